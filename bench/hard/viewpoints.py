"""Viewpoints that are hard: polygons that pass through the camera, contain it, surround it or nearly touch it.

A polygon that reaches behind the camera shows the part before it; one whose plane holds a pinhole shows nothing.
"""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from aliasbench.bench.hard.case import HardCase, Verdict
from aliasbench.bench.hard.placing import (
    BLUE,
    GREEN,
    MAGENTA,
    MOVING_FRAME,
    ORANGE,
    PROJECTIONS,
    SHOWN,
    WHITE,
    Setting,
    camera,
    flat,
    flown,
    misplaced,
    moved,
)
from aliasbench.scenes.model import Camera, Checker, Scene, Surface, Vec3
from aliasbench.scenes.shapes import polygon, quad

_AIM = 2


def _behind() -> tuple[Surface, ...]:
    """Return polygons behind the camera, that a division by a negative depth would mirror into the picture."""
    near = polygon([(-9.0, -6.0, 60.0), (8.0, -5.0, 60.0), (7.0, 6.0, 70.0)], color=MAGENTA)
    far = polygon([(-99.0, -60.0, 500.0), (80.0, -50.0, 500.0), (0.0, 60.0, 500.0)], color=MAGENTA)
    return near, far


def passing_settings() -> list[Setting]:
    """Return floors and walls that run from before the camera past it to behind it, with others wholly behind."""
    floor = polygon([(-7.3, -3.1, -900.0), (9.1, -3.1, -900.0), (9.1, -3.1, 200.0), (-7.3, -3.1, 200.0)], color=ORANGE)
    wall = polygon([(5.3, -2.9, -300.0), (5.3, 14.0, -300.0), (5.3, 11.0, 300.0), (5.3, -2.9, 300.0)], color=BLUE)
    slabs = {
        "orthographic": polygon([(-30.0, -9.0, 20.0), (30.0, 33.0, 100.0), (-44.0, 51.0, 100.0)], color=GREEN),
        "perspective": polygon([(-5.0, -3.1, 20.0), (5.5, 1.7, 25.0), (-44.0, 51.0, 100.0)], color=GREEN),
    }
    views = {"straight": (0.3, 0.2, 0.0), "leaning": (2.3, -1.7, 0.0)}
    out = []
    for projection in PROJECTIONS:
        for name, target in views.items():
            view = camera(projection, target=target)
            # from above the floor, as a pinhole is, it hides nothing of the wall
            walls = (("walls", (floor, wall)),) if projection == "perspective" else ()
            for what, objects in (("floor", (floor,)), *walls, ("slab", (slabs[projection],))):
                scene = Scene("passing", view, (*_behind(), *objects))
                # those behind the camera are painted nowhere
                out.append(Setting(f"{projection} {name} {what}", scene))
    return out


@lru_cache(maxsize=1)
def _flown_by() -> list[Setting]:
    still = passing_settings()
    return still + [
        Setting(f"{s.name} flying", flown(s.scene, (0.5, 0.25, -4.0)), s.order, frame=MOVING_FRAME) for s in still
    ]


def _passing(subject: str) -> Verdict:
    # the reference's near plane for parallel rays is 1e-14 of the largest coordinate, under 1e3, behind the camera, and
    # slabs, which it cuts, rise by half
    return misplaced(subject, _flown_by(), aim=_AIM, near_px=1e-14 * 1e3)


_SQUARES = (5, 29)


@lru_cache(maxsize=1)
def textured_settings() -> list[Setting]:
    """Return a floor and a wall with checkers on them that run past the camera to behind it, still and flying by."""
    floor = np.array([(-7.3, -3.1, 200.0), (9.1, -3.1, 200.0), (9.1, -3.1, -900.0), (-7.3, -3.1, -900.0)])
    wall = np.array([(5.3, -2.9, 300.0), (5.3, 14.0, 300.0), (5.3, 14.0, -300.0), (5.3, -2.9, -300.0)])
    shares = [np.arange(count + 1) / count for count in _SQUARES]
    out = []
    for projection in PROJECTIONS:
        view = camera(projection, target=(0.3, 0.2, 0.0))
        for what, corners in (("floor", floor), ("wall", wall)):
            squares = []
            for i in range(_SQUARES[0]):
                for j in range(_SQUARES[1]):
                    uv = np.array([(shares[0][i + a], shares[1][j + b]) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))])
                    points = corners[0] + uv @ np.stack([corners[1] - corners[0], corners[3] - corners[0]])
                    squares.append(polygon(points, color=BLUE if (i + j) % 2 == 0 else ORANGE))
            checker = Checker((float(_SQUARES[0]), float(_SQUARES[1])), black=BLUE, white=ORANGE)
            shown = quad(corners, texture="squares")
            scene, truth = Scene(what, view, (shown,), {"squares": checker}), Scene(what, view, tuple(squares))
            out.append(Setting(f"{projection} {what}", scene, truth=truth))
            step = (0.5, 0.25, -4.0)
            flying = Setting(f"{projection} {what} flying", flown(scene, step), truth=flown(truth, step))
            out.append(replace(flying, frame=MOVING_FRAME))
    return out


def _passing_textured(subject: str) -> Verdict:
    return misplaced(subject, textured_settings())


def _edge_on(subject: str) -> Verdict:
    """Polygons whose plane holds the camera, before, about and through others that are seen."""
    settings = []
    behind = flat([(-13.3, -9.1), (12.7, -8.3), (13.9, 9.7), (-12.1, 8.9)], ORANGE)
    for position, target in (((0.0, 0.0, 48.0), (0.0, 0.0, 0.0)), ((3.1, -2.2, 45.7), (0.4, 0.3, 0.0))):
        eye, axis = np.array(position), np.subtract(target, position) / 48.0
        for angle in (0.0, 0.7, math.pi / 2.0):
            side = np.cross(axis, (math.sin(angle), math.cos(angle), 0.0))
            sheets = []
            for near, far in ((5.0, 30.0), (-20.0, 40.0)):
                corners = [eye + near * axis - 3.0 * side, eye + far * axis - 9.0 * side,
                           eye + far * axis + 9.0 * side, eye + near * axis + 3.0 * side]  # fmt: skip
                sheets.append(polygon(np.array(corners), color=MAGENTA))
            for projection in PROJECTIONS:
                view = camera(projection, position, target)
                scene = Scene("edge-on", view, (behind, *sheets))
                truth = Scene("edge-on", view, (behind,))
                name = f"{projection} {angle:.1f} from {position[0]:g}"
                settings.append(Setting(name, scene, truth=truth))
                # the sheets' planes stay the camera's: it flies along its axis, or all turn about the axis
                way = -7.0 * axis if position[0] else np.array([0.0, 0.0, -7.0])
                step = (float(way[0]), float(way[1]), float(way[2]))
                settings.append(
                    Setting(f"{name} flying", flown(scene, step), truth=flown(truth, step), frame=MOVING_FRAME)
                )
                if not position[0]:
                    settings.append(Setting(f"{name} turning", moved(scene), truth=moved(truth), frame=MOVING_FRAME))
    return misplaced(subject, settings)


_FACES = (((0, 1, 2, 3), ORANGE), ((4, 5, 6, 7), BLUE), ((0, 1, 5, 4), GREEN), ((3, 2, 6, 7), WHITE),
          ((0, 3, 7, 4), (0.5, 0.0, 0.5)), ((1, 2, 6, 5), (0.0, 0.5, 0.5)))  # fmt: skip
_CORNERS = np.array(
    [(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1), (-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)]
)
_PLACES: tuple[tuple[Vec3, Vec3], ...] = (  # where cameras are in the box, and which way they look
    ((0.0, 0.0, 0.0), (1.0, 0.2, -0.7)),
    ((5.9, -6.2, 6.6), (-3.1, 1.3, 0.4)),
    ((-6.999, 2.1, 1.3), (4.0, 3.0, 2.0)),
)


@lru_cache(maxsize=1)
def box_settings() -> list[Setting]:
    """Return cameras, still and flying, in a closed box of six colours on a background that must not be seen."""
    walls = tuple(polygon(7.0 * _CORNERS[list(corners)], color=color) for corners, color in _FACES)
    out = []
    for k, (position, (x, y, z)) in enumerate(_PLACES):
        target = (position[0] + x, position[1] + y, position[2] + z)
        scene = Scene("box", Camera("perspective", position, target, fov_y_deg=100.0), walls, background=MAGENTA)
        out.append(Setting(f"place {k}", scene))
        out.append(Setting(f"place {k} flying", flown(scene, (0.02, 0.01, -0.03)), frame=MOVING_FRAME))
    return out


def _inside_box(subject: str) -> Verdict:
    return misplaced(subject, box_settings(), aim=_AIM)


_MOSAIC = (
    ((-1.0, -1.0), (0.0, -1.0), (0.05, 0.0), (-1.0, 0.03)),
    ((0.0, -1.0), (1.0, -1.0), (1.0, 0.0), (0.05, 0.0)),
    ((-1.0, 0.03), (0.05, 0.0), (0.0, 1.0), (-1.0, 1.0)),
    ((0.05, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)),
)


@lru_cache(maxsize=2)
def near_settings(distance: float) -> list[Setting]:
    """Return a mosaic that a camera nearly touches, at a place where four of its pieces meet nearly in view."""
    out = []
    for at in (0.0, 12.3):
        objects = tuple(
            flat(at + 20.0 * distance * np.array(piece), color)
            for piece, color in zip(_MOSAIC, (ORANGE, BLUE, GREEN, WHITE), strict=True)
        )
        for projection in PROJECTIONS:
            position, target = (at, at, distance), (at, at, 0.0)
            if projection == "perspective":
                view = Camera(projection, position, target, fov_y_deg=50.0)
            else:
                view = Camera(projection, position, target, height=distance)
            scene = Scene("near", view, objects)
            out.append(Setting(f"{projection} at {at:g}, {distance:g} away", scene))
            step = (0.01 * distance, 0.02 * distance, 0.3 * distance)
            out.append(Setting(f"{out[-1].name}, flying", flown(scene, step), frame=MOVING_FRAME))
    return out


def _very_near(subject: str) -> Verdict:
    settings = [s for d in (1e-3, 1e-6) for s in near_settings(d)]
    return misplaced(subject, settings, aim=_AIM)


CASES: tuple[HardCase, ...] = (
    HardCase(
        "behind-camera",
        "shapes",
        "Floors, walls and slabs run from before the camera to behind it, others lie behind it; still and flying by, "
        "edges also 2^-10 to 2^-22 px from samples.",
        "The part before the camera is where it is, and nothing is mirrored from behind.",
        _passing,
    ),
    HardCase(
        "behind-camera-textured",
        "shapes",
        "A floor and a wall with checkers on them run from before the camera to behind it; still and flying by.",
        "A sample shows the square that is there; where not, within the rounding of the outline.",
        _passing_textured,
    ),
    HardCase(
        "edge-on-polygon",
        "shapes",
        "The camera is in the plane of polygons, also within their outlines, and before another "
        "polygon; still, flying in those planes and with all turning about its axis.",
        "Nothing of those is seen, and nothing of the other is hidden.",
        _edge_on,
    ),
    HardCase(
        "inside-box",
        "shapes",
        "The camera is in a closed box, in its middle, in a corner, and 0.001 from a wall of 14; still and "
        "flying, edges also 2^-10 to 2^-22 px from samples.",
        "Every sample shows the wall that it looks at, none the background; where not, within the format's rounding.",
        _inside_box,
    ),
    HardCase(
        "very-near",
        "shapes",
        "The camera is 1e-3 and 1e-6 from four polygons that meet in view, at the origin and 12 away from it; "
        "still and flying, edges also 2^-10 to 2^-22 px from samples.",
        SHOWN,
        _very_near,
    ),
)
