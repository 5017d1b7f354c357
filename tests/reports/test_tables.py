"""Laws of the tables: what has no value says why, what failed says so, the best is marked."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from aliasbench.metrics.catalog import METRICS
from aliasbench.metrics.guide import GUIDE
from aliasbench.reports import tables
from aliasbench.reports.records import Record, load_runs

MakeRecord = Callable[..., dict[str, Any]]
Fabricate = Callable[..., Path]


def read(fabricate: Fabricate, rows: list[dict[str, Any]]) -> tuple[Record, ...]:
    (run,) = load_runs([fabricate(rows)])
    return run.records


def column(table: tables.Table, text: str) -> list[tables.Cell]:
    (index,) = [i for i, h in enumerate(table.headings) if h.text.startswith(text)]
    return [row[index] for row in table.rows]


def test_what_is_not_applicable_is_a_dash_that_says_so(typical: Path) -> None:
    (run,) = load_runs([typical])
    cells = column(tables.scene_table(run.records, ["run"]), METRICS["strobing"].label)
    assert (cells[0].text, cells[0].title) == ("–", "not applicable")
    assert (cells[4].text, cells[4].title) == ("–", "not measured")


def test_how_the_error_divides_into_space_and_time_stands_where_the_scene_moves(
    fabricate: Fabricate, make_record: MakeRecord, make_score: MakeRecord
) -> None:
    moves = {"spatial": make_score(0.03), "temporal": make_score(-0.004, root=-0.0632)}
    still = {name: make_score(None, "not_applicable") for name in moves}
    rows = [make_record(scene, "raytrace:", metrics=m) for scene, m in (("turns", moves), ("stands", still))]
    turns, stands = read(fabricate, rows)
    table = tables.scene_table([turns], ["run"])
    (cell,) = column(table, METRICS["temporal"].label)
    assert (cell.text, cell.title) == ("-0.00400", "root -0.0632")
    assert column(table, METRICS["spatial"].label)[0].text == "0.0300"
    headings = [h.text for h in tables.scene_table([stands], ["run"]).headings]
    assert not any(h.startswith(METRICS[name].label) for h in headings for name in moves)


def test_headings_come_from_the_registry(typical: Path) -> None:
    (run,) = load_runs([typical])
    table = tables.scene_table(run.records, ["run"])
    (heading,) = [h for h in table.headings if h.title.startswith("jaggies,")]
    assert (heading.text, heading.unit) == (f"{METRICS['jaggies'].label} ↓", "px")
    assert "lower is better" in heading.title
    assert f"{GUIDE['jaggies'].meaning[1:]} Source: {METRICS['jaggies'].source}" in heading.title


def test_the_best_of_each_column_is_marked_whichever_way_better_is(
    fabricate: Fabricate, make_record: MakeRecord, make_score: MakeRecord
) -> None:
    rows = [
        make_record("s", f"raster:msaa={n}", metrics={"rmse": make_score(1 / n), "ssim": make_score(1 - 1 / n)})
        for n in (2, 4, 8)
    ]
    table = tables.scene_table(read(fabricate, rows), ["run"])
    for name in ("rmse", "ssim"):
        assert [c.style for c in column(table, METRICS[name].label)] == ["", "", "best"]


def test_every_record_and_every_metric_is_in_the_table_of_all(
    fabricate: Fabricate, make_record: MakeRecord, make_score: MakeRecord
) -> None:
    metrics = {name: make_score(0.5) for name in METRICS} | {"made_up": make_score(2.0)}
    rows = [make_record("s", "raster:", metrics=metrics), make_record("t", "raytrace:", metrics={})]
    table = tables.record_table(read(fabricate, rows), ["run"])
    assert [row[0].text for row in table.rows] == ["s", "t"]
    for name in METRICS:
        (heading,) = [i for i, h in enumerate(table.headings) if h.title.split(",")[0].split(";")[0] == name]
        assert [row[heading].text for row in table.rows] == ["0.500", "–"]
    assert [c.text for c in column(table, "made_up")] == ["2.00", "–"]
    assert all(len(row) == len(table.headings) for row in table.rows)


def test_failures_and_doubtful_times_are_said_in_words(fabricate: Fabricate, make_record: MakeRecord) -> None:
    rows = [
        make_record("s", "raster:msaa=64", status="failed", error="no such count", seconds=[]),
        make_record("s", "raster:", seconds=[1e-4, 2e-4, 3e-4, 4e-4, 5e-4]),
        make_record("s", "raytrace:"),
    ]
    table = tables.record_table(read(fabricate, rows), ["run"])
    failed, doubtful, fine = (c.text for c in column(table, "notes"))
    assert failed == "no such count"
    assert "spread 67% (over 10%)" in doubtful
    assert "under 1 ms" in doubtful
    assert fine == ""
    assert [c.text for c in column(table, "status")] == ["failed", "ok", "ok"]
    assert [c.style for c in column(table, "time")] == ["absent", "doubtful", ""]


def test_the_run_is_a_column_only_where_there_are_several(typical: Path) -> None:
    (run,) = load_runs([typical])
    assert "run" not in [h.text for h in tables.record_table(run.records, ["run"]).headings]
    assert [c.text for c in column(tables.record_table(run.records, ["run", "x"]), "run")] == ["run"] * 6


def test_the_overview_has_each_technique_once_and_darkens_with_the_error(
    fabricate: Fabricate, make_record: MakeRecord, make_score: MakeRecord
) -> None:
    rows = [
        make_record(scene, technique, metrics={"rmse": make_score(rmse)})
        for scene, technique, rmse in [("a", "raster:", 0.3), ("a", "raytrace:", 0.01), ("b", "raster:", 1e-5)]
    ]
    rows.append(make_record("b", "raytrace:", status="unsupported", error="no lens", seconds=[], metrics={}))
    rows.append(
        make_record("a", "raster:msaa=4", metrics={"rmse": make_score(None, "below_reference_floor", floor=0.02)})
    )
    table = tables.overview_table(read(fabricate, rows))
    assert [h.text for h in table.headings] == ["technique", "a", "b"]
    (_, first, second), (_, third, fourth), (_, floor, not_run) = table.rows
    assert (floor.text, floor.title) == ("< 0.0200", "below reference floor")
    assert (not_run.text, not_run.title) == ("–", "not run")
    assert first.shade is not None
    assert third.shade is not None
    assert first.shade > third.shade > 0
    assert second.shade == 0
    assert (fourth.text, fourth.title, fourth.shade) == ("unsupported", "no lens", None)
    assert first.note == "10.1 ms"


def test_the_overview_has_a_column_for_each_scene_size_and_run(
    fabricate: Fabricate, make_record: MakeRecord, make_score: MakeRecord
) -> None:
    def rows(*sizes: int) -> list[dict[str, object]]:
        made = [make_record("a", "raster:", size=[s, s], metrics={"rmse": make_score(1 / s)}) for s in sizes]
        return [*made, make_record("b", "raster:", metrics={"rmse": make_score(0.5)})]

    runs = load_runs([fabricate(rows(32, 64), "one"), fabricate(rows(64), "two")])
    one = tables.overview_table(runs[0].records)
    assert [(h.text, h.unit) for h in one.headings[1:]] == [("a", "32 × 32"), ("a", "64 × 64"), ("b", "")]
    assert [c.sort for c in one.rows[0][1:]] == [repr(1 / 32), repr(1 / 64), "0.5"]
    both = tables.overview_table([record for run in runs for record in run.records])
    labels = [f"{h.text} {h.unit}" for h in both.headings[1:]]
    assert labels == ["a 32 × 32, one", "a 64 × 64, one", "b one", "a 64 × 64, two", "b two"]


def test_counts_name_every_status(typical: Path) -> None:
    (run,) = load_runs([typical])
    assert tables.status_counts(run.records) == {"ok": 4, "failed": 1, "unsupported": 1}
