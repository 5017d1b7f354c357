"""Opaque texels as few rectangles, and faces cut along them: plain geometry in texture space, for `cutouts`.

A mask is first reduced to the lines where its rows and columns change, so that bars of many texels, or repeats of one
row, cost what the bars cost. The rectangles are runs of a row, merged over the rows below that have the same run.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import called
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

MOST_CELLS = 1 << 24
_SLIVER = 1e-17  # share of a face's area below which a part of it is rounding


@dataclass(frozen=True, slots=True, eq=False)
class Lattice:
    """A mask of texels that repeats, reduced to where it changes.

    Attributes
    ----------
    size : (height, width)
        Of the mask in texels.
    rows, columns : (m,) and (n,) int64
        Where a row (column) begins that differs from the one before it, ascending; empty where all are the same.
    solid : (max(m, 1), max(n, 1)) bool
        Whether the texels from a row to the next and a column to the next are opaque.
    """

    size: tuple[int, int]
    rows: IntArray
    columns: IntArray
    solid: BoolArray


def build_lattice(mask: BoolArray) -> Lattice:
    """Return a mask (h, w), row 0 at v = 0, reduced to where it changes."""
    rows = np.flatnonzero((mask != np.roll(mask, 1, axis=0)).any(axis=1))
    columns = np.flatnonzero((mask != np.roll(mask, 1, axis=1)).any(axis=0))
    kept = mask[rows if len(rows) else slice(0, 1)][:, columns if len(columns) else slice(0, 1)]
    h, w = mask.shape
    return Lattice((h, w), rows.astype(np.int64), columns.astype(np.int64), np.ascontiguousarray(kept))


def find_rectangles(lattice: Lattice, low: FloatArray, high: FloatArray) -> FloatArray | None:
    """Return the opaque rectangles that meet a box of texture space.

    Parameters
    ----------
    lattice : Lattice
    low, high : (2,) float64
        Corners of the box in texels, u first; a box without width lies in the texel that begins there.

    Returns
    -------
    (n, 4) float64 or None
        Of each rectangle left, right, bottom, top in texels, infinite where the mask never ends; None where the box
        covers more than `MOST_CELLS` parts of the lattice.
    """
    columns = _cells(lattice.columns, lattice.size[1], float(low[0]), float(high[0]))
    rows = _cells(lattice.rows, lattice.size[0], float(low[1]), float(high[1]))
    if (columns[1] - columns[0]) * (rows[1] - rows[0]) > MOST_CELLS:
        return None
    m, n = lattice.solid.shape
    tiled = lattice.solid[np.arange(*rows) % m][:, np.arange(*columns) % n]
    found = merge_runs(np.ascontiguousarray(tiled))
    xs = _starts(lattice.columns, lattice.size[1], *columns)
    ys = _starts(lattice.rows, lattice.size[0], *rows)
    return np.stack([xs[found[:, 2]], xs[found[:, 3]], ys[found[:, 0]], ys[found[:, 1]]], axis=1)


def _cells(starts: IntArray, period: int, low: float, high: float) -> tuple[int, int]:
    """Return the first part of a lattice's axis that a range meets, and one past the last."""
    if len(starts) == 0:
        return 0, 1
    first, last = _cell(starts, period, low), _cell(starts, period, high)
    on_border = high > low and float(_starts(starts, period, last, last)[0]) >= high
    return first, max(first + 1, last if on_border else last + 1)


def _cell(starts: IntArray, period: int, at: float) -> int:
    turns = np.floor(at / period)
    within = at - turns * period
    return int(turns) * len(starts) + int(np.searchsorted(starts, within, side="right")) - 1


def _starts(starts: IntArray, period: int, first: int, last: int) -> FloatArray:
    """Return where the parts first..last (with the end of the last but one) begin."""
    if len(starts) == 0:
        return np.array([-np.inf, np.inf])
    k = np.arange(first, last + 1)
    return np.asarray((k // len(starts)) * period + starts[k % len(starts)], dtype=np.float64)


@njit(cache=True, nogil=True, error_model="numpy")
def merge_runs(solid: BoolArray) -> IntArray:
    """Return the rectangles (n, 4) that make up a mask: first row, end row, first column, end column."""
    height, width = solid.shape
    out = np.empty((16, 4), np.int64)
    n = 0
    # of the run that begins at a column: where it ends, and its rectangle; known only of the row before
    ends, rectangle = np.full(width, -1, np.int64), np.zeros(width, np.int64)
    for row in range(height):
        column = 0
        while column < width:
            if not solid[row, column]:
                ends[column] = -1
                column += 1
                continue
            first = column
            while column < width and solid[row, column]:
                column += 1
            # what began inside the run in the row before goes on no longer
            for c in range(first + 1, column):
                ends[c] = -1
            if ends[first] == column:
                out[rectangle[first], 1] = row + 1
                continue
            if n == len(out):
                wider = np.empty((2 * n, 4), np.int64)
                for k in range(n):
                    for c in range(4):
                        wider[k, c] = out[k, c]
                out = wider
            out[n, 0], out[n, 1], out[n, 2], out[n, 3] = row, row + 1, first, column
            ends[first], rectangle[first] = column, n
            n += 1
    return out[:n]


@njit(cache=True, nogil=True, error_model="numpy")
def cut_face(corners: FloatArray, rectangles: FloatArray, most: int) -> tuple[FloatArray, IntArray]:
    """Return the parts of a convex face that lie in rectangles of its texture space.

    Parameters
    ----------
    corners : (n, 5) float64
        x, y, z, and u and v in texels.
    rectangles : (m, 4) float64
        Left, right, bottom, top; may be infinite.
    most : int
        No more parts than this and one are made.

    Returns
    -------
    (k, 5) float64, (parts + 1,) int64
        The parts' corners, and where each part's begin.
    """
    n = len(corners)
    work, size = np.empty((2, n + 8, 5)), np.empty(2, np.int64)
    least = _SLIVER * _area(corners, n)
    out, starts = np.empty((16 * (n + 4), 5)), np.zeros(17, np.int64)
    k, parts = 0, 0
    low, high = np.empty(2), np.empty(2)
    for axis in range(2):
        low[axis], high[axis] = corners[:, 3 + axis].min(), corners[:, 3 + axis].max()
    for r in range(len(rectangles)):
        box = rectangles[r]
        if box[0] > high[0] or box[1] < low[0] or box[2] > high[1] or box[3] < low[1]:
            continue
        now = 0
        _copy(corners, n, work[0], 0)
        size[0] = n
        for side in range(4):
            axis, keep_above = side // 2, side % 2 == 0
            if box[side] <= low[axis] if keep_above else box[side] >= high[axis]:
                continue
            size[1 - now] = _cut(work[now], size[now], 3 + axis, box[side], keep_above, work[1 - now])
            now = 1 - now
        if size[now] < 3 or not _area(work[now], size[now]) > least:
            continue
        if parts > most:
            break
        if k + size[now] > len(out):
            wider = np.empty((2 * len(out), 5))
            _copy(out, k, wider, 0)
            out = wider
        if parts + 2 > len(starts):
            longer = np.empty(2 * len(starts), np.int64)
            for part in range(parts + 1):
                longer[part] = starts[part]
            starts = longer
        _copy(work[now], size[now], out, k)
        k += size[now]
        parts += 1
        starts[parts] = k
    return out[:k], starts[: parts + 1]


@called
def _copy(points: FloatArray, n: int, out: FloatArray, at: int) -> None:
    """Write the first n corners to `out` from `at` on.

    A loop: assigning an array to a part of another compiles the words that say how their shapes differ, for seconds.
    """
    for k in range(n):
        for c in range(5):
            out[at + k, c] = points[k, c]


@called
def _cut(points: FloatArray, n: int, axis: int, at: float, keep_above: bool, out: FloatArray) -> int:
    """Write a convex polygon's part on one side of a line of texture space; return its size."""
    size = 0
    for i in range(n):
        a, b = points[i], points[i + 1 if i + 1 < n else 0]
        da, db = (a[axis] - at, b[axis] - at) if keep_above else (at - a[axis], at - b[axis])
        if da >= 0.0:
            for c in range(5):
                out[size, c] = a[c]
            size += 1
        if (da > 0.0 and db < 0.0) or (da < 0.0 and db > 0.0):
            # from the outer end, whichever side asks
            if da > db:
                a, b, da, db = b, a, db, da
            if not keep_above:
                a, b, da, db = b, a, db, da
            t = da / (da - db)
            for c in range(5):
                out[size, c] = a[c] + t * (b[c] - a[c])
            out[size, axis] = at
            size += 1
    return size


@called
def _area(points: FloatArray, n: int) -> float:
    """Return the area of a planar polygon in space."""
    x, y, z = 0.0, 0.0, 0.0
    for i in range(1, n - 1):
        ax, ay, az = points[i, 0] - points[0, 0], points[i, 1] - points[0, 1], points[i, 2] - points[0, 2]
        bx, by, bz = points[i + 1, 0] - points[0, 0], points[i + 1, 1] - points[0, 1], points[i + 1, 2] - points[0, 2]
        x += ay * bz - az * by
        y += az * bx - ax * bz
        z += ax * by - ay * bx
    return 0.5 * np.sqrt(x * x + y * y + z * z)
