"""What a device makes of alpha: how many hardware samples a fragment covers under GL_SAMPLE_ALPHA_TO_COVERAGE.

OpenGL asks only that more alpha covers more samples, from none at 0 to all at 1. Drivers round up, or to the nearest,
or dither: Mesa's covers sample k of n where alpha > k / n, 1 / 2n too much on average, by which all cut-outs would be
too large. So the excess is measured, once for each number of samples, and the shader takes it off.
"""

import moderngl
import numpy as np

from aliasbench.renderers.raster.graphics import GraphicsContext, read_shader
from aliasbench.scenes.model import FloatArray

ALPHA_TO_COVERAGE = 0x809E  # GL_SAMPLE_ALPHA_TO_COVERAGE, which moderngl has no name for
RAMP_SIDE = 64  # pixels across and down: dither patterns are smaller

_HEAD = "#version 330 core\n#line 1\n"


def coverage_excess(context: GraphicsContext, samples: int) -> float:
    """Return how much more of a pixel than its alpha fragments cover, averaged over all alphas."""
    return float(np.mean(coverage_curve(context, samples))) - 0.5


def coverage_curve(context: GraphicsContext, samples: int) -> FloatArray:
    """Return the share of a pixel's samples covered, (RAMP_SIDE^2,) float64, at the alphas (k + 1/2) / RAMP_SIDE^2.

    Each alpha is drawn at one pixel, neighbours far from each other: dithering devices are smooth on average only.
    """
    size = (RAMP_SIDE, RAMP_SIDE)
    with context.use() as gl:
        color = gl.texture(size, 4, dtype="f4", samples=samples)
        drawn = gl.framebuffer([color])
        resolved = gl.simple_framebuffer(size, 4, dtype="f4")
        program = context.program(_HEAD + read_shader("screen.vert.glsl"), _HEAD + read_shader("ramp.frag.glsl"))
        screen = gl.vertex_array(program, [])
        drawn.use()
        drawn.clear(0.0, 0.0, 0.0, 0.0)
        gl.enable_only(moderngl.NOTHING)
        gl.enable_direct(ALPHA_TO_COVERAGE)
        program["side"] = RAMP_SIDE
        screen.render(moderngl.TRIANGLES, vertices=3)
        gl.disable_direct(ALPHA_TO_COVERAGE)
        context.resolve(drawn, resolved)
        out = np.frombuffer(resolved.read(components=1, dtype="f4"), np.float32).astype(np.float64)
        for made in (screen, drawn, resolved, color):
            made.release()
        context.check("measuring what alpha covers")
    curve: FloatArray = np.empty_like(out)
    # odd, so that every alpha comes once; as in the shader
    curve[np.arange(RAMP_SIDE**2) * 1777 % RAMP_SIDE**2] = out
    return curve
