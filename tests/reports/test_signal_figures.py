"""Laws of the drawings of signals: what is drawn is where its axes say, and the page has one for each renderer."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from aliasbench.metrics.reconstruction import KERNELS
from aliasbench.metrics.signals import RatePoint, measure_rates, original_rows
from aliasbench.reports.page import write_report
from aliasbench.reports.signal_figures import SHOWN_PX, Plot, draw_rates, draw_signals
from aliasbench.scenes.catalog import build_scene
from aliasbench.scenes.model import Scene

MakeRecord = Callable[..., dict[str, Any]]
Fabricate = Callable[..., Path]


def sampled(scene: Scene, size: tuple[int, int]) -> np.ndarray:
    return original_rows(scene, size, range(size[1]), np.arange(size[0]) + 0.5)


def points(element: ElementTree.Element) -> np.ndarray:
    return np.array([[float(v) for v in pair.split(",")] for pair in element.attrib["points"].split()])


def test_axes_put_their_ranges_ends_on_their_borders_and_clip_what_is_beyond() -> None:
    plot = Plot(100.0, 50.0, (1.0, 8.0), (0.0, 2.0), log2=True)
    places = plot.at(np.array([1.0, 2.0, 8.0]), np.array([0.0, 1.0, 5.0]))
    np.testing.assert_allclose(places[:, 1], [150.0, 125.0, 100.0])
    # an octave of three is a third of the way
    assert (places[1, 0] - places[0, 0]) * 3 == pytest.approx(places[2, 0] - places[0, 0])


def test_a_row_is_drawn_with_its_samples_on_its_original_and_every_kernel() -> None:
    scene = build_scene("signals:frequency=0.05,rows=4")
    figure = draw_signals(scene, sampled(scene, (128, 4)))
    assert figure is not None
    svg = ElementTree.fromstring(figure.svg)
    titles = [t.text or "" for t in svg.iter("text") if t.get("class") == "title"]
    assert len(titles) == 6
    for name, title in zip(KERNELS, titles[1:5], strict=True):
        assert title.startswith(f"reconstructed by {name}: RMS difference 0.")
    lines = [points(e) for e in svg.iter("polyline")]
    assert len(lines) == 1 + 2 * 4 + 1
    dots = np.array([[float(c.attrib["cx"]), float(c.attrib["cy"])] for c in svg.iter("circle")]).reshape(
        -1, SHOWN_PX, 2
    )
    assert len(dots) == 6
    # samples lie on the original, to the tenth of a unit that is written and the steps of the line
    on_line = np.interp(dots[0, :, 0], lines[0][:, 0], lines[0][:, 1])
    np.testing.assert_allclose(dots[0, :, 1], on_line, rtol=0, atol=0.5)
    assert "row 2" in figure.caption


def test_rates_are_drawn_with_the_frequencies_found_and_said_in_words() -> None:
    scene = build_scene("nyquist-sweep:rates=4,phases=8")
    rates = measure_rates(scene, sampled(scene, (64, 32)))
    figure = draw_rates(rates)
    assert draw_signals(scene, sampled(scene, (64, 32))) == figure
    svg = ElementTree.fromstring(figure.svg)
    circles = list(svg.iter("circle"))
    assert len(circles) == 4 + 4 * len(KERNELS)
    truth = points(next(svg.iter("polyline")))
    found = np.array([[float(c.attrib["cx"]), float(c.attrib["cy"])] for c in circles[:4]])
    below = np.interp(found[:, 0], truth[:, 0], truth[:, 1])
    # y is down: at 1 sample per cycle the frequency found is lower than the original's, from 2 on it is the same
    assert found[0, 1] > below[0] + 100.0
    np.testing.assert_allclose(found[1:, 1], below[1:], rtol=0, atol=0.5)
    assert "comes back from 2.00 samples per cycle on" in figure.caption
    assert "At 2.00 the amplitude is 0.00 to 1.00" in figure.caption
    assert "At 4.00 the amplitude is 1.00 to 1.00" in figure.caption


@pytest.mark.parametrize(
    ("recovered", "words"),
    [
        # right by chance at 1.5 and 2.5, wrong at 3
        ((1 / 1.5, 1 / 2.5, 0.1, 0.25, 0.2), "from 4.00 samples per cycle on"),
        ((0.1, 0.1, 1 / 3, 0.25, 0.2), "from 3.00 samples per cycle on"),
        ((1 / 1.5, 1 / 2.5, 1 / 3, 0.25, 0.1), None),
        ((1 / 1.5, 1 / 2.5, 1 / 3, 0.25, 0.2), None),
    ],
)
def test_the_frequency_comes_back_from_where_all_higher_rates_have_it(
    recovered: tuple[float, ...], words: str | None
) -> None:
    errors = dict.fromkeys(KERNELS, 0.1)
    rates = [
        RatePoint(rate, 1 / rate, found, found, 1.0, 1.0, errors, errors, {"none": 0.1}, {"none": found})
        for rate, found in zip((1.5, 2.5, 3.0, 4.0, 5.0), recovered, strict=True)
    ]
    caption = draw_rates(rates[::-1]).caption
    assert (f"comes back {words}." in caption) if words else "comes back" not in caption


def test_nothing_is_drawn_of_narrow_pictures_and_scenes_that_are_no_rows() -> None:
    scene = build_scene("signals")
    assert draw_signals(scene, np.zeros((4, 19, 3))) is None
    assert draw_signals(scene, np.zeros((1, 20, 3))) is not None


def test_the_page_draws_the_fewest_samples_of_each_renderer(
    fabricate: Fabricate, make_record: MakeRecord, tmp_path: Path
) -> None:
    pictures, records = {}, []
    for name, size in (("signals:rows=8", (64, 8)), ("nyquist-sweep:rates=4,phases=4", (64, 16))):
        pixels = sampled(build_scene(name), size)
        for number, (technique, samples) in enumerate(
            (("raytrace:spp=4", 4096), ("raytrace:", 1024), ("raster:", 1024))
        ):
            file = f"frames/{name[:3]}{number}.exr"
            pictures[file] = pixels
            records.append(make_record(name, technique, size=list(size), samples=samples, images={"frame": file}))
    records.append(make_record("signals:rows=2", "raytrace:", images={"frame": "frames/missing.exr"}))
    records.append(make_record("signals:rows=3", "raytrace:", images={}))
    page = write_report([fabricate(records, pictures=pictures)], tmp_path / "out").read_text(encoding="utf-8")
    drawn = re.findall(r'<figure class="signal-figure">.*?<figcaption><b>(.*?)</b>', page, re.DOTALL)
    assert drawn == ["raytrace:", "raster:"] * 2


def test_a_sweep_too_small_for_a_row_of_each_wave_is_not_drawn() -> None:
    sweep = build_scene("nyquist-sweep")
    assert draw_signals(sweep, np.zeros((128, 128, 3))) is None, "the middle of each row is a border of two bands"
    assert draw_signals(build_scene("signals:profile=irregular"), np.zeros((128, 128, 3))) is not None
