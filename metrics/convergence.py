"""How error falls with samples: the slope of a sampler, on numbers that were measured elsewhere.

The slope of log RMS over log N tells samplers apart whatever the scene's contrast: -1/2 of independent samples, -3/4 of
strata across an edge (Mitchell 1996), -1 of strata in smooth areas, 0 of a bias. Replicates (seeds, or edges of one
population) are put together before the logarithm is taken, because the mean of logarithms depends on how much the
replicates differ, and a replicate that happens to be exact has no logarithm.
"""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from aliasbench.metrics.resampling import CONFIDENCE, FEWEST_REPLICATES, draw_log_means, draw_medians, interval_of
from aliasbench.metrics.score import Score, finish
from aliasbench.scenes.model import FloatArray

Pool = Literal["rms", "mse", "median"]


def fit_slope(samples: ArrayLike, values: ArrayLike, *, pool: Pool = "rms") -> Score:
    """Return the least-squares slope of log RMS (or log time) over log sample count.

    Extras: `interval`, the 95 % bootstrap interval over replicates (None of fewer than 5); `residual_interval`,
    Student's from the scatter of the counts about the line (None of fewer than 3), which holds where the law is a power
    law; `at_one`, the fitted value at one sample; `last_slope`, between the two largest counts, nearer to 0 than the
    slope where a bias remains; `residual`, the RMS distance from the line in natural logarithms; `counts` and
    `replicates`, how many of each.

    Parameters
    ----------
    samples : (counts,) numbers above 0
        In any order; a count that is there several times weighs as much more.
    values : (counts,) or (replicates, counts) numbers, finite and not negative
        What was measured with each count.
    pool : {"rms", "mse", "median"}
        What the values are and how replicates are put together: RMS errors by their mean square, mean square errors by
        their mean (the slope is the RMS's in both cases), times by their median.

    Returns
    -------
    Score
        Status `identical` where the error of a count is 0, which has no logarithm (`exact` says which), and
        `undefined_one_count` where all counts are the same.

    Raises
    ------
    ValueError
        For counts that are not above 0, values that are negative or not finite, or shapes that do not fit.
    """
    counts, table = read_table("samples", samples, values)
    replicates = table.shape[0]
    facts: dict[str, object] = {"counts": int(np.unique(counts).size), "replicates": replicates}
    if facts["counts"] == 1:
        return finish(Score(None, "undefined_one_count", facts))
    logs = pooled_log(table, pool)
    if np.isneginf(logs).any():
        return finish(Score(None, "identical", {**facts, "exact": counts[np.isneginf(logs)]}))
    at = np.log(counts)
    x = at - at.mean()
    slope = float(logs @ x / (x @ x))
    residuals = logs - logs.mean() - slope * x
    interval = None
    if replicates >= FEWEST_REPLICATES:
        draws = drawn_logs(table, pool, 0)
        interval = interval_of(draws @ x / (x @ x)) if len(draws) else None
    order = np.argsort(at, kind="stable")
    last = at == at[order[-1]]
    before = at == at[~last].max()
    rise = logs[last].mean() - logs[before].mean()
    extras = {
        **facts,
        "interval": interval,
        "residual_interval": _residual_interval(slope, residuals, float(x @ x)),
        "at_one": float(np.exp(logs.mean() - slope * at.mean())),
        "last_slope": float(rise / (at[last].mean() - at[before].mean())),
        "residual": float(np.sqrt(np.mean(residuals**2))),
    }
    return finish(Score(slope, "ok", extras))


def _residual_interval(slope: float, residuals: FloatArray, spread: float) -> tuple[float, float] | None:
    """Return Student's interval of a slope with counts - 2 degrees of freedom; `spread` is the sum of x^2 about 0."""
    free = residuals.size - 2
    if free < 1:
        return None
    error = float(np.sqrt(np.sum(residuals**2) / free / spread))
    half = float(special.stdtrit(free, (1.0 + CONFIDENCE) / 2.0)) * error
    return slope - half, slope + half


def read_table(name: str, along: ArrayLike, values: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return counts (counts,) and values (replicates, counts) in float64, checked.

    Raises
    ------
    ValueError
        See `fit_slope`; `name` is what the counts are called in messages.
    """
    counts, table = np.asarray(along, dtype=np.float64), np.asarray(values, dtype=np.float64)
    if counts.ndim != 1 or counts.size == 0:
        raise ValueError(f"{name}: shape {counts.shape}; must be one number for each count, and at least one")
    if not (np.isfinite(counts).all() and (counts > 0.0).all()):
        raise ValueError(f"{name}: {counts.tolist()} must be finite and above 0")
    if table.ndim not in (1, 2) or table.size == 0 or table.shape[-1] != counts.size:
        raise ValueError(f"values of shape {table.shape} do not fit {counts.size} {name}")
    if not (np.isfinite(table).all() and (table >= 0.0).all()):
        raise ValueError("values must be finite and not negative")
    return counts, table.reshape(-1, counts.size)


def pooled_log(table: FloatArray, pool: Pool) -> FloatArray:
    """Return the log of the replicates' RMS or median (counts,), -inf where it is 0."""
    with np.errstate(divide="ignore"):
        if pool == "median":
            return np.asarray(np.log(np.median(table, axis=0)))
        scale, squares = _squares(table, pool)
        return np.asarray(np.log(scale) + 0.5 * np.log(squares.mean(axis=0)))


def drawn_logs(table: FloatArray, pool: Pool, stream: int) -> FloatArray:
    """Return `pooled_log` as it may truly be, (draws, counts); see `resampling`."""
    if pool == "median":
        return np.asarray(np.log(draw_medians(table, stream)))
    scale, squares = _squares(table, pool)
    return np.asarray(np.log(scale) + 0.5 * draw_log_means(squares, stream))


def _squares(table: FloatArray, pool: Pool) -> tuple[FloatArray, FloatArray]:
    """Return a scale (counts,) of the RMS, and the squares of the errors relative to it.

    Each count has its own scale, so that squares neither overflow nor vanish.
    """
    largest = table.max(axis=0)
    safe = np.where(largest > 0.0, largest, 1.0)
    return (np.sqrt(safe), table / safe) if pool == "mse" else (safe, (table / safe) ** 2)
