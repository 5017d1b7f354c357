"""The lecture's artifacts, rendered by both renderers: high under point sampling, low under the remedy it names.

The factors are at most two thirds of the least that was seen over pictures of 96 to 192 pixels, square or not, and four
seeds; they are meant to notice a metric or a renderer that no longer sees or cures an artifact, not to rank techniques.
Run with -s, the tests print a table of what they measured.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from aliasbench.metrics.catalog import measure, measure_all
from aliasbench.metrics.moire import known_frequencies, wrap_frequency
from aliasbench.metrics.score import Score
from aliasbench.renderers.catalog import prepare
from aliasbench.scenes.catalog import build_scene

FloatArray = NDArray[np.float64]
RENDERERS = ("raytrace", "raster")
# What one sample is to the ray tracer is one pass to the rasterizer.
SAMPLES = {"raytrace": "spp", "raster": "passes"}


@dataclass(frozen=True)
class Artifact:
    """A scene of one artifact with its headline metric.

    `least` is what point sampling scores at least; `remedies` say by which factor at least each remedy lowers that.
    """

    id: str
    scene: str
    metric: str
    frames: int
    least: float
    remedies: tuple[tuple[str, float], ...]

    def technique(self, renderer: str, remedy: str) -> str:
        if remedy.startswith("samples="):
            remedy = f"{SAMPLES[renderer]}={remedy.partition('=')[2]}"
        return f"{renderer}:{remedy}"


ARTIFACTS = (
    Artifact("A1", "brick-floor", "shimmer", 4, 0.0, (("texture=trilinear", 1.0), ("samples=16", 1.0))),
    Artifact("A1", "checker-floor", "shimmer", 6, 0.0, (("texture=trilinear", 1.0), ("samples=16", 1.0))),
    Artifact("A1", "distant-triangle", "shimmer", 6, 0.0, (("texture=trilinear", 1.0), ("samples=16", 1.0))),
    Artifact("A2", "confetti", "shimmer", 6, 0.0, (("samples=16", 1.0),)),
    Artifact("A2", "confetti", "flux_flicker", 6, 0.0, (("samples=16", 1.0),)),
    Artifact("A3", "slivers", "gaps", 3, 0.0, (("samples=4", 1.0), ("samples=16", 1.0))),
    Artifact("A4", "near-horizontal-edge", "jaggies", 1, 0.0, (("samples=16", 1.0),)),
    Artifact("A4", "edge-fan", "jaggies", 1, 0.0, (("samples=16", 1.0),)),
    Artifact("A5", "grid:lines=264", "moire", 2, 0.0, (("samples=16", 1.0), ("samples=64", 1.0))),
    Artifact("A5", "zone-plate", "moire", 1, 0.0, (("samples=16", 1.0),)),
    Artifact("A6", "window-screens:wires=132", "moire", 2, 0.0, (("samples=16", 1.0), ("samples=64", 1.0))),
)
