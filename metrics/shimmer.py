"""Shimmer: error that changes from frame to frame, which the eye sees as buzzing and crawling.

The reference moves as the truth does, so the error needs no motion compensation: its variance in time is the shimmer,
its mean in time is static error, and the two squares add up to the mean square error exactly. `shimmer_abs` and
`flux_flicker` look at the picture alone, to rank filters and shutters whose exact renderings all have error zero.
"""

import math

import numpy as np

from aliasbench.metrics.gate import Signals, each_frame
from aliasbench.metrics.score import Score, rms, settle
from aliasbench.metrics.sharpness import sharpness
from aliasbench.metrics.spectrum import band_spectrum
from aliasbench.metrics.structure import split_error
from aliasbench.metrics.visibility import CSF, PIXELS_PER_DEGREE, visible_shimmer
from aliasbench.scenes.model import FloatArray, PanFact
from aliasbench.scenes.projection import view_at

# Below this there is no shimmer whose character could be described.
NO_SHIMMER = 1e-12
WHOLE_LOOP = 1e-9
CHUNK, COLUMNS = 16384, 64  # pixels at a time, and in one product


def shimmer_and_static(signals: Signals) -> tuple[float, float]:
    """Return SH_err and the RMS of the error's mean in time."""
    return signals.once("shimmer", lambda: _shimmer_and_static(signals.error))


def _shimmer_and_static(error: FloatArray) -> tuple[float, float]:
    mean = np.mean(error, axis=1)
    changing = each_frame(lambda frame: rms(error[:, frame] - mean), error.shape[1])
    return rms(np.array(changing)), rms(mean)


def compute_shimmer(signals: Signals) -> Score:
    """Return SH_err = sqrt(mean over pixels of the variance in time of the error); extras: the static rest.

    Of two or more seeds also what of it is no noise, `structured`: SH_err^2 = structured^2 + `noise_square`, the second
    being the noise's variance in time (none where all frames have the same pattern of samples). The first is signed.
    `visible` is what of it the eye would see (see `visibility.visible_shimmer`) at `ppd` pixels per degree and `fps`
    frames per second: a secondary figure, which no ranking should rest on.
    """
    shimmer, static = shimmer_and_static(signals)
    fps = signals.scene.animation.fps
    extras: dict[str, object] = {
        "static": static,
        "rmse": rms(signals.error),
        "visible": visible_shimmer(band_spectrum(signals), fps),
        "ppd": PIXELS_PER_DEGREE,
        "fps": fps,
        "csf": CSF,
    }
    if signals.seeds > 1:
        split = split_error(signals)
        extras["structured"] = split.root(split.moving)
        extras["noise_square"] = float(np.square(shimmer)) - split.square(split.moving)
    return settle(shimmer, extras, floor=signals.floor)


def compute_buzz(signals: Signals) -> Score:
    """Return mean (E[t+1] - E[t])^2 / (2 SH_err^2), around the loop: 0 crawls slowly, 1 is white, 2 alternates."""
    shimmer, _ = shimmer_and_static(signals)
    if shimmer < NO_SHIMMER:
        return Score(None, "undefined_no_shimmer", {"shimmer": shimmer})
    if shimmer < signals.floor:
        return Score(None, "below_reference_floor", {"floor": signals.floor, "measured_shimmer": shimmer})
    error = signals.error
    steps = each_frame(lambda frame: rms(error[:, frame] - error[:, frame - 1]), signals.frames)
    return Score((rms(np.array(steps)) / shimmer) ** 2 / 2.0, "ok", {"shimmer": shimmer})


def pan_px_per_frame(pan: PanFact, signals: Signals) -> tuple[float, float]:
    """Return how far the picture moves from one frame to the next at the camera's target, in pixels (x, y)."""
    camera, animation = signals.scene.camera, signals.scene.animation
    view = view_at(camera, animation, signals.frame_start, 0.0, signals.size)
    drift = camera.velocity if camera.target_velocity is None else camera.target_velocity
    start = np.asarray(camera.target) + np.asarray(drift) * (signals.frame_start / animation.fps)
    moved = view.project(np.stack([start, start + np.asarray(pan.velocity) / animation.fps]))
    return float(moved[1, 0] - moved[0, 0]), float(moved[1, 1] - moved[0, 1])


def flicker_filter(frames: int, highest: float, windowed: bool) -> FloatArray | None:
    """Return the matrix (m, frames) whose products with a pixel's values have the power beyond a temporal frequency.

    The sum of their squares over `frames` is the sum of |F|^2 over the bins above `highest` cycles a frame of the
    transform F over the number of frames; None if there are no such bins. The rows are an orthonormal basis of sines
    and cosines of the bins beyond, so that of a pixel without them nothing is left but rounding of its own size.
    Under a Hann window the mean leaves first: it would leak from frequency 0 into its neighbours.
    """
    bins = np.arange(1, frames // 2 + 1)
    beyond = bins[bins > highest * frames * (1.0 + 1e-9)]
    if not beyond.size:
        return None
    angle = 2.0 * np.pi / frames * np.mod(beyond[:, None] * np.arange(frames), frames)
    middle = 2 * beyond == frames
    # the highest of an even number has no sine
    rows = np.concatenate(
        [np.cos(angle) * np.where(middle, 1.0, np.sqrt(2.0))[:, None], np.sqrt(2.0) * np.sin(angle)[~middle]]
    )
    rows /= np.sqrt(frames)
    if windowed:
        window = np.sin(np.pi * (np.arange(frames) + 0.5) / frames) ** 2
        rows = rows * (window / np.sqrt(np.mean(window**2)))
        rows -= np.mean(rows, axis=1, keepdims=True)
    out: FloatArray = rows
    return out


def compute_shimmer_abs(signals: Signals) -> Score:
    """Return SH_abs: the RMS of all that flickers faster than anything a pan of a band-limited picture could show.

    A picture without frequencies beyond half a cycle per pixel, moved by (a, b) pixels a frame, has no temporal
    frequency above (|a| + |b|) / 2 cycles a frame. What lies beyond was a scene frequency above Nyquist that folded.
    Counting bins of the transform in time at every pixel equals, by Parseval, the sum over both axes of the transform
    in time and space, and does not need the picture to be periodic. Of several pans the fastest counts.
    """
    animation = signals.scene.animation
    pans = signals.scene.facts.pans
    motions = [pan_px_per_frame(pan, signals) for pan in pans]
    motion = max(motions, key=lambda m: abs(m[0]) + abs(m[1]))
    highest = (abs(motion[0]) + abs(motion[1])) / 2.0
    loops = [signals.frames / (animation.fps * pan.period) for pan in pans]
    whole = all(round(n) >= 1 and abs(n - round(n)) < WHOLE_LOOP * max(1.0, n) for n in loops)
    extras = {"px_per_frame": motion, "highest_cycles_per_frame": highest, "loops": min(loops)}
    if highest == 0.0:
        return Score(None, "not_applicable", {**extras, "missing": "a pan that moves the picture"})
    rows = flicker_filter(signals.frames, highest, not whole)
    if rows is None:
        return Score(None, "undefined_too_small", {**extras, "needs": "a pan of less than one pixel a frame"})
    pixels = signals.test.reshape(signals.seeds, signals.frames, -1)

    def flicker(part: int) -> float:
        own = pixels[:, :, part * CHUNK : (part + 1) * CHUNK]
        fits = own.shape[2] // COLUMNS * COLUMNS
        # (seed, group, frame, pixel): larger products would start threads of their own
        groups = own[:, :, :fits].reshape(*own.shape[:2], -1, COLUMNS).transpose(0, 2, 1, 3)
        parts = (each for each in (groups, own[:, :, fits:]) if each.size)
        return math.hypot(*(rms(rows @ each) * math.sqrt(each[..., 0, :].size) for each in parts))

    total = math.hypot(*each_frame(flicker, -(-pixels.shape[2] // CHUNK)))
    value = total * math.sqrt(len(rows) / signals.test.size)
    kept = {**sharpness(signals), "in_band": in_band_contrast(signals.test, value)}
    return Score(value, "ok" if whole else "windowed", {**extras, "sharpness": kept})


def in_band_contrast(sequence: FloatArray, beyond: float) -> float:
    """Return the RMS contrast about the mean of what a sequence holds besides the RMS `beyond` of what is folded."""
    size = rms(sequence)
    if size == 0.0:
        return 0.0
    # By Parseval, and scaled so that nothing overflows.
    share = 1.0 - (float(np.mean(sequence)) / size) ** 2 - (beyond / size) ** 2
    return size * float(np.sqrt(max(share, 0.0)))


def compute_flux_flicker(signals: Signals) -> Score:
    """Return the standard deviation in time of the picture's total light over its mean: a small object's flicker.

    Extras: the reference's own (`reference`), which is not 0 where light really comes and goes, as at the border.
    """
    flux = np.mean(signals.test, axis=(2, 3))
    mean = np.mean(flux, axis=1)
    if not np.all(mean > NO_SHIMMER):
        return Score(None, "undefined_zero_flux", {"mean": mean})
    relative = flux / mean[:, None] - 1.0
    return Score(rms(relative), "ok", {"mean": mean, "reference": _relative_deviation(signals.reference)})


def _relative_deviation(sequence: FloatArray) -> float | None:
    flux = np.mean(sequence, axis=(1, 2))
    mean = float(np.mean(flux))
    return rms(flux / mean - 1.0) if mean > NO_SHIMMER else None
