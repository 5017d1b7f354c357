"""The mass of a filter over a polygon that a lens spreads over a disc: one integral along each edge and the disc.

With g the filter's profile along one axis, G its integral and H the integral of G, the mean over a chord of the disc,
at height b and of half-length c = sqrt(rho^2 - b^2), of what a polygon gives a pixel at the origin is by Green's
theorem

    the integral along the outline of g(y - b) (H(x + c) - H(x - c)) / (2 c) dy,

and the mean over the disc weighs chords by 2 c / (pi rho^2). So the integrand needs no division, and b = rho sin(theta)
takes away the root. Along an edge it is smooth between knots of the filter, and the integral over the edge is smooth in
theta but where an end of the edge, shifted by the circle, meets a knot, or a corner of knots meets the edge: these
places are known, and between them Gauss and Kronrod's rules with 7 and 15 nodes are halved until they agree. Their
difference, far above the error of the second, is the bound.
"""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.renderers.sampling.filters import GAUSSIAN, LANCZOS, FilterSpec, integral_at, profile_at
from aliasbench.scenes.model import FloatArray

TOLERANCE = 1e-11  # of one part of one edge in one pixel
_DEPTH = 24
_NODES = 12  # of the rule along a part of an edge, of a filter that is no polynomial
_TERMS = 20
SHARP = 1e-6  # a disc of a smaller radius, in pixels, is a point; the rounding of H would show


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """A separable filter as `disc_masses` wants it.

    Attributes
    ----------
    params : float64
        Of the `FilterSpec`.
    knots : (k,) float64
    longest : float
        How long a part of an edge may be for the rule, in pixels.
    nodes : (n, 2) float64
        Places in [0, 1] and weights.
    ends : (p + 1,) float64
        Between which H is a polynomial.
    series : (p, t) float64
        Its coefficients in u of [-1, 1] over the part.
    """

    params: FloatArray
    knots: FloatArray
    longest: float
    nodes: FloatArray
    ends: FloatArray
    series: FloatArray


def spread_of(spec: FilterSpec) -> Spread:
    """Return a separable filter with the integral of its integral."""
    knots = np.array(spec.knots)
    count, longest, terms = _NODES, math.inf, _TERMS
    if spec.kind.degree is not None:
        count, terms = spec.kind.degree + 2, spec.kind.degree + 3
    elif spec.kind.code == GAUSSIAN:
        longest = spec.sigma
    elif spec.kind.code == LANCZOS:
        longest = 0.5 * min(1.0, spec.radius)
    parts = [np.linspace(a, b, max(1, math.ceil((b - a) / longest)) + 1)[:-1] for a, b in pairwise(knots)]
    ends = np.append(np.concatenate(parts), knots[-1])
    t = np.cos(np.pi * (np.arange(terms - 1) + 0.5) / (terms - 1))
    series, before = np.zeros((len(ends) - 1, terms)), 0.0
    for k in range(len(ends) - 1):
        half = (ends[k + 1] - ends[k]) / 2
        inner = np.polynomial.chebyshev.chebfit(t, spec.integral(ends[k] + half * (1 + t)), terms - 2)
        outer = np.polynomial.chebyshev.chebint(inner, lbnd=-1.0) * half
        outer[0] += before
        before = float(np.polynomial.chebyshev.chebval(1.0, outer))
        series[k] = np.polynomial.chebyshev.cheb2poly(outer)[:terms]
    x, w = np.polynomial.legendre.leggauss(count)
    return Spread(spec.params, knots, longest, np.stack([(x + 1) / 2, w / 2], axis=1), ends, series)


# Kronrod's rule of 15 nodes, half of it, and Gauss's weights at every second node (QUADPACK, qk15)
_KRONROD = np.array(
    [
        [0.991455371120812639206854697526329, 0.022935322010529224963732008058970, 0.0],
        [0.949107912342758524526189684047851, 0.063092092629978553290700663189204, 0.129484966168869693270611432679082],
        [0.864864423359769072789712788640926, 0.104790010322250183839876322541518, 0.0],
        [0.741531185599394439863864773280788, 0.140653259715525918745189590510238, 0.279705391489276667901467771423780],
        [0.586087235467691130294144691693013, 0.169004726639267902826583426598550, 0.0],
        [0.405845151377397166906606412076961, 0.190350578064785409913256402421014, 0.381830050505118944950369775488975],
        [0.207784955007898467600689403773245, 0.204432940075298892414161999234649, 0.0],
        [0.0, 0.209482141084727828012999174891714, 0.417959183673469387755102040816327],
    ]
)


@njit(cache=True, nogil=True, error_model="numpy")
def disc_masses(
    edges: FloatArray, radius: float, support: float, params: FloatArray, knots: FloatArray, longest: float,
    nodes: FloatArray, ends: FloatArray, series: FloatArray, rows: NDArray[np.int64], out: FloatArray,
    bound: FloatArray,
) -> None:  # fmt: skip
    """Fill rows [rows[0], rows[1]) of `out` (h, w) with a polygon's masses, and of `bound` with bounds on their errors.

    Parameters
    ----------
    edges : (n, 4) float64
        x0, y0, x1, y1 of the edges of all rings, in pixels; the integral of x dy along them is the area.
    radius : float
        Of the disc, in pixels; below `SHARP` it is none.
    support : float
        Of the filter. The rest is of its `Spread`.
    """
    low, high = np.inf, -np.inf
    left, right = np.inf, -np.inf
    for e in range(len(edges)):
        low, high = min(low, edges[e, 1], edges[e, 3]), max(high, edges[e, 1], edges[e, 3])
        left, right = min(left, edges[e, 0], edges[e, 2]), max(right, edges[e, 0], edges[e, 2])
    reach = support + radius
    close = radius + math.sqrt(2.0) * support + 1e-9
    cuts = np.empty(2 + 6 * len(knots) + 2 * len(knots) * len(knots))
    edge = np.empty(4)
    for row in range(rows[0], rows[1]):
        for column in range(out.shape[1]):
            out[row, column] = bound[row, column] = 0.0
            x, y = column + 0.5, row + 0.5
            if x < left - reach or x > right + reach or y < low - reach or y > high + reach:
                continue
            near = False
            inside = 0.0
            for e in range(len(edges)):
                x0, y0, x1, y1 = edges[e, 0] - x, edges[e, 1] - y, edges[e, 2] - x, edges[e, 3] - y
                near = near or _distance(x0, y0, x1, y1) <= close
                if (y0 > 0.0) != (y1 > 0.0) and x0 - y0 * (x1 - x0) / (y1 - y0) > 0.0:
                    inside += 1.0 if y1 > y0 else -1.0
            if not near:
                out[row, column] = inside
                continue
            total, error = 0.0, 0.0
            for e in range(len(edges)):
                edge[0], edge[1], edge[2], edge[3] = edges[e, 0] - x, edges[e, 1] - y, edges[e, 2] - x, edges[e, 3] - y
                if edge[1] == edge[3] or max(edge[0], edge[2]) < -reach:
                    continue
                if max(edge[1], edge[3]) < -reach or min(edge[1], edge[3]) > reach:
                    continue
                if radius < SHARP:
                    total += _along(edge, 0.0, 0.0, params, knots, longest, nodes, ends, series)
                    error += 4.0 * radius * profile_at(params, 0.0)
                    continue
                n = _breaks(edge, radius, knots, cuts)
                for k in range(n - 1):
                    if cuts[k + 1] - cuts[k] > 1e-14:
                        value, doubt = _disc_part(
                            edge, radius, cuts[k], cuts[k + 1], params, knots, longest, nodes, ends, series
                        )
                        total += value
                        error += doubt
                error += 1e-14 + 1e-15 * (1.0 + support) / radius
            out[row, column], bound[row, column] = total, error


@called
def _distance(x0: float, y0: float, x1: float, y1: float) -> float:
    """Return the distance of a segment from the origin."""
    dx, dy = x1 - x0, y1 - y0
    squared = dx * dx + dy * dy
    t = min(1.0, max(0.0, -(x0 * dx + y0 * dy) / squared)) if squared > 0.0 else 0.0
    return math.hypot(x0 + t * dx, y0 + t * dy)


@allocating
def _breaks(edge: FloatArray, radius: float, knots: FloatArray, cuts: FloatArray) -> int:
    """Fill the sorted angles, from -pi / 2 to pi / 2, where an edge's integral may not be smooth; return how many."""
    cuts[0], cuts[1] = -math.pi / 2, math.pi / 2
    n = 2
    dx, dy = edge[2] - edge[0], edge[3] - edge[1]
    squared = dx * dx + dy * dy
    for k in knots:
        for e in (0, 2):
            n = _add_break(edge[e + 1] - k, radius, cuts, n)
            d = edge[e] - k
            if abs(d) < radius:
                b = math.sqrt((radius - d) * (radius + d))
                n = _add_break(b, radius, cuts, n)
                n = _add_break(-b, radius, cuts, n)
        for j in knots:
            # (j, k) + (radius cos, radius sin) on the edge
            px, py = edge[0] - j, edge[1] - k
            along, across = px * dx + py * dy, px * dy - py * dx
            rest = radius * radius * squared - across * across
            if rest > 0.0:
                root = math.sqrt(rest)
                for sign in (-1.0, 1.0):
                    t = (-along + sign * root) / squared
                    if -1e-9 <= t <= 1.0 + 1e-9:
                        n = _add_break(py + t * dy, radius, cuts, n)
    cuts[:n].sort()
    return n


@called
def _add_break(b: float, radius: float, cuts: FloatArray, n: int) -> int:
    if abs(b) < radius:
        cuts[n] = math.asin(b / radius)
        return n + 1
    return n


@allocating
def _disc_part(
    edge: FloatArray, radius: float, begin: float, end: float, params: FloatArray, knots: FloatArray, longest: float,
    nodes: FloatArray, ends: FloatArray, series: FloatArray,
) -> tuple[float, float]:  # fmt: skip
    """Return the integral over theta in [begin, end] and a bound on its error."""
    stack = np.empty((_DEPTH + 2, 2))
    stack[0] = begin, end
    depth = 1
    total, doubt = 0.0, 0.0
    while depth > 0:
        depth -= 1
        a, b = stack[depth]
        middle, half = (a + b) / 2, (b - a) / 2
        fine, coarse = 0.0, 0.0
        for k in range(8):
            for side in range(2 if k < 7 else 1):
                theta = middle + (half if side == 0 else -half) * _KRONROD[k, 0]
                c = radius * math.cos(theta)
                value = c * _along(edge, radius * math.sin(theta), c, params, knots, longest, nodes, ends, series)
                fine += _KRONROD[k, 1] * value
                coarse += _KRONROD[k, 2] * value
        scale = half / (math.pi * radius * radius)
        difference = abs(fine - coarse) * scale
        if difference <= TOLERANCE or depth + 2 > _DEPTH or half < 1e-12:
            total += fine * scale
            doubt += difference
        else:
            stack[depth] = a, middle
            stack[depth + 1] = middle, b
            depth += 2
    return total, doubt


@allocating
def _along(
    edge: FloatArray, b: float, c: float, params: FloatArray, knots: FloatArray, longest: float, nodes: FloatArray,
    ends: FloatArray, series: FloatArray,
) -> float:  # fmt: skip
    """Return the integral along an edge of g(y - b) (H(x + c) - H(x - c)) dy, or of g(y - b) G(x) dy if c is 0."""
    x0, y0, x1, y1 = edge[0], edge[1], edge[2], edge[3]
    sign = 1.0
    if y0 > y1:
        x0, y0, x1, y1, sign = x1, y1, x0, y0, -1.0
    low, high = max(y0, b + knots[0]), min(y1, b + knots[-1])
    if not low < high:
        return 0.0
    slope = (x1 - x0) / (y1 - y0)
    cuts = np.empty(2 + 3 * len(knots))
    cuts[0], cuts[1] = low, high
    n = 2
    for k in knots:
        if low < b + k < high:
            cuts[n] = b + k
            n += 1
        if slope != 0.0:
            for x in (k - c, k + c):
                y = y0 + (x - x0) / slope
                if low < y < high:
                    cuts[n] = y
                    n += 1
    for i in range(1, n):
        v, j = cuts[i], i
        while j > 0 and cuts[j - 1] > v:
            cuts[j] = cuts[j - 1]
            j -= 1
        cuts[j] = v
    total = 0.0
    for i in range(n - 1):
        length = cuts[i + 1] - cuts[i]
        if length <= 0.0:
            continue
        middle = x0 + (cuts[i] + length / 2 - y0) * slope
        if middle + c <= ends[0]:
            continue
        if middle - c >= ends[-1]:
            mass = integral_at(params, cuts[i + 1] - b) - integral_at(params, cuts[i] - b)
            total += mass * (2.0 * c if c > 0.0 else 1.0)
            continue
        parts = max(1, math.ceil(max(length, abs(slope) * length) / longest))
        step = length / parts
        for p in range(parts):
            for s in range(len(nodes)):
                y = cuts[i] + step * (p + nodes[s, 0])
                x = x0 + (y - y0) * slope
                if c > 0.0:
                    value = _twice(ends, series, x + c) - _twice(ends, series, x - c)
                else:
                    value = integral_at(params, x)
                if value != 0.0:
                    total += nodes[s, 1] * step * profile_at(params, y - b) * value
    return sign * total


@called
def _twice(ends: FloatArray, series: FloatArray, x: float) -> float:
    """Return H(x), the integral of the filter's integral."""
    if x <= ends[0]:
        return 0.0
    last = len(ends) - 1
    if x >= ends[last]:
        return x
    k = min(last - 1, int((x - ends[0]) / (ends[last] - ends[0]) * last))
    while x < ends[k]:
        k -= 1
    while x > ends[k + 1]:
        k += 1
    u = (2.0 * x - ends[k] - ends[k + 1]) / (ends[k + 1] - ends[k])
    terms = series.shape[1]
    total = series[k, terms - 1]
    for j in range(terms - 2, -1, -1):
        total = total * u + series[k, j]
    return total
