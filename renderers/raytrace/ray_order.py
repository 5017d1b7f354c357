"""Samples of a row in the order of time, or of places on the lens: a packet of like rays is traced faster.

The 16 samples of a pixel are spread over the whole shutter. In the frame of a body that turns meanwhile, their rays
start all around it, and a packet has to look at everything between; so it has when they come from all over a lens. So
256 samples of neighbouring pixels are sorted, traced in packets of 16, and put back where they belong: pictures are the
same to the last bit.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import inlined
from aliasbench.renderers.raytrace.lanes import BLUE, GREEN, LANES, LENS_X, LENS_Y, PX, PY, RED, SIGN, TIME
from aliasbench.scenes.model import FloatArray

PACKETS = 16
SAMPLES = PACKETS * LANES
_BUCKETS, _SIDE = 64, 8
_PLACES = 6  # rows of `Block.places`


class Block(NamedTuple):
    """Some packets of samples: places (_PLACES, SAMPLES), colours (3, SAMPLES), and numbers in the order of time."""

    places: FloatArray
    colors: FloatArray
    order: NDArray[np.int64]
    ends: NDArray[np.int64]


def make_block() -> Block:
    """Return room for a block."""
    return Block(
        np.zeros((_PLACES, SAMPLES)),
        np.zeros((3, SAMPLES)),
        np.zeros(SAMPLES, np.int64),
        np.zeros(_BUCKETS + 1, np.int64),
    )


@inlined
def put_packet(block: Block, packet: int, scratch: FloatArray) -> None:
    """Keep a packet's places, times, lens points and signs."""
    at = packet * LANES
    for i in range(LANES):
        block.places[0, at + i], block.places[1, at + i] = scratch[PX + i], scratch[PY + i]
        block.places[2, at + i], block.places[3, at + i] = scratch[TIME + i], scratch[LENS_X + i]
        block.places[4, at + i], block.places[5, at + i] = scratch[LENS_Y + i], scratch[SIGN + i]


@inlined
def sort_block(block: Block, count: int, lens_radius: float) -> None:
    """Write the numbers of the first `count` samples in the order of time, to a part in 64 of the shutter.

    If `lens_radius` is not 0, in the order of 8 x 8 squares of the lens.
    """
    ends, order = block.ends, block.order
    for b in range(_BUCKETS + 1):
        ends[b] = 0
    for k in range(count):
        ends[1 + _bucket(block, k, lens_radius)] += 1
    for b in range(_BUCKETS):
        ends[b + 1] += ends[b]
    for k in range(count):
        b = _bucket(block, k, lens_radius)
        order[ends[b]] = k
        ends[b] += 1


@inlined
def _bucket(block: Block, k: int, lens_radius: float) -> int:
    if lens_radius == 0.0:
        return int(block.places[2, k] * _BUCKETS) & (_BUCKETS - 1)
    scale = 0.5 * _SIDE / lens_radius
    across = int((block.places[3, k] + lens_radius) * scale)
    return (int((block.places[4, k] + lens_radius) * scale) * _SIDE + across) & (_BUCKETS - 1)


@inlined
def take_sorted(block: Block, packet: int, lanes: int, scratch: FloatArray) -> None:
    """Write the places of a packet in the order of time; lanes without a sample repeat the last one."""
    for i in range(LANES):
        k = block.order[packet * LANES + min(i, lanes - 1)]
        scratch[PX + i], scratch[PY + i] = block.places[0, k], block.places[1, k]
        scratch[TIME + i], scratch[LENS_X + i] = block.places[2, k], block.places[3, k]
        scratch[LENS_Y + i] = block.places[4, k]


@inlined
def keep_colors(block: Block, packet: int, lanes: int, scratch: FloatArray) -> None:
    """Keep the colours of a packet in the order of time."""
    for i in range(lanes):
        k = block.order[packet * LANES + i]
        block.colors[0, k], block.colors[1, k] = scratch[RED + i], scratch[GREEN + i]
        block.colors[2, k] = scratch[BLUE + i]


@inlined
def restore_packet(block: Block, packet: int, scratch: FloatArray) -> None:
    """Write a packet's places, signs and colours in their first order."""
    at = packet * LANES
    for i in range(LANES):
        scratch[PX + i], scratch[PY + i] = block.places[0, at + i], block.places[1, at + i]
        scratch[SIGN + i] = block.places[5, at + i]
        scratch[RED + i], scratch[GREEN + i] = block.colors[0, at + i], block.colors[1, at + i]
        scratch[BLUE + i] = block.colors[2, at + i]
