"""Laws that hold for every entry of the catalog."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from aliasbench.metrics import catalog
from aliasbench.metrics.catalog import METRICS
from aliasbench.metrics.gate import Centers
from aliasbench.scenes.model import Animation, Facts, GratingFact, PanFact, RotorFact, Scene

SIDE, FRAMES, SEEDS = 64, 4, 8
# The names that the documentation promises.
DOCUMENTED = [
    "rmse",
    "psnr",
    "relmse",
    "max_error",
    "ssim",
    "flip",
    "jaggies",
    "jaggies_rms",
    "jaggies_bias",
    "jaggies_str",
    "shimmer",
    "shimmer_abs",
    "buzz",
    "flux_flicker",
    "moire",
    "moire_peak",
    "gaps",
    "strobing",
    "strobing_err",
    "apparent_rate",
    "apparent_velocity",
    "noise",
    "structure",
    "bias",
    "spatial",
    "temporal",
    "shutter",
    "mtf50",
    "edge_width",
]
# Whose value for a perfect picture is a reason, not a number.
PERFECT_STATUS = {"psnr": "identical", "buzz": "undefined_no_shimmer"}


def measure_all(names, test, reference, **options):
    """Scores of a sequence whose further sequences, at the shutter's middle, are copies of it."""
    centers = Centers(test.copy(), reference.copy(), reference.copy())
    return catalog.measure_all(names, test, reference, centers=centers, **options)


def measure(name, test, reference, **options):
    return measure_all((name,), test, reference, **options)[name]


@pytest.fixture(scope="module")
def full_scene(make_scene, edge_fact) -> Scene:
    """A scene with every fact; the pan repeats after the sequence's four frames of half a pixel each."""
    facts = Facts(
        edges=(edge_fact((SIDE, SIDE), (-9.0, 20.3), (80.0, 26.9)),),
        rotors=(RotorFact((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 3, 0.5, 7.0, 8.0, 28.0),),
        gratings=(GratingFact((0.3, 0.1)),),
        pans=(PanFact((15.0, 0.0, 0.0), FRAMES / 30.0),),
    )
    return make_scene((SIDE, SIDE), facts=facts, animation=Animation(30.0, FRAMES, 0.0))


@pytest.fixture(scope="module")
def pictures():
    """(seeds, frames, h, w, 3) and its reference, as rough as pictures get within [0, 1] about the scene's edge."""
    rng = np.random.default_rng(0)
    above = 20.3 + 6.6 / 89 * (np.arange(SIDE) + 9.5) - (np.arange(SIDE)[:, None] + 0.5)
    reference = 0.6 * np.clip(above + 0.5, 0.0, 1.0)[..., None] + 0.4 * rng.uniform(size=(FRAMES, SIDE, SIDE, 3))
    return np.clip(reference + 0.1 * rng.normal(size=(SEEDS, *reference.shape)), 0.0, 1.0), reference


def test_every_documented_name_is_measured():
    assert sorted(METRICS) == sorted(DOCUMENTED)


@pytest.mark.parametrize("name", METRICS)
def test_an_entry_describes_itself(name):
    metric = METRICS[name]
    assert metric.name == name
    assert metric.label
    assert metric.unit
    assert metric.source
    assert metric.better in ("lower", "higher", "zero", "truth")
    assert metric.compute.__doc__


@pytest.mark.parametrize("name", METRICS)
def test_every_metric_has_a_value_where_it_applies(full_scene, pictures, name):
    score = measure(name, *pictures, scene=full_scene)
    assert score.status == "ok"
    assert score.value is not None
    assert math.isfinite(score.value)


@pytest.mark.parametrize("name", [n for n, m in METRICS.items() if "reference" in m.needs])
def test_a_perfect_picture_is_perfect(full_scene, pictures, name):
    reference = pictures[1]
    score = measure(name, np.stack([reference] * 2), reference, scene=full_scene)
    if name in PERFECT_STATUS:
        assert (score.value, score.status) == (None, PERFECT_STATUS[name])
    else:
        assert score.value == pytest.approx(1.0 if name == "ssim" else 0.0, abs=1e-12)
        assert score.status == ("deterministic" if name == "bias" else "ok")


@pytest.mark.parametrize("name", [n for n, m in METRICS.items() if "frames" in m.needs])
def test_one_frame_has_no_figures_in_time(full_scene, pictures, name):
    test, reference = pictures
    score = measure(name, test[:, :1], reference[:1], scene=full_scene)
    assert (score.value, score.status) == (None, "undefined_one_frame")


@pytest.mark.parametrize("name", METRICS)
def test_exposure_changes_no_score(full_scene, pictures, name):
    test, reference = pictures
    plain = measure(name, test, reference, scene=full_scene)
    brighter = measure(name, 37.5 * test, 37.5 * reference, scene=replace(full_scene, contrast=37.5))
    assert brighter.value == pytest.approx(plain.value, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("name", [n for n in METRICS if n not in ("relmse", "ssim", "flip", "flux_flicker")])
def test_a_constant_added_to_both_changes_no_score(full_scene, pictures, name):
    test, reference = pictures
    plain = measure(name, test, reference, scene=full_scene)
    lifted = measure(name, test + 5.0, reference + 5.0, scene=full_scene)
    # The annulus's sum over the pixel lattice passes a constant by some 1e-6 at this size, of orders of some 1e-3.
    loose = name in ("strobing", "apparent_rate")
    assert lifted.value == pytest.approx(plain.value, rel=2e-2 if loose else 1e-9, abs=1e-11)


@pytest.mark.parametrize("name", [n for n, m in METRICS.items() if "seeds" not in m.needs])
def test_one_seed_is_a_sequence_without_seeds(full_scene, pictures, name):
    test, reference = pictures
    assert measure(name, test[:1], reference, scene=full_scene) == measure(name, test[0], reference, scene=full_scene)


def test_measuring_together_is_measuring_one_by_one(full_scene, pictures):
    together = measure_all(METRICS, *pictures, scene=full_scene)
    assert list(together) == list(METRICS)
    for name, score in together.items():
        assert score == measure(name, *pictures, scene=full_scene)


def nasty_pictures():
    rng = np.random.default_rng(1)
    shape = (2, 3, SIDE, SIDE, 3)
    yield "black", np.zeros(shape)
    yield "negative", -np.ones(shape)
    yield "huge", rng.choice([-1e308, 1e308], shape)
    yield "tiny", np.full(shape, 5e-324)
    yield "one hot pixel", np.eye(SIDE)[None, None, :, :, None] * 1e160 * np.ones(shape)
    yield "half precision", rng.uniform(size=shape).astype(np.float16)


@pytest.mark.parametrize(("kind", "test"), list(nasty_pictures()))
@pytest.mark.parametrize("contrast", [1.0, 1e-300, 1e300])
def test_whatever_comes_in_nothing_but_numbers_and_reasons_comes_out(full_scene, kind, test, contrast):
    reference = np.zeros(test.shape[1:])
    scene = replace(full_scene, contrast=contrast)
    for name, score in measure_all(METRICS, test, reference, scene=scene).items():
        text = json.dumps({"value": score.value, "status": score.status, "extras": score.extras}, allow_nan=False)
        assert json.loads(text)["value"] == score.value
        assert (score.value is None) == (score.status not in ("ok", "windowed", "deterministic")), (kind, name, score)
