"""A band of rows through the whole shutter: constant spells counted once, active pixels handed to `panels`."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.reference.activity import Marks, Slices, mark_row
from aliasbench.renderers.reference.cellvalues import Blur, Shades, block_of, fill_value
from aliasbench.renderers.reference.panels import Contacts, Panels, integrate_cell
from aliasbench.renderers.reference.placement import Movers, room_for
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]


class Effort(NamedTuple):
    """What a pixel's integral may cost and how good it should be.

    Attributes
    ----------
    span : float
        The largest difference of two colours.
    shutter : float
        Its length in frame intervals.
    target : float
        The bound aimed at in every cell.
    base, share : float
        Instants that a cell may look at: `base`, and `share` for every slice in which it may change.
    most : int
        Panels of one cell.
    """

    span: float
    shutter: float
    target: float
    base: float
    share: float
    most: int


@njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def marks_for(slices: Slices, width: int) -> Marks:
    """Return room for the marks of a row."""
    most = 0
    for s in range(len(slices.begins)):
        most = max(most, slices.instants[s + 1] - slices.instants[s])
    return Marks(
        np.empty(width, np.int64), np.empty(width), np.empty(width, np.bool_), np.empty(width, np.bool_),
        np.empty(most), np.empty(most),
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def count_contacts(slices: Slices, rows: IntArray, width: int) -> tuple[int, int]:
    """Return how many pixels of a band are active in any slice, and in how many slices they are, together."""
    marks = marks_for(slices, width)
    often, total = np.zeros(width, np.int64), 0
    pixels = 0
    for row in range(rows[0], rows[1]):
        often[:] = 0
        for s in range(len(slices.begins)):
            mark_row(slices, s, row, width, marks)
            for column in range(width):
                if marks.active[column]:
                    often[column] += 1
        for column in range(width):
            total += often[column]
            if often[column] > 0:
                pixels += 1
    return pixels, total


@njit(cache=True, nogil=True, error_model="numpy")
def integrate_band(
    slices: Slices, movers: Movers, shades: Shades, blur: Blur | None, effort: Effort, rows: IntArray, width: int,
    height: int, top: int, out: FloatArray, bound: FloatArray,
) -> int:  # fmt: skip
    """Add the mean over the shutter of what rows [rows[0], rows[1]) of the picture with margin add to the picture.

    Parameters
    ----------
    width, height : int
        Of the picture without margin.
    out, bound : (n, width, 3) and (n, width) float64
        The rows from `top` on.

    Returns
    -------
    int
        How many instants of cells were looked at.
    """
    margin = shades.margin
    columns = width + 2 * margin
    widest_block = min(2 * margin + 1, width) * min(2 * margin + 1, height) * 3
    marks = marks_for(slices, columns)
    runs, sides = np.empty((64, 5)), np.empty((64, 2), np.int64)
    kept = columns * widest_block <= 4000000
    steady = np.empty((columns if kept else 1, widest_block))
    known = np.zeros(columns, np.bool_)
    sums, bounds = np.empty((columns if kept else 1, widest_block)), np.empty(widest_block)
    total = np.zeros(widest_block)
    panels = Panels(
        np.empty((effort.most, 2)), np.empty((effort.most, 5, widest_block)), np.empty(effort.most),
        np.empty(effort.most), np.empty(effort.most, np.int64),
    )  # fmt: skip
    room = room_for(8, movers.widest)
    looks = 0
    slots, faces = np.empty((1024, 3)), np.empty(4096, np.int64)
    links = np.empty((1024, 4), np.int64)
    head, tail = np.empty(columns, np.int64), np.empty(columns, np.int64)
    for row in range(rows[0], rows[1]):
        records, used = 0, 0
        head[:] = -1
        known[:] = False
        sums[:] = 0.0
        spells = np.zeros(columns)
        for s in range(len(slices.begins)):
            first = slices.instants[s]
            n = slices.instants[s + 1] - first
            begin, length = slices.begins[s], slices.lengths[s]
            mark_row(slices, s, row, columns, marks)
            loose = slices.loose_starts[s + 1] - slices.loose_starts[s]
            for column in range(columns):
                if not marks.active[column]:
                    if known[column]:
                        spells[column] += length
                        continue
                    block = block_of(row, column, margin, height, width)
                    size = block.rows * block.columns * 3
                    if size == 0:
                        continue
                    cand = np.empty(n, np.int64)
                    here = 0
                    for a in range(n):
                        if marks.left[a] < column + 1 and marks.right[a] > column:
                            cand[here] = first + a
                            here += 1
                    at = column if kept else 0
                    runs, sides = fill_value(
                        slices.points, slices.starts, slices.planes, slices.owners, slices.perspective, slices.extent,
                        cand, here, block, shades, blur, runs, sides, steady[at],
                    )  # fmt: skip
                    looks += 1
                    if kept:
                        known[column] = True
                        spells[column] = length
                    else:
                        _add(steady[0], length / effort.shutter, block.top - top, block.left, block.rows,
                             block.columns, out)  # fmt: skip
                    continue
                if known[column]:
                    known[column] = False
                    for k in range(widest_block):
                        sums[column, k] += spells[column] / effort.shutter * steady[column, k]
                if records == len(slots):
                    slots, links = _more(slots), _more_links(links)
                hidden = marks.edges[column] > 1 or not np.isfinite(marks.speed[column])
                slots[records] = begin, length, marks.speed[column] if hidden else 0.0
                if used + n + loose > len(faces):
                    wider = np.empty(2 * (used + n + loose), np.int64)
                    wider[:used] = faces[:used]
                    faces = wider
                links[records, 0], links[records, 1] = -1, used
                for a in range(n):
                    if marks.left[a] < column + 1 and marks.right[a] > column:
                        faces[used] = slices.faces[first + a]
                        used += 1
                for a in range(slices.loose_starts[s], slices.loose_starts[s + 1]):
                    twice = False
                    for b in range(links[records, 1], used):
                        twice = twice or faces[b] == slices.loose[a]
                    if not twice:
                        faces[used] = slices.loose[a]
                        used += 1
                links[records, 2], links[records, 3] = used, 1 if marks.restless[column] else 0
                if head[column] < 0:
                    head[column] = records
                else:
                    links[tail[column], 0] = records
                tail[column] = records
                records += 1
        for column in range(columns):
            block = block_of(row, column, margin, height, width)
            size = block.rows * block.columns * 3
            if size == 0:
                continue
            if kept:
                if known[column]:
                    for k in range(size):
                        sums[column, k] += spells[column] / effort.shutter * steady[column, k]
                _add(sums[column], 1.0, block.top - top, block.left, block.rows, block.columns, out)
            if head[column] < 0:
                continue
            contacts, n, fast = _contacts(head[column], slots, links, faces)
            most = 0
            for k in range(n):
                most = max(most, contacts.starts[k + 1] - contacts.starts[k])
            if most + 1 > len(room.starts):
                room = room_for(2 * most, movers.widest)
            total[:size] = 0.0
            spread = bounds[: block.rows * block.columns].reshape((block.rows, block.columns))
            spread[:] = 0.0
            allowed = int(effort.base + effort.share * n)
            begin = 0
            while begin < n:
                # as many slices at a time as there is room for panels
                end = min(n, begin + max(1, effort.most // 4))
                part, amount, _ = contacts, n, 0.0
                if end - begin < n:
                    part = Contacts(
                        contacts.begins[begin:end], contacts.lengths[begin:end], contacts.speeds[begin:end],
                        contacts.restless[begin:end], contacts.faces, contacts.starts[begin : end + 1],
                    )  # fmt: skip
                    amount = end - begin
                seen, runs, sides = integrate_cell(
                    movers, part, amount, block, shades, blur, slices.extent, effort.span, effort.shutter,
                    effort.target * amount / n, allowed * amount // n, panels, room, runs, sides, total, spread,
                )  # fmt: skip
                looks += seen
                begin = end
            _add(total, 1.0, block.top - top, block.left, block.rows, block.columns, out)
            for i in range(block.rows):
                for j in range(block.columns):
                    peak = shades.peaks[row - block.top - i, column - block.left - j]
                    bound[block.top - top + i, block.left + j] += (
                        spread[i, j] + fast * effort.span * min(1.0, peak) / effort.shutter
                    )
    return looks


@njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _contacts(first: int, slots: FloatArray, links: IntArray, faces: IntArray) -> tuple[Contacts, int, float]:
    """Return a pixel's contacts, their number, and how long anything could not be followed."""
    n, amount, at = 0, 0, first
    while at >= 0:
        n += 1
        amount += links[at, 2] - links[at, 1]
        at = links[at, 0]
    contacts = Contacts(
        np.empty(n), np.empty(n), np.empty(n), np.empty(n, np.bool_), np.empty(amount, np.int64),
        np.zeros(n + 1, np.int64),
    )  # fmt: skip
    k, used, at = 0, 0, first
    fast = 0.0
    while at >= 0:
        contacts.begins[k], contacts.lengths[k] = slots[at, 0], slots[at, 1]
        contacts.speeds[k] = slots[at, 2]
        if not np.isfinite(slots[at, 2]):
            fast += slots[at, 1]
            contacts.speeds[k] = 0.0
        contacts.restless[k] = links[at, 3] != 0
        for a in range(links[at, 1], links[at, 2]):
            contacts.faces[used] = faces[a]
            used += 1
        k += 1
        contacts.starts[k] = used
        at = links[at, 0]
    return contacts, n, fast


@njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _add(values: FloatArray, weight: float, top: int, left: int, rows: int, columns: int, out: FloatArray) -> None:
    """Add a block of values to the picture."""
    k = 0
    for i in range(rows):
        for j in range(columns):
            for c in range(3):
                out[top + i, left + j, c] += weight * values[k]
                k += 1


@njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _more(values: FloatArray) -> FloatArray:
    out = np.empty((2 * len(values), values.shape[1]))
    out[: len(values)] = values
    return out


@njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _more_links(values: IntArray) -> IntArray:
    out = np.empty((2 * len(values), values.shape[1]), np.int64)
    out[: len(values)] = values
    return out
