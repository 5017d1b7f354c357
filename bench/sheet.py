"""A contact sheet: every scene point sampled by both renderers beside its reference, to see what each scene shows.

Pictures stand at their own pixels, never resized: a resized picture of aliasing shows the resizing. What a renderer
cannot draw is a grey field with the reason in it, so that the sheet says what is missing and why. What strobes shows
in time alone: under a scene with a rotor stands a film of its first frames.
"""

import io
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from aliasbench.bench.whole_files import make_folder, write_files
from aliasbench.bench.wording import certainty, duration, printable, shortened
from aliasbench.scenes.catalog import SCENES
from aliasbench.scenes.errors import InputError, UnsupportedScene
from aliasbench.scenes.model import Scene
from aliasbench.scenes.textures import linear_to_srgb
from aliasbench.scenes.toml_text import free_file_name, safe_file_name

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageFont import FreeTypeFont, ImageFont

COLUMNS = (
    ("raytrace:", "ray tracer, 1 sample"),
    ("raster:", "rasterizer, 1 sample"),
    ("reference:", "reference"),
)
FILM = 8  # frames of a film
LEAST_SIDE, MOST_SIDE = 16, 1024  # pixels of a picture
OVERVIEW_WIDTH = 1700  # pixels: as many scenes stand side by side as fit
MARGIN, LINE = 10, 18  # pixels around things, and of a line of text
PAPER, INK, GREY = (255, 255, 255), (20, 20, 20), (216, 216, 216)
Pixels = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Panel:
    """One picture of a sheet: `pixels` (h, w, 3) are sRGB bytes, None where `reason` says why there are none."""

    technique: str
    title: str
    pixels: Pixels | None
    note: str
    reason: str | None = None


@dataclass(frozen=True, slots=True)
class Row:
    """One scene of a sheet; `film` has its first frames side by side, point sampled, or is empty."""

    scene: str
    summary: str
    image: str
    panels: Sequence[Panel]
    film: Sequence[Pixels] = ()


@dataclass(frozen=True, slots=True)
class Sheet:
    """The files of a sheet and what is on it."""

    index: Path
    overview: Path
    images: Sequence[Path]
    rows: Sequence[Row]

    def as_data(self) -> dict[str, object]:
        """Return the same as plain data, without the pixels."""
        rows = [
            {
                "scene": row.scene,
                "image": str(path),
                "panels": [
                    {"technique": p.technique, "ok": p.reason is None, "note": p.note, "reason": p.reason}
                    for p in row.panels
                ],
            }
            for row, path in zip(self.rows, self.images, strict=True)
        ]
        return {"index": str(self.index), "overview": str(self.overview), "scenes": rows}


def make_sheet(
    names: Sequence[str],
    out: Path,
    *,
    size: tuple[int, int],
    frame: int = 0,
    on_step: Callable[[str], None] = lambda _: None,
) -> Sheet:
    """Draw scenes by both renderers and the reference, and write a PNG for each, an overview and an `index.html`.

    Parameters
    ----------
    names : sequence of str
        Of the catalog, or paths of files; none means the whole catalog.
    out : Path
        A folder, created where it is missing.
    size : (width, height)
        Of each picture, in pixels.
    frame : int
        Of the scenes' animations, the same of each: what shows in time alone, strobing, shows between sheets of two.
    on_step : callable
        Is told what is drawn next.

    Raises
    ------
    InputError
        If a scene is none, or the files cannot be written; then none was.
    """
    from aliasbench.scenes.files import load_scene

    for name, side in zip(("width", "height"), size, strict=True):
        if not LEAST_SIDE <= side <= MOST_SIDE:
            raise InputError(f"size {size[0]}x{size[1]}: {name} must be from {LEAST_SIDE} to {MOST_SIDE} on a sheet")
    scenes = [load_scene(name) for name in names or SCENES]
    make_folder(out)
    taken = ["overview.png"]
    rows = []
    for number, scene in enumerate(scenes):
        panels = []
        for place, (technique, title) in enumerate(COLUMNS):
            step = number * len(COLUMNS) + place
            on_step(f"[{step}/{len(scenes) * len(COLUMNS)}] {scene.name} by {technique}")
            panels.append(_draw(scene, technique, title, size, frame))
        film = _draw_film(scene, size, frame) if scene.facts.rotors else ()
        taken.append(free_file_name(safe_file_name(scene.name), ".png", taken))
        rows.append(Row(scene.name, _summary(scene), taken[-1], panels, film))
    contents = {row.image: _png(_paste_rows([row], size, columns=1)) for row in rows}
    width = 2 * MARGIN + _row_width(size)
    contents["overview.png"] = _png(_paste_rows(rows, size, columns=max(1, OVERVIEW_WIDTH // width)))
    contents["index.html"] = _page(rows, size, frame).encode("utf-8")
    *images, overview, index = write_files(out, contents)
    return Sheet(index, overview, images, rows)


def _draw(scene: Scene, technique: str, title: str, size: tuple[int, int], number: int) -> Panel:
    from aliasbench.renderers import catalog

    try:
        with catalog.prepare(scene, technique, size=size) as prepared:
            frame = prepared.render(frame=number, seed=0)
    except (UnsupportedScene, InputError) as error:
        return Panel(technique, title, None, "", str(error))
    known = "" if frame.uncertainty is None else f", {certainty(frame.uncertainty, frame.uncertainty_kind)}"
    return Panel(technique, title, _bytes(frame.pixels), f"{duration(frame.seconds)}{known}")


def _draw_film(scene: Scene, size: tuple[int, int], first: int) -> list[Pixels]:
    """Return the ray tracer's point samples of `FILM` frames, small enough to stand in one row."""
    from aliasbench.renderers import catalog

    width = (_row_width(size) - (FILM - 1) * MARGIN) // FILM
    small = (max(1, width), max(1, round(width * size[1] / size[0])))
    try:
        with catalog.prepare(scene, COLUMNS[0][0], size=small) as prepared:
            return [_bytes(prepared.render(frame=first + n, seed=0).pixels) for n in range(FILM)]
    except (UnsupportedScene, InputError):
        return []  # the panel of this renderer says why


def _bytes(pixels: NDArray[np.floating]) -> Pixels:
    return np.rint(linear_to_srgb(pixels) * 255).astype(np.uint8)


def _summary(scene: Scene) -> str:
    entry = SCENES.get(scene.name.partition(":")[0])
    return entry.summary if entry is not None else ""


def _row_width(size: tuple[int, int]) -> int:
    return len(COLUMNS) * size[0] + (len(COLUMNS) - 1) * MARGIN


def _paste_rows(rows: Sequence[Row], size: tuple[int, int], *, columns: int) -> "Image":
    """Return rows of panels under their names, `columns` scenes side by side."""
    from PIL import Image

    columns = min(columns, max(1, len(rows)))
    width = _row_width(size) + 2 * MARGIN
    down = -(-len(rows) // columns)
    # Down the columns: the catalog's order is read in them.
    stacks = [rows[k * down : (k + 1) * down] for k in range(columns)]
    heights = [sum(_row_height(row, size) for row in stack) for stack in stacks]
    image = Image.new("RGB", (columns * width, max([1, *heights])), PAPER)
    for column, stack in enumerate(stacks):
        top = 0
        for row in stack:
            _paste_row(image, row, (column * width + MARGIN, top + MARGIN), size)
            top += _row_height(row, size)
    return image


def _row_height(row: Row, size: tuple[int, int]) -> int:
    film = LINE + MARGIN + row.film[0].shape[0] if row.film else 0
    return size[1] + 2 * LINE + 2 * MARGIN + film


def _paste_row(image: "Image", row: Row, corner: tuple[int, int], size: tuple[int, int]) -> None:
    from PIL import Image, ImageDraw

    large, small = _font(14), _font(11)
    draw = ImageDraw.Draw(image)
    x, y = corner
    draw.text((x, y), _fitted(printable(row.scene), large, _row_width(size)), INK, large)
    for place, panel in enumerate(row.panels):
        left, top = x + place * (size[0] + MARGIN), y + 2 * LINE
        draw.text((left, top - LINE), _fitted(_spaced(panel.title), small, size[0]), INK, small)
        if panel.pixels is not None:
            image.paste(Image.fromarray(panel.pixels), (left, top))
            continue
        draw.rectangle((left, top, left + size[0] - 1, top + size[1] - 1), fill=GREY)
        text = textwrap.fill(printable(panel.reason or ""), max(8, size[0] // 7))
        lines = text.splitlines()[: max(1, (size[1] - 12) // 15)]
        draw.multiline_text((left + 6, top + 6), _spaced("\n".join(lines)), INK, small, spacing=3)
    if row.film:
        top = y + 2 * LINE + size[1] + MARGIN
        draw.text((x, top), _spaced(f"{COLUMNS[0][1]}, {FILM} frames in turn"), INK, small)
        for number, pixels in enumerate(row.film):
            image.paste(Image.fromarray(pixels), (x + number * (pixels.shape[1] + MARGIN), top + LINE))


def _font(size: int) -> "FreeTypeFont | ImageFont":
    from PIL import ImageFont

    return ImageFont.load_default(size)


def _spaced(text: str) -> str:
    return text.replace(" ", "  ")  # small, the font's single space can hardly be seen


def _fitted(text: str, font: "FreeTypeFont | ImageFont", width: int) -> str:
    """Return as much of a text as is no wider than `width` pixels."""
    while text and font.getlength(text) > width:
        text = text[:-2].rstrip("…") + "…" if len(text) > 2 else ""
    return text


def _png(image: "Image") -> bytes:
    out = io.BytesIO()
    image.save(out, "PNG")
    return out.getvalue()


def _page(rows: Sequence[Row], size: tuple[int, int], frame: int) -> str:
    import jinja2

    template = files("aliasbench.bench").joinpath("templates/sheet.html.j2").read_text(encoding="utf-8")
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    shown = [
        {
            "name": printable(row.scene),
            "alt": f"{shortened(printable(row.scene))}: point sampled by ray tracer and rasterizer, and the reference",
            "summary": row.summary,
            "image": row.image,
            "panels": row.panels,
        }
        for row in rows
    ]
    return environment.from_string(template).render(rows=shown, size=size, frame=frame)
