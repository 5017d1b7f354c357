"""OBJ files with their materials, and meshes in scene files: looks, places, several files, damage refused."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.meshes import load_mesh
from aliasbench.scenes.model import ImageTexture
from aliasbench.scenes.textures import evaluate_point, load_image

OBJ = """# a square
mtllib a.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vn 0 0 1
usemtl pic
f {}
"""
MTL = "newmtl pic\nKd 0.5 1 1\nmap_Kd {}\nnewmtl plain\nKd 0.25 0.5 0.75\n"
PPM = b"P6 2 2 255\n" + bytes([255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255])  # top row first


def obj(folder: Path, text: str, mtl: str | None = None) -> Path:
    (folder / "a.obj").write_text(text)
    (folder / "a.mtl").write_text(MTL.format("a.ppm") if mtl is None else mtl)
    (folder / "a.ppm").write_bytes(PPM)
    return folder / "a.obj"


@pytest.mark.parametrize("face", ["1/1 2/2 3/3 4/4", "1/1/1 2/2/1 3/3/1 4/4/1", "-4/-4 -3/-3 -2/-2 -1/-1"])
def test_an_obj_has_its_texture_upright_times_its_colour(tmp_path: Path, face: str) -> None:
    model = load_mesh(obj(tmp_path, OBJ.format(face)))
    (surface,) = model.surfaces
    assert surface.color == (0.5, 1.0, 1.0)
    assert surface.texture == "a.obj#a.ppm"
    assert surface.uv is not None
    assert len(surface.triangles) == 2
    corner = {tuple(p): uv for p, uv in zip(surface.vertices.tolist(), surface.uv, strict=True)}
    assert corner[(0.0, 0.0, 0.0)].tolist() == [0, 0]
    assert corner[(1.0, 1.0, 0.0)].tolist() == [1, 1]
    seen = [evaluate_point(model.textures["a.obj#a.ppm"], np.array(uv))[:3].tolist() for uv in ((0.2, 0.8), (0.2, 0.2))]
    assert seen == [[1, 0, 0], [0, 0, 1]]


def test_parts_of_an_obj_have_their_materials(tmp_path: Path) -> None:
    text = OBJ.format("1/1 2/2 3/3") + "usemtl plain\nf 1//1 3//1 4//1\nf 1 2 4\nusemtl pic\nf 1/1 3/3 4/4\n"
    surfaces = load_mesh(obj(tmp_path, text)).surfaces
    assert [(s.color, s.texture, len(s.triangles)) for s in surfaces] == [
        ((0.5, 1.0, 1.0), "a.obj#a.ppm", 2),
        ((0.25, 0.5, 0.75), None, 2),
    ]
    assert [s.name for s in surfaces] == ["a.obj#0", "a.obj#1"]


def test_an_obj_is_what_trimesh_reads(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=2)
    (tmp_path / "ball.obj").write_text(trimesh.exchange.obj.export_obj(ball, include_normals=True, digits=12))
    (surface,) = load_mesh(tmp_path / "ball.obj").surfaces
    np.testing.assert_allclose(surface.vertices[surface.triangles], ball.triangles, atol=1e-11)


@pytest.mark.parametrize(
    ("text", "mtl", "message"),
    [
        ("", None, "has no vertices (lines 'v x y z')"),
        ("v 1 2\nf 1 1 1", None, "line 1: 'v 1 2': v has 2 numbers; 3 or 4 or 6 are needed"),
        ("v 1 2 3\n\nv 1 2 x\nf 1 1 1", None, "line 3: 'v 1 2 x': has something other than numbers"),
        ("v 1 2 3\nf \\\n1 1\\\n1\nf 9 9 9", None, "line 5: there is no vertex 9"),
        (OBJ.format("1/1 2/2"), None, "line 13: a face of 2 corners; 3 at least are needed"),
        (OBJ.format("1/1 2/2 9/3"), None, "line 13: there is no vertex 9; there are 4"),
        (OBJ.format("1/1 2/2 0/3"), None, "line 13: there is no vertex 0"),
        (OBJ.format("1/1 2/2 3/-9"), None, "line 13: there is no texture coordinate -9"),
        (OBJ.format("1/1 2/2 3/x"), None, "is no corner of a face; v, v/vt, v//vn and v/vt/vn are"),
        (OBJ.format("1/1 2/2 1/2/3/4"), None, "1/2/3/4' is no corner"),
        (OBJ.format("1/1 2/2 " + "1" * 60), None, "is no corner of a face"),
        (OBJ.format("1 2 3"), None, "line 13: a face with a textured material needs texture coordinates (vt)"),
        (
            OBJ.format("1/1 2/2 3/3").replace("usemtl pic", "usemtl pik"),
            None,
            "unknown material 'pik'; did you mean 'pic'",
        ),
        (OBJ.format("1/1 2/2 3/3").replace("a.mtl", "b.mtl"), None, "mtllib: 'b.mtl': no such file"),
        (OBJ.format("1/1 2/2 3/3").replace("a.mtl", "../a.mtl"), None, "'../a.mtl' leads out of the folder"),
        (OBJ.format("1/1 2/2 3/3"), MTL.format("gone.png"), "map_Kd: image 'gone.png': no such file"),
        (OBJ.format("1/1 2/2 3/3"), MTL.format("http://x.org/a.png"), "is no local file"),
        (OBJ.format("1/1 2/2 3/3"), MTL.format("C:\\\\a.png"), "is no local file"),
        (OBJ.format("1/1 2/2 3/3"), MTL.format("-s 2 2 a.ppm"), "map_Kd has options"),
        (
            OBJ.format("1/1 2/2 3/3"),
            MTL.replace("0.5 1 1", "-1 0 0").format("a.ppm"),
            "Kd -1 0 0 must be one number or three",
        ),
        (OBJ.format("1/1 2/2 3/3"), MTL.replace("0.5 1 1", "1 0").format("a.ppm"), "a.mtl: line 2: Kd 1 0 must be"),
        (OBJ.format("1/1 2/2 3/3"), MTL.format("a" * 3000), "a.mtl: line 3: map_Kd: image 'aaa"),
        (OBJ.format("1/1 2/2 3/3"), "\v\u2028\x85\n" + MTL.format("-s a.ppm"), "a.mtl: line 4: map_Kd has options"),
        (
            OBJ.format("1/1 2/2 3/3").replace("v 1 1 0", "v nan 1 0"),
            None,
            "line 5: 'v nan 1 0': finite numbers up to 1e+12 are needed",
        ),
    ],
)
def test_damaged_obj_files_are_refused(tmp_path: Path, text: str, mtl: str | None, message: str) -> None:
    with pytest.raises(InputError) as caught:
        load_scene(str(obj(tmp_path, text, mtl)))
    assert message in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path / "a.obj"))


def test_a_mesh_in_a_scene_file_takes_what_the_object_says(tmp_path: Path) -> None:
    obj(tmp_path, OBJ.format("1/1 2/2 3/3 4/4"))
    file = tmp_path / "s.toml"
    file.write_text('[[object]]\nmesh = "a.obj"\ncolor = [0.5, 0.5, 2]\nvelocity = [1, 0, 0]\n')
    scene = load_scene(str(file))
    (surface,) = scene.objects
    assert surface.color == (0.25, 0.5, 2.0)
    assert surface.motion.velocity == (1.0, 0.0, 0.0)
    assert list(scene.textures) == ["a.obj#a.ppm"]
    file.write_text('[[object]]\nmesh = "a.obj"\ntexture = "c"\n[texture.c]\nchecker = { squares = [2, 2] }\n')
    scene = load_scene(str(file))
    assert (scene.objects[0].texture, list(scene.textures)) == ("c", ["c"])
    file.write_text('[[object]]\nmesh = "a.obj"\nuv = [[0, 0]]\n')
    with pytest.raises(InputError, match=r"object\[0\]\.uv = .*must be left out: a mesh has its own"):
        load_scene(str(file))
    (tmp_path / "b.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    file.write_text('[[object]]\nmesh = "b.obj"\ntexture = "c"\n[texture.c]\nchecker = { squares = [2, 2] }\n')
    with pytest.raises(InputError, match=r"object\[0\]\.texture: 'b.obj' has parts without texture coordinates"):
        load_scene(str(file))


def test_only_known_kinds_of_model_files_are_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"unknown kind of model file '.stl'.*known: .glb, .gltf, .obj, .ply"):
        load_mesh(tmp_path / "a.stl")
    for name in ("a.glb", "a.obj", "a.ply"):
        (tmp_path / name).mkdir()
        with pytest.raises(InputError, match=f"{name}: not a regular file"):
            load_scene(str(tmp_path / name))


def test_a_line_of_libraries_may_name_several_or_one_with_blanks(tmp_path: Path) -> None:
    text = OBJ.format("1/1 2/2 3/3") + "usemtl green\nf 1 2 3\n"
    (tmp_path / "b.mtl").write_text("newmtl green\nKd 0 1 0\n")
    assert [s.color for s in load_mesh(obj(tmp_path, text.replace("a.mtl", "a.mtl  b.mtl"))).surfaces][1] == (0, 1, 0)
    (tmp_path / "a.mtl b.mtl").write_text(MTL.format("a.ppm") + "newmtl green\nKd 0 0.5 0\n")
    assert [s.color for s in load_mesh(obj(tmp_path, text.replace("a.mtl", "a.mtl b.mtl"))).surfaces][1] == (0, 0.5, 0)
    with pytest.raises(InputError, match="names more than 64 material libraries"):
        load_mesh(obj(tmp_path, text.replace("a.mtl", "a.mtl " * 65)))


def test_comments_behind_numbers_are_no_part_of_them(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text("newmtl no #1\nKd 0 1 0\n")
    (tmp_path / "a.obj").write_text(
        "mtllib a.mtl\nv 0 0 0 # first\nv 1 0 0#second\n# all\nv 0 1 0\nusemtl no #1\nf 1 2 3 # 4\nf 1 2 9 # tri\n"
    )
    with pytest.raises(InputError, match="line 8: there is no vertex 9"):
        load_mesh(tmp_path / "a.obj")
    (tmp_path / "a.obj").write_text((tmp_path / "a.obj").read_text().replace("9 # tri", "3 # tri"))
    (surface,) = load_mesh(tmp_path / "a.obj").surfaces
    assert surface.color == (0, 1, 0)
    assert len(surface.triangles) == 2


def test_images_are_told_apart_by_their_paths_and_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "a.ppm").write_bytes(PPM[:-1] + b"\0")
    names = ("a.ppm", "sub/a.ppm", "sub/../a.ppm", "sub\\a.ppm", "./sub/a.ppm")
    mtl = "".join(f"newmtl m{k}\nmap_Kd {name}\n" for k, name in enumerate(names))
    text = OBJ.format("1/1 2/2 3/3").replace("usemtl pic", "usemtl m0")
    path = obj(tmp_path, text + "".join(f"usemtl m{k}\nf 1/1 2/2 3/3\n" for k in range(1, 5)), mtl)
    read: list[Path] = []

    def counted(path: Path, **more: Any) -> ImageTexture:
        read.append(path)
        return load_image(path, **more)

    monkeypatch.setattr("aliasbench.scenes.mesh_obj.load_image", counted)
    model = load_mesh(path)
    assert [s.texture for s in model.surfaces] == ["a.obj#a.ppm", "a.obj#sub/a.ppm"]
    assert len(read) == 2
    assert model.textures["a.obj#a.ppm"] != model.textures["a.obj#sub/a.ppm"]


def test_names_that_are_not_utf8_are_told_apart_and_printable(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_bytes(b"newmtl \xe9\nKd 1 0 0\nnewmtl \xe8\nKd 0 1 0\n")
    lines = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl \xe9\nf 1 2 3\nusemtl \xe8\nf 1/1 2/1 3/1\n"
    (tmp_path / "a.obj").write_bytes(lines)
    model = load_mesh(tmp_path / "a.obj")
    assert [s.color for s in model.surfaces] == [(1, 0, 0), (0, 1, 0)]
    with (tmp_path / "a.mtl").open("ab") as file:
        file.write(b"map_Kd \xe8.ppm\n")
    for reason in (r"no such file", r"cannot be read \(its path is not UTF-8\)"):
        with pytest.raises(InputError, match=rf"line 5: map_Kd: image '\\udce8.ppm': {reason}"):
            load_mesh(tmp_path / "a.obj")
        Path(os.fsdecode(bytes(tmp_path) + b"/\xe8.ppm")).write_bytes(PPM)
    (tmp_path / "a.obj").write_bytes(lines.replace(b"usemtl \xe9", b"usemtl \xea"))
    with pytest.raises(InputError, match="unknown material") as caught:
        load_mesh(tmp_path / "a.obj")
    assert str(caught.value).isprintable()


def test_parts_of_many_materials_have_only_their_vertices(tmp_path: Path) -> None:
    points = "".join(f"v {k} {k * k} {k % 3}\n" for k in range(3000))
    (tmp_path / "a.obj").write_text(points + "".join(f"usemtl m{k}\nf {k} {k + 1} {k + 2}\n" for k in range(1, 2000)))
    (surface,) = load_mesh(tmp_path / "a.obj").surfaces
    k = np.arange(1999)[:, None] + np.arange(3)
    np.testing.assert_array_equal(surface.vertices[surface.triangles], np.stack([k, k**2, k % 3], axis=-1))
    (tmp_path / "a.obj").write_text("v 0 0 0\n" + "".join(f"usemtl m{k}\nf 1 1 1\n" for k in range(20_001)))
    with pytest.raises(InputError, match="comes to 20001 parts"):
        load_mesh(tmp_path / "a.obj")
