"""An OpenGL context and what moderngl leaves out of it: exact storage, sample positions, the resolve, checked errors.

OpenGL 3.3 core with GL_ARB_clip_control is required: depth is 32-bit float with a [0, 1] clip range (see `projection`).
A context is locked and current inside `GraphicsContext.use` only, which also lets a prepared scene be rendered on
another thread than the one that made it.
"""

import ctypes
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.resources import files
from typing import Any

import moderngl
import numpy as np

from aliasbench.renderers.raster.platforms import ContextError, EglDevice, NativeContext
from aliasbench.scenes.model import FloatArray

RGBA32F, DEPTH32F = 0x8814, 0x8CAC
# the numbers of samples that hardware has
_POWERS = (2, 4, 8, 16, 32, 64)
_RENDERBUFFER, _RENDERBUFFER_SAMPLES, _SAMPLE_POSITION = 0x8D41, 0x8CAB, 0x8E50
_LOWER_LEFT, _ZERO_TO_ONE = 0x8CA1, 0x935F
_READ_FRAMEBUFFER, _DRAW_FRAMEBUFFER, _COLOR_BIT, _NEAREST = 0x8CA8, 0x8CA9, 0x4000, 0x2600


class GraphicsError(RuntimeError):
    """OpenGL reported an error after a step; the message names both."""


def read_shader(name: str) -> str:
    """Return the text of a shader file of this package."""
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


class GraphicsContext:
    """An OpenGL context with what moderngl leaves out; everything is done inside `use`.

    Attributes
    ----------
    backend, device : str, int or None
    gl : moderngl.Context
    max_size : int
        Largest width or height of a picture.
    max_texture_size : int
    sample_counts : tuple of int
        Numbers of samples that colour and depth targets have exactly, 1 included.
    """

    def __init__(self, backend: str, device: EglDevice | None, native: NativeContext) -> None:
        self.backend = backend
        self.device = None if device is None else device.index
        self.software = device is None or device.software
        self._native = native
        self._lock = threading.RLock()
        self._in_use = False
        self._programs: dict[tuple[str, str], moderngl.Program] = {}
        self._left_over: deque[Callable[[], None]] = deque()
        with native:
            try:
                settings: dict[str, Any] = {"context": native}
                self.gl = moderngl.create_context(require=330, standalone=True, **settings)
            except (moderngl.Error, ValueError) as error:
                raise ContextError(f"OpenGL 3.3 core: {error}", "update the driver") from None
            if "GL_ARB_clip_control" not in self.gl.extensions:
                raise ContextError("the driver has no GL_ARB_clip_control", "update the driver")
            info = self.gl.info
            self.max_size = int(min(info["GL_MAX_RENDERBUFFER_SIZE"], *info["GL_MAX_VIEWPORT_DIMS"]))
            self.max_texture_size = int(info["GL_MAX_TEXTURE_SIZE"])
            self._function("glClipControl", ctypes.c_uint, ctypes.c_uint)(_LOWER_LEFT, _ZERO_TO_ONE)
            # what is bound between uses: moderngl binds again what was bound before, which must then still exist
            self._idle = self.gl.simple_framebuffer((1, 1))
            self._idle.use()
            self.sample_counts = (1, *(n for n in _POWERS if n <= self.gl.max_samples and self._has_samples(n)))
            self.check("making a context")

    def _function(self, name: str, *arguments: type) -> Callable[..., None]:
        address = self._native.load_opengl_function(name)
        if not address:
            raise ContextError(f"the driver has no {name}", "update the driver")
        return ctypes.CFUNCTYPE(None, *arguments)(address)

    @contextmanager
    def use(self) -> Iterator[moderngl.Context]:
        """Make the context current on this thread, alone, until the outermost such block ends."""
        with self._lock:
            if self._in_use:
                yield self.gl
                return
            with self.gl:
                self._in_use = True
                try:
                    yield self.gl
                finally:
                    self._in_use = False
                    self._idle.use()

    def check(self, step: str) -> None:
        """Raise GraphicsError if OpenGL has recorded an error since the last check."""
        error = self.gl.error
        if error != "GL_NO_ERROR":
            raise GraphicsError(f"OpenGL reports {error} after {step} ({self.backend}, {self.renderer})")

    @property
    def renderer(self) -> str:
        """The driver's name for the device."""
        return str(self.gl.info["GL_RENDERER"])

    def release_later(self, release: Callable[[], None]) -> None:
        """Remember what a prepared scene that nobody closed has left here; `release_left_over` frees it.

        Callable at any moment, as the garbage collector does, while another context may be current.
        """
        self._left_over.append(release)

    def release_left_over(self) -> None:
        """Free what forgotten prepared scenes have left; inside `use`."""
        while self._left_over:
            self._left_over.popleft()()

    def program(self, vertex: str, fragment: str) -> moderngl.Program:
        """Return a linked program, the same object for the same sources."""
        key = (vertex, fragment)
        if key not in self._programs:
            self._programs[key] = self.gl.program(vertex_shader=vertex, fragment_shader=fragment)
        return self._programs[key]

    def store(self, renderbuffer: moderngl.Renderbuffer, size: tuple[int, int], samples: int, layout: int) -> int:
        """Give a renderbuffer storage of an exact layout; return the number of samples it got (0 counts as 1).

        moderngl knows no 32-bit float depth, and OpenGL may round the number up.
        """
        u, i = ctypes.c_uint, ctypes.c_int
        self._function("glBindRenderbuffer", u, u)(_RENDERBUFFER, renderbuffer.glo)
        wanted = 0 if samples == 1 else samples
        self._function("glRenderbufferStorageMultisample", u, i, u, i, i)(_RENDERBUFFER, wanted, layout, *size)
        got = ctypes.c_int()
        self._function("glGetRenderbufferParameteriv", u, u, ctypes.c_void_p)(
            _RENDERBUFFER, _RENDERBUFFER_SAMPLES, ctypes.byref(got)
        )
        return max(1, got.value)

    def _has_samples(self, samples: int) -> bool:
        """Whether colour (as a texture) and depth can have that number of samples, neither more nor less."""
        texture = None
        color, depth = self.gl.renderbuffer((1, 1), 4, dtype="f4"), self.gl.depth_renderbuffer((1, 1))
        try:
            stored = [self.store(color, (1, 1), samples, RGBA32F), self.store(depth, (1, 1), samples, DEPTH32F)]
            texture = self.gl.texture((1, 1), 4, dtype="f4", samples=samples)
            return stored == [samples, samples]
        except moderngl.Error:
            return False
        finally:
            for made in (color, depth, texture):
                if made is not None:
                    made.release()
            # a refusal is an answer here
            self.gl.clear_errors()

    def resolve(self, source: moderngl.Framebuffer, target: moderngl.Framebuffer) -> None:
        """Average a multisampled colour target into a plain one, in linear light."""
        u, i = ctypes.c_uint, ctypes.c_int
        bind = self._function("glBindFramebuffer", u, u)
        bind(_READ_FRAMEBUFFER, source.glo)
        bind(_DRAW_FRAMEBUFFER, target.glo)
        box = (0, 0, *source.size)
        self._function("glBlitFramebuffer", *[i] * 8, u, u)(*box, *box, _COLOR_BIT, _NEAREST)
        self.check("averaging the hardware samples")

    def sample_positions(self, count: int) -> FloatArray:
        """Return (count, 2) places of the hardware samples in the pixel, x right and y down.

        Rows are drawn top first (see `projection`), so OpenGL's upward y is the picture's downward y.
        """
        if count == 1:
            return np.full((1, 2), 0.5)
        query = self._function("glGetMultisamplefv", ctypes.c_uint, ctypes.c_uint, ctypes.c_void_p)
        out = np.empty((count, 2), np.float32)
        with self.use() as gl:
            color = gl.renderbuffer((1, 1), 4, dtype="f4")
            self.store(color, (1, 1), count, RGBA32F)
            target = gl.framebuffer([color])
            target.use()
            for k in range(count):
                query(_SAMPLE_POSITION, k, out[k].ctypes.data)
            self._idle.use()
            target.release()
            color.release()
            self.check("asking for the sample positions")
        return out.astype(np.float64)

    def release(self) -> None:
        """Destroy the context."""
        self._native.release()
