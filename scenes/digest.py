"""What makes two values the same: a hash over every value in them, to the bit.

Scenes and textures are equal when their digests are, and references are cached under them. Python's own hash knows no
arrays and is another one in every process.
"""

import hashlib
import struct
from collections.abc import Mapping
from dataclasses import fields, is_dataclass

import numpy as np


def content_digest(value: object) -> str:
    """Return the SHA-256 (hex) of a value made of dataclasses, containers, arrays, numbers, text and None."""
    digest = hashlib.sha256()
    _feed(digest, value)
    return digest.hexdigest()


def _feed(digest: "hashlib._Hash", value: object) -> None:
    if isinstance(value, np.ndarray):
        data = np.ascontiguousarray(value)
        digest.update(f"array{data.dtype.str}{data.shape}".encode())
        digest.update(data.tobytes())
    elif is_dataclass(value) and not isinstance(value, type):
        digest.update(type(value).__name__.encode())
        for f in fields(value):
            digest.update(f.name.encode())
            _feed(digest, getattr(value, f.name))
    elif isinstance(value, Mapping):
        digest.update(f"map{len(value)}".encode())
        for key in sorted(value):
            _feed(digest, key)
            _feed(digest, value[key])
    elif isinstance(value, (tuple, list)):
        digest.update(f"seq{len(value)}".encode())
        for item in value:
            _feed(digest, item)
    elif isinstance(value, bool) or value is None:
        digest.update(repr(value).encode())
    elif isinstance(value, (int, float, np.floating, np.integer)):
        digest.update(b"n" + struct.pack("<d", float(value)))
    elif isinstance(value, str):
        digest.update(f"s{len(value)}:{value}".encode())
    else:
        raise TypeError(f"no digest for {type(value).__name__}")
