"""The table for the terminal."""

import io
from typing import cast

import pytest
from rich.console import Console

from aliasbench.bench.export import Record, Run
from aliasbench.bench.table import failure_lines, legend_lines, record_tables, total_line


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


def test_how_the_error_divides_into_space_and_time_stands_where_scenes_move_and_there_is_room(run: Run) -> None:
    moves = {
        "spatial": {"value": 0.0312, "status": "ok", "extras": {}},
        "temporal": {"value": -0.00456, "status": "ok", "extras": {}},
    }
    still = {name: {"value": None, "status": "not_applicable", "extras": {}} for name in moves}
    for metrics, width, shown in ((moves, 140, True), (moves, 110, False), (still, 140, False)):
        text = printed({**run, "records": [record("a", "x", metrics=metrics)]}, width)
        for word in ("spatial", "0.0312", "temporal", "-0.00456"):
            assert (word in text) == shown


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


def test_the_marks_of_the_tables_are_explained_where_they_occur(run: Run) -> None:
    hidden = {"rmse": {"value": None, "status": "below_reference_floor", "extras": {"floor": 0.0295}}}
    noisy, floored = record("a", "x", seconds=[0.01, 0.02, 0.03, 0.04, 0.05]), record("a", "y", metrics=hidden)

    def legend(*records: Record, width: int = 80) -> list[str]:
        return legend_lines({**run, "records": list(records)}, width)

    assert legend(record("a", "x")) == []
    assert legend(noisy) == ["~: doubtful time, see the report"]
    assert legend(noisy, width=140) == []
    both = legend(noisy, floored)
    assert both == ["~: doubtful time, see the report; < x: below what the reference can tell"]
    assert legend(floored, width=140) == ["< x: below what the reference can tell"]


@pytest.mark.parametrize(
    ("hidden_count", "uncertainty", "said"), [(3, 0.0098, True), (2, 0.0098, False), (3, 1e-12, 0)]
)
def test_a_reference_that_hides_most_scores_is_named_with_its_uncertainty(
    run: Run, hidden_count: int, uncertainty: float, said: bool
) -> None:
    hidden = {"value": None, "status": "below_reference_floor", "extras": {"floor": 0.03}}
    known = {"value": 0.5, "status": "ok", "extras": {}}
    metrics = {str(i): hidden if i < hidden_count else known for i in range(5)}
    lines = legend_lines({**run, "records": [record("a", "x", metrics=metrics, uncertainty=uncertainty)]}, 140)
    sentence = "a 8 x 8: its reference is certified to 0.0098, which hides 3 of 5 scores"
    assert (sentence in lines) == bool(said)
    assert len(lines) == 1 + bool(said)


def test_the_last_line_tells_how_many_of_the_good_ones_are_limits(run: Run) -> None:
    assert total_line(run) == "2 ok, 2 failed, 0 unsupported"
    verdicts = [{"hard_case": {"value": 1e-6, "status": status, "extras": {}}} for status in ("ok", "limit", "limit")]
    run["records"] = [record("c", str(k), metrics=metrics) for k, metrics in enumerate(verdicts)]
    assert total_line(run) == "3 ok (2 of them known limits), 0 failed, 0 unsupported"
