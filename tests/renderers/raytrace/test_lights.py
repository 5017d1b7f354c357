"""Rectangle lights and their shadows against closed forms and references, as means over seeds.

Estimates are judged by their spread over seeds, pixel by pixel and as a whole, and the spread itself has a limit. The
closed forms are Lambert's, by corners of rectangles, integrated over pixels. TRIALS=100 asks for as many random scenes.
"""

import itertools
import math
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.reference.faces import build_faces
from aliasbench.renderers.reference.lit import draw_lit
from aliasbench.renderers.reference.paths import scene_paths
from aliasbench.renderers.sampling.filters import make_filter
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import (
    Animation,
    Camera,
    Checker,
    FloatArray,
    ImageTexture,
    Light,
    Material,
    Motion,
    Scene,
    Surface,
    Vec3,
    read_only,
)
from aliasbench.scenes.projection import focus_at, lens_view, view_at
from aliasbench.scenes.shapes import polygon

TRIALS = int(os.environ.get("TRIALS", "10"))
SAMPLERS = ("random", "jittered", "multijittered", "sobol", "bluenoise")
FLOOR = [(-4.0, 0.0, 4.0), (4.0, 0.0, 4.0), (4.0, 0.0, -4.0), (-4.0, 0.0, -4.0)]
SQUARE_UV = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
DOWN = Camera("orthographic", position=(0.0, 0.5, 0.0), target=(0.0, 0.0, 0.0), up=(0.0, 0.0, -1.0), height=2.0)
LENGTH = (24, 3)  # pixels across a penumbra and along it


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep references of a test in its own folder."""
    monkeypatch.setenv("ALIASBENCH_CACHE", str(tmp_path))


def sample(scene: Scene, technique: str, size: tuple[int, int], seeds: int, frame: int = 0) -> FloatArray:
    """Return pictures (seeds, h, w, 3)."""
    with prepare(scene, technique, size=size) as prepared:
        return np.array([prepared.render(frame, seed).pixels for seed in range(seeds)], dtype=np.float64)


def assert_estimates(
    pictures: FloatArray, truth: FloatArray, *, spread: float, rare: float, bound: float = 0.0
) -> None:
    """Assert that pictures (n, h, w, 3) are unbiased estimates of `truth`, which is known to `bound`.

    Single values and the whole picture's mean are held to Student's t: once in 10 000 tests would a right one fail.
    `spread` is the most that the standard errors may be in the root mean square. `rare` is the brightest contribution
    over the number of a pixel's samples in all pictures: an event that none has seen is worth at most 14 of these, else
    it were seen with probability 1 - e^-14.
    """
    n = len(pictures)
    error = pictures.std(axis=0, ddof=1) / math.sqrt(n)
    off = pictures.mean(axis=0) - truth
    limit = stats.t.ppf(1 - 1e-4 / (2 * off.size), n - 1) * error + 14 * rare + bound
    assert (np.abs(off) <= limit).all(), f"off by up to {np.max(np.abs(off) / limit):.2f} of what is allowed"
    whole = (pictures - truth).mean(axis=(1, 2, 3))
    whole_error = float(whole.std(ddof=1)) / math.sqrt(n)
    z = (abs(whole.mean()) - bound) / max(whole_error, 1e-7)
    assert z < stats.t.ppf(1 - 5e-5, n - 1), f"the whole is off by {z:.1f} standard errors, {whole.mean():.2e}"
    assert np.sqrt((error**2).mean()) <= spread


def ceiling(x0: float, x1: float, z0: float, z1: float, height: float, radiance: float = 1.0) -> Light:
    """Return a light that shines down."""
    corners = ((x0, height, z0), (x1, height, z0), (x1, height, z1), (x0, height, z1))
    return Light(corners, (radiance, radiance, radiance))


def flat(points: object, color: Vec3 = (1.0, 1.0, 1.0), kind: str = "diffuse", **options: object) -> Surface:
    return polygon(points, color=color, material=Material(kind), **options)  # type: ignore[arg-type]


def at_height(x0: float, x1: float, z0: float, z1: float, height: float, **options: object) -> Surface:
    corners = [(x0, height, z1), (x1, height, z1), (x1, height, z0), (x0, height, z0)]
    return flat(corners, uv=SQUARE_UV, **options)  # type: ignore[arg-type]


def corner(a: FloatArray, b: FloatArray, height: float) -> FloatArray:
    """Return the irradiance below the corner of a parallel rectangle a x b of radiance 1 (Howell, view factor B-3)."""
    x, y = a / height, b / height
    p, q = np.sqrt(1 + x * x), np.sqrt(1 + y * y)
    return 0.5 * (x / p * np.arctan(y / p) + y / q * np.arctan(x / q))


def rectangle(x0: FloatArray, x1: FloatArray, z0: FloatArray, z1: FloatArray, height: float) -> FloatArray:
    """Return the irradiance at the origin from a parallel rectangle, by corners with their signs."""
    return corner(x1, z1, height) - corner(x0, z1, height) - corner(x1, z0, height) + corner(x0, z0, height)


def pixel_means(
    value: Callable[[FloatArray, FloatArray], FloatArray], camera: Camera, size: tuple[int, int], kinks: list[float]
) -> FloatArray:
    """Return the means (h, w, 1) of value(x, z) over the pixels of DOWN's picture, split where it has kinks in x."""
    nodes, weights = np.polynomial.legendre.leggauss(10)
    assert camera.height is not None
    step = camera.height / size[1]
    out = np.zeros((size[1], size[0], 1))
    for i, j in np.ndindex(size[1], size[0]):
        x0, z0 = camera.position[0] + (j - size[0] / 2) * step, camera.position[2] + (i - size[1] / 2) * step
        borders = sorted({x0, x0 + step, *(k for k in kinks if x0 < k < x0 + step)})
        for a, b in itertools.pairwise(borders):
            x, z = np.meshgrid(a + (b - a) * (nodes + 1) / 2, z0 + step * (nodes + 1) / 2)
            out[i, j] += (b - a) / step * (np.outer(weights, weights) / 4 * value(x, z)).sum()
    return out


# Penumbrae. What lies at x < edge at half the light's height hides all of the light at x' < 2 edge - x.

LAMP = (-0.5, 0.5, -0.4, 0.6, 2.0)
EDGE = 0.1


def seen_past(edge: float) -> Callable[[FloatArray, FloatArray], FloatArray]:
    """Return the radiance of a white floor at (x, z) under the part of LAMP that is seen past an edge at height 1."""
    x0, x1, z0, z1, height = LAMP

    def value(x: FloatArray, z: FloatArray) -> FloatArray:
        begin = np.clip(2 * edge - x, x0, x1)
        return rectangle(begin - x, x1 - x, z0 - z, z1 - z, height) / math.pi

    return value


def kinks_past(edge: float) -> list[float]:
    return [2 * edge - LAMP[1], 2 * edge - LAMP[0]]


def edge_scene(edge: float = EDGE, *, motion: Motion | None = None, shutter: float = 0.0) -> Scene:
    occluder = at_height(edge - 9.0, edge, -9.0, 9.0, 1.0, kind="unlit", motion=motion)
    camera = replace(DOWN, position=(0.2, 0.5, 0.0), target=(0.2, 0.0, 0.0), height=0.18)
    animation = Animation(fps=10.0, shutter=shutter)
    return Scene("edge", camera, (flat(FLOOR), occluder), lights=(ceiling(*LAMP),), animation=animation)


@pytest.fixture(scope="module")
def penumbra() -> FloatArray:
    scene = edge_scene()
    truth = pixel_means(seen_past(EDGE), scene.camera, LENGTH, kinks_past(EDGE))
    # the picture reaches over all of the penumbra, from umbra to full light
    assert truth[:, 0].max() == 0.0
    assert np.ptp(truth) > 0.05
    return truth


def test_the_penumbra_s_closed_form_is_the_reference_s(penumbra: FloatArray) -> None:
    frame = render(edge_scene(), "reference:", size=LENGTH)
    assert frame.uncertainty_kind == "bound"
    assert frame.uncertainty is not None
    assert frame.uncertainty < 1e-5
    assert np.abs(frame.pixels - penumbra).max() <= frame.uncertainty + 1e-9


@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.parametrize("shadow_rays", [1, 3, 8])
def test_the_penumbra_of_a_straight_edge_has_its_closed_form(
    penumbra: FloatArray, sampler: str, shadow_rays: int
) -> None:
    spp, seeds = 64, 24
    technique = f"raytrace:spp={spp},sampler={sampler},shadow_rays={shadow_rays}"
    pictures = sample(edge_scene(), technique, LENGTH, seeds)
    # A sample is 0 or at most area / (pi height^2) = .08: its deviation is below .04.
    assert_estimates(pictures, penumbra, spread=0.04 / math.sqrt(spp * seeds), rare=0.08 / (spp * seeds))
    assert (pictures[:, :, 0] == 0.0).all()


def test_more_shadow_rays_and_strata_bring_the_noise_down() -> None:
    deviation = {}
    for sampler, rays in itertools.product(SAMPLERS, (1, 4, 16)):
        pictures = sample(edge_scene(), f"raytrace:spp=4,sampler={sampler},shadow_rays={rays}", LENGTH, 24)
        deviation[sampler, rays] = float(np.sqrt(pictures.var(axis=0, ddof=1).mean()))
    # Independent points: the variance is that over places in the pixel, which is small, plus the light's over its rays.
    # 24 x 72 values have a deviation that is known to 2 %.
    assert deviation["random", 1] / deviation["random", 4] == pytest.approx(2.0, abs=0.2)
    assert deviation["random", 4] / deviation["random", 16] == pytest.approx(2.0, abs=0.3)
    # All shadow rays of a pixel are one stratified set, however many to a camera ray.
    for sampler, rays in itertools.product(SAMPLERS[1:], (1, 4, 16)):
        assert deviation[sampler, rays] < 0.75 * deviation["random", rays], (sampler, rays)
    assert deviation["sobol", 16] < 0.35 * deviation["random", 16]
    assert deviation["multijittered", 16] < 0.5 * deviation["random", 16]


@pytest.mark.parametrize("sampler", ["random", "sobol"])
def test_a_moving_occluder_has_the_mean_of_its_penumbrae(sampler: str) -> None:
    # The edge goes from -0.1 to 0.1 in a shutter of half the frame; frame 2 starts two intervals of 0.4 later.
    scene = edge_scene(-0.9, motion=Motion((4.0, 0.0, 0.0)), shutter=0.5)
    nodes, weights = np.polynomial.legendre.leggauss(6)
    truth = np.zeros((LENGTH[1], LENGTH[0], 1))
    for u, w in zip(nodes, weights, strict=True):
        edge = -0.9 + 2 * 0.4 + 0.1 * (u + 1)
        truth += w / 2 * pixel_means(seen_past(edge), scene.camera, LENGTH, kinks_past(edge))
    # Six moments leave an error of the kinks that move through the pixels, far below 1e-4 (12 moments differ by 1e-5).
    pictures = sample(scene, f"raytrace:spp=32,sampler={sampler}", LENGTH, 24, frame=2)
    assert_estimates(pictures, truth, spread=0.0016, rare=0.08 / (32 * 24), bound=2e-5)
    still = sample(scene, f"raytrace:spp=32,sampler={sampler},time=center", LENGTH, 24, frame=2)
    assert_estimates(
        still,
        pixel_means(seen_past(0.0), scene.camera, LENGTH, kinks_past(0.0)),
        spread=0.0016,
        rare=0.08 / (32 * 24),
    )
    assert np.abs(pictures.mean(axis=0) - still.mean(axis=0)).max() > 0.0015


# What lights look like, hide and shade


def below(size_world: float = 2.0) -> Camera:
    """Return a camera that looks up from the floor."""
    return Camera(
        "orthographic", position=(0.0, 0.0, 0.0), target=(0.0, 1.0, 0.0), up=(0.0, 0.0, 1.0), height=size_world
    )


@pytest.mark.parametrize("engine", ["packet", "portable"])
def test_lights_are_seen_in_front_and_black_from_behind_over_what_lies_in_their_plane(engine: str) -> None:
    light = ceiling(-0.5, 0.5, -0.5, 0.5, 1.0, 7.0)
    roof = at_height(-2, 2, -2, 2, 1.0)
    above = replace(below(), position=(0.0, 3.0, 0.0), target=(0.0, 1.0, 0.0))
    for camera, value in ((below(), 7.0), (above, 0.0)):
        scene = Scene("l", camera, (roof,), lights=(light,), background=(0.5, 0.25, 1.0))
        pixels = render(scene, f"raytrace:spp=4,engine={engine}", size=(8, 8)).pixels
        expected = np.zeros((8, 8, 3))
        expected[2:6, 2:6] = value
        # in the light's plane the roof is lit by nothing
        np.testing.assert_array_equal(pixels, expected)
        alone = render(replace(scene, objects=()), f"raytrace:spp=4,engine={engine}", size=(8, 8)).pixels
        expected[expected.sum(axis=2) == 0] = (0.5, 0.25, 1.0)
        expected[2:6, 2:6] = value
        np.testing.assert_array_equal(alone, expected)


def test_the_coverage_of_a_light_that_is_seen_is_exact() -> None:
    light = ceiling(-0.5, 0.53, -0.41, 0.5, 1.0, 3.0)
    pixels = render(Scene("l", below(), (), lights=(light,)), "raytrace:spp=4096,sampler=grid", size=(8, 8)).pixels
    # 64 x 64 samples a pixel count an axis-parallel side with an error below 1/64 of its length
    assert pixels.sum() / 3 / 16 == pytest.approx(3 * 1.03 * 0.91, abs=3 * (1.03 + 0.91) / 4 / 64)
    assert (pixels[3, 3:5] == 3.0).all()


def test_the_side_that_is_seen_is_the_side_that_is_lit() -> None:
    light = ceiling(-0.5, 0.5, -0.5, 0.5, 2.0)
    under = replace(below(), position=(0.0, -1.0, 0.0))
    assert (
        render(Scene("s", under, (flat(FLOOR),), lights=(light,)), "raytrace:spp=16", size=(6, 6)).pixels.max() == 0.0
    )
    pictures = [
        render(Scene("s", DOWN, (flat(f),), lights=(light,)), "raytrace:spp=16", size=(6, 6)).pixels
        for f in (FLOOR, FLOOR[::-1])
    ]
    assert pictures[0].min() > 0.02
    np.testing.assert_allclose(pictures[0], pictures[1], rtol=1e-6)


def test_a_sheet_is_lit_on_the_side_of_the_light_alone() -> None:
    # The sheet stands on the floor and is seen from its right; the light is on one side of it or the other.
    sheet = flat([(0.0, -1.0, 1.0), (0.0, -1.0, -1.0), (0.0, 1.0, -1.0), (0.0, 1.0, 1.0)])
    camera = Camera("orthographic", position=(3.0, 0.0, 0.0), height=1.0)
    for side, least in ((1.0, 0.005), (-1.0, 0.0)):
        light = ceiling(side * 1.0 - 0.4, side * 1.0 + 0.4, -0.4, 0.4, 2.0)
        pixels = render(Scene("s", camera, (sheet,), lights=(light,)), "raytrace:spp=8", size=(4, 4)).pixels
        assert (pixels.max() == 0.0) if least == 0.0 else (pixels.min() > least)


def test_zero_radiance_is_black_and_shades_like_any_black_thing() -> None:
    light = ceiling(-0.5, 0.5, -0.5, 0.5, 2.0)
    dark = ceiling(-0.2, 0.2, -0.3, 0.3, 1.0, 0.0)
    thing = at_height(-0.2, 0.2, -0.3, 0.3, 1.0, color=(0.0, 0.0, 0.0), kind="unlit")
    camera = replace(DOWN, position=(0.0, 3.0, 0.0))
    technique = "raytrace:spp=16,sampler=random"
    lights = [(light, dark), (dark, light), (light,)]
    scenes = [Scene("z", camera, (flat(FLOOR),), lights=one) for one in lights[:2]]
    scenes.append(Scene("z", camera, (flat(FLOOR), thing), lights=lights[2]))
    pictures = [render(scene, technique, size=(12, 12)).pixels for scene in scenes]
    assert pictures[0].max() > 0.01
    for other in pictures[1:]:
        np.testing.assert_array_equal(pictures[0], other)
    only = render(
        Scene("z", camera, (flat(FLOOR),), lights=(dark,), background=(1.0, 1.0, 1.0)), technique, size=(6, 6)
    )
    assert only.pixels.max() == 0.0


def test_lights_add_up_and_shade_each_other() -> None:
    lamps = [ceiling(-0.8, 0.0, -0.4, 0.4, 2.0, 2.0), ceiling(-0.1, 0.4, -0.5, 0.2, 1.2, 1.0)]
    lamps.append(Light(((1.5, 0.2, 0.5), (1.5, 0.2, -0.5), (1.5, 1.2, -0.5), (1.5, 1.2, 0.5)), (0.5, 1.0, 3.0)))
    wall = flat([(-1.2, 0.0, 1.0), (-1.2, 0.0, -1.0), (-1.2, 0.6, -1.0), (-1.2, 0.6, 1.0)], (0.9, 0.5, 0.2))
    camera = Camera("orthographic", position=(0.5, 0.6, 2.0), target=(0.0, 0.1, 0.0), height=2.4)
    scene = Scene("sum", camera, (flat(FLOOR, (0.8, 0.9, 1.0)), wall), lights=tuple(lamps))
    technique, size, seeds = "raytrace:spp=48,sampler=sobol", (12, 10), 24
    singles = []
    for k, lamp in enumerate(lamps):
        # the other lamps' places, black
        others = [flat(o.quad, (0.0, 0.0, 0.0), "unlit") for j, o in enumerate(lamps) if j != k]
        alone = replace(scene, objects=(*scene.objects, *others), lights=(lamp,))
        singles.append(sample(alone, technique, size, seeds))
    together = sample(scene, technique, size, seeds)
    total = np.sum(singles, axis=0)
    # Pictures of the sum and the sum of the pictures have one mean. Their samples are apart only in which light they go
    # to, so their difference's spread over seeds is the yardstick, as before; the brightest sample is seen at 3.
    assert_estimates(together - total, np.zeros((10, 12, 1)), spread=0.02, rare=3.0 / (48 * seeds))
    reference = render(scene, "reference:", size=size)
    assert reference.uncertainty is not None
    assert reference.uncertainty < 1e-4
    assert_estimates(together, reference.pixels, spread=0.02, rare=3.0 / (48 * seeds), bound=reference.uncertainty)


@pytest.mark.parametrize("moving", [False, True])
def test_unlit_and_diffuse_things_throw_one_shadow(moving: bool) -> None:
    motion = Motion((1.0, 0.0, 0.5)) if moving else Motion()
    scenes = [
        Scene(
            "shadow",
            DOWN,
            (flat(FLOOR), at_height(-0.4, 0.3, -0.3, 0.5, 1.0, kind=kind, motion=motion)),
            lights=(ceiling(*LAMP),),
            animation=Animation(fps=1.0, shutter=0.3),
        )
        for kind in ("unlit", "diffuse")
    ]
    pictures = [render(scene, "raytrace:spp=16,sampler=random", size=(12, 12), frame=0).pixels for scene in scenes]
    np.testing.assert_array_equal(*pictures)
    bare = render(replace(scenes[0], objects=scenes[0].objects[:1]), "raytrace:spp=16,sampler=random", size=(12, 12))
    assert pictures[0].mean() < 0.7 * bare.pixels.mean()
    assert pictures[0].max() > 0


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("engine", ["packet", "portable"])
def test_cut_out_things_throw_shadows_with_holes(moving: bool, engine: str) -> None:
    # Texels of a 4 x 4 image are there or not: as good as the squares that are left of it.
    rng = np.random.default_rng(5)
    texels = np.ones((4, 4, 4), np.float32)
    texels[..., 3] = rng.random((4, 4)) < 0.5
    motion = Motion((1.0, 0.0, 0.5)) if moving else Motion()
    whole = at_height(-0.4, 0.4, -0.4, 0.4, 1.0, kind="unlit", texture="holes", motion=motion)
    # v runs from z1 = .4 to z0 = -.4
    parts = [
        at_height(-0.4 + 0.2 * k, -0.2 + 0.2 * k, 0.2 - 0.2 * r, 0.4 - 0.2 * r, 1.0, kind="unlit", motion=motion)
        for r, k in zip(*np.nonzero(texels[..., 3]), strict=True)
    ]
    assert 4 < len(parts) < 12
    base = Scene("holes", DOWN, (flat(FLOOR),), lights=(ceiling(*LAMP),), animation=Animation(fps=1.0, shutter=0.3))
    textures = {"holes": ImageTexture(read_only(texels), alpha_cutoff=0.5)}
    cut = replace(base, objects=(*base.objects, whole), textures=textures)
    squares = replace(base, objects=(*base.objects, *parts))
    technique = f"raytrace:spp=16,sampler=random,engine={engine}"
    pictures = [render(scene, technique, size=(16, 16)).pixels for scene in (cut, squares)]
    assert pictures[0].mean() < 0.9 * render(base, technique, size=(16, 16)).pixels.mean()
    # a shadow ray in some thousands passes a border nearer than float32 tells
    assert (np.abs(pictures[0] - pictures[1]).max(axis=2) > 1e-6).sum() <= 2


@pytest.mark.parametrize("kind", ["checker", "image"])
def test_a_textured_floor_is_lit_as_its_texture_says(kind: str) -> None:
    texels = np.random.default_rng(1).random((5, 7, 4)).astype(np.float32)
    textures = {"t": Checker((5.0, 3.0), (0.1, 0.0, 0.3)) if kind == "checker" else ImageTexture(read_only(texels))}
    floor = at_height(-2, 2, -2, 2, 0.0, color=(0.9, 0.8, 0.7), texture="t")
    post = at_height(-0.2, 0.4, -0.5, 0.1, 0.3, color=(0.3, 0.6, 0.1))
    camera = Camera("perspective", position=(0.3, 1.6, 2.0), target=(0.0, 0.0, 0.0), fov_y_deg=45.0)
    scene = Scene("textured", camera, (floor, post), textures=textures, lights=(ceiling(*LAMP, 8.0),))
    reference = render(scene, "reference:", size=(14, 12))
    assert reference.uncertainty_kind == "bound"
    assert reference.uncertainty is not None
    pictures = sample(scene, "raytrace:spp=64,sampler=sobol", (14, 12), 20)
    assert_estimates(
        pictures, reference.pixels, spread=0.004, rare=1.2 * reference.pixels.max() / 1280, bound=reference.uncertainty
    )


# References


@pytest.mark.parametrize(
    ("scene", "spp", "spread"),
    [
        ("soft-shadow:light_size=1.0,occluder_height=0.9,slats=3", 32, 0.005),
        ("soft-shadow:light_size=0.2,light_height=2.0,slats=2,occluder_height=0.3", 32, 0.005),
        ("depth-of-field:focus=3.5,lens_radius=0.2", 64, 0.006),
        ("depth-of-field:focus=12.0,lens_radius=0.05", 64, 0.006),
        ("pixel-time-lens-light:shutter=0,lens_radius=0,rev_per_s=-4", 32, 0.005),
    ],
)
def test_catalog_scenes_agree_with_their_references(scene: str, spp: int, spread: float) -> None:
    loaded, size, seeds = load_scene(scene), (24, 20), 24
    reference = render(loaded, "reference:", size=size, frame=1)
    assert reference.uncertainty_kind == "bound"
    assert reference.uncertainty is not None
    assert reference.uncertainty < 1e-4
    pictures = sample(loaded, f"raytrace:spp={spp},sampler=sobol", size, seeds, frame=1)
    rare = max(1.0, float(reference.pixels.max())) / (spp * seeds)
    assert_estimates(pictures, reference.pixels, spread=spread, rare=rare, bound=reference.uncertainty)


def average_of_exact(
    scene: Scene, size: tuple[int, int], frame: int, log2: int, replicates: int
) -> tuple[FloatArray, float]:
    """Return the mean over shutter and lens (h, w, 3) of exact pictures of instants seen from points, and its error.

    The points are scrambled Sobol sets, 2^log2 of them each; the error is the largest standard error over replicates.
    """
    faces, paths, spec = build_faces(scene), scene_paths(scene), make_filter("box", 0.5)
    means = []
    for seed in range(replicates):
        total = np.zeros((size[1], size[0], 3))
        for t, u, v in stats.qmc.Sobol(3, seed=seed).random_base2(log2):
            fraction, radius = t * scene.animation.shutter, scene.camera.lens_radius * math.sqrt(u)
            view = view_at(scene.camera, scene.animation, frame, fraction, size)
            focus = focus_at(scene.camera, scene.animation, frame, fraction)
            a, b = radius * math.cos(2 * math.pi * v), radius * math.sin(2 * math.pi * v)
            shown = lens_view(view, a, b, focus)
            total += draw_lit(scene, faces, paths, shown, frame, fraction, spec, target=1e-4).pixels
        means.append(total / 2**log2)
    return np.mean(means, axis=0), float(np.std(means, axis=0, ddof=1).max()) / math.sqrt(replicates)


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_pixel_time_lens_and_light_together_have_the_mean_of_exact_pictures(
    sampler: str, all_at_once: tuple[FloatArray, float]
) -> None:
    truth, error = all_at_once
    # 1e-4; eight standard errors of four replicates: twice what was seen of the largest against 1024 points
    assert error < 2.5e-4
    scene = load_scene("pixel-time-lens-light")
    pictures = sample(scene, f"raytrace:spp=64,sampler={sampler},shadow_rays=2", (8, 6), 32, frame=1)
    assert_estimates(pictures, truth, spread=0.006, rare=1.0 / (64 * 32), bound=8 * error)


@pytest.fixture(scope="module")
def all_at_once() -> tuple[FloatArray, float]:
    scene = load_scene("pixel-time-lens-light")
    return average_of_exact(scene, (8, 6), 1, 7 if "TRIALS" in os.environ else 4, 4)


@pytest.mark.skipif("TRIALS" not in os.environ, reason="the reference takes a minute; TRIALS asks for it")
def test_pixel_time_lens_and_light_together_agree_with_the_reference(all_at_once: tuple[FloatArray, float]) -> None:
    reference = render(load_scene("pixel-time-lens-light"), "reference:", size=(8, 6), frame=1)
    assert reference.uncertainty_kind == "confidence"
    assert reference.uncertainty is not None
    assert np.abs(reference.pixels - all_at_once[0]).max() <= reference.uncertainty + 8 * all_at_once[1]


def random_scene(seed: int) -> Scene:
    """Return diffuse polygons in the air over a floor under one to three lights."""
    rng = np.random.default_rng([77, seed])
    objects = [flat(FLOOR, (0.8, 0.7, 0.9))]
    for k in range(int(rng.integers(3, 7))):
        c = np.array([rng.uniform(-1.2, 1.2), rng.uniform(0.2, 1.2), rng.uniform(-1.2, 1.2)])
        a, b = np.linalg.qr(rng.normal(size=(3, 2)))[0].T * rng.uniform(0.2, 0.6)
        angles = 2 * np.pi * (np.arange(3 + k % 4) + rng.uniform(0.1, 0.9, 3 + k % 4)) / (3 + k % 4)
        points = c + np.cos(angles)[:, None] * a + np.sin(angles)[:, None] * b
        red, green, blue = rng.uniform(0.2, 1.0, 3).tolist()
        objects.append(flat(points, (red, green, blue), "unlit" if rng.random() < 0.15 else "diffuse"))
    lights = []
    for _ in range(1 + seed % 3):
        # somewhere above, turned to near the middle
        place = np.array([rng.uniform(-1.5, 1.5), rng.uniform(1.6, 3.0), rng.uniform(-1.5, 1.5)])
        down = rng.normal(size=3) * 0.3 - place
        down /= np.linalg.norm(down)
        a = np.cross(down, rng.normal(size=3))
        a *= rng.uniform(0.15, 0.5) / np.linalg.norm(a)
        b = np.cross(down, a) * rng.uniform(0.6, 1.5)
        outline = [place - a - b, place + a - b, place + a + b, place - a + b]
        quad = tuple((float(x), float(y), float(z)) for x, y, z in outline)
        red, green, blue = rng.uniform(2.0, 9.0, 3).tolist()
        lights.append(Light(quad, (red, green, blue)))  # type: ignore[arg-type]
    camera = Camera("perspective", position=(0.5, 2.6, 5.0), target=(0.0, 0.4, 0.0), fov_y_deg=38.0)
    return Scene(f"random-{seed}", camera, tuple(objects), lights=tuple(lights), background=(0.05, 0.06, 0.1))


@pytest.mark.parametrize("seed", range(TRIALS))
def test_random_scenes_agree_with_their_references(seed: int) -> None:
    scene, size, seeds, spp = random_scene(seed), (12, 10), 32, 32
    reference = render(scene, "reference:", size=size)
    assert reference.uncertainty is not None
    assert reference.uncertainty < 1e-3
    sampler = ("sobol", "jittered", "multijittered", "random")[seed % 4]
    pictures = sample(scene, f"raytrace:spp={spp},sampler={sampler},shadow_rays={1 + seed % 2}", size, seeds)
    # Lights may be in the picture, at 9; and light that near things get weighs as much as that.
    rare = max(9.0, float(reference.pixels.max())) / (spp * seeds)
    assert_estimates(pictures, reference.pixels, spread=0.1, rare=rare / 4, bound=reference.uncertainty)
    # Nor are the estimates closer to the truth than their spread allows: t^2 has a mean of (n - 1) / (n - 3).
    error = pictures.std(axis=0, ddof=1) / math.sqrt(seeds)
    clear = error > 20 * reference.uncertainty
    assert clear.mean() > 0.3
    squares = ((pictures.mean(axis=0) - reference.pixels)[clear] / error[clear]) ** 2
    # Channels go together: some 40 independent values at least, whose mean square has a deviation of (2 / 40)^.5 = .22.
    assert 0.4 < squares.mean() * (seeds - 3) / (seeds - 1) < 1.9
