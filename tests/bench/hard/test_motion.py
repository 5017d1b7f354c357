"""Every hard case of motion in every renderer, with the outcomes that are known; and that each check can fail."""

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import shapely

from aliasbench.bench.hard import motion, passing, periodic, stillness
from aliasbench.bench.hard.case import METRICS, RASTERS, REFERENCE, RENDERERS, TRACER, HardCase
from aliasbench.metrics.catalog import measure
from aliasbench.renderers.frame import Frame
from aliasbench.scenes.model import FloatArray, Motion, Spin
from aliasbench.scenes.motion import object_matrix

CASES = {case.name: case for case in motion.CASES}
# All else is exact. Edges of a comb are so close to samples that any misplacement shows.
LIMITS = {
    (name, subject)
    for subjects, names in (
        (RASTERS, ("nyquist-grating", "nyquist-bars", "late-spin", "half-turn-matrix", "fly-through")),
        (RENDERERS, ("late-flight", "half-turn", "hundred-turns")),
    )
    for name in names
    for subject in subjects
}


@pytest.mark.parametrize(
    ("name", "subject"), [(case.name, subject) for case in motion.CASES for subject in case.subjects]
)
def test_the_outcome_is_the_known_one(name: str, subject: str) -> None:
    verdict = CASES[name].check(subject)
    assert verdict.outcome == ("limit" if (name, subject) in LIMITS else "ok"), (verdict, verdict.note)
    assert verdict.why


def _shifted(pixels: FloatArray, calls: int) -> FloatArray:  # noqa: ARG001
    return np.roll(pixels, (1, 1), axis=(0, 1))


def _dimmed(pixels: FloatArray, calls: int) -> FloatArray:  # noqa: ARG001
    return pixels * 0.95


def _restless(pixels: FloatArray, calls: int) -> FloatArray:
    return np.roll(pixels, calls, axis=1)


def _glowing(pixels: FloatArray, calls: int) -> FloatArray:  # noqa: ARG001
    out = pixels.copy()
    out[3, 5] += 0.01
    return out


def _broken(pixels: FloatArray, calls: int) -> FloatArray:  # noqa: ARG001
    out = pixels.copy()
    out[3, 5] = np.nan
    return out


Change = Callable[[FloatArray, int], FloatArray]
WRONG: dict[str, tuple[Change, ...]] = {
    "nyquist-grating": (_shifted, _glowing, _broken),
    "nyquist-checker": (_shifted, _glowing),
    "nyquist-bars": (_shifted, _glowing),
    "ambiguous-rate": (_restless,),
    "ambiguous-strobing": (_dimmed,),
    "half-turn": (_shifted, _glowing, _broken),
    "half-turn-matrix": (_shifted, _glowing, _broken),
    "half-turn-collapse": (_glowing, _broken),
    "hundred-turns": (_dimmed, _glowing, _broken),
    "hundred-turns-mean": (_dimmed, _broken),
    "no-motion": (_restless, _broken),
    "hardly-any-motion": (_restless, _broken),
    "late-spin": (_restless, _broken),
    "late-flight": (_restless, _broken),
    "fly-through": (_shifted, _glowing, _broken),
    "adaptive-motion": (_dimmed, _broken),
}


class _Wrong:
    """A prepared scene of which every picture is changed."""

    def __init__(self, prepared: Any, change: Change, calls: list[int]) -> None:
        self.prepared, self.change, self.calls = prepared, change, calls

    def render(self, frame: int = 0, seed: int = 0) -> Frame:
        """Return the changed picture."""
        self.calls[0] += 1
        made = self.prepared.render(frame=frame, seed=seed)
        return replace(made, pixels=self.change(made.pixels, self.calls[0]))

    def __enter__(self) -> "_Wrong":
        self.prepared.__enter__()
        return self

    def __exit__(self, *what: Any) -> None:
        self.prepared.__exit__(*what)


def _falsify(monkeypatch: pytest.MonkeyPatch, change: Change) -> None:
    from aliasbench.renderers import catalog

    calls = [0]

    def prepare(scene: Any, technique: str, *, size: tuple[int, int]) -> Any:
        return _Wrong(catalog.prepare(scene, technique, size=size), change, calls)

    def render(scene: Any, technique: str, *, size: tuple[int, int], frame: int = 0, seed: int = 0) -> Frame:
        with prepare(scene, technique, size=size) as ready:
            made: Frame = ready.render(frame, seed)
            return made

    for module in (motion, periodic, stillness):
        monkeypatch.setattr(module, "prepare", prepare, raising=False)
        monkeypatch.setattr(module, "render", render)


def _fails(case: HardCase, subject: str) -> bool:
    try:
        return case.check(subject).outcome == "failed"
    except ValueError:  # the metrics refuse a reference that is not finite
        return True


@pytest.mark.parametrize(
    ("name", "subject", "change"),
    [
        (name, subject, change)
        for name, changes in WRONG.items()
        for subject in (TRACER, REFERENCE)
        if subject in CASES[name].subjects
        for change in changes
    ],
)
def test_a_wrong_picture_fails(name: str, subject: str, change: Change, monkeypatch: pytest.MonkeyPatch) -> None:
    _falsify(monkeypatch, change)
    assert _fails(CASES[name], subject)


def test_every_check_is_among_those_that_can_fail() -> None:
    assert {*WRONG, "nyquist-metrics"} == set(CASES)


def test_wrong_metrics_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(name: str, *arguments: Any, **options: Any) -> Any:
        score = measure(name, *arguments, **options)
        assert score.value is not None
        return replace(score, value=score.value + 1e-9)

    monkeypatch.setattr(periodic, "measure", wrong)
    assert CASES["nyquist-metrics"].check(METRICS).outcome == "failed"


def test_edges_of_the_comb_are_at_all_distances_from_samples() -> None:
    outline = passing.to_picture(passing.COMB, passing.SIZE)
    distance = passing.distance_to_outline(passing.pixel_points(passing.SIZE), outline)
    counts = np.histogram(np.log10(distance), bins=np.arange(-8.0, 0.0))[0]
    assert (counts >= 10).all()
    polygon = shapely.Polygon(passing.COMB)
    assert polygon.is_valid


@pytest.mark.parametrize("name", ["late-spin", "late-flight", "half-turn", "hundred-turns"])
def test_a_body_that_is_a_ten_thousandth_of_a_pixel_aside_fails(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    comb = passing.COMB.copy()

    def aside(outline: FloatArray, *more: Any, **options: Any) -> Any:
        scale = np.ptp(outline[:, 0]) / np.ptp(comb[:, 0])
        return passing.one_polygon(outline + 1e-4 * scale, *more, **options)

    for module in (motion, stillness):
        monkeypatch.setattr(module, "one_polygon", aside)
    assert CASES[name].check(TRACER).outcome == "failed"


@pytest.mark.parametrize("shift", [0.3, 0.01])
def test_a_displaced_outline_misplaces_samples_by_its_shift_at_most(shift: float) -> None:
    size, count = (32, 24), 300
    outlines = [passing.turned(passing.BLADE, u) for u in passing.middles(count)]
    points = passing.pixel_points(size)
    seen = np.mean(
        [passing.inside(points, passing.to_picture(o + np.array([shift, 0.0]), size)) for o in outlines], axis=0
    )
    miss = passing.find_misses(np.repeat(seen, 3).reshape(24, 32, 3), size, outlines)
    assert miss.pixels > 0
    assert 0.0 < miss.px <= shift
    right = np.mean([passing.inside(points, passing.to_picture(o, size)) for o in outlines], axis=0)
    assert passing.find_misses(np.repeat(right, 3).reshape(24, 32, 3), size, outlines) == passing.Miss(0.0, 0)


@pytest.mark.parametrize("turns", [Fraction(1, 3), Fraction(-7, 4), Fraction(10**9) + Fraction(1, 8), Fraction(5, 2)])
def test_outlines_turn_as_objects_do(turns: Fraction) -> None:
    part = float(turns - round(turns))
    matrix = object_matrix(Motion(spin=Spin(passing.Z, passing.HUB, 30.0)), passing.OPEN, 0, part)
    expected = passing.BLADE @ matrix[:2, :2].T
    # cosine and sine are off by an ulp each, of coordinates up to 12
    np.testing.assert_allclose(passing.turned(passing.BLADE, turns), expected, rtol=0.0, atol=24 * 2.0**-52)
