"""Planted signals of chance, each with what it puts into every metric and how far chance may take that.

Noise is of random signs where it can be: its mean square then is what was planted, exactly.
"""

import math

import numpy as np
from planted import DEVIATIONS, LEVEL, SWING, WINDOW_ROWS, Expected, Plant, Stage
from planted_rotors import noise_power, noisy_rotor_figures
from plants_regular import FIRST_FOLDED_BIN


def noise_figures(stage: Stage, a: float, pictures: int) -> dict[str, Expected]:
    """What white noise says within each picture, if so many pictures are independent."""
    n2, edges = stage.side**2, len(stage.intercepts)
    band = stage.band_bins / n2
    moire = a * math.sqrt(band)
    ordinates = stage.band_bins // 2
    # The largest of n exponentials has mean H_n and variance below pi^2 / 6.
    largest = float(np.sum(1 / np.arange(1.0, ordinates + 1)))
    peak = 2 * a / stage.side * math.sqrt(largest)
    jaggies = a * math.sqrt(WINDOW_ROWS)
    columns = stage.side * edges * pictures
    loose = DEVIATIONS * jaggies / math.sqrt(2 * columns)
    return {
        "jaggies": Expected(jaggies * math.sqrt(1 - 1 / stage.side), loose),
        "jaggies_rms": Expected(jaggies, loose),
        "jaggies_bias": Expected(0.0, DEVIATIONS * jaggies / math.sqrt(columns)),
        "moire": Expected(moire, DEVIATIONS * moire / (2 * math.sqrt(ordinates * pictures))),
        "moire_peak": Expected(peak, DEVIATIONS * peak * math.pi / math.sqrt(6 * pictures) / (2 * largest)),
        **noisy_rotor_figures(stage, noise_power(stage, a**2), pictures),
        "bias": Expected(0.0, DEVIATIONS * a / math.sqrt(n2 * pictures)),
    }


def flicker_figures(stage: Stage, a: float, seeds: int) -> dict[str, Expected]:
    """What noise says that is new in every frame."""
    f, values = stage.frames, stage.side**2 * stage.frames * seeds
    folded = (f + 1 - 2 * FIRST_FOLDED_BIN) / f
    return {
        "shimmer": Expected(a * math.sqrt(1 - 1 / f), DEVIATIONS * a / math.sqrt(2 * values)),
        "shimmer_abs": Expected(a * math.sqrt(folded), DEVIATIONS * a / math.sqrt(2 * values)),
        "buzz": Expected(f / (f - 1), DEVIATIONS / math.sqrt(values)),
        # a's mean over the picture, over the level: of f - 1 degrees of freedom
        "flux_flicker": Expected(
            a / stage.side / LEVEL * math.sqrt(1 - 1 / f),
            DEVIATIONS * a / stage.side / LEVEL / math.sqrt(2 * seeds * f),
        ),
    }


def shared_stairs(stage: Stage, a: float, pictures: int) -> dict[str, Expected]:
    """What noise that all seeds share has in the span of the edges' harmonics: rank / columns of its square."""
    rank = min(stage.q - 1, 16)
    value = a * math.sqrt(WINDOW_ROWS * rank / stage.side)
    edges = len(stage.intercepts)
    return {"jaggies_str": Expected(value, DEVIATIONS * value / math.sqrt(2 * rank * edges * pictures))}


def white_flicker(stage: Stage, a: float) -> Plant:
    """Random signs, new in every pixel of every frame, the same with every seed."""
    signs = np.random.default_rng(1).choice([-a, a], size=(stage.frames, stage.side, stage.side))
    expected = {
        **noise_figures(stage, a, stage.frames),
        **flicker_figures(stage, a, 1),
        **shared_stairs(stage, a, stage.frames),
    }
    return Plant("white flicker", stage.scene(), stage.clean(), stage.everywhere(signs), expected)


def fixed_noise(stage: Stage, a: float) -> Plant:
    """Random signs that stay where they are."""
    signs = np.random.default_rng(2).choice([-a, a], size=(stage.side, stage.side))
    expected = {**noise_figures(stage, a, 1), **shared_stairs(stage, a, 1)}
    # c_3 has a constant besides the rotor's: it adds its power, and products that a part of a loop leaves.
    share = math.sqrt(noise_power(stage, a**2)) / (SWING / 2)
    expected["apparent_rate"] = Expected(stage.rate, DEVIATIONS * share * 2 * stage.rate)
    return Plant("fixed noise", stage.scene(), stage.clean(), stage.everywhere(signs), expected)


def seed_noise(stage: Stage, a: float) -> Plant:
    """Random signs, new in every frame of every seed."""
    seeds = 8
    shape = (seeds, stage.frames, stage.side, stage.side)
    signs = np.random.default_rng(3).choice([-a, a], size=shape)
    values = stage.frames * stage.side**2
    pictures = seeds * stage.frames
    # Pairs of seeds have products of mean zero; the mean over seeds leaves 1 / seeds of the variance in the stairs.
    pairs = math.sqrt(2 / (seeds * (seeds - 1)))
    rank = min(stage.q - 1, 16)
    stairs = (
        WINDOW_ROWS * a**2 / seeds * math.sqrt(2 * rank) / stage.side
        / math.sqrt(len(stage.intercepts) * stage.frames)
    )  # fmt: skip
    expected = {
        **noise_figures(stage, a, pictures),
        **flicker_figures(stage, a, seeds),
        "jaggies_str": Expected(0.0, math.sqrt(DEVIATIONS * stairs)),
        "noise": Expected(a, DEVIATIONS * a / math.sqrt(2 * values) / seeds),
        "structure": Expected(0.0, a * math.sqrt(DEVIATIONS * pairs / math.sqrt(values))),
    }
    return Plant("seed noise", stage.scene(), stage.clean(), signs, expected)
