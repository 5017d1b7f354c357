"""The flat faces of a scene's objects at rest: convex, each with a plane and a texture map of its own.

A convex polygon is kept whole (fewer edges to cross than its triangles), anything else is taken by triangles. All faces
of a polygon get their plane from the same three vertices, so that they stay coplanar after rounding.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.model import FloatArray, Scene, Surface


@dataclass(frozen=True, slots=True, eq=False)
class Faces:
    """Flat faces of all objects, at rest.

    Attributes
    ----------
    vertices : (n, 3) float64
    uv : (n, 2) float64
    corners, starts : (k,) and (m + 1,) int64
        Vertices of face i: corners[starts[i]:starts[i + 1]], in order, convex.
    outlined : (k,) bool
        Whether the edge from a corner to the next one is on the object's outline.
    spread : (m, 3) int64
        Three vertices that give the face's plane and texture map; the same for all faces of a polygon.
    owners : (m,) int64
        The object of each face.
    ranges : tuple of slices
        The vertices of each object.
    """

    vertices: FloatArray
    uv: FloatArray
    corners: NDArray[np.int64]
    starts: NDArray[np.int64]
    outlined: NDArray[np.bool_]
    spread: NDArray[np.int64]
    owners: NDArray[np.int64]
    ranges: tuple[slice, ...]


def build_faces(scene: Scene) -> Faces:
    """Return the faces of a scene's objects: a convex polygon is one, anything else one for each triangle."""
    vertices, uv, ranges = [np.zeros((0, 3))], [np.zeros((0, 2))], []
    corners: list[int] = []
    starts, outlined, spread, owners = [0], [], [], []
    offset = 0
    for index, surface in enumerate(scene.objects):
        n = len(surface.vertices)
        vertices.append(surface.vertices)
        uv.append(surface.uv if surface.uv is not None else np.zeros((n, 2)))
        ranges.append(slice(offset, offset + n))
        whole = surface.is_polygon and (surface.texture is None or _is_affine(surface))
        common = _spread(surface.vertices) if whole else None
        if surface.is_polygon and whole and _is_convex(surface.vertices):
            loops, flags = [list(range(n))], [[True] * n]
        else:
            loops = [t for t in surface.triangles.tolist() if len(set(t)) == 3]
            flags = _outline_flags(surface, loops)
        for loop, flag in zip(loops, flags, strict=True):
            corners.extend(v + offset for v in loop)
            outlined.extend(flag)
            starts.append(len(corners))
            spread.append([v + offset for v in (common or loop)])
            owners.append(index)
        offset += n
    return Faces(
        np.concatenate(vertices),
        np.concatenate(uv),
        np.array(corners, np.int64),
        np.array(starts, np.int64),
        np.array(outlined, bool),
        np.array(spread, np.int64).reshape(-1, 3),
        np.array(owners, np.int64),
        tuple(ranges),
    )


def _outline_flags(surface: Surface, loops: list[list[int]]) -> list[list[bool]]:
    """Return for each edge of each triangle whether it is no diagonal; every edge of a mesh may be a silhouette."""
    edges = [[tuple(sorted((t[k], t[(k + 1) % 3]))) for k in range(3)] for t in loops]
    seen: dict[tuple[int, ...], int] = {}
    for edge in (e for triangle in edges for e in triangle):
        seen[edge] = seen.get(edge, 0) + 1
    return [[not surface.is_polygon or seen[e] == 1 for e in triangle] for triangle in edges]


def _spread(vertices: FloatArray) -> list[int]:
    """Return three far-apart vertices: the farthest from the first, and the farthest from the line through both."""
    v = vertices - vertices[0]
    b = int(np.argmax((v**2).sum(axis=1)))
    c = int(np.argmax((np.cross(v, v[b]) ** 2).sum(axis=1)))
    return [0, b, c]


def _is_convex(vertices: FloatArray) -> bool:
    edge = np.roll(vertices, -1, axis=0) - vertices
    turns = np.cross(edge, np.roll(edge, -1, axis=0))
    normal = np.cross(vertices - vertices[0], np.roll(vertices, -1, axis=0) - vertices[0]).sum(axis=0)
    if (turns @ normal < 0.0).any():
        return False
    # all turns to one side and one turn in total: a star polygon turns twice
    lengths = np.linalg.norm(edge, axis=1)
    following = np.roll(edge, -1, axis=0)
    angles = np.arctan2(np.linalg.norm(turns, axis=1), (edge * following).sum(axis=1))
    return bool((lengths > 0).all() and abs(angles.sum() - 2 * np.pi) < 1e-6)


def _is_affine(surface: Surface) -> bool:
    """Return whether one affine map takes all of a polygon's vertices to their texture coordinates."""
    if surface.uv is None:
        return True
    a, b, c = _spread(surface.vertices)
    e1, e2 = surface.vertices[b] - surface.vertices[a], surface.vertices[c] - surface.vertices[a]
    weights = np.linalg.lstsq(np.stack([e1, e2], axis=1), (surface.vertices - surface.vertices[a]).T, rcond=None)[0].T
    predicted = surface.uv[a] + weights @ np.stack([surface.uv[b] - surface.uv[a], surface.uv[c] - surface.uv[a]])
    return bool(np.abs(predicted - surface.uv).max() <= 1e-12 * max(1.0, float(np.abs(surface.uv).max())))
