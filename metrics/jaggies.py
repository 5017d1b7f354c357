"""Jaggies: how far the picture's edge strays from the true line, in pixels along the edge.

The sum of the error over each column is the difference between the places where picture and reference put the edge:
linear, without a threshold, and 0 for any filter when the two agree. (The threshold contours of print quality standards
are undefined under noise, and a Gaussian reference ripples in them by itself.) Its spread is the raggedness; the part
in step with the edge's crossings of pixel rows is stairstepping, the rest is noise or neither.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from aliasbench.metrics.crawl import crawl_of_edges
from aliasbench.metrics.edges import EdgeWindow, carrier_of, edge_windows
from aliasbench.metrics.gate import Signals
from aliasbench.metrics.score import Score, rms, settle, signed_root
from aliasbench.scenes.model import FloatArray

HARMONICS = 8
# Pixels per degree of the display for which stairs are weighted by how well they are seen.
PPD = 60.0
FEWEST_COLUMNS = 32
HUGE = 1e100
# Maximum of (.0192 + f) exp(-f^1.1) over f, where 1.1 f^.1 (.0192 + f) = 1.
SENSITIVITY_PEAK = 0.37726072
# Relative size below which a harmonic is the same as others at this slope, and counted with them.
DEPENDENT = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Locator:
    """How far the edge is displaced, per seed and column, in pixels towards larger y.

    Attributes
    ----------
    edge, frame : int
        Number of the edge fact; frame number of the scene.
    window : EdgeWindow
    displacement : (seeds, columns) float64
    """

    edge: int
    frame: int
    window: EdgeWindow
    displacement: FloatArray


def locate_edges(signals: Signals) -> list[Locator]:
    """Return the displacement of every edge in every frame in which it has columns to read."""
    return signals.once("edges", lambda: _locate(signals))


def _locate(signals: Signals) -> list[Locator]:
    carriers = [carrier_of(edge, signals.scene) for edge in signals.scene.facts.edges]
    still = edge_windows(signals, carriers, signals.frame_start) if signals.scene.is_static else None
    out = []
    for index in range(signals.frames):
        frame = index + signals.frame_start
        for edge, window in enumerate(still or edge_windows(signals, carriers, frame)):
            if window is None:
                continue
            error = signals.error[:, index]
            error = np.swapaxes(error, 1, 2) if window.transposed else error
            rows = window.first_row + np.arange(window.rows)[:, None] - signals.crop
            columns = window.columns - signals.crop
            displacement: FloatArray = window.sign * np.sum(error[:, rows, columns[None, :]], axis=1)
            out.append(Locator(edge, frame, window, displacement))
    return out


def _each_edge(
    locators: list[Locator], figure: Callable[[Locator], float], mean: Callable[[FloatArray], float]
) -> list[dict[str, object]]:
    edges: list[dict[str, object]] = []
    for edge in sorted({x.edge for x in locators}):
        own = [x for x in locators if x.edge == edge]
        edges.append(
            {
                "edge": edge,
                "value": mean(np.array([figure(x) for x in own])),
                "slope": own[0].window.slope,
                "transposed": own[0].window.transposed,
                "columns": min(x.window.columns.size for x in own),
                "frames": len(own),
            }
        )
    return edges


def _over_edges(signals: Signals, figure: Callable[[Locator], float], mean: Callable[[FloatArray], float]) -> Score:
    """Return `mean` of the figure over all edges and frames; extras: the same for each edge."""
    locators = locate_edges(signals)
    if not locators:
        return Score(None, "edge_leaves_window", {"edges": len(signals.scene.facts.edges)})
    value = mean(np.array([figure(x) for x in locators]))
    floor = signals.floor * max(x.window.rows for x in locators)
    return settle(value, {"edges": _each_edge(locators, figure, mean)}, floor=floor)


def _mean(values: FloatArray) -> float:
    return float(np.mean(values))


def compute_jaggies(signals: Signals) -> Score:
    """Return J_std, the standard deviation of the displacement along the edge; quadratic mean of edges and frames."""
    return _over_edges(signals, lambda x: rms(x.displacement - np.mean(x.displacement, axis=1, keepdims=True)), rms)


def compute_jaggies_rms(signals: Signals) -> Score:
    """Return J_rms, the root mean square of the displacement; quadratic mean of edges and frames."""
    return _over_edges(signals, lambda x: rms(x.displacement), rms)


def compute_jaggies_bias(signals: Signals) -> Score:
    """Return J_bias, the mean displacement with its sign (towards larger y, or x); mean of edges and frames."""
    return _over_edges(signals, lambda x: _mean(x.displacement), _mean)


def edge_phase(window: EdgeWindow) -> FloatArray:
    """Return (columns,): how far through its pixel row the edge is at each column's middle, in [0, 1)."""
    out: FloatArray = np.mod(window.slope * (window.columns + 0.5) + window.intercept, 1.0)
    return out


@dataclass(frozen=True, slots=True, eq=False)
class Stairs:
    """The structured part of one edge: J_str^2 without the noise's share, and what it was made from."""

    square: float
    rest_square: float
    noise_variance: float
    rank: int
    harmonics: FloatArray
    visible_square: float


def contrast_sensitivity(cycles_per_degree: FloatArray) -> FloatArray:
    """Return how well a frequency is seen against the best, which has 1 at 8 cycles per degree.

    2.6 (.0192 + .114 f) exp(-(.114 f)^1.1), Mannos and Sakrison 1974, over its maximum .98.
    """
    f = np.abs(0.114 * np.asarray(cycles_per_degree, dtype=np.float64))
    out: FloatArray = (0.0192 + f) * np.exp(-(f**1.1)) / SENSITIVITY_PEAK
    return out


def split_stairs(locator: Locator) -> Stairs:
    """Return the part of the displacement that repeats with the pixel rows the edge crosses.

    The mean over seeds, less its mean along the edge, is projected on the harmonics up to 8 of the phase. On rational
    slopes several harmonics are the same vector, so dependent ones are dropped (a sum over harmonics would count them
    twice). White noise of variance s2 puts s2 rank / columns into the projection, which is taken off: s2 comes from
    independent seeds, or with one sequence from what the projection leaves over, which is 0 on rational slopes and
    next to 0 for any stairs.
    """
    seeds, count = locator.displacement.shape
    r = np.mean(locator.displacement, axis=0)
    r = r - np.mean(r)
    phase = edge_phase(locator.window)
    turns = 2.0 * np.pi * np.arange(1, HARMONICS + 1)[:, None] * phase
    waves = np.concatenate([np.cos(turns), np.sin(turns)]).T
    basis, strength, _ = np.linalg.svd(waves - np.mean(waves, axis=0), full_matrices=False)
    basis = basis[:, strength > DEPENDENT * np.sqrt(count)]
    rank = basis.shape[1]
    projected = float(np.sum((basis.T @ r) ** 2)) / count
    rest = max(float(np.mean(r**2)) - projected, 0.0)
    if seeds > 1:
        variance = float(np.mean(np.var(locator.displacement, axis=0, ddof=1))) / seeds
    else:
        variance = rest * count / max(count - 1 - rank, 1)
    c = np.abs(np.mean(r * np.exp(-1j * turns), axis=1))
    square = projected - variance * rank / count
    # Harmonics that are the same vector show the same power: their sum is no measure, but tells the shares.
    weight = contrast_sensitivity(np.arange(1.0, HARMONICS + 1) * stairs_per_px(locator.window) * PPD)
    power = float(np.sum(c**2))
    seen = float(np.sum((weight * c) ** 2)) / power if power > 0.0 else 0.0
    return Stairs(square, rest, variance, rank, c, square * seen)


def stairs_per_px(window: EdgeWindow) -> float:
    """Return how many pixel rows the edge crosses per pixel of its length."""
    return abs(window.slope) / float(np.hypot(1.0, window.slope))


def compute_jaggies_str(signals: Signals) -> Score:
    """Return J_str, the root of the mean structured square; extras keep the square with its sign.

    The value carries the sign of the square: noise alone gives values on both sides of 0. Further extras: `visible`,
    the same with the harmonics weighted by how well they are seen on a display of 60 pixels per degree, and `crawl`,
    the stairs' speed along moving edges (`crawl.crawl_of_edges`).
    """
    locators = locate_edges(signals)
    if not locators:
        return Score(None, "edge_leaves_window", {"edges": len(signals.scene.facts.edges)})
    long = [x for x in locators if x.window.columns.size >= FEWEST_COLUMNS]
    if not long:
        most = max(x.window.columns.size for x in locators)
        return Score(None, "undefined_too_small", {"columns": most, "smallest": FEWEST_COLUMNS})
    # What overflows when squared is measured in units of the largest; extras in squares are then None.
    largest = max(float(np.max(np.abs(x.displacement))) for x in long)
    scale = largest if largest > HUGE else 1.0
    if scale > 1.0:
        long = [replace(x, displacement=x.displacement / scale) for x in long]
    stairs = [split_stairs(x) for x in long]
    square = _mean(np.array([s.square for s in stairs]))
    floor = signals.floor * max(x.window.rows for x in long)
    unit = scale * scale
    extras = {
        "signed_square": square * unit,
        "rest_square": _mean(np.array([s.rest_square for s in stairs])) * unit,
        "noise_variance": _mean(np.array([s.noise_variance for s in stairs])) * unit,
        "noise_from": "seeds" if signals.seeds > 1 else "residual",
        "harmonics": scale * np.sqrt(np.mean([s.harmonics**2 for s in stairs], axis=0)),
        "edges": [
            {"edge": x.edge, "frame": x.frame, "signed_square": s.square * unit, "rank": s.rank}
            for x, s in zip(long, stairs, strict=True)
            if x.frame == signals.frame_start
        ],
        "visible": {
            "value": scale * signed_root(_mean(np.array([s.visible_square for s in stairs]))),
            "ppd": PPD,
            "sensitivity": "Mannos and Sakrison 1974",
        },
        "crawl": crawl_of_edges(long, floor / scale),
    }
    return settle(scale * signed_root(square), extras, floor=floor)
