"""From triangles as files give them to surfaces as engines draw them: checked, merged, without what has no area.

Every format ends here, so that each rule is written once: coordinates are finite, indices have their vertex, triangles
of no area are dropped without a word, what has the same colour, texture and motion is one surface, and nothing is
expanded beyond what the size of the file can account for.

The model has no colours at vertices. Where a file has, each triangle gets the mean of its corners' from a texture with
one texel for each triangle, which all parts of the same colours share; beside a texture, the file's own or one that
replaces it, the mean over the whole part multiplies it.
"""

import hashlib
import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.limits import COUNT, LENGTH, RADIANCE
from aliasbench.scenes.model import FloatArray, ImageTexture, Motion, Surface, Vec3

MOST_TRIANGLES = 20_000_000
MOST_PARTS = 20_000  # each takes a fraction of a millisecond, however small it is
_FREE_BYTES = 400_000_000  # of surfaces that any file may give
_BYTES_PER_BYTE = 8  # and that it may give for each byte of its own
_VERTEX_BYTES, _TRIANGLE_BYTES = 40, 12
_COLORED_BYTES = 3 * _VERTEX_BYTES + 16  # of a triangle of several colours: corners of its own, and its texel

Indices = NDArray[np.integer]
Kind = TypeVar("Kind", bound=np.generic)


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Triangles of one look.

    Attributes
    ----------
    positions : (n, 3) float64
        In the world at t = 0.
    triangles : (m, 3) integers
    uv : (n, 2) float64 or None
        v up.
    color : Vec3
        Linear RGB.
    vertex_colors : (n, 3) float64 or None
        Linear RGB; multiplies `color`.
    texture : str or None
    motion : Motion
    place : str
        Where in the file, for messages.
    """

    positions: FloatArray
    triangles: Indices
    uv: FloatArray | None = None
    color: Vec3 = (1.0, 1.0, 1.0)
    vertex_colors: FloatArray | None = None
    texture: str | None = None
    motion: Motion = field(default_factory=Motion)
    place: str = ""


def check_amount(file: str, vertices: int, triangles: int, size: int, *, colored: int = 0, parts: int = 1) -> None:
    """Raise `InputError` if a file of `size` bytes comes to more vertices, triangles or parts than are drawn.

    `colored` of the triangles may have colours at their corners.
    """
    if parts > MOST_PARTS:
        raise InputError(
            f"{file}: comes to {parts} parts (meshes by node, or faces by material); at most {MOST_PARTS} are allowed"
        )
    if triangles > MOST_TRIANGLES:
        raise InputError(f"{file}: comes to {triangles} triangles; at most {MOST_TRIANGLES} are allowed")
    needed = vertices * _VERTEX_BYTES + triangles * _TRIANGLE_BYTES + colored * _COLORED_BYTES
    if needed > max(_FREE_BYTES, _BYTES_PER_BYTE * size):
        raise InputError(
            f"{file}: {size} bytes come to {vertices} vertices and {triangles} triangles"
            f"{f', {colored} of them of several colours' if colored else ''}, {needed} bytes in memory; "
            f"at most {_FREE_BYTES}, or {_BYTES_PER_BYTE} times the file, are allowed"
        )


def build_surfaces(
    parts: Sequence[Part], file: str, label: str, *, retextured: bool = False
) -> tuple[tuple[Surface, ...], dict[str, ImageTexture]]:
    """Return the surfaces of a file's parts, named ``label#0``, ``label#1`` ..., and the textures of vertex colours.

    Where they are to be `retextured` all keep the coordinates of their own, and no textures are made.

    Raises
    ------
    InputError
        If a coordinate is not finite or out of reach, an index has no vertex, or nothing with an area is left.
    """
    groups: dict[tuple[object, ...], list[Part]] = {}
    palettes: dict[bytes, ImageTexture] = {}
    for number, part in enumerate(parts):
        sound = _without_waste(_checked(part, file))
        if len(sound.triangles) == 0:
            continue
        if sound.vertex_colors is not None:
            alone = retextured or sound.texture is not None or _is_even(sound.vertex_colors)
            sound = _of_mean_color(sound) if alone else _with_palette(sound, f"{label}#colors {number}", palettes)
        key = (sound.color, sound.texture, sound.motion, sound.uv is None)
        groups.setdefault(key, []).append(sound)
    if not groups:
        raise InputError(f"{file}: has no triangle with an area; a mesh to draw is needed")
    surfaces = []
    for k, group in enumerate(list(groups)):
        # Each group is let go of once it is merged, so that no more than one is there twice.
        surfaces.append(_surface(groups.pop(group), f"{label}#{k}"))
    return tuple(surfaces), {palette.source: palette for palette in palettes.values()}


def parse_numbers(text: bytes, place: str) -> FloatArray:
    """Return the numbers of a text, separated by white space; raise `InputError` at what is none."""
    with warnings.catch_warnings():
        # What older versions of numpy only warn of.
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(text, dtype=np.float64, sep=" ") if text.strip() else np.empty(0)
        except (ValueError, DeprecationWarning) as error:
            raise InputError(f"{place}: has something other than numbers where only numbers may be") from error


def _checked(part: Part, file: str) -> Part:
    place = f"{file}: {part.place}"
    for what, values, limit in (
        ("vertex", part.positions, LENGTH),
        ("texture coordinate", part.uv, COUNT),
        ("vertex colour", part.vertex_colors, RADIANCE),
    ):
        if values is None or len(values) == 0:
            continue
        # Not (x <= limit), so that a NaN is caught by the one comparison.
        wrong = ~(np.abs(values) <= limit).all(axis=1)
        if wrong.any():
            first = int(np.argmax(wrong))
            raise InputError(
                f"{place}: {what} {first} is {values[first].tolist()}; finite numbers up to {limit:g} are needed"
            )
    if part.triangles.size:
        low, high = int(part.triangles.min()), int(part.triangles.max())
        if low < 0 or high >= len(part.positions):
            worst = low if low < 0 else high
            raise InputError(f"{place}: index {worst} has no vertex; there are {len(part.positions)} vertices")
    return part


def _without_waste(part: Part) -> Part:
    """Return a part without triangles of no area and without vertices that no triangle has."""
    corners = part.triangles.astype(np.int32, copy=False)
    a, b, c = (part.positions[corners[:, k]] for k in range(3))
    b -= a
    c -= a
    # Edges in units of the longest, so that neither overflow nor underflow makes an area vanish.
    scale = float(max(np.abs(b).max(initial=0.0), np.abs(c).max(initial=0.0))) or 1.0
    b /= scale
    c /= scale
    alive = (
        (b[:, 1] * c[:, 2] != b[:, 2] * c[:, 1])
        | (b[:, 2] * c[:, 0] != b[:, 0] * c[:, 2])
        | (b[:, 0] * c[:, 1] != b[:, 1] * c[:, 0])
    )
    if not alive.all():
        corners = corners[alive]
    used = np.zeros(len(part.positions), dtype=bool)
    used[corners] = True
    if used.all():
        return replace(part, triangles=corners)
    renumbered = np.cumsum(used, dtype=np.int32) - 1
    return replace(
        part,
        positions=part.positions[used],
        triangles=renumbered[corners],
        uv=None if part.uv is None else part.uv[used],
        vertex_colors=None if part.vertex_colors is None else part.vertex_colors[used],
    )


def _is_even(colors: FloatArray) -> bool:
    return bool((np.ptp(np.maximum(colors, 0.0), axis=0) == 0.0).all())


def _of_mean_color(part: Part) -> Part:
    """Return a part whose colour is multiplied by the mean of its vertices' colours."""
    if part.vertex_colors is None:
        return part
    lowest = np.maximum(part.vertex_colors, 0.0)
    r, g, b = (lowest[0] if _is_even(lowest) else lowest.mean(axis=0)).tolist()
    return replace(part, color=(part.color[0] * r, part.color[1] * g, part.color[2] * b), vertex_colors=None)


def _with_palette(part: Part, name: str, palettes: dict[bytes, ImageTexture]) -> Part:
    """Return a part whose vertex colours have become a texture of one texel for each triangle.

    The texture is added to `palettes`, by its content, under this name if there is none like it: a mesh that a file
    shows a thousand times has one.
    """
    if part.vertex_colors is None:
        return part
    count = len(part.triangles)
    side = math.ceil(math.sqrt(count))
    rows = math.ceil(count / side)
    colors = np.maximum(part.vertex_colors, 0.0).astype(np.float32)
    texels = np.ones((rows * side, 4), np.float32)
    texels[:count, :3] = sum(colors[part.triangles[:, k]] / 3 for k in range(3))
    digest = hashlib.blake2b(texels.data).digest()
    if digest not in palettes:
        palettes[digest] = ImageTexture(_frozen(texels.reshape(rows, side, 4)), source=name)
    number = np.repeat(np.arange(count), 3)
    return replace(
        part,
        positions=part.positions[part.triangles.ravel()],
        triangles=np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        uv=np.stack([(number % side + 0.5) / side, (number // side + 0.5) / rows], axis=1),
        texture=palettes[digest].source,
        vertex_colors=None,
    )


def _surface(parts: Sequence[Part], name: str) -> Surface:
    first = parts[0]
    starts = np.cumsum([0, *(len(p.positions) for p in parts[:-1])])
    uvs = [p.uv for p in parts if p.uv is not None]
    alone = len(parts) == 1
    return Surface(
        vertices=_frozen(first.positions if alone else np.concatenate([p.positions for p in parts])),
        triangles=_frozen(
            np.concatenate([p.triangles + s for p, s in zip(parts, starts, strict=True)]).astype(np.int32, copy=False)
        ),
        is_polygon=False,
        color=first.color,
        uv=_frozen(uvs[0] if alone else np.concatenate(uvs)) if uvs else None,
        texture=first.texture,
        motion=first.motion,
        name=name,
    )


def _frozen(array: NDArray[Kind]) -> NDArray[Kind]:
    """Return an array made here, which nobody else writes to, as one that nobody can: `read_only` would copy it."""
    out = np.ascontiguousarray(array)
    out.flags.writeable = False
    return out
