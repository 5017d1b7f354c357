"""Laws of sampled rows: the original is the scene's own texture, and what is measured is what the closed forms say."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aliasbench.metrics.reconstruction import KERNELS
from aliasbench.metrics.signals import grating_bands, measure_rates, original_rows
from aliasbench.scenes.catalog import build_scene
from aliasbench.scenes.errors import InputError, UnsupportedScene
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import Light, Material, Scene
from aliasbench.scenes.textures import evaluate_point


def sampled(scene: Scene, size: tuple[int, int]) -> np.ndarray:
    """The picture that an exact point sampler makes: the scene at pixel centres."""
    return original_rows(scene, size, range(size[1]), np.arange(size[0]) + 0.5)


@settings(max_examples=20)
@given(st.floats(0.01, 16.0), st.floats(-1.0, 1.0), st.integers(1, 4096), st.integers(0, 3))
def test_the_original_of_a_wave_is_the_cosine_of_its_fact(
    frequency: float, phase: float, height: int, row: int
) -> None:
    scene = build_scene(f"signals:frequency={frequency!r},phase={phase!r},rows={height}")
    size = (64, height)
    x = np.random.default_rng(7).uniform(-8.0, 72.0, 50)
    expected = 0.5 + 0.5 * np.cos(2 * np.pi * (frequency * (x - 32.0) + phase))
    found = original_rows(scene, size, [min(row, height - 1)], x)
    np.testing.assert_allclose(found[0], np.repeat(expected[:, None], 3, axis=1), rtol=0, atol=1e-10)


def test_the_original_of_the_sweep_has_the_phase_of_its_row() -> None:
    scene = build_scene("nyquist-sweep:rates=4,phases=5,lowest=1.5,highest=12")
    x = np.linspace(0.0, 40.0, 77)
    found = original_rows(scene, (40, 20), range(20), x)[..., 1]
    rate = np.repeat([1.5, 3.0, 6.0, 12.0], 5)[:, None]
    phase = np.tile(np.arange(5) / 5, 4)[:, None]
    np.testing.assert_allclose(found, 0.5 + 0.5 * np.cos(2 * np.pi * ((x - 20) / rate + phase)), rtol=0, atol=1e-10)


def test_the_original_sees_perspective_depth_later_surfaces_and_holes() -> None:
    floor = build_scene("brick-floor:speed=0")
    (surface,) = floor.objects
    x = np.linspace(1.0, 63.0, 32)
    found = original_rows(floor, (64, 64), [5, 50], x)
    np.testing.assert_array_equal(found[0], np.broadcast_to(floor.background, (32, 3)))
    # by hand: eye 1 above the floor, looking 12 degrees down with a field of 50
    down, scale = math.radians(12.0), 32 / math.tan(math.radians(25.0))
    a, b = (x - 32) / scale, (32 - 50.5) / scale
    height, forward = b * math.cos(down) - math.sin(down), math.cos(down) + b * math.sin(down)
    points = np.stack([a / -height, np.full(32, forward / -height)], axis=1)
    np.testing.assert_array_equal(found[1], evaluate_point(floor.textures[surface.texture or ""], points)[:, :3])


def test_the_nearer_surface_hides_and_of_coplanar_ones_the_later(tmp_path: Path) -> None:
    text = 'schema = 1\nname = "stack"\n[camera]\nprojection = "orthographic"\nheight = 2.0\n'
    for z, grey, right in ((0.5, 0.9, -0.5), (0.0, 0.3, 0.5), (0.0, 0.6, 0.0)):
        text += (
            f"[[object]]\nquad = [[-1,-1,{z}],[{right},-1,{z}],[{right},1,{z}],[-1,1,{z}]]\ncolor = [{grey},{grey},0]\n"
        )
    path = tmp_path / "stack.toml"
    path.write_text(text)
    found = original_rows(load_scene(str(path)), (4, 4), [2], np.array([0.5, 1.5, 2.5, 3.5]))
    np.testing.assert_array_equal(found[0, :, 0], [0.9, 0.6, 0.3, 0.0])


def test_diffuse_without_lights_is_unlit() -> None:
    scene = build_scene("signals:frequency=0.1,rows=4")
    asked = ((8, 4), [1], np.linspace(0.0, 8.0, 9))
    painted = [replace(s, material=Material("diffuse")) for s in scene.objects]
    diffuse = replace(scene, objects=tuple(painted))
    np.testing.assert_array_equal(original_rows(diffuse, *asked), original_rows(scene, *asked))
    glossy = replace(scene, objects=(*painted[1:], replace(painted[0], material=Material("glossy"))))
    light = Light(((0, 0, 1), (0, 1, 1), (1, 1, 1), (1, 0, 1)), (1.0, 1.0, 1.0))
    for refused in (glossy, replace(diffuse, lights=(light,))):
        with pytest.raises(UnsupportedScene, match="unlit scenes without lights and lens only"):
            original_rows(refused, *asked)


def test_bands_of_a_picture_are_its_gratings_in_order() -> None:
    scene = build_scene("nyquist-sweep:rates=4,phases=3,lowest=1,highest=8")
    bands = grating_bands(scene, (64, 24))
    assert [band.rows for band in bands] == [(2 * k, 2 * k + 1) for k in range(12)]
    # twice as many pixels, half the frequency of each
    np.testing.assert_allclose([b.cycles_per_px for b in bands], np.repeat([0.5, 0.25, 0.125, 0.0625], 3), rtol=1e-12)
    (band,) = grating_bands(build_scene("signals:rows=8"), (64, 8))
    assert band.rows == tuple(range(8))
    assert band.cycles_per_px == pytest.approx(0.95, rel=1e-14)
    assert grating_bands(build_scene("propeller"), (64, 64)) == ()
    assert grating_bands(build_scene("brick-floor"), (64, 64)) == ()
    assert grating_bands(build_scene("signals:profile=irregular"), (64, 64)) == ()


def test_rates_come_back_with_the_error_and_the_frequency_of_theory() -> None:
    scene = build_scene("nyquist-sweep:rates=10,phases=8")
    points = measure_rates(scene, sampled(scene, (96, 80)))
    np.testing.assert_allclose([p.rate for p in points], 8.0 ** (np.arange(10) / 9), rtol=1e-10)
    for p in points:
        assert p.recovered == pytest.approx(p.predicted, abs=1e-9)
        assert p.expected is not None
        for name in KERNELS:
            # Gauss nodes in half pixels: rounding for polynomials, 2e-5 of the Gaussian's error where it is smallest
            assert p.rmse[name] == pytest.approx(p.expected[name], rel=5e-5)
        # 8 bits move an RMS difference by at most the RMS of their own error (triangle inequality): 1/2 step with
        # dither and 1/sqrt(3) at worst without; Mitchell's kernel amplifies by at most the sum of its weights, 11/9
        for value in p.rmse_quantised.values():
            assert abs(value - p.rmse["mitchell"]) < 11 / 9 / math.sqrt(3) / 255
        assert set(p.rmse_quantised) == {"none", "triangular"}
    below = [p for p in points if p.rate < 1.99]
    assert len(below) == 3
    for p in points:
        true = abs(p.recovered - p.cycles_per_px) < 1e-9
        assert true == (p.rate > 1.99)
    assert points[0].amplitude_high == 0.0
    at_limit = points[3]
    assert at_limit.rate == pytest.approx(2.0)
    assert at_limit.amplitude_low == pytest.approx(0.0, abs=1e-9)
    assert at_limit.amplitude_high == pytest.approx(1.0, abs=1e-9)
    assert all(p.amplitude_low == pytest.approx(1.0, abs=1e-9) for p in points if p.rate > 2.1)
    # more samples a cycle, less error, from 2 on and for every kernel
    for name in KERNELS:
        assert (np.diff([p.rmse[name] for p in points[3:]]) < 0.0).all()


def test_a_square_wave_has_no_closed_form_but_its_fundamentals_frequency() -> None:
    scene = build_scene("signals:profile=square,frequency=0.13,rows=4,contrast=0.5")
    (point,) = measure_rates(scene, sampled(scene, (200, 4)))
    assert point.expected is None
    # other lines of the wave, of a third of the amplitude and less, pull by a fraction of a bin
    assert point.recovered == pytest.approx(0.13, abs=0.2 / 200)
    # in contrast: half of it is the whole swing, and a pixel in eight is wrong by it over half of its width
    assert 0.0 < point.rmse["box"] < 0.5


def test_rows_that_are_not_known_are_refused() -> None:
    scene = build_scene("signals")
    with pytest.raises(InputError, match="row = 4: must be a row of the picture, 0 to 3"):
        original_rows(scene, (8, 4), [4], np.array([0.5]))
    with pytest.raises(InputError, match="a picture 19 pixels wide: at least 20 are needed"):
        measure_rates(scene, np.zeros((4, 19, 3)))
    with pytest.raises(UnsupportedScene, match="unlit scenes without lights and lens only"):
        original_rows(replace(scene, camera=replace(scene.camera, lens_radius=0.1)), (8, 4), [0], np.array([0.5]))


def test_rows_whose_middle_is_on_a_border_are_in_no_band() -> None:
    sweep = load_scene("nyquist-sweep")  # 256 bands
    assert len(grating_bands(sweep, (128, 256))) == 256
    assert grating_bands(sweep, (128, 128)) == ()
    assert len(grating_bands(sweep, (128, 512))) == 256
    assert all(len(band.rows) == 1 for band in grating_bands(sweep, (128, 384))), "of 3 rows to 2 bands one is torn"
