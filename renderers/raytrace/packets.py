"""The fast engine: kernels that make 16 rays, have Embree trace them, and shade them, row after row on every thread.

Three kernels: static flat, static textured, moving: what a scene does not need costs it nothing. Threads take rows from
one shared counter, so none waits for another, and a pixel depends on nothing but its own samples: the picture is the
same bit for bit on any number of threads.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import llvmlite.binding
import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from aliasbench.renderers.raytrace.bodies import fill_body_rays, may_see, to_body
from aliasbench.renderers.raytrace.embree import Device, TriangleScene, library_path, load_library
from aliasbench.renderers.raytrace.lanes import (
    HIT_GEOM,
    HIT_INSTANCE,
    HIT_PRIM,
    LANES,
    RAY_ID,
    RAY_MASK,
    RAY_SIZE,
    RAY_TFAR,
    SCRATCH_SIZE,
    KeyArray,
    Sampling,
    add_samples,
    aligned_floats,
    fill_columns,
    fill_keys,
    fill_moving_rays,
    fill_positions,
    fill_rays,
    fill_times,
)
from aliasbench.renderers.raytrace.shading import MISS, Tables, shade_flat, shade_textured
from aliasbench.renderers.raytrace.tables import Mesh
from aliasbench.renderers.raytrace.texturing import CUTOFF
from aliasbench.scenes.model import FloatArray

IntArray = NDArray[np.int32]
Kernel = Callable[..., None]

# TBB first, then Embree's own symbols, where compiled kernels (cached ones too) look for rtcIntersect16.
load_library()
llvmlite.binding.load_library_permanently(str(library_path()))

# A ctypes pointer would do the same, but kernels with one cannot be cached.
_intersect16 = types.ExternalFunction("rtcIntersect16", types.void(types.intp, types.intp, types.intp, types.intp))

_COHERENT = 1 << 16
_ALL_FEATURES = -1
_NOTHING = -1  # Embree's invalid id, as int32


@intrinsic
def _take_next(typing_context: Any, counter: Any) -> Any:  # noqa: ARG001 - numba passes it
    """Return the int64 at the start of an array and raise it by one, in one step that no other thread can split."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        return builder.atomic_rmw("add", array.data, ir.Constant(ir.IntType(64), 1), "monotonic")

    return types.int64(counter), generate


class Workspace(NamedTuple):
    """One thread's memory, aligned as Embree needs it; `holes` only keeps alive what `arguments` point to."""

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
    holes: NDArray[np.int64]


def make_workspace(width: int) -> Workspace:
    """Return memory for one thread that renders rows of `width` pixels."""
    ray, body_ray = aligned_floats(RAY_SIZE), aligned_floats(RAY_SIZE)
    valid, arguments = aligned_floats(LANES).view(np.int32), aligned_floats(LANES).view(np.int32)
    # RTCIntersectArguments: flags, feature mask, then pointers and a float that stay null.
    arguments[0], arguments[1] = _COHERENT, _ALL_FEATURES
    for ids in (ray.view(np.int32), body_ray.view(np.int32)):
        ids[RAY_MASK : RAY_MASK + LANES] = -1
        ids[RAY_ID : RAY_ID + LANES] = np.arange(LANES)
    return Workspace(
        np.zeros(SCRATCH_SIZE),
        ray,
        ray.view(np.int32),
        body_ray,
        body_ray.view(np.int32),
        valid,
        arguments,
        np.zeros(LANES, np.int32),
        np.zeros(3),
        np.zeros((4, width), np.uint64),
        np.zeros(0, np.int64),
    )


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def _trace(scene: int, work: Workspace, lanes: int) -> None:
    """Find the nearest hits on the mesh that stands still, MISS where there is none."""
    for i in range(LANES):
        work.ray[RAY_TFAR + i] = np.inf
        work.ray_ids[HIT_GEOM + i] = _NOTHING
        work.ray_ids[HIT_INSTANCE + i] = _NOTHING
        work.ray_ids[HIT_PRIM + i] = MISS
    for i in range(LANES):
        work.valid[i] = -1 if i < lanes else 0
    _intersect16(work.valid.ctypes.data, scene, work.ray.ctypes.data, work.arguments.ctypes.data)
    for i in range(LANES):
        work.hits[i] = work.ray_ids[HIT_PRIM + i]


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def _trace_bodies(scenes: NDArray[np.int64], tables: Tables, work: Workspace, row: int, left: int, right: int) -> None:
    """Find nearer hits on the bodies that move, each in its own frame."""
    for body in range(len(scenes)):
        if not may_see(tables.bodies[body], left, right, row):
            continue
        to_body(tables.bodies[body], work.scratch)
        fill_body_rays(work.scratch, work.ray, work.body_ray)
        for i in range(LANES):
            work.body_ids[HIT_GEOM + i] = _NOTHING
            work.body_ids[HIT_INSTANCE + i] = _NOTHING
        _intersect16(work.valid.ctypes.data, scenes[body], work.body_ray.ctypes.data, work.arguments.ctypes.data)
        first = np.int32(tables.firsts[body])
        for i in range(LANES):
            if work.body_ids[HIT_GEOM + i] != _NOTHING:
                work.hits[i] = first + work.body_ids[HIT_PRIM + i]
                work.ray[RAY_TFAR + i] = work.body_ray[RAY_TFAR + i]


@njit(nogil=True, cache=True, error_model="numpy", _nrt=False)
def render_static_flat(
    scene: int, camera: FloatArray, pattern: Sampling, tables: Tables, work: Workspace,
    counter: NDArray[np.int64], out: NDArray[np.float32],
) -> None:  # fmt: skip
    """Render rows until there are none left: nothing moves, no textures."""
    fill_columns(pattern, work.keys)
    while True:
        row = _take_next(counter)
        if row >= out.shape[0]:
            return
        fill_keys(pattern, row, work.keys)
        samples = out.shape[1] * pattern.samples
        for first in range(0, samples, LANES):
            lanes = min(LANES, samples - first)
            fill_positions(pattern, work.keys, row, first, lanes, work.scratch)
            fill_rays(camera, work.scratch, work.ray)
            _trace(scene, work, lanes)
            shade_flat(tables, work.hits, work.scratch)
            add_samples(pattern.samples, row, first, lanes, work.scratch, work.sums, out)


@njit(nogil=True, cache=True, error_model="numpy", _nrt=False)
def render_static_textured(
    scene: int, camera: FloatArray, pattern: Sampling, tables: Tables, work: Workspace,
    counter: NDArray[np.int64], out: NDArray[np.float32],
) -> None:  # fmt: skip
    """Render rows until there are none left: nothing moves."""
    fill_columns(pattern, work.keys)
    while True:
        row = _take_next(counter)
        if row >= out.shape[0]:
            return
        fill_keys(pattern, row, work.keys)
        samples = out.shape[1] * pattern.samples
        for first in range(0, samples, LANES):
            lanes = min(LANES, samples - first)
            fill_positions(pattern, work.keys, row, first, lanes, work.scratch)
            fill_rays(camera, work.scratch, work.ray)
            _trace(scene, work, lanes)
            shade_textured(tables, camera, work.hits, work.scratch)
            add_samples(pattern.samples, row, first, lanes, work.scratch, work.sums, out)


@njit(nogil=True, cache=True, error_model="numpy", _nrt=False)
def render_moving(
    scene: int, scenes: NDArray[np.int64], camera: FloatArray, pattern: Sampling, tables: Tables, work: Workspace,
    counter: NDArray[np.int64], out: NDArray[np.float32],
) -> None:  # fmt: skip
    """Render rows until there are none left: every sample has a time of its own."""
    textured = len(tables.triangles) > 0
    fill_columns(pattern, work.keys)
    while True:
        row = _take_next(counter)
        if row >= out.shape[0]:
            return
        fill_keys(pattern, row, work.keys)
        samples = out.shape[1] * pattern.samples
        for first in range(0, samples, LANES):
            lanes = min(LANES, samples - first)
            fill_positions(pattern, work.keys, row, first, lanes, work.scratch)
            fill_times(pattern, work.keys, first, lanes, work.scratch)
            fill_moving_rays(camera, work.scratch, work.ray)
            _trace(scene, work, lanes)
            _trace_bodies(scenes, tables, work, row, first // pattern.samples, (first + lanes - 1) // pattern.samples)
            if textured:
                shade_textured(tables, camera, work.hits, work.scratch)
            else:
                shade_flat(tables, work.hits, work.scratch)
            add_samples(pattern.samples, row, first, lanes, work.scratch, work.sums, out)


def run_kernel(
    kernel: Kernel,
    pool: ThreadPoolExecutor,
    workspaces: Sequence[Workspace],
    arguments: tuple[object, ...],
    out: NDArray[np.float32],
) -> None:
    """Fill `out` (h, w, 3) by a kernel on as many threads as there are workspaces, this one included.

    `arguments` are the kernel's, up to its workspace.
    """
    counter = np.zeros(1, np.int64)
    others = [pool.submit(kernel, *arguments, work, counter, out) for work in workspaces[1:]]
    kernel(*arguments, workspaces[0], counter, out)
    for other in others:
        other.result()


class PacketEngine:
    """Holds the scene's meshes in Embree and renders pictures with the kernels; see `tracer.Engine`."""

    __slots__ = ("_bodies", "_device", "_handles", "_pool", "_robust", "_still", "_threads")

    def __init__(self, threads: int, *, robust: bool) -> None:
        self._device = Device()
        self._robust = robust
        self._still: TriangleScene | None = None
        self._bodies: list[TriangleScene] = []
        self._handles = np.zeros(0, np.int64)
        self._threads = threads
        self._pool = ThreadPoolExecutor(max(threads - 1, 1), "aliasbench-rays")

    def _build(self, mesh: Mesh, number: int) -> TriangleScene:
        vertices = mesh.vertices.astype(np.float32)
        return TriangleScene(
            self._device, vertices, mesh.triangles, robust=self._robust, holed=mesh.holed, number=number
        )

    def set_still(self, mesh: Mesh) -> None:
        """Take the mesh that stands still (replacing the one before)."""
        if self._still is not None:
            self._still.close()
        self._still = self._build(mesh, 0)

    def set_moving(self, meshes: Sequence[Mesh]) -> None:
        """Take the meshes of the moving bodies, in their own frames."""
        for body in self._bodies:
            body.close()
        self._bodies = [self._build(mesh, 1 + k) for k, mesh in enumerate(meshes)]
        self._handles = np.array([body.handle for body in self._bodies], np.int64)

    def fill(
        self, camera: FloatArray, pattern: Sampling, tables: Tables, moving: bool, out: NDArray[np.float32]
    ) -> None:
        """Write the picture (h, w, 3)."""
        if self._still is None:
            raise RuntimeError("this renderer has been closed")
        shared: tuple[object, ...] = (camera, pattern, tables)
        if moving:
            kernel, arguments = render_moving, (self._still.handle, self._handles, *shared)
        else:
            textured = len(tables.triangles) > 0
            kernel = render_static_textured if textured else render_static_flat
            arguments = (self._still.handle, *shared)
        workspaces = [make_workspace(out.shape[1]) for _ in range(min(self._threads, len(out)))]
        if len(tables.triangles) and (tables.objects[:, CUTOFF] > -np.inf).any():
            from aliasbench.renderers.raytrace.cutout_filter import set_holes

            workspaces = [w._replace(holes=set_holes(w.arguments, tables, camera, w.scratch)) for w in workspaces]
        run_kernel(kernel, self._pool, workspaces, arguments, out)

    def close(self) -> None:
        """Free everything (again is harmless)."""
        self._pool.shutdown()
        self.set_moving(())
        if self._still is not None:
            self._still.close()
            self._still = None
        self._device.close()
