"""Angular orders of a rotor's picture: what the strobing metrics are made from.

A pattern of equal blades has only orders that are multiples of the blade count; all others show how much noise there
is. The orders of a picture cost one pass over the annulus whatever their number.
"""

from dataclasses import dataclass

import numpy as np
from scipy import fft, sparse

from aliasbench.metrics.gate import Signals, each_frame
from aliasbench.metrics.rotors import Annulus, annulus_at, stays
from aliasbench.scenes.model import FloatArray, RotorFact

HIGHEST_HARMONIC = 48
BINS_PER_CYCLE = 64
MOMENTS = 6
FEW_PICTURES = 8

ComplexArray = np.ndarray[tuple[int, ...], np.dtype[np.complex128]]


@dataclass(frozen=True, slots=True, eq=False)
class Orders:
    """Angular orders 1 .. M of a rotor.

    Attributes
    ----------
    rotor : RotorFact
    coefficients : (seeds, frames, M) complex128
        c_m of order m = index + 1, in units of the contrast.
    """

    rotor: RotorFact
    coefficients: ComplexArray

    @property
    def harmonics(self) -> FloatArray:
        """The blade count's multiples up to M, as numbers k = m / blades."""
        return np.arange(1, self.coefficients.shape[-1] // self.rotor.blades + 1, dtype=np.float64)

    @property
    def blade_coefficients(self) -> ComplexArray:
        """c_m of the blade count's multiples, (seeds, frames, K)."""
        return self.coefficients[..., self.rotor.blades - 1 :: self.rotor.blades]


def sharp_power(rotor: RotorFact, k: FloatArray) -> FloatArray:
    """Return |a_m|^2 of the pattern standing still, m = k blades: (d sinc(k d))^2."""
    out: FloatArray = (rotor.duty * np.sinc(k * rotor.duty)) ** 2
    return out


def is_aliased(rotor: RotorFact, fps: float, k: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Return whether order m = k blades passes a point at half the frame rate or more."""
    out: np.ndarray[tuple[int, ...], np.dtype[np.bool_]] = 2.0 * np.abs(k * rotor.blades * rotor.rev_per_s) >= fps * (
        1.0 - 1e-12
    )
    return out


def highest_order(rotor: RotorFact, annulus: Annulus, fps: float) -> int:
    """Return the order up to which the annulus resolves the pattern: 2 pixels a cycle a quarter into it.

    The weight further in is 2 %. No more are taken than are needed to reach twice the first aliased one.
    """
    resolved = np.pi * (annulus.inner_px + (annulus.outer_px - annulus.inner_px) / 4)
    first_aliased = fps / (2.0 * abs(rotor.rev_per_s)) if rotor.rev_per_s else 0.0
    return int(min(resolved, max(HIGHEST_HARMONIC * rotor.blades, 2.0 * first_aliased)))


def angular_orders(values: FloatArray, annulus: Annulus, highest: int) -> ComplexArray:
    """Return (n, highest) complex: c_m = sum over pixels of w T exp(-i m theta), of values (n, pixels).

    The pixels are collected in bins of angle and transformed; each bin keeps six moments of where in it they lie. With
    64 bins to a cycle of the highest order the series exp(-i m d), |m d| <= pi / 64, is cut where it is below 2e-11.
    """
    bins = 1 << (BINS_PER_CYCLE * highest - 1).bit_length()
    step = 2.0 * np.pi / bins
    nearest = np.rint(annulus.angle / step)
    offset = annulus.angle - nearest * step
    place = nearest.astype(np.int64) % bins
    few = values.shape[0] <= FEW_PICTURES
    if not few:
        order = np.argsort(place, kind="stable")
        starts = np.searchsorted(place[order], np.arange(bins + 1))
        columns = np.ascontiguousarray(values.T)
    m = np.arange(1, highest + 1)
    out = np.zeros((values.shape[0], highest), dtype=np.complex128)
    weight = annulus.weight
    factor: ComplexArray = np.ones(highest, dtype=np.complex128)
    for moment in range(MOMENTS):
        if few:  # then making the matrix costs more than it spares
            collected = np.stack([np.bincount(place, weight * row, bins) for row in values], axis=1)
        else:
            collect = sparse.csr_array((weight[order], order, starts), shape=(bins, order.size))
            collected = np.asarray(collect @ columns)
        out += (fft.rfft(collected, axis=0)[1 : highest + 1] * factor[:, None]).T
        weight = weight * offset
        factor *= -1j * m / (moment + 1)
    return out


def measure_orders(signals: Signals, picture: FloatArray, rotor: RotorFact) -> Orders | str:
    """Return the orders of a rotor in a sequence (n, frames, h, w), or the status that says why there are none."""
    scene = signals.scene
    count, frames = picture.shape[:2]
    if not (rotor.blades >= 1 and 0.0 < rotor.duty < 1.0 and 0.0 <= rotor.inner < rotor.outer):
        return "not_applicable"
    first = annulus_at(rotor, signals, signals.frame_start)
    if isinstance(first, str):
        return first
    highest = highest_order(rotor, first, scene.animation.fps)

    def orders_in(annulus: Annulus | str, part: slice) -> ComplexArray | str:
        if isinstance(annulus, str):
            return annulus
        if annulus.inner_px < 4.0 * rotor.blades / np.pi:
            return "undefined_too_small"
        own = picture[:, part].reshape(count, -1, picture.shape[2] * picture.shape[3])[:, :, annulus.index]
        return angular_orders(own.reshape(-1, annulus.index.size), annulus, highest).reshape(count, -1, highest)

    def orders_of(frame: int) -> ComplexArray | str:
        return orders_in(annulus_at(rotor, signals, frame + signals.frame_start), slice(frame, frame + 1))

    found = [orders_in(first, slice(None))] if stays(rotor, scene) else each_frame(orders_of, frames)
    parts = []
    for part in found:
        if isinstance(part, str):
            return part
        parts.append(part)
    return Orders(rotor, np.concatenate(parts, axis=1))


def noise_power(orders: Orders) -> float:
    """Return |c|^2 that noise leaves in every order, from the orders that no blade pattern has.

    The median over ln 2 is the mean of exponentially distributed powers, and ignores single lines. It is taken of each
    picture's own orders: of their means over pictures, which are spread less, the median is nearer to the mean.
    """
    order = np.arange(1, orders.coefficients.shape[-1] + 1)
    other = order % orders.rotor.blades != 0
    if not other.any():
        return 0.0
    power = np.abs(orders.coefficients[..., other]) ** 2
    return float(np.mean(np.median(power, axis=-1)) / np.log(2.0))
