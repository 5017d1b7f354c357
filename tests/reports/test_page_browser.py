"""The page in a browser, opened from disk: it draws, it reacts, it asks nobody for anything, it fits a phone."""

import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, sync_playwright

from aliasbench.reports.guide_page import write_guide

pytestmark = pytest.mark.browser

FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


@dataclass
class Opened:
    """A page together with what it said and what it asked for."""

    page: Page
    complaints: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)


@pytest.fixture(scope="module")
def opened(typical_page: Path) -> Iterator[Opened]:
    """Return the typical report in a desktop window; the tests below share it, each with its own controls."""
    found = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=found, args=FLAGS)
        opened = Opened(browser.new_page(viewport={"width": 1400, "height": 900}, color_scheme="light"))
        opened.page.on("console", lambda m: opened.complaints.append(m.text) if m.type == "error" else None)
        opened.page.on("pageerror", lambda e: opened.complaints.append(str(e)))
        opened.page.on("request", lambda r: opened.requests.append(r.url))
        opened.page.goto(typical_page.as_uri())
        opened.page.wait_for_selector(".chart .main-svg")
        yield opened
        browser.close()


def canvas_pixels(page: Page, number: int) -> np.ndarray:
    script = "n => [...document.querySelectorAll('.closeup')[n].getContext('2d').getImageData(0, 0, 256, 128).data]"
    return np.array(page.evaluate(script, number), dtype=np.uint8).reshape(128, 256, 4)


def test_the_chart_shows_every_point_and_tells_renderers_apart(opened: Opened) -> None:
    page = opened.page
    assert page.locator(".chart .scatterlayer .point").count() == 4
    assert page.locator(".chart .legend .legendtext").all_text_contents() == [
        "best error for the time",
        "ray tracer",
        "rasterizer",
    ]
    assert "4× MSAA" in page.locator(".chart .textpoint").all_text_contents()
    page.locator(".chart .scatterlayer .point").first.hover(force=True)
    page.wait_for_selector(".chart .hovertext")
    assert "RMSE 0.0800" in page.locator(".chart .hovertext").text_content()


def test_error_maps_replace_the_pictures_and_show_their_scale(opened: Opened) -> None:
    page = opened.page
    assert page.locator("img.picture:visible").count() == 5
    assert page.locator("img.heat:visible").count() == 0
    assert not page.locator("[data-scale]").is_visible()
    before = canvas_pixels(page, 1)
    page.locator("[data-mode=heat]").click()
    assert page.locator("img.heat:visible").count() == 4
    assert page.locator("img.picture:visible").count() == 1
    assert page.locator("[data-scale]").is_visible()
    assert np.any(canvas_pixels(page, 1) != before)
    page.locator("[data-mode=picture]").click()
    assert page.locator("img.picture:visible").count() == 5
    np.testing.assert_array_equal(canvas_pixels(page, 1), before)


def test_a_click_moves_the_close_up_of_all_pictures_to_the_same_pixels(opened: Opened) -> None:
    page = opened.page
    frames = page.locator(".frame")
    # the tiles draw each of the 64 x 64 pixels 4 times as wide: (128, 60) is pixel (32, 15)
    frames.nth(2).click(position={"x": 128, "y": 60})
    boxes = page.locator(".marker").evaluate_all("all => all.map(m => [m.style.left, m.style.top, m.style.width])")
    assert boxes == [["25%", "10.9375%", "50%"]] * 5
    zoomed = canvas_pixels(page, 1)[..., 0]
    np.testing.assert_array_equal(zoomed, np.kron(zoomed[::8, ::8], np.ones((8, 8), np.uint8)))
    assert set(np.unique(zoomed)) == {0, 255}
    page.locator("[data-zoom='16']").click()
    assert page.locator(".marker").first.evaluate("m => m.style.width") == "25%"


def test_the_table_filters_and_sorts(opened: Opened) -> None:
    page = opened.page
    rows = page.locator("#records tbody tr")
    page.locator("[data-filter]").fill("RAYTRACE ok")
    assert rows.locator("visible=true").count() == 2
    assert page.locator("[data-count]").inner_text() == "2 of 6"
    page.locator("[data-filter]").fill("")
    heading = page.locator("#records th button", has_text="RMS error")
    heading.click()
    place = heading.evaluate("b => b.closest('th').cellIndex")
    column = f"rows => rows.map(r => r.cells[{place}].textContent)"
    order = rows.evaluate_all(column)
    assert order == ["0", "0.0200", "0.0400", "0.0800", "–", "–"]
    heading.click()
    assert rows.evaluate_all(column) == ["0.0800", "0.0400", "0.0200", "0", "–", "–"]


def test_nothing_is_wider_than_the_window_and_the_theme_follows(opened: Opened) -> None:
    page = opened.page
    ink = []
    for scheme, background in (("dark", "rgb(16, 20, 24)"), ("light", "rgb(255, 255, 255)")):
        page.emulate_media(color_scheme=scheme)
        for width in (390, 768, 1400):
            page.set_viewport_size({"width": width, "height": 844})
            page.wait_for_function("w => document.querySelector('.chart .main-svg').clientWidth < w", arg=width)
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            # beside the techniques' names there is room for a figure
            figure = page.locator("#overview tbody tr:first-child td.shaded").first.bounding_box()
            assert figure is not None
            assert figure["x"] + figure["width"] <= width
            # The chart is drawn anew for each width: all its points come back.
            page.wait_for_function("document.querySelectorAll('.chart .scatterlayer .point').length === 4")
        assert page.evaluate("getComputedStyle(document.body).backgroundColor") == background
        # While it is drawn anew a title may be taken out of the page, where nothing has a colour.
        title = "(t => t && getComputedStyle(t).fill)(document.querySelector('.chart .xtitle'))"
        ink.append(page.wait_for_function(title).json_value())
    assert ink[0] != ink[1]


def test_the_guide_has_its_pairs_side_by_side_in_whole_pixels_on_any_width(opened: Opened, tmp_path: Path) -> None:
    path, sections = write_guide(tmp_path, ["jaggies", "buzz"])
    browser = opened.page.context.browser
    assert browser is not None
    page = browser.new_page(reduced_motion="reduce")
    page.on("request", lambda r: opened.requests.append(r.url))
    page.goto(path.as_uri())
    for width in (390, 768, 1400):
        page.set_viewport_size({"width": width, "height": 844})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        for section in sections:
            pictures = page.locator(f"#{section.metric.name} img")
            boxes = [pictures.nth(k).bounding_box() for k in (0, 1)]
            low, high = (box for box in boxes if box is not None)
            assert low["y"] == high["y"]
            assert low["x"] + low["width"] < high["x"]
            assert section.pair is not None
            for box in (low, high):
                assert box["width"] == box["height"]
                assert box["width"] % section.pair.side == 0
                assert box["x"] + box["width"] <= width
    shown = page.locator("#buzz img").first.evaluate("i => i.currentSrc")
    assert shown == sections[1].shots[0].still.uri
    page.close()


def test_all_this_was_quiet_and_asked_nobody(opened: Opened) -> None:
    assert opened.complaints == []
    assert opened.requests
    assert all(url.startswith(("file:", "data:", "blob:")) for url in opened.requests)
