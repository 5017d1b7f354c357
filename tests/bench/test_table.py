"""The table for the terminal."""

import io
from typing import cast

import pytest
from rich.console import Console

from aliasbench.bench.export import Record, Run
from aliasbench.bench.table import failure_lines, record_tables


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


def printed(run: Run, width: int = 140) -> str:
    stream = io.StringIO()
    console = Console(file=stream, width=width)
    for table in record_tables(run, width):
        console.print(table)
    return stream.getvalue()


def test_every_record_has_a_row_with_its_time_in_milliseconds(run: Run) -> None:
    text = printed(run)
    assert text.count("10 to 12") == 2
    assert "0.01235" in text
    assert text.count("failed") == 2
    assert "-3.7e-17" not in text


def test_only_metrics_that_some_record_has_get_a_column(run: Run) -> None:
    text = printed(run)
    assert "rev/s" in text
    assert "jaggies" not in text


def test_a_reason_is_given_once_with_all_its_cases_and_as_it_was_written(run: Run) -> None:
    assert failure_lines(run) == ["failed: lamp [bold]broke\n    b by x, b by y"]


def test_a_run_without_records_has_no_tables(run: Run) -> None:
    assert printed({**run, "records": []}) == ""


def test_a_value_under_the_reference_s_floor_says_so(run: Run) -> None:
    hidden = {"rmse": {"value": None, "status": "below_reference_floor", "extras": {"floor": 0.0295}}}
    assert "< 0.029" in printed({**run, "records": [record("a", "x", metrics=hidden)]})


def test_in_a_narrow_terminal_no_word_is_cut_and_a_doubtful_time_is_marked(run: Run) -> None:
    noisy = record("a", "raytrace:spp=16,sampler=jittered", seconds=[0.01, 0.02, 0.03, 0.04, 0.05])
    text = printed({**run, "records": [noisy]}, 80)
    assert "~30" in text
    assert max(map(len, text.splitlines())) <= 80
