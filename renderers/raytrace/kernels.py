"""The kernels: they make 16 rays, have Embree trace them, and shade them, row after row on every thread.

What a scene does not need costs it nothing, so there are several: still and flat, still and textured, moving; the same
onto a film, for filters, warps and adaptive sampling; and one for light that is scattered. Threads take rows from one
shared counter, so none waits for another, and a pixel depends on nothing but its own samples (or, splatted, on rows in
a fixed order): the picture is the same bit for bit on any number of threads.
"""

from typing import Any, NamedTuple

import llvmlite.binding
import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import called, inlined
from aliasbench.renderers.raytrace.blurs import fill_film_lens, fill_film_times, picture_reach
from aliasbench.renderers.raytrace.bodies import farther, fill_body_rays, has_layer, may_see, nearer, to_body
from aliasbench.renderers.raytrace.embree import library_path, load_library
from aliasbench.renderers.raytrace.film import Film, add_even, add_runs, is_even, next_runs, place_even, place_runs
from aliasbench.renderers.raytrace.lanes import (
    HIT_GEOM,
    HIT_INSTANCE,
    HIT_PRIM,
    LANES,
    LENS_RADIUS,
    RAY_TFAR,
    START,
    camera_moves,
    fill_changing_rays,
    fill_moving_rays,
    start_rays,
)
from aliasbench.renderers.raytrace.pixel_sums import add_samples
from aliasbench.renderers.raytrace.positions import (
    KeyArray,
    fill_columns,
    fill_keys,
    fill_positions,
    fill_times,
    start_even,
)
from aliasbench.renderers.raytrace.ray_order import (
    PACKETS,
    SAMPLES,
    Block,
    keep_colors,
    put_packet,
    restore_packet,
    sort_block,
    take_sorted,
)
from aliasbench.renderers.raytrace.shading import MISS, Tables, shade_flat, shade_textured
from aliasbench.renderers.sampling.patterns import Pattern
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int32]
CountArray = NDArray[np.int64]

# TBB first, then Embree's own symbols, where compiled kernels (cached ones too) look for rtcIntersect16.
load_library()
llvmlite.binding.load_library_permanently(str(library_path()))

# A ctypes pointer would do the same, but kernels with one cannot be cached.
intersect16 = types.ExternalFunction("rtcIntersect16", types.void(types.intp, types.intp, types.intp, types.intp))

NOTHING = -1  # Embree's invalid id, as int32
EMPTY = 0  # handed over instead of a scene without triangles


@intrinsic
def take_next(typing_context: Any, counter: Any) -> Any:  # noqa: ARG001 - numba passes it
    """Return the int64 at the start of an array and raise it by one, in one step that no other thread can split."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        return builder.atomic_rmw("add", array.data, ir.Constant(ir.IntType(64), 1), "monotonic")

    return types.int64(counter), generate


class Workspace(NamedTuple):
    """One thread's memory, aligned as Embree needs it; `holes` only keeps alive what `arguments` point to.

    `hits` is the row of `ray` where Embree writes triangles.

    `orders`, `numbers`, `runs`, `parts` (runs of each packet), `cursor`, `weights`, `taps` and `room` are what
    `positions` and `film` ask for.
    """

    scratch: FloatArray
    ray: NDArray[np.float32]
    ray_ids: IntArray
    body_ray: NDArray[np.float32]
    body_ids: IntArray
    valid: IntArray
    arguments: IntArray
    hits: IntArray
    sums: FloatArray
    keys: KeyArray
    orders: IntArray
    numbers: CountArray
    runs: CountArray
    parts: CountArray
    cursor: CountArray
    weights: FloatArray
    taps: FloatArray
    room: FloatArray
    block: Block
    holes: CountArray


@inlined
def trace(scene: int, work: Workspace, lanes: int) -> None:
    """Find the nearest hits on the mesh that stands still, MISS where there is none."""
    # One array a loop: with more, the compiler must tell their ranges apart first, for a nanosecond a sample.
    for i in range(LANES):
        work.ray[RAY_TFAR + i] = np.inf
    for i in range(LANES):
        work.hits[i] = MISS
    for i in range(LANES):
        work.valid[i] = -1 if i < lanes else 0
    if scene != EMPTY:
        intersect16(work.valid.ctypes.data, scene, work.ray.ctypes.data, work.arguments.ctypes.data)


@inlined
def trace_bodies(
    scenes: CountArray, tables: Tables, start: float, work: Workspace,
    left: float, right: float, top: float, bottom: float,
) -> None:  # fmt: skip
    """Find nearer hits on the bodies that move and may be seen there in the picture, each in its own frame.

    `start` is the depth at which the rays start.
    """
    for body in range(len(scenes)):
        if not may_see(tables.bodies[body], left, right, top, bottom):
            continue
        values = tables.bodies[body]
        to_body(values, work.scratch)
        fill_body_rays(work.scratch, work.ray, work.body_ray, start)
        layered = has_layer(values)
        if layered:
            for i in range(LANES):
                work.body_ray[RAY_TFAR + i] = np.float32(farther(values, start, np.float64(work.ray[RAY_TFAR + i])))
        for i in range(LANES):
            work.body_ids[HIT_GEOM + i] = NOTHING
            work.body_ids[HIT_INSTANCE + i] = NOTHING
        intersect16(work.valid.ctypes.data, scenes[body], work.body_ray.ctypes.data, work.arguments.ctypes.data)
        first = np.int32(tables.firsts[body])
        for i in range(LANES):
            if work.body_ids[HIT_GEOM + i] != NOTHING:
                work.hits[i] = first + work.body_ids[HIT_PRIM + i]
                work.ray[RAY_TFAR + i] = work.body_ray[RAY_TFAR + i]
                if layered:
                    work.ray[RAY_TFAR + i] = np.float32(nearer(values, start, np.float64(work.ray[RAY_TFAR + i])))


@called
def _trace_block(
    scene: int, scenes: CountArray, camera: FloatArray, tables: Tables, work: Workspace, count: int, textured: bool
) -> None:
    """Find the colours of a block of `count` samples, in packets of nearly one time or place on the lens."""
    # the lens matters less than bodies that move meanwhile
    sort_block(work.block, count, camera[LENS_RADIUS] if len(scenes) == 0 else 0.0)
    for p in range((count + LANES - 1) // LANES):
        lanes = min(LANES, count - p * LANES)
        take_sorted(work.block, p, lanes, work.scratch)
        fill_moving_rays(camera, work.scratch, work.ray)
        trace(scene, work, lanes)
        trace_bodies(scenes, tables, camera[START], work, *picture_reach(work.scratch, lanes))
        if textured:
            shade_textured(tables, camera, work.hits, work.scratch)
        else:
            shade_flat(tables, work.hits, work.scratch)
        keep_colors(work.block, p, lanes, work.scratch)


@njit(nogil=True, cache=True, error_model="numpy", _nrt=False)
def render_static_flat(
    scene: int, camera: FloatArray, pattern: Pattern, tables: Tables, work: Workspace,
    counter: CountArray, out: NDArray[np.float32],
) -> None:  # fmt: skip
    """Render rows until there are none left: nothing moves, no textures."""
    fill_columns(pattern, 0, work.keys)
    start_rays(camera, work.scratch, work.ray)
    while True:
        row = take_next(counter)
        if row >= out.shape[0]:
            return
        fill_keys(pattern, 0, row, work.keys)
        samples = out.shape[1] * pattern.samples
        for first in range(0, samples, LANES):
            lanes = min(LANES, samples - first)
            fill_positions(pattern, work.keys, row, first, lanes, work.orders, work.scratch)
            fill_changing_rays(camera, work.scratch, work.ray)
            trace(scene, work, lanes)
            shade_flat(tables, work.hits, work.scratch)
            add_samples(pattern.samples, row, first, lanes, work.scratch, work.sums, out)


@njit(nogil=True, cache=True, error_model="numpy", _nrt=False)
def render_static_textured(
    scene: int, camera: FloatArray, pattern: Pattern, tables: Tables, work: Workspace,
    counter: CountArray, out: NDArray[np.float32],
) -> None:  # fmt: skip
    """Render rows until there are none left: nothing moves."""
    fill_columns(pattern, 0, work.keys)
    start_rays(camera, work.scratch, work.ray)
    while True:
        row = take_next(counter)
        if row >= out.shape[0]:
            return
        fill_keys(pattern, 0, row, work.keys)
        samples = out.shape[1] * pattern.samples
        for first in range(0, samples, LANES):
            lanes = min(LANES, samples - first)
            fill_positions(pattern, work.keys, row, first, lanes, work.orders, work.scratch)
            fill_changing_rays(camera, work.scratch, work.ray)
            trace(scene, work, lanes)
            shade_textured(tables, camera, work.hits, work.scratch)
            add_samples(pattern.samples, row, first, lanes, work.scratch, work.sums, out)


@njit(nogil=True, cache=True, error_model="numpy", _nrt=False)
def render_moving(
    scene: int, scenes: CountArray, camera: FloatArray, pattern: Pattern, tables: Tables, work: Workspace,
    counter: CountArray, out: NDArray[np.float32],
) -> None:  # fmt: skip
    """Render rows until there are none left: every sample has a time of its own."""
    textured = len(tables.triangles) > 0
    fill_columns(pattern, 0, work.keys)
    while True:
        row = take_next(counter)
        if row >= out.shape[0]:
            return
        fill_keys(pattern, 0, row, work.keys)
        samples = out.shape[1] * pattern.samples
        for start in range(0, samples, SAMPLES):
            count = min(SAMPLES, samples - start)
            packets = (count + LANES - 1) // LANES
            for p in range(packets):
                lanes = min(LANES, count - p * LANES)
                first = start + p * LANES
                fill_positions(pattern, work.keys, row, first, lanes, work.orders, work.scratch)
                fill_times(pattern, work.keys, row, first, lanes, work.numbers, work.scratch)
                put_packet(work.block, p, work.scratch)
            _trace_block(scene, scenes, camera, tables, work, count, textured)
            for p in range(packets):
                restore_packet(work.block, p, work.scratch)
                lanes = min(LANES, count - p * LANES)
                add_samples(pattern.samples, row, start + p * LANES, lanes, work.scratch, work.sums, out)


@njit(nogil=True, cache=True, error_model="numpy", _nrt=False)
def film_static(
    scene: int, camera: FloatArray, pattern: Pattern, tables: Tables, work: Workspace, counter: CountArray, film: Film
) -> None:
    """Expose the film's rows until there are none left: nothing moves, and there is no lens."""
    textured = len(tables.triangles) > 0
    fill_columns(pattern, film.column, work.keys)
    start_rays(camera, work.scratch, work.ray)
    even = is_even(pattern, film)
    if even:
        start_even(pattern, film.each, work.room)
    while True:
        r = take_next(counter)
        if r >= film.begins.shape[0]:
            return
        fill_keys(pattern, film.column, film.row + r, work.keys)
        work.cursor[:] = 0
        first, runs = 0, 0
        while True:
            if even:
                lanes = min(LANES, film.begins.shape[1] * film.each - first)
            else:
                lanes, runs = next_runs(film, r, work.cursor, work.runs[0])
            if lanes <= 0:
                break
            if even:
                place_even(film, work.keys, r, first, work.room, work.scratch)
            else:
                place_runs(pattern, film, work.keys, r, work.runs[0], runs, work.orders, work.scratch)
            fill_changing_rays(camera, work.scratch, work.ray)
            trace(scene, work, lanes)
            if textured:
                shade_textured(tables, camera, work.hits, work.scratch)
            else:
                shade_flat(tables, work.hits, work.scratch)
            if even:
                add_even(film, r, first, lanes, work.scratch)
                first += LANES
            else:
                add_runs(film, r, work.runs[0], runs, work.weights, work.taps, work.room, work.scratch)


@njit(nogil=True, cache=True, error_model="numpy", _nrt=False)
def film_moving(
    scene: int, scenes: CountArray, camera: FloatArray, pattern: Pattern, tables: Tables, work: Workspace,
    counter: CountArray, film: Film,
) -> None:  # fmt: skip
    """Expose the film's rows until there are none left: samples have times of their own, and points on the lens."""
    textured = len(tables.triangles) > 0
    timed = len(scenes) > 0 or camera_moves(camera)
    fill_columns(pattern, film.column, work.keys)
    while True:
        r = take_next(counter)
        if r >= film.begins.shape[0]:
            return
        row = film.row + r
        fill_keys(pattern, film.column, row, work.keys)
        work.cursor[:] = 0
        lanes = LANES
        while lanes > 0:
            count, packets = 0, 0
            while packets < PACKETS:
                runs = work.runs[packets]
                lanes, parts = next_runs(film, r, work.cursor, runs)
                if lanes == 0:
                    break
                work.parts[packets] = parts
                place_runs(pattern, film, work.keys, r, runs, parts, work.orders, work.scratch)
                if timed:
                    fill_film_times(pattern, film, work.keys, r, runs, parts, work.numbers, work.scratch)
                if camera[LENS_RADIUS] > 0.0:
                    radius = camera[LENS_RADIUS]
                    fill_film_lens(pattern, film, work.keys, r, runs, parts, work.numbers, radius, work.scratch)
                put_packet(work.block, packets, work.scratch)
                count += lanes
                packets += 1
            _trace_block(scene, scenes, camera, tables, work, count, textured)
            for p in range(packets):
                restore_packet(work.block, p, work.scratch)
                add_runs(film, r, work.runs[p], work.parts[p], work.weights, work.taps, work.room, work.scratch)
