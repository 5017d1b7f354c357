"""General error: how far the picture is from the truth, whatever the artifact.

All of it is on luminance in units of the contrast that the scene declares, never on a contrast measured from pixels: a
flat picture then has ordinary scores, and scores do not change with exposure.
"""

import math

import numpy as np

from aliasbench.metrics.gate import Signals, each_frame
from aliasbench.metrics.score import Score, rms, settle
from aliasbench.scenes.model import FloatArray

# Keeps relative errors finite in the dark: a tenth of the contrast, squared.
RELATIVE_FLOOR = 0.1
KEY_FRAMES = 3
SAMPLE_STRIDE = 61  # shares no factor with usual widths
SSIM_SIGMA = 1.5


def compute_rmse(signals: Signals) -> Score:
    """Return the root mean square of the luminance error; extras hold the three channels' own, and each seed's."""

    def squares(frame: int) -> FloatArray:
        difference = signals.test_rgb[:, frame] - signals.reference_rgb[frame].astype(np.float64, copy=False)
        return np.array([rms(difference[..., channel]) for channel in range(3)]) / signals.scene.contrast

    channels = np.stack(each_frame(squares, signals.frames))
    extras: dict[str, object] = {"rgb": [rms(channels[:, channel]) for channel in range(3)]}
    if signals.seeds > 1:
        extras["by_seed"] = [rms(error) for error in signals.error]
    return settle(rms(signals.error), extras, floor=signals.floor)


def compute_psnr(signals: Signals) -> Score:
    """Return -20 log10(RMSE) in dB with the contrast as peak; None with status `identical` without error."""
    error = rms(signals.error)
    if error == 0.0 and signals.floor == 0.0:
        return Score(None, "identical", {"rmse": 0.0})
    if error < signals.floor:
        return Score(None, "below_reference_floor", {"floor": signals.floor, "measured_rmse": error})
    return Score(-20.0 * math.log10(error), "ok", {"rmse": error})


def compute_relmse(signals: Signals) -> Score:
    """Return the mean of (T - R)^2 / (R^2 + 0.01 contrast^2)."""

    def relative(frame: int) -> tuple[float, float]:
        inverse = 1.0 / np.hypot(signals.reference[frame], RELATIVE_FLOOR)
        return rms(signals.error[:, frame] * inverse), rms(inverse)

    value, floor = (np.square(rms(each)) for each in np.array(each_frame(relative, signals.frames)).T)
    return settle(float(value), {"epsilon": RELATIVE_FLOOR**2}, floor=float(floor) * signals.floor * signals.floor)


def compute_max_error(signals: Signals) -> Score:
    """Return the largest absolute error; extras: where, and the 99.9th percentile."""
    size = np.abs(signals.error)
    seed, frame, row, column = np.unravel_index(int(np.argmax(size)), size.shape)
    extras = {
        "p99_9": high_percentile(size.ravel(), 99.9),
        "seed": int(seed),
        "frame": int(frame) + signals.frame_start,
        "row": int(row) + signals.crop,
        "column": int(column) + signals.crop,
    }
    return settle(float(size[seed, frame, row, column]), extras, floor=signals.floor)


def high_percentile(values: FloatArray, percent: float) -> float:
    """Return np.percentile of (n,) values for a high percentage, sorting only those that a sample says may matter."""
    rank = (values.size - 1) * percent / 100.0
    guess = np.percentile(values[::SAMPLE_STRIDE], percent - (100.0 - percent))
    upper = values[values >= guess]
    below = values.size - upper.size
    if below > rank:  # the sample was no good
        return float(np.percentile(values, percent))
    place = min((rank - below) / max(upper.size - 1, 1), 1.0)
    return float(np.percentile(upper, 100.0 * place))


def key_frames(frames: int) -> list[int]:
    """Return the first, middle and last of so many frames, ascending, each once: what costly metrics look at."""
    return sorted({round(k * (frames - 1) / (KEY_FRAMES - 1)) for k in range(KEY_FRAMES)})


def compute_ssim(signals: Signals) -> Score:
    """Return the mean structural similarity of the first, middle and last frame (1 is identical).

    Gaussian window of sigma 1.5 over 11 x 11 pixels, population covariance, `data_range` the contrast. The mean leaves
    out a border of half a window; in pictures below 11 pixels, whose windows are filled by reflection, one of 3 pixels.
    It takes 40 ms for 512 x 512, hence key frames. Negative pixels (lobes of a filter) are set to 0 in the copies it
    sees, and counted. Wang, Bovik, Sheikh, Simoncelli 2004.
    """
    from skimage.metrics import structural_similarity

    height, width = signals.error.shape[-2:]
    side = min(height, width)
    if side < 7:
        return Score(None, "undefined_too_small", {"size": [width, height], "smallest": 7})
    keys = key_frames(signals.frames)
    values = []
    negative = 0
    for frame in keys:
        truth = signals.reference[frame]
        for seed in range(signals.seeds):
            picture = signals.test[seed, frame]
            negative += int(np.sum(picture < 0.0))
            values.append(
                structural_similarity(
                    np.maximum(picture, 0.0),
                    np.maximum(truth, 0.0),
                    data_range=1.0,
                    gaussian_weights=True,
                    sigma=SSIM_SIGMA,
                    use_sample_covariance=False,
                    win_size=11 if side >= 11 else 7,
                )
            )
    extras = {
        "frames": [k + signals.frame_start for k in keys],
        "negative_pixels": negative,
        "lowest": float(np.min(values)),
        "data_range": signals.scene.contrast,
        "sigma_px": SSIM_SIGMA,
    }
    error = rms(signals.error)
    if error < signals.floor:
        # Not `floor`, which is in the metric's own unit.
        return Score(None, "below_reference_floor", {**extras, "rmse_floor": signals.floor, "measured_rmse": error})
    return Score(float(np.mean(values)), "ok", extras)
