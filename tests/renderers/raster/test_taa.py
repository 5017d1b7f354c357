"""TAA: a still picture becomes the mean of its frames; what moves is followed, and what it uncovers is not haunted."""

import time
from dataclasses import replace

import numpy as np
import pytest

from aliasbench.renderers.catalog import prepare, render, resolve_technique
from aliasbench.renderers.raster.taa import halton_place
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import Animation, Camera, Checker, Motion
from aliasbench.scenes.projection import view_at

pytestmark = pytest.mark.usefixtures("gl_checked")
MOVING = Animation(fps=30.0, frames=60)


def _moved(scene, size, place):
    """The scene seen by an orthographic camera that is `place` pixels to the right and down."""
    camera = scene.camera
    step = camera.height / size[1] * np.array([place[0], -place[1], 0.0])
    at, target = (tuple(float(v) for v in np.add(p, step)) for p in (camera.position, camera.target))
    return replace(scene, camera=replace(camera, position=at, target=target))


def _rms(a):
    return float(np.sqrt(np.mean(np.square(a, dtype=np.float64))))


def _square(make, corner, side, **options):
    x, y = corner
    return make.polygon([[x, y, 0], [x + side, y, 0], [x + side, y + side, 0], [x, y + side, 0]], **options)


def _textured(make, **options):
    uv = [[0, 0], [1, 0], [1, 1], [0, 1]]
    board = make.polygon([[-3, -3, 0], [3, -3, 0], [3, 3, 0], [-3, 3, 0]], uv=uv, texture="board", **options)
    return make.scene(board, textures={"board": Checker((53.0, 47.0))}, animation=MOVING)


@pytest.mark.parametrize("frame", [7, 32, 50])
def test_a_still_picture_is_the_mean_of_its_frames(make, frame):
    size = (64, 48)
    fan = load_scene("edge-fan")
    bright = make.scene(_square(make, (-0.5, -0.4), 0.77, color=(30.0, 2.0, 0.5)), background=(4.0, 0.0, 0.1))
    for scene, contrast in ((fan, 1.0), (_textured(make), 1.0), (bright, 26.0)):
        frames = range(max(0, frame - 32), frame + 1)
        shown = [render(_moved(scene, size, halton_place(n)), "raster:", size=size).pixels for n in frames]
        mean = np.mean(shown, axis=0, dtype=np.float64)
        out = render(scene, "raster:post=taa", size=size, frame=frame).pixels
        assert _rms(shown[0] - mean) > 0.02 * contrast
        # a moved camera's edges and a jitter's are rounded to sub-pixels alike, but for ties
        assert _rms(out - mean) < 1e-3 * contrast


def test_places_are_spread_evenly_over_any_32_frames():
    for first in (0, 5, 1000, 2**53 - 40):
        places = np.array([halton_place(n) for n in range(first, first + 32)])
        assert (np.abs(places) <= 0.5).all()
        assert sorted(np.floor(32 * (places[:, 0] + 0.5))) == list(range(32))
        assert (np.bincount(np.floor(9 * (places[:, 1] + 0.5)).astype(int), minlength=9) >= 3).all()


def test_the_first_frame_is_what_is_drawn(make):
    size, scene = (48, 40), make.star()
    moved = render(_moved(scene, size, halton_place(0)), "raster:", size=size).pixels
    assert _rms(render(scene, "raster:post=taa", size=size).pixels - moved) < 0.01


@pytest.mark.parametrize("technique", ["raster:post=taa", "raster:msaa=4,passes=2,post=taa", "raster:ssaa=2,post=taa"])
def test_a_frame_does_not_depend_on_what_was_rendered_before(technique):
    scene, size = load_scene("edge-fan:rev_per_s=0.3"), (40, 32)
    fresh = {f: render(scene, technique, size=size, frame=f, seed=2).pixels for f in (3, 20, 33, 36)}
    with prepare(scene, technique, size=size) as prepared:
        for frame, seed in ((33, 2), (3, 2), (20, 2), (20, 2), (3, 7), (20, 2), (36, 2), (33, 2)):
            pixels = prepared.render(frame=frame, seed=seed).pixels
            if seed == 2:
                np.testing.assert_array_equal(pixels, fresh[frame])
    assert all((fresh[3] != fresh[f]).any() for f in (20, 33, 36))


def test_the_price_is_that_of_the_last_frame():
    scene = load_scene("edge-fan:rev_per_s=0.3")
    with prepare(scene, "raster:post=taa", size=(128, 128)) as prepared:
        prepared.render(frame=40)
        shares = []
        told = []
        for frame in (41, 42, 43):
            start = time.perf_counter()
            seconds = prepared.render(frame=frame, progress=told.append).seconds
            shares.append(seconds / (time.perf_counter() - start))
    # one of 33 alike
    assert 1 / 200 < min(shares) < 1 / 8
    assert told == sorted(told[:33]) * 3
    assert told[32] == 1.0


def test_moving_edges_are_better_than_without():
    size = (64, 64)
    for text, factor in (
        ("near-horizontal-edge:speed=0.5", 0.75),
        ("near-horizontal-edge:speed=-0.1", 0.75),
        ("propeller-1", 0.85),
        ("edge-fan:rev_per_s=0.1", 0.9),
        ("camera-turn:turn=10", 0.9),
        ("camera-turn:turn=0,travel=1", 0.9),
    ):
        scene = load_scene(text)
        frames = (10,) if scene.camera.projection == "perspective" else range(20, 32, 2)
        plain, out = [], []
        with (
            prepare(scene, "reference:", size=size) as exact,
            prepare(scene, "raster:", size=size) as once,
            prepare(scene, "raster:post=taa", size=size) as taa,
        ):
            for frame in frames:
                truth = exact.render(frame=frame).pixels
                plain.append(_rms(once.render(frame=frame).pixels - truth))
                out.append(_rms(taa.render(frame=frame).pixels - truth))
        print(f"\n{text}: {_rms(out) / _rms(plain):.3f} of the error without")
        assert _rms(out) < factor * _rms(plain)


@pytest.mark.parametrize("velocity", [(0.9, 0.0, 0.0), (-0.3, 0.7, 0.0), (3.0, 2.0, 0.0)])
@pytest.mark.parametrize("board", [False, True])
def test_nothing_is_left_where_something_was(make, velocity, board):
    size = (64, 64)
    scene = _textured(make) if board else make.scene(animation=MOVING, background=(0.1, 0.2, 0.3))
    start = -0.3 - np.array(velocity[:2]) * 20 / 30
    square = _square(make, start, 0.5, color=(1.0, 0.0, 0.0), motion=Motion(velocity=velocity))
    out = render(replace(scene, objects=(*scene.objects, square)), "raster:post=taa", size=size, frame=20).pixels
    # in front of the board, and two pixels or more from where the square is now
    x, y = np.meshgrid((np.arange(64) + 0.5) / 32 - 1, 1 - (np.arange(64) + 0.5) / 32)
    away = np.maximum(np.abs(x + 0.05), np.abs(y + 0.05)) > 0.25 + 3 / 32
    assert away.sum() > 1000
    if board:
        # the board is black and white: what of red is not also green is the square's
        assert np.abs(out[away, 0] - out[away, 1]).max() < 1e-5
    else:
        np.testing.assert_allclose(out[away], np.broadcast_to((0.1, 0.2, 0.3), out[away].shape), atol=1e-6)
    inner = np.maximum(np.abs(x + 0.05), np.abs(y + 0.05)) < 0.25 - 2 / 32
    np.testing.assert_allclose(out[inner], np.broadcast_to((1.0, 0.0, 0.0), out[inner].shape), atol=1e-6)


def test_what_stands_still_converges_beside_what_moves(make):
    size = (64, 48)
    board = _textured(make)
    square = _square(make, (-0.9, -0.9), 0.3, color=(1.0, 0.0, 0.0), motion=Motion(velocity=(0.3, 0.0, 0.0)))
    alone, both = (
        render(s, "raster:post=taa", size=size, frame=32).pixels
        for s in (board, replace(board, objects=(*board.objects, square)))
    )
    np.testing.assert_allclose(both[:30], alone[:30], atol=1e-6)


def test_flat_bright_surfaces_keep_their_value(make):
    wall = _square(make, (-9, -9), 18, color=(70.0, 0.25, 3000.0), motion=Motion(velocity=(0.31, 0.17, 0.0)))
    for camera in (make.orthographic, make.perspective):
        scene = make.scene(wall, camera=replace(camera, velocity=(0.1, 0.2, 0.0)), animation=MOVING)
        out = render(scene, "raster:post=taa", size=(24, 20), frame=33).pixels
        np.testing.assert_allclose(out, np.broadcast_to((70.0, 0.25, 3000.0), out.shape), rtol=1e-6)


@pytest.mark.parametrize("half", [20.0, 1e7], ids=["near", "in pieces"])
def test_motion_is_where_it_was_a_frame_before(make, half):
    # A floor and a wall before a camera that travels and turns, against rays traced in float64. The larger floor passes
    # under the camera and far away, and is cut by the guard.
    floor = make.polygon([[-half, -1, -half], [half, -1, -half], [half, -1, half], [-half, -1, half]])
    wall = make.polygon([[-1, -1, -3], [0.5, -1, -3], [0.5, 1, -3], [-1, 1, -3]], motion=Motion(velocity=(1.0, 0.5, 0)))
    camera = Camera("perspective", position=(0, 0.2, 2.0), target=(0, 0, -4.0), fov_y_deg=50.0)
    camera = replace(camera, velocity=(1.5, 0.3, -2.0), target_velocity=(0.0, 0.0, 1.0))
    size, frame = (48, 40), 3
    scene = make.scene(floor, wall, camera=camera, animation=MOVING)
    with prepare(scene, "raster:post=taa", size=size) as prepared:
        prepared.render(frame=frame)
        inner = prepared._inner
        motion = inner._post._taa._motion
        far = motion._guard.far_objects(motion._matrices(frame, halton_place(frame)))
        assert far.tolist() == [half > 1e6, False]
        with inner._context.use():
            seen = motion.now.motions.framebuffer.read(components=4, dtype="f4")
            surfaces = motion.now.surfaces.framebuffer.read(components=2, dtype="f4")
    seen = np.frombuffer(seen, np.float32).reshape(40, 48, 4)
    surfaces = np.frombuffer(surfaces, np.float32).reshape(40, 48, 2)[..., 0]
    now, before = (view_at(camera, scene.animation, f, 0.0, size) for f in (frame, frame - 1))
    place = np.stack(np.meshgrid(np.arange(48) + 0.5, np.arange(40) + 0.5), -1) + halton_place(frame)
    x, y = (place[..., 0] - 24) / now.scale, (place[..., 1] - 20) / now.scale
    rays = now.forward + x[..., None] * now.right - y[..., None] * now.up
    for number, (axis, level, velocity) in enumerate(((1, -1.0, (0, 0, 0)), (2, -3.0, (1.0, 0.5, 0))), start=1):
        mine = np.abs(surfaces) == number
        assert mine.sum() > 100
        assert (surfaces[mine] == -number).all()
        points = now.origin + rays * ((level - now.origin[axis]) / rays[..., axis])[..., None]
        then = before.project(points[mine] - np.array(velocity) / 30.0)[:, :2]
        np.testing.assert_allclose(
            seen[mine, :2], then - place[mine], atol=2e-3 * (1 + np.abs(then - place[mine]).max())
        )


def test_the_name_of_the_technique(make):
    assert resolve_technique("raster-taa").post == "taa"
    assert render(make.star(), "raster-taa", size=(24, 16), frame=2).samples == 24 * 16
