"""Bootstrap intervals over replicates: the same numbers always give the same interval, and few replicates a wide one.

What is drawn are the logarithms of pooled figures as they may truly be; whatever is computed from the draws, slope or
time, has the percentiles of its draws as its interval. Means of squares are drawn by the bootstrap-t (Efron and
Tibshirani 1993, section 12.5): of few, skewed values the percentiles of resampled means are too narrow, and BCa is no
wider (of 8 replicates whose squares are lognormal with sigma .6 or chi-square, a "95 %" interval of the mean holds the
truth in 87 to 90 % by percentiles, even set out to Student's distribution, in 83 to 86 % by BCa, in 91 to 93 % by the
bootstrap-t). Medians are drawn by resampling.
"""

import functools
from collections.abc import Iterable, Iterator

import numpy as np

from aliasbench.scenes.model import FloatArray, read_only

RESAMPLES = 2000
CONFIDENCE = 0.95
# Of 4 values, one resampling in 64 holds only one of them, and says nothing of their spread: the tails are full of
# those. Of 5, one in 625.
FEWEST_REPLICATES = 5
_BLOCK = 2**20  # draws at a time: 8 MB
_MOST_KEPT = 64  # replicates up to which the draws are kept for the next caller: 1 MB


def resampling_weights(replicates: int, stream: int = 0) -> Iterable[FloatArray]:
    """Return how often each replicate is drawn, in blocks (resamples, replicates), RESAMPLES rows in all.

    Parameters
    ----------
    replicates : int
        One or more; what each row sums to.
    stream : int
        Things that were measured independently are resampled independently: each takes another number.
    """
    if replicates <= _MOST_KEPT:
        return _kept_weights(replicates, stream)
    return _draw_weights(replicates, stream)


def _draw_weights(replicates: int, stream: int) -> Iterator[FloatArray]:
    rng = np.random.default_rng((stream, replicates))
    rows = max(1, _BLOCK // replicates)
    shares = np.full(replicates, 1.0 / replicates)
    for start in range(0, RESAMPLES, rows):
        weights: FloatArray = rng.multinomial(replicates, shares, min(rows, RESAMPLES - start)).astype(np.float64)
        yield read_only(weights)


@functools.lru_cache(maxsize=32)
def _kept_weights(replicates: int, stream: int) -> tuple[FloatArray, ...]:
    return tuple(_draw_weights(replicates, stream))


def draw_log_means(values: FloatArray, stream: int) -> FloatArray:
    """Return log means as they may truly be, (draws, counts), of values (replicates, counts), not negative.

    The draws are L - SE (l - L) / se, with L and SE the log of the measured mean and its standard error, l and se those
    of a resampling; replicates are drawn whole, so that what is common to their counts stays common. At most RESAMPLES
    draws: resamplings without spread or without any value above 0 are left out. A mean of 0 is drawn as -inf.
    """
    n = len(values)
    sums = [(weights @ values, weights @ np.square(values)) for weights in resampling_weights(n, stream)]
    means, squares = (np.concatenate(part) / n for part in zip(*sums, strict=True))
    mean = values.mean(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        error = values.std(axis=0, ddof=1) / np.sqrt(n) / mean
        errors = np.sqrt(np.maximum(squares - means**2, 0.0) / (n - 1)) / means
        off = np.where(error > 0.0, np.log(means / mean) / errors * error, 0.0)
        return np.asarray((np.log(mean) - off)[np.isfinite(off).all(axis=1)])


def draw_medians(values: FloatArray, stream: int) -> FloatArray:
    """Return the medians of resampled values (replicates, counts), (RESAMPLES, counts)."""
    n = len(values)
    order = np.argsort(values, axis=0)
    ranked = np.take_along_axis(values, order, axis=0)
    # The middle value, or the two about the middle: numbers (n - 1) // 2 and n // 2 of the sorted draws, counted by how
    # many ranks hold no more draws than that.
    middles = ((n - 1) // 2, n // 2)
    blocks = []
    for weights in resampling_weights(n, stream):
        columns = []
        for places, column in zip(order.T, ranked.T, strict=True):
            until = np.cumsum(weights[:, places], axis=1)
            low, high = (column[np.sum(until <= k, axis=1)] for k in middles)
            columns.append((low + high) / 2.0)
        blocks.append(np.stack(columns, axis=1))
    return np.concatenate(blocks)


def interval_of(draws: FloatArray) -> tuple[float, float]:
    """Return the ends of the 95 % interval of some drawn figures (n,), none of them NaN; may be infinite."""
    tail = (1.0 - CONFIDENCE) / 2.0
    # No interpolation: between a finite figure and an infinite one there is nothing.
    low, high = np.quantile(draws, tail, method="lower"), np.quantile(draws, 1.0 - tail, method="higher")
    return float(low), float(high)
