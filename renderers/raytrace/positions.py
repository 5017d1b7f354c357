"""The places of a packet's samples, 16 at a time: `sampling.patterns` as the compiler vectorises it.

Samples of a row are numbered pixel after pixel, and every 16 of them are one packet. With 16 samples a pixel (or a
multiple) a packet is of one pixel, which Embree traces three times faster than 16 pixels; with fewer it holds whole
neighbours, and any count wastes lanes only at the end of a row. What depends on a pixel alone (keys, the orders of
multijittered rows and columns) is computed once for it.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import called, inlined
from aliasbench.renderers.raytrace.lanes import LANES, LOD, PX, PY, TIME, U, V
from aliasbench.renderers.sampling.bits import and32
from aliasbench.renderers.sampling.hashing import SHARED, combine, permute_power, unit
from aliasbench.renderers.sampling.patterns import (
    AXIS_0,
    AXIS_1,
    AXIS_2,
    BLUENOISE,
    CENTER,
    DIM_TIME,
    DIM_X,
    GRID,
    MULTIJITTERED,
    RANDOM,
    SOBOL,
    Pattern,
    column_order,
    line_order,
    order_mask,
    own_order,
    pair_position,
    plane_order,
    row_count,
    row_order,
    sequence_point,
    stream_keys,
)
from aliasbench.renderers.sampling.rare import compiled_if_rare
from aliasbench.renderers.sampling.sobol import TABLE_BITS, scrambled_unit, shuffled
from aliasbench.scenes.model import FloatArray

KeyArray = NDArray[np.uint64]

# Over every sample number (2^24 at most): tells the compiler that none is negative, which spares a check for each lane.
INDEX_MASK = 0x1FFFFFF
SHORT = 1 << TABLE_BITS
# A whole packet, in calls (see `patterns` on such integers).
START: Any = np.int64(0)
ALL: Any = np.int64(LANES)
BATCH = 0x5A17  # what the keys of a pixel's later samples are derived with

# Rows of the keys of a row's pixels: of the pixel, of the streams of x and y, and what columns start from.
PIXEL, FIRST, SECOND, COLUMN, KEY_ROWS = 0, 1, 2, 3, 4


@njit(cache=True, error_model="numpy", _nrt=False)
def fill_columns(pattern: Pattern, first_column: int, keys: KeyArray) -> None:
    """Write what the keys of a column's pixels start from, once for a picture: `keys` (KEY_ROWS, width), last row."""
    for k in range(keys.shape[1]):
        keys[COLUMN, k] = combine(pattern.start, SHARED if pattern.shared else first_column + k)


@njit(cache=True, error_model="numpy", _nrt=False)
def fill_keys(pattern: Pattern, first_column: int, row: int, keys: KeyArray) -> None:
    """Write the keys of a row's pixels: `keys` (KEY_ROWS, width) gets those of the pattern and of its x and y.

    They are a chain of hashes, which costs less done for many pixels at once than on the way to each packet.
    `hashing.pixel_key` and `patterns.stream_keys` are the definition.
    """
    value = SHARED if pattern.shared else row
    for k in range(keys.shape[1]):
        keys[PIXEL, k] = combine(keys[COLUMN, k], value)
    if pattern.sampler == BLUENOISE:
        for k in range(keys.shape[1]):
            keys[FIRST, k], keys[SECOND, k] = stream_keys(pattern, keys[PIXEL, k], first_column + k, row, DIM_X)
        return
    for k in range(keys.shape[1]):
        keys[FIRST, k], keys[SECOND, k] = combine(keys[PIXEL, k], DIM_X), combine(keys[PIXEL, k], DIM_X + 1)


def orders_size(pattern: Pattern) -> int:
    """Return how many columns the array of `_fill_orders` needs."""
    return max(row_count(pattern.samples), pattern.samples // row_count(pattern.samples) + 1)


@called
def _fill_orders(pattern: Pattern, first: int, second: int, orders: NDArray[np.int32]) -> None:
    """Write one pixel's orders of multijittered rows, and of columns in rows of the two lengths."""
    rows = row_count(pattern.samples)
    shortest = pattern.samples // rows
    for k in range(rows):
        orders[0, k] = row_order(k, rows, first)
    for longer in range(2 if shortest * rows < pattern.samples else 1):
        for k in range(shortest + longer):
            orders[1 + longer, k] = column_order(k, shortest + longer, second)


@compiled_if_rare(None)
@called
def _fill_multijittered(
    pattern: Pattern, first: int, second: int, index: int, lane: int, run: int, left: float, top: float,
    orders: NDArray[np.int32], scratch: FloatArray,
) -> None:  # fmt: skip
    """Do what `fill_run` does."""
    if index == 0:
        _fill_orders(pattern, first, second, orders)
    rows = row_count(pattern.samples)
    shortest = pattern.samples // rows
    for k in range(run):
        i = (index + k) & INDEX_MASK
        column, longer = pattern.places[1, i], pattern.places[2, i]
        u = (orders[0, pattern.places[0, i]] + unit(first, i)) / rows
        v = (orders[1 + longer, column] + unit(second, i)) / (shortest + longer)
        scratch[PX + lane + k] = left + (pattern.cells[0, i] + pattern.cells[2, i] * u)
        scratch[PY + lane + k] = top + (pattern.cells[1, i] + pattern.cells[3, i] * v)


@called
def _fill_long(
    pattern: Pattern, first: int, second: int, index: int, lane: int, run: int, left: float, top: float,
    scratch: FloatArray,
) -> None:  # fmt: skip
    """Do what `fill_run` does, for any part of any sequence."""
    for k in range(run):
        scratch[PX + lane + k] = left + sequence_point(pattern, AXIS_0, index + k, first)
    for k in range(run):
        scratch[PY + lane + k] = top + sequence_point(pattern, AXIS_1, index + k, second)


@inlined
def fill_run(
    pattern: Pattern, keys: KeyArray, place: int, index: int, lane: int, run: int, left: float, top: float,
    orders: NDArray[np.int32], scratch: FloatArray,
) -> None:  # fmt: skip
    """Write image positions of `run` samples of one whole set from sample `index` on, in lanes from `lane` on.

    The pixel is the one whose keys are at `place`; `left` and `top` are where it starts in the image. `orders` (3, n)
    keeps its orders from one packet to the next.
    """
    sampler = pattern.sampler
    if sampler in (CENTER, GRID):
        for k in range(run):
            i = (index + k) & INDEX_MASK
            scratch[PX + lane + k] = left + pattern.cells[0, i]
            scratch[PY + lane + k] = top + pattern.cells[1, i]
        return
    first, second = keys[FIRST, place], keys[SECOND, place]
    if sampler == MULTIJITTERED:
        _fill_multijittered(pattern, first, second, index, lane, run, left, top, orders, scratch)
        return
    if sampler == BLUENOISE or (sampler == SOBOL and index + run > SHORT):
        _fill_long(pattern, first, second, index, lane, run, left, top, scratch)
        return
    if sampler == SOBOL:
        key_x, key_y = np.uint32(first), np.uint32(second)
        for k in range(run):
            i = (index + k) & INDEX_MASK
            scratch[PX + lane + k] = left + scrambled_unit(pattern.tables[0, 0, i], key_x)
        for k in range(run):
            i = (index + k) & INDEX_MASK
            scratch[PY + lane + k] = top + scrambled_unit(pattern.tables[0, 1, i], key_y)
        return
    for k in range(run):
        i = (index + k) & INDEX_MASK
        scratch[PX + lane + k] = left + (pattern.cells[0, i] + pattern.cells[2, i] * unit(first, i))
    for k in range(run):
        i = (index + k) & INDEX_MASK
        scratch[PY + lane + k] = top + (pattern.cells[1, i] + pattern.cells[3, i] * unit(second, i))


@inlined
def fill_mixed(pattern: Pattern, keys: KeyArray, runs: NDArray[np.int64], count: int, scratch: FloatArray) -> None:
    """Write places in their pixels of several pixels' samples at once, of Sobol's sequence up to number SHORT.

    `runs` (count, 4) are rows of pixel, sample, first lane and lanes (`film`).
    """
    # keys and numbers pass through float64 lanes, which hold them exactly
    for n in range(count):
        k, index, lane, length = runs[n, 0], runs[n, 1], runs[n, 2], runs[n, 3]
        key_x, key_y = float(np.uint32(keys[FIRST, k])), float(np.uint32(keys[SECOND, k]))
        for i in range(length):
            scratch[U + lane + i], scratch[V + lane + i], scratch[LOD + lane + i] = key_x, key_y, float(index + i)
    for i in range(LANES):
        word = pattern.tables[0, 0, int(scratch[LOD + i]) & (SHORT - 1)]
        scratch[PX + i] = scrambled_unit(word, np.uint32(scratch[U + i]))
    for i in range(LANES):
        word = pattern.tables[0, 1, int(scratch[LOD + i]) & (SHORT - 1)]
        scratch[PY + i] = scrambled_unit(word, np.uint32(scratch[V + i]))


@called
def start_even(pattern: Pattern, each: int, room: FloatArray) -> None:
    """Write to `room` (2, LANES or more) what all packets of `fill_even` share: points before they are scrambled."""
    for dimension in range(2):
        for i in range(LANES):
            room[dimension, i] = float(pattern.tables[0, dimension, i & (each - 1)])


@inlined
def fill_even(
    keys: KeyArray, each: int, column: int, last: int, left: float, room: FloatArray, scratch: FloatArray
) -> None:
    """Do what `fill_mixed` does where every pixel from `column` up to `last` takes its first `each` samples.

    `each` is a part of 16, and `room` is from `start_even`. Writes the columns plus `left` to the row LOD, too.
    """
    if each == 4:
        # loops of constant length, as in `fill_positions`
        _spread_keys(keys, START + 4, column, last, left, scratch)
    else:
        _spread_keys(keys, each, column, last, left, scratch)
    for i in range(LANES):
        scratch[PX + i] = scrambled_unit(np.uint32(np.int64(room[0, i])), np.uint32(np.int64(scratch[U + i])))
    for i in range(LANES):
        scratch[PY + i] = scrambled_unit(np.uint32(np.int64(room[1, i])), np.uint32(np.int64(scratch[V + i])))


@inlined
def _spread_keys(keys: KeyArray, each: int, column: int, last: int, left: float, scratch: FloatArray) -> None:
    for n in range(LANES // each):
        k = min(column + n, last)
        key_x, key_y, x = float(np.uint32(keys[FIRST, k])), float(np.uint32(keys[SECOND, k])), left + (column + n)
        for i in range(n * each, (n + 1) * each):
            scratch[U + i], scratch[V + i], scratch[LOD + i] = key_x, key_y, x


@inlined
def fill_positions(
    pattern: Pattern, keys: KeyArray, row: int, first: int, lanes: int, orders: NDArray[np.int32], scratch: FloatArray
) -> None:
    """Write the image positions of `lanes` samples of a row from its sample number `first` on."""
    column = first // pattern.samples
    index = (first - column * pattern.samples) & INDEX_MASK
    if pattern.samples - index >= LANES:
        # A loop of constant length is what the compiler vectorises best, and this is the common case.
        fill_run(pattern, keys, column, index, START, ALL, float(column), float(row), orders, scratch)
        return
    lane = START
    while lane < lanes:
        run = min(lanes - lane, pattern.samples - index)
        fill_run(pattern, keys, column, index, lane, run, float(column), float(row), orders, scratch)
        lane += run
        column, index = column + 1, 0


@inlined
def _fill_numbers(
    pattern: Pattern, count: int, index: int, lane: int, run: int, order: int, numbers: NDArray[np.int64]
) -> None:
    """Write which points of another dimension's set belong to `run` samples from `index` on; see `own_order`."""
    sampler = pattern.sampler
    is_sequence = sampler == SOBOL or (sampler == BLUENOISE and pattern.progressive)
    if is_sequence:
        key, mask = np.uint32(order), np.uint32(order_mask(count))
        for k in range(run):
            numbers[lane + k] = np.int64(and32(shuffled((index + k) & INDEX_MASK, key), mask))
        return
    if sampler not in (RANDOM, BLUENOISE) and count & (count - 1) == 0:
        mask, key = np.uint32(count - 1), np.uint32(order)
        for k in range(run):
            numbers[lane + k] = np.int64(permute_power((index + k) & INDEX_MASK, mask, key))
        return
    for k in range(run):
        numbers[lane + k] = own_order(pattern, count, index + k, order)


@njit(cache=True, error_model="numpy", _nrt=False)
def fill_line(
    pattern: Pattern, count: int, key: int, column: int, row: int, dimension: int, index: int, lane: int, run: int,
    numbers: NDArray[np.int64], scratch: FloatArray, at: int,
) -> None:  # fmt: skip
    """Write at `at` the places in one dimension of `run` samples of a pixel, of a set of `count`; see `line_position`.

    `key` is the pixel's, `numbers` (LANES,) room for the points' numbers.
    """
    stream, _ = stream_keys(pattern, key, column, row, dimension)
    order = line_order(pattern, key, column, row, dimension)
    if run == LANES:
        # loops of constant length, as in `fill_positions`
        _fill_line(pattern, count, stream, order, dimension, index, START, ALL, numbers, scratch, at)
    else:
        _fill_line(pattern, count, stream, order, dimension, index, lane, run, numbers, scratch, at)


@inlined
def _fill_line(
    pattern: Pattern, count: int, stream: int, order: int, dimension: int, index: int, lane: int, run: int,
    numbers: NDArray[np.int64], scratch: FloatArray, at: int,
) -> None:  # fmt: skip
    sampler = pattern.sampler
    if sampler == RANDOM:
        for k in range(run):
            scratch[at + lane + k] = unit(stream, (index + k) & INDEX_MASK)
        return
    if sampler == SOBOL and dimension == DIM_TIME:
        for k in range(run):
            scratch[at + lane + k] = sequence_point(pattern, AXIS_2, index + k, stream)
        return
    _fill_numbers(pattern, count, index, lane, run, order, numbers)
    if sampler >= SOBOL:
        for k in range(run):
            scratch[at + lane + k] = sequence_point(pattern, AXIS_0, numbers[lane + k], stream)
    elif sampler in (CENTER, GRID):
        for k in range(run):
            scratch[at + lane + k] = (numbers[lane + k] + 0.5) / count
    else:
        for k in range(run):
            scratch[at + lane + k] = (numbers[lane + k] + unit(stream, (index + k) & INDEX_MASK)) / count


@njit(cache=True, error_model="numpy", _nrt=False)
def fill_plane(
    pattern: Pattern, count: int, key: int, column: int, row: int, dimension: int, index: int, step: int, lane: int,
    run: int, numbers: NDArray[np.int64], scratch: FloatArray, at_u: int, at_v: int,
) -> None:  # fmt: skip
    """Write at `at_u`, `at_v` the points in a pair of dimensions of `run` samples, of a set of `count`.

    The samples are index, index + step, ...; see `plane_position`, and `fill_line` for the other parameters.
    """
    first, second = stream_keys(pattern, key, column, row, dimension)
    order = plane_order(pattern, key, column, row, dimension)
    if run == LANES and step == 1:
        # loops of constant length, as in `fill_positions`
        _fill_plane(pattern, count, first, second, order, index, step, START, ALL, numbers, scratch, at_u, at_v)
    else:
        _fill_plane(pattern, count, first, second, order, index, step, lane, run, numbers, scratch, at_u, at_v)


@inlined
def _fill_plane(
    pattern: Pattern, count: int, first: int, second: int, order: int, index: int, step: int, lane: int, run: int,
    numbers: NDArray[np.int64], scratch: FloatArray, at_u: int, at_v: int,
) -> None:  # fmt: skip
    if step == 1:
        _fill_numbers(pattern, count, index, lane, run, order, numbers)
    else:
        for k in range(run):
            numbers[lane + k] = own_order(pattern, count, index + k * step, order)
    if pattern.sampler >= SOBOL:
        for k in range(run):
            scratch[at_u + lane + k] = sequence_point(pattern, AXIS_0, numbers[lane + k], first)
        for k in range(run):
            scratch[at_v + lane + k] = sequence_point(pattern, AXIS_1, numbers[lane + k], second)
        return
    rows = row_count(count)
    for k in range(run):
        u, v = pair_position(pattern, count, rows, numbers[lane + k], index + k * step, first, second)
        scratch[at_u + lane + k], scratch[at_v + lane + k] = u, v


@njit(cache=True, error_model="numpy", _nrt=False)
def fill_times(
    pattern: Pattern, keys: KeyArray, row: int, first: int, lanes: int, numbers: NDArray[np.int64], scratch: FloatArray
) -> None:
    """Write the shutter positions of `lanes` samples of a row from its sample number `first` on."""
    count = pattern.samples
    column, index = first // count, first % count
    lane = START
    while lane < lanes:
        run = min(lanes - lane, count - index)
        key = keys[PIXEL, column]
        fill_line(pattern, count, key, column, row, DIM_TIME, index, lane, run, numbers, scratch, np.int64(TIME))
        lane += run
        column, index = column + 1, 0
