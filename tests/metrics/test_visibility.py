"""The visible part of shimmer: the sensitivity's figures, and what single waves must give."""

import math

import numpy as np
import pytest
from scipy.optimize import minimize

from aliasbench.metrics import visibility
from aliasbench.metrics.catalog import measure
from aliasbench.scenes.model import Animation

W, H = 48, 32
PPD = visibility.PIXELS_PER_DEGREE


def visible(error, rgb, make_scene, fps=30.0):
    frames, height, width = error.shape[-3:]
    scene = make_scene((width, height), animation=Animation(fps, frames))
    return measure("shimmer", rgb(error), rgb(np.zeros((frames, height, width))), scene=scene, filter_radius_px=0.0)


def drifting(k, frames, amplitude=0.7, phase=0.3):
    """kx, ky cycles in the picture, kt in the sequence."""
    t, y, x = np.mgrid[:frames, :H, :W]
    return amplitude * np.cos(2 * np.pi * (k[0] * x / W + k[1] * y / H - k[2] * t / frames) + phase)


def weight(k, frames, fps=30.0):
    rho = math.hypot(k[0] / W, k[1] / H) * PPD
    return float(visibility.sensitivity(np.array(rho), np.array(abs(k[2]) * fps / frames)))


@pytest.mark.parametrize("v", [0.15, 1.0, 3.0, 20.0])
def test_at_a_given_speed_the_maximum_is_where_and_what_it_must_be(v):
    rho = 45.9 / (2 * math.pi * (v + 2))
    largest = (6.1 + 7.3 * abs(math.log10(v / 3)) ** 3) * v * (45.9 / (v + 2)) ** 2 * math.exp(-2)
    if v == 3.0:
        assert rho == pytest.approx(1.4610, abs=5e-5)
        assert largest == pytest.approx(208.712, abs=5e-4)
    assert visibility.kelly_daly(np.array(rho), np.array(v)) == pytest.approx(largest, rel=1e-12)
    around = visibility.kelly_daly(rho * np.array([0.5, 0.99, 1.01, 2.0]), np.array(v))
    assert np.all(around < largest)


def test_the_most_visible_wave_has_sensitivity_one():
    found = minimize(
        lambda q: -float(visibility.kelly_daly(np.exp(q[0]), np.exp(q[1]))),
        np.log([2.0, 1.0]),
        method="Nelder-Mead",
        options={"xatol": 1e-9, "fatol": 1e-10},
    )
    assert -found.fun == pytest.approx(visibility.LARGEST_SENSITIVITY, rel=1e-8)
    rho, f = np.meshgrid(np.geomspace(0.01, 60, 400), np.geomspace(0.01, 120, 400))
    all_of_them = visibility.sensitivity(rho, f)
    assert np.all(all_of_them > 0)
    assert 0.99 < np.max(all_of_them) <= 1.0 + 1e-8
    # Nothing that is left out beyond the visible band has more than a hundredth.
    assert np.max(all_of_them[rho > 0.25 * PPD]) < 0.0101


def test_coarse_and_uniform_flicker_is_seen_like_half_a_cycle_per_degree():
    for f in (0.5, 8.0, 15.0):
        at_floor = visibility.kelly_daly(np.array(0.5), np.array(f / 0.5)) / visibility.LARGEST_SENSITIVITY
        for rho in (0.0, 0.1, 0.5):
            assert visibility.sensitivity(np.array(rho), np.array(f)) == at_floor > 0


@pytest.mark.parametrize("frames", [9, 24])
@pytest.mark.parametrize("k", [(3, 0, 1), (0, 4, 1), (5, -3, 2), (2, 7, 4), (1, 1, -3), (0, 0, 1), (12, 0, 1)])
@pytest.mark.parametrize("fps", [30.0, 12.5])
def test_a_drifting_wave_counts_by_its_frequency(make_scene, rgb, frames, k, fps):
    score = visible(drifting(k, frames), rgb, make_scene, fps)
    assert score.value == pytest.approx(0.7 / math.sqrt(2), rel=1e-12)
    assert score.extras["visible"] == pytest.approx(weight(k, frames, fps) * 0.7 / math.sqrt(2), rel=1e-9)
    assert (score.extras["fps"], score.extras["csf"]) == (fps, "Kelly 1979, Daly 1998")
    assert score.extras["ppd"] == pytest.approx(67.02, abs=0.01)


@pytest.mark.parametrize("k", [(3, 2, 5), (0, 6, 1), (7, 0, 3)])
def test_a_wave_that_flickers_in_place_is_two_that_drift(make_scene, rgb, k):
    frames = 20
    standing = (drifting(k, frames, 0.5, 0.2) + drifting((k[0], k[1], -k[2]), frames, 0.5, 1.1)) / 2
    score = visible(standing, rgb, make_scene)
    assert score.value == pytest.approx(0.5 / 2, rel=1e-12)
    assert score.extras["visible"] == pytest.approx(weight(k, frames) * 0.5 / 2, rel=1e-9)


@pytest.mark.parametrize("k", [(0, 0), (4, 1)])
def test_alternation_at_half_the_frame_rate_counts_once(make_scene, rgb, k):
    frames = 8
    error = drifting((*k, 0), frames, 0.4, 0.0) * (-1.0) ** np.arange(frames)[:, None, None]
    score = visible(error, rgb, make_scene)
    size = 0.4 if k == (0, 0) else 0.4 / math.sqrt(2)
    assert score.value == pytest.approx(size, rel=1e-12)
    assert score.extras["visible"] == pytest.approx(weight((*k, frames / 2), frames) * size, rel=1e-9)


def test_waves_add_up_by_their_squares_and_seeds_are_averaged(make_scene, rgb):
    frames = 16
    waves = [((3, 1, 2), 0.2), ((5, -4, 1), 0.7), ((0, 0, 3), 0.1), ((0, 3, 5), 0.4)]
    alone = [visible(drifting(k, frames, a), rgb, make_scene).extras["visible"] for k, a in waves]
    together = sum(drifting(k, frames, a) for k, a in waves)
    both = visible(together, rgb, make_scene).extras["visible"]
    assert both == pytest.approx(math.sqrt(sum(a**2 for a in alone)), rel=1e-9)
    seeds = np.stack([together, 0 * together])
    assert visible(seeds, rgb, make_scene).extras["visible"] == pytest.approx(both / math.sqrt(2), rel=1e-9)


def test_what_stands_still_or_is_too_fine_is_not_seen(make_scene, rgb):
    frames = 12
    still = np.repeat(np.random.default_rng(0).normal(size=(1, H, W)), frames, axis=0)
    assert visible(still, rgb, make_scene).extras["visible"] < 1e-14
    fine = visible(drifting((20, 0, 1), frames), rgb, make_scene)
    assert fine.value == pytest.approx(0.7 / math.sqrt(2), rel=1e-12)
    assert fine.extras["visible"] < 1e-14


def test_of_noise_less_is_visible_than_there_is(make_scene, rgb):
    noise = np.random.default_rng(1).normal(size=(10, H, W))
    score = visible(noise, rgb, make_scene)
    assert 0.0 < score.extras["visible"] < 0.45 * score.value  # the band has a fifth of its power
