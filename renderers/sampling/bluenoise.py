"""Sobol points whose scrambling keys are chosen by pixel, so that neighbours' errors cancel under a small blur.

A pixel's points are the first N of an Owen-scrambled Sobol sequence as for the plain sampler, and so is its error. Only
the keys of neighbours belong together: a tile of keys, one for each N in `LEVELS`, was found by annealing
(`make_bluenoise`), so that errors of half spaces over (pixel, second pair) are high-pass over the picture. That is what
edges of penumbrae, lenses and shutters are, also where the place in the pixel moves the edge: at 16 samples half of the
error comes from there, so the second pair has to share the pixel's place in the tile. (Heitz & Belcour 2019 permute
pixels' keys for the picture at hand; Heitz et al. 2019 choose them for all pictures. Here a pixel has 2^170 choices,
made in small steps: permuting 2^14 keys under the same energy left .66 of white noise where this leaves .50.)

The tile is for edges that move across the second pair's square the way they move over the picture: u along the
picture's columns and v along its rows, both in the edge's direction. A shadow's border goes the other way over the
light than over the floor, so a light's u has to run to the left in the picture, and v upwards. Another orientation
costs the gain from 8 samples on, nothing else.

Each seed and frame has the tile in another place, and points below their first 8 bits scrambled anew in each pixel.
What no offset can change is the mean over the tile: 1 / 64 of a pixel's standard error for any integrand, and less for
the half spaces, whose mean over the tile vanishes with their low frequencies. A toroidal shift of the points would end
that too, but strata would then wrap around the square's border, which adds to the error.
"""

from functools import cache
from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.sampling.bits import and32, mul32, or32, reverse32, shift_right32
from aliasbench.renderers.sampling.hashing import combine, frame_key, mix32, pixel_key
from aliasbench.renderers.sampling.sobol import WordArray, scramble, scrambled_unit, sobol_bits, sobol_tables
from aliasbench.scenes.model import FloatArray, read_only

LEVELS = (1, 2, 4, 8, 16, 32)
SIDE = 64
DATA = Path(__file__).with_name("bluenoise.npz")

# Words of a tile's pixel: the keys of the pixel's pair, those of the second pair, and of the second pair's order. A
# dimension has a key for each quarter of the unit interval, by the point's unscrambled place: still nested scrambling.
QUARTERS = 4
PIXEL, SECOND, ORDER = 0, QUARTERS, 2 * QUARTERS
WORDS = 2 * QUARTERS + 1
FIELDS = 4 * QUARTERS + 1
# Bits of a field in which quarters may differ. Bits 0, 1 and 9 say where the quarters go, in all 8 ways that scrambling
# has, and are common to them; bits 2 to 6 and 10 to 12 move points within one.
OWN = 0x1C7C

# A scrambled number's first 8 bits depend on these bits of its key, and on no others.
_FINE = np.uint32(0xFF00FF00)
_ADDED, _FACTOR, _BYTE, _SIXTEEN = np.uint32(0xFF), np.uint32(0xFF0000), np.uint32(256), np.uint32(16)
_OFFSETS, _FINE_BITS = 0x51DE, 0xF19E  # streams of their own


def tile_level(count: int) -> int:
    """Return the index in `LEVELS` of the tile for `count` samples: the largest level that is not above it."""
    return sum(level <= count for level in LEVELS) - 1


@cache
def bluenoise_tile(count: int) -> WordArray:
    """Return the tile for `count` samples, read-only (SIDE, SIDE, WORDS) uint32: row, column, word.

    A word is two fields of 16 bits, of the first dimension in the lower half; see `tile_keys`.
    """
    level = LEVELS[tile_level(count)]
    if level != count:
        return bluenoise_tile(level)
    with np.load(DATA) as data:
        planes = data[f"level_{level}"]
    return read_only(words_of(from_planes(planes)).reshape(SIDE, SIDE, WORDS))


def to_planes(fields: NDArray[np.uint16]) -> NDArray[np.uint8]:
    """Return (FIELDS, 2, n) lower and upper bytes of (n, FIELDS) fields: alike ones together are compressed best."""
    return np.stack([fields.T & 0xFF, fields.T >> 8], axis=1).astype(np.uint8)


def from_planes(planes: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """Return the fields of `to_planes`."""
    wide = planes.astype(np.uint16)
    return np.ascontiguousarray((wide[:, 0] | wide[:, 1] << 8).T)


def words_of(fields: NDArray[np.uint16]) -> WordArray:
    """Return (n, WORDS) words of (n, FIELDS) fields of 16 bits.

    Four fields are the first quarter's keys x, y of both pairs, then follow the other quarters' differences from them,
    then the order.
    """
    keys = fields[:, :-1].reshape(-1, QUARTERS, 4).copy()
    keys[:, 1:] = keys[:, :1] ^ keys[:, 1:] & np.uint16(OWN)
    wide = keys.astype(np.uint32)
    pixel, second = wide[:, :, 0] | wide[:, :, 1] << 16, wide[:, :, 2] | wide[:, :, 3] << 16
    return np.concatenate([pixel, second, fields[:, -1:].astype(np.uint32)], axis=1)


@njit(inline="always", cache=True)
def tile_offset(start: int, group: int, side: int) -> tuple[int, int]:
    """Return (columns, rows) by which a group of pairs has its tile shifted, from the frame's key.

    Group 0 is the pixel's pair and the second; every other pair is a group of its own.
    """
    key = combine(combine(start, _OFFSETS), group)
    return int(key) % side, int(key) // side % side


@njit(inline="always", cache=True)
def tile_keys(word: np.uint32, fine_x: np.uint32, fine_y: np.uint32) -> tuple[np.uint32, np.uint32]:
    """Return the Owen keys of a pair's dimensions from a tile's word; points below 2^-8 are the fine keys'."""
    high = shift_right32(word, _SIXTEEN)
    key_x = or32(and32(word, _ADDED), and32(mul32(word, _BYTE), _FACTOR))
    key_y = or32(and32(high, _ADDED), and32(mul32(high, _BYTE), _FACTOR))
    return or32(key_x, and32(fine_x, _FINE)), or32(key_y, and32(fine_y, _FINE))


@njit(inline="always", cache=True)
def tile_order(number: int, count: int, word: np.uint32) -> int:
    """Return where an order of range(count) takes a number; aligned halves, quarters, ... of each block stay together.

    Blocks are [0, 1), [1, 2), [2, 4), ... as far as `count` reaches, but those below its highest power of two are one:
    the numbers that a tile was made for stay the same set.
    """
    block = 1
    while 2 * block <= count:
        block *= 2
    low = np.uint32(block - 1)
    key = np.uint32(mix32(word))
    first = block if number >= block else 0
    n = np.uint32(number)
    while True:
        n = or32(np.uint32(first), and32(reverse32(scramble(reverse32(n), key)), low))
        if int(n) < count:
            return int(n)


@njit(inline="always", cache=True)
def fine_key(pattern: int, pair: int, dimension: int) -> np.uint32:
    """Return the bits of a key that no tile fixes, from a pixel's key in this frame."""
    return np.uint32(combine(combine(pattern, _FINE_BITS), 2 * pair + dimension))


@njit(cache=True)
def fill_pair(
    tables: WordArray, words: WordArray, count: int, second: bool, fine_x: np.uint32, fine_y: np.uint32, out: FloatArray
) -> None:
    """Write the points of a pair to `out`, (count, 2), given the words of one of the tile's pixels."""
    first = SECOND if second else PIXEL
    for i in range(count):
        n = np.uint32(tile_order(i, count, words[ORDER]) if second else i)
        x, y = sobol_bits(tables, 0, n), sobol_bits(tables, 1, n)
        key_x, _ = tile_keys(words[first + int(x) % QUARTERS], fine_x, fine_y)
        _, key_y = tile_keys(words[first + int(y) % QUARTERS], fine_x, fine_y)
        out[i, 0], out[i, 1] = scrambled_unit(x, key_x), scrambled_unit(y, key_y)


@njit(cache=True)
def _fill_pixel(
    tables: WordArray, tile: WordArray, count: int, start: int, column: int, row: int, pair: int, out: FloatArray
) -> None:
    side = len(tile)
    right, down = tile_offset(start, max(0, pair - 1), side)
    pattern = pixel_key(start, column, row)
    fine_x, fine_y = fine_key(pattern, pair, 0), fine_key(pattern, pair, 1)
    fill_pair(tables, tile[(row + down) % side, (column + right) % side], count, pair > 0, fine_x, fine_y, out)


def bluenoise_set(count: int, *, seed: int = 0, frame: int = 0, pixel: tuple[int, int], pair: int) -> FloatArray:
    """Return one pixel's points of a pair of dimensions, (count, 2) float64 in [0, 1).

    Parameters
    ----------
    count : int
        Samples, at least 1.
    seed, frame : int
    pixel : (column, row)
    pair : int
        0 is the place in the pixel; 1 the second pair, which knows of it; others, from 2, are independent.
    """
    out = np.empty((count, 2))
    start = int(frame_key(seed, frame))
    _fill_pixel(sobol_tables(), bluenoise_tile(count), count, start, pixel[0], pixel[1], pair, out)
    return out
