"""Polygons on top of each other in a ground that goes to the horizon: the later one wins wherever it is seen."""

import numpy as np
import pytest

from aliasbench.bench.hard.coplanar import ground_settings
from aliasbench.bench.hard.ownership import pixel_points
from aliasbench.bench.hard.painting import paint
from aliasbench.renderers.catalog import render
from aliasbench.renderers.raytrace.layers import bring_nearer, nearest_of_deep, plane_distances
from aliasbench.renderers.raytrace.tables import Mesh
from aliasbench.scenes.model import Animation, Camera, Checker, Light, Material, Motion, Scene
from aliasbench.scenes.projection import view_at
from aliasbench.scenes.shapes import polygon

SIZE = (240, 160)
TRACERS = ("raytrace:", "raytrace:robust=off", "raytrace:engine=portable")


@pytest.mark.parametrize("technique", [*TRACERS, "raster:"])
@pytest.mark.parametrize("reach", [100.0, 1e3, 3e4, 1e7])
def test_the_later_of_coplanar_polygons_wins_up_to_the_horizon(reach: float, technique: str) -> None:
    for setting in ground_settings(reach):
        pixels = render(setting.scene, technique, size=SIZE).pixels
        painting = paint(setting.scene, SIZE)
        wrong = np.abs(pixels.reshape(-1, 3) - painting.color_at(pixel_points(SIZE))).max(axis=1) > 1e-5
        # within 2^-8 px of an edge a sample may be either's: of some 1500 px of edges in this picture that is 12
        limit = 12 if technique == "raster:" else 3
        assert wrong.sum() <= limit
        if technique != "raster:" and wrong.any() and "perspective" in setting.name:
            # at the horizon, where a part is thinner than rays are exact; by parallel rays it is at the camera's plane
            assert painting.apart(pixels).max() < 0.1
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) >= 4


def test_a_layer_keeps_its_place_in_the_picture_and_its_triangles_stay_together() -> None:
    rng = np.random.default_rng(2)
    camera = Camera("perspective", (0.3, 2.0, -1.0), (0.0, 1.5, -9.0), fov_y_deg=50.0)
    view = view_at(camera, Animation(), 0, 0.0, SIZE)
    anchor = np.array([3.0, -1.0, 2.0])
    corners = np.c_[rng.uniform(-5.0, 5.0, 4), np.zeros(4), rng.uniform(-90.0, -4.0, 4)] - anchor
    mesh = Mesh(
        corners, np.array([(0, 1, 2), (0, 2, 3), (1, 2, 3)], np.int32), np.zeros((4, 2)),
        np.array([0, 1, 1], np.int32), np.zeros(3, bool),
    )  # fmt: skip
    eye = view.origin - anchor
    distances = plane_distances(mesh, eye, 2)
    np.testing.assert_allclose(distances, 2.0, rtol=1e-12)
    layers = np.array([0.0, 1.5, 1.5])
    out = bring_nearer(mesh, layers * 2.0**-18, layers * 2.0**-19, distances, view, anchor)
    before, after = (m.vertices[m.triangles] + anchor for m in (mesh, out))
    np.testing.assert_array_equal(after[0], before[0])
    np.testing.assert_allclose(view.project(after)[..., :2], view.project(before)[..., :2], atol=1e-9)
    depth, nearer = view.to_camera(before)[1:, :, 2], view.to_camera(after)[1:, :, 2]
    # step + tilt z / d, d = 2
    np.testing.assert_allclose(depth / nearer, 1.0 + 1.5 * 2.0**-18 * (1.0 + depth / 4.0), rtol=1e-12)
    # corners 2 and 3 are both triangles': the very same points
    np.testing.assert_array_equal(after[1, 1:], after[2, 1:])


def test_what_is_deep_is_known_by_its_height() -> None:
    corners = np.array([(-1.0, -2.0, 0.0), (1.0, -2.0, 0.0), (0.0, -2.0, -100.0)])
    mesh = Mesh(corners, np.array([(0, 1, 2)], np.int32), np.zeros((3, 2)), np.zeros(1, np.int32), np.zeros(1, bool))
    eye, one = np.zeros(3), np.array([True])
    assert nearest_of_deep(mesh, one, np.array([2.0]), eye) == 2.0
    assert nearest_of_deep(mesh, ~one, np.array([2.0]), eye) == np.inf
    assert nearest_of_deep(mesh, one, np.array([20.0]), eye) == np.inf
    # in the plane it is not seen at all
    assert nearest_of_deep(mesh, one, np.array([0.0]), eye) == np.inf


@pytest.mark.parametrize("technique", TRACERS)
def test_textures_of_layers_stay_where_they_are(technique: str) -> None:
    camera = Camera("perspective", (0.0, 2.0, 0.0), (0.0, 1.2, -9.0), fov_y_deg=50.0)
    corners = [(-9.0, 0.0, 5.0), (9.0, 0.0, 5.0), (9.0, 0.0, -3e3), (-9.0, 0.0, -3e3)]
    uv = np.array([(x, z) for x, _, z in corners]) / 3.0 + 0.123
    textures = {"tiles": Checker((1.0, 1.0), (0.1, 0.2, 0.3), (0.9, 0.8, 0.7))}
    tiled = polygon(corners, uv=uv, texture="tiles")
    below = [polygon(np.array(corners) * (1.5, 1.0, 1.5)) for _ in range(5)]
    alone, above = (
        render(Scene("tiles", camera, objects, textures), technique, size=SIZE).pixels
        for objects in ((tiled,), (*below, tiled))
    )
    seen = np.isin(alone[..., 2], np.float32([0.3, 0.7]))
    assert 0.2 < seen.mean() < 0.8
    np.testing.assert_array_equal(above[seen], alone[seen])


@pytest.mark.parametrize("technique", TRACERS)
@pytest.mark.parametrize("moves", [(0,), (1,), (2,), (0, 2), (0, 1, 2)])
def test_what_slides_in_a_plane_keeps_its_place_among_what_stands_there(moves: tuple[int, ...], technique: str) -> None:
    camera = Camera("perspective", (0.0, 2.0, 0.0), (0.0, 1.2, -9.0), fov_y_deg=50.0)
    corners = np.array([(-90.0, 0.0, 5.0), (90.0, 0.0, 5.0), (90.0, 0.0, -150.0), (-90.0, 0.0, -150.0)])
    motion = Motion((0.3, 0.0, -0.2))
    objects = tuple(
        polygon(corners * (1.0 - 0.1 * k), color=color, motion=motion if k in moves else None)
        for k, color in enumerate([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
    )
    # another plane has layers of its own, which stand
    wall = np.array([(-20.0, 0.5, -200.0), (20.0, 0.5, -200.0), (20.0, 9.0, -200.0), (-20.0, 9.0, -200.0)])
    walls = tuple(polygon(wall, color=color) for color in ((1.0, 0.0, 1.0), (1.0, 1.0, 1.0)))
    scene = Scene("sliding", camera, (*objects, *walls), animation=Animation(1.0, 2, 1.0))
    key = "spp=4" if technique.endswith(":") else ",spp=4"
    pixels = render(scene, technique + key, size=SIZE).pixels
    covered = (pixels == (0.0, 0.0, 1.0)).all(axis=2)
    assert covered[SIZE[1] // 2 + 10 :].all()  # below the far edges of the first two
    assert not (pixels == (1.0, 0.0, 1.0)).all(axis=2).any()
    assert (pixels == (1.0, 1.0, 1.0)).all(axis=2).sum() > 20


@pytest.mark.parametrize("technique", TRACERS)
@pytest.mark.parametrize("way", ["flying", "lens", "lit"])
def test_a_lane_on_a_slope_is_seen_by_any_camera(way: str, technique: str) -> None:
    """A plane along no axis, 700 heights large: what its corners are rounded by is many layers at the camera's foot."""
    normal = np.array([0.31, 0.87, 0.22])
    normal /= np.linalg.norm(normal)
    ahead = np.cross(normal, (1.0, 0.2, 0.1))
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, normal)
    eye = 1.5 * normal

    def place(points: list[tuple[float, float]]) -> list[tuple[float, float, float]]:
        return [tuple(x * right + y * ahead) for x, y in points]

    kind = Material("diffuse") if way == "lit" else Material()
    ground = polygon(
        place([(-997.0, -1003.0), (1011.0, -989.0), (999.0, 1007.0), (-1013.0, 1001.0)]),
        color=(1.0, 0.0, 0.0),
        material=kind,
    )
    lane = polygon(
        place([(-3.1, -20.0), (2.9, -20.0), (2.7, 903.0), (-3.3, 897.0)]), color=(0.0, 1.0, 0.0), material=kind
    )
    camera = Camera(
        "perspective", tuple(eye), tuple(eye + ahead - 0.1 * normal), tuple(normal), fov_y_deg=40.0,
        velocity=tuple(3.0 * ahead) if way == "flying" else (0.0, 0.0, 0.0),
        lens_radius=0.01 if way == "lens" else 0.0, focus_distance=8.0 if way == "lens" else None,
    )  # fmt: skip
    high = [tuple(np.add(eye, 40.0 * normal + x * right + y * ahead)) for x, y in ((-9, -9), (-9, 9), (9, 9), (9, -9))]
    lights = (Light(tuple(high), (9.0, 9.0, 9.0)),) if way == "lit" else ()
    scene = Scene("slope", camera, (ground, lane), lights=lights, animation=Animation(2.0, 2, 1.0))
    key = "spp=4" if technique.endswith(":") else ",spp=4"
    pixels = render(scene, technique + key, size=(60, 40)).pixels
    below = pixels[24:, 15:45]  # of the lane alone: nothing of the ground comes through
    assert (below[..., 0] == 0.0).all()
    assert (below[..., 1] > 0.0).all()
    assert (pixels[24:, :3, 0] > 0.0).any()
