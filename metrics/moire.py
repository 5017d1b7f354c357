"""Moire: false low frequencies, measured as what the error has in the visible band.

A regular detail that is sampled too coarsely comes back as a slow pattern. A beat between two real screens is in the
reference too and cancels in the error, so that only the false one counts. What the exact rendering of a filter itself
lets through has no error; it is told beside it (`abs`), where the scene's spectrum is known.
"""

import math

import numpy as np
from numpy.typing import NDArray

from aliasbench.metrics.blocks import describe_blocks
from aliasbench.metrics.blur_split import SMALLEST, split_blur
from aliasbench.metrics.fisher import fisher_p_value
from aliasbench.metrics.gate import Signals
from aliasbench.metrics.score import Score, rms, settle, signed_root
from aliasbench.metrics.spectrum import (
    BESIDE,
    BESIDE_WINDOWED,
    HIGHEST_VISIBLE,
    band_spectrum,
    combinations_in_band,
    known_frequencies,
    transform,
    trim_to_periods,
    without_lines,
)

# A band with no more power than this, in squared contrast, has no line: rounding leaves it.
NOTHING = 1e-26
# Key frames, of figures that change little from one to the next.
MOST_FRAMES, MOST_PIXELS = 3, 2**18


def compute_moire(signals: Signals) -> Score:
    """Return M = sqrt(sum over the band of |E|^2), in contrast; quadratic mean over frames and seeds.

    Extras: with several seeds the part that they share, M_str^2 (unbiased, may be negative); `abs`, the false energy
    of the picture itself; and what of the whole error is another filter (`blur`), aliasing or noise (`residual`) and a
    shift of the mean (`offset`), of key frames.
    """
    spectrum = band_spectrum(signals)
    size = [spectrum.band.width, spectrum.band.height]
    inside = spectrum.values if spectrum.free.all() else spectrum.values[..., spectrum.free]
    ordinates = inside.shape[-1]
    if not ordinates:
        return Score(None, "undefined_too_small", {"size": size})
    value = band_rms(inside)
    extras: dict[str, object] = {
        "band_cycles_per_px": HIGHEST_VISIBLE,
        "bins": 2 * ordinates,
        "size": size,
        "abs": false_energy(signals),
        **_describe_blur(signals),
    }
    if signals.seeds > 1:
        both = np.abs(np.sum(inside, axis=0)) ** 2 - np.sum(np.abs(inside) ** 2, axis=0)
        square = 2.0 * float(np.mean(np.sum(both, axis=-1))) / (signals.seeds * (signals.seeds - 1))
        extras |= {"structured_square": square, "structured": signed_root(square)}
    return settle(value, extras, floor=signals.floor, status="windowed" if spectrum.windowed else "ok")


def compute_moire_peak(signals: Signals) -> Score:
    """Return P = 2 max over the band of |E|, the amplitude of the strongest false sinusoid; quadratic mean over frames.

    Extras: its frequency and period in the frame where it is strongest; Fisher's g there (the line's share of the
    band's power) with the exact probability of so large a share in white noise, of this frame (`p_value`) and of any of
    as many independent ones (`p_value_any`; both None under a window, which makes the ordinates depend on each other);
    and the peaks of 32 x 32 blocks for chirps (see `blocks.describe_blocks`).
    """
    spectrum = band_spectrum(signals)
    size = [spectrum.band.width, spectrum.band.height]
    if not spectrum.free.any():
        return Score(None, "undefined_too_small", {"size": size})
    magnitude = np.where(spectrum.free, np.abs(spectrum.values), 0.0)
    peaks = 2.0 * np.max(magnitude, axis=-1)
    seed, frame = (int(k) for k in np.unravel_index(int(np.argmax(peaks)), peaks.shape))
    strongest = magnitude[seed, frame]
    largest = float(np.max(strongest))
    relative = strongest / largest if largest > 0.0 else strongest
    share = float(np.sum(relative**2))
    extras: dict[str, object] = {"size": size, **describe_blocks(signals, np.sum(magnitude**2, axis=-1))}
    status = "windowed" if spectrum.windowed else "ok"
    if largest * largest * share < NOTHING:
        return settle(
            0.0, extras | {"cycles_per_px": None, "period_px": None}, floor=2.0 * signals.floor, status=status
        )
    nu = [float(f) for f in spectrum.band.nu[int(np.argmax(strongest))]]
    extras |= {
        "frame": frame + signals.frame_start,
        "cycles_per_px": nu,
        "period_px": 1.0 / math.hypot(*nu),
        "fisher_g": 1.0 / share,
        **_describe_significance(1.0 / share, int(np.sum(spectrum.free)), peaks.size, spectrum.windowed),
    }
    return settle(rms(peaks), extras, floor=2.0 * signals.floor, status=status)


def _describe_significance(g: float, ordinates: int, pictures: int, windowed: bool) -> dict[str, object]:
    if windowed or not math.isfinite(g):
        return {"ordinates": ordinates, "p_value": None, "p_value_any": None}
    p = fisher_p_value(min(g, 1.0), ordinates)
    any_picture = 1.0 if p == 1.0 else -math.expm1(pictures * math.log1p(-p))
    return {"ordinates": ordinates, "p_value": p, "p_value_any": any_picture}


def band_rms(inside: NDArray[np.complex128]) -> float:
    """Return sqrt(sum of |E|^2) of transforms (..., n) of which each ordinate stands for two bins; quadratic mean."""
    # two numbers to each bin: the sum is 2 n x 2 rms^2
    return 2.0 * math.sqrt(inside.shape[-1]) * rms(np.ascontiguousarray(inside).view(np.float64))


def false_energy(signals: Signals) -> float | None:
    """Return M_abs: the RMS of what the picture itself has in the band at frequencies that its gratings do not have.

    Of one to three evenly spaced frames, quadratic mean over seeds too. Any filter that is not ideal leaves some: a
    grating of nu cycles per pixel beyond Nyquist, box filtered exactly, |sinc nu| / sqrt 2 of its amplitude. None
    without gratings, or where they (and their sums and differences) are not all that the spectrum has: under
    perspective, with a turning camera or object, or side by side.
    """
    known = known_frequencies(signals)
    lines = combinations_in_band(known) if known else None
    if lines is None or any(o.motion.spin is not None for o in signals.scene.objects):
        return None
    band = band_spectrum(signals).band
    trim = trim_to_periods(signals)
    free = without_lines(band, lines, BESIDE if trim.window is None else BESIDE_WINDOWED)
    if not free.any():
        return None
    frames = key_frames(signals.frames, MOST_FRAMES)
    inside = np.stack([transform(trim.apply(own[t]), band)[free] for own in signals.test for t in frames])
    return band_rms(inside)


def key_frames(frames: int, most: int) -> list[int]:
    """Return up to `most` frames, at least one, in the middles of equal parts of the sequence."""
    count = max(1, min(frames, most))
    return [int((k + 0.5) * frames / count) for k in range(count)]


def _describe_blur(signals: Signals) -> dict[str, object]:
    frames = key_frames(signals.frames, min(MOST_FRAMES, MOST_PIXELS // signals.error[:, 0].size))
    height, width = signals.error.shape[-2:]
    # of a large picture the middle
    rows = min(height, max(MOST_PIXELS // width, SMALLEST))
    top = (height - rows) // 2
    reference = np.concatenate([signals.reference[frames, top : top + rows]] * signals.seeds)
    test = signals.test[:, frames, top : top + rows].reshape(reference.shape)
    split = split_blur(test, reference)
    if split is None:
        return {"blur": None, "residual": None, "offset": None}
    return {"blur": split.blur, "residual": split.residual, "offset": split.offset}
