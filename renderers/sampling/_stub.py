import numpy as np
from numba import njit
def bluenoise_tile(count):
    return np.arange(4, dtype=np.uint32).reshape(2, 2)
@njit(inline="always", cache=True)
def tile_keys(identity):
    return np.uint32(identity), np.uint32(identity)
@njit(inline="always", cache=True)
def tile_offset(start, pair, side):
    return 0, 0
