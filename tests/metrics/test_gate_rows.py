"""The contract on bad input for every metric at once: each row, on a scene that has facts for all of them."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from planted import WINDOW_ROWS, Stage

from aliasbench.metrics.catalog import METRICS, measure, measure_all
from aliasbench.metrics.score import Score

STAGE = Stage(40, 6, 5, 1.0)
SEEDS = 8
WITH_VALUE = ("ok", "windowed", "deterministic")
# The size of the error, in the unit of the picture or of the edge's place: doubled by an error twice as large.
LINEAR = ("rmse", "max_error", "jaggies", "jaggies_rms", "jaggies_bias", "jaggies_str", "shimmer", "moire",
          "moire_peak", "strobing_err", "noise", "structure", "bias")  # fmt: skip


@pytest.fixture(scope="module")
def scene():
    return STAGE.scene()


@pytest.fixture(scope="module")
def pictures():
    """(seeds, frames, h, w, 3) and its reference, of quarters: every floating type holds them exactly."""
    rng = np.random.default_rng(1)
    reference = rng.integers(0, 5, size=(STAGE.frames, STAGE.side, STAGE.side, 3)) / 4
    return reference + rng.integers(-1, 2, size=(SEEDS, *reference.shape)) / 4, reference


@pytest.fixture(scope="module")
def plain(scene, pictures):
    return measure_all(METRICS, *pictures, scene=scene)


def assert_sound(scores: dict[str, Score]) -> None:
    """A finite number under a status that has one, or none and the reason; all of it JSON."""
    assert list(scores) == list(METRICS)
    for name, score in scores.items():
        json.dumps({"value": score.value, "extras": score.extras}, allow_nan=False)
        assert (score.value is not None) == (score.status in WITH_VALUE), (name, score)


def differing(scores: dict[str, Score], others: dict[str, Score]) -> dict[str, tuple[Score, Score]]:
    """The metrics whose scores are not the same, but for what the order of sums may change."""

    def same(a: Score, b: Score) -> bool:
        if a.value is None or b.value is None:
            return (a.value, a.status) == (b.value, b.status)
        return a.status == b.status and math.isclose(a.value, b.value, rel_tol=1e-9, abs_tol=1e-12)

    return {n: (scores[n], others[n]) for n in scores if not same(scores[n], others[n])}


def test_a_flat_picture_has_the_values_of_its_offset(scene):
    reference = np.full((STAGE.frames, STAGE.side, STAGE.side, 3), 0.25)
    got = measure_all(METRICS, np.stack([reference + 0.5] * 2), reference, scene=scene, filter_radius_px=0.0)
    assert_sound(got)
    expected = {
        "rmse": 0.5, "psnr": 20 * math.log10(2), "relmse": 0.25 / (0.0625 + 0.01), "max_error": 0.5, "jaggies": 0.0,
        "jaggies_rms": WINDOW_ROWS * 0.5, "jaggies_bias": WINDOW_ROWS * 0.5, "jaggies_str": 0.0, "shimmer": 0.0,
        "shimmer_abs": 0.0, "buzz": None, "flux_flicker": 0.0, "moire": 0.0, "moire_peak": 0.0, "gaps": 0.0,
        "apparent_rate": None, "noise": 0.0, "structure": 0.5, "bias": 0.5,
    }  # fmt: skip
    for name, value in expected.items():
        assert got[name].value == (None if value is None else pytest.approx(value, abs=1e-12)), name
    # The annulus' sum over pixels passes 1e-4 of a constant in pictures as small as this.
    for name in ("strobing", "strobing_err"):
        assert got[name].value == pytest.approx(0.0, abs=1e-4)
    # Means .25 and .75, no variance: 2 mu nu / (mu^2 + nu^2) with the definition's .01^2.
    assert got["ssim"].value == pytest.approx((2 * 0.1875 + 1e-4) / (0.625 + 1e-4), rel=1e-9)
    assert (got["buzz"].status, got["apparent_rate"].status) == ("undefined_no_shimmer", "undefined_no_modulation")
    assert got["bias"].status == "deterministic"


@pytest.mark.parametrize("name", METRICS)
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_one_bad_value_in_one_seed_is_no_score_and_is_found(scene, pictures, name, bad):
    test = pictures[0].copy()
    test[5, 3, 17, 20, 1] = bad
    score = measure(name, test, pictures[1], scene=scene)
    assert (score.value, score.status, score.extras["count"]) == (None, "nonfinite", 1)
    assert score.extras["first"] == {"seed": 5, "frame": 3, "row": 17, "column": 20, "channel": 1}


@pytest.mark.parametrize("gain", [1e160, 1e200, 1e300, -1e300])
def test_high_dynamic_range_is_measured_as_it_is(scene, pictures, gain):
    error = pictures[0] - pictures[1]
    black = np.zeros_like(pictures[1])
    usual, bright = (measure_all(METRICS, a, black, scene=scene) for a in (error, gain * error))
    assert_sound(bright)
    for name in LINEAR:
        odd = name in ("jaggies_bias", "bias")
        factor = gain if odd else abs(gain)
        assert usual[name].value is not None
        assert bright[name].value == pytest.approx(factor * usual[name].value, rel=1e-9), name
    assert bright["strobing"].status == "ok"  # a share, cut at 0 and 1
    assert bright["relmse"].status == "overflow"
    assert bright["psnr"].value == pytest.approx(usual["psnr"].value - 20 * math.log10(abs(gain)), rel=1e-9)
    assert bright["buzz"].value == pytest.approx(usual["buzz"].value, rel=1e-9)


def test_a_contrast_as_high_as_the_radiance_makes_it_usual(scene, pictures, plain):
    bright = measure_all(METRICS, *(1e200 * a for a in pictures), scene=replace(scene, contrast=1e200))
    assert not differing(plain, bright)


@pytest.mark.parametrize("size", [1, 2, 3, 4, 6, 7, 8])
def test_pictures_of_any_size_have_numbers_or_reasons(scene, size):
    rng = np.random.default_rng(2)
    test, reference = rng.uniform(size=(2, 2, size, size + 1, 3)), rng.uniform(size=(2, size, size + 1, 3))
    got = measure_all(METRICS, test, reference, scene=scene, filter_radius_px=0.0)
    assert_sound(got)
    assert got["ssim"].status == ("undefined_too_small" if size < 7 else "ok")
    assert got["rmse"].value > 0.0
    for name in ("strobing", "strobing_err", "apparent_rate"):
        assert got[name].value is None
    # A frequency of 1/4 cycle per pixel takes four of them, and the width is one more than the height.
    assert (got["moire"].status == "undefined_too_small") == (size <= 2)


def test_an_all_black_reference_divides_nothing(scene, pictures):
    black = np.zeros_like(pictures[1])
    against = measure_all(METRICS, pictures[0], black, scene=scene)
    assert_sound(against)
    luminance = pictures[0] @ np.array([0.2126, 0.7152, 0.0722])
    inside = luminance[:, :, 1:-1, 1:-1]
    assert against["relmse"].value == pytest.approx(float(np.mean(inside**2)) / 0.01, rel=1e-9)
    assert against["gaps"].value == 0.0
    itself = measure_all(METRICS, np.stack([black] * 2), black, scene=scene)
    assert_sound(itself)
    assert (itself["psnr"].value, itself["psnr"].status) == (None, "identical")
    assert (itself["flux_flicker"].value, itself["flux_flicker"].status) == (None, "undefined_zero_flux")
    for name in LINEAR:
        assert itself[name].value == 0.0
    assert itself["ssim"].value == pytest.approx(1.0)


def test_negative_pixels_count_as_what_they_are(scene, pictures, plain):
    """Lobes of a filter make them: nothing but display copies is clamped, and there they are counted."""
    got = measure_all(METRICS, *(-a for a in pictures), scene=scene)
    assert_sound(got)
    for name in LINEAR:
        sign = -1.0 if name in ("jaggies_bias", "bias") else 1.0
        assert got[name].value == pytest.approx(sign * plain[name].value, rel=1e-9), name
    lobes = pictures[0] - 0.25
    luminance = lobes[:, [0, 2, 5]] @ np.array([0.2126, 0.7152, 0.0722])
    score = measure("ssim", lobes, pictures[1], scene=scene, filter_radius_px=0.0)
    assert score.extras["negative_pixels"] == np.count_nonzero(luminance < 0.0) > 0


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.longdouble, ">f4", ">f8"])
def test_any_floating_type_scores_the_same(scene, pictures, plain, dtype):
    assert not differing(plain, measure_all(METRICS, *(a.astype(dtype) for a in pictures), scene=scene))
    mixed = measure_all(METRICS, pictures[0].astype(dtype), pictures[1], scene=scene)
    assert not differing(plain, mixed)


@pytest.mark.parametrize("layout", ["fortran", "strided", "reversed", "read-only", "lists"])
def test_any_layout_in_memory_scores_the_same_and_is_left_alone(scene, pictures, plain, layout):
    def laid_out(a):
        if layout == "fortran":
            return np.asfortranarray(a)
        if layout == "strided":
            wide = np.zeros((*a.shape[:-2], 2 * a.shape[-2], 5))
            wide[..., ::2, ::2] = a
            return wide[..., ::2, ::2]
        if layout == "reversed":
            return np.ascontiguousarray(a[..., ::-1, ::-1, :])[..., ::-1, ::-1, :]
        if layout == "read-only":
            a = a.copy()
            a.flags.writeable = False
            return a
        return a.tolist()

    given = [laid_out(a) for a in pictures]
    assert not differing(plain, measure_all(METRICS, *given, scene=scene))
    for before, after in zip(pictures, given, strict=True):
        assert np.array_equal(before, np.asarray(after))


def test_many_seeds_are_no_other_case_than_few(scene):
    seeds, side = 400, 12
    noise = np.random.default_rng(3).choice([-0.25, 0.25], size=(seeds, 2, side, side, 1)) * np.ones(3)
    got = measure_all(METRICS, noise, np.zeros((2, side, side, 3)), scene=scene)
    assert_sound(got)
    values = 2 * (side - 2) ** 2
    # Signs have no spread of their own: the mean's square, of 1 / seeds, is all that is spread.
    assert got["noise"].value == pytest.approx(0.25, rel=5 * math.sqrt(2 / values) / seeds)
    assert abs(got["bias"].value) < 5 * 0.25 / math.sqrt(seeds * values)
    # Products of pairs.
    spread = 0.25**2 * math.sqrt(2 / (seeds * (seeds - 1) * values))
    assert abs(got["structure"].extras["square"]) < 5 * spread


def test_one_frame_and_one_seed_have_what_can_be_said_of_them(scene, pictures):
    got = measure_all(METRICS, pictures[0][0, :1], pictures[1][:1], scene=scene)
    assert_sound(got)
    for name, metric in METRICS.items():
        if got[name].status == "not_applicable":
            continue
        if "frames" in metric.needs:
            assert got[name].status == "undefined_one_frame", name
        elif "seeds" in metric.needs:
            assert got[name].status == "needs_seeds", name
