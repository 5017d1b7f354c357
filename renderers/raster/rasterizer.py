"""The rasterizer: MSAA, supersampling, mipmapped minification and an accumulation buffer over pixel and time.

An accumulation pass is one sample index of the shared pattern, the same for all pixels: it draws the whole scene with
the picture shifted by that sample's place in the pixel, at that sample's time in the shutter. Passes are summed in
float64 on the host: blending into a float target is no faster, and less exact.
"""

import weakref
from collections.abc import Callable
from contextlib import ExitStack
from time import perf_counter
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aliasbench.renderers.frame import Frame, Progress
from aliasbench.renderers.geometry import build_bodies
from aliasbench.renderers.raster.context import acquire_context, check_samples
from aliasbench.renderers.raster.graphics import GraphicsContext
from aliasbench.renderers.raster.guard import Guard
from aliasbench.renderers.raster.pipeline import SceneBuffers
from aliasbench.renderers.raster.placement import make_placement
from aliasbench.renderers.raster.projection import MOST_DISTANT, clip_matrices, depth_rule
from aliasbench.renderers.raster.targets import Target
from aliasbench.renderers.sampling.patterns import pattern_frame, sample_set, sampler_code
from aliasbench.renderers.technique import Technique
from aliasbench.renderers.unlit import check_unlit
from aliasbench.scenes.errors import InputError, NotAvailableError
from aliasbench.scenes.model import Scene
from aliasbench.scenes.motion import shutter_fraction


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
    missing = (
        (technique.filter != "box", f"filter={technique.filter}", "filter=box"),
        (technique.radius_px != 0.5, f"filter=box,radius={technique.radius_px:g}", "radius=0.5"),
        (technique.weighting != "samples", f"weighting={technique.weighting}", "weighting=samples"),
        (technique.texture == "anisotropic", "texture=anisotropic", "point, linear, mipmap, trilinear"),
        (technique.post != "none", f"post={technique.post}", "post=none"),
        (technique.alpha_to_coverage, "alpha_to_coverage=on", "alpha_to_coverage=off"),
        (technique.motion != "exact", f"motion={technique.motion}", "motion=exact"),
    )
    for wanted, feature, available in missing:
        if wanted:
            raise NotAvailableError(f"raster: {feature} is not available yet; available: {available}")
    sampler_code(technique.sampler)
    check_unlit("raster", scene)


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
        self._context, self._scene, self._technique, self._size = context, scene, technique, size
        bodies = build_bodies(scene)
        self._placement = make_placement(bodies)
        self._guard = Guard(scene, self._placement, size)
        with context.use() as gl, ExitStack() as made:
            context.release_left_over()
            self._target = Target(context, size, technique, depth_rule(scene.camera))
            made.callback(self._target.release)
            self._buffers = SceneBuffers(context, scene, bodies, technique)
            # compiles the kernel at the first call of a process: that is no rendering
            sample_set(technique.sampler, technique.passes)
            gl.finish()
            context.check("uploading the scene")
            made.pop_all()
        # frees nothing itself: the collector may run while another context is current
        self._forgotten = weakref.finalize(self, _leave, context, self._buffers.release, self._target.release)
        self._forgotten.atexit = False
        self._setup_seconds = perf_counter() - start

    def render(self, frame: int = 0, seed: int = 0, progress: Progress | None = None) -> Frame:
        """Return frame number `frame`; `progress`, where given, is told the share of its passes that are done.

        Raises
        ------
        GraphicsError
            If OpenGL reports an error.
        InputError
            If the scene reaches farther from the camera in that frame than float32 can hold.
        RuntimeError
            If the prepared scene is closed.
        """
        start = perf_counter()
        t = self._technique
        passes = sample_set(t.sampler, t.passes, seed=seed, frame=pattern_frame(t.reseed, frame))
        pixels = np.empty((self._size[1], self._size[0], 3), np.float32)
        total = np.zeros(pixels.shape) if t.passes > 1 else None
        with self._context.use():
            # asked inside, since another thread may close it meanwhile
            if not self._forgotten.alive:
                raise RuntimeError("this prepared scene is closed; prepare it again to render")
            for number, (x, y, time, *_) in enumerate(passes):
                self._draw_pass(frame, 0.5 if t.time == "center" else time, (x - 0.5, y - 0.5), pixels)
                if total is not None:
                    np.add(total, pixels, out=total)
                if progress is not None:
                    progress((number + 1) / t.passes)
            self._context.check("drawing a frame")
        if total is not None:
            np.multiply(total, 1.0 / t.passes, out=pixels, casting="same_kind")
        samples = self._size[0] * self._size[1] * t.passes * t.msaa * t.ssaa**2
        return Frame(pixels, perf_counter() - start, self._setup_seconds, samples)

    def _draw_pass(self, frame: int, time: float, jitter: tuple[float, float], pixels: NDArray[np.float32]) -> None:
        """Draw one pass into `pixels`."""
        matrices = clip_matrices(
            self._scene,
            self._placement,
            size=self._target.size,
            frame=frame,
            fraction=shutter_fraction(self._scene.animation, time),
            jitter=jitter,
            margin=self._target.margin,
        )
        far = self._guard.far_objects(matrices)
        self._target.begin(self._scene.background)
        if far.any():
            self._buffers.draw(matrices, self._guard.cut(matrices, far), far)
        else:
            self._buffers.draw(matrices)
        self._target.read_into(pixels, jitter)

    def close(self) -> None:
        """Free what the scene holds on the device; a second call does nothing."""
        with self._context.use():
            if self._forgotten.detach() is not None:
                self._buffers.release()
                self._target.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
