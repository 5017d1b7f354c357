"""A camera that turns or travels while its shutter is open: rows of posts at three depths, each streaking its own way.

The camera has a place and a target at the begin and at the end of every frame, both moving in straight lines. `turn`
moves the target: everything is smeared alike, near or far. `travel` moves the camera while it keeps looking at the same
point: the middle row, at the target's depth, stays nearly sharp, and what is nearer or farther streaks in opposite
directions. Look at the three rows beside each other, at an instant (`shutter=0`) for the strobing of posts that jump
more than their width from frame to frame, and with the shutter open for the streaks.

The rows stand above one another and hide nothing, so that each shows its own motion; `kind=bricks` hangs a photograph
of bricks in their place. The camera looks straight ahead in the middle of the animation. A target that moves in a
straight line never comes back, so the sequence is short and does not loop, and no fact is declared.
"""

import math
from typing import NamedTuple

from aliasbench.scenes.entries import Choice, Parameter, SceneEntry
from aliasbench.scenes.model import Animation, Camera, Scene, Surface, Vec3
from aliasbench.scenes.photographs import load_photograph
from aliasbench.scenes.shapes import quad
from aliasbench.scenes.staging import FPS

FOV_Y_DEG = 50.0
TARGET_DEPTH = 5.0
FRAMES = 12  # the fastest turn takes the axis 16 degrees to either side
REACH = 1.7  # half a row's length over its depth: what a picture twice as wide as high sees at the fastest turn
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
    photographed = kind == "bricks"
    return Scene(
        name=name,
        camera=camera,
        objects=tuple(_panel(row) for row in ROWS) if photographed else tuple(p for row in ROWS for p in _posts(row)),
        textures={"brick": load_photograph("brick")} if photographed else {},
        animation=Animation(fps=float(FPS), frames=frames, shutter=shutter),
    )


def _posts(row: Row) -> list[Surface]:
    count = math.floor(REACH / row.pitch)
    half = row.pitch * WIDTH_SHARE / 2
    return [
        quad(
            _corners(row, k * row.pitch - half, k * row.pitch + half),
            color=row.color,
            name=f"post {k} of {row.depth:g}",
        )
        for k in range(-count, count + 1)
    ]


def _panel(row: Row) -> Surface:
    corners = _corners(row, -REACH, REACH)
    unit = row.depth * PHOTO_SHARE
    uv = [(x / unit, y / unit) for x, y, _ in corners]
    return quad(corners, color=row.color, uv=uv, texture="brick", name=f"bricks of {row.depth:g}")


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
