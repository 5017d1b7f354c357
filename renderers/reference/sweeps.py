"""A certified bound, of second order, on the shutter's time integral where everything keeps its depth.

As in `shutter` the picture is averaged over slices, each shown as it is at its middle. A pixel's rate of change is the
sum over edges of (colour step) times (speed across the edge), integrated along what is seen of the edge in the pixel.
Over a slice of length h with a rate that stays within D of its value at the middle, the mean is off by at most
D h / 4. For edges of turning and sliding bodies D is small:

* At one place of the body, the speed across its edge changes by angular speed times the body's sliding speed, times
  time.
* What is seen at one place of the edge changes only if a side of the pixel, or an edge that moves in another way,
  passes over that place: then they are closer at the middle than both can move in half a slice. The length of such
  places is read off strips about those lines, and counts with the speed and twice the colour step.

Edges that move alike never pass over one another, so corners cost nothing; slices with a strip are few, and their
strips narrow, so the bound falls as 1 / n^2. Never is it worse than the bound of first order (`shutter`), of which it
takes the least, edge by edge.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.reference.shutter import SQRT2, within
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


@njit(cache=True, nogil=True, error_model="numpy")
def bound_sweeps(
    points: FloatArray, speeds: FloatArray, reach: FloatArray, outlined: BoolArray, starts: IntArray,
    owners: IntArray, instants: IntArray, contrasts: FloatArray, kinds: IntArray, turns: FloatArray, length: float,
    weight: float, rows: IntArray, out: FloatArray,
) -> None:  # fmt: skip
    """Add the slices' error bounds to rows [rows[0], rows[1]) of `out` (h, w); arguments as in `shutter`."""
    width = out.shape[1]
    head = np.full((rows[1] - rows[0], width), -1, np.int64)
    # what comes near which pixel: edge's corners, piece, the next in the pixel's list, row, column
    room = 1024
    nearby = np.empty((room, 6), np.int64)
    span = np.empty((room, 2))
    for t in range(len(instants) - 1):
        count = 0
        for i in range(instants[t], instants[t + 1]):
            step = contrasts[owners[i]] * weight
            for k in range(starts[i], starts[i + 1]):
                if not outlined[k] or step == 0.0:
                    continue
                j = k + 1 if k + 1 < starts[i + 1] else starts[i]
                if not reach[k] * length < 8.0:
                    # faster than the margin round the picture allows to follow
                    out[rows[0] : rows[1]] += step
                    continue
                near = reach[k] * length / 2 + 1e-9
                x0, y0, x1, y1 = points[k, 0], points[k, 1], points[j, 0], points[j, 1]
                first = max(rows[0], int(np.floor(min(y0, y1) - near)))
                last = min(rows[1] - 1, int(np.floor(max(y0, y1) + near)))
                for row in range(first, last + 1):
                    ta, tb = within(y0, y1, row - near, row + 1 + near)
                    if ta > tb:
                        continue
                    xa, xb = x0 + ta * (x1 - x0), x0 + tb * (x1 - x0)
                    left = max(0, int(np.floor(max(min(xa, xb) - near, -1.0))))
                    right = min(width - 1, int(np.floor(min(max(xa, xb) + near, float(width)))))
                    for column in range(left, right + 1):
                        sa, sb = within(x0, x1, column - near, column + 1 + near)
                        sa, sb = max(sa, ta), min(sb, tb)
                        if sa > sb:
                            continue
                        if count == room:
                            room *= 2
                            more, wider = np.empty((room, 6), np.int64), np.empty((room, 2))
                            more[:count], wider[:count] = nearby, span
                            nearby, span = more, wider
                        nearby[count, 0], nearby[count, 1], nearby[count, 2] = k, j, i
                        nearby[count, 3] = head[row - rows[0], column]
                        nearby[count, 4], nearby[count, 5] = row, column
                        span[count, 0], span[count, 1] = sa, sb
                        head[row - rows[0], column] = count
                        count += 1
        for e in range(count):
            row, column = nearby[e, 4], nearby[e, 5]
            k, i = nearby[e, 0], nearby[e, 2]
            if reach[k] > 0.0:
                at = head[row - rows[0], column]
                out[row, column] += contrasts[owners[i]] * weight * _off(
                    points, speeds, reach, owners, kinds, turns, length, nearby, e, span[e, 0], span[e, 1], at
                )  # fmt: skip
        for e in range(count):
            head[nearby[e, 4] - rows[0], nearby[e, 5]] = -1


@njit(cache=True, nogil=True, error_model="numpy")
def _off(
    points: FloatArray, speeds: FloatArray, reach: FloatArray, owners: IntArray, kinds: IntArray, turns: FloatArray,
    length: float, nearby: IntArray, e: int, sa: float, sb: float, at: int,
) -> float:  # fmt: skip
    """Return a bound on how far a slice's mean is off because of one edge in one pixel, in colour steps."""
    k, j, owner = nearby[e, 0], nearby[e, 1], owners[nearby[e, 2]]
    row, column = nearby[e, 4], nearby[e, 5]
    x0, y0, x1, y1 = points[k, 0], points[k, 1], points[j, 0], points[j, 1]
    long = np.sqrt((x1 - x0) ** 2 + (y1 - y0) ** 2)
    v0, v1 = speeds[k, 0], speeds[k, 1]
    speed = max(v0 + sa * (v1 - v0), v0 + sb * (v1 - v0))
    plain = min(1.0, SQRT2 / 4 * speed * length)
    near = reach[k] * length / 2 + 1e-9
    strips = 0.0
    for side in range(2):
        a, b = within(x0, x1, column + side - near, column + side + near)
        strips += max(0.0, min(b, sb) - max(a, sa))
        a, b = within(y0, y1, row + side - near, row + side + near)
        strips += max(0.0, min(b, sb) - max(a, sa))
    while at >= 0:
        o, p, other = nearby[at, 0], nearby[at, 1], owners[nearby[at, 2]]
        at = nearby[at, 3]
        if kinds[other] == kinds[owner]:
            continue
        ox, oy = points[p, 0] - points[o, 0], points[p, 1] - points[o, 1]
        size = np.sqrt(ox * ox + oy * oy)
        close = near + reach[o] * length / 2 + 1e-9
        if not size > 1e-9:
            strips = np.inf
            break
        d0 = ((x0 - points[o, 0]) * oy - (y0 - points[o, 1]) * ox) / size
        d1 = ((x1 - points[o, 0]) * oy - (y1 - points[o, 1]) * ox) / size
        a, b = within(d0, d1, -close, close)
        lo, hi = max(a, sa), min(b, sb)
        # along the other edge, too, it has to come near
        l0 = ((x0 - points[o, 0]) * ox + (y0 - points[o, 1]) * oy) / size
        l1 = ((x1 - points[o, 0]) * ox + (y1 - points[o, 1]) * oy) / size
        a, b = within(l0, l1, -close, size + close)
        strips += max(0.0, min(b, hi) - max(a, lo))
    drift = turns[owner] * reach[k] * length / 2
    rate = 2.0 * (speed + drift) * strips * long + min(SQRT2 + 4.0 * near, (sb - sa) * long) * drift
    return min(plain, rate * length / 4)
