"""Names, triangles and data inside a scene file: read as they stand, or refused with what is allowed."""

import base64
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.image_data import exr_bytes
from aliasbench.scenes.inline_data import ARRAY_PREFIX, encode_array, encode_data
from aliasbench.scenes.model import ImageTexture
from aliasbench.scenes.photographs import load_photograph

Write = Callable[[str], str]
POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1 / 3]], dtype=np.float64)
INDICES = np.array([[0, 1, 2], [3, 2, 1]], dtype=np.int32)
TEXELS = np.arange(24, dtype=np.float32).reshape(3, 2, 4) / 7
VERTICES = "[[object]]\nvertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1]]\n"
IMAGE = "[texture.a]\nimage = "


def data_of(content: bytes) -> str:
    return ARRAY_PREFIX + base64.b64encode(content).decode()


@pytest.mark.parametrize("as_data", [False, True])
def test_triangles_are_read_from_lists_and_from_data(scene_file: Write, as_data: bool) -> None:
    rows = (POINTS, INDICES, POINTS[:, :2] * 3)
    written = [f"'{encode_array(r)}'" if as_data else str(r.tolist()) for r in rows]
    text = "[[object]]\nname = 'a b'\nvertices = {}\ntriangles = {}\nuv = {}\ntexture = 't'\ncolor = [1, 0, 0.5]\n"
    (surface,) = load_scene(scene_file(text.format(*written) + "[texture.t]\nchecker = { squares = [1, 1] }\n")).objects
    assert (surface.name, surface.is_polygon, surface.color) == ("a b", False, (1.0, 0.0, 0.5))
    assert surface.uv is not None
    for found, given in zip((surface.vertices, surface.triangles, surface.uv), rows, strict=True):
        assert found.dtype == given.dtype
        assert np.array_equal(found, given)
        assert not found.flags.writeable


def test_without_indices_every_three_vertices_are_a_triangle(scene_file: Write) -> None:
    (surface,) = load_scene(scene_file(f"[[object]]\nvertices = {POINTS[[0, 1, 2, 3, 2, 1]].tolist()}")).objects
    assert surface.triangles.tolist() == [[0, 1, 2], [3, 4, 5]]


def test_an_image_in_the_file_keeps_every_bit_and_may_be_called_something(scene_file: Write) -> None:
    uri = encode_data("image/x-exr", exr_bytes(TEXELS))
    scene = load_scene(scene_file(f"{IMAGE}'{uri}'\n[texture.b]\nimage = '{uri}'\nsource = 'x'\nalpha_cutoff = 0.5"))
    assert scene.textures == {"a": ImageTexture(TEXELS), "b": ImageTexture(TEXELS, 0.5, "x")}


def test_a_photograph_of_scikit_image_is_named(scene_file: Write) -> None:
    scene = load_scene(scene_file(f'{IMAGE}"skimage:brick.png"\nalpha_cutoff = 0.5'))
    assert scene.textures["a"] == load_photograph("brick", 0.5)
    assert isinstance(scene.textures["a"], ImageTexture)
    assert scene.textures["a"].source == "skimage:brick.png"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "[[object]]\nvertices = [[0, 0], [1, 0]]",
            "object[0].vertices = [[0, 0], [1, 0]]: must be a list of points of 3",
        ),
        ("[[object]]\nvertices = 'AAAA'", "vertices: the data begins 'AAAA'; rows of 3 little-endian float64"),
        (f"[[object]]\nvertices = '{ARRAY_PREFIX}!'", "vertices: the data is not base64; rows of 3"),
        (f"[[object]]\nvertices = '{data_of(b'1234')}'", "the data holds 4 bytes, no multiple of 24; rows of 3"),
        (f"[[object]]\nvertices = '{ARRAY_PREFIX}'", "the data holds 0 bytes, no multiple of 24"),
        (
            f"[[object]]\nvertices = '{encode_array(np.full((3, 3), np.nan))}'",
            "must be rows of 3 finite numbers each from -1e+12 to 1e+12",
        ),
        (VERTICES, "object[0].triangles is missing; it must be given where the number of vertices, 4, is no multiple"),
        (VERTICES + "triangles = []", "triangles = []: must be a list of triples of whole numbers from 0 to 3"),
        (VERTICES + "triangles = [[0, 1, 4]]", "triangles = [[0, 1, 4]]: must be a list of triples of whole"),
        (VERTICES + "triangles = [[0, 1, -1]]", "must be a list of triples of whole numbers from 0 to 3"),
        (VERTICES + "triangles = [[0, 1, 2.0]]", "must be a list of triples of whole numbers from 0 to 3"),
        (VERTICES + "triangles = [[0, 1, true]]", "must be a list of triples of whole numbers from 0 to 3"),
        (VERTICES + f"triangles = '{encode_array(INDICES + 1)}'", "must be a list of triples of whole numbers"),
        (
            VERTICES + f"triangles = '{data_of(b'1234')}'",
            "holds 4 bytes, no multiple of 12; rows of 3 little-endian int32",
        ),
        (
            VERTICES + "triangles = [[0, 1, 2]]\nuv = [[0, 0]]",
            "must be a list of 4 points of 2 numbers each, one for each of",
        ),
        (VERTICES + "triangles = [[0, 1, 2]]\npolygon = [[0, 0, 0]]", "object[0] has polygon and vertices together"),
        (
            VERTICES.replace("vertices", "quad") + "triangles = 1",
            "triangles = 1: must be left out: it belongs to vertices",
        ),
        (VERTICES + "triangles = [[0, 1, 2]]\nname = 'a\tb'", "must be a text of printable characters, at most 200"),
        (
            VERTICES + "triangles = [[0, 1, 2]]\nvelocity = [1e12, 0, 0]\n[animation]\nframes = 90",
            "until the end of the",
        ),
        (
            f"{IMAGE}'data:image/png,xx'",
            "texture.a.image: the data begins 'data:image/png,xx'; known: data:image/png;base64,",
        ),
        (
            f"{IMAGE}'data:text/plain;base64,xx'",
            "the data begins 'data:text/plain;base64,'; known: data:image/png;base64,",
        ),
        (f"{IMAGE}'data:image/png;base64,x'", "texture.a.image: the data is not base64"),
        (f"{IMAGE}'data:image/png;base64,aGk='", "texture.a.image: the image in the data: cannot be read"),
        (f"{IMAGE}'data:image/x-exr;base64,'", "texture.a.image: the image in the data: cannot be read"),
        (f"{IMAGE}'skimage:brik.png'", "texture.a.image: unknown photograph 'skimage:brik.png'"),
        (f"{IMAGE}'skimage:../brick.png'", "texture.a.image: unknown photograph"),
        (f'{IMAGE}"a\\u0000b"', "texture.a.image: "),
        (f"{IMAGE}'x.png'\nsource = 3", "texture.a.source = 3: must be a text"),
        ("[texture.a]\nzone_plate = { k = 1 }\nsource = 'x'", "must be left out: it belongs to textures with an image"),
    ],
)
def test_what_is_wrong_with_data_is_refused(scene_file: Write, text: str, said: str) -> None:
    path = scene_file(text)
    with pytest.raises(InputError) as caught:
        load_scene(path)
    assert said in str(caught.value)
    assert str(caught.value).startswith(f"{path}: ")
    assert str(caught.value).isprintable()
    assert "aliasbench-" not in str(caught.value)


def test_an_image_too_large_for_a_scene_file_is_refused_unread(
    scene_file: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("aliasbench.scenes.inline_data.MAX_IMAGE_BYTES", 2**20)
    text = f"{IMAGE}'data:image/png;base64,{'A' * 2**21}'"
    with pytest.raises(InputError, match="the data holds more than 1 MiB; put the image beside the scene file"):
        load_scene(scene_file(text))


def test_a_file_without_end_is_refused(scene_file: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("aliasbench.scenes.files.MAX_FILE_BYTES", 2**20)
    with pytest.raises(InputError, match=r"given\.toml: is over 1 MiB; no scene file may be"):
        load_scene(scene_file("#" * (2**20 + 1)))
    assert Path("/dev/zero").exists()
    with pytest.raises(InputError, match=r"/dev/zero: cannot be read \(not a regular file"):
        load_scene("/dev/zero")
