"""What the built-in scenes share: the frame rate, the camera of the flat ones, and the length of a loop.

Sequences loop exactly wherever they can, because then the temporal metrics' Fourier bins are exact and need no window.
"""

import math
from fractions import Fraction

from aliasbench.scenes.model import Camera, Vec3

FPS = 30
LEAST_FRAMES, MOST_FRAMES = 30, 300  # one second to ten


def flat_camera() -> Camera:
    """Return the camera of the flat scenes: orthographic, 2 world units high, looking down -z at the origin."""
    return Camera(projection="orthographic", position=(0.0, 0.0, 5.0), target=(0.0, 0.0, 0.0), height=2.0)


def polar(radius: float, angle: float) -> Vec3:
    """Return the point of the plane z = 0 at a radius and an angle (radians, counter-clockwise from +x)."""
    return (radius * math.cos(angle), radius * math.sin(angle), 0.0)


def loop_frames(loops_per_s: float) -> int:
    """Return the least number of frames, from one second on, that holds whole loops; one second if ten hold none."""
    per_frame = Fraction(loops_per_s).limit_denominator(10**6) / FPS
    whole = per_frame.denominator
    if whole > MOST_FRAMES or abs(float(per_frame * FPS) - loops_per_s) > 1e-12 * abs(loops_per_s):
        return LEAST_FRAMES
    return whole * math.ceil(LEAST_FRAMES / whole)
