"""Sums of a row of pixels under the box filter, the way most pictures are made: each sample counts in its own pixel."""

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import inlined
from aliasbench.renderers.raytrace.lanes import BLUE, GREEN, LANES, RED
from aliasbench.scenes.model import FloatArray


@inlined
def add_samples(
    samples: int, row: int, first: int, lanes: int, scratch: FloatArray, sums: FloatArray, out: NDArray[np.float32]
) -> None:
    """Add the lanes' colours to their pixels (see `fill_positions`), and write the pixels that are complete.

    `sums` (3,) float64 carries the pixel that is not complete yet.
    """
    column = first // samples
    index = first - column * samples
    if samples - index >= LANES:
        # In groups of four: a single chain of sixteen additions would be waited for.
        for k in range(3):
            at = RED + k * LANES
            total = sums[k]
            for i in range(4):
                total += (scratch[at + i] + scratch[at + i + 4]) + (scratch[at + i + 8] + scratch[at + i + 12])
            sums[k] = total
        if index + LANES == samples:
            _write_pixel(samples, row, column, sums, out)
        return
    lane = 0
    while lane < lanes:
        run = min(lanes - lane, samples - index)
        for k in range(lane, lane + run):
            sums[0] += scratch[RED + k]
            sums[1] += scratch[GREEN + k]
            sums[2] += scratch[BLUE + k]
        lane += run
        if index + run == samples:
            _write_pixel(samples, row, column, sums, out)
        column, index = column + 1, 0


@inlined
def _write_pixel(samples: int, row: int, column: int, sums: FloatArray, out: NDArray[np.float32]) -> None:
    """Write the mean of a pixel's samples, and start the sums of the next."""
    for k in range(3):
        out[row, column, k] = np.float32(sums[k] / samples)
        sums[k] = 0.0
