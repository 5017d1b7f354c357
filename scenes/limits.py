"""How large and how small the numbers of a scene file may be: within these limits every picture is finite.

Pictures and both engines are float32 (finite to 3e38), cameras and references float64. Each limit keeps the products
that are formed of its values in range; all are far from what anybody draws. That each number is in range by itself does
not suffice: `reach_fault` bounds where things get to in the course of the animation.
"""

import math

import numpy as np

from aliasbench.scenes.model import Animation, Camera, Motion, Surface

# Coordinates, velocities and lengths: squares of differences stay within float32. The least length is its inverse.
LENGTH = 1e12
MIN_LENGTH = 1e-12
# Colours and radiances: of these two are multiplied (colour by texture), and thousands of samples are summed.
RADIANCE = 1e15
# Frequencies, texture coordinates, phases, turns: the product of two is still a whole number in int64.
COUNT = 1e9
MIN_FPS = 1e-6
MAX_NAME = 200  # characters of a scene's or an object's name: it is shown in tables and stands in records
MAX_CATALOG_NAME = 500  # of one that says with which parameters the catalog builds the scene
MAX_FILE_BYTES = 128 * 2**20  # of a scene file; a mesh of a million triangles is 32 MB in one
MIN_FOV_DEG = 1e-6  # 17 mm of picture a thousand kilometres away
# Distance from the origin over the picture's height: beyond, rounding in float64 alone moves a point by a pixel of a
# picture 1000 high. A picture of a millionth of a unit, a million units away, is well within.
RESOLVED = 1e13


def name_of_stem(stem: str) -> str:
    """Return a scene's name from its file's, which may be anything."""
    return "".join(c if c.isprintable() else "?" for c in stem)[:MAX_NAME]


def end_of(animation: Animation) -> float:
    """Return the time in seconds at which the last frame's shutter closes."""
    return (animation.frames - 1 + animation.shutter) / animation.fps


def farthest(camera: Camera) -> float:
    """Return how far from the origin, in world units, things may get under this camera and still be drawn right."""
    height = camera.height
    if height is None:
        distance = math.dist(camera.position, camera.target)
        height = 2 * distance * math.tan(math.radians(camera.fov_y_deg or 0.0) / 2)
    return min(LENGTH, RESOLVED * height)


def camera_fault(camera: Camera, animation: Animation) -> tuple[str, str] | None:
    """Return the key at fault and what it must be where the camera gets too far away, or None. See `reach_fault`."""
    bound, end = farthest(camera), end_of(animation)
    moving = camera.velocity if camera.target_velocity is None else camera.target_velocity
    for key, place, rate, velocity in (
        ("position", camera.position, "velocity", camera.velocity),
        ("target", camera.target, "target_velocity" if camera.target_velocity else "velocity", moving),
    ):
        if _largest(place) > bound:
            return key, _within(bound)
        if _largest(place) + _largest(velocity) * end > bound:
            return rate, _within(bound, end)
    return None


def reach_fault(surface: Surface, camera: Camera, animation: Animation) -> tuple[str, str] | None:
    """Return the key at fault and what it must be where an object gets too far away or turns too often, or None.

    Returns
    -------
    tuple of str and str, or None
        ``shape`` (the object's outline), ``spin``, ``velocity`` or ``matrices``; and what is allowed, for a message.
    """
    bound, end = farthest(camera), end_of(animation)
    motion: Motion = surface.motion
    reach = float(np.abs(surface.vertices).max(initial=0.0))
    if reach > bound:
        return "shape", _within(bound)
    for matrix in motion.matrices or ():
        rows = np.array(matrix).reshape(4, 4)[:3]
        if float(np.abs(surface.vertices @ rows[:, :3].T + rows[:, 3]).max()) > bound:
            return "matrices", _within(bound)
    if motion.spin is not None:
        if _largest(motion.spin.center) > bound:
            return "spin", f"about a center {_within(bound)}"
        if abs(motion.spin.rev_per_s) * end > COUNT:
            return "spin", f"at most {COUNT:g} turns by the end of the animation, at t = {end:g} s"
    if reach + _largest(motion.velocity) * end > bound:
        return "velocity", _within(bound, end)
    return None


def _largest(vector: tuple[float, ...]) -> float:
    return max(map(abs, vector))


def _within(bound: float, end: float | None = None) -> str:
    when = "" if end is None else f" until the end of the animation, at t = {end:g} s"
    why = "" if bound >= LENGTH else f" ({RESOLVED:g} times the picture's height: float64 resolves no more)"
    return f"within {bound:g} of the origin along each axis{when}{why}"
