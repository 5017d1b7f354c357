"""The run directory."""

import resource
import sqlite3
from pathlib import Path

import pytest

from aliasbench.bench import store
from aliasbench.bench.store import RunStore
from aliasbench.scenes.errors import InputError

SPECS = [{"id": "b", "rounds": 2}, {"id": "a", "rounds": 1}]


def test_what_is_committed_is_there_for_readers_while_the_writer_is_open(tmp_path: Path) -> None:
    with RunStore.create(tmp_path / "new" / "run", {"suite": "s"}, SPECS) as run:
        run.add_outcome("b", {"status": "ok"})
        run.add_round(0, {"b": 0.5})
        run.add_round(1, {"b": 0.25})
        stored = store.read_cases(run.run_dir)
        assert [(c.spec["id"], c.is_finished) for c in stored] == [("b", True), ("a", False)]
        assert stored[0].seconds == (0.5, 0.25)
        assert store.read_facts(run.run_dir) == {"suite": "s"}


def test_a_case_is_finished_when_it_is_timed_or_has_no_pictures_to_time(tmp_path: Path) -> None:
    with RunStore.create(tmp_path, {}, SPECS) as run:
        run.add_outcome("b", {"status": "ok"})
        run.add_outcome("a", {"status": "failed"})
        run.add_round(0, {"b": 0.5})
        assert [c.is_finished for c in run.cases()] == [False, True]
        run.add_round(1, {"b": 0.5})
        assert [c.is_finished for c in run.cases()] == [True, True]


def test_a_closed_run_is_one_file_and_can_be_read_where_nobody_can_write(tmp_path: Path) -> None:
    with RunStore.create(tmp_path, {"suite": "s"}, SPECS) as run:
        run.add_outcome("a", {"status": "ok"})
    assert sorted(p.name for p in tmp_path.iterdir() if p.is_file()) == ["run.lock", "run.sqlite"]
    tmp_path.chmod(0o555)
    try:
        assert store.read_facts(tmp_path) == {"suite": "s"}
    finally:
        tmp_path.chmod(0o755)


def test_only_one_process_writes(tmp_path: Path) -> None:
    with (
        RunStore.create(tmp_path, {}, SPECS),
        pytest.raises(InputError, match="is being written by another process"),
    ):
        RunStore.reopen(tmp_path)
    RunStore.reopen(tmp_path).close()


def test_a_run_is_neither_made_twice_nor_reopened_where_there_is_none(tmp_path: Path) -> None:
    RunStore.create(tmp_path / "run", {}, SPECS).close()
    with pytest.raises(InputError, match="holds a run already: go on with --resume, or replace it with --fresh"):
        RunStore.create(tmp_path / "run", {}, SPECS)
    with pytest.raises(InputError, match="no such run directory"):
        RunStore.reopen(tmp_path / "none")


def test_removing_a_run_leaves_what_is_not_its(tmp_path: Path) -> None:
    run = RunStore.create(tmp_path, {}, SPECS)
    for name in ("frames/a.exr", "frames/.writing-b.exr", "references/r.exr", "references/mine.txt", "notes.txt"):
        (tmp_path / name).write_text("x")
    run.close()
    store.remove_run(tmp_path)
    left = sorted(str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file())
    assert left == ["notes.txt", "references/mine.txt", "run.lock"]


def test_nothing_that_is_no_run_is_removed(tmp_path: Path) -> None:
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / "a.exr").write_text("x")
    with pytest.raises(InputError, match="is no run directory"):
        store.remove_run(tmp_path)
    assert (tmp_path / "frames" / "a.exr").exists()


def test_newer_foreign_and_damaged_databases_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.sqlite"
    RunStore.create(tmp_path, {}, SPECS).close()
    database = sqlite3.connect(path)
    database.execute("PRAGMA user_version = 2")
    database.close()
    with pytest.raises(InputError, match=r"newer version \(schema 2\); this one reads up to 1"):
        store.read_facts(tmp_path)
    path.unlink()
    database = sqlite3.connect(path)
    database.execute("CREATE TABLE other (x)")
    database.close()
    with pytest.raises(InputError, match="is no run of this program"):
        store.read_facts(tmp_path)
    path.write_bytes(b"not a database at all" * 100)
    with pytest.raises(InputError, match="cannot be read"):
        store.read_cases(tmp_path)


def test_a_full_disk_is_an_error_that_names_the_run(tmp_path: Path) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    with RunStore.create(tmp_path / "run", {}, SPECS) as run:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1, hard))
        try:
            with pytest.raises(InputError, match=r"^cannot write '.*run': "):
                run.add_outcome("a", {"status": "ok"})
            with pytest.raises(InputError, match=r"^cannot write '.*new': "):
                RunStore.create(tmp_path / "new", {}, SPECS)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        run.add_outcome("b", {"status": "ok"})
    assert [c.outcome is not None for c in store.read_cases(tmp_path / "run")] == [True, False]


def test_what_is_forgotten_is_to_be_done_again_but_keeps_its_timings(tmp_path: Path) -> None:
    with RunStore.create(tmp_path, {}, SPECS) as run:
        run.add_outcome("a", {"status": "ok"})
        run.add_round(0, {"a": 0.5})
        run.forget_outcomes(["a"])
        assert [(c.outcome, c.seconds, c.is_finished) for c in run.cases()][1] == (None, (0.5,), False)


def test_folders_that_cannot_be_made_are_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="cannot write"):
        RunStore.create(tmp_path / "file" / "run", {}, SPECS)
