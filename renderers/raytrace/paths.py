"""Light that is scattered on its way to the camera, 16 paths at a time: lamps, gloss, glass, one diffuse reflection.

What a path meets first decides. Unlit surfaces, lights and the background end it. A diffuse surface is lit by shadow
rays to points on the lights; where the scene asks for a bounce, it also sends the path on in a direction drawn by the
cosine, and what that meets is seen as from the camera, lit by one shadow ray where it is diffuse. Glossy surfaces and
glass send the path on (`scattering`), until MOST_SEGMENTS. A light that a path meets counts, unless it comes from a
diffuse surface, which has been lit by it already. Glass and gloss throw shadows like anything else.

Each step works on all lanes, between two intersections, and both engines take the same steps. New rays start a little
off their surface, by a share of the coordinates that float32 rounds there.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.lights import (
    AREA,
    BEFORE_LIGHT,
    CHANCE,
    CHANCES_BEFORE,
    CORNER,
    EDGE_1,
    EDGE_2,
    LIGHT_NORMAL,
    OFF_SURFACE,
    RADIANCE,
)
from aliasbench.renderers.raytrace.film import (
    RUN_LANE,
    RUN_LANES,
    RUN_PIXEL,
    Film,
    IntArray,
    run_address,
)
from aliasbench.renderers.raytrace.lanes import (
    DX,
    DY,
    DZ,
    LANES,
    LENS_X,
    OX,
    OY,
    OZ,
    RAY_DX,
    RAY_DY,
    RAY_DZ,
    RAY_OX,
    RAY_OY,
    RAY_OZ,
    RAY_TFAR,
    RED,
    TIME,
)
from aliasbench.renderers.raytrace.positions import KeyArray, fill_line, fill_plane
from aliasbench.renderers.raytrace.scattering import (
    cosine_direction,
    glass_direction,
    glossy_direction,
    index_at,
    normalized,
    spectral_weights,
    wavelength_of,
)
from aliasbench.renderers.raytrace.shading import MISS, REACH, Tables, meet_plane
from aliasbench.renderers.raytrace.texturing import CAUCHY_A, CAUCHY_B, MATERIAL, ROUGHNESS
from aliasbench.renderers.sampling.hashing import combine, unit
from aliasbench.renderers.sampling.patterns import DIM_DIRECTION, DIM_LIGHT, DIM_WAVELENGTH, Pattern
from aliasbench.scenes.model import FloatArray

MOST_SEGMENTS = 24  # of a path
UNLIT, LIGHT, DIFFUSE, GLOSSY, GLASS = 0.0, 1.0, 2.0, 3.0, 4.0

# What a path is about to do: nothing any more; fly on, from the camera or a mirror, from a diffuse surface, or from a
# mirror after one; be lit, and then bounce; be lit, and then end.
DONE, FLYING, LEFT_DIFFUSE, REFLECTED, LIT, LIT_LAST = 0, 1, 2, 3, 4, 5

# Rows of the paths' numbers, in lanes: what is seen at its end counts that much, what has been seen, place and normal
# of the last hit, how far off it new rays start, random numbers, and whether the wavelength matters yet.
SHARE, SEEN, PLACE, NORMAL, STEP = 0, 48, 96, 144, 192
LIGHT_U, LIGHT_V, TURN_U, TURN_V, WAVE, SPLIT = 208, 224, 240, 256, 272, 288
PATH_SIZE = 304
# Rows of a shadow ray's scratch for what it brings; in the rows of colours tests for holes leave their alphas.
BROUGHT = LENS_X

_CHANCE = 0x7A7B  # what keys of a path's later random numbers are derived with
_NUMBERS_EACH = 8


class Scattering(NamedTuple):
    """How far paths are followed: shadow rays of each from the camera, and whether diffuse surfaces send them on."""

    shadow_rays: int
    bounces: int


class Paths(NamedTuple):
    """Room for the paths of a packet: numbers, what each is about to do, and where its random numbers come from."""

    numbers: FloatArray
    states: NDArray[np.int32]
    keys: NDArray[np.uint64]
    indices: NDArray[np.int64]


def make_paths() -> Paths:
    """Return room for the paths of a packet."""
    return Paths(np.zeros(PATH_SIZE), np.zeros(LANES, np.int32), np.zeros(LANES, np.uint64), np.zeros(LANES, np.int64))


@njit(cache=True, error_model="numpy", _nrt=False)
def start_paths(
    pattern: Pattern, film: Film, keys: KeyArray, r: int, runs: IntArray, count: int, lanes: int,
    numbers: NDArray[np.int64], paths: Paths,
) -> None:  # fmt: skip
    """Start a path in each of a packet's first lanes."""
    rows = paths.numbers
    for n in range(count):
        run = runs[n]
        key, size, index = run_address(pattern, film, keys, r, run)
        column, row, lane, length = film.column + run[RUN_PIXEL], film.row + r, run[RUN_LANE], run[RUN_LANES]
        fill_plane(
            pattern,
            size,
            key,
            column,
            row,
            DIM_DIRECTION,
            index,
            np.int64(1),
            lane,
            length,
            numbers,
            rows,
            np.int64(TURN_U),
            np.int64(TURN_V),
        )
        fill_line(pattern, size, key, column, row, DIM_WAVELENGTH, index, lane, length, numbers, rows, np.int64(WAVE))
        for i in range(length):
            paths.keys[lane + i], paths.indices[lane + i] = combine(key, _CHANCE), index + i
    for i in range(LANES):
        paths.states[i] = FLYING if i < lanes else DONE
        rows[SPLIT + i] = 0.0
        for c in range(3):
            rows[SHARE + c * LANES + i], rows[SEEN + c * LANES + i] = 1.0, 0.0


@njit(cache=True, error_model="numpy", _nrt=False)
def draw_lights(
    pattern: Pattern, film: Film, keys: KeyArray, r: int, runs: IntArray, count: int, shadow_rays: int, k: int,
    numbers: NDArray[np.int64], paths: Paths,
) -> None:  # fmt: skip
    """Write the light points of shadow ray k of each sample: all of a pixel's are one set, `shadow_rays` a sample."""
    for n in range(count):
        run = runs[n]
        key, size, index = run_address(pattern, film, keys, r, run)
        fill_plane(
            pattern, size * shadow_rays, key, film.column + run[RUN_PIXEL], film.row + r, DIM_LIGHT,
            index * shadow_rays + k, shadow_rays, run[RUN_LANE], run[RUN_LANES], numbers, paths.numbers,
            np.int64(LIGHT_U), np.int64(LIGHT_V),
        )  # fmt: skip


@njit(inline="always", cache=True)
def _chance(paths: Paths, i: int, segment: int, number: int) -> float:
    """Return a random number of its own for a lane, a segment of its path, and a use."""
    return unit(combine(paths.keys[i], segment * _NUMBERS_EACH + number), paths.indices[i])


@njit(cache=True, error_model="numpy", _nrt=False)
def scatter(
    tables: Tables, hits: NDArray[np.int32], segment: int, paths: Paths, scratch: FloatArray, ray: NDArray[np.float32]
) -> tuple[bool, bool]:
    """Let all paths that fly arrive, given what they hit and its colours.

    Returns whether any is to be lit, and whether any flies on. New rays are written for those.
    """
    any_lit, any_flies = False, False
    rows = paths.numbers
    for i in range(LANES):
        state = paths.states[i]
        if state == DONE:
            continue
        hit = hits[i]
        material = UNLIT if hit == MISS else tables.objects[tables.owners[hit], MATERIAL]
        if material <= LIGHT:
            paths.states[i] = DONE
            if material == UNLIT:
                _see(rows, scratch, i)
            elif state != LEFT_DIFFUSE:
                nx, ny, nz = _arrive(tables, hit, rows, scratch, i)
                if nx * scratch[DX + i] + ny * scratch[DY + i] + nz * scratch[DZ + i] < 0.0:
                    _see(rows, scratch, i)
            continue
        nx, ny, nz = _arrive(tables, hit, rows, scratch, i)
        dx, dy, dz = normalized(scratch[DX + i], scratch[DY + i], scratch[DZ + i])
        for c in range(3):
            rows[SHARE + c * LANES + i] *= scratch[RED + c * LANES + i]
        if material != GLASS and nx * dx + ny * dy + nz * dz > 0.0:
            nx, ny, nz = -nx, -ny, -nz
        rows[NORMAL + i], rows[NORMAL + LANES + i], rows[NORMAL + 2 * LANES + i] = nx, ny, nz
        if material == DIFFUSE:
            paths.states[i] = LIT if state == FLYING else LIT_LAST
            any_lit = True
            continue
        values = tables.objects[tables.owners[hit]]
        if material == GLOSSY:
            u, v = rows[TURN_U + i], rows[TURN_V + i]
            if segment > 0:
                u, v = _chance(paths, i, segment, 0), _chance(paths, i, segment, 1)
            (dx, dy, dz), weight = glossy_direction(u, v, values[ROUGHNESS], nx, ny, nz, dx, dy, dz)
            for c in range(3):
                rows[SHARE + c * LANES + i] *= weight
            if weight <= 0.0:
                paths.states[i] = DONE
                continue
        else:
            index = values[CAUCHY_A]
            if values[CAUCHY_B] > 0.0:
                index = index_at(values[CAUCHY_A], values[CAUCHY_B], wavelength_of(rows[WAVE + i]))
                if rows[SPLIT + i] == 0.0:
                    rows[SPLIT + i] = 1.0
                    weights = spectral_weights(rows[WAVE + i])
                    rows[SHARE + i] *= weights[0]
                    rows[SHARE + LANES + i] *= weights[1]
                    rows[SHARE + 2 * LANES + i] *= weights[2]
            (dx, dy, dz), _ = glass_direction(_chance(paths, i, segment, 2), index, nx, ny, nz, dx, dy, dz)
        paths.states[i] = FLYING if state == FLYING else REFLECTED
        _leave(rows, scratch, ray, i, dx, dy, dz)
        any_flies = True
    return any_lit, any_flies


@njit(cache=True, error_model="numpy", _nrt=False)
def _see(rows: FloatArray, scratch: FloatArray, i: int) -> None:
    """Count what a path has met as seen."""
    for c in range(3):
        rows[SEEN + c * LANES + i] += rows[SHARE + c * LANES + i] * scratch[RED + c * LANES + i]


@njit(cache=True, error_model="numpy", _nrt=False)
def _arrive(tables: Tables, hit: int, rows: FloatArray, scratch: FloatArray, i: int) -> tuple[float, float, float]:
    """Write the place of a hit; return the unit normal there, towards the side that the triangle winds about."""
    t, nx, ny, nz = meet_plane(tables, hit, scratch, i)
    x, y, z = (
        scratch[OX + i] + t * scratch[DX + i],
        scratch[OY + i] + t * scratch[DY + i],
        scratch[OZ + i] + t * scratch[DZ + i],
    )
    rows[PLACE + i], rows[PLACE + LANES + i], rows[PLACE + 2 * LANES + i] = x, y, z
    rows[STEP + i] = OFF_SURFACE * max(tables.triangles[hit, REACH], abs(x), abs(y), abs(z))
    return normalized(nx, ny, nz)


@njit(cache=True, error_model="numpy", _nrt=False)
def _off_surface(rows: FloatArray, i: int, dx: float, dy: float, dz: float) -> tuple[float, float, float]:
    """Return where a ray along d starts: off the last hit's surface, on the side that it leaves to."""
    x, y, z = rows[PLACE + i], rows[PLACE + LANES + i], rows[PLACE + 2 * LANES + i]
    nx, ny, nz = rows[NORMAL + i], rows[NORMAL + LANES + i], rows[NORMAL + 2 * LANES + i]
    step = rows[STEP + i]
    if nx * dx + ny * dy + nz * dz < 0.0:
        step = -step
    return x + step * nx, y + step * ny, z + step * nz


@njit(cache=True, error_model="numpy", _nrt=False)
def _leave(
    rows: FloatArray, scratch: FloatArray, ray: NDArray[np.float32], i: int, dx: float, dy: float, dz: float
) -> None:
    x, y, z = _off_surface(rows, i, dx, dy, dz)
    write_lane(scratch, ray, i, x, y, z, dx, dy, dz, np.inf)


@njit(cache=True, error_model="numpy", _nrt=False)
def write_lane(
    scratch: FloatArray, ray: NDArray[np.float32], i: int, x: float, y: float, z: float, dx: float, dy: float,
    dz: float, far: float,
) -> None:  # fmt: skip
    """Write one ray, in both precisions, and where it ends."""
    scratch[OX + i], scratch[OY + i], scratch[OZ + i] = x, y, z
    scratch[DX + i], scratch[DY + i], scratch[DZ + i] = dx, dy, dz
    ray[RAY_OX + i], ray[RAY_OY + i], ray[RAY_OZ + i] = np.float32(x), np.float32(y), np.float32(z)
    ray[RAY_DX + i], ray[RAY_DY + i], ray[RAY_DZ + i] = np.float32(dx), np.float32(dy), np.float32(dz)
    ray[RAY_TFAR + i] = np.float32(far)


@njit(cache=True, error_model="numpy", _nrt=False)
def aim_at_lights(
    tables: Tables, segment: int, k: int, share: float, paths: Paths, scratch: FloatArray, shadow: FloatArray,
    ray: NDArray[np.float32], valid: NDArray[np.int32],
) -> bool:  # fmt: skip
    """Write shadow rays from the paths that are to be lit, and the colours they bring if they arrive.

    Those are colour / pi times radiance, cosines and area over the squared distance, over the chance that the light is
    drawn, times `share` for paths from the camera, which have 1 / share shadow rays; others have the one of `k` = 0.
    `valid` says which lanes have one; returns whether any has.
    """
    any_valid = False
    rows = paths.numbers
    for i in range(LANES):
        valid[i] = 0
        state = paths.states[i]
        if state < LIT:
            continue
        u, v = rows[LIGHT_U + i], rows[LIGHT_V + i]
        weight = share
        if state != LIT:
            if k > 0:
                continue
            u, v, weight = _chance(paths, i, segment, 3), _chance(paths, i, segment, 4), 1.0
        which = 0
        while which + 1 < len(tables.lights) and u >= tables.lights[which + 1, CHANCES_BEFORE]:
            which += 1
        light = tables.lights[which]
        if light[CHANCE] <= 0.0:
            continue
        u = min((u - light[CHANCES_BEFORE]) / light[CHANCE], 1.0)
        px = light[CORNER] + u * light[EDGE_1] + v * light[EDGE_2]
        py = light[CORNER + 1] + u * light[EDGE_1 + 1] + v * light[EDGE_2 + 1]
        pz = light[CORNER + 2] + u * light[EDGE_1 + 2] + v * light[EDGE_2 + 2]
        dx, dy, dz = px - rows[PLACE + i], py - rows[PLACE + LANES + i], pz - rows[PLACE + 2 * LANES + i]
        square = dx * dx + dy * dy + dz * dz
        here = dx * rows[NORMAL + i] + dy * rows[NORMAL + LANES + i] + dz * rows[NORMAL + 2 * LANES + i]
        there = -(dx * light[LIGHT_NORMAL] + dy * light[LIGHT_NORMAL + 1] + dz * light[LIGHT_NORMAL + 2])
        if not (here > 0.0 and there > 0.0 and square > 0.0):
            continue
        x, y, z = _off_surface(rows, i, dx, dy, dz)
        # Far from where coordinates start, the light's own surface may lie before it by rounding.
        unsure = (rows[STEP + i] + OFF_SURFACE * max(abs(px), abs(py), abs(pz))) / np.sqrt(square)
        far = max(1.0 - max(BEFORE_LIGHT, unsure), 0.0)
        write_lane(shadow, ray, i, x, y, z, px - x, py - y, pz - z, far)
        shadow[TIME + i] = scratch[TIME + i]
        weight *= light[AREA] * here * there / (np.pi * square * square * light[CHANCE])
        for c in range(3):
            shadow[BROUGHT + c * LANES + i] = weight * light[RADIANCE + c] * rows[SHARE + c * LANES + i]
        valid[i] = -1
        any_valid = True
    return any_valid


@njit(cache=True, error_model="numpy", _nrt=False)
def take_light(paths: Paths, shadow: FloatArray, ray: NDArray[np.float32], valid: NDArray[np.int32]) -> None:
    """Count the light of shadow rays that arrived: those that Embree has not ended (at minus infinity)."""
    for i in range(LANES):
        if valid[i] != 0 and ray[RAY_TFAR + i] >= 0.0:
            for c in range(3):
                paths.numbers[SEEN + c * LANES + i] += shadow[BROUGHT + c * LANES + i]


@njit(cache=True, error_model="numpy", _nrt=False)
def leave_lit(bounces: bool, segment: int, paths: Paths, scratch: FloatArray, ray: NDArray[np.float32]) -> bool:
    """End the paths that have been lit, or send those from the camera on for a bounce; return whether any flies on."""
    any_flies = False
    rows = paths.numbers
    for i in range(LANES):
        state = paths.states[i]
        if state < LIT:
            continue
        if not bounces or state != LIT:
            paths.states[i] = DONE
            continue
        u, v = rows[TURN_U + i], rows[TURN_V + i]
        if segment > 0:
            u, v = _chance(paths, i, segment, 0), _chance(paths, i, segment, 1)
        nx, ny, nz = rows[NORMAL + i], rows[NORMAL + LANES + i], rows[NORMAL + 2 * LANES + i]
        dx, dy, dz = cosine_direction(u, v, nx, ny, nz)
        _leave(rows, scratch, ray, i, dx, dy, dz)
        paths.states[i] = LEFT_DIFFUSE
        any_flies = True
    return any_flies


@njit(cache=True, error_model="numpy", _nrt=False)
def show_paths(paths: Paths, scratch: FloatArray) -> None:
    """Write what the paths have seen as the lanes' colours."""
    for i in range(3 * LANES):
        scratch[RED + i] = paths.numbers[SEEN + i]
