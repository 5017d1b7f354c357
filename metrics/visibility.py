"""What of a flicker the eye would see, at a viewing distance that is assumed: a weight, never a headline.

The spatio-temporal contrast sensitivity is Kelly's (1979) for stabilised images, with Daly's (1998) constants,

    G(rho, v) = (6.1 + 7.3 |log10(v / 3)|^3) v (2 pi rho)^2 exp(-4 pi rho (v + 2) / 45.9),

of a grating of rho cycles per degree that moves at v = f / rho degrees per second. At a given v it is largest at
rho = 45.9 / (2 pi (v + 2)). The fit goes to 0 for uniform fields, which real vision does not: below .5 cycles per
degree, gratings are seen as if they had .5.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from aliasbench.metrics.perceptual import DISPLAY
from aliasbench.metrics.spectrum import BandSpectrum
from aliasbench.scenes.model import FloatArray

CSF = "Kelly 1979, Daly 1998"
PIXELS_PER_DEGREE = DISPLAY.pixels_per_degree
LOWEST_CYCLES_PER_DEGREE = 0.5
# Largest G, at 1.574 degrees per second and 2.044 cycles per degree.
LARGEST_SENSITIVITY = 219.956892


def kelly_daly(cycles_per_degree: FloatArray, degrees_per_second: FloatArray) -> FloatArray:
    """Return G(rho, v), not normalised, for rho >= 0 and v > 0; arrays of any shapes that broadcast."""
    v, angle = degrees_per_second, 2.0 * np.pi * cycles_per_degree
    level = 6.1 + 7.3 * np.abs(np.log10(v / 3.0)) ** 3
    out: FloatArray = level * v * angle**2 * np.exp(-2.0 * angle * (v + 2.0) / 45.9)
    return out


def sensitivity(cycles_per_degree: FloatArray, hertz: FloatArray) -> FloatArray:
    """Return how visible a flicker of rho >= 0 cycles per degree and f > 0 Hz is: 1 for the most visible one."""
    rho = np.maximum(cycles_per_degree, LOWEST_CYCLES_PER_DEGREE)
    out: FloatArray = kelly_daly(rho, hertz / rho) / LARGEST_SENSITIVITY
    return out


def visible_shimmer(spectrum: BandSpectrum, fps: float) -> float:
    """Return SH_vis: the RMS of the error's changing part, each spatio-temporal frequency weighted by its visibility.

    sqrt(sum over rho and f != 0 of W^2 |E|^2), which is at most SH_err. A drifting sinusoid of amplitude a has
    W a / sqrt 2; one that flickers in place is two that drift, and has W a / 2; a flicker of the whole picture has
    W a / sqrt 2 at rho = 0. Frequencies above .25 cycles per pixel are left out: at 67 pixels per degree W is below
    .0101 there.
    """
    seeds, frames = (int(n) for n in spectrum.values.shape[:2])
    count = frames // 2
    radius = np.hypot(spectrum.band.nu[:, 0], spectrum.band.nu[:, 1]) * PIXELS_PER_DEGREE
    # As many weights as there are distances from frequency 0, some tenth of the bins; frequency 0 comes last.
    rings, ring = np.unique(np.round(radius, 9), return_inverse=True)
    order = np.argsort(ring, kind="stable")
    starts = np.searchsorted(ring[order], np.arange(rings.size))
    power = np.zeros((count, rings.size + 1))
    for values, mean in zip(spectrum.values, spectrum.mean, strict=True):
        # nu stands for -nu too: its waves of frequency f and -f are different ones, and each counts twice.
        both = _two_sided_power(fft.fft(values[:, order], axis=0))
        power[:, :-1] += 2.0 * np.add.reduceat(both, starts, axis=1)
        power[:, -1] += _two_sided_power(fft.fft(mean))
    hertz = np.arange(1, count + 1)[:, None] * fps / frames
    weight = sensitivity(np.append(rings, 0.0), hertz) ** 2
    return math.sqrt(float(np.sum(weight * power)) / seeds) / frames


def _two_sided_power(transformed: NDArray[np.complex128]) -> FloatArray:
    """Return |F_k|^2 + |F_-k|^2 for k = 1 to half the frames; one of them where k and -k are the same."""
    frames = len(transformed)
    square: FloatArray = transformed.real**2 + transformed.imag**2
    both = square[1 : frames // 2 + 1].copy()
    paired = (frames - 1) // 2
    both[:paired] += square[: frames - paired - 1 : -1]
    return both
