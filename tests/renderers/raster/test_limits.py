"""Where drivers and float32 end: many taps, many shadow rays, textures that repeat too often, cut-outs in mirrors."""

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.renderers.raster.context import acquire_context
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import Camera, Checker, ImageTexture, Material, Scene
from aliasbench.scenes.shapes import polygon

pytestmark = pytest.mark.usefixtures("gl_checked")
SQUARE = [(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0)]
UV = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))


@pytest.mark.parametrize(
    "technique",
    [
        "raster:msaa=4,ssaa=32,filter=lanczos",
        "raster:ssaa=64,filter=cone,radius=2.5",
        "raster:msaa=4,ssaa=8,filter=box,radius=12",
        "raster:msaa=4,filter=box,radius=100",
    ],
)
def test_many_taps_add_up_to_what_is_flat(make, technique):
    """Software devices end a shader's loops after 65535 turns, and one sum of so many would be off by 4e-4."""
    pixels = render(make.scene(background=(0.2, 0.3, 0.4)), technique, size=(5, 4)).pixels
    np.testing.assert_allclose(pixels, np.broadcast_to((0.2, 0.3, 0.4), (4, 5, 3)), rtol=1e-5)


def test_more_taps_than_can_be_are_refused_by_name(make):
    with pytest.raises(InputError, match=r"filter=cone,radius=2000: 64032004 samples a pixel would have"):
        render(make.star(), "raster:msaa=4,filter=cone,radius=2000", size=(16, 12))


@pytest.mark.parametrize("rays", [9, 4096, 16385])
@pytest.mark.parametrize("mapped", [False, True])
def test_any_number_of_shadow_rays_is_the_tracer_s(monkeypatch, rays, mapped):
    if mapped:
        if rays > 9:
            rays //= 256
        monkeypatch.setattr("aliasbench.renderers.raster.lighting.MOST_EXACT", 1)
    scene, size = load_scene("soft-shadow"), (24, 18)
    drawn = render(scene, f"raster:shadow_rays={rays}", size=size, frame=3).pixels
    traced = render(scene, f"raytrace:pattern=shared,shadow_rays={rays}", size=size, frame=3).pixels
    off = np.abs(drawn - traced).max(axis=2)
    assert np.ptp(traced) > 0.3
    # an edge within 2/256 px of the sample, and what a map's texels leave of a border
    assert (off > (0.02 if mapped else 1e-4)).mean() < 0.01
    assert abs(float(drawn.mean()) - float(traced.mean())) < 1e-3


def test_many_shadow_rays_count_once_under_signed_weights():
    scene = load_scene("soft-shadow")
    text = "sampler=sobol,shadow_rays=1024,filter=mitchell,weighting=distribution"
    drawn = render(scene, f"raster:passes=4,{text}", size=(16, 12)).pixels
    traced = render(scene, f"raytrace:spp=4,pattern=shared,{text}", size=(16, 12)).pixels
    assert (np.abs(drawn - traced).max(axis=2) > 1e-3).mean() < 0.03


def test_what_is_drawn_in_turns_is_processed_as_a_whole(monkeypatch):
    scene, size = load_scene("soft-shadow"), (24, 18)
    expected = render(scene, "raster:shadow_rays=24,post=smaa", size=size).pixels
    monkeypatch.setattr("aliasbench.renderers.raster.lighting._MOST_TURNS", 100)
    np.testing.assert_allclose(render(scene, "raster:shadow_rays=24,post=smaa", size=size).pixels, expected, atol=1e-5)


def test_textures_that_float32_cannot_tell_apart_are_refused():
    surface = polygon(SQUARE, uv=np.array(UV), texture="checks")
    for squares in (1e7, 1e9):
        scene = Scene("checks", Camera("orthographic", height=2.0), (surface,), {"checks": Checker((squares, squares))})
        with pytest.raises(InputError, match=r"object 0: its texture repeats so often .*; divide the surface"):
            render(scene, "raster", size=(8, 8))
    fine = Scene("checks", Camera("orthographic", height=2.0), (surface,), {"checks": Checker((1e5, 1e5))})
    assert 0.3 < render(fine, "raster:passes=64,sampler=sobol", size=(8, 8)).pixels.mean() < 0.7


def test_cut_outs_are_cut_in_mirrors_too():
    if 4 not in acquire_context().sample_counts:
        pytest.skip("the device has no 4 samples a pixel")
    rows, columns = np.indices((32, 32))
    alpha = np.where(np.hypot(rows - 15.5, columns - 15.5) < 12.0, 1.0, 0.0)
    leaf = ImageTexture(np.dstack([np.ones((32, 32, 3)), alpha]).astype(np.float32), alpha_cutoff=0.5)
    stands = [(-0.5, 0.2, -1.0), (0.5, 0.2, -1.0), (0.5, 1.2, -1.0), (-0.5, 1.2, -1.0)]
    floor = [(-3.0, 0.0, 3.0), (3.0, 0.0, 3.0), (3.0, 0.0, -3.0), (-3.0, 0.0, -3.0)]
    objects = (
        polygon(stands, uv=np.array(UV), texture="leaf"),
        polygon(floor, material=Material("glossy", roughness=0.001)),
    )
    camera = Camera("perspective", position=(0.0, 1.0, 3.0), target=(0.0, 0.3, -1.0), fov_y_deg=45.0)
    scene = Scene("mirror", camera, objects, {"leaf": leaf})
    shown = [
        render(scene, f"raster:msaa=4{more},texture=linear", size=(96, 72)).pixels
        for more in (",alpha_to_coverage=on", "")
    ]
    mirrored = [float(pixels[36:].sum()) for pixels in shown]
    assert mirrored[1] > 20.0
    assert mirrored[0] == pytest.approx(mirrored[1], rel=0.1)
