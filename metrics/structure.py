"""Noise against structure: what changes with the seed, and what stays.

Both are estimated without bias from the same renderings, and their squares add up to the mean square error exactly.
After Durand 2011, Subr and Kautz 2013.
"""

import numpy as np
from scipy import ndimage

from aliasbench.metrics.gate import Signals
from aliasbench.metrics.score import Score, rms, settle, signed_root
from aliasbench.scenes.model import FloatArray

# Below this mean square error there is nothing to split.
NOTHING = 1e-24
BLUR_SIGMA_PX = 1.0


def blue_ratio(noise: FloatArray) -> float | None:
    """Return how much of the noise (..., h, w) survives a blur of 1 pixel, white noise being 1 and blue noise less."""
    total = float(np.square(rms(noise)))
    if not total > NOTHING:
        return None
    sigma = [0.0] * (noise.ndim - 2) + [BLUR_SIGMA_PX] * 2
    impulse = np.zeros(33)
    impulse[16] = 1.0
    kernel = ndimage.gaussian_filter1d(impulse, BLUR_SIGMA_PX)
    white = float(np.sum(kernel**2)) ** 2
    blurred = ndimage.gaussian_filter(noise, sigma, mode="wrap")
    return float(np.square(rms(blurred) / rms(noise))) / white


def compute_noise(signals: Signals) -> Score:
    """Return the RMS over pixels of the standard deviation between seeds (n - 1 in the denominator).

    Extras: the blue ratio (1 white, less is better), and on static scenes the correlation of one frame's noise with the
    next's: 1 where every frame has the same seeds, 0 where each has its own.
    """
    deviation = signals.error - np.mean(signals.error, axis=0)
    value = rms(deviation) * float(np.sqrt(signals.seeds / (signals.seeds - 1)))
    extras: dict[str, object] = {
        "seeds": signals.seeds,
        "deterministic": value == 0.0,
        "blue_ratio": blue_ratio(deviation),
    }
    if signals.frames > 1 and signals.scene.is_static and value > 0.0:
        unit = deviation / rms(deviation)
        extras["frame_correlation"] = float(np.mean(unit * np.roll(unit, -1, axis=1)))
    return settle(value, extras, floor=0.0)


def compute_structure(signals: Signals) -> Score:
    """Return the RMS of the error that all seeds share, with the sign of its unbiased square.

    str^2 = mean (mean error^2 - s^2 / seeds); extras: F_str = str^2 / mean square error (1 deterministic, 0
    unbiased and random, None without error).
    """
    scale = float(np.max(np.abs(signals.error)))
    if scale == 0.0:
        return settle(0.0, {"square": 0.0, "fraction": None}, floor=signals.floor)
    error = signals.error / scale
    mean = np.mean(error, axis=0)
    variance = np.var(error, axis=0, ddof=1)
    square = float(np.mean(mean**2 - variance / signals.seeds))
    mse = float(np.mean(error**2))
    fraction = square / mse if mse * float(np.square(scale)) >= NOTHING else None
    extras = {"square": square * float(np.square(scale)), "fraction": fraction, "seeds": signals.seeds}
    return settle(scale * signed_root(square), extras, floor=signals.floor)
