"""Gaps and coverage error on lines of known width, and what is none."""

import math

import numpy as np
import pytest

from aliasbench.metrics.catalog import measure

SIDE = 40


def line(width, ground=0.0):
    """Coverage of a level line `width` pixels wide (less than 1), within row 20; one frame."""
    picture = np.full((1, SIDE, SIDE), ground)
    picture[0, 20] += width
    return picture


def dots(truth, every):
    """The same line as a point sample may show it: every so many pixels one is lit, all others are not."""
    picture = np.zeros_like(truth)
    picture[0, 20, ::every] = 1.0
    return picture


@pytest.mark.parametrize("every", [2, 4, 8])
def test_of_a_broken_line_the_dark_pixels_are_gaps_and_the_light_is_right(make_scene, rgb, every):
    truth = line(1 / every)
    test = dots(truth, every)
    score = measure("gaps", rgb(test), rgb(truth), scene=make_scene((SIDE, SIDE)), filter_radius_px=0.0)
    # 1/8 does not stand out by more than 1/8.
    expected = SIDE * (1 - 1 / every) if every < 8 else 0
    assert (score.value, score.status) == (expected, "ok")
    assert score.extras["pixels"] == (SIDE if every < 8 else 0)
    assert score.extras["share"] == (pytest.approx(1 - 1 / every) if every < 8 else None)
    assert score.extras["coverage_error"] == pytest.approx(0.0, abs=1e-12)


def test_a_line_that_is_not_there_is_all_gap_and_all_its_light_is_missing(make_scene, rgb):
    truth = np.concatenate([line(0.3), line(0.3)])
    test = np.concatenate([line(0.3), line(0.0)])
    score = measure("gaps", rgb(test), rgb(truth), scene=make_scene((SIDE, SIDE)), filter_radius_px=0.0)
    assert score.value == SIDE / 2
    assert score.extras["coverage_bias"] == pytest.approx(-0.5)
    assert score.extras["coverage_error"] == pytest.approx(math.sqrt(0.5))


def test_a_faint_line_is_no_gap_and_neither_is_one_that_is_dimmed(make_scene, rgb):
    scene = make_scene((SIDE, SIDE))
    faint = measure("gaps", rgb(line(0.0)), rgb(line(0.1)), scene=scene)
    assert (faint.value, faint.extras["pixels"]) == (0.0, 0.0)
    dimmed = measure("gaps", rgb(line(0.01)), rgb(line(0.6)), scene=scene)
    assert dimmed.value == 0.0
    assert dimmed.extras["coverage_bias"] == pytest.approx(0.01 / 0.6 - 1)


def test_dark_is_what_is_darkest_in_the_frame(make_scene, rgb):
    truth, test = line(0.3, ground=0.4), line(0.0, ground=0.4)
    scene = make_scene((SIDE, SIDE), contrast=2.0)
    assert measure("gaps", rgb(2 * test), rgb(2 * truth), scene=scene, filter_radius_px=0.0).value == SIDE
    flat = measure("gaps", rgb(test), rgb(test), scene=scene)
    assert (flat.value, flat.extras["coverage_error"], flat.extras["share"]) == (0.0, None, None)


def test_samples_leave_a_pixel_dark_as_often_as_chance_says(make_scene, rgb):
    rng = np.random.default_rng(1)
    coverage, samples, seeds = 0.3, 4, 16
    truth = np.full((1, SIDE, SIDE), coverage)
    truth[0, 0] = 0.0
    test = rng.binomial(samples, truth, size=(seeds, *truth.shape)) / samples
    score = measure("gaps", rgb(test), rgb(truth), scene=make_scene((SIDE, SIDE)), filter_radius_px=0.0)
    missed = (1 - coverage) ** samples
    # Five standard deviations of a share of so many pixels.
    pixels = seeds * SIDE * (SIDE - 1)
    assert score.extras["share"] == pytest.approx(missed, abs=5 * math.sqrt(missed * (1 - missed) / pixels))


def test_thresholds_that_the_reference_cannot_tell_are_said(make_scene, rgb):
    truth, test = line(0.128), line(0.0)
    scene = make_scene((SIDE, SIDE))
    poor = measure("gaps", rgb(test), rgb(truth), scene=scene, reference_uncertainty=0.003)
    assert (poor.value, poor.status) == (None, "below_reference_floor")
    assert measure("gaps", rgb(test), rgb(truth), scene=scene, reference_uncertainty=0.001).status == "ok"
    clear = measure("gaps", rgb(test), rgb(line(0.3)), scene=scene, reference_uncertainty=0.001)
    assert (clear.value, clear.status) == (SIDE - 2, "ok")
