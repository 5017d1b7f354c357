"""Every pass is drawn at its own time in the shutter, objects and camera alike; frames follow from one to the next."""

from dataclasses import replace

import numpy as np
import pytest

from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.geometry import build_bodies
from aliasbench.renderers.raster.placement import body_matrices, make_placement
from aliasbench.renderers.raster.projection import Instant, Window, clip_matrices
from aliasbench.renderers.sampling.patterns import sample_set
from aliasbench.scenes.model import Camera, Motion, Spin
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import view_at

pytestmark = pytest.mark.usefixtures("gl_checked")
SIZE = (48, 40)
SPIN = Motion(velocity=(0.4, -0.2, 0.1), spin=Spin((0.1, 0.2, 1.0), (0.05, 0.0, 0.0), 3.7))
SHEAR = Motion(
    matrices=(
        (1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1),
        (0.8, 0.3, 0, 0.1, -0.2, 1.1, 0, 0, 0, 0, 1, 0.2, 0, 0, 0, 1),
    )
)


def compare_passes(make, scene, technique, pattern, *, frame, shutter):
    pixels = render(scene, technique, size=SIZE, frame=frame, seed=9).pixels
    samples = [make.sample(scene, SIZE, x, y, frame=frame, fraction=u * shutter) for x, y, u in pattern]
    sure = ~np.any([doubtful for _, doubtful in samples], axis=0)
    expected = np.mean([colors for colors, _ in samples], axis=0)
    assert sure.mean() > 0.6
    assert np.ptp(expected[sure]) > 0.3
    np.testing.assert_allclose(pixels[sure], expected[sure], atol=2e-6)


@pytest.mark.parametrize("motion", [SPIN, SHEAR], ids=["spin", "matrices"])
@pytest.mark.parametrize("camera", ["orthographic", "perspective"])
def test_passes_are_drawn_at_the_patterns_times(make, motion, camera):
    scene = make.star(camera=getattr(make, camera), motion=motion, animation=make.moving)
    pattern = sample_set("jittered", 6, seed=9, frame=2)[:, :3]
    compare_passes(make, scene, "raster:passes=6", pattern, frame=2, shutter=0.75)


def test_time_center_draws_every_pass_at_the_middle_of_the_shutter(make):
    scene = make.star(motion=SPIN, animation=make.moving)
    pattern = sample_set("jittered", 5, seed=9, frame=1)[:, :3]
    pattern[:, 2] = 0.5
    compare_passes(make, scene, "raster:passes=5,time=center", pattern, frame=1, shutter=0.75)


def test_one_pass_is_drawn_at_the_middle_of_the_shutter(make):
    scene = make.star(motion=SPIN, animation=make.moving)
    compare_passes(make, scene, "raster", [(0.5, 0.5, 0.5)], frame=4, shutter=0.75)


def test_the_camera_moves_during_the_shutter(make):
    camera = replace(make.perspective, velocity=(2.0, 1.0, -3.0), target_velocity=(-1.0, 0.5, 0.0))
    scene = make.star(camera=camera, animation=make.moving)
    pattern = sample_set("grid", 4, seed=9, frame=1)[:, :3]
    compare_passes(make, scene, "raster:passes=4,sampler=grid", pattern, frame=1, shutter=0.75)


def test_a_closed_shutter_freezes_the_frame(make):
    moving = replace(make.moving, shutter=0.0)
    scene = make.star(motion=SPIN, animation=moving)
    pattern = sample_set("jittered", 4, seed=9, frame=7)[:, :3]
    compare_passes(make, scene, "raster:passes=4", pattern, frame=7, shutter=0.0)


def test_frame_n_is_n_times_the_motion_of_frame_one(make):
    # 16 px a unit, a pixel and a half each frame
    moving = Motion(velocity=(24.0 * 1.5 / 16, 0.0, 0.0))
    bar = make.polygon([[-1, -2, 0], [-0.875, -2, 0], [-0.875, 2, 0], [-1, 2, 0]], motion=moving)
    scene = make.scene(bar, animation=replace(make.moving, shutter=0.0))
    with prepare(scene, "raster", size=(32, 32)) as prepared:
        for frame in (0, 2, 4, 10):
            lit = np.flatnonzero(prepared.render(frame=frame).pixels[5, :, 0])
            np.testing.assert_array_equal(lit, [1.5 * frame, 1.5 * frame + 1])


def test_hundreds_of_bodies_that_move_differently_each_go_their_own_way(make):
    # 2100 bodies take three rows of the matrix texture
    width, count = 60, 2100
    dots = []
    for k in range(count):
        column, row = k % width, k // width
        x, y = (column + 0.2 - width / 2) / 10, (17.5 - row - 0.8) / 10
        goal = (k * 7) % width
        v = Motion(velocity=((goal - column) / 10 * 24.0, 0.0, 0.0))
        corners = [[x, y, 0], [x + 0.06, y, 0], [x + 0.06, y + 0.06, 0], [x, y + 0.06, 0]]
        dots.append(make.polygon(corners, color=(1.0, k / count, 0.0), motion=v))
    scene = make.scene(*dots, camera=Camera("orthographic", height=3.5), animation=replace(make.moving, shutter=0.0))
    with prepare(scene, "raster", size=(width, 35)) as prepared:
        start, end = prepared.render(frame=0).pixels, prepared.render(frame=1).pixels
    number = np.arange(count).reshape(35, width)
    np.testing.assert_allclose(start[..., 1], number / count, rtol=1e-6)
    for row in range(35):
        # later objects win where two arrive at one place
        expected = np.zeros(width)
        for k in number[row]:
            expected[(k * 7) % width] = k / count
        np.testing.assert_allclose(end[row, :, 1], expected, rtol=1e-6)


def test_clip_matrices_agree_with_the_camera_to_float64(make):
    for camera in (make.orthographic, replace(make.perspective, velocity=(1.0, 2.0, 0.5))):
        scene = make.star(camera=camera, motion=SPIN, animation=make.moving)
        (body,) = build_bodies(scene)
        jitter, margin = (0.3, -0.45), 1
        (clip,) = clip_matrices(
            scene,
            make_placement([body]),
            Instant(3, 0.4, jitter),
            size=SIZE,
            window=Window(-margin, -margin, SIZE[0] + 2 * margin, SIZE[1] + 2 * margin),
        )
        matrix = object_matrix(SPIN, scene.animation, 3, 0.4)
        world = (body.vertices + body.origin) @ matrix[:3, :3].T + matrix[:3, 3]
        expected = view_at(camera, scene.animation, 3, 0.4, SIZE).project(world)
        drawn = np.c_[body.vertices, np.ones(len(body.vertices))] @ clip.T
        ndc = drawn[:, :3] / drawn[:, 3:]
        pixels = (ndc[:, :2] + 1) / 2 * (np.array(SIZE) + 2 * margin) - margin + jitter
        np.testing.assert_allclose(pixels, expected[:, :2], atol=1e-11)
        assert ((ndc[:, 2] > 0) & (ndc[:, 2] < 1)).all()


def test_all_bodies_at_once_are_where_each_is_alone(make):
    rng = np.random.default_rng(4)
    motions = [SPIN, SHEAR, Motion(), Motion(velocity=(1.0, -2.0, 0.3))]
    motions += [Motion(spin=Spin(tuple(rng.normal(size=3)), tuple(rng.normal(size=3)), r)) for r in (6.0, -13.7, 1e4)]
    objects = [make.polygon(rng.normal(size=(3, 3)), motion=m) for m in motions]
    bodies = build_bodies(make.scene(*objects))
    assert len(bodies) == len(motions)
    eye = np.array([0.3, 20.0, -4.0])
    for frame, fraction in ((0, 0.0), (1, 0.25), (12345, 0.7)):
        together = body_matrices(make_placement(bodies), make.moving, frame, fraction, eye)
        for body, matrix in zip(bodies, together, strict=True):
            world = object_matrix(body.motion, make.moving, frame, fraction)
            # both round sums of terms up to v t = 1500 in float64
            np.testing.assert_allclose(matrix, body.local_matrix(world, eye), rtol=0, atol=4e-12)
