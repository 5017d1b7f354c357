"""Where cells of a pixel are cut (see `lit_cells`): a line is one value for each corner, affine in the picture."""

import math

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.renderers.reference.runs import BILINEAR, GRID, SINE
from aliasbench.renderers.reference.shading import Stage
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]

WIDEST = 28  # corners of a cell
_WAVE = 0.4  # cycles within a cell


@called
def filter_break(poly: FloatArray, n: int, breaks: FloatArray, row: int, column: int, best: FloatArray) -> bool:
    """Write the distances from a line where a filter is not smooth, if one crosses the cell."""
    for axis in range(2):
        low, high = np.inf, -np.inf
        for k in range(n):
            low, high = min(low, poly[k, axis]), max(high, poly[k, axis])
        for b in breaks:
            at = b + (row if axis else column)
            if low < at - 1e-12 and high > at + 1e-12:
                for k in range(n):
                    best[k] = poly[k, axis] - at
                return True
    return False


@allocating
def texture_break(stage: Stage, plane: FloatArray, obj: int, poly: FloatArray, n: int, best: FloatArray) -> bool:
    """Write into `best` a line to cut a cell by: a texel's border, or one half-way where a wave has too many cycles."""
    kind, own = stage.kinds[obj], stage.maps[obj]
    ranges = np.empty((2, 2))
    ranges[:, 0], ranges[:, 1] = np.inf, -np.inf
    far = 0.0
    for k in range(n):
        x, y = poly[k, 0], poly[k, 1]
        q = plane[3, 0] * x + plane[3, 1] * y + plane[3, 2]
        s = (plane[1, 0] * x + plane[1, 1] * y + plane[1, 2]) / q
        t = (plane[2, 0] * x + plane[2, 1] * y + plane[2, 2]) / q
        for axis in range(2):
            u = own[axis, 0] * s + own[axis, 1] * t + own[axis, 2]
            ranges[axis, 0], ranges[axis, 1] = min(ranges[axis, 0], u), max(ranges[axis, 1], u)
    if kind in (GRID, BILINEAR):
        shift = 0.5 if kind == BILINEAR else 0.0
        for axis in range(2):
            low, high = ranges[axis, 0] - shift, ranges[axis, 1] - shift
            close = 1e-11 * (1.0 + max(abs(low), abs(high)))
            level = math.floor((low + high) / 2 + 0.5)
            if level <= low + close and level + 1.0 < high - close:
                level += 1.0
            if level >= high - close and level - 1.0 > low + close:
                level -= 1.0
            if low + close < level < high - close:
                for k in range(n):
                    x, y = poly[k, 0], poly[k, 1]
                    q = plane[3, 0] * x + plane[3, 1] * y + plane[3, 2]
                    s = plane[1, 0] * x + plane[1, 1] * y + plane[1, 2]
                    t = plane[2, 0] * x + plane[2, 1] * y + plane[2, 2]
                    best[k] = own[axis, 0] * s + own[axis, 1] * t + (own[axis, 2] - level - shift) * q
                return True
        return False
    if kind == SINE:
        cycles = ranges[0, 1] - ranges[0, 0]
    else:
        for axis in range(2):
            far = math.hypot(far, max(abs(ranges[axis, 0]), abs(ranges[axis, 1])))
        wide = math.hypot(ranges[0, 1] - ranges[0, 0], ranges[1, 1] - ranges[1, 0])
        cycles = abs(stage.params[obj, 6]) * 2.0 * far * wide / (2 * math.pi)
    if cycles > _WAVE:
        halve(poly, n, best)
        return True
    return False


@allocating
def halve(poly: FloatArray, n: int, best: FloatArray) -> None:
    """Write the distances from a line through the middle, across the longer way."""
    low, high = np.empty(2), np.empty(2)
    low[:], high[:] = np.inf, -np.inf
    for k in range(n):
        for axis in range(2):
            low[axis], high[axis] = min(low[axis], poly[k, axis]), max(high[axis], poly[k, axis])
    axis = 0 if high[0] - low[0] >= high[1] - low[1] else 1
    for k in range(n):
        best[k] = poly[k, axis] - (low[axis] + high[axis]) / 2


@called
def divide(
    poly: FloatArray, n: int, values: FloatArray, begin: int, listed: int, cells: FloatArray, shape: IntArray, top: int
) -> int:
    """Push the parts of a cell on both sides of a line, given by a value at every corner; return the new top."""
    if n + 2 > WIDEST:
        half = n // 2
        for k in range(half + 1):
            cells[top, k, 0], cells[top, k, 1] = poly[k, 0], poly[k, 1]
        cells[top + 1, 0, 0], cells[top + 1, 0, 1] = poly[0, 0], poly[0, 1]
        for k in range(half, n):
            cells[top + 1, k - half + 1, 0], cells[top + 1, k - half + 1, 1] = poly[k, 0], poly[k, 1]
        shape[top, 0], shape[top + 1, 0] = half + 1, n - half + 1
    else:
        a, b = 0, 0
        last = n - 1
        for k in range(n):
            d0, d1 = values[last], values[k]
            if (d0 > 0.0 and d1 < 0.0) or (d0 < 0.0 and d1 > 0.0):
                s = d0 / (d0 - d1)
                for c in range(2):
                    at = poly[last, c] + s * (poly[k, c] - poly[last, c])
                    cells[top, a, c] = at
                    cells[top + 1, b, c] = at
                a += 1
                b += 1
            if d1 >= 0.0:
                cells[top, a, 0], cells[top, a, 1] = poly[k, 0], poly[k, 1]
                a += 1
            if d1 <= 0.0:
                cells[top + 1, b, 0], cells[top + 1, b, 1] = poly[k, 0], poly[k, 1]
                b += 1
            last = k
        shape[top, 0], shape[top + 1, 0] = a, b
    for k in range(2):
        shape[top + k, 1], shape[top + k, 2] = begin, listed
        if shape[top + k, 0] < 3:
            shape[top + k, 0] = 3
            for v in range(3):
                cells[top + k, v, 0], cells[top + k, v, 1] = poly[0, 0], poly[0, 1]
    return top + 2
