"""Shadows from depth maps, which scenes of many triangles have: how far they are from exact ones, and their pieces."""

import math
from dataclasses import replace

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.renderers.raster import lighting
from aliasbench.renderers.raster.occluders import box_corners, cones, may_come_between, neighbours_order, pyramids
from aliasbench.renderers.raster.shadow_maps import fit_faces
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import Animation, Camera, ImageTexture, Light, Material, Motion, Scene, Surface, read_only
from aliasbench.scenes.shapes import polygon

pytestmark = pytest.mark.usefixtures("gl_checked")


@pytest.fixture
def mapped(monkeypatch):
    """Draw shadow maps however few triangles there are."""
    monkeypatch.setattr(lighting, "MOST_EXACT", 0)


def ball(triangles, center=(0.0, 0.5, 0.0), radius=0.4):
    k = max(int(math.sqrt(triangles / 4)), 2)
    theta, phi = np.meshgrid(np.linspace(0, np.pi, k + 1), np.linspace(0, 2 * np.pi, 2 * k + 1), indexing="ij")
    unit = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], axis=-1)
    at = np.arange(unit[..., 0].size).reshape(unit.shape[:2])
    a, b, c, d = (x.ravel() for x in (at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)
    vertices = unit.reshape(-1, 3) * radius + center
    sides = [vertices[faces[:, k]] - vertices[faces[:, 0]] for k in (1, 2)]
    faces = faces[np.linalg.norm(np.cross(*sides), axis=1) > 1e-9]
    return Surface(read_only(vertices), read_only(faces), False, color=(0.8, 0.4, 0.2), material=Material("diffuse"))


def compare(scene, options="sampler=sobol", size=(80, 60), *, count=8, most=0.02, frame=1):
    """Assert that few pixels differ from the ray tracer's samples, and those by few samples."""
    traced = render(scene, f"raytrace:pattern=shared,spp={count},{options}", size=size, frame=frame, seed=2).pixels
    drawn = render(scene, f"raster:passes={count},{options}", size=size, frame=frame, seed=2).pixels
    off = np.abs(traced.astype(float) - drawn).max(axis=2)
    differs = off > 1e-3 * np.maximum(traced.max(axis=2), 1e-2)
    assert len(np.unique(traced)) > 100
    assert differs.mean() < most, f"{differs.sum()} of {differs.size} pixels differ"
    return traced


def test_a_large_mesh_has_the_ray_tracers_shadow():
    scene = load_scene("soft-shadow")
    mesh = ball(3000)
    assert len(mesh.triangles) > 2 * lighting.MOST_EXACT
    traced = compare(replace(scene, objects=(scene.objects[0], mesh)))
    bare = render(replace(scene, objects=scene.objects[:1]), "raster:passes=2,sampler=sobol", size=(80, 60)).pixels
    assert traced.min() < 0.3 * bare.min()


@pytest.mark.parametrize("options", ["sampler=sobol", "sampler=jittered,shadow_rays=3", "sampler=jittered,time=center"])
@pytest.mark.parametrize("name", ["soft-shadow", "pixel-time-lens-light"])
@pytest.mark.usefixtures("mapped")
def test_catalog_scenes_are_the_ray_tracers_but_for_borders(name, options):
    compare(load_scene(name), options)


@pytest.mark.usefixtures("mapped")
def test_all_around_a_light_there_are_shadows():
    # a lamp between walls that reach above it: no one picture sees all that may hide it
    def wall(x, z):
        points = [(x - 0.3 * z, 0.1, z + 0.3 * x), (x + 0.3 * z, 0.1, z - 0.3 * x)]
        points += [(px, 2.0, pz) for px, _, pz in points[::-1]]
        return polygon(points, color=(0.5, 0.7, 0.9), material=Material("diffuse"))

    floor = polygon([(-6, 0, 6), (6, 0, 6), (6, 0, -6), (-6, 0, -6)], material=Material("diffuse"))
    walls = tuple(wall(x, z) for x, z in ((0.8, 0.0), (-0.8, 0.1), (0.0, 0.9), (0.2, -0.8)))
    lamp = Light(((-0.1, 1.2, -0.1), (0.1, 1.2, -0.1), (0.1, 1.2, 0.1), (-0.1, 1.2, 0.1)), (9.0, 9.0, 9.0))
    camera = Camera("perspective", position=(2.0, 5.0, 6.0), target=(0.0, 0.0, 0.0), fov_y_deg=40.0)
    compare(Scene("room", camera, (floor, *walls), lights=(lamp,)), count=4, frame=0)


@pytest.mark.parametrize("texture", ["point", "linear"])
@pytest.mark.usefixtures("mapped")
def test_cut_out_things_throw_shadows_with_holes(texture):
    texels = np.ones((4, 4, 4), np.float32)
    texels[..., 3] = np.random.default_rng(5).random((4, 4)) < 0.5
    sheet = polygon(
        [(-0.4, 1.0, 0.4), (0.4, 1.0, 0.4), (0.4, 1.0, -0.4), (-0.4, 1.0, -0.4)],
        uv=((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)),
        texture="holes",
        motion=Motion((1.0, 0.0, 0.5)),
    )
    scene = load_scene("soft-shadow")
    textures = {"holes": ImageTexture(read_only(texels), alpha_cutoff=0.5)}
    animation = Animation(fps=1.0, shutter=0.3)
    holed = replace(scene, objects=(scene.objects[0], sheet), textures=textures, animation=animation)
    # borders of holes are a texel off, and there are many
    compare(holed, f"sampler=sobol,texture={texture}", most=0.03, frame=0)


@pytest.mark.usefixtures("mapped")
def test_a_lit_plane_does_not_shade_itself():
    # lit at a grazing angle by a light just over it, with one far thing that a map must be drawn for
    floor = polygon([(-3, 0, 3), (3, 0, 3), (3, 0, -3), (-3, 0, -3)], material=Material("diffuse"))
    tilted = polygon([(-3, -1, 3), (3, 1, 3), (3, 1, -3), (-3, -1, -3)], material=Material("diffuse"))
    lamp = Light(((-3, 1.4, -0.5), (-2.5, 1.4, -0.5), (-2.5, 1.4, 0.5), (-3, 1.4, 0.5)), (5.0, 5.0, 5.0))
    camera = Camera("orthographic", position=(0.0, 4.0, 2.0), target=(0.0, 0.0, 0.0), height=3.0)
    roof = replace(tilted, vertices=read_only(tilted.vertices + np.array([0, 1.2, 0])))
    for objects in ((floor,), (tilted,), (floor, roof)):
        scene = Scene("plane", camera, objects, lights=(lamp,))
        traced = render(scene, "raytrace:pattern=shared,spp=4,sampler=sobol", size=(60, 60)).pixels
        drawn = render(scene, "raster:passes=4,sampler=sobol", size=(60, 60)).pixels
        assert traced.max() > 0.01
        differs = np.abs(traced - drawn).max(axis=2) > 1e-3 * np.maximum(traced.max(axis=2), 1e-3)
        assert differs.mean() < 0.02


# Their pieces, and those of exact shadows


def test_pyramids_hide_what_a_segment_to_the_light_crosses():
    rng = np.random.default_rng(7)
    corners, points = rng.normal(size=(40, 3, 3)), rng.normal(size=(3, 3)) + np.array([0.0, 4.0, 0.0])
    normals = np.broadcast_to([0.0, -1.0, 0.0], (3, 3))
    targets = rng.normal(size=(300, 3)) * (2.0, 0.5, 2.0) - (0.0, 2.0, 0.0)
    shares, may_hide = pyramids(corners, box_corners(targets), points, normals)
    hidden = 0
    for point, mine, counts in zip(points, shares, may_hide, strict=True):
        for triangle, share, chosen in zip(corners, mine, counts, strict=True):
            a, b, c = triangle
            # target + t (point - target) = a + u (b - a) + v (c - a)
            for target in targets[:60]:
                t, u, v = np.linalg.solve(np.stack([point - target, a - b, a - c], axis=1), a - target)
                crosses = 0 < t < 1 and u >= 0 and v >= 0 and u + v <= 1
                x = share @ (target - point)
                assert crosses == (chosen and x.min() >= 0 and x.sum() > 1)
                hidden += crosses
    assert hidden > 50


def test_what_cannot_come_between_is_left_out():
    lit = box_corners(np.array([(-5.0, 0.0, -5.0), (5.0, 0.5, 5.0)]))
    base = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
    corners = np.stack([base + np.array([0.0, y, 0.0]) for y in (0.0, 0.3, 3.0, -1.0)])
    light = np.array([[0.0, 2.0, 0.0]])
    # the floor itself, a thing over it, one behind the light, one below the floor
    np.testing.assert_array_equal(
        may_come_between(corners, lit, light, np.array([[0.0, -1.0, 0.0]])), [[False, True, False, False]]
    )


def test_cones_hold_their_triangles_and_orders_are_permutations():
    edges = np.random.default_rng(3).normal(size=(20, 4, 3, 3)) * 0.3 + (1.0, 2.0, 0.5)
    for cone, group in zip(cones(edges), edges, strict=True):
        shares = np.random.default_rng(4).dirichlet((1, 1, 1), 50)
        inside = np.einsum("sk,nki->sni", shares, group).reshape(-1, 3)
        assert (inside @ cone[:3] >= cone[3] * np.linalg.norm(inside, axis=1)).all()
    order = neighbours_order(edges.reshape(-1, 3, 3))
    np.testing.assert_array_equal(np.sort(order), np.arange(80))


@pytest.mark.parametrize("spread", [0.2, 3.0])
def test_maps_show_all_that_is_before_the_light(spread):
    rng = np.random.default_rng(9)
    normal = np.array([0.6, -0.8, 0.0])
    ways = rng.normal(size=(60, 3, 3)) * spread + 2 * normal
    faces = fit_faces(ways, normal)
    assert len(faces) == (1 if spread < 1 else 5)
    points = ways.reshape(-1, 3)
    points = points[points @ normal > 0.0]
    shown = np.zeros(len(points), dtype=int)
    for face in faces:
        np.testing.assert_allclose(face.axes @ face.axes.T, np.eye(3), atol=1e-12)
        x, y, z = (points @ face.axes.T).T
        inside = (z > 0) & (x >= face.left * z) & (x <= face.right * z) & (y >= face.bottom * z) & (y <= face.top * z)
        shown += inside
    assert (shown == 1).all()
