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

from aliasbench.renderers.reference.faces import Faces
from aliasbench.renderers.reference.paths import Paths
from aliasbench.scenes.model import FloatArray
from aliasbench.scenes.projection import View

IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Triple = tuple[float, float, float]

MARGIN_PX = 4.0  # scenes go on outside the picture; the shutter's bound needs room for what comes in during a slice
# The near plane's depth over the largest camera coordinate. Nothing divides by the depth of parallel rays, and what
# lies in the camera's own plane is seen: rounding must not take it for behind.
_NEAR_PERSPECTIVE, _NEAR_PARALLEL = 1e-15, -1e-14
_PLANES = 5


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """Convex pieces in the picture, positively oriented (x right, y down), of one or several instants.

    Attributes
    ----------
    points : (k, 2) float64
        Corners in pixels.
    speeds : (k, 2) float64
        Bounds on the speed across the edge that starts at a corner, at its both ends, in pixels per frame interval.
    reach : (k,) float64
        Bounds on the speed in any direction of points of that edge.
    outlined : (k,) bool
    starts : (m + 1,) int64
    planes : (m, 4, 3) float64
        Coefficients (of x, y and 1) of nearness, u q, v q and q, with q = nearness under perspective, else 1.
    owners : (m,) int64
    instants : (t + 1,) int64
        The pieces of instant i: instants[i] to instants[i + 1].
    loose : int
        In how many instants something may come into the picture, within the slice around it, that is not among the
        pieces: from beyond the margin, or through the near plane.
    """

    points: FloatArray
    speeds: FloatArray
    reach: FloatArray
    outlined: NDArray[np.bool_]
    starts: NDArray[np.int64]
    planes: FloatArray
    owners: NDArray[np.int64]
    instants: NDArray[np.int64]
    loose: int


def pieces_at(
    faces: Faces,
    paths: Paths,
    view: View,
    frame: int,
    fraction: float,
    slice_length: float = 0.0,
    in_layers: bool = False,
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
    in_layers : bool
        Whether everything moves parallel to the picture, orthographically (`flat.is_layered`): then the speed across an
        edge is known, and smaller than the speed as such.
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
    drift = np.empty((0, 3))
    if in_layers:
        velocity = paths.velocities(world, faces.ranges, frame, fraction)
        slack = paths.velocity_change(faces.ranges, speed) * slice_length
        drift = np.stack([velocity @ view.right, -(velocity @ view.up), slack], axis=1) * view.scale
    share = _NEAR_PERSPECTIVE if view.perspective else _NEAR_PARALLEL
    near = share * float(np.abs(camera).max(initial=1e-285))
    half = np.array([view.width / 2 + MARGIN_PX, view.height / 2 + MARGIN_PX]) / view.scale
    count = len(faces.owners)
    room = len(faces.corners) + _PLANES * count
    points, speeds, reach = np.empty((room, 2)), np.empty((room, 2)), np.empty(room)
    outlined, starts = np.empty(room, np.bool_), np.zeros(count + 1, np.int64)
    planes, owners = np.empty((count, 4, 3)), np.empty(count, np.int64)
    widest = int(np.diff(faces.starts).max(initial=0)) + _PLANES + 1
    k, m, loose = _clip_project(
        camera, speed, drift, faces.uv, faces.corners, faces.starts, faces.outlined, faces.spread, faces.owners,
        near, half, view.perspective, view.scale, view.width / 2, view.height / 2, slice_length,
        np.empty((2, widest, 8)), points, speeds, reach, outlined, starts, planes, owners,
    )  # fmt: skip
    return Pieces(
        points[:k],
        speeds[:k],
        reach[:k],
        outlined[:k],
        starts[: m + 1],
        planes[:m],
        owners[:m],
        np.array([0, m], np.int64),
        int(loose),
    )


def join_pieces(parts: list[Pieces]) -> Pieces:
    """Return the pieces of several instants as one set."""
    corners = np.cumsum([0] + [len(p.points) for p in parts])
    counts = np.cumsum([0] + [len(p.owners) for p in parts])
    return Pieces(
        np.concatenate([p.points for p in parts]),
        np.concatenate([p.speeds for p in parts]),
        np.concatenate([p.reach for p in parts]),
        np.concatenate([p.outlined for p in parts]),
        np.concatenate([np.zeros(1, np.int64)] + [p.starts[1:] + c for p, c in zip(parts, corners[:-1], strict=True)]),
        np.concatenate([p.planes for p in parts]),
        np.concatenate([p.owners for p in parts]),
        counts.astype(np.int64),
        sum(p.loose for p in parts),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _cut(
    points: FloatArray, n: int, plane: int, half: FloatArray, near: float, perspective: bool, out: FloatArray,
) -> int:  # fmt: skip
    """Write a convex polygon's part on the inner side of one plane; return its size.

    Columns: x, y, z, speed, outlined, drift (2), slack.
    """
    size = 0
    for i in range(n):
        a, b = points[i], points[(i + 1) % n]
        da = _inside(a, plane, half, near, perspective)
        db = _inside(b, plane, half, near, perspective)
        if da >= 0.0:
            for c in range(8):
                out[size, c] = a[c]
            size += 1
        if (da >= 0.0) != (db >= 0.0):
            # from the same end whichever face asks
            swap = _follows(a, b)
            t = db / (db - da) if swap else da / (da - db)
            for c in range(8):
                start, end = (b[c], a[c]) if swap else (a[c], b[c])
                out[size, c] = start + t * (end - start)
            # leaving, the next edge runs along the plane; entering, it is the rest of this one
            out[size, 4] = 0.0 if da >= 0.0 else a[4]
            size += 1
    return size


@njit(cache=True, nogil=True, error_model="numpy")
def _follows(a: FloatArray, b: FloatArray) -> bool:
    """Return whether a comes after b in the order of x, then y, then z."""
    for c in range(3):
        if a[c] != b[c]:
            return a[c] > b[c]
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def _inside(p: FloatArray, plane: int, half: FloatArray, near: float, perspective: bool) -> float:
    """Return the signed distance (up to a factor) to the near plane (0) or a side of the picture (1 to 4)."""
    if plane == 0:
        return p[2] - near
    reach = half[(plane - 1) // 2] * (p[2] if perspective else 1.0)
    value = p[(plane - 1) // 2]
    return reach - value if plane % 2 else reach + value


@njit(cache=True, nogil=True, error_model="numpy")
def _clip_project(
    camera: FloatArray, speed: FloatArray, drift: FloatArray, uv: FloatArray, corners: IntArray, first: IntArray,
    edge_flags: BoolArray, spread: IntArray, face_owners: IntArray, near: float, half: FloatArray, perspective: bool,
    scale: float, cx: float, cy: float, slice_length: float, work: FloatArray, points: FloatArray, speeds: FloatArray,
    reach: FloatArray, outlined: BoolArray, starts: IntArray, planes: FloatArray, owners: IntArray,
) -> tuple[int, int, bool]:  # fmt: skip
    """Fill the output arrays; return the numbers of corners and pieces, and whether more may come in."""
    k, m, loose = 0, 0, False
    for f in range(len(face_owners)):
        n = first[f + 1] - first[f]
        now = 0
        for i in range(n):
            v = corners[first[f] + i]
            for c in range(3):
                work[now, i, c] = camera[v, c]
            work[now, i, 3] = speed[v]
            work[now, i, 4] = 1.0 if edge_flags[first[f] + i] else 0.0
            for c in range(3):
                work[now, i, 5 + c] = drift[v, c] if len(drift) > 0 else 0.0
        if slice_length > 0.0 and not loose:
            loose = _may_come_in(work[now], n, half, near, perspective, scale, len(drift) > 0, slice_length / 2)
        for plane in range(5):
            n = _cut(work[now], n, plane, half, near, perspective, work[1 - now])
            now = 1 - now
            if n < 3:
                break
        if n < 3 or not _plane(camera, uv, spread[f], perspective, scale, cx, cy, planes[m]):
            continue
        p = work[now]
        area = 0.0
        for i in range(n):
            s = scale / p[i, 2] if perspective else scale
            points[k + i, 0] = cx + p[i, 0] * s
            points[k + i, 1] = cy - p[i, 1] * s
        for i in range(n):
            j = (i + 1) % n
            ax, ay = points[k + i, 0] - points[k, 0], points[k + i, 1] - points[k, 1]
            bx, by = points[k + j, 0] - points[k, 0], points[k + j, 1] - points[k, 1]
            area += ax * by - bx * ay
        if not abs(area) > 1e-300:
            continue
        for i in range(n):
            j = (i + 1) % n
            outlined[k + i] = p[i, 4] != 0.0
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
                speeds[k + i, 0] = bound
                speeds[k + i, 1] = bound
                reach[k + i] = bound
                continue
            reach[k + i] = scale * max(p[i, 3], p[j, 3])
            nx, ny = points[k + j, 1] - points[k + i, 1], points[k + i, 0] - points[k + j, 0]
            long = np.sqrt(nx * nx + ny * ny)
            for e in range(2):
                at = p[j] if e else p[i]
                speeds[k + i, e] = scale * at[3]
                if len(drift) > 0 and long > 0.0:
                    across = abs(at[5] * nx + at[6] * ny) / long + at[7]
                    speeds[k + i, e] = min(speeds[k + i, e], across)
        if area < 0.0:
            _reverse(points[k : k + n], speeds[k : k + n], reach[k : k + n], outlined[k : k + n], n)
        owners[m] = face_owners[f]
        k += n
        m += 1
        starts[m] = k
    return k, m, loose


@njit(cache=True, nogil=True, error_model="numpy")
def _may_come_in(
    corners: FloatArray, n: int, half: FloatArray, near: float, perspective: bool, scale: float, in_layers: bool,
    time: float,
) -> bool:  # fmt: skip
    """Return whether a part of a face that is cut away now may be seen at another time of the slice.

    A point beyond the margin has to move by more than the margin: orthographically in pixels; under perspective within
    `margin z / scale` of the world, so its depth is small, and the face's plane must pass close by the camera.
    """
    fastest, lowest = 0.0, np.inf
    for i in range(n):
        fastest = max(fastest, corners[i, 3])
        lowest = min(lowest, corners[i, 2] - corners[i, 3] * time)
    if fastest == 0.0:
        return False
    way = fastest * time
    if not perspective:
        if way * scale <= MARGIN_PX and (in_layers or lowest > near):
            return False
    else:
        wide = np.sqrt(1.0 + half[0] ** 2 + half[1] ** 2)
        normal = _cross(_minus(corners[1], corners[0]), _minus(corners[2], corners[0]))
        length = np.sqrt(_dot(normal, normal))
        distance = abs(_dot(normal, corners[0])) / length if length > 0.0 else 0.0
        if distance > wide * wide * way * (scale / MARGIN_PX + 2.0):
            return False
    # out of sight throughout: all corners stay beyond one side
    for plane in range(5):
        steep = 1.0 if plane == 0 or not perspective else np.sqrt(1.0 + half[(plane - 1) // 2] ** 2)
        furthest = -np.inf
        for i in range(n):
            furthest = max(furthest, _inside(corners[i], plane, half, near, perspective) + steep * corners[i, 3] * time)
        if furthest < 0.0:
            return False
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _reverse(points: FloatArray, speeds: FloatArray, reach: FloatArray, outlined: BoolArray, n: int) -> None:
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
            for c in range(2):
                speeds[i, c], speeds[j, c] = speeds[j, c], speeds[i, c]
    for i in range(n):
        speeds[i, 0], speeds[i, 1] = speeds[i, 1], speeds[i, 0]


@njit(cache=True, nogil=True, error_model="numpy")
def _minus(a: FloatArray, b: FloatArray) -> Triple:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(cache=True, nogil=True, error_model="numpy")
def _cross(a: Triple, b: Triple) -> Triple:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True, nogil=True, error_model="numpy")
def _dot(a: Triple, b: Triple | FloatArray) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, nogil=True, error_model="numpy")
def _plane(
    camera: FloatArray, uv: FloatArray, spread: IntArray, perspective: bool, scale: float, cx: float, cy: float,
    out: FloatArray,
) -> bool:  # fmt: skip
    """Fill the coefficients of nearness, u q, v q and q in the picture; return False for a face seen edge-on."""
    o = camera[spread[0]]
    e1, e2 = _minus(camera[spread[1]], o), _minus(camera[spread[2]], o)
    n = _cross(e1, e2)
    squared, d = _dot(n, n), _dot(n, o)
    lead = d if perspective else n[2]
    if squared == 0.0 or lead == 0.0:
        return False
    # (X, Y) of a picture point at depth 1, or in the world: ((x - cx) / scale, (cy - y) / scale)
    if perspective:
        near_x, near_y, near_1 = n[0] / d, n[1] / d, n[2] / d
    else:
        near_x, near_y, near_1 = n[0] / n[2], n[1] / n[2], -d / n[2]
    _to_picture(near_x, near_y, near_1, scale, cx, cy, out[0])
    g1, g2 = _cross(e2, n), _cross(n, e1)
    for c in range(2):
        t0, t1, t2 = uv[spread[0], c], uv[spread[1], c], uv[spread[2], c]
        s1, s2 = (t1 - t0) / squared, (t2 - t0) / squared
        g = (s1 * g1[0] + s2 * g2[0], s1 * g1[1] + s2 * g2[1], s1 * g1[2] + s2 * g2[2])
        rest = t0 - _dot(g, o)
        if perspective:
            # u q = (g . q (X, Y, 1) z) q / z ... with P = (X, Y, 1) / q: u q = g . (X, Y, 1) + rest q
            _to_picture(g[0] + rest * near_x, g[1] + rest * near_y, g[2] + rest * near_1, scale, cx, cy, out[1 + c])
        else:
            # P = (X, Y, -nearness)
            _to_picture(g[0] - g[2] * near_x, g[1] - g[2] * near_y, rest - g[2] * near_1, scale, cx, cy, out[1 + c])
    if perspective:
        out[3] = out[0]
    else:
        out[3, 0], out[3, 1], out[3, 2] = 0.0, 0.0, 1.0
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _to_picture(a: float, b: float, c: float, scale: float, cx: float, cy: float, out: FloatArray) -> None:
    out[0] = a / scale
    out[1] = -b / scale
    out[2] = c - a * cx / scale + b * cy / scale
