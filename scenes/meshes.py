"""Model files - glTF, OBJ, PLY - as surfaces of a scene, and as scenes by themselves.

The readers are this project's own, on numpy, because files come from anywhere: every size, count, index and name is
checked before it is followed, so that the worst a file can do is to be refused in one sentence. What they read of each
format is said in `gltf`, `mesh_obj` and `mesh_ply`; all end in `mesh_parts`. In tests they are held against trimesh.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from aliasbench.scenes.errors import InputError, unknown_name
from aliasbench.scenes.framing import frame_surfaces
from aliasbench.scenes.gltf import read_gltf
from aliasbench.scenes.gltf_document import read_document
from aliasbench.scenes.limits import MIN_LENGTH, camera_fault, name_of_stem, reach_fault
from aliasbench.scenes.local_files import read_head, read_local
from aliasbench.scenes.mesh_obj import read_obj
from aliasbench.scenes.mesh_parts import Part, build_surfaces
from aliasbench.scenes.mesh_ply import read_ply
from aliasbench.scenes.model import Animation, Camera, ImageTexture, Scene, Surface
from aliasbench.scenes.projection import view_at

MODEL_SUFFIXES = (".glb", ".gltf", ".obj", ".ply")
FPS = 30
_HEAD = 4096  # bytes, in which what is no text shows


@dataclass(frozen=True, slots=True, eq=False)
class MeshFile:
    """What a model file holds.

    Attributes
    ----------
    surfaces : tuple of Surface
        One for each colour, texture and motion, named ``label#0``, ``label#1`` and so on.
    textures : mapping of str to ImageTexture
        By the names that the surfaces use; each begins with the label and a ``#``. Not to be written to.
    camera : Camera or None
        The file's first.
    animation : Animation or None
        As long as the file's, None where nothing moves.
    """

    surfaces: tuple[Surface, ...]
    textures: Mapping[str, ImageTexture]
    camera: Camera | None = None
    animation: Animation | None = None


def load_mesh(path: Path, *, label: str | None = None, retextured: bool = False) -> MeshFile:
    """Return a model file's surfaces in its own coordinates, y up, with their textures.

    Parameters
    ----------
    path : Path
        Ends in one of `MODEL_SUFFIXES`.
    label : str, optional
        What names of surfaces and textures begin with: the file's name where it is not given. Give the path as a scene
        file writes it, so that two files of one name are told apart.
    retextured : bool
        Another texture is put on all surfaces: those of the file are not read, and none is made of vertex colours, of
        which the mean is left. Texture coordinates are the file's own, None where a part has none.

    Raises
    ------
    InputError
        If the file is of no known kind, missing, damaged, too large, or names what is missing or not beside it.
    """
    file, suffix = str(path), path.suffix.lower()
    label = path.name if label is None else label
    if suffix not in MODEL_SUFFIXES:
        raise InputError(f"{file}: {unknown_name('kind of model file', suffix, MODEL_SUFFIXES)}")
    textures: dict[str, ImageTexture] = {}
    parts: list[Part]
    camera, duration = None, 0.0
    if suffix in (".glb", ".gltf"):
        model = read_gltf(read_document(path), label, retextured=retextured)
        parts, textures, camera, duration = list(model.parts), model.textures, model.camera, model.duration_s
    elif suffix == ".obj":
        if b"\0" in read_head(path, file, _HEAD):
            raise InputError(f"{file}: is no OBJ text (it has bytes of 0); an OBJ file is lines such as 'v x y z'")
        parts, textures = read_obj(read_local(path, file), path, label, retextured=retextured)
    else:
        if read_head(path, file, 3) != b"ply":
            raise InputError(f"{file}: has no PLY header ('ply' to 'end_header'); it is damaged, or no PLY file")
        parts = read_ply(read_local(path, file), file)
    surfaces, palettes = build_surfaces(parts, file, label, retextured=retextured)
    moving = any(not s.motion.is_static for s in surfaces) or (camera is not None and not camera.is_static)
    animation = None
    if moving:
        frames = max(1, round(duration * FPS))
        # So many frames a second that the animation is a whole number of them, and loops where its motion does.
        animation = Animation(fps=frames / duration, frames=frames)
    return MeshFile(surfaces, MappingProxyType({**textures, **palettes}), camera, animation)


def load_model_scene(path: Path) -> Scene:
    """Return a model file as a scene: under its own camera, or framed by one that shows all of it; on black.

    Raises
    ------
    InputError
        As `load_mesh` does; and where the model is too large, too far away or too small to be drawn under its camera.
    """
    model = load_mesh(path)
    animation = model.animation or Animation()
    extent = max(float((s.vertices.max(axis=0) - s.vertices.min(axis=0)).max()) for s in model.surfaces)
    if not extent >= MIN_LENGTH:
        raise InputError(f"{path}: is {extent:g} units large; {MIN_LENGTH:g} at least are needed")
    camera = model.camera or frame_surfaces(model.surfaces, animation)
    try:
        view_at(camera, animation, 0, 0.0, (2, 2))
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    faults = [camera_fault(camera, animation), *(reach_fault(s, camera, animation) for s in model.surfaces)]
    for fault in faults:
        if fault is not None:
            raise InputError(f"{path}: its {'coordinates' if fault[0] == 'shape' else fault[0]} must be {fault[1]}")
    return Scene(
        name=name_of_stem(path.stem),
        camera=camera,
        objects=model.surfaces,
        textures=model.textures,
        animation=animation,
    )
