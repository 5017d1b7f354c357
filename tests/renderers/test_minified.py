"""Minified analytic textures: both renderers show the means over pixels where pixels fall on texels of a level."""

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.scenes.catalog import SCENES
from aliasbench.scenes.model import Camera, Checker, Grating, Scene, Texture
from aliasbench.scenes.shapes import quad
from aliasbench.scenes.staging import flat_camera

MODES = ("raytrace:texture=trilinear", "raytrace:texture=mipmap", "raster:texture=trilinear", "raster:texture=mipmap")
SIDE = 64


def wave_means(k: float, start: float, extent: float, count: int) -> np.ndarray:
    """The means of exp(i k x^2) over equal parts of an interval, by Gauss' quadrature."""
    nodes, weights = np.polynomial.legendre.leggauss(256)
    x = start + extent * (np.arange(count)[:, None] + (nodes + 1) / 2) / count
    means: np.ndarray = np.exp(1j * k * x**2) @ weights / 2
    return means


@pytest.mark.parametrize(
    ("k", "phase", "speed", "size"), [(9000.0, 0.0, 0.0, (128, 128)), (3000.0, 1.0, -0.3, (256, 64))]
)
def test_a_minified_zone_plate_is_its_means_over_pixels_far_outside_of_a_square_too(
    k: float, phase: float, speed: float, size: tuple[int, int]
) -> None:
    scene = SCENES["zone-plate"].build(k=k, phase=phase, speed=speed)
    wide = size[0] / size[1]
    across, up = wave_means(k, -wide / 2, wide, size[0]), wave_means(k, -0.5, 1.0, size[1])
    truth = 0.5 + 0.5 * (np.exp(1j * phase) * up[:, None] * across).real
    assert np.ptp(truth) > 0.5
    for mode in MODES:
        # 1e-6: texels in float32; 1e-3: derivatives and coordinates in float32, which place a pixel beside its texel
        atol = 1e-6 if mode.startswith("raytrace") else 1e-3
        pixels = render(scene, mode, size=size).pixels
        np.testing.assert_allclose(pixels, np.repeat(truth[..., None], 3, axis=2), rtol=0, atol=atol)


def filled(texture: Texture, across: float, up: float) -> Scene:
    """A picture that a square fills, whose uv go to these."""
    corners = [(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0)]
    uv = [(0.0, 0.0), (across, 0.0), (across, up), (0.0, up)]
    camera: Camera = flat_camera()
    return Scene("filled", camera, objects=(quad(corners, uv=uv, texture="t"),), textures={"t": texture})


@pytest.mark.parametrize("mode", MODES)
def test_minified_waves_and_checkers_of_any_frequency_are_their_means_over_pixels(mode: str) -> None:
    pixel = np.arange(SIDE)
    atol = 1e-6 if mode.startswith("raytrace") else 1e-3
    # four pixels to a cycle: the mean of cos over a quarter turn, from a quarter on
    wave = 0.5 + 0.5 * np.diff(np.sin(np.pi / 2 * (np.arange(SIDE + 1) + 1))) * 2 / np.pi
    sine = render(filled(Grating(3.7, 0.0, 0.25), SIDE / 4 / 3.7, 1.0), mode, size=(SIDE, SIDE)).pixels
    np.testing.assert_allclose(sine[..., 0], np.tile(wave, (SIDE, 1)), rtol=0, atol=atol)
    # two pixels to a cycle: white from -1/4 to 1/4, so half of every pixel
    square = render(filled(Grating(3.7, 0.0, 0.0, "square"), SIDE / 2 / 3.7, 1.0), mode, size=(SIDE, SIDE)).pixels
    np.testing.assert_allclose(square, 0.5, rtol=0, atol=atol)
    # a pixel to a square: each is its colour; and two to a pixel are their mean
    checker = Checker((5.3, 2.9), (0.0,) * 3, (1.0,) * 3)
    each = render(filled(checker, SIDE / 5.3, SIDE / 2.9), mode, size=(SIDE, SIDE)).pixels[..., 0]
    np.testing.assert_allclose(each[::-1], (pixel + pixel[:, None]) % 2, rtol=0, atol=atol)
    fine = render(filled(checker, 2 * SIDE / 5.3, 2 * SIDE / 2.9), mode, size=(SIDE, SIDE)).pixels
    np.testing.assert_allclose(fine, 0.5, rtol=0, atol=atol)
