"""Cut-out textures: whether a ray that meets a triangle passes through a hole in it.

One test for both engines, on what shading uses: the ray's place on the triangle in float64, the texture there in the
technique's own mode, and its alpha in single precision, as alpha is stored and as the other renderers compare it. What
a hole shows is then the next surface that the very same ray meets: no ray is moved or sent again from behind a hole,
which would miss what touches it.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.raytrace.lanes import LANES, LX
from aliasbench.renderers.raytrace.shading import MISS, Tables, place_along, place_lane, place_packet
from aliasbench.renderers.raytrace.texturing import CUTOFF, KIND, MIPMAP, alpha_lane, alpha_packet
from aliasbench.scenes.model import FloatArray


@njit(cache=True, error_model="numpy", _nrt=False)
def is_hole(tables: Tables, camera: FloatArray, hit: int, scratch: FloatArray, i: int) -> bool:
    """Return whether triangle `hit` is absent where the ray of lane i meets it; the lane's place there is written."""
    values = tables.objects[tables.owners[hit]]
    if values[CUTOFF] == -np.inf:
        return False
    place_lane(tables, camera, hit, scratch, i)
    return np.float32(alpha_lane(tables, values, scratch, i)) < values[CUTOFF]


@njit(cache=True, forceinline=True, error_model="numpy", _nrt=False)
def write_packet_alpha(tables: Tables, camera: FloatArray, hit: int, scratch: FloatArray) -> bool:
    """Write where red goes the alpha of a triangle on all 16 rays, as `is_hole` finds it; return whether that can be.

    It can where the triangle stands still, or no level of detail is asked for and `scratch` has the rays in its frame.
    """
    values = tables.objects[tables.owners[hit]]
    if hit < tables.firsts[0]:
        place_packet(tables, camera, hit, scratch)
    elif values[KIND] < MIPMAP:
        place_along(tables.triangles[hit], scratch, LX)
    else:
        return False
    alpha_packet(tables, values, scratch)
    return True


@njit(cache=True, error_model="numpy", _nrt=False)
def find_holes(
    tables: Tables, camera: FloatArray, hits: NDArray[np.int32], rays: NDArray[np.int64], scratch: FloatArray,
    holes: NDArray[np.bool_],
) -> None:  # fmt: skip
    """Write which of `hits` (k,), on the rays of those numbers in packets of `scratch`, are holes: `holes` (k,)."""
    for k in range(len(hits)):
        at = rays[k]
        holes[k] = hits[k] != MISS and is_hole(tables, camera, hits[k], scratch[at // LANES], at % LANES)
