"""Moire of chirps: false lines that are only somewhere in the picture, found block by block.

A zone plate or a floor that recedes has no single false frequency, and its line drowns in the picture's spectrum. In
Hann-windowed blocks of 32 x 32 pixels, 16 apart, it is nearly a line again. The largest of very many bins is large
under noise too; what noise alone would do is told beside it.

Bins of white noise. With weights w of a block, X = sum w E e^(..) / sum w of noise of RMS s has mean square
s^2 sum w^2 / (sum w)^2 = s^2 (3 / 64)^2 and is complex normal, so that in units of it a bin's power is exponential.
Neighbours are correlated by the window (2/3, 1/6 along each axis). The largest power of a block's 98 bins is on average
that of 68 independent ones, H_68 = 4.80 (measured by simulation, as no closed form is known; tests repeat it). For high
quantiles no such figure is needed: centred normal variables in symmetric convex sets are positively correlated (Royen
2014), so the largest of n correlated powers exceeds a level at most as often as that of n independent ones does, all
blocks and frames together. A block's mean is taken off first, which only makes powers smaller.
"""

import math

import numpy as np
from scipy import fft

from aliasbench.metrics.gate import Signals, each_frame
from aliasbench.metrics.spectrum import HIGHEST_VISIBLE, visible_band
from aliasbench.scenes.model import FloatArray

SIDE, STEP = 32, 16
# Of a sequence with more blocks some pictures are looked at, evenly spaced, and those with most in the band.
MOST_BLOCKS = 8192
STRIP_PIXELS = 2**16  # at a time, to be in the processor's cache
BINS, EFFECTIVE_BINS = 98, 68
CONFIDENCE = 0.99
# Of a variance found as the median of a block's bins outside the band: it varies as one from so many values does
# (relative variance 2 / 140, by simulation).
MEDIAN_FREEDOM = 140.0

# Coordinates from the block's middle: the window is even, and its transform at k = 0, 1 is real, 16 and 8.
_U = np.arange(SIDE) - (SIDE - 1) / 2
HANN = np.cos(np.pi * _U / SIDE) ** 2
ORDERS = int(HIGHEST_VISIBLE * SIDE) + 1
_K = np.arange(ORDERS)
_ANGLE = 2.0 * np.pi * _U[:, None] * _K / SIDE
# Columns cos k u for k = 0..8, then sin k u for k = 1..8.
BASIS = HANN[:, None] * np.concatenate([np.cos(_ANGLE), np.sin(_ANGLE[:, 1:])], axis=1)
BAND = (_K[:, None] ** 2 + _K**2 <= (ORDERS - 1) ** 2) & (_K[:, None] + _K > 0)
NOISE_GAIN = 2.0 * 3.0 / 64.0


def peaks_of(picture: FloatArray) -> FloatArray:
    """Return the amplitude of the strongest line in the visible band of each block (rows, columns) of a picture."""
    rows = max(1, STRIP_PIXELS // (STEP * picture.shape[1]))
    starts = range(0, picture.shape[0] // STEP - 1, rows)
    return np.concatenate([_peaks_of_strip(picture[k * STEP : (k + rows + 1) * STEP]) for k in starts])


def _peaks_of_strip(picture: FloatArray) -> FloatArray:
    """Return the same of a few rows of blocks.

    They are cut into tiles of half a block, each transformed as a block's first and as its second half.
    """
    rows, columns = (side // STEP for side in picture.shape)
    tiles = picture[: rows * STEP, : columns * STEP]
    scale = max(float(np.max(tiles)), -float(np.min(tiles)))
    if 1e-100 < scale < 1e100:
        scale = 1.0  # squares stay within range, and the copy is spared
    elif scale > 0.0:
        tiles = tiles / scale
    halves, orders = np.concatenate([BASIS[:STEP], BASIS[STEP:]], axis=1), BASIS.shape[1]
    # Tiles of 4 rows of pixels, and 256 columns of orders: larger products would start threads of their own.
    along = (tiles.reshape(rows * 4, -1, STEP) @ halves).reshape(-1, columns, 2 * orders)
    along = (along[:, :-1, :orders] + along[:, 1:, orders:]).reshape(rows, STEP, -1)
    down = np.empty((rows, 2 * orders, along.shape[2]))
    for start in range(0, along.shape[2], 256):
        np.matmul(halves.T, along[:, :, start : start + 256], out=down[:, :, start : start + 256])
    both = (down[:-1, :orders] + down[1:, orders:]).reshape(rows - 1, orders, columns - 1, orders)
    # (order down, order along, block's row, block's column), of cosines (c) and sines (s)
    both = np.ascontiguousarray(both.transpose(1, 3, 0, 2))
    cc, cs, sc, ss = both[:ORDERS, :ORDERS], both[:ORDERS, ORDERS:], both[ORDERS:, :ORDERS], both[ORDERS:, ORDERS:]
    own = (tiles.reshape(-1, STEP) @ np.ones(STEP)).reshape(rows, STEP, columns).sum(axis=1)
    mean = (own[:-1, :-1] + own[:-1, 1:] + own[1:, :-1] + own[1:, 1:]) / SIDE**2
    for ky, kx in ((0, 1), (1, 0), (1, 1)):
        cc[ky, kx] -= mean * (STEP * 0.5**ky) * (STEP * 0.5**kx)
    # X(kx, +-ky) = (cc -+ ss) - i (cs +- sc): the larger of the two powers is their mean plus half their difference.
    power = cc**2
    power[:, 1:] += cs**2
    power[1:] += sc**2
    power[1:, 1:] += ss**2 + 2.0 * np.abs(sc[:, 1:] * cs[1:] - cc[1:, 1:] * ss)
    largest = np.max(power[BAND], axis=0)
    out: FloatArray = 2.0 * scale * np.sqrt(largest) / np.sum(HANN) ** 2
    return out


def block_powers(block: FloatArray) -> FloatArray:
    """Return |X|^2 of the bins of `rfft2` of one block, or several (..., 32, 32)."""
    centered = block - np.mean(block, axis=(-2, -1), keepdims=True)
    out: FloatArray = np.abs(fft.rfft2(centered * (HANN[:, None] * HANN))) ** 2 / np.sum(HANN) ** 4
    return out


def noise_in_block(blocks: FloatArray) -> tuple[float, float]:
    """Return the RMS of white noise in a block (seeds, 32, 32) and the degrees of freedom of its square's estimate.

    With several seeds it is their variance, weighted as the transform weights it. With one it comes from the bins
    outside the band: their median over ln 2 is the mean of exponential powers, and does not see a few lines.
    """
    if len(blocks) > 1:
        weight = (HANN[:, None] * HANN) ** 2
        variance = float(np.sum(weight * np.var(blocks, axis=0, ddof=1)) / np.sum(weight))
        return math.sqrt(variance), (len(blocks) - 1) * float(np.sum(weight) ** 2 / np.sum(weight**2))
    fy, fx = fft.fftfreq(SIDE)[:, None], fft.rfftfreq(SIDE)
    # A line in the band leaks one bin out of it.
    outside = np.hypot(fy, fx) > HIGHEST_VISIBLE + 1.0 / SIDE
    square = float(np.median(block_powers(blocks[0])[outside])) / math.log(2.0)
    return 2.0 * math.sqrt(square) / NOISE_GAIN, MEDIAN_FREEDOM


def mean_noise_peak() -> float:
    """Return the mean of a block's peak under white noise of RMS 1: that of 68 independent exponential powers."""
    x = np.linspace(0.0, 8.0, 1601)
    return NOISE_GAIN * float(np.trapezoid(1.0 - (1.0 - np.exp(-(x**2))) ** EFFECTIVE_BINS, x))


def high_noise_peak(blocks: int) -> float:
    """Return what the largest peak of so many blocks of white noise of RMS 1 is below, at least 99 times in 100."""
    each = -math.expm1(math.log(CONFIDENCE) / (BINS * blocks))
    return NOISE_GAIN * math.sqrt(-math.log(each))


def peak_p_value(peak: float, noise: float, freedom: float, blocks: int) -> float:
    """Return a bound of the probability that a block of white noise, of that many, has a peak so high.

    A power over an independent estimate of its mean with `freedom` degrees of freedom has Fisher's F(2, freedom)
    distribution: P(F > f) = (1 + 2 f / freedom)^(-freedom / 2). The bound sums over the bins of all blocks.
    """
    if peak == 0.0:
        return 1.0
    if noise * 1e12 < peak:
        return 0.0
    f = (peak / (NOISE_GAIN * noise)) ** 2
    return min(1.0, BINS * blocks * math.exp(-freedom / 2.0 * math.log1p(2.0 * f / freedom)))


def chosen_pictures(band_power: FloatArray, blocks: int) -> list[tuple[int, int]]:
    """Return which pictures (seed, frame) are looked at, given the power (seeds, frames) in each one's band.

    `blocks` is how many one picture has. All, or as many as there is time for, evenly spaced, and the strongest.
    """
    count = band_power.size
    most = max(1, MOST_BLOCKS // blocks)
    chosen = set(range(count))
    if count > most:
        chosen = {round(k) for k in np.linspace(0, count - 1, most)} | {int(np.argmax(band_power))}
    frames = band_power.shape[1]
    return [(k // frames, k % frames) for k in sorted(chosen)]


def describe_blocks(signals: Signals, band_power: FloatArray) -> dict[str, object]:
    """Return figures of the error's blocks: the largest peak and where it is, the mean one, and those of noise alone.

    Parameters
    ----------
    signals : Signals
    band_power : (seeds, frames) float64
        In each picture's visible band.

    Returns
    -------
    dict
        `block_peak_max`, `block_peak_mean` : in contrast, over the `blocks` that were looked at; None if the picture is
        smaller than a block. Of the largest: `block_center_px` (x, y in the picture), `block_frame`, `block_seed`,
        `block_cycles_per_px`; `block_noise`, the RMS of the white noise found there; `block_noise_peak_mean` and
        `block_noise_peak_99`, what such noise alone would have as one block's mean peak, and what it would keep the
        largest of all these blocks below with 99 % confidence; `block_p_value`, a bound.
    """
    height, width = signals.error.shape[-2:]
    if min(height, width) < SIDE:
        return {"block_peak_max": None, "block_peak_mean": None}
    pictures = chosen_pictures(band_power, (height // STEP - 1) * (width // STEP - 1))
    peaks = np.stack(each_frame(lambda k: peaks_of(signals.error[pictures[k]]), len(pictures)))
    index, i, j = (int(k) for k in np.unravel_index(int(np.argmax(peaks)), peaks.shape))
    peak, (seed, frame), row, column = float(peaks[index, i, j]), pictures[index], i * STEP, j * STEP
    found: dict[str, object] = {
        "block_peak_max": peak,
        "block_peak_mean": float(np.mean(peaks)),
        "blocks": peaks.size,
        "block_frame": frame + signals.frame_start,
        "block_seed": seed,
        "block_center_px": [column + SIDE // 2 + signals.crop, row + SIDE // 2 + signals.crop],
    }
    # What was summed may overflow; there is no noise to compare it with.
    if not (math.isfinite(peak) and peak > 0.0):
        return found
    blocks = signals.error[:, frame, row : row + SIDE, column : column + SIDE] / peak
    band = visible_band(SIDE, SIDE)
    strongest = int(np.argmax(block_powers(blocks[seed])[band.rows, band.columns]))
    noise, freedom = noise_in_block(blocks)
    return found | {
        "block_cycles_per_px": [float(nu) for nu in band.nu[strongest]],
        "block_noise": noise * peak,
        "block_noise_peak_mean": noise * peak * mean_noise_peak(),
        "block_noise_peak_99": noise * peak * high_noise_peak(peaks.size),
        "block_p_value": peak_p_value(1.0, noise, freedom, peaks.size),
    }
