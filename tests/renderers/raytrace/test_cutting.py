"""Surfaces far larger than the view keep their edges, texture and order; planes through the eye are not seen."""

import numpy as np
import pytest

from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.raytrace.cutting import cut_large
from aliasbench.renderers.raytrace.edge_on import through_eye, without
from aliasbench.renderers.raytrace.tables import Mesh
from aliasbench.scenes.model import Animation, Camera, Checker, FloatArray, Scene
from aliasbench.scenes.projection import view_at
from aliasbench.scenes.shapes import polygon

SIZE = (40, 30)
CAMERAS = {
    "orthographic": Camera("orthographic", (0.0, 0.0, 40.0), height=30.0),
    "perspective": Camera("perspective", (0.0, 0.0, 40.0), fov_y_deg=41.0),
}
FAR = (1e2, 1e4, 1e6, 1e8)


def half_plane(far: float, slope: float = 0.37) -> FloatArray:
    """y >= slope x + 0.3, up to `far` units away."""
    along = np.array([1.0, slope]) / np.hypot(1.0, slope)
    across = np.array([-along[1], along[0]])
    start = np.array([0.0, 0.3])
    points = [start - far * along, start + 0.7 * far * along, start + 0.8 * far * along + far * across,
              start - 0.9 * far * along + 0.6 * far * across]  # fmt: skip
    return np.c_[np.array(points), np.zeros(4)]


@pytest.mark.parametrize("engine", ["packet", "portable"])
@pytest.mark.parametrize("projection", CAMERAS)
@pytest.mark.parametrize("far", FAR)
def test_an_edge_is_where_it_is_however_far_it_goes(projection: str, far: float, engine: str) -> None:
    camera = CAMERAS[projection]
    scene = Scene("half", camera, (polygon(half_plane(far)),))
    pixels = render(scene, f"raytrace:engine={engine}", size=SIZE).pixels[..., 0]
    view = view_at(camera, scene.animation, 0, 0.0, SIZE)
    rows, columns = np.indices(pixels.shape)
    origins, ways = view.ray(columns + 0.5, rows + 0.5)
    hit = origins + ways * 40.0
    side = (hit[..., 1] - 0.37 * hit[..., 0] - 0.3) / np.hypot(1.0, 0.37)
    # 1/256 px, and the coordinates' own float64 rounding
    sure = np.abs(side) > 2.0**-8 + 2.0**-50 * far
    assert sure.mean() > 0.98
    assert 0.2 < pixels.mean() < 0.8
    np.testing.assert_array_equal(pixels[sure], (side > 0.0)[sure])


@pytest.mark.parametrize("projection", CAMERAS)
def test_a_huge_texture_keeps_its_place(projection: str) -> None:
    squares = {"tiles": Checker((1.0, 1.0), (0.1, 0.2, 0.3), (0.9, 0.8, 0.7))}

    def picture(far: float) -> FloatArray:
        corners = half_plane(far)
        surface = polygon(corners, uv=corners[:, :2] / 7.3 + 0.123, texture="tiles")
        scene = Scene("half", CAMERAS[projection], (surface,), squares)
        return np.asarray(render(scene, "raytrace:", size=SIZE).pixels)

    small = picture(50.0)
    assert np.ptp(small) > 0.3
    # uv of 1e7 are known to 2^-53 of that: borders move by 1e-9
    np.testing.assert_allclose(picture(1e8), small, atol=1e-6)


def test_huge_sheets_on_top_of_each_other_stay_before_the_camera() -> None:
    sheets = [half_plane(far) for far in (1e7, 1e6, 2e6)]
    colors = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    objects = tuple(polygon(p, color=c) for p, c in zip(sheets, colors, strict=True))
    for camera in CAMERAS.values():
        pixels = render(Scene("sheets", camera, objects), "raytrace:", size=SIZE).pixels
        seen = pixels.any(axis=2)
        assert 0.2 < seen.mean() < 0.8
        np.testing.assert_array_equal(pixels[seen], np.broadcast_to(colors[-1], (seen.sum(), 3)))


def mesh_of(corners: FloatArray) -> Mesh:
    return Mesh(
        corners, np.array([(0, 1, 2), (0, 2, 3)], np.int32), corners[:, :2], np.zeros(2, np.int32), np.zeros(2, bool)
    )


@pytest.mark.parametrize("projection", CAMERAS)
def test_parts_make_up_the_whole(projection: str) -> None:
    view = view_at(CAMERAS[projection], Animation(), 0, 0.0, SIZE)
    whole = mesh_of(half_plane(1e6) - view.origin)
    parts, parents = cut_large(whole, view, view.origin, 0.0)
    assert parents is not None
    assert len(parts.triangles) > 4

    def areas(mesh: Mesh) -> FloatArray:
        a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
        return np.asarray(np.cross(b - a, c - a)[:, 2] / 2)

    # sums of some hundred products of coordinates of 1e6
    np.testing.assert_allclose(np.bincount(parents, areas(parts)), areas(whole), rtol=1e-12)
    # none is turned over, but for rounding of products of 1e12
    assert (areas(parts) * np.sign(areas(whole))[parents] > -(2.0**-45) * 1e12).all()
    np.testing.assert_allclose(parts.uv, parts.vertices[:, :2] + view.origin[:2], atol=1e-8)


def test_ordinary_meshes_are_left_alone() -> None:
    for camera in CAMERAS.values():
        view = view_at(camera, Animation(), 0, 0.0, SIZE)
        mesh = mesh_of(half_plane(50.0) - view.origin)
        assert cut_large(mesh, view, view.origin, 0.0) == (mesh, None)


EYES = ((0.0, 0.0, 48.0), (3.1, -2.2, 45.7))


def sheet_through(eye: tuple[float, float, float], near: float, turn: float = 0.7) -> FloatArray:
    """Return a quad whose plane holds an eye that looks at the origin, up to rounding."""
    axis = -np.array(eye) / np.linalg.norm(eye)
    side = np.cross(axis, (np.sin(turn), np.cos(turn), 0.0))
    ends = [(near, -3.0), (40.0, -9.0), (40.0, 9.0), (near, 3.0)]
    return np.array([np.array(eye) + a * axis + b * side for a, b in ends])


@pytest.mark.parametrize(
    "technique", ["raytrace:", "raytrace:engine=portable", "raytrace:robust=off,spp=4", "reference:"]
)
@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize("near", [5.0, -20.0])
def test_a_plane_through_the_eye_but_for_rounding_is_not_seen(
    eye: tuple[float, float, float], near: float, technique: str
) -> None:
    camera = Camera("perspective", eye, (0.0, 0.0, 0.0), fov_y_deg=30.0)
    wall = polygon([(-9.0, -6.0, 0.0), (8.0, -5.0, 0.0), (7.0, 6.0, 0.0)], color=(0.2, 0.5, 0.9))
    objects = (wall, polygon(sheet_through(eye, near)))
    both, alone = (
        render(Scene("sheet", camera, shown), technique, size=SIZE).pixels for shown in (objects, objects[:1])
    )
    assert np.ptp(alone) > 0.3
    np.testing.assert_array_equal(both, alone)


def test_a_sheet_is_seen_again_when_the_camera_has_left_its_plane() -> None:
    eye = EYES[0]
    sheet = polygon(sheet_through(eye, 5.0, turn=0.0))
    camera = Camera("perspective", eye, (0.0, 0.0, 0.0), fov_y_deg=30.0, velocity=(0.0, 30.0, 0.0))
    scene = Scene("sheet", camera, (sheet,), animation=Animation(fps=30.0, frames=4))
    with prepare(scene, "raytrace:", size=SIZE) as prepared:
        seen = [float(prepared.render(frame=k).pixels.mean()) for k in (0, 1, 2, 0)]
    for technique in ("raytrace:", "raster:"):
        expected = [float(render(scene, technique, size=SIZE, frame=k).pixels.mean()) for k in (0, 1, 2, 0)]
        assert seen == pytest.approx(expected, abs=2 / (SIZE[0] * SIZE[1]))
    assert seen[0] == seen[3] == 0.0 < seen[1] != seen[2]


def test_only_flat_objects_are_dropped() -> None:
    corners = sheet_through(EYES[0], 5.0)
    mesh = mesh_of(corners)
    eye = np.array(EYES[0])
    assert through_eye(mesh, eye, np.array([True])).tolist() == [0, 1]
    assert not len(through_eye(mesh, eye, np.array([False])))
    assert not len(through_eye(mesh, eye + np.array([0.0, 1e-9, 0.0]), np.array([True])))
    left, kept = without(mesh, np.array([0]))
    assert kept.tolist() == [1]
    assert len(left.triangles) == len(left.owners) == 1


def test_huge_sheets_seen_askew_end_where_they_end() -> None:
    """One edge goes through the picture; the rest reaches far, at any angle: what is cut off may not come back in."""
    rng = np.random.default_rng(11)
    for number in range(12):
        far = (1e5, 1e7, 1e8)[number % 3]
        way = rng.normal(size=3)
        camera = Camera(
            "orthographic", tuple(4.0 * way / np.linalg.norm(way)), up=tuple(rng.normal(size=3)), height=2.0
        )
        view = view_at(camera, Animation(), 0, 0.0, SIZE)
        angle, bend = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(-1.0, 1.0, 2)
        along, off = np.array([np.cos(angle), np.sin(angle)]), rng.uniform(-0.5, 0.5)
        across = np.array([-along[1], along[0]])
        ends = [off * across - far * along, off * across + 0.7 * far * along, 0.5 * far * along + far * across,
                -0.9 * far * along + 0.6 * far * across]  # fmt: skip
        flat = np.array(ends)
        corners = flat[:, :1] * view.right + flat[:, 1:] * view.up + (flat @ bend)[:, None] * view.forward
        # what is before the camera's plane: its depth is 4 in the middle
        for technique in ("raytrace:", "raytrace:robust=off"):
            pixels = render(Scene("askew", camera, (polygon(corners),)), technique, size=SIZE).pixels[..., 0]
            rows, columns = np.indices(pixels.shape)
            x, y = (columns + 0.5 - SIZE[0] / 2) / view.scale, (SIZE[1] / 2 - rows - 0.5) / view.scale
            side, depth = x * across[0] + y * across[1] - off, 4.0 + x * bend[0] + y * bend[1]
            sure = (np.abs(side) * view.scale > 2.0**-7) & (np.abs(depth) > 1e-2)
            np.testing.assert_array_equal(pixels[sure], ((side > 0.0) & (depth > 0.0))[sure])
