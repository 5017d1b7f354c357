"""The report: one HTML file that opens offline and shows what each millisecond of antialiasing buys.

Everything is inside the one file (pictures, the chart library, style and script), because a report is mailed, archived
as a build artifact and opened from a disk. This module gathers; figures, charts and tables decide; the template draws.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path
from typing import Any

from plotly.offline import get_plotlyjs

from aliasbench.bench.whole_files import make_folder, write_files
from aliasbench.bench.wording import certainty
from aliasbench.reports import charts, tables
from aliasbench.reports.convergence import convergence_sections
from aliasbench.reports.figures import HEAT_HIGH, HEAT_LOW, heat_palette
from aliasbench.reports.gallery import Gallery, make_galleries
from aliasbench.reports.hard_cases import hard_sections, split_records
from aliasbench.reports.markup import make_environment
from aliasbench.reports.records import Record, Run, load_runs
from aliasbench.reports.signal_figures import SignalFigure, draw_records

MAIN_FACTS = ("cpu", "cores", "memory", "os", "python", "aliasbench", "opengl", "embree")


@dataclass(frozen=True, slots=True)
class Trouble:
    """Cases of one scene that did not come out for one and the same reason."""

    run: str
    scene: str
    status: str
    reason: str
    techniques: Sequence[str]


@dataclass(frozen=True, slots=True)
class SceneSection:
    """One scene at one size: its pictures, its chart (None where nothing can be drawn) and its table.

    `link` is what leads here: the title, with the size where the scene has several. `truth` says how well its
    references are known, empty where there are none.
    """

    anchor: str
    title: str
    link: str
    size: str
    truth: str
    gallery: Gallery
    figure: dict[str, Any] | None
    findings: Sequence[str]
    at_floor: Sequence[str]
    absent: Sequence[str]
    table: tables.Table
    signals: Sequence[SignalFigure]


def write_report(run_dirs: Sequence[Path], out: Path) -> Path:
    """Write the report of one or several runs and return the path of its `index.html`.

    Parameters
    ----------
    run_dirs : sequence of Path
        Run directories; records of several are shown together, each with the label of its run.
    out : Path
        A directory, created where it is missing. The page replaces an older one only when it is complete.

    Raises
    ------
    InputError
        If a directory holds no run or the page cannot be written.
    """
    text = render_page(load_runs(run_dirs))
    make_folder(Path(out))
    (page,) = write_files(Path(out), {"index.html": text.encode("utf-8")})
    return page


def render_page(runs: Sequence[Run]) -> str:
    """Return the whole page as text."""
    every = [record for run in runs for record in run.records]
    records, hard = split_records(every)
    labels = [run.label for run in runs]
    groups = _by_scene(records)
    scenes = _scene_sections(groups, labels)
    resources = files("aliasbench.reports")
    return (
        make_environment()
        .get_template("page.html.j2")
        .render(
            runs=runs,
            machines=[_machine_facts(run) for run in runs if run.machine],
            suites=", ".join(dict.fromkeys(run.suite for run in runs if run.suite)),
            dates=_dates(runs),
            counts=tables.status_counts(every),
            scenes=scenes,
            troubles=_troubles(every),
            overview=tables.overview_table(records) if records else None,
            convergence=convergence_sections(groups),
            hard=hard_sections(hard),
            records=tables.record_table(records, labels),
            meanings=tables.column_meanings(records),
            figures=[{"id": s.anchor, **s.figure} for s in scenes if s.figure],
            heat_colours=["#" + bytes(c).hex() for c in heat_palette()[::5]],
            heat_ticks=_heat_ticks(),
            style=(resources / "style.css").read_text(encoding="utf-8"),
            viewer=(resources / "viewer.js").read_text(encoding="utf-8"),
            plotly=get_plotlyjs() if any(s.figure for s in scenes) else "",
        )
    )


def _dates(runs: Sequence[Run]) -> str:
    """Return when the runs were started, as far as they say, and when the page was made."""
    started = [run.started.replace("T", " ").replace("Z", " UTC") for run in runs if run.started]
    made = f"page made {datetime.now(UTC):%Y-%m-%d %H:%M} UTC"
    return f"run {', '.join(dict.fromkeys(started))}; {made}" if started else made


def _machine_facts(run: Run) -> dict[str, Any]:
    """Return the facts that explain timings first, and the rest to be folded away."""
    main = [(k, v) for k, v in run.machine.items() if v and k.lower() in MAIN_FACTS]
    rest = [(k, v) for k, v in run.machine.items() if v and (k, v) not in main]
    return {"label": run.label, "main": main or rest[:8], "rest": rest if main else rest[8:]}


def _by_scene(records: Sequence[Record]) -> list[tuple[str, list[Record]]]:
    """Return the records of each scene and size under the scene's name, with the size where it has several."""
    groups: dict[tuple[str, tuple[int, int]], list[Record]] = {}
    for record in records:
        groups.setdefault((record.scene, record.size), []).append(record)
    names = [scene for scene, _ in groups]
    titles = [scene if names.count(scene) == 1 else f"{scene} {tables.size_text(size)}" for scene, size in groups]
    return list(zip(titles, groups.values(), strict=True))


def _scene_sections(groups: Sequence[tuple[str, Sequence[Record]]], runs: Sequence[str]) -> list[SceneSection]:
    galleries = make_galleries([group for _, group in groups], runs)
    return [
        _scene_section(f"scene-{number}", link, group, gallery, runs)
        for number, ((link, group), gallery) in enumerate(zip(groups, galleries, strict=True), 1)
    ]


def _scene_section(
    anchor: str, link: str, group: Sequence[Record], gallery: Gallery, runs: Sequence[str]
) -> SceneSection:
    points = charts.chart_points(group)
    drawn = {id(p.record) for p in points}
    return SceneSection(
        anchor=anchor,
        title=group[0].scene,
        link=link,
        size=tables.size_text(group[0].size),
        truth=_truth(group),
        gallery=gallery,
        figure=charts.speed_chart(points, runs) if points else None,
        findings=charts.findings(points),
        at_floor=[charts.describe(p) for p in points if p.reason],
        absent=[_absence(r) for r in group if id(r) not in drawn],
        table=tables.scene_table(group, runs),
        signals=draw_records(group),
    )


def _truth(group: Sequence[Record]) -> str:
    """Return how well the references of a scene's records are known, worst first."""
    worst: dict[str | None, float] = {}
    for record in group:
        if record.uncertainty is not None:
            worst[record.uncertainty_kind] = max(record.uncertainty, worst.get(record.uncertainty_kind, 0.0))
    ordered = sorted(worst.items(), key=lambda item: -item[1])
    return "; ".join(certainty(uncertainty, kind) for kind, uncertainty in ordered)


def _troubles(records: Sequence[Record]) -> list[Trouble]:
    techniques: dict[tuple[str, str, str, str], list[str]] = {}
    for record in records:
        if record.status != "ok":
            key = (record.run, record.scene, record.status, record.error or "no reason was recorded")
            techniques.setdefault(key, []).append(record.technique)
    return [Trouble(*key, names) for key, names in techniques.items()]


def _absence(record: Record) -> str:
    """Return why a record is not on the chart."""
    if record.status != "ok":
        reason = record.status
    elif record.timing is None:
        reason = "not timed"
    else:
        score = record.metrics.get("rmse")
        reason = f"RMSE {score.status.replace('_', ' ')}" if score else "RMSE not measured"
    return f"{record.technique} ({reason})"


def _heat_ticks() -> list[str]:
    ticks, value = [], HEAT_LOW
    while value <= HEAT_HIGH * 1.001:
        ticks.append(f"{value:g}")
        value *= 10
    return ticks
