"""Everything that moves turns about one point of the picture: the open shutter in closed form.

Time comes first. At a distance r from the hub the pattern c(r, u) is a set of arcs that end where the circle meets an
edge, at foot angle +- acos(h / r). Its mean over a turn by S, C(r, theta) = int_0^S c(r, theta - s) ds / S, is
piecewise linear in theta, so that F = int C dtheta is known for any number of turns: with the mean m(r) over the circle
and a jump J at every arc's end a,

    F(r, theta) = m theta - (2 pi)^2 / (6 S) sum_a J [B3((theta - a) / 2 pi) - B3((theta - S - a) / 2 pi)],

B3 the periodic Bernoulli polynomial. By Green's theorem a pixel's integral is then - int F r dr round its sides: one
dimension is left, and each side serves two pixels. F is analytic along a side between the circles on which something
happens (a corner of the pattern, the foot of an edge) and the places where the side meets the pattern as the shutter
opens and closes. There Gauss-Legendre rules of 7 and 4 points are compared, and pieces are halved until they agree;
the difference, far larger than the error of the better rule, is the bound.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.renderers.reference.turning import Rotor
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]

_TOLERANCE = 1e-11  # of a piece of a side, and no less than this share of what rounding costs a pixel
_ROUNDING_SHARE = 1 / 256
_DEEPEST = 48
_X7, _W7 = (np.ascontiguousarray(a) for a in np.polynomial.legendre.leggauss(7))
_X4, _W4 = (np.ascontiguousarray(a) for a in np.polynomial.legendre.leggauss(4))
_PI = 3.141592653589793
_EPS = 2.220446049250313e-16


@njit(cache=True, nogil=True, error_model="numpy")
def integrate_row(
    edges: FloatArray, jumps: FloatArray, radii: FloatArray, sweep: float, hub: FloatArray, row: int, width: int,
    tolerance: float, across: FloatArray, down: FloatArray, cut: FloatArray, slack: FloatArray,
) -> None:  # fmt: skip
    """Integrate F r dr along the sides of one row of pixels.

    Parameters
    ----------
    edges, jumps, radii, sweep, hub
        Of `Rotor`.
    row, width : int
        The row; pixels in it.
    tolerance : float
        Pieces of sides are halved until two rules agree to it.
    across : (width, c)
        Filled: the upper sides, from left to right.
    down : (width + 1, c)
        Filled: the upright sides, from bottom to top.
    cut : (width, c)
        Filled in the hub's row: 2 pi int m r dr where the pixel meets the ray theta = pi.
    slack : (3, width + 1)
        Filled: bounds on the errors of the three.
    """
    work = np.empty((2, jumps.shape[1]))
    y = hub[1] - row + 0.0
    for j in range(width):
        x = j - hub[0]
        slack[0, j] = _integrate(edges, jumps, radii, sweep, 0, y, x, x + 1.0, tolerance, work, across[j])
    for j in range(width + 1):
        slack[1, j] = _integrate(edges, jumps, radii, sweep, 1, j - hub[0], y - 1.0, y, tolerance, work, down[j])
    if y >= 0.0 and y - 1.0 < 0.0:
        for j in range(width):
            low, high = max(hub[0] - j - 1.0, 0.0), hub[0] - j
            if high > low:
                slack[2, j] = _integrate(edges, jumps, radii, sweep, 2, 0.0, low, high, tolerance, work, cut[j])


@allocating
def _integrate(
    edges: FloatArray, jumps: FloatArray, radii: FloatArray, sweep: float, kind: int, distance: float, low: float,
    high: float, tolerance: float, work: FloatArray, out: FloatArray,
) -> float:  # fmt: skip
    """Fill the integral of F r dr along a side; return a bound on its error.

    `kind`: 0 a level side at height `distance`, 1 an upright one, 2 the ray on which F jumps, with 2 pi m for F.
    """
    channels = jumps.shape[1]
    nearest = 0.0 if low < 0.0 < high else min(abs(low), abs(high))
    furthest = max(abs(low), abs(high))
    inner, outer = np.sqrt(nearest * nearest + distance * distance), np.sqrt(furthest * furthest + distance * distance)
    # beyond the pattern there is nothing
    if inner >= radii[-1]:
        return 0.0
    base = np.zeros(channels)
    active = np.empty(len(edges), np.int64)
    count = 0
    for e in range(len(edges)):
        if edges[e, 6] <= inner:
            continue
        if edges[e, 5] >= outer:
            for c in range(channels):
                base[c] += jumps[e, c] * edges[e, 4]
            continue
        active[count] = e
        count += 1
    nothing = count == 0
    for c in range(channels):
        nothing = nothing and base[c] == 0.0
    if nothing:
        return 0.0
    knots = np.empty(3 + 2 * len(radii) + 2 * count)
    n = 0
    knots[n] = low
    n += 1
    if low < 0.0 < high:
        knots[n] = 0.0
        n += 1
    for k in range(len(radii)):
        if inner < radii[k] < outer:
            s = np.sqrt((radii[k] - distance) * (radii[k] + distance))
            for at in (-s, s):
                if low < at < high:
                    knots[n] = at
                    n += 1
    if kind < 2:
        for a in range(count):
            for turn in (0.0, sweep):
                # x cos + y sin = h along the side
                h, foot = edges[active[a], 0], edges[active[a], 1] + turn
                cos, sin = np.cos(foot), np.sin(foot)
                fixed, along = (sin, cos) if kind == 0 else (cos, sin)
                if along != 0.0:
                    at = (h - fixed * distance) / along
                    if low < at < high:
                        knots[n] = at
                        n += 1
    knots[n] = high
    n += 1
    _sort(knots, n)
    slack = 0.0
    ends, depths = np.empty((_DEEPEST + 2, 2)), np.empty(_DEEPEST + 2, np.int64)
    for k in range(1, n):
        # nothing happens on a piece too short to hold a number
        if not knots[k] - knots[k - 1] > 4.0 * _EPS * outer:
            continue
        ends[0, 0], ends[0, 1] = knots[k - 1], knots[k]
        depths[0] = 0
        top = 1
        while top > 0:
            top -= 1
            a, b, depth = ends[top, 0], ends[top, 1], depths[top]
            work[:] = 0.0
            half, middle = (b - a) / 2, (a + b) / 2
            for q in range(7):
                s = middle + half * _X7[q]
                _add_value(edges, jumps, active, count, base, sweep, kind, distance, s, half * _W7[q] * s, work[0])
            for q in range(4):
                s = middle + half * _X4[q]
                _add_value(edges, jumps, active, count, base, sweep, kind, distance, s, half * _W4[q] * s, work[1])
            off = 0.0
            for c in range(channels):
                off = max(off, abs(work[0, c] - work[1, c]))
            if off > tolerance and depth < _DEEPEST:
                for part in range(2):
                    ends[top, 0], ends[top, 1] = (a, middle) if part == 0 else (middle, b)
                    depths[top] = depth + 1
                    top += 1
                continue
            slack += off
            for c in range(channels):
                out[c] += work[0, c]
    return slack


@called
def _sort(values: FloatArray, n: int) -> None:
    """Sort the first n values in place; there are few, and this compiles faster than the library's."""
    for i in range(1, n):
        v = values[i]
        j = i - 1
        while j >= 0 and values[j] > v:
            values[j + 1] = values[j]
            j -= 1
        values[j + 1] = v


@called
def _add_value(
    edges: FloatArray, jumps: FloatArray, active: IntArray, count: int, base: FloatArray, sweep: float, kind: int,
    distance: float, s: float, weight: float, out: FloatArray,
) -> None:  # fmt: skip
    """Add weight times F (`kind` 2: 2 pi m) at a place on a side."""
    channels = len(out)
    r = np.sqrt(s * s + distance * distance)
    theta = 1.0
    if kind == 0:
        theta = np.arctan2(distance, s) / (2 * _PI)
    elif kind == 1:
        theta = np.arctan2(s, distance) / (2 * _PI)
    for c in range(channels):
        out[c] += weight * theta * base[c]
    turned = theta - sweep / (2 * _PI)
    factor = -weight * (2 * _PI) * (2 * _PI) / (6.0 * sweep)
    for a in range(count):
        e = active[a]
        h, foot, start, end = edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3]
        arc = edges[e, 4]
        value = 0.0
        if r > h:
            reach = np.sqrt((r - h) * (r + h))
            angle = np.arctan2(reach, h) if h > 0.0 else _PI / 2
            first = -angle if start < -reach else edges[e, 7]
            last = angle if end > reach else edges[e, 8]
            if last > first:
                arc -= last - first
            if kind < 2:
                if start < reach <= end:
                    at = (foot + angle) / (2 * _PI)
                    value += _b3(theta - at) - _b3(turned - at)
                if start < -reach <= end:
                    at = (foot - angle) / (2 * _PI)
                    value -= _b3(theta - at) - _b3(turned - at)
        value = weight * theta * arc + factor * value
        for c in range(channels):
            out[c] += jumps[e, c] * value


@called
def _b3(x: float) -> float:
    """Return the periodic Bernoulli polynomial B3, x in turns."""
    x -= np.floor(x)
    return x * (x - 0.5) * (x - 1.0)


def draw_rotor(rotor: Rotor, size: tuple[int, int], rows: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
    """Return what the turning pattern adds to a band of rows (n, width, c), and bounds on its error (n, width)."""
    width, channels = size[0], rotor.jumps.shape[1]
    n = rows[1] - rows[0]
    across, down = np.zeros((n + 1, width, channels)), np.zeros((n + 1, width + 1, channels))
    cut, slack = np.zeros((n + 1, width, channels)), np.zeros((n + 1, 3, width + 1))
    tolerance = max(_TOLERANCE, rotor.rounding * _ROUNDING_SHARE)
    for i in range(n + 1):
        integrate_row(
            rotor.edges, rotor.jumps, rotor.radii, rotor.sweep, rotor.hub, rows[0] + i, width, tolerance,
            across[i], down[i], cut[i], slack[i],
        )  # fmt: skip
    pixels = across[:-1] - across[1:] + down[:-1, :-1] - down[:-1, 1:] + cut[:-1]
    bound = slack[:-1, 0, :-1] + slack[1:, 0, :-1] + slack[:-1, 1, :-1] + slack[:-1, 1, 1:] + slack[:-1, 2, :-1]
    return pixels, bound + rotor.rounding
