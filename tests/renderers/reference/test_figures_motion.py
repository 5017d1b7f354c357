"""Published figures of propellers, gratings and zone plates, to all their digits, read off reference pictures."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import fresnel, wofz

from aliasbench.renderers.catalog import render
from aliasbench.scenes.catalog import SCENES
from aliasbench.scenes.model import Grating, ZonePlate

NODES, WEIGHTS = np.polynomial.legendre.leggauss(6)


def annulus(scene, n):
    """Return the centres (x, y) of a picture's pixels from the hub, in pixels, and the annulus' weight of each."""
    fact = scene.facts.rotors[0]
    y, x = np.meshgrid(n / 2 - np.arange(n) - 0.5, np.arange(n) + 0.5 - n / 2, indexing="ij")
    rho = (np.hypot(x, y) * scene.camera.height / n - fact.inner) / (fact.outer - fact.inner)
    weight = np.where((rho > 0) & (rho < 1), np.sin(np.pi * np.clip(rho, 0, 1)) ** 4, 0.0)
    return x, y, weight / weight.sum()


def harmonic(scene, n, order):
    """Return the amplitude of a rotor's angular harmonic, with what pixels take of it given back exactly.

    Of a pattern sum_k a_k exp(i k theta) pixels show sum_k a_k times the mean of exp(i k theta) over each, so the
    weighted sum over pixels is sum_k a_k A_k. A_order is the pixels' attenuation, by quadrature over every pixel; all
    other A_k are lattice leakage, below 1e-8.
    """
    frame = render(scene, "reference:", size=(n, n))
    assert frame.uncertainty_kind == "bound"
    assert frame.uncertainty < 2e-8
    x, y, weight = annulus(scene, n)
    turned = weight * np.exp(-1j * order * np.arctan2(y, x))
    shown = 0.0
    for (a, u), (b, v) in itertools.product(zip(NODES / 2, WEIGHTS / 2, strict=True), repeat=2):
        shown = shown + u * v * np.exp(1j * order * np.arctan2(y + b, x + a))
    return abs((turned * frame.pixels[:, :, 0]).sum() / (turned * shown).sum())


@pytest.mark.parametrize(
    ("rate", "shutter", "figure"),
    [(29.0, 0.0, 0.3183099), (29.0, 0.5, 0.0690164), (29.0, 1.0, 0.0107965), (30.0, 0.5, 0.0675475), (30.0, 1.0, 0.0)],
)
def test_three_blades_have_the_first_harmonic_of_their_shutter(rate, shutter, figure):
    scene = SCENES["propeller"].build(blades=3, rev_per_s=rate, shutter=shutter)
    assert harmonic(scene, 128, 3) == pytest.approx(figure, abs=1e-7)


@pytest.mark.parametrize(
    ("blades", "duty", "rate", "shutter"),
    [(2, 0.3, 29.0, 0.5), (4, 0.25, 7.5, 1.0), (5, 0.5, 23.5, 0.25), (5, 0.7, 1.0, 1.0)],
)
def test_blades_have_the_harmonics_of_their_duty_and_shutter(blades, duty, rate, shutter):
    scene = SCENES["propeller"].build(blades=blades, duty=duty, rev_per_s=rate, shutter=shutter)
    for k in (1, 2):
        expected = duty * abs(np.sinc(k * duty) * np.sinc(k * blades * rate * shutter / 30))
        assert harmonic(scene, 128, k * blades) == pytest.approx(expected, abs=5e-7)


def on_a_circle(scene, shutter):
    """Return angles about the hub, their weights in a mean, and what pictures as small as points show there.

    Around a circle the blurred pattern is linear between the places where a blade's edge is when the shutter opens and
    closes: a rule between these integrates it, its square and its low harmonics exactly. No pixel blurs anything.
    """
    fact = scene.facts.rotors[0]
    radius = 0.45 * (fact.inner + fact.outer)
    period = 2 * np.pi / fact.blades
    edges = 0.2 + period * np.arange(fact.blades)[:, None] + np.array([0.0, period * fact.duty])
    sweep = 2 * np.pi * fact.rev_per_s * shutter / 30
    corners = np.unique(np.round(np.mod(np.concatenate([edges, edges + sweep]).ravel(), 2 * np.pi), 9))
    angles, weights, values = [], [], []
    for low, high in itertools.pairwise([*corners, corners[0] + 2 * np.pi]):
        for node, share in zip(*np.polynomial.legendre.leggauss(16), strict=True):
            angle = (low + high) / 2 + (high - low) / 2 * node
            place = (radius * math.cos(angle), radius * math.sin(angle))
            camera = replace(scene.camera, position=(*place, 5.0), target=(*place, 0.0), height=1e-7)
            frame = render(replace(scene, camera=camera), "reference:", size=(1, 1))
            assert frame.uncertainty_kind == "bound"
            angles.append(angle)
            weights.append((high - low) * share / (4 * np.pi))
            values.append(float(frame.pixels[0, 0, 0]))
    return np.array(angles), np.array(weights), np.array(values)


@pytest.mark.parametrize(
    ("rate", "shutter", "figure", "digits"),
    [
        (1.0, 0.0, 0.315226, 6),
        (1.0, 0.5, 0.2141, 4),
        (1.0, 1.0, 0.1267, 4),
        (29.0, 0.0, 1.0, 9),
        (29.0, 0.5, 0.1963, 4),
        (29.0, 1.0, 0.0321, 4),
        (30.0, 0.0, 1.0, 9),
        (30.0, 0.5, 0.192450, 6),
        (30.0, 1.0, 0.0, 7),
    ],
)
def test_three_blades_strobe_by_their_shutter(rate, shutter, figure, digits):
    scene = SCENES["propeller"].build(blades=3, rev_per_s=rate, shutter=shutter)
    angles, weights, values = on_a_circle(scene, shutter)
    mean = weights @ values
    energy = weights @ (values - mean) ** 2
    for k in range(1, 5):
        if abs(3 * k * rate) < 15:
            energy -= 2 * abs((weights * values) @ np.exp(-3j * k * angles)) ** 2
    assert math.sqrt(max(energy, 0.0) / 0.25) == pytest.approx(figure, abs=0.5 * 10.0**-digits)


def row_of_grating(make_polygon, make_scene, nu, technique, width=16):
    """Return a row that shows (1 + cos) / 2 of `nu` cycles a pixel, and how far off it may be."""
    wide = [(-64.0, -64.0), (64.0, -64.0), (64.0, 64.0), (-64.0, 64.0)]
    scene = make_scene([make_polygon(wide, texture="g")], textures={"g": Grating(nu * 64.0)})
    # a picture one pixel high is two units high
    frame = render(scene, technique, size=(width, 1))
    return frame.pixels[0, :, 0], frame.uncertainty


@pytest.mark.parametrize(
    ("technique", "figure"),
    [
        ("reference:", 0.0413278),
        ("reference:filter=tent", 0.00241545),
        ("reference:filter=gaussian,radius=inf", 0.00269191),
    ],
)
def test_a_grating_beyond_nyquist_leaves_its_filters_response(make_polygon, make_scene, technique, figure):
    # 17/16 cycles a pixel show as one in 16 pixels; moved along, all of that is shimmer, amplitude / sqrt(2)
    row, off = row_of_grating(make_polygon, make_scene, 17 / 16, technique)
    amplitude = 2 * abs(np.fft.fft(row)[1]) / 16 / 0.5
    assert amplitude / math.sqrt(2) == pytest.approx(figure, abs=5e-8 + 2 * math.sqrt(2) * off)


@pytest.mark.parametrize(
    ("nu", "n", "figure"),
    [
        (17 / 16, 1, 1.0584463),
        (17 / 16, 2, 0.0395709),
        (17 / 16, 4, 0.00737800),
        (33 / 16, 2, 1.0252934),
        (33 / 16, 4, 0.0187227),
        (65 / 16, 4, 1.0092719),
    ],
)
def test_regular_samples_leave_a_false_wave_beside_the_reference(make_polygon, make_scene, nu, n, figure):
    exact, _ = row_of_grating(make_polygon, make_scene, nu, "reference:")
    x = np.arange(16)[:, None] + (np.arange(n) + 0.5) / n - 8
    phase = 2 * np.pi * nu * 64.0 * ((2 * x + 64.0) / 128.0)
    sampled = (0.5 + 0.5 * np.cos(phase)).mean(axis=1)
    false = 2 * np.abs(np.fft.rfft(sampled - exact)[1:]).max() / 16 / 0.5
    assert false == pytest.approx(figure, abs=5e-8)


def plate_along(name, x, k):
    """Return the mean of exp(i k t^2) under a filter at the places x, lengths in pixels."""
    if name == "tent":
        scale = math.sqrt(2 * k / math.pi)

        def second(t):
            s, c = fresnel(t * scale)
            return t * (c + 1j * s) / scale - np.exp(1j * k * t * t) / (2j * k)

        return second(x + 1) - 2 * second(x) + second(x - 1)
    sigma = 0.5
    width = 1 - 2j * k * sigma**2
    whole = width**-0.5 * np.exp(1j * k * x * x / width)
    if name == "gaussian":
        return whole
    # cut at 1.5 pixels: exp(-a (t - m)^2) completes the square, its integral is an erf
    a = width / (2 * sigma**2)
    m = x / width
    root = np.sqrt(a)

    def erf(z):
        # of either sign of the real part, without overflow
        s = np.where(z.real < 0, -1.0, 1.0)
        return s * (1 - np.exp(-((s * z) ** 2)) * wofz(1j * s * z))

    share = (erf(root * (x + 1.5 - m)) - erf(root * (x - 1.5 - m))) / 2
    return whole * share / math.erf(1.5 / (sigma * math.sqrt(2)))


@pytest.mark.parametrize(
    ("name", "technique"),
    [
        ("tent", "reference:filter=tent"),
        ("gaussian", "reference:filter=gaussian,radius=inf"),
        ("truncated", "reference:filter=gaussian,radius=1.5"),
    ],
)
def test_a_zone_plate_has_its_closed_forms_under_filters(make_polygon, make_scene, name, technique):
    # the plate goes on outside the picture; 24 pixels, k in radians per square pixel
    n, k, span = 24, 0.11, 16.0
    far = [(-span, -span), (span, -span), (span, span), (-span, span)]
    per_uv = 2 * span * n / 2.0
    plate = ZonePlate((0.5, 0.5), k * per_uv**2, 0.3)
    frame = render(make_scene([make_polygon(far, texture="z")], textures={"z": plate}), technique, size=(n, n))
    along = plate_along(name, np.arange(n) + 0.5 - n / 2, k)
    expected = 0.5 + 0.5 * (np.exp(0.3j) * along[:, None] * along[None, :]).real
    assert np.abs(frame.pixels[..., 1] - expected).max() <= frame.uncertainty
