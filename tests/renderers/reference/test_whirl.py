"""What turns about one point under product filters: against panels in time, the closed form of the box, and energy."""

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.renderers.reference.faces import build_faces
from aliasbench.renderers.reference.flat import palette
from aliasbench.renderers.reference.moving import draw_panels, draw_shutter
from aliasbench.renderers.reference.paths import scene_paths
from aliasbench.renderers.reference.rotor import draw_rotor
from aliasbench.renderers.reference.turning import find_rotor
from aliasbench.renderers.reference.whirl import draw_whirl
from aliasbench.renderers.sampling.filters import make_filter
from aliasbench.scenes.catalog import SCENES
from aliasbench.scenes.model import Motion, Spin


def turning(make_polygon, make_scene, rate=12.0, shutter=0.7, center=(0.13, -0.06, 0.0)):
    motion = Motion(spin=Spin((0, 0, 1), center, rate))
    blade = make_polygon([(0.1, 0.02), (0.8, 0.1), (0.75, 0.4), (0.1, 0.2)], (1.0, 0.3, 0.0), motion=motion)
    # over the blade and over the hub
    patch = make_polygon([(-0.2, -0.3, 0.1), (0.5, 0.15, 0.1), (0.0, 0.3, 0.1)], (0.0, 0.7, 1.0), motion=motion)
    wall = make_polygon([(-3, -3, -1), (3, -3, -1), (3, 3, -1), (-3, 3, -1)], (0.2, 0.1, 0.4))
    return make_scene([blade, patch, wall], shutter=shutter)


@pytest.mark.parametrize(
    ("name", "radius"),
    [("gaussian", 1.5), ("mitchell", 2.0), ("lanczos", 2.0), ("tent", 0.8), ("box", 0.3), ("box", 1.2)],
)
def test_turning_pattern_agrees_with_panels_in_time(make_polygon, make_scene, name, radius):
    scene, size, spec = turning(make_polygon, make_scene), (9, 8), make_filter(name, radius)
    faces, paths = build_faces(scene), scene_paths(scene)
    assert find_rotor(scene, faces, paths, size, 2, palette(scene)) is not None
    closed = draw_shutter(scene, faces, paths, size, 2, spec)
    panels = draw_panels(scene, faces, paths, size, 2, spec, 2e-4)
    assert closed.bound.max() <= 1e-5
    assert panels.bound.max() <= 4e-4
    assert (np.abs(closed.pixels - panels.pixels).max(axis=2) <= closed.bound + panels.bound).all()


@pytest.mark.parametrize("rate", [0.3, 29.0, -95.0])
def test_under_the_box_it_is_the_closed_form(make_polygon, make_scene, rate):
    scene, size = turning(make_polygon, make_scene, rate), (13, 17)
    rotor = find_rotor(scene, build_faces(scene), scene_paths(scene), size, 0, palette(scene))
    assert rotor is not None
    exact, slack = draw_rotor(rotor, size, (0, size[1]))
    whirl = draw_whirl(rotor, size, make_filter("box", 0.5), 1e-8)
    assert whirl.bound.max() <= 1e-7
    assert (np.abs(whirl.pixels - exact).max(axis=2) <= whirl.bound + slack).all()


def test_a_filter_moves_light_and_makes_none(make_polygon, make_scene):
    motion = Motion(spin=Spin((0, 0, 1), (0, 0, 0), 17.0))
    scene = make_scene([make_polygon([(0.05, 0.1), (0.5, 0.0), (0.3, 0.4)], motion=motion)], shutter=0.5)
    area = 0.5 * abs(0.45 * 0.3 - 0.25 * (-0.1)) * 12**2 / 4
    for spec in ("gaussian", "mitchell", "lanczos,radius=2"):
        frame = render(scene, f"reference:filter={spec}", size=(24, 24))
        assert frame.uncertainty <= 1e-5
        total = frame.pixels[..., 0].sum() / frame.pixels.size * 3 * 4
        assert total == pytest.approx(area / 36, abs=1e-4)


def test_the_same_picture_whatever_the_size_is_cut_from(make_polygon, make_scene):
    scene = turning(make_polygon, make_scene, center=(0.0, 0.0, 0.0))
    spec = make_filter("gaussian", 1.5)
    faces, paths = build_faces(scene), scene_paths(scene)
    whole, row = (draw_shutter(scene, faces, paths, size, 0, spec) for size in ((12, 12), (2, 12)))
    assert np.abs(whole.pixels[:, 5:7] - row.pixels).max() <= whole.bound.max() + row.bound.max()


def test_a_fast_propeller_keeps_the_bound_under_a_gaussian():
    scene = SCENES["propeller"].build(blades=3, rev_per_s=29.0, shutter=0.5)
    frame = render(scene, "reference:filter=gaussian,radius=1.5", size=(48, 48), frame=3)
    assert frame.uncertainty_kind == "bound"
    assert frame.uncertainty <= 1e-5
