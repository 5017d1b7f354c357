"""ColorVideoVDP: what it is given, with a stand-in for the package; and with the extra, how its figures behave."""

import contextlib
import importlib.util
import sys
import types
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from aliasbench.metrics.catalog import METRICS, OPTIONAL, measure, measure_all
from aliasbench.metrics.gate import Signals, open_gate
from aliasbench.metrics.perceptual import Display
from aliasbench.metrics.video_quality import MOST_FRAMES, _load, _predict, compute_cvvdp
from aliasbench.scenes.model import Animation

SIDE = 32


@pytest.fixture
def scene(make_scene):
    return make_scene((SIDE, SIDE), animation=Animation(24.0, 8, 0.0))


@pytest.fixture
def installed() -> None:
    if importlib.util.find_spec("pycvvdp") is None:
        pytest.skip("needs the extra: pip install 'aliasbench[perceptual]'")


@pytest.fixture
def stand_in(monkeypatch) -> dict[str, Any]:
    """A package that keeps what it is given and finds every video's quality to be 7.5."""
    seen: dict[str, Any] = {"threads": [6]}

    class Model:
        def __init__(self, **options):
            seen["model"] = options

        def predict(self, test, reference, **options):
            seen.update(test=test, reference=reference, predict=options, threads_within=seen["threads"][-1])
            return np.float32(7.5), {}

    cvvdp = types.ModuleType("pycvvdp")
    cvvdp.vvdp_display_photo_eotf = lambda peak, **options: {"peak": peak, **options}
    cvvdp.vvdp_display_geometry = lambda size, **options: {"size": size, **options}
    cvvdp.cvvdp = Model
    torch = types.ModuleType("torch")
    torch.get_num_threads = lambda: seen["threads"][-1]
    torch.set_num_threads = seen["threads"].append
    torch.inference_mode = contextlib.nullcontext
    torch.device = lambda name: f"device {name}"
    monkeypatch.setitem(sys.modules, "pycvvdp", cvvdp)
    monkeypatch.setitem(sys.modules, "torch", torch)
    monkeypatch.setattr(sys, "path", list(sys.path))
    return seen


def test_it_is_measured_only_where_it_is_named(scene):
    assert "cvvdp" in OPTIONAL
    assert not set(OPTIONAL) & set(METRICS)
    picture = np.zeros((1, SIDE, SIDE, 3))
    assert "cvvdp" not in measure_all(METRICS, picture, picture, scene=scene)


def test_without_the_extra_the_score_says_how_to_install_it(scene, monkeypatch):
    monkeypatch.setitem(sys.modules, "pycvvdp", None)
    picture = np.zeros((2, SIDE, SIDE, 3))
    score = measure("cvvdp", picture, picture, scene=scene)
    assert (score.value, score.status) == (None, "not_installed")
    assert score.extras["install"] == 'pip install "aliasbench[perceptual]"'


def test_the_display_is_the_declared_one_and_the_process_is_left_as_it_was(scene, stand_in):
    picture = np.full((3, SIDE, SIDE, 3), 0.25)
    test = picture.copy()
    test[1:] += 0.125
    path = list(sys.path)
    signals = open_gate(test, picture, scene=scene, frame_start=5)
    assert isinstance(signals, Signals)
    display = Display(pixels_per_degree=40.0, peak_cd_m2=300.0, contrast=500.0, ambient_lux=10.0, reflectivity=0.01)
    score = compute_cvvdp(signals, display=display)
    assert (score.value, score.status) == (7.5, "ok")
    assert stand_in["model"]["display_photometry"] == {
        "peak": 300.0, "contrast": 500.0, "source_colorspace": "BT.709", "EOTF": "1", "E_ambient": 10.0, "k_refl": 0.01,
    }  # fmt: skip
    assert stand_in["model"]["display_geometry"] == {"size": (SIDE - 2, SIDE - 2), "ppd": 40.0}
    assert stand_in["model"]["device"] == "device cpu"
    assert stand_in["predict"] == {"dim_order": "FHWC", "frames_per_second": 24.0}
    assert stand_in["test"].dtype == stand_in["reference"].dtype == np.float32
    assert (stand_in["test"] == np.float32(test[:, 1:-1, 1:-1])).all()
    assert (stand_in["reference"] == 0.25).all()
    assert (stand_in["threads_within"], stand_in["threads"][-1]) == (1, 6)
    assert sys.path == path
    printed = {"pixels_per_degree": 40.0, "peak_cd_m2": 300.0, "display_contrast": 500.0, "ambient_lux": 10.0}
    assert printed.items() <= dict(score.extras).items()
    assert (score.extras["frames"], score.extras["video"], score.extras["fps"]) == ([5, 7], True, 24.0)


def test_the_first_seed_and_frames_are_shown_and_a_still_is_no_video(scene, stand_in):
    frames = MOST_FRAMES + 7
    truth = np.arange(frames)[:, None, None, None] / frames * np.ones((SIDE, SIDE, 3))
    score = measure("cvvdp", np.stack([truth, 1 - truth]), truth, scene=scene)
    assert score.extras["frames"] == [0, MOST_FRAMES - 1]
    assert stand_in["test"].shape == (MOST_FRAMES, SIDE - 2, SIDE - 2, 3)
    assert (stand_in["test"] == stand_in["reference"]).all()
    still = measure("cvvdp", truth[:1], truth[:1], scene=scene)
    assert (still.extras["video"], stand_in["predict"]["frames_per_second"]) == (False, 0)


@pytest.mark.parametrize("contrast", [1.0, 0.02])
def test_pixels_beyond_the_display_are_clamped_and_counted(make_scene, stand_in, contrast):
    scene = make_scene((SIDE, SIDE), contrast=contrast)
    truth = np.full((2, SIDE, SIDE, 3), 0.5)
    test = truth.copy()
    test[0, 9, 9, 1] = -0.25
    test[1, 9:11, 9] = 3.0
    score = measure("cvvdp", contrast * test, contrast * truth, scene=scene)
    assert (score.extras["negative_pixels"], score.extras["pixels_above_white"]) == (1, 2)
    assert score.extras["white"] == pytest.approx(contrast)
    assert (stand_in["test"].min(), stand_in["test"].max()) == (0.0, 1.0)
    assert stand_in["reference"] == pytest.approx(0.5)
    # Brighter than lobes of a filter can make it, the reference's brightest pixel is white.
    score = measure("cvvdp", 8 * contrast * truth, 8 * contrast * truth, scene=scene)
    assert score.extras["white"] == pytest.approx(4 * contrast)
    assert stand_in["reference"] == pytest.approx(1.0)


def test_pictures_that_are_too_small_or_too_near_to_an_unsure_truth_have_no_score(make_scene, stand_in):
    small = np.zeros((2, 9, 30, 3))
    assert measure("cvvdp", small, small, scene=make_scene((30, 9))).status == "undefined_too_small"
    truth = np.full((2, SIDE, SIDE, 3), 0.5)
    score = measure("cvvdp", truth + 0.01, truth, scene=make_scene((SIDE, SIDE)), reference_uncertainty=0.01)
    assert (score.value, score.status) == (None, "below_reference_floor")
    assert "predict" not in stand_in


def sequence(frames: int = 8) -> np.ndarray:
    y, x = np.mgrid[:SIDE, :SIDE] / SIDE
    loop = [np.stack([0.5 + 0.4 * np.sin(9 * x + y + 0.2 * t), y, 0.4 + 0.3 * x], axis=-1) for t in range(frames)]
    return np.array(loop)


@pytest.mark.usefixtures("installed")
def test_equal_videos_are_worth_ten_and_less_with_noise_every_time_alike(scene):
    truth = sequence()
    noise = np.random.default_rng(0).normal(size=truth.shape)
    scores = [measure("cvvdp", truth + s * noise, truth, scene=scene) for s in (0.0, 0.02, 0.05, 0.15)]
    values = [float(s.value or 0) for s in scores]
    print("JOD with noise of 0, 0.02, 0.05, 0.15:", values)
    assert {s.status for s in scores} == {"ok"}
    assert values[0] == 10.0
    assert all(a > b + 0.05 for a, b in pairwise(values))
    assert measure("cvvdp", truth + 0.05 * noise, truth, scene=scene) == scores[2]
    seen = measure("cvvdp", 30 * (truth + 0.05 * noise), 30 * truth, scene=replace(scene, contrast=30.0))
    # Products are off by an ulp of float64, which may change the last bit of a few float32: 1e-6 of ten units of it.
    assert seen.value == pytest.approx(values[2], abs=1e-5)


@pytest.mark.usefixtures("installed")
def test_flicker_is_seen(scene):
    truth = np.full((16, SIDE, SIDE, 3), 0.5)
    sign = np.array([1.0, 1.0, -1.0, -1.0] * 4)[:, None, None, None]  # 6 Hz
    values = [float(measure("cvvdp", truth + a * sign, truth, scene=scene).value or 0) for a in (0.0, 0.01, 0.03)]
    print("JOD of a picture that flickers by 0, 0.01, 0.03 at 6 Hz:", values)
    assert values[0] == 10.0
    assert all(a > b + 0.5 for a, b in pairwise(values))


@pytest.mark.usefixtures("installed")
def test_what_it_is_blind_to_it_still_is(scene):
    """White for black is worth ten to the package: the day it is not, the status for it has no reason any more."""
    black, white = np.zeros((2, SIDE, SIDE, 3), np.float32), np.ones((2, SIDE, SIDE, 3), np.float32)
    assert _predict(*_load(), white, black, fps=30.0, display=Display()) == 10.0
    nearly = np.ones_like(white)
    nearly[:, 10:20, 10:20] = 0.8
    score = measure("cvvdp", nearly, black, scene=scene)
    assert score.status == "ok"
    assert 9.0 < float(score.value or 0) < 10.0
    assert score.extras["mean_error"] == pytest.approx([1 - 0.2 * 100 / (SIDE - 2) ** 2] * 3, abs=1e-6)


@pytest.mark.parametrize(("test", "truth"), [(0.0, 1.0), (1.0, 0.0), (0.5, 0.52), (0.0, 5.0), (1e30, 0.0)])
def test_one_level_for_another_has_no_score_but_its_mean_error(scene, stand_in, test, truth):
    white = np.ones((2, SIDE, SIDE, 3))
    score = measure("cvvdp", test * white, truth * white, scene=scene)
    assert (score.value, score.status) == (None, "undefined_uniform_error")
    shown = [min(v / max(truth, 1.0), 1.0) for v in (test, truth)]
    assert score.extras["mean_error"] == pytest.approx([shown[0] - shown[1]] * 3, abs=1e-6)
    assert "predict" not in stand_in
    assert measure("cvvdp", truth * white, truth * white, scene=scene).status == "ok"
    assert "predict" in stand_in
