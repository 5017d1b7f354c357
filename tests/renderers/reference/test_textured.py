"""Textures at an instant: exact against closed forms, quadrature, clipped areas and dense sampling."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from scipy.integrate import dblquad, quad
from scipy.special import fresnel

from aliasbench.renderers.catalog import render
from aliasbench.renderers.reference.tiles import clip_texels, gauss_table
from aliasbench.renderers.reference.walks import BLEND, TEXELS, walk_texels
from aliasbench.scenes import shapes
from aliasbench.scenes.catalog import SCENES
from aliasbench.scenes.model import Camera, Checker, Grating, ImageTexture, Motion, Scene, ZonePlate, read_only
from aliasbench.scenes.projection import view_at
from aliasbench.scenes.textures import evaluate_point

SQUARE = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
FLOOR = [(-1.0, 0.0, 1.0), (1.0, 0.0, 1.0), (1.0, 0.0, -30.0), (-1.0, 0.0, -30.0)]
# a pixel's sums are good to some hundred ulp; texture coordinates of these small scenes to less
EXACT = 1e-9


def image(rng, h=3, w=4):
    return ImageTexture(read_only(rng.random((h, w, 4)).astype(np.float32)))


def blend_at(texels, u, v):
    h, w = texels.shape[:2]
    x, y = u * w - 0.5, v * h - 0.5
    i, j = math.floor(x), math.floor(y)
    s, t = x - i, y - j
    row = [(1 - s) * float(texels[k % h, i % w, 0]) + s * float(texels[k % h, (i + 1) % w, 0]) for k in (j, j + 1)]
    return (1 - t) * row[0] + t * row[1]


def exact(scene, size, **keys):
    text = "reference:" + ",".join(f"{k}={v}" for k, v in keys.items())
    frame = render(scene, text, size=size)
    assert frame.uncertainty_kind == "bound"
    assert frame.samples == 0
    assert frame.uncertainty is not None
    assert 0.0 < frame.uncertainty < EXACT
    return frame


@pytest.mark.parametrize("roll", [0.0, 0.3, 2.0])
def test_checker_seen_face_on_has_the_areas_of_its_clipped_squares(make_polygon, make_scene, roll):
    camera = Camera("orthographic", up=(math.sin(roll), math.cos(roll), 0.0), height=2.5)
    scene = make_scene([make_polygon(SQUARE, texture="c")], camera=camera, textures={"c": Checker((7.3, 4.6))})
    size = (9, 8)
    frame = exact(scene, size)
    view = view_at(camera, scene.animation, 0, 0.0, size)

    def picture(points):
        return shapely.Polygon(view.project(np.array([(2 * u - 1, 2 * v - 1, 0.0) for u, v in points]))[:, :2])

    expected = np.zeros((size[1], size[0]))
    for i in range(8):
        for j in range(5):
            u0, u1, v0, v1 = i / 7.3, min(1.0, (i + 1) / 7.3), j / 4.6, min(1.0, (j + 1) / 4.6)
            if (i + j) % 2 and u0 < 1 and v0 < 1:
                tile = picture([(u0, v0), (u1, v0), (u1, v1), (u0, v1)])
                for row in range(size[1]):
                    for column in range(size[0]):
                        expected[row, column] += tile.intersection(shapely.box(column, row, column + 1, row + 1)).area
    assert expected.max() > 0.5
    assert np.abs(frame.pixels[..., 0] - expected).max() <= frame.uncertainty


def test_perspective_checker_agrees_with_quadrature_of_its_closed_rows(make_polygon, make_scene):
    camera = Camera("perspective", position=(0, 1, 0), target=(0, 1, -1), fov_y_deg=60.0)
    checker = Checker((2.0, 30.0))
    floor = [(-9.0, 0.0, 0.0), (9.0, 0.0, 0.0), (9.0, 0.0, -60.0), (-9.0, 0.0, -60.0)]
    scene = make_scene([make_polygon(floor, texture="c")], camera=camera, textures={"c": checker})
    size = (16, 16)
    frame = exact(scene, size)
    f = 8 / math.tan(math.radians(30))
    sx, sz = 2.0 / 18, 30.0 / 60

    def folded(s):
        return abs(s % 2 - 1)  # its slope is (-1)^(floor(s) + 1)

    for row, column in ((9, 4), (10, 8), (12, 15), (15, 0), (9, 15)):
        x0, x1 = column - 8.0, column - 7.0

        def line(y, x0=x0, x1=x1):
            z = f / y
            sign = 1 if math.floor(z * sz) % 2 == 0 else -1
            scale = z / f * sx
            mean = (folded((x1 * z / f + 9) * sx) - folded((x0 * z / f + 9) * sx)) / scale
            return 0.5 + 0.5 * sign * mean

        bottom, top = row - 8.0, row - 7.0
        cuts = [f * sz / j for j in range(1, 40)] + [
            f / ((j / sx - 9) / x) for x in (x0, x1) if x for j in range(-9, 60) if j / sx != 9
        ]
        cuts = sorted(c for c in cuts if bottom < c < top)
        edges = [bottom, *cuts, top]
        expected = sum(quad(line, a, b, epsabs=1e-13)[0] for a, b in itertools.pairwise(edges))
        assert frame.pixels[row, column, 0] == pytest.approx(expected, abs=1e-9)


def test_blend_agrees_with_double_quadrature(make_polygon, make_scene):
    texture = image(np.random.default_rng(2))
    camera = Camera("perspective", position=(0.2, 0.9, 2.0), target=(0, 0, 0), up=(0.4, 1, 0.1), fov_y_deg=50.0)
    floor = [(-3.0, 0.0, 1.5), (3.0, 0.0, 1.5), (3.0, 0.0, -3.0), (-3.0, 0.0, -3.0)]
    scene = make_scene([make_polygon(floor, texture="i")], camera=camera, textures={"i": texture})
    size = (6, 5)
    frame = exact(scene, size, texture="linear")
    view = view_at(camera, scene.animation, 0, 0.0, size)

    def value(y, x):
        origin, direction = view.ray(np.array(x), np.array(y))
        hit = origin - origin[1] / direction[1] * direction
        return blend_at(texture.texels, (hit[0] + 3) / 6, (1.5 - hit[2]) / 4.5)

    for row, column in ((3, 2), (4, 4)):
        n = 12
        expected = sum(
            dblquad(value, column + i / n, column + (i + 1) / n, row + j / n, row + (j + 1) / n, epsabs=1e-6)[0]
            for i in range(n)
            for j in range(n)
        )
        assert frame.pixels[row, column, 0] == pytest.approx(expected, abs=2e-5)


@pytest.mark.parametrize("blend", [False, True])
def test_rows_at_once_and_texels_one_by_one_agree(blend):
    rng = np.random.default_rng(8)
    rules = gauss_table()
    for _ in range(200):
        h, w = (int(s) for s in rng.integers(1, 5, 2))
        texels = rng.random((h, w, 3))
        padded = np.concatenate([texels, texels[:, :1]], axis=1)
        steps = (padded[:, 1:] + padded[:, :-1]) / 2 if blend else texels
        sums = np.concatenate([np.zeros((h, 1, 3)), np.cumsum(steps, axis=1)], axis=1)
        angle = rng.uniform(0, 2 * np.pi)
        t, s = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        q = np.append(s * rng.uniform(-0.2, 0.2), 1.0)
        own = np.stack([
            np.append(t * rng.uniform(1, 6) + s * rng.normal(), rng.normal() * 50),
            np.append(s * rng.uniform(1, 6), rng.normal() * 50),
            q,
        ])  # fmt: skip
        corners = np.sort(rng.uniform(0, 2 * np.pi, int(rng.integers(3, 7))))
        poly = np.stack([np.cos(corners), np.sin(corners)], axis=1)
        one, other = np.zeros(3), np.zeros(3)
        flat, summed = padded.reshape(-1, 3), sums.reshape(-1, 3)
        mode = BLEND if blend else TEXELS
        walk_texels(poly, len(poly), own, t[0], t[1], mode, h, w, 0, flat, summed, one)
        clip_texels(poly, len(poly), own, blend, h, w, 0, flat, rules, other)
        assert np.abs(one - other).max() < 1e-12


@pytest.mark.parametrize("nu", [1 / 8, 3 / 8, 17 / 16, 33 / 16])
def test_grating_has_the_amplitude_of_its_sinc(make_polygon, make_scene, nu):
    # n point samples to a pixel show D_n(nu), so their false amplitude is D_n(nu) - sinc(nu); the reference has sinc
    wide = [(-4.0, -2.0), (4.0, -2.0), (4.0, 2.0), (-4.0, 2.0)]
    size = (32, 4)
    px = 2.0 / 4
    grating = Grating(nu * 8.0 / px, 0.0, 0.25)
    camera = Camera("orthographic", height=2.0)
    scene = make_scene(
        [make_polygon([(2 * x, y) for x, y in wide], texture="g")], camera=camera, textures={"g": grating}
    )
    frame = exact(scene, size)
    centre = (np.arange(32) + 0.5 - 16) * px
    phase = 2 * np.pi * (nu / px / 2 * (centre + 8.0) + 0.25)
    expected = 0.5 + 0.5 * np.sinc(nu / 2) * np.cos(phase)
    assert np.abs(frame.pixels[1, :, 0] - expected).max() <= frame.uncertainty


@pytest.mark.parametrize("grating_angle", [0.0, 90.0, 37.0])
@pytest.mark.parametrize("profile", ["sine", "square"])
def test_receding_grating_agrees_with_quadrature(make_polygon, make_scene, profile, grating_angle):
    camera = Camera("perspective", position=(0.1, 0.8, 1.0), target=(0, 0, -1), up=(0.1, 1, 0), fov_y_deg=50.0)
    grating = Grating(6.0, grating_angle, 0.1, profile)
    scene = make_scene([make_polygon(FLOOR, texture="g")], camera=camera, textures={"g": grating})
    size = (8, 8)
    frame = exact(scene, size)
    view = view_at(camera, scene.animation, 0, 0.0, size)
    n = 512
    rng = np.random.default_rng(1)
    for row, column in ((4, 4), (6, 3), (3, 4)):
        x = column + (np.arange(n)[None] + rng.random((n, n))) / n
        y = row + (np.arange(n)[:, None] + rng.random((n, n))) / n
        origin, direction = view.ray(x, y)
        t = -origin[..., 1] / direction[..., 1]
        hit = origin + t[..., None] * direction
        inside = (t > 0) & (np.abs(hit[..., 0]) <= 1) & (hit[..., 2] <= 1) & (hit[..., 2] >= -30)
        uv = np.stack([(hit[..., 0] + 1) / 2, (1 - hit[..., 2]) / 31], axis=-1)
        shown = np.where(inside, evaluate_point(grating, uv)[..., 0], 0.0)
        spread = shown.reshape(n // 4, 4, n // 4, 4).std(axis=(1, 3))
        error = math.sqrt((spread**2).mean()) / n
        assert abs(frame.pixels[row, column, 0] - shown.mean()) <= 6 * error + 1e-9


@pytest.mark.parametrize(("k", "size"), [(200.0, 16), (9000.0, 64)])
def test_zone_plate_is_its_fresnel_integrals(make_polygon, make_scene, k, size):
    scene = make_scene([make_polygon(SQUARE, texture="z")], textures={"z": ZonePlate((0.5, 0.5), k, 0.3)})
    frame = exact(scene, (size, size))
    x = np.linspace(-0.5, 0.5, size + 1)
    scale = math.sqrt(2 * k / math.pi)
    s, c = fresnel(x * scale)
    along = np.diff(c + 1j * s) / scale * size
    expected = 0.5 + 0.5 * (np.exp(0.3j) * along[:, None] * along[None, :]).real
    assert np.abs(frame.pixels[..., 1] - expected).max() <= frame.uncertainty


def test_surfaces_that_cross_show_the_nearer_texture(make_polygon, make_scene):
    # two planes through a common upright line: each is in front on one side of it
    left = [(-1.0, -2.0, 1.0), (1.0, -2.0, -1.0), (1.0, 2.0, -1.0), (-1.0, 2.0, 1.0)]
    right = [(-1.0, -2.0, -1.0), (1.0, -2.0, 1.0), (1.0, 2.0, 1.0), (-1.0, 2.0, -1.0)]
    one = Checker((1.0, 1.0), (0.2, 0.2, 0.2), (1.0, 1.0, 1.0))
    other = Checker((1.0, 1.0), (0.7, 0.7, 0.7), (1.0, 1.0, 1.0))
    scene = make_scene(
        [make_polygon(left, texture="a"), make_polygon(right, texture="b")], textures={"a": one, "b": other}
    )
    frame = exact(scene, (5, 5))
    assert np.abs(frame.pixels[..., 0] - [0.2, 0.2, 0.45, 0.7, 0.7]).max() <= frame.uncertainty


@pytest.mark.parametrize("roll", [0.0, 0.3])
def test_brick_floor_agrees_with_a_million_samples_to_a_pixel(roll):
    scene = SCENES["brick-floor"].build()
    scene = replace(scene, camera=replace(scene.camera, up=(math.sin(roll), math.cos(roll), 0.0)))
    size = (64, 64)
    frame = render(scene, "reference:", size=size, frame=3)
    assert frame.uncertainty_kind == "bound"
    assert frame.uncertainty is not None
    assert frame.uncertainty < 1e-6
    view = view_at(scene.camera, scene.animation, 3, 0.0, size)
    rng = np.random.default_rng(4)
    n = 1024
    row, columns = int(np.argmax(np.abs(frame.pixels[:, 32, 0] - 0.35) > 1e-3)), (5, 40)
    for y0, x0 in [(row, columns[0]), (row + 1, columns[1]), (40, 63), (63, 10)]:
        x = x0 + (np.arange(n)[None] + rng.random((n, n))) / n
        y = y0 + (np.arange(n)[:, None] + rng.random((n, n))) / n
        origin, direction = view.ray(x, y)
        t = -origin[..., 1] / direction[..., 1]
        hit = origin + t[..., None] * direction
        inside = (t > 0) & (np.abs(hit[..., 0]) <= 128) & (hit[..., 2] <= -0.8) & (hit[..., 2] >= -40)
        uv = np.stack([hit[..., 0], -hit[..., 2]], axis=-1)
        shown = np.where(inside, evaluate_point(scene.textures["brick"], uv)[..., 0], scene.background[0])
        spread = shown.reshape(n // 4, 4, n // 4, 4).std(axis=(1, 3))
        error = math.sqrt((spread**2).mean()) / n
        assert abs(frame.pixels[y0, x0, 0] - shown.mean()) <= 5 * error + frame.uncertainty


def test_parts_of_a_textured_plane_add_up_to_the_whole(make_polygon, make_scene):
    rng = np.random.default_rng(6)
    texture = image(rng, 5, 7)
    whole = make_scene([make_polygon(SQUARE, texture="i")], textures={"i": texture})
    triangles = make_polygon(SQUARE, texture="i", triangles=[[0, 1, 2], [0, 2, 3]], is_polygon=False)
    parts = make_scene([triangles], textures={"i": texture})
    for truth in ("point", "linear"):
        one, two = (exact(s, (13, 11), texture=truth) for s in (whole, parts))
        assert np.abs(one.pixels - two.pixels).max() < 1e-12


def test_an_open_shutter_over_a_still_scene_changes_nothing(make_polygon, make_scene):
    scene = make_scene([make_polygon(SQUARE, texture="c")], textures={"c": Checker((5.0, 3.0))}, shutter=1.0)
    still = replace(scene, animation=replace(scene.animation, shutter=0.0))
    assert np.array_equal(exact(scene, (12, 12)).pixels, exact(still, (12, 12)).pixels)


def test_time_center_is_the_middle_of_the_shutter(make_polygon, make_scene):
    def scene(motion, shutter):
        return make_scene(
            [make_polygon(SQUARE, texture="c", motion=motion)], textures={"c": Checker((5.0, 3.0))}, shutter=shutter
        )

    moved = [(x + 0.5, y) for x, y in SQUARE]
    frame = exact(scene(Motion((30.0, 0.0, 0.0)), 1.0), (12, 12), time="center")
    expected = make_scene([make_polygon(moved, texture="c")], textures={"c": Checker((5.0, 3.0))})
    assert np.abs(frame.pixels - exact(expected, (12, 12)).pixels).max() < 1e-12


@pytest.mark.parametrize("per_pixel", [1.0, 1e-3, 1e-5])
def test_an_image_of_one_colour_is_that_colour_within_the_bound_however_large_its_texels(per_pixel):
    """Running sums of its rows are divided by how little of a texel a pixel sees."""
    texels = np.full((16, 64, 4), np.float32(0.7))
    corners = np.array([(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)])
    uv = (corners @ np.array([(1.0, 0.1), (-0.1, 1.0)]) - 0.5) * per_pixel / np.array([64.0, 16.0])
    sheet = shapes.quad(np.c_[corners, np.zeros(4)], uv=uv, texture="t")
    scene = Scene("flat", Camera("orthographic", height=8.0), (sheet,), textures={"t": ImageTexture(texels)})
    frame = render(scene, "reference:", size=(8, 8))
    assert np.abs(frame.pixels - texels[0, 0, 0]).max() <= frame.uncertainty < 1e-7
