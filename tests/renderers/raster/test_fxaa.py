"""FXAA: what its published formula gives along a stair, what it takes for an edge, and its price in the contract."""

import numpy as np
import pytest

from aliasbench.renderers.catalog import render, resolve_technique
from aliasbench.renderers.raster.post import Fxaa

pytestmark = pytest.mark.usefixtures("gl_checked")


def test_a_stair_becomes_a_ramp_by_the_formula(processing):
    # A white edge that goes up by one row after `run` columns. Seen from a pixel at an edge the ends are the first
    # columns whose pair of pixels is of one colour, d to the left and run + 1 - d to the right; the pixel takes
    # .5 - d / (run + 1) at the end where the other colour is in its way. Only the first and last have corners beside
    # them; so near, walks stop at every pixel.
    run, left = 5, 8
    picture = np.zeros((16, left + run + 16, 3), np.float32)
    picture[8:] = 1.0
    picture[7, left + run :] = 1.0
    picture[9:, :left] = 0.0
    picture[8, :left] = 0.0
    out = processing.process(Fxaa, picture)[..., 0]
    for column in range(1, run - 1):
        to_right, to_left = run - column, column + 1
        below_white = max(0.0, 0.5 - to_right / (run + 1)) if to_right < to_left else 0.0
        above_black = max(0.0, 0.5 - to_left / (run + 1)) if to_left < to_right else 0.0
        flat_share = 0.75 * _single(4 / 12) ** 2  # on a straight edge a third of the weighted neighbourhood differs
        assert out[7, left + column] == pytest.approx(max(below_white, flat_share), abs=1e-5)
        assert out[8, left + column] == pytest.approx(1.0 - max(above_black, flat_share), abs=1e-5)


def _single(contrast: float) -> float:
    # squared again by FXAA's own formula where it is used
    return contrast * contrast * (3.0 - 2.0 * contrast)


def test_what_is_hardly_seen_is_no_edge(processing):
    # perceptual contrast of 2 % in the dark, of 5 % in the light: below both thresholds
    for dark, light in ((0.0, 0.0015), (0.8, 0.88), (4.0, 9.0)):
        picture = np.full((12, 12, 3), dark, np.float32)
        picture[:, 6:] = light
        np.testing.assert_array_equal(processing.process(Fxaa, picture), picture)
    picture[:, 6:] = 0.5
    assert (processing.process(Fxaa, picture) != picture).any()


def test_the_name_of_the_technique(make):
    assert resolve_technique("raster-fxaa").post == "fxaa"
    frame = render(make.star(), "raster-fxaa", size=(24, 16))
    assert frame.samples == 24 * 16
    assert frame.seconds > 0
