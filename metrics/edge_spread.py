"""Edge spread functions: what a picture makes of a step, read far more finely than its pixels lie.

Along an edge that is not parallel to the pixel rows every pixel is at another distance from the true line, so one edge
samples its own profile at many distances: the slanted edge of ISO 12233. The scene declares the line, so nothing is
fitted, and the pixels of all seeds and frames that show the edge go into the same profile: profiles are averaged,
never figures taken from them. An edge along the pixel grid has one distance a row, and more where it moves.
"""

from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from aliasbench.metrics.edges import EdgeWindow
from aliasbench.metrics.gate import Signals
from aliasbench.metrics.jaggies import Locator, locate_edges
from aliasbench.metrics.score import Score, rms
from aliasbench.scenes.model import FloatArray

# A step read with 4 bins a pixel is corrected by 5 % too much at Nyquist; with 16 by 0.3 %.
BINS_PER_PX = 16
# Distances farther apart leave the profile between them open. At this step a box filter's transfer at Nyquist is right
# to .02 whatever the phase (of its spectrum's images |sinc(7/2) sinc(7/8)| + |sinc(9/2) sinc(9/8)| is left), and a
# step's is over-corrected by 1 / sinc(1/8).
LARGEST_GAP_PX = 1.0 / 4.0
# At both ends of the profile this much is flat, and tells the two levels.
LEVEL_PX = 0.25
# Of the declared contrast. Single precision leaves a step of some 1e-7 anywhere.
LEAST_CONTRAST = 1e-6
# Standard deviations by which two levels must differ.
SIGNIFICANT = 5.0
SAME_DISTANCE_PX = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class EdgeSpread:
    """The profile across one edge, over all its frames and seeds.

    Attributes
    ----------
    edge : int
        Number of the edge fact.
    window : EdgeWindow
        Of the first frame.
    pixels : int
        How many were read of one seed.
    distance : (n,) float64
        From the true line along its normal, in pixels, positive on the bright side; ascending. The mean of the bin's.
    test, reference : (n,) float64
        0 on the dark level, 1 on the bright one; all 0 where there is no edge.
    contrast, reference_contrast : float
        Between the levels, in units of the scene's contrast; 0 where that is not significant.
    bin_px : float
        Width of the box that spreads distances as the bins do: 1/16 where a bin holds all of its, 0 where it holds one.
    gap_px : float
        Largest step of `distance`.
    """

    edge: int
    window: EdgeWindow
    pixels: int
    distance: FloatArray
    test: FloatArray
    reference: FloatArray
    contrast: float
    reference_contrast: float
    bin_px: float
    gap_px: float

    @property
    def status(self) -> str:
        """Why the test picture has no profile here, or ``ok``."""
        if self.gap_px > LARGEST_GAP_PX + SAME_DISTANCE_PX:
            return "undefined_too_few_phases"
        return "ok" if self.contrast else "undefined_no_edge"


def spread_edges(signals: Signals) -> list[EdgeSpread]:
    """Return the profile of every edge that has columns to read in some frame."""
    return signals.once("edge spread", lambda: _spread(signals))


def usable_spreads(signals: Signals) -> list[EdgeSpread] | Score:
    """Return the profiles that can be measured, or the score that says why there is none.

    `edge_leaves_window` where no edge has columns to read, `undefined_too_few_phases` where none has pixels at enough
    distances (edges along the pixel grid, or with slopes of small whole numbers), `undefined_no_edge` where the picture
    shows no step.
    """
    spreads = spread_edges(signals)
    if not spreads:
        return Score(None, "edge_leaves_window", {"edges": len(signals.scene.facts.edges)})
    usable = [s for s in spreads if s.status == "ok"]
    if usable:
        return usable
    reasons = [s.status for s in spreads]
    status = "undefined_no_edge" if "undefined_no_edge" in reasons else "undefined_too_few_phases"
    return Score(None, status, {"edges": describe_spreads(spreads), "largest_gap_px": LARGEST_GAP_PX})


def describe_spreads(spreads: list[EdgeSpread]) -> list[dict[str, object]]:
    """Return what was read of each edge, as extras."""
    return [
        {
            "edge": s.edge,
            "status": s.status,
            "slope": s.window.slope,
            "transposed": s.window.transposed,
            "pixels": s.pixels,
            "gap_px": s.gap_px,
            "contrast": s.contrast,
        }
        for s in spreads
    ]


def _spread(signals: Signals) -> list[EdgeSpread]:
    locators = sorted(locate_edges(signals), key=lambda x: x.edge)
    test = signals.test.reshape(signals.seeds, signals.frames, -1)
    reference = signals.reference.reshape(1, signals.frames, -1)
    return [_profile(signals, (test, reference), list(own)) for _, own in groupby(locators, key=lambda x: x.edge)]


def _profile(signals: Signals, pictures: tuple[FloatArray, FloatArray], own: list[Locator]) -> EdgeSpread:
    """Return the profile of one edge in two pictures (seeds, frames, pixels) from all frames that show it."""
    size = 2 * BINS_PER_PX * max(x.window.rows + 2 for x in own)
    sums = np.zeros((6, size))
    pixels, scale = 0, 0.0
    # Frames of a still scene share their window: the mean of them is read once.
    for _, same in groupby(own, key=lambda x: id(x.window)):
        group = list(same)
        frames = [x.frame - signals.frame_start for x in group]
        away, pick = _place(signals, group[0].window)
        index = np.floor(away * BINS_PER_PX).astype(np.int64) + size // 2
        pixels += pick.size * len(frames)
        test, reference = (_mean_of(picture, frames, pick) for picture in pictures)
        scale = scale or max(1.0, float(np.max(np.abs(test))))  # squares of 1e200 overflow
        for row, weights in enumerate((None, away, away**2, test, (test / scale) ** 2, reference)):
            sums[row] += np.bincount(index, weights, size)
    count, means = _merge(sums[:, sums[0] > 0.0])
    distance = means[0]
    variance = np.maximum(means[1] - distance**2, 0.0)
    noise = np.sqrt(np.maximum(means[3] - (means[2] / scale) ** 2, 0.0)) * scale
    test, contrast = _normalise(distance, means[2], count, noise)
    reference, reference_contrast = _normalise(distance, means[4], count, np.zeros(count.size))
    return EdgeSpread(
        own[0].edge,
        own[0].window,
        pixels,
        distance,
        test,
        reference,
        contrast,
        reference_contrast,
        float(np.sqrt(12.0 * np.mean(variance))),
        float(np.max(np.diff(distance))) if distance.size > 1 else float(2 * own[0].window.reach),
    )


def _merge(sums: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the counts (n,) and the means (5, n) of bins, those joined whose pixels are at the same distance.

    On rational slopes many are, and rounding puts them on either side of a bin's end.
    """
    apart = np.diff(sums[1] / sums[0], prepend=-np.inf) > SAME_DISTANCE_PX
    joined = np.add.reduceat(sums, np.flatnonzero(apart), axis=1)
    return joined[0], joined[1:] / joined[0]


def _place(signals: Signals, window: EdgeWindow) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return the distances of a window's pixels and their indices into a flat picture.

    The window is a row higher on both sides where the picture is: other edges are kept out of there, too.
    """
    height, width = signals.size if window.transposed else signals.size[::-1]
    low, high = int(np.min(window.first_row)), int(np.max(window.first_row)) + window.rows
    more = int(low > signals.crop and high < height - signals.crop)
    rows = window.first_row + np.arange(-more, window.rows + more)[:, None]
    normal = np.hypot(1.0, window.slope)
    distance = (window.slope * (window.columns + 0.5) + window.intercept - (rows + 0.5)) * (window.sign / normal)
    inside = np.abs(distance) <= (window.reach + more) / normal
    rows, columns = rows - signals.crop, window.columns - signals.crop
    flat = (
        columns * (height - 2 * signals.crop) + rows
        if window.transposed
        else rows * (width - 2 * signals.crop) + columns
    )
    return distance[inside], flat[inside]


def _mean_of(picture: FloatArray, frames: list[int], pick: NDArray[np.int64]) -> FloatArray:
    """Return the picked pixels' mean over seeds and some frames."""
    out: FloatArray = np.zeros(pick.size)
    for seed in range(picture.shape[0]):
        for frame in frames:
            out += picture[seed, frame].take(pick)
    out /= picture.shape[0] * len(frames)
    return out


def _normalise(
    distance: FloatArray, value: FloatArray, count: FloatArray, deviation: FloatArray
) -> tuple[FloatArray, float]:
    """Return the profile between its levels as 0 to 1, and the contrast of the levels; zeros if there is none."""
    ends = distance <= distance[0] + LEVEL_PX, distance >= distance[-1] - LEVEL_PX
    levels, doubt = [], 0.0
    for end in ends:
        share = count[end] / np.sum(count[end])
        levels.append(float(share @ value[end]))
        doubt = float(np.hypot(doubt, rms(deviation[end]) / np.sqrt(np.sum(count[end]))))
    contrast = levels[1] - levels[0]
    if not abs(contrast) > max(LEAST_CONTRAST, SIGNIFICANT * doubt) or not np.isfinite(contrast):
        return np.zeros(value.size), 0.0
    out = (value - levels[0]) / contrast
    out[ends[0]], out[ends[1]] = 0.0, 1.0
    return out, contrast
