"""Slopes of error over samples: planted power laws come back, intervals hold the truth, biases show as plateaus."""

import math

import numpy as np
import pytest
from scipy import stats

from aliasbench.metrics.convergence import fit_slope
from aliasbench.metrics.resampling import RESAMPLES, draw_medians, resampling_weights

COUNTS = np.array([1, 4, 16, 64, 256])
TRIALS = 400
# A coverage of .95 in 400 trials stays above this with probability 1 - 2e-5.
LEAST_HELD = 0.90


def law(counts: np.ndarray, slope: float, at_one: float = 0.3) -> np.ndarray:
    return at_one * np.asarray(counts, dtype=np.float64) ** slope


@pytest.mark.parametrize("slope", [-0.25, -0.5, -0.75, -1.0, -1.5, 0.0, 1.0])
@pytest.mark.parametrize("counts", [(1, 4, 16, 64, 256), (256, 3, 17), (2, 5), (1e-9, 1e9), (4, 4, 9, 9, 9)])
def test_exact_power_laws_are_recovered_to_rounding(slope: float, counts: tuple[float, ...]) -> None:
    score = fit_slope(counts, law(counts, slope))
    # Logarithms below 22 are off by 4e-15, and slopes by that over a spread of 0.8 or more.
    assert (score.value, score.status) == (pytest.approx(slope, abs=1e-14), "ok")
    assert score.extras["at_one"] == pytest.approx(0.3, rel=1e-13)
    assert score.extras["last_slope"] == pytest.approx(slope, abs=1e-14)
    assert score.extras["residual"] < 1e-14
    assert (score.extras["interval"], score.extras["replicates"]) == (None, 1)
    assert score.extras["counts"] == len(set(counts))


@pytest.mark.parametrize("scale", [1e-300, 1e-180, 1.0, 1e180, 1e300])
def test_a_slope_does_not_depend_on_the_unit(scale: float) -> None:
    values = law(COUNTS, -0.5) * np.array([[1.0], [1.3], [0.8], [1.1], [0.7], [1.0]])
    plain, scaled = fit_slope(COUNTS, values), fit_slope(COUNTS, scale * values)
    assert scaled.value == pytest.approx(plain.value, abs=1e-13)
    assert scaled.extras["interval"] == pytest.approx(plain.extras["interval"], abs=1e-12)


def test_replicates_are_put_together_as_their_pool_says() -> None:
    values = np.random.default_rng(1).uniform(0.5, 2.0, size=(7, 5)) * law(COUNTS, -0.6)
    x = np.log(COUNTS)

    def slope(pooled: np.ndarray) -> float:
        return float(np.polyfit(x, np.log(pooled), 1)[0])

    assert fit_slope(COUNTS, values).value == pytest.approx(slope(np.sqrt((values**2).mean(axis=0))), abs=1e-12)
    assert fit_slope(COUNTS, values**2, pool="mse").value == pytest.approx(fit_slope(COUNTS, values).value, abs=1e-12)
    assert fit_slope(COUNTS, values, pool="median").value == pytest.approx(slope(np.median(values, axis=0)), abs=1e-12)


def test_the_residual_interval_is_students_of_the_line() -> None:
    values = law(COUNTS, -0.6) * np.array([1.0, 1.2, 0.9, 1.1, 0.95])
    fit = stats.linregress(np.log(COUNTS), np.log(values))
    half = stats.t.ppf(0.975, 3) * fit.stderr
    got = fit_slope(COUNTS, values).extras["residual_interval"]
    assert got == pytest.approx([fit.slope - half, fit.slope + half], abs=1e-12)
    assert fit_slope(COUNTS[:2], values[:2]).extras["residual_interval"] is None


@pytest.mark.parametrize(
    ("replicates", "kind"),
    [
        (5, "small noise"),
        (5, "skewed noise"),
        (8, "skewed noise"),
        (8, "shared between counts"),
        (20, "small noise"),
    ],
)
def test_intervals_of_slopes_hold_the_planted_slope(replicates: int, kind: str) -> None:
    rng = np.random.default_rng(replicates)
    shape = (replicates, COUNTS.size)
    held, widths = 0, []
    for _ in range(TRIALS):
        sigma = {"small noise": 0.05, "skewed noise": 0.3, "shared between counts": 0.05}[kind]
        factors = np.exp(sigma * rng.normal(size=shape))
        if kind == "shared between counts":
            factors *= np.exp(0.2 * rng.normal(size=(replicates, 1)))
        low, high = fit_slope(COUNTS, law(COUNTS, -0.75) * factors).extras["interval"]
        held += low <= -0.75 <= high
        widths.append(high - low)
    assert held >= LEAST_HELD * TRIALS
    if kind == "small noise" and replicates == 20:
        # Not by being wide: log RMS has a deviation of .05 / sqrt(20), the slope that over sqrt(sum x^2) = 4.38;
        # Student's t of 19 is 2.09 for 1.96.
        x = np.log(COUNTS) - np.log(COUNTS).mean()
        normal = 2 * 1.96 * 0.05 / math.sqrt(20) / math.sqrt(x @ x)
        assert normal * 0.9 < np.mean(widths) < normal * 1.25


def test_intervals_of_times_hold_the_planted_slope_in_spite_of_slow_rounds() -> None:
    rng, slope = np.random.default_rng(4), 0.9
    held = 0
    for _ in range(TRIALS):
        times = law(COUNTS, slope, 1e-3) * np.exp(0.02 * rng.normal(size=(9, COUNTS.size)))
        times[rng.integers(9)] *= 3.0
        low, high = fit_slope(COUNTS, times, pool="median").extras["interval"]
        held += low <= slope <= high
    assert held >= LEAST_HELD * TRIALS


def test_an_interval_needs_five_replicates_and_is_always_the_same() -> None:
    values = law(COUNTS, -0.5) * np.exp(0.1 * np.random.default_rng(5).normal(size=(5, COUNTS.size)))
    assert fit_slope(COUNTS, values[:4]).extras["interval"] is None
    assert fit_slope(COUNTS, values).extras["interval"] is not None
    assert fit_slope(COUNTS, values) == fit_slope(COUNTS, values)


def test_replicates_that_are_all_alike_leave_no_doubt() -> None:
    score = fit_slope(COUNTS, np.repeat(law(COUNTS, -0.75)[None], 8, axis=0))
    assert score.extras["interval"] == pytest.approx([-0.75, -0.75], abs=1e-14)


def test_a_bias_is_a_plateau_that_the_last_slope_shows() -> None:
    counts = 4 ** np.arange(7)
    score = fit_slope(counts, np.hypot(law(counts, -0.5), 0.05))
    # d log hypot(a, b) / d log N = slope a^2 / (a^2 + b^2) lies between its values at the ends of the last piece.
    shares = law(counts[-2:], -0.5) ** 2 / (law(counts[-2:], -0.5) ** 2 + 0.05**2)
    assert -0.5 * shares[0] < score.extras["last_slope"] < -0.5 * shares[1]
    assert score.value > -0.4
    assert score.extras["residual"] > 0.1
    low, high = score.extras["residual_interval"]
    assert low < score.value < high


def test_exact_pictures_have_no_slope() -> None:
    score = fit_slope([1, 4, 16], [0.1, 0.0, 0.02])
    assert (score.value, score.status, score.extras["exact"]) == (None, "identical", [4.0])
    assert fit_slope([1, 4], np.zeros((6, 2))).status == "identical"


def test_replicates_of_which_some_are_exact_count_with_the_others() -> None:
    values = law(COUNTS, -0.75) * np.array([0.0, 0.0, 1.0, 1.1, 0.9, 1.0, 1.2, 0.8])[:, None]
    score = fit_slope(COUNTS, values)
    assert score.value == pytest.approx(-0.75, abs=1e-14)
    low, high = score.extras["interval"]
    assert low <= -0.75 + 1e-12
    assert high >= -0.75 - 1e-12


def test_one_count_has_no_slope() -> None:
    score = fit_slope([16, 16], [0.1, 0.2])
    assert (score.value, score.status, score.extras["counts"]) == (None, "undefined_one_count", 1)


@pytest.mark.parametrize(
    ("counts", "values", "message"),
    [
        ([0, 4], [0.1, 0.2], r"samples: \[0\.0, 4\.0\] must be finite and above 0"),
        ([-1, 4], [0.1, 0.2], "must be finite and above 0"),
        ([1, math.inf], [0.1, 0.2], "must be finite and above 0"),
        ([1, 4], [0.1, math.nan], "values must be finite and not negative"),
        ([1, 4], [0.1, math.inf], "values must be finite and not negative"),
        ([1, 4], [0.1, -0.1], "values must be finite and not negative"),
        ([1, 4], [0.1], r"values of shape \(1,\) do not fit 2 samples"),
        ([1, 4], np.ones((2, 2, 2)), r"values of shape \(2, 2, 2\) do not fit 2 samples"),
        ([1, 4], np.ones((0, 2)), r"values of shape \(0, 2\) do not fit 2 samples"),
        ([], [], r"samples: shape \(0,\); must be one number for each count"),
        ([[1, 4]], [0.1, 0.2], r"samples: shape \(1, 2\); must be one number for each count"),
    ],
)
def test_what_cannot_be_a_curve_is_refused(counts: object, values: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        fit_slope(counts, values)  # type: ignore[arg-type]


@pytest.mark.parametrize("replicates", [1, 5, 64, 65, 600])
def test_every_resampling_draws_as_many_as_there_are(replicates: int) -> None:
    weights = np.concatenate(list(resampling_weights(replicates)))
    assert weights.shape == (RESAMPLES, replicates)
    assert (weights.sum(axis=1) == replicates).all()
    # Each is drawn once on average, with variance 1 - 1 / n: five standard deviations of the mean of RESAMPLES draws.
    assert np.abs(weights.mean(axis=0) - 1.0).max() <= 5.0 / math.sqrt(RESAMPLES)
    if replicates > 1:
        assert (weights != np.concatenate(list(resampling_weights(replicates, 1)))).any()


@pytest.mark.parametrize("replicates", [1, 2, 5, 8])
def test_medians_of_resamplings_are_those_of_the_values_drawn(replicates: int) -> None:
    values = np.random.default_rng(6).normal(size=(replicates, 2))
    (weights,) = resampling_weights(replicates)
    expected = [np.median(np.repeat(values, w.astype(int), axis=0), axis=0) for w in weights[:50]]
    np.testing.assert_allclose(draw_medians(values, 0)[:50], expected, rtol=1e-15)
