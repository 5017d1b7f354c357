"""Shimmer: error that changes from frame to frame, which the eye sees as buzzing and crawling.

The reference moves as the truth does, so the error needs no motion compensation: its variance in time is the shimmer,
its mean in time is static error, and the two squares add up to the mean square error exactly. `shimmer_abs` and
`flux_flicker` look at the picture alone, to rank filters and shutters whose exact renderings all have error zero.
"""

import numpy as np
from scipy import fft

from aliasbench.metrics.gate import Signals
from aliasbench.metrics.score import Score, rms, settle
from aliasbench.metrics.sharpness import sharpness
from aliasbench.scenes.model import FloatArray, PanFact
from aliasbench.scenes.projection import view_at

# Below this there is no shimmer whose character could be described.
NO_SHIMMER = 1e-12
WHOLE_LOOP = 1e-9


def compute_shimmer(signals: Signals) -> Score:
    """Return SH_err = sqrt(mean over pixels of the variance in time of the error); extras: the static rest."""
    mean = np.mean(signals.error, axis=1, keepdims=True)
    extras = {"static": rms(mean), "rmse": rms(signals.error)}
    return settle(rms(signals.error - mean), extras, floor=signals.floor)


def compute_buzz(signals: Signals) -> Score:
    """Return mean (E[t+1] - E[t])^2 / (2 SH_err^2), around the loop: 0 crawls slowly, 1 is white, 2 alternates."""
    mean = np.mean(signals.error, axis=1, keepdims=True)
    shimmer = rms(signals.error - mean)
    if shimmer < NO_SHIMMER:
        return Score(None, "undefined_no_shimmer", {"shimmer": shimmer})
    if shimmer < signals.floor:
        return Score(None, "below_reference_floor", {"floor": signals.floor, "measured_shimmer": shimmer})
    step = rms(np.roll(signals.error, -1, axis=1) - signals.error)
    return Score((step / shimmer) ** 2 / 2.0, "ok", {"shimmer": shimmer})


def pan_px_per_frame(pan: PanFact, signals: Signals) -> tuple[float, float]:
    """Return how far the picture moves from one frame to the next at the camera's target, in pixels (x, y)."""
    scene = signals.scene
    view = view_at(scene.camera, scene.animation, signals.frame_start, 0.0, signals.size)
    start = np.asarray(scene.camera.target, dtype=np.float64)
    end = start + np.asarray(pan.velocity) / scene.animation.fps
    moved = view.project(np.stack([start, end]))
    return float(moved[1, 0] - moved[0, 0]), float(moved[1, 1] - moved[0, 1])


def compute_shimmer_abs(signals: Signals) -> Score:
    """Return SH_abs: the RMS of all that flickers faster than anything a pan of a band-limited picture could show.

    A picture without frequencies beyond half a cycle per pixel, moved by (a, b) pixels a frame, has no temporal
    frequency above (|a| + |b|) / 2 cycles a frame. What lies beyond was a scene frequency above Nyquist that folded.
    Counting bins of the transform in time at every pixel equals, by Parseval, the sum over both axes of the transform
    in time and space, and does not need the picture to be periodic.
    """
    pan = signals.scene.facts.pans[0]
    motion = pan_px_per_frame(pan, signals)
    highest = (abs(motion[0]) + abs(motion[1])) / 2.0
    loops = signals.frames / (signals.scene.animation.fps * pan.period)
    whole = round(loops) >= 1 and abs(loops - round(loops)) < WHOLE_LOOP * max(1.0, loops)
    frequency = np.abs(fft.fftfreq(signals.frames))
    beyond = frequency > highest * (1.0 + 1e-9)
    extras = {"px_per_frame": motion, "highest_cycles_per_frame": highest, "loops": loops}
    if highest == 0.0:
        return Score(None, "not_applicable", {**extras, "missing": "a pan that moves the picture"})
    if not beyond.any():
        return Score(None, "undefined_too_small", {**extras, "needs": "a pan of less than one pixel a frame"})
    sequence = signals.test
    if not whole:
        # The mean leaves first: under a window it would leak from frequency 0 into its neighbours.
        window = np.sin(np.pi * (np.arange(signals.frames) + 0.5) / signals.frames) ** 2
        window /= np.sqrt(np.mean(window**2))
        sequence = (sequence - np.mean(sequence, axis=1, keepdims=True)) * window[:, None, None]
    spectrum = fft.fft(sequence, axis=1)[:, beyond] / signals.frames
    value = rms(np.abs(spectrum)) * np.sqrt(np.count_nonzero(beyond))
    kept = {**sharpness(signals), "in_band": in_band_contrast(signals.test, float(value))}
    return Score(float(value), "ok" if whole else "windowed", {**extras, "sharpness": kept})


def in_band_contrast(sequence: FloatArray, beyond: float) -> float:
    """Return the RMS contrast about the mean of what a sequence holds besides the RMS `beyond` of what is folded."""
    size = rms(sequence)
    if size == 0.0:
        return 0.0
    # By Parseval, and scaled so that nothing overflows.
    share = 1.0 - (float(np.mean(sequence)) / size) ** 2 - (beyond / size) ** 2
    return size * float(np.sqrt(max(share, 0.0)))


def compute_flux_flicker(signals: Signals) -> Score:
    """Return the standard deviation in time of the picture's total light over its mean: a small object's flicker."""
    flux = np.mean(signals.test, axis=(2, 3))
    mean = np.mean(flux, axis=1)
    if not np.all(mean > NO_SHIMMER):
        return Score(None, "undefined_zero_flux", {"mean": mean})
    relative = flux / mean[:, None] - 1.0
    return Score(rms(relative), "ok", {"mean": mean})
