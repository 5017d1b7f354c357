"""Gaps: pixels in which something should be seen and nothing is, as where a thin triangle falls between the samples.

Mean errors hide them: a sliver that is a row of bright dots has nearly the right light in total, and a renderer that
loses a tenth of every pixel's light has the RMSE of one that loses every hundredth pixel whole. Counted is what the eye
sees as a break: the truth stands out from the dark, and the picture is as dark as if nothing were there.
"""

import numpy as np

from aliasbench.metrics.gate import Signals
from aliasbench.metrics.score import Score, rms, settle
from aliasbench.scenes.model import FloatArray

# Of the contrast: how far above the darkest pixel the truth stands out; and less than a step of an 8-bit picture.
STANDS_OUT = 1.0 / 8.0
NOTHING = 1.0 / 256.0


def compute_gaps(signals: Signals) -> Score:
    """Return how many pixels of a frame are gaps, on average over frames and seeds.

    A gap is a pixel whose reference is more than 1/8 of the contrast above the darkest pixel of the frame's reference,
    while the picture is less than 1/256 above that. Extras: how many pixels stand out, the share of them that are gaps,
    and `coverage_error`, the total light's error over the light above the darkest pixel (root mean square over frames
    and seeds; with its sign `coverage_bias`): what the gaps lose and the dots between them have too much. The score is
    `below_reference_floor` where pixels that the reference's uncertainty may move across a threshold are more than a
    third of it.
    """
    value = _count(signals, 0.0)
    # The darkest pixel is uncertain too, which moves a threshold once more.
    slack = 2.0 * signals.uncertainty
    floor = 3.0 * (_count(signals, slack) - _count(signals, -slack)) if slack else 0.0
    dark = _darkest(signals)
    standing = float(np.sum(signals.reference > dark + STANDS_OUT)) / signals.frames
    light = np.mean(signals.reference, axis=(1, 2)) - dark[:, 0, 0]
    extras: dict[str, object] = {
        "stands_out": STANDS_OUT,
        "nothing": NOTHING,
        "pixels": standing,
        "share": value / standing if standing else None,
        "coverage_error": None,
        "coverage_bias": None,
    }
    if np.all(light > 0.0):
        relative = np.mean(signals.error, axis=(2, 3)) / light
        extras |= {"coverage_error": rms(relative), "coverage_bias": float(np.mean(relative))}
    return settle(value, extras, floor=floor)


def _darkest(signals: Signals) -> FloatArray:
    return signals.once("darkest pixels", lambda: np.min(signals.reference, axis=(1, 2), keepdims=True))


def _count(signals: Signals, slack: float) -> float:
    """Return the gaps in a frame if both thresholds were moved by `slack` so that there are more of them."""
    dark = _darkest(signals)
    missing = signals.test < dark + (NOTHING + slack)
    missing &= signals.reference > dark + (STANDS_OUT - slack)
    return float(np.sum(missing)) / (signals.seeds * signals.frames)
