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

from aliasbench.bench.truth import Reference, crop_radius, reference_technique, render_reference
from aliasbench.bench.whole_files import make_folder, write_files
from aliasbench.metrics.catalog import METRICS, find_metric, measure
from aliasbench.metrics.guide import GUIDE, NOTATION, Guide
from aliasbench.metrics.score import Metric, Score
from aliasbench.renderers import catalog
from aliasbench.reports.charts import number
from aliasbench.reports.figures import Picture, encode_film, encode_picture
from aliasbench.reports.guide_pairs import PAIRS, Pair, Shot
from aliasbench.reports.markup import make_environment
from aliasbench.scenes.files import load_scene

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
    takes: dict[tuple[Shot, int, int, int], _Take] = {}
    sections = []
    for place, metric in enumerate(chosen):
        pair = PAIRS.get(metric.name)
        shots = []
        for which in ("low", "high") if pair else ():
            assert pair is not None
            shot = pair.low if which == "low" else pair.high
            on_step(f"[{place}/{len(chosen)}] {metric.name}: {shot.scene} by {shot.technique}")
            key = (shot, pair.side, pair.frames, pair.seeds)
            if key not in takes:
                takes[key] = _take(shot, pair)
            shots.append(_show(metric, pair, shot, takes[key], which == better_shot(metric)))
        sections.append(MetricSection(metric, GUIDE[metric.name], BETTER_WORDS[metric.better], pair, shots))
    return sections


def better_shot(metric: Metric) -> str:
    """Return which of a pair is the better one, `low` or `high`."""
    return "low" if metric.better in ("lower", "zero") else "high"


def _take(shot: Shot, pair: Pair) -> _Take:
    scene, technique = load_scene(shot.scene), catalog.resolve_technique(shot.technique)
    size = (pair.side, pair.side)
    with catalog.prepare(scene, technique, size=size) as prepared:
        test = [
            [np.asarray(prepared.render(frame=n, seed=seed).pixels, np.float32) for n in range(pair.frames)]
            for seed in range(pair.seeds)
        ]
    truth = render_reference(scene, reference_technique(technique, "point"), size, pair.frames, lambda: None)
    return _Take(np.array(test), truth, crop_radius(technique))


def _show(metric: Metric, pair: Pair, shot: Shot, take: _Take, better: bool) -> ShownShot:
    scene = load_scene(shot.scene)
    score = measure(
        metric.name,
        take.test,
        take.truth.pixels,
        scene=scene,
        filter_radius_px=take.radius_px,
        reference_uncertainty=take.truth.uncertainty or 0.0,
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
