"""Aiming: the camera of a scene is shifted by a fraction of a pixel until an edge passes a sample as closely as wished.

A picture whose samples all lie a hundredth of a pixel from the nearest edge says nothing of errors of 1e-6 px. Shifted,
it is the same question asked where the answer hangs by a thread.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from aliasbench.bench.hard.ownership import pixel_points
from aliasbench.bench.hard.painting import Painting
from aliasbench.scenes.model import FloatArray, Scene, as_vec3
from aliasbench.scenes.projection import view_at

BESIDE = (2.0**-10, -(2.0**-14), 2.0**-18, -(2.0**-20), 2.0**-22)  # px, to either side of the edge
_APART_PX = 5.0  # between samples that are aimed at, so that they are at different edges or far along one
_STEPS = 6


def aimed(
    scene: Scene, paint: Callable[[Scene], Painting], count: int, beside: Sequence[float] = BESIDE
) -> list[Scene]:
    """Return the scene by shifted cameras: up to `count` centres of pixels are `beside` px from an edge that is seen.

    Parameters
    ----------
    paint : callable
        Takes a scene with the camera elsewhere and returns what is true of it.
    beside : sequence of float
        For each of the chosen samples there is a scene for each; on which side is which is the sample's own.
    """
    import shapely

    painting = paint(scene)
    points = pixel_points(painting.size)
    borders = _borders(painting)
    distance = shapely.distance(shapely.points(points), borders)
    chosen: list[int] = []
    for k in np.argsort(distance, kind="stable"):
        if distance[k] < 1e-6:  # there already
            continue
        if len(chosen) == count or distance[k] > 1.0:
            break
        if all(np.hypot(*(points[k] - points[other])) > _APART_PX for other in chosen):
            chosen.append(int(k))
    out = []
    for k in chosen:
        out += _shifted(scene, paint, points[k], beside)
    return out


def _shifted(
    scene: Scene, paint: Callable[[Scene], Painting], point: FloatArray, beside: Sequence[float]
) -> list[Scene]:
    import shapely

    color = paint(scene).color_at(point[None])[0]

    def off(shift: FloatArray) -> tuple[float, FloatArray]:
        """Return how far the sample is from the border of its first colour, inside positive, and the way there."""
        painting = paint(_moved(scene, shift))
        line = shapely.shortest_line(shapely.Point(point), _borders(painting))
        way = np.diff(shapely.get_coordinates(line), axis=0)[0]
        apart = math.hypot(*way)
        inside = bool((painting.color_at(point[None])[0] == color).all())
        return (apart if inside else -apart), way

    view = view_at(scene.camera, scene.animation, 0, 0.0, paint(scene).size)
    start, way = off(np.zeros(3))
    ahead = (way[0] * view.right - way[1] * view.up) / abs(start)
    away = np.subtract(scene.camera.target, scene.camera.position) if view.perspective else np.ones(1)
    unit = float(np.linalg.norm(away)) / view.scale  # shifts the picture by a pixel
    before, at, low, high = start, off(2.0**-6 * unit * ahead)[0], 0.0, 2.0**-6 * unit
    slope = (at - before) / (high - low)
    for _ in range(_STEPS):
        if slope == 0.0 or abs(at) < 1e-9:
            break
        before, low, high = at, high, high - at / slope
        at = off(high * ahead)[0]
        if abs(high - low) > 2.0**-12 * unit:  # of what is nearer, differences are mostly rounding
            slope = (at - before) / (high - low)
    if not abs(at) < 1e-6 or slope == 0.0:
        return []
    return [_moved(scene, (high + (b - at) / slope) * ahead) for b in beside]


def _moved(scene: Scene, shift: FloatArray) -> Scene:
    """Return a scene whose camera is elsewhere, or, from where it is, looks elsewhere: a pinhole may touch things."""
    camera = scene.camera
    position, target = (as_vec3(np.asarray(place) + shift) for place in (camera.position, camera.target))
    where = replace(camera, target=target)
    return replace(scene, camera=where if camera.projection == "perspective" else replace(where, position=position))


def _borders(painting: Painting) -> object:
    """Return the lines (shapely) at which what is seen changes its colour."""
    import shapely

    return shapely.union_all([shapely.boundary(region) for region in painting.regions().values()])
