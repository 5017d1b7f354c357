"""What float64 misplaces of edges that reach very far out of the picture, which bounds must not leave out.

Corners in and about the picture are known to a few units in the last place of its width, which every picture's bound
has. Where an edge is cut at the picture's border, the cut is known only as well as the ends: of a polygon a million
pictures wide to some 1e-8 px. Parallel rays begin in the camera's plane, but for a hair by which surfaces in it are let
in: what passes through it is seen by so much more.
"""

import numpy as np

from aliasbench.renderers.reference.clipping import NEAR_PARALLEL
from aliasbench.renderers.sampling.filters import FilterSpec
from aliasbench.scenes.model import FloatArray, Scene, Surface
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import View, view_at

_ROUNDING = 8 * 2.0**-52  # of an end's largest coordinate
_FACING = 1e-9  # tangent of an angle that is none
_WIDE = 16.0  # pictures: nearer ends are within what every picture's bound has


def far_rounding(
    scene: Scene, size: tuple[int, int], frame: int, fractions: tuple[float, float], spec: FilterSpec
) -> float:
    """Return by how much a pixel may be off, relative to the largest colour, for edges that reach far or begin in the
    camera's plane; usually 0.

    An edge that is off by d pixels changes a pixel by at most d times the filter's peak along one axis, and there may
    be two of them to a surface.
    """
    off = 0.0
    near = 0.0
    for fraction in dict.fromkeys(fractions):
        view = view_at(scene.camera, scene.animation, frame, fraction, size)
        furthest = slope = 0.0
        for surface in scene.objects:
            if len(surface.vertices):
                matrix = object_matrix(surface.motion, scene.animation, frame, fraction)
                local = view.to_camera(surface.vertices @ matrix[:3, :3].T + matrix[:3, 3])
                off = max(off, _reach_px(surface, local, view))
                if not view.perspective:
                    furthest, slope = max(furthest, float(np.abs(local).max())), max(slope, _near_slope(surface, local))
        # axes of the world, which the near plane is reckoned in, may be turned
        near = max(near, -NEAR_PARALLEL * np.sqrt(3.0) * furthest * slope * view.scale)
    return 2.0 * (_ROUNDING * off + near) * max(1.0, spec.peak) * spec.gain


def _near_slope(surface: Surface, local: FloatArray) -> float:
    """Return how far the line at which parallel rays begin to see a surface moves with the plane they begin in."""
    corners = local[surface.triangles]
    depth = corners[..., 2]
    passes = (depth.min(axis=1) < 0.0) & (depth.max(axis=1) > 0.0)
    normal = np.cross(corners[passes, 1] - corners[passes, 0], corners[passes, 2] - corners[passes, 0])
    across = np.hypot(normal[:, 0], normal[:, 1])
    # what faces the rays passes the plane everywhere at once: there is no such line
    slopes = np.divide(
        np.abs(normal[:, 2]), across, out=np.zeros_like(across), where=across > _FACING * abs(normal[:, 2])
    )
    return float(slopes.max(initial=0.0))


def _reach_px(surface: Surface, local: FloatArray, view: View) -> float:
    """Return the largest coordinate of an end of an edge that the picture shows a part of, in pixels where it does."""
    usual = _WIDE * max(view.width, view.height)
    half = np.array([view.width, view.height]) / (2.0 * view.scale) * 1.5
    if not view.perspective and np.abs(local[:, :2]).max() * view.scale <= usual:
        return 0.0
    if surface.is_polygon:
        ends = np.stack([local, np.roll(local, -1, axis=0)], axis=1)
    else:
        ends = local[surface.triangles[:, [[0, 1], [1, 2], [2, 0]]]].reshape(-1, 2, 3)
    beyond = ends[..., 2:] * half if view.perspective else half
    hidden = (ends[..., :2] > beyond).all(axis=1) | (ends[..., :2] < -beyond).all(axis=1)
    ends = ends[~np.any(hidden, axis=1)]
    if not view.perspective:
        reach = np.abs(ends[..., :2]).max(initial=0.0) * view.scale
        return float(reach) if reach > usual else 0.0
    along = ends[:, 1] - ends[:, 0]
    square = np.maximum((along * along).sum(axis=1), np.finfo(np.float64).tiny)
    share = np.clip(-(ends[:, 0] * along).sum(axis=1) / square, 0.0, 1.0)
    nearest = np.linalg.norm(ends[:, 0] + share[:, None] * along, axis=1)
    off_axis = 1.0 + (half * half).sum()
    # an edge through the eye is seen as a point
    apart = np.abs(ends).max(axis=(1, 2)) / np.maximum(nearest, np.finfo(np.float64).tiny)
    reach = float(np.where(nearest > 0.0, apart, 0.0).max(initial=0.0)) * view.scale * off_axis
    return reach if reach > usual else 0.0
