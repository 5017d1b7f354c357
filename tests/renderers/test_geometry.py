"""Bodies and coplanar layers: what moves alike stays together, and the later of two coplanar surfaces is in front."""

import numpy as np
import pytest

from aliasbench.renderers.geometry import MOST_LAYERS, build_bodies, coplanar_layers
from aliasbench.scenes.errors import UnsupportedScene
from aliasbench.scenes.model import Animation, Camera, Motion, Scene, Spin, Surface
from aliasbench.scenes.motion import object_matrix

CAMERA = Camera("orthographic", height=2.0)
STILL = Motion()
DRIFT = Motion(velocity=(0.1, 0.0, 0.0))


def triangle(x: float, y: float = 0.0, z: float = 0.0, motion: Motion = STILL) -> Surface:
    corners = np.array([[x, y, z], [x + 1.0, y, z], [x, y + 1.0, z]])
    return Surface(corners, np.array([[0, 1, 2]], np.int32), motion=motion)


def layers(*surfaces: Surface) -> list[int]:
    return coplanar_layers(Scene("s", CAMERA, surfaces)).tolist()


def test_overlapping_coplanar_surfaces_stack_in_their_order() -> None:
    assert layers(triangle(0.0), triangle(0.1), triangle(0.2)) == [0, 1, 2]


def test_surfaces_that_share_only_an_edge_or_lie_apart_stay_in_layer_zero() -> None:
    other_half = Surface(np.array([[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]), np.array([[0, 1, 2]], np.int32))
    assert layers(triangle(0.0), other_half, triangle(5.0)) == [0, 0, 0]


def test_layers_are_those_that_every_pair_of_surfaces_asks_for() -> None:
    rng = np.random.default_rng(3)
    # On a grid, so that some are the same, some touch, some overlap.
    corners = [(x / 2, y / 2) for x, y in rng.integers(0, 14, (60, 2)).tolist()]
    expected: list[int] = []
    for k, (x, y) in enumerate(corners):
        # Triangles of one shape overlap where their difference is within the hexagon |dx|, |dy|, |dx + dy| < 1.
        near = [
            expected[j]
            for j, (u, v) in enumerate(corners[:k])
            if abs(u - x) < 1 and abs(v - y) < 1 and abs(u - x + v - y) < 1
        ]
        expected.append(max(near, default=-1) + 1)
    assert max(expected) > 2
    assert layers(*(triangle(x, y) for x, y in corners)) == expected


def test_as_many_surfaces_lie_on_top_of_each_other_as_layers_can_tell_apart() -> None:
    same = [triangle(0.0)] * (MOST_LAYERS + 1)
    assert layers(*same) == list(range(MOST_LAYERS + 1))
    with pytest.raises(UnsupportedScene, match="more than 4096 objects on top of each other in one plane"):
        layers(*same, triangle(0.5))


def test_other_planes_do_not_interact() -> None:
    assert layers(triangle(0.0), triangle(0.1, z=1e-4), triangle(0.2, z=-1.0)) == [0, 0, 0]


def test_surfaces_that_move_differently_in_one_plane_are_always_stacked() -> None:
    assert layers(triangle(0.0), triangle(9.0, motion=DRIFT), triangle(20.0)) == [0, 1, 2]


def test_a_tilted_plane_is_recognised_from_either_side() -> None:
    turn = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    a, b = triangle(0.0), triangle(0.1)
    flipped = Surface(b.vertices[::-1] @ turn.T, np.array([[0, 1, 2]], np.int32))
    assert layers(Surface(a.vertices @ turn.T, a.triangles), flipped) == [0, 1]


def test_surfaces_that_move_alike_form_one_body_and_keep_their_index() -> None:
    still = Motion(spin=Spin((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 0.0))
    bodies = build_bodies(
        Scene("s", CAMERA, (triangle(0.0), triangle(3.0, motion=DRIFT), triangle(6.0, z=-1.0, motion=still)))
    )
    assert [b.surfaces.tolist() for b in bodies] == [[0, 2], [1]]
    assert all(np.abs(b.vertices).max() <= 3.5 for b in bodies)


@pytest.mark.parametrize("offset", [0.0, 1e6])
def test_a_body_s_matrix_places_its_vertices_relative_to_the_eye(offset: float) -> None:
    motion = Motion((0.5, 0.0, 0.25), Spin((0.0, 1.0, 1.0), (offset, 1.0, 0.0), 0.75))
    shape = triangle(offset, motion=motion)
    (body,) = build_bodies(Scene("s", CAMERA, (shape,)))
    eye = np.array([offset, 0.0, 5.0])
    world = object_matrix(motion, Animation(24.0), 7, 0.3)
    local = body.local_matrix(world, eye)
    expected = shape.vertices @ world[:3, :3].T + world[:3, 3] - eye
    placed = body.vertices @ local[:3, :3].T + local[:3, 3]
    assert np.allclose(placed, expected, rtol=0.0, atol=1e-15 * max(offset, 1.0) * 8)
