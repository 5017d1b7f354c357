"""How much of a pixel filter lies over a part of a pixel: of the one it belongs to and of those around.

A part is what lies between a left side and a straight run (see `borders`), over the run's height. For a filter
g(x) g(y) its mass is the integral over y of [G(x(y)) - G(left)] g(y) along the run: cut where the run meets a knot of
the profile in x or y it is a polynomial of known degree, for which a Gauss-Legendre rule is exact, or an entire
function, for which the rule's error on a Bernstein ellipse (Trefethen, Approximation Theory, theorem 19.3) says how
many nodes bring it below 1e-15. Pixels are a whole number of units apart, so one set of cuts serves all of them. The
cone's mass is closed: the part's four sides, each with the pixel's centre a signed triangle.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.renderers.sampling.filters import CONE, GAUSSIAN, LANCZOS, MITCHELL, FilterSpec, integral_at, profile_at
from aliasbench.scenes.model import FloatArray

QUADRATURE = 1e-15  # what one rule may be off, of a profile's whole mass
_MOST_NODES = 16
POLYNOMIAL, ENTIRE_SQUARED, ENTIRE, RADIAL = 0, 1, 2, 3


@dataclass(frozen=True, slots=True, eq=False)
class Rules:
    """How a filter is integrated along runs.

    Attributes
    ----------
    kind : int
        POLYNOMIAL: one number of nodes does for all; ENTIRE_SQUARED and ENTIRE: the number follows from the cut's
        length, squared or not; RADIAL: closed form.
    limits : (17,) float64
        The largest length, in the unit of the last entry, for which n nodes do; the unit itself comes first.
    nodes : (17, 16, 2) float64
        Places in [0, 1] and weights of the rules with n nodes.
    knots : (k,) float64
        Where in a pixel profiles of any pixel have knots, in (0, 1), ascending.
    """

    kind: int
    limits: FloatArray
    nodes: FloatArray
    knots: FloatArray


def rules_of(spec: FilterSpec) -> Rules:
    """Return how a filter is integrated."""
    nodes = np.zeros((_MOST_NODES + 1, _MOST_NODES, 2))
    for n in range(1, _MOST_NODES + 1):
        x, w = np.polynomial.legendre.leggauss(n)
        nodes[n, :n, 0], nodes[n, :n, 1] = (x + 1) / 2, w / 2
    places = np.unique([(0.5 + k) % 1.0 for k in spec.knots])
    knots = places[(places > 0.0) & (places < 1.0)]
    limits = np.full(_MOST_NODES + 1, np.inf)
    if spec.kind.code == CONE:
        return Rules(RADIAL, limits, nodes, np.empty(0))
    if spec.kind.degree is not None:
        # along a run G has one degree more than g, and g adds its own: n nodes are exact up to degree 2 n - 1
        limits[: spec.kind.degree + 1] = -1.0
        return Rules(POLYNOMIAL, limits, nodes, knots)
    squared = spec.kind.code == GAUSSIAN
    limits[1:] = [_longest(n, squared) for n in range(1, _MOST_NODES + 1)]
    # the Gaussian grows as exp(y^2 / (2 sigma^2)) off the axis, sinc(x) sinc(x / r) as exp(pi (1 + 1 / r) y)
    limits[0] = 1.0 / spec.sigma if squared else math.pi * (1.0 + 1.0 / spec.radius)
    return Rules(ENTIRE_SQUARED if squared else ENTIRE, limits, nodes, knots)


def _longest(n: int, squared: bool) -> float:
    """Return for how long a cut n nodes do.

    A function bounded by M inside the ellipse with half-axes (rho +- 1 / rho) / 2 around [-1, 1] is integrated to
    64/15 M rho^-2n / (1 - rho^-2). With v the lower half-axis, M is 4 exp(q v^2 / 2) or 4 exp(q v), where q is the sum
    over x and y of the cut's half-lengths, for the Gaussian squared; the best rho is taken.
    """
    rho = np.exp(np.linspace(0.05, 6.0, 400))
    v = (rho - 1 / rho) / 2
    allowed = math.log(QUADRATURE * 15 / 64 / 4) + 2 * n * np.log(rho) + np.log1p(-(rho**-2))
    return float(max(0.0, (allowed / (v**2 / 2 if squared else v)).max()))


def cell_masses(spec: FilterSpec) -> FloatArray:
    """Return the filter's mass over the pixels around its centre: (2 m + 1,) for each axis, of the cone for both."""
    places = np.arange(-spec.margin, spec.margin + 1, dtype=np.float64)
    if spec.kind.separable:
        return spec.integral(places + 0.5) - spec.integral(places - 0.5)
    return np.array(
        [[_cone_part(spec.radius, x - 0.5, x + 0.5, y - 0.5, x + 0.5, y + 0.5) for x in places] for y in places]
    )


def cell_peaks(spec: FilterSpec) -> FloatArray:
    """Return bounds on abs f over the pixels around the filter's centre, laid out as `cell_masses`.

    Between samples a profile can rise by at most half their distance times its slope; profiles that fall away from the
    centre throughout have their largest value at the point of the pixel that is nearest to it.
    """
    places = np.arange(-spec.margin, spec.margin + 1, dtype=np.float64)
    nearest = np.maximum(np.abs(places) - 0.5, 0.0)
    if not spec.kind.separable:
        return spec.evaluate(nearest[None, :], nearest[:, None])
    if spec.kind.code not in (MITCHELL, LANCZOS):
        return spec.profile(nearest)
    # slopes: of Mitchell's at most 8/7 (2 / r)^2, at x = 2 r / 7; of sinc(x) sinc(x / r) less than pi (1 + 1 / r)
    steep = 8.0 / 7.0 * (2.0 / spec.radius) ** 2
    if spec.kind.code == LANCZOS:
        steep = spec.peak * math.pi * (1.0 + 1.0 / spec.radius)
    count = max(256, math.ceil(256.0 / spec.radius))
    inside = (np.arange(count) + 0.5) / count - 0.5
    sampled = np.abs(spec.profile(places[:, None] + inside)).max(axis=1)
    return np.minimum(sampled + steep / (2 * count), spec.peak)


@allocating
def run_masses(
    params: FloatArray, limits: FloatArray, nodes: FloatArray, knots: FloatArray, kind: int, support: float,
    run: FloatArray, first: tuple[int, int], shape: tuple[int, int], profile: FloatArray, share: FloatArray,
) -> int:  # fmt: skip
    """Fill share[i, j] with the mass over what a run bounds, of the filter of pixel (first[0] + i, first[1] + j).

    Parameters
    ----------
    params
        Of the `FilterSpec`.
    limits, nodes, knots, kind
        Of its `Rules`.
    support : float
        Of the filter.
    run : (5,) float64
        left, x0, y0, x1, y1, relative to the corner of pixel (0, 0); see `borders`.
    first, shape : (int, int)
        Row and column of the first pixel, relative to pixel (0, 0), and the number of rows and columns.
    profile : (>= columns,) float64
        Room.

    Returns
    -------
    int
        The number of quadrature rules used.
    """
    left, x0, y0, x1, y1 = run
    cx, cy = first[1] + 0.5, first[0] + 0.5
    if kind == RADIAL:
        for i in range(shape[0]):
            for j in range(shape[1]):
                x, y = cx + j, cy + i
                near_x, near_y = max(0.0, abs(x - 0.5) - 0.5), max(0.0, abs(y - 0.5) - 0.5)
                share[i, j] = 0.0
                if near_x * near_x + near_y * near_y < support * support:
                    share[i, j] = _cone_part(support, left - x, x0 - x, y0 - y, x1 - x, y1 - y)
        return 0
    # what lies to the left of the part, over its whole height
    for j in range(shape[1]):
        profile[j] = integral_at(params, left - cx - j)
        if x0 == x1:
            profile[j] -= integral_at(params, x0 - cx - j)
    for i in range(shape[0]):
        mass = integral_at(params, y1 - cy - i) - integral_at(params, y0 - cy - i)
        for j in range(shape[1]):
            share[i, j] = -mass * profile[j]
    if x0 == x1:
        return 0
    cuts, pieces = _cuts(knots, x0, y0, x1, y1)
    used = 0
    for k in range(pieces):
        length = cuts[k + 1] - cuts[k]
        if length <= 0.0:
            continue
        size, panels = 0.0, 1
        if kind != POLYNOMIAL:
            size, panels = _measure((x1 - x0) * length, (y1 - y0) * length, limits, kind)
        count = 1
        while limits[count] < size:
            count += 1
        used += panels
        step = length / panels
        for p in range(panels):
            for s in range(count):
                t = cuts[k] + step * (p + nodes[count, s, 0])
                x, y = x0 + (x1 - x0) * t, y0 + (y1 - y0) * t
                for j in range(shape[1]):
                    profile[j] = integral_at(params, x - cx - j)
                for i in range(shape[0]):
                    weight = nodes[count, s, 1] * step * (y1 - y0) * profile_at(params, y - cy - i)
                    if weight != 0.0:
                        for j in range(shape[1]):
                            share[i, j] += weight * profile[j]
    return used


@allocating
def _cuts(knots: FloatArray, x0: float, y0: float, x1: float, y1: float) -> tuple[FloatArray, int]:
    """Return the sorted shares of the way along a run at which it is cut, 0 and 1 included, and the number of parts."""
    cuts = np.empty(2 * len(knots) + 2)
    cuts[0] = 0.0
    n = 1
    for k in knots:
        for t in ((k - y0) / (y1 - y0), (k - x0) / (x1 - x0)):
            if 0.0 < t < 1.0:
                i = n
                while cuts[i - 1] > t:
                    cuts[i] = cuts[i - 1]
                    i -= 1
                cuts[i] = t
                n += 1
    cuts[n] = 1.0
    return cuts, n


@called
def _measure(dx: float, dy: float, limits: FloatArray, kind: int) -> tuple[float, int]:
    """Return the length of a cut's part in the rules' measure, and into how many parts the cut must be divided."""
    unit, longest = limits[0], limits[len(limits) - 1]
    if kind == ENTIRE:
        q = unit * (abs(dx) + abs(dy)) / 2
        panels = max(1, math.ceil(q / longest))
        return q / panels, panels
    q = unit * unit * (dx * dx + dy * dy) / 4
    panels = max(1, math.ceil(math.sqrt(q / longest)))
    return q / (panels * panels), panels


@njit(cache=True, nogil=True, error_model="numpy")
def _cone_part(radius: float, left: float, x0: float, y0: float, x1: float, y1: float) -> float:
    """Return the cone's mass over (left, y0), (x0, y0), (x1, y1), (left, y1), relative to its tip."""
    a, b, c, top, bottom = left / radius, x0 / radius, x1 / radius, y0 / radius, y1 / radius
    return (
        _cone_triangle(a, top, b, top)
        + _cone_triangle(b, top, c, bottom)
        + _cone_triangle(c, bottom, a, bottom)
        + _cone_triangle(a, bottom, a, top)
    )


@called
def _cone_triangle(px: float, py: float, qx: float, qy: float) -> float:
    """Return the mass of a cone of radius 1 over the signed triangle from its tip to p and q.

    Along the side, at distance h from the tip, s runs from its foot. Within the disc the mass up to s is
    3 / pi [h s / 2 - h (s sqrt(h^2 + s^2) + h^2 asinh(s / h)) / 6]; beyond the disc it is that of a sector, angle / 6.
    """
    dx, dy = qx - px, qy - py
    length = math.sqrt(dx * dx + dy * dy)
    cross = px * qy - py * qx
    h = abs(cross) / length if length > 0.0 else 0.0
    if h < 1e-300:
        return 0.0
    s0, s1 = (px * dx + py * dy) / length, (qx * dx + qy * dy) / length
    if h >= 1.0:
        total = (math.atan2(s1, h) - math.atan2(s0, h)) / 6.0
    else:
        half = math.sqrt(1.0 - h * h)
        a, b = min(max(s0, -half), half), min(max(s1, -half), half)
        total = 0.0
        # a side that does not meet the disc has a == b at the near end
        for s, e in ((s0, a), (b, s1)):
            if s != e:
                total += (math.atan2(e, h) - math.atan2(s, h)) / 6.0
        if a != b:
            ra, rb = math.sqrt(h * h + a * a), math.sqrt(h * h + b * b)
            total += h * (b - a) / 2.0 - h * (b * rb - a * ra + h * h * (math.asinh(b / h) - math.asinh(a / h))) / 6.0
    return math.copysign(total, cross) * 3.0 / math.pi
