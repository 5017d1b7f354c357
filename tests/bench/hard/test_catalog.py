"""What holds of every hard case, whatever it asks."""

import re

import pytest

from aliasbench.bench.hard.case import ALL, METRICS, Verdict, samples_key, verdict_outcome, with_keys
from aliasbench.bench.hard.catalog import _GROUPS, HARD_CASES

GROUPS = ("edges", "shapes", "scale", "motion", "values", "sizes")


def test_names_are_unique():
    assert len(HARD_CASES) == sum(len(group) for group in _GROUPS)


@pytest.mark.parametrize("name", HARD_CASES)
def test_a_case_says_what_it_asks_and_what_must_hold(name):
    case = HARD_CASES[name]
    assert case.name == name
    assert re.fullmatch(r"[a-z0-9-]+", name)
    assert case.group in GROUPS
    for text in (case.question, case.criterion):
        assert re.fullmatch(r"[A-Z0-9].*[.?]", text), text
    assert case.subjects
    assert len(set(case.subjects)) == len(case.subjects)
    assert set(case.subjects) <= set(ALL) or case.subjects == (METRICS,)


@pytest.mark.parametrize(
    ("measured", "rounding", "bound", "error", "outcome"),
    [
        (0.0, 0.0, 0.0, None, "ok"),
        (1e-3, 1e-3, 2e-3, None, "ok"),
        (1.5e-3, 1e-3, 2e-3, 1e-3, "limit"),
        (2.1e-3, 1e-3, 2e-3, None, "failed"),
        (0.0, 0.0, 1.0, 2e-3, "failed"),  # known too badly
        (0.0, 0.0, 1.0, float("nan"), "failed"),
        (float("nan"), 1.0, 1.0, None, "failed"),
        (float("inf"), 1.0, float("inf"), None, "failed"),
        (1.5, 1.0, float("inf"), None, "failed"),  # a limit without an end is none
        (0.0, 0.0, 1.0, -1e-4, "failed"),
        (-1.0, 0.0, 1.0, None, "failed"),
        (0.5, 1.0, 0.9, None, "failed"),  # bounds the wrong way round
    ],
)
def test_a_verdict_follows_from_its_figures(measured, rounding, bound, error, outcome):
    verdict = Verdict(measured, "px", rounding, bound, "why", error)
    assert verdict.outcome == outcome
    stored = verdict_outcome(next(iter(HARD_CASES.values())), verdict)
    assert stored["status"] == ("failed" if outcome == "failed" else "ok")
    assert (stored["error"] is None) == (outcome != "failed")


def test_keys_join_a_subject_s_text():
    assert with_keys("raytrace:", "spp=4") == "raytrace:spp=4"
    assert with_keys("raytrace:robust=off", "") == "raytrace:robust=off"
    assert samples_key("raster:backend=egl", 4, "sampler=grid") == "raster:backend=egl,passes=4,sampler=grid"
    assert samples_key("raytrace:robust=off", 2) == "raytrace:robust=off,spp=2"
