"""A filter's weights for 16 samples at once: polynomials in the distance from each column and row of pixels in reach.

A sample at d from the middle of its pixel, to the right, is at d - j from the middle of the j-th pixel that way, and
the filter's profile is smooth there: knots lie at the middle of a pixel, where d = 0 is an end of the interval, at the
radius, beyond which the weight is set to 0, and in Mitchell's half-way, which has two polynomials. To the left the
picture is the mirrored one. So every column has one polynomial on [0, h], h half the side of what samples are spread
over, fitted to 1e-9 of the profile's peak; the compiler runs them over the lanes without a table or a branch.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic
from numpy.polynomial import chebyshev

from aliasbench.renderers.raytrace.lanes import LANES
from aliasbench.renderers.sampling.bits import hidden
from aliasbench.renderers.sampling.filters import FilterSpec
from aliasbench.scenes.model import FloatArray

_ACCURACY = 1e-9
_MOST_TERMS = 28
_WIDE = 8  # float64 in the widest vectors that there are; narrower ones are used in pairs


def profile_polynomials(spec: FilterSpec, margin: int, half: float) -> FloatArray:
    """Return (pieces, 2 margin + 1, terms) coefficients in t = 2 d / half - 1, the constant first.

    Parameters
    ----------
    spec : FilterSpec
        A separable filter.
    margin : int
        How many pixels away samples count.
    half : float
        Samples lie at most so far from the middle of their pixel, across and up.
    """
    nodes = np.cos(np.pi * (np.arange(64) + 0.5) / 64)
    places = half * (nodes + 1.0) / 2.0
    pieces = spec.smooth_pieces()
    rows = np.array(
        [[chebyshev.chebfit(nodes, piece(places - j), 63) for j in range(-margin, margin + 1)] for piece in pieces]
    )
    # The sum of what is left out bounds the error.
    left_out = np.abs(rows[..., ::-1]).cumsum(axis=-1)[..., ::-1].max(axis=(0, 1))
    terms = int(np.argmax(np.append(left_out, 0.0) <= _ACCURACY * spec.peak))
    terms = max(1, min(terms, _MOST_TERMS))
    out = np.zeros((*rows.shape[:2], terms))
    for k in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            series = chebyshev.cheb2poly(rows[k, j, :terms])
            out[k, j, : len(series)] = series
    return out


@intrinsic
def _run_polynomial(typing_context: Any, coefficients: Any, places: Any, out: Any) -> Any:  # noqa: ARG001 - numba's
    """Write a polynomial's values at 2 LANES places, all contiguous float64 arrays; the constant comes first.

    Written as vectors, because the sums must stay in registers from term to term, where a loop over lanes inside one
    over terms would send each through memory.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        arrays = [
            context.make_array(kind)(context, builder, value)
            for kind, value in zip(signature.args, arguments, strict=True)
        ]
        terms = builder.extract_value(arrays[0].shape, 0)
        vector = ir.VectorType(ir.DoubleType(), _WIDE)
        parts = 2 * LANES // _WIDE
        zero, one = ir.Constant(ir.IntType(64), 0), ir.Constant(ir.IntType(64), 1)

        def spread(index: Any) -> Any:
            value = builder.load(builder.gep(arrays[0].data, [index]))
            alone = builder.insert_element(ir.Constant(vector, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
            mask = ir.Constant(ir.VectorType(ir.IntType(32), _WIDE), [0] * _WIDE)
            return builder.shuffle_vector(alone, ir.Constant(vector, ir.Undefined), mask)

        def part_of(array: Any, k: int) -> Any:
            return builder.bitcast(
                builder.gep(array.data, [ir.Constant(ir.IntType(64), k * _WIDE)]), vector.as_pointer()
            )

        at = [builder.load(part_of(arrays[1], k), align=8) for k in range(parts)]
        last = builder.sub(terms, one)
        first = spread(last)
        before, body, after = builder.block, builder.append_basic_block("term"), builder.append_basic_block("done")
        builder.cbranch(builder.icmp_signed(">", last, zero), body, after)
        builder.position_at_end(body)
        index = builder.phi(ir.IntType(64))
        sums = [builder.phi(vector) for _ in range(parts)]
        index.add_incoming(last, before)
        below = builder.sub(index, one)
        coefficient = spread(below)
        new = [builder.fadd(builder.fmul(s, x), coefficient) for s, x in zip(sums, at, strict=True)]
        index.add_incoming(below, body)
        for phi, value in zip(sums, new, strict=True):
            phi.add_incoming(first, before)
            phi.add_incoming(value, body)
        builder.cbranch(builder.icmp_signed(">", below, zero), body, after)
        builder.position_at_end(after)
        for k, value in enumerate(new):
            result = builder.phi(vector)
            result.add_incoming(first, before)
            result.add_incoming(value, body)
            new[k] = result
        for k, value in enumerate(new):
            builder.store(value, part_of(arrays[2], k), align=8)
        return context.get_dummy_value()

    return types.void(coefficients, places, out), generate


@njit(cache=True, error_model="numpy", _nrt=False)
def weigh_lanes(
    polynomials: FloatArray, half: float, radius: float, least: float, offsets: FloatArray, at: int,
    weights: FloatArray, room: FloatArray,
) -> None:  # fmt: skip
    """Write the profile's values for 16 offsets across and 16 up from the middles of pixels, in `offsets` from `at` on.

    Row j of `weights` (2 margin + 1, 2 LANES) is for the j-th of the columns in reach, from the left, and of the rows,
    from the top. No value is below `least`: 0 for filters without lobes, whatever polynomials round to. `room` is
    (4, 2 LANES).
    """
    lanes = hidden(2 * LANES)  # both axes in one loop: as long as the compiler's unrolled vectors
    taps = polynomials.shape[1]
    margin = taps // 2
    scale = 2.0 / half
    far, place = room[0], room[1]
    for i in range(lanes):
        far[i] = abs(offsets[at + i])
        place[i] = scale * far[i] - 1.0
    for j in range(taps):
        own = weights[j]
        _run_polynomial(polynomials[0, j], place, own)
        middle = float(j - margin)
        if polynomials.shape[0] > 1:
            outer = room[2]
            _run_polynomial(polynomials[1, j], place, outer)
            for i in range(lanes):
                own[i] = own[i] if abs(far[i] - middle) <= 0.5 * radius else outer[i]
        for i in range(lanes):
            own[i] = max(own[i], least) if abs(far[i] - middle) <= radius else 0.0
    for j in range(margin):
        left, right = weights[j], weights[taps - 1 - j]
        for i in range(lanes):
            first, last, mirrored = left[i], right[i], offsets[at + i] < 0.0
            left[i] = last if mirrored else first
            right[i] = first if mirrored else last


@njit(cache=True, error_model="numpy", fastmath={"reassoc"}, _nrt=False)
def add_taps(margin: int, weights: FloatArray, colors: FloatArray, at: int, taps: FloatArray, room: FloatArray) -> None:
    """Add 16 samples of one pixel to its taps (2 margin + 1, 2 margin + 1, 4): weighted colours, and weights.

    `weights` as from `weigh_lanes`; `colors` holds red, green and blue from `at` on; `room` is (4, 2 LANES).
    """
    lanes = hidden(LANES)
    for j in range(2 * margin + 1):
        down = weights[j, LANES:]
        for c in range(3):
            own = room[c]
            for i in range(lanes):
                own[i] = down[i] * colors[at + c * LANES + i]
        for k in range(2 * margin + 1):
            across = weights[k]
            red, green, blue, total = 0.0, 0.0, 0.0, 0.0
            for i in range(lanes):
                w = across[i]
                red += w * room[0, i]
                green += w * room[1, i]
                blue += w * room[2, i]
                total += w * down[i]
            taps[j, k, 0] += red
            taps[j, k, 1] += green
            taps[j, k, 2] += blue
            taps[j, k, 3] += total
