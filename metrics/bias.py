"""Bias: error that does not average out over seeds, as adaptive sampling has when it counts its own pilot samples.

The mean over the picture alone would hide it: a pooled pilot's bias is antisymmetric about a coverage of one half, so
it is reported for each tenth of the coverage too. After Kirk and Arvo 1991.
"""

import numpy as np
from scipy import special

from aliasbench.metrics.gate import Signals
from aliasbench.metrics.score import Score, settle, signed_root
from aliasbench.scenes.model import FloatArray

FEWEST_SEEDS = 8
COVERAGE_BINS = 10
CONFIDENCE = 0.95


def mean_with_interval(means: FloatArray) -> dict[str, object]:
    """Return the mean over seeds (n,), its t value and its 95 % interval; without spread neither."""
    mean = float(np.mean(means))
    error = float(np.std(means, ddof=1)) / np.sqrt(means.size)
    if error == 0.0:
        return {"mean": mean, "t": None, "interval": None}
    half = float(special.stdtrit(means.size - 1, (1.0 + CONFIDENCE) / 2.0)) * error
    return {"mean": mean, "t": mean / error, "interval": [mean - half, mean + half]}


def compute_bias(signals: Signals) -> Score:
    """Return the mean over seeds, frames and pixels of test - reference, in contrast, with its sign.

    Extras: t and the 95 % interval; the same for each tenth of the reference's coverage; B2, the unbiased mean
    square of the pixels' own biases; and how many pixels are wrong in the same way with every seed.
    """
    error = signals.error
    seeds = signals.seeds
    same = bool(np.all(error == error[0]))
    if seeds < FEWEST_SEEDS and not same:
        return Score(None, "needs_seeds", {"seeds": seeds, "needs": FEWEST_SEEDS})
    mean = np.mean(error, axis=0)
    variance = np.var(error, axis=0, ddof=1)
    square = float(np.mean(mean**2 - variance / seeds))
    coverage = np.clip(signals.reference, 0.0, 1.0)
    tenth = np.minimum((coverage * COVERAGE_BINS).astype(np.int64), COVERAGE_BINS - 1)
    bins = []
    for k in range(COVERAGE_BINS):
        inside = tenth == k
        if inside.any():
            own = mean_with_interval(np.mean(error[:, inside], axis=1))
            bins.append(
                {"coverage": [k / COVERAGE_BINS, (k + 1) / COVERAGE_BINS], "pixels": int(np.sum(inside)), **own}
            )
    overall = mean_with_interval(np.mean(error, axis=(1, 2, 3)))
    extras = {
        **overall,
        "square": square,
        "root": signed_root(square),
        "by_coverage": bins,
        "always_wrong_pixels": int(np.sum((variance == 0.0) & (mean != 0.0))),
        "seeds": seeds,
    }
    return settle(float(np.mean(error)), extras, floor=signals.floor, status="deterministic" if same else "ok")
