"""By how many pixels float32 rays may misplace the edges of a scene's polygons that are seen, and float64 the truth.

As in `edge_pictures`, but edge by edge, for any camera, and with the coordinates that there are. With u half an ulp,
a and b an edge's ends relative to the ray's origin, e = b - a, s = a + b and R the larger of |a| and |b|, Embree's
robust test takes the sign of (e x s) . D:

* its six products, of 7 roundings each, leave 7 u P |D|, P being the sum of |e_i s_j D_k| over all i, j, k that differ,
  by |D|. Parallel rays see 2 |e'| |D| times the distance, e' being what they see of e, so the edge moves by
  7 u P / (2 |e'|). From a pinhole it turns by 7 u P / |e x s|;
* rounded input (vertex, origin, direction, difference) adds 4 u R, and the test's own tolerance 2 u R; from a pinhole
  over the distance to where the edge is seen.

Parallel rays begin in the camera's plane: where a polygon passes through it, the distance to the polygon's plane, as
many roundings of R, moves the line at which it is first seen by that over the share of its normal across the rays.

An angle is scale / cos^2 as many pixels, off the axis. What moves is traced in a frame of its own, whose origin is
within its extent. Where two edges meet sharply what both add reaches farther along them than this: none of it is
allowed for.
"""

import itertools
import math
from collections.abc import Iterator

import numpy as np

from aliasbench.bench.hard.edge_pictures import HALF_ULP, PERMANENT
from aliasbench.bench.hard.painting import outline_seen
from aliasbench.scenes.model import FloatArray, Scene, Surface
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import View, view_at

WHY = (
    "float32 rays: an edge test's six products, of 7 roundings of 2^-24 each, and 6 roundings of the distance to the "
    "edge's farther end, seen from where it is seen"
)
WHY_FAST = (
    f"{WHY}: the robust test's bound, to which the fast one is held, also at inner edges, between which it sees through"
)
INPUT, PRODUCT = 6.0, 7.0
_FLOAT64 = 16.0 * 2.0**-53  # a matrix, a difference, three products and sums, a quotient, the way to the picture
_TINY = float(np.finfo(np.float64).tiny)


def ray_bound(scene: Scene, size: tuple[int, int], *, frame: int = 0, fraction: float = 0.0) -> float:
    """Return by how many pixels float32 rays may misplace an edge that is in the picture."""
    view = view_at(scene.camera, scene.animation, frame, fraction, size)
    worst = 0.0
    for surface in scene.objects:
        matrix = object_matrix(surface.motion, scene.animation, frame, fraction)
        local = surface.vertices @ matrix[:3, :3].T + matrix[:3, 3] - view.origin
        more = np.zeros(3) if surface.motion.is_static else np.ptp(local, axis=0) / 2.0
        worst = max(worst, *(_moved(view, a, b, more) for a, b in _sides(surface, local)))
        worst = max(worst, *(_begins(view, loop, more) for loop in _loops(surface, local)))
    return HALF_ULP * worst


def truth_bound(scene: Scene, size: tuple[int, int], *, frame: int = 0, fraction: float = 0.0) -> float:
    """Return by how many pixels float64 may misplace edges that are in the picture: what the truth is worth."""
    view = view_at(scene.camera, scene.animation, frame, fraction, size)
    worst = 0.0
    for surface in scene.objects:
        matrix = object_matrix(surface.motion, scene.animation, frame, fraction)
        world = surface.vertices @ matrix[:3, :3].T + matrix[:3, 3]
        reach = float(np.linalg.norm(world, axis=1).max() + np.linalg.norm(view.origin))
        for a, b in _sides(surface, world - view.origin):
            rays = _seen(view, a, b)
            if rays is not None:
                worst = max(worst, reach / (_nearest(a, b, rays) if view.perspective else 1.0))
    return _FLOAT64 * worst * view.scale * _off_axis(view)


def _sides(surface: Surface, local: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield the ends of a polygon's sides, or of a mesh's triangles'."""
    for loop in _loops(surface, local):
        yield from zip(loop, np.roll(loop, -1, axis=0), strict=True)


def _loops(surface: Surface, local: FloatArray) -> list[FloatArray]:
    return [local] if surface.is_polygon else list(local[surface.triangles])


def _begins(view: View, loop: FloatArray, more: FloatArray) -> float:
    """Return by how many pixels, of 2^24, the line is misplaced at which parallel rays begin to meet a plane."""
    depth = loop @ view.forward
    if view.perspective or not depth.min() < 0.0 < depth.max():
        return 0.0
    normal = np.cross(loop, np.roll(loop, -1, axis=0)).sum(axis=0)
    across = float(np.hypot(normal @ view.right, normal @ view.up))
    if across <= 1e-9 * float(np.linalg.norm(normal)):
        return 0.0
    origin = math.hypot(view.width, view.height) / 2.0 / view.scale
    reach = float(np.linalg.norm(loop, axis=1).max() + origin + np.linalg.norm(more))
    return (INPUT + PRODUCT * PERMANENT) * reach * float(np.linalg.norm(normal)) / across * view.scale


def _moved(view: View, a: FloatArray, b: FloatArray, more: FloatArray) -> float:
    """Return by how many pixels, of 2^24, one edge may be misplaced; 0 if it is not in the picture."""
    rays = _seen(view, a, b)
    if rays is None:
        return 0.0
    edge, total, origin = b - a, a + b, np.zeros(3)
    if view.perspective:
        nearest, across = _nearest(a, b, rays), float(np.linalg.norm(np.cross(edge, total)))
    else:
        nearest, across = 1.0, 2.0 * float(np.hypot(edge @ view.right, edge @ view.up))
        # every ray has an origin of its own
        origin = (np.abs(view.right) * view.width + np.abs(view.up) * view.height) / 2.0 / view.scale
    length = float(np.linalg.norm(edge)) * (float(np.linalg.norm(total)) if view.perspective else 1.0)
    if across <= 1e-9 * length:
        return 0.0  # along the rays: it is no outline
    reach = max(float(np.linalg.norm(end)) for end in (a, b)) + float(np.linalg.norm(origin + more))
    sizes = np.abs(edge), np.abs(total) + 2.0 * (origin + more), np.abs(rays).max(axis=0)
    products = sum(float(sizes[0][i] * sizes[1][j] * sizes[2][k]) for i, j, k in itertools.permutations(range(3)))
    return (INPUT * reach / nearest + PRODUCT * products / across) * view.scale * _off_axis(view)


def _seen(view: View, a: FloatArray, b: FloatArray) -> FloatArray | None:
    """Return (2, 3): directions of the first and the last ray in the picture to see an edge; None if none does."""
    import shapely

    # an edge as a polygon of no area is cut to what lies before the camera as outlines are
    image = outline_seen(view, view.origin + np.array([a, b, b]))
    if len(image) < 2:
        return None
    part = shapely.intersection(shapely.LineString(image), shapely.box(0.0, 0.0, view.width, view.height))
    ends = shapely.get_coordinates(part)[[0, -1]] if not part.is_empty else None
    if ends is None:
        return None
    directions = np.asarray(view.ray(ends[:, 0], ends[:, 1])[1])
    out: FloatArray = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return out


def _nearest(a: FloatArray, b: FloatArray, rays: FloatArray) -> float:
    """Return how far the nearest point of an edge is that is seen between two rays from a pinhole."""
    along = (b - a) / max(float(np.linalg.norm(b - a)), _TINY)
    height = float(np.linalg.norm(np.cross(a, along)))
    if (rays[0] @ along) * (rays[1] @ along) > 0.0:
        height /= max(float(np.linalg.norm(np.cross(rays, along), axis=1).max()), _TINY)
    return max(height, _TINY)


def _off_axis(view: View) -> float:
    """Return 1 / cos^2 in the picture's corners."""
    return 1.0 + (view.width**2 + view.height**2) / 4.0 / view.scale**2 if view.perspective else 1.0
