"""Sharpness beside the figures of false detail: what blur costs, and what is left of patterns without edges."""

import math

import numpy as np
import pytest
from scipy import special

from aliasbench.metrics.catalog import measure
from aliasbench.scenes.model import Animation, Facts, PanFact

SIDE, LOOP = 192, 16


@pytest.fixture
def strobe(rotor_scene, rotor_frames, rgb):
    def run(blades, rate, shutter, *, duty=0.5, noise=0.0, frames=6):
        scene, rotor = rotor_scene(SIDE, blades, rate, duty=duty, frames=frames, shutter=shutter)
        picture = rotor_frames(rotor, SIDE, scene.animation)
        picture = picture + noise * np.random.default_rng(3).normal(size=picture.shape)
        return measure("strobing", rgb(picture), rgb(picture), scene=scene)

    return run


def left_of_pattern(blades, rate, shutter, duty):
    """The share of a pattern's power that a shutter leaves: of order k blades (d sinc k d)^2 sinc^2(k B r T)."""
    k = np.arange(1.0, 200_001.0)
    power = (duty * np.sinc(k * duty)) ** 2 * np.sinc(k * blades * rate * shutter / 30.0) ** 2
    return 2 * power.sum() / (duty * (1 - duty))


@pytest.mark.parametrize(
    ("blades", "rate", "shutter", "duty"),
    [
        (3, 1.0, 0.5, 0.5),
        (3, 29.0, 0.5, 0.5),
        (3, 29.0, 1.0, 0.5),
        (3, 30.0, 0.5, 0.5),
        (5, 4.0, 1.0, 0.3),
        (4, 7.0, 0.25, 0.7),
    ],
)
def test_the_modulation_that_a_shutter_keeps_is_its_sincs(strobe, blades, rate, shutter, duty):
    score = strobe(blades, rate, shutter, duty=duty)
    kept = score.extras["sharpness"]["modulation_kept"]
    expected = left_of_pattern(blades, rate, shutter, duty)
    # Sampled at pixel centres (as for strobing itself) .8 % of the root, and of orders that nothing resolves, some 1 %
    # of the pattern, an estimate that is right to half.
    assert kept == pytest.approx(expected, rel=0.02, abs=1e-4)
    assert score.extras["rotors"][0]["modulation_kept"] == kept
    assert score.value**2 <= kept + 1e-9


def test_all_of_a_sharp_pattern_is_kept_and_of_a_full_turn_of_it_nothing(strobe):
    for duty in (0.2, 0.5):
        assert strobe(3, 29.0, 0.0, duty=duty).extras["sharpness"]["modulation_kept"] == pytest.approx(1.0, abs=0.01)
        assert strobe(3, 0.0, 0.0, duty=duty).extras["sharpness"]["modulation_kept"] == pytest.approx(1.0, abs=0.01)
    assert strobe(3, 30.0, 1.0).extras["sharpness"]["modulation_kept"] == pytest.approx(0.0, abs=1e-6)


def test_noise_is_no_modulation(strobe):
    # 18 000 pixels of an annulus weighted as sin^4: |c|^2 is .04 / 9000 in each of 48 orders, which is taken off; what
    # is left of their sum has a deviation of sqrt(48 / 6) of one, 1e-4 of the pattern's power.
    kept = strobe(3, 30.0, 1.0, noise=0.2).extras["sharpness"]["modulation_kept"]
    assert kept == pytest.approx(0.0, abs=1e-3)


def test_scenes_without_edges_say_so(strobe):
    kept = strobe(3, 29.0, 0.5).extras["sharpness"]
    assert (kept["mtf50"], kept["edge_width"]) == (None, None)
    assert kept["missing"] == {"mtf50": "not_applicable", "edge_width": "not_applicable"}


def pan_scene(make_scene, sub):
    fact = PanFact((30.0 / sub, 0.0, 0.0), LOOP * sub / 30.0)
    return make_scene((LOOP, 4), facts=Facts(pans=(fact,)), animation=Animation(30.0, LOOP * sub))


@pytest.mark.parametrize(
    ("level", "within", "beyond"),
    [(0.0, 1.0, 1.0), (3.0, 0.25, 2.0), (-1e3, 1.0, 0.0), (0.5, 0.0, 1.0), (1e200, 1e200, 0.0)],
)
def test_what_is_in_band_is_the_contrast_of_the_pattern_that_the_grid_can_show(make_scene, rgb, level, within, beyond):
    sub = 4
    scene = pan_scene(make_scene, sub)
    x = np.arange(LOOP) + 0.5 - (np.arange(LOOP * sub)[:, None] + 0.5) / sub
    picture = level + within * np.cos(2 * np.pi * 3 / 8 * x) + beyond * np.cos(2 * np.pi * 17 / 16 * x)
    picture = rgb(np.repeat(picture[:, None, :], 4, axis=1))
    score = measure("shimmer_abs", picture, picture, scene=scene)
    assert score.value == pytest.approx(beyond / math.sqrt(2), rel=1e-9, abs=1e-12 * max(1.0, abs(level)))
    # The contrast comes from the square less the level's: rounding counts to 1e-16 of that.
    loose = 1e-7 * max(1.0, abs(level))
    assert score.extras["sharpness"]["in_band"] == pytest.approx(within / math.sqrt(2), rel=1e-6, abs=loose)


def test_what_does_not_move_is_in_band(make_scene, rgb):
    scene = pan_scene(make_scene, 4)
    stripes = np.where(np.arange(4) % 2, 1.0, 0.0)[:, None] * np.ones(LOOP)
    picture = rgb(np.repeat(stripes[None], LOOP * 4, axis=0))
    score = measure("shimmer_abs", picture, picture, scene=scene)
    assert score.extras["sharpness"]["in_band"] == pytest.approx(0.5, abs=1e-9)
    black = np.zeros(picture.shape)
    assert measure("shimmer_abs", black, black, scene=scene).extras["sharpness"]["in_band"] == 0.0


def test_blur_shows_beside_what_it_gains(make_scene, edge_fact, rgb):
    width, height, sub, slope = 64, 40, 4, 0.1618  # x = 16 + slope (y - 20): the left edge of a bar half the loop wide
    fact = edge_fact((width, height), (16 - slope * 60, -40.0), (16 + slope * 60, 80.0))
    frames, fps = width * sub, 30.0
    pan = PanFact((fps / sub, 0.0, 0.0), frames / fps)
    scene = make_scene(
        (width, height),
        facts=Facts(edges=(fact,), pans=(pan,)),
        animation=Animation(fps, frames),
        velocity=(-fps / sub, 0.0, 0.0),  # of the camera: the picture moves right
    )
    x = np.arange(width) + 0.5 - np.arange(frames)[:, None, None] / sub
    beyond = np.mod(x - (16 + slope * (np.arange(height)[:, None] + 0.5 - 20)) + width / 4, width) - width / 4

    def measured(sigma):
        deviation = sigma * math.hypot(1, slope)
        bar = special.ndtr(beyond / deviation) - special.ndtr((beyond - width / 2) / deviation)
        score = measure("shimmer_abs", rgb(bar), rgb(bar), scene=scene, filter_radius_px=2.0)
        assert score.extras["sharpness"]["missing"] == {}
        # A Gaussian has half of its modulation at sqrt(ln 2 / 2) / (pi sigma).
        assert score.extras["sharpness"]["mtf50"] == pytest.approx(
            math.sqrt(math.log(2) / 2) / math.pi / sigma, rel=3e-3
        )
        assert score.extras["sharpness"]["edge_width"] == pytest.approx(2.563103 * sigma, rel=3e-3)
        return score

    sharp, soft = measured(0.4), measured(0.7)
    assert soft.value < sharp.value / 3
    assert soft.extras["sharpness"]["in_band"] < sharp.extras["sharpness"]["in_band"]
