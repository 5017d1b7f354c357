"""Moments of textures whose rows lie along one direction of the picture: whole rows at once, by parts.

As in `walks`, t runs along the rows and s across them; the moment of t^p s^r is the integral around the fragment of
A_p s^r ds, where A_p is a primitive of f t^p along t. With f split into the mean of its row and a rest f0,

    A_p = mean t^(p + 1) / (p + 1) + sum over k <= p of (-1)^k p! / (p - k)! t^(p - k) F_(k + 1),

F_k the k-th primitive of f0 along t: in texels it is the k-th primitive of a periodic row, itself periodic when each
has mean 0, and a polynomial of degree k within a texel. Between two crossings of a texel's border the integrand is a
polynomial for which Gauss-Legendre is exact. Primitives of a row that is long against the fragment are large against
what is left of their sum; such fragments are clipped texel by texel (`moments`).
"""

import math

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.renderers.reference.surfaces import WALK, WALK_BLEND, Surfaces
from aliasbench.renderers.reference.walks import (
    BLEND,
    BLEND_CHANGE,
    MOST_PANELS,
    TEXELS,
    cell_of,
    linear_at,
    next_crossing,
    wrap,
)
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]

_SLOW = 16.0  # the phase's change over a unit of length below which a wave is summed by quadrature
# Gauss-Legendre of n nodes leaves (n!)^4 / ((2 n + 1) (2 n)!^3) of the derivative of order 2 n. Powers up to 9 and
# primitives over a step of length e have one of at most (9 e)^(2 n): steps below these leave under 1e-9 of it.
_TWO_NODES, _THREE_NODES = 0.005, 0.04
_WAVE_NODES = 16
_SHARES = np.concatenate([[np.inf], 1.0 / np.arange(1.0, 21.0)])  # 1 / n


def row_primitives(
    surfaces: Surfaces, degree: int, ways: tuple[int, int] = (WALK, WALK_BLEND)
) -> tuple[FloatArray, FloatArray]:
    """Return the primitives of all rows of texels at their borders, and the rows' means.

    Only pieces of the two `ways` get any, the second of which are blends.

    Returns
    -------
    primitives : (k, degree + 1, 3) float64
        Of each texel's left border: the first, second, ... primitive of what its row differs from its mean.
    means : (k, 3) float64
        Of each texel: the mean of its row.
    """
    out = np.zeros((len(surfaces.texels), degree + 1, 3))
    means = np.zeros((len(surfaces.texels), 3))
    blocks: dict[int, tuple[int, int, bool]] = {}
    for m, way in enumerate(surfaces.ways):
        if way in ways:
            h, w, first = (int(n) for n in surfaces.blocks[m])
            blocks[first] = (h, w, way == ways[1])
            if surfaces.shifts[m] != 0.0:
                for (h, w, first), smooth in zip(surfaces.shifted[m].tolist(), (False, True), strict=True):
                    blocks[first] = (h, w, smooth)
    for first, (h, w, smooth) in blocks.items():
        rows = surfaces.texels[first : first + h * (w + 1)].reshape(h, w + 1, 3)
        values, rises = rows[:, :w], (np.diff(rows, axis=1) if smooth else np.zeros((h, w, 3)))
        mean = values.mean(axis=1, keepdims=True)
        values = values - mean
        made: list[FloatArray] = []
        for k in range(1, degree + 2):
            # over a texel: Taylor's polynomial of the primitives below, and the row itself
            lower = [made[k - 1 - m] / math.factorial(m) for m in range(1, k)]
            step = sum((p[:, :w] for p in lower), values / math.factorial(k) + rises / math.factorial(k + 1))
            now = np.concatenate([np.zeros((h, 1, 3)), np.cumsum(step, axis=1)], axis=1)
            inner = sum(
                (made[k - 1 - m][:, :w] / math.factorial(m + 1) for m in range(1, k)),
                now[:, :w] + values / math.factorial(k + 1) + rises / math.factorial(k + 2),
            )
            now = now - inner.mean(axis=1, keepdims=True)
            now[:, w] = now[:, 0]
            made.append(now)
        out[first : first + h * (w + 1)] = np.stack(made, axis=2).reshape(-1, degree + 1, 3)
        means[first : first + h * (w + 1)] = np.repeat(mean, w + 1, axis=1).reshape(-1, 3)
    return out, means


@called
def row_length(poly: FloatArray, n: int, own: FloatArray, along: FloatArray, width: int, unit: float) -> float:
    """Return the longest period of a row over a fragment, over 2 pi units: by which primitives grow at most."""
    slope = abs(own[0, 0] * along[0] + own[0, 1] * along[1])
    most = 0.0
    for k in range(n):
        most = max(most, linear_at(own[2], poly[k, 0], poly[k, 1]))
    return width * most / (slope * unit * 2 * np.pi)


@allocating
def walk_moments(
    poly: FloatArray, n: int, own: FloatArray, along: FloatArray, mode: int, block: IntArray, texels: FloatArray,
    primitives: FloatArray, means: FloatArray, rules: FloatArray, place: FloatArray, degree: int, factor: float,
    out: FloatArray,
) -> None:  # fmt: skip
    """Add factor times the moments of an image over a fragment to `out` (degree + 1, degree + 1, 3): powers of t and s.

    Parameters as in `walks.walk_texels` and `moments`; primitives and means are those of `row_primitives`.
    """
    height, width, offset = block[0], block[1], block[2]
    tx, ty, unit = along[0], along[1], place[2]
    column, row = cell_of(own, poly, n)
    u, v, q = own[0] - column * own[2], own[1] - row * own[2], own[2]
    slope = u[0] * tx + u[1] * ty
    first_column, first_row = wrap(column, width), wrap(row, height)
    exact = (degree + 3) // 2
    grown = np.empty((2, degree + 3))
    for k in range(n):
        e = k + 1 if k + 1 < n else 0
        ax, ay, bx, by = poly[k, 0], poly[k, 1], poly[e, 0], poly[e, 1]
        ds = (tx * (by - ay) - ty * (bx - ax)) / unit
        if ds == 0.0:
            continue
        dt = (tx * (bx - ax) + ty * (by - ay)) / unit
        s0 = (tx * (ay - place[1]) - ty * (ax - place[0])) / unit
        t0 = (tx * (ax - place[0]) + ty * (ay - place[1])) / unit
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
                here = offset + wrap(first_row + j, height) * (width + 1)
                above = here
                if mode == BLEND:
                    above = offset + wrap(first_row + j + 1.0, height) * (width + 1)
                i_here = wrap(first_column + i, width)
                length = max(abs(ds), abs(dt)) * (to - at)
                nodes, panels = exact, 1
                if mode == TEXELS:
                    if length < _TWO_NODES:
                        nodes = min(exact, 2)
                    elif length < _THREE_NODES:
                        nodes = min(exact, 3)
                else:
                    nodes = exact + 3
                    panels = 1 + int(abs(dq) * (to - at) / min(q0 + at * dq, q0 + to * dq) / BLEND_CHANGE)
                for panel in range(panels):
                    for g in range(nodes):
                        share = at + (to - at) * (panel + (1.0 + rules[nodes, 0, g]) / 2) / panels
                        weight = factor * unit * unit * ds * (to - at) * rules[nodes, 1, g] / 2 / panels
                        qs = q0 + share * dq
                        x = (u0 + share * du) / qs - i
                        rate = qs / (slope * unit)
                        s, t = s0 + share * ds, t0 + share * dt
                        y = (v0 + share * dv) / qs - j if mode == BLEND else 0.0
                        for side in range(2 if mode == BLEND else 1):
                            row_at = (above if side == 1 else here) + i_here
                            _add_node(
                                s, t, x, rate, weight * (y if side == 1 else 1.0 - y), mode == TEXELS, row_at, texels,
                                primitives, means, degree, grown, out,
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
def _add_node(
    s: float, t: float, x: float, rate: float, weight: float, flat: bool, at: int, texels: FloatArray,
    primitives: FloatArray, means: FloatArray, degree: int, grown: FloatArray, out: FloatArray,
) -> None:  # fmt: skip
    """Add weight s^r A_p at one point of an edge, x of a texel to the right of the border number `at`."""
    for c in range(3):
        mean = means[at, c]
        value = texels[at, c] - mean
        rise = 0.0 if flat else texels[at + 1, c] - texels[at, c]
        scale = 1.0
        for k in range(1, degree + 2):
            # Taylor's polynomial by Horner's rule
            total = value + rise * x * _SHARES[k + 1]
            for m in range(k):
                total = total * x * _SHARES[k - m] + primitives[at, m, c]
            scale *= rate
            grown[0, k] = scale * total
            grown[1, k] = grown[0, k]
        power = 1.0
        for p in range(degree + 1):
            # with G_p,k = t^p F_k - p G_(p-1),(k+1), the sum of the module's head is G_p,1
            if p > 0:
                for k in range(1, degree + 2 - p):
                    grown[1, k] = power * grown[0, k] - p * grown[1, k + 1]
            power *= t
            total = weight * (mean * power * _SHARES[p + 1] + grown[1, 1])
            for r in range(degree + 1 - p):
                out[p, r, c] += total
                total *= s


@allocating
def wave_moments(
    poly: FloatArray, n: int, own: FloatArray, along: FloatArray, rules: FloatArray, place: FloatArray, degree: int,
    out: FloatArray,
) -> None:  # fmt: skip
    """Add the moments of cos(2 pi u) over a fragment to `out` (degree + 1, degree + 1): powers of t and s.

    With the phase w + speed t along a row the primitive of cos t^p is, by parts, a sum of t^(p - k) sines over
    speed^(k + 1); where the phase hardly changes that cancels, and a rule from a fixed t takes its place.
    """
    tx, ty, unit = along[0], along[1], place[2]
    column, _ = cell_of(own, poly, n)
    u, q = own[0] - column * own[2], own[2]
    slope = 2 * np.pi * (u[0] * tx + u[1] * ty) * unit
    lowest, highest, most = np.inf, -np.inf, 0.0
    for k in range(n):
        t = (tx * (poly[k, 0] - place[0]) + ty * (poly[k, 1] - place[1])) / unit
        lowest, highest = min(lowest, t), max(highest, t)
        most = max(most, linear_at(q, poly[k, 0], poly[k, 1]))
    by_parts = abs(slope) / most >= _SLOW
    parts, waves = np.empty(degree + 1), np.empty(degree + 1)
    for k in range(n):
        e = k + 1 if k + 1 < n else 0
        ax, ay, bx, by = poly[k, 0], poly[k, 1], poly[e, 0], poly[e, 1]
        ds = (tx * (by - ay) - ty * (bx - ax)) / unit
        if ds == 0.0:
            continue
        dt = (tx * (bx - ax) + ty * (by - ay)) / unit
        s0 = (tx * (ay - place[1]) - ty * (ax - place[0])) / unit
        t0 = (tx * (ax - place[0]) + ty * (ay - place[1])) / unit
        q0, q1 = linear_at(q, ax, ay), linear_at(q, bx, by)
        u0, u1 = linear_at(u, ax, ay), linear_at(u, bx, by)
        w0 = u0 - slope / (2 * np.pi) * (t0 - lowest)
        w1 = u1 - slope / (2 * np.pi) * (t0 + dt - lowest)
        least = min(q0, q1)
        fastest = max(abs(u1 * q0 - u0 * q1), abs(w1 * q0 - w0 * q1)) / least**2
        panels = 1 + int(min(max(2.0 * fastest, 8.0 * abs(q1 - q0) / least), 1.0 * MOST_PANELS))
        for panel in range(panels):
            for g in range(_WAVE_NODES):
                share = (panel + (1.0 + rules[_WAVE_NODES, 0, g]) / 2) / panels
                qs = q0 + share * (q1 - q0)
                s, t = s0 + share * ds, t0 + share * dt
                speed = slope / qs
                phase = 2 * np.pi * (u0 + share * (u1 - u0)) / qs
                for p in range(degree + 1):
                    parts[p] = 0.0
                if by_parts:
                    # A_p = t^p sin / speed - p / speed (the primitive of t^(p - 1) sin), and so on in turns
                    sine, cosine = np.sin(phase) / speed, np.cos(phase) / speed
                    parts[0], waves[0] = sine, -cosine
                    power = 1.0
                    for p in range(1, degree + 1):
                        power *= t
                        parts[p] = power * sine - p / speed * waves[p - 1]
                        waves[p] = -power * cosine + p / speed * parts[p - 1]
                else:
                    length = t - lowest
                    nodes = min(int(0.4 * abs(speed) * length + 12.0) + degree // 2, rules.shape[0] - 1)
                    for h in range(nodes):
                        far = lowest + length * (1.0 + rules[nodes, 0, h]) / 2
                        wave = rules[nodes, 1, h] / 2 * length * np.cos(phase + speed * (far - t))
                        for p in range(degree + 1):
                            parts[p] += wave
                            wave *= far
                weight = unit * unit * ds * rules[_WAVE_NODES, 1, g] / 2 / panels
                for p in range(degree + 1):
                    total = weight * parts[p]
                    for r in range(degree + 1 - p):
                        out[p, r] += total
                        total *= s


@allocating
def turn_moments(parts: FloatArray, along: FloatArray, degree: int, color: FloatArray, out: FloatArray) -> None:
    """Add moments (degree + 1, degree + 1, 3) of powers of t and s, times a colour, to those of powers of x and y.

    x = tx t - ty s and y = ty t + tx s: a product of a of the one and b of the other.
    """
    tx, ty = along[0], along[1]
    row, work = np.empty(degree + 1), np.empty(degree + 1)
    for a in range(degree + 1):
        # coefficients of t^p s^(a - p) of x^a
        if a == 0:
            row[0] = 1.0
        else:
            row[a] = 0.0
            for p in range(a, -1, -1):
                row[p] = -ty * row[p] + (tx * row[p - 1] if p > 0 else 0.0)
        for p in range(a + 1):
            work[p] = row[p]
        for b in range(degree + 1 - a):
            order = a + b
            if b > 0:
                work[order] = 0.0
                for p in range(order, -1, -1):
                    work[p] = tx * work[p] + (ty * work[p - 1] if p > 0 else 0.0)
            for p in range(order + 1):
                if work[p] != 0.0:
                    for c in range(3):
                        out[a, b, c] += work[p] * parts[p, order - p, c] * color[c]
