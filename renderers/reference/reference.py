"""The reference renderer: the exact picture of a scene, or one that states how far off it may be.

Three ways, chosen by the scene: flat colours at an instant are exact up to rounding; flat colours over an open shutter
carry a certified bound; textures at an instant are exact too, and moving ones are sampled in time, with a bound of 99 %
confidence that holds for all pixels at once. The seed changes nothing.
"""

import time
from dataclasses import dataclass
from types import TracebackType
from typing import Self

import numpy as np

from aliasbench.renderers.frame import Frame
from aliasbench.renderers.reference.cache import Stored, fetch
from aliasbench.renderers.reference.faces import Faces, build_faces
from aliasbench.renderers.reference.filtered import draw_filtered, is_pixel_box, wide_view
from aliasbench.renderers.reference.flat import Integral, draw_shutter
from aliasbench.renderers.reference.paths import Paths, scene_paths
from aliasbench.renderers.sampling.filters import FilterSpec, filter_of
from aliasbench.renderers.technique import Technique
from aliasbench.scenes.errors import NotAvailableError
from aliasbench.scenes.model import Scene, content_digest
from aliasbench.scenes.projection import view_at

ALGORITHM = 2  # changes with anything that changes a reference's pixels: stored ones are not used then


@dataclass(frozen=True, slots=True, eq=False)
class PreparedReference:
    """A scene ready for its references; see `renderers.frame.Prepared`."""

    scene: Scene
    technique: Technique
    spec: FilterSpec
    size: tuple[int, int]
    faces: Faces
    paths: Paths
    setup_seconds: float

    def render(self, frame: int = 0, seed: int = 0) -> Frame:  # noqa: ARG002 - the contract's; a reference has no seed
        """Return the reference of frame number `frame`."""
        start = time.perf_counter()
        shown = 0 if self.scene.is_static else frame
        textured = any(o.texture is not None for o in self.scene.objects)
        if textured:
            stored = fetch(self.key(shown), lambda: self._textured(shown))
        elif self.shutter_open:
            stored = fetch(
                self.key(shown), lambda: _stored(draw_shutter(self.scene, self.faces, self.paths, self.size, shown))
            )
        else:
            stored = _stored(
                draw_filtered(
                    self.scene, self.faces, self.paths, self.size, shown, self.scene.animation.shutter / 2, self.spec
                )
            )
        return Frame(
            pixels=stored.pixels,
            seconds=time.perf_counter() - start,
            setup_seconds=self.setup_seconds,
            samples=stored.samples,
            uncertainty=stored.uncertainty,
            uncertainty_kind="confidence" if stored.samples else "bound",
        )

    def key(self, frame: int) -> str:
        """Return the name under which a frame's reference is stored."""
        t = self.technique
        fields = (t.filter, t.radius_px, t.sigma_px, t.texture, t.time, t.motion)
        return content_digest((ALGORITHM, self.scene, self.size, fields, frame))

    @property
    def shutter_open(self) -> bool:
        return self.scene.animation.shutter > 0.0 and self.technique.time == "spread" and not self.scene.is_static

    def _textured(self, frame: int) -> Stored:
        from aliasbench.renderers.reference.converged import converge

        return converge(
            self.scene, self.faces, self.paths, self.size, frame, self.spec,
            linear=self.technique.texture == "linear", spread=self.shutter_open,
        )  # fmt: skip

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        return None


def _stored(integral: Integral) -> Stored:
    return Stored(integral.pixels, float(np.max(integral.bound)), 0)


def prepare_reference(scene: Scene, technique: Technique, size: tuple[int, int]) -> PreparedReference:
    """Return a scene ready for its references.

    Parameters
    ----------
    scene : Scene
    technique : Technique
        Of renderer `reference`: filter, texture truth, time and motion count.
    size : (width, height)
        In pixels.

    Raises
    ------
    NotAvailableError
        For a feature that references do not have yet.
    """
    start = time.perf_counter()
    spec = filter_of(technique)
    _refuse_missing(scene)
    paths = scene_paths(scene, interpolated=technique.motion == "matrix")
    wide_view(view_at(scene.camera, scene.animation, 0, 0.0, size), spec)
    prepared = PreparedReference(scene, technique, spec, size, build_faces(scene), paths, time.perf_counter() - start)
    if not is_pixel_box(spec) and prepared.shutter_open and all(o.texture is None for o in scene.objects):
        raise NotAvailableError(
            f"reference: filter={technique.filter} of radius {technique.radius_px:g} is not available yet for "
            "an open shutter; available: filter=box,radius=0.5"
        )
    return prepared


def _refuse_missing(scene: Scene) -> None:
    """Raise for what a scene has and references do not have yet."""
    available = "available: unlit objects (diffuse without lights) seen through a pinhole or orthographic camera"
    if scene.camera.lens_radius > 0.0:
        raise NotAvailableError(f"reference: a lens (lens_radius) is not available yet; {available}")
    if scene.lights:
        raise NotAvailableError(f"reference: lights are not available yet; {available}")
    for surface in scene.objects:
        if surface.material.kind not in ("unlit", "diffuse"):
            raise NotAvailableError(f"reference: material {surface.material.kind} is not available yet; {available}")
