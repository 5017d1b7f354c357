"""Sobol's sequence under Owen's scrambling: sample numbers to points, in any order, at about a nanosecond each.

Three dimensions (Joe & Kuo 2008, new-joe-kuo-6.21201); the first two are a (0, 2)-sequence: the first 2^m points, and
any aligned 2^m after them, have one point in every elementary interval of area 2^-m. What needs more dimensions takes
the first two or one of them again in an order of its own (`shuffled`), which is well spread in itself and at random
relative to the others (padding, as in Burley 2020).

Owen's nested scrambling is a hash that lets every bit depend on higher ones alone (Laine & Karras 2011, with the
constants of Vegdahl 2021), applied to bit-reversed numbers; keys are 32 bits. Points are linear over their number's
bits, so two tables of 4096 rows give any of 2^24 points by one exclusive or.
"""

import functools

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.sampling.bits import add32, and32, mul32, or32, reverse32, shift_right32, xor32

WordArray = NDArray[np.uint32]

DIMENSIONS = 3
TABLE_BITS = 12
_TABLE = 1 << TABLE_BITS
# Degree, coefficients and first direction numbers of the primitive polynomials of dimensions 1 and 2.
_POLYNOMIALS = ((1, 0, (1,)), (2, 1, (1, 3)))

_M1, _M2, _M3 = np.uint32(0x3D20ADEA), np.uint32(0x05526C56), np.uint32(0x53A22864)
_ONE, _SIXTEEN = np.uint32(1), np.uint32(16)
TO_UNIT = 2.0**-32


def _directions() -> NDArray[np.uint32]:
    """Return (DIMENSIONS, 32) direction numbers, the first bit's first."""
    out = np.zeros((DIMENSIONS, 32), np.uint64)
    out[0] = [1 << (31 - k) for k in range(32)]
    for row, (degree, coefficients, first) in zip(out[1:], _POLYNOMIALS, strict=True):
        numbers = list(first)
        for k in range(degree, 32):
            value = numbers[k - degree] ^ (numbers[k - degree] << degree)
            for j in range(1, degree):
                value ^= ((coefficients >> (degree - 1 - j)) & 1) * (numbers[k - j] << j)
            numbers.append(value)
        row[:] = [n << (31 - k) for k, n in enumerate(numbers)]
    return out.astype(np.uint32)


@functools.cache
def sobol_tables() -> WordArray:
    """Return (2, DIMENSIONS, 4096) uint32: bit-reversed points of numbers k, and of numbers 4096 k."""
    directions = _directions()
    out = np.zeros((2, DIMENSIONS, _TABLE), np.uint32)
    numbers = np.arange(_TABLE)
    for half in range(2):
        for bit in range(TABLE_BITS):
            has_bit = (numbers >> bit) & 1 == 1
            out[half][:, has_bit] ^= directions[:, half * TABLE_BITS + bit, None]
    return _reversed(out.ravel()).reshape(out.shape)


@njit(cache=True)
def _reversed(words: WordArray) -> WordArray:
    out = np.empty_like(words)
    for i in range(len(words)):
        out[i] = reverse32(words[i])
    return out


@njit(inline="always", cache=True)
def scramble(reversed_bits: np.uint32, key: np.uint32) -> np.uint32:
    """Return Owen's scrambling of a bit-reversed number, in the same order of bits."""
    x = reversed_bits
    x = xor32(x, mul32(x, _M1))
    x = add32(x, key)
    x = mul32(x, or32(shift_right32(key, _SIXTEEN), _ONE))
    x = xor32(x, mul32(x, _M2))
    return xor32(x, mul32(x, _M3))


@njit(inline="always", cache=True)
def scrambled_unit(reversed_bits: np.uint32, key: np.uint32) -> float:
    """Return the point in [0, 1), a multiple of 2^-32, of a bit-reversed number under a key."""
    return float(reverse32(scramble(reversed_bits, key))) * TO_UNIT


@njit(inline="always", cache=True)
def shuffled(number: int, key: np.uint32) -> np.uint32:
    """Return another number for a sample: a permutation that keeps aligned blocks of 2^m numbers together."""
    return reverse32(scramble(reverse32(np.uint32(number)), key))


@njit(inline="always", cache=True)
def sobol_bits(tables: WordArray, dimension: int, number: np.uint32) -> np.uint32:
    """Return the bit-reversed point of a sample number below 2^24."""
    low = and32(number, np.uint32(_TABLE - 1))
    high = and32(shift_right32(number, np.uint32(TABLE_BITS)), np.uint32(_TABLE - 1))
    return xor32(tables[0, dimension, low], tables[1, dimension, high])
