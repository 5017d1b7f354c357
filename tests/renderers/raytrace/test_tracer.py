"""Laws of whole pictures: coverage, order, patterns, determinism, refusals."""

import dataclasses
from typing import Any

import numpy as np
import pytest
import shapely

from aliasbench.renderers.catalog import prepare, render
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Camera, Checker, Grating, Material, Motion, Scene

PERSPECTIVE = Camera("perspective", position=(0.0, 0.0, 5.0), fov_y_deg=90.0)
SLANTED = Camera("perspective", position=(3.0, 2.0, 5.0), fov_y_deg=60.0)


@pytest.fixture(scope="module")
def triangle_scene(polygon: Any, flat_scene: Any) -> Scene:
    scene: Scene = flat_scene([polygon([[-6.3, -5.1, 0], [7.2, -1.7, 0], [-1.4, 6.6, 0]])], background=(0.0, 0.25, 0.5))
    return scene


def test_grid_of_4096_gives_exact_coverage_within_its_discrepancy(polygon: Any, flat_scene: Any) -> None:
    # One world unit is a pixel here. A row of 64 samples counts an interval with an error below 1/64, and the midpoint
    # rule over 64 rows adds at most 1/64 of half the length's total variation (2): 2/64 in every pixel.
    corners = np.array([[-6.3, -5.1, 0.0], [7.2, -1.7, 0.0], [-1.4, 6.6, 0.0]])
    pixels = render(flat_scene([polygon(corners)]), "raytrace:spp=4096,sampler=grid", size=(16, 16)).pixels[..., 0]
    shape = shapely.Polygon(corners[:, :2] * [1, -1] + 8)
    exact = np.array([[shape.intersection(shapely.box(j, i, j + 1, i + 1)).area for j in range(16)] for i in range(16)])
    assert np.abs(pixels - exact).max() < 2 / 64
    # Errors of different pixels are independent: their sum stays far below the sum of the bounds.
    assert abs(pixels.sum() - shape.area) < 1e-3 * shape.area
    assert set(np.unique(pixels[exact == 1.0])) == {1.0}
    assert set(np.unique(pixels[exact == 0.0])) == {0.0}


def test_an_empty_scene_is_its_background_exactly(flat_scene: Any) -> None:
    for engine in ("packet", "portable"):
        frame = render(flat_scene([], background=(0.1, 0.2, 0.7)), f"raytrace:spp=7,engine={engine}", size=(9, 5))
        np.testing.assert_array_equal(frame.pixels, np.broadcast_to(np.float32([0.1, 0.2, 0.7]), (5, 9, 3)))
        assert frame.samples == 9 * 5 * 7


def test_one_centre_sample_sees_what_the_centre_sees(quad: Any, flat_scene: Any) -> None:
    # The square's border runs at .25 and .75 of pixels: a pixel is in where its centre is.
    scene = flat_scene([quad(-3.25, -2.75, 4.75, 3.25)])
    pixels = render(scene, "raytrace:", size=(16, 16)).pixels[..., 0]
    x = np.arange(16) + 0.5 - 8
    inside = ((x > -3.25) & (x < 4.75))[None, :] & ((-x > -2.75) & (-x < 3.25))[:, None]
    np.testing.assert_array_equal(pixels, inside.astype(np.float32))


@pytest.mark.parametrize("threads", ["2", "3", "7"])
@pytest.mark.parametrize("spp", [1, 5, 16, 33])
def test_pixels_are_the_same_on_any_number_of_threads(
    triangle_scene: Scene, monkeypatch: pytest.MonkeyPatch, spp: int, threads: str
) -> None:
    technique = f"raytrace:spp={spp},sampler=jittered"
    monkeypatch.setenv("ALIASBENCH_THREADS", "1")
    alone = render(triangle_scene, technique, size=(37, 23), frame=2, seed=5).pixels
    monkeypatch.setenv("ALIASBENCH_THREADS", threads)
    np.testing.assert_array_equal(render(triangle_scene, technique, size=(37, 23), frame=2, seed=5).pixels, alone)


@pytest.mark.parametrize("value", ["0", "-1", "two", "1.5", "1025"])
def test_a_bad_number_of_threads_is_refused(triangle_scene: Scene, monkeypatch: pytest.MonkeyPatch, value: str) -> None:
    monkeypatch.setenv("ALIASBENCH_THREADS", value)
    with pytest.raises(InputError, match=rf"ALIASBENCH_THREADS={value}: must be a whole number from 1 to 1024"):
        prepare(triangle_scene, "raytrace:", size=(4, 4))


def test_seeds_and_frames_change_the_pattern_and_reseed_never_keeps_it(triangle_scene: Scene) -> None:
    with prepare(triangle_scene, "raytrace:spp=4", size=(16, 16)) as fresh:
        first = fresh.render(0, 0).pixels
        np.testing.assert_array_equal(fresh.render(0, 0).pixels, first)
        assert np.any(fresh.render(0, 1).pixels != first)
        assert np.any(fresh.render(1, 0).pixels != first)
    with prepare(triangle_scene, "raytrace:spp=4,reseed=never", size=(16, 16)) as same:
        np.testing.assert_array_equal(same.render(7, 0).pixels, same.render(0, 0).pixels)
        assert np.any(same.render(0, 1).pixels != first)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
@pytest.mark.parametrize("camera", [Camera("orthographic", height=8.0), PERSPECTIVE, SLANTED])
@pytest.mark.parametrize("robust", ["on", "off"])
def test_of_coplanar_surfaces_the_later_wins(
    quad: Any, flat_scene: Any, camera: Camera, order: tuple[int, int], robust: str
) -> None:
    pair = [quad(-3, -3, 3, 3, color=(1.0, 0.0, 0.0)), quad(-1.5, -2, 2, 1.25, color=(0.0, 1.0, 0.0))]
    scene = flat_scene([pair[k] for k in order], camera=camera)
    pixels = render(scene, f"raytrace:robust={robust}", size=(64, 64)).pixels
    alone = [render(flat_scene([p], camera=camera), "raytrace:", size=(64, 64)).pixels.max(axis=2) for p in pair]
    both = (alone[0] > 0) & (alone[1] > 0)
    assert both.sum() > 100
    expected = np.zeros(3)
    expected[order[1]] = 1.0
    np.testing.assert_array_equal(pixels[both], np.broadcast_to(expected, (both.sum(), 3)))
    # Bringing a layer nearer moves no point of the picture.
    np.testing.assert_array_equal(pixels.max(axis=2) > 0, (alone[0] > 0) | (alone[1] > 0))


def test_coplanar_order_holds_from_a_moving_camera_and_among_moving_bodies(quad: Any, flat_scene: Any) -> None:
    camera = Camera("perspective", position=(3.0, 2.0, 5.0), fov_y_deg=60.0, velocity=(20.0, 0.0, 0.0))
    still = quad(-3, -3, 3, 3, color=(1.0, 0.0, 0.0))
    for motion in (Motion(), Motion(velocity=(30.0, 0.0, 0.0))):
        above = quad(-2, -2, 1, 1, color=(0.0, 1.0, 0.0), motion=motion)
        scene = flat_scene([still, above], camera=camera)
        scene = dataclasses.replace(scene, animation=dataclasses.replace(scene.animation, shutter=0.5))
        together = render(scene, "raytrace:spp=16,sampler=random,pattern=shared", size=(48, 48)).pixels
        alone = dataclasses.replace(scene, objects=(above,))
        expected = render(alone, "raytrace:spp=16,sampler=random,pattern=shared", size=(48, 48)).pixels
        assert expected.max() == 1.0
        # Samples within float32's rounding of an edge may differ.
        assert np.count_nonzero(together[..., 1] != expected[..., 1]) <= 1


def test_shared_patterns_have_equal_offsets_in_every_pixel(quad: Any, flat_scene: Any) -> None:
    # A wave of one cycle per pixel is the same in every pixel, and so is what equal offsets see of it.
    wave = {"wave": Grating(16.0, angle_deg=30.0)}
    angle = np.radians(30.0)
    uv = [[0, 0], [1 / np.cos(angle), 0], [1 / np.cos(angle), 1 / np.sin(angle)], [0, 1 / np.sin(angle)]]
    scene = flat_scene([quad(-8, -8, 8, 8, texture="wave", uv=uv)], textures=wave)
    shared = render(scene, "raytrace:spp=5,pattern=shared", size=(16, 16)).pixels
    assert np.ptp(shared) < 1e-6
    assert np.ptp(render(scene, "raytrace:spp=5,pattern=pixel", size=(16, 16)).pixels) > 0.1


def test_diffuse_without_lights_equals_unlit(quad: Any, flat_scene: Any) -> None:
    plain = quad(-3, -3, 3.3, 3, color=(0.3, 0.6, 0.9), texture="c")
    textures = {"c": Checker((5.0, 5.0))}
    diffuse = dataclasses.replace(plain, material=Material("diffuse"))
    pictures = [
        render(flat_scene([s], textures=textures), "raytrace:spp=9", size=(16, 16)).pixels for s in (plain, diffuse)
    ]
    assert pictures[0].max() > 0.2
    np.testing.assert_array_equal(pictures[0], pictures[1])


def test_two_prepared_scenes_do_not_touch_each_other_and_close_twice(quad: Any, flat_scene: Any) -> None:
    one = prepare(flat_scene([quad(-8, -8, 8, 8, color=(1.0, 0.0, 0.0))]), "raytrace:", size=(8, 8))
    two = prepare(flat_scene([quad(-8, -8, 8, 8, color=(0.0, 1.0, 0.0))]), "raytrace:", size=(8, 8))
    with one, two:
        assert one.render().pixels[4, 4].tolist() == [1.0, 0.0, 0.0]
        assert two.render().pixels[4, 4].tolist() == [0.0, 1.0, 0.0]
    one.__exit__(None, None, None)
    with pytest.raises(RuntimeError, match="closed"):
        one.render()


def test_far_from_the_world_origin_the_picture_is_the_same(quad: Any, flat_scene: Any) -> None:
    # Powers of two keep the float64 coordinates exact, so that only the engine's own precision is at stake.
    shift = 2.0**22
    near = flat_scene([quad(-3.25, -2.75, 4.75, 3.25)])
    moved = quad(-3.25 + shift, -2.75, 4.75 + shift, 3.25)
    camera = Camera("orthographic", position=(shift, 0.0, 5.0), target=(shift, 0.0, 0.0), height=16.0)
    pictures = [
        render(scene, "raytrace:spp=16", size=(16, 16)).pixels for scene in (near, flat_scene([moved], camera=camera))
    ]
    np.testing.assert_array_equal(pictures[0], pictures[1])
