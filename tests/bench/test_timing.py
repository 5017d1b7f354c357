"""What timings say."""

import numpy as np
import pytest

from aliasbench.bench.timing import interleaved, summarise


def test_the_median_lies_in_its_interval_and_equal_timings_have_none() -> None:
    same = summarise([0.02] * 9)
    assert (same.median_s, same.low_s, same.high_s, same.spread) == (0.02, 0.02, 0.02, 0.0)
    assert same.warnings == ()
    spread = summarise([0.010, 0.011, 0.012, 0.013, 0.030])
    assert spread.median_s == 0.012
    assert 0.010 <= spread.low_s <= 0.012 <= spread.high_s <= 0.030
    assert spread.low_s < spread.high_s


def test_the_interval_covers_the_true_median_about_as_often_as_it_says() -> None:
    generator = np.random.default_rng(5)
    trials = 200
    hits = 0
    for _ in range(trials):
        found = summarise(generator.lognormal(0.0, 0.1, 25).tolist())
        hits += found.low_s <= 1.0 <= found.high_s
    # 95 % of 200 is 190 with a standard error of 3.1: four of them, and 2 % for what the percentile bootstrap lacks.
    assert hits >= 190 - 4 * 3.1 - 4


def test_the_same_timings_always_give_the_same_summary() -> None:
    seconds = [0.5, 0.7, 0.6, 0.9]
    assert summarise(seconds) == summarise(seconds)


def test_what_cannot_be_relied_upon_says_why() -> None:
    assert summarise([1e-4] * 7).warnings == ("under 1 ms",)
    assert summarise([1.0, 1.0]).warnings == ("only 2 rounds",)
    assert summarise([1.0]).warnings == ("only 1 round",)
    assert summarise([1.0] * 6 + [3.6]).warnings == ("up to 3.6 times the median",)
    assert summarise([1.0, 1.5, 2.0, 2.5, 3.0]).warnings == ("spread 50% (over 10%)",)


@pytest.mark.parametrize("bad", [[], [float("nan")], [-1.0], [float("inf"), 1.0]])
def test_timings_that_are_none_are_refused(bad: list[float]) -> None:
    with pytest.raises(ValueError, match="timings"):
        summarise(bad)


def test_every_round_holds_each_once_and_none_keeps_its_place() -> None:
    rounds = list(interleaved(4, 8))
    assert [number for number, _ in rounds] == list(range(8))
    assert all(sorted(order) == [0, 1, 2, 3] for _, order in rounds)
    for place in range(4):
        assert sorted(order[place] for _, order in rounds) == [0, 0, 1, 1, 2, 2, 3, 3]
