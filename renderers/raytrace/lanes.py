"""A packet of 16 samples on its way through the tracer: which pixels, which places and times, which rays.

Samples of a row are numbered pixel after pixel, and every 16 of them are one packet. With 16 samples a pixel (or a
multiple) a packet is of one pixel, which Embree traces three times faster than 16 pixels; with fewer it holds whole
neighbours, and any count wastes lanes only at the end of a row.

Lane values in float64 live in one scratch array, one row of 16 for each quantity, and rays in float32 in a second one
laid out as Embree's RTCRayHit16: two arrays, so that the compiler can tell that stores do not touch loads and
vectorises. Both renderings of a packet (`packets`, `portable`) share everything here.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.sampling.hashing import SHARED, combine, unit
from aliasbench.renderers.sampling.patterns import (
    CENTER,
    DIM_X,
    DIM_Y,
    GRID,
    JITTERED,
    RANDOM,
    cell_position,
    row_count,
    sampler_code,
    shutter_position,
)
from aliasbench.scenes.model import FloatArray

KeyArray = NDArray[np.uint64]
LANES = 16

# Over every sample number (2^24 at most): tells the compiler that none is negative, which spares a check for each lane.
_INDEX_MASK = 0x1FFFFFF

# Rows of the float64 scratch array, in lanes: image position, shutter position, ray, texture coordinates, distance.
PX, PY, TIME = 0, 16, 32
OX, OY, OZ, DX, DY, DZ = 48, 64, 80, 96, 112, 128
U, V = 144, 160
RED, GREEN, BLUE = 176, 192, 208
LX, LY, LZ, MX, MY, MZ = 224, 240, 256, 272, 288, 304  # the ray in a body's frame
LOD, DISTANCE = 320, 336
SCRATCH_SIZE = 352

# Rows of RTCRayHit16 (rtcore_ray.h), in lanes.
RAY_OX, RAY_OY, RAY_OZ, RAY_TNEAR, RAY_DX, RAY_DY, RAY_DZ, RAY_TIME = 0, 16, 32, 48, 64, 80, 96, 112
RAY_TFAR, RAY_MASK, RAY_ID, RAY_FLAGS = 128, 144, 160, 176
HIT_PRIM, HIT_GEOM, HIT_INSTANCE = 272, 288, 304
RAY_SIZE = 384

# Camera values: eye at the shutter's opening and its travel until closing (relative to the anchor), the unnormalised
# axis and its change, the up hint, the axes at opening, then scalars.
EYE, EYE_TRAVEL, AXIS, AXIS_TRAVEL, UP_HINT, RIGHT, UP, FORWARD = 0, 3, 6, 9, 12, 15, 18, 21
SCALE, PERSPECTIVE, CENTER_X, CENTER_Y, TURNING = 24, 25, 26, 27, 28
CAMERA_SIZE = 29


class Sampling(NamedTuple):
    """The sample pattern as data.

    Attributes
    ----------
    sampler, samples : int
        The sampler's number and how many samples a pixel has.
    start : uint64
        `frame_key` of seed and frame.
    shared : bool
        One pattern for all pixels.
    hashed : bool
        Whether positions need random numbers at all.
    cells : (4, samples) float64
        Left, top, width and height of each sample's cell in the unit square.
    """

    sampler: int
    samples: int
    start: np.uint64
    shared: bool
    hashed: bool
    cells: FloatArray


def build_sampling(name: str, samples: int, start: int, *, shared: bool) -> Sampling:
    """Return the pattern of `samples` samples a pixel under a sampler's name (see `patterns.SAMPLERS`)."""
    code = sampler_code(name)
    cells = np.zeros((4, samples))
    _fill_cells(code, samples, cells)
    return Sampling(code, samples, np.uint64(start), shared, code in (RANDOM, JITTERED), cells)


@njit(cache=True, error_model="numpy", _nrt=False)
def _fill_cells(sampler: int, samples: int, cells: FloatArray) -> None:
    rows = row_count(samples)
    for index in range(samples):
        if sampler == CENTER:
            cells[0, index], cells[1, index] = 0.5, 0.5
        elif sampler == RANDOM:
            cells[2, index], cells[3, index] = 1.0, 1.0
        elif sampler == GRID:
            cells[0, index], cells[1, index] = cell_position(index, samples, rows, 0.5, 0.5)
        else:
            x0, y0 = cell_position(index, samples, rows, 0.0, 0.0)
            x1, y1 = cell_position(index, samples, rows, 1.0, 1.0)
            cells[0, index], cells[1, index], cells[2, index], cells[3, index] = x0, y0, x1 - x0, y1 - y0


@njit(cache=True, error_model="numpy", _nrt=False)
def fill_columns(pattern: Sampling, keys: KeyArray) -> None:
    """Write what the keys of a column's pixels start from, once for a picture: `keys` (4, width), last row."""
    for column in range(keys.shape[1]):
        keys[3, column] = combine(pattern.start, SHARED if pattern.shared else column)


@njit(cache=True, error_model="numpy", _nrt=False)
def fill_keys(pattern: Sampling, row: int, keys: KeyArray) -> None:
    """Write the keys of a row's pixels: `keys` (4, width) gets those of the pattern and of its x and y.

    They are a chain of hashes, which costs less done for many pixels at once than on the way to each packet.
    `hashing.pixel_key` is the definition.
    """
    value = SHARED if pattern.shared else row
    for column in range(keys.shape[1]):
        key = combine(keys[3, column], value)
        keys[0, column], keys[1, column], keys[2, column] = key, combine(key, DIM_X), combine(key, DIM_Y)


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def _fill_run(
    pattern: Sampling, keys: KeyArray, row: int, column: int, index: int, lane: int, run: int, scratch: FloatArray
) -> None:
    """Write the image positions of `run` samples of one pixel from sample `index` on, in lanes from `lane` on."""
    if pattern.hashed:
        key_x, key_y = keys[1, column], keys[2, column]
        for k in range(run):
            i = (index + k) & _INDEX_MASK
            scratch[PX + lane + k] = column + (pattern.cells[0, i] + pattern.cells[2, i] * unit(key_x, i))
        for k in range(run):
            i = (index + k) & _INDEX_MASK
            scratch[PY + lane + k] = row + (pattern.cells[1, i] + pattern.cells[3, i] * unit(key_y, i))
    else:
        for k in range(run):
            i = (index + k) & _INDEX_MASK
            scratch[PX + lane + k] = column + pattern.cells[0, i]
            scratch[PY + lane + k] = row + pattern.cells[1, i]


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def fill_positions(pattern: Sampling, keys: KeyArray, row: int, first: int, lanes: int, scratch: FloatArray) -> None:
    """Write the image positions of `lanes` samples of a row from its sample number `first` on."""
    column = first // pattern.samples
    index = (first - column * pattern.samples) & _INDEX_MASK
    if pattern.samples - index >= LANES:
        # A loop of constant length is what the compiler vectorises best, and this is the common case.
        _fill_run(pattern, keys, row, column, index, 0, LANES, scratch)
        return
    lane = 0
    while lane < lanes:
        run = min(lanes - lane, pattern.samples - index)
        _fill_run(pattern, keys, row, column, index, lane, run, scratch)
        lane += run
        column, index = column + 1, 0


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def fill_times(pattern: Sampling, keys: KeyArray, first: int, lanes: int, scratch: FloatArray) -> None:
    """Write the shutter positions of `lanes` samples of a row from its sample number `first` on."""
    column, index = first // pattern.samples, first % pattern.samples
    for lane in range(lanes):
        scratch[TIME + lane] = shutter_position(pattern.sampler, pattern.samples, index, keys[0, column])
        index += 1
        if index == pattern.samples:
            column, index = column + 1, 0


@njit(cache=True, error_model="numpy", _nrt=False)
def write_ray(
    scratch: FloatArray, ray: NDArray[np.float32], i: int, perspective: float,
    ex: float, ey: float, ez: float, px: float, py: float, pz: float, fx: float, fy: float, fz: float,
) -> None:  # fmt: skip
    """Write the ray of lane i: from the eye e (plus the image plane's point p if parallel) along f (plus p if not)."""
    parallel = 1.0 - perspective
    ox, oy, oz = ex + parallel * px, ey + parallel * py, ez + parallel * pz
    dx, dy, dz = fx + perspective * px, fy + perspective * py, fz + perspective * pz
    scratch[OX + i], scratch[OY + i], scratch[OZ + i] = ox, oy, oz
    scratch[DX + i], scratch[DY + i], scratch[DZ + i] = dx, dy, dz
    ray[RAY_OX + i], ray[RAY_OY + i], ray[RAY_OZ + i] = np.float32(ox), np.float32(oy), np.float32(oz)
    ray[RAY_DX + i], ray[RAY_DY + i], ray[RAY_DZ + i] = np.float32(dx), np.float32(dy), np.float32(dz)


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def fill_rays(camera: FloatArray, scratch: FloatArray, ray: NDArray[np.float32]) -> None:
    """Write the rays of all 16 lanes through their image positions, for a camera that stands still."""
    step = 1.0 / camera[SCALE]
    cx, cy, perspective = camera[CENTER_X], camera[CENTER_Y], camera[PERSPECTIVE]
    ex, ey, ez = camera[EYE], camera[EYE + 1], camera[EYE + 2]
    rx, ry, rz = camera[RIGHT], camera[RIGHT + 1], camera[RIGHT + 2]
    ux, uy, uz = camera[UP], camera[UP + 1], camera[UP + 2]
    fx, fy, fz = camera[FORWARD], camera[FORWARD + 1], camera[FORWARD + 2]
    for i in range(LANES):
        a = (scratch[PX + i] - cx) * step
        b = (cy - scratch[PY + i]) * step
        px, py, pz = a * rx + b * ux, a * ry + b * uy, a * rz + b * uz
        write_ray(scratch, ray, i, perspective, ex, ey, ez, px, py, pz, fx, fy, fz)


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def fill_moving_rays(camera: FloatArray, scratch: FloatArray, ray: NDArray[np.float32]) -> None:
    """Write the rays of all 16 lanes for a camera that moves, each from where the camera is at the lane's time."""
    step = 1.0 / camera[SCALE]
    cx, cy, perspective = camera[CENTER_X], camera[CENTER_Y], camera[PERSPECTIVE]
    rx, ry, rz = camera[RIGHT], camera[RIGHT + 1], camera[RIGHT + 2]
    ux, uy, uz = camera[UP], camera[UP + 1], camera[UP + 2]
    fx, fy, fz = camera[FORWARD], camera[FORWARD + 1], camera[FORWARD + 2]
    hx, hy, hz = camera[UP_HINT], camera[UP_HINT + 1], camera[UP_HINT + 2]
    turning = camera[TURNING] != 0.0
    for i in range(LANES):
        time = scratch[TIME + i]
        if turning:
            fx = camera[AXIS] + time * camera[AXIS_TRAVEL]
            fy = camera[AXIS + 1] + time * camera[AXIS_TRAVEL + 1]
            fz = camera[AXIS + 2] + time * camera[AXIS_TRAVEL + 2]
            inverse = 1.0 / np.sqrt(fx * fx + fy * fy + fz * fz)
            fx, fy, fz = fx * inverse, fy * inverse, fz * inverse
            rx, ry, rz = fy * hz - fz * hy, fz * hx - fx * hz, fx * hy - fy * hx
            inverse = 1.0 / np.sqrt(rx * rx + ry * ry + rz * rz)
            rx, ry, rz = rx * inverse, ry * inverse, rz * inverse
            ux, uy, uz = ry * fz - rz * fy, rz * fx - rx * fz, rx * fy - ry * fx
        ex = camera[EYE] + time * camera[EYE_TRAVEL]
        ey = camera[EYE + 1] + time * camera[EYE_TRAVEL + 1]
        ez = camera[EYE + 2] + time * camera[EYE_TRAVEL + 2]
        a = (scratch[PX + i] - cx) * step
        b = (cy - scratch[PY + i]) * step
        px, py, pz = a * rx + b * ux, a * ry + b * uy, a * rz + b * uz
        write_ray(scratch, ray, i, perspective, ex, ey, ez, px, py, pz, fx, fy, fz)


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
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


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def _write_pixel(samples: int, row: int, column: int, sums: FloatArray, out: NDArray[np.float32]) -> None:
    """Write the mean of a pixel's samples, and start the sums of the next."""
    for k in range(3):
        out[row, column, k] = np.float32(sums[k] / samples)
        sums[k] = 0.0


def aligned_floats(count: int) -> NDArray[np.float32]:
    """Return `count` zeros that start on a multiple of 64 bytes, as Embree's packets must."""
    memory = np.zeros(count + 16, np.float32)
    skip = -memory.ctypes.data % 64 // 4
    return memory[skip : skip + count]
