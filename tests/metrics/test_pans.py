"""Shimmer of the picture alone: pans along any direction, several at once, by the camera, of any length."""

import math

import numpy as np
import pytest
from scipy import integrate

from aliasbench.metrics.catalog import measure
from aliasbench.metrics.shimmer import flicker_filter
from aliasbench.scenes.model import Animation, Camera, Facts, PanFact, Scene

FPS = 25.0


def pan_scene(make_scene, size, *speeds, frames, loop=None, **more):
    """Pans by (x, y) pixels a frame, y down as in pictures, each repeating after `loop` frames."""
    facts = tuple(PanFact((x * FPS, -y * FPS, 0.0), (loop or frames) / FPS) for x, y in speeds)
    return make_scene(size, facts=Facts(pans=facts), animation=Animation(FPS, frames), **more)


def moving(size, frames, speed, *waves):
    """A sum of a cos(2 pi nu (p - speed t) + 1), nu = (x, y) cycles a pixel, over pixel middles p."""
    t, y, x = np.mgrid[:frames, : size[1], : size[0]] + 0.5
    x, y = x - speed[0] * t, y - speed[1] * t
    return sum(a * np.cos(2 * np.pi * (nu[0] * x + nu[1] * y) + 1.0) for a, nu in waves)


def shimmer_abs(picture, rgb, scene, **more):
    return measure("shimmer_abs", rgb(picture), rgb(picture), scene=scene, **more)


@pytest.mark.parametrize("frames", [5, 16, 27])
@pytest.mark.parametrize("highest", [0.01, 0.11, 0.25, 0.39])
def test_the_filter_takes_what_transforms_have_beyond(frames, highest):
    pixels = np.random.default_rng(frames).normal(size=(frames, 40)) + 3.0
    for windowed in (False, True):
        window = np.sin(np.pi * (np.arange(frames) + 0.5) / frames) ** 2 if windowed else np.ones(frames)
        taken = (pixels - windowed * pixels.mean(axis=0)) * (window / np.sqrt(np.mean(window**2)))[:, None]
        power = np.abs(np.fft.fft(taken, axis=0) / frames) ** 2
        expected = power[np.abs(np.fft.fftfreq(frames)) > highest].sum(axis=0)
        rows = flicker_filter(frames, highest, windowed)
        assert np.sum((rows @ pixels) ** 2, axis=0) / frames == pytest.approx(expected, rel=1e-11)
        # Nothing is left of a constant but rounding.
        assert np.max(np.abs(rows @ np.full(frames, 1.0))) < 1e-14
    assert flicker_filter(frames, 0.5, False) is None


@pytest.mark.parametrize(
    ("speed", "frames"), [((0.25, 0.25), 64), ((-0.25, 0.25), 64), ((0.0, -0.5), 32), ((0.125, -0.25), 128)]
)
def test_pans_along_both_axes(make_scene, rgb, speed, frames):
    size = (16, 16)
    scene = pan_scene(make_scene, size, speed, frames=frames)
    kept = [(0.7, (7 / 16, -5 / 16)), (0.3, (-0.5, 7 / 16)), (1.0, (0.0, 0.0))]
    score = shimmer_abs(moving(size, frames, speed, *kept), rgb, scene)
    assert score.status == "ok"
    assert score.value < 1e-12
    assert score.extras["px_per_frame"] == pytest.approx(speed, abs=1e-12)
    assert score.extras["highest_cycles_per_frame"] == pytest.approx((abs(speed[0]) + abs(speed[1])) / 2)
    # (19/16, 17/16) moves by more than half of what the pan moves a cycle a pixel in either direction.
    folded = (19 / 16 * np.sign(speed[0] or 1.0), 17 / 16 * np.sign(speed[1]))
    rate = (folded[0] * speed[0] + folded[1] * speed[1] + 0.5) % 1.0 - 0.5
    assert abs(rate) > score.extras["highest_cycles_per_frame"]
    both = shimmer_abs(moving(size, frames, speed, *kept, (0.4, folded)), rgb, scene)
    assert both.value == pytest.approx(0.4 / math.sqrt(2), rel=1e-9)


@pytest.mark.parametrize("sub", [3, 4, 7])
@pytest.mark.parametrize("nu", [17 / 16, 19 / 16, 1.0])
def test_other_rates_and_frequencies_fold_alike(make_scene, rgb, sub, nu):
    size, frames = (16, 4), 16 * sub
    gains = {"point": 1.0, "box": np.sinc(nu), "tent": np.sinc(nu) ** 2, "gauss": math.exp(-((math.pi * nu) ** 2) / 2)}
    scene = pan_scene(make_scene, size, (1 / sub, 0.0), frames=frames)
    folds = abs((nu / sub + 0.5) % 1.0 - 0.5) > 0.5 / sub
    assert folds
    for gain in gains.values():
        score = shimmer_abs(moving(size, frames, (1 / sub, 0.0), (gain, (nu, 0.0)), (0.5, (3 / 8, 0.0))), rgb, scene)
        assert score.value == pytest.approx(abs(gain) / math.sqrt(2), rel=1e-9, abs=1e-12)


def test_of_several_pans_the_fastest_says_what_can_be_true(make_scene, rgb):
    frames, size = 128, (16, 8)
    slow, fast = (0.125, 0.0), (0.25, 0.0)
    left = moving(size, frames, slow, (1.0, (7 / 16, 0.0)))
    right = moving(size, frames, fast, (1.0, (7 / 16, 0.0)))
    picture = np.where(np.arange(16) < 8, left, right)
    for order in ((slow, fast), (fast, slow)):
        score = shimmer_abs(picture, rgb, pan_scene(make_scene, size, *order, frames=frames))
        assert score.value < 1e-12
        assert score.extras["px_per_frame"] == pytest.approx(fast)
    # Alone the slow pan would call the fast one's right half false.
    alone = shimmer_abs(picture, rgb, pan_scene(make_scene, size, slow, frames=frames), filter_radius_px=0.0)
    assert alone.value == pytest.approx(0.5, rel=1e-9)
    # If one of them has no whole loop, none has.
    odd = Facts(pans=(PanFact((slow[0] * FPS, 0.0, 0.0), frames / FPS), PanFact((fast[0] * FPS, 0.0, 0.0), 7.3)))
    assert shimmer_abs(picture, rgb, make_scene(size, facts=odd, animation=Animation(FPS, frames))).status == "windowed"


@pytest.mark.parametrize("start", [0, 9, 400])
@pytest.mark.parametrize("projection", ["orthographic", "perspective"])
def test_a_pan_by_the_camera_is_the_same_from_any_frame(rgb, start, projection):
    frames, size, distance = 64, (16, 16), 5.0
    pixel = {"orthographic": 1.0, "perspective": 2 * distance * math.tan(math.radians(20.0)) / 16}[projection]
    velocity = (-0.25 * pixel * FPS, 0.25 * pixel * FPS, 0.0)
    camera = Camera(projection, (0.0, 0.0, distance), height=16.0, fov_y_deg=40.0, velocity=velocity)
    pan = PanFact((-velocity[0], -velocity[1], 0.0), frames / FPS)
    scene = Scene("p", camera, facts=Facts(pans=(pan,)), animation=Animation(FPS, frames))
    speed = (0.25, 0.25)
    picture = moving(size, frames, speed, (0.5, (17 / 16, 5 / 16)), (0.5, (3 / 16, -7 / 16)))
    score = shimmer_abs(picture, rgb, scene, frame_start=start)
    assert score.extras["px_per_frame"] == pytest.approx(speed, rel=1e-9)
    assert score.value == pytest.approx(0.5 / math.sqrt(2), rel=1e-9)


def test_seeds_are_averaged_and_large_constants_leave_nothing(make_scene, rgb):
    frames, size = 48, (12, 10)
    scene = pan_scene(make_scene, size, (0.25, 0.0), frames=frames)
    one = moving(size, frames, (0.25, 0.0), (0.3, (13 / 12, 0.0)))
    seeds = np.stack([one, 0.0 * one, 2.0 * one])
    score = measure("shimmer_abs", rgb(seeds), rgb(one), scene=scene, filter_radius_px=0.0)
    assert score.value == pytest.approx(0.3 / math.sqrt(2) * math.sqrt(5 / 3), rel=1e-9)
    assert shimmer_abs(0.0 * one + 800.0, rgb, scene).value < 800 * 1e-14
    huge = shimmer_abs(one * 1e200, rgb, scene)
    assert huge.value == pytest.approx(0.3e200 / math.sqrt(2), rel=1e-9)


def dots(size, frames, speed, places, width, profile):
    """Flat dots, `width` pixels wide and high, that move along x around a picture and come in again."""
    t = np.arange(frames)[:, None] + 0.5
    total = np.zeros((frames, size[1], size[0]))
    for x, row in places:
        u = np.mod(np.arange(size[0]) + 0.5 - x - speed * t + size[0] / 2, size[0]) - size[0] / 2
        total[:, row] += profile(u, width)
    return total


def point(u, width):
    return ((u >= -width / 2) & (u < width / 2)).astype(np.float64)


def box(u, width):
    return np.clip(np.minimum(u + 0.5, width / 2) - np.maximum(u - 0.5, -width / 2), 0.0, None)


@pytest.mark.parametrize("width", [0.2, 0.3, 0.6])
def test_dots_smaller_than_a_pixel_flicker_less_the_more_there_are(make_scene, rgb, width):
    size, sub = (20, 12), 20
    frames = size[0] * sub
    scene = pan_scene(make_scene, size, (1 / sub, 0.0), frames=frames)

    def flicker(places, profile):
        picture = rgb(dots(size, frames, 1 / sub, places, width, profile))
        return measure("flux_flicker", picture, picture, scene=scene, filter_radius_px=0.0).value

    one = math.sqrt((1 - width) / width)
    assert flicker([(3.0, 5)], point) == pytest.approx(one, rel=1e-9)
    assert flicker([(3.0, 5)], box) == pytest.approx(0.0, abs=1e-12)
    # All in one phase: as one dot.
    assert flicker([(3.0, row) for row in range(12)], point) == pytest.approx(one, rel=1e-9)
    # In phases of their own, each flicker is independent, to within what 300 pairs of random phases share: a hit or
    # miss of probability w has lag correlations of both signs, of mean 0 and at most 1.
    rng = np.random.default_rng(2)
    places = [(float(x), int(row)) for x, row in zip(rng.uniform(0, 20, 200), rng.integers(0, 12, 200), strict=True)]
    many = flicker(places, point)
    assert one / math.sqrt(200) / 3 < many < 3 * one / math.sqrt(200)
    assert flicker(places, box) == pytest.approx(0.0, abs=1e-12)
    # Phases a fifth of a pixel apart, dots a fifth wide (or two or three): one is always hit.
    if width * 5 == round(width * 5):
        assert flicker([(k / 5, k) for k in range(5)], point) == pytest.approx(0.0, abs=1e-9)


def test_light_that_really_comes_and_goes_is_told_beside_its_flicker(make_scene, rgb):
    size, frames = (20, 6), 80
    # For a fifth of the loop the dot is in the border, and no sampling is to blame.
    scene = pan_scene(make_scene, size, (0.25, 0.0), frames=frames)
    truth, test = (dots(size, frames, 0.25, [(2.3, 2)], 0.5, p) for p in (box, point))
    picture = rgb(truth)
    score = measure("flux_flicker", rgb(test), picture, scene=scene, filter_radius_px=2.0)
    inside = truth[:, 2:-2, 2:-2].sum(axis=(1, 2))
    assert score.extras["reference"] == pytest.approx(np.std(inside) / np.mean(inside), rel=1e-9)
    assert score.extras["reference"] > 0.3
    assert score.value > score.extras["reference"]
    whole = measure("flux_flicker", picture, picture, scene=scene, filter_radius_px=0.0)
    assert (whole.value, whole.extras["reference"]) == (pytest.approx(0.0, abs=1e-12), pytest.approx(0.0, abs=1e-12))


@pytest.mark.parametrize(("radius", "figure"), [(8.0, 0.0101709), (1.5, 0.0123314), (2.0, None)])
def test_a_gaussian_is_no_partition_of_unity_and_truncation_makes_it_worse(make_scene, rgb, radius, figure):
    size, sub = (20, 4), 400
    frames = size[0] * sub // 20

    def profile(u, _):
        return np.exp(-2 * u**2) * (np.abs(u) <= radius)

    # One pixel's way is enough: the sum repeats.
    picture = dots(size, frames, 1 / sub, [(10.0, 1)], 0.0, profile)
    scene = pan_scene(make_scene, size, (1 / sub, 0.0), frames=frames, loop=frames)
    found = measure("flux_flicker", rgb(picture), rgb(picture), scene=scene, filter_radius_px=0.0).value

    def flux(x):
        places = np.arange(-9, 10) + 0.5 - x
        return float(np.sum(profile(places, 0.0)))

    mean, square = (
        integrate.quad(lambda x, p=p: flux(x) ** p, 0.0, 1.0, points=[0.5], epsabs=1e-12)[0] for p in (1, 2)
    )
    expected = math.sqrt(square / mean**2 - 1.0)
    # The midpoint rule: second derivatives are below 50 and steps 1/400; a jump lies between two positions.
    assert found == pytest.approx(expected, rel=2e-3)
    if figure is not None:
        assert expected == pytest.approx(figure, rel=2e-5)
