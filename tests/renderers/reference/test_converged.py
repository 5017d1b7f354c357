"""Textured references: closed forms within the stated bound, and both truths of a texture."""

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.scenes.model import Camera, Checker, Grating, ImageTexture, Motion, ZonePlate, read_only
from aliasbench.scenes.textures import evaluate_point

SQUARE = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]


def dark_minus_light(edges):
    """Return the means of (-1)^floor between neighbouring edges."""
    whole = np.floor(edges)
    rest = edges - whole
    return np.diff(np.where(np.mod(whole, 2) == 0, rest, 1 - rest)) / np.diff(edges)


def test_fronto_parallel_checker_is_exact(make_polygon, make_scene):
    scene = make_scene([make_polygon(SQUARE, texture="c")], textures={"c": Checker((5.3, 7.1))})
    frame = render(scene, "reference:", size=(20, 20))
    u = dark_minus_light(np.linspace(0, 5.3, 21))
    v = dark_minus_light(np.linspace(7.1, 0, 21))
    expected = 0.5 - 0.5 * v[:, None] * u[None, :]
    assert frame.uncertainty_kind == "bound"
    assert frame.samples == 0
    assert np.abs(frame.pixels[..., 0] - expected).max() < 1e-11


@pytest.mark.parametrize("texture", ["point", "linear"])
def test_image_truth_is_squares_or_their_blend(make_polygon, make_scene, texture):
    texels = np.random.default_rng(5).random((3, 4, 4)).astype(np.float32)
    scene = make_scene([make_polygon(SQUARE, texture="i")], textures={"i": ImageTexture(read_only(texels))})
    size = (12, 12)
    frame = render(scene, f"reference:texture={texture}", size=size)
    # 12 pixels over 4 and 3 texels: midpoints of a fine grid integrate squares exactly, blends to 1 / k^2
    k = 40
    u = (np.arange(12 * k) + 0.5) / (12 * k)
    v = 1 - u
    column, row = u * 4, v * 3
    if texture == "point":
        values = texels[np.floor(row).astype(int)[:, None], np.floor(column).astype(int)[None, :], :3].astype(float)
    else:
        i, j = np.floor(column - 0.5), np.floor(row - 0.5)
        s, t = (column - 0.5 - i)[None, :, None], (row - 0.5 - j)[:, None, None]
        pick = lambda dj, di: texels[np.mod(j + dj, 3).astype(int)[:, None], np.mod(i + di, 4).astype(int)[None, :], :3]  # noqa: E731
        values = (1 - t) * ((1 - s) * pick(0, 0) + s * pick(0, 1)) + t * ((1 - s) * pick(1, 0) + s * pick(1, 1))
    expected = values.reshape(12, k, 12, k, 3).mean(axis=(1, 3))
    assert frame.uncertainty is not None
    assert np.abs(frame.pixels - expected).max() <= frame.uncertainty + (1e-9 if texture == "point" else 1e-4)


def test_rolled_perspective_checker_is_within_its_bound(make_polygon, make_scene):
    camera = Camera("perspective", position=(0.2, 0.9, 2.0), target=(0, 0, 0), up=(0.3, 1, 0), fov_y_deg=40.0)
    floor = [(-1.0, 0.0, 1.0), (1.0, 0.0, 1.0), (1.0, 0.0, -1.0), (-1.0, 0.0, -1.0)]
    texture = Checker((6.0, 6.0), (0.1, 0.0, 0.0), (0.9, 0.8, 1.0))
    scene = make_scene(
        [make_polygon(floor, (0.5, 1, 1), texture="c")],
        camera=camera,
        textures={"c": texture},
        background=(0.2, 0.2, 0.2),
    )
    size = (16, 12)
    frame = render(scene, "reference:", size=size)
    from aliasbench.scenes.projection import view_at

    k = 64
    x, y = np.meshgrid((np.arange(16 * k) + 0.5) / k, (np.arange(12 * k) + 0.5) / k)
    origin, direction = view_at(camera, scene.animation, 0, 0.0, size).ray(x, y)
    t = -origin[..., 1] / direction[..., 1]
    hit = origin + t[..., None] * direction
    inside = (np.abs(hit[..., 0]) <= 1) & (np.abs(hit[..., 2]) <= 1) & (t > 0)
    uv = np.stack([(hit[..., 0] + 1) / 2, (1 - hit[..., 2]) / 2], axis=-1)
    shown = np.where(inside[..., None], evaluate_point(texture, uv)[..., :3] * (0.5, 1, 1), 0.2)
    expected = shown.reshape(12, k, 16, k, 3).mean(axis=(1, 3))
    assert frame.uncertainty is not None
    assert frame.uncertainty < 5e-3
    # the regular grid itself: a few edges in a pixel, each off by at most half a cell's share
    assert np.abs(frame.pixels - expected).max() <= frame.uncertainty + 3 * 0.5 / k
    assert np.sqrt(((frame.pixels - expected) ** 2).mean()) < 2e-3


@pytest.mark.parametrize("profile", ["sine", "square"])
def test_grating_has_the_box_filter_of_its_wave(make_polygon, make_scene, profile):
    grating = Grating(3.0, 90.0, 0.1, profile, (0.2, 0.2, 0.2), (0.8, 0.7, 0.6))
    scene = make_scene([make_polygon(SQUARE, texture="g")], textures={"g": grating})
    frame = render(scene, "reference:", size=(8, 16))
    v = np.linspace(1, 0, 17)
    if profile == "sine":
        mean = 0.5 + 0.5 * np.diff(np.sin(2 * np.pi * (3 * v + 0.1))) / np.diff(6 * np.pi * v)
    else:
        mean = 0.5 + 0.5 * dark_minus_light(2 * (3 * v + 0.1) + 0.5)
    expected = np.array([0.2, 0.2, 0.2]) + mean[:, None] * np.array([0.6, 0.5, 0.4])
    assert frame.uncertainty is not None
    assert frame.uncertainty < 1e-3
    assert np.abs(frame.pixels - expected[:, None]).max() <= frame.uncertainty


def test_zone_plate_is_within_its_bound(make_polygon, make_scene):
    from scipy.special import fresnel

    k = 200.0
    scene = make_scene([make_polygon(SQUARE, texture="z")], textures={"z": ZonePlate((0.5, 0.5), k, 0.3)})
    frame = render(scene, "reference:", size=(16, 16))
    x = np.linspace(-0.5, 0.5, 17)
    scale = np.sqrt(2 * k / np.pi)
    s, c = fresnel(x * scale)
    along = np.diff(c + 1j * s) / scale * 16
    expected = 0.5 + 0.5 * (np.exp(0.3j) * along[:, None] * along[None, :]).real
    assert frame.uncertainty is not None
    assert frame.uncertainty < 5e-3
    assert np.abs(frame.pixels[..., 1] - expected).max() <= frame.uncertainty


def mean_of_instants(scene, size, count):
    """Return the mean of the exact pictures of `count` instants, evenly spread over the shutter."""
    from aliasbench.renderers.reference.faces import build_faces
    from aliasbench.renderers.reference.paths import scene_paths
    from aliasbench.renderers.reference.texture_tables import texture_table
    from aliasbench.renderers.reference.textured import draw_textured, instant_of
    from aliasbench.scenes.projection import view_at

    faces, paths, table = build_faces(scene), scene_paths(scene), texture_table(scene, linear=False)
    total = np.zeros((size[1], size[0], 3))
    for k in range(count):
        fraction = scene.animation.shutter * (k + 0.5) / count
        view = view_at(scene.camera, scene.animation, 0, fraction, size)
        picture = draw_textured(instant_of(scene, faces, paths, view, 0, fraction, table))
        assert picture is not None
        total += picture.pixels / count
    return total


def test_checker_panned_by_a_whole_period_is_an_even_grey(make_polygon, make_scene):
    wide = [(-9.0, -3.0), (9.0, -3.0), (9.0, 3.0), (-9.0, 3.0)]
    px = 2.0 / 16
    checker = Checker((18.0 / (2 * px), 1.0))
    pan = Motion((4 * px * 30, 0.0, 0.0))
    scene = make_scene([make_polygon(wide, texture="c", motion=pan)], textures={"c": checker}, shutter=1.0)
    frame = render(scene, "reference:", size=(16, 16))
    assert frame.uncertainty_kind == "bound"
    assert frame.uncertainty is not None
    assert frame.uncertainty < 1e-9
    assert np.abs(frame.pixels - 0.5).max() <= frame.uncertainty


@pytest.mark.parametrize("texture", [Checker((7.0, 9.0)), Grating(8.0, 30.0), Grating(5.0, 0.0, 0.2, "square")])
def test_camera_sliding_along_the_rows_of_a_floor_is_exact(make_polygon, make_scene, texture):
    camera = Camera("perspective", position=(0, 0.5, 1), target=(0, 0.2, 0), fov_y_deg=50.0, velocity=(12.0, 0.0, 0.0))
    floor = [(-30.0, 0.0, 0.4), (30.0, 0.0, 0.4), (30.0, 0.0, -9.0), (-30.0, 0.0, -9.0)]
    scene = make_scene([make_polygon(floor, texture="t")], camera=camera, textures={"t": texture}, shutter=1.0)
    size = (12, 10)
    frame = render(scene, "reference:", size=size)
    assert frame.uncertainty_kind == "bound"
    assert frame.uncertainty is not None
    assert frame.uncertainty < 1e-8
    assert frame.pixels.std() > 0.01
    # u moves by at most a period or so: midpoints are off by some 1 / n^2 of it
    assert np.abs(frame.pixels - mean_of_instants(scene, size, 400)).max() < 3e-5


def test_turning_texture_is_within_its_bound(make_polygon, make_scene):
    from aliasbench.scenes.model import Spin

    motion = Motion(spin=Spin((0, 0, 1), (0.1, 0.2, 0.0), 9.0))
    scene = make_scene(
        [make_polygon(SQUARE, texture="c", motion=motion)], textures={"c": Checker((3.0, 2.0))}, shutter=0.8
    )
    size = (10, 8)
    frame = render(scene, "reference:", size=size)
    assert frame.uncertainty_kind == "confidence"
    assert frame.samples > 0
    assert frame.uncertainty is not None
    assert frame.uncertainty < 5e-3
    # a border sweeps a pixel in about a tenth of the shutter: 500 midpoints leave 1e-5 of that
    assert np.abs(frame.pixels - mean_of_instants(scene, size, 500)).max() <= frame.uncertainty + 1e-4


def test_checker_under_a_cone_is_within_its_bound_of_its_squares_as_polygons(make_polygon, make_scene):
    camera = Camera("perspective", position=(0.2, 0.9, 2.0), target=(0, 0, 0), up=(0.3, 1, 0), fov_y_deg=40.0)
    dark, light = (0.1, 0.0, 0.0), (0.9, 0.8, 1.0)
    floor = [(-1.0, 0.0, 1.0), (1.0, 0.0, 1.0), (1.0, 0.0, -1.0), (-1.0, 0.0, -1.0)]
    textured = make_scene(
        [make_polygon(floor, texture="c")], camera=camera, textures={"c": Checker((4.0, 3.0), dark, light)}
    )
    tiles = []
    for i in range(4):
        for j in range(3):
            x0, x1, z0, z1 = i / 2 - 1, (i + 1) / 2 - 1, 1 - j / 1.5, 1 - (j + 1) / 1.5
            tiles.append(
                make_polygon([(x0, 0, z0), (x1, 0, z0), (x1, 0, z1), (x0, 0, z1)], light if (i + j) % 2 else dark)
            )
    size = (10, 7)
    frame = render(textured, "reference:filter=cone", size=size)
    truth = render(make_scene(tiles, camera=camera), "reference:filter=cone", size=size)
    assert truth.uncertainty_kind == "bound"
    assert frame.uncertainty_kind == "confidence"
    assert frame.uncertainty is not None
    assert frame.uncertainty < 2e-2
    assert np.abs(frame.pixels - truth.pixels).max() <= frame.uncertainty


def test_zone_plate_too_fine_for_quadrature_is_sampled_within_its_bound(make_polygon, make_scene):
    # some hundred cycles to a pixel leave nothing but the mean, up to a stationary point's share
    k = 3e5
    scene = make_scene([make_polygon(SQUARE, texture="z")], textures={"z": ZonePlate((0.5, 0.5), k, 0.3)})
    frame = render(scene, "reference:", size=(6, 6))
    assert frame.uncertainty_kind == "confidence"
    assert frame.samples > 0
    assert frame.uncertainty is not None
    assert frame.uncertainty < 3e-2
    assert np.abs(frame.pixels - 0.5).max() <= frame.uncertainty + np.pi / (2 * k) * 36


@pytest.mark.parametrize("keys", ["filter=cone", "filter=box,radius=0.2"])
def test_turning_texture_under_a_filter_is_within_its_bound_of_exact_instants(make_polygon, make_scene, keys):
    from aliasbench.scenes.model import Spin

    motion = Motion(spin=Spin((0, 0, 1), (0.1, 0.2, 0.0), 9.0))
    checker, size, count = {"c": Checker((3.0, 2.0))}, (5, 4), 12
    scene = make_scene([make_polygon(SQUARE, texture="c", motion=motion)], textures=checker, shutter=0.8)
    frame = render(scene, f"reference:{keys}", size=size)
    assert frame.uncertainty_kind == "confidence"
    assert frame.uncertainty is not None
    assert frame.uncertainty < 2e-2
    turned = []
    for k in range(count):
        angle = 2 * np.pi * 9.0 * 0.8 / 30 * (k + 0.5) / count
        corners = []
        for x, y in SQUARE:
            dx, dy = x - 0.1, y - 0.2
            corners.append(
                (0.1 + dx * np.cos(angle) - dy * np.sin(angle), 0.2 + dx * np.sin(angle) + dy * np.cos(angle))
            )
        still = make_scene([make_polygon(corners, texture="c")], textures=checker)
        turned.append(render(still, f"reference:{keys}", size=size).pixels)
    # midpoints of a path whose slope changes by at most some units: h^2 / 8 of that
    assert np.abs(frame.pixels - np.mean(turned, axis=0)).max() <= frame.uncertainty + 5e-3
