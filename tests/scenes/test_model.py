"""Content decides equality: every value of a scene counts, and nothing else does."""

from dataclasses import fields, replace
from typing import get_args

import numpy as np
import pytest

from aliasbench.scenes.model import (
    TEXTURE_KINDS,
    Animation,
    Camera,
    Checker,
    EdgeFact,
    Facts,
    ImageTexture,
    Light,
    Material,
    Motion,
    Scene,
    Spin,
    Surface,
    Texture,
    as_vec3,
    content_digest,
    read_only,
)
from aliasbench.scenes.shapes import quad

CORNERS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]


def build() -> Scene:
    return Scene(
        name="one",
        camera=Camera("orthographic", height=2.0),
        objects=(quad(CORNERS, texture="tiles"),),
        textures={"tiles": Checker((4.0, 4.0)), "photo": ImageTexture(np.ones((2, 2, 4), np.float32))},
    )


def test_equal_content_is_equal_and_hashes_alike() -> None:
    assert build() == build()
    assert hash(build()) == hash(build())
    assert content_digest(build()) == content_digest(build())


CHANGED = {
    "name": "two",
    "camera": Camera("orthographic", height=2.5),
    "objects": (quad(CORNERS),),
    "textures": {"tiles": Checker((4.0, 5.0))},
    "lights": (Light(((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)), (1, 1, 1)),),
    "background": (0.0, 0.0, 0.1),
    "contrast": 0.5,
    "bounces": 1,
    "animation": Animation(frames=2),
    "facts": Facts(edges=(EdgeFact((0, 0, 0), (1, 0, 0)),)),
}


def test_every_field_of_a_scene_has_a_change_to_try() -> None:
    assert set(CHANGED) == {f.name for f in fields(Scene)}


@pytest.mark.parametrize("field", sorted(CHANGED))
def test_a_change_of_any_field_makes_another_scene(field: str) -> None:
    assert replace(build(), **{field: CHANGED[field]}) != build()


SURFACE_CHANGED = {
    "vertices": np.array(CORNERS) + 1e-12,
    "triangles": np.array([[0, 1, 3], [1, 2, 3]], np.int32),
    "is_polygon": False,
    "color": (1.0, 1.0, 0.9),
    "uv": None,
    "texture": None,
    "material": Material("diffuse"),
    "motion": Motion(velocity=(0.0, 0.0, 1.0)),
    "name": "other",
}


@pytest.mark.parametrize("field", [f.name for f in fields(Surface)])
def test_a_change_of_any_field_makes_another_surface(field: str) -> None:
    surface = quad(CORNERS, texture="tiles")
    assert replace(surface, **{field: SURFACE_CHANGED[field]}) != surface


def test_one_texel_makes_another_texture() -> None:
    texels = np.ones((2, 2, 4), np.float32)
    other = texels.copy()
    other[1, 1, 0] = np.nextafter(np.float32(1), np.float32(0))
    assert ImageTexture(texels) == ImageTexture(texels.copy())
    assert ImageTexture(texels) != ImageTexture(other)


def test_the_order_in_which_textures_are_named_does_not_count() -> None:
    a, b = Checker((1.0, 1.0)), Checker((2.0, 2.0))
    assert content_digest({"a": a, "b": b}) == content_digest({"b": b, "a": a})
    assert content_digest({"a": a, "b": b}) != content_digest({"a": b, "b": a})


def test_whole_and_real_numbers_of_one_value_are_one() -> None:
    assert content_digest((1, 2)) == content_digest((1.0, np.float64(2.0)))
    assert content_digest(True) != content_digest(1)


def test_nesting_counts() -> None:
    assert content_digest(((1, 2), (3,))) != content_digest(((1,), (2, 3)))
    assert content_digest(("ab", "c")) != content_digest(("a", "bc"))


def test_what_cannot_be_hashed_is_refused() -> None:
    with pytest.raises(TypeError, match="no digest for object"):
        content_digest(object())


def test_read_only_arrays_cannot_be_written_and_do_not_follow_their_source() -> None:
    source = np.arange(3.0)
    frozen = read_only(source)
    source[0] = 9.0
    assert frozen[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        frozen[0] = 1.0


@pytest.mark.parametrize(
    ("motion", "static"),
    [
        (Motion(), True),
        (Motion(spin=Spin((0, 0, 1), (0, 0, 0), 0.0)), True),
        (Motion(spin=Spin((0, 0, 1), (0, 0, 0), 1.0)), False),
        (Motion(velocity=(0.0, 1e-9, 0.0)), False),
        (Motion(matrices=((1.0,) * 16, (1.0,) * 16)), False),
    ],
)
def test_a_scene_is_static_when_nothing_in_it_moves(motion: Motion, static: bool) -> None:
    scene = build()
    assert scene.is_static
    assert replace(scene, objects=(quad(CORNERS, motion=motion),)).is_static is static
    assert not replace(scene, camera=replace(scene.camera, velocity=(1.0, 0.0, 0.0))).is_static
    assert not replace(scene, camera=replace(scene.camera, target_velocity=(1.0, 0.0, 0.0))).is_static


def test_every_texture_has_a_name_of_its_own() -> None:
    assert set(TEXTURE_KINDS) == set(get_args(Texture))
    assert len(set(TEXTURE_KINDS.values())) == len(TEXTURE_KINDS)


def test_a_vector_is_three_plain_numbers_without_negative_zeros() -> None:
    vector = as_vec3(np.array([-0.0, 1 / 3, -2.5]))
    assert repr(vector) == f"(0.0, {1 / 3!r}, -2.5)"
