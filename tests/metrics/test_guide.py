"""What readers are told of every metric: an entry for each, in whole sentences, with no figure that is not checked."""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import fields

import numpy as np
import pytest
from scipy import integrate, optimize

from aliasbench.metrics.catalog import METRICS, OPTIONAL, measure
from aliasbench.metrics.guide import GUIDE, NOTATION, Guide
from aliasbench.scenes.model import FloatArray

# Described before they can be measured.
SOON: set[str] = set()
SENTENCES = [f.name for f in fields(Guide) if f.name != "formula"]
DECIMAL = re.compile(r"\d+\.\d+")
# Decimals that are assumptions of the figure beside them, not results: widths, deviations, shares, errors.
GIVEN: Mapping[str, set[str]] = {
    "max_error": {"99.9"},
    "ssim": {"0.03"},
    "shimmer_abs": {"0.5"},
    "flux_flicker": {"0.5", "1.5", "0.1", "0.25"},
    "bias": {"0.2"},
    "mtf50": {"0.5"},
    "edge_width": {"0.5"},
    # Between black and white, as published with the metric.
    "flip": {"0.967"},
}
NU = 17 / 16  # lines a pixel
GAUSS = 0.5  # pixels


def dirichlet(n: int, nu: float) -> float:
    """The response of n equally spaced samples a pixel to nu cycles a pixel."""
    return math.sin(math.pi * nu) / (n * math.sin(math.pi * nu / n))


def moire_of_grid(n: int, nu: float) -> float:
    return abs(dirichlet(n, nu) - np.sinc(nu)) / math.sqrt(2)


def relative_error_of_edge() -> float:
    """Mean over coverages c of (T - c)^2 / (c^2 + 0.01), T = 0 below a half and 1 above."""
    low = integrate.quad(lambda c: c**2 / (c**2 + 0.01), 0.0, 0.5)[0]
    return low + integrate.quad(lambda c: (1 - c) ** 2 / (c**2 + 0.01), 0.5, 1.0)[0]


def crawl(n: int) -> float:
    """Buzz of an edge that passes a pixel in n steps, brute force, the pixel being the middle one of three."""
    u = (np.arange(3 * n) + 0.5) / n - 1.0
    error = np.where(u > 0.5, 1.0, 0.0) - np.clip(u, 0.0, 1.0)
    return float(np.mean((np.roll(error, -1) - error) ** 2) / (2 * np.var(error)))


def flicker_of_thin_line() -> float:
    """Relative deviation, over places in the pixel, of a thin line's light under a Gaussian cut at 1.5 px."""
    place = (np.arange(3000) + 0.5) / 3000
    distance = place[:, None] - np.arange(-3, 5)
    light = np.sum(np.where(np.abs(distance) <= 1.5, np.exp(-0.5 * (distance / GAUSS) ** 2), 0.0), axis=1)
    return float(np.std(light) / np.mean(light))


def shares_of_orders(blades: int, rate: float, shutter_s: float, fps: float = 30.0) -> tuple[FloatArray, FloatArray]:
    """Share of the sharp pattern's power in each order, half of the circle being bright, and its attenuation."""
    k = np.arange(1, 400_001)
    power = np.sinc(0.5 * k) ** 2
    aliased = np.abs(k * blades * rate) >= fps / 2
    return power / np.sum(power) * aliased, np.sinc(k * blades * rate * shutter_s)


def strobing(rate: float, shutter_s: float) -> float:
    share, kept = shares_of_orders(3, rate, shutter_s)
    return math.sqrt(float(np.sum(share * kept**2)))


def strobing_error(rate: float, shutter_s: float) -> float:
    share, kept = shares_of_orders(3, rate, shutter_s)
    return math.sqrt(float(np.sum(share * (1 - kept) ** 2)))


def pilot_bias(c: float, pilot: int, more: int) -> float:
    return more / (pilot + more) * c * (1 - c) * (c ** (pilot - 1) - (1 - c) ** (pilot - 1))


def gaussian_mtf(nu: float) -> float:
    return math.exp(-2 * (math.pi * GAUSS * nu) ** 2)


def half_of(mtf: Callable[[float], float]) -> float:
    return float(optimize.brentq(lambda nu: mtf(nu) - 0.5, 0.01, 0.9))


def gaps_of_line(width: float) -> float:
    """Pixels with more than 1/8 of a line and a centre beside it, on average over the line's places."""
    start = (np.arange(8000) + 0.5) / 8000
    pixel = np.arange(-3, 4)[:, None]
    covered = np.minimum(start + width, pixel + 1) - np.maximum(start, pixel)
    hit = (start <= pixel + 0.5) & (pixel + 0.5 <= start + width)
    return float(np.sum((covered > 1 / 8) & ~hit) / start.size)


def bins_of_band(side: int) -> int:
    nu = np.hypot(*np.meshgrid(np.fft.fftfreq(side), np.fft.fftfreq(side)))
    return int(np.sum((nu > 0) & (nu <= 0.25)))


EDGE = math.sqrt(1 / 12)
FIGURES: list[tuple[str, str, str, float]] = [
    ("rmse", "point_sampled", "0.289", EDGE),
    ("psnr", "point_sampled", "10.8", -20 * math.log10(EDGE)),
    ("psnr", "point_sampled", "30.8", -20 * math.log10(EDGE / math.sqrt(100))),
    ("relmse", "point_sampled", "0.473", relative_error_of_edge()),
    # A half plane that holds the centre of a pixel covers half of it or more.
    ("max_error", "point_sampled", "0.5", 0.5),
    ("jaggies", "point_sampled", "0.289", EDGE),
    ("jaggies", "point_sampled", "0.25", math.sqrt((1 - 1 / 2**2) / 12)),
    ("jaggies", "caution", "0.408", math.sqrt(integrate.quad(lambda c: c * (1 - c), 0, 1)[0])),
    ("jaggies_rms", "point_sampled", "0.289", EDGE),
    ("jaggies_rms", "point_sampled", "0.5", 0.5),
    ("jaggies_bias", "point_sampled", "0.5", 0.5),
    ("jaggies_str", "point_sampled", "0.278", math.sqrt(2 * sum((2 * math.pi * k) ** -2 for k in range(1, 9)))),
    ("shimmer", "point_sampled", "0.0721", math.sqrt((1 - 1 / 32**2) / (12 * 16))),
    ("shimmer", "point_sampled", "0.707", abs(1 - np.sinc(1.0)) / math.sqrt(2)),
    ("shimmer_abs", "perfect", "0.0413", abs(np.sinc(NU)) / math.sqrt(2)),
    ("shimmer_abs", "perfect", "0.0024", np.sinc(NU) ** 2 / math.sqrt(2)),
    ("shimmer_abs", "perfect", "0.0027", gaussian_mtf(NU) / math.sqrt(2)),
    ("shimmer_abs", "point_sampled", "0.707", 1 / math.sqrt(2)),
    ("buzz", "point_sampled", "0.182", crawl(32)),
    ("flux_flicker", "perfect", "0.0123", flicker_of_thin_line()),
    ("flux_flicker", "point_sampled", "1.73", math.sqrt((1 - 0.25) / 0.25)),
    ("moire", "point_sampled", "0.748", moire_of_grid(1, NU)),
    ("moire", "point_sampled", "0.0052", moire_of_grid(4, NU)),
    ("moire", "point_sampled", "0.714", moire_of_grid(4, 65 / 16)),
    ("moire", "caution", "0.44", math.sqrt(math.pi / 16)),
    ("moire_peak", "point_sampled", "1.06", abs(1 - np.sinc(NU))),
    ("moire_peak", "caution", "0.042", 2 * math.sqrt(math.log(bins_of_band(128) / 2)) / 128),
    ("strobing", "perfect", "0.196", strobing(29.0, 1 / 60)),
    ("strobing", "perfect", "0.032", strobing(29.0, 1 / 30)),
    ("strobing", "point_sampled", "0.315", strobing(1.0, 0.0)),
    ("strobing_err", "point_sampled", "0.969", strobing_error(29.0, 1 / 30)),
    ("noise", "point_sampled", "0.408", math.sqrt(1 / 6)),
    ("noise", "point_sampled", "0.051", math.sqrt(1 / (6 * 16**1.5))),
    ("bias", "caution", "0.060", -pilot_bias(0.2, 4, 12)),
    ("mtf50", "perfect", "0.603", half_of(np.sinc)),
    ("mtf50", "perfect", "0.443", half_of(lambda nu: np.sinc(nu) ** 2)),
    ("mtf50", "perfect", "0.375", half_of(gaussian_mtf)),
    ("edge_width", "perfect", "0.8", 0.9 - 0.1),
    # The tent's profile is u^2 / 2 up to the middle.
    ("edge_width", "perfect", "1.11", 2 * (1 - math.sqrt(0.2))),
    ("edge_width", "perfect", "1.28", 2 * GAUSS * math.sqrt(2) * optimize.brentq(lambda x: math.erf(x) - 0.8, 0, 3)),
    ("spatial", "point_sampled", "0.289", EDGE),
    ("gaps", "point_sampled", "0.375", gaps_of_line(0.3) / 2),
    ("gaps", "point_sampled", "0.75", gaps_of_line(0.3)),
    ("gaps", "point_sampled", "0.75", gaps_of_line(0.9)),
]
# Statements with a bound in place of a figure; each has a test of its own below.
BOUNDS: Mapping[str, set[str]] = {"ssim": {"0.9"}, "shimmer": {"0.9"}, "moire": {"0.3", "0.7"}}


def test_every_metric_has_an_entry_and_every_entry_a_metric():
    assert set(METRICS) <= set(GUIDE)
    assert set(GUIDE) - set(METRICS) - set(OPTIONAL) <= SOON <= set(GUIDE)


@pytest.mark.parametrize("name", GUIDE)
def test_entries_are_whole_sentences(name):
    for field in SENTENCES:
        text = getattr(GUIDE[name], field)
        assert re.fullmatch(r"[A-Z0-9√−].*\.", text), (field, text)
        assert "  " not in text
    assert not re.search(r"\. ", GUIDE[name].meaning)
    assert GUIDE[name].formula
    assert not GUIDE[name].formula.endswith(".")


def test_the_table_cannot_be_changed():
    for table in (GUIDE, NOTATION):
        with pytest.raises(TypeError, match="does not support item assignment"):
            table["rmse"] = ""


@pytest.mark.parametrize(("name", "field", "figure", "value"), FIGURES)
def test_figures_are_right_to_their_last_digit(name, field, figure, value):
    assert figure in DECIMAL.findall(getattr(GUIDE[name], field))
    half = 0.5 * 10.0 ** -len(figure.partition(".")[2])
    assert float(figure) == pytest.approx(value, abs=half * (1 + 1e-9))


@pytest.mark.parametrize("name", GUIDE)
def test_no_figure_is_left_unchecked(name):
    told = {d for field in SENTENCES for d in DECIMAL.findall(getattr(GUIDE[name], field))}
    checked = {figure for metric, _, figure, _ in FIGURES if metric == name}
    assert told == checked | GIVEN.get(name, set()) | BOUNDS.get(name, set())


def test_ssim_is_high_on_an_edge_low_on_false_patterns_and_harsh_on_even_areas(make_scene, rgb, box_edge, point_edge):
    size = (66, 66)

    def ssim(test: FloatArray, truth: FloatArray) -> float:
        score = measure("ssim", rgb(test[None]), rgb(truth[None]), scene=make_scene(size))
        assert score.value is not None
        return score.value

    for slope in (0.0618, 0.3, 0.97):
        truth = box_edge(size, slope, 33.2 - 33 * slope)
        assert 0.9 < ssim(point_edge(size, slope, 33.2 - 33 * slope), truth) < 1.0
    x = np.broadcast_to(np.arange(66) + 0.5, size)
    wave = np.cos(2 * np.pi * NU * x)
    # Opposite in sign where sinc is negative, with 17 times the amplitude: nearly -2 / 17.
    assert abs(ssim(0.5 + 0.5 * wave, 0.5 + 0.5 * np.sinc(NU) * wave)) < 2 * abs(np.sinc(NU)) + 0.03
    # On an even area of 0.5 the first factor is 1 within 1e-3 and the second c2 / (variance + c2), which is a half at
    # 0.03. The window's variance is short of it by the window's sum of squares, 1 / (4 pi 1.5^2) = 3.5 %, and spreads
    # by sqrt(2 * .035) = 27 %: both lift the mean by .009. The mean of some 66^2 * .035 = 154 windows that do not
    # overlap is within five times .27 / 4 / sqrt(154) = .027.
    noise = np.random.default_rng(0).normal(scale=0.03, size=size)
    assert ssim(0.5 + noise, np.full(size, 0.5)) == pytest.approx(0.5, abs=0.009 + 0.009 + 0.027)


@pytest.mark.parametrize("slope", [0.01, 0.0618, 0.1, 0.3, 0.618, 0.97])
def test_stairs_are_in_moire_too_and_crawling_ones_in_shimmer(make_scene, rgb, box_edge, point_edge, slope):
    size = (66, 66)
    places = [33.13 - 33 * slope + k / 16 for k in range(16)]
    test, truth = (rgb(np.array([edge(size, slope, b) for b in places])) for edge in (point_edge, box_edge))

    def scored(name: str, frames: slice) -> float:
        score = measure(name, test[frames], truth[frames], scene=make_scene(size))
        assert score.value is not None
        return score.value

    still = slice(0, 1)
    assert 0.25 < scored("moire", still) / scored("rmse", still) < 0.75
    assert 0.9 < scored("shimmer", slice(None)) / scored("rmse", slice(None)) < 1.0
