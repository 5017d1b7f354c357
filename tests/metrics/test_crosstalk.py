"""The whole matrix of planted signals and metrics, predicted from the definitions.

No metric is blind to all artifacts but its own: static stairsteps put a part of their energy into the visible band, a
drifting line flickers, white flicker jags an edge. What each planted signal must put into each metric is derived in
`plants_*`; here everything is measured and compared. Signals without chance must come out within 2 % of what was
planted (and do within rounding, but for sums over a lattice of pixels that stand for integrals); of random ones the
slack is five standard deviations. Run with -s, the matrix is printed.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial

import numpy as np
import pytest
from planted import Expected, Plant, Stage
from plants_pooled import odd_bias, pooled_bias, pooled_moments, pooled_pilot
from plants_random import fixed_noise, seed_noise, white_flicker
from plants_regular import alternation, frozen_rotor, moving_stairs, offset, static_stairs, wave

from aliasbench.metrics.catalog import METRICS, measure_all
from aliasbench.metrics.score import Score

# Sides, frames, run of the stairs, contrast: two of each, so that no figure holds by chance.
STAGES = {"64 px": Stage(64, 12, 8, 1.0), "48 px": Stage(48, 16, 4, 7.0)}
AMOUNT = 0.05
REGULAR: Mapping[str, Callable[[Stage], Plant]] = {
    "offset": partial(offset, a=AMOUNT),
    "stairs": partial(static_stairs, a=AMOUNT),
    "moving stairs": partial(moving_stairs, a=AMOUNT),
    "alternation": partial(alternation, a=AMOUNT),
    "false line": lambda stage: wave(stage, AMOUNT, "false line", (5, 0)),
    "line on stairs": lambda stage: wave(stage, AMOUNT, "line on stairs", (stage.side // stage.q, 0), on_stairs=True),
    "racing line": lambda stage: wave(stage, AMOUNT, "racing line", (5, 0), 5),
    "slow line": lambda stage: wave(stage, AMOUNT, "slow line", (3, 4), 2),
    # Both of its components are in the visible band, and it is not.
    "fine line": lambda stage: wave(stage, AMOUNT, "fine line", (round(0.2 * stage.side),) * 2),
    "frozen rotor": partial(frozen_rotor, a=0.2),
    "odd bias": partial(odd_bias, a=0.02),
}
RANDOM: Mapping[str, Callable[[Stage], Plant]] = {
    "white flicker": partial(white_flicker, a=AMOUNT),
    "fixed noise": partial(fixed_noise, a=AMOUNT),
    "seed noise": partial(seed_noise, a=AMOUNT),
    "pooled pilot": partial(pooled_pilot, n0=4),
}
PLANTS = {**REGULAR, **RANDOM}
# In units of the planted root mean square; the others have units of their own.
OWN_UNIT = ("psnr", "relmse", "buzz", "apparent_rate", "gaps", "flux_flicker")


def measure_plant(plant: Plant, stage: Stage, names: tuple[str, ...], rgb) -> dict[str, Score]:
    test, reference = (stage.contrast * a for a in (plant.reference + plant.error, plant.reference))
    return measure_all(names, rgb(test), rgb(reference), scene=plant.scene, filter_radius_px=0.0)


@pytest.fixture(scope="module")
def matrix() -> Iterator[list[tuple[str, float, dict[str, Expected], dict[str, Score]]]]:
    """What was measured, printed as a table in the end: measured over predicted, in units of the planted RMS."""
    rows: list[tuple[str, float, dict[str, Expected], dict[str, Score]]] = []
    yield rows
    names = list(rows[0][2])
    print("\n\nmeasured / predicted, in units of what was planted (* in the metric's own)")
    for block in (names[: len(names) // 2], names[len(names) // 2 :]):
        print(f"\n{'':22s}" + "".join(f"{n + '*' * (n in OWN_UNIT):>17s}" for n in block))
        for label, rms, expected, got in rows:
            print(f"{label:22s}" + "".join(f"{pair(n, rms, expected[n], got[n]):>17s}" for n in block))


def pair(name: str, rms: float, expected: Expected, score: Score) -> str:
    def shown(value: float | None) -> str:
        if value is None:
            return "-"
        text = f"{value / (1.0 if name in OWN_UNIT else rms):.3f}"
        return "0" if float(text) == 0.0 else text

    return f"{shown(score.value)} / {shown(expected.value) if expected.slack < math.inf else '?'}"


@pytest.mark.parametrize("where", STAGES)
@pytest.mark.parametrize("name", PLANTS)
def test_every_metric_says_of_a_planted_signal_what_its_definition_says(matrix, rgb, name, where):
    stage = STAGES[where]
    plant = PLANTS[name](stage)
    expected = stage.expect(plant)
    got = measure_plant(plant, stage, tuple(expected), rgb)
    matrix.append((f"{name}, {where}", plant.rms, expected, got))
    wrong = {n: (got[n].value, e) for n, e in expected.items() if not e.holds(got[n].value)}
    assert not wrong
    if name in REGULAR:
        assert all(e.slack <= 0.02 * plant.rms for e in expected.values())
    else:
        # Of noise, what is summed over all pixels must be known as well; what is read along edges is as it is.
        for n in ("rmse", "shimmer", "shimmer_abs", "noise"):
            assert expected[n].slack <= 0.02 * plant.rms, n


# Those that are not linear in the error, not of it, or predicted with signals of their own.
NOT_PREDICTED = {"ssim", "flip", "cvvdp", "mtf50", "edge_width", "spatial", "temporal", "shutter", "apparent_velocity"}


def test_the_matrix_has_every_metric_of_the_catalog():
    stage = STAGES["48 px"]
    assert set(METRICS) - NOT_PREDICTED == set(stage.expect(offset(stage, AMOUNT)))


def test_the_clean_sequence_has_no_artifact_of_any_kind(rgb):
    """Of the sequence without anything planted every metric is at its best, new ones too."""
    for stage in STAGES.values():
        clean = stage.contrast * np.repeat(stage.clean()[None], 2, axis=0)
        got = measure_all(METRICS, rgb(clean), rgb(clean[0]), scene=stage.scene(), filter_radius_px=0.0)
        for name, score in got.items():
            metric = METRICS[name]
            if score.value is None or metric.better not in ("lower", "zero") or name == "edge_width":
                continue
            # The annulus' sums over a lattice of pixels stand for integrals.
            assert abs(score.value) <= (1e-4 if name == "strobing" else 1e-9), name
        assert got["apparent_rate"].value == pytest.approx(stage.rate, abs=1e-9)
        assert got["ssim"].value == pytest.approx(1.0)


def test_stairs_flicker_and_white_noise_cross_over_as_much_as_was_said(rgb):
    """Static stairsteps put .27 to .67 of their RMSE into M, moving ones .96 into SH_err, white flicker .45 into M."""
    stage = STAGES["64 px"]
    for plant, metric, low, high in (
        (static_stairs(stage, AMOUNT), "moire", 0.27, 0.67),
        (moving_stairs(stage, AMOUNT), "shimmer", 0.94, 1.0),
        (white_flicker(stage, AMOUNT), "moire", 0.42, 0.46),
    ):
        value = measure_plant(plant, stage, (metric,), rgb)[metric].value
        assert value is not None
        assert low <= value / plant.rms <= high


@pytest.mark.parametrize(
    ("c", "n0", "n1", "expected"), [(0.2, 4, 12, -0.06048), (0.05, 4, 60, -0.0381744), (0.9, 2, 14, 0.063)]
)
def test_the_planted_bias_is_the_derived_one(c, n0, n1, expected):
    bias = float(pooled_bias(np.array([c]), n0, n1)[0])
    assert bias == pytest.approx(expected, abs=1e-7)
    assert float(pooled_moments(np.array([c]), n0, n1)[0, 0]) - c == pytest.approx(bias, abs=1e-12)


def test_the_bias_of_a_ramp_of_coverages_has_mean_zero_and_its_own_mean_square():
    coverage = (np.arange(4000) + 0.5) / 4000
    bias = pooled_bias(coverage, 4, 12)
    assert float(np.mean(bias)) == pytest.approx(0.0, abs=1e-15)
    # Midpoint rule, second derivative of the square below 10.
    assert float(np.mean(bias**2)) == pytest.approx(0.00186688, abs=5e-9 + 10 / (24 * 4000**2))
