"""Laws of the recovered frequency: exact without noise, at the alias, and as uncertain as theory says with noise."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aliasbench.metrics.quantisation import quantisation_rms, quantise
from aliasbench.metrics.spectral_line import aliased_frequency, line_deviation, recover_frequency
from aliasbench.scenes.errors import InputError


def wave(nu: float, phase: np.ndarray | float, count: int = 64, amplitude: float = 0.5) -> np.ndarray:
    phases = np.atleast_1d(phase)[:, None]
    return 0.5 + amplitude * np.cos(2 * np.pi * (nu * (np.arange(count) + 0.5) + phases))


def test_the_alias_is_the_distance_to_the_nearest_whole_number() -> None:
    given_, expected = (
        [0.0, 0.3, 0.5, 0.7, 0.95, 1.0, 1.05, 2.5, 3.4, -0.2],
        [0, 0.3, 0.5, 0.3, 0.05, 0, 0.05, 0.5, 0.4, 0.2],
    )
    np.testing.assert_allclose(aliased_frequency(given_), expected, atol=1e-15)


@settings(max_examples=60)
@given(st.floats(0.0, 5.0), st.floats(0.0, 1.0), st.integers(32, 200))
def test_a_single_line_is_found_exactly_at_its_alias(nu: float, phase: float, count: int) -> None:
    alias = float(aliased_frequency(nu))
    # a cycle and a half of the wave, and of its beat with 1/2, in the row: else see the next tests
    if not 1.5 / count < alias < 0.5 - 1.5 / count:
        alias = 0.25
        nu = math.floor(nu) + 0.25
    line = recover_frequency(wave(nu, phase, count))
    assert line.cycles_per_px == pytest.approx(alias, abs=1e-11)
    np.testing.assert_allclose(line.amplitudes, 0.5, rtol=1e-9)
    assert line.residual_rms < 1e-11


@pytest.mark.parametrize("nu", [0.5, 1.5, 0.499, 0.503])
def test_near_half_a_cycle_rows_of_several_phases_tell_the_frequency(nu: float) -> None:
    line = recover_frequency(wave(nu, np.arange(8) / 8))
    assert line.cycles_per_px == pytest.approx(float(aliased_frequency(nu)), abs=1e-9)


def test_at_half_a_cycle_the_amplitude_is_the_sine_of_the_phase() -> None:
    phases = np.arange(16) / 16
    line = recover_frequency(wave(0.5, phases))
    # samples at (j + 1/2) / 2 cycles: cos(pi j + pi / 2 + 2 pi phase)
    np.testing.assert_allclose(line.amplitudes, 0.5 * np.abs(np.sin(2 * np.pi * phases)), rtol=0, atol=1e-12)


@pytest.mark.parametrize("nu", [0.0, 1.0, 3.0])
def test_whole_frequencies_are_constants_without_a_wave(nu: float) -> None:
    line = recover_frequency(wave(nu, np.arange(4) / 4))
    assert (line.cycles_per_px, line.amplitudes.max()) == (0.0, 0.0)
    assert line.residual_rms < 1e-12


@pytest.mark.parametrize("count", [8, 24, 63, 256])
def test_half_a_cycle_per_sample_is_found_exactly_at_any_phases(count: int) -> None:
    phases = (0.0, 0.03, 0.1, 0.2, 0.37, 0.5, 0.51, 0.8)
    rows = np.concatenate([np.atleast_2d(wave(0.5, phase, count)) for phase in phases])
    line = recover_frequency(rows, least_amplitude=1e-9)
    assert line.cycles_per_px == 0.5
    assert recover_frequency(rows[3]).cycles_per_px == 0.5


def test_a_wave_below_the_least_amplitude_is_none() -> None:
    rows = wave(0.2, 0.1, amplitude=1e-4)
    assert recover_frequency(rows).cycles_per_px == pytest.approx(0.2, abs=1e-9)
    assert recover_frequency(rows, least_amplitude=1e-3).cycles_per_px == 0.0


def test_the_strongest_of_two_lines_is_found() -> None:
    rows = wave(0.11, 0.3, 256) + wave(0.37, 0.1, 256, 0.1)
    # the other line pulls by less than its share over the separation in bins
    assert recover_frequency(rows).cycles_per_px == pytest.approx(0.11, abs=0.1 / 256)


def test_the_frequency_of_noisy_rows_deviates_as_the_bound_says() -> None:
    rng = np.random.default_rng(11)
    found = [
        recover_frequency(wave(0.2137, rng.random(), 64) + rng.normal(0.0, 0.05, 64)).cycles_per_px for _ in range(400)
    ]
    expected = line_deviation(0.05, 0.5, 64)
    # the deviation of 400 has an error of 1 / sqrt(800) of itself, the mean one of 1 / 20 of a deviation
    assert np.std(found) == pytest.approx(expected, rel=4 / math.sqrt(800))
    assert np.mean(found) == pytest.approx(0.2137, abs=4 * expected / 20)


def test_eight_bits_with_dither_move_the_frequency_by_what_their_noise_does() -> None:
    rows = wave(0.2137, 0.2, 4096, 0.4)
    bound = line_deviation(quantisation_rms(8, "triangular"), 0.4, 4096)
    for seed in range(8):
        moved = recover_frequency(quantise(rows, 8, "triangular", seed)).cycles_per_px - 0.2137
        assert 0.0 < abs(moved) < 4.5 * bound


def test_rows_that_cannot_be_fitted_are_refused() -> None:
    with pytest.raises(InputError, match=r"rows of shape \(1, 7\): at least 8 samples"):
        recover_frequency(np.zeros(7))
    with pytest.raises(InputError, match="a sample is not finite"):
        recover_frequency([0.0] * 8 + [math.nan])
