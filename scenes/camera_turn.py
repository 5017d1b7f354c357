"""A camera that turns or travels while its shutter is open: rows of posts at three depths, each streaking its own way.

The camera has a place and a target at the begin and at the end of every frame, both moving in straight lines. `turn`
moves the target: everything is smeared alike, near or far. `travel` moves the camera while it keeps looking at the same
point: the middle row, at the target's depth, stays nearly sharp, and what is nearer or farther streaks in opposite
directions. Look at the three rows beside each other, at an instant (`shutter=0`) for the strobing of posts that jump
more than their width from frame to frame, and with the shutter open for the streaks.

The rows stand above one another and hide nothing, so that each shows its own motion; `kind=bricks` hangs a photograph
of bricks in their place. The camera looks straight ahead in the middle of the animation. A target that moves in a
straight line never comes back, so the sequence is short and does not loop, and no fact is declared.

The rows reach across a picture four times as wide as high. Where a fast turn and a fast travel against it swing the
view so far that such a picture would look back along a row, they end 85 degrees from straight ahead, which is enough
for a picture twice as wide as high.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from aliasbench.scenes.entries import Choice, Parameter, SceneEntry
from aliasbench.scenes.model import Animation, Camera, Scene, Surface, Vec3, read_only
from aliasbench.scenes.photographs import load_photograph
from aliasbench.scenes.shapes import quad
from aliasbench.scenes.staging import FPS

FOV_Y_DEG = 50.0
TARGET_DEPTH = 5.0
FRAMES = 12  # the fastest turn takes the axis 17 degrees to either side
WIDEST = 4.25  # width over height of what the rows fill: pictures, and what filters see beside them
STEEPEST = math.radians(85.0)  # from straight ahead to a row's end
PHOTO_SHARE = 0.3  # of a row's depth: width of a photograph


class Row(NamedTuple):
    """A row of posts: depth, then pitch, lower and upper end over the depth, and colour."""

    depth: float
    pitch: float
    low: float
    high: float
    color: Vec3


WIDTH_SHARE = 0.3  # of the pitch
ROWS = (
    Row(3.0, 0.17, -0.44, -0.17, (1.0, 0.55, 0.2)),
    Row(TARGET_DEPTH, 0.1, -0.135, 0.135, (1.0, 1.0, 1.0)),
    Row(10.0, 0.06, 0.17, 0.44, (0.4, 0.75, 1.0)),
)


def build_camera_turn(*, name: str, kind: str, turn: float, travel: float, shutter: float) -> Scene:
    """Return the rows before a camera that turns by `turn` (degrees per second) and travels (world units per second).

    The rate of turning is that at the middle of the animation; positive is to the right, as for `travel`.
    """
    moving = turn != 0.0 or travel != 0.0
    frames = FRAMES if moving else 1
    middle = (frames - 1 + shutter) / 2 / FPS
    drift = TARGET_DEPTH * math.radians(turn)
    camera = Camera(
        projection="perspective",
        position=(-travel * middle, 0.0, 0.0),
        target=(-drift * middle, 0.0, -TARGET_DEPTH),
        fov_y_deg=FOV_Y_DEG,
        velocity=(travel, 0.0, 0.0),
        target_velocity=(drift, 0.0, 0.0),
    )
    swing = math.atan(abs(drift - travel) * middle / TARGET_DEPTH)
    steepest = min(swing + math.atan(WIDEST * math.tan(math.radians(FOV_Y_DEG / 2))), STEEPEST)
    reaches = [math.tan(steepest) + abs(travel) * middle / row.depth for row in ROWS]
    photographed = kind == "bricks"
    parts = [_panel(row, r) if photographed else _posts(row, r) for row, r in zip(ROWS, reaches, strict=True)]
    return Scene(
        name=name,
        camera=camera,
        objects=tuple(surface for part in parts for surface in part),
        textures={"brick": load_photograph("brick")} if photographed else {},
        animation=Animation(fps=float(FPS), frames=frames, shutter=shutter),
    )


def _posts(row: Row, reach: float) -> list[Surface]:
    """Return a row's posts, up to `reach` times the depth to either side."""
    count = math.ceil(reach / row.pitch)
    half = row.pitch * WIDTH_SHARE / 2
    middle = quad(_corners(row, -half, half), color=row.color)
    places = np.arange(-count, count + 1) * row.pitch * row.depth
    vertices = read_only(middle.vertices + places[:, None, None] * (1.0, 0.0, 0.0))
    return [
        # A post to the side needs no new check, and checking hundreds of them takes longer than all else.
        replace(middle, vertices=own, name=f"post {k} of {row.depth:g}")
        for k, own in enumerate(vertices, start=-count)
    ]


def _panel(row: Row, reach: float) -> list[Surface]:
    corners = _corners(row, -reach, reach)
    unit = row.depth * PHOTO_SHARE
    uv = [(x / unit, y / unit) for x, y, _ in corners]
    return [quad(corners, color=row.color, uv=uv, texture="brick", name=f"bricks of {row.depth:g}")]


def _corners(row: Row, left: float, right: float) -> list[Vec3]:
    outline = ((left, row.low), (right, row.low), (right, row.high), (left, row.high))
    return [(x * row.depth, y * row.depth, -row.depth) for x, y in outline]


ENTRIES = (
    SceneEntry(
        "camera-turn",
        "a camera that turns or travels in the open shutter past posts at three depths",
        "camera_turn",
        build_camera_turn,
        {
            "kind": Choice("posts", ("posts", "bricks"), "what stands at the three depths"),
            "turn": Parameter(60.0, -90.0, 90.0, "float", "turning of the view to the right, degrees per second"),
            "travel": Parameter(0.0, -10.0, 10.0, "float", "motion of the camera to the right, world units per second"),
            "shutter": Parameter(0.5, 0.0, 1.0, "float", "open share of the frame interval"),
        },
    ),
)
