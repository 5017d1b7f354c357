"""Unbiased estimates of pictures under lights from stratified points: for averages over a lens or time.

The points of a pixel are a lattice of the golden ratio, moved at random (Cranley and Patterson 1976): every one of them
is uniform over the pixel by itself, which is all that being unbiased takes. At a point irradiance is closed, so a soft
shadow adds no noise; what is noisy is where pieces end within the pixel.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.renderers.reference.coverage import band_candidates, row_candidates
from aliasbench.renderers.reference.irradiance import CORNERS, stack_room
from aliasbench.renderers.reference.lit_cells import Rules
from aliasbench.renderers.reference.occluders import SEPARATES, SHADES, Links
from aliasbench.renderers.reference.shading import COATED, SHOWN, Stage, place_of, shade
from aliasbench.renderers.reference.slabs import TIE, nearness_at
from aliasbench.renderers.sampling.filters import filter_at
from aliasbench.renderers.sampling.hashing import combine, pattern_key, unit
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]

_GOLDEN = 0.6180339887498949


@njit(cache=True, nogil=True, error_model="numpy")
def point_rows(
    points: FloatArray, starts: IntArray, planes: FloatArray, owners: IntArray, extent: float, tiny: float,
    stage: Stage, links: Links, rules: Rules, number: int, seed: int, frame: int, rows: IntArray, top: int,
    patch: FloatArray,
) -> None:  # fmt: skip
    """Add to `patch` (rows of the narrow picture from `top` on) an estimate of what `lit_cells.lit_rows` integrates."""
    m = rules.margin
    width = patch.shape[1] + 2 * m
    reach = 2 * m + 1
    sum_here = np.empty(3)
    scratch, marks = np.empty((64, CORNERS, 3)), np.empty((64, 2), np.int64)
    active = np.empty(64, np.int64)
    band, low, high, here = band_candidates(points, starts, 0, len(owners), rows)
    for row in range(rows[0], rows[1]):
        first_of, ids, _ = row_candidates(points, starts, band, low, high, here, row, width)
        for column in range(width):
            begin, n = first_of[column], first_of[column + 1] - first_of[column]
            some = False
            for k in range(begin, begin + n):
                some = some or stage.modes[ids[k]] != SHOWN
            if not some:
                continue
            key = pattern_key(seed, frame, column, row)
            u0, v0 = unit(combine(key, 11), 0), unit(combine(key, 12), 0)
            for s in range(number):
                u, v = u0 + s / number, v0 + s * _GOLDEN
                x, y = column + u - np.floor(u), row + v - np.floor(v)
                piece = shown_at(points, starts, planes, owners, extent, stage.perspective, ids[begin:], n, x, y)
                if piece < 0 or stage.modes[piece] == SHOWN:
                    continue
                sum_here[:] = 0.0
                scratch, marks, active = radiance_at(
                    stage, links, planes, piece, x, y, tiny, active, scratch, marks, sum_here
                )
                for i in range(reach):
                    r = row - 2 * m + i - top
                    if r < 0 or r >= len(patch):
                        continue
                    for j in range(reach):
                        c0 = column - 2 * m + j
                        if c0 < 0 or c0 >= patch.shape[1]:
                            continue
                        w = 1.0 / number
                        if len(rules.params) > 0:
                            w *= filter_at(rules.params, x - (column - m + j + 0.5), y - (row - m + i + 0.5))
                        for c in range(3):
                            patch[r, c0, c] += w * sum_here[c]


@allocating
def radiance_at(
    stage: Stage, links: Links, planes: FloatArray, piece: int, x: float, y: float, tiny: float, active: IntArray,
    scratch: FloatArray, marks: IntArray, out: FloatArray,
) -> tuple[FloatArray, IntArray, IntArray]:  # fmt: skip
    """Add the radiance of a piece at a point of the picture to `out`; return the work arrays, longer if need be."""
    world, value = np.empty(3), np.empty(3)
    lights = len(stage.light_planes)
    coated = stage.modes[piece] == COATED
    for light in range(-1 if coated else 0, 0 if coated else lights):
        index = 0 if coated else links.parts[piece, light]
        if index < 0:
            continue
        part = links.part_corners[
            0 if coated else links.part_first[index] : 0 if coated else links.part_first[index + 1]
        ]
        place_of(stage, planes[piece, 0], x, y, world)
        here, at = 0, piece * lights + max(light, 0)
        hidden = False
        for k in range(links.pair_first[at], links.pair_first[at if coated else at + 1]):
            pair = links.pairs[k]
            away, dark = False, links.pair_dark[pair] == 1
            for p in range(links.plane_first[pair], links.plane_first[pair + 1]):
                d = (
                    links.planes[p, 0] * world[0] + links.planes[p, 1] * world[1] + links.planes[p, 2] * world[2]
                    - links.planes[p, 3]
                )  # fmt: skip
                kind = links.kinds[p]
                if kind & SEPARATES and d <= -tiny:
                    away = True
                    break
                if kind & SHADES and d < tiny:
                    dark = False
            if away:
                continue
            if dark:
                hidden = True
                break
            if here == len(active):
                more = np.empty(2 * here, np.int64)
                for k in range(here):
                    more[k] = active[k]
                active = more
            active[here] = links.pair_occluder[pair]
            here += 1
        if hidden:
            continue
        room = stack_room(active, here, links.occluder_first)
        if room > len(scratch):
            scratch, marks = np.empty((2 * room, CORNERS, 3)), np.empty((2 * room, 2), np.int64)
        shade(stage, links, planes, piece, light, part, x, y, active, here, scratch, marks, world, value)
        for c in range(3):
            out[c] += value[c]
    return scratch, marks, active


@called
def shown_at(
    points: FloatArray, starts: IntArray, planes: FloatArray, owners: IntArray, extent: float, perspective: bool,
    ids: IntArray, n: int, x: float, y: float,
) -> int:  # fmt: skip
    """Return the piece that is seen at a point, -1 for the background."""
    shown, best = -1, 0.0
    for a in range(n):
        piece = ids[a]
        inside = True
        for k in range(starts[piece], starts[piece + 1]):
            j = k + 1 if k + 1 < starts[piece + 1] else starts[piece]
            dx, dy = points[j, 0] - points[k, 0], points[j, 1] - points[k, 1]
            if dx * (y - points[k, 1]) - dy * (x - points[k, 0]) < 0.0:
                inside = False
                break
        if inside:
            near = nearness_at(planes[piece, 0], x, y)
            tie = TIE * (max(abs(near), abs(best)) if perspective else extent)
            if shown < 0 or near > best + tie or (near >= best - tie and owners[piece] > owners[shown]):
                shown, best = piece, near
    return shown
