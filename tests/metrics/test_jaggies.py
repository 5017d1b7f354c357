"""Jaggies of known edges: closed forms on irrational and rational slopes, and where edges may be read."""

import math

import numpy as np
import pytest
from scipy import special

from aliasbench.metrics.catalog import measure
from aliasbench.metrics.jaggies import contrast_sensitivity
from aliasbench.scenes.model import Animation, Facts, Motion, Spin, Surface

GOLDEN = (math.sqrt(5) - 1) / 2
SIZE = (520, 80)
NAMES = ("jaggies", "jaggies_rms", "jaggies_bias", "jaggies_str")


def line(edge_fact, size, slope, intercept):
    """The fact of y = slope x + intercept across a picture and beyond, bright above."""
    x0, x1 = -10.0, size[0] + 10.0
    return edge_fact(size, (x0, slope * x0 + intercept), (x1, slope * x1 + intercept))


@pytest.fixture
def edge_scene(make_scene, edge_fact):
    def make(slope, intercept, size=SIZE, **kwargs):
        return make_scene(size, facts=Facts(edges=(line(edge_fact, size, slope, intercept),)), **kwargs)

    return make


def scores(test, reference, scene, rgb, **kwargs):
    test = rgb(test)
    test = test[None] if test.ndim == 3 else test
    reference = rgb(reference)[None] if reference.ndim == 2 else rgb(reference)
    return {n: measure(n, test, reference, scene=scene, **kwargs) for n in NAMES}


def test_one_sample_on_an_irrational_slope_gives_root_one_twelfth(edge_scene, rgb, box_edge, point_edge):
    slope, intercept = 0.1 * GOLDEN, 20.0
    got = scores(
        point_edge(SIZE, slope, intercept), box_edge(SIZE, slope, intercept), edge_scene(slope, intercept), rgb
    )
    columns = got["jaggies"].extras["edges"][0]["columns"]
    assert columns >= 500
    # r is the sawtooth 1/2 - phase: 31 whole periods and a part of one, of at most 1/32 of the variance 1/12.
    assert got["jaggies"].value == pytest.approx(1 / math.sqrt(12), rel=1 / 32)
    assert abs(got["jaggies_bias"].value) < 0.5 / 31
    assert got["jaggies_rms"].value ** 2 == pytest.approx(got["jaggies"].value ** 2 + got["jaggies_bias"].value ** 2)
    harmonics = got["jaggies_str"].extras["harmonics"]
    for k in range(1, 4):
        assert harmonics[k - 1] == pytest.approx(1 / (2 * math.pi * k), rel=0.1)
    fundamental = 2 * harmonics[0] ** 2 / got["jaggies"].value ** 2
    assert fundamental == pytest.approx(6 / math.pi**2, rel=0.1)
    # Eight harmonics of a sawtooth hold 6/pi^2 (1 + 1/4 + ... + 1/64) of its variance.
    share = 6 / math.pi**2 * sum(1 / k**2 for k in range(1, 9))
    assert got["jaggies_str"].value == pytest.approx(math.sqrt(share / 12), rel=0.02)


@pytest.mark.parametrize(("q", "expected"), [(2, 0.25), (3, 0.272166), (8, 0.286411), (16, 0.288111)])
def test_rational_slopes_have_their_own_spread_and_bias_at_most_half_a_step(
    edge_scene, rgb, box_edge, point_edge, q, expected
):
    size = (2 + 240, 200)  # 240 columns between the borders: whole periods of each q
    slope, intercept = 1 / q, 30.0 + 0.25 / q
    got = scores(
        point_edge(size, slope, intercept),
        box_edge(size, slope, intercept),
        edge_scene(slope, intercept, size),
        rgb,
        filter_radius_px=0.5,
    )
    assert math.sqrt((1 - 1 / q**2) / 12) == pytest.approx(expected, abs=1e-6)
    columns = got["jaggies"].extras["edges"][0]["columns"]
    assert columns % q == 0
    assert got["jaggies"].value == pytest.approx(expected, abs=1e-6)
    assert abs(got["jaggies_bias"].value) <= 1 / (2 * q) + 1e-12


def test_stairs_of_slope_one_half_are_counted_once(edge_scene, rgb, box_edge, point_edge):
    size = (130, 100)
    got = scores(point_edge(size, 0.5, 10.125), box_edge(size, 0.5, 10.125), edge_scene(0.5, 10.125, size), rgb)
    assert got["jaggies_str"].value == pytest.approx(0.25, abs=1e-9)
    assert got["jaggies_str"].value == pytest.approx(got["jaggies"].value, abs=1e-9)
    assert got["jaggies_str"].extras["edges"][0]["rank"] == 1
    # Harmonics of two pixels' stairs are all the same wave, or none: a sum over them is too much.
    harmonics = np.array(got["jaggies_str"].extras["harmonics"])
    assert math.sqrt(2 * harmonics[0] ** 2) == pytest.approx(0.353553, abs=1e-6)
    assert math.sqrt(2 * np.sum(harmonics**2)) == pytest.approx(0.707, abs=2e-4)


@pytest.mark.parametrize(("n", "expected"), [(2, 0.144338), (4, 0.072169)])
def test_regular_levels_divide_the_spread(edge_scene, rgb, box_edge, point_edge, n, expected):
    slope, intercept = 0.01 * GOLDEN, 20.0
    size = (2 + round(3 / slope), 60)  # three steps
    got = scores(
        point_edge(size, slope, intercept, n), box_edge(size, slope, intercept), edge_scene(slope, intercept, size), rgb
    )
    # The n sub-columns of a pixel differ in height by less than slope: a change of a level by at most slope / 2.
    assert got["jaggies"].value == pytest.approx(expected, abs=slope / 2 + expected / 100)


def test_random_samples_make_white_noise_and_no_stairs(edge_scene, rgb, box_edge):
    rng = np.random.default_rng(11)
    samples, seeds, size = 16, 12, (402, 40)
    slope, intercept = 0.02 * GOLDEN, 20.0
    truth = box_edge(size, slope, intercept)
    test = rng.binomial(samples, truth, size=(seeds, 1, *truth.shape)) / samples
    scene = edge_scene(slope, intercept, size)
    spread = measure("jaggies", rgb(test), rgb(truth)[None], scene=scene)
    # Coverage of the one or two pixels of a column: variance c (1 - c) / N, on average 1 / (6 N); the mean over five
    # steps of the edge is within 2 % of it, the estimate from 4800 values within 5 sqrt(2 / 4800) = 10 %.
    assert spread.value**2 == pytest.approx(1 / (6 * samples), rel=0.12)
    stairs = measure("jaggies_str", rgb(test), rgb(truth)[None], scene=scene)
    assert stairs.extras["noise_from"] == "seeds"
    # 16 dimensions of 400 with the mean's variance: the projection's standard deviation is sqrt(2 16) / 400 of it.
    assert abs(stairs.extras["signed_square"]) < 5 * math.sqrt(32) / 400 / (6 * samples * seeds)
    alone = measure("jaggies_str", rgb(test[0]), rgb(truth)[None], scene=scene)
    assert alone.extras["noise_from"] == "residual"
    assert abs(alone.extras["signed_square"]) < 5 * math.sqrt(32) / 400 / (6 * samples)


@pytest.mark.parametrize("slope", [0.1 * GOLDEN, -0.3 * GOLDEN, GOLDEN, 0.5, 1.0])
def test_box_pictures_put_the_edge_where_it_is(box_edge, slope):
    # In the definition r compares two pictures; against the line itself the sum down a column of coverage is exact.
    size, intercept = (100, 160), 20.3 + 100 * max(-slope, 0.0)
    where = box_edge(size, slope, intercept).sum(axis=0)
    assert np.abs(where - (slope * (np.arange(size[0]) + 0.5) + intercept)).max() < 1e-10


@pytest.mark.parametrize("slope", [0.1 * GOLDEN, 0.3, 0.5, 1.0])
@pytest.mark.parametrize("offset", [0.0, 0.25, 0.7])
def test_one_sample_is_displaced_by_at_most_half_a_row(edge_scene, rgb, box_edge, point_edge, slope, offset):
    size = (200, 40 + round(200 * slope))
    args = (size, slope, 20.0 + offset)
    got = scores(point_edge(*args), box_edge(*args), edge_scene(slope, 20.0 + offset, size), rgb)
    assert 0.0 <= got["jaggies_rms"].value <= 0.5 + 1e-9
    assert abs(got["jaggies_bias"].value) <= got["jaggies_rms"].value + 1e-12


def test_exact_pictures_of_another_unit_filter_put_the_edge_in_the_same_place(edge_scene, rgb, box_edge):
    # A tent is a box of boxes: average the box filter's coverage over a pixel of offsets in y. It moves no column sum.
    slope, intercept = 0.1 * GOLDEN, 20.0
    offsets = (np.arange(64) + 0.5) / 64 - 0.5
    tent = np.mean([box_edge(SIZE, slope, intercept + o) for o in offsets], axis=0)
    got = scores(tent, box_edge(SIZE, slope, intercept), edge_scene(slope, intercept), rgb, filter_radius_px=1.0)
    assert got["jaggies_rms"].value < 1e-10
    assert (
        measure(
            "rmse", rgb(tent)[None], rgb(box_edge(SIZE, slope, intercept))[None], scene=edge_scene(slope, intercept)
        ).value
        > 1e-3
    )


def test_gaussian_edges_ripple_as_derived(edge_scene, rgb, box_edge):
    sigma, slope, intercept, size = 0.5, 0.05 * GOLDEN, 20.0, (522, 60)
    distance = slope * (np.arange(size[0]) + 0.5) + intercept - (np.arange(size[1])[:, None] + 0.5)
    picture = special.ndtr(distance / math.hypot(1, slope) / sigma)
    got = scores(
        picture, box_edge(size, slope, intercept), edge_scene(slope, intercept, size), rgb, filter_radius_px=3.0
    )
    amplitude = math.exp(-2 * math.pi**2 * sigma**2 * (1 + slope**2)) / math.pi
    assert math.exp(-2 * math.pi**2 * sigma**2) / math.pi == pytest.approx(0.00228925, abs=1e-8)
    # Sixteen ripples, give or take a part of one.
    assert got["jaggies"].value == pytest.approx(amplitude / math.sqrt(2), rel=1 / 32)


@pytest.mark.parametrize("intercept", [20.5, 20.25])
def test_an_edge_along_the_grid_is_shifted_and_not_ragged(edge_scene, rgb, box_edge, point_edge, intercept):
    got = scores(point_edge(SIZE, 0.0, intercept), box_edge(SIZE, 0.0, intercept), edge_scene(0.0, intercept), rgb)
    assert got["jaggies"].value == pytest.approx(0.0, abs=1e-12)
    assert got["jaggies_str"].value == pytest.approx(0.0, abs=1e-12)
    # Bright above the edge: the picture's edge is at the last sample row above it, 20 here; 20 - intercept.
    assert got["jaggies_bias"].value == pytest.approx(20.0 - intercept, abs=1e-12)


def test_turning_the_fact_round_turns_the_sign(make_scene, edge_fact, rgb, box_edge, point_edge):
    slope, intercept = 0.0, 20.25
    start, end = (-10.0, intercept), (SIZE[0] + 10.0, intercept)
    back = make_scene(SIZE, facts=Facts(edges=(edge_fact(SIZE, end, start),)))
    truth, test = box_edge(SIZE, slope, intercept), point_edge(SIZE, slope, intercept)
    # Bright below: the same place is now found in the picture's complement.
    got = scores(1.0 - test, 1.0 - truth, back, rgb)
    assert got["jaggies_bias"].value == pytest.approx(-0.25, abs=1e-12)


def test_transposition_changes_nothing_but_the_axis(make_scene, edge_fact, rgb, box_edge, point_edge):
    slope, intercept, size = 0.1 * GOLDEN, 20.0, (200, 80)
    wide = make_scene(size, facts=Facts(edges=(line(edge_fact, size, slope, intercept),)))
    tall_size = size[::-1]
    x0, x1 = -10.0, size[0] + 10.0
    upwards = edge_fact(tall_size, (slope * x1 + intercept, x1), (slope * x0 + intercept, x0))
    tall = make_scene(tall_size, facts=Facts(edges=(upwards,)))
    test, truth = point_edge(size, slope, intercept), box_edge(size, slope, intercept)
    for name, score in scores(test, truth, wide, rgb).items():
        other = scores(test.T, truth.T, tall, rgb)[name]
        assert other.value == pytest.approx(score.value, rel=1e-9, abs=1e-12)


def test_exposure_and_offset_change_nothing(edge_scene, rgb, box_edge, point_edge):
    slope, intercept = 0.1 * GOLDEN, 20.0
    test, truth = point_edge(SIZE, slope, intercept), box_edge(SIZE, slope, intercept)
    plain = scores(test, truth, edge_scene(slope, intercept), rgb)
    other = scores(7 * test + 3, 7 * truth + 3, edge_scene(slope, intercept, contrast=7.0), rgb)
    for name in NAMES:
        assert other[name].value == pytest.approx(plain[name].value, rel=1e-9)


def test_an_edge_moves_with_the_object_whose_outline_it_is(make_scene, edge_fact, rgb, box_edge, point_edge):
    size, slope = (200, 120), 0.1 * GOLDEN
    fact = edge_fact(size, (-20.0, slope * -20 + 30), (220.0, slope * 220 + 30))
    outline = np.array([fact.start, fact.end, (120.0, 300.0, 0.0), (-120.0, 300.0, 0.0)])
    moving = Surface(outline, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32), motion=Motion((0.0, -300.0, 0.0)))
    animation = Animation(30.0, 3, 0.0)
    truth, test = (np.array([f(size, slope, 30.0 + 10.0 * k) for k in (2, 3, 4)]) for f in (box_edge, point_edge))
    scene = make_scene(size, facts=Facts(edges=(fact,)), objects=(moving,), animation=animation)
    score = measure("jaggies", rgb(test), rgb(truth), scene=scene, frame_start=2)
    assert score.value == pytest.approx(1 / math.sqrt(12), rel=0.1)
    assert score.extras["edges"][0]["frames"] == 3
    # Without the object the fact stays behind, where the picture has no error.
    still = make_scene(size, facts=Facts(edges=(fact,)), animation=animation)
    assert measure("jaggies", rgb(test), rgb(truth), scene=still, frame_start=2).value < 1e-12
    # A camera that moves up takes every edge down the picture.
    camera = make_scene(size, facts=Facts(edges=(fact,)), animation=animation, velocity=(0.0, 300.0, 0.0))
    assert measure("jaggies", rgb(test), rgb(truth), scene=camera, frame_start=2).value == pytest.approx(score.value)


def test_a_spinning_edge_is_transposed_when_it_is_steep(make_scene, edge_fact, rgb):
    size = (120, 120)
    fact = edge_fact(size, (10.0, 60.0), (110.0, 60.0))
    outline = np.array([fact.start, fact.end, (50.0, 40.0, 0.0), (-50.0, 40.0, 0.0)])
    spin = Spin((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 30.0 / 4)
    turning = Surface(outline, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32), motion=Motion(spin=spin))
    scene = make_scene(size, facts=Facts(edges=(fact,)), objects=(turning,), animation=Animation(30.0, 2, 0.0))
    truth = np.zeros((1, *size))
    test = truth.copy()
    test[0, :, 59] = 0.25  # bright stays left of the edge, which now points up
    score = measure("jaggies_bias", rgb(test), rgb(truth), scene=scene, frame_start=1)
    assert score.extras["edges"][0]["transposed"] is True
    assert score.value == pytest.approx(0.25, abs=1e-12)


def test_columns_near_another_edge_are_left_out(make_scene, edge_fact, rgb):
    size = (200, 100)
    flat = edge_fact(size, (-10.0, 50.0), (210.0, 50.0))
    crossing = edge_fact(size, (100.0, 100.0), (100.0, 0.0))
    truth = np.zeros((1, size[1], size[0]))
    test = truth.copy()
    test[0, 50, 98:102] = 1.0  # an error of the other edge
    both = measure("jaggies", rgb(test), rgb(truth), scene=make_scene(size, facts=Facts(edges=(flat, crossing))))
    assert both.extras["edges"][0]["value"] == 0.0
    assert 180 < both.extras["edges"][0]["columns"] < 198
    alone = measure("jaggies", rgb(test), rgb(truth), scene=make_scene(size, facts=Facts(edges=(flat,))))
    assert alone.value > 0.1


@pytest.mark.parametrize("name", NAMES)
def test_an_edge_outside_the_picture_has_no_score(edge_scene, rgb, name):
    picture = rgb(np.zeros((1, SIZE[1], SIZE[0])))
    for intercept in (-5.0, 1.0, SIZE[1] - 1.0, SIZE[1] + 40.0):
        score = measure(name, picture, picture, scene=edge_scene(0.0, intercept))
        assert (score.value, score.status) == (None, "edge_leaves_window")


def test_stairs_need_32_columns(edge_scene, rgb):
    picture = rgb(np.zeros((1, 40, 33)))
    scene = edge_scene(0.1, 20.0, (33, 40))
    assert measure("jaggies", picture, picture, scene=scene).value == 0.0
    score = measure("jaggies_str", picture, picture, scene=scene)
    assert (score.value, score.status) == (None, "undefined_too_small")


def test_a_reference_that_is_not_good_enough_is_said(edge_scene, rgb, box_edge, point_edge):
    slope, intercept = 0.1 * GOLDEN, 20.0
    test, truth = point_edge(SIZE, slope, intercept), box_edge(SIZE, slope, intercept)
    scene = edge_scene(slope, intercept)
    poor = scores(test, truth, scene, rgb, reference_uncertainty=0.05)
    assert (poor["jaggies"].value, poor["jaggies"].status) == (None, "below_reference_floor")
    good = scores(test, truth, scene, rgb, reference_uncertainty=1e-3)
    assert good["jaggies"].status == "ok"


def test_sensitivity_is_mannos_and_sakrisons():
    f = np.linspace(0.0, 60.0, 60_001)
    published = 2.6 * (0.0192 + 0.114 * f) * np.exp(-((0.114 * f) ** 1.1))
    assert f[np.argmax(published)] == pytest.approx(8.0, abs=0.2)
    assert published.max() == pytest.approx(0.98, abs=2e-3)
    assert np.abs(contrast_sensitivity(f) - published / published.max()).max() < 1e-7


@pytest.mark.parametrize("k", [1, 2, 5])
def test_a_harmonic_is_seen_by_the_sensitivity_at_its_frequency(edge_scene, rgb, k):
    slope, intercept, amplitude = 0.1 * GOLDEN, 20.3, 0.2
    truth = np.zeros((SIZE[1], SIZE[0]))
    test = truth.copy()
    columns = np.arange(SIZE[0])
    line_at = slope * (columns + 0.5) + intercept
    test[np.floor(line_at).astype(int), columns] = amplitude * np.cos(2 * np.pi * k * line_at)
    visible = scores(test, truth, edge_scene(slope, intercept), rgb)["jaggies_str"].extras["visible"]
    assert (visible["ppd"], visible["sensitivity"]) == (60.0, "Mannos and Sakrison 1974")
    cycles = k * slope / math.hypot(1, slope) * 60.0
    # 32 stairs and a part of one: the mean square of the harmonic, its mean, which is taken off, and what it shows of
    # its neighbours, 1 / (pi 32) of the amplitude, squared, of sensitivities up to 1.
    assert visible["value"] == pytest.approx(
        amplitude / math.sqrt(2) * float(contrast_sensitivity(np.array(cycles))), rel=1 / 64
    )


def test_visible_stairs_of_coinciding_harmonics_are_counted_once(edge_scene, rgb, box_edge, point_edge):
    size = (130, 100)
    got = scores(point_edge(size, 0.5, 10.125), box_edge(size, 0.5, 10.125), edge_scene(0.5, 10.125, size), rgb)
    # One wave, which is harmonics 1, 3, 5 and 7: it is seen by their mean sensitivity, of squares.
    cycles = np.array([1, 3, 5, 7]) * 0.5 / math.hypot(1, 0.5) * 60.0
    expected = 0.25 * math.sqrt(np.mean(contrast_sensitivity(cycles) ** 2))
    assert got["jaggies_str"].extras["visible"]["value"] == pytest.approx(expected, rel=1e-6)
