"""Strobing of rotors: the wagon wheel's closed forms, per shutter, per accumulation count, per rate."""

import math
from dataclasses import replace

import numpy as np
import pytest

from aliasbench.metrics.catalog import measure
from aliasbench.metrics.gate import Signals, open_gate
from aliasbench.metrics.orders import angular_orders, measure_orders, noise_power
from aliasbench.metrics.rotors import Annulus, annulus_at
from aliasbench.scenes.model import Animation, Camera, Facts, Scene
from aliasbench.scenes.projection import view_at

SIDE = 192
# The sectors are sampled at pixel centres: about 30000 of them lie in the annulus and a radial boundary is straddled by
# about 2 * 60 pixels per edge, so a share is off by some 1 / 60^(3/2) = .002 of itself; orders that nothing resolves
# (the tail) are attenuated by an estimate that is right to half, and are 1 % of the pattern's power.
LATTICE = 0.004


@pytest.fixture
def strobe(rotor_scene, rotor_frames, rgb):
    def run(name, blades, rate, shutter_s, *, instants=0, side=SIDE, frames=6, duty=0.5):
        scene, rotor = rotor_scene(side, blades, rate, duty=duty, frames=frames, shutter=shutter_s * 30.0)
        picture = rgb(rotor_frames(rotor, side, scene.animation, instants))
        return measure(name, picture, picture, scene=scene)

    return run


@pytest.mark.parametrize(
    ("rate", "shutter_s", "expected"),
    [
        (1.0, 0.0, 0.315226),
        (1.0, 1 / 60, 0.2141),
        (1.0, 1 / 30, 0.1267),
        (29.0, 0.0, 1.0),
        (29.0, 1 / 60, 0.1963),
        (29.0, 1 / 30, 0.0321),
        (30.0, 0.0, 1.0),
        (30.0, 1 / 60, 1 / math.sqrt(27)),
        (30.0, 1 / 30, 0.0),
    ],
)
def test_strobing_of_three_blades_has_the_shutters_closed_form(strobe, rate, shutter_s, expected):
    score = strobe("strobing", 3, rate, shutter_s)
    assert score.status == "ok"
    tail = float(str(score.extras["rotors"][0]["tail_share"]))
    kept = float(str(score.extras["rotors"][0]["tail_kept"]))
    assert score.value == pytest.approx(expected, abs=LATTICE * expected + 1e-6, rel=kept * tail)


@pytest.mark.parametrize(
    ("rate", "instants", "expected"),
    [(30.0, 3, 1.0), (30.0, 9, 1 / 3), (30.0, 4, 0.0), (29.0, 4, 0.2236), (29.0, 16, 0.1027)],
)
def test_an_accumulation_buffer_strobes_by_its_count_of_instants(strobe, rate, instants, expected):
    score = strobe("strobing", 3, rate, 1 / 30, instants=instants)
    # With 16 instants a third of the visible aliased power is beyond the orders that 192 pixels resolve.
    assert score.value == pytest.approx(expected, rel=0.012, abs=1e-6)


@pytest.mark.parametrize(
    ("rate", "shutter_s", "expected"),
    [
        (29.0, 0.0, 0.3183099),
        (29.0, 1 / 60, 0.0690164),
        (29.0, 1 / 30, 0.0107965),
        (30.0, 1 / 60, 0.0675475),
        (30.0, 1 / 30, 0.0),
    ],
)
def test_the_first_order_is_attenuated_by_the_shutters_sinc(strobe, rate, shutter_s, expected):
    score = strobe("apparent_rate", 3, rate, shutter_s)
    assert 0.5 * np.sinc(0.5) * abs(np.sinc(3 * rate * shutter_s)) == pytest.approx(expected, abs=1e-7)
    first = score.extras["rotors"][0]["orders"][0]
    assert first["size"] == pytest.approx(expected, rel=1e-3, abs=1e-8)


@pytest.mark.parametrize("blades", [2, 3, 4, 5])
@pytest.mark.parametrize(("rate", "expected"), [(1.0, 1.0), (29.0, -1.0), (30.0, 0.0)])
def test_apparent_rates_at_30_frames_a_second(strobe, blades, rate, expected):
    score = strobe("apparent_rate", blades, rate, 0.0, frames=30)
    assert score.status == "ok"
    # Over a whole loop the lattice's error of the phase goes through all angles and averages out.
    assert score.value == pytest.approx(expected, abs=1e-3)
    assert score.extras["sign"] == int(np.sign(expected))


def test_fifteen_blades_at_one_turn_a_second_have_no_direction(strobe):
    score = strobe("apparent_rate", 15, 1.0, 0.0)
    assert (score.value, score.status, score.extras["sign"]) == (-1.0, "ok", None)
    assert score.extras["rotors"][0]["backward_fraction"] == pytest.approx(0.5)


def test_twenty_blades_at_one_turn_a_second_go_back_half_a_turn(strobe):
    score = strobe("apparent_rate", 20, 1.0, 0.0, side=260, frames=30)
    assert score.value == pytest.approx(-0.5, abs=1e-3)


def test_a_pattern_that_the_shutter_blurs_away_has_no_rate(strobe):
    score = strobe("apparent_rate", 3, 30.0, 1 / 30)
    assert (score.value, score.status) == (None, "undefined_no_modulation")


def test_backward_fraction_is_one_at_29_and_zero_at_a_slow_turn(strobe):
    assert strobe("apparent_rate", 3, 29.0, 1 / 60).extras["rotors"][0]["backward_fraction"] == pytest.approx(
        1.0, abs=0.05
    )
    assert strobe("apparent_rate", 3, 0.25, 1 / 30).extras["rotors"][0]["backward_fraction"] == pytest.approx(
        0.0, abs=0.05
    )


def test_a_still_rotor_does_not_strobe(strobe):
    assert strobe("strobing", 3, 0.0, 0.0).value == 0.0
    assert strobe("apparent_rate", 3, 0.0, 0.0).value == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("duty", [0.2, 0.7])
def test_the_sharp_pattern_is_all_there_at_any_duty(strobe, duty):
    assert strobe("strobing", 4, 29.0, 0.0, duty=duty).value == pytest.approx(1.0, abs=LATTICE)


def test_noise_is_not_strobing(rotor_scene, rotor_frames, rgb):
    scene, rotor = rotor_scene(SIDE, 3, 30.0, frames=4, shutter=1.0)
    truth = rotor_frames(rotor, SIDE, scene.animation)
    samples = 16
    test = np.random.default_rng(2).binomial(samples, truth) / samples
    noise = measure("rmse", rgb(test), rgb(truth), scene=scene)
    # Full blur: every pixel is 1 / 2 and its estimate has variance d (1 - d) / N.
    assert noise.value**2 == pytest.approx(0.5 * 0.5 / samples, rel=0.02)
    assert noise.value**2 == pytest.approx(0.015625, rel=0.02)
    assert measure("strobing", rgb(test), rgb(truth), scene=scene).value < 0.01


def test_what_noise_leaves_in_an_order_is_known_from_the_other_orders(rotor_scene, rgb):
    scene, rotor = rotor_scene(160, 3, 29.0, frames=16)
    noise = np.random.default_rng(4).normal(size=(16, 160, 160))
    gate = open_gate(rgb(noise), rgb(np.zeros_like(noise)), scene=scene)
    assert isinstance(gate, Signals)
    orders = measure_orders(gate, gate.test, rotor)
    assert not isinstance(orders, str)
    annulus = annulus_at(rotor, gate, 0)
    assert not isinstance(annulus, str)
    count = orders.coefficients.shape[-1] * 2 / 3
    # White noise of variance 1 leaves sum w^2. A median of n exponentials is spread by 1 / sqrt n, and its mean is
    # 1 / (2 n) above ln 2; 16 pictures, five standard deviations.
    bound = (5 / math.sqrt(16 * count) + 1 / (2 * count)) / math.log(2)
    assert noise_power(orders) == pytest.approx(np.sum(annulus.weight**2), rel=bound)


def test_rates_of_noise_are_said_to_be_noise(rotor_scene, rotor_frames, rgb):
    scene, rotor = rotor_scene(SIDE, 3, 30.0, frames=6, shutter=1.0)
    blurred = rotor_frames(rotor, SIDE, scene.animation)
    noise = 0.1 * np.random.default_rng(5).normal(size=blurred.shape)

    def first(picture):
        score = measure("apparent_rate", rgb(picture), rgb(blurred), scene=scene)
        return score.extras["rotors"][0]["orders"][0]

    assert first(blurred + noise)["above_noise"] is False
    standing = rotor_frames(rotor, SIDE, replace(scene.animation, shutter=0.0))
    # Noise of .1 leaves .1 sqrt(sum w^2) of some .1 / 100, a blade pattern of .02 its first order's third.
    assert first(blurred + 0.02 * standing + noise)["above_noise"] is True


def test_the_renderers_own_strobing_is_the_difference_from_its_shutter(rotor_scene, rotor_frames, rgb):
    scene, rotor = rotor_scene(SIDE, 3, 30.0, frames=4, shutter=1.0)
    truth = rgb(rotor_frames(rotor, SIDE, scene.animation))
    frozen = rgb(rotor_frames(rotor, SIDE, scene.animation, 3))
    assert measure("strobing_err", truth, truth, scene=scene).value == 0.0
    score = measure("strobing_err", frozen, truth, scene=scene)
    # All of the sharp pattern, and what the shutter shows of it is nothing.
    assert score.value == pytest.approx(1.0, abs=LATTICE)


@pytest.mark.parametrize(("blades", "rate", "duty"), [(2, 29.0, 0.5), (7, -15.0, 0.35), (12, 30.0, 0.5)])
def test_strobing_errors_do_not_depend_on_how_many_orders_are_resolved(
    rotor_scene, rotor_frames, rgb, blades, rate, duty
):
    scene, rotor = rotor_scene(SIDE, blades, rate, duty=duty, frames=6, shutter=0.5)
    instant = replace(scene.animation, shutter=0.0)
    truth, frozen = (rotor_frames(rotor, SIDE, animation) for animation in (scene.animation, instant))
    k = np.arange(1, 200_001)
    sharp = (duty * np.sinc(k * duty)) ** 2
    turn = k * blades * rate * 0.5 / 30.0
    # The shutter opens at the instant: order k lags by half the turn while it is open.
    off = np.abs(1.0 - np.sinc(turn) * np.exp(-1j * np.pi * turn)) ** 2
    expected = math.sqrt(2 * float(np.sum(sharp * off)) / (duty * (1 - duty)))
    score = measure("strobing_err", rgb(frozen), rgb(truth), scene=scene)
    assert score.value == pytest.approx(expected, rel=2 * LATTICE)


def test_lattice_leakage_of_the_annulus_is_below_2e_9(rotor_scene, rgb):
    scene, rotor = rotor_scene(256, 4, 1.0, frames=1)
    gate = open_gate(rgb(np.ones((1, 256, 256))), rgb(np.zeros((1, 256, 256))), scene=scene)
    assert isinstance(gate, Signals)
    orders = measure_orders(gate, gate.test, rotor)
    assert not isinstance(orders, str)
    for m in (4, 8, 12):
        assert abs(orders.coefficients[0, 0, m - 1]) <= 2e-9


def test_seen_from_behind_the_rate_about_the_axis_is_the_same(rotor_scene, rotor_frames, rgb):
    scene, rotor = rotor_scene(SIDE, 3, 4.0, frames=10)
    frames = rgb(rotor_frames(rotor, SIDE, scene.animation))
    behind = replace(scene, camera=replace(scene.camera, position=(0.0, 0.0, -5.0)))
    mirrored = np.ascontiguousarray(frames[:, :, ::-1])
    front = measure("apparent_rate", frames, frames, scene=scene)
    assert front.value == pytest.approx(4.0, abs=4e-3)
    assert measure("apparent_rate", mirrored, mirrored, scene=behind).value == pytest.approx(front.value, abs=1e-9)


def test_a_perspective_and_an_oblique_view_measure_the_same(rotor_scene, rgb):
    _, rotor = rotor_scene(2, 3, 29.0)  # radii .2 and .8 about the origin
    camera = Camera("perspective", position=(1.5, 1.0, 3.0), fov_y_deg=45.0)
    scene = Scene("oblique", camera, facts=Facts(rotors=(rotor,)), animation=Animation(30.0, 6, 0.0))
    side = 300
    origin, direction = view_at(camera, scene.animation, 0, 0.0, (side, side)).ray(
        *np.meshgrid(np.arange(side) + 0.5, np.arange(side) + 0.5)
    )
    points = origin - direction * (origin[..., 2] / direction[..., 2])[..., None]
    turn = np.arctan2(points[..., 1], points[..., 0]) / (2 * np.pi) * 3
    frames = rgb(np.array([np.mod(turn - 3 * 29 / 30 * k, 1.0) < 0.5 for k in range(6)]))
    assert measure("apparent_rate", frames, frames, scene=scene).value == pytest.approx(-1.0, abs=2e-2)
    assert measure("strobing", frames, frames, scene=scene).value == pytest.approx(1.0, abs=0.02)


def test_an_annulus_that_cannot_be_read_says_why(strobe, rotor_scene, rgb):
    assert strobe("strobing", 20, 29.0, 0.0, side=96).status == "undefined_too_small"
    assert strobe("strobing", 3, 29.0, 0.0, side=24).status == "undefined_too_small"
    scene, rotor = rotor_scene(SIDE, 3, 29.0, frames=2)
    away = replace(scene, facts=Facts(rotors=(replace(rotor, center=(60.0, 0.0, 0.0)),)))
    picture = rgb(np.zeros((2, SIDE, SIDE)))
    assert measure("strobing", picture, picture, scene=away).status == "annulus_leaves_window"
    edge_on = replace(scene, facts=Facts(rotors=(replace(rotor, axis=(0.0, 1.0, 0.0)),)))
    assert measure("strobing", picture, picture, scene=edge_on).status == "not_applicable"


def test_binned_orders_are_the_sums_over_pixels():
    rng = np.random.default_rng(3)
    weight = rng.uniform(size=5000)
    annulus = Annulus(
        np.arange(5000), rng.uniform(-np.pi, np.pi, 5000), weight / weight.sum(), inner_px=10.0, outer_px=40.0
    )
    values = rng.normal(size=(3, 5000))
    orders = angular_orders(values, annulus, 100)
    for m in (1, 7, 99, 100):
        direct = values @ (annulus.weight * np.exp(-1j * m * annulus.angle))
        assert np.abs(orders[:, m - 1] - direct).max() < 2e-11 * np.abs(values).max()
