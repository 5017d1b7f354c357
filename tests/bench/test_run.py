"""The runner, on renderers that cost nothing."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from aliasbench.bench.export import load_run
from aliasbench.bench.frames import read_image, write_image
from aliasbench.bench.run import Step, start_run
from aliasbench.bench.suite import Request, plan_run
from aliasbench.metrics import catalog as metrics
from aliasbench.metrics.score import Score
from aliasbench.renderers.technique import parse_technique
from aliasbench.scenes import files
from aliasbench.scenes.errors import InputError, UnsupportedScene

SUITE = """
schema = 1
name = "fake"
size = [8, 8]
frames = 2
rounds = 3
scenes = ["one", "two"]
techniques = ["raytrace:", "raytrace:spp=4", "raster:", "raytrace:spp=4,filter=tent"]
metrics = ["rmse", "shimmer", "jaggies"]
"""
pytestmark = pytest.mark.usefixtures("fakes")
TECHNIQUES = ["raytrace:", "raytrace:spp=4", "raster:", "raytrace:spp=4,filter=tent"]


@pytest.fixture
def request_all(tmp_path: Path) -> Request:
    (tmp_path / "fake.toml").write_text(SUITE)
    return Request(str(tmp_path / "fake.toml"))


def test_every_case_has_a_record_with_raw_seconds_metrics_and_pictures(
    pixels_of, request_all: Request, tmp_path: Path
) -> None:
    run_dir = tmp_path / "run"
    start_run(request_all, run_dir)
    run = load_run(run_dir)
    assert run["schema"] == 1
    assert run["suite"] == "fake"
    assert run["unfinished"] == 0
    assert {"cpu", "cores", "os", "python", "aliasbench", "numpy"} <= run["machine"].keys()
    assert [(r["scene"], r["technique"]) for r in run["records"]] == [
        (s, t) for s in ("one", "two") for t in TECHNIQUES
    ]
    for record in run["records"]:
        assert (record["status"], record["error"]) == ("ok", None)
        assert (record["size"], record["seed"], record["frames"]) == ([8, 8], 0, 2)
        assert len(record["seconds"]) == 3
        assert all(s >= 0.002 for s in record["seconds"])
        assert (record["setup_seconds"], record["samples"]) == (0.25, 7 * 64)
        assert (record["uncertainty"], record["uncertainty_kind"]) == (1e-9, "bound")
        scene, technique = files.load_scene(record["scene"]), parse_technique(record["technique"])
        truth = parse_technique("reference:filter=tent" if "tent" in technique.text else "reference:")
        test = np.stack([pixels_of(scene, technique, (8, 8), n, 0) for n in range(2)]).astype(np.float32)
        true = np.stack([pixels_of(scene, truth, (8, 8), n, 0) for n in range(2)])
        assert np.array_equal(read_image(run_dir / record["images"]["frame"]), test[0])
        assert np.array_equal(read_image(run_dir / record["images"]["reference"]), true[0].astype(np.float32))
        error = (test - true)[:, 1:-1, 1:-1]
        assert record["metrics"]["shimmer"]["status"] == "ok"
        assert record["metrics"]["jaggies"] == {"value": None, "status": "not_applicable", "extras": {}} or (
            record["metrics"]["jaggies"]["value"] is None
        )
        weights = np.array([0.2126, 0.7152, 0.0722])
        candidates = [np.sqrt(np.mean(error**2)), np.sqrt(np.mean((error @ weights) ** 2))]
        assert min(abs(record["metrics"]["rmse"]["value"] - c) for c in candidates) < 1e-9


def test_references_are_rendered_once_for_each_scene_and_filter(fakes, request_all: Request, tmp_path: Path) -> None:
    start_run(request_all, tmp_path / "run")
    assert [e for e in fakes.log if e[1].startswith("reference")] == [
        (scene, text, frame, 0)
        for scene in ("one", "two")
        for text in ("reference:", "reference:filter=tent")
        for frame in (0, 1)
    ]


def test_timed_rounds_come_last_and_are_interleaved_after_a_warm_up(
    fakes, request_all: Request, tmp_path: Path
) -> None:
    start_run(request_all, tmp_path / "run")
    one = [e[1] for e in fakes.log if e[0] == "one"]
    timed = one[-4 * 4 :]
    assert timed[:4] == TECHNIQUES
    for number in range(3):
        at = 4 * (number + 1)
        assert timed[at : at + 4] == TECHNIQUES[number:] + TECHNIQUES[:number]
    assert all(e[2] == 0 for e in [e for e in fakes.log if e[0] == "one"][-16:])


def test_what_fails_is_recorded_with_its_reason_and_the_run_goes_on(
    fakes, request_all: Request, tmp_path: Path
) -> None:
    def fail(scene: str, technique: str, count: int) -> BaseException | None:
        if scene == "one" and technique == "raytrace:":
            return RuntimeError("the lamp\nbroke")
        if scene == "one" and technique == "raster:":
            return UnsupportedScene("raster: no dispersion")
        if scene == "one" and technique == "raytrace:spp=4" and count == 4:
            return InputError("too slow")
        if scene == "two" and technique == "reference:filter=tent":
            return Exception("bare")
        return None

    fakes.fail = fail
    start_run(request_all, tmp_path / "run")
    records = load_run(tmp_path / "run")["records"]
    assert [(r["status"], r["error"]) for r in records] == [
        ("failed", "RuntimeError: the lamp broke"),
        ("failed", "while timing: too slow"),
        ("unsupported", "raster: no dispersion"),
        ("ok", None),
        ("ok", None),
        ("ok", None),
        ("ok", None),
        ("failed", "no reference: Exception: bare"),
    ]
    assert records[0]["metrics"] == {}
    assert records[1]["metrics"]["rmse"]["status"] == "ok"
    assert len(records[1]["seconds"]) < 3
    assert (tmp_path / "run" / records[7]["images"]["frame"]).is_file()


def test_a_picture_that_is_not_finite_fails_its_case(fakes, request_all: Request, tmp_path: Path) -> None:
    def spoil(technique: str, pixels: np.ndarray) -> np.ndarray:
        if technique == "raster:":
            pixels[5, 3, 1] = np.nan
            pixels[6, 0, 0] = np.inf
        return pixels

    fakes.change = spoil
    start_run(request_all, tmp_path / "run")
    broken = [r for r in load_run(tmp_path / "run")["records"] if r["status"] == "failed"]
    assert [r["technique"] for r in broken] == ["raster:", "raster:"]
    assert broken[0]["error"] == "4 values are not finite, the first in frame 0 at row 5, column 3"
    assert broken[0]["metrics"]["rmse"]["value"] is None
    assert broken[0]["metrics"]["rmse"]["status"] == "nonfinite"
    json.dumps(load_run(tmp_path / "run"), allow_nan=False)


def test_metrics_that_break_or_give_no_finite_number_fail_their_case(
    request_all: Request, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ValueError("rmse is shy")

    monkeypatch.setattr(metrics, "measure_all", broken)
    start_run(request_all, tmp_path / "run")
    assert {r["error"] for r in load_run(tmp_path / "run")["records"]} == {"metrics: ValueError: rmse is shy"}
    for score in (Score(float("inf"), "ok", {}), Score(1.0, "ok", {"per": [float("nan")]})):
        monkeypatch.setattr(metrics, "measure_all", lambda *_, s=score, **__: {"rmse": s})
        start_run(request_all, tmp_path / "run", fresh=True)
        records = load_run(tmp_path / "run")["records"]
        assert {r["status"] for r in records} == {"failed"}
        assert all(re.fullmatch("metrics: ValueError: (inf|nan) is not finite", r["error"] or "") for r in records)


def test_seeds_are_all_rendered_and_all_measured(fakes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shapes = []
    measure_all = metrics.measure_all

    def watch(names: object, test: np.ndarray, reference: np.ndarray, **options: object) -> object:
        shapes.append((test.shape, reference.shape))
        return measure_all(names, test, reference, **options)

    monkeypatch.setattr(metrics, "measure_all", watch)
    request = Request(scenes=("one",), techniques=("raster:",), size=(6, 5), frames=2, seeds=3, rounds=1)
    start_run(request, tmp_path / "run")
    assert shapes == [((3, 2, 5, 6, 3), (2, 5, 6, 3))]
    (record,) = load_run(tmp_path / "run")["records"]
    assert (record["seed"], record["seeds"]) == (0, [0, 1, 2])
    assert [e[2:] for e in fakes.log if e[1] == "raster:"][:6] == [(f, s) for s in range(3) for f in range(2)]


def test_progress_counts_every_render_up_to_the_total(fakes, request_all: Request, tmp_path: Path) -> None:
    steps: list[Step] = []
    start_run(request_all, tmp_path / "run", on_step=steps.append)
    assert steps[-1].done == steps[-1].total == len(fakes.log)
    assert [s.done for s in steps] == sorted(s.done for s in steps)
    assert {s.doing for s in steps} >= {"one: reference:", "two: raster:", "two: speed"}
    assert steps[-1].doing == "done"


def test_progress_ends_at_the_total_whatever_fails(fakes, request_all: Request, tmp_path: Path) -> None:
    steps: list[Step] = []
    fakes.fail = lambda scene, technique, count: (
        RuntimeError("x") if technique == "raster:" or (scene, count) == ("two", 4) else None
    )
    start_run(request_all, tmp_path / "run", on_step=steps.append)
    assert {r["status"] for r in load_run(tmp_path / "run")["records"]} == {"ok", "failed"}
    assert steps[-1] == Step("done", steps[-1].total, steps[-1].total)
    assert [s.done for s in steps] == sorted(s.done for s in steps)
    steps.clear()
    start_run(Request(), tmp_path / "run", resume=True, on_step=steps.append)
    assert steps == [Step("nothing left to do", 0, 0)]


class TestResume:
    def test_a_finished_run_is_left_as_it_is(self, fakes, request_all: Request, tmp_path: Path) -> None:
        start_run(request_all, tmp_path / "run")
        before, renders = load_run(tmp_path / "run"), len(fakes.log)
        start_run(request_all, tmp_path / "run", resume=True)
        start_run(Request(), tmp_path / "run", resume=True)
        assert load_run(tmp_path / "run") == before
        assert len(fakes.log) == renders

    @pytest.mark.parametrize("stop_at", [0, 3, 8, 21, 34, 55])
    def test_an_interrupted_run_goes_on_and_repeats_no_picture_it_kept(
        self, fakes, request_all: Request, tmp_path: Path, stop_at: int
    ) -> None:
        start_run(request_all, tmp_path / "whole")
        fakes.log.clear()

        def interrupt(*_: object) -> BaseException | None:
            return KeyboardInterrupt() if len(fakes.log) == stop_at else None

        fakes.fail = interrupt
        with pytest.raises(KeyboardInterrupt):
            start_run(request_all, tmp_path / "run")
        kept = {(r["scene"], r["technique"]): r for r in load_run(tmp_path / "run")["records"]}
        fakes.fail = lambda *_: None
        fakes.log.clear()
        start_run(request_all, tmp_path / "run", resume=True)
        whole, parts = load_run(tmp_path / "whole"), load_run(tmp_path / "run")
        assert parts["unfinished"] == 0
        assert len(parts["records"]) == len(whole["records"]) == 8
        for a, b in zip(whole["records"], parts["records"], strict=True):
            assert {k: v for k, v in a.items() if k != "seconds"} == {k: v for k, v in b.items() if k != "seconds"}
            assert len(a["seconds"]) == len(b["seconds"])
            for image, path in a["images"].items():
                assert (tmp_path / "whole" / path).read_bytes() == (tmp_path / "run" / b["images"][image]).read_bytes()
        assert not {(e[0], e[1]) for e in fakes.log} & kept.keys()
        for key, record in kept.items():
            again = next(r for r in parts["records"] if (r["scene"], r["technique"]) == key)
            assert again == record

    @pytest.mark.parametrize("folder", ["frames", "references"])
    @pytest.mark.parametrize("left", [None, 0.0, 0.3, 0.99])
    def test_cases_whose_pictures_are_lost_or_damaged_are_done_again(
        self, fakes, request_all: Request, tmp_path: Path, folder: str, left: float | None
    ) -> None:
        start_run(request_all, tmp_path / "run")
        before = load_run(tmp_path / "run")
        kind = folder.removesuffix("s")
        lost = before["records"][1]["images"][kind]
        hit = [r for r in before["records"] if r["images"][kind] == lost]
        whole = (tmp_path / "run" / lost).read_bytes()
        (tmp_path / "run" / lost).unlink()
        if left is not None:
            (tmp_path / "run" / lost).write_bytes(whole[: int(len(whole) * left)])
        fakes.log.clear()
        steps: list[Step] = []
        start_run(Request(), tmp_path / "run", resume=True, on_step=steps.append)
        assert (tmp_path / "run" / lost).read_bytes() == whole
        assert load_run(tmp_path / "run") == before
        assert {e[:2] for e in fakes.log if e[1] != "reference:"} == {(r["scene"], r["technique"]) for r in hit}
        assert steps[0].doing.startswith(f"{len(hit)} case{'s' if len(hit) > 1 else ''} done again")
        assert steps[-1] == Step("done", len(fakes.log), len(fakes.log))

    def test_a_picture_of_another_size_is_no_picture_of_the_case(self, request_all: Request, tmp_path: Path) -> None:
        start_run(request_all, tmp_path / "run")
        picture = tmp_path / "run" / load_run(tmp_path / "run")["records"][0]["images"]["frame"]
        whole = picture.read_bytes()
        write_image(picture, np.zeros((4, 4, 3), np.float32))
        start_run(Request(), tmp_path / "run", resume=True)
        assert picture.read_bytes() == whole

    def test_a_run_is_not_written_over_unless_asked(self, request_all: Request, tmp_path: Path) -> None:
        start_run(request_all, tmp_path / "run")
        with pytest.raises(InputError, match="holds a run already: go on with --resume, or replace it with --fresh"):
            start_run(request_all, tmp_path / "run")
        with pytest.raises(InputError, match="give one of them"):
            start_run(request_all, tmp_path / "run", resume=True, fresh=True)
        (tmp_path / "run" / "notes.txt").write_text("mine")
        only_one = Request(request_all.suite, scenes=("one",))
        start_run(only_one, tmp_path / "run", fresh=True)
        run = load_run(tmp_path / "run")
        assert len(run["records"]) == 4
        assert len(list((tmp_path / "run" / "frames").iterdir())) == 4
        assert (tmp_path / "run" / "notes.txt").read_text() == "mine"

    def test_another_suite_machine_or_version_cannot_go_on(
        self, request_all: Request, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        start_run(request_all, tmp_path / "run")
        with pytest.raises(InputError, match=r"cannot resume .* it holds the suite 'fake' with other cases"):
            start_run(Request(request_all.suite, shard=(1, 2)), tmp_path / "run", resume=True)
        monkeypatch.setattr("aliasbench.bench.machine.project_version", lambda: "9.9")
        with pytest.raises(InputError, match=r"cannot resume .* its aliasbench was '.*' and is '9\.9' now"):
            start_run(request_all, tmp_path / "run", resume=True)

    def test_resume_begins_a_run_that_was_killed_before_it_began_but_takes_no_foreign_folder(
        self, request_all: Request, tmp_path: Path
    ) -> None:
        (tmp_path / "begun").mkdir()
        (tmp_path / "begun" / "run.lock").touch()
        (tmp_path / "begun" / ".run.sqlite").write_text("half")
        (tmp_path / "empty").mkdir()
        for name in ("begun", "empty"):
            start_run(request_all, tmp_path / name, resume=True)
            assert len(load_run(tmp_path / name)["records"]) == 8
        (tmp_path / "other").mkdir()
        (tmp_path / "other" / "thesis.txt").touch()
        for choice in ({}, {"resume": True}, {"fresh": True}):
            with pytest.raises(InputError, match=r"is no run directory: .* other files; give a new or an empty folder"):
                start_run(request_all, tmp_path / "other", **choice)
        assert [path.name for path in (tmp_path / "other").iterdir()] == ["thesis.txt"]
        with pytest.raises(InputError, match=r"cannot resume '.*none': no such folder; name a suite"):
            start_run(Request(), tmp_path / "none", resume=True)
        assert not (tmp_path / "none").exists()


def test_a_case_of_a_run_is_the_same_in_every_shard(request_all: Request, tmp_path: Path) -> None:
    start_run(request_all, tmp_path / "whole")
    whole = {r["id"]: r["metrics"] for r in load_run(tmp_path / "whole")["records"]}
    shards: dict[str, object] = {}
    for number in (1, 2, 3):
        start_run(Request(request_all.suite, shard=(number, 3)), tmp_path / str(number))
        shards |= {r["id"]: r["metrics"] for r in load_run(tmp_path / str(number))["records"]}
    assert shards == whole
    assert len(whole) == len(plan_run(request_all).cases)
