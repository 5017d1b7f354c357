"""Both renderers' rows are the signal itself at the pixel centres, within float32 of where they sample it."""

import numpy as np
import pytest

from aliasbench.metrics.reconstruction import expected_rmse
from aliasbench.metrics.signals import measure_rates, original_rows
from aliasbench.metrics.spectral_line import recover_frequency
from aliasbench.renderers.catalog import render
from aliasbench.scenes.catalog import build_scene
from aliasbench.scenes.signals import JOINTS, SWEEP_REACH

EPS = 2.0**-24
# Positions along a row pass through this many roundings in float32: both ends of a span, its slope, and the texture's.
ROUNDINGS = 4.0


def tolerance(cycles_per_unit: float, furthest: float) -> float:
    """How far a wave between 0 and 1 may be off where positions up to `furthest` world units are float32."""
    return np.pi * cycles_per_unit * furthest * ROUNDINGS * EPS + 2 * EPS


@pytest.mark.parametrize("technique", ["raytrace:", "raster:"])
@pytest.mark.parametrize(
    ("scene", "size"),
    [
        ("signals", (256, 1)),
        ("signals", (64, 64)),
        ("signals:rows=1", (256, 1)),
        ("signals:frequency=0.37,phase=0.21,rows=1,contrast=0.3", (1023, 1)),
        ("signals:frequency=0.13,phase=-0.6,rows=3", (96, 3)),
    ],
)
def test_rows_are_the_wave_at_pixel_centres(technique: str, scene: str, size: tuple[int, int]) -> None:
    built = build_scene(scene)
    pixels = render(built, technique, size=size).pixels
    expected = original_rows(built, size, [0], np.arange(size[0]) + 0.5)[0]
    half = size[0] / size[1]  # world units from the middle to the picture's side
    furthest = next(joint for joint in JOINTS[1:] if joint >= half)
    bound = tolerance(built.facts.gratings[0].cycles_per_unit[0], furthest)
    np.testing.assert_allclose(pixels[0], expected, rtol=0, atol=bound)
    # a taller picture shows the same row again
    np.testing.assert_allclose(pixels, np.broadcast_to(pixels[:1], pixels.shape), rtol=0, atol=bound)


@pytest.mark.parametrize("technique", ["raytrace:", "raster:"])
def test_irregular_rows_are_the_bars_at_pixel_centres(technique: str) -> None:
    # a bar and a half to a pixel and a phase of its own: no centre is at a bar's border
    built = build_scene("signals:profile=irregular,frequency=0.75,rows=16,phase=0.1")
    pixels = render(built, technique, size=(64, 16)).pixels
    expected = original_rows(built, (64, 16), [8], np.arange(64) + 0.5)[0]
    np.testing.assert_allclose(pixels[8], expected, rtol=0, atol=2 * EPS)


@pytest.mark.parametrize("technique", ["raytrace:", "raster:"])
def test_a_rendered_sweep_is_what_the_sampling_theorem_says(technique: str) -> None:
    built = build_scene("nyquist-sweep:rates=7,phases=8")
    size = (128, 56)
    pixels = render(built, technique, size=size).pixels
    bound = tolerance(28.0, SWEEP_REACH)
    expected = original_rows(built, size, range(56), np.arange(128) + 0.5)
    np.testing.assert_allclose(pixels, expected, rtol=0, atol=bound)
    for point in measure_rates(built, pixels):
        # an error of the samples moves the frequency by less than its share of the amplitude in radians over the row
        assert point.recovered == pytest.approx(point.predicted, abs=bound / 0.5 / 128)
        for name, rmse in point.rmse.items():
            # weights of a kernel sum to 11/9 in magnitude at most; Gauss quadrature as in the metric's own test
            assert rmse == pytest.approx(expected_rmse(1 / point.rate, name), rel=5e-5, abs=2 * bound)


def test_the_default_regular_signal_comes_back_nineteen_times_too_slow() -> None:
    for technique in ("raytrace:", "raster:"):
        row = render(build_scene("signals:rows=8"), technique, size=(256, 8)).pixels[4, :, 1]
        assert recover_frequency(row).cycles_per_px == pytest.approx(0.05, abs=1e-6)
