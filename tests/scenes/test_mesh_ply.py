"""PLY files: every form gives the same faces, colours are taken as they are meant, damage is refused."""

import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.meshes import load_mesh
from aliasbench.scenes.textures import srgb_to_linear

HEAD = """ply
format {format} 1.0
comment two faces
element vertex 4
property float x
property float y
property double z
{extra}element face {faces}
property uchar flags
property list {count} int vertex_indices
property list uchar float texcoord
end_header
"""
POINTS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 2)]


def ply(order: str, faces: list[list[int]], count: str = "uchar", colors: bool = False) -> bytes:
    """Return a PLY file in an order: ``<``, ``>`` or empty for ascii."""
    extra = "property uchar red\nproperty uchar green\nproperty uchar blue\n" if colors else ""
    name = {"<": "binary_little_endian", ">": "binary_big_endian", "": "ascii"}[order]
    head = HEAD.format(format=name, extra=extra, faces=len(faces), count=count).encode()
    color = (255, 0, 51) if colors else ()
    if not order:
        lines = [" ".join(map(str, (*p, *color))) for p in POINTS]
        lines += [" ".join(map(str, (7, len(f), *f, 2, 0.5, 0.5))) for f in faces]
        return head + "\n".join(lines).encode() + b"\n"
    body = b"".join(struct.pack(f"{order}ffd{len(color)}B", *p, *color) for p in POINTS)
    kind = {"uchar": "B", "int": "i"}[count]
    for f in faces:
        body += struct.pack(f"{order}B{kind}{len(f)}iBff", 7, len(f), *f, 2, 0.5, 0.5)
    return head + body


@pytest.mark.parametrize("order", ["<", ">", ""])
@pytest.mark.parametrize("count", ["uchar", "int"])
@pytest.mark.parametrize(
    ("faces", "wanted"),
    [
        ([[0, 1, 2], [0, 2, 3]], [[0, 1, 2], [0, 2, 3]]),
        ([[0, 1, 2, 3]], [[0, 1, 2], [0, 2, 3]]),
        ([[0, 1, 2, 3], [1, 2, 3], [0, 1]], [[1, 2, 3], [0, 1, 2], [0, 2, 3]]),
    ],
)
def test_every_form_of_ply_gives_the_same_faces(
    tmp_path: Path, order: str, count: str, faces: list[list[int]], wanted: list[list[int]]
) -> None:
    (tmp_path / "a.ply").write_bytes(ply(order, faces, count))
    (surface,) = load_mesh(tmp_path / "a.ply").surfaces
    assert surface.vertices.tolist() == [list(map(float, p)) for p in POINTS]
    assert surface.triangles.tolist() == wanted
    assert surface.texture is None


@pytest.mark.parametrize("order", ["<", ">", ""])
def test_colours_of_bytes_are_srgb(tmp_path: Path, order: str) -> None:
    (tmp_path / "a.ply").write_bytes(ply(order, [[0, 1, 2]], colors=True))
    (surface,) = load_mesh(tmp_path / "a.ply").surfaces
    assert surface.color == pytest.approx(srgb_to_linear(np.array([255, 0, 51]) / 255).tolist())


@pytest.mark.parametrize("encoding", ["binary_little_endian", "ascii"])
def test_a_ply_is_what_trimesh_wrote(tmp_path: Path, encoding: str) -> None:
    ball = trimesh.creation.icosphere(subdivisions=2)
    (tmp_path / "ball.ply").write_bytes(trimesh.exchange.ply.export_ply(ball, encoding=encoding))
    (surface,) = load_mesh(tmp_path / "ball.ply").surfaces
    np.testing.assert_array_equal(surface.triangles, ball.faces)
    np.testing.assert_allclose(surface.vertices, ball.vertices, atol=1e-7)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "has no PLY header"),
        (b"ply\nformat ascii 1.0\nelement vertex 1\n", "has no PLY header"),
        (b"ply\nformat ascii 2.0\nend_header\n", "line 2: 'format ascii 2.0' is no line of a PLY 1.0 header"),
        (b"ply\nelement vertex -1\nend_header\n", "line 2: 'element vertex -1' is no line"),
        (b"ply\nend_header\n", "has no format line"),
        (b"ply\nformat ascii 1.0\nend_header\n", "has no vertices with x, y and z"),
        (ply("<", [[0, 1, 2]])[:-30], "has not the"),
        (ply("<", [[0, 1, 2], [0, 1, 2, 3]])[:-9], "has not the 2 elements 'face' that its header says (cut off?)"),
        (
            ply("", [[0, 1, 2]])[:-12],
            "a list 'vertex_indices' has a length of 3; the file has 2 more of its values (cut off?)",
        ),
        (ply("", [[0, 1, 2]]).replace(b"7 3", b"7 x"), "line 17: '7 x 0 1 2 "),
        (ply("", [[0, 1, 2]]).replace(b"7 3", b"7 -3"), "element 'face': a list 'vertex_indices' has a length of -3"),
        (ply("", [[0, 1, 2]]) + b"5 6\n", "has 2 numbers more than the elements of its header have"),
        (
            ply("", [[0, 1, 2]]).replace(b"element face", b"element vertex"),
            "line 8: there is an element 'vertex' already",
        ),
        (ply("", [[0, 1, 2]]).replace(b"3 0 1 2", b"3 0 1 1.5"), "a face has the index 1.5; whole numbers from 0"),
        (ply("", [[0, 1, 2]]).replace(b"vertex 4", b"vertex 99999999"), "element vertex has a count of 99999999"),
        (ply("<", [[0, 1, 4]]), "index 4 has no vertex; there are 4 vertices"),
        (ply("<", [[0, 1, -2]]), "a face has the index -2; whole numbers from 0 are needed"),
        (ply("", [[0, 1, 2]]).replace(b"1 1 0", b"1 nan 0"), "mesh: vertex 2 is [1.0, nan, 0.0]; finite numbers"),
        (ply("<", [[0, 1, 1]]), "has no triangle with an area"),
        (ply("<", []), "has no triangle with an area"),
    ],
)
def test_damaged_ply_files_are_refused(tmp_path: Path, data: bytes, message: str) -> None:
    (tmp_path / "a.ply").write_bytes(data)
    with pytest.raises(InputError) as caught:
        load_scene(str(tmp_path / "a.ply"))
    assert message in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path / "a.ply"))


@pytest.mark.parametrize("line", ["property float x\n", "property list uchar float x\n"])
def test_a_property_that_is_there_twice_is_refused(tmp_path: Path, line: str) -> None:
    data = ply("", [[0, 1, 2]]).replace(b"property float y\n", line.encode() + b"property float y\n")
    (tmp_path / "a.ply").write_bytes(data)
    with pytest.raises(InputError, match=r"a.ply: line 6: element vertex has a property 'x' already"):
        load_mesh(tmp_path / "a.ply")
