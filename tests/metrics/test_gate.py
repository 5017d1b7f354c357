"""The contract on bad input, row by row: what raises, what is a status, and what is an ordinary value."""

import math

import numpy as np
import pytest

from aliasbench.metrics.catalog import METRICS, measure, measure_all
from aliasbench.metrics.gate import Signals, open_gate
from aliasbench.metrics.score import Score, finish, rms, sanitize
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Scene

SHAPE = (2, 12, 10, 3)


@pytest.fixture
def scene(make_scene) -> Scene:
    return make_scene((10, 12))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.int64, np.bool_, np.complex128, np.object_])
def test_pixels_without_a_scale_raise(scene, dtype):
    with pytest.raises(ValueError, match=rf"test: pixels of type {np.dtype(dtype)} have no known scale"):
        measure("rmse", np.zeros(SHAPE, dtype), np.zeros(SHAPE), scene=scene)
    with pytest.raises(ValueError, match=r"reference: pixels of type"):
        measure("rmse", np.zeros(SHAPE), np.zeros(SHAPE, dtype), scene=scene)


@pytest.mark.parametrize("shape", [(2, 12, 10), (12, 10, 3), (2, 12, 10, 4), (1, 12, 10, 3), (3, 2, 10, 12, 3)])
def test_shapes_that_do_not_match_raise(scene, shape):
    with pytest.raises(ValueError, match=r"test: shape \(.*\); must be the reference's \(2, 12, 10, 3\)"):
        measure("rmse", np.zeros(shape), np.zeros(SHAPE), scene=scene)


def test_a_reference_that_is_no_sequence_raises(scene):
    with pytest.raises(ValueError, match=r"reference: shape \(12, 10, 3\); must be \(frames, h, w, 3\)"):
        measure("rmse", np.zeros((12, 10, 3)), np.zeros((12, 10, 3)), scene=scene)


@pytest.mark.parametrize("shape", [(0, 12, 10, 3), (2, 0, 10, 3), (2, 12, 0, 3)])
def test_empty_pictures_raise(scene, shape):
    with pytest.raises(ValueError, match=r"test: shape \(.*\) holds no pixels"):
        measure("rmse", np.zeros(shape), np.zeros(shape), scene=scene)


def test_no_seeds_are_no_pixels(scene):
    with pytest.raises(ValueError, match=r"test: shape \(0, 2, 12, 10, 3\) holds no pixels"):
        measure("noise", np.zeros((0, *SHAPE)), np.zeros(SHAPE), scene=scene)


@pytest.mark.parametrize("contrast", [None, "1"])
def test_a_contrast_that_is_no_number_is_a_bug_of_the_caller(make_scene, contrast):
    with pytest.raises(TypeError, match="must be real number"):
        measure("rmse", np.zeros(SHAPE), np.zeros(SHAPE), scene=make_scene((10, 12), contrast=contrast))


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_reference_that_is_not_finite_raises(scene, bad):
    reference = np.zeros(SHAPE)
    reference[1, 2, 3, 0] = bad
    with pytest.raises(ValueError, match="reference: 1 values are not finite"):
        measure("rmse", np.zeros(SHAPE), reference, scene=scene)


@pytest.mark.parametrize("number", [-1.0, math.nan, math.inf, "1", None, True])
@pytest.mark.parametrize("name", ["filter_radius_px", "reference_uncertainty"])
def test_radius_and_uncertainty_must_be_finite_and_not_negative(scene, name, number):
    with pytest.raises(ValueError, match=rf"{name} .*: must be finite and not negative"):
        measure("rmse", np.zeros(SHAPE), np.zeros(SHAPE), scene=scene, **{name: number})


@pytest.mark.parametrize("number", [-1, 2.5, "0", None, True])
def test_the_first_frame_has_a_whole_number(scene, number):
    with pytest.raises(ValueError, match=r"frame_start .*: must be a whole number, not negative"):
        measure("rmse", np.zeros(SHAPE), np.zeros(SHAPE), scene=scene, frame_start=number)


@pytest.mark.parametrize("name", METRICS)
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_picture_that_is_not_finite_is_reported_with_its_place(scene, name, bad):
    test = np.zeros((2, *SHAPE))
    test[1, 0, 11, 9, 2] = test[1, 1, 0, 0, 0] = bad  # in the border too
    score = measure(name, test, np.zeros(SHAPE), scene=scene)
    assert (score.value, score.status, score.extras["count"]) == (None, "nonfinite", 2)
    assert score.extras["first"] == {"seed": 1, "frame": 0, "row": 11, "column": 9, "channel": 2}


@pytest.mark.parametrize("name", METRICS)
@pytest.mark.parametrize("contrast", [0.0, -1.0, math.nan, math.inf])
def test_a_scene_without_contrast_has_no_scores(make_scene, name, contrast):
    score = measure(name, np.ones(SHAPE), np.zeros(SHAPE), scene=make_scene((10, 12), contrast=contrast))
    assert (score.value, score.status) == (None, "undefined_zero_contrast")


def test_a_flat_picture_has_ordinary_values(scene):
    reference = np.full(SHAPE, 0.25)
    got = measure_all(("rmse", "shimmer", "moire", "buzz", "max_error"), reference + 0.5, reference, scene=scene)
    assert got["rmse"].value == got["max_error"].value == pytest.approx(0.5)
    assert got["shimmer"].value == pytest.approx(0.0, abs=1e-12)
    assert got["moire"].value == pytest.approx(0.0, abs=1e-12)
    assert got["buzz"].value is None


def test_radiances_of_1e200_keep_their_root_mean_squares(scene):
    test = np.zeros(SHAPE)
    test[0] = 1e200
    got = measure_all(METRICS, test, np.zeros(SHAPE), scene=scene)
    assert got["rmse"].value == pytest.approx(1e200 / math.sqrt(2))
    assert got["shimmer"].value == pytest.approx(5e199)
    assert got["max_error"].value == pytest.approx(1e200)
    assert got["relmse"].status == "overflow"


def test_pictures_below_seven_pixels_have_no_ssim_and_borders_may_leave_nothing(make_scene):
    small = np.zeros((1, 8, 9, 3))
    score = measure("ssim", small, small, scene=make_scene((9, 8)))
    assert (score.value, score.status) == (None, "undefined_too_small")
    assert measure("ssim", small, small, scene=make_scene((9, 8)), filter_radius_px=0.0).value == pytest.approx(1.0)
    gone = measure("rmse", small, small, scene=make_scene((9, 8)), filter_radius_px=4.0)
    assert (gone.value, gone.status) == (None, "undefined_too_small")


@pytest.mark.parametrize(("radius", "border"), [(0.0, 0), (0.5, 1), (1.0, 1), (1.5, 2), (3.0, 3)])
def test_the_border_of_the_filter_is_cut_off_both(scene, radius, border):
    test = np.zeros(SHAPE)
    test[:, :, :border] = test[:, :border] = 1.0
    test[:, border, border] = 0.5
    gate = open_gate(test, np.zeros(SHAPE), scene=scene, filter_radius_px=radius)
    assert isinstance(gate, Signals)
    assert gate.error.shape == (1, 2, 12 - 2 * border, 10 - 2 * border)
    assert np.argwhere(gate.error).tolist() == [[0, 0, 0, 0], [0, 1, 0, 0]]
    assert (gate.seeds, gate.frames, gate.crop) == (1, 2, border)


def test_negative_pixels_are_kept_in_the_error(scene):
    assert measure("rmse", np.full(SHAPE, -0.5), np.zeros(SHAPE), scene=scene).value == pytest.approx(0.5)


@pytest.mark.parametrize("name", [n for n, m in METRICS.items() if {"edges", "rotors", "pans"} & set(m.needs)])
def test_a_metric_without_its_fact_is_not_applicable(scene, name):
    score = measure(name, np.zeros(SHAPE), np.zeros(SHAPE), scene=scene)
    (missing,) = {"edges", "rotors", "pans"} & set(METRICS[name].needs)
    assert (score.value, score.status, score.extras) == (None, "not_applicable", {"missing": missing})


@pytest.mark.parametrize("name", [n for n, m in METRICS.items() if "seeds" in m.needs])
@pytest.mark.parametrize("seeds", [(), (1,)])
def test_splits_over_seeds_need_seeds(scene, name, seeds):
    score = measure(name, np.zeros((*seeds, *SHAPE)), np.zeros(SHAPE), scene=scene)
    assert (score.value, score.status) == (None, "needs_seeds")


@pytest.mark.parametrize(
    "name", ["rmse", "psnr", "relmse", "max_error", "ssim", "flip", "shimmer", "buzz", "moire", "moire_peak"]
)
def test_no_score_stands_below_three_times_the_references_uncertainty(scene, name):
    rng = np.random.default_rng(1)
    reference = rng.uniform(size=SHAPE)
    test = reference + 0.01 * rng.normal(size=SHAPE)
    low = measure(name, test, reference, scene=scene, reference_uncertainty=0.05)
    assert (low.value, low.status) == (None, "below_reference_floor")
    fine = measure(name, test, reference, scene=scene, reference_uncertainty=1e-6)
    assert fine.status == "ok"
    assert fine.value is not None


def test_unknown_names_say_what_was_probably_meant(scene):
    with pytest.raises(InputError, match=r"unknown metric 'shimer'; did you mean 'shimmer'\? known: .*ssim"):
        measure("shimer", np.zeros(SHAPE), np.zeros(SHAPE), scene=scene)


def test_rms_does_not_overflow_or_underflow():
    assert rms(np.array([3e200, 4e200])) == pytest.approx(math.sqrt(12.5) * 1e200)
    assert rms(np.array([3e-200, 4e-200])) == pytest.approx(math.sqrt(12.5) * 1e-200)
    assert rms(np.zeros(3)) == 0.0


def test_finish_lets_nothing_infinite_through():
    score = finish(Score(math.inf, "ok", {"a": np.float64(math.nan), "b": [np.int64(2), np.array([1.0, math.inf])]}))
    assert score == Score(None, "overflow", {"a": None, "b": [2, [1.0, None]]})
    with pytest.raises(TypeError, match="extras cannot hold a object"):
        sanitize(object())
