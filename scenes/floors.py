"""A textured floor that recedes to nearly the horizon, under a slow sideways pan: texture minification.

`brick-floor` lays scikit-image's photograph of bricks (512 x 512, CC0) edge to edge, one photograph to a world unit. At
256 pixels of height a pixel covers three texels at the lower border and, at the far end 40 units away, ten photographs
in depth: point sampling turns that into noise that boils as the camera moves a few pixels, which is what to look at,
together with how far a mipmap blurs it. The horizon shows under a plain sky; the floor ends in front of it, so that
exact sums over it are finite.

The pan goes sideways, along the texture's rows: after one world unit the picture is the same again, to the bit, and the
far end of the floor never moves in the picture. No pan is declared, because under perspective the picture has no one
velocity.
"""

import math
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

from aliasbench.scenes.entries import Parameter, SceneEntry
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Animation, Camera, ImageTexture, Scene
from aliasbench.scenes.shapes import quad
from aliasbench.scenes.staging import FPS, loop_frames
from aliasbench.scenes.textures import load_image

EYE_HEIGHT = 1.0
FOV_Y_DEG, PITCH_DEG = 50.0, 12.0
NEAR_Z, FAR_Z = -0.8, -40.0  # in front of the eye, nearer than the lower border sees
HALF_WIDTH = 128.0  # the far end at a picture four times as wide as high is 75 to a side
SKY = (0.35, 0.55, 0.85)


def build_brick_floor(*, name: str, speed: float, shutter: float) -> Scene:
    """Return the floor seen by a camera that moves sideways with `speed` (world units per second)."""
    pitch = math.radians(PITCH_DEG)
    corners = [
        (-HALF_WIDTH, 0.0, NEAR_Z),
        (HALF_WIDTH, 0.0, NEAR_Z),
        (HALF_WIDTH, 0.0, FAR_Z),
        (-HALF_WIDTH, 0.0, FAR_Z),
    ]
    floor = quad(corners, uv=[(x, -z) for x, _, z in corners], texture="brick", name="floor")
    camera = Camera(
        projection="perspective",
        position=(0.0, EYE_HEIGHT, 0.0),
        target=(0.0, EYE_HEIGHT - math.sin(pitch), -math.cos(pitch)),
        fov_y_deg=FOV_Y_DEG,
        velocity=(speed, 0.0, 0.0),
    )
    return Scene(
        name=name,
        camera=camera,
        objects=(floor,),
        textures={"brick": brick_photo()},
        background=SKY,
        animation=Animation(fps=float(FPS), frames=loop_frames(speed) if speed else 1, shutter=shutter),
    )


@lru_cache(maxsize=1)
def brick_photo() -> ImageTexture:
    """Return scikit-image's photograph of bricks, read once; scikit-image itself is not imported."""
    package = find_spec("skimage")
    if package is None or package.origin is None:
        raise InputError("scene 'brick-floor' needs scikit-image's photograph of bricks; install scikit-image")
    return load_image(Path(package.origin).parent / "data" / "brick.png", source="skimage/data/brick.png")


ENTRIES = (
    SceneEntry(
        "brick-floor",
        "a photograph of bricks on a receding floor under a slow pan: far texture shimmers",
        "floors",
        build_brick_floor,
        {
            "speed": Parameter(0.5, -4.0, 4.0, "float", "sideways pan of the camera, world units per second"),
            "shutter": Parameter(0.0, 0.0, 1.0, "float", "open share of the frame interval"),
        },
    ),
)
