"""The film: which samples a row still needs, and what becomes of their colours.

Two ways to develop. A sample of equal weight belongs to its pixel alone (`sums`); one that is weighted by a filter
belongs to every pixel whose filter covers it. Those splats are gathered without seams and without locks: a row of
samples adds to buffers of its own, one for each row of pixels that it reaches, and `develop_rows` adds the buffers of
neighbouring rows in the order of rows. Memory is that of a few rows, whatever the number of samples; the picture is the
same bit for bit on any number of threads.

Rows are described by the numbers [begin, end) of the samples that each of their pixels takes in this pass, so that one
kernel serves uniform sampling, pilots, and whatever adaptive sampling asks for next. Packets run through pixels: the
lanes of a packet are cut into runs, a run being consecutive samples of one pixel.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import inlined
from aliasbench.renderers.raytrace.lanes import BLUE, GREEN, LANES, LOD, PX, PY, RED, SIGN
from aliasbench.renderers.raytrace.positions import (
    ALL,
    BATCH,
    PIXEL,
    SHORT,
    START,
    KeyArray,
    fill_even,
    fill_mixed,
    fill_run,
)
from aliasbench.renderers.raytrace.profiles import add_taps, weigh_lanes
from aliasbench.renderers.sampling.hashing import combine
from aliasbench.renderers.sampling.patterns import (
    DIM_X,
    RANDOM,
    SOBOL,
    Pattern,
    pixel_position,
    row_count,
    stream_keys,
)
from aliasbench.renderers.sampling.warps import IDENTITY, Warp, warp_lanes
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]

# Columns of a run: pixel (counted from the film's first column), sample, first lane, lanes.
RUN_PIXEL, RUN_INDEX, RUN_LANE, RUN_LANES = 0, 1, 2, 3

_SPECK = 1e-12  # added to the weights of a pixel's own samples, which may all lie in the corners that a cone leaves out


class Film(NamedTuple):
    """Some rows of samples and what they add up to.

    Attributes
    ----------
    row, column : int
        Where the film's first row and column lie in the image; they may lie outside of it.
    begins, ends : (rows, width) int32
        The samples [begin, end) that each pixel takes.
    each : int
        A part of 16: every pixel takes its first so many samples, and nothing has been summed yet. Else 0.
    shifts, sums, squares : (rows, width, 3) float64
        The first sample of each pixel, and sums of the differences from it and of their squares: means and variances
        of any range of values keep their digits. `squares` is empty where variances are not wanted (any more), and
        `shifts` too where only sums are; then no difference is taken. All are empty where samples are splatted.
    scales : (rows, width) float64
        What the samples of a pixel are weighted with beside the filter; empty for `sums`.
    splats : (rows, 2 margin + 1, image width, 4) float64
        Weighted colours, and weights, that each row adds to the pixels from `margin` rows above it on.
    margin : int
    radius, spread : float
        Of the filter, and the side of the square that samples are spread over, in pixels.
    least : float
        The least value of a profile: 0, or minus infinity of filters with lobes.
    radial : bool
        The filter is a cone; else it is the product of a profile along x and y.
    profile : (pieces, 2 margin + 1, terms) float64
        See `profiles.profile_polynomials`.
    warp : Warp
        Of weighted distributions.
    """

    row: int
    column: int
    begins: NDArray[np.int32]
    ends: NDArray[np.int32]
    each: int
    shifts: FloatArray
    sums: FloatArray
    squares: FloatArray
    scales: FloatArray
    splats: FloatArray
    margin: int
    radius: float
    spread: float
    least: float
    radial: bool
    profile: FloatArray
    warp: Warp


@inlined
def next_runs(film: Film, r: int, cursor: IntArray, runs: IntArray) -> tuple[int, int]:
    """Return how many lanes and how many runs the next packet of a row has, 0 and 0 at its end; write `runs`.

    `cursor` (2,) holds pixel and sample to go on from, zeros at the start of a row.
    """
    width = film.begins.shape[1]
    k, index = cursor[0], cursor[1]
    lane, count = 0, 0
    while lane < LANES and k < width:
        index = max(index, np.int64(film.begins[r, k]))
        left = film.ends[r, k] - index
        if left > 0:
            run = min(LANES - lane, left)
            runs[count, RUN_PIXEL], runs[count, RUN_INDEX] = k, index
            runs[count, RUN_LANE], runs[count, RUN_LANES] = lane, run
            lane += run
            count += 1
            index += run
            left -= run
        if left <= 0:
            k, index = k + 1, 0
    cursor[0], cursor[1] = k, index
    return lane, count


@inlined
def is_even(pattern: Pattern, film: Film) -> bool:
    """Return whether `place_even` and `add_even` can serve, which do the same as the functions for runs, but faster."""
    return film.each > 0 and film.warp.code == IDENTITY and pattern.sampler == SOBOL and pattern.samples <= SHORT


@inlined
def place_even(film: Film, keys: KeyArray, r: int, first: int, room: FloatArray, scratch: FloatArray) -> None:
    """Write the image positions of a packet from a row's sample number `first` on, every pixel taking `film.each`.

    `room` is from `start_even`.
    """
    y = film.row + r + 0.5
    fill_even(keys, film.each, first // film.each, film.begins.shape[1] - 1, film.column + 0.5, room, scratch)
    for i in range(LANES):
        scratch[PX + i] = film.spread * (scratch[PX + i] - 0.5) + scratch[LOD + i]
    for i in range(LANES):
        scratch[PY + i] = film.spread * (scratch[PY + i] - 0.5) + y


@inlined
def add_even(film: Film, r: int, first: int, lanes: int, scratch: FloatArray) -> None:
    """Write the sums of a packet's pixels to the film, every pixel taking `film.each` samples."""
    each = film.each
    if each == 4 and lanes == LANES:
        # loops of constant length, as in `fill_positions`
        for p in range(LANES // 4):
            _add_first(film, r, first // 4 + p, 4 * p, START + 4, scratch)
        return
    for p in range(lanes // each):
        _add_first(film, r, first // each + p, each * p, each, scratch)


@inlined
def _add_first(film: Film, r: int, k: int, lane: int, length: int, scratch: FloatArray) -> None:
    """Write what `_sum_run` adds, of a pixel that it has added nothing to."""
    for c in range(3):
        at = RED + c * LANES + lane
        shift = scratch[at]
        total, square = 0.0, 0.0
        for i in range(length):
            d = scratch[at + i] - shift
            total += d
            square += d * d
        film.shifts[r, k, c], film.sums[r, k, c], film.squares[r, k, c] = shift, total, square


@inlined
def run_address(pattern: Pattern, film: Film, keys: KeyArray, r: int, run: IntArray) -> tuple[np.uint64, int, int]:
    """Return the key, the size of the set, and the number in it, of a run's first sample.

    Of samplers without a sequence that any number of samples is well spread in, every pass is a whole set of its own.
    """
    k, index = run[RUN_PIXEL], run[RUN_INDEX]
    key = keys[PIXEL, k]
    if not pattern.progressive or pattern.sampler == RANDOM or pattern.sampler >= SOBOL:
        return key, pattern.samples, index
    begin = np.int64(film.begins[r, k])
    if begin > 0:
        key = combine(key, BATCH + begin)
    return key, film.ends[r, k] - begin, index - begin


@inlined
def place_runs(
    pattern: Pattern, film: Film, keys: KeyArray, r: int, runs: IntArray, count: int, orders: NDArray[np.int32],
    scratch: FloatArray,
) -> None:  # fmt: skip
    """Write the image positions of a packet's samples, and the signs of their weights."""
    row = film.row + r
    is_plain = film.warp.code == IDENTITY and film.spread == 1.0
    is_mixed = count > 1 and pattern.sampler == SOBOL and pattern.samples <= SHORT
    if is_mixed:
        fill_mixed(pattern, keys, runs, count, scratch)
    for n in range(0 if is_mixed else count):
        run = runs[n]
        k, lane, length = run[RUN_PIXEL], run[RUN_LANE], run[RUN_LANES]
        left, top = (float(film.column + k), float(row)) if is_plain else (0.0, 0.0)
        key, size, index = run_address(pattern, film, keys, r, run)
        if size == pattern.samples and key == keys[PIXEL, k]:
            if length == LANES:
                fill_run(pattern, keys, k, index, START, ALL, left, top, orders, scratch)
            else:
                fill_run(pattern, keys, k, index, lane, length, left, top, orders, scratch)
        else:
            first, second = stream_keys(pattern, key, film.column + k, row, DIM_X)
            rows = row_count(size)
            for i in range(length):
                u, v = pixel_position(pattern, size, rows, index + i, first, second)
                scratch[PX + lane + i], scratch[PY + lane + i] = left + u, top + v
    if is_plain and not is_mixed:
        return
    if film.warp.code != IDENTITY:
        warp_lanes(film.warp, scratch, PX, PY, SIGN, LANES)
    else:
        for i in range(2 * LANES):
            scratch[PX + i] = film.spread * (scratch[PX + i] - 0.5)
    for n in range(count):
        run = runs[n]
        x = film.column + run[RUN_PIXEL] + 0.5
        for i in range(run[RUN_LANE], run[RUN_LANE] + run[RUN_LANES]):
            scratch[PX + i] += x
    for i in range(LANES):
        scratch[PY + i] += row + 0.5


@inlined
def add_runs(
    film: Film, r: int, runs: IntArray, count: int, weights: FloatArray, taps: FloatArray, room: FloatArray,
    scratch: FloatArray,
) -> None:  # fmt: skip
    """Add a packet's colours to the film.

    `weights` (2 margin + 1, 2 LANES), `taps` (2 margin + 1, 2 margin + 1, 4) and `room` (4, 2 LANES) are room for
    splats; `taps` keeps a pixel from one packet to the next.
    """
    if film.warp.code != IDENTITY:
        for i in range(LANES):
            weight = film.warp.gain * scratch[SIGN + i]
            scratch[RED + i] *= weight
            scratch[GREEN + i] *= weight
            scratch[BLUE + i] *= weight
    if film.splats.shape[0] == 0:
        for n in range(count):
            _sum_run(film, r, runs[n], scratch)
        return
    if not film.radial:
        _weigh_runs(film, r, runs, count, weights, room, scratch)
    for n in range(count):
        run = runs[n]
        k, index = run[RUN_PIXEL], run[RUN_INDEX]
        if index == film.begins[r, k]:
            _clear(taps)
        if film.radial:
            _tap_radial(film, r, run, taps, scratch)
        elif run[RUN_LANES] == LANES:
            add_taps(film.margin, weights, scratch, RED, taps, room)
        else:
            _tap_lanes(film.margin, run[RUN_LANE], run[RUN_LANES], weights, taps, scratch)
        if index + run[RUN_LANES] == film.ends[r, k]:
            _splat_pixel(film, r, k, taps)


@inlined
def _clear(taps: FloatArray) -> None:
    values = taps.reshape(taps.size)
    for k in range(len(values)):
        values[k] = 0.0


@inlined
def _sum_run(film: Film, r: int, run: IntArray, scratch: FloatArray) -> None:
    k, lane, length = run[RUN_PIXEL], run[RUN_LANE], run[RUN_LANES]
    if film.shifts.shape[0] == 0:
        for c in range(3):
            at = RED + c * LANES
            total = film.sums[r, k, c]
            if length == LANES:
                # The order of `pixel_sums.add_samples`, so that both ways give the same bits.
                for i in range(4):
                    total += (scratch[at + i] + scratch[at + i + 4]) + (scratch[at + i + 8] + scratch[at + i + 12])
            else:
                for i in range(lane, lane + length):
                    total += scratch[at + i]
            film.sums[r, k, c] = total
        return
    for c in range(3):
        at = RED + c * LANES
        if run[RUN_INDEX] == 0:
            film.shifts[r, k, c] = scratch[at + lane]
        shift = film.shifts[r, k, c]
        total, square = 0.0, 0.0
        if length == LANES and film.squares.shape[0] == 0:
            for i in range(4):
                d0, d1 = scratch[at + i] - shift, scratch[at + i + 4] - shift
                d2, d3 = scratch[at + i + 8] - shift, scratch[at + i + 12] - shift
                total += (d0 + d1) + (d2 + d3)
        elif length == LANES:
            for i in range(4):
                d0, d1 = scratch[at + i] - shift, scratch[at + i + 4] - shift
                d2, d3 = scratch[at + i + 8] - shift, scratch[at + i + 12] - shift
                total += (d0 + d1) + (d2 + d3)
                square += (d0 * d0 + d1 * d1) + (d2 * d2 + d3 * d3)
        else:
            for i in range(lane, lane + length):
                d = scratch[at + i] - shift
                total += d
                square += d * d
        film.sums[r, k, c] += total
        if film.squares.shape[0] > 0:
            film.squares[r, k, c] += square


@inlined
def _weigh_runs(
    film: Film, r: int, runs: IntArray, count: int, weights: FloatArray, room: FloatArray, scratch: FloatArray
) -> None:
    """Write the profile at every lane's distance from each column, and from each row, that it reaches."""
    y = film.row + r + 0.5
    for n in range(count):
        run = runs[n]
        x = film.column + run[RUN_PIXEL] + 0.5
        for i in range(run[RUN_LANE], run[RUN_LANE] + run[RUN_LANES]):
            scratch[PX + i] -= x
            scratch[PY + i] -= y
    weigh_lanes(film.profile, 0.5 * film.spread, film.radius, film.least, scratch, PX, weights, room)


@inlined
def _tap_lanes(margin: int, lane: int, length: int, weights: FloatArray, taps: FloatArray, scratch: FloatArray) -> None:
    for i in range(lane, lane + length):
        red, green, blue = scratch[RED + i], scratch[GREEN + i], scratch[BLUE + i]
        for j in range(2 * margin + 1):
            for k in range(2 * margin + 1):
                w = weights[j, LANES + i] * weights[k, i]
                taps[j, k, 0] += w * red
                taps[j, k, 1] += w * green
                taps[j, k, 2] += w * blue
                taps[j, k, 3] += w


@njit(cache=True, error_model="numpy", _nrt=False)
def _tap_radial(film: Film, r: int, run: IntArray, taps: FloatArray, scratch: FloatArray) -> None:
    """Add a run's samples to their pixel's taps under the cone."""
    x, y = film.column + run[RUN_PIXEL] + 0.5, film.row + r + 0.5
    slope, peak = 1.0 / film.radius, 3.0 / (np.pi * film.radius * film.radius)
    for i in range(run[RUN_LANE], run[RUN_LANE] + run[RUN_LANES]):
        dx, dy = scratch[PX + i] - x, scratch[PY + i] - y
        red, green, blue = scratch[RED + i], scratch[GREEN + i], scratch[BLUE + i]
        for j in range(2 * film.margin + 1):
            down = dy - (j - film.margin)
            for k in range(2 * film.margin + 1):
                across = dx - (k - film.margin)
                w = peak * max(0.0, 1.0 - slope * np.sqrt(across * across + down * down))
                if j == film.margin and k == film.margin:
                    w += _SPECK * peak
                taps[j, k, 0] += w * red
                taps[j, k, 1] += w * green
                taps[j, k, 2] += w * blue
                taps[j, k, 3] += w


@inlined
def _splat_pixel(film: Film, r: int, k: int, taps: FloatArray) -> None:
    """Add a pixel's taps to the row's buffers; what falls outside of the image is dropped."""
    scale, width = film.scales[r, k], film.splats.shape[2]
    left = film.column + k - film.margin
    for i in range(2 * film.margin + 1):
        if 0 <= left + i < width:
            for j in range(2 * film.margin + 1):
                for c in range(4):
                    film.splats[r, j, left + i, c] += scale * taps[j, i, c]


@njit(nogil=True, cache=True, error_model="numpy", _nrt=False)
def develop_rows(splats: FloatArray, first: int, window: FloatArray, top: int) -> None:
    """Add rows of splats, the first that of image row `first`, to a window (rows, width, 4) that starts at `top`."""
    margin = splats.shape[1] // 2
    for r in range(splats.shape[0]):
        for j in range(splats.shape[1]):
            row = first + r + j - margin - top
            if 0 <= row < window.shape[0]:
                for k in range(splats.shape[2]):
                    for c in range(4):
                        window[row, k, c] += splats[r, j, k, c]
