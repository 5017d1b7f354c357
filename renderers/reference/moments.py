"""Moments of a picture over a fragment, the integrals of f x^a y^b up to a total degree, by quadrature that is exact.

A filter that is a polynomial over a cell (`expansions`) needs no more of the picture than these. x and y are measured
from the cell's centre in units of about half its size, so that powers stay near 1. Constant parts are integrals of
x^(a + 1) y^b / (a + 1) dy around them, by Gauss-Legendre of sufficient order; so are texels clipped one by one.
What is smooth takes the rules of `tiles`, with as many nodes more as the powers ask for. Rows of texels: `row_moments`.
"""

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.renderers.reference.fragments import convex_area, copy_corners, cut_convex
from aliasbench.renderers.reference.tiles import (
    MOST_CHANGE,
    MOST_EVALUATIONS,
    MOST_NODES,
    fan_quads,
    longest_sides,
    phase_rates,
    point_of,
    quarter_quad,
    relative_change,
    texel_range,
)
from aliasbench.renderers.reference.walks import cell_of, linear_at, wrap
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]


@called
def polygon_moments(
    poly: FloatArray, n: int, place: FloatArray, degree: int, rules: FloatArray, out: FloatArray
) -> None:
    """Write the moments of a polygon to `out` (degree + 1, degree + 1); place is the centre's x and y, and the unit."""
    nodes = (degree + 3) // 2
    unit = place[2]
    for a in range(degree + 1):
        for b in range(degree + 1):
            out[a, b] = 0.0
    for k in range(n):
        e = k + 1 if k + 1 < n else 0
        x0, y0 = (poly[k, 0] - place[0]) / unit, (poly[k, 1] - place[1]) / unit
        dx, dy = (poly[e, 0] - poly[k, 0]) / unit, (poly[e, 1] - poly[k, 1]) / unit
        if dy == 0.0:
            continue
        for g in range(nodes):
            s = (1.0 + rules[nodes, 0, g]) / 2
            x, y = x0 + s * dx, y0 + s * dy
            power = rules[nodes, 1, g] / 2 * dy * x * unit * unit
            for a in range(degree + 1):
                term = power / (a + 1)
                for b in range(degree + 1 - a):
                    out[a, b] += term
                    term *= y
                power *= x


@called
def add_colored(parts: FloatArray, degree: int, color: FloatArray, out: FloatArray) -> None:
    """Add moments (degree + 1, degree + 1) times a colour to `out` (degree + 1, degree + 1, 3)."""
    for a in range(degree + 1):
        for b in range(degree + 1 - a):
            for c in range(3):
                out[a, b, c] += parts[a, b] * color[c]


@called
def _add_point(x: float, y: float, place: FloatArray, degree: int, value: FloatArray, out: FloatArray) -> None:
    """Add x^a y^b times a value (3,) to `out`."""
    x, y = (x - place[0]) / place[2], (y - place[1]) / place[2]
    power = 1.0
    for a in range(degree + 1):
        term = power
        for b in range(degree + 1 - a):
            for c in range(3):
                out[a, b, c] += term * value[c]
            term *= y
        power *= x


@allocating
def clip_moments(
    poly: FloatArray, n: int, own: FloatArray, bilinear: bool, height: int, width: int, offset: int,
    texels: FloatArray, rules: FloatArray, place: FloatArray, degree: int, out: FloatArray,
) -> None:  # fmt: skip
    """Add the moments of an image over a fragment to `out` (degree + 1, degree + 1, 3); see `tiles.clip_texels`."""
    column, row = cell_of(own, poly, n)
    u, v, q = own[0] - column * own[2], own[1] - row * own[2], own[2]
    first_column, first_row = wrap(column, width), wrap(row, height)
    work = np.empty((5, n + 8, 2))
    rest, spare, strip, tile, left = work[0], work[1], work[2], work[3], work[4]
    parts = np.empty((degree + 1, degree + 1))
    size = n
    copy_corners(poly, n, rest)
    low, high = texel_range(v, q, rest, size)
    j = low
    while size > 0:
        if j < high:
            d = (j + 1.0) * q - v
            in_strip, size = cut_convex(rest, size, d[0], d[1], d[2], 0.0, 0.0, strip, spare)
            rest, spare = spare, rest
        else:
            in_strip, size = size, 0
            copy_corners(rest, in_strip, strip)
        if in_strip > 0:
            here = offset + wrap(first_row + j, height) * (width + 1)
            above = offset + wrap(first_row + j + 1.0, height) * (width + 1)
            i, last = texel_range(u, q, strip, in_strip)
            while in_strip > 0:
                if i < last:
                    d = (i + 1.0) * q - u
                    in_tile, in_strip = cut_convex(strip, in_strip, d[0], d[1], d[2], 0.0, 0.0, tile, left)
                    strip, left = left, strip
                else:
                    in_tile, in_strip = in_strip, 0
                    copy_corners(strip, in_tile, tile)
                if in_tile > 0:
                    at = wrap(first_column + i, width)
                    if bilinear:
                        _blend_moments(
                            tile, in_tile, u - i * q, v - j * q, q, here + at, above + at, texels, rules, place,
                            degree, out,
                        )  # fmt: skip
                    else:
                        polygon_moments(tile, in_tile, place, degree, rules, parts)
                        add_colored(parts, degree, texels[here + at], out)
                i += 1.0
        j += 1.0


@allocating
def _blend_moments(
    tile: FloatArray, n: int, u: FloatArray, v: FloatArray, q: FloatArray, low: int, high: int, texels: FloatArray,
    rules: FloatArray, place: FloatArray, degree: int, out: FloatArray,
) -> None:  # fmt: skip
    """Add the moments of the blend of four texels over a polygon between their centres."""
    stack = np.empty((256, 4, 2))
    quad, value = np.empty((4, 2)), np.empty(3)
    nodes = 5 + (degree + 1) // 2
    depth = fan_quads(tile, n, stack)
    while depth > 0:
        depth -= 1
        copy_corners(stack[depth], 4, quad)
        if depth + 4 <= len(stack) and relative_change(q, quad) > MOST_CHANGE:
            quarter_quad(quad, stack[depth : depth + 4])
            depth += 4
            continue
        for g in range(nodes):
            for h in range(nodes):
                x, y, area = point_of(quad, rules[nodes, 0, g], rules[nodes, 0, h])
                area *= rules[nodes, 1, g] * rules[nodes, 1, h]
                qs = linear_at(q, x, y)
                s, t = linear_at(u, x, y) / qs, linear_at(v, x, y) / qs
                for c in range(3):
                    below = texels[low, c] + s * (texels[low + 1, c] - texels[low, c])
                    above = texels[high, c] + s * (texels[high + 1, c] - texels[high, c])
                    value[c] = area * (below + t * (above - below))
                _add_point(x, y, place, degree, value, out)


@allocating
def zone_moments(
    poly: FloatArray, n: int, own: FloatArray, params: FloatArray, rules: FloatArray, place: FloatArray, degree: int,
    out: FloatArray,
) -> float:  # fmt: skip
    """Add the moments of a zone plate over a fragment to `out`; return the area given up as too fine."""
    stack = np.empty((512, 4, 2))
    quad, value = np.empty((4, 2)), np.empty(3)
    depth = fan_quads(poly, n, stack)
    lost, work = 0.0, 0
    k, phase = params[6], params[7]
    while depth > 0:
        depth -= 1
        copy_corners(stack[depth], 4, quad)
        if work > MOST_EVALUATIONS:
            lost += abs(convex_area(quad, 4))
            continue
        work += 144
        fastest, bend = phase_rates(quad, own, k)
        across, down = longest_sides(quad)
        a, b = 0.65 * fastest * across, 0.65 * fastest * down
        more = 12.0 + degree // 2
        if (
            0.8 * max(a, b) + more > MOST_NODES
            or relative_change(own[2], quad) > MOST_CHANGE
            or bend * max(across, down) ** 2 > 2.0
        ):
            if depth + 4 <= len(stack):
                quarter_quad(quad, stack[depth : depth + 4])
                depth += 4
            else:
                lost += abs(convex_area(quad, 4))
            continue
        m, o = int(0.8 * a + more), int(0.8 * b + more)
        work += m * o
        for g in range(m):
            for h in range(o):
                x, y, area = point_of(quad, rules[m, 0, g], rules[o, 0, h])
                area *= rules[m, 1, g] * rules[o, 1, h]
                q = linear_at(own[2], x, y)
                u, v = linear_at(own[0], x, y) / q, linear_at(own[1], x, y) / q
                wave = np.cos(k * (u * u + v * v) + phase)
                for c in range(3):
                    low, high = params[c], params[3 + c]
                    value[c] = area * ((low + high) / 2 + (high - low) / 2 * wave)
                _add_point(x, y, place, degree, value, out)
    return lost
