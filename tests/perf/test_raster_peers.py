"""The rasterizer beside pyrender, the offscreen renderer that Python has, on a floor of one texture.

pyrender is an optional peer (the extra `peers`). It draws with four hardware samples and trilinear mipmaps into 8 bits
of sRGB, and reads colour and depth: `raster:msaa=4,texture=trilinear` is the nearest of ours, with 32-bit floats.
`make bench` prints the ratio; nothing is asserted of it.
"""

import os
import time
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from aliasbench.renderers.catalog import prepare
from aliasbench.scenes.model import Camera, Checker, Scene, Surface, read_only

SQUARES = 64
REACH = 40.0
CAMERA = Camera("perspective", position=(0.0, 1.0, 0.0), target=(0.0, 0.6, -4.0), fov_y_deg=45.0)
CORNERS = np.array([(-REACH, 0.0, REACH), (REACH, 0.0, REACH), (REACH, 0.0, -REACH), (-REACH, 0.0, -REACH)])
UV = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
TRIANGLES = np.array([(0, 1, 2), (0, 2, 3)], np.int32)


@pytest.fixture
def pyrender(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The peer, on a device without a window."""
    reason = "pyrender, the optional peer, is not installed: pip install -e '.[peers]'"
    monkeypatch.setenv("PYOPENGL_PLATFORM", os.environ.get("PYOPENGL_PLATFORM", "egl"))
    # its last release knows numpy's name for infinity of before 2.0
    monkeypatch.setattr(np, "infty", np.inf, raising=False)
    return pytest.importorskip("pyrender", reason=reason)


def peer_scene(pyrender: ModuleType) -> Any:
    """Return the floor as pyrender has it: an image of 8 x 8 texels for each square, in flat light."""
    from PIL import Image

    side = 8 * SQUARES
    row = (np.arange(side) // 8) % 2
    squares = np.where(row[:, None] ^ row[None, :], 255, 0).astype(np.uint8)
    texture = pyrender.Texture(
        sampler=pyrender.Sampler(magFilter=9729, minFilter=9987),
        source=Image.fromarray(squares).convert("RGB"),
        source_channels="RGB",
    )
    primitive = pyrender.Primitive(
        positions=CORNERS.astype(np.float32),
        normals=np.array([[0.0, 1.0, 0.0]] * 4, np.float32),
        texcoord_0=UV.astype(np.float32),
        indices=TRIANGLES.astype(np.uint32),
        material=pyrender.MetallicRoughnessMaterial(baseColorTexture=texture, doubleSided=True),
        mode=4,
    )
    scene = pyrender.Scene(bg_color=(0.0, 0.0, 0.0, 1.0), ambient_light=(1.0, 1.0, 1.0))
    scene.add(pyrender.Mesh([primitive]))
    position, target = np.array(CAMERA.position), np.array(CAMERA.target)
    back = (position - target) / np.linalg.norm(position - target)
    right = np.cross((0.0, 1.0, 0.0), back)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(back, right), back], axis=1)
    pose[:3, 3] = position
    scene.add(pyrender.PerspectiveCamera(yfov=np.radians(CAMERA.fov_y_deg or 0.0)), pose=pose)
    return scene


def test_time_against_pyrender(benchmark: Any, pyrender: ModuleType) -> None:
    side, rounds = (512, 25) if benchmark.enabled else (64, 1)
    surface = Surface(read_only(CORNERS), read_only(TRIANGLES), uv=read_only(UV), texture="floor")
    scene = Scene("floor", CAMERA, (surface,), {"floor": Checker((SQUARES, SQUARES))})
    peer = pyrender.OffscreenRenderer(side, side)
    theirs = peer_scene(pyrender)
    best = {"ours": np.inf, "pyrender": np.inf}
    try:
        with prepare(scene, "raster:msaa=4,texture=trilinear", size=(side, side)) as prepared:

            def alternate() -> None:
                start = time.perf_counter()
                prepared.render()
                middle = time.perf_counter()
                peer.render(theirs, flags=pyrender.RenderFlags.FLAT)
                end = time.perf_counter()
                best["ours"], best["pyrender"] = min(best["ours"], middle - start), min(best["pyrender"], end - middle)

            benchmark.pedantic(alternate, rounds=rounds, warmup_rounds=1)
            ours = prepared.render().pixels
            shown = peer.render(theirs, flags=pyrender.RenderFlags.FLAT)[0] / 255.0
    finally:
        peer.delete()
    # the same floor: horizon and means of the far half, whatever is done to colours
    covered = ours.mean(axis=(1, 2)) > 0.0
    assert 0.3 < covered.mean() < 0.9
    assert (covered != (shown.mean(axis=(1, 2)) > 0.0)).sum() <= 1
    assert abs(ours[covered].mean() - shown[covered].mean()) < 0.1
    if benchmark.enabled:
        benchmark.extra_info["ratio"] = best["pyrender"] / best["ours"]
        print(
            f"\ntextured floor, {side} x {side}: ours {1e3 * best['ours']:.1f} ms, pyrender "
            f"{1e3 * best['pyrender']:.1f} ms: {best['pyrender'] / best['ours']:.2f} times ours"
        )
