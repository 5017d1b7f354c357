"""Laws that pictures of any polygons obey, under any technique, size, place and scale; on scenes drawn by hypothesis.

A hundred examples are drawn here, the same every time. EXAMPLES=10000 with -s draws so many in all, and prints for each
law how many ran and the largest ratio of what was found to what is allowed: see `picture_laws` and `picture_bounds`.
"""

import functools
import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, note, settings
from hypothesis import strategies as st
from picture_bounds import SNAPPED_PX, find_borders
from picture_laws import (
    darkening,
    independent_ratio,
    mirror_ratio,
    mirrored,
    out_of_range,
    overshoot,
    passes_ratio,
    stratified_ratio,
)
from random_pictures import (
    DISTANCE,
    EXAMPLES,
    NOT_NEGATIVE,
    WHITE,
    Case,
    cases,
    engines,
    filters,
    level_cases,
    techniques,
)

from aliasbench.renderers.catalog import prepare, render

MOST_TRACED = 300_000  # samples of a picture that is held to the reference
STRATA = ("grid", "jittered", "multijittered", "sobol")
RATIOS: dict[str, list[float]] = {}  # of every comparison, by law
RAN: dict[str, int] = {}
CASES_OF_ANY_MOTION = st.booleans().flatmap(lambda level: cases(moving=None, level=level))
# references of what moves in space, and not in a plane that faces the camera, may take half a minute
CASES_OF_QUICK_REFERENCES = st.booleans().flatmap(lambda moving: cases(moving=moving, level=moving))


def examples(few: int, share: float) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Ask for `few` examples here, and for a share of what EXAMPLES says."""
    unhurried = [HealthCheck.too_slow, HealthCheck.filter_too_much, HealthCheck.data_too_large]
    return settings(max_examples=round(EXAMPLES * share) or few, suppress_health_check=unhurried)


def counted(law: Callable[..., None]) -> Callable[..., None]:
    """Count the examples that a law held of."""

    @functools.wraps(law)
    def one(**drawn: object) -> None:
        law(**drawn)
        RAN[law.__name__] = RAN.get(law.__name__, 0) + 1

    return one


@pytest.fixture(scope="module", autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep references in a folder of their own; print at the end what was found."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ALIASBENCH_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield
    print()
    for law, ratios in RATIOS.items():
        print(f"{law}: {len(ratios)} comparisons, at most {max(ratios):.3g} of what is allowed")
    for name, count in RAN.items():
        print(f"{name}: {count} examples")
    print(f"in all {sum(RAN.values())} examples")


def hold(law: str, ratio: float) -> None:
    """Assert that no more is found than allowed, and remember the ratio."""
    RATIOS.setdefault(law, []).append(ratio)
    assert ratio <= 1.0, f"{law}: {ratio:.6g} times what is allowed"


@examples(24, 0.3)
@given(st.data(), CASES_OF_ANY_MOTION)
@counted
def test_values_are_finite_and_within_the_range_of_the_scene(data: st.DataObject, case: Case) -> None:
    chosen = data.draw(filters())
    lobed = "mitchell" in chosen or "lanczos" in chosen
    technique = data.draw(techniques(chosen, shared=lobed, fixed=not lobed))
    if data.draw(st.integers(0, 3)) == 0 and (case.scene.is_static or case.is_level):
        technique = f"reference:{chosen[1:]}"
    if lobed and "distribution" not in technique:
        assume(overshoot(technique, case) < 1e3)  # few samples' weights all but cancel: rounding has the say
    note(technique)
    frame = render(case.scene, technique, size=case.size, frame=case.frame, seed=case.seed)
    assert frame.pixels.shape == (case.size[1], case.size[0], 3)
    assert frame.pixels.dtype == (np.float64 if technique.startswith("reference") else np.float32)
    assert np.isfinite(frame.pixels).all()
    hold("range", out_of_range(case.scene, technique, case, frame.pixels, frame.uncertainty or 0.0))


@examples(12, 0.15)
@given(st.data(), level_cases(), st.floats(1.0, 1.3))
@counted
def test_a_white_polygon_that_grows_darkens_no_pixel(data: st.DataObject, case: Case, factor: float) -> None:
    """It grows about a point inside, by so much that sides stay inside though old and new ones be misplaced."""
    chosen = data.draw(filters(NOT_NEGATIVE))
    technique = data.draw(techniques(chosen)).replace(",robust=off", "")  # which has gaps between triangles
    stage, (flat, *_) = case.stage, case.flats
    a, b = flat.outline, np.roll(flat.outline, -1, axis=0)
    inner = float((np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / np.linalg.norm(b - a, axis=1)).min())
    scale = case.size[1] / 2.0
    if stage.projection == "perspective":
        scale /= math.tan(math.radians(stage.fov_deg) / 2.0) * (DISTANCE - flat.center[2])
    grown = factor
    for _ in range(3):  # how far sides may be off grows with the polygon
        large = stage.on_black([stage.surface(flat, grown=grown, color=WHITE)])
        off = find_borders(large, case.size, snapped=False).off.max(initial=0.0) + SNAPPED_PX
        grown = max(factor, 1.0 + 4.0 * off / (inner * scale))
    assume(grown < 20.0)
    note(f"{technique}, {grown}")
    small, large = (stage.on_black([stage.surface(flat, grown=g, color=WHITE)]) for g in (1.0, grown))
    for asked in (technique, f"reference:{chosen[1:]}"):
        hold(f"grown, {asked.partition(':')[0]}", darkening(case, small, large, asked))


@examples(12, 0.15)
@given(st.data(), level_cases())
@counted
def test_a_further_white_polygon_darkens_no_pixel(data: st.DataObject, case: Case) -> None:
    chosen = data.draw(filters(NOT_NEGATIVE))
    technique = data.draw(techniques(chosen)).replace(",robust=off", "")
    note(technique)
    white = [case.stage.surface(flat, color=WHITE) for flat in case.flats]
    before, after = case.stage.on_black(white[:1]), case.stage.on_black(white)
    for asked in (technique, f"reference:{chosen[1:]}"):
        hold(f"added, {asked.partition(':')[0]}", darkening(case, before, after, asked))


def side_for(case: Case) -> int:
    """Return the largest power of two k so that k x k samples of all pixels are at most `MOST_TRACED`."""
    return 2 ** int(math.log2(MOST_TRACED / (case.size[0] * case.size[1])) / 2)


@examples(16, 0.2)
@given(st.data(), cases())
@counted
def test_still_pictures_are_within_their_bound_of_the_reference(data: st.DataObject, case: Case) -> None:
    """One sample in each of k x k cells of every pixel: only cells that an edge crosses can be wrong."""
    chosen = data.draw(filters(NOT_NEGATIVE))
    truth = render(case.scene, f"reference:{chosen[1:]}", size=case.size)
    k, sampler = min(64, side_for(case)), data.draw(st.sampled_from(STRATA))
    engine = data.draw(engines(sampler))
    pattern = data.draw(st.sampled_from(("", ",pattern=shared")))
    technique = f"raytrace:spp={k * k},sampler={sampler}{engine}{pattern}{chosen}"
    note(technique)
    independent = sampler == "jittered"
    hold("still, raytrace", stratified_ratio(case, technique, k, truth, independent=independent))
    passes, ssaa = data.draw(st.sampled_from(((1, 16), (1, 16), (4, 8), (16, 2), (4, 16))))
    sampler = data.draw(st.sampled_from(STRATA)) if passes > 1 else "center"
    backend = data.draw(st.sampled_from(("egl", "egl", "egl", "osmesa")))
    technique = f"raster:passes={passes},ssaa={ssaa},sampler={sampler},backend={backend}{chosen}"
    note(technique)
    # passes move the picture within a drawn pixel, one in each cell of a finer grid
    hold("still, raster", stratified_ratio(case, technique, ssaa * math.isqrt(passes), truth))


@examples(8, 0.1)
@given(st.data(), cases(moving=None, level=True, most=8))
@counted
def test_independent_samples_are_within_their_bound_of_the_reference(data: st.DataObject, case: Case) -> None:
    """Places drawn from the filter and times from the shutter, independently: the mean is the exact picture's."""
    chosen = data.draw(filters())
    truth = render(case.scene, f"reference:{chosen[1:]}", size=case.size, frame=case.frame)
    engine = data.draw(engines("random"))
    weighting = ",weighting=distribution" if chosen else ""
    technique = f"raytrace:spp={side_for(case) ** 2},sampler=random{engine}{chosen}{weighting}"
    note(technique)
    hold("independent, raytrace", independent_ratio(case, technique, truth))


@examples(6, 0.05)
@given(st.data(), cases(moving=True, most=12))
@counted
def test_passes_are_pictures_of_instants(data: st.DataObject, case: Case) -> None:
    """The mean of passes of known times is within its bound of the mean of the references of these instants."""
    passes, sampler = data.draw(st.integers(1, 3)), data.draw(st.sampled_from(("random", "jittered", "sobol")))
    # so that any time is the middle of a shutter
    animation = replace(case.scene.animation, shutter=min(case.scene.animation.shutter, 0.5))
    note(f"{passes} passes, {sampler}")
    case = replace(case, scene=replace(case.scene, animation=animation))
    hold("instants, raster", passes_ratio(case, sampler, passes, 16))


@examples(10, 0.05)
@given(st.data(), CASES_OF_ANY_MOTION)
@counted
def test_the_same_arguments_give_the_same_bits(data: st.DataObject, case: Case) -> None:
    technique = data.draw(techniques(data.draw(filters(NOT_NEGATIVE))))
    note(technique)
    with prepare(case.scene, technique, size=case.size) as prepared:
        first = prepared.render(case.frame, case.seed).pixels
        prepared.render(case.frame + 1, case.seed + 1)
        again = prepared.render(case.frame, case.seed).pixels
    anew = render(case.scene, technique, size=case.size, frame=case.frame, seed=case.seed).pixels
    assert first.tobytes() == again.tobytes() == anew.tobytes()


@examples(8, 0.05)
@given(st.data(), CASES_OF_QUICK_REFERENCES)
@counted
def test_a_mirrored_scene_mirrors_the_reference(data: st.DataObject, case: Case) -> None:
    technique = f"reference:{data.draw(filters())[1:]}"
    note(technique)
    hold("mirrored, reference", mirror_ratio(case, technique, case.scene, mirrored(case.scene)))
