"""Laws of quantisation: closed forms of the error without dither and with, and what dither keeps."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aliasbench.metrics.quantisation import Dither, dither_noise, quantisation_rms, quantise
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.textures import srgb_to_linear

MANY = 1 << 17


@settings(max_examples=25)
@given(st.lists(st.floats(-1.0, 2.0), min_size=1, max_size=20), st.integers(1, 24))
def test_without_dither_values_go_to_the_nearest_level_in_range(values: list[float], bits: int) -> None:
    top = 2**bits - 1
    out = quantise(values, bits)
    clipped = np.clip(values, 0.0, 1.0)
    assert np.abs(out - clipped).max() <= (0.5 + 1e-7) / top
    np.testing.assert_allclose(out * top, np.rint(out * top), rtol=0, atol=1e-6)
    np.testing.assert_array_equal(quantise(out, bits), out)


@pytest.mark.parametrize("bits", [4, 8, 12])
@pytest.mark.parametrize("dither", ["none", "uniform", "triangular"])
def test_the_error_over_all_values_has_its_closed_form(bits: int, dither: Any) -> None:
    # whole steps, two from the ends at least, so that nothing is clamped
    top = 2**bits - 1
    values = (2 + (top - 4) * (np.arange(MANY) + 0.5) / MANY) / top
    found = np.sqrt(np.mean((quantise(values, bits, dither, seed=5) - values) ** 2))
    # n squares of at most 9/4 steps^2: the mean square of about 1/4 is known to 4 * .5 / sqrt(n)
    assert found == pytest.approx(quantisation_rms(bits, dither), rel=8 / math.sqrt(MANY) if dither != "none" else 2e-3)
    assert quantisation_rms(8) == pytest.approx(1 / (255 * math.sqrt(12)))


@pytest.mark.parametrize("share", [0.0, 0.1, 0.37, 0.5, 0.93])
def test_dither_keeps_the_mean_of_any_value_and_the_triangular_one_its_noise_too(share: float) -> None:
    value = (100 + share) / 255
    variances: dict[Dither, float] = {"uniform": share * (1 - share), "triangular": 0.25}
    for dither, variance in variances.items():
        error = 255 * (quantise(np.full(MANY, value), 8, dither, seed=2) - value)
        assert np.mean(error) == pytest.approx(0.0, abs=4.5 * math.sqrt(variance / MANY) + 1e-12)
        # errors lie within 3/2: fourth moments are below 9/4 of second ones
        assert np.mean(error**2) == pytest.approx(variance, abs=4.5 * 1.5 * math.sqrt(variance / MANY) + 1e-12)
    # while rounding alone is off by the same everywhere
    plain = 255 * (quantise(np.full(3, value)) - value)
    np.testing.assert_allclose(plain, round(share) - share, rtol=0, atol=1e-12)


def test_a_wave_of_less_than_half_a_step_survives_in_dither_only() -> None:
    wave = 0.4 * np.cos(2 * np.pi * 0.05 * np.arange(MANY))
    values = (100 + wave) / 255
    assert np.ptp(quantise(values)) == 0.0
    kept = 255 * quantise(values, dither="triangular", seed=1) - 100
    # regression on the wave: the noise of 1/2 a step over |wave| sqrt(n)
    assert kept @ wave / (wave @ wave) == pytest.approx(1.0, abs=4.5 * 0.5 / math.sqrt(wave @ wave))


def test_srgb_levels_are_the_bytes_of_a_picture_and_dither_keeps_the_mean_of_what_is_stored() -> None:
    levels = srgb_to_linear(np.arange(256) / 255.0)
    np.testing.assert_allclose(quantise(levels, encoding="srgb"), levels, rtol=0, atol=1e-15)
    # linear .5 is sRGB 187.5 / 255 in 8 bits: 188
    assert quantise([0.5], encoding="srgb")[0] == levels[188]
    stored = 100.3 / 255
    out = quantise(np.full(MANY, srgb_to_linear(np.array(stored))), 8, "uniform", 3, "srgb")
    share = np.mean(np.isclose(out, levels[101]))
    assert share == pytest.approx(0.3, abs=4.5 * math.sqrt(0.21 / MANY))
    assert set(np.unique(np.searchsorted(levels, out - 1e-9))) == {100, 101}


def test_noise_is_uniform_unrelated_to_its_neighbours_and_to_other_seeds_and_repeats() -> None:
    noises = [dither_noise((MANY,), seed, stream) for seed in (0, 1, 2**40) for stream in (0, 1)]
    np.testing.assert_array_equal(noises[0], dither_noise((MANY,), 0, 0))
    np.testing.assert_array_equal(noises[0].reshape(2, -1), dither_noise((2, MANY // 2), 0, 0))
    for index, noise in enumerate(noises):
        assert -0.5 <= noise.min() < -0.4999
        assert 0.4999 < noise.max() < 0.5
        counts = np.histogram(noise, 64, (-0.5, 0.5))[0]
        chi = np.sum((counts - MANY / 64) ** 2) / (MANY / 64)
        assert abs(chi - 63) < 4.5 * math.sqrt(2 * 63)
        for other in (np.roll(noise, 1), *noises[:index]):
            assert abs(noise @ other) * 12 / MANY < 4.5 / math.sqrt(MANY)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"dither": "triangle"}, "unknown dither 'triangle'; did you mean 'triangular'"),
        ({"encoding": "sRgb"}, "unknown encoding 'sRgb'; did you mean 'srgb'"),
        ({"bits": 0}, "bits = 0: must be a whole number from 1 to 24"),
        ({"bits": 8.0}, "bits = 8.0: must be a whole number"),
        ({"bits": True}, "bits = True: must be a whole number"),
        ({"seed": -1}, "seed = -1: must be a whole number from 0"),
    ],
)
def test_wrong_options_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        quantise([0.5], **options)


def test_values_that_are_not_finite_and_unknown_dither_are_refused() -> None:
    with pytest.raises(InputError, match="one is not finite"):
        quantise([0.5, math.inf])
    wrong: Any = "blue"
    with pytest.raises(InputError, match="unknown dither 'blue'"):
        quantisation_rms(8, wrong)
