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

Each seed and frame has the tile in another place and orientation, and points below their first 8 bits scrambled anew in
each pixel. An orientation is a symmetry of the square, done to the picture, the pixel and the second pair at once:
columns are mirrored with x and u, rows with y and v, or one swapped for the other. The edges that the tile was made for
are still among those, sets are still nets, and whatever is odd about the middle of x and u, or of y and v, has no bias.

What no place can change is the rest of the mean over the tile. Counts of n seeds' points in K equal cells have a
chi-square whose mean exceeds K - 1 by n K sum((p - 1 / K)^2), p being the cells' shares of the 8 SIDE^2 places. If K'
classes of cells are left that orientations do not exchange, and m coordinates or pairs that they do, keys by chance
make that n (K' - 1) / (m SIDE^2): of 8 x 8 cells K' = 10 and m = 1 for (x, y) and (u, v), 16 and 2 for (x, v) and
(y, u), 32 and 2 for (x, u) and (y, v); of k parts of one coordinate k / 2 and 2. So it is about
EXCESS (K - 1) n / SIDE^2 at most. In 8 x 8 cells of each pair and 64 parts of each coordinate the tile is level
(`level_bluenoise`), for each sample of the levels by itself: no class of 256 or 512 lacks or exceeds more than LEVEL
points, which leaves a hundredth of that. In finer parts annealing may leave more: of single light points, in 128 parts,
eleven times EXCESS.

A toroidal shift of all points would be exact, but strata would then wrap around the square's border: 20 % more error in
penumbrae, and .77 of white noise for .50.
"""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.sampling.bits import and32, or32, reverse32, xor32
from aliasbench.renderers.sampling.hashing import combine, frame_key, mix32, pixel_key
from aliasbench.renderers.sampling.sobol import TO_UNIT, WordArray, scramble, sobol_bits, sobol_tables
from aliasbench.scenes.model import FloatArray, read_only

Fields = NDArray[np.integer[Any]]
Tile = NDArray[np.uint64]

LEVELS = (1, 2, 4, 8, 16, 32)
SIDE = 64  # a power of two
EXCESS, LEVEL = 0.25, 6  # bounds of the tile's unevenness, see above
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

# Orientations, 0 to 7: the tile's columns go along the picture's rows; they go backwards; the tile's rows do.
_SWAPPED, _MIRRORED = 1, 2
# The byte of a stream that no quarter uses says what is done to its points: first bit swapped, second mirrored.
_TURN_SHIFT = np.uint64(32)
_QUARTERS_ONLY = np.uint64(0xFFFFFF00FFFFFFFF)
_ONES = np.uint32(0xFFFFFFFF)


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
def tile_offset(start: int, group: int, side: int) -> tuple[int, int, int]:
    """Return (columns, rows, orientation) of a group of pairs' tile, from the frame's key; see `tile_place`.

    Group 0 is the pixel's pair and the second; every other pair is a group of its own.
    """
    key = combine(combine(start, _OFFSETS), group)
    return int(key) % side, int(key) // side % side, int(key) // (side * side) % 8


@njit(inline="always", cache=True)
def tile_place(column: int, row: int, right: int, down: int, turn: int, side: int) -> tuple[int, int]:
    """Return the (column, row) of the tile that a pixel has, given the tile's offset and orientation."""
    across, along = (row, column) if turn & _SWAPPED else (column, row)
    if turn & _MIRRORED:
        across = -across
    if turn & (_MIRRORED << 1):
        along = -along
    return (across + right) & (side - 1), (along + down) & (side - 1)


@njit(inline="always", cache=True)
def tile_streams(
    word_x: np.uint64, word_y: np.uint64, turn: int, fine_x: int, fine_y: int
) -> tuple[np.uint64, np.uint64]:
    """Return a pair's streams from its two words in a tile of some orientation.

    `fine_x`, `fine_y` are hashes for the bits that the tile leaves free.
    """
    swapped = turn & _SWAPPED
    mirror_x, mirror_y = turn & _MIRRORED, turn >> 1 & _MIRRORED
    if swapped:
        word_x, word_y, mirror_x, mirror_y = word_y, word_x, mirror_y, mirror_x
    x = word_x | np.uint64(fine_x) & _FINE | np.uint64(swapped | mirror_x) << _TURN_SHIFT
    y = word_y | np.uint64(fine_y) & _FINE | np.uint64(swapped | mirror_y) << _TURN_SHIFT
    return x, y


@njit(inline="always", cache=True)
def quarter_key(stream: np.uint64, reversed_bits: np.uint32) -> np.uint32:
    """Return the Owen key for a bit-reversed Sobol point of a dimension, given the dimension's stream."""
    shift = np.uint64(32) + (np.uint64(8) * (np.uint64(reversed_bits) & np.uint64(QUARTERS - 1)))
    own = (stream & _QUARTERS_ONLY) >> shift
    return np.uint32(stream ^ ((own & np.uint64(0x1F)) << np.uint64(2)) ^ ((own & np.uint64(0xE0)) << np.uint64(13)))


@njit(inline="always", cache=True)
def tile_point(tables: WordArray, dimension: int, number: np.uint32, stream: np.uint64) -> float:
    """Return a point of a pair's dimension (0 or 1) in [0, 1), a multiple of 2^-32, given the dimension's stream."""
    turn = int(stream >> _TURN_SHIFT)
    mirror = _ONES if turn & _MIRRORED else np.uint32(0)
    bits = sobol_bits(tables, dimension ^ (turn & _SWAPPED), number)
    return float(xor32(reverse32(scramble(bits, quarter_key(stream, bits))), mirror)) * TO_UNIT


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
    """Return a dimension's hash for `tile_streams` from the pixel's key in this frame."""
    return combine(combine(pattern, _FINE_BITS), 2 * pair + dimension)


@njit(cache=True, nogil=True)
def fill_pair(
    tables: WordArray, words: Tile, count: int, second: bool, turn: int, fine_x: int, fine_y: int, out: FloatArray
) -> None:
    """Write the points of a pair to `out`, (count, 2), given the words of one of the tile's pixels."""
    first = SECOND if second else PIXEL
    stream_x, stream_y = tile_streams(words[first], words[first + 1], turn, fine_x, fine_y)
    for i in range(count):
        n = np.uint32(tile_order(i, count, words[ORDER]) if second else i)
        out[i, 0] = tile_point(tables, 0, n, stream_x)
        out[i, 1] = tile_point(tables, 1, n, stream_y)


@njit(cache=True)
def fill_pixel(
    tables: WordArray, tile: Tile, count: int, start: int, column: int, row: int, pair: int, out: FloatArray
) -> None:
    """Write the points of a pixel's pair to `out`, (count, 2); `start` is the frame's key."""
    side = len(tile)
    right, down, turn = tile_offset(start, max(0, pair - 1), side)
    across, along = tile_place(column, row, right, down, turn, side)
    pattern = pixel_key(start, column, row)
    fine_x, fine_y = fine_key(pattern, pair, 0), fine_key(pattern, pair, 1)
    fill_pair(tables, tile[along, across], count, pair > 0, turn, fine_x, fine_y, out)


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
