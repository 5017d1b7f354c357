"""One door to all references: what is drawn how, of which kind its uncertainty is, and that nothing is refused."""

from dataclasses import replace

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.renderers.reference import averaged
from aliasbench.scenes.errors import UnsupportedScene
from aliasbench.scenes.model import (
    Camera,
    Checker,
    ImageTexture,
    Light,
    Material,
    Motion,
    Surface,
    read_only,
)  # fmt: skip

TRIANGLE = [(-0.5, -0.4), (0.7, 0.1), (0.0, 0.8)]
QUAD = [(-0.7, -0.6), (0.8, -0.5), (0.6, 0.7), (-0.5, 0.6)]
LENS = Camera("perspective", fov_y_deg=30.0, lens_radius=0.3, focus_distance=3.0)
LIGHT = Light(((-1, 2, -1), (1, 2, -1), (1, 2, 1), (-1, 2, 1)), (3.0, 3.0, 3.0))
MOVING = Motion((4.0, 0.0, 0.0))


@pytest.fixture(autouse=True)
def coarse(monkeypatch):
    """Keep averages short: what they reach is tested elsewhere."""
    monkeypatch.setattr(averaged, "_MOST", 16)
    monkeypatch.setattr(averaged, "_PILOT", 4)


@pytest.mark.parametrize("material", ["glossy", "glass"])
def test_materials_that_are_not_there_yet_are_named(make_polygon, make_scene, material):
    triangle = make_polygon(TRIANGLE)
    shiny = Surface(triangle.vertices, triangle.triangles, material=Material(material))
    with pytest.raises(UnsupportedScene, match=rf"material {material} \(object number 0\) is not drawn; unlit"):
        render(make_scene([shiny]), "reference:", size=(4, 4))


def test_light_that_goes_on_from_one_surface_to_another_is_named(make_polygon, make_scene):
    scene = replace(make_scene([make_polygon(TRIANGLE)]), bounces=1)
    with pytest.raises(UnsupportedScene, match=r"diffuse interreflection \(bounces = 1\) is not drawn; direct light"):
        render(scene, "reference:", size=(4, 4))


@pytest.mark.parametrize("technique", ["reference:", "reference:filter=tent", "reference:time=center"])
@pytest.mark.parametrize("camera", [None, LENS], ids=["pinhole", "lens"])
@pytest.mark.parametrize("kind", ["flat", "textured", "lit"])
@pytest.mark.parametrize("shutter", [0.0, 0.5])
def test_no_scene_of_unlit_or_diffuse_surfaces_is_refused(make_polygon, make_scene, technique, camera, kind, shutter):
    motion = MOVING if shutter else None
    surface = make_polygon(QUAD, (1.0, 0.5, 0.2), motion=motion, texture="t" if kind == "textured" else None)
    surface = replace(surface, material=Material("diffuse"))
    textures = {"t": Checker((3.0, 2.0))} if kind == "textured" else None
    scene = make_scene([surface], camera=camera, shutter=shutter, textures=textures, background=(0.1, 0.0, 0.3))
    scene = replace(scene, lights=(LIGHT,) if kind == "lit" else ())
    frame = render(scene, technique, size=(4, 3))
    assert frame.pixels.shape == (3, 4, 3)
    assert np.isfinite(frame.pixels).all()
    assert frame.uncertainty is not None
    assert frame.uncertainty >= 0.0
    assert frame.uncertainty_kind == ("confidence" if frame.samples else "bound")
    spread = shutter > 0.0 and technique != "reference:time=center"
    if kind == "flat":
        assert (frame.samples == 0) == (camera is None or not spread)
    if kind == "lit":
        assert (frame.samples == 0) == (camera is None and not spread)


def test_lights_are_seen_and_light_diffuse_surfaces_only(make_polygon, make_scene):
    camera = Camera("perspective", position=(0, 0.5, 5), fov_y_deg=60.0)
    floor = make_polygon([(-3, -1, -3), (3, -1, -3), (3, -1, 3), (-3, -1, 3)])
    scenes = [
        replace(make_scene([replace(floor, material=Material(m))], camera=camera), lights=(LIGHT,))
        for m in ("diffuse", "unlit")
    ]
    lit, unlit = (render(s, "reference:", size=(8, 8)) for s in scenes)
    assert lit.uncertainty < 1e-4
    assert 0.05 < lit.pixels[-1].min() < lit.pixels[-1].max() < 3.0
    np.testing.assert_allclose(unlit.pixels[-1], 1.0, atol=1e-9)


def test_cutouts_show_what_lies_behind_through_a_lens_too(make_polygon, make_scene):
    alpha = np.ones((2, 2, 4), np.float32)
    alpha[0, 0, 3] = 0.0
    holes = {"t": ImageTexture(read_only(alpha), alpha_cutoff=0.5)}
    square = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    scene = make_scene([make_polygon(square, (0.0, 1.0, 0.0), texture="t")], textures=holes, background=(1.0, 0, 0))
    frame = render(scene, "reference:", size=(4, 4))
    np.testing.assert_allclose(frame.pixels[2:, :2], np.broadcast_to((1.0, 0, 0), (2, 2, 3)), atol=1e-12)
    np.testing.assert_allclose(frame.pixels[:2], np.broadcast_to((0, 1.0, 0), (2, 4, 3)), atol=1e-12)
    blurred = replace(scene, camera=replace(scene.camera, lens_radius=0.2, focus_distance=4.0))
    frame = render(blurred, "reference:", size=(4, 4))
    assert frame.uncertainty_kind == "bound"
    assert 0.0 < frame.pixels[2, 1, 0] < 1.0
