"""Numbers that mean nothing: each is refused in a sentence that says where it is and what is allowed.

Left in, one NaN becomes a black pixel in one renderer, spreads over a filter's width in another, and makes a kernel
read foreign memory in a third. Scenes built in Python are asked of every renderer; files are refused before any.
"""

import base64
import json
import math
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from aliasbench.bench.hard.case import METRICS, HardCase, Verdict
from aliasbench.renderers.catalog import prepare
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import (
    Animation,
    Camera,
    Checker,
    Grating,
    ImageTexture,
    Light,
    Material,
    Motion,
    Scene,
    Spin,
    Texture,
    ZonePlate,
)
from aliasbench.scenes.shapes import quad

NAN, INF = math.nan, math.inf
_IDENTITY = tuple(np.eye(4).ravel().tolist())


def _plain() -> Scene:
    corners = [(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0)]
    shape = quad(corners, texture="t", name="plate")
    return Scene("hard", Camera("orthographic", height=2.0), (shape,), textures={"t": Checker((2.0, 2.0))})


def _with(**changes: Any) -> Scene:
    scene = _plain()
    return replace(scene, objects=(replace(scene.objects[0], **changes),))


def _with_camera(**changes: Any) -> Scene:
    return replace(_plain(), camera=replace(_plain().camera, **changes))


def _with_texture(texture: Texture) -> Scene:
    return replace(_plain(), textures={"t": texture})


def _with_light(corner: float, radiance: float) -> Scene:
    corners = ((0.0, 0.0, corner), (1.0, 0.0, 1.0), (1.0, 1.0, 1.0), (0.0, 1.0, 1.0))
    return replace(_plain(), lights=(Light(corners, (radiance, 1.0, 1.0)),))


def _with_vertex(value: float) -> Scene:
    vertices = _plain().objects[0].vertices.copy()
    vertices[1, 1] = value
    return _with(vertices=vertices)


def _with_texel(value: float) -> Scene:
    texels = np.ones((4, 4, 4), np.float32)
    texels[1, 2, 0] = value
    return _with_texture(ImageTexture(texels))


def _with_matrix(value: float) -> Scene:
    matrix = (value, *_IDENTITY[1:])
    return _with(motion=Motion(matrices=(_IDENTITY, matrix)))


def _with_spin(turns: float, center: float) -> Scene:
    return _with(motion=Motion(spin=Spin((0.0, 0.0, 1.0), (center, 0.0, 0.0), turns)))


def _with_triangle(index: int) -> Scene:
    return _with(triangles=np.array([[0, 1, index]], np.int32))


# What is wrong, and what the sentence must name.
SPOILT: Mapping[str, tuple[Callable[[float], Scene], str]] = {
    "a vertex": (_with_vertex, "vertices of object plate"),
    "a texture coordinate": (lambda v: _with(uv=np.full((4, 2), v)), "uv of object plate"),
    "a colour": (lambda v: _with(color=(1.0, v, 1.0)), "color of object plate"),
    "the background": (lambda v: replace(_plain(), background=(v, 0.0, 0.0)), "background"),
    "a light's radiance": (lambda v: _with_light(0.0, v), "radiance of light 0"),
    "a light's corner": (lambda v: _with_light(v, 1.0), "quad of light 0"),
    "the camera's position": (lambda v: _with_camera(position=(0.0, v, 5.0)), "position of the camera"),
    "the camera's target": (lambda v: _with_camera(target=(0.0, v, 0.0)), "target of the camera"),
    "the camera's up": (lambda v: _with_camera(up=(0.0, v, 0.0)), "up of the camera"),
    "the camera's height": (lambda v: _with_camera(height=v), "height of the camera"),
    "the camera's velocity": (lambda v: _with_camera(velocity=(v, 0.0, 0.0)), "velocity of the camera"),
    "the lens": (lambda v: _with_camera(lens_radius=v), "lens_radius of the camera"),
    "the focus": (lambda v: _with_camera(focus_distance=v), "focus_distance of the camera"),
    "the frame rate": (lambda v: replace(_plain(), animation=Animation(v, 1, 0.0)), "fps of the animation"),
    "the shutter": (lambda v: replace(_plain(), animation=Animation(1.0, 1, v)), "shutter of the animation"),
    "a velocity": (lambda v: _with(motion=Motion((v, 0.0, 0.0))), "velocity of object plate"),
    "a spin": (lambda v: _with_spin(v, 0.0), "spin of object plate"),
    "a spin's center": (lambda v: _with_spin(1.0, v), "spin of object plate"),
    "a matrix": (_with_matrix, "matrices of object plate"),
    "a roughness": (lambda v: _with(material=Material("glossy", roughness=v)), "material of object plate"),
    "a texel": (_with_texel, "texels of texture 't'"),
    "a cut-off": (lambda v: _with_texture(ImageTexture(np.ones((2, 2, 4), np.float32), v)), "alpha_cutoff of texture"),
    "a checker's squares": (lambda v: _with_texture(Checker((v, 2.0))), "squares of texture 't'"),
    "a checker's colour": (lambda v: _with_texture(Checker((2.0, 2.0), (v, 0.0, 0.0))), "black of texture 't'"),
    "a grating's cycles": (lambda v: _with_texture(Grating(v)), "cycles, angle_deg and phase of texture 't'"),
    "a grating's colour": (lambda v: _with_texture(Grating(3.0, high=(v, 1.0, 1.0))), "high of texture 't'"),
    "a zone plate's k": (lambda v: _with_texture(ZonePlate((0.5, 0.5), v)), "center, k and phase of texture 't'"),
}
# Not a matter of numbers that are finite: what would be looked up where nothing is.
MISSING: Mapping[str, tuple[Callable[[], Scene], str]] = {
    "a vertex's number": (lambda: _with_triangle(4), "triangles of object plate"),
    "a negative number": (lambda: _with_triangle(-1), "triangles of object plate"),
    "a texture": (lambda: _with(texture="tt"), "unknown texture 'tt'"),
    "texture coordinates": (lambda: _with(uv=None), "uv of object plate"),
    "texels": (lambda: _with_texture(ImageTexture(np.ones((0, 4, 4), np.float32))), "texels of texture 't'"),
    "channels": (lambda: _with_texture(ImageTexture(np.ones((4, 4, 3), np.float32))), "texels of texture 't'"),
    "squares": (lambda: _with_texture(Checker((0.0, 2.0))), "squares of texture 't'"),
}


def refusal(attempt: Callable[[], object], *named: str) -> str | None:
    """Return what is wrong with how an attempt was refused, or None where its sentence names all that it must."""
    try:
        attempt()
    except InputError as error:
        text = str(error)
        missing = [name for name in named if name not in text]
        one_sentence = "\n" not in text and len(text) < 400
        return None if one_sentence and not missing else f"{text!r} does not name {missing}"
    return "accepted"


def count_wrong(attempts: Mapping[str, tuple[Callable[[], object], tuple[str, ...]]]) -> Verdict:
    """Return how many attempts were accepted, or refused in a bad sentence."""
    found = {what: refusal(attempt, *named) for what, (attempt, named) in attempts.items()}
    wrong = [f"{what}: {problem}" for what, problem in found.items() if problem is not None]
    why = f"{len(attempts)} inputs, none of which means anything: each is refused where it enters"
    return Verdict(float(len(wrong)), "inputs", 0.0, 0.0, why, note="; ".join(wrong)[:600])


def _spoilt(subject: str) -> Verdict:
    attempts: dict[str, tuple[Callable[[], object], tuple[str, ...]]] = {}
    for what, (spoil, named) in SPOILT.items():
        for value in (NAN, INF, -INF):
            attempts[f"{what} {value}"] = (_preparing(spoil(value), subject), ("scene 'hard'", named))
    for what, (make, named) in MISSING.items():
        attempts[f"without {what}"] = (_preparing(make(), subject), ("scene 'hard'", named))
    return count_wrong(attempts)


def _preparing(scene: Scene, subject: str, size: object = (4, 4), frame: object = None) -> Callable[[], object]:
    def attempt() -> object:
        with prepare(scene, subject, size=cast(tuple[int, int], size)) as prepared:
            return None if frame is None else prepared.render(frame=cast(int, frame))

    return attempt


def _sizes(subject: str) -> Verdict:
    sizes: tuple[object, ...] = (
        (0, 4),
        (4, 0),
        (-1, 4),
        (65537, 1),
        (1, 65537),
        (2**40, 1),
        (1.5, 2),
        (True, 2),
        (NAN, 4),
    )
    texts: tuple[object, ...] = ("8x8", (3,), (3, 4, 5), None, 7)
    frames: tuple[object, ...] = (-1, 2**53 + 1, 2**70, 1.5, NAN, True, "0")
    attempts: dict[str, tuple[Callable[[], object], tuple[str, ...]]] = {}
    for size in sizes:
        attempts[f"size {size}"] = (_preparing(_plain(), subject, size), ("size", "whole number from 1 to 65536"))
    for size in texts:
        attempts[f"size {size}"] = (_preparing(_plain(), subject, size), ("size", "(width, height)"))
    for frame in frames:
        attempts[f"frame {frame}"] = (_preparing(_plain(), subject, (1, 1), frame), ("frame=", "from 0 to 2^53"))
    return count_wrong(attempts)


def _files(subject: str) -> Verdict:  # noqa: ARG001 - no renderer is involved
    """Files that say nan, inf or nothing at all."""
    attempts: dict[str, tuple[Callable[[], object], tuple[str, ...]]] = {}
    with tempfile.TemporaryDirectory(prefix="aliasbench-hard-") as folder:
        for name, (content, named) in bad_files(Path(folder)).items():
            path = Path(folder) / name
            if isinstance(content, bytes):
                path.write_bytes(content)
            else:
                path.write_text(content)
            attempts[name] = (_loading(path), (name, *named))
        return count_wrong(attempts)


def _loading(path: Path) -> Callable[[], object]:
    return lambda: load_scene(str(path))


_OBJECT = "[[object]]\nquad = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]\n"
_PLY = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"


def bad_files(folder: Path) -> dict[str, tuple[str | bytes, tuple[str, ...]]]:
    """Return files by name, with what a refusal must name; pictures that they use are written into the folder."""
    out: dict[str, tuple[str | bytes, tuple[str, ...]]] = {}
    faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    none = "element face 0\nproperty list uchar int vertex_indices\nend_header\n"
    for value in ("nan", "inf", "-inf"):
        out[f"vertex-{value}.obj"] = (f"v 0 0 0\nv 1 {value} 0\nv 0 1 0\nf 1 2 3\n", (value,))
        out[f"vertex-{value}.ply"] = (f"{_PLY}{faces}0 0 0\n1 {value} 0\n0 1 0\n3 0 1 2\n", ("finite",))
        out[f"vertex-{value}.gltf"] = (gltf_text(float(value)), ("finite",))
        allowed = "finite number"
        for key, text in (
            ("contrast", f"contrast = {value}\n{_OBJECT}"),
            ("background", f"background = [0, {value}, 0]\n{_OBJECT}"),
            ("quad", _OBJECT.replace("[1, -1, 0]", f"[1, {value}, 0]")),
            ("color", f"{_OBJECT}color = [1, {value}, 1]\n"),
            ("velocity", f"{_OBJECT}velocity = [{value}, 0, 0]\n"),
            ("matrices", f"{_OBJECT}matrices = [{list(_IDENTITY)}, [{value}, {str(list(_IDENTITY[1:]))[1:]}]\n"),
            ("rev_per_s", f"{_OBJECT}spin = {{ axis = [0, 0, 1], rev_per_s = {value} }}\n"),
            ("camera.position", f"[camera]\nposition = [0, {value}, 5]\n{_OBJECT}"),
            ("camera.height", f"[camera]\nheight = {value}\n{_OBJECT}"),
            ("radiance", f"{_OBJECT}[[light]]\nquad = [[0,0,1],[1,0,1],[1,1,1],[0,1,1]]\nradiance = [{value}, 1, 1]\n"),
            ("squares", f"{_OBJECT}texture = 't'\n[texture.t]\nchecker = {{ squares = [{value}, 2] }}\n"),
        ):
            out[f"{key}-{value}.toml"] = (text, (key, allowed))
        _write_texels(folder / f"texels-{value}.exr", float(value))
        image = f"{_OBJECT}texture = 't'\n[texture.t]\nimage = 'texels-{value}.exr'\n"
        out[f"texel-{value}.toml"] = (image, ("texture.t.image", f"texels-{value}.exr", "not finite"))
    for value in ("0", "-1", "1e-300"):
        out[f"contrast-{value}.toml"] = (f"contrast = {value}\n{_OBJECT}", ("contrast", "at least 1e-15"))
    out["no-faces.obj"] = ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", ("no triangle",))
    out["no-faces.ply"] = (f"{_PLY}{none}0 0 0\n1 0 0\n0 1 0\n", ("no triangle",))
    out["no-faces.gltf"] = (json.dumps({"asset": {"version": "2.0"}, "scenes": [{"nodes": []}], "scene": 0}), ())
    for suffix in ("obj", "ply", "gltf"):
        out[f"no-faces-mesh-{suffix}.toml"] = (
            f"[[object]]\nmesh = 'no-faces.{suffix}'\n",
            ("mesh", f"no-faces.{suffix}"),
        )
    return out


def _write_texels(path: Path, value: float) -> None:
    from aliasbench.bench.frames import write_image

    pixels = np.ones((3, 2, 3), np.float32)
    pixels[1, 1, 2] = value
    write_image(path, pixels)


def gltf_text(value: float) -> str:
    """Return a glTF document of one triangle, one coordinate of which is the value."""
    points = np.array([[0, 0, 0], [1, value, 0], [0, 1, 0]], "<f4").tobytes()
    return json.dumps(
        {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
            "bufferViews": [{"buffer": 0, "byteLength": len(points)}],
            "buffers": [
                {
                    "byteLength": len(points),
                    "uri": "data:application/octet-stream;base64," + base64.b64encode(points).decode(),
                }
            ],
        }
    )


CASES = (
    HardCase(
        "values-that-are-no-numbers",
        "sizes",
        "Scenes built in Python with NaN or infinity in vertices, texels, colours, lights, camera or motion, or with "
        "numbers of vertices and textures that there are not.",
        "Each is refused by InputError, in one sentence that names the scene and the value's place.",
        _spoilt,
    ),
    HardCase(
        "sizes-that-are-none",
        "sizes",
        "Picture sizes of 0, below, above 65536 or no whole numbers; frame numbers below 0, above 2^53 or none.",
        "Each is refused by InputError, in one sentence that says what is allowed.",
        _sizes,
    ),
    HardCase(
        "files-with-no-numbers",
        "sizes",
        "Files (OBJ, PLY, glTF, EXR, scenes) before any renderer: nan, inf, contrasts of 0 and below, no faces.",
        "Each is refused by InputError, in one sentence that names the file, the place and what is wrong.",
        _files,
        (METRICS,),
    ),
)
