"""Moire: false low frequencies, measured as what the error has in the visible band.

A regular detail that is sampled too coarsely comes back as a slow pattern. A beat between two real screens is in the
reference too and cancels in the error, so that only the false one counts.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from aliasbench.metrics.gate import Signals
from aliasbench.metrics.score import Score, rms, settle, signed_root
from aliasbench.scenes.model import FloatArray
from aliasbench.scenes.projection import view_at

# The band in which false patterns are visible as such, cycles per pixel.
HIGHEST_VISIBLE = 0.25
WHOLE_PERIODS = 1e-6
NOTHING = 1e-26
BLOCK, BLOCK_STEP = 32, 16

Spectrum = tuple[NDArray[np.complex128], tuple[int, int], NDArray[np.bool_], bool]


def visible_band(shape: tuple[int, int]) -> tuple[FloatArray, FloatArray, NDArray[np.bool_], FloatArray]:
    """Return the frequencies (h, 1) and (1, w') of a real transform, the band's bins and how often each counts.

    A bin between 0 and Nyquist of the last axis stands for its mirror image too and counts twice.
    """
    height, width = shape
    fy, fx = fft.fftfreq(height)[:, None], fft.rfftfreq(width)[None, :]
    size = np.hypot(fy, fx)
    band = (size > 0.0) & (size <= HIGHEST_VISIBLE * (1.0 + 1e-12))
    twice = np.where((fx == 0.0) | (fx == 0.5), 1.0, 2.0)
    return fy, fx, band, np.broadcast_to(twice, band.shape)


def known_frequencies(signals: Signals) -> list[tuple[float, float]]:
    """Return the gratings' frequencies in cycles per pixel (x, y); none where they vary over the picture."""
    scene = signals.scene
    if scene.camera.projection != "orthographic":
        return []
    view = view_at(scene.camera, scene.animation, signals.frame_start, 0.0, signals.size)
    units = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    points = view.project(units)[:, :2]
    pixels_per_unit = (points[1:] - points[0]).T
    if abs(np.linalg.det(pixels_per_unit)) < 1e-9 * float(np.sum(pixels_per_unit**2)):
        return []
    inverse = np.linalg.inv(pixels_per_unit)
    found = [np.asarray(g.cycles_per_unit) @ inverse for g in scene.facts.gratings]
    return [(float(nu[0]), float(nu[1])) for nu in found]


def whole_periods(side: int, cycles_per_px: list[float]) -> int | None:
    """Return the largest length, at least half of `side`, that holds whole periods of all; None if there is none."""
    for length in range(side, max(side // 2, 1) - 1, -1):
        cycles = np.array(cycles_per_px) * length
        if np.all(np.abs(cycles - np.round(cycles)) < WHOLE_PERIODS * np.maximum(1.0, np.abs(cycles))):
            return length
    return None


def prepare_spectrum(signals: Signals) -> Spectrum:
    """Return the error's spectrum (seeds, frames, h, w'), the size it was taken of, the band, and whether windowed.

    Where the scene declares gratings, the picture is trimmed to whole periods of them and their own lines are left out
    (an error there is a filter's amplitude, not a false pattern); where that cannot be done a Hann window is used.
    """
    return signals.once("spectrum of the error", lambda: _prepare(signals))


def _prepare(signals: Signals) -> Spectrum:
    height, width = signals.error.shape[-2:]
    known = known_frequencies(signals)
    trimmed = [whole_periods(side, [nu[axis] for nu in known]) for axis, side in ((1, height), (0, width))]
    h, w = (side if trim is None else trim for trim, side in zip(trimmed, (height, width), strict=True))
    error = signals.error[..., :h, :w]
    if None in trimmed:
        window = np.ones((h, w))
        for axis, trim in enumerate(trimmed):
            if trim is None:
                hann = np.sin(np.pi * (np.arange((h, w)[axis]) + 0.5) / (h, w)[axis]) ** 2
                hann /= np.sqrt(np.mean(hann**2))
                window = window * (hann[:, None] if axis == 0 else hann[None, :])
        error = (error - np.mean(error, axis=(2, 3), keepdims=True)) * window
    fy, fx, band, _ = visible_band((h, w))
    for nx, ny in known:
        lines = int(HIGHEST_VISIBLE / np.hypot(nx, ny)) if nx or ny else 0
        for k in range(1, lines + 1):
            for sign in (1.0, -1.0):
                band = band & ~((np.abs(fx - sign * k * nx) * w < 1.5) & (np.abs(fy - sign * k * ny) * h < 1.5))
    return fft.rfft2(error) / (h * w), (h, w), band, None in trimmed


def compute_moire(signals: Signals) -> Score:
    """Return M = sqrt(sum over the band of |E|^2), in contrast; quadratic mean over frames and seeds.

    Extras: with several seeds the part that they share, M_str^2 (unbiased, may be negative).
    """
    spectrum, shape, band, windowed = prepare_spectrum(signals)
    if not band.any():
        return Score(None, "undefined_too_small", {"size": [shape[1], shape[0]]})
    twice = visible_band(shape)[3][band]
    inside = spectrum[:, :, band] * np.sqrt(twice)
    value = rms(np.abs(inside)) * float(np.sqrt(inside.shape[-1]))
    extras: dict[str, object] = {
        "band_cycles_per_px": HIGHEST_VISIBLE,
        "bins": float(np.sum(twice)),
        "size": [shape[1], shape[0]],
    }
    if signals.seeds > 1:
        both = np.abs(np.sum(inside, axis=0)) ** 2 - np.sum(np.abs(inside) ** 2, axis=0)
        square = float(np.mean(np.sum(both, axis=-1))) / (signals.seeds * (signals.seeds - 1))
        extras |= {"structured_square": square, "structured": signed_root(square)}
    return settle(value, extras, floor=signals.floor, status="windowed" if windowed else "ok")


def compute_moire_peak(signals: Signals) -> Score:
    """Return P = 2 max over the band of |E|, the amplitude of the strongest false sinusoid; quadratic mean over frames.

    Extras: its frequency and period in the frame where it is strongest, Fisher's g (the share of the strongest line)
    with an upper bound of its p-value under white noise, and the peaks of 32 x 32 blocks for chirps.
    """
    spectrum, shape, band, windowed = prepare_spectrum(signals)
    if not band.any():
        return Score(None, "undefined_too_small", {"size": [shape[1], shape[0]]})
    fy, fx, _, twice = visible_band(shape)
    size = np.abs(spectrum)
    power = np.where(band, size, 0.0) ** 2
    largest = np.unravel_index(int(np.argmax(power)), power.shape)
    seed, frame = int(largest[0]), int(largest[1])
    peaks = 2.0 * np.max(np.where(band, size, 0.0), axis=(2, 3))
    extras: dict[str, object] = {"size": [shape[1], shape[0]], **block_peaks(signals.error[0, 0])}
    total = float(np.sum(power[seed, frame] * twice)) / 2.0
    if total < NOTHING:
        extras |= {"cycles_per_px": None, "period_px": None}
    else:
        nu = (float(fx[0, largest[3]]), float(fy[largest[2], 0]))
        g = float(power[largest]) / total
        ordinates = float(np.sum(twice[band])) / 2.0
        extras |= {
            "frame": frame + signals.frame_start,
            "cycles_per_px": nu,
            "period_px": 1.0 / float(np.hypot(*nu)),
            "fisher_g": g,
            "p_value_bound": min(1.0, ordinates * max(1.0 - g, 0.0) ** (ordinates - 1.0)),
        }
    value = 0.0 if total < NOTHING else rms(peaks)
    return settle(value, extras, floor=2.0 * signals.floor, status="windowed" if windowed else "ok")


def block_peaks(error: FloatArray) -> dict[str, object]:
    """Return the largest and the mean peak of Hann-windowed 32 x 32 blocks, 16 apart, of one picture (h, w)."""
    if min(error.shape) < BLOCK:
        return {"block_peak_max": None, "block_peak_mean": None}
    blocks = np.lib.stride_tricks.sliding_window_view(error, (BLOCK, BLOCK))[::BLOCK_STEP, ::BLOCK_STEP]
    hann = np.sin(np.pi * (np.arange(BLOCK) + 0.5) / BLOCK) ** 2
    window = hann[:, None] * hann
    centered = blocks - np.mean(blocks, axis=(2, 3), keepdims=True)
    spectrum = np.abs(fft.rfft2(centered * window)) / np.sum(window)
    band = visible_band((BLOCK, BLOCK))[2]
    peaks = 2.0 * np.max(spectrum[..., band], axis=-1)
    return {"block_peak_max": float(np.max(peaks)), "block_peak_mean": float(np.mean(peaks))}
