"""The table for the terminal."""

import io
from typing import cast

import pytest
from rich.console import Console

from aliasbench.bench.export import Record, Run
from aliasbench.bench.table import failure_lines, record_table


def record(scene: str, technique: str, **changes: object) -> Record:
    base: Record = {
        "id": f"{scene}-{technique}",
        "scene": scene,
        "technique": technique,
        "size": [8, 8],
        "seed": 0,
        "seeds": [0],
        "frames": 1,
        "status": "ok",
        "error": None,
        "seconds": [0.010, 0.012, 0.011, 0.011, 0.011],
        "setup_seconds": 0.1,
        "samples": 64,
        "uncertainty": None,
        "uncertainty_kind": None,
        "images": {},
        "metrics": {"rmse": {"value": 0.0123456, "status": "ok", "extras": {}}},
    }
    return cast(Record, {**base, **changes})


@pytest.fixture
def run() -> Run:
    rate = {"apparent_rate": {"value": -3.7e-17, "status": "ok", "extras": {}}}
    failed = {"status": "failed", "error": "lamp [bold]broke", "seconds": [], "metrics": {}}
    records = [record("a", "x", metrics=rate), record("a", "y"), record("b", "x", **failed), record("b", "y", **failed)]
    return {"schema": 1, "suite": "s", "started": "", "machine": {}, "unfinished": 0, "records": records}


def printed(run: Run) -> str:
    stream = io.StringIO()
    Console(file=stream, width=200).print(record_table(run))
    return stream.getvalue()


def test_every_record_has_a_row_with_its_time_in_milliseconds(run: Run) -> None:
    text = printed(run)
    assert text.count("11 (10 to 12)") == 2
    assert "0.01235" in text
    assert text.count("failed") == 2
    assert "-3.7e-17" not in text


def test_only_metrics_that_some_record_has_get_a_column(run: Run) -> None:
    text = printed(run)
    assert "apparent_rate" in text
    assert "jaggies" not in text


def test_a_reason_is_given_once_with_all_its_cases_and_as_it_was_written(run: Run) -> None:
    assert failure_lines(run) == ["failed: lamp [bold]broke\n    b by x, b by y"]


def test_a_run_without_records_is_a_table_too(run: Run) -> None:
    assert "s: 0 cases" in printed({**run, "records": []})
