"""A certified bound on the error of the shutter's time integral, from the middles of its slices alone.

The picture is averaged over n slices of the open shutter, each shown as it is at its middle (composite midpoint). In a
slice a pixel changes only by what edges sweep over it: up to a time s from the middle, an edge of speed v across itself
sweeps at most v s sqrt(2) of the pixel, so the slice's mean is off by at most the colour step times v h sqrt(2) / 4,
and by nothing if no edge comes near. Where planes may pass through one another as they move, the line in which they
meet has no bounded speed: such a pixel counts with the whole colour step. The sum over the slices bounds every pixel;
rounding is far below.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.reference.coverage import row_extent
from aliasbench.renderers.reference.slabs import TIE
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

SQRT2 = 1.4142135623730951


@njit(cache=True, nogil=True, error_model="numpy")
def bound_edges(
    points: FloatArray, speeds: FloatArray, reach: FloatArray, outlined: BoolArray, starts: IntArray,
    owners: IntArray, instants: IntArray, contrasts: FloatArray, length: float, weight: float, rows: IntArray,
    out: FloatArray,
) -> None:  # fmt: skip
    """Add the slices' error bounds by moving outlines to rows [rows[0], rows[1]) of `out` (h, w).

    Parameters
    ----------
    points, speeds, reach, outlined, starts, owners, instants
        Of `Pieces`.
    contrasts : (objects,) float64
        The largest colour step against anything else, for every object.
    length, weight : float
        Of a slice: in frame intervals, and as a share of the shutter.
    """
    width = out.shape[1]
    for i in range(instants[0], instants[-1]):
        step = contrasts[owners[i]] * weight
        for k in range(starts[i], starts[i + 1]):
            if not outlined[k]:
                continue
            j = k + 1 if k + 1 < starts[i + 1] else starts[i]
            v0, v1 = speeds[k, 0], speeds[k, 1]
            fastest = reach[k]
            if (v0 == 0.0 and v1 == 0.0) or step == 0.0:
                continue
            if not fastest * length < 8.0:
                # faster than the margin round the picture allows to follow
                out[rows[0] : rows[1]] += step
                continue
            # a hair more than the way in half a slice
            near = fastest * length / 2 + 1e-9
            x0, y0, x1, y1 = points[k, 0], points[k, 1], points[j, 0], points[j, 1]
            first = max(rows[0], int(np.floor(min(y0, y1) - near)))
            last = min(rows[1] - 1, int(np.floor(max(y0, y1) + near)))
            for row in range(first, last + 1):
                ta, tb = within(y0, y1, row - near, row + 1 + near)
                if ta > tb:
                    continue
                xa, xb = x0 + ta * (x1 - x0), x0 + tb * (x1 - x0)
                left = max(0, int(np.floor(max(min(xa, xb) - near, -1.0))))
                right = min(width - 1, int(np.floor(min(max(xa, xb) + near, float(width)))))
                for column in range(left, right + 1):
                    sa, sb = within(x0, x1, column - near, column + 1 + near)
                    sa, sb = max(sa, ta), min(sb, tb)
                    if sa > sb:
                        continue
                    speed = max(v0 + sa * (v1 - v0), v0 + sb * (v1 - v0))
                    out[row, column] += step * min(1.0, SQRT2 / 4 * speed * length)


@njit(cache=True, nogil=True, error_model="numpy")
def within(a: float, b: float, low: float, high: float) -> tuple[float, float]:
    """Return the range of t in [0, 1] in which a + t (b - a) lies in [low, high], a little widened."""
    if abs(b - a) < 1e-9:
        return (0.0, 1.0) if a >= low - 1e-9 and a <= high + 1e-9 else (1.0, 0.0)
    t, u = (low - a) / (b - a), (high - a) / (b - a)
    if t > u:
        t, u = u, t
    return max(0.0, t - 1e-9), min(1.0, u + 1e-9)


@njit(cache=True, nogil=True, error_model="numpy")
def bound_crossings(
    points: FloatArray, reach: FloatArray, starts: IntArray, planes: FloatArray, owners: IntArray, instants: IntArray,
    contrasts: FloatArray, kinds: IntArray, turns: FloatArray, perspective: bool, scale: float, center: FloatArray,
    extent: float, length: float, weight: float, rows: IntArray, out: FloatArray,
) -> None:  # fmt: skip
    """Add the slices' error bounds where planes may change their order, to rows of `out` (h, w).

    Parameters
    ----------
    kinds : (objects,) int64
        Equal for objects that move alike.
    turns : (objects,) float64
        Bounds on the angular speed against the camera, radians per frame interval.
    """
    width = out.shape[1]
    for t in range(len(instants) - 1):
        n = instants[t + 1] - instants[t]
        near, low, high = np.empty(n), np.empty(n), np.empty(n)
        steep = np.empty(n)
        for a in range(n):
            i = instants[t] + a
            near[a] = reach[starts[i] : starts[i + 1]].max() * length / 2 + 1e-9
            low[a] = points[starts[i] : starts[i + 1], 1].min() - near[a]
            high[a] = points[starts[i] : starts[i + 1], 1].max() + near[a]
            p = planes[i, 0]
            gx, gy = p[0] * scale, p[1] * scale
            g1 = p[2] + p[0] * center[0] + p[1] * center[1] if perspective else 1.0
            steep[a] = np.sqrt(gx * gx + gy * gy + g1 * g1)
        left, right = np.empty(n), np.empty(n)
        for row in range(rows[0], rows[1]):
            for a in range(n):
                left[a], right[a] = np.inf, -np.inf
                if low[a] < row + 1 and high[a] > row:
                    i = instants[t] + a
                    if not near[a] < 4.0:
                        left[a], right[a] = 0.0, float(width)
                    else:
                        lo, hi = row_extent(points, starts[i], starts[i + 1], row - near[a], row + 1 + near[a])
                        left[a], right[a] = lo - near[a], hi + near[a]
            order = np.argsort(left)
            for first in range(n):
                for second in range(first + 1, n):
                    a, b = order[first], order[second]
                    if left[b] >= right[a]:
                        break
                    i, j = instants[t] + a, instants[t] + b
                    begin, end = max(left[a], left[b], 0.0), min(right[a], right[b], float(width))
                    if begin >= end or (near[a] <= 1e-9 and near[b] <= 1e-9):
                        continue
                    for column in range(int(begin), int(np.ceil(end))):
                        step = _crossing(
                            planes[i, 0], planes[j, 0], steep[a], steep[b], near[a], near[b],
                            turns[owners[i]], turns[owners[j]], kinds[owners[i]] == kinds[owners[j]],
                            perspective, scale, center, extent, length, column, row,
                        )  # fmt: skip
                        out[row, column] += weight * step * max(contrasts[owners[i]], contrasts[owners[j]])


@njit(cache=True, nogil=True, error_model="numpy")
def _crossing(
    p: FloatArray, q: FloatArray, steep_p: float, steep_q: float, near_p: float, near_q: float, turn_p: float,
    turn_q: float, alike: bool, perspective: bool, scale: float, center: FloatArray, extent: float, length: float,
    x: int, y: int,
) -> float:  # fmt: skip
    """Return the share of a pixel that may change sides between two planes, on average over a slice."""
    low, high, flat = np.inf, -np.inf, True
    rate_p, rate_q = 0.0, 0.0
    for corner in range(4):
        cx, cy = x + corner % 2, y + corner // 2
        v, w = p[0] * cx + p[1] * cy + p[2], q[0] * cx + q[1] * cy + q[2]
        low, high = min(low, v - w), max(high, v - w)
        flat = flat and abs(v - w) <= TIE * (max(abs(v), abs(w)) if perspective else extent)
        ray = np.sqrt(1.0 + ((cx - center[0]) / scale) ** 2 + ((cy - center[1]) / scale) ** 2) if perspective else 1.0
        rate_p = max(rate_p, _change(v, steep_p, near_p, turn_p, ray, perspective, scale, length))
        rate_q = max(rate_q, _change(w, steep_q, near_q, turn_q, ray, perspective, scale, length))
    if alike and flat:
        return 0.0
    if low - rate_p - rate_q > 0.0 or high + rate_p + rate_q < 0.0:
        return 0.0
    # the line in which two planes of one body meet moves with the body
    return min(1.0, SQRT2 / 2 * max(near_p, near_q)) if alike else 1.0


@njit(cache=True, nogil=True, error_model="numpy")
def _change(
    nearness: float, steep: float, near: float, turn: float, ray: float, perspective: bool, scale: float,
    length: float,
) -> float:  # fmt: skip
    """Return a bound on how much a plane's nearness at a fixed point changes within half a slice.

    A plane moving at V changes the depth along an axis at V / cos; half as much again covers what the tilt and the
    distance change meanwhile, as long as that is little.
    """
    if perspective:
        if not nearness > 0.0:
            return np.inf
        tilt = turn * length * ray * steep / nearness + 2 * near / scale * steep / nearness
    else:
        tilt = turn * length * steep
    return 1.5 * steep * near / scale if tilt < 0.25 else np.inf
