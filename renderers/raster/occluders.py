"""What may throw a shadow from one point of a light: pyramids over triangles, made in float64 for every pass.

With the point at hand, to be hidden by a triangle is to lie beyond it in the pyramid over it: three scalar products in
the shader (light.glsl), exact for every sample. Triangles that cannot come between that point and anything lit are left
out: those behind the light, and those that have all that is lit on the light's side of their plane, as a floor has.
The others go in groups of neighbours, each within a cone that is tried first.
"""

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.lights import OFF_SURFACE
from aliasbench.scenes.model import FloatArray

GROUP = 16  # triangles; on llvmpipe 4 to 8 cost up to 2.5 times as much, 32 about the same
_FLAT = 1e-12  # of the product of three distances: seen edge-on from the light, a triangle hides nothing
_WIDE = 0.05  # cosine; cones wider than that are not asked
_ROUNDING = 1e-5  # of float32, in cosines
_MORTON_BITS = 10

BoolArray = NDArray[np.bool_]


def neighbours_order(corners: FloatArray) -> NDArray[np.int64]:
    """Return an order of triangles (m, 3, 3) in which neighbours are near each other (along a Morton curve)."""
    middles = corners.mean(axis=1)
    low, high = middles.min(axis=0, initial=np.inf), middles.max(axis=0, initial=-np.inf)
    extent = np.maximum(high - low, 1e-300).max(initial=1e-300)
    cells = np.clip((middles - low) / extent * (1 << _MORTON_BITS), 0, (1 << _MORTON_BITS) - 1).astype(np.int64)
    code = np.zeros(len(cells), np.int64)
    for bit in range(_MORTON_BITS):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


def box_corners(points: FloatArray) -> FloatArray:
    """Return the (8, 3) corners of the box about points (..., 3)."""
    flat = points.reshape(-1, 3)
    ends = np.stack([flat.min(axis=0), flat.max(axis=0)])
    return np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def may_come_between(corners: FloatArray, lit: FloatArray, points: FloatArray, normals: FloatArray) -> BoolArray:
    """Return (k, m) which triangles may come between each light point and what is lit; arguments as `pyramids` has."""
    slack = OFF_SURFACE * float(max(np.abs(corners).max(initial=0.0), np.abs(lit).max(initial=0.0)))
    heights = np.einsum("mij,kj->kmi", corners, normals).max(axis=2, initial=-np.inf)
    before = heights - np.einsum("ki,ki->k", points, normals)[:, None] > slack
    plane = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(plane, axis=1, keepdims=True)
    plane = np.divide(plane, length, out=np.zeros_like(plane), where=length > 0.0)
    offsets = np.einsum("mi,mi->m", plane, corners[:, 0])
    beyond = lit @ plane.T - offsets  # (n, m)
    here = points @ plane.T - offsets  # (k, m)
    above, below = beyond.min(axis=0) < -slack, beyond.max(axis=0) > slack
    out: BoolArray = before & np.where(here > 0.0, above, below)
    return out


def pyramids(
    corners: FloatArray, lit: FloatArray, points: FloatArray, normals: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Return what takes a place relative to each light point to its shares of each triangle's corners, and who counts.

    Parameters
    ----------
    corners : (m, 3, 3) float64
        Of the triangles.
    lit : (n, 3) float64
        Points whose hull holds all that is lit.
    points, normals : (k, 3) float64
        On the lights, and which way they shine.

    Returns
    -------
    shares : (k, m, 3, 3) float64
    may_hide : (k, m) bool
        False for triangles that cannot come between; their shares are 0.
    """
    edges = corners - points[:, None, None]  # (k, m, 3, 3)
    a, b, c = edges[:, :, 0], edges[:, :, 1], edges[:, :, 2]
    shares = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=2)
    volume = np.einsum("kmi,kmi->km", a, shares[:, :, 0])
    size = np.linalg.norm(edges, axis=3).prod(axis=2)
    may_hide = may_come_between(corners, lit, points, normals) & (np.abs(volume) > _FLAT * size)
    shares = np.divide(shares, volume[:, :, None, None], out=np.zeros_like(shares), where=may_hide[:, :, None, None])
    return shares, may_hide


def cones(edges: FloatArray) -> FloatArray:
    """Return (g, 4): axis and cosine of cones about the origin that hold groups of triangles (g, n, 3, 3)."""
    directions = edges.reshape(len(edges), -1, 3)
    lengths = np.linalg.norm(directions, axis=2, keepdims=True)
    directions = np.divide(directions, lengths, out=np.zeros_like(directions), where=lengths > 0.0)
    axes = directions.sum(axis=1)
    norms = np.linalg.norm(axes, axis=1, keepdims=True)
    axes = np.divide(axes, norms, out=np.zeros_like(axes), where=norms > 0.0)
    cosines = np.einsum("gni,gi->gn", directions, axes).min(axis=1) - _ROUNDING
    return np.concatenate([axes, np.where(cosines > _WIDE, cosines, -2.0)[:, None]], axis=1)
