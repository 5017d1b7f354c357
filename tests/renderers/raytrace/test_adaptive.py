"""Adaptive sampling: pooled pilots have the bias of their closed form, the unbiased kind has none, wherever edges are.

TRIALS=10 asks for ten times the seeds.
"""

import math
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from aliasbench.renderers.catalog import prepare, render
from aliasbench.scenes.catalog import SCENES
from aliasbench.scenes.model import Scene

TRIALS = int(os.environ.get("TRIALS", "0"))
SEEDS = 200 * max(TRIALS, 1)
ALPHA = 1e-3  # of one family of tests
SIDE = 64


@pytest.fixture(scope="module")
def comb(quad: Any, flat_scene: Any) -> Any:
    """Return a builder of pictures whose pixels are all covered by the same share, by a strip at their left."""

    def build(
        coverage: float, side: int = SIDE, low: float = 0.0, high: float = 1.0, height: int | None = None
    ) -> Scene:
        white, far = (high, high, high), 2.0 * side
        strips = [quad(x, -far, x + coverage, far, color=white) for x in np.arange(-side, side, dtype=float)]
        scene: Scene = flat_scene(strips, height=float(height or side), background=(low, low, low))
        return scene

    return build


@pytest.fixture(scope="module")
def star(polygon: Any, flat_scene: Any) -> Scene:
    """Return a Siemens star of 18 wedges."""
    wedges = []
    for k in range(18):
        a, b = 2 * np.pi * (k + 0.13) / 18, 2 * np.pi * (k + 0.63) / 18
        wedges.append(polygon([[0, 0, 0], [99 * np.cos(a), 99 * np.sin(a), 0], [99 * np.cos(b), 99 * np.sin(b), 0]]))
    scene: Scene = flat_scene(wedges, height=2.0)
    return scene


@pytest.fixture(scope="module")
def dots(quad: Any, flat_scene: Any) -> Scene:
    """Return squares of .1 to .6 pixels a side on 32 x 32 pixels, each in a pixel of its own with empty neighbours."""
    rng = np.random.default_rng(11)
    squares = []
    for i in range(1, 32, 3):
        for j in range(1, 32, 3):
            side = rng.uniform(0.1, 0.6)
            x, y = j - 16 + rng.uniform(0.0, 1.0 - side), 16 - i - 1 + rng.uniform(0.0, 1.0 - side)
            squares.append(quad(x, y, x + side, y + side))
    scene: Scene = flat_scene(squares, height=32.0)
    return scene


@dataclass(frozen=True, eq=False)
class Run:
    """Errors (seeds, h, w) against the reference, and numbers of samples (seeds, h, w)."""

    errors: NDArray[np.float64]
    counts: NDArray[np.float64]
    exact: NDArray[np.float64]

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(self.errors**2)))


def run(scene: Scene, technique: str, filtering: str, side: int, seeds: int) -> Run:
    exact = render(scene, "reference:" + filtering, size=(side, side)).pixels[..., 0]
    errors, counts = [], []
    with prepare(scene, f"raytrace:{technique},{filtering}", size=(side, side)) as prepared:
        for seed in range(seeds):
            frame = prepared.render(seed=seed)
            assert np.isfinite(frame.pixels).all()
            errors.append(frame.pixels[..., 0] - exact)
            if frame.sample_counts is None:
                counts.append(np.full(exact.shape, frame.samples / exact.size))
            else:
                assert frame.sample_counts.shape == exact.shape
                assert frame.sample_counts.sum() == frame.samples
                counts.append(frame.sample_counts)
    return Run(np.stack(errors), np.stack(counts), exact)


def mean_and_interval(values: NDArray[np.float64], alpha: float) -> tuple[float, float]:
    """Return the mean of independent values and the half width of its interval of confidence 1 - alpha."""
    error = float(values.std(ddof=1)) / math.sqrt(len(values))
    return float(values.mean()), float(stats.t.isf(alpha / 2, len(values) - 1)) * error


# Pooled: the closed form of METRICS.md, section 7.


@pytest.mark.parametrize(
    ("coverage", "first", "more", "expected"),
    [(0.2, 4, 12, -0.06048), (0.05, 4, 60, -0.0381744141), (0.9, 2, 14, 0.063), (0.5, 4, 12, 0.0), (0.35, 3, 29, None)],
)
def test_pooled_pilots_have_the_bias_of_the_closed_form(
    comb: Any, coverage: float, first: int, more: int, expected: float | None
) -> None:
    c, n = coverage, first
    bias = more / (n + more) * c * (1 - c) * (c ** (n - 1) - (1 - c) ** (n - 1))
    if expected is not None:
        assert bias == pytest.approx(expected, abs=1e-9)
    technique = f"raytrace:adaptive=pooled,sampler=random,min_spp={n},max_spp={n + more},tolerance=1e-9"
    values, counts = [], []
    with prepare(comb(coverage), technique, size=(SIDE, SIDE)) as prepared:
        for seed in range(16):
            frame = prepared.render(seed=seed)
            values.append(frame.pixels[..., 0].astype(np.float64))
            counts.append(frame.sample_counts)
    errors = np.stack(values).ravel() - c  # samples of all pixels are independent
    mean, half = mean_and_interval(errors, 0.01)
    assert half < 3e-3
    assert abs(mean - bias) < half
    numbers = np.stack(counts).ravel()
    assert set(np.unique(numbers)) == {n, n + more}
    stops = c**n + (1 - c) ** n
    assert abs(np.mean(numbers == n) - stops) < 3.3 * math.sqrt(stops * (1 - stops) / numbers.size)


def test_pooled_sampling_stops_where_its_own_standard_error_is_within_the_tolerance(comb: Any) -> None:
    # From a pilot of 64 the variance is known to 10 %; then n = s^2 / tolerance^2 samples, 525 on average.
    c, tolerance = 0.3, 0.02
    got = run(
        comb(c, 32),
        f"adaptive=pooled,sampler=random,min_spp=64,max_spp=4096,tolerance={tolerance}",
        "filter=box",
        32,
        8,
    )
    assert got.counts.min() >= 64
    assert got.counts.max() < 4096
    wanted = c * (1 - c) / tolerance**2
    assert got.counts.mean() == pytest.approx(wanted, rel=0.05)
    # 8192 independent errors: the RMS is known to sqrt(1 / 16384) = .8 %, four of which are allowed beside 3 %.
    assert got.rms == pytest.approx(tolerance, rel=0.06)


def test_unbiased_sampling_reaches_the_tolerance_on_average(comb: Any) -> None:
    # The largest of eight neighbours' variances asks for no fewer samples than one's own, on average.
    c, tolerance = 0.3, 0.02
    got = run(
        comb(c, 32),
        f"adaptive=unbiased,sampler=random,min_spp=64,max_spp=4096,tolerance={tolerance}",
        "filter=box",
        32,
        8,
    )
    assert got.counts.mean() > c * (1 - c) / tolerance**2
    assert got.counts.mean() < 1.4 * c * (1 - c) / tolerance**2
    assert tolerance / 1.3 < got.rms < tolerance
    mean, half = mean_and_interval(got.errors.ravel(), ALPHA)
    assert abs(mean) < half


# The numbers of samples.


@pytest.mark.parametrize("adaptive", ["pooled", "unbiased", "unbiased,pattern=shared"])
@pytest.mark.parametrize("filtering", ["filter=box", "filter=gaussian"])
def test_samples_go_where_edges_are(star: Scene, adaptive: str, filtering: str) -> None:
    low, high = 4, 50
    got = run(star, f"adaptive={adaptive},min_spp={low},max_spp={high},tolerance=.01", filtering, SIDE, 1)
    counts, pilot = got.counts[0], 4 if "shared" in adaptive else 0
    assert counts.min() == low + pilot
    assert counts.max() == high + pilot
    covered = render(star, "reference:filter=box,radius=1.5", size=(SIDE, SIDE)).pixels[..., 0]
    flat = (covered < 1e-9) | (covered > 1 - 1e-9)  # no edge in the pixel or in its neighbours
    assert flat.mean() > 0.1
    np.testing.assert_array_equal(counts[flat], low + pilot)
    box = render(star, "reference:", size=(SIDE, SIDE)).pixels[..., 0]
    assert counts[(box > 0.2) & (box < 0.8)].mean() > 5 * low


def test_a_looser_tolerance_takes_fewer_samples(star: Scene) -> None:
    totals = [
        render(star, f"raytrace:adaptive={a},sampler=random,tolerance={t},max_spp=256", size=(SIDE, SIDE)).samples
        for a in ("pooled", "unbiased")
        for t in (0.05, 0.1, 0.2)
    ]
    for tight, middle, loose in (totals[:3], totals[3:]):
        assert tight > 1.3 * middle
        assert middle > 1.1 * loose
        assert loose >= 4 * SIDE**2


@pytest.mark.parametrize("adaptive", ["pooled", "unbiased"])
@pytest.mark.parametrize("tolerance", ["1e-9", "1e-12", "1e-30", "1e-200"])
def test_a_tolerance_out_of_reach_takes_all_samples(comb: Any, adaptive: str, tolerance: str) -> None:
    # 1e-12 asks for more samples than an int64 holds, 1e-200 for more than a float64 does. Every pilot sees the edge:
    # it is between the two columns of cells.
    technique = f"raytrace:adaptive={adaptive},sampler=jittered,min_spp=4,max_spp=100,tolerance={tolerance}"
    frame = render(comb(0.5, 8), technique, size=(8, 8))
    np.testing.assert_array_equal(frame.sample_counts, np.full((8, 8), 100))
    flat = render(comb(0.0001, 8, 1.0, 1.0), technique, size=(8, 8))
    np.testing.assert_array_equal(flat.sample_counts, np.full((8, 8), 4))


@pytest.mark.parametrize("adaptive", ["pooled", "unbiased", "unbiased,pattern=shared"])
@pytest.mark.parametrize("filtering", ["filter=box", "filter=tent", "filter=gaussian,weighting=distribution"])
def test_equal_bounds_are_uniform_sampling(star: Scene, adaptive: str, filtering: str) -> None:
    frame = render(star, f"raytrace:adaptive={adaptive},min_spp=9,max_spp=9,{filtering}", size=(17, 17))
    assert frame.sample_counts is not None
    np.testing.assert_array_equal(frame.sample_counts, 18 if "shared" in adaptive else 9)


@pytest.mark.parametrize("adaptive", ["pooled", "unbiased", "unbiased,pattern=shared"])
@pytest.mark.parametrize("bounds", ["min_spp=1,max_spp=1", "min_spp=1", "min_spp=2,max_spp=3", "max_spp=100"])
@pytest.mark.parametrize("filtering", ["filter=box", "filter=tent", "filter=lanczos,weighting=distribution"])
def test_a_picture_of_one_pixel(comb: Any, adaptive: str, bounds: str, filtering: str) -> None:
    # min_spp=1 cannot tell a variance in its own pixel, but in those around it, outside of the picture.
    frame = render(comb(0.4, 1), f"raytrace:adaptive={adaptive},{bounds},{filtering}", size=(1, 1))
    assert frame.pixels.shape == (1, 1, 3)
    assert np.isfinite(frame.pixels).all()
    assert frame.sample_counts is not None
    assert frame.samples == frame.sample_counts.sum() >= 1


@pytest.mark.parametrize("adaptive", ["pooled", "unbiased"])
def test_variances_of_large_values_keep_their_digits(comb: Any, adaptive: str) -> None:
    # 1e6 and 1e6 + 1: sums of squares would leave nothing of the variance of .25. The same samples of 0 and 1 ask for
    # the same numbers.
    technique = f"raytrace:adaptive={adaptive},sampler=random,min_spp=8,max_spp=4096,tolerance=.05"
    small, large = (render(comb(0.3, 16, low, low + 1.0), technique, size=(16, 16)) for low in (0.0, 1e6))
    assert small.sample_counts is not None
    assert small.sample_counts.std() > 1.0
    assert small.sample_counts.max() < 4096
    np.testing.assert_array_equal(large.sample_counts, small.sample_counts)
    np.testing.assert_allclose(large.pixels, 1e6 + small.pixels.astype(np.float64), rtol=6e-8)


# Unbiased: nothing but noise in the mean.

ON_EVERY_SCENE = (
    ("sampler=random", "filter=box"), ("sampler=jittered", "filter=box"), ("sampler=sobol", "filter=box"),
    ("sampler=jittered,pattern=shared", "filter=box"), ("sampler=sobol,weighting=distribution", "filter=tent"),
    ("sampler=jittered", "filter=tent"),
)  # fmt: skip
ON_THE_STAR = (
    ("sampler=multijittered", "filter=box"), ("sampler=random,pattern=shared", "filter=box"),
    ("sampler=random,min_spp=1", "filter=box"), ("sampler=random,weighting=distribution", "filter=gaussian"),
    ("sampler=jittered,weighting=distribution,pattern=shared", "filter=gaussian"), ("sampler=sobol", "filter=gaussian"),
    ("sampler=jittered,pattern=shared", "filter=tent"),
)  # fmt: skip
CASES = [("star", *which) for which in ON_EVERY_SCENE + ON_THE_STAR]
CASES += [("edge-fan", *which) for which in ON_EVERY_SCENE[::2]] + [("dots", *which) for which in ON_EVERY_SCENE]
CASES += [(name, *which) for name in ("edge-fan", "dots") for which in ON_THE_STAR] if TRIALS else []


def assert_no_bias(got: Run, allowed: float, *, is_shared: bool = False) -> None:
    """Fail where the whole picture, or the pixels of a fifth of coverage, are off by more than noise and `allowed`."""
    seen = (got.exact > 1e-9) & (got.exact < 1.0 - 1e-9)
    assert seen.sum() > 100
    bins = np.clip((5 * got.exact).astype(int), 0, 4)
    families = [seen, *(seen & (bins == k) for k in np.unique(bins[seen]))]
    for family in families:
        mean, half = mean_and_interval(got.errors[:, family].mean(axis=1), ALPHA / len(families))
        assert abs(mean) < half + allowed, f"bias {mean:.2e} +- {half:.2e} on {family.sum()} pixels"
    # The mean square of the pixels' biases less the noise that is left in them (METRICS.md, section 7): 0 give or take
    # noise * sqrt(2 / pixels) where pixels are independent, which those of one pattern are not.
    errors = got.errors[:, seen]
    noise = float(np.mean(errors.var(axis=0, ddof=1))) / len(errors)
    square = float(np.mean(errors.mean(axis=0) ** 2)) - noise
    spread = 0.15 if is_shared else math.sqrt(2.0 / seen.sum())
    assert square < 5.0 * spread * noise + allowed**2, f"RMS bias {math.sqrt(max(square, 0.0)):.2e}"


def scene_of(name: str, request: pytest.FixtureRequest) -> Scene:
    scene: Scene = SCENES[name].build() if name in SCENES else request.getfixturevalue(name)
    return scene


@pytest.mark.parametrize(("name", "sampling", "filtering"), CASES)
def test_unbiased_sampling_has_no_bias(
    request: pytest.FixtureRequest, name: str, sampling: str, filtering: str
) -> None:
    is_splat = filtering != "filter=box" and "distribution" not in sampling
    # The quotient of weighted sums has a bias of its own, under uniform sampling too: of 16 samples up to .001
    # (METRICS.md, section 13).
    pilot, allowed = ("min_spp=16,", 1e-3) if is_splat else ("min_spp=4,", 0.0)
    # What a dot's neighbours may see of it is little.
    tolerance = 0.004 if name == "dots" else 0.03 if is_splat else 0.06
    technique = f"adaptive=unbiased,{'' if 'min_spp' in sampling else pilot}{sampling},max_spp=64,tolerance={tolerance}"
    is_large = (name, sampling) == ("star", "sampler=random")
    side = SIDE if is_large else 32 if name == "dots" or "gaussian" in filtering else 24
    got = run(scene_of(name, request), technique, filtering, side, SEEDS)
    assert got.errors.std() > 1e-3
    assert got.counts.max() > got.counts.min()
    assert_no_bias(got, allowed, is_shared="shared" in sampling)


@pytest.mark.parametrize("name", ["star", "dots"])
def test_the_bias_of_pooled_pilots_would_be_seen(request: pytest.FixtureRequest, name: str) -> None:
    got = run(
        scene_of(name, request), "adaptive=pooled,sampler=random,max_spp=64,tolerance=.03", "filter=box", 32, SEEDS
    )
    with pytest.raises(AssertionError, match="bias"):
        assert_no_bias(got, 0.0)


def test_what_adaptive_sampling_buys(request: pytest.FixtureRequest) -> None:
    side = 256 if TRIALS else SIDE
    print(f"\n{side} x {side} pixels, max_spp=256, tolerance=.02, against as many samples spread evenly")
    print("scene     sampler kind      min_spp samples    RMSE    even  ratio")
    ratios = {}
    for name in ("star", "edge-fan", "dots"):
        scene = scene_of(name, request)
        for sampler in ("random", "sobol"):
            for kind in ("pooled", "unbiased"):
                for pilot in (4, 16):
                    technique = f"adaptive={kind},sampler={sampler},min_spp={pilot},max_spp=256,tolerance=.02"
                    side_here = 32 if name == "dots" else side
                    got = run(scene, technique, "filter=box", side_here, 2)
                    spp = max(1, round(float(got.counts.mean())))
                    even = run(scene, f"spp={spp},sampler={sampler}", "filter=box", side_here, 2)
                    ratio = ratios[name, sampler, kind, pilot] = got.rms / even.rms
                    numbers = f"{got.counts.mean():7.1f} {got.rms:7.5f} {even.rms:7.5f} {ratio:6.2f}"
                    print(f"{name:9s} {sampler:7s} {kind:9s} {pilot:7d} {numbers}")
    for name in ("star", "edge-fan"):
        assert ratios[name, "sobol", "unbiased", 16] < 0.9
