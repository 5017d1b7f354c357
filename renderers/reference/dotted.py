"""Textured pictures over an open shutter under wide filters: points on a lattice that shifts from instant to instant.

A pixel under a wide filter sees thousands of texels' borders pass while the shutter is open, and many instants tell
more of it than few exact ones. At each instant the scene is looked up at one point of every cell, the same point in
all of them, so that the filter's weights are one small table. Time and shift are the points of a scrambled Sobol
sequence (`averaged`): the estimate is unbiased, and its error falls faster than by chance.
"""

import math

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.reference.averaged import scrambled_sobol
from aliasbench.renderers.reference.faces import Faces
from aliasbench.renderers.reference.flat import over_bands
from aliasbench.renderers.reference.paths import Paths
from aliasbench.renderers.reference.texture_tables import TextureTable
from aliasbench.renderers.reference.textured import Instant, instant_of
from aliasbench.renderers.reference.weighted import Cells, build_cells, sample_rows
from aliasbench.renderers.sampling.filters import FilterSpec
from aliasbench.scenes.model import FloatArray, Scene
from aliasbench.scenes.projection import view_at

_ACROSS, _MOST_EACH = 9.0, 21  # cells to a filter, and at most to a pixel, along one axis
# Nanoseconds of one core: of a point and another for each piece, of an instant, and of a term of the gathering
_POINT, _PIECE, _INSTANT, _TERM = 60.0, 10.0, 3e6, 12.0
_FEWEST, _MOST = 16, 256


def lattice(spec: FilterSpec) -> Cells:
    """Return the cells that hold one point each."""
    each = min(math.ceil(_ACROSS / (2 * spec.support)), _MOST_EACH)
    return build_cells(spec, each + 1 - each % 2)


def affordable_instants(cells: Cells, size: tuple[int, int], pieces: int, budget: float) -> int:
    """Return how many instants, a power of two, take `budget` nanoseconds."""
    across = 2 * cells.margin + 1
    points = (size[0] * cells.each + across) * (size[1] * cells.each + across)
    terms = 2 * across if cells.spec.kind.separable else across**2
    price = _INSTANT + points * (_POINT + _PIECE * pieces) + size[0] * size[1] * terms * _TERM
    return int(2 ** np.clip(np.floor(np.log2(max(budget / price, 1.0))), np.log2(_FEWEST), np.log2(_MOST)))


def draw_dotted(
    scene: Scene, faces: Faces, paths: Paths, size: tuple[int, int], frame: int, table: TextureTable, cells: Cells,
    count: int, seed: int,
) -> FloatArray:  # fmt: skip
    """Return an unbiased estimate (h, w, 3) of the mean over the open shutter.

    Parameters
    ----------
    cells : Cells
        Of the filter.
    count : int
        Of instants, a power of two.
    seed : int
    """
    shutter = scene.animation.shutter
    out = np.zeros((size[1], size[0], 3))
    wide = cells.fine_view(view_at(scene.camera, scene.animation, frame, 0.0, size))
    nothing = np.zeros((wide.height, wide.width, 3))
    for time, x, y in scrambled_sobol(count, 3, seed):
        fraction = shutter * float(time)
        view = cells.fine_view(view_at(scene.camera, scene.animation, frame, fraction, size))
        at = instant_of(scene, faces, paths, view, frame, fraction, table)
        points, shift = np.empty((view.height, view.width, 5)), np.array([x, y])

        def draw(
            rows: NDArray[np.int64], at: Instant = at, points: FloatArray = points, shift: FloatArray = shift
        ) -> None:
            sample_rows(
                at.pieces.points, at.pieces.starts, at.pieces.planes, at.pieces.owners, at.colors, at.surfaces.ways,
                at.surfaces.own, at.surfaces.blocks, at.surfaces.params, at.surfaces.texels, at.view.perspective,
                at.extent, 0, frame, shift, nothing, rows, points,
            )  # fmt: skip

        over_bands(draw, view.height)
        _gather(points[..., 2:], cells, shift, out)
    return out / count


def _gather(values: FloatArray, cells: Cells, shift: FloatArray, out: FloatArray) -> None:
    """Add the filter's sum over points at `shift` of each cell, times a cell's area."""
    m, (h, w, _) = cells.each, out.shape
    places = np.arange(-cells.margin, cells.margin + 1) - 0.5
    x, y = (places + shift[0]) / m, (places + shift[1]) / m
    first = m // 2
    columns = [slice(first + k, first + k + m * (w - 1) + 1, m) for k in range(len(places))]
    rows = [slice(first + k, first + k + m * (h - 1) + 1, m) for k in range(len(places))]
    if not cells.spec.kind.separable:
        for k, weights in enumerate(cells.spec.evaluate(x[None, :], y[:, None]) / m**2):
            for weight, column in zip(weights.tolist(), columns, strict=True):
                if weight != 0.0:
                    out += weight * values[rows[k], column]
        return
    across, down = cells.spec.profile(x) / m, cells.spec.profile(y) / m
    along = np.zeros((len(values), w, 3))
    for weight, column in zip(across.tolist(), columns, strict=True):
        if weight != 0.0:
            along += weight * values[:, column]
    for weight, row in zip(down.tolist(), rows, strict=True):
        if weight != 0.0:
            out += weight * along[row]
