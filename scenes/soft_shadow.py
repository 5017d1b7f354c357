"""Shadows with penumbrae under a square light, alone and together with every other blur.

`soft-shadow` has slats over a diffuse floor. Each casts a shadow with a border as wide as the light is large, times
occluder height over the distance from occluder to light: 0.12 world units or 10 pixels of 256 by default, so that the
stripes of shadow stay apart and have soft flanks; with a larger light or higher slats they run into one. One shadow ray
to a camera ray turns the penumbrae to noise, which is what to look at, and how much of it goes away with more shadow
rays or with more camera rays of one shadow ray each. The slats are turned against the pixel rows.

`pixel-time-lens-light` has all four at once, because a fixed number of samples spread over all of them is what the
lecture ends on: a rotor that turns in the open shutter, over a floor on which its soft shadow turns too, seen through a
lens that is focused on the rotor, with posts in front of it and behind it. Each blur goes away with its own parameter.
The frames are whole turns. No closed form is known for all of it together, so its reference is an average with an
interval; its light is large and therefore dim, because the interval goes with the brightest thing that might be seen.
With `lens_radius=0` and `shutter=0` the picture is certified.

Lights are dimmed or brightened with their size and height so that the floor under them is always equally bright.
No facts are declared: what these pictures show is compared with references.
"""

import math

from aliasbench.scenes.entries import Parameter, SceneEntry
from aliasbench.scenes.lamps import square_lamp
from aliasbench.scenes.model import Animation, Camera, Material, Motion, Scene, Spin, Surface, Vec3
from aliasbench.scenes.motion import rotation_matrix
from aliasbench.scenes.shapes import polygon, quad
from aliasbench.scenes.staging import FPS, loop_frames

DIFFUSE = Material("diffuse")
UP: Vec3 = (0.0, 1.0, 0.0)
FLOOR_COLOR, SLAT_COLOR = (0.9, 0.9, 0.9), (0.8, 0.35, 0.15)
BRIGHTNESS = 0.8  # radiance of a white floor under the light
HALF_SIDE = 30.0  # of the floor, which fills the picture up to four times as wide as high
SLAT_WIDTH, SLAT_LENGTH, SLAT_TURNS = 0.18, 1.3, 0.06
EYE: Vec3 = (0.0, 3.0, 4.0)
FOV_Y_DEG = 32.0
ROTOR_HEIGHT, ROTOR_RADIUS, ROTOR_HUB, BLADES, BLADE_SHARE = 0.25, 0.75, 0.12, 3, 0.4
START_ANGLE = 0.2  # radians: no edge starts along a row or a column
LAMP_HEIGHT = 2.2
DIMMED = 0.6  # as BRIGHTNESS, for what is nearer to the lamp
POSTS: tuple[tuple[Vec3, Vec3], ...] = (
    ((-0.95, 0.0, 1.15), (0.2, 0.7, 1.0)),
    ((0.85, 0.0, -1.3), (1.0, 0.85, 0.2)),
)
POST_WIDTH, POST_HEIGHT = 0.06, 0.6


def build_soft_shadow(
    *, name: str, light_size: float, light_height: float, occluder_height: float, slats: int
) -> Scene:
    """Return `slats` slats at `occluder_height` over a floor under a light; see the catalog for the parameters."""
    turned = rotation_matrix(UP, SLAT_TURNS)
    objects = [_floor()]
    for k in range(slats):
        left = (2 * k - slats + 0.5) * SLAT_WIDTH
        corners = [(x, z) for x in (left, left + SLAT_WIDTH) for z in (SLAT_LENGTH / 2, -SLAT_LENGTH / 2)]
        outline = [corners[0], corners[2], corners[3], corners[1]]
        points = [turned @ (x, occluder_height, z) for x, z in outline]
        objects.append(quad(points, color=SLAT_COLOR, material=DIFFUSE, name=f"slat {k}"))
    return Scene(
        name=name,
        camera=Camera(projection="perspective", position=EYE, target=(0.0, 0.0, 0.0), fov_y_deg=FOV_Y_DEG),
        objects=tuple(objects),
        lights=(square_lamp(size=light_size, height=light_height, radiosity=BRIGHTNESS),),
        animation=Animation(fps=float(FPS)),
    )


def build_pixel_time_lens_light(
    *, name: str, rev_per_s: float, shutter: float, lens_radius: float, light_size: float
) -> Scene:
    """Return a rotor over a floor under a light, seen through a lens focused on the rotor's middle."""
    middle = (0.0, ROTOR_HEIGHT, 0.0)
    motion = Motion(spin=Spin(UP, middle, rev_per_s)) if rev_per_s else Motion()
    objects = [_floor()]
    for k in range(BLADES):
        first, width = START_ANGLE + 2 * math.pi * k / BLADES, 2 * math.pi * BLADE_SHARE / BLADES
        ends = [(ROTOR_HUB, first), (ROTOR_RADIUS, first), (ROTOR_RADIUS, first + width), (ROTOR_HUB, first + width)]
        points = [(r * math.cos(a), ROTOR_HEIGHT, -r * math.sin(a)) for r, a in ends]
        objects.append(polygon(points, color=SLAT_COLOR, material=DIFFUSE, motion=motion, name=f"blade {k}"))
    for (x, y, z), color in POSTS:
        post = [
            (x - POST_WIDTH / 2, y, z),
            (x + POST_WIDTH / 2, y, z),
            (x + POST_WIDTH / 2, y + POST_HEIGHT, z),
            (x - POST_WIDTH / 2, y + POST_HEIGHT, z),
        ]
        objects.append(quad(post, color=color, name=f"post at {z:g}"))
    camera = Camera(
        projection="perspective",
        position=EYE,
        target=middle,
        fov_y_deg=FOV_Y_DEG,
        lens_radius=lens_radius,
    )
    return Scene(
        name=name,
        camera=camera,
        objects=tuple(objects),
        lights=(square_lamp(size=light_size, height=LAMP_HEIGHT, radiosity=DIMMED),),
        animation=Animation(fps=float(FPS), frames=loop_frames(rev_per_s) if rev_per_s else 1, shutter=shutter),
    )


def _floor() -> Surface:
    s = HALF_SIDE
    return quad([(-s, 0, s), (s, 0, s), (s, 0, -s), (-s, 0, -s)], color=FLOOR_COLOR, material=DIFFUSE, name="floor")


ENTRIES = (
    SceneEntry(
        "soft-shadow",
        "slats over a floor under a square light: penumbrae that few shadow rays turn to noise",
        "soft_shadow",
        build_soft_shadow,
        {
            "light_size": Parameter(0.6, 0.02, 1.0, "float", "side of the light, world units"),
            "light_height": Parameter(3.0, 2.0, 6.0, "float", "of the light over the floor, world units"),
            "occluder_height": Parameter(0.5, 0.05, 1.0, "float", "of the slats over the floor, world units"),
            "slats": Parameter(4, 1, 8, "int", "number of slats"),
        },
    ),
    SceneEntry(
        "pixel-time-lens-light",
        "a turning rotor, its soft shadow, and a lens: all kinds of samples matter at once",
        "soft_shadow",
        build_pixel_time_lens_light,
        {
            "rev_per_s": Parameter(2.0, -30.0, 30.0, "float", "turns of the rotor per second"),
            "shutter": Parameter(0.5, 0.0, 1.0, "float", "open share of the frame interval"),
            "lens_radius": Parameter(0.12, 0.0, 0.3, "float", "radius of the lens, world units"),
            "light_size": Parameter(1.6, 0.02, 2.0, "float", "side of the light, world units"),
        },
    ),
)
