"""The rasterizer: MSAA, supersampling, mipmapped minification and an accumulation buffer over all sample dimensions.

An accumulation pass is one sample index of the shared pattern, the same for all pixels: it draws the whole scene with
the picture shifted by that sample's place in the pixel, at that sample's time in the shutter, from its point of the
lens (`exposures`). Passes are summed in float64 on the host: blending into a float target is no faster, and less exact.
Pictures larger than the device can draw are drawn in parts.
"""

import weakref
from collections.abc import Callable
from contextlib import ExitStack
from time import perf_counter
from types import TracebackType
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aliasbench.renderers.frame import Frame, Progress
from aliasbench.renderers.geometry import build_bodies
from aliasbench.renderers.lights import with_lights
from aliasbench.renderers.raster.context import acquire_context, check_samples
from aliasbench.renderers.raster.exposures import Exposure, Exposures
from aliasbench.renderers.raster.filtering import make_optics
from aliasbench.renderers.raster.gloss import check_gloss
from aliasbench.renderers.raster.graphics import GraphicsContext
from aliasbench.renderers.raster.guard import Guard
from aliasbench.renderers.raster.pipeline import SceneBuffers
from aliasbench.renderers.raster.placement import make_placement
from aliasbench.renderers.raster.post import Post, check_whole
from aliasbench.renderers.raster.projection import (
    MOST_DISTANT,
    Instant,
    Window,
    clip_matrices,
    depth_rule,
    layer_tilts,
    pass_view,
)
from aliasbench.renderers.raster.targets import Target, make_layout
from aliasbench.renderers.sampling.patterns import sampler_code
from aliasbench.renderers.sampling.warps import IDENTITY
from aliasbench.renderers.technique import Technique
from aliasbench.scenes.errors import InputError, UnsupportedScene
from aliasbench.scenes.model import FloatArray, Scene
from aliasbench.scenes.motion import shutter_fraction

_LEAST_WEIGHT = 1e-9  # of a pass, on average: less is rounding


def prepare_raster(scene: Scene, technique: Technique, size: tuple[int, int]) -> "RasterScene":
    """Return the scene on the graphics device, ready to be drawn; see `renderers.catalog.prepare`.

    Raises
    ------
    NotAvailableError
        For a documented technique that the rasterizer does not have yet.
    UnsupportedScene
        For what the scene has and the rasterizer does not draw.
    InputError
        If the device lacks the hardware samples asked for or cannot hold a picture of this size, or a number of the
        scene is beyond 32-bit graphics.
    NoContextError
        If there is no OpenGL here; the message lists what was tried.
    """
    _check_available(scene, technique)
    _check_range(scene)
    start = perf_counter()
    context = acquire_context(technique.backend, technique.device)
    check_samples(context, technique.msaa)
    return RasterScene(context, scene, technique, size, start)


def _check_available(scene: Scene, technique: Technique) -> None:
    sampler_code(technique.sampler)
    _check_drawn(scene)


def _check_drawn(scene: Scene) -> None:
    """Raise UnsupportedScene for what of light the rasterizer does not draw."""
    if scene.bounces:
        raise UnsupportedScene(
            f"raster: diffuse interreflection (bounces = {scene.bounces}) is not drawn; direct light alone is"
        )
    check_gloss(scene)
    for index, surface in enumerate(scene.objects):
        if surface.material.kind == "glass":
            raise UnsupportedScene(
                f"raster: material {surface.material.kind} (object {surface.name or f'number {index}'}) is not drawn; "
                "unlit, diffuse and glossy are"
            )


def _check_range(scene: Scene) -> None:
    """Raise InputError for numbers that 32-bit graphics cannot hold."""
    rows: list[tuple[str, ArrayLike]] = [
        ("camera position", scene.camera.position),
        ("camera target", scene.camera.target),
        ("background", scene.background),
    ]
    for index, surface in enumerate(scene.objects):
        which = f"object {index}" + (f" ({surface.name})" if surface.name else "")
        spin = surface.motion.spin
        rows += [
            (f"{which}: vertices", surface.vertices),
            (f"{which}: color", surface.color),
            (f"{which}: uv", () if surface.uv is None else surface.uv),
            (f"{which}: spin center", () if spin is None else spin.center),
            (f"{which}: matrices", surface.motion.matrices or ()),
        ]
    rows += [(f"light {k}: quad", light.quad) for k, light in enumerate(scene.lights)]
    for what, values in rows:
        largest = float(np.abs(np.asarray(values, dtype=np.float64)).max(initial=0.0))
        if not largest <= MOST_DISTANT:
            raise InputError(
                f"{what}: {largest:.3g} is too large for the rasterizer, which takes up to {MOST_DISTANT:.3g}"
            )


def _leave(context: GraphicsContext, *releases: Callable[[], None]) -> None:
    for release in releases:
        context.release_later(release)


class RasterScene:
    """A scene on the graphics device, for one technique and picture size."""

    def __init__(
        self, context: GraphicsContext, scene: Scene, technique: Technique, size: tuple[int, int], start: float
    ) -> None:
        scene = with_lights(scene)
        self._context, self._scene, self._technique, self._size = context, scene, technique, size
        self._optics = make_optics(technique)
        self._layout = make_layout(context, size, technique, self._optics)
        if technique.post != "none":
            check_whole(context, size, technique, self._optics)
        bodies = build_bodies(scene)
        self._placement = make_placement(bodies)
        self._parts = [self._make_part(*corner) for corner in self._layout.corners(size)]
        with context.use() as gl, ExitStack() as made:
            context.release_left_over()
            self._target = Target(context, self._layout, technique, depth_rule(scene.camera), self._optics)
            made.callback(self._target.release)
            self._buffers = SceneBuffers(context, scene, bodies, technique, self._layout.full)
            made.callback(self._buffers.release)
            self._most_rays = None if self._buffers.light is None else self._buffers.light.most_rays
            # compiles the kernels at the first call of a process: that is no rendering
            first = Exposures(technique, self._optics, 0, 0, self._most_rays)
            self._post: Post | None = None
            if technique.post != "none":
                summed = len(first) > 1
                self._post = Post(context, scene, self._placement, technique, self._target, size, summed=summed)
                made.callback(self._post.release)
            # one sample in the middle of everything is the same in every frame
            is_fixed = technique.sampler == "center" and technique.passes * technique.shadow_rays == 1
            self._fixed = first if is_fixed else None
            gl.finish()
            context.check("uploading the scene")
            made.pop_all()
        # frees nothing itself: the collector may run while another context is current
        self._forgotten = weakref.finalize(self, _leave, context, *self._releases())
        self._forgotten.atexit = False
        self._sums: FloatArray | None = None
        self._setup_seconds = perf_counter() - start

    def _make_part(self, left: int, top: int) -> "_Part":
        ssaa, margin = self._layout.ssaa, self._layout.margin
        window = Window(left * ssaa - margin, top * ssaa - margin, *self._layout.full)
        width, height = (min(p, s - c) for p, s, c in zip(self._layout.part, self._size, (left, top), strict=True))
        guard = Guard(self._scene, self._placement, (window.width, window.height))
        return _Part(window, (slice(top, top + height), slice(left, left + width)), guard)

    def render(self, frame: int = 0, seed: int = 0, progress: Progress | None = None) -> Frame:
        """Return frame number `frame`; `progress`, where given, is told the share of its passes that are done.

        Raises
        ------
        GraphicsError
            If OpenGL reports an error.
        InputError
            If the scene reaches farther from the camera in that frame than float32 can hold, or no sample lies under
            the filter.
        RuntimeError
            If the prepared scene is closed.
        """
        start = perf_counter()
        t = self._technique
        pixels = np.empty((self._size[1], self._size[0], 3), np.float32)
        with self._context.use() as gl:
            # asked inside, since another thread may close it meanwhile
            if not self._forgotten.alive:
                raise RuntimeError("this prepared scene is closed; prepare it again to render")
            frames = range(frame, frame + 1) if self._post is None else self._post.frames(frame, seed)
            for drawn in frames:
                if drawn == frame > frames[0]:
                    # what a running application has drawn before is no part of a frame's price
                    gl.finish()
                    start = perf_counter()
                exposures = self._fixed or Exposures(t, self._optics, seed, drawn, self._most_rays)
                for number, part in enumerate(self._parts, start=(drawn - frames[0]) * len(self._parts)):
                    done = None if progress is None else _share(progress, number, len(frames) * len(self._parts))
                    self._render_part(part, drawn, exposures, pixels, done)
            if self._post is not None:
                self._post.read_into(pixels)
            self._context.check("drawing a frame")
        samples = self._size[0] * self._size[1] * t.passes * t.msaa * t.ssaa**2
        return Frame(pixels, perf_counter() - start, self._setup_seconds, samples)

    def _render_part(
        self,
        part: "_Part",
        frame: int,
        exposures: Exposures,
        pixels: NDArray[np.float32],
        progress: Progress | None,
    ) -> None:
        """Draw all passes of a part of the picture and write its pixels, or leave them with what processes them."""
        whole = len(self._parts) == 1
        drawn = pixels if whole else np.empty((self._layout.part[1], self._layout.part[0], 3), np.float32)
        sums = self._cleared_sums(drawn) if len(exposures) > 1 else None
        weights = 0.0
        for number in range(len(exposures)):
            exposure = exposures[number]
            weight = exposure.weight * self._draw_pass(part, frame, exposure)
            if self._post is None or sums is not None:
                self._target.read_into(drawn)
            if sums is not None:
                if exposure.weight != 1.0:
                    np.multiply(drawn, np.float32(exposure.weight), out=drawn)
                np.add(sums, drawn, out=sums)
            weights += weight
            if progress is not None:
                progress((number + 1) / len(exposures))
        if self._optics.warp.code != IDENTITY:
            weights = float(exposures.passes)  # signed samples of a distribution: their mean, not their quotient
        if not abs(weights) > _LEAST_WEIGHT * exposures.passes:
            raise InputError(
                f"filter={self._technique.filter},radius={self._technique.radius_px:g}: no sample lies under so narrow "
                "a filter; use passes alone, whose places are drawn under it"
            )
        if sums is not None:
            np.multiply(sums, 1.0 / weights, out=drawn, casting="same_kind")
        if self._post is not None:
            scale = exposures[0].weight / weights if sums is None else 1.0
            self._post.run(frame, scale, drawn)
        elif sums is None and (weights != 1.0 or exposures[0].weight != 1.0):
            np.multiply(drawn, np.float32(exposures[0].weight / weights), out=drawn)
        if not whole:
            height, width = (s.stop - s.start for s in part.place)
            pixels[part.place] = drawn[:height, :width]

    def _cleared_sums(self, like: NDArray[np.float32]) -> FloatArray:
        if self._sums is None:
            self._sums = np.empty(like.shape)
        self._sums.fill(0.0)
        return self._sums

    def _draw_pass(self, part: "_Part", frame: int, exposure: Exposure) -> float:
        """Draw one pass of a part; return the sum of its samples' weights."""
        ssaa = self._layout.ssaa
        moved = (0.0, 0.0) if self._post is None else self._post.place(frame)
        instant = Instant(
            frame,
            shutter_fraction(self._scene.animation, exposure.time),
            (exposure.jitter[0] + ssaa * moved[0], exposure.jitter[1] + ssaa * moved[1]),
            exposure.lens,
            self._technique.motion == "matrix",
        )
        drawn = (self._size[0] * ssaa, self._size[1] * ssaa)
        matrices = clip_matrices(self._scene, self._placement, instant, size=drawn, window=part.window)
        if self._buffers.light is not None:
            self._buffers.light.update(exposure, instant, pass_view(self._scene, instant, drawn), part.window)
        far = part.guard.far_objects(matrices)
        self._target.begin(self._scene.background)
        tilts = layer_tilts(self._scene, self._placement, instant, drawn)
        if far.any():
            self._buffers.draw(matrices, tilts, part.guard.cut(matrices, far), far)
        else:
            self._buffers.draw(matrices, tilts)
        return self._target.finish(exposure.jitter)

    def close(self) -> None:
        """Free what the scene holds on the device; a second call does nothing."""
        with self._context.use():
            if self._forgotten.detach() is not None:
                for release in self._releases():
                    release()

    def _releases(self) -> list[Callable[[], None]]:
        post = [] if self._post is None else [self._post.release]
        return [self._buffers.release, self._target.release, *post]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class _Part(NamedTuple):
    """A part of the picture: what is drawn, which pixels it is (rows, columns), and what is far in it."""

    window: Window
    place: tuple[slice, slice]
    guard: Guard


def _share(progress: Progress, number: int, count: int) -> Progress:
    """Return what tells the progress of one of `count` equal parts of the work."""
    return lambda done: progress((number + done) / count)
