"""What misplacement is read off: a ladder of edges, and by how much number formats let an edge be misplaced.

A ladder is strips whose edges pass pixel centres at distances from half a pixel down to a millionth,
so that any misplacement turns samples over and its size is read off the ladder. Bounds follow from the formats, in
units of half an ulp, 2^-24 of the distance from a ray's origin to a corner. A ray tracer rounds the corner, the ray's
origin and its direction (3); an edge test takes a corner relative to the ray, and the edge, sum and difference of two
such (3), their cross product (2, terms are fused) and its product with the direction (3), and compares with a tolerance
of an ulp (1 more when that is kept by robust rays): together 12. Where the camera is far from a small scene, rays start
close before it, and that is the origin. A rasterizer snaps corners to 1/256 px, by half a step
each way.
"""

import math

import numpy as np

from aliasbench.bench.hard.case import RASTERS, Verdict, samples_key
from aliasbench.bench.hard.ownership import worst_misplacement
from aliasbench.bench.hard.sight import centres_of
from aliasbench.renderers.catalog import render
from aliasbench.scenes.model import Animation, Camera, Checker, Motion, Scene, Spin, Surface, Vec3, as_vec3
from aliasbench.scenes.shapes import polygon, quad

SIZE = (96, 64)
FAR: Vec3 = (1e6, -7e5, 4e5)
HERE: Vec3 = (0.0, 0.0, 0.0)
DISTANCE_PX = 100.0  # of the camera from the ladder, in the ladder's pixels
# A rotation by the quaternion 4 + i + 2j + 3k: no axis of the world is one of the picture's.
TURN = np.array([(4.0, -20.0, 22.0), (28.0, 10.0, 4.0), (-10.0, 20.0, 20.0)]) / 30.0
HALF_ULP = 2.0**-24
RAY_ROUNDINGS = 12.0
# The diagonal of the box about the scene is the diameter of a sphere about it; what moves is a little wider, and rays
# start up to 1/32 of the depth beyond before it.
_AROUND, _FAR = 1.125, 8.0
FLOAT64_ROUNDINGS = 8.0 * 2.0**-53  # of an origin, a direction, a product and a sum for each of both
SNAPPED_PX = math.sqrt(2.0) / 512.0  # half of 1/256 px, right and down
FRAME, _FPS, _SHUTTER = 7, 30.0, 0.5
MIDDLE_S = (FRAME + _SHUTTER / 2) / _FPS


INSTANT = "reference:time=center"


def ladder(
    at: Vec3 = HERE, unit: float = 1.0, *, motion: Motion | None = None, color: Vec3 | None = None
) -> list[Surface]:
    """Return strips whose edges, and texel borders, pass pixel centres ever closer; a pixel is `unit` wide."""

    def place(points: list[tuple[float, float]]) -> np.ndarray:
        return np.asarray(at) + unit * np.array([(x, y, 0.0) for x, y in points]) @ TURN.T

    out = []
    for rung in range(10):
        lean, x, y = 0.5 * 4.0**-rung, 3.0 * rung - 45.5, 5.0 * rung - 27.5
        upright = [(x - lean, -28.0), (x + 1.25, -28.0), (x + 1.25, 28.0), (x + lean, 28.0)]
        level = [(-12.0, y - lean), (14.0, y + lean), (14.0, y + 2.0), (-12.0, y + 2.0)]
        out.append(polygon(place(upright), color=color or ((1.0, 0.5, 0.0), (0.0, 1.0, 0.5))[rung % 2], motion=motion))
        out.append(polygon(place(level), color=color or (0.0, 0.5, 1.0), motion=motion))
    for rung in range(8):
        lean, x = 0.5 * 4.0**-rung, 4.0 * rung + 16.5
        corners = [(x - 1.75, -28.0), (x + 1.75, -28.0), (x + 1.75, 28.0), (x - 1.75, 28.0)]
        # the border of two squares, at u = 1, leans as the other edges do
        uv = [(1.0 + (a - x - lean * b / 28.0) / 3.0, 0.5) for a, b in corners]
        out.append(quad(place(corners), uv=uv, texture="squares", motion=motion))
    return out


SQUARES = Checker((1.0, 1.0), (0.2, 0.2, 0.2), (0.8, 0.8, 0.8))


def camera_for(
    projection: str, at: Vec3, unit: float, *, distance_px: float = DISTANCE_PX, velocity: Vec3 = HERE
) -> Camera:
    """Return a camera that sees the ladder's plane with pixels of `unit`, from so many of them away."""
    position, up = as_vec3(np.asarray(at) + distance_px * unit * TURN[:, 2]), as_vec3(TURN[:, 1])
    if projection == "orthographic":
        return Camera("orthographic", position, at, up, height=SIZE[1] * unit, velocity=velocity)
    fov = 2.0 * math.degrees(math.atan(SIZE[1] / 2.0 / distance_px))
    return Camera("perspective", position, at, up, fov_y_deg=fov, velocity=velocity)


def ladder_scene(
    projection: str, *, at: Vec3 = HERE, unit: float = 1.0, moving: bool = False, distance_px: float = DISTANCE_PX
) -> Scene:
    """Return the ladder before a camera; moving, it has made whole turns and whole pixels when frame 7's shutter is
    half closed, and so has the camera.
    """
    textures = {"squares": SQUARES}
    if not moving:
        camera = camera_for(projection, at, unit, distance_px=distance_px)
        return Scene("ladder", camera, tuple(ladder(at, unit)), textures)
    step = unit / MIDDLE_S
    velocities = [as_vec3(step * TURN @ v) for v in ((5.0, -4.0, 0.0), (3.0, -3.0, 0.0))]
    motion = Motion(velocities[0], Spin(as_vec3(TURN[:, 2]), at, 3.0 / MIDDLE_S))
    camera = camera_for(projection, at, unit, distance_px=distance_px, velocity=velocities[1])
    animation = Animation(_FPS, 20, _SHUTTER)
    return Scene("ladder", camera, tuple(ladder(at, unit, motion=motion)), textures, animation=animation)


def ray_bound_px(scene: Scene, unit: float) -> float:
    """Return by how many pixels of `unit` float32 may move an edge under rays: see the module's text."""
    eye = np.asarray(scene.camera.position)
    corners = np.concatenate([s.vertices for s in scene.objects])
    reach = float(np.linalg.norm(corners - eye, axis=1).max())
    across = float(np.linalg.norm(np.ptp(corners, axis=0))) * _AROUND
    if reach < _FAR * across:
        return RAY_ROUNDINGS * HALF_ULP * reach / unit
    # rays start close before the sphere about the scene, to where float64 has followed them
    return (RAY_ROUNDINGS * HALF_ULP * across + FLOAT64_ROUNDINGS * reach) / unit


def misplacement(subject: str, scene: Scene, frame: int = 0) -> float:
    """Return how far from a border a sample at a pixel's centre still is wrong, in pixels."""
    fraction = scene.animation.shutter / 2
    truth = centres_of(scene, SIZE, frame, fraction)
    return worst_misplacement(render(scene, samples_key(subject, 1), size=SIZE, frame=frame).pixels, truth)


def placed(found: dict[str, float], bound: float, why: str) -> Verdict:
    worst = max(found, key=lambda name: found[name])
    return Verdict(found[worst], "px", 0.0, bound, why, note=f"worst: {worst}; " + listed(found))


def listed(found: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.1e}" for name, value in found.items())


def bound_of(subject: str, scene: Scene, unit: float) -> tuple[float, str]:
    """Return what a subject may misplace in a scene at most, in px, and why."""
    if subject in RASTERS:
        return SNAPPED_PX, "8 subpixel bits: corners snap to 1/256 px, by half a step right and down"
    return ray_bound_px(scene, unit), "float32 rays: 12 roundings of 2^-24 of the distance from camera to corner"
