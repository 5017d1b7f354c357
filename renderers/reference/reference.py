"""The reference renderer: the exact picture of a scene, or one that states how far off it may be.

Nothing made of unlit and diffuse surfaces is refused. What is drawn how, and what `Frame.uncertainty` then means:

* Flat colours through a pinhole: exact at an instant, certified over an open shutter ("bound").
* Textures through a pinhole: exact or certified at an instant where that is affordable, else sampled ("confidence").
* Lights, through a pinhole at an instant: certified ("bound"), or sampled where the bound stays wide.
* A lens: the pinhole's picture where all is in focus; layers that face the camera certified (`defocus`, "bound").
* All else, lens, shutter and light together: averages over both (`averaged`, "confidence").
* Images with cut-outs become geometry first (`cutouts`), or are sampled where their borders are curves.

"confidence" is 99 % for all pixels at once. The seed changes nothing.
"""

import time
from dataclasses import dataclass, replace
from types import TracebackType
from typing import Self

import numpy as np

from aliasbench.renderers.frame import Frame, Progress
from aliasbench.renderers.reference.averaged import average
from aliasbench.renderers.reference.cache import Stored, fetch
from aliasbench.renderers.reference.constant_uv import paint_constant
from aliasbench.renderers.reference.cutouts import expand
from aliasbench.renderers.reference.defocus import draw_layers, is_in_focus
from aliasbench.renderers.reference.faces import Faces, build_faces
from aliasbench.renderers.reference.far_edges import far_rounding
from aliasbench.renderers.reference.filtered import draw_filtered, wide_view
from aliasbench.renderers.reference.flat import Integral
from aliasbench.renderers.reference.paths import Paths, scene_paths
from aliasbench.renderers.reference.snapshots import FlatPictures, LitPictures, Shot, TexturedPictures
from aliasbench.renderers.sampling.filters import FilterSpec, filter_of
from aliasbench.renderers.technique import Technique
from aliasbench.scenes.errors import InputError, UnsupportedScene
from aliasbench.scenes.limits import LENGTH
from aliasbench.scenes.model import Checker, ImageTexture, Scene, ZonePlate, content_digest
from aliasbench.scenes.projection import view_at

ALGORITHM = 10  # changes with anything that changes a reference's pixels: stored ones are not used then
_WIDE = 1e-3  # a bound beyond which sampling may do better


@dataclass(frozen=True, slots=True, eq=False)
class PreparedReference:
    """A scene ready for its references; see `renderers.frame.Prepared`.

    `scene` is as given, but for triangles of one texture coordinate (see `constant_uv`); `drawn` has its cut-outs as
    geometry, and is None where that cannot be.
    """

    scene: Scene
    drawn: Scene | None
    technique: Technique
    spec: FilterSpec
    size: tuple[int, int]
    faces: Faces
    paths: Paths
    setup_seconds: float

    def render(
        self,
        frame: int = 0,
        seed: int = 0,  # noqa: ARG002 - the contract's; a reference has no seed
        progress: Progress | None = None,
    ) -> Frame:
        """Return the reference of frame number `frame`; `progress` is told its end alone."""
        start = time.perf_counter()
        shown = 0 if self.scene.is_static else frame
        plain = self.drawn is not None and not (_is_textured(self.drawn) or self.scene.lights or self.shutter_open)
        if plain and not self._blurs(shown):
            stored = self._at_once(shown)
        else:
            stored = fetch(self.key(shown), lambda: self._make(shown))
        far = far_rounding(self.scene, self.size, shown, self._fractions, self.spec)
        if far > 0.0:
            largest = 1.0 if self.scene.lights else _brightest(self.scene)
            stored = replace(stored, uncertainty=stored.uncertainty + far * max(1.0, largest))
        self._check(stored)
        if progress is not None:
            progress(1.0)
        return Frame(
            pixels=stored.pixels,
            seconds=time.perf_counter() - start,
            setup_seconds=self.setup_seconds,
            samples=stored.samples,
            uncertainty=stored.uncertainty,
            uncertainty_kind="confidence" if stored.samples else "bound",
        )

    def _check(self, stored: Stored) -> None:
        """Raise for a picture that cannot be: a wrong truth must not pass for one."""
        has_lobes = self.spec.name in ("mitchell", "lanczos")
        most = np.inf if self.scene.lights or has_lobes else _brightest(self.scene)
        least = -np.inf if has_lobes else 0.0
        slack = stored.uncertainty + 1e-9 * (most if np.isfinite(most) else 1.0)
        low, high = float(np.min(stored.pixels)), float(np.max(stored.pixels))
        if not (np.isfinite([low, high]).all() and low >= least - slack and high <= most + slack):
            raise UnsupportedScene(
                f"reference: {self.scene.name}: rounding errors make its picture impossible (values from {low:g} to "
                f"{high:g}); a scene of less extreme sizes or texture coordinates is needed"
            )

    def key(self, frame: int) -> str:
        """Return the name under which a frame's reference is stored."""
        t = self.technique
        fields = (t.filter, t.radius_px, t.sigma_px, t.texture, t.time, t.motion)
        return content_digest((ALGORITHM, self.scene, self.size, fields, frame))

    @property
    def shutter_open(self) -> bool:
        return self.scene.animation.shutter > 0.0 and self.technique.time == "spread" and not self.scene.is_static

    @property
    def _fractions(self) -> tuple[float, float]:
        """The first and last fraction of the frame interval that count."""
        shutter = self.scene.animation.shutter
        return (0.0, shutter) if self.shutter_open else (shutter / 2, shutter / 2)

    @property
    def _linear(self) -> bool:
        return self.technique.texture == "linear"

    def _blurs(self, frame: int) -> bool:
        """Return whether the lens changes anything."""
        return self.scene.camera.lens_radius > 0.0 and not is_in_focus(
            self.scene, self.faces, self.paths, frame, self._fractions
        )

    def _at_once(self, frame: int) -> Stored:
        """Return the flat-coloured picture of an instant, through a pinhole."""
        scene = self.scene if self.drawn is None else self.drawn
        return _stored(draw_filtered(scene, self.faces, self.paths, self.size, frame, self._fractions[0], self.spec))

    def _make(self, frame: int) -> Stored:
        scene, faces, paths, spec, linear = self.drawn, self.faces, self.paths, self.spec, self._linear
        if scene is None:
            from aliasbench.renderers.reference.cutout_samples import sample_cutouts

            shot = Shot(self.scene, faces, paths, self.size, frame, spec)
            return sample_cutouts(shot, linear=linear, shutter=self._fractions)
        blurs, textured = self._blurs(frame), _is_textured(scene)
        if scene.lights:
            return self._lit(scene, frame, blurs=blurs)
        if blurs:
            layers = None
            if not textured and not self.shutter_open:
                layers = draw_layers(scene, faces, paths, self.size, frame, self._fractions[0], spec)
            return self._averaged(scene, frame, blurs=True) if layers is None else _stored(layers)
        if textured:
            from aliasbench.renderers.reference.converged import converge

            return converge(scene, faces, paths, self.size, frame, spec, linear=linear, spread=self.shutter_open)
        if self.shutter_open:
            from aliasbench.renderers.reference.moving import draw_shutter

            return _stored(draw_shutter(scene, faces, paths, self.size, frame, spec))
        return self._at_once(frame)

    def _lit(self, scene: Scene, frame: int, *, blurs: bool) -> Stored:
        """Return the picture of a scene with lights."""
        from aliasbench.renderers.reference.lit import draw_lit

        if blurs or self.shutter_open:
            return self._averaged(scene, frame, blurs=blurs)
        fraction = self._fractions[0]
        view = view_at(scene.camera, scene.animation, frame, fraction, self.size)
        certified = _stored(
            draw_lit(scene, self.faces, self.paths, view, frame, fraction, self.spec, linear=self._linear)
        )
        if certified.uncertainty <= _WIDE:
            return certified
        sampled = self._averaged(scene, frame, blurs=False)
        return min(certified, sampled, key=lambda stored: stored.uncertainty)

    def _averaged(self, scene: Scene, frame: int, *, blurs: bool) -> Stored:
        """Return the average over lens and shutter of pictures drawn one by one."""
        from aliasbench.renderers.reference.texture_tables import texture_table

        shot = Shot(scene, self.faces, self.paths, self.size, frame, self.spec)
        pictures: FlatPictures | LitPictures | TexturedPictures = FlatPictures(shot)
        if scene.lights:
            pictures = LitPictures(shot, self._linear)
        elif _is_textured(scene):
            pictures = TexturedPictures(shot, texture_table(scene, linear=self._linear))
        radius = scene.camera.lens_radius if blurs else 0.0
        return average(pictures, lens_radius=radius, shutter=self._fractions, key=frame)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        return None


def _is_textured(scene: Scene) -> bool:
    return any(o.texture is not None for o in scene.objects)


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
    UnsupportedScene
        For what the scene has and references do not draw.
    """
    start = time.perf_counter()
    spec = filter_of(technique)
    _refuse_missing(scene)
    _refuse_beyond(scene)
    scene = paint_constant(scene, linear=technique.texture == "linear")
    drawn = expand(scene, linear=technique.texture == "linear")
    if drawn is None and scene.lights:
        raise UnsupportedScene(
            "reference: lights on images that are cut out along curves (alpha_cutoff with texture=linear), or into "
            "more faces than can be built, are not drawn; texture=point with fewer texels is"
        )
    shown = scene if drawn is None else drawn
    paths = scene_paths(shown, interpolated=technique.motion == "matrix")
    wide_view(view_at(scene.camera, scene.animation, 0, 0.0, size), spec)
    seconds = time.perf_counter() - start
    return PreparedReference(scene, drawn, technique, spec, size, build_faces(shown), paths, seconds)


def _brightest(scene: Scene) -> float:
    """Return the largest value that anything of an unlit scene shows."""
    values = [max(scene.background)]
    for surface in scene.objects:
        texture = scene.textures[surface.texture] if surface.texture is not None else None
        if texture is None or isinstance(texture, ZonePlate):
            shown = 1.0
        elif isinstance(texture, ImageTexture):
            shown = float(texture.texels[..., :3].max())
        else:
            ends = (texture.black, texture.white) if isinstance(texture, Checker) else (texture.low, texture.high)
            shown = float(np.max(ends))
        values.append(max(surface.color) * shown)
    return max(values)


def _refuse_beyond(scene: Scene) -> None:
    """Raise for coordinates beyond those of scene files, for which the bounds are not derived."""
    for index, surface in enumerate(scene.objects):
        reach = float(np.abs(surface.vertices).max(initial=0.0))
        if reach > LENGTH:
            raise InputError(
                f"reference: object {surface.name or f'number {index}'} reaches {reach:.3g} units from the origin; "
                f"up to {LENGTH:g} is drawn"
            )


def _refuse_missing(scene: Scene) -> None:
    """Raise for what a scene has and references do not have yet."""
    if scene.bounces:
        raise UnsupportedScene(
            f"reference: diffuse interreflection (bounces = {scene.bounces}) is not drawn; direct light alone is"
        )
    for index, surface in enumerate(scene.objects):
        if surface.material.kind not in ("unlit", "diffuse"):
            raise UnsupportedScene(
                f"reference: material {surface.material.kind} (object {surface.name or f'number {index}'}) is not "
                "drawn; unlit and diffuse are, with or without lights"
            )
