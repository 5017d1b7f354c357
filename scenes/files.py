"""Scenes from what a user writes: a catalog name, a name with parameters, or a TOML scene file (schema 1).

A file is read strictly (see `schema`): whatever is wrong is one sentence with the file, the key's path, the value and
what is allowed, before any renderer sees it. `load_scene` raises the first; `checking` collects them all.
"""

import math
import re
import tomllib
from functools import partial
from pathlib import Path

import numpy as np

from aliasbench.scenes.catalog import SCENES, build_scene
from aliasbench.scenes.errors import InputError, reason_of, shortened, unknown_name
from aliasbench.scenes.facts import read_facts
from aliasbench.scenes.file_objects import SHAPES, Pieces, read_light, read_name, read_object
from aliasbench.scenes.file_textures import read_textures
from aliasbench.scenes.limits import (
    COUNT,
    LENGTH,
    MAX_CATALOG_NAME,
    MAX_FILE_BYTES,
    MAX_NAME,
    MIN_FOV_DEG,
    MIN_FPS,
    MIN_LENGTH,
    RADIANCE,
    camera_fault,
    end_of,
    name_of_stem,
    reach_fault,
)
from aliasbench.scenes.lines import excess
from aliasbench.scenes.local_files import open_input
from aliasbench.scenes.meshes import MODEL_SUFFIXES, load_model_scene
from aliasbench.scenes.model import Animation, Camera, Facts, Scene, Surface, Texture
from aliasbench.scenes.problems import Problems
from aliasbench.scenes.projection import view_at
from aliasbench.scenes.schema import Table

SCHEMA = 1
NO_MEMORY = "needs more memory than there is"
_ROOT = (
    *("schema", "name", "background", "contrast", "bounces"),
    *("animation", "camera", "object", "texture", "light", "fact"),
)
_PROJECTIONS = ("orthographic", "perspective")
_CAMERA = (
    *("projection", "position", "target", "up", "height", "fov_y_deg"),
    *("velocity", "target_velocity", "lens_radius", "focus_distance"),
)


def load_scene(text: str) -> Scene:
    """Return the scene that a text names.

    Parameters
    ----------
    text : str
        The path of a model file (ends in one of `meshes.MODEL_SUFFIXES`) or of a scene file (anything else that exists
        as a file, ends in ``.toml`` or has a path separator); otherwise a name in `catalog.SCENES`, with parameters or
        without: ``propeller:blades=5,rev_per_s=23.5``.

    Raises
    ------
    InputError
        If there is no such scene, or the file or a parameter is wrong.
    TypeError
        If `text` is none.
    """
    if not isinstance(text, str):
        raise TypeError(f"a scene is named by a text (of the catalog, or a file's path), not by {type(text).__name__}")
    try:
        return _load(text.strip())
    except MemoryError as error:
        raise InputError(f"{text.strip()}: {NO_MEMORY}") from error
    except OSError as error:
        raise InputError(f"{text.strip()}: cannot be read ({reason_of(error)})") from error


def _load(given: str) -> Scene:
    path = Path(given)
    if path.suffix.lower() in MODEL_SUFFIXES:
        return load_model_scene(path)
    if given and (path.suffix.lower() == ".toml" or "/" in given or "\\" in given or _is_file(path)):
        return read_scene_file(path)
    name = given.partition(":")[0].strip()
    if name not in SCENES:
        problem = unknown_name("scene", name, SCENES)
        raise InputError(f"{problem}; or the path of a scene file (.toml)")
    return build_scene(given)


def read_scene_file(path: Path) -> Scene:
    """Return the scene of a TOML file (schema 1); see `load_scene`."""
    return read_scene_text(read_text(path), str(path), path.parent)


def read_scene_text(text: str, file: str, folder: Path) -> Scene:
    """Return the scene of a TOML text.

    Parameters
    ----------
    text : str
    file : str
        What messages call it.
    folder : Path
        To which its paths are relative.
    """
    return read_root(Table(Problems(file), "", parse_toml(text, file)), folder, Path(file).stem)


def read_root(root: Table, folder: Path, stem: str) -> Scene:
    """Return the scene of a file's root table; its name is `stem` where the file gives none.

    Where problems are collected the scene is one only if there are none.
    """
    problems = root.problems
    # First: a newer file may well have keys that this version does not know.
    if root.whole("schema", SCHEMA, at_least=0) != SCHEMA:
        root.refuse("schema", f"{SCHEMA}, the only version of scene files that this version reads")
    root.check_keys(_ROOT)
    start = problems.mark()
    animation = problems.attempt(lambda: _read_animation(root.table("animation"))) or Animation()
    camera = problems.attempt(lambda: _read_camera(root.table("camera"), animation)) or Camera("orthographic")
    staged = problems.sound_since(start)
    textures = problems.attempt(lambda: read_textures(root.table("texture"), folder)) or {}
    after_textures = problems.mark()
    objects: list[Surface] = []
    brought: dict[str, Texture] = {}
    for table in root.tables("object"):
        pieces = problems.attempt(partial(read_object, table, textures, folder))
        if pieces is None:
            continue
        if staged:
            _check_reach(table, pieces, camera, animation)
        objects += pieces.surfaces
        brought |= pieces.textures
    most = MAX_CATALOG_NAME if _is_of_catalog(root.values.get("name")) else MAX_NAME
    checked = objects if staged and problems.sound_since(after_textures) else []
    return Scene(
        name=read_name(root, name_of_stem(stem), most),
        camera=camera,
        objects=tuple(objects),
        textures=textures | brought,
        lights=tuple(
            light
            for table in root.tables("light")
            if (light := problems.attempt(partial(read_light, table))) is not None
        ),
        background=root.color("background", (0.0, 0.0, 0.0)),
        contrast=root.number("contrast", 1.0, at_least=1 / RADIANCE, at_most=RADIANCE),
        bounces=root.whole("bounces", 0, at_least=0, at_most=1),
        animation=animation,
        facts=problems.attempt(lambda: read_facts(root.table("fact"), checked, camera)) or Facts(),
    )


def _is_of_catalog(name: object) -> bool:
    return isinstance(name, str) and name.partition(":")[0] in SCENES


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:
        return False  # a text too long to be a path, say


def read_text(path: Path) -> str:
    """Return the text of a scene file; raise `InputError` if it cannot be read or is no text of a sensible size."""
    file = str(path)
    try:
        with open_input(path) as stream:
            content = stream.read(MAX_FILE_BYTES + 1)
        if len(content) > MAX_FILE_BYTES:
            raise InputError(f"{file}: is over {MAX_FILE_BYTES >> 20} MiB; no scene file may be")
        # Some editors open a text in UTF-8 with a byte order mark, which says nothing.
        return content.decode("utf-8").removeprefix("\ufeff")
    except UnicodeDecodeError as error:
        raise InputError(f"{file}: byte {error.start} is not UTF-8; a scene file is a TOML text in UTF-8") from error
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"{file}: cannot be read ({reason_of(error)}); the path of a scene file (.toml) is needed"
        ) from error


def parse_toml(text: str, file: str) -> dict[str, object]:
    """Return the tables of a TOML text; raise `InputError` with line and column if it is none."""
    if (found := excess(text)) is not None:
        raise InputError(f"{file}: line {found[0]}: {found[1]}; no scene file needs that")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        said = re.fullmatch(r"(.*) \(at line (\d+), column (\d+)\)", str(error), re.DOTALL)
        if said is not None:
            what, line, column = said[1], int(said[2]), int(said[3])
        else:
            # Only the end of the document is reported without a place.
            what = str(error).removesuffix(" (at end of document)")
            line, column = text.count("\n") + 1, len(text) - (text.rfind("\n") + 1) + 1
        raise InputError(f"{file}: line {line}, column {column}: not valid TOML: {shortened(what)}") from error
    except ValueError as error:
        # What Python says of an integer with more decimal digits than it converts.
        number = re.search(r"\d(_?\d){999}", text)
        line = text.count("\n", 0, number.start()) + 1 if number else 1
        raise InputError(
            f"{file}: line {line}: a number of thousands of digits; at most {LENGTH:g} is of use"
        ) from error
    except RecursionError as error:
        raise InputError(f"{file}: nested too deeply to be a scene file") from error


def _read_animation(table: Table) -> Animation:
    table.check_keys(("fps", "frames", "shutter"))
    return Animation(
        fps=table.number("fps", 30.0, at_least=MIN_FPS, at_most=COUNT),
        frames=table.whole("frames", 1, at_least=1),
        shutter=table.number("shutter", 0.0, at_least=0.0, at_most=1.0),
    )


def _read_camera(table: Table, animation: Animation) -> Camera:
    mark = table.problems.mark()
    table.check_keys(_CAMERA)
    flat = table.choice("projection", _PROJECTIONS, "orthographic") == "orthographic"
    is_known = table.values.get("projection", "orthographic") in _PROJECTIONS
    for key, wanted in (("fov_y_deg", "perspective"), ("height", "orthographic")):
        if is_known and table.has(key) and flat != (wanted == "orthographic"):
            table.report(key, f'left out: it belongs to projection = "{wanted}"')
    camera = Camera(
        projection="orthographic" if flat else "perspective",
        position=table.vector("position", (0.0, 0.0, 5.0)),
        target=table.vector("target", (0.0, 0.0, 0.0)),
        up=table.direction("up", (0.0, 1.0, 0.0)),
        height=table.number("height", 2.0, at_least=MIN_LENGTH, at_most=LENGTH) if flat else None,
        fov_y_deg=None if flat else table.number("fov_y_deg", at_least=MIN_FOV_DEG, below=180.0),
        velocity=table.vector("velocity", (0.0, 0.0, 0.0)),
        target_velocity=table.vector("target_velocity") if table.has("target_velocity") else None,
        lens_radius=table.number("lens_radius", 0.0, at_least=0.0, at_most=LENGTH),
        focus_distance=(
            table.number("focus_distance", at_least=MIN_LENGTH, at_most=LENGTH) if table.has("focus_distance") else None
        ),
    )
    if not table.problems.sound_since(mark):
        return camera
    for t in _critical_times(camera, animation):
        try:
            view_at(camera, animation, 0, t * animation.fps, (2, 2))
        except InputError as error:
            key = "up" if " up " in str(error) else "position"
            table.problems.refuse((*table.place, key), str(error))
    if (fault := camera_fault(camera, animation)) is not None:
        table.refuse(*fault)
    return camera


def _check_reach(table: Table, pieces: Pieces, camera: Camera, animation: Animation) -> None:
    for surface in pieces.surfaces:
        if (fault := reach_fault(surface, camera, animation)) is not None:
            key, allowed = fault
            shape = next(k for k in SHAPES if table.has(k))
            if key == "shape" or table.has(key):
                table.report(shape if key == "shape" else key, allowed)
            else:
                # Its own animation: the scene file says nothing of a motion.
                table.report(shape, f"a model with a {key} {allowed}")


def _critical_times(camera: Camera, animation: Animation) -> list[float]:
    """Return the times of the animation at which the camera can be degenerate: its ends, and where it comes nearest."""
    end = end_of(animation)
    axis = np.array(camera.target) - np.array(camera.position)
    drift = np.array(camera.target_velocity or camera.velocity) - np.array(camera.velocity)
    up = np.array(camera.up) / math.hypot(*camera.up)
    times = [0.0, end]
    # |p + q t| is least at t = -p.q / q.q; p, q first the axis itself, then its part across `up`.
    for p, q in ((axis, drift), (np.cross(axis, up), np.cross(drift, up))):
        if (q_squared := float(q @ q)) > 0.0:
            times.append(min(max(0.0, -float(p @ q) / q_squared), end))
    return times
