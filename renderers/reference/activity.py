"""Which pixels may change within a slice of the open shutter: the facts that make its integral certain.

A pixel is active in a slice if a moving outline may come near it, if two planes may change their order in it, or if
something may come into the picture that cannot be followed; anything else shows the same all through the slice. All
from the middle of the slice and bounds on speeds, so that nothing is missed between the instants that are looked at.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.renderers.reference.coverage import row_extent
from aliasbench.renderers.reference.placement import Movers, place_faces, room_for
from aliasbench.renderers.reference.slabs import TIE
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

_LIKELY = 0.6  # of the bound on an edge's speed across itself, where it need not be certain
_FOLLOWED_PX = 8.0  # way within a slice up to which the margin round the picture lets edges be followed


class Slices(NamedTuple):
    """The slices of the shutter, each with the scene's pieces at its middle.

    Attributes
    ----------
    begins, lengths : (s,) float64
        In frame intervals.
    points, reach, outlined, starts, planes, owners, faces
        Of the `Pieces` of all slices.
    instants : (s + 1,) int64
        The pieces of slice i: instants[i] to instants[i + 1].
    loose, loose_speeds, loose_starts : (k,) int64, (k,) float64 and (s + 1,) int64
        `Pieces.loose` of slice i: loose[loose_starts[i] : loose_starts[i + 1]]; and their speeds.
    across : (k,) float64
        How fast the edge that starts at a corner moves across itself, at most, as `reach`.
    near, low, high, steep, turns : (m,) float64
        Of every piece: how far it may move, and least and greatest y, within the slice; size of its nearness'
        gradient; and a bound on its angular speed against the camera, radians per frame interval.
    kinds : (objects,) int64
        Equal for objects that move alike.
    contrasts : (objects,) float64
        The largest colour step against anything else.
    camera : (3,) float64
        Scale and the picture's middle.
    perspective : bool
    extent : float
        The scene's size, for ties of depth.
    """

    begins: FloatArray
    lengths: FloatArray
    points: FloatArray
    reach: FloatArray
    outlined: BoolArray
    starts: IntArray
    planes: FloatArray
    owners: IntArray
    faces: IntArray
    instants: IntArray
    loose: IntArray
    loose_speeds: FloatArray
    loose_starts: IntArray
    across: FloatArray
    near: FloatArray
    low: FloatArray
    high: FloatArray
    steep: FloatArray
    turns: FloatArray
    kinds: IntArray
    contrasts: FloatArray
    camera: FloatArray
    perspective: bool
    extent: float


class Marks(NamedTuple):
    """One row of pixels in one slice.

    Attributes
    ----------
    edges : (w,) int64
        How many outlines come near; a corner counts for two more.
    speed : (w,) float64
        Of what comes near, at most, pixels per frame interval: the geometric mean of the speeds along and across it,
        whose square, times that of a time, is about what a corner covers in it.
    active, restless : (w,) bool
        Whether the pixel may change, and whether planes in it may change their order.
    left, right : (pieces,) float64
        Between which columns each of the slice's pieces may be; empty: left > right.
    """

    edges: IntArray
    speed: FloatArray
    active: BoolArray
    restless: BoolArray
    left: FloatArray
    right: FloatArray


@njit(cache=True, nogil=True, error_model="numpy")
def describe_pieces(slices: Slices) -> None:
    """Fill `near`, `low`, `high` and `steep`."""
    scale, cx, cy = slices.camera
    for s in range(len(slices.begins)):
        for i in range(slices.instants[s], slices.instants[s + 1]):
            fastest, top, bottom = 0.0, np.inf, -np.inf
            for k in range(slices.starts[i], slices.starts[i + 1]):
                fastest = max(fastest, slices.reach[k])
                top, bottom = min(top, slices.points[k, 1]), max(bottom, slices.points[k, 1])
            near = fastest * slices.lengths[s] / 2 + 1e-9
            slices.near[i], slices.low[i], slices.high[i] = near, top - near, bottom + near
            p = slices.planes[i, 0]
            gx, gy = p[0] * scale, p[1] * scale
            g1 = p[2] + p[0] * cx + p[1] * cy if slices.perspective else 1.0
            slices.steep[i] = np.sqrt(gx * gx + gy * gy + g1 * g1)


def measure_across(slices: Slices, movers: Movers) -> None:
    """Fill `across` from where edges are as their slice begins and ends.

    With a speed v and an acceleration a the way from the middle is v t + a t^2 / 2: the longer of both ways over half
    the slice is at least half of the largest speed times that, and no way is longer in between.
    """
    widest = int(np.diff(slices.instants).max(initial=0))
    room = room_for(widest, movers.widest)
    slices.across[:] = 0.0
    for s in range(len(slices.begins)):
        first, last = slices.instants[s], slices.instants[s + 1]
        if first == last:
            continue
        corners = slice(slices.starts[first], slices.starts[last])
        starts = slices.starts[first : last + 1] - slices.starts[first]
        following = np.arange(1, starts[-1] + 1)
        following[starts[1:] - 1] = starts[:-1]
        points = slices.points[corners]
        along = points[following] - points
        length = np.hypot(along[:, 0], along[:, 1])
        for end in (0.0, 1.0):
            m = place_faces(
                movers, slices.faces[first:last], last - first, slices.begins[s] + end * slices.lengths[s], room
            )
            if m != last - first or not np.array_equal(room.starts[: m + 1], starts):
                slices.across[corners] = np.inf
                break
            way = room.points[: starts[-1]] - points
            far = np.abs(along[:, 0] * way[:, 1] - along[:, 1] * way[:, 0])
            # of the edge's other end
            on = way[following]
            far = np.maximum(far, np.abs(along[:, 0] * on[:, 1] - along[:, 1] * on[:, 0]))
            with np.errstate(divide="ignore", invalid="ignore"):
                speed = 4.0 * far / (length * slices.lengths[s])
            speed[~(speed < np.inf)] = np.inf
            slices.across[corners] = np.maximum(slices.across[corners], speed)
    np.minimum(slices.across, slices.reach, out=slices.across)


@allocating
def mark_row(slices: Slices, s: int, row: int, width: int, marks: Marks) -> None:
    """Fill the marks of a row in slice s."""
    marks.edges[:] = 0
    marks.speed[:] = 0.0
    marks.active[:] = False
    marks.restless[:] = False
    first, last, length = slices.instants[s], slices.instants[s + 1], slices.lengths[s]
    here = np.empty(last - first, np.int64)
    count = 0
    for i in range(first, last):
        a = i - first
        marks.left[a], marks.right[a] = np.inf, -np.inf
        if not (slices.low[i] < row + 1 and slices.high[i] > row):
            continue
        near = slices.near[i]
        if not near < _FOLLOWED_PX / 2:
            marks.left[a], marks.right[a] = 0.0, float(width)
        else:
            lo, hi = row_extent(slices.points, slices.starts[i], slices.starts[i + 1], row - near, row + 1 + near)
            marks.left[a], marks.right[a] = lo - near, hi + near
        if marks.left[a] < width and marks.right[a] > 0.0:
            here[count] = i
            count += 1
            _mark_edges(slices, i, length, row, width, marks)
    for k in range(slices.loose_starts[s], slices.loose_starts[s + 1]):
        marks.active[:] = True
        for column in range(width):
            marks.edges[column] += 2
            marks.speed[column] = max(marks.speed[column], slices.loose_speeds[k])
    for second in range(1, count):
        for first_of_two in range(second):
            i, j = here[first_of_two], here[second]
            if slices.near[i] <= 1e-9 and slices.near[j] <= 1e-9:
                continue
            low = max(marks.left[i - first], marks.left[j - first], 0.0)
            high = min(marks.right[i - first], marks.right[j - first], float(width))
            if low >= high:
                continue
            begin, end = int(low), int(np.ceil(high))
            if not _may_swap(slices, i, j, length, begin, end, row):
                continue
            for column in range(begin, end):
                if _may_swap(slices, i, j, length, column, column + 1, row):
                    marks.restless[column] = True
                    marks.active[column] = True


@allocating
def _mark_edges(slices: Slices, i: int, length: float, row: int, width: int, marks: Marks) -> None:
    """Mark what the outlines of one piece come near."""
    starts, points = slices.starts, slices.points
    if slices.contrasts[slices.owners[i]] == 0.0:
        return
    for k in range(starts[i], starts[i + 1]):
        if not slices.outlined[k]:
            continue
        j = k + 1 if k + 1 < starts[i + 1] else starts[i]
        speed = slices.reach[k]
        if not speed * length < _FOLLOWED_PX:
            # faster than the margin round the picture allows to follow
            marks.active[:] = True
            for column in range(width):
                marks.edges[column] += 2
                marks.speed[column] = max(marks.speed[column], speed)
            continue
        # a hair more than the way in half a slice
        near = speed * length / 2 + 1e-9
        x0, y0, x1, y1 = points[k, 0], points[k, 1], points[j, 0], points[j, 1]
        ta, tb = within(y0, y1, row - near, row + 1 + near)
        if ta > tb:
            continue
        dx, dy = x1 - x0, y1 - y0
        # a pixel's half diagonal across the edge, and how far the edge gets across itself
        broad = (abs(dx) + abs(dy)) / 2 + (slices.across[k] * length / 2 + 1e-9) * np.sqrt(dx * dx + dy * dy)
        speed = np.sqrt(speed * slices.across[k] * _LIKELY)
        xa, xb = x0 + ta * (x1 - x0), x0 + tb * (x1 - x0)
        left = max(0, int(np.floor(max(min(xa, xb) - near, -1.0))))
        right = min(width - 1, int(np.floor(min(max(xa, xb) + near, float(width)))))
        for column in range(left, right + 1):
            sa, sb = within(x0, x1, column - near, column + 1 + near)
            sa, sb = max(sa, ta), min(sb, tb)
            if sa > sb or abs(dx * (row + 0.5 - y0) - dy * (column + 0.5 - x0)) > broad:
                continue
            marks.edges[column] += 3 if sa <= 0.0 or sb >= 1.0 else 1
            if speed > 0.0:
                marks.active[column] = True
                marks.speed[column] = max(marks.speed[column], speed)


@called
def within(a: float, b: float, low: float, high: float) -> tuple[float, float]:
    """Return the range of t in [0, 1] in which a + t (b - a) lies in [low, high], a little widened."""
    if abs(b - a) < 1e-9:
        return (0.0, 1.0) if a >= low - 1e-9 and a <= high + 1e-9 else (1.0, 0.0)
    t, u = (low - a) / (b - a), (high - a) / (b - a)
    if t > u:
        t, u = u, t
    return max(0.0, t - 1e-9), min(1.0, u + 1e-9)


@called
def _may_swap(slices: Slices, i: int, j: int, length: float, x0: int, x1: int, row: int) -> bool:
    """Return whether two planes may change their order over columns [x0, x1) of a row.

    The line in which two planes of one body meet moves with the body.
    """
    p, q = slices.planes[i, 0], slices.planes[j, 0]
    perspective, extent = slices.perspective, slices.extent
    scale, center_x, center_y = slices.camera
    low, high, flat = np.inf, -np.inf, True
    rate = 0.0
    for corner in range(4):
        cx, cy = x1 if corner % 2 else x0, row + corner // 2
        v, w = p[0] * cx + p[1] * cy + p[2], q[0] * cx + q[1] * cy + q[2]
        low, high = min(low, v - w), max(high, v - w)
        flat = flat and abs(v - w) <= TIE * (max(abs(v), abs(w)) if perspective else extent)
        ray = np.sqrt(1.0 + ((cx - center_x) / scale) ** 2 + ((cy - center_y) / scale) ** 2) if perspective else 1.0
        change = _change(v, slices.steep[i], slices.near[i], slices.turns[i], ray, perspective, scale, length)
        change += _change(w, slices.steep[j], slices.near[j], slices.turns[j], ray, perspective, scale, length)
        rate = max(rate, change)
    if slices.kinds[slices.owners[i]] == slices.kinds[slices.owners[j]] and flat:
        return False
    return not (low - rate > 0.0 or high + rate < 0.0)


@called
def _change(
    nearness: float, steep: float, near: float, turn: float, ray: float, perspective: bool, scale: float, length: float,
) -> float:  # fmt: skip
    """Return a bound on how much a plane's nearness at a fixed point changes within half a slice.

    A plane moving at V changes the depth along an axis at V / cos; half as much again covers what the tilt and the
    distance change meanwhile, as long as that is little.
    """
    if near <= 1e-9:
        return 0.0
    if perspective:
        if not nearness > 0.0:
            return np.inf
        tilt = turn * length * ray * steep / nearness + 2 * near / scale * steep / nearness
    else:
        tilt = turn * length * steep
    return 1.5 * steep * near / scale if tilt < 0.25 else np.inf
