"""Where colours meet inside a pixel: the visible borders, as straight runs between two shades.

A pixel's colour under any filter is the integral of its base shade over the pixel, and for every run between a shade to
its left and one to its right the difference of the two, integrated over what lies between the pixel's left side and the
run. The runs come from the same slabs as exact coverage (`slabs`); where a border goes on through several slabs it is
one run, so a filter is integrated over few of them. A part of the pixel whose last shade is not the base has one more
run, along its right side.
"""

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating
from aliasbench.renderers.reference.coverage import MANY_LINES, MAX_LEVEL, select_pieces
from aliasbench.renderers.reference.slabs import front_owner, gather_lines
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

BASE, COUNT = 0, 1  # places in the state of a pixel being traced
_UNSET = -1


@allocating
def trace_pixel(
    points: FloatArray, starts: IntArray, planes: FloatArray, owners: IntArray, shades: IntArray, perspective: bool,
    extent: float, cand: IntArray, n: int, X: float, Y: float, state: IntArray, runs: FloatArray, sides: IntArray,
) -> tuple[FloatArray, IntArray]:  # fmt: skip
    """Return the base shade of a pixel and its visible borders.

    Parameters
    ----------
    points, starts, planes, owners
        Of `Pieces`.
    shades : (objects + 1,) int64
        A number for the colour of every object, and last of the background.
    cand, n
        The pieces that may reach into the pixel.
    X, Y : float
        The pixel's corner.
    state : (2,) int64
        Filled with the base shade and the number of borders.
    runs, sides : (k, 5) float64, (k, 2) int64
        Room for the borders; returned enlarged where it does not do.

    Returns
    -------
    runs : (>= number of borders, 5) float64
        x of the left end of what the run is measured from, then x and y of the upper and of the lower end, relative to
        the pixel's corner.
    sides : (>= number of borders, 2) int64
        The shades to the left and to the right.
    """
    stack = np.empty((3 * MAX_LEVEL + 4, 4))
    stack[0] = 0.0, 0.0, 1.0, 0.0
    depth = 1
    state[BASE], state[COUNT] = _UNSET, 0
    kept, edges = np.empty(n, np.int64), np.empty(n, np.int64)
    while depth > 0:
        depth -= 1
        ox, oy, size, level = stack[depth]
        here = select_pieces(
            points, starts, planes, owners, perspective, extent, cand, n, X + ox, Y + oy, size, kept, edges
        )
        lines = edges[:here].sum()
        if here == 0 or (here == 1 and lines == 0):
            shade = shades[-1] if here == 0 else shades[owners[kept[0]]]
            if state[BASE] == _UNSET:
                state[BASE] = shade
            if shade != state[BASE]:
                runs, sides = _with_room(runs, sides, state[COUNT] + 1)
                k = state[COUNT]
                runs[k] = ox, ox + size, oy, ox + size, oy + size
                sides[k] = shade, state[BASE]
                state[COUNT] += 1
            continue
        if level < MAX_LEVEL and lines > MANY_LINES:
            half = size / 2
            for q in range(4):
                stack[depth] = ox + half * (q % 2), oy + half * (q // 2), half, level + 1
                depth += 1
            continue
        runs, sides = _trace_cell(
            points, starts, planes, owners, shades, perspective, extent, kept, edges, here, lines,
            X, Y, ox, oy, size, state, runs, sides,
        )  # fmt: skip
    return runs, sides


@allocating
def _with_room(runs: FloatArray, sides: IntArray, needed: int) -> tuple[FloatArray, IntArray]:
    """Return arrays that hold at least `needed` rows, with the rows of the given ones."""
    if needed <= len(runs):
        return runs, sides
    more_runs, more_sides = np.empty((2 * needed, 5)), np.empty((2 * needed, 2), np.int64)
    for k in range(len(runs)):
        more_sides[k, 0], more_sides[k, 1] = sides[k, 0], sides[k, 1]
        for c in range(5):
            more_runs[k, c] = runs[k, c]
    return more_runs, more_sides


@allocating
def _trace_cell(
    points: FloatArray, starts: IntArray, planes: FloatArray, owners: IntArray, shades: IntArray, perspective: bool,
    extent: float, kept: IntArray, edges: IntArray, here: int, lines: int, X: float, Y: float, ox: float, oy: float,
    size: float, state: IntArray, runs: FloatArray, sides: IntArray,
) -> tuple[FloatArray, IntArray]:  # fmt: skip
    """Append the borders of one cell at (ox, oy) of the pixel; return what `trace_pixel` does."""
    line, piece, side, band, events, nl, ne = gather_lines(
        points, starts, planes, perspective, extent, kept, edges, here, lines, X + ox, Y + oy, size
    )
    # at most one run of each line, and of the right side, is under way: these are finished when they change or end
    under_way = np.zeros(nl + 1, np.bool_)
    run = np.empty((nl + 1, 5))
    between = np.empty((nl + 1, 2), np.int64)
    xs, at = np.empty(nl), np.empty(nl, np.int64)
    spans = np.empty((here, 2))
    previous = 0.0
    for k in range(1, ne):
        if events[k] - previous <= 1e-15 * size and k + 1 < ne:
            continue
        top, bottom = previous, events[k]
        middle = top + (bottom - top) / 2
        previous = bottom
        for a in range(here):
            inside = edges[a] == 0 or (band[a, 0] <= middle <= band[a, 1])
            spans[a] = (-np.inf, np.inf) if inside else (1.0, 0.0)
        nx = 0
        for e in range(nl):
            if line[e, 2] <= middle <= line[e, 3]:
                x = line[e, 0] + line[e, 1] * middle
                if side[e] > 0:
                    spans[piece[e], 1] = min(spans[piece[e], 1], x)
                elif side[e] < 0:
                    spans[piece[e], 0] = max(spans[piece[e], 0], x)
                if 0.0 < x < size:
                    i = nx
                    while i > 0 and xs[i - 1] > x:
                        xs[i], at[i] = xs[i - 1], at[i - 1]
                        i -= 1
                    xs[i], at[i] = x, e
                    nx += 1
        shown, left, border = _UNSET, 0.0, -1
        for s in range(nx + 1):
            right = xs[s] if s < nx else size
            # borders that coincide leave no gap between them
            if right - left > 1e-15 * size or (s == nx and shown == _UNSET):
                owner = front_owner(
                    planes, owners, perspective, extent, kept, spans, here, X + ox, Y + oy, (left + right) / 2, middle
                )
                shade = shades[owner]
                if shown != _UNSET and shade != shown:
                    runs, sides = _go_on(
                        line, border, nl, top, bottom, ox, oy, size, shown, shade, under_way, run, between,
                        state, runs, sides,
                    )  # fmt: skip
                shown = shade
            if s < nx:
                left, border = right, at[s]
        if state[BASE] == _UNSET:
            state[BASE] = shown
        if shown != state[BASE]:
            runs, sides = _go_on(
                line, nl, nl, top, bottom, ox, oy, size, shown, state[BASE], under_way, run, between, state, runs, sides
            )
    for e in range(nl + 1):
        if under_way[e]:
            runs, sides = _finish(e, run, between, state, runs, sides)
    return runs, sides


@allocating
def _go_on(
    line: FloatArray, e: int, nl: int, top: float, bottom: float, ox: float, oy: float, size: float, left: int,
    right: int, under_way: BoolArray, run: FloatArray, between: IntArray, state: IntArray, runs: FloatArray,
    sides: IntArray,
) -> tuple[FloatArray, IntArray]:  # fmt: skip
    """Let line e (nl: the right side) part two shades from `top` to `bottom` of a cell, going on with its run if any.

    Returns the arrays of finished runs.
    """
    if e == nl:
        upper, lower = size, size
    else:
        upper = min(size, max(0.0, line[e, 0] + line[e, 1] * top))
        lower = min(size, max(0.0, line[e, 0] + line[e, 1] * bottom))
    if under_way[e] and run[e, 4] == oy + top and between[e, 0] == left and between[e, 1] == right:
        run[e, 3], run[e, 4] = ox + lower, oy + bottom
        return runs, sides
    if under_way[e]:
        runs, sides = _finish(e, run, between, state, runs, sides)
    under_way[e] = True
    run[e] = ox, ox + upper, oy + top, ox + lower, oy + bottom
    between[e] = left, right
    return runs, sides


@allocating
def _finish(
    e: int, run: FloatArray, between: IntArray, state: IntArray, runs: FloatArray, sides: IntArray,
) -> tuple[FloatArray, IntArray]:  # fmt: skip
    """Append the run of line e to the finished ones; return their arrays."""
    k = state[COUNT]
    runs, sides = _with_room(runs, sides, k + 1)
    for c in range(5):
        runs[k, c] = run[e, c]
    sides[k, 0], sides[k, 1] = between[e, 0], between[e, 1]
    state[COUNT] += 1
    return runs, sides
