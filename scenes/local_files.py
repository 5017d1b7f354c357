"""The files that a model file names: only those beside it, and only as many bytes as anybody means to read.

A model file comes from anywhere, and what it names is opened without a question. So a name is a path within the file's
own folder or it is refused: no network, no absolute path, no way up, no link that leads out.
"""

import re
from pathlib import Path
from urllib.parse import unquote

from aliasbench.scenes.errors import InputError, shortened

MOST_BYTES = 10**9  # of one file
_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")


def read_local(path: Path, what: str) -> bytes:
    """Return the content of a regular file of at most `MOST_BYTES`; `what` names it in messages.

    Raises
    ------
    InputError
        If it is missing, no regular file, too large or cannot be read.
    """
    try:
        if not path.is_file():
            raise InputError(f"{what}: {'not a regular file' if path.exists() else 'no such file'}")
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise InputError(f"{what}: has {size} bytes; at most {MOST_BYTES} are allowed")
        return path.read_bytes()
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{what}: cannot be read ({reason})") from error


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
