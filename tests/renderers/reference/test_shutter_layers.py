"""Where everything keeps its depth the slices' bound is of second order, and holds."""

import numpy as np
import pytest

from aliasbench.renderers.reference.faces import build_faces
from aliasbench.renderers.reference.flat import draw_shutter, draw_slices, is_layered
from aliasbench.renderers.reference.paths import scene_paths
from aliasbench.scenes.model import Camera, Motion, Spin


def layers(rng, make_polygon, make_scene, count, **kwargs):
    """Return convex polygons at depths of their own that stand, slide, or turn as they slide."""
    objects = []
    for k in range(count):
        angles = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, 6)))
        middle, radius = rng.uniform(-0.8, 0.8, 2), rng.uniform(0.1, 0.5)
        points = np.c_[middle + radius * np.c_[np.cos(angles), np.sin(angles)], np.full(len(angles), 0.05 * k)]
        slide = (*rng.uniform(-8, 8, 2), 0.0)
        spin = Spin((0, 0, 1), (*middle, 0.0), float(rng.uniform(-9, 9)))
        motion = (Motion(), Motion(slide), Motion(slide, spin))[int(rng.integers(0, 3))]
        objects.append(make_polygon(points, tuple(rng.uniform(0, 1, 3)), motion=motion))
    return make_scene(objects, **kwargs)


def slices(scene, size, count, frame=0):
    return draw_slices(scene, build_faces(scene), scene_paths(scene), size, frame, count)[0]


@pytest.mark.parametrize("seed", range(16))
def test_few_slices_stay_in_their_bound_of_many(make_polygon, make_scene, seed):
    rng = np.random.default_rng(seed)
    camera = Camera("orthographic", height=2.0, velocity=(3.0, 1.0, 0.0)) if seed % 4 == 3 else None
    scene = layers(rng, make_polygon, make_scene, 5, camera=camera, shutter=float(rng.uniform(0.2, 1)))
    size = tuple(rng.integers(5, 14, 2).tolist())
    truth = slices(scene, size, 1500)
    assert truth.pixels.max() > 0.1
    for count in (3, 17, 120):
        few = slices(scene, size, count)
        error = np.abs(few.pixels - truth.pixels).max(axis=2)
        assert (error <= few.bound + truth.bound).all()


@pytest.mark.parametrize("seed", range(16))
def test_slices_of_a_turning_pattern_stay_in_their_bound_of_its_closed_form(make_polygon, make_scene, seed):
    rng = np.random.default_rng(seed)
    motion = Motion(spin=Spin((0, 0, 1), (*rng.uniform(-0.3, 0.3, 2), 0.0), float(rng.uniform(-20, 20))))
    objects = [
        make_polygon(rng.uniform(-0.9, 0.9, (3, 2)), tuple(rng.uniform(0.2, 1, 3)), motion=motion) for _ in range(3)
    ]
    scene, size = make_scene(objects, shutter=float(rng.uniform(0.05, 1))), (13, 11)
    truth = draw_shutter(scene, build_faces(scene), scene_paths(scene), size, 3)
    assert truth.bound.max() < 1e-8
    for count in (2, 19, 160):
        few = slices(scene, size, count, frame=3)
        error = np.abs(few.pixels - truth.pixels).max(axis=2)
        assert (error <= few.bound + truth.bound).all()
        assert error.max() > 1e-9


def test_bound_falls_with_the_square_of_the_slices(make_polygon, make_scene):
    scene = layers(np.random.default_rng(5), make_polygon, make_scene, 6, shutter=0.5)
    coarse, fine = (float(slices(scene, (20, 20), n).bound.max()) for n in (250, 1000))
    assert fine < coarse / 10


def test_a_bar_that_slides_over_a_still_edge_has_its_exact_mean(make_polygon, make_scene):
    px = 2.0 / 16
    wall = make_polygon([(-9, -9, -1), (0.3 * px, -9, -1), (0.3 * px, 9, -1), (-9, 9, -1)], (0, 1, 0))
    bar = make_polygon([(-4 * px, -9), (-2.5 * px, -9), (-2.5 * px, 9), (-4 * px, 9)], (1, 0, 0))
    moving = make_polygon(bar.vertices, (1, 0, 0), motion=Motion((6 * px * 30, 0, 0)))
    scene = make_scene([wall, moving], shutter=1.0)
    assert is_layered(scene, build_faces(scene), scene_paths(scene), 0)
    integral = draw_shutter(scene, build_faces(scene), scene_paths(scene), (16, 16), 0)
    # a place is red for 1.5 px of 6 of the bar's way once the bar has passed it all, and else what is left
    place = np.arange(-8, 8)[:, None] + (np.arange(4000) + 0.5) / 4000
    red = np.clip(np.minimum(place + 4, 6) - np.maximum(place + 2.5, 0), 0, None) / 6
    green = np.where(place < 0.3, 1 - red, 0)
    error = np.abs(integral.pixels[8, :, :2] - np.c_[red.mean(axis=1), green.mean(axis=1)]).max()
    assert error <= integral.bound.max() + 1e-6
    assert integral.bound.max() <= 1e-4
