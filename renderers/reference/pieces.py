"""The scene at one instant as convex pieces in the picture: what every exact reference starts from.

Faces (outlines of convex polygons, else triangles) are taken to camera space, cut by the near plane and by the border
of the picture with a margin, and projected. Cutting before the division keeps coordinates small, so a plane that runs
behind the camera loses no digits. Everything that neighbours share is computed from the same numbers in the same
order, whichever face asks: shared edges stay shared to the last bit, and parts of a plane leave no gap.

Nearness (minus the depth, or 1 / depth under perspective) and texture coordinates (times nearness) are affine in the
picture, three coefficients each.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import called
from aliasbench.renderers.reference.clipping import (
    NEAR_PARALLEL,
    NEAR_PERSPECTIVE,
    ONE_CORNER,
    PLANES,
    cross,
    cut_polygon,
    dot,
    face_planes,
    inside_plane,
    merge_corners,
    minus,
)  # fmt: skip
from aliasbench.renderers.reference.faces import Faces
from aliasbench.renderers.reference.paths import Paths
from aliasbench.scenes.model import FloatArray
from aliasbench.scenes.projection import View

IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

MARGIN_PX = 4.0  # scenes go on outside the picture; an open shutter needs room for what comes in during a slice


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """Convex pieces in the picture, positively oriented (x right, y down), of one or several instants.

    Attributes
    ----------
    points : (k, 2) float64
        Corners in pixels.
    reach : (k,) float64
        Bounds on the speed of points of the edge that starts at a corner, in pixels per frame interval.
    outlined : (k,) bool
    starts : (m + 1,) int64
    planes : (m, 4, 3) float64
        Coefficients (of x, y and 1) of nearness, u q, v q and q, with q = nearness under perspective, else 1.
    owners : (m,) int64
    instants : (t + 1,) int64
        The pieces of instant i: instants[i] to instants[i + 1].
    faces : (m,) int64
        The face that each is a piece of.
    loose : (n,) int64
        Faces of which more may come into the picture within the slice around the instant: from beyond the margin, or
        through the near plane.
    loose_speeds : (n,) float64
        How fast its border may come in, in pixels per frame interval; inf where that is not known.
    """

    points: FloatArray
    reach: FloatArray
    outlined: NDArray[np.bool_]
    starts: NDArray[np.int64]
    planes: FloatArray
    owners: NDArray[np.int64]
    instants: NDArray[np.int64]
    faces: NDArray[np.int64]
    loose: NDArray[np.int64]
    loose_speeds: FloatArray


def pieces_at(
    faces: Faces,
    paths: Paths,
    view: View,
    frame: int,
    fraction: float,
    slice_length: float = 0.0,
) -> Pieces:
    """Return the pieces of one instant.

    Parameters
    ----------
    faces, paths
        Of the scene.
    view : View
        The camera at the instant.
    frame, fraction
        The instant, see `scenes.motion`.
    slice_length : float
        Length of the time slice around the instant, in frame intervals; enters the speeds.
    """
    world = paths.positions(faces.vertices, faces.ranges, frame, fraction)
    local = world - view.origin
    # sums in a fixed order, unlike a matrix product, so that equal vertices of different objects stay equal
    camera = np.stack(
        [
            local[:, 0] * axis[0] + local[:, 1] * axis[1] + local[:, 2] * axis[2]
            for axis in (view.right, view.up, view.forward)
        ],
        axis=1,
    ).reshape(-1, 3)
    speed = paths.speeds(faces.vertices, faces.ranges, camera, frame)
    share = NEAR_PERSPECTIVE if view.perspective else NEAR_PARALLEL
    near = share * float(np.abs(camera).max(initial=1e-285))
    half = np.array([view.width / 2 + MARGIN_PX, view.height / 2 + MARGIN_PX]) / view.scale
    count = len(faces.owners)
    room = len(faces.corners) + PLANES * count
    points, reach = np.empty((room, 2)), np.empty(room)
    outlined, starts = np.empty(room, np.bool_), np.zeros(count + 1, np.int64)
    planes, kept, loose = np.empty((count, 4, 3)), np.empty(count, np.int64), np.zeros(count)
    widest = int(np.diff(faces.starts).max(initial=0)) + PLANES + 1
    k, m = _clip_project(
        camera, speed, faces.uv, faces.corners, faces.starts, faces.outlined, faces.spread, near, half,
        view.perspective, view.scale, view.width / 2, view.height / 2, slice_length,
        np.empty((2, widest, 5)), points, reach, outlined, starts, planes, kept, loose,
    )  # fmt: skip
    return Pieces(
        points[:k],
        reach[:k],
        outlined[:k],
        starts[: m + 1],
        planes[:m],
        faces.owners[kept[:m]],
        np.array([0, m], np.int64),
        kept[:m],
        np.flatnonzero(loose),
        loose[loose > 0.0],
    )


def join_pieces(parts: list[Pieces]) -> Pieces:
    """Return the pieces of several instants as one set."""
    corners = np.cumsum([0] + [len(p.points) for p in parts])
    counts = np.cumsum([0] + [len(p.owners) for p in parts])
    return Pieces(
        np.concatenate([p.points for p in parts]),
        np.concatenate([p.reach for p in parts]),
        np.concatenate([p.outlined for p in parts]),
        np.concatenate([np.zeros(1, np.int64)] + [p.starts[1:] + c for p, c in zip(parts, corners[:-1], strict=True)]),
        np.concatenate([p.planes for p in parts]),
        np.concatenate([p.owners for p in parts]),
        counts.astype(np.int64),
        np.concatenate([p.faces for p in parts]),
        np.concatenate([p.loose for p in parts]),
        np.concatenate([p.loose_speeds for p in parts]),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _clip_project(
    camera: FloatArray, speed: FloatArray, uv: FloatArray, corners: IntArray, first: IntArray, edge_flags: BoolArray,
    spread: IntArray, near: float, half: FloatArray, perspective: bool, scale: float, cx: float, cy: float,
    slice_length: float, work: FloatArray, points: FloatArray, reach: FloatArray, outlined: BoolArray,
    starts: IntArray, planes: FloatArray, kept: IntArray, loose: FloatArray,
) -> tuple[int, int]:  # fmt: skip
    """Fill the output arrays; return the numbers of corners and pieces."""
    k, m = 0, 0
    close = ONE_CORNER * 2.0 * max(cx, cy)
    edge = np.empty(work.shape[1], np.int64)
    for f in range(len(first) - 1):
        n = first[f + 1] - first[f]
        now = 0
        for i in range(n):
            v = corners[first[f] + i]
            for c in range(3):
                work[now, i, c] = camera[v, c]
            work[now, i, 3] = speed[v]
            work[now, i, 4] = 1.0 if edge_flags[first[f] + i] else 0.0
        if slice_length > 0.0:
            loose[f] = _may_come_in(work[now], n, half, near, perspective, scale, slice_length / 2)
        for plane in range(5):
            n = cut_polygon(work[now], n, plane, half, near, perspective, work[1 - now])
            now = 1 - now
            if n < 3:
                break
        if n < 3:
            continue
        # seen edge-on at its middle, a moving face may open within the slice: it stays, with a plane of no value
        opens = slice_length > 0.0 and speed[corners[first[f]]] + speed[corners[first[f] + 1]] > 0.0
        if not face_planes(camera, uv, spread[f], perspective, scale, cx, cy, planes[m]):
            if not opens:
                continue
            planes[m] = np.nan
        p = work[now]
        area = 0.0
        for i in range(n):
            s = scale / p[i, 2] if perspective else scale
            points[k + i, 0] = cx + p[i, 0] * s
            points[k + i, 1] = cy - p[i, 1] * s
        for i in range(n):
            edge[i] = i
        whole = n
        if slice_length == 0.0:
            n = merge_corners(points[k : k + n], n, close, edge)
            if n < 3:
                continue
        for i in range(n):
            j = (i + 1) % n
            ax, ay = points[k + i, 0] - points[k, 0], points[k + i, 1] - points[k, 1]
            bx, by = points[k + j, 0] - points[k, 0], points[k + j, 1] - points[k, 1]
            area += ax * by - bx * ay
        if not abs(area) > 1e-300:
            if not opens:
                continue
            planes[m] = np.nan
        for c in range(n):
            i, j = edge[c], (edge[c] + 1) % whole
            outlined[k + c] = p[i, 4] != 0.0
            if perspective:
                # over the whole slice: the depth may shrink by what the speed allows in half of it
                v = max(p[i, 3], p[j, 3])
                z = min(p[i, 2], p[j, 2]) - v * slice_length / 2.0
                wide = 0.0
                for e in (i, j):
                    wide = max(wide, 1.0 + (p[e, 0] ** 2 + p[e, 1] ** 2) / p[e, 2] ** 2)
                bound = 0.0
                if v > 0.0:
                    bound = 1.1 * scale * v * np.sqrt(wide) / z if z > 0.0 else np.inf
                reach[k + c] = bound
            else:
                reach[k + c] = scale * max(p[i, 3], p[j, 3])
        if area < 0.0:
            _reverse(points[k : k + n], reach[k : k + n], outlined[k : k + n], n)
        kept[m] = f
        k += n
        m += 1
        starts[m] = k
    return k, m


@called
def _may_come_in(
    corners: FloatArray, n: int, half: FloatArray, near: float, perspective: bool, scale: float, time: float,
) -> float:  # fmt: skip
    """Return how fast a part of a face that is cut away now may come to be seen in the slice: 0 never, inf not known.

    A point beyond the margin has to move by more than the margin: orthographically in pixels; under perspective within
    `margin z / scale` of the world, so its depth is small, and the face's plane must pass close by the camera.
    """
    fastest, lowest = 0.0, np.inf
    for i in range(n):
        fastest = max(fastest, corners[i, 3])
        lowest = min(lowest, corners[i, 2] - corners[i, 3] * time)
    if fastest == 0.0:
        return 0.0
    way, speed = fastest * time, np.inf
    normal = cross(minus(corners[1], corners[0]), minus(corners[2], corners[0]))
    length = np.sqrt(dot(normal, normal))
    if not perspective:
        if way * scale <= MARGIN_PX and lowest > near:
            return 0.0
        # the line in which a tilted face meets the camera's plane moves at V / sin of the tilt
        flat = np.sqrt(normal[0] ** 2 + normal[1] ** 2)
        if flat > 0.0 and way * scale <= MARGIN_PX:
            speed = 2.0 * scale * fastest * length / flat
    else:
        wide = np.sqrt(1.0 + half[0] ** 2 + half[1] ** 2)
        # nothing of it is so near that it could cross the margin
        if lowest > near and 1.1 * scale * wide * way <= MARGIN_PX * lowest:
            return 0.0
        distance = abs(dot(normal, corners[0])) / length if length > 0.0 else 0.0
        if distance > wide * wide * way * (scale / MARGIN_PX + 2.0):
            return 0.0
    # out of sight throughout: all corners stay beyond one side
    for plane in range(5):
        steep = 1.0 if plane == 0 or not perspective else np.sqrt(1.0 + half[(plane - 1) // 2] ** 2)
        furthest = -np.inf
        for i in range(n):
            inside = inside_plane(corners[i], plane, half, near, perspective)
            furthest = max(furthest, inside + steep * corners[i, 3] * time)
        if furthest < 0.0:
            return 0.0
    return speed


@called
def _reverse(points: FloatArray, reach: FloatArray, outlined: BoolArray, n: int) -> None:
    """Turn a loop round; an edge's data move with the edge."""
    for i in range(n // 2):
        j = n - 1 - i
        for c in range(2):
            points[i, c], points[j, c] = points[j, c], points[i, c]
    # edge i now ends where it began: edge n - 2 - i of before, and the closing edge stays the last
    for i in range(n - 1):
        j = n - 2 - i
        if i < j:
            reach[i], reach[j] = reach[j], reach[i]
            outlined[i], outlined[j] = outlined[j], outlined[i]
