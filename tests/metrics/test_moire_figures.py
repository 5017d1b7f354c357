"""Moire on every kind of bin and picture, under every sampler with a closed form, and of the picture alone."""

import math

import numpy as np
import pytest

from aliasbench.metrics.catalog import measure
from aliasbench.metrics.spectrum import combinations_in_band, visible_band, whole_periods, without_lines
from aliasbench.scenes.model import Animation, Camera, Facts, GratingFact, Motion, Scene, Spin
from aliasbench.scenes.shapes import quad

SIZES = [(16, 16), (17, 16), (16, 25), (33, 19), (20, 44), (4, 30), (9, 9)]


def wave(size, k, amplitude=1.0, phase=0.6):
    width, height = size
    y, x = np.mgrid[:height, :width]
    return amplitude * np.cos(2 * np.pi * (k[0] * x / width + k[1] * y / height) + phase)


def error_only(name, error, rgb, scene):
    return measure(name, rgb(error), rgb(np.zeros_like(error)), scene=scene, filter_radius_px=0.0)


@pytest.mark.parametrize("size", SIZES)
def test_band_and_sums_are_those_of_the_whole_transform(make_scene, rgb, size):
    width, height = size
    error = np.random.default_rng(width * height).normal(size=(3, height, width))
    spectrum = np.abs(np.fft.fft2(error)) / (width * height)
    nu = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.fftfreq(width))
    inside = (nu > 0) & (nu <= 0.25)
    scene = make_scene(size)
    moire = error_only("moire", error, rgb, scene)
    assert moire.extras["bins"] == inside.sum() > 0
    assert moire.value == pytest.approx(np.sqrt(np.mean(np.sum(spectrum[:, inside] ** 2, axis=1))), rel=1e-12)
    peak = error_only("moire_peak", error, rgb, scene)
    largest = spectrum[:, inside].max(axis=1)
    # No bin within .25 is its own opposite: a line always has two.
    assert peak.value == pytest.approx(np.sqrt(np.mean((2 * largest) ** 2)), rel=1e-12)
    frame = int(np.argmax(largest))
    power = spectrum[frame, inside] ** 2
    assert peak.extras["frame"] == frame
    assert peak.extras["ordinates"] == inside.sum() / 2
    assert peak.extras["fisher_g"] == pytest.approx(power.max() / (power.sum() / 2), rel=1e-12)


@pytest.mark.parametrize("size", SIZES)
def test_a_line_in_any_bin_has_its_amplitude(make_scene, rgb, size):
    width, height = size
    scene = make_scene(size)
    tried = 0
    for kx in range(width // 4 + 1):
        for ky in range(-(height // 4), height // 4 + 1):
            if not 0.0 < math.hypot(kx / width, ky / height) <= 0.25 or (kx + ky) % 2:
                continue
            tried += 1
            score = error_only("moire_peak", wave(size, (kx, ky), 0.37)[None], rgb, scene)
            assert score.value == pytest.approx(0.37, rel=1e-12)
            found, planted = np.array(score.extras["cycles_per_px"]) * size, np.array([kx, ky])
            assert min(np.abs(found - planted).max(), np.abs(found + planted).max()) < 1e-9
            assert score.extras["period_px"] == pytest.approx(1 / math.hypot(kx / width, ky / height), rel=1e-12)
            assert score.extras["fisher_g"] == pytest.approx(1.0)
            assert error_only("moire", wave(size, (kx, ky), 0.37)[None], rgb, scene).value == pytest.approx(
                0.37 / math.sqrt(2), rel=1e-12
            )
    assert tried >= 2


@pytest.mark.parametrize("k", [(8, 0), (0, 10), (8, 10), (5, 0), (0, 6), (4, 5)])
def test_lines_outside_the_band_are_not_moire(make_scene, rgb, k):
    # The first three are their own opposites: (1/2, 0), (0, 1/2), (1/2, 1/2).
    scene = make_scene((16, 20))
    score = error_only("moire_peak", wave((16, 20), k)[None], rgb, scene)
    assert (score.value, score.extras["cycles_per_px"]) == (0.0, None)
    assert error_only("moire", wave((16, 20), k)[None], rgb, scene).value == pytest.approx(0.0, abs=1e-13)


def test_the_strongest_line_of_any_seed_and_frame_is_described(make_scene, rgb):
    error = np.zeros((2, 3, 24, 32))
    for seed, frame, k, amplitude in ((0, 0, (3, 1), 0.1), (1, 2, (2, -5), 0.4), (0, 1, (0, 4), 0.3)):
        error[seed, frame] = wave((32, 24), k, amplitude)
    score = measure(
        "moire_peak",
        rgb(error),
        rgb(np.zeros((3, 24, 32))),
        scene=make_scene((32, 24)),
        filter_radius_px=0,
        frame_start=5,
    )
    assert score.value == pytest.approx(math.sqrt((0.1**2 + 0.4**2 + 0.3**2) / 6), rel=1e-12)
    assert score.extras["frame"] == 7
    assert np.abs(score.extras["cycles_per_px"]) == pytest.approx([2 / 32, 5 / 24])


def sampled(nu, sampler, n, phases, width, seeds, rng):
    """Means of n samples of cos(2 pi nu x + phase) in each pixel of a row to each phase, (seeds, phases, width)."""
    shape = (seeds, len(phases), width, n)
    if sampler == "random":
        offset = rng.uniform(size=shape)
    else:
        offset = (np.arange(n) + rng.uniform(size=shape)) / n
    x = np.arange(width)[:, None] + offset
    return np.cos(2 * np.pi * nu * x + phases[:, None, None]).mean(axis=-1)


@pytest.mark.parametrize(
    ("sampler", "nu", "n", "figure"),
    [
        ("random", 1.0, 1, 0.5),
        ("random", 1.0, 4, 0.125),
        ("random", 0.4, 3, None),
        ("random", 2.7, 2, None),
        ("jittered", 1.0, 1, 0.5),
        ("jittered", 1.0, 2, 0.148679),
        ("jittered", 1.0, 4, 0.0236788),
        ("jittered", 0.4, 3, None),
        ("jittered", 2.7, 2, None),
    ],
)
def test_noise_of_a_grating_averaged_over_its_phase(make_scene, rgb, sampler, nu, n, figure):
    width, rows, seeds = 64, 48, 8
    rng = np.random.default_rng(round(100 * nu) + n)
    phases = 2 * np.pi * (np.arange(rows) + 0.5) / rows
    test = sampled(nu, sampler, n, phases, width, seeds, rng)
    truth = np.sinc(nu) * np.cos(2 * np.pi * nu * (np.arange(width) + 0.5) + phases[:, None])
    expected = (1 - np.sinc(nu) ** 2) / (2 * n) if sampler == "random" else (1 - np.sinc(nu / n) ** 2) / (2 * n)
    if figure is not None:
        assert expected == pytest.approx(figure, abs=1e-6)
    scene = make_scene((width, rows))
    noise = measure("noise", rgb(test[:, None]), rgb(truth[None]), scene=scene, filter_radius_px=0.0)
    rmse = measure("rmse", rgb(test[:, None]), rgb(truth[None]), scene=scene, filter_radius_px=0.0)
    # Means of bounded values have no more kurtosis than normal ones: relative deviation sqrt(2 / values), five of it.
    assert noise.value**2 == pytest.approx(expected, rel=5 * math.sqrt(2 / (width * rows * (seeds - 1))))
    assert rmse.value**2 == pytest.approx(expected, rel=5 * math.sqrt(2 / (width * rows * seeds)))
    # It is white, and the band has its share of it: a fifth, of 12 800 / 2 ordinates.
    moire = measure("moire", rgb(test[:, None]), rgb(truth[None]), scene=scene, filter_radius_px=0.0)
    share = float(str(moire.extras["bins"])) / (width * rows)
    assert share == pytest.approx(math.pi / 16, rel=0.02)
    assert moire.value**2 == pytest.approx(share * expected, rel=5 / math.sqrt(share * width * rows * seeds / 2))


def test_the_amplitude_at_nyquist_depends_on_the_phase(make_scene, rgb):
    x = np.arange(32) + 0.5
    scene = make_scene((32, 4))
    found = []
    for phase in (0.0, 0.13, 0.25):
        carrier = np.repeat(np.cos(2 * np.pi * (0.5 * x + phase))[None, None, :], 4, axis=1)
        found.append(measure("rmse", rgb(carrier), rgb(2 / math.pi * carrier), scene=scene, filter_radius_px=0.0).value)
        # cos(pi (x + 1/2) + 2 pi phase) alternates with amplitude sin(2 pi phase).
        assert found[-1] == pytest.approx((1 - 2 / math.pi) * abs(math.sin(2 * math.pi * phase)), abs=1e-12)
    assert found[0] < 1e-12 < found[1] < found[2]


def grating_scene(make_scene, size, *frequencies, **more):
    facts = Facts(gratings=tuple(GratingFact(f) for f in frequencies))
    return make_scene(size, facts=facts, **more)


def abs_of(picture, rgb, scene, **more):
    return measure("moire", rgb(picture), rgb(picture), scene=scene, **more).extras["abs"]


FILTERS = {
    "point": lambda _: 1.0,
    "box": lambda nu: abs(np.sinc(nu)),
    "tent": lambda nu: np.sinc(nu) ** 2,
    "gaussian": lambda nu: math.exp(-2 * (math.pi * 0.5 * nu) ** 2),
}


def grating(size, nu, gain, frames=1, speed=0.0):
    width, height = size
    x = np.arange(width) + 0.5 - speed * np.arange(frames)[:, None]
    return np.repeat((0.5 + 0.5 * gain * np.cos(2 * np.pi * nu * x))[:, None, :], height, axis=1)


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("nu", [17 / 16, 33 / 32, 31 / 16, 35 / 16])
@pytest.mark.parametrize(("frames", "speed"), [(1, 0.0), (7, 0.3)])
def test_the_false_energy_of_an_exact_picture_is_what_its_filter_lets_through(make_scene, rgb, name, nu, frames, speed):
    size = (98, 70)
    gain = FILTERS[name](nu)
    scene = grating_scene(make_scene, size, (nu, 0.0), animation=Animation(30.0, frames))
    picture = grating(size, nu, gain, frames, speed)
    # Amplitude 1/2; the picture against itself has no moire, but for its own.
    assert measure("moire", rgb(picture), rgb(picture), scene=scene).value == 0.0
    assert abs_of(picture, rgb, scene) == pytest.approx(gain / 2 / math.sqrt(2), rel=1e-9)


def test_false_energy_figures():
    assert abs(np.sinc(17 / 16)) / math.sqrt(2) == pytest.approx(0.0413278, abs=1e-7)
    assert FILTERS["tent"](17 / 16) / math.sqrt(2) == pytest.approx(0.00241545, abs=1e-8)
    assert FILTERS["gaussian"](17 / 16) / math.sqrt(2) == pytest.approx(0.00269191, abs=1e-8)


@pytest.mark.parametrize("nu", [1 / 8, 3 / 16, 7 / 16])
def test_what_a_pixel_grid_can_show_is_not_false(make_scene, rgb, nu):
    scene = grating_scene(make_scene, (98, 40), (nu, 0.0), contrast=2.0)
    assert abs_of(grating((98, 40), nu, 1.0), rgb, scene) == pytest.approx(0.0, abs=1e-12)


def test_false_energy_without_whole_periods_is_within_the_windows_leakage(make_scene, rgb):
    size, nu = (128, 128), 1 + 1 / (8 * math.sqrt(3))
    scene = grating_scene(make_scene, size, (nu, 0.0))
    # The window is of unit mean square; the line is 9 bins from 0 and from the band's end, and leaks 1e-3 that far.
    assert abs_of(grating(size, nu, 1.0), rgb, scene) == pytest.approx(0.5 / math.sqrt(2), rel=1e-3)
    inside = 1 / (8 * math.sqrt(3))
    scene = grating_scene(make_scene, size, (inside, 0.0))
    # More than 3.5 bins away from a line less than 1 % of its amplitude is left in each of the nearest bins.
    assert abs_of(grating(size, inside, 1.0), rgb, scene) < 0.5 * 0.01 * math.sqrt(2)


def test_overlapping_gratings_have_their_sums_and_differences(make_scene, rgb):
    size = (130, 98)
    fx, fy, fine = 3 / 16, 1 / 8, 15 / 16
    y, x = np.mgrid[: size[1], : size[0]] + 0.5
    first, second = 1 + np.cos(2 * np.pi * fx * x), 1 + np.cos(2 * np.pi * fy * y)
    scene = grating_scene(make_scene, size, (fx, 0.0), (0.0, fy))
    assert abs_of((first * second)[None] / 4, rgb, scene) == pytest.approx(0.0, abs=1e-12)
    # Two screens beyond Nyquist: their beat at (1/8, 0) is true, each one's own alias is false.
    other = fine - 1 / 8
    box = [np.sinc(f) for f in (fine, other)]
    product = (
        1
        + box[0] * np.cos(2 * np.pi * fine * x)
        + box[1] * np.cos(2 * np.pi * other * x)
        + 0.5 * np.sinc(1 / 8) * np.cos(2 * np.pi * x / 8)
    )
    scene = grating_scene(make_scene, size, (fine, 0.0), (other, 0.0), (1 / 8, 0.0))
    # `other` comes back at 3/16, `fine` at 1/16.
    expected = math.sqrt((box[0] ** 2 + box[1] ** 2) / 2)
    assert abs_of(product[None], rgb, scene) == pytest.approx(expected, rel=1e-9)


def test_false_energy_is_told_only_where_the_spectrum_is_known(make_scene, rgb):
    size = (64, 64)
    picture = grating(size, 17 / 16, 1.0)
    facts = Facts(gratings=(GratingFact((17 / 16, 0.0)),))
    assert abs_of(picture, rgb, make_scene(size, facts=facts)) is not None
    assert abs_of(picture, rgb, make_scene(size)) is None
    perspective = Scene("p", Camera("perspective", fov_y_deg=40.0), facts=facts)
    assert abs_of(picture, rgb, perspective) is None
    turning = Camera("orthographic", height=64.0, velocity=(0.0, 0.0, 0.0), target_velocity=(1.0, 0.0, 0.0))
    assert abs_of(picture, rgb, Scene("t", turning, facts=facts)) is None
    corners = [(-9.0, -9.0, 0.0), (9.0, -9.0, 0.0), (9.0, 9.0, 0.0), (-9.0, 9.0, 0.0)]
    spinning = quad(corners, motion=Motion(spin=Spin((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 1.0)))
    assert abs_of(picture, rgb, make_scene(size, facts=facts, objects=(spinning,))) is None
    # Gratings side by side have no line spectrum.
    many = [(1.0 + k / 16 + 1e-3 * k * k, 0.0) for k in range(1, 7)]
    assert abs_of(picture, rgb, grating_scene(make_scene, size, *many)) is None


def test_lines_of_two_gratings():
    assert combinations_in_band([]) == []
    assert combinations_in_band([(0.1, 0.0)]) == [(0.1, 0.0), (0.2, 0.0)]
    crossed = combinations_in_band([(0.125, 0.0), (0.0, 0.2)])
    assert crossed == [(0.0, 0.2), (0.125, -0.2), (0.125, 0.0), (0.125, 0.2), (0.25, 0.0)]
    beat = combinations_in_band([(1.0, 0.0), (0.9, 0.05), (0.1, -0.05)])
    assert np.array(beat) == pytest.approx(np.array([(0.1, -0.05), (0.2, -0.1)]))


@pytest.mark.parametrize("size", [(32, 20), (33, 21)])
def test_lines_take_their_neighbours_and_nothing_else(size):
    band = visible_band(size[1], size[0])
    for line in ((3.0 / size[0], 2.0 / size[1]), (0.0, 4.0 / size[1]), (-0.1, 0.11), (0.001, 0.0)):
        free = without_lines(band, [line])
        expected = []
        for nu in band.nu:
            distance = [np.abs(nu - sign * np.array(line)) * size for sign in (1, -1)]
            expected.append(not any(np.all(d < 1.5) for d in distance))
        assert free.tolist() == expected
        assert 1 <= np.sum(~free) <= 9


@pytest.mark.parametrize(
    ("side", "cycles", "expected"),
    [(126, [17 / 16], 112), (100, [], 100), (100, [0.5, 1 / 3], 96), (100, [math.sqrt(2)], None), (1, [0.5], None)],
)
def test_whole_periods(side, cycles, expected):
    assert whole_periods(side, cycles) == expected
