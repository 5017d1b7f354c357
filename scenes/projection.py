"""The camera, once for both renderers, the references and the metrics, in float64.

Image coordinates: x to the right and y down, in pixels, (0, 0) the top left corner of the picture, pixel (i, j) covers
[j, j + 1) x [i, i + 1); the camera's axis meets the picture at (width / 2, height / 2).

A thin lens adds nothing but a family of such views. Of a lens focused at F, the ray through its point (a, b) that meets
the pinhole's ray in the plane at depth F is at depth Z off that ray by (a, b) (1 - Z / F), with a pinhole and with
parallel rays alike. A world point at (X, Y, Z) is therefore seen from there where the pinhole sees
(X - a (1 - Z / F), Y - b (1 - Z / F), Z): camera coordinates being scalar products with the axes, that is the view from
origin + a right + b up whose axes are right + (a / F) forward and up + (b / F) forward (`lens_view`).
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Animation, Camera, FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A camera at one instant and one picture size.

    Attributes
    ----------
    origin : (3,) float64
        The camera's position in the world.
    right, up, forward : (3,) float64
        Axes: camera coordinates are the scalar products with them; `up` is up in the picture. Orthonormal, but for
        `shear` times forward in right and up.
    perspective : bool
    scale : float
        Orthographic: pixels per world unit. Perspective: pixels at distance 1 along the axis (the focal length).
    width, height : int
        Picture size in pixels.
    shear : (float, float)
        What right and up have of forward: (0, 0) but off the centre of a lens.
    """

    origin: FloatArray
    right: FloatArray
    up: FloatArray
    forward: FloatArray
    perspective: bool
    scale: float
    width: int
    height: int
    shear: tuple[float, float] = (0.0, 0.0)

    def to_camera(self, points: FloatArray) -> FloatArray:
        """Return (..., 3) coordinates along right, up and forward of world points (..., 3)."""
        axes = np.stack([self.right, self.up, self.forward], axis=-1)
        out: FloatArray = (np.asarray(points, dtype=np.float64) - self.origin) @ axes
        return out

    def project(self, points: FloatArray) -> FloatArray:
        """Return (..., 3): x and y in pixels (y down) and the depth along the axis, of world points (..., 3).

        Under perspective a point at depth <= 0 has no image; clip first.
        """
        local = self.to_camera(points)
        scale = self.scale / local[..., 2] if self.perspective else np.full(local.shape[:-1], self.scale)
        return np.stack(
            [self.width / 2 + local[..., 0] * scale, self.height / 2 - local[..., 1] * scale, local[..., 2]], axis=-1
        )

    def ray(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return origins and directions (..., 3) in the world through image points; a direction's depth is 1."""
        a = (np.asarray(x, dtype=np.float64)[..., None] - self.width / 2) / self.scale
        b = (self.height / 2 - np.asarray(y, dtype=np.float64)[..., None]) / self.scale
        # the axes' dual vectors: each has a scalar product of 1 with its own axis and 0 with the others
        right, up = (axis - s * self.forward for axis, s in zip((self.right, self.up), self.shear, strict=True))
        forward = self.forward - self.shear[0] * right - self.shear[1] * up
        plane = a * right + b * up
        if self.perspective:
            return np.broadcast_to(self.origin, plane.shape), plane + forward
        return self.origin + plane, np.broadcast_to(forward, plane.shape)


def view_at(camera: Camera, animation: Animation, frame: int, fraction: float, size: tuple[int, int]) -> View:
    """Return the camera's view at a time (see `motion`) for a picture of `size` = (width, height) pixels.

    Raises
    ------
    InputError
        If the camera is degenerate at that time: position equals target, or `up` is along the axis.
    """
    width, height = size
    t = (frame + fraction) / animation.fps
    velocity = np.asarray(camera.velocity, dtype=np.float64)
    target_velocity = velocity if camera.target_velocity is None else np.asarray(camera.target_velocity)
    origin = np.asarray(camera.position, dtype=np.float64) + velocity * t
    axis = np.asarray(camera.target, dtype=np.float64) - np.asarray(camera.position) + (target_velocity - velocity) * t
    length = math.sqrt(axis.dot(axis))
    if not length > 0.0:
        raise InputError(f"camera: position equals target at t = {t:g} s; they must differ")
    forward = axis / length
    hint = np.asarray(camera.up, dtype=np.float64)
    right = _cross(forward, hint)
    norm = math.sqrt(right.dot(right))
    if not norm > 1e-12 * math.sqrt(hint.dot(hint)):
        raise InputError(f"camera: up {list(camera.up)} is along the viewing axis; it must not be")
    right = right / norm
    up = _cross(right, forward)
    if camera.projection == "orthographic":
        if camera.height is None:
            raise InputError("camera: an orthographic camera needs height (world units from bottom to top)")
        scale = height / camera.height
    else:
        if camera.fov_y_deg is None:
            raise InputError("camera: a perspective camera needs fov_y_deg (degrees from bottom to top)")
        scale = height / 2 / np.tan(np.radians(camera.fov_y_deg) / 2)
    return View(origin, right, up, forward, camera.projection == "perspective", float(scale), width, height)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the vector product of two vectors (3,): numpy's, bit for bit, in a tenth of its time.

    Every accumulation pass asks for a view, which took longer than drawing small pictures.
    """
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def focus_at(camera: Camera, animation: Animation, frame: int, fraction: float) -> float:
    """Return the distance along the axis of the plane in focus at a time: the target's where none is given."""
    if camera.focus_distance is not None:
        return camera.focus_distance
    velocity = np.asarray(camera.velocity, dtype=np.float64)
    drift = np.zeros(3) if camera.target_velocity is None else np.asarray(camera.target_velocity) - velocity
    axis = np.asarray(camera.target, dtype=np.float64) - np.asarray(camera.position)
    return float(np.linalg.norm(axis + drift * ((frame + fraction) / animation.fps)))


def lens_view(view: View, a: float, b: float, focus: float) -> View:
    """Return what a camera sees through one point of its lens.

    Parameters
    ----------
    view : View
        Through the centre of the lens.
    a, b : float
        The point on the lens, in world units along right and up.
    focus : float
        Distance along the axis of the plane in focus, above 0: its points do not move in the picture.
    """
    return replace(
        view,
        origin=view.origin + a * view.right + b * view.up,
        right=view.right + a / focus * view.forward,
        up=view.up + b / focus * view.forward,
        shear=(a / focus, b / focus),
    )
