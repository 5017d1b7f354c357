"""How fast the samplers converge on edges: slopes, known figures, exact variances, rendered and by sample sets.

The rendered scene has a random straight edge in every pixel: its angle uniform, its offset uniform over the lines that
cross the pixel, so that one picture is a draw from all edges. Intervals are over edges and seeds by the bootstrap, and
lie within the margins whole. TRIALS=8 asks for eight times as many seeds.
"""

import functools
import os

import numpy as np
import pytest

from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.sampling.bluenoise import SIDE as SIDE_OF_TILE
from aliasbench.renderers.sampling.patterns import SAMPLERS, sample_set
from aliasbench.scenes.model import Camera, FloatArray, Scene, Surface, read_only

NAMES = tuple(SAMPLERS)
SETS = 1500
SIDE = 128  # pixels, each with an edge: 16384
SEEDS = 3 * max(1, int(os.environ.get("TRIALS", "0")))
COUNTS = (4, 16, 64, 256)
REPLICAS = 400
PARTIAL = 1e-6  # of a pixel, which an edge has to cover and to leave

# Slope of log RMS over log N: the least and the most that is right. Figures of 4000 other edges: -.500 -.749 -.753
# -.765 -.752; strata of area 1 / N give N^-3/4 (Mitchell 1996).
SLOPES = {
    "random": (-0.52, -0.48),
    "jittered": (-0.78, -0.72),
    "grid": (-np.inf, -0.73),
    "multijittered": (-np.inf, -0.73),
    "sobol": (-np.inf, -0.73),
    "bluenoise": (-np.inf, -0.73),
}
# Those figures, of other patterns over LISTED_EDGES other edges.
LISTED_SLOPES = {"random": -0.500, "jittered": -0.749, "grid": -0.753, "multijittered": -0.765, "sobol": -0.752}
LISTED_EDGES = 4000
FIGURES = {"random": (0.1804, 0.0904, 0.0453, 0.0224), "jittered": (0.1277, 0.0450, 0.0160, 0.0056)}


def clip(polygon: list[tuple[float, float]], a: float, b: float, c: float) -> list[tuple[float, float]]:
    """Return the part of a convex polygon in which a x + b y <= c."""
    out = []
    for (x0, y0), (x1, y1) in zip(polygon, polygon[1:] + polygon[:1], strict=True):
        d0, d1 = a * x0 + b * y0 - c, a * x1 + b * y1 - c
        if d0 <= 0.0:
            out.append((x0, y0))
        if d0 * d1 < 0.0:
            t = d0 / (d0 - d1)
            out.append((x0 + t * (x1 - x0), y0 + t * (y1 - y0)))
    return out


def area(polygon: list[tuple[float, float]]) -> float:
    x, y = np.array(polygon).T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


@functools.cache
def edges() -> tuple[Scene, FloatArray]:
    """Return a scene of half pixels, one unit a pixel, and their areas (SIDE, SIDE)."""
    rng = np.random.default_rng(20)
    vertices: list[tuple[float, float, float]] = []
    triangles: list[tuple[int, int, int]] = []
    areas = np.zeros((SIDE, SIDE))
    corner = SIDE / 2
    for row in range(SIDE):
        for column in range(SIDE):
            angle = rng.uniform(0.0, 2.0 * np.pi)
            a, b = np.cos(angle), np.sin(angle)
            offset = rng.uniform(-0.5, 0.5) * (abs(a) + abs(b))
            half = clip([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)], a, b, offset)
            areas[row, column] = area(half)
            x, y = column + 0.5 - corner, corner - row - 0.5
            start = len(vertices)
            vertices += [(x + u, y + v, 0.0) for u, v in half]
            triangles += [(start, start + k, start + k + 1) for k in range(1, len(half) - 1)]
    surface = Surface(read_only(np.array(vertices)), read_only(np.array(triangles, np.int32)))
    return Scene("edges", Camera("orthographic", height=float(SIDE)), (surface,), {}), read_only(areas)


@functools.cache
def square_errors(name: str) -> FloatArray:
    """Return squared errors over partially covered pixels, (counts, seeds, edges); a grid's seeds are all one."""
    scene, areas = edges()
    told = (areas > PARTIAL) & (areas < 1.0 - PARTIAL)
    assert told.mean() > 0.99
    seeds = 1 if name == "grid" else SEEDS
    out = np.empty((len(COUNTS), seeds, told.sum()))
    for n, count in enumerate(COUNTS):
        with prepare(scene, f"raytrace:spp={count},sampler={name}", size=(SIDE, SIDE)) as prepared:
            for seed in range(seeds):
                pixels = prepared.render(seed=seed).pixels[..., 0].astype(np.float64)
                out[n, seed] = (pixels - areas)[told] ** 2
    return read_only(out)


def slope_of(rms: FloatArray) -> FloatArray:
    """Return the least-squares slope of log RMS (..., counts) over log N."""
    x = np.log(COUNTS) - np.log(COUNTS).mean()
    return np.log(rms) @ x / (x @ x)


@functools.cache
def resamplings(edges_told: int) -> FloatArray:
    """Return how often each edge is drawn, (REPLICAS, edges): k times out of many is Poisson's."""
    return np.random.default_rng(1).poisson(1.0, (REPLICAS, edges_told)).astype(np.float64)


@functools.cache
def bootstrap(name: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return RMS (counts,), and 99 % intervals (2, counts) of it and (2,) of the slope, over resampled edges."""
    errors = square_errors(name).mean(axis=1)
    weights = resamplings(errors.shape[1])
    rms = np.sqrt(weights @ errors.T / weights.sum(axis=1, keepdims=True))
    ends = [0.5, 99.5]
    return np.sqrt(errors.mean(axis=1)), np.percentile(rms, ends, axis=0), np.percentile(slope_of(rms), ends)


def test_slopes_of_edges_are_those_of_the_literature() -> None:
    print(f"\nRMS over {square_errors('random').shape[2]} edges x {SEEDS} seeds, 99 % intervals")
    print(f"{'sampler':14s}" + "".join(f"{f'N = {n}':>10s}" for n in COUNTS) + "   slope")
    wrong = []
    for name, (least, most) in SLOPES.items():
        rms, _, interval = bootstrap(name)
        slope = float(slope_of(rms))
        row = f"{name:14s}" + "".join(f"{r:10.5f}" for r in rms)
        print(row + f"   {slope:.4f} [{interval[0]:.4f}, {interval[1]:.4f}]")
        if not (least <= interval[0] <= slope <= interval[1] <= most):
            wrong.append((name, slope, *interval))
        half = (interval[1] - interval[0]) / 2
        theirs = half * np.sqrt(SIDE * SIDE / LISTED_EDGES)
        if name in LISTED_SLOPES and abs(slope - LISTED_SLOPES[name]) > np.hypot(half, theirs):
            wrong.append((name, slope, LISTED_SLOPES[name]))
    assert wrong == []


@pytest.mark.parametrize("name", FIGURES)
def test_errors_of_edges_are_the_known_figures(name: str) -> None:
    rms, interval, _ = bootstrap(name)
    known = np.array(FIGURES[name])
    print(f"\n{name}: RMS / known figure {np.round(rms / known, 4)}, 99 % intervals {np.round(interval / known, 4)}")
    assert (np.abs(interval / known - 1.0) < 0.04).all()


def test_the_better_sampler_has_the_smaller_error_from_16_samples_on() -> None:
    rms = {name: bootstrap(name)[0] for name in SLOPES}
    for better, worse in (("jittered", "random"), ("multijittered", "jittered"), ("sobol", "jittered")):
        assert (rms[better] < rms[worse])[1:].all(), (better, worse)


@pytest.mark.parametrize("name", ["random", "jittered", "multijittered", "sobol", "bluenoise"])
@pytest.mark.parametrize("count", [1, 3, 4, 7, 16, 64])
def test_pictures_of_edges_are_unbiased(name: str, count: int) -> None:
    scene, areas = edges()
    errors = render(scene, f"raytrace:spp={count},sampler={name}", size=(SIDE, SIDE), seed=9).pixels[..., 0] - areas
    # A pixel's mean over scramblings is right for every edge: pooled over quarters of the coverage.
    quarter = np.floor(4.0 * areas)
    for k in range(4):
        part = errors[quarter == k]
        assert len(part) > 1000
        assert abs(part.mean()) < 4.0 * part.std() / np.sqrt(len(part))


@pytest.mark.parametrize("name", NAMES)
def test_pictures_are_the_same_on_any_number_of_threads(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene, _ = edges()
    technique = f"raytrace:spp={1 if name == 'center' else 7},sampler={name}"
    pictures = []
    for threads in (1, 2, 5):
        monkeypatch.setenv("ALIASBENCH_THREADS", str(threads))
        pictures.append(render(scene, technique, size=(SIDE, SIDE), seed=3).pixels)
    assert pictures[0].max() == 1.0
    assert pictures[0].min() == 0.0
    for picture in pictures[1:]:
        np.testing.assert_array_equal(picture, pictures[0])


def edge_error(places: FloatArray) -> FloatArray:
    """Return the exact mean square error of edges across one axis whose coverage is uniform, of (..., N) coordinates.

    The integral over c of (share of the coordinates below c, minus c)^2: Cramer and von Mises' statistic over N,
    1 / (12 N^2) + sum of (x_(i) - (i - 1/2) / N)^2 / N.
    """
    count = places.shape[-1]
    middles = (np.arange(count) + 0.5) / count
    return 1.0 / (12.0 * count**2) + ((np.sort(places, axis=-1) - middles) ** 2).mean(axis=-1)


def row_lengths(count: int) -> FloatArray:
    rows = round(np.sqrt(count))
    return np.diff([i * count // rows for i in range(rows + 1)]).astype(np.float64)


def row_error(name: str, count: int) -> float:
    """Return the mean square error of an edge along the rows of strata, by uniform coverage, of any N.

    In a row of n strata, n / N high, the error is that of n points at its middle, or n independent ones: the square of
    n / N times 1 / 12, or 1 / (6 n), on average. One point in each of N rows is the case n = 1.
    """
    if name == "random":
        return 1.0 / (6.0 * count)
    if name in ("multijittered", "sobol", "bluenoise"):
        return 1.0 / (6.0 * count**2)
    n = row_lengths(count)
    return float((n**3).sum() / (12.0 * count**3) if name == "grid" else (n**2).sum() / (6.0 * count**3))


def square_error(name: str, count: int) -> float:
    """Return the table's entry for N = n^2 (METRICS.md, section 1)."""
    return {
        "random": 1.0 / (6.0 * count),
        "jittered": 1.0 / (6.0 * count**1.5),
        "multijittered": 1.0 / (6.0 * count**2),
        "sobol": 1.0 / (6.0 * count**2),
        "bluenoise": 1.0 / (6.0 * count**2),
        "grid": 1.0 / (12.0 * count),
    }[name]


@functools.cache
def many_sets(name: str, count: int) -> FloatArray:
    if name == "bluenoise":  # pixels of a picture are not independent
        return np.stack([sample_set(name, count, seed=s, pixel=(7, 2)) for s in range(SETS)])
    return np.stack([sample_set(name, count, seed=7, pixel=(k, 2)) for k in range(1 if name == "grid" else SETS)])


def assert_mean(errors: FloatArray, expected: float, places: float = np.inf) -> None:
    """Assert that the mean is as expected, of independent errors drawn from as many `places` (a tile's, by chance)."""
    if len(errors) == 1:
        assert errors[0] == pytest.approx(expected, rel=1e-12)
        return
    spread = errors.std(ddof=1) / np.sqrt(len(errors))
    assert 0.0 < spread < 0.03 * expected
    assert abs(errors.mean() - expected) < 4.0 * spread * np.sqrt(1.0 + len(errors) / places)


def places_of(name: str) -> float:
    """Return how many places an edge has in the sampler: in a tile two, exchanged by orientations, in each pixel."""
    return 2.0 * SIDE_OF_TILE**2 if name == "bluenoise" else np.inf


@pytest.mark.parametrize("name", SLOPES)
@pytest.mark.parametrize("count", [1, 4, 16, 64])
def test_errors_of_edges_along_the_axes_are_exact(name: str, count: int) -> None:
    sets = many_sets(name, count)
    assert row_error(name, count) == pytest.approx(square_error(name, count), rel=1e-12)
    for axis in range(2):
        assert_mean(edge_error(sets[..., axis]), square_error(name, count), places_of(name))


@pytest.mark.parametrize("name", ["random", "jittered", "multijittered", "grid"])
@pytest.mark.parametrize("count", [2, 3, 5, 7, 11, 17])
def test_errors_of_edges_along_rows_are_exact_for_any_count(name: str, count: int) -> None:
    assert_mean(edge_error(many_sets(name, count)[..., 1]), row_error(name, count))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("count", [1, 4, 7, 16])
def test_errors_of_a_moving_edge_are_those_of_stratified_times(name: str, count: int) -> None:
    # Coverage by time alone: N distinct strata of the shutter, their middles for samplers that draw nothing.
    if name in ("sobol", "bluenoise") and count == 7:
        count = 8
    times = many_sets(name, count)[..., 2] if name != "center" else sample_set(name, count)[None, :, 2]
    expected = 1.0 / (6.0 * count) if name == "random" else 1.0 / (6.0 * count**2)
    assert_mean(edge_error(times), expected / 2.0 if name in ("center", "grid") else expected, places_of(name))
