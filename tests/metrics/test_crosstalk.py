"""What each planted signal puts into each metric, predicted from the definitions, within 2 % of the planted RMS."""

import math

import numpy as np
import pytest

from aliasbench.metrics.catalog import measure_all
from aliasbench.scenes.model import Facts

SIDE, FRAMES, PLANTED = 66, 16, 0.25
NAMES = ("rmse", "max_error", "shimmer", "buzz", "moire", "jaggies", "jaggies_bias", "flux_flicker")


@pytest.fixture
def cross(make_scene, edge_fact, rgb):
    """Scores of error (frames, SIDE, SIDE) planted on a flat reference of 1, in units of the planted RMS."""

    def run(error):
        facts = Facts(edges=(edge_fact((SIDE, SIDE), (-9.0, 33.5), (80.0, 33.5)),))
        truth = np.ones(error.shape)
        got = measure_all(NAMES, rgb(truth + PLANTED * error), rgb(truth), scene=make_scene((SIDE, SIDE), facts=facts))
        ratios = {n: None if s.value is None else s.value / PLANTED for n, s in got.items()}
        return ratios | {"buzz": got["buzz"].value, "rows": rows_read(got)}

    def rows_read(got):
        # A flat edge: slope 0, so the window is 2 (radius + 1) pixels and one for where it starts.
        assert got["jaggies"].extras["edges"][0]["slope"] == pytest.approx(0.0, abs=1e-12)
        return 4

    return run


def test_an_offset_is_error_and_shift_and_nothing_else(cross):
    got = cross(np.ones((FRAMES, SIDE, SIDE)))
    assert got["rmse"] == pytest.approx(1.0, abs=0.02)
    assert got["jaggies_bias"] == pytest.approx(got["rows"], abs=0.02)
    for name in ("shimmer", "moire", "jaggies", "flux_flicker"):
        assert got[name] == pytest.approx(0.0, abs=1e-12)
    assert got["buzz"] is None


def test_whole_picture_alternation_is_shimmer_and_flux_and_no_moire(cross):
    got = cross(np.where(np.arange(FRAMES) % 2, 1.0, -1.0)[:, None, None] * np.ones((1, SIDE, SIDE)))
    assert got["shimmer"] == pytest.approx(1.0, abs=0.02)
    assert got["flux_flicker"] == pytest.approx(1.0, abs=0.02)
    assert got["buzz"] == pytest.approx(2.0, abs=1e-9)
    assert got["moire"] == pytest.approx(0.0, abs=1e-12)
    assert got["jaggies"] == pytest.approx(0.0, abs=1e-12)


def test_white_flicker_puts_root_pi_sixteenths_into_moire(cross):
    got = cross(np.random.default_rng(1).normal(size=(FRAMES, SIDE, SIDE)))
    assert got["shimmer"] == pytest.approx(math.sqrt(1 - 1 / FRAMES), abs=0.02)
    assert got["moire"] == pytest.approx(math.sqrt(math.pi / 16), abs=0.02)
    assert got["buzz"] == pytest.approx(FRAMES / (FRAMES - 1), abs=0.02)
    # Sums of four independent values down each of 64 columns in 16 frames: five standard deviations are 11 %.
    assert got["jaggies"] == pytest.approx(math.sqrt(got["rows"]), rel=0.11)


def test_fixed_white_noise_does_not_shimmer(cross):
    got = cross(np.repeat(np.random.default_rng(2).normal(size=(1, SIDE, SIDE)), FRAMES, axis=0))
    assert got["shimmer"] == pytest.approx(0.0, abs=1e-12)
    # One frame's band: bins / 2 = 400 independent powers, the root is within five times 1 / (2 sqrt 400).
    assert got["moire"] == pytest.approx(math.sqrt(math.pi / 16), rel=5 / 40)


def test_a_moving_point_sampled_edge_shimmers_with_all_but_its_mean(cross):
    # Steps of 1/8 pixel over two pixels: in each the error is a sawtooth, of mean square 1/12 (1 - 1/64) and mean 0.
    position = 30.0 + (np.arange(FRAMES) + 0.5) / 8
    u = position[:, None] - np.arange(SIDE)
    error = np.where(u > 0.5, 1.0, 0.0) - np.clip(u, 0.0, 1.0)
    error = np.repeat(error[:, None, :], SIDE, axis=1)
    got = cross(error)
    planted = math.sqrt((1 - 1 / 64) / 12 / 64)
    assert got["rmse"] == pytest.approx(planted, rel=1e-9)
    assert got["shimmer"] == pytest.approx(planted, rel=1e-9)
    # Of a line one pixel wide the spectrum is flat along x: bins of row 0 up to 1/4, both sides, without 0.
    assert got["moire"] == pytest.approx(planted * math.sqrt(32 / 64), rel=1e-9)
