"""From samples back to a continuous signal: what a display and an eye make of a row of pixels.

A reconstruction is the sum of the samples times a kernel about each. Of a single line at nu cycles per sample this is
the line times K^(nu), and its images at nu - k times K^(nu - k), K^ being the kernel's Fourier transform; so the error
of a sinusoid, averaged over its phase, is known without rendering anything, and is what measured ones are held to.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from aliasbench.scenes.errors import unknown_name
from aliasbench.scenes.model import FloatArray

GAUSSIAN_SIGMA = 0.5  # samples; the spot of a display
# Closer to 0 the closed form of Mitchell's transform cancels, and its series is exact in float64.
SERIES_BELOW = 0.01


@dataclass(frozen=True, slots=True)
class Kernel:
    """A reconstruction kernel of unit area; distances are in samples, frequencies in cycles per sample.

    Attributes
    ----------
    name : str
        Its key in `KERNELS`.
    radius : float
        The kernel is 0 further out (of the Gaussian, less than 2e-14 of its peak).
    evaluate, transform : callable
        Value at a distance, and Fourier transform at a frequency (real, as the kernel is even).
    """

    name: str
    radius: float
    evaluate: Callable[[FloatArray], FloatArray]
    transform: Callable[[FloatArray], FloatArray]


def _box(x: FloatArray) -> FloatArray:
    # Half open: of two samples equally near, one is shown and not both.
    out: FloatArray = np.where((x >= -0.5) & (x < 0.5), 1.0, 0.0)
    return out


def _tent(x: FloatArray) -> FloatArray:
    return np.maximum(0.0, 1.0 - np.abs(x))


def _gaussian(x: FloatArray) -> FloatArray:
    out: FloatArray = np.exp(-0.5 * (x / GAUSSIAN_SIGMA) ** 2) / (GAUSSIAN_SIGMA * np.sqrt(2.0 * np.pi))
    return np.where(np.abs(x) <= 8.0 * GAUSSIAN_SIGMA, out, 0.0)


def _mitchell(x: FloatArray) -> FloatArray:
    # B = C = 1/3
    a = np.abs(x)
    near = ((7.0 * a - 12.0) * a * a + 16.0 / 3.0) / 6.0
    far = (((-7.0 / 3.0 * a + 12.0) * a - 20.0) * a + 32.0 / 3.0) / 6.0
    return np.where(a < 1.0, near, np.where(a < 2.0, far, 0.0))


def _box_transform(nu: FloatArray) -> FloatArray:
    return np.sinc(nu)


def _tent_transform(nu: FloatArray) -> FloatArray:
    out: FloatArray = np.sinc(nu) ** 2
    return out


def _gaussian_transform(nu: FloatArray) -> FloatArray:
    return np.exp(-2.0 * (np.pi * GAUSSIAN_SIGMA * nu) ** 2)


def _mitchell_transform(nu: FloatArray) -> FloatArray:
    # The family is affine in B and C: at C = 0 it goes from the cubic Hermite (B = 0) to the cubic B-spline (B = 1),
    # and C adds a kernel without area. The transforms of these three follow by integration by parts.
    small = np.abs(nu) < SERIES_BELOW
    f = np.where(small, 1.0, nu)
    square = (np.pi * f) ** 2
    one, two, four = np.sinc(f), np.sinc(2.0 * f), np.sinc(4.0 * f)
    hermite = 3.0 / square * (one**2 - two)
    third = -2.0 / square * (3.0 * two**2 - 2.0 * two - four)
    whole = (2.0 * hermite + one**4 + third) / 3.0
    # Near 0 instead the sum over even moments m of (-1)^k m_2k (2 pi nu)^(2k) / (2k)!
    w = (2.0 * np.pi * np.where(small, nu, 0.0)) ** 2
    series = 1.0 + w * (_MOMENTS[0] + w * (_MOMENTS[1] + w * (_MOMENTS[2] + w * _MOMENTS[3])))
    return np.where(small, series, whole)


def _series_term(order: int) -> float:
    """Return what an even moment of Mitchell's kernel, from its polynomials, contributes to its transform's series."""
    near = np.polynomial.Polynomial([16.0 / 18.0, 0.0, -2.0, 7.0 / 6.0])
    far = np.polynomial.Polynomial([32.0 / 18.0, -20.0 / 6.0, 2.0, -7.0 / 18.0])
    power = np.polynomial.Polynomial([0.0] * order + [1.0])
    inner, outer = (near * power).integ(), (far * power).integ()
    moment = 2.0 * float(inner(1.0) - inner(0.0) + outer(2.0) - outer(1.0))
    return (-1.0) ** (order // 2) * moment / math.factorial(order)


_MOMENTS = tuple(_series_term(order) for order in (2, 4, 6, 8))

KERNELS: Mapping[str, Kernel] = MappingProxyType(
    {
        "box": Kernel("box", 0.5, _box, _box_transform),
        "tent": Kernel("tent", 1.0, _tent, _tent_transform),
        "gaussian": Kernel("gaussian", 8.0 * GAUSSIAN_SIGMA, _gaussian, _gaussian_transform),
        "mitchell": Kernel("mitchell", 2.0, _mitchell, _mitchell_transform),
    }
)


def kernel_of(name: str) -> Kernel:
    """Return the kernel of a name; raise `InputError` for an unknown one."""
    if name not in KERNELS:
        raise unknown_name("reconstruction kernel", name, KERNELS)
    return KERNELS[name]


def reconstruct(
    samples: ArrayLike, x_px: ArrayLike, kernel: str, *, periodic: bool = False, normalised: bool = True
) -> FloatArray:
    """Return (..., m): the continuous signal that a kernel makes of a row of samples, at positions along the row.

    Parameters
    ----------
    samples : (..., n) float
        Sample j lies at j + 0.5 pixels: the centre of its pixel.
    x_px : (m,) float
        Positions from the row's left end, pixels.
    kernel : {"box", "tent", "gaussian", "mitchell"}
        Box shows each sample as wide as its pixel, tent joins them by lines, the Gaussian has sigma 0.5, Mitchell has
        B = C = 1/3 (Mitchell and Netravali 1988).
    periodic : bool
        Whether the row goes on as a repetition of itself; else as its last samples, so that within `radius` + 1/2 of
        the ends the result is not the signal's.
    normalised : bool
        Whether the weights at every position are divided by their sum. Only the Gaussian's is not 1 by itself (it
        ripples by 1.4 %).
    """
    s = np.asarray(samples, dtype=np.float64)
    x = np.asarray(x_px, dtype=np.float64)
    chosen = kernel_of(kernel)
    count = s.shape[-1]
    reach = int(np.ceil(chosen.radius))
    taps = np.floor(x).astype(np.int64)[:, None] + np.arange(-reach, reach + 1)
    weights = chosen.evaluate(x[:, None] - (taps + 0.5))
    if normalised:
        weights = weights / weights.sum(axis=1, keepdims=True)
    index = np.mod(taps, count) if periodic else np.clip(taps, 0, count - 1)
    out = np.zeros((*s.shape[:-1], len(x)))
    # tap by tap: all at once would take eleven times the memory
    for tap in range(taps.shape[1]):
        out += s[..., index[:, tap]] * weights[:, tap]
    return out


def response(cycles_per_px: float, offset_px: ArrayLike, kernel: str, *, normalised: bool = True) -> FloatArray:
    """Return complex (m,): what a reconstruction multiplies exp(2 pi i nu x) by, at distances from a sample.

    Its mean over a sample interval is K^(nu); that it is not constant are the images.

    Parameters
    ----------
    cycles_per_px : float
        nu.
    offset_px : (m,) float
        Distance from the nearest sample, in [-1/2, 1/2] (any distance is right: it has period 1).
    kernel, normalised
        As in `reconstruct`.
    """
    chosen = kernel_of(kernel)
    offset = np.asarray(offset_px, dtype=np.float64)
    reach = int(np.ceil(chosen.radius)) + 1
    away = (offset - np.round(offset))[:, None] - np.arange(-reach, reach + 1)
    weights = chosen.evaluate(away)
    if normalised:
        weights = weights / weights.sum(axis=1, keepdims=True)
    out: FloatArray = np.sum(weights * np.exp(-2j * np.pi * cycles_per_px * away), axis=1)
    return out


def interval_nodes(order: int = 8) -> tuple[FloatArray, FloatArray]:
    """Return positions in (0, 1) and weights (sum 1) of Gauss quadrature over a pixel, its halves taken apart.

    Sample centres and pixel borders, where kernels have their knots, are ends of the halves: polynomials times waves of
    up to two cycles per pixel are integrated to rounding.
    """
    nodes, weights = np.polynomial.legendre.leggauss(order)
    half = (nodes + 1.0) / 4.0
    return np.concatenate([half, half + 0.5]), np.concatenate([weights, weights]) / 4.0


def expected_rmse(cycles_per_px: float, kernel: str, *, amplitude: float = 0.5, normalised: bool = True) -> float:
    """Return the RMS difference of a sinusoid and the reconstruction of its point samples, over position and phase.

    Equals amplitude / sqrt(2) * sqrt((1 - K^(nu))^2 + sum over k != 0 of K^(nu - k)^2) where weights are not
    normalised (Parseval): for the box sqrt(2 - 2 sinc nu), for the tent sqrt(1 - 2 sinc^2 nu + (2 + cos 2 pi nu) / 3).
    At every position the mean over the phases is right for three or more equally spaced ones already.

    Parameters
    ----------
    cycles_per_px : float
        nu, of the original; above 1/2 the samples are those of its alias.
    kernel, normalised
        As in `reconstruct`.
    amplitude : float
        Half of the difference between crest and trough.
    """
    order = 24 + int(4.0 * abs(cycles_per_px))
    positions, weights = interval_nodes(order)
    miss = 1.0 - response(cycles_per_px, positions - 0.5, kernel, normalised=normalised)
    return float(abs(amplitude) * np.sqrt(0.5 * np.sum(weights * np.abs(miss) ** 2)))
