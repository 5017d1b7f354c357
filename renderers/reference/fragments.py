"""A pixel cut into convex fragments, each of which shows one piece: where textures are integrated.

Pieces are laid on one after the other. Every edge of a piece cuts a fragment in two along one line, and where the
planes of two pieces cross, the line of equal depth does; both halves get the same cut points, so the fragments always
make up the pixel. Trapezoids (see `slabs`) would do as well, but a texture wants few and large fragments.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.renderers.reference.slabs import TIE
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]


@called
def copy_corners(poly: FloatArray, n: int, out: FloatArray) -> None:
    """Copy n corners, one by one: a slice would take a second to compile."""
    for k in range(n):
        out[k, 0], out[k, 1] = poly[k, 0], poly[k, 1]


@called
def cut_convex(
    poly: FloatArray, n: int, a: float, b: float, c: float, ox: float, oy: float, inside: FloatArray,
    outside: FloatArray,
) -> tuple[int, int]:  # fmt: skip
    """Write the parts of a convex polygon where a (x - ox) + b (y - oy) + c is >= 0 and <= 0; return their sizes.

    A part without area has size 0. `inside` and `outside` must hold n + 2 corners.
    """
    lowest, highest = np.inf, -np.inf
    for k in range(n):
        d = a * (poly[k, 0] - ox) + b * (poly[k, 1] - oy) + c
        lowest, highest = min(lowest, d), max(highest, d)
    if lowest >= 0.0 or highest <= 0.0:
        whole = inside if lowest >= 0.0 else outside
        copy_corners(poly, n, whole)
        return (n, 0) if lowest >= 0.0 else (0, n)
    ni, no = 0, 0
    x0, y0 = poly[n - 1, 0], poly[n - 1, 1]
    d0 = a * (x0 - ox) + b * (y0 - oy) + c
    for k in range(n):
        x1, y1 = poly[k, 0], poly[k, 1]
        d1 = a * (x1 - ox) + b * (y1 - oy) + c
        if (d0 > 0.0 and d1 < 0.0) or (d0 < 0.0 and d1 > 0.0):
            s = d0 / (d0 - d1)
            x, y = x0 + s * (x1 - x0), y0 + s * (y1 - y0)
            inside[ni, 0], inside[ni, 1] = x, y
            outside[no, 0], outside[no, 1] = x, y
            ni += 1
            no += 1
        if d1 >= 0.0:
            inside[ni, 0], inside[ni, 1] = x1, y1
            ni += 1
        if d1 <= 0.0:
            outside[no, 0], outside[no, 1] = x1, y1
            no += 1
        x0, y0, d0 = x1, y1, d1
    return (ni if ni > 2 else 0), (no if no > 2 else 0)


@allocating
def split_pixel(
    points: FloatArray, starts: IntArray, planes: FloatArray, owners: IntArray, perspective: bool, extent: float,
    cand: IntArray, n: int, x0: float, y0: float, x1: float, y1: float, polys: FloatArray, sizes: IntArray,
    shown: IntArray,
) -> int:  # fmt: skip
    """Fill the fragments of a rectangle and the piece that each shows (-1: the background); return how many they are.

    Returns -1 where `polys` (fragments, corners, 2) has too little room.
    """
    room, corners = polys.shape[0], polys.shape[1]
    polys[0, 0, 0], polys[0, 0, 1] = x0, y0
    polys[0, 1, 0], polys[0, 1, 1] = x1, y0
    polys[0, 2, 0], polys[0, 2, 1] = x1, y1
    polys[0, 3, 0], polys[0, 3, 1] = x0, y1
    sizes[0], shown[0] = 4, -1
    total = 1
    work = np.empty((2, corners, 2))
    for a in range(n):
        piece = cand[a]
        for f in range(total):
            before = shown[f]
            if not _may_meet(points, starts[piece], starts[piece + 1], polys[f], sizes[f]):
                continue
            size = sizes[f]
            copy_corners(polys[f], size, work[0])
            now = 0
            for k in range(starts[piece], starts[piece + 1]):
                j = k + 1 if k + 1 < starts[piece + 1] else starts[piece]
                if size + 2 > corners or total + 2 > room:
                    return -1
                dx, dy = points[j, 0] - points[k, 0], points[j, 1] - points[k, 1]
                size, out = cut_convex(
                    work[now], size, -dy, dx, 0.0, points[k, 0], points[k, 1], work[1 - now], polys[total]
                )
                now = 1 - now
                if out > 0:
                    sizes[total], shown[total] = out, before
                    total += 1
                if size == 0:
                    break
            if size == 0:
                # all of it was given to fragments of what it showed before: this one is used up
                sizes[f] = 0
                continue
            if before < 0:
                copy_corners(work[now], size, polys[f])
                sizes[f], shown[f] = size, piece
                continue
            p, q = planes[piece, 0], planes[before, 0]
            da, db = p[0] - q[0], p[1] - q[1]
            ox, oy = work[now, 0, 0], work[now, 0, 1]
            dc = (p[0] * ox + p[1] * oy + p[2]) - (q[0] * ox + q[1] * oy + q[2])
            low, high, scale = np.inf, -np.inf, 0.0
            for k in range(size):
                d = da * (work[now, k, 0] - ox) + db * (work[now, k, 1] - oy) + dc
                low, high = min(low, d), max(high, d)
                scale = max(scale, abs(p[0] * work[now, k, 0] + p[1] * work[now, k, 1] + p[2]))
            tie = TIE * (scale if perspective else extent)
            later = owners[piece] >= owners[before]
            if low >= -tie and (high > tie or later):
                copy_corners(work[now], size, polys[f])
                sizes[f], shown[f] = size, piece
            elif high <= tie:
                copy_corners(work[now], size, polys[f])
                sizes[f] = size
            else:
                if size + 2 > corners:
                    return -1
                front, back = cut_convex(work[now], size, da, db, dc, ox, oy, polys[f], polys[total])
                sizes[f], shown[f] = front, piece
                sizes[total], shown[total] = back, before
                total += 1
    return total


@called
def between(ids: IntArray, left: FloatArray, right: FloatArray, n: int, x0: float, x1: float, out: IntArray) -> int:
    """Write those of n pieces that reach into (x0, x1); return how many.

    A count that starts from 0 where it is used would be a type of its own, for which all that takes it is compiled
    once more.
    """
    count = 0
    for a in range(n):
        if left[a] < x1 and right[a] > x0:
            out[count] = ids[a]
            count += 1
    return count


@called
def _may_meet(points: FloatArray, begin: int, end: int, poly: FloatArray, n: int) -> bool:
    """Return False where a polygon lies beyond one edge of a piece: then nothing needs to be cut."""
    if n == 0:
        return False
    for k in range(begin, end):
        j = k + 1 if k + 1 < end else begin
        dx, dy = points[j, 0] - points[k, 0], points[j, 1] - points[k, 1]
        beyond = True
        for v in range(n):
            if dx * (poly[v, 1] - points[k, 1]) - dy * (poly[v, 0] - points[k, 0]) > 0.0:
                beyond = False
                break
        if beyond:
            return False
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def convex_area(poly: FloatArray, n: int) -> float:
    """Return the area of a positively oriented polygon, from its first corner so that no digits are lost."""
    twice = 0.0
    for k in range(1, n - 1):
        ax, ay = poly[k, 0] - poly[0, 0], poly[k, 1] - poly[0, 1]
        bx, by = poly[k + 1, 0] - poly[0, 0], poly[k + 1, 1] - poly[0, 1]
        twice += ax * by - bx * ay
    return twice / 2
