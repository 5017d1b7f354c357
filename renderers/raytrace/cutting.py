"""Triangles so large that float32 would misplace their outline, cut in float64 into parts that it does not.

An edge test's rounding grows with the distance to the edge's ends, not to the part of it that is seen: an outline that
reaches a million pictures far would be pixels away from its place. Along planes about the camera, which all triangles
are cut along alike so that what they share stays shared, everything is cut into parts not much larger than their
distance. Nothing is left out: shadows and reflections need what is outside of the picture. Ordinary scenes have no such
outline, and are left as they are. What is not mended: an edge that runs away from a pinhole keeps, where it is far, a
rounding of that distance.
"""

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.raytrace.tables import Mesh
from aliasbench.scenes.model import FloatArray
from aliasbench.scenes.projection import View

# What an edge test of three terms rounds by, of the largest coordinate; and what it may misplace, in pixels.
_ROUNDING, _TOLERANCE_PX = 8.0 * 2.0**-24, 2.0**-8
PLACED_PX = _TOLERANCE_PX / _ROUNDING  # so far away parallel rays place an edge's ends that well
_WIDTH = 2.0  # pictures: how wide a tube about an orthographic camera's axis is left whole
_STEP = 8.0  # between one plane's distance from a pinhole and the next one's
_MOST_STEPS = 64


def cut_large(
    mesh: Mesh, view: View, anchor: FloatArray, travel: float, nearest: float = np.inf, *, robust: bool = True
) -> tuple[Mesh, NDArray[np.int64] | None]:
    """Return a mesh of the same surface whose outlines float32 places to 1/256 px, and of which triangle each of its
    triangles is a part; the mesh itself, and None, if float32 does.

    Parameters
    ----------
    mesh : Mesh
        Vertices are relative to `anchor`.
    view : View
        What is to be seen well; `travel` is how far the camera may come from there, in world units.
    nearest : float
        How near a pinhole what must be cut whatever its outline begins, see `layers`.
    robust : bool
        Rays that are not robust slip through edges inside of a surface that are misplaced as well.
    """
    if not len(mesh.triangles):
        return mesh, None
    axes = np.stack([view.right, view.up, view.forward], axis=1)
    local = (mesh.vertices - (view.origin - anchor)) @ axes
    reach = float(np.abs(local).max())
    if not view.perspective:
        tube = _WIDTH / 2.0 * max(view.width, view.height) / view.scale + travel
        if reach * view.scale <= PLACED_PX or not _leaves_tube(mesh, local, tube).any():
            return mesh, None
        distances = [tube * _STEP**k for k in range(_steps(reach, tube))]
    else:
        nearest = min(nearest, _nearest_of_misplaced(_outline(mesh) if robust else _edges(mesh), local, view))
        if nearest == np.inf:
            return mesh, None
        distances = [nearest * _STEP**k for k in range(_steps(reach, nearest))]
    sides = range(3 if view.perspective else 2)
    planes = [(axes[:, k], sign * d) for d in distances for k in sides for sign in (1.0, -1.0)]
    return _cut(mesh, [(normal, offset + float(normal @ (view.origin - anchor))) for normal, offset in planes])


def _steps(reach: float, nearest: float) -> int:
    """Return how many cuts there are between the nearest and what reaches that far."""
    return min(_MOST_STEPS, 1 + int(np.log(max(reach / nearest, 1.0)) / np.log(_STEP)))


def first_cut(mesh: Mesh, view: View) -> float:
    """Return how near the origin of a mesh's frame it must be cut for float32 to place its edges, infinity if never.

    There is a pinhole, or what parallel rays of `view` see; edges may come into sight as the mesh turns.
    """
    if view.perspective:
        return _nearest_of_misplaced(_edges(mesh), mesh.vertices, view, everywhere=True)
    tube = _WIDTH / 2.0 * max(view.width, view.height) / view.scale
    reach = float(np.abs(mesh.vertices).max())
    return tube if reach * view.scale > PLACED_PX and reach > _STEP * tube else np.inf


def cut_about(mesh: Mesh, nearest: float, axes: FloatArray) -> tuple[Mesh, NDArray[np.int64]]:
    """Return a mesh cut at distances from its frame's origin that grow from `nearest` on along `axes` (3, 3), of length
    1, and of which triangles its triangles are parts.
    """
    reach = float(np.linalg.norm(mesh.vertices, axis=1).max())
    steps = min(_MOST_STEPS, 1 + int(np.log(max(reach / nearest, 1.0)) / np.log(_STEP)))
    return _cut(
        mesh, [(axis, sign * nearest * _STEP**k) for k in range(steps) for axis in axes for sign in (1.0, -1.0)]
    )


def _edges(mesh: Mesh) -> NDArray[np.int64]:
    """Return (3 m, 2): the vertices of the triangles' edges, the lower number first."""
    return np.sort(mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1).astype(np.int64)


def _outline(mesh: Mesh) -> NDArray[np.int64]:
    """Return (k, 2): the vertices of edges that belong to one triangle alone."""
    edges = _edges(mesh)
    _, first, count = np.unique(edges @ [len(mesh.vertices), 1], return_index=True, return_counts=True)
    out: NDArray[np.int64] = edges[first[count == 1]]
    return out


def _leaves_tube(mesh: Mesh, local: FloatArray, tube: float) -> NDArray[np.bool_]:
    """Return which triangles pass the tube and reach far out of it."""
    corners = local[mesh.triangles][..., :2]
    beyond = (corners > tube).all(axis=1) | (corners < -tube).all(axis=1)
    passes = ~np.any(beyond, axis=1)
    out: NDArray[np.bool_] = passes & (np.abs(corners).max(axis=(1, 2)) > _STEP * tube)
    return out


def _nearest_of_misplaced(
    edges: NDArray[np.int64], local: FloatArray, view: View, *, everywhere: bool = False
) -> float:
    """Return how near the eye edges come that float32 misplaces in the picture, or anywhere, infinity if none does.

    An edge's rounding turns it by its largest coordinate over its line's distance from the eye.
    """
    ends = local[edges]
    reach = np.abs(ends).max(axis=(1, 2))
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1)
    along /= np.maximum(length, np.finfo(np.float64).tiny)[:, None]
    height = np.linalg.norm(np.cross(ends[:, 0], along), axis=1)
    foot = np.clip(-(ends[:, 0] * along).sum(axis=1), 0.0, length)
    near = np.linalg.norm(ends[:, 0] + foot[:, None] * along, axis=1)
    wide = np.array([view.width, view.height]) / view.scale * (_WIDTH / 2.0)
    beyond = ends[..., 2:] * wide
    hidden = (ends[..., :2] > beyond).all(axis=1) | (ends[..., :2] < -beyond).all(axis=1)
    bad = (everywhere | ~np.any(hidden, axis=1)) & (near > 0.0) & (length > _STEP * near)
    bad &= reach * view.scale * _ROUNDING > _TOLERANCE_PX * height
    return float(near[bad].min(initial=np.inf))


def _cut(mesh: Mesh, planes: list[tuple[FloatArray, float]]) -> tuple[Mesh, NDArray[np.int64]]:
    """Return a mesh cut along planes normal . x = offset, and the triangles that its triangles are parts of."""
    corners = np.concatenate([mesh.vertices, mesh.uv], axis=1)[mesh.triangles]
    rows = np.arange(len(corners))
    for normal, offset in planes:
        distance = corners[..., :3] @ normal - offset
        ahead = distance >= 0.0
        count = ahead.sum(axis=1)
        crossed = (count == 1) | (count == 2)
        if not crossed.any():
            continue
        alone = ahead[crossed] == (count[crossed] == 1)[:, None]
        order = (np.argmax(alone, axis=1)[:, None] + np.arange(3)) % 3
        turned = np.take_along_axis(corners[crossed], order[..., None], axis=1)
        apart = np.take_along_axis(distance[crossed], order, axis=1)
        a, b, c = (turned[:, k] for k in range(3))
        left, right = (_crossing(turned, apart, k) for k in (1, 2))
        parts = [np.stack(p, axis=1) for p in ((a, left, right), (left, b, c), (left, c, right))]
        corners = np.concatenate([corners[~crossed], *parts])
        rows = np.concatenate([rows[~crossed], *[rows[crossed]] * 3])
    parts_mesh = Mesh(
        corners[..., :3].reshape(-1, 3),
        np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3),
        corners[..., 3:].reshape(-1, 2),
        mesh.owners[rows],
        mesh.holed[rows],
    )
    return parts_mesh, rows


def _crossing(corners: FloatArray, distance: FloatArray, k: int) -> FloatArray:
    """Return where the sides from corner 0 to corner k meet the plane, reckoned alike for both triangles at a side."""
    swap = (distance[:, 0] > distance[:, k])[:, None]
    low, high = np.where(swap, corners[:, k], corners[:, 0]), np.where(swap, corners[:, 0], corners[:, k])
    below, above = np.minimum(distance[:, 0], distance[:, k]), np.maximum(distance[:, 0], distance[:, k])
    share = (below / (below - above))[:, None]
    out: FloatArray = low + share * (high - low)
    return out
