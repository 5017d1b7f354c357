"""What turns about one point has its open shutter in closed form: against brute force, quadrature and the harmonics."""

import numpy as np
import pytest
from scipy.integrate import quad

from aliasbench.renderers.catalog import render
from aliasbench.renderers.reference.faces import build_faces
from aliasbench.renderers.reference.flat import draw_instant, palette
from aliasbench.renderers.reference.moving import draw_panels, draw_shutter
from aliasbench.renderers.reference.paths import scene_paths
from aliasbench.renderers.reference.turning import find_rotor
from aliasbench.renderers.sampling.filters import make_filter
from aliasbench.scenes.catalog import SCENES
from aliasbench.scenes.model import Camera, Motion, Spin


def cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def spinning(rate, axis=(0, 0, 1), center=(0, 0, 0)):
    return Motion(spin=Spin(axis, center, rate))


def closed_form(scene, size, frame=0):
    """Return the integral, having checked that it is the closed form."""
    faces, paths = build_faces(scene), scene_paths(scene)
    assert find_rotor(scene, faces, paths, size, frame, palette(scene)) is not None
    return draw_shutter(scene, faces, paths, size, frame, make_filter("box", 0.5))


def is_closed_form(scene, size=(16, 16)):
    return find_rotor(scene, build_faces(scene), scene_paths(scene), size, 0, palette(scene)) is not None


def assert_agrees_with_panels(scene, size, frame=0):
    integral = closed_form(scene, size, frame)
    spec = make_filter("box", 0.5)
    brute = draw_panels(scene, build_faces(scene), scene_paths(scene), size, frame, spec, 1e-4)
    error = np.abs(integral.pixels - brute.pixels).max(axis=2)
    assert (error <= integral.bound + brute.bound).all()
    assert integral.pixels.max() - integral.pixels.min() > 0.05
    assert integral.bound.max() < 1e-8
    return float(error.max())


def random_scene(rng, make_polygon, make_scene):
    """Return a scene of one to four convex polygons of one turn, which may cover one another."""
    center = (*rng.uniform(-0.4, 0.4, 2), 0.0)
    motion = spinning(float(rng.choice([0.7, -7.3, 31.0, -120.0])), (0, 0, float(rng.choice([1, -2]))), center)
    objects = []
    for depth in rng.permutation(4)[: rng.integers(1, 5)] * 0.1:
        angles = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, 7)))
        radius, middle = rng.uniform(0.05, 0.6), rng.uniform(-0.5, 0.5, 2)
        points = np.c_[middle + radius * np.c_[np.cos(angles), np.sin(angles)], np.full(len(angles), depth)]
        objects.append(make_polygon(points, tuple(rng.uniform(0, 1, 3)), motion=motion))
    return make_scene(objects, background=(0.2, 0.1, 0.0), shutter=float(rng.uniform(0.05, 1)))


@pytest.mark.parametrize("seed", range(24))
def test_random_patterns_agree_with_panels(make_polygon, make_scene, seed):
    rng = np.random.default_rng(seed)
    scene = random_scene(rng, make_polygon, make_scene)
    size = tuple(rng.integers(5, 20, 2).tolist())
    assert_agrees_with_panels(scene, size, int(rng.integers(0, 40)))


@pytest.mark.parametrize("seed", range(12))
def test_small_turns_agree_with_panels(make_polygon, make_scene, seed):
    # a slow turn moves a pixel's edges by a few pixels: 1500 middles are good to 1e-4
    rng = np.random.default_rng(100 + seed)
    motion = spinning(float(rng.uniform(0.5, 1.5)), center=(0.1, -0.2, 0.0))
    corners = rng.uniform(0.3, 0.8, 3)[:, None] * np.c_[np.cos(a := np.arange(3) * 2.1), np.sin(a)]
    shape = make_polygon(corners, motion=motion)
    assert assert_agrees_with_panels(make_scene([shape], shutter=0.6), (12, 12)) < 1e-4


@pytest.mark.parametrize("turns", [1, 2, 100])
def test_whole_turns_leave_rings(make_polygon, make_scene, turns):
    # a disc's share of each circle, averaged over the pixel by an independent integral
    shape = make_polygon([(0.2, -0.3), (0.7, -0.1), (0.5, 0.4)], motion=spinning(turns * 30.0))
    scene, size = make_scene([shape], shutter=1.0), (16, 16)
    integral = closed_form(scene, size)
    outline = np.array([(0.2, -0.3), (0.7, -0.1), (0.5, 0.4)]) * 8

    def share(r):
        crossings = []
        for p, q in zip(outline, np.roll(outline, -1, axis=0), strict=True):
            d = q - p
            roots = np.roots([d @ d, 2 * p @ d, p @ p - r * r])
            crossings += [np.arctan2(*(p + t.real * d)[::-1]) for t in roots if abs(t.imag) < 1e-9 and 0 <= t.real < 1]
        ends = np.sort(crossings)
        total = 0.0
        for a, b in zip(ends, np.append(ends[1:], ends[:1] + 2 * np.pi), strict=True):
            m = r * np.array([np.cos((a + b) / 2), np.sin((a + b) / 2)])
            following = np.roll(outline, -1, axis=0)
            sides = cross(following - outline, m - outline)
            total += (b - a) * bool((sides > 0).all())
        return total / (2 * np.pi)

    knots = np.sort(np.r_[np.hypot(*outline.T), np.hypot(4, 1), np.hypot(4, 2), np.hypot(5, 1), np.hypot(5, 2)])

    def arc(r):
        # of the pixel [4, 5] x [1, 2] above and to the right of the hub
        low = max(np.arcsin(1 / r), np.arccos(min(1.0, 5 / r)))
        return max(0.0, min(np.arccos(4 / r), np.arcsin(min(1.0, 2 / r))) - low)

    expected = quad(lambda r: share(r) * arc(r) * r, np.hypot(4, 1), np.hypot(5, 2), points=knots[3:-1], limit=400)[0]
    assert integral.pixels[6, 12, 0] == pytest.approx(expected, abs=1e-7)
    # every ring is the same all round: mirrored pixels are equal
    assert np.abs(integral.pixels - integral.pixels[::-1, ::-1]).max() < 1e-9
    assert np.abs(integral.pixels - integral.pixels.transpose(1, 0, 2)).max() < 1e-9


@pytest.mark.parametrize(("blades", "rate", "shutter"), [(3, 29.0, 0.5), (2, 1.0, 0.1), (20, 100.0, 1.0)])
def test_radial_blades_blur_to_the_trapezoid_of_their_angle(make_polygon, make_scene, blades, rate, shutter):
    duty, objects = 0.4, []
    for b in range(blades):
        a = 2 * np.pi * (b + np.linspace(0, duty, 4)) / blades + 0.3
        rim = 3 * np.c_[np.cos(a), np.sin(a)]
        objects.append(make_polygon([(0, 0), *rim], motion=spinning(rate)))
    integral = closed_form(make_scene(objects, shutter=shutter), (32, 32))
    sweep = rate / 30 * shutter * blades

    def bright(t):
        return np.floor(t) * duty + np.minimum(t - np.floor(t), duty)

    nodes, weights = np.polynomial.legendre.leggauss(20)
    for row, column in ((3, 20), (16, 2), (15, 2), (28, 11)):
        # in small squares: Gauss-Legendre is spoilt only where a kink of the trapezoid passes
        k = 40
        grid = ((np.arange(k)[:, None] + 0.5 + nodes / 2) / k).ravel()
        y, x = np.meshgrid(16 - row - grid, column + grid - 16, indexing="ij")
        phase = (np.arctan2(y, x) - 0.3) / (2 * np.pi) * blades
        w = np.tile(weights / 2 / k, k)
        expected = w @ ((bright(phase) - bright(phase - sweep)) / sweep) @ w
        assert integral.pixels[row, column, 0] == pytest.approx(expected, abs=2e-6)


def test_the_hub_may_lie_on_corners_sides_and_edges(make_polygon, make_scene):
    for center in ((0.0, 0.0, 0.0), (0.125, 0.0, 0.0), (0.0625, 0.0625, 0.0)):
        for points in (
            [(-0.5, 0), (0.5, 0), (0, 0.6)],
            [(0, 0), (0.5, 0.1), (0.2, 0.4)],
            [(-0.5, -0.4), (0.6, 0), (0, 0.7)],
        ):
            moved = np.array(points) + center[:2]
            scene = make_scene([make_polygon(moved, motion=spinning(7.0, center=center))], shutter=0.9)
            assert_agrees_with_panels(scene, (16, 16))


def test_parts_add_up_to_the_whole(make_polygon, make_scene):
    motion = spinning(17.0, center=(0.1, 0.05, 0))
    star = [(0.6, 0), (0.1, 0.1), (0, 0.6), (-0.1, 0.1), (-0.6, 0), (-0.1, -0.1), (0, -0.6), (0.1, -0.1)]
    inside = [[0, 1, 7], [2, 3, 1], [4, 5, 3], [6, 7, 5], [1, 3, 5], [1, 5, 7]]
    whole = closed_form(make_scene([make_polygon(star, triangles=inside, motion=motion)], shutter=0.7), (20, 14))
    parts = [make_polygon([star[i] for i in t], motion=motion) for t in inside]
    summed = closed_form(make_scene(parts, shutter=0.7), (20, 14))
    assert np.abs(whole.pixels - summed.pixels).max() < 1e-9
    # light is neither lost nor made: the star stays in the picture
    area = sum(abs(cross(*(np.array([star[t[1]], star[t[2]]]) - star[t[0]]))) / 2 for t in inside)
    assert whole.pixels[:, :, 0].sum() == pytest.approx(area * 49, abs=1e-7)


def test_perspective_turn_is_the_orthographic_one_at_its_distance(make_polygon, make_scene):
    shape = make_polygon([(0.1, 0.02), (0.8, 0.1), (0.75, 0.4)], motion=spinning(12.0))
    flat = closed_form(make_scene([shape], shutter=0.5), (16, 16))
    camera = Camera("perspective", fov_y_deg=float(np.degrees(2 * np.arctan(1 / 5))))
    deep = closed_form(make_scene([shape], camera=camera, shutter=0.5), (16, 16))
    assert np.abs(flat.pixels - deep.pixels).max() < 1e-9


def test_of_coplanar_parts_the_later_object_is_seen_whatever_rounding_says(make_polygon, make_scene):
    motion = spinning(2.2, center=(-0.03, 0.12, 0.0))
    rng = np.random.default_rng(4)
    for _ in range(6):
        rounds = [np.sort(rng.uniform(0, 2 * np.pi, n)) for n in (7, 5, 3)]
        parts = [
            make_polygon(np.c_[0.5 * np.cos(a), 0.5 * np.sin(a), np.full(len(a), 0.1)], tuple(c), motion=motion)
            for a, c in zip(rounds, np.eye(3), strict=True)
        ]
        assert_agrees_with_panels(make_scene(parts, shutter=0.8), (3, 4))


def test_backdrop_and_still_neighbours(make_polygon, make_scene):
    shape = make_polygon([(0.1, 0.02), (0.5, 0.1), (0.4, 0.3)], (1, 0, 0), motion=spinning(12.0))
    wall = make_polygon([(-2, -2, -1), (2, -2, -1), (2, 2, -1), (-2, 2, -1)], (0, 0.5, 1))
    sign = make_polygon([(0.6, 0.6, 1), (0.9, 0.7, 1), (0.7, 0.9, 1)], (1, 1, 0))
    assert_agrees_with_panels(make_scene([shape, wall, sign], shutter=0.5), (17, 16))
    front = make_polygon([(-2, -2, 1), (2, -2, 1), (2, 2, 1), (-2, 2, 1)], (0, 0.5, 1))
    near = make_polygon([(0.3, 0.3, -1), (0.9, 0.7, -1), (0.7, 0.9, -1)], (1, 1, 0))
    assert not is_closed_form(make_scene([shape, front], shutter=0.5))
    assert not is_closed_form(make_scene([shape, near], shutter=0.5))


def test_other_motions_are_left_to_panels(make_polygon, make_scene):
    points = [(0.1, 0.02), (0.5, 0.1), (0.4, 0.3)]

    def one(motion, **kwargs):
        return make_scene([make_polygon(points, motion=motion)], shutter=0.5, **kwargs)

    assert is_closed_form(one(spinning(2.0)))
    assert not is_closed_form(one(spinning(2.0, axis=(0, 1, 1))))
    assert not is_closed_form(one(Motion((1.0, 0, 0))))
    assert not is_closed_form(one(Motion((1.0, 0, 0), Spin((0, 0, 1), (0, 0, 0), 2.0))))
    assert not is_closed_form(one(spinning(2.0), camera=Camera("orthographic", height=2.0, velocity=(0.1, 0, 0))))
    assert not is_closed_form(one(spinning(1e-10)))
    two = [make_polygon(points, motion=spinning(r)) for r in (2.0, 3.0)]
    assert not is_closed_form(make_scene(two, shutter=0.5))


def test_a_barely_turning_blade_is_its_instant(make_polygon, make_scene):
    scene = make_scene([make_polygon([(0.1, 0.02), (0.5, 0.1), (0.4, 0.3)], motion=spinning(1e-5))], shutter=0.5)
    integral = closed_form(scene, (16, 16))
    instant = draw_instant(scene, build_faces(scene), scene_paths(scene), (16, 16), 0, 0.25).pixels
    # the edges move by less than 1e-5 pixels
    assert np.abs(integral.pixels - instant).max() <= 1e-5
    assert integral.bound.max() < 1e-6


@pytest.mark.parametrize(
    ("rate", "shutter", "amplitude"),
    [(29.0, 0.0, 0.3183099), (29.0, 0.5, 0.0690164), (29.0, 1.0, 0.0107965), (30.0, 0.5, 0.0675475), (30.0, 1.0, 0.0)],
)
def test_first_harmonic_of_the_propeller_is_attenuated_by_the_shutter(rate, shutter, amplitude):
    scene = SCENES["propeller"].build(blades=3, rev_per_s=rate, shutter=shutter)
    n = 128
    frame = render(scene, "reference:", size=(n, n))
    assert frame.uncertainty is not None
    assert frame.uncertainty < 1e-8
    fact = scene.facts.rotors[0]
    scale = n / scene.camera.height
    y, x = np.meshgrid(n / 2 - np.arange(n) - 0.5, np.arange(n) + 0.5 - n / 2, indexing="ij")
    rho = (np.hypot(x, y) / scale - fact.inner) / (fact.outer - fact.inner)
    weight = np.where((rho > 0) & (rho < 1), np.sin(np.pi * rho) ** 4, 0.0)
    weight /= weight.sum()
    harmonic = abs((weight * frame.pixels[:, :, 0] * np.exp(-3j * np.arctan2(y, x))).sum())
    # the pixel takes (m / r)^2 / 24 of the harmonic, a few parts in a thousand
    assert harmonic == pytest.approx(amplitude, rel=4e-3, abs=1e-7)
