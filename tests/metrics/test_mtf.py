"""MTF and width of known edges: closed forms at many angles, and what noise, motion and too few pixels do."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import integrate, optimize, special

from aliasbench.metrics.catalog import measure, measure_all
from aliasbench.renderers.catalog import render
from aliasbench.scenes.catalog import build_scene
from aliasbench.scenes.model import Animation, Facts, Motion, Surface

NAMES = ("mtf50", "edge_width")
SIGMA = 0.5
RADIUS = {"point": 0.5, "box": 0.5, "tent": 1.0, "gauss": 1.5}
# Phases fill one pixel on all but the last three, which have 20, 8 and 5.
SLOPES = (0.01, 0.0309, 0.0618, -0.1618, 0.3141, -0.618, 0.99, 0.05, 0.125, 0.2)
COARSE = np.arange(17) / 16


def distance(size, slope, intercept):
    """(h, w) of pixel middles to the line, positive above it."""
    x, y = np.arange(size[0]) + 0.5, np.arange(size[1])[:, None] + 0.5
    return (slope * x + intercept - y) / math.hypot(1, slope)


def boxes(d, widths):
    """The integral up to d of the convolution of boxes, by differences of u^n / n!."""
    total = np.zeros(np.shape(d))
    for signs in itertools.product((-1, 1), repeat=len(widths)):
        shift = sum(s * w / 2 for s, w in zip(signs, widths, strict=True))
        total = total + math.prod(signs) * np.maximum(d + shift, 0.0) ** len(widths)
    return np.clip(total / math.factorial(len(widths)) / math.prod(widths), 0.0, 1.0)


def profile(kind, d, slope):
    """The exact picture of a half plane at distances d: the filter's projection on the normal, integrated."""
    cos, sin = 1 / math.hypot(1, slope), abs(slope) / math.hypot(1, slope)
    if kind == "point":
        return np.where(d > 0, 1.0, 0.0)
    if kind == "gauss":
        return special.ndtr(d / SIGMA)
    return boxes(d, (cos, sin) if kind == "box" else (cos, cos, sin, sin))


def closed_form(kind, f, slope):
    """The transfer along the normal: of separable filters the product of both axes'."""
    cos, sin = 1 / math.hypot(1, slope), abs(slope) / math.hypot(1, slope)
    if kind == "point":
        return np.ones(np.shape(f))
    if kind == "gauss":
        return np.exp(-2 * (np.pi * SIGMA * f) ** 2)
    return (np.sinc(f * cos) * np.sinc(f * sin)) ** (1 if kind == "box" else 2)


def half(kind, slope):
    return optimize.brentq(lambda f: closed_form(kind, f, slope) - 0.5, 0.05, 1.0)


def width(kind, slope):
    return 2 * optimize.brentq(lambda d: profile(kind, np.array(d), slope) - 0.9, 0.0, 3.0)


def potential(curve):
    """int_.5^1 MTF^2 / int_0^.5 MTF^2."""
    return integrate.quad(lambda f: curve(f) ** 2, 0.5, 1.0)[0] / integrate.quad(lambda f: curve(f) ** 2, 0.0, 0.5)[0]


def tolerance(kind, f, gap):
    """How far a measured transfer may be from the closed form: relative, absolute.

    Bins of 1/16 and steps of `gap` are corrected by 1 / (sinc(f / 16) sinc(f gap)): uneven ones by at most as much too
    little or too much. The images of the spectrum at f +- 1/gap are added, times what the differences leave of them;
    of filters that are nowhere wider than a pixel no more than of a box along the axis.
    """
    step = max(gap, 1 / 16)
    images = sum(abs(closed_form(kind, step**-1 + s * f, 0.0) * np.sinc(1 + s * f * step)) for s in (-1, 1))
    return 1 / (np.sinc(f / 16) * np.sinc(f * gap)) - 1, images * (kind != "point")


@pytest.fixture
def edge_scene(make_scene, edge_fact):
    def make(size, *lines, **kwargs):
        """Lines (slope, intercept) or (slope, intercept, x0, x1)."""
        facts = []
        for slope, intercept, *ends in lines:
            x0, x1 = ends or (-10.0, size[0] + 10.0)
            facts.append(edge_fact(size, (x0, slope * x0 + intercept), (x1, slope * x1 + intercept)))
        return make_scene(size, facts=Facts(edges=tuple(facts)), **kwargs)

    return make


def place(slope, columns=300):
    """(size, intercept) of a picture that the whole edge crosses."""
    rise = abs(slope) * columns
    return (columns, 40 + math.ceil(rise)), 20.3 + (rise if slope < 0 else 0.0)


@pytest.fixture
def scores(edge_scene, rgb):
    def run(kind, slope, columns=300, **kwargs):
        size, intercept = place(slope, columns)
        picture = rgb(profile(kind, distance(size, slope, intercept), slope))[None]
        scene = edge_scene(size, (slope, intercept))
        return measure_all(NAMES, picture, picture, scene=scene, **{"filter_radius_px": RADIUS[kind], **kwargs})

    return run


def test_figures_of_filters_along_an_axis():
    assert closed_form("box", 0.5, 0.0) == pytest.approx(2 / math.pi, abs=1e-12)
    assert closed_form("tent", 0.5, 0.0) == pytest.approx(4 / math.pi**2, abs=1e-12)
    assert closed_form("gauss", 0.5, 0.0) == pytest.approx(0.291213, abs=1e-6)
    for kind, expected in (("point", 1.0), ("box", 0.166898), ("tent", 0.049727), ("gauss", 0.027023)):
        assert potential(lambda f, kind=kind: closed_form(kind, f, 0.0)) == pytest.approx(expected, abs=1e-6)
    # Closed forms of the widths; the boxes' sum needs some width on the other axis, of which the square counts.
    assert width("box", 1e-4) == pytest.approx(0.8, abs=1e-6)
    assert width("tent", 1e-3) == pytest.approx(2 * (1 - math.sqrt(0.2)), abs=1e-5)
    assert 2 * (1 - math.sqrt(0.2)) == pytest.approx(1.105573, abs=1e-6)
    assert width("gauss", 0.0) == pytest.approx(2.563103 * SIGMA, abs=1e-6)


@pytest.mark.parametrize("slope", SLOPES)
@pytest.mark.parametrize("kind", ["point", "box", "tent", "gauss"])
def test_the_transfer_of_an_exact_picture_is_its_filters(scores, kind, slope):
    extras = scores(kind, slope)["mtf50"].extras
    assert extras["frequencies"] == list(COARSE)
    gap = extras["edges"][0]["gap_px"]
    rel, images = tolerance(kind, COARSE, gap)
    expected = closed_form(kind, COARSE, slope)
    assert np.all(np.abs(np.array(extras["mtf"]) - expected) <= rel * expected + images + 1e-3)
    assert extras["mtf"][0] == pytest.approx(1.0, abs=1e-12)
    assert extras["mtf_nyquist"] == extras["mtf"][8]
    assert extras["reference_mtf"] == pytest.approx(extras["mtf"], abs=1e-12)
    # Of an integral of squares the mean tolerance counts twice, and of a ratio of two of them four times.
    wanted = potential(lambda f: closed_form(kind, f, slope))
    loose = 4 * (rel[8:].mean() + (images / expected)[8:12].mean())
    assert extras["aliasing_potential"] == pytest.approx(wanted, rel=loose, abs=1e-4)
    energy = 2 * integrate.quad(lambda f: (closed_form(kind, f, slope) / (2 * math.pi * f)) ** 2, 0.5, 1.0)[0]
    assert extras["aliased_energy"] == pytest.approx(energy, rel=loose, abs=1e-5)


@pytest.mark.parametrize("slope", [0.0309, 0.0618, 0.3141, -0.618, 0.99])
@pytest.mark.parametrize("kind", ["box", "tent", "gauss"])
def test_bins_and_differences_are_corrected(scores, kind, slope):
    extras = scores(kind, slope, 400)["mtf50"].extras
    rel, _ = tolerance(kind, 0.5, 1 / 16)
    # Of 25 columns a bin the filling varies by no more than a quarter: so much of the correction, .32 %, may be wrong.
    assert rel == pytest.approx(0.0032, abs=1e-4)
    assert extras["mtf_nyquist"] == pytest.approx(closed_form(kind, 0.5, slope), rel=rel / 4)


@pytest.mark.parametrize(("slope", "step"), [(0.1, 0.1), (0.125, 0.125), (0.25, 0.25), (-0.2, 0.2), (0.75, 0.25)])
def test_equal_steps_between_phases_are_corrected_exactly(scores, slope, step):
    extras = scores("gauss", slope)["mtf50"].extras
    gap = step / math.hypot(1, slope)
    assert extras["edges"][0]["gap_px"] == pytest.approx(gap, abs=1e-9)
    # One distance a bin: no bin to correct for, and the nearest image of a Gaussian, 3 cycles/px away, is 4e-20. What
    # is left is the cut of the profile where its levels are read, at 3 sigma or more: .1 % of a tail's share of it.
    assert 1 / np.sinc(gap / 2) - 1 > 3e-3
    assert extras["mtf"][:9] == pytest.approx(list(closed_form("gauss", COARSE[:9], slope)), abs=1e-4)


@pytest.mark.parametrize("slope", SLOPES)
@pytest.mark.parametrize("kind", ["box", "tent", "gauss"])
def test_half_of_the_modulation_and_the_rise_are_the_filters(scores, kind, slope):
    got = scores(kind, slope)
    assert [got[n].status for n in NAMES] == ["ok", "ok"]
    f = half(kind, slope)
    rel, images = tolerance(kind, f, got["mtf50"].extras["edges"][0]["gap_px"])
    steep = (closed_form(kind, f - 1e-4, slope) - closed_form(kind, f + 1e-4, slope)) / 2e-4
    assert got["mtf50"].value == pytest.approx(f, abs=(rel / 2 + images) / steep + 1e-4)
    assert got["mtf50"].extras["reference_mtf50"] == got["mtf50"].value
    # A bin's mean is off by S'' / (24 16^2), on both sides: S'' / S' is below 3 per pixel at 10 % of these filters,
    # and a bin that holds a kink of the box by a quarter of a bin at most, where the phases are few by one of a step.
    few = got["mtf50"].extras["edges"][0]["gap_px"] > 1 / 14
    assert got["edge_width"].value == pytest.approx(width(kind, slope), rel=0.01 if few else 0.002)
    assert got["edge_width"].extras["reference_edge_width"] == got["edge_width"].value
    assert got["edge_width"].extras["overshoot"] == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize(
    ("kind", "nyquist", "alias"),
    [("box", 2 / math.pi, 0.166898), ("tent", 4 / math.pi**2, 0.049727), ("gauss", 0.291213, 0.027023)],
)
def test_measured_along_an_axis_the_figures_of_the_filters_are_found(scores, kind, nyquist, alias):
    extras = scores(kind, 0.01, 420)["mtf50"].extras
    rel, images = tolerance(kind, 0.5, extras["edges"][0]["gap_px"])
    # At slope .01 the other axis takes (pi f .01)^2 / 6 = 4e-5 of the transfer, and up to four times that of squares.
    assert extras["mtf_nyquist"] == pytest.approx(nyquist, rel=rel, abs=images + 4e-5)
    assert extras["aliasing_potential"] == pytest.approx(alias, rel=4 * rel)


@pytest.mark.parametrize("slope", SLOPES)
def test_point_samples_have_no_limit_and_no_width(scores, slope):
    got = scores("point", slope)
    assert (got["mtf50"].value, got["mtf50"].status) == (None, "undefined_no_crossing")
    assert (got["edge_width"].value, got["edge_width"].status) == (None, "below_resolution")
    extras = got["mtf50"].extras
    gap = extras["edges"][0]["gap_px"]
    # Corrected for bins and steps that a step does not see; a bin of two distances at its ends spreads sqrt 3 times one
    # that is evenly filled.
    most = 1 / (np.sinc(math.sqrt(3) / 32) * np.sinc(gap / 2))
    assert 1.0 <= extras["mtf_nyquist"] <= most
    assert extras["mtf50"] is None
    assert got["edge_width"].extras["measured"] <= gap == got["edge_width"].extras["resolution_px"]
    if gap < 0.07:
        assert extras["mtf_nyquist"] == pytest.approx(1.0, abs=4e-3)
        assert extras["aliasing_potential"] == pytest.approx(1.0, abs=2e-2)
        # int 2 / (2 pi f)^2 from 1/2 to 1.
        assert extras["aliased_energy"] == pytest.approx(1 / (2 * math.pi**2), rel=2e-2)


@pytest.mark.parametrize("slope", [0.0, 1 / 3, 0.5, -0.5, 1.0, -1.0])
@pytest.mark.parametrize("kind", ["point", "gauss"])
def test_edges_with_few_phases_have_no_score(scores, kind, slope):
    for score in scores(kind, slope).values():
        assert (score.value, score.status) == (None, "undefined_too_few_phases")
        assert score.extras["edges"][0]["gap_px"] > score.extras["largest_gap_px"]


def test_an_edge_along_the_grid_has_the_phases_of_its_steps(make_scene, edge_fact, rgb):
    size, frames = (40, 30), 16
    fact = edge_fact(size, (-5.0, 12.0), (45.0, 12.0))
    outline = np.array([fact.start, fact.end, (25.0, 40.0, 0.0), (-25.0, 40.0, 0.0)])
    motion = Motion(velocity=(0.0, -30.0 * 7 / 16, 0.0))  # 7/16 of a pixel a frame: all sixteenths
    plane = Surface(outline, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32), motion=motion)
    scene = make_scene(size, facts=Facts(edges=(fact,)), objects=(plane,), animation=Animation(30.0, frames))
    picture = rgb([profile("gauss", distance(size, 0.0, 12.0 + 7 / 16 * k), 0.0) for k in range(frames)])
    got = measure_all(NAMES, picture, picture, scene=scene, filter_radius_px=1.5)
    assert got["mtf50"].extras["edges"][0]["gap_px"] == pytest.approx(1 / 16, abs=1e-9)
    assert got["mtf50"].value == pytest.approx(half("gauss", 0.0), rel=1e-3)
    assert got["edge_width"].value == pytest.approx(2.563103 * SIGMA, rel=2e-3)
    # With four of the frames the phases are half a pixel apart somewhere.
    few = measure("mtf50", picture[:2], picture[:2], scene=scene, filter_radius_px=1.5)
    assert few.status == "undefined_too_few_phases"


@pytest.mark.parametrize("slope", [0.0618, -0.3141])
def test_transposed_and_turned_round_edges_score_the_same(make_scene, edge_fact, rgb, scores, slope):
    plain = scores("box", slope)
    size, intercept = place(slope)
    grey = 1.0 - profile("box", distance(size, slope, intercept), slope).T
    x0, x1 = -10.0, size[0] + 10.0
    downwards = edge_fact(size[::-1], (slope * x0 + intercept, x0), (slope * x1 + intercept, x1))
    tall = make_scene(size[::-1], facts=Facts(edges=(downwards,)))
    got = measure_all(NAMES, rgb(grey)[None], rgb(grey)[None], scene=tall)
    assert got["mtf50"].extras["edges"][0]["transposed"] is True
    assert got["mtf50"].extras["edges"][0]["contrast"] == pytest.approx(1.0, abs=1e-9)
    for name in NAMES:
        # Pixels on the end of a bin may go to the other side of it.
        assert got[name].value == pytest.approx(plain[name].value, rel=2e-3)


@pytest.mark.parametrize(("gain", "offset"), [(0.01, 0.4), (3e-5, 1.0), (-0.5, 0.9), (1e200, 0.0)])
def test_contrast_and_level_do_not_matter(edge_scene, rgb, gain, offset):
    slope = 0.0618
    size, intercept = place(slope)
    picture = rgb(profile("box", distance(size, slope, intercept), slope))[None]
    scene = edge_scene(size, (slope, intercept))
    plain = measure_all(NAMES, picture, picture, scene=scene)
    got = measure_all(NAMES, gain * picture + offset, picture, scene=scene)
    for name in NAMES:
        assert got[name].value == pytest.approx(plain[name].value, rel=1e-9)
        assert got[name].extras["edges"][0]["contrast"] == pytest.approx(gain, rel=1e-9)


def test_a_displaced_edge_is_not_less_sharp(edge_scene, rgb):
    size = (300, 90)
    lines = ((0.0618, 20.3), (-0.0309, 70.2))
    scene = edge_scene(size, *lines)

    def band(shift):
        """Bright above the first line and below the second, whose fact must then run leftwards: use its complement."""
        upper = profile("box", distance(size, 0.0618, 20.3 + shift), 0.0618)
        lower = profile("box", distance(size, -0.0309, 70.2 - shift), -0.0309)
        return rgb(upper + 1.0 - lower)[None]

    true, moved = (measure_all(NAMES, band(s), band(0.0), scene=scene) for s in (0.0, 0.3))
    assert [e["contrast"] for e in true["mtf50"].extras["edges"]] == pytest.approx([1.0, -1.0], abs=1e-9)
    for name in NAMES:
        assert moved[name].value == pytest.approx(true[name].value, rel=2e-3)


def test_of_several_edges_the_curves_are_averaged(edge_scene, rgb):
    # A sharp and a soft edge: the mean curve's crossing is not the mean of the crossings.
    size, slopes, sigmas = (300, 120), (0.0618, 0.0618), (0.3, 1.0)
    d = [distance(size, m, b) for m, b in zip(slopes, (25.3, 85.2), strict=True)]
    picture = rgb(special.ndtr(d[0] / sigmas[0]) + special.ndtr(d[1] / sigmas[1]))[None] / 2
    scene = edge_scene(size, (slopes[0], 25.3), (slopes[1], 85.2))
    got = measure_all(NAMES, picture, picture, scene=scene, filter_radius_px=4.0)

    def mean(f):
        return np.mean([np.exp(-2 * (np.pi * s * f) ** 2) for s in sigmas], axis=0)

    crossing = optimize.brentq(lambda f: mean(f) - 0.5, 0.1, 1.0)
    assert got["mtf50"].value == pytest.approx(crossing, rel=2e-3)
    rise = optimize.brentq(lambda u: np.mean([special.ndtr(u / s) for s in sigmas]) - 0.9, 0.0, 5.0)
    assert got["edge_width"].value == pytest.approx(2 * rise, rel=2e-3)
    assert got["mtf50"].extras["mtf"] == pytest.approx(list(mean(COARSE)), abs=2e-3)


@pytest.mark.parametrize("amount", [0.5, 1.5])
def test_negative_lobes_raise_the_curve_and_are_told(edge_scene, rgb, amount):
    slope, narrow, wide = 0.1618, 0.4, 0.8
    size, intercept = place(slope)
    d = distance(size, slope, intercept)
    grey = (1 + amount) * special.ndtr(d / narrow) - amount * special.ndtr(d / wide)
    scene = edge_scene(size, (slope, intercept))
    got = measure_all(NAMES, rgb(grey)[None], rgb(grey)[None], scene=scene, filter_radius_px=4.0)

    def curve(f):
        gauss = [np.exp(-2 * (np.pi * s * f) ** 2) for s in (narrow, wide)]
        return (1 + amount) * gauss[0] - amount * gauss[1]

    assert got["mtf50"].extras["mtf"] == pytest.approx(list(curve(COARSE)), abs=2e-3)
    assert max(got["mtf50"].extras["mtf"]) > 1.01
    assert got["mtf50"].value == pytest.approx(optimize.brentq(lambda f: curve(f) - 0.5, 0.3, 1.0), rel=2e-3)
    # The profile's own extreme, at steps so fine that its flat top is met to 1e-3.
    assert got["edge_width"].extras["overshoot"] == pytest.approx(grey.max() - 1.0, abs=2e-3)


@pytest.mark.parametrize(("velocity", "shutter"), [((0.0, 2.0), 0.5), ((1.7, -0.9), 1.0), ((3.0, 0.0), 1.0)])
def test_an_open_shutter_blurs_by_the_sweep_along_the_normal(make_scene, edge_fact, rgb, velocity, shutter):
    slope, intercept, size, frames = 0.1618, 30.3, (300, 110), 3
    x0, x1 = -30.0, size[0] + 30.0
    fact = edge_fact(size, (x0, slope * x0 + intercept), (x1, slope * x1 + intercept))
    outline = np.array([fact.start, fact.end, (*fact.end[:1], 90.0, 0.0), (*fact.start[:1], 90.0, 0.0)])
    motion = Motion(velocity=(30.0 * velocity[0], -30.0 * velocity[1], 0.0))
    plane = Surface(outline, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32), motion=motion)
    animation = Animation(30.0, frames, shutter)
    scene = make_scene(size, facts=Facts(edges=(fact,)), objects=(plane,), animation=animation)
    rows = velocity[1] - slope * velocity[0]  # by which the line moves down in a frame
    sweep = abs(rows) * shutter / math.hypot(1, slope)
    # The mean over the sweep of the box filter's profile: a third box.
    widths = (1 / math.hypot(1, slope), slope / math.hypot(1, slope), sweep)
    picture = rgb([boxes(distance(size, slope, intercept + rows * (k + shutter / 2)), widths) for k in range(frames)])
    got = measure_all(NAMES, picture, picture, scene=scene)

    def curve(f):
        return closed_form("box", f, slope) * np.sinc(f * sweep)

    assert got["mtf50"].value == pytest.approx(optimize.brentq(lambda f: curve(f) - 0.5, 0.05, 1.0), rel=2e-3)
    wanted = 2 * optimize.brentq(lambda d: boxes(np.array(d), widths) - 0.9, 0.0, 3.0)
    assert got["edge_width"].value == pytest.approx(wanted, rel=3e-3)


@pytest.mark.parametrize(("samples", "seeds", "seed"), [(16, 1, 1), (16, 4, 2), (4, 1, 3), (64, 2, 4)])
def test_noise_of_random_samples_moves_the_figures_by_as_much_as_derived(edge_scene, rgb, samples, seeds, seed):
    slope = 0.0618
    size, intercept = place(slope, 400)
    truth = profile("box", distance(size, slope, intercept), slope)
    test = np.random.default_rng(seed).binomial(samples, truth, size=(seeds, 1, *truth.shape)) / samples
    got = measure_all(NAMES, rgb(test), rgb(truth)[None], scene=edge_scene(size, (slope, intercept)))
    # The transform is 2 pi i f times that of the profile: white noise of variance c (1 - c) / N, whose integral across
    # the edge is 1 / (6 N), at 400 pixels per pixel of distance makes the part along the curve vary by half of
    # (2 pi f)^2 / (6 N 400). Five deviations.
    f = half("box", slope)
    deviation = math.sqrt((2 * math.pi * f) ** 2 / (6 * samples * 400 * seeds) / 2)
    steep = (closed_form("box", f - 1e-4, slope) - closed_form("box", f + 1e-4, slope)) / 2e-4
    assert got["mtf50"].value == pytest.approx(f, abs=5 * deviation / steep)
    assert got["mtf50"].extras["reference_mtf50"] == pytest.approx(f, rel=1e-3)
    # A bin has 25 pixels; c (1 - c) = .09 at its crossing, and the slope is 1. The first bin beyond counts, so the
    # crossings may lie inwards by two deviations, and by five where they are not.
    bin_deviation = math.sqrt(0.09 / (samples * seeds * 25))
    assert -7 * bin_deviation < got["edge_width"].value - width("box", slope) < 7 * bin_deviation


@pytest.mark.parametrize("name", NAMES)
def test_a_picture_without_the_edge_has_no_sharpness(edge_scene, rgb, name):
    size, intercept = place(0.0618)
    scene = edge_scene(size, (0.0618, intercept))
    truth = rgb(profile("box", distance(size, 0.0618, intercept), 0.0618))[None]
    noise = rgb(np.random.default_rng(4).normal(size=(1, *size[::-1])))
    for picture in (np.full(truth.shape, 0.3), noise, 1e-7 * truth):
        score = measure(name, picture, truth, scene=scene)
        assert (score.value, score.status) == (None, "undefined_no_edge")
    for line in ((0.0618, -40.0), (0.0618, 90.0)):
        assert measure(name, truth, truth, scene=edge_scene(size, line)).status == "edge_leaves_window"
    assert measure(name, truth, truth, scene=edge_scene(size)).status == "not_applicable"


def test_a_reference_without_the_edge_has_no_figures_beside_the_pictures(edge_scene, rgb):
    size, intercept = place(0.0618)
    truth = rgb(profile("box", distance(size, 0.0618, intercept), 0.0618))[None]
    got = measure_all(NAMES, truth, np.zeros(truth.shape), scene=edge_scene(size, (0.0618, intercept)))
    assert [got[n].status for n in NAMES] == ["ok", "ok"]
    assert got["mtf50"].extras["reference_mtf50"] is None
    assert got["edge_width"].extras["reference_edge_width"] is None


def test_edges_with_few_phases_are_left_out_of_the_mean(edge_scene, rgb):
    size = (300, 90)
    lines = ((0.0618, 20.3), (0.0, 70.2))
    grey = (profile("box", distance(size, *lines[0]), 0.0618) + special.ndtr(distance(size, *lines[1]) / 0.1)) / 2
    got = measure_all(NAMES, rgb(grey)[None], rgb(grey)[None], scene=edge_scene(size, *lines))
    assert [e["status"] for e in got["mtf50"].extras["edges"]] == ["ok", "undefined_too_few_phases"]
    assert got["mtf50"].value == pytest.approx(half("box", 0.0618), rel=1e-3)


def cut_gauss(f, radius=1.5):
    """The transform of a Gaussian cut at `radius` and renormalised, on one axis."""
    return (
        integrate.quad(lambda x: math.exp(-2 * x * x) * math.cos(2 * math.pi * f * x), -radius, radius)[0]
        / integrate.quad(lambda x: math.exp(-2 * x * x), -radius, radius)[0]
    )


@pytest.mark.parametrize("slope", [0.1, -0.37])
def test_references_are_as_sharp_as_their_filters(slope):
    size = (192, 128)
    scene = build_scene(f"near-horizontal-edge:slope={slope}")
    cos, sin = 1 / math.hypot(1, slope), abs(slope) / math.hypot(1, slope)
    for text, radius, curve in (
        ("reference:", 0.5, lambda f: np.sinc(f * cos) * np.sinc(f * sin)),
        ("reference:filter=tent", 1.0, lambda f: (np.sinc(f * cos) * np.sinc(f * sin)) ** 2),
        ("reference:filter=gaussian", 1.5, lambda f: cut_gauss(f * cos) * cut_gauss(f * sin)),
    ):
        picture = np.asarray(render(scene, text, size=size).pixels, dtype=np.float64)[None]
        score = measure("mtf50", picture, picture, scene=scene, filter_radius_px=radius)
        assert curve(score.value) == pytest.approx(0.5, abs=3e-3)
        assert score.extras["mtf_nyquist"] == pytest.approx(curve(0.5), abs=3e-3)
    # One sample a pixel, rendered: nothing limits it.
    picture = np.asarray(render(scene, "raytrace:", size=size).pixels, dtype=np.float64)[None]
    assert measure("mtf50", picture, picture, scene=scene).status == "undefined_no_crossing"


def test_frames_that_do_not_show_the_edge_are_left_out(edge_scene, rgb):
    size, intercept = place(0.0618)
    scene = replace(edge_scene(size, (0.0618, intercept), velocity=(0.0, 30.0 * 50, 0.0)), animation=Animation(30.0, 2))
    picture = np.zeros((2, *size[::-1]))
    picture[0] = profile("box", distance(size, 0.0618, intercept), 0.0618)
    score = measure("mtf50", rgb(picture), rgb(picture), scene=scene)
    assert score.value == pytest.approx(half("box", 0.0618), rel=1e-3)
