"""Where and when the samples of a pixel lie: one definition for the tracer's kernels and the rasterizer's passes.

A sample set of N is addressed by (seed, frame, pixel, index, dimension): any number of it can be computed in any order
on any thread. All dimensions are well spread in themselves and together (Cook 1984): the shutter's times, lens and
light points, wavelengths and directions are strata in orders of their own, or further dimensions of one sequence.

    center         all in the middle of the pixel
    grid           the centres of equal cells
    random         independent uniform points
    jittered       one uniform point in each cell
    multijittered  jittered in cells and, correlated (Kensler 2013), in finer rows and columns as well
    sobol          the first N points of Sobol's (0, 2)-sequence under Owen's scrambling; any prefix is well spread
    bluenoise      sobol with scramblings arranged over the picture so that neighbours' errors cancel (`bluenoise`)

N that is no square: round(sqrt N) rows, row i holds n_i cells of height n_i / N, all of area 1 / N (DESIGN.md).
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import called, inlined
from aliasbench.renderers.sampling.bluenoise import (
    ORDER,
    PIXEL,
    SECOND,
    WORDS,
    Tile,
    bluenoise_tile,
    fine_key,
    tile_offset,
    tile_order,
    tile_place,
    tile_point,
    tile_streams,
)
from aliasbench.renderers.sampling.hashing import SHARED, combine, frame_key, permute, pixel_key, unit
from aliasbench.renderers.sampling.rare import compiled_if_rare
from aliasbench.renderers.sampling.sobol import (
    TABLE_BITS,
    WordArray,
    scrambled_unit,
    shuffled,
    sobol_bits,
    sobol_tables,
)
from aliasbench.scenes.errors import unknown_name
from aliasbench.scenes.model import FloatArray

CENTER, GRID, RANDOM, JITTERED, MULTIJITTERED, SOBOL, BLUENOISE = 0, 1, 2, 3, 4, 5, 6
SAMPLERS: Mapping[str, int] = {
    "center": CENTER,
    "grid": GRID,
    "random": RANDOM,
    "jittered": JITTERED,
    "multijittered": MULTIJITTERED,
    "sobol": SOBOL,
    "bluenoise": BLUENOISE,
}

# Dimensions: each has a stream of its own; lens, light and direction take two.
# Kernels are compiled anew for each plain integer that is written out in a call, but once for all of numpy's.
DIM_X, DIM_TIME, DIM_LENS, DIM_LIGHT, DIM_WAVELENGTH, DIM_DIRECTION = (np.int64(d) for d in (0, 2, 3, 5, 7, 8))
DIMENSIONS = 10
AXIS_0, AXIS_1, AXIS_2 = (np.int64(axis) for axis in range(3))  # of the sequence
_ORDER, _COLUMNS, _ROWS = 1, 2, 3  # what streams are derived from a dimension's
_MOST_NUMBERS = 2**24
_SHORT = 1 << TABLE_BITS


class Pattern(NamedTuple):
    """A sample set of every pixel of one frame, as data for kernels.

    Attributes
    ----------
    sampler, samples : int
        The sampler's number and N.
    start : uint64
        `frame_key` of seed and frame.
    shared : bool
        One set for all pixels.
    progressive : bool
        Not all N may be taken: orders of other dimensions must be good from the first sample on.
    cells : (4, N) float64
        Left, top, width and height of the cell that each sample is spread over, in the unit square.
    places : (3, N) int32
        Of multijittered samples: row, place in the row, and by how much the row is longer than the shortest.
    tables : (2, 3, 4096) uint32
        See `sobol.sobol_tables`; empty for other samplers.
    tile : (side, side, WORDS) uint64
        See `bluenoise.bluenoise_tile`; empty for other samplers.
    offsets : (DIMENSIONS, 3) int64
        Where each dimension's tile starts, column and row, and its orientation; see `bluenoise.tile_offset`.
    """

    sampler: int
    samples: int
    start: np.uint64
    shared: bool
    progressive: bool
    cells: FloatArray
    places: NDArray[np.int32]
    tables: WordArray
    tile: Tile
    offsets: NDArray[np.int64]


class RarePattern(Pattern):
    """A pattern of multijittered or bluenoise samples, whose code other kernels do without (`rare`)."""

    __slots__ = ()
    RARE = True


def tile_offsets(start: int, side: int) -> NDArray[np.int64]:
    """Return `Pattern.offsets` of a frame with the key `start`: the light and the pixel share a place."""
    groups = [0 if dimension in (DIM_X, DIM_LIGHT) else dimension for dimension in range(DIMENSIONS)]
    return np.array([tile_offset(np.uint64(start), group, side) for group in groups], np.int64)


def sampler_code(name: str) -> int:
    """Return the kernel's number of a sampler.

    Raises
    ------
    InputError
        For another name.
    """
    if name not in SAMPLERS:
        raise unknown_name("sampler", name, SAMPLERS)
    return SAMPLERS[name]


def make_pattern(name: str, count: int, start: int, *, shared: bool, progressive: bool = False) -> Pattern:
    """Return the pattern of `count` samples a pixel under a sampler's name.

    `start` is `frame_key` of seed and frame.
    """
    code = sampler_code(name)
    cells = np.zeros((4, count))
    tables, tile = np.zeros((2, 0, 0), np.uint32), np.zeros((0, 0, WORDS), np.uint64)
    offsets = np.zeros((DIMENSIONS, 3), np.int64)
    places = np.zeros((3, count if code == MULTIJITTERED else 0), np.int32)
    if code == MULTIJITTERED:
        _fill_places(count, places)
    if code in (SOBOL, BLUENOISE):
        tables = sobol_tables()
    else:
        _fill_cells(code, count, cells)
    if code == BLUENOISE:
        tile = bluenoise_tile(count).copy()  # kernels know writable arrays and others apart
        offsets = tile_offsets(start, len(tile))
    kind = RarePattern if code in (MULTIJITTERED, BLUENOISE) else Pattern
    return kind(code, count, np.uint64(start), shared, progressive, cells, places, tables, tile, offsets)


@njit(cache=True)
def row_count(count: int) -> int:
    """Return the number of rows of a stratified set of `count` samples, round(sqrt(count))."""
    return max(1, int(np.round(np.sqrt(float(count)))))


@njit(inline="always", cache=True)
def cell_of(index: int, count: int, rows: int) -> tuple[int, int, int]:
    """Return the row of stratum `index` (row-major) out of `count`, the row's first stratum, and how many it has.

    Row i holds cells floor(i count / rows) .. floor((i + 1) count / rows) - 1.
    """
    row = (index * rows + rows - 1) // count
    first = row * count // rows
    if first > index:
        row -= 1
        first = row * count // rows
    return row, first, (row + 1) * count // rows - first


@njit(inline="always", cache=True)
def cell_position(index: int, count: int, rows: int, u: float, v: float) -> tuple[float, float]:
    """Return (x, y) in the unit square of the point (u, v) of stratum `index` out of `count`; see `cell_of`."""
    _, first, n = cell_of(index, count, rows)
    return (index - first + u) / n, (first + v * n) / count


@njit(cache=True, error_model="numpy")
def _fill_cells(sampler: int, count: int, cells: FloatArray) -> None:
    rows = row_count(count)
    for index in range(count):
        if sampler == CENTER:
            cells[0, index], cells[1, index] = 0.5, 0.5
        elif sampler == RANDOM:
            cells[2, index], cells[3, index] = 1.0, 1.0
        elif sampler == GRID:
            cells[0, index], cells[1, index] = cell_position(index, count, rows, 0.5, 0.5)
        else:
            x0, y0 = cell_position(index, count, rows, 0.0, 0.0)
            x1, y1 = cell_position(index, count, rows, 1.0, 1.0)
            cells[0, index], cells[1, index], cells[2, index], cells[3, index] = x0, y0, x1 - x0, y1 - y0


@njit(cache=True, error_model="numpy")
def _fill_places(count: int, places: NDArray[np.int32]) -> None:
    rows = row_count(count)
    for index in range(count):
        row, first, n = cell_of(index, count, rows)
        places[0, index], places[1, index], places[2, index] = row, index - first, n - count // rows


@njit(inline="always", cache=True)
def column_order(column: int, cells: int, stream: int) -> int:
    """Return which of a row's `cells` finer rows the multijittered sample in a column takes: the same in all rows."""
    return permute(column, cells, combine(combine(stream, _COLUMNS), cells))


@njit(inline="always", cache=True)
def row_order(row: int, rows: int, stream: int) -> int:
    """Return which of a cell's `rows` finer columns the multijittered samples in a row take: the same in all cells."""
    return permute(row, rows, combine(stream, _ROWS))


@compiled_if_rare(np.uint64(0))
@njit(cache=True)
def _tile_word(pattern: Pattern, column: int, row: int, dimension: int, word: int) -> np.uint64:
    """Return a word of the tile for a dimension of a pixel."""
    right, down, turn = pattern.offsets[dimension, 0], pattern.offsets[dimension, 1], pattern.offsets[dimension, 2]
    across, along = tile_place(column, row, right, down, turn, len(pattern.tile))
    return pattern.tile[along, across, word]


@inlined
def sequence_point(pattern: Pattern, axis: int, number: int, stream: int) -> float:
    """Return a point of Sobol's sequence in [0, 1), scrambled as the sampler does it with a dimension's stream."""
    if pattern.sampler == BLUENOISE:
        return _tile_point(pattern, axis, number, stream)
    return scrambled_unit(sobol_bits(pattern.tables, axis, np.uint32(number)), np.uint32(stream))


@compiled_if_rare(0.0)
@inlined
def _tile_point(pattern: Pattern, axis: int, number: int, stream: int) -> float:
    return tile_point(pattern.tables, axis, np.uint32(number), np.uint64(stream))


@njit(cache=True)
def stream_keys(pattern: Pattern, key: int, column: int, row: int, dimension: int) -> tuple[np.uint64, np.uint64]:
    """Return the keys of a dimension and the next for the pixel whose `pixel_key` is `key`."""
    if pattern.sampler == BLUENOISE:
        return _tile_keys(pattern, key, column, row, dimension)
    return combine(key, dimension), combine(key, dimension + 1)


@compiled_if_rare((np.uint64(0), np.uint64(0)))
@njit(cache=True)
def _tile_keys(pattern: Pattern, key: int, column: int, row: int, dimension: int) -> tuple[np.uint64, np.uint64]:
    first = PIXEL if dimension == DIM_X else SECOND
    return tile_streams(
        _tile_word(pattern, column, row, dimension, first),
        _tile_word(pattern, column, row, dimension, first + 1),
        pattern.offsets[dimension, 2],
        fine_key(key, dimension, 0),
        fine_key(key, dimension, 1),
    )


@njit(inline="always", cache=True)
def order_mask(count: int) -> int:
    """Return the mask over the numbers of a sequence from which another dimension's `count` are taken."""
    return _SHORT - 1 if count <= _SHORT else _MOST_NUMBERS - 1


@inlined
def own_order(pattern: Pattern, count: int, index: int, key: int) -> int:
    """Return which point of a dimension's set of `count` belongs to sample `index`, under a key of its own."""
    if pattern.sampler == RANDOM:
        return index
    if pattern.sampler == SOBOL or (pattern.sampler == BLUENOISE and pattern.progressive):
        return int(np.int64(shuffled(index, np.uint32(key)))) & order_mask(count)
    if pattern.sampler == BLUENOISE:
        return _tile_order(pattern, count, index, key)
    return permute(index, count, key)


@compiled_if_rare(np.int64(0))
@njit(cache=True, error_model="numpy")
def _tile_order(pattern: Pattern, count: int, index: int, key: int) -> int:  # noqa: ARG001 - its type decides
    return tile_order(index, count, np.uint64(key))


@inlined
def pair_position(
    pattern: Pattern, count: int, rows: int, number: int, index: int, first: int, second: int
) -> tuple[float, float]:
    """Return point `number` of a set of `count` in the unit square, for sample `index` and the streams' keys."""
    sampler = pattern.sampler
    if sampler in (SOBOL, BLUENOISE):
        return sequence_point(pattern, AXIS_0, number, first), sequence_point(pattern, AXIS_1, number, second)
    if sampler in (CENTER, GRID):
        return cell_position(number, count, rows, 0.5, 0.5)
    u, v = unit(first, index), unit(second, index)
    if sampler == RANDOM:
        return u, v
    if sampler == MULTIJITTERED:
        u, v = _finer_position(pattern, count, rows, number, first, second, u, v)
    return cell_position(number, count, rows, u, v)


@compiled_if_rare((0.0, 0.0))
@called
def _finer_position(
    pattern: Pattern, count: int, rows: int, number: int, first: int, second: int, u: float, v: float,  # noqa: ARG001
) -> tuple[float, float]:  # fmt: skip
    """Return the place in its cell of a multijittered sample."""
    row, start, n = cell_of(number, count, rows)
    return (row_order(row, rows, first) + u) / rows, (column_order(number - start, n, second) + v) / n


@njit(inline="always", cache=True)
def pixel_position(pattern: Pattern, count: int, rows: int, index: int, first: int, second: int) -> tuple[float, float]:
    """Return a sample's place in its pixel, x right and y down, both in [0, 1)."""
    if pattern.sampler == CENTER:
        return 0.5, 0.5
    return pair_position(pattern, count, rows, index, index, first, second)


@njit(inline="always", cache=True)
def plane_position(
    pattern: Pattern, count: int, rows: int, index: int, first: int, second: int, order: int
) -> tuple[float, float]:
    """Return a sample's point in the unit square of another pair of dimensions (lens, light, direction).

    `order` is `plane_order`.
    """
    return pair_position(pattern, count, rows, own_order(pattern, count, index, order), index, first, second)


@njit(inline="always", cache=True)
def line_position(pattern: Pattern, count: int, index: int, stream: int, order: int) -> float:
    """Return a sample's place in [0, 1) in a single dimension (wavelength), stratified in an order of its own."""
    sampler = pattern.sampler
    if sampler == RANDOM:
        return unit(stream, index)
    number = own_order(pattern, count, index, order)
    if sampler in (SOBOL, BLUENOISE):
        return sequence_point(pattern, AXIS_0, number, stream)
    if sampler in (CENTER, GRID):
        return (number + 0.5) / count
    return (number + unit(stream, index)) / count


@njit(inline="always", cache=True)
def shutter_position(pattern: Pattern, count: int, index: int, stream: int, order: int) -> float:
    """Return a sample's time in the open shutter, [0, 1): as any single dimension, or Sobol's third.

    The centre and grid samplers take the middle of each stratum; one sample is in the middle of the shutter then.
    """
    if pattern.sampler == SOBOL:
        return sequence_point(pattern, AXIS_2, index, stream)
    return line_position(pattern, count, index, stream, order)


@njit(cache=True)
def line_order(pattern: Pattern, key: int, column: int, row: int, dimension: int) -> np.uint64:
    """Return the key of a single dimension's order for the pixel whose `pixel_key` is `key`."""
    if pattern.sampler == BLUENOISE and not pattern.progressive:
        return _tile_word(pattern, column, row, dimension, ORDER)
    return combine(combine(key, dimension), _ORDER)


@njit(cache=True)
def plane_order(pattern: Pattern, key: int, column: int, row: int, dimension: int) -> np.uint64:
    """Return the key of a pair's order for the pixel whose `pixel_key` is `key`."""
    if pattern.sampler == BLUENOISE and not pattern.progressive:
        return _tile_word(pattern, column, row, dimension, ORDER)
    return combine(combine(key, dimension), combine(key, dimension + 1))


def pattern_frame(reseed: str, frame: int) -> int:
    """Return the frame number that enters the pattern's key: 0 throughout under reseed=never."""
    return 0 if reseed == "never" else frame


@called
def _plane(
    pattern: Pattern, count: int, index: int, key: int, column: int, row: int, dimension: int
) -> tuple[float, float]:
    a, b = stream_keys(pattern, key, column, row, dimension)
    rows = row_count(count)
    if dimension == DIM_X:
        return pixel_position(pattern, count, rows, index, a, b)
    return plane_position(pattern, count, rows, index, a, b, plane_order(pattern, key, column, row, dimension))


@called
def _line(pattern: Pattern, count: int, index: int, key: int, column: int, row: int, dimension: int) -> float:
    a, _ = stream_keys(pattern, key, column, row, dimension)
    order = line_order(pattern, key, column, row, dimension)
    if dimension == DIM_TIME:
        return shutter_position(pattern, count, index, a, order)
    return line_position(pattern, count, index, a, order)


@njit(cache=True)
def _fill(pattern: Pattern, column: int, row: int, out: FloatArray) -> None:
    count = pattern.samples
    key = pixel_key(pattern.start, column, row)
    for index in range(count):
        for pair in (DIM_X, DIM_LENS, DIM_LIGHT, DIM_DIRECTION):
            out[index, pair], out[index, pair + 1] = _plane(pattern, count, index, key, column, row, pair)
        for line in (DIM_TIME, DIM_WAVELENGTH):
            out[index, line] = _line(pattern, count, index, key, column, row, line)


def sample_set(
    name: str, count: int, *, seed: int = 0, frame: int = 0, pixel: tuple[int, int] = (SHARED, SHARED)
) -> FloatArray:
    """Return a whole set, (count, 10) in [0, 1): x, y, time, lens u v, light u v, wavelength, direction u v.

    Parameters
    ----------
    name : str
        A key of `SAMPLERS`.
    count : int
        Samples, at least 1.
    seed, frame : int
    pixel : (column, row)
        Left out, the set that accumulation passes and `pattern=shared` use for all pixels.

    Raises
    ------
    InputError
        For another name.
    """
    out = np.empty((count, DIMENSIONS))
    pattern = make_pattern(name, count, frame_key(seed, frame), shared=pixel == (SHARED, SHARED))
    _fill(pattern, pixel[0], pixel[1], out)
    return out
