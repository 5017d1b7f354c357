"""Film for the plain engine: the packet kernels' steps, over many packets between two calls of a tracer in Python.

Packets are opened in the order of rows and pixels, traced together, and added in the same order, so that film and
pictures are what the kernels make of the same hits.
"""

from typing import Self

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.raytrace.blurs import fill_film_lens, fill_film_times
from aliasbench.renderers.raytrace.film import Film, IntArray, add_runs, next_runs, place_runs
from aliasbench.renderers.raytrace.lanes import (
    LANES,
    LENS_RADIUS,
    RAY_SIZE,
    SCRATCH_SIZE,
    fill_moving_rays,
    fill_rays,
)
from aliasbench.renderers.raytrace.paths import (
    DONE,
    LIT,
    PATH_SIZE,
    Paths,
    aim_at_lights,
    draw_lights,
    leave_lit,
    scatter,
    show_paths,
    start_paths,
    take_light,
)
from aliasbench.renderers.raytrace.positions import KEY_ROWS, KeyArray, fill_columns, fill_keys, orders_size
from aliasbench.renderers.raytrace.shading import MISS, Tables, shade_flat, shade_textured
from aliasbench.renderers.sampling.patterns import Pattern
from aliasbench.scenes.model import FloatArray

RayArray = NDArray[np.float32]

# Columns of what is kept of a packet beside its runs: the film's row, how many runs, how many lanes.
_ROW, _RUNS, _LANES_USED = 0, 1, 2
# What is kept from one batch to the next: the film's row, whether it has been begun, and the cursor of its runs.
_AT_ROW, _BEGUN, _CURSOR = 0, 1, 2


class FilmRoom:
    """What is needed to expose one film: room for some packets, and where the next ones start."""

    def __init__(
        self, camera: FloatArray, pattern: Pattern, tables: Tables, moving: bool, film: Film, packets: int
    ) -> None:
        self.camera, self.pattern, self.tables, self.moving, self.film = camera, pattern, tables, moving, film
        samples = int(np.maximum(film.ends - film.begins, 0).sum(dtype=np.int64))
        packets = min(packets, -(-samples // LANES) + len(film.begins))
        self.state = np.zeros(4, np.int64)
        self.keys = np.zeros((KEY_ROWS, film.begins.shape[1]), np.uint64)
        self.orders = np.zeros((3, orders_size(pattern)), np.int32)
        self.numbers = np.zeros(LANES, np.int64)
        self.scratch, self.rays = np.zeros((packets, SCRATCH_SIZE)), np.zeros((packets, RAY_SIZE), np.float32)
        self.runs, self.heads = np.zeros((packets, LANES, 4), np.int64), np.zeros((packets, 3), np.int64)
        taps = 2 * film.margin + 1
        self.weights, self.taps = np.zeros((taps, 2 * LANES)), np.zeros((taps, taps, 4))
        self.room = np.zeros((4, 2 * LANES))
        fill_columns(pattern, film.column, self.keys)

    def next_batch(self) -> "Batch | None":
        """Return the next packets, with their rays, or None after the last."""
        count = _open(
            self.pattern, self.film, self.camera, self.moving, self.state, self.keys, self.orders, self.numbers,
            self.scratch, self.rays, self.runs, self.heads,
        )  # fmt: skip
        return Batch(self, count) if count else None


class Batch:
    """Some packets of a film, from their first rays to their colours."""

    def __init__(self, room: FilmRoom, count: int) -> None:
        self.room = room
        self.scratch, self.rays = room.scratch[:count], room.rays[:count]
        self.runs, self.heads = room.runs[:count], room.heads[:count]
        self.hits = np.full((count, LANES), MISS, np.int32)
        self.shadow = np.zeros((0, SCRATCH_SIZE))
        self.shadow_rays = np.zeros((0, RAY_SIZE), np.float32)
        self.valid = np.zeros((0, LANES), np.int32)
        self.paths = Paths(np.zeros(0), np.zeros(0, np.int32), np.zeros(0, np.uint64), np.zeros(0, np.int64))

    def ends(self) -> RayArray:
        """Return how far the rays go, (n,): to infinity."""
        return np.full(self.hits.size, np.inf, np.float32)

    def shade(self) -> Self:
        """Write the colours of what the rays have hit."""
        _shade_all(self.room.tables, self.room.camera, self.hits, self.scratch)
        return self

    def add(self) -> None:
        """Add the colours to the film."""
        room = self.room
        _add_all(room.film, self.runs, self.heads, room.weights, room.taps, room.room, self.scratch)

    def start_paths(self) -> None:
        """Start a path for each sample."""
        count = len(self.hits)
        self.paths = Paths(
            np.zeros((count, PATH_SIZE)),
            np.zeros((count, LANES), np.int32),
            np.zeros((count, LANES), np.uint64),
            np.zeros((count, LANES), np.int64),
        )
        self.shadow, self.shadow_rays = np.zeros_like(self.scratch), np.zeros_like(self.rays)
        self.valid = np.zeros((count, LANES), np.int32)
        room = self.room
        _start_all(room.pattern, room.film, room.keys, self.runs, self.heads, room.numbers, *self.paths)

    def scatter(self, segment: int) -> tuple[bool, bool]:
        """Let all paths that fly arrive; see `paths.scatter`."""
        self.shade()
        return _scatter_all(self.room.tables, self.hits, segment, *self.paths, self.scratch, self.rays)

    def aim_at_lights(self, segment: int, k: int, shadow_rays: int) -> None:
        """Write shadow ray k of each path that is to be lit."""
        room = self.room
        _aim_all(
            room.pattern, room.film, room.keys, room.tables, self.runs, self.heads, room.numbers, segment, k,
            shadow_rays, *self.paths, self.scratch, self.shadow, self.shadow_rays, self.valid,
        )  # fmt: skip

    def take_light(self, stopped: NDArray[np.bool_]) -> None:
        """Count the light of the shadow rays that were not stopped (n, LANES)."""
        self.valid[stopped] = 0
        _take_all(*self.paths, self.shadow, self.shadow_rays, self.valid)

    def leave_lit(self, bounces: bool, segment: int) -> bool:
        """End or send on the paths that have been lit; see `paths.leave_lit`."""
        return bool(_leave_all(bounces, segment, *self.paths, self.scratch, self.rays))

    def is_flying(self) -> NDArray[np.bool_]:
        """Return which lanes have a ray to be traced."""
        return (self.paths.states > DONE) & (self.paths.states < LIT)

    def show_paths(self) -> None:
        """Write what the paths have seen as colours."""
        _show_all(*self.paths, self.scratch)


@njit(cache=True, error_model="numpy", _nrt=False)
def _open(
    pattern: Pattern, film: Film, camera: FloatArray, moving: bool, state: IntArray, keys: KeyArray,
    orders: NDArray[np.int32], numbers: IntArray, scratch: FloatArray, rays: RayArray, runs: IntArray, heads: IntArray,
) -> int:  # fmt: skip
    """Write the next packets; return how many."""
    count = 0
    while count < len(scratch) and state[_AT_ROW] < film.begins.shape[0]:
        r = state[_AT_ROW]
        if state[_BEGUN] == 0:
            fill_keys(pattern, film.column, film.row + r, keys)
            state[_BEGUN] = 1
        lanes, parts = next_runs(film, r, state[_CURSOR:], runs[count])
        if lanes == 0:
            state[_AT_ROW] += 1
            state[_BEGUN:] = 0
            continue
        own = scratch[count]
        place_runs(pattern, film, keys, r, runs[count], parts, orders, own)
        if moving:
            fill_film_times(pattern, film, keys, r, runs[count], parts, numbers, own)
            if camera[LENS_RADIUS] > 0.0:
                fill_film_lens(pattern, film, keys, r, runs[count], parts, numbers, camera[LENS_RADIUS], own)
            fill_moving_rays(camera, own, rays[count])
        else:
            fill_rays(camera, own, rays[count])
        heads[count, _ROW], heads[count, _RUNS], heads[count, _LANES_USED] = r, parts, lanes
        count += 1
    return count


@njit(cache=True, error_model="numpy", _nrt=False)
def _shade_all(tables: Tables, camera: FloatArray, hits: NDArray[np.int32], scratch: FloatArray) -> None:
    placed = len(tables.triangles) > 0
    for p in range(len(scratch)):
        if placed:
            shade_textured(tables, camera, hits[p], scratch[p])
        else:
            shade_flat(tables, hits[p], scratch[p])


@njit(cache=True, error_model="numpy", _nrt=False)
def _add_all(
    film: Film, runs: IntArray, heads: IntArray, weights: FloatArray, taps: FloatArray, room: FloatArray,
    scratch: FloatArray,
) -> None:  # fmt: skip
    for p in range(len(scratch)):
        add_runs(film, heads[p, _ROW], runs[p], heads[p, _RUNS], weights, taps, room, scratch[p])


@njit(cache=True, error_model="numpy", _nrt=False)
def _start_all(
    pattern: Pattern, film: Film, keys: KeyArray, runs: IntArray, heads: IntArray, numbers: IntArray,
    rows: FloatArray, states: NDArray[np.int32], path_keys: KeyArray, indices: IntArray,
) -> None:  # fmt: skip
    for p in range(len(runs)):
        r = heads[p, _ROW]
        if p == 0 or r != heads[p - 1, _ROW]:
            fill_keys(pattern, film.column, film.row + r, keys)
        paths = Paths(rows[p], states[p], path_keys[p], indices[p])
        start_paths(pattern, film, keys, r, runs[p], heads[p, _RUNS], heads[p, _LANES_USED], numbers, paths)


@njit(cache=True, error_model="numpy", _nrt=False)
def _scatter_all(
    tables: Tables, hits: NDArray[np.int32], segment: int, rows: FloatArray, states: NDArray[np.int32],
    path_keys: KeyArray, indices: IntArray, scratch: FloatArray, rays: RayArray,
) -> tuple[bool, bool]:  # fmt: skip
    any_lit, any_flies = False, False
    for p in range(len(scratch)):
        paths = Paths(rows[p], states[p], path_keys[p], indices[p])
        lit, flies = scatter(tables, hits[p], segment, paths, scratch[p], rays[p])
        any_lit, any_flies = any_lit or lit, any_flies or flies
    return any_lit, any_flies


@njit(cache=True, error_model="numpy", _nrt=False)
def _aim_all(
    pattern: Pattern, film: Film, keys: KeyArray, tables: Tables, runs: IntArray, heads: IntArray, numbers: IntArray,
    segment: int, k: int, shadow_rays: int, rows: FloatArray, states: NDArray[np.int32], path_keys: KeyArray,
    indices: IntArray, scratch: FloatArray, shadow: FloatArray, rays: RayArray, valid: NDArray[np.int32],
) -> None:  # fmt: skip
    for p in range(len(scratch)):
        r = heads[p, _ROW]
        if p == 0 or r != heads[p - 1, _ROW]:
            fill_keys(pattern, film.column, film.row + r, keys)
        paths = Paths(rows[p], states[p], path_keys[p], indices[p])
        draw_lights(pattern, film, keys, r, runs[p], heads[p, _RUNS], shadow_rays, k, numbers, paths)
        aim_at_lights(tables, segment, k, 1.0 / shadow_rays, paths, scratch[p], shadow[p], rays[p], valid[p])


@njit(cache=True, error_model="numpy", _nrt=False)
def _take_all(
    rows: FloatArray, states: NDArray[np.int32], path_keys: KeyArray, indices: IntArray, shadow: FloatArray,
    rays: RayArray, valid: NDArray[np.int32],
) -> None:  # fmt: skip
    for p in range(len(shadow)):
        take_light(Paths(rows[p], states[p], path_keys[p], indices[p]), shadow[p], rays[p], valid[p])


@njit(cache=True, error_model="numpy", _nrt=False)
def _leave_all(
    bounces: bool, segment: int, rows: FloatArray, states: NDArray[np.int32], path_keys: KeyArray, indices: IntArray,
    scratch: FloatArray, rays: RayArray,
) -> bool:  # fmt: skip
    any_flies = False
    for p in range(len(scratch)):
        paths = Paths(rows[p], states[p], path_keys[p], indices[p])
        flies = leave_lit(bounces, segment, paths, scratch[p], rays[p])
        any_flies = any_flies or flies
    return any_flies


@njit(cache=True, error_model="numpy", _nrt=False)
def _show_all(
    rows: FloatArray, states: NDArray[np.int32], path_keys: KeyArray, indices: IntArray, scratch: FloatArray
) -> None:
    for p in range(len(scratch)):
        show_paths(Paths(rows[p], states[p], path_keys[p], indices[p]), scratch[p])
