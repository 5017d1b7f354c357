"""A regular grid, facing the camera, finer than the pixels: moire.

White lines cross at right angles on black, each half as wide as the pitch. At the default there are 33 lines to 16
pixels of a picture 256 high (33 to 32 at 512): a point sample sees every second line (every one) a little later than
the one before, and a false grid of 16 (32) pixels comes out, with full contrast, where in truth the picture is a nearly
even grey. Look at the false grid, at how a finer grid of samples only moves it to other frequencies, and with `speed`
at how it races: it moves one of its own periods while the grid moves one line.

The grid is there as triangles and as one repeated period of a texture, with the same edges. Declared are the two
frequencies of its lines, and the pan where there is one: along the first direction, a loop is one line.
"""

from aliasbench.scenes.bars import (
    DUTY,
    Bars,
    bars_as_mesh,
    bars_as_quad,
    crossed_period,
    drift_velocity,
    share_of,
)
from aliasbench.scenes.entries import Choice, Parameter, SceneEntry
from aliasbench.scenes.model import Animation, Facts, GratingFact, Motion, PanFact, Scene, Surface, Texture
from aliasbench.scenes.staging import FPS, flat_camera, loop_frames

PICTURE_HEIGHT = 2.0  # world units
IN_FRONT = 2.0**-6  # the second set of bars before the first: nothing lies in one plane
WHITE = (1.0, 1.0, 1.0)


def build_grid(
    *, name: str, lines: float, angle_deg: float, duty: float, speed: float, kind: str, shutter: float
) -> Scene:
    """Return a grid of `lines` to the picture's height that moves `speed` lines a second; see the catalog."""
    pitch, share = PICTURE_HEIGHT / lines, share_of(duty)
    upright = Bars(pitch, angle_deg, share, drift=speed)
    level = Bars(pitch, angle_deg + 90.0, share, z=IN_FRONT)
    velocity = drift_velocity(upright)
    motion = Motion(velocity=velocity)
    objects: tuple[Surface, ...]
    textures: dict[str, Texture] = {}
    if kind == "polygons":
        objects = (
            bars_as_mesh(upright, color=WHITE, motion=motion, name="upright lines"),
            # moving along themselves, they need not move
            bars_as_mesh(level, color=WHITE, name="level lines"),
        )
    else:
        textures["grid"] = crossed_period(share)
        objects = (bars_as_quad(upright, texture="grid", motion=motion, name="grid"),)
    return Scene(
        name=name,
        camera=flat_camera(),
        objects=objects,
        textures=textures,
        animation=Animation(fps=float(FPS), frames=loop_frames(speed) if speed else 1, shutter=shutter),
        facts=Facts(
            gratings=(GratingFact(upright.frequency), GratingFact(level.frequency)),
            pans=(PanFact(velocity, 1.0 / abs(speed)),) if speed else (),
        ),
    )


ENTRIES = (
    SceneEntry(
        "grid",
        "a regular grid, finer than the pixels: a false, coarse one comes out",
        "grid",
        build_grid,
        {
            "lines": Parameter(528.0, 4.0, 2048.0, "float", "lines each way in the picture's height, 2 world units"),
            "angle_deg": Parameter(0.0, -90.0, 90.0, "float", "turn of the grid, counter-clockwise"),
            "duty": DUTY,
            "speed": Parameter(1.0, -15.0, 15.0, "float", "pan, lines per second"),
            "kind": Choice("texture", ("texture", "polygons"), "one repeated image, or triangles"),
            "shutter": Parameter(0.0, 0.0, 1.0, "float", "open share of the frame interval"),
        },
    ),
)
