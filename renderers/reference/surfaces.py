"""How each textured piece is integrated: which direction its rows take in the picture, and how exact that is.

Under perspective 1 / depth is constant along one direction of the picture (the horizon's). If a texture's v is so too,
or u, whole rows are summed at once (`walks`); an orthographic piece always has such a direction. Else texels are
clipped one by one (`tiles`). The bound of a piece follows from how far rounding may move the border of a texel: by d
texels is off by at most d times the contrast, along u and along v.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.reference.fragments import convex_area
from aliasbench.renderers.reference.pieces import Pieces
from aliasbench.renderers.reference.runs import BILINEAR, GRID, SINE
from aliasbench.renderers.reference.texture_tables import TextureTable
from aliasbench.scenes.model import FloatArray
from aliasbench.scenes.projection import View

FLAT, WALK, WALK_BLEND, WAVE, PLATE, CLIP, CLIP_BLEND = -1, 0, 1, 2, 3, 4, 5

_EPS = 2.0**-52
_FACING = 1e-11  # relative change of 1 / depth over a piece that is none
_ALIGNED = 1e-9  # texels by which a row may leave its direction, across the picture
_STEEPEST = 1e3  # how much faster u may change across the rows than along them
_SLIVER = 1e-12  # square pixels of a piece: seen edge-on but for rounding, which is all its texture is too
# Integrals of running sums along four sides: interpolation, product, quotient and sum round by half of `_EPS` each.
_SUM_ROUNDINGS = 8.0
_MOST_LOST = 1e-9  # of a pixel, by dividing rounding errors by how fast u changes along a row


@dataclass(frozen=True, slots=True, eq=False)
class Surfaces:
    """What the kernels need of each piece.

    Attributes
    ----------
    ways : (m,) int64
        FLAT, WALK and so on.
    own : (m, 3, 3) float64
        Coefficients of u q, v q and q in the picture, u and v in the texture's own coordinates.
    along : (m, 2) float64
        The direction of the rows.
    blocks : (m, 3) int64
        Height, width and first row of the texels.
    params : (m, 8) float64
        As in `texture_tables`.
    shifts : (m,) float64
        By how many texels u moves while the shutter is open, 0 for none; see `pans`.
    shifted : (m, 2, 3) int64
        Then, the blocks of the rows' means, and of the running sums of what the texels differ from them.
    texels, sums : (k, 3) float64
        Rows of width + 1: texels with the first repeated, and their running sums (of neighbours' means, for blends).
    bound : float
        On the error of a pixel by rounding.
    tiles : float
        How many texels must be clipped one by one, about.
    """

    ways: NDArray[np.int64]
    own: FloatArray
    along: FloatArray
    blocks: NDArray[np.int64]
    params: FloatArray
    shifts: FloatArray
    shifted: NDArray[np.int64]
    texels: FloatArray
    sums: FloatArray
    bound: float
    tiles: float


def build_surfaces(
    pieces: Pieces, table: TextureTable, colors: FloatArray, uv_reach: FloatArray, view: View, far: float
) -> Surfaces:
    """Return how each piece is integrated.

    Parameters
    ----------
    pieces : Pieces
    table : TextureTable
    colors : (objects + 1, 3)
    uv_reach : (objects,)
        The largest |u| or |v| of each object.
    view : View
    far : float
        The largest distance of a vertex from the camera.
    """
    m = len(pieces.owners)
    out = Surfaces(
        np.full(m, FLAT, np.int64), np.zeros((m, 3, 3)), np.tile((1.0, 0.0), (m, 1)), np.ones((m, 3), np.int64),
        np.zeros((m, 8)), np.zeros(m), np.ones((m, 2, 3), np.int64), np.zeros((0, 3)), np.zeros((0, 3)), 0.0, 0.0,
    )  # fmt: skip
    bound, tiles = 0.0, 0.0
    for index, owner in enumerate(int(o) for o in pieces.owners):
        kind = int(table.kinds[owner])
        points = pieces.points[pieces.starts[index] : pieces.starts[index + 1]]
        homogeneous = np.c_[points, np.ones(len(points))]
        q = homogeneous @ pieces.planes[index, 3]
        if kind < 0 or not (q > 0.0).all():
            continue
        scale = float(np.abs(colors[owner]).max())
        area = convex_area(points, len(points))
        if area <= _SLIVER:
            brightest = max(
                1.0, float(np.abs(table.row_texels).max(initial=1.0)), float(np.abs(table.params[owner, :6]).max())
            )
            bound = max(bound, area * scale * brightest)
            continue
        rows = np.concatenate([table.maps[owner] @ pieces.planes[index, 1:], pieces.planes[index, 3:]])
        if kind == BILINEAR:
            rows[:2] -= 0.5 * rows[2]
        span = float(np.ptp(points, axis=0).sum())
        wander = float(np.abs(rows[2, :2]).sum() * span / q.max())
        if wander <= _FACING:
            rows[2] = 0.0, 0.0, q.mean()
        else:
            wander = 0.0
        reach = (np.abs(homogeneous) @ np.abs(rows[:2]).T / q[:, None]).max(axis=0)
        reach += uv_reach[owner] * np.abs(table.maps[owner][:, :2]).sum(axis=1)
        relative = _rounding(pieces.planes[index, 0], view, far) + wander
        leaves = _settle(rows, homogeneous, relative * reach, squares=kind == GRID)
        off = float((relative * reach).sum()) + leaves
        values = table.params[owner, :6].reshape(2, 3)
        lost = summing = 0.0
        if kind in (GRID, BILINEAR):
            if kind == GRID:
                off = _moved_borders(rows, homogeneous, relative * reach) + leaves
            choice = _choose_rows(rows, points, q, kind == BILINEAR)
            out.ways[index], rows, out.along[index] = choice.way, choice.rows, choice.along
            h, w, first = out.blocks[index] = table.blocks[owner, int(choice.swapped)]
            values = table.row_texels[first : first + h * (w + 1)]
            off, lost = (1.0 + choice.steep) * off + choice.leaves, choice.lost
            summed = float(np.abs(table.row_sums[first : first + h * (w + 1)]).max(initial=0.0))
            summing = _SUM_ROUNDINGS * _EPS * summed * choice.texel_px
            if choice.way in (CLIP, CLIP_BLEND):
                tiles += _count_tiles(rows, homogeneous)
        elif kind == SINE:
            out.ways[index], out.along[index] = WAVE, _across(rows[2])
            off *= np.pi
        else:
            out.ways[index] = PLATE
            off *= 2.0 * abs(table.params[owner, 6]) * float(reach.max())
        out.own[index], out.params[index] = rows, table.params[owner]
        # nothing is off by more than all there is of a piece in a pixel
        off = min(off, area, 1.0) + lost
        bound = max(bound, scale * (float(np.ptp(values, axis=0).max()) * off + summing))
    return replace(out, texels=table.row_texels, sums=table.row_sums, bound=bound, tiles=tiles)


@dataclass(frozen=True, slots=True, eq=False)
class _Choice:
    """Rows of a texture in the picture.

    `steep`, `leaves` and `lost` enter the bound, see `_STEEPEST`, `_ALIGNED` and `_MOST_LOST`; `texel_px` is the
    longest a texel is along its row, where running sums are divided by what they change by in a pixel.
    """

    way: int
    rows: FloatArray
    along: FloatArray
    swapped: bool
    steep: float
    leaves: float
    lost: float = 0.0
    texel_px: float = 0.0


def _choose_rows(rows: FloatArray, points: FloatArray, q: FloatArray, blend: bool) -> _Choice:
    """Return the direction along which a row of texels runs, with u and v exchanged where that is needed."""
    least, span = float(q.min()), float(np.ptp(points, axis=0).sum())
    for swapped in (False, True):
        own = rows[[1, 0, 2]] if swapped else rows
        facing = not own[2, :2].any()
        along = _across(own[1] if facing else own[2])
        if facing and not own[1, :2].any() and own[0, :2].any():
            along = own[0, :2] / np.linalg.norm(own[0, :2])
        leaves = abs(float(own[1, :2] @ along)) * span / least
        slope = abs(float(own[0, :2] @ along))
        # how fast u and v change across the rows: their gradients, of (u q - u q) / q, at every corner
        homogeneous = np.c_[points, np.ones(len(points))]
        values = homogeneous @ own[:2].T / q[:, None]
        fastest = float(np.abs(own[None, 0, :2] - values[:, :1] * own[None, 2, :2]).max())
        size = float((np.abs(homogeneous) @ np.abs(own[0])).max())
        if leaves <= _ALIGNED and slope * _STEEPEST > fastest and 4.0 * _EPS * size <= _MOST_LOST * slope:
            lost = 4.0 * _EPS * size / slope
            way, texel_px = WALK_BLEND if blend else WALK, float(q.max()) / slope
            return _Choice(way, own, along, swapped, fastest / slope, leaves, lost, texel_px)
        if swapped is False and slope <= 1e-12 * fastest and not own[1].any():
            # a wave whose crests run along the horizon: its rows are the crests, and what counts texels along them is
            # of no matter, there is only one
            crests = np.stack([np.append(along, 0.0) * (least / max(span, 1.0)), own[0], own[2]])
            leaves = slope * span / least
            return _Choice(WALK, crests, along, True, 1.0, leaves)
    return _Choice(CLIP_BLEND if blend else CLIP, rows, np.array([1.0, 0.0]), False, 0.0, 0.0)


def _settle(rows: FloatArray, homogeneous: FloatArray, errors: FloatArray, *, squares: bool) -> float:
    """Make u and v constant in `rows` where they change by rounding only; return by how much they did.

    Such a change has no direction, and dividing by it gives anything. Squares are constant within a texel, so its
    middle stands for all of it: what lies on a border to the last bit belongs to the texel that begins there.
    """
    q = homogeneous @ rows[2]
    most = 0.0
    for c in range(2):
        if not rows[c].any():
            continue  # a texture without this coordinate
        values = homogeneous @ rows[c] / q
        change = float(np.ptp(values))
        if change > 4.0 * float(errors[c]):
            continue
        value = float(values.mean())
        if squares:
            value = float(np.floor(value + errors[c])) + 0.5
        else:
            most += change
        rows[c] = value * rows[2]
    return most


def _moved_borders(rows: FloatArray, homogeneous: FloatArray, errors: FloatArray) -> float:
    """Return which share of a pixel changes its square where u and v are off by `errors`, summed over both.

    A border that is off by d texels moves by d over how many texels there are to a pixel. Where there are many, so are
    the borders, and it comes to d. Rounding is largest where a piece is farthest, and its texels densest.
    """
    q = homogeneous @ rows[2]
    total = 0.0
    for c in range(2):
        values = homogeneous @ rows[c] / q
        low, high = float(values.min()) - errors[c], float(values.max()) + errors[c]
        if np.floor(low) == np.floor(high) or not rows[c].any():
            continue
        slopes = np.hypot(*(rows[c, None, :2] - values[:, None] * rows[2, None, :2]).T) / q
        densest = float(slopes.max())
        total += float(errors[c]) / min(1.0, densest) if densest > 0.0 else 1.0
    return min(total, 1.0)


def _rounding(nearness: FloatArray, view: View, far: float) -> float:
    """Return the relative error of texture coordinates: five times what extended precision shows for any pose.

    A plane that passes by the camera at a small share of its own size loses that share in its distance.
    """
    a, b = nearness[0] * view.scale, nearness[1] * view.scale
    if not view.perspective:
        return float(_EPS * (8.0 + np.hypot(a, b)))
    c = nearness[2] + nearness[0] * view.width / 2 + nearness[1] * view.height / 2
    return float(_EPS * (8.0 + far * np.sqrt(a * a + b * b + c * c) / 4))


def _across(row: FloatArray) -> FloatArray:
    """Return the unit vector along which a row's value does not change; any where it changes nowhere."""
    length = float(np.hypot(row[0], row[1]))
    return np.array([-row[1], row[0]]) / length if length > 0.0 else np.array([1.0, 0.0])


def _count_tiles(rows: FloatArray, homogeneous: FloatArray) -> float:
    """Return the area of a piece in texels, and one for each row."""
    u, v = (homogeneous @ rows[:2].T / (homogeneous @ rows[2])[:, None]).T
    return abs(float(u @ np.roll(v, -1) - v @ np.roll(u, -1))) / 2 + float(np.ptp(v)) + 1.0
