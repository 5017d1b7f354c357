"""Motion as two matrices, begin and end of the frame, beside the rotation they stand for: what interpolation loses.

The lecture gives every object a matrix for the begin of the frame and one for its end, and every ray the matrix between
the two that belongs to its time. Linear interpolation takes points along chords instead of arcs: halfway through a turn
by an angle a the left bar is cos(a / 2) as long as it should be, a half at the default 120 degrees. The right bar spins
at the same rate, exactly. Look at the outlines of the two smears with the shutter open: the left one is cut straight
where the right one is round, and brighter near its middle; and at how the difference goes with the square of the angle.

Two matrices are the same for every frame, so the left bar does the same in each; the right one goes on turning, and the
frames hold whole turns of it where ten seconds can. Bars stay in the picture and apart from each other. No rotor is
declared: a bar is not a share of the circle, and the left one does not keep its shape.
"""

from aliasbench.scenes.entries import Parameter, SceneEntry
from aliasbench.scenes.model import Animation, FloatArray, Motion, Scene, Spin, Surface, Vec3
from aliasbench.scenes.motion import rotation_matrix
from aliasbench.scenes.shapes import quad
from aliasbench.scenes.staging import FPS, flat_camera, loop_frames

AXIS: Vec3 = (0.0, 0.0, 1.0)
LEFT, RIGHT = (-0.5, 0.0, 0.0), (0.5, 0.0, 0.0)
HALF_LENGTH, HALF_WIDTH = 0.46, 0.09
START_TURNS = 0.03  # no edge starts along a row or a column
COLORS: tuple[Vec3, Vec3] = ((1.0, 1.0, 1.0), (1.0, 0.45, 0.1))  # of the two halves, to tell half turns from none


def build_two_matrices(*, name: str, angle: float, shutter: float) -> Scene:
    """Return the bar of two matrices, turned by `angle` degrees in a frame, and left of the bar that spins as fast."""
    rate = angle / 360.0 * FPS
    between, exact = Motion(), Motion()
    if angle:
        between = Motion(matrices=(_turned_about(LEFT, 0.0), _turned_about(LEFT, angle / 360.0)))
        exact = Motion(spin=Spin(AXIS, RIGHT, rate))
    return Scene(
        name=name,
        camera=flat_camera(),
        objects=(*_bar(LEFT, between, "two matrices"), *_bar(RIGHT, exact, "spin")),
        animation=Animation(fps=float(FPS), frames=loop_frames(rate) if angle else 1, shutter=shutter),
    )


def _bar(center: Vec3, motion: Motion, name: str) -> list[Surface]:
    """Return two halves of a bar that meet in its centre."""
    start = rotation_matrix(AXIS, START_TURNS)
    halves = []
    for sign, color in zip((1.0, -1.0), COLORS, strict=True):
        corners = [(0.0, -HALF_WIDTH), (HALF_LENGTH, -HALF_WIDTH), (HALF_LENGTH, HALF_WIDTH), (0.0, HALF_WIDTH)]
        points = [start @ (sign * x, sign * y, 0.0) + center for x, y in corners]
        halves.append(quad(points, color=color, motion=motion, name=f"{name} {'+' if sign > 0 else '-'}"))
    return halves


def _turned_about(center: Vec3, turns: float) -> tuple[float, ...]:
    """Return the row-major 4 x 4 matrix of a rotation about a centre."""
    rotation: FloatArray = rotation_matrix(AXIS, turns)
    shift = center - rotation @ center
    rows = [(*(float(x) for x in rotation[k]), float(shift[k])) for k in range(3)]
    return (*rows[0], *rows[1], *rows[2], 0.0, 0.0, 0.0, 1.0)


ENTRIES = (
    SceneEntry(
        "two-matrices",
        "a bar turned by two matrices a frame beside one that truly spins: interpolation shrinks it",
        "two_matrices",
        build_two_matrices,
        {
            "angle": Parameter(120.0, -170.0, 170.0, "float", "turn in a frame, degrees counter-clockwise"),
            "shutter": Parameter(1.0, 0.0, 1.0, "float", "open share of the frame interval"),
        },
    ),
)
