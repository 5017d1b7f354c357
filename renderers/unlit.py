"""What a renderer of unlit scenes through a pinhole cannot draw, in the same words for rasterizer and ray tracer."""

from aliasbench.scenes.errors import UnsupportedScene
from aliasbench.scenes.model import Scene


def check_unlit(renderer: str, scene: Scene) -> None:
    """Raise `UnsupportedScene` if a scene has a lens, lights, or a material that answers light."""
    if scene.camera.lens_radius > 0.0:
        lens = f"a lens (lens_radius = {scene.camera.lens_radius:g})"
        raise UnsupportedScene(f"{renderer}: {lens} is not drawn; a pinhole is")
    if scene.lights:
        raise UnsupportedScene(f"{renderer}: lights ({len(scene.lights)}) are not drawn; scenes without lights are")
    if scene.bounces:
        raise UnsupportedScene(
            f"{renderer}: diffuse interreflection (bounces = {scene.bounces}) is not drawn; direct light alone is"
        )
    for index, surface in enumerate(scene.objects):
        if surface.material.kind not in ("unlit", "diffuse"):
            raise UnsupportedScene(
                f"{renderer}: material {surface.material.kind} (object {surface.name or f'number {index}'}) is not "
                "drawn; unlit is, and diffuse without lights"
            )
