"""The plain engine: embreex's own single rays, for platforms without the packet path and as the check on it.

Rays and shading are the functions of the packet path; only the tracing differs. embreex traces at time 0 alone, so rays
go into every moving body's frame, as they do there; here no body is left out because it looks out of sight, which
makes this the check on that too.
"""

from collections.abc import Sequence

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.raytrace.bodies import fill_body_rays, to_body
from aliasbench.renderers.raytrace.lanes import (
    LANES,
    RAY_DX,
    RAY_OX,
    RAY_SIZE,
    SCRATCH_SIZE,
    KeyArray,
    Sampling,
    add_samples,
    fill_columns,
    fill_keys,
    fill_moving_rays,
    fill_positions,
    fill_rays,
    fill_times,
)
from aliasbench.renderers.raytrace.shading import MISS, Tables, shade_flat, shade_textured
from aliasbench.renderers.raytrace.tables import Mesh
from aliasbench.scenes.model import FloatArray

RayArray = NDArray[np.float32]
# Packets held at once: some 10 MB.
_BATCH = 4096


class PortableEngine:
    """Holds the scene's meshes in embreex and renders pictures ray by ray; see `tracer.Engine`."""

    __slots__ = ("_bodies", "_is_closed", "_robust", "_still")

    def __init__(self, *, robust: bool) -> None:
        self._robust = robust
        self._is_closed = False
        self._still: EmbreeScene | None = None
        self._bodies: list[EmbreeScene | None] = []

    def _build(self, mesh: Mesh) -> EmbreeScene | None:
        if not len(mesh.triangles):
            return None
        scene = EmbreeScene(robust=self._robust)
        TriangleMesh(scene, mesh.vertices.astype(np.float32), mesh.triangles.astype(np.int32))
        return scene

    def set_still(self, mesh: Mesh) -> None:
        """Take the mesh that stands still (replacing the one before)."""
        self._still = self._build(mesh)

    def set_moving(self, meshes: Sequence[Mesh]) -> None:
        """Take the meshes of the moving bodies, in their own frames."""
        self._bodies = [self._build(mesh) for mesh in meshes]

    def fill(self, camera: FloatArray, pattern: Sampling, tables: Tables, moving: bool, out: RayArray) -> None:
        """Write the picture (h, w, 3)."""
        if self._is_closed:
            raise RuntimeError("this renderer has been closed")
        per_row = -(-out.shape[1] * pattern.samples // LANES)
        rows = max(1, _BATCH // per_row)
        scratch = np.zeros((rows * per_row, SCRATCH_SIZE))
        rays = np.zeros((rows * per_row, RAY_SIZE), np.float32)
        keys, sums = np.zeros((4, out.shape[1]), np.uint64), np.zeros(3)
        fill_columns(pattern, keys)
        for top in range(0, out.shape[0], rows):
            blocks = min(rows, out.shape[0] - top) * per_row
            _make_rays(camera, pattern, moving, top, keys, scratch[:blocks], rays[:blocks])
            hits = self._trace(tables, scratch[:blocks], rays[:blocks])
            _shade(camera, pattern, tables, top, hits, scratch[:blocks], sums, out)

    def _trace(self, tables: Tables, scratch: FloatArray, rays: RayArray) -> NDArray[np.int32]:
        """Return the triangles hit, (blocks, LANES)."""
        nearest = np.full(rays.shape[0] * LANES, np.inf, np.float32)
        hits = np.full(nearest.shape, MISS, np.int32)
        if self._still is not None:
            self._nearer(self._still, rays, 0, nearest, hits)
        for index, body in enumerate(self._bodies):
            if body is None:
                continue
            _make_body_rays(tables.bodies[index], scratch, rays)
            self._nearer(body, rays, int(tables.firsts[index]), nearest, hits)
        return hits.reshape(-1, LANES)

    @staticmethod
    def _nearer(scene: EmbreeScene, rays: RayArray, first: int, nearest: RayArray, hits: NDArray[np.int32]) -> None:
        found = scene.run(_vectors(rays, RAY_OX), _vectors(rays, RAY_DX), output=1)
        is_nearer = (found["geomID"] >= 0) & (found["tfar"] < nearest)
        nearest[is_nearer] = found["tfar"][is_nearer]
        hits[is_nearer] = first + found["primID"][is_nearer]

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
    camera: FloatArray, pattern: Sampling, moving: bool, top: int, keys: KeyArray, scratch: FloatArray, rays: RayArray
) -> None:
    samples = keys.shape[1] * pattern.samples
    per_row = (samples + LANES - 1) // LANES
    for block in range(len(scratch)):
        row, first = top + block // per_row, block % per_row * LANES
        if first == 0:
            fill_keys(pattern, row, keys)
        lanes = min(LANES, samples - first)
        fill_positions(pattern, keys, row, first, lanes, scratch[block])
        if moving:
            fill_times(pattern, keys, first, lanes, scratch[block])
            fill_moving_rays(camera, scratch[block], rays[block])
        else:
            fill_rays(camera, scratch[block], rays[block])


@njit(cache=True, error_model="numpy", _nrt=False)
def _make_body_rays(values: FloatArray, scratch: FloatArray, rays: RayArray) -> None:
    for block in range(len(scratch)):
        to_body(values, scratch[block])
        fill_body_rays(scratch[block], rays[block], rays[block])


@njit(cache=True, error_model="numpy", _nrt=False)
def _shade(
    camera: FloatArray, pattern: Sampling, tables: Tables, top: int, hits: NDArray[np.int32], scratch: FloatArray,
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
