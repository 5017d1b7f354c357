"""Tables of the page as plain rows of cells: what is shown, what a hover says and what sorting compares.

All decisions (which metrics are headings, which value is best, what an absent value means) are made here, so that the
template only draws.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from aliasbench.metrics.catalog import METRICS, OPTIONAL
from aliasbench.metrics.guide import GUIDE
from aliasbench.reports.charts import RENDERER_NAMES, number
from aliasbench.reports.records import Record, Score

# One metric for each artifact: stairsteps, shimmer, moiré, strobing. The table of all records has the rest.
HEADLINES = ("rmse", "ssim", "jaggies", "shimmer", "moire", "strobing", "apparent_rate")
# How the error divides into space and time, of scenes that move.
DIVISION = ("spatial", "temporal")
MOST_EXTRAS = 8

Column = tuple[str, tuple[int, int], str]  # of the overview: scene, size and run


@dataclass(frozen=True, slots=True)
class Cell:
    """One cell: its text, the tooltip, what sorting compares, and its style class.

    `shade` (0 to 1) is how strongly the overview tints it, None for not at all.
    """

    text: str
    title: str = ""
    sort: str = ""
    style: str = ""
    note: str = ""
    shade: float | None = None


@dataclass(frozen=True, slots=True)
class Heading:
    """One column heading; `numeric` columns are right-aligned."""

    text: str
    title: str = ""
    numeric: bool = False
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Table:
    """Headings and rows; `row_styles` holds one style class a row."""

    headings: Sequence[Heading]
    rows: Sequence[Sequence[Cell]]
    row_styles: Sequence[str]


def scene_table(records: Sequence[Record], runs: Sequence[str]) -> Table:
    """Return the headline metrics of one scene, a row a record, the best value of each column marked."""
    moves = any(record.value(name) is not None for record in records for name in DIVISION)
    names = _present(records, (*HEADLINES, *DIVISION) if moves else HEADLINES)
    headings = [Heading("technique"), *_run_heading(runs), Heading("time", "median time of one frame", True, "ms")]
    headings += [_metric_heading(name) for name in names]
    best = {name: _best(name, records) for name in names}
    rows = []
    for record in records:
        row = [_technique_cell(record), *_run_cell(record, runs), _time_cell(record)]
        row += [_metric_cell(record, name, best[name]) for name in names]
        rows.append(row)
    return Table(headings, rows, [record.status for record in records])


def record_table(records: Sequence[Record], runs: Sequence[str]) -> Table:
    """Return every record with every metric that any of them has, failures and warnings in words."""
    names = _present(records, METRICS)
    headings = [Heading("scene"), Heading("technique"), *_run_heading(runs), Heading("status")]
    headings += [Heading("notes", "reasons of failures, and why a time may not be reliable")]
    headings += [
        Heading("time", "median time of one frame with its 95 % bootstrap interval", True, "ms"),
        Heading("setup", "building and uploading the scene", True, "ms"),
        Heading("samples", "primary samples of one frame", True),
    ]
    headings += [_metric_heading(name) for name in names]
    headings += [Heading("size"), Heading("frames", "", True), Heading("seed")]
    rows = []
    for record in records:
        width, height = record.size
        row = [Cell(record.scene), _technique_cell(record), *_run_cell(record, runs), _status_cell(record)]
        row += [Cell(note_text(record), style="words")]
        row += [_time_cell(record, interval=True), _number_cell(record.setup_seconds, 1e3)]
        row += [
            Cell("–", style="absent")
            if record.samples is None
            else Cell(f"{record.samples:,}", sort=str(record.samples))
        ]
        row += [_metric_cell(record, name, None) for name in names]
        row += [Cell(size_text(record.size), sort=str(width * height)), Cell(str(record.frames)), Cell(record.seed)]
        rows.append(row)
    return Table(headings, rows, [record.status for record in records])


def overview_table(records: Sequence[Record]) -> Table:
    """Return RMSE and time of every technique (rows) in every scene, size and run (columns), tinted by the error.

    A heading says the size where its scene has several, and the run where several have the scene. Several records of
    one technique in one column (seeds) show the first that has an RMSE.
    """
    columns = list(dict.fromkeys((r.scene, r.size, r.run) for r in records))
    techniques = list(dict.fromkeys(r.technique for r in records))
    found: dict[tuple[str, Column], Record] = {}
    for record in records:
        key = (record.technique, (record.scene, record.size, record.run))
        if key not in found or (found[key].value("rmse") is None and record.value("rmse") is not None):
            found[key] = record
    rows, styles = [], []
    for technique in techniques:
        cells = [found.get((technique, column)) for column in columns]
        first = next(r for r in cells if r is not None)
        rows.append([_technique_cell(first), *(_overview_cell(r) for r in cells)])
        styles.append("ok")
    return Table([Heading("technique"), *(_column_heading(column, columns) for column in columns)], rows, styles)


def _column_heading(column: Column, columns: Sequence[Column]) -> Heading:
    scene, size, run = column
    of_scene = [other for other in columns if other[0] == scene]
    parts = [size_text(size)] if len({other[1] for other in of_scene}) > 1 else []
    parts += [run] if len({other[2] for other in of_scene}) > 1 else []
    return Heading(scene, "", True, ", ".join(parts))


def size_text(size: tuple[int, int]) -> str:
    """Return a size as the page writes it: 256 × 128."""
    return f"{size[0]} × {size[1]}"


def note_text(record: Record) -> str:
    """Return why a record failed or what makes its time unreliable, empty where there is nothing to say."""
    warnings = record.timing.warnings if record.timing else ()
    return "; ".join(([record.error] if record.error else []) + list(warnings))


def status_counts(records: Iterable[Record]) -> dict[str, int]:
    """Return how many records have each status, ok first."""
    counts = {"ok": 0, "failed": 0, "unsupported": 0}
    for record in records:
        counts[record.status] = counts.get(record.status, 0) + 1
    return counts


def _present(records: Sequence[Record], names: Iterable[str]) -> list[str]:
    """Return the names that any record has, in the order given; unknown metrics only where `names` is the registry."""
    known = list(names)
    held = dict.fromkeys(name for record in records for name in record.metrics)
    extra = [name for name in held if name not in METRICS] if len(known) == len(METRICS) else []
    return [name for name in known if name in held] + extra


def _says(record: Record, name: str) -> bool:
    """Return whether a record has a value of a metric, or a floor that it is below."""
    score = record.metrics.get(name)
    return score is not None and (score.value is not None or score.floor is not None)


def _run_heading(runs: Sequence[str]) -> list[Heading]:
    return [Heading("run")] if len(runs) > 1 else []


def _run_cell(record: Record, runs: Sequence[str]) -> list[Cell]:
    return [Cell(record.run)] if len(runs) > 1 else []


def _metric_heading(name: str) -> Heading:
    entry = METRICS.get(name) or OPTIONAL.get(name)
    if entry is None:
        return Heading(name, "", True)
    arrow = {"low": " ↓", "hig": " ↑"}.get(str(entry.better)[:3], "")
    better = {"low": ", lower is better", "hig": ", higher is better"}.get(str(entry.better)[:3], "")
    unit = "" if entry.unit in ("", "1") else entry.unit
    meaning = GUIDE[name].meaning
    title = f"{name}{better}; {meaning[0].lower()}{meaning[1:]} Source: {entry.source}"
    return Heading(f"{entry.label}{arrow}", title, True, unit)


def column_meanings(records: Sequence[Record]) -> list[tuple[str, str]]:
    """Return label and meaning of every metric that any record has."""
    known = {**METRICS, **OPTIONAL}
    return [(known[name].label, GUIDE[name].meaning) for name in _present(records, METRICS) if name in known]


def _best(name: str, records: Sequence[Record]) -> float | None:
    entry = METRICS.get(name) or OPTIONAL.get(name)
    values = [v for v in (r.value(name) for r in records) if v is not None]
    if entry is None or len(values) < 2:
        return None
    sense = str(entry.better)[:3]
    return min(values) if sense == "low" else max(values) if sense == "hig" else None


def _technique_cell(record: Record) -> Cell:
    kind = RENDERER_NAMES.get(record.renderer, "")
    return Cell(record.technique, title=kind, style=f"technique {record.renderer if kind else 'other'}")


def _status_cell(record: Record) -> Cell:
    return Cell(record.status, style=f"badge {record.status}")


def _time_cell(record: Record, interval: bool = False) -> Cell:
    timing = record.timing
    if timing is None:
        return Cell("–", title="not timed", style="absent")
    low, median, high = (number(s * 1e3) for s in (timing.low_s, timing.median_s, timing.high_s))
    title = "; ".join([f"95 % interval {low} to {high} ms, {timing.rounds} rounds", *timing.warnings])
    style = "doubtful" if timing.warnings else ""
    return Cell(median, title, repr(timing.median_s), style, note=f"{low}–{high}" if interval else "")


def _number_cell(value: float | None, factor: float = 1.0) -> Cell:
    return Cell("–", style="absent") if value is None else Cell(number(value * factor), sort=repr(value))


def _samples_cell(record: Record) -> Cell:
    if record.samples is None:
        return Cell("–", style="absent")
    return Cell(f"{record.samples:,}", sort=str(record.samples))


def _metric_cell(record: Record, name: str, best: float | None) -> Cell:
    score = record.metrics.get(name)
    if score is None:
        return Cell("–", title="not measured", style="absent")
    status = score.status.replace("_", " ")
    if score.value is None:
        return Cell("–", title=f"{status}: {number(score.floor)}" if score.floor else status, style="absent")
    title = "; ".join(([] if score.status == "ok" else [status]) + _extras(score))
    # what reads the same counts as the same: no winner by a digit that is not shown
    is_best = best is not None and number(score.value) == number(best)
    return Cell(number(score.value), title, repr(score.value), "best" if is_best else "")


def _extras(score: Score) -> list[str]:
    """Return the further figures of a score that are plain numbers or words, the first few."""
    plain = [(k, v) for k, v in score.extras.items() if isinstance(v, (int, float, str))]
    return [f"{k} {number(v) if isinstance(v, float) else v}" for k, v in plain[:MOST_EXTRAS]]


def _overview_cell(record: Record | None) -> Cell:
    if record is None:
        return Cell("–", title="not run", style="absent")
    if record.status != "ok":
        return Cell(record.status, title=note_text(record), style=f"badge {record.status}")
    score = record.metrics.get("rmse")
    ms = f"{number(record.timing.median_s * 1e3)} ms" if record.timing else "not timed"
    if score is None or score.value is None:
        reason = score.status.replace("_", " ") if score else "not measured"
        text = f"< {number(score.floor)}" if score and score.floor else "–"
        return Cell(text, title=reason, style="absent", note=ms)
    shade = 0.0
    if score.value > 0:
        # one decade and a half is the whole span of a scene's techniques; .001 and below stay white
        shade = min(1.0, max(0.0, (math.log10(score.value) + 3.0) / 2.5))
    return Cell(number(score.value), title=ms, sort=repr(score.value), note=ms, shade=round(shade, 3))
