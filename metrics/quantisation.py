"""Samples as few bits: rounding is a part of sampling, and dither trades its structure for noise.

Without dither the error is a function of the signal, so that a slow wave turns into steps. Uniform dither of one step
makes the mean error zero at every value, triangular dither of two makes its variance the same at every value too
(Lipshitz, Wannamaker and Vanderkooy 1992). None of it is taken off again afterwards, as no display does.
"""

import math
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aliasbench.scenes.errors import InputError, unknown_name
from aliasbench.scenes.model import FloatArray
from aliasbench.scenes.textures import linear_to_srgb, srgb_to_linear

Dither = Literal["none", "uniform", "triangular"]
Encoding = Literal["linear", "srgb"]
MOST_BITS = 24


def quantise(
    values: ArrayLike,
    bits: int = 8,
    dither: Dither = "none",
    seed: int = 0,
    encoding: Encoding = "linear",
) -> FloatArray:
    """Return values as they come back after being stored in a few bits; of the shape of `values`.

    Values are clamped to [0, 1], encoded, dithered, rounded to the nearest of 2^bits levels (half to even), clamped to
    the levels there are, and decoded again.

    Parameters
    ----------
    values : (...) float
        Linear light, finite.
    bits : int
        1 to 24.
    dither : {"none", "uniform", "triangular"}
        What is added before rounding, in steps: nothing; uniform in [-1/2, 1/2); the sum of two such. Within half a
        step (uniform) or one step (triangular) of 0 and 1 the clamp takes part of the noise, and the mean is not kept.
    seed : int
        At least 0. Noise depends on it and on a value's place in the array, not on the value.
    encoding : {"linear", "srgb"}
        What the levels are evenly spaced in: light itself, or its sRGB encoding as in PNG files. Dither keeps the mean
        of what is stored: under "srgb" that is the encoded value, and the mean of the light is slightly more.

    Raises
    ------
    InputError
        For other options, or values that are not finite.
    """
    for what, given, known in (("dither", dither, get_args(Dither)), ("encoding", encoding, get_args(Encoding))):
        if given not in known:
            raise unknown_name(what, str(given), known)
    if isinstance(bits, bool) or not isinstance(bits, (int, np.integer)) or not 1 <= bits <= MOST_BITS:
        raise InputError(f"bits = {bits}: must be a whole number from 1 to {MOST_BITS}")
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or not 0 <= seed < 2**63:
        raise InputError(f"seed = {seed}: must be a whole number from 0 to 2^63 - 1")
    light = np.asarray(values, dtype=np.float64)
    if not np.isfinite(light).all():
        raise InputError("values: one is not finite; finite numbers are needed")
    light = np.clip(light, 0.0, 1.0)
    top = float(2**bits - 1)
    stored = top * (linear_to_srgb(light) if encoding == "srgb" else light)
    for stream in range({"none": 0, "uniform": 1, "triangular": 2}[dither]):
        stored = stored + dither_noise(light.shape, int(seed), stream)
    # + 0.0: rounding leaves zeros of either sign
    level = np.clip(np.rint(stored), 0.0, top) / top + 0.0
    out: FloatArray = srgb_to_linear(level) if encoding == "srgb" else level
    return out


def dither_noise(shape: tuple[int, ...], seed: int, stream: int) -> FloatArray:
    """Return uniform noise in [-1/2, 1/2): a hash of (seed, stream, place in the array).

    SplitMix64's finaliser (Steele, Lea and Flood 2014) over a counter, twice, so that neighbouring seeds are unrelated.
    """
    place = np.arange(math.prod(shape), dtype=np.uint64)
    key = _mixed(_mixed(np.array([seed], dtype=np.uint64)) + np.uint64(stream))
    bits = _mixed(_mixed(place) ^ key)
    uniform = (bits >> np.uint64(11)).astype(np.float64) * 2.0**-53 - 0.5
    return uniform.reshape(shape)


def _mixed(z: NDArray[np.uint64]) -> NDArray[np.uint64]:
    z = z + np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


def quantisation_rms(bits: int = 8, dither: Dither = "none") -> float:
    """Return the RMS error of linear quantisation of a signal whose values fall anywhere between two levels alike.

    In steps of 1 / (2^bits - 1): sqrt(1/12) without dither, sqrt(1/12 + 1/12) with uniform dither (at a value the
    share p of the way between two levels it is sqrt(p (1 - p))), sqrt(1/12 + 2/12) = 1/2 with triangular dither, which
    is the same at every value.
    """
    if dither not in get_args(Dither):
        raise unknown_name("dither", str(dither), get_args(Dither))
    variance = {"none": 1.0, "uniform": 2.0, "triangular": 3.0}[dither] / 12.0
    return math.sqrt(variance) / float(2**bits - 1)
