"""What single scenes of the artifacts promise: closed forms of theirs, and artifacts that are plain to see."""

import math

import numpy as np
import pytest
import shapely

from aliasbench.metrics.catalog import measure
from aliasbench.renderers.catalog import render
from aliasbench.scenes.catalog import SCENES, build_scene
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import view_at
from aliasbench.scenes.textures import evaluate_point


def test_the_zone_plate_has_a_false_centre_where_there_is_one_cycle_to_a_pixel() -> None:
    # 64 pixels and k = 64 pi / 0.25: 16 pixels to the side of a pixel the phase is further on by 16 pi, and by 2 pi for
    # each pixel that the first is from the middle, which is a half and a whole number: the same rings, inverted
    k = 64 * math.pi / 0.25
    scene = SCENES["zone-plate"].build(k=k)
    for technique in ("raytrace:", "raster:"):
        picture = render(scene, technique, size=(64, 64)).pixels
        # float32 places a pixel's centre to 1e-7 of the picture's height; the phase changes by 2 k r of that
        np.testing.assert_allclose(picture[:, 16:], 1 - picture[:, :-16], rtol=0, atol=1e-7 * 2 * k)
        assert np.ptp(picture) > 0.9
    truth = render(scene, "reference:", size=(64, 64)).pixels
    assert np.ptp(truth[28:36, 28:36]) > 0.5  # the true centre
    assert np.ptp(truth[28:36, 45:51]) < 0.15  # nothing where the false one is


@pytest.mark.parametrize(("k", "phase"), [(4000.0, 0.0), (123.4, 1.0), (30.0, -3.0)])
def test_the_zone_plate_is_what_its_parameters_say(k: float, phase: float) -> None:
    scene = SCENES["zone-plate"].build(k=k, phase=phase)
    (plate,) = scene.objects
    assert plate.uv is not None
    places = np.random.default_rng(3).uniform(-1.0, 1.0, (50, 2))
    # uv is linear in the world's x and y
    fit = np.linalg.lstsq(np.c_[plate.vertices[:, :2], np.ones(4)], plate.uv, rcond=None)[0]
    values = evaluate_point(scene.textures["rings"], np.c_[places, np.ones(50)] @ fit)[:, 0]
    heights = np.hypot(*places.T) / 2.0
    np.testing.assert_allclose(values, (1 + np.cos(k * heights**2 + phase)) / 2, rtol=0, atol=1e-9)


@pytest.mark.parametrize(("count", "least", "most"), [(96, 0.02, 1.0), (7, 0.1, 0.1), (300, 0.5, 2.0), (3, 0.001, 0.3)])
def test_slivers_have_the_widths_asked_for_and_keep_apart(count: int, least: float, most: float) -> None:
    scene = SCENES["slivers"].build(count=count, narrowest_px=least, widest_px=most)
    corners = np.concatenate([s.vertices[s.triangles] for s in scene.objects])[..., :2]
    assert len(corners) == count
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    widths = sides.min(axis=1) * 128  # pixels of a picture 2 units and 256 pixels high
    assert widths.min() == pytest.approx(least, rel=1e-9)
    assert widths.max() == pytest.approx(most, rel=1e-9)
    shapes = shapely.polygons(corners)
    assert shapely.union_all(shapes).area == pytest.approx(float(shapely.area(shapes).sum()), rel=1e-9)
    assert np.abs(corners).max() < 1.0


@pytest.mark.parametrize(
    ("text", "frames"), [("slivers", 50), ("slivers:count=95", 300), ("slivers:rev_per_s=1,count=32", 30)]
)
def test_slivers_loop_over_equal_parts_of_a_turn(text: str, frames: int) -> None:
    assert build_scene(text).animation.frames == frames


@pytest.mark.parametrize("texture", ["checker", "photograph"])
@pytest.mark.parametrize("size", [8.0, 40.0, 200.0])
def test_the_distant_triangle_has_its_height_and_its_speed_in_pixels(texture: str, size: float) -> None:
    scene = SCENES["distant-triangle"].build(size_px=size, texture=texture, speed_px=9.0)
    (triangle,) = scene.objects
    seen = []
    for frame in (0, 30):
        m = object_matrix(triangle.motion, scene.animation, frame, 0.0)
        view = view_at(scene.camera, scene.animation, frame, 0.0, (256, 256))
        seen.append(view.project(triangle.vertices @ m[:3, :3].T + m[:3, 3])[:, :2])
    # its corners are up to a quarter of its size nearer or farther than its middle, at a hundred units
    near = size * 2 * 100.0 * math.tan(math.radians(15.0)) / 256 / 100.0
    assert np.ptp(seen[0][:, 1]) == pytest.approx(size, rel=near)
    np.testing.assert_allclose(np.linalg.norm(seen[1] - seen[0], axis=1), 9.0, rtol=near)


def test_the_distant_triangle_boils_and_the_truth_does_not() -> None:
    scene = build_scene("distant-triangle:size_px=60")
    point, truth = (
        np.array([render(scene, technique, size=(128, 128), frame=n).pixels for n in range(6)])
        for technique in ("raytrace:", "reference:")
    )
    inside = (slice(None), slice(60, 68), slice(58, 66))
    assert point[inside].std(axis=0).mean() > 4 * truth[inside].std(axis=0).mean()
    score = measure("shimmer", point, truth, scene=scene)
    assert score.value is not None
    assert score.value > 0.02


@pytest.mark.parametrize("rate", [1.0, 29.0, 30.0])
def test_the_three_propellers_differ_in_their_default_rate_alone(rate: float) -> None:
    named, plain = SCENES[f"propeller-{rate:g}"], SCENES["propeller"].build(rev_per_s=rate)
    scene = named.build()
    assert scene.facts.rotors[0].rev_per_s == rate
    assert (scene.objects, scene.camera, scene.animation, scene.facts) == (
        plain.objects,
        plain.camera,
        plain.animation,
        plain.facts,
    )
    assert named.parameters.keys() == SCENES["propeller"].parameters.keys()
    assert named.build(rev_per_s=2.0).facts == SCENES["propeller"].build(rev_per_s=2.0).facts


@pytest.mark.parametrize("text", ["grid", "zone-plate", "window-screens"])
@pytest.mark.parametrize("side", [256, 512])
def test_moire_is_plain_at_the_default_in_pictures_of_both_sizes(text: str, side: int) -> None:
    scene = build_scene(text)
    point, truth = (render(scene, technique, size=(side, side)) for technique in ("raytrace:", "reference:"))
    score = measure(
        "moire", point.pixels[None], truth.pixels[None], scene=scene, reference_uncertainty=truth.uncertainty or 0.0
    )
    assert score.value is not None
    assert score.value > 0.1
