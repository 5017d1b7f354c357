"""glTF files are where they say, under their camera, and move as they say."""

import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import trimesh

from aliasbench.scenes.meshes import load_mesh, load_model_scene
from aliasbench.scenes.motion import object_matrix, rotation_matrix
from aliasbench.scenes.projection import view_at

Write = Callable[..., Path]


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


def test_transforms_multiply_down_the_tree_with_matrices_in_columns(gltf: ModuleType, write: Write) -> None:
    builder = gltf.plain()
    half = math.sqrt(0.5)
    builder.document["nodes"] = [
        {"translation": [10, 0, 0], "rotation": [0, 0, half, half], "scale": [2, 2, 2], "children": [1]},
        {"matrix": [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 0, 3, 0, 1], "mesh": 0},
    ]
    (surface,) = load_mesh(write(builder)).surfaces
    # (x, y) -> (x, 3 - y) -> twice -> a quarter turn -> + 10
    wanted = [(10 - 2 * (3 - y), 2 * x, 0) for x, y, _ in gltf.SQUARE]
    np.testing.assert_allclose(surface.vertices, wanted, atol=1e-12)


@pytest.mark.parametrize(("mode", "indices"), [(4, [0, 1, 2, 0, 2, 3]), (5, [0, 1, 3, 2]), (6, [0, 1, 2, 3])])
def test_lists_strips_and_fans_cover_the_same_square(
    gltf: ModuleType, write: Write, mode: int, indices: list[int]
) -> None:
    for kind in ("u1", "u2", "u4"):
        builder = gltf.Builder()
        primitive = {"attributes": {"POSITION": builder.array(gltf.SQUARE)}, "indices": builder.array(indices, kind)}
        builder.document["meshes"] = [{"primitives": [{**primitive, "mode": mode}]}]
        (surface,) = load_mesh(write(builder)).surfaces
        a, b, c = (surface.vertices[surface.triangles[:, k]] for k in range(3))
        areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
        assert areas.tolist() == [0.5, 0.5]
        assert not surface.is_polygon


def test_sparse_strided_and_normalized_accessors_are_read(gltf: ModuleType, write: Write) -> None:
    builder = gltf.Builder()
    rows = np.zeros(4, [("p", "<f4", 3), ("uv", "<u2", 2)])
    rows["p"], rows["uv"] = gltf.SQUARE, np.array(gltf.UV) * 65535
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


def test_the_files_camera_is_used(gltf: ModuleType, write: Write) -> None:
    builder = gltf.plain()
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
def test_a_model_without_a_camera_is_in_view_and_fills_it(gltf: ModuleType, write: Write, scale: float) -> None:
    builder = gltf.plain()
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


@pytest.mark.parametrize(("turns", "keys"), [(1.0, 5), (-2.0, 9), (0.25, 2), (3.0, 73)])
def test_a_steady_rotation_is_a_spin_exactly(gltf: ModuleType, write: Write, turns: float, keys: int) -> None:
    axis = (1.0, 2.0, -0.5)
    scene = load_model_scene(write(gltf.rotating(keys, turns, 4.0, axis)))
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
        wanted = np.array(gltf.SQUARE) @ (outer @ inner)[:3, :3].T + (outer @ inner)[:3, 3]
        matrix = object_matrix(surface.motion, scene.animation, frame, 0.0)
        found = surface.vertices @ matrix[:3, :3].T + matrix[:3, 3]
        # Keys are float32, the axis is their mean.
        np.testing.assert_allclose(found, wanted, atol=5e-6)


def test_a_wheel_on_a_car_moves_straight_and_turns(gltf: ModuleType, write: Write) -> None:
    builder = gltf.rotating(5, 1.0, 2.0, (0, 0, 1))
    times = builder.array([0.0, 1.0, 2.0])
    gltf.add_animation(builder, 0, "translation", times, builder.array([(1, 2, 3), (2, 2, 3), (3, 2, 3)]))
    (surface,) = load_mesh(write(builder)).surfaces
    assert surface.motion.velocity == pytest.approx((1.0, 0.0, 0.0), abs=1e-6)
    assert surface.motion.spin is not None
    # Mirrored along y, it turns the other way.
    assert surface.motion.spin.axis == pytest.approx((0.0, 0.0, -1.0))
    assert surface.motion.spin.center == pytest.approx((11.0, 2.0, 3.0))


@pytest.mark.parametrize("case", ["step", "uneven", "curve", "scale", "sheared", "spline"])
def test_what_is_no_steady_motion_stays_in_its_first_pose(gltf: ModuleType, write: Write, case: str) -> None:
    builder = gltf.plain()
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
        gltf.add_animation(builder, 1, "rotation", times, builder.array(quarter))
    else:
        builder.document["nodes"] = [node]
        gltf.add_animation(builder, 0, path, times, builder.array(values), kind)
    scene = load_model_scene(write(builder))
    assert scene.is_static
    assert scene.animation.frames == 1
    wanted = {"scale": [0, 5], "sheared": [0, 1]}.get(case, [5, 6])
    assert [scene.objects[0].vertices[:, 0].min(), scene.objects[0].vertices[:, 0].max()] == wanted


def test_triangles_of_no_area_are_dropped_silently(gltf: ModuleType, write: Write) -> None:
    builder = gltf.plain()
    builder.document["meshes"][0]["primitives"][0]["indices"] = builder.array([0, 1, 2, 0, 0, 1, 1, 2, 1], "u2")
    (surface,) = load_mesh(write(builder)).surfaces
    assert len(surface.triangles) == 1
    assert len(surface.vertices) == 3
