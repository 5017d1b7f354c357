"""`aliasbench scenes export` and `check`: what they print and write, and what they refuse."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from aliasbench.bench import whole_files
from aliasbench.scenes.catalog import SCENES
from aliasbench.scenes.errors import InputError, UnsupportedScene
from aliasbench.scenes.files import load_scene

Run = Callable[..., tuple[int, str, str]]
PROGRAM = [sys.executable, "-m", "aliasbench.bench"]
GIVEN = """[[object]]
quad = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]
velocity = [1, 0, 0]
[texture.a]
checker = { squares = [1, 1] }
[animation]
frames = 3
shutter = 0.5
"""


@pytest.fixture
def given(tmp_path: Path) -> str:
    path = tmp_path / "given.toml"
    path.write_text(GIVEN)
    return str(path)


def refused(result: tuple[int, str, str]) -> str:
    code, out, err = result
    assert (code, out) == (2, "")
    assert err.startswith("aliasbench: ")
    assert err.count("\n") == 1
    return err


@pytest.mark.parametrize("name", ["edge-fan", "propeller:blades=5,rev_per_s=23.5", "grid", "brick-floor"])
def test_what_is_printed_is_a_file_that_loads_as_an_equal_scene(run: Run, tmp_path: Path, name: str) -> None:
    code, text, err = run("scenes", "export", name)
    assert (code, err) == (0, "")
    (tmp_path / "my.toml").write_text(text, encoding="utf-8")
    assert load_scene(str(tmp_path / "my.toml")) == load_scene(name)
    assert json.loads(run("scenes", "export", name, "--json")[1]) == {"scene": name, "text": text}


def test_a_file_is_normalised_and_images_go_beside_it(run: Run, tmp_path: Path, given: str) -> None:
    code, out, _ = run("scenes", "export", given, "-o", str(tmp_path / "a" / "b"))
    assert (code, out) == (0, f"{tmp_path}/a/b/given.toml\n")
    assert load_scene(out.strip()) == load_scene(given)
    code, out, _ = run("scenes", "export", "grid", "-o", str(tmp_path / "a" / "mine.toml"), "--json")
    names = [Path(path).name for path in json.loads(out)["files"]]
    assert names == ["mine.toml", "mine-grid.exr"]
    assert load_scene(str(tmp_path / "a" / "mine.toml")) == SCENES["grid"].build()
    assert sorted(path.name for path in (tmp_path / "a").iterdir()) == ["b", "mine-grid.exr", "mine.toml"]


def test_what_cannot_be_exported_or_written_is_refused_and_leaves_nothing(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("x")
    (tmp_path / "taken" / "grid.toml").mkdir(parents=True)
    for arguments, said in (
        ("propeler", "unknown scene 'propeler'; did you mean 'propeller'?"),
        ("gone.toml", "gone.toml: cannot be read (No such file"),
        ("grid -o file", "cannot write into 'file': it is a file; a folder is needed"),
        ("grid -o file/x", "cannot write into 'file/x': Not a directory"),
        ("grid -o taken", "cannot write 'taken/grid.toml': it is a folder"),
        ("", "required: SCENE"),
        ("grid -o", "--output needs a value, --output DIR"),
        ("grid --out x", "unknown option of aliasbench scenes export '--out'; did you mean '--output'?"),
        ("grid grid", "unexpected 'grid'"),
    ):
        assert said in refused(run("scenes", "export", *arguments.split()))
    assert sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*")) == [
        *("file", "taken", "taken/grid.toml")
    ]


def test_a_disk_that_fills_up_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a").write_text("old")
    synced: list[int] = []

    def full(handle: int) -> None:
        synced.append(handle)
        if len(synced) == 2:
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(whole_files.os, "fsync", full)
    with pytest.raises(InputError, match=r"cannot write into .*: No space left on device"):
        whole_files.write_files(tmp_path, {"a": b"new", "b": b"new"})
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a": "old"}


def test_closed_and_full_outputs_are_refused_in_one_sentence(given: str) -> None:
    for action, name in (("export", "grid"), ("check", given)):
        command = " ".join([*PROGRAM, "scenes", action, name])
        for target, said in ((">&-", "standard output is closed"), (">/dev/full", "No space left on device")):
            done = subprocess.run(f"{command} {target}", shell=True, capture_output=True, text=True, check=False)
            assert done.returncode == 2
            assert said in done.stderr
            assert done.stderr.count("\n") == 1


def test_a_sound_file_is_summed_up_with_who_can_draw_it(run: Run, given: str, tmp_path: Path) -> None:
    lit = tmp_path / "lit.toml"
    lit.write_text("[[light]]\nquad = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]\nradiance = [1, 1, 1]")
    code, out, err = run("scenes", "check", given, str(lit))
    assert (code, err) == (0, "")
    first, second, *reasons = out.splitlines()
    assert first == (
        f"ok: {given}: given: 1 object of 2 triangles; 1 checker; 3 frames at 30 fps; shutter 0.5; facts: none; "
        "drawn by raytrace, raster, reference"
    )
    assert second.startswith(f"ok: {lit}: lit: 0 objects of 0 triangles; no texture; 1 light; still; facts: none")
    able = second.rpartition("drawn by ")[2].split(", ")
    assert [reason.split(":")[0] for reason in reasons] == [
        f"    not by {name}" for name in ("raytrace", "raster", "reference") if name not in able
    ]
    rows = json.loads(run("scenes", "check", given, "--json")[1])["files"]
    assert rows[0]["ok"] is True
    assert rows[0]["textures"] == {"a": "checker"}
    assert rows[0]["renderers"] == {"raytrace": None, "raster": None, "reference": None}


@pytest.mark.usefixtures("fakes")
def test_a_renderer_that_cannot_draw_it_says_why(run: Run, given: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*_: object, **__: object) -> None:
        raise UnsupportedScene("it has [no] fog")

    monkeypatch.setattr("aliasbench.renderers.catalog.prepare", none)
    code, out, _ = run("scenes", "check", given)
    assert code == 0
    assert "drawn by none\n" in out
    assert "    not by raster: it has [no] fog\n" in out


def test_every_problem_is_a_line_with_file_and_line_number_and_the_exit_code_is_2(
    run: Run, given: str, tmp_path: Path
) -> None:
    wrong = tmp_path / "wrong.toml"
    wrong.write_text("contrast = -1\n[camera]\nheigth = 2\n[[object]]\ncolor = 3\n")
    code, out, err = run("scenes", "check", str(wrong), given)
    assert code == 2
    lines = out.splitlines()
    assert [line.partition(": ")[0] for line in lines] == [*(f"{wrong}:{line}" for line in (1, 3, 4, 5)), "ok"]
    assert err == f"aliasbench: problems: 4 in {wrong}\n"
    code, out, _ = run("scenes", "check", str(wrong), "--json")
    assert code == 2
    (row,) = json.loads(out)["files"]
    assert row["ok"] is False
    assert [(p["line"], p["key"]) for p in row["problems"]][:3] == [
        (1, "contrast"),
        (3, "camera.heigth"),
        (4, "object[0]"),
    ]


def test_files_that_cannot_be_read_do_not_hide_the_others(run: Run, given: str, tmp_path: Path) -> None:
    gone = str(tmp_path / "gone.toml")
    assert "cannot be read (No such file" in refused(run("scenes", "check", gone))
    assert "cannot be read (Is a directory" in refused(run("scenes", "check", str(tmp_path)))
    code, out, err = run("scenes", "check", gone, given)
    assert code == 2
    assert out.startswith(f"ok: {given}")
    assert gone in err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("scenes", "no action given; known: export, check, sheet"),
        ("scenes chek", "unknown action of scenes 'chek'; did you mean 'check'?"),
        ("scenes check", "required: FILE"),
        ("scenes check a.toml --jsn", "unknown option of aliasbench scenes check '--jsn'; did you mean '--json'?"),
        ("list scenes propeler", "unknown name of scenes 'propeler'; did you mean 'propeller'?"),
    ],
)
def test_bad_usage_is_refused_with_what_is_known(run: Run, arguments: str, said: str) -> None:
    assert said in refused(run(*arguments.split()))


def test_scenes_are_listed_on_a_line_each_and_one_by_name_with_its_parameters(run: Run) -> None:
    title, *lines, hint = run("list", "scenes")[1].splitlines()
    assert title == "scenes:"
    assert "list scenes NAME" in hint
    assert [line.split()[0] for line in lines] == list(SCENES)
    assert max(map(len, lines)) <= 120
    _, about, *parameters = run("list", "scenes", "propeller")[1].splitlines()
    assert about == f"  propeller  {SCENES['propeller'].summary}"
    assert [line.strip().partition("=")[0] for line in parameters] == list(SCENES["propeller"].parameters)
    (row,) = json.loads(run("list", "scenes", "propeller", "--json")[1])["scenes"]
    assert row["parameters"]["blades"]["default"] == 3
