"""Errors in space and in time told apart: planted sequences of known errors, and rendered ones."""

import math

import numpy as np
import pytest

from aliasbench.metrics.catalog import measure, measure_all
from aliasbench.metrics.gate import Centers

NAMES = ("spatial", "temporal", "shutter")
SHAPE = (3, 9, 8)  # frames, h, w


@pytest.fixture
def planted(make_scene, rgb):
    """Scores of sequences (frames, h, w), or (seeds, frames, h, w), made of a reference and errors of known size."""
    rng = np.random.default_rng(1)
    own, instant, full = (rng.uniform(size=SHAPE) for _ in range(3))

    def run(error, center_error, *, contrast=1.0, crop=0.0, frames_of_full=SHAPE[0], own_uncertainty=0.0, **more):
        scene = make_scene(SHAPE[:0:-1], contrast=contrast)
        centers = Centers(
            rgb(contrast * (instant + center_error)),
            rgb(contrast * instant),
            rgb(contrast * full[:frames_of_full]),
            **more,
        )
        test, reference = rgb(contrast * (own + error)), rgb(contrast * own)
        scores = measure_all(
            NAMES,
            test,
            reference,
            scene=scene,
            filter_radius_px=crop,
            reference_uncertainty=own_uncertainty,
            centers=centers,
        )
        return scores, own - full

    return run


@pytest.mark.parametrize("contrast", [1.0, 0.3, 1e-200, 1e150])
@pytest.mark.parametrize(("error", "center_error"), [(0.3, 0.1), (0.1, 0.3), (0.0, 0.2), (0.2, 0.0)])
def test_spatial_is_the_error_at_the_middle_and_temporal_the_signed_rest(planted, contrast, error, center_error):
    signs = np.random.default_rng(2).choice([-1.0, 1.0], size=(2, *SHAPE))
    scores, off = planted(error * signs, center_error * signs[:, ::-1], contrast=contrast)
    # Differences of numbers up to 1.3 that are off by some ulp.
    assert scores["spatial"].value == pytest.approx(center_error, abs=1e-15)
    assert scores["temporal"].value == pytest.approx(error**2 - center_error**2, abs=1e-15)
    root = math.copysign(math.sqrt(abs(error**2 - center_error**2)), error - center_error)
    assert scores["temporal"].extras["root"] == pytest.approx(root, abs=1e-8)
    assert scores["shutter"].value == pytest.approx(math.sqrt(np.mean(off**2)), rel=1e-12)


def test_the_border_is_cut_off_all_five_sequences(planted):
    error, center_error = np.full(SHAPE, 0.25), np.full(SHAPE, 0.125)
    for wrong in (error, center_error):
        wrong[:, :2], wrong[:, -2:], wrong[..., :2], wrong[..., -2:] = 7.0, 7.0, 7.0, 7.0
    scores, off = planted(error, center_error, crop=1.5)
    assert scores["spatial"].value == pytest.approx(0.125, abs=1e-15)
    assert scores["temporal"].value == pytest.approx(0.0625 - 0.015625, abs=1e-15)
    assert scores["shutter"].value == pytest.approx(math.sqrt(np.mean(off[:, 2:-2, 2:-2] ** 2)), rel=1e-12)


def test_a_full_shutter_known_of_the_first_frames_is_compared_with_those(planted):
    scores, off = planted(np.zeros(SHAPE), np.zeros(SHAPE), frames_of_full=2)
    assert scores["shutter"].value == pytest.approx(math.sqrt(np.mean(off[:2] ** 2)), rel=1e-12)
    assert scores["shutter"].extras == {"frames": 2}


def test_a_closed_shutter_has_no_error_in_time_however_uncertain_its_reference(make_scene, rgb):
    rng = np.random.default_rng(3)
    reference = rgb(rng.uniform(size=SHAPE))
    scene = make_scene(SHAPE[:0:-1])
    for test in (reference + 0.2, rgb(rng.uniform(size=(2, *SHAPE)))):
        for given in (Centers(test, reference), Centers(test.copy(), reference.copy())):
            scores = measure_all(("rmse", *NAMES), test, reference, scene=scene, centers=given)
            assert scores["temporal"].value == 0.0
            assert scores["spatial"].value == pytest.approx(scores["rmse"].value, rel=1e-14)
            assert (scores["shutter"].status, scores["shutter"].extras) == (
                "not_applicable",
                {"missing": "full_shutter"},
            )
        hidden = measure_all(
            NAMES, test, reference, scene=scene, reference_uncertainty=1.0, centers=Centers(test, reference)
        )
        assert (hidden["temporal"].value, hidden["spatial"].status) == (0.0, "below_reference_floor")


BELOW = "below_reference_floor"


@pytest.mark.parametrize(
    ("uncertainty", "statuses"),
    [
        ({}, ["ok", "ok", "ok"]),
        # A third of .034 more than .1; (2 * .1 + .034) * .034 is less than a third of .2^2 - .1^2.
        ({"reference_uncertainty": 0.034}, [BELOW, "ok", "ok"]),
        # (2 * .2 + .03) * .03 is more than a third of .03.
        ({"own_uncertainty": 0.03}, ["ok", BELOW, "ok"]),
        # Differences of two uniform numbers: an RMS of .408.
        ({"full_shutter_uncertainty": 0.15}, ["ok", "ok", BELOW]),
        ({"full_shutter_uncertainty": 0.08, "own_uncertainty": 0.08}, ["ok", BELOW, BELOW]),
    ],
)
def test_scores_that_the_references_uncertainty_may_cause_are_not_printed(planted, uncertainty, statuses):
    scores, _ = planted(np.full(SHAPE, 0.2), np.full(SHAPE, 0.1), **uncertainty)
    assert [scores[name].status for name in NAMES] == statuses


def test_what_is_missing_or_broken_says_so(make_scene, rgb):
    rng = np.random.default_rng(4)
    test, reference, scene = rgb(rng.uniform(size=SHAPE)), rgb(rng.uniform(size=SHAPE)), make_scene(SHAPE[:0:-1])
    for name in NAMES:
        score = measure(name, test, reference, scene=scene)
        assert (score.value, score.status, score.extras) == (None, "not_applicable", {"missing": "centers"})
    broken = test.copy()
    broken[2, 5, 4, 1] = np.nan
    scores = measure_all(("rmse", *NAMES), test, reference, scene=scene, centers=Centers(broken, reference, reference))
    first = {"seed": 0, "frame": 2, "row": 5, "column": 4, "channel": 1}
    for name in NAMES:
        assert (scores[name].status, scores[name].extras) == ("nonfinite", {"count": 1, "first": first})
    assert scores["rmse"].status == "ok"
    for wrong, message in (
        (Centers(test[:2], reference), r"centers\.test: shape \(2, 9, 8, 3\); must be \(3, 9, 8, 3\)"),
        (Centers(test, reference[:, 1:]), r"centers\.reference: shape \(3, 8, 8, 3\); must be \(3, 9, 8, 3\)"),
        (Centers(test, reference, np.zeros((4, 9, 8, 3))), r"centers\.full_shutter: shape \(4, 9, 8, 3\)"),
        (Centers(test, reference, np.zeros((0, 9, 8, 3))), r"centers\.full_shutter: .* holds no pixels"),
        (Centers(test, broken), r"centers\.reference: 1 values are not finite"),
        (Centers(test, reference, broken), r"centers\.full_shutter: 1 values are not finite"),
        (Centers((test * 255).astype(np.uint8), reference), r"centers\.test: pixels of type uint8 have no known scale"),
        (Centers(test, reference, None, -1.0), r"centers\.reference_uncertainty -1\.0: must be finite and not"),
        (Centers(test, reference, None, 0.0, np.inf), r"centers\.full_shutter_uncertainty inf: must be finite"),
    ):
        with pytest.raises(ValueError, match=message):
            measure("rmse", test, reference, scene=scene, centers=wrong)
