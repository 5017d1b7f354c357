"""Whether a run can begin or go on in a folder, and what of it must be done again.

A run goes on only as the same run: same cases, machine and versions, and its pictures still whole. A case whose picture
was deleted or damaged is forgotten, timings aside, and so done again like one that was never finished.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from aliasbench.bench import store as stores
from aliasbench.bench.frames import check_folder_name, read_image
from aliasbench.bench.store import RunStore
from aliasbench.bench.suite import Request
from aliasbench.scenes.errors import InputError


def check_folder(run_dir: Path, *, must_exist: bool) -> bool:
    """Return whether a folder holds a run.

    Raises
    ------
    InputError
        If it holds other files and no run, cannot be looked at or have pictures, or is missing and must not be.
    """
    check_folder_name(run_dir)
    try:
        if stores.holds_run(run_dir):
            return True
        if must_exist and not run_dir.exists():
            raise InputError(f"cannot resume {str(run_dir)!r}: no such folder; name a suite to begin a run there")
        if run_dir.is_dir() and not stores.is_untouched(run_dir):
            raise InputError(
                f"{str(run_dir)!r} is no run directory: it has no {stores.DATABASE}, but other files;"
                " give a new or an empty folder"
            )
    except OSError as error:
        raise InputError(f"cannot write {str(run_dir)!r}: {error.strerror or error}") from None
    return False


def stored_request(run_dir: Path) -> Request:
    """Return what a run was asked for when it began."""
    stored = stores.read_facts(run_dir)["request"]
    fields: dict[str, Any] = {key: tuple(v) if isinstance(v, list) else v for key, v in stored.items()}
    return Request(**fields)


def refuse_other_run(run_dir: Path, facts: Mapping[str, Any]) -> None:
    """Refuse to go on with a run that would not be the same run.

    Raises
    ------
    InputError
        If its cases, its machine or a version differ from those of `facts`.
    """
    old = stores.read_facts(run_dir)
    if old["plan"] != facts["plan"]:
        raise InputError(
            f"cannot resume {str(run_dir)!r}: it holds the suite {old['suite']!r} with other cases than asked for now"
            " (scenes, techniques, sizes, seeds or rounds differ); give another directory, or --fresh"
        )
    before, now = old["machine"], facts["machine"]
    for key in sorted(before.keys() | now.keys()):
        if before.get(key) != now.get(key):
            raise InputError(
                f"cannot resume {str(run_dir)!r}: its {key} was {before.get(key)!r} and is {now.get(key)!r} now; times"
                " and pictures would not belong together; give another directory, or --fresh"
            )


def forget_lost_pictures(store: RunStore) -> int:
    """Forget the outcome of every case of which a picture is missing or damaged; return how many there are."""
    whole: dict[str, bool] = {}
    lost = []
    for case in store.cases():
        pictures = case.outcome.get("images", {}).values() if case.outcome else ()
        for picture in pictures:
            if picture not in whole:
                whole[picture] = _is_whole(store.run_dir / picture, case.spec["size"])
        if not all(whole[picture] for picture in pictures):
            lost.append(str(case.spec["id"]))
    store.forget_outcomes(lost)
    return len(lost)


def _is_whole(path: Path, size: tuple[int, int]) -> bool:
    try:
        height, width = read_image(path).shape[:2]
    except InputError:
        return False
    return [width, height] == list(size)
