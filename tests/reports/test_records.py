"""Laws of reading runs: every record is kept, odd values become dashes, labels tell runs apart."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from aliasbench.reports.records import Record, load_runs, unique_labels
from aliasbench.scenes.errors import InputError

MakeRecord = Callable[..., dict[str, Any]]
Fabricate = Callable[..., Path]


def load_one(fabricate: Fabricate, record: dict[str, Any]) -> Record:
    (run,) = load_runs([fabricate([record])])
    (loaded,) = run.records
    return loaded


def test_no_run_directory_is_refused() -> None:
    with pytest.raises(InputError, match="at least one run directory"):
        load_runs([])


def test_labels_are_unique_and_as_short_as_that_allows() -> None:
    assert unique_labels([Path("/a/quick"), Path("/b/full")]) == ["quick", "full"]
    assert unique_labels([Path("/a/quick"), Path("/b/quick")]) == ["a/quick", "b/quick"]
    assert unique_labels([Path("/a/quick"), Path("/a/quick")]) == ["quick (1)", "quick (2)"]


def test_a_record_keeps_its_figures(fabricate: Fabricate, make_record: MakeRecord, make_score: MakeRecord) -> None:
    record = load_one(fabricate, make_record("disc", "raster:msaa=4", metrics={"rmse": make_score(0.25, columns=3)}))
    assert (record.scene, record.technique, record.size) == ("disc", "raster:msaa=4", (64, 64))
    assert record.timing is not None
    assert record.timing.median_s == 0.0101
    assert record.timing.low_s <= 0.0101 <= record.timing.high_s
    assert record.value("rmse") == 0.25
    assert record.metrics["rmse"].extras == {"columns": 3}


def test_a_bare_record_is_still_a_record(fabricate: Fabricate) -> None:
    record = load_one(fabricate, {"scene": "disc", "technique": "raster:", "status": "failed", "size": [8, 4]})
    assert record.timing is None
    assert record.samples is None
    assert record.value("rmse") is None
    assert record.error == ""


@pytest.mark.parametrize("value", [float("nan"), float("inf"), None, "0.5"])
def test_what_is_not_a_finite_number_has_no_value(
    fabricate: Fabricate, make_record: MakeRecord, make_score: MakeRecord, value: Any
) -> None:
    record = load_one(fabricate, make_record("disc", "raster:", metrics={"rmse": make_score(value)}))
    assert record.value("rmse") is None


def test_nested_machine_facts_become_one_list(fabricate: Fabricate) -> None:
    (run,) = load_runs([fabricate([], machine={"cpu": "x", "packages": {"numpy": "2"}, "gl_samples": [1, 4]})])
    assert dict(run.machine) == {"cpu": "x", "packages numpy": "2", "gl samples": "1, 4"}


@pytest.mark.parametrize(
    ("technique", "renderer", "short"),
    [
        ("raytrace:", "raytrace", "1 sample"),
        ("raytrace-jittered-16", "raytrace", "16 spp jittered"),
        ("raster:msaa=4", "raster", "4× MSAA"),
        ("raster:ssaa=3,texture=trilinear", "raster", "3×3 SSAA trilinear"),
        ("raster:passes=16,sampler=jittered", "raster", "16 passes jittered"),
        ("raytrace:time=center", "raytrace", "1 sample time center"),
        ("raytrace:adaptive=pooled,tolerance=.1", "raytrace", "adaptive pooled tolerance .1"),
    ],
)
def test_short_labels_read_like_speech(
    fabricate: Fabricate, make_record: MakeRecord, technique: str, renderer: str, short: str
) -> None:
    record = load_one(fabricate, make_record("disc", technique))
    assert (record.renderer, record.short) == (renderer, short)
