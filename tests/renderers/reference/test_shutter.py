"""Bounds of moving scenes hold against brute force in time, under any filter, and closed forms come out."""

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.renderers.reference.faces import build_faces
from aliasbench.renderers.reference.filtered import draw_filtered
from aliasbench.renderers.reference.flat import draw_instant
from aliasbench.renderers.reference.moving import draw_panels
from aliasbench.renderers.reference.paths import scene_paths
from aliasbench.renderers.reference.pieces import pieces_at
from aliasbench.renderers.reference.placement import movers_of, place_faces, room_for
from aliasbench.renderers.sampling.filters import make_filter
from aliasbench.scenes.model import Camera, Motion, Spin
from aliasbench.scenes.projection import view_at

SIZE = (16, 16)
BOX = make_filter("box", 0.5)


def brute_force(scene, size, frame, spec, samples):
    """Return the mean of exact pictures at regular times, and what it differs by from half of them."""
    faces, paths = build_faces(scene), scene_paths(scene)
    half = [
        sum(
            draw_filtered(
                scene, faces, paths, size, frame, (k + offset) / samples * scene.animation.shutter, spec
            ).pixels
            for k in range(samples)
        )
        / samples
        for offset in (0.25, 0.75)
    ]
    return (half[0] + half[1]) / 2, np.abs(half[0] - half[1]).max(axis=2)


def assert_bound_holds(scene, size=SIZE, frame=0, spec=BOX, samples=400, target=1e-5, loosest=2e-5):
    """Check every pixel's own bound against many instants; their two halves differ by more than they are off."""
    integral = draw_panels(scene, build_faces(scene), scene_paths(scene), size, frame, spec, target)
    truth, doubt = brute_force(scene, size, frame, spec, samples)
    middle = draw_instant(scene, build_faces(scene), scene_paths(scene), size, frame, scene.animation.shutter / 2)
    assert np.abs(truth - middle.pixels).max() > 1e-3
    assert (np.abs(integral.pixels - truth).max(axis=2) <= integral.bound + doubt).all()
    assert np.median(doubt) < 1e-3
    assert integral.bound.max() <= loosest
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
    assert 0.01 < integral.pixels[8, 8, 0] < 0.99


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
    frame = render(scene, "reference:", size=(24, 24))
    expected = np.clip((16 - np.arange(24) - 0.5) / 8, 0, 1)
    expected[[7, 15]] = 1.0, 1 / 16
    expected[8:16] = 1 - (np.arange(8) + 0.5) / 8
    assert frame.uncertainty is not None
    assert frame.uncertainty <= 1e-5
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


def test_what_rushes_in_from_far_outside_is_seen_for_its_share_of_the_way(make_polygon, make_scene):
    # one unit wide, across all of the picture on its way of 82 units
    block = make_polygon([(-41, -0.5), (-40, -0.5), (-40, 0.5), (-41, 0.5)], motion=Motion((82.0 * 30, 0, 0)))
    frame = render(make_scene([block], shutter=1.0), "reference:", size=SIZE)
    expected = np.zeros((16, 16, 3))
    expected[4:12] = 1 / 82
    assert np.abs(frame.pixels - expected).max() <= frame.uncertainty <= 1e-4


def test_what_comes_from_behind_the_camera_stays_in_the_bound(make_polygon, make_scene):
    block = make_polygon(
        [(-0.5, -0.5, 6), (0.5, -0.5, 6), (0.5, 0.5, 5.5), (-0.5, 0.5, 5.5)], motion=Motion((0, 0, -45.0))
    )
    assert_bound_holds(make_scene([block], shutter=1.0))


def test_a_decal_that_turns_on_a_floor_keeps_a_small_bound(make_polygon, make_scene):
    camera = Camera("perspective", position=(0.0, 2.0, 3.0), fov_y_deg=40.0)
    floor = make_polygon([(-2, 0, -2), (2, 0, -2), (2, 0, 2), (-2, 0, 2)], (0.2, 0.2, 0.2))
    decal = make_polygon(
        [(-0.8, 0, -0.5), (0.8, 0, -0.4), (0.1, 0, 0.7)],
        (1, 0, 0.3),
        motion=Motion(spin=Spin((0, 1, 0), (0, 0, 0), 4.0)),
    )
    assert_bound_holds(make_scene([floor, decal], camera=camera, shutter=1.0))


def test_a_matrix_motion_through_its_singular_middle_stays_in_the_bound(make_polygon, make_scene):
    begin = tuple(np.eye(4).ravel())
    end = tuple(np.diag([-1.0, -1.0, 1.0, 1.0]).ravel())
    motion = Motion(matrices=(begin, end))
    scene = make_scene([make_polygon([(-0.7, -0.4), (0.5, -0.6), (0.3, 0.8)], motion=motion)], shutter=1.0)
    assert_bound_holds(scene)


@pytest.mark.parametrize(
    ("name", "radius"), [("box", 0.3), ("gaussian", 1.5), ("lanczos", 2.0), ("mitchell", 2.0), ("cone", 1.0)]
)
def test_every_filter_stays_in_its_bound(make_polygon, make_scene, name, radius):
    camera = Camera("perspective", fov_y_deg=25.0, velocity=(1.0, 0, -3.0))
    back = make_polygon([(-0.6, -0.9, -0.2), (0.9, -0.6, -0.2), (0.1, 0.9, -0.2)], (0, 0.5, 1))
    scene = make_scene([back, blade(make_polygon, 5.0)], camera=camera, shutter=0.5, background=(0.1, 0.2, 0))
    assert_bound_holds(scene, size=(9, 7), spec=make_filter(name, radius), samples=200, target=1e-4, loosest=2e-4)


def test_faces_placed_by_a_kernel_are_the_pieces_of_an_instant(make_polygon, make_scene):
    rng = np.random.default_rng(8)
    matrices = tuple(tuple((np.eye(4) + 0.3 * np.vstack([rng.normal(size=(3, 4)), np.zeros(4)])).ravel()) for _ in "ab")
    motions = [
        Motion(),
        Motion((3.0, -2.0, 9.0)),
        Motion((1.0, 2.0, 0.5), Spin((1.0, 2.0, 0.3), (0.2, 0.1, 0.4), 17.0)),
        Motion(matrices=matrices),
        Motion((0.0, 0.0, 140.0)),
    ]
    objects = [make_polygon(rng.uniform(-0.9, 0.9, (3, 3)), motion=m) for m in motions]
    for camera in (
        Camera("orthographic", height=2.0, velocity=(1.0, 2.0, 3.0)),
        Camera("perspective", fov_y_deg=50.0, velocity=(1.0, 2.0, -3.0), target_velocity=(5.0, 0.0, 2.0)),
    ):
        scene = make_scene(objects, camera=camera, shutter=1.0)
        faces, paths = build_faces(scene), scene_paths(scene)
        movers = movers_of(faces, paths, view_at(camera, scene.animation, 3, 0.0, SIZE), 3)
        room = room_for(len(objects), movers.widest)
        for time in (0.0, 0.37, 1.0):
            pieces = pieces_at(faces, paths, view_at(camera, scene.animation, 3, time, SIZE), 3, time)
            m = place_faces(movers, np.arange(len(objects)), len(objects), time, room)
            k = room.starts[m]
            assert m >= 3
            assert np.array_equal(room.owners[:m], pieces.owners)
            assert np.array_equal(room.starts[: m + 1], pieces.starts)
            assert np.abs(room.points[:k] - pieces.points).max() < 1e-10
            assert np.abs(room.planes[:m, 0] - pieces.planes[:, 0]).max() < 1e-10


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (9, 1)])
def test_smallest_pictures_and_none_to_see(make_polygon, make_scene, size):
    empty = render(make_scene([], background=(0.1, 0.2, 0.7), shutter=1.0), "reference:filter=tent", size=size)
    assert np.abs(empty.pixels - (0.1, 0.2, 0.7)).max() <= empty.uncertainty
    behind = make_polygon([(-1, -1, 9), (1, -1, 9), (0, 1, 9)], motion=Motion((1.0, 0, 0)))
    camera = Camera("perspective", fov_y_deg=40.0)
    frame = render(make_scene([behind], camera=camera, background=(0.5, 0, 1), shutter=1.0), "reference:", size=size)
    assert np.abs(frame.pixels - (0.5, 0, 1)).max() <= frame.uncertainty <= 1e-5


def test_a_small_budget_loosens_the_bound_and_keeps_it(make_polygon, make_scene):
    scene = make_scene([blade(make_polygon, 8.0), blade(make_polygon, -5.0)], shutter=1.0)
    faces, paths = build_faces(scene), scene_paths(scene)
    rich, poor = (draw_panels(scene, faces, paths, SIZE, 0, BOX, 1e-5, budget) for budget in (1e9, 1e5))
    assert rich.bound.max() <= 2e-5 < poor.bound.max()
    assert (np.abs(rich.pixels - poor.pixels).max(axis=2) <= rich.bound + poor.bound).all()


def test_the_same_picture_on_any_number_of_threads(make_polygon, make_scene, monkeypatch):
    scene = make_scene([blade(make_polygon, 8.0)], shutter=0.5)
    faces, paths = build_faces(scene), scene_paths(scene)
    spec = make_filter("tent", 1.0)
    many = draw_panels(scene, faces, paths, (8, 80), 0, spec)
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0}, raising=False)
    one = draw_panels(scene, faces, paths, (8, 80), 0, spec)
    assert np.array_equal(many.pixels, one.pixels)
    assert np.array_equal(many.bound, one.bound)
