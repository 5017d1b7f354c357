"""Crawl of stairs along moving edges: the speed that two instants show, which is the true one only below half a row."""

import math

import numpy as np
import pytest

from aliasbench.metrics.catalog import measure
from aliasbench.metrics.crawl import turn_per_frame
from aliasbench.scenes.model import Animation, Facts, Motion, Surface

COLUMNS, FRAMES = 300, 12
GOLDEN = (math.sqrt(5) - 1) / 2


@pytest.fixture
def moving(make_scene, edge_fact, point_edge, box_edge, rgb):
    """(point-sampled frames, exact frames, scene) of an edge that moves by (right, down) pixels a frame."""

    def make(slope, velocity, *, frames=FRAMES, transposed=False, columns=COLUMNS):
        rows = velocity[1] - slope * velocity[0]
        height = 40 + math.ceil(abs(slope) * columns + abs(rows) * frames)
        intercept = 20.3 - min(slope * columns, 0.0) - min(rows * frames, 0.0)
        size = (columns, height)
        x0, x1 = -200.0, columns + 200.0
        ends = [(x0, slope * x0 + intercept), (x1, slope * x1 + intercept)]
        if transposed:
            size, velocity, ends = size[::-1], velocity[::-1], [(y, x) for x, y in reversed(ends)]
        fact = edge_fact(size, *ends)
        outline = np.array([fact.start, fact.end, (5000.0, 5000.0, 0.0)])
        motion = Motion(velocity=(30.0 * velocity[0], -30.0 * velocity[1], 0.0))
        plane = Surface(outline, np.array([[0, 1, 2]], dtype=np.int32), motion=motion)
        scene = make_scene(size, facts=Facts(edges=(fact,)), objects=(plane,), animation=Animation(30.0, frames))
        pictures = [
            np.array([edge((columns, height), slope, intercept + rows * k) for k in range(frames)])
            for edge in (point_edge, box_edge)
        ]
        if transposed:
            pictures = [p.transpose(0, 2, 1) for p in pictures]
        return rgb(pictures[0]), rgb(pictures[1]), scene

    return make


def crawl(test, truth, scene, **kwargs):
    return measure("jaggies_str", test, truth, scene=scene, **kwargs).extras["crawl"]


@pytest.mark.parametrize("transposed", [False, True])
@pytest.mark.parametrize(
    ("slope", "velocity"),
    [
        (0.1 * GOLDEN, (0.0, 0.1)),
        (0.1 * GOLDEN, (0.0, -0.37)),
        (0.1 * GOLDEN, (0.0, 0.8)),
        (0.1 * GOLDEN, (0.0, 1.3)),
        (-0.2 * GOLDEN, (0.0, -0.8)),
        (0.1, (0.0, 0.3)),
        (0.1, (0.7, -0.6)),
        (0.05 * GOLDEN, (3.0, 0.0)),
        (GOLDEN, (0.0, 0.3)),
        (-GOLDEN, (1.5, 0.0)),
        (0.77, (0.1, 0.9)),
    ],
)
def test_stairs_seem_to_move_by_the_wrapped_step_of_the_edge(moving, slope, velocity, transposed):
    (found,) = crawl(*moving(slope, velocity, transposed=transposed))
    rows = velocity[1] - slope * velocity[0]
    length = math.hypot(1, slope) / abs(slope)
    # Where the edge crosses a row, x = (row - b) / m: a step down of a row moves the stairs by -1 / m.
    true = -rows * length * math.copysign(1.0, slope)
    wrapped = (rows + 0.5) % 1.0 - 0.5
    assert found["stair_px"] == pytest.approx(length, rel=1e-9)
    assert found["true_px_per_frame"] == pytest.approx(true, rel=1e-9)
    assert found["aliased"] is (abs(rows) >= 0.5)
    # At slope 1/10 harmonic 9 falls on the first's image: 1/9 of its size, 1/9 rad at most in 2 pi, over 11 steps of a
    # line fit far less; elsewhere Hann's window leaves less than 1 / (2 m columns)^3 of the image.
    assert found["px_per_frame"] == pytest.approx(-wrapped * length * math.copysign(1.0, slope), abs=0.003 * length)
    assert found["direction"] == int(math.copysign(1.0, -wrapped * slope))
    # The point sample's displacement is a sawtooth of one row, whose first harmonic is 1 / (2 pi).
    assert found["harmonic_px"] == pytest.approx(1 / (2 * math.pi), rel=0.05)
    if abs(rows) < 0.5:
        assert found["px_per_frame"] == pytest.approx(true, abs=0.003 * length)


@pytest.mark.parametrize("rows", [1.0, -2.0])
def test_stairs_of_an_edge_that_moves_by_whole_rows_stand_still(moving, rows):
    (found,) = crawl(*moving(0.1 * GOLDEN, (0.0, rows)))
    assert found["px_per_frame"] == pytest.approx(0.0, abs=1e-4)
    assert (found["direction"], found["aliased"]) == (0, True)
    assert abs(found["true_px_per_frame"]) == pytest.approx(abs(rows) * found["stair_px"], rel=1e-9)


def test_stairs_that_move_by_half_of_their_length_have_no_direction(moving):
    (found,) = crawl(*moving(0.1 * GOLDEN, (0.0, 0.5)))
    assert (found["direction"], found["aliased"]) == (None, True)
    # The phasors' image, of opposite turn, falls on the same line: within the tolerance of half a turn, 1/100.
    assert found["px_per_frame"] == pytest.approx(found["stair_px"] / 2, rel=1e-3)


@pytest.mark.parametrize("slope", [0.1 * GOLDEN, 0.1, -0.5])
def test_exact_pictures_have_no_stairs_to_crawl(moving, slope):
    _, truth, scene = moving(slope, (0.0, 0.3))
    (found,) = crawl(truth.astype(np.float32), truth, scene)
    assert (found["px_per_frame"], found["direction"]) == (None, None)
    assert found["true_px_per_frame"] == pytest.approx(-0.3 * math.hypot(1, slope) / slope)


def test_stairs_of_two_pixels_have_no_direction_and_edges_along_the_grid_no_stairs(moving):
    (found,) = crawl(*moving(0.5, (0.0, 0.3)))
    assert (found["px_per_frame"], found["direction"]) == (None, None)
    assert found["harmonic_px"] > 0.1
    assert crawl(*moving(0.0, (0.0, 0.3))) == []


def test_still_edges_and_single_frames_do_not_crawl(moving, make_scene):
    test, truth, scene = moving(0.1 * GOLDEN, (0.0, 0.3))
    assert crawl(test[:1], truth[:1], scene) == []
    still = make_scene(scene_size(test), facts=scene.facts, animation=scene.animation)
    assert crawl(test, truth, still) == []


def scene_size(pictures):
    return pictures.shape[2], pictures.shape[1]


def test_noise_does_not_crawl(moving, rgb):
    _, truth, scene = moving(0.1 * GOLDEN, (0.0, 0.3))
    for seed in range(5):
        noisy = np.random.default_rng(seed).binomial(16, truth[..., 0]) / 16
        (found,) = crawl(rgb(noisy), truth, scene)
        assert found["px_per_frame"] is None


def test_stairs_under_noise_crawl_as_they_do(moving):
    test, truth, scene = moving(0.1 * GOLDEN, (0.0, 0.8))
    noisy = test + np.random.default_rng(1).normal(size=(4, *test.shape)) * 0.02
    (found,) = crawl(noisy, truth, scene)
    # Five rows of noise .02 / 2 of four seeds' mean move the phasor, 1 / (2 pi), by .022 sqrt(3 / 2 / 300 / 2) = .001
    # in quadrature, .001 cycles of phase; a line through 12 phases has sqrt(12 / 12^3) = 1/12 of that.
    assert found["px_per_frame"] == pytest.approx(0.2 * found["stair_px"], abs=5e-3 * found["stair_px"])
    assert found["direction"] == 1


def test_a_reference_that_is_not_good_enough_has_no_crawl(moving):
    test, truth, scene = moving(0.1 * GOLDEN, (0.0, 0.8))
    (found,) = crawl(test, truth, scene, reference_uncertainty=0.02)
    assert found["px_per_frame"] is None


def test_a_later_start_of_the_sequence_changes_nothing(moving):
    test, truth, scene = moving(0.1 * GOLDEN, (0.0, 0.8))
    (whole,) = crawl(test, truth, scene)
    (part,) = crawl(test[4:9], truth[4:9], scene, frame_start=4)
    assert part["px_per_frame"] == pytest.approx(whole["px_per_frame"], abs=0.003 * whole["stair_px"])


@pytest.mark.parametrize("turn", [-0.4999, -0.31, 0.0, 0.003, 0.2, 0.49])
@pytest.mark.parametrize("frames", [2, 3, 60])
def test_the_turn_of_clean_phasors_is_found(turn, frames):
    phasors = 0.3 * np.exp(2j * np.pi * (turn * np.arange(frames) + 0.123))
    assert turn_per_frame(phasors) == pytest.approx(turn, abs=1e-7)
