"""Laws of Sobol's points, Owen's scrambling of them, and the 32-bit arithmetic and permutations beneath.

A (t, m, s)-net in base 2 is 2^m points of which every elementary interval (a box of sides 2^-d1 .. 2^-ds that starts at
multiples of them) of volume 2^(t-m) holds exactly 2^t. TRIALS=10 asks for ten times as many scramblings.
"""

import itertools
import os
import warnings

import numpy as np
import pytest
from numba import njit
from scipy import stats
from scipy.stats import qmc

from aliasbench.renderers.sampling import bits
from aliasbench.renderers.sampling.hashing import mix32, permute, permute_power
from aliasbench.renderers.sampling.patterns import sample_set
from aliasbench.renderers.sampling.sobol import (
    DIMENSIONS,
    TO_UNIT,
    scramble,
    scrambled_unit,
    shuffled,
    sobol_bits,
    sobol_tables,
)
from aliasbench.scenes.model import FloatArray

KEYS = 8192 * max(1, int(os.environ.get("TRIALS", "0")))
PLANES = ((0, 1), (3, 4), (5, 6), (8, 9))  # place in the pixel, lens, light, direction
LINES = (0, 1, 2, 3, 4, 5, 6, 7, 8, 9)


@njit(cache=True)
def point_words(tables, dimension, numbers):
    out = np.empty(len(numbers), np.uint32)
    for i in range(len(numbers)):
        out[i] = bits.reverse32(sobol_bits(tables, dimension, numbers[i]))
    return out


@njit(cache=True)
def scrambled_units(tables, dimension, number, keys):
    out = np.empty(len(keys))
    for i in range(len(keys)):
        out[i] = scrambled_unit(sobol_bits(tables, dimension, number), keys[i])
    return out


@njit(cache=True)
def scrambled_words(words, key):
    out = np.empty(len(words), np.uint32)
    for i in range(len(words)):
        out[i] = bits.reverse32(scramble(bits.reverse32(words[i]), key))
    return out


@njit(cache=True)
def shuffled_numbers(numbers, key):
    out = np.empty(len(numbers), np.uint32)
    for i in range(len(numbers)):
        out[i] = shuffled(numbers[i], key)
    return out


@njit(cache=True)
def permuted(count, key):
    out = np.empty(count, np.int64)
    for i in range(count):
        out[i] = permute(i, count, key)
    return out


@njit(cache=True)
def permuted_power(count, key):
    out = np.empty(count, np.int64)
    for i in range(count):
        out[i] = permute_power(i, np.uint32(count - 1), key)
    return out


@njit(cache=True)
def mixed(numbers):
    out = np.empty(len(numbers), np.uint64)
    for i in range(len(numbers)):
        out[i] = mix32(numbers[i])
    return out


@njit(cache=True)
def word_operations(a, b, shift):
    return (
        bits.add32(a, b),
        bits.mul32(a, b),
        bits.xor32(a, b),
        bits.and32(a, b),
        bits.or32(a, b),
        bits.shift_right32(a, shift),
        bits.reverse32(a),
    )


def random_words(count: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 2**32, count, dtype=np.uint32)


def points(numbers: np.ndarray) -> FloatArray:
    """Return the unscrambled points (n, 3) of sample numbers."""
    words = [point_words(sobol_tables(), d, numbers.astype(np.uint32)) for d in range(DIMENSIONS)]
    return np.stack(words, axis=1) * TO_UNIT


def assert_net(block: FloatArray, t: int = 0) -> None:
    """Hold (2^m, s) points against every elementary interval of volume 2^(t - m)."""
    count, dimensions = block.shape
    m = count.bit_length() - 1
    assert count == 1 << m
    free = max(m - t, 0)
    for shape in itertools.product(range(free + 1), repeat=dimensions):
        if sum(shape) == free:
            cell = np.zeros(count, int)
            for d, digits in enumerate(shape):
                cell = (cell << digits) + np.floor(block[:, d] * (1 << digits)).astype(int)
            assert np.array_equal(np.bincount(cell, minlength=1 << free), np.full(1 << free, count >> free)), shape


def test_words_are_added_and_multiplied_modulo_two_to_the_32() -> None:
    top = 2**32 - 1
    pairs = [(0, 0), (top, top), (top, 1), (1 << 31, 2), *random_words(40, 1).reshape(20, 2).tolist()]
    for a, b in pairs:
        shift = b % 32
        expected = ((a + b) & top, a * b & top, a ^ b, a & b, a | b, a >> shift, int(f"{a:032b}"[::-1], 2))
        assert word_operations(np.uint32(a), np.uint32(b), np.uint32(shift)) == expected


@pytest.mark.parametrize("count", [1, 5, 4096, 10000])
@pytest.mark.parametrize("first", [0, 1, 4095, 4096, 2**24 - 10000])
def test_points_are_those_of_scipy(count: int, first: int) -> None:
    # The library's number n is Gray's code of n here: the same points in aligned blocks, in another order.
    sequence = qmc.Sobol(DIMENSIONS, scramble=False, bits=32)
    if first:
        sequence.fast_forward(first)
    numbers = np.arange(first, first + count)
    # (it warns that a first block is no power of two)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        expected = sequence.random(count)
    assert np.array_equal(points(numbers ^ numbers >> 1), expected)
    if first == 0 and count == 4096:
        assert sorted(points(numbers).tolist()) == sorted(expected.tolist())


def test_the_first_dimension_is_the_number_with_its_bits_reversed() -> None:
    numbers = np.concatenate([np.arange(5000), [2**24 - 1, 2**23, 4097 * 4095]])
    assert points(numbers)[:, 0].tolist() == [int(f"{n:032b}"[::-1], 2) * TO_UNIT for n in numbers.tolist()]


@pytest.mark.parametrize("exponent", range(13))
@pytest.mark.parametrize("start", [0, 1, 7, -1])
def test_aligned_blocks_are_nets(exponent: int, start: int) -> None:
    count = 1 << exponent
    first = start * count if start >= 0 else 2**24 - count
    block = points(np.arange(first, first + count))
    assert_net(block[:, :2])
    assert_net(block, t=1)


@pytest.mark.parametrize("exponent", [0, 1, 2, 3, 4, 6, 8, 10])
@pytest.mark.parametrize("block", [0, 1, 3])
def test_aligned_blocks_of_samples_are_nets_in_every_pair(exponent: int, block: int) -> None:
    count = 1 << exponent
    for seed in range(6):
        samples = sample_set("sobol", 4 * count, seed=seed, pixel=(seed, 3))[block * count : (block + 1) * count]
        for plane in PLANES:
            assert_net(samples[:, plane])
        for line in LINES:
            assert_net(samples[:, [line]])
        assert_net(samples[:, :3], t=1)


def test_long_sets_are_nets_in_every_pair() -> None:
    samples = sample_set("sobol", 2**14, seed=3, pixel=(5, 6))
    for block in (samples, samples[3 * 4096 :], samples[4096 + 512 : 4096 + 1024]):
        for plane in PLANES:
            assert_net(block[:, plane])
        assert_net(block[:, :3], t=1)


def star_discrepancy(places: FloatArray) -> float:
    """Return the star discrepancy of (n, 2) points: it is reached at boxes, closed or open, that points bound."""
    n = len(places)
    x, y = (np.append(np.sort(places[:, d]), 1.0) for d in range(2))
    inside = [
        np.less_equal(places[:, 0], x[:, None]).astype(np.float64) @ np.less_equal(places[:, 1], y[:, None]).T,
        np.less(places[:, 0], x[:, None]).astype(np.float64) @ np.less(places[:, 1], y[:, None]).T,
    ]
    area = np.outer(x, y)
    return float(max((inside[0] / n - area).max(), (area - inside[1] / n).max()))


def discrepancy_bound(count: int) -> float:
    """Return what the star discrepancy of the first `count` points of a (0, 2)-sequence never exceeds.

    That of a (0, m, 2)-net in base 2, times its 2^m points, is at most floor(m / 2 + 3 / 2) (Niederreiter 1992,
    theorem 4.7), and a prefix is a union of such nets, one for each bit of its length.
    """
    return sum((m + 3) // 2 for m in range(count.bit_length()) if count >> m & 1) / count


@pytest.mark.parametrize("plane", PLANES)
def test_any_prefix_is_well_spread(plane: tuple[int, int]) -> None:
    counts = [*range(1, 66), 97, 127, 200, 255, 256, 257, 300]
    places = sample_set("sobol", 300, seed=8, pixel=(1, 2))[:, plane]
    assert [n for n in counts if star_discrepancy(places[:n]) > discrepancy_bound(n)] == []
    # The bound is no empty promise: random points break it.
    places = sample_set("random", 300, seed=8, pixel=(1, 2))[:, plane]
    assert star_discrepancy(places[:256]) > discrepancy_bound(256)


@pytest.mark.parametrize("key", [0, 1, 0xFFFFFFFF, 0x80000000, 0x12345678])
def test_scrambling_is_nested_and_loses_nothing(key: int) -> None:
    # Owen's: two numbers agree in as many leading bits after as before, so that nets stay nets.
    words = random_words(20000, 3)
    near = words ^ (np.uint32(1) << random_words(20000, 4) % np.uint32(32))
    both = scrambled_words(words, np.uint32(key)), scrambled_words(near, np.uint32(key))
    agree = [np.floor(np.log2((a ^ b).astype(np.float64))) for a, b in ((words, near), both)]
    assert np.array_equal(*agree)


def test_shuffling_keeps_aligned_blocks_together() -> None:
    for key in random_words(20, 5):
        numbers = shuffled_numbers(np.arange(4096, dtype=np.uint32), key)
        for m in range(13):
            blocks = (numbers >> np.uint32(m)).reshape(-1, 1 << m)
            assert np.array_equal(blocks, np.broadcast_to(blocks[:, :1], blocks.shape))
            assert len(np.unique(blocks[:, 0])) == 4096 >> m


def chance_limit(tests: int) -> float:
    """Return Sidak's limit for one false alarm in a thousand."""
    return 1.0 - (1.0 - 1e-3) ** (1.0 / tests)


@pytest.mark.parametrize("dimension", range(DIMENSIONS))
def test_scrambling_is_unbiased(dimension: int) -> None:
    # Over keys, every point is uniform, and any two are independent but for the leading bits that they share and the
    # one after, which differs: what makes the variance of scrambled nets what it is.
    keys = mixed(np.arange(KEYS, dtype=np.uint64)).astype(np.uint32)
    numbers = (0, 1, 2, 3, 5, 12, 4095, 2**24 - 1)
    units = [scrambled_units(sobol_tables(), dimension, np.uint32(n), keys) for n in numbers]
    p_values = []
    for u in units:
        p_values.append(stats.chisquare(np.bincount((u * 256).astype(int), minlength=256)).pvalue)
        assert abs(u.mean() - 0.5) < 4.5 / np.sqrt(12.0 * KEYS)
    bare = (points(np.array(numbers))[:, dimension] * 16).astype(int)
    cells = np.arange(16)
    lengths = np.array([int(c).bit_length() for c in cells])
    for (a, b), (u, v) in zip(itertools.combinations(bare, 2), itertools.combinations(units, 2), strict=True):
        # Of the four leading bits, pairs of cells share as many as the unscrambled points do.
        possible = (lengths[cells[:, None] ^ cells] == lengths[a ^ b]).ravel()
        table = np.bincount((u * 16).astype(int) * 16 + (v * 16).astype(int), minlength=256)
        assert table[~possible].sum() == 0
        p_values.append(stats.chisquare(table[possible]).pvalue)
    assert min(p_values) > chance_limit(len(p_values)), np.round(p_values, 6)


@pytest.mark.parametrize("exponent", range(0, 15, 2))
def test_the_permutation_of_a_power_of_two_is_the_general_one(exponent: int) -> None:
    count = 1 << exponent
    for key in [0, 1, 2**32 - 1, *random_words(20, 6).tolist()]:
        expected = permuted(count, np.uint64(key))
        assert np.array_equal(permuted_power(count, np.uint32(key)), expected)
        assert np.array_equal(np.sort(expected), np.arange(count))


@pytest.mark.parametrize("count", [1, 2, 3, 5, 7, 11, 17, 97, 1000, 4097])
def test_permutations_of_any_count_lose_nothing(count: int) -> None:
    for key in random_words(20, 7).tolist():
        assert np.array_equal(np.sort(permuted(count, np.uint64(key))), np.arange(count))
