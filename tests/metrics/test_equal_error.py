"""Time to an error, error in a time and speed-ups: planted laws come back, and nothing is extrapolated silently."""

import math

import numpy as np
import pytest

from aliasbench.metrics.equal_error import Curve, error_at_time, samples_to_error, speedup_at_error, time_to_error
from aliasbench.metrics.score import Score

COUNTS = np.array([1.0, 4.0, 16.0, 64.0, 256.0])
TRIALS = 400
LEAST_HELD = 0.90  # see test_convergence


def law(counts: np.ndarray, slope: float, at_one: float = 0.3) -> np.ndarray:
    return at_one * np.asarray(counts, dtype=np.float64) ** slope


@pytest.mark.parametrize("slope", [-0.5, -0.75, -1.0])
@pytest.mark.parametrize("shuffled", [False, True])
def test_exact_laws_are_recovered_within_and_beyond_what_was_measured(slope: float, shuffled: bool) -> None:
    counts = np.random.default_rng(1).permutation(COUNTS) if shuffled else COUNTS
    times, errors = 2e-3 * counts**0.9, law(counts, slope)
    within = dict.fromkeys((1.0, 4.0, 37.3, 256.0), "ok")
    for samples, status in (within | dict.fromkeys((0.2, 900.0), "extrapolated")).items():
        error, time = float(law(samples, slope)), 2e-3 * samples**0.9
        # Logarithms below 7 are off by 1e-15; pieces are extended fifty units, and slopes of -1/2 double it again.
        for score, expected in (
            (samples_to_error(counts, errors, error), samples),
            (time_to_error(times, errors, error), time),
            (error_at_time(times, errors, time), error),
        ):
            assert (score.value, score.status) == (pytest.approx(expected, rel=1e-12), status)
            assert score.extras["interval"] is None
            assert score.extras["covers"] == []


def test_the_range_that_was_measured_is_told() -> None:
    score = time_to_error(COUNTS, law(COUNTS, -0.5), 1e-4)
    assert score.status == "extrapolated"
    assert score.extras["measured"] == pytest.approx([0.3, 0.3 / 16])
    assert error_at_time(COUNTS, law(COUNTS, -0.5), 1e-4).extras["measured"] == pytest.approx([1.0, 256.0])


def test_a_curve_goes_through_its_points_and_straight_between_them() -> None:
    times, errors = np.array([1.0, 3.0, 20.0]), np.array([0.4, 0.05, 0.04])
    for time, error in zip(times, errors, strict=True):
        assert time_to_error(times, errors, error).value == pytest.approx(time, rel=1e-12)
        assert error_at_time(times, errors, time).value == pytest.approx(error, rel=1e-12)
    half = time_to_error(times, errors, math.sqrt(0.4 * 0.05)).value
    assert half == pytest.approx(math.sqrt(3.0), rel=1e-12)


def test_settings_that_are_beaten_do_not_count() -> None:
    times = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 32.0])
    errors = np.array([0.4, 0.5, 0.1, 0.1, 0.3, 0.05])
    front = [0, 2, 5]
    for target in np.geomspace(0.05, 0.4, 13):
        got = time_to_error(times, errors, target)
        assert got.status == "ok"
        assert got.value == pytest.approx(time_to_error(times[front], errors[front], target).value, rel=1e-12)
    for time in np.geomspace(1.0, 32.0, 13):
        got = error_at_time(times, errors, time)
        assert got.value == pytest.approx(error_at_time(times[front], errors[front], time).value, rel=1e-12)


def test_a_setting_that_was_measured_twice_counts_as_its_better_one() -> None:
    times, errors = [1.0, 4.0, 4.0, 16.0], [0.4, 0.2, 0.21, 0.1]
    assert time_to_error(times, errors, 0.2).value == pytest.approx(4.0, rel=1e-12)
    assert error_at_time(times, errors, 4.0).value == pytest.approx(0.2, rel=1e-12)


def test_time_and_error_are_inverses_on_any_curve() -> None:
    rng = np.random.default_rng(2)
    compared = 0
    for _ in range(200):
        times, errors = np.exp(rng.normal(size=(2, int(rng.integers(2, 8)))))
        first, best = errors[np.argmin(times)], errors.min()
        for share in (0.01, 0.3, 0.7, 0.99) if first > best else ():
            target = best**share * first ** (1.0 - share)
            score = time_to_error(times, errors, target)
            assert score.status == "ok"
            # Steep pieces (a few units of log error over .001 of log time) turn rounding of 1e-16 to 1e-13.
            assert error_at_time(times, errors, float(score.value or 0.0)).value == pytest.approx(target, rel=1e-9)
            compared += 1
    assert compared > 400


def test_a_plateau_is_not_promised_to_go_on_falling() -> None:
    counts = 4.0 ** np.arange(8)
    errors = np.hypot(law(counts, -0.5), 0.02)
    score = samples_to_error(counts, errors, 0.01)
    assert score.status == "extrapolated"
    # A line through all would say some (0.3 / 0.01)^2 = 900; the last piece falls by less than 3 %.
    assert score.value is None or score.value > 1e20
    assert samples_to_error(counts, errors, 0.021).status == "ok"


def test_slower_settings_that_brought_nothing_are_taken_for_what_they_are() -> None:
    times, errors = np.array([1.0, 4.0, 16.0]), np.array([0.4, 0.2, 0.2])
    assert error_at_time(times, errors, 10.0).value == pytest.approx(0.2, rel=1e-12)
    # From the slowest setting on with the last slope there was, -1/2: half the error takes four times 16.
    score = time_to_error(times, errors, 0.1)
    assert (score.value, score.status) == (pytest.approx(64.0, rel=1e-12), "extrapolated")


def test_one_setting_says_nothing_of_other_errors() -> None:
    assert time_to_error([2.0], [0.1], 0.1).value == pytest.approx(2.0, rel=1e-12)
    for target in (0.05, 0.2):
        score = time_to_error([2.0], [0.1], target)
        assert (score.value, score.status) == (None, "out_of_reach")
    assert (error_at_time([2.0], [0.1], 1.0).value, error_at_time([2.0], [0.1], 1.0).status) == (None, "out_of_reach")
    later = error_at_time([2.0], [0.1], 3.0)
    assert (later.value, later.status) == (pytest.approx(0.1, rel=1e-12), "extrapolated")
    # The same of several settings none of which is better than the first.
    assert time_to_error([1.0, 4.0], [0.1, 0.2], 0.05).status == "out_of_reach"


def test_an_exact_setting_reaches_everything_and_nothing_is_reached_on_the_way() -> None:
    times, errors = [1.0, 4.0, 16.0], [0.4, 0.2, 0.0]
    assert time_to_error(times, errors, 1e-9).value == pytest.approx(16.0, rel=1e-12)
    assert time_to_error(times, errors, 0.3).value == pytest.approx(4.0 ** (math.log(4 / 3) / math.log(2)), rel=1e-12)
    assert error_at_time(times, errors, 15.0).value == pytest.approx(0.2, rel=1e-12)
    for time in (16.0, 99.0):
        assert error_at_time(times, errors, time).value == 0.0
    first = time_to_error([3.0, 5.0], [0.0, 0.1], 0.2)
    assert (first.value, first.status) == (pytest.approx(3.0, rel=1e-12), "ok")
    drawn = time_to_error(times, np.array(errors) * np.linspace(0.9, 1.1, 8)[:, None], 1e-3)
    assert drawn.extras["interval"] == pytest.approx([16.0, 16.0], rel=1e-12)


SIGMA = 0.2
# Mean square of exp(SIGMA z) is exp(2 SIGMA^2): all pooled errors of a law are larger by exp(SIGMA^2).
AT_ONE = 0.3 * math.exp(SIGMA**2)


def noisy(rng: np.random.Generator, slope: float, replicates: int) -> np.ndarray:
    return law(COUNTS, slope) * np.exp(SIGMA * rng.normal(size=(replicates, COUNTS.size)))


def holds(score: Score, truth: float) -> bool:
    low, high = score.extras["interval"]
    return bool(low <= truth <= (math.inf if high is None else high))


def test_intervals_hold_the_planted_time_and_error() -> None:
    rng = np.random.default_rng(5)
    times = 1e-3 * COUNTS
    held = np.zeros(2)
    for _ in range(TRIALS):
        errors = noisy(rng, -0.75, 5)
        held[0] += holds(time_to_error(times, errors, 0.03), 1e-3 * (AT_ONE / 0.03) ** (1 / 0.75))
        held[1] += holds(error_at_time(times, errors, 0.05), AT_ONE * 50.0**-0.75)
    assert (held >= LEAST_HELD * TRIALS).all(), held


def test_intervals_hold_the_planted_speed() -> None:
    rng = np.random.default_rng(6)
    held = 0
    for _ in range(TRIALS):
        jitter = np.exp(0.05 * rng.normal(size=(2, 9, COUNTS.size)))
        a, b = Curve(2e-3 * COUNTS * jitter[0], noisy(rng, -0.5, 8)), Curve(COUNTS * jitter[1], noisy(rng, -0.75, 8))
        score = speedup_at_error(a, b, 0.03)
        held += holds(score, 2e-3 * (AT_ONE / 0.03) ** (1 / 0.5 - 1 / 0.75))
        assert score.extras["covers"] == ["errors", "times"]
    assert held >= LEAST_HELD * TRIALS


def test_speed_is_the_ratio_of_times_and_says_what_is_extrapolated() -> None:
    a, b = Curve(COUNTS, law(COUNTS, -0.5)), Curve(3.0 * COUNTS, law(COUNTS, -0.75))
    score = speedup_at_error(a, b, 0.03)
    expected = 10.0**2 / (3.0 * 10.0 ** (4 / 3))
    assert (score.value, score.status) == (pytest.approx(expected, rel=1e-12), "ok")
    assert speedup_at_error(b, a, 0.03).value == pytest.approx(1.0 / expected, rel=1e-12)
    assert score.extras["times"] == pytest.approx([100.0, 3.0 * 10.0 ** (4 / 3)])
    assert speedup_at_error(a, b, 0.3 / 17).status == "extrapolated"  # a measured to 0.3 / 16
    lost = speedup_at_error(a, Curve([1.0], [0.1]), 0.03)
    assert (lost.value, lost.status, lost.extras["interval"]) == (None, "out_of_reach", None)
    assert lost.extras["times"] == [pytest.approx(100.0), None]


def test_only_what_was_repeated_is_covered_by_an_interval() -> None:
    times = COUNTS * np.exp(0.05 * np.random.default_rng(3).normal(size=(9, 5)))
    score = time_to_error(times, law(COUNTS, -0.5), 0.03)
    assert score.extras["covers"] == ["times"]
    low, high = score.extras["interval"]
    assert low < score.value < high
    both = speedup_at_error(Curve(COUNTS, law(COUNTS, -0.5)), Curve(times, law(COUNTS, -0.5)), 0.03)
    assert both.extras["interval"] == pytest.approx([100.0 / high, 100.0 / low], rel=0.02)  # another draw of 2000


@pytest.mark.parametrize(
    ("times", "errors", "target", "message"),
    [
        ([1.0, 2.0], [0.1, 0.2], 0.0, r"target 0\.0: must be finite and above 0"),
        ([1.0, 2.0], [0.1, 0.2], math.nan, "target nan: must be finite and above 0"),
        ([0.0, 2.0], [0.1, 0.2], 0.1, r"times of shape \(2,\) must be .* finite and above 0"),
        ([[1.0, math.inf]], [0.1, 0.2], 0.1, r"times of shape \(1, 2\) must be .* finite and above 0"),
        (1.0, [0.1], 0.1, r"times of shape \(\) must be"),
        ([1.0, 2.0], [0.1, -0.2], 0.1, "values must be finite and not negative"),
        ([1.0, 2.0], [0.1], 0.1, r"values of shape \(1,\) do not fit 2 times"),
    ],
)
def test_what_is_no_curve_is_refused(times: object, errors: object, target: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        time_to_error(times, errors, target)  # type: ignore[arg-type]
    if "target" not in message:
        with pytest.raises(ValueError, match=message):
            error_at_time(times, errors, 1.0)  # type: ignore[arg-type]
