"""What a camera looks at along its plane is not seen, and nothing else is lost with it."""

from dataclasses import replace

import numpy as np
import pytest

from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.raytrace.edge_on import seen_edge_on
from aliasbench.renderers.raytrace.tables import Mesh
from aliasbench.scenes.model import Animation, Camera, FloatArray, Scene, Surface
from aliasbench.scenes.projection import View, view_at
from aliasbench.scenes.shapes import polygon

SIZE = (32, 24)
ENGINES = ("raytrace:", "raytrace:robust=off", "raytrace:engine=portable")


def _camera(projection: str, rng: np.random.Generator) -> Camera:
    position = rng.uniform(-2.0, 2.0, 3) + np.array([0.0, 0.0, 7.0])
    up = rng.uniform(-0.2, 0.2, 3) + np.array([0.0, 1.0, 0.0])
    options = {"height": 2.0} if projection == "orthographic" else {"fov_y_deg": 41.0}
    return Camera(projection, tuple(position), tuple(rng.uniform(-0.5, 0.5, 3)), tuple(up), **options)


def _place(view: View, points: list[tuple[float, float]], depths: list[float]) -> FloatArray:
    origins, directions = view.ray(*np.array(points).T)
    return origins + np.array(depths)[:, None] * directions


def _mesh(vertices: FloatArray, triangles: list[tuple[int, int, int]]) -> Mesh:
    count = len(triangles)
    return Mesh(
        vertices, np.array(triangles, np.int32), np.zeros((len(vertices), 2)), np.zeros(count, np.int32),
        np.zeros(count, np.bool_),
    )  # fmt: skip


@pytest.mark.parametrize("technique", ENGINES)
@pytest.mark.parametrize("projection", ["orthographic", "perspective"])
def test_a_plane_along_the_rays_is_not_seen_beside_where_it_is(projection: str, technique: str) -> None:
    rng = np.random.default_rng(3)
    for _ in range(12):
        camera = _camera(projection, rng)
        view = view_at(camera, Animation(), 0, 0.0, SIZE)
        # on a line through centres, so that rays lie in the plane, and within a slanted bounding box
        line = [(8.5, 3.5), (20.5, 15.5)]
        corners = _place(view, [*line, *line[::-1]], [5.0, 5.1, 7.3, 7.2])
        scene = Scene("edge-on", camera, (polygon(corners),))
        seen = render(scene, technique, size=SIZE).pixels[..., 0]
        rows, columns = np.nonzero(seen)
        assert np.array_equal(rows, columns - 5)  # on the line itself any answer is right
        assert ((columns >= 8) & (columns <= 20)).all()


def test_planes_along_the_rays_are_found() -> None:
    camera = _camera("perspective", np.random.default_rng(1))
    view = view_at(camera, Animation(), 0, 0.0, SIZE)
    anchor = np.array([0.5, -1.0, 2.0])
    points = _place(view, [(8.5, 3.5), (20.5, 15.5), (8.5, 3.5), (9.0, 20.0)], [5.0, 5.1, 7.3, 6.0]) - anchor
    mesh = _mesh(points, [(0, 1, 2), (0, 1, 3), (1, 2, 3)])
    assert seen_edge_on(mesh, view, anchor).tolist() == [0]


@pytest.mark.parametrize("projection", ["orthographic", "perspective"])
def test_a_needle_that_faces_the_camera_stays(projection: str) -> None:
    camera = _camera(projection, np.random.default_rng(2))
    view = view_at(camera, Animation(), 0, 0.0, SIZE)
    # as thin as float64 has it, as a piece of a larger surface may be: left out it would leave a gap
    mesh = _mesh(_place(view, [(5.0, 5.0), (25.0, 5.0), (15.0, 5.0 + 1e-9)], [5.0, 5.0, 5.0]), [(0, 1, 2)])
    assert not len(seen_edge_on(mesh, view, np.zeros(3)))


def test_a_floor_below_a_low_camera_stays() -> None:
    # 1e-4 above a floor that reaches 1e4 times as far: its picture is the lower half, however small the angle is
    camera = Camera("perspective", (0.0, 1e-4, 0.0), (0.0, 1e-4, -1.0), fov_y_deg=40.0)
    floor = polygon([(-5.0, 0.0, 1.0), (5.0, 0.0, 1.0), (5.0, 0.0, -1.0), (-5.0, 0.0, -1.0)])
    seen = render(Scene("floor", camera, (floor,)), "raytrace:", size=SIZE).pixels[..., 0]
    assert (seen[SIZE[1] // 2 + 1 :] == 1.0).all()
    assert (seen[: SIZE[1] // 2] == 0.0).all()


@pytest.mark.parametrize("size", [1e-50, 1.0, 1e50])
def test_any_size_of_world_is_judged_alike(size: float) -> None:
    camera = Camera("perspective", (0.0, 0.0, 5.0 * size), fov_y_deg=41.0)
    view = view_at(camera, Animation(), 0, 0.0, SIZE)
    points = _place(
        view, [(8.5, 3.5), (20.5, 15.5), (8.5, 3.5), (9.0, 20.0)], [5.0 * size, 5.1 * size, 7.3 * size, size]
    )
    assert seen_edge_on(_mesh(points, [(0, 1, 2), (0, 1, 3)]), view, np.zeros(3)).tolist() == [0]


@pytest.mark.parametrize("shutter", [0.0, 1.0])
@pytest.mark.parametrize("technique", ENGINES)
def test_a_camera_that_moves_in_the_plane_sees_it_where_it_is(technique: str, shutter: float) -> None:
    # a mesh, so that its plane is not that of a polygon which a pinhole in it does not see at all
    rng = np.random.default_rng(5)
    for _ in range(4):
        camera = _camera("perspective", rng)
        view = view_at(camera, Animation(), 0, 0.0, SIZE)
        line = [(8.5, 3.5), (20.5, 15.5)]
        corners = _place(view, [*line, *line[::-1]], [5.0, 5.1, 7.3, 7.2])
        # along the ray through (0.5, 3.5 - 8), which is in the plane, and so is whatever is seen of it
        step = _place(view, [(14.5, 9.5)], [0.3])[0] - view.origin
        triangles = np.array([(0, 1, 2), (0, 2, 3)], np.int32)
        sheet = Surface(corners, triangles, is_polygon=False)
        moving = replace(camera, velocity=tuple(step))
        scene = Scene("edge-on", moving, (sheet,), animation=Animation(1.0, 4, shutter))
        with prepare(scene, technique + ("spp=4" if technique.endswith(":") else ",spp=4"), size=SIZE) as prepared:
            for frame in (0, 1, 0):
                rows, columns = np.nonzero(prepared.render(frame=frame).pixels[..., 0])
                # nearer it is larger; samples are anywhere in a pixel, and the line passes corners of pixels
                assert (np.abs(rows - columns + 5) <= 1).all()
