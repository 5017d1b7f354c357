"""Cut-outs whose borders are curves, or too many: stratified points, an unbiased picture of any view and filter.

A blended image is cut out where its blended alpha falls below the cutoff, which is no polygon; and a mask may repeat
more often than is worth cutting (`cutouts.expand` says when). Points are spread over a filter's support by the filter
itself, in a grid of cells with one point each, and each sees the nearest surface that is opaque there. How many points
a pixel takes follows from geometry alone, so it biases nothing: few where no outline, no border of texels and no
crossing of planes comes near.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from aliasbench.renderers.reference.averaged import lens_places
from aliasbench.renderers.reference.cache import Stored
from aliasbench.renderers.reference.cutout_points import find_uneven, sample_rows
from aliasbench.renderers.reference.cutouts import fill_holes
from aliasbench.renderers.reference.filtered import wide_view
from aliasbench.renderers.reference.flat import depth_extent, over_bands, palette
from aliasbench.renderers.reference.pieces import pieces_at
from aliasbench.renderers.reference.snapshots import Shot
from aliasbench.renderers.reference.texture_tables import TextureTable, texture_table
from aliasbench.renderers.sampling.filters import FilterSpec
from aliasbench.renderers.sampling.hashing import combine
from aliasbench.scenes.model import FloatArray, ImageTexture, Scene

IntArray = NDArray[np.int64]

REPLICATES = 32
_CONFIDENCE = 0.99
_POINTS = 1 << 27  # of a whole reference, where something happens
_PLACES = 64  # of lens and shutter in a replicate
_FEW, _MOST = 4, 64  # sides of the grid of an even pixel, and of the finest grid
_BINS = 256
_FLOOR = 1e-9  # for the rounding of what is averaged


@dataclass(frozen=True, slots=True, eq=False)
class CutoutTable:
    """What a point needs to know of textures.

    Attributes
    ----------
    textures : TextureTable
        As if nothing were cut out.
    alphas : (k,) float64
        Of the rows of `textures.texels`.
    cutoffs : (objects,) float64
        -inf where nothing is cut out.
    """

    textures: TextureTable
    alphas: FloatArray
    cutoffs: FloatArray


def cutout_table(scene: Scene, *, linear: bool) -> CutoutTable:
    """Return the textures of a scene with their alpha."""
    textures = texture_table(fill_holes(scene), linear=linear)
    alphas, cutoffs = np.ones(len(textures.texels)), np.full(len(scene.objects), -np.inf)
    for index, surface in enumerate(scene.objects):
        image = None if surface.texture is None else scene.textures[surface.texture]
        if isinstance(image, ImageTexture) and image.alpha_cutoff is not None:
            start = int(textures.offsets[index])
            alphas[start : start + image.texels[..., 3].size] = image.texels[..., 3].ravel()
            cutoffs[index] = np.float32(image.alpha_cutoff)
    return CutoutTable(textures, alphas, cutoffs)


def sample_cutouts(shot: Shot, *, linear: bool, shutter: tuple[float, float]) -> Stored:
    """Return the mean of replicates, with Student's bound of 99 % confidence for all pixels at once.

    Parameters
    ----------
    shot : Shot
        Of the scene with its cut-outs and no lights; its faces have no holes. A lens is that of the scene's camera.
    linear : bool
        Whether images are blends of their texels instead of squares.
    shutter : (float, float)
        First and last fraction of the frame interval; equal for an instant.
    """
    table = cutout_table(shot.scene, linear=linear)
    lens_radius = shot.scene.camera.lens_radius
    count = 1 if lens_radius == 0.0 and shutter[0] == shutter[1] else _PLACES
    width, height = shot.size

    mean, squares, taken = np.zeros((height, width, 3)), np.zeros((height, width, 3)), 0
    for replicate in range(REPLICATES):
        seed = int(combine(combine(0xC07, shot.frame), replicate))
        picture = np.zeros((height, width, 3))
        for k, place in enumerate(lens_places(count, lens_radius, shutter, seed)):
            taken += sample_place(shot, table, place, _POINTS // REPLICATES // count, int(combine(seed, k)), picture)
        change = picture / count - mean
        mean += change / (replicate + 1)
        squares += change * (picture / count - mean)
    error = float(np.sqrt(squares.max(initial=0.0) / (REPLICATES - 1) / REPLICATES))
    quantile = -float(stdtrit(REPLICATES - 1, (1 - _CONFIDENCE) / (2 * mean.size)))
    return Stored(mean, quantile * error + _FLOOR, taken)


def sample_place(shot: Shot, table: CutoutTable, place: FloatArray, points: int, seed: int, out: FloatArray) -> int:
    """Add to `out` (h, w, 3) an unbiased estimate of the picture through one point of the lens at one instant.

    Parameters
    ----------
    place : (3,) float64
        See `averaged.lens_places`.
    points : int
        For all pixels where something happens together.

    Returns
    -------
    int
        How many points were taken.
    """
    view = wide_view(shot.view(place), shot.spec)
    pieces = pieces_at(shot.faces, shot.paths, view, shot.frame, float(place[2]))
    colors, extent = palette(shot.scene), depth_extent(shot.scene)
    textures, spec = table.textures, shot.spec
    edges = _quantiles(spec)
    uneven = np.zeros(out.shape[:2], np.bool_)
    sides = np.full(uneven.shape, _FEW, np.int64)

    def find(rows: IntArray) -> None:
        find_uneven(
            pieces.points, pieces.starts, pieces.planes, pieces.owners, textures.kinds, textures.maps, textures.sizes,
            textures.offsets, table.alphas, table.cutoffs, view.perspective, extent, spec.support, spec.margin, rows,
            uneven,
        )  # fmt: skip

    def draw(rows: IntArray) -> None:
        sample_rows(
            pieces.points, pieces.starts, pieces.planes, pieces.owners, colors, textures.kinds, textures.maps,
            textures.params, textures.sizes, textures.offsets, textures.texels, table.alphas, table.cutoffs,
            view.perspective, extent, spec.params, spec.support, spec.margin, edges, sides, seed, shot.frame, rows, out,
        )  # fmt: skip

    over_bands(find, shot.size[1])
    sides[uneven] = int(np.clip(np.sqrt(points / max(1, int(uneven.sum()))), _FEW, _MOST))
    over_bands(draw, shot.size[1])
    return int((sides**2).sum())


def _quantiles(spec: FilterSpec) -> FloatArray:
    """Return the borders of bins of equal probability that a point's place along an axis is drawn from.

    About as abs f integrated over the other axis, and never 0 where f is not.
    """
    edges = np.linspace(-spec.support, spec.support, 4 * _BINS + 1)
    middles = (edges[1:] + edges[:-1]) / 2
    if spec.kind.separable:
        density = np.abs(spec.evaluate(middles, 0.0))
    else:
        density = np.abs(spec.evaluate(middles[:, None], middles[None, :])).mean(axis=1)
    shares = np.cumsum(density + 1e-2 * density.max())
    out: FloatArray = np.interp(np.arange(_BINS + 1) / _BINS, np.concatenate([[0.0], shares]) / shares[-1], edges)
    return out
