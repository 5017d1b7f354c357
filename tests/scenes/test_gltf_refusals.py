"""Damaged glTF files, and those that ask for too much, are refused in one sentence that names the place."""

import base64
import math
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.meshes import load_mesh

Write = Callable[..., Path]


def changed(builder: Any, path: str, value: Any) -> Any:
    """Return a builder in whose document the value at a path of keys is replaced."""
    *keys, last = [int(k) if k.isdigit() else k for k in path.split(".")]
    target: Any = builder.document
    for key in keys:
        target = target[key]
    target[last] = value
    return builder


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("asset.version", "1.0", 'asset.version = "1.0": must be 2.0'),
        ("extensionsRequired", ["KHR_draco_mesh_compression"], "unknown required extension 'KHR_draco_mesh"),
        ("nodes", [{"mesh": 0, "children": [0]}], "nodes[0]: is reached twice; nodes must form a tree"),
        ("nodes", [{"children": [1, 1]}, {"mesh": 0}], "nodes[1]: is reached twice"),
        ("nodes", [{"mesh": 7}], "nodes[0].mesh = 7: must be an index of meshes, of which there are 1"),
        ("nodes", [{"mesh": 0, "scale": [1e12, 1, 1]}, {}], "must be"),
        ("nodes.0.rotation", [0, 0, 0, 0], "nodes[0].rotation = [0, 0, 0, 0]: must be a unit quaternion"),
        ("nodes.0.matrix", [1] * 16, "must be affine: 16 numbers, column by column"),
        ("accessors.0.count", 2**30, "bytes come to 1073741824 vertices"),
        ("accessors.0.count", 400, "accessors[0].count = 400: must be of fewer elements"),
        ("accessors.0.bufferView", 99, "accessors[0].bufferView = 99: must be an index of bufferViews"),
        ("accessors.0.type", "MAT4", 'accessors[0].type = "MAT4": must be VEC3, as meshes[0].primitives[0]'),
        ("accessors.0.componentType", 5130, "componentType = 5130: must be one of 5120"),
        ("bufferViews.0.byteLength", 10**6, "bufferViews[0].byteLength = 1000000: must be at most"),
        ("bufferViews.1.byteStride", 1, "need"),
        ("meshes.0.primitives.0.mode", 7, "primitives[0].mode = 7: must be a whole number from 0 to 6"),
        ("meshes.0.primitives.0.mode", 1, "has no triangle with an area; a mesh to draw is needed"),
        ("materials.0.alphaMode", "GLOW", "unknown alphaMode 'GLOW'"),
        ("textures.0.source", 3, "textures[0].source = 3: must be an index of images"),
        ("textures", [{}], "textures[0].source is missing; it must be an index of images (PNG or JPEG"),
        ("images", [{"uri": "gone.png"}], "images[0]: image 'gone.png': no such file"),
        ("images", [{"uri": "../a.png"}], "'../a.png' leads out of the folder"),
        ("images", [{"uri": "%2e%2e/a.png"}], "leads out of the folder"),
        ("images", [{"uri": "/etc/passwd"}], "is no relative path; a path within the model file's own folder"),
        ("images", [{"uri": "http://example.org/a.png"}], "is no local file"),
        ("images", [{"uri": "file:///etc/passwd"}], "is no local file"),
        ("images", [{"uri": "out/passwd"}], "leads out of the folder"),
        ("images", [{"uri": "data:image/png;base64,???"}], "its data URI is not valid base64"),
        ("images", [{"uri": "data:text/plain,hello"}], "is no data URI in base64"),
        ("images", [{"uri": "a.glb"}], "images[0]: is neither PNG nor JPEG"),
        ("cameras", [{"type": "perspective", "perspective": {"yfov": 4}}], "perspective.yfov = 4: must be"),
        ("nodes.0.mesh", True, "nodes[0].mesh = true: must be a whole number"),
        ("meshes", {}, "meshes = {}: must be a list of objects"),
    ],
)
def test_damaged_documents_are_refused_with_the_place(
    gltf: ModuleType, write: Write, tmp_path: Path, path: str, value: Any, message: str
) -> None:
    (tmp_path / "out").symlink_to("/etc")
    builder = changed(gltf.textured(), path, value)
    if path == "cameras":
        builder.document["nodes"][0]["camera"] = 0
    if "1e12" in str(value) or "1000000000000" in str(value):
        builder.document["nodes"] = [{"children": [1], "scale": [1e12, 1, 1]}, {"mesh": 0, "scale": [1e12, 1, 1]}]
        message = "nodes[1]: its transform leads beyond 1e+12"
    with pytest.raises(InputError) as caught:
        load_scene(str(write(builder)))
    said = str(caught.value)
    assert message in said
    assert said.startswith(str(tmp_path / "a.glb"))
    assert "\n" not in said


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e30])
def test_coordinates_that_are_no_numbers_are_refused(gltf: ModuleType, write: Write, value: float) -> None:
    builder = gltf.Builder()
    points = [*gltf.SQUARE[:3], (0, value, 0)]
    builder.document["meshes"] = [{"primitives": [{"attributes": {"POSITION": builder.array(points)}, "mode": 6}]}]
    with pytest.raises(InputError, match=r"primitives\[0\].attributes.POSITION: element 3 is \[0.0, .*finite numbers"):
        load_mesh(write(builder))


def test_indices_have_a_vertex(gltf: ModuleType, write: Write) -> None:
    builder = gltf.plain()
    builder.document["meshes"][0]["primitives"][0]["indices"] = builder.array([0, 1, 4], "u2")
    with pytest.raises(InputError, match=r"primitives\[0\].indices: index 4 has no vertex; there are 4 vertices"):
        load_mesh(write(builder))


def test_few_bytes_cannot_ask_for_much(gltf: ModuleType, write: Write) -> None:
    builder = gltf.Builder()
    many = builder.array(np.zeros((3000, 3)))
    primitive = {"attributes": {"POSITION": many}}
    builder.document["meshes"] = [{"primitives": [primitive] * 1000}]
    builder.document["nodes"] = [{"mesh": 0, "children": list(range(1, 40))}, *[{"mesh": 0}] * 39]
    with pytest.raises(InputError, match=r"comes to 40000000 triangles; at most 20000000 are allowed"):
        load_mesh(write(builder))
    builder.document["nodes"] = [{"mesh": 0, "children": list(range(1, 8))}, *[{"mesh": 0}] * 7]
    with pytest.raises(InputError, match=r"bytes come to 24000000 vertices and 8000000 triangles"):
        load_mesh(write(builder))


def test_an_image_that_claims_to_be_huge_is_refused_unread(gltf: ModuleType, write: Write) -> None:
    data = bytearray(gltf.png(gltf.FOUR))
    data[16:24] = struct.pack(">II", 100_000, 100_000)
    data[29:33] = struct.pack(">I", zlib.crc32(bytes(data[12:29])))
    builder = gltf.textured()
    builder.document["images"] = [{"uri": "data:image/png;base64," + base64.b64encode(data).decode()}]
    with pytest.raises(InputError, match=r"images\[0\]: (has 100000 x 100000 texels; at most|cannot be read)"):
        load_mesh(write(builder))


def test_files_cut_off_anywhere_are_refused(gltf: ModuleType, write: Write, tmp_path: Path) -> None:
    data = write(gltf.textured()).read_bytes()
    for length in (0, 3, 4, 12, 19, 21, len(data) // 2, len(data) - 1):
        (tmp_path / "cut.glb").write_bytes(data[:length])
        with pytest.raises(InputError, match=r"cut.glb: .*(cut off|JSON)"):
            load_scene(str(tmp_path / "cut.glb"))


def test_deep_trees_and_deep_json_end(gltf: ModuleType, write: Write, tmp_path: Path) -> None:
    builder = gltf.plain()
    depth = 20_000
    builder.document["nodes"] = [{"children": [k + 1]} for k in range(depth)] + [{"mesh": 0}]
    assert len(load_mesh(write(builder)).surfaces) == 1
    (tmp_path / "deep.gltf").write_text('{"asset": ' + "[" * 100_000)
    with pytest.raises(InputError, match="nested too deeply"):
        load_mesh(tmp_path / "deep.gltf")


def test_colours_at_corners_count_as_what_they_come_to(gltf: ModuleType, write: Write) -> None:
    builder = gltf.Builder()
    colors = np.random.default_rng(1).random((300, 3))
    attributes = {"POSITION": builder.array(colors), "COLOR_0": builder.array(colors)}
    corners = builder.array(np.tile(np.arange(300), 1000), "u2")
    builder.document["meshes"] = [{"primitives": [{"attributes": attributes, "indices": corners}]}]
    builder.document["nodes"] = [{"mesh": 0, "children": list(range(1, 30))}, *[{"mesh": 0}] * 29]
    # Without colours they come to 36 MB, with them each triangle has three vertices and a texel of its own.
    with pytest.raises(InputError, match=r"3000000 triangles, 3000000 of them of several colours, 444360000 bytes"):
        load_mesh(write(builder))
