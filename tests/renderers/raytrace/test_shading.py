"""Laws of texture look-ups: nearest texels in float64, levels of detail, analytic values."""

from typing import Any

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.scenes.model import (
    Animation,
    Camera,
    Checker,
    Grating,
    ImageTexture,
    Motion,
    Texture,
    ZonePlate,
    read_only,
)
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import view_at
from aliasbench.scenes.textures import evaluate_point, mip_chain

SIZE = (96, 64)
CAMERA = Camera("perspective", position=(2.0, 4.0, 9.0), fov_y_deg=50.0)
TEXELS = np.random.default_rng(1).random((24, 40, 4), dtype=np.float32)
TEXTURES: dict[str, Texture] = {
    "image": ImageTexture(read_only(TEXELS)),
    "checker": Checker((17.0, 9.0), (0.1, 0.2, 0.3), (0.9, 0.8, 0.6)),
    "sine": Grating(31.0, 25.0, 0.3, "sine", (0.1, 0.0, 0.2), (0.7, 1.0, 0.9)),
    "square": Grating(13.0, -40.0, 0.1, "square"),
    "zone": ZonePlate((0.3, 0.6), 3000.0, 0.7),
}


def hit_uv(motion: Motion, animation: Animation, frame: int) -> tuple[np.ndarray, np.ndarray]:
    """Return (h, w, 2) texture coordinates at pixel centres on the plane of the floor, and which are on the floor."""
    view = view_at(CAMERA, animation, frame, 0.0, SIZE)
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    origin, direction = view.ray(x, y)
    inverse = np.linalg.inv(object_matrix(motion, animation, frame, 0.0))
    o, d = origin @ inverse[:3, :3].T + inverse[:3, 3], direction @ inverse[:3, :3].T
    place = o - o[..., 2:] / d[..., 2:] * d
    uv = (place[..., :2] + 5.0) / 10.0 * [1.5, 2.5] - 0.25
    return uv, (np.abs(place[..., :2]) < 5.0 - 1e-4).all(axis=2)


def floor(quad: Any, name: str, **options: Any) -> Any:
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * [1.5, 2.5] - 0.25
    return quad(-5, -5, 5, 5, uv=uv, texture=name, color=(0.5, 0.75, 1.0), **options)


@pytest.mark.parametrize("name", TEXTURES)
@pytest.mark.parametrize("mode", ["point", "linear"])
@pytest.mark.parametrize("motion", [Motion(), Motion((1.0, 2.0, 0.0), None)], ids=["still", "moved"])
def test_look_ups_are_those_of_float64(quad: Any, flat_scene: Any, name: str, mode: str, motion: Motion) -> None:
    if name == "image" and mode == "linear":
        mode = "point"
    scene = flat_scene([floor(quad, name, motion=motion)], camera=CAMERA, textures=TEXTURES)
    pixels = render(scene, f"raytrace:texture={mode}", size=SIZE, frame=3).pixels
    uv, inside = hit_uv(motion, Animation(), 3)
    expected = evaluate_point(TEXTURES[name], uv)[..., :3] * [0.5, 0.75, 1.0]
    wrong = inside & (np.abs(pixels - expected) > 1e-6).any(axis=2)
    assert inside.sum() > 2000
    # Float64 agrees to some 1e-13 of a texel: a pixel on a border that exactly may fall to either side, and none does.
    assert wrong.sum() == 0


def test_look_ups_on_a_moving_body_are_those_of_its_own_frame(quad: Any, flat_scene: Any) -> None:
    # The camera moves with the floor: every time of the shutter sees the same picture, the still one's.
    velocity = (30.0, -60.0, 90.0)
    camera = Camera("perspective", position=CAMERA.position, fov_y_deg=50.0, velocity=velocity)
    for name in TEXTURES:
        still = flat_scene([floor(quad, name)], camera=CAMERA, textures=TEXTURES)
        moving = flat_scene(
            [floor(quad, name, motion=Motion(velocity))],
            camera=camera,
            textures=TEXTURES,
            animation=Animation(shutter=1.0),
        )
        for mode in ("point", "trilinear"):
            technique = f"raytrace:spp=4,texture={mode}"
            pictures = [render(scene, technique, size=SIZE).pixels for scene in (still, moving)]
            # Some samples lie so near an edge of the floor or a texel that float rounding decides.
            assert np.count_nonzero(np.abs(pictures[0] - pictures[1]).max(axis=2) > 1e-5) <= 4


@pytest.mark.parametrize("level", range(6))
@pytest.mark.parametrize("mode", ["mipmap", "trilinear"])
@pytest.mark.parametrize("camera", ["orthographic", "perspective"])
@pytest.mark.parametrize("spp", [1, 4])
def test_integer_levels_of_detail_are_exactly_the_chain_s_texels(
    quad: Any, flat_scene: Any, level: int, mode: str, camera: Any, spp: int
) -> None:
    # A pixel spans 2^level texels and its centre is a texel's centre there. With 4 samples the footprint is half as
    # wide, and the four texels of the level below average to the same (level 0 is then magnified: left out).
    image = ImageTexture(read_only(np.random.default_rng(2).random((32, 32, 4), dtype=np.float32)))
    pixels = 32 >> level
    view = (
        Camera("orthographic", height=2.0)
        if camera == "orthographic"
        else Camera("perspective", position=(0.0, 0.0, 1.0), fov_y_deg=90.0)
    )
    scene = flat_scene([quad(-1, -1, 1, 1, texture="image")], camera=view, textures={"image": image})
    technique = f"raytrace:texture={mode},spp={spp},sampler=grid"
    if spp == 4 and level == 0:
        pixels = 16
    picture = render(scene, technique, size=(pixels, pixels)).pixels
    expected = mip_chain(image).levels[max(level, 1 if spp == 4 else 0)][::-1, :, :3]
    np.testing.assert_allclose(picture, expected, atol=2e-6)


def test_fractional_levels_blend_and_the_longer_side_decides(quad: Any, flat_scene: Any) -> None:
    # 16 texels across a pixel in one direction and 2^2.5 in the other: the longer decides, LOD 4, and swapped the same.
    texels = np.random.default_rng(3).random((64, 64, 4), dtype=np.float32)
    image = ImageTexture(read_only(texels))
    chain = mip_chain(image).levels
    side = 2.0**2.5
    uv = np.array([[0, 0], [1, 0], [1, side / 16], [0, side / 16]])
    for swap in (False, True):
        corners = uv[:, ::-1] if swap else uv
        scene = flat_scene([quad(-2, -2, 2, 2, uv=corners, texture="i")], height=4.0, textures={"i": image})
        picture = render(scene, "raytrace:texture=trilinear", size=(4, 4)).pixels[3, 1]
        u, v = 1.5 / 4, 0.5 / 4 * side / 16
        x, y = (v, u) if swap else (u, v)
        level = chain[4].astype(np.float64)  # 4 x 4
        a, b = x * 4 - 0.5, y * 4 - 0.5
        i, j, fa, fb = int(np.floor(b)), int(np.floor(a)), a - np.floor(a), b - np.floor(b)
        rows = [(1 - fa) * level[k % 4, j % 4] + fa * level[k % 4, (j + 1) % 4] for k in (i, i + 1)]
        np.testing.assert_allclose(picture, ((1 - fb) * rows[0] + fb * rows[1])[:3], atol=1e-6)
    # Half way between two levels: 2^3.5 texels a pixel, at a place that is a texel's corner in both is their mean.
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * side * 2 * 4 / 64 - 0.5 * side * 2 / 64 * 3
    scene = flat_scene([quad(-2, -2, 2, 2, uv=uv, texture="i")], height=4.0, textures={"i": image})
    picture = render(scene, "raytrace:texture=trilinear", size=(4, 4)).pixels[2, 1]
    corner = [np.mean([c[r, k] for r in (0, -1) for k in (0, -1)], axis=0) for c in (chain[3], chain[4])]
    np.testing.assert_allclose(picture, np.mean(corner, axis=0)[:3], atol=1e-6)


def test_far_away_levels_end_at_the_mean(quad: Any, flat_scene: Any) -> None:
    scene = flat_scene([floor(quad, "image")], height=4000.0, textures=TEXTURES)
    picture = render(scene, "raytrace:texture=trilinear", size=(401, 401)).pixels
    np.testing.assert_allclose(picture[200, 200], TEXELS.mean(axis=(0, 1))[:3] * [0.5, 0.75, 1.0], atol=1e-6)
