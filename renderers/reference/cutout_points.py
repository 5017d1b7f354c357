"""The kernels of `cutout_samples`: which pixels need many points, and what a point of the picture shows."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.renderers.reference.coverage import row_extent
from aliasbench.renderers.reference.runs import BILINEAR, GRID, SINE
from aliasbench.renderers.reference.slabs import nearness_at, tie_of
from aliasbench.renderers.sampling.filters import filter_at
from aliasbench.renderers.sampling.hashing import pattern_key, unit
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]

_MANY_TEXELS = 64  # across which a pixel is not searched


@njit(cache=True, nogil=True, error_model="numpy")
def find_uneven(
    points: FloatArray, starts: IntArray, planes: FloatArray, owners: IntArray, kinds: IntArray, maps: FloatArray,
    sizes: IntArray, offsets: IntArray, alphas: FloatArray, cutoffs: FloatArray, perspective: bool, extent: float,
    support: float, margin: int, rows: IntArray, uneven: NDArray[np.bool_],
) -> None:  # fmt: skip
    """Mark the pixels whose value may jump within the filter's reach."""
    count = len(owners)
    full = np.empty(count, np.int64)
    left, right = np.empty(count), np.empty(count)
    xs, ys = np.empty(4), np.empty(4)
    for row in range(rows[0], rows[1]):
        cy = row + margin + 0.5
        for i in range(count):
            left[i], right[i] = row_extent(points, starts[i], starts[i + 1], cy - support, cy + support)
        for column in range(uneven.shape[1]):
            cx = column + margin + 0.5
            for k in range(4):
                xs[k], ys[k] = cx + support * (2 * (k % 2) - 1), cy + support * (2 * (k // 2) - 1)
            n, jumps = 0, False
            for i in range(count):
                if not (left[i] < cx + support and right[i] > cx - support):
                    continue
                inside = 0
                for k in range(4):
                    inside += int(_holds(points, starts[i], starts[i + 1], xs[k], ys[k]))
                if inside < 4 or _texture_jumps(
                    planes[i], maps[owners[i]], kinds[owners[i]], sizes[owners[i]], offsets[owners[i]], alphas,
                    cutoffs[owners[i]], xs, ys,
                ):  # fmt: skip
                    jumps = True
                    break
                for a in range(n):
                    jumps = jumps or _cross(planes[i, 0], planes[full[a], 0], perspective, extent, xs, ys)
                if jumps:
                    break
                full[n] = i
                n += 1
            uneven[row, column] = jumps


@called
def _cross(
    one: FloatArray, other: FloatArray, perspective: bool, extent: float, xs: FloatArray, ys: FloatArray
) -> bool:
    """Return whether two planes may change their order within four corners."""
    above, below = 0, 0
    for k in range(4):
        v, w = nearness_at(one, xs[k], ys[k]), nearness_at(other, xs[k], ys[k])
        tie = tie_of(perspective, extent, v, w)
        above += int(v - w > tie)
        below += int(w - v > tie)
    return above < 4 and below < 4 and above + below > 0


@allocating
def _texture_jumps(
    plane: FloatArray, to_own: FloatArray, kind: int, size: IntArray, offset: int, alphas: FloatArray, cutoff: float,
    xs: FloatArray, ys: FloatArray,
) -> bool:  # fmt: skip
    """Return whether squares of one texel meet within four corners, or opaque and absent texels of a blend."""
    if kind not in (GRID, BILINEAR) or (kind == BILINEAR and cutoff == -np.inf):
        return False
    shift = 0.5 if kind == BILINEAR else 0.0
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for k in range(4):
        if not nearness_at(plane[3], xs[k], ys[k]) > 0.0:
            return True
        at = _own(plane, to_own, xs[k], ys[k])
        for axis in range(2):
            low[axis], high[axis] = min(low[axis], at[axis] - shift), max(high[axis], at[axis] - shift)
    i0, i1, j0, j1 = np.floor(low[0]), np.floor(high[0]), np.floor(low[1]), np.floor(high[1])
    if kind == GRID:
        return i0 != i1 or j0 != j1
    if i1 - i0 > _MANY_TEXELS or j1 - j0 > _MANY_TEXELS:
        return True
    opaque, absent = False, False
    for j in range(int(j1 - j0) + 2):
        for i in range(int(i1 - i0) + 2):
            at_texel = offset + _wrapped(j0 + j, size[0]) * size[1] + _wrapped(i0 + i, size[1])
            opaque = opaque or alphas[at_texel] >= cutoff
            absent = absent or alphas[at_texel] < cutoff
    return opaque and absent


@njit(cache=True, nogil=True, error_model="numpy")
def sample_rows(
    points: FloatArray, starts: IntArray, planes: FloatArray, owners: IntArray, colors: FloatArray, kinds: IntArray,
    maps: FloatArray, params: FloatArray, sizes: IntArray, offsets: IntArray, texels: FloatArray, alphas: FloatArray,
    cutoffs: FloatArray, perspective: bool, extent: float, weights: FloatArray, support: float, margin: int,
    edges: FloatArray, sides: IntArray, seed: int, frame: int, rows: IntArray, out: FloatArray,
) -> None:  # fmt: skip
    """Add the estimates of rows [rows[0], rows[1]) to `out`; pieces lie `margin` pixels further right and down."""
    width, count = out.shape[1], len(owners)
    ids, cand = np.empty(count, np.int64), np.empty(count, np.int64)
    left, right = np.empty(count), np.empty(count)
    total, value = np.empty(3), np.empty(3)
    for row in range(rows[0], rows[1]):
        cy = row + margin + 0.5
        n = 0
        for i in range(count):
            # empty, (inf, -inf), where the piece does not meet the rows
            lo, hi = row_extent(points, starts[i], starts[i + 1], cy - support, cy + support)
            if lo <= hi:
                ids[n], left[n], right[n] = i, lo, hi
                n += 1
        for column in range(width):
            cx = column + margin + 0.5
            here = 0
            for a in range(n):
                if left[a] < cx + support and right[a] > cx - support:
                    cand[here] = ids[a]
                    here += 1
            total[:] = 0.0
            side = sides[row, column]
            key = pattern_key(seed, frame, column, row)
            for s in range(side * side if here > 0 else 0):
                dx, px = _draw((s % side + unit(key, 2 * s)) / side, edges)
                dy, py = _draw((s // side + unit(key, 2 * s + 1)) / side, edges)
                x, y = cx + dx, cy + dy
                shown, best = -1, 0.0
                for a in range(here):
                    i = cand[a]
                    if not _holds(points, starts[i], starts[i + 1], x, y):
                        continue
                    v = nearness_at(planes[i, 0], x, y)
                    tie = tie_of(perspective, extent, v, best)
                    if shown < 0 or v > best + tie or (v >= best - tie and owners[i] > owners[shown]):
                        owner = owners[i]
                        if cutoffs[owner] > -np.inf and (
                            _alpha(planes[i], maps[owner], kinds[owner], sizes[owner], offsets[owner], alphas, x, y)
                            < cutoffs[owner]
                        ):
                            continue
                        shown, best = i, v
                if shown < 0:
                    continue
                # what differs from the background; the background's own integral is 1
                owner = owners[shown]
                _color(
                    planes[shown], maps[owner], kinds[owner], params[owner], sizes[owner], offsets[owner], texels, x, y,
                    value,
                )  # fmt: skip
                weight = filter_at(weights, dx, dy) / (px * py * side * side)
                for c in range(3):
                    total[c] += weight * (colors[owner, c] * value[c] - colors[-1, c])
            for c in range(3):
                out[row, column, c] += colors[-1, c] + total[c]


@called
def _draw(u: float, edges: FloatArray) -> tuple[float, float]:
    """Return the place along an axis that a number of [0, 1) stands for, and the density there."""
    bins = len(edges) - 1
    at = min(int(u * bins), bins - 1)
    step = edges[at + 1] - edges[at]
    return edges[at] + step * (u * bins - at), 1.0 / (bins * step)


@called
def _holds(points: FloatArray, begin: int, end: int, x: float, y: float) -> bool:
    """Return whether a convex piece holds a point."""
    ax, ay = points[end - 1, 0] - x, points[end - 1, 1] - y
    for k in range(begin, end):
        bx, by = points[k, 0] - x, points[k, 1] - y
        if ax * by - bx * ay < 0.0:
            return False
        ax, ay = bx, by
    return True


@called
def _own(plane: FloatArray, to_own: FloatArray, x: float, y: float) -> tuple[float, float]:
    """Return where a point of the picture lies in a texture's own coordinates."""
    q = nearness_at(plane[3], x, y)
    u, v = nearness_at(plane[1], x, y) / q, nearness_at(plane[2], x, y) / q
    return (
        to_own[0, 0] * u + to_own[0, 1] * v + to_own[0, 2],
        to_own[1, 0] * u + to_own[1, 1] * v + to_own[1, 2],
    )


@called
def _wrapped(index: float, period: int) -> int:
    return int(index - np.floor(index / period) * period) % period


@called
def _corners(u: float, v: float, blend: bool, size: IntArray) -> tuple[int, int, int, int, float, float]:
    """Return the rows and columns of the texels that make up a value, and the shares of the second ones."""
    if not blend:
        i, j = _wrapped(np.floor(u), size[1]), _wrapped(np.floor(v), size[0])
        return i, i, j, j, 0.0, 0.0
    u, v = u - 0.5, v - 0.5
    i, j = np.floor(u), np.floor(v)
    return (
        _wrapped(i, size[1]), _wrapped(i + 1.0, size[1]), _wrapped(j, size[0]), _wrapped(j + 1.0, size[0]), u - i, v - j
    )  # fmt: skip


@called
def _alpha(
    plane: FloatArray, to_own: FloatArray, kind: int, size: IntArray, offset: int, alphas: FloatArray, x: float,
    y: float,
) -> float:  # fmt: skip
    u, v = _own(plane, to_own, x, y)
    i0, i1, j0, j1, s, t = _corners(u, v, kind == BILINEAR, size)
    low, high = offset + j0 * size[1], offset + j1 * size[1]
    return (1 - t) * ((1 - s) * alphas[low + i0] + s * alphas[low + i1]) + t * (
        (1 - s) * alphas[high + i0] + s * alphas[high + i1]
    )


@called
def _color(
    plane: FloatArray, to_own: FloatArray, kind: int, params: FloatArray, size: IntArray, offset: int,
    texels: FloatArray, x: float, y: float, value: FloatArray,
) -> None:  # fmt: skip
    """Write a texture's value at a point of the picture; 1 for none."""
    if kind < 0:
        value[:] = 1.0
        return
    u, v = _own(plane, to_own, x, y)
    if kind in (GRID, BILINEAR):
        i0, i1, j0, j1, s, t = _corners(u, v, kind == BILINEAR, size)
        low, high = offset + j0 * size[1], offset + j1 * size[1]
        for c in range(3):
            value[c] = (1 - t) * ((1 - s) * texels[low + i0, c] + s * texels[low + i1, c]) + t * (
                (1 - s) * texels[high + i0, c] + s * texels[high + i1, c]
            )
        return
    phase = 2 * np.pi * u if kind == SINE else params[6] * (u * u + v * v) + params[7]
    share = (1.0 + np.cos(phase)) / 2
    for c in range(3):
        value[c] = params[c] + (params[3 + c] - params[c]) * share
