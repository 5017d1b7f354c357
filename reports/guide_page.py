"""The guide to the metrics: one HTML file that says what each means and shows a low and a high score of it.

Pictures are rendered when the page is made, and the scores under them are measured on them, so that no figure on the
page can be out of date. Everything is inside the one file; films are animated PNGs, which need no script.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aliasbench.bench.centers import center_frames, center_technique, center_truth, full_truth, own_truth, truths_of
from aliasbench.bench.quality import render_frames
from aliasbench.bench.suite import Case
from aliasbench.bench.truth import Reference, crop_radius, render_reference
from aliasbench.bench.whole_files import make_folder, write_files
from aliasbench.metrics.catalog import METRICS, find_metric, measure
from aliasbench.metrics.gate import Centers
from aliasbench.metrics.guide import GUIDE, NOTATION, Guide
from aliasbench.metrics.score import Metric, Score
from aliasbench.renderers import catalog
from aliasbench.renderers.technique import Technique
from aliasbench.reports.charts import number
from aliasbench.reports.figures import Picture, encode_film, encode_picture
from aliasbench.reports.guide_pairs import PAIRS, Pair, Shot
from aliasbench.reports.markup import make_environment
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import Scene

SHOWN_SIDE = 320  # CSS pixels of a picture's side: a whole number for each pixel
BETTER_WORDS = {
    "lower": "lower is better",
    "higher": "higher is better",
    "zero": "nearer to 0 is better",
    "truth": "nearer to the true figure is better",
}


@dataclass(frozen=True, slots=True)
class ShownShot:
    """One picture of a pair with its score; `still` stands for a film where motion is not wanted."""

    shot: Shot
    picture: Picture
    still: Picture
    score: Score
    text: str
    better: bool

    def as_data(self) -> dict[str, object]:
        """Return the same as plain data, without the pixels."""
        score = {"value": self.score.value, "status": self.score.status}
        return {"scene": self.shot.scene, "technique": self.shot.technique, "better": self.better, **score}


@dataclass(frozen=True, slots=True)
class MetricSection:
    """One metric as the page shows it; `shots` are low and high, empty where no pair is known."""

    metric: Metric
    guide: Guide
    better: str
    pair: Pair | None
    shots: Sequence[ShownShot]


@dataclass(frozen=True, slots=True, eq=False)
class _Take:
    """What was rendered of a shot: (seeds, frames, h, w, 3), its truth, and the pixels metrics cut off."""

    test: NDArray[np.float32]
    truth: Reference
    radius_px: float
    centers: Centers | None


def write_guide(
    out: Path, names: Iterable[str] = (), *, on_step: Callable[[str], None] = lambda _: None
) -> tuple[Path, list[MetricSection]]:
    """Write the page and return the path of its `index.html` and what is on it.

    Parameters
    ----------
    out : Path
        A folder, created where it is missing.
    names : iterable of str
        Of metrics; none means all.
    on_step : callable
        Is told what is drawn next.

    Raises
    ------
    InputError
        If a name is unknown or the page cannot be written; then an older page is still there.
    """
    chosen = [find_metric(name) for name in names] or list(METRICS.values())
    make_folder(Path(out))
    sections = draw_sections(chosen, on_step)
    (page,) = write_files(Path(out), {"index.html": render_page(sections).encode("utf-8")})
    return page, sections


def draw_sections(chosen: Sequence[Metric], on_step: Callable[[str], None] = lambda _: None) -> list[MetricSection]:
    """Return the metrics' sections, their pairs rendered and measured."""
    takes: dict[tuple[Shot, int, int, int, bool], _Take] = {}
    sections = []
    for place, metric in enumerate(chosen):
        pair = PAIRS.get(metric.name)
        shots = []
        for which in ("low", "high") if pair else ():
            assert pair is not None
            shot = pair.low if which == "low" else pair.high
            on_step(f"[{place}/{len(chosen)}] {metric.name}: {shot.scene} by {shot.technique}")
            split = "centers" in metric.needs
            key = (shot, pair.side, pair.frames, pair.seeds, split)
            if key not in takes:
                takes[key] = _take(shot, pair, split)
            shots.append(_show(metric, pair, shot, takes[key], which == better_shot(metric)))
        sections.append(MetricSection(metric, GUIDE[metric.name], BETTER_WORDS[metric.better], pair, shots))
    return sections


def better_shot(metric: Metric) -> str:
    """Return which of a pair is the better one, `low` or `high`."""
    return "low" if metric.better in ("lower", "zero") else "high"


def _take(shot: Shot, pair: Pair, split: bool) -> _Take:
    """Render a shot and its truth; with `split` also what tells errors in space from errors in time."""
    scene, technique = load_scene(shot.scene), catalog.resolve_technique(shot.technique)
    size, seeds = (pair.side, pair.side), tuple(range(pair.seeds))
    names = ("spatial", "temporal", "shutter") if split else ()
    case = Case("", scene, technique, size, pair.frames, seeds, 1, names, "point")
    own = own_truth(case)
    rendered = [_rendered(scene, technique, case)]
    truths = {t.name: render_reference(t.scene, t.technique, size, t.frames, lambda: None) for t in truths_of(case)}
    truth, centers = truths[own.name], None
    middle, full = center_truth(case), full_truth(case)
    if middle is not None and full is not None:
        if center_frames(case):
            rendered.append(_rendered(scene, center_technique(case), case))
        at_center, whole = truths[middle.name], truths[full.name]
        bounds = (at_center.uncertainty or 0.0, whole.uncertainty or 0.0)
        centers = Centers(rendered[-1], at_center.pixels, whole.pixels, *bounds)
    return _Take(rendered[0], truth, crop_radius(technique), centers)


def _rendered(scene: Scene, technique: Technique, case: Case) -> NDArray[np.float32]:
    """Return (seeds, frames, h, w, 3)."""
    with catalog.prepare(scene, technique, size=case.size) as prepared:
        pictures, _ = render_frames(case, prepared, lambda: None)
    return pictures if pictures.ndim == 5 else pictures[None]


def _show(metric: Metric, pair: Pair, shot: Shot, take: _Take, better: bool) -> ShownShot:
    scene = load_scene(shot.scene)
    score = measure(
        metric.name,
        take.test,
        take.truth.pixels,
        scene=scene,
        filter_radius_px=take.radius_px,
        reference_uncertainty=take.truth.uncertainty or 0.0,
        centers=take.centers,
    )
    exposure = 1.0 / scene.contrast if scene.contrast > 1.0 else 1.0
    still = encode_picture(take.test[0, 0], exposure)
    film = encode_film(take.test[0], pair.frame_ms, exposure) if pair.frames > 1 else still
    return ShownShot(shot, film, still, score, score_text(score), better)


def score_text(score: Score) -> str:
    """Return a score in words: the number, or why there is none."""
    return score.status.replace("_", " ") if score.value is None else number(score.value).replace("-", "−")


def render_page(sections: Sequence[MetricSection]) -> str:
    """Return the whole page as text."""
    resources = files("aliasbench.reports")
    return (
        make_environment()
        .get_template("guide.html.j2")
        .render(
            sections=sections,
            notation=NOTATION,
            side=SHOWN_SIDE,
            style=(resources / "style.css").read_text(encoding="utf-8") + (resources / "guide.css").read_text("utf-8"),
        )
    )
