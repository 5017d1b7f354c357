"""Where a sequence has the lines of moving gratings in space, and how strong they are from frame to frame.

Their places are known: a declared frequency and its multiples, each at its alias on the pixel lattice. Least squares
under a window then needs no size of picture that holds whole periods, as a transform would.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from aliasbench.metrics.gate import Signals
from aliasbench.metrics.gratings import MovingGrating, moving_gratings
from aliasbench.metrics.orders import ComplexArray
from aliasbench.scenes.model import FloatArray

# Harmonics that are looked for one by one, and the share of the strongest amplitude from which on they are.
MOST_LINES = 8
LEAST_LINE = 1e-3
# Periods of a line, or of the beat of two, that the picture must hold for them to be told apart.
LEAST_PERIODS = 1.5


@dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """A moving grating's lines in a sequence.

    Attributes
    ----------
    grating : MovingGrating
    harmonics : (K,) int
        Of the grating that have a line of their own; the first is 1 but where that flashes in place.
    seen : (K, 2) float64
        Frequency vectors (x, y) in the picture, in [-1/2, 1/2) cycles per pixel.
    coefficients : (seeds, frames, K) complex128
        c_k: the picture has sum_k c_k exp(2 pi i seen_k x) and its conjugate, in units of the contrast.
    """

    grating: MovingGrating
    harmonics: FloatArray
    seen: FloatArray
    coefficients: ComplexArray


def wrapped(cycles: FloatArray) -> FloatArray:
    """Return cycles less the nearest whole number, in [-1/2, 1/2)."""
    out: FloatArray = cycles - np.floor(cycles + 0.5)
    return out


def all_lines(signals: Signals, which: Literal["test", "error"]) -> list[Lines]:
    """Return the lines of all gratings that a pan moves, fitted together; a list for each that may have none."""
    picture = signals.test if which == "test" else signals.error
    return signals.once(f"lines of {which}", lambda: _find_lines(signals, picture))


def _find_lines(signals: Signals, picture: FloatArray) -> list[Lines]:
    gratings = moving_gratings(signals)
    size = np.array(picture.shape[:-3:-1])
    found: list[tuple[int, int, FloatArray]] = []
    wanted = [(k, number) for number, grating in enumerate(gratings) for k in _strong_harmonics(grating)]
    for k, number in sorted(wanted):
        seen = wrapped(k * np.array(gratings[number].frequency))
        # Also from the mean and its own mirror image: a line at 0 or half a cycle a pixel flashes in place.
        others = [0.0 * seen, -seen, *(sign * other for _, _, other in found for sign in (1.0, -1.0))]
        if all(np.any(np.abs(wrapped(seen - other)) * size >= LEAST_PERIODS) for other in others):
            found.append((number, k, seen))
    places = np.array([seen for _, _, seen in found]).reshape(-1, 2)
    coefficients = fit_lines(picture, places)
    out = []
    for number, grating in enumerate(gratings):
        own = [i for i, (owner, _, _) in enumerate(found) if owner == number]
        harmonics = np.array([found[i][1] for i in own], dtype=np.float64)
        out.append(Lines(grating, harmonics, places[own], coefficients[..., own]))
    return out


def _strong_harmonics(grating: MovingGrating) -> list[int]:
    if grating.amplitudes is None:
        return [1]
    strong = np.flatnonzero(grating.amplitudes >= LEAST_LINE * grating.amplitudes.max()) + 1
    return [int(k) for k in strong[:MOST_LINES]]


def fit_lines(picture: FloatArray, places: FloatArray) -> ComplexArray:
    """Return coefficients (seeds, frames, K) of lines in pictures (seeds, frames, h, w).

    Least squares of a constant and the lines with their mirror images, weighted by a window of squared sines, which
    keeps out what the picture has besides: exact where it has nothing else, whatever its size.

    Parameters
    ----------
    picture : (seeds, frames, h, w) float64
    places : (K, 2) float64
        Frequencies (x, y), cycles per pixel; each of them apart from the others and from its mirror image.
    """
    seeds, frames, height, width = picture.shape
    if not len(places):
        return np.zeros((seeds, frames, 0), dtype=np.complex128)
    weights = [_window(width), _window(height)]
    waves = [np.exp(-2j * np.pi * np.outer(np.arange(n), f)) for n, f in zip((width, height), places.T, strict=True)]
    along = weights[0][:, None] * waves[0]
    # Real products, which run at the speed of the machine's matrix product.
    columns = np.concatenate([weights[0][:, None], along.real, along.imag], axis=1)
    rows = (picture.reshape(-1, width) @ columns).reshape(-1, height, columns.shape[1])
    count = len(places)
    partial = rows[..., 1 : count + 1] + 1j * rows[..., count + 1 :]
    lines = np.einsum("fhk,hk->fk", partial, weights[1][:, None] * waves[1])
    mean = np.einsum("fh,h->f", rows[..., 0], weights[1])
    products = np.concatenate([mean[:, None], lines, lines.conj()], axis=1)
    every = np.concatenate([np.zeros((1, 2)), places, -places])
    apart = every[None, :, :] - every[:, None, :]
    gram = _transform(weights[0], apart[..., 0]) * _transform(weights[1], apart[..., 1])
    solved = np.linalg.solve(gram, products.T).T
    return np.asarray(solved[:, 1 : count + 1].reshape(seeds, frames, count), dtype=np.complex128)


def _window(side: int) -> FloatArray:
    out: FloatArray = np.sin(np.pi * (np.arange(side) + 0.5) / side) ** 2
    return out / np.sum(out)


def _transform(weights: FloatArray, frequencies: FloatArray) -> ComplexArray:
    """Return sum_j w_j exp(2 pi i f j) at frequencies of any shape."""
    out: ComplexArray = np.exp(2j * np.pi * frequencies[..., None] * np.arange(weights.size)) @ weights
    return out
