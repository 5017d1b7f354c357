"""Many drifting triangles smaller than a pixel, or little larger: they flicker on and off as they cross pixel centres.

All move with one velocity, some tenths of a pixel a frame, and the pattern repeats along it, so that a whole loop takes
a few seconds and the pan is declared with it. Look at single triangles blinking, and at the sum of the light, which in
truth is nearly constant. The drift is slanted, and so is the lattice on which the pattern repeats: repeats along rows
would all meet the pixel grid in one phase, blink together, and show as stripes.

Every triangle has its own depth: where two overlap the later one wins, in every renderer and without ties. Triangles of
one colour are one mesh. They cover much more than the picture, so that what drifts in is there for some twenty loops.
"""

import math

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.entries import Parameter, SceneEntry
from aliasbench.scenes.model import Animation, Facts, FloatArray, Motion, PanFact, Scene, Surface, Vec3, as_vec3
from aliasbench.scenes.shapes import mesh
from aliasbench.scenes.staging import FPS, flat_camera, loop_frames

PERIOD = 0.2  # world units along the drift; more than the largest triangle
ACROSS = 2.03  # world units between repeats across the drift, a little more than the picture
SKEW = 0.0737  # by which these are shifted along it
TILT = math.radians(15.0)  # of the drift, upwards from the right
DRIFT = np.array([math.cos(TILT), math.sin(TILT), 0.0])
LATTICE = np.array([PERIOD * DRIFT, SKEW * DRIFT + ACROSS * np.array([-DRIFT[1], DRIFT[0], 0.0])])
# World units that the pattern covers: the widest picture is 8 x 2; the rest is where it comes from or goes to.
WIDE, HIGH = 4.5, 1.5
RESERVE = np.array([4.5, 1.0])
SMALLEST = 0.2 / 1.5  # smallest diameter over the largest
LEAST_GAP = math.pi / 3  # between corners on a triangle's circle: no corner is sharper than 30 degrees
DEPTH_STEP = 2.0**-10  # between one triangle and the next
COLORS: tuple[Vec3, ...] = (
    (1.0, 1.0, 1.0),
    (1.0, 0.25, 0.2),
    (1.0, 0.8, 0.1),
    (0.2, 0.9, 0.3),
    (0.2, 0.7, 1.0),
    (1.0, 0.45, 0.9),
)


def build_confetti(*, name: str, count: int, size_px: float, seed: int, speed: float, shutter: float) -> Scene:
    """Return `count` triangles in every square of the picture's height, drifting to the right with `speed`."""
    in_cell = max(1, round(count * PERIOD * ACROSS / 4.0))
    cell, color = _cell(in_cell, 2 * size_px / 256, seed)
    low, high = np.array([-WIDE, -HIGH]), np.array([WIDE, HIGH])
    if speed >= 0.0:
        low -= RESERVE
    else:
        high += RESERVE
    shifts = _shifts(low, high)
    # of triangles' middles, before any corner is put in its place: most of the copies are outside
    x, y = (shifts[:, None, k] + cell[..., k].mean(axis=1) for k in (0, 1))
    covered = (x > low[0]) & (x < high[0]) & (y > low[1]) & (y < high[1])
    velocity = as_vec3(speed * DRIFT)
    objects: list[Surface] = []
    for k, rgb in enumerate(COLORS):
        copy, triangle = np.nonzero(covered & (color == k))
        corners = (shifts[copy, None, :] + cell[triangle]).reshape(-1, 3)
        if len(corners):
            triangles = np.arange(len(corners)).reshape(-1, 3)
            motion = Motion(velocity=velocity)
            objects.append(mesh(corners, triangles, color=rgb, motion=motion, name=f"confetti {k}"))
    loops_per_s = abs(speed) / PERIOD
    return Scene(
        name=name,
        camera=flat_camera(),
        objects=tuple(objects),
        animation=Animation(fps=float(FPS), frames=loop_frames(loops_per_s) if speed else 1, shutter=shutter),
        facts=Facts(pans=(PanFact(velocity, 1.0 / loops_per_s),) if speed else ()),
    )


def _shifts(low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the lattice's shifts (n, 3) that bring a cell's triangles into the box from low to high (x, y)."""
    i, j = np.meshgrid(np.arange(-80, 81), np.arange(-5, 6), indexing="ij")
    shifts = i.reshape(-1, 1) * LATTICE[0] + j.reshape(-1, 1) * LATTICE[1]
    reach = np.abs(LATTICE[:, :2]).sum(axis=0)
    near = ((shifts[:, :2] > low - reach) & (shifts[:, :2] < high + reach)).all(axis=1)
    chosen: FloatArray = shifts[near]
    return chosen


def _cell(count: int, largest: float, seed: int) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return the corners (count, 3, 3) of one cell's triangles, of diameters up to `largest`, and their colours.

    Corners lie on a circle of the diameter, counter-clockwise; middles are jittered over strata across the drift.
    """
    rng = np.random.default_rng(seed)
    along = rng.random(count)
    across = (rng.permutation(count) + rng.random(count)) / count - 0.5
    middle = along[:, None] * LATTICE[0] + across[:, None] * LATTICE[1]
    middle[:, 2] = DEPTH_STEP * np.arange(count)
    radius = largest / 2 * (SMALLEST + (1 - SMALLEST) * rng.random((count, 1)))
    gaps = LEAST_GAP + (2 * math.pi - 3 * LEAST_GAP) * rng.dirichlet(np.ones(3), count)
    angle = 2 * math.pi * rng.random((count, 1)) + np.cumsum(gaps, axis=1)
    around = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=-1)
    return middle[:, None, :] + radius[..., None] * around, rng.integers(len(COLORS), size=count)


ENTRIES = (
    SceneEntry(
        "confetti",
        "small triangles that drift over the pixel centres: they flicker on and off",
        "confetti",
        build_confetti,
        {
            "count": Parameter(4000, 8, 20000, "int", "triangles in a square of the picture's height"),
            "size_px": Parameter(1.5, 0.2, 20.0, "float", "largest diameter, in pixels of a picture 256 high"),
            "seed": Parameter(1, 0, 2**31 - 1, "int", "of places, shapes and colours"),
            "speed": Parameter(0.08, -2.0, 2.0, "float", "drift to the right and up, world units per second"),
            "shutter": Parameter(0.0, 0.0, 1.0, "float", "open share of the frame interval"),
        },
    ),
)
