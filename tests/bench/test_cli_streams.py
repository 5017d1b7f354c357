"""The command line where it is treated badly: closed or full streams, endless values, names that a terminal obeys."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

Run = Callable[..., tuple[int, str, str]]
PROGRAM = [sys.executable, "-m", "aliasbench.bench"]
NINES = "9" * 5000


def started(closed: str, *arguments: str, cwd: Path) -> "subprocess.CompletedProcess[str]":
    command = ["sh", "-c", f'exec "$@" {closed}', "sh", *PROGRAM, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=cwd)


@pytest.mark.parametrize("arguments", ["list", "doctor", "export run", "--help", "list --help", "--version"])
def test_what_is_only_printed_is_refused_where_there_is_nowhere_to_print(arguments: str, tmp_path: Path) -> None:
    done = started(">&-", *arguments.split(), cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "aliasbench: cannot print: standard output is closed\n"


def test_files_are_made_also_with_both_streams_closed(tmp_path: Path) -> None:
    arguments = ["render", "edge-fan", "raytrace:", "--size", "8x8", "-o"]
    for number, closed in enumerate((">&-", "2>&-", ">&- 2>&-")):
        done = started(closed, *arguments, f"{number}.exr", cwd=tmp_path)
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout.startswith("1.exr: edge-fan by raytrace:") == (closed == "2>&-")
    assert len({path.read_bytes() for path in tmp_path.glob("*.exr")}) == 1
    assert started(">&-", *arguments, "a.exr", "--json", cwd=tmp_path).returncode == 2


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("arguments", [["list", "filters"], ["--help"]])
def test_a_full_standard_output_is_named(
    arguments: list[str], unbuffered: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONUNBUFFERED", unbuffered)
    done = started("> /dev/full", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr == "aliasbench: cannot write standard output: No space left on device\n"


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (f"render edge-fan raytrace: -o a.exr --size {NINES}x4", "width must be from 1 to 65536"),
        (f"render edge-fan raytrace: -o a.exr --frame {NINES}", "must be a whole number from 0"),
        (f"render edge-fan raytrace:spp={NINES} -o a.exr", "must be a whole number from 1 to 16777216"),
        (f"render edge-fan raytrace: -o {NINES}.exr", "File name too long"),
        (f"run --scene edge-fan -o {NINES}", "cannot write '999"),
        (f"run quick --shard 1/{NINES} -o x", "must be i/n"),
        (f"run {NINES} -o x", "suite '999"),
        (f"report {NINES} -o x", "run directory '999"),
        (f"export {NINES}", "run directory '999"),
        (f"list {NINES}", "unknown section '999"),
        (f"list --{NINES}", "unknown option of aliasbench list '--999"),
        (NINES, "unknown command '999"),
        (f"--{NINES}", "unknown option of aliasbench '--999"),
    ],
)
def test_endless_values_are_shortened_in_one_sentence(run: Run, arguments: str, sentence: str) -> None:
    code, out, err = run(*arguments.split())
    assert (code, out) == (2, "")
    assert sentence in err
    assert "9" * 61 not in err
    assert len(err) < 400
    assert err.count("\n") == 1


@pytest.mark.usefixtures("fakes")
def test_nothing_that_a_terminal_obeys_is_printed(run: Run, tmp_path: Path) -> None:
    name, folder = "sc\x1b[31mene\n", tmp_path / "ru\x9bn"
    code, out, err = run("run", "--scene", name, "--technique", "raytrace:", "--size", "8x8", "-o", str(folder))
    assert code == 0
    for text in (out, err):
        assert all(c.isprintable() or c == "\n" for c in text)
        assert r"sc\x1b[31mene\n" in text
    code, out, _ = run("export", str(folder), "--json")
    assert json.loads(out)["records"][0]["scene"] == name
    assert "\x1b" not in out
    code, out, _ = run("render", name, "raytrace:", "-o", str(folder / "a\x1b.exr"), "--size", "8x8")
    assert (code, out.count("\n"), "\x1b" in out) == (0, 1, False)
    code, out, err = run("render", name, "raytrace:", "-o", str(folder / "none\x1b" / "a.exr"))
    assert (code, out, "\x1b" in err) == (2, "", False)


def test_names_that_are_no_text_are_read_written_and_shown(run: Run, tmp_path: Path, fakes) -> None:
    suite, picture, folder = (str(tmp_path / os.fsdecode(name)) for name in (b"s\xff.toml", b"p\xff.exr", b"f\xff"))
    Path(suite).write_text('schema = 1\nscenes = ["a"]\ntechniques = ["raster:"]\nsize = [8, 8]\n')
    assert run("run", suite, "-o", str(tmp_path / "run"))[0] == 0
    renders = len(fakes.log)
    assert run("run", "-o", str(tmp_path / "run"), "--resume")[0] == 0
    assert len(fakes.log) == renders
    code, out, _ = run("export", str(tmp_path / "run"), "--json")
    assert (code, json.loads(out)["suite"]) == (0, os.fsdecode(b"s\xff"))
    code, out, _ = run("render", "a", "raster:", "-o", picture, "--size", "8x8")
    assert (code, r"p\udcff.exr: a by raster:" in out, Path(picture).is_file()) == (0, True, True)
    Path(folder).mkdir()
    for arguments in (("render", "a", "raster:", "-o", f"{folder}/a.exr"), ("run", suite, "-o", folder)):
        code, out, err = run(*arguments)
        assert (code, out) == (2, "")
        assert "f\\udcff': its name is not UTF-8" in err
