"""Wavefront OBJ files: positions, texture coordinates, polygons, colours and textures (of materials: `mesh_mtl`).

Lines are sorted by kind first and their numbers parsed in one go: a million triangles take seconds, not minutes.
Where a material has a texture its colour multiplies it. Colours after a vertex' coordinates (x y z r g b) are linear.
Comments behind numbers are not in the format, but in files: they are cut off where a file cannot be read with them, so
that the others are no slower. Only where numbers cannot be read are lines looked at one by one, to name the first.
Free-form curves, lines and points are left out. Source: Wavefront, Object Files (.obj), version 3.0.
"""

import io
import re
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.errors import InputError, printable, reason_of, shortened, unknown_name
from aliasbench.scenes.limits import LENGTH
from aliasbench.scenes.local_files import is_local, path_beside
from aliasbench.scenes.mesh_mtl import Material, decoded, read_materials
from aliasbench.scenes.mesh_parts import Part, check_amount, parse_numbers
from aliasbench.scenes.mesh_polygons import cut_faces
from aliasbench.scenes.model import FloatArray, ImageTexture
from aliasbench.scenes.textures import load_image

_LONGEST_CORNER = 48  # characters: three whole numbers and two slashes are fewer
_CORNER = re.compile(rb"-?\d{1,9}(/-?\d{1,9}|(/-?\d{1,9}|/)/-?\d{1,9})?")
_COMMENTED = re.compile(rb"\s*(v|vt|f)\s[^#]*#")
_FREE_TEXELS = 2**25
_TEXELS_PER_BYTE = 16


@dataclass(frozen=True, slots=True)
class _Faces:
    """The faces of one material: their corners' texts, how many each has, and what was defined before each."""

    corners: list[bytes] = field(default_factory=list)
    counts: "array[int]" = field(default_factory=lambda: array("q"))
    before: "array[int]" = field(default_factory=lambda: array("q"))  # line, positions, texture coordinates of each


def read_obj(
    data: bytes, path: Path, label: str, *, retextured: bool = False
) -> tuple[list[Part], dict[str, ImageTexture]]:
    """Return the parts of an OBJ file's content, one for each material, and the textures that they use.

    Where they are to be `retextured` no texture is read.

    Raises
    ------
    InputError
        If a line cannot be read, an index has no vertex, or a material or a texture is missing or not beside the file.
    """
    try:
        return _read_lines(data, len(data), path, label, retextured)
    except InputError:
        bare = b"\n".join(line.split(b"#", 1)[0] if _COMMENTED.match(line) else line for line in _lines_of(data))
        if bare.count(b"#") == data.count(b"#"):
            raise
    return _read_lines(bare, len(data), path, label, retextured)


def _lines_of(data: bytes) -> Iterator[bytes]:
    """Return a file's lines one by one: all of them together take several times the memory of the file."""
    if b"\\" in data:
        return iter(_joined(data.splitlines()))
    if b"\n" not in data:
        return iter(data.splitlines())
    return (line.rstrip(b"\r\n") for line in io.BytesIO(data))


def _joined(lines: list[bytes]) -> list[bytes]:
    """Return lines with those that a backslash continues as one at the first one's place, empty ones at the others'."""
    out = [b""] * len(lines)
    first, pieces = 0, list[bytes]()
    for k, line in enumerate(lines):
        first = first if pieces else k
        pieces.append(line.removesuffix(b"\\"))
        if pieces[-1] == line or k == len(lines) - 1:
            out[first] = b" ".join(pieces)
            pieces = []
    return out


def _read_lines(
    data: bytes, size: int, path: Path, label: str, retextured: bool
) -> tuple[list[Part], dict[str, ImageTexture]]:
    file = str(path)
    points, coordinates = list[bytes](), list[bytes]()
    groups: dict[str, _Faces] = {"": _Faces()}
    libraries = list[str]()
    current = groups[""]
    for number, line in enumerate(_lines_of(data), 1):
        words = line.split(None, 1)
        if len(words) < 2:
            continue
        kind, rest = words
        if kind == b"v":
            points.append(rest)
        elif kind == b"vt":
            coordinates.append(rest)
        elif kind == b"f":
            corners = rest.split()
            if len(corners) < 3:
                raise InputError(f"{file}: line {number}: a face of {len(corners)} corners; 3 at least are needed")
            current.corners.extend(corners)
            current.counts.append(len(corners))
            current.before.extend((number, len(points), len(coordinates)))
        elif kind == b"usemtl":
            current = groups.setdefault(decoded(rest), _Faces())
        elif kind == b"mtllib":
            libraries.append(decoded(rest))
    if not points:
        raise InputError(f"{file}: has no vertices (lines 'v x y z'); an OBJ mesh needs them")
    values = _read_columns(points, data, file, "v", (3, 4, 6))
    points.clear()
    positions, colors = values[:, :3], np.maximum(values[:, 3:], 0.0) if values.shape[1] == 6 else None
    uv = _read_columns(coordinates, data, file, "vt", (1, 2, 3)) if coordinates else None
    coordinates.clear()
    if uv is not None and uv.shape[1] == 1:
        uv = np.concatenate([uv, np.zeros_like(uv)], axis=1)
    triangles = sum(len(g.corners) - 2 * len(g.counts) for g in groups.values())
    corners_all = sum(len(g.corners) for g in groups.values())
    vertices = max(len(positions), corners_all if uv is not None else 0)
    drawn = sum(bool(g.counts) for g in groups.values())
    check_amount(file, vertices, triangles, size, colored=0 if colors is None else triangles, parts=drawn)
    materials = read_materials(libraries, path)
    textures: dict[str, ImageTexture] = {}
    wanted: dict[Path, Material] = {}
    parts = []
    for name in list(groups):
        faces = groups.pop(name)
        if not faces.counts:
            continue
        if name and libraries and name not in materials:
            raise InputError(f"{file}: usemtl: {unknown_name('material', name, materials)}")
        material = materials.get(name, Material())
        texture = None
        if material.image is not None and not retextured:
            image = path_beside(path.parent, material.image, f"{material.image_place}: map_Kd", escaped=False)
            wanted.setdefault(image, material)
            texture = _texture_name(image, path, label)
        parts.append(_build_part(faces, positions, colors, None if uv is None else uv[:, :2], material, texture, file))
        del faces
    # Last, when the texts of the faces are gone: both at once would be the most memory.
    for image, material in wanted.items():
        textures[_texture_name(image, path, label)] = _load_texture(image, material, textures)
    return parts, textures


def _read_columns(own: Sequence[bytes], data: bytes, file: str, kind: str, widths: Sequence[int]) -> FloatArray:
    """Return the numbers of a file's lines of one kind, which are `own` without the kind, as (n, width)."""
    counts = [len(line.split()) for line in own]
    least = min(counts)
    width = max((w for w in widths if w <= least), default=0)
    try:
        numbers = parse_numbers(b" ".join(own), f"{file}: lines {kind!r}")
        if width > 0 and width * len(own) != len(numbers):
            # Some lines have more numbers than others: of all those that every line has.
            text = b" ".join(b" ".join(line.split()[:width]) for line in own)
            numbers = parse_numbers(text, f"{file}: lines {kind!r}")
    except InputError:
        _refuse_line(data, file, kind, widths)
        raise
    # Not (x > limit), so that a NaN is caught by the one comparison.
    if width == 0 or not (np.abs(numbers.reshape(len(own), width)[:, :3]) <= LENGTH).all():
        _refuse_line(data, file, kind, widths)
    return numbers.reshape(len(own), width)


def _refuse_line(data: bytes, file: str, kind: str, widths: Sequence[int]) -> None:
    """Raise `InputError` at the first line of a kind that has not the numbers it needs."""
    for number, line in enumerate(_lines_of(data), 1):
        words = line.split()
        if words[:1] != [kind.encode()]:
            continue
        place = f"{file}: line {number}: {shortened(ascii(decoded(line)))}"
        if len(words) <= widths[0]:
            needed = " or ".join(map(str, widths))
            raise InputError(f"{place}: {kind} has {len(words) - 1} numbers; {needed} are needed")
        numbers = parse_numbers(b" ".join(words[1:]), place)
        if not (np.abs(numbers[:3]) <= LENGTH).all():
            raise InputError(f"{place}: finite numbers up to {LENGTH:g} are needed")


def _build_part(
    faces: _Faces,
    positions: FloatArray,
    colors: FloatArray | None,
    uv: FloatArray | None,
    material: Material,
    texture: str | None,
    file: str,
) -> Part:
    counts = np.array(faces.counts, np.int64)
    before = np.repeat(np.array(faces.before).reshape(-1, 3), counts, axis=0)
    numbers = _parse_corners(faces.corners, before[:, 0], file)
    point = _resolve(numbers[:, 0], before[:, 1], len(positions), before[:, 0], "vertex", file)
    if len(point) < len(positions):
        # Of many materials each has few of the vertices.
        used, point = np.unique(point, return_inverse=True)
        positions, colors = positions[used], None if colors is None else colors[used]
    triangles = cut_faces(point, counts, positions)
    place = f"material {material.name}" if material.name else "faces"
    has_uv = numbers[:, 1] != 0
    if uv is None or not has_uv.all():
        if texture is not None:
            line = int(before[np.argmin(has_uv), 0]) if uv is not None else int(before[0, 0])
            raise InputError(f"{file}: line {line}: a face with a textured material needs texture coordinates (vt)")
        return Part(positions, point[triangles], None, material.color, colors, place=place)
    coordinate = _resolve(numbers[:, 1], before[:, 2], len(uv), before[:, 0], "texture coordinate", file)
    # One vertex for each pair of position and texture coordinate that occurs.
    pairs, corner = np.unique(point * len(uv) + coordinate, return_inverse=True)
    point, coordinate = pairs // len(uv), pairs % len(uv)
    own = None if colors is None else colors[point]
    return Part(positions[point], corner[triangles], uv[coordinate], material.color, own, texture, place=place)


def _parse_corners(corners: list[bytes], lines: NDArray[np.int64], file: str) -> NDArray[np.int64]:
    """Return (n, 2): the numbers of the position and of the texture coordinate (0: none) of corners ``v/vt/vn``."""
    if max(map(len, corners)) > _LONGEST_CORNER:
        first = next(k for k, corner in enumerate(corners) if len(corner) > _LONGEST_CORNER)
        raise InputError(f"{file}: line {int(lines[first])}: {shortened(ascii(corners[first]))} is no corner of a face")
    texts = np.array(corners)
    slashes = np.strings.count(texts, b"/")
    doubled = np.strings.count(texts, b"//")
    out = np.zeros((len(corners), 2), np.int64)
    for count, double, width, used in ((0, 0, 1, 1), (1, 0, 2, 2), (2, 0, 3, 2), (2, 1, 2, 1)):
        chosen = (slashes == count) & (doubled == double)
        if not chosen.any():
            continue
        text = b" ".join(corners if chosen.all() else texts[chosen].tolist())
        try:
            numbers = parse_numbers(text.replace(b"/", b" "), file)
        except InputError:
            numbers = np.empty(0)
        if text.translate(None, b"0123456789-/ ") or len(numbers) != width * int(chosen.sum()):
            _refuse_corner(corners, lines, file)
        if not (np.abs(numbers) < 2**31).all():
            _refuse_corner(corners, lines, file)
        out[chosen, :used] = numbers.reshape(-1, width)[:, :used].astype(np.int64)
        slashes[chosen] = -1
    if (slashes != -1).any():
        _refuse_corner(corners, lines, file)
    return out


def _refuse_corner(corners: list[bytes], lines: NDArray[np.int64], file: str) -> NoReturn:
    first = next((k for k, corner in enumerate(corners) if not _CORNER.fullmatch(corner)), 0)
    raise InputError(
        f"{file}: line {int(lines[first])}: {shortened(ascii(corners[first]))} is no corner of a face; "
        "v, v/vt, v//vn and v/vt/vn are"
    )


def _resolve(
    numbers: NDArray[np.int64], before: NDArray[np.int64], count: int, lines: NDArray[np.int64], what: str, file: str
) -> NDArray[np.int64]:
    """Return indices from 0 of numbers from 1, or from -1 back from what was defined before."""
    out = np.where(numbers > 0, numbers - 1, before + numbers)
    wrong = (numbers == 0) | (out < 0) | (out >= count)
    if wrong.any():
        first = int(np.argmax(wrong))
        raise InputError(
            f"{file}: line {int(lines[first])}: there is no {what} {int(numbers[first])}; there are {count}"
        )
    return out


def _texture_name(image: Path, path: Path, label: str) -> str:
    return printable(f"{label}#{image.relative_to(path.parent.resolve()).as_posix()}")


def _load_texture(image: Path, material: Material, others: Mapping[str, ImageTexture]) -> ImageTexture:
    used = sum(t.texels.size // 4 for t in others.values())
    what = f"{material.image_place}: map_Kd: image {shortened(ascii(image.name))}"
    try:
        size = image.stat().st_size if is_local(image) else 0
        most = max(_FREE_TEXELS, _TEXELS_PER_BYTE * size) - used
        source = printable(material.image or "")
        return load_image(image, source=source, label=what, most_texels=max(0, most))
    except OSError as error:
        raise InputError(f"{what}: cannot be read ({reason_of(error)})") from error
