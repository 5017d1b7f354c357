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
from aliasbench.renderers.raster.pictures import PostStage, Uploaded
from aliasbench.renderers.raster.placement import Placement
from aliasbench.renderers.raster.stages import Image, Jitter
from aliasbench.renderers.raster.taa import REPLAYED, Taa, halton_place
from aliasbench.renderers.raster.targets import Target, make_layout
from aliasbench.renderers.technique import Technique
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Scene

# in fxaa.frag.glsl: at how many distances ends of edges are looked for
_STOPS = 11


class Filter(Protocol):
    """What makes one picture of another; its result is in `output`."""

    output: Image

    def run(self, scale: float, /) -> None:
        """Do it for the source, whose values count `scale` times."""
        ...

    def release(self) -> None:
        """Free what it holds."""
        ...


class Fxaa:
    """FXAA 3.11 (Lottes 2011), quality preset 39; see `fxaa.frag.glsl`."""

    def __init__(self, context: GraphicsContext, source: Image, size: tuple[int, int], made: ExitStack) -> None:
        self._luma = PostStage(context, source, size, made, "luma.frag.glsl", 1)
        self._blend = PostStage(context, source, size, made, "fxaa.frag.glsl", lumas=self._luma.output)
        self._blend.settings["stops"] = _STOPS
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


_FILTERS: dict[str, type[Fxaa] | type[Smaa]] = {"fxaa": Fxaa, "smaa": Smaa}


class Post:
    """The processing that a technique asks for, of pictures of one size; those that are `summed` come from the host."""

    def __init__(
        self,
        context: GraphicsContext,
        scene: Scene,
        placement: Placement,
        technique: Technique,
        target: Target,
        size: tuple[int, int],
        *,
        summed: bool,
    ) -> None:
        self._uploaded: Uploaded | None = None
        with ExitStack() as made:
            try:
                if summed:
                    self._uploaded = Uploaded(context, size, made)
                source = self._uploaded or target.output
                self._taa: Taa | None = None
                if technique.post == "taa":
                    self._taa = Taa(context, scene, placement, technique, source, size, made)
                self._filter: Filter = self._taa or _FILTERS[technique.post](context, source, size, made)
                context.check("making the pictures to process")
            except (moderngl.Error, GraphicsError) as error:
                context.gl.clear_errors()
                raise InputError(
                    f"size {size[0]}x{size[1]} with post={technique.post}: this device ({context.renderer}) cannot "
                    f"hold the pictures that takes ({error}); choose a smaller size"
                ) from None
            made.pop_all()
        # what the history is of, when it is whole: the first frame and the seed, and the last frame
        self._history: tuple[int, int] = (0, 0)
        self._latest: int | None = None

    def frames(self, frame: int, seed: int) -> range:
        """Return the frames to be drawn and processed, one after the other, for one: those it depends on come first.

        What the last call has left is gone on from where that gives the same picture.
        """
        history = (frame if self._taa is None else max(0, frame - REPLAYED), seed)
        goes_on = history == self._history and self._latest is not None and self._latest < frame
        first = self._latest + 1 if goes_on and self._latest is not None else history[0]
        self._history, self._latest = history, None
        return range(first, frame + 1)

    def place(self, frame: int) -> Jitter:
        """Return by how much of a pixel, right and down, a frame's picture is to be moved."""
        return (0.0, 0.0) if self._taa is None else halton_place(frame)

    def run(self, frame: int, scale: float, pixels: NDArray[np.float32]) -> None:
        """Process what was drawn of a frame, times `scale`; of several passes the (h, w, 3) picture given instead."""
        if self._uploaded is not None:
            self._uploaded.write(pixels)
        if self._taa is not None:
            self._taa.begin(frame, is_first=frame == self._history[0])
        self._filter.run(scale)
        self._latest = frame

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
