"""Where and when the samples of a pixel lie: one definition for the tracer's kernels and the rasterizer's passes.

A sample set of N is addressed by (seed, frame, pixel, index): the pixel position comes from the stratum `index`, the
shutter time, lens and light from strata in orders of their own, so that all are well spread together (Cook 1984).

N that is no square: round(sqrt N) rows, row i holds n_i cells of height n_i / N, all of area 1 / N (DESIGN.md).
"""

from collections.abc import Mapping

import numpy as np
from numba import njit

from aliasbench.renderers.sampling.hashing import SHARED, combine, pattern_key, permute, unit
from aliasbench.scenes.errors import NotAvailableError
from aliasbench.scenes.model import FloatArray

CENTER, GRID, RANDOM, JITTERED = 0, 1, 2, 3
SAMPLERS: Mapping[str, int] = {"center": CENTER, "grid": GRID, "random": RANDOM, "jittered": JITTERED}

# Dimensions: each has a stream of its own.
DIM_X, DIM_Y, DIM_TIME, DIM_LENS, DIM_LIGHT = 0, 1, 2, 3, 5


def sampler_code(name: str) -> int:
    """Return the kernel's number of a sampler.

    Raises
    ------
    NotAvailableError
        For a sampler that is documented but not there yet.
    """
    if name not in SAMPLERS:
        raise NotAvailableError(f"sampler={name} is not available yet; available: {', '.join(SAMPLERS)}")
    return SAMPLERS[name]


@njit(cache=True)
def row_count(count: int) -> int:
    """Return the number of rows of a stratified set of `count` samples, round(sqrt(count))."""
    return max(1, int(np.round(np.sqrt(float(count)))))


@njit(inline="always", cache=True)
def cell_position(index: int, count: int, rows: int, u: float, v: float) -> tuple[float, float]:
    """Return (x, y) in the unit square of the point (u, v) of stratum `index` (row-major) out of `count`.

    Row i holds cells floor(i count / rows) .. floor((i + 1) count / rows) - 1.
    """
    row = (index * rows + rows - 1) // count
    first = row * count // rows
    if first > index:
        row -= 1
        first = row * count // rows
    after = (row + 1) * count // rows
    n = after - first
    return (index - first + u) / n, (first + v * n) / count


@njit(inline="always", cache=True)
def pixel_position(sampler: int, count: int, rows: int, index: int, key: int) -> tuple[float, float]:
    """Return a sample's place in its pixel, x right and y down, both in [0, 1)."""
    if sampler == CENTER:
        return 0.5, 0.5
    if sampler == GRID:
        return cell_position(index, count, rows, 0.5, 0.5)
    u = unit(combine(key, DIM_X), index)
    v = unit(combine(key, DIM_Y), index)
    if sampler == RANDOM:
        return u, v
    return cell_position(index, count, rows, u, v)


@njit(inline="always", cache=True)
def shutter_position(sampler: int, count: int, index: int, key: int) -> float:
    """Return a sample's time in the open shutter, [0, 1): stratified in an order of its own, at random for `random`.

    The centre and grid samplers take the middle of each stratum; one sample is in the middle of the shutter then.
    """
    stream = combine(key, DIM_TIME)
    if sampler == RANDOM:
        return unit(stream, index)
    stratum = permute(index, count, combine(stream, 1))
    if sampler in (CENTER, GRID):
        return (stratum + 0.5) / count
    return (stratum + unit(stream, index)) / count


@njit(inline="always", cache=True)
def plane_position(sampler: int, count: int, rows: int, index: int, key: int, dim: int) -> tuple[float, float]:
    """Return a sample's point in the unit square of another pair of dimensions (lens, light), strata permuted."""
    if count == 1 and sampler in (CENTER, GRID):
        return 0.5, 0.5
    first, second = combine(key, dim), combine(key, dim + 1)
    u, v = unit(first, index), unit(second, index)
    if sampler == RANDOM:
        return u, v
    if sampler in (CENTER, GRID):
        u, v = 0.5, 0.5
    return cell_position(permute(index, count, combine(first, second)), count, rows, u, v)


def pattern_frame(reseed: str, frame: int) -> int:
    """Return the frame number that enters the pattern's key: 0 throughout under reseed=never."""
    return 0 if reseed == "never" else frame


@njit(cache=True)
def _fill(sampler: int, count: int, key: int, out: FloatArray) -> None:
    rows = row_count(count)
    for index in range(count):
        out[index, 0], out[index, 1] = pixel_position(sampler, count, rows, index, key)
        out[index, 2] = shutter_position(sampler, count, index, key)
        out[index, 3], out[index, 4] = plane_position(sampler, count, rows, index, key, DIM_LENS)
        out[index, 5], out[index, 6] = plane_position(sampler, count, rows, index, key, DIM_LIGHT)


def sample_set(
    name: str, count: int, *, seed: int = 0, frame: int = 0, pixel: tuple[int, int] = (SHARED, SHARED)
) -> FloatArray:
    """Return a whole set, (count, 7) float64 in [0, 1): x, y, time, lens u and v, light u and v.

    Parameters
    ----------
    name : str
        A key of `SAMPLERS`.
    count : int
        Samples, at least 1.
    seed, frame : int
    pixel : (column, row)
        Left out, the set that accumulation passes and `pattern=shared` use for all pixels.
    """
    out = np.empty((count, 7))
    _fill(sampler_code(name), count, pattern_key(seed, frame, pixel[0], pixel[1]), out)
    return out
