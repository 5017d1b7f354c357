"""Coplanar polygons that stand still before a pinhole, each layer a little nearer: more so where rays graze its plane.

A plane is known to some ulp of the distance of its corners, and a ray that grazes it meets it accordingly early or
late: at distance z, seen from a height d above the plane, by z / d times as many ulp of z. Two polygons in one plane
need to be that far apart. Scaled about the eye by 1 / (1 + k (step + tilt z / d)), which takes a plane to a plane and
leaves every point of the picture where it is, layer k is: raised by k step of the eye's height above the plane, and
tilted by k tilt. Layers that move, or are seen through a lens or by scattered light, are bodies (`bodies.nearer`).
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.raytrace.bodies import LEAST_HEIGHT
from aliasbench.renderers.raytrace.tables import Mesh
from aliasbench.scenes.model import FloatArray
from aliasbench.scenes.projection import View

_DEEP = 16.0
_LEAST = 0.5  # of a factor's inverse; only what is behind the camera comes below


def plane_distances(mesh: Mesh, eye: FloatArray, count: int) -> FloatArray:
    """Return (count,): how far from the eye each object's plane is, by its largest triangle."""
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] - eye for k in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    largest = np.argsort(length, kind="stable")  # of those of an object the last is kept
    out = np.zeros(count)
    with np.errstate(divide="ignore", invalid="ignore"):
        out[mesh.owners[largest]] = np.nan_to_num(np.abs((normal * a).sum(axis=1)) / length)[largest]
    return out


def bring_nearer(
    mesh: Mesh,
    steps: FloatArray,
    tilts: FloatArray,
    distances: FloatArray,
    view: View,
    anchor: FloatArray,
    most: float = np.inf,
) -> Mesh:
    """Return a mesh with its triangles nearer to the eye by steps and tilts (m,), in the same place of the picture.

    `distances` (objects,) are those of the objects' planes from the eye; by a share of `most` nothing is nearer.
    """
    rows = np.flatnonzero(steps)
    eye = view.origin - anchor
    local = mesh.vertices[mesh.triangles[rows]] - eye
    height = np.maximum(distances[mesh.owners[rows]], LEAST_HEIGHT * np.abs(local).max(axis=(1, 2)))
    tilt = np.divide(tilts[rows], height, out=np.zeros_like(height), where=height > 0.0)
    shares = steps[rows][:, None] + tilt[:, None] * (local @ view.forward)
    nearer = eye + local / np.maximum(1.0 + np.minimum(shares, most), _LEAST)[..., None]
    triangles = mesh.triangles.copy()
    triangles[rows] = len(mesh.vertices) + np.arange(3 * len(rows), dtype=np.int32).reshape(-1, 3)
    return replace(
        mesh,
        vertices=np.concatenate([mesh.vertices, nearer.reshape(-1, 3)]),
        triangles=triangles,
        uv=np.concatenate([mesh.uv, np.zeros((3 * len(rows), 2))]),
    )


def nearest_of_deep(mesh: Mesh, stacked: NDArray[np.bool_], distances: FloatArray, eye: FloatArray) -> float:
    """Return how near the eye planes with layers, of triangles that are `stacked` (m,), come that reach far beyond;
    infinity if none does.

    So deep a triangle's corners are rounded by more than layers are apart where it is near.
    """
    rows = np.flatnonzero(stacked)
    reach = np.linalg.norm(mesh.vertices[mesh.triangles[rows]] - eye, axis=2).max(axis=1)
    height = distances[mesh.owners[rows]]
    deep = (reach > _DEEP * height) & (height > 0.0)
    # in the plane but for rounding, it is seen as a line
    return float(np.maximum(height, LEAST_HEIGHT * reach)[deep].min(initial=np.inf))
