"""What each built-in scene promises: its facts hold, it loops, and it goes on outside the picture."""

import math

import numpy as np
import pytest
import shapely

from aliasbench.scenes.catalog import SCENES, build_scene
from aliasbench.scenes.confetti import ACROSS, LATTICE, PERIOD
from aliasbench.scenes.model import Scene
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import view_at
from aliasbench.scenes.staging import loop_frames

WIDEST = 4.0  # width over height of the widest picture that the scenes fill


def shapes_at(scene: Scene, frame: int) -> list[tuple[shapely.Polygon, tuple[float, float, float]]]:
    """The scene's outlines in the plane and their colours."""
    out = []
    for surface in scene.objects:
        m = object_matrix(surface.motion, scene.animation, frame, 0.0)
        moved = surface.vertices @ m[:3, :3].T + m[:3, 3]
        out.append((shapely.Polygon(moved[:, :2]), surface.color))
    return out


def color_at(scene: Scene, x: float, y: float, frame: int = 0) -> tuple[float, float, float]:
    """The colour of the last outline over a point of a flat scene."""
    color = scene.background
    for outline, own in shapes_at(scene, frame):
        if outline.contains(shapely.Point(x, y)):
            color = own
    return color


@pytest.mark.parametrize(
    "text",
    [
        "near-horizontal-edge",
        "near-horizontal-edge:slope=-3.5,offset=0.4",
        "edge-fan",
        "edge-fan:wedges=40",
        "edge-fan:wedges=4",
    ],
)
def test_edges_are_bright_to_the_left_and_dark_to_the_right(text: str) -> None:
    scene = build_scene(text)
    assert scene.facts.edges
    for edge in scene.facts.edges:
        start, end = np.array(edge.start[:2]), np.array(edge.end[:2])
        along = (end - start) / np.linalg.norm(end - start)
        left = np.array([-along[1], along[0]])
        for share in (0.05, 0.5, 0.95):
            at = start + share * (end - start)
            assert color_at(scene, *(at + 1e-3 * left)) == (1.0, 1.0, 1.0)
            assert color_at(scene, *(at - 1e-3 * left)) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(("slope", "offset"), [(0.1, 0.0), (0.0, 0.3), (-0.7, -0.2), (4.0, 1.0)])
def test_the_edge_has_its_slope_and_its_offset_and_leaves_the_widest_picture(slope: float, offset: float) -> None:
    scene = SCENES["near-horizontal-edge"].build(slope=slope, offset=offset)
    (edge,) = scene.facts.edges
    (x0, y0, _), (x1, y1, _) = edge.start, edge.end
    assert (y1 - y0) / (x1 - x0) == pytest.approx(slope, abs=1e-14)
    assert y0 + slope * (0.0 - x0) == pytest.approx(offset, abs=1e-13)
    view = shapely.box(-WIDEST - 0.1, -1.1, WIDEST + 0.1, 1.1)
    assert not view.contains(shapely.Point(x0, y0))
    assert not view.contains(shapely.Point(x1, y1))
    # the half plane, and nothing less, over the whole of the widest picture
    above = shapely.Polygon([(-9, slope * -9 + offset), (9, slope * 9 + offset), (9, 99), (-9, 99)])
    (plane, _) = shapes_at(scene, 0)[0]
    assert plane.intersection(view).symmetric_difference(above.intersection(view)).area < 1e-12


def test_a_moving_edge_rises_with_its_speed() -> None:
    scene = build_scene("near-horizontal-edge:speed=0.3")
    assert color_at(scene, 0.0, 0.29, frame=30) == (0.0, 0.0, 0.0)
    assert color_at(scene, 0.0, 0.31, frame=30) == (1.0, 1.0, 1.0)


def test_the_fan_has_edges_at_angles_spread_over_the_quarter_turn() -> None:
    edges = SCENES["edge-fan"].build().facts.edges
    angles = sorted(math.degrees(math.atan2(e.end[1] - e.start[1], e.end[0] - e.start[0])) % 90.0 for e in edges)
    assert len(angles) == 18
    gaps = np.diff([*angles, angles[0] + 90.0])
    assert gaps.min() > 4.4
    assert gaps.max() < 5.6
    assert angles[0] == pytest.approx(1.7, abs=1e-9)


def test_wedges_of_the_fan_do_not_overlap() -> None:
    for count in (4, 18, 128):
        outlines = [outline for outline, _ in shapes_at(SCENES["edge-fan"].build(wedges=count), 0)]
        total = sum(outline.area for outline in outlines)
        assert shapely.union_all(outlines).area == pytest.approx(total, rel=1e-9)


@pytest.mark.parametrize("text", ["confetti", "confetti:count=50,seed=7,speed=-0.25", "confetti:speed=0.3,size_px=8"])
def test_confetti_is_the_same_in_and_around_the_widest_picture_after_a_loop(text: str) -> None:
    scene = build_scene(text)
    view = shapely.box(-WIDEST - 0.25, -1.25, WIDEST + 0.25, 1.25)

    def seen(frame: int) -> list[tuple[float, ...]]:
        rows: list[tuple[float, ...]] = []
        for surface in scene.objects:
            m = object_matrix(surface.motion, scene.animation, frame, 0.0)
            corners = (surface.vertices @ m[:3, :3].T + m[:3, 3])[surface.triangles]
            inside = shapely.intersects(shapely.polygons(corners[..., :2]), view)
            rows += [(*surface.color, *row) for row in np.round(corners[inside].reshape(-1, 9), 9).tolist()]
        return sorted(rows)

    (pan,) = scene.facts.pans
    loops = scene.animation.frames / scene.animation.fps / pan.period
    assert loops == pytest.approx(round(loops), abs=1e-9)
    assert round(loops) >= 1
    first = seen(0)
    assert len(first) > 100
    for times in (1, 4):
        np.testing.assert_allclose(seen(times * scene.animation.frames), first, rtol=0, atol=2e-9)


def test_confetti_has_the_count_and_the_sizes_asked_for() -> None:
    scene = build_scene("confetti:count=800,size_px=3")
    corners = np.concatenate([s.vertices[s.triangles] for s in scene.objects])
    # of the copies of a triangle just one is in the cell about the origin, wherever in its circle its middle lies
    cell = np.linalg.solve(LATTICE[:, :2].T, corners.mean(axis=1)[:, :2].T)
    in_cell = np.count_nonzero((np.floor(cell + 0.5) == 0).all(axis=0))
    assert in_cell == round(800 * PERIOD * ACROSS / 4)
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    assert sides.max() <= 3 * 2 / 256 * (1 + 1e-9)
    # the longest side is at least the circle's radius times sqrt(3)
    assert sides.min() >= 3 * 0.2 / 1.5 / 256 * math.sqrt(3) * (1 - 1e-9)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 2] > 0.0).all()


def test_confetti_that_overlaps_lies_at_depths_of_its_own() -> None:
    scene = build_scene("confetti:count=4000,size_px=20")
    corners = np.concatenate([s.vertices[s.triangles] for s in scene.objects])
    corners = corners[(np.abs(corners[..., 0]) < 0.5).all(axis=1)]
    outlines = shapely.polygons(corners[..., :2])
    first, second = shapely.STRtree(outlines).query(outlines, predicate="overlaps")
    assert len(first) > 1000
    assert (corners[first, 0, 2] != corners[second, 0, 2]).all()
    assert np.ptp(corners[..., 2], axis=1).max() == 0.0


def test_another_seed_gives_another_confetti() -> None:
    assert build_scene("confetti:seed=2").objects != build_scene("confetti").objects


ROTORS = [
    "propeller",
    "propeller:blades=5,rev_per_s=23.5",
    "propeller:blades=1,duty=0.5",
    "propeller:blades=1,duty=0.9",
]
ROTORS += ["propeller:blades=20,duty=0.2", "propeller:duty=0.95,inner=0.1,outer=0.9", "propeller:blades=2,duty=0.05"]


@pytest.mark.parametrize("text", ROTORS)
def test_blades_have_radial_edges_and_their_share_of_the_circle_all_over_the_annulus(text: str) -> None:
    scene = build_scene(text)
    (rotor,) = scene.facts.rotors
    blades = shapely.union_all([outline for outline, _ in shapes_at(scene, 0)])
    steps = 20_000
    angles = 2 * np.pi * (np.arange(steps) + 0.5) / steps
    patterns = []
    for radius in np.linspace(rotor.inner, rotor.outer, 7):
        inside = shapely.contains_xy(blades, radius * np.cos(angles), radius * np.sin(angles))
        # each of the 2 * blades edges is found to half a step
        assert inside.mean() == pytest.approx(rotor.duty, abs=rotor.blades / steps + 1e-12)
        assert np.count_nonzero(inside != np.roll(inside, 1)) == 2 * rotor.blades
        patterns.append(inside)
    # the same at every radius, up to rounding at an edge
    assert max(np.count_nonzero(p != patterns[0]) for p in patterns) <= 2 * rotor.blades
    # and a blade further on it is the same again
    assert np.count_nonzero(patterns[0] != np.roll(patterns[0], steps // rotor.blades)) <= 2 * rotor.blades * (
        1 if steps % rotor.blades == 0 else 2
    )


def test_the_propeller_turns_counter_clockwise_by_twelve_degrees_a_frame() -> None:
    scene = build_scene("propeller")
    start, later = (shapes_at(scene, frame)[0][0].centroid for frame in (0, 1))
    turned = math.degrees(math.atan2(later.y, later.x) - math.atan2(start.y, start.x))
    assert turned == pytest.approx(12.0, abs=1e-9)


@pytest.mark.parametrize(
    ("rate", "frames"),
    [(1.0, 30), (29.0, 30), (30.0, 30), (23.5, 60), (-1.0, 30), (0.0, 30), (0.1, 300), (7.3, 300), (20.0, 30)],
)
def test_the_propeller_makes_whole_turns_in_its_frames(rate: float, frames: int) -> None:
    assert loop_frames(rate) == frames
    turns = frames * rate / 30.0
    assert turns == pytest.approx(round(turns), abs=1e-9)


@pytest.mark.parametrize("rate", [math.pi, 0.01])
def test_a_rate_without_a_short_loop_has_thirty_frames(rate: float) -> None:
    assert loop_frames(rate) == 30


def test_the_floor_loops_over_one_photograph() -> None:
    scene = SCENES["brick-floor"].build()
    floor = scene.objects[0]
    assert floor.uv is not None
    first = view_at(scene.camera, scene.animation, 0, 0.0, (64, 64))
    after = view_at(scene.camera, scene.animation, scene.animation.frames, 0.0, (64, 64))
    assert (after.origin - first.origin).tolist() == [1.0, 0.0, 0.0]
    np.testing.assert_array_equal(after.forward, first.forward)
    # texture coordinates are world x and -z: one world unit is one photograph
    np.testing.assert_array_equal(floor.uv, floor.vertices[:, [0, 2]] * (1.0, -1.0))


@pytest.mark.parametrize("frame", [0, 600])
def test_the_floor_fills_the_widest_picture_below_its_far_end_and_the_horizon_shows(frame: int) -> None:
    scene = SCENES["brick-floor"].build()
    view = view_at(scene.camera, scene.animation, frame, 0.0, (400, 100))
    corners = view.project(scene.objects[0].vertices)
    assert (corners[:, 2] > 0.0).all()  # in front of the eye: nothing to clip there
    near, far = corners[:2], corners[2:]
    assert near[:, 1].min() > 105.0
    assert near[0, 0] < -5.0
    assert near[1, 0] > 405.0
    assert far[1, 0] < -5.0
    assert far[0, 0] > 405.0
    horizon = 50.0 - view.scale * math.tan(math.radians(12.0))
    assert 20.0 < horizon < far[:, 1].min() < horizon + 5.0


def test_the_photograph_is_read_once_and_keeps_its_source_relative() -> None:
    first, second = (SCENES["brick-floor"].build().textures["brick"] for _ in range(2))
    assert first is second
    assert getattr(first, "source", "") == "skimage:brick.png"
