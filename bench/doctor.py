"""Whether this machine can render, and if not, what helps: every engine is tried and says what it can do."""

import os
import tempfile
from dataclasses import asdict
from pathlib import Path

from aliasbench.bench.machine import describe_machine
from aliasbench.bench.wording import printable
from aliasbench.scenes.errors import InputError, NotAvailableError

THREADS_FIX = "unset the variable, or give it a number of threads that is allowed"
CACHE_FIX = "make it writable, or set {} to a folder that is; until then what it would keep is made again every time"
EMBREE_FIX = "install the package embreex of this platform (pip install --force-reinstall embreex)"


def diagnose() -> dict[str, object]:
    """Return what the machine can do, fit for JSON.

    Returns
    -------
    dict
        "ok": whether at least one OpenGL context, Embree and the threads work; "opengl": a list of attempts (backend,
        device, ok, renderer, vendor, version, max_samples, sample_positions in pixels with y down, error, fix);
        "embree": (ok, version, isa, packet_width, library, or error and fix); "threads": how many, None where what
        the user set is wrong ("threads_error", "threads_fix"); "caches": a list of (what, folder, writable, fix), which
        cost time but not "ok"; "machine": as run directories hold it.
    """
    from aliasbench.renderers.raster.context import describe_contexts

    contexts = [asdict(report) for report in describe_contexts()]
    embree, threads = _embree(), _threads()
    return {
        "ok": any(context["ok"] for context in contexts) and bool(embree["ok"]) and threads["threads"] is not None,
        "opengl": contexts,
        "embree": embree,
        **threads,
        "caches": _caches(),
        "machine": describe_machine(),
    }


def _embree() -> dict[str, object]:
    from aliasbench.renderers.raytrace.embree import EmbreeError, embree_info

    try:
        return {"ok": True, **asdict(embree_info())}
    except (NotAvailableError, EmbreeError, ImportError, OSError) as error:
        return {"ok": False, "error": str(error), "fix": EMBREE_FIX}


def _threads() -> dict[str, object]:
    from aliasbench.renderers.raytrace.tracer import thread_count

    try:
        return {"threads": thread_count()}
    except InputError as error:
        return {"threads": None, "threads_error": str(error), "threads_fix": THREADS_FIX}


def _caches() -> list[dict[str, object]]:
    from aliasbench.renderers.kernel_cache import cache_root
    from aliasbench.renderers.reference.cache import cache_folder

    # Importing the renderers has set the variable; without it numba would choose.
    kernels = Path(os.environ.get("NUMBA_CACHE_DIR") or cache_root())
    folders = (("compiled kernels", kernels, "NUMBA_CACHE_DIR"), ("references", cache_folder(), "ALIASBENCH_CACHE"))
    return [
        {"what": what, "folder": str(folder), "writable": _is_writable(folder), "fix": CACHE_FIX.format(variable)}
        for what, folder, variable in folders
    ]


def _is_writable(folder: Path) -> bool:
    """Return whether files can be made in a folder, or where it is missing the folder itself."""
    there = next((path for path in (folder, *folder.absolute().parents) if path.exists()), folder)
    try:
        # Asking for permission would not do: root is allowed everything, also where nothing can be made.
        with tempfile.TemporaryFile(dir=there):
            return True
    except OSError:
        return False


def describe(diagnosis: dict[str, object]) -> list[str]:
    """Return a diagnosis as lines for people."""
    lines = []
    contexts, embree, machine = diagnosis["opengl"], diagnosis["embree"], diagnosis["machine"]
    caches = diagnosis["caches"]
    assert isinstance(contexts, list)
    assert isinstance(embree, dict)
    assert isinstance(machine, dict)
    assert isinstance(caches, list)
    for context in contexts:
        name = context["backend"] if context["device"] is None else f"{context['backend']} device {context['device']}"
        if not context["ok"]:
            lines += [f"OpenGL {name}: no: {context['error']}", f"    fix: {context['fix']}"]
            continue
        kind = "software" if context["software"] else "hardware"
        lines.append(f"OpenGL {name}: ok, {context['renderer']} ({context['vendor']}, {kind}), {context['version']}")
        lines.append(
            f"    up to {context['max_samples']} samples a pixel, textures up to {context['max_texture_size']}"
        )
        for count, positions in context["sample_positions"]:
            if count > 1:
                places = " ".join(f"({x:g}, {y:g})" for x, y in positions)
                lines.append(f"    {count} samples at {places} (x right, y down)")
    if embree["ok"]:
        lines.append(f"Embree: ok, {embree['version']}, {embree['isa']}, packets of {embree['packet_width']}")
    else:
        lines += [f"Embree: no: {embree['error']}", f"    fix: {embree['fix']}"]
    if diagnosis["threads"] is not None:
        lines.append(f"threads: {diagnosis['threads']}")
    else:
        lines += [f"threads: no: {diagnosis['threads_error']}", f"    fix: {diagnosis['threads_fix']}"]
    for cache in caches:
        lines.append(f"cache of {cache['what']}: {cache['folder']}, {'' if cache['writable'] else 'not '}writable")
        lines += [] if cache["writable"] else [f"    fix: {cache['fix']}"]
    lines += [f"{key}: {value}" for key, value in machine.items() if key not in ("opengl", "embree")]
    return [printable(line) for line in lines]
