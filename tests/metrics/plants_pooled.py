"""Planted biases of adaptive sampling: the mean of n0 pilot samples and, unless these are all equal, of n1 more.

On a ramp of coverages from 0 to 1 its bias cancels over the picture, and is left in every metric but the mean.
"""

import math

import numpy as np
from planted import ANYTHING, DEVIATIONS, LEVEL, WINDOW_ROWS, Expected, FloatArray, Plant, Stage
from planted_rotors import noise_power, noisy_rotor_figures, orders_of, rotor_figures
from plants_regular import FIRST_FOLDED_BIN, displacement_figures


def ramp(stage: Stage) -> FloatArray:
    """Coverage that grows from left to right, (side, side), through the middle of each of `side` steps."""
    return np.repeat(((np.arange(stage.side) + 0.5) / stage.side)[None, :], stage.side, axis=0)


def ramp_figures(stage: Stage, bias: FloatArray) -> dict[str, Expected]:
    """What an error (h, w) that depends on the column alone says, beside its root mean square."""
    return {
        **displacement_figures(stage, bias[None]),
        **stage.moire(bias[None]),
        # A linear ramp has angular order 1 and no other: what it adds to the picture is no blade's.
        **rotor_figures(stage, np.repeat(orders_of(stage, bias)[None], stage.frames, axis=0), rotor=False),
        "bias": Expected(float(np.mean(bias))),
    }


def pooled_bias(c: FloatArray, n0: int, n1: int) -> FloatArray:
    """The bias at coverages c, in closed form."""
    return n1 / (n0 + n1) * c * (1 - c) * (c ** (n0 - 1) - (1 - c) ** (n0 - 1))


def pooled_moments(c: FloatArray, n0: int, n1: int) -> FloatArray:
    """The estimate's mean, and its moments 2 to 4 about that, (4, ...): sums over all that can be drawn."""
    values, chances = [], []
    for h0 in range(n0 + 1):
        first = math.comb(n0, h0) * c**h0 * (1 - c) ** (n0 - h0)
        if h0 in (0, n0):
            values.append(h0 / n0)
            chances.append(first)
            continue
        for h1 in range(n1 + 1):
            values.append((h0 + h1) / (n0 + n1))
            chances.append(first * math.comb(n1, h1) * c**h1 * (1 - c) ** (n1 - h1))
    value, chance = np.array(values)[:, None], np.array(chances)
    mean = np.sum(chance * value, axis=0)
    return np.array([mean, *(np.sum(chance * (value - mean) ** k, axis=0) for k in (2, 3, 4))])


def odd_bias(stage: Stage, a: float) -> Plant:
    """The bias alone, without the noise that it comes with."""
    coverage = ramp(stage)
    bias = pooled_bias(coverage, 4, 12)
    bias = bias * (a / math.sqrt(float(np.mean(bias**2))))
    reference = np.repeat(coverage[None], stage.frames, axis=0)
    return Plant("odd bias", stage.scene(), reference, stage.everywhere(bias), ramp_figures(stage, bias))


def pooled_pilot(stage: Stage, n0: int) -> Plant:
    """Pixels as a renderer estimates them with pilots of n0 samples and 3 n0 more."""
    n1, seeds, f, side = 3 * n0, 8, stage.frames, stage.side
    rng = np.random.default_rng(4)
    coverage = ramp(stage)
    shape = (seeds, f, side, side)
    first, more = rng.binomial(n0, coverage, shape), rng.binomial(n1, coverage, shape)
    stopped = (first == 0) | (first == n0)
    error = np.where(stopped, first / n0, (first + more) / (n0 + n1)) - coverage

    bias = pooled_bias(coverage, n0, n1)
    mean, variance, third, fourth = np.repeat(pooled_moments(coverage[0], n0, n1)[:, None, :], side, axis=1)
    np.testing.assert_allclose(mean - coverage, bias, rtol=0, atol=1e-12)
    v, b2 = float(np.mean(variance)), float(np.mean(bias**2))
    square = variance + bias**2
    fourth_about_truth = fourth + 4 * bias * third + 6 * bias**2 * variance + bias**4
    pictures, pixels = seeds * f, side**2
    values, columns = pixels * pictures, side * len(stage.intercepts) * pictures

    def root(square: float, spread: float) -> Expected:
        """The root of a square whose standard deviation is known."""
        return Expected(math.sqrt(square), DEVIATIONS * spread / (2 * math.sqrt(square)))

    def deviation(mean_square: FloatArray | float, count: int) -> float:
        return math.sqrt(float(np.mean(mean_square)) / count)

    static = ramp_figures(stage, bias)
    known = {name: e.value for name, e in static.items() if e.value is not None}
    rotor = noisy_rotor_figures(stage, noise_power(stage, variance), pictures)
    assert rotor["strobing_err"].value is not None
    # A sum of as many independent values as a window has rows.
    drift = WINDOW_ROWS * fourth + 3 * WINDOW_ROWS * (WINDOW_ROWS - 1) * variance**2
    sway = WINDOW_ROWS * v
    ordinates = stage.band_bins // 2
    white = v * stage.band_bins / pixels
    relative = 1 / (coverage**2 + 0.01)
    noise_spread = deviation(fourth, values)
    pairs = math.sqrt(2 / (seeds * (seeds - 1)))
    # Of the mean over seeds, white noise in the rank of the stairs' span, and its product with what is there.
    rank = min(stage.q - 1, 16)
    stairs = sway / seeds / side / math.sqrt(len(stage.intercepts) * f)
    expected = {
        "rmse": root(v + b2, deviation(fourth_about_truth - square**2, values)),
        "psnr": Expected(
            -10 * math.log10(v + b2),
            10 / math.log(10) * DEVIATIONS * deviation(fourth_about_truth - square**2, values) / (v + b2),
        ),
        "relmse": Expected(
            float(np.mean(square * relative)), DEVIATIONS * deviation(fourth_about_truth * relative**2, values)
        ),
        "jaggies": root(known["jaggies"] ** 2 + sway * (1 - 1 / side), 1.2 * deviation(drift, columns)),
        "jaggies_rms": root(known["jaggies_rms"] ** 2 + sway, 1.2 * deviation(drift, columns)),
        "jaggies_bias": Expected(known["jaggies_bias"], DEVIATIONS * deviation(sway, columns)),
        "jaggies_str": root(
            known["jaggies_str"] ** 2,
            math.hypot(stairs * math.sqrt(2 * rank), 2 * known["jaggies_str"] * math.sqrt(stairs)),
        ),
        "shimmer": root(v * (1 - 1 / f), noise_spread),
        "shimmer_abs": root(v * (f + 1 - 2 * FIRST_FOLDED_BIN) / f, noise_spread),
        "buzz": Expected(f / (f - 1), DEVIATIONS * deviation(variance**2, values) / v),
        "flux_flicker": root(v / pixels / LEVEL**2 * (1 - 1 / f), v / pixels / LEVEL**2 * math.sqrt(2 / pictures)),
        "moire": root(
            known["moire"] ** 2 + white,
            white / math.sqrt(ordinates * pictures) + 2 * known["moire"] * math.sqrt(v / values),
        ),
        # The strongest line, and no more on it than the noise's own strongest line.
        "moire_peak": Expected(known["moire_peak"], 2 * math.sqrt(v * (math.log(ordinates) + DEVIATIONS) / pixels)),
        "strobing": Expected(known["strobing"], rotor["strobing"].slack),
        "strobing_err": Expected(
            math.hypot(known["strobing_err"], rotor["strobing_err"].value), 2 * rotor["strobing_err"].slack
        ),
        # There is no rotor in the picture: the rate is that of what noise and bias have at three turns a circle.
        "apparent_rate": ANYTHING,
        "noise": root(v, noise_spread),
        "structure": root(
            b2, math.hypot(2 * deviation(square * bias**2, values), pairs * deviation(variance**2, pixels * f))
        ),
        "bias": Expected(float(np.mean(bias)), DEVIATIONS * deviation(v, values)),
    }
    reference = np.repeat(coverage[None], f, axis=0)
    return Plant("pooled pilot", stage.scene(), reference, error, expected)
