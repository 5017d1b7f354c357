"""A glass prism before bright slits: what is white beside it is a spectrum through it.

The camera looks straight (orthographic) through a right-angled wedge of glass at a dark screen with a white slit and a
white field on it. Rays meet the wedge's front at a right angle, go through unbent, and leave its slanted back by
Snell's law at sin(out) = n sin(`angle`): blue, for which n is larger, is bent farther than red, and every colour sees
the slit at another place. Look at the slit, which is drawn out into a band of colours, at the coloured borders of the
field, and at how few samples break the band into coloured noise; above the wedge slit and field are seen as they are.

`ior` and `abbe` are the glass's n_d and Abbe number V = (n_d - 1) / (n_F - n_C); the default is the flint SF10's. Its
band is about 6 of 256 pixels wide between the lines F and C alone; `abbe=10` is more than any glass has, and plainer.
The slit is set so that the middle colour is seen in the middle of the picture. No total reflection occurs in range.

The wedge is six flat faces, all wound outwards, of one glass. Nothing moves, and no facts are declared.
"""

import math

from aliasbench.scenes.entries import Parameter, SceneEntry
from aliasbench.scenes.model import Animation, Material, Scene, Surface, Vec3
from aliasbench.scenes.shapes import quad
from aliasbench.scenes.staging import FPS, flat_camera

FRONT_Z, SCREEN_Z = 0.5, -1.5
HALF_WIDTH = 0.6  # of the wedge, thin at its left side
THINNEST = 0.05
LOW, HIGH = -0.75, 0.4  # of the wedge
SLIT_WIDTH, FIELD_WIDTH = 0.025, 0.25
FIELD_SHIFT = 0.16  # from the slit's middle to the field's nearer side
SLIT_LOW, SLIT_HIGH = -0.65, 0.8
SCREEN_SIDE = 40.0
SCREEN_COLOR: Vec3 = (0.02, 0.02, 0.02)


def build_dispersion_prism(*, name: str, angle: float, ior: float, abbe: float) -> Scene:
    """Return the wedge of `angle` degrees before the screen; see the catalog for the parameters."""
    middle = landing(0.0, angle, ior)
    field = middle - FIELD_SHIFT - FIELD_WIDTH
    objects = (
        _upright(-SCREEN_SIDE, SCREEN_SIDE, -SCREEN_SIDE, SCREEN_SIDE, 0.0, SCREEN_COLOR, "screen"),
        _upright(middle - SLIT_WIDTH / 2, middle + SLIT_WIDTH / 2, SLIT_LOW, SLIT_HIGH, 1e-3, (1.0, 1.0, 1.0), "slit"),
        _upright(field, field + FIELD_WIDTH, SLIT_LOW, SLIT_HIGH, 1e-3, (1.0, 1.0, 1.0), "field"),
        *_wedge(angle, Material("glass", ior=ior, abbe=abbe)),
    )
    return Scene(name=name, camera=flat_camera(), objects=objects, animation=Animation(fps=float(FPS)))


def thickness(x: float, angle: float) -> float:
    """Return how thick a wedge of `angle` degrees is at x (world units)."""
    return THINNEST + (x + HALF_WIDTH) * math.tan(math.radians(angle))


def landing(x: float, angle: float, index: float) -> float:
    """Return the x at which a ray of the camera that meets the wedge at `x` meets the screen, for a refractive index.

    The back's outward normal leans by the wedge's angle a to its thin side, the left. The ray reaches it at a and
    leaves at a + d, sin(a + d) = n sin(a): bent by d to the thick side, the right.
    """
    slope = math.radians(angle)
    bent = math.asin(index * math.sin(slope)) - slope
    return x + (FRONT_Z - thickness(x, angle) - SCREEN_Z) * math.tan(bent)


def _wedge(angle: float, glass: Material) -> list[Surface]:
    """Return the wedge's faces, wound counter-clockwise as seen from outside."""
    left, right = -HALF_WIDTH, HALF_WIDTH
    a, b = FRONT_Z - thickness(left, angle), FRONT_Z - thickness(right, angle)
    corners = {
        "front": [(left, LOW, FRONT_Z), (right, LOW, FRONT_Z), (right, HIGH, FRONT_Z), (left, HIGH, FRONT_Z)],
        "back": [(right, LOW, b), (left, LOW, a), (left, HIGH, a), (right, HIGH, b)],
        "left": [(left, LOW, a), (left, LOW, FRONT_Z), (left, HIGH, FRONT_Z), (left, HIGH, a)],
        "right": [(right, LOW, FRONT_Z), (right, LOW, b), (right, HIGH, b), (right, HIGH, FRONT_Z)],
        "top": [(left, HIGH, FRONT_Z), (right, HIGH, FRONT_Z), (right, HIGH, b), (left, HIGH, a)],
        "bottom": [(left, LOW, a), (right, LOW, b), (right, LOW, FRONT_Z), (left, LOW, FRONT_Z)],
    }
    return [quad(points, material=glass, name=f"wedge {side}") for side, points in corners.items()]


def _upright(left: float, right: float, low: float, high: float, lift: float, color: Vec3, name: str) -> Surface:
    z = SCREEN_Z + lift
    return quad([(left, low, z), (right, low, z), (right, high, z), (left, high, z)], color=color, name=name)


ENTRIES = (
    SceneEntry(
        "dispersion-prism",
        "white slits seen through a glass wedge: refraction draws them out into spectra",
        "dispersion_prism",
        build_dispersion_prism,
        {
            "angle": Parameter(28.0, 5.0, 30.0, "float", "of the wedge, degrees"),
            "ior": Parameter(1.728, 1.2, 1.8, "float", "refractive index at 587.6 nm"),
            "abbe": Parameter(28.4, 10.0, 100.0, "float", "Abbe number: low is dispersive"),
        },
    ),
)
