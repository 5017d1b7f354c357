"""Polygons are accepted exactly when they are planar, simple and have an area, and are cut without a change."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Motion, Surface
from aliasbench.scenes.shapes import PLANE_TOLERANCE, mesh, polygon, quad, triangulate

SQUARE = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)]
ARROW = [(0.0, 0.0, 0.0), (2.0, 1.0, 0.0), (0.0, 2.0, 0.0), (0.7, 1.0, 0.0)]
COMB = [(x, y, 0.0) for k in range(5) for x, y in ((2 * k, 0), (2 * k, 3), (2 * k + 1, 3), (2 * k + 1, 0))]
COMB = [*COMB, (9.0, -1.0, 0.0), (0.0, -1.0, 0.0)]
FLAT_VERTICES = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (2, 1, 0), (2, 2, 0), (1, 2, 0), (0, 2, 0), (0, 1, 0)]
SPIRAL = [
    (0, 0),
    (6, 0),
    (6, 6),
    (1, 6),
    (1, 2),
    (4, 2),
    (4, 4),
    (3, 4),
    (3, 3),
    (2, 3),
    (2, 5),
    (5, 5),
    (5, 1),
    (0, 1),
]
STAR = [
    ((1.0 if k % 2 else 0.3) * np.cos(2 * np.pi * k / 14), (1.0 if k % 2 else 0.3) * np.sin(2 * np.pi * k / 14), 0.0)
    for k in range(14)
]
OUTLINES = {
    "triangle": SQUARE[:3],
    "square": SQUARE,
    "arrow": ARROW,
    "comb": COMB,
    "flat vertices": FLAT_VERTICES,
    "spiral": [(x, y, 0.0) for x, y in SPIRAL],
    "star": STAR,
}


def area_vectors(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a) / 2


def outline_area_vector(points: np.ndarray) -> np.ndarray:
    local = points - points.mean(axis=0)
    return np.cross(local, np.roll(local, -1, axis=0)).sum(axis=0) / 2


def check_cut(surface: Surface) -> None:
    points = surface.vertices
    assert surface.triangles.shape == (len(points) - 2, 3)
    assert surface.triangles.dtype == np.int32
    parts, whole = area_vectors(points, surface.triangles), outline_area_vector(points)
    size = float(np.linalg.norm(whole))
    # every part wound as the outline, so that areas add up only without overlaps
    assert (parts @ whole > 0.0).all()
    scale = np.finfo(np.float64).eps * np.abs(points).max() ** 2
    np.testing.assert_allclose(np.linalg.norm(parts, axis=1).sum(), size, rtol=1e-13, atol=64 * scale)
    np.testing.assert_allclose(parts.sum(axis=0), whole, rtol=0, atol=64 * len(points) * scale)
    sides = {frozenset((k, (k + 1) % len(points))) for k in range(len(points))}
    used = [frozenset(pair) for t in surface.triangles.tolist() for pair in ((t[0], t[1]), (t[1], t[2]), (t[2], t[0]))]
    assert {e for e in used if used.count(e) == 1} == sides
    assert all(used.count(e) <= 2 for e in used)


@pytest.mark.parametrize("reverse", [False, True], ids=["as given", "reversed"])
@pytest.mark.parametrize("name", OUTLINES)
def test_triangles_cover_the_outline_once_with_its_winding_and_its_vertices(name: str, reverse: bool) -> None:
    points = np.array(OUTLINES[name], dtype=np.float64)
    if reverse:
        points = points[::-1]
    surface = polygon(points)
    np.testing.assert_array_equal(surface.vertices, points)
    check_cut(surface)


@pytest.mark.parametrize("name", OUTLINES)
def test_a_polygon_may_lie_anywhere_in_space(name: str) -> None:
    turn = Rotation.from_rotvec([0.3, -1.1, 0.7])
    points = turn.apply(np.array(OUTLINES[name], dtype=np.float64))
    for offset, scale in (((0, 0, 0), 1.0), ((1e4, -2e4, 3e3), 1.0), ((0, 0, 0), 1e-5), ((0, 0, 0), 1e7)):
        check_cut(polygon(points * scale + offset))


@given(
    radii=st.lists(st.floats(0.05, 1.0), min_size=3, max_size=20),
    tilt=st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3)),
)
@settings(max_examples=80, deadline=None)
def test_any_star_shaped_outline_is_cut(radii: list[float], tilt: tuple[float, float, float]) -> None:
    angles = 2 * np.pi * np.arange(len(radii)) / len(radii)
    flat = np.stack([radii * np.cos(angles), radii * np.sin(angles), np.zeros(len(radii))], axis=1)
    check_cut(polygon(Rotation.from_rotvec(tilt).apply(flat)))


def test_arrays_are_float64_and_int32_and_cannot_be_written() -> None:
    surface = quad(SQUARE)
    assert surface.uv is not None
    for array, kind in ((surface.vertices, np.float64), (surface.triangles, np.int32), (surface.uv, np.float64)):
        assert array.dtype == kind
        assert not array.flags.writeable


def test_a_quad_has_the_unit_square_as_texture_coordinates() -> None:
    surface = quad(SQUARE)
    assert surface.uv is not None
    assert surface.uv.tolist() == [[0, 0], [1, 0], [1, 1], [0, 1]]
    own = quad(SQUARE, uv=[(0, 0), (4, 0), (4, 4), (0, 4)], texture="t")
    assert own.uv is not None
    assert own.uv.max() == 4.0
    assert own.texture == "t"


def test_what_is_given_is_kept() -> None:
    motion = Motion(velocity=(1.0, 0.0, 0.0))
    surface = polygon(ARROW, color=(0.1, 0.2, 0.3), motion=motion, name="arrow")
    assert (surface.color, surface.motion, surface.name, surface.uv) == ((0.1, 0.2, 0.3), motion, "arrow", None)
    assert surface.is_polygon


REFUSED = {
    "two points": (SQUARE[:2], "has 2 points; at least 3 are needed"),
    "one place": ([(1, 1, 1)] * 3, "all its points are the same"),
    "repeated": ([*SQUARE, SQUARE[3]], "points 3 and 4 are the same"),
    "closed": ([*SQUARE, SQUARE[0]], "points 4 and 0 are the same"),
    "on a line": ([(0, 0, 0), (1, 1, 1), (2, 2, 2), (3.5, 3.5, 3.5)], "has no area: its points lie on one line"),
    "there and back": ([(0, 0, 0), (1, 0, 0), (2, 0, 0), (1, 0, 0)], "has no area: its points lie on one line"),
    "figure of eight": ([(0, 0, 0), (1, 1, 0), (1, 0, 0), (0, 1, 0)], "has no area: its outline crosses itself"),
    "crossing": ([(0, 0, 0), (3, 0, 0), (3, 3, 0), (1, -1, 0)], "its outline crosses or touches itself"),
    "pentagram": (
        [(np.cos(4 * np.pi * k / 5), np.sin(4 * np.pi * k / 5), 0) for k in range(5)],
        "its outline crosses or touches itself",
    ),
    "touching": (
        [(0, 0, 0), (2, 0, 0), (2, 2, 0), (1, 0, 0), (0, 2, 0)],
        "its outline crosses or touches itself",
    ),
    "spike": ([(0, 0, 0), (2, 0, 0), (3, 0, 0), (2, 0, 0), (2, 2, 0)], "its outline crosses or touches itself"),
    "off its plane": ([*SQUARE[:3], (0.0, 1.0, 0.01)], r"point \d lies 0\.00\d+ of the polygon's size off its plane"),
    "too large": ([(0, 0, 0), (1e300, 0, 0), (0, 1e300, 0)], r"its size is 1e\+300; 1e-60 to 1e\+60 is allowed"),
    "beyond": ([(-1e308, 0, 0), (1e308, 0, 0), (0, 1e308, 0)], "its size is inf"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_planar_simple_polygon_is_refused(case: str) -> None:
    points, message = REFUSED[case]
    with pytest.raises(InputError, match=f"^polygon: {message}"):
        polygon(points)


@pytest.mark.parametrize("share", [0.5, 2.0])
def test_the_plane_is_held_to_its_tolerance(share: float) -> None:
    # a corner lifted by 4 d lies d off the best plane of a unit square, as the other three do
    lifted = [*SQUARE[:3], (0.0, 1.0, 4 * share * PLANE_TOLERANCE)]
    if share < 1.0:
        assert len(polygon(lifted).triangles) == 2
    else:
        with pytest.raises(InputError, match=r"at most 1e-06 is allowed \(a planar polygon\)"):
            polygon(lifted)


def test_a_sliver_is_a_polygon_and_a_line_is_not() -> None:
    assert len(polygon([(0, 0, 0), (1, 0, 0), (1, 1e-9, 0)]).triangles) == 1
    with pytest.raises(InputError, match="has no area"):
        polygon([(0, 0, 0), (1, 0, 0), (1, 1e-13, 0)])


def test_area_that_only_rounding_makes_is_none() -> None:
    # at 1e9 a coordinate is known to 1e-7: the lift of 1e-7 in a length of 1 is noise
    with pytest.raises(InputError, match="has no area"):
        polygon([(1e9, 1e9, 0), (1e9 + 1, 1e9 + 1, 0), (1e9 + 2, 1e9 + 2.0000001, 0)])


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([(0, 0), (1, 0), (0, 1)], r"polygon 'p': has shape \(3, 2\); \(n, 3\) is needed"),
        ([(0, 0, 0), (1, 0, float("nan")), (0, 1, 0)], r"polygon 'p': entry 1 is \[1\.0, 0\.0, nan\]"),
        ([(0, 0, 0), (1, 0), (0, 1, 0)], "polygon 'p': not a list of 3 numbers each"),
        ("abc", "polygon 'p': not a list of 3 numbers each"),
    ],
)
def test_points_that_are_no_finite_triples_are_refused(points: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        polygon(points, name="p")


def test_texture_coordinates_must_match_the_points() -> None:
    with pytest.raises(InputError, match="uv has 2 pairs for 4 points; one for each is needed"):
        polygon(SQUARE, uv=[(0, 0), (1, 1)])
    with pytest.raises(InputError, match="texture 'bricks' needs uv"):
        polygon(SQUARE, texture="bricks")
    with pytest.raises(InputError, match="uv: entry 0 is"):
        polygon(SQUARE, uv=[(np.inf, 0), (1, 1), (0, 0), (0, 0)])


def test_a_quad_has_four_corners() -> None:
    with pytest.raises(InputError, match="quad 'q': has 3 corners; exactly 4 are needed"):
        quad(SQUARE[:3], name="q")


def test_a_mesh_keeps_its_triangles_and_refuses_indices_it_has_no_vertex_for() -> None:
    surface = mesh(SQUARE, [(0, 1, 2)], color=(1.0, 0.0, 0.0))
    assert not surface.is_polygon
    assert surface.triangles.tolist() == [[0, 1, 2]]
    for bad in ([(0, 1, 4)], [(-1, 0, 1)]):
        with pytest.raises(InputError, match=r"vertex indices must lie in 0\.\.3"):
            mesh(SQUARE, bad)
    with pytest.raises(InputError, match=r"triangles have shape \(0,\)"):
        mesh(SQUARE, [])


def test_triangulating_twice_gives_the_same() -> None:
    points = np.array(STAR)
    np.testing.assert_array_equal(triangulate(points), triangulate(points.copy()))
