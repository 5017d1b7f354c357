"""A glTF 2.0 file taken apart: its JSON, strictly read, and the bytes it refers to. Nothing is trusted.

Every index, offset, length and name in a file is an instruction to whoever reads it, so each is checked here against
what there is before it is followed. Counts are bounded by bytes that exist: no few characters can ask for gigabytes.
Source: Khronos, glTF 2.0 specification (ISO/IEC 12113), sections 3.6 (binary data) and 4 (GLB).
"""

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.errors import InputError, unknown_name
from aliasbench.scenes.gltf_buffers import Buffers
from aliasbench.scenes.local_files import read_head, read_local, size_of_local
from aliasbench.scenes.problems import Problems
from aliasbench.scenes.schema import Table

LISTS = (
    *("accessors", "animations", "bufferViews", "buffers", "cameras", "images"),
    *("materials", "meshes", "nodes", "samplers", "scenes", "textures"),
)
_EXTENSIONS = ("KHR_texture_transform", "KHR_mesh_quantization", "KHR_lights_punctual", "KHR_node_visibility")
_MOST_MARKS = 4_000_000  # brackets and commas: what the JSON comes to in memory
_MOST_TEXT = 64_000_000  # bytes of JSON
_MOST_NODES = 100_000
_MOST_ENTRIES = 200_000  # of any other list
_COMPONENTS: Mapping[int, str] = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS: Mapping[str, int] = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


@dataclass(frozen=True, slots=True, eq=False)
class Document:
    """A glTF file: its JSON as tables, by list, and its buffers.

    Attributes
    ----------
    root : Table
    lists : mapping of str to sequence of Table
        The entries of the top-level lists (`LISTS`).
    buffers : Buffers
    folder : Path
        Where the files that it names must be.
    size : int
        Bytes of the file and its buffers.
    """

    root: Table
    lists: Mapping[str, Sequence[Table]]
    buffers: Buffers
    folder: Path
    size: int

    def follow(self, table: Table, key: str, kind: str) -> tuple[int, Table] | None:
        """Return the index under a key and the entry of a top-level list that it is of, None where there is no key."""
        if not table.has(key):
            return None
        index = table.whole(key, at_least=0)
        if index >= len(self.lists[kind]):
            table.refuse(key, f"an index of {kind}, of which there are {len(self.lists[kind])}")
        return index, self.lists[kind][index]

    def indices(self, table: Table, key: str, kind: str) -> list[int]:
        """Return the indices under a key, all of a top-level list; none where there is no key."""
        value = table.values.get(key, [])
        count = len(self.lists[kind])
        if not isinstance(value, list) or not all(type(i) is int and 0 <= i < count for i in value):
            table.refuse(key, f"a list of indices of {kind}, of which there are {count}")
        return list(value)

    def view(self, table: Table, key: str = "bufferView") -> NDArray[np.uint8]:
        """Return the bytes of the buffer view under a key, which must be there."""
        found = self.follow(table, key, "bufferViews")
        if found is None:
            table.refuse(key, "an index of bufferViews")
        view = found[1]
        target = self.follow(view, "buffer", "buffers")
        if target is None:
            view.refuse("buffer", "an index of buffers")
        buffer = self.buffers.bytes_of(target[0])
        start, length = view.whole("byteOffset", 0, at_least=0), view.whole("byteLength", at_least=1)
        if start + length > len(buffer):
            view.refuse("byteLength", f"at most {max(0, len(buffer) - start)}, what the buffer has from byte {start}")
        return buffer[start : start + length]

    def accessor(self, table: Table, key: str, types: Sequence[str]) -> NDArray[np.generic]:
        """Return the values (count, width) of the accessor under a key, which must be there; integers as they are
        stored, but those said to be normalized as float64.

        Parameters
        ----------
        types : sequence of str
            What it may be: ``SCALAR``, ``VEC2``, ``VEC3``, ``VEC4``.
        """
        found = self.follow(table, key, "accessors")
        if found is None:
            table.refuse(key, "an index of accessors")
        accessor = found[1]
        kind = accessor.text("type")
        if kind not in types:
            accessor.refuse("type", f"{' or '.join(types)}, as {table.where(key)} needs")
        width, count = _WIDTHS[kind], accessor.whole("count", at_least=1)
        dtype = _component(accessor)
        if count > self.size:
            accessor.refuse("count", f"at most {self.size}, the bytes of the file")
        if accessor.has("bufferView"):
            values = self._elements(accessor, dtype, count, width)
        elif accessor.has("sparse"):
            values = np.zeros((count, width), dtype)
        else:
            accessor.refuse("bufferView", "an index of bufferViews")
        if accessor.has("sparse"):
            values = self._with_sparse(accessor.table("sparse"), values)
        if accessor.values.get("normalized") is True and dtype.kind in "iu":
            bits = 8 * dtype.itemsize - (dtype.kind == "i")
            shares: NDArray[np.float64] = np.maximum(values.astype(np.float64) / (2**bits - 1), -1.0)
            return shares
        return values

    def _elements(self, table: Table, dtype: np.dtype[np.generic], count: int, width: int) -> NDArray[np.generic]:
        """Return the (count, width) elements that start at a table's byteOffset of its buffer view."""
        data = self.view(table)
        start, size = table.whole("byteOffset", 0, at_least=0), dtype.itemsize * width
        stride = self.lists["bufferViews"][table.whole("bufferView", at_least=0)].whole("byteStride", size, at_least=1)
        needed = start + stride * (count - 1) + size
        if stride < size or needed > len(data):
            table.refuse(
                "count" if table.has("count") else "bufferView",
                f"of fewer elements: {count} of {size} bytes, {stride} apart from byte {start} on, need {needed} bytes "
                f"of a buffer view that has {len(data)}",
            )
        strides = (stride, dtype.itemsize)
        return np.ndarray((count, width), dtype, buffer=data.data, offset=start, strides=strides)

    def _with_sparse(self, sparse: Table, values: NDArray[np.generic]) -> NDArray[np.generic]:
        count = sparse.whole("count", at_least=1)
        if count > len(values):
            sparse.refuse("count", f"at most {len(values)}, the elements of the accessor")
        where, what = sparse.table("indices"), sparse.table("values")
        places = self._elements(where, _component(where, ("u1", "<u2", "<u4")), count, 1)[:, 0].astype(np.int64)
        if int(places.max()) >= len(values):
            raise InputError(
                f"{sparse.file}: {sparse.path}: index {int(places.max())} is beyond {len(values)} elements"
            )
        out = values.copy()
        out[places] = self._elements(what, values.dtype, count, values.shape[1])
        return out


def read_document(path: Path) -> Document:
    """Return a ``.glb`` or ``.gltf`` file as a document; which of them is seen from its first bytes.

    Raises
    ------
    InputError
        If it is truncated or damaged, of another version, needs an extension that is not known, or names a file that is
        not there or not beside it.
    """
    file = str(path)
    binary_form = read_head(path, file, 4) == b"glTF"
    if not binary_form and (size := size_of_local(path, file)) > _MOST_TEXT:
        raise InputError(f"{file}: is no GLB file, and has {size} bytes; at most {_MOST_TEXT} of glTF JSON are allowed")
    data = read_local(path, file)
    text, binary = _split(data, file) if binary_form else (data, None)
    root = Table(Problems(file), "", _parse(text, file))
    version = root.table("asset").text("version")
    if not version.startswith("2."):
        root.table("asset").refuse("version", "2.0, the version of glTF that is read")
    for name in _texts(root, "extensionsRequired"):
        if name not in _EXTENSIONS and not name.startswith("KHR_materials_"):
            problem = unknown_name("required extension", name, (*_EXTENSIONS, "KHR_materials_..."))
            raise InputError(f"{file}: extensionsRequired: {problem}")
    for key in LISTS:
        listed, most = root.values.get(key), _MOST_NODES if key == "nodes" else _MOST_ENTRIES
        if isinstance(listed, list) and len(listed) > most:
            raise InputError(f"{file}: {key}: there are {len(listed)}; at most {most} are allowed")
    lists = {key: entries(root, key) for key in LISTS}
    buffers = Buffers(lists["buffers"], binary, path.parent)
    return Document(root, lists, buffers, path.parent, len(data) + buffers.size)


def as_reals(values: NDArray[np.generic]) -> NDArray[np.float64]:
    """Return values as float64, a copy."""
    # Damaged files hold signalling NaNs, of which numpy warns; that they are none is for the caller to say.
    with np.errstate(invalid="ignore"):
        return values.astype(np.float64)


def entries(table: Table, key: str) -> list[Table]:
    """Return the objects of a list of objects, none where there is no key."""
    value = table.values.get(key, [])
    if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
        table.refuse(key, "a list of objects")
    return table.tables(key)


def _texts(table: Table, key: str) -> list[str]:
    value = table.values.get(key, [])
    if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
        table.refuse(key, "a list of texts")
    return [str(name) for name in value]


def _component(table: Table, allowed: Sequence[str] = tuple(_COMPONENTS.values())) -> np.dtype[np.generic]:
    name = _COMPONENTS.get(table.whole("componentType", at_least=0))
    if name is None or name not in allowed:
        known = [str(number) for number, each in _COMPONENTS.items() if each in allowed]
        table.refuse("componentType", f"one of {', '.join(known)}")
    return np.dtype(name)


def _split(data: bytes, file: str) -> tuple[bytes, bytes | None]:
    """Return the JSON and the binary chunk of a GLB file."""
    if len(data) < 20:
        raise InputError(f"{file}: has {len(data)} bytes; a GLB file has 20 at least (cut off?)")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise InputError(f"{file}: is GLB version {version}; version 2 is read")
    if length > len(data):
        raise InputError(f"{file}: should have {length} bytes and has {len(data)} (cut off?)")
    chunks: dict[bytes, bytes] = {}
    start = 12
    while start + 8 <= length:
        size, kind = struct.unpack_from("<I4s", data, start)
        if start + 8 + size > length:
            raise InputError(f"{file}: the chunk at byte {start} has {size} bytes, beyond the file's end (cut off?)")
        chunks.setdefault(kind, data[start + 8 : start + 8 + size])
        start += 8 + size
        start += -start % 4
    if b"JSON" not in chunks:
        raise InputError(f"{file}: has no JSON chunk; a GLB file needs one")
    return chunks[b"JSON"], chunks.get(b"BIN\0")


def _parse(text: bytes, file: str) -> dict[str, object]:
    if len(text) > _MOST_TEXT:
        raise InputError(f"{file}: has {len(text)} bytes of JSON; at most {_MOST_TEXT} are allowed")
    if text[:100].removeprefix(b"\xef\xbb\xbf").lstrip()[:1] not in (b"{", b"[", b""):
        raise InputError(f"{file}: is neither GLB nor glTF JSON, which begins with '{{'")
    if text.count(b",") + text.count(b"[") + text.count(b"{") > _MOST_MARKS:
        raise InputError(f"{file}: its JSON has more than {_MOST_MARKS} values; fewer are allowed")
    try:
        document = json.loads(text.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise InputError(f"{file}: byte {error.start} of its JSON is not UTF-8") from error
    except json.JSONDecodeError as error:
        raise InputError(f"{file}: line {error.lineno}, column {error.colno}: not valid JSON: {error.msg}") from error
    except (RecursionError, ValueError) as error:
        raise InputError(f"{file}: its JSON is nested too deeply, or has a number too long, to be a model") from error
    if not isinstance(document, dict):
        raise InputError(f"{file}: is no JSON object; a glTF file is one")
    return document
