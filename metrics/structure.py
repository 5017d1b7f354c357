"""Noise against structure: what changes with the seed, and what stays; and of what stays, what moves.

All are estimated without bias from the same renderings, and their squares add up to the mean square error exactly:
mean E^2 = static + moving + noise. After Durand 2011, Subr and Kautz 2013.
"""

from dataclasses import dataclass

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
    # From the first seed, because the mean of equal numbers is not always that number.
    deviation = signals.error - signals.error[0]
    deviation -= np.mean(deviation, axis=0)
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


@dataclass(frozen=True, slots=True)
class Split:
    """The mean square error's parts, in units of the contrast squared; the estimates are signed.

    Attributes
    ----------
    scale : float
        The largest error: the squares are of errors divided by it, so that they neither overflow nor vanish.
    mse, static, moving, noise : float
        mse = static + moving + noise, to rounding.
    """

    scale: float
    mse: float
    static: float
    moving: float
    noise: float

    def square(self, part: float) -> float:
        """Return a part in units of the contrast squared."""
        return part * float(np.square(self.scale))

    def root(self, part: float) -> float:
        """Return a part's root in units of the contrast, with its sign."""
        return self.scale * signed_root(part)


def split_error(signals: Signals) -> Split:
    """Return what the error of two or more seeds is made of: static structure, moving structure and noise.

    With e(t) what all seeds share, the structure's square is the mean of e(t)^2 over frames, the static one that of
    (mean over t of e)^2, and the moving one their difference, the variance of e in time. Products of different seeds
    have the expectation of products of e, however the noise of one seed's frames is correlated: all of a seed's frames
    may have the same pattern of samples. The mean over pairs of seeds of x_a x_b is

        sum_{a != b} x_a x_b / (S (S - 1)) = (mean x)^2 - s^2 / S,

    s^2 the variance between seeds (S - 1 in the denominator): for x = E(t) and for x = the mean of E over frames.
    """
    return signals.once("split of the error", lambda: _split(signals))


def _split(signals: Signals) -> Split:
    scale = max(float(np.max(signals.error)), -float(np.min(signals.error)))
    if scale == 0.0:
        return Split(0.0, 0.0, 0.0, 0.0, 0.0)
    frames = signals.frames
    structure = noise = mse = 0.0
    total = np.zeros(signals.error.shape[:1] + signals.error.shape[2:])
    for frame in range(frames):
        error = signals.error[:, frame] / scale
        total += error
        pair, own = _pair_product(error)
        structure, noise, mse = structure + pair, noise + own, mse + float(np.mean(error**2))
    static = _pair_product(total / frames)[0] if frames > 1 else structure
    structure, noise, mse = structure / frames, noise / frames, mse / frames
    return Split(scale, mse, static, structure - static, noise)


def _pair_product(values: FloatArray) -> tuple[float, float]:
    """Return the mean product of different seeds' values (seeds, h, w), and the mean variance between seeds."""
    seeds = values.shape[0]
    mean = np.mean(values, axis=0)
    variance = float(np.mean((values - mean) ** 2)) * seeds / (seeds - 1)
    return float(np.mean(mean**2)) - variance / seeds, variance


def compute_structure(signals: Signals) -> Score:
    """Return the RMS of the error that all seeds share, with the sign of its unbiased square.

    str^2 = mean (mean error^2 - s^2 / seeds); extras: F_str = str^2 / mean square error (1 deterministic, 0
    unbiased and random, None without error), and the full split of the mean square error (see `split_error`):
    `static_square` + `moving_square` + `noise_square`, with the signed roots `static` and `moving` (None of one frame).
    """
    split = split_error(signals)
    square = split.static + split.moving
    extras: dict[str, object] = {
        "square": split.square(square),
        "fraction": square / split.mse if split.square(split.mse) >= NOTHING else None,
        "seeds": signals.seeds,
        "static_square": split.square(split.static),
        "moving_square": split.square(split.moving),
        "noise_square": split.square(split.noise),
        "static": split.root(split.static),
        "moving": split.root(split.moving) if signals.frames > 1 else None,
    }
    return settle(split.root(square), extras, floor=signals.floor)
