"""Gloss, glass and one diffuse reflection against independent truths: furnaces, optics and quadrature.

In a furnace all directions are as bright, so that a picture shows energy alone. Slabs and prisms are compared with what
Fresnel's and Snell's laws say of each path. What one wall adds to another is integrated over the wall, whose own light
is Lambert's closed form.
"""

import math
from dataclasses import replace
from functools import cache
from typing import Literal

import numpy as np
import pytest
from scipy import integrate, stats

from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.raytrace.scattering import cauchy, ggx_brdf, index_at, spectral_weights, wavelength_of
from aliasbench.scenes.dispersion_prism import FRONT_Z, HALF_WIDTH, SCREEN_Z, SLIT_WIDTH, landing, thickness
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import Camera, Checker, FloatArray, Light, Material, Motion, Scene, Surface, Vec3
from aliasbench.scenes.shapes import polygon

SAMPLERS = ("random", "jittered", "multijittered", "sobol", "bluenoise")
WHITE, BLACK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
FAR = 500.0


def sample(scene: Scene, technique: str, size: tuple[int, int], seeds: int) -> FloatArray:
    """Return pictures (seeds, h, w, 3)."""
    with prepare(scene, technique, size=size) as prepared:
        return np.array([prepared.render(0, seed).pixels for seed in range(seeds)], dtype=np.float64)


def assert_mean(values: FloatArray, truth: float, spread: float, slack: float = 0.0) -> None:
    """Assert that the mean over seeds (n,) is `truth` and known to `spread`; a right one fails once in 10 000 times."""
    error = float(values.std(ddof=1)) / math.sqrt(len(values))
    assert error <= spread
    off = abs(values.mean() - truth) - slack
    assert off <= stats.t.ppf(1 - 5e-5, len(values) - 1) * error + 1e-7, f"{values.mean():.6f} is not {truth:.6f}"


def surface(points: object, color: Vec3 = WHITE, material: Material | None = None) -> Surface:
    return polygon(points, color=color, material=material or Material())  # type: ignore[arg-type]


def level(y: float, half: float = FAR, *, up: bool = True) -> list[tuple[float, float, float]]:
    """Return a square at a height, wound to be seen from above or from below."""
    corners = [(-half, y, half), (half, y, half), (half, y, -half), (-half, y, -half)]
    return corners if up else corners[::-1]


def looking_down(angle_deg: float, *, distance: float = 4.0, height: float = 0.5, target: Vec3 = BLACK) -> Camera:
    """Return a camera with parallel rays that meet the ground at an angle to its normal, coming from +x."""
    a = math.radians(angle_deg)
    x, y, z = target
    place = (x + distance * math.sin(a), y + distance * math.cos(a), z)
    return Camera("orthographic", position=place, target=target, up=(0.0, 0.0, -1.0), height=height)


# Gloss


def albedo(alpha: float, angle_deg: float) -> float:
    """Return the share that a white glossy surface reflects, by quadrature of the BRDF over halfway vectors.

    tan(theta_m) = alpha tan(psi) spreads the lobe evenly; d omega_o = 4 (i . m) d omega_m.
    """
    a = math.radians(angle_deg)
    i = np.array([math.sin(a), 0.0, math.cos(a)])

    def integrand(psi: float, phi: float) -> float:
        slope = alpha * math.tan(psi)
        cos = 1 / math.sqrt(1 + slope * slope)
        sin = slope * cos
        m = np.array([sin * math.cos(phi), sin * math.sin(phi), cos])
        seen = float(i @ m)
        o = 2 * seen * m - i
        if seen <= 0 or o[2] <= 0:
            return 0.0
        solid = sin * cos**2 * alpha / math.cos(psi) ** 2
        return float(ggx_brdf(alpha, 0.0, 0.0, 1.0, *i, *o)) * o[2] * 4 * seen * solid

    value, error = integrate.dblquad(integrand, 0, math.pi, 0, math.pi / 2 - 1e-9, epsabs=2e-4, epsrel=0)
    assert error < 4e-4
    return 2 * float(value)


@pytest.mark.parametrize("angle", [0.0, 50.0, 80.0])
@pytest.mark.parametrize(("alpha", "sampler"), [(0.3, "jittered"), (0.6, "random"), (1.0, "sobol")])
def test_a_glossy_surface_in_a_furnace_shows_its_albedo(alpha: float, sampler: str, angle: float) -> None:
    color = (0.9, 0.5, 1.0)
    ground = surface(level(0.0), color, Material("glossy", roughness=alpha))
    truth = albedo(alpha, angle)
    assert truth < 0.995
    for side in (1, -1):
        camera = looking_down(angle)
        if side < 0:
            x, y, z = camera.position
            camera = replace(camera, position=(x, -y, z))
        scene = Scene("furnace", camera, (ground,), background=WHITE)
        pictures = sample(scene, f"raytrace:spp=128,sampler={sampler}", (8, 8), 16)
        for channel, share in enumerate(color):
            assert_mean(pictures[..., channel].mean(axis=(1, 2)) / share, truth, 0.002, slack=4e-4)


@pytest.mark.parametrize("angle", [0.0, 40.0, 75.0])
def test_the_smoothest_surface_in_a_furnace_reflects_all(angle: float) -> None:
    scene = Scene("mirror", looking_down(angle), (surface(level(0.0), WHITE, Material("glossy", roughness=0.001)),),
                  background=WHITE)  # fmt: skip
    pictures = sample(scene, "raytrace:spp=64,sampler=random", (8, 8), 8)
    # Facets that turn the ray into the surface have a slope of k alpha with 2 k alpha > cos(angle), a share
    # 1 / (1 + k^2) of them, 6e-5 at 75 degrees; of the others a few 1e-5 is lost (`test_scattering`).
    assert pictures.max() <= 1.0
    assert pictures.mean() > 1.0 - 2e-4


def test_a_mirror_shows_the_mirrored_things_at_the_mirrored_place() -> None:
    # Things over the ground, seen in it; and, without the ground, the things below it that they are mirrored to.
    shapes = [
        [(-0.8, 0.2, 0.3), (0.4, 0.1, -0.2), (0.5, 1.2, -0.4), (-0.7, 1.3, 0.1)],
        [(0.3, 0.3, 0.6), (1.3, 0.2, 0.1), (0.9, 1.0, 0.3)],
    ]
    colors = ((1.0, 0.4, 0.1), (0.2, 0.9, 0.5))
    camera = Camera("perspective", position=(0.2, 2.6, 3.5), target=(0.1, -0.9, -0.1), fov_y_deg=26.0)
    things = [surface(s, c) for s, c in zip(shapes, colors, strict=True)]
    turned = [surface([(x, -y, z) for x, y, z in s], c) for s, c in zip(shapes, colors, strict=True)]
    technique, size = "raytrace:spp=16,sampler=multijittered", (40, 30)
    expected = render(Scene("below", camera, tuple(turned), background=(0.1, 0.2, 0.3)), technique, size=size).pixels
    hidden = render(Scene("above", camera, tuple(things), background=(0.1, 0.2, 0.3)), technique, size=size).pixels
    clear = (np.abs(hidden - np.float32([0.1, 0.2, 0.3])) < 1e-6).all(axis=2)
    assert clear.mean() > 0.6
    assert (expected.max(axis=2) > 0.35)[clear].sum() > 100
    off = {}
    for roughness in (1e-6, 0.001):
        # no wider than it must be: rays start off a surface by a share of its coordinates
        ground = surface(level(0.0, 9.0), WHITE, Material("glossy", roughness=roughness))
        scene = Scene("mirror", camera, (*things, ground), background=(0.1, 0.2, 0.3))
        picture = render(scene, technique, size=size).pixels
        np.testing.assert_array_equal(picture[~clear][hidden[~clear] == 1.0], hidden[~clear][hidden[~clear] == 1.0])
        off[roughness] = np.abs(picture - expected).max(axis=2)[clear]
    # A ray in thousands passes an edge closer than the lobe's millionth and float32 tell.
    assert (off[1e-6] > 1e-4).sum() <= 4
    # At .001 facets lean by k alpha with probability 1 / (1 + k^2): over 2 m way that moves the hit by 4 k mm, a pixel
    # being 60 mm wide: a row of pixels along the edges differs by some hundredths, the median not at all.
    assert np.median(off[0.001]) < 1e-3
    assert off[0.001].mean() < 0.02


def test_a_glossy_colour_multiplies_with_each_reflection() -> None:
    # Between two parallel mirrors a ray comes out after a known number of reflections.
    mirror = Material("glossy", roughness=1e-6)
    left = surface([(-0.5, 0.0, -9.0), (-0.5, 0.0, 9.0), (-0.5, 3.0, 9.0), (-0.5, 3.0, -9.0)], (0.5, 0.8, 0.9), mirror)
    right = surface([(0.5, 0.0, -9.0), (0.5, 0.0, 9.0), (0.5, 3.0, 9.0), (0.5, 3.0, -9.0)], (0.9, 0.5, 0.7), mirror)
    # From (0, 4) down, one to the right in one down: it meets x = .5 at y = 3.5, over the mirrors' top; start lower.
    camera = Camera(
        "orthographic", position=(-0.45, 3.2, 0.0), target=(0.5, 2.25, 0.0), up=(0.0, 0.0, -1.0), height=0.05
    )
    scene = Scene("hall", camera, (left, right), background=WHITE)
    picture = render(scene, "raytrace:spp=4,sampler=jittered", size=(4, 4)).pixels
    # right at 2.25, left at 1.25, right at 0.25, and out
    expected = np.float32([0.9 * 0.5 * 0.9, 0.5 * 0.8 * 0.5, 0.7 * 0.9 * 0.7])
    np.testing.assert_allclose(picture, np.broadcast_to(expected, (4, 4, 3)), rtol=1e-4)


# Glass


def fresnel_share(angle_deg: float, index: float) -> float:
    """Return the unpolarised reflected share by Fresnel's sine and tangent laws, entering glass of an index."""
    if angle_deg == 0.0:
        return ((index - 1) / (index + 1)) ** 2
    i = math.radians(angle_deg)
    t = math.asin(math.sin(i) / index)
    return 0.5 * ((math.sin(i - t) / math.sin(i + t)) ** 2 + (math.tan(i - t) / math.tan(i + t)) ** 2)


def slab(thickness: float, index: float) -> tuple[Surface, Surface]:
    """Return two faces of a slab below y = 0, wound outwards, too wide to have others."""
    glass = Material("glass", ior=index)
    return surface(level(0.0), WHITE, glass), surface(level(-thickness, up=False), WHITE, glass)


@pytest.mark.parametrize("index", [1.5, 1.8])
@pytest.mark.parametrize("angle", [0.0, 40.0, 70.0])
@pytest.mark.parametrize("sampler", ["random", "sobol"])
def test_a_slab_of_glass_parts_the_light_as_fresnel_says(index: float, angle: float, sampler: str) -> None:
    # (1 - R)^2 (1 + R^2 + R^4 ...) goes through: (1 - R) / (1 + R).
    share = fresnel_share(angle, index)
    faces = slab(0.1, index)
    below, above = surface(level(-30.0)), surface(level(30.0))
    for target, truth in ((below, (1 - share) / (1 + share)), (above, 2 * share / (1 + share))):
        scene = Scene("slab", looking_down(angle), (*faces, target))
        pictures = sample(scene, f"raytrace:spp=128,sampler={sampler}", (8, 8), 16)
        np.testing.assert_array_equal(pictures[..., 0], pictures[..., 2])
        assert_mean(pictures[..., 0].mean(axis=(1, 2)), truth, 0.0025)
    furnace = render(
        Scene("furnace", looking_down(angle), faces, background=(0.25, 1.0, 3.0)), "raytrace:spp=64", size=(8, 8)
    )
    np.testing.assert_array_equal(furnace.pixels, np.broadcast_to(np.float32([0.25, 1.0, 3.0]), (8, 8, 3)))


def test_a_slab_shifts_what_is_seen_through_it() -> None:
    # On the plane below, thickness (tan i - tan t) nearer to the viewer; light that is reflected twice inside, a share
    # R^2 of it, by 2 thickness tan t farther on, and so on.
    index, angle, thickness, size = 1.6, 55.0, 0.4, (48, 4)
    i = math.radians(angle)
    t = math.asin(math.sin(i) / index)
    share = fresnel_share(angle, index)
    depth = 1.0
    # The middle ray would meet the plane y = -depth at x = -depth tan i.
    straight = -depth * math.tan(i)
    passed = straight + thickness * (math.tan(i) - math.tan(t))
    field = [(-FAR, -depth, FAR), (passed, -depth, FAR), (passed, -depth, -FAR), (-FAR, -depth, -FAR)]
    camera = looking_down(angle, height=0.25)
    scene = Scene("shift", replace(camera, up=(0.0, 0.0, -1.0)), (*slab(thickness, index), surface(field)))
    pictures = sample(scene, "raytrace:spp=256,sampler=sobol", size, 16)
    # The picture's x is the direction along which rays meet the ground at growing or falling x; a pixel is 1/16 of its
    # height wide, and 1 / cos i as wide on the ground.
    view = render(Scene("no glass", camera, (surface(field),)), "raytrace:", size=size).pixels[..., 0]
    sign = 1.0 if view[0, 0] < view[0, -1] else -1.0
    pixel = 0.25 / 4 / math.cos(i)
    borders = (np.arange(49) - 24) * pixel
    truth = np.zeros(48)
    for k in range(6):
        # right of which place along the picture the field is seen by light of k detours
        weight = (1 - share) ** 2 * share ** (2 * k)
        edge = 2 * k * thickness * math.tan(t)
        covered = np.maximum(borders + edge, 0.0) if sign > 0 else np.minimum(borders, 0.0)
        truth += weight * np.diff(covered) / pixel
    mean = pictures[..., 0].mean(axis=0)
    error = pictures[..., 0].std(axis=0, ddof=1) / 4
    assert np.sqrt((error**2).mean()) < 0.01
    limit = stats.t.ppf(1 - 1e-4 / 400, 15) * error + 14 / (256 * 16)
    assert (np.abs(mean - truth) <= limit).all(), np.abs(mean - truth).max()
    # Where the step is, to a fraction of a pixel.
    sums = pictures[..., 0].mean(axis=1).sum(axis=1)
    assert_mean(sums, float(truth.sum()), 0.02)


PRISM = 28.0, 1.728


def prism_scene(abbe: float | None, *, width: float = 0.3) -> Scene:
    """Return the slit alone behind the catalog's wedge, seen from near."""
    angle, index = PRISM
    scene = load_scene(f"dispersion-prism:angle={angle!r},ior={index!r},abbe={abbe or 100.0!r}")
    kept = [o for o in scene.objects if o.name == "slit" or o.name.startswith("wedge")]
    assert len(kept) == 7
    if abbe is None:
        kept = [replace(o, material=replace(o.material, abbe=None)) for o in kept]
    camera = replace(scene.camera, position=(0.0, -0.15, 5.0), target=(0.0, -0.15, 0.0), height=width * 4 / 48)
    return replace(scene, camera=camera, objects=tuple(kept))


@cache
def slit_lift() -> float:
    """Return how far the slit is before the screen."""
    slit = next(o for o in prism_scene(None).objects if o.name == "slit")
    return float(slit.vertices[0, 2]) - SCREEN_Z


def place_on_slit(x: float, index: float) -> float:
    """Return where a ray of the camera meets the plane of the slit."""
    angle, _ = PRISM
    bent = math.asin(index * math.sin(math.radians(angle))) - math.radians(angle)
    return landing(x, angle, index) - slit_lift() * math.tan(bent)


@cache
def band(abbe: float, size: int, width: float) -> FloatArray:
    """Return red, green and blue (size, 3) of the slit seen through the wedge, by following rays in the plane.

    In front at a right angle; then at each side that a ray meets Fresnel's share stays inside, mirrored, and the rest
    leaves by Snell's law, onto the slit or past it. Nothing comes back into a convex body.
    """
    angle, ior = PRISM
    count, fine = 500, 8
    low, high = -HALF_WIDTH, HALF_WIDTH
    front, thin, thick = FRONT_Z, FRONT_Z - thickness(low, angle), FRONT_Z - thickness(high, angle)
    corners = [(low, front), (low, thin), (high, thick), (high, front)]
    a, b = cauchy(ior, abbe)
    random = (np.arange(count) + 0.5) / count
    index = np.array([index_at(a, b, wavelength_of(w)) for w in random])
    weights = np.array([spectral_weights(w) for w in random])
    slit_z, slit_x = SCREEN_Z + slit_lift(), landing(0.0, angle, ior)

    place = np.zeros((size * fine, count, 2))
    place[..., 0] = (((np.arange(size * fine) + 0.5) / (size * fine) - 0.5) * width)[:, None]
    place[..., 1] = FRONT_Z
    direction = np.zeros_like(place)
    direction[..., 1] = -1.0
    share = np.broadcast_to(1 - ((index - 1) / (index + 1)) ** 2, place.shape[:2]).copy()
    seen = np.zeros(place.shape[:2])
    for _ in range(12):
        reach, normal = np.full(share.shape, np.inf), np.zeros_like(place)
        for k in range(4):
            (x0, z0), (x1, z1) = corners[k], corners[(k + 1) % 4]
            # counter-clockwise with x to the right and z up: outwards is to the right of the way
            outwards = np.array([z1 - z0, x0 - x1]) / math.hypot(x1 - x0, z1 - z0)
            towards = direction @ outwards
            with np.errstate(divide="ignore", invalid="ignore"):
                distance = ((np.array([x0, z0]) - place) @ outwards) / towards
            nearer = (towards > 1e-12) & (distance < reach)
            reach, normal = np.where(nearer, distance, reach), np.where(nearer[..., None], outwards, normal)
        place = place + reach[..., None] * direction
        inner = np.clip((direction * normal).sum(axis=-1), 0.0, 1.0)
        tangent = direction - inner[..., None] * normal
        sine = index * np.sqrt(1 - inner**2)
        outer = np.sqrt(np.maximum(1 - sine**2, 0.0))
        # perpendicular and parallel amplitudes from the cosines, all reflected beyond the critical angle
        across = ((index * inner - outer) / (index * inner + outer)) ** 2
        along = ((index * outer - inner) / (index * outer + inner)) ** 2
        back = np.where(sine < 1.0, (across + along) / 2, 1.0)
        out = index[:, None] * tangent + outer[..., None] * normal
        with np.errstate(divide="ignore", invalid="ignore"):
            x = place[..., 0] + out[..., 0] / out[..., 1] * (slit_z - place[..., 1])
        seen += share * (1 - back) * ((out[..., 1] < 0.0) & (np.abs(x - slit_x) < SLIT_WIDTH / 2))
        share, direction = share * back, direction - 2 * inner[..., None] * normal
    return (seen @ weights / count).reshape(size, fine, 3).mean(axis=1)


@pytest.mark.parametrize(("abbe", "width"), [(28.4, 0.3), (18.0, 0.48)])
@pytest.mark.parametrize("sampler", ["random", "sobol", "jittered"])
def test_a_prism_draws_a_slit_out_into_its_spectrum(abbe: float, width: float, sampler: str) -> None:
    columns, seeds = 48, 24
    truth = band(abbe, columns, width)
    pictures = sample(prism_scene(abbe, width=width), f"raytrace:spp=256,sampler={sampler}", (columns, 4), seeds)
    profiles = pictures.mean(axis=1)
    error = profiles.std(axis=0, ddof=1) / math.sqrt(seeds)
    # Weights are up to 3, the slit's share of a pixel up to 1.
    assert np.sqrt((error**2).mean()) < 1.5 / math.sqrt(256 * 4 * seeds)
    limit = stats.t.ppf(1 - 1e-4 / 300, seeds - 1) * error + 14 * 3 / (256 * 4 * seeds)
    # 500 wavelengths and 8 places to a pixel count the band's borders to 2e-3 (as twice as many of both say).
    assert (np.abs(profiles.mean(axis=0) - truth) <= limit + 2e-3).all()
    # Each channel's energy and centroid: pixels are 1/160 or 1/100 wide.
    places = np.arange(columns) + 0.5
    centroids = (truth * places[:, None]).sum(axis=0) / truth.sum(axis=0)
    assert abs(centroids[0] - centroids[2]) > 8.0
    for channel in range(3):
        energy = float(truth[:, channel].sum())
        parts = profiles[..., channel]
        assert_mean(parts.sum(axis=1) / energy, 1.0, 0.008, slack=1e-3)
        assert_mean((parts * (places - centroids[channel])).sum(axis=1) / energy, 0.0, 0.06, slack=0.01)


def test_a_glass_without_dispersion_leaves_everything_grey() -> None:
    angle, ior = PRISM
    picture = render(prism_scene(None), "raytrace:spp=64,sampler=sobol", size=(48, 4)).pixels
    np.testing.assert_array_equal(picture[..., 0], picture[..., 1])
    np.testing.assert_array_equal(picture[..., 0], picture[..., 2])
    # The slit is as wide as it is, seen magnified, around the middle where it was put.
    slope = place_on_slit(1.0, ior) - place_on_slit(0.0, ior)
    middle = 24.0 + (landing(0.0, angle, ior) - place_on_slit(0.0, ior)) / slope / (0.3 / 48)
    inner, outer = math.radians(angle), math.asin(ior * math.sin(math.radians(angle)))
    lost = fresnel_share(math.degrees(outer), ior)
    assert math.sin(outer) == pytest.approx(ior * math.sin(inner))
    through = (1 - ((ior - 1) / (ior + 1)) ** 2) * (1 - lost)
    profile = picture[..., 0].mean(axis=0)
    assert profile.sum() == pytest.approx(through * SLIT_WIDTH / slope / (0.3 / 48), rel=0.03)
    assert (profile * (np.arange(48) + 0.5)).sum() / profile.sum() == pytest.approx(middle, abs=0.03)
    coloured = render(prism_scene(28.4), "raytrace:spp=64,sampler=sobol", size=(48, 4)).pixels
    assert np.abs(coloured[..., 0] - coloured[..., 2]).max() > 0.1


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_dispersion_leaves_white_white(sampler: str) -> None:
    scene = prism_scene(12.0)
    scene = replace(scene, objects=tuple(o for o in scene.objects if o.name != "slit"), background=(1.0, 0.5, 0.25))
    pictures = sample(scene, f"raytrace:spp=64,sampler={sampler}", (12, 4), 24)
    for channel, value in enumerate((1.0, 0.5, 0.25)):
        # Red and blue are 3 over a sixth and fall to 0 over a third: a variance of 9 (1 / 6 + 1 / 9) - 1 = 1.5 a
        # sample, of which 24 seeds tell the deviation to a seventh.
        assert_mean(pictures[..., channel].mean(axis=(1, 2)) / value, 1.0, 1.5 * math.sqrt(1.5 / (64 * 48 * 24)))
    if sampler != "random":
        # Wavelengths are strata: 64 of them leave next to nothing of the colour noise.
        assert pictures.std(axis=0, ddof=1).max() < 0.1


@pytest.mark.parametrize(("index", "is_total"), [(1.5, True), (1.9, True), (1.3, False)])
def test_beyond_the_critical_angle_all_light_is_reflected(index: float, is_total: bool) -> None:
    # A right-angled prism: in through the front (z = 0), at 45 degrees to the slanted side from (0, 0) to (1, -1), and
    # out through the right (x = 1). Both legs are met at a right angle, where R0 is reflected to and fro.
    glass = Material("glass", ior=index)
    sides = [
        [(0, -9, 0), (1, -9, 0), (1, 9, 0), (0, 9, 0)],
        [(1, -9, 0), (1, -9, -1), (1, 9, -1), (1, 9, 0)],
        [(1, -9, -1), (0, -9, 0), (0, 9, 0), (1, 9, -1)],
    ]
    prism = tuple(surface(s, WHITE, glass) for s in sides)
    right = surface([(5, -FAR, -2), (5, -FAR, 2), (5, FAR, 2), (5, FAR, -2)])
    behind = surface([(-FAR, -FAR, -9), (FAR, -FAR, -9), (FAR, FAR, -9), (-FAR, FAR, -9)])
    camera = Camera("orthographic", position=(0.5, 0.0, 4.0), target=(0.5, 0.0, 0.0), height=0.2)
    r0 = ((index - 1) / (index + 1)) ** 2
    sideways = sample(Scene("total", camera, (*prism, right)), "raytrace:spp=128,sampler=sobol", (8, 8), 16)
    through = sample(Scene("total", camera, (*prism, behind)), "raytrace:spp=128,sampler=sobol", (8, 8), 16)
    if is_total:
        # (1 - R0)^2 (1 + R0^2 + ...)
        assert_mean(sideways[..., 0].mean(axis=(1, 2)), (1 - r0) / (1 + r0), 0.002)
        assert through.max() == 0.0
    else:
        # From inside at 45 degrees it is refracted to asin(n sin 45) by the share that enters at that angle.
        lost = fresnel_share(math.degrees(math.asin(index * math.sin(math.pi / 4))), index)
        # Of what is reflected by the slant, and again on its way back from the right leg and from the front, as much
        # arrives at it as before times (q R0)^2; what else it lets through leaves to the left.
        again = (lost * r0) ** 2
        assert_mean(through[..., 0].mean(axis=(1, 2)), (1 - r0) * (1 - lost) / (1 - again), 0.002)
        assert_mean(sideways[..., 0].mean(axis=(1, 2)), (1 - r0) ** 2 * lost / (1 - again), 0.002)


def test_coloured_glass_takes_its_colour_at_each_face() -> None:
    color = (0.9, 0.5, 0.8)
    glass = Material("glass", ior=1.5)
    faces = (surface(level(0.0), color, glass), surface(level(-0.1, up=False), color, glass))
    scene = Scene("tinted", looking_down(0.0), (*faces, surface(level(-3.0))))
    pictures = sample(scene, "raytrace:spp=128,sampler=sobol", (8, 8), 16)
    r = 0.04
    for channel, c in enumerate(color):
        truth = c * c * (1 - r) ** 2 / (1 - (r * c) ** 2)
        assert_mean(pictures[..., channel].mean(axis=(1, 2)), truth, 0.002)


# One bounce


def diffuse(points: object, color: Vec3 = WHITE) -> Surface:
    return surface(points, color, Material("diffuse"))


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_a_diffuse_surface_in_a_furnace_is_its_albedo_exactly(sampler: str) -> None:
    color = (0.8, 0.3, 0.55)
    scene = Scene("furnace", looking_down(30.0), (diffuse(level(0.0), color),), background=(1.0, 0.5, 2.0), bounces=1)
    picture = render(scene, f"raytrace:spp=16,sampler={sampler}", size=(8, 8)).pixels
    np.testing.assert_allclose(picture, np.broadcast_to(np.float32([0.8, 0.15, 1.1]), (8, 8, 3)), rtol=1e-6)
    # Without a bounce and without lights it is as bright as an unlit one.
    plain = render(replace(scene, bounces=0), f"raytrace:spp=16,sampler={sampler}", size=(8, 8)).pixels
    np.testing.assert_array_equal(plain, np.broadcast_to(np.float32(color), (8, 8, 3)))


def panel_share(x: float, width: float, height: float) -> float:
    """Return the share of a ground point's view that a wall takes: `x` before it, reaching `width` both ways.

    Twice what the rectangle width x height has whose lower corner is opposite (Howell, view factor B-4).
    """
    root = math.hypot(height, x)
    return 2 * (math.atan(width / x) - x / root * math.atan(width / root)) / (2 * math.pi)


WALL_WIDTH, WALL_HEIGHT = 1.2, 0.9
WALL = [
    (0.0, 0.0, WALL_WIDTH),
    (0.0, 0.0, -WALL_WIDTH),
    (0.0, WALL_HEIGHT, -WALL_WIDTH),
    (0.0, WALL_HEIGHT, WALL_WIDTH),
]


def at_point(x: float, z: float = 0.0) -> Camera:
    """Return a camera that looks at next to nothing but one point of the ground."""
    return Camera("orthographic", position=(x, 0.5, z), target=(x, 0.0, z), up=(0.0, 0.0, -1.0), height=1e-3)


@pytest.mark.parametrize("x", [0.1, 0.5, 1.5])
@pytest.mark.parametrize("sampler", ["random", "sobol"])
def test_a_bounce_gathers_walls_and_sky_by_their_view_factors(x: float, sampler: str) -> None:
    share = panel_share(x, WALL_WIDTH, WALL_HEIGHT)
    assert 0.01 < share < 0.5
    ground = diffuse(level(0.0), (0.8, 0.5, 0.25))
    wall = surface(WALL, (0.9, 0.2, 3.0))
    scene = Scene("corner", at_point(x), (ground, wall), background=(0.5, 1.0, 0.1), bounces=1)
    pictures = sample(scene, f"raytrace:spp=4096,sampler={sampler}", (1, 1), 24)
    for c, (own, sky, shown) in enumerate(zip((0.8, 0.5, 0.25), (0.5, 1.0, 0.1), (0.9, 0.2, 3.0), strict=True)):
        assert_mean(pictures[:, 0, 0, c], own * (sky + share * (shown - sky)), 0.0025)
    # A diffuse wall that nothing lights is black; the sky is what is left.
    dark = replace(scene, objects=(ground, diffuse(WALL)))
    pictures = sample(dark, f"raytrace:spp=4096,sampler={sampler}", (1, 1), 24)
    assert_mean(pictures[:, 0, 0, 1], 0.5 * (1 - share), 0.0025)


def test_what_a_surface_gathers_from_a_mirror_is_seen_in_it() -> None:
    # A wall that mirrors a sky of one colour is that sky.
    ground = diffuse(level(0.0), (0.5, 0.5, 0.5))
    mirror = surface(WALL, WHITE, Material("glossy", roughness=1e-6))
    scene = Scene("corner", at_point(0.4), (ground, mirror), background=WHITE, bounces=1)
    pictures = sample(scene, "raytrace:spp=4096,sampler=sobol", (1, 1), 16)
    # Mirrored upwards all goes to the sky: nothing goes to the ground again from below the mirror's horizon.
    assert_mean(pictures[:, 0, 0, 0], 0.5, 1e-3)


LAMP: Light = Light(((0.5, 2.0, -0.5), (1.5, 2.0, -0.5), (1.5, 2.0, 0.5), (0.5, 2.0, 0.5)), (5.0, 3.0, 1.0))


def lamp_irradiance(points: FloatArray, normal: FloatArray, lamp: Light = LAMP) -> FloatArray:
    """Return the irradiance (n,) from a lamp of radiance 1, all of which is above the points' horizon.

    Lambert's sum over the edges: 1/2 angle (n . unit normal of the plane through the point and the edge).
    """
    corners = np.array(lamp.quad)[None] - points[:, None]
    total = np.zeros(len(points))
    for k in range(4):
        a, b = corners[:, k], corners[:, (k + 1) % 4]
        plane = np.cross(a, b)
        length = np.linalg.norm(plane, axis=1)
        total += np.arctan2(length, (a * b).sum(axis=1)) * (plane @ normal) / length
    return np.abs(total) / 2


def wall_radiance(x: float, z: float, color: float) -> float:
    """Return what the wall, lit by LAMP at radiance 1, adds to the radiance of a white point of the ground."""
    nodes, weights = np.polynomial.legendre.leggauss(48)
    y, w = np.meshgrid(WALL_HEIGHT * (nodes + 1) / 2, WALL_WIDTH * nodes)
    points = np.stack([np.zeros(y.size), y.ravel(), w.ravel()], axis=1)
    shown = color / math.pi * lamp_irradiance(points, np.array([1.0, 0.0, 0.0]))
    r2 = x * x + points[:, 1] ** 2 + (points[:, 2] - z) ** 2
    # cosines: at the ground y / r, at the wall x / r
    kernel = points[:, 1] * x / r2**2
    area = np.outer(weights, weights).ravel() * WALL_HEIGHT / 2 * WALL_WIDTH
    return float((shown * kernel * area).sum()) / math.pi


@pytest.mark.parametrize(("x", "z"), [(0.2, 0.0), (0.6, 0.7), (1.0, -0.3)])
@pytest.mark.parametrize("sampler", ["random", "sobol"])
@pytest.mark.parametrize("shadow_rays", [1, 4])
def test_one_bounce_adds_what_quadrature_says(x: float, z: float, sampler: str, shadow_rays: int) -> None:
    own, painted = (0.9, 0.6, 0.8), (0.3, 0.9, 0.5)
    scene = Scene("room", at_point(x, z), (diffuse(level(0.0), own), diffuse(WALL, painted)), lights=(LAMP,), bounces=1)
    technique = f"raytrace:spp=4096,sampler={sampler},shadow_rays={shadow_rays}"
    direct = float(lamp_irradiance(np.array([[x, 0.0, z]]), np.array([0.0, 1.0, 0.0]))[0]) / math.pi
    without = sample(replace(scene, bounces=0), technique, (1, 1), 16)
    with_bounce = sample(scene, technique, (1, 1), 32)
    for c in range(3):
        assert_mean(without[:, 0, 0, c], own[c] * direct * LAMP.radiance[c], 5e-4)
        more = own[c] * wall_radiance(x, z, painted[c]) * LAMP.radiance[c]
        assert more > 0.001
        assert_mean(with_bounce[:, 0, 0, c], own[c] * direct * LAMP.radiance[c] + more, min(2e-3, more / 10))


def mirrored(light: Light) -> Light:
    """Return a light as seen in a mirror at x = 0; its winding is the image's."""
    a, b, c, d = ((-x, y, z) for x, y, z in light.quad)
    return Light((b, a, d, c), light.radiance)


def test_a_mirror_lights_the_ground_with_the_lamp_s_image() -> None:
    # A wall without end that mirrors: what the ground gathers from it is the lamp once more, behind the wall. Shadow
    # rays do not go by mirrors, so that this light comes with the bounce alone.
    wall = surface(
        [(0, 0, FAR), (0, 0, -FAR), (0, FAR, -FAR), (0, FAR, FAR)], WHITE, Material("glossy", roughness=1e-6)
    )
    scene = Scene("image", at_point(0.6, 0.1), (diffuse(level(0.0), (0.5, 0.5, 0.5)), wall), lights=(LAMP,), bounces=1)
    place, up = np.array([[0.6, 0.0, 0.1]]), np.array([0.0, 1.0, 0.0])
    direct, image = (float(lamp_irradiance(place, up, light)[0]) / math.pi for light in (LAMP, mirrored(LAMP)))
    for bounces, total in ((0, direct), (1, direct + image)):
        pictures = sample(replace(scene, bounces=bounces), "raytrace:spp=4096,sampler=sobol", (1, 1), 24)
        for c in range(3):
            assert_mean(pictures[:, 0, 0, c], 0.5 * total * LAMP.radiance[c], 2e-3)
    assert image > 0.3 * direct


@pytest.mark.parametrize("alpha", [0.2, 0.6])
@pytest.mark.parametrize("sampler", ["random", "sobol"])
def test_a_glossy_surface_shows_a_lamp_as_its_brdf_says(alpha: float, sampler: str) -> None:
    camera = looking_down(40.0, distance=0.5, height=1e-3, target=(0.6, 0.0, 0.1))
    to_viewer = np.array(camera.position) - np.array(camera.target)
    to_viewer /= np.linalg.norm(to_viewer)
    nodes, weights = np.polynomial.legendre.leggauss(40)
    corner, first, second = (
        np.array(LAMP.quad[0]),
        np.subtract(LAMP.quad[1], LAMP.quad[0]),
        np.subtract(LAMP.quad[3], LAMP.quad[0]),
    )
    area, truth = float(np.linalg.norm(np.cross(first, second))), 0.0
    for u, a in zip((nodes + 1) / 2, weights / 2, strict=True):
        for v, b in zip((nodes + 1) / 2, weights / 2, strict=True):
            way = corner + u * first + v * second - np.array(camera.target)
            far = float(np.linalg.norm(way))
            way /= far
            brdf = float(ggx_brdf(alpha, 0.0, 1.0, 0.0, *to_viewer, *way))
            # both cosines are the way's height
            truth += a * b * area * brdf * way[1] ** 2 / far**2
    scene = Scene(
        "gloss", camera, (surface(level(0.0), (0.5, 1.0, 0.8), Material("glossy", roughness=alpha)),), lights=(LAMP,)
    )
    pictures = sample(scene, f"raytrace:spp=4096,sampler={sampler}", (1, 1), 24)
    assert truth > 0.02
    for c, color in enumerate((0.5, 1.0, 0.8)):
        assert_mean(pictures[:, 0, 0, c], truth * color * LAMP.radiance[c], 0.006)


@pytest.mark.parametrize("shadow_rays", [1, 3])
def test_what_is_seen_in_a_mirror_is_lit_as_elsewhere(shadow_rays: int) -> None:
    # A mirror at 45 degrees before the camera turns its rays from -z down to the ground at (0.6, 0, 0.1).
    mirror = [(0.4, 0.4, -0.1), (0.8, 0.4, -0.1), (0.8, 0.8, 0.3), (0.4, 0.8, 0.3)]
    camera = Camera("orthographic", position=(0.6, 0.6, 3.0), target=(0.6, 0.6, 0.1), height=1e-3)
    things = (
        diffuse(level(0.0), (0.5, 0.7, 0.9)),
        surface(mirror, (0.9, 0.9, 0.9), Material("glossy", roughness=1e-6)),
    )
    # The lamp is to the side, so that the mirror does not shade the place.
    lamp = Light(tuple((x + 1.5, y, z) for x, y, z in LAMP.quad), LAMP.radiance)  # type: ignore[arg-type]
    scene = Scene("seen", camera, things, lights=(lamp,))
    expected = float(lamp_irradiance(np.array([[0.6, 0.0, 0.1]]), np.array([0.0, 1.0, 0.0]), lamp)[0]) / math.pi
    pictures = sample(scene, f"raytrace:spp=1024,sampler=sobol,shadow_rays={shadow_rays}", (1, 1), 24)
    for c, color in enumerate((0.5, 0.7, 0.9)):
        assert_mean(pictures[:, 0, 0, c], 0.9 * color * expected * lamp.radiance[c], 1e-3)
    assert expected > 0.01


def test_lights_that_a_bounce_meets_do_not_count_twice() -> None:
    # Ground under a lamp that fills much of its sky: direct light alone, with the bounce and without.
    wide = Light(((-1.0, 0.3, -1.0), (1.0, 0.3, -1.0), (1.0, 0.3, 1.0), (-1.0, 0.3, 1.0)), WHITE)
    camera = replace(at_point(0.0), position=(0.0, 0.2, 0.0))
    scene = Scene("lamp", camera, (diffuse(level(0.0)),), lights=(wide,), bounces=1)
    pictures = [sample(replace(scene, bounces=b), "raytrace:spp=4096,sampler=sobol", (1, 1), 8) for b in (0, 1)]
    np.testing.assert_array_equal(pictures[0], pictures[1])
    assert pictures[0].mean() > 0.5


def test_catalog_room_without_a_bounce_is_direct_light() -> None:
    scene = load_scene("colour-bleeding:bounces=0")
    reference = render(scene, "reference:", size=(12, 10))
    assert reference.uncertainty is not None
    pictures = sample(scene, "raytrace:spp=256,sampler=sobol", (12, 10), 16)
    off = (pictures - reference.pixels).mean(axis=(1, 2, 3))
    assert_mean(off, 0.0, 8e-4, slack=reference.uncertainty)
    # With the bounce nothing gets darker, and the white floor near the red wall gets redder.
    bounced = sample(load_scene("colour-bleeding"), "raytrace:spp=64,sampler=sobol", (12, 10), 16)
    gained = bounced.mean(axis=0) - pictures.mean(axis=0)
    error = np.sqrt((bounced.var(axis=0, ddof=1) + pictures.var(axis=0, ddof=1)) / 16)
    assert (gained >= -8 * error - 1e-6).all()
    assert gained.mean() > 0.02
    assert gained[8, 2, 0] > 1.1 * gained[8, 2, 1]
    assert gained[8, 9, 1] > 1.1 * gained[8, 9, 0]


# What it costs elsewhere


Kind = Literal["glossy", "glass", "light"]


@pytest.mark.parametrize("kind", ["glossy", "glass", "light"])
@pytest.mark.parametrize("options", ["spp=1", "spp=7,sampler=random", "spp=16,sampler=sobol", "spp=16,filter=tent"])
@pytest.mark.parametrize("moving", [False, True])
def test_unlit_pictures_are_the_same_when_paths_are_followed(kind: Kind, options: str, moving: bool) -> None:
    motion = Motion((3.0, 1.0, 0.0)) if moving else Motion()
    shown = polygon(
        [(-1.0, -0.8, 0.0), (0.9, -0.5, 0.3), (0.7, 0.9, 0.5), (-1.2, 0.6, 0.2)], uv=[(0, 0), (1, 0), (1, 1), (0, 1)],
        texture="t", motion=motion,
    )  # fmt: skip
    other = surface([(-0.3, -0.9, 1.0), (0.6, 0.1, 1.1), (-0.5, 0.7, 1.0)], (0.2, 0.7, 0.4))
    camera = Camera("perspective", position=(0.3, 0.2, 4.0), fov_y_deg=45.0)
    scene = Scene("plain", camera, (shown, other), {"t": Checker((5.0, 4.0))}, background=(0.1, 0.2, 0.3))
    scene = replace(scene, animation=replace(scene.animation, shutter=0.7))
    # behind the camera
    hidden = [(-1.0, -1.0, 9.0), (1.0, -1.0, 9.0), (1.0, 1.0, 9.0), (-1.0, 1.0, 9.0)]
    if kind == "light":
        followed = replace(scene, lights=(Light(tuple(hidden), WHITE),))  # type: ignore[arg-type]
    else:
        followed = replace(scene, objects=(surface(hidden, WHITE, Material(kind)), *scene.objects))
    plain, paths = (render(s, f"raytrace:{options}", size=(29, 21), frame=1).pixels for s in (scene, followed))
    assert plain.std() > 0.1
    np.testing.assert_array_equal(plain, paths)


def test_the_front_of_the_wedge_is_where_the_formulas_have_it() -> None:
    front = next(o for o in prism_scene(28.4).objects if o.name == "wedge front")
    assert set(front.vertices[:, 2]) == {FRONT_Z}
