"""The section on convergence: what more samples bring each family of techniques, and what an error costs in each.

The arithmetic is `bench.families`; here it becomes rows and sentences. Where a figure was not measured, the bound that
is certain stands in its place and the extrapolation, so called, below it; a slope of fewer than three counts is not
shown at all.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from aliasbench.bench.families import (
    Comparison,
    Family,
    Lead,
    Measured,
    compare_families,
    find_lead,
    group_families,
)
from aliasbench.metrics.score import Score
from aliasbench.reports.charts import RENDERER_NAMES, number
from aliasbench.reports.records import Record
from aliasbench.reports.tables import Cell, Heading, Table

FARTHEST = 16.0  # times the longest time measured: two more settings of four times the samples


@dataclass(frozen=True, slots=True)
class Convergence:
    """One scene at one size in one run: the table, whether it has slopes, and what it comes to in a sentence."""

    title: str
    run: str
    has_slopes: bool
    table: Table
    finding: str


def convergence_sections(groups: Sequence[tuple[str, Sequence[Record]]]) -> list[Convergence]:
    """Return the families of every scene that has any.

    Parameters
    ----------
    groups : sequence of (title, records)
        The records of one scene at one size; those of several runs are compared within each run.
    """
    sections = []
    for title, records in groups:
        for run in dict.fromkeys(record.run for record in records):
            families = group_families([_measured(record) for record in records if record.run == run])
            if families:
                comparison = compare_families(families)
                lead = find_lead(comparison)
                words = finding(lead, comparison.rmse) if lead else ""
                has_slopes = any(family.slope for family in families)
                sections.append(Convergence(title, run, has_slopes, convergence_table(comparison), words))
    return sections


def convergence_table(comparison: Comparison) -> Table:
    """Return a row for each family: counts, slopes (where any has one), time to the error, error in the time."""
    rmse, ms = f"{comparison.rmse:g}", f"{comparison.seconds * 1e3:.3g}"
    sloped = any(family.slope for family in comparison.families)
    slopes = [
        Heading("error slope", "change of log RMSE with the log of the sample count", True),
        Heading("time slope", "change of log time with the log of the sample count", True),
    ]
    headings = [
        Heading("technique", "what its members have in common; N (or k x k) is what differs"),
        Heading("samples", "samples a pixel that were run", True, "a pixel"),
        *(slopes if sloped else []),
        Heading(f"time to RMSE {rmse}", "read off between the settings that were run", True, "ms"),
        Heading(f"RMSE in {ms} ms", "read off between the settings that were run", True),
    ]
    rows = [
        [
            Cell(family.name, RENDERER_NAMES.get(family.renderer, ""), style=f"technique {family.renderer}"),
            Cell(", ".join(map(str, dict.fromkeys(family.counts))), sort=str(max(family.counts))),
            *([_slope_cell(family, s) for s in (family.slope, family.time_slope)] if sloped else []),
            _time_cell(family, time, comparison.rmse),
            _error_cell(family, error, comparison.seconds),
        ]
        for family, time, error in zip(comparison.families, comparison.times, comparison.errors, strict=True)
    ]
    return Table(headings, rows, ["ok"] * len(rows))


def finding(lead: Lead, rmse: float) -> str:
    """Return in a sentence who is first at an error, and how much sooner than the other, with its interval."""
    ends, span = _ends(lead.speedup), _span(lead.speedup)
    times = lead.speedup.value or 0.0
    ratio = f"{times:.2g} times" if times < 10.0 else f"{times:.0f} times"
    if ends and ends[0] <= 1.0 <= (ends[1] or 1.0):
        pace = f"takes about as long ({ratio}, {span}): too close to call"
    else:
        pace = f"takes {ratio} as long" + (f" ({span})" if ends else "")
    place = f"{lead.first.name} is the first at RMSE {rmse:g}, in {number((lead.time.value or 0.0) * 1e3)} ms"
    return f"{place}; {lead.other.name} {pace}."


def _measured(record: Record) -> Measured:
    score = record.metrics.get("rmse")
    errors: tuple[float, ...] = ()
    if record.status == "ok" and score is not None and score.value is not None:
        seeds = score.extras.get("by_seed")
        errors = tuple(float(e) for e in seeds) if isinstance(seeds, list) and seeds else (score.value,)
    return Measured(record.technique, errors, record.seconds)


def _ends(score: Score) -> tuple[float, float | None] | None:
    """Return the ends of a score's interval, the upper one None where it is infinite; None without interval."""
    interval = score.extras.get("interval")
    if not isinstance(interval, list) or interval[0] is None:
        return None
    return float(interval[0]), None if interval[1] is None else float(interval[1])


def _span(score: Score, factor: float = 1.0) -> str:
    """Return an interval as the page writes it, empty where there is none."""
    ends = _ends(score)
    if ends is None:
        return ""
    low, high = ends
    return f"{number(low * factor)}–{'∞' if high is None else number(high * factor)}"


def _slope_cell(family: Family, score: Score | None) -> Cell:
    if score is None:
        return Cell("–", f"{len(set(family.counts))} sample counts; a slope needs three", style="absent")
    if score.value is None:
        return Cell("–", "a picture without error has no logarithm", style="absent")
    interval, source = score.extras.get("interval"), f"95 % interval over {score.extras['replicates']} repetitions"
    if interval is None:
        interval, source = score.extras.get("residual_interval"), "95 % interval by the scatter about the line"
    title = f"{source}; between the two largest counts {_signed(score.extras['last_slope'])}"
    note = " to ".join(_signed(end) for end in interval) if isinstance(interval, list) else ""
    return Cell(_signed(score.value), title, repr(score.value), note=note)


def _signed(value: object) -> str:
    """Return a slope with two decimals and a minus sign."""
    return f"{round(value, 2) + 0.0:.2f}".replace("-", "−") if isinstance(value, float) else "–"


def _time_cell(family: Family, score: Score, rmse: float) -> Cell:
    (largest, least), (quickest, slowest) = family.errors, family.seconds
    if rmse > largest:
        title = f"its quickest setting has RMSE {number(largest)} already"
        return Cell(f"< {number(quickest * 1e3)}", title, repr(quickest))
    if score.value is None:
        return Cell("–", f"more samples do not take it below RMSE {number(least)}", style="absent")
    if score.status == "extrapolated":
        return _beyond(f"> {number(slowest * 1e3)}", score, 1e3, score.value / slowest, f"down to RMSE {number(least)}")
    return Cell(number(score.value * 1e3), "", repr(score.value), note=_span(score, 1e3))


def _error_cell(family: Family, score: Score, seconds: float) -> Cell:
    (_, least), (quickest, slowest) = family.errors, family.seconds
    if seconds < quickest or score.value is None:
        return Cell("–", f"its quickest setting takes {number(quickest * 1e3)} ms", style="absent")
    if score.status == "extrapolated":
        return _beyond(f"≤ {number(least)}", score, 1.0, seconds / slowest, f"up to {number(slowest * 1e3)} ms")
    return Cell(number(score.value), "", repr(score.value), note=_span(score))


def _beyond(bound: str, score: Score, factor: float, reach: float, measured: str) -> Cell:
    """Return what is certain of a figure that was not measured, and what it may be if that is not too far off."""
    value = (score.value or 0.0) * factor
    note = f"≈ {number(value)} extrapolated" if reach <= FARTHEST else ""
    return Cell(bound, f"measured {measured}", repr(value), "doubtful", note)
