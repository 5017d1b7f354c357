"""A scene's pictures through single points of the lens at single instants: exact, or unbiased estimates.

One class for each way of drawing; all give what `averaged` asks for. Flat colours are drawn many instants at a time,
which costs about a microsecond for each pixel that an edge crosses.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.reference.coverage import cover_rows
from aliasbench.renderers.reference.faces import Faces
from aliasbench.renderers.reference.filtered import add_filtered, is_pixel_box, wide_view
from aliasbench.renderers.reference.flat import depth_extent, over_bands, palette
from aliasbench.renderers.reference.lit import sample_lit
from aliasbench.renderers.reference.paths import Paths
from aliasbench.renderers.reference.pieces import join_pieces, pieces_at
from aliasbench.renderers.reference.scanlines import scan_rows
from aliasbench.renderers.reference.surfaces import FLAT
from aliasbench.renderers.reference.texture_tables import TextureTable
from aliasbench.renderers.reference.textured import Instant, draw_textured, instant_of
from aliasbench.renderers.reference.weighted import Cells, build_cells, sample_rest
from aliasbench.renderers.sampling.filters import FilterSpec
from aliasbench.renderers.sampling.hashing import combine
from aliasbench.scenes.model import FloatArray, ImageTexture, Scene
from aliasbench.scenes.projection import View, focus_at, lens_view, view_at

_CHUNK = 64  # instants drawn at once
_ROUNDING = 1e-12
# Nanoseconds of one core, measured once: for a pixel, one that edges cross, a face, a picture, a term of a filter
_PIXEL, _CROSSED, _FACE, _PICTURE, _TERM = 15.0, 900.0, 2000.0, 2e5, 8.0
_TEXTURED, _TEXEL, _LINE = 1500.0, 100.0, 300.0  # a textured pixel, a texel clipped alone, a pixel on a line
_TEXTURED_PICTURE = 1.5e6  # setting up the tables of a textured picture, whatever its size
_LINES = 2  # of a row of cells, where texels are too fine to be clipped
_LIT, _SHADOW, _POINTS = 1000.0, 100.0, 2  # a lit point, an occluder that may shade it, points to a pixel
_CELLS = 3  # to a pixel along one axis, under wide filters


@dataclass(frozen=True, slots=True, eq=False)
class Shot:
    """What is pictured: a scene, its frame, the picture's size and the pixel filter."""

    scene: Scene
    faces: Faces
    paths: Paths
    size: tuple[int, int]
    frame: int
    spec: FilterSpec

    def view(self, place: FloatArray) -> View:
        """Return the view through a point of the lens at an instant, see `averaged.lens_places`."""
        camera, animation = self.scene.camera, self.scene.animation
        a, b, fraction = (float(v) for v in place)
        view = view_at(camera, animation, self.frame, fraction, self.size)
        if a == 0.0 and b == 0.0:
            return view
        return lens_view(view, a, b, focus_at(camera, animation, self.frame, fraction))


@dataclass(slots=True, eq=False)
class _Tally:
    """What was drawn so far."""

    pictures: int = 0
    nanoseconds: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class FlatPictures:
    """Flat-coloured scenes: exact pictures under any filter."""

    shot: Shot
    tally: _Tally = field(default_factory=_Tally)

    @property
    def size(self) -> tuple[int, int]:
        return self.shot.size

    @property
    def contrast(self) -> float:
        colors = palette(self.shot.scene)
        return float((colors.max(axis=0) - colors.min(axis=0)).max()) * self.shot.spec.gain

    def price(self) -> float:
        return self.tally.nanoseconds / max(1, self.tally.pictures)

    def add(self, places: FloatArray, seed: int, out: FloatArray) -> float:  # noqa: ARG002 - exact pictures have none
        return max(self._add(places[k : k + _CHUNK], out) for k in range(0, len(places), _CHUNK))

    def _add(self, places: FloatArray, out: FloatArray) -> float:
        shot, scene, spec = self.shot, self.shot.scene, self.shot.spec
        box = is_pixel_box(spec)
        views = [shot.view(p) for p in places]
        views = views if box else [wide_view(v, spec) for v in views]
        pieces = join_pieces(
            [
                pieces_at(shot.faces, shot.paths, view, shot.frame, float(place[2]))
                for view, place in zip(views, places, strict=True)
            ]
        )
        colors, extent, weights = palette(scene), depth_extent(scene), np.ones(len(places))
        view = views[0]

        def draw(rows: NDArray[np.int64], out: FloatArray) -> int:
            return cover_rows(
                pieces.points, pieces.starts, pieces.planes, pieces.owners, pieces.instants, colors, view.perspective,
                extent, weights, rows, out,
            )  # fmt: skip

        self.tally.pictures += len(places)
        self.tally.nanoseconds += len(places) * (
            view.width * view.height * _PIXEL + len(shot.faces.owners) * _FACE + _PICTURE
        )
        if box:
            crossed = sum(over_bands(lambda rows: draw(rows, out), view.height))
            self.tally.nanoseconds += crossed * _CROSSED
            return max(_ROUNDING, 8 * 2.0**-52 * max(shot.size)) * float(np.abs(colors).max())
        terms = (2 * spec.margin + 1) ** 2
        edges = float(np.abs(np.diff(pieces.points, axis=0)).clip(0, view.width + view.height).sum())
        self.tally.nanoseconds += edges * (_CROSSED + terms * _TERM * 4)
        return add_filtered(scene, view, pieces, weights, spec, out) / len(places)


@dataclass(frozen=True, slots=True, eq=False)
class TexturedPictures:
    """Textured scenes: exact under the box of a pixel, else an unbiased estimate, see `weighted`."""

    shot: Shot
    table: TextureTable
    tally: _Tally = field(default_factory=_Tally)

    @property
    def size(self) -> tuple[int, int]:
        return self.shot.size

    @property
    def contrast(self) -> float:
        brightest = max(
            1.0,
            float(np.abs(self.table.texels).max(initial=0.0)),
            float(np.abs(self.table.params[:, :6]).max(initial=0)),
        )
        return float(np.abs(palette(self.shot.scene)).max()) * brightest * self.shot.spec.gain

    def price(self) -> float:
        return self.tally.nanoseconds / max(1, self.tally.pictures)

    def add(self, places: FloatArray, seed: int, out: FloatArray) -> float:
        spec = self.shot.spec
        cells = None if is_pixel_box(spec) else build_cells(spec, _CELLS)
        return max(self._add(place, cells, int(combine(seed, k)), out) for k, place in enumerate(places))

    def _add(self, place: FloatArray, cells: Cells | None, seed: int, out: FloatArray) -> float:
        shot = self.shot
        view = shot.view(place) if cells is None else cells.fine_view(shot.view(place))
        at = instant_of(shot.scene, shot.faces, shot.paths, view, shot.frame, float(place[2]), self.table)
        exact = draw_textured(at)
        self.tally.pictures += 1
        pixels = view.width * view.height
        if exact is None:
            means, bound = _scan(at, self.table, seed, shot.frame), _ROUNDING
            ends = _texel_rows(at) * view.height * _LINES
            self.tally.nanoseconds += (
                _TEXTURED_PICTURE + pixels * _LINES * _LINE * len(at.pieces.owners) + ends * _TEXEL
            )
        else:
            means, bound = exact.pixels, float(exact.bound.max())
            texels = at.surfaces.tiles + _texel_rows(at) * view.width
            self.tally.nanoseconds += _TEXTURED_PICTURE + pixels * _TEXTURED + texels * _TEXEL
        if cells is None:
            out += means
            return bound
        out += cells.gather(means, shot.size)
        out += sample_rest(
            cells, at.pieces, at.surfaces, at.colors, means, view.perspective, at.extent, shot.size,
            int(combine(seed, 1)), shot.frame,
        )  # fmt: skip
        return bound * shot.spec.gain


@dataclass(frozen=True, slots=True, eq=False)
class LitPictures:
    """Scenes with lights: unbiased estimates from a few points a pixel, see `lit`."""

    shot: Shot
    linear: bool
    tally: _Tally = field(default_factory=_Tally)

    @property
    def size(self) -> tuple[int, int]:
        return self.shot.size

    @property
    def contrast(self) -> float:
        scene = self.shot.scene
        brightest = max([1.0, *(max(light.radiance) for light in scene.lights)])
        texels = [
            float(np.abs(t.texels).max(initial=0.0)) for t in scene.textures.values() if isinstance(t, ImageTexture)
        ]
        return float(np.abs(palette(scene)).max(initial=1.0)) * brightest * max([1.0, *texels]) * self.shot.spec.gain

    def price(self) -> float:
        return self.tally.nanoseconds / max(1, self.tally.pictures)

    def add(self, places: FloatArray, seed: int, out: FloatArray) -> float:
        shot = self.shot
        for k, place in enumerate(places):
            out += sample_lit(
                shot.scene, shot.faces, shot.paths, shot.view(place), shot.frame, float(place[2]), shot.spec, _POINTS,
                int(combine(seed, k)), linear=self.linear,
            )  # fmt: skip
        pixels = (shot.size[0] + 2 * shot.spec.margin) * (shot.size[1] + 2 * shot.spec.margin)
        each = len(shot.faces.owners) * len(shot.scene.lights) * _SHADOW + _LIT
        self.tally.pictures += len(places)
        self.tally.nanoseconds += len(places) * (10 * _PICTURE + pixels * _POINTS * each)
        return _ROUNDING


def _texel_rows(at: Instant) -> float:
    """Return about how many rows of texels are seen."""
    total = 0.0
    for k, own in enumerate(at.surfaces.own):
        if at.surfaces.ways[k] != FLAT:
            corners = at.pieces.points[at.pieces.starts[k] : at.pieces.starts[k + 1]]
            u, v, q = own @ np.column_stack([corners, np.ones(len(corners))]).T
            total += float(max(np.ptp(u / q), np.ptp(v / q)))
    return total


def _scan(at: Instant, table: TextureTable, seed: int, frame: int) -> FloatArray:
    """Return an unbiased estimate of the box-filtered picture, exact along lines."""
    out = np.zeros((at.view.height, at.view.width, 3))
    pieces = at.pieces

    def draw(rows: NDArray[np.int64]) -> None:
        scan_rows(
            pieces.points, pieces.starts, pieces.planes, pieces.owners, pieces.instants, at.colors,
            table.kinds, table.maps, table.params, table.sizes, table.offsets, table.texels,
            at.view.perspective, at.extent, _LINES, seed, frame, rows, out,
        )  # fmt: skip

    over_bands(draw, at.view.height)
    return out
