"""What stands between a receiver and a light, and the planes at which the view of the light changes its kind.

Seen from a point that moves over a receiver, the visible part of a polygonal light is an analytic function of the
place until a corner of the light passes behind an edge of an occluder, or a corner of an occluder passes before an edge
of the light (Heckbert 1992, discontinuity meshing). Both happen in planes: through a corner and an edge. Cut along
these planes a receiver falls into parts on which quadrature converges like on a polynomial, and on which nothing can
hide between nodes. The same planes tell what needs no work: an occluder is out of the way of everything on the light's
side of a plane that separates the two, and it hides the whole light from what is within all planes through its edges
and the light's corners.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]

SEPARATES, SHADES = 1, 2  # bits of a plane's kind
ROOM = 24  # corners of a clipped light or occluder
FINE = 1e-3  # of what counts as one plane: a sign that close to zero is rounding


class Links(NamedTuple):
    """For every piece and light: which part of the light it may see, and what may be in between.

    Attributes
    ----------
    parts : (pieces, lights) int64
        The part of a light that is above the piece's horizon; -1 for none.
    part_first, part_corners : (p + 1,) int64, (k, 3) float64
    pair_first : (pieces * lights + 1,) int64
        The pairs of piece m and light l: pairs[pair_first[m * lights + l]] and on.
    pairs : (n,) int64
    pair_occluder : (r,) int64
        The occluder of a pair (part of a light, occluder).
    pair_dark : (r,) int64
        Whether (1) an occluder can hide all of the light: it is on one side of the occluder's plane.
    plane_first, planes, kinds : (r + 1,) int64, (q, 4) float64, (q,) int64
        Normal (of length 1) and offset, f(x) = n . x - c; the occluder is where f >= 0 if the plane SEPARATES it from
        the light or runs through one of its edges (SHADES, as its own plane does: the side away from the light).
    occluder_first, occluder_corners : (o + 1,) int64, (k, 3) float64
        Faces clipped to the light's front; for light l and face f occluder l * faces + f.
    """

    parts: IntArray
    part_first: IntArray
    part_corners: FloatArray
    pair_first: IntArray
    pairs: IntArray
    pair_occluder: IntArray
    pair_dark: IntArray
    plane_first: IntArray
    planes: FloatArray
    kinds: IntArray
    occluder_first: IntArray
    occluder_corners: FloatArray


@njit(cache=True, nogil=True, error_model="numpy")
def link_lights(
    world: FloatArray, corners: IntArray, starts: IntArray, quads: FloatArray, light_planes: FloatArray,
    receivers: FloatArray, piece_planes: FloatArray, piece_starts: IntArray, wanted: NDArray[np.bool_], close: float,
) -> Links:  # fmt: skip
    """Return what may be between pieces and lights.

    Parameters
    ----------
    world : (n, 3)
        Vertices; of face f those at corners[starts[f]:starts[f + 1]].
    quads : (lights, 4, 3)
    light_planes : (lights, 4)
        Normal towards the lit side, and offset.
    receivers : (k, 3)
        The corners of the pieces in the world; of piece m those at piece_starts[m]:piece_starts[m + 1].
    piece_planes : (pieces, 4)
        Normal towards the camera, and offset.
    wanted : (pieces,)
        Which pieces are lit.
    close : float
        Nearer than this is in one plane.
    """
    lights, faces, pieces = len(quads), len(starts) - 1, len(piece_planes)
    fine = FINE * close
    occluder_first, occluder_corners = np.zeros(lights * faces + 1, np.int64), np.empty((64, 3))
    widest = ROOM
    for f in range(faces):
        widest = max(widest, starts[f + 1] - starts[f] + 2)
    poly, other = np.empty((widest, 3)), np.empty((widest, 3))
    total = 0
    for light in range(lights):
        for f in range(faces):
            n = starts[f + 1] - starts[f]
            for k in range(n):
                for c in range(3):
                    poly[k, c] = world[corners[starts[f] + k], c]
            n = clip_front(poly, n, light_planes[light], close, other)
            occluder_corners = _append(occluder_corners, total, other, n)
            total += n
            occluder_first[light * faces + f + 1] = total
    parts = np.full((pieces, lights), -1, np.int64)
    part_first, part_corners = np.zeros(lights + pieces * lights + 1, np.int64), np.empty((64, 3))
    # the whole lights come first, and are shared by all that see them whole
    for light in range(lights):
        part_corners = _append(part_corners, 4 * light, quads[light], 4)
        part_first[light + 1] = 4 * light + 4
    part_count, used = lights, 4 * lights
    pair_first, pairs = np.zeros(pieces * lights + 1, np.int64), np.empty(64, np.int64)
    pair_occluder, pair_dark = np.empty(64, np.int64), np.empty(64, np.int64)
    plane_first, planes, kinds = np.zeros(64, np.int64), np.empty((64, 4)), np.empty(64, np.int64)
    found, made, flat = 0, 0, 0
    known = np.full(lights * faces, -1, np.int64)
    trial, trial_kinds = np.empty((64, 4)), np.empty(64, np.int64)
    for m in range(pieces):
        begin, end = piece_starts[m], piece_starts[m + 1]
        for light in range(lights):
            pair_first[m * lights + light] = found
            if not wanted[m] or not _is_before(receivers, begin, end, light_planes[light], close):
                continue
            n = clip_front(quads[light], 4, piece_planes[m], close, other)
            if n == 0:
                continue
            index = light
            if _range(piece_planes[m], quads[light])[0] < 0.0:
                index = part_count
                part_corners = _append(part_corners, used, other, n)
                used += n
                part_count += 1
                part_first[part_count] = used
            parts[m, light] = index
            seen = part_corners[part_first[index] : part_first[index + 1]]
            for f in range(faces):
                o = light * faces + f
                hull = occluder_corners[occluder_first[o] : occluder_first[o + 1]]
                if len(hull) < 3 or not _is_before(hull, 0, len(hull), piece_planes[m], close):
                    continue
                if not _boxes_meet(hull, seen, receivers[begin:end]):
                    continue
                pair = known[o] if index == light else -1
                if pair < 0:
                    need = 2 * len(hull) * len(seen) + 1
                    if need > len(trial):
                        trial, trial_kinds = np.empty((2 * need, 4)), np.empty(2 * need, np.int64)
                    count, dark = event_planes(seen, hull, fine, trial, trial_kinds)
                    if _separated(trial, trial_kinds, 0, count, receivers, begin, end, fine):
                        continue
                    planes = _append(planes, flat, trial, count)
                    for k in range(count):
                        kinds = _append_id(kinds, flat + k, trial_kinds[k])
                    flat += count
                    pair_occluder = _append_id(pair_occluder, made, o)
                    pair_dark = _append_id(pair_dark, made, 1 if dark else 0)
                    plane_first = _append_id(plane_first, made + 1, flat)
                    pair = made
                    made += 1
                    if index == light:
                        known[o] = pair
                elif _separated(
                    planes, kinds, plane_first[pair], plane_first[pair + 1], receivers, begin, end, fine
                ):  # fmt: skip
                    continue
                pairs = _append_id(pairs, found, pair)
                found += 1
    pair_first[pieces * lights] = found
    return Links(
        parts, part_first, part_corners, pair_first, pairs, pair_occluder, pair_dark, plane_first, planes, kinds,
        occluder_first, occluder_corners,
    )  # fmt: skip


@allocating
def event_planes(
    light: FloatArray, hull: FloatArray, close: float, planes: FloatArray, kinds: IntArray
) -> tuple[int, bool]:
    """Write the planes at which a convex occluder changes what is seen of a convex light.

    Returns
    -------
    count : int
        How many; at most twice the product of the numbers of corners, and one.
    dark : bool
        Whether the occluder can hide all of the light.
    """
    count, dark = 0, True
    own = np.empty(4)
    if _plane_through(hull, own):
        # the occluder's own plane: only what it separates from the light is in its shadow
        lowest, highest = _range(own, light)
        if lowest >= -close:
            _flip(own)
        one_side = lowest >= -close or highest <= close
        for c in range(4):
            planes[0, c] = own[c]
        kinds[0] = (SEPARATES | SHADES) if one_side else 0
        dark = one_side
        count = 1
    for i in range(len(light)):
        for e in range(len(hull)):
            if not _plane_of(hull[e], hull[(e + 1) % len(hull)], light[i], close, planes[count]):
                dark = False
                continue
            lowest, highest = _range(planes[count], hull)
            if -lowest > highest:
                _flip(planes[count])
            lowest, highest = _range(planes[count], light)
            kinds[count] = SHADES | (SEPARATES if highest <= close else 0)
            count += 1
    for i in range(len(light)):
        for e in range(len(hull)):
            if not _plane_of(light[i], light[(i + 1) % len(light)], hull[e], close, planes[count]):
                continue
            lowest, highest = _range(planes[count], light)
            if highest > -lowest:
                _flip(planes[count])
            lowest, highest = _range(planes[count], hull)
            kinds[count] = SEPARATES if lowest >= -close else 0
            count += 1
    return count, dark


@called
def clip_front(poly: FloatArray, n: int, plane: FloatArray, close: float, out: FloatArray) -> int:
    """Write the part of a convex polygon in front of a plane; return its size, 0 where it only touches the plane."""
    highest = -np.inf
    for k in range(n):
        highest = max(highest, _height(plane, poly[k]))
    if highest <= close:
        return 0
    size = 0
    d0 = _height(plane, poly[n - 1])
    last = n - 1
    for k in range(n):
        d1 = _height(plane, poly[k])
        if (d0 > 0.0 and d1 < 0.0) or (d0 < 0.0 and d1 > 0.0):
            for c in range(3):
                out[size, c] = poly[last, c] + d0 / (d0 - d1) * (poly[k, c] - poly[last, c])
            size += 1
        if d1 >= 0.0:
            for c in range(3):
                out[size, c] = poly[k, c]
            size += 1
        last, d0 = k, d1
    return size if size > 2 else 0


@called
def _height(plane: FloatArray, p: FloatArray) -> float:
    return plane[0] * p[0] + plane[1] * p[1] + plane[2] * p[2] - plane[3]


@called
def _range(plane: FloatArray, poly: FloatArray) -> tuple[float, float]:
    lowest, highest = np.inf, -np.inf
    for k in range(len(poly)):
        d = _height(plane, poly[k])
        lowest, highest = min(lowest, d), max(highest, d)
    return lowest, highest


@called
def _is_before(poly: FloatArray, begin: int, end: int, plane: FloatArray, close: float) -> bool:
    """Return whether any corner is in front of a plane."""
    highest = -np.inf
    for k in range(begin, end):
        highest = max(highest, _height(plane, poly[k]))
    return highest > close


@called
def _separated(
    planes: FloatArray, kinds: IntArray, first: int, last: int, receivers: FloatArray, begin: int, end: int,
    close: float,
) -> bool:  # fmt: skip
    """Return whether an occluder is out of the way of all of a piece."""
    for p in range(first, last):
        if kinds[p] & SEPARATES and not _is_before(receivers, begin, end, planes[p], close):
            return True
    return False


@called
def _boxes_meet(hull: FloatArray, light: FloatArray, piece: FloatArray) -> bool:
    """Return whether the box of an occluder meets that of all segments between a piece and a light."""
    for c in range(3):
        low, high = np.inf, -np.inf
        for k in range(len(light)):
            low, high = min(low, light[k, c]), max(high, light[k, c])
        for k in range(len(piece)):
            low, high = min(low, piece[k, c]), max(high, piece[k, c])
        nearest, farthest = np.inf, -np.inf
        for k in range(len(hull)):
            nearest, farthest = min(nearest, hull[k, c]), max(farthest, hull[k, c])
        if nearest > high or farthest < low:
            return False
    return True


@called
def _plane_of(a: FloatArray, b: FloatArray, p: FloatArray, close: float, out: FloatArray) -> bool:
    """Write the plane through two points and a third; return False where they are in line."""
    ex, ey, ez = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    px, py, pz = p[0] - a[0], p[1] - a[1], p[2] - a[2]
    nx, ny, nz = ey * pz - ez * py, ez * px - ex * pz, ex * py - ey * px
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    if not length > close * np.sqrt(ex * ex + ey * ey + ez * ez):
        return False
    out[0], out[1], out[2] = nx / length, ny / length, nz / length
    out[3] = out[0] * a[0] + out[1] * a[1] + out[2] * a[2]
    return True


@called
def _plane_through(poly: FloatArray, out: FloatArray) -> bool:
    """Write the plane of a convex polygon (Newell's method); return False for one without area."""
    nx, ny, nz = 0.0, 0.0, 0.0
    for k in range(1, len(poly) - 1):
        ax, ay, az = poly[k, 0] - poly[0, 0], poly[k, 1] - poly[0, 1], poly[k, 2] - poly[0, 2]
        bx, by, bz = poly[k + 1, 0] - poly[0, 0], poly[k + 1, 1] - poly[0, 1], poly[k + 1, 2] - poly[0, 2]
        nx += ay * bz - az * by
        ny += az * bx - ax * bz
        nz += ax * by - ay * bx
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    if not length > 0.0:
        return False
    out[0], out[1], out[2] = nx / length, ny / length, nz / length
    out[3] = out[0] * poly[0, 0] + out[1] * poly[0, 1] + out[2] * poly[0, 2]
    return True


@called
def _flip(plane: FloatArray) -> None:
    for c in range(4):
        plane[c] = -plane[c]


@allocating
def _append(store: FloatArray, used: int, rows: FloatArray, n: int) -> FloatArray:
    """Copy n rows to `store` after the first `used` ones; return it, or a longer one."""
    if used + n > len(store):
        longer = np.empty((2 * (used + n), store.shape[1]))
        for k in range(used):
            for c in range(store.shape[1]):
                longer[k, c] = store[k, c]
        store = longer
    for k in range(n):
        for c in range(store.shape[1]):
            store[used + k, c] = rows[k, c]
    return store


@allocating
def _append_id(store: IntArray, used: int, value: int) -> IntArray:
    """Write one number to `store` after the first `used` ones; return it, or a longer one."""
    if used >= len(store):
        longer = np.zeros(2 * used + 2, np.int64)
        for k in range(used):
            longer[k] = store[k]
        store = longer
    store[used] = value
    return store
