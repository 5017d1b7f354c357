"""Sums of very many samples: they may not drift, and estimates come as close as their number lets them."""

import math

import numpy as np

from aliasbench.bench.hard.case import REFERENCE, RENDERERS, TRACERS, HardCase, Verdict, samples_key
from aliasbench.bench.hard.panels import HALF_ULP, gray, is_raster, panel, picture, sampled
from aliasbench.renderers.catalog import render
from aliasbench.scenes.model import FloatArray, Motion, Scene
from aliasbench.scenes.shapes import polygon

_COLORS = (0.1, 1e6, 1e-6)
_MILLION, _PASSES = 2**20, 2**14
_SIDE, _SIDE_RASTER = 1024, 60  # rows of strata; on the device the fewest with a standard error below 1e-3
# Two-sided, an unbiased estimate is farther from the truth once in 10000.
_DEVIATIONS = 3.9


def _flat_sums(subject: str) -> Verdict:
    """Relative errors of flat colours after very many samples."""
    count = _PASSES if is_raster(subject) else _MILLION
    scene = picture([panel(-9.0, -9.0, 9.0, 9.0, (1, 1), _COLORS)], (1, 1))
    got = render(scene, sampled(subject, count), size=(1, 1)).pixels.astype(np.float64)
    return Verdict(
        float(np.abs(got / np.asarray(_COLORS) - 1.0).max()),
        "of the value",
        HALF_ULP * (2 if is_raster(subject) else 1),
        HALF_ULP * (2 if is_raster(subject) else 1),
        "float32 rounds the mean, and on the device the colour, by 2^-24 of it; a float32 sum would drift by 1e-5",
        note=f"{count} samples",
    )


def _red(scene: Scene, technique: str) -> float:
    """Return the only pixel's red."""
    return float(render(scene, technique, size=(1, 1)).pixels[0, 0, 0])


def _slanted() -> Scene:
    """Return an edge through the one pixel that covers .3 of it, .2 at its bottom and .4 at its top."""
    corners = [(-9.0, -3.5, 0.0), (-0.9, -3.5, 0.0), (0.5, 3.5, 0.0), (-9.0, 3.5, 0.0)]  # 3 pixels beyond, either way
    return picture([polygon(corners)], (1, 1))


def _stratified_error(side: int) -> float:
    """Return the standard error of the coverage of `_slanted` by one uniform sample in each of side x side cells."""
    rows, columns = np.arange(side, dtype=np.float64)[:, None], np.arange(side + 1, dtype=np.float64)
    start, stop = side * 0.2 + 0.2 * rows, side * 0.2 + 0.2 * (rows + 1)  # the edge's column in each row of cells

    def below(t: FloatArray) -> FloatArray:
        """Return the integral of clip(t, 0, 1)."""
        out: FloatArray = np.where(t > 1.0, t - 0.5, 0.5 * np.maximum(t, 0.0) ** 2)
        return out

    covered = (below(stop - columns) - below(start - columns)) / (stop - start)
    return math.sqrt(float((covered * (1.0 - covered)).sum())) / side**2


def _exact_coverage(scenes: list[Scene]) -> Verdict:
    """Return the verdict on the reference's .3 of each scene."""
    frames = [render(scene, REFERENCE, size=(1, 1)) for scene in scenes]
    # corners of some 10 px, of which a float64 area loses 16 roundings
    bound = max(frame.uncertainty or 0.0 for frame in frames) + 16.0 * 100.0 * 2.0**-53
    error = max(abs(float(frame.pixels[0, 0, 0]) - 0.3) for frame in frames)
    return Verdict(error, "contrast", bound, bound, "the bound that the reference states, beside .3 in float64")


def _stratified_coverage(subject: str) -> Verdict:
    """The error of an edge's coverage by very many stratified samples."""
    if subject == REFERENCE:
        return _exact_coverage([_slanted()])
    side = _SIDE_RASTER if is_raster(subject) else _SIDE
    error = _stratified_error(side)
    got = _red(_slanted(), sampled(subject, side * side, more="sampler=jittered"))
    snapped = 1.2 / 512 if is_raster(subject) else 0.0
    return Verdict(
        abs(got - 0.3),
        "contrast",
        _DEVIATIONS * error,
        _DEVIATIONS * error + snapped,
        f"cells that the edge covers by c have a variance of c (1 - c): {_DEVIATIONS} standard errors"
        + (", and 1/512 px of a vertex in x with .2 times 1/512 in y" if snapped else ""),
        standard_error=error,
        note=f"{side * side} samples",
    )


def _independent_coverage(subject: str) -> Verdict:
    """The error of .3 by a million independent samples: of an edge's coverage, and of the share of the shutter."""
    error = math.sqrt(0.3 * 0.7 / _MILLION)
    # an edge that moves from -.2 to .8 of the pixel while the shutter is open: .8^2 / 2 = .32, lowered to .3 by its top
    moving = picture(
        [panel(-9.0, 0.0625, -0.2, 9.0, (1, 1), gray(1.0), Motion(velocity=(1.0, 0.0, 0.0)))], (1, 1), shutter=1.0
    )
    if subject == REFERENCE:
        return _exact_coverage([_slanted(), moving])
    missed = [
        abs(_red(scene, samples_key(subject, _MILLION, "sampler=random")) - 0.3) for scene in (_slanted(), moving)
    ]
    return Verdict(
        max(missed),
        "contrast",
        _DEVIATIONS * error,
        _DEVIATIONS * error,
        f"the standard error of 2^20 independent samples of variance .21, {_DEVIATIONS} times",
        standard_error=error,
        note=f"still {missed[0]:.1e}, moving {missed[1]:.1e}",
    )


CASES = (
    HardCase(
        "flat-after-a-million-samples",
        "values",
        "A pixel of flat colour is the mean of 2^20 samples, or 2^14 passes.",
        "It is that colour, to float32's rounding. A reference takes no samples.",
        _flat_sums,
        RENDERERS,
    ),
    HardCase(
        "edge-after-a-million-samples",
        "values",
        "A slanted edge covers .3 of a pixel that takes 2^20 stratified samples, or 3600 passes.",
        "The mean is .3 within the error that stratified samples have; the reference is .3 within its bound.",
        _stratified_coverage,
    ),
    HardCase(
        "a-million-independent-samples",
        "values",
        "An edge covers .3 of a pixel, or of pixel and open shutter as it moves, of 2^20 independent samples.",
        "The mean is .3 within the error that independent samples have, the reference within its bound. A rasterizer's "
        "passes are too few.",
        _independent_coverage,
        (*TRACERS, REFERENCE),
    ),
)
