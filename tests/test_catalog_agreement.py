"""Every scene of the catalog, at a small size: whatever a renderer draws agrees with the reference.

Samples of a pixel are independent and lie between the darkest and the brightest that the scene has, so that Bernstein's
inequality bounds how far a mean of N can be from the truth, rare events included: with L = ln(2 values / p),

    |mean - truth| <= sqrt(2 v L / N) + 2 (hi - lo) L / (3 N),    v <= (hi - truth)(truth - lo),

for all pixels at once but with probability p (strata only lower the variance). That finds local errors; systematic ones
are found by what the seeds share. Of the ray tracer, whose pixels are independent, the mean of (mean - truth)^2 less
s^2 / S over the pixels is the square of the error without its noise, known to four standard errors. The rasterizer's
passes share their pattern over the picture: there the products of two seeds' errors, averaged over the picture, are one
independent value for each pair of seeds, of mean zero if nothing is wrong, and Student's t says how far off is too far.

The rasterizer puts corners on a grid of 1/256 pixel: each of its edges lies within half a step each way of where it
should, which adds at most 2^-8.5 of a pixel times the length of edges in the pixel.
"""

import math
import statistics
import time
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter
from scipy.special import stdtrit

from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.frame import Frame
from aliasbench.scenes.catalog import SCENES, build_scene
from aliasbench.scenes.entries import Choice
from aliasbench.scenes.errors import UnsupportedScene
from aliasbench.scenes.model import Checker, Grating, ImageTexture, Scene
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import view_at

SIZE = (48, 32)
SEEDS = {"raytrace": 4, "raster": 16}
SAMPLES, PASSES = 256, 16
MISS = 1e-4  # the chance that a true picture is refused, of each bound
SUBPIXEL = math.sqrt(0.5) / 256
TIMES = 5  # of the open shutter at which edges are looked for

NAMES = sorted(SCENES)
# Other words than the default, where the shutter is shut: a moving photograph's reference can take minutes.
# What is finer than the pixels is made coarser, or a corner's place in the rasterizer would excuse anything.
COARSE = {"grid": ",lines=50", "window-screens": ",wires=50"}
WORDS = [
    f"{name}:{key}={word}{COARSE.get(name, '')}"
    for name in NAMES
    for key, choice in SCENES[name].parameters.items()
    if isinstance(choice, Choice)
    for word in choice.names
    if word != choice.default and SCENES[name].build().animation.shutter == 0.0
]
# The artifacts' scenes in motion under an open shutter, where that has an exact reference at a low price.
OPEN = [
    "brick-floor:shutter=1",
    "checker-floor:shutter=0.5",
    "confetti:shutter=1,count=300",
    "edge-fan:shutter=1,rev_per_s=-1",
    "grid:shutter=0.5,lines=50",
    "near-horizontal-edge:shutter=1,speed=1",
    "propeller-29:shutter=0.5",
    "slivers:shutter=1,count=16",
    "window-screens:shutter=1,wires=50,speed=-9",
]
WITHOUT_REFERENCE = {"material glossy", "material glass", "diffuse interreflection"}
# Scenes whose reference takes a minute, with less to average.
EXPENSIVE = {"pixel-time-lens-light": "pixel-time-lens-light:lens_radius=0,shutter=0"}
TECHNIQUES = (
    (f"raytrace:spp={SAMPLES},sampler=jittered", SAMPLES),
    (f"raster:passes={PASSES},sampler=jittered", PASSES),
)
# Sequences that loop without a fact that says so.
LOOPS = ("brick-floor", "checker-floor", "slivers", "window-screens")


def features(scene: Scene) -> set[str]:
    """What the scene has that a renderer may refuse, in the words of the refusals."""
    kinds = {s.material.kind for s in scene.objects} - {"unlit", "diffuse"}
    out = {f"material {kind}" for kind in kinds}
    if scene.lights:
        out |= {"lights"}
    if scene.camera.lens_radius > 0.0:
        out |= {"a lens"}
    if scene.bounces:
        out |= {"diffuse interreflection"}
    return out


def brightness(scene: Scene) -> tuple[float, float]:
    """The least and the greatest value that a sample can have.

    What a point of a light brings to a surface, radiance times area times cosines over pi times squared distance, is
    less than the radiance everywhere in the scenes here.
    """
    radiances = [max(light.radiance) for light in scene.lights]
    low, high = min([*scene.background, *(0.0 for _ in radiances)]), max([*scene.background, *radiances])
    for surface in scene.objects:
        texture = None if surface.texture is None else scene.textures[surface.texture]
        least, most = 0.0, 1.0
        if texture is None:
            least = 1.0
        elif isinstance(texture, ImageTexture):
            least, most = float(texture.texels[..., :3].min()), float(texture.texels[..., :3].max())
        elif isinstance(texture, Checker):
            least, most = min(*texture.black, *texture.white), max(*texture.black, *texture.white)
        elif isinstance(texture, Grating):
            least, most = min(*texture.low, *texture.high), max(*texture.low, *texture.high)
        low, high = min(low, least * min(surface.color)), max(high, most * max(surface.color))
    return low, high


def edge_lengths(scene: Scene, frame: int) -> NDArray[np.float64]:
    """How many pixels of triangles' edges there are in and next to each pixel, (h, w): a little more than in truth."""
    width, height = SIZE
    total = np.zeros((height, width))
    fractions = np.linspace(0.0, scene.animation.shutter, TIMES) if scene.animation.shutter else [0.0]
    for fraction in fractions:
        view = view_at(scene.camera, scene.animation, frame, float(fraction), SIZE)
        for surface in scene.objects:
            m = object_matrix(surface.motion, scene.animation, frame, float(fraction))
            points = surface.vertices @ m[:3, :3].T + m[:3, 3]
            ends = np.unique(np.sort(surface.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
            a, b = points[ends[:, 0]], points[ends[:, 1]]
            p, q = (view.project(end) for end in (a, b))
            ahead = (p[:, 2] > 0) & (q[:, 2] > 0)
            beside = (np.maximum(p, q)[:, :2] < 0).any(axis=1) | (np.minimum(p, q)[:, :2] > SIZE).any(axis=1)
            a, b = a[~(ahead & beside)], b[~(ahead & beside)]
            if not len(a):
                continue
            steps = max(8, min(1024, 1_000_000 // len(a)))
            for k in range(0, len(a), 4096):
                share = np.linspace(0.0, 1.0, steps + 1)[:, None, None]
                seen = view.project(a[k : k + 4096] * (1 - share) + b[k : k + 4096] * share)
                length = np.hypot(*np.moveaxis(np.diff(seen[..., :2], axis=0), -1, 0))
                middle = (seen[1:, :, :2] + seen[:-1, :, :2]) / 2
                front = (seen[1:, :, 2] > 0) & (seen[:-1, :, 2] > 0)
                total += np.histogram2d(
                    middle[..., 1][front], middle[..., 0][front], bins=(height, width),
                    range=((0, height), (0, width)), weights=length[front],
                )[0]  # fmt: skip
    wide: NDArray[np.float64] = maximum_filter(total / len(fractions), size=3)
    return wide[..., None]


def bernstein(truth: NDArray[np.float64], count: int, low: float, high: float) -> NDArray[np.float64]:
    """The bound of the module's first lines."""
    log = math.log(2 * truth.size / MISS)
    variance = np.maximum(high - truth, 0.0) * np.maximum(truth - low, 0.0)
    return np.sqrt(2 * variance * log / count) + 2 * (high - low) * log / (3 * count)


def draw(scene: Scene, technique: str, frame: int) -> NDArray[np.float64] | UnsupportedScene:
    """Pictures (seeds, h, w, 3), or the refusal."""
    try:
        with prepare(scene, technique, size=SIZE) as prepared:
            frames = [
                prepared.render(frame=frame, seed=seed).pixels for seed in range(SEEDS[technique.partition(":")[0]])
            ]
    except UnsupportedScene as refusal:
        return refusal
    return np.array(frames, dtype=np.float64)


def disagreement(
    scene: Scene, renderer: str, pictures: NDArray[np.float64], samples: int, truth: Frame, frame: int
) -> str | None:
    """What is wrong with pictures (seeds, h, w, 3) of so many samples to a pixel each; None if nothing is."""
    if not np.isfinite(pictures).all():
        return "a value is not finite"
    mean, exact = pictures.mean(axis=0), np.asarray(truth.pixels, dtype=np.float64)
    assert truth.uncertainty is not None
    low, high = brightness(scene)
    shift = SUBPIXEL * (high - low) * edge_lengths(scene, frame) if renderer == "raster" else np.zeros(1)
    # 2e-6: rounding of colours and sums in float32
    allowed = truth.uncertainty + bernstein(exact, len(pictures) * samples, low, high) + 2e-6 * high + shift
    worst = np.unravel_index(int(np.argmax(np.abs(mean - exact) / allowed)), mean.shape)
    if abs(mean[worst] - exact[worst]) > allowed[worst]:
        return f"pixel {worst}: {mean[worst]:.6g}, in truth {exact[worst]:.6g} to {allowed[worst]:.2g}"
    known = float(np.mean((truth.uncertainty + 2e-6 * high + shift) ** 2))
    if renderer == "raytrace":
        # channels see the same samples: one value for a pixel
        shared = ((mean - exact) ** 2 - pictures.var(axis=0, ddof=1) / len(pictures)).mean(axis=2).ravel()
        factor = 4.0
    else:
        errors = pictures - exact
        shared = (errors[0::2] * errors[1::2]).mean(axis=(1, 2, 3))
        factor = float(stdtrit(len(shared) - 1, 1 - MISS))
    error = float(shared.std(ddof=1)) / math.sqrt(shared.size)
    if shared.mean() > known + factor * error:
        return f"mean square error beside noise {shared.mean():.3g}, in truth 0 to {known + factor * error:.2g}"
    return None


@pytest.mark.parametrize("text", [*(EXPENSIVE.get(name, name) for name in NAMES), *WORDS, *OPEN])
def test_what_the_renderers_draw_agrees_with_the_reference(text: str) -> None:
    scene = build_scene(text)
    frame = scene.animation.frames // 2
    truth: Frame | None = None
    for technique, samples in TECHNIQUES:
        renderer = technique.partition(":")[0]
        pictures = draw(scene, technique, frame)
        if isinstance(pictures, UnsupportedScene):
            assert str(pictures).startswith(f"{renderer}: ")
            assert any(feature in str(pictures) for feature in features(scene)), pictures
            continue
        assert np.isfinite(pictures).all()
        assert np.ptp(pictures) > 1e-3
        if features(scene) & WITHOUT_REFERENCE:
            with pytest.raises(UnsupportedScene, match="|".join(features(scene) & WITHOUT_REFERENCE)):
                render(scene, "reference:", size=SIZE, frame=frame)
            continue
        truth = render(scene, "reference:", size=SIZE, frame=frame) if truth is None else truth
        assert np.ptp(truth.pixels) > 1e-3
        assert disagreement(scene, renderer, pictures, samples, truth, frame) is None


@pytest.mark.parametrize(("technique", "samples"), TECHNIQUES)
@pytest.mark.parametrize(
    ("text", "least_px"), [("edge-fan", 0.1), ("propeller", 0.1), ("checker-floor", 0.1), ("brick-floor", 0.25)]
)
def test_the_comparison_notices_a_picture_that_is_a_little_off(
    text: str, least_px: float, technique: str, samples: int
) -> None:
    scene = build_scene(text)
    view = view_at(scene.camera, scene.animation, 0, 0.0, SIZE)
    # that much at the distance of the scene's middle, which of a floor is a few units off
    aside = least_px * (4.0 if view.perspective else 1.0) / view.scale
    x, y, z = scene.camera.position
    u, v, w = scene.camera.target
    camera = replace(scene.camera, position=(x + aside, y, z), target=(u + aside, v, w))
    pictures = draw(replace(scene, camera=camera), technique, 0)
    truth = render(scene, "reference:", size=SIZE)
    assert not isinstance(pictures, UnsupportedScene)
    assert disagreement(scene, technique.partition(":")[0], pictures, samples, truth, 0) is not None


@pytest.mark.parametrize("name", NAMES)
def test_a_scene_is_built_in_under_fifty_milliseconds(name: str) -> None:
    entry = SCENES[name]
    entry.build()
    took = []
    for _ in range(3):
        begin = time.perf_counter()
        entry.build()
        took.append(time.perf_counter() - begin)
    assert statistics.median(took) < 0.05


def says_it_loops(scene: Scene) -> bool:
    """Whether facts say that the frames hold whole periods of everything that moves."""
    seconds = scene.animation.frames / scene.animation.fps
    counts = [seconds / p.period for p in scene.facts.pans] + [seconds * r.rev_per_s for r in scene.facts.rotors]
    return bool(counts) and all(abs(c - round(c)) < 1e-9 and round(c) != 0 for c in counts)


LOOPING = [n for n in NAMES if not (s := SCENES[n].build()).is_static and (n in LOOPS or says_it_loops(s))]


@pytest.mark.parametrize("name", LOOPING)
def test_a_loop_ends_where_it_began(name: str) -> None:
    scene = SCENES[name].build()
    with prepare(scene, "reference:", size=SIZE) as prepared:
        first, moved, after = (prepared.render(frame=n) for n in (1, 2, 1 + scene.animation.frames))
    assert first.uncertainty is not None
    assert after.uncertainty is not None
    known = first.uncertainty + after.uncertainty
    # 1e-9: what rounding of the frame's time does to places, of a few thousand edges in a pixel
    np.testing.assert_allclose(after.pixels, first.pixels, rtol=0, atol=known + 1e-9)
    if name != "propeller-30":
        assert np.abs(moved.pixels - first.pixels).max() > 1e-3


def test_every_sequence_of_the_artifacts_loops() -> None:
    ours = {"brick-floor", "checker-floor", "confetti", "slivers", "grid", "window-screens", "propeller"}
    assert ours | {"propeller-1", "propeller-29", "propeller-30"} <= set(LOOPING)
