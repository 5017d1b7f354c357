"""What photographed walls and floors, turning cameras and pairs of matrices promise: loops, pans and closed forms."""

import math

import numpy as np
import pytest

from aliasbench.scenes.catalog import SCENES, build_scene
from aliasbench.scenes.model import FloatArray, Scene
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import View, view_at
from aliasbench.scenes.walls import SHIFT

WALLS = ("brick-wall", "page-wall", "photo-wall", "photo-wall:photo=coins,speed=-0.5", "page-wall:height=0.5")


def first_view(scene: Scene, size: tuple[int, int] = (256, 256), frame: int = 0, fraction: float = 0.0) -> View:
    return view_at(scene.camera, scene.animation, frame, fraction, size)


# --- photographs ---


@pytest.mark.parametrize("name", WALLS)
def test_a_wall_loops_over_whole_photographs_of_square_texels(name: str) -> None:
    scene = build_scene(name)
    (wall,), (texture,) = scene.objects, scene.textures.values()
    assert wall.uv is not None
    rows, columns = getattr(texture, "texels", np.zeros((1, 1))).shape[:2]
    np.testing.assert_allclose(wall.uv * (columns, rows), wall.vertices[:, :2] * columns - SHIFT, rtol=1e-14)
    moved = first_view(scene, frame=scene.animation.frames).origin - first_view(scene).origin
    assert moved[0] == round(moved[0]) != 0.0
    assert moved[1] == moved[2] == 0.0


@pytest.mark.parametrize("name", WALLS)
def test_a_walls_declared_pan_is_how_every_point_moves_in_the_picture(name: str) -> None:
    scene = build_scene(name)
    (pan,) = scene.facts.pans
    points = np.array([(-1.3, 0.4, 0.0), (0.0, 0.0, 0.0), (2.0, -0.2, 0.0)])
    before, after = (first_view(scene, frame=n).project(points) for n in (3, 4))
    declared = np.array(pan.velocity) / scene.animation.fps * first_view(scene).scale
    np.testing.assert_allclose(after[:, 0] - before[:, 0], declared[0], rtol=1e-12)
    np.testing.assert_array_equal(after[:, 1:], before[:, 1:])
    # after a period the pan has gone the width of one photograph
    assert abs(pan.velocity[0]) * pan.period == pytest.approx(1.0, rel=1e-15)


@pytest.mark.parametrize("name", ["brick-wall", "page-wall"])
def test_a_walls_default_pan_is_less_than_a_pixel_a_frame_at_256_pixels(name: str) -> None:
    scene = build_scene(name)
    (pan,) = scene.facts.pans
    assert 0.2 < abs(pan.velocity[0]) * first_view(scene).scale / scene.animation.fps < 0.9


@pytest.mark.parametrize("speed", [-2.0, 2.0])
def test_a_wall_fills_the_widest_picture_for_ten_seconds(speed: float) -> None:
    scene = SCENES["brick-wall"].build(speed=speed, height=8.0)
    for frame in (0, 300):
        corners = first_view(scene, (400, 100), frame).project(scene.objects[0].vertices)
        assert corners[:, :2].min() < -5.0
        assert corners[:, 0].max() > 405.0
        assert corners[:, 1].max() > 105.0


def test_a_wall_that_does_not_move_declares_no_pan() -> None:
    scene = SCENES["page-wall"].build(speed=0.0)
    assert scene.is_static
    assert scene.facts.pans == ()
    assert scene.animation.frames == 1


def test_the_photograph_of_choice_is_the_named_scene() -> None:
    for photo in ("brick", "grass", "gravel"):
        chosen, named = build_scene(f"photo-floor:photo={photo}"), build_scene(f"{photo}-floor")
        assert (chosen.objects, chosen.textures, chosen.camera) == (named.objects, named.textures, named.camera)
    assert build_scene("photo-wall:photo=brick").textures == build_scene("brick-wall").textures


# --- motion of the camera, and two matrices ---


@pytest.mark.parametrize("turn", [60.0, -90.0, 5.0])
@pytest.mark.parametrize("shutter", [0.0, 0.5])
def test_the_camera_turns_at_its_rate_in_the_middle_of_the_animation(turn: float, shutter: float) -> None:
    scene = SCENES["camera-turn"].build(turn=turn, shutter=shutter)
    middle = (scene.animation.frames - 1 + shutter) / 2

    def yaw(frames: float) -> float:
        forward = first_view(scene, frame=0, fraction=frames).forward
        return math.degrees(math.atan2(forward[0], -forward[2]))

    assert yaw(middle) == pytest.approx(0.0, abs=1e-12)
    step = 1e-3
    rate = (yaw(middle + step) - yaw(middle - step)) / (2 * step) * scene.animation.fps
    # the tangent goes evenly: the central difference errs by the rate's square (in radians per step) over 3
    assert rate == pytest.approx(turn, rel=(math.radians(turn) / scene.animation.fps * step) ** 2 + 1e-9)


def test_a_travelling_camera_keeps_its_target_and_streaks_near_and_far_opposite_ways() -> None:
    scene = SCENES["camera-turn"].build(turn=0.0, travel=6.0)
    points = np.array([(0.0, 0.0, -z) for z in (3.0, 5.0, 10.0)])
    frames = scene.animation.frames
    first, last = (first_view(scene, frame=n).project(points) for n in (0, frames - 1))
    for seen in (first, last):
        np.testing.assert_allclose(seen[1, :2], 128.0, atol=1e-9)
    moved = last[:, 0] - first[:, 0]
    assert moved[0] < -50.0
    assert moved[2] > 30.0


def test_rows_of_the_turning_camera_do_not_hide_each_other() -> None:
    scene = SCENES["camera-turn"].build(turn=90.0, travel=5.0, shutter=1.0)
    # the camera stays on the x axis, so what could hide something is as high over its depth as that
    assert scene.camera.velocity[1:] == scene.camera.position[1:] == (0.0, 0.0)
    spans = {}
    for surface in scene.objects:
        slopes = surface.vertices[:, 1] / -surface.vertices[:, 2]
        spans[-surface.vertices[0, 2]] = (slopes.min(), slopes.max())
    assert sorted(spans) == [3.0, 5.0, 10.0]
    assert spans[3.0][1] < spans[5.0][0] < spans[5.0][1] < spans[10.0][0]


@pytest.mark.parametrize(
    ("turn", "travel", "wide"), [(60.0, 0.0, 4), (-90.0, 0.0, 4), (0.0, 10.0, 4), (5.0, -3.0, 4), (90.0, -10.0, 2)]
)
@pytest.mark.parametrize("kind", ["posts", "bricks"])
def test_rows_of_the_turning_camera_go_on_outside_of_wide_pictures(
    turn: float, travel: float, wide: int, kind: str
) -> None:
    scene = SCENES["camera-turn"].build(turn=turn, travel=travel, shutter=1.0, kind=kind)
    ends = np.concatenate([s.vertices for s in scene.objects])
    for frame, fraction in ((0, 0.0), (scene.animation.frames - 1, 1.0)):
        view = first_view(scene, (100 * wide, 100), frame, fraction)
        for depth in (3.0, 5.0, 10.0):
            row = ends[np.isclose(ends[:, 2], -depth)]
            for end, side in ((row[:, 0].min(), -1.0), (row[:, 0].max(), 1.0)):
                x, _, ahead = view.project(np.array([[end, 0.0, -depth]]))[0]
                assert ahead <= 0.0 or side * (x - 50.0 * wide) > 50.0 * wide


def test_a_camera_that_neither_turns_nor_travels_is_at_rest() -> None:
    assert SCENES["camera-turn"].build(turn=0.0).is_static
    assert not SCENES["camera-turn"].build(turn=0.0, travel=-1.0).is_static
    assert SCENES["two-matrices"].build(angle=0.0).is_static
    assert SCENES["pixel-time-lens-light"].build(rev_per_s=0.0).is_static


@pytest.mark.parametrize("angle", [120.0, -170.0, 90.0, 7.5])
def test_interpolated_matrices_shrink_the_bar_by_the_cosine_of_half_the_angle(angle: float) -> None:
    scene = SCENES["two-matrices"].build(angle=angle)

    def tips(fraction: float) -> list[FloatArray]:
        """The far ends' middles of the two white halves, from their bars' centres."""
        out = []
        for surface, center in ((scene.objects[0], -0.5), (scene.objects[2], 0.5)):
            m = object_matrix(surface.motion, scene.animation, 0, fraction)
            tip = (surface.vertices[1] + surface.vertices[2]) / 2
            out.append((m @ [*tip, 1.0])[:3] - (center, 0.0, 0.0))
        return out

    for fraction in (0.0, 1.0):
        left, right = tips(fraction)
        np.testing.assert_allclose(left, right, atol=1e-15)
    left, right = (float(np.linalg.norm(t)) for t in tips(0.5))
    assert right == pytest.approx(0.46, rel=1e-14)
    assert left / right == pytest.approx(math.cos(math.radians(angle) / 2), rel=1e-12)


@pytest.mark.parametrize("angle", [120.0, 170.0])
def test_bars_stay_in_the_picture_and_on_their_side_and_loop(angle: float) -> None:
    scene = SCENES["two-matrices"].build(angle=angle)
    for fraction in np.linspace(0.0, 1.0, 41):
        for k, surface in enumerate(scene.objects):
            m = object_matrix(surface.motion, scene.animation, 1, float(fraction))
            x, y = (surface.vertices @ m[:3, :3].T + m[:3, 3])[:, :2].T
            side = -x if k < 2 else x
            assert side.min() > 0.02
            assert max(side.max(), np.abs(y).max()) < 0.98
    turns = scene.animation.frames * angle / 360
    assert turns == pytest.approx(round(turns), abs=1e-9)
