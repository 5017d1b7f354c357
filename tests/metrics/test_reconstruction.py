"""Laws of reconstruction: every kernel against its transform, and measured errors against Parseval's sum."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aliasbench.metrics.reconstruction import KERNELS, expected_rmse, interval_nodes, kernel_of, reconstruct, response
from aliasbench.scenes.errors import InputError

NAMES = sorted(KERNELS)
FREQUENCIES = st.floats(0.0, 4.0)


def integral(name: str, nu: float, shift: float = 0.0) -> float:
    """The integral of k(x) k(x + shift) (or of k(x) where shift is nan) times cos(2 pi nu x), to rounding."""
    kernel = KERNELS[name]
    nodes, weights = np.polynomial.legendre.leggauss(60)
    knots = np.arange(-math.ceil(2 * kernel.radius), math.ceil(2 * kernel.radius) + 1) / 2
    total = 0.0
    for a, b in pairwise(knots):
        x = (a + b) / 2 + (b - a) / 2 * nodes
        other = 1.0 if math.isnan(shift) else kernel.evaluate(x + shift)
        total += float(np.sum(weights * (b - a) / 2 * kernel.evaluate(x) * other * np.cos(2 * np.pi * nu * x)))
    return total


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=25)
@given(nu=st.one_of(st.floats(-8.0, 8.0), st.floats(-0.02, 0.02)))
def test_the_transform_is_the_integral_of_the_kernel_times_a_wave(name: str, nu: float) -> None:
    closed = float(KERNELS[name].transform(np.array([nu]))[0])
    # Mitchell's closed form cancels like eps / (pi nu)^2, at most 1e-12 where the series takes over
    assert closed == pytest.approx(integral(name, nu, math.nan), abs=4e-12)


@pytest.mark.parametrize("name", NAMES)
def test_kernels_are_even_have_unit_area_and_end_at_their_radius(name: str) -> None:
    kernel = KERNELS[name]
    x = np.linspace(0.01, kernel.radius * 1.5, 333)
    np.testing.assert_allclose(kernel.evaluate(x), kernel.evaluate(-x), rtol=0, atol=1e-16)
    assert (kernel.evaluate(x[x > kernel.radius]) == 0.0).all()
    assert kernel.transform(np.array([0.0]))[0] == pytest.approx(1.0, abs=1e-14)
    assert integral(name, 0.0, math.nan) == pytest.approx(1.0, abs=1e-13)


def test_mitchell_has_its_published_values() -> None:
    # B = C = 1/3: (6 - 2B) / 6 in the middle, B / 6 a sample away, 0 two away
    values = kernel_of("mitchell").evaluate(np.array([0.0, 1.0, 2.0]))
    np.testing.assert_allclose(values, [8 / 9, 1 / 18, 0.0], atol=1e-15)


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=20)
@given(nu=FREQUENCIES, amplitude=st.floats(0.01, 2.0))
def test_the_expected_error_is_parsevals_sum_over_the_images(name: str, nu: float, amplitude: float) -> None:
    kernel = KERNELS[name]
    own = float(kernel.transform(np.array([nu]))[0])
    # The sum of K^(nu - k)^2 over all k, by Poisson: the kernel's correlations at whole distances.
    reach = math.ceil(2 * kernel.radius)
    if name == "box":
        images = 1.0  # of the half-open box, not of its quadrature at distance 1
    else:
        images = sum(integral(name, 0.0, m) * math.cos(2 * math.pi * nu * m) for m in range(-reach, reach + 1))
    square = max(1.0 - 2.0 * own + images, 0.0)
    expected = amplitude / math.sqrt(2) * math.sqrt(square)
    found = expected_rmse(nu, name, amplitude=amplitude, normalised=False)
    # near 0 the root of a difference of ones: rounding of 1e-15 in the square
    assert found**2 == pytest.approx(expected**2, abs=3e-13 * amplitude**2)


@settings(max_examples=20)
@given(nu=FREQUENCIES)
def test_box_and_tent_have_the_errors_of_their_docstring(nu: float) -> None:
    half = 1 / (2 * math.sqrt(2))
    assert expected_rmse(nu, "box") == pytest.approx(half * math.sqrt(2 - 2 * np.sinc(nu)), abs=2e-8)
    square = 1 - 2 * np.sinc(nu) ** 2 + (2 + math.cos(2 * math.pi * nu)) / 3
    assert expected_rmse(nu, "tent") == pytest.approx(half * math.sqrt(max(square, 0.0)), abs=2e-8)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("phases", [3, 7])
def test_a_few_equally_spaced_phases_have_the_expected_error_at_any_frequency(name: str, phases: int) -> None:
    offsets, weights = interval_nodes(40)
    for nu in (0.1234, 0.5, 0.77, 1.0, 2.31):
        x = (np.arange(8, 24)[:, None] + offsets).ravel()
        phase = np.arange(phases)[:, None] / phases
        truth = 0.5 + 0.5 * np.cos(2 * np.pi * (nu * x + phase))
        samples = 0.5 + 0.5 * np.cos(2 * np.pi * (nu * (np.arange(32) + 0.5) + phase))
        square = np.mean((reconstruct(samples, x, name) - truth) ** 2, axis=0) @ np.tile(weights / 16, 16)
        assert math.sqrt(square) == pytest.approx(expected_rmse(nu, name), abs=1e-9)


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=15)
@given(nu=FREQUENCIES, phase=st.floats(0.0, 1.0), shift=st.floats(0.0, 1.0))
def test_a_wave_comes_back_times_the_response(name: str, nu: float, phase: float, shift: float) -> None:
    x = np.arange(8, 24) + shift
    samples = np.cos(2 * np.pi * (nu * (np.arange(32) + 0.5) + phase))
    for normalised in (True, False):
        factor = response(nu, x - 0.5, name, normalised=normalised)
        expected = np.real(np.exp(2j * np.pi * (nu * x + phase)) * factor)
        found = reconstruct(samples, x, name, normalised=normalised)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_constants_come_back_everywhere_and_a_periodic_row_goes_on(name: str) -> None:
    x = np.linspace(-30.0, 60.0, 1201)
    np.testing.assert_allclose(reconstruct(np.full((2, 16), 0.3), x, name), 0.3, rtol=1e-14)
    samples = np.random.default_rng(3).random(16)
    once, again = (reconstruct(samples, x + k * 16, name, periodic=True) for k in (0, 3))
    np.testing.assert_allclose(once, again, rtol=0, atol=1e-12)


def test_box_shows_each_sample_over_its_pixel_and_tent_goes_through_all() -> None:
    samples = np.random.default_rng(4).random(9)
    x = np.linspace(0.0, 9.0, 91)[:-1] + 0.05
    np.testing.assert_array_equal(reconstruct(samples, x, "box"), samples[np.floor(x).astype(int)])
    np.testing.assert_array_equal(reconstruct(samples, np.arange(9.0), "box"), samples)
    np.testing.assert_allclose(reconstruct(samples, np.arange(9) + 0.5, "tent"), samples, rtol=0, atol=1e-15)
    np.testing.assert_allclose(reconstruct(samples, np.arange(1.0, 9.0), "tent"), (samples[1:] + samples[:-1]) / 2)


def test_unknown_kernels_are_refused() -> None:
    with pytest.raises(InputError, match="unknown reconstruction kernel 'tend'; did you mean 'tent'"):
        reconstruct([0.0, 1.0], [0.5], "tend")
