"""The object of a scene file that is a model file: its surfaces, with what the object says of all of them.

A colour multiplies every surface's own; a texture of the scene file replaces theirs, in the model's own coordinates,
and is multiplied by the mean of vertex colours as a texture of the model's own is; a motion replaces the model's
animation, which goes on by the scene file's clock otherwise.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.file_objects import Pieces, read_material, read_motion, read_name, read_texture_name
from aliasbench.scenes.meshes import load_mesh
from aliasbench.scenes.model import Motion, Texture
from aliasbench.scenes.schema import Table


def read_mesh_object(table: Table, textures: Mapping[str, Texture], folder: Path) -> Pieces:
    """Return the surfaces of an object with `mesh`, and the textures that the model file brings along.

    Parameters
    ----------
    table : Table
        The object, its keys known to be keys of objects.
    textures : mapping of str to Texture
        Those of the scene file.
    folder : Path
        To which the model's path is relative.
    """
    if table.has("uv"):
        table.report("uv", "left out: a mesh has its own")
    given = table.text("mesh")
    texture = read_texture_name(table, textures)
    red, green, blue = table.color("color", (1.0, 1.0, 1.0))
    material = read_material(table)
    moves = any(table.has(key) for key in ("velocity", "spin", "matrices"))
    motion = table.problems.attempt(lambda: read_motion(table)) or Motion()
    name = read_name(table, "")
    place = (*table.place, "mesh")
    if not given:
        table.problems.give_up()
    try:
        model = load_mesh(folder / given, label=given, retextured=texture is not None)
    except InputError as error:
        table.problems.refuse(place, f"{table.where('mesh')}: {error}")
    if taken := sorted(set(model.textures) & set(textures)):
        table.problems.refuse(
            place, f"{table.where('mesh')}: its texture {taken[0]!r} has the name of the scene file's"
        )
    if texture is not None and any(surface.uv is None for surface in model.surfaces):
        table.problems.refuse(
            (*table.place, "texture"),
            f"{table.where('texture')}: {given!r} has parts without texture coordinates; a texture needs them",
        )
    surfaces = tuple(
        replace(
            surface,
            color=(surface.color[0] * red, surface.color[1] * green, surface.color[2] * blue),
            texture=surface.texture if texture is None else texture,
            material=material,
            motion=motion if moves else surface.motion,
            name=f"{name} {k}" if name else surface.name,
        )
        for k, surface in enumerate(model.surfaces)
    )
    return Pieces(surfaces, model.textures)
