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
from numpy.typing import NDArray

from aliasbench.renderers.geometry import Body
from aliasbench.scenes.model import FloatArray, Scene
from aliasbench.scenes.projection import View, focus_at

_FAR = 0.75  # of what rays reach at least: where less is empty, two bits are not to be gained
MOST_NEARER = 2.0**-5  # of what is beyond the start: layers are brought nearer by no more
_ROOM = 2.0**-4  # of the same: how far before what it is for it lies
_ROUNDING = 2.0**-40  # of the reach: more than float64 may misplace a sphere


@dataclass(frozen=True, slots=True, eq=False)
class Spheres:
    """Spheres about the objects of bodies: centres (n, 3) at time 0, velocities (n, 3), radii (n,), which have a layer
    (n,), and of which body they are (n,).
    """

    centers: FloatArray
    velocities: FloatArray
    radii: FloatArray
    layered: NDArray[np.bool_]
    bodies: NDArray[np.int64]

    @classmethod
    def about(cls, bodies: Sequence[Body]) -> Self:
        """Return the spheres about bodies, however they spin; about those that matrices move, at both ends."""
        centers, velocities, radii, numbers = [np.zeros((0, 3))], [np.zeros((0, 3))], [np.zeros(0)], [np.zeros(0, int)]
        for number, body in enumerate(bodies):
            if not len(body.triangles):
                continue
            motion, corners = body.motion, body.vertices[body.triangles] + body.origin
            firsts = np.flatnonzero(np.diff(body.surfaces, prepend=-1))
            counts = np.diff(firsts, append=len(corners))
            if motion.spin is not None:
                middle = np.repeat(np.array(motion.spin.center, dtype=np.float64)[None], len(firsts), axis=0)
            else:
                low, high = (f.reduceat(corners, firsts) for f in (np.minimum, np.maximum))
                middle = (low.min(axis=1) + high.max(axis=1)) / 2
            apart = np.linalg.norm(corners - np.repeat(middle, counts, axis=0)[:, None], axis=2).max(axis=1)
            radius = np.maximum.reduceat(apart, firsts)
            for matrix in (np.reshape(m, (4, 4)) for m in motion.matrices or (np.eye(4),)):
                moved = np.asarray(matrix[:3, :3], dtype=np.float64)
                centers.append(middle @ moved.T + matrix[:3, 3])
                velocities.append(np.broadcast_to(np.asarray(motion.velocity, dtype=np.float64), middle.shape))
                # Frobenius: no direction is stretched by more
                radii.append(radius * (np.linalg.norm(moved) if motion.matrices else 1.0))
                numbers.append(np.full(len(firsts), number))
        owners = np.concatenate(numbers).astype(np.int64)
        layered = np.array([body.layer > 0 for body in bodies], dtype=np.bool_)[owners]
        return cls(np.concatenate(centers), np.concatenate(velocities), np.concatenate(radii), layered, owners)


def find_start(
    spheres: Spheres,
    scene: Scene,
    views: tuple[View, View],
    span: tuple[float, float],
    margin_px: float = 0.0,
) -> tuple[float, float]:
    """Return the depth before which no ray of an exposure meets anything, and which share of its reach lies beyond.

    Where rays may as well start at the camera these are 0 and 1. The share is the largest of all that has layers.

    Parameters
    ----------
    spheres : Spheres
    scene : Scene
    views : tuple of View
        At the shutter's opening and closing.
    span : tuple of float
        When that is, in seconds.
    margin_px : float
        How far beyond the picture filters ask.
    """
    ends = [spheres.centers + t * spheres.velocities - view.origin for t, view in zip(span, views, strict=True)]
    lens, focus = scene.camera.lens_radius, focus_at(scene.camera, scene.animation, 0, span[0] * scene.animation.fps)
    slope = lens / focus if lens > 0.0 else 0.0
    # both are straight lines in time, and so is what is between them, as seen from the camera
    depths = np.array([end @ view.forward for end in ends for view in views])
    seen = depths.max(axis=0, initial=-np.inf) + spheres.radii + lens > 0.0
    if not seen.any():
        return 0.0, 1.0
    if views[0].perspective:
        travel = ends[1] - ends[0]
        square = (travel * travel).sum(axis=1)
        share = np.divide(-(ends[0] * travel).sum(axis=1), square, out=np.zeros_like(square), where=square > 0.0)
        distances = np.linalg.norm(ends[0] + np.clip(share, 0.0, 1.0)[:, None] * travel, axis=1)
        farthest = np.maximum(*(np.linalg.norm(end, axis=1) for end in ends)) + spheres.radii
        # a ray's direction has depth 1, and is longest in the corners
        slope += (np.hypot(views[0].width, views[0].height) / 2 + margin_px) / views[0].scale
    elif np.array_equal(views[0].forward, views[1].forward):
        distances, farthest = depths.min(axis=0), depths.max(axis=0) + spheres.radii
    else:
        return 0.0, 1.0
    nearest = (distances - spheres.radii - lens) / float(np.hypot(1.0, slope))
    room = _ROOM * (farthest - nearest) + _ROUNDING * farthest
    depth = float((nearest - room)[seen].min())
    if not (np.isfinite(depth) and depth > _FAR * float(farthest[seen].min())):
        return 0.0, 1.0
    layered = farthest[seen & spheres.layered]
    return depth, float(((layered - depth) / layered).max()) if len(layered) else 1.0
