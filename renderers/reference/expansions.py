"""Pixel filters as polynomials: what exact moments of a picture (`moments`) are multiplied with.

Every pixel is cut into the same cells, at the places where the profile of any pixel's filter has a knot, and finer
where a polynomial asks for it. In a cell the filter of each pixel around is a product of two Chebyshev series; of the
product all terms up to a total degree are kept. Box, tent and Mitchell are polynomials themselves. Of the others what
is left out is bounded by the sum of the left-out coefficients: number of cells and degree follow from a bound.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from aliasbench.renderers.kernel_parts import allocating
from aliasbench.renderers.sampling.filters import FilterSpec
from aliasbench.scenes.model import FloatArray, read_only

TARGET = 5e-6  # of what is left out, relative to the largest colour
MOST_DEGREE = 8
_FINEST = 64  # cells to a pixel along one axis
_NODES = 40
_EPS = 2.0**-52


@dataclass(frozen=True, slots=True, eq=False)
class Expansion:
    """A filter over the cells of the pixels that it reaches.

    Attributes
    ----------
    degree : int
        The largest total degree of a term.
    cuts : (n + 1,) float64
        Where the cells of a pixel begin and end along one axis, from 0 to 1.
    margin : int
        How many pixels the filter reaches into on every side of its own.
    along : (2 margin + 1, n, degree + 1, degree + 1) float64
        For a pixel at that distance along x, a cell, and a term j in y: coefficients of the powers of x in units of
        `half`, from the cell's centre; terms in x above degree - j are left out.
    across : (2 margin + 1, n, degree + 1) float64
        Coefficients of the Chebyshev polynomials in y.
    powers : (n, degree + 1, degree + 1) float64
        Row j: coefficients of the Chebyshev polynomial j of a cell's y in powers of y in units of `half`.
    half : float
        Half the size of the largest cell: the unit of length of moments.
    left_out : float
        Bound on the integral of the absolute difference from the filter.
    shares : (2, degree + 1) float64
        What an error of the moments of order p (in units of a cell's) does to a pixel at most: of those of x^p y^r for
        any r, and of all of total degree p.
    """

    degree: int
    cuts: FloatArray
    margin: int
    along: FloatArray
    across: FloatArray
    powers: FloatArray
    half: float
    left_out: float
    shares: FloatArray


def expand_filter(spec: FilterSpec) -> Expansion:
    """Return a separable filter as polynomials, exactly or to `TARGET`; the cheapest of the ways that do."""
    knots = np.mod(0.5 + np.array(spec.knots), 1.0)
    known = spec.kind.degree
    best: tuple[float, FloatArray, FloatArray, int, float] | None = None
    parts = 1
    while parts <= _FINEST and (best is None or parts <= 4):
        cuts = _cut(knots, parts)
        series = _series(spec, cuts)
        if known is not None:
            return _expansion(spec, cuts, series, 2 * known, 0.0)
        for degree in range(2, MOST_DEGREE + 1):
            left = _left_out(series, np.diff(cuts), degree)
            if left <= TARGET:
                cells = len(cuts) - 1
                price = cells * (1.0 + 0.2 * (degree + 1) * (degree + 2))
                if best is None or price < best[0]:
                    best = (price, cuts, series, degree, left)
                break
        parts += 1 if parts < 4 else parts // 2
    if best is None:
        cuts = _cut(knots, _FINEST)
        series = _series(spec, cuts)
        best = (0.0, cuts, series, MOST_DEGREE, _left_out(series, np.diff(cuts), MOST_DEGREE))
    return _expansion(spec, *best[1:])


def _cut(knots: FloatArray, parts: int) -> FloatArray:
    """Return the cells' ends: the knots, and no cell wider than 1 / parts."""
    ends = np.unique(np.concatenate([[0.0, 1.0], knots]))
    ends = ends[np.concatenate([[True], np.diff(ends) > 1e-12])]
    ends[-1] = 1.0
    pieces = [np.linspace(a, b, math.ceil((b - a) * parts - 1e-9) + 1)[:-1] for a, b in itertools.pairwise(ends)]
    return np.concatenate([*pieces, [1.0]])


def _series(spec: FilterSpec, cuts: FloatArray) -> FloatArray:
    """Return Chebyshev coefficients (2 margin + 1, cells, _NODES) of the profile over each pixel around."""
    nodes = np.cos(np.pi * (np.arange(_NODES) + 0.5) / _NODES)
    fit = chebyshev.chebvander(nodes, _NODES - 1).T * (2.0 / _NODES)
    fit[0] /= 2.0
    centres, halves = (cuts[1:] + cuts[:-1]) / 2, np.diff(cuts) / 2
    offsets = np.arange(-spec.margin, spec.margin + 1)
    x = offsets[:, None, None] - 0.5 + centres[None, :, None] + halves[None, :, None] * nodes
    inside = np.abs(offsets[:, None] - 0.5 + centres) < spec.support
    values = np.where(inside[..., None], spec.profile(x), 0.0)
    return values @ fit.T


def _left_out(series: FloatArray, widths: FloatArray, degree: int) -> float:
    """Return a bound on the integral of what is left out of the product of two series."""
    sizes = (np.abs(series) * widths[None, :, None]).sum(axis=(0, 1))
    tails = np.concatenate([np.cumsum(sizes[::-1])[::-1], np.zeros(1)])
    # terms j in y, and in x all above degree - j
    first = np.maximum(degree + 1 - np.arange(len(sizes)), 0)
    return float((sizes * tails[first]).sum())


def _expansion(spec: FilterSpec, cuts: FloatArray, series: FloatArray, degree: int, left: float) -> Expansion:
    kept = degree + 1
    half = float(np.diff(cuts).max()) / 2
    cells = len(cuts) - 1
    powers = np.zeros((cells, kept, kept))
    for j in range(kept):
        row = chebyshev.cheb2poly(np.eye(kept)[j])
        powers[:, j, : len(row)] = row * (2 * half / np.diff(cuts))[:, None] ** np.arange(len(row))
    along = np.zeros((len(series), cells, kept, kept))
    for j in range(kept):
        most = kept - j
        along[:, :, j] = np.einsum("dci,cia->dca", series[:, :, :most], powers[:, :most])
    widths = np.diff(cuts) / (2 * half)
    ones = np.einsum("dci,cia->dca", np.abs(series[:, :, :kept]), np.abs(powers))
    line = (ones * widths[None, :, None]).sum(axis=(0, 1))
    shares = np.stack([line * line.sum(), np.convolve(line, line)[:kept]])
    rounding = 64 * _EPS * float(np.abs(along[:, :, 0]).sum()) * float(np.abs(series[:, :, :kept]).sum())
    return Expansion(
        degree, read_only(cuts), spec.margin, read_only(along), read_only(series[:, :, :kept].copy()),
        read_only(powers), half, left + rounding, read_only(shares),
    )  # fmt: skip


@allocating
def gather_row(
    moments: FloatArray, degree: int, margin: int, along: FloatArray, across: FloatArray, powers: FloatArray, row: int,
    top: int, patch: FloatArray,
) -> None:  # fmt: skip
    """Add what a row of pixels gives to the pixels around.

    Parameters
    ----------
    moments : (n, w + 2 margin, n, degree + 1, degree + 1, 3)
        Of the cells of row number `row` of the wide picture, for powers of x and y.
    patch : (k, w, 3)
        Rows of the picture from `top` on.
    """
    cells, wide = moments.shape[0], moments.shape[1]
    width = patch.shape[1]
    kept = degree + 1
    terms = np.empty((kept, 3))
    sums = np.zeros((width, kept, 3))
    for cy in range(cells):
        sums[:] = 0.0
        for column in range(wide):
            first, last = max(0, column - 2 * margin), min(column, width - 1)
            if first > last:
                continue
            for cx in range(cells):
                here = moments[cy, column, cx]
                for j in range(kept):
                    for a in range(kept - j):
                        for c in range(3):
                            terms[a, c] = 0.0
                        for b in range(j + 1):
                            p = powers[cy, j, b]
                            if p != 0.0:
                                for c in range(3):
                                    terms[a, c] += p * here[a, b, c]
                    for target in range(first, last + 1):
                        for a in range(kept - j):
                            weight = along[column - target, cx, j, a]
                            for c in range(3):
                                sums[target, j, c] += weight * terms[a, c]
        for i in range(max(top, row - 2 * margin), min(top + len(patch), row + 1)):
            for target in range(width):
                for j in range(kept):
                    weight = across[row - i, cy, j]
                    for c in range(3):
                        patch[i - top, target, c] += weight * sums[target, j, c]
