"""What a pass is drawn to, and how its samples become pixels: 32-bit float colour and depth, averaged in linear light.

With hardware samples and moved passes together a plain average would widen the filter: sample k of a pass lies at
p_k + jitter, up to half a pixel outside its pixel, and the mean over all jitters would be the box filter convolved with
the device's pattern (on a star, 256 samples so made had the error of 9). The pattern does not depend on the pixel, so
a sample that leaves its pixel on one side belongs to the neighbour there, and the neighbour on the other side has the
one to fill its place: `_Gather` takes it from there. All samples of a pixel are then inside it, at p_k + jitter
modulo the pixel, and their mean over all jitters is the box filter exactly.

Supersampling draws a picture k times as wide and high, whose pixels play the part of sub-pixels in all of this, and
averages k x k of them on the device.
"""

from contextlib import ExitStack
from typing import Any, Protocol

import moderngl
import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.raster.graphics import DEPTH32F, GraphicsContext, GraphicsError, read_shader
from aliasbench.renderers.raster.projection import DepthRule
from aliasbench.renderers.technique import Technique
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import FloatArray

# 32-bit RGBA and depth
_BYTES_PER_SAMPLE = 20


def wrapped_positions(positions: FloatArray, jitter: tuple[float, float]) -> tuple[FloatArray, NDArray[np.int32]]:
    """Return where in its pixel every hardware sample lies once moved, (n, 2), and how many pixels off that is."""
    moved = positions + np.asarray(jitter)
    whole = np.floor(moved)
    return moved - whole, whole.astype(np.int32)


def ssaa_positions(ssaa: int, jitter: tuple[float, float]) -> FloatArray:
    """Return (ssaa^2, 2) places in the pixel of the samples of one supersampled pass (the grid when not moved)."""
    row, column = np.divmod(np.arange(ssaa * ssaa), ssaa)
    out: FloatArray = (np.stack([column, row], axis=-1) + 0.5 + np.asarray(jitter)) / ssaa
    return out


class Target:
    """What passes are drawn to and read from.

    Attributes
    ----------
    size : (width, height)
        Of the picture that is drawn: `ssaa` times the one that is read.
    margin : int
        How many pixels the target is larger than that on each side.
    """

    def __init__(self, context: GraphicsContext, size: tuple[int, int], technique: Technique, rule: DepthRule) -> None:
        self.size = (size[0] * technique.ssaa, size[1] * technique.ssaa)
        moved, samples = technique.sampler != "center", technique.msaa
        self.margin = 1 if moved and samples > 1 else 0
        full = (self.size[0] + 2 * self.margin, self.size[1] + 2 * self.margin)
        limit = min(context.max_size, context.max_texture_size)
        if max(full) > limit:
            larger = f" with ssaa={technique.ssaa}" if technique.ssaa > 1 else ""
            most = limit // technique.ssaa - 2 * self.margin
            raise InputError(f"size {size[0]}x{size[1]}{larger}: this device ({context.renderer}) draws at most {most}")
        self._stages: list[_Stage] = []
        with ExitStack() as made:
            try:
                self._surface = _Surface(context, full, samples, rule, made)
                self._add_stages(context, size, technique, made)
                context.check("making the targets")
            except (moderngl.Error, GraphicsError) as error:
                # what a driver says of lacking memory: an incomplete framebuffer, or an error of its own
                context.gl.clear_errors()
                taken = full[0] * full[1] * samples * _BYTES_PER_SAMPLE / 2**30
                raise InputError(
                    f"size {size[0]}x{size[1]}: this device ({context.renderer}) cannot hold {samples} sample"
                    f"{'s'[: samples > 1]} a pixel of {full[0]}x{full[1]} pixels ({taken:.1f} GiB: {error}); "
                    f"choose a smaller size{' or msaa' * (samples > 1)}{' or ssaa' * (technique.ssaa > 1)}"
                ) from None
            made.pop_all()

    def _add_stages(
        self, context: GraphicsContext, size: tuple[int, int], technique: Technique, made: ExitStack
    ) -> None:
        samples = technique.msaa
        if self.margin:
            self._stages.append(_Gather(context, self._surface, self.size, samples, self.margin, made))
        elif samples > 1:
            self._stages.append(_Resolve(context, self._surface, self.size, made))
        if technique.ssaa > 1:
            source = self._stages[-1].output if self._stages else self._surface
            self._stages.append(_Reduce(context, source, size, technique.ssaa, made))
        self._last = self._stages[-1].output if self._stages else self._surface

    def begin(self, background: tuple[float, float, float]) -> None:
        """Clear the target and make it the one drawn to."""
        self._surface.begin(background)

    def read_into(self, pixels: NDArray[np.float32], jitter: tuple[float, float]) -> None:
        """Write the picture of a pass, drawn with that jitter, into an (h, w, 3) array."""
        for stage in self._stages:
            stage.run(jitter)
        self._last.framebuffer.read_into(pixels, components=3, dtype="f4")

    def release(self) -> None:
        """Free everything."""
        for stage in self._stages:
            stage.release()
        self._surface.release()


class _Image:
    """A picture of one sample a pixel; `made` frees what there is already when the rest cannot be made."""

    def __init__(self, context: GraphicsContext, size: tuple[int, int], made: ExitStack) -> None:
        self.color: Any = context.gl.texture(size, 4, dtype="f4")
        made.callback(self.color.release)
        self.framebuffer = context.gl.framebuffer([self.color])
        made.callback(self.framebuffer.release)

    def release(self) -> None:
        self.framebuffer.release()
        self.color.release()


class _Surface(_Image):
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
        self.framebuffer.use()
        gl = self.framebuffer.ctx
        gl.enable_only(moderngl.DEPTH_TEST)
        gl.depth_func = self._rule.comparison
        self.framebuffer.clear(*background, 1.0, depth=self._rule.empty)

    def release(self) -> None:
        super().release()
        self._depth.release()


class _Stage(Protocol):
    """One step from samples to pixels; its result is in `output`."""

    output: _Image

    def run(self, jitter: tuple[float, float], /) -> None: ...

    def release(self) -> None: ...


class _Resolve:
    """The hardware's own average of the samples of each pixel."""

    def __init__(self, context: GraphicsContext, source: _Image, size: tuple[int, int], made: ExitStack) -> None:
        self._context, self._source = context, source
        self.output = _Image(context, size, made)

    def run(self, _jitter: tuple[float, float], /) -> None:
        self._context.resolve(self._source.framebuffer, self.output.framebuffer)

    def release(self) -> None:
        self.output.release()


class _ScreenStage:
    """A fragment shader over every pixel of the output, reading the source."""

    def __init__(
        self,
        context: GraphicsContext,
        source: _Image,
        size: tuple[int, int],
        made: ExitStack,
        shader: str,
        **constants: int,
    ) -> None:
        self._source = source
        self.output = _Image(context, size, made)
        lines = ["#version 330 core", *(f"#define {name} {value}" for name, value in constants.items()), "#line 1\n"]
        self._program = context.program(
            *("\n".join(lines) + read_shader(name) for name in ("screen.vert.glsl", shader))
        )
        self._screen = context.gl.vertex_array(self._program, [])
        made.callback(self._screen.release)

    def run(self, _jitter: tuple[float, float], /) -> None:
        self.output.framebuffer.use()
        self.output.framebuffer.ctx.enable_only(moderngl.NOTHING)
        self._source.color.use(0)
        self._program["source"] = 0
        self._screen.render(moderngl.TRIANGLES, vertices=3)

    def release(self) -> None:
        self._screen.release()
        self.output.release()


class _Gather(_ScreenStage):
    """The average of the hardware samples that lie in a pixel, whichever pixel they were drawn for."""

    def __init__(
        self,
        context: GraphicsContext,
        source: _Image,
        size: tuple[int, int],
        samples: int,
        margin: int,
        made: ExitStack,
    ) -> None:
        super().__init__(context, source, size, made, "gather.frag.glsl", SAMPLES=samples)
        self._positions, self._margin = context.sample_positions(samples), margin

    def run(self, jitter: tuple[float, float], /) -> None:
        _, off = wrapped_positions(self._positions, jitter)
        self._program["offsets"] = [tuple(p) for p in (self._margin - off).tolist()]
        super().run(jitter)


class _Reduce(_ScreenStage):
    """The average of k x k pixels."""

    def __init__(
        self, context: GraphicsContext, source: _Image, size: tuple[int, int], ssaa: int, made: ExitStack
    ) -> None:
        super().__init__(context, source, size, made, "reduce.frag.glsl", SSAA=ssaa)
