"""Where the mean of a turning pattern is not smooth: on straight kinks and on circles about the hub (see `whirl`).

A rectangle is cut across into strips, and a line through it into pieces, that hold none of these inside.
"""

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import called
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]

MOST_MET = 12  # curves in a cell of which it is known beforehand where they meet each other


@called
def is_tangled(
    kinks: FloatArray, near: IntArray, met: int, rings: FloatArray, ringed: int,
    box: tuple[float, float, float, float],
) -> bool:  # fmt: skip
    """Return whether a kink or a circle may run through a rectangle, or the hub lies in it."""
    x0, x1, y0, y1 = box
    count = 0
    for i in range(met):
        a, b, c, d = kinks[near[i]]
        if max(a, c) >= x0 and min(a, c) <= x1 and max(b, d) >= y0 and min(b, d) <= y1:
            # on which sides of the line are the corners?
            f = (c - a) * ((y0 + y1) / 2 - b) - (d - b) * ((x0 + x1) / 2 - a)
            if abs(f) <= (abs(c - a) * (y1 - y0) + abs(d - b) * (x1 - x0)) / 2:
                count += 1
    x = 0.0 if x0 < 0.0 < x1 else min(abs(x0), abs(x1))
    y = 0.0 if y0 < 0.0 < y1 else min(abs(y0), abs(y1))
    far_x, far_y = max(abs(x0), abs(x1)), max(abs(y0), abs(y1))
    for k in range(ringed):
        if x * x + y * y <= rings[k] * rings[k] <= far_x * far_x + far_y * far_y:
            count += 1
    return count > 0 or (x == 0.0 and y == 0.0)


@called
def find_strips(
    kinks: FloatArray, near: IntArray, met: int, rings: FloatArray, ringed: int, swap: bool, u0: float, u1: float,
    v0: float, v1: float, out: FloatArray,
) -> int:  # fmt: skip
    """Fill the sorted v at which kinks begin or end, or meet circles, u0, u1 or each other; return how many."""
    n = _insert(out, 0, v0)
    for a in range(met if met + ringed <= MOST_MET else 0):
        p, q, r, s = kinks[near[a]]
        if swap:
            p, q, r, s = q, p, s, r
        du, dv = r - p, s - q
        square, along = du * du + dv * dv, p * du + q * dv
        for k in range(ringed):
            rest = along * along - square * (p * p + q * q - rings[k] * rings[k])
            if rest > 0.0:
                for sign in (-1.0, 1.0):
                    v = q + (sign * np.sqrt(rest) - along) / square * dv
                    if v0 < v < v1:
                        n = _insert(out, n, v)
        for b in range(a):
            e, f, g, h = kinks[near[b]]
            if swap:
                e, f, g, h = f, e, h, g
            cross = du * (h - f) - dv * (g - e)
            if cross != 0.0:
                v = q + ((e - p) * (h - f) - (f - q) * (g - e)) / cross * dv
                if v0 < v < v1:
                    n = _insert(out, n, v)
    for a in range(met):
        p, q, r, s = kinks[near[a]]
        if swap:
            p, q, r, s = q, p, s, r
        for end in (q, s):
            if v0 < end < v1:
                n = _insert(out, n, end)
        for u in (u0, u1):
            if min(p, r) < u < max(p, r):
                v = q + (u - p) / (r - p) * (s - q)
                if v0 < v < v1:
                    n = _insert(out, n, v)
    for k in range(ringed):
        for u in (u0, u1, 0.0):
            if abs(u) < rings[k]:
                v = np.sqrt((rings[k] - u) * (rings[k] + u))
                if v0 < v < v1:
                    n = _insert(out, n, v)
                if v0 < -v < v1:
                    n = _insert(out, n, -v)
    return _insert(out, n, v1)


@called
def find_knots(
    kinks: FloatArray, near: IntArray, met: int, rings: FloatArray, ringed: int, swap: bool, u0: float, u1: float,
    v: float, out: FloatArray, round_: NDArray[np.bool_],
) -> int:  # fmt: skip
    """Fill the sorted u at which a line meets kinks and circles, and which are circles; return how many."""
    n = _insert(out, 0, u0)
    round_[0] = False
    for a in range(met):
        p, q, r, s = kinks[near[a]]
        if swap:
            p, q, r, s = q, p, s, r
        if min(q, s) < v < max(q, s):
            u = p + (v - q) / (s - q) * (r - p)
            if u0 < u < u1:
                n = _insert_marked(out, n, u, round_, False)
    for k in range(ringed):
        if abs(v) < rings[k]:
            u = np.sqrt((rings[k] - v) * (rings[k] + v))
            if u0 < u < u1:
                n = _insert_marked(out, n, u, round_, True)
            if u0 < -u < u1:
                n = _insert_marked(out, n, -u, round_, True)
    return _insert_marked(out, n, u1, round_, False)


@called
def draw_towards(x: float, first: bool, last: bool) -> tuple[float, float]:
    """Return a place in [-1, 1] drawn towards one end or both, and its weight."""
    t = (1.0 + x) / 2
    if first and last:
        return 2.0 * t * t * (3.0 - 2.0 * t) - 1.0, 6.0 * t * (1.0 - t)
    if first:
        return 2.0 * t * t - 1.0, 2.0 * t
    if last:
        return 1.0 - 2.0 * (1.0 - t) * (1.0 - t), 2.0 * (1.0 - t)
    return x, 1.0


@called
def _insert(values: FloatArray, n: int, value: float) -> int:
    i = n
    while i > 0 and values[i - 1] > value:
        values[i] = values[i - 1]
        i -= 1
    values[i] = value
    return n + 1


@called
def _insert_marked(values: FloatArray, n: int, value: float, marks: NDArray[np.bool_], mark: bool) -> int:
    i = n
    while i > 0 and values[i - 1] > value:
        values[i], marks[i] = values[i - 1], marks[i - 1]
        i -= 1
    values[i], marks[i] = value, mark
    return n + 1
