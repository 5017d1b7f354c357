"""Times and lens points of a film's packets: the dimensions beside the place in the picture that blur it."""

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import called
from aliasbench.renderers.raytrace.film import RUN_LANE, RUN_LANES, RUN_PIXEL, Film, IntArray, run_address
from aliasbench.renderers.raytrace.lanes import LANES, LENS_X, LENS_Y, PX, PY, TIME
from aliasbench.renderers.raytrace.positions import KeyArray, fill_line, fill_plane
from aliasbench.renderers.sampling.bits import hidden
from aliasbench.renderers.sampling.discs import disc_point
from aliasbench.renderers.sampling.patterns import DIM_LENS, DIM_TIME, Pattern
from aliasbench.scenes.model import FloatArray

# As they stand in calls; see `patterns` on such integers.
TIMES, ONE = np.int64(TIME), np.int64(1)
LENS_U, LENS_V = np.int64(LENS_X), np.int64(LENS_Y)


@called
def fill_film_times(
    pattern: Pattern, film: Film, keys: KeyArray, r: int, runs: IntArray, count: int, numbers: NDArray[np.int64],
    scratch: FloatArray,
) -> None:  # fmt: skip
    """Write the shutter positions of a packet's samples."""
    for n in range(count):
        run = runs[n]
        key, size, index = run_address(pattern, film, keys, r, run)
        column, row = film.column + run[RUN_PIXEL], film.row + r
        fill_line(
            pattern, size, key, column, row, DIM_TIME, index, run[RUN_LANE], run[RUN_LANES], numbers, scratch, TIMES
        )


@called
def fill_film_lens(
    pattern: Pattern, film: Film, keys: KeyArray, r: int, runs: IntArray, count: int, numbers: NDArray[np.int64],
    radius: float, scratch: FloatArray,
) -> None:  # fmt: skip
    """Write the points of a packet's samples on a lens of a radius, in world units."""
    for n in range(count):
        run = runs[n]
        key, size, index = run_address(pattern, film, keys, r, run)
        column, row = film.column + run[RUN_PIXEL], film.row + r
        fill_plane(
            pattern, size, key, column, row, DIM_LENS, index, ONE, run[RUN_LANE], run[RUN_LANES], numbers, scratch,
            LENS_U, LENS_V,
        )  # fmt: skip
    for i in range(hidden(LANES)):
        x, y = disc_point(scratch[LENS_X + i], scratch[LENS_Y + i])
        scratch[LENS_X + i], scratch[LENS_Y + i] = radius * x, radius * y


@called
def picture_reach(scratch: FloatArray, lanes: int) -> tuple[float, float, float, float]:
    """Return left, right, top and bottom of a packet's image positions."""
    left, right, top, bottom = np.inf, -np.inf, np.inf, -np.inf
    for i in range(lanes):
        left, right = min(left, scratch[PX + i]), max(right, scratch[PX + i])
        top, bottom = min(top, scratch[PY + i]), max(bottom, scratch[PY + i])
    return left, right, top, bottom
