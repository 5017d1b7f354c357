"""What the scenes of the artifacts promise: true facts, equal pictures in both forms, no border in sight."""

import math
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from aliasbench.metrics.catalog import measure
from aliasbench.renderers.catalog import render
from aliasbench.scenes.bars import share_of
from aliasbench.scenes.catalog import SCENES, build_scene
from aliasbench.scenes.model import Checker, ImageTexture, Scene
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import view_at
from aliasbench.scenes.textures import evaluate_point

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


# --- each scene's own


def test_the_zone_plate_has_a_false_centre_where_there_is_one_cycle_to_a_pixel() -> None:
    # 64 pixels and k = 64 pi / 0.25: 16 pixels to the side of a pixel the phase is further on by 16 pi, and by 2 pi for
    # each pixel that the first is from the middle, which is a half and a whole number: the same rings, inverted
    k = 64 * math.pi / 0.25
    for technique in ("raytrace:", "raster:"):
        picture = draw(f"zone-plate:k={k!r}", technique, (64, 64))
        # float32 places a pixel's centre to 1e-7 of the picture's height; the phase changes by 2 k r of that
        np.testing.assert_allclose(picture[:, 16:], 1 - picture[:, :-16], rtol=0, atol=1e-7 * 2 * k)
        assert np.ptp(picture) > 0.9
    truth = draw(f"zone-plate:k={k!r}", "reference:", (64, 64))
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
