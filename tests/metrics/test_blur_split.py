"""The split into blur and alias: known kernels are found, known aliases are left."""

import math

import numpy as np
import pytest
from scipy import ndimage

from aliasbench.metrics.blur_split import RIDGE, split_blur
from aliasbench.metrics.catalog import measure

DELTA = np.pad([[1.0]], 2)


def convolve(picture, kernel):
    """(h * R)(p) = sum over k of h[k] R(p - k); the border, of which two pixels are wrong, is not looked at."""
    return np.stack([ndimage.convolve(p, kernel, mode="nearest") for p in picture])


def spread_design(reference):
    """One column to each of the kernel's taps, one row to each pixel inside the border, without the columns' means."""
    _, h, w = reference.shape
    columns = [reference[:, 2 - y : h - 2 - y, 2 - x : w - 2 - x].ravel() for y in range(-2, 3) for x in range(-2, 3)]
    design = np.stack(columns, axis=1)
    return design - design.mean(axis=0)


def inside(picture):
    return picture[:, 2:-2, 2:-2]


def random_kernel(seed):
    kernel = np.random.default_rng(seed).normal(size=(5, 5))
    return DELTA + 0.2 * (kernel - kernel.mean())


@pytest.mark.parametrize("size", [(1, 40, 64), (3, 21, 33), (2, 70, 16)])
def test_it_is_the_ridge_regression_that_it_says(size):
    rng = np.random.default_rng(size[1])
    reference = ndimage.gaussian_filter(rng.normal(size=size), (0, 0.7, 0.4)) + 3.0
    test = convolve(reference, random_kernel(1)) + 0.1 * rng.normal(size=size) - 0.3
    split = split_blur(test, reference)
    design, error = spread_design(reference), inside(test - reference).ravel()
    centered = error - error.mean()
    stacked = np.concatenate([design, np.sqrt(RIDGE * error.size) * np.eye(25)])
    change = np.linalg.lstsq(stacked, np.concatenate([centered, np.zeros(25)]), rcond=None)[0]
    # Sums of some thousand products, in another order; the least eigenvalue is above 1e-4 of the largest.
    assert split.kernel == pytest.approx(DELTA + change.reshape(5, 5), abs=1e-9)
    assert split.blur == pytest.approx(np.sqrt(np.mean((design @ change) ** 2)), rel=1e-9)
    assert split.residual == pytest.approx(np.sqrt(np.mean((centered - design @ change) ** 2)), rel=1e-9)
    assert split.offset == pytest.approx(error.mean(), rel=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_a_known_kernel_is_recovered(seed):
    reference = np.random.default_rng(seed).uniform(size=(1, 60, 50))
    kernel = random_kernel(seed + 10)
    split = split_blur(convolve(reference, kernel), reference)
    design = spread_design(reference)
    values = np.linalg.eigvalsh(design.T @ design / len(design))
    change = float(np.linalg.norm(kernel - DELTA))
    # (A + ridge)^-1 A is short of 1 by at most ridge / least eigenvalue; what is missing is the residual.
    short = RIDGE / values[0] * change
    assert split.kernel == pytest.approx(kernel, abs=short)
    assert short < 1e-4
    assert split.residual <= short * math.sqrt(values[-1]) + 1e-8
    blurred = inside(convolve(reference, kernel) - reference)
    assert split.blur == pytest.approx(np.std(blurred), rel=1e-4)


@pytest.mark.parametrize("amplitude", [0.3, 0.02])
def test_an_alias_that_the_reference_has_not_is_residual(amplitude):
    # Whole periods in the 64 pixels inside the border, so that different frequencies are orthogonal at any shift.
    rng = np.random.default_rng(2)
    y, x = np.mgrid[:68, :68] / 64.0
    reference = sum(
        rng.normal() * np.cos(2 * np.pi * (i * x + j * y) + rng.uniform(0, 6))
        for i in range(13)
        for j in range(-12, 13)
        if (i, j) > (0, 0)
    )[None]
    alias = amplitude * np.cos(2 * np.pi * (26 * x + 3 * y) + 1.0)
    split = split_blur(reference + alias, reference)
    assert split.residual == pytest.approx(amplitude / math.sqrt(2), rel=1e-9)
    # Only rounding of the sums over 4096 pixels is left, times the ridge's inverse at most.
    assert split.blur < 1e-7
    assert split.offset == pytest.approx(0.0, abs=1e-12)
    kernel = random_kernel(5)
    both = split_blur(convolve(reference, kernel) + alias, reference)
    assert both.residual == pytest.approx(amplitude / math.sqrt(2), rel=1e-3)
    assert both.blur == pytest.approx(np.std(inside(convolve(reference, kernel) - reference)), rel=1e-3)


@pytest.mark.parametrize("value", [0.0, 0.5, 40.0])
def test_equal_pictures_are_equal_and_a_constant_error_is_an_offset(value):
    flat = np.full((2, 20, 20), value)
    rough = np.random.default_rng(0).uniform(size=flat.shape)
    for picture in (flat, rough):
        split = split_blur(picture, picture)
        assert (split.blur, split.residual, split.offset) == (0.0, 0.0, 0.0)
        assert np.array_equal(split.kernel, DELTA)
        shifted = split_blur(picture + 0.25, picture)
        assert shifted.offset == pytest.approx(0.25, rel=1e-12)
        # sqrt of rounding of squares
        assert max(shifted.blur, shifted.residual) < 1e-6


def test_squares_add_up_and_constants_do_not_matter():
    rng = np.random.default_rng(6)
    reference = rng.uniform(size=(2, 30, 30))
    test = convolve(reference, random_kernel(3)) + rng.normal(size=reference.shape) * 0.05 + 0.1
    split, lifted = split_blur(test, reference), split_blur(test + 7.0, reference + 7.0)
    square = float(np.mean(inside(test - reference) ** 2))
    # The ridge moves at most 2 |change|^2 ridge from one part to another.
    assert split.blur**2 + split.residual**2 + split.offset**2 == pytest.approx(square, abs=4 * RIDGE)
    for name in ("blur", "residual", "offset"):
        assert getattr(lifted, name) == pytest.approx(getattr(split, name), rel=1e-9)


def test_shift_by_a_pixel_is_a_kernel_with_the_shift_in_it():
    reference = np.random.default_rng(9).uniform(size=(1, 40, 40))
    for dy, dx in ((0, 1), (-2, 1)):
        split = split_blur(np.roll(reference, (dy, dx), axis=(1, 2)), reference)
        assert np.unravel_index(int(np.argmax(split.kernel)), (5, 5)) == (2 + dy, 2 + dx)
        assert split.kernel[2 + dy, 2 + dx] == pytest.approx(1.0, abs=1e-4)


def test_small_or_endless_pictures_have_no_split():
    assert split_blur(np.zeros((1, 15, 40)), np.zeros((1, 15, 40))) is None
    huge = 1e300 * np.random.default_rng(0).normal(size=(1, 20, 20))
    with np.errstate(all="ignore"):
        assert split_blur(huge, huge * 0.5) is None


def test_moire_tells_blur_from_noise(make_scene, rgb):
    rng = np.random.default_rng(4)
    reference = rng.uniform(size=(5, 52, 48))
    kernel = np.outer([0, 1, 2, 1, 0], [0, 1, 2, 1, 0]) / 16.0
    blurred = convolve(reference, kernel)
    sigma = 0.05
    seeds = blurred + sigma * rng.normal(size=(3, *blurred.shape))
    scene = make_scene((48, 52), contrast=2.0)
    score = measure("moire", rgb(2.0 * seeds), rgb(2.0 * reference), scene=scene, filter_radius_px=1.0)
    # 25 taps take 25 of 3 x 3 x 46 x 42 values; their spread is 1 / sqrt(2 n), and this is five of it.
    values = 9 * 46 * 42
    assert score.extras["residual"] == pytest.approx(sigma, rel=25 / values + 5 / math.sqrt(2 * values))
    assert score.extras["blur"] == pytest.approx(np.std(blurred - reference), rel=0.02)
    exact = measure("moire", rgb(reference), rgb(reference), scene=scene)
    assert [exact.extras[k] for k in ("blur", "residual", "offset")] == [0.0, 0.0, 0.0]
    small = measure("moire", rgb(reference[:, :16, :16]), rgb(reference[:, :16, :16]), scene=make_scene((16, 16)))
    assert small.extras["blur"] is None
