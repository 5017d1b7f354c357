"""Adaptive sampling where it cannot know better: flat pixels, tolerances out of reach, and dots that pilots miss."""

import math

import numpy as np

from aliasbench.bench.hard.case import REFERENCE, TRACERS, HardCase, Verdict, with_keys
from aliasbench.bench.hard.panels import gray, halved, panel, picture
from aliasbench.renderers.catalog import prepare, render
from aliasbench.scenes.model import FloatArray, Scene
from aliasbench.scenes.shapes import mesh

SIZE = (8, 8)
_LEAST, _MOST = 4, 64
_KINDS = ("pooled", "unbiased")
_DOT = 1.0 / 64.0
_DOTS, _SEEDS = (64, 64), 64
# Two-sided, the mean of 64 independent pictures is farther from the truth once in 10000 (Student's t, 63 degrees).
_DEVIATIONS = 4.15


def _flat_pixels(subject: str) -> Verdict:
    """How many pixels of flat pictures got more samples than the pilot, or another colour."""
    colors = (0.1, 1e6, 1e-6)
    wall = picture([panel(-9.0, -9.0, 20.0, 20.0, SIZE, colors)], SIZE)
    scenes = {"edges": wall, "texture": halved(SIZE, 0.1, 0.1, textured=True)}
    wrong, looked_at = 0, 0
    for name, scene in scenes.items():
        truth = np.asarray(colors if name == "edges" else gray(0.1), dtype=np.float32)
        for kind in _KINDS:
            for least in (_LEAST, 1000):
                keys = f"adaptive={kind},min_spp={least},max_spp=4096,tolerance=1e-30,sampler=sobol"
                frame = render(scene, with_keys(subject, keys), size=SIZE)
                assert frame.sample_counts is not None, "adaptive pictures say how many samples each pixel got"
                wrong += int(((frame.sample_counts != least) | (frame.pixels != truth).any(axis=-1)).sum())
                looked_at += frame.sample_counts.size
    return Verdict(
        float(wrong),
        "pixels",
        0.0,
        0.0,
        "differences from the first sample are exactly 0, and so is their variance",
        note=f"{looked_at} pixels",
    )


def _out_of_reach(subject: str) -> Verdict:
    """How many pixels of halves did not get all samples, or are not half."""
    wrong = 0
    keys = f"min_spp={_LEAST},max_spp=1024,tolerance=1e-30,sampler=jittered"
    for textured in (False, True):
        for kind in _KINDS:
            scene = halved(SIZE, 0.0, 1.0, textured=textured)
            frame = render(scene, with_keys(subject, f"adaptive={kind},{keys}"), size=SIZE)
            assert frame.sample_counts is not None, "adaptive pictures say how many samples each pixel got"
            wrong += int((frame.sample_counts != 1024).sum())
    return Verdict(
        float(wrong), "pixels", 0.0, 0.0, "2 x 2 cells lie on both sides of the edge: every pilot has a variance"
    )


def dots() -> Scene:
    """Return white squares of 1/64 pixel, one inside each pixel of a picture of `_DOTS`."""
    width, height = _DOTS
    columns, rows = (axis.ravel() for axis in np.meshgrid(np.arange(width), np.arange(height)))
    x, y = columns - width / 2 + 0.37, rows - height / 2 + 0.21
    corners = [(x, y), (x + _DOT, y), (x + _DOT, y + _DOT), (x, y + _DOT)]
    vertices = np.stack([np.stack([a, b, np.zeros_like(a)], axis=1) for a, b in corners], axis=1).reshape(-1, 3)
    first = 4 * np.arange(len(x))[:, None]
    triangles = np.concatenate([first + np.array(half) for half in ([0, 1, 2], [0, 2, 3])])
    return picture([mesh(vertices, triangles, color=gray(1.0))], _DOTS)


def _picture_means(subject: str, keys: str) -> tuple[FloatArray, float]:
    """Return the mean of each seed's picture of `dots`, and how many samples a pixel got on average."""
    technique = with_keys(subject, f"{keys},min_spp={_LEAST},max_spp={_MOST},tolerance=1e-9,sampler=random")
    means, samples = [], 0
    with prepare(dots(), technique, size=_DOTS) as prepared:
        for seed in range(_SEEDS):
            frame = prepared.render(seed=seed)
            means.append(float(frame.pixels[..., 0].mean(dtype=np.float64)))
            samples += frame.samples
    return np.asarray(means), samples / (_SEEDS * _DOTS[0] * _DOTS[1])


def _dot_bias(subject: str, kind: str) -> Verdict:
    """The bias of the mean of pixels with a dot, whose area is 1/4096."""
    if subject == REFERENCE:
        frame = render(dots(), subject, size=_DOTS)
        bound = (frame.uncertainty or 0.0) + 64.0 * 2.0**-53  # of corners up to 32 px, twice
        error = float(np.abs(frame.pixels - _DOT**2).max())
        return Verdict(error, "contrast", bound, bound, "the bound that the reference states: every pixel is 1/4096")
    means, samples = _picture_means(subject, f"adaptive={kind}")
    area, rest = _DOT**2, _MOST - _LEAST
    error = float(means.std(ddof=1)) / math.sqrt(len(means))
    # METRICS.md, section 7: n pilots that agree end the pixel with their own mean; float32 places the dot to 4e-6 px
    lost = rest / _MOST * area * (1.0 - area) * ((1.0 - area) ** (_LEAST - 1) - area ** (_LEAST - 1))
    placed = 4.0 * _DOT * 32 * 2.0**-24
    allowed = _DEVIATIONS * error + placed
    if not allowed < 0.5 * lost:
        return Verdict(math.inf, "contrast", 0.0, 0.0, "the standard error must be far below the bias", error)
    return Verdict(
        abs(float(means.mean()) - area),
        "contrast",
        allowed,
        allowed + (lost if kind == "pooled" else 0.0),
        "pilots of 4 that all miss the dot end the pixel: 60/64 c (1 - c) ((1 - c)^3 - c^3) of c = 1/4096 is lost"
        if kind == "pooled"
        else f"no bias: {_DEVIATIONS} standard errors over {_SEEDS} seeds",
        standard_error=error,
        note=f"mean {means.mean():.3e} where {area:.3e} is right, {samples:.2f} samples a pixel",
    )


def _pooled_dots(subject: str) -> Verdict:
    return _dot_bias(subject, "pooled")


def _unbiased_dots(subject: str) -> Verdict:
    return _dot_bias(subject, "unbiased")


def _variance_of_large_values(subject: str) -> Verdict:
    """How far the number of samples is from what the variance of 2^20 and 2^20 + 1/8 asks for."""
    low, step, wanted, pilot = 2.0**20, 0.125, 4096, 1024
    tolerance = 0.5 * step / math.sqrt(wanted)
    keys = f"adaptive=pooled,min_spp={pilot},max_spp=65536,tolerance={tolerance!r},sampler=random"
    frame = render(halved(SIZE, low, low + step, textured=False), with_keys(subject, keys), size=SIZE)
    assert frame.sample_counts is not None, "adaptive pictures say how many samples each pixel got"
    # s^2 = n / (n - 1) p (1 - p) of the step: p is .5 up to four standard errors of the pilot
    rounding = 1.0 / (pilot - 1) + 4.0 * (4.0 * 0.5) ** 2 / pilot + 1.0 / wanted
    return Verdict(
        float(np.abs(frame.sample_counts / wanted - 1.0).max()),
        "of the number",
        rounding,
        rounding,
        "a pilot of 1024 knows p (1 - p) of p = 1/2 to 4 (4 / 64)^2, if no digits of the variance are lost",
        note=f"{frame.sample_counts.min()} to {frame.sample_counts.max()} samples where {wanted} are right",
    )


_ONLY = "Only tracers are adaptive."

CASES = (
    HardCase(
        "flat-needs-no-more",
        "values",
        "Adaptive sampling to a tolerance of 1e-30 sees flat colours of .1, 1e6 and 1e-6, plain or from a texture.",
        f"Every pixel stops at min_spp, its variance exactly 0, and has the colour's nearest float32. {_ONLY}",
        _flat_pixels,
        TRACERS,
    ),
    HardCase(
        "tolerance-out-of-reach",
        "values",
        "Adaptive sampling to a tolerance of 1e-30 sees pixels that are half white.",
        f"Every pixel gets max_spp samples. {_ONLY}",
        _out_of_reach,
        TRACERS,
    ),
    HardCase(
        "dot-missed-by-pooled-pilots",
        "values",
        "Each pixel holds a dot of 1/64 pixel, which the four samples of a pooled pilot miss in 999 of 1000 pixels.",
        f"The mean is too dark by no more than the pixels that stop with their pilots. {_ONLY}",
        _pooled_dots,
        TRACERS,
    ),
    HardCase(
        "dot-missed-by-unbiased-pilots",
        "values",
        "Each pixel holds a dot of 1/64 pixel, which the four samples of a pilot miss in 999 of 1000 pixels.",
        "Unbiased allocation keeps the mean, within its standard error over 64 seeds; the reference has it in every "
        f"pixel. {_ONLY}",
        _unbiased_dots,
        (*TRACERS, REFERENCE),
    ),
    HardCase(
        "variance-beside-a-large-mean",
        "values",
        "Half of a pixel is 2^20 and half 2^20 + 1/8: the square of the mean is 3e14 times the variance.",
        f"Adaptive sampling takes as many samples as that variance asks for. {_ONLY}",
        _variance_of_large_values,
        TRACERS,
    ),
)
