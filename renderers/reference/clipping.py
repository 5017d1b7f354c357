"""Cutting, projecting and describing one face in camera space: what pieces at an instant and moving faces share.

Whatever two faces have in common is computed from the same numbers in the same order, whichever asks.
"""

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import called
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]
Triple = tuple[float, float, float]

PLANES = 5
# The near plane's depth over the largest camera coordinate. Nothing divides by the depth of parallel rays, and what
# lies in the camera's own plane is seen: rounding must not take it for behind.
NEAR_PERSPECTIVE, NEAR_PARALLEL = 1e-15, -1e-14
EDGE_ON = 16 * 2.0**-52  # distance from the eye of a plane, over that of a corner, that is none
ONE_CORNER = 4 * 2.0**-52  # corners this near, over the width of the picture, are one up to rounding


@called
def cut_polygon(
    points: FloatArray, n: int, plane: int, half: FloatArray, near: float, perspective: bool, out: FloatArray,
) -> int:  # fmt: skip
    """Write a convex polygon's part on the inner side of one plane; return its size.

    Columns: x, y, z, speed, outlined.
    """
    size = 0
    for i in range(n):
        a, b = points[i], points[(i + 1) % n]
        da = inside_plane(a, plane, half, near, perspective)
        db = inside_plane(b, plane, half, near, perspective)
        if da >= 0.0:
            for c in range(5):
                out[size, c] = a[c]
            size += 1
        if (da >= 0.0) != (db >= 0.0):
            # from the same end whichever face asks
            swap = _follows(a, b)
            t = db / (db - da) if swap else da / (da - db)
            for c in range(5):
                start, end = (b[c], a[c]) if swap else (a[c], b[c])
                out[size, c] = start + t * (end - start)
            # leaving, the next edge runs along the plane; entering, it is the rest of this one
            out[size, 4] = 0.0 if da >= 0.0 else a[4]
            size += 1
    return size


@called
def merge_corners(points: FloatArray, n: int, close: float, kept: IntArray) -> int:
    """Join corners of a loop that are one up to rounding, as cuts near a corner of the picture leave.

    An edge of no length has no direction, and no half plane. Joined corners take the first in the order of x, then y,
    of theirs, so that neighbours agree. Returns how many are left; `kept[i]` becomes the number of the corner whose
    following edge is now edge i.
    """
    size = 0
    for i in range(n):
        same = False
        if size > 0:
            k = size - 1
            same = abs(points[i, 0] - points[k, 0]) <= close and abs(points[i, 1] - points[k, 1]) <= close
        if same:
            _take_first(points, size - 1, i)
            kept[size - 1] = i
        else:
            points[size, 0], points[size, 1] = points[i, 0], points[i, 1]
            kept[size] = i
            size += 1
    while size > 1:
        k = size - 1
        if abs(points[k, 0] - points[0, 0]) > close or abs(points[k, 1] - points[0, 1]) > close:
            break
        _take_first(points, 0, k)
        size -= 1
    return size


@called
def _take_first(points: FloatArray, k: int, i: int) -> None:
    ahead = points[i, 0] < points[k, 0] or (points[i, 0] == points[k, 0] and points[i, 1] < points[k, 1])
    if ahead:
        points[k, 0], points[k, 1] = points[i, 0], points[i, 1]


@called
def _follows(a: FloatArray, b: FloatArray) -> bool:
    """Return whether a comes after b in the order of x, then y, then z."""
    for c in range(3):
        if a[c] != b[c]:
            return a[c] > b[c]
    return False


@called
def inside_plane(p: FloatArray, plane: int, half: FloatArray, near: float, perspective: bool) -> float:
    """Return the signed distance (up to a factor) to the near plane (0) or a side of the picture (1 to 4)."""
    if plane == 0:
        return p[2] - near
    reach = half[(plane - 1) // 2] * (p[2] if perspective else 1.0)
    value = p[(plane - 1) // 2]
    return reach - value if plane % 2 else reach + value


@called
def minus(a: FloatArray, b: FloatArray) -> Triple:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@called
def cross(a: Triple, b: Triple) -> Triple:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@called
def dot(a: Triple, b: Triple | FloatArray) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@called
def nearness_plane(o: FloatArray, n: Triple, perspective: bool) -> tuple[bool, float, float, float]:
    """Return whether a plane through o with normal n is seen other than edge-on, and the coefficients of its nearness.

    They belong to X, Y and 1, a picture point at depth 1 or in the world: ((x - cx) / scale, (cy - y) / scale).
    """
    d = dot(n, o)
    lead = d if perspective else n[2]
    # a plane that holds the eye but for rounding is seen edge-on, and not as half of the picture
    through_eye = EDGE_ON * np.sqrt(dot(n, n) * dot(o, o)) if perspective else 0.0
    if dot(n, n) == 0.0 or abs(lead) <= through_eye:
        return False, 0.0, 0.0, 0.0
    if perspective:
        return True, n[0] / d, n[1] / d, n[2] / d
    return True, n[0] / n[2], n[1] / n[2], -d / n[2]


@called
def face_planes(
    camera: FloatArray, uv: FloatArray, spread: IntArray, perspective: bool, scale: float, cx: float, cy: float,
    out: FloatArray,
) -> bool:  # fmt: skip
    """Fill the coefficients of nearness, u q, v q and q in the picture; return False for a face seen edge-on."""
    o = camera[spread[0]]
    e1, e2 = minus(camera[spread[1]], o), minus(camera[spread[2]], o)
    n = cross(e1, e2)
    squared = dot(n, n)
    seen, near_x, near_y, near_1 = nearness_plane(o, n, perspective)
    if not seen:
        return False
    to_picture(near_x, near_y, near_1, scale, cx, cy, out[0])
    g1, g2 = cross(e2, n), cross(n, e1)
    for c in range(2):
        t0, t1, t2 = uv[spread[0], c], uv[spread[1], c], uv[spread[2], c]
        s1, s2 = (t1 - t0) / squared, (t2 - t0) / squared
        g = (s1 * g1[0] + s2 * g2[0], s1 * g1[1] + s2 * g2[1], s1 * g1[2] + s2 * g2[2])
        rest = t0 - dot(g, o)
        if perspective:
            # u q = (g . q (X, Y, 1) z) q / z ... with P = (X, Y, 1) / q: u q = g . (X, Y, 1) + rest q
            to_picture(g[0] + rest * near_x, g[1] + rest * near_y, g[2] + rest * near_1, scale, cx, cy, out[1 + c])
        else:
            # P = (X, Y, -nearness)
            to_picture(g[0] - g[2] * near_x, g[1] - g[2] * near_y, rest - g[2] * near_1, scale, cx, cy, out[1 + c])
    if perspective:
        # one by one: a slice would take as long to compile as all of this
        for c in range(3):
            out[3, c] = out[0, c]
    else:
        out[3, 0], out[3, 1], out[3, 2] = 0.0, 0.0, 1.0
    return True


@called
def to_picture(a: float, b: float, c: float, scale: float, cx: float, cy: float, out: FloatArray) -> None:
    out[0] = a / scale
    out[1] = -b / scale
    out[2] = c - a * cx / scale + b * cy / scale
