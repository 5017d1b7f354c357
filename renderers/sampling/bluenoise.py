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
What no offset can change is the mean over the tile. With keys by chance it would be 1 / 64 of a pixel's standard error;
annealing holds it below that. A toroidal shift of all points would end it, but strata would then wrap around the
square's border: 20 % more error in penumbrae, and .77 of white noise for .50.
"""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.sampling.bits import and32, or32, reverse32
from aliasbench.renderers.sampling.hashing import combine, frame_key, mix32, pixel_key
from aliasbench.renderers.sampling.sobol import WordArray, scramble, scrambled_unit, sobol_bits, sobol_tables
from aliasbench.scenes.model import FloatArray, read_only

Fields = NDArray[np.integer[Any]]
Tile = NDArray[np.uint64]

LEVELS = (1, 2, 4, 8, 16, 32)
SIDE = 64
DATA = Path(__file__).with_name("bluenoise.npz")

# Words of a tile's pixel: streams of the pixel's pair and of the second pair, and the key of the second pair's order.
PIXEL, SECOND, ORDER, WORDS = 0, 2, 4, 5
# A dimension has a key for each quarter of the unit interval, by the unscrambled point: still nested scrambling.
QUARTERS = 4
# Fields of 16 bits that they are made of: the first quarter's keys of the four dimensions, the other quarters'
# differences from them, and the order.
FIELDS = 4 * QUARTERS + 1
# Bits of a field in which quarters may differ. Bits 0, 1 and 9 say where the quarters go, in all 8 ways that scrambling
# has, and are common to them; bits 2 to 6 and 10 to 12 move points within one.
OWN = 0x1C7C

# A scrambled number's first 8 bits depend on the other bits of its key alone.
_FINE = np.uint64(0xFF00FF00)
_OFFSETS, _FINE_BITS = 0x51DE, 0xF19E  # streams of their own


def tile_level(count: int) -> int:
    """Return the index in `LEVELS` of the tile for `count` samples: the largest level that is not above it."""
    return sum(level <= count for level in LEVELS) - 1


@cache
def bluenoise_tile(count: int) -> Tile:
    """Return the tile for `count` samples, read-only (SIDE, SIDE, WORDS) uint64: row, column, word."""
    level = LEVELS[tile_level(count)]
    if level != count:
        return bluenoise_tile(level)
    with np.load(DATA) as data:
        fields = from_planes(data[f"level_{level}"])
    return read_only(tile_words(fields).reshape(SIDE, SIDE, WORDS))


def to_planes(fields: NDArray[np.uint16]) -> NDArray[np.uint8]:
    """Return (FIELDS, 2, n) lower and upper bytes of (n, FIELDS) fields: alike ones together are compressed best."""
    return np.stack([fields.T & 0xFF, fields.T >> 8], axis=1).astype(np.uint8)


def from_planes(planes: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """Return the fields of `to_planes`."""
    wide = planes.astype(np.uint16)
    return np.ascontiguousarray((wide[:, 0] | wide[:, 1] << 8).T)


@njit(cache=True, nogil=True)
def fill_words(fields: Fields, out: Tile) -> None:
    """Write the words of one pixel to `out`, (WORDS,), given its fields, (FIELDS,).

    A stream has the first quarter's key in bits 0 to 31, and what others differ by in a byte for each quarter above.
    """
    for dimension in range(4):
        field = np.uint64(fields[dimension])
        stream = field & np.uint64(0xFF) | (field & np.uint64(0xFF00)) << np.uint64(8)
        for quarter in range(1, QUARTERS):
            own = np.uint64(fields[4 * quarter + dimension])
            byte = own >> np.uint64(2) & np.uint64(0x1F) | own >> np.uint64(5) & np.uint64(0xE0)
            stream |= byte << np.uint64(32 + 8 * quarter)
        out[dimension] = stream
    out[ORDER] = np.uint64(fields[FIELDS - 1])


@njit(cache=True)
def tile_words(fields: Fields) -> Tile:
    """Return (n, WORDS) words of (n, FIELDS) fields."""
    out = np.empty((len(fields), WORDS), np.uint64)
    for k in range(len(fields)):
        fill_words(fields[k], out[k])
    return out


@njit(inline="always", cache=True)
def tile_offset(start: int, group: int, side: int) -> tuple[int, int]:
    """Return (columns, rows) by which a group of pairs has its tile shifted, from the frame's key.

    Group 0 is the pixel's pair and the second; every other pair is a group of its own.
    """
    key = combine(combine(start, _OFFSETS), group)
    return int(key) % side, int(key) // side % side


@njit(inline="always", cache=True)
def tile_stream(word: np.uint64, fine: int) -> np.uint64:
    """Return a dimension's stream from a tile's word, with the bits of a hash that the tile leaves free."""
    return word | np.uint64(fine) & _FINE


@njit(inline="always", cache=True)
def quarter_key(stream: np.uint64, reversed_bits: np.uint32) -> np.uint32:
    """Return the Owen key for a bit-reversed Sobol point of a dimension, given the dimension's stream."""
    shift = np.uint64(32) + (np.uint64(8) * (np.uint64(reversed_bits) & np.uint64(QUARTERS - 1)))
    own = stream >> shift
    return np.uint32(stream ^ ((own & np.uint64(0x1F)) << np.uint64(2)) ^ ((own & np.uint64(0xE0)) << np.uint64(13)))


@njit(inline="always", cache=True)
def tile_order(number: int, count: int, word: np.uint64) -> int:
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
def fine_key(pattern: int, pair: int, dimension: int) -> np.uint64:
    """Return the hash for a dimension's `tile_stream` from the pixel's key in this frame."""
    return combine(combine(pattern, _FINE_BITS), 2 * pair + dimension)


@njit(cache=True, nogil=True)
def fill_pair(
    tables: WordArray, words: Tile, count: int, second: bool, fine_x: int, fine_y: int, out: FloatArray
) -> None:
    """Write the points of a pair to `out`, (count, 2), given the words of one of the tile's pixels."""
    first = SECOND if second else PIXEL
    stream_x, stream_y = tile_stream(words[first], fine_x), tile_stream(words[first + 1], fine_y)
    for i in range(count):
        n = np.uint32(tile_order(i, count, words[ORDER]) if second else i)
        x, y = sobol_bits(tables, 0, n), sobol_bits(tables, 1, n)
        out[i, 0] = scrambled_unit(x, quarter_key(stream_x, x))
        out[i, 1] = scrambled_unit(y, quarter_key(stream_y, y))


@njit(cache=True)
def fill_pixel(
    tables: WordArray, tile: Tile, count: int, start: int, column: int, row: int, pair: int, out: FloatArray
) -> None:
    """Write the points of a pixel's pair to `out`, (count, 2); `start` is the frame's key."""
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
    fill_pixel(sobol_tables(), bluenoise_tile(count), count, start, pixel[0], pixel[1], pair, out)
    return out
