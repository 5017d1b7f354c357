"""Laws of exact coverage: against per-pixel overlay by another library, closed forms, and partitions."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from aliasbench.renderers.catalog import render
from aliasbench.scenes.model import Camera, Scene, Surface
from aliasbench.scenes.projection import view_at

ULP = 2.0**-52


def pixel_boxes(size):
    x, y = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    return shapely.box(x, y, x + 1, y + 1)


def coverage_of(shape, size):
    return shapely.area(shapely.intersection(pixel_boxes(size), shape))


def in_picture(scene, points, size):
    v = np.asarray(points, dtype=np.float64)
    v = np.c_[v, np.zeros(len(v))] if v.shape[1] == 2 else v
    return view_at(scene.camera, scene.animation, 0, 0.0, size).project(v)[:, :2]


coordinate = st.floats(-1.4, 1.4, allow_nan=False).map(lambda x: round(x, 4))


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    st.lists(st.tuples(coordinate, coordinate), min_size=3, max_size=3), st.tuples(st.integers(1, 9), st.integers(1, 9))
)
def test_triangle_covers_what_an_overlay_library_says(points, size):
    scene = Scene(
        "t", Camera("orthographic", height=2.0), (Surface(np.c_[points, np.zeros(3)], np.array([[0, 1, 2]], np.int32)),)
    )
    shape = shapely.Polygon(in_picture(scene, points, size))
    frame = render(scene, "reference:", size=size)
    # both round coordinates of up to some ten pixels: a few ulp of them times the edge in a pixel
    assert np.abs(frame.pixels[..., 0] - coverage_of(shape, size)).max() < 1e-13
    assert frame.pixels.shape == (size[1], size[0], 3)


def test_concave_polygon_is_covered_once(make_polygon, make_scene):
    star = [(0.9, 0.0), (0.1, 0.15), (-0.3, 0.8), (-0.1, -0.05), (-0.2, -0.9)]
    # ears of the outline; vertices 1 and 3 are reflex
    scene = make_scene([make_polygon(star, triangles=[[0, 1, 3], [1, 2, 3], [0, 3, 4]])])
    expected = coverage_of(shapely.Polygon(in_picture(scene, star, (17, 13))), (17, 13))
    assert np.abs(render(scene, "reference:", size=(17, 13)).pixels[..., 1] - expected).max() < 1e-13


@pytest.mark.parametrize("size", [(64, 64), (400, 300)])
def test_triangles_of_a_plane_sum_to_one(make_polygon, make_scene, size):
    rng = np.random.default_rng(3)
    inner = rng.uniform(-0.9, 0.9, (12, 2))
    points = np.r_[inner, [[-3, -3], [3, -3], [3, 3], [-3, 3]]]
    triangles = [np.array(t.exterior.coords)[:3] for t in shapely.delaunay_triangles(shapely.MultiPoint(points)).geoms]
    together = render(make_scene([make_polygon(t) for t in triangles]), "reference:", size=size).pixels
    assert np.abs(together - 1).max() <= 4 * ULP
    alone = sum(render(make_scene([make_polygon(t)]), "reference:", size=size).pixels for t in triangles)
    assert np.abs(alone - 1).max() <= 4 * ULP


@pytest.mark.parametrize("near_first", [True, False])
def test_nearer_polygon_hides_whatever_the_order(make_polygon, make_scene, near_first):
    far = [(-0.8, -0.7, 0.0), (0.9, -0.5, 0.0), (0.1, 0.9, 0.0)]
    near = [(-0.5, -0.9, 0.5), (0.8, 0.3, 0.5), (-0.6, 0.6, 0.5)]
    objects = [make_polygon(near, (1, 0, 0)), make_polygon(far, (0, 1, 0))]
    scene = make_scene(objects if near_first else objects[::-1], background=(0, 0, 1))
    size = (19, 16)
    front = shapely.Polygon(in_picture(scene, near, size))
    back = shapely.Polygon(in_picture(scene, far, size)).difference(front)
    red, green = coverage_of(front, size), coverage_of(back, size)
    expected = np.stack([red, green, 1 - red - green], axis=2)
    assert np.abs(render(scene, "reference:", size=size).pixels - expected).max() < 1e-13


def test_later_of_coplanar_polygons_wins(make_polygon, make_scene):
    first, second = (
        [(-0.9, -0.9), (0.7, -0.9), (0.7, 0.7), (-0.9, 0.7)],
        [(-0.3, -0.2), (0.9, -0.2), (0.9, 0.9), (-0.3, 0.9)],
    )
    scene = make_scene([make_polygon(first, (1, 0, 0)), make_polygon(second, (0, 1, 0))])
    size = (11, 11)
    above = shapely.Polygon(in_picture(scene, second, size))
    expected = coverage_of(shapely.Polygon(in_picture(scene, first, size)).difference(above), size)
    pixels = render(scene, "reference:", size=size).pixels
    assert np.abs(pixels[..., 0] - expected).max() < 1e-13
    assert np.abs(pixels[..., 1] - coverage_of(above, size)).max() < 1e-13


@pytest.mark.parametrize("projection", ["orthographic", "perspective"])
def test_planes_that_cross_meet_in_a_line(make_polygon, make_scene, projection):
    camera = (
        Camera("orthographic", height=2.0) if projection == "orthographic" else Camera("perspective", fov_y_deg=30.0)
    )
    tilt = 0.7
    a = [(-2, -2, -2 * tilt), (2, -2, 2 * tilt), (2, 2, 2 * tilt), (-2, 2, -2 * tilt)]  # z = tilt x
    b = [(-2, -2, 0.1), (2, -2, 0.1), (2, 2, 0.1), (-2, 2, 0.1)]
    scene = make_scene([make_polygon(a, (1, 0, 0)), make_polygon(b, (0, 1, 0))], camera=camera)
    size = (21, 15)
    x = in_picture(scene, [(0.1 / tilt, 0.0, 0.1)], size)[0, 0]
    red = render(scene, "reference:", size=size).pixels[..., 0]
    # to the right of the line the tilted plane is nearer
    expected = np.clip(np.arange(size[0]) + 1 - x, 0, 1)
    assert np.abs(red - expected).max() < 1e-12


def test_polygon_through_the_camera_is_cut(make_polygon, make_scene):
    camera = Camera("perspective", position=(0, 1, 0), target=(0, 1, -1), fov_y_deg=90.0)
    floor = [(-1e5, 0, 50), (1e5, 0, 50), (1e5, 0, -40), (-1e5, 0, -40)]
    behind = [(-5, -5, 3), (5, -5, 3), (0, 9, 3)]
    scene = make_scene([make_polygon(floor), make_polygon(behind, (0, 1, 0))], camera=camera)
    pixels = render(scene, "reference:", size=(16, 24)).pixels
    # the far end is at 1 / 40 below the axis: 12 + 12 / 40 rows from the top
    expected = np.clip(np.arange(24) + 1 - (12 + 12 / 40), 0, 1)[:, None]
    assert np.abs(pixels - expected[..., None]).max() < 1e-9


def test_mesh_hides_itself(make_polygon, make_scene):
    # a pyramid seen from above its tip: the union of its faces is its square
    points = [(-0.6, -0.5, 0), (0.7, -0.5, 0), (0.7, 0.6, 0), (-0.6, 0.6, 0), (0.05, 0.1, 1.0)]
    faces = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [0, 2, 1], [0, 3, 2]]
    scene = make_scene([make_polygon(points, triangles=faces, is_polygon=False)])
    expected = coverage_of(shapely.Polygon(in_picture(scene, points[:4], (13, 13))), (13, 13))
    assert np.abs(render(scene, "reference:", size=(13, 13)).pixels[..., 2] - expected).max() < 1e-13


def test_many_wedges_that_meet_in_a_pixel_share_it(make_polygon, make_scene):
    angles = 2 * np.pi * (np.arange(400) + 0.3) / 400
    rim = 3 * np.c_[np.cos(angles), np.sin(angles)]
    wedges = [make_polygon([(0.013, 0.007), rim[k], rim[(k + 1) % 400]], (k % 2, 1, 0)) for k in range(400)]
    pixels = render(make_scene(wedges), "reference:", size=(32, 32)).pixels
    assert np.abs(pixels[..., 1] - 1).max() < 1e-13
    assert 0.45 < pixels[..., 0].mean() < 0.55
    middle = pixels[15, 16, 0]
    assert abs(middle - 0.5) < 0.02


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (9, 1)])
def test_empty_scene_is_its_background(make_scene, size):
    frame = render(make_scene([], background=(0.1, 0.2, 0.7)), "reference:", size=size)
    assert frame.pixels.dtype == np.float64
    assert np.array_equal(frame.pixels, np.broadcast_to((0.1, 0.2, 0.7), (size[1], size[0], 3)))
    assert (frame.uncertainty_kind, frame.samples) == ("bound", 0)
    assert frame.uncertainty is not None
    assert frame.uncertainty < 1e-11


def test_seed_changes_nothing(make_polygon, make_scene):
    scene = make_scene([make_polygon([(-0.5, -0.4), (0.7, 0.1), (0, 0.8)])])
    one, two = (render(scene, "reference:", size=(8, 8), seed=s).pixels for s in (0, 5))
    assert np.array_equal(one, two)
