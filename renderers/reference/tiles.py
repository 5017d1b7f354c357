"""Integrals of textures over a fragment where no direction in the picture keeps a row of texels: seen at a slant.

Constant squares are clipped one by one and their areas are exact; the price is one clip for each texel in the picture.
What is smooth (a blend within one tile, a zone plate) is integrated by Gauss-Legendre over quadrilaterals, with as many
nodes as its phase asks for: e^(iAx) over [-1, 1] is off by (e A / 4 n)^(2 n), and n = .8 A + 12 leaves 1e-15.
"""

from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.renderers.reference.fragments import convex_area, copy_corners, cut_convex
from aliasbench.renderers.reference.walks import cell_of, linear_at, wrap
from aliasbench.scenes.model import FloatArray, read_only

IntArray = NDArray[np.int64]

MOST_NODES = 64
MOST_EVALUATIONS = 400_000  # of a fragment of a zone plate: about seventy cycles to a pixel, each way
_TILE_NODES = 5
MOST_CHANGE = 1.0 / 16.0  # of q within one rule: what is left of 1 / q is under 66^-10


@lru_cache(maxsize=1)
def gauss_table() -> FloatArray:
    """Return nodes and weights on [-1, 1] of all orders up to MOST_NODES, (order + 1, 2, MOST_NODES)."""
    table = np.zeros((MOST_NODES + 1, 2, MOST_NODES))
    for n in range(1, MOST_NODES + 1):
        table[n, 0, :n], table[n, 1, :n] = np.polynomial.legendre.leggauss(n)
    return read_only(table)


@njit(cache=True, nogil=True, error_model="numpy")
def clip_texels(
    poly: FloatArray, n: int, own: FloatArray, bilinear: bool, height: int, width: int, offset: int,
    texels: FloatArray, rules: FloatArray, value: FloatArray,
) -> None:  # fmt: skip
    """Add the integral of an image over a fragment to `value` (3,); parameters as in `walks.walk_texels`."""
    column, row = cell_of(own, poly, n)
    u, v, q = own[0] - column * own[2], own[1] - row * own[2], own[2]
    first_column, first_row = wrap(column, width), wrap(row, height)
    work = np.empty((5, n + 8, 2))
    rest, spare, strip, tile, left = work[0], work[1], work[2], work[3], work[4]
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
                        _blend_tile(tile, in_tile, u - i * q, v - j * q, q, here + at, above + at, texels, rules, value)
                    else:
                        area = convex_area(tile, in_tile)
                        for c in range(3):
                            value[c] += area * texels[here + at, c]
                i += 1.0
        j += 1.0


@called
def texel_range(u: FloatArray, q: FloatArray, poly: FloatArray, n: int) -> tuple[float, float]:
    """Return the first and last whole number below u / q over a polygon."""
    low, high = np.inf, -np.inf
    for k in range(n):
        value = linear_at(u, poly[k, 0], poly[k, 1]) / linear_at(q, poly[k, 0], poly[k, 1])
        low, high = min(low, value), max(high, value)
    return np.floor(low), np.floor(high)


@allocating
def _blend_tile(
    tile: FloatArray, n: int, u: FloatArray, v: FloatArray, q: FloatArray, low: int, high: int, texels: FloatArray,
    rules: FloatArray, value: FloatArray,
) -> None:  # fmt: skip
    """Add the integral of the blend of four texels over a polygon between their centres."""
    stack = np.empty((256, 4, 2))
    quad = np.empty((4, 2))
    depth = fan_quads(tile, n, stack)
    while depth > 0:
        depth -= 1
        copy_corners(stack[depth], 4, quad)
        if depth + 4 <= len(stack) and relative_change(q, quad) > MOST_CHANGE:
            quarter_quad(quad, stack[depth : depth + 4])
            depth += 4
            continue
        for g in range(_TILE_NODES):
            for h in range(_TILE_NODES):
                x, y, area = point_of(quad, rules[_TILE_NODES, 0, g], rules[_TILE_NODES, 0, h])
                area *= rules[_TILE_NODES, 1, g] * rules[_TILE_NODES, 1, h]
                qs = linear_at(q, x, y)
                s, t = linear_at(u, x, y) / qs, linear_at(v, x, y) / qs
                for c in range(3):
                    below = texels[low, c] + s * (texels[low + 1, c] - texels[low, c])
                    above = texels[high, c] + s * (texels[high + 1, c] - texels[high, c])
                    value[c] += area * (below + t * (above - below))


@allocating
def integrate_zone(
    poly: FloatArray, n: int, own: FloatArray, k: float, phase: float, rules: FloatArray,
) -> tuple[float, float]:  # fmt: skip
    """Return the integral of cos(k (u^2 + v^2) + phase) over a fragment, and the area given up as too fine."""
    stack = np.empty((512, 4, 2))
    quad = np.empty((4, 2))
    depth = fan_quads(poly, n, stack)
    total, lost, work = 0.0, 0.0, 0
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
        nodes = 0.8 * max(a, b) + 12.0
        if nodes > MOST_NODES or relative_change(own[2], quad) > MOST_CHANGE or bend * max(across, down) ** 2 > 2.0:
            if depth + 4 <= len(stack):
                quarter_quad(quad, stack[depth : depth + 4])
                depth += 4
            else:
                lost += abs(convex_area(quad, 4))
            continue
        m, o = int(0.8 * a + 12.0), int(0.8 * b + 12.0)
        work += m * o
        for g in range(m):
            for h in range(o):
                x, y, area = point_of(quad, rules[m, 0, g], rules[o, 0, h])
                q = linear_at(own[2], x, y)
                u, v = linear_at(own[0], x, y) / q, linear_at(own[1], x, y) / q
                total += rules[m, 1, g] * rules[o, 1, h] * area * np.cos(k * (u * u + v * v) + phase)
    return total, lost


@called
def phase_rates(quad: FloatArray, own: FloatArray, k: float) -> tuple[float, float]:
    """Return the largest gradient of the phase, and how fast it changes, per pixel."""
    fastest, bend = 0.0, 0.0
    for c in range(4):
        x, y = quad[c, 0], quad[c, 1]
        q = linear_at(own[2], x, y)
        u, v = linear_at(own[0], x, y) / q, linear_at(own[1], x, y) / q
        ux, uy = (own[0, 0] - u * own[2, 0]) / q, (own[0, 1] - u * own[2, 1]) / q
        vx, vy = (own[1, 0] - v * own[2, 0]) / q, (own[1, 1] - v * own[2, 1]) / q
        fastest = max(fastest, 2 * abs(k) * np.hypot(u * ux + v * vx, u * uy + v * vy))
        bend = max(bend, abs(k) * (ux * ux + uy * uy + vx * vx + vy * vy))
    return fastest, bend


@called
def fan_quads(poly: FloatArray, n: int, stack: FloatArray) -> int:
    """Write a convex polygon as quadrilaterals, the last of them perhaps a triangle."""
    count = 0
    for k in range(1, n - 1, 2):
        last = k + 2 if k + 2 < n else k + 1
        for c in range(2):
            stack[count, 0, c], stack[count, 1, c] = poly[0, c], poly[k, c]
            stack[count, 2, c], stack[count, 3, c] = poly[k + 1, c], poly[last, c]
        count += 1
    return count


@called
def point_of(quad: FloatArray, g: float, h: float) -> tuple[float, float, float]:
    """Return a point of a quadrilateral and the Jacobian there, of g and h in [-1, 1]."""
    s, t = (1.0 + g) / 2, (1.0 + h) / 2
    ax, ay = quad[1, 0] - quad[0, 0], quad[1, 1] - quad[0, 1]
    bx, by = quad[3, 0] - quad[0, 0], quad[3, 1] - quad[0, 1]
    cx, cy = quad[2, 0] - quad[1, 0] - bx, quad[2, 1] - quad[1, 1] - by
    jacobian = (ax + t * cx) * (by + s * cy) - (ay + t * cy) * (bx + s * cx)
    return (
        quad[0, 0] + s * ax + t * bx + s * t * cx,
        quad[0, 1] + s * ay + t * by + s * t * cy,
        jacobian / 4,
    )


@allocating
def quarter_quad(quad: FloatArray, out: FloatArray) -> None:
    """Write the four parts of a quadrilateral, cut through the middles of its sides."""
    grid = np.empty((3, 3, 2))
    for a in range(3):
        for b in range(3):
            grid[a, b, 0], grid[a, b, 1], _ = point_of(quad, a - 1.0, b - 1.0)
    for p in range(4):
        a, b = p % 2, p // 2
        for c in range(2):
            out[p, 0, c], out[p, 1, c] = grid[a, b, c], grid[a + 1, b, c]
            out[p, 2, c], out[p, 3, c] = grid[a + 1, b + 1, c], grid[a, b + 1, c]


@called
def relative_change(q: FloatArray, quad: FloatArray) -> float:
    """Return by which share of its least value q changes over a quadrilateral."""
    low, high = np.inf, -np.inf
    for k in range(4):
        value = linear_at(q, quad[k, 0], quad[k, 1])
        low, high = min(low, value), max(high, value)
    return (high - low) / low if low > 0.0 else np.inf


@allocating
def longest_sides(quad: FloatArray) -> tuple[float, float]:
    """Return the length of the longer of the first and third side, and of the second and fourth."""
    lengths = np.empty(4)
    for k in range(4):
        j = (k + 1) % 4
        lengths[k] = np.hypot(quad[k, 0] - quad[j, 0], quad[k, 1] - quad[j, 1])
    return max(lengths[0], lengths[2]), max(lengths[1], lengths[3])
