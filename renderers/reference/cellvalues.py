"""What one pixel cell of flat colours adds to the picture at an instant: its mean under the box, or under any filter
what it adds to each of the pixels around.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating
from aliasbench.renderers.reference.borders import BASE, COUNT, trace_pixel
from aliasbench.renderers.reference.coverage import cover_pixel
from aliasbench.renderers.reference.masses import cell_masses, cell_peaks, rules_of, run_masses
from aliasbench.renderers.sampling.filters import FilterSpec
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]


class Shades(NamedTuple):
    """Colours, and how far a filter reaches, as arrays for a kernel.

    Attributes
    ----------
    colors : (objects + 1, 3) float64
        Of every object, and last of the background.
    shades, tints : (objects + 1,) int64 and (k, 3) float64
        The number of each colour among the distinct ones, and these.
    margin : int
    peaks : (2 margin + 1, 2 margin + 1) float64
        Bounds on the filter's absolute value over the pixels around its centre.
    """

    colors: FloatArray
    shades: IntArray
    tints: FloatArray
    margin: int
    peaks: FloatArray


class Blur(NamedTuple):
    """A filter other than the area of a pixel, as arrays for a kernel.

    Attributes
    ----------
    masses : (2 margin + 1, 2 margin + 1) float64
        Its mass over the pixels around its centre.
    support, params, limits, nodes, knots, kind
        Of the `FilterSpec` and its `Rules`.
    """

    masses: FloatArray
    support: float
    params: FloatArray
    limits: FloatArray
    nodes: FloatArray
    knots: FloatArray
    kind: int


def shades_of(colors: FloatArray, spec: FilterSpec | None) -> tuple[Shades, Blur | None]:
    """Return colours and filter for a kernel; no filter is the area of a pixel."""
    tints, shades = np.unique(colors, axis=0, return_inverse=True)
    numbers = shades.ravel().astype(np.int64)
    if spec is None:
        return Shades(colors, numbers, tints, 0, np.ones((1, 1))), None
    rules = rules_of(spec)
    masses, peaks = cell_masses(spec), cell_peaks(spec)
    if masses.ndim == 1:
        masses, peaks = np.outer(masses, masses), np.outer(peaks, peaks)
    return Shades(colors, numbers, tints, spec.margin, peaks), Blur(
        masses, float(spec.support), spec.params, rules.limits, rules.nodes, rules.knots, rules.kind
    )


class Block(NamedTuple):
    """The pixels that a cell adds to: rows first[0] + i, columns first[1] + j of the picture without margin.

    `row`, `column` is the cell, in the picture with margin.
    """

    row: int
    column: int
    top: int
    left: int
    rows: int
    columns: int


@allocating
def block_of(row: int, column: int, margin: int, height: int, width: int) -> Block:
    """Return what a cell reaches in a picture of a size; rows or columns may be 0."""
    top, left = max(row - 2 * margin, 0), max(column - 2 * margin, 0)
    return Block(row, column, top, left, max(0, min(row + 1, height) - top), max(0, min(column + 1, width) - left))


@allocating
def fill_value(
    points: FloatArray, starts: IntArray, planes: FloatArray, owners: IntArray, perspective: bool, extent: float,
    cand: IntArray, n: int, block: Block, shades: Shades, blur: Blur | None,
    runs: FloatArray, sides: IntArray, out: FloatArray,
) -> tuple[FloatArray, IntArray]:  # fmt: skip
    """Fill `out` (rows columns 3,) with what a cell adds to its block; return the room for borders, maybe larger."""
    row, column = block.row, block.column
    if blur is None:  # known when this is compiled: the filters' part is left out then
        total, comp = np.zeros(3), np.zeros(3)
        cover_pixel(
            points, starts, planes, owners, shades.colors, perspective, extent, cand, n, float(column), float(row),
            total, comp,
        )  # fmt: skip
        for c in range(3):
            out[c] = total[c] + comp[c]
        return runs, sides
    state = np.zeros(2, np.int64)
    runs, sides = trace_pixel(
        points, starts, planes, owners, shades.shades, perspective, extent, cand, n, float(column), float(row),
        state, runs, sides,
    )  # fmt: skip
    margin, tints = shades.margin, shades.tints
    k = 0
    for i in range(block.rows):
        for j in range(block.columns):
            mass = blur.masses[row - block.top - i, column - block.left - j]
            for c in range(3):
                out[k] = mass * tints[state[BASE], c]
                k += 1
    share, profile = np.empty((block.rows, block.columns)), np.empty(block.columns)
    for e in range(state[COUNT]):
        run_masses(
            blur.params, blur.limits, blur.nodes, blur.knots, blur.kind, blur.support, runs[e],
            (block.top + margin - row, block.left + margin - column), (block.rows, block.columns), profile, share,
        )  # fmt: skip
        k = 0
        for i in range(block.rows):
            for j in range(block.columns):
                for c in range(3):
                    out[k] += (tints[sides[e, 0], c] - tints[sides[e, 1], c]) * share[i, j]
                    k += 1
    return runs, sides
