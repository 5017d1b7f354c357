"""How many samples a pixel gets under adaptive sampling, from what has been seen of it or of its neighbours.

The standard error of n samples of standard deviation s is taken as s / n^(e / 2). Independent samples have e = 1. Of
stratified ones it is what an edge leaves, the worst that is not noise: over d dimensions of cells of width n^(-1/d) an
edge runs through n^(1 - 1/d) of them, and the variance falls as n^-(1 + 1/d) (Mitchell 1996).

A pixel that must not look at itself looks at its four neighbours across its sides. An edge through it leaves it by two
of them, so that two vary, and the lesser variance is taken for its own: of two on opposite sides. Of two that meet in a
corner the edge may cut off just that, or pass by beyond it, and their variance counts for less. Or the edge is so close
to a side that two opposite neighbours are flat and different: then it is in between. What varies on one side alone is
an edge that passes by, and counts for a part of its variance: pilots may have missed where it comes in.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.raytrace.film import Film
from aliasbench.renderers.sampling.patterns import RANDOM
from aliasbench.renderers.technique import Technique
from aliasbench.scenes.model import FloatArray, Scene

CountArray = NDArray[np.int32]

_ONE_SIDED, _CORNER = 0.01, 0.4
_LANES = 16


def error_exponent(scene: Scene, technique: Technique, sampler: int) -> float:
    """Return e of the standard error (see the module) of a technique's samples of a scene."""
    if sampler == RANDOM:
        return 1.0
    moves = scene.animation.shutter > 0.0 and not scene.is_static and technique.time == "spread"
    dimensions = 2 + int(moves) + 2 * int(scene.camera.lens_radius > 0.0) + 2 * int(bool(scene.lights))
    scatters = scene.bounces > 0 or any(o.material.kind in ("glossy", "glass") for o in scene.objects)
    return 1.0 + 1.0 / (dimensions + 2 * int(scatters))


@njit(cache=True, nogil=True, error_model="numpy")
def variances(first: int, after: int, film: Film, numbers: CountArray, out: FloatArray) -> None:
    """Write the largest variance of the channels of each pixel's samples, infinite of a single one, in some rows."""
    for r in range(first, after):
        for k in range(numbers.shape[1]):
            n = numbers[r, k]
            largest = 0.0
            for c in range(3):
                total = film.sums[r, k, c]
                largest = max(largest, film.squares[r, k, c] - total * total / n)
            out[r, k] = largest / (n - 1) if n > 1 else np.inf


@njit(cache=True, nogil=True, error_model="numpy")
def wanted_number(variance: float, tolerance: float, exponent: float, least: int, most: int) -> int:
    """Return how many samples of a variance bring the standard error to the tolerance, from `least` to `most`."""
    if variance <= 0.0:
        return least
    # compared as floats: no integer holds what a tolerance out of reach asks for
    wanted = (variance / (tolerance * tolerance)) ** (1.0 / exponent) - 1e-9
    if not wanted < most:
        return most
    return max(least, math.ceil(wanted))


@njit(cache=True, nogil=True, error_model="numpy")
def next_numbers(
    own: FloatArray, numbers: CountArray, tolerance: float, exponent: float, most: int, out: CountArray
) -> bool:
    """Write how many samples each pixel should have next, given variances of its own; return whether any wants more.

    No pixel grows to more than eight times its samples at once: few samples tell little of their variance.
    """
    any_more = False
    for r in range(numbers.shape[0]):
        for k in range(numbers.shape[1]):
            n = numbers[r, k]
            wanted = 2 if n < 2 else wanted_number(own[r, k], tolerance, exponent, n, most)
            out[r, k] = max(n, min(wanted, 8 * n, most))
            any_more = any_more or out[r, k] > n
    return any_more


@njit(cache=True, nogil=True, error_model="numpy")
def neighbour_numbers(
    first: int, after: int, film: Film, own: FloatArray, tolerance: float, exponent: float, least: int, most: int,
    alone: bool, out: CountArray,
) -> None:  # fmt: skip
    """Write the numbers of samples of all pixels but a film's outermost ring, from the pilots around them.

    Parameters
    ----------
    first, after : int
        The rows of `out` to write.
    film : Film
        With the sums of pilots of `least` samples.
    own : (rows, width) float64
        Their variances.
    alone : bool
        The pilots are discarded, so that the pixel's own may count.
    out : (rows - 2, width - 2) int32
    """
    for r in range(first, after):
        for k in range(out.shape[1]):
            y, x = r + 1, k + 1
            variance, a, b = 0.0, 0.0, 0.0
            if least > 1:
                left, right, above, below = own[y, x - 1], own[y, x + 1], own[y - 1, x], own[y + 1, x]
                a, b = max(left, right), max(above, below)
                variance = max(_CORNER * min(a, b), min(left, right), min(above, below), _ONE_SIDED * max(a, b))
                if alone:
                    variance = max(variance, own[y, x])
            if a <= 0.0:
                variance = max(variance, 0.25 * _gap(film.shifts, y, x - 1, y, x + 1))
            if b <= 0.0:
                variance = max(variance, 0.25 * _gap(film.shifts, y - 1, x, y + 1, x))
            wanted = wanted_number(variance, tolerance, exponent, least, most)
            if wanted > least:
                # whole packets beside the pilot
                wanted = min(most, least + (wanted - least + _LANES - 1) // _LANES * _LANES)
            out[r, k] = wanted


@njit(cache=True, forceinline=True, nogil=True, error_model="numpy")
def _gap(shifts: FloatArray, y0: int, x0: int, y1: int, x1: int) -> float:
    """Return the squared difference of two pixels whose samples are all the same, the largest of the channels."""
    largest = 0.0
    for c in range(3):
        gap = shifts[y0, x0, c] - shifts[y1, x1, c]
        largest = max(largest, gap * gap)
    return largest


@njit(cache=True, nogil=True, error_model="numpy")
def resolve_sums(
    first: int, after: int, film: Film, numbers: CountArray, around: int, out: NDArray[np.float32]
) -> None:
    """Write means of `numbers` (h, w) samples to an image (h, w, 3); the film has so many pixels more all around."""
    shifted = film.shifts.shape[0] > 0
    for r in range(first, after):
        for k in range(out.shape[1]):
            n = numbers[r, k]
            for c in range(3):
                mean = film.sums[around + r, around + k, c] / n
                if shifted:
                    mean += film.shifts[around + r, around + k, c]
                out[r, k, c] = np.float32(mean)
