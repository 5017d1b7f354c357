"""Temporal antialiasing: one sample a pixel and frame, and the mean over frames, each pixel following what it shows.

A running application has drawn the frames before; here each frame draws again up to 32 of them and says what the last
alone took. The first of them is taken as it is: were there black before, a still picture would never be the mean of its
frames. Frame n is moved by the point n + 1 of the Halton sequence in bases 2 and 3: any 32 in a row are spread well. A
picture of several passes, hardware samples or sub-pixels is moved as a whole, and its filter thereby widened by the box
of a pixel.

Colours are averaged as they are, linear and however bright: that is what makes a still picture right.
"""

from contextlib import ExitStack

from aliasbench.renderers.raster.graphics import GraphicsContext
from aliasbench.renderers.raster.motion import Motion
from aliasbench.renderers.raster.pictures import PostStage
from aliasbench.renderers.raster.placement import Placement
from aliasbench.renderers.raster.projection import depth_rule
from aliasbench.renderers.raster.stages import Image, Jitter
from aliasbench.renderers.technique import Technique
from aliasbench.scenes.model import Scene

# frames before its own that a frame depends on
REPLAYED = 32


def halton_place(frame: int) -> Jitter:
    """Return where a frame's samples lie relative to the pixels' centres, in pixels, right and down: [-.5, .5) each."""
    return (_radical_inverse(frame + 1, 2) - 0.5, _radical_inverse(frame + 1, 3) - 0.5)


def _radical_inverse(number: int, base: int) -> float:
    mirrored, scale = 0, 1
    while number:
        number, digit = divmod(number, base)
        mirrored, scale = mirrored * base + digit, scale * base
    return mirrored / scale


class Taa:
    """The mean over frames, in one of two pictures of which the other is the history; see `taa.frag.glsl`."""

    def __init__(
        self,
        context: GraphicsContext,
        scene: Scene,
        placement: Placement,
        technique: Technique,
        source: Image,
        size: tuple[int, int],
        made: ExitStack,
    ) -> None:
        rule = depth_rule(scene.camera)
        self._motion = Motion(context, scene, placement, technique, size, rule, made)
        # what does not move may change all the same where it reflects others, or they their shadows on it
        self._by_surface = not scene.lights and all(s.material.kind in ("unlit", "diffuse") for s in scene.objects)
        self._larger_is_nearer = rule.comparison == ">="
        # two of each kind, so that there always is one that does not write what it reads
        self._still, self._moving = (
            [PostStage(context, source, size, made, "taa.frag.glsl", constants={"STILL": still}) for _ in range(2)]
            for still in (1, 0)
        )
        self._is_first = self._is_still = False
        self.output = self._still[0].output

    def begin(self, frame: int, is_first: bool) -> None:
        """Draw the motion up to the frame that is run next; the first one has no history."""
        self._is_first = is_first
        self._is_still = self._motion.draw(frame, halton_place(frame))

    def run(self, scale: float, /) -> None:
        """Add a frame's picture, times `scale`, to `output`, the mean up to the one before."""
        simple = self._is_first or self._is_still
        step = next(s for s in (self._still if simple else self._moving) if s.output is not self.output)
        step.others = {"history": self.output}
        if simple:
            step.settings = {"is_first": self._is_first}
        else:
            now, before = self._motion.now, self._motion.before
            step.others |= {"motions": now.motions, "surfaces": now.surfaces, "surfaces_before": before.surfaces}
            step.settings = {"by_surface": self._by_surface, "larger_is_nearer": self._larger_is_nearer}
        step.apply(scale)
        self.output = step.output

    def release(self) -> None:
        """Free everything."""
        for step in (*self._still, *self._moving):
            step.release()
        self._motion.release()
