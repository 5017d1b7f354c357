"""What is done to a finished picture: antialiasing that looks at pixels and not at the scene.

A finished picture is what the technique makes without it: filtered, averaged, linear and 32-bit float. Where there is
one pass it never leaves the device; the mean of several is made on the host and goes back. Edges are looked for in
what the eye sees, sRGB-encoded luminance up to white, and colours are mixed in linear light, so that what is not at an
edge keeps its value to the bit, however bright.

The device draws at once what is processed at once: a pixel may depend on others dozens of pixels away.
"""

from contextlib import ExitStack
from typing import Protocol

import moderngl
import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.raster.filtering import Optics
from aliasbench.renderers.raster.graphics import GraphicsContext, GraphicsError
from aliasbench.renderers.raster.stages import Image, ScreenStage
from aliasbench.renderers.raster.targets import Target, make_layout
from aliasbench.renderers.technique import Technique
from aliasbench.scenes.errors import InputError


class Filter(Protocol):
    """What makes one picture of another."""

    output: Image

    def run(self, scale: float, /) -> None:
        """Do it for the source, whose values count `scale` times."""
        ...

    def release(self) -> None:
        """Free what it holds."""
        ...


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
    """A fragment shader over every pixel of a picture, which looks at `source` and at other pictures by name."""

    def __init__(
        self,
        context: GraphicsContext,
        source: Image,
        size: tuple[int, int],
        made: ExitStack,
        shader: str,
        components: int = 4,
        **others: Image,
    ) -> None:
        super().__init__(context, source, size, made, shader, components=components)
        self._others = others

    def apply(self, scale: float = 1.0) -> None:
        """Do it for the source, whose values count `scale` times."""
        if "scale" in self._program:
            self._program["scale"] = scale
        for unit, (name, image) in enumerate(self._others.items(), start=1):
            image.color.use(unit)
            self._program[name] = unit
        self.run((0.0, 0.0))


class Fxaa:
    """FXAA 3.11 (Lottes 2011), quality preset 39; see `fxaa.frag.glsl`."""

    def __init__(self, context: GraphicsContext, source: Image, size: tuple[int, int], made: ExitStack) -> None:
        self._luma = PostStage(context, source, size, made, "luma.frag.glsl", 1)
        self._blend = PostStage(context, source, size, made, "fxaa.frag.glsl", lumas=self._luma.output)
        self.output = self._blend.output

    def run(self, scale: float, /) -> None:
        """See `Filter`."""
        self._luma.apply(scale)
        self._blend.apply(scale)

    def release(self) -> None:
        """See `Filter`."""
        self._luma.release()
        self._blend.release()


class Smaa:
    """SMAA 1x (Jimenez et al. 2012) with its finest thresholds: luma edges, orthogonal patterns and sharp corners."""

    def __init__(self, context: GraphicsContext, source: Image, size: tuple[int, int], made: ExitStack) -> None:
        luma = PostStage(context, source, size, made, "luma.frag.glsl", 1)
        edges = PostStage(context, luma.output, size, made, "smaa_edges.frag.glsl", 2)
        areas = PostStage(context, edges.output, size, made, "smaa_areas.frag.glsl")
        blend = PostStage(context, source, size, made, "smaa_blend.frag.glsl", areas=areas.output)
        self._steps = (luma, edges, areas, blend)
        self.output = blend.output

    def run(self, scale: float, /) -> None:
        """See `Filter`."""
        for step in self._steps:
            step.apply(scale)

    def release(self) -> None:
        """See `Filter`."""
        for step in self._steps:
            step.release()


_FILTERS = {"fxaa": Fxaa, "smaa": Smaa}


class Post:
    """The processing that a technique asks for, of pictures of one size."""

    def __init__(self, context: GraphicsContext, technique: Technique, target: Target, size: tuple[int, int]) -> None:
        self._uploaded: Uploaded | None = None
        with ExitStack() as made:
            try:
                if technique.passes > 1:
                    self._uploaded = Uploaded(context, size, made)
                self._filter: Filter = _FILTERS[technique.post](context, self._uploaded or target.output, size, made)
                context.check("making the pictures to process")
            except (moderngl.Error, GraphicsError) as error:
                context.gl.clear_errors()
                raise InputError(
                    f"size {size[0]}x{size[1]} with post={technique.post}: this device ({context.renderer}) cannot "
                    f"hold the pictures that takes ({error}); choose a smaller size"
                ) from None
            made.pop_all()

    def run(self, scale: float, pixels: NDArray[np.float32] | None) -> None:
        """Process what was drawn, times `scale`, or the (h, w, 3) picture given instead."""
        if self._uploaded is not None and pixels is not None:
            self._uploaded.write(pixels)
        self._filter.run(scale)

    def read_into(self, pixels: NDArray[np.float32]) -> None:
        """Write the processed picture into an (h, w, 3) array."""
        self._filter.output.framebuffer.read_into(pixels, components=3, dtype="f4")

    def release(self) -> None:
        """Free everything."""
        self._filter.release()
        if self._uploaded is not None:
            self._uploaded.release()


def check_whole(context: GraphicsContext, size: tuple[int, int], technique: Technique, optics: Optics) -> None:
    """Raise InputError for a picture that cannot be drawn at once; the message names the largest of that shape."""

    def fits(width: int) -> tuple[int, int] | None:
        shape = (width, max(1, width * size[1] // size[0]))
        return shape if make_layout(context, shape, technique, optics).part == shape else None

    if fits(size[0]) == size:
        return
    low, high = 1, size[0]
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if fits(middle) else (low, middle)
    width, height = fits(low) or (1, 1)
    raise InputError(
        f"size {size[0]}x{size[1]} with post={technique.post}: processing needs the picture in one part, and this "
        f"device ({context.renderer}) draws at most {width}x{height} of that shape at once"
    )
