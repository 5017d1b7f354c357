"""The records as a table for the terminal: what a reader wants to know first, and every warning and reason in words."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from aliasbench.bench.export import Record, Run
from aliasbench.bench.timing import summarise

if TYPE_CHECKING:
    from rich.table import Table

NEGLIGIBLE = 1e-9  # what is left of a zero in float64
HEADLINES = ("rmse", "jaggies", "shimmer", "moire", "strobing", "apparent_rate")


def record_table(run: Run) -> "Table":
    """Return a table of all records, scene after scene: time with its interval, headline metrics, status, warnings.

    Only the headline metrics that some record has are shown; a dash is a metric without a value for this scene.
    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    records = run["records"]
    names = [n for n in HEADLINES if any(_value(r, n) is not None for r in records)]
    table = Table(box=box.SIMPLE_HEAD, title=f"{run['suite']}: {len(records)} cases", title_justify="left")
    table.add_column("scene", overflow="fold")
    table.add_column("technique", overflow="fold")
    table.add_column("ms (95 %)", justify="right", no_wrap=True)
    for name in names:
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("status")
    table.add_column("notes")
    styles = {"failed": "red", "unsupported": "yellow"}
    for number, record in enumerate(records):
        following = records[number + 1] if number + 1 < len(records) else record
        time, warnings = _time(record["seconds"])
        cells = [record["scene"], record["technique"], time, *(_number(_value(record, name)) for name in names)]
        table.add_row(
            *map(Text, cells),
            Text(record["status"], styles.get(record["status"], "")),
            Text("; ".join(warnings)),
            end_section=following["scene"] != record["scene"],
        )
    return table


def failure_lines(run: Run) -> list[str]:
    """Return a line for every reason why cases have no result, with the cases that it holds for."""
    reasons: dict[str, list[str]] = {}
    for record in run["records"]:
        if record["error"]:
            case = f"{record['scene']} by {record['technique']}"
            reasons.setdefault(f"{record['status']}: {record['error']}", []).append(case)
    return [f"{reason}\n    {', '.join(cases)}" for reason, cases in reasons.items()]


def _time(seconds: Sequence[float]) -> tuple[str, list[str]]:
    if not seconds:
        return "–", []
    times = summarise(seconds)
    median, low, high = (f"{value * 1e3:.3g}" for value in (times.median_s, times.low_s, times.high_s))
    return f"{median} ({low} to {high})", list(times.warnings)


def _value(record: Record, name: str) -> float | None:
    value = record["metrics"].get(name, {}).get("value")
    return value if isinstance(value, float) else None


def _number(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value:.4g}" if abs(value) >= NEGLIGIBLE else "0"
