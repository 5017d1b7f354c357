"""The ray tracer behind the renderers' contract: a scene and a technique in, frames out.

What a frame is made from is `exposure`'s to say, who gets how many samples and what becomes of them `development`'s,
and what traces them an engine's: `packets`, or `portable` on platforms without and as the check on it.
"""

import os
import time
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.frame import Frame, Progress
from aliasbench.renderers.geometry import build_bodies
from aliasbench.renderers.lights import light_values, with_lights
from aliasbench.renderers.raytrace.allocation import error_exponent
from aliasbench.renderers.raytrace.bodies import BODY_SIZE, body_values
from aliasbench.renderers.raytrace.cutting import cut_large, edge_on, without
from aliasbench.renderers.raytrace.development import Development, Room, is_plain, make_optics
from aliasbench.renderers.raytrace.edge_on import keeps_planes, without_edge_on
from aliasbench.renderers.raytrace.exposure import Exposure, plan_exposure
from aliasbench.renderers.raytrace.film import Film
from aliasbench.renderers.raytrace.lighting import is_scattered, put_materials
from aliasbench.renderers.raytrace.paths import Scattering
from aliasbench.renderers.raytrace.shading import Tables
from aliasbench.renderers.raytrace.start import Spheres
from aliasbench.renderers.raytrace.tables import (
    Mesh,
    body_mesh,
    build_looks,
    build_ownership,
    build_tables,
    camera_values,
    merge_bodies,
)
from aliasbench.renderers.sampling.hashing import frame_key
from aliasbench.renderers.sampling.patterns import Pattern, make_pattern, pattern_frame
from aliasbench.renderers.technique import Technique
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import FloatArray, Scene

THREADS_VARIABLE = "ALIASBENCH_THREADS"
_MAX_THREADS = 1024
MOST_SAMPLES = 2**32


class Engine(Protocol):
    """What traces: given meshes once and again, it fills pictures and film."""

    def set_still(self, mesh: Mesh) -> None:
        """Take the mesh that stands still (replacing the one before)."""
        ...

    def set_moving(self, meshes: Sequence[Mesh]) -> None:
        """Take the meshes of the moving bodies, in their own frames."""
        ...

    def fill(
        self,
        camera: FloatArray,
        pattern: Pattern,
        tables: Tables,
        moving: bool,
        out: NDArray[np.float32],
        progress: Progress | None = None,
    ) -> None:
        """Write the picture (h, w, 3), every sample counting in its own pixel alone; scenes without lens or light."""
        ...

    def expose(
        self,
        camera: FloatArray,
        pattern: Pattern,
        tables: Tables,
        moving: bool,
        scattering: Scattering | None,
        film: Film,
    ) -> None:
        """Add samples to a film; `scattering` where paths of light are needed."""
        ...

    def spread(self, function: Callable[..., None], rows: int, *arguments: object) -> None:
        """Call a function of the first row and the one after of each part of `rows`, on every thread."""
        ...

    def close(self) -> None:
        """Free everything."""
        ...


def thread_count() -> int:
    """Return the number of threads to render on: ALIASBENCH_THREADS, or every core.

    Raises
    ------
    InputError
        If the variable is no whole number from 1 to 1024.
    """
    given = os.environ.get(THREADS_VARIABLE, "").strip()
    if not given:
        return os.cpu_count() or 1
    if not (given.isascii() and given.isdigit() and 1 <= int(given) <= _MAX_THREADS):
        raise InputError(f"{THREADS_VARIABLE}={given}: must be a whole number from 1 to {_MAX_THREADS}")
    return int(given)


def prepare_raytrace(scene: Scene, technique: Technique, size: tuple[int, int]) -> "PreparedRaytrace":
    """Return the scene ready to be traced at `size` = (width, height).

    Raises
    ------
    InputError
        For a degenerate camera, more than 2^32 samples, a filter too wide for memory, or a bad ALIASBENCH_THREADS.
    """
    spp = technique.spp if technique.adaptive == "off" else technique.max_spp
    if size[0] * size[1] * spp > MOST_SAMPLES:
        raise InputError(
            f"{size[0]} x {size[1]} pixels at {spp} samples are more than 2^32 samples in all; "
            "a smaller picture or fewer samples are not"
        )
    threads = thread_count()
    started = time.perf_counter()
    if technique.engine == "packet":
        from aliasbench.renderers.raytrace.packets import PacketEngine

        engine: Engine = PacketEngine(threads, robust=technique.robust)
    else:
        from aliasbench.renderers.raytrace.portable import PortableEngine

        engine = PortableEngine(robust=technique.robust)
    return PreparedRaytrace(scene, technique, size, engine, started)


class PreparedRaytrace:
    """A scene held by an engine; see `frame.Prepared`.

    `started` (of `time.perf_counter`) is where the setup's clock began. Kernels are compiled, or loaded, on one pixel
    after that clock has stopped and before any frame's starts.
    """

    __slots__ = (
        "_bodies",
        "_engine",
        "_footprint",
        "_hidden",
        "_is_plain",
        "_is_scattered",
        "_looks",
        "_mesh_key",
        "_moving",
        "_optics",
        "_placed",
        "_room",
        "_scene",
        "_setup_seconds",
        "_size",
        "_spheres",
        "_still",
        "_technique",
        "_whole",
    )

    def __init__(
        self, scene: Scene, technique: Technique, size: tuple[int, int], engine: Engine, started: float
    ) -> None:
        self._is_scattered = is_scattered(scene)
        self._scene = scene = with_lights(scene)
        self._technique = technique
        self._size = size
        self._engine = engine
        self._bodies = build_bodies(scene)
        self._looks = build_looks(scene, technique.texture)
        put_materials(scene, self._looks.objects)
        self._placed = self._looks.textured or self._is_scattered
        self._footprint = float(technique.shading_samples) ** -0.5
        self._mesh_key: tuple[float, ...] = ()
        self._hidden = np.zeros(0, np.int64)
        self._still = self._moving = build_ownership((), placed=False)
        self._optics = make_optics(technique, size[0])
        self._room = Room()
        has_lens = scene.camera.lens_radius > 0.0
        self._is_plain = is_plain(technique, self._optics) and not has_lens and not self._is_scattered
        self._spheres = Spheres.about(self._bodies)
        exposure = plan_exposure(scene, technique, size, self._bodies, self._spheres, 0)
        meshes = [body_mesh(body, self._looks) for body in exposure.moving]
        engine.set_moving(meshes)
        self._moving = build_ownership(meshes, placed=self._placed)
        self._place(exposure)
        self._setup_seconds = time.perf_counter() - started
        self._size = (1, 1)
        self._expose(exposure, frame_key(0, 0), None)
        self._size = size

    def render(self, frame: int = 0, seed: int = 0, progress: Progress | None = None) -> Frame:
        """Return frame number `frame`; the same arguments give the same pixels on any number of threads.

        `progress`, where given, is told the share that is done, from 0 to 1, now and then.
        """
        started = time.perf_counter()
        technique = self._technique
        exposure = plan_exposure(self._scene, technique, self._size, self._bodies, self._spheres, frame)
        self._place(exposure)
        start = frame_key(seed, pattern_frame(technique.reseed, frame))
        pixels, counts = self._expose(exposure, start, progress)
        seconds = time.perf_counter() - started
        samples = self._size[0] * self._size[1] * technique.spp if counts is None else int(counts.sum(dtype=np.int64))
        return Frame(pixels, seconds, self._setup_seconds, samples, counts)

    def _place(self, exposure: Exposure) -> None:
        """Give the engine the still mesh of an exposure, unless it has it."""
        known = exposure.mesh_key == self._mesh_key
        if known and self._scene.camera.is_static:
            return
        if not known:
            self._whole = merge_bodies(self._scene, self._looks, exposure.still, exposure.shutter, exposure.anchor)
        hidden = self._find_edge_on(exposure)
        if known and np.array_equal(hidden, self._hidden):
            return
        mesh, kept = (self._whole, None) if not len(hidden) else without(self._whole, hidden)
        mesh, parents = cut_large(mesh, exposure.anchor_view, exposure.anchor, exposure.travel)
        # light comes from all sides; a camera sees only what faces it
        if not self._is_scattered and keeps_planes(self._scene.camera):
            mesh = without_edge_on(mesh, exposure.shutter.first, exposure.anchor)
        self._engine.set_still(mesh)
        # a part has its whole triangle's plane and texture map, which its own corners know less well
        still = build_ownership((self._whole,), placed=self._placed)
        for chosen in (kept, parents):
            still = still if chosen is None else still.of_parts(chosen)
        self._still, self._hidden, self._mesh_key = still, hidden, exposure.mesh_key

    def _find_edge_on(self, exposure: Exposure) -> NDArray[np.int64]:
        """Return the triangles of the still mesh that a pinhole sees nothing of; those that cast shadows stay."""
        camera, shutter = self._scene.camera, exposure.shutter
        moves = shutter.opening != shutter.closing and not camera.is_static
        if camera.projection != "perspective" or camera.lens_radius > 0.0 or moves or self._is_scattered:
            return np.zeros(0, np.int64)
        flat = np.array([s.is_polygon for s in self._scene.objects], dtype=bool)
        return edge_on(self._whole, shutter.first.origin - exposure.anchor, flat)

    def _expose(
        self, exposure: Exposure, start: int, progress: Progress | None
    ) -> tuple[NDArray[np.float32], NDArray[np.int32] | None]:
        """Return the picture, and the number of samples of each pixel where they differ."""
        scene, shutter, anchor, t = self._scene, exposure.shutter, exposure.anchor, self._technique
        bodies = np.zeros((len(exposure.moving), BODY_SIZE))
        for values, body in zip(bodies, exposure.moving, strict=True):
            values[:] = body_values(scene, body, shutter, anchor)
        lights = light_values(scene, shutter.first, anchor)
        tables = build_tables(scene, self._looks, self._still, self._moving, bodies, lights, self._footprint)
        camera = camera_values(scene, shutter, anchor, exposure.start)
        is_adaptive = t.adaptive != "off"
        pattern = make_pattern(
            t.sampler,
            t.max_spp if is_adaptive else t.spp,
            start,
            shared=t.pattern == "shared",
            progressive=is_adaptive,
        )
        if self._is_plain:
            out = np.zeros((self._size[1], self._size[0], 3), np.float32)
            self._engine.fill(camera, pattern, tables, exposure.has_times, out, progress)
            return out, None
        has_times = exposure.has_times or scene.camera.lens_radius > 0.0
        scattering = Scattering(t.shadow_rays, scene.bounces) if self._is_scattered else None

        def expose(pattern: Pattern, film: Film) -> None:
            self._engine.expose(camera, pattern, tables, has_times, scattering, film)

        exponent = error_exponent(scene, t, pattern.sampler)
        return Development(
            t, self._size, pattern, self._optics, expose, self._engine.spread, exponent, self._room, progress
        ).run()

    def close(self) -> None:
        """Free what the engine holds (again is harmless)."""
        self._engine.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
