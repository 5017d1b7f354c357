"""Irradiance from the visible part of a polygonal light, closed: Lambert's formula over an exact polygon difference.

Seen from a point x, a convex occluder hides the cone of directions within the planes through x and its edges. Those
planes cut the light polygon into convex parts; the parts outside are kept, each is cut by the next occluder, and what
is left of the light adds 1/2 sum theta_i n . gamma_i (Lambert 1760; Arvo 1995, eq. 2): theta_i the angle that an edge
spans at x, gamma_i the unit normal of the plane through x and that edge. Nothing is projected, so nothing is far away:
an occluder may reach behind x, touch the receiver or cross the light.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]

CORNERS = 48  # room for the corners of a part of a light
_EDGE_ON = 1e-13  # an occluder's plane as near to x as that, relative to its distance, hides nothing


@njit(cache=True, nogil=True, error_model="numpy")
def lambert(poly: FloatArray, n: int, normal: FloatArray) -> float:
    """Return the irradiance at the origin from a convex polygon (n, 3) of radiance 1, all above the horizon.

    The corners run counter-clockwise as seen from the origin, which is on the lit side.
    """
    total = 0.0
    ax, ay, az = poly[n - 1, 0], poly[n - 1, 1], poly[n - 1, 2]
    for k in range(n):
        bx, by, bz = poly[k, 0], poly[k, 1], poly[k, 2]
        # a x b as a x (b - a): a short edge far away keeps its digits
        ex, ey, ez = bx - ax, by - ay, bz - az
        cx, cy, cz = ay * ez - az * ey, az * ex - ax * ez, ax * ey - ay * ex
        length = math.sqrt(cx * cx + cy * cy + cz * cz)
        if length > 0.0:
            angle = math.atan2(length, ax * bx + ay * by + az * bz)
            total -= angle / length * (normal[0] * cx + normal[1] * cy + normal[2] * cz)
        ax, ay, az = bx, by, bz
    return 0.5 * total


@called
def visible_irradiance(
    x: FloatArray, normal: FloatArray, light: FloatArray, active: IntArray, count: int, first: IntArray,
    corners: FloatArray, stack: FloatArray, marks: IntArray,
) -> float:  # fmt: skip
    """Return the irradiance at x from a light of radiance 1, less what occluders hide.

    Parameters
    ----------
    x : (3,) float64
        In front of the light.
    normal : (3,) float64
        The receiver's, of length 1.
    light : (n, 3) float64
        Convex, counter-clockwise from its lit side, all above the receiver's horizon.
    active : (count,) int64
        Which occluders count.
    first, corners : (k + 1,) int64, (m, 3) float64
        The convex occluders, all in front of the light's plane.
    stack : (r, CORNERS, 3) float64
        Room for r >= `stack_room` parts.
    marks : (r, 2) int64
    """
    n = len(light)
    for k in range(n):
        for c in range(3):
            stack[0, k, c] = light[k, c] - x[c]
    if count == 0:
        return lambert(stack[0], n, normal)
    marks[0, 0], marks[0, 1] = n, 0
    top = 1
    total = 0.0
    spare = len(stack) - 1  # the part being cut lies here
    while top > 0:
        top -= 1
        n, order = marks[top, 0], marks[top, 1]
        if order == count:
            total += lambert(stack[top], n, normal)
            continue
        begin, end = first[active[order]], first[active[order] + 1]
        side = _side(x, corners, begin, end)
        if side == 0.0:
            marks[top, 1] = order + 1
            top += 1
            continue
        _copy(stack[top], n, stack[spare])
        for e in range(begin, end):
            j = e + 1 if e + 1 < end else begin
            px, py, pz = corners[e, 0] - x[0], corners[e, 1] - x[1], corners[e, 2] - x[2]
            qx, qy, qz = corners[j, 0] - corners[e, 0], corners[j, 1] - corners[e, 1], corners[j, 2] - corners[e, 2]
            nx, ny, nz = side * (py * qz - pz * qy), side * (pz * qx - px * qz), side * (px * qy - py * qx)
            if n + 2 > CORNERS:
                # more corners than there is room for: in two, along a diagonal
                half = n // 2
                _copy(stack[spare], half + 1, stack[top])
                marks[top, 0], marks[top, 1] = half + 1, order
                top += 1
                for k in range(half, n):
                    for c in range(3):
                        stack[spare, 1 + k - half, c] = stack[spare, k, c]
                n = n - half + 1
            n, out = _cut(stack[spare], n, nx, ny, nz, stack[top])
            if out > 0:
                marks[top, 0], marks[top, 1] = out, order + 1
                top += 1
            if n == 0:
                break
    return total


@called
def stack_room(active: IntArray, count: int, first: IntArray) -> int:
    """Return how many parts of a light there may be at a time."""
    room = 4
    for k in range(count):
        room += 2 * (first[active[k] + 1] - first[active[k]])
    return room


@called
def _side(x: FloatArray, corners: FloatArray, begin: int, end: int) -> float:
    """Return which way round an occluder's corners run, seen from x: 1 or -1; 0 where it is seen edge-on."""
    nx, ny, nz = 0.0, 0.0, 0.0
    for k in range(begin + 1, end - 1):
        ax, ay = corners[k, 0] - corners[begin, 0], corners[k, 1] - corners[begin, 1]
        az = corners[k, 2] - corners[begin, 2]
        bx, by = corners[k + 1, 0] - corners[begin, 0], corners[k + 1, 1] - corners[begin, 1]
        bz = corners[k + 1, 2] - corners[begin, 2]
        nx += ay * bz - az * by
        ny += az * bx - ax * bz
        nz += ax * by - ay * bx
    px, py, pz = corners[begin, 0] - x[0], corners[begin, 1] - x[1], corners[begin, 2] - x[2]
    height = nx * px + ny * py + nz * pz
    size = math.sqrt((nx * nx + ny * ny + nz * nz) * (px * px + py * py + pz * pz))
    if abs(height) <= _EDGE_ON * size:
        return 0.0
    return 1.0 if height > 0.0 else -1.0


@called
def _copy(poly: FloatArray, n: int, out: FloatArray) -> None:
    for k in range(n):
        out[k, 0], out[k, 1], out[k, 2] = poly[k, 0], poly[k, 1], poly[k, 2]


@allocating
def _cut(poly: FloatArray, n: int, nx: float, ny: float, nz: float, outside: FloatArray) -> tuple[int, int]:
    """Keep in `poly` the part of a polygon with n . v >= 0 and write the other; return their sizes."""
    lowest, highest = np.inf, -np.inf
    for k in range(n):
        d = nx * poly[k, 0] + ny * poly[k, 1] + nz * poly[k, 2]
        lowest, highest = min(lowest, d), max(highest, d)
    if lowest >= 0.0:
        return n, 0
    if highest <= 0.0:
        _copy(poly, n, outside)
        return 0, n
    inside = np.empty((CORNERS, 3))
    ni, no = 0, 0
    last = n - 1
    d0 = nx * poly[last, 0] + ny * poly[last, 1] + nz * poly[last, 2]
    for k in range(n):
        d1 = nx * poly[k, 0] + ny * poly[k, 1] + nz * poly[k, 2]
        if (d0 > 0.0 and d1 < 0.0) or (d0 < 0.0 and d1 > 0.0):
            s = d0 / (d0 - d1)
            for c in range(3):
                value = poly[last, c] + s * (poly[k, c] - poly[last, c])
                inside[ni, c] = value
                outside[no, c] = value
            ni += 1
            no += 1
        if d1 >= 0.0:
            for c in range(3):
                inside[ni, c] = poly[k, c]
            ni += 1
        if d1 <= 0.0:
            for c in range(3):
                outside[no, c] = poly[k, c]
            no += 1
        last, d0 = k, d1
    _copy(inside, ni, poly)
    return (ni if ni > 2 else 0), (no if no > 2 else 0)
