"""The lecture's weighted distributions: from points of the unit square to offsets that are spread like a filter.

`weighting=distribution` spends samples where the filter is large instead of weighting them: offsets have the density
abs f / gain, where gain is the integral of abs f, and gain / N sum(sign_i L_i) estimates the integral of f L. The maps
are inverse distribution functions, one for each axis where the filter is a product, so that strata stay strata: boxes
of the unit square become boxes of the same share of the filter. The cone is no product. It gets Shirley & Chiu's
concentric square, the radius put through the cone's own distribution: the polar map cuts the disc open along an angle
and squeezes a side of the square into the centre (1.1 to 1.5 times the RMS error at 16 and 64 jittered samples).

Inverse distribution functions end in roots, of order 2 where the filter crosses zero, 3 where it touches it, or in a
Gaussian's logarithm. A table in equal steps fails there, Newton's method starves. Here every octave of the mass left
to such an end has 32 cells, whose numbers are the leading bits of the mass, with a polynomial of degree 4 in each: the
relative error is the same in all of them (2e-12). A filter with lobes has a piece for each half lobe, with a table of
its own counted from the zero it ends in.
"""

import itertools
import math
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from aliasbench.renderers.sampling.bits import hidden
from aliasbench.renderers.sampling.filters import BOX, CONE, GAUSSIAN, TENT, FilterSpec, filter_of
from aliasbench.renderers.technique import Technique
from aliasbench.scenes.model import FloatArray, read_only

# What `warp_lanes` does. IDENTITY is the uniform pixel, the same map as that of a box of radius .5.
IDENTITY, STRETCH, ROOT, LECTURE, QUANTILE, LOBES, DISC = 0, 1, 2, 3, 4, 5, 6
LECTURE_MU = 0.4

_OCTAVES = 56  # numbers in [.5, 1) are multiples of 2^-53, and those of a stratum near 0 are smaller
_CELL_BITS = 5
_CELLS = 1 << _CELL_BITS
_ROWS = _OCTAVES * _CELLS  # and one more, constant, for a mass of 1
_TERMS = 5
_SMALLEST = 2.0**-_OCTAVES
_QUADRATURE = 24  # points for a piece, at most a pixel long where the profile is no polynomial: exact to rounding

# A float64 has its exponent, biased by 1023, from bit 52 on. Indices are unsigned: a negative one would be looked for.
_SHIFT = np.uint64(52 - _CELL_BITS)
_WITHIN, _ONE_BITS = np.uint64((1 << (52 - _CELL_BITS)) - 1), np.uint64(1023 << 52)
_FIRST_ROW = np.uint64((1023 - _OCTAVES) << _CELL_BITS)
_ROWS_EACH, _HEAD_EACH, _NEXT = np.uint64(_ROWS + 1), np.uint64(4), np.uint64(1)
# Places in the parameters: radius, guide, then for each piece its upper bound, reference, inverse size and sign.
_EXTENT = 0
_GUIDE, _BOUND, _REFERENCE, _DENSITY, _SIGN = (np.uint64(k) for k in (1, 1 + _ROWS, 2 + _ROWS, 3 + _ROWS, 4 + _ROWS))

_HALF_ROOT_BITS = 0x3FE6A09E667F3BCD  # of sqrt(1/2)
_LN2_HIGH, _LN2_LOW = 0.6931471803691238, 1.9082149292705877e-10  # the first times an exponent is exact
_LOG_LEAST = math.log(5e-324)  # of the smallest positive float, the lecture's s where s = 0


class Warp(NamedTuple):
    """A map of the unit square as plain data that kernels take.

    Attributes
    ----------
    code : int
        Which map; IDENTITY says that the position is uniform in the pixel and `warp_lanes` need not be called.
    params : (n,) float64
        First the radius (mu of the lecture's Gaussian); with LOBES the guide and the heads of the pieces.
    table : (rows, 5) float64
        Coefficients of the cells, piece after piece.
    gain : float
        The integral of abs f: what the mean of the signed samples is multiplied by.
    """

    code: int
    params: FloatArray
    table: FloatArray
    gain: float


def make_warp(technique: Technique) -> Warp:
    """Return the map of a technique's positions: IDENTITY under `weighting=samples`."""
    if technique.weighting == "samples":
        return _pack(IDENTITY, [0.5])
    if technique.warp == "lecture":
        return _pack(LECTURE, [LECTURE_MU]) if technique.filter == "gaussian" else _pack(ROOT, [1.0])
    return filter_warp(filter_of(technique))


def filter_warp(spec: FilterSpec) -> Warp:
    """Return the exact map of a filter, whatever its radius and sigma."""
    code = spec.kind.code
    if code == BOX:
        return _pack(IDENTITY if spec.radius == 0.5 else STRETCH, [spec.radius])
    if code == TENT:
        return _pack(ROOT, [spec.radius])
    if code == CONE:
        return _pack(DISC, [spec.radius], _fit(spec.radius * _cone_quantile(_nodes())))
    if code == GAUSSIAN:
        return _pack(QUANTILE, [spec.radius], _fit(np.minimum(_gaussian_quantile(spec, _nodes()), spec.radius)))
    return _lobe_warp(spec)


def warp_points(warp: Warp, u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the offsets dx, dy in pixels and the signs (1 or -1) of points of [0, 1)^2, in their broadcast shape."""
    a, b = np.broadcast_arrays(np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64))
    out = np.stack([a.ravel(), b.ravel(), np.empty(a.size)])
    _warp_many(warp, out)
    return out[0].reshape(a.shape), out[1].reshape(a.shape), out[2].reshape(a.shape)


def _pack(code: int, params: list[float], table: FloatArray | None = None, gain: float = 1.0) -> Warp:
    rows = np.empty((0, _TERMS)) if table is None else table
    return Warp(code, read_only(np.array(params, dtype=np.float64)), read_only(np.ascontiguousarray(rows)), gain)


def _shares() -> FloatArray:
    """Return Chebyshev's points of [0, 1] with both ends, so that neighbouring cells meet."""
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.arange(_TERMS) / (_TERMS - 1)))


def _nodes() -> FloatArray:
    """Return (rows, _TERMS) masses in (0, 1], the places in each cell where the polynomial is exact."""
    octave, cell = np.divmod(np.arange(_ROWS + 1), _CELLS)
    mass = (1.0 + (cell[:, None] + _shares()) / _CELLS) * np.exp2(octave - _OCTAVES)[:, None]
    return np.asarray(np.minimum(mass, 1.0))


def _fit(values: FloatArray) -> FloatArray:
    """Return the coefficients of the polynomials with these values at `_nodes`.

    Their variable is what a mantissa in [1, 2) has beyond the left end of its cell, where they are exact.
    """
    inverse = np.linalg.inv(np.vander(_shares(), increasing=True))
    coefficients = (values - values[:, :1]) @ inverse.T
    coefficients[:, 0] = values[:, 0]
    return np.asarray(coefficients * float(_CELLS) ** np.arange(_TERMS))


def _cone_quantile(mass: FloatArray) -> FloatArray:
    """Return rho in (0, 1) whose disc has the share s^2, s = 1 - mass, of the unit cone: 3 rho^2 - 2 rho^3 = s^2.

    With rho = 1/2 - sin(a) the left side is (1 - sin 3a) / 2, so sin 3a = 1 - 2 s^2 and 3a = 2 acos(s) - pi/2;
    acos(1 - m) = 2 asin(sqrt(m / 2)) keeps small masses exact.
    """
    angle = (4.0 * np.arcsin(np.sqrt(0.5 * mass)) - 0.5 * np.pi) / 3.0
    return np.asarray(0.5 - np.sin(angle))


def _gaussian_quantile(spec: FilterSpec, mass: FloatArray) -> FloatArray:
    """Return x >= 0 beyond which, on both sides together, the share `mass` of the cut Gaussian lies."""
    from scipy.special import erfinv, ndtri

    reach = spec.radius / (spec.sigma * math.sqrt(2.0))
    inside = math.erf(reach)
    if spec.radius < spec.sigma:  # nearly a box: the share within x is the smaller number, and exact
        return np.asarray(spec.sigma * math.sqrt(2.0) * erfinv((1.0 - mass) * inside))
    return np.asarray(-spec.sigma * ndtri(0.5 * (math.erfc(reach) + mass * inside)))


class _Piece(NamedTuple):
    """A part of a half profile in which the filter has one sign, from `start` to `stop` in abs x.

    If it ends in a zero that is its start; of two it is no more than the half next to one.
    """

    start: float
    stop: float
    sign: float
    mass: float
    series: FloatArray  # Chebyshev's, of mass(d) / d for the distance d from the start

    def places(self) -> FloatArray:
        """Return abs x where the mass counted from the start is the share `_nodes` of the whole.

        Newton's method on log mass over log d, which a root of any order leaves nearly straight.
        """
        from numpy.polynomial import chebyshev

        share, size = _nodes(), abs(self.stop - self.start)
        slope = chebyshev.chebder(self.series)
        # Next to the start rounding may leave no mass at all, or a wrong order: at distances that are rounding too.
        least = 1e-17 * self.mass / size
        d = size * np.sqrt(share)
        for _ in range(40):
            t = 2.0 * d / size - 1.0
            mean = np.maximum(chebyshev.chebval(t, self.series), least)
            order = np.clip(1.0 + 2.0 * d / size * chebyshev.chebval(t, slope) / mean, 1.0, 4.0)
            last, d = d, np.minimum(d * (share * self.mass / (d * mean)) ** (1.0 / order), size)
            if np.abs(d - last).max() < 1e-9 * size:  # quadratic: the change that would follow is far below rounding
                break
        return np.asarray(self.start + math.copysign(1.0, self.stop - self.start) * d)


def _make_piece(spec: FilterSpec, start: float, stop: float) -> _Piece:
    """Return a piece; in t of [-1, 1] the distance from its start is (t + 1) / 2 of its size."""
    from numpy.polynomial import chebyshev, legendre

    points, weights = legendre.leggauss(_QUADRATURE)
    t = np.cos(np.pi * (np.arange(_QUADRATURE) + 0.5) / _QUADRATURE)
    at = start + (stop - start) * 0.25 * (t[:, None] + 1.0) * (points + 1.0)
    mean = np.abs(spec.profile(at)) @ weights * 0.5
    series = np.asarray(chebyshev.chebfit(t, mean, _QUADRATURE - 1), dtype=np.float64)
    size = abs(stop - start)
    sign = math.copysign(1.0, float(spec.profile(0.5 * (start + stop))))
    return _Piece(start, stop, sign, float(size * chebyshev.chebval(1.0, series)), series)


def _zeros(spec: FilterSpec) -> list[float]:
    """Return where the profile of a filter with lobes is zero, ascending, up to the radius."""
    if spec.name == "mitchell":  # (u - 2)^2 (8 - 7 u) / 3 beyond u = 2 x / r = 1
        return [4.0 / 7.0 * spec.radius, spec.radius]
    return [float(n) for n in range(1, math.ceil(spec.radius))] + [spec.radius]


def _pieces(spec: FilterSpec) -> list[_Piece]:
    """Return the pieces of a filter with lobes from the radius inwards."""
    zeros = _zeros(spec)
    inner = [k for k in spec.knots if 0.0 < k < zeros[0]]
    spans = [(b, a) for a, b in itertools.pairwise([0.0, *inner, zeros[0]])]
    for a, b in itertools.pairwise(zeros):
        spans += [(a, 0.5 * (a + b)), (b, 0.5 * (a + b))]
    return [_make_piece(spec, start, stop) for start, stop in reversed(spans)]


def _lobe_warp(spec: FilterSpec) -> Warp:
    pieces = _pieces(spec)
    total = 2.0 * sum(p.mass for p in pieces)
    # A sliver past the last whole zero that no number can hit would be a table of noise.
    while sum(p.mass for p in pieces[:2]) < _SMALLEST * total:
        del pieces[:2]
    bounds = np.cumsum([p.mass for p in pieces]) / total
    bounds[-1] = math.inf
    heads = []
    for k, (piece, bound) in enumerate(zip(pieces, bounds, strict=True)):
        outer = float(bounds[k - 1]) if k else 0.0
        heads += [float(bound), outer if piece.start > piece.stop else float(bound), total / piece.mass, piece.sign]
    guide = np.searchsorted(bounds, _nodes()[:-1, 0])
    table = np.concatenate([_fit(p.places()) for p in pieces])
    return _pack(LOBES, [spec.radius, *guide.tolist(), *heads], table, total * total)


@intrinsic
def _bits_of(typing_context: Any, value: Any) -> Any:  # noqa: ARG001 - numba passes it
    """Return the bits of a float64 as a uint64."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
        return builder.bitcast(arguments[0], ir.IntType(64))

    return types.uint64(types.float64), generate


@intrinsic
def _float_of(typing_context: Any, bits: Any) -> Any:  # noqa: ARG001 - numba passes it
    """Return the float64 that has these bits."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
        return builder.bitcast(arguments[0], ir.DoubleType())

    return types.float64(types.uint64), generate


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def _look_up(table: FloatArray, first: np.uint64, mass: float, shift: np.uint64) -> float:
    """Return the tabulated value at mass * 2^shift in [_SMALLEST, 1], of the piece whose rows start at `first`."""
    bits = _bits_of(mass)
    t = _float_of((bits & _WITHIN) | _ONE_BITS) - 1.0
    row = (bits >> _SHIFT) + (first - _FIRST_ROW + (shift << np.uint64(_CELL_BITS)))
    high = (table[row, 4] * t + table[row, 3]) * t + table[row, 2]
    return (high * t + table[row, 1]) * t + table[row, 0]


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def _stretch(width: float, scratch: FloatArray, at: int, lanes: int) -> None:
    for i in range(lanes):
        scratch[at + i] = (scratch[at + i] - 0.5) * width


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def _root(radius: float, scratch: FloatArray, at: int, lanes: int) -> None:
    """Shirley's formula: the mass outside x of one half of the tent is (1 - x / r)^2 / 2."""
    for i in range(lanes):
        u = scratch[at + i]
        scratch[at + i] = math.copysign(radius * (1.0 - np.sqrt(2.0 * min(u, 1.0 - u))), u - 0.5)


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def _quantile(table: FloatArray, scratch: FloatArray, at: int, lanes: int) -> None:
    for i in range(lanes):
        u = scratch[at + i]
        x = _look_up(table, np.uint64(0), max(0.5 * _SMALLEST, min(u, 1.0 - u)), _NEXT)
        scratch[at + i] = math.copysign(x, u - 0.5)


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def _lobes(params: FloatArray, table: FloatArray, scratch: FloatArray, at: int, sign_at: int, lanes: int) -> None:
    for i in range(lanes):
        u = scratch[at + i]
        w = max(_SMALLEST, min(u, 1.0 - u))
        # The guide knows the piece at the left end of the cell that w is in: few cells reach into the next.
        piece = np.uint64(params[(_bits_of(w) >> _SHIFT) + (_GUIDE - _FIRST_ROW)])
        while w > params[_BOUND + _HEAD_EACH * piece]:
            piece += _NEXT
        head = _HEAD_EACH * piece
        mass = max(_SMALLEST, abs(w - params[_REFERENCE + head]) * params[_DENSITY + head])
        x = _look_up(table, _ROWS_EACH * piece, mass, np.uint64(0))
        scratch[sign_at + i] *= params[_SIGN + head]
        scratch[at + i] = math.copysign(x, u - 0.5)


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def _ones(scratch: FloatArray, at: int, lanes: int) -> None:
    for i in range(lanes):
        scratch[at + i] = 1.0


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def _sin_eighths(t: float) -> float:
    """Return sin(pi t / 4) for abs t <= 1: Taylor, the term of degree 17 is below 5e-17."""
    x = 0.25 * np.pi * t
    y = x * x
    high = (((-1.0 / 1307674368000.0 * y + 1.0 / 6227020800.0) * y - 1.0 / 39916800.0) * y + 1.0 / 362880.0) * y
    return x + x * y * (((high - 1.0 / 5040.0) * y + 1.0 / 120.0) * y - 1.0 / 6.0)


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def _cos_eighths(t: float) -> float:
    """Return cos(pi t / 4) for abs t <= 1: Taylor, the term of degree 18 is below 3e-18."""
    x = 0.25 * np.pi * t
    y = x * x
    high = ((1.0 / 20922789888000.0 * y - 1.0 / 87178291200.0) * y + 1.0 / 479001600.0) * y - 1.0 / 3628800.0
    return 1.0 - 0.5 * y + y * y * (((high * y + 1.0 / 40320.0) * y - 1.0 / 720.0) * y + 1.0 / 24.0)


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def _disc(
    radius: float, table: FloatArray, scratch: FloatArray, x_at: int, y_at: int, sign_at: int, lanes: int
) -> None:
    """Shirley & Chiu 1997: squares around the centre to circles, eighths of a side to eighths of a turn."""
    for i in range(lanes):
        u, v = scratch[x_at + i], scratch[y_at + i]
        scratch[sign_at + i] = max(0.5 * _SMALLEST, min(min(u, 1.0 - u), min(v, 1.0 - v)))
    for i in range(lanes):
        scratch[sign_at + i] = _look_up(table, np.uint64(0), scratch[sign_at + i], _NEXT)
    inside = radius * (1.0 - 2.0**-51)  # rounding of cosine and sine must not lead past the radius
    for i in range(lanes):
        a, b = scratch[x_at + i] - 0.5, scratch[y_at + i] - 0.5
        steep = abs(b) > abs(a)
        major, minor = (b, a) if steep else (a, b)
        t = minor / (major if major != 0.0 else 1.0)
        rho = math.copysign(min(scratch[sign_at + i], inside), major)
        along, across = rho * _cos_eighths(t), rho * _sin_eighths(t)
        scratch[x_at + i] = across if steep else along
        scratch[y_at + i] = along if steep else across
        scratch[sign_at + i] = 1.0


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def _log_unit(s: float) -> float:
    """Return log s for s in [0, 1), that of the smallest positive float for 0.

    s = 2^e m with m in [sqrt(1/2), sqrt(2)), and log m = 2 atanh((m - 1) / (m + 1)): the term of degree 23 is 1e-18.
    """
    bits = np.int64(_bits_of(s))
    exponent = (bits - _HALF_ROOT_BITS) >> 52
    m = _float_of(np.uint64(bits - (exponent << 52)))
    e = float(exponent)
    f = (m - 1.0) / (m + 1.0)
    z = f * f
    high = ((((z / 21.0 + 1.0 / 19.0) * z + 1.0 / 17.0) * z + 1.0 / 15.0) * z + 1.0 / 13.0) * z + 1.0 / 11.0
    tail = ((((high * z + 1.0 / 9.0) * z + 1.0 / 7.0) * z + 1.0 / 5.0) * z + 1.0 / 3.0) * z
    value = e * _LN2_HIGH + (2.0 * f + (2.0 * f * tail + e * _LN2_LOW))
    return value if s > 0.0 else _LOG_LEAST


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def _lecture(mu: float, scratch: FloatArray, x_at: int, y_at: int, lanes: int) -> None:
    """a = mu sqrt(-2 log s), b = 2 pi t; dx = a sin b, dy = a cos b (Box & Muller 1958)."""
    for i in range(lanes):
        a = mu * np.sqrt(-2.0 * _log_unit(scratch[x_at + i]))
        turns = scratch[y_at + i]
        quarter = np.floor(4.0 * turns + 0.5)
        t = 8.0 * turns - 2.0 * quarter
        sine, cosine = _sin_eighths(t), _cos_eighths(t)
        # (sine, cosine) becomes (s, c), (c, -s), (-s, -c), (-c, s) quarter by quarter, and (s, c) again.
        x, y = (cosine, -sine) if abs(quarter - 2.0) == 1.0 else (sine, cosine)
        side = -a if abs(quarter - 2.5) < 1.0 else a
        scratch[x_at + i], scratch[y_at + i] = side * x, side * y


@njit(cache=True, error_model="numpy", _nrt=False)
def warp_lanes(warp: Warp, scratch: FloatArray, x_at: int, y_at: int, sign_at: int, lanes: int) -> None:
    """Turn lanes of points in [0, 1)^2 into offsets from the pixel's centre, in place, and write their signs.

    Lanes may hold anything, NaN too, that somebody leaves there: what comes out of them then means nothing.

    Parameters
    ----------
    warp : Warp
    scratch : (n,) float64
        Lane i has its point at [x_at + i] and [y_at + i], gets dx and dy there, and 1 or -1 at [sign_at + i].
    x_at, y_at, sign_at : int
        Where the three rows start; they do not overlap.
    lanes : int
        How many.
    """
    lanes = hidden(lanes)
    code, params = warp.code, warp.params
    extent = params[_EXTENT]
    if code == DISC:
        _disc(extent, warp.table, scratch, x_at, y_at, sign_at, lanes)
        return
    _ones(scratch, sign_at, lanes)
    if code == QUANTILE:
        _quantile(warp.table, scratch, x_at, lanes)
        _quantile(warp.table, scratch, y_at, lanes)
    elif code == LOBES:
        _lobes(params, warp.table, scratch, x_at, sign_at, lanes)
        _lobes(params, warp.table, scratch, y_at, sign_at, lanes)
    elif code == ROOT:
        _root(extent, scratch, x_at, lanes)
        _root(extent, scratch, y_at, lanes)
    elif code == LECTURE:
        _lecture(extent, scratch, x_at, y_at, lanes)
    else:
        _stretch(2.0 * extent, scratch, x_at, lanes)
        _stretch(2.0 * extent, scratch, y_at, lanes)


@njit(cache=True, error_model="numpy", _nrt=False)
def _warp_many(warp: Warp, points: FloatArray) -> None:
    """Warp (3, n) points in place, rows x, y and sign."""
    n = points.shape[1]
    warp_lanes(warp, points.reshape(3 * n), 0, n, 2 * n, n)
