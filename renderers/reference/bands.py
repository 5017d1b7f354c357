"""A row of pixels through the whole shutter: which slices each may change in (`scan_row`), and what that adds up to.

Slices in which nothing changes count as one; those that follow each other and in which little moves are looked at as
one contact.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating
from aliasbench.renderers.reference.activity import Marks, Slices, mark_row
from aliasbench.renderers.reference.cellvalues import Blur, Shades, block_of
from aliasbench.renderers.reference.panels import Contacts, Panels, integrate_cell, look
from aliasbench.renderers.reference.placement import Movers, room_for
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]

_BEGIN, _LENGTH, _SPEED, _FASTEST, _GONE = 0, 1, 2, 3, 4  # columns of `Records.spans`
_NEXT, _FIRST, _LAST, _KIND = 0, 1, 2, 3  # and of `Records.links`
_STEADY, _CALM, _RESTLESS, _LOST = 0, 1, 2, 3  # kinds: nothing changes; planes keep their order; or not; not followed


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
    base, share, dense : float
        Instants that a cell may look at: `base`, `share` for every contact, and `dense` for what corners need: the time
        T in which they may come near by the root of the integral of their speed squared over it. What some cells do not
        need goes to others.
    ahead : float
        What the first cells of a row may take beforehand.
    most : int
        Panels of one cell.
    """

    span: float
    shutter: float
    target: float
    base: float
    share: float
    dense: float
    ahead: float
    most: int


class Records(NamedTuple):
    """What happens to the pixels of one row, in lists by pixel.

    Attributes
    ----------
    heads : (w,) int64
        The first entry of each pixel, -1 for none.
    spans : (n, 5) float64
        Begin and length (of what is steady: an instant within it and the time it takes up in all), bounds on the speed
        of outlines (0 where no corner may be missed, and wherever), and their way.
    links : (n, 4) int64
        The next entry, first and last + 1 of its faces, and its kind.
    faces : (k,) int64
    """

    heads: IntArray
    spans: FloatArray
    links: IntArray
    faces: IntArray


@njit(cache=True, nogil=True, error_model="numpy")
def scan_row(slices: Slices, row: int, width: int, ways: FloatArray, counts: FloatArray, stage: int) -> Records:
    """Return what happens to the pixels of a row; without faces if `stage` < 0.

    Adds to counts[k] how many contacts the pixels have, together, if slices that follow each other are joined as long
    as nothing moves by more than ways[k] pixels; to counts[-2] how many pixels have any, and to counts[-1] the sum
    of what `Effort.dense` goes by. `stage`: k of the records.
    """
    stages = len(ways)
    most = 0
    for s in range(len(slices.begins)):
        most = max(most, slices.instants[s + 1] - slices.instants[s])
    active, restless = np.empty(width, np.bool_), np.empty(width, np.bool_)
    edges, speeds, left, right = np.empty(width, np.int64), np.empty(width), np.empty(most), np.empty(most)
    marks = Marks(edges, speeds, active, restless, left, right)
    last, gone, sums = np.empty(width, np.int64), np.empty((width, stages)), np.empty((width, 2))
    heads, tails, calm = np.empty(width, np.int64), np.empty(width, np.int64), np.empty(width, np.int64)
    for column in range(width):
        last[column] = -2
        heads[column] = tails[column] = calm[column] = -1
        sums[column, 0] = sums[column, 1] = 0.0
    instants, begins, lengths, places = slices.instants, slices.begins, slices.lengths, slices.faces
    loose, loose_starts = slices.loose, slices.loose_starts
    room = 64 if stage < 0 else 1024
    spans, links, faces = np.empty((room, 5)), np.empty((room, 4), np.int64), np.empty(8 * room, np.int64)
    records, used = 0, 0
    for s in range(len(begins)):
        first, n = instants[s], instants[s + 1] - instants[s]
        begin, length = begins[s], lengths[s]
        mark_row(slices, s, row, width, marks)
        more = loose_starts[s + 1] - loose_starts[s]
        for column in range(width):
            changes, raw = active[column], speeds[column]
            lost = changes and not raw < np.inf
            step = 0.0 if lost else raw * length
            if changes:
                if last[column] < 0:
                    counts[stages] += 1.0
                if not lost:
                    sums[column, 0] += length
                    sums[column, 1] += length * raw * raw
                for k in range(stages):
                    if last[column] == s - 1 and gone[column, k] + step <= ways[k]:
                        gone[column, k] += step
                    else:
                        gone[column, k] = step
                        counts[k] += 1.0
                last[column] = s
            if stage < 0:
                continue
            if not changes and calm[column] >= 0:
                spans[calm[column], _LENGTH] += length
                continue
            if records == len(spans):
                spans, links = _more(spans), _more_whole(links)
            now = tails[column]
            joins = changes and now >= 0 and calm[column] < 0 and lost == (links[now, _KIND] == _LOST)
            joins = joins and spans[now, _GONE] + step <= ways[stage]
            needed = n + more + (links[now, _LAST] - links[now, _FIRST] if joins else 0)
            while used + needed > len(faces):
                wider = np.empty(2 * len(faces), np.int64)
                for k in range(used):
                    wider[k] = faces[k]
                faces = wider
            start = used
            for a in range(n):
                if left[a] < column + 1 and right[a] > column:
                    faces[used] = places[first + a]
                    used += 1
            kind = _STEADY
            if changes:
                kind = _LOST if lost else (_RESTLESS if restless[column] else _CALM)
                for a in range(more):
                    used = _include(faces, start, used, loose[loose_starts[s] + a])
            if joins:
                # outlines that come near one after the other may hide something together
                spans[now, _LENGTH] = begin + length - spans[now, _BEGIN]
                spans[now, _GONE] += step
                if not lost:
                    spans[now, _FASTEST] = max(spans[now, _FASTEST], raw)
                    spans[now, _SPEED] = spans[now, _FASTEST]
                links[now, _KIND] = max(links[now, _KIND], kind)
                used = _join(faces, links, now, start, used)
                continue
            followed = changes and not lost
            spans[records, _BEGIN] = begin if changes else begin + length / 2
            spans[records, _LENGTH], spans[records, _GONE] = length, step
            spans[records, _SPEED] = raw if followed and edges[column] > 1 else 0.0
            spans[records, _FASTEST] = raw if followed else 0.0
            links[records, _NEXT], links[records, _KIND] = -1, kind
            links[records, _FIRST], links[records, _LAST] = start, used
            if now < 0:
                heads[column] = records
            else:
                links[now, _NEXT] = records
            tails[column] = records
            calm[column] = -1 if changes else records
            records += 1
    for column in range(width):
        counts[stages + 1] += np.sqrt(sums[column, 0] * sums[column, 0] * sums[column, 1])
    return Records(heads, spans, links, faces)


@njit(inline="always")
def _include(faces: IntArray, start: int, used: int, face: int) -> int:
    """Append a face unless it is there from `start` on; return the new end."""
    for b in range(start, used):
        if faces[b] == face:
            return used
    faces[used] = face
    return used + 1


@njit(inline="always")
def _join(faces: IntArray, links: IntArray, entry: int, start: int, used: int) -> int:
    """Add the faces from `start` to `used`, the last ones, to an entry's; return the new end."""
    a, b = links[entry, _FIRST], links[entry, _LAST]
    missing = False
    for k in range(start, used):
        found = False
        for j in range(a, b):
            found = found or faces[j] == faces[k]
        missing = missing or not found
    if not missing:
        return start
    # all together behind the others
    end = used
    for j in range(a, b):
        end = _include(faces, start, end, faces[j])
    links[entry, _FIRST], links[entry, _LAST] = start, end
    return end


@njit(cache=True, nogil=True, error_model="numpy")
def integrate_row(
    records: Records, movers: Movers, extent: float, shades: Shades, blur: Blur | None, effort: Effort, row: int,
    width: int, height: int, top: int, out: FloatArray, bound: FloatArray,
) -> int:  # fmt: skip
    """Add the mean over the shutter of what a row of the picture with margin adds to the picture.

    Parameters
    ----------
    records : Records
        Of the row.
    extent : float
        The scene's size, for ties of depth.
    width, height : int
        Of the picture without margin.
    out, bound : (n, width, 3) and (n, width) float64
        The rows from `top` on.

    Returns
    -------
    int
        How many instants of cells were looked at.
    """
    margin, peaks = shades.margin, shades.peaks
    heads, spans, links, ids = records.heads, records.spans, records.links, records.faces
    shutter, most_panels = effort.shutter, effort.most
    columns = width + 2 * margin
    widest_block = min(2 * margin + 1, width) * min(2 * margin + 1, height) * 3
    runs, sides = np.empty((64, 5)), np.empty((64, 2), np.int64)
    value, total, spread = np.empty(widest_block), np.empty(widest_block), np.empty(widest_block // 3)
    panels = Panels(
        np.empty((most_panels, 2)), np.empty((most_panels, 5, widest_block)), np.empty(most_panels),
        np.empty(most_panels), np.empty(most_panels, np.int64),
    )  # fmt: skip
    most = 0
    for column in range(columns):
        at = heads[column]
        while at >= 0:
            most = max(most, links[at, _LAST] - links[at, _FIRST])
            at = links[at, _NEXT]
    room = room_for(most + 1, movers.widest)
    looks, pool = 0, effort.ahead
    for column in range(columns):
        block = block_of(row, column, margin, height, width)
        size = block.rows * block.columns * 3
        if size == 0 or heads[column] < 0:
            continue
        n, amount, at = 0, 0, heads[column]
        while at >= 0:
            if links[at, _KIND] != _STEADY:
                n, amount = n + 1, amount + links[at, _LAST] - links[at, _FIRST]
            at = links[at, _NEXT]
        begins, lengths, speeds = np.empty(n), np.empty(n), np.empty(n)
        restless, faces, starts = np.empty(n, np.bool_), np.empty(amount, np.int64), np.empty(n + 1, np.int64)
        for c in range(size):
            total[c] = 0.0
        k, used, fast, at = 0, 0, 0.0, heads[column]
        lasts, squares = 0.0, 0.0
        starts[0] = 0
        while at >= 0:
            first, last, kind = links[at, _FIRST], links[at, _LAST], links[at, _KIND]
            length, speed = spans[at, _LENGTH], spans[at, _SPEED]
            if kind == _STEADY:
                runs, sides = look(
                    movers, ids[first:], last - first, spans[at, _BEGIN], block, shades, blur, extent, room, runs,
                    sides, value,
                )  # fmt: skip
                looks += 1
                for c in range(size):
                    total[c] += length / shutter * value[c]
            else:
                begins[k], lengths[k], speeds[k], restless[k] = spans[at, _BEGIN], length, speed, kind == _RESTLESS
                lasts, squares = lasts + length, squares + length * speed * speed
                if kind == _LOST:
                    fast += length
                for a in range(first, last):
                    faces[used] = ids[a]
                    used += 1
                k += 1
                starts[k] = used
            at = links[at, _NEXT]
        if n > 0:
            for c in range(size // 3):
                spread[c] = 0.0
            pool += effort.base + effort.share * n + effort.dense * lasts * np.sqrt(squares)
            allowed = int(max(pool, 5.0 * n))
            seen = 0
            contacts = Contacts(begins, lengths, speeds, restless, faces, starts)
            # as many contacts at a time as there is room for panels
            for begin in range(0, n, max(1, most_panels // 4)):
                end = min(n, begin + max(1, most_panels // 4))
                more, runs, sides = integrate_cell(
                    movers, contacts, begin, end, block, shades, blur, extent, effort.span, shutter,
                    effort.target * (end - begin) / n, allowed * (end - begin) // n, panels, room, runs, sides, total,
                    spread,
                )  # fmt: skip
                seen += more
            pool = max(0.0, pool - seen)
            looks += seen
        c = 0
        for i in range(block.rows):
            for j in range(block.columns):
                if n > 0:
                    peak = min(1.0, peaks[row - block.top - i, column - block.left - j])
                    bound[block.top - top + i, block.left + j] += spread[c // 3] + fast * effort.span * peak / shutter
                for channel in range(3):
                    out[block.top - top + i, block.left + j, channel] += total[c]
                    c += 1
    return looks


@allocating
def _more(values: FloatArray) -> FloatArray:
    out = np.empty((2 * len(values), values.shape[1]))
    for i in range(len(values)):
        for c in range(values.shape[1]):
            out[i, c] = values[i, c]
    return out


@allocating
def _more_whole(values: IntArray) -> IntArray:
    out = np.empty((2 * len(values), values.shape[1]), np.int64)
    for i in range(len(values)):
        for c in range(values.shape[1]):
            out[i, c] = values[i, c]
    return out
