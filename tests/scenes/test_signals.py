"""Laws of the scenes that are signals: their facts are their waves, at every row and as far as wide pictures reach."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aliasbench.scenes.catalog import SCENES, build_scene
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Grating, ImageTexture
from aliasbench.scenes.signals import JOINTS, irregular_bars, sweep_rates


@settings(max_examples=20)
@given(st.floats(0.001, 16.0), st.integers(1, 8192), st.floats(-1.0, 1.0), st.sampled_from(["sine", "square"]))
def test_the_frequency_is_in_cycles_per_pixel_of_a_picture_of_that_many_rows(
    frequency: float, rows: int, phase: float, profile: str
) -> None:
    scene = SCENES["signals"].build(frequency=frequency, rows=rows, phase=phase, profile=profile)
    assert scene.camera.height is not None
    pixel = scene.camera.height / rows
    ((across, down),) = (g.cycles_per_unit for g in scene.facts.gratings)
    assert across * pixel == pytest.approx(frequency, rel=1e-14)
    assert down == 0.0
    wave = scene.textures["wave"]
    assert isinstance(wave, Grating)
    # texture coordinates are world units, so that the texture's cycles are the fact's
    assert (wave.cycles, wave.angle_deg, wave.phase, wave.profile) == (across, 0.0, phase, profile)
    for surface in scene.objects:
        assert surface.uv is not None
        np.testing.assert_array_equal(surface.uv, surface.vertices[:, :2])


def test_the_pieces_of_a_wave_join_and_reach_the_widest_row() -> None:
    spans = sorted((s.vertices[:, 0].min(), s.vertices[:, 0].max()) for s in SCENES["signals"].build().objects)
    assert spans[0][0] == -JOINTS[-1]
    assert spans[-1][1] == JOINTS[-1]
    assert all(left[1] == right[0] for left, right in pairwise(spans))
    # 16384 x 1 pixels are 2 units each
    assert JOINTS[-1] > 16384.0
    # but for the one in the middle of the picture, no joint is where pixel centres of one row are
    assert all(joint % 1.0 != 0.0 for joint in JOINTS[1:])


def test_irregular_bars_are_half_a_cycle_long_keep_to_the_contrast_and_have_no_frequency() -> None:
    scene = SCENES["signals"].build(profile="irregular", frequency=0.5, rows=100, phase=0.25, contrast=0.4)
    assert scene.facts.gratings == ()
    bars = scene.textures["wave"]
    assert isinstance(bars, ImageTexture)
    grey = bars.texels[0, :, 0]
    assert 0.3 <= grey.min() < 0.302
    assert 0.698 < grey.max() <= np.float32(0.7)
    # white: the correlations of n unrelated values have a deviation of 1 / sqrt(n); 1023 of them stay within 4.5
    power = np.abs(np.fft.fft(grey - grey.mean())) ** 2
    correlations = np.fft.ifft(power).real[1:] / np.fft.ifft(power).real[0]
    assert np.abs(correlations).max() < 4.5 / np.sqrt(grey.size)
    surface = scene.objects[0]
    assert surface.uv is not None
    texels = surface.uv[:, 0] * grey.size
    pixel = 2.0 / 100
    # two bars a cycle, and half a cycle a pixel: one bar a pixel; a phase of a quarter is half a bar
    np.testing.assert_allclose(texels, surface.vertices[:, 0] / pixel + 0.5, rtol=1e-12)
    assert irregular_bars((0.0,) * 3, (1.0,) * 3) == irregular_bars((0.0,) * 3, (1.0,) * 3)


@pytest.mark.parametrize(
    ("rates", "phases", "lowest", "highest"), [(16, 16, 1.0, 8.0), (4, 3, 1.5, 6.0), (7, 5, 1, 64)]
)
def test_the_sweep_has_a_row_for_every_rate_and_phase_from_the_top(
    rates: int, phases: int, lowest: float, highest: float
) -> None:
    scene = SCENES["nyquist-sweep"].build(rates=rates, phases=phases, lowest=lowest, highest=highest)
    count = rates * phases
    assert len(scene.objects) == count
    expected = lowest * (highest / lowest) ** (np.arange(rates) / (rates - 1))
    np.testing.assert_allclose([count / 2 / g.cycles_per_unit[0] for g in scene.facts.gratings], expected, rtol=1e-11)
    for row, surface in enumerate(scene.objects):
        middle = 1.0 - (row + 0.5) * 2.0 / count
        assert surface.vertices[:, 1].min() < middle < surface.vertices[:, 1].max()
        wave = scene.textures[surface.texture or ""]
        assert isinstance(wave, Grating)
        assert wave.cycles == scene.facts.gratings[row // phases].cycles_per_unit[0]
        assert wave.phase == row % phases / phases
        assert surface.uv is not None
        np.testing.assert_array_equal(surface.uv, surface.vertices[:, :2])
    heights = [(s.vertices[:, 1].max(), s.vertices[:, 1].min()) for s in scene.objects]
    assert all(above[1] == below[0] for above, below in pairwise(heights))
    # the outermost go on outside of the picture
    assert heights[0][0] > 3.0
    assert heights[-1][1] < -3.0


def test_the_sweep_has_whole_octaves_among_its_rates_exactly() -> None:
    rates = sweep_rates(1.0, 8.0, 16)
    assert [rates[k] for k in (0, 5, 10, 15)] == [1.0, 2.0, 4.0, 8.0]


def test_a_sweep_needs_two_rates_in_order() -> None:
    with pytest.raises(InputError, match="parameter lowest = 8: must be less than highest, 8"):
        build_scene("nyquist-sweep:lowest=8")
