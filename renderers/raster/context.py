"""Which OpenGL a technique gets, what this machine has, and contexts that are made once.

`backend=auto` tries EGL's devices in their order (drivers list GPUs before software), then OSMesa; when all fail, one
error lists each attempt with its fix. A context costs tens of milliseconds, so each thread keeps one for every backend
and device until the process ends.
"""

import atexit
import os
import threading
from dataclasses import dataclass

from aliasbench.renderers.raster.graphics import GraphicsContext
from aliasbench.renderers.raster.platforms import (
    ContextError,
    EglContext,
    EglDevice,
    NativeContext,
    OsmesaContext,
    egl_devices,
)
from aliasbench.scenes.errors import InputError, unknown_name
from aliasbench.scenes.model import FloatArray

BACKENDS = ("auto", "egl", "osmesa")


class NoContextError(InputError):
    """No OpenGL context of the wanted kind can be made here; the message lists each attempt with its fix."""


@dataclass(frozen=True, slots=True)
class ContextReport:
    """What one backend (and EGL device) of this machine can do, or why it cannot be used.

    Attributes
    ----------
    backend : "egl" or "osmesa"
    device : int or None
        The number for `device=`; None where there is no choice.
    ok : bool
    software : bool
        Whether pictures are made by the processor.
    renderer, vendor, version : str
        What the driver says of itself; empty unless `ok`.
    max_texture_size, max_samples : int
    sample_positions : tuple of (count, positions)
        For each number of hardware samples the device has exactly, their places in the pixel: (x, y) in pixels, x to
        the right and y down.
    error, fix : str
        Why it cannot be used and what helps; empty where `ok`.
    """

    backend: str
    device: int | None
    ok: bool
    software: bool = False
    renderer: str = ""
    vendor: str = ""
    version: str = ""
    max_texture_size: int = 0
    max_samples: int = 1
    sample_positions: tuple[tuple[int, tuple[tuple[float, float], ...]], ...] = ()
    error: str = ""
    fix: str = ""

    @property
    def sample_counts(self) -> tuple[int, ...]:
        """The values of `msaa` that this device takes."""
        return tuple(count for count, _ in self.sample_positions)


class _Pool:
    """The contexts of this process. Shared state, because a context is dear, tied to the process and freed at exit."""

    def __init__(self) -> None:
        self._made: dict[tuple[int, int, str, int | None], GraphicsContext] = {}
        atexit.register(self.release)

    def get(self, backend: str, device: EglDevice | None) -> GraphicsContext:
        key = (os.getpid(), threading.get_ident(), backend, None if device is None else device.index)
        if key not in self._made:
            native: NativeContext = OsmesaContext() if device is None else EglContext(device)
            self._made[key] = GraphicsContext(backend, device, native)
        return self._made[key]

    def release(self) -> None:
        for key in list(self._made):
            context = self._made.pop(key)
            if key[0] == os.getpid():
                context.release()


_POOL = _Pool()


def _attempts(backend: str, device: int | None) -> list[tuple[str, EglDevice | None, ContextError | None]]:
    """Return what to try, in order: (backend, device, the reason why there is nothing to try)."""
    out: list[tuple[str, EglDevice | None, ContextError | None]] = []
    if backend in ("auto", "egl"):
        try:
            out += [("egl", d, None) for d in egl_devices() if device in (None, d.index)]
        except ContextError as error:
            out.append(("egl", None, error))
        if not out:
            count = len(egl_devices())
            raise InputError(f"device={device}: EGL lists {count} device{'s'[: count > 1]} here, numbered from 0")
    if backend in ("auto", "osmesa") and device is None:
        out.append(("osmesa", None, None))
    return out


def acquire_context(backend: str = "auto", device: int | None = None) -> GraphicsContext:
    """Return this thread's context for a backend and device, making it at the first call.

    Parameters
    ----------
    backend : "auto", "egl" or "osmesa"
    device : int, optional
        Which of EGL's devices (`describe_contexts` numbers them); left out, the first that works.

    Raises
    ------
    NoContextError
        If none can be made; the message lists each attempt with its fix.
    InputError
        For an unknown backend, a device EGL does not list, or a device with osmesa.
    """
    if backend not in BACKENDS:
        raise unknown_name("backend", backend, BACKENDS)
    if backend == "osmesa" and device is not None:
        raise InputError(f"device={device}: backend=osmesa has no devices; device is for backend=egl")
    failures = []
    for name, egl_device, failure in _attempts(backend, device):
        label = "EGL" if name == "egl" else "OSMesa"
        if egl_device is not None:
            label += f" device {egl_device.index}"
        try:
            if failure is not None:
                raise failure
            return _POOL.get(name, egl_device)
        except ContextError as error:
            failures.append(f"{label}: {error.reason} ({error.fix})")
    raise NoContextError(f"backend={backend}: no OpenGL context can be made; {'; '.join(failures)}")


def describe_contexts() -> list[ContextReport]:
    """Return a report for every EGL device (one for EGL as a whole if it has none) and for OSMesa, in auto's order."""
    return [_describe(*attempt) for attempt in _attempts("auto", None)]


def _describe(backend: str, device: EglDevice | None, failure: ContextError | None) -> ContextReport:
    index = None if device is None else device.index
    try:
        if failure is not None:
            raise failure
        context = _POOL.get(backend, device)
    except ContextError as error:
        return ContextReport(backend, index, False, error=error.reason, fix=error.fix)
    info = context.gl.info
    positions = tuple(
        (n, tuple((float(x), float(y)) for x, y in context.sample_positions(n))) for n in context.sample_counts
    )
    return ContextReport(
        backend,
        index,
        True,
        context.software,
        context.renderer,
        str(info["GL_VENDOR"]),
        str(info["GL_VERSION"]),
        context.max_texture_size,
        max(context.sample_counts),
        positions,
    )


def sample_positions(count: int, *, backend: str = "auto", device: int | None = None) -> FloatArray:
    """Return (count, 2) float64 places of a device's hardware samples in the pixel, x right and y down, in (0, 1).

    Raises
    ------
    InputError
        If the device does not have exactly that number of samples, or there is no such device.
    """
    context = acquire_context(backend, device)
    check_samples(context, count)
    return context.sample_positions(count)


def check_samples(context: GraphicsContext, count: int) -> None:
    """Raise InputError unless the device has exactly `count` samples a pixel; the message says how to have more."""
    known = context.sample_counts
    if count in known:
        return
    best = max(n for n in known if n <= count)
    passes = -(-count // best)
    more = f"msaa={best},passes={passes}" if best > 1 else f"passes={passes}"
    raise InputError(
        f"msaa={count}: this device ({context.renderer}) has {', '.join(map(str, known))} samples a pixel; "
        f"{more} takes {best * passes}"
    )
