"""Exact box-filtered pictures of flat-coloured pieces: every pixel is cut into trapezoids that show one colour each.

A pixel (a cell) that edges cross is cut into horizontal slabs at every height where something happens: a corner, two
edges crossing, an edge meeting the cell's side, two planes that intersect. Inside a slab no edges cross, so the spans
between them are trapezoids, their area is height times width half-way up, and the nearest piece half-way is the one
that is seen. This handles pieces that run through each other, needs no overlay whose topology could fail, and the areas
of a cell always add up to the cell. Edges are moved to the cell's corner in doubled precision: parts that share an edge
agree on it to the last bit, and an area is good to a few ulp wherever it lies.

Any other filter is an integral over the same trapezoids.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.renderers.reference.slabs import add_area, cut_slabs, nearness_at, tie_of
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]

MANY_LINES = 32
MAX_LEVEL = 5


@njit(cache=True, nogil=True, error_model="numpy")
def cover_rows(
    points: FloatArray, starts: IntArray, planes: FloatArray, owners: IntArray, instants: IntArray,
    colors: FloatArray, perspective: bool, extent: float, weights: FloatArray, rows: IntArray, out: FloatArray,
) -> int:  # fmt: skip
    """Add weights[t] times the picture of every instant t to rows [rows[0], rows[1]) of `out` (h, w, 3).

    `colors` has a row for every object, then the background's. `extent` is the scene's size, for ties of depth.
    Returns the number of cells that needed slabs.
    """
    work = 0
    width = out.shape[1]
    total, comp = np.zeros(3), np.zeros(3)
    for t in range(len(weights)):
        first, last = instants[t], instants[t + 1]
        band, low, high, here = band_candidates(points, starts, first, last, rows)
        for row in range(rows[0], rows[1]):
            first_of, ids, alone = row_candidates(points, starts, band, low, high, here, row, width)
            for column in range(width):
                begin, count = first_of[column], first_of[column + 1] - first_of[column]
                if alone[column]:
                    shown = -1 if count == 0 else owners[ids[begin]]
                    for c in range(3):
                        out[row, column, c] += weights[t] * colors[shown, c]
                    continue
                total[:] = 0.0
                comp[:] = 0.0
                work += cover_pixel(
                    points, starts, planes, owners, colors, perspective, extent, ids[begin:], count,
                    float(column), float(row), total, comp,
                )  # fmt: skip
                for c in range(3):
                    out[row, column, c] += weights[t] * (total[c] + comp[c])
    return work


@allocating
def band_candidates(
    points: FloatArray, starts: IntArray, first: int, last: int, rows: IntArray
) -> tuple[IntArray, FloatArray, FloatArray, int]:
    """Return the pieces that reach into rows [rows[0], rows[1]), their least and greatest y, and their number."""
    low, high = np.empty(last - first), np.empty(last - first)
    band = np.empty(last - first, np.int64)
    here = 0
    for i in range(first, last):
        top, bottom = np.inf, -np.inf
        for k in range(starts[i], starts[i + 1]):
            top, bottom = min(top, points[k, 1]), max(bottom, points[k, 1])
        if top < rows[1] and bottom > rows[0]:
            band[here], low[here], high[here] = i, top, bottom
            here += 1
    return band, low, high, here


@allocating
def row_candidates(
    points: FloatArray, starts: IntArray, band: IntArray, low: FloatArray, high: FloatArray, here: int, row: int,
    width: int,
) -> tuple[IntArray, IntArray, NDArray[np.bool_]]:  # fmt: skip
    """Return the pieces that may reach into each pixel of a row.

    Returns
    -------
    first_of : (width + 2,) int64
    ids : (k,) int64
        The pieces of column x: ids[first_of[x] : first_of[x + 1]].
    alone : (width,) bool
        Whether one thing fills the pixel for certain: its only piece, or the background.
    """
    spans = np.empty((here, 2), np.int64)
    solid = np.empty((here, 2))
    # numbers in each column, moved up by two so that the sums below end as first places
    first_of = np.zeros(width + 2, np.int64)
    for i in range(here):
        spans[i] = 0, 0
        if low[i] < row + 1 and high[i] > row:
            lo, hi = row_extent(points, starts[band[i]], starts[band[i] + 1], row, row + 1)
            if lo < width and hi > 0:
                spans[i] = int(max(0.0, np.floor(lo))), int(min(float(width), np.ceil(hi)))
                solid[i] = _solid_extent(points, starts[band[i]], starts[band[i] + 1], row)
                for column in range(spans[i, 0], spans[i, 1]):
                    first_of[column + 2] += 1
    for column in range(width):
        first_of[column + 2] += first_of[column + 1]
    ids = np.empty(first_of[width + 1], np.int64)
    for i in range(here):
        for column in range(spans[i, 0], spans[i, 1]):
            ids[first_of[column + 1]] = i
            first_of[column + 1] += 1
    alone = np.empty(width, np.bool_)
    for column in range(width):
        begin, n = first_of[column], first_of[column + 1] - first_of[column]
        alone[column] = n == 0
        if n == 1:
            alone[column] = solid[ids[begin], 0] <= column and column + 1 <= solid[ids[begin], 1]
    for k in range(len(ids)):
        ids[k] = band[ids[k]]
    return first_of, ids, alone


@called
def row_extent(points: FloatArray, begin: int, end: int, low: float, high: float) -> tuple[float, float]:
    """Return the least and greatest x of a convex piece between two heights."""
    lo, hi = np.inf, -np.inf
    for k in range(begin, end):
        j = k + 1 if k + 1 < end else begin
        x0, y0, x1, y1 = points[k, 0], points[k, 1], points[j, 0], points[j, 1]
        if y0 > y1:
            x0, y0, x1, y1 = x1, y1, x0, y0
        if y1 < low or y0 > high:
            continue
        a = x0 if y0 >= low else x0 + (low - y0) / (y1 - y0) * (x1 - x0)
        b = x1 if y1 <= high else x0 + (high - y0) / (y1 - y0) * (x1 - x0)
        lo, hi = min(lo, a, b), max(hi, a, b)
    return lo - 1e-9, hi + 1e-9


@called
def _solid_extent(points: FloatArray, begin: int, end: int, row: int) -> tuple[float, float]:
    """Return the x range that a convex piece fills all through a row of pixels (empty: inf, -inf)."""
    lo, hi = -np.inf, np.inf
    low, high = np.inf, -np.inf
    for k in range(begin, end):
        j = k + 1 if k + 1 < end else begin
        x0, y0, x1, y1 = points[k, 0], points[k, 1], points[j, 0], points[j, 1]
        low, high = min(low, y0), max(high, y0)
        if y0 == y1:
            continue
        for y in (row, row + 1):
            if min(y0, y1) <= y <= max(y0, y1):
                x = x0 + (y - y0) / (y1 - y0) * (x1 - x0)
                # the piece lies to the left of an edge that goes down
                if y1 > y0:
                    hi = min(hi, x - 1e-9)
                else:
                    lo = max(lo, x + 1e-9)
    if low <= row and high >= row + 1 and np.isfinite(lo) and np.isfinite(hi):
        return lo, hi
    return np.inf, -np.inf


@allocating
def cover_pixel(
    points: FloatArray, starts: IntArray, planes: FloatArray, owners: IntArray, colors: FloatArray, perspective: bool,
    extent: float, cand: IntArray, n: int, x: float, y: float, total: FloatArray, comp: FloatArray,
) -> int:  # fmt: skip
    """Sum the colours of one pixel, dividing it where too many edges meet; return the number of slabbed cells."""
    stack = np.empty((3 * MAX_LEVEL + 4, 4))
    stack[0] = x, y, 1.0, 0.0
    depth = 1
    work = 0
    while depth > 0:
        depth -= 1
        cx, cy, size, level = stack[depth]
        answer = _cell(
            points, starts, planes, owners, colors, perspective, extent, cand, n, cx, cy, size,
            level < MAX_LEVEL, total, comp,
        )  # fmt: skip
        if answer == 2:
            half = size / 2
            for q in range(4):
                stack[depth] = cx + half * (q % 2), cy + half * (q // 2), half, level + 1
                depth += 1
        work += answer
    return work


@allocating
def _cell(
    points: FloatArray, starts: IntArray, planes: FloatArray, owners: IntArray, colors: FloatArray, perspective: bool,
    extent: float, cand: IntArray, n: int, X: float, Y: float, size: float, divisible: bool, total: FloatArray,
    comp: FloatArray,
) -> int:  # fmt: skip
    """Sum the colours of one cell; return 0 if one colour fills it, 1 if it took slabs, 2 if it must be divided."""
    kept = np.empty(n, np.int64)
    edges = np.empty(n, np.int64)
    count = select_pieces(points, starts, planes, owners, perspective, extent, cand, n, X, Y, size, kept, edges)
    lines = edges[:count].sum()
    if count == 0:
        add_area(total, comp, colors[-1], size * size)
        return 0
    if count == 1 and lines == 0:
        add_area(total, comp, colors[owners[kept[0]]], size * size)
        return 0
    if divisible and lines > MANY_LINES:
        return 2
    cut_slabs(
        points, starts, planes, owners, colors, perspective, extent,
        kept, edges, count, lines, X, Y, size, total, comp,
    )  # fmt: skip
    return 1


@called
def select_pieces(
    points: FloatArray, starts: IntArray, planes: FloatArray, owners: IntArray, perspective: bool, extent: float,
    cand: IntArray, n: int, X: float, Y: float, size: float, kept: IntArray, edges: IntArray,
) -> int:  # fmt: skip
    """Return how many pieces may be seen in a cell, and fill which (`kept`) and how many of their edges cross it.

    A piece with 0 `edges` fills the cell.
    """
    count = 0
    mx, my, half = X + size / 2, Y + size / 2, size / 2
    for a in range(n):
        i = cand[a]
        crossing, outside = 0, False
        for k in range(starts[i], starts[i + 1]):
            j = k + 1 if k + 1 < starts[i + 1] else starts[i]
            dx, dy = points[j, 0] - points[k, 0], points[j, 1] - points[k, 1]
            f = dx * (my - points[k, 1]) - dy * (mx - points[k, 0])
            reach = (abs(dx) + abs(dy)) * half
            if f <= -reach:
                outside = True
                break
            if f < reach:
                crossing += 1
        if not outside:
            kept[count], edges[count] = i, crossing
            count += 1
    return _drop_hidden(planes, owners, perspective, extent, kept, edges, count, X, Y, size)


@called
def _drop_hidden(
    planes: FloatArray, owners: IntArray, perspective: bool, extent: float, kept: IntArray, edges: IntArray,
    count: int, X: float, Y: float, size: float,
) -> int:  # fmt: skip
    """Drop what lies behind a piece that fills the cell; return how many pieces are left."""
    front, best = -1, -np.inf
    for a in range(count):
        if edges[a] == 0:
            p = planes[kept[a], 0]
            low = min(
                nearness_at(p, X, Y),
                nearness_at(p, X + size, Y),
                nearness_at(p, X, Y + size),
                nearness_at(p, X + size, Y + size),
            )
            tie = tie_of(perspective, extent, low, best) if front >= 0 else 0.0
            if front < 0 or low > best + tie or (low >= best - tie and owners[kept[a]] > owners[kept[front]]):
                front, best = a, low
    if front < 0 or count == 1:
        return count
    f = kept[front]
    size_kept = 0
    for a in range(count):
        i = kept[a]
        hidden = a != front
        if hidden:
            strictly, weakly = True, True
            for corner in range(4):
                x, y = X + size * (corner % 2), Y + size * (corner // 2)
                v, w = nearness_at(planes[f, 0], x, y), nearness_at(planes[i, 0], x, y)
                tie = tie_of(perspective, extent, v, w)
                strictly = strictly and v - w > tie
                weakly = weakly and v - w >= -tie
            hidden = strictly or (weakly and owners[f] >= owners[i])
        if not hidden:
            kept[size_kept], edges[size_kept] = i, edges[a]
            size_kept += 1
    return size_kept
