"""Lights for both renderers: as objects that are seen, hide and throw shadows, and as values to draw points on.

Both take the same points of the same lights, so that pictures made of equal samples are equal pictures.
"""

from dataclasses import replace

import numpy as np

from aliasbench.scenes.model import FloatArray, Scene, Surface, read_only
from aliasbench.scenes.projection import View

# Values of a light: corner, two edges, unit normal of its bright side, radiance, area, and the chance to be drawn with
# the sum of those before.
CORNER, EDGE_1, EDGE_2, LIGHT_NORMAL, RADIANCE, AREA, CHANCE, CHANCES_BEFORE, LIGHT_SIZE = (
    0,
    3,
    6,
    9,
    12,
    15,
    16,
    17,
    18,
)

OFF_SURFACE = 2e-6  # of the coordinates, some 30 ulp of float32: twice what intersection may be off
BEFORE_LIGHT = 1e-4  # of the way, which shadow rays stop short of their light at least


def with_lights(scene: Scene) -> Scene:
    """Return a scene whose lights are objects too, after all others: they are seen, hide, and throw shadows."""
    if not scene.lights:
        return scene
    shapes = tuple(
        Surface(
            read_only(np.array(light.quad, dtype=np.float64)),
            read_only(np.array([[0, 1, 2], [0, 2, 3]], np.int32)),
            color=light.radiance,
            name=f"light {k}",
        )
        for k, light in enumerate(scene.lights)
    )
    return replace(scene, objects=scene.objects + shapes)


def light_values(scene: Scene, view: View, anchor: FloatArray) -> FloatArray:
    """Return (l, LIGHT_SIZE) values of the lights, relative to `anchor`; drawn by their power."""
    out = np.zeros((len(scene.lights), LIGHT_SIZE))
    for values, light in zip(out, scene.lights, strict=True):
        a, b, _, d = (np.asarray(corner, dtype=np.float64) for corner in light.quad)
        normal = np.cross(b - a, d - a)
        area = float(np.linalg.norm(normal))
        corner, across, up = _turned(a - anchor, b - a, d - a, view)
        values[CORNER : CORNER + 3], values[EDGE_1 : EDGE_1 + 3], values[EDGE_2 : EDGE_2 + 3] = corner, across, up
        values[LIGHT_NORMAL : LIGHT_NORMAL + 3] = normal / area if area > 0.0 else 0.0
        values[RADIANCE : RADIANCE + 3] = light.radiance
        values[AREA] = area
    power = out[:, AREA] * out[:, RADIANCE : RADIANCE + 3].max(axis=1, initial=0.0)
    if power.sum() > 0.0:
        out[:, CHANCE] = power / power.sum()
        out[:, CHANCES_BEFORE] = np.cumsum(out[:, CHANCE]) - out[:, CHANCE]
    return out


def _turned(
    corner: FloatArray, one: FloatArray, other: FloatArray, view: View
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the same parallelogram from the corner whose edges run leftwards and upwards (or away) in the picture.

    Borders of shadows move over a light the other way than over the picture, and blue noise counts on it (`bluenoise`).
    """
    across, up = (one, other) if abs(one @ view.right) >= abs(other @ view.right) else (other, one)
    if across @ view.right > 0.0:
        corner, across = corner + across, -across
    rise, depth = float(up @ view.up), float(up @ view.forward)
    if (rise if abs(rise) > abs(depth) else depth) < 0.0:
        corner, up = corner + up, -up
    return corner, across, up
