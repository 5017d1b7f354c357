"""A packet of 16 samples on its way through the tracer: where its numbers lie, and which rays it sends.

Lane values in float64 live in one scratch array, one row of 16 for each quantity, and rays in float32 in a second one
laid out as Embree's RTCRayHit16: two arrays, so that the compiler can tell that stores do not touch loads and
vectorises. Both renderings of a packet (`packets`, `portable`) share everything here.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import called, inlined
from aliasbench.scenes.model import FloatArray

LANES = 16

# Rows of the float64 scratch array, in lanes: image position, shutter position, ray, texture coordinates, distance.
PX, PY, TIME = 0, 16, 32
OX, OY, OZ, DX, DY, DZ = 48, 64, 80, 96, 112, 128
U, V = 144, 160
RED, GREEN, BLUE = 176, 192, 208
LX, LY, LZ, MX, MY, MZ = 224, 240, 256, 272, 288, 304  # the ray in a body's frame
LOD, DISTANCE = 320, 336
LENS_X, LENS_Y, SIGN = 352, 368, 384  # the point on the lens in world units; the sign of a sample's weight
S_RIGHT, R_RIGHT, S_UP, R_UP = 400, 416, 432, 448  # how texture coordinates move along a sample's footprint
SCRATCH_SIZE = 464

# Rows of RTCRayHit16 (rtcore_ray.h), in lanes.
RAY_OX, RAY_OY, RAY_OZ, RAY_TNEAR, RAY_DX, RAY_DY, RAY_DZ, RAY_TIME = 0, 16, 32, 48, 64, 80, 96, 112
RAY_TFAR, RAY_MASK, RAY_ID, RAY_FLAGS = 128, 144, 160, 176
HIT_PRIM, HIT_GEOM, HIT_INSTANCE = 272, 288, 304
RAY_SIZE = 384

# Camera values: eye at the shutter's opening and its travel until closing (relative to the anchor), the unnormalised
# axis and its change, the up hint, the axes at opening, then scalars.
EYE, EYE_TRAVEL, AXIS, AXIS_TRAVEL, UP_HINT, RIGHT, UP, FORWARD = 0, 3, 6, 9, 12, 15, 18, 21
SCALE, PERSPECTIVE, CENTER_X, CENTER_Y, TURNING = 24, 25, 26, 27, 28
LENS_RADIUS, FOCUS = 29, 30  # a focus of 0 is the distance of the target, at any time
START = 31  # the depth at which rays start
CAMERA_SIZE = 32


@called
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


@called
def _start_ahead(depth: float, scratch: FloatArray, ray: NDArray[np.float32]) -> None:
    """Have the rays of all lanes start at a depth, to which they are followed in float64."""
    for k in range(0, 3 * LANES, LANES):
        for i in range(LANES):
            ray[RAY_OX + k + i] = np.float32(scratch[OX + k + i] + depth * scratch[DX + k + i])


@inlined
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
    if camera[START] > 0.0:
        _start_ahead(camera[START], scratch, ray)


@called
def start_rays(camera: FloatArray, scratch: FloatArray, ray: NDArray[np.float32]) -> None:
    """Write what all rays of a camera that stands still share: the eye, or the direction of parallel rays."""
    is_pinhole = camera[PERSPECTIVE] == 1.0
    row, at, shared = (OX, RAY_OX, EYE) if is_pinhole else (DX, RAY_DX, FORWARD)
    for k in range(3):
        for i in range(LANES):
            scratch[row + k * LANES + i] = camera[shared + k]
            ray[at + k * LANES + i] = np.float32(camera[shared + k])


@inlined
def fill_changing_rays(camera: FloatArray, scratch: FloatArray, ray: NDArray[np.float32]) -> None:
    """Do what `fill_rays` does where `start_rays` has been and nothing else has written rays since."""
    if camera[PERSPECTIVE] == 1.0:
        _fill_rows(camera, scratch, ray, DX, RAY_DX, FORWARD)
    else:
        _fill_rows(camera, scratch, ray, OX, RAY_OX, EYE)
    if camera[START] > 0.0:
        _start_ahead(camera[START], scratch, ray)


# With the rows known before it is optimised, which `inlined` would not do: 4 % of a picture's time.
@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def _fill_rows(
    camera: FloatArray, scratch: FloatArray, ray: NDArray[np.float32], row: int, at: int, start: int
) -> None:
    """Write the image plane's points, from the camera's value `start` on, into three rows."""
    step = 1.0 / camera[SCALE]
    cx, cy = camera[CENTER_X], camera[CENTER_Y]
    rx, ry, rz = camera[RIGHT], camera[RIGHT + 1], camera[RIGHT + 2]
    ux, uy, uz = camera[UP], camera[UP + 1], camera[UP + 2]
    x0, y0, z0 = camera[start], camera[start + 1], camera[start + 2]
    for i in range(LANES):
        a = (scratch[PX + i] - cx) * step
        b = (cy - scratch[PY + i]) * step
        x, y, z = x0 + (a * rx + b * ux), y0 + (a * ry + b * uy), z0 + (a * rz + b * uz)
        scratch[row + i], scratch[row + LANES + i], scratch[row + 2 * LANES + i] = x, y, z
        ray[at + i], ray[at + LANES + i], ray[at + 2 * LANES + i] = np.float32(x), np.float32(y), np.float32(z)


@inlined
def camera_moves(camera: FloatArray) -> bool:
    """Return whether the camera is anywhere else at another time of the exposure."""
    travels = camera[EYE_TRAVEL] != 0.0 or camera[EYE_TRAVEL + 1] != 0.0 or camera[EYE_TRAVEL + 2] != 0.0
    return travels or camera[TURNING] != 0.0


@inlined
def fill_moving_rays(camera: FloatArray, scratch: FloatArray, ray: NDArray[np.float32]) -> None:
    """Write the rays of all 16 lanes for a camera that moves, each from where the camera is at the lane's time.

    Through a lens they start at the lane's point of it and meet, in the plane in focus, the ray through its middle.
    """
    step = 1.0 / camera[SCALE]
    cx, cy, perspective = camera[CENTER_X], camera[CENTER_Y], camera[PERSPECTIVE]
    rx, ry, rz = camera[RIGHT], camera[RIGHT + 1], camera[RIGHT + 2]
    ux, uy, uz = camera[UP], camera[UP + 1], camera[UP + 2]
    fx, fy, fz = camera[FORWARD], camera[FORWARD + 1], camera[FORWARD + 2]
    hx, hy, hz = camera[UP_HINT], camera[UP_HINT + 1], camera[UP_HINT + 2]
    turning, has_lens, is_given = camera[TURNING] != 0.0, camera[LENS_RADIUS] > 0.0, camera[FOCUS] > 0.0
    if not (has_lens or camera_moves(camera)):
        fill_rays(camera, scratch, ray)
        return
    focus = camera[FOCUS]
    if has_lens and not is_given:
        focus = np.sqrt(camera[AXIS] ** 2 + camera[AXIS + 1] ** 2 + camera[AXIS + 2] ** 2)
    for i in range(LANES):
        time = scratch[TIME + i]
        if turning:
            fx = camera[AXIS] + time * camera[AXIS_TRAVEL]
            fy = camera[AXIS + 1] + time * camera[AXIS_TRAVEL + 1]
            fz = camera[AXIS + 2] + time * camera[AXIS_TRAVEL + 2]
            length = np.sqrt(fx * fx + fy * fy + fz * fz)
            if not is_given:
                focus = length
            inverse = 1.0 / length
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
        if has_lens:
            lx = scratch[LENS_X + i] * rx + scratch[LENS_Y + i] * ux
            ly = scratch[LENS_X + i] * ry + scratch[LENS_Y + i] * uy
            lz = scratch[LENS_X + i] * rz + scratch[LENS_Y + i] * uz
            inverse = 1.0 / focus
            write_ray(
                scratch, ray, i, perspective, ex + lx, ey + ly, ez + lz, px, py, pz,
                fx - inverse * lx, fy - inverse * ly, fz - inverse * lz,
            )  # fmt: skip
        else:
            write_ray(scratch, ray, i, perspective, ex, ey, ez, px, py, pz, fx, fy, fz)
    if camera[START] > 0.0:
        _start_ahead(camera[START], scratch, ray)


def aligned_floats(count: int) -> NDArray[np.float32]:
    """Return `count` zeros that start on a multiple of 64 bytes, as Embree's packets must."""
    memory = np.zeros(count + 16, np.float32)
    skip = -memory.ctypes.data % 64 // 4
    return memory[skip : skip + count]
