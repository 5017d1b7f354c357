"""How surfaces answer light, as the kernels want it."""

from aliasbench.renderers.raytrace.paths import DIFFUSE, GLASS, GLOSSY, LIGHT, UNLIT
from aliasbench.renderers.raytrace.scattering import cauchy
from aliasbench.renderers.raytrace.texturing import CAUCHY_A, CAUCHY_B, MATERIAL, ROUGHNESS
from aliasbench.scenes.model import FloatArray, Scene


def is_scattered(scene: Scene) -> bool:
    """Return whether paths of light are needed to draw a scene: it has lights, a bounce, gloss or glass."""
    return bool(scene.lights) or scene.bounces > 0 or any(o.material.kind in ("glossy", "glass") for o in scene.objects)


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
