"""Pixels under lights: adaptive cubature over parts of a pixel on which radiance is analytic.

A fragment (see `fragments`) is cut along the lines where the view of a light changes its kind (`occluders`), where a
texel begins, and where the filter is not smooth, until nothing of that kind crosses a cell; then two Gauss rules of
different degree agree to many digits, and where they do not (a crossing of two occluders' edges before a light's edge
moves along a curve; near a contact irradiance only depends on the direction) the cell is halved. The difference of the
rules, which is about the error of the poorer one, counts twice towards the bound, more where edges may cross, and all
that a cell could show does where work runs out.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.renderers.reference.coverage import band_candidates, row_candidates
from aliasbench.renderers.reference.fragments import convex_area, copy_corners, split_pixel
from aliasbench.renderers.reference.irradiance import CORNERS, stack_room
from aliasbench.renderers.reference.lit_cuts import WIDEST, divide, filter_break, halve, texture_break
from aliasbench.renderers.reference.occluders import SEPARATES, SHADES, Links
from aliasbench.renderers.reference.shading import COATED, SHOWN, Stage, place_of, shade
from aliasbench.renderers.sampling.filters import filter_at
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]

_SMALL = 2e-3  # area of a pixel that may err as if it were all of it, so that small cells need not be exact
_MOST, _LEAST = 40, 16  # how many times the average number of cells a pixel may take; and what it may take at least
_SAFETY, _SAFETY_CROSSED = 2.0, 16.0  # times the difference of two rules


class Rules(NamedTuple):
    """Two cubature rules over the triangle (0, 0), (1, 0), (0, 1), weights adding up to 1, and what a filter needs.

    Attributes
    ----------
    good, poor : (n, 3) float64
        Place and weight.
    params : (k,) float64
        Of the filter; empty for the area of a pixel.
    peak : float
        Its largest value.
    margin : int
    breaks : (b,) float64
        Where between the borders of a pixel some pixel's filter is not smooth.
    target : float
        What a pixel may err by.
    cells : int
        How many cells a pixel may take on average over some rows; a few may take many times that.
    """

    good: FloatArray
    poor: FloatArray
    params: FloatArray
    peak: float
    margin: int
    breaks: FloatArray
    target: float
    cells: int


@njit(cache=True, nogil=True, error_model="numpy")
def lit_rows(
    points: FloatArray, starts: IntArray, planes: FloatArray, owners: IntArray, extent: float, tiny: float,
    stage: Stage, links: Links, rules: Rules, rows: IntArray, top: int, patch: FloatArray, doubt: FloatArray,
) -> None:  # fmt: skip
    """Add what pixels of rows [rows[0], rows[1]) of the wide picture show of pieces that need light or texture.

    `extent` is the scene's size, for ties of depth; what is nearer to a plane than `tiny` is in it.
    `patch` (h, w, 3) and `doubt` (h, w), a bound on its error, hold rows of the narrow picture from row `top` on.
    """
    m = rules.margin
    width = patch.shape[1] + 2 * m
    polys, sizes, shown = np.empty((16, 16, 2)), np.empty(16, np.int64), np.empty(16, np.int64)
    reach = 2 * m + 1
    good, poor = np.empty((reach, reach, 3)), np.empty((reach, reach, 3))
    total, error = np.empty((reach, reach, 3)), np.empty((reach, reach))
    lights = len(stage.light_planes)
    pool = rules.cells * width * (rows[1] - rows[0])
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
            while True:
                fragments = split_pixel(
                    points, starts, planes, owners, stage.perspective, extent, ids[begin:], n, float(column),
                    float(row), column + 1.0, row + 1.0, polys, sizes, shown,
                )  # fmt: skip
                if fragments >= 0:
                    break
                polys = np.empty((2 * polys.shape[0], 2 * polys.shape[1], 2))
                sizes, shown = np.empty(polys.shape[0], np.int64), np.empty(polys.shape[0], np.int64)
            total[:] = 0.0
            error[:] = 0.0
            left = min(_MOST * rules.cells, max(pool, _LEAST))
            pool -= left
            for f in range(fragments):
                if sizes[f] < 3 or shown[f] < 0 or stage.modes[shown[f]] == SHOWN:
                    continue
                coated = stage.modes[shown[f]] == COATED
                for light in range(-1 if coated else 0, 0 if coated else lights):
                    if coated or links.parts[shown[f], light] >= 0:
                        left = _integrate(
                            polys[f], sizes[f], shown[f], light, planes, tiny, stage, links, rules, row, column,
                            left, good, poor, total, error,
                        )  # fmt: skip
            pool += max(left, 0)
            for i in range(reach):
                r = row - 2 * m + i - top
                if r < 0 or r >= len(patch):
                    continue
                for j in range(reach):
                    s = column - 2 * m + j
                    if s < 0 or s >= patch.shape[1]:
                        continue
                    for c in range(3):
                        patch[r, s, c] += total[i, j, c]
                    doubt[r, s] += error[i, j]


@allocating
def _integrate(
    fragment: FloatArray, size: int, piece: int, light: int, planes: FloatArray, tiny: float, stage: Stage,
    links: Links, rules: Rules, row: int, column: int, left: int, good: FloatArray, poor: FloatArray,
    total: FloatArray, error: FloatArray,
) -> int:  # fmt: skip
    """Add the integral over a fragment for one light (-1: of the bare texture); return how many cells are left."""
    cells = np.empty((32, WIDEST, 2))
    shape = np.empty((32, 3), np.int64)  # corners, and which part of `lists` holds what may be in the way
    lists, count = _candidates(links, piece, light, len(stage.light_planes))
    # a fragment of very many corners is a fan of triangles
    whole = size <= WIDEST - 2
    poly = np.empty((WIDEST, 2))
    for k in range(1, 2 if whole else size - 1):
        for v in range(size if whole else 3):
            at = v if whole or v == 0 else k + v - 1
            poly[v, 0], poly[v, 1] = fragment[at, 0], fragment[at, 1]
        corners = size if whole else min(size, 3)
        left = _integrate_cells(
            poly, corners, piece, light, planes, tiny, stage, links, rules, row, column,
            left, good, poor, total, error, cells, shape, lists, count,
        )  # fmt: skip
    return left


@allocating
def _candidates(links: Links, piece: int, light: int, lights: int) -> tuple[IntArray, int]:
    """Return the pairs that may be in a piece's light, with room for more, and their number."""
    at = piece * lights + max(light, 0)
    begin, end = links.pair_first[at], links.pair_first[at]
    if light >= 0:
        end = links.pair_first[at + 1]
    out = np.empty(64 + end - begin, np.int64)
    for k in range(begin, end):
        out[k - begin] = links.pairs[k]
    return out, end - begin


@allocating
def _integrate_cells(
    fragment: FloatArray, size: int, piece: int, light: int, planes: FloatArray, tiny: float, stage: Stage,
    links: Links, rules: Rules, row: int, column: int, left: int, good: FloatArray, poor: FloatArray,
    total: FloatArray, error: FloatArray, cells: FloatArray, shape: IntArray, lists: IntArray, count: int,
) -> int:  # fmt: skip
    copy_corners(fragment, size, cells[0])
    shape[0, 0], shape[0, 1], shape[0, 2] = size, 0, count
    top = 1
    poly, values, best = np.empty((WIDEST, 2)), np.empty(WIDEST), np.empty(WIDEST)
    world, q = np.empty((WIDEST, 3)), np.empty(WIDEST)
    stack, marks = np.empty((16, CORNERS, 3)), np.empty((16, 2), np.int64)
    active = np.empty(0, np.int64)
    obj = stage.objects[piece]
    largest = 0.0
    for c in range(3):
        shine = stage.radiance[light, c] if light >= 0 else 1.0
        largest = max(largest, abs(stage.colors[obj, c]) * stage.brightest[obj] * abs(shine))
    part = links.part_corners[0:0]
    if light >= 0:
        index = links.parts[piece, light]
        part = links.part_corners[links.part_first[index] : links.part_first[index + 1]]
    while top > 0:
        top -= 1
        n, begin, listed = shape[top, 0], shape[top, 1], shape[top, 2]
        copy_corners(cells[top], n, poly)
        area = convex_area(poly, n)
        if not area > 0.0:
            continue
        left -= 1
        peak = min(1.0, rules.peak)
        if left <= 0 or largest * area * peak < 1e-5 * _SMALL * rules.target:
            # all that it may show
            for i in range(total.shape[0]):
                for j in range(total.shape[1]):
                    error[i, j] += largest * area * rules.peak
            continue
        crossing = filter_break(poly, n, rules.breaks, row, column, best)
        here = 0
        end = begin + listed
        if light >= 0:
            lowest, highest = np.inf, -np.inf
            lp = stage.light_planes[light]
            for k in range(n):
                q[k] = place_of(stage, planes[piece, 0], poly[k, 0], poly[k, 1], world[k])
                d = lp[0] * world[k, 0] + lp[1] * world[k, 1] + lp[2] * world[k, 2] - lp[3]
                values[k] = d * q[k]
                lowest, highest = min(lowest, d), max(highest, d)
            if highest <= tiny:
                continue
            if not crossing and lowest < -tiny:
                crossing = True
                for k in range(n):
                    best[k] = values[k]
            if not crossing:
                while end + listed > len(lists):
                    lists = _longer(lists)
                here, crossing = _watch(world, q, n, tiny, links, lists, begin, listed, end, values, best)
                if here < 0:
                    continue
                begin = end
                listed = here
        if not crossing and stage.kinds[obj] >= 0:
            crossing = texture_break(stage, planes[piece], obj, poly, n, best)
        if top + 2 > len(cells):
            cells, shape = _more_cells(cells), _more_shape(shape)
        if crossing:
            top = divide(poly, n, best, begin, listed, cells, shape, top)
            continue
        if here > 0:
            if here > len(active):
                active = np.empty(2 * here, np.int64)
            for k in range(here):
                active[k] = links.pair_occluder[lists[begin + k]]
            room = stack_room(active, here, links.occluder_first)
            if room > len(stack):
                stack, marks = np.empty((2 * room, CORNERS, 3)), np.empty((2 * room, 2), np.int64)
        _apply(rules.poor, poly, n, piece, light, part, planes, stage, links, rules, row, column, active, here, stack,
               marks, poor)  # fmt: skip
        _apply(rules.good, poly, n, piece, light, part, planes, stage, links, rules, row, column, active, here, stack,
               marks, good)  # fmt: skip
        # where two occluders' edges cross, what is seen changes its kind along a curve that nothing was cut by
        safety = _SAFETY_CROSSED if here > 1 else _SAFETY
        off = 0.0
        for i in range(total.shape[0]):
            for j in range(total.shape[1]):
                for c in range(3):
                    off = max(off, safety * abs(good[i, j, c] - poor[i, j, c]))
        if off <= rules.target * (area + _SMALL) or left < top:
            for i in range(total.shape[0]):
                for j in range(total.shape[1]):
                    worst = 0.0
                    for c in range(3):
                        total[i, j, c] += good[i, j, c]
                        worst = max(worst, safety * abs(good[i, j, c] - poor[i, j, c]))
                    error[i, j] += worst
            continue
        halve(poly, n, best)
        top = divide(poly, n, best, begin, listed, cells, shape, top)
    return left


@called
def _watch(
    world: FloatArray, q: FloatArray, n: int, tiny: float, links: Links, lists: IntArray, begin: int, listed: int,
    end: int, values: FloatArray, best: FloatArray,
) -> tuple[int, bool]:  # fmt: skip
    """Write from `end` on the pairs that may hide something from a cell, and into `best` a plane to cut it by.

    Returns their number, -1 if the cell sees nothing of the light, and whether there is a plane that crosses it.
    """
    here, most, crossing = 0, 0.0, False
    for k in range(begin, begin + listed):
        pair = lists[k]
        away, dark, middle, chosen = False, links.pair_dark[pair] == 1, 0.0, -1
        for p in range(links.plane_first[pair], links.plane_first[pair + 1]):
            lowest, highest = np.inf, -np.inf
            for v in range(n):
                d = (
                    links.planes[p, 0] * world[v, 0] + links.planes[p, 1] * world[v, 1]
                    + links.planes[p, 2] * world[v, 2] - links.planes[p, 3]
                )  # fmt: skip
                lowest, highest = min(lowest, d), max(highest, d)
            kind = links.kinds[p]
            if kind & SEPARATES and highest <= tiny:
                away = True
                break
            if kind & SHADES and lowest < -tiny:
                dark = False
            if lowest < -tiny and highest > tiny and min(-lowest, highest) > middle:
                middle, chosen = min(-lowest, highest), p
        if away:
            continue
        if dark:
            return -1, False
        lists[end + here] = pair
        here += 1
        if chosen >= 0 and middle > most:
            most, crossing = middle, True
            for v in range(n):
                values[v] = (
                    links.planes[chosen, 0] * world[v, 0] + links.planes[chosen, 1] * world[v, 1]
                    + links.planes[chosen, 2] * world[v, 2] - links.planes[chosen, 3]
                )  # fmt: skip
                best[v] = values[v] * q[v]
    return here, crossing


@allocating
def _apply(
    rule: FloatArray, poly: FloatArray, n: int, piece: int, light: int, part: FloatArray, planes: FloatArray,
    stage: Stage, links: Links, rules: Rules, row: int, column: int, active: IntArray, here: int, stack: FloatArray,
    marks: IntArray, out: FloatArray,
) -> None:  # fmt: skip
    """Fill `out` with the integral over a cell by one rule, for every pixel whose filter reaches it."""
    reach = out.shape[0]
    out[:] = 0.0
    world, value = np.empty(3), np.empty(3)
    for t in range(1, n - 1):
        ax, ay = poly[t, 0] - poly[0, 0], poly[t, 1] - poly[0, 1]
        bx, by = poly[t + 1, 0] - poly[0, 0], poly[t + 1, 1] - poly[0, 1]
        area = (ax * by - bx * ay) / 2
        if not area > 0.0:
            continue
        for k in range(len(rule)):
            x = poly[0, 0] + rule[k, 0] * ax + rule[k, 1] * bx
            y = poly[0, 1] + rule[k, 0] * ay + rule[k, 1] * by
            shade(stage, links, planes, piece, light, part, x, y, active, here, stack, marks, world, value)
            weight = rule[k, 2] * area
            if len(rules.params) == 0:
                for c in range(3):
                    out[0, 0, c] += weight * value[c]
                continue
            for i in range(reach):
                for j in range(reach):
                    # the narrow pixel (row - 2 m + i) has its centre m + .5 further on in the wide picture
                    w = weight * filter_at(
                        rules.params, x - (column - rules.margin + j + 0.5), y - (row - rules.margin + i + 0.5)
                    )
                    for c in range(3):
                        out[i, j, c] += w * value[c]


@allocating
def _more_cells(cells: FloatArray) -> FloatArray:
    out = np.empty((2 * len(cells), cells.shape[1], 2))
    for k in range(len(cells)):
        copy_corners(cells[k], cells.shape[1], out[k])
    return out


@allocating
def _more_shape(shape: IntArray) -> IntArray:
    out = np.empty((2 * len(shape), 3), np.int64)
    for k in range(len(shape)):
        for c in range(3):
            out[k, c] = shape[k, c]
    return out


@allocating
def _longer(ids: IntArray) -> IntArray:
    out = np.empty(2 * len(ids), np.int64)
    for k in range(len(ids)):
        out[k] = ids[k]
    return out
