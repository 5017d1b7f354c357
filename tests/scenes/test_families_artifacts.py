"""What the scenes of the artifacts promise: true facts, equal pictures in both forms, no border in sight."""

import math
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from aliasbench.renderers.catalog import render
from aliasbench.scenes.bars import share_of
from aliasbench.scenes.catalog import SCENES, build_scene
from aliasbench.scenes.model import Checker, ImageTexture, Scene
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import view_at

WIDEST = shapely.box(-4.0, -1.0, 4.0, 1.0)  # world units of a flat picture four times as wide as high
Image = NDArray[np.floating[Any]]


def draw(text: str, technique: str, size: tuple[int, int], frame: int = 0) -> Image:
    return render(build_scene(text), technique, size=size, frame=frame).pixels


def outline_of_all(scene: Scene, index: int, frame: int) -> shapely.Polygon:
    """The hull of an object at a frame, in the plane."""
    surface = scene.objects[index]
    m = object_matrix(surface.motion, scene.animation, frame, 0.0)
    return shapely.MultiPoint((surface.vertices @ m[:3, :3].T + m[:3, 3])[:, :2]).convex_hull


def coverage_at(scene: Scene, index: int, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether a bar of an object is over points (n, 2), at rest."""
    surface = scene.objects[index]
    corners = surface.vertices[surface.triangles][..., :2]
    tree = shapely.STRtree(shapely.polygons(corners))
    found = np.zeros(len(points), dtype=bool)
    found[tree.query(shapely.points(points), predicate="intersects")[0]] = True
    return found


# --- two forms, one picture


@settings(max_examples=4)
@given(
    wires=st.floats(6.0, 40.0),
    ratio=st.floats(0.8, 1.25),
    angle=st.floats(-80.0, 80.0),
    tilt=st.floats(-80.0, 80.0),
    duty=st.floats(0.1, 0.9),
    speed=st.floats(-3.0, 3.0),
    weave=st.sampled_from(["upright", "crossed"]),
    frame=st.integers(0, 90),
)
def test_screens_of_polygons_and_of_cut_outs_are_one_picture(frame: int, ratio: float, **rest: Any) -> None:
    named = {"angle_deg": rest.pop("angle"), "tilt_deg": rest.pop("tilt"), "pitch_ratio": ratio, **rest}
    pictures = [
        render(SCENES["window-screens"].build(kind=kind, **named), "reference:", size=(48, 32), frame=frame).pixels
        for kind in ("polygons", "cutouts")
    ]
    np.testing.assert_allclose(pictures[1], pictures[0], rtol=0, atol=1e-9)


@settings(max_examples=4)
@given(
    lines=st.floats(6.0, 60.0), angle_deg=st.floats(-80.0, 80.0), duty=st.floats(0.1, 0.9), speed=st.floats(-3.0, 3.0)
)
def test_grids_of_polygons_and_of_a_texture_are_one_picture(**named: float) -> None:
    pictures = [
        render(SCENES["grid"].build(kind=kind, **named), "reference:", size=(48, 32), frame=7)
        for kind in ("polygons", "texture")
    ]
    known = sum(p.uncertainty or 0.0 for p in pictures)
    np.testing.assert_allclose(pictures[1].pixels, pictures[0].pixels, rtol=0, atol=known + 1e-9)


@pytest.mark.parametrize(("duty", "parts"), [(0.5, 2), (0.3, 10), (1 / 32, 32), (31 / 32, 32), (1 / 3, 3), (0.123, 8)])
def test_shares_are_the_nearest_fraction_of_few_parts(duty: float, parts: int) -> None:
    share = share_of(duty)
    assert share.denominator <= 32
    assert abs(share - duty) <= min(abs(round(duty * n) / n - duty) for n in range(1, 33)) + 1e-15
    assert share.denominator == parts
    texture = SCENES["window-screens"].build(duty=duty, kind="cutouts").textures["wire"]
    assert isinstance(texture, ImageTexture)
    assert np.mean(texture.texels[..., 3] >= 0.5) == pytest.approx(float(share), abs=1e-12)


# --- facts


SCREENS = [
    "window-screens",
    "window-screens:wires=400,angle_deg=-3,tilt_deg=20,duty=0.3",
    "window-screens:weave=crossed,wires=37.5,pitch_ratio=1.2,angle_deg=30",
]


@pytest.mark.parametrize("text", SCREENS)
def test_screens_declare_front_back_and_beat_for_each_way_of_their_wires(text: str) -> None:
    scene = build_scene(text)
    declared = [np.array(g.cycles_per_unit) for g in scene.facts.gratings]
    ways = len(scene.objects) // 2
    assert len(declared) == 3 * ways
    points = np.random.default_rng(5).uniform(-0.9, 0.9, (400, 2))
    for way in range(ways):
        front, back, beat = declared[3 * way : 3 * way + 3]
        np.testing.assert_allclose(beat, front - back, rtol=0, atol=1e-12 * float(np.hypot(*front)))
        for index, frequency in ((2 * way + 1, front), (2 * way, back)):
            assert f"{'front' if frequency is front else 'back'} wires" in scene.objects[index].name
            over = coverage_at(scene, index, points)
            assert 0 < np.count_nonzero(over) < len(points)
            period = frequency / (frequency @ frequency)
            for shift, same in ((period, True), (7 * period, True), (0.5 * period, False)):
                moved = coverage_at(scene, index, points + shift)
                # a point within rounding of an edge may go either way
                assert (np.count_nonzero(moved != over) <= 1) == same
    heights = [float(surface.vertices[0, 2]) for surface in scene.objects]
    assert len(set(heights)) == len(heights)


def test_equal_screens_have_no_beat_to_declare() -> None:
    assert len(build_scene("window-screens:pitch_ratio=1,angle_deg=0").facts.gratings) == 2


def test_the_true_beat_is_in_the_reference_and_false_ones_are_in_the_point_sample() -> None:
    # 33 and 35 wires to 32 pixels: the beat has 2 cycles in 32 pixels, the point-sampled screens 1 and 3
    text = "window-screens:wires=33,pitch_ratio=0.942857142857142857,angle_deg=0,speed=0"
    lines = {}
    for technique in ("reference:", "raytrace:", "raster:"):
        picture = draw(text, technique, (128, 32)).mean(axis=(0, 2))
        spectrum = 2 * np.abs(np.fft.rfft(picture)) / len(picture)
        lines[technique] = {k: float(spectrum[4 * k]) for k in range(1, 9)}
    # two square waves of half black: their first harmonics are 2 / pi each about the mean, and meet as cos cos
    expected = 2 * (1 / math.pi) ** 2
    true = lines["reference:"]
    # besides it, what is left under a pixel's box of f1 (the share 1 / 33 of 1 / pi) and of higher beats (a ninth)
    assert max(true, key=lambda k: true[k]) == 2
    assert true[2] == pytest.approx(expected, rel=1 / 33)
    assert max(v for k, v in true.items() if k != 2) < expected / 9 + 1 / 33 / math.pi
    for technique in ("raytrace:", "raster:"):
        false = lines[technique]
        assert max(false, key=lambda k: false[k]) in (1, 3)
        assert min(false[1], false[3]) > true[2]


@pytest.mark.parametrize(
    "text", ["grid", "grid:lines=97.3,angle_deg=-31,duty=0.3", "grid:kind=polygons,angle_deg=90,lines=40"]
)
def test_a_grid_declares_the_frequencies_that_its_two_sets_of_lines_have(text: str) -> None:
    scene = build_scene(text)
    # the same lines as geometry, of which periods can be counted
    polygons = SCENES["grid"].build(**{**_parameters(scene.name), "kind": "polygons"})
    points = np.random.default_rng(6).uniform(-0.9, 0.9, (300, 2))
    assert polygons.facts == scene.facts
    for index, fact in enumerate(scene.facts.gratings):
        frequency = np.array(fact.cycles_per_unit)
        assert np.hypot(*frequency) == pytest.approx(float(_parameters(scene.name).get("lines", 528.0)) / 2.0)
        over = coverage_at(polygons, index, points)
        period = frequency / (frequency @ frequency)
        assert np.count_nonzero(coverage_at(polygons, index, points + period) != over) <= 1
        assert np.count_nonzero(coverage_at(polygons, index, points + period / 2) != over) > 50
    (pan,) = scene.facts.pans
    # a loop is one period along the first direction
    way = np.array(pan.velocity[:2]) * pan.period
    np.testing.assert_allclose(way @ scene.facts.gratings[0].cycles_per_unit, 1.0, rtol=1e-12)
    np.testing.assert_allclose(way @ scene.facts.gratings[1].cycles_per_unit, 0.0, rtol=0, atol=1e-12)


def _parameters(name: str) -> dict[str, Any]:
    items = name.partition(":")[2].split(",")
    pairs = [item.partition("=")[::2] for item in items if item]
    return {k: v if v.isalpha() else float(v) for k, v in pairs}


# --- nothing ends in sight


@pytest.mark.parametrize(
    "text",
    [
        *("grid", "grid:lines=5,angle_deg=37,speed=-9", "grid:kind=polygons,lines=20,angle_deg=61,speed=15"),
        *("window-screens:wires=9,speed=-12,angle_deg=40", "window-screens:kind=cutouts,weave=crossed,tilt_deg=50"),
        *("zone-plate:speed=0.5", "zone-plate:speed=-1"),
    ],
)
def test_flat_patterns_go_on_outside_the_widest_picture_for_ten_seconds(text: str) -> None:
    scene = build_scene(text)
    for frame in (0, 299):
        for index in range(len(scene.objects)):
            assert outline_of_all(scene, index, frame).contains(WIDEST)


@pytest.mark.parametrize("text", ["checker-floor", "checker-floor:far=400,speed=-4", "checker-floor:far=4,squares=1"])
def test_the_checkered_floor_fills_the_widest_picture_up_to_its_far_end(text: str) -> None:
    scene = build_scene(text)
    far = _parameters(scene.name).get("far", 40.0)
    for frame in (0, 599):
        view = view_at(scene.camera, scene.animation, frame, 0.0, (400, 100))
        seen = view.project(scene.objects[0].vertices)
        assert (seen[:, 2] > 0.0).all()
        assert seen[:2, 1].min() > 102.0
        assert seen[[0, 3], 0].max() < 0.0
        assert seen[[1, 2], 0].min() > 400.0
        end = view.project(np.array([[view.origin[0], 0.0, -far]]))[0, 1]
        assert seen[2:, 1] == pytest.approx([end, end])


def test_the_checkered_floor_loops_over_two_squares() -> None:
    scene = build_scene("checker-floor:squares=3,speed=0.4")
    texture = scene.textures["checker"]
    assert isinstance(texture, Checker)
    way = scene.camera.velocity[0] * scene.animation.frames / scene.animation.fps
    periods = way * texture.squares[0] / 2
    assert periods == pytest.approx(round(periods), abs=1e-12)
    assert round(periods) >= 1
