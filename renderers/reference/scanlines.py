"""Pictures of textured pieces: exact integrals along horizontal lines, a few of which sample each row of pixels.

Along a line the picture is a run of visible spans, and a texture made of constant squares is a run of texels whose ends
are known in closed form under perspective too; so only the vertical direction is sampled, and N lines err like N^-1.5
instead of N^-0.75. Strata end where corners lie, so horizontal edges cost nothing.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.renderers.reference.cells import sort_prefix
from aliasbench.renderers.reference.runs import BILINEAR, add_flat, add_smooth, add_texels, along_line
from aliasbench.renderers.reference.slabs import TIE
from aliasbench.renderers.sampling.hashing import combine, pattern_key, permute, unit
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]

_MOST_LINES = 8  # times the asked-for number, in rows that texels crowd


@njit(cache=True, nogil=True, error_model="numpy")
def scan_rows(
    points: FloatArray, starts: IntArray, planes: FloatArray, owners: IntArray, instants: IntArray,
    colors: FloatArray, kinds: IntArray, maps: FloatArray, params: FloatArray, sizes: IntArray, offsets: IntArray,
    texels: FloatArray, perspective: bool, extent: float, lines: int, seed: int, frame: int, rows: IntArray,
    out: FloatArray,
) -> None:  # fmt: skip
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
                            here = max(here, min(2 * asked, _MOST_LINES * lines))
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


@called
def _level_lines(
    plane: FloatArray, own: FloatArray, shift: float, row: int, width: int, knots: FloatArray, m: int,
) -> tuple[int, int]:  # fmt: skip
    """Add to the knots of a row the heights where one texture coordinate passes whole numbers all along the row.

    So a plane seen without roll has its rows of texels cut exactly. Nothing is added where the coordinate changes along
    the row, or where the knots have no room left. Returns the new number of knots, and the lines that the row deserves.
    """
    a, top = along_line(plane, own, float(row))
    _, bottom = along_line(plane, own, row + 1.0)
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


@allocating
def _line(
    points: FloatArray, starts: IntArray, planes: FloatArray, owners: IntArray, colors: FloatArray, kinds: IntArray,
    maps: FloatArray, params: FloatArray, sizes: IntArray, offsets: IntArray, texels: FloatArray, perspective: bool,
    extent: float, ids: IntArray, n: int, y: float, weight: float, key: int, out: FloatArray,
) -> None:  # fmt: skip
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
            add_flat(colors[owner], x0, x1, weight, out)
        elif kinds[owner] <= BILINEAR:
            add_texels(
                planes[shown], maps[owner], kinds[owner] == BILINEAR, sizes[owner], offsets[owner], texels,
                colors[owner], x0, x1, y, weight, combine(key, k), out,
            )  # fmt: skip
        else:
            add_smooth(
                planes[shown], maps[owner], kinds[owner], params[owner], colors[owner], x0, x1, y, weight,
                combine(key, k), out,
            )  # fmt: skip


@called
def _chord(points: FloatArray, begin: int, end: int, y: float) -> tuple[float, float]:
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
