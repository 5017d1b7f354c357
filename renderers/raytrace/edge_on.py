"""Triangles that a camera looks at along their plane: they have no area in the picture, and Embree is not told.

For a ray in a triangle's plane all three of Embree's edge tests are rounding and nothing else, in robust mode too: one
ray in some ten "hits" the triangle anywhere within its bounding box, pixels away from where it lies. A closed mesh with
sides along the rays then shows them beside its outline. What is left out is thinner in the picture than float32 rays
are exact; what merely is small or thin, but faces the camera, stays, so that surfaces keep no gaps.
"""

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.raytrace.tables import Mesh
from aliasbench.scenes.model import FloatArray
from aliasbench.scenes.projection import View

# Sine of the angle between ray and plane. Float32 keeps the sign of any volume above some 2^-20 of its factors.
_STEEPEST = 2.0**-12
_THROUGH_EYE = 2.0**-48  # distance of a plane from the eye, relative to what it is reckoned from
_DEEPEST = 8.0  # farthest over least depth of a triangle of which all parts are seen alike
# Of 2^-24: what the roundings of Embree's robust test add up to at most, see `bench.hard.edge_pictures`.
_ROUNDINGS = 16.0


def through_eye(mesh: Mesh, eye: FloatArray, flat: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the triangles whose plane holds a pinhole but for rounding, of objects that are `flat`.

    A pinhole sees nothing of a polygon in whose plane it is; rounded to float32 such a polygon passes by it at some
    distance, and may hide half of the picture.
    """
    numbers = np.flatnonzero(flat[mesh.owners])
    a, b, c = (mesh.vertices[mesh.triangles[numbers, k]] - eye for k in range(3))
    first, second = b - a, c - a
    distance = np.abs((np.cross(first, second) * a).sum(axis=1))
    lengths = np.prod([np.linalg.norm(v, axis=1) for v in (a, first, second)], axis=0)
    out: NDArray[np.int64] = numbers[distance <= _THROUGH_EYE * lengths]
    return out


def seen_edge_on(mesh: Mesh, view: View, anchor: FloatArray) -> NDArray[np.int64]:
    """Return the triangles of a mesh (relative to `anchor`) that `view` sees along their plane."""
    rows = np.flatnonzero(_are_steep(mesh, view, anchor))
    return rows[_are_thin(mesh.vertices[mesh.triangles[rows]] + anchor, view)] if len(rows) else rows


def without(mesh: Mesh, dropped: NDArray[np.int64]) -> tuple[Mesh, NDArray[np.int64]]:
    """Return a mesh without some of its triangles, and which of them it keeps."""
    kept = np.setdiff1d(np.arange(len(mesh.triangles)), dropped)
    return Mesh(mesh.vertices, mesh.triangles[kept], mesh.uv, mesh.owners[kept], mesh.holed[kept]), kept


def _are_steep(mesh: Mesh, view: View, anchor: FloatArray) -> NDArray[np.bool_]:
    """Return (m,): of which triangles, those without area apart, a ray to a corner is nearly in the plane."""
    local = mesh.vertices - (view.origin - anchor)
    # products of six lengths stay in float64's range
    local /= float(np.abs(local).max(initial=0.0)) or 1.0
    x, y, z = (np.ascontiguousarray(column)[mesh.triangles.T] for column in local.T)
    ax, ay, az, bx, by, bz = x[1] - x[0], y[1] - y[0], z[1] - z[0], x[2] - x[0], y[2] - y[0], z[2] - z[0]
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    rx, ry, rz = (x[0], y[0], z[0]) if view.perspective else view.forward
    facing, normal = nx * rx + ny * ry + nz * rz, nx**2 + ny**2 + nz**2
    out: NDArray[np.bool_] = (facing**2 <= _STEEPEST**2 * (normal * (rx**2 + ry**2 + rz**2))) & (normal > 0.0)
    return out


def _are_thin(corners: FloatArray, view: View) -> NDArray[np.bool_]:
    """Return (m,): which triangles (m, 3, 3) are thinner in the picture than rays are exact there."""
    reach = np.linalg.norm(corners - view.origin, axis=-1).max(axis=1)
    depth = view.to_camera(corners)[..., 2].min(axis=1)
    if view.perspective:
        before = depth > 0.0
        # of one that reaches far beyond its nearest corner the nearer part may be seen well
        before &= reach <= _DEEPEST * depth
        depth = np.where(before, depth, 1.0)
        image = view.project(np.where(before[:, None, None], corners, view.origin + view.forward))[..., :2]
        exact = view.scale * (reach / depth) ** 2
    else:
        before = np.ones(len(corners), dtype=np.bool_)
        image = view.project(corners)[..., :2]
        exact = view.scale * reach
    sides = np.roll(image, -1, axis=1) - image
    area = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
    longest = np.linalg.norm(sides, axis=-1).max(axis=1)
    out: NDArray[np.bool_] = before & (area <= longest * exact * (_ROUNDINGS * 2.0**-24))
    return out
