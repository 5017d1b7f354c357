"""glTF files become what they say: places, colours, textures, cameras and motions; and damaged ones are refused."""

import base64
import json
import math
import struct
import zlib
from collections.abc import Callable, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from aliasbench.renderers.catalog import render
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.meshes import load_mesh, load_model_scene
from aliasbench.scenes.motion import object_matrix, rotation_matrix
from aliasbench.scenes.projection import view_at
from aliasbench.scenes.textures import evaluate_point, srgb_to_linear

SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
UV = [(0, 1), (1, 1), (1, 0), (0, 0)]  # v down: the square's bottom-left corner is the image's
CORNERS = [0, 1, 2, 0, 2, 3]
COMPONENTS = {"f4": 5126, "u1": 5121, "u2": 5123, "u4": 5125, "i2": 5122}
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}

Write = Callable[..., Path]


class Builder:
    """A glTF document in the making: arrays are added, indices of accessors come back."""

    def __init__(self) -> None:
        self.data = b""
        self.document: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "accessors": [],
            "bufferViews": [],
        }

    def view(self, data: bytes, **more: Any) -> int:
        views = self.document["bufferViews"]
        views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data), **more})
        self.data += data + bytes(-len(data) % 4)
        return len(views) - 1

    def array(self, values: Any, kind: str = "f4", **more: Any) -> int:
        array = np.array(values, "<" + kind)
        array = array.reshape(len(array), -1)
        entry = {"bufferView": self.view(array.tobytes()), "componentType": COMPONENTS[kind], **more}
        self.document["accessors"].append({**entry, "count": len(array), "type": KINDS[array.shape[1]]})
        return len(self.document["accessors"]) - 1

    def square(self, **more: Any) -> dict[str, Any]:
        attributes = {"POSITION": self.array(SQUARE), "TEXCOORD_0": self.array(UV)}
        return {"attributes": attributes, "indices": self.array(CORNERS, "u2"), **more}

    def bytes(self, **changes: Any) -> bytes:
        document = {**self.document, "buffers": [{"byteLength": len(self.data)}], **changes}
        text = json.dumps(document).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        chunks += struct.pack("<I4s", len(self.data), b"BIN\0") + self.data
        return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def png(pixels: Any) -> bytes:
    out = BytesIO()
    Image.fromarray(np.array(pixels, np.uint8)).save(out, "PNG")
    return out.getvalue()


FOUR = [[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [128, 128, 128]]]  # top row first


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Return a function that writes a builder's document, with changes, and returns the file's path."""

    def save(builder: Builder, name: str = "a.glb", **changes: Any) -> Path:
        path = tmp_path / name
        path.write_bytes(builder.bytes(**changes))
        return path

    return save


def textured(pixels: Any = FOUR, *, sampler: Mapping[str, Any] | None = None, **material: Any) -> Builder:
    builder = Builder()
    info = {"index": 0, **material.pop("info", {})}
    factor = material.pop("factor", [1, 1, 1, 1])
    image = builder.view(png(pixels))
    builder.document |= {
        "images": [{"bufferView": image, "mimeType": "image/png"}],
        "textures": [{"source": 0, **({} if sampler is None else {"sampler": 0})}],
        "samplers": [] if sampler is None else [dict(sampler)],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": info, "baseColorFactor": factor}, **material}],
        "meshes": [{"primitives": [builder.square(material=0)]}],
    }
    return builder


def plain(**primitive: Any) -> Builder:
    builder = Builder()
    builder.document["meshes"] = [{"primitives": [builder.square(**primitive)]}]
    return builder


def value_at(path: Path, x: float, y: float) -> list[float]:
    """Return the texture's value (RGBA) that a model has at a point (x, y, 0) of its unit square."""
    model = load_mesh(path)
    (surface,) = model.surfaces
    assert surface.uv is not None
    assert surface.texture is not None
    corners = {tuple(p): uv for p, uv in zip(surface.vertices.tolist(), surface.uv, strict=True)}
    a, b, d = (corners[p] for p in ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    return list(evaluate_point(model.textures[surface.texture], a + x * (b - a) + y * (d - a)).tolist())


def test_a_picture_stands_upright_and_in_linear_light(write: Write) -> None:
    path = write(textured())
    grey = float(srgb_to_linear(np.array(128 / 255)))
    assert value_at(path, 0.25, 0.75) == [1, 0, 0, 1]
    assert value_at(path, 0.75, 0.75) == [0, 1, 0, 1]
    assert value_at(path, 0.25, 0.25) == [0, 0, 1, 1]
    assert value_at(path, 0.75, 0.25) == pytest.approx([grey] * 3 + [1], rel=1e-6)


def test_the_renderers_draw_what_the_file_says(write: Write) -> None:
    camera = {"type": "orthographic", "orthographic": {"xmag": 0.5, "ymag": 0.5, "znear": 0.1, "zfar": 9}}
    builder = textured()
    builder.document |= {"cameras": [camera], "nodes": [{"mesh": 0}, {"camera": 0, "translation": [0.5, 0.5, 3]}]}
    builder.document["scenes"] = [{"nodes": [0, 1]}]
    scene = load_scene(str(write(builder)))
    grey = float(srgb_to_linear(np.array(128 / 255)))
    wanted = np.array([[[1, 0, 0], [0, 1, 0]], [[0, 0, 1], [grey] * 3]], np.float32)
    for technique in ("raytrace:", "raster:", "reference:"):
        np.testing.assert_allclose(render(scene, technique, size=(2, 2)).pixels, wanted, atol=1e-6)


def test_the_scene_is_what_trimesh_reads(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    scene = trimesh.Scene()
    for k in range(3):
        part = trimesh.creation.icosphere(subdivisions=1, radius=0.3 + k)
        matrix = np.eye(4)
        matrix[:3] = rng.standard_normal((3, 4))
        scene.add_geometry(part, node_name=f"node{k}", transform=matrix)
        matrix = matrix.copy()
        matrix[:3] *= -1.5
        scene.graph.update(frame_to=f"again{k}", frame_from=f"node{k}", matrix=matrix, geometry=f"geometry_{k}")
    for name in ("a.glb", "a.gltf"):
        folder = tmp_path / name
        folder.mkdir()
        scene.export(str(folder / name))
        ours = load_mesh(folder / name)
        theirs = trimesh.load_scene(folder / name).to_mesh()
        assert sum(len(s.triangles) for s in ours.surfaces) == len(theirs.faces) == 3 * 2 * 80
        own = np.concatenate([s.vertices[s.triangles] for s in ours.surfaces])
        np.testing.assert_allclose(_signature(own), _signature(theirs.triangles), atol=1e-6)


def _signature(triangles: np.ndarray) -> np.ndarray:
    """Return what tells a set of triangles (m, 3, 3) from another, whatever the order of triangles and of corners."""
    a, b, c = (triangles[:, k] for k in range(3))
    places = np.sort(triangles.mean(axis=1) @ (1.0, 0.618, 0.234))
    return np.stack([places, np.sort(np.linalg.norm(np.cross(b - a, c - a), axis=1))])


def test_transforms_multiply_down_the_tree_with_matrices_in_columns(write: Write) -> None:
    builder = plain()
    half = math.sqrt(0.5)
    builder.document["nodes"] = [
        {"translation": [10, 0, 0], "rotation": [0, 0, half, half], "scale": [2, 2, 2], "children": [1]},
        {"matrix": [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 0, 3, 0, 1], "mesh": 0},
    ]
    (surface,) = load_mesh(write(builder)).surfaces
    # (x, y) -> (x, 3 - y) -> twice -> a quarter turn -> + 10
    wanted = [(10 - 2 * (3 - y), 2 * x, 0) for x, y, _ in SQUARE]
    np.testing.assert_allclose(surface.vertices, wanted, atol=1e-12)


@pytest.mark.parametrize(("mode", "indices"), [(4, [0, 1, 2, 0, 2, 3]), (5, [0, 1, 3, 2]), (6, [0, 1, 2, 3])])
def test_lists_strips_and_fans_cover_the_same_square(write: Write, mode: int, indices: list[int]) -> None:
    for kind in ("u1", "u2", "u4"):
        builder = Builder()
        primitive = {"attributes": {"POSITION": builder.array(SQUARE)}, "indices": builder.array(indices, kind)}
        builder.document["meshes"] = [{"primitives": [{**primitive, "mode": mode}]}]
        (surface,) = load_mesh(write(builder)).surfaces
        a, b, c = (surface.vertices[surface.triangles[:, k]] for k in range(3))
        areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
        assert areas.tolist() == [0.5, 0.5]
        assert not surface.is_polygon


def test_sparse_strided_and_normalized_accessors_are_read(write: Write) -> None:
    builder = Builder()
    rows = np.zeros(4, [("p", "<f4", 3), ("uv", "<u2", 2)])
    rows["p"], rows["uv"] = SQUARE, np.array(UV) * 65535
    view = builder.view(rows.tobytes(), byteStride=rows.itemsize)
    moved = builder.view(np.array([(0, 5, 0)], "<f4").tobytes())
    where = builder.view(np.array([3], "<u2").tobytes())
    sparse = {"count": 1, "indices": {"bufferView": where, "componentType": 5123}, "values": {"bufferView": moved}}
    entry = {"bufferView": view, "count": 4}
    builder.document["accessors"] = [
        {**entry, "componentType": 5126, "type": "VEC3", "sparse": sparse},
        {**entry, "componentType": 5123, "type": "VEC2", "byteOffset": 12, "normalized": True},
    ]
    attributes = {"POSITION": 0, "TEXCOORD_0": 1}
    builder.document["meshes"] = [{"primitives": [{"attributes": attributes, "mode": 6}]}]
    (surface,) = load_mesh(write(builder)).surfaces
    assert surface.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 5, 0]]
    assert surface.uv is not None
    assert surface.uv.tolist() == [[0, 0], [1, 0], [1, 1], [0, 1]]


def test_alpha_cuts_out_where_the_mode_says_so(write: Write) -> None:
    half = [[[255, 0, 0, 255], [255, 0, 0, 100]]]
    cutoffs = []
    for more in ({}, {"alphaMode": "MASK"}, {"alphaMode": "MASK", "alphaCutoff": 0.3}, {"alphaMode": "BLEND"}):
        (texture,) = load_mesh(write(textured(half, **more))).textures.values()
        cutoffs.append(texture.alpha_cutoff)
        assert texture.texels[0, 1].tolist() == pytest.approx([1, 0, 0, 100 / 255])  # not multiplied by alpha
    # With a cutoff of 0.3 nothing is cut out: a plain texture, which every renderer draws.
    assert cutoffs == [None, 0.5, None, 0.5]
    faded = textured(half, alphaMode="MASK", factor=[1, 1, 1, 0.8])
    (texture,) = load_mesh(write(faded)).textures.values()
    assert texture.alpha_cutoff == pytest.approx(0.625)
    with pytest.raises(InputError, match="has no triangle with an area"):
        load_mesh(write(textured(half, alphaMode="MASK", factor=[1, 1, 1, 0.4])))


@pytest.mark.parametrize("axis", ["wrapS", "wrapT"])
@pytest.mark.parametrize(("code", "chosen"), [(10497, [0, 1, 0, 1]), (33648, [0, 1, 1, 0]), (33071, [0, 1, 1, 1])])
def test_samplers_wrap_as_they_say(write: Write, axis: str, code: int, chosen: list[int]) -> None:
    row = [[255, 0, 0], [0, 255, 0]]
    pixels = [row] if axis == "wrapS" else [[row[1]], [row[0]]]
    scale = [2, 1] if axis == "wrapS" else [1, 2]
    # Along v the transform starts at the top: shifted by one period down, it is at the bottom.
    offset = [0, 0] if axis == "wrapS" else [0, -1]
    info = {"extensions": {"KHR_texture_transform": {"scale": scale, "offset": offset}}}
    path = write(textured(pixels, sampler={axis: code}, info=info))
    found = []
    for k in range(4):
        along = (k + 0.5) / 4
        value = value_at(path, along, 0.5) if axis == "wrapS" else value_at(path, 0.5, along)
        found.append(value[:2])
    assert found == [[1.0, 0.0] if c == 0 else [0.0, 1.0] for c in chosen]


def test_a_texture_transform_rotates_counter_clockwise_and_chooses_its_set(write: Write) -> None:
    turned = {"extensions": {"KHR_texture_transform": {"rotation": math.pi / 2, "offset": [0, 1]}}}
    # uv turned counter-clockwise in the picture: what was seen at the right is seen at the top.
    path = write(textured(info=turned))
    u, v = 0.75, 0.25
    moved = (v, 1 - u)  # u' = u cos + v sin, v' = -u sin + v cos, + (0, 1)
    expected = np.array(FOUR)[int(moved[1] * 2), int(moved[0] * 2)] / 255
    assert value_at(path, u, 1 - v)[:3] == pytest.approx(srgb_to_linear(expected).tolist(), rel=1e-6)
    with pytest.raises(InputError, match=r"attributes.TEXCOORD_1 is missing; it must be given: the material's texture"):
        load_mesh(write(textured(info={"texCoord": 1})))


def test_one_colour_at_all_vertices_is_the_surfaces_and_several_are_flat(write: Write) -> None:
    for colors, wanted in (([(0.5, 0.25, 1)] * 4, [[0.5, 0.25, 1]] * 2), ([(1, 0, 0)] * 3 + [(0, 0, 0)], None)):
        builder = plain()
        primitive = builder.document["meshes"][0]["primitives"][0]
        primitive["attributes"]["COLOR_0"] = builder.array(colors)
        model = load_mesh(write(builder))
        (surface,) = model.surfaces
        if wanted is not None:
            assert surface.color == (0.5, 0.25, 1.0)
            assert not model.textures
        else:
            assert surface.texture == "a.glb#colors 0"
            assert surface.uv is not None
            values = evaluate_point(model.textures[surface.texture], surface.uv[surface.triangles[:, 0]])
            np.testing.assert_allclose(values[:, :3], [[1, 0, 0], [2 / 3, 0, 0]], rtol=1e-6)


def test_the_files_camera_is_used(write: Write) -> None:
    builder = plain()
    half = math.sqrt(0.5)
    builder.document |= {
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}],
        "nodes": [{"mesh": 0}, {"camera": 0, "translation": [5, 0.5, 0], "rotation": [0, half, 0, half]}],
        "scenes": [{"nodes": [0, 1]}],
    }
    scene = load_model_scene(write(builder))
    view = view_at(scene.camera, scene.animation, 0, 0.0, (100, 100))
    np.testing.assert_allclose(view.forward, [-1, 0, 0], atol=1e-12)
    assert scene.camera.fov_y_deg == pytest.approx(math.degrees(1.0))
    assert view.origin.tolist() == [5, 0.5, 0]


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_a_model_without_a_camera_is_in_view_and_fills_it(write: Write, scale: float) -> None:
    builder = plain()
    builder.document["nodes"] = [{"mesh": 0, "scale": [scale, 3 * scale, scale], "translation": [7 * scale, 0, scale]}]
    scene = load_model_scene(write(builder))
    for size in ((100, 100), (300, 100)):
        view = view_at(scene.camera, scene.animation, 0, 0.0, size)
        seen = view.project(scene.objects[0].vertices)
        assert seen[:, 2].min() > 0
        low, high = seen[:, :2].min(axis=0), seen[:, :2].max(axis=0)
        assert (low >= 0).all()
        assert (high <= size).all()
        # The picture's height is used, all but the margins of five in a hundred.
        np.testing.assert_allclose([low[1], high[1]], [5, 95], atol=0.5)
        assert (low[0] + high[0]) / 2 == pytest.approx(size[0] / 2, abs=1)


def rotating(keys: int, turns: float, seconds: float, axis: tuple[float, float, float]) -> Builder:
    builder = plain()
    angle = np.linspace(0, 2 * np.pi * turns, keys)[:, None]
    unit = np.array(axis) / np.linalg.norm(axis)
    first = np.array([0.5, 0.5, 0.5, 0.5])  # a third of a turn about (1, 1, 1): the keys start turned
    quaternions = [_product(np.append(np.sin(a / 2) * unit, np.cos(a / 2)), first) for a in angle]
    times = builder.array(np.linspace(0, seconds, keys))
    add_animation(builder, 1, "rotation", times, builder.array(quaternions))
    builder.document["nodes"] = [
        {"children": [1], "translation": [1, 2, 3], "scale": [2, -2, 2]},
        {"mesh": 0, "translation": [5, 0, 0]},
    ]
    return builder


def add_animation(builder: Builder, node: int, path: str, times: int, values: int, kind: str = "LINEAR") -> None:
    animation = builder.document.setdefault("animations", [{"samplers": [], "channels": []}])[0]
    animation["samplers"].append({"input": times, "output": values, "interpolation": kind})
    target = {"node": node, "path": path}
    animation["channels"].append({"sampler": len(animation["samplers"]) - 1, "target": target})


def _product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    vector = p[3] * q[:3] + q[3] * p[:3] + np.cross(p[:3], q[:3])
    return np.append(vector, p[3] * q[3] - p[:3] @ q[:3])


@pytest.mark.parametrize(("turns", "keys"), [(1.0, 5), (-2.0, 9), (0.25, 2), (3.0, 73)])
def test_a_steady_rotation_is_a_spin_exactly(write: Write, turns: float, keys: int) -> None:
    axis = (1.0, 2.0, -0.5)
    scene = load_model_scene(write(rotating(keys, turns, 4.0, axis)))
    (surface,) = scene.objects
    assert surface.motion.spin is not None
    assert abs(surface.motion.spin.rev_per_s) == pytest.approx(abs(turns) / 4.0, rel=1e-15)
    assert scene.animation.frames == 120
    assert scene.animation.fps == 30.0
    outer = np.diag([2.0, -2.0, 2.0, 1.0])
    outer[:3, 3] = (1, 2, 3)
    third = rotation_matrix((1, 1, 1), 1 / 3)
    for frame in (0, 7, 50, 119):
        inner = np.eye(4)
        inner[:3, :3] = rotation_matrix(axis, turns * frame / 120) @ third
        inner[:3, 3] = (5, 0, 0)
        wanted = np.array(SQUARE) @ (outer @ inner)[:3, :3].T + (outer @ inner)[:3, 3]
        matrix = object_matrix(surface.motion, scene.animation, frame, 0.0)
        found = surface.vertices @ matrix[:3, :3].T + matrix[:3, 3]
        # Keys are float32, the axis is their mean.
        np.testing.assert_allclose(found, wanted, atol=5e-6)


def test_a_wheel_on_a_car_moves_straight_and_turns(write: Write) -> None:
    builder = rotating(5, 1.0, 2.0, (0, 0, 1))
    times = builder.array([0.0, 1.0, 2.0])
    add_animation(builder, 0, "translation", times, builder.array([(1, 2, 3), (2, 2, 3), (3, 2, 3)]))
    (surface,) = load_mesh(write(builder)).surfaces
    assert surface.motion.velocity == pytest.approx((1.0, 0.0, 0.0), abs=1e-6)
    assert surface.motion.spin is not None
    # Mirrored along y, it turns the other way.
    assert surface.motion.spin.axis == pytest.approx((0.0, 0.0, -1.0))
    assert surface.motion.spin.center == pytest.approx((11.0, 2.0, 3.0))


@pytest.mark.parametrize("case", ["step", "uneven", "curve", "scale", "sheared", "spline"])
def test_what_is_no_steady_motion_stays_in_its_first_pose(write: Write, case: str) -> None:
    builder = plain()
    times = builder.array([0.0, 1.0, 2.0] if case != "uneven" else [0.0, 0.5, 2.0])
    values = [(5, 0, 0), (6, 0, 0), (7, 0, 0)] if case != "curve" else [(5, 0, 0), (6, 1, 0), (7, 0, 0)]
    path, kind = "translation", {"step": "STEP", "spline": "CUBICSPLINE"}.get(case, "LINEAR")
    if case == "spline":
        values = [v for value in values for v in ((0, 0, 0), value, (0, 0, 0))]
    node: dict[str, Any] = {"mesh": 0}
    if case == "scale":
        path, values = "scale", [(5, 1, 1), (6, 1, 1), (7, 1, 1)]
    if case == "sheared":
        quarter = [(0, 0, math.sin(a), math.cos(a)) for a in (0, math.pi / 4, math.pi / 2)]
        builder.document["nodes"] = [{"children": [1], "scale": [1, 3, 1]}, node]
        add_animation(builder, 1, "rotation", times, builder.array(quarter))
    else:
        builder.document["nodes"] = [node]
        add_animation(builder, 0, path, times, builder.array(values), kind)
    scene = load_model_scene(write(builder))
    assert scene.is_static
    assert scene.animation.frames == 1
    wanted = {"scale": [0, 5], "sheared": [0, 1]}.get(case, [5, 6])
    assert [scene.objects[0].vertices[:, 0].min(), scene.objects[0].vertices[:, 0].max()] == wanted


def changed(builder: Builder, path: str, value: Any) -> Builder:
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
    write: Write, tmp_path: Path, path: str, value: Any, message: str
) -> None:
    (tmp_path / "out").symlink_to("/etc")
    builder = changed(textured(), path, value)
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
def test_coordinates_that_are_no_numbers_are_refused(write: Write, value: float) -> None:
    builder = Builder()
    points = [*SQUARE[:3], (0, value, 0)]
    builder.document["meshes"] = [{"primitives": [{"attributes": {"POSITION": builder.array(points)}, "mode": 6}]}]
    with pytest.raises(InputError, match=r"primitives\[0\].attributes.POSITION: element 3 is \[0.0, .*finite numbers"):
        load_mesh(write(builder))


def test_indices_have_a_vertex(write: Write) -> None:
    builder = plain()
    builder.document["meshes"][0]["primitives"][0]["indices"] = builder.array([0, 1, 4], "u2")
    with pytest.raises(InputError, match=r"primitives\[0\].indices: index 4 has no vertex; there are 4 vertices"):
        load_mesh(write(builder))


def test_triangles_of_no_area_are_dropped_silently(write: Write) -> None:
    builder = plain()
    builder.document["meshes"][0]["primitives"][0]["indices"] = builder.array([0, 1, 2, 0, 0, 1, 1, 2, 1], "u2")
    (surface,) = load_mesh(write(builder)).surfaces
    assert len(surface.triangles) == 1
    assert len(surface.vertices) == 3


def test_few_bytes_cannot_ask_for_much(write: Write) -> None:
    builder = Builder()
    many = builder.array(np.zeros((3000, 3)))
    primitive = {"attributes": {"POSITION": many}}
    builder.document["meshes"] = [{"primitives": [primitive] * 1000}]
    builder.document["nodes"] = [{"mesh": 0, "children": list(range(1, 40))}, *[{"mesh": 0}] * 39]
    with pytest.raises(InputError, match=r"comes to 40000000 triangles; at most 20000000 are allowed"):
        load_mesh(write(builder))
    builder.document["nodes"] = [{"mesh": 0, "children": list(range(1, 8))}, *[{"mesh": 0}] * 7]
    with pytest.raises(InputError, match=r"bytes come to 24000000 vertices and 8000000 triangles"):
        load_mesh(write(builder))


def test_an_image_that_claims_to_be_huge_is_refused_unread(write: Write) -> None:
    data = bytearray(png(FOUR))
    data[16:24] = struct.pack(">II", 100_000, 100_000)
    data[29:33] = struct.pack(">I", zlib.crc32(bytes(data[12:29])))
    builder = textured()
    builder.document["images"] = [{"uri": "data:image/png;base64," + base64.b64encode(data).decode()}]
    with pytest.raises(InputError, match=r"images\[0\]: (has 100000 x 100000 texels; at most|cannot be read)"):
        load_mesh(write(builder))


def test_files_cut_off_anywhere_are_refused(write: Write, tmp_path: Path) -> None:
    data = write(textured()).read_bytes()
    for length in (0, 3, 4, 12, 19, 21, len(data) // 2, len(data) - 1):
        (tmp_path / "cut.glb").write_bytes(data[:length])
        with pytest.raises(InputError, match=r"cut.glb: .*(cut off|JSON)"):
            load_scene(str(tmp_path / "cut.glb"))


def test_deep_trees_and_deep_json_end(write: Write, tmp_path: Path) -> None:
    builder = plain()
    depth = 20_000
    builder.document["nodes"] = [{"children": [k + 1]} for k in range(depth)] + [{"mesh": 0}]
    assert len(load_mesh(write(builder)).surfaces) == 1
    (tmp_path / "deep.gltf").write_text('{"asset": ' + "[" * 100_000)
    with pytest.raises(InputError, match="nested too deeply"):
        load_mesh(tmp_path / "deep.gltf")
