"""Code that few techniques need, left out of the kernels of all others: numba compiles what a branch could lead to.

A kernel is compiled for the types of its arguments. What a rare technique's data are of a class of their own for, is
compiled into the kernels for that class alone, when such a technique is first used.
"""

from collections.abc import Callable
from typing import Any, TypeVar

from numba.extending import overload

F = TypeVar("F", bound=Callable[..., Any])


def compiled_if_rare(otherwise: Any) -> Callable[[F], F]:
    """Return a decorator for kernels whose first argument is a named tuple; they are there where its class is RARE.

    Kernels for other classes have the constant `otherwise` in its place, of the same type as the kernel's result: they
    are never to come to it.
    """

    def decorate(kernel: F) -> F:
        def call(data: Any, *rest: Any) -> Any:
            return kernel(data, *rest)

        @overload(call, jit_options={"forceinline": True, "error_model": "numpy", "_nrt": False})
        def choose(data: Any, *rest: Any) -> Any:  # noqa: ARG001 - their types decide
            if getattr(data.instance_class, "RARE", False):

                def run(data: Any, *rest: Any) -> Any:
                    return kernel(data, *rest)

                return run

            def skip(data: Any, *rest: Any) -> Any:  # noqa: ARG001 - as above
                return otherwise

            return skip

        return call  # type: ignore[return-value]

    return decorate
