"""General error against closed forms of a straight edge (sections of unit-step pictures under known samplers)."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy import special

from aliasbench.metrics.catalog import measure
from aliasbench.scenes.model import Scene

STEPS = 256


def edge_offsets(steps: int = STEPS) -> np.ndarray:
    return (np.arange(steps) + 0.5) / steps


def vertical_edge(levels: Callable[[np.ndarray], np.ndarray], width: int = 12, steps: int = STEPS) -> np.ndarray:
    """(steps, 4, width): bright left of x = 5 + offset; the value of a pixel from the edge's distance to its left."""
    u = 5.0 + edge_offsets(steps)[:, None] - np.arange(width)
    return np.repeat(levels(u)[:, None, :], 4, axis=1)


def box(u: np.ndarray) -> np.ndarray:
    return np.clip(u, 0.0, 1.0)


def tent(u: np.ndarray) -> np.ndarray:
    """Integral of the tent of radius 1 about the pixel's middle up to the edge."""
    v = np.clip(u - 0.5, -1.0, 1.0)
    return np.where(v < 0.0, (1.0 + v) ** 2 / 2, 1.0 - (1.0 - v) ** 2 / 2)


def point(u: np.ndarray) -> np.ndarray:
    return (u > 0.5).astype(np.float64)


def gauss(u: np.ndarray) -> np.ndarray:
    return special.ndtr((u - 0.5) / 0.5)


def regular(n: int) -> Callable[[np.ndarray], np.ndarray]:
    return lambda u: np.clip(np.round(u * n), 0, n) / n


def per_edge_pixel(test: np.ndarray, reference: np.ndarray, scene: Scene, rgb, radius: float) -> float:
    """Sum of squared error per pixel of edge length, from the RMSE that `measure` returns."""
    score = measure("rmse", rgb(test), rgb(reference), scene=scene, filter_radius_px=radius)
    assert score.status == "ok"
    return float(score.value or 0.0) ** 2 * (test.shape[2] - 2 * math.ceil(radius))


@pytest.mark.parametrize(
    ("levels", "truth", "expected"),
    [
        (point, box, 1 / 12),
        (regular(4), box, 1 / (12 * 16)),  # 4 x 4 on the grid: 4 levels, 1 / (12 N)
        (regular(16), box, 1 / (12 * 16**2)),  # 16 distinct offsets: 1 / (12 N^2)
        (point, tent, 1 / 10),
        (point, gauss, 0.5 * (math.sqrt(2) - 1) / math.sqrt(math.pi)),
        (box, tent, 1 / 160),  # what using the wrong filter costs
    ],
)
def test_square_error_of_an_edge_has_its_closed_form(make_scene, rgb, levels, truth, expected):
    got = per_edge_pixel(vertical_edge(levels), vertical_edge(truth), make_scene((12, 4)), rgb, 1.0)
    # Midpoint rule over the offsets: E^2 is piecewise quadratic with second derivative at most 2 on pieces whose ends
    # (multiples of 1/32) fall between midpoints, so the error is at most 2 / (24 STEPS^2) a pixel over 5 pixels; the
    # Gaussian beyond the border (4 pixels off, 8 sigma) is below 1e-15.
    assert got == pytest.approx(expected, abs=5 * 2 / (24 * STEPS**2))


@pytest.mark.parametrize(("slope", "expected"), [(0.0, 1 / 12), (0.3, 0.0802499), (1.0, math.sqrt(2) / 20)])
def test_square_error_per_edge_length_depends_on_the_angle_as_derived(
    make_scene, rgb, box_edge, point_edge, slope, expected
):
    size, steps = (42, 60), 500
    a, b = 1 / math.hypot(1, slope), slope / math.hypot(1, slope)
    assert a / 12 + b**3 / (60 * a**2) == pytest.approx(expected, abs=1e-6)
    offsets = 8.0 + edge_offsets(steps)
    truth = np.array([box_edge(size, slope, o) for o in offsets])
    test = np.array([point_edge(size, slope, o) for o in offsets])
    score = measure("rmse", rgb(test), rgb(truth), scene=make_scene(size))
    columns, pixels = size[0] - 2, (size[0] - 2) * (size[1] - 2)
    per_length = float(score.value or 0.0) ** 2 * pixels / (columns * math.hypot(1, slope))
    # A point sample jumps twice per offset and column at most, of E^2 <= 1/4: the midpoint rule is off by half of that.
    assert per_length == pytest.approx(expected, abs=2 * 0.25 / steps)


def test_psnr_is_the_rmse_in_decibels_and_identical_pictures_have_none(make_scene, rgb):
    reference = rgb(np.zeros((1, 8, 8)))
    assert measure("psnr", reference + 0.1, reference, scene=make_scene((8, 8))).value == pytest.approx(20.0, abs=1e-9)
    score = measure("psnr", reference, reference, scene=make_scene((8, 8)))
    assert (score.value, score.status) == (None, "identical")


def test_relmse_divides_by_the_reference_and_stays_finite_in_the_dark(make_scene, rgb):
    scene = make_scene((8, 8), contrast=2.0)
    for level in (0.0, 3.0):
        reference = rgb(np.full((1, 8, 8), level))
        score = measure("relmse", reference + 0.5, reference, scene=scene)
        assert score.value == pytest.approx(0.25 / (level**2 + 1e-2 * 4.0), rel=1e-12)


def test_max_error_says_where_it_is(make_scene, rgb):
    reference = np.zeros((3, 9, 9))
    test = reference.copy()
    test[1, 4, 6] = -0.75
    score = measure("max_error", rgb(test), rgb(reference), scene=make_scene((9, 9)), frame_start=10)
    assert score.value == pytest.approx(0.75, abs=1e-12)
    assert {k: score.extras[k] for k in ("frame", "row", "column")} == {"frame": 11, "row": 4, "column": 6}


def test_rmse_is_of_luminance_and_keeps_the_channels_beside_it(make_scene, rgb):
    reference = rgb(np.zeros((1, 8, 8)))
    test = reference.copy()
    test[..., 1] = 0.5
    score = measure("rmse", test, reference, scene=make_scene((8, 8)))
    assert score.value == pytest.approx(0.5 * 0.7152, rel=1e-12)
    assert score.extras["rgb"] == [0.0, 0.5, 0.0]


def test_rmse_of_several_seeds_keeps_each_of_theirs(make_scene, rgb):
    test = np.random.default_rng(2).normal(size=(3, 2, 8, 8))
    score = measure("rmse", rgb(test), rgb(np.zeros((2, 8, 8))), scene=make_scene((8, 8)), filter_radius_px=0)
    assert score.extras["by_seed"] == pytest.approx(np.sqrt((test**2).mean(axis=(1, 2, 3))), rel=1e-12)
    assert score.value == pytest.approx(math.sqrt(np.mean(np.square(score.extras["by_seed"]))), rel=1e-12)
    one = measure("rmse", rgb(test[0]), rgb(np.zeros((2, 8, 8))), scene=make_scene((8, 8)))
    assert "by_seed" not in one.extras


def test_ssim_is_one_for_equal_pictures_and_falls_with_noise(make_scene, rgb):
    scene = make_scene((24, 24))
    truth = np.indices((1, 24, 24)).sum(axis=0) % 7 / 6.0
    noise = np.random.default_rng(1).normal(size=truth.shape)
    scores = [measure("ssim", rgb(truth + s * noise), rgb(truth), scene=scene).value for s in (0.0, 0.05, 0.2)]
    assert scores[0] == pytest.approx(1.0, abs=1e-12)
    assert 1.0 > float(scores[1] or 0) > float(scores[2] or 0) > 0.0


def test_ssim_sees_negative_pixels_as_black_and_counts_them(make_scene, rgb):
    truth = np.zeros((1, 16, 16))
    test = truth.copy()
    test[0, 5, 5] = -0.25
    score = measure("ssim", rgb(test), rgb(truth), scene=make_scene((16, 16)))
    assert score.value == pytest.approx(1.0, abs=1e-12)
    assert score.extras["negative_pixels"] == 1
    assert measure("rmse", rgb(test), rgb(truth), scene=make_scene((16, 16))).value == pytest.approx(
        0.25 / 14, rel=1e-12
    )
