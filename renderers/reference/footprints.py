"""Images whose texels are small against a pixel, seen at a slant: integrals by Green's theorem in texture space.

There a fragment is a polygon too, texels are squares, and the picture's area for a unit of texture is
J = q^3 / det with 1 / q linear in u and v. Cut into slices over which q changes little, J is a polynomial up to
`REMAINDER`, so exact moments of whole rows (`row_moments`) give the integral for one step at each texel that the
outline crosses, where clipping (`tiles`) takes one for each texel within.

Where texels are so small that J hardly changes from one to the next, no polynomial is needed: along a row, by parts,

    integral of f J = mean of the row * integral of J + F1 J - F2 J_u + F3 J_uu - integral of F3 J_uuu,

F_k the primitives of what the row differs from its mean; the last term is left out.

Where even the outline crosses too many, the mean stands for the image. With f = mean + rest, rest = dF / du for a
periodic F, the integral of rest J is that of F J around the outline less that of F dJ/du within: a bound that falls
with the size of texels, and needs nothing but the largest F (`row_bounds`).
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.renderers.reference.fragments import convex_area, copy_corners, cut_convex
from aliasbench.renderers.reference.row_moments import walk_moments
from aliasbench.renderers.reference.surfaces import Surfaces
from aliasbench.renderers.reference.walks import BLEND, TEXELS, cell_of, linear_at, wrap
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]

DEGREE = 6
# What is left of J, relative, and by which share of it q may differ from a slice's middle: 36 x^7 is left then. The
# second where an outline crosses many texels.
REMAINDER, _LOOSE, _MANY = 1e-9, 1e-7, 1000.0
_WIDEST, _WIDER = 0.03, 0.055
_SLOWEST = 1e-3  # relative change of 1 / q over a texel: two nodes to a step leave 1e-15
_LONGEST = 20.0  # rows, in radians of a slice: rounding of their primitives stays below 1e-10, see `smoothed`
_STEP = 8.0  # what a crossing costs against a clip
_TINY = 1e-13  # of det against the products in it: no area in texture space


def row_bounds(surfaces: Surfaces, primitives: FloatArray) -> FloatArray:
    """Return what the mean of each piece's image leaves, (m, 4, 3), channels last.

    Rows: the mean; the largest primitive along a row of what the row differs from its mean; that across rows of what
    the rows' means differ from the image's; and the largest third primitive along a row, given `row_primitives`.
    """
    out = np.zeros((len(surfaces.ways), 4, 3))
    known: dict[int, FloatArray] = {}
    for m, (h, w, first) in enumerate(surfaces.blocks.tolist()):
        if w < 1 or len(surfaces.texels) < first + h * (w + 1):
            continue
        if first not in known:
            image = surfaces.texels[first : first + h * (w + 1)].reshape(h, w + 1, 3)[:, :w]
            mean = image.mean(axis=(0, 1))
            rows = image.mean(axis=1)
            along = _largest_primitive(image - rows[:, None], 1).max(axis=0)
            # within a texel, Taylor's polynomial from its border
            terms = np.abs(primitives[first : first + h * (w + 1), :3]).max(axis=0, initial=0.0).sum(axis=0)
            third = terms + 2 * np.abs(image).max(axis=(0, 1))
            known[first] = np.stack([mean, along, _largest_primitive(rows - mean, 0), third])
        out[m] = known[first]
    return out


def _largest_primitive(rest: FloatArray, axis: int) -> FloatArray:
    """Return the largest primitive, from its best constant, of periodic squares or of blends between their centres."""
    running = np.cumsum(rest, axis=axis)
    span = (np.maximum(running.max(axis=axis), 0.0) - np.minimum(running.min(axis=axis), 0.0)) / 2
    # a blend's is at its centres a mean of neighbours of these, and bulges between by an eighth of its rise
    return span + np.abs(rest).max(axis=axis) / 4


@allocating
def crossings(poly: FloatArray, n: int, own: FloatArray) -> tuple[float, float]:
    """Return how many borders of texels the outline of a fragment crosses, about, and how many texels are within."""
    us, vs = np.empty(n), np.empty(n)
    for k in range(n):
        q = linear_at(own[2], poly[k, 0], poly[k, 1])
        us[k], vs[k] = linear_at(own[0], poly[k, 0], poly[k, 1]) / q, linear_at(own[1], poly[k, 0], poly[k, 1]) / q
    steps, area = 0.0, 0.0
    for k in range(n):
        e = k + 1 if k + 1 < n else 0
        steps += abs(us[e] - us[k]) + abs(vs[e] - vs[k])
        area += (us[k] - us[0]) * (vs[e] - vs[0]) - (us[e] - us[0]) * (vs[k] - vs[0])
    return steps, abs(area) / 2


@njit(cache=True, nogil=True, error_model="numpy")
def add_mean(poly: FloatArray, n: int, own: FloatArray, bounds: FloatArray, value: FloatArray) -> float:
    """Add the mean's integral over a fragment to `value` (3,) and return its bound; where that is inf, add nothing.

    Parameters
    ----------
    bounds : (3, 3)
        Of the piece, see `row_bounds`.
    """
    area = convex_area(poly, n)
    column, row = cell_of(own, poly, n)
    u, v, q = own[0] - column * own[2], own[1] - row * own[2], own[2]
    det = _determinant(u, v, q)
    along, across, most_q, least_q = 0.0, 0.0, 0.0, np.inf
    u0, v0 = 0.0, 0.0
    length = 0.0
    for k in range(n + 1):
        e = k if k < n else 0
        qe = linear_at(q, poly[e, 0], poly[e, 1])
        u1, v1 = linear_at(u, poly[e, 0], poly[e, 1]) / qe, linear_at(v, poly[e, 0], poly[e, 1]) / qe
        if k > 0:
            along, across = along + abs(u1 - u0), across + abs(v1 - v0)
            length += np.hypot(poly[e, 0] - poly[k - 1, 0], poly[e, 1] - poly[k - 1, 1])
        u0, v0 = u1, v1
        most_q, least_q = max(most_q, qe), min(least_q, qe)
    largest = 0.0
    if abs(det) > _TINY * _size(u, v, q):
        density = most_q**3 / abs(det)
        wu, wv = (v[0] * q[1] - v[1] * q[0]) / det, (q[0] * u[1] - q[1] * u[0]) / det
        by_rows = density * across + 3 * abs(wu) * most_q * area
        by_means = density * along + 3 * abs(wv) * most_q * area
        for c in range(3):
            largest = max(largest, bounds[1, c] * by_rows + bounds[2, c] * by_means)
    elif own[1, 0] == 0.0 and own[1, 1] == 0.0 and own[1, 2] == 0.0:
        # f depends on u alone. Along a direction d, 1 / u_t = q^2 / N with N constant on each line along d
        x, y = 0.0, 0.0
        for k in range(n):
            x += poly[k, 0] / n
            y += poly[k, 1] / n
        at, near = linear_at(u, x, y), linear_at(q, x, y)
        dx, dy = u[0] * near - at * q[0], u[1] * near - at * q[1]
        size = np.hypot(dx, dy)
        dx, dy = dx / size, dy / size
        ut, qt = u[0] * dx + u[1] * dy, q[0] * dx + q[1] * dy
        low, high = np.inf, -np.inf
        for k in range(n):
            steep = ut * linear_at(q, poly[k, 0], poly[k, 1]) - linear_at(u, poly[k, 0], poly[k, 1]) * qt
            low, high = min(low, steep), max(high, steep)
        least = min(abs(low), abs(high)) if low * high > 0.0 else 0.0
        share = (length * most_q**2 + 2 * area * most_q * abs(qt)) / least if least > 0.0 else np.inf
        for c in range(3):
            largest = max(largest, bounds[1, c] * share)
    else:
        return np.inf
    if largest < np.inf:
        for c in range(3):
            value[c] += area * bounds[0, c]
    return largest


@called
def _determinant(u: FloatArray, v: FloatArray, q: FloatArray) -> float:
    return u[0] * (v[1] * q[2] - v[2] * q[1]) - u[1] * (v[0] * q[2] - v[2] * q[0]) + u[2] * (v[0] * q[1] - v[1] * q[0])


@called
def _size(u: FloatArray, v: FloatArray, q: FloatArray) -> float:
    """Return the sum of what a determinant adds up, without signs."""
    return (
        abs(u[0]) * (abs(v[1] * q[2]) + abs(v[2] * q[1]))
        + abs(u[1]) * (abs(v[0] * q[2]) + abs(v[2] * q[0]))
        + abs(u[2]) * (abs(v[0] * q[1]) + abs(v[1] * q[0]))
    )


@njit(cache=True, nogil=True, error_model="numpy")
def add_footprint(
    poly: FloatArray, n: int, own: FloatArray, bilinear: bool, block: IntArray, texels: FloatArray,
    primitives: FloatArray, means: FloatArray, third: FloatArray, rules: FloatArray, value: FloatArray,
) -> float:  # fmt: skip
    """Add the integral of an image over a fragment to `value` (3,); return the share that is off, -1 if not done.

    Parameters as in `row_moments.walk_moments`.
    """
    steps, within = crossings(poly, n, own)
    if within < _STEP * steps:
        return -1.0
    column, row = cell_of(own, poly, n)
    u, v, q = own[0] - column * own[2], own[1] - row * own[2], own[2]
    det = _determinant(u, v, q)
    if abs(det) <= 1e4 * _TINY * _size(u, v, q):
        return -1.0
    wu, wv = (v[0] * q[1] - v[1] * q[0]) / det, (q[0] * u[1] - q[1] * u[0]) / det
    low, high = np.inf, 0.0
    for k in range(n):
        at = linear_at(q, poly[k, 0], poly[k, 1])
        low, high = min(low, at), max(high, at)
    remainder = REMAINDER if steps < _MANY else _LOOSE
    change = 60 * abs(wu * high) ** 3 * third.max()
    if not bilinear and change <= remainder and max(abs(wu), abs(wv)) * high <= _SLOWEST:
        _add_dense(poly, n, own, block, texels, primitives, means, value)
        return float(change)
    # 1 / q runs evenly in texture space; from slice to slice it changes by a factor
    slices = 1 + int(np.log(high / low) / (2 * (_WIDEST if steps < _MANY else _WIDER)))
    kept = DEGREE + 1
    parts = np.empty((kept, kept, 3))
    rest, spare, part, there = np.empty((n + 8, 2)), np.empty((n + 8, 2)), np.empty((n + 8, 2)), np.empty((n + 8, 2))
    straight, along, place, sums = np.zeros((3, 3)), np.zeros(2), np.empty(3), np.zeros(3)
    straight[0, 0], straight[1, 1], straight[2, 2] = 1.0, 1.0, 1.0
    straight[0, 2], straight[1, 2] = column, row
    along[0] = 1.0
    size = n
    copy_corners(poly, n, rest)
    for k in range(slices):
        count = size
        if k + 1 < slices:
            level = low * (high / low) ** ((k + 1) / slices)
            size, count = cut_convex(rest, size, q[0], q[1], q[2] - level, 0.0, 0.0, spare, part)
            rest, spare = spare, rest
        else:
            copy_corners(rest, size, part)
        if count == 0:
            continue
        left, right, top, bottom, near, far = np.inf, -np.inf, np.inf, -np.inf, np.inf, 0.0
        for e in range(count):
            at = linear_at(q, part[e, 0], part[e, 1])
            there[e, 0] = linear_at(u, part[e, 0], part[e, 1]) / at
            there[e, 1] = linear_at(v, part[e, 0], part[e, 1]) / at
            left, right = min(left, there[e, 0]), max(right, there[e, 0])
            top, bottom = min(top, there[e, 1]), max(bottom, there[e, 1])
            near, far = min(near, 1.0 / at), max(far, 1.0 / at)
        place[0], place[1], place[2] = (left + right) / 2, (top + bottom) / 2, max(right - left, bottom - top) / 2
        if not block[1] <= _LONGEST * 2 * np.pi * place[2]:
            return -1.0
        # 1 / q at the centre: from any corner
        w = 1.0 / linear_at(q, part[0, 0], part[0, 1])
        w += wu * (place[0] - there[0, 0]) + wv * (place[1] - there[0, 1])
        change = max(far - w, w - near) / w
        degree = 0
        while degree < DEGREE and (degree + 2) * (degree + 3) / 2 * change ** (degree + 1) > remainder / 2:
            degree += 1
        for a in range(kept):
            for b in range(kept):
                for c in range(3):
                    parts[a, b, c] = 0.0
        walk_moments(
            there, count, straight, along, BLEND if bilinear else TEXELS, block, texels, primitives, means, rules,
            place, degree, 1.0, parts,
        )  # fmt: skip
        gu, gv = wu * place[2] / w, wv * place[2] / w
        scale = 1.0 / (det * w**3)
        # (1 + e)^-3 with e = gu u + gv v
        for order in range(degree + 1):
            term = scale * (order + 1) * (order + 2) / 2 * (1.0 - 2.0 * (order % 2))
            choose = 1.0
            for p in range(order + 1):
                weight = term * choose * gu**p * gv ** (order - p)
                for c in range(3):
                    sums[c] += weight * parts[p, order - p, c]
                choose = choose * (order - p) / (p + 1)
    for c in range(3):
        value[c] += sums[c]
    return remainder


@allocating
def _add_dense(
    poly: FloatArray, n: int, own: FloatArray, block: IntArray, texels: FloatArray, primitives: FloatArray,
    means: FloatArray, value: FloatArray,
) -> None:  # fmt: skip
    """Add the integral of squares over a fragment to `value` (3,), J changing slowly."""
    height, width, offset = block[0], block[1], block[2]
    column, row = cell_of(own, poly, n)
    u, v, q = own[0] - column * own[2], own[1] - row * own[2], own[2]
    first_column, first_row = wrap(column, width), wrap(row, height)
    det = _determinant(u, v, q)
    wu = (v[0] * q[1] - v[1] * q[0]) / det
    for k in range(n):
        e = k + 1 if k + 1 < n else 0
        q0, q1 = linear_at(q, poly[k, 0], poly[k, 1]), linear_at(q, poly[e, 0], poly[e, 1])
        u0, u1 = linear_at(u, poly[k, 0], poly[k, 1]) / q0, linear_at(u, poly[e, 0], poly[e, 1]) / q1
        v0, v1 = linear_at(v, poly[k, 0], poly[k, 1]) / q0, linear_at(v, poly[e, 0], poly[e, 1]) / q1
        du, dv, w0, dw = u1 - u0, v1 - v0, 1.0 / q0, 1.0 / q1 - 1.0 / q0
        if dv == 0.0:
            continue
        i, j, last_i, last_j = np.floor(u0), np.floor(v0), np.floor(u1), np.floor(v1)
        up_i, up_j = (1.0 if last_i > i else 0.0), (1.0 if last_j > j else 0.0)
        next_u = (i + up_i - u0) / du if i != last_i else np.inf
        next_v = (j + up_j - v0) / dv if j != last_j else np.inf
        in_row = offset + wrap(first_row + j, height) * (width + 1)
        at = in_row + wrap(first_column + i, width)
        begin = 0.0
        while True:
            end = max(begin, min(next_u, next_v, 1.0))
            if end > begin:
                for side in range(2):
                    share = begin + (end - begin) * (0.5 + (side - 0.5) * 0.5773502691896257)
                    x = u0 + share * du
                    w = w0 + share * dw
                    # 1 / q in the same row where u is 0
                    back = w - wu * x
                    weight = dv * (end - begin) / (2 * det * w * w)
                    even, dense, rate = weight * (w + back) * x / (2 * back * back), weight / w, wu / w
                    x -= i
                    for c in range(3):
                        mean = means[at, c]
                        rest = texels[at, c] - mean
                        one, two, three = primitives[at, 0, c], primitives[at, 1, c], primitives[at, 2, c]
                        three += x * (two + x * (one / 2 + x * rest / 6))
                        two += x * (one + x * rest / 2)
                        one += x * rest
                        value[c] += even * mean + dense * (one + rate * (3 * two + 12 * rate * three))
            begin = end
            if begin >= 1.0:
                break
            if next_u <= next_v:
                i += 2.0 * up_i - 1.0
                next_u = (i + up_i - u0) / du if i != last_i else np.inf
            else:
                j += 2.0 * up_j - 1.0
                next_v = (j + up_j - v0) / dv if j != last_j else np.inf
                in_row = offset + wrap(first_row + j, height) * (width + 1)
            at = in_row + wrap(first_column + i, width)
