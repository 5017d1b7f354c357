"""Zone plates as images: exact area averages over the part of the texture that surfaces show.

A zone plate never repeats, so it has no period to bake: the image covers a range of uv, and its frequency grows with
the distance from its middle, so that no number of samples to a texel would be enough everywhere. Its mean over a texel
has a closed form: cos(k (x^2 + y^2) + phase) is a sum of products of functions of x and of y alone, whose integrals are
Fresnel's. Every level is made from these and not from the level before.
"""

import math

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.model import FloatArray, Vec2, ZonePlate, read_only

FINEST = 1024.0  # texels to one unit of uv; fewer, by powers of two, where the range is large
MOST_TEXELS, LONGEST = 2**23, 8192  # of the finest level: 128 megabytes, and what graphics devices usually take
LEAST_TEXELS = 2**17  # that every plate gets: room for 4 x 4 cells is enough for any range
CELL = 64  # texels: the image has whole cells of them, that coarser levels fit pixels wherever the finest does


def plate_levels(
    plate: ZonePlate, low: Vec2, high: Vec2, plates: int = 1
) -> tuple[tuple[NDArray[np.float32], ...], FloatArray]:
    """Return mip levels whose texels are the plate's means over their areas, and the map to the image's coordinates.

    Parameters
    ----------
    plate : ZonePlate
    low, high : Vec2
        Range of uv that is looked at. The image covers it with 64 texels or more to spare on every side, and repeats
        beyond.
    plates : int
        How many share the texels that are allowed.

    Returns
    -------
    levels : tuple of (h, w, 4) float32
        Row 0 at the least v, each half the size (rounded down, at least 1) of the one before.
    uv_matrix : (2, 3) float64
        Takes (u, v, 1) to 0..1 in the image.
    """
    first, cells, side = _laid_out(low, high, max(MOST_TEXELS // plates, LEAST_TEXELS))
    start, extent = first * side, cells * side
    width, height = (int(n) * CELL for n in cells)
    levels = []
    while True:
        cos_u, sin_u = _means(plate.k, start[0] - plate.center[0], extent[0], width)
        cos_v, sin_v = _means(plate.k, start[1] - plate.center[1], extent[1], height)
        c, s = math.cos(plate.phase), math.sin(plate.phase)
        rows = np.stack([c * cos_v - s * sin_v, -c * sin_v - s * cos_v], axis=1)
        level = np.ones((height, width, 4), np.float32)
        level[..., :3] = (0.5 + 0.5 * (rows @ np.stack([cos_u, sin_u])))[..., None]
        levels.append(read_only(level))
        if width == height == 1:
            break
        width, height = max(1, width // 2), max(1, height // 2)
    matrix = np.array([[1 / extent[0], 0.0, -start[0] / extent[0]], [0.0, 1 / extent[1], -start[1] / extent[1]]])
    return tuple(levels), matrix


def _laid_out(low: Vec2, high: Vec2, most: int) -> tuple[FloatArray, FloatArray, float]:
    """Return the image's first cell and number of cells, each (2,) along u and v, and a cell's side in uv."""
    side = CELL / FINEST
    while True:
        first = np.floor(np.asarray(low) / side) - 1.0
        cells = np.ceil(np.asarray(high) / side) + 1.0 - first
        if cells.max() * CELL <= LONGEST and cells.prod() * CELL**2 <= most:
            return first, cells, side
        side *= 2.0


def _means(k: float, start: float, extent: float, count: int) -> tuple[FloatArray, FloatArray]:
    """Return the means (count,) of cos(k x^2) and sin(k x^2) over equal parts of start <= x <= start + extent."""
    # Half a second of start-up, for the few scenes that need it.
    from scipy.special import fresnel

    if k == 0.0:
        return np.ones(count), np.zeros(count)
    scale = math.sqrt(2.0 * abs(k) / math.pi)
    sines, cosines = fresnel(scale * (start + extent * np.arange(count + 1) / count))
    part = scale * extent / count
    return np.diff(cosines) / part, math.copysign(1.0, k) * np.diff(sines) / part
