"""The hard cases of shapes and viewpoints: their outcomes, and that each kind of check can fail."""

import dataclasses
import math
from functools import partial
from typing import Any

import numpy as np
import pytest

from aliasbench.bench.hard import aiming, coplanar, degenerate, placing, rays, shapes, viewpoints
from aliasbench.bench.hard.case import EGL, FAST, OSMESA, PORTABLE, REFERENCE, TRACER
from aliasbench.bench.hard.ownership import distance_to_outline, inside, pixel_points
from aliasbench.bench.hard.painting import SNAPPED_PX, Painting, paint
from aliasbench.bench.hard.placing import BLUE, ORANGE, SIZE, Setting, camera, flat, misplaced
from aliasbench.renderers.frame import Frame
from aliasbench.scenes.model import Scene
from aliasbench.scenes.shapes import mesh

CASES = {case.name: case for case in (*shapes.CASES, *degenerate.CASES, *coplanar.CASES, *viewpoints.CASES)}
# Every other answer is "ok".
LIMITS = {
    "sliver-samples": {TRACER, FAST, PORTABLE, EGL, OSMESA},
    "coplanar": {EGL, OSMESA},
    "coplanar-moving": {EGL, OSMESA},
    "behind-camera": {TRACER, FAST, PORTABLE, EGL, OSMESA},
    "inside-box": {TRACER, FAST, PORTABLE, EGL, OSMESA},
    "many-vertices": {TRACER, FAST, PORTABLE, EGL, OSMESA},
    "huge-polygon": {TRACER, FAST, PORTABLE, EGL, OSMESA},
    "huge-polygon-exposed": {EGL, OSMESA},
    "very-near": {TRACER, FAST, PORTABLE, EGL, OSMESA},
}
# What is slow is asked for less of.
REDUCED: dict[tuple[str, str], Any] = {
    **{
        ("sliver-light", s): partial(shapes._sliver_light, powers=(2, 4)) for s in (TRACER, FAST, PORTABLE, EGL, OSMESA)
    },
    ("sliver-light", REFERENCE): partial(shapes._sliver_light, powers=(1,)),
}


@pytest.fixture(autouse=True)
def reduced(monkeypatch: pytest.MonkeyPatch) -> None:
    """Look at fewer of the settings with many corners, at each kind of them."""
    rings, huge = shapes.ring_settings(), shapes.huge_settings()
    monkeypatch.setattr(shapes, "ring_settings", lambda: [rings[k] for k in (1, 2, 5, 9)])
    monkeypatch.setattr(shapes, "huge_settings", lambda: [huge[k] for k in (0, 4, 8, 17)])
    monkeypatch.setattr(shapes, "_INSTANTS", 4)
    monkeypatch.setattr(viewpoints, "_AIM", 1)


@pytest.mark.parametrize(("name", "subject"), [(c.name, s) for c in CASES.values() for s in c.subjects])
def test_every_case_has_its_outcome(name: str, subject: str) -> None:
    verdict = REDUCED.get((name, subject), CASES[name].check)(subject)
    assert verdict.outcome == ("limit" if subject in LIMITS.get(name, ()) else "ok"), verdict


def test_a_painting_covers_and_shows_what_its_outlines_say() -> None:
    low = np.array([(1.25, 1.0), (4.5, 1.0), (4.5, 3.0), (1.25, 3.0)])
    high = np.array([(3.0, 0.0), (6.0, 0.0), (6.0, 2.5), (3.0, 2.5)])
    painting = Painting((8, 4), (low, high), (ORANGE, BLUE), (0.0, 0.0, 0.0))
    coverage = painting.coverage()
    # sums of exact binary fractions, cut by exact coordinates
    np.testing.assert_allclose(coverage[1, 1], 0.75 * np.array(ORANGE), atol=1e-15)
    np.testing.assert_allclose(coverage[2, 3], 0.5 * np.array(BLUE) + 0.5 * np.array(ORANGE), atol=1e-15)
    np.testing.assert_allclose(coverage[2, 4], 0.5 * np.array(BLUE) + 0.25 * np.array(ORANGE), atol=1e-15)
    shown = painting.color_at(np.array([(2.0, 2.0), (3.5, 2.0), (7.0, 3.5)]))
    np.testing.assert_array_equal(shown, [ORANGE, BLUE, (0.0, 0.0, 0.0)])


def test_a_wrong_colour_counts_as_far_as_it_is_from_where_it_is_seen() -> None:
    left = np.array([(-1.0, -1.0), (3.0, -1.0), (3.0, 5.0), (-1.0, 5.0)])
    painting = Painting((8, 4), (left,), (ORANGE,), (0.0, 0.0, 0.0))
    picture = painting.color_at(np.stack(np.meshgrid(np.arange(8) + 0.5, np.arange(4) + 0.5), -1).reshape(-1, 2))
    picture = picture.reshape(4, 8, 3)
    assert painting.apart(picture).max() == 0.0
    picture[1, 5] = ORANGE  # its centre is 2.5 px from the region
    picture[2, 1] = 0.0
    assert sorted(painting.apart(picture))[-2:] == pytest.approx([1.5, 2.5], abs=1e-12)
    picture[0, 0] = BLUE
    assert painting.apart(picture).max() == 1e9


def test_a_polygon_through_the_camera_s_plane_is_painted_to_its_horizon() -> None:
    seen = next(s for s in viewpoints.passing_settings() if s.name == "perspective straight floor")
    painting = seen.painting()
    assert len(painting.outlines) == 1  # what lies behind the camera is nowhere
    assert 0.05 < (painting.coverage() > 0).any(axis=2).mean() < 0.9


def _shifted(monkeypatch: pytest.MonkeyPatch, by: int) -> None:
    real = placing.render

    def render(*args: Any, **options: Any) -> Frame:
        frame = real(*args, **options)
        return dataclasses.replace(frame, pixels=np.roll(frame.pixels, by, axis=1))

    monkeypatch.setattr(placing, "render", render)


@pytest.mark.parametrize("subject", [TRACER, EGL, REFERENCE])
@pytest.mark.parametrize(
    "name",
    [
        "sliver-samples",
        "many-vertices",
        "huge-polygon",
        "coplanar",
        "behind-camera",
        "behind-camera-textured",
        "edge-on-polygon",
        "inside-box",
    ],
)
def test_a_picture_that_is_shifted_by_a_pixel_fails(monkeypatch: pytest.MonkeyPatch, name: str, subject: str) -> None:
    _shifted(monkeypatch, 1)
    assert CASES[name].check(subject).outcome == "failed"


@pytest.mark.parametrize("subject", [TRACER, EGL, REFERENCE])
def test_a_wrong_winner_fails(subject: str) -> None:
    stack = coplanar.stack_settings((60.0,))[0]
    turned = dataclasses.replace(stack.scene, objects=stack.scene.objects[::-1])
    assert misplaced(subject, [dataclasses.replace(stack, scene=turned, truth=stack.scene)]).outcome == "failed"


def test_layers_that_are_drawn_in_the_wrong_order_fail_on_the_ground(monkeypatch: pytest.MonkeyPatch) -> None:
    real = placing.render

    def render(scene: Scene, *args: Any, **options: Any) -> Frame:
        return real(dataclasses.replace(scene, objects=scene.objects[::-1]), *args, **options)

    monkeypatch.setattr(placing, "render", render)
    assert CASES["coplanar-ground"].check(EGL).outcome == "failed"


@pytest.mark.parametrize("subject", [TRACER, EGL, REFERENCE])
def test_a_triangle_with_an_area_is_noticed(monkeypatch: pytest.MonkeyPatch, subject: str) -> None:
    clean = degenerate.degenerate_meshes()[0]
    more = mesh([*clean.vertices, (12.0, 0.0, 0.0)], [*clean.triangles, (1, 2, 4)], color=clean.color)
    monkeypatch.setattr(degenerate, "degenerate_meshes", lambda: (clean, more))
    assert CASES["degenerate-triangles"].check(subject).outcome == "failed"
    assert CASES["degenerate-files"].check(subject).outcome == "failed"


def test_an_empty_picture_proves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    _, odd = degenerate.degenerate_meshes()
    away = mesh(odd.vertices + 1e3, odd.triangles, color=odd.color)
    monkeypatch.setattr(degenerate, "degenerate_meshes", lambda: (away, away))
    assert CASES["degenerate-triangles"].check(TRACER).outcome == "failed"


@pytest.mark.parametrize("share", [1.05, 0.95])
def test_slivers_of_another_area_fail(monkeypatch: pytest.MonkeyPatch, share: float) -> None:
    def hatch(width: float, seed: int) -> tuple[Scene, float]:
        scene, area = real(width, seed)
        return scene, share * area

    real = shapes.sliver_hatch
    monkeypatch.setattr(shapes, "sliver_hatch", hatch)
    # a twentieth of a coverage of .11 at a standard error of at most 7e-4: eight of them
    assert shapes._sliver_light(TRACER, powers=(2,)).outcome == "failed"


@pytest.mark.parametrize("projection", placing.PROJECTIONS)
def test_a_camera_that_is_aimed_has_an_edge_beside_a_sample(projection: placing.Projection) -> None:
    outline = flat([(-9.37, -7.13), (8.71, -5.19), (3.93, 9.68)], ORANGE)
    setting = Setting("triangle", Scene("triangle", camera(projection), (outline,)))
    found = placing._pictures(setting, 2)
    assert len(found) == 1 + 2 * len(aiming.BESIDE)
    points = pixel_points(SIZE)
    for first in (1, 1 + len(aiming.BESIDE)):
        outlines = [painting.outlines[0] for _, painting in found[first : first + len(aiming.BESIDE)]]
        nearest = int(distance_to_outline(points, outlines[-1]).argmin())  # of the finest aim
        point = points[nearest : nearest + 1]
        away = np.array([distance_to_outline(point, o)[0] * (1.0 if inside(point, o)[0] else -1.0) for o in outlines])
        # the search ends within 1e-9 px, and what is left of it is straight to 1e-3 of 2^-10 px
        np.testing.assert_allclose(np.abs(away), np.abs(aiming.BESIDE), rtol=1e-3, atol=2e-9)
        assert (np.sign(away) == np.sign(away[0]) * np.sign(aiming.BESIDE)).all()


def test_ray_bounds_follow_from_distances_in_pixels() -> None:
    square = flat([(-5.0, -5.0), (5.0, -5.0), (5.0, 5.0), (-5.0, 5.0)], ORANGE)
    scene = Scene("square", camera("orthographic"), (square,))
    # e = (10, 0, 0), s = (0, 10, -96) and the pinhole's directions at most (5, 5, 48) / 48.5: |e_x| (|s_y| |D_z| +
    # |s_z| |D_y|) over |e x s|, or half of it, with origins up to (18, 12) from the axis, over |e|
    off, corner = math.sqrt(48.0**2 + 50.0), 1.0 + (36.0**2 + 24.0**2) / 4.0 / 48.0**2
    parallel = 2.0**-24 * (6.0 * (off + math.hypot(18.0, 12.0)) + 7.0 * 10.0 * (10.0 + 2.0 * 18.0) / 20.0)
    assert rays.ray_bound(scene, SIZE) == pytest.approx(parallel, rel=1e-9)
    through = Scene("square", camera("perspective"), (square,))
    near = math.sqrt(48.0**2 + 5.0**2)
    products = 10.0 * (10.0 * 48.0 / off + 96.0 * 5.0 / off) / (10.0 * math.hypot(10.0, 96.0))
    pinhole = 2.0**-24 * (6.0 * off / near + 7.0 * products) * 48.0 * corner
    assert rays.ray_bound(through, SIZE) == pytest.approx(pinhole, rel=1e-9)
    # roundings are relative: a scene a thousand times as large is as many pixels off
    large = Scene("large", camera("perspective", (0.0, 0.0, 48e3)), (flat(1e3 * square.vertices[:, :2], ORANGE),))
    assert rays.ray_bound(large, SIZE) == pytest.approx(pinhole, rel=1e-9)
    # what is not in the picture may be anywhere
    away = flat([(60.0, 0.0), (1e6, 0.0), (1e6, 9.0)], ORANGE)
    beside = dataclasses.replace(scene, objects=(square, away))
    assert rays.ray_bound(beside, SIZE) == rays.ray_bound(scene, SIZE)
    assert rays.truth_bound(scene, SIZE) < 2.0**-24 * rays.ray_bound(scene, SIZE)


def test_the_fast_test_may_see_through_nowhere_but_at_triangles_sides(monkeypatch: pytest.MonkeyPatch) -> None:
    square = flat([(-8.0, -8.0), (8.0, -8.0), (8.0, 8.0), (-8.0, 8.0)], ORANGE)
    setting = Setting("square", Scene("square", camera("orthographic"), (square,)))
    real = placing.render
    holes = {
        "on the diagonal": (14, 15),
        "off it": (14, 18),
    }  # of the triangles (0, 1, 2) and (0, 2, 3), rows downwards
    for where, (row, column) in holes.items():

        def render(*args: Any, at: tuple[int, int] = (row, column), **options: Any) -> Frame:
            frame = real(*args, **options)
            pixels = frame.pixels.copy()
            assert (pixels[at] == ORANGE).all()
            pixels[at] = 0.0
            return dataclasses.replace(frame, pixels=pixels)

        monkeypatch.setattr(placing, "render", render)
        assert misplaced(FAST, [setting]).outcome == ("ok" if where == "on the diagonal" else "failed")
        assert misplaced(TRACER, [setting]).outcome == "failed"


def test_the_snapped_bound_is_half_a_subpixel_step_each_way() -> None:
    assert np.hypot(1 / 512, 1 / 512) == SNAPPED_PX
    square = Scene("square", camera("orthographic"), (flat([(-2, -2), (2, -2), (2, 2), (-2, 2)], ORANGE),))
    assert paint(square, SIZE).coverage().sum() == pytest.approx(16 * 1.5, abs=1e-12)
    assert misplaced(TRACER, [Setting("square", square)]).outcome == "ok"
