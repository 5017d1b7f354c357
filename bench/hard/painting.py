"""The picture of flat polygons in float64, painted one over the other: the truth for samples and for exact coverage.

Polygons are cut to what lies before the camera, projected, and each covers those before it. What a renderer shows at a
sample is then judged by how far the region of that colour is from it, in pixels: a wrong winner in the middle of an
overlap counts as much as a shape that is not there at all.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aliasbench.bench.hard.ownership import inside, pixel_points
from aliasbench.scenes.model import FloatArray, Scene, Vec3
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import View, view_at

TIE_PX = 1e-12  # the truth's own rounding: nearer to an edge a sample is on it, and either side's
SNAPPED_PX = math.sqrt(2.0) / 512.0  # 8 subpixel bits: by half a step of 1/256 px, right and down
SNAPPED = "8 subpixel bits: corners snap to 1/256 px, by at most half a step right and half a step down"
_COLOR_TOLERANCE = 1e-5  # float32 pixels hold the scenes' colours to 6e-8
_WIDER = 4.0  # pictures: to where polygons are cut
_NOWHERE_PX, _TOUCHING_PX = 1e9, 1e-300


@dataclass(frozen=True, slots=True, eq=False)
class Painting:
    """Convex or simple outlines in pixels, back to front, over a background.

    Attributes
    ----------
    size : (width, height)
    outlines : tuple of (n, 2) float64
    colors : tuple of Vec3
    background : Vec3
    """

    size: tuple[int, int]
    outlines: tuple[FloatArray, ...]
    colors: tuple[Vec3, ...]
    background: Vec3

    def color_at(self, points: FloatArray) -> FloatArray:
        """Return (n, 3): what samples at points (n, 2) show."""
        out = np.tile(np.asarray(self.background), (len(points), 1))
        for outline, color in zip(self.outlines, self.colors, strict=True):
            out[inside(points, outline)] = color
        return out

    def regions(self) -> dict[Vec3, Any]:
        """Return the region (shapely) in which each colour is seen, in a window well beyond the picture."""
        import shapely

        reach = _WIDER * max(self.size)
        free = shapely.box(-reach, -reach, self.size[0] + reach, self.size[1] + reach)
        out: dict[Vec3, Any] = {}
        for outline, color in reversed(list(zip(self.outlines, self.colors, strict=True))):
            shape = shapely.make_valid(shapely.Polygon(outline))
            seen, free = shapely.intersection(shape, free), shapely.difference(free, shape)
            out[color] = shapely.union(out[color], seen) if color in out else seen
        out[self.background] = shapely.union(out[self.background], free) if self.background in out else free
        return out

    def coverage(self) -> FloatArray:
        """Return (h, w, 3): each pixel's mean colour, exact up to float64."""
        import shapely

        corners = pixel_points(self.size, 0.0, 0.0)
        pixels = shapely.box(*corners.T, *(corners + 1.0).T)
        out = np.zeros((len(pixels), 3))
        rows = np.arange(float(self.size[1]))
        bands = shapely.box(0.0, rows, float(self.size[0]), rows + 1.0)
        for color, region in self.regions().items():
            # row by row and part by part: what has many corners is slow to cut with every pixel
            parts = shapely.get_parts(shapely.intersection(region, bands))
            part, pixel = shapely.STRtree(pixels).query(parts, predicate="intersects")
            areas = shapely.area(shapely.intersection(pixels[pixel], parts[part]))
            out += np.bincount(pixel, areas, len(pixels))[:, None] * np.asarray(color)
        return out.reshape(self.size[1], self.size[0], 3)

    def apart(self, pixels: NDArray[np.floating], x: float = 0.5, y: float = 0.5) -> FloatArray:
        """Return (h w,): how far from each sample, in pixels, the colour is that a picture (h, w, 3) shows there.

        Samples are at (column + x, row + y). It is 0 where a sample is right, and 1e9 where its colour is nowhere.
        """
        import shapely

        points = pixel_points(self.size, x, y)
        shown = np.asarray(pixels, dtype=np.float64).reshape(-1, 3)
        wrong = ~(np.abs(shown - self.color_at(points)).max(axis=1) <= _COLOR_TOLERANCE)
        out = np.where(wrong, _NOWHERE_PX, 0.0)
        if wrong.any():
            for color, region in self.regions().items():
                alike = wrong & (np.abs(shown - color).max(axis=1) <= _COLOR_TOLERANCE)
                if alike.any() and not region.is_empty:
                    # touching is wrong by less than the truth's rounding
                    out[alike] = np.maximum(shapely.distance(shapely.points(points[alike]), region), _TOUCHING_PX)
        return out


def paint(
    scene: Scene,
    size: tuple[int, int],
    *,
    frame: int = 0,
    fraction: float = 0.0,
    order: tuple[int, ...] | None = None,
) -> Painting:
    """Return the painting of a scene's untextured polygons at a time.

    `order` numbers the objects from back to front, in the scene's order if not given; it is the caller's to know that
    none hides one that comes later. Polygons that reach behind the camera must be convex.
    """
    view = view_at(scene.camera, scene.animation, frame, fraction, size)
    outlines, colors = [], []
    for number in range(len(scene.objects)) if order is None else order:
        surface = scene.objects[number]
        matrix = object_matrix(surface.motion, scene.animation, frame, fraction)
        outline = outline_seen(view, surface.vertices @ matrix[:3, :3].T + matrix[:3, 3])
        if len(outline) > 2:
            outlines.append(outline)
            colors.append(surface.color)
    return Painting(size, tuple(outlines), tuple(colors), scene.background)


def outline_seen(view: View, corners: FloatArray) -> FloatArray:
    """Return (n, 2): an outline in pixels, without what is behind the camera or far outside of the picture."""
    local = view.to_camera(corners)
    wide = _WIDER * max(view.width, view.height) / view.scale
    if view.perspective:
        sides = [(1.0, 0.0, wide), (-1.0, 0.0, wide), (0.0, 1.0, wide), (0.0, -1.0, wide)]
        whole = (local[:, 2] > 0.0).all() and (np.abs(local[:, :2]) <= wide * local[:, 2:]).all()
        for side in () if whole else sides:
            local = _cut(local, local @ np.asarray(side))
        if not len(local):
            return np.zeros((0, 2))
        scale = view.scale / local[:, 2:]
    else:
        if (np.abs(local[:, :2]) > wide).any():
            for axis in (0, 1):
                for sign in (1.0, -1.0):
                    local = _cut(local, wide + sign * local[:, axis])
        local = _cut(local, local[:, 2]) if (local[:, 2:] < 0.0).any() else local
        scale = np.full((len(local), 1), view.scale)
    return np.asarray(np.array([view.width / 2, view.height / 2]) + local[:, :2] * scale * np.array([1.0, -1.0]))


def _cut(corners: FloatArray, distance: FloatArray) -> FloatArray:
    """Return what of a convex outline (n, 3) lies at distances (n,) >= 0 from a plane."""
    out = []
    for k in range(len(corners)):
        here, there = float(distance[k]), float(distance[k - 1])
        if (here >= 0.0) != (there >= 0.0):
            out.append(corners[k - 1] + there / (there - here) * (corners[k] - corners[k - 1]))
        if here >= 0.0:
            out.append(corners[k])
    return np.array(out).reshape(-1, 3)
