"""Elliptically weighted averages of a texture over the footprint of a sample: anisotropic filtering without probes.

A pixel's square lies on the texture as a parallelogram. Mip levels blur by its longer side (`texturing`), which at a
grazing angle is the wrong one; here the texels of one finer level are averaged under an ellipse (Greene and Heckbert
1986, "Creating raster omnimax images from multiple perspective views using the elliptical weighted average filter";
Heckbert 1989, "Fundamentals of texture mapping and image warping", 3.5).

Texels are constant squares, so that the weight which an exact average gives to a texel is the parallelogram convolved
with a texel's square, at the texel's centre. Variances add under convolution, and a square's is 1/12 of its side's
square along each axis: with the footprint's axes x and y in texels, that weight has the covariance

    V = (x x^T + y y^T + I) / 12.

The identity is Heckbert's reconstruction term. The ellipse's weights have the same covariance, and the profile
(1 - Q)^2 of Q = d^T (8 V)^-1 d < 1, whose variance is 1/8. Greene and Heckbert leave the profile open; over random
parallelograms, on white noise, noise of spectrum 1/f and random squares, this one errs from the exact averages by 40 %
less than a Gaussian of covariance V cut at 2.5 or 3 sigmas, and by a quarter less than one as wide as suits it best,
with as many texels. It is itself best at V. It ends smoothly, and needs neither an exponential nor a table.

One level is looked at, the coarsest on which the footprint still covers four texels and is 1.5 across: blending with
the next one, as between bilinear look-ups, was found to err more and to cost more. A footprint narrower than a texel
of level 0 counts as one texel wide, which is what bilinear magnification does: its tent is a texel's square convolved
with one.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import inlined
from aliasbench.scenes.model import FloatArray

# The ratio of a footprint's axes up to which the average is sharp; past it the shorter axis counts as longer, as with
# the rasterizer's `anisotropy=16`.
MOST_ANISOTROPY = 16.0

# Where a triangle's row has its maps to u and v, and an object's the matrix to the chain's coordinates: `shading` and
# `texturing` define these, and are to import this module.
_U_MAP, _V_MAP, _UV_MATRIX = 4, 8, 16

_SPREAD = 8.0 / 12.0  # of 8 V above
_ROW_SPREAD = 7.0 / 12.0  # where all is in one row or column: (1 - x^2)^2 along a line has variance 1/7
# From which squared width, and squared area, in texels the next level is still fine enough: 1.5 and 4 there.
_COARSEST_WIDTH, _COARSEST_AREA = 9.0, 256.0
_WIDEST = 16.0  # squared width in texels that is never exceeded so, as the longer side is no less than the shorter
_NARROW = 6.0  # half a row's length in texels up to which all rows are as long as the longest: branches guessed right
_FURTHEST = 1e30  # squared length in texels of level 0 that any chain ends far below


@intrinsic
def _weigh_run(typing_context: Any, texels: Any, at: Any, count: Any, left: Any, dx: Any, per_along: Any) -> Any:  # noqa: ARG001 - numba passes it
    """Return the sums of w red, w green, w blue, w alpha and w over `count` > 0 texels in a row, from texel `at` on.

    w = max(left - x^2 per_along, 0)^2 for x = dx, dx + 1, ... The four channels of a texel lie together and are one
    vector, which the compiler does not find out by itself.
    """
    result = types.UniTuple(types.float64, 5)
    signature = result(texels, types.int64, types.int64, types.float64, types.float64, types.float64)
    if texels.layout != "C" or texels.dtype != types.float32:
        return None
    return signature, _build_run


def _build_run(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Write `_weigh_run`'s loop."""
    array, at, count, left, dx, per_along = arguments
    data = context.make_array(signature.args[0])(context, builder, array).data
    number, integer = ir.DoubleType(), at.type
    pixel, sums = ir.VectorType(ir.FloatType(), 4), ir.VectorType(number, 4)
    before = builder.block
    loop, after = builder.append_basic_block("run"), builder.append_basic_block("run.end")
    builder.branch(loop)
    builder.position_at_end(loop)
    i, x, acc, total = (builder.phi(kind) for kind in (integer, number, sums, number))
    starts = integer(0), dx, ir.Constant(sums, [0.0] * 4), number(0.0)
    for phi, start in zip((i, x, acc, total), starts, strict=True):
        phi.add_incoming(start, before)
    place = builder.gep(data, [builder.mul(builder.add(at, i), integer(4))])
    texel = builder.load(builder.bitcast(place, pixel.as_pointer()), typ=pixel)
    texel.align = 4
    root = builder.fsub(left, builder.fmul(builder.fmul(x, x), per_along))
    root = builder.select(builder.fcmp_ordered(">", root, number(0.0)), root, number(0.0))
    weight = builder.fmul(root, root)
    lane, mask = ir.IntType(32), ir.Constant(ir.VectorType(ir.IntType(32), 4), [0] * 4)
    single = builder.insert_element(ir.Constant(sums, ir.Undefined), weight, lane(0))
    weights = builder.shuffle_vector(single, ir.Constant(sums, ir.Undefined), mask)
    nexts = (
        builder.add(i, integer(1)),
        builder.fadd(x, number(1.0)),
        builder.fadd(acc, builder.fmul(weights, builder.fpext(texel, sums))),
        builder.fadd(total, weight),
    )
    for phi, value in zip((i, x, acc, total), nexts, strict=True):
        phi.add_incoming(value, loop)
    builder.cbranch(builder.icmp_signed("<", nexts[0], count), loop, after)
    builder.position_at_end(after)
    parts = [builder.extract_element(nexts[2], lane(k)) for k in range(4)]
    return context.make_tuple(builder, signature.return_type, [*parts, nexts[3]])


@njit(cache=True, error_model="numpy", _nrt=False)
def ewa_color(
    levels: NDArray[np.int64], texels: NDArray[np.float32], first_level: int, level_count: int,
    s: float, r: float, s_x: float, r_x: float, s_y: float, r_y: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Return a texture's average (red, green, blue, alpha) over a footprint; finite whatever the footprint is.

    Parameters
    ----------
    levels : (k, 3) int64
        First texel, width and height of every mip level (`Tables`).
    texels : (t, 4) float32
    first_level, level_count : int
        The texture's own levels, each half the size of the one before.
    s, r : float
        The footprint's middle, in the chain's coordinates, which repeat with period 1.
    s_x, r_x, s_y, r_y : float
        How (s, r) changes along the footprint's width and along its height (`footprint_axes`).
    """
    width, height = levels[first_level, 1], levels[first_level, 2]
    ss, sr, rr, least, most = _footprint_moments(s_x * width, r_x * height, s_y * width, r_y * height, width, height)
    level, end = first_level, first_level + level_count - 1
    while level < end and least >= _COARSEST_WIDTH and least * most >= _COARSEST_AREA:
        least, most = 0.25 * least, 0.25 * most
        level += 1
    first = levels[level, 0]
    if levels[level, 1] == 1 and levels[level, 2] == 1:
        return texels[first, 0], texels[first, 1], texels[first, 2], texels[first, 3]
    if level > first_level:
        across, up = levels[level, 1] / width, levels[level, 2] / height
        ss, sr, rr = ss * across * across, sr * across * up, rr * up * up
    if least > _WIDEST:
        # Past the last level the footprint counts as no wider than that one serves, which bounds the loops.
        shrink = _WIDEST / least
        ss, sr, rr = ss * shrink, sr * shrink, rr * shrink
    return _average(texels, first, levels[level, 1], levels[level, 2], s, r, ss, sr, rr)


@inlined
def _footprint_moments(
    x_s: float, x_r: float, y_s: float, y_r: float, width: int, height: int
) -> tuple[float, float, float, float, float]:
    """Return x x^T + y y^T of the footprint's axes in texels (ss, sr, rr), and its eigenvalues from the smaller one on.

    The eigenvalues, squares of the footprint's shorter and longer side, are raised to 1 and to the limit of anisotropy.
    """
    ss, sr, rr = x_s * x_s + y_s * y_s, x_s * x_r + y_s * y_r, x_r * x_r + y_r * y_r
    if not ss + rr < _FURTHEST:
        ss, sr, rr = _FURTHEST, 0.0, _FURTHEST
    # Along a side of one texel nothing changes: the footprint's extent is that along the other.
    if width == 1:
        ss, sr = 0.0, 0.0
    if height == 1:
        rr, sr = 0.0, 0.0
    apart = np.sqrt((ss - rr) * (ss - rr) + 4.0 * sr * sr)
    longer = 0.5 * (ss + rr + apart)
    shorter = longer - apart
    most = max(longer, 1.0)
    least = max(shorter, 1.0, most * (1.0 / MOST_ANISOTROPY**2))
    if least > shorter:
        # What has the same eigenvectors and other eigenvalues is a linear function of the matrix.
        slope = (most - least) / apart if apart > 1e-9 else 0.0
        shift = most - slope * longer
        ss, sr, rr = slope * ss + shift, slope * sr, slope * rr + shift
    return ss, sr, rr, least, most


@inlined
def _average(
    texels: NDArray[np.float32], first: int, width: int, height: int,
    s: float, r: float, ss: float, sr: float, rr: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Return the weighted average of one level's texels about a place, from the footprint's moments in texels."""
    x, y = (s - np.floor(s)) * width - 0.5, (r - np.floor(r)) * height - 0.5
    x, y = x if x < width else 0.0, y if y < height else 0.0  # where the place is no number
    wide, tall = _SPREAD, _SPREAD
    if width == 1:
        x, ss, sr, tall = 0.0, 0.0, 0.0, _ROW_SPREAD
    if height == 1:
        y, rr, sr, wide = 0.0, 0.0, 0.0, _ROW_SPREAD
    # Q in rows: (y part) + (x - middle of the row)^2 / along, a completed square: large terms cancel here once at most.
    up = tall * (rr + 1.0)
    per_up = 1.0 / up
    lean = _SPREAD * sr * per_up
    along = wide * (ss + 1.0) - lean * _SPREAD * sr
    per_along = 1.0 / along
    reach, widest = np.sqrt(up), np.sqrt(along)
    most = int(2.0 * widest) + 1
    low, high = int(np.ceil(y - reach)), int(np.floor(y + reach))
    row = low if 0 <= low < height else low % height
    red, green, blue, alpha, total = 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(low, high + 1):
        dy = j - y
        left = max(1.0 - dy * dy * per_up, 0.0)
        middle = x + lean * dy
        if widest < _NARROW:
            start, count = np.ceil(middle - widest), most
        else:
            half = np.sqrt(along * left)
            start = np.ceil(middle - half)
            count = int(np.floor(middle + half) - start) + 1
        dx = start - middle
        column = int(start)
        if column < 0 or column + count > width:
            column %= width
        while count > 0:
            run = min(count, width - column)
            more_red, more_green, more_blue, more_alpha, more = _weigh_run(
                texels, first + row * width + column, run, left, dx, per_along
            )
            red, green, blue, alpha = red + more_red, green + more_green, blue + more_blue, alpha + more_alpha
            total += more
            dx += run
            count -= run
            column = 0
        row = row + 1 if row + 1 < height else 0
    share = 1.0 / total
    return red * share, green * share, blue * share, alpha * share


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def footprint_axes(
    row: FloatArray, values: FloatArray, weight: float,
    right_x: float, right_y: float, right_z: float, up_x: float, up_y: float, up_z: float,
    dx: float, dy: float, dz: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Return how the chain's coordinates move along a sample's footprint: (s_x, r_x) rightwards, (s_y, r_y) upwards.

    Parameters
    ----------
    row, values : (TRIANGLE_SIZE,) and (OBJECT_SIZE,) float64
        The triangle's and the object's.
    weight : float
        How far the ray's origin (parallel rays) or direction (perspective) moves with the image point over a footprint,
        the latter times the distance (see `shading.place_packet`).
    right_x, ..., up_z, dx, dy, dz : float
        The picture's axes and the ray's direction, in the triangle's own frame.
    """
    s_x, r_x = _moved(row, values, weight, right_x, right_y, right_z, dx, dy, dz)
    s_y, r_y = _moved(row, values, weight, up_x, up_y, up_z, dx, dy, dz)
    return s_x, r_x, s_y, r_y


@inlined
def _moved(
    row: FloatArray, values: FloatArray, weight: float,
    qx: float, qy: float, qz: float, dx: float, dy: float, dz: float,
) -> tuple[float, float]:  # fmt: skip
    """Return how the chain's coordinates move with the image point along q: P moves by w (q - D (n . q) / (n . D))."""
    along = (row[0] * qx + row[1] * qy + row[2] * qz) / (row[0] * dx + row[1] * dy + row[2] * dz)
    x, y, z = weight * (qx - along * dx), weight * (qy - along * dy), weight * (qz - along * dz)
    du = row[_U_MAP] * x + row[_U_MAP + 1] * y + row[_U_MAP + 2] * z
    dv = row[_V_MAP] * x + row[_V_MAP + 1] * y + row[_V_MAP + 2] * z
    return (
        values[_UV_MATRIX] * du + values[_UV_MATRIX + 1] * dv,
        values[_UV_MATRIX + 3] * du + values[_UV_MATRIX + 4] * dv,
    )
