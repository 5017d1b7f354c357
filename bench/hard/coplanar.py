"""Objects that lie on top of each other in one plane: the later one wins, from everywhere and at all times.

Nothing in a picture may depend on how a renderer decides that, be it by depth or by order.
"""

import math

import numpy as np

from aliasbench.bench.hard.case import HardCase, Verdict
from aliasbench.bench.hard.placing import (
    ANIMATION,
    BLUE,
    DISTANCE,
    GREEN,
    MIDDLE_S,
    MOVING_FRAME,
    ORANGE,
    PROJECTIONS,
    SIZE,
    WHITE,
    Setting,
    camera,
    flown,
    misplaced,
    moved,
)
from aliasbench.scenes.model import Checker, FloatArray, Motion, Scene, Spin, Surface, Vec3
from aliasbench.scenes.shapes import polygon, quad

_GRAZING_DEG = (60.0, 85.0, 89.0)
_SQUARES = 6
_DARK, _LIGHT = (0.2, 0.2, 0.2), (0.8, 0.8, 0.8)
# leaves of a stack: overlapping outlines in one plane, in units of the plane
_LEAVES: tuple[tuple[tuple[float, float], ...], ...] = (
    ((-13.3, -9.1), (12.7, -8.3), (13.9, 9.7), (-12.1, 8.9)),
    ((-15.2, -3.3), (4.1, -10.7), (3.3, 6.1), (-9.7, 10.3)),
    ((-4.3, -7.7), (14.3, -3.9), (7.1, 11.1)),
    ((-10.1, -1.7), (10.9, -2.3), (11.3, 3.1), (-9.3, 2.9)),
    ((-2.1, -6.3), (3.7, -5.9), (2.9, 7.3), (-3.3, 6.7)),
)
_COLORS: tuple[Vec3, ...] = (ORANGE, BLUE, GREEN, WHITE, (0.5, 0.0, 0.5))


def _tilted(points: FloatArray, tilt_deg: float, stretch: float = 1.0) -> FloatArray:
    """Return points (n, 3) of a plane (n, 2) through the origin, turned out of z = 0 about an axis in it.

    `stretch` lengthens the plane across that axis, so that it is as large in the picture as before it was turned.
    """
    axis = np.array([math.cos(0.3), math.sin(0.3), 0.0])
    other = np.array([-axis[1], axis[0], 0.0])
    along, across = points @ axis[:2], points @ other[:2] * stretch
    down = math.cos(math.radians(tilt_deg)) * other + np.array([0.0, 0.0, math.sin(math.radians(tilt_deg))])
    return np.asarray(along[:, None] * axis + across[:, None] * down)


def _leaf(number: int, tilt_deg: float, motion: Motion | None = None) -> Surface:
    # from a pinhole what is turned by more than 85 degrees would come behind it if it kept its height
    stretch = min(1.0 / math.cos(math.radians(tilt_deg)), 3.0)
    return polygon(_tilted(np.array(_LEAVES[number]), tilt_deg, stretch), color=_COLORS[number], motion=motion)


def stack_settings(angles: tuple[float, ...] = (0.0, *_GRAZING_DEG)) -> list[Setting]:
    """Return five overlapping polygons in one plane, seen straight and at grazing angles."""
    out = []
    for projection in PROJECTIONS:
        for tilt in angles:
            scene = Scene("stack", camera(projection), tuple(_leaf(k, tilt) for k in range(len(_LEAVES))))
            out.append(Setting(f"{projection} {tilt:.0f} deg", scene))
    return out


def _coplanar(subject: str) -> Verdict:
    return misplaced(subject, stack_settings())


def _coplanar_moving(subject: str) -> Verdict:
    """All leaves turning as one, each with a motion of its own in the plane, and the camera moving."""
    settings = [Setting(f"{s.name} turning", moved(s.scene), frame=MOVING_FRAME) for s in stack_settings((0.0, 85.0))]
    for projection in PROJECTIONS:
        for tilt in (0.0, 60.0, 85.0):
            # in the plane, along its axis and about its normal: the leaves slide over each other
            normal = np.cross(*_tilted(np.eye(2), tilt))
            ways = _tilted(np.array([(3.0, 0.0), (-2.0, 0.0), (0.0, 0.0), (1.0, 0.0), (-4.0, 0.0)]) / MIDDLE_S, tilt)
            leaves = []
            for k, way in enumerate(ways.tolist()):
                x, y, z = normal.tolist()
                spin = Spin((x, y, z), (0.0, 0.0, 0.0), (k - 2) * 0.01 / MIDDLE_S)
                leaves.append(_leaf(k, tilt, Motion(velocity=(way[0], way[1], way[2]), spin=spin)))
            scene = Scene("stack", camera(projection), tuple(leaves), animation=ANIMATION)
            settings.append(Setting(f"{projection} {tilt:.0f} deg sliding", scene, frame=MOVING_FRAME))
            still = Scene("stack", camera(projection), tuple(_leaf(k, tilt) for k in range(len(_LEAVES))))
            scene = flown(still, (2.0, -2.0, 2.0))
            settings.append(Setting(f"{projection} {tilt:.0f} deg camera", scene, frame=MOVING_FRAME))
    return misplaced(subject, settings)


def ground_settings(reach: float) -> list[Setting]:
    """Return five overlapping polygons in a plane 3 units below the camera, leaning, that reach far along it."""
    normal = np.array([math.sin(0.2), math.cos(0.2) * math.cos(0.1), math.cos(0.2) * math.sin(0.1)])
    ahead = np.array([0.0, 0.0, -1.0]) + normal[2] * normal
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, normal)
    below = np.array([0.0, 0.0, DISTANCE]) - 3.0 * normal
    outlines = (
        [(-reach, -reach), (reach, -0.9 * reach), (reach, reach), (-0.8 * reach, reach)],
        [(-0.2 * reach, 3.0), (0.3 * reach, -0.4 * reach), (0.25 * reach, 0.9 * reach), (-0.2 * reach, 0.7 * reach)],
        [(-8.0, 4.0), (9.0, 6.0), (13.0, 40.0), (-11.0, 50.0)],
        [(-3.0, -20.0), (4.0, -20.0), (5.0, 0.8 * reach), (-4.0, 0.9 * reach)],
        [(-40.0, 30.0), (50.0, 35.0), (45.0, 60.0), (-44.0, 70.0)],
    )
    objects = tuple(
        polygon(below + np.array(outline) @ np.stack([right, ahead]), color=color)
        for outline, color in zip(outlines, _COLORS, strict=True)
    )
    return [Setting(f"{p} {reach:g}", Scene("ground", camera(p), objects)) for p in PROJECTIONS]


def _coplanar_ground(subject: str) -> Verdict:
    settings = [s for reach in (60.0, 300.0, 1e3, 1e4) for s in ground_settings(reach)]
    return misplaced(subject, settings, reach_px=1e4 * SIZE[1])


def _checkered(corners: FloatArray, number: int) -> tuple[Surface, list[Surface]]:
    """Return a quad with a checker of its own colours on it, and the same as flat squares."""
    color = _COLORS[number]
    surface = quad(corners, texture="squares", color=color)
    shares = np.arange(_SQUARES + 1) / _SQUARES
    squares = []
    for i in range(_SQUARES):
        for j in range(_SQUARES):
            uv = np.array([(shares[i + a], shares[j + b]) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))])
            # a parallelogram: texture coordinates are affine in it
            points = corners[0] + uv[:, :1] * (corners[1] - corners[0]) + uv[:, 1:] * (corners[3] - corners[0])
            value = _LIGHT if (i + j) % 2 else _DARK
            r, g, b = (float(c * v) for c, v in zip(color, value, strict=True))
            squares.append(polygon(points, color=(r, g, b)))
    return surface, squares


def _coplanar_textured(subject: str) -> Verdict:
    checker = Checker((float(_SQUARES), float(_SQUARES)), _DARK, _LIGHT)
    settings = []
    for projection in PROJECTIONS:
        for tilt in (0.0, 60.0, 85.0):
            stretch = min(1.0 / math.cos(math.radians(tilt)), 3.0)
            objects, squares = [], []
            for k, (x, y) in enumerate(((-13.3137, -9.7211), (-7.9173, -4.3319), (-1.1271, -8.9433))):
                corners = np.array([(x, y), (x + 14.3, y + 1.1), (x + 13.6, y + 13.4), (x - 0.7, y + 12.3)])
                surface, flats = _checkered(_tilted(corners, tilt, stretch), k)
                objects.append(surface)
                squares += flats
            view = camera(projection)
            scene = Scene("stack", view, tuple(objects), {"squares": checker})
            still = Setting(f"{projection} {tilt:.0f} deg", scene, truth=Scene("stack", view, tuple(squares)))
            settings.append(still)
            if tilt:
                turning = moved(still.scene), moved(Scene("stack", view, tuple(squares)))
                settings.append(Setting(f"{still.name} turning", turning[0], None, turning[1], MOVING_FRAME))
    return misplaced(subject, settings)


_WINS = "Where polygons overlap, a sample shows the last of them; where it does not, an edge is within the rounding."
CASES: tuple[HardCase, ...] = (
    HardCase(
        "coplanar",
        "shapes",
        "Five polygons overlap in one plane, seen straight and at 60, 85 and 89 degrees.",
        _WINS,
        _coplanar,
    ),
    HardCase(
        "coplanar-moving",
        "shapes",
        "Overlapping polygons in one plane turn as one, slide over each other, or are passed by the camera.",
        _WINS,
        _coplanar_moving,
    ),
    HardCase(
        "coplanar-textured",
        "shapes",
        "Three quads with checkers overlap in one plane, still and turning, at up to 85 degrees.",
        "Where they overlap, a sample shows the last one's square; where it does not, a border is within the rounding.",
        _coplanar_textured,
    ),
    HardCase(
        "coplanar-ground",
        "shapes",
        "Five polygons overlap in the ground 3 units below the camera, from behind it up to 10 000 units ahead.",
        _WINS,
        _coplanar_ground,
    ),
)
