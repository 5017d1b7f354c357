"""The camera's two directions undo each other, and its conventions are the stated ones."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Animation, Camera
from aliasbench.scenes.projection import view_at

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
