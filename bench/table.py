"""The records as a table for the terminal: what a reader wants to know first, and every warning and reason in words."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

from aliasbench.bench.export import Record, Run
from aliasbench.bench.hard.case import HARD_CASE
from aliasbench.bench.hard.overview import TITLES, Cell, Found, is_hard, overview
from aliasbench.bench.timing import summarise
from aliasbench.bench.wording import certainty, printable, sentence

if TYPE_CHECKING:
    from rich.table import Table

NEGLIGIBLE = 1e-9  # what is left of a zero in float64
DASH = "–"
WIDE = 110  # characters from which there is room for everything
ROOMY = 130  # and from which there is room for how the error divides into space and time
HEADLINES = ("rmse", "jaggies", "shimmer", "moire", "strobing", "apparent_rate")
DIVISION = ("spatial", "temporal")
SHORT = {"apparent_rate": "rev/s"}


def record_tables(run: Run, width: int) -> list["Table"]:
    """Return a table for each scene: time with its interval, the headline metrics it has, and what to beware of.

    A dash is a metric without a value for this record; "< x" one that is under the reference's floor x. Where `width`,
    in characters, is small, intervals and notes make way and a doubtful time is marked with ~; how the error of a scene
    that moves divides into space and time stands where there is much room.
    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    measured = [record for record in run["records"] if not is_hard(record["size"])]
    tables = [hard_table(run)] if len(measured) < len(run["records"]) else []
    styles = {"failed": "red", "unsupported": "yellow"}
    wide = width >= WIDE
    for (scene, size), group in groupby(measured, key=lambda r: (r["scene"], tuple(r["size"]))):
        records = list(group)
        shown = (*HEADLINES, *DIVISION) if width >= ROOMY else HEADLINES
        names = [n for n in shown if any(_number(r, n) != DASH for r in records)]
        title = Text(f"{printable(scene)}  {size[0]} x {size[1]}", "bold")
        table = Table(box=box.SIMPLE_HEAD, title=title, title_justify="left", pad_edge=False, padding=(0, 1, 0, 0))
        longest = max(len(r["technique"]) for r in records)
        table.add_column("technique", overflow="fold", min_width=min(longest, 24))
        table.add_column("ms", justify="right", no_wrap=True)
        if wide:
            table.add_column("95 %", no_wrap=True)
        for name in names:
            table.add_column(SHORT.get(name, name), justify="right", no_wrap=True)
        if wide:
            table.add_column("notes", style="dim")
        for record in records:
            median, interval, warnings = _time(record["seconds"])
            cells = [median, interval] if wide else [f"~{median}" if warnings else median]
            cells += [_number(record, name) for name in names]
            if wide:
                cells.append("; ".join([*([] if record["status"] == "ok" else [record["status"]]), *warnings]))
            table.add_row(Text(printable(record["technique"]), styles.get(record["status"], "")), *map(Text, cells))
        tables.append(table)
    return tables


def hard_table(run: Run) -> "Table":
    """Return the verdicts of the hard cases: a row for each, a column for each subject."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    subjects, rows = overview(_found(record) for record in run["records"] if is_hard(record["size"]))
    table = Table(box=box.SIMPLE_HEAD, title=Text("hard cases", "bold"), title_justify="left", pad_edge=False)
    table.add_column("case", overflow="fold")
    for subject in subjects:
        table.add_column(TITLES.get(subject, subject))
    styles = {"failed": "red", "unsupported": "yellow", "limit": "cyan"}
    for row in rows:
        cells = (row.cells.get(subject, Cell("", "", "")) for subject in subjects)
        table.add_row(Text(printable(row.name)), *(Text(cell.text, styles.get(cell.outcome, "")) for cell in cells))
    return table


def _found(record: Record) -> Found:
    score: Any = record["metrics"].get(HARD_CASE)
    verdict = () if score is None else (score["value"], score["status"], score["extras"])
    return Found(record["scene"], record["technique"], record["status"], record["error"], *verdict)


def legend_lines(run: Run, width: int) -> list[str]:
    """Return what the marks in the tables mean, as far as they occur, and where a reference says too little.

    A scene gets a line if more than half of its scores are under the floor of its reference, and that floor is not that
    of rounding alone.
    """
    legend = []
    if width < WIDE and any(_time(r["seconds"])[2] for r in run["records"]):
        legend.append("~: doubtful time, see the report")
    if any(_is_hidden(s) for r in run["records"] for s in r["metrics"].values()):
        legend.append("< x: below what the reference can tell")
    lines = ["; ".join(legend)] if legend else []
    for (scene, size), group in groupby(run["records"], key=lambda r: (r["scene"], tuple(r["size"]))):
        records = list(group)
        scores = [s for r in records for s in r["metrics"].values()]
        hidden = sum(_is_hidden(s) for s in scores)
        known = sum(s["value"] is not None for s in scores)
        uncertainty, kind = max(
            ((r["uncertainty"] or 0.0, r["uncertainty_kind"] or "") for r in records), default=(0.0, "")
        )
        if hidden > known and uncertainty > NEGLIGIBLE:
            lines.append(
                f"{printable(scene)} {size[0]} x {size[1]}: its reference is {certainty(uncertainty, kind)}, which"
                f" hides {hidden} of {hidden + known} scores"
            )
    return lines


def failure_lines(run: Run) -> list[str]:
    """Return a line for every reason why cases have no result, with the cases that it holds for."""
    reasons: dict[str, list[str]] = {}
    for record in run["records"]:
        if record["error"]:
            case = printable(f"{record['scene']} by {record['technique']}")
            reasons.setdefault(sentence(f"{record['status']}: {record['error']}"), []).append(case)
    return [f"{reason}\n    {', '.join(cases)}" for reason, cases in reasons.items()]


def _time(seconds: Sequence[float]) -> tuple[str, str, list[str]]:
    """Return the median in milliseconds, its interval, and warnings, as text."""
    if not seconds:
        return DASH, "", []
    times = summarise(seconds)
    median, low, high = (f"{value * 1e3:.3g}" for value in (times.median_s, times.low_s, times.high_s))
    return median, f"{low} to {high}", list(times.warnings)


def _number(record: Record, name: str) -> str:
    score = record["metrics"].get(name)
    if score is None:
        return DASH
    value = score["value"]
    if isinstance(value, float):
        return f"{value:.4g}" if abs(value) >= NEGLIGIBLE else "0"
    extras = score["extras"]
    floor = extras.get("floor") if _is_hidden(score) and isinstance(extras, dict) else None
    return f"< {floor:.2g}" if isinstance(floor, float) else DASH


def _is_hidden(score: Mapping[str, object]) -> bool:
    return score["status"] == "below_reference_floor"


def total_line(run: Run) -> str:
    """Return how many cases of a run came out how, and how many of the good ones are known limits."""
    records = run["records"]
    counts = {status: sum(r["status"] == status for r in records) for status in ("ok", "failed", "unsupported")}
    verdicts = [r["metrics"].get(HARD_CASE) for r in records]
    limits = sum(verdict is not None and verdict["status"] == "limit" for verdict in verdicts)
    known = f" ({limits} of them known limits)" if limits else ""
    return ", ".join(f"{count} {status}{known if status == 'ok' else ''}" for status, count in counts.items())
