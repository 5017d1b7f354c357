"""Moire: false lines of gratings under regular sampling, noise, and what is not counted."""

import math

import numpy as np
import pytest

from aliasbench.metrics.catalog import measure
from aliasbench.scenes.model import Facts, GratingFact

W = 128


def dirichlet(u, n):
    return math.sin(math.pi * u) / (n * math.sin(math.pi * u / n))


def grating(nu, gain, width=W, height=W):
    """Amplitude `gain`, nu cycles a pixel along x."""
    return np.repeat(gain * np.cos(2 * np.pi * nu * (np.arange(width) + 0.5))[None, None, :], height, axis=1)


def pair(nu, n, rgb, width=W, height=W):
    return rgb(grating(nu, dirichlet(nu, n), width, height)), rgb(grating(nu, np.sinc(nu), width, height))


@pytest.mark.parametrize(
    ("nu", "n", "expected"),
    [
        (17 / 16, 1, 1.0584463),
        (17 / 16, 2, 0.0395709),
        (17 / 16, 4, 0.00737800),
        (33 / 16, 2, 1.0252934),
        (33 / 16, 4, 0.0187227),
        (65 / 16, 4, 1.0092719),
    ],
)
def test_a_grating_comes_back_at_the_difference_frequency(make_scene, rgb, nu, n, expected):
    test, truth = pair(nu, n, rgb)
    assert abs(dirichlet(nu, n) - np.sinc(nu)) == pytest.approx(expected, abs=1e-7)
    scene = make_scene((W, W))
    peak = measure("moire_peak", test, truth, scene=scene, filter_radius_px=0.0)
    # The test multiplies by n/n regular samples' sum, exact to some ulp.
    assert peak.value == pytest.approx(expected, abs=1e-7)
    assert [abs(f) for f in peak.extras["cycles_per_px"]] == [1 / 16, 0.0]
    assert peak.extras["period_px"] == 16.0
    assert peak.extras["fisher_g"] == pytest.approx(1.0)
    assert peak.extras["p_value"] < 1e-100
    score = measure("moire", test, truth, scene=scene, filter_radius_px=0.0)
    assert score.value == pytest.approx(expected / math.sqrt(2), abs=1e-7)


def test_known_gratings_are_measured_over_whole_periods(make_scene, rgb):
    test, truth = pair(17 / 16, 1, rgb)
    scene = make_scene((W, W), facts=Facts(gratings=(GratingFact((17 / 16, 0.0)),)))
    score = measure("moire", test, truth, scene=scene)  # a border of one pixel leaves 126
    assert (score.status, score.extras["size"]) == ("ok", [112, 126])
    assert score.value == pytest.approx(0.7484345, abs=1e-7)


def test_a_known_line_of_the_scene_is_not_moire(make_scene, rgb):
    test, truth = pair(1 / 8, 1, rgb)
    unknown = measure("moire_peak", test, truth, scene=make_scene((W, W)), filter_radius_px=0.0)
    assert unknown.value == pytest.approx(1 - np.sinc(1 / 8), abs=1e-12)
    assert unknown.value == pytest.approx(0.0255046, abs=1e-7)
    scene = make_scene((W, W), facts=Facts(gratings=(GratingFact((1 / 8, 0.0)),)))
    assert measure("moire_peak", test, truth, scene=scene).value == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("seeds", "frames"), [(1, 2), (3, 1), (2, 5)])
def test_scores_of_several_seeds_and_frames_are_their_quadratic_means(make_scene, rgb, seeds, frames):
    rng = np.random.default_rng(seeds)
    truth = grating(1 / 8, 1.0, 66, 40)[0] + np.zeros((frames, 1, 1))
    test = truth + rng.normal(size=(seeds, frames, 40, 66)) * rng.uniform(size=(seeds, frames, 1, 1))
    scene = make_scene((66, 40), facts=Facts(gratings=(GratingFact((1 / 8, 0.0)),)))
    for name in ("moire", "moire_peak"):
        together = measure(name, rgb(test), rgb(truth), scene=scene)
        alone = [
            float(measure(name, rgb(test[s, t][None]), rgb(truth[t][None]), scene=scene).value)
            for s in range(seeds)
            for t in range(frames)
        ]
        assert together.value == pytest.approx(np.sqrt(np.mean(np.square(alone))), rel=1e-12)


def test_a_known_grating_without_whole_periods_is_windowed(make_scene, rgb):
    nu = 1 + 1 / (8 * math.sqrt(3))
    test, truth = pair(nu, 1, rgb)
    scene = make_scene((W, W), facts=Facts(gratings=(GratingFact((nu, 0.0)),)))
    score = measure("moire", test, truth, scene=scene)
    assert score.status == "windowed"
    assert score.value == pytest.approx((1 - np.sinc(nu)) / math.sqrt(2), rel=1e-3)
    # Neighbouring bins share a window's lines: the exact test does not hold.
    peak = measure("moire_peak", test, truth, scene=scene)
    assert (peak.status, peak.extras["p_value"], peak.extras["p_value_any"]) == ("windowed", None, None)


def test_at_nyquist_nothing_is_in_the_visible_band(make_scene, rgb):
    phases = (np.arange(64) + 0.5) / 64
    x = np.arange(W) + 0.5
    carrier = np.cos(2 * np.pi * (0.5 * x + phases[:, None]))[:, None, :]
    test, truth = (np.repeat(g * carrier, 8, axis=1) for g in (1.0, np.sinc(0.5)))
    scene = make_scene((W, 8))
    rmse = measure("rmse", rgb(test), rgb(truth), scene=scene, filter_radius_px=0.0)
    assert rmse.value**2 == pytest.approx((1 - 2 / math.pi) ** 2 / 2, rel=1e-12)
    assert rmse.value**2 == pytest.approx(0.0660226, abs=1e-7)
    assert measure("moire", rgb(test), rgb(truth), scene=scene, filter_radius_px=0.0).value == pytest.approx(
        0.0, abs=1e-12
    )


def test_white_noise_puts_the_bands_share_into_moire(make_scene, rgb):
    noise = np.random.default_rng(4).normal(size=(12, W, W))
    truth = rgb(np.zeros_like(noise))
    score = measure("moire", rgb(noise), truth, scene=make_scene((W, W)), filter_radius_px=0.0)
    bins = float(str(score.extras["bins"]))
    assert bins / W**2 == pytest.approx(0.195801, abs=1e-6)
    # 12 frames of bins / 2 independent exponential powers: five standard deviations.
    assert score.value**2 == pytest.approx(bins / W**2, rel=5 / math.sqrt(12 * bins / 2))
    peak = measure("moire_peak", rgb(noise), truth, scene=make_scene((W, W)), filter_radius_px=0.0)
    # The largest of n exponentials is ln n, give or take 1 of about 7.
    assert peak.value == pytest.approx(2 * math.sqrt(math.log(bins / 2)) / W, rel=0.1)
    assert peak.value == pytest.approx(0.042, rel=0.1)
    assert peak.extras["p_value_any"] > 1e-3


def test_noise_between_seeds_is_not_structured_moire(make_scene, rgb):
    seeds = 6
    noise = np.random.default_rng(8).normal(size=(seeds, 1, 66, 66))
    truth = np.zeros((1, 66, 66))
    score = measure("moire", rgb(noise), rgb(truth), scene=make_scene((66, 66)))
    bins = float(str(score.extras["bins"]))
    # Pairs of independent spectra: each bin's product has standard deviation 1 / N, over bins / 2 of them, doubled.
    spread = math.sqrt(2 * bins / (seeds * (seeds - 1))) / 64**2 * math.sqrt(2)
    assert abs(score.extras["structured_square"]) < 5 * spread
    test, reference = pair(17 / 16, 1, rgb, 66, 66)
    repeated = measure("moire", np.stack([test, test]), reference, scene=make_scene((66, 66)))
    assert repeated.extras["structured"] == pytest.approx(repeated.value, rel=1e-9)


def test_a_real_beat_of_two_screens_is_not_counted(make_scene, rgb):
    x = np.arange(W) + 0.5
    beat = (1 + np.cos(2 * np.pi * x / 4)) * (1 + np.cos(2 * np.pi * x / 3.2)) / 4
    picture = rgb(np.repeat(beat[None, None, :], W, axis=1))
    assert measure("moire", picture, picture, scene=make_scene((W, W))).value == 0.0
    assert measure("moire", picture, np.zeros_like(picture), scene=make_scene((W, W))).value > 0.1


def test_a_constant_error_is_no_moire(make_scene, rgb):
    truth = rgb(np.zeros((1, 33, 50)))
    scene = make_scene((50, 33))
    assert measure("moire", truth + 0.5, truth, scene=scene).value == pytest.approx(0.0, abs=1e-12)
    peak = measure("moire_peak", truth + 0.5, truth, scene=scene)
    assert (peak.value, peak.extras["cycles_per_px"]) == (0.0, None)


def test_a_band_without_bins_is_too_small(make_scene, rgb):
    picture = rgb(np.zeros((1, 3, 3)))
    for name in ("moire", "moire_peak"):
        assert measure(name, picture, picture, scene=make_scene((3, 3))).status == "undefined_too_small"


def test_blocks_find_a_local_ghost(make_scene, rgb):
    picture = np.zeros((1, W, W))
    picture[0, 40:104, 40:104] = 0.5 * np.cos(2 * np.pi * np.arange(64) / 8)
    peak = measure("moire_peak", rgb(picture), rgb(np.zeros((1, W, W))), scene=make_scene((W, W)))
    assert peak.extras["block_peak_max"] == pytest.approx(0.5, rel=1e-6)
    assert peak.extras["block_peak_mean"] < 0.25
    assert peak.value < 0.25
