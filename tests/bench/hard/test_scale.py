"""The hard cases of scale: each comes out as written down here, and none passes on a picture that is wrong."""

import math
from dataclasses import replace
from itertools import count

import numpy as np
import pytest

from aliasbench.bench.hard import coordinates, depth, footprints, horizon, ladder, scale, texel_areas
from aliasbench.bench.hard.case import EGL, REFERENCE, TRACER, with_keys
from aliasbench.bench.hard.ownership import pixel_points
from aliasbench.bench.hard.sight import centres_of, what_is_seen
from aliasbench.renderers import catalog
from aliasbench.renderers.technique import parse_technique
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Camera, Checker, Scene, as_vec3
from aliasbench.scenes.shapes import quad

MODULES = (scale, depth, footprints, coordinates, horizon, ladder, texel_areas)
CASES = {c.name: c for m in MODULES for c in getattr(m, "CASES", ())}

# Outcomes of tracers, rasterizers and the reference; "-": not asked.
OUTCOMES = {
    "far-from-origin": ("limit", "limit", "ok"),
    "units-small": ("limit", "limit", "ok"),
    "units-large": ("limit", "limit", "ok"),
    "scales-exposed": ("ok", "ok", "ok"),
    "meshes-far-from-origin": ("limit", "limit", "ok"),
    "telescope": ("limit", "limit", "ok"),
    "surfaces-vast": ("limit", "limit", "ok"),
    "depth-range": ("limit", "limit", "ok"),
    "depth-close": ("limit", "limit", "ok"),
    "footprints-point": ("ok", "limit", "ok"),
    "footprints-extreme": ("ok", "limit", "ok"),
    "footprints-minified": ("ok", "ok", "ok"),
    "footprints-magnified": ("ok", "ok", "ok"),
    "coordinates-far-point": ("ok", "ok", "ok"),
    "coordinates-far-filtered": ("ok", "ok", "ok"),
    "repeats-many": ("ok", "limit", "ok"),
    "horizon-point": ("limit", "limit", "ok"),
    "horizon-filtered": ("ok", "ok", "ok"),
    "horizon-mean": ("ok", "ok", "-"),
}
# What a GPU may round more, or less, than the software device does: either is well.
EITHER = {"footprints-point", "footprints-magnified", "footprints-extreme", "repeats-many", "horizon-point"}
GROUPS = {"raytrace": 0, "raster": 1, "reference": 2}


def pairs():
    return [pytest.param(c, s, id=f"{c.name}-{s}") for c in CASES.values() for s in c.subjects]


def test_every_case_has_its_outcome_written_down():
    assert list(OUTCOMES) == list(CASES)
    for case in CASES.values():
        asked = {s.split(":")[0] for s in case.subjects}
        assert asked == {name for name, k in GROUPS.items() if OUTCOMES[case.name][k] != "-"}
        assert case.group == "scale"


@pytest.mark.parametrize(("case", "subject"), pairs())
def test_a_case_comes_out_as_written_down(case, subject):
    verdict = case.check(subject)
    group = subject.split(":")[0]
    expected = {OUTCOMES[case.name][GROUPS[group]]}
    if group == "raster" and case.name in EITHER:
        expected = {"ok", "limit"}
    assert verdict.outcome in expected, verdict


def change_pictures(monkeypatch, change):
    """Make every module of cases render through `change(scene, technique, size, frame) -> Frame`."""
    for module in MODULES:
        if hasattr(module, "render"):
            monkeypatch.setattr(module, "render", change)


@pytest.mark.parametrize(
    ("name", "subject"),
    [
        ("units-small", REFERENCE),
        ("scales-exposed", TRACER),
        ("meshes-far-from-origin", REFERENCE),
        ("depth-close", REFERENCE),
        ("depth-range", REFERENCE),
        ("footprints-point", REFERENCE),
        ("footprints-extreme", TRACER),
        ("footprints-extreme", REFERENCE),
        ("footprints-magnified", REFERENCE),
        ("coordinates-far-point", REFERENCE),
        ("repeats-many", REFERENCE),
        ("horizon-point", REFERENCE),
        ("footprints-minified", EGL),
        ("footprints-minified", REFERENCE),
        ("footprints-magnified", EGL),
        ("horizon-filtered", TRACER),
        ("horizon-filtered", REFERENCE),
        ("horizon-mean", EGL),
    ],
)
def test_a_picture_that_is_paler_is_noticed(monkeypatch, name, subject):
    calls = count()

    def paler(scene, technique, *, size, frame=0):
        made = catalog.render(scene, technique, size=size, frame=frame)
        # by 2 % and ever more, so that pictures that are compared differ too
        return replace(made, pixels=made.pixels * (0.98 - 0.005 * (next(calls) % 7)))

    change_pictures(monkeypatch, paler)
    assert CASES[name].check(subject).outcome == "failed"


@pytest.mark.parametrize(
    ("name", "subject", "shift_px"),
    [
        ("far-from-origin", TRACER, 3e-4),
        ("far-from-origin", EGL, 6e-3),
        ("units-small", EGL, 6e-3),
        ("depth-range", TRACER, 3e-4),
        ("meshes-far-from-origin", EGL, 6e-3),
        ("telescope", EGL, 6e-3),
        ("surfaces-vast", EGL, 6e-3),
        ("footprints-point", TRACER, 3e-4),
        ("footprints-point", EGL, 6e-3),
        ("coordinates-far-point", EGL, 6e-3),
        ("repeats-many", TRACER, 3e-4),
        ("horizon-point", EGL, 0.2),
    ],
)
def test_a_camera_that_is_slightly_aside_is_noticed(monkeypatch, name, subject, shift_px):
    def aside(scene, technique, *, size, frame=0):
        camera = scene.camera
        position, target = np.asarray(camera.position), np.asarray(camera.target)
        forward = target - position
        if camera.height is None:
            across = 2.0 * math.tan(math.radians(camera.fov_y_deg) / 2.0) * np.linalg.norm(forward)
        else:
            across = camera.height
        right = np.cross(forward, camera.up)
        # half of it up: neither edges along x nor along y hide it
        step = shift_px * across / size[1] * (right / np.linalg.norm(right) + 0.5 * np.asarray(camera.up))
        moved = replace(camera, position=as_vec3(position + step), target=as_vec3(target + step))
        return catalog.render(replace(scene, camera=moved), technique, size=size, frame=frame)

    change_pictures(monkeypatch, aside)
    assert CASES[name].check(subject).outcome == "failed"


@pytest.mark.parametrize("subject", [TRACER, EGL, REFERENCE])
def test_texture_coordinates_that_are_rounded_are_noticed(monkeypatch, subject):
    def rounded(scene, technique, *, size, frame=0):
        objects = tuple(replace(s, uv=s.uv.astype(np.float32).astype(np.float64)) for s in scene.objects)
        return catalog.render(replace(scene, objects=objects), technique, size=size, frame=frame)

    change_pictures(monkeypatch, rounded)
    assert CASES["coordinates-far-filtered"].check(subject).outcome == "failed"


def test_a_farther_plane_that_shows_is_noticed(monkeypatch):
    def first_wins(scene, technique, *, size, frame=0):
        return catalog.render(replace(scene, objects=scene.objects[:1]), technique, size=size, frame=frame)

    change_pictures(monkeypatch, first_wins)
    verdict = CASES["depth-close"].check(TRACER)
    assert (verdict.outcome, verdict.measured) == ("failed", 2.0**-10)


def test_a_refusal_that_says_nothing_is_noticed(monkeypatch):
    def refuse(*_, **__):
        raise InputError("no")

    change_pictures(monkeypatch, refuse)
    verdict = CASES["footprints-extreme"].check(EGL)
    assert (verdict.outcome, verdict.note) == ("failed", "no")


def test_pictures_that_are_not_finite_are_noticed(monkeypatch):
    def spoilt(scene, technique, *, size, frame=0):
        made = catalog.render(scene, technique, size=size, frame=frame)
        pixels = made.pixels.copy()
        pixels[size[1] // 2, 0] = np.nan
        return replace(made, pixels=pixels)

    change_pictures(monkeypatch, spoilt)
    for name in ("horizon-point", "horizon-filtered", "horizon-mean"):
        assert CASES[name].check(EGL).outcome == "failed"


# What is seen, by hand: squares of half a unit, 4 pixels a unit, on a sheet that ends at x = 1.
def sheet_scene(projection):
    corners = [(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0)]
    fov = 2.0 * math.degrees(math.atan(0.2))
    view = {"height": 2.0} if projection == "orthographic" else {"fov_y_deg": fov}
    camera = Camera(projection, (0.0, 0.0, 5.0), **view)
    return Scene("s", camera, (quad(corners, texture="c"),), {"c": Checker((4.0, 4.0), (0.1,) * 3, (0.9,) * 3)})


@pytest.mark.parametrize("projection", ["orthographic", "perspective"])
def test_what_is_seen_of_a_checker_and_how_far_borders_are(projection):
    # 8 pixels high: a square is 2 pixels; (column, row) from the top left, the sheet's left edge at column 4 of 16
    points = np.array([(4.25, 7.5), (6.5, 7.5), (4.5, 5.25), (1.0, 4.0), (11.9, 0.95)])
    seen = what_is_seen(sheet_scene(projection), (16, 8), points)
    np.testing.assert_allclose(seen.color[:, 0], [0.1, 0.9, 0.9, 0.0, 0.1], rtol=0, atol=1e-15)
    # slopes are differences over 1e-4 px of places known to 1e-15: good to 1e-10
    np.testing.assert_allclose(seen.distance, [0.25, 0.5, 0.5, 3.0, 0.1], rtol=0, atol=1e-9)


def test_the_nearer_of_two_polygons_is_seen_whichever_comes_first():
    near, far = (
        quad([(-2, -2, z), (2, -2, z), (2, 2, z), (-2, 2, z)], color=(c, c, c)) for z, c in ((1e-5, 0.75), (0.0, 0.25))
    )
    camera = Camera("perspective", (0.0, 0.0, 5.0), fov_y_deg=20.0)
    for objects in ((near, far), (far, near)):
        seen = centres_of(Scene("s", camera, objects), (8, 8))
        assert (seen.color == 0.75).all()


def test_a_ladder_has_edges_at_all_distances_from_samples():
    truth = what_is_seen(ladder.ladder_scene("orthographic"), ladder.SIZE, pixel_points(ladder.SIZE))
    counts = np.histogram(np.log10(np.maximum(truth.distance, 1e-12)), bins=np.arange(-7.0, 0.0))[0]
    assert (counts > 10).all()


def test_minifications_are_known_to_their_renderers():
    for subject in (TRACER, EGL):
        for mode in footprints.modes_of(subject):
            assert parse_technique(with_keys(subject, f"texture={mode}")).texture == mode
