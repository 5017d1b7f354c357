"""Laws of the blue-noise sampler, and its purpose in a model of a penumbra."""

import itertools
import math
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage, stats

from aliasbench.renderers.sampling import level_bluenoise, make_bluenoise
from aliasbench.renderers.sampling.bluenoise import (
    DATA,
    EXCESS,
    FIELDS,
    LEVEL,
    LEVELS,
    OWN,
    SIDE,
    WORDS,
    Tile,
    bluenoise_set,
    bluenoise_tile,
    fill_pixel,
    from_planes,
    tile_offset,
    tile_order,
    tile_words,
    to_planes,
)
from aliasbench.renderers.sampling.hashing import frame_key
from aliasbench.renderers.sampling.sobol import WordArray, sobol_tables
from aliasbench.scenes.model import FloatArray

COUNTS = (1, 2, 3, 4, 5, 7, 8, 10, 16, 17, 32, 64)
SIZE = 2 * SIDE
SLOPES = (0.06, 0.1, 0.16)  # penumbrae of 17, 10 and 6 pixels
ANGLES_DEG = (21.6, 45.0, 111.6)
DRAWS = 50_000


@njit(cache=True)
def _picture(tables: WordArray, tile: Tile, count: int, start: int, size: int, pair: int) -> FloatArray:
    out = np.empty((size, size, count, 2))
    for row in range(size):
        for column in range(size):
            fill_pixel(tables, tile, count, start, column, row, pair, out[row, column])
    return out


def picture(tile: Tile, count: int, *, seed: int, pair: int, size: int = SIZE) -> FloatArray:
    """Points (row, column, sample, 2) of all pixels of a square picture."""
    points: FloatArray = _picture(sobol_tables(), tile, count, int(frame_key(seed, 0)), size, pair)
    return points


@njit(cache=True)
def _seeds(
    tables: WordArray, tile: Tile, count: int, starts: NDArray[np.int64], column: int, row: int, out: FloatArray
) -> None:
    points = np.empty((count, 2))  # contiguous, and all arguments of the types that `_picture` compiles it for
    for seed in range(len(out)):
        for pair in range(3):
            fill_pixel(tables, tile, count, starts[seed], column, row, pair, points)
            for k in range(count):
                out[seed, k, 2 * pair], out[seed, k, 2 * pair + 1] = points[k, 0], points[k, 1]


@cache
def one_pixel(count: int) -> FloatArray:
    """Points (DRAWS, sample, 6) of one pixel under many seeds: x, y, u, v, and those of the third pair."""
    out = np.empty((DRAWS, count, 6))
    starts = np.array([frame_key(seed, 0) for seed in range(DRAWS)], np.int64)
    _seeds(sobol_tables(), bluenoise_tile(count), count, starts, 5, 9, out)
    return out


@cache
def seeds_by_orientation() -> tuple[int, ...]:
    """The first seed that has each orientation of the pixel's tile."""
    turns = [tile_offset(int(frame_key(s, 0)), 0, SIDE)[2] for s in range(100)]
    return tuple(turns.index(turn) for turn in range(8))


@cache
def random_tile(seed: int) -> Tile:
    """A tile of keys as `make_bluenoise` has them before it starts."""
    fields = np.random.default_rng(seed).integers(0, 1 << 16, (SIDE * SIDE, FIELDS), dtype=np.uint16)
    fields[:, 4:-1] &= np.uint16(OWN)
    words: Tile = tile_words(fields).reshape(SIDE, SIDE, WORDS)
    words.setflags(write=False)  # as the sampler's own are, which is a type of its own to the compiler
    return words


def half_plane_area(normal: FloatArray, slope: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """P(n.l - a.x < t) for l and x uniform over centred unit squares: a sum of four independent uniform numbers.

    By inclusion and exclusion over the signs of the widths w_k: sum of prod(s) (t + s.w / 2)_+^4 / (4! prod w).
    """
    widths = np.abs(np.concatenate([normal, slope]))
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 4)).reshape(4, -1)

    def area(t: FloatArray) -> FloatArray:
        reach = np.maximum(0.0, t[..., None] + 0.5 * (widths @ signs)) ** 4
        return np.asarray((reach * signs.prod(axis=0)).sum(axis=-1) / (24.0 * widths.prod()))

    return area


def penumbra_errors(tile: Callable[[int], Tile], count: int, angle_deg: float, slope: float, seed: int) -> FloatArray:
    """Errors of a picture of nothing but penumbrae whose edges have one direction.

    The lit part of the light is n.l < t, where t = t0 + a.p and p is the whole place in the picture.
    """
    normal = np.array([math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))])
    a = slope * normal
    half = 0.5 * float(np.abs(normal).sum() + np.abs(a).sum())
    row, column = np.mgrid[0:SIZE, 0:SIZE]
    first = np.random.default_rng(seed).uniform(0.0, 2.0 * half)
    t = (first + a[0] * column + a[1] * row) % (2.0 * half) - half
    place = picture(tile(seed), count, seed=seed, pair=0) - 0.5
    light = picture(tile(seed), count, seed=seed, pair=1) - 0.5
    lit = light @ normal - place @ a < t[:, :, None]
    return np.asarray(lit.mean(axis=2) - half_plane_area(normal, a)(t))


def blue_ratio(errors: FloatArray) -> float:
    """Q of METRICS.md section 6, of errors whose expectation is 0."""
    blurred = ndimage.gaussian_filter(errors, 1.0, mode="wrap", truncate=6.0)
    impulse = np.zeros((33, 33))
    impulse[16, 16] = 1.0
    gain = np.square(ndimage.gaussian_filter(impulse, 1.0, truncate=6.0)).sum()
    return float(np.square(blurred).mean() / (np.square(errors).mean() * gain))


@cache
def penumbra(count: int, arranged: bool) -> tuple[float, float]:
    """(Q, RMSE) over angles and slopes, two seeds each."""
    errors = [
        penumbra_errors((lambda _: bluenoise_tile(count)) if arranged else random_tile, count, angle, slope, seed)
        for angle in ANGLES_DEG
        for slope in SLOPES
        for seed in (1, 2)
    ]
    return float(np.mean([blue_ratio(e) for e in errors])), float(np.sqrt(np.mean(np.square(errors))))


def test_the_area_beside_an_edge_is_that_of_many_points() -> None:
    rng = np.random.default_rng(0)
    normal, slope = np.array([0.9, 0.436]), np.array([0.09, 0.0436])
    n = 400_000
    y = (rng.random((n, 2)) - 0.5) @ normal - (rng.random((n, 2)) - 0.5) @ slope
    t = np.linspace(-0.7, 0.7, 9)
    exact = half_plane_area(normal, slope)(t)
    assert np.all(np.abs((y[:, None] < t).mean(axis=0) - exact) <= 5.0 * np.sqrt(exact * (1 - exact) / n) + 1e-12)


@pytest.mark.parametrize(("count", "limit"), [(1, 0.4), (2, 0.5), (4, 0.48), (8, 0.52), (16, 0.57)])
def test_errors_in_penumbrae_are_blue(count: int, limit: float) -> None:
    """White noise has 1, with a standard error of about .02 for one picture of 128^2 pixels and .005 for all."""
    ratio, _ = penumbra(count, arranged=True)
    print(f"Q {ratio:.3f} at {count}")
    assert 0.0 < ratio <= limit


@pytest.mark.parametrize("count", [1, 4, 16])
def test_errors_of_random_keys_are_white(count: int) -> None:
    ratio, _ = penumbra(count, arranged=False)
    assert 0.93 <= ratio <= 1.07


@pytest.mark.parametrize("count", [3, 5, 10, 32])
def test_other_counts_are_not_worse_than_white(count: int) -> None:
    ratio, _ = penumbra(count, arranged=True)
    print(f"Q {ratio:.3f} at {count}")
    assert ratio <= 0.85


@pytest.mark.parametrize("count", [1, 2, 4, 8, 10, 16, 32])
def test_the_size_of_errors_is_that_of_random_keys(count: int) -> None:
    _, arranged = penumbra(count, arranged=True)
    _, independent = penumbra(count, arranged=False)
    assert arranged == pytest.approx(independent, rel=0.03)


@pytest.mark.parametrize("pair", [0, 1, 2])
@pytest.mark.parametrize("count", [2, 4, 8, 16, 32])
def test_points_are_a_net(count: int, pair: int) -> None:
    """Scrambled Sobol points of two dimensions, in any orientation: one in each elementary interval of area 1 / N.

    So are the first 2, 4, ... places in the pixel.
    """
    pictures = [picture(bluenoise_tile(count), count, seed=s, pair=pair, size=8) for s in seeds_by_orientation()]
    points = np.stack(pictures).reshape(-1, count, 2)
    for first in (points[:, : 1 << k] for k in range(1, int(math.log2(count)) + 1)) if pair == 0 else (points,):
        bits = int(math.log2(first.shape[1]))
        for m in range(bits + 1):
            cell = np.floor(first[..., 0] * 2**m) * 2 ** (bits - m) + np.floor(first[..., 1] * 2 ** (bits - m))
            assert np.array_equal(np.sort(cell, axis=1), np.broadcast_to(np.arange(2**bits), cell.shape))


@pytest.mark.parametrize("count", [4, 16])
def test_errors_are_blue_in_every_orientation(count: int) -> None:
    """Had an orientation the light the other way than the pixel, errors of 16 samples would be white in it."""
    for seed in seeds_by_orientation():
        found = [penumbra_errors(lambda _: bluenoise_tile(count), count, a, 0.1, seed) for a in ANGLES_DEG]
        assert np.mean([blue_ratio(e) for e in found]) <= 0.6


@pytest.mark.parametrize("count", [1, 4, 5, 16])
def test_coordinates_and_products_that_an_orientation_turns_have_no_bias(count: int) -> None:
    """Over a whole tile in all orientations only the bits below the first 8 are left to chance."""
    seeds = seeds_by_orientation()
    points = [[picture(bluenoise_tile(count), count, seed=s, pair=p, size=SIDE) - 0.5 for s in seeds] for p in (0, 1)]
    (x, y), (u, v) = (np.moveaxis(np.array(p), -1, 0) for p in points)
    # A product with a number below 1/2 varies less.
    deviation = 2.0**-8 / math.sqrt(12.0 * x.size / count)
    for value in (x, y, u, v, x * y, u * v, x * v, y * u):
        assert abs(value.mean()) < 5.0 * deviation
    # One orientation alone has one.
    assert max(abs(p.mean()) for pair in points for one in pair for p in np.moveaxis(one, -1, 0)) > 5.0 * deviation


@pytest.mark.parametrize("count", COUNTS)
def test_the_second_pairs_order_permutes_and_keeps_the_first_block(count: int) -> None:
    block = 2 ** int(math.log2(count))
    seen = set()
    for key in range(40):
        order = [tile_order(k, count, np.uint64(key)) for k in range(count)]
        assert sorted(order) == list(range(count))
        assert sorted(order[:block]) == list(range(block))
        seen.add(tuple(order))
    assert len(seen) == 1 if count == 1 else len(seen) > 1


@pytest.mark.parametrize("count", [1, 2, 4, 10, 16])
def test_points_of_a_pixel_are_uniform_over_seeds(count: int) -> None:
    """Chi-square of each sample in cells of every pair, and of what is below the 8 bits that a tile fixes.

    Of many more seeds than the tile has places, yet only samples beyond a level have room for its unevenness.
    """
    assert DRAWS > 10 * SIDE**2
    points = one_pixel(count)
    cells = np.floor(points * 8.0).astype(int)
    p_values = []
    for a, b in itertools.combinations(range(6), 2):
        for k in range(count):
            room = 1.0 + (0.0 if count in LEVELS else EXCESS * DRAWS / SIDE**2)
            counts = np.bincount(8 * cells[:, k, a] + cells[:, k, b], minlength=64)
            p_values.append(stats.chi2.sf(stats.chisquare(counts).statistic / room, 63))
    fine = np.floor(points * 4096.0).astype(int) % 16
    p_values += [stats.chisquare(np.bincount(fine[..., d].ravel(), minlength=16)).pvalue for d in range(6)]
    assert min(p_values) > 1e-3 / len(p_values)


@pytest.mark.parametrize("count", [1, 2, 4, 8, 16])
def test_means_of_arranged_pairs_hardly_depend_on_each_other(count: int) -> None:
    """A sample's place says nothing of its light point; means of sets may, as far as annealing gains by it.

    An edge's variance is changed by at most 2 |a| of their correlation, in which a border of 4 pixels has |a| = 1/4.
    """
    points = one_pixel(count)
    chance = 5.0 / math.sqrt(DRAWS)
    means = np.corrcoef(points.mean(axis=1).T)
    assert np.abs(means[:2, 2:4]).max() <= 0.1 + chance
    assert np.abs(means[:4, 4:]).max() <= chance
    for k in range(count):
        # Twice chance: cells of an eighth are level, not what is in them.
        assert np.abs(np.corrcoef(points[:, k].T)[:2, 2:]).max() <= 2.0 * chance


@pytest.mark.parametrize("count", LEVELS)
def test_tiles_are_level(count: int) -> None:
    with np.load(DATA) as data:
        fields = from_planes(data[f"level_{count}"]).astype(np.int64)
    _, counts = level_bluenoise.tile_counts(sobol_tables(), fields, count)
    excess = counts - level_bluenoise.even_counts()
    assert np.abs(excess).max() <= LEVEL
    assert np.sqrt(np.square(excess).mean()) <= 1.5


def test_classes_of_cells_are_what_the_orientations_exchange() -> None:
    """Orbits under all symmetries of the square, done to both points at once, have a slot each, and all points."""

    def slots(x: int, y: int, u: int, v: int) -> NDArray[np.int64]:
        out = np.empty(level_bluenoise.KINDS, np.int64)
        level_bluenoise.fill_slots(np.array([x, y, u, v]), out)
        return out

    members: dict[int, set[tuple[str, int, int]]] = {}
    last = level_bluenoise.CELLS * level_bluenoise.FINE - 1
    for x, y, u, v in np.random.default_rng(0).integers(0, last + 1, (20_000, 4)).tolist():
        found = slots(x, y, u, v)
        assert sorted(slots(last - x, y, last - u, v)) == sorted(found)
        assert sorted(slots(x, last - y, u, last - v)) == sorted(found)
        assert sorted(slots(y, x, v, u)) == sorted(found)
        names = ("xy", "uv", "xu", "yv", "xv", "yu")
        place = {"x": x, "y": y, "u": u, "v": v}
        cells = [(a + b, place[a] // level_bluenoise.FINE, place[b] // level_bluenoise.FINE) for a, b in names]
        cells += [(a, part, 0) for a, part in place.items()]
        for slot, cell in zip(found.tolist(), cells, strict=True):
            members.setdefault(slot, set()).add(cell)
    # 10 classes of (x, y), as many of (u, v), 32, 16, and half the parts of either pair
    assert len(members) == 10 + 10 + 32 + 16 + 32 + 32
    even = level_bluenoise.even_counts()
    for slot, cells in members.items():
        assert even[slot] == sum(SIDE**2 // 64 for _ in cells)
    assert even.sum() == level_bluenoise.KINDS * SIDE**2


@pytest.mark.parametrize("pair", [0, 1])
@pytest.mark.parametrize("count", LEVELS)
def test_what_offsets_cannot_change_is_small(count: int, pair: int) -> None:
    """The mean over a whole tile of a half plane's error, against that of random keys: 1 / SIDE of one pixel's."""
    points = picture(bluenoise_tile(count), count, seed=0, pair=pair, size=SIDE) - 0.5
    share = []
    for angle in np.linspace(0.1, math.pi, 24, endpoint=False):
        normal = np.array([math.cos(angle), math.sin(angle)])
        area = half_plane_area(normal, np.array([1e-3, 1e-3]))
        for t in (-0.3, 0.0, 0.25):
            errors = (points @ normal < t).mean(axis=2) - float(area(np.array(t)))
            share.append(errors.mean() / errors.std())
    bias = np.sqrt(np.mean(np.square(share))) * SIDE
    print(f"bias {bias:.2f} / SIDE at {count}, pair {pair}")
    assert 0.0 < bias <= 0.7


@pytest.mark.parametrize("pair", [0, 1])
def test_a_tile_of_single_points_fills_the_square_more_evenly_than_chance(pair: int) -> None:
    points = picture(bluenoise_tile(1), 1, seed=0, pair=pair, size=SIDE).reshape(-1, 2)
    counts = np.bincount(np.floor(points * 8.0).astype(int) @ (8, 1), minlength=64)
    assert stats.chisquare(counts).statistic / 63 < 0.6


@pytest.mark.parametrize("count", [1, 4, 16])
def test_errors_of_far_pixels_do_not_correlate(count: int) -> None:
    """Correlation of n pixels is 1 / sqrt(n) by chance; of 24 distances none above 4.5 of them."""
    errors = penumbra_errors(lambda _: bluenoise_tile(count), count, 45.0, 0.1, 7)
    first = errors / np.sqrt(np.square(errors).mean())
    for right, down in [(a, b) for a in (0, 12, 19, 27, 31) for b in (0, 13, 20, 26, 30) if a or b]:
        assert abs((first * np.roll(first, (down, right), (0, 1))).mean()) * SIDE <= 4.5


def test_pairs_from_the_third_have_their_own_places_in_the_tile() -> None:
    places = {group: [tile_offset(int(frame_key(s, 0)), group, SIDE) for s in range(200)] for group in range(4)}
    for group, values in places.items():
        columns, rows, turns = np.array(values).T
        assert np.bincount(turns, minlength=8).min() > 8  # of 25, with a deviation of 4.7
        assert columns.min() < 6
        assert columns.max() >= SIDE - 6
        assert abs(np.corrcoef(columns, rows)[0, 1]) < 0.3
        assert all(np.mean([a == b for a, b in zip(values, places[g], strict=True)]) < 0.05 for g in range(group))


@pytest.mark.parametrize("pair", [0, 1, 2])
def test_sets_depend_on_seed_frame_pixel_and_pair_alone(pair: int) -> None:
    one = bluenoise_set(16, seed=3, frame=2, pixel=(7, 4), pair=pair)
    assert np.array_equal(one, bluenoise_set(16, seed=3, frame=2, pixel=(7, 4), pair=pair))
    others = [
        bluenoise_set(16, seed=4, frame=2, pixel=(7, 4), pair=pair),
        bluenoise_set(16, seed=3, frame=3, pixel=(7, 4), pair=pair),
        bluenoise_set(16, seed=3, frame=2, pixel=(8, 4), pair=pair),
        bluenoise_set(16, seed=3, frame=2, pixel=(7 + SIDE, 4), pair=pair),
        bluenoise_set(16, seed=3, frame=2, pixel=(7, 4), pair=pair + 1),
    ]
    assert not any(np.array_equal(one, other) for other in others)
    # The same place of the tile: the same points up to what is scrambled anew.
    assert np.abs(others[3] - one).max() < 2.0**-8


def test_a_count_takes_the_tile_of_the_largest_level_below() -> None:
    for count, level in {1: 1, 2: 2, 3: 2, 4: 4, 7: 4, 8: 8, 10: 8, 31: 16, 32: 32, 64: 32, 1000: 32}.items():
        assert bluenoise_tile(count) is bluenoise_tile(level)
    assert len({bluenoise_tile(level).tobytes() for level in LEVELS}) == len(LEVELS)
    assert all(bluenoise_tile(n).shape == (SIDE, SIDE, WORDS) for n in LEVELS)
    assert not bluenoise_tile(1).flags.writeable


def test_the_data_file_is_small_and_has_the_levels() -> None:
    assert DATA.stat().st_size < 440_000
    with np.load(DATA) as data:
        assert set(data) == {f"level_{n}" for n in LEVELS} == {f"level_{n}" for n in make_bluenoise.PLANS}
        for name in data:
            fields = from_planes(data[name])
            assert fields.shape == (SIDE * SIDE, FIELDS)
            assert not (fields & ~make_bluenoise.MASKS.astype(np.uint16)).any()
            assert np.array_equal(to_planes(fields), data[name])


@pytest.mark.slow
def test_annealing_is_repeatable_and_makes_errors_blue() -> None:
    plan = make_bluenoise.Plan((0, 1, 2, 3), 4, 0.0, 12)
    one, again = (make_bluenoise.make_tile(1, plan) for _ in range(2))
    assert np.array_equal(one, again)
    words: NDArray[np.uint64] = tile_words(one)
    tile = words.reshape(SIDE, SIDE, WORDS)
    assert blue_ratio(penumbra_errors(lambda _: tile, 1, 45.0, 0.1, 1)) < 0.75
