"""Bias and variance over seeds by coverage: closed forms of two-stage sampling, and intervals that hold the truth."""

import math

import numpy as np
import pytest
from scipy import integrate, stats

from aliasbench.metrics.bias import variance_with_interval
from aliasbench.metrics.catalog import measure

BINS = 10


def two_stage_bias(c: np.ndarray, n0: int, n1: int) -> np.ndarray:
    return n1 / (n0 + n1) * c * (1 - c) * (c ** (n0 - 1) - (1 - c) ** (n0 - 1))


def two_stage(rng: np.random.Generator, c: np.ndarray, seeds: int, n0: int, n1: int) -> np.ndarray:
    """(seeds, *c.shape) pooled estimates: n0 samples, and n1 more unless all are equal."""
    pilot, rest = rng.binomial(n0, c, (seeds, *c.shape)), rng.binomial(n1, c, (seeds, *c.shape))
    return np.where((pilot == 0) | (pilot == n0), pilot / n0, (pilot + rest) / (n0 + n1))


def uniform_coverage(side: int) -> np.ndarray:
    """(1, side, side), every coverage alike often."""
    return ((np.arange(side * side) + 0.5) / (side * side)).reshape(1, side, side)


@pytest.mark.parametrize(("n0", "n1", "listed"), [(4, 12, 0.00186688), (2, 14, None), (4, 60, None), (8, 8, None)])
def test_a_pooled_pilots_bias_by_coverage_is_the_closed_form(make_scene, rgb, n0, n1, listed):
    square = integrate.quad(lambda c: two_stage_bias(c, n0, n1) ** 2, 0, 1)[0]
    assert integrate.quad(lambda c: two_stage_bias(c, n0, n1), 0, 1)[0] == pytest.approx(0.0, abs=1e-12)
    if listed is not None:
        assert square == pytest.approx(listed, abs=5e-9)
    # The same from the definition: every outcome of the pilot times its probability.
    for c in (0.05, 0.3, 0.7):
        k = np.arange(n0 + 1)
        value = np.where((k == 0) | (k == n0), k / n0, (k + n1 * c) / (n0 + n1))
        mean = float(stats.binom.pmf(k, n0, c) @ value)
        assert mean - c == pytest.approx(two_stage_bias(np.array(c), n0, n1), abs=1e-12)
    side, seeds = 90, 16
    c = uniform_coverage(side)
    pictures = two_stage(np.random.default_rng(n0 + n1), c, seeds, n0, n1)
    score = measure("bias", rgb(pictures), rgb(c), scene=make_scene((side, side)), filter_radius_px=0)
    spread = pictures.std(axis=0)
    values = side * side * seeds
    assert abs(score.value) < 5 * math.sqrt(np.mean(spread**2) / values)
    # Spread of B2: 4 b^2 s^2 of the cross terms and 2 s^4 / (seeds (seeds - 1)) of the pairs, over the pixels.
    b = two_stage_bias(c, n0, n1)
    pairs = 2 * spread**4 / (seeds * (seeds - 1))
    assert score.extras["square"] == pytest.approx(
        square, abs=5 * math.sqrt(np.mean(4 * b**2 * spread**2 / seeds + pairs) / (side * side))
    )
    assert score.extras["root"] == pytest.approx(math.sqrt(square), rel=0.1)
    assert len(score.extras["by_coverage"]) == BINS
    for k, tenth in enumerate(score.extras["by_coverage"]):
        inside = (c >= k / BINS) & (c < (k + 1) / BINS)
        assert tenth["pixels"] == inside.sum()
        assert tenth["mean"] == pytest.approx(
            b[inside].mean(), abs=5 * math.sqrt(np.mean(spread[inside] ** 2) / inside.sum() / seeds)
        )


def test_a_discarded_pilot_has_no_bias_at_any_coverage(make_scene, rgb):
    side, seeds, n1 = 90, 16, 12
    c = uniform_coverage(side)
    rest = np.random.default_rng(1).binomial(n1, c, (seeds, *c.shape)) / n1
    score = measure("bias", rgb(rest), rgb(c), scene=make_scene((side, side)), filter_radius_px=0)
    variance = c * (1 - c) / n1
    assert abs(score.value) < 5 * math.sqrt(variance.mean() / c.size / seeds)
    assert abs(score.extras["square"]) < 5 * math.sqrt(np.mean(2 * variance**2) / (seeds * (seeds - 1)) / c.size)
    for tenth in score.extras["by_coverage"]:
        # Within a tenth the variance is at most 1 / (4 n1).
        assert abs(tenth["mean"]) < 5 * math.sqrt(0.25 / n1 / tenth["pixels"] / seeds)


def test_random_samples_have_noise_of_a_sixth_over_n_and_no_structure(make_scene, rgb):
    side, seeds, n = 128, 4, 16
    c = uniform_coverage(side)
    pictures = np.random.default_rng(2).binomial(n, c, (seeds, *c.shape)) / n
    scene = make_scene((side, side))
    noise, structure = (
        measure(name, rgb(pictures), rgb(c), scene=scene, filter_radius_px=0) for name in ("noise", "structure")
    )
    # Mean of c (1 - c) / 16. The variance of 4 has one of 2 s^4 / 3 at most, since binomial tails are short on average:
    # relatively 0.8, as the mean of (c (1 - c))^2 is 1.2 times the square of the mean.
    assert noise.value**2 == pytest.approx(1 / 96, rel=5 * math.sqrt(0.8) / side)
    pairs = 2 / (seeds * (seeds - 1)) / 96**2 * 1.2
    assert abs(structure.extras["square"]) < 5 * math.sqrt(pairs) / side
    assert structure.extras["fraction"] == pytest.approx(0.0, abs=5 * math.sqrt(pairs) / side * 96)


def test_variance_by_coverage_is_that_of_the_seeds(make_scene, rgb):
    rng = np.random.default_rng(3)
    truth = rng.uniform(-0.2, 1.2, size=(3, 12, 17))
    pictures = truth + rng.normal(size=(9, *truth.shape)) * rng.choice([0.0, 0.1, 0.4], size=truth.shape)
    score = measure("bias", rgb(pictures), rgb(truth), scene=make_scene((17, 12)), filter_radius_px=0)
    error = pictures - truth
    variance = error.var(axis=0, ddof=1)
    assert score.extras["variance"] == pytest.approx(variance.mean(), rel=1e-12)
    assert score.extras["square"] == pytest.approx(np.mean(error.mean(axis=0) ** 2 - variance / 9), rel=1e-9)
    for k, tenth in enumerate(score.extras["by_coverage"]):
        inside = np.clip(np.floor(truth * BINS), 0, BINS - 1) == k
        assert tenth["variance"] == pytest.approx(variance[inside].mean(), rel=1e-12)
        assert tenth["mean"] == pytest.approx(error[:, inside].mean(), rel=1e-9)
        means = error[:, inside].mean(axis=1)
        half = stats.t.ppf(0.975, 8) * stats.sem(means)
        assert tenth["interval"] == pytest.approx([means.mean() - half, means.mean() + half], rel=1e-9)
        low, high = tenth["variance_interval"]
        assert low < tenth["variance"] < high


@pytest.mark.parametrize("seeds", [8, 16, 40])
@pytest.mark.parametrize("pattern", ["own", "shared"])
def test_intervals_of_bias_and_variance_hold_the_truth_at_every_coverage(make_scene, rgb, seeds, pattern):
    trials, columns = 120, 5
    rng = np.random.default_rng(seeds)
    truth = np.repeat(((np.arange(BINS) + 0.5) / BINS)[None, :, None], columns, axis=2)
    shift = 0.3 * (0.5 - truth)
    scene = make_scene((columns, BINS))
    held = np.zeros(2)
    for _ in range(trials):
        noise = rng.normal(size=(seeds, 1, BINS, columns if pattern == "own" else 1)) * 0.1
        score = measure("bias", rgb(truth + shift + noise), rgb(truth), scene=scene, filter_radius_px=0)
        for k, tenth in enumerate(score.extras["by_coverage"]):
            (low, high), (least, most) = tenth["interval"], tenth["variance_interval"]
            held += low <= shift[0, k, 0] <= high, least <= 0.01 <= most
    count = trials * BINS
    # Student's interval of a Gaussian mean is exact: five standard deviations of a binomial share about .95.
    assert held[0] / count == pytest.approx(0.95, abs=5 * math.sqrt(0.95 * 0.05 / count))
    assert held[1] / count > 0.90


def test_an_interval_of_the_variance_is_not_wide_without_need():
    # Of many independent pixels the log of the variance has a standard deviation of sqrt(2 / (pixels (seeds - 1))).
    seeds, pixels = 12, 4000
    noise = np.random.default_rng(5).normal(size=(seeds, pixels))
    squares = ((noise - noise.mean(axis=0)) ** 2).mean(axis=1)
    got = variance_with_interval(squares)
    low, high = got["variance_interval"]
    width = 2 * stats.t.ppf(0.975, seeds - 1) * math.sqrt(2 / (pixels * (seeds - 1)))
    # It is estimated from 12 seeds: known to 1 / sqrt(22) relatively, three of these.
    assert math.log(high / low) == pytest.approx(width, rel=3 / math.sqrt(22))
    assert variance_with_interval(np.zeros(8)) == {"variance": 0.0, "variance_interval": None}


@pytest.mark.parametrize("seeds", [2, 8, 9, 11, 23])
@pytest.mark.parametrize("offset", [0.1, 0.3, -0.7, 1e-9])
def test_equal_seeds_are_deterministic_however_their_mean_is_rounded(make_scene, rgb, seeds, offset):
    truth = np.full((1, 8, 8), 0.5)
    score = measure("bias", rgb(np.repeat(truth[None] + offset, seeds, axis=0)), rgb(truth), scene=make_scene((8, 8)))
    assert (score.status, score.value) == ("deterministic", pytest.approx(offset, rel=1e-6))
    keys = ("t", "interval", "variance", "variance_interval", "always_wrong_pixels")
    assert [score.extras[k] for k in keys] == [None, None, 0.0, None, 36]
    (tenth,) = score.extras["by_coverage"]
    assert [tenth[k] for k in keys[:4]] == [None, None, 0.0, None]


def test_a_feature_that_every_seed_misses_is_counted_among_noise(make_scene, rgb):
    rng = np.random.default_rng(6)
    truth = np.full((1, 20, 20), 0.25)
    pictures = truth + 0.1 * rng.normal(size=(9, 1, 20, 20))
    pictures[..., 5:8, 4:9] = 0.15  # missed: 15 pixels, -0.1 off with every seed
    pictures[..., 0, :] = truth[0, 0]  # right with every seed
    score = measure("bias", rgb(pictures), rgb(truth), scene=make_scene((20, 20)), filter_radius_px=0)
    assert (score.status, score.extras["always_wrong_pixels"]) == ("ok", 15)


def test_a_bias_below_the_references_floor_is_not_told(make_scene, rgb):
    truth = np.full((1, 8, 8), 0.5)
    pictures = np.repeat(truth[None] + 0.002, 8, axis=0)
    score = measure("bias", rgb(pictures), rgb(truth), scene=make_scene((8, 8)), reference_uncertainty=1e-3)
    assert (score.value, score.status) == (None, "below_reference_floor")
