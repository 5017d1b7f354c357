"""The ray tracer behind the renderers' contract: a scene and a technique in, frames out.

What it does not have yet is refused here, before anything is built; what a frame is made from is `exposure`'s to say,
what traces it an engine's: `packets`, or `portable` on platforms without and as the check on it.
"""

import os
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.frame import Frame
from aliasbench.renderers.geometry import build_bodies
from aliasbench.renderers.raytrace.bodies import BODY_SIZE, body_values
from aliasbench.renderers.raytrace.exposure import Exposure, plan_exposure
from aliasbench.renderers.raytrace.lanes import Sampling, build_sampling
from aliasbench.renderers.raytrace.shading import Tables
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
from aliasbench.renderers.sampling.patterns import pattern_frame, sampler_code
from aliasbench.renderers.technique import Technique
from aliasbench.renderers.unlit import check_unlit
from aliasbench.scenes.errors import InputError, NotAvailableError
from aliasbench.scenes.model import FloatArray, Scene

THREADS_VARIABLE = "ALIASBENCH_THREADS"
_MAX_THREADS = 1024


class Engine(Protocol):
    """What traces: given meshes once and again, it fills pictures."""

    def set_still(self, mesh: Mesh) -> None:
        """Take the mesh that stands still (replacing the one before)."""
        ...

    def set_moving(self, meshes: Sequence[Mesh]) -> None:
        """Take the meshes of the moving bodies, in their own frames."""
        ...

    def fill(
        self, camera: FloatArray, pattern: Sampling, tables: Tables, moving: bool, out: NDArray[np.float32]
    ) -> None:
        """Write the picture (h, w, 3)."""
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


def check_available(scene: Scene, technique: Technique) -> None:
    """Raise for what the ray tracer does not have: `NotAvailableError` a technique's, `UnsupportedScene` a scene's."""
    t = technique
    sampler_code(t.sampler)
    refused: tuple[tuple[bool, str, str], ...] = (
        (t.filter != "box" or t.radius_px != 0.5, f"filter={t.filter},radius={t.radius_px:g}", "filter=box,radius=.5"),
        (t.weighting != "samples", f"weighting={t.weighting}", "weighting=samples"),
        (t.adaptive != "off", f"adaptive={t.adaptive}", "adaptive=off"),
        (t.motion != "exact", f"motion={t.motion}", "motion=exact"),
        (t.texture == "ewa", "texture=ewa", "texture=point, linear, mipmap and trilinear"),
    )
    for is_refused, asked, instead in refused:
        if is_refused:
            raise NotAvailableError(f"{asked} is not available in the ray tracer yet; available: {instead}")
    check_unlit("raytrace", scene)


def prepare_raytrace(scene: Scene, technique: Technique, size: tuple[int, int]) -> "PreparedRaytrace":
    """Return the scene ready to be traced at `size` = (width, height).

    Raises
    ------
    NotAvailableError
        For a documented technique that the ray tracer does not have yet.
    UnsupportedScene
        For what the scene has and the ray tracer does not draw.
    InputError
        For a degenerate camera, or a bad ALIASBENCH_THREADS.
    """
    check_available(scene, technique)
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
        "_looks",
        "_mesh_key",
        "_moving",
        "_scene",
        "_setup_seconds",
        "_size",
        "_still",
        "_technique",
    )

    def __init__(
        self, scene: Scene, technique: Technique, size: tuple[int, int], engine: Engine, started: float
    ) -> None:
        self._scene = scene
        self._technique = technique
        self._size = size
        self._engine = engine
        self._bodies = build_bodies(scene)
        self._looks = build_looks(scene, technique.texture)
        self._footprint = float(technique.shading_samples) ** -0.5
        self._mesh_key: tuple[int, ...] = ()
        self._still = self._moving = build_ownership((), textured=False)
        exposure = plan_exposure(scene, technique, size, self._bodies, 0)
        meshes = [body_mesh(body, self._looks) for body in exposure.moving]
        engine.set_moving(meshes)
        self._moving = build_ownership(meshes, textured=self._looks.textured)
        self._place(exposure)
        self._setup_seconds = time.perf_counter() - started
        self._fill(exposure, build_sampling(technique.sampler, 1, frame_key(0, 0), shared=False), (1, 1))

    def render(self, frame: int = 0, seed: int = 0) -> Frame:
        """Return frame number `frame`; the same arguments give the same pixels on any number of threads."""
        started = time.perf_counter()
        technique = self._technique
        exposure = plan_exposure(self._scene, technique, self._size, self._bodies, frame)
        self._place(exposure)
        start = frame_key(seed, pattern_frame(technique.reseed, frame))
        pattern = build_sampling(technique.sampler, technique.spp, start, shared=technique.pattern == "shared")
        pixels = self._fill(exposure, pattern, self._size)
        seconds = time.perf_counter() - started
        return Frame(pixels, seconds, self._setup_seconds, self._size[0] * self._size[1] * technique.spp)

    def _place(self, exposure: Exposure) -> None:
        """Give the engine the still mesh of an exposure, unless it has it."""
        if exposure.mesh_key == self._mesh_key:
            return
        mesh = merge_bodies(self._scene, self._looks, exposure.still, exposure.shutter, exposure.anchor)
        self._engine.set_still(mesh)
        self._still = build_ownership((mesh,), textured=self._looks.textured)
        self._mesh_key = exposure.mesh_key

    def _fill(self, exposure: Exposure, pattern: Sampling, size: tuple[int, int]) -> NDArray[np.float32]:
        scene, shutter, anchor = self._scene, exposure.shutter, exposure.anchor
        bodies = np.zeros((len(exposure.moving), BODY_SIZE))
        for values, body in zip(bodies, exposure.moving, strict=True):
            values[:] = body_values(scene, body, shutter, anchor)
        tables = build_tables(scene, self._looks, self._still, self._moving, bodies, self._footprint)
        out = np.zeros((size[1], size[0], 3), np.float32)
        self._engine.fill(camera_values(scene, shutter, anchor), pattern, tables, exposure.has_times, out)
        return out

    def close(self) -> None:
        """Free what the engine holds (again is harmless)."""
        self._engine.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
