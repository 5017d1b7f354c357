"""Bias: error that does not average out over seeds, as adaptive sampling has when it counts its own pilot samples.

The mean over the picture alone would hide it: a pooled pilot's bias is antisymmetric about a coverage of one half, so
it is reported for each tenth of the coverage too, with the variance beside it, because a technique that trades one for
the other does so at some coverages only. After Kirk and Arvo 1991.

Seeds are independent of each other; pixels need not be (a pattern may be shared by all), so that every interval is over
seeds and none counts pixels.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import special

from aliasbench.metrics.gate import Signals
from aliasbench.metrics.score import Score, settle, signed_root
from aliasbench.scenes.model import FloatArray

FEWEST_SEEDS = 8
COVERAGE_BINS = 10
CONFIDENCE = 0.95


def _student(seeds: int) -> float:
    return float(special.stdtrit(seeds - 1, (1.0 + CONFIDENCE) / 2.0))


def mean_with_interval(means: FloatArray) -> dict[str, object]:
    """Return the mean over seeds (n,), its t value and its 95 % interval; without spread neither."""
    mean = float(np.mean(means))
    error = float(np.std(means, ddof=1)) / np.sqrt(means.size)
    # Of equal numbers the standard deviation need not be 0: their mean is rounded.
    if error == 0.0 or np.all(means == means[0]):
        return {"mean": mean, "t": None, "interval": None}
    half = _student(means.size) * error
    return {"mean": mean, "t": mean / error, "interval": [mean - half, mean + half]}


def variance_with_interval(squares: FloatArray) -> dict[str, object]:
    """Return the mean variance of pixels between seeds, from each seed's mean squared deviation (n,), and its interval.

    V = sum d / (n - 1) is a U-statistic of the seeds. Leaving out seed i takes n / (n - 1) d_i from the sum of squares:
    the jackknife's pseudo-values are n d_i / (n - 2) plus a constant, and its standard error is n / (n - 2)
    times the standard error of the mean of d. Of one pixel, or of pixels that share a pattern, V is about chi-square
    with n - 1 degrees of freedom, of many independent ones about normal: Student's interval of log V suits both. A
    "95 %" interval of 8 seeds held the truth in 90 to 98 % of planted noises (Gaussian, uniform, binomial, of 1 to 1000
    pixels), and in 87 % where half the variance was common to all pixels.
    """
    n = squares.size
    variance = float(np.sum(squares)) / (n - 1)
    if not variance > 0.0:
        return {"variance": variance, "variance_interval": None}
    error = n / (n - 2) * float(np.std(squares, ddof=1)) / np.sqrt(n) / variance
    factor = np.exp(_student(n) * error)
    return {"variance": variance, "variance_interval": [variance / factor, variance * factor]}


def compute_bias(signals: Signals) -> Score:
    """Return the mean over seeds, frames and pixels of test - reference, in contrast, with its sign.

    Extras: t and the 95 % interval over seeds; the mean variance of pixels between seeds and its interval; all of these
    for each tenth of the reference's coverage; B2, the unbiased mean square of the pixels' own biases, and its signed
    root; and how many pixels are wrong in the same way with every seed, such as those of features that all missed.
    """
    error = signals.error
    seeds, pixels = signals.seeds, error[0].size
    same = bool(np.all(error == error[0]))
    if seeds < FEWEST_SEEDS and not same:
        return Score(None, "needs_seeds", {"seeds": seeds, "needs": FEWEST_SEEDS})
    sums, squares, counts, mean_square, wrong = _sum_by_coverage(signals)
    bins = [
        {
            "coverage": [k / COVERAGE_BINS, (k + 1) / COVERAGE_BINS],
            "pixels": int(counts[k]),
            **mean_with_interval(sums[:, k] / counts[k]),
            **variance_with_interval(squares[:, k] / counts[k]),
        }
        for k in np.flatnonzero(counts)
    ]
    square = mean_square - float(squares.sum()) / (seeds - 1) / pixels / seeds
    extras = {
        **mean_with_interval(sums.sum(axis=1) / pixels),
        **variance_with_interval(squares.sum(axis=1) / pixels),
        "square": square,
        "root": signed_root(square),
        "by_coverage": bins,
        "always_wrong_pixels": wrong,
        "seeds": seeds,
    }
    return settle(float(np.mean(error)), extras, floor=signals.floor, status="deterministic" if same else "ok")


def _sum_by_coverage(signals: Signals) -> tuple[FloatArray, FloatArray, NDArray[np.int64], float, int]:
    """Return sums by seed and tenth of the coverage, frame by frame, since all frames at once are gigabytes.

    They are, of the errors and of their squared deviations from the seeds' mean, (seeds, bins) each; the number of
    pixels (bins,); the mean square over pixels of the seeds' mean; and how many pixels are always wrong alike.
    """
    sums, squares = np.zeros((2, signals.seeds, COVERAGE_BINS))
    counts = np.zeros(COVERAGE_BINS, dtype=np.int64)
    mean_square, wrong = 0.0, 0
    for frame, reference in enumerate(signals.reference):
        coverage = np.clip(reference.ravel(), 0.0, 1.0)
        tenth = np.minimum((coverage * COVERAGE_BINS).astype(np.int64), COVERAGE_BINS - 1)
        counts += np.bincount(tenth, minlength=COVERAGE_BINS)
        error = signals.error[:, frame].reshape(signals.seeds, -1)
        # Most pixels of most scenes are right with every seed, and add nothing.
        told = error.any(axis=0)
        error, tenth = error[:, told], tenth[told]
        alike = np.all(error == error[0], axis=0)
        wrong += int(np.sum(alike))
        # The mean of equal numbers is rounded, and would leave a variance.
        mean = np.where(alike, error[0], error.mean(axis=0))
        mean_square += float(np.sum(mean**2))
        for seed, own in enumerate(error):
            sums[seed] += np.bincount(tenth, own, COVERAGE_BINS)
            squares[seed] += np.bincount(tenth, (own - mean) ** 2, COVERAGE_BINS)
    return sums, squares, counts, mean_square / signals.error[0].size, wrong
