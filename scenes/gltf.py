"""glTF models (.glb, .gltf) as parts of one look each, in the world, moving as the file's animation says.

What is read: the default scene's nodes with their transforms (matrices, translation, rotation and scale, mirrored and
instanced ones), triangles, strips and fans of all their meshes, indexed or not, base colours and textures
(`gltf_materials`), vertex colours (COLOR_0) with their alpha, the first camera, the first animation where it is rigid
and steady (`gltf_animation`). Points and lines have no area and are left out; skins and morph targets stay in their
rest shape, a skinned mesh where its own coordinates put it, as the specification says of the node it hangs on.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.gltf_animation import read_animation
from aliasbench.scenes.gltf_document import Document, as_reals, entries
from aliasbench.scenes.gltf_materials import Look, read_look
from aliasbench.scenes.gltf_nodes import Placed, walk_nodes
from aliasbench.scenes.gltf_textures import TextureReader
from aliasbench.scenes.limits import COUNT, LENGTH, MIN_FOV_DEG, MIN_LENGTH, RADIANCE
from aliasbench.scenes.mesh_parts import Indices, Part, check_amount
from aliasbench.scenes.model import Camera, FloatArray, ImageTexture, Motion, Vec3, as_vec3
from aliasbench.scenes.schema import Table

_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_ROUNDING = 1e-6  # of alpha in float32


@dataclass(frozen=True, slots=True, eq=False)
class GltfModel:
    """What a glTF file holds; `duration_s` is its animation's, 0 where there is none."""

    parts: Sequence[Part]
    textures: dict[str, ImageTexture]
    camera: Camera | None
    duration_s: float


@dataclass(frozen=True, slots=True, eq=False)
class _Primitive:
    """The arrays of one primitive, read once for all nodes that show it."""

    positions: FloatArray
    triangles: Indices
    uv: FloatArray | None
    texture: str | None
    color: Vec3
    vertex_colors: FloatArray | None
    place: str


def read_gltf(document: Document, label: str, *, retextured: bool = False) -> GltfModel:
    """Return the model of a document; its textures' names begin with `label`.

    Where it is to be `retextured` no image is read, and coordinates are those in which the model's pictures are.

    Raises
    ------
    InputError
        If anything that is drawn is damaged, missing or beyond what is allowed.
    """
    file = document.root.file
    animated, duration = read_animation(document)
    placed = list(walk_nodes(document, animated))
    shown = [(place, found[0]) for place in placed if (found := document.follow(place.node, "mesh", "meshes"))]
    counts: dict[int, tuple[int, int, int, int]] = {}
    for _, mesh in shown:
        if mesh not in counts:
            counts[mesh] = _amount(document, document.lists["meshes"][mesh])
    vertices, triangles, colored, drawn = (sum(counts[mesh][k] for _, mesh in shown) for k in range(4))
    check_amount(file, vertices, triangles, document.size, colored=colored, parts=drawn)
    reader = TextureReader(document, label, retextured=retextured)
    looks: dict[int | None, Look] = {}
    hidden: list[str] = []  # why parts are not drawn
    meshes: dict[int, list[_Primitive]] = {}
    parts: list[Part] = []
    for place, mesh in shown:
        if mesh not in meshes:
            tables = entries(document.lists["meshes"][mesh], "primitives")
            meshes[mesh] = [p for t in tables if (p := _read_primitive(document, t, reader, looks, hidden)) is not None]
        skinned = place.node.has("skin")
        for primitive in meshes[mesh]:
            matrix = np.eye(4) if skinned else place.matrix
            parts.append(
                Part(
                    positions=primitive.positions @ matrix[:3, :3].T + matrix[:3, 3],
                    triangles=primitive.triangles,
                    uv=primitive.uv,
                    color=primitive.color,
                    vertex_colors=primitive.vertex_colors,
                    texture=primitive.texture,
                    motion=Motion() if skinned else place.motion,
                    place=primitive.place,
                )
            )
    if hidden and not parts:
        raise InputError(f"{file}: all of its parts are transparent: {hidden[0]}")
    return GltfModel(parts, reader.textures, _first_camera(document, placed), duration)


def _amount(document: Document, mesh: Table) -> tuple[int, int, int, int]:
    """Return how many vertices, triangles, triangles with colours at their corners, and primitives with triangles a
    mesh says it has, unread.
    """
    vertices = triangles = colored = drawn = 0
    for primitive in entries(mesh, "primitives"):
        found = document.follow(primitive.table("attributes"), "POSITION", "accessors")
        if found is None or _mode(primitive) not in (_TRIANGLES, _STRIP, _FAN):
            continue
        indexed = document.follow(primitive, "indices", "accessors")
        own = found[1].whole("count", at_least=1)
        corners = own if indexed is None else indexed[1].whole("count", at_least=1)
        drawn += 1
        vertices += own
        cut = corners // 3 if _mode(primitive) == _TRIANGLES else max(0, corners - 2)
        triangles += cut
        colored += cut if primitive.table("attributes").has("COLOR_0") else 0
    return vertices, triangles, colored, drawn


def _read_primitive(
    document: Document, primitive: Table, reader: TextureReader, looks: dict[int | None, Look], hidden: list[str]
) -> _Primitive | None:
    """Return a primitive's arrays, None where it draws nothing: points, lines, or nothing left by its alpha."""
    attributes = primitive.table("attributes")
    if _mode(primitive) not in (_TRIANGLES, _STRIP, _FAN) or not attributes.has("POSITION"):
        return None
    place = f"{primitive.file}: {primitive.path}"
    material = document.follow(primitive, "material", "materials")
    number = None if material is None else material[0]
    if number not in looks:
        looks[number] = read_look(document, None if material is None else material[1])
    look = looks[number]
    if look.absent:
        hidden.append(look.absent)
        return None
    positions = _attribute(document, attributes, "POSITION", ("VEC3",), LENGTH)
    triangles = _triangles(document, primitive, len(positions))
    colors = None
    if attributes.has("COLOR_0"):
        colors = _attribute(document, attributes, "COLOR_0", ("VEC3", "VEC4"), RADIANCE, positions)
        before = len(triangles)
        look, triangles = _cut_out(look, colors, triangles)
        if before and len(triangles) == 0:
            hidden.append(f"the alpha of COLOR_0 of {primitive.path} is below {look.cutoff:g}")
        colors = None if look.is_emitted else colors[:, :3]
    color = look.color
    if any(look.emissive):
        if colors is None:
            color = _sum(color, look.emissive)
        else:
            color, colors = (1.0, 1.0, 1.0), np.minimum(colors * color + look.emissive, RADIANCE)
    if len(triangles) == 0:
        return None
    texture, uv = None, None
    if look.image is not None:
        key = f"TEXCOORD_{look.uv_set}"
        if not attributes.has(key):
            attributes.refuse(key, "given: the material's texture uses it")
        texture, uv = reader.use(look, _attribute(document, attributes, key, ("VEC2",), COUNT, positions), place)
    elif attributes.has("TEXCOORD_0"):
        # A scene file may put a texture of its own on the mesh.
        uv = _attribute(document, attributes, "TEXCOORD_0", ("VEC2",), COUNT, positions)
        uv[:, 1] = 1.0 - uv[:, 1]
    return _Primitive(positions, triangles, uv, texture, color, colors, primitive.path)


def _sum(a: Vec3, b: Vec3) -> Vec3:
    red, green, blue = (min(x + y, RADIANCE) for x, y in zip(a, b, strict=True))
    return (red, green, blue)


def _cut_out(look: Look, colors: FloatArray, triangles: Indices) -> tuple[Look, Indices]:
    """Return a look and the triangles that are left of a primitive by the alpha of its vertex colours (n, 3 or 4).

    As with colours: a triangle has the mean of its corners', and a texture is multiplied by that of all that are left.
    """
    if look.cutoff is None or colors.shape[1] == 3 or len(triangles) == 0:
        return look, triangles
    alpha = np.clip(colors[:, 3], 0.0, 1.0)[triangles].mean(axis=1)
    alive = alpha >= look.cutoff - _ROUNDING
    if not alive.any():
        return look, triangles[:0]
    mean = float(alpha[alive].mean())
    return replace(look, cutoff=look.cutoff / mean if mean > 0.0 else None), triangles[alive]


def _mode(primitive: Table) -> int:
    mode = primitive.whole("mode", _TRIANGLES, at_least=0)
    if mode > _FAN:
        primitive.refuse("mode", "a whole number from 0 to 6: points, lines or triangles")
    return mode


def _attribute(
    document: Document, table: Table, key: str, types: Sequence[str], limit: float, positions: FloatArray | None = None
) -> FloatArray:
    """Return an attribute's values, all finite, as many as there are positions."""
    values = as_reals(document.accessor(table, key, types))
    if positions is not None and len(values) != len(positions):
        table.refuse(key, f"an accessor of {len(positions)} elements, as POSITION has, not {len(values)}")
    # Not (x > limit), so that a NaN is caught by the one comparison.
    sound = np.abs(values) <= limit
    if not sound.all():
        first = int(np.argmin(sound.all(axis=1)))
        raise InputError(
            f"{table.file}: {table.where(key)}: element {first} is {values[first].tolist()}; "
            f"finite numbers up to {limit:g} are needed"
        )
    return values


def _triangles(document: Document, primitive: Table, vertices: int) -> Indices:
    """Return the (m, 3) vertex indices of a primitive's list, strip or fan; what is left over of a list is ignored."""
    corners: NDArray[np.integer] = np.arange(vertices, dtype=np.int32)
    if primitive.has("indices"):
        values = document.accessor(primitive, "indices", ("SCALAR",))[:, 0]
        if values.dtype.kind != "u":
            primitive.refuse("indices", "an accessor of unsigned integers")
        if int(values.max()) >= vertices:
            raise InputError(
                f"{primitive.file}: {primitive.path}.indices: index {int(values.max())} has no vertex; "
                f"there are {vertices} vertices"
            )
        corners = values.astype(np.int32)
    mode = _mode(primitive)
    if mode == _TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    if mode == _STRIP:
        return np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
    return np.stack([np.full(max(0, len(corners) - 2), corners[0]), corners[1:-1], corners[2:]], axis=1)


def _first_camera(document: Document, placed: Sequence[Placed]) -> Camera | None:
    """Return the first camera of the scene; it looks along its node's -z with +y up and sees whole depths.

    A camera on a node that moves straight moves along; one that turns stays in its first pose.
    """
    for place in placed:
        found = document.follow(place.node, "camera", "cameras")
        if found is None:
            continue
        table = found[1]
        kind = table.choice("type", ("perspective", "orthographic"), "perspective")
        lens = table.table(kind)
        axes = place.matrix[:3, :3]
        lengths = np.linalg.norm(axes, axis=0)
        if not lengths.min() > MIN_LENGTH:
            place.node.refuse("scale", "above 0: a camera's transform must be invertible")
        eye, forward, up = place.matrix[:3, 3], -axes[:, 2] / lengths[2], axes[:, 1] / lengths[1]
        flat = kind == "orthographic"
        return Camera(
            projection="orthographic" if flat else "perspective",
            position=as_vec3(eye),
            target=as_vec3(eye + forward * max(1.0, float(np.abs(eye).max()))),
            up=as_vec3(up),
            height=2 * lens.number("ymag", at_least=MIN_LENGTH, at_most=LENGTH / 2) if flat else None,
            fov_y_deg=None if flat else math.degrees(_fov(lens)),
            velocity=(0.0, 0.0, 0.0) if place.motion.spin is not None else place.motion.velocity,
        )
    return None


def _fov(lens: Table) -> float:
    return lens.number("yfov", at_least=math.radians(MIN_FOV_DEG), below=math.pi)
