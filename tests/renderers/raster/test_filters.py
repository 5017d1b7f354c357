"""Filters over passes: pixel by pixel the weighted mean of the samples of a float64 model, and the exact limit."""

import math

import numpy as np
import pytest

from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.raster.context import sample_positions
from aliasbench.renderers.raster.stages import wrapped_positions
from aliasbench.renderers.raster.targets import ssaa_positions
from aliasbench.renderers.sampling.filters import filter_of
from aliasbench.renderers.sampling.patterns import sample_set
from aliasbench.renderers.sampling.warps import make_warp, warp_points
from aliasbench.renderers.technique import parse_technique
from aliasbench.scenes.errors import InputError

pytestmark = pytest.mark.usefixtures("gl_checked")
SIZE = (45, 38)
FILTERS = (
    "filter=box,radius=0.3",
    "filter=box,radius=1.2",
    "filter=tent",
    "filter=tent,radius=2.3",
    "filter=tent,radius=0.35",
    "filter=cone",
    "filter=cone,radius=1.7",
    "filter=gaussian",
    "filter=gaussian,radius=2.5,sigma=0.9",
    "filter=mitchell",
    "filter=mitchell,radius=3.1",
    "filter=lanczos",
    "filter=lanczos,radius=2",
)
LOBES = ("mitchell", "lanczos")


def weighted_mean(make, scene, filter_text, places):
    """Sum (w f) / sum w over samples at `places` (n, 2) of all pixels around, (h, w, 3), and where none is doubtful."""
    spec = filter_of(parse_technique(f"raster:{filter_text}"))
    reach = math.ceil(spec.radius + 0.5)
    total, weights, doubtful = np.zeros((SIZE[1], SIZE[0], 3)), 0.0, np.zeros((SIZE[1], SIZE[0]), bool)
    for x, y in places:
        for dx in range(-reach, reach + 1):
            for dy in range(-reach, reach + 1):
                weight = float(spec.evaluate(x + dx - 0.5, y + dy - 0.5))
                if weight != 0.0:
                    colors, unsure = make.sample(scene, SIZE, x + dx, y + dy)
                    total += weight * colors
                    weights += weight
                    doubtful |= unsure
    return total / weights, ~doubtful


def assert_same(pixels, expected, sure, least):
    assert sure.mean() > least
    assert np.ptp(expected[sure]) > 0.3
    np.testing.assert_allclose(pixels[sure], expected[sure], atol=5e-6)


@pytest.mark.parametrize("filter_text", FILTERS)
def test_every_sample_counts_with_its_weight_in_all_pixels_around(make, filter_text):
    scene = make.star(camera=make.perspective)
    spec = filter_of(parse_technique(f"raster:{filter_text}"))
    pixels = render(scene, f"raster:passes=2,{filter_text}", size=SIZE, seed=4).pixels
    # of a filter within the pixel the samples lie where it is
    spread = min(1.0, 2.0 * spec.radius)
    places = 0.5 + spread * (sample_set("jittered", 2, seed=4)[:, :2] - 0.5)
    assert_same(pixels, *weighted_mean(make, scene, filter_text, places), 0.3)


@pytest.mark.parametrize("filter_text", ["filter=tent,radius=1.3", "filter=cone", "filter=mitchell"])
def test_hardware_samples_and_sub_pixels_are_weighted_by_their_own_places(make, filter_text):
    scene = make.star()
    jitters = sample_set("jittered", 2, seed=7)[:, :2] - 0.5
    corners = np.array([(0, 0), (0.5, 0), (0, 0.5), (0.5, 0.5)])
    still = sample_positions(4)
    cases = {
        "msaa=4": still,
        "ssaa=2": ssaa_positions(2, (0.0, 0.0)),
        "msaa=4,passes=2": [p + j for j in jitters for p in still],
        "ssaa=3,passes=2": [p for j in jitters for p in ssaa_positions(3, tuple(j))],
        "msaa=4,ssaa=2": [c + p / 2 for c in corners for p in still],
        "msaa=4,ssaa=2,passes=2": [
            c + p / 2 for j in jitters for c in corners for p in wrapped_positions(still, tuple(j))[0]
        ],
    }
    for text, places in cases.items():
        pixels = render(scene, f"raster:{text},{filter_text}", size=SIZE, seed=7).pixels
        assert_same(pixels, *weighted_mean(make, scene, filter_text, np.asarray(places) % 1.0), 0.25)


@pytest.mark.parametrize("filter_text", FILTERS)
@pytest.mark.parametrize("warp", ["exact", "lecture"])
def test_passes_of_a_distribution_are_moved_by_points_of_the_filter(make, filter_text, warp):
    text = f"passes=5,{filter_text},weighting=distribution"
    if warp == "lecture":
        if filter_text not in ("filter=tent", "filter=gaussian"):
            return
        text += ",warp=lecture"
    scene = make.star(camera=make.perspective)
    pixels = render(scene, f"raster:{text}", size=SIZE, seed=9).pixels
    chosen = make_warp(parse_technique(f"raster:{text}"))
    u, v = sample_set("jittered", 5, seed=9)[:, :2].T
    samples = [make.sample(scene, SIZE, 0.5 + x, 0.5 + y) for x, y, _ in zip(*warp_points(chosen, u, v), strict=True)]
    signs = warp_points(chosen, u, v)[2]
    expected = chosen.gain * np.mean([s * colors for s, (colors, _) in zip(signs, samples, strict=True)], axis=0)
    assert_same(pixels, expected, ~np.any([unsure for _, unsure in samples], axis=0), 0.5)


@pytest.mark.parametrize("filter_text", FILTERS)
@pytest.mark.parametrize("weighting", ["samples", "distribution"])
def test_pictures_converge_to_the_exact_filter(make, filter_text, weighting):
    """1024 Sobol points leave an RMS of some 4e-4 over the picture, twice that drawn from a filter over two pixels.

    Under lobes a distribution's signs are shared by all pixels: what they leave of 1 is a factor of the whole picture.
    """
    scene = make.star()
    truth = render(scene, f"reference:{filter_text}", size=SIZE).pixels
    technique = f"raster:passes=1024,sampler=sobol,{filter_text},weighting={weighting}"
    picture = render(scene, technique, size=SIZE).pixels
    off = picture - truth
    partial = np.abs(off).max(axis=2) > 1e-6
    if weighting == "distribution" and filter_text.split(",")[0].split("=")[1] in LOBES:
        spec = filter_of(parse_technique(f"raster:{filter_text}"))
        u, v = sample_set("sobol", 1024, seed=0)[:, :2].T
        warp = make_warp(parse_technique(technique))
        share = warp.gain * warp_points(warp, u, v)[2].mean()
        assert abs(share - 1.0) < 0.05
        assert np.sqrt(np.mean((picture / share - truth) ** 2)) < 3e-3 * spec.gain
        return
    assert np.sqrt(np.mean(off**2)) < (1.5e-3 if weighting == "distribution" else 7e-4)
    assert abs(off[partial].mean()) < 3e-4
    # every bin of coverage: a bias by coverage would cancel in the whole
    for low, high in ((0.0, 0.25), (0.25, 0.5), (0.5, 1.01)):
        chosen = partial & (truth.max(axis=2) >= low) & (truth.max(axis=2) < high)
        if chosen.sum() > 50:
            assert abs(off[chosen].mean()) < 3e-4


def test_flat_pictures_stay_flat_under_every_filter(make):
    whole = make.scene(make.polygon([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], color=(0.1, 0.7, 123.456)))
    for filter_text in FILTERS:
        for text in ("passes=3", "ssaa=3", "msaa=4,passes=2"):
            pixels = render(whole, f"raster:{text},{filter_text}", size=(5, 4)).pixels
            np.testing.assert_allclose(pixels, np.broadcast_to((0.1, 0.7, 123.456), (4, 5, 3)), rtol=2e-6)


def test_thousands_of_passes_add_up_without_bias(make):
    """Sums of float32 pictures in float64: what is left is each picture's own rounding, under weights of all sizes."""
    half = make.polygon([[-2, -2, 0], [0.1, -2, 0], [0.1, 2, 0], [-2, 2, 0]], color=(0.3, 0.1, 0.9))
    scene = make.scene(half, background=(0.7, 1e-3, 11.1))
    pixels = render(scene, "raster:passes=4096,sampler=sobol,filter=gaussian", size=(6, 4)).pixels
    np.testing.assert_allclose(pixels[:, :2], np.broadcast_to((0.3, 0.1, 0.9), (4, 2, 3)), rtol=1e-6)
    np.testing.assert_allclose(pixels[:, 5], np.broadcast_to((0.7, 1e-3, 11.1), (4, 3)), rtol=1e-6)


def test_filters_that_no_sample_lies_under_are_refused(make):
    with (
        prepare(make.star(), "raster:msaa=4,filter=box,radius=0.05", size=SIZE) as prepared,
        pytest.raises(InputError, match=r"filter=box,radius=0\.05: no sample lies under so narrow a filter"),
    ):
        prepared.render()


@pytest.mark.parametrize("key", ["msaa=4", "ssaa=2"])
def test_fixed_samples_cannot_be_drawn_from_a_filter(make, key):
    with pytest.raises(InputError, match=r"weighting=distribution with .*; use weighting=samples, or passes=\d+ "):
        prepare(make.star(), f"raster:{key},passes=3,filter=tent,weighting=distribution", size=SIZE)
