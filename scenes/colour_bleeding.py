"""A room of coloured walls under a lamp: diffuse surfaces that light each other.

Three white sides (floor, back, block) stand between a red and a green wall under a square lamp. Light that goes on from
the coloured walls tints what is white near them: the block's sides, the floor along the walls; and it fills shadows
that direct light leaves black. Look at the block's shaded sides and its shadow, and at the noise of few samples there.

The room is open to the viewer and to the sky, which is black, so that nothing but the lamp gives light. `reflectance`
is the share that white and the walls' own colours give back: the share of light that bounces k times goes as its k-th
power. One bounce is drawn; with `bounces=0`, direct light alone, the same room has black shadows and no tint, and with
`reflectance=0` nothing but the lamp is seen. All stands still, and no facts are declared.
"""

from aliasbench.scenes.entries import Parameter, SceneEntry
from aliasbench.scenes.lamps import square_lamp
from aliasbench.scenes.model import Animation, Camera, Material, Scene, Surface, Vec3
from aliasbench.scenes.motion import rotation_matrix
from aliasbench.scenes.shapes import quad
from aliasbench.scenes.staging import FPS

DIFFUSE = Material("diffuse")
HALF = 1.0  # of the room's sides
EYE: Vec3 = (0.0, 1.0, 4.2)
TARGET: Vec3 = (0.0, 0.95, 0.0)
FOV_Y_DEG = 34.0
LAMP_HEIGHT = 1.9
BRIGHTNESS = 0.5  # radiance of a white floor under the lamp, by direct light alone
WHITE, RED, GREEN = (1.0, 1.0, 1.0), (1.0, 0.08, 0.05), (0.1, 0.8, 0.12)
BLOCK_TURNS = 0.05
BLOCK_MIDDLE: Vec3 = (0.25, 0.0, -0.15)
BLOCK_HALF, BLOCK_HEIGHT = 0.3, 0.65


def build_colour_bleeding(*, name: str, light_size: float, reflectance: float, bounces: int) -> Scene:
    """Return the room with a lamp of side `light_size` and walls that give back `reflectance` of their colours."""
    h, top = HALF, 2 * HALF
    sides: list[tuple[str, Vec3, list[Vec3]]] = [
        ("floor", WHITE, [(-h, 0.0, h), (h, 0.0, h), (h, 0.0, -h), (-h, 0.0, -h)]),
        ("back", WHITE, [(-h, 0.0, -h), (h, 0.0, -h), (h, top, -h), (-h, top, -h)]),
        ("left", RED, [(-h, 0.0, h), (-h, 0.0, -h), (-h, top, -h), (-h, top, h)]),
        ("right", GREEN, [(h, 0.0, -h), (h, 0.0, h), (h, top, h), (h, top, -h)]),
        *_block(),
    ]
    return Scene(
        name=name,
        camera=Camera(projection="perspective", position=EYE, target=TARGET, fov_y_deg=FOV_Y_DEG),
        objects=tuple(_wall(side, color, corners, reflectance) for side, color, corners in sides),
        lights=(square_lamp(size=light_size, height=LAMP_HEIGHT, radiosity=BRIGHTNESS),),
        bounces=bounces,
        animation=Animation(fps=float(FPS)),
    )


def _wall(side: str, color: Vec3, corners: list[Vec3], reflectance: float) -> Surface:
    red, green, blue = (reflectance * c for c in color)
    return quad(corners, color=(red, green, blue), material=DIFFUSE, name=side)


def _block() -> list[tuple[str, Vec3, list[Vec3]]]:
    """Return the sides of a block on the floor, turned about its axis, wound outwards; it has no underside."""
    turned = rotation_matrix((0.0, 1.0, 0.0), BLOCK_TURNS)
    s = BLOCK_HALF
    ring = []
    for x, z in ((-s, s), (s, s), (s, -s), (-s, -s)):
        a = turned @ (x, 0.0, z) + BLOCK_MIDDLE
        ring.append((float(a[0]), float(a[2])))
    sides = [("block top", WHITE, [(x, BLOCK_HEIGHT, z) for x, z in ring])]
    for k, (x, z) in enumerate(ring):
        u, w = ring[(k + 1) % 4]
        sides.append((f"block side {k}", WHITE, [(x, 0.0, z), (u, 0.0, w), (u, BLOCK_HEIGHT, w), (x, BLOCK_HEIGHT, z)]))
    return sides


ENTRIES = (
    SceneEntry(
        "colour-bleeding",
        "a room with a red and a green wall under a lamp: diffuse surfaces tint each other",
        "colour_bleeding",
        build_colour_bleeding,
        {
            "light_size": Parameter(0.6, 0.05, 1.5, "float", "side of the lamp, world units"),
            "reflectance": Parameter(0.8, 0.0, 0.95, "float", "share of light that white walls give back"),
            "bounces": Parameter(
                1, 0, 1, "int", "0 leaves direct light alone, 1 adds light from one surface to another"
            ),
        },
    ),
)
