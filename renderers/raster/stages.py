"""From what was drawn to the picture: averages of hardware samples and sub-pixels, and filters, as steps on the device.

With hardware samples and moved passes together a plain average would widen the filter: sample k of a pass lies at
p_k + jitter, up to half a pixel outside its pixel, and the mean over all jitters would be the box filter convolved with
the device's pattern (on a star, 256 samples so made had the error of 9). The pattern does not depend on the pixel, so
a sample that leaves its pixel on one side belongs to the neighbour there, and the neighbour on the other side has the
one to fill its place: `Gather` takes it from there. All samples of a pixel are then inside it, at p_k + jitter
modulo the pixel, and their mean over all jitters is the box filter exactly.

A step that weights samples returns what the weights add up to; the others give means and return 1.
"""

from contextlib import ExitStack
from typing import Any, Protocol

import moderngl
import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.raster.filtering import Optics, plane_weights, profile_weights
from aliasbench.renderers.raster.graphics import GraphicsContext, read_shader
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import FloatArray

_TAPS_PER_ROW = 1024  # as in taps.frag.glsl
_TAPS_AT_ONCE = 1 << 14
_MOST_TAPS = 1 << 22

Jitter = tuple[float, float]


def wrapped_positions(positions: FloatArray, jitter: Jitter) -> tuple[FloatArray, NDArray[np.int32]]:
    """Return where in its pixel every hardware sample lies once moved, (n, 2), and how many pixels off that is."""
    moved = positions + np.asarray(jitter)
    whole = np.floor(moved)
    return moved - whole, whole.astype(np.int32)


class Image:
    """A picture of one sample a pixel; `made` frees what there is already when the rest cannot be made."""

    def __init__(self, context: GraphicsContext, size: tuple[int, int], made: ExitStack, components: int = 4) -> None:
        self.color: Any = context.gl.texture(size, components, dtype="f4")
        made.callback(self.color.release)
        self.framebuffer = context.gl.framebuffer([self.color])
        made.callback(self.framebuffer.release)

    def release(self) -> None:
        """Free it."""
        self.framebuffer.release()
        self.color.release()


class Stage(Protocol):
    """One step from samples to pixels; its result is in `output`."""

    output: Image

    def run(self, jitter: Jitter, /) -> float:
        """Do it for what was drawn with that jitter, in drawn pixels; return the sum of the weights."""
        ...

    def release(self) -> None:
        """Free what it holds."""
        ...


class Resolve:
    """The hardware's own average of the samples of each pixel."""

    def __init__(self, context: GraphicsContext, source: Image, size: tuple[int, int], made: ExitStack) -> None:
        self._context, self._source = context, source
        self.output = Image(context, size, made)

    def run(self, _jitter: Jitter, /) -> float:
        """See `Stage`."""
        self._context.resolve(self._source.framebuffer, self.output.framebuffer)
        return 1.0

    def release(self) -> None:
        """See `Stage`."""
        self.output.release()


class ScreenStage:
    """A fragment shader over every pixel of the output, reading the source."""

    def __init__(
        self,
        context: GraphicsContext,
        source: Image,
        size: tuple[int, int],
        made: ExitStack,
        shader: str,
        components: int = 4,
        **constants: int,
    ) -> None:
        self._source = source
        self.output = Image(context, size, made, components)
        lines = ["#version 330 core", *(f"#define {name} {value}" for name, value in constants.items()), "#line 1\n"]
        self._program = context.program(
            *("\n".join(lines) + read_shader(name) for name in ("screen.vert.glsl", shader))
        )
        self._screen = context.gl.vertex_array(self._program, [])
        made.callback(self._screen.release)

    def run(self, _jitter: Jitter, /) -> float:
        """See `Stage`."""
        self._begin()
        self._screen.render(moderngl.TRIANGLES, vertices=3)
        return 1.0

    def _begin(self) -> None:
        """Make the output the target and the source what is read."""
        self.output.framebuffer.use()
        self.output.framebuffer.ctx.enable_only(moderngl.NOTHING)
        self._source.color.use(0)
        self._program["source"] = 0

    def release(self) -> None:
        """See `Stage`."""
        self._screen.release()
        self.output.release()


class Gather(ScreenStage):
    """The average of the hardware samples that lie in a pixel, whichever pixel they were drawn for."""

    def __init__(
        self,
        context: GraphicsContext,
        source: Image,
        size: tuple[int, int],
        samples: int,
        margin: int,
        made: ExitStack,
    ) -> None:
        super().__init__(context, source, size, made, "gather.frag.glsl", SAMPLES=samples)
        self._positions, self._margin = context.sample_positions(samples), margin

    def run(self, jitter: Jitter, /) -> float:
        """See `Stage`."""
        _, off = wrapped_positions(self._positions, jitter)
        self._program["offsets"] = [tuple(p) for p in (self._margin - off).tolist()]
        return super().run(jitter)


class Reduce(ScreenStage):
    """The average of k x k pixels."""

    def __init__(
        self, context: GraphicsContext, source: Image, size: tuple[int, int], ssaa: int, made: ExitStack
    ) -> None:
        halved = ssaa % 2 == 0 and all(side & (side - 1) == 0 for side in source.color.size)
        super().__init__(context, source, size, made, "reduce.frag.glsl", SSAA=ssaa, BLOCK=2 if halved else 1)
        if halved:
            source.color.filter = (moderngl.LINEAR, moderngl.LINEAR)


class Axis(ScreenStage):
    """A separable filter along one axis (0 across, 1 down), over a target with the filter's margin."""

    def __init__(
        self,
        context: GraphicsContext,
        source: Image,
        size: tuple[int, int],
        axis: int,
        optics: Optics,
        ssaa: int,
        made: ExitStack,
    ) -> None:
        taps = (2 * optics.margin + 1) * ssaa
        super().__init__(context, source, size, made, "axis.frag.glsl", AXIS=axis, SSAA=ssaa, TAPS=taps)
        self._axis, self._optics, self._ssaa = axis, optics, ssaa
        self._weights = context.gl.texture((taps, 1), 1, dtype="f4")
        made.callback(self._weights.release)

    def run(self, jitter: Jitter, /) -> float:
        """See `Stage`."""
        weights = profile_weights(self._optics, self._ssaa, jitter[self._axis]).astype(np.float32)
        self._weights.write(weights)
        self._weights.use(1)
        self._program["weights"] = 1
        super().run(jitter)
        return float(weights.sum(dtype=np.float64))

    def release(self) -> None:
        """See `Stage`."""
        super().release()
        self._weights.release()


class Taps(ScreenStage):
    """Any filter, over single samples of a target with `margin` drawn pixels on each side."""

    def __init__(
        self,
        context: GraphicsContext,
        source: Image,
        size: tuple[int, int],
        samples: int,
        optics: Optics,
        ssaa: int,
        margin: int,
        made: ExitStack,
    ) -> None:
        most = samples * (2 * margin + ssaa) ** 2
        if most > _MOST_TAPS:
            raise InputError(
                f"filter={optics.spec.name},radius={optics.spec.radius:g}: {most} samples a pixel would have to be "
                f"weighted in each pass; up to {_MOST_TAPS} can be. Use a smaller radius, or passes in place of "
                "msaa and ssaa"
            )
        super().__init__(context, source, size, made, "taps.frag.glsl", SAMPLES=samples, SSAA=ssaa)
        self._positions = context.sample_positions(samples) - 0.5
        self._optics, self._ssaa, self._margin = optics, ssaa, margin
        self._taps = context.gl.texture((_TAPS_PER_ROW, -(-most // _TAPS_PER_ROW)), 4, dtype="f4")
        self._room = np.zeros((self._taps.height * _TAPS_PER_ROW, 4), np.float32)
        made.callback(self._taps.release)

    def run(self, jitter: Jitter, /) -> float:
        """See `Stage`."""
        taps = plane_weights(self._optics, self._ssaa, self._positions + np.asarray(jitter), self._margin // self._ssaa)
        self._room[: len(taps)] = taps
        self._taps.write(self._room)
        self._taps.use(1)
        self._begin()
        self._program["taps"], self._program["margin"] = 1, self._margin
        gl = self.output.framebuffer.ctx
        for first in range(0, len(taps), _TAPS_AT_ONCE):
            self._program["first"], self._program["after"] = first, min(first + _TAPS_AT_ONCE, len(taps))
            self._screen.render(moderngl.TRIANGLES, vertices=3)
            gl.enable_only(moderngl.BLEND)
            gl.blend_func = moderngl.ONE, moderngl.ONE
        gl.enable_only(moderngl.NOTHING)
        return float(self._room[: len(taps), 3].sum(dtype=np.float64))

    def release(self) -> None:
        """See `Stage`."""
        super().release()
        self._taps.release()
