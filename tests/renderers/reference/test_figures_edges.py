"""Published figures of straight edges and thin lines, to all their digits, read off reference pictures.

A picture of one row shows an edge's profile at every whole distance from one place; Gauss-Legendre rules over that
place, with nodes in each piece on which the profile is smooth, make integrals over all distances of it.
"""

import itertools
import math

import numpy as np
import pytest
from scipy.optimize import brentq

from aliasbench.renderers.catalog import render

NODES, WEIGHTS = np.polynomial.legendre.leggauss(20)
REACH = 9  # pixels from an edge beyond which every profile here is 0 or 1 to 1e-16
FILTERS = {"box": "reference:", "tent": "reference:filter=tent", "gauss": "reference:filter=gaussian,radius=inf"}


@pytest.fixture
def half_plane(make_polygon, make_scene):
    """Return a maker of a scene that is white to the left of a line, `distance` pixels right of the picture's middle.

    The picture is two units high; a pixel is `pixel` units. The line's normal is turned by `angle`.
    """

    def make(distance, pixel, angle=0.0):
        out = np.array([math.cos(angle), math.sin(angle)])
        along = np.array([-out[1], out[0]])
        foot, far = distance * pixel * out, 500.0
        corners = [foot + far * along, foot + far * (along - out), foot - far * (along + out), foot - far * along]
        return make_scene([make_polygon(corners)])

    return make


def pixel_value(half_plane, technique, distance, angle=0.0):
    """Return what a pixel shows whose centre lies `distance` pixels inside a half-plane."""
    # a picture of one pixel is two units high
    return float(render(half_plane(distance, 2.0, angle), technique, size=(1, 1)).pixels[0, 0, 0])


def profile(half_plane, technique):
    """Return distances from an edge, their weights in an integral over all of them, and the picture's values there."""
    at, weight, value = [], [], []
    width = 2 * REACH + 1
    for start in (0.0, 0.5):
        for node, share in zip(start + (NODES + 1) / 4, WEIGHTS / 4, strict=True):
            # a picture one pixel high is two units high
            row = render(half_plane(node, 2.0), technique, size=(width, 1)).pixels[0, :, 0]
            at.append(node - (np.arange(width) - REACH))
            weight.append(np.full(width, share))
            value.append(row)
    at, weight, value = (np.concatenate(a) for a in (at, weight, value))
    return at, weight, value


def response(edge, frequency):
    """Return the Fourier transform, at cycles per pixel, of the derivative of an edge's profile."""
    at, weight, value = edge
    # by parts, of what differs from a step at 0: the step's derivative has the transform 1
    step = (at > 0).astype(float)
    return 1.0 + 2 * np.pi * frequency * float((weight * (value - step) * np.sin(2 * np.pi * frequency * at)).sum())


@pytest.mark.parametrize(("angle", "figure"), [(0.0, 0.0833333), (math.atan(0.3), 0.0802499), (math.pi / 4, 0.0707107)])
def test_one_sample_errs_along_an_edge_by_its_slope(half_plane, angle, figure):
    # pixels lie evenly at all distances from a line of irrational slope: one for each unit of length and of distance
    a, b = math.cos(angle), math.sin(angle)
    cuts = [-(a + b) / 2, -abs(a - b) / 2, 0.0, abs(a - b) / 2, (a + b) / 2]
    total = 0.0
    for low, high in itertools.pairwise(cuts):
        for node, share in zip(*np.polynomial.legendre.leggauss(4), strict=True):
            h = (low + high) / 2 + (high - low) / 2 * node
            error = pixel_value(half_plane, "reference:", h, angle) - (h > 0)
            total += (high - low) / 2 * share * error**2
    assert total == pytest.approx(a / 12 + b**3 / (60 * a * a), abs=1e-13)
    assert total == pytest.approx(figure, abs=5e-8)


@pytest.mark.parametrize(("name", "figure"), [("box", 0.63662), ("tent", 0.40528), ("gauss", 0.291213)])
def test_an_edge_keeps_its_filters_response_at_nyquist(half_plane, name, figure):
    exact = {"box": 2 / np.pi, "tent": 4 / np.pi**2, "gauss": math.exp(-(np.pi**2) / 8)}[name]
    measured = response(profile(half_plane, FILTERS[name]), 0.5)
    assert measured == pytest.approx(exact, abs=1e-12)
    assert measured == pytest.approx(figure, abs=6e-6 if name != "gauss" else 5e-7)


def test_a_slanted_edge_keeps_the_product_of_two_sincs(half_plane):
    # across a slanted edge the box of a pixel is a trapezoid: its response is a sinc along each axis
    angle = 0.2
    a, b = math.cos(angle), math.sin(angle)
    cuts = [-(a + b) / 2, -(a - b) / 2, 0.0, (a - b) / 2, (a + b) / 2]
    total = 1.0
    for low, high in itertools.pairwise(cuts):
        for node, share in zip(*np.polynomial.legendre.leggauss(12), strict=True):
            h = (low + high) / 2 + (high - low) / 2 * node
            step = pixel_value(half_plane, "reference:", h, angle) - (h > 0)
            total += (high - low) / 2 * share * np.pi * step * math.sin(np.pi * h)
    assert total == pytest.approx(np.sinc(a / 2) * np.sinc(b / 2), abs=1e-12)


@pytest.mark.parametrize(("name", "figure"), [("box", 0.8), ("tent", 1.105573), ("gauss", 2.563103 * 0.5)])
def test_an_edge_rises_from_a_tenth_to_nine_tenths_over_its_filters_width(half_plane, name, figure):
    low, high = (
        brentq(lambda h, level=level: pixel_value(half_plane, FILTERS[name], h) - level, -2.0, 2.0, xtol=1e-13)
        for level in (0.1, 0.9)
    )
    assert high - low == pytest.approx(figure, abs=5e-7)


@pytest.mark.parametrize(("name", "figure"), [("box", 0.166898), ("tent", 0.049727), ("gauss", 0.027023)])
def test_what_an_edge_keeps_beyond_nyquist(half_plane, name, figure):
    edge = profile(half_plane, FILTERS[name])
    below, above = (
        sum(w / 4 * response(edge, start + (x + 1) / 4) ** 2 for x, w in zip(NODES, WEIGHTS, strict=True))
        for start in (0.0, 0.5)
    )
    assert above / below == pytest.approx(figure, abs=5e-7)


def test_the_place_of_a_gaussian_edge_ripples(half_plane):
    places = np.arange(8) / 8
    width = 2 * REACH + 1
    sums = [render(half_plane(p, 2.0), FILTERS["gauss"], size=(width, 1)).pixels[0, :, 0].sum() for p in places]
    ripple = np.array(sums) - places
    amplitude = 2 * abs(np.fft.fft(ripple)[1]) / len(places)
    assert amplitude == pytest.approx(math.exp(-(np.pi**2) / 2) / np.pi, abs=1e-13)
    assert amplitude == pytest.approx(0.00228925, abs=5e-9)


@pytest.mark.parametrize(("q", "figure"), [(2, 0.25), (3, 0.272166), (8, 0.286411), (16, 0.288111)])
def test_one_sample_on_a_rational_slope_is_ragged_by_its_denominator(half_plane, q, figure):
    # slope 1 / q; the columns of one period, with room for the edge above and below
    size = (q, 9)
    angle = math.atan(1 / q)
    pixel = 2.0 / size[1]
    # sampled where no centre lies on the edge: a quarter of the steps' distance 1 / q off
    shift = math.cos(angle) / (4 * q)
    scene = half_plane(shift, pixel, angle + np.pi / 2)
    exact = render(scene, "reference:", size=size).pixels[..., 0]
    y, x = np.meshgrid(size[1] / 2 - 0.5 - np.arange(size[1]), np.arange(q) + 0.5 - q / 2, indexing="ij")
    out = np.array([-math.sin(angle), math.cos(angle)])
    sampled = (out[0] * x + out[1] * y < shift).astype(float)
    r = (sampled - exact).sum(axis=0)
    assert np.std(r) == pytest.approx(math.sqrt((1 - 1 / q**2) / 12), abs=1e-12)
    assert np.std(r) == pytest.approx(figure, abs=5e-7)
    assert abs(r.mean()) <= 0.5 / q + 1e-12


@pytest.fixture
def upright_line(make_polygon, make_scene):
    """Return a maker of a white upright line: its middle, in pixels from the picture's, and its width in pixels."""

    def make(middle, width):
        low, high = 2.0 * (middle - width / 2), 2.0 * (middle + width / 2)
        return make_scene([make_polygon([(low, -99), (high, -99), (high, 99), (low, 99)])])

    return make


@pytest.mark.parametrize(("width", "figure"), [(0.1, 0.0896667), (0.25, 0.1822917), (0.5, 0.2083333)])
def test_one_sample_of_a_thin_line_errs_by_its_width(upright_line, width, figure):
    # the line's left end runs over a pixel, from centre to centre: pieces end where an end passes a border or a centre
    cuts = sorted({0.0, 0.5 - width, 0.5, 1.0 - width, 1.0})
    total, energy = 0.0, 0.0
    for low, high in itertools.pairwise(cuts):
        for node, share in zip(*np.polynomial.legendre.leggauss(3), strict=True):
            left = (low + high) / 2 + (high - low) / 2 * node  # from a pixel's centre
            row = render(upright_line(left + width / 2, width), "reference:", size=(5, 1)).pixels[0, :, 0]
            centres = np.arange(5) - 2.0
            sampled = ((centres >= left) & (centres < left + width)).astype(float)
            total += (high - low) / 2 * share * float(((sampled - row) ** 2).sum())
            energy += (high - low) / 2 * share * float((row**2).sum())
    # where the line holds a centre: its left end in (1 - w, 1) of the way
    assert total == pytest.approx(width - width**2 - width**3 / 3, abs=1e-13)
    assert total == pytest.approx(figure, abs=5e-8)
    assert energy == pytest.approx(width**2 - width**3 / 3, abs=1e-13)


@pytest.mark.parametrize(
    ("technique", "figure"),
    [
        ("reference:", 0.0),
        ("reference:filter=tent", 0.0),
        ("reference:filter=gaussian,radius=inf", 0.0101709),
        ("reference:filter=gaussian,radius=1.5", 0.0123314),
    ],
)
def test_the_light_of_a_line_flickers_where_a_filter_is_no_partition(upright_line, technique, figure):
    # so thin that its own width takes (pi w)^2 / 6 of the fundamental, under 2e-8 of it; a filter that ends 1.5 pixels
    # from its centre lets the light turn sharply half-way between two pixels' centres
    width = 1e-4
    light, weight = [], []
    for start in (0.0, 0.5):
        for node, share in zip(start + (NODES + 1) / 4, WEIGHTS / 4, strict=True):
            row = render(upright_line(node, width), technique, size=(2 * REACH + 1, 1)).pixels[0, :, 0]
            light.append(row.sum())
            weight.append(share)
    mean = float(np.dot(weight, light))
    assert math.sqrt(np.dot(weight, (np.array(light) - mean) ** 2)) / mean == pytest.approx(figure, abs=5e-8)
