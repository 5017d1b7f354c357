"""Rotors seen by the camera: the angle of every pixel about the hub, and the weights of a smooth annulus.

Angles and radii are taken in the rotor's own plane, by casting a ray through each pixel's centre, so that oblique and
perspective views need no other code, and angles and the declared rate always turn the same way about the axis. The
annulus fades as sin^4 towards both rims, which keeps sums over the pixel lattice within 2e-9 of the integrals they
stand for.
"""

from dataclasses import dataclass

import numpy as np

from aliasbench.metrics.gate import Signals
from aliasbench.scenes.model import FloatArray, RotorFact, Scene, Surface
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import View, view_at

RING_POINTS = 64
NARROWEST_PX = 8.0
FACING = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Annulus:
    """The pixels of a rotor's annulus in one frame.

    Attributes
    ----------
    index : (n,) int
        Into the flattened, cropped picture.
    angle : (n,) float64
        About the axis, right-handed, from an arbitrary but fixed direction, in radians.
    weight : (n,) float64
        Sums to 1.
    inner_px, outer_px : float
        Radii on the image; of an ellipse the least.
    """

    index: np.ndarray[tuple[int], np.dtype[np.int64]]
    angle: FloatArray
    weight: FloatArray
    inner_px: float
    outer_px: float


def plane_axes(axis: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors that are right-handed with the axis; (x, y) for +z."""
    helper = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    first = helper - axis * float(helper @ axis)
    first = first / np.linalg.norm(first)
    return first, np.cross(axis, first)


def carrier_of(rotor: RotorFact, scene: Scene) -> Surface | None:
    """Return the object that spins about the rotor's centre, with which it moves; None for a rotor that stays."""
    for surface in scene.objects:
        spin = surface.motion.spin
        if spin is not None and np.allclose(spin.center, rotor.center, rtol=0.0, atol=1e-9 * rotor.outer):
            return surface
    return None


def stays(rotor: RotorFact, scene: Scene) -> bool:
    """Return whether the rotor's centre is at the same place of the picture in all frames."""
    carrier = carrier_of(rotor, scene)
    return scene.camera.is_static and (carrier is None or carrier.motion.velocity == (0.0, 0.0, 0.0))


def hub_at(rotor: RotorFact, signals: Signals, frame: int, fraction: float) -> FloatArray:
    """Return the rotor's centre (3,) at a time: it moves with the object that spins about it."""
    center = np.asarray(rotor.center, dtype=np.float64)
    carrier = carrier_of(rotor, signals.scene)
    if carrier is None:
        return center
    matrix = object_matrix(carrier.motion, signals.scene.animation, frame, fraction)
    return matrix[:3, :3] @ center + matrix[:3, 3]


def annulus_at(rotor: RotorFact, signals: Signals, frame: int) -> Annulus | str:
    """Return the rotor's annulus in a frame (the scene's number) at the shutter's middle, or the status why not.

    `not_applicable` for a rotor seen edge-on or behind the camera, `undefined_too_small` for an annulus
    narrower than 8 pixels, `annulus_leaves_window` if the outer rim is not all in the picture.
    """
    scene = signals.scene
    fraction = scene.animation.shutter / 2
    view = view_at(scene.camera, scene.animation, frame, fraction, signals.size)
    normal = np.asarray(rotor.axis, dtype=np.float64)
    normal = normal / np.linalg.norm(normal)
    hub = hub_at(rotor, signals, frame, fraction)
    first, second = plane_axes(normal)
    turn = 2 * np.pi * np.arange(RING_POINTS) / RING_POINTS
    ring = np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * second
    sight = hub - view.origin if view.perspective else view.forward
    rims = np.stack([hub + ring * rotor.inner, hub + ring * rotor.outer])
    if abs(float(normal @ sight)) <= FACING * np.linalg.norm(sight) or np.any(
        view.perspective & (view.to_camera(rims)[..., 2] <= 0.0)
    ):
        return "not_applicable"
    projected = view.project(rims)[..., :2]
    middle = view.project(hub)[:2]
    inner_px, outer_px = np.min(np.linalg.norm(projected - middle, axis=-1), axis=1)
    if outer_px - inner_px < NARROWEST_PX:
        return "undefined_too_small"
    width, height = signals.size
    low, high = signals.crop, np.array([width, height]) - signals.crop
    if np.any(projected[1] < low) or np.any(projected[1] > high):
        return "annulus_leaves_window"
    return _collect(rotor, view, hub, normal, projected[1], signals, (float(inner_px), float(outer_px)))


def _collect(
    rotor: RotorFact,
    view: View,
    hub: FloatArray,
    normal: FloatArray,
    rim: FloatArray,
    signals: Signals,
    radii_px: tuple[float, float],
) -> Annulus:
    """Return the annulus, looking only at the pixels of the rim's bounding box."""
    crop = signals.crop
    x0, y0 = np.floor(np.min(rim, axis=0)).astype(int) - crop
    x1, y1 = np.ceil(np.max(rim, axis=0)).astype(int) - crop
    height, width = signals.error.shape[-2:]
    rows, columns = np.mgrid[max(y0, 0) : min(y1 + 1, height), max(x0, 0) : min(x1 + 1, width)]
    origin, direction = view.ray(columns + crop + 0.5, rows + crop + 0.5)
    distance = ((hub - origin) @ normal) / (direction @ normal)
    offset = origin + distance[..., None] * direction - hub
    first, second = plane_axes(normal)
    u, v = offset @ first, offset @ second
    share = (np.hypot(u, v) - rotor.inner) / (rotor.outer - rotor.inner)
    inside = (share > 0.0) & (share < 1.0)
    # A pixel covers an area of the plane that grows with the cube of its depth under perspective.
    area = distance**3 if view.perspective else np.ones(distance.shape)
    weight = np.where(inside, np.sin(np.pi * share) ** 4 * area, 0.0)[inside]
    index = (rows * width + columns)[inside]
    return Annulus(index, np.arctan2(v, u)[inside], weight / np.sum(weight), *radii_px)
