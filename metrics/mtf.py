"""The modulation transfer of a picture's edges: how much of each frequency is left, and how much that must alias.

The derivative of the edge spread function is the line spread function, its transform the optical transfer function
along the edge's normal (ISO 12233 with the angle known). A pixel grid folds everything beyond half a cycle per pixel:
what is left there is aliasing. Filters that keep more within are sharper, filters that keep more beyond alias.
"""

from dataclasses import dataclass

import numpy as np
from scipy import integrate

from aliasbench.metrics.edge_spread import EdgeSpread, describe_spreads, spread_edges, usable_spreads
from aliasbench.metrics.gate import Signals
from aliasbench.metrics.score import Score
from aliasbench.scenes.model import FloatArray

# Frequencies from 0 to 1 in steps of 1/128 cycles/px. A linear interpolation of a curve whose second derivative is at
# most pi^2 (a step through a box of one pixel) is off by pi^2 / 128^2 / 8 = 8e-5.
STEPS = 128
FREQUENCIES: FloatArray = np.arange(STEPS + 1) / STEPS
FREQUENCIES.flags.writeable = False
NYQUIST = STEPS // 2
COARSE = 8  # of them lie between two of the curve kept in extras


@dataclass(frozen=True, slots=True, eq=False)
class Transfer:
    """The transfer of one picture's edges at `FREQUENCIES`, the mean over edges of the modulus.

    Attributes
    ----------
    modulus : (129,) float64
        1 at frequency 0.
    spectrum : (129,) float64
        Root mean square over edges of modulus times contrast: what these edges have of each frequency.
    """

    modulus: FloatArray
    spectrum: FloatArray

    @property
    def half(self) -> float | None:
        """The frequency in cycles/px where the modulus first falls to 1/2; None if it does not up to 1."""
        below = np.flatnonzero(self.modulus < 0.5)
        if not below.size:
            return None
        high = int(below[0])
        above, under = self.modulus[high - 1], self.modulus[high]
        return float(FREQUENCIES[high - 1] + (above - 0.5) / (above - under) / STEPS)

    @property
    def nyquist(self) -> float:
        """The modulus at 1/2 cycle/px."""
        return float(self.modulus[NYQUIST])

    @property
    def aliasing_potential(self) -> float:
        """The integral of the squared modulus from 1/2 to 1 cycle/px over that from 0 to 1/2."""
        power = self.modulus**2
        beyond, within = (float(integrate.simpson(p, dx=1 / STEPS)) for p in (power[NYQUIST:], power[: NYQUIST + 1]))
        return beyond / within

    @property
    def aliased_energy(self) -> float:
        """What the edge has between 1/2 and 1 cycle/px and the pixel grid folds, in contrast^2 px per px of edge.

        A step of contrast A behind a filter has the spectrum A M(f) / (2 pi i f): twice the integral of its square.
        """
        density = (self.spectrum[NYQUIST:] / (2.0 * np.pi * FREQUENCIES[NYQUIST:])) ** 2
        return 2.0 * float(integrate.simpson(density, dx=1 / STEPS))


def transfer_of(distance: FloatArray, value: FloatArray, bin_px: float) -> FloatArray:
    """Return the modulus (129,) of the transfer of an edge spread function.

    Differences of the profile over steps g are the line spread averaged over a box of width g, and each value is the
    profile averaged over its bin: the sampled transform is therefore the wanted one times sinc(f g) sinc(f bin), and is
    divided by it. (What is left is the images of the spectrum at 1/g, on which both factors are nearly 0. A step is
    its own image: sampled it has modulus 1, and is over-corrected by up to 1 / sinc^2(f / 16), 0.3 % at f = 1/2.)

    Parameters
    ----------
    distance : (n,) float
        Ascending, in pixels.
    value : (n,) float
        From 0 to 1.
    bin_px : float
        Width of the bins.
    """
    gap = np.diff(distance)
    middle = distance[:-1] + gap / 2.0
    wave = np.exp(-2j * np.pi * FREQUENCIES[:, None] * middle) / np.sinc(FREQUENCIES[:, None] * gap)
    out: FloatArray = np.abs(wave @ np.diff(value)) / np.sinc(FREQUENCIES * bin_px)
    return out


def edge_transfer(spreads: list[EdgeSpread], which: str) -> Transfer | None:
    """Return the transfer of the edges that ``test`` or ``reference`` shows, or None if it shows none."""
    moduli, contrasts = [], []
    for s in spreads:
        value, contrast = (s.test, s.contrast) if which == "test" else (s.reference, s.reference_contrast)
        if contrast:
            moduli.append(transfer_of(s.distance, value, s.bin_px))
            contrasts.append(contrast)
    if not moduli:
        return None
    curves = np.array(moduli)
    spectrum: FloatArray = np.sqrt(np.mean((curves * np.array(contrasts)[:, None]) ** 2, axis=0))
    return Transfer(np.mean(curves, axis=0), spectrum)


def _figures(transfer: Transfer | None, before: str = "") -> dict[str, object]:
    return {
        f"{before}mtf50": transfer and transfer.half,
        f"{before}mtf_nyquist": transfer and transfer.nyquist,
        f"{before}mtf": None if transfer is None else transfer.modulus[::COARSE],
        f"{before}aliasing_potential": transfer and transfer.aliasing_potential,
        f"{before}aliased_energy": transfer and transfer.aliased_energy,
    }


def compute_mtf50(signals: Signals) -> Score:
    """Return the frequency in cycles/px at which half of the modulation across the picture's edges is left.

    Of one edge the profiles of all frames and seeds are averaged, of several edges the curves. The curve is the
    picture's own, shutter and all; the reference's is beside it. Where it stays above one half up to 1 cycle/px, as
    that of point samples does, there is no such frequency: `undefined_no_crossing`, and the figures are in the extras.
    """
    spreads = usable_spreads(signals)
    if isinstance(spreads, Score):
        return spreads
    transfer = edge_transfer(spreads, "test")
    if transfer is None or not np.isfinite(transfer.modulus).all():
        return Score(None, "overflow")
    extras = {
        **_figures(transfer),
        **_figures(edge_transfer(spreads, "reference"), "reference_"),
        "frequencies": FREQUENCIES[::COARSE],
        "edges": describe_spreads(spread_edges(signals)),
    }
    if transfer.half is None:
        return Score(None, "undefined_no_crossing", extras)
    return Score(transfer.half, "ok", extras)
