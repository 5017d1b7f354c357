"""SMAA: its areas are those that straight edges really cover, corners stay, and what it takes for an edge."""

import numpy as np
import pytest

from aliasbench.renderers.catalog import render, resolve_technique
from aliasbench.renderers.raster.post import Smaa

pytestmark = pytest.mark.usefixtures("gl_checked")


def _covered_below(height: np.ndarray, rows: int) -> np.ndarray:
    """Exact share of each pixel below heights (columns + 1,) of a polyline with corners at whole x, no steep pieces."""
    y = np.arange(rows)[:, None]
    a, b = height[None, :-1] - y, height[None, 1:] - y  # height above the pixel's top, downwards
    low, high = np.minimum(a, b), np.maximum(a, b)
    # mean over the column of clip(1 - t, 0, 1) for t from low to high, through its antiderivative
    primitive = lambda t: np.where(t < 0, t, np.where(t > 1, 0.5, t - t * t / 2))  # noqa: E731
    span = high - low
    return np.where(
        span > 1e-12, (primitive(high) - primitive(low)) / np.where(span > 1e-12, span, 1), np.clip(1 - low, 0, 1)
    )


@pytest.mark.parametrize("run", [1, 2, 3, 4, 7, 10, 20, 60])
def test_straight_edges_get_the_area_they_cover(processing, run):
    # A line that rises by one row every `run` columns and passes the middles of the stair's risers: the one line that
    # the stair is taken for. White is below.
    columns = 6 * run
    height = 12.5 - np.arange(columns + 1) / run
    coverage = _covered_below(height, 16)
    middles = (height[1:] + height[:-1]) / 2
    picture = np.repeat((np.arange(16)[:, None] + 0.5 > middles)[..., None], 3, axis=2).astype(np.float32)
    assert 0.05 < np.abs(picture[..., 0] - coverage)[:, 2 * run : 4 * run].max() <= 0.5
    inner = slice(2 * run, 4 * run)  # the runs at the picture's sides go on outside
    for turn in (lambda p: p, lambda p: p[:, ::-1], lambda p: p.swapaxes(0, 1)):
        out = turn(processing.process(Smaa, np.ascontiguousarray(turn(picture))))
        np.testing.assert_allclose(out[:, inner, 0], coverage[:, inner], atol=2e-6)


def test_corners_are_kept(processing):
    picture = np.zeros((40, 40, 3), np.float32)
    picture[10:30, 12:28] = 1.0
    out = processing.process(Smaa, picture)
    # without looking for corners, the two pixels at each would lose nearly half
    assert 0 < np.abs(out - picture).max() <= 0.25 * 0.5


def test_edges_longer_than_the_search_have_no_turn(processing):
    picture = np.zeros((9, 400, 3), np.float32)
    picture[4:] = 1.0
    picture[3, 200:] = 1.0
    out = processing.process(Smaa, picture)
    changed = np.flatnonzero((out != picture).any(axis=(0, 2)))
    assert 100 <= changed.min() < 199 < changed.max() < 300
    assert 0.4 < out[3, 199, 0] < 0.5


def test_what_is_hardly_seen_is_no_edge(processing):
    for dark, light in ((0.0, 0.003), (0.8, 0.88), (4.0, 9.0)):
        picture = np.full((12, 12, 3), dark, np.float32)
        picture[6:, 6:] = light
        picture[7:, 3:] = light
        np.testing.assert_array_equal(processing.process(Smaa, picture), picture)
    picture[picture == 9.0] = 0.5
    assert (processing.process(Smaa, picture) != picture).any()


def test_a_faint_edge_beside_a_strong_one_is_none(processing):
    picture = np.zeros((16, 16, 3), np.float32)
    picture[:, 8:] = 0.02
    picture[:, 9:] = 1.0
    picture[8:, 7] = 0.02
    plain = processing.process(Smaa, picture)
    assert (plain[8:, :7] == picture[8:, :7]).all()
    picture[:, 9:] = 0.02
    assert (processing.process(Smaa, picture)[4:12, :8] != picture[4:12, :8]).any()


def test_the_name_of_the_technique(make):
    assert resolve_technique("raster-smaa").post == "smaa"
    frame = render(make.star(), "raster-smaa", size=(24, 16))
    assert frame.samples == 24 * 16
    assert frame.seconds > 0
