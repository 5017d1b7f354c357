"""Where the vertices of a scene are at a time, and how fast they can move: the facts behind a certified time integral.

Speeds are bounds over a whole frame interval, relative to the camera, so that a time slice's error can be bounded from
its middle alone. They hold exactly: a turning point's speed is constant, a sliding point's and an interpolated matrix's
too; a camera that turns towards its target adds its angular speed times the distance.
"""

from dataclasses import dataclass

import numpy as np

from aliasbench.scenes.model import Animation, Camera, FloatArray, Motion, Scene
from aliasbench.scenes.motion import object_matrix


@dataclass(frozen=True, slots=True)
class Paths:
    """The motions of a scene's objects and camera.

    `interpolated`: every motion is replaced by the linear interpolation of its matrices at the begin and the end of the
    frame interval.
    """

    motions: tuple[Motion, ...]
    animation: Animation
    camera: Camera
    interpolated: bool = False

    def matrix(self, motion: Motion, frame: int, fraction: float) -> FloatArray:
        """Return the (4, 4) matrix of an object at a time."""
        if not self.interpolated:
            return object_matrix(motion, self.animation, frame, fraction)
        begin = object_matrix(motion, self.animation, frame, 0.0)
        end = object_matrix(motion, self.animation, frame, 1.0)
        return (1.0 - fraction) * begin + fraction * end

    def positions(self, vertices: FloatArray, ranges: tuple[slice, ...], frame: int, fraction: float) -> FloatArray:
        """Return world positions (n, 3) of rest positions (n, 3); `ranges` are the objects' rows."""
        out = vertices.copy()
        matrices: dict[Motion, FloatArray] = {}
        for motion, rows in zip(self.motions, ranges, strict=True):
            if motion.is_static:
                continue
            if motion not in matrices:
                matrices[motion] = self.matrix(motion, frame, fraction)
            m = matrices[motion]
            x, y, z = vertices[rows].T
            for k in range(3):
                out[rows, k] = x * m[k, 0] + y * m[k, 1] + z * m[k, 2] + m[k, 3]
        return out

    def speeds(self, vertices: FloatArray, ranges: tuple[slice, ...], camera: FloatArray, frame: int) -> FloatArray:
        """Return bounds (n,) on the speed relative to the camera's axes, in world units per frame interval.

        Parameters
        ----------
        vertices : (n, 3)
            Rest positions.
        ranges
            The objects' rows.
        camera : (n, 3)
            Present positions in camera space.
        frame : int
        """
        fps = self.animation.fps
        eye = np.asarray(self.camera.velocity) / fps
        out = np.full(len(vertices), float(np.linalg.norm(eye)))
        for motion, rows in zip(self.motions, ranges, strict=True):
            if motion.is_static:
                continue
            points = vertices[rows]
            if self.interpolated or motion.matrices is not None:
                change = self.matrix(motion, frame, 1.0) - self.matrix(motion, frame, 0.0)
                out[rows] = np.linalg.norm(points @ change[:3, :3].T + change[:3, 3] - eye, axis=1)
                continue
            out[rows] = float(np.linalg.norm(np.asarray(motion.velocity) / fps - eye))
            if motion.spin is not None:
                axis = np.asarray(motion.spin.axis) / np.linalg.norm(motion.spin.axis)
                radius = np.linalg.norm(np.cross(points - np.asarray(motion.spin.center), axis), axis=1)
                out[rows] += 2 * np.pi * abs(motion.spin.rev_per_s) / fps * radius
        turning = self.camera_turn(frame)
        if turning > 0.0:
            out += turning * 1.1 * (np.linalg.norm(camera, axis=1) + out)
        return out

    def camera_turn(self, frame: int) -> float:
        """Return a bound on the camera's angular speed over a frame interval, in radians per frame interval."""
        target_velocity = self.camera.target_velocity
        if target_velocity is None:
            return 0.0
        drift = (np.asarray(target_velocity) - np.asarray(self.camera.velocity)) / self.animation.fps
        speed = float(np.linalg.norm(drift))
        if speed == 0.0:
            return 0.0
        axis = np.asarray(self.camera.target) - np.asarray(self.camera.position) + drift * frame
        up = np.asarray(self.camera.up) / np.linalg.norm(self.camera.up)
        # forward turns at most at drift / distance, right (axis x up, normalised) at |drift x up| / |axis x up|
        forward = speed / max(_least_length(axis, drift), 1e-300)
        side = np.cross(drift, up)
        right = float(np.linalg.norm(side)) / max(_least_length(np.cross(axis, up), side), 1e-300)
        return forward + right


def scene_paths(scene: Scene, *, interpolated: bool = False) -> Paths:
    """Return the paths of a scene."""
    return Paths(tuple(o.motion for o in scene.objects), scene.animation, scene.camera, interpolated)


def _least_length(start: FloatArray, step: FloatArray) -> float:
    """Return the least length of start + s step over s in [0, 1]."""
    squared = float(step @ step)
    s = min(1.0, max(0.0, -float(start @ step) / squared)) if squared > 0.0 else 0.0
    return float(np.linalg.norm(start + s * step))
