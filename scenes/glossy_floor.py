"""A glossy floor under bright panels: reflections that are sharp where things stand and blur with the distance.

Striped panels stand on a floor of GGX roughness `roughness` (alpha). Where a panel meets the floor its reflection is
sharp at any roughness; the higher up the panel, the wider the lobe that has to be averaged, so one sample a pixel gives
noise that grows towards the viewer. Look at the stripes' reflections, which run together at a distance that halves as
the roughness doubles, and at the lone lozenge that floats: of it there is nothing but a blurred image.

The panels are unlit (they shine by themselves) and there is no other light. They face the camera; mirrored at the
floor (y to -y) they lie in the picture, on the floor's part of it. All stands still, and no facts are declared.
"""

from aliasbench.scenes.entries import Parameter, SceneEntry
from aliasbench.scenes.model import Animation, Camera, Material, Scene, Surface, Vec3
from aliasbench.scenes.shapes import polygon, quad
from aliasbench.scenes.staging import FPS

EYE: Vec3 = (0.0, 1.1, 3.6)
TARGET: Vec3 = (0.0, 0.05, 0.0)
FOV_Y_DEG = 40.0
HALF_SIDE = 30.0
NEAR_Z, FAR_Z = 3.0, -30.0
FLOOR_COLOR: Vec3 = (0.85, 0.85, 0.85)
SKY: Vec3 = (0.05, 0.06, 0.08)
STRIPES = 6  # to a panel, every other one of them dark
DARK = 0.06
# Left end, width, height, depth and colour.
PANELS: tuple[tuple[float, float, float, float, Vec3], ...] = (
    (-1.15, 0.7, 0.75, -0.25, (1.0, 0.35, 0.2)),
    (0.35, 0.8, 0.6, 0.0, (0.3, 0.7, 1.0)),
)
LOZENGE_MIDDLE: Vec3 = (-0.1, 0.55, 0.2)
LOZENGE_RADIUS = 0.12


def build_glossy_floor(*, name: str, roughness: float) -> Scene:
    """Return the panels on a floor of the given roughness (GGX alpha)."""
    s = HALF_SIDE
    floor = quad(
        [(-s, 0, NEAR_Z), (s, 0, NEAR_Z), (s, 0, FAR_Z), (-s, 0, FAR_Z)],
        color=FLOOR_COLOR,
        material=Material("glossy", roughness=roughness),
        name="floor",
    )
    x, y, z = LOZENGE_MIDDLE
    r = LOZENGE_RADIUS
    lozenge = polygon([(x - r, y, z), (x, y - r, z), (x + r, y, z), (x, y + r, z)], name="lozenge")
    return Scene(
        name=name,
        camera=Camera(projection="perspective", position=EYE, target=TARGET, fov_y_deg=FOV_Y_DEG),
        objects=(floor, *(stripe for panel in PANELS for stripe in _stripes(*panel)), lozenge),
        background=SKY,
        animation=Animation(fps=float(FPS)),
    )


def _stripes(left: float, width: float, height: float, z: float, color: Vec3) -> list[Surface]:
    """Return a panel of upright stripes, bright and dark in turn."""
    step = width / STRIPES
    dark = (DARK * color[0], DARK * color[1], DARK * color[2])
    return [
        quad(
            [(a, 0.0, z), (a + step, 0.0, z), (a + step, height, z), (a, height, z)],
            color=dark if k % 2 else color,
            name=f"stripe {k} at {left:g}",
        )
        for k in range(STRIPES)
        for a in (left + k * step,)
    ]


ENTRIES = (
    SceneEntry(
        "glossy-floor",
        "bright striped panels on a glossy floor: reflections blur with distance and go noisy",
        "glossy_floor",
        build_glossy_floor,
        {"roughness": Parameter(0.1, 0.001, 1.0, "float", "GGX alpha of the floor")},
    ),
)
