"""Levels the tiles of `bluenoise`: `python -m aliasbench.renderers.sampling.level_bluenoise` rewrites its data file.

`make_bluenoise` leaves the tile's mean to chance where edges do not tell, and all seeds of the sampler have that mean.
Here more cold sweeps are made under the same energy, with what counts of points lack of even ones on top: of each
sample of a set by itself, in the 8 x 8 cells of every pair of dimensions and in 64 parts of every dimension. Cells that
the tile's orientations exchange count as one. The weight of the counts grows until they are even: exactly or to a point
or two with few samples, and to 3 % with the most, where one key moves many points.

The same machine and libraries give the same file from what `make_bluenoise` writes.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.sampling.bluenoise import (
    DATA,
    FIELDS,
    LEVELS,
    SIDE,
    WORDS,
    fill_pair,
    fill_words,
    from_planes,
    to_planes,
)
from aliasbench.renderers.sampling.hashing import combine, unit
from aliasbench.renderers.sampling.make_bluenoise import (
    COLD,
    MASKS,
    PLANS,
    REACH,
    Plan,
    Single,
    errors,
    make_series,
    own_energy,
    phase_table,
    spread,
    start,
)
from aliasbench.renderers.sampling.sobol import WordArray, sobol_tables
from aliasbench.scenes.model import FloatArray

Counts = NDArray[np.int64]

CELLS, FINE = 8, 8  # cells of a coordinate, and parts of each
# Slots of classes of cells: of (x, y), (u, v), of (x, u) with (y, v), and of (x, v) with (y, u); then of parts of the
# coordinates of the pixel and of the second pair.
PLACES, POINTS, ALIKE, ACROSS, PLACE_LINES, POINT_LINES, SLOTS = 0, 16, 32, 64, 80, 112, 144
KINDS = 10  # slots of a sample
RISE, MOST_SWEEPS = 500, 700  # sweeps in which the weight grows, and all at most
LIGHT, HEAVY = 1e-5, 0.1  # weights of a squared count, relative to what a random change costs
_HOPELESS = 60.0  # what no change of a cold tile's energy makes up for, in temperatures


@njit(inline="always", cache=True)
def _folded(a: int, b: int) -> int:
    """Return the class, 0 to 15, of a cell under mirrors of each coordinate."""
    return min(a, CELLS - 1 - a) * 4 + min(b, CELLS - 1 - b)


@njit(inline="always", cache=True)
def _sorted(a: int, b: int) -> int:
    """Return the class, of 0 to 15, of a cell under mirrors and the swap."""
    p, q = min(a, CELLS - 1 - a), min(b, CELLS - 1 - b)
    return min(p, q) * 4 + max(p, q)


@njit(inline="always", cache=True)
def _turned(a: int, b: int) -> int:
    """Return the class, 0 to 31, of a cell under the mirror of both coordinates at once."""
    return (a * CELLS + b) if 2 * a < CELLS else (CELLS - 1 - a) * CELLS + CELLS - 1 - b


@njit(cache=True)
def fill_slots(parts: Counts, out: Counts) -> None:
    """Write the slots in which a sample counts to `out`, (KINDS,), given the parts that x, y, u and v are in."""
    x, y, u, v = parts[0] // FINE, parts[1] // FINE, parts[2] // FINE, parts[3] // FINE
    out[0], out[1] = PLACES + _sorted(x, y), POINTS + _sorted(u, v)
    out[2], out[3] = ALIKE + _turned(x, u), ALIKE + _turned(y, v)
    out[4], out[5] = ACROSS + _folded(x, v), ACROSS + _folded(y, u)
    for k in range(4):
        line = POINT_LINES if k > 1 else PLACE_LINES
        out[6 + k] = line + min(parts[k], CELLS * FINE - 1 - parts[k])


@njit(cache=True)
def _point_slots(points: FloatArray, out: Counts) -> None:
    """Write the slots of a pixel's samples to `out`, (count, KINDS), given the points of both pairs, (2, count, 2)."""
    parts = np.empty(4, np.int64)
    for s in range(out.shape[0]):
        for k in range(4):
            parts[k] = int(points[k // 2, s, k % 2] * (CELLS * FINE))
        fill_slots(parts, out[s])


def even_counts() -> Counts:
    """Return how many of a tile's points belong in each slot, (SLOTS,)."""
    out, slots = np.zeros(SLOTS, np.int64), np.zeros(KINDS, np.int64)
    share = SIDE**2 // CELLS**2
    for a, b in np.ndindex(CELLS, CELLS):
        fill_slots(FINE * np.array([a, b, a, b]), slots)
        out[slots[:2]] += share
        fill_slots(FINE * np.array([a, a, b, b]), slots)
        np.add.at(out, slots[2:6], share)
    out[PLACE_LINES:] = 4 * SIDE**2 // (CELLS * FINE)
    return out


@njit(cache=True)
def tile_counts(tables: WordArray, fields: NDArray[np.int64], count: int) -> tuple[Counts, Counts]:
    """Return all slots of a tile's samples, (SIDE^2, count, KINDS), and the counts in them, (count, SLOTS)."""
    slots, counts = np.zeros((len(fields), count, KINDS), np.int64), np.zeros((count, SLOTS), np.int64)
    words, points = np.empty(WORDS, np.uint64), np.empty((2, count, 2))
    for pixel in range(len(fields)):
        fill_words(fields[pixel], words)
        fill_pair(tables, words, count, False, 0, 0, 0, points[0])
        fill_pair(tables, words, count, True, 0, 0, 0, points[1])
        _point_slots(points, slots[pixel])
        for s in range(count):
            for k in range(KINDS):
                counts[s, slots[pixel, s, k]] += 1
    return slots, counts


@njit(cache=True)
def _move(old: Counts, new: Counts, excess: Counts) -> int:
    """Move a pixel's samples from slots to others, and return the change of the sum of the squared excess."""
    change = 0
    for s in range(old.shape[0]):
        for k in range(KINDS):
            a, b = old[s, k], new[s, k]
            if a != b:
                change += 2 * (excess[s, b] - excess[s, a]) + 2
                excess[s, a] -= 1
                excess[s, b] += 1
    return change


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _sweep(
    tables: WordArray, fields: NDArray[np.int64], free: NDArray[np.int64], masks: NDArray[np.int64], count: int,
    direction: Single, scale: Single, mean: Single, turn: Single, kernel: Single, even: Single, keep: float,
    heat: float, weight: float, key: int, E: Single, h: Single, slots: Counts, excess: Counts,
) -> None:  # fmt: skip
    """As `make_bluenoise` does it, with a weight of squared excess counts, half of the times by few bits of a field."""
    terms = len(scale)
    new, total = np.empty((2, terms), np.float32), np.zeros((2, terms), np.float32)
    points, moved = np.empty((2, count, 2)), np.empty((count, KINDS), np.int64)
    trial, words = np.empty(FIELDS, np.int64), np.empty(WORDS, np.uint64)
    two, spared = np.float32(2.0), np.float32(keep)
    for pixel in range(SIDE * SIDE):
        total += E[pixel]
    for step in range(SIDE * SIDE):
        pixel = int(unit(key, 5 * step) * SIDE * SIDE)
        field = free[int(unit(key, 5 * step + 1) * len(free))]
        bits = int(unit(key, 5 * step + 2) * 65536.0)
        if step & 1:
            bits &= int(unit(key, 5 * step + 4) * 65536.0) & (bits << 7 | bits >> 9)
        bits &= masks[field]
        if bits == 0:
            continue
        for k in range(FIELDS):
            trial[k] = fields[pixel, k]
        trial[field] ^= bits
        fill_words(trial, words)
        fill_pair(tables, words, count, False, 0, 0, 0, points[0])
        fill_pair(tables, words, count, True, 0, 0, 0, points[1])
        _point_slots(points, moved)
        gain = _move(slots[pixel], moved, excess)
        limit = -heat * math.log(max(unit(key, 5 * step + 3), 1e-12)) - weight * gain
        if weight * gain > _HOPELESS * heat:
            _move(moved, slots[pixel], excess)
            continue
        errors(tables, words, count, direction, scale, mean, turn, points, new)
        cost = np.float32(0.0)
        for part in range(2):
            for k in range(terms):
                old = E[pixel, part, k]
                d = new[part, k] - old
                own = kernel[0, REACH, REACH, k]
                cost += d * (two * h[pixel, part, k] + own * (d - spared * (new[part, k] + old)))
                cost += d * even[k] * (two * total[part, k] + d)
        if cost > limit:
            _move(moved, slots[pixel], excess)
            continue
        fields[pixel, field] = trial[field]
        slots[pixel] = moved
        for part in range(2):
            for k in range(terms):
                value = new[part, k]
                new[part, k] = value - E[pixel, part, k]
                total[part, k] += new[part, k]
                E[pixel, part, k] = value
        spread(new, pixel, kernel, h)


def level_tile(given: NDArray[np.uint16], count: int, plan: Plan) -> NDArray[np.uint16]:
    """Return a level tile for `count` samples from one as `make_bluenoise.make_tile` returns it."""
    tables, series, free = sobol_tables(), make_series(plan), np.array(plan.fields)
    terms = (series.direction, series.scale, series.mean, phase_table())
    fields = given.astype(np.int64)
    E = np.zeros((SIDE * SIDE, 2, len(series.scale)), np.float32)
    h = np.zeros_like(E)
    start(tables, fields, count, *terms, series.kernel, E, h)
    slots, counts = tile_counts(tables, fields, count)
    excess = counts - even_counts()
    own = series.kernel[0, REACH, REACH]
    wanted = own_energy(E, own)
    change, keep = 2.0 * wanted / SIDE**2, 0.5
    for k in range(MOST_SWEEPS):
        weight = LIGHT * (HEAVY / LIGHT) ** min(1.0, k / RISE) * change
        key = int(combine(combine(0x1E7E1, count), k))
        _sweep(
            tables, fields, free, MASKS, count, *terms, series.kernel, series.even, keep, COLD * change, weight, key,
            E, h, slots, excess,
        )  # fmt: skip
        keep += 0.5 * (1.0 - own_energy(E, own) / wanted)
        if not excess.any():
            break
    return fields.astype(np.uint16)


def main() -> None:
    """Write the data file anew."""
    with np.load(DATA) as data:
        given = {count: from_planes(data[f"level_{count}"]) for count in LEVELS}
    planes = {f"level_{n}": to_planes(level_tile(given[n], n, PLANS[n])) for n in reversed(LEVELS)}
    np.savez_compressed(DATA, allow_pickle=False, **planes)


if __name__ == "__main__":
    main()
