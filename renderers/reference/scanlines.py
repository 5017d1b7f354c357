"""Pictures of textured pieces: exact integrals along horizontal lines, a few of which sample each row of pixels.

Along a line the picture is a run of visible spans, and a texture made of constant squares is a run of texels whose ends
are known in closed form under perspective too; so only the vertical direction is sampled, and the error of N lines falls
like N^-1.5 instead of that of N points. Strata end where corners lie, so horizontal edges cost nothing.
"""

import numpy as np
from numba import njit

from aliasbench.renderers.reference.cells import sort_prefix
from aliasbench.renderers.reference.coverage import TIE
from aliasbench.renderers.sampling.hashing import combine, pattern_key, permute, unit

GRID, BILINEAR, SINE, ZONE = 0, 1, 2, 3
_MANY_TEXELS = 24.0  # across one pixel: from here on stratified points along the line take over
_POINTS = 16
_MOST_LINES = 16  # times the asked-for number, in rows that texels crowd


@njit(cache=True, nogil=True)
def scan_rows(
    points, starts, planes, owners, instants, colors, kinds, maps, params, sizes, offsets, texels,
    perspective, extent, lines, seed, frame, rows, out,
):  # type: ignore[no-untyped-def]  # fmt: skip
    """Add the mean over the lines to rows [rows[0], rows[1]) of `out` (h, w, 3).

    Parameters
    ----------
    colors : (objects + 1, 3)
        The last row is the background.
    kinds : (objects,) int64
        The kind of texture, -1 for none.
    maps : (objects, 2, 3)
        From (u, v, 1) to the texture's own coordinates: texels, cycles, or the distance from the zone plate's centre.
    params : (objects, 8)
        Of smooth textures: low, high (3 each); or k and phase.
    sizes, offsets : (objects, 2), (objects,) int64
        Height and width of an image, and its first row in `texels` (n, 3).
    lines : int
        For each instant and row; more where rows of texels crowd.
    """
    width = out.shape[1]
    times = len(instants) - 1
    total = lines * times
    for row in range(rows[0], rows[1]):
        key = pattern_key(seed, frame, -2, row)
        for t in range(times):
            n, m, here = 0, 2, lines
            ids = np.empty(instants[t + 1] - instants[t], np.int64)
            knots = np.empty(2 + lines + 3 * _MOST_LINES * lines)
            knots[0], knots[1] = row, row + 1.0
            for i in range(instants[t], instants[t + 1]):
                ys = points[starts[i] : starts[i + 1], 1]
                if ys.min() < row + 1 and ys.max() > row:
                    ids[n] = i
                    n += 1
                    if times == 1 and m < lines:
                        for y in ys:
                            if row < y < row + 1:
                                knots[m] = y
                                m += 1
            if n == 0:
                for column in range(width):
                    for c in range(3):
                        out[row, column, c] += colors[-1, c] / times
                continue
            if times == 1:
                for a in range(n):
                    owner = owners[ids[a]]
                    if 0 <= kinds[owner] <= BILINEAR:
                        shift = 0.5 if kinds[owner] == BILINEAR else 0.0
                        for axis in range(2):
                            m, asked = _level_lines(planes[ids[a]], maps[owner, axis], shift, row, width, knots, m)
                            here = max(here, min(4 * asked, _MOST_LINES * lines))
            sort_prefix(knots, m)
            index = 0
            for k in range(1, m):
                high = knots[k] - knots[k - 1]
                count = lines if times > 1 else int(np.ceil(here * high - 1e-9))
                for s in range(count):
                    if times > 1:
                        place = permute(t * lines + s, total, combine(key, 1))
                        y = row + (place + unit(key, place)) / total
                        weight = 1.0 / total
                    else:
                        y = knots[k - 1] + high * (s + unit(key, index)) / count
                        weight = high / count
                    index += 1
                    _line(
                        points, starts, planes, owners, colors, kinds, maps, params, sizes, offsets, texels,
                        perspective, extent, ids, n, y, weight, combine(key, 7 + t * lines + index), out[row],
                    )  # fmt: skip


@njit(cache=True, nogil=True)
def _level_lines(plane, own, shift, row, width, knots, m):  # type: ignore[no-untyped-def]
    """Add to the knots of a row the heights where one texture coordinate passes whole numbers all along the row.

    So a plane seen without roll has its rows of texels cut exactly. Nothing is added where the coordinate changes along
    the row, or where the knots have no room left. Returns the new number of knots, and the lines that the row deserves.
    """
    a, top = _affine(plane, own, float(row))
    _, bottom = _affine(plane, own, row + 1.0)
    q0, q1 = plane[3, 1] * row + plane[3, 2], plane[3, 1] * (row + 1) + plane[3, 2]
    least = min(q0, q1)
    if not least > 0.0 or abs(a) * width > 1e-7 * least or abs(plane[3, 0]) * width > 1e-10 * least:
        return m, 0
    first, last = top / q0 - shift, bottom / q1 - shift
    low, high = np.ceil(min(first, last)), np.floor(max(first, last))
    asked = int(min(high - low + 1.0, 1e6))
    if m + asked > len(knots):
        return m, asked
    level = low
    while level <= high:
        value = level + shift
        slope = bottom - top - value * (q1 - q0)
        if slope != 0.0:
            y = row + (value * q0 - top) / slope
            if row < y < row + 1:
                knots[m] = y
                m += 1
        level += 1.0
    return m, asked


@njit(cache=True, nogil=True)
def _line(
    points, starts, planes, owners, colors, kinds, maps, params, sizes, offsets, texels,
    perspective, extent, ids, n, y, weight, key, out,
):  # type: ignore[no-untyped-def]  # fmt: skip
    """Add the picture along one line, times weight, to a row of pixels."""
    width = float(out.shape[0])
    on = np.empty(n, np.int64)
    spans = np.empty((n, 2))
    count = 0
    for a in range(n):
        lo, hi = _chord(points, starts[ids[a]], starts[ids[a] + 1], y)
        if lo < hi and lo < width and hi > 0.0:
            on[count], spans[count, 0], spans[count, 1] = ids[a], max(lo, 0.0), min(hi, width)
            count += 1
    xs = np.empty(2 + 2 * count + count * (count - 1) // 2)
    m = 2
    xs[0], xs[1] = 0.0, width
    for a in range(count):
        xs[m], xs[m + 1] = spans[a, 0], spans[a, 1]
        m += 2
        for b in range(a):
            lo, hi = max(spans[a, 0], spans[b, 0]), min(spans[a, 1], spans[b, 1])
            d = planes[on[a], 0] - planes[on[b], 0]
            if lo < hi and d[0] != 0.0:
                x = -(d[1] * y + d[2]) / d[0]
                if lo < x < hi:
                    xs[m] = x
                    m += 1
    sort_prefix(xs, m)
    for k in range(1, m):
        x0, x1 = xs[k - 1], xs[k]
        if x1 <= x0:
            continue
        middle = (x0 + x1) / 2
        shown, best = -1, 0.0
        for a in range(count):
            if spans[a, 0] <= middle <= spans[a, 1]:
                p = planes[on[a], 0]
                v = p[0] * middle + p[1] * y + p[2]
                tie = TIE * (max(abs(v), abs(best)) if perspective else extent)
                if shown < 0 or v > best + tie or (v >= best - tie and owners[on[a]] > owners[shown]):
                    shown, best = on[a], v
        owner = owners[shown] if shown >= 0 else -1
        if owner < 0 or kinds[owner] < 0:
            _flat(colors[owner], x0, x1, weight, out)
        elif kinds[owner] <= BILINEAR:
            _texels(
                planes[shown], maps[owner], kinds[owner] == BILINEAR, sizes[owner], offsets[owner], texels,
                colors[owner], x0, x1, y, weight, combine(key, k), out,
            )  # fmt: skip
        else:
            _smooth(
                planes[shown], maps[owner], kinds[owner], params[owner], colors[owner], x0, x1, y, weight,
                combine(key, k), out,
            )  # fmt: skip


@njit(cache=True, nogil=True)
def _chord(points, begin, end, y):  # type: ignore[no-untyped-def]
    """Return where a convex piece begins and ends along a line; empty (1, 0) where it does not meet it."""
    lo, hi = np.inf, -np.inf
    for k in range(begin, end):
        j = k + 1 if k + 1 < end else begin
        x0, y0, x1, y1 = points[k, 0], points[k, 1], points[j, 0], points[j, 1]
        if (y0 <= y) != (y1 <= y):
            # from the upper end whichever piece asks
            if y0 > y1:
                x0, y0, x1, y1 = x1, y1, x0, y0
            x = x0 + (y - y0) / (y1 - y0) * (x1 - x0)
            lo, hi = min(lo, x), max(hi, x)
    return lo, hi


@njit(cache=True, nogil=True)
def _flat(color, x0, x1, weight, out):  # type: ignore[no-untyped-def]
    for column in range(int(x0), min(int(np.ceil(x1)), out.shape[0])):
        share = weight * (min(x1, column + 1.0) - max(x0, float(column)))
        for c in range(3):
            out[column, c] += share * color[c]


@njit(cache=True, nogil=True)
def _affine(plane, row, y):  # type: ignore[no-untyped-def]
    """Return the slope and the value at x = 0 of (row . (u, v, 1)) q along a line."""
    slope = row[0] * plane[1, 0] + row[1] * plane[2, 0] + row[2] * plane[3, 0]
    start = (
        row[0] * (plane[1, 1] * y + plane[1, 2])
        + row[1] * (plane[2, 1] * y + plane[2, 2])
        + row[2] * (plane[3, 1] * y + plane[3, 2])
    )
    return slope, start


@njit(cache=True, nogil=True)
def _texels(plane, to_grid, bilinear, size, offset, texels, color, x0, x1, y, weight, key, out):  # type: ignore[no-untyped-def]
    """Add a span of an image: texel by texel, or at stratified points where texels are many to a pixel."""
    ua, ub = _affine(plane, to_grid[0], y)
    va, vb = _affine(plane, to_grid[1], y)
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


@njit(cache=True, nogil=True)
def _crossing(a, b, qa, qb, level, moves):  # type: ignore[no-untyped-def]
    """Return the x where (a x + b) / (qa x + qb) reaches a level, inf where it does not move."""
    slope = a - level * qa
    if not moves or slope == 0.0:
        return np.inf
    return (level * qb - b) / slope


@njit(cache=True, nogil=True)
def _wrap(index, period):  # type: ignore[no-untyped-def]
    return int(index - np.floor(index / period) * period) % period


@njit(cache=True, nogil=True)
def _next(index, forward, period):  # type: ignore[no-untyped-def]
    if forward > 0.5:
        return index + 1 if index + 1 < period else 0
    return index - 1 if index > 0 else period - 1


@njit(cache=True, nogil=True)
def _look_up(u, v, bilinear, size, offset, texels, share, value):  # type: ignore[no-untyped-def]
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


@njit(cache=True, nogil=True)
def _smooth(plane, to_own, kind, params, color, x0, x1, y, weight, key, out):  # type: ignore[no-untyped-def]
    """Add a span of a sine grating or a zone plate, at stratified points."""
    ua, ub = _affine(plane, to_own[0], y)
    va, vb = _affine(plane, to_own[1], y)
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
