"""Holes for Embree: a function that it calls for every triangle hit which may have holes, to take back those in one.

Embree then goes on with the same ray in the same traversal: that costs one look-up for each layer and no new ray, and
neither order nor distance of layers matters. The alternative, to send a ray again from just beyond each hole, costs a
traversal for each layer and passes over what touches the layer.

The function is compiled on import, which only scenes with cut-outs cause. Embree hands it one pointer of ours, to the
addresses of what a test for holes needs.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray, cfunc, njit, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from aliasbench.renderers.lights import LIGHT_SIZE
from aliasbench.renderers.raytrace.bodies import BODY_SIZE
from aliasbench.renderers.raytrace.cutouts import is_hole, write_packet_alpha
from aliasbench.renderers.raytrace.lanes import CAMERA_SIZE, RED, SCRATCH_SIZE
from aliasbench.renderers.raytrace.shading import TRIANGLE_SIZE, EwaTables, Tables
from aliasbench.renderers.raytrace.texturing import CUTOFF, OBJECT_SIZE
from aliasbench.scenes.model import FloatArray

AddressArray = NDArray[np.int64]

# RTCFilterFunctionNArguments in 64-bit words: int* valid, user pointer, context, RTCRayN*, RTCHitN*, unsigned N.
_VALID, _USER, _CONTEXT, _RAY, _HIT, _COUNT, _ARGUMENTS_SIZE = 0, 1, 2, 3, 4, 5, 6
# RTCRayN and RTCHitN are rows of N (rtcore_ray.h): the id among 12 rows, the triangle's number among 8.
_RAY_ID_ROW, _RAY_ROWS, _PRIM_ROW, _HIT_ROWS = 10, 12, 5, 8
# RTCIntersectArguments in 64-bit words: flags and features, context, filter.
_CONTEXT_WORD, _FILTER_WORD = 1, 2

# Words of our context: Embree's own (instance and its primitive: none), then addresses, each with its rows where they
# vary, and the footprint as the bits of a float64.
_SCRATCH, _CAMERA, _FOOTPRINT, _OBJECTS, _OWNERS, _TRIANGLES, _BODIES, _FIRSTS, _LEVELS, _TEXELS = (
    1, 2, 3, 4, 6, 8, 10, 12, 14, 16,
)  # fmt: skip
_CONTEXT_SIZE = 18
_PACKET_WORTH = 4


def set_holes(arguments: NDArray[np.int32], tables: Tables, camera: FloatArray, scratch: FloatArray) -> AddressArray:
    """Have the intersections under `arguments` (of one thread, whose lanes are `scratch`) pass through holes.

    The rays' ids must be their lanes, and each geometry's user data 0, or k + 1 for that of moving body k. What is
    returned, and all arrays given, must live until the last intersection.
    """
    words = np.zeros(_CONTEXT_SIZE, np.int64)
    words[0] = -1
    words[_SCRATCH], words[_CAMERA] = scratch.ctypes.data, camera.ctypes.data
    words.view(np.float64)[_FOOTPRINT] = tables.footprint
    for at, array in (
        (_OBJECTS, tables.objects),
        (_OWNERS, tables.owners),
        (_TRIANGLES, tables.triangles),
        (_BODIES, tables.bodies),
        (_FIRSTS, tables.firsts),
        (_LEVELS, tables.levels),
        (_TEXELS, tables.texels),
    ):
        words[at], words[at + 1] = array.ctypes.data, len(array)
    addresses = arguments.view(np.int64)
    addresses[_CONTEXT_WORD], addresses[_FILTER_WORD] = words.ctypes.data, _drop_holes.address
    return words


@intrinsic
def _pointer(typing_context: Any, address: Any) -> Any:  # noqa: ARG001 - numba passes it
    """Return an address as a pointer."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
        return builder.inttoptr(arguments[0], ir.IntType(8).as_pointer())

    return types.voidptr(types.int64), generate


@njit(cache=True, forceinline=True, error_model="numpy")
def _tables(words: AddressArray, camera: FloatArray) -> Tables:
    """Return the tables that a context has the addresses of; lights and background are not among them."""
    return EwaTables(
        carray(_pointer(words[_OBJECTS]), (words[_OBJECTS + 1], OBJECT_SIZE), np.float64),
        carray(_pointer(words[_OWNERS]), (words[_OWNERS + 1],), np.int32),
        carray(_pointer(words[_TRIANGLES]), (words[_TRIANGLES + 1], TRIANGLE_SIZE), np.float64),
        carray(_pointer(words[_BODIES]), (words[_BODIES + 1], BODY_SIZE), np.float64),
        carray(_pointer(words[_FIRSTS]), (words[_FIRSTS + 1],), np.int64),
        carray(_pointer(words[_LEVELS]), (words[_LEVELS + 1], 3), np.int64),
        carray(_pointer(words[_TEXELS]), (words[_TEXELS + 1], 4), np.float32),
        carray(_pointer(words[_OBJECTS]), (0, LIGHT_SIZE), np.float64),
        camera,
        words.view(np.float64)[_FOOTPRINT],
    )


@cfunc(types.void(types.CPointer(types.int64)), cache=True, error_model="numpy")
def _drop_holes(arguments: Any) -> None:
    """Take back the hits of a packet that lie in holes (RTCFilterFunctionN: clear their `valid`)."""
    given = carray(arguments, (_ARGUMENTS_SIZE,))
    # The upper half of the last word is padding.
    count = given[_COUNT] & 0xFFFFFFFF
    valid = carray(_pointer(given[_VALID]), (count,), np.int32)
    ids = carray(_pointer(given[_RAY]), (_RAY_ROWS * count,), np.int32)
    prims = carray(_pointer(given[_HIT]), (_HIT_ROWS * count,), np.int32)
    words = carray(_pointer(given[_CONTEXT]), (_CONTEXT_SIZE,), np.int64)
    camera = carray(_pointer(words[_CAMERA]), (CAMERA_SIZE,), np.float64)
    scratch = carray(_pointer(words[_SCRATCH]), (SCRATCH_SIZE,), np.float64)
    tables = _tables(words, camera)
    body = given[_USER]
    first = tables.firsts[body - 1] if body > 0 else 0
    # Most calls are about one triangle; with few lanes left their own look-ups cost less than a packet's.
    prim, left, is_one = -1, 0, True
    for k in range(count):
        if valid[k] != 0:
            is_one &= left == 0 or prims[_PRIM_ROW * count + k] == prim
            prim = prims[_PRIM_ROW * count + k]
            left += 1
    hit = first + prim
    if is_one and left >= _PACKET_WORTH and write_packet_alpha(tables, camera, hit, scratch):
        cutoff = tables.objects[tables.owners[hit], CUTOFF]
        for k in range(count):
            if valid[k] != 0 and np.float32(scratch[RED + ids[_RAY_ID_ROW * count + k]]) < cutoff:
                valid[k] = 0
        return
    for k in range(count):
        if valid[k] != 0:
            hit = first + prims[_PRIM_ROW * count + k]
            if is_hole(tables, camera, hit, scratch, ids[_RAY_ID_ROW * count + k]):
                valid[k] = 0
