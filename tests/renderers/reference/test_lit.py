"""Rectangle lights: closed forms of view factors, penumbrae by quadrature, and laws of energy, shadow and area."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from aliasbench.renderers.reference.faces import build_faces
from aliasbench.renderers.reference.lit import draw_lit, sample_lit
from aliasbench.renderers.reference.paths import scene_paths
from aliasbench.renderers.sampling.filters import make_filter
from aliasbench.scenes.model import (
    Camera,
    Checker,
    Grating,
    Light,
    Material,
    Motion,
    Scene,
    Surface,
    ZonePlate,
    read_only,
)
from aliasbench.scenes.projection import view_at

BOX = make_filter("box", 0.5)
UV = read_only(np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]))
FLOOR = [(-4.0, 0.0, 4.0), (4.0, 0.0, 4.0), (4.0, 0.0, -4.0), (-4.0, 0.0, -4.0)]
DOWN = Camera("orthographic", position=(0.0, 1.0, 0.0), target=(0.0, 0.0, 0.0), up=(0.0, 0.0, -1.0), height=2.0)


def surface(points, color=(1.0, 1.0, 1.0), kind="diffuse", **keys):
    v = np.asarray(points, dtype=np.float64)
    fan = np.array([[0, i, i + 1] for i in range(1, len(v) - 1)], np.int32)
    return Surface(read_only(v), read_only(fan), color=color, material=Material(kind), **keys)


def ceiling(x0, x1, z0, z1, height, radiance=1.0):
    """Return a light that shines down."""
    quad = ((x0, height, z0), (x1, height, z0), (x1, height, z1), (x0, height, z1))
    return Light(quad, (radiance, radiance, radiance))


def draw(scene, size, spec=BOX, *, frame=0, fraction=0.0, view=None, **keys):
    view = view or view_at(scene.camera, scene.animation, frame, fraction, size)
    return draw_lit(scene, build_faces(scene), scene_paths(scene), view, frame, fraction, spec, **keys)


def estimate(scene, size, spec, points, seed, **keys):
    view = view_at(scene.camera, scene.animation, 0, 0.0, size)
    return sample_lit(scene, build_faces(scene), scene_paths(scene), view, 0, 0.0, spec, points, seed, **keys)


def corner(a, b, height):
    """Return the irradiance below the corner of a parallel rectangle a x b of radiance 1 (Howell, view factor B-3)."""
    x, y = a / height, b / height
    p, q = math.sqrt(1 + x * x), math.sqrt(1 + y * y)
    return 0.5 * (x / p * math.atan(y / p) + y / q * math.atan(x / q))


def rectangle(x0, x1, z0, z1, height):
    """Return the irradiance at the origin from a parallel rectangle, by corners with their signs."""
    return corner(x1, z1, height) - corner(x0, z1, height) - corner(x1, z0, height) + corner(x0, z0, height)


def random_scene(seed, *, camera=None, occluders=5, lights=1, floor=None):
    rng = np.random.default_rng(seed)
    objects = [floor or surface(FLOOR, (0.8, 0.7, 0.9))]
    for k in range(occluders):
        c = rng.uniform(-1.5, 1.5, 3)
        c[1] = rng.uniform(0.3, 1.2)
        a, b = np.linalg.qr(rng.normal(size=(3, 2)))[0].T
        s = rng.uniform(0.2, 0.5)
        points = [c + s * (-a - b), c + s * (a - b), c + s * (a + b), c + s * (b - a)][: 3 + k % 2]
        objects.append(surface(points, tuple(rng.uniform(0.3, 1.0, 3)), "unlit" if k == 2 else "diffuse"))
    shine = [ceiling(-0.5 + k, 0.5 + k, -0.5, 0.5, 2.5 - 0.3 * k, 4.0 + k) for k in range(lights)]
    place = camera or Camera("perspective", position=(0.0, 3.0, 6.0), target=(0.0, 0.3, 0.0), fov_y_deg=45.0)
    return Scene("lit", place, tuple(objects), lights=tuple(shine), background=(0.05, 0.06, 0.1))


@pytest.mark.parametrize(("x", "z", "height"), [(0.0, 0.0, 1.5), (0.7, -0.4, 0.8), (2.5, 1.0, 3.0)])
def test_a_parallel_rectangle_has_its_view_factor(x, z, height):
    camera = replace(DOWN, position=(x, 0.5, z), target=(x, 0.0, z), height=1e-4)
    scene = Scene("p", camera, (surface(FLOOR),), lights=(ceiling(-1.0, 0.6, -0.5, 0.9, height),))
    got = draw(scene, (1, 1))
    # the pixel is so small that the mean differs from the middle by its area times a curvature of a few units
    assert got.pixels[0, 0, 0] == pytest.approx(
        rectangle(-1 - x, 0.6 - x, -0.5 - z, 0.9 - z, height) / math.pi, abs=1e-8
    )
    assert got.bound.max() < 1e-9


@pytest.mark.parametrize("c", [0.3, 1.0, 4.0])
def test_a_perpendicular_rectangle_has_its_view_factor(c):
    a, b = 1.2, 0.9
    # standing on the floor's plane at distance c, its lower corner opposite the point (Howell, view factor B-4)
    quad = ((0.0, 0.0, -c), (a, 0.0, -c), (a, b, -c), (0.0, b, -c))
    p, q = math.sqrt(b * b + c * c), a
    expected = 0.5 * (math.atan(q / c) - c / p * math.atan(q / p))
    camera = replace(DOWN, position=(0.0, 0.5, 0.0), height=1e-4)
    got = draw(Scene("p", camera, (surface(FLOOR),), lights=(Light(quad, (1.0, 1.0, 1.0)),)), (1, 1))
    assert got.pixels[0, 0, 0] == pytest.approx(expected / math.pi, abs=1e-8)


def test_a_small_light_falls_off_with_the_square_of_the_distance():
    for height in (1.0, 2.0, 5.0):
        light = ceiling(0.5, 0.502, 0.0, 0.002, height, 1e6)
        got = draw(Scene("p", replace(DOWN, position=(0.0, 0.5, 0.0), height=1e-4), (surface(FLOOR),), lights=(light,)),
                   (1, 1)).pixels[0, 0, 0]  # fmt: skip
        r2 = 0.501**2 + height**2 + 0.001**2
        assert got == pytest.approx(1e6 * 4e-6 * height**2 / r2**2 / math.pi, rel=1e-5)


def test_a_huge_light_fills_the_hemisphere():
    got = draw(Scene("p", DOWN, (surface(FLOOR, (0.5, 0.25, 1.0)),), lights=(ceiling(-1e4, 1e4, -1e4, 1e4, 2.0),)),
               (3, 3))  # fmt: skip
    assert got.pixels == pytest.approx(np.broadcast_to((0.5, 0.25, 1.0), (3, 3, 3)), abs=1e-6)


@pytest.mark.parametrize("edge", [0.0, 0.37])
def test_the_penumbra_of_a_straight_edge_is_that_of_the_clipped_light(edge):
    # what is seen of the light past an edge at half its height begins at 2 edge - x
    occluder = surface([(-9.0, 1.0, -9.0), (edge, 1.0, -9.0), (edge, 1.0, 9.0), (-9.0, 1.0, 9.0)], kind="unlit")
    camera = replace(DOWN, position=(0.2, 0.5, 0.0), target=(0.2, 0.0, 0.0), height=0.5)
    scene = Scene("p", camera, (surface(FLOOR), occluder), lights=(ceiling(-0.5, 0.5, -0.4, 0.6, 2.0),))
    size = (6, 2)
    got = draw(scene, size)
    nodes, weights = np.polynomial.legendre.leggauss(12)

    def mean(column, row):
        x0, z0, step = 0.2 + (column - 3) * 0.25, (row - 1) * 0.25, 0.25
        kinks = sorted({x0, x0 + step, *(k for k in (2 * edge - 0.5, 2 * edge + 0.5) if x0 < k < x0 + step)})
        total = 0.0
        for a, b in itertools.pairwise(kinks):
            for u, w in zip(nodes, weights, strict=True):
                x = a + (b - a) * (u + 1) / 2
                begin = max(-0.5, 2 * edge - x)
                for v, t in zip(nodes, weights, strict=True):
                    z = z0 + step * (v + 1) / 2
                    if begin < 0.5:
                        total += (b - a) * w * t / 4 * rectangle(begin - x, 0.5 - x, -0.4 - z, 0.6 - z, 2.0)
        return total / step / math.pi

    expected = np.array([[mean(c, r) for c in range(size[0])] for r in range(size[1])])
    assert got.bound.max() < 1e-5
    assert (np.abs(got.pixels[..., 0] - expected) <= got.bound + 1e-12).all()
    assert np.ptp(expected) > 0.01


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("parallel", [False, True])
def test_a_pixel_is_the_mean_of_its_quarters(seed, parallel):
    camera = Camera("orthographic", position=(1.0, 3.0, 6.0), height=4.0) if parallel else None
    scene = random_scene(seed, camera=camera, occluders=3 + 2 * seed, lights=1 + seed % 2)
    coarse, fine = draw(scene, (9, 7)), draw(scene, (18, 14))
    mean, bound = (a.reshape(7, 2, 9, 2, -1).mean(axis=(1, 3)) for a in (fine.pixels, fine.bound))
    assert coarse.bound.max() < 1e-5
    assert (np.abs(coarse.pixels - mean) <= coarse.bound[..., None] + bound).all()


@pytest.mark.parametrize("name", ["checker", "grating", "plate"])
def test_wide_boxes_of_textured_floors_are_means_of_pixels(name):
    textures = {"checker": Checker((7.0, 5.0), (0.2, 0.0, 0.1)), "grating": Grating(6.0, 20.0),
                "plate": ZonePlate((0.4, 0.5), 60.0)}  # fmt: skip
    for kind in ("diffuse", "unlit"):
        floor = surface(FLOOR, kind=kind, uv=UV, texture=name)
        scene = replace(random_scene(4, occluders=2, floor=floor), textures=textures)
        wide = draw(scene, (4, 4), make_filter("box", 1.5))
        assert wide.bound.max() < 1e-4
        view = view_at(scene.camera, scene.animation, 0, 0.0, (4, 4))
        small = draw(scene, (6, 6), view=replace(view, width=6, height=6))
        sums = sum(small.pixels[i : i + 4, j : j + 4] for i in range(3) for j in range(3)) / 9
        assert (np.abs(wide.pixels - sums) <= (wide.bound + small.bound.max())[..., None]).all()


def test_more_in_the_way_is_never_brighter_and_nothing_shines_brighter_than_the_light():
    light = ceiling(-0.5, 0.5, -0.5, 0.5, 2.0, 3.0)
    rng = np.random.default_rng(8)
    # the camera is below all occluders, which it does not see
    camera = replace(DOWN, position=(0.0, 0.1, 0.0))
    objects, before = [surface(FLOOR)], None
    for _ in range(5):
        got = draw(Scene("p", camera, tuple(objects), lights=(light,)), (8, 8))
        assert got.pixels.min() >= -got.bound.max()
        assert got.pixels.max() <= 3.0
        if before is not None:
            assert (got.pixels <= before.pixels + (got.bound + before.bound)[..., None]).all()
            assert got.pixels.sum() < before.pixels.sum()
        before = got
        c = np.array([*rng.uniform(-0.6, 0.6, 2), 0.0])[[0, 2, 1]] + (0.0, rng.uniform(0.4, 1.4), 0.0)
        objects.append(surface(c + 0.3 * rng.normal(size=(3, 3)) * (1.0, 0.3, 1.0), kind="unlit"))


def test_lights_are_seen_in_front_black_from_behind_and_over_what_lies_in_their_plane():
    light = ceiling(-0.5, 0.5, -0.5, 0.5, 1.0, 7.0)
    roof = surface([(-2.0, 1.0, -2.0), (2.0, 1.0, -2.0), (2.0, 1.0, 2.0), (-2.0, 1.0, 2.0)])
    below = Camera("orthographic", position=(0.0, 0.0, 0.0), target=(0.0, 1.0, 0.0), up=(0.0, 0.0, 1.0), height=2.0)
    above = replace(below, position=(0.0, 3.0, 0.0))
    for camera, value in ((below, 7.0), (above, 0.0)):
        got = draw(Scene("p", camera, (roof,), lights=(light,), background=(0.5, 0.5, 0.5)), (4, 4))
        assert got.pixels[1:3, 1:3] == pytest.approx(np.full((2, 2, 3), value), abs=1e-9)
        # in the light's plane it is lit by nothing
        assert got.pixels[0, 0] == pytest.approx(np.zeros(3), abs=1e-9)
        alone = draw(Scene("p", camera, (), lights=(light,), background=(0.5, 0.5, 0.5)), (4, 4))
        assert alone.pixels[0, 0] == pytest.approx(np.full(3, 0.5), abs=1e-9)


def test_the_side_that_is_seen_is_the_side_that_is_lit():
    light = ceiling(-0.5, 0.5, -0.5, 0.5, 2.0)
    under = Camera("orthographic", position=(0.0, -1.0, 0.0), target=(0.0, 0.0, 0.0), up=(0.0, 0.0, 1.0), height=2.0)
    assert draw(Scene("p", under, (surface(FLOOR),), lights=(light,)), (3, 3)).pixels.max() == 0.0
    turned = surface(FLOOR[::-1])
    a, b = (draw(Scene("p", DOWN, (f,), lights=(light,)), (3, 3)) for f in (surface(FLOOR), turned))
    assert a.pixels == pytest.approx(b.pixels, abs=1e-9)
    assert a.pixels.min() > 0.05


def test_a_wall_on_the_floor_lights_one_side_and_shades_the_other():
    # seen from above, the wall is a line; the light is far to one side of it
    wall = surface([(0.0, 0.0, -4.0), (0.0, 0.0, 4.0), (0.0, 3.0, 4.0), (0.0, 3.0, -4.0)])
    camera = replace(DOWN, position=(0.01, 5.0, 0.0), target=(0.01, 0.0, 0.0), height=0.4)
    scene = Scene("p", camera, (surface(FLOOR), wall), lights=(ceiling(1.0, 2.0, -1.0, 1.0, 2.5),))
    got = draw(scene, (8, 2))
    assert got.bound.max() < 1e-5
    assert got.pixels[:, :3].max() == 0.0
    assert got.pixels[:, 4:].min() > 0.05


def test_moving_things_shade_where_they_are():
    square = np.array([(-0.4, 0.6, -0.4), (0.4, 0.6, -0.4), (0.4, 0.6, 0.4), (-0.4, 0.6, 0.4)])
    light = ceiling(-0.5, 0.5, -0.5, 0.5, 2.0)
    moved = surface(square, motion=Motion(velocity=(3.0, 0.0, 0.0)))
    there = surface(square + np.array([0.3, 0.0, 0.0]))
    a = draw(Scene("p", DOWN, (surface(FLOOR), moved), lights=(light,)), (5, 5), frame=3)
    b = draw(Scene("p", DOWN, (surface(FLOOR), there), lights=(light,)), (5, 5))
    assert (np.abs(a.pixels - b.pixels) <= (a.bound + b.bound)[..., None]).all()


def test_a_surface_in_focus_looks_alike_from_every_point_of_a_lens():
    card = surface([(-1.0, 0.2, -1.0), (1.0, 0.2, -1.0), (1.0, 2.2, -1.0), (-1.0, 2.2, -1.0)], (0.9, 0.5, 0.2))
    quad = ((-1.0, 2.5, 2.0), (1.0, 2.5, 2.0), (1.0, 3.0, 1.0), (-1.0, 3.0, 1.0))
    for flat in (Camera("perspective", (0.0, 1.0, 4.0), (0.0, 1.0, 0.0), fov_y_deg=20.0),
                 Camera("orthographic", (0.0, 1.0, 4.0), (0.0, 1.0, 0.0), height=1.5)):  # fmt: skip
        scene = Scene("p", flat, (card,), lights=(Light(quad, (5.0, 5.0, 5.0)), Light(quad[::-1], (5.0, 5.0, 5.0))))
        view = view_at(flat, scene.animation, 0, 0.0, (5, 4))
        sheared = replace(
            view, origin=view.origin + 0.3 * view.right - 0.2 * view.up,
            right=view.right + 0.3 / 5.0 * view.forward, up=view.up - 0.2 / 5.0 * view.forward,
        )  # fmt: skip
        a, b = draw(scene, (5, 4), view=view), draw(scene, (5, 4), view=sheared)
        assert a.pixels.min() > 0.01
        assert (np.abs(a.pixels - b.pixels) <= (a.bound + b.bound)[..., None]).all()


@pytest.mark.parametrize(("name", "radius"), [("box", 0.5), ("tent", 1.0), ("mitchell", 2.0)])
def test_estimates_from_points_are_unbiased(name, radius):
    spec = make_filter(name, radius)
    scene = random_scene(5, lights=2)
    exact = draw(scene, (5, 4), spec)
    assert exact.bound.max() < 1e-5
    pictures = np.array([estimate(scene, (5, 4), spec, 32, seed) for seed in range(32)])
    error = pictures.std(axis=0, ddof=1) / 32**0.5
    # Student's t with 31 degrees of freedom over 60 values; a sliver that no point has met leaves no spread
    assert (np.abs(pictures.mean(axis=0) - exact.pixels) <= 5.5 * error + exact.bound[..., None] + 2e-4).all()
    assert error.max() < 0.01


def test_pictures_of_nothing_and_of_one_pixel():
    scene = random_scene(6)
    empty = replace(scene, objects=(), lights=())
    assert draw(empty, (1, 5)).pixels == pytest.approx(np.broadcast_to(scene.background, (5, 1, 3)), abs=1e-12)
    one, many = draw(scene, (1, 1)), draw(scene, (4, 4))
    assert (np.abs(one.pixels[0, 0] - many.pixels.mean(axis=(0, 1))) <= one.bound.max() + many.bound.mean()).all()
