"""A zone plate: rings that grow finer outwards, and false ring systems where they are finer than the pixels.

The value is (1 + cos(k r^2 + phase)) / 2 with r the distance from the middle in picture heights: at r there are
k r / pi cycles to a picture height. Where that is once, twice, ... the number of samples, a point sample shows rings
about a centre that is not there. At the default k false centres lie 0.2 picture heights apart, in rows and columns, in
a picture 256 high, and 0.4 apart at 512. Look at them; what is true there is an even grey.

The texture is analytic, evaluated exactly where it is sampled. Filtered minification works on an image of all that the
plate covers, of exact area averages, 1024 texels to a picture height (512 where it pans); in pictures that are higher,
filtered rings are blurred by its texels. Nothing is declared: the frequency is another one everywhere. A pan moves the
rings to the right; they never repeat, so it does not loop.
"""

import math

from aliasbench.scenes.entries import Parameter, SceneEntry
from aliasbench.scenes.model import Animation, Motion, Scene, ZonePlate
from aliasbench.scenes.shapes import quad
from aliasbench.scenes.staging import FPS, LEAST_FRAMES, flat_camera

PICTURE_HEIGHT = 2.0  # world units
WIDE, HIGH = 4.5, 1.5  # world units from the middle that are covered: the widest picture is 8 x 2
RESERVE_S = 10.0  # seconds of motion for which the plate goes on


def build_zone_plate(*, name: str, k: float, phase: float, speed: float, shutter: float) -> Scene:
    """Return a zone plate about the picture's middle that moves to the right; see the catalog for the parameters."""
    coming = RESERVE_S * abs(speed)
    left = -WIDE - (coming if speed > 0.0 else 0.0)
    right = WIDE + (coming if speed < 0.0 else 0.0)
    corners = [(left, -HIGH, 0.0), (right, -HIGH, 0.0), (right, HIGH, 0.0), (left, HIGH, 0.0)]
    plate = quad(
        corners,
        uv=[(0.5 + x / PICTURE_HEIGHT, 0.5 + y / PICTURE_HEIGHT) for x, y, _ in corners],
        texture="rings",
        motion=Motion(velocity=(speed, 0.0, 0.0)),
        name="plate",
    )
    return Scene(
        name=name,
        camera=flat_camera(),
        objects=(plate,),
        textures={"rings": ZonePlate((0.5, 0.5), k, phase)},
        animation=Animation(fps=float(FPS), frames=LEAST_FRAMES if speed else 1, shutter=shutter),
    )


ENTRIES = (
    SceneEntry(
        "zone-plate",
        "rings that grow finer outwards: false ring systems beside the true one",
        "zone_plate",
        build_zone_plate,
        {
            "k": Parameter(4000.0, 1.0, 40000.0, "float", "phase at one picture height from the middle, radians"),
            "phase": Parameter(0.0, -math.pi, math.pi, "float", "phase at the middle, radians: 0 is bright"),
            "speed": Parameter(0.0, -1.0, 1.0, "float", "pan to the right, world units per second"),
            "shutter": Parameter(0.0, 0.0, 1.0, "float", "open share of the frame interval"),
        },
    ),
)
