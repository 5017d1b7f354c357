"""`aliasbench scenes export` and `check`: what they print and write, and what they refuse."""

import json
import os
import stat
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from aliasbench.bench import whole_files
from aliasbench.bench.frames import write_image
from aliasbench.bench.scene_files import export_files
from aliasbench.scenes import checking
from aliasbench.scenes.catalog import SCENES
from aliasbench.scenes.errors import InputError, UnsupportedScene
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import Scene
from aliasbench.scenes.schema import Table

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
    assert {path.name: path.read_text(encoding="utf-8") for path in tmp_path.iterdir()} == {"a": "old"}


@pytest.mark.parametrize("links", [True, False])
def test_a_file_that_cannot_be_renamed_leaves_what_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, links: bool
) -> None:
    for name in "ac":
        (tmp_path / name).write_text(f"old {name}", encoding="utf-8")
    replace = Path.replace

    def refuse(self: Path, target: Path) -> Path:
        if target.name == "c" and not self.name.endswith("-old"):
            raise PermissionError(1, "Operation not permitted")
        return replace(self, target)

    def no_link(*_: object, **__: object) -> None:
        raise OSError(95, "Operation not supported")

    if not links:
        monkeypatch.setattr(whole_files.os, "link", no_link)
    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", refuse)
        with pytest.raises(InputError, match=r"cannot write into .*: Operation not permitted"):
            whole_files.write_files(tmp_path, dict.fromkeys("abc", b"new"))
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"a": b"old a", "c": b"old c"}
    assert whole_files.write_files(tmp_path, dict.fromkeys("abc", b"new")) == [tmp_path / name for name in "abc"]
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == dict.fromkeys("abc", b"new")


def test_what_was_there_is_never_thrown_away_even_when_it_cannot_be_put_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a").write_bytes(b"old")
    replace, renamed = Path.replace, []

    def once(self: Path, target: Path) -> Path:
        renamed.append(target)
        if len(renamed) > 1:
            raise OSError(5, "Input/output error")
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", once)
    with pytest.raises(InputError, match="Input/output error"):
        whole_files.write_files(tmp_path, dict.fromkeys("ab", b"new"))
    assert sorted(path.read_bytes() for path in tmp_path.iterdir()) == [b"new", b"old"]


def test_a_scene_file_takes_its_place_after_the_images_that_it_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace, order = Path.replace, []

    def noted(self: Path, target: Path) -> Path:
        order.append(target)
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", noted)
    assert export_files("grid", tmp_path) == order[::-1]
    assert [path.name for path in order] == ["grid-grid.exr", "grid.toml"]


@pytest.fixture(params=[0o022, 0o077, 0o002])
def umask(request: pytest.FixtureRequest) -> Iterator[int]:
    """Return what new files may not be, until the test ends."""
    before = os.umask(request.param)
    yield request.param
    os.umask(before)


def test_who_may_read_a_file_is_what_the_umask_says(tmp_path: Path, umask: int) -> None:
    whole_files.write_files(tmp_path, {"a": b""})
    write_image(tmp_path / "b.exr", np.zeros((1, 1, 3)))
    assert {stat.S_IMODE(path.stat().st_mode) for path in tmp_path.iterdir()} == {0o666 & ~umask}


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
    assert second.startswith(f"ok: {lit}: lit: no objects; no texture; 1 light; still; facts: none")
    able = second.rpartition("drawn by ")[2].split(", ")
    assert [reason.split(":")[0] for reason in reasons] == [
        f"    not by {name}" for name in ("raytrace", "raster", "reference") if name not in able
    ]
    rows = json.loads(run("scenes", "check", given, "--json")[1])["files"]
    assert rows[0]["ok"] is True
    assert rows[0]["textures"] == {"a": "checker"}
    assert rows[0]["renderers"] == {"raytrace": None, "raster": None, "reference": None}


def test_one_file_that_takes_too_much_memory_or_cannot_be_opened_is_named_and_the_others_are_checked(
    run: Run, given: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    large = tmp_path / "large.toml"
    large.write_text(GIVEN)
    read_root = checking.read_root

    def too_much(root: Table, folder: Path, stem: str) -> Scene:
        if stem == "large":
            raise MemoryError
        return read_root(root, folder, stem)

    monkeypatch.setattr(checking, "read_root", too_much)
    os.mkfifo(tmp_path / "fifo.toml")
    files = [str(tmp_path / name) for name in ("large.toml", "gone.toml", "fifo.toml")]
    code, out, err = run("scenes", "check", *files, given)
    assert code == 2
    first, second = out.splitlines()
    assert first == f"{large}:1: needs more memory than there is"
    assert second.startswith(f"ok: {given}: ")
    assert [line.partition(".toml: ")[2] for line in err.splitlines()[:2]] == [
        f"cannot be read ({why}); the path of a scene file (.toml) is needed"
        for why in ("No such file or directory", "not a regular file")
    ]
    assert err.splitlines()[2:] == [f"aliasbench: problems: 1 in {large}"]


@pytest.mark.parametrize("arguments", [("check", ""), ("export", "grid", "-o", "")])
def test_a_path_without_a_character_is_none(run: Run, arguments: tuple[str, ...]) -> None:
    assert "a path is needed" in refused(run("scenes", *arguments))


def test_a_scene_file_may_come_through_a_pipe() -> None:
    done = subprocess.run(
        [*PROGRAM, "scenes", "export", "/dev/stdin"], input=GIVEN, capture_output=True, text=True, check=True
    )
    assert 'name = "stdin"' in done.stdout


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
