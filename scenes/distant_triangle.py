"""One textured triangle, small and far away, that drifts slowly: its texture boils.

It stands a hundred units off before a dark sky, some dozens of pixels high, and carries far more detail than it has
pixels: two checker squares to a pixel across, or a photograph of bricks at 16 texels to a pixel. Point sampled, every
pixel takes one texel of the many it covers, and another one in the next frame, a fifth of a pixel further on. Look at
the boiling inside, while the outline hardly moves; in truth the inside is a nearly even tone.

It faces the camera a little askew, so that texture and pixels never line up, and drifts along a slant. It does not come
back, so the sequence does not loop, and nothing is declared.
"""

import math

import numpy as np

from aliasbench.scenes.entries import Choice, Parameter, SceneEntry
from aliasbench.scenes.model import Animation, Camera, Checker, Motion, Scene, Texture
from aliasbench.scenes.photographs import load_photograph
from aliasbench.scenes.shapes import polygon
from aliasbench.scenes.staging import FPS, LEAST_FRAMES

DISTANCE = 100.0
FOV_Y_DEG = 30.0
PIXEL = 2 * DISTANCE * math.tan(math.radians(FOV_Y_DEG) / 2) / 256  # world units there, in a picture 256 high
TURN, YAW = math.radians(17.0), math.radians(35.0)  # in the picture's plane, then about the vertical
SLANT = math.radians(20.0)  # of the drift
SQUARES_PER_PX = 2.0
PHOTOGRAPHS_PER_PX = 1 / 32
SKY = (0.05, 0.05, 0.1)
OUTLINE = np.array([[-0.5, -0.5], [0.55, -0.4], [-0.05, 0.5]])  # counter-clockwise


def build_distant_triangle(*, name: str, size_px: float, speed_px: float, texture: str, shutter: float) -> Scene:
    """Return a triangle `size_px` high that moves `speed_px` a second (pixels at 256 high); see the catalog."""
    c, s = math.cos(TURN), math.sin(TURN)
    turned = OUTLINE @ np.array([[c, s], [-s, c]])
    size = size_px / float(np.ptp(turned[:, 1]))
    across = size * PIXEL * turned[:, 0]
    points = np.stack([across * math.cos(YAW), size * PIXEL * turned[:, 1], -across * math.sin(YAW) - DISTANCE], axis=1)
    velocity = (speed_px * PIXEL * math.cos(SLANT), speed_px * PIXEL * math.sin(SLANT), 0.0)
    if texture == "checker":
        surface: Texture = Checker((SQUARES_PER_PX, SQUARES_PER_PX))
        per_px = 1.0
    else:
        surface, per_px = load_photograph("brick"), PHOTOGRAPHS_PER_PX
    triangle = polygon(
        points, uv=OUTLINE * size * per_px, texture=texture, motion=Motion(velocity=velocity), name="triangle"
    )
    return Scene(
        name=name,
        camera=Camera(projection="perspective", position=(0.0, 0.0, 0.0), target=(0.0, 0.0, -1.0), fov_y_deg=FOV_Y_DEG),
        objects=(triangle,),
        textures={texture: surface},
        background=SKY,
        animation=Animation(fps=float(FPS), frames=LEAST_FRAMES if speed_px else 1, shutter=shutter),
    )


ENTRIES = (
    SceneEntry(
        "distant-triangle",
        "a small, far, textured triangle that drifts slowly: its texture boils",
        "distant_triangle",
        build_distant_triangle,
        {
            "size_px": Parameter(40.0, 1.0, 400.0, "float", "height, in pixels of a picture 256 high"),
            "speed_px": Parameter(6.0, -60.0, 60.0, "float", "drift in such pixels per second, rightwards and up"),
            "texture": Choice("checker", ("checker", "photograph"), "a fine checker, or a photograph of bricks"),
            "shutter": Parameter(0.0, 0.0, 1.0, "float", "open share of the frame interval"),
        },
    ),
)
