"""Several files written into a folder: all of them or none, each complete under its name.

They are written beside their places first and renamed only when every one is on the disk, in the order given; what
they replace is kept until the last is in its place, and put back if one cannot be. A full disk so leaves what was there
before. A process killed between two renames leaves some files new and some old, each complete: the one that names the
others belongs last.
"""

import contextlib
import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from aliasbench.bench.frames import make_temporary
from aliasbench.scenes.errors import InputError, reason_of


def make_folder(folder: Path) -> None:
    """Create a folder where it is missing; raise `InputError` where it cannot be or cannot be written to."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        make_temporary(folder).unlink()
    except FileExistsError:
        raise InputError(f"cannot write into {str(folder)!r}: it is a file; a folder is needed") from None
    except (OSError, ValueError) as error:
        raise InputError(f"cannot write into {str(folder)!r}: {reason_of(error)}") from None


def write_files(folder: Path, contents: Mapping[str, bytes]) -> list[Path]:
    """Write files into a folder that is there and return their paths.

    Raises
    ------
    InputError
        If any cannot be written; then none was, and what was there before is there again.
    """
    written: list[tuple[Path, Path]] = []
    try:
        for name, content in contents.items():
            target = folder / name
            if target.is_dir():
                raise InputError(f"cannot write {str(target)!r}: it is a folder")
            temporary = make_temporary(folder)
            written.append((temporary, target))
            with temporary.open("wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
        _rename(written)
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"cannot write into {str(folder)!r}: {reason_of(error)}") from None
    finally:
        for temporary, _ in written:
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)
    return [target for _, target in written]


def _rename(written: Iterable[tuple[Path, Path]]) -> None:
    """Put every file in its place, or leave every place as it was."""
    with contextlib.ExitStack() as undo:
        replaced = []
        for temporary, target in written:
            if os.path.lexists(target):
                old = _keep(target, temporary.with_name(f"{temporary.name}-old"))
                replaced.append(old)
                undo.callback(_put_back, old, target)
                temporary.replace(target)
            else:
                temporary.replace(target)
                undo.callback(target.unlink, missing_ok=True)
        undo.pop_all()
    for old in replaced:
        with contextlib.suppress(OSError):
            old.unlink()


def _keep(target: Path, old: Path) -> Path:
    """Give a file a second name; where the file system has no such thing, the second name alone."""
    try:
        os.link(target, old, follow_symlinks=False)
    except OSError:
        target.rename(old)
    return old


def _put_back(old: Path, target: Path) -> None:
    old.replace(target)
    # Two names of one file are both left by a renaming.
    old.unlink(missing_ok=True)
