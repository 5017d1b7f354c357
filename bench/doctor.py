"""Whether this machine can render, and if not, what helps: every engine is tried and says what it can do."""

import os
from dataclasses import asdict

from aliasbench.bench.machine import describe_machine
from aliasbench.scenes.errors import NotAvailableError

EMBREE_FIX = "install the package embreex of this platform (pip install --force-reinstall embreex)"


def diagnose() -> dict[str, object]:
    """Return what the machine can do, fit for JSON.

    Returns
    -------
    dict
        "ok": whether at least one OpenGL context and Embree work; "opengl": a list of attempts (backend, device, ok,
        renderer, vendor, version, max_samples, sample_positions in pixels with y down, error, fix); "embree": (ok,
        version, isa, packet_width, library, or error and fix); "threads"; "machine": as run directories hold it.
    """
    from aliasbench.renderers.raster.context import describe_contexts

    contexts = [asdict(report) for report in describe_contexts()]
    embree = _embree()
    return {
        "ok": any(context["ok"] for context in contexts) and bool(embree["ok"]),
        "opengl": contexts,
        "embree": embree,
        "threads": os.cpu_count() or 1,
        "machine": describe_machine(),
    }


def _embree() -> dict[str, object]:
    from aliasbench.renderers.raytrace.embree import EmbreeError, embree_info

    try:
        return {"ok": True, **asdict(embree_info())}
    except (NotAvailableError, EmbreeError, ImportError, OSError) as error:
        return {"ok": False, "error": str(error), "fix": EMBREE_FIX}


def describe(diagnosis: dict[str, object]) -> list[str]:
    """Return a diagnosis as lines for people."""
    lines = []
    contexts, embree, machine = diagnosis["opengl"], diagnosis["embree"], diagnosis["machine"]
    assert isinstance(contexts, list)
    assert isinstance(embree, dict)
    assert isinstance(machine, dict)
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
    lines.append(f"threads: {diagnosis['threads']}")
    lines += [f"{key}: {value}" for key, value in machine.items() if key not in ("opengl", "embree")]
    return lines
