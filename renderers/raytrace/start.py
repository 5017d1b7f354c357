"""Where rays start: close before the scene, where the camera is far away and a float32 ray from there would miss.

A coordinate x is rounded by up to |x| 2^-24, so what a ray misses grows with the distance from its origin. Seen through
a telescope, or by parallel rays from far away, a scene is small beside that distance. Rays are then followed in float64
up to a depth at which nothing can be yet, and are handed over from there; coordinates are relative to that place.
Nothing changes for scenes that surround the camera.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from aliasbench.renderers.geometry import Body
from aliasbench.scenes.model import FloatArray, Scene
from aliasbench.scenes.projection import View, focus_at

_FAR = 0.75  # of the reach: where less is empty, two bits are not to be gained
_LAYERS = 2.0**-5  # of what is beyond: more than all layers together are brought nearer
_ROUNDING = 2.0**-40  # of the reach: more than float64 may misplace a sphere


@dataclass(frozen=True, slots=True, eq=False)
class Spheres:
    """Spheres about bodies: centres (b, 3) at time 0, their velocities (b, 3), and radii (b,), in world units."""

    centers: FloatArray
    velocities: FloatArray
    radii: FloatArray

    @classmethod
    def about(cls, bodies: Sequence[Body]) -> Self:
        """Return the spheres about bodies, however they spin; about those that matrices move, at both ends."""
        centers, velocities, radii = [np.zeros((0, 3))], [np.zeros((0, 3))], [np.zeros(0)]
        for body in bodies:
            motion, radius = body.motion, np.linalg.norm(body.vertices, axis=1).max(initial=0.0)
            if motion.matrices is not None:
                for matrix in (np.reshape(m, (4, 4)) for m in motion.matrices):
                    centers.append((matrix[:3, :3] @ body.origin + matrix[:3, 3])[None])
                    velocities.append(np.zeros((1, 3)))
                    radii.append(np.atleast_1d(radius * np.linalg.norm(matrix[:3, :3])))
                continue
            pivot = body.origin if motion.spin is None else np.asarray(motion.spin.center, dtype=np.float64)
            centers.append(pivot[None])
            velocities.append(np.asarray(motion.velocity, dtype=np.float64)[None])
            radii.append(np.atleast_1d(radius + np.linalg.norm(body.origin - pivot)))
        return cls(np.concatenate(centers), np.concatenate(velocities), np.concatenate(radii))


def find_start(
    spheres: Spheres, scene: Scene, views: tuple[View, View], frame: int, margin_px: float = 0.0
) -> tuple[float, float]:
    """Return the depth before which no ray of a frame meets anything, and which share of what rays reach lies beyond.

    Where rays may as well start at the camera these are 0 and 1. `views` are those at the shutter's opening and
    closing; bodies may be anywhere where they are in the frame's interval. Filters ask `margin_px` beyond the picture.
    """
    if not len(spheres.radii):
        return 0.0, 1.0
    first, last = views
    times = np.array([frame, frame + 1]) / scene.animation.fps
    # both ends of every path: what is between them is within the sphere about all
    paths = spheres.centers + times[:, None, None] * spheres.velocities
    low, high = (paths - spheres.radii[:, None]).min(axis=(0, 1)), (paths + spheres.radii[:, None]).max(axis=(0, 1))
    middle = (low + high) / 2
    radius = float((np.linalg.norm(paths - middle, axis=2) + spheres.radii).max())
    lens, focus = scene.camera.lens_radius, focus_at(scene.camera, scene.animation, frame, 0.0)
    slope = lens / focus if lens > 0.0 else 0.0
    if first.perspective:
        eye = first.origin
        travel = last.origin - eye
        square = float(travel @ travel)
        share = min(1.0, max(0.0, float((middle - eye) @ travel) / square)) if square > 0.0 else 0.0
        distance = float(np.linalg.norm(middle - eye - share * travel))
        # a ray's direction has depth 1, and is longest in the corners
        slope += (np.hypot(first.width, first.height) / 2 + margin_px) / first.scale
    elif np.array_equal(first.forward, last.forward):
        distance = min(float((middle - view.origin) @ view.forward) for view in (first, last))
    else:
        return 0.0, 1.0
    reach = distance + radius
    nearest = (distance - radius - lens) / float(np.hypot(1.0, slope))
    depth = nearest - _LAYERS * (reach - nearest) - _ROUNDING * reach
    if not (np.isfinite(reach) and depth > _FAR * reach):
        return 0.0, 1.0
    return depth, (reach - depth) / reach
