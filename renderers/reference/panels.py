"""The time integral of what one pixel cell shows, over the slices in which it may change.

Simpson's rule on panels of five instants, of which the one with the largest bound is halved until the bounds add up to
little enough; a half keeps three of the five instants. With the third differences d and e of a panel's values, Simpson
with half the step differs by (d - e) / 12. A kink or a jump of the first derivative leaves at most that much error, a
jump of the value at most twice: a panel's bound is (abs d + abs e) / 6, where two kinks cannot cancel.

What no instant sees would be missed: a corner that enters the cell and leaves it between two instants, g apart. At
speed V it gets as far as V g / 2 and covers less than (V g)^2 / 6 on average, or V W g^2 / 6 where its sides move at W
across themselves; that much is added for one gap of four wherever outlines might do it (more than one straight outline
near the cell). Planes that may change their order are looked at
beforehand: slices are halved until their distance at the cell's corners is seen to keep its sign or to change it.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.renderers.reference.cellvalues import Block, Blur, Shades, fill_value
from aliasbench.renderers.reference.placement import Movers, Room, place_faces
from aliasbench.renderers.reference.slabs import nearness_at, tie_of
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]

_DEEPEST = 14  # halvings of a slice to tell which of two planes is the nearer one
_SAFETY = 1.0 / 6.0


class Contacts(NamedTuple):
    """The slices in which one cell may change.

    Attributes
    ----------
    begins, lengths : (n,) float64
        In frame intervals.
    speeds : (n,) float64
        Bounds on the speed of outlines near the cell, pixels per frame interval, where corners may be missed, else 0.
    restless : (n,) bool
    faces : (k,) int64
    starts : (n + 1,) int64
        The faces that may be seen in slice i: faces[starts[i] : starts[i + 1]].
    """

    begins: FloatArray
    lengths: FloatArray
    speeds: FloatArray
    restless: NDArray[np.bool_]
    faces: IntArray
    starts: IntArray


class Panels(NamedTuple):
    """Room for panels: begin and length, five values, bound, what corners may add, and the contact of each."""

    spans: FloatArray
    values: FloatArray
    bounds: FloatArray
    unseen: FloatArray
    contacts: IntArray


@allocating
def integrate_cell(
    movers: Movers, contacts: Contacts, begin_at: int, end_at: int, block: Block, shades: Shades, blur: Blur | None,
    extent: float, span: float, shutter: float, target: float, allowed: int, panels: Panels, room: Room,
    runs: FloatArray, sides: IntArray, total: FloatArray, bound: FloatArray,
) -> tuple[int, FloatArray, IntArray]:  # fmt: skip
    """Add a cell's integral over some contacts to `total` (rows columns 3,), and its bounds to `bound` (rows columns,).

    Parameters
    ----------
    begin_at, end_at : int
        The first contact and the last + 1.
    span : float
        The largest difference of two colours.
    shutter : float
        Its length in frame intervals: the integral is a mean over it.
    target : float
        The bound aimed at.
    allowed : int
        About how many instants may be looked at.

    Returns
    -------
    int
        How many instants were looked at; then the room for borders.
    """
    size = block.rows * block.columns * 3
    spans, values, bounds, of = panels.spans, panels.values, panels.bounds, panels.contacts
    begins, lengths, speeds, restless = contacts.begins, contacts.lengths, contacts.speeds, contacts.restless
    starts, listed = contacts.starts, contacts.faces
    most = len(bounds)
    peak = 0.0
    for i in range(block.rows):
        for j in range(block.columns):
            peak = max(peak, shades.peaks[block.row - block.top - i, block.column - block.left - j])
    count, looks = 0, 0
    unresolved, over = 0.0, 0.0
    for k in range(begin_at, end_at):
        faces, amount = listed[starts[k] :], starts[k + 1] - starts[k]
        before = count
        if restless[k]:
            added, more, seen = _resolve(
                movers, faces, amount, begins[k], lengths[k], block, extent, room,
                min(most - end_at + k - count, max(4, allowed // 8)), spans[count:],
            )  # fmt: skip
            count += added
            unresolved += more * span / shutter
            looks += seen
        else:
            spans[count, 0], spans[count, 1] = begins[k], lengths[k]
            count += 1
        for p in range(before, count):
            of[p] = k
            begin, length = spans[p, 0], spans[p, 1]
            first = 0
            if p > 0 and abs(spans[p - 1, 0] + spans[p - 1, 1] - begin) <= 1e-14:
                _copy(values[p - 1, 4], values[p, 0], size)
                first = 1
            for q in range(first, 5):
                runs, sides = look(
                    movers, faces, amount, begin + length * q / 4, block, shades, blur, extent, room, runs, sides,
                    values[p, q],
                )  # fmt: skip
            looks += 5 - first
            _judge(panels, p, speeds[k], span, shutter, peak, size)
    over = 0.0
    for p in range(count):
        over += bounds[p]
    while over > target and looks < allowed and count < most:
        worst = count - 1
        for p in range(count):
            if bounds[p] > bounds[worst]:
                worst = p
        if not bounds[worst] > 0.0:
            break
        over -= bounds[worst]
        begin, length, k = spans[worst, 0], spans[worst, 1] / 2, of[worst]
        if length <= 1e-13 * shutter:
            # as short as time can be told: it stays as it is
            unresolved += bounds[worst] / peak
            bounds[worst] = 0.0
            continue
        of[count] = k
        spans[count, 0], spans[count, 1], spans[worst, 1] = begin + length, length, length
        for q in range(3):
            _copy(values[worst, 2 + q], values[count, 2 * q], size)
        _copy(values[worst, 2], values[worst, 4], size)
        _copy(values[worst, 1], values[worst, 2], size)
        for half in range(4):
            p = worst if half < 2 else count
            q = 1 + 2 * (half % 2)
            runs, sides = look(
                movers, listed[starts[k] :], starts[k + 1] - starts[k], spans[p, 0] + length * q / 4, block, shades,
                blur, extent, room, runs, sides, values[p, q],
            )  # fmt: skip
        for half in range(2):
            p = worst if half == 0 else count
            _judge(panels, p, speeds[k], span, shutter, peak, size)
            over += bounds[p]
        looks += 4
        count += 1
    _sum_up(panels, count, block, shades, shutter, unresolved, total, bound)
    return looks, runs, sides


@called
def _copy(values: FloatArray, out: FloatArray, size: int) -> None:
    for k in range(size):
        out[k] = values[k]


@njit(inline="always")
def look(
    movers: Movers, faces: IntArray, amount: int, time: float, block: Block, shades: Shades, blur: Blur | None,
    extent: float, room: Room, runs: FloatArray, sides: IntArray, out: FloatArray,
) -> tuple[FloatArray, IntArray]:  # fmt: skip
    """Fill `out` with what a cell adds at a time."""
    m = place_faces(movers, faces, amount, time, room)
    return fill_value(
        room.points, room.starts, room.planes, room.owners, movers.perspective, extent, room.order, m, block,
        shades, blur, runs, sides, out,
    )  # fmt: skip


@called
def _judge(panels: Panels, p: int, speed: float, span: float, shutter: float, peak: float, size: int) -> None:
    """Fill the bound of a panel, and its part that no instant may have seen."""
    values, length = panels.values, panels.spans[p, 1]
    worst = 0.0
    for k in range(size):
        worst = max(worst, _third(values[p], k))
    way = speed * length / 4
    panels.unseen[p] = length / shutter * span * min(1.0, way * way / 24.0)
    panels.bounds[p] = length / shutter * worst * _SAFETY + panels.unseen[p] * peak


@called
def _third(values: FloatArray, k: int) -> float:
    """Return the sum of the absolute third differences of a panel's values."""
    a, b, c, d, e = values[0, k], values[1, k], values[2, k], values[3, k], values[4, k]
    return abs(a - 3.0 * b + 3.0 * c - d) + abs(b - 3.0 * c + 3.0 * d - e)


@called
def _sum_up(
    panels: Panels, count: int, block: Block, shades: Shades, shutter: float, unresolved: float, total: FloatArray,
    bound: FloatArray,
) -> None:  # fmt: skip
    """Add the panels' integrals and bounds."""
    values, spans, unseen, peaks = panels.values, panels.spans, panels.unseen, shades.peaks
    rows, columns = block.rows, block.columns
    for p in range(count):
        share, hidden = spans[p, 1] / shutter, unseen[p]
        for at in range(rows * columns):
            worst = 0.0
            for k in range(3 * at, 3 * at + 3):
                worst = max(worst, _third(values[p], k))
                ends, halves = values[p, 0, k] + values[p, 4, k], values[p, 1, k] + values[p, 3, k]
                total[k] += share * (ends + 4.0 * halves + 2.0 * values[p, 2, k]) / 12.0
            peak = peaks[block.row - block.top - at // columns, block.column - block.left - at % columns]
            bound[at] += share * worst * _SAFETY + hidden * peak
    for at in range(rows * columns):
        peak = peaks[block.row - block.top - at // columns, block.column - block.left - at % columns]
        bound[at] += unresolved * min(1.0, peak)


@allocating
def _resolve(
    movers: Movers, faces: IntArray, amount: int, begin: float, length: float, block: Block, extent: float, room: Room,
    most: int, spans: FloatArray,
) -> tuple[int, float, int]:  # fmt: skip
    """Halve a slice until the order of its planes is told between the instants; write its panels to `spans`.

    Returns the number of panels, the length of time for which it is not told, and the number of instants looked at.
    """
    stack = np.empty((_DEEPEST + 2, 3))
    stack[0, 0], stack[0, 1], stack[0, 2] = begin, length, 0.0
    depth, count, unresolved, looks = 1, 0, 0.0, 0
    while depth > 0:
        depth -= 1
        start, size, level = stack[depth, 0], stack[depth, 1], stack[depth, 2]
        looks += 5
        touch = _may_touch(movers, faces, amount, start, size, block, extent, room)
        if touch and level < _DEEPEST and count + depth + 2 <= most:
            for half in range(2):
                # the first half on top
                stack[depth, 0] = start + (1 - half) * size / 2
                stack[depth, 1], stack[depth, 2] = size / 2, level + 1.0
                depth += 1
            continue
        spans[count, 0], spans[count, 1] = start, size
        count += 1
        if touch:
            unresolved += size
    return count, unresolved, looks


@allocating
def _may_touch(
    movers: Movers, faces: IntArray, amount: int, begin: float, length: float, block: Block, extent: float, room: Room
) -> bool:
    """Return whether two planes may come to meet at a corner of the cell and part again between the instants."""
    here, seen = np.empty((5, amount, 4)), np.zeros(amount, np.int64)
    for q in range(5):
        m = place_faces(movers, faces, amount, begin + length * q / 4, room)
        for a in range(m):
            at = room.which[a]
            seen[at] += 1
            for corner in range(4):
                here[q, at, corner] = nearness_at(
                    room.planes[a, 0], float(block.column + corner % 2), float(block.row + corner // 2)
                )
    for a in range(amount):
        for b in range(a):
            if seen[a] < 5 or seen[b] < 5:
                continue
            for corner in range(4):
                least, most, bend = np.inf, -np.inf, 0.0
                tie = 0.0
                for q in range(5):
                    v, w = here[q, a, corner], here[q, b, corner]
                    least, most = min(least, v - w), max(most, v - w)
                    tie = max(tie, tie_of(movers.perspective, extent, v, w))
                    if 1 <= q <= 3:
                        before = here[q - 1, a, corner] - here[q - 1, b, corner]
                        after = here[q + 1, a, corner] - here[q + 1, b, corner]
                        bend = max(bend, abs(before - 2.0 * (v - w) + after))
                # between instants a parabola gets an eighth of the second difference lower than at their ends
                if least > tie and least <= bend / 2.0 + tie:
                    return True
                if most < -tie and most >= -bend / 2.0 - tie:
                    return True
    return False
