"""What weighted sums must keep: flat pictures, the scene's range without lobes and a bounded one with them."""

import itertools
import math

import numpy as np

from aliasbench.bench.hard.case import HardCase, Verdict, with_keys
from aliasbench.bench.hard.panels import HALF_ULP, gray, halved, is_raster, panel, picture, sampled
from aliasbench.renderers.catalog import render, resolve_technique
from aliasbench.renderers.sampling.filters import FilterSpec, filter_of
from aliasbench.scenes.model import Surface
from aliasbench.scenes.shapes import polygon

# What polynomials of a profile leave of it in the ray tracer, in terms of the peak: `profiles`.
_PROFILE = 1e-9


def spec_of(filtering: str) -> FilterSpec:
    """Return the filter that keys of a technique's text name."""
    return filter_of(resolve_technique(with_keys("reference:", filtering)))


def device_rounding(spec: FilterSpec, most: float = 1.0) -> float:
    """Return what float32 products and sums on the device leave, along both axes, of values up to `most`."""
    return HALF_ULP * most * (4 * (2 * math.ceil(spec.radius) + 1) + 4)


def _flat(subject: str) -> Verdict:
    """Relative errors of a flat picture under narrow and wide filters."""
    size = (6, 5)
    worst, bound, where = 0.0, 0.0, ""
    scenes = {
        "edges": picture([panel(-90.0, -90.0, 90.0, 90.0, size, gray(0.1))], size),
        "texture": halved(size, 0.1, 0.1, textured=True),
    }
    for filtering in (
        "filter=box,radius=0.1",
        "filter=box,radius=9",
        "filter=tent,radius=16",
        "filter=cone,radius=8",
        "filter=gaussian,radius=0.3",
        "filter=gaussian,radius=12,sigma=3",
        "filter=mitchell,radius=10",
        "filter=lanczos,radius=8",
    ):
        spec = spec_of(filtering)
        taps = 2 * math.ceil(spec.radius) + 1
        for name, scene in scenes.items():
            got = render(scene, sampled(subject, 16, filtering, "sampler=sobol"), size=size).pixels
            error = float(np.abs(got.astype(np.float64) / 0.1 - 1.0).max())
            along = taps * taps / 64 + 64 + 2 if spec.name == "cone" else 4 * taps + 4
            bound = max(bound, HALF_ULP * along * spec.gain)
            if error >= worst:
                worst, where = error, f"{name}, {filtering}"
    ulp = HALF_ULP * (1 + is_raster(subject))
    return Verdict(
        worst,
        "of the value",
        ulp,
        max(bound, ulp) if is_raster(subject) else ulp,
        "weights divide by their own sum: float32 rounds the result, and on the device products and sums of the taps",
        note=f"worst by {where}",
    )


def _clutter(size: tuple[int, int]) -> list[Surface]:
    """Return wedges and small triangles of values from .25 to .75, edges everywhere."""
    draw = np.random.default_rng(7)
    shapes = []
    for _ in range(40):
        x, y = draw.uniform(-0.5, 0.5, 2) * size
        a, b, c = np.sort(draw.uniform(0.0, 2.0 * math.pi, 3))
        if min(b - a, c - b, 2.0 * math.pi - c + a) < 0.2:
            continue
        reach = draw.uniform(0.3, 3.0)
        corners = [(x + reach * math.cos(t), y + reach * math.sin(t), 0.0) for t in (a, b, c)]
        shapes.append(polygon(corners, color=gray(float(draw.choice([0.25, 0.5, 0.75])))))
    return shapes


def _no_overshoot(subject: str) -> Verdict:
    """How far values leave the scene's own range under filters without lobes."""
    size = (16, 12)
    scene = picture(_clutter(size), size, background=0.25)
    worst, where = 0.0, ""
    for filtering in (
        "filter=box",
        "filter=box,radius=0.1",
        "filter=tent",
        "filter=cone",
        "filter=cone,radius=0.55",
        "filter=gaussian",
        "filter=gaussian,radius=4,sigma=0.3",
    ):
        for count in (1, 5) if not subject.startswith("reference") else (1,):
            technique = sampled(subject, count, filtering, "sampler=random")
            got = render(scene, technique, size=size).pixels.astype(np.float64)
            beyond = float(np.maximum(0.25 - got, got - 0.75).max())
            spread = float(np.ptp(got))
            if not spread > 0.1:
                return Verdict(math.inf, "contrast", 0.0, 0.0, f"{technique}: the picture must show the scene")
            if beyond >= worst:
                worst, where = beyond, technique
    spec = spec_of("filter=gaussian,radius=4")
    return Verdict(
        worst,
        "contrast",
        0.75 * HALF_ULP,
        device_rounding(spec, 0.75) if is_raster(subject) else 0.75 * HALF_ULP,
        "weights are not negative; float32 rounds .75, and on the device each product and sum of the taps",
        note=f"worst by {where}",
    )


def _signs(spec: FilterSpec) -> list[tuple[float, float, int]]:
    """Return the intervals (start, stop, sign) between the zeros of a profile with lobes."""
    half = [1.0, 2.0, 3.0] if spec.name == "lanczos" else [4.0 / 7.0 * spec.radius, spec.radius]
    stops = [-x for x in reversed(half)] + half
    middle = len(half) - 1
    return [(a, b, (-1) ** abs(k - middle)) for k, (a, b) in enumerate(itertools.pairwise(stops))]


def _lobes(subject: str) -> Verdict:
    """The error of the brightest value that a filter with lobes can make of a scene between 0 and 1."""
    size, side = (13, 13), 4
    found = []
    for filtering in ("filter=mitchell", "filter=lanczos"):
        spec = spec_of(filtering)
        pieces = _signs(spec)
        # white wherever the middle pixel's filter is positive, black where it is negative
        white = [
            panel(6.5 + a, 6.5 + c, 6.5 + b, 6.5 + d, size, gray(1.0))
            for a, b, s in pieces
            for c, d, t in pieces
            if s == t
        ]
        got = render(picture(white, size), sampled(subject, side**2, filtering, "sampler=grid"), size=size).pixels
        reach = math.ceil(spec.radius)
        grid = np.arange(-reach, reach) + 0.5
        offsets = np.add.outer(grid - 0.5, (np.arange(side) + 0.5) / side - 0.5).ravel()
        weights = spec.profile(np.append(offsets, reach + (np.arange(side) + 0.5) / side - 0.5))
        gain = (float(np.abs(weights).sum()) / abs(float(weights.sum()))) ** 2
        if subject.startswith("reference"):
            gain = spec.gain
        highest = 0.5 + 0.5 * gain
        error = abs(float(got[6, 6, 0]) - highest)
        beyond = max(0.0, float(got.max()) - highest)
        found.append((max(error, beyond), highest, spec, filtering))
    error, highest, spec, filtering = max(found, key=lambda entry: entry[0])
    rounding = highest * HALF_ULP + (2.0 * _PROFILE * 49 if not subject.startswith("reference") else 0.0)
    return Verdict(
        error,
        "contrast",
        rounding,
        rounding + device_rounding(spec, highest) if is_raster(subject) else rounding,
        "where white is what has positive weights the value is (1 + sum abs w / sum w) / 2, and can be no larger: "
        "float32 rounds it, and polynomials give each of 49 weights to 1e-9",
        note=f"{filtering}: up to {highest:.4f}",
    )


def _sigmas(subject: str) -> Verdict:
    """Errors under Gaussians that are next to a point, and next to a box."""
    size = (8, 2)
    # .004 px is 1.02 of 1/256 px: an edge cannot be drawn on the other side of the centre
    sides = np.where(np.arange(size[0]) % 2 == 0, 0.004, -0.004)
    strips = [panel(k - 0.01, -8.0, k + 0.5 + d, 12.0, size, gray(1.0)) for k, d in enumerate(sides)]
    # a strip ends where the next pixel's begins, so that only its right side is near a centre
    scene = picture(strips, size)
    truth = (sides > 0.0).astype(np.float64)
    worst, where = 0.0, ""
    for sigma in ("1e-9", "1e-6"):
        filtering = f"filter=gaussian,sigma={sigma}"
        got = render(scene, sampled(subject, 16, filtering, "sampler=sobol"), size=size).pixels[..., 0]
        error = float(np.abs(got.astype(np.float64) - truth).max())
        if error >= worst:
            worst, where = error, filtering
    for sigma in ("1e6", "1e9"):
        filtering = f"filter=gaussian,sigma={sigma}"
        pair = [
            render(scene, sampled(subject, 16, keys, "sampler=sobol"), size=size).pixels[..., 0].astype(np.float64)
            for keys in (filtering, "filter=box,radius=1.5")
        ]
        error = float(np.abs(pair[0] - pair[1]).max())
        if error >= worst:
            worst, where = error, filtering
    ulp = 2.0 * HALF_ULP
    spec = spec_of("filter=gaussian")
    return Verdict(
        worst,
        "contrast",
        ulp,
        ulp + 2.0 * device_rounding(spec) if is_raster(subject) else ulp,
        "1e-6 px is a point: the colour at the centre; 1e6 px is a box, to (1.5e-6)^2: float32 rounds either",
        note=f"worst by {where}",
    )


CASES = (
    HardCase(
        "flat-under-any-filter",
        "values",
        "A flat picture under filters of radius .1 to 16, with and without lobes, plain or from a texture.",
        "Every pixel, at the border too, is that colour to float32's rounding.",
        _flat,
    ),
    HardCase(
        "no-overshoot-without-lobes",
        "values",
        "Triangles everywhere, one to five random samples a pixel, filters that are nowhere negative.",
        "No value leaves the scene's range, .25 to .75.",
        _no_overshoot,
    ),
    HardCase(
        "overshoot-of-lobes",
        "values",
        "White is exactly where the Mitchell or Lanczos filter of a pixel is positive: the largest overshoot there is.",
        "The pixel is (1 + sum abs w / sum w) / 2, and no pixel is brighter.",
        _lobes,
    ),
    HardCase(
        "sigma-next-to-0-and-infinity",
        "values",
        "Gaussians of sigma 1e-9 and 1e-6 beside edges .004 px from centres, and of 1e6 and 1e9 cut at 1.5 pixels.",
        "They are the point and the box that they differ from by rounding only.",
        _sigmas,
    ),
)
