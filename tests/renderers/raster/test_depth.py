"""Which surface is seen: the nearer by a hundred thousandth, the later in one plane, never one behind the eye."""

import itertools

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.scenes.model import Camera, Motion, Spin

pytestmark = pytest.mark.usefixtures("gl_checked")
RED, GREEN, BLUE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
SIZE = (33, 33)


def cameras(position, target, size):
    """Both projections, seeing `size` world units at the target."""
    distance = np.linalg.norm(np.subtract(position, target))
    fov = 2 * np.degrees(np.arctan(size / 2 / distance))
    yield Camera("orthographic", position=position, target=target, height=size)
    yield Camera("perspective", position=position, target=target, fov_y_deg=fov)


def square(make, z, color, half=1.0, **options):
    return make.polygon(
        [[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]], color=color, **options
    )


def assert_all(pixels, color):
    np.testing.assert_array_equal(pixels, np.broadcast_to(np.float32(color), pixels.shape))


@pytest.mark.parametrize("distance", [1e-3, 1.0, 1e4])
def test_planes_a_hundred_thousandth_of_the_distance_apart_are_told_apart(make, distance):
    for camera in cameras((0, 0, 0), (0, 0, -distance), distance):
        # a wall far behind must not cost the two their precision (float32 vertices of one body would, at 150 times)
        wall = square(make, -50 * distance, BLUE, half=50 * distance)
        near = square(make, -distance, RED, half=distance)
        far = square(make, -distance * (1 + 1e-5), GREEN, half=distance)
        for order in itertools.permutations([wall, near, far]):
            assert_all(render(make.scene(*order, camera=camera), "raster:", size=SIZE).pixels, RED)


@pytest.mark.parametrize("target", [(0.0, 0.0, 0.0), (0.4, -0.3, 0.0)])
def test_in_one_plane_the_later_object_wins(make, target):
    first, second = square(make, 0.0, RED, half=2.0), square(make, 0.0, GREEN, half=2.5)
    third = make.polygon([[-3, -2.9, 0], [3, -3, 0], [0, 5, 0]], color=BLUE)
    for camera, msaa in itertools.product(cameras((3.0, 2.0, 4.0), target, 1.0), (1, 4)):
        for order in itertools.permutations([first, second, third]):
            pixels = render(make.scene(*order, camera=camera), f"raster:msaa={msaa},passes=3", size=SIZE).pixels
            assert_all(pixels, order[-1].color)


def test_in_one_plane_a_moving_object_keeps_its_rank(make):
    still = square(make, 0.0, RED, half=3.0)
    spinning = square(make, 0.0, GREEN, half=3.0, motion=Motion(spin=Spin((0, 0, 1), (0, 0, 0), 1.7)))
    for camera in cameras((0.0, -3.0, 4.0), (0, 0, 0), 1.0):
        for order in ([still, spinning], [spinning, still]):
            scene = make.scene(*order, camera=camera, animation=make.moving)
            assert_all(render(scene, "raster:passes=4", size=SIZE, frame=3).pixels, order[-1].color)


def test_layers_move_nothing_in_the_picture(make):
    base = make.star(camera=make.perspective)
    # the star again on top of one of another colour: every sample must be hidden
    below = [make.polygon(s.vertices, color=(0.0, 0.0, 0.0)) for s in base.objects]
    stacked = make.scene(*below, *base.objects, camera=make.perspective, background=base.background)
    for technique in ("raster", "raster:msaa=4"):
        np.testing.assert_array_equal(
            render(stacked, technique, size=(64, 64)).pixels, render(base, technique, size=(64, 64)).pixels
        )


def test_what_is_behind_the_camera_is_not_seen(make):
    for camera in cameras((0, 0, 0), (0, 0, -1), 1.0):
        behind, ahead = square(make, 0.5, RED, half=9.0), square(make, -5.0, GREEN, half=9.0)
        assert_all(render(make.scene(behind, ahead, camera=camera), "raster", size=SIZE).pixels, GREEN)
        assert_all(render(make.scene(behind, camera=camera), "raster", size=SIZE).pixels, (0, 0, 0))


def test_nothing_in_front_of_the_camera_is_cut_away(make):
    for camera in cameras((0, 0, 0), (0, 0, -1), 1.0):
        for z, end in ((-1e-4, -1.0), (-1e-3, -100.0), (-1.0, -1e5)):
            near = square(make, z, RED, half=max(1.0, -z))
            far = square(make, end, GREEN, half=-end)
            assert_all(render(make.scene(near, far, camera=camera), "raster", size=SIZE).pixels, RED)


def test_a_floor_that_passes_under_the_camera_fills_the_picture_below_the_horizon(make):
    floor = make.polygon([[-1e4, -1, -1e4], [1e4, -1, -1e4], [1e4, -1, 1e4], [-1e4, -1, 1e4]], color=GREEN)
    camera = Camera("perspective", position=(0, 0, 0), target=(0, 0, -1), fov_y_deg=90.0)
    pixels = render(make.scene(floor, camera=camera), "raster", size=(64, 64)).pixels[..., 1]
    np.testing.assert_array_equal(pixels[:32], 0.0)
    np.testing.assert_array_equal(pixels[32:], 1.0)


def test_far_from_the_origin_a_scene_looks_as_at_the_origin(make):
    offset = np.array([3e6, -2e6, 1e6])
    base = make.star(camera=make.perspective)
    moved = [make.polygon(s.vertices + offset, color=s.color) for s in base.objects]
    position, target = (tuple(np.add(p, offset)) for p in (make.perspective.position, make.perspective.target))
    camera = Camera("perspective", position=position, target=target, fov_y_deg=make.perspective.fov_y_deg)
    scene = make.scene(*moved, camera=camera, background=base.background)
    size = (64, 48)
    expected, doubtful = make.sample(base, size, 0.5, 0.5)
    pixels = render(scene, "raster", size=size).pixels
    np.testing.assert_allclose(pixels[~doubtful], expected[~doubtful], atol=1e-6)
