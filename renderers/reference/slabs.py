"""One cell that edges cross, cut into slabs and spans: the heart of exact coverage (see `coverage`)."""

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.renderers.reference.cells import cross_lines, local_line, sort_prefix
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]

TIE = 1e-9  # nearer than this (relative) is in the same plane, where the later object wins


@called
def add_area(total: FloatArray, comp: FloatArray, color: FloatArray, area: float) -> None:
    """Add area times colour, keeping what each sum loses (Neumaier)."""
    for c in range(3):
        value = color[c] * area
        s = total[c] + value
        if abs(total[c]) >= abs(value):
            comp[c] += (total[c] - s) + value
        else:
            comp[c] += (value - s) + total[c]
        total[c] = s


@called
def nearness_at(plane: FloatArray, x: float, y: float) -> float:
    return plane[0] * x + plane[1] * y + plane[2]


@called
def tie_of(perspective: bool, extent: float, a: float, b: float) -> float:
    return TIE * (max(abs(a), abs(b)) if perspective else extent)


@allocating
def gather_lines(
    points: FloatArray, starts: IntArray, planes: FloatArray, perspective: bool, extent: float, kept: IntArray,
    edges: IntArray, count: int, lines: int, X: float, Y: float, size: float,
) -> tuple[FloatArray, IntArray, IntArray, FloatArray, FloatArray, int, int]:  # fmt: skip
    """Return the lines that cross a cell and the sorted heights at which anything happens in it.

    Returns
    -------
    line : (n, 4) float64
        Intercept at the cell's top, slope dx/dy, first and last height; all relative to the cell's corner.
    piece : (n,) int64
        The index into `kept`, -1 where two planes meet.
    side : (n,) int64
        -1: the piece is to the right of the line; 1: to the left.
    band : (count, 2) float64
        First and last height of every piece.
    events : (m,) float64
    n, m : int
        How much of these arrays is filled.
    """
    room = lines
    for a in range(count):
        for b in range(a):
            if _planes_meet(planes[kept[a], 0], planes[kept[b], 0], perspective, extent, X, Y, size):
                room += 1
    line = np.empty((room, 4))
    piece = np.empty(room, np.int64)
    side = np.empty(room, np.int64)
    band = np.empty((count, 2))
    events = np.empty(2 + 2 * count + 4 * room + room * (room - 1) // 2 + room)
    nl, ne = 0, 2
    events[0], events[1] = 0.0, size
    for a in range(count):
        i = kept[a]
        band[a] = 0.0, size
        if edges[a] == 0:
            continue
        low, high = np.inf, -np.inf
        for k in range(starts[i], starts[i + 1]):
            j = k + 1 if k + 1 < starts[i + 1] else starts[i]
            low, high = min(low, points[k, 1]), max(high, points[k, 1])
            dx, dy = points[j, 0] - points[k, 0], points[j, 1] - points[k, 1]
            f = dx * (Y + size / 2 - points[k, 1]) - dy * (X + size / 2 - points[k, 0])
            if f >= (abs(dx) + abs(dy)) * size / 2:
                continue
            e, g = (k, j) if dy > 0.0 else (j, k)
            if points[g, 1] <= Y or points[e, 1] >= Y + size or not points[g, 1] - points[e, 1] > 1e-15:
                continue
            c, m = local_line(points[e, 0], points[e, 1], points[g, 0], points[g, 1], X, Y)
            line[nl] = c, m, points[e, 1] - Y, points[g, 1] - Y
            piece[nl], side[nl] = a, 1 if dy > 0.0 else -1
            nl += 1
        band[a] = low - Y, high - Y
        for y in (low - Y, high - Y):
            if 0.0 < y < size:
                events[ne] = y
                ne += 1
    for a in range(count):
        for b in range(a):
            p, q = planes[kept[a], 0], planes[kept[b], 0]
            if not _planes_meet(p, q, perspective, extent, X, Y, size):
                continue
            da, db = p[0] - q[0], p[1] - q[1]
            dc = nearness_at(p, X, Y) - nearness_at(q, X, Y)
            if abs(da) <= 1e-12 * abs(db):
                y = -dc / db
                if 0.0 < y < size:
                    events[ne] = y
                    ne += 1
            else:
                line[nl] = -dc / da, -db / da, 0.0, size
                piece[nl], side[nl] = -1, 0
                nl += 1
    ne = cross_lines(line, nl, size, events, ne)
    sort_prefix(events, ne)
    return line, piece, side, band, events, nl, ne


@allocating
def cut_slabs(
    points: FloatArray, starts: IntArray, planes: FloatArray, owners: IntArray, colors: FloatArray, perspective: bool,
    extent: float, kept: IntArray, edges: IntArray, count: int, lines: int, X: float, Y: float, size: float,
    total: FloatArray, comp: FloatArray,
) -> None:  # fmt: skip
    """Cut a cell into slabs and spans, and add the colour seen in each."""
    line, piece, side, band, events, nl, ne = gather_lines(
        points, starts, planes, perspective, extent, kept, edges, count, lines, X, Y, size
    )
    xs = np.empty(nl + 2)
    spans = np.empty((count, 2))
    previous = 0.0
    for k in range(1, ne):
        # nothing is lost by joining a slab of no height to the next one
        if events[k] - previous <= 1e-15 * size and k + 1 < ne:
            continue
        height = events[k] - previous
        middle = previous + height / 2
        previous = events[k]
        nx = 1
        xs[0] = 0.0
        for a in range(count):
            inside = edges[a] == 0 or (band[a, 0] <= middle <= band[a, 1])
            spans[a] = (-np.inf, np.inf) if inside else (1.0, 0.0)
        for e in range(nl):
            if line[e, 2] <= middle <= line[e, 3]:
                x = line[e, 0] + line[e, 1] * middle
                if side[e] > 0:
                    spans[piece[e], 1] = min(spans[piece[e], 1], x)
                elif side[e] < 0:
                    spans[piece[e], 0] = max(spans[piece[e], 0], x)
                if 0.0 < x < size:
                    xs[nx] = x
                    nx += 1
        xs[nx] = size
        nx += 1
        sort_prefix(xs, nx)
        begin, shown = 0.0, -2
        for s in range(1, nx):
            x = (xs[s - 1] + xs[s]) / 2
            owner = front_owner(planes, owners, perspective, extent, kept, spans, count, X, Y, x, middle)
            # equal colours side by side are one trapezoid
            if s > 1 and owner != shown:
                add_area(total, comp, colors[shown], height * (xs[s - 1] - begin))
                begin = xs[s - 1]
            shown = owner
        add_area(total, comp, colors[shown], height * (size - begin))


@called
def _planes_meet(
    p: FloatArray, q: FloatArray, perspective: bool, extent: float, X: float, Y: float, size: float,
) -> bool:  # fmt: skip
    """Return whether each of two planes is the nearer one somewhere in the cell."""
    low, high, tie = np.inf, -np.inf, 0.0
    for corner in range(4):
        x, y = X + size * (corner % 2), Y + size * (corner // 2)
        v, w = nearness_at(p, x, y), nearness_at(q, x, y)
        low, high, tie = min(low, v - w), max(high, v - w), max(tie, tie_of(perspective, extent, v, w))
    return low < -tie and high > tie


@called
def front_owner(
    planes: FloatArray, owners: IntArray, perspective: bool, extent: float, kept: IntArray, spans: FloatArray,
    count: int, X: float, Y: float, x: float, y: float,
) -> int:  # fmt: skip
    """Return the object that is seen at a point of the cell, -1 for none."""
    shown, best = -1, 0.0
    for a in range(count):
        if spans[a, 0] <= x <= spans[a, 1]:
            i = kept[a]
            v = nearness_at(planes[i, 0], X + x, Y + y)
            tie = tie_of(perspective, extent, v, best)
            if shown < 0 or v > best + tie or (v >= best - tie and owners[i] > shown):
                shown, best = owners[i], v
    return shown
