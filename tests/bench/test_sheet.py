"""The contact sheet: pictures at their own pixels, reasons where there are none, and a page that shows all."""

import itertools
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from aliasbench.bench.sheet import COLUMNS, FILM, LINE, MARGIN, make_sheet
from aliasbench.renderers.technique import parse_technique
from aliasbench.scenes.catalog import SCENES
from aliasbench.scenes.errors import InputError, UnsupportedScene
from aliasbench.scenes.model import Camera, Scene
from aliasbench.scenes.textures import linear_to_srgb

Run = Callable[..., tuple[int, str, str]]
SIZE = (40, 24)


@pytest.mark.usefixtures("fakes")
class TestSheet:
    def test_pictures_are_there_pixel_for_pixel_in_the_order_of_the_columns(
        self, tmp_path: Path, pixels_of: Callable[..., np.ndarray]
    ) -> None:
        sheet = make_sheet(["one"], tmp_path, size=SIZE, frame=3)
        image = np.asarray(Image.open(sheet.images[0]))
        assert image.shape == (SIZE[1] + 2 * LINE + 2 * MARGIN, 3 * SIZE[0] + 4 * MARGIN, 3)
        for place, (technique, _) in enumerate(COLUMNS):
            pixels = pixels_of(Scene("one", Camera("orthographic")), parse_technique(technique), SIZE, 3, 0)
            shown = np.rint(linear_to_srgb(pixels.astype(np.float32)) * 255)
            left, top = MARGIN + place * (SIZE[0] + MARGIN), MARGIN + 2 * LINE
            # The reference's pixels are float64, one rounding less: a step of 1 at most.
            found = image[top : top + SIZE[1], left : left + SIZE[0]].astype(int)
            assert np.abs(found - shown).max() <= (technique == "reference:")

    def test_every_scene_is_in_the_overview_and_on_the_page(self, tmp_path: Path) -> None:
        names = [f"scene-{k}" for k in range(31)] + ["<b>&", "a/b", "a:b"]
        told: list[str] = []
        sheet = make_sheet(names, tmp_path / "new", size=SIZE, on_step=told.append)
        assert len(told) == 3 * len(names)
        assert told[4] == "[4/102] scene-1 by raster:"
        assert len({path.name for path in sheet.images}) == len(names)
        page = sheet.index.read_text(encoding="utf-8")
        assert page.count("<h2>") == page.count("<img ") == len(names)
        assert "<h2>&lt;b&gt;&amp;</h2>" in page
        assert all(f'src="{path.name}"' in page for path in sheet.images)
        with Image.open(sheet.overview) as overview:
            cells = (overview.width // (3 * SIZE[0] + 4 * MARGIN), overview.height // (SIZE[1] + 2 * LINE + 2 * MARGIN))
        assert cells[0] * cells[1] >= len(names)
        assert {path.name for path in (tmp_path / "new").iterdir()} == {
            *("index.html", "overview.png"),
            *(path.name for path in sheet.images),
        }

    def test_what_cannot_be_drawn_is_a_grey_field_with_the_reason(self, tmp_path: Path, fakes) -> None:
        fakes.fail = lambda _, technique, __: UnsupportedScene("no <fog>") if technique == "raster:" else None
        sheet = make_sheet(["one"], tmp_path, size=SIZE)
        assert [panel.reason for panel in sheet.rows[0].panels] == [None, "no <fog>", None]
        left, top = MARGIN + SIZE[0] + MARGIN, MARGIN + 2 * LINE
        field = np.asarray(Image.open(sheet.images[0]))[top : top + SIZE[1], left : left + SIZE[0]]
        assert (field == 216).all(axis=2).mean() > 0.5
        assert (field < 100).any()
        assert "no &lt;fog&gt;" in sheet.index.read_text(encoding="utf-8")

    def test_the_command_prints_paths_and_progress_apart(self, run: Run, tmp_path: Path) -> None:
        arguments = ("scenes", "sheet", "-o", str(tmp_path / "out"), "--size", "16x16", "one", "two")
        code, out, err = run(*arguments)
        assert code == 0
        names = ("index.html", "overview.png", "one.png", "two.png")
        assert out.splitlines() == [str(tmp_path / "out" / name) for name in names]
        assert err.splitlines()[0] == "[0/6] one by raytrace:"
        found = json.loads(run(*arguments, "--json")[1])
        assert found["index"] == str(tmp_path / "out" / "index.html")
        assert [row["scene"] for row in found["scenes"]] == ["one", "two"]
        assert [panel["ok"] for panel in found["scenes"][0]["panels"]] == [True, True, True]

    def test_a_folder_that_cannot_be_written_is_refused_before_anything_is_drawn(
        self, run: Run, tmp_path: Path, fakes
    ) -> None:
        (tmp_path / "file").write_text("x")
        code, out, err = run("scenes", "sheet", "one", "-o", str(tmp_path / "file"))
        assert (code, out) == (2, "")
        assert "it is a file; a folder is needed" in err
        assert fakes.log == []


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("", "required: -o/--output"),
        ("propeler -o OUT", "unknown scene 'propeler'; did you mean 'propeller'?"),
        ("propeller -o OUT --size 5000x16", "size 5000x16: width must be from 16 to 1024 on a sheet"),
        ("propeller -o OUT --size 16x8", "size 16x8: height must be from 16 to 1024 on a sheet"),
        ("propeller -o OUT --size 16", "'16' must be WIDTHxHEIGHT"),
    ],
)
def test_bad_usage_is_refused_and_leaves_nothing(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: str, said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, err = run("scenes", "sheet", *arguments.split())
    assert (code, out) == (2, "")
    assert said in err
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_without_names_the_sheet_is_of_the_whole_catalog(tmp_path: Path, fakes) -> None:
    sheet = make_sheet([], tmp_path, size=(16, 16))
    assert [row.scene for row in sheet.rows] == list(SCENES)
    assert [row.summary for row in sheet.rows] == [entry.summary for entry in SCENES.values()]
    assert len(fakes.log) == 3 * len(SCENES)


def test_real_renderers_draw_on_it(tmp_path: Path) -> None:
    sheet = make_sheet(["near-horizontal-edge", "glossy-floor"], tmp_path, size=(32, 24))
    assert all(panel.reason is None for panel in sheet.rows[0].panels)
    assert "certified to" in sheet.rows[0].panels[2].note
    with pytest.raises(InputError, match="size 15x24: width must be"):
        make_sheet([], tmp_path, size=(15, 24))


def test_what_turns_has_a_film_of_its_first_frames(tmp_path: Path) -> None:
    still, film = make_sheet(["edge-fan", "propeller:rev_per_s=30"], tmp_path, size=SIZE).rows
    assert still.film == ()
    assert len(film.film) == FILM
    assert all(np.array_equal(pixels, film.film[0]) for pixels in film.film), "it stands still"
    assert film.film[0].std() > 20
    with Image.open(tmp_path / "edge-fan.png") as short, Image.open(tmp_path / film.image) as long:
        assert long.height - short.height == LINE + MARGIN + film.film[0].shape[0]
    turning = make_sheet(["propeller"], tmp_path, size=SIZE).rows[0].film
    assert not any(np.array_equal(a, b) for a, b in itertools.pairwise(turning))
