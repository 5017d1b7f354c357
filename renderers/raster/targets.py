"""What a pass is drawn to and read from: 32-bit float colour and depth, made into pixels in linear light (`stages`).

Supersampling draws a picture k times as wide and high, whose pixels play the part of sub-pixels throughout. Samples
that count in other pixels than their own need pixels around the picture: the target has a margin for them.
"""

from contextlib import ExitStack
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.raster.filtering import Optics
from aliasbench.renderers.raster.graphics import DEPTH32F, GraphicsContext, GraphicsError
from aliasbench.renderers.raster.projection import DepthRule
from aliasbench.renderers.raster.stages import Axis, Gather, Image, Reduce, Resolve, Stage, Taps
from aliasbench.renderers.technique import Technique
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import FloatArray

# 32-bit RGBA and depth
_BYTES_PER_SAMPLE = 20
# Of one target: larger pictures are drawn in parts.
_MOST_BYTES = 1 << 30


def ssaa_positions(ssaa: int, jitter: tuple[float, float]) -> FloatArray:
    """Return (ssaa^2, 2) places in the pixel of the samples of one supersampled pass (the grid when not moved)."""
    row, column = np.divmod(np.arange(ssaa * ssaa), ssaa)
    out: FloatArray = (np.stack([column, row], axis=-1) + 0.5 + np.asarray(jitter)) / ssaa
    return out


class Layout(NamedTuple):
    """How a picture is cut into parts that a device can draw.

    Attributes
    ----------
    part : (width, height)
        Of every part, in pixels of the picture; the last ones may reach beyond it.
    margin : int
        Drawn pixels around a part.
    ssaa : int
        Drawn pixels a pixel, in each direction.
    """

    part: tuple[int, int]
    margin: int
    ssaa: int

    @property
    def full(self) -> tuple[int, int]:
        """Width and height of what is drawn of a part."""
        return (self.part[0] * self.ssaa + 2 * self.margin, self.part[1] * self.ssaa + 2 * self.margin)

    def corners(self, size: tuple[int, int]) -> list[tuple[int, int]]:
        """Return (left, top) of all parts of a picture."""
        return [(x, y) for y in range(0, size[1], self.part[1]) for x in range(0, size[0], self.part[0])]


def make_layout(context: GraphicsContext, size: tuple[int, int], technique: Technique, optics: Optics) -> Layout:
    """Return how to draw a picture: at once where the device can.

    Raises
    ------
    InputError
        If the margin or the sub-pixels alone are more than the device can draw.
    """
    samples, ssaa = technique.msaa, technique.ssaa
    moved = technique.sampler != "center" and samples > 1
    margin = optics.margin * ssaa if optics.is_weighted else 0
    if moved:
        margin += ssaa if optics.is_weighted else 1
    limit = (min(context.max_size, context.max_texture_size) - 2 * margin) // ssaa
    if limit < 1:
        raise InputError(
            f"ssaa={ssaa} with {margin} drawn pixels around: this device ({context.renderer}) draws at most "
            f"{min(context.max_size, context.max_texture_size)} pixels across"
        )
    # parts of even sizes: drivers take derivatives over 2 x 2 pixels, which then are the same as in one piece
    width, height = (side if side <= limit else max(limit & ~1, 1) for side in size)
    while True:
        layout = Layout((width, height), margin, ssaa)
        full = layout.full
        if full[0] * full[1] * samples * _BYTES_PER_SAMPLE <= _MOST_BYTES or width * height == 1:
            return layout
        width, height = (_half(width), height) if width > height else (width, _half(height))


def _half(side: int) -> int:
    """Return half of a side, rounded up to an even number where there is one below it."""
    return min(2 * -(-side // 4), side - 1)


class Target:
    """What parts of a picture are drawn to and read from."""

    def __init__(
        self, context: GraphicsContext, layout: Layout, technique: Technique, rule: DepthRule, optics: Optics
    ) -> None:
        self._stages: list[Stage] = []
        full, samples = layout.full, technique.msaa
        with ExitStack() as made:
            try:
                self._surface = Surface(context, full, samples, rule, made)
                self._add_stages(context, layout, technique, optics, made)
                context.check("making the targets")
            except (moderngl.Error, GraphicsError) as error:
                # what a driver says of lacking memory: an incomplete framebuffer, or an error of its own
                context.gl.clear_errors()
                taken = full[0] * full[1] * samples * _BYTES_PER_SAMPLE / 2**30
                raise InputError(
                    f"size {layout.part[0]}x{layout.part[1]}: this device ({context.renderer}) cannot hold {samples} "
                    f"sample{'s'[: samples > 1]} a pixel of {full[0]}x{full[1]} pixels ({taken:.1f} GiB: {error}); "
                    f"choose a smaller size{' or msaa' * (samples > 1)}{' or ssaa' * (technique.ssaa > 1)}"
                ) from None
            made.pop_all()

    def _add_stages(
        self, context: GraphicsContext, layout: Layout, technique: Technique, optics: Optics, made: ExitStack
    ) -> None:
        samples, ssaa, margin, part = technique.msaa, technique.ssaa, layout.margin, layout.part
        source: Image = self._surface
        if optics.is_weighted and (samples > 1 or not optics.spec.kind.separable):
            self._stages.append(Taps(context, source, part, samples, optics, ssaa, margin, made))
        elif optics.is_weighted:
            self._stages.append(Axis(context, source, (part[0], layout.full[1]), 0, optics, ssaa, made))
            self._stages.append(Axis(context, self._stages[-1].output, part, 1, optics, ssaa, made))
        else:
            drawn = (part[0] * ssaa, part[1] * ssaa)
            if margin:
                self._stages.append(Gather(context, source, drawn, samples, margin, made))
            elif samples > 1:
                self._stages.append(Resolve(context, source, drawn, made))
            if ssaa > 1:
                source = self._stages[-1].output if self._stages else source
                self._stages.append(Reduce(context, source, part, ssaa, made))
        self.output: Image = self._stages[-1].output if self._stages else self._surface

    def begin(self, background: tuple[float, float, float]) -> None:
        """Clear the target and make it the one drawn to."""
        self._surface.begin(background)

    def finish(self, jitter: tuple[float, float]) -> float:
        """Make the pixels of a pass, drawn with that jitter, in `output`; return the sum of its samples' weights."""
        weight = 1.0
        for stage in self._stages:
            weight *= stage.run(jitter)
        return weight

    def read_into(self, pixels: NDArray[np.float32]) -> None:
        """Write `output` into an (h, w, 3) array."""
        self.output.framebuffer.read_into(pixels, components=3, dtype="f4")

    def release(self) -> None:
        """Free everything."""
        for stage in self._stages:
            stage.release()
        self._surface.release()


class Surface(Image):
    """Colour and depth of one size and number of samples."""

    def __init__(
        self, context: GraphicsContext, size: tuple[int, int], samples: int, rule: DepthRule, made: ExitStack
    ) -> None:
        gl = context.gl
        self._rule = rule
        # moderngl wants all attachments to be made with one number of samples, and knows no 32-bit float depth
        made_with = 0 if samples == 1 else samples
        self.color = gl.texture(size, 4, dtype="f4", samples=made_with)
        made.callback(self.color.release)
        self._depth = gl.depth_renderbuffer(size, samples=made_with)
        made.callback(self._depth.release)
        context.store(self._depth, size, samples, DEPTH32F)
        self.framebuffer = gl.framebuffer([self.color], self._depth)
        made.callback(self.framebuffer.release)

    def begin(self, background: tuple[float, float, float]) -> None:
        """Clear it and make it the one drawn to."""
        self.framebuffer.use()
        gl = self.framebuffer.ctx
        gl.enable_only(moderngl.DEPTH_TEST)
        gl.depth_func = self._rule.comparison
        self.framebuffer.clear(*background, 1.0, depth=self._rule.empty)

    def release(self) -> None:
        """Free it."""
        super().release()
        self._depth.release()
