"""Sharpness beside every figure of false detail: blur removes aliasing too, and must not win by it.

The metrics of the picture alone (`shimmer_abs`, `strobing`) fall with every loss of detail. The width of the picture's
edges and the frequency at which half of the modulation is left say what was paid.
"""

import numpy as np
from scipy import interpolate

from aliasbench.metrics.edge_spread import EdgeSpread, describe_spreads, spread_edges, usable_spreads
from aliasbench.metrics.gate import Signals
from aliasbench.metrics.mtf import compute_mtf50
from aliasbench.metrics.score import Score
from aliasbench.scenes.model import FloatArray

LEVELS = (0.1, 0.9)
# Points per pixel at which the profiles of several edges are averaged.
FINE = 64


def crossing(distance: FloatArray, value: FloatArray, level: float, start: float, direction: int) -> float | None:
    """Return the first place at which a profile reaches the level, going from `start` towards one end, or None."""
    side = distance > start if direction > 0 else distance < start
    place = np.concatenate([[start], distance[side][::direction]])
    height = np.concatenate([[np.interp(start, distance, value)], value[side][::direction]])
    reached = np.flatnonzero((height - level) * direction >= 0.0)
    if not reached.size:
        return None
    last = int(reached[0])
    if last == 0:
        return start
    step = (level - height[last - 1]) / (height[last] - height[last - 1])
    return float(place[last - 1] + step * (place[last] - place[last - 1]))


def middle_of(distance: FloatArray, value: FloatArray) -> float:
    """Return where a profile from 0 to 1 rises through 1/2, nearest to the true line."""
    above = value >= 0.5
    rise = np.flatnonzero(~above[:-1] & above[1:])
    share = (0.5 - value[rise]) / (value[rise + 1] - value[rise])
    places = distance[rise] + share * (distance[rise + 1] - distance[rise])
    return float(places[np.argmin(np.abs(places))])


def mean_profile(profiles: list[tuple[FloatArray, FloatArray]]) -> tuple[FloatArray, FloatArray]:
    """Return the mean of several profiles (distance, value), each moved so that its middle is at 0.

    A picture that displaces its edges, each by another amount, is not less sharp for it.
    """
    moved = [(distance - middle_of(distance, value), value) for distance, value in profiles]
    end = max(max(-distance[0], distance[-1]) for distance, _ in moved)
    grid = np.arange(-np.ceil(end * FINE), np.ceil(end * FINE) + 1.0) / FINE
    return grid, np.mean([_resample(grid, distance, value) for distance, value in moved], axis=0)


def _resample(grid: FloatArray, distance: FloatArray, value: FloatArray) -> FloatArray:
    within = np.clip(grid, distance[0], distance[-1])
    # Akima's curve does not swing beside the kinks that a box filter's profile has near 10 % and 90 %.
    out: FloatArray = interpolate.Akima1DInterpolator(distance, value)(within)
    return out


def rise_width(profiles: list[tuple[FloatArray, FloatArray]]) -> float | None:
    """Return the distance from 10 % to 90 % of the mean profile, out of its middle, in pixels."""
    if not profiles:
        return None
    distance, value = mean_profile(profiles)
    low = crossing(distance, value, LEVELS[0], 0.0, -1)
    high = crossing(distance, value, LEVELS[1], 0.0, 1)
    return None if low is None or high is None else high - low


def _profiles(spreads: list[EdgeSpread], which: str) -> list[tuple[FloatArray, FloatArray]]:
    if which == "test":
        return [(s.distance, s.test) for s in spreads if s.contrast]
    return [(s.distance, s.reference) for s in spreads if s.reference_contrast]


def compute_edge_width(signals: Signals) -> Score:
    """Return the distance over which the picture's edges rise from 10 % to 90 %, in pixels.

    Of one edge the profiles of all frames and seeds are averaged, of several edges the profiles about their middles. A
    rise within one step between the distances that the pixels offer has no width that could be told from 0, as that of
    point samples: `below_resolution`.
    """
    spreads = usable_spreads(signals)
    if isinstance(spreads, Score):
        return spreads
    width = rise_width(_profiles(spreads, "test"))
    resolution = max(s.gap_px for s in spreads)
    extras = {
        "reference_edge_width": rise_width(_profiles(spreads, "reference")),
        "overshoot": max(max(float(np.max(s.test)) - 1.0, -float(np.min(s.test))) for s in spreads),
        "resolution_px": resolution,
        "edges": describe_spreads(spread_edges(signals)),
    }
    if width is None or width <= resolution:
        return Score(None, "below_resolution", {**extras, "measured": width})
    return Score(width, "ok", extras)


def sharpness(signals: Signals) -> dict[str, object]:
    """Return {"mtf50", "edge_width", "missing"} of the picture, as extras beside figures of false detail.

    Figures that the picture does not have are None, and `missing` has the status that says why by their names
    (`not_applicable` in scenes without edges).
    """
    if not signals.scene.facts.edges:
        scores = dict.fromkeys(("mtf50", "edge_width"), Score(None, "not_applicable"))
    else:
        scores = {"mtf50": compute_mtf50(signals), "edge_width": compute_edge_width(signals)}
    missing = {name: score.status for name, score in scores.items() if score.value is None}
    return {**{name: score.value for name, score in scores.items()}, "missing": missing}
