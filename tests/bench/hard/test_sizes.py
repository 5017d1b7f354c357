"""The hard cases of sizes: each holds for each subject, as written down here; and each check fails on what is wrong."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from aliasbench.bench.hard import empty, flat_signals, late_frames, refusals, sizes, texel_counts, triangles
from aliasbench.bench.hard.case import EGL, METRICS, RASTERS, REFERENCE, RENDERERS, TRACER
from aliasbench.metrics.catalog import METRICS as ALL_METRICS
from aliasbench.metrics.score import Score
from aliasbench.renderers import catalog
from aliasbench.renderers.frame import Frame

CASES = {case.name: case for case in sizes.CASES}
# All else is exact. Vertices on 1/256 px; places within a texel of 16384 have 10 of 24 bits left.
LIMITS = {
    (name, subject)
    for subjects, names in (
        (RASTERS, ("filtered-texels", "late-turns", "latest-flight")),
        (RENDERERS, ("small-pictures", "wide-pictures")),
    )
    for name in names
    for subject in subjects
}
Bend = Callable[[NDArray[Any]], NDArray[Any]]


@pytest.fixture(autouse=True)
def reduced(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each length once: the widest that is drawn at once, and one that is drawn in parts."""
    monkeypatch.setattr(sizes, "WIDE", ((16384, 3), (1, 20000)))
    monkeypatch.setattr(texel_counts, "SIZES", ((1, 1), (1, 7), (5, 3), (4093, 1), (1, 16384)))


@pytest.mark.parametrize(("name", "subject"), [(case.name, s) for case in sizes.CASES for s in case.subjects])
def test_the_outcome_is_the_known_one(name: str, subject: str) -> None:
    verdict = CASES[name].check(subject)
    assert verdict.outcome == ("limit" if (name, subject) in LIMITS else "ok"), (verdict, verdict.note)


def test_every_case_is_named_once_and_of_this_group() -> None:
    assert len(CASES) == len(sizes.CASES) >= 15
    assert {case.group for case in sizes.CASES} == {"sizes"}


def bent(monkeypatch: pytest.MonkeyPatch, bend: Bend) -> None:
    """Make all renderers' pictures wrong."""

    def render(scene: Any, technique: Any, **more: Any) -> Frame:
        frame = catalog.render(scene, technique, **more)
        return replace(frame, pixels=bend(frame.pixels.copy()))

    for module in (sizes, empty, late_frames, texel_counts):
        monkeypatch.setattr(module, "render", render)


def shifted(pixels: NDArray[Any]) -> NDArray[Any]:
    return np.roll(pixels, 1, axis=1 if pixels.shape[1] > 1 else 0)


def one_off(pixels: NDArray[Any]) -> NDArray[Any]:
    pixels[-1, -1] = 1.0 - pixels[-1, -1]
    return pixels


def dimmed(pixels: NDArray[Any]) -> NDArray[Any]:
    out: NDArray[Any] = (pixels * 0.999).astype(pixels.dtype)
    return out


def lost(pixels: NDArray[Any]) -> NDArray[Any]:
    pixels[0, 0] = np.nan
    return pixels


BENDS: dict[str, tuple[Bend, ...]] = {
    "small-pictures": (shifted, one_off, dimmed),
    "wide-pictures": (shifted, dimmed),
    "filters-wider-than-the-picture": (dimmed, one_off, lost),
    "empty-scenes": (dimmed, one_off, lost),
    "texel-a-pixel": (shifted, one_off, dimmed),
    "filtered-texels": (shifted, one_off, lost),
    "texture-too-wide": (shifted, one_off, dimmed),
    "late-turns": (shifted, one_off),
    "latest-flight": (shifted, one_off),
}


@pytest.mark.parametrize(
    ("name", "bend", "subject"),
    [
        (name, bend, subject)
        for name, bends in BENDS.items()
        for bend in bends
        for subject in (TRACER, EGL, REFERENCE)
        # two references bent alike agree: see the next test
        if (name, subject) != ("filters-wider-than-the-picture", REFERENCE)
    ],
)
def test_wrong_pictures_fail(name: str, bend: Bend, subject: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sizes, "WIDE", ((20000, 1),))
    monkeypatch.setattr(sizes, "SMALL", ((17, 31),))
    if (name, subject) == ("texture-too-wide", EGL):
        monkeypatch.setattr(texel_counts, "TOO_WIDE", (101, 1))  # any device takes it
    bent(monkeypatch, bend)
    with np.errstate(invalid="ignore"):
        assert CASES[name].check(subject).outcome == "failed"


def test_a_reference_that_depends_on_its_size_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    bent(monkeypatch, lambda pixels: pixels * (1.0 + 1e-9 * pixels.shape[1]))
    assert CASES["filters-wider-than-the-picture"].check(REFERENCE).outcome == "failed"


@pytest.mark.parametrize("post", ["fxaa", "smaa", "taa"])
def test_processing_that_blurs_everything_fails(post: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def render(scene: Any, technique: str, **more: Any) -> Frame:
        frame = catalog.render(scene, technique, **more)
        return replace(frame, pixels=frame.pixels * np.float32(0.98)) if post in technique else frame

    monkeypatch.setattr(sizes, "render", render)
    assert CASES["post-processing-of-small-pictures"].check(EGL).outcome == "failed"


def test_processing_of_too_wide_a_picture_may_not_give_black(monkeypatch: pytest.MonkeyPatch) -> None:
    black = Frame(np.zeros((1, 65536, 3), np.float32), 1.0, 1.0, 1)
    monkeypatch.setattr(sizes, "render", lambda *_, **__: black)
    assert CASES["post-processing-of-too-wide-pictures"].check(EGL).measured == 3.0


def test_a_hollow_mesh_that_shows_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    def render(scene: Any, technique: str, **more: Any) -> Frame:
        frame = catalog.render(scene, technique, **more)
        return replace(frame, pixels=frame.pixels + np.float32(1e-6 * (len(scene.objects) > 2)))

    monkeypatch.setattr(empty, "render", render)
    assert CASES["hollow-meshes"].check(TRACER).outcome == "failed"


def test_a_frame_that_comes_late_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(late_frames, "LATE", (4 * 10**9 + 1,))
    assert CASES["late-periods"].check(TRACER).outcome == "failed"
    monkeypatch.setattr(late_frames, "LATE", (4 * 10**9,))
    assert CASES["late-periods"].check(TRACER).outcome == "ok"


def test_misplacement_is_that_of_the_nearest_sample_that_explains_a_pixel() -> None:
    size = (9, 7)
    scene = triangles.triangle_scene(size)
    moved = replace(
        scene, objects=(replace(scene.objects[0], vertices=scene.objects[0].vertices + np.array([0.25, 0.0, 0.0])),)
    )
    pixels = catalog.render(moved, "raytrace:spp=256,sampler=grid", size=size).pixels
    found = triangles.least_misplacement(pixels, scene, size, triangles.grid_offsets(16))
    # at most the shift, along the edge's normal; at least what is left of it by samples 1/16 px apart
    assert 0.25 - 0.15 < found <= 0.25


def test_what_is_accepted_or_refused_in_vague_words_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    assert refusals.refusal(lambda: None, "x") == "accepted"
    monkeypatch.setattr(refusals, "SPOILT", {"nothing": (lambda _: refusals._plain(), "vertices")})
    verdict = CASES["values-that-are-no-numbers"].check(TRACER)
    assert (verdict.outcome, verdict.measured) == ("failed", 3.0)
    spoil = refusals._with_vertex
    monkeypatch.setattr(refusals, "SPOILT", {"vague": (spoil, "the second vertex")})
    assert CASES["values-that-are-no-numbers"].check(REFERENCE).measured == 3.0


def test_a_file_that_is_read_all_the_same_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    files = {"fine.toml": (refusals._OBJECT, ("x",)), "odd.obj": ("v 0 0 nan\n", ("never said",))}
    monkeypatch.setattr(refusals, "bad_files", lambda _: files)
    assert CASES["files-with-no-numbers"].check(METRICS).measured == 2.0


def test_scores_that_are_not_as_written_down_count(monkeypatch: pytest.MonkeyPatch) -> None:
    names = [case.name for case in flat_signals.CASES]
    for score in (Score(0.7), Score(None, "overflow")):
        monkeypatch.setattr(
            flat_signals.catalog, "measure_all", lambda *_, score=score, **__: dict.fromkeys(ALL_METRICS, score)
        )
        for name in names:
            assert CASES[name].check(METRICS).measured > 10, name
