"""What a scene file says about textures, objects and lights, as the model's own data.

Apart from `files`, which knows texts, paths and the camera: here are the keys of one object, and which go together.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from aliasbench.scenes.errors import InputError, NotAvailableError, unknown_name
from aliasbench.scenes.limits import COUNT
from aliasbench.scenes.model import (
    Checker,
    Grating,
    Light,
    Material,
    Motion,
    Spin,
    Surface,
    Texture,
    Vec3,
    ZonePlate,
)
from aliasbench.scenes.schema import Table
from aliasbench.scenes.shapes import QUAD_UV, polygon
from aliasbench.scenes.textures import load_image

_SHAPES = ("polygon", "quad", "mesh")
_MATERIALS: Mapping[str, tuple[str, ...]] = {
    "unlit": (),
    "diffuse": (),
    "glossy": ("roughness",),
    "glass": ("ior", "abbe"),
}
_OBJECT = (
    *_SHAPES,
    *("color", "uv", "texture", "material", "roughness", "ior", "abbe", "velocity", "spin", "matrices"),
)
_TEXTURES = ("checker", "image", "grating", "zone_plate")


def read_textures(table: Table, folder: Path) -> dict[str, Texture]:
    """Return the textures of the table `texture` by name; image paths are relative to `folder`."""
    return {name: _read_texture(table.table(name), folder) for name in table.values}


def _read_texture(table: Table, folder: Path) -> Texture:
    table.check_keys((*_TEXTURES, "alpha_cutoff"))
    kind = table.check_exclusive(_TEXTURES, "a texture")
    if table.has("alpha_cutoff") and kind != "image":
        table.refuse("alpha_cutoff", "left out: it belongs to textures with an image")
    if kind == "image":
        source = table.text("image")
        cutoff = table.number("alpha_cutoff", at_least=0.0, at_most=1.0) if table.has("alpha_cutoff") else None
        try:
            return load_image(folder / source, alpha_cutoff=cutoff, source=source)
        except InputError as error:
            raise InputError(f"{table.file}: {table.where('image')}: {error}") from error
    inner = table.table(kind)
    if kind == "checker":
        inner.check_keys(("squares", "black", "white"))
        across, up = inner.numbers("squares", 2, COUNT)
        if min(across, up) <= 0.0:
            inner.refuse("squares", f"two finite numbers over 0 and at most {COUNT:g} (squares per unit of u and of v)")
        return Checker((across, up), inner.color("black", (0.0, 0.0, 0.0)), inner.color("white", (1.0, 1.0, 1.0)))
    if kind == "grating":
        inner.check_keys(("cycles", "angle_deg", "phase", "profile", "low", "high"))
        return Grating(
            cycles=inner.number("cycles", at_least=0.0, at_most=COUNT),
            angle_deg=inner.number("angle_deg", 0.0, at_least=-COUNT, at_most=COUNT),
            phase=inner.number("phase", 0.0, at_least=-COUNT, at_most=COUNT),
            profile="sine" if inner.choice("profile", ("sine", "square"), "sine") == "sine" else "square",
            low=inner.color("low", (0.0, 0.0, 0.0)),
            high=inner.color("high", (1.0, 1.0, 1.0)),
        )
    inner.check_keys(("center", "k", "phase"))
    u, v = inner.numbers("center", 2, COUNT) if inner.has("center") else (0.5, 0.5)
    return ZonePlate(
        center=(u, v),
        k=inner.number("k", above=0.0, at_most=COUNT),
        phase=inner.number("phase", 0.0, at_least=-COUNT, at_most=COUNT),
    )


def read_object(table: Table, textures: Mapping[str, Texture]) -> Surface:
    """Return the surface of one `[[object]]`; its texture must be one of `textures`."""
    table.check_keys(_OBJECT)
    shape = table.check_exclusive(_SHAPES, "an object")
    if shape == "mesh":
        raise NotAvailableError(
            f"{table.file}: {table.where('mesh')}: meshes are not read in this version; polygon and quad are"
        )
    points = table.points(shape, 3, 4 if shape == "quad" else None)
    texture = table.text("texture") if table.has("texture") else None
    if texture is not None and texture not in textures:
        problem = unknown_name("texture", texture, textures)
        raise InputError(f"{table.file}: {table.where('texture')}: {problem}")
    uv = table.points("uv", 2, limit=COUNT) if table.has("uv") else np.array(QUAD_UV) if shape == "quad" else None
    if uv is not None and len(uv) != len(points):
        table.refuse("uv", f"a list of {len(points)} points of 2 numbers each, one for each point of the {shape}")
    if texture is not None and uv is None:
        table.refuse("uv", f"given with a texture: {len(points)} points of 2 numbers each, one for each of the polygon")
    try:
        return polygon(
            points,
            color=table.color("color", (1.0, 1.0, 1.0)),
            uv=uv,
            texture=texture,
            material=_read_material(table),
            motion=_read_motion(table),
        )
    except InputError as error:
        if str(error).startswith("polygon: "):
            raise InputError(f"{table.file}: {table.where(shape)}: {str(error).removeprefix('polygon: ')}") from error
        raise


def _read_material(table: Table) -> Material:
    kind = table.choice("material", tuple(_MATERIALS), "unlit")
    for owner, keys in _MATERIALS.items():
        for key in keys:
            if table.has(key) and owner != kind:
                table.refuse(key, f'left out: it belongs to material = "{owner}"')
    if kind == "glossy":
        return Material("glossy", roughness=table.number("roughness", 0.1, above=0.0, at_most=1.0))
    if kind == "glass":
        abbe = table.number("abbe", above=0.0, at_most=COUNT) if table.has("abbe") else None
        return Material("glass", ior=table.number("ior", 1.5, above=0.0, at_most=COUNT), abbe=abbe)
    return Material("diffuse" if kind == "diffuse" else "unlit")


def _read_motion(table: Table) -> Motion:
    if table.has("matrices"):
        for key in ("velocity", "spin"):
            if table.has(key):
                table.refuse(key, "left out: matrices say the whole motion")
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
    begin, end = table.points("matrices", 16, 2)
    for matrix in (begin, end):
        if matrix[12:].tolist() != [0.0, 0.0, 0.0, 1.0]:
            table.refuse("matrices", "two affine row-major 4 x 4 matrices, each ending in 0, 0, 0, 1")
    return tuple(begin.tolist()), tuple(end.tolist())


def read_light(table: Table) -> Light:
    """Return the light of one `[[light]]`."""
    table.check_keys(("quad", "radiance"))
    corners = table.points("quad", 3, 4)
    try:
        polygon(corners)
    except InputError as error:
        raise InputError(f"{table.file}: {table.where('quad')}: {str(error).removeprefix('polygon: ')}") from error
    if np.abs(corners[0] - corners[1] + corners[2] - corners[3]).max() > 1e-6 * np.ptp(corners, axis=0).max():
        table.refuse("quad", "the four corners of a parallelogram, in order")
    a, b, c, d = (_as_vec3(corner.tolist()) for corner in corners)
    return Light((a, b, c, d), table.color("radiance"))


def _as_vec3(values: list[float]) -> Vec3:
    x, y, z = values
    return (x, y, z)
