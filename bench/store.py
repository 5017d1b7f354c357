"""The run directory: what a run has found so far, safe against being killed at any moment.

    RUN_DIR/run.sqlite          the plan, the machine, outcomes and raw timings (SQLite, write-ahead log)
    RUN_DIR/frames/ID.exr       frame 0 of each case
    RUN_DIR/references/ID.exr   frame 0 of the references
    RUN_DIR/run.lock            held while a process writes

A case is committed in one transaction after its picture is complete on disk, a round of timings in another; so whatever
is in the store is true, and what is not there is done again. One writer at a time, any number of readers.
"""

import fcntl
import json
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from aliasbench.bench.frames import remove_unfinished
from aliasbench.scenes.errors import InputError

SCHEMA = 1
DATABASE = "run.sqlite"
LOCK = "run.lock"
FRAMES = "frames"
REFERENCES = "references"

_TABLES = """
CREATE TABLE run (key TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE cases (id TEXT PRIMARY KEY, position INTEGER NOT NULL, spec TEXT NOT NULL);
CREATE TABLE outcomes (id TEXT PRIMARY KEY REFERENCES cases, outcome TEXT NOT NULL, trace TEXT);
CREATE TABLE timings (
    id TEXT NOT NULL REFERENCES cases, round INTEGER NOT NULL, seconds REAL NOT NULL, PRIMARY KEY (id, round)
);
"""

Json = Mapping[str, Any]  # what was read from JSON


@dataclass(frozen=True, slots=True)
class StoredCase:
    """A case's plan, its outcome (None while it is not done) and its raw timings in seconds, round after round."""

    spec: Json
    outcome: Json | None
    seconds: tuple[float, ...]

    @property
    def is_finished(self) -> bool:
        """Whether nothing is left to do: it did not come out ok, or every round is timed."""
        if self.outcome is None:
            return False
        return self.outcome["status"] != "ok" or len(self.seconds) >= int(self.spec["rounds"])


def holds_run(run_dir: Path) -> bool:
    """Return whether a folder holds a run."""
    return (run_dir / DATABASE).is_file()


def is_untouched(run_dir: Path) -> bool:
    """Return whether a folder holds nothing, or only what a run leaves that was killed before it began."""
    begun = (LOCK, FRAMES, REFERENCES)
    return all(path.name in begun or path.name.startswith(f".{DATABASE}") for path in run_dir.iterdir())


def remove_run(run_dir: Path) -> None:
    """Remove a run from its folder: the files a run makes, and nothing else."""
    read_facts(run_dir)
    lock = acquire_lock(run_dir)
    try:
        for folder in (run_dir / FRAMES, run_dir / REFERENCES):
            for picture in folder.glob("*.exr"):
                picture.unlink()
            remove_unfinished(folder)
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()
        # The database goes last: while it is there, the folder is still known to hold a run.
        for suffix in ("-wal", "-shm", ""):
            (run_dir / f"{DATABASE}{suffix}").unlink(missing_ok=True)
    finally:
        os.close(lock)


class RunStore:
    """A run directory open for writing, by this process alone; a context manager. Made by `create` and `reopen`."""

    def __init__(self, run_dir: Path, connection: sqlite3.Connection, lock: int) -> None:
        self.run_dir = run_dir
        self._connection = connection
        self._lock = lock

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @classmethod
    def create(cls, run_dir: Path, facts: Json, specs: Sequence[Json]) -> Self:
        """Return the store of a new run. `facts` describe it (suite, request, machine); `specs` are its cases.

        Raises
        ------
        InputError
            If the folder cannot be made or written, holds a run already, or another process writes there.
        """
        lock = acquire_lock(run_dir)
        try:
            if holds_run(run_dir):
                raise InputError(
                    f"{str(run_dir)!r} holds a run already: go on with --resume, or replace it with --fresh"
                )
            # Made under another name: a database under its own name is always whole.
            unfinished = run_dir / f".{DATABASE}"
            for suffix in ("", "-wal", "-shm", "-journal"):
                (run_dir / f".{DATABASE}{suffix}").unlink(missing_ok=True)
            with _writing(run_dir), closing(sqlite3.connect(unfinished)) as connection, connection:
                connection.executescript(f"BEGIN; {_TABLES} COMMIT;")
                connection.execute(f"PRAGMA user_version = {SCHEMA}")
                connection.executemany("INSERT INTO run VALUES (?, ?)", [(k, _dump(v)) for k, v in facts.items()])
                rows = [(str(s["id"]), i, _dump(s)) for i, s in enumerate(specs)]
                connection.executemany("INSERT INTO cases VALUES (?, ?, ?)", rows)
            unfinished.replace(run_dir / DATABASE)
        except BaseException:
            os.close(lock)
            raise
        return cls._open(run_dir, lock)

    @classmethod
    def reopen(cls, run_dir: Path) -> Self:
        """Return the store of a run that is to go on.

        Raises
        ------
        InputError
            If the folder holds no run, one of a newer version, or one that another process is writing.
        """
        read_facts(run_dir)
        return cls._open(run_dir, acquire_lock(run_dir))

    @classmethod
    def _open(cls, run_dir: Path, lock: int) -> Self:
        try:
            with _writing(run_dir):
                for folder in (FRAMES, REFERENCES):
                    (run_dir / folder).mkdir(exist_ok=True)
                    remove_unfinished(run_dir / folder)
                connection = sqlite3.connect(run_dir / DATABASE)
                connection.execute("PRAGMA journal_mode = WAL")
                connection.execute("PRAGMA synchronous = FULL")
        except InputError:
            os.close(lock)
            raise
        return cls(run_dir, connection, lock)

    def close(self) -> None:
        """Fold the log into the database, so that the run is one file again, and let go of the folder."""
        try:
            with _writing(self.run_dir), closing(self._connection):
                self._connection.execute("PRAGMA journal_mode = DELETE")
        finally:
            os.close(self._lock)

    def cases(self) -> list[StoredCase]:
        """Return every case of the plan, in its order, with what is known of it."""
        return _cases(self._connection)

    def add_outcome(self, case_id: str, outcome: Json, *, trace: str | None = None) -> None:
        """Commit how a case came out; replaces an earlier outcome. `trace` is for whoever looks for a bug."""
        with _writing(self.run_dir), self._connection:
            row = (case_id, _dump(outcome), trace)
            self._connection.execute("INSERT OR REPLACE INTO outcomes VALUES (?, ?, ?)", row)

    def add_round(self, number: int, seconds: Mapping[str, float]) -> None:
        """Commit one round of timings: seconds by case id."""
        with _writing(self.run_dir), self._connection:
            rows = [(case_id, number, value) for case_id, value in seconds.items()]
            self._connection.executemany("INSERT OR IGNORE INTO timings VALUES (?, ?, ?)", rows)

    def forget_outcomes(self, case_ids: Iterable[str]) -> None:
        """Commit that these cases are to be done again; their timings stay."""
        with _writing(self.run_dir), self._connection:
            self._connection.executemany("DELETE FROM outcomes WHERE id = ?", [(i,) for i in case_ids])


@contextmanager
def _writing(run_dir: Path) -> Iterator[None]:
    """Name the folder in whatever goes wrong while it is written: SQLite's own words name nothing."""
    try:
        yield
    except (OSError, sqlite3.Error) as error:
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        raise InputError(f"cannot write {str(run_dir)!r}: {reason}") from None


def acquire_lock(run_dir: Path) -> int:
    """Return the descriptor of the folder's lock, made with the folder; closing it, or dying, lets go.

    Raises
    ------
    InputError
        If the folder cannot be made or written, or another process holds the lock.
    """
    try:
        run_dir.mkdir(parents=True, exist_ok=True)
        lock = os.open(run_dir / LOCK, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise InputError(f"cannot write {str(run_dir)!r}: {error.strerror or error}") from None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(lock)
        raise InputError(f"{str(run_dir)!r} is being written by another process") from None
    return lock


def read_facts(run_dir: Path) -> dict[str, Any]:
    """Return what describes a run (suite, request, machine, when it began); opens it for reading only.

    Raises
    ------
    InputError
        If the folder holds no run, or one of a newer version.
    """
    connection = _connect_read_only(run_dir)
    try:
        return {key: json.loads(value) for key, value in connection.execute("SELECT key, value FROM run")}
    except sqlite3.Error as error:
        raise InputError(f"{str(run_dir / DATABASE)!r} is damaged: {error}") from None
    finally:
        connection.close()


def read_cases(run_dir: Path) -> list[StoredCase]:
    """Return every case of a run in the order of its plan; opens it for reading only. Errors as `read_facts`."""
    connection = _connect_read_only(run_dir)
    try:
        return _cases(connection)
    except sqlite3.Error as error:
        raise InputError(f"{str(run_dir / DATABASE)!r} is damaged: {error}") from None
    finally:
        connection.close()


def _connect_read_only(run_dir: Path) -> sqlite3.Connection:
    path = run_dir / DATABASE
    try:
        if not run_dir.is_dir():
            raise InputError(f"{str(run_dir)!r}: no such run directory")
        if not path.is_file():
            raise InputError(f"{str(run_dir)!r} is no run directory: it has no {DATABASE}")
    except OSError as error:
        raise InputError(f"run directory {str(run_dir)!r}: cannot be read ({error.strerror or error})") from None
    log = run_dir / f"{DATABASE}-wal"
    # A finished run may lie on a medium that nobody can write to, where SQLite cannot make its shared memory.
    mode = "mode=ro" if log.exists() or os.access(run_dir, os.W_OK) else "immutable=1"
    try:
        connection = sqlite3.connect(f"{path.resolve().as_uri()}?{mode}", uri=True)
        (version,) = connection.execute("PRAGMA user_version").fetchone()
    except sqlite3.Error as error:
        raise InputError(f"{str(path)!r} cannot be read: {error}") from None
    if version > SCHEMA:
        connection.close()
        raise InputError(
            f"{str(run_dir)!r} was written by a newer version (schema {version}); this one reads up to {SCHEMA}"
        )
    if version < 1:
        connection.close()
        raise InputError(f"{str(path)!r} is no run of this program")
    return connection


def _cases(connection: sqlite3.Connection) -> list[StoredCase]:
    seconds: dict[str, list[float]] = {}
    for case_id, value in connection.execute("SELECT id, seconds FROM timings ORDER BY round"):
        seconds.setdefault(case_id, []).append(value)
    query = "SELECT cases.id, spec, outcome FROM cases LEFT JOIN outcomes USING (id) ORDER BY position"
    return [
        StoredCase(json.loads(spec), json.loads(outcome) if outcome else None, tuple(seconds.get(case_id, ())))
        for case_id, spec, outcome in connection.execute(query)
    ]


def _dump(value: object) -> str:
    return json.dumps(value, allow_nan=False)
