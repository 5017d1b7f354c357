"""The texts of the scene's shaders: the variant for one kind of texture, and what a scene defines for it."""

from collections.abc import Sequence

from aliasbench.renderers.raster.graphics import read_shader
from aliasbench.renderers.raster.minification import KINDS, MODES, Shading


def scene_shader(name: str, shading: Shading, defined: Sequence[str] = (), before: str = "") -> str:
    """Return the text of a shader file for a shading, after `before`, with some names `defined`."""
    names = [*KINDS, *MODES]
    lines = ["#version 330 core", *(f"#define {n} {i}" for i, n in enumerate(names))]
    lines += [f"#define KIND {shading.kind}", f"#define MODE {shading.mode}", *(f"#define {n}" for n in defined)]
    lines += [f"#define COVERAGE {int(shading.is_coverage)}"]
    return "\n".join(lines) + "\n" + before + "#line 1\n" + read_shader(name)
