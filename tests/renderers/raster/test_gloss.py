"""Glossy polygons: mirrors, the geometry of images, and the BRDF against the ray tracer."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.raster import targets
from aliasbench.renderers.raster.gloss import facet
from aliasbench.renderers.raster.virtual_images import Mirror, refine
from aliasbench.renderers.raytrace.scattering import glossy_direction
from aliasbench.scenes.errors import UnsupportedScene
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import Animation, Camera, Checker, Light, Material, Motion, Scene, Surface, read_only
from aliasbench.scenes.shapes import polygon

pytestmark = pytest.mark.usefixtures("gl_checked")

UV = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
BESIDE = Camera("perspective", position=(0.4, 1.1, 3.6), target=(0.0, 0.05, 0.0), fov_y_deg=40.0)


def floor(roughness=0.0, half=3.0, color=(0.85, 0.7, 0.9), **options):
    points = [(-half, 0, half), (half, 0, half), (half, 0, -half), (-half, 0, -half)]
    return polygon(points, color=color, material=Material("glossy", roughness=roughness), **options)


def panel(x0, x1, y0, y1, z, kind="unlit", color=(1.0, 0.4, 0.2), **options):
    points = [(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)]
    return polygon(points, color=color, material=Material(kind), uv=UV, **options)


def lit_scene(roughness=0.0, motion=None, camera=BESIDE):
    """Diffuse and unlit panels, one textured, one through the floor and one moving, under a light that is mirrored."""
    lamp = Light(((-0.9, 1.2, -0.8), (-0.1, 1.2, -0.8), (-0.1, 1.2, 0.0), (-0.9, 1.2, 0.0)), (3.0, 4.0, 5.0))
    objects = (
        floor(roughness),
        panel(-1.1, -0.3, -0.4, 0.7, -0.5, "diffuse"),
        panel(0.2, 1.0, 0.0, 0.6, 0.0, color=(1.0, 1.0, 1.0), texture="t"),
        panel(-0.3, 0.1, 0.3, 0.6, 0.4, "diffuse", (0.3, 0.9, 1.0), motion=motion or Motion()),
    )
    textures = {"t": Checker((4.0, 3.0), (0.1, 0.0, 0.3))}
    animation = Animation(fps=10.0, shutter=0.5)
    return Scene("lit", camera, objects, textures, (lamp,), background=(0.05, 0.06, 0.08), animation=animation)


# Geometry


def random_facets(count=200):
    rng = np.random.default_rng(1)
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    for normal in normals:
        eye, point = normal * rng.uniform(0.1, 3.0) + np.cross(normal, rng.normal(size=3)), rng.normal(size=3)
        point += (rng.uniform(0.0, 2.0) - normal @ point) * normal
        half = normal + rng.uniform(0.0, 1.0) * np.cross(normal, rng.normal(size=3))
        yield normal, eye, point, half / np.linalg.norm(half)


def test_the_ray_to_an_image_is_turned_by_the_facet_to_what_it_shows():
    for normal, eye, point, half in random_facets():
        # the plane need not pass through the origin
        shift = np.array([0.3, -0.2, 0.5])
        image = Mirror(normal, float(normal @ shift), eye + shift, None).image(point + shift, half) - shift
        along = image - eye
        at = eye + along * (-(normal @ eye) / (normal @ along))
        onward = (at - eye) - 2 * half * (half @ (at - eye))
        s = np.linalg.norm(image - at) / np.linalg.norm(at - eye)
        np.testing.assert_allclose(at + s * onward, point, atol=1e-9 * (1 + np.linalg.norm(image)))


def test_parallel_rays_are_turned_likewise():
    turned = 0
    for normal, eye, point, half in random_facets():
        direction = -eye / np.linalg.norm(eye)
        if not normal @ direction < 0.0:
            continue
        mirror = Mirror(normal, 0.0, eye, direction)
        onward = direction - 2 * half * (half @ direction)
        if normal @ onward <= 1e-2:
            continue
        image = mirror.image(point, half)
        s = (normal @ point) / (normal @ onward)
        np.testing.assert_allclose(image - s * direction + s * onward, point, atol=1e-9 * (1 + s))
        assert abs(normal @ (image - s * direction)) < 1e-9 * (1 + s)
        turned += 1
    assert turned > 50


def test_flat_facets_mirror():
    for normal, eye, point, _ in random_facets(20):
        mirrored = point - 2 * (normal @ point) * normal
        np.testing.assert_allclose(Mirror(normal, 0.0, eye, None).image(point, normal), mirrored, atol=1e-12)


def test_refined_triangles_cover_the_same_and_have_straight_images():
    rng = np.random.default_rng(4)
    corners = rng.uniform(-1, 1, (6, 3, 3))
    corners[..., 1] += 1.0
    mirror = Mirror(np.array([0.0, 1.0, 0.0]), 0.0, np.array([0.0, 1.0, 3.0]), None)
    half = np.array([0.3, 1.0, 0.1]) / np.linalg.norm([0.3, 1.0, 0.1])
    fine = refine(mirror, corners, half[None], 1e-3)
    assert len(fine) > 50

    def areas(t):
        return np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1) / 2

    assert areas(fine).sum() == pytest.approx(areas(corners).sum())
    middles, ends = 0.5 * (fine + np.roll(fine, -1, axis=1)), mirror.image(fine, half)
    off = mirror.image(middles, half) - 0.5 * (ends + np.roll(ends, -1, axis=1))
    assert np.linalg.norm(off, axis=2).max() < 1e-3 * np.linalg.norm(ends - mirror.eye, axis=2).max()


def test_facets_are_the_ray_tracers_where_it_faces_the_surface():
    normal = np.array([0.0, 0.6, 0.8])
    for u, v, alpha in np.random.default_rng(2).random((50, 3)):
        half = facet(alpha, (u, v), normal)
        direction, _ = glossy_direction(u, v, alpha, *normal, *-normal)
        np.testing.assert_allclose(2 * (normal @ half) * half - normal, direction, atol=1e-9)


@pytest.mark.parametrize("alpha", [0.05, 0.3, 0.9])
def test_facets_have_the_ggx_s_distribution(alpha):
    # P(tan^2 < t) of D cos is t / (t + alpha^2), and the azimuth is even
    numbers = np.random.default_rng(3).random((4000, 2))
    halves = np.array([facet(alpha, (u, v), np.array([0.0, 0.0, 1.0])) for u, v in numbers])
    square = halves[:, 2] ** -2 - 1.0
    assert stats.kstest(square / (square + alpha**2), "uniform").pvalue > 1e-4
    assert stats.kstest(np.arctan2(halves[:, 1], halves[:, 0]) / math.tau + 0.5, "uniform").pvalue > 1e-4


# Mirrors


def test_a_smooth_floor_shows_the_mirrored_scene():
    things = (panel(-1.0, -0.2, 0.0, 0.7, -0.5), panel(0.1, 0.7, 0.2, 0.6, 0.3, color=(0.2, 0.6, 1.0)))
    scene = Scene("m", BESIDE, (floor(), *things), background=(0.1, 0.2, 0.3))
    mirrored = tuple(
        replace(t, vertices=read_only(t.vertices * (1.0, -1.0, 1.0)), color=tuple(np.multiply(t.color, floor().color)))
        for t in things
    )
    explicit = replace(scene, objects=mirrored, background=tuple(np.multiply(scene.background, floor().color)))
    marked = replace(
        scene,
        objects=(replace(floor(), material=Material("unlit"), color=(9.0, 9.0, 9.0)), *things),
    )
    technique, size = "raster:passes=4,sampler=jittered", (64, 48)
    shown, wanted, where = (render(s, technique, size=size).pixels for s in (scene, explicit, marked))
    on_floor = (where == 9.0).all(axis=2)
    assert on_floor.mean() > 0.3
    assert len(np.unique(wanted[on_floor], axis=0)) > 6
    differs = np.abs(shown - wanted).max(axis=2)[on_floor] > 1e-5
    assert differs.mean() < 0.005


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"motion": Motion((1.0, 0.5, 0.5))},
        {"camera": replace(BESIDE, lens_radius=0.08)},
        {"camera": replace(BESIDE, velocity=(1.0, 0.0, -2.0))},
        {"camera": Camera("orthographic", position=(0.3, 1.0, 3.0), height=2.4)},
        {"camera": replace(BESIDE, position=(0.4, -0.3, 3.6))},
    ],
    ids=["still", "moving", "lens", "camera", "parallel", "below"],
)
def test_a_smooth_floor_is_the_ray_tracers_sample_for_sample(options):
    scene, size = lit_scene(**options), (64, 48)
    traced = render(scene, "raytrace:pattern=shared,spp=8,sampler=jittered", size=size, seed=1).pixels
    drawn = render(scene, "raster:passes=8,sampler=jittered", size=size, seed=1).pixels
    differs = np.abs(traced.astype(float) - drawn).max(axis=2) > 2e-4 * np.maximum(traced.max(axis=2), 1e-2)
    assert len(np.unique(traced)) > 40
    assert differs.mean() < 0.02, f"{differs.sum()} of {differs.size} pixels differ"


# Gloss


def compare(scene, passes, size, seeds, *, rare):
    """Assert that converged pictures have the ray tracer's mean; return that."""
    pictures = []
    for technique in (f"raytrace:spp={passes},sampler=sobol", f"raster:passes={passes},sampler=sobol"):
        with prepare(scene, technique, size=size) as prepared:
            pictures.append(np.array([prepared.render(seed=k).pixels for k in range(seeds)], dtype=np.float64))
    means = [p.mean(axis=0) for p in pictures]
    error = np.sqrt(sum(p.var(axis=0, ddof=1) for p in pictures) / seeds)
    # an edge 2/256 px off is worth that share of its contrast
    limit = stats.t.ppf(1 - 1e-4 / (2 * error.size), seeds - 1) * error + 14 * rare + 2 / 256
    off = np.abs(means[0] - means[1])
    assert (off <= limit).all(), f"off by up to {np.max(off / limit):.2f} of what is allowed"
    # pixels share the samples of a pass and err together, but each as its own spread says
    assert np.sqrt((off**2).mean()) <= 1.5 * np.sqrt((error**2).mean()) + 3e-4
    return means[0]


@pytest.mark.parametrize("roughness", [0.02, 0.1, 0.3])
def test_glossy_floor_has_the_ray_tracers_mean(roughness):
    mean = compare(load_scene(f"glossy-floor:roughness={roughness}"), 128, (32, 24), 8, rare=1.0 / (128 * 8))
    assert np.ptp(mean) > 0.5


def test_gloss_mirrors_lit_things_and_lights():
    compare(lit_scene(0.15), 128, (32, 24), 8, rare=5.0 / (128 * 8))


@pytest.mark.parametrize("roughness", [0.1, 0.5, 1.0])
def test_a_floor_under_an_even_sky_reflects_its_albedo(roughness):
    camera = Camera("orthographic", position=(0.0, 1.0, 1.5), target=(0.0, 0.0, 0.0), height=1e-3)
    scene = Scene("sky", camera, (floor(roughness, color=(1.0, 1.0, 1.0)),), background=(1.0, 1.0, 1.0))
    shown = render(scene, "raster:passes=1024,sampler=sobol", size=(1, 1)).pixels[0, 0]
    arriving = np.array([0.0, -1.0, -1.5]) / math.hypot(1.0, 1.5)
    grid = (np.arange(64) + 0.5) / 64
    weights = [glossy_direction(u, v, roughness, 0.0, 1.0, 0.0, *arriving)[1] for u in grid for v in grid]
    assert 0.3 < np.mean(weights) < 1.0
    np.testing.assert_allclose(shown, np.mean(weights), rtol=0.01)


def test_several_glossy_polygons_see_the_rest_and_each_other_black():
    wall = polygon(
        [(-1.5, 0.0, -1.0), (1.5, 0.0, -1.0), (1.5, 1.5, -1.0), (-1.5, 1.5, -1.0)],
        material=Material("glossy", roughness=0.0),
        color=(0.5, 0.6, 0.7),
    )
    scene = Scene("two", BESIDE, (floor(), wall, panel(-0.5, 0.3, 0.2, 0.6, 0.3)), background=(0.2, 0.3, 0.4))
    black = replace(wall, material=Material("unlit"), color=(0.0, 0.0, 0.0))
    dark = replace(floor(), material=Material("unlit"), color=(0.0, 0.0, 0.0))
    technique, size = "raster:passes=2,sampler=jittered", (64, 48)
    both = render(scene, technique, size=size).pixels
    # where one mirror is black already, the other shows the same: their sum is both, but for what is neither
    one = render(replace(scene, objects=(scene.objects[0], black, scene.objects[2])), technique, size=size).pixels
    other = render(replace(scene, objects=(dark, wall, scene.objects[2])), technique, size=size).pixels
    neither = render(replace(scene, objects=(dark, black, scene.objects[2])), technique, size=size).pixels
    assert np.abs(one - neither).max() > 0.1
    assert np.abs(other - neither).max() > 0.1
    np.testing.assert_allclose(both, one + other - neither, atol=1e-6)


def test_glossy_meshes_are_refused():
    mesh = Surface(
        read_only(np.eye(3)), read_only(np.array([[0, 1, 2]], np.int32)), False, material=Material("glossy"), name="pot"
    )
    with pytest.raises(UnsupportedScene, match=r"material glossy on a mesh \(object pot\) is not drawn"):
        prepare(Scene("mesh", BESIDE, (mesh,)), "raster:", size=(4, 4))


def test_gloss_edge_on_and_from_within_its_plane_is_not_seen():
    camera = replace(BESIDE, position=(0.0, 0.0, 4.0), target=(0.0, 0.0, 0.0))
    scene = Scene("edge", camera, (floor(0.1),), background=(0.5, 0.5, 0.5))
    np.testing.assert_array_equal(render(scene, "raster:passes=2", size=(8, 8)).pixels, 0.5)


@pytest.mark.parametrize("extra", ["", ",ssaa=2", ",msaa=4", ",filter=gaussian", ",filter=tent,weighting=distribution"])
def test_gloss_goes_with_everything(extra):
    scene, size = lit_scene(0.1, Motion((1.0, 0.5, 0.5)), replace(BESIDE, lens_radius=0.05)), (24, 18)
    pixels = render(scene, f"raster:passes=32,sampler=sobol{extra}", size=size).pixels
    # a filter's own blur apart, it is one picture
    mean = render(scene, "raytrace:spp=64,sampler=sobol", size=size).pixels.mean()
    assert pixels.mean() == pytest.approx(mean, rel=0.05)


def test_parts_of_a_picture_mirror_as_the_whole(monkeypatch):
    scene, size, technique = lit_scene(0.1), (40, 30), "raster:passes=4,sampler=sobol"
    whole = render(scene, technique, size=size).pixels
    monkeypatch.setattr(targets, "_MOST_BYTES", 20 * 20 * 20)
    parts = render(scene, technique, size=size).pixels
    assert (np.abs(whole - parts).max(axis=2) > 1e-5).mean() < 0.01


def test_one_pixel_and_a_scene_far_from_the_origin():
    near = lit_scene()
    offset = np.array([1e6, -1e6, 2e6])

    def moved(points):
        return tuple(tuple((np.asarray(p) + offset).tolist()) for p in points)

    far = replace(
        near,
        objects=tuple(replace(o, vertices=read_only(o.vertices + offset)) for o in near.objects),
        lights=tuple(replace(light, quad=moved(light.quad)) for light in near.lights),
        camera=replace(BESIDE, position=moved([BESIDE.position])[0], target=moved([BESIDE.target])[0]),
    )
    for size in ((1, 1), (48, 36)):
        pictures = [render(s, "raster:passes=2,sampler=jittered", size=size).pixels for s in (near, far)]
        assert (np.abs(pictures[0] - pictures[1]).max(axis=2) > 1e-4).mean() < 0.01
