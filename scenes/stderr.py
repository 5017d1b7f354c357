"""The C library's stderr, silenced: image libraries write there what they also report, and on good files too.

libpng, for one, prints a line of its own before it returns its error. Who uses this project reads one sentence, so the
file descriptor is pointed elsewhere while a file is decoded; Python's `sys.stderr` alone would not do.
"""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_STDERR = 2
# The descriptor is the whole process's: two threads that swap it at once would leave it silenced for good.
_LOCK = threading.Lock()


@contextmanager
def silenced_stderr() -> Iterator[None]:
    """Discard what is written to file descriptor 2 inside the block, by any thread of the process."""
    with _LOCK:
        try:
            kept = os.dup(_STDERR)
        except OSError:
            # There is none to silence.
            yield
            return
        try:
            with Path(os.devnull).open("wb") as nowhere:
                os.dup2(nowhere.fileno(), _STDERR)
            yield
        finally:
            os.dup2(kept, _STDERR)
            os.close(kept)
