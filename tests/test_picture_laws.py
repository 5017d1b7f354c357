"""The laws of random pictures notice pictures that break them, and random pictures are worth looking at."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from picture_bounds import color_range, crossed_cells, doubtful_area, filter_variation, find_borders, stratified_bound
from picture_laws import (
    darkening,
    draw,
    independent_ratio,
    mirror_ratio,
    mirrored,
    out_of_range,
    passes_ratio,
    stratified_ratio,
)
from random_pictures import AT_REST, FPS, WHITE, Case, Flat, Stage, cases

from aliasbench.renderers.catalog import render
from aliasbench.renderers.sampling.filters import make_filter
from aliasbench.scenes.model import Motion, Scene, as_vec3

TRIANGLE = np.array([(-0.6, -0.4), (0.7, -0.3), (0.1, 0.6)])
SIZE = (8, 6)


@pytest.fixture(autouse=True)
def own_cache(tmp_path: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ALIASBENCH_CACHE", str(tmp_path))


def make_case(motion: Motion = AT_REST, *, projection: str = "orthographic", shutter: float = 0.0) -> Case:
    """An orange triangle before a dark ground, far from the origin and turned."""
    stage = Stage(projection, 30.0, (300.0, -20.0, 7.0), 0.01, True, (0.1, 0.2, 0.1), shutter)
    flat = Flat(TRIANGLE, (0.05, -0.1, 0.0), 0.0, (2.0, 0.7, 0.3), motion)
    return Case(stage, (flat,), stage.scene([stage.surface(flat)]), SIZE, 0, 5)


def aside(case: Case, px: float) -> Scene:
    """The scene of a case with its camera moved to the right, by so many pixels of an orthographic picture."""
    step = px * 2.0 * case.stage.unit / SIZE[1] * case.stage.axes[:, 0]
    camera = case.scene.camera
    moved = replace(camera, position=as_vec3(camera.position + step), target=as_vec3(camera.target + step))
    return replace(case.scene, camera=moved)


@pytest.mark.parametrize(
    ("technique", "k", "px"),
    [
        ("raytrace:spp=4096,sampler=jittered", 64, 0.05),
        ("raytrace:spp=4096,sampler=grid,engine=portable", 64, 0.1),
        ("raytrace:spp=4096,sampler=sobol,filter=tent", 64, 0.3),
        ("raster:ssaa=16", 16, 0.3),
        ("raster:passes=16,ssaa=4,sampler=grid", 16, 0.3),
        ("raster:passes=4,ssaa=16,sampler=sobol,filter=gaussian", 32, 0.6),
    ],
)
def test_a_still_picture_that_is_a_little_off_is_noticed(technique: str, k: int, px: float) -> None:
    case = make_case()
    _, _, chosen = technique.partition(",filter")
    truth = render(case.scene, "reference:" + ("filter" + chosen if chosen else ""), size=SIZE)
    independent = "jittered" in technique
    assert stratified_ratio(case, technique, k, truth, independent=independent) < 0.5
    assert stratified_ratio(case, technique, k, truth, independent=independent, shown=aside(case, px)) > 1.0


@pytest.mark.parametrize("chosen", ["", "filter=mitchell,radius=1.5"])
@pytest.mark.parametrize("projection", ["orthographic", "perspective"])
def test_a_moving_picture_that_is_a_little_off_is_noticed(projection: str, chosen: str) -> None:
    case = make_case(Motion(velocity=(0.3 * FPS, 0.0, 0.0)), projection=projection, shutter=0.5)
    truth = render(case.scene, f"reference:{chosen}", size=SIZE)
    technique = "raytrace:spp=16384,sampler=random" + (f",{chosen},weighting=distribution" if chosen else "")
    assert independent_ratio(case, technique, truth) < 0.6
    assert independent_ratio(case, technique, truth, shown=aside(case, 0.4 if chosen else 0.25)) > 1.0
    if not chosen:
        assert passes_ratio(case, "jittered", 2, 16) < 0.6
        assert passes_ratio(case, "jittered", 2, 16, shown=aside(case, 0.4)) > 1.0


@pytest.mark.parametrize("technique", ["raytrace:spp=4", "raster:passes=4", "reference:filter=tent"])
def test_a_polygon_that_shrinks_is_noticed(technique: str) -> None:
    case = make_case()
    small, large = (case.stage.on_black([case.stage.surface(case.flats[0], grown=g, color=WHITE)]) for g in (1.0, 1.2))
    assert darkening(case, small, large, technique) <= 1.0
    assert darkening(case, large, small, technique) > 1.0


@pytest.mark.parametrize(
    "technique", ["raytrace:spp=4", "raster:passes=4,sampler=grid,filter=mitchell", "reference:filter=lanczos"]
)
def test_values_out_of_range_are_noticed(technique: str) -> None:
    case = make_case()
    pixels = draw(case.scene, technique, case)
    known = render(case.scene, technique, size=SIZE).uncertainty or 0.0
    assert out_of_range(case.scene, technique, case, pixels, known) <= 1.0
    low, high = color_range(case.scene)
    # these filters' lobes overshoot by less than twice the range
    for changed in (pixels + 2.0 * (high - low), pixels - 2.0 * (high - low)):
        assert out_of_range(case.scene, technique, case, changed, known) > 1.0
    if "filter" not in technique:
        assert out_of_range(case.scene, technique, case, pixels * (1.0 + 1e-5), known) > 1.0


def test_a_picture_that_is_not_mirrored_is_noticed() -> None:
    case = make_case()
    assert mirror_ratio(case, "reference:filter=tent", case.scene, mirrored(case.scene)) <= 1.0
    assert mirror_ratio(case, "reference:filter=tent", case.scene, case.scene) > 1.0
    assert mirror_ratio(case, "reference:", case.scene, mirrored(aside(case, 1e-6))) > 1.0


@pytest.mark.parametrize("projection", ["orthographic", "perspective"])
def test_borders_are_the_outlines_in_the_picture(projection: str) -> None:
    """Of cells of a fine grid those that change colour inside, by the reference, are crossed; and few others are."""
    case = make_case(projection=projection)
    fine = tuple(64 * side for side in SIZE)
    truth = render(case.scene, "reference:", size=fine).pixels
    low, high = color_range(case.scene)
    mixed = ((truth > low + 1e-9) & (truth < high - 1e-9)).any(axis=2)
    counts = mixed.reshape(SIZE[1], 64, SIZE[0], 64).sum(axis=(1, 3))
    borders = find_borders(case.scene, SIZE, snapped=False)
    crossed = crossed_cells(borders, SIZE, 64)
    assert counts.sum() > 300
    assert (counts <= crossed).all()
    # three more for each edge in a pixel, and what a slanted one misses of k (dx + dy) where it crosses a cell's corner
    assert crossed.sum() <= 1.05 * counts.sum() + 4.0 * borders.in_pixels(SIZE)[0].sum() + 1.0
    assert 0.0 < doubtful_area(borders, SIZE).max() < 1e-3


def test_crossing_planes_have_a_border() -> None:
    stage = Stage("perspective", 40.0, (0.0, 0.0, 0.0), 1.0, True, (0.0, 0.0, 0.0), 0.0)
    square = np.array([(-3.0, -3.0), (3.0, -3.0), (3.0, 3.0), (-3.0, 3.0)])
    flats = [Flat(square, (0.0, 0.1, 0.0), tilt, color) for tilt, color in ((0.4, (1.0, 0.0, 0.0)), (-0.3, WHITE))]
    scene = stage.scene([stage.surface(f) for f in flats])
    truth = render(scene, "reference:", size=SIZE).pixels[..., 1]
    mixed = (truth > 1e-9) & (truth < 1.0 - 1e-9)
    shown, _, _ = find_borders(scene, SIZE, snapped=False).in_pixels(SIZE)
    assert mixed.any()
    assert shown.any(axis=0)[mixed].all()
    # lines that go on beyond the polygons, and edges that are hidden, are borders too
    assert shown.any(axis=0).sum() <= 0.5 * SIZE[0] * SIZE[1]


def test_variation_of_a_box_is_its_rim_and_of_a_tent_falls_with_the_cells() -> None:
    # the rim of a square of side 2 r, by 1 / (4 r^2): 8 r k cells of area 1 / k^2 within, as many without, 4 in corners
    assert filter_variation(make_filter("box", 0.75), 16) <= (2 * 8 * 0.75 * 16 + 4) / 16**2 / (4 * 0.75**2)
    # of f = g g with g = 1 - abs x: sum of a (abs f_x + abs f_y) = h (2 + 2), less what corners share
    for k in (8, 32):
        assert 3.5 / k < filter_variation(make_filter("tent", 1.0), k) <= 4.0 / k + 1e-9


def test_most_random_pictures_show_edges_and_their_bound_is_no_excuse() -> None:
    shows, bounds = [], []

    @settings(max_examples=100)
    @given(cases(), st.just(16))
    def look(case: Case, k: int) -> None:
        borders = find_borders(case.scene, case.size, snapped=True)
        crossed = crossed_cells(borders, case.size, k)
        low, high = color_range(case.scene)
        shows.append(bool((crossed > 0).any() and (high > low).all()))
        if shows[-1]:
            box = make_filter("box", 0.5)
            bound = stratified_bound(case.scene, borders, case.size, k, box, independent=False) / (high - low)
            bounds.append(float(np.median(bound[crossed > 0])))

    look()
    assert len(shows) >= 100
    assert np.mean(shows) > 0.6
    # two edges that cross 16 + 3 cells each: 0.15
    assert np.median(bounds) < 0.25
