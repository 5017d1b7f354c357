"""The pictures of a scene side by side: the reference, every technique, and the error map of each.

Pictures are cropped and never scaled, because resampling is the very thing under test; when a run has more pictures
than a page can carry, the crop gets smaller until the page is of a sane size.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aliasbench.bench.frames import read_image
from aliasbench.reports import figures
from aliasbench.reports.charts import number
from aliasbench.reports.figures import FloatImage, Picture
from aliasbench.reports.records import Record
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.files import load_scene

# The side of the crop in pixels, tried in this order, and the characters that all pictures together may take.
CROP_SIDES = (256, 128, 64)
PICTURE_BUDGET = 9_000_000
CLOSE_UP = (32, 16)


@dataclass(frozen=True, slots=True)
class Panel:
    """One tile: what it shows, its pictures (None where there is none, `problem` says why) and its figures in words."""

    title: str
    renderer: str
    picture: Picture | None
    heat: Picture | None
    facts: str
    problem: str


@dataclass(frozen=True, slots=True)
class Gallery:
    """All tiles of a scene; `region` is (left, top) of the first close-up, `crop` says what of the picture is shown."""

    panels: Sequence[Panel]
    region: tuple[int, int]
    scale: int
    crop: str
    exposure: str

    @property
    def has_heat(self) -> bool:
        """Whether any tile has an error map."""
        return any(panel.heat for panel in self.panels)


def make_galleries(groups: Sequence[Sequence[Record]], runs: Sequence[str]) -> list[Gallery]:
    """Return one gallery for each scene's records, all together within the budget of a page where that is possible."""
    galleries: list[Gallery] = []
    for side in CROP_SIDES:
        galleries = [_make_gallery(group, runs, side) for group in groups]
        pictures = [p for g in galleries for panel in g.panels for p in (panel.picture, panel.heat) if p]
        if sum(len(p.uri) for p in pictures) <= PICTURE_BUDGET:
            break
    return galleries


def _make_gallery(group: Sequence[Record], runs: Sequence[str], side: int) -> Gallery:
    contrast = scene_contrast(group[0].scene)
    exposure = 1.0 / contrast if contrast > 1.0 else 1.0
    read: dict[Path, FloatImage | str] = {}
    panels: list[Panel] = []
    references: dict[str, Panel] = {}
    errors: list[FloatImage] = []
    tests: list[FloatImage] = []
    for record in group:
        test = _image(record, "frame", side, read)
        truth = _image(record, "reference", side, read)
        if not isinstance(test, str):
            tests.append(test.max(axis=2))
        heat = None
        if not isinstance(truth, str):
            picture = figures.encode_picture(truth, exposure)
            references.setdefault(picture.uri, Panel("reference", "reference", picture, None, record.short, ""))
            if not isinstance(test, str) and test.shape == truth.shape:
                heat = figures.encode_heat_map(test, truth, contrast)
                errors.append(np.abs(test - truth).max(axis=2))
        panels.append(_technique_panel(record, test, heat, exposure, runs))
    shown = next((p.picture for p in (*references.values(), *panels) if p.picture), None)
    compared = errors or tests
    same = [e for e in compared if e.shape == compared[0].shape]
    width, height = (shown.width, shown.height) if shown else (0, 0)
    cropped = shown is not None and (width, height) != group[0].size
    return Gallery(
        panels=[*_reference_panels(list(references.values())), *panels],
        region=figures.most_telling_region(same, *CLOSE_UP),
        scale=max(1, CROP_SIDES[0] // max(width, height, 1)),
        crop=f"the central {width} × {height} pixels of {group[0].size[0]} × {group[0].size[1]}" if cropped else "",
        exposure=f"brightness divided by the scene's contrast of {number(contrast)}" if contrast > 1.0 else "",
    )


def scene_contrast(scene: str) -> float:
    """Return the contrast that a scene declares, 1 where it cannot be loaded here (a file of another machine)."""
    try:
        contrast = load_scene(scene).contrast
    except (InputError, OSError):
        return 1.0
    return contrast if contrast > 0 else 1.0


def _reference_panels(references: Sequence[Panel]) -> list[Panel]:
    """Return the reference tiles; where techniques have different filters, each says whose reference it is."""
    if len(references) == 1:
        return [Panel("reference", "reference", references[0].picture, None, "exact, or with a known error bound", "")]
    return [Panel("reference", "reference", p.picture, None, f"for {p.facts} and its like", "") for p in references]


def _image(record: Record, kind: str, side: int, read: dict[Path, FloatImage | str]) -> FloatImage | str:
    """Return the cropped image of a record, or the sentence that says why there is none."""
    name = record.images.get(kind)
    if name is None:
        return "no picture was kept"
    path = record.folder / name
    if path not in read:
        try:
            read[path] = read_image(path)
        except InputError:
            read[path] = f"picture {name} is missing or cannot be read"
    image = read[path]
    return image if isinstance(image, str) else figures.crop_to(image, side)


def _technique_panel(
    record: Record, test: FloatImage | str, heat: Picture | None, exposure: float, runs: Sequence[str]
) -> Panel:
    facts = []
    rmse = record.metrics.get("rmse")
    if rmse and rmse.value is not None:
        facts.append(f"RMSE {number(rmse.value)}")
    elif rmse and rmse.floor:
        facts.append(f"RMSE < {number(rmse.floor)}")
    elif rmse and record.status == "ok":
        facts.append(f"RMSE {rmse.status.replace('_', ' ')}")
    if record.timing:
        facts.append(f"{number(record.timing.median_s * 1e3)} ms")
    if len(runs) > 1:
        facts.append(record.run)
    problem = ""
    if record.status != "ok":
        problem = f"{record.status}: {record.error}" if record.error else record.status
    elif isinstance(test, str):
        problem = test
    picture = None if isinstance(test, str) else figures.encode_picture(test, exposure)
    return Panel(record.technique, record.renderer, picture, heat, " · ".join(facts), problem)
