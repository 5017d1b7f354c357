"""What a texture is worth at a place: analytic ones exactly, images and baked chains from their mip levels.

The formulas of `scenes.textures` and of OpenGL, for 16 lanes at once where all are of one object, or lane by lane.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import called, inlined
from aliasbench.renderers.raytrace.ewa import ewa_color
from aliasbench.renderers.raytrace.lanes import BLUE, GREEN, LANES, LOD, R_RIGHT, R_UP, RED, S_RIGHT, S_UP, U, V
from aliasbench.renderers.sampling.rare import compiled_if_rare
from aliasbench.renderers.sampling.trig import cos_turns
from aliasbench.scenes.model import FloatArray

if TYPE_CHECKING:
    from aliasbench.renderers.raytrace.shading import Tables

# Values of an object: colour, kind of texture, what that kind needs, below which alpha it is absent (-inf: none), and
# how it answers light (`paths`).
COLOR, KIND, PLACE, LOW, SPAN, PHASE, RATE, LEVEL, LEVELS, UV_MATRIX, CUTOFF = 0, 3, 4, 6, 9, 12, 13, 14, 15, 16, 22
MATERIAL, ROUGHNESS, CAUCHY_A, CAUCHY_B, OBJECT_SIZE = 23, 24, 25, 26, 27
PLAIN, CHECKER, SINE, SQUARE, ZONE = 0.0, 1.0, 2.0, 3.0, 4.0
NEAREST, MIPMAP, TRILINEAR, EWA = 5.0, 6.0, 7.0, 8.0

IndexArray = NDArray[np.int64]
TexelArray = NDArray[np.float32]


@inlined
def _checker_share(u: float, v: float, across: float, up: float) -> float:
    count = np.floor(u * across) + np.floor(v * up)
    return count - 2.0 * np.floor(count * 0.5)


@inlined
def _wave(u: float, v: float, across: float, up: float, phase: float) -> float:
    return cos_turns(u * across + v * up + phase)


@inlined
def _rings(u: float, v: float, center_u: float, center_v: float, rate: float, phase: float) -> float:
    x, y = u - center_u, v - center_v
    return cos_turns((x * x + y * y) * rate + phase)


@inlined
def _blend(
    scratch: FloatArray, i: int, share: float,
    red: float, green: float, blue: float, to_red: float, to_green: float, to_blue: float,
) -> None:  # fmt: skip
    scratch[RED + i] = red + share * to_red
    scratch[GREEN + i] = green + share * to_green
    scratch[BLUE + i] = blue + share * to_blue


@inlined
def shade_packet(tables: "Tables", owner: int, scratch: FloatArray) -> None:
    """Write the colours of 16 hits on one object, from their texture coordinates and levels of detail."""
    values = tables.objects[owner]
    kind = values[KIND]
    # Read before the loops: the compiler cannot know that writing colours leaves them as they are.
    first, second, phase, rate = values[PLACE], values[PLACE + 1], values[PHASE], values[RATE]
    red, green, blue = (
        values[COLOR] * values[LOW],
        values[COLOR + 1] * values[LOW + 1],
        values[COLOR + 2] * values[LOW + 2],
    )
    to_red, to_green, to_blue = (
        values[COLOR] * values[SPAN],
        values[COLOR + 1] * values[SPAN + 1],
        values[COLOR + 2] * values[SPAN + 2],
    )
    if kind == CHECKER:
        for i in range(LANES):
            share = _checker_share(scratch[U + i], scratch[V + i], first, second)
            _blend(scratch, i, share, red, green, blue, to_red, to_green, to_blue)
    elif kind == SINE:
        for i in range(LANES):
            share = 0.5 + 0.5 * _wave(scratch[U + i], scratch[V + i], first, second, phase)
            _blend(scratch, i, share, red, green, blue, to_red, to_green, to_blue)
    elif kind == SQUARE:
        for i in range(LANES):
            share = 0.5 + 0.5 * np.sign(_wave(scratch[U + i], scratch[V + i], first, second, phase))
            _blend(scratch, i, share, red, green, blue, to_red, to_green, to_blue)
    elif kind == ZONE:
        for i in range(LANES):
            share = 0.5 + 0.5 * _rings(scratch[U + i], scratch[V + i], first, second, rate, phase)
            _blend(scratch, i, share, red, green, blue, to_red, to_green, to_blue)
    else:
        for i in range(LANES):
            _look_up(tables, values, scratch, i)


@inlined
def shade_lane(tables: "Tables", owner: int, scratch: FloatArray, i: int) -> None:
    """Write the colour of one hit, from its texture coordinates and level of detail."""
    values = tables.objects[owner]
    kind = values[KIND]
    if kind >= NEAREST:
        _look_up(tables, values, scratch, i)
        return
    u, v = scratch[U + i], scratch[V + i]
    first, second, phase = values[PLACE], values[PLACE + 1], values[PHASE]
    if kind == CHECKER:
        share = _checker_share(u, v, first, second)
    else:
        if kind == ZONE:
            share = _rings(u, v, first, second, values[RATE], phase)
        else:
            share = _wave(u, v, first, second, phase)
            if kind == SQUARE:
                share = np.sign(share)
        share = 0.5 + 0.5 * share
    for k in range(3):
        scratch[RED + k * LANES + i] = values[COLOR + k] * values[LOW + k] + share * (
            values[COLOR + k] * values[SPAN + k]
        )


@inlined
def _own_place(values: FloatArray, scratch: FloatArray, i: int) -> tuple[float, float]:
    """Return where a lane's texture coordinates lie in those of the mip chain."""
    u, v = scratch[U + i], scratch[V + i]
    return (
        values[UV_MATRIX] * u + values[UV_MATRIX + 1] * v + values[UV_MATRIX + 2],
        values[UV_MATRIX + 3] * u + values[UV_MATRIX + 4] * v + values[UV_MATRIX + 5],
    )


@inlined
def _nearest(first: int, width: int, height: int, s: float, r: float) -> int:
    """Return the texel that holds a place, on the level that has its first texel there and this size."""
    return first + _wrap(np.floor(r * height), height) * width + _wrap(np.floor(s * width), width)


@inlined
def _level_of(values: FloatArray, scratch: FloatArray, i: int) -> tuple[int, float]:
    """Return the level that a lane is looked up in, and the share of the one above."""
    lod = min(max(scratch[LOD + i], 0.0), values[LEVELS] - 1.0)
    if values[KIND] == MIPMAP:
        # GL's rule for the nearest level: ceil(lod + 1/2) - 1.
        level, part = max(np.ceil(lod + 0.5) - 1.0, 0.0), 0.0
    else:
        level = np.floor(lod)
        part = lod - level
    return int(values[LEVEL]) + int(level), part


@compiled_if_rare((0.0, 0.0, 0.0, 0.0))
@inlined
def _ewa(
    tables: "Tables", values: FloatArray, scratch: FloatArray, i: int, s: float, r: float
) -> tuple[float, float, float, float]:
    """Return the colour and alpha of an image averaged over a lane's footprint."""
    return ewa_color(
        tables.levels, tables.texels, int(values[LEVEL]), int(values[LEVELS]), s, r,
        scratch[S_RIGHT + i], scratch[R_RIGHT + i], scratch[S_UP + i], scratch[R_UP + i],
    )  # fmt: skip


@inlined
def _look_up(tables: "Tables", values: FloatArray, scratch: FloatArray, i: int) -> None:
    """Write the colour of an image (or baked chain) from one level or between two."""
    levels, texels = tables.levels, tables.texels
    s, r = _own_place(values, scratch, i)
    if values[KIND] == NEAREST:
        level = levels[int(values[LEVEL])]
        texel = _nearest(level[0], level[1], level[2], s, r)
        for k in range(3):
            scratch[RED + k * LANES + i] = values[COLOR + k] * texels[texel, k]
        return
    if values[KIND] == EWA:
        red, green, blue, _ = _ewa(tables, values, scratch, i, s, r)
        scratch[RED + i] = values[COLOR] * red
        scratch[RED + LANES + i] = values[COLOR + 1] * green
        scratch[RED + 2 * LANES + i] = values[COLOR + 2] * blue
        return
    at, part = _level_of(values, scratch, i)
    red, green, blue = _bilinear(levels, texels, at, s, r)
    if part > 0.0:
        red_above, green_above, blue_above = _bilinear(levels, texels, at + 1, s, r)
        red += part * (red_above - red)
        green += part * (green_above - green)
        blue += part * (blue_above - blue)
    scratch[RED + i] = values[COLOR] * red
    scratch[RED + LANES + i] = values[COLOR + 1] * green
    scratch[RED + 2 * LANES + i] = values[COLOR + 2] * blue


@inlined
def alpha_packet(tables: "Tables", values: FloatArray, scratch: FloatArray) -> None:
    """Write the alpha of 16 hits on one image where their red goes."""
    levels, texels = tables.levels, tables.texels
    if values[KIND] == NEAREST:
        # Read before the loop: the compiler cannot know that writing alphas leaves them as they are.
        level = levels[int(values[LEVEL])]
        first, width, height = level[0], level[1], level[2]
        a, b, c = values[UV_MATRIX], values[UV_MATRIX + 1], values[UV_MATRIX + 2]
        d, e, f = values[UV_MATRIX + 3], values[UV_MATRIX + 4], values[UV_MATRIX + 5]
        for i in range(LANES):
            u, v = scratch[U + i], scratch[V + i]
            texel = _nearest(first, width, height, a * u + b * v + c, d * u + e * v + f)
            scratch[RED + i] = texels[texel, 3]
        return
    for i in range(LANES):
        scratch[RED + i] = alpha_lane(tables, values, scratch, i)


@called
def alpha_lane(tables: "Tables", values: FloatArray, scratch: FloatArray, i: int) -> float:
    """Return the alpha of an image at a hit, looked up as `_look_up` does the colour."""
    levels, texels = tables.levels, tables.texels
    s, r = _own_place(values, scratch, i)
    if values[KIND] == NEAREST:
        level = levels[int(values[LEVEL])]
        return texels[_nearest(level[0], level[1], level[2], s, r), 3]
    if values[KIND] == EWA:
        return _ewa(tables, values, scratch, i, s, r)[3]
    at, part = _level_of(values, scratch, i)
    alpha = _bilinear_alpha(levels, texels, at, s, r)
    if part > 0.0:
        alpha += part * (_bilinear_alpha(levels, texels, at + 1, s, r) - alpha)
    return alpha


@inlined
def _four_texels(
    levels: IndexArray, level: int, s: float, r: float
) -> tuple[int, int, int, int, float, float, float, float]:
    """Return the texels about a place (left and right of the lower row, then of the upper) and their weights."""
    first, width, height = levels[level, 0], levels[level, 1], levels[level, 2]
    x, y = s * width - 0.5, r * height - 0.5
    x0, y0 = np.floor(x), np.floor(y)
    a, b = x - x0, y - y0
    left, low = _wrap(x0, width), _wrap(y0, height)
    right = left + 1 if left + 1 < width else 0
    high = low + 1 if low + 1 < height else 0
    p, q = first + low * width, first + high * width
    return (
        p + left, p + right, q + left, q + right,
        (1.0 - a) * (1.0 - b), a * (1.0 - b), (1.0 - a) * b, a * b,
    )  # fmt: skip


@inlined
def _bilinear(levels: IndexArray, texels: TexelArray, level: int, s: float, r: float) -> tuple[float, float, float]:
    c00, c10, c01, c11, w00, w10, w01, w11 = _four_texels(levels, level, s, r)
    return (
        w00 * texels[c00, 0] + w10 * texels[c10, 0] + w01 * texels[c01, 0] + w11 * texels[c11, 0],
        w00 * texels[c00, 1] + w10 * texels[c10, 1] + w01 * texels[c01, 1] + w11 * texels[c11, 1],
        w00 * texels[c00, 2] + w10 * texels[c10, 2] + w01 * texels[c01, 2] + w11 * texels[c11, 2],
    )


@inlined
def _bilinear_alpha(levels: IndexArray, texels: TexelArray, level: int, s: float, r: float) -> float:
    c00, c10, c01, c11, w00, w10, w01, w11 = _four_texels(levels, level, s, r)
    return w00 * texels[c00, 3] + w10 * texels[c10, 3] + w01 * texels[c01, 3] + w11 * texels[c11, 3]


@inlined
def _wrap(index: float, size: int) -> int:
    """Return a texel index taken into range(size); in float64, which holds every index that means anything."""
    wrapped = int(index - size * np.floor(index / size))
    return wrapped if 0 <= wrapped < size else 0
