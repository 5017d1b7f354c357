"""Equal error and equal time: what one technique costs to be as good as another, read off measured curves.

A curve is the polyline, in log time and log error, through the settings that no quicker setting equals: what a user
gets who may choose the setting. It is exact for power laws, as a straight line fitted to all would be, but it also
follows biases, ordered grids and rasterizers with a fixed cost, where a line is wrong by factors. Beyond the measured
settings its outermost pieces go on, and the score says so.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aliasbench.metrics.convergence import drawn_logs, pooled_log, read_table
from aliasbench.metrics.resampling import FEWEST_REPLICATES, interval_of
from aliasbench.metrics.score import Score, finish
from aliasbench.scenes.model import FloatArray

_ROUNDING = 1e-12  # in logarithms: the end of a curve is part of it, however its RMS was rounded
_FAR = 50.0  # in logarithms: as far as curves go on


class Curve(NamedTuple):
    """What was measured of one technique with several settings.

    Attributes
    ----------
    times : (counts,) or (rounds, counts) numbers above 0
        In seconds, or any other cost; repeated timings are put together by their median.
    errors : (counts,) or (replicates, counts) numbers, not negative
        RMS errors; replicates are put together by their mean square.
    """

    times: ArrayLike
    errors: ArrayLike


class _Lines(NamedTuple):
    """Curves as polylines: the measured one in row 0, then the drawn ones.

    `t` and `e` are (rows, counts + 3) logarithms: a point far before the first setting, the settings in order of time
    (each that is beaten replaced by the last one that is not), the time of the slowest, and a point far beyond.
    """

    t: FloatArray
    e: FloatArray
    covers: tuple[str, ...]


def time_to_error(times: ArrayLike, errors: ArrayLike, target: float) -> Score:
    """Return the time in which a technique reaches an RMS error.

    Extras: `interval`, the 95 % bootstrap interval (an end is None where it is infinite, all of it where neither errors
    nor times have 5 replicates), `covers`, whether it is over replicates of "errors", "times" or both, and `measured`,
    the largest and the least error of the curve.

    Parameters
    ----------
    times, errors : array_like
        See `Curve`. A setting with an error of 0 reaches every target, and none is reached between it and the one
        before.
    target : float
        Above 0.

    Returns
    -------
    Score
        Status `extrapolated` where the target lies outside of what was measured; None with status `out_of_reach` where
        nothing says how the curve goes on.

    Raises
    ------
    ValueError
        For a target or times that are not above 0, values that are negative or not finite, shapes that do not fit.
    """
    lines = _draw(Curve(times, errors), 0)
    logs, outside = _log_times(lines, _log("target", target))
    return _score(logs, outside, lines.covers, {"measured": np.exp(lines.e[0, [1, -2]])})


def samples_to_error(samples: ArrayLike, errors: ArrayLike, target: float) -> Score:
    """Return how many samples reach an RMS error, not rounded: `time_to_error` with counts for times."""
    return time_to_error(samples, errors, target)


def error_at_time(times: ArrayLike, errors: ArrayLike, time: float) -> Score:
    """Return the RMS error that a technique reaches in a time; the inverse of `time_to_error`, with its statuses.

    Parameters, extras and errors are as there, but for `time`, above 0, and `measured`, the least and greatest time.
    """
    at = _log("time", time)
    lines = _draw(Curve(times, errors), 0)
    first, slowest = lines.t[0, 1], lines.t[0, -2]
    outside = not first - _ROUNDING <= at <= slowest + _ROUNDING
    return _score(_log_errors(lines, at), outside, lines.covers, {"measured": np.exp([first, slowest])})


def speedup_at_error(a: Curve, b: Curve, target: float) -> Score:
    """Return how many times sooner `b` reaches an RMS error than `a`: the ratio of their times.

    The two are resampled independently of each other. Extras: `interval` and `covers` as of `time_to_error`; `times`,
    the two times. Status `extrapolated` or `out_of_reach` where either is; errors as there.
    """
    at = _log("target", target)
    lines = [_draw(curve, stream) for curve, stream in ((a, 0), (b, 2))]
    (times_a, outside_a), (times_b, outside_b) = (_log_times(line, at) for line in lines)
    rows = min((len(t) for t in (times_a, times_b) if len(t) > 1), default=1)
    times = np.stack([np.broadcast_to(t[:rows], rows) for t in (times_a, times_b)])
    with np.errstate(invalid="ignore", over="ignore"):  # where both are out of reach
        ratios, seconds = times[0] - times[1], np.exp(times[:, 0])
    if np.isposinf(times[:, 0]).any():
        ratios = np.array([np.inf])
    covers = tuple(dict.fromkeys(name for line in lines for name in line.covers))
    return _score(ratios, outside_a or outside_b, covers, {"times": seconds})


def _log(name: str, value: float) -> float:
    if not (np.isfinite(value) and value > 0.0):
        raise ValueError(f"{name} {value}: must be finite and above 0")
    return float(np.log(value))


def _score(logs: FloatArray, outside: bool, covers: tuple[str, ...], extras: Mapping[str, object]) -> Score:
    """Return the score of log figures (rows,): row 0 is the value, the others give its interval."""
    extras = {**extras, "covers": covers, "interval": None}
    if np.isposinf(logs[0]):
        return finish(Score(None, "out_of_reach", extras))
    with np.errstate(over="ignore"):
        if len(logs) > 1 and not np.isnan(logs).any():
            extras["interval"] = np.exp(interval_of(logs[1:]))
        return finish(Score(float(np.exp(logs[0])), "extrapolated" if outside else "ok", extras))


def _draw(curve: Curve, stream: int) -> _Lines:
    """Return the polylines of a curve; its errors are resampled by `stream`, its times by the next one."""
    times = np.asarray(curve.times, dtype=np.float64)
    if times.ndim not in (1, 2) or not (np.isfinite(times).all() and (times > 0.0).all()):
        raise ValueError(f"times of shape {times.shape} must be (counts,) or (rounds, counts), finite and above 0")
    times = np.atleast_2d(times)
    errors = read_table("times", times[0], curve.errors)[1]
    t, e = pooled_log(times, "median")[None], pooled_log(errors, "rms")[None]
    kinds = (("errors", errors), ("times", times))
    covers = tuple(name for name, table in kinds if len(table) >= FEWEST_REPLICATES)
    if covers:
        drawn_t = drawn_logs(times, "median", stream + 1) if "times" in covers else t
        drawn_e = drawn_logs(errors, "rms", stream) if "errors" in covers else e
        rows = min(len(drawn) for drawn in (drawn_t, drawn_e) if len(drawn) > 1)
        t, e = (np.concatenate([a, np.broadcast_to(b[:rows], (rows, a.size))]) for a, b in ((t, drawn_t), (e, drawn_e)))
    order = np.argsort(t, axis=1, kind="stable")
    t, e = np.take_along_axis(t, order, axis=1), np.take_along_axis(e, order, axis=1)
    slowest = t[:, -1:]
    stands = np.ones(e.shape, dtype=np.bool_)
    stands[:, 1:] = e[:, 1:] < np.minimum.accumulate(e, axis=1)[:, :-1]
    last = np.maximum.accumulate(np.where(stands, np.arange(e.shape[1]), 0), axis=1)
    t, e = np.take_along_axis(t, last, axis=1), np.take_along_axis(e, last, axis=1)
    # The outermost pieces: from the first setting to the next better one, and to the last one from that before it.
    second = np.argmax(e < e[:, :1], axis=1)[:, None]
    before = np.take_along_axis(last, np.maximum(last[:, -1:] - 1, 0), axis=1)
    left, right = _slope(t, e, np.zeros_like(second), second), _slope(t, e, before, last[:, -1:])
    t = np.concatenate([t[:, :1] - _FAR, t, slowest, slowest + _FAR], axis=1)
    e = np.concatenate([e[:, :1] - left * _FAR, e, e[:, -1:], e[:, -1:] + right * _FAR], axis=1)
    return _Lines(t, e, covers)


def _slope(t: FloatArray, e: FloatArray, one: NDArray[np.intp], other: NDArray[np.intp]) -> FloatArray:
    """Return d e / d t (rows, 1) between two settings of each row, 0 where they do not say."""
    with np.errstate(invalid="ignore"):  # of two settings that are both exact
        run, rise = (np.take_along_axis(a, other, axis=1) - np.take_along_axis(a, one, axis=1) for a in (t, e))
    return np.divide(rise, run, out=np.zeros_like(run), where=(run > 0.0) & np.isfinite(rise))


def _log_times(lines: _Lines, at: float) -> tuple[FloatArray, bool]:
    """Return the log times (rows,) at which curves are down to a log error, and whether that was not measured.

    They are inf where the error is never reached, or nothing says how much sooner than by the first setting.
    """
    t, e = lines.t, lines.e
    largest, least = e[0, 1], e[0, -2]
    if at > largest + _ROUNDING and e[0, 0] == largest and np.isfinite(largest):
        return np.array([np.inf]), True
    reached = e <= at + _ROUNDING
    # Column 0 is reached where a draw does not say how errors are before the first setting: then that one will do.
    index = np.maximum(np.argmax(reached, axis=1), 1)
    (t0, t1), (e0, e1) = _ends(t, index), _ends(e, index)
    with np.errstate(invalid="ignore"):
        run = e1 - e0
    share = np.divide(at - e0, run, out=np.ones_like(run), where=np.isfinite(run) & (run < 0.0))
    outside = not least - _ROUNDING <= at <= largest + _ROUNDING and bool(np.isfinite(largest))
    return np.where(reached.any(axis=1), t0 + share * (t1 - t0), np.inf), outside


def _log_errors(lines: _Lines, at: float) -> FloatArray:
    """Return the log errors (rows,) of curves at a log time; inf before the first setting where nothing is known."""
    t, e = lines.t, lines.e
    later = t > at + _ROUNDING
    index = np.where(later.any(axis=1), np.maximum(np.argmax(later, axis=1), 1), t.shape[1] - 1)
    (t0, t1), (e0, e1) = _ends(t, index), _ends(e, index)
    known = np.isfinite(e1)
    drop = np.where(known, e1, 0.0) - np.where(known, e0, 0.0)
    return np.where((index == 1) & (e0 == e1), np.inf, e0 + (at - t0) / (t1 - t0) * drop)


def _ends(values: FloatArray, index: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
    """Return the values (rows,) before and at an index of each row."""
    rows = np.arange(len(values))
    return values[rows, index - 1], values[rows, index]
