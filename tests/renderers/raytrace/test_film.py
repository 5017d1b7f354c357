"""Laws of the film: no seams, the same bits however the work is cut, sums that hold, and filters too wide refused."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.raytrace import development
from aliasbench.renderers.sampling.filters import filter_of
from aliasbench.renderers.technique import parse_technique
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Camera, Light, Material, Scene

POSITIVE = (
    "filter=box", "filter=box,radius=.3", "filter=box,radius=2.2", "filter=tent", "filter=tent,radius=.45",
    "filter=cone", "filter=cone,radius=.55", "filter=cone,radius=2", "filter=gaussian", "filter=gaussian,sigma=.2",
    "filter=gaussian,sigma=.01", "filter=gaussian,sigma=.07", "filter=gaussian,sigma=.09",
    "filter=gaussian,sigma=1e-6", "filter=gaussian,sigma=1.5,radius=4",
    "filter=gaussian,sigma=1e6,radius=.7", "filter=gaussian,radius=1e9",
)  # fmt: skip
LOBES = ("filter=mitchell", "filter=mitchell,radius=1.5", "filter=lanczos", "filter=lanczos,radius=2")
SPLATS = ("filter=tent,radius=1.3", "filter=cone", "filter=lanczos,radius=2")
EVERY_WAY = (
    "spp=5,filter=tent", "spp=33,sampler=random,filter=gaussian,sigma=.8,radius=2", "spp=16,filter=lanczos",
    "spp=7,filter=cone,radius=1.7", "spp=9,filter=mitchell,weighting=distribution", "spp=4,filter=box,radius=1.2",
    "adaptive=pooled,tolerance=.02", "adaptive=unbiased,tolerance=.03", "adaptive=pooled,filter=tent,tolerance=.05",
    "adaptive=unbiased,filter=cone,sampler=sobol,tolerance=.05", "adaptive=unbiased,pattern=shared,min_spp=3",
    "adaptive=unbiased,filter=tent,weighting=distribution,min_spp=1",
)  # fmt: skip
BACKGROUND = (0.1, 0.37, 1234.5)


@pytest.fixture(scope="module")
def shapes(polygon: Any, flat_scene: Any) -> Scene:
    """Return a few polygons on 11 rows; some leave the picture."""
    rng = np.random.default_rng(3)
    objects = []
    for _ in range(9):
        angles = 2 * np.pi * (np.arange(3) + rng.uniform(0.1, 0.9, 3)) / 3
        points = np.stack([np.cos(angles), np.sin(angles)], axis=1) * rng.uniform(0.4, 6) + rng.uniform(-8, 8, 2)
        color = tuple(float(c) for c in np.round(rng.uniform(0, 2, 3), 3))
        objects.append(polygon(np.c_[points, np.zeros(3)], color=color))
    scene: Scene = flat_scene(objects, height=11.0, background=(0.1, 0.0, 0.3))
    return scene


@pytest.fixture(scope="module")
def lit_scene(quad: Any, flat_scene: Any) -> Scene:
    """Return a diffuse wall, a glossy card before it, and a light."""
    wall = dataclasses.replace(quad(-9, -9, 9, 9, -4.0), material=Material("diffuse"))
    card = dataclasses.replace(quad(-3, -2, 1.3, 2.7, -2.0), material=Material("glossy", roughness=0.3))
    light = Light(((-2.0, 6.0, 4.0), (-2.0, 3.0, 5.0), (2.0, 3.0, 5.0), (2.0, 6.0, 4.0)), (9.0, 8.0, 7.0))
    scene: Scene = dataclasses.replace(flat_scene([wall, card], height=11.0), lights=(light,))
    return scene


def pixels_of(scene: Scene, technique: str, size: tuple[int, int] = (14, 11), seed: int = 0) -> np.ndarray:
    pixels = render(scene, "raytrace:" + technique, size=size, seed=seed).pixels
    assert pixels.shape == (size[1], size[0], 3)
    assert pixels.dtype == np.float32
    assert np.isfinite(pixels).all()
    return pixels


@pytest.mark.parametrize("sampling", ["spp=1", "spp=1,sampler=random", "spp=16,sampler=sobol,pattern=shared"])
@pytest.mark.parametrize("weighting", ["samples", "distribution"])
@pytest.mark.parametrize("filtering", POSITIVE)
def test_a_flat_background_stays_flat(flat_scene: Any, filtering: str, weighting: str, sampling: str) -> None:
    scene = flat_scene([], background=BACKGROUND)
    pixels = pixels_of(scene, f"{sampling},{filtering},weighting={weighting}", (31, 17), seed=3)
    np.testing.assert_allclose(pixels, np.broadcast_to(np.float32(BACKGROUND), pixels.shape), rtol=1e-6)


@pytest.mark.parametrize("adaptive", ["pooled", "unbiased", "unbiased,pattern=shared", "unbiased,min_spp=1"])
@pytest.mark.parametrize("filtering", ["filter=box", "filter=cone,radius=.6", "filter=gaussian", "filter=lanczos"])
def test_a_flat_background_stays_flat_and_cheap_under_adaptive_sampling(
    flat_scene: Any, filtering: str, adaptive: str
) -> None:
    scene = flat_scene([], background=BACKGROUND)
    frame = render(scene, f"raytrace:adaptive={adaptive},{filtering}", size=(7, 5))
    np.testing.assert_allclose(frame.pixels, np.broadcast_to(np.float32(BACKGROUND), (5, 7, 3)), rtol=1e-6)
    assert frame.sample_counts is not None
    pilots = 2 if "shared" in adaptive else 1
    np.testing.assert_array_equal(frame.sample_counts, pilots * (1 if "min_spp=1" in adaptive else 4))


@pytest.mark.parametrize("sampling", ["spp=1", "spp=1,sampler=random", "spp=16,sampler=jittered"])
@pytest.mark.parametrize("filtering", LOBES)
def test_weights_with_lobes_are_normalised(flat_scene: Any, filtering: str, sampling: str) -> None:
    # Of single jittered samples some pixels' weights nearly cancel.
    pixels = pixels_of(flat_scene([], background=BACKGROUND), f"{sampling},{filtering}", (31, 9))
    np.testing.assert_allclose(pixels, np.broadcast_to(np.float32(BACKGROUND), pixels.shape), rtol=1e-6)


@pytest.mark.parametrize("filtering", LOBES)
def test_signed_weights_have_mean_1_and_the_variance_of_their_gain(flat_scene: Any, filtering: str) -> None:
    # Each sample is +-gain, of mean 1: variance gain^2 - 1, over N; the mean over n pixels then has a standard error
    # of sqrt(variance / n), and the sample variance one of variance * sqrt(2 / n) (N = 16 is nearly normal).
    gain = filter_of(parse_technique("reference:" + filtering)).gain
    technique = f"spp=16,sampler=random,weighting=distribution,{filtering}"
    values = pixels_of(flat_scene([], background=(1.0, 1.0, 1.0)), technique, (128, 128))[..., 0].astype(np.float64)
    variance = (gain**2 - 1.0) / 16
    assert gain > 1.1
    assert abs(values.mean() - 1.0) < 3.5 * np.sqrt(variance / values.size)
    assert abs(values.var() / variance - 1.0) < 3.5 * np.sqrt(2.2 / values.size)


@pytest.mark.parametrize("filtering", ["filter=box", "filter=tent", "filter=mitchell"])
@pytest.mark.parametrize("weighting", ["samples", "distribution"])
def test_the_picture_of_a_shape_sums_to_its_area(polygon: Any, flat_scene: Any, filtering: str, weighting: str) -> None:
    # These filters' shifted copies sum to 1 everywhere: all that a shape radiates arrives, whatever pixel it is in.
    corners = np.array([[-3.3, -2.1, 0.0], [3.2, -1.7, 0.0], [-1.4, 3.6, 0.0]])
    (ax, ay), (bx, by) = (corners[1] - corners[0])[:2], (corners[2] - corners[0])[:2]
    area = 0.5 * (ax * by - ay * bx)
    scene = flat_scene([polygon(corners)])
    pixels = pixels_of(scene, f"spp=1024,sampler=sobol,{filtering},weighting={weighting}", (16, 16))
    # Each of the 30 pixels that the outline crosses errs by some .002 (test_weightings), signed weights by three times.
    assert abs(pixels[..., 0].sum(dtype=np.float64) - area) < 3 * 0.002 * np.sqrt(30) * (
        3 if "mitch" in filtering else 1
    )


@pytest.mark.parametrize("technique", EVERY_WAY)
def test_splats_and_counts_are_the_same_bits_on_any_number_of_threads(
    shapes: Scene, monkeypatch: pytest.MonkeyPatch, technique: str
) -> None:
    frames = []
    for threads in ("1", "2", "3", "5"):
        monkeypatch.setenv("ALIASBENCH_THREADS", threads)
        frames.append(render(shapes, "raytrace:" + technique, size=(23, 17), frame=1, seed=9))
    assert frames[0].pixels.std() > 0.1
    for frame in frames[1:]:
        np.testing.assert_array_equal(frame.pixels, frames[0].pixels)
        assert (frame.sample_counts is None) == ("adaptive" not in technique)
        if frame.sample_counts is not None:
            np.testing.assert_array_equal(frame.sample_counts, frames[0].sample_counts)


@pytest.mark.parametrize("technique", ["spp=9,shadow_rays=3", "spp=4,filter=tent", "adaptive=unbiased,filter=gaussian"])
def test_lit_pictures_are_the_same_bits_on_any_number_of_threads(
    lit_scene: Scene, monkeypatch: pytest.MonkeyPatch, technique: str
) -> None:
    pictures = []
    for threads in ("1", "2", "3", "5"):
        monkeypatch.setenv("ALIASBENCH_THREADS", threads)
        pictures.append(pixels_of(lit_scene, technique))
    assert pictures[0].std() > 0.01
    for picture in pictures[1:]:
        np.testing.assert_array_equal(picture, pictures[0])


@pytest.mark.parametrize("technique", EVERY_WAY)
def test_pictures_do_not_depend_on_how_rows_are_grouped(
    shapes: Scene, monkeypatch: pytest.MonkeyPatch, technique: str
) -> None:
    whole = render(shapes, "raytrace:" + technique, size=(14, 11))
    for size in (1, 12_000):
        monkeypatch.setattr(development, "_GROUP_BYTES", size)
        cut = render(shapes, "raytrace:" + technique, size=(14, 11))
        np.testing.assert_array_equal(cut.pixels, whole.pixels)
        if whole.sample_counts is not None:
            np.testing.assert_array_equal(cut.sample_counts, whole.sample_counts)


@pytest.mark.parametrize("technique", EVERY_WAY)
def test_a_taller_picture_has_the_same_rows(shapes: Scene, technique: str) -> None:
    # One row more below: the axis meets the picture half a pixel lower. A power of two keeps coordinates exact.
    lower = Camera("orthographic", position=(0.0, -0.5, 5.0), target=(0.0, -0.5, 0.0), height=12.0)
    small = pixels_of(shapes, technique)
    taller = pixels_of(dataclasses.replace(shapes, camera=lower), technique, (14, 12))
    assert small.std() > 0.1
    # The same samples of the same places, whose coordinates may differ in their last bit.
    np.testing.assert_allclose(taller[:11], small, rtol=0.0, atol=2e-6)


@pytest.mark.parametrize("filtering", SPLATS)
def test_one_sample_a_pixel_is_spread_over_neighbours(quad: Any, flat_scene: Any, filtering: str) -> None:
    # One centre sample of each pixel: weights are the filter at whole distances.
    scene = flat_scene([quad(-1.0, -1.0, 1.0, 0.0)], height=9.0, camera=None)
    scene = dataclasses.replace(scene, camera=Camera("orthographic", height=9.0, position=(0.5, 0.5, 5.0),
                                                     target=(0.5, 0.5, 0.0)))  # fmt: skip
    pixels = pixels_of(scene, f"spp=1,{filtering}", (9, 9))[..., 0]
    spec = filter_of(parse_technique("reference:" + filtering))
    lit = pixels_of(scene, "spp=1", (9, 9))[..., 0]
    assert lit.sum() == 2.0
    at = np.argwhere(lit > 0)
    reach = np.arange(-4, 5)
    total = spec.evaluate(reach[:, None], reach[None, :]).sum()
    i, j = np.mgrid[:9, :9]
    expected = sum(spec.evaluate(j - b, i - a) for a, b in at) / total
    np.testing.assert_allclose(pixels, expected, atol=2e-6)


@pytest.mark.parametrize("filtering", ["filter=box,radius=20", "filter=tent,radius=20", "filter=cone,radius=20"])
def test_a_filter_wider_than_the_picture_works(quad: Any, flat_scene: Any, filtering: str) -> None:
    scene = flat_scene([quad(-90.0, -90.0, -0.3, 90.0)], height=4.0)
    exact = render(scene, "reference:" + filtering, size=(5, 4)).pixels
    pixels = pixels_of(scene, f"spp=4,{filtering}", (5, 4))
    # The edge crosses 41 pixels of 4 samples, each of which errs by a standard deviation of at most 1 / 4.
    peak = float(filter_of(parse_technique("reference:" + filtering)).evaluate(0.0, 0.0))
    assert np.abs(pixels - exact).max() < 5 * 0.25 * np.sqrt(41) * peak
    assert 0.4 < exact.mean() < 0.55


@pytest.mark.parametrize("filtering", ["box", "tent", "cone", "mitchell"])
@pytest.mark.parametrize("radius", ["300", "1e9", "1e300"])
def test_a_filter_too_wide_for_memory_is_one_clear_error(shapes: Scene, filtering: str, radius: str) -> None:
    said = f"{float(radius):g}".replace("+", r"\+")
    sentence = rf"radius={said}: a picture 40 pixels wide .* more than 2 GB; a smaller radius or picture does not"
    with pytest.raises(InputError, match=sentence):
        prepare(shapes, f"raytrace:spp=4,filter={filtering},radius={radius}", size=(40, 30))


@pytest.mark.parametrize("weighting", ["samples", "distribution"])
def test_a_lanczos_filter_too_wide_for_its_table_is_refused(shapes: Scene, weighting: str) -> None:
    with pytest.raises(InputError, match=r"radius=1e\+09: must be at most 256 with filter=lanczos"):
        prepare(shapes, f"raytrace:spp=4,filter=lanczos,radius=1e9,weighting={weighting}", size=(4, 4))


@pytest.mark.parametrize(
    ("filtering", "spp"),
    [("filter=box", 2**20), ("filter=tent", 2**20), ("filter=gaussian", 2**17), ("filter=cone", 2**17)],
)
def test_sums_of_a_million_samples_keep_their_digits(quad: Any, flat_scene: Any, filtering: str, spp: int) -> None:
    # One value that float32 sums would lose (1e6 times 0.1 in float32 is .9 % off).
    scene = flat_scene([], height=1.0, background=(0.1, 1e-6, 1e6))
    pixels = pixels_of(scene, f"spp={spp},sampler=grid,{filtering}", (2, 1))
    np.testing.assert_allclose(pixels, np.broadcast_to(np.float32([0.1, 1e-6, 1e6]), (1, 2, 3)), rtol=2e-7)
    # Half and half: 2^10 columns of the grid, of which as many lie on either side.
    light = quad(-1.0, -9.0, -0.5, 9.0, color=(1e6, 1e6, 1e-6))
    other = quad(0.0, -9.0, 0.5, 9.0, color=(1e6, 1e6, 1e-6))
    scene = flat_scene([light, other], height=1.0, background=(1e-6, 0.0, 1e6))
    pixels = pixels_of(scene, f"spp={2**20},sampler=grid", (2, 1))
    np.testing.assert_allclose(pixels, np.broadcast_to([[[5e5 + 5e-7, 5e5, 5e5 + 5e-7]]], (1, 2, 3)), rtol=1e-6)


def test_dark_pixels_keep_their_digits_beside_bright_ones(quad: Any, flat_scene: Any) -> None:
    # Far from the edge no bright sample is under the filter: no sum may have passed through 1e6.
    scene = flat_scene([quad(-90.0, -90.0, 0.0, 90.0, color=(1e6, 1e6, 1e6))], background=(1e-6, 3e-6, 7e-6))
    for filtering in ("filter=tent", "filter=lanczos,radius=2", "filter=cone"):
        pixels = pixels_of(scene, f"spp=64,{filtering}", (16, 16))
        dark, bright = pixels[:, 11:], pixels[:, :5]
        np.testing.assert_allclose(dark, np.broadcast_to(np.float32([1e-6, 3e-6, 7e-6]), dark.shape), rtol=1e-6)
        np.testing.assert_allclose(bright, 1e6, rtol=1e-6)


def test_more_than_two_to_the_32_samples_are_refused(shapes: Scene) -> None:
    with pytest.raises(InputError, match=r"64 x 65 pixels at 1048576 samples are more than 2\^32 samples in all"):
        prepare(shapes, f"raytrace:spp={2**20}", size=(64, 65))
    with pytest.raises(InputError, match=r"are more than 2\^32 samples in all"):
        prepare(shapes, f"raytrace:adaptive=pooled,max_spp={2**24}", size=(64, 65))
