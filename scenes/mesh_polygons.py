"""Faces of any number of corners cut into triangles, a million at a time.

A fan about the first corner covers a convex face and nothing else; of a concave one it covers too much, some of it
twice. So the faces that turn both ways are found, by the thousand at once, and cut by the triangulation that `shapes`
uses for polygons. Files hold faces that are no polygons too: bent ones are cut as they are seen along the axis in which
they are seen largest, and where the outline crosses itself nothing is right, and the fan is as good as anything.
"""

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.limits import LENGTH
from aliasbench.scenes.model import FloatArray

_CHUNK = 2**17  # corners looked at together
_TURN = 1e-6  # sine of a turn the wrong way that is no rounding of float32 coordinates

Corners = NDArray[np.integer]


def cut_faces(corners: Corners, counts: NDArray[np.int64], positions: FloatArray) -> NDArray[np.int64]:
    """Return the triangles that cut faces, each wound as its face is.

    Parameters
    ----------
    corners : (c,) integers
        Indices of positions, one face after the other. Faces with an index that has no position are cut as fans.
    counts : (f,) int64
        How many corners each face has, at least 3.
    positions : (n, 3) float64
        Not necessarily finite, or within limits: what is not is cut as fans too.

    Returns
    -------
    (m, 3) int64
        Numbers of corners, from 0 to c - 1. Convex faces come first, in order.
    """
    starts = np.cumsum(counts) - counts
    several = np.flatnonzero(counts > 3)
    concave = np.zeros(len(counts), dtype=bool)
    ends = np.cumsum(counts[several])
    at = 0
    while at < len(several):
        before = int(ends[at - 1]) if at else 0
        stop = max(at + 1, int(np.searchsorted(ends, before + _CHUNK, side="right")))
        chosen = several[at:stop]
        concave[chosen] = _turn_both_ways(corners, starts[chosen], counts[chosen], positions)
        at = stop
    if not concave.any():
        return _fans(starts, counts)
    cut, done = _cut_concave(corners, starts, counts, np.flatnonzero(concave), positions)
    return np.concatenate([_fans(starts[~done], counts[~done]), cut])


def _fans(starts: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.int64]:
    triangles = counts - 2
    first = np.repeat(starts, triangles)
    step = np.arange(len(first)) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    return np.stack([first, first + step + 1, first + step + 2], axis=1)


def _numbers(starts: NDArray[np.int64], counts: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the numbers of the corners of faces, one after the other, and where each face begins among them."""
    local = np.cumsum(counts) - counts
    return np.arange(int(counts.sum())) + np.repeat(starts - local, counts), local


def _turn_both_ways(
    corners: Corners, starts: NDArray[np.int64], counts: NDArray[np.int64], positions: FloatArray
) -> NDArray[np.bool_]:
    """Return whether each face turns the wrong way at a corner, seen along its normal."""
    numbers, local = _numbers(starts, counts)
    index = corners[numbers]
    known = (index >= 0) & (index < len(positions))
    points = positions[np.where(known, index, 0)]
    known &= (np.abs(points) <= LENGTH).all(axis=1)
    following = np.arange(1, len(index) + 1)
    following[local + counts - 1] = local
    with np.errstate(all="ignore"):
        edges = points[following] - points
        # Units of its longest edge, so that nothing over- or underflows whatever the model's size.
        size = np.maximum.reduceat(np.abs(edges).max(axis=1), local)
        edges /= np.repeat(size, counts)[:, None]
        turns = _cross(edges, edges[following])
        spokes = (points - np.repeat(points[local], counts, axis=0)) / np.repeat(size, counts)[:, None]
        normals = np.add.reduceat(_cross(spokes, edges), local)
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        lengths = np.linalg.norm(edges, axis=1)
        along = (turns * np.repeat(normals, counts, axis=0)).sum(axis=1)
        wrong = along < -_TURN * lengths * lengths[following]
    return np.logical_or.reduceat(wrong, local) & np.logical_and.reduceat(known, local)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    x, y, z = a.T
    u, v, w = b.T
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=1)


def _cut_concave(
    corners: Corners,
    starts: NDArray[np.int64],
    counts: NDArray[np.int64],
    faces: NDArray[np.int64],
    positions: FloatArray,
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return the triangles of the faces that are simple polygons, and which of all faces these are."""
    import shapely

    done = np.zeros(len(counts), dtype=bool)
    numbers, local = _numbers(starts[faces], counts[faces])
    owner = np.repeat(np.arange(len(faces)), counts[faces])
    flat = _flattened(positions[corners[numbers]], owner, local)
    rings = shapely.linearrings(flat, indices=owner)
    polygons = shapely.polygons(rings)
    polygons[~(shapely.is_simple(rings) & shapely.is_valid(polygons))] = None
    cut = _triangulated(polygons)
    simple = ~shapely.is_missing(cut)
    if not simple.any():
        return np.empty((0, 3), np.int64), done
    pieces, piece_of = shapely.get_parts(cut, return_index=True)
    outlines = shapely.get_coordinates(shapely.get_exterior_ring(pieces)).reshape(-1, 4, 2)[:, :3]
    # Triangles come back as coordinates, which are the corners' own: equal rows are the same corner of the same face.
    owner_of = np.repeat(piece_of, 3)
    rows = np.concatenate([np.column_stack([owner, flat]), np.column_stack([owner_of, outlines.reshape(-1, 2)])])
    _, first, row = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    triangles = first[row.reshape(-1)[len(flat) :]].reshape(-1, 3)
    a, b, c = (flat[triangles[:, k]] for k in range(3))
    areas = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    counter_clockwise = shapely.is_ccw(rings)[owner[triangles[:, 0]]]
    turned = (areas > 0) != counter_clockwise
    triangles[turned] = triangles[turned][:, ::-1]
    done[faces[simple]] = True
    return numbers[triangles], done


def _triangulated(polygons: NDArray[np.object_]) -> NDArray[np.object_]:
    """Return polygons' triangulations, None for None and for what is too small or too thin for GEOS."""
    import shapely

    try:
        return np.asarray(shapely.constrained_delaunay_triangles(polygons))
    except shapely.errors.GEOSException:
        if len(polygons) == 1:
            return np.array([None])
    # One spoils it for all: halves, until it is alone.
    middle = len(polygons) // 2
    return np.concatenate([_triangulated(polygons[:middle]), _triangulated(polygons[middle:])])


def _flattened(points: FloatArray, owner: NDArray[np.int64], local: NDArray[np.int64]) -> FloatArray:
    """Return points (c, 2) in the two coordinates in which their face is seen largest, untouched but for -0."""
    counts = np.diff(np.append(local, len(points)))
    following = np.arange(1, len(points) + 1)
    following[local + counts - 1] = local
    relative = points - points[local][owner]
    relative /= np.maximum.reduceat(np.abs(relative).max(axis=1), local)[owner][:, None]
    dropped = np.abs(np.add.reduceat(_cross(relative, relative[following]), local)).argmax(axis=1)[owner]
    each = np.arange(len(points))
    return np.stack([points[each, (dropped + 1) % 3], points[each, (dropped + 2) % 3]], axis=1) + 0.0
