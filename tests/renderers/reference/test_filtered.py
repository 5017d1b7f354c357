"""Every filter on flat scenes against what shares nothing with it: overlays by shapely, quadrature by scipy."""

import itertools

import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.special import ndtr, owens_t

from aliasbench.renderers.catalog import render
from aliasbench.renderers.reference.faces import build_faces
from aliasbench.renderers.reference.filtered import add_filtered, draw_filtered, spread_bound, wide_view
from aliasbench.renderers.reference.flat import draw_instant
from aliasbench.renderers.reference.paths import scene_paths
from aliasbench.renderers.reference.pieces import join_pieces, pieces_at
from aliasbench.renderers.sampling.filters import FILTERS, make_filter
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Camera, Motion, Scene, Surface
from aliasbench.scenes.projection import view_at

SEPARABLE = [name for name, kind in FILTERS.items() if kind.separable]
SIZE = (12, 10)
NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)


def in_picture(points, size):
    """Project points of the plane z = 0 of a camera two units high, looking along -z."""
    v = np.asarray(points, dtype=np.float64)
    return np.c_[size[0] / 2 + v[:, 0] * size[1] / 2, size[1] / 2 - v[:, 1] * size[1] / 2]


def half_plane(make_polygon, size, x, y, angle, color=(1.0, 1.0, 1.0)):
    """Return a polygon that fills, around the picture, what lies to the left of a line through pixel place (x, y)."""
    along = np.array([np.cos(angle), np.sin(angle)])
    left = np.array([-along[1], along[0]])
    o = np.array([(x - size[0] / 2), (size[1] / 2 - y)]) * 2 / size[1]
    far = 400.0
    return make_polygon([o - far * along, o + far * along, o + far * (along + left), o + far * (left - along)], color)


def text(name, radius, sigma=0.5):
    return f"reference:filter={name},radius={radius!r}" + (f",sigma={sigma!r}" if name == "gaussian" else "")


def overlay_mass(spec, shape, row, column):
    """Integrate a separable filter over a shape by shapely's overlay with its knots and Gauss rules on triangles."""
    moved = shapely.affinity.translate(shape, -column - 0.5, -row - 0.5)
    ends = sorted({*spec.knots, *np.arange(-5.0, 5.5)})
    ends = [e for e in ends if abs(e) <= spec.support]
    total = 0.0
    for (a, b), (c, d) in itertools.product(itertools.pairwise(ends), itertools.pairwise(ends)):
        part = shapely.intersection(moved, shapely.box(a, c, b, d))
        for piece in shapely.get_parts(part):
            if piece.area > 0.0:
                for t in shapely.constrained_delaunay_triangles(piece).geoms:
                    total += triangle_mass(spec, np.array(t.exterior.coords)[:3])
    return total


def triangle_mass(spec, p):
    """Integrate a smooth filter over a triangle, by a product rule collapsed onto it."""
    u, w = (NODES + 1) / 2, WEIGHTS / 2
    s, t = np.meshgrid(u, u, indexing="ij")
    weight = np.outer(w, w) * s
    e, f = p[1] - p[0], p[2] - p[1]
    points = p[0] + s[..., None] * e + (s * t)[..., None] * f
    return float((weight * spec.evaluate(points[..., 0], points[..., 1])).sum() * abs(e[0] * f[1] - e[1] * f[0]))


@pytest.mark.parametrize("radius", [0.04, 0.5, 0.73, 1.0, 1.5, 2.6])
@pytest.mark.parametrize("name", SEPARABLE)
def test_edge_along_the_grid_shows_the_profiles_integral(make_polygon, make_scene, name, radius):
    spec = make_filter(name, radius)
    upright = make_scene([half_plane(make_polygon, SIZE, 5.37, 5.0, np.pi / 2)])
    pixels = render(upright, text(name, radius), size=SIZE).pixels
    # an edge known to some ulp of 10 pixels, times the filter's slope
    close = 1e-15 * (5 + 10 * spec.peak)
    assert np.abs(pixels - spec.integral(5.37 - np.arange(12) - 0.5)[None, :, None]).max() < close
    level = make_scene([half_plane(make_polygon, SIZE, 5.0, 4.81, 0.0)])
    pixels = render(level, text(name, radius), size=SIZE).pixels
    assert np.abs(pixels - spec.integral(4.81 - np.arange(10) - 0.5)[:, None, None]).max() < close


@pytest.mark.parametrize("radius", [0.3, 1.0, 2.2])
def test_edge_under_the_cone_depends_on_its_distance_alone(make_polygon, make_scene, radius):
    for angle in (0.0, 0.3, np.pi / 4, 2.0, np.pi / 2):
        pixels = render(
            make_scene([half_plane(make_polygon, SIZE, 5.4, 4.7, angle)]), f"reference:filter=cone,radius={radius}",
            size=SIZE,
        ).pixels[..., 0]  # fmt: skip
        j, i = np.meshgrid(np.arange(12) + 0.5 - 5.4, np.arange(10) + 0.5 - 4.7)
        d = np.clip((-np.sin(angle) * j - np.cos(angle) * i) / radius, -1, 1)
        a = np.maximum(np.abs(d), 1e-300)
        # sections at distance x have the area sqrt(1 - x^2) - x^2 arcosh(1 / x); this is its integral up to a
        half = (2 * a * np.sqrt(1 - a**2) + np.arcsin(a) - a**3 * np.arccosh(1 / a)) / 3
        expected = 0.5 + np.sign(d) * 3 / np.pi * half
        # corners 2000 pixels away are rounded by 2e-13
        assert np.abs(pixels - expected).max() < 2e-13 / radius


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 0.3, np.pi / 4, 1.2, np.pi / 2 - 1e-7, np.pi / 2, 2.5])
@pytest.mark.parametrize("sigma", [0.15, 0.5, 1.3])
def test_edge_under_the_whole_gaussian_is_the_normal_distribution(make_polygon, make_scene, angle, sigma):
    scene = make_scene([half_plane(make_polygon, SIZE, 5.4, 4.7, angle)])
    pixels = render(scene, text("gaussian", np.inf, sigma), size=SIZE).pixels[..., 0]
    j, i = np.meshgrid(np.arange(12) + 0.5 - 5.4, np.arange(10) + 0.5 - 4.7)
    # the half-plane ends 2000 pixels away; y runs down
    expected = ndtr((-np.sin(angle) * j - np.cos(angle) * i) / sigma)
    assert np.abs(pixels - expected).max() < 1e-13 / sigma


def test_wide_gaussian_reaches_far_outside_the_picture(make_polygon, make_scene):
    scene = make_scene([half_plane(make_polygon, (5, 4), 30.0, 2.0, 1.1)])
    frame = render(scene, text("gaussian", np.inf, 12.0), size=(5, 4))
    j, i = np.meshgrid(np.arange(5) + 0.5 - 30.0, np.arange(4) + 0.5 - 2.0)
    expected = ndtr((-np.sin(1.1) * j - np.cos(1.1) * i) / 12.0)
    assert np.abs(frame.pixels[..., 0] - expected).max() < 1e-13
    assert frame.uncertainty is not None
    assert frame.uncertainty < 1e-9


coordinate = st.floats(-1.4, 1.4, allow_nan=False).map(lambda x: round(x, 4))
corner = st.tuples(coordinate, coordinate)


@settings(max_examples=40, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
@given(
    st.sampled_from(SEPARABLE), st.floats(0.15, 3.0), st.floats(0.25, 1.5), st.lists(corner, min_size=6, max_size=6),
    st.tuples(st.integers(1, 6), st.integers(1, 6)), st.integers(0, 35), st.booleans(),
)  # fmt: skip
def test_overlapping_triangles_show_what_an_overlay_and_quadrature_say(name, radius, sigma, points, size, at, endless):
    if endless and name == "gaussian":
        radius = np.inf
    spec = make_filter(name, radius, sigma)
    surfaces = [
        Surface(np.c_[points[3 * k : 3 * k + 3], np.full(3, 0.1 * k)], np.array([[0, 1, 2]], np.int32), color=color)
        for k, color in enumerate([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])
    ]
    scene = Scene("t", Camera("orthographic", height=2.0), tuple(surfaces), background=(0.0, 0.0, 1.0))
    frame = render(scene, text(name, radius, sigma), size=size)
    row, column = divmod(at % (size[0] * size[1]), size[0])
    front = shapely.Polygon(in_picture(points[3:], size))
    back = shapely.Polygon(in_picture(points[:3], size)).difference(front)
    green, red = overlay_mass(spec, front, row, column), overlay_mass(spec, back, row, column)
    # the overlay rounds corners to some ulp of ten pixels, 1e-15; the filter's mass follows with its peak
    assert np.abs(frame.pixels[row, column] - (red, green, 1 - red - green)).max() < 2e-13 * max(1.0, spec.peak)
    assert frame.uncertainty_kind == "bound"
    assert frame.uncertainty is not None
    assert frame.uncertainty < 1e-10


def gaussian_polygon_mass(points, sigma):
    """Return the mass of an infinite Gaussian at the origin over a polygon, from Owen's T for every side."""
    total = 0.0
    for p, q in zip(points, np.roll(points, -1, axis=0), strict=True):
        d = q - p
        length = np.hypot(*d)
        cross = p[0] * q[1] - p[1] * q[0]
        h = abs(cross) / length
        a, b = np.arctan2(p @ d / length, h), np.arctan2(q @ d / length, h)
        inner = (b - a) / (2 * np.pi) - (owens_t(h / sigma, np.tan(b)) - owens_t(h / sigma, np.tan(a)))
        total += np.sign(cross) * inner
    return total


@pytest.mark.parametrize("radius", [np.inf, 1.5, 0.8])
def test_concave_polygon_under_a_gaussian_is_its_sum_of_owens_functions(make_polygon, make_scene, radius):
    star = [(0.9, 0.0), (0.1, 0.15), (-0.3, 0.8), (-0.1, -0.05), (-0.2, -0.9)]
    scene = make_scene([make_polygon(star, triangles=[[0, 1, 3], [1, 2, 3], [0, 3, 4]])])
    size, sigma = (9, 7), 0.6
    pixels = render(scene, text("gaussian", radius, sigma), size=size).pixels[..., 0]
    outline = shapely.Polygon(in_picture(star, size))
    whole = make_filter("gaussian", np.inf, sigma)
    norm = 1.0 if np.isinf(radius) else (float(whole.integral(radius)) * 2 - 1) ** 2
    for row, column in itertools.product(range(7), range(9)):
        moved = shapely.affinity.translate(outline, -column - 0.5, -row - 0.5)
        if np.isfinite(radius):
            moved = moved.intersection(shapely.box(-radius, -radius, radius, radius))
        expected = 0.0
        for part in shapely.get_parts(moved):
            if part.area > 0.0:
                ring = np.array(shapely.orient_polygons(part).exterior.coords)[:-1]
                expected += gaussian_polygon_mass(ring, sigma)
        assert abs(pixels[row, column] - expected / norm) < 1e-13


def cone_mass(radius, triangle):
    """Integrate the cone at the origin over a triangle: closed along x, by Gauss-Legendre nodes across."""
    p = np.asarray(triangle) / radius

    def up_to(x, y):
        y = max(abs(y), 1e-300)
        if y >= 1.0:
            return 0.0
        half = np.sqrt(1 - y * y)
        x = min(max(x, -half), half)
        return x - (x * np.hypot(x, y) + y * y * np.arcsinh(x / y)) / 2

    sides = [(p[k], p[(k + 1) % 3]) for k in range(3)]
    breaks = {0.0, *p[:, 1]}
    for a, b in sides:
        d = b - a
        roots = np.roots([d @ d, 2 * a @ d, a @ a - 1.0])
        breaks |= {float(a[1] + t.real * d[1]) for t in roots if t.imag == 0.0 and 0 < t.real < 1}
    low, high = max(p[:, 1].min(), -1.0), min(p[:, 1].max(), 1.0)
    ends = [low, *sorted(b for b in breaks if low < b < high), high] if low < high else []

    def across(y):
        xs = [a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]) for a, b in sides if (a[1] - y) * (b[1] - y) < 0]
        return up_to(max(xs), y) - up_to(min(xs), y) if len(xs) > 1 else 0.0

    # A sine takes the square roots at the circle's ends away; between the breaks nothing else is singular.
    nodes, weights = np.polynomial.legendre.leggauss(160)
    angle = nodes * np.pi / 2
    total = 0.0
    for a, b in itertools.pairwise(ends):
        middle, half = (a + b) / 2, (b - a) / 2
        values = [across(y) for y in middle + half * np.sin(angle)]
        total += half * np.pi / 2 * float(np.sum(weights * np.cos(angle) * values))
    return 3 / np.pi * total


@settings(max_examples=25, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
@given(st.floats(0.2, 3.0), st.lists(corner, min_size=3, max_size=3), st.integers(0, 29))
def test_triangle_under_the_cone_is_its_quadrature(radius, points, at):
    size = (6, 5)
    scene = Scene(
        "t", Camera("orthographic", height=2.0), (Surface(np.c_[points, np.zeros(3)], np.array([[0, 1, 2]], np.int32)),)
    )
    row, column = divmod(at, size[0])
    value = render(scene, text("cone", radius), size=size).pixels[row, column, 0]
    expected = cone_mass(radius, in_picture(points, size) - (column + 0.5, row + 0.5))
    assert abs(value - expected) < 1e-10


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("radius", [0.35, 1.0, 1.9])
def test_triangles_of_a_plane_sum_to_one(make_polygon, make_scene, name, radius):
    inner = np.random.default_rng(3).uniform(-0.9, 0.9, (12, 2))
    points = np.r_[inner, [[-3, -3], [3, -3], [3, 3], [-3, 3]]]
    triangles = [np.array(t.exterior.coords)[:3] for t in shapely.delaunay_triangles(shapely.MultiPoint(points)).geoms]
    size = (40, 30)
    together = render(make_scene([make_polygon(t) for t in triangles]), text(name, radius), size=size).pixels
    assert np.abs(together - 1).max() < 1e-14
    alone = sum(render(make_scene([make_polygon(t)]), text(name, radius), size=size).pixels for t in triangles)
    assert np.abs(alone - 1).max() < 1e-12


@pytest.mark.parametrize(("name", "radius"), [("tent", 1.0), ("cone", 0.8), ("lanczos", 2.0), ("gaussian", np.inf)])
@pytest.mark.parametrize("projection", ["orthographic", "perspective"])
def test_planes_that_cross_meet_in_a_line(make_polygon, make_scene, projection, name, radius):
    flat = Camera("orthographic", height=2.0)
    camera = flat if projection == "orthographic" else Camera("perspective", fov_y_deg=30.0)
    tilt = 0.7
    a = [(-3, -3, -3 * tilt), (3, -3, 3 * tilt), (3, 3, 3 * tilt), (-3, 3, -3 * tilt)]  # z = tilt x
    b = [(-3, -3, 0.1), (3, -3, 0.1), (3, 3, 0.1), (-3, 3, 0.1)]
    scene = make_scene([make_polygon(a, (1, 0, 0)), make_polygon(b, (0, 1, 0))], camera=camera)
    size = (21, 15)
    x = view_at(camera, scene.animation, 0, 0.0, size).project(np.array([[0.1 / tilt, 0.0, 0.1]]))[0, 0]
    red = render(scene, text(name, radius), size=size).pixels[..., 0]
    # to the right of the line the tilted plane is nearer
    edge = render(make_scene([half_plane(make_polygon, size, x, 7.0, np.pi / 2)]), text(name, radius), size=size)
    assert np.abs(red - (1 - edge.pixels[..., 0])).max() < 1e-12


def test_wide_box_is_the_mean_of_the_pixels_it_covers(make_polygon, make_scene):
    # 400 wedges meet in one pixel, which is divided many times
    angles = 2 * np.pi * (np.arange(400) + 0.3) / 400
    rim = 3 * np.c_[np.cos(angles), np.sin(angles)]
    scene = make_scene(
        [make_polygon([(0.013, 0.007), rim[k], rim[(k + 1) % 400]], (k % 2, 1, k / 400)) for k in range(400)]
    )
    plain = render(scene, "reference:", size=(20, 16)).pixels
    for k in (3, 5):
        wide = render(scene, f"reference:filter=box,radius={k / 2}", size=(20, 16)).pixels
        mean = np.lib.stride_tricks.sliding_window_view(plain, (k, k), axis=(0, 1)).mean(axis=(3, 4))
        m = k // 2
        assert np.abs(wide[m:-m, m:-m] - mean).max() < 1e-13
    with_tent = render(scene, "reference:filter=tent", size=(20, 16)).pixels
    assert np.abs(with_tent[..., 1] - 1).max() < 1e-13


@pytest.mark.parametrize(
    ("name", "radius", "figure"),
    [("tent", 1.0, 1 / 10), ("box", 0.5, 1 / 12), ("gaussian", np.inf, 0.5 * (np.sqrt(2) - 1) / np.sqrt(np.pi))],
)
def test_point_samples_of_an_edge_are_off_by_the_known_mean_square(make_polygon, make_scene, name, radius, figure):
    # averaged over the edge's place within a pixel; at .5 the sampled pixel changes sides
    x, w = np.polynomial.legendre.leggauss(12)
    total = 0.0
    for start in (0.0, 0.5):
        for place, weight in zip(start + (x + 1) / 4, w / 4, strict=True):
            scene = make_scene([half_plane(make_polygon, (13, 1), 6 + place, 0.5, np.pi / 2)])
            exact = render(scene, text(name, radius), size=(13, 1)).pixels[0, :, 0]
            sampled = (np.arange(13) + 0.5 < 6 + place).astype(np.float64)
            total += weight * float(((exact - sampled) ** 2).sum())
    assert total == pytest.approx(figure, abs=1e-12)


def test_box_picture_against_the_tent_is_off_by_a_160th(make_polygon, make_scene):
    x, w = np.polynomial.legendre.leggauss(6)
    total = 0.0
    for start in (0.0, 0.5):
        for place, weight in zip(start + (x + 1) / 4, w / 4, strict=True):
            scene = make_scene([half_plane(make_polygon, (9, 1), 4 + place, 0.5, np.pi / 2)])
            box, tent = (render(scene, f"reference:filter={f}", size=(9, 1)).pixels[0, :, 0] for f in ("box", "tent"))
            total += weight * float(((box - tent) ** 2).sum())
    assert total == pytest.approx(1 / 160, abs=1e-14)


@pytest.mark.parametrize("name", FILTERS)
def test_small_picture_is_a_part_of_the_large_one(make_polygon, make_scene, name):
    shapes = [[(-0.3, -0.4), (0.7, 0.1), (0, 0.8)], [(-0.9, 0.1), (0.2, -0.8), (0.1, 0.3)]]

    def picture(size):
        camera = Camera("orthographic", height=2.0 * size[1] / 11)
        scene = make_scene([make_polygon(s, (0.3, k, 1)) for k, s in enumerate(shapes)], camera=camera)
        return render(scene, f"reference:filter={name}", size=size).pixels

    large = picture((11, 11))
    for w, h in ((1, 1), (1, 9), (7, 1), (3, 5)):
        i, j = (11 - h) // 2, (11 - w) // 2
        assert np.abs(picture((w, h)) - large[i : i + h, j : j + w]).max() < 1e-13


def test_sum_of_instants_is_the_sum_of_their_pictures(make_polygon, make_scene):
    moving = make_polygon([(-0.5, -0.4), (0.7, 0.1), (0, 0.8)], (1, 0.5, 0.1), motion=Motion((9.0, 3.0, 0)))
    scene = make_scene([moving, make_polygon([(-1, -1, -1), (1, -1, -1), (1, 0, -1)], (0, 0, 1))], shutter=1.0)
    faces, paths = build_faces(scene), scene_paths(scene)
    fractions, weights = (0.1, 0.4, 0.45), np.array([0.2, 0.5, 0.3])
    for name in ("box", "cone", "mitchell"):
        spec = make_filter(name, 1.2)
        views = [wide_view(view_at(scene.camera, scene.animation, 0, f, SIZE), spec) for f in fractions]
        pieces = join_pieces([pieces_at(faces, paths, v, 0, f) for v, f in zip(views, fractions, strict=True)])
        out = np.ones((SIZE[1], SIZE[0], 3))
        bound = add_filtered(scene, views[0], pieces, weights, spec, out)
        single = [draw_filtered(scene, faces, paths, SIZE, 0, f, spec).pixels for f in fractions]
        expected = 1 + sum(w * p for w, p in zip(weights, single, strict=True))
        assert np.abs(out - expected).max() < 1e-14
        assert 0 < bound < 1e-11
        assert np.abs(single[0] - single[2]).max() > 0.1


def test_instant_amid_an_open_shutter_has_every_filter(make_polygon, make_scene):
    scene = make_scene([make_polygon([(-0.5, -0.4), (0.7, 0.1), (0, 0.8)], motion=Motion((9.0, 3.0, 0)))], shutter=0.5)
    spec = make_filter("tent", 1.0)
    middle = draw_filtered(scene, build_faces(scene), scene_paths(scene), SIZE, 3, 0.25, spec).pixels
    frame = render(scene, "reference:filter=pyramid,time=center", size=SIZE, frame=3)
    assert np.array_equal(frame.pixels, middle)


@pytest.mark.parametrize("name", FILTERS)
def test_open_shutter_changes_nothing_that_stands_still(make_polygon, make_scene, name):
    triangle = make_polygon([(-0.5, -0.4), (0.7, 0.1), (0, 0.8)])
    open_, closed = (
        render(make_scene([triangle], shutter=s), f"reference:filter={name}", size=SIZE) for s in (1.0, 0.0)
    )
    assert np.array_equal(open_.pixels, closed.pixels)
    assert open_.uncertainty == closed.uncertainty


def test_pixel_box_is_the_plain_picture(make_polygon, make_scene):
    scene = make_scene([make_polygon([(-0.5, -0.4), (0.7, 0.1), (0, 0.8)])])
    faces, paths = build_faces(scene), scene_paths(scene)
    plain = draw_instant(scene, faces, paths, SIZE, 0, 0.0).pixels
    assert np.array_equal(draw_filtered(scene, faces, paths, SIZE, 0, 0.0, make_filter("box", 0.5)).pixels, plain)
    nearly = draw_filtered(scene, faces, paths, SIZE, 0, 0.0, make_filter("box", 0.5 + 1e-12)).pixels
    assert np.abs(nearly - plain).max() < 1e-11


@pytest.mark.parametrize("radius", [0.3, 1.0, 2.4, 3.0])
@pytest.mark.parametrize("name", FILTERS)
def test_bound_within_pixels_spreads_by_the_largest_value_of_the_filter(name, radius):
    spec = make_filter(name, radius)
    m = spec.margin
    one = np.zeros((2 * m + 1 + 2 * m, 2 * m + 1 + 2 * m))
    one[2 * m, 2 * m] = 1.0
    spread = spread_bound(one, spec)
    assert spread.shape == (2 * m + 1, 2 * m + 1)
    # 401 points across each pixel: no value above the bound, and the bound above none by much
    inside = np.linspace(-0.5, 0.5, 401)
    for i, j in itertools.product(range(-m, m + 1), repeat=2):
        largest = np.abs(spec.evaluate(j + inside[None, :], i + inside[:, None])).max()
        assert largest <= spread[m + i, m + j] * (1 + 1e-12)
        assert spread[m + i, m + j] <= largest + 0.06 * spec.peak**2


@pytest.mark.parametrize("name", ["tent", "cone", "gaussian"])
def test_number_of_threads_changes_nothing(make_polygon, make_scene, monkeypatch, name):
    rng = np.random.default_rng(8)
    scene = make_scene([make_polygon(rng.uniform(-1.2, 1.2, (3, 2)), tuple(rng.uniform(0, 1, 3))) for _ in range(9)])
    pictures = []
    for cores in (1, 5):
        monkeypatch.setattr("os.sched_getaffinity", lambda _, n=cores: set(range(n)))
        pictures.append(render(scene, f"reference:filter={name}", size=(50, 150)).pixels)
    assert np.array_equal(*pictures)
    assert np.ptp(pictures[0]) > 0.3


def test_filter_that_reaches_too_far_is_refused(make_scene):
    message = "filter=gaussian,radius=inf reaches 1660 pixels far; a reference allows at most 1024"
    with pytest.raises(InputError, match=message):
        render(make_scene([]), "reference:filter=gaussian,radius=inf,sigma=200", size=(4, 4))
