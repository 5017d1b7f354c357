"""The error's low spatial frequencies, once for all metrics that look there.

Only the band in which a pattern is seen as a pattern is kept, a tenth of the transform, so that a long sequence's
spectrum fits into memory and the transform's second half is taken of a quarter of the columns. The error is real: of
each pair of opposite frequencies one is kept, and stands for both.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from aliasbench.metrics.gate import Signals, each_frame
from aliasbench.scenes.model import FloatArray
from aliasbench.scenes.projection import view_at

Frequency = tuple[float, float]

# The band in which false patterns are visible as such, cycles per pixel.
HIGHEST_VISIBLE = 0.25
WHOLE_PERIODS = 1e-6
# Lines of gratings that overlap: orders of each, and bins on either side of a line that are its own. Under a Hann
# window it is 3: further than 3 bins away a line between two bins leaks less than 1 % of its amplitude.
HIGHEST_ORDER = 4
BESIDE, BESIDE_WINDOWED = 1.5, 3.5
# More unrelated gratings than two crossed pairs lie side by side, and their lines are blurred across.
MOST_GRATINGS = 4


@dataclass(frozen=True, slots=True, eq=False)
class Band:
    """Where in a transform of real pictures the visible band is: one of each two opposite frequencies.

    Both are in the transform with the same magnitude. None is its own opposite: that takes 2 nu whole along both axes,
    which in the band only frequency 0 has, and it is left out.

    Attributes
    ----------
    height, width : int
        Size of the picture.
    rows, columns : (n,) int
        Bins of `rfft2`.
    nu : (n, 2) float64
        Cycles per pixel along x and y.
    """

    height: int
    width: int
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    nu: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class BandSpectrum:
    """The error's transform in the band.

    Attributes
    ----------
    values : (seeds, frames, n) complex128
        Transform over the number of pixels: a sinusoid of amplitude a has magnitude a / 2.
    mean : (seeds, frames) float64
        Frequency 0.
    band : Band
    free : (n,) bool
        Which bins are no line of the scene.
    windowed : bool
        Whether a Hann window was used, because the gratings have no whole periods in the picture.
    """

    values: NDArray[np.complex128]
    mean: FloatArray
    band: Band
    free: NDArray[np.bool_]
    windowed: bool


def visible_band(height: int, width: int) -> Band:
    """Return the bins of 0 < |nu| <= .25 of a picture's transform."""
    fy, fx = fft.fftfreq(height)[:, None], fft.rfftfreq(width)[None, :]
    size = np.hypot(fy, fx)
    inside = (size > 0.0) & (size <= HIGHEST_VISIBLE * (1.0 + 1e-12)) & ((fx > 0.0) | (fy > 0.0))
    rows, columns = np.nonzero(inside)
    return Band(height, width, rows, columns, np.stack([fx[0, columns], fy[rows, 0]], axis=1))


def known_frequencies(signals: Signals) -> list[Frequency]:
    """Return the gratings' frequencies in cycles per pixel (x, y); none where they vary over the picture or in time."""
    scene = signals.scene
    camera = scene.camera
    if camera.projection != "orthographic" or camera.target_velocity not in (None, camera.velocity):
        return []
    view = view_at(camera, scene.animation, signals.frame_start, 0.0, signals.size)
    units = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    points = view.project(units)[:, :2]
    pixels_per_unit = (points[1:] - points[0]).T
    if abs(np.linalg.det(pixels_per_unit)) < 1e-9 * float(np.sum(pixels_per_unit**2)):
        return []
    inverse = np.linalg.inv(pixels_per_unit)
    found = [np.asarray(g.cycles_per_unit) @ inverse for g in scene.facts.gratings]
    return [(float(nu[0]), float(nu[1])) for nu in found]


def whole_periods(side: int, cycles_per_px: Sequence[float]) -> int | None:
    """Return the largest length, at least half of `side`, that holds whole periods of all; None if there is none."""
    lengths = np.arange(side, max(side // 2, 1) - 1, -1)
    cycles = lengths[:, None] * np.asarray(cycles_per_px, dtype=np.float64)
    slack = WHOLE_PERIODS * np.maximum(1.0, np.abs(cycles))
    fits = np.all(np.abs(cycles - np.round(cycles)) < slack, axis=1)
    return int(lengths[int(np.argmax(fits))]) if fits.any() else None


def without_lines(band: Band, lines: Sequence[Frequency], beside: float = BESIDE) -> NDArray[np.bool_]:
    """Return which of the band's bins (n,) are further than `beside` bins, along x or y, from every line."""
    taken = np.zeros((band.height, band.width // 2 + 1), dtype=np.bool_)
    for nx, ny in lines:
        for x, y in ((nx * band.width, ny * band.height), (-nx * band.width, -ny * band.height)):
            columns = np.arange(max(0, math.ceil(x - beside)), min(band.width // 2, math.floor(x + beside)) + 1)
            rows = np.arange(math.ceil(y - beside), math.floor(y + beside) + 1) % band.height
            taken[rows[:, None], columns] = True
    out: NDArray[np.bool_] = ~taken[band.rows, band.columns]
    return out


def harmonics(gratings: Sequence[Frequency]) -> list[Frequency]:
    """Return the multiples of the gratings' frequencies that are in the visible band."""
    lines = []
    for nx, ny in gratings:
        highest = int(HIGHEST_VISIBLE / np.hypot(nx, ny)) if nx or ny else 0
        lines += [(k * nx, k * ny) for k in range(1, highest + 1)]
    return lines


def combinations_in_band(gratings: Sequence[Frequency]) -> list[Frequency] | None:
    """Return the lines in the visible band that gratings have where they overlap: m f1 + n f2 of any two.

    Orders up to 4 of each, and all of what is declared itself: even of two square waves the amplitude at (5, 5) is
    only 2 / (5 pi)^2 = .0081, and with all orders false lines would count as true ones wherever frequencies have a
    common measure. None for more unrelated gratings than could overlap, whose spectrum is not one of lines.
    """
    orders = np.arange(-HIGHEST_ORDER, HIGHEST_ORDER + 1)
    m, n = (a.ravel() for a in np.meshgrid(orders, orders))
    unrelated: list[FloatArray] = []
    for grating in gratings:
        own = np.asarray(grating)
        pairs = [m[:, None] * a + n[:, None] * b for a, b in combinations([*unrelated, np.zeros(2)], 2)]
        if not any(np.any(np.all(np.abs(p - own) < 1e-9, axis=1)) for p in pairs):
            unrelated.append(own)
    if len(unrelated) > MOST_GRATINGS:
        return None
    lines = harmonics(gratings)
    for a, b in combinations(unrelated, 2):
        sums = m[:, None] * a + n[:, None] * b
        lines += [(float(x), float(y)) for x, y in sums[np.hypot(sums[:, 0], sums[:, 1]) <= HIGHEST_VISIBLE]]
    # Opposite frequencies are one line, and so are those that rounding alone tells apart.
    rounded = {(round(x, 12), round(y, 12)) for x, y in lines}
    return sorted({max((x, y), (-x, -y)) for x, y in rounded} - {(0.0, 0.0)})


@dataclass(frozen=True, slots=True, eq=False)
class Trim:
    """The part of the picture that is transformed: whole periods of its gratings, or all of it under a window.

    Attributes
    ----------
    height, width : int
        From the top left corner.
    window : (h, w) float64 or None
        Hann, of unit mean square, along the axes that hold no whole periods.
    """

    height: int
    width: int
    window: FloatArray | None

    def apply(self, picture: FloatArray) -> FloatArray:
        """Return the part of a picture (h, w); its mean is taken off first where a window would spread it."""
        part = picture[: self.height, : self.width]
        return part if self.window is None else (part - np.mean(part)) * self.window


def trim_to_periods(signals: Signals) -> Trim:
    """Return the part of the picture in which the scene's gratings have whole periods."""
    height, width = signals.error.shape[-2:]
    known = known_frequencies(signals)
    lengths = [whole_periods(side, [nu[axis] for nu in known]) for axis, side in ((1, height), (0, width))]
    h, w = (side if length is None else length for length, side in zip(lengths, (height, width), strict=True))
    if None not in lengths:
        return Trim(h, w, None)
    windows = []
    for length, side in zip(lengths, (h, w), strict=True):
        hann = np.sin(np.pi * (np.arange(side) + 0.5) / side) ** 2
        windows.append(hann / np.sqrt(np.mean(hann**2)) if length is None else np.ones(side))
    return Trim(h, w, windows[0][:, None] * windows[1])


def transform(picture: FloatArray, band: Band) -> NDArray[np.complex128]:
    """Return the transform (n,) of one picture (h, w) in the band, over the number of pixels."""
    columns = fft.rfft(picture, axis=1)[:, : int(HIGHEST_VISIBLE * band.width) + 1]
    spectrum = fft.fft(columns, axis=0)
    out: NDArray[np.complex128] = spectrum[band.rows, band.columns] / picture.size
    return out


def band_spectrum(signals: Signals) -> BandSpectrum:
    """Return the error's spectrum in the visible band, of every seed and frame.

    Where the scene declares gratings, the picture is trimmed to whole periods of them and their own lines are not
    `free` (an error there is a filter's amplitude, not a false pattern).
    """
    return signals.once("spectrum of the error", lambda: _band_spectrum(signals))


def _band_spectrum(signals: Signals) -> BandSpectrum:
    trim = trim_to_periods(signals)
    band = visible_band(trim.height, trim.width)
    values = np.empty((signals.seeds, signals.frames, len(band.nu)), dtype=np.complex128)
    mean = np.empty((signals.seeds, signals.frames))

    def transform_frame(frame: int) -> None:
        for seed, picture in enumerate(signals.error[:, frame]):
            values[seed, frame] = transform(trim.apply(picture), band)
            mean[seed, frame] = np.mean(picture[: trim.height, : trim.width])

    each_frame(transform_frame, signals.frames)
    free = without_lines(band, harmonics(known_frequencies(signals)))
    return BandSpectrum(values, mean, band, free, trim.window is not None)
