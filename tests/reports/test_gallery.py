"""Laws of the pictures side by side: pixels are never resampled, missing ones say why, the page stays small."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aliasbench.reports import gallery
from aliasbench.reports.records import load_runs

MakeRecord = Callable[..., dict[str, Any]]
Fabricate = Callable[..., Path]

PICTURES = {"frame": "frames/test.exr", "reference": "frames/ref.exr"}


def make_one(run_dir: Path) -> gallery.Gallery:
    (run,) = load_runs([run_dir])
    (made,) = gallery.make_galleries([run.records], ["run"])
    return made


def test_the_reference_comes_first_and_every_record_has_a_tile(typical: Path) -> None:
    made = make_one(typical)
    assert [p.title for p in made.panels] == [
        "reference",
        "raytrace:",
        "raytrace:spp=16,sampler=jittered",
        "raster:msaa=4",
        "raster:",
        "raster:msaa=16",
        "raster:ssaa=2",
    ]
    assert [p.heat is not None for p in made.panels] == [False, True, True, True, True, False, False]
    assert made.scale == 4
    assert made.panels[5].problem == "failed: 16 samples are more than this device has"
    assert made.panels[6].problem == "unsupported: the rasterizer has no dispersion"
    assert made.panels[1].facts == "RMSE 0.0800 · 2.02 ms"


def test_missing_pictures_leave_a_sentence(fabricate: Fabricate, make_record: MakeRecord) -> None:
    rows = [make_record("s", "raster:", images=PICTURES), make_record("s", "raytrace:")]
    made = make_one(fabricate(rows, pictures={"frames/ref.exr": np.zeros((64, 64, 3), np.float32)}))
    assert [p.picture is not None for p in made.panels] == [True, False, False]
    assert made.panels[1].problem == "picture frames/test.exr is missing or cannot be read"
    assert made.panels[2].problem == "no picture was kept"


def test_pictures_of_other_sizes_are_shown_without_an_error_map(fabricate: Fabricate, make_record: MakeRecord) -> None:
    pictures = {"frames/ref.exr": np.zeros((64, 64, 3)), "frames/test.exr": np.ones((32, 64, 3))}
    made = make_one(fabricate([make_record("s", "raster:", images=PICTURES)], pictures=pictures))
    assert made.panels[1].picture is not None
    assert made.panels[1].heat is None
    assert not made.has_heat


def test_different_references_are_all_shown(fabricate: Fabricate, make_record: MakeRecord) -> None:
    pictures = {f"frames/{n}.exr": np.full((8, 8, 3), n / 4) for n in range(3)}
    rows = [
        make_record("s", f"raster:msaa={n}", images={"frame": "frames/0.exr", "reference": f"frames/{n}.exr"})
        for n in (1, 2)
    ]
    made = make_one(fabricate(rows, pictures=pictures))
    assert [p.facts for p in made.panels[:2]] == ["for 1× MSAA and its like", "for 2× MSAA and its like"]


def test_large_pictures_are_cropped_and_the_caption_says_so(fabricate: Fabricate, make_record: MakeRecord) -> None:
    row = make_record("s", "raster:", images=PICTURES, size=[300, 40])
    made = make_one(fabricate([row], pictures={f"frames/{n}.exr": np.ones((40, 300, 3)) for n in ("ref", "test")}))
    picture = made.panels[1].picture
    assert picture is not None
    assert (picture.width, picture.height, made.scale) == (256, 40, 1)
    assert made.crop == "the central 256 × 40 pixels of 300 × 40"


def test_the_crop_shrinks_until_the_page_is_of_a_sane_size(
    fabricate: Fabricate, make_record: MakeRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    noise = np.random.default_rng(0).random((256, 256, 3))
    row = make_record("s", "raster:", images=PICTURES, size=[256, 256])
    run_dir = fabricate([row], pictures={"frames/ref.exr": noise, "frames/test.exr": noise[::-1]})
    monkeypatch.setattr(gallery, "PICTURE_BUDGET", 250_000)
    made = make_one(run_dir)
    pictures = [p for panel in made.panels for p in (panel.picture, panel.heat) if p]
    assert {p.width for p in pictures} == {128}
    assert sum(len(p.uri) for p in pictures) <= 250_000
    assert "128 × 128" in made.crop


def test_contrast_is_the_scenes_own_and_1_where_it_is_unknown(tmp_path: Path) -> None:
    scene = tmp_path / "bright.toml"
    scene.write_text(
        'schema = 1\nname = "bright"\ncontrast = 4.0\n[camera]\nprojection = "orthographic"\n'
        "position = [0, 0, 5]\ntarget = [0, 0, 0]\nup = [0, 1, 0]\nheight = 2.0\n"
        "[[object]]\npolygon = [[-1, -1, 0], [1, -1, 0], [0, 1, 0]]\n",
        encoding="utf-8",
    )
    assert gallery.scene_contrast(str(scene)) == 4.0
    assert gallery.scene_contrast("no such scene") == 1.0
