"""The part of Embree 4 that the tracer needs, through ctypes: a device, triangle scenes, and what they can do.

embreex carries the whole library but binds only single rays at time 0. The library itself has packets of 16 rays, which
the kernels call directly (`packets`); this module sets up what they trace, and turns Embree's error codes into
exceptions. Everything is freed on close, and by a finalizer where close was forgotten.
"""

import ctypes
import functools
import weakref
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.errors import NotAvailableError

# Values of Embree's enums (rtcore_common.h, rtcore_device.h, rtcore_geometry.h, rtcore_scene.h), the same in 4.x.
_GEOMETRY_TRIANGLE = 0
_BUFFER_INDEX, _BUFFER_VERTEX = 0, 1
_FORMAT_UINT3, _FORMAT_FLOAT3 = 0x5003, 0x9003
_SCENE_ROBUST = 4
_PROPERTY_VERSION = 0
_PROPERTY_NATIVE_PACKET: Mapping[int, int] = {4: 32, 8: 33, 16: 34}
_PACKET_ISA: Mapping[int, str] = {16: "AVX-512", 8: "AVX or AVX2", 4: "SSE"}

_POINTER = ctypes.c_void_p
_UINT = ctypes.c_uint
_SIGNATURES: Mapping[str, tuple[object, tuple[object, ...]]] = {
    "rtcNewDevice": (_POINTER, (ctypes.c_char_p,)),
    "rtcReleaseDevice": (None, (_POINTER,)),
    "rtcGetDeviceError": (ctypes.c_int, (_POINTER,)),
    "rtcGetDeviceLastErrorMessage": (ctypes.c_char_p, (_POINTER,)),
    "rtcGetDeviceProperty": (ctypes.c_ssize_t, (_POINTER, ctypes.c_int)),
    "rtcNewScene": (_POINTER, (_POINTER,)),
    "rtcReleaseScene": (None, (_POINTER,)),
    "rtcSetSceneFlags": (None, (_POINTER, ctypes.c_int)),
    "rtcCommitScene": (None, (_POINTER,)),
    "rtcNewGeometry": (_POINTER, (_POINTER, ctypes.c_int)),
    "rtcReleaseGeometry": (None, (_POINTER,)),
    "rtcCommitGeometry": (None, (_POINTER,)),
    "rtcAttachGeometry": (_UINT, (_POINTER, _POINTER)),
    "rtcSetGeometryUserData": (None, (_POINTER, _POINTER)),
    "rtcSetGeometryEnableFilterFunctionFromArguments": (None, (_POINTER, ctypes.c_bool)),
    "rtcSetNewGeometryBuffer": (
        _POINTER,
        (_POINTER, ctypes.c_int, _UINT, ctypes.c_int, ctypes.c_size_t, ctypes.c_size_t),
    ),
}


class EmbreeError(RuntimeError):
    """Embree refused a call; the message is Embree's own."""


@dataclass(frozen=True, slots=True)
class EmbreeInfo:
    """What `doctor` tells about the ray tracer.

    Attributes
    ----------
    version : str
        Of the Embree library.
    isa : str
        The vector instructions that its packets use on this processor.
    packet_width : int
        The widest packet that runs natively: 16, 8, 4, or 1.
    library : str
        File name of the library.
    """

    version: str
    isa: str
    packet_width: int
    library: str


def library_path() -> Path:
    """Return the Embree 4 library that the embreex wheel carries.

    Raises
    ------
    NotAvailableError
        If this platform's wheel carries none; engine=portable still works there.
    """
    import embreex

    package = Path(embreex.__file__).parent
    folders = (package.parent / "embreex.libs", package / ".dylibs", package)
    for folder in folders:
        found = sorted(p for p in folder.glob("*embree4*") if ".so" in p.name or p.suffix in (".dylib", ".dll"))
        if found:
            return found[0]
    raise NotAvailableError(
        "engine=packet needs the Embree 4 library inside the embreex package, and this installation has none; "
        "available: engine=portable"
    )


@functools.cache
def load_library() -> ctypes.CDLL:
    """Return the library with the signatures of the functions used here."""
    # Importing a module of embreex loads TBB, which the library needs and would not find by itself.
    import embreex.rtcore_scene  # noqa: F401

    library = ctypes.CDLL(str(library_path()))
    for name, (result, arguments) in _SIGNATURES.items():
        function = getattr(library, name)
        function.restype = result
        function.argtypes = arguments
    return library


class Device:
    """An Embree device: what scenes are made on. A context manager; `close` frees it once its scenes are closed."""

    __slots__ = ("__weakref__", "_finalizer", "handle", "library")

    def __init__(self) -> None:
        self.library = load_library()
        self.handle: int = self.library.rtcNewDevice(None) or 0
        if not self.handle:
            code = self.library.rtcGetDeviceError(None)
            raise EmbreeError(f"Embree cannot make a device on this machine (error {code})")
        self._finalizer = weakref.finalize(self, self.library.rtcReleaseDevice, self.handle)

    def check(self, action: str) -> None:
        """Raise `EmbreeError` if a call since the last check failed; `action` says what was being done."""
        code = self.library.rtcGetDeviceError(self.handle)
        if code:
            text = self.library.rtcGetDeviceLastErrorMessage(self.handle) or b""
            raise EmbreeError(f"Embree failed to {action} (error {code}): {text.decode(errors='replace')}".rstrip(": "))

    def get_property(self, number: int) -> int:
        """Return a device property by its number in `RTCDeviceProperty`."""
        return int(self.library.rtcGetDeviceProperty(self.handle, number))

    def close(self) -> None:
        """Release the device (again is harmless)."""
        self._finalizer()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class TriangleScene:
    """A committed scene of one triangle mesh; `handle` is its address, for the kernels.

    Parameters
    ----------
    device : Device
    vertices : (n, 3) float32
    triangles : (m, 3) int
        Vertex indices; m may be 0.
    robust : bool
        Embree's robust mode: no ray slips through an edge that two triangles share.
    holed : (m,) bool, optional
        Hits on these triangles go through the filter function of the intersection's arguments.
    number : int
        What that function finds as the geometry's user data.
    """

    __slots__ = ("__weakref__", "_finalizer", "handle")

    def __init__(
        self,
        device: Device,
        vertices: NDArray[np.float32],
        triangles: NDArray[np.integer],
        *,
        robust: bool,
        holed: NDArray[np.bool_] | None = None,
        number: int = 0,
    ) -> None:
        library = device.library
        self.handle: int = library.rtcNewScene(device.handle) or 0
        device.check("make a scene")
        # The scene keeps its device alive in Embree by a count of its own, so the order of closing does not matter.
        self._finalizer = weakref.finalize(self, library.rtcReleaseScene, self.handle)
        library.rtcSetSceneFlags(self.handle, _SCENE_ROBUST if robust else 0)
        if holed is None or not holed.any():
            if len(triangles):
                self._attach(device, vertices, triangles, None)
        else:
            # Two geometries, as filters cost time, of all triangles each, as hits give a triangle's place in its own:
            # what belongs to the other is sent to a vertex that is not a number, and Embree leaves that out.
            nowhere = np.concatenate([vertices, np.full((1, 3), np.nan, np.float32)])
            for is_member, user in ((~holed, None), (holed, number)):
                if is_member.any():
                    own = np.where(is_member[:, None], triangles, len(vertices))
                    self._attach(device, nowhere, own, user)
        library.rtcCommitScene(self.handle)
        device.check("build a scene")

    def _attach(
        self, device: Device, vertices: NDArray[np.float32], triangles: NDArray[np.integer], filtered: int | None
    ) -> None:
        """Add triangles; under filters where `filtered`, their user data, is given."""
        library = device.library
        geometry = library.rtcNewGeometry(device.handle, _GEOMETRY_TRIANGLE)
        try:
            _fill(library, geometry, _BUFFER_VERTEX, _FORMAT_FLOAT3, vertices.astype(np.float32))
            _fill(library, geometry, _BUFFER_INDEX, _FORMAT_UINT3, triangles.astype(np.uint32))
            if filtered is not None:
                library.rtcSetGeometryUserData(geometry, filtered)
                library.rtcSetGeometryEnableFilterFunctionFromArguments(geometry, True)
            library.rtcCommitGeometry(geometry)
            library.rtcAttachGeometry(self.handle, geometry)
        finally:
            library.rtcReleaseGeometry(geometry)

    def close(self) -> None:
        """Release the scene (again is harmless)."""
        self._finalizer()


def _fill(library: ctypes.CDLL, geometry: int, kind: int, layout: int, rows: NDArray[np.generic]) -> None:
    """Copy an (n, 3) array into a new buffer of the geometry."""
    data = np.ascontiguousarray(rows)
    address = library.rtcSetNewGeometryBuffer(geometry, kind, 0, layout, data.itemsize * 3, len(data))
    if not address:
        raise EmbreeError(f"Embree cannot hold a buffer of {data.nbytes} bytes")
    ctypes.memmove(address, data.ctypes.data, data.nbytes)


def embree_info() -> EmbreeInfo:
    """Return version, instruction set and packet width of the Embree that renders here.

    Raises
    ------
    NotAvailableError
        If there is no Embree library (see `library_path`).
    """
    with Device() as device:
        number = device.get_property(_PROPERTY_VERSION)
        widths = [w for w, p in _PROPERTY_NATIVE_PACKET.items() if device.get_property(p)]
    width = max(widths, default=1)
    version = f"{number // 10000}.{number // 100 % 100}.{number % 100}"
    return EmbreeInfo(version, _PACKET_ISA.get(width, "scalar"), width, library_path().name)
