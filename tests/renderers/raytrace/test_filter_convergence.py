"""Every filter, by weighted samples and by weighted distribution, converges to the exact picture of that filter.

Random polygons that are on or off in each channel are seen under random sampling, whose samples are independent, so
that every pixel has a test of its own; and under Sobol samples, which have little noise, so that the bias itself is
seen. Which pixels are tested how is METRICS.md, section 13: those with at least 20 hits and 20 misses expected in each
picture one by one, the rest pooled by coverage, and those that the whole filter sees in one colour for equality.

TRIALS=10 asks for ten times the pictures, and as many random radii for each filter.
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
from aliasbench.renderers.sampling.filters import FAR_SIGMAS, filter_of
from aliasbench.renderers.technique import parse_technique
from aliasbench.scenes.model import Camera, Scene

TRIALS = int(os.environ.get("TRIALS", "0"))
SIZE = (16, 12)
SPP = 1024
RANDOM_SEEDS, SOBOL_SEEDS = 12 * max(TRIALS, 1), 8 * max(TRIALS, 1)
SIGNED_SEEDS = 4 * SOBOL_SEEDS  # signed weights have four times the noise
ENOUGH = 20  # hits, and misses, of each picture
MOST_BIAS = 3e-4
ALPHA = 1e-3  # of one family of tests
LINE = "filter={},radius={:.3f}"

NAMED = (
    "filter=box", "filter=box,radius=.3", "filter=box,radius=1.3", "filter=tent", "filter=tent,radius=.4",
    "filter=cone", "filter=cone,radius=.6", "filter=cone,radius=2", "filter=gaussian",
    "filter=gaussian,sigma=.8,radius=2", "filter=mitchell", "filter=lanczos", "filter=lanczos,radius=2",
)  # fmt: skip
DISTRIBUTIONS = ("filter=gaussian,radius=inf", "filter=gaussian,sigma=.8,radius=inf")
# What the lecture prints: an infinite Gaussian of its mu, whatever sigma says, and the exact tent.
LECTURES = {
    "filter=gaussian,warp=lecture": "filter=gaussian,sigma=.4,radius=inf",
    "filter=gaussian,sigma=.7,radius=1,warp=lecture": "filter=gaussian,sigma=.4,radius=inf",
    "filter=tent,warp=lecture": "filter=tent",
}


def random_filters() -> tuple[str, ...]:
    rng = np.random.default_rng(20)
    names = ("box", "tent", "cone", "gaussian", "mitchell", "lanczos")
    return tuple(LINE.format(name, rng.uniform(0.25, 2.6)) for name in names for _ in range(max(TRIALS, 1)))


SAMPLES = [("weighting=samples," + f, f) for f in NAMED + random_filters()]
DISTRIBUTED = [("weighting=distribution," + f, f) for f in NAMED + DISTRIBUTIONS + random_filters()]
LECTURED = [("weighting=distribution," + f, truth) for f, truth in LECTURES.items()]
CASES = [pytest.param(t, r, id=t.replace("weighting=", "")) for t, r in SAMPLES + DISTRIBUTED + LECTURED]
BIAS_CASES = CASES if TRIALS else [c for c in CASES if c.values[1] not in random_filters()]


@dataclass(frozen=True, eq=False)
class Truth:
    """The exact picture under a filter, and the share of the filter's whole square that is covered."""

    pixels: NDArray[np.float64]
    under: NDArray[np.float64]
    gain: float
    side: float

    @property
    def empty(self) -> NDArray[np.bool_]:
        return self.under < 1e-12

    @property
    def flat(self) -> NDArray[np.bool_]:
        return self.empty | (self.under > 1.0 - 1e-12)

    def least(self, spp: int, technique: str) -> NDArray[np.float64]:
        """Return how many hits or misses, whichever are fewer, each pixel may expect of one picture at least."""
        if self.gain == 1.0:
            return spp * np.minimum(self.pixels, 1.0 - self.pixels)
        if "distribution" in technique:
            # the share of abs f that is covered is at least abs R / gain
            return spp * np.minimum(np.abs(self.pixels), np.abs(1.0 - self.pixels)) / self.gain
        return spp * np.minimum(self.under, 1.0 - self.under) * self.side**2


def truth_of(scene: Scene, text: str, size: tuple[int, int]) -> Truth:
    spec = filter_of(parse_technique("reference:" + text))
    reach = min(spec.radius, FAR_SIGMAS * spec.sigma) if spec.name == "gaussian" else spec.radius
    pixels = render(scene, "reference:" + text, size=size).pixels
    under = render(scene, f"reference:filter=box,radius={reach!r}", size=size).pixels
    return Truth(pixels, under, spec.gain, 2.0 * reach)


def errors_of(scene: Scene, text: str, exact: NDArray[np.float64], seeds: int) -> NDArray[np.float64]:
    """Return (seeds, h, w, 3) of errors."""
    with prepare(scene, "raytrace:" + text, size=(exact.shape[1], exact.shape[0])) as prepared:
        return np.stack([prepared.render(seed=s).pixels - exact for s in range(seeds)])


def largest_t(errors: NDArray[np.float64]) -> tuple[float, float]:
    """Return the largest t of the means over the first axis, and what it may be: Sidak's correction of `ALPHA`."""
    seeds, count = len(errors), errors[0].size
    spread = errors.std(axis=0, ddof=1) / np.sqrt(seeds)
    t = np.abs(errors.mean(axis=0)) / np.maximum(spread, 1e-7)  # pictures are float32
    level = -math.expm1(math.log1p(-ALPHA) / count)
    return float(t.max()), float(stats.t.isf(level / 2, seeds - 1))


def pooled(errors: NDArray[np.float64], coverage: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (seeds, bins) of errors averaged over the pixels of each tenth of coverage that has any."""
    bins = np.clip((10 * coverage).astype(int), 0, 9)
    return np.stack([errors[:, bins == k].mean(axis=1) for k in np.unique(bins)], axis=1)


@pytest.fixture(scope="module")
def confetti(polygon: Any, flat_scene: Any) -> Scene:
    """Return random triangles and quadrilaterals, on or off in each channel: tiny, large, and leaving the picture."""
    rng = np.random.default_rng(7)
    colors = [(1.0, 0.0, 0.0), (0.0, 1.0, 1.0), (1.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)]
    shapes = []
    for k, reach in enumerate([30.0, 9.0, 5.0, 4.0, 3.0, 2.0, 2.0, 1.5, 1.0, 0.6, 0.4, 0.3, 0.2, 0.1, 0.05, 6.0]):
        angles = 2 * np.pi * (np.arange(3 + k % 2) + rng.uniform(0.1, 0.9, 3 + k % 2)) / (3 + k % 2)
        # The largest covers a half of the picture or so, the last a corner of it.
        centre = rng.uniform([-8, -6], [8, 6]) if 0 < k < 15 else [(-26.0, -9.0), (9.0, 8.0)][k > 0]
        points = np.stack([np.cos(angles), np.sin(angles)], axis=1) * reach + centre
        shapes.append(polygon(np.c_[points, np.zeros(len(points))], color=colors[k % 5]))
    scene: Scene = flat_scene(shapes, height=float(SIZE[1]))
    return scene


@pytest.mark.parametrize(("technique", "reference"), CASES)
def test_every_filter_converges_to_its_exact_picture(technique: str, reference: str, confetti: Scene) -> None:
    truth = truth_of(confetti, reference, SIZE)
    errors = errors_of(confetti, f"spp={SPP},sampler=random,{technique}", truth.pixels, RANDOM_SEEDS)
    assert np.isfinite(errors).all()
    flat = truth.flat
    tested = ~flat & (truth.least(SPP, technique) >= ENOUGH)
    assert tested.sum() > 20
    t, allowed = largest_t(errors[:, tested])
    assert t < allowed, f"a pixel is off by {t:.1f} of its standard errors"
    bins = pooled(errors[:, ~flat], truth.pixels[~flat])
    assert bins.shape[1] >= 5
    t, allowed = largest_t(bins)
    assert t < allowed, f"pixels of like coverage are off by {t:.1f} of their standard errors"
    if "inf" not in reference:
        assert flat.sum() > 20
    # Signed weights average to 1 in expectation alone.
    same = truth.empty if truth.gain > 1.0 and "distribution" in technique else flat
    assert np.abs(errors[:, same]).max(initial=0.0) <= 1e-7


@pytest.mark.parametrize(("technique", "reference"), BIAS_CASES)
def test_the_bias_is_below_3e_4(technique: str, reference: str, confetti: Scene) -> None:
    truth = truth_of(confetti, reference, SIZE)
    is_signed = truth.gain > 1.0 and "distribution" in technique
    seeds = SIGNED_SEEDS if is_signed else SOBOL_SEEDS
    errors = errors_of(confetti, f"spp={SPP},sampler=sobol,{technique}", truth.pixels, seeds)
    seen = ~truth.flat
    thirds = np.clip((3 * truth.pixels[seen]).astype(int), 0, 2)
    parts = [errors[:, seen], *(errors[:, seen][:, thirds == k] for k in range(3))]
    for part in parts:
        means = part.mean(axis=1)
        error = means.std(ddof=1) / np.sqrt(seeds)
        interval = stats.t.isf(0.5 * ALPHA / len(parts), seeds - 1) * error
        assert abs(means.mean()) - interval < MOST_BIAS, f"{means.mean():.1e} +- {error:.1e}"
    means = parts[0].mean(axis=1)
    error = means.std(ddof=1) / np.sqrt(seeds)
    assert error < MOST_BIAS / (2 if is_signed else 3), "too few pictures to tell"
    assert abs(means.mean()) - (2.0 * error if is_signed else 0.0) < MOST_BIAS


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (11, 1), (5, 3)])
@pytest.mark.parametrize(
    "filtering", ["filter=box", "filter=tent,radius=1.4", "filter=cone", "filter=gaussian", "filter=lanczos,radius=2"]
)
@pytest.mark.parametrize("weighting", ["samples", "distribution"])
def test_pictures_of_any_size_converge_too(
    polygon: Any, flat_scene: Any, size: tuple[int, int], filtering: str, weighting: str
) -> None:
    # An edge through the middle, on beyond the picture on all sides: every pixel is at a border.
    half = [[-40.0, -17.3, 0.0], [40.0, 17.6, 0.0], [40.0, 90.0, 0.0], [-40.0, 90.0, 0.0]]
    scene = flat_scene([polygon(half)], height=float(size[1]))
    truth = truth_of(scene, filtering, size)
    text = f"spp={SPP},sampler=random,weighting={weighting},{filtering}"
    errors = errors_of(scene, text, truth.pixels, 16)
    tested = ~truth.flat & (truth.least(SPP, text) >= ENOUGH)
    assert tested.any()
    t, allowed = largest_t(errors[:, tested])
    assert t < allowed
    assert np.abs(errors[:, truth.empty]).max(initial=0.0) <= 1e-7


@pytest.mark.parametrize(("spp", "pictures", "documented"), [(4, 64, -0.0042), (16, 128, -0.0010)])
def test_the_bias_of_a_quotient_of_few_samples(
    quad: Any, flat_scene: Any, spp: int, pictures: int, documented: float
) -> None:
    # E[A / B] = R - (cov(A, B) - R var B) / N + O(1 / N^2) of the means A = f L and B = f; here all is a product of
    # integrals along one axis, of each pixel that the tent reaches. L is 1 beyond -.25 along both axes.
    steps = 4000
    x = (np.arange(2 * steps) + 0.5) / steps - 1.0
    tent, seen = 1.0 - np.abs(x), x > -0.25
    parts = (x < -0.5, np.abs(x) < 0.5, x > 0.5)

    def square(values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the integrals over the nine pixels of the product of a function of x with itself of y."""
        one = np.array([values[part].sum() / steps for part in parts])
        return np.outer(one, one)

    exact = square(tent * seen).sum()
    covariance = (square(tent**2 * seen) - square(tent * seen) * square(tent)).sum()
    variance = (square(tent**2) - square(tent) ** 2).sum()
    predicted = -(covariance - exact * variance) / spp
    assert predicted == pytest.approx(documented, abs=6e-5)
    # Pixels three apart share no sample.
    side = 96
    places = np.arange(1, side, 3) + 0.5 - side / 2
    shapes = [quad(a - 0.25, -b - 1.5, a + 1.5, -b + 0.25) for a in places for b in places]
    scene = flat_scene(shapes, height=float(side))
    technique = f"raytrace:spp={spp},sampler=random,filter=tent"
    with prepare(scene, technique, size=(side, side)) as prepared:
        seen_pixels = np.stack([prepared.render(seed=s).pixels[1::3, 1::3, 0] for s in range(pictures)])
    assert render(scene, "reference:filter=tent", size=(side, side)).pixels[1::3, 1::3, 0] == pytest.approx(exact, 1e-6)
    bias = seen_pixels.mean() - exact
    error = seen_pixels.std() / np.sqrt(seen_pixels.size)
    second = 3.0 * variance / spp * abs(predicted)  # the next term: smaller by the variance of B, as B is 1 on average
    assert 3.0 * error < abs(predicted)
    assert abs(bias - predicted) < 3.0 * error + second
    print(f"{spp} samples: bias {bias:.5f} +- {error:.5f}, predicted {predicted:.5f}")


@pytest.mark.parametrize("filtering", ["filter=tent", "filter=gaussian,sigma=.8,radius=2", "filter=lanczos"])
def test_borders_are_seen_as_parts_of_a_larger_picture_are(confetti: Scene, filtering: str) -> None:
    # One set for all pixels: a picture is then bit for bit the middle of a larger one.
    wide = Camera("orthographic", height=SIZE[1] + 8.0)
    larger = Scene("larger", wide, confetti.objects)
    text = f"raytrace:spp=16,sampler=sobol,pattern=shared,{filtering}"
    small = render(confetti, text, size=SIZE).pixels
    large = render(larger, text, size=(SIZE[0] + 8, SIZE[1] + 8)).pixels
    # Sums run over rays that float64 rounds differently: an edge within an ulp of a sample does not occur here.
    np.testing.assert_allclose(large[4:-4, 4:-4], small, rtol=0.0, atol=1e-6)
    assert small[0].std() > 0.05
