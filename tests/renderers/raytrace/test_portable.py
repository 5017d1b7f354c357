"""The two engines are one ray tracer: what packets see is what single rays see."""

from typing import Any

import numpy as np
import pytest

from aliasbench.renderers.catalog import prepare, render
from aliasbench.scenes.model import Animation, Camera, Checker, ImageTexture, Motion, Scene, Spin, Surface, read_only

SIZE = (67, 45)
CAMERA = Camera("perspective", position=(0.4, 0.7, 4.0), fov_y_deg=50.0)


def relief(cells: int) -> Surface:
    """Return a wavy triangle mesh with shared edges over [-2, 2] x [-2, 2]."""
    x, y = np.meshgrid(np.linspace(-2, 2, cells + 1), np.linspace(-2, 2, cells + 1))
    vertices = np.stack([x, y, 0.3 * np.sin(3 * x) * np.cos(4 * y)], axis=-1).reshape(-1, 3)
    i = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    n = cells + 1
    triangles = np.concatenate([np.stack([i, i + 1, i + n + 1], 1), np.stack([i, i + n + 1, i + n], 1)])
    uv = vertices[:, :2] / 4 + 0.5
    return Surface(
        read_only(vertices), read_only(triangles.astype(np.int32)), is_polygon=False, uv=read_only(uv), texture="t"
    )


def build(flat_scene: Any, quad: Any, name: str) -> Scene:
    image = ImageTexture(read_only(np.random.default_rng(0).random((13, 20, 4), dtype=np.float32)))
    textures = {"t": Checker((9.0, 7.0)), "i": image}
    background = (0.1, 0.2, 0.3)
    if name == "flat":
        objects = [quad(-1.2, -0.7, 1, 1.1, color=(0.2, 0.5, 0.9)), quad(-0.5, -1.7, 0.4, 0.3, color=(0.9, 0.1, 0.3))]
        return flat_scene(objects, camera=CAMERA, textures=textures, background=background)
    if name == "relief":
        return flat_scene([relief(40)], camera=CAMERA, textures=textures, background=background)
    spin = Motion((4.0, 0.0, 1.0), Spin((0.1, 0.3, 1.0), (0.2, 0.0, 0.0), 7.0))
    objects = [
        quad(-1.2, -0.7, 1, 1.1, color=(0.2, 0.5, 0.9)),
        quad(-0.8, -0.3, 0.8, 0.3, 0.1, texture="i", motion=spin),
        quad(-0.3, -0.8, 0.3, 0.8, 0.2, texture="t", motion=Motion(velocity=(-13.0, 1.0, 0.0))),
    ]
    camera = Camera("perspective", position=(0.4, 0.7, 4.0), fov_y_deg=50.0, velocity=(2.0, 0.0, 1.0),
                    target_velocity=(0.0, 1.0, 0.0))  # fmt: skip
    shutter = Animation(shutter=0.7)
    return flat_scene(objects, camera=camera, textures=textures, background=background, animation=shutter)


@pytest.mark.parametrize("name", ["flat", "relief", "moving"])
@pytest.mark.parametrize("options", ["spp=1", "spp=5", "spp=16", "spp=40,pattern=shared", "spp=9,texture=trilinear"])
def test_packets_equal_single_rays_bit_for_bit(flat_scene: Any, quad: Any, name: str, options: str) -> None:
    scene = build(flat_scene, quad, name)
    packet, portable = (
        render(scene, f"raytrace:engine={engine},{options}", size=SIZE, frame=2, seed=3).pixels
        for engine in ("packet", "portable")
    )
    assert packet.std() > 0.05
    np.testing.assert_array_equal(packet, portable)


def test_without_the_robust_flag_they_differ_only_at_edges(flat_scene: Any, quad: Any) -> None:
    scene = build(flat_scene, quad, "relief")
    packet, portable = (
        render(scene, f"raytrace:engine={engine},robust=off,spp=16", size=SIZE).pixels
        for engine in ("packet", "portable")
    )
    differing = (np.abs(packet - portable) > 1e-5).any(axis=2)
    assert differing.mean() <= 0.001


def test_a_robust_relief_has_no_holes(flat_scene: Any) -> None:
    surface = relief(150)
    scene = flat_scene([surface], camera=Camera("perspective", position=(0, 0, 3.0), fov_y_deg=30.0),
                       textures={"t": Checker((1.0, 1.0), (1.0, 1.0, 1.0))})  # fmt: skip
    np.testing.assert_array_equal(render(scene, "raytrace:spp=16", size=(128, 128)).pixels, 1.0)


def test_a_closed_portable_renderer_says_so(flat_scene: Any, quad: Any) -> None:
    prepared = prepare(build(flat_scene, quad, "flat"), "raytrace:engine=portable", size=(4, 4))
    with prepared:
        assert prepared.render().pixels.shape == (4, 4, 3)
    with pytest.raises(RuntimeError, match="closed"):
        prepared.render()
