"""Pictures of flat-coloured scenes under any pixel filter, at an instant or as a weighted sum of instants.

The picture with a margin as wide as the filter reaches is cut into pixels of one shade and visible borders (`borders`).
A shade that fills a pixel adds the filter's mass over it to every pixel around: together a convolution of the picture
of base shades. A border adds to the pixels around it the integral of the filter over what lies to its left
(`masses`), closed or by Gauss-Legendre rules with as many nodes as their error bound asks for. Nothing here is
sampled, and the bound that comes with the picture counts every rule used.
"""

from dataclasses import replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.reference.borders import BASE, COUNT, trace_pixel
from aliasbench.renderers.reference.coverage import band_candidates, row_candidates
from aliasbench.renderers.reference.faces import Faces
from aliasbench.renderers.reference.flat import Integral, depth_extent, draw_view, over_bands, palette
from aliasbench.renderers.reference.masses import QUADRATURE, cell_masses, cell_peaks, rules_of, run_masses
from aliasbench.renderers.reference.paths import Paths
from aliasbench.renderers.reference.pieces import Pieces, pieces_at
from aliasbench.renderers.sampling.filters import FilterSpec
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import FloatArray, Scene
from aliasbench.scenes.projection import View, view_at

IntArray = NDArray[np.int64]

LARGEST_MARGIN = 1024
_SECTION = 256  # rows whose patches are held at a time
_ROUNDING = 1e-12  # see `rounding_bound`


def draw_filtered(
    scene: Scene, faces: Faces, paths: Paths, size: tuple[int, int], frame: int, fraction: float, spec: FilterSpec
) -> Integral:
    """Return the exact picture at one instant under a filter.

    The box of one pixel takes `flat.draw_view`, which needs no margin.

    Raises
    ------
    InputError
        For a filter that reaches over more than `LARGEST_MARGIN` pixels.
    """
    view = view_at(scene.camera, scene.animation, frame, fraction, size)
    return draw_instant_view(scene, faces, paths, view, frame, fraction, spec)


def draw_instant_view(
    scene: Scene, faces: Faces, paths: Paths, view: View, frame: int, fraction: float, spec: FilterSpec
) -> Integral:
    """Return the exact picture of one instant in a given view, whose axes may be sheared.

    A point's camera coordinates are its products with the view's axes, whatever these are: a view through a place of a
    lens has axes that are not at right angles.

    Raises
    ------
    InputError
        For a filter that reaches over more than `LARGEST_MARGIN` pixels.
    """
    if is_pixel_box(spec):
        return draw_view(scene, view, pieces_at(faces, paths, view, frame, fraction))
    pixels = np.zeros((view.height, view.width, 3))
    wide = wide_view(view, spec)
    bound = add_filtered(scene, wide, pieces_at(faces, paths, wide, frame, fraction), np.ones(1), spec, pixels)
    return Integral(pixels, np.full(pixels.shape[:2], bound))


def is_pixel_box(spec: FilterSpec) -> bool:
    """Return whether a filter is the plain area of a pixel."""
    return spec.name == "box" and spec.radius == 0.5


def wide_view(view: View, spec: FilterSpec) -> View:
    """Return the view widened on every side by the filter's margin: all that the picture's pixels see.

    Raises
    ------
    InputError
        For a filter that reaches over more than `LARGEST_MARGIN` pixels.
    """
    margin = spec.margin
    if margin > LARGEST_MARGIN:
        raise InputError(
            f"filter={spec.name},radius={spec.radius:g} reaches {spec.support:g} pixels far; "
            f"a reference allows at most {LARGEST_MARGIN}"
        )
    return replace(view, width=view.width + 2 * margin, height=view.height + 2 * margin)


def add_filtered(
    scene: Scene, view: View, pieces: Pieces, weights: FloatArray, spec: FilterSpec, out: FloatArray
) -> float:
    """Add weights[t] times the filtered picture of every instant t to `out`; return a bound on the error added.

    Parameters
    ----------
    scene : Scene
        For its colours.
    view : View
        From `wide_view`; of any of the instants (only size and kind of projection count).
    pieces : Pieces
        Of the instants, in the wide view.
    weights : (t,) float64
    spec : FilterSpec
    out : (h, w, 3) float64
        The picture, without margin.
    """
    margin = spec.margin
    colors, shades = np.unique(palette(scene), axis=0, return_inverse=True)
    shades = shades.ravel().astype(np.int64)
    extent = depth_extent(scene)
    rules = rules_of(spec)
    base = np.zeros((view.height, view.width, 3))
    height, width = out.shape[:2]

    def draw(rows: NDArray[np.int64]) -> tuple[int, FloatArray, int]:
        top, bottom = max(0, int(rows[0]) - 2 * margin), min(height, int(rows[1]))
        patch = np.zeros((max(0, bottom - top), width, 3))
        most = _filter_rows(
            pieces.points, pieces.starts, pieces.planes, pieces.owners, pieces.instants, colors, shades,
            view.perspective, extent, weights, spec.params, rules.limits, rules.nodes, rules.knots, rules.kind,
            spec.support, margin, rows, base, top, patch,
        )  # fmt: skip
        return top, patch, most

    most = 0
    for section in range(0, view.height, _SECTION):

        def draw_section(rows: NDArray[np.int64], section: int = section) -> tuple[int, FloatArray, int]:
            return draw(rows + section)

        for top, patch, rules_used in over_bands(draw_section, min(_SECTION, view.height - section)):
            out[top : top + len(patch)] += patch
            most = max(most, rules_used)
    _convolve(base, cell_masses(spec), margin, out)
    largest = float(np.abs(colors).max())
    share = float(np.abs(weights).sum())
    return (
        share * largest * (rounding_bound(spec, view) + QUADRATURE * most * (2 * margin + 1) ** 2 * min(1.0, spec.peak))
    )


def spread_bound(bound: FloatArray, spec: FilterSpec) -> FloatArray:
    """Return what changes within pixels can change in a filtered picture.

    Parameters
    ----------
    bound : (h + 2 m, w + 2 m) float64
        In the wide view: for every pixel a bound on the integral over it of the absolute error, of a time average say.
    spec : FilterSpec

    Returns
    -------
    (h, w) float64
        A bound for every pixel: each pixel around it adds its bound times the largest abs f over it.
    """
    peaks, margin = cell_peaks(spec), spec.margin
    out = np.zeros((bound.shape[0] - 2 * margin, bound.shape[1] - 2 * margin, 1))
    _convolve(bound[:, :, None], peaks, margin, out)
    return out[:, :, 0]


def rounding_bound(spec: FilterSpec, view: View) -> float:
    """Return what rounding may change in a filtered picture, relative to its largest colour.

    A corner is known to a few units in the last place of the picture's width, and an edge that is off by d changes a
    pixel by at most d times the filter's peak along one axis; sums of terms with negative lobes add their size.
    """
    place = 8 * 2.0**-52 * max(view.width, view.height)
    return (_ROUNDING + 2 * place * max(1.0, spec.peak)) * spec.gain


@njit(cache=True, nogil=True, error_model="numpy")
def _filter_rows(
    points: FloatArray, starts: IntArray, planes: FloatArray, owners: IntArray, instants: IntArray,
    colors: FloatArray, shades: IntArray, perspective: bool, extent: float, weights: FloatArray, params: FloatArray,
    limits: FloatArray, nodes: FloatArray, knots: FloatArray, kind: int, support: float, margin: int, rows: IntArray,
    base: FloatArray, top: int, patch: FloatArray,
) -> int:  # fmt: skip
    """Fill rows [rows[0], rows[1]) of the base shades and add the borders' share to the rows around.

    `base` is the wide picture; `patch` holds rows of the narrow one from row `top` on, all that these rows reach.
    Returns the largest number of quadrature rules in any pixel.
    """
    columns = base.shape[1]
    runs, sides = np.empty((64, 5)), np.empty((64, 2), np.int64)
    state = np.zeros(2, np.int64)
    reach = 2 * margin + 1
    share = np.empty((min(reach, len(patch)), min(reach, patch.shape[1])))
    profile = np.empty(share.shape[1])
    most = 0
    for t in range(len(weights)):
        band, low, high, here = band_candidates(points, starts, instants[t], instants[t + 1], rows)
        for row in range(rows[0], rows[1]):
            first_of, ids, alone = row_candidates(points, starts, band, low, high, here, row, columns)
            for column in range(columns):
                begin, n = first_of[column], first_of[column + 1] - first_of[column]
                if alone[column]:
                    shade = shades[-1] if n == 0 else shades[owners[ids[begin]]]
                    for c in range(3):
                        base[row, column, c] += weights[t] * colors[shade, c]
                    continue
                runs, sides = trace_pixel(
                    points, starts, planes, owners, shades, perspective, extent, ids[begin:], n,
                    float(column), float(row), state, runs, sides,
                )  # fmt: skip
                for c in range(3):
                    base[row, column, c] += weights[t] * colors[state[BASE], c]
                # rows and columns of the narrow picture that this pixel reaches
                r0, r1 = max(row - 2 * margin, 0), min(row + 1, top + len(patch))
                c0, c1 = max(column - 2 * margin, 0), min(column + 1, patch.shape[1])
                if r0 >= r1 or c0 >= c1:
                    continue
                used = 0
                for k in range(state[COUNT]):
                    used += run_masses(
                        params, limits, nodes, knots, kind, support, runs[k],
                        (r0 + margin - row, c0 + margin - column), (r1 - r0, c1 - c0), profile, share,
                    )  # fmt: skip
                    left, right = sides[k, 0], sides[k, 1]
                    for c in range(3):
                        step = weights[t] * (colors[left, c] - colors[right, c])
                        if step != 0.0:
                            for i in range(r1 - r0):
                                for j in range(c1 - c0):
                                    patch[r0 - top + i, c0 + j, c] += step * share[i, j]
                most = max(most, used)
    return most


def _convolve(base: FloatArray, masses: FloatArray, margin: int, out: FloatArray) -> None:
    """Add what is in (h + 2 m, w + 2 m, c) times the filter's masses, (2 m + 1,) or that squared, to (h, w, c)."""
    h, w = out.shape[:2]
    reach = range(2 * margin + 1)
    if masses.ndim == 1:
        rows = np.zeros((h, *base.shape[1:]))
        for i in reach:
            rows += masses[i] * base[i : i + h]
        for j in reach:
            out += masses[j] * rows[:, j : j + w]
        return
    for i in reach:
        for j in reach:
            if masses[i, j] != 0.0:
                out += masses[i, j] * base[i : i + h, j : j + w]
