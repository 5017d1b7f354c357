"""What doctor says of settings and folders."""

from pathlib import Path

import pytest

from aliasbench.bench.doctor import CACHE_FIX, THREADS_FIX, describe, diagnose
from aliasbench.renderers.raster.context import ContextReport


@pytest.fixture(autouse=True)
def working(monkeypatch: pytest.MonkeyPatch) -> None:
    context = ContextReport("egl", 0, True, renderer="lamp")
    monkeypatch.setattr("aliasbench.renderers.raster.context.describe_contexts", lambda: [context])
    monkeypatch.setattr("aliasbench.bench.doctor.describe_machine", lambda: {"cpu": "\x1b[31mx"})


def test_the_number_of_threads_is_that_which_is_rendered_with(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ALIASBENCH_THREADS", "3")
    found = diagnose()
    assert (found["ok"], found["threads"]) == (True, 3)
    assert "threads: 3" in describe(found)


@pytest.mark.parametrize("threads", ["0", "-1", "two", "9" * 30])
def test_a_wrong_number_of_threads_is_a_machine_that_cannot_render(
    monkeypatch: pytest.MonkeyPatch, threads: str
) -> None:
    monkeypatch.setenv("ALIASBENCH_THREADS", threads)
    found = diagnose()
    assert (found["ok"], found["threads"]) == (False, None)
    lines = describe(found)
    at = next(i for i, line in enumerate(lines) if line.startswith("threads: no: "))
    assert f"ALIASBENCH_THREADS={threads}: must be a whole number from 1 to 1024" in lines[at]
    assert lines[at + 1] == f"    fix: {THREADS_FIX}"


def test_caches_are_named_and_tried(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "new" / "kernels"))
    monkeypatch.setenv("ALIASBENCH_CACHE", str(tmp_path / "file"))
    found = diagnose()
    assert found["ok"] is True
    lines = describe(found)
    assert f"cache of compiled kernels: {tmp_path / 'new' / 'kernels'}, writable" in lines
    at = lines.index(f"cache of references: {tmp_path / 'file' / 'references'}, not writable")
    assert lines[at + 1] == f"    fix: {CACHE_FIX.format('ALIASBENCH_CACHE')}"
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_what_it_says_can_be_printed() -> None:
    assert r"cpu: \x1b[31mx" in describe(diagnose())
