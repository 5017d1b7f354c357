"""Scenes as scene files: a readable TOML text that loads as an equal scene, to the bit.

Numbers are written by `repr`, the shortest text that reads back as the same float64; keys at their default are left
out. What is too long to read stands in the file all the same, so that one file can be the whole scene:

- photographs of scikit-image by name (``skimage:brick.png``);
- other images as float32 EXR, which loses nothing: beside the scene file where a folder is given, otherwise inside it;
- meshes as `vertices` and `triangles`: lists where they are short, base64 otherwise (see `inline_data`). glTF would
  round coordinates to float32.

The text is read back before it is handed out, so that what cannot be written is an error and not another scene.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from aliasbench.scenes.errors import InputError, shortened
from aliasbench.scenes.files import SCHEMA, read_scene_text
from aliasbench.scenes.image_data import exr_bytes
from aliasbench.scenes.inline_data import DATA_PREFIX, MAX_IMAGE_BYTES, encode_array, encode_data
from aliasbench.scenes.model import (
    TEXTURE_KINDS,
    Camera,
    Facts,
    ImageTexture,
    Material,
    Motion,
    Scene,
    Surface,
    Texture,
)
from aliasbench.scenes.photographs import PHOTOGRAPHS, SOURCE_PREFIX, load_photograph
from aliasbench.scenes.shapes import QUAD_UV
from aliasbench.scenes.toml_text import assignment, free_file_name, header, inline_table, safe_file_name, written

LONGEST_LIST = 256  # rows of an array written as numbers; longer ones are base64


@dataclass(frozen=True, slots=True)
class Exported:
    """A scene file's text, and the image files that belong beside it, by name."""

    text: str
    images: Mapping[str, bytes] = field(default_factory=dict)


def export_scene(scene: Scene, *, beside: str | None = None) -> Exported:
    """Return a scene as a scene file.

    Parameters
    ----------
    scene : Scene
    beside : str, optional
        Images become files beside the scene file, their names beginning with this; by default they are in the text.

    Raises
    ------
    InputError
        If an image is too large to be inside the text, or the scene has something that scene files cannot say.
    """
    images: dict[str, bytes] = {}
    blocks = [_root(scene)]
    blocks += [_object(surface) for surface in scene.objects]
    blocks += [_texture(name, texture, beside, images) for name, texture in scene.textures.items()]
    blocks += [
        ["[[light]]", assignment("quad", [list(c) for c in light.quad]), assignment("radiance", light.radiance)]
        for light in scene.lights
    ]
    blocks += _facts(scene.facts)
    text = "\n\n".join("\n".join(block) for block in blocks) + "\n"
    _verify(scene, text, images)
    return Exported(text, images)


def _verify(scene: Scene, text: str, images: Mapping[str, bytes]) -> None:
    label = f"scene {shortened(scene.name)!r} cannot be written as a scene file"
    with TemporaryDirectory(prefix="aliasbench-") as folder:
        for name, content in images.items():
            (Path(folder) / name).write_bytes(content)
        try:
            again = read_scene_text(text, "it", Path(folder))
        except InputError as error:
            raise InputError(f"{label}: {error}") from error
    if again != scene:
        raise InputError(f"{label}: it has something that scene files do not say ({_difference(scene, again)})")


def _difference(one: Scene, other: Scene) -> str:
    names = ("name", "camera", "lights", "background", "contrast", "bounces", "animation", "facts")
    for name in names:
        if getattr(one, name) != getattr(other, name):
            return name
    for index, (a, b) in enumerate(zip(one.objects, other.objects, strict=True)):
        if a != b:
            return f"object {a.name or f'number {index}'}"
    return "textures"


def _root(scene: Scene) -> list[str]:
    moving = scene.animation
    lines = [
        "# linear RGB, world units, seconds; y up, the camera looks from position to target",
        assignment("schema", SCHEMA),
        assignment("name", scene.name),
        assignment("background", scene.background),
        assignment("contrast", scene.contrast) + "  # white minus black, for the metrics",
        *([assignment("bounces", scene.bounces)] if scene.bounces else []),
        "",
        "[animation]  # frame n is at n / fps; the shutter is open for this share of 1 / fps",
        assignment("fps", moving.fps),
        assignment("frames", moving.frames),
        assignment("shutter", moving.shutter),
        "",
        "[camera]",
    ]
    return lines + _camera(scene.camera)


def _camera(camera: Camera) -> list[str]:
    plain = Camera(camera.projection)
    values: dict[str, object] = {
        "projection": camera.projection,
        "position": camera.position,
        "target": camera.target,
    }
    values |= {"up": camera.up} if _differs(camera.up, plain.up) else {}
    for key in ("height", "fov_y_deg"):
        if (value := getattr(camera, key)) is not None:
            values[key] = value
    for key in ("velocity", "target_velocity", "lens_radius", "focus_distance"):
        if _differs(value := getattr(camera, key), getattr(plain, key)):
            values[key] = value
    notes = {"height": "  # world units from bottom to top", "velocity": "  # world units per second"}
    return [assignment(key, value) + notes.get(key, "") for key, value in values.items()]


def _object(surface: Surface) -> list[str]:
    lines = ["[[object]]"]
    if surface.name:
        lines.append(assignment("name", surface.name))
    lines += _appearance(surface) + _motion(surface.motion)
    is_quad = surface.is_polygon and len(surface.vertices) == 4 and surface.uv is not None
    key = ("quad" if is_quad else "polygon") if surface.is_polygon else "vertices"
    lines.append(_rows(key, surface.vertices))
    count = len(surface.vertices)
    if not surface.is_polygon and _differs(surface.triangles, np.arange(count - count % 3).reshape(-1, 3)):
        lines.append(_rows("triangles", surface.triangles))
    if surface.uv is not None and not (is_quad and not _differs(surface.uv, np.array(QUAD_UV))):
        lines.append(_rows("uv", surface.uv))
    return lines


def _appearance(surface: Surface) -> list[str]:
    values: dict[str, object] = {"color": surface.color}
    if surface.texture is not None:
        values["texture"] = surface.texture
    material, plain = surface.material, Material()
    if material != plain:
        values["material"] = material.kind
    for key in ("roughness", "ior", "abbe"):
        if _differs(value := getattr(material, key), getattr(plain, key)):
            values[key] = value
    return [assignment(key, value) for key, value in values.items()]


def _motion(motion: Motion) -> list[str]:
    lines = []
    if motion.matrices is not None:
        lines.append("# row by row, at the begin and the end of every frame; between, as the lecture has it, linear")
        lines.append(_rows("matrices", np.array(motion.matrices)))
    if _differs(motion.velocity, (0.0, 0.0, 0.0)):
        lines.append(assignment("velocity", motion.velocity) + "  # world units per second")
    if (spin := motion.spin) is not None:
        table = {"axis": spin.axis, "center": spin.center, "rev_per_s": spin.rev_per_s}
        lines.append(f"spin = {inline_table(table)}")
    return lines


def _rows(key: str, rows: np.ndarray) -> str:
    if len(rows) > LONGEST_LIST:
        kind = "int32" if rows.dtype == np.int32 else "float64"
        # A literal string: the reader takes it in one go.
        return f"# {len(rows)} rows of {rows.shape[1]} {kind}\n{key} = '{encode_array(rows)}'"
    items = [written(row) for row in rows.tolist()]
    if sum(map(len, items)) < 90:
        return f"{key} = [{', '.join(items)}]"
    return f"{key} = [\n" + "".join(f"    {item},\n" for item in items) + "]"


def _texture(name: str, texture: Texture, beside: str | None, images: dict[str, bytes]) -> list[str]:
    lines = [header("texture", name)]
    if isinstance(texture, ImageTexture):
        return lines + _image(name, texture, beside, images)
    kind = TEXTURE_KINDS[type(texture)]
    values = {f.name: getattr(texture, f.name) for f in fields(texture)}
    return [*lines, f"# {_TEXTURE_NOTES[kind]}", f"{kind} = {inline_table(values)}"]


_TEXTURE_NOTES = {
    "checker": "squares to a unit of u and of v",
    "grating": "low + (high - low) (1 + cos(2 pi (cycles s + phase))) / 2, s = u cos(angle) + v sin(angle)",
    "zone_plate": "(1 + cos(k r^2 + phase)) / 2, r from the center in uv",
}


def _image(name: str, texture: ImageTexture, beside: str | None, images: dict[str, bytes]) -> list[str]:
    height, width = texture.texels.shape[:2]
    lines = [f"# {width} x {height} texels, linear light"]
    source: str | None = texture.source
    if _is_photograph(texture):
        lines, image, source = ["# a photograph that scikit-image ships"], texture.source, None
    elif beside is not None:
        image = free_file_name(f"{beside}-{safe_file_name(name)}", ".exr", images)
        images[image] = exr_bytes(texture.texels)
        source = None if source == image else source
    else:
        content = exr_bytes(texture.texels)
        if len(content) > MAX_IMAGE_BYTES // 2:
            raise InputError(
                f"texture {shortened(name)!r} is an image of {width} x {height} texels, too large to stand in the "
                "text; name a folder with -o, and it is written beside the scene file"
            )
        image = encode_data("image/x-exr", content)
        source = source or None
    if texture.alpha_cutoff is not None:
        lines.append(assignment("alpha_cutoff", texture.alpha_cutoff) + "  # absent where alpha is less")
    if source is not None:
        lines.append(assignment("source", source) + "  # what the image is called")
    # A literal string where it is long: the reader takes it in one go.
    return [*lines, f"image = '{image}'" if image.startswith(DATA_PREFIX) else assignment("image", image)]


def _is_photograph(texture: ImageTexture) -> bool:
    """Return whether a texture is, texel for texel, the photograph that it is called."""
    word = texture.source.removeprefix(SOURCE_PREFIX)
    if word == texture.source or word not in PHOTOGRAPHS.values():
        return False
    return load_photograph(word, texture.alpha_cutoff) == texture


def _facts(facts: Facts) -> Iterator[list[str]]:
    for edge in facts.edges:
        yield [
            "[[fact.edge]]  # bright to the left of from -> to",
            assignment("from", edge.start),
            assignment("to", edge.end),
        ]
    for kind, found in (("rotor", facts.rotors), ("grating", facts.gratings), ("pan", facts.pans)):
        for fact in found:
            keys = _FACT_KEYS[kind]
            yield [f"[[fact.{kind}]]", *(assignment(key, getattr(fact, key)) for key in keys)]


_FACT_KEYS: Mapping[str, Sequence[str]] = {
    "rotor": ("center", "axis", "blades", "duty", "rev_per_s", "inner", "outer"),
    "grating": ("cycles_per_unit",),
    "pan": ("velocity", "period"),
}


def _differs(value: object, default: object) -> bool:
    """Return whether a value is not its default, to the bit: -0.0 is another number than 0.0."""
    if value is None or default is None:
        return value is not default
    a, b = np.asarray(value), np.asarray(default)
    return a.shape != b.shape or not bool((a == b).all()) or not bool((np.signbit(a) == np.signbit(b)).all())
