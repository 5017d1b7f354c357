"""Addressable randomness: a number for every (seed, frame, pixel, sample, dimension), in any order, on any thread.

Integer hashes on 32 bits. numba widens uint32 arithmetic to 64 bits, so everything is kept in uint64 and masked back;
the mixer is Wellons' `lowbias32` (bias .17 of an ideal hash). Every dimension hashes the seed anew: deriving one from
another linearly showed as a bias of three standard errors.
"""

import numpy as np
from numba import njit

from aliasbench.renderers.sampling.bits import add32, and32, mul32, or32, shift_right32, xor32

MASK = np.uint64(0xFFFFFFFF)
_MULTIPLIER_1 = np.uint64(0x7FEB352D)
_MULTIPLIER_2 = np.uint64(0x846CA68B)
_GOLDEN = np.uint64(0x9E3779B9)
_S15, _S16 = np.uint64(15), np.uint64(16)
_FIRST, _SECOND, _GOLDEN_WORD = np.uint32(_MULTIPLIER_1), np.uint32(_MULTIPLIER_2), np.uint32(_GOLDEN)
_FIFTEEN, _SIXTEEN = np.uint32(15), np.uint32(16)
_TO_UNIT = 2.0**-32

# Pixel coordinates that stand for "all pixels alike".
SHARED = -1


@njit(inline="always", cache=True)
def mix32(x: int) -> np.uint64:
    """Return a bijective scramble of the low 32 bits, as uint64."""
    h = np.uint64(x) & MASK
    h ^= h >> _S16
    h = (h * _MULTIPLIER_1) & MASK
    h ^= h >> _S15
    h = (h * _MULTIPLIER_2) & MASK
    return h ^ (h >> _S16)


@njit(inline="always", cache=True)
def combine(key: int, value: int) -> np.uint64:
    """Return the hash of a key extended by one more integer (negative ones wrap)."""
    return mix32((np.uint64(key) + _GOLDEN + (mix32(np.uint64(np.int64(value)) & MASK) ^ np.uint64(0x5BF03635))) & MASK)


@njit(inline="always", cache=True)
def unit(key: int, index: int) -> float:
    """Return a number in [0, 1), a multiple of 2^-32, for one index under a key."""
    word = np.uint32(key)
    x = xor32(add32(word, mul32(np.uint32(index), _GOLDEN_WORD)), shift_right32(word, _FIFTEEN))
    x = mul32(xor32(x, shift_right32(x, _SIXTEEN)), _FIRST)
    x = mul32(xor32(x, shift_right32(x, _FIFTEEN)), _SECOND)
    return float(xor32(x, shift_right32(x, _SIXTEEN))) * _TO_UNIT


@njit(inline="always", cache=True)
def frame_key(seed: int, frame: int) -> np.uint64:
    """Return what the keys of all patterns of one frame start from."""
    return combine(combine(combine(0x243F6A88, seed & 0xFFFFFFFF), seed >> 32), frame)


@njit(inline="always", cache=True)
def pixel_key(start: int, column: int, row: int) -> np.uint64:
    """Return the key of one pixel's pattern from its frame's; `column = row = SHARED` for that of all pixels."""
    return combine(combine(start, column), row)


@njit(cache=True)
def pattern_key(seed: int, frame: int, column: int, row: int) -> np.uint64:
    """Return the key of one pixel's pattern; `column = row = SHARED` for the pattern of all pixels."""
    return pixel_key(frame_key(seed, frame), column, row)


@njit(inline="always", cache=True)
def permute(index: int, count: int, key: int) -> int:
    """Return where a pseudo-random permutation of range(count) takes `index` (Kensler 2013, cycle walking)."""
    if count <= 1:
        return 0
    w = np.uint64(count - 1)
    w |= w >> np.uint64(1)
    w |= w >> np.uint64(2)
    w |= w >> np.uint64(4)
    w |= w >> np.uint64(8)
    w |= w >> _S16
    p = np.uint64(key)
    i = np.uint64(index)
    one = np.uint64(1)
    while True:
        i ^= p
        i = (i * np.uint64(0xE170893D)) & MASK
        i ^= p >> _S16
        i ^= (i & w) >> np.uint64(4)
        i ^= p >> np.uint64(8)
        i = (i * np.uint64(0x0929EB3F)) & MASK
        i ^= p >> np.uint64(23)
        i ^= (i & w) >> one
        i = (i * (one | (p >> np.uint64(27)))) & MASK
        i = (i * np.uint64(0x6935FA69)) & MASK
        i ^= (i & w) >> np.uint64(11)
        i = (i * np.uint64(0x74DCB303)) & MASK
        i ^= (i & w) >> np.uint64(2)
        i = (i * np.uint64(0x9E501CC3)) & MASK
        i ^= (i & w) >> np.uint64(2)
        i = (i * np.uint64(0xC860A3DF)) & MASK
        i &= w
        i ^= i >> np.uint64(5)
        if i < np.uint64(count):
            break
    return int(np.int64((i + p) % np.uint64(count)))  # unsigned and signed make float64


@njit(inline="always", cache=True)
def permute_power(index: int, mask: np.uint32, key: np.uint32) -> np.uint32:
    """Return `permute` for a count of mask + 1, a power of two: without a loop, so that many are done at once."""
    p, i = key, xor32(np.uint32(index), key)
    i = mul32(i, np.uint32(0xE170893D))
    i = xor32(i, shift_right32(p, np.uint32(16)))
    i = xor32(i, shift_right32(and32(i, mask), np.uint32(4)))
    i = xor32(i, shift_right32(p, np.uint32(8)))
    i = mul32(i, np.uint32(0x0929EB3F))
    i = xor32(i, shift_right32(p, np.uint32(23)))
    i = xor32(i, shift_right32(and32(i, mask), np.uint32(1)))
    i = mul32(i, or32(np.uint32(1), shift_right32(p, np.uint32(27))))
    i = mul32(i, np.uint32(0x6935FA69))
    i = xor32(i, shift_right32(and32(i, mask), np.uint32(11)))
    i = mul32(i, np.uint32(0x74DCB303))
    i = xor32(i, shift_right32(and32(i, mask), np.uint32(2)))
    i = mul32(i, np.uint32(0x9E501CC3))
    i = xor32(i, shift_right32(and32(i, mask), np.uint32(2)))
    i = and32(mul32(i, np.uint32(0xC860A3DF)), mask)
    i = xor32(i, shift_right32(i, np.uint32(5)))
    return and32(add32(i, p), mask)
