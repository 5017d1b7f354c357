"""Fisher's exact test against rational arithmetic, many digits, simulation and its limit."""

import math
from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np
import pytest
from scipy.optimize import brentq

from aliasbench.metrics.catalog import measure
from aliasbench.metrics.fisher import LARGEST_FIRST_TERM, fisher_p_value


def rational_p_value(g, n):
    share = Fraction(g)
    terms = ((-1) ** (j - 1) * math.comb(n, j) * (1 - j * share) ** (n - 1) for j in range(1, n + 1) if j * share < 1)
    return float(sum(terms))


def p_value_of_many_digits(g, n, terms=400, digits=150):
    """The first terms, in ordinary order; the first one left out bounds the rest once terms decrease."""
    with localcontext() as context:
        context.prec = digits
        total, ways = Decimal(0), Decimal(1)
        for j in range(1, terms + 1):
            rest = 1 - j * Decimal(g)
            if rest <= 0:
                return float(total)
            ways = ways * (n - j + 1) / j
            term = ways * rest ** (n - 1)
            total += (-1) ** (j - 1) * term
        assert term < Decimal("1e-30")
        return float(total)


def first_term(g, n):
    return n * math.exp((n - 1) * math.log1p(-g))


@pytest.mark.parametrize("n", [2, 3, 5, 12, 40, 98])
def test_small_numbers_of_ordinates_equal_rational_arithmetic(n):
    shares = [1.0 / n + s * (1.0 - 1.0 / n) for s in (1e-6, 0.01, 0.07, 0.2, 0.5, 0.83, 0.999)]
    for g in [*shares, 0.25, 0.5]:
        # Both are exact sums rounded to float64; the series is cut at 1e-20 of the sum.
        assert fisher_p_value(g, n) == pytest.approx(rational_p_value(g, n), rel=1e-15, abs=1e-300)


@pytest.mark.parametrize("n", [700, 25716, 400_000])
@pytest.mark.parametrize("first", [1e-200, 1e-9, 0.05, 0.7, 3.0, 12.0, 39.9])
def test_large_numbers_of_ordinates_equal_sums_of_many_digits(n, first):
    g = -math.expm1(math.log(first / n) / (n - 1))
    assert fisher_p_value(g, n) == pytest.approx(p_value_of_many_digits(g, n), rel=1e-15)


@pytest.mark.parametrize("n", [200, 3000, 25716])
def test_where_the_series_gives_way_to_its_bound_nothing_is_lost(n):
    g = brentq(lambda x: first_term(x, n) - LARGEST_FIRST_TERM, 1.0 / n, 0.9)
    for factor in (1 - 1e-9, 1 + 1e-9):
        # The complement is at most e^-40 there, below half a unit in the last place of 1.
        assert fisher_p_value(g * factor, n) == 1.0
        assert p_value_of_many_digits(g * factor, n) == 1.0


@pytest.mark.parametrize(("n", "trials"), [(4, 40_000), (24, 40_000), (300, 8_000)])
def test_simulated_shares_exceed_a_level_as_often(n, trials):
    power = np.random.default_rng(n).exponential(size=(trials, n))
    share = np.max(power, axis=1) / np.sum(power, axis=1)
    for g in np.quantile(share, [0.05, 0.5, 0.9, 0.99]):
        p = fisher_p_value(float(g), n)
        # Five standard deviations of a count; the quantile itself came from the same trials.
        assert np.mean(share > g) == pytest.approx(p, abs=5 * math.sqrt(p * (1 - p) / trials))


def test_the_limit_for_many_ordinates_is_gumbels_law():
    n = 1_000_000
    for t in (0.01, 0.5, 2.0):
        g = -math.expm1(math.log(t / n) / (n - 1))
        # Terms differ from t^j / j! by a share of order (ln n)^2 / n.
        assert fisher_p_value(g, n) == pytest.approx(-math.expm1(-t), rel=4 * math.log(n) ** 2 / n)


def test_ends_of_the_range():
    assert fisher_p_value(1.0, 1) == 1.0  # one ordinate always has all
    assert fisher_p_value(1.0, 50) == 0.0
    assert fisher_p_value(0.02, 50) == 1.0  # the largest has at least its share
    assert fisher_p_value(0.0, 50) == 1.0
    assert fisher_p_value(1.0 - 1e-12, 400_000) == 0.0
    assert fisher_p_value(0.5, 2) == 1.0
    assert fisher_p_value(0.75, 2) == 0.5


@pytest.mark.parametrize(("g", "n"), [(-0.1, 5), (1.1, 5), (0.5, 0), (float("nan"), 5)])
def test_what_is_no_share_is_refused(g, n):
    with pytest.raises(ValueError, match="g must be in"):
        fisher_p_value(g, n)


@pytest.mark.parametrize("size", [(16, 16), (17, 23), (24, 15)])
def test_of_white_noise_pictures_p_is_uniform(make_scene, rgb, size):
    rng = np.random.default_rng(size[0])
    count = 300
    truth = rgb(np.zeros((1, size[1], size[0])))
    found = np.sort(
        [
            float(
                str(
                    measure(
                        "moire_peak",
                        rgb(sigma * rng.normal(size=(1, size[1], size[0]))),
                        truth,
                        scene=make_scene(size),
                        filter_radius_px=0.0,
                    ).extras["p_value"]
                )
            )
            for sigma in rng.uniform(0.01, 10.0, count)
        ]
    )
    expected = (np.arange(count) + 0.5) / count
    # Kolmogorov: the largest distance exceeds 1.95 / sqrt(n) once in a thousand times.
    assert np.max(np.abs(found - expected)) < 1.95 / math.sqrt(count)


def test_p_of_several_pictures_counts_all_of_them(make_scene, rgb):
    noise = np.random.default_rng(3).normal(size=(2, 5, 20, 20))
    score = measure("moire_peak", rgb(noise), rgb(np.zeros((5, 20, 20))), scene=make_scene((20, 20)))
    p = float(str(score.extras["p_value"]))
    # 18 x 18 pixels: of the 69 points of a lattice within a radius of 4.5, half of all but the middle
    assert score.extras["ordinates"] == 34
    assert score.extras["p_value_any"] == pytest.approx(1 - (1 - p) ** 10, rel=1e-12)
