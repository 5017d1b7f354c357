"""From triangles as files give them to surfaces as engines draw them: checked, merged, without what has no area.

Every format ends here, so that each rule is written once: coordinates are finite, indices have their vertex, triangles
of no area are dropped without a word, what has the same colour, texture and motion is one surface, and nothing is
expanded beyond what the size of the file can account for.

The model has no colours at vertices. Where a file has, each triangle gets the mean of its corners' from a texture with
one texel for each triangle; beside a texture of the file's own the mean over the whole part multiplies it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.limits import COUNT, LENGTH, RADIANCE
from aliasbench.scenes.model import FloatArray, ImageTexture, Motion, Surface, Vec3, read_only

MOST_TRIANGLES = 20_000_000
_FREE_BYTES = 400_000_000  # of surfaces that any file may give
_BYTES_PER_BYTE = 8  # and that it may give for each byte of its own
_VERTEX_BYTES, _TRIANGLE_BYTES = 40, 12

Indices = NDArray[np.integer]


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


def check_amount(file: str, vertices: int, triangles: int, size: int) -> None:
    """Raise `InputError` if a file of `size` bytes comes to more vertices or triangles than are drawn."""
    if triangles > MOST_TRIANGLES:
        raise InputError(f"{file}: comes to {triangles} triangles; at most {MOST_TRIANGLES} are allowed")
    needed = vertices * _VERTEX_BYTES + triangles * _TRIANGLE_BYTES
    if needed > max(_FREE_BYTES, _BYTES_PER_BYTE * size):
        raise InputError(
            f"{file}: {size} bytes come to {vertices} vertices and {triangles} triangles, {needed} bytes in memory; "
            f"at most {_FREE_BYTES}, or {_BYTES_PER_BYTE} times the file, are allowed"
        )


def build_surfaces(parts: Sequence[Part], file: str, label: str) -> tuple[tuple[Surface, ...], dict[str, ImageTexture]]:
    """Return the surfaces of a file's parts, named ``label#0``, ``label#1`` ..., and the textures of vertex colours.

    Raises
    ------
    InputError
        If a coordinate is not finite or out of reach, an index has no vertex, or nothing with an area is left.
    """
    groups: dict[tuple[object, ...], list[Part]] = {}
    palettes: dict[str, ImageTexture] = {}
    for number, part in enumerate(parts):
        sound = _without_waste(_checked(part, file))
        if len(sound.triangles) == 0:
            continue
        if sound.vertex_colors is not None:
            sound = _colored(sound, f"{label}#colors {number}", palettes)
        key = (sound.color, sound.texture, sound.motion, sound.uv is None)
        groups.setdefault(key, []).append(sound)
    if not groups:
        raise InputError(f"{file}: has no triangle with an area; a mesh to draw is needed")
    return tuple(_surface(group, f"{label}#{k}") for k, group in enumerate(groups.values())), palettes


def fan(first: int, count: int) -> list[tuple[int, int, int]]:
    """Return the triangles of `count` corners in order from index `first`, all about the first corner."""
    return [(first, first + k, first + k + 1) for k in range(1, count - 1)]


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


def _colored(part: Part, name: str, palettes: dict[str, ImageTexture]) -> Part:
    """Return a part whose vertex colours have become its colour, or a texture of one texel for each triangle."""
    colors = part.vertex_colors
    if colors is None:
        return part
    lowest = np.maximum(colors, 0.0)
    if part.texture is not None or (np.ptp(lowest, axis=0) == 0.0).all():
        r, g, b = (lowest.mean(axis=0) if part.texture is not None else lowest[0]).tolist()
        color = (part.color[0] * r, part.color[1] * g, part.color[2] * b)
        return replace(part, color=color, vertex_colors=None)
    count = len(part.triangles)
    side = math.ceil(math.sqrt(count))
    rows = math.ceil(count / side)
    texels = np.ones((rows * side, 4), np.float32)
    texels[:count, :3] = lowest[part.triangles].mean(axis=1)
    palettes[name] = ImageTexture(read_only(texels.reshape(rows, side, 4)), source=name)
    number = np.repeat(np.arange(count), 3)
    return replace(
        part,
        positions=part.positions[part.triangles.ravel()],
        triangles=np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        uv=np.stack([(number % side + 0.5) / side, (number // side + 0.5) / rows], axis=1),
        texture=name,
        vertex_colors=None,
    )


def _surface(parts: Sequence[Part], name: str) -> Surface:
    first = parts[0]
    starts = np.cumsum([0, *(len(p.positions) for p in parts[:-1])])
    uvs = [p.uv for p in parts if p.uv is not None]
    alone = len(parts) == 1
    return Surface(
        vertices=read_only(first.positions if alone else np.concatenate([p.positions for p in parts])),
        triangles=read_only(
            np.concatenate([p.triangles + s for p, s in zip(parts, starts, strict=True)]).astype(np.int32)
        ),
        is_polygon=False,
        color=first.color,
        uv=read_only(uvs[0] if alone else np.concatenate(uvs)) if uvs else None,
        texture=first.texture,
        motion=first.motion,
        name=name,
    )
