"""A texture of a scene file replaces whatever a model file is coloured by, in the model's own coordinates."""

from pathlib import Path

import pytest

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.files import load_scene

POINTS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 2)]


def test_a_scene_files_texture_is_put_on_the_coordinates_of_a_coloured_mesh(tmp_path: Path) -> None:
    head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n{uv}"
    head += "property float red\nproperty float green\nproperty float blue\n"
    head += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    uv, colors = ((0, 0), (1, 0), (1, 1), (0, 1)), ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1))
    given = [(*p, *c, *rgb) for p, c, rgb in zip(POINTS, uv, colors, strict=True)]
    faces = "4 0 1 2 3\n"
    with_uv = head.format(uv="property float u\nproperty float v\n") + "".join(
        f"{' '.join(map(str, g))}\n" for g in given
    )
    without = head.format(uv="") + "".join(f"{' '.join(map(str, (*g[:3], *g[5:])))}\n" for g in given)
    (tmp_path / "a.ply").write_text(with_uv + faces)
    (tmp_path / "b.ply").write_text(without + faces)
    text = '[[object]]\nmesh = "{}.ply"\ntexture = "c"\n[texture.c]\nchecker = {{ squares = [4, 4] }}\n'
    (tmp_path / "a.toml").write_text(text.format("a"))
    scene = load_scene(str(tmp_path / "a.toml"))
    (surface,) = scene.objects
    assert surface.uv is not None
    assert surface.uv.tolist() == [list(pair) for pair in uv]
    assert (surface.texture, list(scene.textures), surface.color) == ("c", ["c"], (0.5, 0.5, 0.5))
    (tmp_path / "b.toml").write_text(text.format("b"))
    with pytest.raises(InputError, match=r"'b.ply' has parts without texture coordinates"):
        load_scene(str(tmp_path / "b.toml"))
