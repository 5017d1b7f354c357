"""PLY files, ascii and binary: vertices, texture coordinates, colours, and faces of any number of corners.

A PLY file says in its header what each number is; elements and properties that are not needed are stepped over. Values
come as one block where every element has the same size, which is what a million triangles need to be read in a
second; faces of different sizes are walked one by one.
Colours of integer type are sRGB, of float type linear, as images are. Source: G. Turk, The PLY Polygon File Format.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.errors import InputError, shortened
from aliasbench.scenes.mesh_parts import Part, check_amount, parse_numbers
from aliasbench.scenes.mesh_polygons import cut_faces
from aliasbench.scenes.model import FloatArray
from aliasbench.scenes.textures import srgb_to_linear

_TYPES: Mapping[str, str] = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "float": "f4",
    "double": "f8",
    "float32": "f4",
    "float64": "f8",
}
_ORDERS: Mapping[str, str] = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}
_UV_NAMES = (("u", "v"), ("s", "t"), ("texture_u", "texture_v"))
_MOST_HEADER = 2**16
_CORNERS = ("vertex_indices", "vertex_index")


@dataclass(frozen=True, slots=True)
class _Property:
    name: str
    kind: str
    counted_by: str  # the type of a list's length; empty for a number


@dataclass(frozen=True, slots=True)
class _Element:
    name: str
    count: int
    properties: tuple[_Property, ...]


# A number for each element; or its lists, (n, k) all of one length, or several such blocks.
Column = NDArray[np.generic] | list[NDArray[np.generic]]


def read_ply(data: bytes, file: str) -> list[Part]:
    """Return the triangles of a PLY file's content as one part.

    Raises
    ------
    InputError
        If it is cut off or damaged, has no vertices or faces, or more than are drawn.
    """
    order, elements, start = _read_header(data, file)
    columns: dict[str, dict[str, Column]] = {}
    body = np.frombuffer(data, np.uint8)[start:] if order else _numbers_of(data, start, file)
    reader = _Reader(body, order, file)
    for element in elements:
        if element.count > len(data):
            raise InputError(f"{file}: element {element.name} has a count of {element.count}; the file is smaller")
        columns[element.name] = reader.read(element)
        # The numbers of a text say nothing of where a line ends: that all of them are used tells that they are right.
        if order and {"vertex", "face"} <= columns.keys():
            break
    if not order and reader.left:
        raise InputError(f"{file}: has {reader.left} numbers more than the elements of its header have")
    kinds = {p.name: p.kind for e in elements if e.name == "vertex" for p in e.properties}
    vertex = {k: c for k, c in columns.get("vertex", {}).items() if isinstance(c, np.ndarray) and c.ndim == 1}
    face = columns.get("face", {})
    if not {"x", "y", "z"} <= vertex.keys():
        raise InputError(f"{file}: has no vertices with x, y and z; a PLY mesh needs them")
    corners = next((face[name] for name in _CORNERS if name in face), None)
    if corners is None:
        raise InputError(f"{file}: has no faces with vertex_indices; a PLY mesh needs them")
    faces = [block for block in (corners if isinstance(corners, list) else [corners]) if block.ndim == 2]
    count = sum(len(block) * max(0, block.shape[1] - 2) for block in faces)
    colors = _colors(vertex, kinds)
    check_amount(file, len(vertex["x"]), count, len(data), colored=0 if colors is None else count)
    positions = _stack(vertex, ("x", "y", "z"))
    cut = [_cut(_as_indices(block, file), positions) for block in faces if block.shape[1] > 2]
    triangles = np.concatenate([np.empty((0, 3), np.int32), *cut])
    uv = next((_stack(vertex, names) for names in _UV_NAMES if set(names) <= vertex.keys()), None)
    return [Part(positions, triangles, uv, vertex_colors=colors, place="mesh")]


def _numbers_of(data: bytes, start: int, file: str) -> FloatArray:
    """Return the numbers of a text from a byte on; where something is none its line is named."""
    try:
        return parse_numbers(data[start:], file)
    except InputError:
        for number, line in enumerate(data[start:].splitlines(), len(data[:start].splitlines()) + 1):
            parse_numbers(line, f"{file}: line {number}: {shortened(ascii(line.decode('latin-1')))}")
        raise


def _read_header(data: bytes, file: str) -> tuple[str, list[_Element], int]:
    end = data.find(b"end_header", 0, _MOST_HEADER)
    newline = data.find(b"\n", max(end, 0))
    if data[:3] != b"ply" or end < 0 or newline < 0:
        raise InputError(f"{file}: has no PLY header ('ply' to 'end_header'); it is damaged, or no PLY file")
    order, elements = None, list[_Element]()
    lines = data[:end].decode("latin-1").splitlines()
    for number, line in enumerate(lines[1:], 2):
        words = line.split()
        match words:
            case [] | ["comment", *_] | ["obj_info", *_]:
                continue
            case ["format", name, "1.0"] if name in _ORDERS:
                order = _ORDERS[name]
            case ["element", name, count] if count.isascii() and count.isdigit() and len(count) < 11:
                if any(element.name == name for element in elements):
                    raise InputError(f"{file}: line {number}: there is an element {name!r} already; one is needed")
                elements.append(_Element(name, int(count), ()))
            case ["property", "list", counted, kind, name] if elements and counted in _TYPES and kind in _TYPES:
                if _TYPES[counted][0] == "f":
                    raise InputError(f"{file}: line {number}: a list is counted by {counted}; an integer is needed")
                elements[-1] = _with(elements[-1], _Property(name, _TYPES[kind], _TYPES[counted]), file, number)
            case ["property", kind, name] if elements and kind in _TYPES:
                elements[-1] = _with(elements[-1], _Property(name, _TYPES[kind], ""), file, number)
            case _:
                raise InputError(f"{file}: line {number}: {shortened(ascii(line))} is no line of a PLY 1.0 header")
    if order is None:
        raise InputError(f"{file}: its header has no format line ('format ascii 1.0', say)")
    return order, elements, newline + 1


def _with(element: _Element, new: _Property, file: str, line: int) -> _Element:
    if any(p.name == new.name for p in element.properties):
        raise InputError(
            f"{file}: line {line}: element {element.name} has a property {new.name!r} already; one is needed"
        )
    return _Element(element.name, element.count, (*element.properties, new))


class _Reader:
    """Reads elements one after the other: of bytes, or of the numbers of a text, where everything is one number wide.

    Parameters
    ----------
    data : (n,) uint8, or (n,) float64 for a text
    order : str
        Byte order of a binary file, empty for a text.
    """

    __slots__ = ("_at", "_data", "_file", "_order")

    def __init__(self, data: NDArray[np.uint8] | FloatArray, order: str, file: str) -> None:
        self._data, self._order, self._file, self._at = data, order, file, 0

    @property
    def left(self) -> int:
        """How many bytes, or numbers, follow what was read."""
        return len(self._data) - self._at

    def read(self, element: _Element) -> dict[str, Column]:
        """Return an element's values by property: (n,) numbers, or lists as blocks of one length each."""
        if element.count == 0 or not element.properties:
            return {p.name: np.empty(0) for p in element.properties}
        first = self._starts(element, 1)
        width = first[1]
        end = self._at + width * element.count
        if end <= len(self._data):
            rows = self._data[self._at : end].reshape(element.count, width)
            counts = {p: rows[:, at : at + self._size(p.counted_by)] for p, at, _ in first[0] if p.counted_by}
            # Every list as long as in the first row: the whole element is one block.
            if all((c == c[0]).all() for c in counts.values()):
                self._at = end
                return {p.name: self._block(rows[:, at + self._size(p.counted_by) :], p, n) for p, at, n in first[0]}
        if not any(p.counted_by for p in element.properties):
            self._cut_off(element)
        return self._walk(element)

    def _walk(self, element: _Element) -> dict[str, Column]:
        """Return an element's values where its lists have different lengths: places first, then all of one length."""
        places, width = self._starts(element, element.count)
        self._at += width
        found: dict[_Property, tuple[list[int], list[int]]] = {p: ([], []) for p in element.properties}
        for p, at, n in places:
            found[p][0].append(at + self._size(p.counted_by))
            found[p][1].append(n)
        start = self._at - width
        out: dict[str, Column] = {}
        for p, (at_all, n_all) in found.items():
            at_array, n_array = np.array(at_all) + start, np.array(n_all)
            blocks = []
            for n in np.unique(n_array).tolist():
                units = np.arange(n * self._size(p.kind))
                blocks.append(self._block(self._data[at_array[n_array == n][:, None] + units], p, n))
            out[p.name] = blocks if p.counted_by else blocks[0]
        return out

    def _starts(self, element: _Element, rows: int) -> tuple[list[tuple[_Property, int, int]], int]:
        """Return where each value of the next rows begins, from here on, with its length; and where the rows end."""
        out: list[tuple[_Property, int, int]] = []
        at, left = 0, len(self._data) - self._at
        sizes = [(p, self._size(p.counted_by), self._size(p.kind)) for p in element.properties]
        for _ in range(rows):
            for p, before, size in sizes:
                n = self._length(p, self._at + at, element) if p.counted_by else 1
                out.append((p, at, n))
                at += before + n * size
                if at > left:
                    self._cut_off(element)
        return out, at

    def _length(self, p: _Property, at: int, element: _Element) -> int:
        if at >= len(self._data):
            self._cut_off(element)
        if self._order and p.counted_by == "u1":
            return int(self._data[at])
        values = self._block(self._data[None, at : at + self._size(p.counted_by)], p, 1, p.counted_by)
        n = float(values[0]) if len(values) == 1 else -1.0
        if len(values) == 0:
            self._cut_off(element)
        left = len(self._data) - at - self._size(p.counted_by)
        if not (n >= 0 and n.is_integer()):
            raise InputError(f"{self._place(element, p)} has a length of {n:g}; a whole number from 0 is needed")
        if n * self._size(p.kind) > left:
            raise InputError(
                f"{self._place(element, p)} has a length of {n:g}; the file has {left // self._size(p.kind)} more of "
                "its values (cut off?)"
            )
        return int(n)

    def _place(self, element: _Element, p: _Property) -> str:
        return f"{self._file}: element {element.name!r}: a list {p.name!r}"

    def _size(self, kind: str) -> int:
        """Return how many units a value of a kind takes; no kind takes none."""
        return (np.dtype(kind).itemsize if self._order else 1) if kind else 0

    def _block(self, units: NDArray[np.generic], p: _Property, n: int, kind: str = "") -> NDArray[np.generic]:
        """Return rows of units as (rows,) numbers, or as (rows, n) where the property is a list."""
        own = kind or p.kind
        values = units[:, : n * self._size(own)]
        if self._order:
            if values.shape[1] < n * self._size(own):
                return np.empty(0)
            values = np.ascontiguousarray(values).view(self._order + own)
        return values if p.counted_by and not kind else values[:, 0]

    def _cut_off(self, element: _Element) -> NoReturn:
        raise InputError(
            f"{self._file}: has not the {element.count} elements {element.name!r} that its header says (cut off?)"
        )


def _cut(faces: NDArray[np.int32], positions: FloatArray) -> NDArray[np.int32]:
    """Return the triangles (m, 3) of faces (n, k) of one number of corners."""
    count, each = faces.shape
    corners = faces.ravel()
    return faces if each == 3 else corners[cut_faces(corners, np.full(count, each, np.int64), positions)]


def _as_indices(values: NDArray[np.generic], file: str) -> NDArray[np.int32]:
    with np.errstate(invalid="ignore"):
        numbers = values.astype(np.float64)
    whole = (numbers >= 0) & (numbers < 2**31) & (numbers == np.floor(numbers))
    if not whole.all():
        raise InputError(f"{file}: a face has the index {numbers[~whole][0]:g}; whole numbers from 0 are needed")
    return numbers.astype(np.int32)


def _stack(columns: Mapping[str, NDArray[np.generic]], names: Sequence[str]) -> FloatArray:
    # Damaged files hold signalling NaNs, of which numpy warns; `mesh_parts` refuses them.
    with np.errstate(invalid="ignore"):
        return np.stack([columns[name].astype(np.float64) for name in names], axis=1)


def _colors(vertex: Mapping[str, NDArray[np.generic]], kinds: Mapping[str, str]) -> FloatArray | None:
    """Return vertices' linear colours (n, 3), None where there are none."""
    names = next((n for n in (("red", "green", "blue"), ("r", "g", "b")) if set(n) <= vertex.keys()), None)
    if names is None:
        return None
    colors = _stack(vertex, names)
    kind = np.dtype(kinds[names[0]])
    if kind.kind in "iu":
        return srgb_to_linear(np.clip(colors / np.iinfo(kind).max, 0.0, 1.0))
    return colors
