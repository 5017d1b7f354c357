"""The certified bound of moving scenes holds against brute force in time, and closed forms come out."""

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.renderers.reference.faces import build_faces
from aliasbench.renderers.reference.flat import draw_instant, draw_slices
from aliasbench.renderers.reference.paths import scene_paths
from aliasbench.scenes.model import Camera, Motion, Spin

SIZE = (24, 24)


def brute_force(scene, size, frame, samples):
    """Return the mean of exact pictures at regular times (interval middles), and the number of them."""
    faces, paths = build_faces(scene), scene_paths(scene)
    shutter = scene.animation.shutter
    times = (np.arange(samples) + 0.5) / samples * shutter
    return sum(draw_instant(scene, faces, paths, size, frame, float(t)).pixels for t in times) / samples


def assert_bound_holds(scene, size=SIZE, frame=0, slices=6, samples=1000):
    """Check every pixel's own bound against many more instants, which are good to their own share of it."""
    faces, paths = build_faces(scene), scene_paths(scene)
    integral = draw_slices(scene, faces, paths, size, frame, slices)[0]
    truth_bound = draw_slices(scene, faces, paths, size, frame, samples)[0].bound
    error = np.abs(integral.pixels - brute_force(scene, size, frame, samples)).max(axis=2)
    assert error.max() > 1e-4
    assert (error <= integral.bound + truth_bound).all()
    return integral


def blade(make_polygon, rev_per_s, **kwargs):
    points = [(0.1, 0.02), (0.8, 0.1), (0.75, 0.4), (0.1, 0.2)]
    return make_polygon(points, motion=Motion(spin=Spin((0, 0, 1), (0, 0, 0), rev_per_s)), **kwargs)


@pytest.mark.parametrize(("rev_per_s", "shutter", "frame"), [(1.0, 1.0, 0), (7.3, 0.5, 11), (-29.0, 1.0, 2)])
def test_turning_blade_stays_in_its_bound(make_polygon, make_scene, rev_per_s, shutter, frame):
    scene = make_scene([blade(make_polygon, rev_per_s)], shutter=shutter)
    assert_bound_holds(scene, frame=frame)


def test_sliding_polygons_in_front_of_each_other_stay_in_the_bound(make_polygon, make_scene):
    one = make_polygon([(-0.8, -0.7), (0.2, -0.5), (-0.2, 0.6)], (1, 0.2, 0), motion=Motion((11.0, 3.0, 0.0)))
    two = make_polygon(
        [(-0.3, -0.9, 0.5), (0.8, 0.3, 0.5), (-0.6, 0.6, 0.5)], (0, 1, 0.5), motion=Motion((-9.0, 5.0, 0.0))
    )
    assert_bound_holds(make_scene([one, two], shutter=1.0))


def test_planes_that_pass_through_each_other_stay_in_the_bound(make_polygon, make_scene):
    tilted = make_polygon([(-0.8, -0.8, -0.4), (0.8, -0.8, 0.4), (0.8, 0.8, 0.4), (-0.8, 0.8, -0.4)], (1, 0, 0))
    rising = make_polygon(
        [(-0.9, -0.6, -0.1), (0.9, -0.6, -0.1), (0.9, 0.7, -0.1), (-0.9, 0.7, -0.1)],
        (0, 1, 0),
        motion=Motion((0, 0, 6.0)),
    )
    integral = assert_bound_holds(make_scene([tilted, rising], shutter=1.0))
    assert 0.01 < integral.pixels[12, 12, 0] < 0.99


def test_moving_camera_and_tumbling_polygon_stay_in_the_bound(make_polygon, make_scene):
    camera = Camera("perspective", fov_y_deg=30.0, velocity=(4.0, 1.0, -6.0), target_velocity=(2.0, 0.0, 0.0))
    tumbling = make_polygon(
        [(-0.8, -0.5), (0.8, -0.3), (0.1, 0.7)], (1, 0.5, 0), motion=Motion(spin=Spin((1, 1, 0), (0.1, 0, 0), 3.0))
    )
    still = make_polygon([(-1, -1, -0.6), (1, -1, -0.4), (1, 1, -0.5), (-1, 1, -0.7)], (0, 0.3, 1))
    assert_bound_holds(make_scene([still, tumbling], camera=camera, shutter=0.7))


def test_two_matrices_stay_in_the_bound(make_polygon, make_scene):
    begin = (1.0, 0, 0, -0.3, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1)
    end = (0.0, -1, 0, 0.4, 1, 0, 0, 0.2, 0, 0, 1, 0, 0, 0, 0, 1)
    scene = make_scene(
        [make_polygon([(-0.4, -0.4), (0.5, -0.3), (0.1, 0.5)], motion=Motion(matrices=(begin, end)))], shutter=1.0
    )
    assert_bound_holds(scene)


def test_edge_that_sweeps_the_picture_leaves_a_ramp(make_polygon, make_scene):
    # the right edge goes from column 8 to 16 at constant speed while the shutter is open
    px = 2.0 / 24
    half_plane = make_polygon([(-9, -9), (-4 * px, -9), (-4 * px, 9), (-9, 9)], motion=Motion((8 * px * 30, 0, 0)))
    scene = make_scene([half_plane], shutter=1.0)
    frame = render(scene, "reference:", size=SIZE)
    expected = np.clip((16 - np.arange(24) - 0.5) / 8, 0, 1)
    expected[[7, 15]] = 1.0, 1 / 16
    expected[8:16] = 1 - (np.arange(8) + 0.5) / 8
    assert frame.uncertainty is not None
    assert frame.uncertainty <= 1e-3
    assert np.abs(frame.pixels - expected[None, :, None]).max() <= frame.uncertainty


@pytest.mark.parametrize(("rev_per_s", "blades"), [(1.0, 3), (29.0, 3)])
def test_blades_blur_to_the_trapezoid_of_their_angle(make_polygon, make_scene, rev_per_s, blades):
    size, duty = (64, 64), 0.5
    objects = []
    for b in range(blades):
        a = 2 * np.pi * (b + np.linspace(0, duty, 9)) / blades
        rim = 3 * np.c_[np.cos(a), np.sin(a)]
        objects.append(make_polygon([(0, 0), *rim], motion=Motion(spin=Spin((0, 0, 1), (0, 0, 0), rev_per_s))))
    frame = render(make_scene(objects, shutter=0.5), "reference:", size=size)
    # time first: a point at angle theta is bright for the share of the sweep that the blades cover
    sweep = rev_per_s / 30 * 0.5 * blades  # in blade periods

    def bright(t):
        return np.floor(t) * duty + np.minimum(t - np.floor(t), duty)

    k = 24
    row, column = 10, 47
    y, x = np.meshgrid(row + (np.arange(k) + 0.5) / k - 32, column + (np.arange(k) + 0.5) / k - 32, indexing="ij")
    phase = np.arctan2(-y, x) / (2 * np.pi) * blades
    expected = float(((bright(phase) - bright(phase - sweep)) / sweep).mean())
    assert frame.uncertainty is not None
    # midpoints over k x k points of a function of slope below 1 / (sweep radius) per pixel
    assert abs(frame.pixels[row, column, 0] - expected) <= frame.uncertainty + 1e-3


def test_center_time_is_the_instant_amid_the_shutter(make_polygon, make_scene):
    scene = make_scene([blade(make_polygon, 10.0)], shutter=0.5)
    middle = draw_instant(scene, build_faces(scene), scene_paths(scene), SIZE, 3, 0.25).pixels
    frame = render(scene, "reference:time=center", size=SIZE, frame=3)
    assert np.array_equal(frame.pixels, middle)
    assert frame.uncertainty is not None
    assert frame.uncertainty < 1e-11


def test_open_shutter_changes_nothing_that_stands_still(make_polygon, make_scene):
    triangle = make_polygon([(-0.5, -0.4), (0.7, 0.1), (0, 0.8)])
    open_, closed = (render(make_scene([triangle], shutter=s), "reference:", size=SIZE) for s in (1.0, 0.0))
    assert np.array_equal(open_.pixels, closed.pixels)
    assert open_.uncertainty == closed.uncertainty


def test_whole_turns_between_frames_give_the_same_picture(make_polygon, make_scene):
    scene = make_scene([blade(make_polygon, 30.0)], shutter=0.0)
    first, later = (render(scene, "reference:", size=SIZE, frame=f).pixels for f in (0, 1000001))
    assert np.array_equal(first, later)


def test_matrix_motion_shrinks_what_turns(make_polygon, make_scene):
    # half a turn in a frame: the mean of both matrices maps everything to the axis
    scene = make_scene([blade(make_polygon, 15.0)], shutter=1.0)
    exact = render(scene, "reference:time=center", size=SIZE).pixels
    linear = render(scene, "reference:time=center,motion=matrix", size=SIZE).pixels
    assert exact.sum() > 10
    assert linear.sum() < 1e-9


def test_what_rushes_in_from_far_outside_stays_in_the_bound(make_polygon, make_scene):
    # 480 pixels to the left at first, across the picture within a thirtieth of the shutter
    block = make_polygon([(-41, -0.5), (-40, -0.5), (-40, 0.5), (-41, 0.5)], motion=Motion((82.0 * 30, 0, 0)))
    assert_bound_holds(make_scene([block], shutter=1.0))


def test_what_comes_from_behind_the_camera_stays_in_the_bound(make_polygon, make_scene):
    block = make_polygon(
        [(-0.5, -0.5, 6), (0.5, -0.5, 6), (0.5, 0.5, 5.5), (-0.5, 0.5, 5.5)], motion=Motion((0, 0, -45.0))
    )
    assert_bound_holds(make_scene([block], shutter=1.0))
