"""OpenGL without a window: EGL devices (a GPU or Mesa's software device) and OSMesa, made by hand through ctypes.

moderngl accepts any object that loads functions and makes itself current. Two such objects live here, instead of
glcontext's, for three reasons: every failing step has its own code and so its own sentence with the fix; the libraries
are found under the names that run-time packages install; and a context is let go after each use (the drivers of both
kinds share one current-context slot for each thread, so one left current would be restored wrongly).
"""

import ctypes
from dataclasses import dataclass
from typing import Protocol, Self

EGL_FIX = "install the packages libegl1, libgl1 and libgl1-mesa-dri"
OSMESA_FIX = "install the package libosmesa6 (Mesa up to 25.0)"
_EGL_LIBRARY = "libEGL.so.1"
_OSMESA_LIBRARIES = ("libOSMesa.so.8", "libOSMesa.so")

_EGL_PLATFORM_DEVICE = 0x313F
_EGL_EXTENSIONS = 0x3055
_EGL_DRM_DEVICE_FILE = 0x3233
_EGL_OPENGL_API = 0x30A2
_EGL_NONE = 0x3038
# surface type: pbuffer; renderable type: OpenGL
_EGL_CONFIG = (0x3033, 0x0001, 0x3040, 0x0008, _EGL_NONE)
# OpenGL 3.3, core profile
_EGL_CONTEXT = (0x3098, 3, 0x30FB, 3, 0x30FD, 0x0001, _EGL_NONE)
# RGBA, no depth, no stencil, no accumulation, core profile, OpenGL 3.3; a final 0
_OSMESA_CONTEXT = (0x22, 0x1908, 0x30, 0, 0x31, 0, 0x32, 0, 0x33, 0x34, 0x36, 3, 0x37, 3, 0)
_GL_UNSIGNED_BYTE = 0x1401

_Handle = ctypes.c_void_p


class ContextError(RuntimeError):
    """A context could not be made; `reason` says which step failed, `fix` what helps."""

    def __init__(self, reason: str, fix: str) -> None:
        super().__init__(f"{reason}; {fix}")
        self.reason = reason
        self.fix = fix


class NativeContext(Protocol):
    """What moderngl needs of a context: it loads functions by name and is current inside `with`."""

    def load_opengl_function(self, name: str) -> int: ...

    def __enter__(self) -> Self: ...

    def __exit__(self, *details: object) -> None: ...

    def release(self) -> None: ...


@dataclass(frozen=True, slots=True)
class EglDevice:
    """An EGL device: its number for `device=`, the system's file for it, and whether it is software."""

    index: int
    handle: int
    file: str
    software: bool


def _ints(values: tuple[int, ...]) -> "ctypes.Array[ctypes.c_int]":
    return (ctypes.c_int * len(values))(*values)


def _open_egl() -> ctypes.CDLL:
    try:
        egl = ctypes.CDLL(_EGL_LIBRARY)
    except OSError as error:
        raise ContextError(f"{_EGL_LIBRARY} cannot be loaded ({error})", EGL_FIX) from None
    egl.eglGetProcAddress.restype = _Handle
    egl.eglGetProcAddress.argtypes = [ctypes.c_char_p]
    egl.eglQueryString.restype = ctypes.c_char_p
    egl.eglQueryString.argtypes = [_Handle, ctypes.c_int]
    egl.eglInitialize.argtypes = [_Handle, _Handle, _Handle]
    egl.eglChooseConfig.argtypes = [_Handle, _Handle, _Handle, ctypes.c_int, _Handle]
    egl.eglCreateContext.restype = _Handle
    egl.eglCreateContext.argtypes = [_Handle, _Handle, _Handle, _Handle]
    egl.eglMakeCurrent.argtypes = [_Handle] * 4
    egl.eglDestroyContext.argtypes = [_Handle] * 2
    return egl


def _egl_extension(egl: ctypes.CDLL, name: str, result: type, *arguments: type) -> "ctypes._FuncPointer":
    address = egl.eglGetProcAddress(name.encode())
    if not address:
        raise ContextError(f"{_EGL_LIBRARY} has no {name}", EGL_FIX)
    return ctypes.CFUNCTYPE(result, *arguments)(address)


def egl_devices() -> tuple[EglDevice, ...]:
    """Return the EGL devices of this machine, in the driver's order.

    Raises
    ------
    ContextError
        If the library is missing or lists no devices at all.
    """
    egl = _open_egl()
    query = _egl_extension(
        egl,
        "eglQueryDevicesEXT",
        ctypes.c_uint,
        ctypes.c_int,
        ctypes.POINTER(_Handle),
        ctypes.POINTER(ctypes.c_int),
    )
    describe = _egl_extension(egl, "eglQueryDeviceStringEXT", ctypes.c_char_p, _Handle, ctypes.c_int)
    handles, count = (_Handle * 64)(), ctypes.c_int()
    if not query(len(handles), handles, ctypes.byref(count)) or not count.value:
        raise ContextError("EGL finds no device (no driver is installed)", EGL_FIX)
    devices = []
    for index in range(count.value):
        handle = handles[index]
        extensions = (describe(handle, _EGL_EXTENSIONS) or b"").decode().split()
        file = ""
        if "EGL_EXT_device_drm" in extensions:
            file = (describe(handle, _EGL_DRM_DEVICE_FILE) or b"").decode()
        devices.append(EglDevice(index, int(handle or 0), file, "EGL_MESA_device_software" in extensions))
    return tuple(devices)


class EglContext:
    """An OpenGL 3.3 core context on one EGL device, current inside `with` only."""

    def __init__(self, device: EglDevice) -> None:
        self._egl = _open_egl()
        get_display = _egl_extension(
            self._egl, "eglGetPlatformDisplayEXT", _Handle, ctypes.c_uint, _Handle, ctypes.POINTER(ctypes.c_int)
        )
        access = f"let this user open {device.file}" if device.file else EGL_FIX
        self._display = get_display(_EGL_PLATFORM_DEVICE, device.handle, None)
        if not self._display or not self._egl.eglInitialize(self._display, None, None):
            raise self._failure("eglInitialize", access)
        if not self._egl.eglBindAPI(_EGL_OPENGL_API):
            raise self._failure("eglBindAPI(OpenGL)", EGL_FIX)
        config, count = _Handle(), ctypes.c_int()
        chosen = self._egl.eglChooseConfig(
            self._display, _ints(_EGL_CONFIG), ctypes.byref(config), 1, ctypes.byref(count)
        )
        if not chosen or not count.value:
            raise self._failure("eglChooseConfig", EGL_FIX)
        self._context = self._egl.eglCreateContext(self._display, config, None, _ints(_EGL_CONTEXT))
        if not self._context:
            raise self._failure("eglCreateContext", "the driver must support OpenGL 3.3 core; update it")

    def _failure(self, step: str, fix: str) -> ContextError:
        return ContextError(f"{step} failed ({self._egl.eglGetError():#06x})", fix)

    def load_opengl_function(self, name: str) -> int:
        """Return the address of a GL function, 0 where there is none."""
        return int(self._egl.eglGetProcAddress(name.encode()) or 0)

    def __enter__(self) -> Self:
        # the API is bound for each thread; without it a context made on another thread cannot become current here
        self._egl.eglBindAPI(_EGL_OPENGL_API)
        if not self._egl.eglMakeCurrent(self._display, None, None, self._context):
            raise self._failure("eglMakeCurrent", "use a prepared scene on one thread at a time")
        return self

    def __exit__(self, *details: object) -> None:
        self._egl.eglMakeCurrent(self._display, None, None, None)

    def release(self) -> None:
        """Destroy the context; a second call does nothing."""
        if self._context:
            self._egl.eglMakeCurrent(self._display, None, None, None)
            self._egl.eglDestroyContext(self._display, self._context)
            self._context = None


class OsmesaContext:
    """An OpenGL 3.3 core context of OSMesa (software, no driver needed), current inside `with` only."""

    def __init__(self) -> None:
        self._library = self._open()
        self._context = self._library.OSMesaCreateContextAttribs(_ints(_OSMESA_CONTEXT), None)
        if not self._context:
            raise ContextError("OSMesaCreateContextAttribs failed", "OSMesa must support OpenGL 3.3 core; update it")
        # OSMesa wants a picture to draw to and keeps its address
        self._picture = (ctypes.c_ubyte * 4)()

    @staticmethod
    def _open() -> ctypes.CDLL:
        for name in _OSMESA_LIBRARIES:
            try:
                library = ctypes.CDLL(name)
            except OSError:
                continue
            library.OSMesaCreateContextAttribs.restype = _Handle
            library.OSMesaCreateContextAttribs.argtypes = [_Handle, _Handle]
            library.OSMesaMakeCurrent.argtypes = [_Handle, _Handle, ctypes.c_uint, ctypes.c_int, ctypes.c_int]
            library.OSMesaMakeCurrent.restype = ctypes.c_ubyte
            library.OSMesaGetProcAddress.restype = _Handle
            library.OSMesaGetProcAddress.argtypes = [ctypes.c_char_p]
            library.OSMesaDestroyContext.argtypes = [_Handle]
            return library
        raise ContextError(f"{_OSMESA_LIBRARIES[0]} cannot be loaded", OSMESA_FIX)

    def load_opengl_function(self, name: str) -> int:
        """Return the address of a GL function, 0 where there is none."""
        return int(self._library.OSMesaGetProcAddress(name.encode()) or 0)

    def __enter__(self) -> Self:
        if not self._library.OSMesaMakeCurrent(self._context, self._picture, _GL_UNSIGNED_BYTE, 1, 1):
            raise ContextError("OSMesaMakeCurrent failed", "use a prepared scene on one thread at a time")
        return self

    def __exit__(self, *details: object) -> None:
        self._library.OSMesaMakeCurrent(None, None, _GL_UNSIGNED_BYTE, 0, 0)

    def release(self) -> None:
        """Destroy the context; a second call does nothing."""
        if self._context:
            self._library.OSMesaMakeCurrent(None, None, _GL_UNSIGNED_BYTE, 0, 0)
            self._library.OSMesaDestroyContext(self._context)
            self._context = None
