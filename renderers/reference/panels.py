"""The time integral of what one pixel cell shows, over the slices in which it may change.

Simpson's rule on panels of five instants, of which the one with the largest bound is halved until the bounds add up to
little enough; a half keeps three of the five instants. With the third differences d and e of a panel's values, Simpson
with half the step differs by (d - e) / 12. A kink or a jump of the first derivative leaves at most that much error, a
jump of the value at most twice: a panel's bound is (abs d + abs e) / 6, where two kinks cannot cancel.

What no instant sees would be missed: a corner that enters the cell and leaves it between two instants, g apart. At
speed V it gets as far as V g / 2 and covers less than (V g)^2 / 12 on average; that much is added wherever outlines
might do it (more than one straight outline near the cell). Planes that may change their order are looked at
beforehand: slices are halved until their distance at the cell's corners is seen to keep its sign or to change it.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

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


@njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def integrate_cell(
    movers: Movers, contacts: Contacts, n: int, block: Block, shades: Shades, blur: Blur | None, extent: float,
    span: float, shutter: float, target: float, allowed: int, panels: Panels, room: Room, runs: FloatArray,
    sides: IntArray, total: FloatArray, bound: FloatArray,
) -> tuple[int, FloatArray, IntArray]:  # fmt: skip
    """Add a cell's integral over n contacts to `total` (rows columns 3,), and its bounds to `bound` (rows, columns).

    Parameters
    ----------
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
    most = len(panels.bounds)
    peak = 0.0
    for i in range(block.rows):
        for j in range(block.columns):
            peak = max(peak, shades.peaks[block.row - block.top - i, block.column - block.left - j])
    count, looks = 0, 0
    unresolved = 0.0
    for k in range(n):
        faces, amount = contacts.faces[contacts.starts[k] :], contacts.starts[k + 1] - contacts.starts[k]
        before = count
        if contacts.restless[k]:
            count, more, seen = _resolve(
                movers, faces, amount, contacts.begins[k], contacts.lengths[k], block, extent, room,
                min(most - n + k, count + max(4, allowed // 8)), panels.spans, count,
            )  # fmt: skip
            unresolved += more * span / shutter
            looks += seen
        else:
            panels.spans[count, 0], panels.spans[count, 1] = contacts.begins[k], contacts.lengths[k]
            count += 1
        for p in range(before, count):
            panels.contacts[p] = k
            begin, length = panels.spans[p]
            first = 0
            if p > 0 and abs(panels.spans[p - 1, 0] + panels.spans[p - 1, 1] - begin) <= 1e-14:
                panels.values[p, 0, :size] = panels.values[p - 1, 4, :size]
                first = 1
            for q in range(first, 5):
                runs, sides = _look(
                    movers, faces, amount, begin + length * q / 4, block, shades, blur, extent, room, runs, sides,
                    panels.values[p, q],
                )  # fmt: skip
            looks += 5 - first
            _judge(panels, p, contacts.speeds[k], span, shutter, peak, size)
    over = 0.0
    for p in range(count):
        over += panels.bounds[p]
    while over > target and looks < allowed and count < most:
        worst = 0
        for p in range(1, count):
            if panels.bounds[p] > panels.bounds[worst]:
                worst = p
        if not panels.bounds[worst] > 0.0:
            break
        over -= panels.bounds[worst]
        begin, length = panels.spans[worst, 0], panels.spans[worst, 1] / 2
        k = panels.contacts[worst]
        if length <= 1e-13 * shutter:
            # as short as time can be told: it stays as it is
            unresolved += panels.bounds[worst] / peak
            panels.bounds[worst] = 0.0
            continue
        faces, amount = contacts.faces[contacts.starts[k] :], contacts.starts[k + 1] - contacts.starts[k]
        panels.contacts[count] = k
        panels.spans[count, 0], panels.spans[count, 1] = begin + length, length
        panels.spans[worst, 1] = length
        for q in range(3):
            panels.values[count, 2 * q, :size] = panels.values[worst, 2 + q, :size]
        panels.values[worst, 4, :size] = panels.values[worst, 2, :size]
        panels.values[worst, 2, :size] = panels.values[worst, 1, :size]
        for half in range(2):
            p = worst if half == 0 else count
            for q in (1, 3):
                runs, sides = _look(
                    movers, faces, amount, panels.spans[p, 0] + length * q / 4, block, shades, blur, extent, room, runs,
                    sides, panels.values[p, q],
                )  # fmt: skip
            _judge(panels, p, contacts.speeds[k], span, shutter, peak, size)
            over += panels.bounds[p]
        looks += 4
        count += 1
    for i in range(block.rows):
        for j in range(block.columns):
            bound[i, j] += unresolved * min(1.0, shades.peaks[block.row - block.top - i, block.column - block.left - j])
    for p in range(count):
        _sum_up(panels, p, block, shades, shutter, total, bound)
    return looks, runs, sides


@njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _look(
    movers: Movers, faces: IntArray, amount: int, time: float, block: Block, shades: Shades, blur: Blur | None,
    extent: float, room: Room, runs: FloatArray, sides: IntArray, out: FloatArray,
) -> tuple[FloatArray, IntArray]:  # fmt: skip
    """Fill `out` with what a cell adds at a time."""
    m = place_faces(movers, faces, amount, time, room)
    return fill_value(
        room.points, room.starts, room.planes, room.owners, movers.perspective, extent, np.arange(m), m, block,
        shades, blur, runs, sides, out,
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _judge(panels: Panels, p: int, speed: float, span: float, shutter: float, peak: float, size: int) -> None:
    """Fill the bound of a panel, and its part that no instant may have seen."""
    v, share = panels.values[p], panels.spans[p, 1] / shutter
    worst = 0.0
    for k in range(size):
        d = v[0, k] - 3.0 * v[1, k] + 3.0 * v[2, k] - v[3, k]
        e = v[1, k] - 3.0 * v[2, k] + 3.0 * v[3, k] - v[4, k]
        worst = max(worst, abs(d) + abs(e))
    way = speed * panels.spans[p, 1] / 4
    panels.unseen[p] = share / 4 * span * min(1.0, way * way / 12.0)
    panels.bounds[p] = share * worst * _SAFETY + panels.unseen[p] * peak


@njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _sum_up(
    panels: Panels, p: int, block: Block, shades: Shades, shutter: float, total: FloatArray, bound: FloatArray
) -> None:
    """Add a panel's integral and bounds."""
    v, share = panels.values[p], panels.spans[p, 1] / shutter
    k = 0
    for i in range(block.rows):
        for j in range(block.columns):
            worst = 0.0
            for _ in range(3):
                d = v[0, k] - 3.0 * v[1, k] + 3.0 * v[2, k] - v[3, k]
                e = v[1, k] - 3.0 * v[2, k] + 3.0 * v[3, k] - v[4, k]
                worst = max(worst, abs(d) + abs(e))
                total[k] += share * (v[0, k] + 4.0 * v[1, k] + 2.0 * v[2, k] + 4.0 * v[3, k] + v[4, k]) / 12.0
                k += 1
            peak = shades.peaks[block.row - block.top - i, block.column - block.left - j]
            bound[i, j] += share * worst * _SAFETY + panels.unseen[p] * peak


@njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _resolve(
    movers: Movers, faces: IntArray, amount: int, begin: float, length: float, block: Block, extent: float, room: Room,
    most: int, spans: FloatArray, count: int,
) -> tuple[int, float, int]:  # fmt: skip
    """Halve a slice until the order of its planes is told between the instants; append its panels to `spans`.

    Returns the number of panels, the length of time for which it is not told, and the number of instants looked at.
    """
    stack = np.empty((_DEEPEST + 2, 3))
    stack[0] = begin, length, 0.0
    depth, unresolved, looks = 1, 0.0, 0
    while depth > 0:
        depth -= 1
        start, size, level = stack[depth]
        looks += 5
        if not _may_touch(movers, faces, amount, start, size, block, extent, room):
            spans[count, 0], spans[count, 1] = start, size
            count += 1
        elif level < _DEEPEST and count + depth + 2 <= most:
            stack[depth] = start + size / 2, size / 2, level + 1
            stack[depth + 1] = start, size / 2, level + 1
            depth += 2
        else:
            spans[count, 0], spans[count, 1] = start, size
            count += 1
            unresolved += size
    return count, unresolved, looks


@njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
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
