"""Everything that moves turns about one point of the picture, under any filter that is a product g(x) g(y).

At every point the pattern's mean over the open shutter is closed (the derivative of what `rotor` integrates): at a
distance r from the hub it is piecewise linear in the angle, with kinks on the edges as they lie when the shutter opens
and when it closes, and its coefficients are analytic in r but on the circles on which something happens. What is left
is one integral of it times the filter over every pixel cell, for all pixels around at once. Lines across the cell, as
much along the radius as the picture's axes allow, are cut at kinks and circles; and the cell into strips at the heights
where any of these meets its sides. In between all is smooth, but where several of them meet. Gauss-Legendre rules of 7
and 5 points both ways are compared and the cell is halved until they agree; the difference, far larger than the error
of the better rule, is the bound. Where such curves run through it the strips may hide kinks, on which two rules can
agree by accident: there a third rule, of 6 points, must agree too, and the largest difference of any two counts twice.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.renderers.reference.flat import Integral, over_bands
from aliasbench.renderers.reference.turning import Rotor
from aliasbench.renderers.reference.whirl_cuts import MOST_MET, draw_towards, find_knots, find_strips, is_tangled
from aliasbench.renderers.sampling.filters import FilterSpec, profile_at
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]

WIDEST = 12  # pixels of margin beyond which the pixels around a cell are too many
_SECTION = 256  # rows whose patches are held at a time
_MOST_PARTS = 2048  # of a cell
_SAFETY = 1.5
_FLOOR, _FLOOR_SHARE = 2e-9, 0.03  # added for where all rules agree by accident: of a colour, or of the bound aimed at
_X7, _W7 = (np.ascontiguousarray(a) for a in np.polynomial.legendre.leggauss(7))
_X6, _W6 = (np.ascontiguousarray(a) for a in np.polynomial.legendre.leggauss(6))
_X5, _W5 = (np.ascontiguousarray(a) for a in np.polynomial.legendre.leggauss(5))
_PI = 3.141592653589793
_EPS = 2.220446049250313e-16


def draw_whirl(rotor: Rotor, size: tuple[int, int], spec: FilterSpec, target: float) -> Integral:
    """Return what a turning pattern adds to the picture (h, w, c) under a filter, and bounds on the error.

    Parameters
    ----------
    rotor : Rotor
    size : (width, height)
    spec : FilterSpec
        Separable.
    target : float
        The bound aimed at.
    """
    width, height = size
    margin = spec.margin
    pixels, bound = np.zeros((height, width, rotor.jumps.shape[1])), np.zeros((height, width))
    places = np.mod(0.5 + np.array(spec.knots), 1.0)
    cuts = np.unique(np.concatenate([np.array([0.0, 1.0]), places]))
    cuts = cuts[np.concatenate([np.array([True]), np.diff(cuts) > 1e-12])]
    circles = rotor.radii[np.concatenate([np.array([True]), np.diff(rotor.radii) > 1e-12 * rotor.radii[-1]])]
    hub, tolerance = rotor.hub + margin, target / (2 * margin + 1) ** 2 / 10

    def draw(rows: NDArray[np.int64]) -> tuple[int, FloatArray, FloatArray]:
        top, bottom = max(0, int(rows[0]) - 2 * margin), min(height, int(rows[1]))
        patch = np.zeros((max(0, bottom - top), width, pixels.shape[2]))
        slack = np.zeros((max(0, bottom - top), width))
        _whirl_rows(
            rotor.edges, rotor.jumps, _kinks(rotor), circles, rotor.sweep, hub, cuts, spec.params, margin, tolerance,
            rows, height, top, patch, slack,
        )  # fmt: skip
        return top, patch, slack

    high = height + 2 * margin
    for section in range(0, high, _SECTION):

        def draw_section(rows: NDArray[np.int64], section: int = section) -> tuple[int, FloatArray, FloatArray]:
            return draw(rows + section)

        for top, patch, slack in over_bands(draw_section, min(_SECTION, high - section)):
            pixels[top : top + len(patch)] += patch
            bound[top : top + len(patch)] += slack
    floor = max(_FLOOR * float(np.abs(rotor.jumps).max()), _FLOOR_SHARE * target)
    return Integral(pixels, bound + rotor.rounding * spec.gain + floor)


def _kinks(rotor: Rotor) -> FloatArray:
    """Return both ends (2 n, 4) of every edge as the shutter opens and closes, from the hub, y up."""
    parts = []
    for turn in (0.0, rotor.sweep):
        h, foot = rotor.edges[:, 0], rotor.edges[:, 1] + turn
        cos, sin = np.cos(foot), np.sin(foot)
        for s in (rotor.edges[:, 2], rotor.edges[:, 3]):
            parts += [h * cos - s * sin, h * sin + s * cos]
    return np.concatenate([np.stack(parts[:4], axis=1), np.stack(parts[4:], axis=1)])


@njit(cache=True, nogil=True, error_model="numpy")
def _whirl_rows(
    edges: FloatArray, jumps: FloatArray, kinks: FloatArray, circles: FloatArray, sweep: float, hub: FloatArray,
    cuts: FloatArray, params: FloatArray, margin: int, tolerance: float, rows: IntArray, height: int, top: int,
    patch: FloatArray, slack: FloatArray,
) -> None:  # fmt: skip
    """Add what rows [rows[0], rows[1]) of the picture with margin add to rows from `top` on.

    Parameters
    ----------
    edges, jumps, sweep
        Of `Rotor`.
    kinks : (n, 4)
        See `_kinks`.
    circles : (k,)
        Radii.
    hub : (2,)
        In the picture with margin.
    cuts : (m + 1,)
        Where the cells of a pixel begin and end along each axis.
    """
    width, channels = patch.shape[1], patch.shape[2]
    reach, cells = 2 * margin + 1, len(cuts) - 1
    active, near = np.empty(len(edges), np.int64), np.empty(len(kinks), np.int64)
    rings, base = np.empty(len(circles)), np.zeros(channels)
    sums, total, off = (
        np.empty((3, reach, reach, channels)),
        np.empty((reach, reach, channels)),
        np.empty((reach, reach)),
    )
    line = np.empty((reach, channels))
    box = np.empty(4)
    parts = np.empty((_MOST_PARTS + 2, 4))
    for row in range(rows[0], rows[1]):
        for column in range(width + 2 * margin):
            for cell in range(cells * cells):
                i, j = cell // cells, cell % cells
                box[0], box[1] = column + cuts[j] - hub[0], column + cuts[j + 1] - hub[0]
                box[2], box[3] = hub[1] - row - cuts[i + 1], hub[1] - row - cuts[i]
                inner, outer = _radii(box)
                if inner >= circles[-1]:
                    continue
                count, nothing = 0, True
                base[:] = 0.0
                for e in range(len(edges)):
                    if edges[e, 6] <= inner:
                        continue
                    nothing = False
                    if edges[e, 5] >= outer:
                        for c in range(channels):
                            base[c] += jumps[e, c] * edges[e, 4] / (2 * _PI)
                        continue
                    active[count] = e
                    count += 1
                if nothing:
                    continue
                met, ringed = 0, 0
                for k in range(len(kinks)):
                    a, b, c, d = kinks[k]
                    if max(a, c) > box[0] and min(a, c) < box[1] and max(b, d) > box[2] and min(b, d) < box[3]:
                        near[met] = k
                        met += 1
                for k in range(len(circles)):
                    if inner < circles[k] < outer:
                        rings[ringed] = circles[k]
                        ringed += 1
                # lines run along the axis that is more along the radius
                swap = abs(box[0] + box[1]) < abs(box[2] + box[3])
                for c in range(4):
                    parts[0, c] = box[c]
                todo, made = 1, 1
                while todo > 0:
                    todo -= 1
                    x0, x1, y0, y1 = parts[todo]
                    total[:] = 0.0
                    off[:] = 0.0
                    rules = 3 if is_tangled(kinks, near, met, rings, ringed, (x0, x1, y0, y1)) else 2
                    _integrate_part(
                        edges, jumps, active, count, base, sweep, kinks, near, met, rings, ringed, hub, row, column,
                        params, margin, swap, (x0, x1, y0, y1), rules, line, sums, total, off,
                    )  # fmt: skip
                    if off.max() > tolerance and made < _MOST_PARTS and max(x1 - x0, y1 - y0) > 1e-9:
                        middle = (x0 + x1) / 2 if x1 - x0 > y1 - y0 else (y0 + y1) / 2
                        if x1 - x0 > y1 - y0:
                            parts[todo], parts[todo + 1] = (x0, middle, y0, y1), (middle, x1, y0, y1)
                        else:
                            parts[todo], parts[todo + 1] = (x0, x1, y0, middle), (x0, x1, middle, y1)
                        todo += 2
                        made += 1
                        continue
                    for p in range(max(0, 2 * margin - row), min(reach, height + 2 * margin - row)):
                        for q in range(max(0, 2 * margin - column), min(reach, width + 2 * margin - column)):
                            # p, q count from the farthest pixel above and to the left
                            at, to = row - 2 * margin + p - top, column - 2 * margin + q
                            for c in range(channels):
                                patch[at, to, c] += total[p, q, c]
                            slack[at, to] += off[p, q]


@called
def _radii(box: FloatArray) -> tuple[float, float]:
    """Return the least and greatest distance of a rectangle from the hub."""
    x0, x1, y0, y1 = box
    x = 0.0 if x0 < 0.0 < x1 else min(abs(x0), abs(x1))
    y = 0.0 if y0 < 0.0 < y1 else min(abs(y0), abs(y1))
    far_x, far_y = max(abs(x0), abs(x1)), max(abs(y0), abs(y1))
    return np.sqrt(x * x + y * y), np.sqrt(far_x * far_x + far_y * far_y)


@called
def _spread(sums: FloatArray, p: int, q: int, c: int, rules: int) -> float:
    """Return a bound from what the rules say of one pixel."""
    a, b = sums[0, p, q, c], sums[1, p, q, c]
    if rules == 2:
        return _SAFETY * abs(a - b)
    d = sums[2, p, q, c]
    return 2.0 * _SAFETY * max(abs(a - b), abs(a - d), abs(b - d))


@allocating
def _integrate_part(
    edges: FloatArray, jumps: FloatArray, active: IntArray, count: int, base: FloatArray, sweep: float,
    kinks: FloatArray, near: IntArray, met: int, rings: FloatArray, ringed: int, hub: FloatArray, row: int, column: int,
    params: FloatArray, margin: int, swap: bool, box: tuple[float, float, float, float], rules: int, line: FloatArray,
    sums: FloatArray, out: FloatArray, off: FloatArray,
) -> None:  # fmt: skip
    """Add the integral of pattern times filter over a rectangle to `out` (pixels, pixels, channels).

    Its bound is added to `off` (pixels, pixels). u is measured along lines, v across them.
    """
    channels, reach = out.shape[2], 2 * margin + 1
    a, b = 2 if swap else 0, 0 if swap else 2
    u0, u1, v0, v1 = box[a], box[a + 1], box[b], box[b + 1]
    # an axis of the picture from hub coordinates: place = origin + sense * u, from the corner of the pixel farthest off
    origin_u, sense_u = (hub[1] - row, -1.0) if swap else (hub[0] - column, 1.0)
    origin_v, sense_v = (hub[0] - column, 1.0) if swap else (hub[1] - row, -1.0)
    strips, knots = np.empty(2 + 4 * met + 6 * ringed + MOST_MET**2), np.empty(2 + met + 2 * ringed)
    round_ = np.empty(len(knots), np.bool_)
    value = np.empty(channels)
    n = find_strips(kinks, near, met, rings, ringed, swap, u0, u1, v0, v1, strips)
    for strip in range(n - 1):
        half_v, middle_v = (strips[strip + 1] - strips[strip]) / 2, (strips[strip + 1] + strips[strip]) / 2
        if not half_v > 1e-14:
            continue
        sums[:] = 0.0
        for number in range(7 + 5 + (6 if rules > 2 else 0)):
            rule = 0 if number < 7 else (1 if number < 12 else 2)
            i = number if rule == 0 else (number - 7 if rule == 1 else number - 12)
            x, w = (_X7, _W7) if rule == 0 else ((_X5, _W5) if rule == 1 else (_X6, _W6))
            v = middle_v + half_v * x[i]
            line[:] = 0.0
            m = find_knots(kinks, near, met, rings, ringed, swap, u0, u1, v, knots, round_)
            for k in range(m - 1):
                half = (knots[k + 1] - knots[k]) / 2
                if not half > 1e-14:
                    continue
                for j in range(len(x)):
                    # square roots begin at circles: the rule is drawn towards them
                    t, weight = draw_towards(x[j], round_[k], round_[k + 1])
                    u = knots[k] + half * (1.0 + t)
                    px, py = (v, u) if swap else (u, v)
                    _pattern(edges, jumps, active, count, base, sweep, px, py, value)
                    weight *= w[j] * half
                    place = origin_u + sense_u * u + 2 * margin - margin - 0.5
                    for q in range(reach):
                        g = weight * profile_at(params, place - q)
                        for c in range(channels):
                            line[q, c] += g * value[c]
            place = origin_v + sense_v * v + 2 * margin - margin - 0.5
            for p in range(reach):
                g = w[i] * half_v * profile_at(params, place - p)
                for q in range(reach):
                    for c in range(channels):
                        if swap:
                            sums[rule, q, p, c] += g * line[q, c]
                        else:
                            sums[rule, p, q, c] += g * line[q, c]
        for p in range(reach):
            for q in range(reach):
                worst = 0.0
                for c in range(channels):
                    out[p, q, c] += sums[0, p, q, c]
                    worst = max(worst, _spread(sums, p, q, c, rules))
                off[p, q] += worst


@called
def _pattern(
    edges: FloatArray, jumps: FloatArray, active: IntArray, count: int, base: FloatArray, sweep: float, x: float,
    y: float, out: FloatArray,
) -> None:  # fmt: skip
    """Fill the pattern's mean over the shutter at a point."""
    r = np.sqrt(x * x + y * y)
    theta = np.arctan2(y, x) / (2 * _PI)
    turned = theta - sweep / (2 * _PI)
    for c in range(len(out)):
        out[c] = base[c]
    for a in range(count):
        e = active[a]
        h, foot, start, end = edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3]
        arc, value = edges[e, 4], 0.0
        if r > h:
            reach = np.sqrt((r - h) * (r + h))
            angle = np.arctan2(reach, h) if h > 0.0 else _PI / 2
            first = -angle if start < -reach else edges[e, 7]
            last = angle if end > reach else edges[e, 8]
            if last > first:
                arc -= last - first
            if start < reach <= end:
                at = (foot + angle) / (2 * _PI)
                value += _b2(theta - at) - _b2(turned - at)
            if start < -reach <= end:
                at = (foot - angle) / (2 * _PI)
                value -= _b2(theta - at) - _b2(turned - at)
        value = arc / (2 * _PI) - _PI / sweep * value
        for c in range(len(out)):
            out[c] += jumps[e, c] * value


@called
def _b2(x: float) -> float:
    """Return the periodic Bernoulli polynomial B2 less 1/6, x in turns."""
    x -= np.floor(x)
    return x * (x - 1.0)
