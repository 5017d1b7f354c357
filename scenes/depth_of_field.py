"""A lens before things at three depths: fine edges go soft and small bright things turn into discs.

Three groups stand side by side, at depth 3, 5 and 9, drawn so that they look alike to a pinhole: a comb of bars that
get finer, and bright dots above it. The lens is focused at depth 5: the middle group stays sharp, the left and the
right one are spread over discs of 2 R f |1 / Z - 1 / F| pixels (R the lens radius, f the focal length in pixels), 11
and 8 of 256 by default. Look at the dots, which become discs with sharp borders, dim by the ratio of areas; at the
comb, whose fine end is lost first; and at noise there when samples are few. With `focus` the sharp group changes.

Everything is flat and faces the camera, and the groups keep farther apart than they are spread at the default: such
pictures are known exactly. All stands still, and no facts are declared.
"""

import math
from itertools import pairwise

from aliasbench.scenes.entries import Parameter, SceneEntry
from aliasbench.scenes.model import Animation, Camera, Scene, Surface, Vec3
from aliasbench.scenes.shapes import polygon, quad
from aliasbench.scenes.staging import FPS, polar

FOV_Y_DEG = 40.0
# Places and sizes below are over the depth: tangents of the angle from the axis.
GROUPS: tuple[tuple[float, float, Vec3], ...] = (
    (3.0, -0.235, (1.0, 0.75, 0.45)),
    (5.0, 0.0, (1.0, 1.0, 1.0)),
    (9.0, 0.235, (0.5, 0.8, 1.0)),
)
BAR_WIDTHS = (0.024, 0.018, 0.0135, 0.01, 0.0075, 0.0055, 0.004, 0.003)  # each gap is as wide as the bar before it
COMB_LOW, COMB_HIGH = -0.28, 0.05
DOTS = ((-0.05, 0.13, 0.012), (0.045, 0.145, 0.009), (-0.035, 0.235, 0.007), (0.05, 0.24, 0.005))  # x, y, radius
DOT_CORNERS = 8
START_ANGLE = 0.2  # radians: no side of a dot lies along a row or a column


def build_depth_of_field(*, name: str, lens_radius: float, focus: float) -> Scene:
    """Return the three groups before a lens of a radius (world units), focused at a depth."""
    camera = Camera(
        projection="perspective",
        position=(0.0, 0.0, 0.0),
        target=(0.0, 0.0, -1.0),
        fov_y_deg=FOV_Y_DEG,
        lens_radius=lens_radius,
        focus_distance=focus,
    )
    objects = tuple(surface for depth, middle, color in GROUPS for surface in _group(depth, middle, color))
    return Scene(name=name, camera=camera, objects=objects, animation=Animation(fps=float(FPS)))


def _group(depth: float, middle: float, color: Vec3) -> list[Surface]:
    borders = [0.0]
    for width in BAR_WIDTHS:
        borders += [borders[-1] + width, borders[-1] + 2 * width]
    left = middle - borders[-2] / 2
    surfaces = []
    for begin, end in list(pairwise(borders))[::2]:
        a, b = left + begin, left + end
        outline = [(a, COMB_LOW), (b, COMB_LOW), (b, COMB_HIGH), (a, COMB_HIGH)]
        points = [(x * depth, y * depth, -depth) for x, y in outline]
        surfaces.append(quad(points, color=color, name=f"bar at {depth:g}"))
    for x, y, radius in DOTS:
        corners = [polar(radius, START_ANGLE + k * 2 * math.pi / DOT_CORNERS) for k in range(DOT_CORNERS)]
        points = [((middle + x + dx) * depth, (y + dy) * depth, -depth) for dx, dy, _ in corners]
        surfaces.append(polygon(points, color=color, name=f"dot at {depth:g}"))
    return surfaces


ENTRIES = (
    SceneEntry(
        "depth-of-field",
        "combs and dots at three depths before a lens: out of focus, dots turn into discs",
        "depth_of_field",
        build_depth_of_field,
        {
            "lens_radius": Parameter(0.12, 0.0, 0.5, "float", "radius of the lens, world units"),
            "focus": Parameter(5.0, 2.0, 20.0, "float", "depth in focus, world units; groups stand at 3, 5 and 9"),
        },
    ),
)
