"""The camera's two directions undo each other, and its conventions are the stated ones."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Animation, Camera
from aliasbench.scenes.projection import focus_at, lens_view, view_at

STILL = Animation()
FLAT = Camera("orthographic", height=2.0)
DEEP = Camera("perspective", position=(1.0, 2.0, 3.0), target=(0.0, 0.5, -1.0), fov_y_deg=40.0)
part = st.floats(0.0, 1.0)


@pytest.mark.parametrize("camera", [FLAT, DEEP], ids=["orthographic", "perspective"])
@given(x=part, y=part, depth=st.floats(0.1, 100.0))
@settings(max_examples=60, deadline=None)
def test_a_point_on_a_ray_projects_back_to_where_the_ray_came_from(
    camera: Camera, x: float, y: float, depth: float
) -> None:
    view = view_at(camera, STILL, 0, 0.0, (320, 200))
    origin, direction = view.ray(np.array(320 * x), np.array(200 * y))
    back = view.project(origin + depth * direction)
    # coordinates up to 160 pixels from the middle, depths to 100: some ulp of those
    np.testing.assert_allclose(back, [320 * x, 200 * y, depth], rtol=1e-12, atol=1e-11)


@pytest.mark.parametrize("camera", [FLAT, DEEP], ids=["orthographic", "perspective"])
def test_the_axis_meets_the_middle_of_the_picture(camera: Camera) -> None:
    for size in ((64, 48), (7, 5), (1, 1)):
        image = view_at(camera, STILL, 0, 0.0, size).project(np.array(camera.target))
        np.testing.assert_allclose(image[:2], np.array(size) / 2, rtol=0, atol=1e-12 * max(size))


def test_an_orthographic_camera_has_its_height_from_top_to_bottom_and_square_pixels() -> None:
    view = view_at(FLAT, STILL, 0, 0.0, (400, 200))
    corners = np.array([[-2.0, 1.0, 0.3], [2.0, -1.0, -7.0]])
    np.testing.assert_array_equal(view.project(corners), [[0.0, 0.0, 4.7], [400.0, 200.0, 12.0]])


def test_a_perspective_camera_has_its_angle_from_top_to_bottom() -> None:
    camera = Camera("perspective", position=(0.0, 0.0, 0.0), target=(0.0, 0.0, -1.0), fov_y_deg=90.0)
    view = view_at(camera, STILL, 0, 0.0, (100, 100))
    np.testing.assert_allclose(view.project(np.array([3.0, 3.0, -3.0])), [100.0, 0.0, 3.0], rtol=0, atol=1e-12)


def test_the_target_moves_along_unless_it_has_a_velocity() -> None:
    animation = Animation(fps=10.0)
    moving = Camera("orthographic", height=2.0, velocity=(1.0, 0.0, 0.0))
    still = view_at(FLAT, animation, 0, 0.0, (64, 64))
    later = view_at(moving, animation, 5, 0.5, (64, 64))
    np.testing.assert_array_equal(later.forward, still.forward)
    np.testing.assert_allclose(later.origin - still.origin, [0.55, 0.0, 0.0], rtol=0, atol=1e-15)
    turning = Camera("orthographic", height=2.0, velocity=(1.0, 0.0, 0.0), target_velocity=(0.0, 0.0, 0.0))
    axis = np.array([-0.55, 0.0, -5.0])
    np.testing.assert_allclose(
        view_at(turning, animation, 5, 0.5, (64, 64)).forward, axis / np.linalg.norm(axis), rtol=0, atol=1e-15
    )


@pytest.mark.parametrize(
    ("camera", "message"),
    [
        (Camera("orthographic", target=(0.0, 0.0, 5.0), height=2.0), r"position equals target at t = 0 s"),
        (Camera("orthographic", up=(0.0, 0.0, 1.0), height=2.0), r"up \[0\.0, 0\.0, 1\.0\] is along the viewing axis"),
        (Camera("orthographic"), "an orthographic camera needs height"),
        (Camera("perspective"), "a perspective camera needs fov_y_deg"),
    ],
)
def test_a_degenerate_camera_is_refused(camera: Camera, message: str) -> None:
    with pytest.raises(InputError, match=message):
        view_at(camera, STILL, 0, 0.0, (8, 8))


@pytest.mark.parametrize("projection", ["orthographic", "perspective"])
def test_lens_views_agree_with_rays_through_lens_and_focus(projection: str) -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        camera = Camera(projection, tuple(rng.normal((0, 0, 6))), tuple(rng.normal(size=3)), height=3.0, fov_y_deg=50.0)
        view = view_at(camera, Animation(), 0, 0.0, (64, 48))
        (a, b), focus = rng.normal(size=2), rng.uniform(0.5, 9.0)
        through = lens_view(view, a, b, focus)
        x, y = rng.uniform(0, 64), rng.uniform(0, 48)
        start, along = view.ray(np.array(x), np.array(y))
        in_focus = start + along * focus
        np.testing.assert_allclose(through.project(in_focus), [x, y, focus], atol=1e-11)
        lens = (start if projection == "orthographic" else view.origin) + a * view.right + b * view.up
        for depth in rng.uniform(0.2, 20.0, 3):
            np.testing.assert_allclose(
                through.project(lens + (in_focus - lens) * depth / focus), [x, y, depth], atol=1e-10
            )
        begin, direction = through.ray(np.array(x), np.array(y))
        np.testing.assert_allclose(begin + direction * focus, in_focus, atol=1e-11)
        np.testing.assert_allclose(begin, lens, atol=1e-11)


def test_centre_of_the_lens_is_the_pinhole() -> None:
    view = view_at(DEEP, Animation(), 0, 0.0, (64, 48))
    through = lens_view(view, 0.0, 0.0, 3.0)
    assert all(np.array_equal(getattr(through, k), getattr(view, k)) for k in ("origin", "right", "up", "forward"))
    assert through.shear == view.shear == (0.0, 0.0)


def test_focus_follows_the_target_unless_it_is_given() -> None:
    moving = Camera("orthographic", (0, 0, 5), (0, 0, 0), height=2.0, target_velocity=(0, 0, 1.0))
    assert focus_at(moving, Animation(fps=4.0), 6, 0.0) == pytest.approx(3.5)
    assert focus_at(replace(moving, velocity=(0, 0, 1.0)), Animation(fps=4.0), 6, 0.0) == pytest.approx(5.0)
    assert focus_at(replace(moving, focus_distance=2.0), Animation(), 6, 0.0) == 2.0
