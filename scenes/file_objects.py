"""What a scene file says about objects and lights, as the model's own data.

Apart from `files`, which knows texts, paths and the camera: here are the keys of one object, and which go together. An
object is a polygon, a quad, a model file (`mesh`), or triangles written out: `vertices` with `triangles`, the form in
which meshes are exported.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from aliasbench.scenes.errors import InputError, unknown_name
from aliasbench.scenes.inline_data import read_rows, read_triangles
from aliasbench.scenes.limits import COUNT, LENGTH, MAX_NAME
from aliasbench.scenes.model import (
    FloatArray,
    Light,
    Material,
    Motion,
    Spin,
    Surface,
    Texture,
    Vec3,
    read_only,
)
from aliasbench.scenes.schema import Table
from aliasbench.scenes.shapes import QUAD_UV, polygon

SHAPES = ("polygon", "quad", "mesh", "vertices")
_MATERIALS: Mapping[str, tuple[str, ...]] = {
    "unlit": (),
    "diffuse": (),
    "glossy": ("roughness",),
    "glass": ("ior", "abbe"),
}
_OBJECT = (
    *("name", *SHAPES, "triangles", "color", "uv", "texture"),
    *("material", "roughness", "ior", "abbe", "velocity", "spin", "matrices"),
)


@dataclass(frozen=True, slots=True)
class Pieces:
    """The surfaces of one `[[object]]`, and the textures that it brings along (those of a model file)."""

    surfaces: tuple[Surface, ...]
    textures: Mapping[str, Texture] = field(default_factory=dict)


def read_object(table: Table, textures: Mapping[str, Texture], folder: Path) -> Pieces:
    """Return what one `[[object]]` is.

    Parameters
    ----------
    table : Table
    textures : mapping of str to Texture
        What its texture must be one of.
    folder : Path
        Of the scene file, to which the paths of model files are relative.
    """
    table.check_keys(_OBJECT)
    shape = table.problems.attempt(lambda: table.check_exclusive(SHAPES, "an object"))
    if table.has("triangles") and shape not in ("vertices", None):
        table.report("triangles", "left out: it belongs to vertices")
    if shape == "mesh":
        # Imported here: it reads its other keys with this module's functions.
        from aliasbench.scenes.file_meshes import read_mesh_object

        return read_mesh_object(table, textures, folder)
    points = np.empty((0, 3)) if shape is None else _read_points(table, shape)
    texture = read_texture_name(table, textures)
    uv = None if shape is None else _read_uv(table, shape, points)
    if texture is not None and uv is None and shape is not None and len(points):
        table.report("uv", f"given with a texture: {len(points)} points of 2 numbers each, {_one_for_each(shape)}")
        texture = None
    surface = Surface(
        points,
        np.empty((0, 3), dtype=np.int32),
        uv=uv,
        texture=texture,
        color=table.color("color", (1.0, 1.0, 1.0)),
        material=read_material(table),
        motion=table.problems.attempt(lambda: read_motion(table)) or Motion(),
        name=read_name(table, ""),
    )
    if shape is None or len(points) == 0:
        table.problems.give_up()
    if shape == "vertices":
        indices = read_triangles(table, "triangles", len(points))
        return Pieces((replace(surface, triangles=read_only(indices), is_polygon=False),))
    try:
        outline = polygon(points)
    except InputError as error:
        table.problems.refuse((*table.place, shape), f"{table.where(shape)}: {str(error).removeprefix('polygon: ')}")
    return Pieces((replace(surface, vertices=outline.vertices, triangles=outline.triangles),))


def _read_points(table: Table, shape: str) -> FloatArray:
    if shape == "vertices":
        return read_only(read_rows(table, "vertices", 3, limit=LENGTH))
    return read_only(table.points(shape, 3, 4 if shape == "quad" else None))


def _read_uv(table: Table, shape: str, points: FloatArray) -> FloatArray | None:
    if not table.has("uv"):
        return read_only(np.array(QUAD_UV)) if shape == "quad" else None
    uv = read_rows(table, "uv", 2, limit=COUNT)
    if len(uv) and len(points) and len(uv) != len(points):
        table.report("uv", f"a list of {len(points)} points of 2 numbers each, {_one_for_each(shape)}")
    return read_only(uv)


def _one_for_each(shape: str) -> str:
    return "one for each of the vertices" if shape == "vertices" else f"one for each point of the {shape}"


def read_texture_name(table: Table, textures: Mapping[str, Texture]) -> str | None:
    """Return the key `texture` of an object, None where it has none."""
    name = table.text("texture") if table.has("texture") else None
    if name and name not in textures:
        table.fail("texture", f"{table.where('texture')}: {unknown_name('texture', name, textures)}")
    return name or None


def read_name(table: Table, default: str, most: int = MAX_NAME) -> str:
    """Return the key `name`, a text that may be printed as it is."""
    name = table.text("name", default)
    if len(name) > most or not name.isprintable():
        table.report("name", f"a text of printable characters, at most {most}")
        return default
    return name


def read_material(table: Table) -> Material:
    """Return the material of an object."""
    mark = table.problems.mark()
    kind = table.choice("material", tuple(_MATERIALS), "unlit")
    if not table.problems.sound_since(mark):
        return Material("unlit")
    for owner, keys in _MATERIALS.items():
        for key in keys:
            if table.has(key) and owner != kind:
                table.report(key, f'left out: it belongs to material = "{owner}"')
    if kind == "glossy":
        return Material("glossy", roughness=table.number("roughness", 0.1, above=0.0, at_most=1.0))
    if kind == "glass":
        abbe = table.number("abbe", above=0.0, at_most=COUNT) if table.has("abbe") else None
        return Material("glass", ior=table.number("ior", 1.5, above=0.0, at_most=COUNT), abbe=abbe)
    return Material("diffuse" if kind == "diffuse" else "unlit")


def read_motion(table: Table) -> Motion:
    """Return the motion of an object: a velocity and a spin, or two matrices."""
    if table.has("matrices"):
        for key in ("velocity", "spin"):
            if table.has(key):
                table.report(key, "left out: matrices say the whole motion")
        return Motion(matrices=_read_matrices(table))
    spin = None
    if table.has("spin"):
        turning = table.table("spin")
        turning.check_keys(("axis", "center", "rev_per_s"))
        spin = Spin(
            turning.direction("axis", (0.0, 0.0, 1.0)),
            turning.vector("center", (0.0, 0.0, 0.0)),
            turning.number("rev_per_s", at_least=-COUNT, at_most=COUNT),
        )
    return Motion(table.vector("velocity", (0.0, 0.0, 0.0)), spin)


def _read_matrices(table: Table) -> tuple[tuple[float, ...], tuple[float, ...]]:
    rows = table.points("matrices", 16, 2)
    if len(rows) == 0:
        table.problems.give_up()
    begin, end = rows
    for matrix in (begin, end):
        if matrix[12:].tolist() != [0.0, 0.0, 0.0, 1.0]:
            table.refuse("matrices", "two affine row-major 4 x 4 matrices, each ending in 0, 0, 0, 1")
    return tuple(begin.tolist()), tuple(end.tolist())


def read_light(table: Table) -> Light:
    """Return the light of one `[[light]]`."""
    table.check_keys(("quad", "radiance"))
    corners, radiance = table.points("quad", 3, 4), table.color("radiance")
    if len(corners) == 0:
        table.problems.give_up()
    try:
        polygon(corners)
    except InputError as error:
        table.problems.refuse((*table.place, "quad"), f"{table.where('quad')}: {str(error).removeprefix('polygon: ')}")
    if np.abs(corners[0] - corners[1] + corners[2] - corners[3]).max() > 1e-6 * np.ptp(corners, axis=0).max():
        table.refuse("quad", "the four corners of a parallelogram, in order")
    a, b, c, d = (_as_vec3(corner.tolist()) for corner in corners)
    return Light((a, b, c, d), radiance)


def _as_vec3(values: list[float]) -> Vec3:
    x, y, z = values
    return (x, y, z)
