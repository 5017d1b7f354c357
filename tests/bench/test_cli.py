"""The command line: what it prints, where, and with which exit code."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from aliasbench.bench import doctor
from aliasbench.bench.arguments import COMMANDS, NOT_YET
from aliasbench.bench.frames import read_image
from aliasbench.bench.listing import SECTIONS, WIDTH
from aliasbench.metrics.catalog import METRICS
from aliasbench.metrics.guide import GUIDE
from aliasbench.renderers.raster.context import ContextReport
from aliasbench.renderers.raytrace.embree import EmbreeInfo
from aliasbench.renderers.technique import parse_technique
from aliasbench.scenes.errors import NotAvailableError, UnsupportedScene
from aliasbench.scenes.model import Camera, Scene

Run = Callable[..., tuple[int, str, str]]
PROGRAM = [sys.executable, "-m", "aliasbench.bench"]


def assert_refused(result: tuple[int, str, str], sentence: str) -> None:
    code, out, err = result
    assert code == 2
    assert out == ""
    assert err.startswith("aliasbench: ")
    assert err.count("\n") == 1
    assert "Traceback" not in err
    assert sentence in err


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ("", "no command given; known: doctor, list"),
        ("rendr", "unknown command 'rendr'; did you mean 'render'?"),
        ("render", "the following arguments are required: SCENE, TECHNIQUE, -o/--output"),
        ("render propeller raytrace: -o OUT.exr --size 0x5", "'0x5': width must be from 1 to 65536"),
        ("render propeller raytrace: -o OUT.exr --size 5x0", "'5x0': height must be from 1 to 65536"),
        ("render propeller raytrace: -o OUT.exr --size 5", "'5' must be WIDTHxHEIGHT"),
        ("render propeller raytrace: -o OUT.exr --size -3x5", "--size: '-3x5' must be WIDTHxHEIGHT, as in 512x512"),
        ("render propeller raytrace: -o OUT.exr --size", "--size needs a value, --size WxH (see"),
        ("run quick -o", "--output needs a value, --output RUN_DIR (see"),
        ("-x", "unknown option of aliasbench '-x'; known: --help, --version"),
        ("--verson", "unknown option of aliasbench '--verson'; did you mean '--version'?"),
        ("run -o OUT --resume", "cannot resume 'out': no such folder; name a suite"),
        ("render propeller raytrace: -o OUT.exr --frame -1", "'-1' must be a whole number from 0"),
        ("render propeller raytrace: -o OUT.exr --seed 1.5", "'1.5' must be a whole number from 0"),
        ("render propeller raytrace: -o OUT.jpg", "unknown extension"),
        ("render propeller raytrace: -o OUT/a/b.exr", "no such folder"),
        ("render propeler raytrace: -o OUT.exr", "unknown scene 'propeler'; did you mean 'propeller'?"),
        ("render propeller raytrac: -o OUT.exr", "unknown renderer 'raytrac'; did you mean 'raytrace'?"),
        ("render propeller raytrace:spp=0 -o OUT.exr", "spp=0: must be a whole number"),
        ("render propeller raytrace: -o OUT.exr --frames 3", "unknown option of aliasbench render '--frames'"),
        ("render propeller raytrace: extra -o OUT.exr", "unexpected 'extra'"),
        ("list scene", "unknown section 'scene'; did you mean 'scenes'?"),
        ("list metrics jagies", "unknown name of metrics 'jagies'; did you mean 'jaggies'?"),
        ("list scenes -o OUT", "list -o: only metrics have a page; of scenes: aliasbench scenes sheet -o DIR"),
        ("list -o OUT", "list -o: only metrics have a page"),
        ("list metrics -o", "--output needs a value, --output DIR (see"),
        ("run -o OUT", "nothing to run: name a suite, or scenes with --scene"),
        ("run quik -o OUT", "unknown suite 'quik'; did you mean 'quick'?"),
        ("run quick", "required: -o/--output"),
        ("run quick -o OUT --resum", "did you mean '--resume'?"),
        ("run quick -o OUT --shard 3/2", "'3/2' must be i/n with i from 1 to n"),
        ("run quick -o OUT --shard 0/2", "'0/2' must be i/n"),
        ("run quick -o OUT --executor dask", "executor dask is not available yet; available: local"),
        ("run quick -o OUT --executor disk", "unknown executor 'disk'; did you mean 'dask'?"),
        ("run quick -o OUT --workers 2", "--workers is for --executor dask"),
        ("run --scene propeller --technique raytrace:sp=4 -o OUT", "unknown key of raytrace 'sp'; did you mean 'spp'?"),
        ("export OUT", "no such run directory"),
        ("export .", "is no run directory"),
        ("export . --format xml", "unknown format 'xml'"),
        ("report . -o OUT", "is no run directory"),
        ("compare a b --fail-on time", "the command compare is not available yet; available: doctor, list"),
    ],
)
def test_bad_usage_is_one_sentence_on_standard_error_and_exit_code_2(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: str, sentence: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert_refused(run(*arguments.replace("OUT", "out").split()), sentence)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", NOT_YET)
def test_every_command_that_is_not_there_yet_says_so_and_still_has_help(run: Run, command: str) -> None:
    assert_refused(run(command), f"the command {command} is not available yet")
    code, out, _ = run(command, "--help")
    assert (code, "not available yet" in out) == (0, True)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help(run: Run, command: str) -> None:
    code, out, err = run(command, "--help")
    assert (code, err) == (0, "")
    assert out.startswith(f"usage: aliasbench {command}")


def test_help_is_there_at_once() -> None:
    seconds = []
    for _ in range(3):
        start = time.perf_counter()
        done = subprocess.run([*PROGRAM, "--help"], capture_output=True, text=True, check=True)
        seconds.append(time.perf_counter() - start)
        assert all(command in done.stdout for command in COMMANDS)
    assert min(seconds) < 0.3


@pytest.mark.usefixtures("fakes")
class TestRender:
    def test_exr_holds_the_float32_values_and_json_says_what_was_done(
        self, run: Run, tmp_path: Path, pixels_of: Callable[..., np.ndarray]
    ) -> None:
        out = str(tmp_path / "a.exr")
        arguments = ["any", "raster-msaa-4", "-o", out, "--size", "6x4", "--frame", "2", "--seed", "3", "--json"]
        code, text, err = run("render", *arguments)
        assert (code, err) == (0, "")
        facts = json.loads(text)
        assert (facts["technique"], facts["size"], facts["samples"]) == ("raster:msaa=4", [6, 4], 7 * 24)
        scene = Scene("any", Camera("orthographic", height=2.0))
        expected = pixels_of(scene, parse_technique("raster:msaa=4"), (6, 4), 2, 3).astype(np.float32)
        assert np.array_equal(read_image(tmp_path / "a.exr"), expected)

    def test_a_reference_is_rounded_to_float32(
        self, run: Run, tmp_path: Path, pixels_of: Callable[..., np.ndarray]
    ) -> None:
        assert run("render", "any", "reference:", "-o", str(tmp_path / "a.exr"), "--size", "6x4")[0] == 0
        scene = Scene("any", Camera("orthographic", height=2.0))
        exact = pixels_of(scene, parse_technique("reference:"), (6, 4), 0, 0)
        assert np.array_equal(read_image(tmp_path / "a.exr"), exact.astype(np.float32))

    def test_what_a_renderer_cannot_do_is_said(self, run: Run, tmp_path: Path, fakes) -> None:
        fakes.fail = lambda *_: UnsupportedScene("the rasterizer has no dispersion")
        result = run("render", "any", "raster:", "-o", str(tmp_path / "a.exr"))
        assert_refused(result, "unsupported: the rasterizer has no dispersion")
        fakes.fail = lambda *_: MemoryError()
        assert_refused(run("render", "any", "raster:", "-o", str(tmp_path / "a.exr")), "not enough memory")
        assert list(tmp_path.iterdir()) == []


class TestRun:
    ARGUMENTS = (
        "--scene",
        "one",
        "--technique",
        "raytrace:",
        "--technique",
        "raster:",
        "--size",
        "8x8",
        "--rounds",
        "2",
    )

    def test_the_table_has_a_row_for_each_case_and_export_prints_the_records(
        self, run: Run, tmp_path: Path, fakes
    ) -> None:
        fakes.fail = lambda _, technique, __: UnsupportedScene("no [dispersion]") if technique == "raster:" else None
        code, out, err = run("run", *self.ARGUMENTS, "-o", str(tmp_path / "run"))
        assert code == 0
        assert "[0/" in err
        assert "raytrace:" in out
        assert "no [dispersion]" in out
        assert "1 ok, 0 failed, 1 unsupported" in out
        assert "only 2 rounds" in out
        code, text, err = run("export", str(tmp_path / "run"), "--format", "json")
        assert (code, err) == (0, "")
        exported = json.loads(text)
        assert exported["schema"] == 1
        assert [r["status"] for r in exported["records"]] == ["ok", "unsupported"]
        keys = "scene technique size seed frames status error seconds setup_seconds samples metrics"
        assert all(set(keys.split()) <= record.keys() for record in exported["records"])
        for record in exported["records"]:
            assert all(set(score) == {"value", "status", "extras"} for score in record["metrics"].values())
        assert exported["records"][0]["metrics"]["rmse"]["status"] == "ok"
        assert run("export", str(tmp_path / "run"), "-o", str(tmp_path / "a.json"))[0] == 0
        assert json.loads((tmp_path / "a.json").read_text()) == exported
        assert run("export", str(tmp_path / "run"), "--json") == (0, text, "")

    def test_failed_cases_are_exit_code_1_with_the_reason_in_the_table(self, run: Run, tmp_path: Path, fakes) -> None:
        fakes.fail = lambda _, technique, __: RuntimeError("lamp") if technique == "raster:" else None
        code, out, _ = run("run", *self.ARGUMENTS, "-o", str(tmp_path / "run"))
        assert code == 1
        assert "RuntimeError: lamp" in out
        assert "1 ok, 1 failed, 0 unsupported" in out

    def test_a_run_is_refused_resumed_and_replaced(self, run: Run, tmp_path: Path, fakes) -> None:
        arguments = ("run", *self.ARGUMENTS, "-o", str(tmp_path / "run"))
        assert run(*arguments)[0] == 0
        assert_refused(run(*arguments), "holds a run already: go on with --resume, or replace it with --fresh")
        renders = len(fakes.log)
        assert run(*arguments, "--resume")[0] == 0
        assert len(fakes.log) == renders
        code, out, _ = run(*arguments, "--overwrite", "--json")
        assert code == 0
        assert len(json.loads(out)["records"]) == 2
        assert len(fakes.log) == 2 * renders

    def test_ctrl_c_says_how_to_go_on(self, run: Run, tmp_path: Path, fakes) -> None:
        fakes.fail = lambda *_: KeyboardInterrupt() if len(fakes.log) == 3 else None
        code, out, err = run("run", *self.ARGUMENTS, "-o", str(tmp_path / "run"))
        assert (code, out) == (130, "")
        command = err.splitlines()[-1].partition("goes on with: aliasbench ")[2].split()
        fakes.fail = lambda *_: None
        assert run(*command)[0] == 0

    def test_an_output_that_cannot_be_a_run_directory_is_refused(self, run: Run, tmp_path: Path, fakes) -> None:
        (tmp_path / "file").write_text("x")
        for output in ("file", "file/run"):
            assert_refused(run("run", *self.ARGUMENTS, "-o", str(tmp_path / output)), "cannot write")
        assert fakes.log == []


@pytest.mark.parametrize("section", SECTIONS)
def test_list_names_every_entry_and_its_json_is_the_same(run: Run, section: str) -> None:
    code, text, err = run("list", section)
    assert (code, err) == (0, "")
    rows = json.loads(run("list", section, "--json")[1])[section]
    assert len(rows) > 0
    assert all(row["name"] in text for row in rows)


@pytest.mark.parametrize("name", METRICS)
def test_a_metric_is_listed_with_its_guide_whole(run: Run, name: str) -> None:
    code, text, err = run("list", "metrics", name)
    assert (code, err) == (0, "")
    assert max(map(len, text.splitlines())) <= WIDTH
    words = " ".join(text.split())
    (row,) = json.loads(run("list", "metrics", name, "--json")[1])["metrics"]
    assert row["name"] == name
    for field, told in asdict(GUIDE[name]).items():
        assert f"{field.replace('_', ' ')}: {told}" in words
        assert row["guide"][field] == told
    assert f"source: {METRICS[name].source}" in words


def test_list_alone_lists_everything(run: Run) -> None:
    assert list(json.loads(run("list", "--json")[1])) == list(SECTIONS)


def test_doctor_tells_what_every_engine_can_do(run: Run) -> None:
    code, out, _ = run("doctor", "--json")
    found = json.loads(out)
    assert code == (0 if found["ok"] else 1)
    assert found["ok"] == (any(c["ok"] for c in found["opengl"]) and found["embree"]["ok"])
    for attempt in found["opengl"]:
        assert attempt["renderer"] if attempt["ok"] else (attempt["error"] and attempt["fix"])
    text = run("doctor")[1]
    for line in ("OpenGL egl", "OpenGL osmesa", "Embree: ", "threads: ", "numpy: "):
        assert line in text


@pytest.mark.parametrize("broken", ["opengl", "embree"])
def test_doctor_is_1_with_the_fix_where_an_engine_is_missing(
    run: Run, monkeypatch: pytest.MonkeyPatch, broken: str
) -> None:
    def no_embree() -> EmbreeInfo:
        raise NotAvailableError("no library")

    context = ContextReport("egl", 0, broken != "opengl", renderer="lamp", error="no driver", fix="get one")
    monkeypatch.setattr("aliasbench.renderers.raster.context.describe_contexts", lambda: [context])
    working = EmbreeInfo("4.4.0", "AVX2", 8, "libembree4.so")
    monkeypatch.setattr(
        "aliasbench.renderers.raytrace.embree.embree_info", no_embree if broken == "embree" else lambda: working
    )
    code, out, _ = run("doctor")
    assert code == 1
    assert ("OpenGL egl device 0: no: no driver\n    fix: get one" in out) == (broken == "opengl")
    assert (f"Embree: no: no library\n    fix: {doctor.EMBREE_FIX}" in out) == (broken == "embree")


def test_version_is_the_installed_one_with_a_digest_of_the_sources(run: Run) -> None:
    code, out, _ = run("--version")
    assert code == 0
    assert out.startswith("aliasbench 0.")
    assert "+" in out


def test_a_reader_that_has_seen_enough_gets_no_complaint() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run([*PROGRAM, "list", "filters"], stdout=writing, stderr=subprocess.PIPE, check=False)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, b"")


def test_the_real_renderers_are_run_measured_timed_and_reported(run: Run, tmp_path: Path) -> None:
    arguments = ["--size", "48x40", "--frames", "2", "--rounds", "1", "-o", str(tmp_path / "run")]
    for technique in ("raytrace:", "raytrace:spp=64,sampler=jittered", "raster-1", "raster:passes=64", "raster:msaa=3"):
        arguments += ["--technique", technique]
    code, out, _ = run("run", "--scene", "propeller:shutter=0.5", *arguments)
    assert code == 1
    assert "4 ok, 1 failed, 0 unsupported" in out
    records = json.loads(run("export", str(tmp_path / "run"))[1])["records"]
    assert "msaa=3" in records[4]["error"]
    errors = [r["metrics"]["rmse"]["value"] for r in records[:4]]
    # 64 jittered samples of pixel and time against one: at worst (noise alone) an eighth, and far less with strata.
    assert 0 < errors[1] < errors[0] / 8
    assert 0 < errors[3] < errors[2] / 8
    assert all(r["uncertainty"] <= 1e-3 and r["seconds"][0] > 0 for r in records[:4])
    code, out, err = run("report", str(tmp_path / "run"), "-o", str(tmp_path / "page"))
    assert (code, err) == (0, "")
    page = Path(out.strip())
    assert page == tmp_path / "page" / "index.html"
    assert "propeller:shutter=0.5" in page.read_text(encoding="utf-8")
