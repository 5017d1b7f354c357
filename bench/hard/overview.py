"""The verdicts of a run as one table: a row for each hard case, a column for each subject.

For the terminal and the report alike: text and facts, no layout.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from aliasbench.bench.hard.case import ALL, METRICS

NO_PICTURE = (0, 0)  # the size that records of hard cases have
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
class Found:
    """A record of a hard case: `outcome` and `extras` are its verdict's, None where there is none but a reason."""

    name: str
    subject: str
    status: str
    error: str | None
    value: float | None = None
    outcome: str | None = None
    extras: Mapping[str, Any] | None = None


@dataclass(frozen=True, slots=True)
class Cell:
    """One verdict: `outcome` is "ok", "limit", "failed" or "unsupported"; `text` is short, `detail` says it all.

    `allowed` is the bound with the unit that the measured figure has too, `why` is where the bounds come from; both are
    empty where a reason stands in place of a verdict.
    """

    outcome: str
    text: str
    detail: str
    allowed: str = ""
    why: str = ""


@dataclass(frozen=True, slots=True)
class Row:
    """One hard case with its verdicts by subject; subjects that it is not asked of are missing."""

    name: str
    group: str
    question: str
    criterion: str
    cells: dict[str, Cell]


def is_hard(size: Sequence[int]) -> bool:
    """Return whether a record with pictures of such a size is a hard case's."""
    return tuple(size) == NO_PICTURE


def overview(found: Iterable[Found]) -> tuple[list[str], list[Row]]:
    """Return the subjects that occur, in their usual order, and a row for each hard case in the order found."""
    from aliasbench.bench.hard.catalog import HARD_CASES

    rows: dict[str, Row] = {}
    for each in found:
        case, extras = HARD_CASES.get(each.name), each.extras or {}
        group, question, criterion = (
            str(extras.get(key) or getattr(case, key, "")) for key in ("group", "question", "criterion")
        )
        row = rows.setdefault(each.name, Row(each.name, group, question, criterion, {}))
        row.cells[each.subject] = make_cell(each)
    present = {subject for row in rows.values() for subject in row.cells}
    usual = [subject for subject in (*ALL, METRICS) if subject in present]
    return [*usual, *sorted(present.difference(usual))], list(rows.values())


def make_cell(found: Found) -> Cell:
    """Return a verdict in few characters and in full."""
    extras = found.extras
    if extras is None or found.outcome is None:
        return Cell(found.status, found.status, found.error or "no reason was recorded")
    measured = f"{figure(found.value)} {extras['unit']}"
    allowed = f"{figure(extras['bound'])} {extras['unit']}"
    detail = f"{measured}, {figure(extras['bound'])} allowed"
    if extras["standard_error"] is not None:
        detail += f", standard error {figure(extras['standard_error'])}"
    if extras["note"]:
        detail += f"; {extras['note']}"
    text = "ok" if found.outcome == "ok" else f"{found.outcome} {figure(found.value)}"
    return Cell(found.outcome, text, detail, allowed, str(extras["why"]))


def figure(value: float | None) -> str:
    """Return a figure in three digits; not finite ones were stored as None."""
    return "not finite" if value is None else f"{value:.3g}"
