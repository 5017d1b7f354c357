"""What changes no score, and what changes it in proportion: pictures of any size, contrast, filter and number of seeds.

Each property is asserted of the metrics whose definition claims it; exposure and the order of seeds are no concern of
any, new ones included.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from aliasbench.metrics.catalog import METRICS, measure_all
from aliasbench.metrics.score import Score
from aliasbench.scenes.model import Animation, Camera, EdgeFact, Facts, PanFact, RotorFact, Scene

FloatArray = NDArray[np.float64]
# What metrics with a part in other libraries, which work in float32, may be off by; ours sum in another order at most.
ROUNDING, SINGLE = 1e-9, 1e-5
OURS = {
    "rmse", "psnr", "relmse", "max_error", "jaggies", "jaggies_rms", "jaggies_bias", "jaggies_str", "shimmer",
    "shimmer_abs", "buzz", "flux_flicker", "moire", "moire_peak", "gaps", "strobing", "strobing_err", "apparent_rate",
    "noise", "structure", "bias",
}  # fmt: skip
OF_THE_ERROR = OURS - {"relmse", "flux_flicker", "shimmer_abs", "strobing", "apparent_rate", "gaps"}
LINEAR = OF_THE_ERROR - {"psnr", "buzz"}
# Those that see the picture as a whole, not along a line with a window of whole rows.
PLANAR = ("rmse", "psnr", "relmse", "max_error", "ssim", "shimmer", "buzz", "flux_flicker", "moire", "moire_peak",
          "gaps", "noise", "structure", "bias", "shimmer_abs", "strobing", "strobing_err")  # fmt: skip


@dataclass(frozen=True, eq=False)
class Case:
    """A scene with facts for everything and rough pictures: test (seeds, frames, h, w, 3), reference (frames, ...)."""

    scene: Scene
    test: FloatArray
    reference: FloatArray
    radius_px: float

    def scores(self, names=None, **changed) -> dict[str, Score]:
        case = replace(self, **changed)
        return measure_all(
            METRICS if names is None else names,
            case.test,
            case.reference,
            scene=case.scene,
            filter_radius_px=case.radius_px,
        )


def world(width: int, height: int, x: float, y: float) -> tuple[float, float, float]:
    return (x - width / 2, height / 2 - y, 0.0)


def scene_of(width: int, height: int, frames: int, contrast: float, slope: float) -> Scene:
    """One unit is a pixel; an edge through the middle, a rotor about it, a pan of a whole loop."""
    edge = EdgeFact(*(world(width, height, x, height / 2 + slope * (x - width / 2)) for x in (-9.0, width + 9.0)))
    outer = min(width, height) / 2 - 4
    rotor = RotorFact((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 2, 0.4, 7.0, 3.0, outer)
    pan = PanFact((0.6 * 30.0 / frames, 0.6 * 30.0 / frames, 0.0), frames / 30.0)
    return Scene(
        "any",
        Camera("orthographic", height=float(height)),
        contrast=contrast,
        animation=Animation(30.0, frames, 0.0),
        facts=Facts(edges=(edge,), rotors=(rotor,), pans=(pan,)),
    )


@st.composite
def cases(draw, least_seeds=1) -> Case:
    width, height = draw(st.integers(32, 43)), draw(st.integers(32, 43))
    frames, seeds = draw(st.integers(2, 4)), draw(st.integers(least_seeds, 3))
    contrast = 10.0 ** draw(st.floats(-4.0, 4.0))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    reference = rng.uniform(size=(frames, height, width, 3))
    noise = rng.normal(size=(seeds, *reference.shape)) * 10.0 ** draw(st.floats(-3.0, 0.0))
    scene = scene_of(width, height, frames, contrast, draw(st.floats(-1.0, 1.0)))
    return Case(
        scene, contrast * (reference + noise), contrast * reference, draw(st.sampled_from([0.0, 0.5, 1.0, 2.0]))
    )


def same(a: Score, b: Score, name: str, factor: float = 1.0) -> bool:
    """Whether two scores are one, up to rounding, `b` times `factor`."""
    if a.value is None or b.value is None:
        return a.value is b.value and a.status == b.status
    slack = ROUNDING if name in OURS else SINGLE
    return a.status == b.status and math.isclose(a.value, factor * b.value, rel_tol=slack, abs_tol=1e-10 * factor)


def differing(before: dict[str, Score], after: dict[str, Score], names=None) -> dict[str, tuple[object, object]]:
    shared = before if names is None else [n for n in names if n in before]
    assert shared
    return {
        n: ((before[n].value, before[n].status), (after[n].value, after[n].status))
        for n in shared
        if not same(before[n], after[n], n)
    }


@settings(max_examples=6)
@given(case=cases(), stops=st.floats(-9.0, 9.0))
def test_exposure_changes_nothing(case, stops):
    gain = 2.0**stops
    scene = replace(case.scene, contrast=gain * case.scene.contrast)
    brighter = case.scores(test=gain * case.test, reference=gain * case.reference, scene=scene)
    assert not differing(case.scores(), brighter)


@settings(max_examples=6)
@given(case=cases(), level=st.floats(-3.0, 3.0))
def test_a_constant_in_both_changes_nothing_in_the_error(case, level):
    constant = level * case.scene.contrast
    lifted = case.scores(test=case.test + constant, reference=case.reference + constant)
    assert not differing(case.scores(), lifted, OF_THE_ERROR)


@settings(max_examples=4)
@given(case=cases(least_seeds=2), data=st.data())
def test_the_order_of_seeds_changes_nothing(case, data):
    order = data.draw(st.permutations(range(len(case.test))))
    # Blocks of a local figure may be looked for in one seed alone, in extras; values are of all.
    assert not differing(case.scores(), case.scores(test=case.test[list(order)]))


@settings(max_examples=6)
@given(case=cases(), shift=st.integers(1, 4))
def test_where_a_loop_begins_changes_nothing(case, shift):
    rolled = {"test": np.roll(case.test, shift, axis=1), "reference": np.roll(case.reference, shift, axis=0)}
    names = OURS - {
        "apparent_rate"
    }  # which is of the frames' differences, that of the last to the first not among them
    assert not differing(case.scores(names), case.scores(names, **rolled))


def mirrored(case: Case, axis: int) -> Case:
    """The case upside down (axis -3) or left to right (axis -2): the pan turns with it, the rotor the other way."""
    (pan,), (rotor,) = case.scene.facts.pans, case.scene.facts.rotors
    x, y, z = pan.velocity
    velocity = (-x, y, z) if axis == -2 else (x, -y, z)
    facts = replace(
        case.scene.facts,
        pans=(replace(pan, velocity=velocity),),
        rotors=(replace(rotor, rev_per_s=-rotor.rev_per_s),),
        edges=(),
    )
    return replace(
        case,
        scene=replace(case.scene, facts=facts),
        test=np.flip(case.test, axis),
        reference=np.flip(case.reference, axis),
    )


def transposed(case: Case) -> Case:
    """Rows for columns: the picture's height in world units is another, one unit still a pixel."""
    width = case.reference.shape[2]
    (rotor,) = case.scene.facts.rotors
    facts = replace(case.scene.facts, rotors=(replace(rotor, rev_per_s=-rotor.rev_per_s),), edges=())
    scene = replace(case.scene, facts=facts, camera=replace(case.scene.camera, height=float(width)))
    return replace(case, scene=scene, test=np.swapaxes(case.test, 2, 3), reference=np.swapaxes(case.reference, 1, 2))


@settings(max_examples=8)
@given(case=cases(least_seeds=2), how=st.sampled_from(["upside down", "left to right", "transposed"]))
def test_mirror_images_score_the_same(case, how):
    other = transposed(case) if how == "transposed" else mirrored(case, -3 if how == "upside down" else -2)
    before, after = case.scores((*PLANAR, "apparent_rate")), other.scores((*PLANAR, "apparent_rate"))
    assert not differing(before, after, PLANAR)
    rate, back = before["apparent_rate"].value, after["apparent_rate"].value
    assert rate is not None
    # What turns seems to turn the other way.
    assert back == pytest.approx(-rate, rel=1e-7, abs=1e-9)


@settings(max_examples=8)
@given(case=cases(least_seeds=2), factor=st.floats(0.01, 100.0))
def test_scores_are_linear_in_the_error_where_they_are_its_size(case, factor):
    reference = case.reference
    error = case.test - reference
    before, after = case.scores(OURS), case.scores(OURS, test=reference + factor * error)
    # The scaled error is what is left of a sum: it is known to rounding of the reference.
    rounding = 1e-15 * (1.0 + factor) * 50 / max(before["rmse"].value or 0.0, 1e-9)
    for name in LINEAR:
        a, b = before[name].value, after[name].value
        if a is None or b is None:
            assert a is b, name
            continue
        # Signed roots of small squares magnify what they are taken of.
        slack = 1e-8 + rounding
        scale = before["jaggies_rms" if name.startswith("jaggies") else "max_error"].value or 0.0
        loose = math.sqrt(slack) if name in ("structure", "jaggies_str") else slack
        assert abs(b - factor * a) <= factor * (loose * scale + slack * abs(a)), name
    square = factor * factor
    assert after["relmse"].value == pytest.approx(square * before["relmse"].value, rel=1e-8 + 2 * rounding)
    assert after["psnr"].value == pytest.approx(
        before["psnr"].value - 20 * math.log10(factor), abs=1e-7 + 10 * rounding
    )
    assert after["buzz"].value == pytest.approx(before["buzz"].value, rel=1e-7 + 2 * rounding)


@settings(max_examples=12)
@given(
    # the exact picture divides differences by the slope
    slope=st.one_of(st.just(0.0), st.floats(1e-3, 1.0), st.floats(-1.0, -1e-3)),
    place=st.floats(-2.0, 2.0),
    across=st.integers(-6, 6),
    down=st.integers(-6, 6),
    samples=st.sampled_from([1, 2, 3]),
)
def test_stairs_that_move_with_their_line_are_the_same(box_edge, point_edge, rgb, slope, place, across, down, samples):
    """Picture and declared stretch of the line moved by whole pixels: all figures of the edge stay."""
    width, height = 64, 92
    scene = scene_of(width, height, 2, 1.0, slope)
    names = ("jaggies", "jaggies_rms", "jaggies_bias", "jaggies_str")
    # A sample on the line is on the one side or the other by rounding.
    u, v = (np.arange(n * samples) + 0.5 for n in (width, height))
    off = v[:, None] / samples - height / 2 - place - slope * (u / samples - width / 2 - 0.5)
    assume(np.abs(off).min() > 1e-9)

    def scores(x: int, y: int) -> dict[str, Score]:
        # Ends at halves of pixels, so that rounding moves no column in or out.
        middle = (width / 2 + 0.5 + x, height / 2 + place + y)
        ends = [world(width, height, middle[0] + u, middle[1] + slope * u) for u in (-20.0, 20.0)]
        intercept = middle[1] - slope * middle[0]
        test = rgb(point_edge((width, height), slope, intercept, samples))[None]
        truth = rgb(box_edge((width, height), slope, intercept))[None]
        return measure_all(names, test, truth, scene=replace(scene, facts=Facts(edges=(EdgeFact(*ends),))))

    first, moved = scores(0, 0), scores(across, down)
    for name in names:
        assert first[name].status == "ok"
        # Places are rounded at 1e-14, which a slope of 1e-3 makes 1e-11 of coverage, in 42 columns at most; of J_str
        # the root of a square of 0 is within the root of that.
        slack = 1e-9 if name != "jaggies_str" else 1e-6
        assert moved[name].value == pytest.approx(first[name].value, abs=slack), name
