"""White triangles on black, no two of which meet, and how wrong a picture is: in float64 and by GEOS, unrendered."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aliasbench.bench.hard.case import RASTERS
from aliasbench.bench.hard.ladder import RAY_ROUNDINGS
from aliasbench.bench.hard.ownership import distance_to_outline, inside, outline_px, pixel_points
from aliasbench.scenes.model import Camera, FloatArray, Scene, Surface
from aliasbench.scenes.shapes import polygon

Size = tuple[int, int]
ULP = 2.0**-24  # half a step of float32, relative
SNAP = math.sqrt(2.0) / 512  # px: a vertex moves by up to half of 1/256 px along each axis
_CUT_PX = 1.0 / 256.0
_MOST_CUT = 10_000


def misplaced_px(subject: str, size: Size) -> float:
    """Return by how many pixels a subject may misplace an edge in a picture of `size`: see `ladder`.

    Corners, rays' origins and directions round once each, up to half a diagonal from the picture's middle; the edge
    test's other roundings are of the distance between ray and corner, up to a diagonal, but what still outlines would
    lose by more than 1/256 px is cut in float64 before.
    """
    diagonal = ULP * math.hypot(*size)
    return SNAP if subject in RASTERS else 1.5 * diagonal + min((RAY_ROUNDINGS - 3.0) * diagonal, _CUT_PX)


def misplaced_why(subject: str) -> str:
    """Return in words where `misplaced_px` is from."""
    if subject in RASTERS:
        return "vertices are snapped to 1/256 px: sqrt 2 / 512 px"
    return (
        f"float32 rays: 3 roundings of 2^-24 of half the picture's diagonal, and {RAY_ROUNDINGS - 3.0:g} of all of it, "
        "but what would lose more than 1/256 px is cut in float64"
    )


def near_edge_scene(size: Size, gap_px: float) -> Scene:
    """Return a white half of a picture, whose edge passes the centre of a pixel in its middle at a distance."""
    slope = np.array([0.6, 0.8])
    along, centre = np.array([-slope[1], slope[0]]), 0.5 * (np.array(size) % 2 == 0)
    foot, far = centre + gap_px * slope, 2.0 * float(max(size)) + 2.0
    corners = [foot - far * along, foot + far * along, foot - far * slope]
    return in_pixels(size, polygon([(x, y, 0.0) for x, y in corners]))


def triangle_scene(size: Size) -> Scene:
    """Return a white triangle on black whose edges cross the whole picture; a world unit is a pixel."""
    x, y = size[0] / 2, size[1] / 2
    shape = polygon([(-0.98 * x, -0.93 * y, 0.0), (0.97 * x, -0.71 * y, 0.0), (0.31 * x, 0.96 * y, 0.0)])
    return in_pixels(size, shape)


def comb_scene(size: Size, teeth: int = 24) -> Scene:
    """Return white triangles some 7 px wide from end to end of a long picture, their edges across its longer side.

    Edges of some lean against rows or columns of centres by less and less, down to a thousandth of a pixel.
    """
    x, y = size
    long, short = max(x, y), min(x, y)
    shapes = []
    for number in range(teeth):
        # over the whole length, the first and the last one at its ends, at other places within a pixel each
        along = 3.5 + (long - 8.0) * number / (teeth - 1) + 0.618 * number % 1.0 - long / 2
        points = [(along - 3.1, -0.45 * short), (along + 4.2, -0.38 * short), (along + 0.7, 0.47 * short)]
        if number % 2:
            lean, middle = 0.618 * 4.0 ** -(number // 2 * 5 % 12), math.floor(along) + 0.5
            points[1:] = [(middle + lean, -0.38 * short), (middle - lean, 0.47 * short)]
        shapes.append(polygon([(a, b, 0.0) if x == long else (b, a, 0.0) for a, b in points]))
    return in_pixels(size, *shapes)


def in_pixels(size: Size, *objects: Surface, background: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Scene:
    """Return a scene of which a world unit is a pixel, the origin in the picture's middle."""
    return Scene("hard", Camera("orthographic", height=float(size[1])), objects, background=background)


def grid_offsets(side: int) -> FloatArray:
    """Return (side^2, 2): the centres of a pixel's equal cells."""
    row, column = np.divmod(np.arange(side * side), side)
    out: FloatArray = (np.stack([column, row], axis=-1) + 0.5) / side
    return out


def least_misplacement(pixels: NDArray[np.floating], scene: Scene, size: Size, offsets: FloatArray) -> float:
    """Return how far from an edge, in px, samples must have been taken wrongly to explain a black and white picture.

    A pixel that is m samples off has at least its m samples nearest to an edge, of those that could err that way,
    wrong; a pixel that is no whole number of samples off cannot be explained: inf.
    """
    outlines = _outlines(scene, size)
    count = len(offsets)
    points = [pixel_points(size, x, y) for x, y in offsets.tolist()]
    white = np.stack([_inside_any(p, outlines) for p in points], axis=1)
    off = pixels[..., 0].reshape(-1).astype(np.float64) * count - white.sum(axis=1)
    wrong = np.rint(off)
    # sums and quotients of up to `count` equal terms
    if np.abs(off - wrong).max() > 4.0 * count**2 * ULP or np.ptp(pixels, axis=-1).max() > 0.0:
        return math.inf
    chosen = np.flatnonzero(wrong)
    places = np.stack([p[chosen] for p in points], axis=1)
    distance = _distance(places.reshape(-1, 2), outlines).reshape(len(chosen), count)
    # only samples that could err that way
    distance[white[chosen] != (wrong[chosen] < 0.0)[:, None]] = math.inf
    nth = np.abs(wrong[chosen]).astype(np.int64) - 1
    return float(np.take_along_axis(np.sort(distance, axis=1), nth[:, None], axis=1).max(initial=0.0))


def coverage_error(pixels: NDArray[np.floating], scene: Scene, size: Size) -> float:
    """Return the largest error of a reference's pixel against the area that GEOS cuts out of its square.

    Of very many pixels with a part of an edge every nth is looked at.
    """
    import shapely

    outlines = _outlines(scene, size)
    corner = pixel_points(size, 0.0, 0.0)
    centres = corner + 0.5
    truth = _inside_any(centres, outlines).astype(np.float64)
    near = _distance(centres, outlines) < 0.75  # half a pixel's diagonal is .707
    cut = np.flatnonzero(near)
    cut = cut[:: 1 + len(cut) // _MOST_CUT]
    near[cut] = False
    squares = shapely.box(corner[cut, 0], corner[cut, 1], corner[cut, 0] + 1.0, corner[cut, 1] + 1.0)
    shape = shapely.MultiPolygon([shapely.Polygon(outline) for outline in outlines])
    truth[cut] = shapely.area(shapely.intersection(squares, shape))
    return float(np.abs(pixels[..., 0].reshape(-1) - truth)[~near].max())


def _outlines(scene: Scene, size: Size) -> list[FloatArray]:
    return [outline_px(scene, number, size, 0, 0.0) for number in range(len(scene.objects))]


def _inside_any(points: FloatArray, outlines: Sequence[FloatArray]) -> NDArray[np.bool_]:
    out = np.zeros(len(points), dtype=np.bool_)
    for outline in outlines:
        chosen = _close_to(points, outline)
        out[chosen] |= inside(points[chosen], outline)
    return out


def _distance(points: FloatArray, outlines: Sequence[FloatArray]) -> FloatArray:
    """Return (n,): how far points are from the nearest outline; infinite where that is over a pixel."""
    out = np.full(len(points), math.inf)
    for outline in outlines:
        chosen = _close_to(points, outline)
        out[chosen] = np.minimum(out[chosen], distance_to_outline(points[chosen], outline))
    return out


def _close_to(points: FloatArray, outline: FloatArray) -> NDArray[np.int64]:
    """Return which points lie in the outline's box or less than a pixel from it."""
    low, high = outline.min(axis=0) - 1.0, outline.max(axis=0) + 1.0
    x, y = points.T
    return np.flatnonzero((x > low[0]) & (x < high[0]) & (y > low[1]) & (y < high[1]))
