"""The section on hard cases: a row a case, a column a subject, every limit with its derivation."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from aliasbench.bench.hard.case import EGL, FAST, HARD_CASE, METRICS, REFERENCE, TRACER
from aliasbench.bench.table import record_tables
from aliasbench.reports.hard_cases import HardSection, hard_sections, split_records
from aliasbench.reports.page import write_report
from aliasbench.reports.records import load_runs

MakeRecord = Callable[..., dict[str, Any]]
Fabricate = Callable[..., Path]
EXTRAS = {
    "group": "edges",
    "question": "Who owns it?",
    "criterion": "One does.",
    "unit": "px",
    "rounding": 0.0,
    "bound": 2e-3,
    "why": "8 bits",
    "standard_error": None,
    "note": "in <row> 3",
}


@pytest.fixture
def rows(make_record: MakeRecord, make_score: MakeRecord) -> list[dict[str, Any]]:
    def hard(
        name: str, subject: str, outcome: str, value: float | None = 0.0, status: str = "ok", **changes: Any
    ) -> dict[str, Any]:
        score = make_score(value, outcome, **(EXTRAS | changes))
        return make_record(
            name, subject, size=[0, 0], rounds=0, seconds=[], status=status, images={}, metrics={HARD_CASE: score}
        )

    broken = make_record(
        "spokes",
        REFERENCE,
        size=[0, 0],
        rounds=0,
        seconds=[],
        status="failed",
        error="no spokes",
        images={},
        metrics={},
    )
    return [
        hard("spokes", TRACER, "ok"),
        hard("spokes", FAST, "limit", 1.25e-3),
        hard("spokes", EGL, "limit", 1.25e-3),
        broken,
        hard("greys", METRICS, "failed", None, "failed", group="sizes"),
        make_record("edges", "raytrace:", metrics={"rmse": make_score(0.1)}),
    ]


@pytest.fixture
def section(fabricate: Fabricate, rows: list[dict[str, Any]]) -> HardSection:
    (run,) = load_runs([fabricate(rows, "run")])
    pictures, hard = split_records(run.records)
    assert [r.scene for r in pictures] == ["edges"]
    (found,) = hard_sections(hard)
    return found


def test_a_row_has_the_verdict_of_every_subject(section: HardSection) -> None:
    assert section.counts == [("ok", 1), ("limit", 2), ("failed", 2)]
    assert [group for group, _ in section.tables] == ["edges", "sizes"]
    table = section.tables[0][1]
    assert [h.text for h in table.headings] == ["case", "tracer", "robust off", "EGL", "reference"]
    (row,) = table.rows
    assert [cell.text for cell in row] == ["spokes", "ok", "limit 0.00125", "limit 0.00125", "failed"]
    assert row[0].note == "Who owns it? One does."
    assert (row[2].note, row[2].style) == ("of 0.002 px", "badge limit")
    assert row[2].title == "0.00125 px, 0.002 allowed; in <row> 3: 8 bits"
    assert row[4].title == "no spokes"


def test_limits_are_derived_once_for_subjects_alike(section: HardSection) -> None:
    limits = [(limit.name, limit.subjects, limit.why) for limit in section.limits]
    assert limits == [
        ("spokes", "robust off, EGL", "8 bits"),
        ("spokes", "reference", ""),
        ("greys", "metrics", "8 bits"),
    ]
    assert section.limits[2].found.startswith("not finite px, 0.002 allowed")


def test_the_page_has_the_section_and_no_pictures_of_it(
    fabricate: Fabricate, rows: list[dict[str, Any]], tmp_path: Path
) -> None:
    page = write_report([fabricate(rows, "run")], tmp_path / "page").read_text()
    assert page.count('<section id="hard-cases">') == 1
    assert page.count('<section class="scene"') == 1
    assert "in &lt;row&gt; 3" in page
    only = write_report([fabricate(rows[:5], "hard")], tmp_path / "only").read_text()
    assert 'id="hard-cases"' in only
    assert "There are no records" not in only
    assert '<section id="records">' not in only


def test_the_terminal_shows_hard_cases_in_one_table_and_others_by_scene(
    fabricate: Fabricate, rows: list[dict[str, Any]]
) -> None:
    from aliasbench.bench.export import load_run

    tables = record_tables(load_run(fabricate(rows, "run")), 140)
    assert [str(table.title).split()[0] for table in tables] == ["hard", "edges"]
    assert [column.header for column in tables[0].columns] == [
        "case",
        "tracer",
        "robust off",
        "EGL",
        "reference",
        "metrics",
    ]
    assert tables[0].row_count == 2
