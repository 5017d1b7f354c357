"""Reconstruction filters over accumulation passes: which pixels of a pass count in which pixel of the picture, and how.

Under `weighting=samples` a sample counts in every pixel whose filter covers it. All pixels share the places of their
samples, so that is a convolution of each pass with a few weights: tap (dx, dy) of a pixel is what was drawn for the
pixel dx to the right and dy below, at that one's sample. The weights of all passes are summed and divided by once: sum
(w f) / sum w, in every pixel the same divisor. Under `weighting=distribution` the pass as a whole is moved by a point
drawn from the filter, beyond the pixel if need be, and nothing is left to be weighted.

With hardware samples, or a supersampled picture, each sample has taps of its own.
"""

import math
from dataclasses import dataclass

import numpy as np

from aliasbench.renderers.sampling.filters import GAUSSIAN, FilterSpec, filter_of
from aliasbench.renderers.sampling.warps import Warp, make_warp
from aliasbench.renderers.technique import Technique
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import FloatArray

# As in the ray tracer: beyond so many sigmas a Gaussian is not followed.
_FAR_SIGMAS = 6.0


@dataclass(frozen=True, slots=True, eq=False)
class Optics:
    """A technique's filter as accumulation passes need it.

    Attributes
    ----------
    spec : FilterSpec
    warp : Warp
        Of weighted distributions; IDENTITY otherwise.
    is_weighted : bool
        Whether passes are convolved with weights.
    reach : float
        How far away a sample counts at most, across or down, in pixels.
    margin : int
        How many pixels away a pixel's samples may still count.
    spread : float
        The side of the square in the middle of a pixel that single samples lie in: all of it, or where the filter is.
    """

    spec: FilterSpec
    warp: Warp
    is_weighted: bool
    reach: float
    margin: int
    spread: float


def make_optics(technique: Technique) -> Optics:
    """Return what a technique's passes are filtered with.

    Raises
    ------
    InputError
        For a filter distribution with hardware samples or a supersampled picture, whose samples cannot be moved singly.
    """
    spec = filter_of(technique)
    is_box = technique.filter == "box" and technique.radius_px == 0.5
    is_weighted = technique.weighting == "samples" and not is_box
    fixed = technique.msaa > 1 or technique.ssaa > 1
    if technique.weighting == "distribution" and not is_box and fixed:
        many = technique.msaa * technique.ssaa**2 * technique.passes
        key = "msaa" if technique.msaa > 1 else "ssaa"
        raise InputError(
            f"weighting=distribution with {key}: the places of those samples are fixed and cannot be drawn from the "
            f"filter; use weighting=samples, or passes={many} without {key}"
        )
    reach = min(spec.radius, _FAR_SIGMAS * spec.sigma) if spec.kind.code == GAUSSIAN else spec.radius
    margin = max(0, math.ceil(reach - 0.5)) if is_weighted else 0
    spread = min(1.0, 2.0 * reach) if is_weighted and not fixed else 1.0
    return Optics(spec, make_warp(technique), is_weighted, reach, margin, spread)


def profile_weights(optics: Optics, ssaa: int, jitter: float) -> FloatArray:
    """Return the (2 margin + 1) * ssaa weights along one axis of a pixel's taps, from the first on.

    Tap t is the drawn pixel `ssaa * (pixel - margin) + t`, whose sample is moved by `jitter` drawn pixels.
    """
    return optics.spec.profile(_offsets(optics, ssaa, jitter))


def plane_weights(optics: Optics, ssaa: int, positions: FloatArray, margin: int) -> FloatArray:
    """Return the (n, 4) taps of a pixel that count, (dx, dy, sample, weight).

    Parameters
    ----------
    positions : (samples, 2) float64
        Places of the samples relative to the centre of a drawn pixel, the pass's jitter included.
    margin : int
        How many pixels away drawn pixels are looked at; dx, dy count drawn pixels from `ssaa` times the pixel.
    """
    taps = np.arange(-margin * ssaa, (margin + 1) * ssaa)
    dx, dy, sample = (a.ravel() for a in np.meshgrid(taps, taps, np.arange(len(positions)), indexing="xy"))
    x = (dx + 0.5 + positions[sample, 0]) / ssaa - 0.5
    y = (dy + 0.5 + positions[sample, 1]) / ssaa - 0.5
    weight = optics.spec.evaluate(x, y)
    kept = weight != 0.0
    out: FloatArray = np.stack([dx, dy, sample, weight], axis=1)[kept]
    return out


def _offsets(optics: Optics, ssaa: int, jitter: float) -> FloatArray:
    taps = np.arange(-optics.margin * ssaa, (optics.margin + 1) * ssaa)
    out: FloatArray = (taps + 0.5 + jitter) / ssaa - 0.5
    return out
