"""Filters' supports: narrower than pixels, many pixels wide, and the warps that draw places under them from 0 to 1."""

import math
from collections.abc import Callable

import numpy as np

from aliasbench.bench.hard.case import RENDERERS, HardCase, Verdict, samples_key
from aliasbench.bench.hard.panels import HALF_ULP, gray, is_raster, panel, picture, sampled
from aliasbench.bench.hard.weights import device_rounding, spec_of
from aliasbench.renderers.catalog import prepare, render, resolve_technique
from aliasbench.renderers.sampling.filters import filter_of
from aliasbench.renderers.sampling.warps import LECTURE_MU, make_warp, warp_points
from aliasbench.scenes.model import FloatArray, Scene

_SNAP = 1.0 / 512.0  # vertices on 1/256 px move an upright edge by so much
# An estimate's mean over 8 seeds is farther from the truth once in 2000 (Student's t, 7 degrees).
_SEEDS, _DEVIATIONS = 8, 6.0
_SAMPLES = 64
_FILTERINGS = (
    "filter=box,radius=0.1",
    "filter=box,radius=8",
    "filter=tent",
    "filter=tent,radius=1e-6",
    "filter=cone",
    "filter=cone,radius=1e-6",
    "filter=gaussian",
    "filter=gaussian,radius=0.3",
    "filter=gaussian,radius=1e6",
    "filter=gaussian,radius=inf",
    "filter=gaussian,sigma=1e-6",
    "filter=gaussian,sigma=1e6",
    "filter=mitchell",
    "filter=mitchell,radius=0.1",
    "filter=lanczos",
    "filter=lanczos,radius=1.5",
    "filter=lanczos,radius=20",
    "filter=gaussian,warp=lecture",
    "filter=tent,warp=lecture",
)


def _ends() -> FloatArray:
    """Return the numbers from 0 to 1 at which logarithms, roots and tables end, one ulp off either way too."""
    inner = [2.0**-60, 2.0**-53, 2.0**-32, 0.25, 0.5, 0.75, 1.0 - 2.0**-32]
    near = [math.nextafter(x, side) for x in inner for side in (0.0, 1.0)]
    return np.array([0.0, 5e-324, 2.0**-1022, *inner, *near, 1.0 - 2.0**-53, 1.0])


def _warp_ends(subject: str) -> Verdict:
    """How many offsets of points on the border of the unit square are not finite or lie outside of the filter."""
    u, v = np.meshgrid(_ends(), _ends())
    bad, where = 0, ""
    for filtering in _FILTERINGS:
        technique = resolve_technique(samples_key(subject, 2, f"weighting=distribution,{filtering}"))
        spec = filter_of(technique)
        reach = spec.radius
        if technique.warp == "lecture":
            # of the smallest positive float, which stands for 0
            reach = LECTURE_MU * math.sqrt(-2.0 * math.log(5e-324)) if technique.filter == "gaussian" else 1.0
        elif math.isinf(reach):
            reach = 8.6 * spec.sigma  # beyond lies less mass on either side than 2^-57, half of a number's least step
        dx, dy, sign = warp_points(make_warp(technique), u, v)
        allowed = reach * (1.0 + 4.0 * 2.0**-53)
        fits = (np.abs(dx) <= allowed) & (np.abs(dy) <= allowed) & (np.abs(sign) == 1.0)  # comparisons refuse NaN
        bad += int((~fits).sum())
        where = where if fits.all() else filtering
    return Verdict(
        float(bad),
        "points",
        0.0,
        0.0,
        "a point of the closed unit square has a place under the filter, and a sign",
        note=f"{u.size} points under each of {len(_FILTERINGS)} filters" + (f"; worst {where}" if where else ""),
    )


def _gaps(subject: str) -> Verdict:
    """The largest value of pixels whose filters end before what is bright."""
    size = (4, 4)
    worst, where = 0.0, ""
    for filtering, radius in (
        ("filter=box,radius=0.1", 0.1),
        ("filter=box,radius=0.25", 0.25),
        ("filter=gaussian,radius=0.3", 0.3),
        ("filter=tent,radius=0.4", 0.4),
        ("filter=mitchell,radius=0.3", 0.3),
    ):
        for spend in ("samples", "distribution"):
            near, far = 0.5 + radius + 0.005, 1.5 - radius - 0.005  # 1.3 of 1/256 px
            upright = [panel(k + near, -8.0, k + far, 12.0, size, gray(1e6)) for k in range(-1, 4)]
            level = [panel(-8.0, k + near, 12.0, k + far, size, gray(1e6)) for k in range(-1, 4)]
            if subject.startswith("reference") and spend == "distribution":
                continue
            technique = sampled(subject, 16, filtering, f"weighting={spend}")
            error = float(np.abs(render(picture([*upright, *level], size), technique, size=size).pixels).max())
            if error >= worst:
                worst, where = error, technique
    return Verdict(
        worst, "radiance", 0.0, 0.0, "what is bright lies in the gaps between the filters' supports", note=where
    )


def _mean_error(
    subject: str, scene: Scene, size: tuple[int, int], keys: tuple[str, str], truth: FloatArray
) -> tuple[float, float]:
    """Return the mean error of pictures whose rows are all `truth`, over seeds, and its standard error."""
    with prepare(scene, sampled(subject, _SAMPLES, *keys), size=size) as prepared:
        if subject.startswith("reference"):
            return float(np.abs(prepared.render().pixels[..., 0] - truth).max()), 0.0
        errors = [
            float((prepared.render(seed=seed).pixels[..., 0].astype(np.float64) - truth).mean())
            for seed in range(_SEEDS)
        ]
    return abs(float(np.mean(errors))), float(np.std(errors, ddof=1)) / math.sqrt(_SEEDS)


def _worst_mean_error(
    subject: str,
    entries: list[tuple[str, Scene, tuple[int, int], FloatArray]],
    snapped: Callable[[str], float],
    why: str,
    floor: Callable[[str], float] | None = None,
) -> Verdict:
    """Return the verdict on the entry (filter, scene, size, truth) whose mean error is the largest over its bound.

    `snapped` says what 1/256 px of a vertex may change under a filter, `floor` what the standard error is at least.
    """
    found = []
    for filtering, scene, size, truth in entries:
        error, known = _mean_error(subject, scene, size, (filtering, "sampler=sobol"), truth)
        if floor is not None and not subject.startswith("reference"):
            known = max(known, floor(filtering))
        rounding = 1e-12 if subject.startswith("reference") else _DEVIATIONS * known + HALF_ULP
        bound = rounding + (snapped(filtering) if is_raster(subject) else 0.0)
        found.append((error / rounding, error, rounding, bound, known, filtering))
    _, error, rounding, bound, known, filtering = max(found)
    return Verdict(error, "contrast", rounding, bound, why, standard_error=known, note=f"worst by {filtering}")


def _narrow(subject: str) -> Verdict:
    """The mean error of upright edges .02 to .08 px beside pixels' centres."""
    size = (16, 4)
    places = 0.02 + 0.06 * (np.arange(size[0]) + 0.5) / size[0]
    strips = [panel(k - 0.05, -8.0, k + 0.5 + d, 12.0, size, gray(1.0)) for k, d in enumerate(places)]
    scene = picture(strips, size)
    root = math.sqrt(0.5) / 0.5  # 1 / (sigma sqrt 2)
    entries = [(f"filter=box,radius={r}", scene, size, 0.5 + 0.5 * places / r) for r in (0.1, 0.25)]
    cut = np.array([math.erf(root * d) for d in places]) / math.erf(root * 0.3)
    entries.append(("filter=gaussian,radius=0.3", scene, size, 0.5 + 0.5 * cut))
    return _worst_mean_error(
        subject,
        entries,
        lambda filtering: _SNAP * spec_of(filtering).peak,
        "closed form: the filter's integral up to the edge; "
        f"{_DEVIATIONS:g} standard errors, and for 1/256 px of a vertex 1/512 px times the filter's peak",
    )


def _wide(subject: str) -> Verdict:
    """The mean error of pixels on the bright side of an upright edge under filters of 8 pixels and more."""
    size = (9, 3)
    edge = 9.3
    distance = edge - (np.arange(size[0]) + 0.5)
    scene = picture([panel(-60.0, -60.0, edge, 60.0, size, gray(1.0))], size)
    u = np.minimum(distance / 8.0, 1.0)
    tent = 0.5 + u - 0.5 * u * u
    root = 1.0 / (4.0 * math.sqrt(2.0))
    gaussian = 0.5 + 0.5 * np.array([math.erf(root * d) for d in distance]) / math.erf(root * 10.0)
    box = 0.5 + distance / 19.0
    entries = [
        ("filter=tent,radius=8", scene, size, tent),
        ("filter=gaussian,radius=10,sigma=4", scene, size, gaussian),
        ("filter=box,radius=9.5", scene, size, box),
    ]
    return _worst_mean_error(
        subject,
        entries,
        lambda filtering: _SNAP * spec_of(filtering).peak + device_rounding(spec_of(filtering)),
        "closed form: the filter's integral up to the edge; "
        f"{_DEVIATIONS:g} standard errors, on the device its products and sums, and 1/512 px times the filter's peak",
        # the edge cuts one of a pixel's strata, of variance 1/4 at most; few seeds may all fall on one side of it
        floor=lambda filtering: spec_of(filtering).peak * 0.5 / _SAMPLES / math.sqrt(_SEEDS),
    )


CASES = (
    HardCase(
        "warps-of-0-and-1",
        "values",
        "Filter distributions are drawn from points on the border of the unit square: 0, the least float, 1 - ulp, 1.",
        "Every offset is finite and under the filter. A reference draws no places.",
        _warp_ends,
        RENDERERS,
    ),
    HardCase(
        "gaps-between-filters",
        "values",
        "Filters of a radius under half a pixel leave gaps; all that lies there is 1e6.",
        "Pixels are exactly black.",
        _gaps,
    ),
    HardCase(
        "filters-narrower-than-pixels",
        "values",
        "Edges .02 to .08 px beside the centres of pixels, under boxes of radius .1 and .25 and a Gaussian of .3.",
        "Means are the filter's integral up to the edge, within their standard error.",
        _narrow,
    ),
    HardCase(
        "filters-of-many-pixels",
        "values",
        "An edge under a tent of radius 8, a Gaussian of 10 and a box of 9.5 pixels.",
        "Means are the filter's integral up to the edge, within their standard error.",
        _wide,
    ),
)
