"""Laws of the page: one file that needs nothing else, says everything, and survives any name and any run."""

import re
from collections import Counter
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aliasbench.metrics.catalog import METRICS
from aliasbench.metrics.guide import GUIDE
from aliasbench.reports.page import write_report
from aliasbench.scenes.errors import InputError

MakeRecord = Callable[..., dict[str, Any]]
Fabricate = Callable[..., Path]

VOID = {"meta", "link", "img", "input", "br", "hr"}


class Page(HTMLParser):
    """The page as counts of tags, all attributes, and the text outside scripts and styles; unbalanced tags fail."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: Counter[str] = Counter()
        self.attributes: list[tuple[str, str, str]] = []
        self.words: list[str] = []
        self.open: list[str] = []
        self.feed(text)
        self.close()
        assert not self.open
        self.text = re.sub(r"\s+", " ", " ".join(self.words))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags[tag] += 1
        self.attributes += [(tag, name, value or "") for name, value in attrs]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] not in ("script", "style"):
            self.words.append(data)


def report(run_dirs: list[Path], out: Path) -> Page:
    path = write_report(run_dirs, out)
    assert path == out / "index.html"
    return Page(path.read_text(encoding="utf-8"))


def test_the_page_needs_nothing_outside_itself(typical: Path, tmp_path: Path) -> None:
    page = report([typical], tmp_path / "out")
    links = [value for _, name, value in page.attributes if name in ("src", "href", "srcset", "action", "data")]
    assert len(links) > 10
    assert all(link.startswith(("data:", "#")) for link in links)
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["index.html"]


def test_the_chart_library_is_embedded_once(typical: Path, tmp_path: Path) -> None:
    text = write_report([typical], tmp_path).read_text(encoding="utf-8")
    assert text.count("* plotly.js v") == 1


def test_the_header_names_machine_suite_and_counts(typical: Path, tmp_path: Path) -> None:
    page = report([typical], tmp_path)
    for words in ("Testium 9000", "softpipe", "4.4.0", "suite quick", "6 cases", "4 ok", "1 failed", "1 unsupported"):
        assert words in page.text


def test_every_case_is_on_the_page_with_its_reason(typical: Path, tmp_path: Path) -> None:
    page = report([typical], tmp_path)
    for words in ("16 samples are more than this device has", "the rasterizer has no dispersion", "not applicable"):
        assert words in page.text + " ".join(value for _, name, value in page.attributes if name == "title")
    for technique in ("raytrace:", "raytrace:spp=16,sampler=jittered", "raster:msaa=4", "raster:", "raster:ssaa=2"):
        # a tile, a row of the scene, a row of all records, a row of the overview
        assert page.words.count(technique) >= 4


def test_the_page_says_what_its_columns_mean(typical: Path, fabricate: Fabricate, tmp_path: Path) -> None:
    page = report([typical], tmp_path / "out")
    for name in METRICS:
        # of the metrics in the records of that run, and of no other
        assert (GUIDE[name].meaning in page.text) == (name in ("rmse", "jaggies", "strobing"))
    empty = report([fabricate([], "empty")], tmp_path / "none")
    assert "What the columns mean" in page.text
    assert "What the columns mean" not in empty.text


def test_links_to_scenes_say_the_size_where_it_tells_them_apart(
    fabricate: Fabricate, make_record: MakeRecord, tmp_path: Path
) -> None:
    runs = [fabricate([make_record("a", "raster:", size=[side, side])], f"r{side}") for side in (32, 64)]
    text = write_report([*runs, fabricate([make_record("b", "raster:")], "rb")], tmp_path).read_text(encoding="utf-8")
    links = re.findall(r'<a href="#scene-\d+">([^<]*)</a>', text)
    assert links == ["a 32 × 32", "a 64 × 64", "b"]


def test_how_well_a_reference_is_known_stands_beside_its_scene(
    fabricate: Fabricate, make_record: MakeRecord, tmp_path: Path
) -> None:
    records = [
        make_record("a", "raster:", uncertainty=2e-6, uncertainty_kind="bound"),
        make_record("a", "raytrace:", uncertainty=7e-4, uncertainty_kind="confidence"),
        make_record("b", "raster:", uncertainty=None),
    ]
    text = write_report([fabricate(records, "r")], tmp_path).read_text(encoding="utf-8")
    assert text.count("reference 99 % confident to 0.0007; certified to 2e-06") == 1
    assert text.count("· reference") == 1


def test_points_that_a_logarithmic_axis_cannot_show_are_named(typical: Path, tmp_path: Path) -> None:
    page = report([typical], tmp_path)
    assert re.search(r"no error that could be measured.*1 sample \(equal to the reference, 10\.1 ms\)", page.text)
    assert "Not on the chart: raster:msaa=16 (failed), raster:ssaa=2 (unsupported)" in page.text


def test_every_picture_has_an_error_map_and_a_description(typical: Path, tmp_path: Path) -> None:
    page = report([typical], tmp_path)
    kinds = Counter(value for tag, name, value in page.attributes if (tag, name) == ("img", "class"))
    assert kinds == {"picture": 5, "heat": 4}
    assert [value for tag, name, value in page.attributes if (tag, name) == ("img", "alt")].count("disc: raster:") == 1


@pytest.mark.parametrize(
    "name", ["<script>alert(1)</script>", '"><img src=x onerror=alert(1)>', "Größe & 测试 'ü'", "{{ 7 * 7 }}"]
)
def test_names_are_text_whatever_they_hold(
    fabricate: Fabricate, make_record: MakeRecord, make_score: MakeRecord, tmp_path: Path, name: str
) -> None:
    row = make_record(name, f"raster:post={name}", error=name, metrics={"rmse": make_score(0.1), name: make_score(1.0)})
    failed = row | {"status": "failed", "seconds": []}
    run = fabricate([row, failed], suite=name, machine={name: name}, pictures={"f.exr": np.zeros((4, 4, 3))})
    page = report([run], tmp_path / "out")
    assert page.tags["script"] == 3
    assert page.tags["img"] == 0
    assert page.words.count(name) >= 6
    assert not [a for a in page.attributes if a[1].startswith("on")]


def test_an_empty_run_gives_a_page_that_says_so(fabricate: Fabricate, tmp_path: Path) -> None:
    page = report([fabricate([])], tmp_path / "out")
    assert "There are no records in this run yet." in page.text
    assert "0 cases" in page.text
    assert page.tags["table"] == 0


def test_a_run_of_failures_gives_a_page_without_charts(
    fabricate: Fabricate, make_record: MakeRecord, tmp_path: Path
) -> None:
    rows = [
        make_record("s", f"raster:msaa={n}", status="failed", error=f"reason {n}", seconds=[], metrics={})
        for n in (2, 4)
    ]
    page = report([fabricate(rows)], tmp_path / "out")
    assert "2 failed" in page.text
    assert page.text.count("reason 2") >= 3
    assert "failed s : reason 2 raster:msaa=2 failed s : reason 4 raster:msaa=4" in page.text
    assert not [a for a in page.attributes if a[1:] == ("class", "chart")]
    assert "so there is no chart" in page.text


def test_several_runs_are_shown_together_each_with_its_label(
    fabricate: Fabricate, make_record: MakeRecord, tmp_path: Path
) -> None:
    before, after = (fabricate([make_record("s", "raster:")], name) for name in ("before", "after"))
    page = report([before, after], tmp_path / "out")
    for label in ("before", "after"):
        assert page.words.count(label) >= 3
    assert page.text.count("rasterizer ·") == 0
    assert '"name": "rasterizer \\u00b7 before"' in (tmp_path / "out/index.html").read_text(encoding="utf-8")


def test_an_unfinished_run_is_marked(fabricate: Fabricate, make_record: MakeRecord, tmp_path: Path) -> None:
    run = fabricate([make_record("s", "raster:")], unfinished=3, started="2026-01-02T03:04:05Z")
    page = report([run], tmp_path / "out")
    assert "run is not finished: 3 of its cases have no record yet." in page.text
    assert "run 2026-01-02 03:04:05 UTC" in page.text


def test_an_older_page_is_replaced_and_a_bad_place_refused(typical: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "index.html").write_text("old", encoding="utf-8")
    assert report([typical], out).tags["table"] == 3
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(InputError, match=r"cannot write into '.*file': it is a file"):
        write_report([typical], tmp_path / "file")
