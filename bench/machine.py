"""What a result depends on besides the suite: processor, system, engines and the versions of everything involved.

All of it is in every run directory; a run goes on only where nothing of it has changed. The project's version carries a
digest of its sources, so that numbers of two states of the code are never taken for one, without asking any version
control system.
"""

import hashlib
import os
import platform
from importlib import metadata
from pathlib import Path

from aliasbench.renderers import kernel_cache
from aliasbench.scenes.errors import NotAvailableError

PACKAGES = ("numpy", "scipy", "numba", "llvmlite", "embreex", "moderngl", "OpenImageIO", "scikit-image", "shapely")
_SOURCES = ("scenes", "renderers", "metrics", "bench")


def describe_machine() -> dict[str, str]:
    """Return what results depend on, as texts by name; what cannot be found out says "unknown" or why not."""
    return {
        "cpu": _cpu_model(),
        "cores": str(os.cpu_count() or "unknown"),
        "memory": _memory(),
        "os": platform.platform(),
        "python": platform.python_version(),
        "aliasbench": project_version(),
        **describe_engines(),
        **package_versions(),
    }


def project_version() -> str:
    """Return the installed version with a digest of the sources: "0.1.0+3f2a9c0d"."""
    root = Path(kernel_cache.__file__).parents[1]
    digests = "".join(kernel_cache.source_digest(root / folder) for folder in _SOURCES)
    return f"{_version('aliasbench')}+{hashlib.sha256(digests.encode()).hexdigest()[:8]}"


def package_versions() -> dict[str, str]:
    """Return the versions of the packages that pixels and times depend on."""
    return {name: _version(name) for name in PACKAGES}


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed"


def _cpu_model() -> str:
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text(encoding="utf-8", errors="replace").splitlines():
            key, _, value = line.partition(":")
            if key.strip() == "model name":
                return value.strip()
    return platform.processor() or platform.machine() or "unknown"


def _memory() -> str:
    names = getattr(os, "sysconf_names", {})
    if not {"SC_PAGE_SIZE", "SC_PHYS_PAGES"} <= set(names):
        return "unknown"
    return f"{os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / 2**30:.1f} GiB"


def describe_engines() -> dict[str, str]:
    """Return what renders here: the OpenGL that is used unless told otherwise, and Embree."""
    from aliasbench.renderers.raster.context import NoContextError, acquire_context
    from aliasbench.renderers.raytrace.embree import embree_info

    try:
        opengl = acquire_context().renderer
    except NoContextError as error:
        opengl = str(error)
    try:
        info = embree_info()
        embree = f"{info.version}, {info.isa}, packets of {info.packet_width}"
    except NotAvailableError as error:
        embree = str(error)
    return {"opengl": opengl, "embree": embree}
