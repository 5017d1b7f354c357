"""Damaged glTF files, and those that ask for too much, are refused in one sentence that names the place."""

import base64
import json
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
from aliasbench.scenes.local_files import read_local
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
    many = builder.array(np.zeros((30000, 3)))
    primitive = {"attributes": {"POSITION": many}}
    builder.document["meshes"] = [{"primitives": [primitive] * 100}]
    builder.document["nodes"] = [{"mesh": 0, "children": list(range(1, 40))}, *[{"mesh": 0}] * 39]
    with pytest.raises(InputError, match=r"comes to 40000000 triangles; at most 20000000 are allowed"):
        load_mesh(write(builder))
    builder.document["nodes"] = [{"mesh": 0, "children": list(range(1, 8))}, *[{"mesh": 0}] * 7]
    with pytest.raises(InputError, match=r"bytes come to 24000000 vertices and 8000000 triangles"):
        load_mesh(write(builder))


@pytest.mark.parametrize(
    ("nodes", "primitives", "message"),
    [
        (100_001, 1, "nodes: there are 100001; at most 100000 are allowed"),
        (101, 200, r"comes to 20200 parts \(meshes by node"),
        (1, 20_001, r"comes to 20001 parts \(meshes by node"),
    ],
)
def test_more_nodes_and_parts_than_are_drawn_are_refused_soon(
    gltf: ModuleType, write: Write, nodes: int, primitives: int, message: str
) -> None:
    builder = gltf.plain()
    builder.document["meshes"][0]["primitives"] *= primitives
    builder.document["nodes"] = [{"mesh": 0}] * nodes
    del builder.document["scenes"], builder.document["scene"]
    with pytest.raises(InputError, match=message):
        load_mesh(write(builder))


def test_a_list_of_more_entries_than_any_model_has_is_refused(gltf: ModuleType, write: Write) -> None:
    builder = gltf.plain()
    builder.document["materials"] = [{}] * 200_001
    with pytest.raises(InputError, match="materials: there are 200001; at most 200000 are allowed"):
        load_mesh(write(builder))


def test_a_file_that_is_a_buffer_often_is_counted_and_read_once(
    gltf: ModuleType, write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    builder = gltf.plain()
    names = []

    def counted(path: Path, what: str) -> bytes:
        names.append(path.name)
        return read_local(path, what)

    monkeypatch.setattr("aliasbench.scenes.gltf_buffers.read_local", counted)
    (tmp_path / "used.bin").write_bytes(builder.data)
    with (tmp_path / "large.bin").open("wb") as file:
        file.truncate(600_000_000)
    large = {"uri": "large.bin", "byteLength": 600_000_000}
    buffers = [{"uri": "used.bin", "byteLength": len(builder.data)}] * 2 + [large] * 3
    wanted = load_mesh(write(builder)).surfaces[0].vertices
    for k, view in enumerate(builder.document["bufferViews"]):
        view["buffer"] = k % 2
    (tmp_path / "many.gltf").write_text(json.dumps({**builder.document, "buffers": buffers}))
    np.testing.assert_array_equal(load_mesh(tmp_path / "many.gltf").surfaces[0].vertices, wanted)
    assert names == ["used.bin"]
    (tmp_path / "more.bin").hardlink_to(tmp_path / "large.bin")
    more = [*buffers, {**large, "uri": "more.bin"}]
    (tmp_path / "many.gltf").write_text(json.dumps({**builder.document, "buffers": more}))
    with pytest.raises(InputError, match=r"buffers: come to 1200\d+ bytes; at most 1000000000 are allowed"):
        load_mesh(tmp_path / "many.gltf")


def test_keys_of_many_channels_are_read_once_and_counted(
    gltf: ModuleType, write: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    builder = gltf.plain()
    times, values = builder.array(np.arange(100.0)), builder.array(np.arange(300.0).reshape(100, 3))
    for node in range(50):
        gltf.add_animation(builder, node, "translation", times, values)
    builder.document["nodes"] = [{"mesh": 0, "children": list(range(1, 50))}, *[{"mesh": 0}] * 49]
    monkeypatch.setattr("aliasbench.scenes.gltf_animation._MOST_KEYS", 200)
    assert {s.motion.velocity for s in load_mesh(write(builder)).surfaces} == {(3, 3, 3), (6, 6, 6)}
    for node in (0, 1):
        gltf.add_animation(builder, node, "translation", builder.array(np.arange(100.0)), values)
    with pytest.raises(InputError, match=r"animations\[0\]: has more than 200 keys; fewer are allowed"):
        load_mesh(write(builder))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("a.glb", "is no GLB file, and has 900000000 bytes; at most 64000000 of glTF JSON are allowed"),
        ("a.gltf", "is no GLB file, and has 900000000 bytes"),
        ("a.obj", r"is no OBJ text \(it has bytes of 0\)"),
        ("a.ply", "has no PLY header"),
    ],
)
def test_large_files_of_another_kind_are_refused_unread(
    tmp_path: Path, name: str, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr("pathlib.Path.read_bytes")
    with (tmp_path / name).open("wb") as file:
        file.truncate(900_000_000)
    with pytest.raises(InputError, match=message):
        load_mesh(tmp_path / name)


def test_what_is_neither_glb_nor_json_is_said_to_be_neither(tmp_path: Path) -> None:
    (tmp_path / "a.glb").write_text("schema = 1\n")
    with pytest.raises(InputError, match=r"a.glb: is neither GLB nor glTF JSON"):
        load_mesh(tmp_path / "a.glb")


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
