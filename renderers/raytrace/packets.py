"""The fast engine: scenes in Embree, and the kernels that have it trace 16 rays at once, on every thread."""

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.frame import Progress
from aliasbench.renderers.raytrace.embree import Device, TriangleScene
from aliasbench.renderers.raytrace.film import Film
from aliasbench.renderers.raytrace.kernels import (
    EMPTY,
    Workspace,
    film_moving,
    film_static,
    render_moving,
    render_static_flat,
    render_static_textured,
)
from aliasbench.renderers.raytrace.lanes import (
    HIT_PRIM,
    LANES,
    PERSPECTIVE,
    RAY_ID,
    RAY_MASK,
    RAY_SIZE,
    RAY_TNEAR,
    SCRATCH_SIZE,
    aligned_floats,
)
from aliasbench.renderers.raytrace.paths import Scattering, make_paths
from aliasbench.renderers.raytrace.positions import KEY_ROWS, orders_size
from aliasbench.renderers.raytrace.ray_order import PACKETS, make_block
from aliasbench.renderers.raytrace.shading import EwaTables, Tables
from aliasbench.renderers.raytrace.tables import Mesh
from aliasbench.renderers.raytrace.texturing import CUTOFF
from aliasbench.renderers.sampling.patterns import Pattern, RarePattern
from aliasbench.scenes.model import FloatArray

Kernel = Callable[..., None]

_COHERENT = 1 << 16
_ALL_FEATURES = -1
_AHEAD = 1e-30
_REPORTS_S = 0.1  # between two reports of progress


def make_workspace(width: int, pattern: Pattern, margin: int) -> Workspace:
    """Return memory for one thread that renders rows of `width` pixels under a filter that reaches `margin` more."""
    ray, body_ray = aligned_floats(RAY_SIZE), aligned_floats(RAY_SIZE)
    valid, arguments = aligned_floats(LANES).view(np.int32), aligned_floats(LANES).view(np.int32)
    # RTCIntersectArguments: flags, feature mask, then pointers and a float that stay null.
    arguments[0], arguments[1] = _COHERENT, _ALL_FEATURES
    for ids in (ray.view(np.int32), body_ray.view(np.int32)):
        ids[RAY_MASK : RAY_MASK + LANES] = -1
        ids[RAY_ID : RAY_ID + LANES] = np.arange(LANES)
    taps = 2 * margin + 1
    return Workspace(
        aligned_floats(2 * SCRATCH_SIZE).view(np.float64),
        ray,
        ray.view(np.int32),
        body_ray,
        body_ray.view(np.int32),
        valid,
        arguments,
        ray.view(np.int32)[HIT_PRIM : HIT_PRIM + LANES],
        np.zeros(3),
        np.zeros((KEY_ROWS, width), np.uint64),
        np.zeros((3, orders_size(pattern)), np.int32),
        np.zeros(LANES, np.int64),
        np.zeros((PACKETS, LANES, 4), np.int64),
        np.zeros(PACKETS, np.int64),
        np.zeros(2, np.int64),
        np.zeros((taps, 2 * LANES)),
        np.zeros((taps, taps, 4)),
        np.zeros((4, 2 * LANES)),
        make_block(),
        np.zeros(0, np.int64),
    )


class PacketEngine:
    """Holds the scene's meshes in Embree and renders pictures with the kernels; see `tracer.Engine`."""

    __slots__ = ("_bodies", "_device", "_handles", "_has_still", "_pool", "_robust", "_still", "_threads")

    def __init__(self, threads: int, *, robust: bool) -> None:
        self._device = Device()
        self._robust = robust
        self._still: TriangleScene | None = None
        self._has_still = False
        self._bodies: list[TriangleScene] = []
        self._handles = np.zeros(0, np.int64)
        self._threads = threads
        self._pool = ThreadPoolExecutor(threads, "aliasbench-rays")

    def _build(self, mesh: Mesh, number: int) -> TriangleScene:
        vertices = mesh.vertices.astype(np.float32)
        return TriangleScene(
            self._device, vertices, mesh.triangles, robust=self._robust, holed=mesh.holed, number=number
        )

    def set_still(self, mesh: Mesh) -> None:
        """Take the mesh that stands still (replacing the one before)."""
        if self._still is not None:
            self._still.close()
        self._still = self._build(mesh, 0)
        self._has_still = bool(len(mesh.triangles))

    def set_moving(self, meshes: Sequence[Mesh]) -> None:
        """Take the meshes of the moving bodies, in their own frames."""
        for body in self._bodies:
            body.close()
        self._bodies = [self._build(mesh, 1 + k) for k, mesh in enumerate(meshes)]
        self._handles = np.array([body.handle for body in self._bodies], np.int64)

    def fill(
        self,
        camera: FloatArray,
        pattern: Pattern,
        tables: Tables,
        moving: bool,
        out: NDArray[np.float32],
        progress: Progress | None = None,
    ) -> None:
        """Write the picture (h, w, 3), every sample counting in its own pixel alone."""
        handles: tuple[object, ...] = (self._still_handle,)
        if moving:
            kernel, handles = render_moving, (self._still_handle, self._handles)
        else:
            kernel = render_static_textured if len(tables.triangles) > 0 else render_static_flat
        self._run(kernel, (*handles, camera, pattern, tables), out.shape[1], 0, out, progress)

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
        kernel = film_moving if moving else film_static
        handles: tuple[object, ...] = (self._still_handle,)
        if scattering is not None:
            from aliasbench.renderers.raytrace.path_kernels import film_paths

            kernel, handles = film_paths, (scattering, moving, self._still_handle, self._handles)
            # the largest kernel, so of all that is rare there is one for both kinds
            if isinstance(pattern, RarePattern) or isinstance(tables, EwaTables):
                pattern, tables = RarePattern(*pattern), EwaTables(*tables)
        elif moving:
            handles = (self._still_handle, self._handles)
        self._run(kernel, (*handles, camera, pattern, tables), film.begins.shape[1], film.margin, film, None)

    def spread(self, function: Callable[..., None], rows: int, *arguments: object) -> None:
        """Call a function of the first row and the one after of each part of `rows`, on every thread."""
        borders = [rows * k // self._threads for k in range(self._threads + 1)]
        parts = [(a, b) for a, b in pairwise(borders) if a < b]
        others = [self._pool.submit(function, *part, *arguments) for part in parts[1:]]
        for part in parts[:1]:
            function(*part, *arguments)
        for other in others:
            other.result()

    @property
    def _still_handle(self) -> int:
        if self._still is None:
            raise RuntimeError("this renderer has been closed")
        return self._still.handle if self._has_still else EMPTY

    def _run(
        self,
        kernel: Kernel,
        arguments: tuple[object, ...],
        width: int,
        margin: int,
        out: NDArray[np.float32] | Film,
        progress: Progress | None,
    ) -> None:
        """Run a kernel on every thread, this one too unless progress is asked for."""
        camera, pattern, tables = arguments[-3:]
        assert isinstance(camera, np.ndarray)
        assert isinstance(pattern, Pattern)
        assert isinstance(tables, Tables)
        rows = len(out.begins) if isinstance(out, Film) else len(out)
        # Paths have a second workspace for their shadow rays.
        each = 2 if isinstance(arguments[0], Scattering) else 1
        threads = max(1, min(self._threads, rows))
        workspaces = [[make_workspace(width, pattern, margin) for _ in range(each)] for _ in range(threads)]
        if camera[PERSPECTIVE] == 1.0:
            # in a polygon's plane a camera sees nothing of it
            for own in workspaces:
                for w in own:
                    w.ray[RAY_TNEAR : RAY_TNEAR + LANES] = w.body_ray[RAY_TNEAR : RAY_TNEAR + LANES] = _AHEAD
        if len(tables.triangles) and (tables.objects[:, CUTOFF] > -np.inf).any():
            from aliasbench.renderers.raytrace.cutout_filter import set_holes

            workspaces = [
                [w._replace(holes=set_holes(w.arguments, tables, camera, w.scratch)) for w in own] for own in workspaces
            ]
        rooms = [(*own, make_paths()) if each > 1 else tuple(own) for own in workspaces]
        counter = np.zeros(1, np.int64)
        here = 0 if progress is not None else 1
        others = [self._pool.submit(kernel, *arguments, *own, counter, out) for own in rooms[here:]]
        if progress is None:
            kernel(*arguments, *rooms[0], counter, out)
        else:
            while not all(other.done() for other in others):
                progress(min(1.0, int(counter[0]) / max(rows, 1)))
                time.sleep(_REPORTS_S)
            progress(1.0)
        for other in others:
            other.result()

    def close(self) -> None:
        """Free everything (again is harmless)."""
        self._pool.shutdown()
        self.set_moving(())
        if self._still is not None:
            self._still.close()
            self._still = None
        self._device.close()
