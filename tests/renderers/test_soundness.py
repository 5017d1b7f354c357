"""What no renderer may be given: looked up or divided by, it would end in foreign memory or in no number."""

from dataclasses import replace

import numpy as np
import pytest

from aliasbench.renderers.catalog import prepare
from aliasbench.renderers.soundness import check_scene
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Camera, Checker, Grating, ImageTexture, Scene, Texture, ZonePlate
from aliasbench.scenes.shapes import quad

CORNERS = [(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0)]


def scene_with(texture: Texture) -> Scene:
    camera = Camera("orthographic", height=2.0)
    return Scene("sound", camera, (quad(CORNERS, texture="t", name="plate"),), textures={"t": texture})


def texels(value: float = 1.0, shape: tuple[int, ...] = (3, 5, 4)) -> ImageTexture:
    values = np.ones(shape, np.float32)
    values.reshape(-1)[29:30] = value  # row 1, column 2, green
    return ImageTexture(values)


@pytest.mark.parametrize(
    ("texture", "message"),
    [
        (
            texels(np.nan),
            "texels of texture 't' are not all finite numbers, the first at row 1 from the bottom, column 2",
        ),
        (
            texels(-np.inf),
            "texels of texture 't' are not all finite numbers, the first at row 1 from the bottom, column 2",
        ),
        (texels(shape=(0, 5, 4)), r"texels of texture 't' have shape \(0, 5, 4\); \(height, width, 4\) is needed"),
        (texels(shape=(3, 5, 3)), r"texels of texture 't' have shape \(3, 5, 3\); \(height, width, 4\) is needed"),
        (replace(texels(), alpha_cutoff=np.nan), "alpha_cutoff of texture 't' is nan; it must be from 0 to 1"),
        (Checker((np.nan, 2.0)), r"squares of texture 't' must be finite numbers, not \(nan, 2.0\)"),
        (Checker((2.0, -1.0)), r"squares of texture 't' is \(2.0, -1.0\); it must be above 0"),
        (Checker((2.0, 2.0), white=(1.0, np.inf, 1.0)), "white of texture 't' must be finite numbers"),
        (Grating(np.inf), "cycles, angle_deg and phase of texture 't' must be finite numbers"),
        (Grating(1.0, low=(np.nan, 0.0, 0.0)), "low of texture 't' must be finite numbers"),
        (ZonePlate((0.5, np.nan), 1.0), "center, k and phase of texture 't' must be finite numbers"),
    ],
)
def test_textures_that_mean_nothing_are_refused_by_name(texture: Texture, message: str) -> None:
    with pytest.raises(InputError, match=f"scene 'sound': {message}"):
        check_scene(scene_with(texture))


@pytest.mark.parametrize("technique", ["raytrace:", "raytrace:engine=portable", "raster:", "reference:"])
def test_no_renderer_is_given_a_texture_that_means_nothing(technique: str) -> None:
    with pytest.raises(InputError, match="squares of texture 't' must be finite numbers"):
        prepare(scene_with(Checker((np.nan, 2.0))), technique, size=(4, 4))


def test_triangles_and_textures_that_are_not_there_are_refused() -> None:
    scene = scene_with(Checker((2.0, 2.0)))
    plate = scene.objects[0]
    check_scene(scene)
    for index in (-1, 4):
        with pytest.raises(InputError, match=r"triangles of object plate name vertices .*; it has 4, numbered from 0"):
            check_scene(replace(scene, objects=(replace(plate, triangles=np.array([[0, 1, index]], np.int32)),)))
    with pytest.raises(InputError, match="object plate: unknown texture 'tt'; did you mean 't'"):
        check_scene(replace(scene, objects=(replace(plate, texture="tt"),)))
    with pytest.raises(InputError, match=r"uv of object plate is none; its texture needs shape \(4, 2\)"):
        check_scene(replace(scene, objects=(replace(plate, uv=None),)))
    with pytest.raises(InputError, match=r"uv of object plate is an array of shape \(3, 2\)"):
        check_scene(replace(scene, objects=(replace(plate, uv=np.zeros((3, 2))),)))


def test_texels_whose_sum_overflows_are_sound() -> None:
    """The sum that tells whether all are finite is no reason to refuse: values near float64's end in float64 texels."""
    check_scene(scene_with(ImageTexture(np.full((4, 4, 4), 1e308))))  # type: ignore[arg-type]
