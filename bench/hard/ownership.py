"""Who owns a sample, computed in float64 without any renderer: the truth that sampled pictures are held to.

Polygons are projected, and a sample belongs to the last one on top that contains it. A renderer may differ only where
the sample is close to an edge, so a wrong sample's distance from the nearest edge is the renderer's error in pixels.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.model import FloatArray, Scene
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import view_at


@dataclass(frozen=True, slots=True, eq=False)
class Ownership:
    """What samples see.

    Attributes
    ----------
    color : (n, 3) float64
    distance : (n,) float64
        From the nearest outline of any polygon, in pixels; infinite where there is none.
    """

    color: FloatArray
    distance: FloatArray


def outline_px(scene: Scene, number: int, size: tuple[int, int], frame: int, fraction: float) -> FloatArray:
    """Return (n, 2): an object's outline in pixels at a time; all of it must be before the camera."""
    surface = scene.objects[number]
    matrix = object_matrix(surface.motion, scene.animation, frame, fraction)
    view = view_at(scene.camera, scene.animation, frame, fraction, size)
    out: FloatArray = view.project(surface.vertices @ matrix[:3, :3].T + matrix[:3, 3])[:, :2]
    return out


def distance_to_outline(points: FloatArray, outline: FloatArray) -> FloatArray:
    """Return (n,): how far points (n, 2) are from the nearest side of a closed outline (m, 2), in its units."""
    nearest = np.full(len(points), np.inf)
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        side = b - a
        length2 = float(side @ side)
        along = np.clip((points - a) @ side / length2, 0.0, 1.0) if length2 > 0.0 else np.zeros(len(points))
        nearest = np.minimum(nearest, np.linalg.norm(points - a - along[:, None] * side, axis=1))
    return nearest


def inside(points: FloatArray, outline: FloatArray) -> NDArray[np.bool_]:
    """Return (n,): which points lie in a simple outline, by crossings of the line to the right."""
    x, y = points.T
    out = np.zeros(len(points), dtype=np.bool_)
    for (ax, ay), (bx, by) in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        if ay != by:
            out ^= ((ay > y) != (by > y)) & (x < ax + (y - ay) * (bx - ax) / (by - ay))
    return out


def who_owns(
    scene: Scene, size: tuple[int, int], points: FloatArray, *, frame: int = 0, fraction: float = 0.0
) -> Ownership:
    """Return what samples at `points` (n, 2) in pixels see of flat polygons that are drawn in order, no two at odds.

    Only for scenes in which a later object is nowhere behind an earlier one: depth is not looked at.
    """
    color = np.tile(np.asarray(scene.background, dtype=np.float64), (len(points), 1))
    distance = np.full(len(points), np.inf)
    for number, surface in enumerate(scene.objects):
        outline = outline_px(scene, number, size, frame, fraction)
        color[inside(points, outline)] = surface.color
        distance = np.minimum(distance, distance_to_outline(points, outline))
    return Ownership(color, distance)


def pixel_points(size: tuple[int, int], x: float = 0.5, y: float = 0.5) -> FloatArray:
    """Return (w h, 2): the places (column + x, row + y) of all pixels, row by row."""
    columns, rows = np.meshgrid(np.arange(size[0]) + x, np.arange(size[1]) + y)
    return np.stack([columns.ravel(), rows.ravel()], axis=1)


def worst_misplacement(pixels: NDArray[np.floating], truth: Ownership, tolerance: float = 1e-5) -> float:
    """Return the largest distance from an edge, in px, at which a one-sample picture (h, w, 3) has a wrong colour."""
    wrong = np.abs(pixels.reshape(-1, 3) - truth.color).max(axis=1) > tolerance
    return float(truth.distance[wrong].max()) if wrong.any() else 0.0
