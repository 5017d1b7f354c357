"""A known amount of each artifact, added to a clean sequence, is recovered by its metric: within 2 %, at any size.

And more of it never scores less. The same signals as in the matrix of cross-talk, at other amounts and elsewhere.
"""

import math
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from planted import Plant, Stage
from plants_pooled import odd_bias
from plants_random import fixed_noise, seed_noise, white_flicker
from plants_regular import (
    alternation,
    frozen_rotor,
    moving_stairs,
    offset,
    stairs_size,
    static_stairs,
    wave,
)

from aliasbench.metrics.catalog import measure

STAGE = Stage(40, 14, 5, 3.0)
UNIT = 0.1
# Of an artifact with root mean square a: the metric that is for it, and its value for that.
ARTIFACTS: dict[str, tuple[Callable[[float], Plant], str, Callable[[float], float]]] = {
    "offset": (lambda a: offset(STAGE, a), "bias", lambda a: a),
    "error": (lambda a: wave(STAGE, a, "line", (2, 3), 1), "rmse", lambda a: a),
    "stairs": (lambda a: static_stairs(STAGE, a), "jaggies_str", lambda a: stair_height(a)),
    "ragged edge": (lambda a: moving_stairs(STAGE, a), "jaggies", lambda a: stair_height(a)),
    "shifted edge": (lambda a: offset(STAGE, a), "jaggies_bias", lambda a: 4 * a),
    "shimmer": (lambda a: white_flicker(STAGE, a), "shimmer", lambda a: a * math.sqrt(1 - 1 / STAGE.frames)),
    "folded flicker": (lambda a: wave(STAGE, a, "racing", (3, 1), 5), "shimmer_abs", lambda a: a),
    "flicker": (lambda a: alternation(STAGE, a), "flux_flicker", lambda a: 2 * a),
    "false line": (lambda a: wave(STAGE, a, "line", (0, 4)), "moire", lambda a: a),
    "strongest line": (lambda a: wave(STAGE, a, "line", (2, -3)), "moire_peak", lambda a: a * math.sqrt(2)),
    "strobing": (lambda a: frozen_rotor(STAGE, a), "strobing", lambda a: 2 * a),
    "noise": (lambda a: seed_noise(STAGE, a), "noise", lambda a: a),
    "structure": (lambda a: fixed_noise(STAGE, a), "structure", lambda a: a),
    "odd bias": (lambda a: odd_bias(STAGE, a), "structure", lambda a: a),
}


def stair_height(a: float) -> float:
    """The standard deviation in pixels of stairs of that root mean square over the picture."""
    return stairs_size(STAGE, a) * math.sqrt((1 - 1 / STAGE.q**2) / 12)


@cache
def planted(name: str) -> Plant:
    """The artifact with root mean square UNIT; what is random is the same at all amounts."""
    return ARTIFACTS[name][0](UNIT)


@pytest.fixture(scope="module")
def scored(rgb):
    def run(plant: Plant, metric: str, amount: float = UNIT) -> float:
        test, reference = (STAGE.contrast * x for x in (plant.reference + amount / UNIT * plant.error, plant.reference))
        score = measure(metric, rgb(test), rgb(reference), scene=plant.scene, filter_radius_px=0.0)
        assert score.value is not None, score
        return score.value

    return run


@pytest.mark.parametrize("amount", [1e-4, 0.01, 0.1, 0.4])
@pytest.mark.parametrize("name", ARTIFACTS)
def test_a_planted_amount_is_recovered_within_two_percent(scored, name, amount):
    _, metric, value = ARTIFACTS[name]
    assert scored(planted(name), metric, amount) == pytest.approx(value(amount), rel=0.02)


@pytest.mark.parametrize("name", ARTIFACTS)
@settings(max_examples=6)
@given(amount=st.floats(1e-3, 0.45), more=st.floats(1.001, 8.0))
def test_more_of_an_artifact_scores_more(scored, name, amount, more):
    _, metric, _ = ARTIFACTS[name]
    few, many = (scored(planted(name), metric, a) for a in (amount / more, amount))
    assert few < many


@pytest.mark.parametrize("amount", [0.0, 0.01, 0.1])
def test_signals_that_do_not_overlap_add_as_squares(scored, amount):
    """Energies of different lines, and of stairs, noise and offsets, add: one artifact does not hide another."""
    line, fine = wave(STAGE, 0.05, "line", (4, 0)), wave(STAGE, 0.03, "fine", (11, 5), 5)
    both = Plant("both", line.scene, line.reference, line.error + fine.error + amount)
    assert scored(both, "rmse") == pytest.approx(math.sqrt(0.05**2 + 0.03**2 + amount**2), rel=1e-9)
    assert scored(both, "moire") == pytest.approx(0.05, rel=1e-9)
    assert scored(both, "shimmer") == pytest.approx(0.03, rel=1e-9)
    assert scored(both, "bias") == pytest.approx(amount, abs=1e-12)


def test_the_stage_is_another_one_than_that_of_the_matrix():
    assert (STAGE.side % 4, STAGE.side % STAGE.q, STAGE.frames) == (0, 0, 14)
    assert np.ptp(STAGE.clean()) == pytest.approx(0.4, abs=0.01)
