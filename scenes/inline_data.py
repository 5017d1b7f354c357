"""Data inside a scene file: images and long arrays as base64 texts, so that one file can hold a whole scene.

A data URI says what it is. Images are files of any format that `textures.load_image` reads
(``data:image/png;base64,...``, ``data:image/x-exr;base64,...``: EXR keeps float32 texels to the bit). Arrays are
``data:application/octet-stream;base64,...`` of little-endian float64 (coordinates) or int32 (indices), row after row: a
mesh of a hundred thousand triangles as decimal text would be several times as large, and take Python's TOML reader many
seconds.
"""

import base64
import binascii
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.errors import shortened
from aliasbench.scenes.model import FloatArray
from aliasbench.scenes.schema import Table, between

DATA_PREFIX = "data:"
ARRAY_PREFIX = "data:application/octet-stream;base64,"
MAX_IMAGE_BYTES = 64 * 2**20  # of one image's file inside a scene file
# Formats by the media types under which images are inlined.
IMAGE_SUFFIXES = {"png": ".png", "x-exr": ".exr", "jpeg": ".jpg", "tiff": ".tif", "vnd.radiance": ".hdr"}
_URI = re.compile(r"data:([a-z]+/[a-z0-9.+-]+);base64,", re.IGNORECASE)


def encode_data(media: str, content: bytes) -> str:
    """Return a data URI of bytes, for example of media type ``image/x-exr``."""
    return f"{DATA_PREFIX}{media};base64,{base64.b64encode(content).decode('ascii')}"


def encode_array(rows: NDArray[np.generic]) -> str:
    """Return a data URI of an array of float64 or int32."""
    return encode_data("application/octet-stream", rows.astype(rows.dtype.newbyteorder("<")).tobytes())


def decode_image(text: str) -> tuple[str, bytes]:
    """Return the file suffix and the bytes of an image's data URI.

    Raises
    ------
    ValueError
        Saying what is wrong with it.
    """
    head = _URI.match(text)
    kind = head[1].lower().removeprefix("image/") if head else ""
    if head is None or kind not in IMAGE_SUFFIXES:
        known = ", ".join(f"data:image/{name};base64," for name in IMAGE_SUFFIXES)
        raise ValueError(f"begins {shortened(text[: head.end() if head else 30])!r}; known: {known}")
    if len(text) > MAX_IMAGE_BYTES * 4 // 3:
        raise ValueError(f"holds more than {MAX_IMAGE_BYTES >> 20} MiB; put the image beside the scene file")
    return IMAGE_SUFFIXES[kind], _decode(text, head.end())


def read_rows(table: Table, key: str, width: int, *, limit: float) -> FloatArray:
    """Return an array (n, width) of float64 from -limit to limit: a list of points, or a data URI of float64."""
    value = table.values.get(key)
    if not isinstance(value, str):
        return table.points(key, width, limit=limit)
    rows = _read_array(table, key, value, width, np.dtype("<f8"))
    if len(rows) and not bool((np.abs(rows) <= limit).all()):
        table.report(key, f"rows of {width} finite numbers each{between(limit)}")
        return np.empty((0, width))
    return rows.astype(np.float64)


def read_triangles(table: Table, key: str, vertex_count: int) -> NDArray[np.int32]:
    """Return indices (m, 3) of vertices: a list of triples of whole numbers, or a data URI of int32.

    Without the key every three vertices are a triangle.
    """
    none = np.empty((0, 3), dtype=np.int32)
    if not table.has(key):
        if vertex_count == 0 or vertex_count % 3:
            table.report(key, f"given where the number of vertices, {vertex_count}, is no multiple of 3")
            return none
        return np.arange(vertex_count, dtype=np.int32).reshape(-1, 3)
    value = table.values[key]
    allowed = f"a list of triples of whole numbers from 0 to {vertex_count - 1}, at least one"
    if isinstance(value, str):
        rows = _read_array(table, key, value, 3, np.dtype("<i4")).astype(np.int32)
        if len(rows) == 0:
            return none
    elif isinstance(value, list) and value and all(_is_triple(row) for row in value):
        rows = np.array(value, dtype=np.int32)
    else:
        table.report(key, allowed)
        return none
    if rows.min() < 0 or rows.max() >= vertex_count:
        table.report(key, allowed)
        return none
    return rows


def _is_triple(row: object) -> bool:
    if not isinstance(row, Sequence) or len(row) != 3:
        return False
    return all(isinstance(k, int) and not isinstance(k, bool) and 0 <= k < 2**31 for k in row)


def _read_array(table: Table, key: str, text: str, width: int, dtype: np.dtype[np.generic]) -> NDArray[np.generic]:
    """Return an array (n, width) from a data URI; of what is none, the empty stand-in after a report."""
    problem = f"begins {text[:40]!r}" if not text.startswith(ARRAY_PREFIX) else None
    content = b""
    if problem is None:
        try:
            content = _decode(text, len(ARRAY_PREFIX))
        except ValueError as error:
            problem = str(error)
        else:
            if not content or len(content) % (width * dtype.itemsize):
                problem = f"holds {len(content)} bytes, no multiple of {width * dtype.itemsize}"
    if problem is not None:
        kind = "float64" if dtype.kind == "f" else "int32"
        table.fail(
            key,
            f"{table.where(key)}: the data {problem}; rows of {width} little-endian {kind} under {ARRAY_PREFIX} are "
            "allowed, or a list",
        )
        return np.empty((0, width), dtype=dtype)
    return np.frombuffer(content, dtype=dtype).reshape(-1, width)


def _decode(text: str, start: int) -> bytes:
    try:
        return base64.b64decode(text[start:].encode("ascii"), validate=True)
    except (binascii.Error, UnicodeEncodeError):
        raise ValueError("is not base64") from None
