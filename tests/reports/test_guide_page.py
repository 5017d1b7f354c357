"""The guide to the metrics: each has a pair of pictures that shows it, measured and seen, on a page of its own."""

import base64
import io
import json
import re
from collections.abc import Mapping
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from aliasbench.bench import cli
from aliasbench.metrics.catalog import METRICS
from aliasbench.metrics.guide import GUIDE
from aliasbench.metrics.score import Score
from aliasbench.reports.figures import encode_film, encode_picture
from aliasbench.reports.guide_page import SHOWN_SIDE, MetricSection, better_shot, draw_sections, score_text, write_guide
from aliasbench.reports.guide_pairs import PAIRS, Pair, Shot
from aliasbench.reports.markup import formula
from aliasbench.scenes.errors import InputError

# How many times the high score of a pair is the low one, at least; of errors where higher is better.
SEVERAL = 3.0
# Of 255 steps of display brightness, the mean difference of the two pictures: an eye needs one or two on even areas.
SEEN = 2.0


Guided = tuple[Path, dict[str, MetricSection]]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Guided:
    """The page of all metrics, and its sections by name."""
    page, sections = write_guide(tmp_path_factory.mktemp("guide"))
    return page, {s.metric.name: s for s in sections}


def pixels_of(uri: str) -> np.ndarray:
    """Return (frames, h, w, 3) bytes of an embedded picture."""
    image = Image.open(io.BytesIO(base64.b64decode(uri.partition("base64,")[2])))
    frames = []
    for number in range(getattr(image, "n_frames", 1)):
        image.seek(number)
        frames.append(np.asarray(image.convert("RGB")))
    return np.array(frames)


def true_figures(extras: object) -> list[float]:
    """Return the figures that the extras of a score call true, in order."""
    if isinstance(extras, Mapping):
        own = [float(v) for k, v in extras.items() if str(k).startswith("true_")]
        return own + [figure for value in extras.values() for figure in true_figures(value)]
    return [figure for value in extras for figure in true_figures(value)] if isinstance(extras, list) else []


def test_every_metric_has_a_pair_and_every_pair_whole_pixels() -> None:
    assert set(METRICS) <= set(PAIRS) <= set(GUIDE)
    for pair in PAIRS.values():
        assert SHOWN_SIDE % (2 * pair.side) == 0  # half as wide on phones
        assert pair.look.endswith((".", "?"))
        assert pair.low != pair.high


@pytest.mark.parametrize("name", METRICS)
def test_the_high_score_is_several_times_the_low_one(whole: Guided, name: str) -> None:
    low, high = (shot.score.value for shot in whole[1][name].shots)
    assert low is not None
    assert high is not None
    if name == "psnr":
        low, high = 10 ** (low / 20), 10 ** (high / 20)
    if name == "ssim":
        low, high = 1 - high, 1 - low
    if METRICS[name].better == "truth":
        # Not more or less of something: the high one is what the scene says and the low one is not.
        shots = whole[1][name].shots
        false, true = (true_figures(shot.score.extras)[0] for shot in shots)
        assert high == pytest.approx(true, rel=0.02)
        assert abs(low - false) > 0.5 * max(abs(low), abs(false))
        return
    assert abs(high) > SEVERAL * abs(low)


@pytest.mark.parametrize("name", METRICS)
def test_the_difference_is_seen(whole: Guided, name: str) -> None:
    low, high = (pixels_of(shot.picture.uri).astype(float) for shot in whole[1][name].shots)
    side = PAIRS[name].side
    for pixels in (low, high):
        assert pixels.shape[1:] == (side, side, 3)
        # Films keep equal frames once.
        assert 1 <= len(pixels) <= PAIRS[name].frames
        assert PAIRS[name].frames == 1 or len(pixels) > PAIRS[name].frames / 4
    frames = min(len(low), len(high))
    difference = np.abs(low[:frames] - high[:frames])
    # Where they differ at all: an edge is a small part of a picture.
    assert difference.max() > 30
    assert difference[difference.max(axis=3) > 0].mean() > SEEN
    shots = whole[1][name].shots
    assert [shot.better for shot in shots] == [better_shot(METRICS[name]) == which for which in ("low", "high")]


class Links(HTMLParser):
    """All that a page points at, with the text outside of style sheets; unbalanced tags fail."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.open: list[str] = []
        self.words: list[str] = []
        self.feed(text)
        self.close()
        assert not self.open
        self.text = re.sub(r"\s+", " ", "".join(self.words))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.links += [value or "" for name, value in attrs if name in ("src", "srcset", "href")]
        if tag not in ("meta", "link", "img", "source", "wbr"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open[-1:] != ["style"]:
            self.words.append(data)


def test_the_page_says_everything_and_needs_nothing_outside_itself(
    whole: Guided,
) -> None:
    path, sections = whole
    text = path.read_text(encoding="utf-8")
    page = Links(text)
    assert path.name == "index.html"
    assert [p.name for p in path.parent.iterdir()] == ["index.html"]
    assert all(link.startswith(("data:", "#")) for link in page.links)
    assert "<script" not in text
    films = sum(pair.frames > 1 for name, pair in PAIRS.items() if name in METRICS)
    assert text.count("<img ") == 2 * len(METRICS)
    assert text.count("prefers-reduced-motion") == 2 * films
    for name, section in sections.items():
        guide = GUIDE[name]
        assert f'id="{name}"' in text
        assert f"#{name}" in page.links
        for told in (guide.meaning, guide.perfect, guide.point_sampled, guide.caution, METRICS[name].source):
            assert told in page.text
        for shot in section.shots:
            assert score_text(shot.score) in page.text
            assert shot.shot.scene in page.text
            assert shot.shot.technique in page.text
    assert path.stat().st_size < 3_000_000


def test_one_metric_has_a_page_of_its_own_and_an_unknown_one_none(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["list", "metrics", "jaggies", "-o", str(tmp_path / "out"), "--json"]) == 0
    said = capsys.readouterr()
    found = json.loads(said.out)
    assert Path(found["page"]) == tmp_path / "out" / "index.html"
    (low, high) = found["metrics"].pop("jaggies")
    assert found["metrics"] == {}
    assert (low["better"], high["better"]) == (True, False)
    # Of an edge of slope 309/5000 the point samples' displacement is as good as uniform; 76 columns hold five stairs.
    assert high["value"] == pytest.approx(12**-0.5, rel=0.05)
    assert said.err.splitlines()[0] == "[0/1] jaggies: near-horizontal-edge:slope=0.0618 by raytrace:spp=16"
    assert Links((tmp_path / "out/index.html").read_text(encoding="utf-8")).text.count("point sampled") == 1
    with pytest.raises(InputError, match="unknown metric 'jagies'; did you mean 'jaggies'"):
        write_guide(tmp_path / "none", ["jagies"])
    assert not (tmp_path / "none").exists()


def test_a_metric_without_a_number_or_a_pair_is_shown_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    edge = "near-horizontal-edge:slope=0.0618"
    monkeypatch.setattr(
        "aliasbench.reports.guide_page.PAIRS", {"buzz": Pair(Shot(edge, "reference:"), Shot(edge, "raytrace:"), "See.")}
    )
    with_reason, without = draw_sections([METRICS["buzz"], METRICS["rmse"]])
    assert [shot.text for shot in with_reason.shots] == ["undefined one frame"] * 2
    assert (without.pair, without.shots) == (None, [])


def test_scores_and_formulas_are_set_for_readers() -> None:
    assert score_text(Score(-0.0123456)) == "−0.0123"
    assert score_text(Score(None, "below_reference_floor")) == "below reference floor"
    assert formula("a_b < Σ_y |c_m(t)|") == "a<sub>b</sub> &lt; Σ<sub>y</sub> |c<sub>m</sub>(t)|"


def test_a_film_shows_its_frames_in_turn_as_pictures_do() -> None:
    frames = np.random.default_rng(0).uniform(-0.2, 1.7, size=(5, 8, 12, 3))
    film = encode_film(frames, 40, exposure=0.5)
    assert (film.width, film.height) == (12, 8)
    shown = pixels_of(film.uri)
    assert len(shown) == 5
    for number, frame in enumerate(frames):
        assert np.array_equal(shown[number], pixels_of(encode_picture(frame, 0.5).uri)[0])
    image = Image.open(io.BytesIO(base64.b64decode(film.uri.partition("base64,")[2])))
    assert (image.info["duration"], image.info["loop"]) == (40, 0)
