"""The cases about values: each holds for each of its subjects, and each check can fail."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from aliasbench.bench.hard import adaptivity, case, sums, supports, values, weights
from aliasbench.bench.hard.case import EGL, OSMESA, RASTERS, REFERENCE, RENDERERS, TRACER, TRACERS
from aliasbench.bench.hard.catalog import HARD_CASES
from aliasbench.renderers import catalog
from aliasbench.renderers.frame import Frame
from aliasbench.scenes.model import FloatArray

CASES = {entry.name: entry for entry in values.CASES}
# What is not exact, and by whom.
LIMITS = {
    "values-of-both-signs": RENDERERS,
    "denormal-colours": RASTERS,
    "dot-missed-by-pooled-pilots": TRACERS,
    "filters-narrower-than-pixels": RASTERS,
    "no-overshoot-without-lobes": RASTERS,
}
Bend = Callable[[NDArray[Any]], NDArray[Any]]


@pytest.fixture(autouse=True)
def reduced(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take fewer samples than the suite does, where many of them are the question: means are known less well."""
    monkeypatch.setattr(values, "_SAMPLES", 64)
    monkeypatch.setattr(supports, "_SAMPLES", 16)
    for name, value in (("_PASSES", 256), ("_MILLION", 2**16), ("_SIDE", 256), ("_SIDE_RASTER", 24)):
        monkeypatch.setattr(sums, name, value)
    monkeypatch.setattr(case, "LARGEST_STANDARD_ERROR", 4e-3)


def has_osmesa() -> bool:
    from aliasbench.renderers.raster.context import describe_contexts

    return next(report for report in describe_contexts() if report.backend == "osmesa").ok


def test_the_cases_are_in_the_catalog() -> None:
    assert len(CASES) == len(values.CASES) >= 20
    assert all(HARD_CASES[name] is entry for name, entry in CASES.items())
    assert {entry.group for entry in CASES.values()} == {"values"}
    assert set(LIMITS) < set(CASES)


@pytest.mark.parametrize(("name", "subject"), [(c.name, s) for c in CASES.values() for s in c.subjects])
def test_every_case_holds(name: str, subject: str) -> None:
    if subject == OSMESA and not has_osmesa():
        pytest.skip("libosmesa6 is not installed")
    verdict = CASES[name].check(subject)
    expected = ("ok", "limit") if subject in LIMITS.get(name, ()) else ("ok",)
    assert verdict.outcome in expected, verdict
    assert verdict.why


# What a check is shown that has something wrong.


@dataclass(frozen=True, eq=False)
class Bent:
    """A prepared scene whose pictures are changed."""

    inner: Any
    bend: Callable[[Frame], Frame]

    def render(self, frame: int = 0, seed: int = 0) -> Frame:
        return self.bend(self.inner.render(frame=frame, seed=seed))

    def __enter__(self) -> "Bent":
        return self

    def __exit__(self, *error: object) -> None:
        self.inner.__exit__(*error)


def bend_all(monkeypatch: pytest.MonkeyPatch, bend: Callable[[Frame], Frame]) -> None:
    """Change every picture that a check sees."""

    def render(*arguments: Any, **options: Any) -> Frame:
        return bend(catalog.render(*arguments, **options))

    def prepare(*arguments: Any, **options: Any) -> Bent:
        return Bent(catalog.prepare(*arguments, **options), bend)

    for module in (values, sums, adaptivity, supports, weights):
        monkeypatch.setattr(module, "render", render)
    for module in (adaptivity, supports):
        monkeypatch.setattr(module, "prepare", prepare)


def outcomes(name: str, monkeypatch: pytest.MonkeyPatch, bend: Bend, subject: str = TRACER) -> tuple[str, str]:
    """Return the outcome of a case before and after its pictures' pixels are changed."""
    check = CASES[name].check
    before = check(subject).outcome
    bend_all(monkeypatch, lambda frame: replace(frame, pixels=bend(frame.pixels)))
    return before, check(subject).outcome


WITHOUT_PICTURES = {"warps-of-0-and-1", "colours-beyond-float32"}
OF_NUMBERS = {"tolerance-out-of-reach", "variance-beside-a-large-mean"}


@pytest.mark.parametrize("name", sorted(set(CASES) - WITHOUT_PICTURES - OF_NUMBERS))
def test_a_brighter_picture_fails(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert outcomes(name, monkeypatch, lambda pixels: 1.02 * pixels + 0.02)[1] == "failed"


@pytest.mark.parametrize("subject", [EGL, REFERENCE])
@pytest.mark.parametrize("name", ["dark-beside-a-sun", "largest-colours", "edge-after-a-million-samples"])
def test_a_brighter_picture_fails_for_others(name: str, subject: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert outcomes(name, monkeypatch, lambda pixels: 1.02 * pixels + 0.02, subject)[1] == "failed"


@pytest.mark.parametrize(
    "name", ["dot-missed-by-unbiased-pilots", "a-million-independent-samples", "colours-beyond-float32"]
)
def test_a_brighter_reference_fails(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert outcomes(name, monkeypatch, lambda pixels: 1.0001 * pixels, REFERENCE) == ("ok", "failed")


@pytest.mark.parametrize("name", ["flat-after-a-million-samples", "flat-under-any-filter", "largest-colours"])
def test_drift_of_a_millionth_fails(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a float32 sum of 2^14 equal numbers is off by, at least."""
    assert outcomes(name, monkeypatch, lambda pixels: (1.0 - 1e-6) * pixels.astype(np.float64)) == ("ok", "failed")


def test_a_float32_sum_of_both_signs_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """It has nothing left of 1e-6."""
    assert outcomes("values-of-both-signs", monkeypatch, np.zeros_like)[1] == "failed"


def test_bleeding_from_the_sun_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """A weight of 1e-12 beyond the filter."""
    assert outcomes("dark-beside-a-sun", monkeypatch, lambda pixels: pixels + 1e-12 * 1e6) == ("ok", "failed")
    assert outcomes("dark-beside-a-sun", monkeypatch, np.zeros_like)[1] == "failed"


def test_flushed_denormals_fail_where_nothing_allows_them(monkeypatch: pytest.MonkeyPatch) -> None:
    def flush(pixels: NDArray[Any]) -> NDArray[Any]:
        return np.where(np.abs(pixels) < 2.0**-126, 0.0, pixels)

    assert outcomes("denormal-colours", monkeypatch, flush) == ("ok", "failed")


def test_a_wider_filter_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """The tent of radius 9 in place of 8, the box of .12 in place of .1."""

    def render(scene: Any, technique: str, **options: Any) -> Any:
        wider = technique.replace("radius=8", "radius=9").replace("radius=0.1", "radius=0.12")
        return catalog.prepare(scene, wider, **options)

    monkeypatch.setattr(supports, "prepare", render)
    for subject in (TRACER, REFERENCE):
        assert CASES["filters-of-many-pixels"].check(subject).outcome == "failed"
        assert CASES["filters-narrower-than-pixels"].check(subject).outcome == "failed"


def test_a_warp_that_leaves_its_filter_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(supports, "_FILTERINGS", supports._FILTERINGS[:3])
    for wrong in (np.nan, np.inf, 1e9):

        def warp(_: object, u: FloatArray, v: FloatArray, wrong: float = wrong) -> tuple[FloatArray, ...]:
            return np.where(u == 0.0, wrong, 0.0), 0.0 * v, np.ones_like(u)

        monkeypatch.setattr(supports, "warp_points", warp)
        verdict = CASES["warps-of-0-and-1"].check(TRACER)
        assert verdict.outcome == "failed"
        assert verdict.measured >= 26


def test_overflow_that_nobody_tells_of_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("aliasbench.bench.run.describe_nonfinite", lambda _: None)
    verdict = CASES["colours-beyond-float32"].check(TRACER)
    assert verdict.outcome == "failed"
    assert verdict.measured == 2.0


def test_an_accepted_radiance_beyond_the_range_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("aliasbench.renderers.raster.rasterizer._check_range", lambda _: None)
    assert CASES["largest-colours"].check(EGL).outcome == "failed"


# Numbers of samples.


@pytest.mark.parametrize("name", ["flat-needs-no-more", "tolerance-out-of-reach"])
@pytest.mark.parametrize("change", [-1, 1])
def test_one_pixel_with_another_number_of_samples_fails(
    name: str, change: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def bend(frame: Frame) -> Frame:
        assert frame.sample_counts is not None
        counts = frame.sample_counts.copy()
        counts[3, 2] += change
        return replace(frame, sample_counts=counts)

    bend_all(monkeypatch, bend)
    verdict = CASES[name].check(TRACER)
    assert verdict.outcome == "failed"
    assert verdict.measured in (4.0, 8.0)  # one of each picture


def test_a_variance_off_by_a_fiftieth_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    def bend(frame: Frame) -> Frame:
        assert frame.sample_counts is not None
        return replace(frame, sample_counts=(frame.sample_counts * 1.02).astype(np.int32))

    bend_all(monkeypatch, bend)
    assert CASES["variance-beside-a-large-mean"].check(TRACER).outcome == "failed"


def test_pooled_pilots_fail_as_unbiased_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    means = adaptivity._picture_means(TRACER, "adaptive=pooled")
    monkeypatch.setattr(adaptivity, "_picture_means", lambda *_: means)
    assert CASES["dot-missed-by-unbiased-pilots"].check(TRACER).outcome == "failed"


def test_a_mean_known_too_badly_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """Twice the noise, or a fourth of the bias, may not pass as unbiased."""
    monkeypatch.setattr(adaptivity, "_SEEDS", 4)
    monkeypatch.setattr(adaptivity, "_DOTS", (8, 8))
    assert CASES["dot-missed-by-unbiased-pilots"].check(TRACER).outcome == "failed"


# The closed forms that checks hold pictures to.


def test_the_stratified_error_is_what_samples_have() -> None:
    """Against the standard deviation over 4000 sets of 8 x 8 samples, known to 1.1 %: four of that are allowed."""
    side, sets = 8, 4000
    draw = np.random.default_rng(1)
    cells = np.arange(side)
    x = (cells + draw.random((sets, side, side))) / side
    y = (cells[:, None] + draw.random((sets, side, side))) / side
    means = (x < 0.2 + 0.2 * y).mean(axis=(1, 2))
    assert abs(means.mean() - 0.3) < 4.0 * means.std() / np.sqrt(sets)
    assert sums._stratified_error(side) == pytest.approx(means.std(), rel=0.045)


def test_dots_cover_1_in_4096() -> None:
    vertices = adaptivity.dots().objects[0].vertices.reshape(-1, 4, 3)
    sides = np.ptp(vertices, axis=1)
    assert len(vertices) == 4096
    np.testing.assert_allclose(sides[:, :2], 1.0 / 64.0, rtol=1e-12)
    low, high = vertices.min(axis=1), vertices.max(axis=1)
    assert (np.floor(low[:, :2]) == np.floor(high[:, :2])).all()
