"""Textured pictures under any pixel filter: exact means of small cells, and an unbiased estimate of what they miss.

With f the scene, w the filter, and a bar for the mean over a cell, the integral of f w is the sum of f-bar w-bar, exact
from a finer picture (`textured`), plus that of (f - f-bar)(w - w-bar): a small thing, since both factors are, of which
one random point in each cell is an unbiased estimate. Cells are 1 / m of a pixel wide, m odd, so that a pixel's centre
is a cell's.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import called
from aliasbench.renderers.reference.coverage import row_extent
from aliasbench.renderers.reference.flat import over_bands
from aliasbench.renderers.reference.masses import cell_masses
from aliasbench.renderers.reference.pieces import Pieces
from aliasbench.renderers.reference.slabs import TIE, nearness_at
from aliasbench.renderers.reference.surfaces import CLIP_BLEND, FLAT, PLATE, WALK_BLEND, WAVE, Surfaces
from aliasbench.renderers.reference.walks import linear_at, wrap
from aliasbench.renderers.sampling.filters import FilterSpec, filter_at, make_filter
from aliasbench.renderers.sampling.hashing import combine, pattern_key, unit
from aliasbench.scenes.model import FloatArray
from aliasbench.scenes.projection import View

IntArray = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """The cells of a picture under a filter.

    Attributes
    ----------
    each : int
        Cells to a pixel along one axis; odd.
    spec : FilterSpec
    margin : int
        How many cells the filter reaches beyond the one at a pixel's centre.
    masses : (2 margin + 1, 2 margin + 1) float64
        Its mass over the cells around.
    """

    each: int
    spec: FilterSpec
    margin: int
    masses: FloatArray

    def fine_view(self, view: View) -> View:
        """Return the view whose pixels are the cells, as far as filters reach."""
        return replace(
            view,
            scale=view.scale * self.each,
            width=view.width * self.each + 2 * self.margin,
            height=view.height * self.each + 2 * self.margin,
        )

    def gather(self, means: FloatArray, size: tuple[int, int]) -> FloatArray:
        """Return the picture (h, w, 3) of cells that are flat."""
        m, reach = self.each, range(2 * self.margin + 1)
        first = m // 2
        h, w = size[1], size[0]
        out = np.zeros((h, w, 3))
        if self.spec.kind.separable:
            along = np.zeros((means.shape[0], w, 3))
            for k in reach:
                along += self.masses[self.margin, k] * means[:, first + k : first + k + m * w : m][:, :w]
            scale = self.masses[self.margin, self.margin]
            for k in reach:
                out += self.masses[k, self.margin] / scale * along[first + k : first + k + m * h : m][:h]
            return out
        for i in reach:
            for j in reach:
                if self.masses[i, j] != 0.0:
                    rows = means[first + i : first + i + m * h : m][:h]
                    out += self.masses[i, j] * rows[:, first + j : first + j + m * w : m][:, :w]
        return out


def build_cells(spec: FilterSpec, each: int) -> Cells:
    """Return the cells for a filter, `each` of them (odd) to a pixel."""
    if not spec.kind.separable:
        # the cone is the same at every scale
        wide = make_filter(spec.name, spec.radius * each)
        return Cells(each, spec, wide.margin, cell_masses(wide))
    margin = max(0, math.ceil(spec.support * each - 0.5))
    borders = np.arange(-margin, margin + 2) - 0.5
    masses = np.diff(spec.integral(borders / each))
    return Cells(each, spec, margin, np.outer(masses, masses))


def sample_rest(
    cells: Cells, pieces: Pieces, surfaces: Surfaces, colors: FloatArray, means: FloatArray, perspective: bool,
    extent: float, size: tuple[int, int], seed: int, frame: int, *, known: bool = True,
) -> FloatArray:  # fmt: skip
    """Return an unbiased estimate (h, w, 3) of what `Cells.gather` misses of the scene, from one point in each cell.

    `pieces` and `surfaces` are those of the fine view, `means` (fine h, fine w, 3) the cells' means, or unbiased
    estimates of them, of which `gather` is given the same. If the means are not `known`, they must be zero: the
    estimate is then of the whole picture, and needs no `gather`.
    """
    out = np.zeros((size[1], size[0], 3))
    points, anywhere = np.zeros((len(means), means.shape[1], 5)), np.full(2, -1.0)
    masses = cells.masses if known else np.zeros_like(cells.masses)

    def draw(rows: NDArray[np.int64]) -> None:
        sample_rows(
            pieces.points, pieces.starts, pieces.planes, pieces.owners, colors, surfaces.ways, surfaces.own,
            surfaces.blocks, surfaces.params, surfaces.texels, perspective, extent, seed, frame, anywhere, means,
            rows, points,
        )  # fmt: skip

    def weigh(rows: NDArray[np.int64]) -> None:
        _weigh_rows(points, cells.spec.params, masses, cells.each, cells.margin, rows, out)

    over_bands(draw, len(means))
    over_bands(weigh, size[1])
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def sample_rows(
    points: FloatArray, starts: IntArray, planes: FloatArray, owners: IntArray, colors: FloatArray, ways: IntArray,
    own: FloatArray, blocks: IntArray, params: FloatArray, texels: FloatArray, perspective: bool, extent: float,
    seed: int, frame: int, shift: FloatArray, means: FloatArray, rows: IntArray, out: FloatArray,
) -> None:  # fmt: skip
    """Fill rows of cells with the place of a point in each (x, y) and the scene there less the mean.

    The point is random where `shift` is negative, else at `shift` of a cell.
    """
    width, count = means.shape[1], len(owners)
    ids, left, right = np.empty(count, np.int64), np.empty(count), np.empty(count)
    value = np.empty(3)
    for row in range(rows[0], rows[1]):
        key = pattern_key(seed, frame, -3, row)
        across, down = combine(key, 1), combine(key, 2)
        n = 0
        for i in range(count):
            lo, hi = row_extent(points, starts[i], starts[i + 1], row, row + 1)
            if lo < width and hi > 0:
                ids[n], left[n], right[n] = i, lo, hi
                n += 1
        for column in range(width):
            x, y = column + shift[0], row + shift[1]
            if shift[0] < 0.0:
                x, y = column + unit(across, column), row + unit(down, column)
            shown, best = -1, 0.0
            for a in range(n):
                if left[a] <= x <= right[a] and _is_inside(points, starts[ids[a]], starts[ids[a] + 1], x, y):
                    near = nearness_at(planes[ids[a], 0], x, y)
                    tie = TIE * (max(abs(near), abs(best)) if perspective else extent)
                    if shown < 0 or near > best + tie or (near >= best - tie and owners[ids[a]] > owners[shown]):
                        shown, best = ids[a], near
            for c in range(3):
                value[c] = 1.0
            if shown >= 0 and ways[shown] != FLAT:
                _look_up(ways[shown], own[shown], blocks[shown], params[shown], texels, x, y, value)
            owner = owners[shown] if shown >= 0 else -1
            out[row, column, 0], out[row, column, 1] = x - column, y - row
            for c in range(3):
                out[row, column, 2 + c] = colors[owner, c] * value[c] - means[row, column, c]


@called
def _is_inside(points: FloatArray, begin: int, end: int, x: float, y: float) -> bool:
    for k in range(begin, end):
        j = k + 1 if k + 1 < end else begin
        dx, dy = points[j, 0] - points[k, 0], points[j, 1] - points[k, 1]
        if dx * (y - points[k, 1]) - dy * (x - points[k, 0]) < 0.0:
            return False
    return True


@called
def _look_up(
    way: int, own: FloatArray, block: IntArray, params: FloatArray, texels: FloatArray, x: float, y: float,
    value: FloatArray,
) -> None:  # fmt: skip
    """Write the value of a texture at a point of the picture."""
    q = linear_at(own[2], x, y)
    u, v = linear_at(own[0], x, y) / q, linear_at(own[1], x, y) / q
    if way in (WAVE, PLATE):
        wave = np.cos(2 * np.pi * u) if way == WAVE else np.cos(params[6] * (u * u + v * v) + params[7])
        for c in range(3):
            value[c] = (params[c] + params[3 + c]) / 2 + (params[3 + c] - params[c]) / 2 * wave
        return
    i, j = np.floor(u), np.floor(v)
    row = block[2] + wrap(j, block[0]) * (block[1] + 1)
    at = row + wrap(i, block[1])
    if way not in (WALK_BLEND, CLIP_BLEND):
        for c in range(3):
            value[c] = texels[at, c]
        return
    above = at - row + block[2] + wrap(j + 1.0, block[0]) * (block[1] + 1)
    s, t = u - i, v - j
    for c in range(3):
        low = texels[at, c] + s * (texels[at + 1, c] - texels[at, c])
        high = texels[above, c] + s * (texels[above + 1, c] - texels[above, c])
        value[c] = low + t * (high - low)


@njit(cache=True, nogil=True, error_model="numpy")
def _weigh_rows(
    points: FloatArray, params: FloatArray, masses: FloatArray, each: int, margin: int, rows: IntArray, out: FloatArray,
) -> None:  # fmt: skip
    """Fill rows of the picture with the sum over cells of (f - its mean) (w - its mean)."""
    for row in range(rows[0], rows[1]):
        for column in range(out.shape[1]):
            first_row, first_column = each * row + each // 2, each * column + each // 2
            for i in range(2 * margin + 1):
                for j in range(2 * margin + 1):
                    p = points[first_row + i, first_column + j]
                    if p[2] == 0.0 and p[3] == 0.0 and p[4] == 0.0:
                        continue
                    x, y = (j - margin + p[0] - 0.5) / each, (i - margin + p[1] - 0.5) / each
                    w = filter_at(params, x, y) / (each * each) - masses[i, j]
                    for c in range(3):
                        out[row, column, c] += w * p[2 + c]
