"""Errors in space and in time: which further sequences a case needs, and what they say of real ones."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aliasbench.bench import centers
from aliasbench.bench.export import Record, load_run
from aliasbench.bench.run import Step, start_run
from aliasbench.bench.suite import Case, Request, plan_run
from aliasbench.renderers import catalog
from aliasbench.renderers.technique import parse_technique
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import Animation, Camera, Scene

NAMES = ("spatial", "temporal", "shutter")
OPEN = "propeller:rev_per_s=29,shutter=0.5"


def case_of(scene: str, technique: str, **changes: Any) -> Case:
    (case,) = plan_run(Request(scenes=(scene,), techniques=(technique,), size=(256, 128), frames=5)).cases
    return replace(case, **changes)


def names_of(case: Case) -> list[tuple[str, float, int]]:
    return [(t.name, t.scene.animation.shutter, t.frames) for t in centers.truths_of(case)]


def test_a_scene_that_stands_still_or_metrics_that_do_not_ask_need_no_further_truth() -> None:
    for case in (
        case_of("near-horizontal-edge", "raytrace:spp=4"),
        case_of(OPEN, "raytrace:spp=4", metrics=("rmse", "shimmer")),
    ):
        assert names_of(case) == [("reference:", case.scene.animation.shutter, 5)]
        assert (centers.center_truth(case), centers.full_truth(case), centers.center_frames(case)) == (None, None, 0)


def test_an_open_shutter_needs_the_instant_in_its_middle_and_the_first_frames_under_a_full_one() -> None:
    case = case_of(OPEN, "raytrace:spp=4,filter=tent")
    # Two pictures of 256 x 128 have 65536 pixels.
    assert names_of(case) == [
        ("reference:filter=tent", 0.5, 5),
        ("reference:filter=tent,time=center", 0.5, 5),
        ("reference:filter=tent with a full shutter", 1.0, 2),
    ]
    assert names_of(replace(case, size=(64, 64)))[2][2] == 5
    assert names_of(replace(case, size=(1024, 1024)))[2][2] == 1
    assert names_of(replace(case, metrics=("temporal",))) == names_of(case)[:2]
    assert centers.center_frames(replace(case, seeds=(0, 1, 2))) == 15
    assert centers.center_technique(case) == parse_technique("raytrace:spp=4,filter=tent,time=center")


def test_what_is_known_already_is_not_rendered_again() -> None:
    closed = case_of("propeller:rev_per_s=29", "raytrace:spp=4")
    assert names_of(closed) == [("reference:", 0.0, 5), ("reference: with a full shutter", 1.0, 2)]
    assert (centers.center_technique(closed), centers.center_frames(closed)) == (closed.technique, 0)
    assert names_of(case_of("two-matrices", "raster:")) == [("reference:", 1.0, 5), ("reference:time=center", 1.0, 5)]
    instant = case_of(OPEN, "reference:time=center")
    assert names_of(instant) == [("reference:time=center", 0.5, 5), ("reference: with a full shutter", 1.0, 2)]
    assert centers.center_frames(instant) == 0
    assert centers.center_frames(case_of(OPEN, "reference:")) == 5


@pytest.mark.parametrize(
    "technique",
    [
        "raytrace:",
        "raytrace:sampler=grid",
        "raytrace:time=center,spp=4",
        "raster:",
        "raster:msaa=4",
        "raster:ssaa=2,motion=matrix",
        "raster:post=taa",
        "raster:sampler=grid,post=smaa",
    ],
)
def test_techniques_that_see_an_instant_are_the_same_at_the_shutters_middle(technique: str) -> None:
    case = case_of(OPEN, technique)
    assert centers.center_technique(case) is case.technique
    at_center = technique if "time=center" in technique else f"{technique}{',' * (technique[-1] != ':')}time=center"
    own, center = (catalog.render(case.scene, t, size=(40, 40), frame=1, seed=3) for t in (technique, at_center))
    assert np.array_equal(own.pixels, center.pixels)


@pytest.mark.parametrize("technique", ["raytrace:spp=4", "raster:passes=4", "raster:sampler=jittered"])
def test_techniques_that_sample_time_are_not(technique: str) -> None:
    case = case_of(OPEN, technique)
    own, center = (catalog.render(case.scene, t, size=(40, 40)) for t in (technique, centers.center_technique(case)))
    assert np.abs(own.pixels - center.pixels).max() > 0.1


def run_records(tmp_path: Path, scenes: tuple[str, ...], techniques: tuple[str, ...], **options: Any) -> list[Record]:
    start_run(Request(scenes=scenes, techniques=techniques, rounds=1, **options), tmp_path / "run")
    records = load_run(tmp_path / "run")["records"]
    assert [r["error"] for r in records] == [None] * (len(scenes) * len(techniques))
    return records


@pytest.mark.usefixtures("fakes")
class TestFakes:
    @pytest.fixture
    def moving(self, monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
        """Makes all scenes move, with a shutter."""

        def shut(shutter: float) -> None:
            camera = Camera("orthographic", height=2.0, velocity=(1.0, 0.0, 0.0))
            monkeypatch.setattr(
                "aliasbench.scenes.files.load_scene",
                lambda text: Scene(text, camera, animation=Animation(30.0, 3, shutter)),
            )

        return shut

    @pytest.mark.parametrize("shutter", [0.0, 0.5, 1.0])
    def test_progress_counts_the_further_renders(
        self, moving: Callable[[float], None], fakes: Any, tmp_path: Path, shutter: float
    ) -> None:
        moving(shutter)
        steps: list[Step] = []
        request = Request(scenes=("s",), techniques=("raster:", "raytrace:spp=4"), size=(8, 8), frames=3, rounds=2)
        start_run(replace(request, seeds=2), tmp_path / "run", on_step=steps.append)
        assert steps[-1].done == steps[-1].total == len(fakes.log)
        # Of two seeds, and of two techniques the one that samples time.
        assert fakes.rendered("raytrace:spp=4,time=center") == (6 if shutter else 0)
        assert fakes.rendered("raster:time=center") == 0
        assert fakes.rendered("reference:time=center") == (3 if shutter else 0)
        assert fakes.rendered("reference:") == (3 if shutter == 1.0 else 6)

    def test_scores_compare_the_sequences_they_are_defined_by(
        self, moving: Callable[[float], None], pixels_of: Any, tmp_path: Path
    ) -> None:
        moving(0.5)
        (record,) = run_records(tmp_path, ("s",), ("raytrace:spp=4",), size=(8, 8), frames=3, seeds=2)
        scene = load_like("s")

        def picture(text: str, seeds: int) -> np.ndarray:
            t = parse_technique(text)
            own = np.array([[pixels_of(scene, t, (8, 8), f, s) for f in range(3)] for s in range(seeds)])
            return own[:, :, 1:-1, 1:-1] @ np.array([0.2126, 0.7152, 0.0722])

        def mean_square(error: np.ndarray) -> float:
            return float(np.mean(error**2))

        total = mean_square(picture("raytrace:spp=4", 2) - picture("reference:", 1))
        spatial = mean_square(picture("raytrace:spp=4,time=center", 2) - picture("reference:time=center", 1))
        # Pictures under test are float32.
        assert record["metrics"]["spatial"]["value"] == pytest.approx(np.sqrt(spatial), abs=1e-7)
        assert record["metrics"]["temporal"]["value"] == pytest.approx(total - spatial, abs=1e-7)
        # The fake pictures do not depend on the shutter.
        assert record["metrics"]["shutter"]["extras"]["measured"] == 0.0

    def test_a_truth_that_fails_leaves_out_only_what_it_is_for(
        self, moving: Callable[[float], None], fakes: Any, tmp_path: Path
    ) -> None:
        moving(0.5)
        for text, count, missing in (("reference:time=center", 0, "centers"), ("reference:", 3, "full_shutter")):
            fakes.fail = lambda _, technique, done, text=text, count=count: (
                RuntimeError("x") if (technique, done) == (text, count) else None
            )
            fakes.log.clear()
            steps: list[Step] = []
            request = Request(scenes=("s",), techniques=("raytrace:spp=4",), size=(8, 8), frames=3, rounds=1)
            start_run(request, tmp_path / "run", fresh=(tmp_path / "run").exists(), on_step=steps.append)
            (record,) = load_run(tmp_path / "run")["records"]
            assert (record["status"], record["metrics"]["rmse"]["status"]) == ("ok", "ok")
            assert record["metrics"]["shutter"]["extras"] == {"missing": missing}
            assert (record["metrics"]["spatial"]["value"] is None) == (missing == "centers")
            assert steps[-1].done == steps[-1].total

    def test_a_picture_that_is_not_finite_at_the_middle_fails_its_case(
        self, moving: Callable[[float], None], fakes: Any, tmp_path: Path
    ) -> None:
        moving(0.5)
        fakes.change = lambda text, pixels: pixels * (np.nan if text.startswith("raytrace:spp=4,time") else 1.0)
        start_run(Request(scenes=("s",), techniques=("raytrace:spp=4",), size=(8, 8), frames=2), tmp_path / "run")
        (record,) = load_run(tmp_path / "run")["records"]
        assert record["status"] == "failed"
        assert record["error"] == "384 values are not finite, the first in frame 0 at row 0, column 0"
        assert record["metrics"]["spatial"]["status"] == "nonfinite"
        assert record["metrics"]["rmse"]["status"] == "ok"


def load_like(name: str) -> Scene:
    """A scene of that name: the fakes' pictures know no more of it."""
    return Scene(name, Camera("orthographic", height=2.0))


def test_a_sampler_of_time_has_little_error_in_time_and_one_of_the_middle_has_it_all(tmp_path: Path) -> None:
    size, frames = (64, 64), 1
    techniques = (
        "raytrace:spp=16",
        "raytrace:spp=16,time=center",
        "raster:passes=16",
        "raster:passes=16,time=center",
        "raytrace:",
        "raster:",
    )
    records = run_records(tmp_path, (OPEN,), techniques, size=size, frames=frames)
    scores = {r["technique"]: {n: r["metrics"][n]["value"] for n in (*NAMES, "rmse")} for r in records}
    scene = load_scene(OPEN)
    inside = (slice(1, -1), slice(1, -1), 0)

    def truth(scene: Scene, text: str) -> np.ndarray:
        with catalog.prepare(scene, text, size=size) as prepared:
            return np.array([prepared.render(f).pixels[inside] for f in range(frames)])

    own, instant = truth(scene, "reference:"), truth(scene, "reference:time=center")
    full = truth(replace(scene, animation=replace(scene.animation, shutter=1.0)), "reference:")
    away = float(np.sqrt(np.mean((own - instant) ** 2)))
    assert away > 0.2
    for technique, found in scores.items():
        # The pictures are grey: their luminance is the red channel, to the rounding of the three weights.
        assert found["shutter"] == pytest.approx(np.sqrt(np.mean((own - full) ** 2)), rel=1e-12)
        assert found["temporal"] == pytest.approx(found["rmse"] ** 2 - found["spatial"] ** 2, abs=1e-15)
        # N samples independent of each other have a variance of c (1 - c) / N in a pixel of coverage c, and strata
        # less; an instant is as far from the shutter's truth as R_0 is, give or take its own error in space.
        if technique in ("raytrace:spp=16", "raster:passes=16"):
            assert abs(found["temporal"]) < 2.0 * np.mean(own * (1.0 - own)) / 16
        else:
            assert found["rmse"] == pytest.approx(away, abs=found["spatial"])
            assert found["temporal"] > 5.0 * abs(scores["raytrace:spp=16"]["temporal"])
    for renderer, many in (("raytrace", "spp"), ("raster", "passes")):
        # The same places in space, and the same picture at the middle.
        assert scores[f"{renderer}:{many}=16"]["spatial"] == scores[f"{renderer}:{many}=16,time=center"]["spatial"]


def test_one_sample_of_a_closed_shutter_has_no_error_in_time(tmp_path: Path) -> None:
    records = run_records(
        tmp_path, ("propeller:rev_per_s=29",), ("raytrace:", "raster:", "raytrace:spp=4"), size=(48, 48), frames=2
    )
    for record in records:
        metrics = record["metrics"]
        assert (metrics["temporal"]["value"], metrics["temporal"]["status"]) == (0.0, "ok")
        assert metrics["spatial"]["value"] == pytest.approx(metrics["rmse"]["value"], rel=1e-12)
        assert float(metrics["shutter"]["value"] or 0.0) > 0.2


def test_of_a_scene_that_stands_still_nothing_is_told_apart(tmp_path: Path) -> None:
    (record,) = run_records(tmp_path, ("near-horizontal-edge",), ("raytrace:",), size=(32, 32))
    assert [record["metrics"][name]["status"] for name in NAMES] == ["not_applicable"] * 3
