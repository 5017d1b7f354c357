"""Textured pictures at an instant under separable pixel filters, with a certified bound.

Each pixel is cut into the cells of the filter's expansion (`expansions`), each cell into fragments that show one piece,
and of each fragment the exact moments are taken (`moments`, `row_moments`); the filter of every pixel around, a
polynomial over the cell, is a sum of them. So a cell is integrated once, however far a filter reaches. A box has
polynomials of degree 0 and takes the integrals of `textured`.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.renderers.reference.coverage import row_extent
from aliasbench.renderers.reference.expansions import Expansion, expand_filter, gather_row
from aliasbench.renderers.reference.flat import Integral, over_bands
from aliasbench.renderers.reference.fragments import between, split_pixel
from aliasbench.renderers.reference.masses import cell_peaks
from aliasbench.renderers.reference.moments import add_colored, clip_moments, polygon_moments, zone_moments
from aliasbench.renderers.reference.row_moments import (
    row_length,
    row_primitives,
    turn_moments,
    walk_moments,
    wave_moments,
)
from aliasbench.renderers.reference.surfaces import CLIP_BLEND, FLAT, PLATE, WALK, WALK_BLEND, WAVE
from aliasbench.renderers.reference.textured import Instant
from aliasbench.renderers.reference.tiles import gauss_table
from aliasbench.renderers.reference.walks import BLEND, ROWS, TEXELS
from aliasbench.renderers.sampling.filters import FilterSpec
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]

# Texels clipped one by one, some 0.4 microseconds each with their moments.
_MOST_TILES, _TILES_OF_A_PIXEL = 2e7, 2e3
_ROUNDING = 1e-11
_FEW_NODES = 2e-9  # see `row_moments`
_EPS = 2.0**-52
_MOST_GROWTH = 1e-7  # what rounding in sums by parts may change in a pixel of contrast 1
_SECTION = 256


@dataclass(frozen=True, slots=True, eq=False)
class _Section:
    """A band's share of the picture: rows from `top` on, the area given up, and the longest rows summed by parts."""

    top: int
    patch: FloatArray
    lost: float
    longest: FloatArray


def draw_smoothed(instant: Instant, spec: FilterSpec) -> Integral | None:
    """Return the picture at one instant under a separable filter, None where that would take too much work.

    Parameters
    ----------
    instant : Instant
        In a view widened by the filter's margin (`filtered.wide_view`).
    spec : FilterSpec
    """
    view, pieces, surfaces, colors = instant.view, instant.pieces, instant.surfaces, instant.colors
    if surfaces.tiles > _MOST_TILES + _TILES_OF_A_PIXEL * view.width * view.height:
        return None
    grid = expand_filter(spec)
    margin = grid.margin
    height, width = view.height - 2 * margin, view.width - 2 * margin
    out = np.zeros((height, width, 3))
    rules = gauss_table()
    primitives, means = row_primitives(surfaces, grid.degree)
    limits = np.array([_longest_row(s) for s in grid.shares])

    def draw(rows: NDArray[np.int64]) -> _Section:
        top, bottom = max(0, int(rows[0]) - 2 * margin), min(height, int(rows[1]))
        patch = np.zeros((max(0, bottom - top), width, 3))
        lost, longest = _smooth_rows(
            pieces.points, pieces.starts, pieces.planes, pieces.owners, colors, surfaces.ways, surfaces.own,
            surfaces.along, surfaces.blocks, surfaces.params, surfaces.shifts, surfaces.shifted, surfaces.texels,
            primitives, means, rules, view.perspective, instant.extent, grid.cuts, grid.half, grid.degree,
            margin, grid.along, grid.across, grid.powers, limits, view.width, rows, top, patch,
        )  # fmt: skip
        return _Section(top, patch, lost, longest)

    longest = np.zeros(2)
    for section in range(0, view.height, _SECTION):

        def draw_section(rows: NDArray[np.int64], section: int = section) -> _Section:
            return draw(rows + section)

        for part in over_bands(draw_section, min(_SECTION, view.height - section)):
            if part.lost > 0.0:
                return None
            out[part.top : part.top + len(part.patch)] += part.patch
            longest = np.maximum(longest, part.longest)
    return Integral(out, np.full(out.shape[:2], _bound(instant, spec, grid, longest)))


def _growth(shares: FloatArray, length: float) -> float:
    """Return what rounding changes in a pixel of contrast 1 where rows as long as `length` are summed by parts.

    The primitive number k + 1 of a row is at most length^(k + 1) (a sine's is, and all else is smaller), comes with
    p! / (p - k)! in the moment of order p, and is known to a few units in the last place.
    """
    orders = np.arange(len(shares))
    factorials = np.cumprod(np.maximum(orders, 1.0))
    return float(8 * _EPS * (shares * factorials * max(length, 1.0) ** (orders + 1.0)).sum())


def _longest_row(shares: FloatArray) -> float:
    """Return the largest length whose `_growth` is allowed."""
    low, high = 1.0, 1e9
    while high > low * 1.01:
        middle = np.sqrt(low * high)
        low, high = (middle, high) if _growth(shares, middle) <= _MOST_GROWTH else (low, middle)
    return float(low)


def _bound(instant: Instant, spec: FilterSpec, grid: Expansion, longest: FloatArray) -> float:
    """Return the bound of any pixel: borders of texels that are off count by the filter's peak over a pixel."""
    peaks = float(np.prod([cell_peaks(spec).sum()] * 2))
    brightest = float(np.abs(instant.colors).max() * max(1.0, float(np.abs(instant.surfaces.texels).max())))
    rounding = _ROUNDING + (_FEW_NODES if grid.degree > 0 else 0.0)
    grown = sum(_growth(s, float(n)) for s, n in zip(grid.shares, longest, strict=True) if n > 0.0)
    return instant.surfaces.bound * peaks + brightest * (grid.left_out + rounding * max(1.0, peaks) + grown)


@njit(cache=True, nogil=True, error_model="numpy")
def _smooth_rows(
    points: FloatArray, starts: IntArray, planes: FloatArray, owners: IntArray, colors: FloatArray, ways: IntArray,
    own: FloatArray, along: FloatArray, blocks: IntArray, params: FloatArray, shifts: FloatArray, shifted: IntArray,
    texels: FloatArray, primitives: FloatArray, means: FloatArray, rules: FloatArray, perspective: bool, extent: float,
    cuts: FloatArray, half: float, degree: int, margin: int, grid_along: FloatArray, across: FloatArray,
    powers: FloatArray, limits: FloatArray, width: int, rows: IntArray, top: int, patch: FloatArray,
) -> tuple[float, FloatArray]:  # fmt: skip
    """Add what rows [rows[0], rows[1]) of the wide picture give to `patch`, rows of the picture from `top` on.

    Returns the area that was given up as too fine, and the longest rows summed by parts: along an axis, and others.
    """
    count, cells, kept = len(owners), len(cuts) - 1, degree + 1
    ids, cand = np.empty(count, np.int64), np.empty(count, np.int64)
    left, right = np.empty(count), np.empty(count)
    polys, sizes, shown = np.empty((16, 16, 2)), np.empty(16, np.int64), np.empty(16, np.int64)
    moments = np.empty((cells, width, cells, kept, kept, 3))
    parts, place = np.empty((kept, kept)), np.empty(3)
    place[2] = half
    lost, longest = 0.0, np.zeros(2)
    for row in range(rows[0], rows[1]):
        moments[:] = 0.0
        for cy in range(cells):
            y0, y1 = row + cuts[cy], row + cuts[cy + 1]
            place[1] = (y0 + y1) / 2
            n = 0
            for i in range(count):
                lo, hi = row_extent(points, starts[i], starts[i + 1], y0, y1)
                if lo < width and hi > 0:
                    ids[n], left[n], right[n] = i, lo, hi
                    n += 1
            for column in range(width):
                for cx in range(cells):
                    x0, x1 = column + cuts[cx], column + cuts[cx + 1]
                    place[0] = (x0 + x1) / 2
                    here = between(ids, left, right, n, x0, x1, cand)
                    while True:
                        fragments = split_pixel(
                            points, starts, planes, owners, perspective, extent, cand, here, x0, y0, x1, y1,
                            polys, sizes, shown,
                        )  # fmt: skip
                        if fragments >= 0:
                            break
                        polys = np.empty((2 * polys.shape[0], 2 * polys.shape[1], 2))
                        sizes, shown = np.empty(polys.shape[0], np.int64), np.empty(polys.shape[0], np.int64)
                    for f in range(fragments):
                        if sizes[f] < 3:
                            continue
                        piece = shown[f]
                        way = ways[piece] if piece >= 0 else FLAT
                        color = colors[owners[piece]] if piece >= 0 else colors[-1]
                        if way == FLAT:
                            polygon_moments(polys[f], sizes[f], place, degree, rules, parts)
                            add_colored(parts, degree, color, moments[cy, column, cx])
                            continue
                        slanted = 0 if along[piece, 0] == 0.0 or along[piece, 1] == 0.0 else 1
                        given_up, length = _add_texture(
                            polys[f], sizes[f], way, own[piece], along[piece], blocks[piece], params[piece],
                            shifts[piece], shifted[piece], color, texels, primitives, means, rules, place, degree,
                            limits[slanted], moments[cy, column, cx],
                        )  # fmt: skip
                        lost += given_up
                        longest[slanted] = max(longest[slanted], length)
        gather_row(moments, degree, margin, grid_along, across, powers, row, top, patch)
    return lost, longest


@allocating
def _add_texture(
    poly: FloatArray, n: int, way: int, own: FloatArray, along: FloatArray, block: IntArray, params: FloatArray,
    shift: float, shifted: IntArray, color: FloatArray, texels: FloatArray, primitives: FloatArray,
    means: FloatArray, rules: FloatArray, place: FloatArray, degree: int, limit: float, out: FloatArray,
) -> tuple[float, float]:  # fmt: skip
    """Add a fragment's moments times its colour to `out`; return what is given up, and the length of rows if summed.

    Rows longer than `limit` are not summed but clipped.
    """
    kept = degree + 1
    parts = np.zeros((kept, kept, 3))
    if way == PLATE:
        lost = zone_moments(poly, n, own, params, rules, place, degree, parts)
        _add_tinted(parts, color, out)
        return lost, 0.0
    if way == WAVE:
        wave = np.zeros((kept, kept))
        wave_moments(poly, n, own, along, rules, place, degree, wave)
        for p in range(kept):
            for r in range(kept - p):
                for c in range(3):
                    parts[p, r, c] = (params[3 + c] - params[c]) / 2 * wave[p, r]
        turn_moments(parts, along, degree, color, out)
        flat = np.empty((kept, kept))
        polygon_moments(poly, n, place, degree, rules, flat)
        for a in range(kept):
            for b in range(kept - a):
                for c in range(3):
                    out[a, b, c] += (params[c] + params[3 + c]) / 2 * color[c] * flat[a, b]
        return 0.0, 0.0
    if way in (WALK, WALK_BLEND):
        length = row_length(poly, n, own, along, block[1], place[2]) if block[1] > 1 else 0.0
        if length <= limit or shift != 0.0:
            # where u moves, the mean over the way is a difference of running sums, and the rows' means: see `textured`
            for end in range(3 if shift != 0.0 else 1):
                mode, factor, moved, rows = TEXELS, 1.0, own, block
                if shift == 0.0:
                    mode = BLEND if way == WALK_BLEND else TEXELS
                elif end < 2:
                    mode, factor, rows = ROWS, (2 * end - 1) / shift, shifted[1]
                    moved = own.copy()
                    for c in range(3):
                        moved[0, c] += end * shift * own[2, c]
                else:
                    rows = shifted[0]
                walk_moments(
                    poly, n, moved, along, mode, rows, texels, primitives, means, rules, place, degree, factor, parts
                )
            turn_moments(parts, along, degree, color, out)
            return 0.0, length
    clip_moments(
        poly, n, own, way in (CLIP_BLEND, WALK_BLEND), block[0], block[1], block[2], texels, rules, place, degree, parts
    )
    _add_tinted(parts, color, out)
    return 0.0, 0.0


@called
def _add_tinted(parts: FloatArray, color: FloatArray, out: FloatArray) -> None:
    for a in range(parts.shape[0]):
        for b in range(parts.shape[0] - a):
            for c in range(3):
                out[a, b, c] += parts[a, b, c] * color[c]
