"""The one door to all renderers: a scene and a technique in, a prepared scene or a frame out.

Heavy imports happen here, when a renderer is first used.
"""

from collections.abc import Mapping

from aliasbench.renderers.frame import Frame, Prepared
from aliasbench.renderers.technique import Technique, parse_technique
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Scene

# Named techniques: what people ask for by name, in every place that takes a technique text.
TECHNIQUES: Mapping[str, str] = {
    "raytrace-1": "raytrace:",
    "raytrace-jittered-4": "raytrace:spp=4,sampler=jittered",
    "raytrace-jittered-16": "raytrace:spp=16,sampler=jittered",
    "raytrace-jittered-64": "raytrace:spp=64,sampler=jittered",
    "raytrace-random-16": "raytrace:spp=16,sampler=random",
    "raytrace-grid-16": "raytrace:spp=16,sampler=grid",
    "raster-1": "raster:",
    "raster-msaa-4": "raster:msaa=4",
    "raster-passes-4": "raster:passes=4,sampler=jittered",
    "raster-passes-16": "raster:passes=16,sampler=jittered",
    "raster-passes-64": "raster:passes=64,sampler=jittered",
}

MAX_SIDE = 65536


def resolve_technique(technique: str | Technique) -> Technique:
    """Return the technique of a text, of a name in `TECHNIQUES`, or itself."""
    if isinstance(technique, Technique):
        return technique
    return parse_technique(TECHNIQUES.get(technique.strip(), technique))


def prepare(scene: Scene, technique: str | Technique, *, size: tuple[int, int]) -> Prepared:
    """Return the scene built and uploaded for a technique, ready to render frame after frame.

    Parameters
    ----------
    scene : Scene
    technique : Technique or str
        A technique, its text, or a name in `TECHNIQUES`.
    size : (width, height)
        In pixels.

    Raises
    ------
    InputError
        For a bad technique text or size.
    UnsupportedScene
        If the renderer cannot do this scene; the message names the feature.
    """
    chosen = resolve_technique(technique)
    for name, side in zip(("width", "height"), size, strict=True):
        if isinstance(side, bool) or int(side) != side or not 1 <= side <= MAX_SIDE:
            raise InputError(f"size {size[0]}x{size[1]}: {name} must be a whole number from 1 to {MAX_SIDE}")
    if chosen.renderer == "raytrace":
        from aliasbench.renderers.raytrace.tracer import prepare_raytrace

        return prepare_raytrace(scene, chosen, size)
    if chosen.renderer == "raster":
        from aliasbench.renderers.raster.rasterizer import prepare_raster

        return prepare_raster(scene, chosen, size)
    from aliasbench.renderers.reference.reference import prepare_reference

    return prepare_reference(scene, chosen, size)


def render(scene: Scene, technique: str | Technique, *, size: tuple[int, int], frame: int = 0, seed: int = 0) -> Frame:
    """Return one frame: `prepare` and `Prepared.render` at once."""
    with prepare(scene, technique, size=size) as prepared:
        return prepared.render(frame=frame, seed=seed)
