"""Photographed floors that recede to nearly the horizon, under a slow sideways pan: texture minification.

`brick-floor`, `grass-floor` and `gravel-floor` lay one of scikit-image's photographs (512 x 512, see `photographs`)
edge to edge, one photograph to a world unit; `photo-floor` takes the photograph as a parameter. At 256 pixels of height
a pixel covers three texels at the lower border and, at the far end 40 units away, ten photographs in depth: point
sampling turns that into noise that boils as the camera moves a few pixels, which is what to look at, together with how
far a mipmap blurs it. Bricks are regular and shimmer in rows; grass and gravel have detail at every scale and boil all
over. The horizon shows under a plain sky; the floor ends in front of it, so that exact sums over it are finite.

The pan goes sideways, along the texture's rows: after one world unit the picture is the same again, to the bit, and the
far end of the floor never moves in the picture. No pan is declared, because under perspective the picture has no one
velocity.
"""

import math
from functools import partial

from aliasbench.scenes.entries import Choice, Parameter, SceneEntry
from aliasbench.scenes.model import Animation, Camera, Scene
from aliasbench.scenes.photographs import load_photograph
from aliasbench.scenes.shapes import quad
from aliasbench.scenes.staging import FPS, loop_frames

EYE_HEIGHT = 1.0
FOV_Y_DEG, PITCH_DEG = 50.0, 12.0
NEAR_Z, FAR_Z = -0.8, -40.0  # in front of the eye, nearer than the lower border sees
HALF_WIDTH = 128.0  # the far end at a picture four times as wide as high is 75 to a side
SKY = (0.35, 0.55, 0.85)
FLOOR_PHOTOS = ("brick", "grass", "gravel")


def floor_camera(speed: float) -> Camera:
    """Return a camera over a floor at y = 0, the horizon in sight, that moves sideways (world units per second)."""
    pitch = math.radians(PITCH_DEG)
    return Camera(
        projection="perspective",
        position=(0.0, EYE_HEIGHT, 0.0),
        target=(0.0, EYE_HEIGHT - math.sin(pitch), -math.cos(pitch)),
        fov_y_deg=FOV_Y_DEG,
        velocity=(speed, 0.0, 0.0),
    )


def build_floor(*, name: str, photo: str, speed: float, shutter: float) -> Scene:
    """Return the floor seen by a camera that moves sideways with `speed` (world units per second)."""
    corners = [
        (-HALF_WIDTH, 0.0, NEAR_Z),
        (HALF_WIDTH, 0.0, NEAR_Z),
        (HALF_WIDTH, 0.0, FAR_Z),
        (-HALF_WIDTH, 0.0, FAR_Z),
    ]
    floor = quad(corners, uv=[(x, -z) for x, _, z in corners], texture=photo, name="floor")
    return Scene(
        name=name,
        camera=floor_camera(speed),
        objects=(floor,),
        textures={photo: load_photograph(photo)},
        background=SKY,
        animation=Animation(fps=float(FPS), frames=loop_frames(speed) if speed else 1, shutter=shutter),
    )


_PARAMETERS = {
    "speed": Parameter(0.5, -4.0, 4.0, "float", "sideways pan of the camera, world units per second"),
    "shutter": Parameter(0.0, 0.0, 1.0, "float", "open share of the frame interval"),
}

ENTRIES = (
    SceneEntry(
        "brick-floor",
        "a photograph of bricks on a receding floor under a slow pan: far texture shimmers",
        "floors",
        partial(build_floor, photo="brick"),
        _PARAMETERS,
    ),
    SceneEntry(
        "grass-floor",
        "a photograph of grass on a receding floor under a slow pan: irregular texture boils",
        "floors",
        partial(build_floor, photo="grass"),
        _PARAMETERS,
    ),
    SceneEntry(
        "gravel-floor",
        "a photograph of gravel on a receding floor under a slow pan: irregular texture boils",
        "floors",
        partial(build_floor, photo="gravel"),
        _PARAMETERS,
    ),
    SceneEntry(
        "photo-floor",
        "a photograph of choice on a receding floor under a slow pan",
        "floors",
        build_floor,
        {"photo": Choice("grass", FLOOR_PHOTOS, "photograph laid edge to edge"), **_PARAMETERS},
    ),
)
