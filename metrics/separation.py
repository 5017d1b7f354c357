"""Errors in space told from errors in time, and what a longer shutter would change, of a scene that moves.

Four sequences do it: the technique T and its exact reference R_s under the scene's shutter, and both at the instant in
the shutter's middle, T_c and R_0, where no time is sampled. What is wrong there is wrong in space,

    spatial = RMS(T_c - R_0),    temporal = MSE(T - R_s) - spatial^2,

and the rest is what sampling the open shutter adds, or takes away where blur hides errors in space: `temporal` is
signed. A fifth, R_1, exact with a shutter that never closes, says how far the scene's own shutter is from one:
`shutter` = RMS(R_s - R_1), which is no error of a technique.
"""

from collections.abc import Iterable, Iterator

import numpy as np

from aliasbench.metrics.gate import Centers, Signals, luminance
from aliasbench.metrics.score import Score, rms, settle, signed_root
from aliasbench.scenes.model import FloatArray


def _given(signals: Signals) -> Centers:
    assert isinstance(signals.centers, Centers), "metrics that need centers are asked only where they are given"
    return signals.centers


def _rms_of_all(pictures: Iterable[FloatArray]) -> float:
    """Return the RMS of pictures of one size, which are made one at a time to spare copies of sequences."""
    return rms(np.array([rms(picture) for picture in pictures]))


def _errors(signals: Signals) -> Iterator[FloatArray]:
    """Yield T - R_s of every frame and seed, (h, w), in units of the contrast."""
    for frame in range(signals.frames):
        yield from signals.error[:, frame]


def _center_errors(signals: Signals) -> Iterator[FloatArray]:
    """Yield T_c - R_0 of every frame and seed, in the same order and units."""
    centers, contrast = _given(signals), signals.scene.contrast
    for frame, reference in enumerate(centers.reference):
        truth = luminance(reference) / contrast
        for test in centers.test[:, frame]:
            yield luminance(test) / contrast - truth


def measure_total(signals: Signals) -> float:
    """Return RMS(T - R_s)."""
    return signals.once("error by frames", lambda: _rms_of_all(_errors(signals)))


def measure_spatial(signals: Signals) -> float:
    """Return RMS(T_c - R_0), to the bit RMS(T - R_s) where the four are two."""
    if signals.is_instant:
        return measure_total(signals)
    return signals.once("error in space", lambda: _rms_of_all(_center_errors(signals)))


def _center_uncertainty(signals: Signals) -> float:
    """Return the bound on a pixel of R_0, in units of the contrast."""
    own = _given(signals).reference_uncertainty / signals.scene.contrast
    return signals.uncertainty if signals.is_instant else own


def compute_spatial(signals: Signals) -> Score:
    """Return RMS(T_c - R_0): the error where all samples are taken at the shutter's middle, as the truth is."""
    extras = {"instant": signals.is_instant}
    return settle(measure_spatial(signals), extras, floor=3.0 * _center_uncertainty(signals))


def compute_temporal(signals: Signals) -> Score:
    """Return MSE(T - R_s) - spatial^2, signed, in units of the contrast squared; extras: its root with the sign.

    Where the shutter is not open nothing is sampled in time, and it is 0.
    """
    spatial, total = measure_spatial(signals), measure_total(signals)
    value = float(np.square(total) - np.square(spatial))
    # A reference that is off by u everywhere moves an RMS r to r +- u at most, and its square by (2 r + u) u.
    known = ((total, signals.uncertainty), (spatial, _center_uncertainty(signals)))
    doubt = sum((2.0 * r + u) * u for r, u in known)
    extras = {"rmse": total, "spatial": spatial, "root": signed_root(value), "instant": signals.is_instant}
    return settle(value, extras, floor=0.0 if signals.is_instant else 3.0 * doubt)


def compute_shutter(signals: Signals) -> Score:
    """Return RMS(R_s - R_1): what a shutter that never closes would change in the truth; extras: frames compared."""
    centers = _given(signals)
    if centers.full_shutter is None:
        return Score(None, "not_applicable", {"missing": "full_shutter"})
    contrast, count = signals.scene.contrast, len(centers.full_shutter)
    value = _rms_of_all(
        own - luminance(full) / contrast for own, full in zip(signals.reference, centers.full_shutter, strict=False)
    )
    floor = signals.floor + 3.0 * centers.full_shutter_uncertainty / contrast
    return settle(value, {"frames": count}, floor=floor)
