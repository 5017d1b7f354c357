"""The plain engine: embreex's own single rays, for platforms without the packet path and as the check on it.

Rays and shading are the functions of the packet path; only the tracing differs. embreex traces at time 0 alone, so rays
go into every moving body's frame, as they do there; here no body is left out because it looks out of sight, which
makes this the check on that too. embreex tells the nearest hit and nothing behind it: where that lies in a hole, the
same ray is traced against each half of the triangles that may have holes, and so on, down to what it meets first.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore import EmbreeDevice
from embreex.rtcore_scene import EmbreeScene
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.frame import Progress
from aliasbench.renderers.raytrace.bodies import fill_body_rays, has_layer, nearer, to_body
from aliasbench.renderers.raytrace.cutouts import find_holes
from aliasbench.renderers.raytrace.film import Film
from aliasbench.renderers.raytrace.lanes import (
    LANES,
    PERSPECTIVE,
    RAY_DX,
    RAY_OX,
    RAY_SIZE,
    RAY_TFAR,
    SCRATCH_SIZE,
    START,
    fill_moving_rays,
    fill_rays,
)
from aliasbench.renderers.raytrace.paths import MOST_SEGMENTS, Scattering
from aliasbench.renderers.raytrace.pixel_sums import add_samples
from aliasbench.renderers.raytrace.portable_film import Batch, FilmRoom
from aliasbench.renderers.raytrace.positions import (
    KEY_ROWS,
    KeyArray,
    fill_columns,
    fill_keys,
    fill_positions,
    fill_times,
    orders_size,
)
from aliasbench.renderers.raytrace.shading import MISS, Tables, shade_flat, shade_textured
from aliasbench.renderers.raytrace.tables import Mesh
from aliasbench.renderers.sampling.patterns import Pattern
from aliasbench.scenes.model import FloatArray

RayArray = NDArray[np.float32]
_BATCH = 4096  # packets held at once: some 20 MB


class _Triangles:
    """Some triangles of a mesh in embreex; `rows` (k,) are their numbers there."""

    __slots__ = ("_device", "_halves", "_mesh", "_robust", "_scene", "rows")

    def __init__(self, device: EmbreeDevice, mesh: Mesh, rows: NDArray[np.int32], *, robust: bool) -> None:
        self.rows = rows
        self._device, self._mesh, self._robust = device, mesh, robust
        self._halves: tuple[_Triangles, ...] = ()
        self._scene: EmbreeScene | None = None
        if len(rows):
            self._scene = EmbreeScene(device, robust=robust)
            # Only the vertices in use: of a mesh with many holes there are many parts.
            used, triangles = np.unique(mesh.triangles[rows], return_inverse=True)
            triangles = triangles.reshape(-1, 3).astype(np.int32)
            TriangleMesh(self._scene, mesh.vertices[used].astype(np.float32), triangles)

    def trace(self, origins: RayArray, directions: RayArray, *, ahead: bool) -> tuple[RayArray, NDArray[np.int32]]:
        """Return distances (n,) and triangles of the nearest hits, inf and MISS where there is none.

        With `ahead` those at distance 0 do not count: in a polygon's plane a camera sees nothing of it.
        """
        if self._scene is None or not len(origins):
            return np.full(len(origins), np.inf, np.float32), np.full(len(origins), MISS, np.int32)
        found = self._scene.run(origins, directions, output=1)
        is_hit = found["geomID"] >= 0
        distances = np.where(is_hit, found["tfar"], np.float32(np.inf))
        hits = np.where(is_hit, self.rows[np.where(is_hit, found["primID"], 0)], np.int32(MISS))
        at_start = distances <= 0.0
        if ahead and at_start.any():
            # embreex knows no least distance; what is not at 0 then is where it was, to float32
            step = np.float32(1e-20) + np.float32(2.0**-20) * np.abs(origins[at_start]).max(axis=1, keepdims=True)
            started = origins[at_start] + step * directions[at_start]
            distances[at_start], hits[at_start] = self.trace(started, directions[at_start], ahead=False)
        return distances, hits

    def halves(self) -> tuple["_Triangles", ...]:
        """Return the first and the second half, none of a single triangle; they are built once."""
        if not self._halves and len(self.rows) > 1:
            halves = np.array_split(self.rows, 2)
            self._halves = tuple(_Triangles(self._device, self._mesh, half, robust=self._robust) for half in halves)
        return self._halves


@dataclass(frozen=True, slots=True, eq=False)
class _Body:
    """A mesh's triangles without holes, and those with."""

    solid: _Triangles
    holed: _Triangles


@dataclass(frozen=True, slots=True, eq=False)
class _Search:
    """The nearest hits so far, none beyond the first distances: distances and triangles (n,) of lanes of `scratch`."""

    tables: Tables
    camera: FloatArray
    scratch: FloatArray
    nearest: RayArray
    hits: NDArray[np.int32]

    start: float

    def look(self, body: _Body, rays: RayArray, first: int, values: FloatArray | None = None) -> None:
        """Take nearer hits on a body, whose triangles are numbered from `first` on, by rays in its frame.

        `values` (BODY_SIZE,) are those of one that is not the still mesh.
        """
        origins, directions = _vectors(rays, RAY_OX), _vectors(rays, RAY_DX)
        distances, found = body.solid.trace(origins, directions, ahead=self.camera[PERSPECTIVE] == 1.0)
        distances = self._counted(distances, values)
        is_nearer = distances < self.nearest
        self.nearest[is_nearer] = distances[is_nearer]
        self.hits[is_nearer] = first + found[is_nearer]
        if len(body.holed.rows):
            self._look_through(body.holed, origins, directions, first, np.arange(len(origins)), values)

    def _counted(self, distances: RayArray, values: FloatArray | None) -> RayArray:
        """Return where hits of a body count, see `bodies.nearer`."""
        if values is None or not has_layer(values):
            return distances
        out: RayArray = np.full_like(distances, np.inf)
        is_hit = distances < np.inf
        out[is_hit] = nearer(values, self.start, distances[is_hit].astype(np.float64))
        return out

    def _look_through(
        self,
        triangles: _Triangles,
        origins: RayArray,
        directions: RayArray,
        first: int,
        lanes: NDArray[np.int64],
        values: FloatArray | None,
    ) -> None:
        distances, found = triangles.trace(origins[lanes], directions[lanes], ahead=self.camera[PERSPECTIVE] == 1.0)
        distances = self._counted(distances, values)
        is_nearer = distances < self.nearest[lanes]
        lanes, distances, found = lanes[is_nearer], distances[is_nearer], first + found[is_nearer]
        holes = np.zeros(len(lanes), np.bool_)
        find_holes(self.tables, self.camera, found, lanes, self.scratch, holes)
        self.nearest[lanes[~holes]] = distances[~holes]
        self.hits[lanes[~holes]] = found[~holes]
        if holes.any():
            for half in triangles.halves():
                self._look_through(half, origins, directions, first, lanes[holes], values)


class PortableEngine:
    """Holds the scene's meshes in embreex and renders pictures ray by ray; see `tracer.Engine`."""

    __slots__ = ("_bodies", "_device", "_is_closed", "_robust", "_still")

    def __init__(self, *, robust: bool) -> None:
        self._robust = robust
        self._device = EmbreeDevice()
        self._is_closed = False
        self._still: _Body | None = None
        self._bodies: list[_Body] = []

    def _build(self, mesh: Mesh) -> _Body:
        return _Body(
            *(
                _Triangles(self._device, mesh, np.flatnonzero(is_member).astype(np.int32), robust=self._robust)
                for is_member in (~mesh.holed, mesh.holed)
            )
        )

    def set_still(self, mesh: Mesh) -> None:
        """Take the mesh that stands still (replacing the one before)."""
        self._still = self._build(mesh)

    def set_moving(self, meshes: Sequence[Mesh]) -> None:
        """Take the meshes of the moving bodies, in their own frames."""
        self._bodies = [self._build(mesh) for mesh in meshes]

    def fill(
        self,
        camera: FloatArray,
        pattern: Pattern,
        tables: Tables,
        moving: bool,
        out: RayArray,
        progress: Progress | None = None,
    ) -> None:
        """Write the picture (h, w, 3), every sample counting in its own pixel alone."""
        self._check_open()
        per_row = -(-out.shape[1] * pattern.samples // LANES)
        rows = max(1, _BATCH // per_row)
        scratch = np.zeros((rows * per_row, SCRATCH_SIZE))
        rays = np.zeros((rows * per_row, RAY_SIZE), np.float32)
        keys, sums = np.zeros((KEY_ROWS, out.shape[1]), np.uint64), np.zeros(3)
        orders, numbers = np.zeros((3, orders_size(pattern)), np.int32), np.zeros(LANES, np.int64)
        fill_columns(pattern, 0, keys)
        for top in range(0, out.shape[0], rows):
            blocks = min(rows, out.shape[0] - top) * per_row
            _make_rays(camera, pattern, moving, top, keys, orders, numbers, scratch[:blocks], rays[:blocks])
            nearest = np.full(blocks * LANES, np.inf, np.float32)
            hits = self._trace(tables, camera, scratch[:blocks], rays[:blocks], nearest, camera[START])
            _shade(camera, pattern, tables, top, hits, scratch[:blocks], sums, out)
            if progress is not None:
                progress(min(top + rows, len(out)) / len(out))

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
        self._check_open()
        room = FilmRoom(camera, pattern, tables, moving, film, _BATCH)
        while (batch := room.next_batch()) is not None:
            batch.hits[:] = self._trace(tables, camera, batch.scratch, batch.rays, batch.ends(), camera[START])
            if scattering is None:
                batch.shade()
            else:
                self._follow(batch, tables, camera, scattering)
            batch.add()

    def spread(self, function: Callable[..., None], rows: int, *arguments: object) -> None:
        """Call a function of the first row and the one after of each part of `rows`: of one part here."""
        function(0, rows, *arguments)

    def _follow(self, batch: Batch, tables: Tables, camera: FloatArray, scattering: Scattering) -> None:
        """Follow the paths of a batch to their ends (see `path_kernels.film_paths`)."""
        batch.start_paths()
        for segment in range(MOST_SEGMENTS):
            any_lit, any_flies = batch.scatter(segment)
            if any_lit:
                for k in range(scattering.shadow_rays if len(tables.lights) else 0):
                    batch.aim_at_lights(segment, k, scattering.shadow_rays)
                    ends = batch.shadow_rays[:, RAY_TFAR : RAY_TFAR + LANES].ravel().copy()
                    hits = self._trace(tables, camera, batch.shadow, batch.shadow_rays, ends)
                    batch.take_light(hits != MISS)
                any_flies |= batch.leave_lit(scattering.bounces > 0, segment)
            if not any_flies:
                break
            hits = self._trace(tables, camera, batch.scratch, batch.rays, batch.ends())
            is_flying = batch.is_flying()
            batch.hits[is_flying] = hits[is_flying]
        batch.show_paths()

    def _trace(
        self,
        tables: Tables,
        camera: FloatArray,
        scratch: FloatArray,
        rays: RayArray,
        nearest: RayArray,
        start: float = 0.0,
    ) -> NDArray[np.int32]:
        """Return the triangles hit before the distances `nearest` (n,) by rays from a depth on, (blocks, LANES)."""
        hits = np.full(nearest.shape, MISS, np.int32)
        search = _Search(tables, camera, scratch, nearest, hits, start)
        if self._still is not None:
            search.look(self._still, rays, 0)
        for index, body in enumerate(self._bodies):
            own = rays.copy()
            _make_body_rays(tables.bodies[index], scratch, own, start)
            search.look(body, own, int(tables.firsts[index]), tables.bodies[index])
        return hits.reshape(-1, LANES)

    def _check_open(self) -> None:
        if self._is_closed:
            raise RuntimeError("this renderer has been closed")

    def close(self) -> None:
        """Free everything (again is harmless)."""
        self._still, self._bodies, self._is_closed = None, [], True


def _vectors(rays: RayArray, at: int) -> RayArray:
    """Return (n, 3) vectors of all lanes from the rows of the packets that start at `at`."""
    # RTCRayHit16 has tnear between origin and direction, hence rows of LANES from `at` on.
    rows = rays[:, at : at + 3 * LANES].reshape(-1, 3, LANES)
    return np.ascontiguousarray(rows.transpose(0, 2, 1).reshape(-1, 3))


@njit(cache=True, error_model="numpy", _nrt=False)
def _make_rays(
    camera: FloatArray, pattern: Pattern, moving: bool, top: int, keys: KeyArray, orders: NDArray[np.int32],
    numbers: NDArray[np.int64], scratch: FloatArray, rays: RayArray,
) -> None:  # fmt: skip
    samples = keys.shape[1] * pattern.samples
    per_row = (samples + LANES - 1) // LANES
    for block in range(len(scratch)):
        row, first = top + block // per_row, block % per_row * LANES
        if first == 0:
            fill_keys(pattern, 0, row, keys)
        lanes = min(LANES, samples - first)
        fill_positions(pattern, keys, row, first, lanes, orders, scratch[block])
        if moving:
            fill_times(pattern, keys, row, first, lanes, numbers, scratch[block])
            fill_moving_rays(camera, scratch[block], rays[block])
        else:
            fill_rays(camera, scratch[block], rays[block])


@njit(cache=True, error_model="numpy", _nrt=False)
def _make_body_rays(values: FloatArray, scratch: FloatArray, rays: RayArray, start: float) -> None:
    for block in range(len(scratch)):
        to_body(values, scratch[block])
        fill_body_rays(scratch[block], rays[block], rays[block], start)


@njit(cache=True, error_model="numpy", _nrt=False)
def _shade(
    camera: FloatArray, pattern: Pattern, tables: Tables, top: int, hits: NDArray[np.int32], scratch: FloatArray,
    sums: FloatArray, out: RayArray,
) -> None:  # fmt: skip
    textured = len(tables.triangles) > 0
    samples = out.shape[1] * pattern.samples
    per_row = (samples + LANES - 1) // LANES
    for block in range(len(scratch)):
        if textured:
            shade_textured(tables, camera, hits[block], scratch[block])
        else:
            shade_flat(tables, hits[block], scratch[block])
        row, first = top + block // per_row, block % per_row * LANES
        add_samples(pattern.samples, row, first, min(LANES, samples - first), scratch[block], sums, out)
