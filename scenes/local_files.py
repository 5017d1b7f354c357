"""The files that a model file names: only those beside it, and only as many bytes as anybody means to read.

A model file comes from anywhere, and what it names is opened without a question. So a name is a path within the file's
own folder or it is refused: no network, no absolute path, no way up, no link that leads out.
"""

import errno
import os
import re
import stat
from pathlib import Path
from typing import BinaryIO
from urllib.parse import unquote

from aliasbench.scenes.errors import InputError, reason_of, shortened

MOST_BYTES = 10**9  # of one file
_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")


def size_of_local(path: Path, what: str) -> int:
    """Return how many bytes a regular file of at most `MOST_BYTES` has; `what` names it in messages.

    Raises
    ------
    InputError
        If it is missing, no regular file, too large or cannot be looked at.
    """
    try:
        if not path.is_file():
            raise InputError(f"{what}: {'not a regular file' if path.exists() else 'no such file'}")
        size = path.stat().st_size
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{what}: cannot be read ({reason_of(error)})") from error
    if size > MOST_BYTES:
        raise InputError(f"{what}: has {size} bytes; at most {MOST_BYTES} are allowed")
    return size


def read_head(path: Path, what: str, count: int) -> bytes:
    """Return the first bytes of a file, of which more is read if they are of its kind; refused as by `read_local`."""
    size_of_local(path, what)
    try:
        with path.open("rb") as file:
            return file.read(count)
    except OSError as error:
        raise InputError(f"{what}: cannot be read ({reason_of(error)})") from error


def read_local(path: Path, what: str) -> bytes:
    """Return the content of a regular file of at most `MOST_BYTES`; `what` names it in messages.

    Raises
    ------
    InputError
        If it is missing, no regular file, too large or cannot be read.
    """
    size_of_local(path, what)
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{what}: cannot be read ({reason_of(error)})") from error


def open_input(path: Path) -> BinaryIO:
    """Return a file that the user names, opened to be read: a regular one, or a pipe that the process was started with.

    A named pipe (a FIFO) would wait for ever for somebody to write; what ``/dev/stdin`` stands for, or a shell's
    ``<(...)``, has no name in the file system and a writer at its other end.

    Raises
    ------
    OSError
        If it cannot be opened, or is neither.
    """
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    try:
        mode = os.fstat(descriptor).st_mode
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        if not stat.S_ISREG(mode):
            if not stat.S_ISFIFO(mode) or Path(os.path.realpath(path)).exists():
                raise OSError(errno.EINVAL, "not a regular file", str(path))
            os.set_blocking(descriptor, True)
        return os.fdopen(descriptor, "rb")
    except OSError:
        os.close(descriptor)
        raise


def is_local(path: Path) -> bool:
    """Return whether a path is that of a regular file, which can be looked at."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def path_beside(folder: Path, name: str, what: str, *, escaped: bool) -> Path:
    """Return the path of a file that a model file names, within the model file's folder.

    Parameters
    ----------
    folder : Path
        Of the model file.
    name : str
        As the model file writes it: a relative path with slashes.
    what : str
        Where it is named, for messages.
    escaped : bool
        Whether it is a URI, in which a percent sign and two digits are a byte.

    Raises
    ------
    InputError
        If it is on the network, or outside of the folder.
    """
    quoted = f"{what}: {shortened(ascii(name))}"
    inside = "a path within the model file's own folder is needed"
    if _SCHEME.match(name) or name.startswith(("//", "\\\\")):
        raise InputError(f"{quoted} is no local file; {inside}")
    relative = unquote(name, errors="strict") if escaped and _is_utf8(name) else name
    if not relative or "\0" in relative or Path(relative).is_absolute() or relative.startswith(("/", "\\")):
        raise InputError(f"{quoted} is no relative path; {inside}")
    try:
        root = folder.resolve()
        path = (root / relative).resolve()
    except (OSError, RuntimeError, ValueError) as error:
        raise InputError(f"{quoted} cannot be found ({error}); {inside}") from error
    if not path.is_relative_to(root):
        raise InputError(f"{quoted} leads out of the folder; {inside}")
    return path


def _is_utf8(name: str) -> bool:
    try:
        unquote(name, errors="strict")
    except UnicodeDecodeError:
        return False
    return True
