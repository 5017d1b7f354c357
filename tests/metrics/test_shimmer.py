"""Shimmer against closed forms of pans, lines and flicker."""

import math

import numpy as np
import pytest

from aliasbench.metrics.catalog import measure
from aliasbench.scenes.model import Animation, Facts, PanFact

W = 16


def pan_scene(make_scene, sub, *, loops=1.0, width=W):
    """A picture that moves right by 1 / sub pixel a frame and repeats after `width` pixels."""
    frames = round(width * sub * loops)
    fps = 30.0
    fact = PanFact((fps / sub, 0.0, 0.0), width * sub / fps)
    return make_scene((width, 4), facts=Facts(pans=(fact,)), animation=Animation(fps, frames))


def panned(profile, sub, frames, width=W):
    """(frames, 4, width): profile(x - position) of pixel middles x, position (k + .5) / sub, periodic in `width`."""
    position = (np.arange(frames) + 0.5) / sub
    u = np.mod(np.arange(width) + 0.5 - position[:, None], width)
    return np.repeat(profile(u)[:, None, :], 4, axis=1)


def box_bar(width, loop=W):
    """Box-filtered bar from 0 to `width`, periodic."""

    def primitive(x):
        return np.floor(x / loop) * width + np.minimum(np.mod(x, loop), width)

    return lambda u: primitive(u + 0.5) - primitive(u - 0.5)


def point_bar(width, loop=W):
    return lambda u: (np.mod(u, loop) < width).astype(np.float64)


def sine(nu, gain=1.0):
    return lambda u: gain * np.cos(2 * np.pi * nu * u)


def test_point_sampled_edge_shimmers_as_derived(make_scene, rgb):
    sub = 32
    scene = pan_scene(make_scene, sub)
    frames = scene.animation.frames
    # A bar of half the loop has two edges, far apart: twice the variance of one.
    test, truth = (panned(bar(W / 2), sub, frames) for bar in (point_bar, box_bar))
    score = measure("shimmer", rgb(test), rgb(truth), scene=scene)
    one_edge = math.sqrt((1 - 1 / sub**2) / (12 * W))
    assert one_edge == pytest.approx(0.0721335, abs=1e-7)
    assert score.value == pytest.approx(math.sqrt(2) * one_edge, rel=1e-12)


@pytest.mark.parametrize(("line", "expected"), [(0.1, 0.0896667), (0.25, 0.1822917), (0.5, 0.2083333)])
def test_point_sampled_thin_line_has_the_derived_square_error(make_scene, rgb, line, expected):
    sub = 320
    scene = pan_scene(make_scene, sub)
    # All frames one below the other: their squares are the same, and one picture is measured sooner than 5120.
    test, truth = (panned(bar(line), sub, scene.animation.frames).reshape(1, -1, W) for bar in (point_bar, box_bar))
    assert line - line**2 - line**3 / 3 == pytest.approx(expected, abs=1e-7)
    score = measure("rmse", rgb(test), rgb(truth), scene=scene, filter_radius_px=0.0)
    # Line and pixel bounds are multiples of 1 / sub: midpoint rule on pieces with second derivative at most 2.
    assert float(score.value or 0.0) ** 2 * W == pytest.approx(expected, abs=1e-7 + 4 / (24 * sub**2))
    energy = measure("rmse", rgb(truth), rgb(0.0 * truth), scene=scene, filter_radius_px=0.0)
    assert float(energy.value or 0.0) ** 2 * W == pytest.approx(line**2 - line**3 / 3, abs=4 / (24 * sub**2))


def test_square_error_is_static_plus_shimmer_exactly(make_scene, rgb):
    rng = np.random.default_rng(3)
    test, truth = rng.normal(size=(2, 12, 9, 11))
    scene = make_scene((11, 9))
    score = measure("shimmer", rgb(test), rgb(truth), scene=scene)
    rmse = measure("rmse", rgb(test), rgb(truth), scene=scene)
    assert float(score.value or 0) ** 2 + float(str(score.extras["static"])) ** 2 == pytest.approx(
        float(rmse.value or 0) ** 2, rel=1e-12
    )


@pytest.mark.parametrize(("nu", "expected"), [(1.0, 0.707107), (17 / 16, 0.748435), (3 / 8, 0.152584)])
def test_panned_sinusoid_shimmers_by_its_amplitude_error(make_scene, rgb, nu, expected):
    sub = 4
    scene = pan_scene(make_scene, sub)
    test, truth = (panned(sine(nu, g), sub, scene.animation.frames) for g in (1.0, np.sinc(nu)))
    assert abs(1 - np.sinc(nu)) / math.sqrt(2) == pytest.approx(expected, abs=1e-6)
    score = measure("shimmer", rgb(test), rgb(truth), scene=scene)
    assert score.value == pytest.approx(abs(1 - np.sinc(nu)) / math.sqrt(2), rel=1e-9)


@pytest.mark.parametrize("nu", [0.3, 1.2, 2.0])
def test_where_frames_repeat_a_wave_shimmer_depends_on_its_phase(make_scene, rgb, nu):
    """Moved by whole cycles a frame a wave stands still, by half cycles it has two values and no mean square of 1/2."""
    scene = make_scene((7, 4))
    step = 1.0 - np.sinc(nu)
    for cycles_per_frame, phases in ((0.0, 16), (1.0, 16), (0.5, 16)):
        squares = []
        for phase in np.arange(phases) / phases:
            turn = cycles_per_frame * np.arange(6)[:, None] + nu * np.arange(7) + phase
            error = np.repeat(step * np.cos(2 * np.pi * turn)[:, None, :], 4, axis=1)
            score = measure("shimmer", rgb(error), rgb(0.0 * error), scene=scene, filter_radius_px=0.0)
            squares.append(float(score.value) ** 2)
        if cycles_per_frame != 0.5:
            assert max(squares) < 1e-24
        else:
            # Averaged over the phase it is the derived one again.
            assert np.mean(squares) == pytest.approx(step**2 / 2, rel=1e-12)
            one_pixel = measure(
                "shimmer", rgb(error[..., :1]), rgb(0.0 * error[..., :1]), scene=scene, filter_radius_px=0.0
            )
            assert float(one_pixel.value) ** 2 == pytest.approx((step * math.cos(2 * math.pi * phase)) ** 2, rel=1e-9)


@pytest.mark.parametrize(
    ("gain", "expected"),
    [
        (1.0, 0.707107),
        (np.sinc(17 / 16), 0.0413278),
        (np.sinc(17 / 16) ** 2, 0.00241545),
        (math.exp(-2 * math.pi**2 * 0.25 * (17 / 16) ** 2), 0.00269191),
    ],
)
@pytest.mark.parametrize("loops", [1.0, 2.0])
def test_shimmer_abs_counts_folded_frequencies(make_scene, rgb, gain, expected, loops):
    scene = pan_scene(make_scene, 4, loops=loops)
    picture = rgb(panned(lambda u: sine(17 / 16, gain)(u) + sine(3 / 8)(u), 4, scene.animation.frames))
    score = measure("shimmer_abs", picture, picture, scene=scene)
    assert score.status == "ok"
    assert score.value == pytest.approx(expected, rel=3e-6)


def test_shimmer_abs_of_what_a_pixel_grid_can_show_is_zero(make_scene, rgb):
    scene = pan_scene(make_scene, 4)
    picture = rgb(panned(sine(7 / 16), 4, scene.animation.frames))
    assert measure("shimmer_abs", picture, picture, scene=scene).value == pytest.approx(0.0, abs=1e-12)


def test_shimmer_abs_of_part_of_a_loop_says_windowed(make_scene, rgb):
    scene = pan_scene(make_scene, 4, loops=0.75)
    picture = rgb(panned(sine(17 / 16), 4, scene.animation.frames))
    score = measure("shimmer_abs", picture, picture, scene=scene)
    assert score.status == "windowed"
    # The line is 4.75 bins above the band's end and a Hann window leaks less than 1 % of amplitude that far.
    assert score.value == pytest.approx(1 / math.sqrt(2), rel=1e-2)


def test_shimmer_abs_needs_a_pan_slower_than_a_pixel_a_frame(make_scene, rgb):
    scene = pan_scene(make_scene, 1)
    picture = rgb(panned(sine(17 / 16), 1, scene.animation.frames))
    assert measure("shimmer_abs", picture, picture, scene=scene).status == "undefined_too_small"


def test_buzz_is_two_for_alternation_and_follows_the_frequency(make_scene, rgb):
    frames = 16
    scene = make_scene((8, 8))
    truth = np.zeros((frames, 8, 8))
    for k in (1, 3, 8):
        flicker = np.cos(2 * np.pi * k * np.arange(frames) / frames)[:, None, None]
        score = measure("buzz", rgb(truth + flicker), rgb(truth), scene=scene)
        assert score.value == pytest.approx(1 - math.cos(2 * math.pi * k / frames), abs=1e-12)


def test_buzz_of_white_noise_is_n_over_n_minus_one(make_scene, rgb):
    n, side = 16, 66
    noise = np.random.default_rng(5).normal(size=(n, side, side))
    score = measure("buzz", rgb(noise), rgb(np.zeros_like(noise)), scene=make_scene((side, side)))
    # The lag-one correlation of 64^2 n normal values has standard deviation 1 / sqrt(64^2 n): five of them.
    assert score.value == pytest.approx(n / (n - 1), abs=5 / math.sqrt(64**2 * n))


def test_buzz_without_shimmer_is_null(make_scene, rgb):
    truth = rgb(np.zeros((4, 8, 8)))
    score = measure("buzz", truth + 0.5, truth, scene=make_scene((8, 8)))
    assert (score.value, score.status) == (None, "undefined_no_shimmer")


def test_static_error_does_not_shimmer_and_reseeded_noise_shimmers_by_its_variance(make_scene, rgb):
    rng = np.random.default_rng(7)
    n, side = 32, 34
    scene = make_scene((side, side))
    truth = np.zeros((n, side, side))
    fixed = np.repeat(rng.normal(size=(1, side, side)), n, axis=0)
    score = measure("shimmer", rgb(fixed), rgb(truth), scene=scene)
    assert score.value == pytest.approx(0.0, abs=1e-12)
    assert score.extras["static"] == pytest.approx(score.extras["rmse"])
    fresh = measure("shimmer", rgb(rng.normal(size=truth.shape)), rgb(truth), scene=scene)
    # Population variance of n frames: (n - 1) / n; relative standard deviation sqrt(2 / values), five of them.
    assert float(fresh.value or 0) ** 2 == pytest.approx((n - 1) / n, rel=5 * math.sqrt(2 / (n * 32**2)))


@pytest.mark.parametrize(("line", "expected"), [(0.1, 3.0), (0.25, 1.732051), (0.5, 1.0)])
def test_point_sampled_line_flickers_on_and_off(make_scene, rgb, line, expected):
    scene = pan_scene(make_scene, 40)
    picture = rgb(panned(point_bar(line), 40, scene.animation.frames))
    score = measure("flux_flicker", picture, picture, scene=scene, filter_radius_px=0.0)
    assert score.value == pytest.approx(math.sqrt((1 - line) / line), rel=1e-12)
    assert score.value == pytest.approx(expected, abs=1e-6)


def test_flux_of_a_partition_of_unity_does_not_flicker_and_a_gaussian_does_as_derived(make_scene, rgb):
    scene = pan_scene(make_scene, 40)

    def flicker(profile):
        picture = rgb(panned(profile, 40, scene.animation.frames))
        return measure("flux_flicker", picture, picture, scene=scene, filter_radius_px=0.0).value

    def centered(u):
        return np.mod(u + W / 2, W) - W / 2

    def gauss(u):
        return np.exp(-2 * centered(u) ** 2)

    assert flicker(box_bar(0.25)) == pytest.approx(0.0, abs=1e-12)
    assert flicker(lambda u: np.maximum(1 - np.abs(centered(u)), 0.0)) == pytest.approx(0.0, abs=1e-12)
    assert flicker(gauss) == pytest.approx(math.sqrt(2) * math.exp(-(math.pi**2) / 2), rel=1e-4)
    assert flicker(gauss) == pytest.approx(0.0101709, abs=1e-6)
    truncated = flicker(lambda u: gauss(u) * (np.abs(centered(u)) <= 1.5))
    # The cut at 1.5 falls between positions: the midpoint rule over 40 of them resolves its jump e^-4.5 to 1 / 40.
    assert truncated == pytest.approx(0.0123314, rel=2e-2)


def test_no_light_has_no_flicker(make_scene, rgb):
    black = rgb(np.zeros((3, 8, 8)))
    score = measure("flux_flicker", black, black, scene=make_scene((8, 8)))
    assert (score.value, score.status) == (None, "undefined_zero_flux")
