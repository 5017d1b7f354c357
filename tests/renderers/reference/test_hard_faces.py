"""Faces that leave a reference no digits to spare: edges through the corners of its window, textures without a map."""

import dataclasses

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.renderers.reference import reference
from aliasbench.renderers.reference.constant_uv import paint_constant
from aliasbench.scenes.errors import UnsupportedScene
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import (
    Animation,
    Camera,
    Checker,
    Grating,
    ImageTexture,
    Motion,
    Scene,
    as_vec3,
    read_only,
)  # fmt: skip
from aliasbench.scenes.shapes import mesh, polygon

FLAT = Camera("orthographic", height=2.0)
SIZES = [(8, 8), (64, 64), (100, 100), (37, 37)]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("up", [1, -1])
@pytest.mark.parametrize("ulps", [0, 1, -3])
def test_a_half_plane_along_the_diagonal_fills_half(size, up, ulps):
    # its edge passes through two corners of the window that references cut everything to, or an ulp beside
    nudge = ulps * 2.0**-52
    half_plane = polygon([(-9, -9 * up + nudge, 0), (9, 9 * up, 0), (-9, 9 * up, 0)])
    pixels = render(Scene("diagonal", FLAT, (half_plane,)), "reference:", size=size).pixels[..., 0]
    row, column = np.indices(size[::-1])
    place = column + row - (size[0] - 1) if up > 0 else column - row
    expected = np.where(place == 0, 0.5, np.where(place < 0, 1.0, 0.0))
    np.testing.assert_allclose(pixels, expected, atol=1e-12)


@pytest.mark.parametrize("size", SIZES)
def test_a_triangle_with_a_side_through_a_corner_of_the_window_keeps_its_area(size):
    triangle = mesh([(2, -2, 0), (0.5, 2, 0), (-2, 2, 0)], [[0, 1, 2]])
    pixels = render(Scene("t", FLAT, (triangle,)), "reference:", size=size).pixels[..., 0]
    truth = render(
        Scene("t", FLAT, (mesh([(2, -2, 0), (0.5 + 1e-15, 2 + 1e-15, 0), (-2 - 1e-15, 2, 0)], [[0, 1, 2]]),)),
        "raytrace:spp=256,sampler=jittered", size=size,
    ).pixels[..., 0]  # fmt: skip
    assert pixels.mean() == pytest.approx(float(truth.mean()), abs=1e-3)
    assert np.abs(pixels - truth).max() < 0.05


def test_moving_edges_through_corners_of_the_window_agree_with_instants():
    scene = load_scene("near-horizontal-edge:slope=-1,speed=2,shutter=1")
    shown = render(scene, "reference:", size=(16, 16), frame=3).pixels
    # over the shutter the edge moves by 16/30 pixels: each pixel's mean over time is a cubic, exact in 4 Gauss nodes
    # on each side of where its corners are crossed; sampled here at 64 midpoints, an error below 1/64^2
    parts = []
    for k in range(64):
        still = dataclasses.replace(
            scene, animation=dataclasses.replace(scene.animation, shutter=0.0),
            objects=tuple(_moved(o, (3 + (k + 0.5) / 64) / scene.animation.fps) for o in scene.objects),
        )  # fmt: skip
        parts.append(render(still, "reference:", size=(16, 16)).pixels)
    np.testing.assert_allclose(shown, np.mean(parts, axis=0), atol=1 / 64**2 + 1e-5)


def _moved(surface, time):
    move = np.asarray(surface.motion.velocity) * time
    return dataclasses.replace(surface, vertices=read_only(surface.vertices + move), motion=Motion())


@pytest.mark.parametrize("truth", ["point", "linear"])
@pytest.mark.parametrize("projection", ["orthographic", "perspective"])
def test_triangles_of_one_texture_coordinate_are_flat_coloured(palette_scene, truth, projection):
    scene, colors = palette_scene(projection, truth == "linear")
    plain = dataclasses.replace(
        scene,
        objects=tuple(
            mesh(s.vertices[t], [[0, 1, 2]], color=tuple(c))
            for s in scene.objects for t, c in zip(s.triangles, colors, strict=True)
        ),
        textures={},
    )  # fmt: skip
    for technique in (f"reference:texture={truth}", f"reference:texture={truth},filter=gaussian"):
        shown, same = (render(s, technique, size=(24, 20)) for s in (scene, plain))
        assert shown.uncertainty_kind == "bound"
        np.testing.assert_allclose(shown.pixels, same.pixels, atol=1e-11)
        assert shown.pixels.std() > 0.05


@pytest.fixture
def palette_scene():
    def make(projection, blend):
        rng = np.random.default_rng(5)
        vertices = rng.uniform(-1, 1, (24, 3)) * [1, 1, 0.3]
        uv = np.repeat(rng.uniform(-2, 2, (8, 2)), 3, axis=0)
        texels = rng.uniform(0, 1, (3, 4, 4)).astype(np.float32)
        texels[..., 3] = 1.0
        bare = mesh(vertices, np.arange(24).reshape(8, 3))
        surface = dataclasses.replace(bare, uv=read_only(uv), texture="palette")
        camera = FLAT if projection == "orthographic" else Camera("perspective", fov_y_deg=30.0)
        scene = Scene("palette", camera, (surface,), {"palette": ImageTexture(read_only(texels))})
        u, v = (uv[::3] * [4, 3] - (0.5 if blend else 0.0)).T
        k, r = np.floor(u).astype(int), np.floor(v).astype(int)
        if not blend:
            return scene, texels[r % 3, k % 4, :3].astype(float)
        a, b = (u - k)[:, None], (v - r)[:, None]
        rows = [texels[row % 3, k % 4, :3] * (1 - a) + texels[row % 3, (k + 1) % 4, :3] * a for row in (r, r + 1)]
        return scene, rows[0] * (1 - b) + rows[1] * b

    return make


def test_only_constant_triangles_are_painted_and_cut_out_ones_are_gone():
    texels = np.ones((1, 2, 4), np.float32)
    texels[0, 0] = (0.5, 0.25, 0.125, 1.0)
    texels[0, 1, 3] = 0.0
    image = ImageTexture(read_only(texels), alpha_cutoff=0.5)
    uv = [(0.1, 0.5)] * 3 + [(0.9, 0.5)] * 3 + [(0, 0), (1, 0), (0, 1)]
    vertices = np.random.default_rng(1).uniform(-1, 1, (9, 3))
    bare = mesh(vertices, [[0, 1, 2], [3, 4, 5], [6, 7, 8]], color=(1.0, 1.0, 0.5))
    surface = dataclasses.replace(bare, uv=read_only(np.array(uv)), texture="t")
    scene = Scene("s", FLAT, (surface,), {"t": image})
    rest, painted = paint_constant(scene, linear=False).objects
    assert rest.texture == "t"
    np.testing.assert_array_equal(rest.vertices[rest.triangles[0]], surface.vertices[6:])
    assert (painted.texture, painted.uv, painted.color) == (None, None, (0.5, 0.25, 0.0625))
    np.testing.assert_array_equal(painted.vertices[painted.triangles[0]], surface.vertices[:3])
    checker = dataclasses.replace(scene, textures={"t": Checker((2.0, 1.0))})
    assert len(paint_constant(checker, linear=True).objects) == 3  # the rest, black, white
    plain = dataclasses.replace(scene, objects=(mesh(surface.vertices, surface.triangles),))
    assert paint_constant(plain, linear=False) is plain


@pytest.mark.parametrize("wrong", [np.nan, np.inf, 1.5, -0.5])
def test_a_picture_that_cannot_be_is_refused(monkeypatch, wrong):
    whole = reference.PreparedReference._at_once
    monkeypatch.setattr(
        reference.PreparedReference, "_at_once",
        lambda self, frame: dataclasses.replace(s := whole(self, frame), pixels=s.pixels + wrong),
    )  # fmt: skip
    with pytest.raises(UnsupportedScene, match="edge-fan: rounding errors make its picture impossible"):
        render(load_scene("edge-fan"), "reference:", size=(4, 4))


@pytest.fixture
def striped_quad():
    """Return a maker of a quad whose texture changes along one line of the picture only, but for noise."""

    def make(texture, uv, projection="orthographic", noise=0.0):
        corners = np.array([(-0.83, -0.71, 0.0), (0.77, -0.9, 0.0), (0.9, 0.68, 0.0), (-0.66, 0.93, 0.0)])
        if projection == "perspective":
            corners[:, 2] = -corners[:, 1]
        turned = noise * corners[:, :2] @ [[0.3, 0.7], [-0.9, 0.4]]
        given = polygon(corners, uv=uv(corners) + turned, texture="t")
        camera = FLAT if projection == "orthographic" else Camera("perspective", fov_y_deg=30.0)
        return Scene("stripes", camera, (given,), {"t": texture})

    return make


@pytest.mark.parametrize("truth", ["point", "linear"])
@pytest.mark.parametrize("kind", ["box", "tent"])
@pytest.mark.parametrize("projection", ["orthographic", "perspective"])
@pytest.mark.parametrize("constant", [0, 1])
@pytest.mark.parametrize("noise", [1e-16, 1e-13, 1e-10])
def test_a_texture_coordinate_constant_up_to_rounding_is_as_good_as_constant(
    striped_quad, truth, kind, projection, constant, noise
):
    texels = np.random.default_rng(3).uniform(0, 1, (3, 3, 4)).astype(np.float32)
    texels[..., 3] = 1.0

    def uv(corners):
        out = np.full((4, 2), 0.4)
        out[:, 1 - constant] = 0.7 * corners[:, 1] + 0.3 * corners[:, 0]
        return out

    image = ImageTexture(read_only(texels))
    exact, noisy = (
        render(striped_quad(image, uv, projection, n), f"reference:texture={truth},filter={kind}", size=(9, 8))
        for n in (0.0, noise)
    )
    assert max(exact.uncertainty, noisy.uncertainty) < 1e-7
    # texels' borders and values move by some times the noise
    np.testing.assert_allclose(noisy.pixels, exact.pixels, atol=20 * noise + exact.uncertainty + noisy.uncertainty)


def test_a_texture_coordinate_of_zero_leaves_nothing_to_doubt(striped_quad):
    image = ImageTexture(read_only(np.random.default_rng(3).uniform(0, 1, (3, 3, 4)).astype(np.float32)))
    scene = striped_quad(image, lambda corners: corners[:, :2] * [1.5, 0.0])
    assert render(scene, "reference:", size=(9, 8)).uncertainty < 1e-10


def test_a_grating_across_its_own_waves_is_flat():
    # s = u cos 30 + v sin 30 is the same at all corners, but for the last bits
    s = np.sqrt(3)
    grating = Grating(4.0, 30.0, 0.5, "square", (0.25, 0.5, 0.0), (0.5, 1.0, 0.25))
    corners = [(-0.83, -0.71, 0), (0.77, -0.9, 0), (0.1, 0.68, 0)]
    uv = [(0.5, 0.5 + 0.61 * s), (1.5, 0.5 - 0.39 * s), (0.75, 0.5 + 0.36 * s)]
    waves = Scene("w", FLAT, (polygon(corners, uv=uv, texture="t"),), {"t": grating})
    value = np.cos(2 * np.pi * (4.0 * (0.5 * s / 2 + (0.5 + 0.61 * s) / 2) + 0.5))
    flat = Scene("f", FLAT, (polygon(corners, color=(0.5, 1.0, 0.25) if value > 0 else (0.25, 0.5, 0.0)),))
    shown, plain = (render(scene, "reference:", size=(8, 8)) for scene in (waves, flat))
    assert shown.uncertainty < 1e-9
    np.testing.assert_allclose(shown.pixels, plain.pixels, atol=1e-12)


def test_a_textured_face_seen_edge_on_but_for_rounding_leaves_the_bound_small():
    texels = np.random.default_rng(3).uniform(0, 1, (2, 3, 4)).astype(np.float32)
    texels[..., 3] = 1.0
    camera = Camera("orthographic", position=(3.0, 0.0, 3.0), height=2.0)
    corners = [(-0.5, -0.7, -0.5), (0.3, -0.6, 0.3), (0.7, 0.9, 0.7 + 1e-15), (-0.4, 0.6, -0.4)]
    wall = polygon(corners, uv=[(0, 0), (3, 0), (3, 2), (0, 2)], texture="t")
    empty = Scene("e", camera, (), background=(0.2, 0.4, 0.6))
    shown = render(
        dataclasses.replace(empty, objects=(wall,), textures={"t": ImageTexture(read_only(texels))}),
        "reference:filter=tent,texture=linear", size=(8, 8),
    )  # fmt: skip
    assert shown.uncertainty_kind == "bound"
    assert shown.uncertainty < 1e-7
    np.testing.assert_allclose(shown.pixels, np.broadcast_to((0.2, 0.4, 0.6), (8, 8, 3)), atol=1e-10)


@pytest.mark.parametrize("text", ["reference:", "reference:filter=tent", "reference:filter=cone"])
@pytest.mark.parametrize(("unit", "away"), [(1.0, 0.0), (1e-5, 900.0), (1e-6, 1e6), (1e6, 1e6)])
@pytest.mark.parametrize("moving", [False, True])
def test_a_surface_a_hundredth_nearer_is_in_front_however_far_from_the_origin(text, unit, away, moving):
    """What counts as one depth is a billionth of the scene's own size, and not of its distance from the origin."""
    at = np.array([0.3, -0.2, 1.0]) * away
    corners = np.array([(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0)])
    camera = Camera("orthographic", as_vec3(np.add(at, (0.0, 0.0, 4.0 * unit))), as_vec3(at), height=2.0 * unit)
    motion = Motion(velocity=(0.1 * unit, 0.0, 0.0)) if moving else Motion()
    near = polygon(at + unit * (0.6 * corners + (0.0, 0.0, 0.01)), color=(1.0, 0.0, 0.0), motion=motion)
    far = polygon(at + unit * corners, color=(0.0, 1.0, 0.0))
    animation = Animation(24.0, 4, 0.5)
    for order in ((near, far), (far, near)):
        scene = Scene("layers", camera, order, animation=animation)
        pixels = render(scene, text, size=(8, 8)).pixels[3:5, 3:5]
        np.testing.assert_allclose(pixels, np.broadcast_to((1.0, 0.0, 0.0), (2, 2, 3)), rtol=0, atol=1e-9)
