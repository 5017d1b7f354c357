"""The section on hard cases: a matrix of verdicts, and the derivation of every limit in words.

A reader shall see at a glance that nothing failed, and find for each limit how far it goes and why it can go no
further.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from aliasbench.bench.hard.case import HARD_CASE
from aliasbench.bench.hard.overview import TITLES, Found, Row, is_hard, overview
from aliasbench.bench.hard.overview import Cell as Answer
from aliasbench.reports.records import Record
from aliasbench.reports.tables import Cell, Heading, Table

STYLES = {"ok": "badge ok", "limit": "badge limit", "failed": "badge failed", "unsupported": "badge unsupported"}


@dataclass(frozen=True, slots=True)
class Limit:
    """Subjects of one case that are limited, or failed, alike: what was found of each, and why."""

    name: str
    subjects: str
    found: str
    why: str


@dataclass(frozen=True, slots=True)
class HardSection:
    """The verdicts of one run: how many of each outcome, a table for each group of cases, and what is not plain ok."""

    run: str
    counts: Sequence[tuple[str, int]]
    tables: Sequence[tuple[str, Table]]
    limits: Sequence[Limit]


def split_records(records: Sequence[Record]) -> tuple[list[Record], list[Record]]:
    """Return the records with pictures and those of hard cases."""
    return [r for r in records if not is_hard(r.size)], [r for r in records if is_hard(r.size)]


def hard_sections(records: Sequence[Record]) -> list[HardSection]:
    """Return the verdicts of each run among the records of hard cases."""
    return [_section(run, [r for r in records if r.run == run]) for run in dict.fromkeys(r.run for r in records)]


def _section(run: str, records: Sequence[Record]) -> HardSection:
    subjects, rows = overview(_found(record) for record in records)
    outcomes = [cell.outcome for row in rows for cell in row.cells.values()]
    groups = dict.fromkeys(row.group for row in rows)
    return HardSection(
        run,
        [(outcome, outcomes.count(outcome)) for outcome in STYLES if outcome in outcomes],
        [(group, _table([row for row in rows if row.group == group], subjects)) for group in groups],
        [limit for row in rows for limit in _limits(row, subjects)],
    )


def _found(record: Record) -> Found:
    score = record.metrics.get(HARD_CASE)
    verdict = () if score is None else (score.value, score.status, score.extras)
    return Found(record.scene, record.technique, record.status, record.error or None, *verdict)


def _table(rows: Sequence[Row], subjects: Sequence[str]) -> Table:
    """Return a group's cases, a row each, with the verdict of every subject; blank where it is not asked."""
    asked = [subject for subject in subjects if any(subject in row.cells for row in rows)]
    headings = [Heading("case"), *(Heading(TITLES.get(subject, subject), subject) for subject in asked)]
    cells = []
    for row in rows:
        line = [Cell(row.name, note=f"{row.question} {row.criterion}")]
        for subject in asked:
            cell = row.cells.get(subject)
            line.append(Cell("") if cell is None else _verdict(cell))
        cells.append(line)
    return Table(headings, cells, ["" for _ in rows])


def _verdict(cell: Answer) -> Cell:
    allowed = f"of {cell.allowed}" if cell.outcome != "ok" and cell.allowed else ""
    title = f"{cell.detail}: {cell.why}" if cell.why else cell.detail
    return Cell(cell.text, title=title, style=STYLES.get(cell.outcome, "badge"), note=allowed)


def _limits(row: Row, subjects: Sequence[str]) -> list[Limit]:
    """Return what is not plain ok in a row, subjects with the same derivation and figures together."""
    alike: dict[tuple[str, str], list[str]] = {}
    for subject in subjects:
        cell = row.cells.get(subject)
        if cell is not None and cell.outcome != "ok":
            alike.setdefault((cell.detail, cell.why), []).append(TITLES.get(subject, subject))
    return [Limit(row.name, ", ".join(names), detail, why) for (detail, why), names in alike.items()]
