"""References kept between runs, found by what they are a picture of.

The key is a hash of everything that enters a reference: the scene's content, the size, the frame, the technique's
fields that a reference knows, and the version of the algorithm. A file carries a checksum of its data, so that a
damaged or half-written one is made anew; it gets its name when it is whole, so two writers are safe. A cache that
cannot be written costs time, not correctness.
"""

import contextlib
import hashlib
import io
import os
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aliasbench.renderers.kernel_cache import cache_root
from aliasbench.scenes.model import FloatArray

_DIGEST_SIZE = 32
_MAGIC = b"aliasbench reference 1\n"


@dataclass(frozen=True, slots=True, eq=False)
class Stored:
    """A finished reference: pixels (h, w, 3), the largest uncertainty, and the samples it took."""

    pixels: FloatArray
    uncertainty: float
    samples: int


def cache_folder() -> Path:
    """Return the folder of the references: `references` below ALIASBENCH_CACHE or the user's cache folder."""
    given = os.environ.get("ALIASBENCH_CACHE")
    return (Path(given) if given else cache_root()) / "references"


def fetch(key: str, make: Callable[[], Stored]) -> Stored:
    """Return the reference stored under a key, or make and store it; equal bit for bit either way."""
    path = cache_folder() / f"{key}.npz"
    found = _read(path)
    if found is not None:
        return found
    made = make()
    _write(path, made)
    return made


def _read(path: Path) -> Stored | None:
    """Return what a file holds, None if there is none or it is damaged."""
    try:
        data = path.read_bytes()
    except OSError:
        return None
    head = len(_MAGIC) + _DIGEST_SIZE
    body = data[head:]
    if data[: len(_MAGIC)] != _MAGIC or hashlib.sha256(body).digest() != data[len(_MAGIC) : head]:
        return None
    try:
        with np.load(io.BytesIO(body), allow_pickle=False) as arrays:
            return Stored(arrays["pixels"], float(arrays["uncertainty"]), int(arrays["samples"]))
    except (OSError, ValueError, KeyError, zipfile.BadZipFile):
        return None


def _write(path: Path, stored: Stored) -> None:
    buffer = io.BytesIO()
    np.savez(buffer, pixels=stored.pixels, uncertainty=stored.uncertainty, samples=stored.samples)
    body = buffer.getvalue()
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=path.stem[:16], suffix=".part")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(_MAGIC + hashlib.sha256(body).digest() + body)
            Path(name).replace(path)
        except OSError:
            Path(name).unlink(missing_ok=True)
            raise
