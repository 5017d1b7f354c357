"""The kernel of scattered light: `paths` step by step, with Embree between the steps. Only scenes with it load this."""

import numpy as np
from numba import njit, types
from numpy.typing import NDArray

from aliasbench.renderers.raytrace.blurs import fill_film_lens, fill_film_times, picture_reach
from aliasbench.renderers.raytrace.bodies import fill_body_rays, to_body
from aliasbench.renderers.raytrace.film import Film, add_runs, next_runs, place_runs
from aliasbench.renderers.raytrace.kernels import (
    EMPTY,
    NOTHING,
    CountArray,
    Workspace,
    intersect16,
    take_next,
    trace,
    trace_bodies,
)
from aliasbench.renderers.raytrace.lanes import (
    HIT_GEOM,
    HIT_INSTANCE,
    LANES,
    LENS_RADIUS,
    RAY_TFAR,
    START,
    fill_moving_rays,
    fill_rays,
)
from aliasbench.renderers.raytrace.paths import (
    DONE,
    LIT,
    MOST_SEGMENTS,
    Paths,
    Scattering,
    aim_at_lights,
    draw_lights,
    leave_lit,
    scatter,
    show_paths,
    start_paths,
    take_light,
)
from aliasbench.renderers.raytrace.positions import fill_columns, fill_keys
from aliasbench.renderers.raytrace.shading import MISS, Tables, shade_textured
from aliasbench.renderers.sampling.patterns import Pattern
from aliasbench.scenes.model import FloatArray

_occluded16 = types.ExternalFunction("rtcOccluded16", types.void(types.intp, types.intp, types.intp, types.intp))

_COHERENT = 1 << 16


@njit(cache=True, error_model="numpy", _nrt=False)
def _trace_paths(scene: int, scenes: CountArray, tables: Tables, paths: Paths, work: Workspace) -> None:
    """Find what flying paths hit next, on everything."""
    for i in range(LANES):
        work.ray_ids[HIT_GEOM + i] = NOTHING
        work.ray_ids[HIT_INSTANCE + i] = NOTHING
        work.valid[i] = -1 if DONE < paths.states[i] < LIT else 0
    for i in range(LANES):
        if work.valid[i] != 0:
            work.hits[i] = MISS
    work.arguments[0] = 0  # of paths that have been scattered, hardly two go the same way
    if scene != EMPTY:
        intersect16(work.valid.ctypes.data, scene, work.ray.ctypes.data, work.arguments.ctypes.data)
    trace_bodies(scenes, tables, 0.0, work, -np.inf, np.inf, -np.inf, np.inf)
    work.arguments[0] = _COHERENT


@njit(cache=True, error_model="numpy", _nrt=False)
def _trace_shadows(scene: int, scenes: CountArray, tables: Tables, shadow: Workspace) -> None:
    """Find which shadow rays are stopped by anything: their end is set to minus infinity."""
    if scene != EMPTY:
        _occluded16(shadow.valid.ctypes.data, scene, shadow.ray.ctypes.data, shadow.arguments.ctypes.data)
    for body in range(len(scenes)):
        to_body(tables.bodies[body], shadow.scratch)
        fill_body_rays(shadow.scratch, shadow.ray, shadow.body_ray, 0.0)
        _occluded16(shadow.valid.ctypes.data, scenes[body], shadow.body_ray.ctypes.data, shadow.arguments.ctypes.data)
        for i in range(LANES):
            if shadow.body_ray[RAY_TFAR + i] < 0.0:
                shadow.ray[RAY_TFAR + i] = -np.inf


@njit(nogil=True, cache=True, error_model="numpy", _nrt=False)
def film_paths(
    scattering: Scattering, moving: bool, scene: int, scenes: CountArray, camera: FloatArray, pattern: Pattern,
    tables: Tables, work: Workspace, shadow: Workspace, paths: Paths, counter: NDArray[np.int64], film: Film,
) -> None:  # fmt: skip
    """Expose the film's rows until there are none left, following each path of light.

    `moving`: samples have times of their own, or points on the lens.
    """
    share = 1.0 / scattering.shadow_rays
    has_lights = len(tables.lights) > 0
    fill_columns(pattern, film.column, work.keys)
    while True:
        r = take_next(counter)
        if r >= film.begins.shape[0]:
            return
        fill_keys(pattern, film.column, film.row + r, work.keys)
        work.cursor[:] = 0
        while True:
            lanes, runs = next_runs(film, r, work.cursor, work.runs[0])
            if lanes == 0:
                break
            place_runs(pattern, film, work.keys, r, work.runs[0], runs, work.orders, work.scratch)
            if moving:
                fill_film_times(pattern, film, work.keys, r, work.runs[0], runs, work.numbers, work.scratch)
                if camera[LENS_RADIUS] > 0.0:
                    radius = camera[LENS_RADIUS]
                    fill_film_lens(pattern, film, work.keys, r, work.runs[0], runs, work.numbers, radius, work.scratch)
                fill_moving_rays(camera, work.scratch, work.ray)
            else:
                fill_rays(camera, work.scratch, work.ray)
            trace(scene, work, lanes)
            trace_bodies(scenes, tables, camera[START], work, *picture_reach(work.scratch, lanes))
            start_paths(pattern, film, work.keys, r, work.runs[0], runs, lanes, work.numbers, paths)
            for segment in range(MOST_SEGMENTS):
                shade_textured(tables, camera, work.hits, work.scratch)
                any_lit, any_flies = scatter(tables, work.hits, segment, paths, work.scratch, work.ray)
                if any_lit:
                    if has_lights:
                        for k in range(scattering.shadow_rays):
                            own = work.runs[0]
                            draw_lights(
                                pattern, film, work.keys, r, own, runs, scattering.shadow_rays, k, work.numbers, paths
                            )
                            if aim_at_lights(
                                tables, segment, k, share, paths, work.scratch, shadow.scratch, shadow.ray, shadow.valid
                            ):
                                _trace_shadows(scene, scenes, tables, shadow)
                                take_light(paths, shadow.scratch, shadow.ray, shadow.valid)
                    any_flies |= leave_lit(scattering.bounces > 0, segment, paths, work.scratch, work.ray)
                if not any_flies:
                    break
                _trace_paths(scene, scenes, tables, paths, work)
            show_paths(paths, work.scratch)
            add_runs(film, r, work.runs[0], runs, work.weights, work.taps, work.room, work.scratch)
