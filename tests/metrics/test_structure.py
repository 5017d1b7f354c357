"""Noise, structure and bias: unbiased splits over seeds, on planted noise of known size."""

import math

import numpy as np
import pytest

from aliasbench.metrics.catalog import measure

SIDE = 66
PIXELS = 64 * 64


def test_squares_of_noise_and_structure_add_up_to_the_mean_square_error(make_scene, rgb):
    rng = np.random.default_rng(1)
    test, truth = rng.normal(size=(5, 2, 9, 8)), rng.normal(size=(2, 9, 8))
    scene = make_scene((8, 9))
    noise, structure, rmse = (measure(n, rgb(test), rgb(truth), scene=scene) for n in ("noise", "structure", "rmse"))
    assert noise.value**2 + structure.extras["square"] == pytest.approx(rmse.value**2, rel=1e-12)
    assert structure.extras["fraction"] == pytest.approx(structure.extras["square"] / rmse.value**2)


def test_structure_is_the_mean_product_of_different_seeds(make_scene, rgb):
    test = np.random.default_rng(2).normal(size=(4, 1, 10, 10))
    structure = measure(
        "structure", rgb(test), rgb(np.zeros((1, 10, 10))), scene=make_scene((10, 10)), filter_radius_px=0
    )
    pairs = [np.mean(test[a] * test[b]) for a in range(4) for b in range(a)]
    assert structure.extras["square"] == pytest.approx(np.mean(pairs), rel=1e-9)
    assert structure.value == pytest.approx(math.copysign(math.sqrt(abs(np.mean(pairs))), np.mean(pairs)), rel=1e-9)


def test_planted_noise_and_structure_are_found_each(make_scene, rgb):
    rng = np.random.default_rng(3)
    seeds, noise, static = 4, 0.1, 0.05
    pattern = static * rng.choice([-1.0, 1.0], size=(1, SIDE, SIDE))
    test = pattern + noise * rng.normal(size=(seeds, 1, SIDE, SIDE))
    truth = np.zeros((1, SIDE, SIDE))
    got = {n: measure(n, rgb(test), rgb(truth), scene=make_scene((SIDE, SIDE))) for n in ("noise", "structure")}
    # Relative standard deviation of a variance from (seeds - 1) PIXELS values: sqrt(2 / those), five of them.
    assert got["noise"].value ** 2 == pytest.approx(noise**2, rel=5 * math.sqrt(2 / (3 * PIXELS)))
    # Cross term of pattern and mean noise (2 static noise / sqrt(seeds)) and the noise pairs, over PIXELS.
    spread = math.hypot(2 * static * noise / math.sqrt(seeds), noise**2 * math.sqrt(2 / (seeds * (seeds - 1))))
    assert got["structure"].extras["square"] == pytest.approx(static**2, abs=5 * spread / math.sqrt(PIXELS))


def planted(rng, *, seeds, frames, static, moving, noise, fresh, shape=(64, 64)):
    """(seeds, frames, h, w): a still pattern, one that changes sign from frame to frame, and noise between seeds.

    Both patterns are -1 or 1 everywhere and cancel each other's products exactly: their squares are the truth.
    """
    still = np.ones(shape)
    still[::2] = -1.0
    restless = np.where(np.arange(frames) % 2 == 0, 1.0, -1.0)[:, None, None] * np.where(
        np.arange(shape[1]) % 2 == 0, 1.0, -1.0
    )
    own = rng.normal(size=(seeds, frames if fresh else 1, *shape))
    return static * still + moving * restless + noise * own


@pytest.mark.parametrize("shape", [(2, 1, 6, 7), (3, 5, 4, 9), (7, 2, 3, 3)])
@pytest.mark.parametrize("size", [1.0, 1e-120, 1e120])
def test_the_full_split_adds_up_and_is_made_of_products_of_different_seeds(make_scene, rgb, shape, size):
    test = size * np.random.default_rng(11).normal(size=shape)
    truth = np.zeros(shape[1:])
    scene = make_scene(shape[:1:-1])
    options = {"scene": scene, "filter_radius_px": 0.0}
    extras = measure("structure", rgb(test), rgb(truth), **options).extras
    pairs = [(a, b) for a in range(shape[0]) for b in range(a)]
    unit = test / size
    structure = np.mean([np.mean(unit[a] * unit[b]) for a, b in pairs])
    static = np.mean([np.mean(unit[a].mean(axis=0) * unit[b].mean(axis=0)) for a, b in pairs])
    # Squares of 1e-120 and 1e120 are still numbers; a sum of some hundred of them is off by a few ulp of the largest.
    parts = [float(extras[name]) / size**2 for name in ("static_square", "moving_square", "noise_square")]
    assert parts == pytest.approx([static, structure - static, np.mean(unit**2) - structure], abs=1e-13)
    assert sum(parts) == pytest.approx(np.mean(unit**2), rel=1e-13)
    assert float(extras["static"]) == pytest.approx(size * math.copysign(math.sqrt(abs(static)), static), rel=1e-6)
    if shape[1] == 1:
        assert (parts[1], extras["moving"]) == (0.0, None)
    else:
        moving = structure - static
        assert float(extras["moving"]) == pytest.approx(size * math.copysign(math.sqrt(abs(moving)), moving), rel=1e-6)


@pytest.mark.parametrize("fresh", [True, False])
@pytest.mark.parametrize(
    ("seeds", "frames", "static", "moving", "noise"),
    [(4, 6, 0.05, 0.03, 0.1), (2, 12, 0.0, 0.04, 0.2), (3, 2, 0.08, 0.0, 0.05), (2, 4, 0.0, 0.0, 0.3)],
)
def test_the_full_split_finds_what_was_planted(make_scene, rgb, fresh, seeds, frames, static, moving, noise):
    test = planted(
        np.random.default_rng(12), seeds=seeds, frames=frames, static=static, moving=moving, noise=noise, fresh=fresh
    )
    truth = np.zeros(test.shape[1:])
    scene, options = make_scene((64, 64)), {"filter_radius_px": 0.0}
    structure = measure("structure", rgb(test), rgb(truth), scene=scene, **options).extras
    shimmer = measure("shimmer", rgb(test), rgb(truth), scene=scene, **options)
    # Independent values of noise: of all frames, or of one. A mean product of a pattern of size p with the mean of the
    # seeds' noise has the standard deviation p noise / sqrt(seeds values), counted twice, and one of noise with noise
    # noise^2 sqrt(2 / (seeds (seeds - 1) values)); for the moving part both the frames' and the means' are subtracted.
    values = PIXELS * (frames if fresh else 1)
    cross = 2 * math.hypot(static, moving) * noise / math.sqrt(seeds)
    spread = math.hypot(cross, noise**2 * math.sqrt(2 / (seeds * (seeds - 1)))) / math.sqrt(values)
    assert structure["static_square"] == pytest.approx(static**2, abs=5 * spread)
    assert structure["moving_square"] == pytest.approx(moving**2, abs=5 * math.sqrt(2) * spread)
    # Relative standard deviation of a variance from (seeds - 1) values: sqrt(2 / those).
    close = 5 * math.sqrt(2 / ((seeds - 1) * values))
    assert structure["noise_square"] == pytest.approx(noise**2, rel=close)
    assert shimmer.extras["structured"] == structure["moving"]
    # Noise that all frames share does not shimmer; the variance of N fresh values (population) is 1 - 1 / N of it.
    share = noise**2 * (1 - 1 / frames) if fresh else 0.0
    assert shimmer.extras["noise_square"] == pytest.approx(share, rel=close, abs=5 * math.sqrt(2) * spread)
    assert shimmer.value**2 == pytest.approx(
        structure["moving_square"] + shimmer.extras["noise_square"], rel=1e-12, abs=1e-15
    )


def test_the_full_split_is_unbiased_where_noise_is_all_there_is(make_scene, rgb):
    rng = np.random.default_rng(13)
    scene, trials, frames = make_scene((8, 8)), 400, 3
    truth = np.zeros((frames, 8, 8))
    for fresh in (True, False):
        found = []
        for _ in range(trials):
            test = planted(rng, seeds=2, frames=frames, static=0.0, moving=0.0, noise=1.0, fresh=fresh, shape=(8, 8))
            extras = measure("structure", rgb(test), rgb(truth), scene=scene, filter_radius_px=0.0).extras
            found.append([extras["static_square"], extras["moving_square"]])
        mean, deviation = np.mean(found, axis=0), np.std(found, axis=0, ddof=1)
        # Five standard errors of the mean over trials; that of a moving part which is always 0 is rounding.
        assert np.all(np.abs(mean) <= 5 * deviation / math.sqrt(trials) + 1e-12)
        assert deviation[0] > 0.01


def test_shimmer_of_one_seed_says_nothing_of_noise(make_scene, rgb):
    pictures = np.random.default_rng(14).normal(size=(3, 8, 8))
    score = measure("shimmer", rgb(pictures), rgb(np.zeros((3, 8, 8))), scene=make_scene((8, 8)))
    assert "structured" not in score.extras


@pytest.mark.parametrize("seeds", [2, 3, 5, 7, 9])
def test_equal_seeds_have_no_noise_however_their_mean_is_rounded(make_scene, rgb, seeds):
    test = np.repeat(np.random.default_rng(10).uniform(size=(1, 2, 12, 12)), seeds, axis=0)
    noise = measure("noise", rgb(test), rgb(np.zeros((2, 12, 12))), scene=make_scene((12, 12)))
    assert (noise.value, noise.extras["deterministic"]) == (0.0, True)


def test_a_deterministic_renderer_is_all_structure(make_scene, rgb):
    test = np.repeat(np.random.default_rng(4).normal(size=(1, 1, 12, 12)), 2, axis=0)
    truth = np.zeros((1, 12, 12))
    scene = make_scene((12, 12))
    noise = measure("noise", rgb(test), rgb(truth), scene=scene)
    assert (noise.value, noise.extras["deterministic"], noise.extras["blue_ratio"]) == (0.0, True, None)
    structure = measure("structure", rgb(test), rgb(truth), scene=scene)
    assert structure.extras["fraction"] == pytest.approx(1.0)
    assert structure.value == pytest.approx(measure("rmse", rgb(test), rgb(truth), scene=scene).value)


def blue(make_scene, rgb, field):
    seeds = np.stack([field, -field])  # their mean is zero: the deviation is the field
    truth = np.zeros(field.shape)
    score = measure("noise", rgb(seeds), rgb(truth), scene=make_scene(field.shape[:0:-1]), filter_radius_px=0)
    return score.extras["blue_ratio"]


def test_blue_ratio_is_one_for_white_noise_and_as_derived_for_others(make_scene, rgb):
    white = np.random.default_rng(5).normal(size=(16, 64, 64))
    # The blurred field has 4 pi pixels to an independent value: 16 PIXELS / 12.6 of them, five standard deviations.
    assert blue(make_scene, rgb, white) == pytest.approx(1.0, rel=5 * math.sqrt(2 * 4 * math.pi / white.size))
    difference = white - np.roll(white, 1, axis=2)
    assert 1 - math.exp(-1 / 4) == pytest.approx(0.221199, abs=1e-6)
    assert blue(make_scene, rgb, difference) == pytest.approx(0.221199, rel=0.05)
    # The kernel is cut at 4 sigma: its sum of squares is the infinite one's within 1e-4.
    assert blue(make_scene, rgb, np.ones((1, 32, 32))) == pytest.approx(4 * math.pi, rel=1e-3)


def test_frame_correlation_tells_fixed_seeds_from_fresh_ones(make_scene, rgb):
    rng = np.random.default_rng(6)
    fixed = np.repeat(rng.normal(size=(3, 1, SIDE, SIDE)), 4, axis=1)
    fresh = rng.normal(size=fixed.shape)
    truth = np.zeros(fixed.shape[1:])
    scene = make_scene((SIDE, SIDE))
    assert measure("noise", rgb(fixed), rgb(truth), scene=scene).extras["frame_correlation"] == pytest.approx(1.0)
    # 8 PIXELS independent products (two of three seeds' deviations are independent), five standard deviations.
    correlation = measure("noise", rgb(fresh), rgb(truth), scene=scene).extras["frame_correlation"]
    assert abs(correlation) < 5 / math.sqrt(8 * PIXELS)


@pytest.mark.parametrize(
    ("c", "n0", "n1", "expected"),
    [(0.2, 4, 12, -0.06048), (0.05, 4, 60, -0.0381744), (0.9, 2, 14, 0.063), (0.5, 4, 12, 0.0)],
)
def test_a_pooled_pilot_is_biased_as_derived_and_a_discarded_one_is_not(make_scene, rgb, c, n0, n1, expected):
    assert n1 / (n0 + n1) * c * (1 - c) * (c ** (n0 - 1) - (1 - c) ** (n0 - 1)) == pytest.approx(expected, abs=1e-7)
    rng = np.random.default_rng(7)
    shape = (16, 1, 42, 42)
    pilot, rest = rng.binomial(n0, c, shape), rng.binomial(n1, c, shape)
    stopped = (pilot == 0) | (pilot == n0)
    pooled = np.where(stopped, pilot / n0, (pilot + rest) / (n0 + n1))
    truth = np.full(shape[1:], c)
    score = measure("bias", rgb(pooled), rgb(truth), scene=make_scene((42, 42)))
    # The estimate lies in [0, 1] about a mean near c: variance at most c (1 - c) / n0 + bias^2 over 16 * 1600 values.
    spread = math.sqrt((c * (1 - c) / n0 + expected**2) / (16 * 1600))
    assert score.value == pytest.approx(expected, abs=5 * spread)
    low, high = score.extras["interval"]
    assert low < score.value < high
    assert score.extras["by_coverage"][0]["pixels"] == 1600
    # A pixel's own bias squared, on average: B2.
    assert score.extras["square"] == pytest.approx(expected**2, abs=5 * (2 * abs(expected) + 0.02) * 5 * spread)
    discarded = measure("bias", rgb(rest / n1), rgb(truth), scene=make_scene((42, 42)))
    assert abs(discarded.value) < 5 * math.sqrt(c * (1 - c) / n1 / (16 * 1600))


def test_bias_that_cancels_over_the_picture_shows_by_coverage(make_scene, rgb):
    coverage = np.repeat(np.linspace(0.05, 0.95, 10)[None, :, None], 20, axis=2)
    antisymmetric = (0.5 - coverage) / 10
    noise = np.random.default_rng(8).normal(size=(8, 1, 10, 20)) * 1e-3
    score = measure(
        "bias", rgb(coverage + antisymmetric + noise), rgb(coverage), scene=make_scene((20, 10)), filter_radius_px=0
    )
    assert abs(score.value) < 5e-3 / math.sqrt(8 * 200)
    tenths = score.extras["by_coverage"]
    assert len(tenths) == 10
    assert tenths[0]["mean"] == pytest.approx(0.045, abs=5e-4)
    assert tenths[9]["mean"] == pytest.approx(-0.045, abs=5e-4)


def test_bias_needs_eight_seeds_or_a_deterministic_renderer(make_scene, rgb):
    rng = np.random.default_rng(9)
    truth = np.zeros((1, 8, 8))
    scene = make_scene((8, 8))
    few = measure("bias", rgb(rng.normal(size=(7, 1, 8, 8))), rgb(truth), scene=scene)
    assert (few.value, few.status) == (None, "needs_seeds")
    same = measure("bias", rgb(np.full((2, 1, 8, 8), 0.25)), rgb(truth), scene=scene)
    assert same.status == "deterministic"
    assert same.value == pytest.approx(0.25)
    assert (same.extras["t"], same.extras["interval"], same.extras["always_wrong_pixels"]) == (None, None, 36)
