"""Area lights and soft shadows: closed forms, references, and the ray tracer sample for sample."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.raster import targets
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import Animation, Camera, Checker, ImageTexture, Light, Material, Motion, Scene, read_only
from aliasbench.scenes.shapes import polygon

FLOOR = [(-4.0, 0.0, 4.0), (4.0, 0.0, 4.0), (4.0, 0.0, -4.0), (-4.0, 0.0, -4.0)]
DOWN = Camera("orthographic", position=(0.0, 0.5, 0.0), target=(0.0, 0.0, 0.0), up=(0.0, 0.0, -1.0), height=2.0)
SQUARE_UV = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
LAMP = (-0.5, 0.5, -0.4, 0.6, 2.0)
EDGE = 0.1
LENGTH = (24, 3)

pytestmark = pytest.mark.usefixtures("gl_checked")


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    """Keep references of a test in its own folder."""
    monkeypatch.setenv("ALIASBENCH_CACHE", str(tmp_path))


def ceiling(x0, x1, z0, z1, height, radiance=1.0):
    """Return a light that shines down."""
    return Light(((x0, height, z0), (x1, height, z0), (x1, height, z1), (x0, height, z1)), (radiance,) * 3)


def flat(points, color=(1.0, 1.0, 1.0), kind="diffuse", **options):
    return polygon(points, color=color, material=Material(kind), **options)


def at_height(x0, x1, z0, z1, height, **options):
    corners = [(x0, height, z1), (x1, height, z1), (x1, height, z0), (x0, height, z0)]
    return flat(corners, uv=SQUARE_UV, **options)


def edge_scene():
    """A white floor; what lies at x < EDGE at half the light's height hides the light at x' < 2 EDGE - x."""
    occluder = at_height(EDGE - 9.0, EDGE, -9.0, 9.0, 1.0, kind="unlit")
    camera = replace(DOWN, position=(0.2, 0.5, 0.0), target=(0.2, 0.0, 0.0), height=0.18)
    return Scene("edge", camera, (flat(FLOOR), occluder), lights=(ceiling(*LAMP),))


def corner(a, b, height):
    """Irradiance below the corner of a parallel rectangle a x b of radiance 1 (Howell, view factor B-3)."""
    x, y = a / height, b / height
    p, q = np.sqrt(1 + x * x), np.sqrt(1 + y * y)
    return 0.5 * (x / p * np.arctan(y / p) + y / q * np.arctan(x / q))


def seen_past_edge(x, z):
    """Radiance of the floor at (x, z)."""
    x0, x1, z0, z1, height = LAMP
    x0 = np.clip(2 * EDGE - x, x0, x1)
    parts = ((x1, z1, 1), (x0, z1, -1), (x1, z0, -1), (x0, z0, 1))
    return sum(sign * corner(a - x, b - z, height) for a, b, sign in parts) / math.pi


@pytest.fixture(scope="module")
def penumbra():
    """Means of the closed form over the pixels, split where it has kinks in x."""
    camera, nodes = edge_scene().camera, np.polynomial.legendre.leggauss(10)
    step = camera.height / LENGTH[1]
    out = np.zeros((LENGTH[1], LENGTH[0], 1))
    for i, j in np.ndindex(LENGTH[1], LENGTH[0]):
        left, top = camera.position[0] + (j - LENGTH[0] / 2) * step, (i - LENGTH[1] / 2) * step
        kinks = [k for k in (2 * EDGE - LAMP[1], 2 * EDGE - LAMP[0]) if left < k < left + step]
        for a, b in itertools.pairwise([left, *sorted(kinks), left + step]):
            x, z = np.meshgrid(a + (b - a) * (nodes[0] + 1) / 2, top + step * (nodes[0] + 1) / 2)
            out[i, j] += (b - a) / step * (np.outer(nodes[1], nodes[1]) / 4 * seen_past_edge(x, z)).sum()
    assert out[:, 0].max() == 0.0
    assert np.ptp(out) > 0.05
    return out


def assert_estimates(pictures, truth, *, rare, bound=0.0):
    """Assert that pictures (n, h, w, 3) are unbiased: Student's t fails a right one once in 10 000 tests.

    Events that none has seen are worth at most 14 times `rare`, else they were seen with probability 1 - e^-14.
    """
    n = len(pictures)
    error = pictures.std(axis=0, ddof=1) / math.sqrt(n)
    off = np.abs(pictures.mean(axis=0) - truth)
    limit = stats.t.ppf(1 - 1e-4 / (2 * off.size), n - 1) * error + 14 * rare + bound
    assert (off <= limit).all(), f"off by up to {np.max(off / limit):.2f} of what is allowed"
    return error


def sample(scene, technique, size, seeds, frame=0):
    with prepare(scene, technique, size=size) as prepared:
        return np.array([prepared.render(frame, seed).pixels for seed in range(seeds)], dtype=np.float64)


@pytest.mark.parametrize("sampler", ["random", "jittered", "multijittered", "sobol"])
@pytest.mark.parametrize("shadow_rays", [1, 3, 8])
def test_the_penumbra_of_a_straight_edge_has_its_closed_form(penumbra, sampler, shadow_rays):
    passes, seeds = 16, 20
    technique = f"raster:passes={passes},sampler={sampler},shadow_rays={shadow_rays}"
    pictures = sample(edge_scene(), technique, LENGTH, seeds)
    # a sample is 0 or at most area / (pi height^2) = .08: its deviation is below .04
    error = assert_estimates(pictures, penumbra, rare=0.08 / (passes * seeds))
    assert np.sqrt((error**2).mean()) <= 0.04 / math.sqrt(passes * seeds)
    assert (pictures[:, :, 0] == 0.0).all()


def test_stratified_shadow_rays_bring_the_noise_down():
    deviation = {}
    for sampler, rays in itertools.product(("random", "sobol"), (1, 8)):
        pictures = sample(edge_scene(), f"raster:passes=4,sampler={sampler},shadow_rays={rays}", LENGTH, 24)
        deviation[sampler, rays] = float(np.sqrt(pictures.var(axis=0, ddof=1).mean()))
    # pixels share their samples: 24 pictures know a deviation to 15 %
    assert deviation["random", 1] / deviation["random", 8] == pytest.approx(math.sqrt(8), rel=0.4)
    assert deviation["sobol", 8] < 0.5 * deviation["random", 8]


@pytest.mark.parametrize("x", [0.0, 1.7])
def test_an_unoccluded_rectangle_gives_its_closed_form(x):
    x0, x1, z0, z1, height = LAMP
    camera = replace(DOWN, position=(x, 0.5, 0.3), target=(x, 0.0, 0.3), height=1e-3)
    scene = Scene("open", camera, (flat(FLOOR, (0.5, 1.0, 0.25)),), lights=(ceiling(*LAMP, 3.0),))
    parts = ((x1, z1, 1), (x0, z1, -1), (x1, z0, -1), (x0, z0, 1))
    truth = 3.0 * sum(sign * corner(a - x, b - 0.3, height) for a, b, sign in parts) / math.pi
    pixels = render(scene, "raster:passes=1024,sampler=sobol", size=(1, 1)).pixels
    # a scrambled Sobol net of 2^10 points of so smooth an integrand: far below the 1/1024 of one cell
    np.testing.assert_allclose(pixels[0, 0], truth * np.array([0.5, 1.0, 0.25]), rtol=5e-4)


@pytest.mark.parametrize(
    "name",
    ["soft-shadow:light_size=1.0,occluder_height=0.9,slats=3", "pixel-time-lens-light:shutter=0,lens_radius=0"],
)
def test_catalog_scenes_agree_with_their_references(name):
    scene, size, seeds, passes = load_scene(name), (24, 20), 16, 32
    reference = render(scene, "reference:", size=size, frame=1)
    assert reference.uncertainty_kind == "bound"
    assert reference.uncertainty < 1e-4
    pictures = sample(scene, f"raster:passes={passes},sampler=sobol", size, seeds, frame=1)
    rare = max(1.0, float(reference.pixels.max())) / (passes * seeds)
    assert_estimates(pictures, reference.pixels, rare=rare, bound=reference.uncertainty)


# The ray tracer, sample for sample


def assert_agrees(scene, options, size=(48, 40), *, frame=1, most=0.01):
    """Assert that both renderers take the same samples.

    Edges lie 2/256 of a pixel off and shadow borders as far as float32 rounds: `most` is the share of pixels that may
    differ for that. An edge has some 40 pixels a side, of which 4/256 lie so near it that a sample may fall in between.
    """
    count = options.pop("count", 8)
    text = "".join(f",{k}={v}" for k, v in options.items())
    traced = render(scene, f"raytrace:pattern=shared,spp={count}{text}", size=size, frame=frame, seed=2).pixels
    drawn = render(scene, f"raster:passes={count}{text}", size=size, frame=frame, seed=2).pixels
    difference = np.abs(traced.astype(np.float64) - drawn).max(axis=2)
    differs = difference > 1e-4 * np.maximum(traced.max(axis=2), 1e-2)
    assert differs.mean() <= most, f"{differs.sum()} of {differs.size} pixels differ"
    assert len(np.unique(traced)) > 50
    return traced, drawn


def lights_scene(**options):
    """A floor, a wall and a textured table, lit by three lights of which one is seen and shaded."""
    lamps = [ceiling(-0.8, 0.0, -0.4, 0.4, 2.0, 2.0), ceiling(-0.1, 0.4, -0.5, 0.2, 1.2, 1.0)]
    lamps.append(Light(((1.5, 0.2, 0.5), (1.5, 0.2, -0.5), (1.5, 1.2, -0.5), (1.5, 1.2, 0.5)), (0.5, 1.0, 3.0)))
    wall = flat([(-1.2, 0.0, 1.0), (-1.2, 0.0, -1.0), (-1.2, 0.6, -1.0), (-1.2, 0.6, 1.0)], (0.9, 0.5, 0.2))
    table = at_height(-0.3, 0.5, -0.4, 0.3, 0.4, texture="t", motion=options.pop("motion", Motion()))
    camera = Camera("perspective", position=(0.5, 1.6, 3.0), target=(0.0, 0.3, 0.0), fov_y_deg=45.0)
    camera = replace(camera, **options)
    textures = {"t": Checker((5.0, 3.0), (0.1, 0.0, 0.3))}
    animation = Animation(fps=10.0, shutter=0.6)
    objects = (flat(FLOOR, (0.8, 0.9, 1.0)), wall, table)
    return Scene("sum", camera, objects, textures, lights=tuple(lamps), animation=animation)


@pytest.mark.parametrize("sampler", ["random", "jittered", "multijittered", "sobol"])
def test_soft_shadow_is_the_ray_tracers(sampler):
    traced, _ = assert_agrees(load_scene("soft-shadow"), {"sampler": sampler})
    assert np.ptp(traced) > 0.5


@pytest.mark.parametrize(
    "options",
    [
        {"sampler": "sobol", "shadow_rays": 3},
        {"sampler": "sobol", "time": "center"},
        {"count": 1},
        {"sampler": "jittered", "filter": "gaussian"},
        {"sampler": "jittered", "filter": "mitchell", "weighting": "distribution"},
    ],
    ids=str,
)
def test_everything_at_once_is_the_ray_tracers(options):
    assert_agrees(load_scene("pixel-time-lens-light"), options, most=0.02)


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"motion": Motion((1.0, 0.5, -1.0))},
        {"lens_radius": 0.1},
        {"velocity": (3.0, 0.0, 1.0)},
        {"velocity": (1.0, 0.0, 0.0), "target_velocity": (0.0, 1.0, 0.0), "lens_radius": 0.05},
        {"projection": "orthographic", "fov_y_deg": None, "height": 2.4},
    ],
    ids=str,
)
def test_several_lights_are_the_ray_tracers(options):
    assert_agrees(lights_scene(**options), {"sampler": "jittered"}, most=0.02)


def test_a_scene_far_from_the_origin_is_the_same():
    near = lights_scene(lens_radius=0.05, motion=Motion((1.0, 0.5, -1.0)))
    offset = np.array([1e6, -1e6, 2e6])

    def moved(points):
        return tuple(tuple((np.asarray(p) + offset).tolist()) for p in points)

    far = replace(
        near,
        objects=tuple(replace(o, vertices=read_only(o.vertices + offset)) for o in near.objects),
        lights=tuple(replace(light, quad=moved(light.quad)) for light in near.lights),
        camera=replace(near.camera, position=moved([near.camera.position])[0], target=moved([near.camera.target])[0]),
    )
    pictures = [render(s, "raster:passes=4,sampler=sobol", size=(48, 40)).pixels for s in (near, far)]
    differs = np.abs(pictures[0] - pictures[1]).max(axis=2) > 1e-5 * np.maximum(pictures[0].max(axis=2), 0.1)
    assert differs.mean() < 0.005


@pytest.mark.parametrize("factor", [1e-12, 1e12])
def test_size_does_not_matter(factor):
    scene = lights_scene()
    scaled = replace(
        scene,
        objects=tuple(replace(o, vertices=read_only(o.vertices * factor)) for o in scene.objects),
        lights=tuple(
            replace(light, quad=tuple(tuple(c * factor for c in p) for p in light.quad)) for light in scene.lights
        ),
        camera=replace(
            scene.camera,
            position=tuple(c * factor for c in scene.camera.position),
            target=tuple(c * factor for c in scene.camera.target),
        ),
    )
    pictures = [render(s, "raster:passes=2,sampler=sobol", size=(32, 24)).pixels for s in (scene, scaled)]
    assert (np.abs(pictures[0] - pictures[1]).max(axis=2) > 1e-5).mean() < 0.005


# What lights look like, hide and shade


def below():
    return Camera("orthographic", position=(0, 0, 0), target=(0, 1, 0), up=(0, 0, 1), height=2.0)


def test_lights_are_seen_in_front_and_black_from_behind_over_what_lies_in_their_plane():
    light = ceiling(-0.5, 0.5, -0.5, 0.5, 1.0, 7.0)
    roof = at_height(-2, 2, -2, 2, 1.0)
    above = replace(below(), position=(0.0, 3.0, 0.0), target=(0.0, 1.0, 0.0))
    for camera, value in ((below(), 7.0), (above, 0.0)):
        scene = Scene("l", camera, (roof,), lights=(light,), background=(0.5, 0.25, 1.0))
        expected = np.zeros((8, 8, 3))
        expected[2:6, 2:6] = value
        # in the light's plane the roof is lit by nothing
        np.testing.assert_array_equal(render(scene, "raster:passes=2", size=(8, 8)).pixels, expected)
        expected[expected.sum(axis=2) == 0] = (0.5, 0.25, 1.0)
        expected[2:6, 2:6] = value
        alone = render(replace(scene, objects=()), "raster:passes=2", size=(8, 8)).pixels
        np.testing.assert_array_equal(alone, expected)


def test_the_side_that_is_seen_is_the_side_that_is_lit():
    light = ceiling(-0.5, 0.5, -0.5, 0.5, 2.0)
    under = replace(below(), position=(0.0, -1.0, 0.0))
    hidden = render(Scene("s", under, (flat(FLOOR),), lights=(light,)), "raster:passes=4", size=(6, 6)).pixels
    assert hidden.max() == 0.0
    pictures = [
        render(Scene("s", DOWN, (flat(f),), lights=(light,)), "raster:passes=4", size=(6, 6)).pixels
        for f in (FLOOR, FLOOR[::-1])
    ]
    assert pictures[0].min() > 0.02
    np.testing.assert_allclose(pictures[0], pictures[1], rtol=1e-6)


def test_unlit_surfaces_do_not_answer_and_diffuse_without_lights_are_unlit():
    scene = lights_scene()
    unlit = replace(scene, objects=tuple(replace(o, material=Material("unlit")) for o in scene.objects))
    dark = replace(unlit, lights=tuple(replace(light, radiance=(0.0,) * 3) for light in unlit.lights))
    pictures = [render(s, "raster:", size=(24, 20)).pixels for s in (unlit, dark)]
    is_light = (dark_places := pictures[1].max(axis=2) == 0.0) & (pictures[0].max(axis=2) > 0.0)
    assert dark_places.any()
    np.testing.assert_array_equal(pictures[0][~is_light], pictures[1][~is_light])
    bare = [replace(s, lights=()) for s in (scene, unlit)]
    np.testing.assert_array_equal(*(render(s, "raster:", size=(24, 20)).pixels for s in bare))


def test_zero_radiance_is_black():
    dark = ceiling(-0.2, 0.2, -0.3, 0.3, 1.0, 0.0)
    scene = Scene("z", DOWN, (flat(FLOOR),), lights=(dark,), background=(1.0, 1.0, 1.0))
    assert render(scene, "raster:passes=4", size=(6, 6)).pixels.max() == 0.0


@pytest.mark.parametrize("texture", ["point", "linear"])
@pytest.mark.parametrize("moving", [False, True])
def test_cut_out_things_throw_shadows_with_holes(moving, texture):
    texels = np.ones((4, 4, 4), np.float32)
    texels[..., 3] = np.random.default_rng(5).random((4, 4)) < 0.5
    motion = Motion((1.0, 0.0, 0.5)) if moving else Motion()
    sheet = at_height(-0.4, 0.4, -0.4, 0.4, 1.0, kind="unlit", texture="holes", motion=motion)
    textures = {"holes": ImageTexture(read_only(texels), alpha_cutoff=0.5)}
    animation = Animation(fps=1.0, shutter=0.3)
    scene = Scene("holes", DOWN, (flat(FLOOR), sheet), textures, lights=(ceiling(*LAMP),), animation=animation)
    traced, _ = assert_agrees(scene, {"sampler": "sobol", "texture": texture}, frame=0)
    bare = render(replace(scene, objects=scene.objects[:1]), "raster:passes=8,sampler=sobol", size=(48, 40), seed=2)
    assert 0.5 < traced.mean() / bare.pixels.mean() < 0.95


# The rest of what a technique may ask for


def test_one_pixel_and_a_single_pass():
    scene = load_scene("soft-shadow")
    traced = render(scene, "raytrace:", size=(1, 1)).pixels
    assert traced.max() > 0.0
    np.testing.assert_allclose(render(scene, "raster:", size=(1, 1)).pixels, traced, rtol=1e-5)


def test_supersampled_and_multisampled_pictures_are_near_the_truth():
    scene, size = load_scene("soft-shadow"), (32, 24)
    truth = render(scene, "reference:", size=size).pixels
    errors = {}
    for extra in ("", ",ssaa=2", ",msaa=4"):
        pixels = render(scene, f"raster:passes=64,sampler=sobol{extra}", size=size).pixels
        errors[extra] = float(np.sqrt(((pixels - truth) ** 2).mean()))
    assert errors[",ssaa=2"] < errors[""] < 0.01
    # of the four samples of a pixel all have the light of one place: shadows are half a pixel more blurred
    assert errors[",msaa=4"] < 0.02


def test_parts_of_a_picture_are_lit_as_the_whole(monkeypatch):
    scene, size, technique = lights_scene(lens_radius=0.05), (40, 30), "raster:passes=4,sampler=sobol,filter=gaussian"
    whole = render(scene, technique, size=size).pixels
    monkeypatch.setattr(targets, "_MOST_BYTES", 24 * 20 * 20)
    parts = render(scene, technique, size=size).pixels
    differs = np.abs(whole - parts).max(axis=2) > 1e-5
    assert differs.mean() < 0.01


def test_a_floor_that_reaches_beyond_float32_is_lit_like_a_small_one():
    small = load_scene("soft-shadow")
    floor = small.objects[0]
    wide = replace(small, objects=(replace(floor, vertices=read_only(floor.vertices * 1e6)), *small.objects[1:]))
    pictures = [render(s, "raster:passes=4,sampler=sobol", size=(40, 30)).pixels for s in (small, wide)]
    # shadow rays start some 60 units off such a floor: only what lies outside shadows is comparable
    lit = pictures[1].max(axis=2) > 0.0
    assert lit.mean() > 0.5
    traced = render(wide, "raytrace:pattern=shared,spp=4,sampler=sobol", size=(40, 30)).pixels
    differs = np.abs(pictures[1] - traced).max(axis=2) > 1e-3 * np.maximum(traced.max(axis=2), 0.1)
    assert differs.mean() < 0.02
