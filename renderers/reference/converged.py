"""References of textured scenes: exact where they can be, else a mean of replicates with a bound of 99 % confidence.

At an instant the box filter is exact (`textured`), and every separable filter is as good as that (`smoothed`); the
cone, and what would take too much work, adds an unbiased estimate of a small rest (`weighted`). An open shutter
averages exact instants from strata of the shutter, two to a stratum as mirror images, so that what is linear in time
cancels; replicates share the finest strata, which makes their spread too large rather than too small. Under wide
filters it averages points (`dotted`). Zone plates too fine for quadrature are integrated along lines (`scanlines`).

The bound of a value is Student's t times its standard error. "All pixels at once" is taken literally: the quantile is
Bonferroni's for every channel of every pixel, 1 - 0.01 / (2 m). Pooling variances over pixels would be smaller and
wrong, pixels differ by orders of magnitude.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from aliasbench.renderers.reference.cache import Stored
from aliasbench.renderers.reference.dotted import affordable_instants, draw_dotted, lattice
from aliasbench.renderers.reference.faces import Faces
from aliasbench.renderers.reference.filtered import is_pixel_box, wide_view
from aliasbench.renderers.reference.flat import depth_extent, over_bands, palette
from aliasbench.renderers.reference.pans import average_slide, is_even_motion
from aliasbench.renderers.reference.paths import Paths
from aliasbench.renderers.reference.pieces import join_pieces, pieces_at
from aliasbench.renderers.reference.scanlines import scan_rows
from aliasbench.renderers.reference.smoothed import draw_smoothed
from aliasbench.renderers.reference.surfaces import WALK, WALK_BLEND
from aliasbench.renderers.reference.texture_tables import TextureTable, texture_table
from aliasbench.renderers.reference.textured import Instant, draw_textured, instant_of
from aliasbench.renderers.reference.weighted import Cells, build_cells, sample_rest
from aliasbench.renderers.sampling.filters import FilterSpec
from aliasbench.renderers.sampling.hashing import combine, permute, unit
from aliasbench.scenes.model import FloatArray, ImageTexture, Scene
from aliasbench.scenes.projection import view_at

REPLICATES = 12  # Student's factor against the finer strata of fewer
_LINES = 64  # of a row in a replicate, at 256 x 256; the work is the same at other sizes
_TIMES = 32
_CONFIDENCE = 0.99
_MOST_STRATA = 96  # of the shutter, in a replicate
# Prices in nanoseconds, measured; they choose the number of strata, so they are constants and not clocks.
_BUDGET, _PIXEL_COST, _CROSSING_COST, _TILE_COST, _PIECE_COST = 3.6e10, 1000.0, 40.0, 100.0, 1e6
_CELL_WORK, _MOST_CELLS = 2**24, 21  # cells under all filters of a replicate; to a pixel along one axis
_FLOOR = 1e-9  # for the rounding of what is averaged

Maker = Callable[[int], FloatArray]


def converge(
    scene: Scene, faces: Faces, paths: Paths, size: tuple[int, int], frame: int, spec: FilterSpec, *, linear: bool,
    spread: bool,
) -> Stored:  # fmt: skip
    """Return the reference of a textured scene; of 0 samples where it is exact, with a certified bound.

    Parameters
    ----------
    spec : FilterSpec
    linear : bool
        Whether images are blends of their texels instead of squares.
    spread : bool
        Whether to average over the open shutter, else at its middle.
    """
    table = texture_table(scene, linear=linear)
    shutter = scene.animation.shutter
    cells = None if is_pixel_box(spec) else build_cells(spec, _cells_each(spec, size))

    def snapshot(fraction: float) -> "_Snapshot":
        return _Snapshot(scene, faces, paths, size, frame, fraction, table, cells)

    if spread:
        slide = _slide(scene, faces, paths, size, frame, table, spec)
        if slide is not None:
            return slide
        if cells is not None:
            points = lattice(spec)
            count = affordable_instants(points, size, len(faces.owners), _BUDGET / REPLICATES)

            def dots(replicate: int) -> FloatArray:
                seed = int(combine(combine(0x7E57, replicate), frame))
                return draw_dotted(scene, faces, paths, size, frame, table, points, count, seed)

            return _average(dots, size, count * points.each**2, 0.0)
    elif cells is not None and spec.kind.separable:
        view = wide_view(view_at(scene.camera, scene.animation, frame, shutter / 2, size), spec)
        smooth = draw_smoothed(instant_of(scene, faces, paths, view, frame, shutter / 2, table), spec)
        if smooth is not None:
            return Stored(smooth.pixels, float(smooth.bound.max()), 0)
    middle = snapshot(shutter / 2)
    if middle.bound is None and cells is None:
        return _by_lines(scene, faces, paths, size, frame, table, spread=spread)
    if not spread:
        if cells is None and middle.bound is not None:
            return Stored(middle.base, middle.bound, 0)
        return _average(lambda replicate: middle.picture(replicate), size, 1, middle.bound or 0.0)
    strata = int(np.clip(_BUDGET / (2 * REPLICATES * _price(middle.instant)), 1, _MOST_STRATA))
    bounds = [middle.bound]

    def one(replicate: int) -> FloatArray:
        total = np.zeros((size[1], size[0], 3))
        for k in range(strata):
            key = combine(combine(0x7E57, k), frame)
            u = (permute(replicate, REPLICATES, key) + unit(combine(key, 1), replicate)) / (2 * REPLICATES)
            for half, place in enumerate((u, 1.0 - u)):
                seed = (replicate * strata + k) * 2 + half
                shown = snapshot(shutter * (k + place) / strata)
                bounds.append(shown.bound)
                total += shown.picture(seed)
        return total / (2 * strata)

    average = _average(one, size, 2 * strata, 0.0)
    known = [bound for bound in bounds if bound is not None]
    if len(known) < len(bounds):
        # some instants are too fine to be drawn exactly
        return _by_lines(scene, faces, paths, size, frame, table, spread=spread)
    return replace(average, uncertainty=average.uncertainty + sum(known) / len(known))


def _slide(
    scene: Scene, faces: Faces, paths: Paths, size: tuple[int, int], frame: int, table: TextureTable, spec: FilterSpec
) -> Stored | None:
    """Return the exact mean over the open shutter where textures only slide along their rows."""
    if not is_even_motion(paths, frame) or not spec.kind.separable:
        return None
    begin, end = (
        instant_of(
            scene,
            faces,
            paths,
            wide_view(view_at(scene.camera, scene.animation, frame, f, size), spec),
            frame,
            f,
            table,
        )
        for f in (0.0, scene.animation.shutter)
    )
    slide = average_slide(begin, end)
    if slide is None:
        return None
    exact = draw_textured(slide) if is_pixel_box(spec) else draw_smoothed(slide, spec)
    return None if exact is None else Stored(exact.pixels, float(exact.bound.max()), 0)


def _price(instant: Instant) -> float:
    """Return about how many nanoseconds the exact picture of an instant takes: rows of texels cross every column."""
    pieces, surfaces, view = instant.pieces, instant.surfaces, instant.view
    crossings = 0.0
    for m in np.flatnonzero((surfaces.ways == WALK) | (surfaces.ways == WALK_BLEND)):
        points = pieces.points[pieces.starts[m] : pieces.starts[m + 1]]
        homogeneous = np.c_[points, np.ones(len(points))]
        rows = float(np.ptp(homogeneous @ surfaces.own[m, 1] / (homogeneous @ surfaces.own[m, 2])))
        crossings += 2 * rows * min(view.width, float(np.ptp(points[:, 0])) + 1.0)
    return (
        _PIXEL_COST * view.width * view.height
        + _CROSSING_COST * crossings
        + _TILE_COST * surfaces.tiles
        + _PIECE_COST * len(pieces.owners)
    )


def _cells_each(spec: FilterSpec, size: tuple[int, int]) -> int:
    """Return how many cells to a pixel pay: the error falls with their number, the work is one term for each."""
    work = _CELL_WORK / (size[0] * size[1])
    each = int(min(np.sqrt(work) / max(1.0, 2 * spec.support), _MOST_CELLS))
    return max(3, each - 1 + each % 2)


class _Snapshot:
    """A scene at one instant: its exact box-filtered picture, or what is exact of it under another filter."""

    def __init__(
        self, scene: Scene, faces: Faces, paths: Paths, size: tuple[int, int], frame: int, fraction: float,
        table: TextureTable, cells: Cells | None,
    ) -> None:  # fmt: skip
        view = view_at(scene.camera, scene.animation, frame, fraction, size)
        fine = view if cells is None else cells.fine_view(view)
        self.instant = instant_of(scene, faces, paths, fine, frame, fraction, table)
        exact = draw_textured(self.instant)
        self.bound = None if exact is None else float(exact.bound.max())
        self.means = np.zeros((fine.height, fine.width, 3)) if exact is None else exact.pixels
        self.cells, self.size, self.frame = cells, size, frame
        self.base = self.means if cells is None else cells.gather(self.means, size)

    def picture(self, seed: int) -> FloatArray:
        """Return the exact picture, or an unbiased estimate of it."""
        if self.cells is None:
            return self.base
        at = self.instant
        return self.base + sample_rest(
            self.cells, at.pieces, at.surfaces, at.colors, self.means, at.view.perspective, at.extent, self.size,
            seed, self.frame, known=self.bound is not None,
        )  # fmt: skip


def _average(make: Maker, size: tuple[int, int], per_pixel: int, bound: float) -> Stored:
    """Return the mean of the replicates and its 99 % bound, to which the certified bound of each is added."""
    mean, spread_sum = np.zeros((size[1], size[0], 3)), np.zeros((size[1], size[0], 3))
    for replicate in range(REPLICATES):
        picture = make(replicate)
        change = picture - mean
        mean += change / (replicate + 1)
        spread_sum += change * (picture - mean)
    error = np.sqrt(spread_sum / (REPLICATES - 1) / REPLICATES)
    quantile = -float(stdtrit(REPLICATES - 1, (1 - _CONFIDENCE) / (2 * mean.size)))
    samples = REPLICATES * per_pixel * size[0] * size[1]
    return Stored(mean, quantile * float(error.max()) + bound + _FLOOR, samples)


def _by_lines(
    scene: Scene, faces: Faces, paths: Paths, size: tuple[int, int], frame: int, table: TextureTable, *, spread: bool
) -> Stored:
    """Return the mean of replicates from stratified lines."""
    times = _TIMES if spread else 1
    # an analytic texture has few squares or none: a line is cheap
    dear = any(isinstance(t, ImageTexture) for t in scene.textures.values())
    lines = int(np.clip(_LINES * (1 if dear else 4) * 65536 / (size[0] * size[1]), 8, 512))
    rows = lines // times * times if times > 1 else lines
    return _average(
        lambda replicate: _replicate(
            scene, faces, paths, size, frame, table, times, max(1, lines // times), replicate
        ),
        size, rows, 0.0,
    )  # fmt: skip


def _replicate(
    scene: Scene, faces: Faces, paths: Paths, size: tuple[int, int], frame: int, table: TextureTable,
    times: int, lines: int, replicate: int,
) -> FloatArray:  # fmt: skip
    """Return one unbiased picture; its times are stratified over the shutter, one in each stratum."""
    shutter = scene.animation.shutter
    key = combine(combine(0x7E57, replicate), frame)
    fractions = [shutter * (k + unit(key, k)) / times for k in range(times)] if times > 1 else [shutter / 2]
    views = [view_at(scene.camera, scene.animation, frame, f, size) for f in fractions]
    pieces = join_pieces([pieces_at(faces, paths, v, frame, f) for v, f in zip(views, fractions, strict=True)])
    colors, extent = palette(scene), depth_extent(scene)
    out = np.zeros((size[1], size[0], 3))

    def draw(rows: NDArray[np.int64]) -> None:
        scan_rows(
            pieces.points, pieces.starts, pieces.planes, pieces.owners, pieces.instants, colors,
            table.kinds, table.maps, table.params, table.sizes, table.offsets, table.texels,
            views[0].perspective, extent, lines, replicate, frame, rows, out,
        )  # fmt: skip

    over_bands(draw, size[1])
    return out
