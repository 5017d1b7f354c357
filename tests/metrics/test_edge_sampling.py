"""What samplers cost on edges, measured on planted pictures: along an axis, and over all lines that cross a pixel.

A picture of lines has one in every pixel, its angle uniform and its offset uniform over those that cross the pixel.
Half planes cover pixels by a closed form, and the samplers' mean square errors are integrals over the angle, so that
pictures are compared with figures of no sampling at all.
"""

import functools
import math

import numpy as np
import pytest
from scipy import integrate

from aliasbench.metrics.catalog import measure
from aliasbench.metrics.convergence import fit_slope

SIDE = 128
PARTIAL = 1e-6  # of a pixel, which a line has to cover and to leave
LISTED_LINES = 1000  # at least so many are behind the listed figures
# Positions in sixteenths of a pixel, of Direct3D and Vulkan.
STANDARD = {
    1: [(8, 8)],
    2: [(12, 12), (4, 4)],
    4: [(6, 2), (14, 6), (2, 10), (10, 14)],
    8: [(9, 5), (7, 11), (13, 9), (5, 3), (3, 13), (1, 7), (11, 15), (15, 1)],
    16: [
        *[(9, 9), (7, 5), (5, 10), (12, 7), (3, 6), (10, 13), (13, 11), (11, 3)],
        *[(6, 14), (8, 1), (4, 2), (2, 12), (0, 8), (15, 4), (14, 15), (1, 0)],
    ],
}
LISTED_STANDARD = {1: 0.2465, 2: 0.1603, 4: 0.0916, 8: 0.0573, 16: 0.0439}
LISTED = {
    "random": {1: 0.3605, 4: 0.1804, 16: 0.0904, 64: 0.0453, 256: 0.0224},
    "jittered": {1: 0.3581, 4: 0.1277, 16: 0.0450, 64: 0.0160, 256: 0.0056},
}
COUNTS = (4, 16, 64, 256)


def coverage(cos: np.ndarray, sin: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Area of the unit square about 0 in which cos x + sin y < offset, for offsets at which the line crosses it.

    With a >= b the absolute cosine and sine, t the way from the corner that is entered first: t^2 / (2 a b) while a
    triangle is covered (t < b), then (t - b / 2) / a, and the same from the other corner.
    """
    a, b = np.maximum(abs(cos), abs(sin)), np.minimum(abs(cos), abs(sin))
    t = np.clip(offset + (a + b) / 2, 0.0, a + b)
    near = np.minimum(t, a + b - t)
    triangle = near**2 / (2 * a * np.maximum(b, 1e-300))
    area = np.where(near < b, triangle, (near - b / 2) / a)
    return np.where(2 * t < a + b, area, 1.0 - area)


@functools.cache
def lines(seed: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Cosines, sines and offsets of as many lines as the picture has pixels, partly covered all, and the coverage."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0.0, 2.0 * np.pi, 2 * SIDE * SIDE)
    cos, sin = np.cos(angle), np.sin(angle)
    offset = rng.uniform(-0.5, 0.5, angle.size) * (abs(cos) + abs(sin))
    area = coverage(cos, sin, offset)
    told = np.flatnonzero((area > PARTIAL) & (area < 1.0 - PARTIAL))[: SIDE * SIDE]
    return tuple(a[told].reshape(SIDE, SIDE) for a in (cos, sin, offset, area))  # type: ignore[return-value]


def cells(count: int) -> np.ndarray:
    """(count, 2) centres of the cells of a square grid, in the pixel about 0."""
    n = math.isqrt(count)
    return np.stack(np.mgrid[:n, :n], axis=-1).reshape(-1, 2) / n + (0.5 / n - 0.5)


def picture(positions: np.ndarray, jitter: float = 0.0, seed: int = 0) -> np.ndarray:
    """(SIDE, SIDE) shares of positions (count, 2) that the lines cover, each moved by up to +- jitter in each pixel."""
    rng = np.random.default_rng(seed)
    cos, sin, offset, _ = lines()
    hits = np.zeros((SIDE, SIDE))
    for x, y in positions:
        dx, dy = rng.uniform(-jitter, jitter, (2, SIDE, SIDE)) if jitter else (0.0, 0.0)
        hits += cos * (x + dx) + sin * (y + dy) < offset
    return hits / len(positions)


def sampled(sampler: str, count: int) -> np.ndarray:
    if sampler == "random":
        return picture(np.zeros((count, 2)), 0.5, seed=count)
    return picture(cells(count), 0.5 / math.isqrt(count) if sampler == "jittered" else 0.0, seed=count)


def measured(shares: np.ndarray, make_scene, rgb) -> float:
    truth = lines()[3]
    score = measure("rmse", rgb(shares[None]), rgb(truth[None]), scene=make_scene((SIDE, SIDE)), filter_radius_px=0)
    assert score.status == "ok"
    return float(score.value)


def over_angles(square) -> float:
    """RMS over partially covered pixels of a mean square error (of k = tan angle, at angles up to 45 degrees).

    A line covers less than PARTIAL within sqrt(2 a b PARTIAL) of the first corner, and the last, where errors are of
    the size of PARTIAL: leaving them out divides by what is left.
    """

    def kept(k: float) -> float:
        return 1.0 - 2.0 * math.sqrt(2.0 * k * PARTIAL) / (1.0 + k)

    eighth = math.pi / 4
    total = integrate.quad(lambda angle: square(math.tan(angle)), 0.0, eighth)[0]
    return math.sqrt(total / integrate.quad(lambda angle: kept(math.tan(angle)), 0.0, eighth)[0])


def random_square(k: float) -> float:
    """Mean of c (1 - c) over offsets, for a = 1, b = k, lines 1 + k wide.

    Two triangles, 2 int_0^k t^2/(2k) (1 - t^2/(2k)) dt = k^2/3 - k^3/10, and from k/2 to 1 - k/2 in between,
    int c (1 - c) dc = 1/6 - k^2/4 + k^3/12.
    """
    return (1 / 6 + k**2 / 12 - k**3 / 60) / (1 + k)


def center_square(k: float) -> float:
    """Mean square error of one sample in the middle: 1/12 + k^3/60 per length of an edge, 1 + k lines to a length."""
    return (1 / 12 + k**3 / 60) / (1 + k)


def pattern_rms(positions: np.ndarray, angles: int = 512, offsets: int = 1024) -> float:
    """RMS error of fixed positions over a lattice of lines instead of random ones."""
    angle = (np.arange(angles)[:, None] + 0.5) / angles * 2 * np.pi
    cos, sin = np.cos(angle), np.sin(angle)
    offset = ((np.arange(offsets) + 0.5) / offsets - 0.5) * (abs(cos) + abs(sin))
    area = coverage(cos, sin, offset)
    hits = sum((cos * x + sin * y < offset).astype(np.float64) for x, y in positions)
    told = (area > PARTIAL) & (area < 1.0 - PARTIAL)
    return math.sqrt(float(np.mean((hits / len(positions) - area)[told] ** 2)))


def spread(squares: np.ndarray, count: int) -> float:
    """Relative standard deviation of an RMS over `count` independent pixels with such squared errors."""
    return float(squares.std() / squares.mean() / 2 / math.sqrt(count))


def check(shares: np.ndarray, truth: float, listed: float, make_scene, rgb) -> None:
    squares = (shares - lines()[3]) ** 2
    rms = measured(shares, make_scene, rgb)
    assert rms == pytest.approx(math.sqrt(squares.mean()), rel=1e-12)
    # Four standard deviations of SIDE^2 lines; the listed figures have LISTED_LINES, and four digits.
    assert rms == pytest.approx(truth, rel=4 * spread(squares, SIDE * SIDE))
    assert listed == pytest.approx(truth, rel=3 * spread(squares, LISTED_LINES), abs=5e-5)


def test_coverage_by_half_planes_is_what_points_count():
    cos, sin, offset, area = (a.ravel()[:60] for a in lines())
    n = 400
    at = (np.arange(n) + 0.5) / n - 0.5
    share = [(c * at[:, None] + s * at < d).mean() for c, s, d in zip(cos, sin, offset, strict=True)]
    # A line passes fewer than 2 n of the n^2 cells, and of those each is wrong by less than its area.
    np.testing.assert_allclose(share, area, atol=2 / n)
    axis = coverage(np.array([1.0, 0.0, -1.0]), np.array([0.0, 1.0, 0.0]), np.array([0.2, -0.5, 0.5]))
    np.testing.assert_allclose(axis, [0.7, 0.0, 1.0], atol=1e-15)


@pytest.mark.parametrize("count", LISTED["random"])
def test_random_samples_of_lines_have_their_listed_error(make_scene, rgb, count):
    truth = over_angles(random_square) / math.sqrt(count)
    check(sampled("random", count), truth, LISTED["random"][count], make_scene, rgb)


@pytest.mark.parametrize("count", LISTED["jittered"])
def test_jittered_samples_of_lines_have_their_listed_error(make_scene, rgb, count):
    # A cell of side 1/n is crossed by 1/n of the lines, with any coverage as the pixel is: n^2 cells, each with 1 / n^4
    # of its variance, give 1 / n^3 of a pixel's: N^-3/2 exactly.
    truth = over_angles(random_square) * count**-0.75
    check(sampled("jittered", count), truth, LISTED["jittered"][count], make_scene, rgb)


@pytest.mark.parametrize("count", STANDARD)
def test_standard_patterns_have_their_listed_error_and_pass_drivers_limit(make_scene, rgb, count):
    positions = np.array(STANDARD[count]) / 16 - 0.5
    shares = picture(positions)
    # Each of up to 16 jumps over an offset is off by half a step of 1024 at most, by chance, of squares that differ by
    # 1/4 at most, in one of 512 angles: far below the lines' spread.
    check(shares, pattern_rms(positions), LISTED_STANDARD[count], make_scene, rgb)
    assert measured(shares, make_scene, rgb) < 0.333 * 0.62 ** math.log2(count)


def test_one_sample_in_the_middle_has_the_closed_form(make_scene, rgb):
    truth = over_angles(center_square)
    assert pattern_rms(np.zeros((1, 2))) == pytest.approx(truth, rel=2e-3)  # 0.25 of a step of 1/1024 relative to 1/16
    check(picture(np.zeros((1, 2))), truth, LISTED_STANDARD[1], make_scene, rgb)


@pytest.mark.parametrize(
    ("sampler", "slope", "listed"), [("random", -0.5, -0.500), ("jittered", -0.75, -0.749), ("grid", None, -0.753)]
)
def test_slopes_over_lines_are_the_listed_ones(make_scene, rgb, sampler, slope, listed):
    # Rows of the picture are replicates: 128 lines each.
    pictures = [sampled(sampler, count) for count in COUNTS]
    errors = np.stack([np.sqrt(np.mean((p - lines()[3]) ** 2, axis=1)) for p in pictures], axis=1)
    score = fit_slope(COUNTS, errors)
    x = np.log(COUNTS) - np.log(COUNTS).mean()

    def fitted(rms: list[float]) -> float:
        return float(np.log(rms) @ x / (x @ x))

    assert score.value == pytest.approx(fitted([measured(p, make_scene, rgb) for p in pictures]), abs=1e-12)
    if slope is None:
        slope = fitted([pattern_rms(cells(count)) for count in COUNTS])
        assert slope == pytest.approx(-0.75, abs=0.01)
    low, high = score.extras["interval"]
    half = (high - low) / 2
    assert half < 0.02
    # Twice 95 % are four standard deviations; those of 4000 other lines are twice those of SIDE^2.
    assert abs(score.value - slope) < 2 * half
    assert abs(listed - slope) < 2 * 2 * half


def axis_samples(sampler: str, rng: np.random.Generator, count: int, edges: int) -> np.ndarray:
    """(edges, count) coordinates across an edge along an axis."""
    if sampler == "random":
        return rng.uniform(size=(edges, count))
    strata = count if sampler == "N-rooks" else math.isqrt(count)
    return (np.arange(count) % strata + rng.uniform(size=(edges, count))) / strata


@pytest.mark.parametrize("count", [1, 4, 9, 16, 64, 256])
@pytest.mark.parametrize("sampler", ["random", "jittered", "N-rooks"])
def test_an_edge_along_an_axis_costs_random_samplers_their_closed_form(make_scene, rgb, sampler, count):
    expected = {
        "random": 1 / (6 * count),
        "jittered": 1 / (6 * count**1.5),
        "N-rooks": 1 / (6 * count**2),
    }[sampler]
    offset = ((np.arange(SIDE * SIDE) + 0.5) / (SIDE * SIDE))[:, None]
    samples = axis_samples(sampler, np.random.default_rng(count), count, offset.size)
    shares = (samples < offset).mean(axis=1).reshape(1, SIDE, SIDE)
    truth = offset.reshape(1, SIDE, SIDE)
    score = measure("rmse", rgb(shares), rgb(truth), scene=make_scene((SIDE, SIDE)), filter_radius_px=0)
    tolerance = 4 * 2 * spread((shares - truth) ** 2, SIDE * SIDE)
    assert tolerance < 0.07
    assert score.value**2 == pytest.approx(expected, rel=tolerance)
    listed = {"random": 0.0104167, "jittered": 0.0026042, "N-rooks": 6.5104e-4}
    if count == 16:
        assert expected == pytest.approx(listed[sampler], rel=1e-4)


@pytest.mark.parametrize("count", [1, 4, 16, 64, 256])
@pytest.mark.parametrize("kind", ["grid", "rotated grid"])
def test_an_edge_along_an_axis_costs_regular_samplers_their_closed_form(make_scene, rgb, kind, count):
    levels = math.isqrt(count) if kind == "grid" else count
    truth = ((np.arange(SIDE * SIDE) + 0.5) / (SIDE * SIDE)).reshape(1, SIDE, SIDE)
    shares = np.floor(truth * levels + 0.5) / levels
    score = measure("rmse", rgb(shares), rgb(truth), scene=make_scene((SIDE, SIDE)), filter_radius_px=0)
    # Midpoint rule of 2^14 offsets, whose jumps at odd multiples of 1 / (2 levels) lie between midpoints: second
    # derivative 2, error 2 / 24 of a step squared.
    assert score.value**2 == pytest.approx(1 / (12 * levels**2), abs=1.001 * 2 / 24 / SIDE**4)
    if count == 16:
        listed = {"grid": 0.0052083, "rotated grid": 3.2552e-4}[kind]
        assert score.value**2 == pytest.approx(listed, rel=1e-4)
