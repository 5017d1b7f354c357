"""Which lanes of a packet are alike, as the bits of a word: one comparison of a whole vector, where a loop takes 16.

What hits several triangles is looked up triangle by triangle, and finding the lanes of each is most of what that costs.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

ALL_LANES = 0xFFFF

_WORD, _LANES = ir.IntType(32), 16


@intrinsic
def equal_lanes(typing_context: Any, lanes: Any, value: Any) -> Any:  # noqa: ARG001 - numba passes it
    """Return bit i where entry i of 16 contiguous int32 equals an int32."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        vector = ir.VectorType(_WORD, _LANES)
        nothing = ir.Constant(vector, ir.Undefined)
        words = builder.load(builder.bitcast(array.data, vector.as_pointer()), align=4)
        first = builder.insert_element(nothing, arguments[1], ir.Constant(_WORD, 0))
        copies = builder.shuffle_vector(first, nothing, ir.Constant(vector, [0] * _LANES))
        bits = builder.bitcast(builder.icmp_signed("==", words, copies), ir.IntType(_LANES))
        return builder.zext(bits, ir.IntType(64))

    return types.int64(lanes, types.int32), generate


@intrinsic
def lowest_bit(typing_context: Any, word: Any) -> Any:  # noqa: ARG001 - numba passes it
    """Return the place of the lowest bit that is set, of an int64 that is not 0."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
        return builder.cttz(arguments[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.int64), generate
