"""A camera for a model that brings none: the whole of it in view, from the front, a little from the right and above.

Perspective, because models are looked at like things. The distance is not guessed from a bounding sphere, which leaves
a long model small: for every point p, in axes of the view and relative to the point looked at, depth d of the eye must
fulfil |x| / k <= d - z and |y| / k <= d - z, with k the tangent of half the angle less a margin; so d is the largest of
|x| / k + z and |y| / k + z. Width and height count alike, so pictures that are at least as wide as high show it all.
"""

import math
from collections.abc import Sequence

import numpy as np

from aliasbench.scenes.limits import MIN_LENGTH
from aliasbench.scenes.model import Animation, Camera, FloatArray, Surface, Vec3
from aliasbench.scenes.motion import object_matrix

FOV_Y_DEG = 35.0
AZIMUTH_DEG, ELEVATION_DEG = 30.0, 20.0  # from +z towards +x, and up
_MARGIN = 0.9  # of the picture's half height
_MOST_SWEPT = 10_000  # vertices
_MOMENTS = 16  # at which a moving surface is looked at


def frame_surfaces(surfaces: Sequence[Surface], animation: Animation) -> Camera:
    """Return a camera that has all surfaces in view, over the whole animation where they move."""
    points = np.concatenate([_swept(surface, animation) for surface in surfaces])
    low, high = points.min(axis=0), points.max(axis=0)
    center = (low + high) / 2
    azimuth, elevation = math.radians(AZIMUTH_DEG), math.radians(ELEVATION_DEG)
    back = np.array(
        [math.sin(azimuth) * math.cos(elevation), math.sin(elevation), math.cos(azimuth) * math.cos(elevation)]
    )
    right = np.array([math.cos(azimuth), 0.0, -math.sin(azimuth)])
    axes = np.stack([right, np.cross(back, right), back])
    k = _MARGIN * math.tan(math.radians(FOV_Y_DEG) / 2)
    x, y, z = np.ascontiguousarray((points - center) @ axes.T).T.copy()
    size = max(float(np.abs(a).max()) for a in (x, y, z))
    distance = _distance(x, y, z, k, size)
    for _ in range(4):
        # Perspective shows near parts larger: look at the middle of the picture of the model, not of its box.
        depth = distance - z
        middle = np.array([_middle(x / depth), _middle(y / depth)]) * distance
        center = center + middle @ axes[:2]
        x -= middle[0]
        y -= middle[1]
        distance = _distance(x, y, z, k, size)
    return Camera(
        projection="perspective",
        position=_vec3(center + distance * back),
        target=_vec3(center),
        up=(0.0, 1.0, 0.0),
        fov_y_deg=FOV_Y_DEG,
    )


def _middle(values: FloatArray) -> float:
    return float(values.min() + values.max()) / 2


def _distance(x: FloatArray, y: FloatArray, z: FloatArray, k: float, size: float) -> float:
    """Return the least distance from which all points are in view, and in front of the eye by a share of their size."""
    reach = max(float((np.abs(a) / k + z).max()) for a in (x, y))
    return max(reach, float(z.max()) + 0.01 * size, MIN_LENGTH)


def _swept(surface: Surface, animation: Animation) -> FloatArray:
    """Return points (n, 3) that a surface's points at all times of the animation lie among, or nearly."""
    points = surface.vertices
    if surface.motion.is_static:
        return points
    if len(points) > _MOST_SWEPT:
        # Of a large model that moves its box: at every moment all its points would be more than the model.
        low, high = points.min(axis=0), points.max(axis=0)
        points = np.array([[(low, high)[(k >> axis) & 1][axis] for axis in range(3)] for k in range(8)])
    moments = np.linspace(0.0, float(animation.frames), _MOMENTS, endpoint=True)
    swept = []
    for moment in moments.tolist():
        matrix = object_matrix(surface.motion, animation, 0, moment)
        swept.append(points @ matrix[:3, :3].T + matrix[:3, 3])
    return np.concatenate(swept)


def _vec3(values: FloatArray) -> Vec3:
    x, y, z = (values + 0.0).tolist()
    return (x, y, z)
