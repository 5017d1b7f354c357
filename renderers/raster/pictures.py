"""Pictures that are processed after they are finished, and the steps that make one of several."""

from collections.abc import Mapping
from contextlib import ExitStack
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.raster.graphics import GraphicsContext
from aliasbench.renderers.raster.stages import Image, ScreenStage


class Uploaded(Image):
    """A picture that comes from the host."""

    def __init__(self, context: GraphicsContext, size: tuple[int, int], made: ExitStack) -> None:
        # nothing is drawn to it: devices need not be able to, with three components
        self.color = context.gl.texture(size, 3, dtype="f4")
        made.callback(self.color.release)

    def write(self, pixels: NDArray[np.float32]) -> None:
        """Make it that (h, w, 3) picture."""
        self.color.write(np.ascontiguousarray(pixels, dtype=np.float32))

    def release(self) -> None:
        """Free it."""
        self.color.release()


class PostStage(ScreenStage):
    """A fragment shader over every pixel of a picture, which looks at `source` and at other pictures by name.

    Attributes
    ----------
    others : dict of str to Image
    settings : dict
        Other uniforms, by name.
    """

    def __init__(
        self,
        context: GraphicsContext,
        source: Image,
        size: tuple[int, int],
        made: ExitStack,
        shader: str,
        components: int = 4,
        constants: Mapping[str, int] = MappingProxyType({}),
        **others: Image,
    ) -> None:
        super().__init__(context, source, size, made, shader, components=components, **constants)
        self.others = others
        self.settings: dict[str, bool | int] = {}

    def apply(self, scale: float = 1.0) -> None:
        """Do it for the source, whose values count `scale` times."""
        if "scale" in self._program:
            self._program["scale"] = scale
        for unit, (name, image) in enumerate(self.others.items(), start=1):
            image.color.use(unit)
            self._program[name] = unit
        for name, value in self.settings.items():
            self._program[name] = value
        self.run((0.0, 0.0))
