"""Nothing to see: the background alone, and meshes without triangles, under every kind of technique."""

import numpy as np

from aliasbench.bench.hard.case import RASTERS, REFERENCE, HardCase, Verdict, with_keys
from aliasbench.bench.hard.triangles import ULP, in_pixels, triangle_scene
from aliasbench.renderers.catalog import render
from aliasbench.scenes.model import Motion, Surface
from aliasbench.scenes.shapes import polygon

BACKGROUND = (0.3, 0.1, 7.7)
_TRACED = (
    *("", "spp=5", "spp=16,sampler=sobol", "spp=9,sampler=random", "spp=4,sampler=bluenoise"),
    *("spp=16,sampler=grid,filter=tent", "spp=4,filter=cone", "spp=4,filter=gaussian"),
    *("spp=16,sampler=grid,filter=mitchell", "spp=16,sampler=grid,filter=lanczos"),
    *("spp=9,filter=gaussian,weighting=distribution", "spp=9,filter=tent,weighting=distribution,warp=lecture"),
    *("adaptive=pooled", "adaptive=unbiased", "spp=4,texture=ewa", "spp=4,motion=matrix,time=center"),
)
_DRAWN = (
    *("", "msaa=4", "ssaa=3", "passes=5", "msaa=4,passes=3", "msaa=4,alpha_to_coverage=on", "texture=anisotropic"),
    *("passes=16,sampler=grid,filter=tent", "passes=4,filter=cone", "msaa=4,filter=gaussian", "ssaa=4,filter=mitchell"),
    *("passes=16,sampler=grid,filter=lanczos", "passes=9,filter=gaussian,weighting=distribution"),
    *("post=fxaa", "post=smaa", "post=taa", "msaa=4,post=smaa", "passes=3,post=fxaa"),
)
_EXACT = (
    *("", "filter=gaussian,radius=inf", "filter=mitchell", "filter=lanczos", "filter=cone", "filter=tent"),
    *("texture=linear", "time=center", "motion=matrix"),
)


def techniques(subject: str) -> tuple[str, ...]:
    """Return one set of keys for each kind of technique that a subject has."""
    return _EXACT if subject == REFERENCE else _DRAWN if subject in RASTERS else _TRACED


def _empty(subject: str) -> Verdict:
    """Background alone, under every kind of technique; and meshes without triangles."""
    worst, where = 0.0, ""
    hollow = Surface(np.zeros((0, 3)), np.zeros((0, 3), np.int32), is_polygon=False)
    unused = Surface(np.eye(3), np.zeros((0, 3), np.int32), is_polygon=False)
    for key in techniques(subject):
        for objects in ((), (hollow, unused)):
            for size in ((1, 1), (7, 3)):
                scene = in_pixels(size, *objects, background=BACKGROUND)
                pixels = render(scene, with_keys(subject, key), size=size).pixels
                error = float(np.abs(pixels / np.array(BACKGROUND) - 1.0).max())
                if not error <= worst:
                    worst, where = error, key or "no keys"
    # the device's sums are float32, a tracer's and a reference's float64
    terms = 64.0 if subject in RASTERS else 1.0
    rounding = 64.0 * 2.0**-53 if subject == REFERENCE else terms * ULP
    return Verdict(
        worst,
        "relative",
        rounding,
        rounding,
        "a mean of equal values loses a rounding for each term of a sum, up to 64 in a row of taps: of float32 on the "
        "device, else of float64, and a tracer's pixels are float32",
        note=f"worst: {where}" if where else "",
    )


def _hollow_mesh(subject: str) -> Verdict:
    """A mesh without triangles between others: nothing else may change, not even the order of objects."""
    size = (17, 11)
    shape, cover = triangle_scene(size).objects[0], polygon([(-3, -2, 0), (4, -3, 0), (1, 4, 0)], color=(0.5, 0.1, 0.9))
    hollow = Surface(np.eye(3), np.zeros((0, 3), np.int32), is_polygon=False)
    moving = Surface(np.eye(3), np.zeros((0, 3), np.int32), is_polygon=False, motion=Motion((1.0, 0.0, 0.0)))
    with_it, without = (
        render(in_pixels(size, *objects), subject, size=size).pixels
        for objects in ((hollow, shape, moving, cover), (shape, cover))
    )
    if not np.ptp(without) > 0.5:
        return Verdict(1.0, "contrast", 0.0, 0.0, "there must be something to compare", note="the picture is flat")
    worst = float(np.abs(with_it - without).max())
    return Verdict(worst, "contrast", 0.0, 0.0, "what has no area covers no sample: the same picture bit for bit")


CASES = (
    HardCase(
        "empty-scenes",
        "sizes",
        "A background without objects, or with meshes of no triangles, under every kind of technique, from 1 x 1 on.",
        "Every pixel is the background, within the rounding of a mean in float32.",
        _empty,
    ),
    HardCase(
        "hollow-meshes",
        "sizes",
        "Meshes without triangles, still and moving, among objects that overlap.",
        "The picture is the same bit for bit as without them.",
        _hollow_mesh,
    ),
)
