"""Several files written into a folder: all of them or none, each complete under its name.

They are written beside their places first and renamed only when every one is on the disk, so that a full disk or a
killed process leaves what was there before.
"""

import contextlib
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

from aliasbench.bench.frames import TEMPORARY_PREFIX
from aliasbench.scenes.errors import InputError


def make_folder(folder: Path) -> None:
    """Create a folder where it is missing; raise `InputError` where it cannot be or cannot be written to."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle, probe = tempfile.mkstemp(prefix=TEMPORARY_PREFIX, dir=folder)
        os.close(handle)
        Path(probe).unlink()
    except FileExistsError:
        raise InputError(f"cannot write into {str(folder)!r}: it is a file; a folder is needed") from None
    except (OSError, ValueError) as error:
        raise InputError(f"cannot write into {str(folder)!r}: {getattr(error, 'strerror', None) or error}") from None


def write_files(folder: Path, contents: Mapping[str, bytes]) -> list[Path]:
    """Write files into a folder that is there and return their paths.

    Raises
    ------
    InputError
        If any cannot be written; then none was.
    """
    written: list[tuple[Path, Path]] = []
    try:
        for name, content in contents.items():
            target = folder / name
            if target.is_dir():
                raise InputError(f"cannot write {str(target)!r}: it is a folder")
            handle, temporary = tempfile.mkstemp(prefix=TEMPORARY_PREFIX, dir=folder)
            written.append((Path(temporary), target))
            with os.fdopen(handle, "wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            Path(temporary).chmod(0o644)
        for path, target in written:
            path.replace(target)
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"cannot write into {str(folder)!r}: {getattr(error, 'strerror', None) or error}") from None
    finally:
        for path, _ in written:
            with contextlib.suppress(OSError):
                path.unlink(missing_ok=True)
    return [target for _, target in written]
