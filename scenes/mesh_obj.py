"""Wavefront OBJ files with their materials (MTL): positions, texture coordinates, polygons, colours and textures.

Lines are sorted by kind first and their numbers parsed in one go: a million triangles take seconds, not minutes.
Polygons are cut as fans about their first corner. Of a material its diffuse colour Kd is read, as linear light, and its
texture map_Kd; where there is a texture Kd multiplies it. Colours after a vertex' coordinates (x y z r g b) are linear.
Free-form curves, lines and points are left out. Source: Wavefront, Object Files (.obj), version 3.0.
"""

import re
from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.errors import InputError, shortened, unknown_name
from aliasbench.scenes.limits import RADIANCE
from aliasbench.scenes.local_files import path_beside, read_local
from aliasbench.scenes.mesh_parts import Part, check_amount
from aliasbench.scenes.mesh_ply import parse_numbers
from aliasbench.scenes.model import FloatArray, ImageTexture, Vec3
from aliasbench.scenes.textures import load_image

_LONGEST_CORNER = 48  # characters: three whole numbers and two slashes are fewer
_CORNER = re.compile(rb"-?\d{1,9}(/-?\d{1,9}|(/-?\d{1,9}|/)/-?\d{1,9})?")
_MOST_LIBRARIES = 64
_FREE_TEXELS = 2**25
_TEXELS_PER_BYTE = 16


@dataclass(frozen=True, slots=True)
class _Material:
    color: Vec3 = (1.0, 1.0, 1.0)
    image: str | None = None
    place: str = ""


@dataclass(frozen=True, slots=True)
class _Faces:
    """The faces of one material: their corners' texts, how many each has, and what was defined before each."""

    corners: list[bytes] = field(default_factory=list)
    counts: "array[int]" = field(default_factory=lambda: array("q"))
    before: "array[int]" = field(default_factory=lambda: array("q"))  # line, positions, texture coordinates of each


def read_obj(data: bytes, path: Path, label: str) -> tuple[list[Part], dict[str, ImageTexture]]:
    """Return the parts of an OBJ file's content, one for each material, and the textures that they use.

    Raises
    ------
    InputError
        If a line cannot be read, an index has no vertex, or a material or a texture is missing or not beside the file.
    """
    file = str(path)
    points, coordinates = list[bytes](), list[bytes]()
    groups: dict[str, _Faces] = {"": _Faces()}
    libraries = list[str]()
    current = groups[""]
    for number, line in enumerate(data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").splitlines(), 1):
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
            current = groups.setdefault(rest.decode("utf-8", "replace").strip(), _Faces())
        elif kind == b"mtllib":
            libraries.append(rest.decode("utf-8", "replace").strip())
    positions, colors = _read_points(points, file)
    uv = _read_columns(coordinates, file, "vt", (1, 2, 3))
    if uv is not None and uv.shape[1] == 1:
        uv = np.concatenate([uv, np.zeros_like(uv)], axis=1)
    triangles = sum(len(g.corners) - 2 * len(g.counts) for g in groups.values())
    corners_all = sum(len(g.corners) for g in groups.values())
    check_amount(file, max(len(positions), corners_all if uv is not None else 0), triangles, len(data))
    materials = _read_materials(libraries, path)
    textures: dict[str, ImageTexture] = {}
    parts = []
    for name, faces in groups.items():
        if not faces.counts:
            continue
        if name and libraries and name not in materials:
            raise InputError(f"{file}: usemtl: {unknown_name('material', name, materials)}")
        material = materials.get(name, _Material())
        texture = None if material.image is None else _texture(material, path, label, textures)
        parts.append(_build_part(faces, positions, colors, None if uv is None else uv[:, :2], material, texture, file))
    return parts, textures


def _read_points(lines: Sequence[bytes], file: str) -> tuple[FloatArray, FloatArray | None]:
    """Return positions (n, 3), and colours (n, 3) where every vertex has one."""
    values = _read_columns(lines, file, "v", (3, 4, 6))
    if values is None:
        raise InputError(f"{file}: has no vertices (lines 'v x y z'); an OBJ mesh needs them")
    return values[:, :3], np.maximum(values[:, 3:], 0.0) if values.shape[1] == 6 else None


def _read_columns(lines: Sequence[bytes], file: str, kind: str, widths: Sequence[int]) -> FloatArray | None:
    """Return the numbers of lines of one kind as (n, width), None where there are no lines."""
    if not lines:
        return None
    numbers = parse_numbers(b" ".join(lines), f"{file}: lines {kind!r}")
    counts = [len(line.split()) for line in lines]
    least = min(counts)
    width = max((w for w in widths if w <= least), default=0)
    if width == 0:
        raise InputError(f"{file}: a line {kind!r} has {least} numbers; {' or '.join(map(str, widths))} are needed")
    if width * len(lines) != len(numbers):
        # Some lines have more numbers than others: of all those that every line has.
        text = b" ".join(b" ".join(line.split()[:width]) for line in lines)
        numbers = parse_numbers(text, f"{file}: lines {kind!r}")
    return numbers.reshape(len(lines), width)


def _build_part(
    faces: _Faces,
    positions: FloatArray,
    colors: FloatArray | None,
    uv: FloatArray | None,
    material: _Material,
    texture: str | None,
    file: str,
) -> Part:
    counts = np.array(faces.counts)
    before = np.repeat(np.array(faces.before).reshape(-1, 3), counts, axis=0)
    numbers = _parse_corners(faces.corners, before[:, 0], file)
    point = _resolve(numbers[:, 0], before[:, 1], len(positions), before[:, 0], "vertex", file)
    triangles = _cut(counts)
    place = f"material {material.place}" if material.place else "faces"
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


def _cut(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the (m, 3) corners of the triangles that cut faces of these counts of corners, in order, as fans."""
    first = np.repeat(np.cumsum(counts) - counts, counts - 2)
    step = np.arange(len(first)) - np.repeat(np.cumsum(counts - 2) - (counts - 2), counts - 2)
    return np.stack([first, first + step + 1, first + step + 2], axis=1)


def _read_materials(libraries: Sequence[str], path: Path) -> dict[str, _Material]:
    out: dict[str, _Material] = {}
    if len(libraries) > _MOST_LIBRARIES:
        raise InputError(f"{path}: names {len(libraries)} material libraries; at most {_MOST_LIBRARIES} are allowed")
    for name in libraries:
        what = f"{path}: mtllib"
        library = path_beside(path.parent, name.replace("\\", "/"), what, escaped=False)
        data = read_local(library, f"{what}: {shortened(ascii(name))}")
        current = ""
        for number, line in enumerate(data.decode("utf-8", "replace").splitlines(), 1):
            words = line.split(None, 1)
            if len(words) < 2:
                continue
            key, rest = words[0], words[1].strip()
            place = f"{library.name}: line {number}"
            if key == "newmtl":
                current = rest
                out[current] = _Material(place=rest)
            elif key == "Kd" and current in out:
                numbers = parse_numbers(rest.encode(), f"{path}: {place}").tolist()
                if not 1 <= len(numbers) <= 3 or not all(0.0 <= n <= RADIANCE for n in numbers):
                    raise InputError(f"{path}: {place}: Kd must be three numbers from 0 to {RADIANCE:g}")
                r, g, b = numbers if len(numbers) == 3 else numbers[:1] * 3
                out[current] = _Material((r, g, b), out[current].image, current)
            elif key == "map_Kd" and current in out:
                out[current] = _Material(out[current].color, _image_name(rest, f"{path}: {place}"), current)
    return out


def _image_name(rest: str, place: str) -> str:
    if rest.startswith("-"):
        raise InputError(f"{place}: map_Kd has options ({shortened(ascii(rest))}); a path alone is read")
    return rest.replace("\\", "/")


def _texture(material: _Material, path: Path, label: str, textures: dict[str, ImageTexture]) -> str:
    """Return the name of a material's texture among `textures`, which it is added to."""
    image = path_beside(path.parent, material.image or "", f"{path}: map_Kd", escaped=False)
    name = f"{label}#{image.name}"
    if name not in textures or textures[name].source != material.image:
        if name in textures:
            name = f"{label}#{material.image}"
        used = sum(t.texels.size // 4 for t in textures.values())
        size = image.stat().st_size if image.is_file() else 0
        most = max(_FREE_TEXELS, _TEXELS_PER_BYTE * size) - used
        what = f"{path}: map_Kd: image {image.name!r}"
        texture = load_image(image, source=material.image, label=what, most_texels=max(0, most))
        textures[name] = texture
    return name
