"""Time as evidence: raw seconds are kept, and what they mean is computed when they are read.

Techniques are timed in rounds, one render of each in every round, so that a slow minute of the machine hits all alike;
every round starts with the next technique, so that none always follows the same neighbour. The first renders are
warm-up and are not kept. The headline is the median with a bootstrap interval; where the numbers cannot carry a
conclusion, a sentence says so.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

RESAMPLES = 2000
CONFIDENCE = 0.95
WIDE_SPREAD = 0.10
SHORT_SECONDS = 1e-3
FEW_ROUNDS = 5
FAR_OUT = 2.0


@dataclass(frozen=True, slots=True)
class TimingSummary:
    """What repeated timings of one thing say.

    Attributes
    ----------
    median_s, low_s, high_s : float
        Seconds: the median and the ends of its 95 % bootstrap interval.
    spread : float
        Distance between the quartiles, as a share of the median.
    rounds : int
    warnings : tuple of str
        Why the figures should not be relied upon; empty where they can be.
    """

    median_s: float
    low_s: float
    high_s: float
    spread: float
    rounds: int
    warnings: tuple[str, ...]


def summarise(seconds: Sequence[float]) -> TimingSummary:
    """Return the median of raw timings, its 95 % percentile-bootstrap interval, and warnings.

    The resampling is seeded with a constant: the same seconds always give the same interval (Efron and Tibshirani 1993,
    chapter 13).

    Raises
    ------
    ValueError
        If there are no timings, or one is negative or not finite.
    """
    raw = np.asarray(seconds, dtype=np.float64)
    if raw.ndim != 1 or raw.size == 0:
        raise ValueError("no timings to summarise")
    if not (np.isfinite(raw).all() and (raw >= 0).all()):
        raise ValueError("timings must be finite and not negative")
    median = float(np.median(raw))
    resampled = np.random.default_rng(0).choice(raw, size=(RESAMPLES, raw.size))
    tail = (1.0 - CONFIDENCE) / 2.0
    low, high = np.quantile(np.median(resampled, axis=1), [tail, 1.0 - tail])
    lower, upper = np.quantile(raw, [0.25, 0.75])
    spread = float((upper - lower) / median) if median > 0 else 0.0
    warnings = []
    if spread > WIDE_SPREAD:
        warnings.append(f"spread {spread:.0%} (over {WIDE_SPREAD:.0%})")
    if raw.max() > FAR_OUT * median:
        warnings.append(f"up to {raw.max() / median:.1f} times the median")
    if median < SHORT_SECONDS:
        warnings.append(f"under {SHORT_SECONDS * 1e3:.0f} ms")
    if raw.size < FEW_ROUNDS:
        warnings.append(f"only {raw.size} round{'s' if raw.size > 1 else ''}")
    return TimingSummary(median, float(low), float(high), spread, int(raw.size), tuple(warnings))


def interleaved(count: int, rounds: int) -> Iterator[tuple[int, tuple[int, ...]]]:
    """Yield (round, order): every round holds each of `count` things once, starting one further than the last."""
    for number in range(rounds):
        yield number, tuple((number + i) % count for i in range(count))
