"""Standard output and standard error as they may be found: closed, full, or read by someone who has seen enough."""

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from aliasbench.scenes.errors import InputError


def open_streams() -> bool:
    """Make both streams fit to be written, and return whether standard output leads anywhere."""
    can_print = sys.stdout is not None
    for name, number in (("stdout", 1), ("stderr", 2)):
        stream = getattr(sys, name)
        if stream is None:
            # Closed by whoever started this: a file opened later must not get its number, and with it C's messages.
            _discard(number)
            setattr(sys, name, os.fdopen(number, "w", closefd=False))
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    return can_print


def discard_output() -> None:
    """Let what is still to be printed vanish, also at exit."""
    _discard(sys.stdout.fileno())


def _discard(number: int) -> None:
    nowhere = os.open(os.devnull, os.O_WRONLY)
    if nowhere != number:
        os.dup2(nowhere, number)
        os.close(nowhere)


@contextmanager
def writing_output() -> Iterator[None]:
    """Write to standard output, to the end, and name it where that fails.

    Raises
    ------
    InputError
        If it cannot be written.
    BrokenPipeError
        If nobody reads on.
    """
    try:
        yield
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        discard_output()
        raise InputError(f"cannot write standard output: {error.strerror or error}") from None
