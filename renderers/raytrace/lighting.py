"""Lights, and surfaces that answer light, as the kernels want them."""

from dataclasses import replace

import numpy as np

from aliasbench.renderers.raytrace.paths import (
    AREA,
    CHANCE,
    CHANCES_BEFORE,
    CORNER,
    DIFFUSE,
    EDGE_1,
    EDGE_2,
    GLASS,
    GLOSSY,
    LIGHT,
    LIGHT_NORMAL,
    LIGHT_SIZE,
    RADIANCE,
    UNLIT,
)
from aliasbench.renderers.raytrace.scattering import cauchy
from aliasbench.renderers.raytrace.texturing import CAUCHY_A, CAUCHY_B, MATERIAL, ROUGHNESS
from aliasbench.scenes.model import FloatArray, Scene, Surface, read_only
from aliasbench.scenes.projection import View


def is_scattered(scene: Scene) -> bool:
    """Return whether paths of light are needed to draw a scene: it has lights, a bounce, gloss or glass."""
    return bool(scene.lights) or scene.bounces > 0 or any(o.material.kind in ("glossy", "glass") for o in scene.objects)


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


def put_materials(scene: Scene, objects: FloatArray) -> None:
    """Write how the objects of a scene `with_lights` answer light into their rows (n, OBJECT_SIZE).

    Where nothing lights them, diffuse surfaces are as bright as unlit ones.
    """
    own = len(scene.objects) - len(scene.lights)
    is_lit = bool(scene.lights) or scene.bounces > 0
    codes = {"unlit": UNLIT, "diffuse": DIFFUSE if is_lit else UNLIT, "glossy": GLOSSY, "glass": GLASS}
    for k, (values, surface) in enumerate(zip(objects, scene.objects, strict=False)):
        material = surface.material
        values[MATERIAL] = codes[material.kind] if k < own else LIGHT
        values[ROUGHNESS] = material.roughness
        values[CAUCHY_A], values[CAUCHY_B] = material.ior, 0.0
        if material.kind == "glass" and material.abbe is not None:
            values[CAUCHY_A], values[CAUCHY_B] = cauchy(material.ior, material.abbe)


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
