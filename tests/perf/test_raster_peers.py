"""The rasterizer beside pyrender, the offscreen renderer that Python has, on a floor of one texture.

pyrender is an optional peer (the extra `peers`). It draws with four hardware samples and trilinear mipmaps into 8 bits
of sRGB, and reads colour and depth: `raster:msaa=4,texture=trilinear` is the nearest of ours, with 32-bit floats.
`make bench` prints the ratio; nothing is asserted of it. It runs in a process of its own, since it closes the display
that all contexts of a process share.
"""

import importlib.util
import multiprocessing
import os
import time
from multiprocessing.connection import Connection
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


def peer_scene(pyrender: Any) -> Any:
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


def serve(side: int, pipe: Connection) -> None:
    """Draw the floor whenever asked to, and send the seconds it took and the picture; until asked with False."""
    os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
    # its last release knows numpy's name for infinity of before 2.0
    np.inf = np.inf  # type: ignore[attr-defined]
    import pyrender

    renderer, scene = pyrender.OffscreenRenderer(side, side), peer_scene(pyrender)
    while pipe.recv():
        start = time.perf_counter()
        picture, _ = renderer.render(scene, flags=pyrender.RenderFlags.FLAT)
        pipe.send((time.perf_counter() - start, picture))


def test_time_against_pyrender(benchmark: Any) -> None:
    if importlib.util.find_spec("pyrender") is None:
        pytest.skip("pyrender, the optional peer, is not installed: pip install -e '.[peers]'")
    side, rounds = (512, 25) if benchmark.enabled else (64, 1)
    surface = Surface(read_only(CORNERS), read_only(TRIANGLES), uv=read_only(UV), texture="floor")
    scene = Scene("floor", CAMERA, (surface,), {"floor": Checker((SQUARES, SQUARES))})
    best = {"ours": np.inf, "pyrender": np.inf}
    ours, theirs = multiprocessing.get_context("spawn").Pipe()
    peer = multiprocessing.get_context("spawn").Process(target=serve, args=(side, theirs), daemon=True)
    peer.start()
    theirs.close()
    with prepare(scene, "raster:msaa=4,texture=trilinear", size=(side, side)) as prepared:

        def alternate() -> Any:
            start = time.perf_counter()
            prepared.render()
            best["ours"] = min(best["ours"], time.perf_counter() - start)
            ours.send(True)
            seconds, picture = ours.recv()
            best["pyrender"] = min(best["pyrender"], seconds)
            return picture

        shown = benchmark.pedantic(alternate, rounds=rounds, warmup_rounds=1) / 255.0
        drawn = prepared.render().pixels
    ours.send(False)
    peer.join(30)
    # the same floor: horizon and means of the far half, whatever is done to colours
    covered = drawn.mean(axis=(1, 2)) > 0.0
    assert 0.3 < covered.mean() < 0.9
    assert (covered != (shown.mean(axis=(1, 2)) > 0.0)).sum() <= 1
    assert abs(drawn[covered].mean() - shown[covered].mean()) < 0.1
    if benchmark.enabled:
        benchmark.extra_info["ratio"] = best["pyrender"] / best["ours"]
        print(
            f"\ntextured floor, {side} x {side}: ours {1e3 * best['ours']:.1f} ms, pyrender "
            f"{1e3 * best['pyrender']:.1f} ms: {best['pyrender'] / best['ours']:.2f} times ours"
        )
