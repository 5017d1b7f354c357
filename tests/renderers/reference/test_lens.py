"""A lens: what is in focus is the pinhole's; what is not is spread over a disc, to closed forms and to brute force."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

from aliasbench.renderers.catalog import render
from aliasbench.renderers.reference import averaged, defocus
from aliasbench.renderers.reference.faces import build_faces
from aliasbench.renderers.reference.paths import scene_paths
from aliasbench.renderers.reference.snapshots import FlatPictures, Shot
from aliasbench.renderers.sampling.filters import filter_of, make_filter
from aliasbench.renderers.technique import parse_technique
from aliasbench.scenes.model import Camera, Motion, Spin

DEEP = Camera("perspective", fov_y_deg=40.0)
FLAT = Camera("orthographic", height=2.0)


def disc_radius(camera, height, z):
    """Return the radius in pixels of the disc that a point at world height z becomes; the camera is at z = 5."""
    depth = 5.0 - z
    flat = camera.projection == "orthographic"
    scale = height / 2.0 if flat else height / 2 / math.tan(math.radians(20.0)) / depth
    return camera.lens_radius * abs(1.0 - depth / camera.focus_distance) * scale, scale


def edge_response(t):
    """Return the share of a unit disc to the left of t."""
    t = min(1.0, max(-1.0, t))
    return 0.5 + (t * math.sqrt(1.0 - t * t) + math.asin(t)) / math.pi


def square(z, left, right, low=-50.0, high=50.0):
    return [(left, low, z), (right, low, z), (right, high, z), (left, high, z)]


@pytest.mark.parametrize("camera", [DEEP, FLAT], ids=lambda c: c.projection)
@pytest.mark.parametrize(
    ("lens_radius", "focus", "z"), [(0.3, 4.0, 1.5), (0.05, 7.0, -3.0), (1.2, 3.0, 0.5), (1e-4, 2.0, 0.0)]
)
@pytest.mark.parametrize(
    "filter_text", ["box", "box,radius=1.3", "tent", "gaussian", "gaussian,radius=inf,sigma=0.3", "mitchell", "lanczos"]
)
def test_defocused_edge_is_the_filtered_edge_response(
    make_polygon, make_scene, camera, lens_radius, focus, z, filter_text
):
    camera = replace(camera, lens_radius=lens_radius, focus_distance=focus)
    n, at = 13, 0.037
    scene = make_scene([make_polygon(square(z, at, 50.0), (0.5, 1.0, 0.25))], camera=camera)
    frame = render(scene, f"reference:filter={filter_text}", size=(n, 3))
    radius, scale = disc_radius(camera, 3, z)
    spec = filter_of(parse_technique(f"reference:filter={filter_text}"))
    edge = n / 2 + at * scale
    truth = []
    for column in range(n):
        offset = column + 0.5 - edge
        cuts = sorted({*spec.knots, *(s * radius - offset for s in (-1, 1) if abs(s * radius - offset) < spec.support)})
        parts = [
            quad(lambda q, o=offset: float(spec.profile(q)) * edge_response((o + q) / radius), a, b, epsabs=1e-13)[0]
            for a, b in pairwise(cuts)
        ]
        truth.append(sum(parts))
    assert frame.uncertainty_kind == "bound"
    assert frame.uncertainty < 1e-9
    # quad's own error is some 1e-11 at the roots of the response
    np.testing.assert_allclose(frame.pixels[1], np.outer(truth, (0.5, 1.0, 0.25)), atol=frame.uncertainty + 5e-11)


@pytest.mark.parametrize("camera", [DEEP, FLAT], ids=lambda c: c.projection)
def test_a_point_becomes_an_even_disc(make_polygon, make_scene, camera):
    camera = replace(camera, lens_radius=0.5, focus_distance=2.5)
    n, half, z = 33, 0.004, 0.5
    scene = make_scene([make_polygon(square(z, -half, half, -half, half))], camera=camera)
    frame = render(scene, "reference:", size=(n, n))
    radius, scale = disc_radius(camera, n, z)
    mass = (2 * half * scale) ** 2
    assert frame.uncertainty < 1e-8
    assert frame.pixels[..., 0].sum() == pytest.approx(mass, rel=1e-6)
    x, y = np.meshgrid(np.arange(n) + 0.5 - n / 2, np.arange(n) + 0.5 - n / 2)
    distance = np.hypot(x, y)
    blur = math.sqrt(0.5) * (1 + 2 * half * scale)
    inside, outside = distance < radius - blur, distance > radius + blur
    assert inside.sum() > 30
    np.testing.assert_allclose(frame.pixels[inside, 0], mass / (math.pi * radius**2), rtol=1e-6)
    assert np.abs(frame.pixels[outside]).max() == 0.0


@pytest.mark.parametrize("filter_text", ["box", "gaussian", "cone"])
def test_what_is_in_focus_is_the_pinhole_picture(make_polygon, make_scene, filter_text):
    camera = Camera("perspective", position=(0, 0, 4.0), fov_y_deg=35.0)
    turning = Motion(spin=Spin((0, 0, 1), (0.1, 0, 0), 3.0))
    star = [(-0.7, -0.5), (0.6, -0.6), (0.3, 0.7)]
    for motion in (None, turning):
        pinhole = make_scene([make_polygon(star, (0.9, 0.2, 0.4), motion=motion)], camera=camera)
        lens = replace(pinhole, camera=replace(camera, lens_radius=0.4, focus_distance=None if motion else 4.0))
        one, two = (render(s, f"reference:filter={filter_text}", size=(9, 7)) for s in (pinhole, lens))
        assert np.array_equal(one.pixels, two.pixels)
        assert (one.uncertainty, one.uncertainty_kind) == (two.uncertainty, "bound")


def random_layers(rng, make_polygon):
    """Return polygons that face the camera at z = 5, now and then before a backdrop, and a camera."""
    objects = []
    if rng.random() < 0.5:
        z = rng.uniform(-3, -1)
        objects.append(make_polygon(square(z, -50.0, 50.0), tuple(rng.random(3))))
    depths = rng.uniform(-0.5, 2.5, 2)
    for _ in range(rng.integers(1, 4)):
        angles = np.sort(rng.random(rng.integers(3, 6)) * 2 * np.pi)
        radius = 10 ** rng.uniform(-1.5, 0)
        points = np.stack([radius * np.cos(angles), radius * np.sin(angles), 0 * angles], axis=1)
        center = np.append(rng.normal(size=2) * 0.6, rng.choice(depths))
        objects.append(make_polygon(points + center, tuple(rng.random(3))))
    camera = replace(DEEP if rng.random() < 0.5 else FLAT, lens_radius=10 ** rng.uniform(-2.5, -0.3))
    return objects, replace(camera, focus_distance=rng.uniform(2, 8))


def test_layers_agree_with_brute_force_over_the_lens(make_polygon, make_scene):
    rng, specs, drawn = np.random.default_rng(8), [("box", 0.5), ("tent", 1.0), ("gaussian", 1.5), ("mitchell", 2.0)], 0
    for trial in range(16):
        objects, camera = random_layers(rng, make_polygon)
        scene = make_scene(objects, camera=camera, background=tuple(rng.random(3)))
        spec = make_filter(*specs[trial % 4])
        faces, paths, size = build_faces(scene), scene_paths(scene), (8, 7)
        exact = defocus.draw_layers(scene, faces, paths, size, 0, 0.0, spec)
        if exact is None:
            continue
        drawn += 1
        assert exact.bound.max() < 1e-7
        pictures = FlatPictures(Shot(scene, faces, paths, size, 0, spec))
        count, means = 64, np.zeros((8, 7, 8, 3))
        for replicate in range(8):
            places = averaged.lens_places(count, camera.lens_radius, (0.0, 0.0), 100 * trial + replicate)
            pictures.add(places, 0, means[replicate])
        means /= count
        error = means.std(axis=0, ddof=1) / math.sqrt(8)
        # 168 values: seven standard errors of 7 degrees of freedom, and a point or two that all replicates missed
        assert (np.abs(means.mean(axis=0) - exact.pixels) <= 12 * error + 2 / (8 * count)).all()
    assert drawn >= 10


def test_layers_that_hide_one_another_where_they_blur_are_left_to_averages(make_polygon, make_scene):
    camera = replace(FLAT, lens_radius=0.3, focus_distance=5.0)
    back, front = make_polygon(square(-1.0, -0.5, 0.3, -0.4, 0.4)), make_polygon(square(1.0, 0.0, 0.8, -0.3, 0.6))
    apart = make_polygon(square(1.0, 0.95, 1.4, -0.3, 0.6))
    spec = make_filter("box", 0.5)
    for second, expected in ((front, False), (apart, True)):
        scene = make_scene([back, second], camera=camera)
        found = defocus.draw_layers(scene, build_faces(scene), scene_paths(scene), (8, 8), 0, 0.0, spec)
        assert (found is not None) == expected


def test_cut_layers_of_one_depth_show_the_later_object(make_polygon, make_scene):
    camera = replace(FLAT, lens_radius=0.2, focus_distance=4.0)
    red = make_polygon(square(0.0, -0.6, 0.4, -0.5, 0.5), (1.0, 0.0, 0.0))
    blue = make_polygon(square(0.0, -0.1, 0.7, -0.2, 0.8), (0.0, 0.0, 1.0))
    alone = [render(make_scene([o], camera=camera), "reference:", size=(10, 10)) for o in (red, blue)]
    both = render(make_scene([red, blue], camera=camera), "reference:", size=(10, 10))
    assert both.uncertainty_kind == "bound"
    np.testing.assert_allclose(both.pixels[..., 2], alone[1].pixels[..., 2], atol=1e-9)
    overlap = make_polygon(square(0.0, -0.1, 0.4, -0.2, 0.5))
    shared = render(make_scene([overlap], camera=camera), "reference:", size=(10, 10)).pixels[..., 0]
    np.testing.assert_allclose(both.pixels[..., 0], alone[0].pixels[..., 0] - shared, atol=1e-9)


@pytest.mark.parametrize("size", [(1, 1), (1, 5), (4, 1)])
def test_empty_scenes_and_what_is_behind_a_lens(make_polygon, make_scene, size):
    camera = replace(DEEP, lens_radius=0.5, focus_distance=3.0)
    behind = make_polygon(square(7.0, -1.0, 1.0))
    for objects in ([], [behind]):
        frame = render(make_scene(objects, camera=camera, background=(0.1, 0.2, 0.7)), "reference:", size=size)
        np.testing.assert_allclose(frame.pixels, np.broadcast_to((0.1, 0.2, 0.7), (size[1], size[0], 3)), atol=1e-12)
        assert frame.uncertainty_kind == "bound"
