"""References of textured scenes at an instant: exact, up to a bound on rounding.

Each pixel is cut into fragments that show one piece (`fragments`), and a fragment's texture is integrated in closed
form or, where it is smooth, by quadrature that leaves less than rounding does (`surfaces` says how). So a floor that
runs to the horizon costs about one step for each row of texels and column of pixels.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.reference.coverage import row_extent
from aliasbench.renderers.reference.faces import Faces
from aliasbench.renderers.reference.flat import Integral, over_bands, palette, scene_extent
from aliasbench.renderers.reference.fragments import between, convex_area, split_pixel
from aliasbench.renderers.reference.paths import Paths
from aliasbench.renderers.reference.pieces import Pieces, pieces_at
from aliasbench.renderers.reference.surfaces import (
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

# Texels clipped one by one, some 0.1 microseconds each: about what the next best way (`scanlines`) would take.
MOST_TILES, _TILES_OF_A_PIXEL = 4e7, 6e3
_ROUNDING = 4e-12


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
        view, pieces, build_surfaces(pieces, table, colors, uv_reach, view, far), colors, scene_extent(scene)
    )


def draw_textured(instant: Instant) -> Integral | None:
    """Return the exact box-filtered picture at one instant, None where that would take too much work."""
    view, pieces, surfaces, colors = instant.view, instant.pieces, instant.surfaces, instant.colors
    if surfaces.tiles > MOST_TILES + _TILES_OF_A_PIXEL * view.width * view.height:
        return None
    out = np.zeros((view.height, view.width, 3))
    rules = gauss_table()

    def draw(rows: NDArray[np.int64]) -> float:
        return texture_rows(
            pieces.points, pieces.starts, pieces.planes, pieces.owners, colors, surfaces.ways, surfaces.own,
            surfaces.along, surfaces.blocks, surfaces.params, surfaces.shifts, surfaces.shifted,
            surfaces.texels, surfaces.sums, rules, view.perspective, instant.extent, rows, out,
        )  # fmt: skip

    if max(over_bands(draw, view.height)) > 0.0:
        return None
    largest = float(np.abs(colors).max() * max(1.0, float(np.abs(surfaces.texels).max())))
    return Integral(out, np.full(out.shape[:2], surfaces.bound + _ROUNDING * largest))


@njit(cache=True, nogil=True, error_model="numpy")
def texture_rows(
    points: FloatArray, starts: IntArray, planes: FloatArray, owners: IntArray, colors: FloatArray, ways: IntArray,
    own: FloatArray, along: FloatArray, blocks: IntArray, params: FloatArray, shifts: FloatArray, shifted: IntArray,
    texels: FloatArray, sums: FloatArray, rules: FloatArray, perspective: bool, extent: float, rows: IntArray,
    out: FloatArray,
) -> float:  # fmt: skip
    """Add the picture to rows [rows[0], rows[1]) of `out` (h, w, 3); return the area that was given up as too fine."""
    width, count = out.shape[1], len(owners)
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
                    clip_texels(
                        polys[f], sizes[f], own[piece], way == CLIP_BLEND, blocks[piece, 0], blocks[piece, 1],
                        blocks[piece, 2], texels, rules, value,
                    )  # fmt: skip
                for c in range(3):
                    out[row, column, c] += colors[owner, c] * value[c]
    return lost


@njit(cache=True, nogil=True, error_model="numpy")
def _add_rows(
    poly: FloatArray, n: int, own: FloatArray, along: FloatArray, mode: int, shift: float, block: IntArray,
    shifted: IntArray, texels: FloatArray, sums: FloatArray, part: FloatArray, value: FloatArray,
) -> None:  # fmt: skip
    """Add an image whose rows are in line; where u moves by `shift`, its mean over the way.

    With P the running sum of a row, the mean over [u, u + shift] is (P(u + shift) - P(u)) / shift: that of P less what
    grows evenly, plus the row's mean.
    """
    if shift == 0.0:
        walk_texels(poly, n, own, along[0], along[1], mode, block[0], block[1], block[2], texels, sums, value)
        return
    b = shifted[0]
    walk_texels(poly, n, own, along[0], along[1], TEXELS, b[0], b[1], b[2], texels, sums, value)
    b = shifted[1]
    for end in range(2):
        rows = own.copy()
        for c in range(3):
            rows[0, c] += end * shift * own[2, c]
            part[c] = 0.0
        walk_texels(poly, n, rows, along[0], along[1], ROWS, b[0], b[1], b[2], texels, sums, part)
        for c in range(3):
            value[c] += (2 * end - 1) * part[c] / shift
