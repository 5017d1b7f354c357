"""Exact integrals of textures over a fragment, by Green's theorem: the sum of primitives along its edges.

Let t be a direction in the picture along which q (1 / depth, or 1) and v do not change: the rows of the texture, seen
from wherever the rows are parallel to the horizon, and always under an orthographic camera. Along t the texture is one
row of texels, and u grows evenly, so F = (q / u_t) P_row(u), with P the running sum of the row's texels, has dF/dt = f
whatever lies between: thousands of texels cost as much as one. The integral over the fragment is that of F ds around
it, s across t; between two crossings of a texel's border, F is linear along an edge and the midpoint is exact. A
bilinear blend is the same with smooth pieces, a sine wave has a sine for its primitive.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]

TEXELS, BLEND, ROWS = 0, 1, 2

# Gauss-Legendre on [-1, 1]. A blend is cubic over q squared. With q changing by at most 1 / 64 it is analytic within an
# ellipse of sum of axes 256, where a coordinate of [0, 1] is below 128: four nodes leave 128^3 256^-8 < 1e-12.
_BLEND_NODES, _BLEND_WEIGHTS = (np.array(v) for v in np.polynomial.legendre.leggauss(4))
BLEND_CHANGE = 1.0 / 64.0
# half a cycle to a panel: (e A / 4 n)^(2 n) < 1e-19 with A = pi / 2 and n = 10
_WAVE_NODES, _WAVE_WEIGHTS = (np.array(v) for v in np.polynomial.legendre.leggauss(10))
MOST_PANELS = 100_000


@called
def linear_at(row: FloatArray, x: float, y: float) -> float:
    return row[0] * x + row[1] * y + row[2]


@called
def cell_of(own: FloatArray, poly: FloatArray, n: int) -> tuple[float, float]:
    """Return the texel (column, row) under the middle of a fragment; numbers are kept small by counting from it."""
    x, y = 0.0, 0.0
    for k in range(n):
        x += poly[k, 0] / n
        y += poly[k, 1] / n
    q = linear_at(own[2], x, y)
    return np.floor(linear_at(own[0], x, y) / q), np.floor(linear_at(own[1], x, y) / q)


@called
def wrap(index: float, period: int) -> int:
    """Return a whole number, however large, modulo the period."""
    return int(index - np.floor(index / period) * period) % period


@called
def next_crossing(start: float, change: float, q0: float, dq: float, level: float) -> float:
    """Return the share of an edge at which (start + s change) / (q0 + s dq) is at a level."""
    slope = change - level * dq
    return (level * q0 - start) / slope if slope != 0.0 else np.inf


@njit(cache=True, nogil=True, error_model="numpy")
def walk_texels(
    poly: FloatArray, n: int, own: FloatArray, tx: float, ty: float, mode: int, height: int, width: int, offset: int,
    texels: FloatArray, sums: FloatArray, value: FloatArray,
) -> None:  # fmt: skip
    """Add the integral of an image over a fragment to `value` (3,).

    Parameters
    ----------
    own : (3, 3)
        Coefficients (of x, y and 1) of u q, v q and q, u and v in texels (from their centres where bilinear).
    tx, ty
        Unit vector along which v and q do not change.
    mode : int
        TEXELS: constant squares; BLEND: bilinear between centres; ROWS: linear along rows, which stay apart.
    texels, sums : (k, 3)
        Rows of width + 1 from `offset` on; the last of each row is the first of the next period, and its total.
    """
    column, row = cell_of(own, poly, n)
    u = own[0] - column * own[2]
    v = own[1] - row * own[2]
    q = own[2]
    slope = u[0] * tx + u[1] * ty
    first_column, first_row = wrap(column, width), wrap(row, height)
    for k in range(n):
        e = k + 1 if k + 1 < n else 0
        ax, ay, bx, by = poly[k, 0], poly[k, 1], poly[e, 0], poly[e, 1]
        ds = tx * (by - ay) - ty * (bx - ax)
        if ds == 0.0:
            continue
        q0, q1 = linear_at(q, ax, ay), linear_at(q, bx, by)
        u0, u1, v0, v1 = linear_at(u, ax, ay), linear_at(u, bx, by), linear_at(v, ax, ay), linear_at(v, bx, by)
        du, dv, dq = u1 - u0, v1 - v0, q1 - q0
        i, j, last_i, last_j = np.floor(u0 / q0), np.floor(v0 / q0), np.floor(u1 / q1), np.floor(v1 / q1)
        up_i, up_j = (1.0 if last_i > i else 0.0), (1.0 if last_j > j else 0.0)
        next_u = next_crossing(u0, du, q0, dq, i + up_i) if i != last_i else np.inf
        next_v = next_crossing(v0, dv, q0, dq, j + up_j) if j != last_j else np.inf
        at = 0.0
        while True:
            to = max(at, min(next_u, next_v, 1.0))
            if to > at:
                in_row = first_column + i
                periods = np.floor(in_row / width)
                here = offset + wrap(first_row + j, height) * (width + 1)
                i_here = here + int(in_row - periods * width)
                weight = ds * (to - at) / slope
                if mode == TEXELS:
                    middle = (at + to) / 2
                    qm = q0 + middle * dq
                    into = u0 + middle * du - i * qm
                    for c in range(3):
                        total = periods * sums[here + width, c] + sums[i_here, c]
                        value[c] += weight * (qm * total + into * texels[i_here, c])
                else:
                    above = here
                    if mode == BLEND:
                        above = offset + wrap(first_row + j + 1.0, height) * (width + 1)
                    _add_blend(
                        at, to, u0 - i * q0, du - i * dq, v0 - j * q0, dv - j * dq, q0, dq, weight, periods,
                        here, i_here, above, width, texels, sums, value,
                    )  # fmt: skip
            at = to
            if at >= 1.0:
                break
            if next_u <= next_v:
                i += 2.0 * up_i - 1.0
                next_u = next_crossing(u0, du, q0, dq, i + up_i) if i != last_i else np.inf
            else:
                j += 2.0 * up_j - 1.0
                next_v = next_crossing(v0, dv, q0, dq, j + up_j) if j != last_j else np.inf


@called
def _add_blend(
    at: float, to: float, u0: float, du: float, v0: float, dv: float, q0: float, dq: float, weight: float,
    periods: float, low: int, i_low: int, high: int, width: int, texels: FloatArray, sums: FloatArray,
    value: FloatArray,
) -> None:  # fmt: skip
    """Add the primitive of a bilinear blend along a part of an edge that stays between four texels' centres."""
    i_high = high + i_low - low
    change = abs(dq) * (to - at) / min(q0 + at * dq, q0 + to * dq)
    panels = 1 + int(change / BLEND_CHANGE)
    for panel in range(panels):
        for g in range(len(_BLEND_NODES)):
            s = at + (to - at) * (panel + (1.0 + _BLEND_NODES[g]) / 2) / panels
            q = q0 + s * dq
            x, y = (u0 + s * du) / q, (v0 + s * dv) / q
            share = weight * _BLEND_WEIGHTS[g] / 2 / panels * q
            for c in range(3):
                below = periods * sums[low + width, c] + sums[i_low, c]
                above = periods * sums[high + width, c] + sums[i_high, c]
                below += x * (texels[i_low, c] + (texels[i_low + 1, c] - texels[i_low, c]) * x / 2)
                above += x * (texels[i_high, c] + (texels[i_high + 1, c] - texels[i_high, c]) * x / 2)
                value[c] += share * (below + y * (above - below))


@allocating
def walk_wave(poly: FloatArray, n: int, own: FloatArray, tx: float, ty: float) -> float:
    """Return the integral of cos(2 pi u) over a fragment; q does not change along (tx, ty).

    From a fixed t the primitive is (t - t') cos(pi (u + u')) sinc(u - u'), which is good for any slope, none too.
    """
    column, _ = cell_of(own, poly, n)
    u = own[0] - column * own[2]
    q = own[2]
    slope = u[0] * tx + u[1] * ty
    base = tx * poly[0, 0] + ty * poly[0, 1]
    total = 0.0
    for k in range(n):
        e = k + 1 if k + 1 < n else 0
        ax, ay, bx, by = poly[k, 0], poly[k, 1], poly[e, 0], poly[e, 1]
        ds = tx * (by - ay) - ty * (bx - ax)
        if ds == 0.0:
            continue
        q0, q1 = linear_at(q, ax, ay), linear_at(q, bx, by)
        u0, u1 = linear_at(u, ax, ay), linear_at(u, bx, by)
        t0, t1 = tx * ax + ty * ay - base, tx * bx + ty * by - base
        w0, w1 = u0 - slope * t0, u1 - slope * t1
        least = min(q0, q1)
        fastest = max(abs(u1 * q0 - u0 * q1), abs(w1 * q0 - w0 * q1)) / least**2
        panels = 1 + int(min(max(2.0 * fastest, 8.0 * abs(q1 - q0) / least), 1.0 * MOST_PANELS))
        for panel in range(panels):
            for g in range(len(_WAVE_NODES)):
                s = (panel + (1.0 + _WAVE_NODES[g]) / 2) / panels
                qs = q0 + s * (q1 - q0)
                us, ws, ts = (u0 + s * (u1 - u0)) / qs, (w0 + s * (w1 - w0)) / qs, t0 + s * (t1 - t0)
                x = np.pi * (us - ws)
                sinc = np.sin(x) / x if abs(x) > 1e-4 else 1.0 - x * x / 6
                total += ds * _WAVE_WEIGHTS[g] / 2 / panels * ts * np.cos(np.pi * (us + ws)) * sinc
    return total
