"""Textures under separable filters: closed forms, squares as polygons, and double quadrature, within the bound."""

import math

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.special import fresnel

from aliasbench.renderers.catalog import render
from aliasbench.renderers.reference.expansions import expand_filter
from aliasbench.renderers.sampling.filters import make_filter
from aliasbench.scenes.model import Camera, Checker, Grating, ImageTexture, ZonePlate, read_only
from aliasbench.scenes.projection import view_at

SQUARE = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
FLOOR = [(-1.0, 0.0, 1.0), (1.0, 0.0, 1.0), (1.0, 0.0, -1.0), (-1.0, 0.0, -1.0)]
WIDE = [(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)]
FILTERS = [
    "filter=box,radius=1.3",
    "filter=box,radius=0.2",
    "filter=tent",
    "filter=gaussian",
    "filter=gaussian,radius=inf,sigma=0.4",
    "filter=mitchell,radius=1.5",
    "filter=lanczos",
]


def certified(scene, text, size):
    frame = render(scene, f"reference:{text}", size=size)
    assert frame.uncertainty_kind == "bound"
    assert frame.samples == 0
    assert frame.uncertainty is not None
    assert 0.0 < frame.uncertainty <= 1e-5
    return frame


@pytest.mark.parametrize(
    ("name", "radius"), [("gaussian", 1.5), ("gaussian", math.inf), ("lanczos", 3.0), ("tent", 0.7)]
)
def test_expansion_is_the_filter_up_to_what_it_leaves_out(name, radius):
    spec = make_filter(name, radius)
    grid = expand_filter(spec)
    rng = np.random.default_rng(1)
    total = 0.0
    widths = np.diff(grid.cuts)
    for dx in range(2 * grid.margin + 1):
        for dy in range(2 * grid.margin + 1):
            for cx in range(len(widths)):
                for cy in range(len(widths)):
                    x, y = (grid.cuts[c] + widths[c] * rng.random(20) for c in (cx, cy))
                    u, v = ((p - (grid.cuts[c] + widths[c] / 2)) / grid.half for p, c in ((x, cx), (y, cy)))
                    value = np.zeros(20)
                    for j in range(grid.degree + 1):
                        in_y = np.polynomial.polynomial.polyval(v, grid.powers[cy, j])
                        in_x = np.polynomial.polynomial.polyval(u, grid.along[dx, cx, j])
                        value += grid.across[dy, cy, j] * in_y * in_x
                    exact = spec.evaluate(x + dx - grid.margin - 0.5, y + dy - grid.margin - 0.5)
                    total += float(np.abs(value - exact).max()) * widths[cx] * widths[cy]
    assert total <= grid.left_out + 1e-13


@pytest.mark.parametrize("keys", FILTERS)
@pytest.mark.parametrize("up", [(0.0, 1.0, 0.0), (0.3, 1.0, 0.0)])
def test_checker_is_its_squares_as_polygons(make_polygon, make_scene, keys, up):
    camera = Camera("perspective", position=(0.0, 0.9, 2.0), target=(0, 0, 0), up=up, fov_y_deg=40.0)
    dark, light = (0.1, 0.0, 0.0), (0.9, 0.8, 1.0)
    scene = make_scene(
        [make_polygon(FLOOR, texture="c")], camera=camera, textures={"c": Checker((4.0, 3.0), dark, light)}
    )
    tiles = []
    for i in range(4):
        for j in range(3):
            x0, x1, z0, z1 = i / 2 - 1, (i + 1) / 2 - 1, 1 - j / 1.5, 1 - (j + 1) / 1.5
            corners = [(x0, 0, z0), (x1, 0, z0), (x1, 0, z1), (x0, 0, z1)]
            tiles.append(make_polygon(corners, light if (i + j) % 2 else dark))
    size = (10, 7)
    frame = certified(scene, keys, size)
    truth = render(make_scene(tiles, camera=camera), f"reference:{keys}", size=size)
    assert truth.uncertainty_kind == "bound"
    assert truth.uncertainty is not None
    assert np.abs(frame.pixels - truth.pixels).max() <= frame.uncertainty + truth.uncertainty


def response(spec, nu):
    """Return the Fourier transform of a profile at a frequency in cycles per pixel, by Gauss-Legendre."""
    x, w = np.polynomial.legendre.leggauss(200)
    r = spec.support
    return sum(
        float((w * spec.profile(r * (x + s) / 2) * np.cos(np.pi * nu * r * (x + s))).sum()) * r / 2 for s in (-1, 1)
    )


@pytest.mark.parametrize("profile_rolled", [0.0, 25.0, 90.0])
@pytest.mark.parametrize(("name", "radius"), [("tent", 1.0), ("gaussian", 1.5), ("mitchell", 2.0), ("lanczos", 3.0)])
def test_grating_has_the_amplitude_of_the_filters_transform(make_polygon, make_scene, name, radius, profile_rolled):
    spec = make_filter(name, radius)
    size, px = (8, 8), 2.0 / 8
    for nu in (0.05, 0.4, 17 / 16):
        grating = Grating(nu * 18.0 / px, profile_rolled, 0.2)
        scene = make_scene([make_polygon(WIDE, texture="g")], textures={"g": grating})
        frame = certified(scene, f"filter={name},radius={radius}", size)
        x = (np.arange(8) + 0.5 - 4) * px
        angle = math.radians(profile_rolled)
        u, v = (x[None, :] + 9) / 18, (9 - x[:, None]) / 18
        phase = 2 * np.pi * (grating.cycles * (u * math.cos(angle) + v * math.sin(angle)) + 0.2)
        amplitude = response(spec, nu * math.cos(angle)) * response(spec, nu * math.sin(angle))
        expected = 0.5 + 0.5 * amplitude * np.cos(phase)
        assert np.abs(frame.pixels[..., 0] - expected).max() <= frame.uncertainty


def test_zone_plate_under_gaussian_and_tent_is_its_closed_form(make_polygon, make_scene):
    size, px, k = (8, 8), 2.0 / 8, 9000.0
    scene = make_scene([make_polygon(WIDE, texture="z")], textures={"z": ZonePlate((0.5, 0.5), k, 0.3)})
    rate = k * (px / 18) ** 2  # cos(rate x^2), x in pixels
    x = np.arange(8) + 0.5 - 4
    sigma = 0.5
    frame = certified(scene, "filter=gaussian,radius=inf", size)
    bend = 1 - 2j * rate * sigma**2
    along = bend**-0.5 * np.exp(1j * rate * x**2 / bend)
    expected = 0.5 + 0.5 * (np.exp(0.3j) * along[:, None] * along[None, :]).real
    assert np.abs(frame.pixels[..., 0] - expected).max() <= frame.uncertainty
    frame = certified(scene, "filter=tent", size)

    def second(t):
        scale = math.sqrt(2 * rate / math.pi)
        s, c = fresnel(t * scale)
        return t * (c + 1j * s) / scale - np.exp(1j * rate * t**2) / (2j * rate)

    along = second(x + 1) - 2 * second(x) + second(x - 1)
    expected = 0.5 + 0.5 * (np.exp(0.3j) * along[:, None] * along[None, :]).real
    assert np.abs(frame.pixels[..., 0] - expected).max() <= frame.uncertainty + 1e-9


@pytest.mark.parametrize("position", [(0.0, 0.9, 2.0), (0.6, 0.9, 2.0)])
def test_blend_under_gaussian_agrees_with_double_quadrature(make_polygon, make_scene, position):
    texels = np.random.default_rng(5).random((2, 3, 4)).astype(np.float32)
    camera = Camera("perspective", position=position, target=(0, 0, 0), fov_y_deg=40.0)
    floor = [(-9.0, 0.0, 1.2), (9.0, 0.0, 1.2), (9.0, 0.0, -9.0), (-9.0, 0.0, -9.0)]
    scene = make_scene(
        [make_polygon(floor, texture="i")], camera=camera, textures={"i": ImageTexture(read_only(texels))}
    )
    size = (5, 5)
    frame = certified(scene, "filter=gaussian,radius=1,texture=linear", size)
    spec = make_filter("gaussian", 1.0)
    view = view_at(camera, scene.animation, 0, 0.0, size)

    def value(y, x):
        origin, direction = view.ray(np.array(x), np.array(y))
        hit = origin - origin[1] / direction[1] * direction
        u, v = (hit[0] + 9) / 18 * 3 - 0.5, (1.2 - hit[2]) / 10.2 * 2 - 0.5
        i, j = math.floor(u), math.floor(v)
        s, t = u - i, v - j
        rows = [(1 - s) * float(texels[m % 2, i % 3, 1]) + s * float(texels[m % 2, (i + 1) % 3, 1]) for m in (j, j + 1)]
        weight = float(spec.evaluate(float(x) - 2.5, float(y) - 3.5))
        return weight * ((1 - t) * rows[0] + t * rows[1])

    expected = sum(
        dblquad(value, 1.5 + a / 2, 2 + a / 2, 2.5 + b / 2, 3 + b / 2, epsabs=1e-7, epsrel=1e-7)[0]
        for a in range(4)
        for b in range(4)
    )
    assert frame.pixels[3, 2, 1] == pytest.approx(expected, abs=2e-5)


@pytest.mark.parametrize("keys", ["filter=gaussian", "filter=box,radius=0.5"])
@pytest.mark.parametrize(
    "texture",
    [
        ImageTexture(read_only(np.full((1, 1, 4), 0.25, np.float32))),
        Checker((6.0, 5.0), (0.25, 0.25, 0.25), (0.25, 0.25, 0.25)),
        Grating(0.0, 0.0, 0.0, "sine", (0.0, 0.0, 0.0), (0.25, 0.25, 0.25)),
        Grating(0.0, 0.0, 0.0, "square", (0.0, 0.0, 0.0), (0.25, 0.25, 0.25)),
        ZonePlate((0.5, 0.5), 0.0, math.pi * 2 / 3),
    ],
)
def test_what_has_one_value_is_that_value(make_polygon, make_scene, texture, keys):
    scene = make_scene([make_polygon(WIDE, texture="t")], textures={"t": texture})
    frame = certified(scene, keys, (3, 4))
    assert np.abs(frame.pixels - 0.25).max() <= frame.uncertainty


def test_texture_over_black_is_black_and_edge_on_unseen(make_polygon, make_scene):
    checker = {"c": Checker((7.0, 5.0))}
    black = make_scene([make_polygon(WIDE, (0.0, 0.0, 0.0), texture="c")], textures=checker)
    assert np.abs(render(black, "reference:filter=tent", size=(4, 4)).pixels).max() == 0.0
    edge_on = [(-1.0, 0.0, -1.0), (1.0, 0.0, -1.0), (1.0, 0.0, 1.0), (-1.0, 0.0, 1.0)]
    unseen = make_scene([make_polygon(edge_on, texture="c")], textures=checker, background=(0.5, 0.5, 0.5))
    frame = certified(unseen, "filter=tent", (4, 4))
    assert np.abs(frame.pixels - 0.5).max() <= frame.uncertainty
