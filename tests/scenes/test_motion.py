"""Motion against scipy's rotations, and exactness where turns are whole."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from aliasbench.scenes.model import Animation, Motion, Spin
from aliasbench.scenes.motion import object_matrix, rotation_matrix, shutter_fraction, spin_turns

EPS = float(np.finfo(np.float64).eps)
POINT = np.array([0.3, -0.7, 1.1, 1.0])
unit = st.floats(-1.0, 1.0)
axes = st.tuples(unit, unit, unit).filter(lambda a: np.linalg.norm(a) > 0.1)


@given(axis=axes, turns=st.floats(-3.0, 3.0))
@settings(max_examples=100, deadline=None)
def test_rotation_equals_scipys(axis: tuple[float, float, float], turns: float) -> None:
    a = np.array(axis) / np.linalg.norm(axis)
    expected = Rotation.from_rotvec(2 * np.pi * turns * a).as_matrix()
    # scipy takes its angle, up to 3 turns of 2 pi, as the length of a vector: the products that made the vector and the
    # length are rounded, some four ulp in all, before it is reduced
    np.testing.assert_allclose(rotation_matrix(axis, turns), expected, rtol=0, atol=4 * 6 * np.pi * EPS + 8 * EPS)


@given(axis=axes, turns=st.floats(-1e3, 1e3))
@settings(max_examples=50, deadline=None)
def test_rotation_is_orthonormal_and_keeps_its_axis(axis: tuple[float, float, float], turns: float) -> None:
    r = rotation_matrix(axis, turns)
    np.testing.assert_allclose(r @ r.T, np.eye(3), rtol=0, atol=16 * EPS)
    assert np.linalg.det(r) == pytest.approx(1.0, abs=16 * EPS)
    np.testing.assert_allclose(r @ np.array(axis), axis, rtol=0, atol=16 * EPS)


@pytest.mark.parametrize(
    ("turns", "image"),
    [(0.0, (1, 0, 0)), (0.25, (0, 1, 0)), (0.5, (-1, 0, 0)), (0.75, (0, -1, 0)), (1.0, (1, 0, 0)), (-7.25, (0, -1, 0))],
)
def test_quarter_turns_about_z_are_exact_and_counter_clockwise(turns: float, image: tuple[float, float, float]) -> None:
    assert (rotation_matrix((0.0, 0.0, 2.0), turns) @ np.array([1.0, 0.0, 0.0])).tolist() == list(image)


@pytest.mark.parametrize("frame", [0, 1, 7, 10**6])
def test_whole_turns_a_frame_give_the_same_matrix_every_frame(frame: int) -> None:
    motion = Motion(spin=Spin((1.0, 2.0, 3.0), (0.5, -0.5, 0.25), 60.0))
    np.testing.assert_array_equal(object_matrix(motion, Animation(fps=30.0), frame, 0.0), np.eye(4))


def test_a_rotor_at_the_frame_rate_less_one_creeps_backwards() -> None:
    spin = Spin((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 29.0)
    turns = np.array([spin_turns(spin, Animation(fps=30.0), n, 0.0) for n in range(61)])
    # 29 / 30 is rounded by half an ulp once; the product with n and the remainder by at most n ulp more
    difference = turns + np.arange(61) / 30.0
    np.testing.assert_allclose(difference, np.round(difference), rtol=0, atol=62 * EPS)


def test_velocity_and_spin_are_added_as_stated() -> None:
    animation = Animation(fps=24.0, frames=5, shutter=0.5)
    spin = Spin((0.2, -1.0, 0.4), (0.5, 0.25, -0.75), 1.7)
    velocity = np.array([0.3, -0.2, 0.9])
    t = (3 + 0.25) / 24.0
    axis = np.array(spin.axis) / np.linalg.norm(spin.axis)
    r = Rotation.from_rotvec(2 * np.pi * 1.7 * t * axis)
    c = np.array(spin.center)
    expected = c + velocity * t + r.apply(POINT[:3] - c)
    matrix = object_matrix(Motion(tuple(velocity), spin), animation, 3, 0.25)
    np.testing.assert_allclose((matrix @ POINT)[:3], expected, rtol=0, atol=32 * EPS)
    assert matrix[3].tolist() == [0, 0, 0, 1]


def test_two_matrices_are_interpolated_over_every_frame_anew() -> None:
    begin = np.eye(4)
    end = np.eye(4)
    end[:3, 3] = (2.0, 4.0, -6.0)
    motion = Motion(matrices=(tuple(begin.ravel().tolist()), tuple(end.ravel().tolist())))
    for frame in (0, 5):
        for fraction in (0.0, 0.25, 1.0):
            moved = object_matrix(motion, Animation(frames=9), frame, fraction) @ POINT
            np.testing.assert_array_equal(moved[:3], POINT[:3] + fraction * end[:3, 3])


def test_a_resting_object_has_the_identity() -> None:
    np.testing.assert_array_equal(object_matrix(Motion(), Animation(), 12, 0.7), np.eye(4))


def test_the_shutter_opens_for_its_share_of_the_interval() -> None:
    assert shutter_fraction(Animation(shutter=0.5), 0.5) == 0.25
    assert shutter_fraction(Animation(shutter=0.0), 0.9) == 0.0
