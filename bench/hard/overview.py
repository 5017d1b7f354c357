"""The verdicts of a run as one table: a row for each hard case, a column for each subject.

For the terminal and the report alike: text and facts, no layout.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from aliasbench.bench.hard.case import ALL, HARD_CASE, METRICS

if TYPE_CHECKING:
    from aliasbench.bench.export import Record

NO_PICTURE = [0, 0]  # the size that records of hard cases have
TITLES = {
    "raytrace:": "tracer",
    "raytrace:robust=off": "robust off",
    "raytrace:engine=portable": "portable",
    "raster:backend=egl": "EGL",
    "raster:backend=osmesa": "OSMesa",
    "reference:": "reference",
    METRICS: "metrics",
}


@dataclass(frozen=True, slots=True)
class Cell:
    """One verdict: `outcome` is "ok", "limit", "failed" or "unsupported"; `text` is short, `detail` says it all."""

    outcome: str
    text: str
    detail: str


@dataclass(frozen=True, slots=True)
class Row:
    """One hard case with its verdicts by subject; subjects that it is not asked of are missing."""

    name: str
    group: str
    question: str
    criterion: str
    cells: dict[str, Cell]


def is_hard(record: "Record") -> bool:
    """Return whether a record is a hard case's."""
    return record["size"] == NO_PICTURE


def overview(records: Sequence["Record"]) -> tuple[list[str], list[Row]]:
    """Return the subjects that occur, in their usual order, and a row for each hard case in the records' order."""
    from aliasbench.bench.hard.catalog import HARD_CASES

    rows: dict[str, Row] = {}
    for record in records:
        name = record["scene"]
        case = HARD_CASES.get(name)
        extras: Any = record["metrics"].get(HARD_CASE, {}).get("extras", {})
        group, question, criterion = (
            str(extras.get(key) or getattr(case, key, "")) for key in ("group", "question", "criterion")
        )
        row = rows.setdefault(name, Row(name, group, question, criterion, {}))
        row.cells[record["technique"]] = make_cell(record)
    present = {subject for row in rows.values() for subject in row.cells}
    usual = [subject for subject in (*ALL, METRICS) if subject in present]
    return [*usual, *sorted(present.difference(usual))], list(rows.values())


def make_cell(record: "Record") -> Cell:
    """Return a record's verdict in few characters and in full."""
    score: Any = record["metrics"].get(HARD_CASE)
    if score is None:
        return Cell(record["status"], record["status"], record["error"] or "no reason was recorded")
    extras = score["extras"]
    unit, error = extras["unit"], extras["standard_error"]
    detail = f"{figure(score['value'])} {unit}, {figure(extras['bound'])} allowed: {extras['why']}"
    if error is not None:
        detail += f"; standard error {figure(error)}"
    if extras["note"]:
        detail += f"; {extras['note']}"
    text = "ok" if score["status"] == "ok" else f"{score['status']} {figure(score['value'])}"
    return Cell(score["status"], text, detail)


def figure(value: float | None) -> str:
    """Return a figure in three digits; not finite ones were stored as None."""
    return "not finite" if value is None else f"{value:.3g}"
