"""The frequency of a row of samples: what it must be by the sampling theorem, and what it is found to be.

A wave of nu cycles per sample has exactly the samples of one at |nu - round(nu)|, and nobody can tell them apart
afterwards. The frequency of samples is therefore looked for between 0 and 1/2, by least squares of one sinusoid about a
mean: unlike the largest bin of a Fourier transform it needs no whole periods in the row, and without noise it is exact.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import FloatArray

PADDING = 8  # bins of the first search for each of the row's own
STEPS = 50  # of Newton's method; it doubles the digits, and takes 4 to 6
LEAST_SAMPLES = 8
NO_CHANGE = 1e-10  # of the rows' size times their length


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """The one sinusoid that fits some rows best.

    Attributes
    ----------
    cycles_per_px : float
        In [0, 1/2]; 0 where the rows have no wave.
    amplitudes : (r,) float64
        Of each row: half of the difference between crest and trough of the fitted wave. At exactly 1/2 it is what the
        samples show, which depends on the phase.
    residual_rms : float
        What the wave leaves of the rows.
    """

    cycles_per_px: float
    amplitudes: FloatArray
    residual_rms: float


def aliased_frequency(cycles_per_px: ArrayLike) -> FloatArray:
    """Return |nu - round(nu)|, in [0, 1/2]: the frequency at which point samples of nu cycles per sample come back."""
    nu = np.asarray(cycles_per_px, dtype=np.float64)
    return np.abs(nu - np.round(nu))


def line_deviation(noise: float, amplitude: float, count: int) -> float:
    """Return the standard deviation of a recovered frequency under white noise: sqrt(6) noise / (pi A n^(3/2)).

    The Cramer-Rao bound of a single line far from 0 and 1/2 (Rife and Boorstyn 1974), which least squares attains.
    """
    return math.sqrt(6.0) * noise / (math.pi * amplitude * count * math.sqrt(count))


def recover_frequency(rows: ArrayLike, *, least_amplitude: float = 0.0) -> Line:
    """Return the one frequency of some rows of samples, each with a mean, an amplitude and a phase of its own.

    Parameters
    ----------
    rows : (n,) or (r, n) float
        At least 8 samples; finite. Rows of other phases help where one row shows little, as near 1/2.
    least_amplitude : float
        A wave of less than this in every row is no wave: the frequency is 0. What a renderer's rounding leaves of a
        constant has a frequency too.

    Returns
    -------
    Line
        Exact (to rounding) for a single line; under white noise unbiased with `line_deviation`. Less than half a cycle
        in the row cannot be told from a change of the mean.

    Raises
    ------
    InputError
        If there are fewer than 8 samples or one is not finite.
    """
    s = np.atleast_2d(np.asarray(rows, dtype=np.float64))
    count = s.shape[-1]
    if s.ndim != 2 or count < LEAST_SAMPLES:
        raise InputError(f"rows of shape {s.shape}: at least {LEAST_SAMPLES} samples in one or several rows are needed")
    if not np.isfinite(s).all():
        raise InputError("rows: a sample is not finite")
    centered = s - s.mean(axis=1, keepdims=True)
    silent = Line(0.0, np.zeros(len(s)), float(np.sqrt(np.mean(centered**2))))
    size = PADDING * count
    power = np.sum(np.abs(fft.rfft(centered, size, axis=1)) ** 2, axis=0)
    if not power.max() > 1e-24 * count**2 * max(float(np.max(s**2)), 1e-300):
        return silent
    start = int(np.argmax(power)) / size
    if not 2.0 / count < start < 0.5 - 2.0 / count:
        # There a wave and its mirror image share their bins, and the highest is between the two.
        near = np.clip(start + np.arange(-PADDING, PADDING + 1) / size, 0.0, 0.5)
        start = float(min(near, key=lambda at: float(np.sum(_fit(s, float(at))[1] ** 2))))
    low, high = max(start - 1.0 / size, 0.0), min(start + 1.0 / size, 0.5)
    nu = start
    for _ in range(STEPS):
        step = _newton_step(s, nu)
        after = min(max(nu + step, low), high)
        if abs(after - nu) <= 1e-15:
            break
        nu = after
    amplitudes, residual, _ = _fit(s, nu)
    if not amplitudes.max() >= least_amplitude:
        return silent
    return Line(nu, amplitudes, float(np.sqrt(np.mean(residual**2))))


def _fit(s: FloatArray, nu: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return amplitudes (r,), residuals (r, n), and how the rows change with the frequency (r, n), fit for fit."""
    angle = 2.0 * np.pi * (np.arange(s.shape[1]) - (s.shape[1] - 1) / 2.0)
    basis = np.stack([np.ones_like(angle), np.cos(nu * angle), np.sin(nu * angle)], axis=1)
    # Near 1/2 (and 0) columns fall together; the cut-off then gives the smallest wave with the same samples.
    inverse = np.linalg.pinv(basis, rcond=1e-9)
    coefficients = inverse @ s.T
    _, a, b = coefficients
    residual = s - (basis @ coefficients).T
    change = angle * (b[:, None] * basis[:, 1] - a[:, None] * basis[:, 2])
    change = change - (basis @ (inverse @ change.T)).T
    return np.hypot(a, b), residual, change


def _newton_step(s: FloatArray, nu: float) -> float:
    """Return the step of Gauss and Newton in the frequency, means and amplitudes following (variable projection)."""
    _, residual, change = _fit(s, nu)
    steepness = float(np.sum(change**2))
    # At exactly 1/2 nothing changes but by rounding, which would step anywhere.
    least = NO_CHANGE**2 * float(np.sum(s**2)) * s.shape[1] ** 2
    return float(np.sum(change * residual)) / steepness if steepness > least else 0.0
