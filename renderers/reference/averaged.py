"""Averages of pictures over the lens and the open shutter: what takes over where no closed form is known.

A picture through one point of the lens at one instant is exact or an unbiased estimate (`snapshots`); the mean over
lens and shutter is taken at the points of an Owen-scrambled Sobol sequence (Owen 1995; scrambled by hashing, Laine and
Karras 2011), whose error falls faster than 1 / n for what varies continuously, as a pixel's value does. The square is
mapped to the disc by (sqrt(u), 2 pi v), which keeps areas. The mean of independent replicates comes with Student's
interval of 99 % confidence for all pixels at once (Bonferroni). Their size follows from a pilot, whose pictures count
for nothing else: choosing by the very pictures that are averaged would make the interval too short.
"""

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit
from scipy.stats import qmc

from aliasbench.renderers.reference.cache import Stored
from aliasbench.renderers.sampling.hashing import combine
from aliasbench.scenes.model import FloatArray

REPLICATES = 16
TARGET = 3e-4  # the interval aimed at
_CONFIDENCE = 0.99
_PILOT, _MOST = 16, 2**16  # points of a replicate
_BUDGET = 2.4e10  # nanoseconds of one core, by the prices of `Pictures`: constants, so that clocks choose nothing
# Points of all replicates that may miss what a pixel shows from a small part of lens and shutter; no spread tells of it
_MISSED = 4.0


class Pictures(Protocol):
    """Pictures of a scene at places of lens and shutter."""

    @property
    def size(self) -> tuple[int, int]: ...

    @property
    def contrast(self) -> float:
        """The largest difference between two values of a pixel."""
        ...

    def add(self, places: FloatArray, seed: int, out: FloatArray) -> float:
        """Add the pictures at `places` (n, 3) (see `lens_places`) to `out`; return a bound on the error of any."""
        ...

    def price(self) -> float:
        """Return what the pictures added so far took on average, in nanoseconds of one core, counted and not timed."""
        ...


def average(pictures: Pictures, *, lens_radius: float, shutter: tuple[float, float], key: int) -> Stored:
    """Return the mean over lens and shutter with its interval.

    Parameters
    ----------
    pictures : Pictures
    lens_radius : float
        World units, 0 for a pinhole.
    shutter : (float, float)
        First and last fraction of the frame interval; equal for an instant.
    key : int
        What the points depend on: the same for the same reference.
    """

    def make(replicate: int, count: int, stage: int) -> tuple[FloatArray, float]:
        seed = int(combine(combine(combine(0x1E45, key), stage), replicate))
        out = np.zeros((pictures.size[1], pictures.size[0], 3))
        bound = pictures.add(lens_places(count, lens_radius, shutter, seed), seed, out)
        return out / count, bound

    # a single place needs more than one picture only if they are estimates, whose error falls slowly
    still = lens_radius == 0.0 and shutter[0] == shutter[1]
    first, order = (1, 2) if still else (_PILOT, 1)
    _, interval, _ = _replicates(lambda r: make(r, first, 0))
    affordable = _BUDGET / REPLICATES / pictures.price()
    wanted = first * (interval / TARGET) ** order + _MISSED * pictures.contrast / TARGET / REPLICATES
    count = 2 ** max(0, round(math.log2(max(first, min(wanted * 1.5, affordable, _MOST)))))
    mean, interval, bound = _replicates(lambda r: make(r, count, 1))
    missed = _MISSED * pictures.contrast / (REPLICATES * count)
    return Stored(mean, interval + missed + bound, REPLICATES * count * pictures.size[0] * pictures.size[1])


def _replicates(make: "_Maker") -> tuple[FloatArray, float, float]:
    """Return the replicates' mean, the longest interval of any value, and the largest bound on their own errors."""
    mean, largest = np.zeros(()), 0.0
    spread = np.zeros(())
    for replicate in range(REPLICATES):
        picture, bound = make(replicate)
        change = picture - mean
        mean = mean + change / (replicate + 1)
        spread = spread + change * (picture - mean)
        largest = max(largest, bound)
    error = float(np.sqrt(spread.max() / (REPLICATES - 1) / REPLICATES))
    quantile = -float(stdtrit(REPLICATES - 1, (1 - _CONFIDENCE) / (2 * mean.size)))
    return mean, quantile * error, largest


class _Maker(Protocol):
    def __call__(self, replicate: int, /) -> tuple[FloatArray, float]: ...


def lens_places(count: int, lens_radius: float, shutter: tuple[float, float], seed: int) -> FloatArray:
    """Return places spread evenly over lens and shutter, (count, 3): world units right and up, fraction of the frame.

    Parameters
    ----------
    count : int
        A power of two.
    lens_radius, shutter
        See `average`.
    seed : int
    """
    u = scrambled_sobol(count, 3, seed)
    # an open shutter alone takes the first and best dimension
    radius, angle, time = (u[:, 0], u[:, 1], u[:, 2]) if lens_radius > 0.0 else (u[:, 1], u[:, 2], u[:, 0])
    length, turn = lens_radius * np.sqrt(radius), 2 * np.pi * angle
    return np.stack(
        [length * np.cos(turn), length * np.sin(turn), shutter[0] + (shutter[1] - shutter[0]) * time], axis=1
    )


def scrambled_sobol(count: int, dimensions: int, seed: int) -> FloatArray:
    """Return the first `count` (a power of two) points of a scrambled Sobol sequence in the unit cube."""
    plain = qmc.Sobol(dimensions, scramble=False, bits=32).random_base2(count.bit_length() - 1)
    digits = (plain * 2.0**32).astype(np.uint32)
    out = np.empty((count, dimensions))
    for k in range(dimensions):
        # a dimension's lowest digits come from a seed of its own, at random
        out[:, k] = _scramble(digits[:, k], int(combine(seed, k))) * 2.0**-32 + 2.0**-33
    return out


def _scramble(digits: NDArray[np.uint32], seed: int) -> NDArray[np.uint32]:
    """Return digits each of which is flipped by a hash of those before it (Laine and Karras, Vegdahl's constants)."""
    x = _reverse(digits)
    x = x ^ (x * np.uint32(0x3D20ADEA))
    x = x + np.uint32(seed)
    x = x * np.uint32((seed >> 16) | 1)
    x = x ^ (x * np.uint32(0x05526C56))
    x = x ^ (x * np.uint32(0x53A22864))
    return _reverse(x)


def _reverse(x: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Return the bits in reverse order."""
    for shift, mask in ((1, 0x55555555), (2, 0x33333333), (4, 0x0F0F0F0F), (8, 0x00FF00FF)):
        x = ((x >> np.uint32(shift)) & np.uint32(mask)) | ((x & np.uint32(mask)) << np.uint32(shift))
    return (x >> np.uint32(16)) | (x << np.uint32(16))
