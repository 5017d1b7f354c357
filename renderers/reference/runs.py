"""One visible span of a line, added to the pixels it crosses: flat, texel by texel, or at stratified points."""

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.renderers.sampling.hashing import combine, unit
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]

GRID, BILINEAR, SINE, ZONE = 0, 1, 2, 3
_MANY_TEXELS = 24.0  # across one pixel: from here on stratified points along the line take over
_POINTS = 16


@called
def add_flat(color: FloatArray, x0: float, x1: float, weight: float, out: FloatArray) -> None:
    for column in range(int(x0), min(int(np.ceil(x1)), out.shape[0])):
        share = weight * (min(x1, column + 1.0) - max(x0, float(column)))
        for c in range(3):
            out[column, c] += share * color[c]


@called
def along_line(plane: FloatArray, row: FloatArray, y: float) -> tuple[float, float]:
    """Return the slope and the value at x = 0 of (row . (u, v, 1)) q along a line."""
    slope = row[0] * plane[1, 0] + row[1] * plane[2, 0] + row[2] * plane[3, 0]
    start = (
        row[0] * (plane[1, 1] * y + plane[1, 2])
        + row[1] * (plane[2, 1] * y + plane[2, 2])
        + row[2] * (plane[3, 1] * y + plane[3, 2])
    )
    return slope, start


@allocating
def add_texels(
    plane: FloatArray, to_grid: FloatArray, bilinear: bool, size: IntArray, offset: int, texels: FloatArray,
    color: FloatArray, x0: float, x1: float, y: float, weight: float, key: int, out: FloatArray,
) -> None:  # fmt: skip
    """Add a span of an image: texel by texel, or at stratified points where texels are many to a pixel."""
    ua, ub = along_line(plane, to_grid[0], y)
    va, vb = along_line(plane, to_grid[1], y)
    qa, qb = plane[3, 0], plane[3, 1] * y + plane[3, 2]
    if bilinear:
        # between the centres of four texels the blend is one polynomial
        ua, ub, va, vb = ua - 0.5 * qa, ub - 0.5 * qb, va - 0.5 * qa, vb - 0.5 * qb
    value = np.zeros(3)
    for column in range(int(x0), min(int(np.ceil(x1)), out.shape[0])):
        x, end = max(x0, float(column)), min(x1, column + 1.0)
        if end <= x:
            continue
        q0, q1 = qa * x + qb, qa * end + qb
        u, u1 = (ua * x + ub) / q0, (ua * end + ub) / q1
        v, v1 = (va * x + vb) / q0, (va * end + vb) / q1
        value[:] = 0.0
        many = abs(u1 - u) + abs(v1 - v)
        if bilinear or many > _MANY_TEXELS:
            # a blend is continuous: a few stratified points do what needs every texel's end otherwise
            stream = combine(key, column)
            nodes = min(_POINTS, 2 + int(many))
            for s in range(nodes):
                p = x + (end - x) * (s + unit(stream, s)) / nodes
                q = qa * p + qb
                _look_up((ua * p + ub) / q, (va * p + vb) / q, bilinear, size, offset, texels, (end - x) / nodes, value)
        else:
            i, j = np.floor(u), np.floor(v)
            iu, jv = (1.0 if u1 > u else 0.0), (1.0 if v1 > v else 0.0)
            xu = _crossing(ua, ub, qa, qb, i + iu, u1 != u)
            xv = _crossing(va, vb, qa, qb, j + jv, v1 != v)
            iw, jw = _wrap(i, size[1]), _wrap(j, size[0])
            while x < end:
                nearest = max(x, min(xu, xv, end))
                at = offset + jw * size[1] + iw
                for c in range(3):
                    value[c] += (nearest - x) * texels[at, c]
                x = nearest
                if x >= end:
                    break
                if xu <= xv:
                    i += 2.0 * iu - 1.0
                    iw = _next(iw, iu, size[1])
                    xu = _crossing(ua, ub, qa, qb, i + iu, True)
                else:
                    j += 2.0 * jv - 1.0
                    jw = _next(jw, jv, size[0])
                    xv = _crossing(va, vb, qa, qb, j + jv, True)
        for c in range(3):
            out[column, c] += weight * color[c] * value[c]


@called
def _crossing(a: float, b: float, qa: float, qb: float, level: float, moves: bool) -> float:
    """Return the x where (a x + b) / (qa x + qb) reaches a level, inf where it does not move."""
    slope = a - level * qa
    if not moves or slope == 0.0:
        return np.inf
    return (level * qb - b) / slope


@called
def _wrap(index: float, period: int) -> int:
    return int(index - np.floor(index / period) * period) % period


@called
def _next(index: int, forward: float, period: int) -> int:
    if forward > 0.5:
        return index + 1 if index + 1 < period else 0
    return index - 1 if index > 0 else period - 1


@called
def _look_up(
    u: float, v: float, bilinear: bool, size: IntArray, offset: int, texels: FloatArray, share: float,
    value: FloatArray,
) -> None:  # fmt: skip
    i, j = np.floor(u), np.floor(v)
    iw, jw = _wrap(i, size[1]), _wrap(j, size[0])
    row = offset + jw * size[1]
    if not bilinear:
        for c in range(3):
            value[c] += share * texels[row + iw, c]
        return
    s, t = u - i, v - j
    right = _next(iw, 1.0, size[1])
    above = offset + _next(jw, 1.0, size[0]) * size[1]
    for c in range(3):
        low = (1 - s) * texels[row + iw, c] + s * texels[row + right, c]
        high = (1 - s) * texels[above + iw, c] + s * texels[above + right, c]
        value[c] += share * ((1 - t) * low + t * high)


@called
def add_smooth(
    plane: FloatArray, to_own: FloatArray, kind: int, params: FloatArray, color: FloatArray, x0: float, x1: float,
    y: float, weight: float, key: int, out: FloatArray,
) -> None:  # fmt: skip
    """Add a span of a sine grating or a zone plate, at stratified points."""
    ua, ub = along_line(plane, to_own[0], y)
    va, vb = along_line(plane, to_own[1], y)
    qa, qb = plane[3, 0], plane[3, 1] * y + plane[3, 2]
    for column in range(int(x0), min(int(np.ceil(x1)), out.shape[0])):
        x, end = max(x0, float(column)), min(x1, column + 1.0)
        if end <= x:
            continue
        stream = combine(key, column)
        mean = 0.0
        for s in range(_POINTS):
            p = x + (end - x) * (s + unit(stream, s)) / _POINTS
            q = qa * p + qb
            u, v = (ua * p + ub) / q, (va * p + vb) / q
            phase = 2 * np.pi * u if kind == SINE else params[6] * (u * u + v * v) + params[7]
            mean += (1.0 + np.cos(phase)) / 2 / _POINTS
        for c in range(3):
            out[column, c] += weight * (end - x) * color[c] * (params[c] + (params[3 + c] - params[c]) * mean)
