"""Laws of the sample patterns, over every sampler and awkward counts: strata, uniformity, independence, no bias.

Statistical laws hold a family of p-values against Sidak's limit for one false alarm in a thousand; seeds are fixed, so
none ever flickers. TRIALS=10 asks for ten times as many pixels.

Pixels of `bluenoise` belong together on purpose within one picture, so that laws of chance draw each of its sets under
another seed, and look at neighbours beyond its reach. `test_bluenoise` has more laws of it.
"""

import itertools
import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numba import njit
from scipy import stats

from aliasbench.renderers.sampling import bluenoise, patterns
from aliasbench.renderers.sampling.hashing import SHARED, frame_key
from aliasbench.renderers.sampling.patterns import (
    SAMPLERS,
    RarePattern,
    make_pattern,
    pattern_frame,
    sample_set,
    sampler_code,
    tile_offsets,
)
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import FloatArray

NAMES = tuple(SAMPLERS)
DRAWN = ("random", "jittered", "multijittered", "sobol", "bluenoise")
ORDERED = ("center", "grid", "jittered", "multijittered")
COUNTS = (1, 2, 3, 4, 5, 7, 8, 11, 16, 17, 64, 97, 256)
X, Y, TIME, LENS, LIGHT, WAVELENGTH, DIRECTION, DIMENSIONS = 0, 1, 2, 3, 5, 7, 8, 10
PAIRS = (LENS, LIGHT, DIRECTION)
SIDE = 64
PIXELS = SIDE * SIDE * max(1, int(os.environ.get("TRIALS", "0")))
FALSE_ALARMS = 1e-3
REACH = 6  # pixels, within which those of bluenoise depend on each other: a blur's kernel applied twice

fill = patterns._fill


@njit(cache=True, nogil=True)
def fill_many(pattern, places, out):
    for k in range(len(places)):
        fill(pattern, places[k, 0], places[k, 1], out[k])


def pixel_places(pixels: int) -> np.ndarray:
    """Return (pixels, 2) columns and rows of a picture `SIDE` wide."""
    return np.stack([np.arange(pixels) % SIDE, np.arange(pixels) // SIDE], axis=1)


def sets(name: str, count: int, pixels: int = PIXELS, *, seed: int = 0, frame: int = 0) -> FloatArray:
    """Return the sets of that many pixels, (pixels, count, 10)."""
    out = np.empty((pixels, count, DIMENSIONS))
    fill_many(make_pattern(name, count, frame_key(seed, frame), shared=False), pixel_places(pixels), out)
    return out


@njit(cache=True, nogil=True)
def fill_draws(p, starts, offsets, places, out):
    for k in range(len(places)):
        one = RarePattern(
            p.sampler, p.samples, starts[k], p.shared, p.progressive, p.cells, p.places, p.tables, p.tile, offsets[k]
        )
        fill(one, places[k, 0], places[k, 1], out[k])


def seed_sets(
    name: str, count: int, seeds: np.ndarray, *, frame: int = 0, shift: tuple[int, int] = (0, 0)
) -> FloatArray:
    """Return a set of each seed, (seeds, count, 10), of one pixel after the other, all displaced by `shift`."""
    pattern = make_pattern(name, count, frame_key(0, 0), shared=False)
    starts = np.array([frame_key(int(seed), frame) for seed in seeds], np.uint64)
    offsets = np.array([tile_offsets(start, bluenoise.SIDE) for start in starts])
    out = np.empty((len(seeds), count, DIMENSIONS))
    fill_draws(pattern, starts, offsets, pixel_places(len(seeds)) + shift, out)
    return out


def draws(name: str, count: int, pixels: int = PIXELS, *, seed: int = 0) -> FloatArray:
    """Return independent sets (pixels, count, 10): the pixels of a picture, or each of a seed of its own."""
    if name == "bluenoise":
        return seed_sets(name, count, np.arange(seed * pixels, (seed + 1) * pixels))
    return sets(name, count, pixels, seed=seed)


def row_ends(count: int) -> list[int]:
    """The first strata of the documented rows, and the end: round(sqrt N) rows, as equal as can be."""
    rows = round(np.sqrt(count))
    return [i * count // rows for i in range(rows + 1)]


def strata(count: int) -> list[tuple[float, float, float, float]]:
    """The documented cells (x0, x1, y0, y1), row by row: row i of height n_i / N."""
    cells = []
    for first, after in itertools.pairwise(row_ends(count)):
        n = after - first
        cells += [(k / n, (k + 1) / n, first / count, after / count) for k in range(n)]
    return cells


def strata_numbers(points: FloatArray) -> np.ndarray:
    """Return in which cell of as many as there are points each of (..., count, 2) lies."""
    count = points.shape[-2]
    ends = np.array(row_ends(count))
    row = np.searchsorted(ends / count, points[..., 1], side="right") - 1
    return ends[row] + np.floor(points[..., 0] * np.diff(ends)[row]).astype(int)


def assert_chance(p_values: FloatArray, what: str) -> None:
    """Hold the smallest p-value against Sidak's limit for the whole family."""
    p = np.ravel(p_values)
    assert p.size
    assert np.isfinite(p).all()
    limit = 1.0 - (1.0 - FALSE_ALARMS) ** (1.0 / p.size)
    assert p.min() > limit, f"{what}: smallest of {p.size} p-values {p.min():.2e} at {p.argmin()}, limit {limit:.2e}"


def uniform_p_values(cells: np.ndarray, kinds: int, excess: float = 0.0) -> FloatArray:
    """Return a chi-square p-value for each column of (draws, columns) cell numbers, out of `kinds` equal cells.

    `excess` is by what share the statistic is larger than chance has it.
    """
    n, columns = cells.shape
    counts = np.bincount((np.arange(columns) * kinds + cells).ravel(), minlength=columns * kinds)
    expected = n / kinds
    statistic = ((counts.reshape(columns, kinds) - expected) ** 2).sum(axis=1) / expected
    return stats.chi2.sf(statistic / (1.0 + excess), kinds - 1)


def excess_of(name: str, seeds: int) -> float:
    """Return the `excess` of that many independent sets: places in a tile of keys are not uniform (`bluenoise`)."""
    return bluenoise.EXCESS * seeds / bluenoise.SIDE**2 if name == "bluenoise" else 0.0


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("count", COUNTS)
def test_all_numbers_lie_in_the_unit_interval(name: str, count: int) -> None:
    points = sample_set(name, count, seed=5)
    assert points.shape == (count, DIMENSIONS)
    assert np.all((points >= 0.0) & (points < 1.0))


@pytest.mark.parametrize("count", COUNTS)
def test_strata_have_equal_area_and_one_sample_each(count: int) -> None:
    cells = strata(count)
    assert len(cells) == count
    assert np.allclose([(x1 - x0) * (y1 - y0) for x0, x1, y0, y1 in cells], 1 / count, rtol=1e-12)
    grid = sample_set("grid", count)
    for (x0, x1, y0, y1), (x, y) in zip(cells, grid[:, :2], strict=True):
        assert x == pytest.approx((x0 + x1) / 2, abs=1e-15)
        assert y == pytest.approx((y0 + y1) / 2, abs=1e-15)
    for name in ("jittered", "multijittered"):
        for x, y in ((X, Y), *((first, first + 1) for first in PAIRS)):
            numbers = strata_numbers(sets(name, count, 20, seed=9)[..., [x, y]])
            expected = np.broadcast_to(np.arange(count), numbers.shape)
            assert np.array_equal(numbers if x == X else np.sort(numbers, axis=-1), expected)


@pytest.mark.parametrize("count", COUNTS)
def test_multijittered_samples_have_a_fine_row_each_and_a_fine_column_where_rows_are_equal(count: int) -> None:
    points = sets("multijittered", count, 20, seed=3)
    fine = np.floor(points * count).astype(int)
    every = np.broadcast_to(np.arange(count), (20, count))
    for x in (X, *PAIRS):
        assert np.array_equal(np.sort(fine[..., x + 1], axis=-1), every)
        if count % round(np.sqrt(count)) == 0:
            assert np.array_equal(np.sort(fine[..., x], axis=-1), every)


@pytest.mark.parametrize("rows", [2, 3, 5, 8])
def test_multijittered_rows_and_columns_share_one_order(rows: int) -> None:
    # Kensler's correlation: where a sample lies in its cell's columns depends on its row alone, and the reverse.
    fine = np.floor(sets("multijittered", rows * rows, 20)[..., :2] * rows * rows).astype(int) % rows
    across, down = np.moveaxis(fine.reshape(20, rows, rows, 2), -1, 0)
    assert np.array_equal(across, np.broadcast_to(across[:, :, :1], across.shape))
    assert np.array_equal(down, np.broadcast_to(down[:, :1], down.shape))
    every = np.broadcast_to(np.arange(rows), (20, rows))
    assert np.array_equal(np.sort(across[:, :, 0], axis=-1), every)
    assert np.array_equal(np.sort(down[:, 0], axis=-1), every)


@pytest.mark.parametrize("dimension", [TIME, WAVELENGTH])
@pytest.mark.parametrize("name", [name for name in NAMES if name != "random"])
@pytest.mark.parametrize("count", COUNTS)
def test_times_and_wavelengths_are_stratified(name: str, count: int, dimension: int) -> None:
    numbers = sets(name, count, 20, seed=2)[..., dimension]
    if name in ("sobol", "bluenoise") and count & (count - 1):
        # Of a sequence, the largest power of two of its samples is.
        count = 1 << (count.bit_length() - 1)
        numbers = numbers[:, :count]
    assert np.array_equal(np.sort(np.floor(numbers * count), axis=1), np.broadcast_to(np.arange(count), (20, count)))


def test_one_centred_sample_is_the_middle_of_everything() -> None:
    assert np.array_equal(sample_set("center", 1, seed=77), np.full((1, DIMENSIONS), 0.5))
    assert np.array_equal(sample_set("grid", 1, seed=77), np.full((1, DIMENSIONS), 0.5))


@pytest.mark.parametrize("name", DRAWN)
def test_the_same_address_gives_the_same_numbers_and_other_addresses_others(name: str) -> None:
    base = sample_set(name, 16, seed=1, frame=2, pixel=(3, 4))
    assert np.array_equal(base, sample_set(name, 16, seed=1, frame=2, pixel=(3, 4)))
    others = [
        sample_set(name, 16, seed=2, frame=2, pixel=(3, 4)),
        sample_set(name, 16, seed=1, frame=3, pixel=(3, 4)),
        sample_set(name, 16, seed=1, frame=2, pixel=(4, 3)),
        sample_set(name, 16, seed=1, frame=2, pixel=(4, 4)),
        sample_set(name, 16, seed=1 + 2**32, frame=2, pixel=(3, 4)),
        sample_set(name, 16, seed=1, frame=2, pixel=(SHARED, SHARED)),
    ]
    for other in others:
        assert not np.any(base == other)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("count", [1, 5, 16])
def test_pixels_may_be_sampled_in_any_order_on_any_number_of_threads(name: str, count: int) -> None:
    places = np.random.default_rng(0).permutation(pixel_places(400))
    pattern = make_pattern(name, count, frame_key(8, 3), shared=False)
    out = np.full((400, count, DIMENSIONS), np.nan)
    with ThreadPoolExecutor(3) as pool:
        list(pool.map(fill_many, [pattern] * 8, np.split(places, 8), np.split(out, 8)))
    for column, row in ((0, 0), (63, 0), (5, 3)):
        at = np.flatnonzero((places == (column, row)).all(axis=1)).item()
        assert np.array_equal(out[at], sample_set(name, count, seed=8, frame=3, pixel=(column, row)))
    back = sets(name, count, 400, seed=8, frame=3)
    assert np.array_equal(out, back[places[:, 1] * SIDE + places[:, 0]])


@pytest.mark.parametrize("name", ["random", "sobol"])
def test_fewer_samples_are_the_first_of_more(name: str) -> None:
    whole = sample_set(name, 4096, seed=6, pixel=(2, 9))
    for count in COUNTS:
        assert np.array_equal(whole[:count], sample_set(name, count, seed=6, pixel=(2, 9)))


@pytest.mark.parametrize("count", COUNTS)
def test_fewer_samples_of_bluenoise_are_the_first_of_more_that_share_a_tile(count: int) -> None:
    # Places in the pixel are; of other dimensions the first power of two has the same points in the same order.
    power = 1 << (count.bit_length() - 1)
    few, more, twice = (sample_set("bluenoise", n, seed=6, pixel=(2, 9)) for n in (count, 2 * power - 1, 2 * power))
    assert np.array_equal(more[:count, :TIME], few[:, :TIME])
    assert np.array_equal(more[:power], few[:power])
    if power < bluenoise.LEVELS[-1]:
        assert not np.isin(twice[:count], few).any()
    else:
        assert np.array_equal(twice[:count, :TIME], few[:, :TIME])


def in_cells(name: str, points: FloatArray) -> FloatArray:
    """Return sets with each sample's place in its pixel counted from its stratum's corner in units of its sides."""
    if name not in ("jittered", "multijittered"):
        return points
    x0, x1, y0, y1 = np.array(strata(points.shape[1])).T
    out = points.copy()
    out[..., X], out[..., Y] = (points[..., X] - x0) / (x1 - x0), (points[..., Y] - y0) / (y1 - y0)
    return np.clip(out, 0.0, 1.0 - 2.0**-53)


@pytest.mark.parametrize("name", DRAWN)
@pytest.mark.parametrize("count", [1, 5, 7, 16])
def test_every_sample_is_uniform_in_every_dimension_and_pair(name: str, count: int) -> None:
    # Each index by itself, so that draws are independent: strata would otherwise hide what is uneven.
    points = in_cells(name, draws(name, count, seed=4))
    fine = (points * 64).astype(int).reshape(len(points), -1)
    excess = excess_of(name, len(points))
    assert_chance(uniform_p_values(fine, 64, excess), f"{name}, 64 intervals of (index, dimension)")
    coarse = (points * 8).astype(int)
    for a, b in itertools.combinations(range(DIMENSIONS), 2):
        p = uniform_p_values(coarse[..., a] * 8 + coarse[..., b], 64, 0.0 if count in bluenoise.LEVELS else excess)
        assert_chance(1.0 - (1.0 - p) ** (DIMENSIONS * (DIMENSIONS - 1) / 2), f"{name}, 8 x 8 cells of {a} and {b}")


@pytest.mark.parametrize("name", DRAWN)
@pytest.mark.parametrize("count", [7, 16])
def test_all_samples_together_are_uniform_in_every_dimension_and_pair(name: str, count: int) -> None:
    # Strata make the counts more even than chance would, and the test the safer.
    points = draws(name, count, seed=5).reshape(-1, DIMENSIONS)
    excess = excess_of(name, len(points) // count)
    assert_chance(uniform_p_values((points * 64).astype(int), 64, excess), f"{name}, 64 intervals")
    coarse = (points * 12).astype(int)
    pairs = [coarse[:, a] * 12 + coarse[:, b] for a, b in itertools.combinations(range(DIMENSIONS), 2)]
    assert_chance(uniform_p_values(np.stack(pairs, axis=1), 144, excess), f"{name}, 12 x 12 cells of pairs")


@pytest.mark.parametrize("name", ORDERED)
@pytest.mark.parametrize("count", [2, 3, 4, 5, 7, 11, 16, 17])
def test_orders_of_other_dimensions_are_random_in_themselves_and_to_each_other(name: str, count: int) -> None:
    points = sets(name, count, seed=12)
    orders = [np.broadcast_to(np.arange(count), points.shape[:2])]
    orders += [np.floor(points[..., d] * count).astype(int) for d in (TIME, WAVELENGTH)]
    orders += [strata_numbers(points[..., [d, d + 1]]) for d in PAIRS]
    p_values = []
    for a, b in itertools.combinations(orders, 2):
        table = np.bincount((a * count + b).ravel(), minlength=count * count)
        # The covariance of a random permutation's matrix is (I - J/N) x (I - J/N) / (N - 1).
        statistic = ((table - len(points) / count) ** 2).sum() * (count - 1) / len(points)
        p_values.append(stats.chi2.sf(statistic, (count - 1) ** 2))
    assert_chance(np.array(p_values), f"{name}, pairs of orders of {count}")


def correlation_p_values(
    a: FloatArray, b: FloatArray, *, same: bool = False, arranged: bool = False, excess: float = 0.0
) -> FloatArray:
    """Return p-values of no correlation of any dimension of sets `a` with any of `b`, by samples and by pixel means.

    One number per pair of pixels, whose own spread is the measure: samples of a pixel need not be independent.
    `arranged` leaves out the pixel means of places in the pixel against those of light points. `excess` is by what
    share the variance of the products' mean is larger than chance has it.
    """
    out = []
    for means in (False, True):
        x, y = (s.mean(axis=1, keepdims=True) if means else s for s in (a, b))
        x, y = x - x.mean(axis=0), y - y.mean(axis=0)  # of each index by itself: the strata's places go
        products = np.einsum("pka,pkb->pab", x, y)
        spread = products.std(axis=0)
        told = spread > 1e-9  # what is the same in all pixels correlates with nothing
        if same:
            told &= ~np.eye(DIMENSIONS, dtype=bool)
        if arranged and means:
            told[X : Y + 1, LIGHT : LIGHT + 2] = told[LIGHT : LIGHT + 2, X : Y + 1] = False
        z = products.mean(axis=0)[told] / spread[told] * np.sqrt(len(products))
        out.append(2.0 * stats.norm.sf(np.abs(z) / np.sqrt(1.0 + excess)))
    return np.concatenate(out)


@pytest.mark.parametrize(
    ("name", "count"),
    [(n, c) for n in NAMES for c in (1, 4, 5) if n in DRAWN or c > 1],  # else all in the middle of everything
)
def test_neighbouring_pixels_seeds_frames_and_dimensions_are_uncorrelated(name: str, count: int) -> None:
    if name == "bluenoise":
        # Over seeds: within a picture all dimensions have one tile, which matches itself at some displacement.
        seeds = np.arange(PIXELS)
        here = seed_sets(name, count, seeds)
        pairs = {
            "right": (here, seed_sets(name, count, seeds, shift=(REACH + 1, 0))),
            "below": (here, seed_sets(name, count, seeds, shift=(0, REACH + 1))),
            "across": (here, seed_sets(name, count, seeds, shift=(REACH + 1, REACH + 1))),
            "seed": (here, seed_sets(name, count, seeds + PIXELS)),
            "next seed": (here[:-1], here[1:]),
            "frame": (here, seed_sets(name, count, seeds, frame=1)),
            "seed and frame": (here[1:], seed_sets(name, count, seeds[:-1], frame=1)),
            "seed's upper half": (here, seed_sets(name, count, seeds + 2**32)),
        }
    else:
        here = sets(name, count, seed=1)
        picture = here.reshape(-1, SIDE, count, DIMENSIONS)
        pairs = {
            "right": (picture[:, :-1], picture[:, 1:]),
            "below": (picture[:-1], picture[1:]),
            "across": (picture[:-1, :-1], picture[1:, 1:]),
            "seed": (here, sets(name, count, seed=2)),
            "frame": (here, sets(name, count, seed=1, frame=1)),
            "seed and frame": (sets(name, count, seed=0, frame=1), here),
            "seed's upper half": (here, sets(name, count, seed=1 + 2**32)),
        }
    # Pairs of places in a tile of keys are SIDE^2, or twice as many where columns are swapped with rows.
    in_tile = ("right", "below", "across") if name == "bluenoise" else ()
    p_values = []
    for which, pair in pairs.items():
        excess = PIXELS / (2 * bluenoise.SIDE**2) if which in in_tile else 0.0
        p_values.append(correlation_p_values(*(s.reshape(-1, count, DIMENSIONS) for s in pair), excess=excess))
    # What bluenoise arranges is a pixel's set against its light's; how little that says is in `test_bluenoise`.
    p_values.append(correlation_p_values(here, here, same=True, arranged=name == "bluenoise"))
    assert_chance(np.concatenate(p_values), name)


@pytest.mark.parametrize("name", DRAWN)
@pytest.mark.parametrize("count", [16, 64])
def test_unrelated_dimensions_of_a_set_meet_by_chance(name: str, count: int) -> None:
    # Halves against halves: the sum over a set of the signs' products is +-N if one order serves both dimensions. Its
    # mean square is N by chance, and 2 N where a shuffled sequence gives neighbours, two by two, to both halves.
    signs = np.where(draws(name, count, 1000, seed=21) < 0.5, -1.0, 1.0)
    squares = (np.einsum("pka,pkb->pab", signs, signs) ** 2).mean(axis=0)
    group = np.array([0, 0, 0, 1, 1, 2, 2, 3, 4, 4])
    unrelated = group[:, None] != group
    assert unrelated.sum() == DIMENSIONS**2 - (9 + 4 + 4 + 1 + 4)
    assert squares[unrelated].max() < 3.0 * count
    assert squares[unrelated].max() > 0.5 * count


def integrands(points: FloatArray) -> FloatArray:
    """Return the means over each set of x, y, x y and two half planes, (pixels, 5); `INTEGRALS` is their truth."""
    x, y = points[..., X], points[..., Y]
    values = [x, y, x * y, x + 0.37 * y < 0.6, 0.2 * x - y < -0.35]
    return np.stack([v.mean(axis=1) for v in values], axis=1)


# Both half planes' borders leave the square through opposite sides: the area is where they are halfway.
INTEGRALS = np.array([0.5, 0.5, 0.25, 0.6 - 0.37 / 2, 1.0 - 0.35 - 0.2 / 2])


@pytest.mark.parametrize("name", DRAWN)
def test_no_count_loses_samples_or_is_biased(name: str) -> None:
    worst = []
    for count in range(1, 21):
        means = integrands(draws(name, count, 4000, seed=count))
        error = means.std(axis=0, ddof=1) / np.sqrt(len(means))
        assert (error > 0.0).all()
        worst.append(np.abs(means.mean(axis=0) - INTEGRALS) / error)
    assert np.max(worst) < 4.0, f"count {np.argmax(np.max(worst, axis=1)) + 1}: {np.max(worst):.2f} standard errors"


@pytest.mark.parametrize("count", COUNTS)
def test_a_grid_of_any_count_integrates_bilinear_functions_exactly(count: int) -> None:
    # The midpoint rule in each row, and over rows weighted by their heights.
    np.testing.assert_allclose(integrands(sample_set("grid", count)[None])[0, :3], INTEGRALS[:3], rtol=0, atol=1e-15)


def test_reseed_never_keeps_the_pattern_of_frame_zero() -> None:
    assert [pattern_frame("never", 7), pattern_frame("frame", 7)] == [0, 7]


def test_a_sampler_that_does_not_exist_says_which_do() -> None:
    message = (
        r"^unknown sampler 'sobel'; did you mean 'sobol'\? "
        r"known: bluenoise, center, grid, jittered, multijittered, random, sobol$"
    )
    for call in (sampler_code, lambda name: sample_set(name, 4)):
        with pytest.raises(InputError, match=message):
            call("sobel")
