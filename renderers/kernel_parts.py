"""Decorators for what only kernels call: compiled with them, and with no way in from Python.

Those ways in (unpacking of arguments, a C function) are an eighth of what kernels take to compile. In Python itself the
functions stay what is written. Who holds an array is not counted in what makes none: ways in and counts were a third of
compiling the references, and counts half of the time of those under lights. `njit` is for kernels, for parts that
Python calls as well, and for parts that are to be compiled anew for each integer that is written out in a call; here
all such integers are alike.
"""

from collections.abc import Callable
from typing import Any

from numba.extending import register_jitable


def inlined(function: Callable[..., Any]) -> Any:
    """Return the function, to be compiled into every kernel that calls it and optimised there."""
    return register_jitable(cache=True, forceinline=True, error_model="numpy", _nrt=False, no_cfunc_wrapper=True)(
        function
    )


def called(function: Callable[..., Any]) -> Any:
    """Return the function, to be compiled once; it makes no arrays, copies no slices and returns neither."""
    return register_jitable(cache=True, error_model="numpy", _nrt=False, no_cfunc_wrapper=True)(function)


def allocating(function: Callable[..., Any]) -> Any:
    """Return the function, to be compiled once; unlike the others it may make arrays, copy slices and return either."""
    # said, or a caller that makes none would decide
    return register_jitable(cache=True, error_model="numpy", _nrt=True, no_cfunc_wrapper=True)(function)
