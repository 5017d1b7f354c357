"""References of textured scenes at an instant: exact, up to a bound on rounding.

Each pixel is cut into fragments that show one piece (`fragments`), and a fragment's texture is integrated in closed
form or, where it is smooth, by quadrature that leaves less than rounding does (`surfaces` says how). So a floor that
runs to the horizon costs about one step for each row of texels and column of pixels.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating
from aliasbench.renderers.reference.coverage import row_extent
from aliasbench.renderers.reference.faces import Faces
from aliasbench.renderers.reference.flat import Integral, depth_extent, over_bands, palette
from aliasbench.renderers.reference.footprints import DEGREE, add_footprint, add_mean, crossings, row_bounds
from aliasbench.renderers.reference.fragments import between, convex_area, split_pixel
from aliasbench.renderers.reference.paths import Paths
from aliasbench.renderers.reference.pieces import Pieces, pieces_at
from aliasbench.renderers.reference.row_moments import row_primitives
from aliasbench.renderers.reference.surfaces import (
    CLIP,
    CLIP_BLEND,
    FLAT,
    PLATE,
    WALK,
    WALK_BLEND,
    WAVE,
    Surfaces,
    build_surfaces,
)
from aliasbench.renderers.reference.texture_tables import TextureTable
from aliasbench.renderers.reference.tiles import clip_texels, gauss_table, integrate_zone
from aliasbench.renderers.reference.walks import BLEND, ROWS, TEXELS, walk_texels, walk_wave
from aliasbench.scenes.model import FloatArray, Scene
from aliasbench.scenes.projection import View

IntArray = NDArray[np.int64]

# Nanoseconds that fragments' outlines may cost, by the borders of texels they cross, before means take over
MOST_CROSSINGS = 2.4e10
_WALKED, _CLIPPED = 25.0, 70.0
_ROUNDING = 4e-12
_COUNT = -1.0  # crossings are counted instead


@dataclass(frozen=True, slots=True, eq=False)
class Instant:
    """A scene at one instant as the kernels want it."""

    view: View
    pieces: Pieces
    surfaces: Surfaces
    colors: FloatArray
    extent: float


def instant_of(
    scene: Scene, faces: Faces, paths: Paths, view: View, frame: int, fraction: float, table: TextureTable
) -> Instant:
    """Return a scene at one instant, seen in a view of that instant."""
    pieces = pieces_at(faces, paths, view, frame, fraction)
    colors = palette(scene)
    uv_reach = np.array([0.0 if o.uv is None else float(np.abs(o.uv).max(initial=0.0)) for o in scene.objects])
    world = paths.positions(faces.vertices, faces.ranges, frame, fraction) - view.origin
    far = float(np.sqrt((world**2).sum(axis=1)).max(initial=0.0))
    return Instant(
        view, pieces, build_surfaces(pieces, table, colors, uv_reach, view, far), colors, depth_extent(scene)
    )


def draw_textured(instant: Instant) -> Integral | None:
    """Return the box-filtered picture at one instant, None where that would take too much work.

    It is exact up to rounding but in pixels that texels crowd: there the bound is that of a mean, see `footprints`.
    """
    view, pieces, surfaces, colors = instant.view, instant.pieces, instant.surfaces, instant.colors
    shape = (view.height, view.width)
    out, slack = np.zeros((*shape, 3)), np.zeros(shape)
    rules = gauss_table()
    primitives, means = row_primitives(surfaces, DEGREE, (CLIP, CLIP_BLEND))
    bounds = row_bounds(surfaces, primitives)

    def run(limit: float) -> float:
        def draw(rows: NDArray[np.int64]) -> float:
            return texture_rows(
                pieces.points, pieces.starts, pieces.planes, pieces.owners, colors, surfaces.ways, surfaces.own,
                surfaces.along, surfaces.blocks, surfaces.params, surfaces.shifts, surfaces.shifted, surfaces.texels,
                surfaces.sums, primitives, means, bounds, rules, view.perspective, instant.extent, limit, rows, slack,
                out,
            )  # fmt: skip

        return max(over_bands(draw, view.height))

    limit = np.inf
    if most_crossings(instant) > MOST_CROSSINGS:
        run(_COUNT)
        steps = np.sort(slack, axis=None)
        within = np.cumsum(steps) <= MOST_CROSSINGS
        limit = float(steps[within].max(initial=1.0))
        slack[:] = 0.0
    if run(limit) > 0.0:
        return None
    largest = float(np.abs(colors).max() * max(1.0, float(np.abs(surfaces.texels).max())))
    return Integral(out, slack + (surfaces.bound + _ROUNDING * largest))


def most_crossings(instant: Instant) -> float:
    """Return at most how many nanoseconds the borders of texels cost that the outlines of pixels cross, about.

    u and v change in one direction along a line, so each of the lines between pixels crosses every border once.
    """
    pieces, surfaces, view = instant.pieces, instant.surfaces, instant.view
    total = 0.0
    for m in np.flatnonzero((surfaces.ways != FLAT) & (surfaces.ways != WAVE) & (surfaces.ways != PLATE)):
        points = pieces.points[pieces.starts[m] : pieces.starts[m + 1]]
        u, v, q = surfaces.own[m] @ np.c_[points, np.ones(len(points))].T
        lines = np.minimum(np.ptp(points, axis=0) + 2.0, (view.width, view.height)).sum()
        price = _WALKED if surfaces.ways[m] in (WALK, WALK_BLEND) else _CLIPPED
        total += 2.0 * price * float(lines * (np.ptp(u / q) + np.ptp(v / q)))
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def texture_rows(
    points: FloatArray, starts: IntArray, planes: FloatArray, owners: IntArray, colors: FloatArray, ways: IntArray,
    own: FloatArray, along: FloatArray, blocks: IntArray, params: FloatArray, shifts: FloatArray, shifted: IntArray,
    texels: FloatArray, sums: FloatArray, primitives: FloatArray, means: FloatArray, bounds: FloatArray,
    rules: FloatArray, perspective: bool, extent: float, limit: float, rows: IntArray, slack: FloatArray,
    out: FloatArray,
) -> float:  # fmt: skip
    """Add the picture to rows [rows[0], rows[1]) of `out` (h, w, 3); return the area that was given up as too fine.

    Fragments whose outline crosses borders of texels for more than `limit` nanoseconds show the mean, and `slack`
    (h, w) gets its bound. With a negative limit nothing is drawn: `slack` gets the price of all such crossings.
    """
    width, count = out.shape[1], len(owners)
    brightest = np.abs(colors).max() * max(1.0, np.abs(texels).max())
    ids, cand = np.empty(count, np.int64), np.empty(count, np.int64)
    left, right = np.empty(count), np.empty(count)
    polys, sizes, shown = np.empty((16, 16, 2)), np.empty(16, np.int64), np.empty(16, np.int64)
    value, part = np.empty(3), np.empty(3)
    lost = 0.0
    for row in range(rows[0], rows[1]):
        n = 0
        for i in range(count):
            # empty, (inf, -inf), where the piece does not meet the row
            lo, hi = row_extent(points, starts[i], starts[i + 1], row, row + 1)
            if lo < width and hi > 0:
                ids[n], left[n], right[n] = i, lo, hi
                n += 1
        for column in range(width):
            here = between(ids, left, right, n, float(column), column + 1.0, cand)
            while True:
                fragments = split_pixel(
                    points, starts, planes, owners, perspective, extent, cand, here, float(column), float(row),
                    column + 1.0, row + 1.0, polys, sizes, shown,
                )  # fmt: skip
                if fragments >= 0:
                    break
                polys = np.empty((2 * polys.shape[0], 2 * polys.shape[1], 2))
                sizes, shown = np.empty(polys.shape[0], np.int64), np.empty(polys.shape[0], np.int64)
            for f in range(fragments):
                if sizes[f] < 3:
                    continue
                piece = shown[f]
                owner = owners[piece] if piece >= 0 else -1
                way = ways[piece] if piece >= 0 else FLAT
                image = way in (WALK, WALK_BLEND, CLIP, CLIP_BLEND)
                if image and limit < np.inf:
                    steps, _ = crossings(polys[f], sizes[f], own[piece])
                    price = steps * (_WALKED if way in (WALK, WALK_BLEND) else _CLIPPED)
                    if limit < 0.0:
                        slack[row, column] += price
                        continue
                    if price > limit:
                        part[:] = 0.0
                        left_out = add_mean(polys[f], sizes[f], own[piece], bounds[piece], part)
                        if left_out < np.inf:
                            most = 0.0
                            for c in range(3):
                                most = max(most, abs(colors[owner, c]))
                                out[row, column, c] += colors[owner, c] * part[c]
                            slack[row, column] += left_out * most
                            continue
                if limit < 0.0:
                    continue
                area = convex_area(polys[f], sizes[f])
                for c in range(3):
                    value[c] = area if way == FLAT else 0.0
                if way in (WAVE, PLATE):
                    if way == WAVE:
                        wave = walk_wave(polys[f], sizes[f], own[piece], along[piece, 0], along[piece, 1])
                    else:
                        p = params[piece]
                        wave, given_up = integrate_zone(polys[f], sizes[f], own[piece], p[6], p[7], rules)
                        lost += given_up
                    for c in range(3):
                        low, high = params[piece, c], params[piece, 3 + c]
                        value[c] = (low + high) / 2 * area + (high - low) / 2 * wave
                elif way in (WALK, WALK_BLEND):
                    mode = BLEND if way == WALK_BLEND else TEXELS
                    _add_rows(
                        polys[f], sizes[f], own[piece], along[piece], mode, shifts[piece], blocks[piece],
                        shifted[piece], texels, sums, part, value,
                    )  # fmt: skip
                elif way != FLAT:
                    off = add_footprint(
                        polys[f], sizes[f], own[piece], way == CLIP_BLEND, blocks[piece], texels, primitives, means,
                        bounds[piece, 3], rules, value,
                    )  # fmt: skip
                    slack[row, column] += max(off, 0.0) * brightest * area
                    if off < 0.0:
                        clip_texels(
                            polys[f], sizes[f], own[piece], way == CLIP_BLEND, blocks[piece, 0], blocks[piece, 1],
                            blocks[piece, 2], texels, rules, value,
                        )  # fmt: skip
                for c in range(3):
                    out[row, column, c] += colors[owner, c] * value[c]
    return lost


@allocating
def _add_rows(
    poly: FloatArray, n: int, own: FloatArray, along: FloatArray, mode: int, shift: float, block: IntArray,
    shifted: IntArray, texels: FloatArray, sums: FloatArray, part: FloatArray, value: FloatArray,
) -> None:  # fmt: skip
    """Add an image whose rows are in line; where u moves by `shift`, its mean over the way.

    With P the running sum of a row, the mean over [u, u + shift] is (P(u + shift) - P(u)) / shift: that of P less what
    grows evenly, plus the row's mean.
    """
    # one call for all modes: with constants it would be compiled for each
    for end in range(3 if shift != 0.0 else 1):
        rows, at, b, factor = mode, own, block, 1.0
        if shift != 0.0:
            rows, b = TEXELS, shifted[0]
            if end < 2:
                rows, b, factor = ROWS, shifted[1], (2 * end - 1) / shift
                at = own.copy()
                for c in range(3):
                    at[0, c] += end * shift * own[2, c]
        for c in range(3):
            part[c] = 0.0
        walk_texels(poly, n, at, along[0], along[1], rows, b[0], b[1], b[2], texels, sums, part)
        for c in range(3):
            value[c] += factor * part[c]
