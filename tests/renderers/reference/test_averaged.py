"""Averages over lens and shutter: unbiased points, honest intervals, and agreement with what is known exactly."""

import math
from dataclasses import replace

import numpy as np
import pytest

from aliasbench.renderers.reference import averaged
from aliasbench.renderers.reference.averaged import average, lens_places, scrambled_sobol
from aliasbench.renderers.reference.defocus import draw_layers
from aliasbench.renderers.reference.faces import build_faces
from aliasbench.renderers.reference.moving import draw_shutter
from aliasbench.renderers.reference.paths import scene_paths
from aliasbench.renderers.reference.snapshots import FlatPictures, Shot, TexturedPictures
from aliasbench.renderers.reference.texture_tables import texture_table
from aliasbench.renderers.sampling.filters import make_filter
from aliasbench.scenes.model import Camera, Checker, Motion

BOX = make_filter("box", 0.5)
STAR = [(-0.5, -0.4), (0.7, 0.1), (0.0, 0.8)]


@pytest.fixture
def coarse(monkeypatch):
    """Aim at an interval ten times as wide, for speed."""
    monkeypatch.setattr(averaged, "TARGET", 3e-3)


def shot_of(scene, spec=BOX, size=(9, 7), frame=0):
    return Shot(scene, build_faces(scene), scene_paths(scene), size, frame, spec)


@pytest.mark.parametrize("count", [1, 8, 64])
def test_every_stratum_of_each_axis_and_of_the_first_plane_has_one_point(count):
    for seed in range(5):
        u = scrambled_sobol(count, 3, seed)
        assert u.min() > 0.0
        assert u.max() < 1.0
        for k in range(3):
            assert np.array_equal(np.sort(np.floor(u[:, k] * count)), np.arange(count))
        for bits in range(count.bit_length()):
            wide, high = 2**bits, count // 2**bits
            cells = np.floor(u[:, 0] * wide) * high + np.floor(u[:, 1] * high)
            assert len(np.unique(cells)) == count


def test_points_are_uniform_over_seeds():
    # the means over seeds of polynomials; each point of a set is uniform, so the errors are Monte Carlo's at most
    u = np.stack([scrambled_sobol(4, 3, seed) for seed in range(4000)])
    for power in (1, 2, 3):
        sigma = math.sqrt(1 / (2 * power + 1) - 1 / (power + 1) ** 2) / math.sqrt(4000)
        assert np.abs((u**power).mean(axis=0) - 1 / (power + 1)).max() < 5 * sigma
    assert np.abs((u[:, :, 0] * u[:, :, 1] * u[:, :, 2]).mean(axis=0) - 1 / 8).max() < 5 * 0.15 / math.sqrt(4000)


def test_places_fill_the_disc_and_the_shutter_evenly():
    places = lens_places(1024, 2.0, (0.25, 0.75), 3)
    squared = (places[:, :2] ** 2).sum(axis=1) / 4.0
    assert squared.max() < 1.0
    assert abs(squared.mean() - 0.5) < 1e-3
    assert np.abs(places[:, :2].mean(axis=0)).max() < 5e-3
    assert 0.25 < places[:, 2].min() < 0.251
    assert 0.749 < places[:, 2].max() < 0.75
    pinhole = lens_places(64, 0.0, (0.0, 1.0), 3)
    assert not pinhole[:, :2].any()
    assert np.array_equal(np.sort(np.floor(pinhole[:, 2] * 64)), np.arange(64))


@pytest.mark.usefixtures("coarse")
def test_average_over_the_lens_agrees_with_layers(make_polygon, make_scene):
    camera = Camera("perspective", fov_y_deg=30.0, lens_radius=0.4, focus_distance=3.0)
    scene = make_scene([make_polygon(STAR)], camera=camera, background=(0.2, 0.1, 0.0))
    for spec in (BOX, make_filter("tent", 1.0)):
        shot = shot_of(scene, spec)
        exact = draw_layers(scene, shot.faces, shot.paths, shot.size, 0, 0.0, spec)
        mean = average(FlatPictures(shot), lens_radius=0.4, shutter=(0.0, 0.0), key=0)
        assert mean.samples > 0
        assert mean.uncertainty < 6e-3
        assert np.abs(mean.pixels - exact.pixels).max() <= mean.uncertainty
        again = average(FlatPictures(shot), lens_radius=0.4, shutter=(0.0, 0.0), key=0)
        assert np.array_equal(mean.pixels, again.pixels)
        assert mean.uncertainty == again.uncertainty


@pytest.mark.usefixtures("coarse")
def test_average_over_the_shutter_agrees_with_the_certified_one(make_polygon, make_scene):
    scene = make_scene([make_polygon(STAR, motion=Motion((9.0, 3.0, 0.0)))], shutter=0.8)
    shot = shot_of(scene, frame=2)
    exact = draw_shutter(scene, shot.faces, shot.paths, shot.size, 2, BOX)
    mean = average(FlatPictures(shot), lens_radius=0.0, shutter=(0.0, 0.8), key=2)
    assert np.abs(mean.pixels - exact.pixels).max() <= mean.uncertainty + exact.bound.max()


@pytest.mark.usefixtures("coarse")
@pytest.mark.parametrize("spec", [BOX, make_filter("tent", 1.0)], ids=["box", "tent"])
def test_textured_pictures_through_a_pinhole_are_unbiased(make_polygon, make_scene, spec):
    scene = make_scene(
        [make_polygon([(-0.7, -0.6), (0.8, -0.5), (0.6, 0.7), (-0.5, 0.6)], (1.0, 0.5, 1.0), texture="t")],
        textures={"t": Checker((3.0, 2.0), (0.2, 0.2, 0.2), (0.8, 0.8, 0.8))},
    )
    shot, table = shot_of(scene, spec, (5, 4)), texture_table(scene, linear=False)
    mean = average(TexturedPictures(shot, table), lens_radius=0.0, shutter=(0.0, 0.0), key=1)
    # a picture 25 times as fine, weighed by the filter at the middles of its pixels
    each, fine = 25, np.zeros((100, 125, 3))
    TexturedPictures(replace(shot, spec=BOX, size=(125, 100)), table).add(np.zeros((1, 3)), 0, fine)
    reach = np.arange(-24, 25) if spec is not BOX else np.arange(-12, 13)
    kernel = spec.evaluate(*np.meshgrid(reach / each, reach / each)) / each**2
    for row, column in ((1, 1), (2, 2), (2, 3)):
        middle = (each * row + 12, each * column + 12)
        window = fine[
            middle[0] + reach[0] : middle[0] + reach[-1] + 1, middle[1] + reach[0] : middle[1] + reach[-1] + 1
        ]
        truth = np.einsum("ij,ijk->k", kernel, window)
        # the midpoint rule errs by (1 / 25)^2 / 12 of the tent's slope at its ridges
        assert np.abs(mean.pixels[row, column] - truth).max() < mean.uncertainty + 1e-3


def test_a_price_follows_the_rows_of_texels(make_polygon, make_scene):
    prices = []
    for squares in (2.0, 2e4):
        scene = make_scene(
            [make_polygon([(-0.7, -0.6), (0.7, -0.6), (0.7, 0.6), (-0.7, 0.6)], texture="t")],
            textures={"t": Checker((squares, squares))},
        )
        pictures = TexturedPictures(shot_of(scene, BOX, (8, 8)), texture_table(scene, linear=False))
        pictures.add(np.zeros((1, 3)), 0, np.zeros((8, 8, 3)))
        prices.append(pictures.price())
    assert prices[1] - prices[0] == pytest.approx(2e4 * 8 * 100, rel=0.1)
