"""What surfaces that are not simply their colour need in a pass, put together: planes, lights, what gloss mirrors.

Scenes without lights and gloss have none of this, and their shaders nothing of it.
"""

from collections.abc import Sequence

import numpy as np

from aliasbench.renderers.geometry import Body
from aliasbench.renderers.raster.exposures import Exposure
from aliasbench.renderers.raster.gloss import Gloss
from aliasbench.renderers.raster.graphics import GraphicsContext, read_shader
from aliasbench.renderers.raster.lighting import Lighting
from aliasbench.renderers.raster.minification import Shading
from aliasbench.renderers.raster.placement import make_placement
from aliasbench.renderers.raster.projection import Instant, Window, depth_rule
from aliasbench.renderers.raster.surfaces import Surfaces, Uniforms, objects_order
from aliasbench.renderers.technique import Technique
from aliasbench.scenes.model import Scene
from aliasbench.scenes.projection import View

_PLANES, _LIGHTS, _MIRROR = 2, 3, 4  # texture units; those before are the scene's own


class Light:
    """How the surfaces of a scene answer light, on the device; made and used inside the context's `use`.

    Attributes
    ----------
    defined : tuple of str
        What shaders are told.
    text : str
        What comes before a fragment shader.
    ranks : (m,) int64
        The number among the objects' triangles of each triangle counted body by body.
    """

    def __init__(
        self,
        context: GraphicsContext,
        scene: Scene,
        bodies: Sequence[Body],
        technique: Technique,
        shadings: dict[str | None, Shading],
        size: tuple[int, int],
    ) -> None:
        order = objects_order(bodies)
        self.ranks = np.empty_like(order)
        self.ranks[order] = np.arange(len(order))
        self._gloss: Gloss | None = None
        self._surfaces = Surfaces(context, scene, bodies, make_placement(bodies), _PLANES)
        self._lighting: Lighting | None = None
        self.defined: tuple[str, ...] = ("PLACED",)
        self.text = read_shader("surface.glsl")
        if technique.msaa > 1:
            self.defined += ("SAMPLES",)
        if scene.lights:
            self._lighting = Lighting(context, scene, technique, self._surfaces, shadings, _LIGHTS)
            self.defined += ("LIT",)
            self.text += self._lighting.text
        if any(o.material.kind == "glossy" for o in scene.objects):
            self._gloss = Gloss(
                context,
                scene,
                tuple(bodies),
                self._surfaces,
                order,
                shadings,
                size,
                depth_rule(scene.camera),
                tuple(d for d in self.defined if d != "SAMPLES"),
                self.text,
            )

    @property
    def most_rays(self) -> int | None:
        """How many shadow rays a pass may have at a time; None without lights."""
        return None if self._lighting is None else self._lighting.most_rays

    def shader(self, gloss: int | None) -> tuple[tuple[str, ...], str]:
        """Return what is defined and what comes before the fragment shader of an object, which is glossy where it has a
        number."""
        if gloss is None:
            return self.defined, self.text
        return (*self.defined, "GLOSS"), read_shader("gloss.glsl") + self.text

    def update(self, exposure: Exposure, instant: Instant, view: View, window: Window) -> None:
        """Make it that of a pass."""
        self._surfaces.update(instant, view, window)
        if self._lighting is not None:
            self._lighting.update(exposure, instant.frame)
        if self._gloss is not None:
            self._gloss.update(self.use(), exposure.direction, view, window, instant.jitter, instant.frame)

    def use(self) -> Uniforms:
        """Bind what shaders read; return their uniforms."""
        self._surfaces.use()
        return self._surfaces.uniforms | ({} if self._lighting is None else self._lighting.use())

    def use_mirror(self, number: int) -> Uniforms:
        """Bind what a glossy object mirrors; return its shader's further uniforms."""
        return {} if self._gloss is None else self._gloss.polygons[number].use(_MIRROR)

    def release(self) -> None:
        """Free everything."""
        self._surfaces.release()
        if self._gloss is not None:
            self._gloss.release()
        if self._lighting is not None:
            self._lighting.release()


def make_light(
    context: GraphicsContext,
    scene: Scene,
    bodies: Sequence[Body],
    technique: Technique,
    shadings: dict[str | None, Shading],
    size: tuple[int, int],
) -> Light | None:
    """Return how a scene's surfaces answer light; None where each shows its colour and no more."""
    needed = bool(scene.lights) or any(o.material.kind == "glossy" for o in scene.objects)
    return Light(context, scene, bodies, technique, shadings, size) if needed else None
