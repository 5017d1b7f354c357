"""Every case about edges, asked of every subject, has the outcome written down here; and every check can fail."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aliasbench.bench.hard import edges, moving_edges, shared_edges, texel_lines
from aliasbench.bench.hard.case import ALL, EGL, FAST, OSMESA, PORTABLE, REFERENCE, TRACER, HardCase, Verdict
from aliasbench.bench.hard.edge_pictures import (
    FINEST,
    Look,
    cameras,
    coverage,
    misplacements,
    ray_bound,
    snap_bound,
    stages,
    worst_of,
)
from aliasbench.bench.hard.ownership import pixel_points
from aliasbench.renderers.frame import Frame
from aliasbench.scenes.shapes import polygon

MODULES = (edges, moving_edges, shared_edges, texel_lines)
CASES: Mapping[str, HardCase] = {case.name: case for module in MODULES for case in module.CASES}
# Everything else is "ok": a limit that is new must be noticed.
LIMITS: Mapping[str, tuple[str, ...]] = {
    "centre-edges": (TRACER, FAST, PORTABLE, EGL, OSMESA),
    "border-edges": (EGL, OSMESA),
    "flat-slopes": (TRACER, FAST, PORTABLE, EGL, OSMESA),
    "fan-vertex": (TRACER, FAST, PORTABLE, EGL, OSMESA),
    "edge-on-mesh": (EGL, OSMESA),
    "whole-pixel-motion": (TRACER, FAST, PORTABLE, EGL, OSMESA, REFERENCE),
    "shared-edges": (FAST,),
    "shared-vertices": (TRACER, FAST, PORTABLE),
    "edge-parts": (TRACER, FAST, PORTABLE),
    "coverage-sums": (REFERENCE,),
    "checker-lines": (EGL, OSMESA),
    "texel-lines": (EGL, OSMESA),
}


@pytest.fixture(autouse=True)
def reduced(monkeypatch: pytest.MonkeyPatch) -> None:
    """Look at rest with a camera that is exact, on the move with one that is not, at fewer distances and seeds."""

    def few(size: tuple[int, int], names: Any = None) -> list[Any]:  # noqa: ARG001 - as `stages`
        return [s for s in stages(size, ("orthographic", "perspective")) if s.moving == (s.name == "perspective")]

    for module in MODULES:
        monkeypatch.setattr(module, "stages", few)
    monkeypatch.setattr(shared_edges, "BESIDE", (0.0, 2.0**-22, 2.0**-18, 2.0**-13))
    monkeypatch.setattr(shared_edges, "SEEDS", 1)


@pytest.mark.parametrize("subject", ALL)
@pytest.mark.parametrize("name", CASES)
def test_outcomes_are_those_written_down(name: str, subject: str) -> None:
    verdict = CASES[name].check(subject)
    assert verdict.outcome == ("limit" if subject in LIMITS[name] else "ok"), verdict
    assert verdict.unit == ("contrast" if subject == REFERENCE or name == "coverage-sums" else "px")
    assert subject == REFERENCE or name == "coverage-sums" or verdict.bound <= 1.0 / 256.0


def test_the_table_is_of_these_cases() -> None:
    assert LIMITS.keys() == CASES.keys()
    assert all(case.subjects == ALL and case.group == "edges" for case in CASES.values())


def test_the_fast_test_misses_where_the_robust_one_does_not() -> None:
    fast, robust = (CASES["shared-edges"].check(subject) for subject in (FAST, TRACER))
    assert robust.measured == 0.0
    assert fast.measured >= FINEST
    missed = int(fast.note.split("; ")[1].split()[0])
    assert missed > 100  # thousands of samples are aimed at edges


def _break(monkeypatch: pytest.MonkeyPatch, change: Any) -> None:
    """Have every picture that the checks see changed."""
    for module in MODULES:
        if hasattr(module, "render"):
            plain = module.render

            def shown(*arguments: Any, _plain: Any = plain, **options: Any) -> Frame:
                frame: Frame = _plain(*arguments, **options)
                return replace(frame, pixels=change(frame.pixels))

            monkeypatch.setattr(module, "render", shown)
        if hasattr(module, "prepare"):
            monkeypatch.setattr(module, "prepare", _broken_prepare(module.prepare, change))


def _broken_prepare(prepare: Any, change: Any) -> Any:
    class Broken:
        def __init__(self, *arguments: Any, **options: Any) -> None:
            self._inner = prepare(*arguments, **options)

        def render(self, **options: Any) -> Frame:
            frame: Frame = self._inner.render(**options)
            return replace(frame, pixels=change(frame.pixels))

        def __enter__(self) -> "Broken":
            self._inner.__enter__()
            return self

        def __exit__(self, *reason: Any) -> None:
            self._inner.__exit__(*reason)

    return Broken


def _shifted(pixels: np.ndarray) -> np.ndarray:
    """Everything is a pixel farther right and down."""
    return np.roll(pixels, (1, 1), axis=(0, 1))


def _punctured(pixels: np.ndarray) -> np.ndarray:
    """A pixel in the middle sees the background."""
    out = pixels.copy()
    out[out.shape[0] // 2 - 1, out.shape[1] // 2 - 1] = 0.0
    return out


@pytest.mark.parametrize("subject", [TRACER, EGL, REFERENCE])
@pytest.mark.parametrize("name", [n for n in CASES if not n.startswith(("shared", "edge-parts", "coverage"))])
def test_a_shifted_picture_fails(name: str, subject: str, monkeypatch: pytest.MonkeyPatch) -> None:
    _break(monkeypatch, _shifted)
    assert CASES[name].check(subject).outcome == "failed"


@pytest.mark.parametrize("subject", [FAST, EGL, REFERENCE])
@pytest.mark.parametrize("name", ["shared-edges", "edge-parts", "coverage-sums"])
def test_a_hole_fails(name: str, subject: str, monkeypatch: pytest.MonkeyPatch) -> None:
    # of the mesh this pixel is within a triangle or beside an edge, both farther than any bound from the next
    monkeypatch.setattr(shared_edges, "BESIDE", (0.25,))
    monkeypatch.setattr(shared_edges, "fan", lambda hub: [o + np.array([0.2, 0.1]) for o in edges.fan(hub)])
    _break(monkeypatch, _punctured)
    assert CASES[name].check(subject).outcome == "failed"


def test_a_hole_at_a_vertex_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shared_edges, "BESIDE", (2.0**-8,))

    def without_vertices(pixels: np.ndarray) -> np.ndarray:
        out = pixels.copy()
        out[:: shared_edges.CELL, :: shared_edges.CELL] = 0.0
        return out

    _break(monkeypatch, without_vertices)
    for subject in (TRACER, FAST, PORTABLE, EGL):
        assert CASES["shared-vertices"].check(subject).outcome == "failed"


def test_misplacement_is_the_way_to_what_has_the_colour() -> None:
    square = np.array([(1.0, 1.0), (5.0, 1.0), (5.0, 5.0), (1.0, 5.0)])
    looks = [Look((1.0, 0.0, 0.0), [square]), Look((0.0, 1.0, 0.0), [square], hidden=True)]
    red, green, blue, black = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0))
    samples = [
        (red, (2.0, 3.0), 0.0),  # inside, rightly
        (red, (8.0, 9.0), 5.0),  # 3 and 4 px beyond a corner
        (black, (2.0, 3.5), 1.0),  # inside, 1 px from the left
        (black, (0.0, 0.0), 0.0),
        (green, (2.5, 3.0), 1.5),  # hidden: to the outline from either side
        (green, (0.5, 3.0), 0.5),
        (blue, (3.0, 3.0), np.inf),
    ]
    colors, points, expected = (np.array(column, dtype=np.float64) for column in zip(*samples, strict=True))
    assert np.allclose(misplacements(colors, points, looks), expected, rtol=1e-12)
    seam = [np.array([(1.0, 1.0), (5.0, 5.0), (1.0, 5.0)])]
    with_seam = misplacements(colors, points, looks, seam)
    assert with_seam[2] == pytest.approx(1.0)  # its side to (1, 5) is the square's
    assert misplacements(colors[2:3], np.array([(3.25, 3.0)]), looks, seam)[0] == pytest.approx(0.25 / np.sqrt(2.0))


def test_a_wrong_texel_is_as_far_as_its_border() -> None:
    _, table = texel_lines._image()
    points = np.array([(4.75, 3.5), (4.75, 3.5), (4.5, 3.5)])  # columns begin at x = .5 + 4 k, rows at y = .5 + 2 k
    column, row = 5, texel_lines.TEXELS[1] - 6
    colors = np.array([table[row, column], table[row, column - 1], table[row, column - 1]])
    assert np.allclose(texel_lines.texel_misplacements(colors, points, table, 0.0), [0.0, 0.25, FINEST])
    beyond = texel_lines.texel_misplacements(table[row, column + 3][None], points[:1], table, 0.0)
    assert np.isinf(beyond).all()


def test_coverage_is_the_area_of_the_outline() -> None:
    outline = np.array([(1.25, 0.5), (6.5, 2.0), (3.0, 5.75)])
    covered = coverage(outline, (8, 6))
    (ax, ay), (bx, by) = outline[1:] - outline[0]
    doubled = ax * by - ay * bx
    assert covered.sum() == pytest.approx(abs(doubled) / 2.0, rel=1e-13)
    assert covered.max() == 1.0
    # against a fine grid: an edge of length under 2 px a pixel crosses at most 2 * 64 of its 64^2 cells
    fine = (np.arange(64) + 0.5) / 64
    inside = [edges_inside(outline, x, y) for y in fine + 2 for x in fine + 4]
    assert covered[2, 4] == pytest.approx(np.mean(inside), abs=2.0 / 64)


def edges_inside(outline: np.ndarray, x: float, y: float) -> bool:
    """Whether a point lies on one side of all edges."""
    along, to = np.roll(outline, -1, axis=0) - outline, np.array([x, y]) - outline
    sides = along[:, 0] * to[:, 1] - along[:, 1] * to[:, 0]
    return bool((sides > 0).all() or (sides < 0).all())


def test_bounds_grow_with_the_distance_and_are_larger_for_the_fast_test() -> None:
    size = (24, 16)
    still = next(s for s in stages(size, ("perspective",)) if not s.moving)
    near, far = (polygon(still.place(edges.fan((12.5, 8.5))[0], depth)) for depth in (5.0, 500.0))
    robust, fast = ray_bound(TRACER, still, [near]), ray_bound(FAST, still, [near])
    assert robust < fast
    # in pixels a perspective picture does not change with scale, nor do roundings
    assert ray_bound(TRACER, still, [far]) == pytest.approx(robust, rel=1e-6)
    # four roundings of the input alone, before those of the test and before corners
    assert robust >= 2.0**-24 * 4.0 * still.view.scale
    assert snap_bound(0.0) == pytest.approx(np.sqrt(2.0) / 512.0)
    assert snap_bound(0.0, aligned=True) == 1.0 / 512.0


def test_the_worst_verdict_is_what_failed_or_is_nearest_to_its_bound() -> None:
    good, near, far = (Verdict(m, "px", 0.0, 1.0, "") for m in (0.0, 0.5, 0.25))
    broken = Verdict(2.0, "px", 0.0, 1.0, "")
    assert worst_of([good, near, far]) is near
    assert worst_of([near, broken, good]) is broken
    assert worst_of([Verdict(np.inf, "px", 0.0, 1.0, ""), broken]).measured == np.inf


def test_stages_keep_their_places_in_the_picture_when_things_move() -> None:
    for stage in stages((24, 16)):
        points = np.array([(3.5, 4.5), (20.0, 1.0)])
        seconds = (stage.frame + 0.5) / stage.animation.fps if stage.moving else 0.0
        world = stage.place(points) + np.asarray(stage.motion.velocity) * seconds
        assert np.allclose(stage.view.project(world)[:, :2], points, atol=1e-11)
    assert set(cameras((24, 16))) == {"orthographic", "turned", "perspective"}
    assert len(pixel_points((24, 16))) == 384
