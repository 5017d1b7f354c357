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
from aliasbench.renderers.raytrace.development import Development, Room, is_plain, make_optics
from aliasbench.renderers.raytrace.exposure import Exposure, plan_exposure
from aliasbench.renderers.raytrace.film import Film
from aliasbench.renderers.raytrace.lighting import is_scattered, put_materials
from aliasbench.renderers.raytrace.moving import Moving
from aliasbench.renderers.raytrace.paths import Scattering
from aliasbench.renderers.raytrace.shading import Tables
from aliasbench.renderers.raytrace.start import Spheres
from aliasbench.renderers.raytrace.still import Still
from aliasbench.renderers.raytrace.tables import (
    Mesh,
    build_looks,
    build_tables,
    camera_values,
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
        "_is_plain",
        "_is_scattered",
        "_looks",
        "_moving",
        "_optics",
        "_room",
        "_scene",
        "_setup_seconds",
        "_size",
        "_spheres",
        "_still",
        "_technique",
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
        placed = self._looks.textured or self._is_scattered
        self._footprint = float(technique.shading_samples) ** -0.5
        self._still = Still(scene, self._looks, placed=placed, lit=self._is_scattered, robust=technique.robust)
        self._optics = make_optics(technique, size[0])
        self._room = Room()
        has_lens = scene.camera.lens_radius > 0.0
        self._is_plain = is_plain(technique, self._optics) and not has_lens and not self._is_scattered
        self._spheres = Spheres.about(self._bodies)
        exposure = self._plan(0)
        self._moving = Moving(scene, self._looks, exposure.moving, placed=placed)
        self._moving.place(exposure, engine.set_moving)
        self._still.place(exposure, engine.set_still)
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
        exposure = self._plan(frame)
        self._moving.place(exposure, self._engine.set_moving)
        self._still.place(exposure, self._engine.set_still)
        start = frame_key(seed, pattern_frame(technique.reseed, frame))
        pixels, counts = self._expose(exposure, start, progress)
        seconds = time.perf_counter() - started
        samples = self._size[0] * self._size[1] * technique.spp if counts is None else int(counts.sum(dtype=np.int64))
        return Frame(pixels, seconds, self._setup_seconds, samples, counts)

    def _plan(self, frame: int) -> Exposure:
        return plan_exposure(
            self._scene, self._technique, self._size, self._bodies, self._spheres, frame, lit=self._is_scattered
        )

    def _expose(
        self, exposure: Exposure, start: int, progress: Progress | None
    ) -> tuple[NDArray[np.float32], NDArray[np.int32] | None]:
        """Return the picture, and the number of samples of each pixel where they differ."""
        scene, shutter, anchor, t = self._scene, exposure.shutter, exposure.anchor, self._technique
        bodies = np.zeros((len(self._moving.bodies), BODY_SIZE))
        for values, body in zip(bodies, self._moving.bodies, strict=True):
            values[:] = body_values(scene, body, shutter, anchor)
        lights = light_values(scene, shutter.first, anchor)
        tables = build_tables(
            scene, self._looks, self._still.ownership, self._moving.ownership, bodies, lights, self._footprint
        )
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
