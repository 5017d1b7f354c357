"""Laws of the sample patterns, over every sampler and awkward counts."""

import itertools

import numpy as np
import pytest
from scipy import stats

from aliasbench.renderers.sampling.hashing import SHARED
from aliasbench.renderers.sampling.patterns import SAMPLERS, pattern_frame, sample_set, sampler_code
from aliasbench.scenes.errors import NotAvailableError

COUNTS = (1, 2, 3, 4, 5, 7, 8, 11, 16, 17, 64, 97, 256)


def strata(count: int) -> list[tuple[float, float, float, float]]:
    """The documented cells (x0, x1, y0, y1), row by row: round(sqrt N) rows, row i of height n_i / N."""
    rows = round(np.sqrt(count))
    ends = [i * count // rows for i in range(rows + 1)]
    cells = []
    for first, after in itertools.pairwise(ends):
        n = after - first
        cells += [(k / n, (k + 1) / n, first / count, after / count) for k in range(n)]
    return cells


@pytest.mark.parametrize("name", SAMPLERS)
@pytest.mark.parametrize("count", COUNTS)
def test_all_numbers_lie_in_the_unit_interval(name: str, count: int) -> None:
    points = sample_set(name, count, seed=5)
    assert points.shape == (count, 7)
    assert np.all((points >= 0.0) & (points < 1.0))


@pytest.mark.parametrize("count", COUNTS)
def test_strata_have_equal_area_and_one_sample_each(count: int) -> None:
    cells = strata(count)
    assert len(cells) == count
    assert np.allclose([(x1 - x0) * (y1 - y0) for x0, x1, y0, y1 in cells], 1 / count, rtol=1e-12)
    jittered = sample_set("jittered", count, seed=9, pixel=(3, 4))
    grid = sample_set("grid", count)
    for (x0, x1, y0, y1), (x, y), (gx, gy) in zip(cells, jittered[:, :2], grid[:, :2], strict=True):
        assert x0 <= x < x1
        assert y0 <= y < y1
        assert gx == pytest.approx((x0 + x1) / 2, abs=1e-15)
        assert gy == pytest.approx((y0 + y1) / 2, abs=1e-15)


@pytest.mark.parametrize("name", ["center", "grid", "jittered"])
@pytest.mark.parametrize("count", COUNTS)
def test_times_are_stratified(name: str, count: int) -> None:
    times = sample_set(name, count, seed=2, pixel=(8, 1))[:, 2]
    assert np.array_equal(np.sort(np.floor(times * count)), np.arange(count))


@pytest.mark.parametrize("dimension", [3, 5])
@pytest.mark.parametrize("count", COUNTS)
def test_lens_and_light_points_fill_every_stratum_once(dimension: int, count: int) -> None:
    points = sample_set("jittered", count, seed=2, pixel=(8, 1))[:, dimension : dimension + 2]
    for x0, x1, y0, y1 in strata(count):
        inside = (points[:, 0] >= x0) & (points[:, 0] < x1) & (points[:, 1] >= y0) & (points[:, 1] < y1)
        assert inside.sum() == 1


def test_one_centred_sample_is_the_middle_of_everything() -> None:
    assert np.array_equal(sample_set("center", 1, seed=77), np.full((1, 7), 0.5))
    assert np.array_equal(sample_set("grid", 1, seed=77), np.full((1, 7), 0.5))


@pytest.mark.parametrize("name", ["random", "jittered"])
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


@pytest.mark.parametrize("name", ["random", "jittered"])
def test_numbers_are_uniform_in_every_dimension_and_pair(name: str) -> None:
    points = np.concatenate([sample_set(name, 16, seed=4, pixel=(i, j)) for i in range(40) for j in range(40)])
    # 7 dimensions and 21 pairs: a p-value under 1e-5 in any is no chance (fixed seed, so this never flickers).
    for d in range(7):
        counts = np.bincount((points[:, d] * 64).astype(int), minlength=64)
        assert stats.chisquare(counts).pvalue > 1e-5
        for e in range(d + 1, 7):
            cells = (points[:, d] * 12).astype(int) * 12 + (points[:, e] * 12).astype(int)
            assert stats.chisquare(np.bincount(cells, minlength=144)).pvalue > 1e-5


def test_neighbouring_pixels_seeds_and_frames_are_uncorrelated() -> None:
    n = 64
    grid = np.array([[sample_set("random", 4, seed=1, pixel=(i, j)) for i in range(n)] for j in range(n)])
    seeds = np.array([sample_set("random", 4, seed=s) for s in range(n * n)])
    frames = np.array([sample_set("random", 4, frame=f) for f in range(n * n)])
    for a, b in (
        (grid[:, :-1], grid[:, 1:]),
        (grid[:-1], grid[1:]),
        (seeds[:-1], seeds[1:]),
        (frames[:-1], frames[1:]),
    ):
        for d in range(7):
            r = np.corrcoef(a[..., d].ravel(), b[..., d].ravel())[0, 1]
            assert abs(r) < 4.5 / np.sqrt(a[..., d].size)


def test_reseed_never_keeps_the_pattern_of_frame_zero() -> None:
    assert [pattern_frame("never", 7), pattern_frame("frame", 7)] == [0, 7]


def test_a_sampler_that_is_not_there_yet_says_what_is() -> None:
    with pytest.raises(NotAvailableError, match=r"sampler=sobol is not available yet; available: center, grid"):
        sampler_code("sobol")
