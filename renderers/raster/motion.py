"""Where everything in the picture was one frame before: what temporal antialiasing follows surfaces with.

The scene is drawn once more, one sample a pixel, with the matrices of the frame before at hand. Both sets of matrices
are of the shutter's middle and of the lens's: what a frame blurs is blurred about there.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import ClassVar

import moderngl
import numpy as np

from aliasbench.renderers.geometry import Body
from aliasbench.renderers.raster.graphics import DEPTH32F, GraphicsContext
from aliasbench.renderers.raster.guard import BoolArray, Guard, Pieces
from aliasbench.renderers.raster.pipeline import SceneBuffers, _Batch
from aliasbench.renderers.raster.placement import Placement
from aliasbench.renderers.raster.projection import DepthRule, Instant, Window, clip_matrices, layer_tilts, pack_matrices
from aliasbench.renderers.raster.stages import Image, Jitter
from aliasbench.renderers.technique import Technique
from aliasbench.scenes.model import FloatArray, Scene
from aliasbench.scenes.motion import shutter_fraction

# relative; a body that moves by less in a frame stands still: a whole number of turns may round so
_STANDS = 1e-9
# beyond what float32 holds
_HUGE = 1e36


class MotionTarget:
    """What is seen in each pixel: its motion and depths, and which surface it is; see `motion.frag.glsl`."""

    def __init__(self, context: GraphicsContext, size: tuple[int, int], rule: DepthRule, made: ExitStack) -> None:
        gl = context.gl
        self._rule = rule
        self.motions, self.surfaces = Image(context, size, made), Image(context, size, made, components=2)
        self._depth = gl.depth_renderbuffer(size)
        made.callback(self._depth.release)
        context.store(self._depth, size, 1, DEPTH32F)
        self._framebuffer = gl.framebuffer([self.motions.color, self.surfaces.color], self._depth)
        made.callback(self._framebuffer.release)

    def begin(self) -> None:
        """Clear it and make it the one drawn to."""
        self._framebuffer.use()
        gl = self._framebuffer.ctx
        gl.enable_only(moderngl.DEPTH_TEST)
        gl.depth_func = self._rule.comparison
        self._framebuffer.clear(depth=self._rule.empty)

    def release(self) -> None:
        """Free it."""
        self._framebuffer.release()
        self._depth.release()
        self.motions.release()
        self.surfaces.release()


class MotionBuffers(SceneBuffers):
    """A scene's bodies, drawn as how far they moved."""

    shaders: ClassVar[tuple[str, str]] = ("motion.vert.glsl", "motion.frag.glsl")
    answers_light: ClassVar[bool] = False

    def __init__(
        self,
        context: GraphicsContext,
        scene: Scene,
        bodies: Sequence[Body],
        technique: Technique,
        size: tuple[int, int],
        made: ExitStack,
    ) -> None:
        # only holes in images matter, and those of the finest level
        super().__init__(context, scene, bodies, replace(technique, texture="point", alpha_to_coverage=False), size)
        self._owners = [np.unique(b.surfaces) for b in bodies]
        self._before = context.gl.texture((self._matrices.width, self._matrices.height), 4, dtype="f4")
        self._before.filter = (moderngl.NEAREST, moderngl.NEAREST)
        made.callback(self.release)
        self._moves: tuple[FloatArray, FloatArray] = (np.zeros((0, 4, 4)), np.zeros((0, 4, 4)))

    def draw_moved(
        self, matrices: FloatArray, before: FloatArray, tilts: FloatArray, size: tuple[int, int], guard: Guard
    ) -> None:
        """Draw into the bound target every body with its matrix (n, 4, 4) now and in the frame before."""
        self._moves = (matrices, before)
        packed = pack_matrices(before, self._row_length, self._before.height)
        self._before.write(packed.tobytes())
        self._before.use(2)
        for batch in self._batches:
            batch.array.program["before"] = 2
            batch.array.program["half_size"] = (size[0] / 2, size[1] / 2)
            batch.array.program["is_piece"] = False
        far = guard.far_objects(matrices)
        if far.any():
            self.draw(matrices, tilts, guard.cut(matrices, far), far)
        else:
            self.draw(matrices, tilts)

    def _draw_pieces(self, batch: _Batch, pieces: Pieces, first: int) -> None:
        program = batch.array.program
        program["is_piece"] = True
        for number, (owned, now, before) in enumerate(zip(self._owners, *self._moves, strict=True)):
            mine: BoolArray = np.isin(pieces.surfaces, owned)
            if mine.any():
                carried = _carry(now, before)
                moves = not np.array_equal(now[[0, 1, 3]], before[[0, 1, 3]])
                program["carried"] = tuple(carried.T.astype(np.float32).ravel().tolist())
                program["piece_surface"] = float(number + 1) * (-1.0 if moves else 1.0)
                super()._draw_pieces(batch, _some(pieces, mine), first)
        program["is_piece"] = False

    def release(self) -> None:
        """Free everything on the device."""
        super().release()
        self._before.release()


def _some(pieces: Pieces, chosen: BoolArray) -> Pieces:
    return replace(
        pieces,
        corners=pieces.corners[chosen],
        uv=pieces.uv[chosen],
        nearest=pieces.nearest[chosen],
        surfaces=pieces.surfaces[chosen],
        triangles=pieces.triangles[chosen],
        bodies=pieces.bodies[chosen],
    )


def _stands(now: FloatArray, before: FloatArray) -> BoolArray:
    """Return which of (n, 4, 4) clip matrices are those of a frame before, up to the unit of depth."""
    out: BoolArray = np.ones(len(now), dtype=bool)
    a, b = now.copy(), before.copy()
    for m in (a, b):
        length = np.linalg.norm(m[:, 2, :3], axis=1)
        # under perspective, depth has no row of its own
        m[:, 2] /= np.where(length > 0.0, length, np.inf)[:, None]
    for row in range(4):
        largest = np.abs(a[:, row]).max(axis=1, initial=0.0)
        out &= np.abs(b[:, row] - a[:, row]).max(axis=1, initial=0.0) <= _STANDS * largest
    return out


def _carry(now: FloatArray, before: FloatArray) -> FloatArray:
    """Return the (4, 4) matrix from a body's clip space now to that of the frame before; nowhere if it is flat."""
    if np.array_equal(now[[0, 1, 3]], before[[0, 1, 3]]):
        main = np.argmax(np.abs(now[2]))
        return np.diag([1.0, 1.0, before[2, main] / now[2, main] if now[2, main] else 1.0, 1.0])
    try:
        out: FloatArray = before @ np.linalg.inv(now)
    except np.linalg.LinAlgError:
        return np.zeros((4, 4))
    return out if np.abs(out).max() < _HUGE else np.zeros((4, 4))


class Motion:
    """The motions of a prepared scene, drawn frame by frame; the last two stay at hand."""

    def __init__(
        self,
        context: GraphicsContext,
        scene: Scene,
        placement: Placement,
        technique: Technique,
        size: tuple[int, int],
        rule: DepthRule,
        made: ExitStack,
    ) -> None:
        self._scene, self._placement, self._size = scene, placement, size
        self._interpolated = technique.motion == "matrix"
        self._buffers = MotionBuffers(context, scene, placement.bodies, technique, size, made)
        self.now, self.before = (MotionTarget(context, size, rule, made) for _ in range(2))
        self._guard = Guard(scene, placement, size)

    def draw(self, frame: int, jitter: Jitter) -> bool:
        """Draw the motion from the frame before to this one into `now`; return whether everything stands still."""
        self.now, self.before = self.before, self.now
        matrices, before = (self._matrices(f, jitter) for f in (frame, frame - 1))
        stands = _stands(matrices, before)
        for row in (0, 1, 3):
            before[stands, row] = matrices[stands, row]
        self.now.begin()
        tilts = layer_tilts(self._scene, self._placement, self._instant(frame, jitter), self._size)
        self._buffers.draw_moved(matrices, before, tilts, self._size, self._guard)
        return bool(stands.all())

    def _instant(self, frame: int, jitter: Jitter) -> Instant:
        fraction = shutter_fraction(self._scene.animation, 0.5)
        return Instant(frame, fraction, jitter, interpolated=self._interpolated)

    def _matrices(self, frame: int, jitter: Jitter) -> FloatArray:
        instant = self._instant(frame, jitter)
        return clip_matrices(self._scene, self._placement, instant, size=self._size, window=Window(0, 0, *self._size))

    def release(self) -> None:
        """Free everything."""
        self._buffers.release()
        self.now.release()
        self.before.release()
