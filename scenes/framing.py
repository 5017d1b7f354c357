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
from aliasbench.scenes.model import Animation, Camera, FloatArray, Surface, as_vec3
from aliasbench.scenes.motion import object_matrix

FOV_Y_DEG = 35.0
AZIMUTH_DEG, ELEVATION_DEG = 30.0, 20.0  # from +z towards +x, and up
_MARGIN = 0.9  # of the picture's half height
_MOST_SWEPT = 10_000  # vertices
_MOMENTS = 16  # at which a moving surface is looked at
_CHUNK = 2**15  # points: what is computed of them stays in the cache


def frame_surfaces(surfaces: Sequence[Surface], animation: Animation) -> Camera:
    """Return a camera that has all surfaces in view, over the whole animation where they move."""
    swept = [_swept(surface, animation) for surface in surfaces]
    points = swept[0] if len(swept) == 1 else np.concatenate(swept)
    low, high = points.min(axis=0), points.max(axis=0)
    center = (low + high) / 2
    azimuth, elevation = math.radians(AZIMUTH_DEG), math.radians(ELEVATION_DEG)
    back = np.array(
        [math.sin(azimuth) * math.cos(elevation), math.sin(elevation), math.cos(azimuth) * math.cos(elevation)]
    )
    right = np.array([math.cos(azimuth), 0.0, -math.sin(azimuth)])
    axes = np.stack([right, np.cross(back, right), back])
    k = _MARGIN * math.tan(math.radians(FOV_Y_DEG) / 2)
    seen = np.empty((3, len(points)))
    chunks = [slice(start, start + _CHUNK) for start in range(0, len(points), _CHUNK)]
    for chunk in chunks:
        seen[:, chunk] = axes @ (points[chunk] - center).T
    size = float(max(seen.max(), -seen.min()))
    nearest = float(seen[2].max()) + 0.01 * size
    # Of both sides of the picture, left and right, bottom and top: a shift of the view adds to one what it takes away
    # from the other, so that the points are not looked at again.
    reach = np.array(
        [[max(float((s * seen[a, c] / k + seen[2, c]).max()) for c in chunks) for a in (0, 1)] for s in (-1, 1)]
    )
    shift = np.zeros(2)
    distance = max(float(reach.max()), nearest, MIN_LENGTH)
    for _ in range(4):
        # Perspective shows near parts larger: look at the middle of the picture of the model, not of its box.
        low, high = np.full(2, np.inf), np.full(2, -np.inf)
        for chunk in chunks:
            picture = (seen[:2, chunk] - shift[:, None]) / (distance - seen[2, chunk])
            low, high = np.minimum(low, picture.min(axis=1)), np.maximum(high, picture.max(axis=1))
        shift = shift + (low + high) / 2 * distance
        distance = max(float((reach + np.array([[1.0], [-1.0]]) * shift / k).max()), nearest, MIN_LENGTH)
    center = center + shift @ axes[:2]
    return Camera(
        projection="perspective",
        position=as_vec3(center + distance * back),
        target=as_vec3(center),
        up=(0.0, 1.0, 0.0),
        fov_y_deg=FOV_Y_DEG,
    )


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
