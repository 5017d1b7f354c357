"""Arithmetic on 32 bits inside kernels, as the processor's vectors have it.

numba widens every operation on uint32 to 64 bits, which halves the lanes of a vector and turns multiplications into
slow ones; these stay at 32 bits and wrap. In Python itself they cannot be called: hashes are kernels' business.
"""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

_WORD = ir.IntType(32)


def _binary(build: Callable[[Any, Any, Any], Any]) -> Callable[[Any, Any, Any], Any]:
    def define(typing_context: Any, first: Any, second: Any) -> Any:  # noqa: ARG001 - numba passes it
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
            return build(builder, arguments[0], arguments[1])

        return types.uint32(types.uint32, types.uint32), generate

    return define


@intrinsic
def add32(typing_context: Any, first: Any, second: Any) -> Any:
    """Return the sum, modulo 2^32."""
    return _binary(lambda builder, a, b: builder.add(a, b))(typing_context, first, second)


@intrinsic
def mul32(typing_context: Any, first: Any, second: Any) -> Any:
    """Return the product, modulo 2^32."""
    return _binary(lambda builder, a, b: builder.mul(a, b))(typing_context, first, second)


@intrinsic
def xor32(typing_context: Any, first: Any, second: Any) -> Any:
    """Return the exclusive or."""
    return _binary(lambda builder, a, b: builder.xor(a, b))(typing_context, first, second)


@intrinsic
def and32(typing_context: Any, first: Any, second: Any) -> Any:
    """Return the bitwise and."""
    return _binary(lambda builder, a, b: builder.and_(a, b))(typing_context, first, second)


@intrinsic
def or32(typing_context: Any, first: Any, second: Any) -> Any:
    """Return the bitwise or."""
    return _binary(lambda builder, a, b: builder.or_(a, b))(typing_context, first, second)


@intrinsic
def shift_right32(typing_context: Any, value: Any, count: Any) -> Any:
    """Return the value without its lowest `count` bits, zeros coming in from above."""
    return _binary(lambda builder, a, b: builder.lshr(a, b))(typing_context, value, count)


@intrinsic
def reverse32(typing_context: Any, value: Any) -> Any:  # noqa: ARG001 - numba passes it
    """Return the bits in reverse order."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
        kind = ir.FunctionType(_WORD, [_WORD])
        function = builder.module.declare_intrinsic("llvm.bitreverse", [_WORD], kind)
        return builder.call(function, [arguments[0]])

    return types.uint32(types.uint32), generate


@intrinsic
def hidden(typing_context: Any, number: Any) -> Any:  # noqa: ARG001 - numba passes it
    """Return the number through an empty instruction: loops of a known length are unrolled and never vectorised."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
        word = ir.IntType(64)
        return builder.asm(ir.FunctionType(word, [word]), "", "=r,0", [arguments[0]], False)

    return types.int64(types.int64), generate
