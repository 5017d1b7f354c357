"""The radiance that a light causes at a point of the picture, and what kernels need of an instant for that.

Points are taken relative to the camera, so that rounding is of the size of what is seen.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import called
from aliasbench.renderers.reference.irradiance import visible_irradiance
from aliasbench.renderers.reference.occluders import Links
from aliasbench.renderers.reference.runs import BILINEAR, GRID, SINE
from aliasbench.renderers.reference.walks import wrap
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int64]

SHOWN, LIT, COATED = 0, 1, 2  # what a piece needs: nothing (it is in the exact picture), light, its texture alone


class Stage(NamedTuple):
    """Everything of an instant that a point of the picture needs to be shaded.

    Attributes
    ----------
    perspective : bool
    center : (2,) float64
        Where the axis meets the picture.
    scale : float
    unproject : (3, 3) float64
        From camera coordinates to the world relative to the camera.
    modes, objects : (m,) int64
        SHOWN, LIT or COATED, and the object, of every piece.
    normals : (m, 3) float64
        Towards the camera.
    light_planes, radiance : (l, 4), (l, 3) float64
    colors : (objects + 1, 3) float64
    kinds, maps, params, sizes, offsets, texels
        Of textures, see `texture_tables`.
    """

    perspective: bool
    center: FloatArray
    scale: float
    unproject: FloatArray
    modes: IntArray
    objects: IntArray
    normals: FloatArray
    light_planes: FloatArray
    radiance: FloatArray
    colors: FloatArray
    kinds: IntArray
    maps: FloatArray
    params: FloatArray
    sizes: IntArray
    offsets: IntArray
    texels: FloatArray
    brightest: FloatArray


@called
def place_of(stage: Stage, plane: FloatArray, x: float, y: float, out: FloatArray) -> float:
    """Write the place of a picture point on a piece, relative to the camera; return q (see `pieces`)."""
    a, b = (x - stage.center[0]) / stage.scale, (stage.center[1] - y) / stage.scale
    near = plane[0] * x + plane[1] * y + plane[2]
    if stage.perspective:
        px, py, pz = a / near, b / near, 1.0 / near
    else:
        px, py, pz = a, b, -near
    u = stage.unproject
    for c in range(3):
        out[c] = u[c, 0] * px + u[c, 1] * py + u[c, 2] * pz
    return near if stage.perspective else 1.0


@called
def coat_at(stage: Stage, planes: FloatArray, piece: int, x: float, y: float, out: FloatArray) -> None:
    """Write colour times texture at a point of the picture."""
    obj = stage.objects[piece]
    kind = stage.kinds[obj]
    for c in range(3):
        out[c] = stage.colors[obj, c]
    if kind < 0:
        return
    p, own = planes[piece], stage.maps[obj]
    q = p[3, 0] * x + p[3, 1] * y + p[3, 2]
    s = (p[1, 0] * x + p[1, 1] * y + p[1, 2]) / q
    t = (p[2, 0] * x + p[2, 1] * y + p[2, 2]) / q
    u = own[0, 0] * s + own[0, 1] * t + own[0, 2]
    v = own[1, 0] * s + own[1, 1] * t + own[1, 2]
    if kind in (GRID, BILINEAR):
        h, w, first = stage.sizes[obj, 0], stage.sizes[obj, 1], stage.offsets[obj]
        if kind == GRID:
            at = first + wrap(math.floor(v), h) * w + wrap(math.floor(u), w)
            for c in range(3):
                out[c] *= stage.texels[at, c]
            return
        i, j = math.floor(u - 0.5), math.floor(v - 0.5)
        a, b = u - 0.5 - i, v - 0.5 - j
        i0, i1, j0, j1 = wrap(i, w), wrap(i + 1.0, w), wrap(j, h), wrap(j + 1.0, h)
        for c in range(3):
            low = (1 - a) * stage.texels[first + j0 * w + i0, c] + a * stage.texels[first + j0 * w + i1, c]
            high = (1 - a) * stage.texels[first + j1 * w + i0, c] + a * stage.texels[first + j1 * w + i1, c]
            out[c] *= (1 - b) * low + b * high
        return
    table = stage.params[obj]
    wave = math.cos(2 * math.pi * u) if kind == SINE else math.cos(table[6] * (u * u + v * v) + table[7])
    for c in range(3):
        out[c] *= (table[c] + table[3 + c]) / 2 + (table[3 + c] - table[c]) / 2 * wave


@called
def shade(
    stage: Stage, links: Links, planes: FloatArray, piece: int, light: int, part: FloatArray, x: float, y: float,
    active: IntArray, here: int, stack: FloatArray, marks: IntArray, world: FloatArray, value: FloatArray,
) -> None:  # fmt: skip
    """Write the radiance of a piece at a point of the picture that one light causes; -1: of its texture alone."""
    coat_at(stage, planes, piece, x, y, value)
    if light < 0:
        return
    place_of(stage, planes[piece, 0], x, y, world)
    lp = stage.light_planes[light]
    share = 0.0
    if lp[0] * world[0] + lp[1] * world[1] + lp[2] * world[2] > lp[3]:
        share = visible_irradiance(
            world, stage.normals[piece], part, active, here, links.occluder_first, links.occluder_corners, stack, marks
        ) / math.pi  # fmt: skip
    for c in range(3):
        value[c] *= share * stage.radiance[light, c]
