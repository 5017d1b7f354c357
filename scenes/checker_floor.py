"""A checkered floor that recedes to nearly the horizon, under a slow sideways pan: minification with exact sums.

The same view as `brick-floor`, with a checker in place of the photograph: the true picture is known in closed form, and
a false pattern is plain, because what is true far away is an even grey. At 256 pixels of height rows of squares are
finer than the pixels from some seven units on: point sampling turns them into false bands that race when the camera
moves. The floor ends in front of the horizon, as far away as `far` says: the farther, the more squares lie in a pixel.

The pan goes along the rows of squares; after two squares the picture is the same again, and the far end never moves. No
pan and no grating are declared: under perspective the picture has no one velocity, and no one frequency.
"""

from aliasbench.scenes.entries import Parameter, SceneEntry
from aliasbench.scenes.floors import NEAR_Z, SKY, floor_camera
from aliasbench.scenes.model import Animation, Checker, Scene
from aliasbench.scenes.shapes import quad
from aliasbench.scenes.staging import FPS, loop_frames

WIDTH_SHARE = 2.0  # half the floor's width over its far end: the widest picture sees 1.9
RESERVE_S = 20.0  # seconds of motion for which the floor goes on


def build_checker_floor(*, name: str, squares: float, far: float, speed: float, shutter: float) -> Scene:
    """Return the floor seen by a camera that moves sideways with `speed` (world units per second); see the catalog."""
    half = WIDTH_SHARE * far + RESERVE_S * abs(speed)
    corners = [(-half, 0.0, NEAR_Z), (half, 0.0, NEAR_Z), (half, 0.0, -far), (-half, 0.0, -far)]
    floor = quad(corners, uv=[(x, -z) for x, _, z in corners], texture="checker", name="floor")
    return Scene(
        name=name,
        camera=floor_camera(speed),
        objects=(floor,),
        textures={"checker": Checker((squares, squares))},
        background=SKY,
        animation=Animation(fps=float(FPS), frames=loop_frames(speed * squares / 2) if speed else 1, shutter=shutter),
    )


ENTRIES = (
    SceneEntry(
        "checker-floor",
        "a checkered floor that recedes to nearly the horizon under a slow pan: false bands",
        "checker_floor",
        build_checker_floor,
        {
            "squares": Parameter(4.0, 0.25, 16.0, "float", "squares to a world unit; the eye is one unit high"),
            "far": Parameter(40.0, 4.0, 400.0, "float", "distance of the floor's far end, world units"),
            "speed": Parameter(0.5, -4.0, 4.0, "float", "sideways pan of the camera, world units per second"),
            "shutter": Parameter(0.0, 0.0, 1.0, "float", "open share of the frame interval"),
        },
    ),
)
