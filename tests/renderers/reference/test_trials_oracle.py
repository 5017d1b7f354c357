"""The oracle that judges references, judged itself: by closed forms, by the model's own geometry, and by its parts."""

import numpy as np
import pytest
from oracle import Stage, sample_points
from oracle_filters import Kernel
from oracle_rows import sample_lines
from oracle_rules import integrate_lines
from random_scenes import CLASSES, FILTERS, make_case
from scipy.integrate import dblquad, quad
from scipy.special import ndtr

from aliasbench.scenes.model import Camera, Light, Material, Scene
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import view_at
from aliasbench.scenes.shapes import polygon


@pytest.mark.parametrize("radius", [0.3, 0.5, 1.0, 2.3])
@pytest.mark.parametrize("name", FILTERS)
def test_filters_have_integral_one_and_primitives_that_are_their_integrals(name, radius):
    kernel = Kernel(name, radius, 0.4)
    total = quad(lambda y: float(kernel.primitive(radius, y)), -radius, radius, points=[0.0, -radius / 2, radius / 2])[
        0
    ]
    assert total == pytest.approx(1.0, abs=1e-8)
    for x, y in ((0.3 * radius, 0.1 * radius), (-0.6 * radius, 0.5 * radius), (0.8 * radius, 0.0)):
        expected = quad(lambda t, y=y: float(kernel.density(t, y)), -radius, x, points=[0.0, -radius / 2], limit=200)[0]
        # quad takes its word for the cone's corner at the rim
        assert float(kernel.primitive(x, y)) == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize("name", FILTERS)
def test_places_drawn_under_a_filter_weigh_one_in_all(name):
    kernel = Kernel(name, 1.3, 0.4)
    u = (np.arange(400) + 0.5) / 400
    x, w = kernel.draw(u)
    grid = kernel.density(x[:, None], x[None, :]) * w[:, None] * w[None, :]
    assert grid.mean() == pytest.approx(1.0, abs=1e-4)  # midpoint rule of a Lipschitz function: 1 / n^2


@pytest.mark.parametrize("kind", CLASSES)
def test_cameras_and_motions_are_the_models(kind):
    for seed in range(12):
        case = make_case(kind, seed)
        stage = Stage(case.scene, case.size, case.frame)
        for fraction in (0.0, 0.37, 1.0):
            f = np.array([fraction])
            view = view_at(case.scene.camera, case.scene.animation, case.frame, fraction, case.size)
            origin, right, up, forward, _ = stage.axes(f)
            for mine, theirs in ((origin, view.origin), (right, view.right), (up, view.up), (forward, view.forward)):
                assert np.abs(mine[0] - theirs).max() < 1e-13 * (1 + np.abs(theirs).max())
            assert stage.scale == pytest.approx(view.scale, rel=1e-14)
            for index, surface in enumerate(case.scene.objects):
                m = object_matrix(surface.motion, case.scene.animation, case.frame, fraction)
                expected = surface.vertices @ m[:3, :3].T + m[:3, 3]
                assert np.abs(stage.world(index, f)[0] - expected).max() < 1e-13 * (10 + np.abs(expected).max())


ROWS = ("instant-flat-filter", "texture-instant-filter", "moving-flat-filter", "texture-moving", "lens-motion")


@pytest.mark.parametrize("kind", ROWS)
def test_points_rows_and_rules_agree(kind):
    compared = 0
    for seed in range(8):
        case = make_case(kind, seed)
        stage = Stage(case.scene, case.size, case.frame, linear=case.linear, matrix=case.matrix)
        kernel = Kernel(case.filter, case.radius, case.sigma)
        place = (case.size[1] // 2, case.size[0] // 3)
        mean, error = sample_points(stage, kernel, place, case.shutter, log2=6, seed=5)
        if error.max() < 1e-6:
            continue
        compared += 1
        try:
            rows, rows_error = sample_lines(stage, kernel, place, case.shutter, log2=6, seed=5)
        except OverflowError:
            continue
        assert (np.abs(rows - mean) < 5.5 * np.hypot(error, rows_error) + 5e-5).all(), seed
        if case.shutter[0] == case.shutter[1] and not case.scene.camera.lens_radius:
            try:
                exact, bar = integrate_lines(stage, kernel, place, case.shutter[0], most=400)
            except OverflowError:
                continue
            assert (np.abs(exact - rows) < 5.5 * rows_error + bar + 5e-5).all(), seed
    assert compared >= 2


def test_defocused_edge_is_the_discs_share():
    """A half-plane at depth Z is blurred by a disc of radius R scale abs(1 - Z / F) / Z; the pixel is far smaller."""
    far = 50.0
    edge = polygon([[0.0, -far, 0.0], [far, -far, 0.0], [far, far, 0.0], [0.0, far, 0.0]])
    camera = Camera("perspective", position=(0, 0, 3), fov_y_deg=50.0, lens_radius=0.1, focus_distance=2.0)
    stage = Stage(Scene("edge", camera, (edge,)), (21, 21), 0)
    blur = 0.1 * stage.scale * 0.5 / 3.0
    for column in (9, 10, 11):
        mean, error = sample_lines(stage, Kernel("box", 0.01), (10, column), (0.0, 0.0), log2=8)
        t = np.clip((column + 0.5 - 10.5) / blur, -1, 1)
        assert np.abs(mean - (0.5 + (t * np.sqrt(1 - t * t) + np.arcsin(t)) / np.pi)).max() < 5 * error.max() + 1e-5


def test_irradiance_of_a_rectangle_is_its_double_integral():
    floor = polygon([[-9, 0, 9], [9, 0, 9], [9, 0, -9], [-9, 0, -9]], material=Material("diffuse"))
    light = Light(((-0.5, 1, -0.3), (0.5, 1, -0.3), (0.5, 1, 0.3), (-0.5, 1, 0.3)), (3.0, 2.0, 1.0))
    camera = Camera("orthographic", position=(0.4, 5, 0.2), target=(0.4, 0, 0.2), up=(0, 0, -1), height=1e-3)
    for turned in (False, True):
        quad_ = light.quad[::-1] if turned else light.quad
        scene = Scene("lit", camera, (floor,), lights=(Light(quad_, light.radiance),))
        mean, error = sample_points(Stage(scene, (1, 1), 0), Kernel("box", 0.5), (0, 0), (0.0, 0.0), log2=9)
        # straight above the place looked at the light is in the way: seen from the front or from behind
        assert np.abs(mean - (np.array([3.0, 2.0, 1.0]) if not light_faces_down(quad_) else 0)).max() < 1e-12
        assert error.max() < 1e-12
    aside = Camera("orthographic", position=(0.9, 5, 0.2), target=(0.9, 0, 0.2), up=(0, 0, -1), height=1e-3)
    down = light if light_faces_down(light.quad) else Light(light.quad[::-1], light.radiance)
    scene = Scene("lit", aside, (floor,), lights=(down,))
    mean, error = sample_points(Stage(scene, (1, 1), 0), Kernel("box", 0.5), (0, 0), (0.0, 0.0), log2=9)
    form = dblquad(lambda z, x: 1.0 / ((x - 0.9) ** 2 + 1 + (z - 0.2) ** 2) ** 2, -0.5, 0.5, -0.3, 0.3)[0]
    assert (np.abs(mean - form / np.pi * np.array([3.0, 2.0, 1.0])) < 5 * error + 1e-6).all()


def light_faces_down(corners):
    a, b, _, d = np.array(corners)
    return np.cross(b - a, d - a)[1] < 0


def test_gaussian_edge_is_the_normal_distribution():
    far = 50.0
    edge = polygon([[0.0, -far, 0.0], [far, -far, 0.0], [far, far, 0.0], [0.0, far, 0.0]])
    stage = Stage(Scene("edge", Camera("orthographic", height=2.0), (edge,)), (9, 9), 0)
    for column in range(2, 7):
        mean, _ = integrate_lines(stage, Kernel("gaussian", np.inf, 0.7), (4, column), 0.0)
        assert np.abs(mean - ndtr((column + 0.5 - 4.5) / 0.7)).max() < 1e-12
