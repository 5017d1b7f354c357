"""Apparent speed and strobing of gratings under a pan: closed forms of planted sequences, and rendered ones."""

import math
from dataclasses import replace

import numpy as np
import pytest

from aliasbench.metrics.catalog import measure
from aliasbench.metrics.grating_lines import fit_lines
from aliasbench.metrics.gratings import sharp_amplitudes
from aliasbench.renderers.catalog import prepare
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import Animation, Camera, Facts, Grating, GratingFact, Motion, PanFact, RotorFact, Scene
from aliasbench.scenes.shapes import quad

FPS = 25.0
# Lines are fitted without leakage; sums of some thousand products of double precision, and phases of up to some tens of
# turns, are off by less than this.
EXACT = 1e-10


@pytest.fixture
def planted(make_scene, rgb):
    """A sine of (x, y) cycles per pixel that moves by (x, y) pixels a frame (y down), its shutter integrated exactly.

    `instants` > 0 averages so many equally spaced instants of the shutter instead.
    """

    def make(nu, velocity, *, shutter=0.0, frames=7, size=(61, 48), instants=0, swing=1.0, first=0):
        nu, velocity = np.array(nu, dtype=np.float64), np.array(velocity, dtype=np.float64)
        facts = Facts(
            gratings=(GratingFact((float(nu[0]), -float(nu[1]))),),
            pans=(PanFact((FPS * float(velocity[0]), -FPS * float(velocity[1]), 0.0), 1.0),),
        )
        scene = make_scene(size, facts=facts, animation=Animation(FPS, frames, shutter))
        x, y = np.arange(size[0]) + 0.5, np.arange(size[1])[:, None] + 0.5
        drift = float(nu @ velocity)

        def at(t):
            return np.cos(2 * np.pi * (nu[0] * x + nu[1] * y - drift * t + 0.17))

        pictures = []
        for number in range(first, first + frames):
            if instants:
                times = number + (np.arange(instants) + 0.5) / instants * shutter
                wave = np.mean([at(t) for t in times], axis=0)
            else:
                wave = np.sinc(drift * shutter) * at(number + shutter / 2)
            pictures.append(0.5 + 0.5 * swing * wave)
        return rgb(np.array(pictures)), scene

    return make


def wrap(cycles):
    return cycles - math.floor(cycles + 0.5)


def test_a_quarter_cycle_a_pixel_at_three_pixels_a_frame_goes_back_by_one(planted):
    pictures, scene = planted((0.25, 0.0), (3.0, 0.0))
    score = measure("apparent_velocity", pictures, pictures, scene=scene)
    assert (score.status, score.extras["sign"]) == ("ok", -1)
    assert score.value == pytest.approx(-1.0, abs=EXACT)
    (grating,) = score.extras["gratings"]
    assert grating["true_px_per_frame"] == pytest.approx(3.0, abs=EXACT)
    assert (grating["aliased"], grating["backward_fraction"]) == (True, 1.0)


@pytest.mark.parametrize(
    ("nu", "velocity"),
    [
        ((0.25, 0.0), (0.6, 0.0)),
        ((0.25, 0.0), (-0.6, 0.0)),
        ((0.1, 0.0), (7.3, 0.0)),
        ((0.0, 0.31), (0.0, 2.0)),
        ((0.13, 0.21), (1.0, -2.5)),
        ((0.13, -0.21), (1.5, 2.5)),
        # Aliased in space: near a whole number of cycles, just below and above, and past a half.
        ((17 / 16, 0.0), (0.25, 0.0)),
        ((15 / 16, 0.0), (0.25, 0.0)),
        ((2.1, 0.0), (0.4, 0.0)),
        ((0.7, 0.0), (0.3, 0.0)),
        ((0.7, 0.0), (0.9, 0.0)),
        ((0.95, 0.12), (0.2, 0.1)),
        ((0.12, 1.9), (0.2, 0.3)),
        # An integer number of cycles a frame stands still.
        ((0.25, 0.0), (4.0, 0.0)),
        ((0.3, 0.2), (2.0, 7.0)),
    ],
)
@pytest.mark.parametrize("shutter", [0.0, 0.4])
def test_the_apparent_velocity_is_that_of_the_alias_in_space_and_time(planted, nu, velocity, shutter):
    pictures, scene = planted(nu, velocity, shutter=shutter)
    score = measure("apparent_velocity", pictures, pictures, scene=scene)
    drift = float(np.dot(nu, velocity))
    seen = np.array([wrap(nu[0]), wrap(nu[1])])
    turn = wrap(round(drift, 12)) * (-1.0 if seen @ np.array(nu) < 0.0 else 1.0)
    assert score.value == pytest.approx(turn / np.hypot(*seen), abs=EXACT)
    assert score.extras["sign"] == np.sign(round(turn, 12))
    (grating,) = score.extras["gratings"]
    assert grating["cycles_per_px"] == pytest.approx(nu, abs=EXACT)
    assert grating["true_px_per_frame"] == pytest.approx(drift / np.hypot(*nu), abs=EXACT)
    assert grating["aliased"] == (abs(drift) >= 0.5)
    assert grating["attenuation"] == pytest.approx(abs(np.sinc(drift * shutter)), abs=EXACT)
    assert grating["shutter_attenuation"] == pytest.approx(abs(np.sinc(drift * shutter)), abs=EXACT)
    (line,) = grating["lines"]
    assert line["seen_cycles_per_px"] == pytest.approx(seen, abs=EXACT)
    backward = np.sign(round(turn, 12)) != np.sign(drift)
    assert grating["backward_fraction"] == float(backward)
    # A line that moves half a cycle a frame or more is strobing, and what the shutter leaves of it is how much.
    strobing = measure("strobing", pictures, pictures, scene=scene)
    expected = abs(np.sinc(drift * shutter)) if abs(drift) >= 0.5 else 0.0
    assert strobing.value == pytest.approx(expected, abs=EXACT)


@pytest.mark.parametrize(("nu", "v"), [(0.25, 2.0), (0.25, -2.0), (0.125, 12.0), (0.7, 5 / 7)])
def test_at_half_a_cycle_a_frame_there_is_no_direction(planted, nu, v):
    pictures, scene = planted((nu, 0.0), (v, 0.0))
    score = measure("apparent_velocity", pictures, pictures, scene=scene)
    assert (score.status, score.extras["sign"]) == ("ok", None)
    assert score.value == pytest.approx(-0.5 / abs(wrap(nu)), abs=EXACT)
    assert score.extras["gratings"][0]["backward_fraction"] == 0.5
    assert measure("strobing", pictures, pictures, scene=scene).value == pytest.approx(1.0, abs=EXACT)


@pytest.mark.parametrize(("v", "shutter"), [(3.0, 0.5), (4.0, 1.0), (8.0, 0.25), (5.0, 1.0)])
@pytest.mark.parametrize("instants", [1, 3, 4])
def test_instants_of_a_shutter_leave_their_dirichlet_kernel(planted, v, shutter, instants):
    pictures, scene = planted((0.25, 0.0), (v, 0.0), shutter=shutter, instants=instants)
    cycles = 0.25 * v * shutter
    below = instants * math.sin(math.pi * cycles / instants)
    kept = abs(math.sin(math.pi * cycles) / below) if abs(below) > 1e-9 else 1.0
    assert measure("strobing", pictures, pictures, scene=scene).value == pytest.approx(kept, abs=EXACT)
    truth, _ = planted((0.25, 0.0), (v, 0.0), shutter=shutter)
    # Both waves have the phase of the shutter's middle; the difference of their signed amplitudes is the error.
    signed = (
        math.sin(math.pi * cycles) / below if abs(below) > 1e-9 else math.cos(math.pi * cycles * (1 - 1 / instants))
    )
    error = measure("strobing_err", pictures, truth, scene=scene)
    assert error.value == pytest.approx(abs(signed - np.sinc(cycles)), abs=EXACT)


def test_a_pattern_that_the_shutter_blurs_away_has_no_velocity(planted):
    pictures, scene = planted((0.25, 0.0), (4.0, 0.0), shutter=1.0)
    score = measure("apparent_velocity", pictures, pictures, scene=scene)
    assert (score.value, score.status) == (None, "undefined_no_modulation")
    assert score.extras["gratings"][0]["shutter_attenuation"] == pytest.approx(0.0, abs=EXACT)


@pytest.mark.parametrize("nu", [1.0, 2.0, 0.5, 1.5, 1.0 + 0.5 / 61])
def test_a_grating_that_flashes_in_place_has_no_direction(planted, nu):
    pictures, scene = planted((nu, 0.0), (0.3, 0.0))
    for name in ("apparent_velocity", "strobing", "strobing_err"):
        score = measure(name, pictures, pictures, scene=scene)
        assert (score.value, score.status) == (None, "undefined_no_direction")


def test_a_later_first_frame_changes_nothing(planted):
    pictures, scene = planted((0.2, 0.1), (1.0, 1.0), first=11)
    score = measure("apparent_velocity", pictures, pictures, scene=scene, frame_start=11)
    assert score.value == pytest.approx(0.3 / math.hypot(0.2, 0.1), abs=EXACT)


def test_noise_does_not_strobe_and_seeds_share_the_line(planted):
    pictures, scene = planted((0.2, 0.0), (3.0, 0.0), frames=8, size=(66, 66), shutter=0.5)
    rng = np.random.default_rng(1)
    noisy = pictures + 0.2 * rng.normal(size=(3, *pictures.shape[:-1], 1))
    # A coefficient of a frame has the noise's variance times sum w^2 / (sum w)^2 = (3 / (2 * 64))^2, half of it along
    # the line's own phase; the mean is over 8 frames and 3 seeds. Five standard deviations, of an amplitude of 1 / 4.
    noise = 0.2 * 1.5 / 64
    spread = 5 * noise / math.sqrt(2 * 24) / 0.25
    assert measure("strobing", noisy, pictures, scene=scene).value == pytest.approx(np.sinc(0.3), abs=spread)
    # Without a line, its power is noise^2 / 8 in each of 3 seeds, which is taken off, give or take five times its
    # standard deviation, which is as large.
    blank = 0.5 + noisy - pictures
    most = noise / 0.25 * math.sqrt(5 / 8 / math.sqrt(3))
    assert measure("strobing", blank, pictures, scene=scene).value < most
    # Of 7 advances between frames the inner phases cancel: two phases, each off by noise / (sqrt(2) |c|), over 7 steps
    # and 3 seeds.
    velocity = measure("apparent_velocity", noisy, pictures, scene=scene)
    turn = noise / (0.25 * np.sinc(0.3)) / 7 / math.sqrt(3) / (2 * math.pi)
    assert velocity.value == pytest.approx(wrap(0.6) / 0.2, abs=5 * turn / 0.2)


@pytest.mark.parametrize("shape", [(1, 1, 40, 61), (2, 3, 64, 33)])
def test_fitted_lines_are_those_of_the_picture(shape):
    rng = np.random.default_rng(2)
    places = np.array([[0.11, 0.07], [0.31, -0.2], [-0.4, 0.0], [0.0, 0.25]])
    coefficients = rng.normal(size=(*shape[:2], 4)) + 1j * rng.normal(size=(*shape[:2], 4))
    x, y = np.arange(shape[3]), np.arange(shape[2])[:, None]
    waves = np.exp(2j * np.pi * (places[:, 0, None, None] * x + places[:, 1, None, None] * y))
    picture = 3.0 + 2.0 * np.einsum("sfk,khw->sfhw", coefficients, waves).real
    assert np.abs(fit_lines(picture, places) - coefficients).max() < 1e-11
    assert fit_lines(picture, np.zeros((0, 2))).shape == (*shape[:2], 0)


def test_rotors_and_gratings_are_weighed_together_and_a_grating_that_stands_still_not_at_all(planted):
    pictures, scene = planted((0.3, 0.0), (2.0, 0.0), size=(128, 128), shutter=0.5)
    rotor = RotorFact((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 3, 0.5, 1.0, 12.0, 50.0)
    alone = replace(scene, facts=Facts(rotors=(rotor,)))
    both = replace(scene, facts=replace(scene.facts, rotors=(rotor,)))
    turning = measure("strobing", pictures, pictures, scene=alone).value
    together = measure("strobing", pictures, pictures, scene=both)
    assert together.value == pytest.approx(math.sqrt((turning**2 + np.sinc(0.3) ** 2) / 2), abs=1e-9)
    assert len(together.extras["gratings"]) == 1
    along = replace(both, facts=replace(both.facts, gratings=(GratingFact((0.0, 0.3)),)))
    assert measure("strobing", pictures, pictures, scene=along).value == turning
    still = replace(along, facts=replace(along.facts, rotors=()))
    assert measure("strobing", pictures, pictures, scene=still).value == 0.0
    assert measure("apparent_velocity", pictures, pictures, scene=still).status in ("ok", "undefined_no_modulation")


def test_where_nothing_is_declared_or_no_frequency_is_the_pictures_nothing_is_measured(planted):
    pictures, scene = planted((0.25, 0.0), (3.0, 0.0))

    def statuses(scene):
        names = ("apparent_velocity", "strobing", "strobing_err")
        return [
            (s.status, s.extras.get("missing")) for s in (measure(n, pictures, pictures, scene=scene) for n in names)
        ]

    assert statuses(replace(scene, facts=replace(scene.facts, pans=()))) == [
        ("not_applicable", "pans"),
        ("not_applicable", "patterns"),
        ("not_applicable", "patterns"),
    ]
    assert [missing for _, missing in statuses(replace(scene, facts=replace(scene.facts, gratings=())))] == [
        "gratings",
        "patterns",
        "patterns",
    ]
    turns = replace(scene.camera, target_velocity=(1.0, 0.0, 0.0))
    for camera in (Camera("perspective", fov_y_deg=40.0), turns):
        assert statuses(replace(scene, camera=camera)) == [("not_applicable", "gratings of one frequency")] * 3
    one = measure("strobing", pictures[:1], pictures[:1], scene=scene)
    assert one.value == pytest.approx(1.0, abs=EXACT)


def textured(side, frequency, velocity, *, profile="sine", shutter=0.0, camera_moves=False, pan_sign=1.0):
    """A scene of which a world unit is a pixel: a grating of (x, y) cycles per pixel, y up, that moves or is passed."""
    corners = [(sx * 8.0 * side, sy * 8.0 * side, 0.0) for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    length, angle = math.hypot(*frequency), math.atan2(frequency[1], frequency[0])
    rate = (FPS * velocity[0], FPS * velocity[1], 0.0)
    back = (-rate[0], -rate[1], 0.0)
    still = (0.0, 0.0, 0.0)
    return Scene(
        "textured",
        Camera("orthographic", height=float(side), velocity=back if camera_moves else still),
        objects=(
            quad(
                corners,
                uv=[(x, y) for x, y, _ in corners],
                texture="grating",
                motion=Motion(velocity=still if camera_moves else rate),
                name="wall",
            ),
        ),
        textures={"grating": Grating(length, math.degrees(angle), 0.13, profile, (0.1,) * 3, (0.9,) * 3)},
        contrast=0.8,
        animation=Animation(FPS, 5, shutter),
        facts=Facts(
            gratings=(GratingFact(frequency),), pans=(PanFact((pan_sign * rate[0], pan_sign * rate[1], 0.0), 1.0),)
        ),
    )


def rendered(scene, technique, side, frames=5):
    with prepare(scene, technique, size=(side, side)) as prepared:
        return np.array([prepared.render(f).pixels for f in range(frames)])


@pytest.mark.parametrize(
    ("frequency", "velocity", "shutter"),
    [((0.25, 0.0), (3.0, 0.0), 0.5), ((0.2, 0.15), (1.5, 2.0), 0.25), ((17 / 16, 0.0), (0.9, 0.0), 0.5)],
)
def test_the_reference_shows_a_sine_as_pixel_and_shutter_leave_it(frequency, velocity, shutter):
    side, nu = 48, np.array(frequency)
    scene = textured(side, frequency, velocity, shutter=shutter)
    exact, point = rendered(scene, "reference:", side), rendered(scene, "raytrace:", side)
    drift = float(nu @ velocity)
    kept = float(np.sinc(nu[0]) * np.sinc(nu[1]) * np.sinc(drift * shutter))
    seen = wrap(drift) / float(np.hypot(*(nu - np.round(nu))))
    # The reference is exact to 1e-9 of the contrast, the tracer's float32 coordinates to some 1e-6 of a cycle, and its
    # pixels to 1e-7; a line of `kept` has a phase as many times less exact.
    for pictures, left, close in ((exact, abs(kept), 1e-8), (point, 1.0, 1e-5)):
        velocity_seen = measure("apparent_velocity", pictures, exact, scene=scene)
        assert velocity_seen.value == pytest.approx(seen, rel=close / left, abs=close / left)
        (grating,) = velocity_seen.extras["gratings"]
        assert grating["attenuation"] == pytest.approx(left, abs=close)
        aliased = left if abs(drift) >= 0.5 else 0.0
        assert measure("strobing", pictures, exact, scene=scene).value == pytest.approx(aliased, abs=close)
    assert measure("strobing_err", exact, exact, scene=scene).value == 0.0
    # The tracer's instant is the shutter's middle: the phase is the reference's.
    assert measure("strobing_err", point, exact, scene=scene).value == pytest.approx(abs(1.0 - kept), abs=1e-5)


@pytest.mark.parametrize("camera_moves", [False, True])
@pytest.mark.parametrize("pan_sign", [1.0, -1.0])
def test_a_pan_may_be_named_after_the_camera(camera_moves, pan_sign):
    side = 40
    scene = textured(side, (0.2, 0.0), (0.75, 0.0), camera_moves=camera_moves, pan_sign=pan_sign)
    pictures = rendered(scene, "raytrace:", side, 3)
    score = measure("apparent_velocity", pictures, pictures, scene=scene)
    assert score.value == pytest.approx(0.75, abs=1e-5)
    assert score.extras["gratings"][0]["true_px_per_frame"] == pytest.approx(0.75, abs=EXACT)


@pytest.mark.parametrize("shutter", [0.0, 0.5])
@pytest.mark.parametrize("drift", [0.2, 0.55])
def test_a_square_wave_strobes_by_its_aliased_harmonics(shutter, drift):
    side, nu = 64, 0.131
    scene = textured(side, (nu, 0.0), (drift / nu, 0.0), profile="square", shutter=shutter)
    exact = rendered(scene, "reference:", side, 3)
    k = np.arange(1, 4001, 2)
    sharp = np.sinc(k / 2) ** 2
    left = (np.sinc(k * nu) * np.sinc(k * drift * shutter)) ** 2
    aliased = k * drift >= 0.5
    share = float(np.sum((sharp * left)[aliased]) / np.sum(sharp))
    score = measure("strobing", exact, exact, scene=scene)
    (parts,) = score.extras["gratings"]
    assert len(parts["harmonics"]) == 8
    # Beyond the fifteenth harmonic, what is left is estimated from the last octave, of which pixel and shutter leave
    # more; and as far as those lines fall on others', of which three frames do not tell them by their motion, they add
    # to these. The sharp pattern is cut off at 1e-4 of its power.
    beyond = float(np.sum((sharp * left)[k > 15]) / np.sum(sharp))
    doubt = 2 * math.sqrt(share * beyond) + beyond + float(parts["tail_share"]) * float(parts["tail_kept"]) + 2e-4
    assert doubt < 0.03
    assert score.value**2 == pytest.approx(share, abs=doubt)
    point = rendered(scene, "raytrace:", side, 3)
    whole = float(np.sum(sharp[aliased]) / np.sum(sharp))
    # A point sample keeps all of it, save which harmonics share an alias: some 2 % of the power.
    assert measure("strobing", point, exact, scene=scene).value ** 2 == pytest.approx(whole, abs=0.02)


@pytest.mark.parametrize("duty", [0.5, 0.25, 0.3125])
@pytest.mark.parametrize("angle", [0.0, 20.0])
def test_harmonics_of_a_grids_image_are_those_of_its_bars(duty, angle):
    scene = load_scene(f"grid:lines=30,duty={duty},angle_deg={angle}")
    k = np.arange(1, 33)
    for fact in scene.facts.gratings:
        amplitudes = sharp_amplitudes(scene, fact)
        assert amplitudes is not None
        # Bars cover `duty` of what the crossing ones leave free.
        assert amplitudes[:32] == pytest.approx(np.abs(duty * np.sinc(k * duty)) * (1 - duty), abs=1e-12)
    assert sharp_amplitudes(scene, GratingFact((7.7, 0.1))) is None
    bars = load_scene(f"grid:lines=30,duty={duty},angle_deg={angle},kind=polygons")
    assert sharp_amplitudes(bars, bars.facts.gratings[0]) is None


def test_of_a_panned_grid_of_images_the_lines_that_move_are_measured():
    side = 96
    scene = load_scene("grid:lines=36,speed=-14,duty=0.25")  # 3 / 8 of a cycle a pixel, .4666 of a cycle a frame
    pictures = rendered(scene, "raytrace:", side, 5)
    score = measure("apparent_velocity", pictures, pictures, scene=scene)
    first, second = score.extras["gratings"]
    assert (score.extras["grating"], second["true_px_per_frame"]) == (0, 0.0)
    assert first["true_px_per_frame"] == pytest.approx(-14 / 30 / 0.375, rel=1e-9)
    assert score.extras["sign"] == -1
    bars = load_scene("grid:lines=36,speed=-14,duty=0.25,kind=polygons")
    strobing = measure("strobing", pictures, pictures, scene=bars)
    assert (strobing.status, strobing.extras["missing"]) == ("not_applicable", "a texture of the grating's frequency")
    assert 0.0 < float(measure("strobing", pictures, pictures, scene=scene).value or 0.0) <= 1.0
