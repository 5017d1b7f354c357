"""glTF files look as they say: pictures, colours, what is cut out, and how textures go on beyond their borders."""

import math
from collections.abc import Callable
from pathlib import Path
from types import MappingProxyType, ModuleType

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.meshes import load_mesh
from aliasbench.scenes.textures import evaluate_point, mip_chain, srgb_to_linear

Write = Callable[..., Path]


def value_at(path: Path, x: float, y: float) -> list[float]:
    """Return the texture's value (RGBA) that a model has at a point (x, y, 0) of its unit square."""
    model = load_mesh(path)
    (surface,) = model.surfaces
    assert surface.uv is not None
    assert surface.texture is not None
    corners = {tuple(p): uv for p, uv in zip(surface.vertices.tolist(), surface.uv, strict=True)}
    a, b, d = (corners[p] for p in ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    return list(evaluate_point(model.textures[surface.texture], a + x * (b - a) + y * (d - a)).tolist())


def test_a_picture_stands_upright_and_in_linear_light(gltf: ModuleType, write: Write) -> None:
    path = write(gltf.textured())
    grey = float(srgb_to_linear(np.array(128 / 255)))
    assert value_at(path, 0.25, 0.75) == [1, 0, 0, 1]
    assert value_at(path, 0.75, 0.75) == [0, 1, 0, 1]
    assert value_at(path, 0.25, 0.25) == [0, 0, 1, 1]
    assert value_at(path, 0.75, 0.25) == pytest.approx([grey] * 3 + [1], rel=1e-6)


def test_the_renderers_draw_what_the_file_says(gltf: ModuleType, write: Write) -> None:
    camera = {"type": "orthographic", "orthographic": {"xmag": 0.5, "ymag": 0.5, "znear": 0.1, "zfar": 9}}
    builder = gltf.textured()
    builder.document |= {"cameras": [camera], "nodes": [{"mesh": 0}, {"camera": 0, "translation": [0.5, 0.5, 3]}]}
    builder.document["scenes"] = [{"nodes": [0, 1]}]
    scene = load_scene(str(write(builder)))
    grey = float(srgb_to_linear(np.array(128 / 255)))
    wanted = np.array([[[1, 0, 0], [0, 1, 0]], [[0, 0, 1], [grey] * 3]], np.float32)
    for technique in ("raytrace:", "raster:", "reference:"):
        np.testing.assert_allclose(render(scene, technique, size=(2, 2)).pixels, wanted, atol=1e-6)


def test_alpha_cuts_out_where_the_mode_says_so(gltf: ModuleType, write: Write) -> None:
    half = [[[255, 0, 0, 255], [255, 0, 0, 100]]]
    cutoffs = []
    for more in ({}, {"alphaMode": "MASK"}, {"alphaMode": "MASK", "alphaCutoff": 0.3}, {"alphaMode": "BLEND"}):
        (texture,) = load_mesh(write(gltf.textured(half, **more))).textures.values()
        cutoffs.append(texture.alpha_cutoff)
        assert texture.texels[0, 1].tolist() == pytest.approx([1, 0, 0, 100 / 255])  # not multiplied by alpha
    # With a cutoff of 0.3 nothing is cut out: a plain texture, which every renderer draws.
    assert cutoffs == [None, 0.5, None, 0.5]
    faded = gltf.textured(half, alphaMode="MASK", factor=[1, 1, 1, 0.8])
    (texture,) = load_mesh(write(faded)).textures.values()
    assert texture.alpha_cutoff == pytest.approx(0.625)
    for mode, rule in (("MASK", "its cutoff"), ("BLEND", "at which BLEND is drawn as a cut-out")):
        with pytest.raises(InputError, match=rf"all of its parts are transparent: .*alpha 0.4 is below 0.5, {rule}"):
            load_mesh(write(gltf.textured(half, alphaMode=mode, factor=[1, 1, 1, 0.4])))


@pytest.mark.parametrize(
    ("color", "emissive", "wanted"),
    [
        ([0, 0, 0, 1], {"emissiveFactor": [1, 0.5, 0]}, [1, 0.5, 0]),
        ([0.25, 0.5, 0, 1], {"emissiveFactor": [0.25, 0, 0.5]}, [0.5, 0.5, 0.5]),
        (
            [0.5, 0, 0, 1],
            {
                "emissiveFactor": [0, 0, 1],
                "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 3}},
            },
            [0.5, 0, 3],
        ),
        ([0.5, 0, 0, 1], {"emissiveFactor": [0, 0, 1], "extensions": {"KHR_materials_unlit": {}}}, [0.5, 0, 0]),
    ],
)
def test_what_shines_is_added_to_the_colour(
    gltf: ModuleType, write: Write, color: list[float], emissive: dict[str, object], wanted: list[float]
) -> None:
    builder = gltf.plain(material=0)
    builder.document["materials"] = [{"pbrMetallicRoughness": {"baseColorFactor": color}, **emissive}]
    (surface,) = load_mesh(write(builder)).surfaces
    assert list(surface.color) == wanted
    # Colours of vertices multiply what is lit only.
    attributes = builder.document["meshes"][0]["primitives"][0]["attributes"]
    attributes["COLOR_0"] = builder.array([(0, 0, 0)] * 4)
    (surface,) = load_mesh(write(builder)).surfaces
    assert list(surface.color) == [w - c for w, c in zip(wanted, color, strict=False)]


def test_an_emissive_texture_is_drawn_where_the_base_is_black_and_left_out_elsewhere(
    gltf: ModuleType, write: Write
) -> None:
    shining = {"emissiveFactor": [1, 0.5, 1], "emissiveTexture": {"index": 0}}
    model = load_mesh(write(gltf.textured(factor=[0, 0, 0, 1], **shining)))
    (surface,) = model.surfaces
    assert surface.color == (1, 0.5, 1)
    assert surface.texture is not None
    assert model.textures[surface.texture].texels[1, 0, :3].tolist() == [1, 0, 0]
    for more in ({"factor": [1, 1, 0, 1]}, {"factor": [0, 0, 0, 1], "alphaMode": "MASK"}):
        (surface,) = load_mesh(write(gltf.textured(**more, **shining))).surfaces
        assert list(surface.color) == more["factor"][:3]
    # Without a texture of its own black times the base's is black.
    (surface,) = load_mesh(write(gltf.textured(factor=[0, 0, 0, 1], emissiveFactor=[0, 1, 0]))).surfaces
    assert (surface.color, surface.texture) == ((0, 1, 0), None)


def test_emissive_values_are_not_negative(gltf: ModuleType, write: Write) -> None:
    with pytest.raises(InputError, match=r"emissiveFactor = \[0, -1, 0\]: must be three numbers of at least 0"):
        load_mesh(write(gltf.textured(emissiveFactor=[0, -1, 0])))


@pytest.mark.parametrize("axis", ["wrapS", "wrapT"])
@pytest.mark.parametrize(("code", "chosen"), [(10497, [0, 1, 0, 1]), (33648, [0, 1, 1, 0]), (33071, [0, 1, 1, 1])])
def test_samplers_wrap_as_they_say(gltf: ModuleType, write: Write, axis: str, code: int, chosen: list[int]) -> None:
    row = [[255, 0, 0], [0, 255, 0]]
    pixels = [row] if axis == "wrapS" else [[row[1]], [row[0]]]
    scale = [2, 1] if axis == "wrapS" else [1, 2]
    # Along v the transform starts at the top: shifted by one period down, it is at the bottom.
    offset = [0, 0] if axis == "wrapS" else [0, -1]
    info = {"extensions": {"KHR_texture_transform": {"scale": scale, "offset": offset}}}
    path = write(gltf.textured(pixels, sampler={axis: code}, info=info))
    found = []
    for k in range(4):
        along = (k + 0.5) / 4
        value = value_at(path, along, 0.5) if axis == "wrapS" else value_at(path, 0.5, along)
        found.append(value[:2])
    assert found == [[1.0, 0.0] if c == 0 else [0.0, 1.0] for c in chosen]


def test_a_texture_transform_rotates_counter_clockwise_and_chooses_its_set(gltf: ModuleType, write: Write) -> None:
    turned = {"extensions": {"KHR_texture_transform": {"rotation": math.pi / 2, "offset": [0, 1]}}}
    # uv turned counter-clockwise in the picture: what was seen at the right is seen at the top.
    path = write(gltf.textured(info=turned))
    u, v = 0.75, 0.25
    moved = (v, 1 - u)  # u' = u cos + v sin, v' = -u sin + v cos, + (0, 1)
    expected = np.array(gltf.FOUR)[int(moved[1] * 2), int(moved[0] * 2)] / 255
    assert value_at(path, u, 1 - v)[:3] == pytest.approx(srgb_to_linear(expected).tolist(), rel=1e-6)
    with pytest.raises(InputError, match=r"attributes.TEXCOORD_1 is missing; it must be given: the material's texture"):
        load_mesh(write(gltf.textured(info={"texCoord": 1})))


def test_one_colour_at_all_vertices_is_the_surfaces_and_several_are_flat(gltf: ModuleType, write: Write) -> None:
    for colors, wanted in (([(0.5, 0.25, 1)] * 4, [[0.5, 0.25, 1]] * 2), ([(1, 0, 0)] * 3 + [(0, 0, 0)], None)):
        builder = gltf.plain()
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


def test_copies_of_a_coloured_mesh_share_one_palette(gltf: ModuleType, write: Write) -> None:
    builder = gltf.plain()
    attributes = builder.document["meshes"][0]["primitives"][0]["attributes"]
    attributes["COLOR_0"] = builder.array([(1, 0, 0)] * 3 + [(0, 0, 0)])
    builder.document["nodes"] = [{"mesh": 0, "children": [1, 2]}, *[{"mesh": 0, "translation": [2, 0, 0]}] * 2]
    model = load_mesh(write(builder))
    (surface,) = model.surfaces
    assert list(model.textures) == [surface.texture] == ["a.glb#colors 0"]
    assert len(surface.triangles) == 6
    assert surface.uv is not None
    np.testing.assert_array_equal(surface.uv, np.tile(surface.uv[:6], (3, 1)))


@pytest.mark.parametrize("mode", ["OPAQUE", "MASK", "BLEND"])
def test_alpha_at_vertices_cuts_out_triangles_and_multiplies_the_textures(
    gltf: ModuleType, write: Write, mode: str
) -> None:
    # The second triangle, of corners 0, 2 and 3, has a mean of 0.4; the first one of 0.8.
    alpha = [(1, 1, 1, a) for a in (0.6, 1.2, 0.6, 0.0)]
    builder = gltf.plain(material=0)
    builder.document["materials"] = [{"alphaMode": mode}]
    attributes = builder.document["meshes"][0]["primitives"][0]["attributes"]
    attributes["COLOR_0"] = builder.array(alpha)
    (surface,) = load_mesh(write(builder)).surfaces
    assert len(surface.triangles) == (2 if mode == "OPAQUE" else 1)
    # Alpha is no more than 1: the mean that is left is (0.6 + 1 + 0.6) / 3.
    half = gltf.textured([[[255, 0, 0, 255], [255, 0, 0, 100]]], alphaMode=mode)
    half.document["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = half.array(alpha)
    model = load_mesh(write(half))
    (texture,) = model.textures.values()
    assert texture.alpha_cutoff == (None if mode == "OPAQUE" else pytest.approx(0.5 * 3 / 2.2))
    attributes["COLOR_0"] = builder.array([(1, 1, 1, 0.25)] * 4)
    if mode != "OPAQUE":
        with pytest.raises(InputError, match=r"all of its parts are transparent: the alpha of COLOR_0 of .* below 0.5"):
            load_mesh(write(builder))


@pytest.mark.parametrize("code", [33648, 33071])
def test_what_does_not_repeat_is_not_filtered_with_its_opposite_border(
    gltf: ModuleType, write: Write, code: int
) -> None:
    # Left half black, right half white: where it repeats, filtered values next to the border are grey.
    pixels = np.repeat(np.array([0, 255], np.uint8), 32)[None, :, None].repeat(64, axis=0).repeat(3, axis=2)
    model = load_mesh(write(gltf.textured(pixels, sampler={"wrapS": code, "wrapT": code})))
    (surface,) = model.surfaces
    (texture,) = model.textures.values()
    assert surface.uv is not None
    left, right = surface.uv[:, 0].min(), surface.uv[:, 0].max()
    for level in mip_chain(texture).levels[:5]:
        width = level.shape[1]
        # The two texels that are blended on a border of the picture, of its inside and of its outside.
        for border, value in ((left * width, 0.0), (right * width, 1.0)):
            assert border == pytest.approx(round(border))
            assert (level[:, [round(border) - 1, round(border) % width], 0] == value).all()


def test_a_texture_that_replaces_the_files_has_the_coordinates_of_its_pictures(gltf: ModuleType, write: Write) -> None:
    info = {"extensions": {"KHR_texture_transform": {"scale": [2, 1]}}}
    builder = gltf.textured(sampler={"wrapS": 33071}, info=info)
    builder.document["images"] = [{"uri": "missing.png"}]
    model = load_mesh(write(builder), retextured=True)
    (surface,) = model.surfaces
    assert not model.textures
    assert surface.texture is None
    assert surface.uv is not None
    assert surface.uv.tolist() == [[0, 0], [2, 0], [2, 1], [0, 1]]


def test_an_image_that_cannot_be_put_down_to_be_decoded_is_said_so(
    gltf: ModuleType, write: Write, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "missing"))
    with pytest.raises(InputError, match=r"images\[0\]: cannot be decoded: a folder for temporary files with room"):
        load_mesh(write(gltf.textured()))


def test_textures_of_a_model_are_not_written_to(gltf: ModuleType, write: Write) -> None:
    textures = load_mesh(write(gltf.textured())).textures
    assert isinstance(textures, MappingProxyType)
