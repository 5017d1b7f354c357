"""A slowly turning fan of triangles much thinner than a pixel: they break up, and leave gaps.

Each points inwards and is between a fiftieth of a pixel and a pixel wide at its outer end (in a picture 256 high): in
truth a faint even line, brighter where it is wider. A point sample finds a row of dots with gaps instead, wherever a
pixel's centre happens to lie inside. Look at the dots running along the thin ones as the fan turns, and at thin ones
that are not there at all.

Widths grow around the fan in sixteen equal ratios and then begin anew, so that a fan of a multiple of sixteen has
turned into itself long before a whole turn; the frames hold a whole number of such steps (of turns, of other counts)
wherever the rate allows it within ten seconds. Nothing is declared: a line thinner than a pixel has no edge to measure.
"""

import numpy as np

from aliasbench.scenes.entries import Parameter, SceneEntry
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Animation, Motion, Scene, Spin
from aliasbench.scenes.shapes import mesh
from aliasbench.scenes.staging import FPS, flat_camera, loop_frames

WIDTHS = 16  # from the thinnest to the widest
INNER, OUTER = 0.12, 0.95  # radii, world units, of the tips and of the outer ends
PIXEL = 2.0 / 256  # world units
START_ANGLE = 0.031  # radians: none starts along a row or a column


def build_slivers(
    *, name: str, count: int, narrowest_px: float, widest_px: float, rev_per_s: float, shutter: float
) -> Scene:
    """Return `count` white slivers on black that turn about the picture's middle; see the catalog."""
    if narrowest_px > widest_px:
        raise InputError(
            f"scene 'slivers': parameter narrowest_px = {narrowest_px:g}: must not be more than widest_px, "
            f"{widest_px:g}"
        )
    k = np.arange(count)
    steps = max(1, min(WIDTHS, count) - 1)
    widths = PIXEL * narrowest_px * (widest_px / narrowest_px) ** (k % WIDTHS / steps)
    angles = START_ANGLE + 2 * np.pi * k / count
    outwards = np.stack([np.cos(angles), np.sin(angles), np.zeros(count)], axis=1)
    sideways = np.stack([-outwards[:, 1], outwards[:, 0], np.zeros(count)], axis=1)
    half = widths[:, None] / 2
    corners = np.stack(
        [INNER * outwards, OUTER * outwards - half * sideways, OUTER * outwards + half * sideways], axis=1
    )
    motion = Motion(spin=Spin((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), rev_per_s))
    repeats = count // WIDTHS if count % WIDTHS == 0 else 1
    return Scene(
        name=name,
        camera=flat_camera(),
        objects=(mesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3), motion=motion, name="slivers"),),
        animation=Animation(
            fps=float(FPS), frames=loop_frames(rev_per_s * repeats) if rev_per_s else 1, shutter=shutter
        ),
    )


ENTRIES = (
    SceneEntry(
        "slivers",
        "a slowly turning fan of triangles thinner than a pixel: they leave gaps",
        "slivers",
        build_slivers,
        {
            "count": Parameter(96, 3, 300, "int", "slivers in the fan"),
            "narrowest_px": Parameter(0.02, 0.001, 2.0, "float", "least width, in pixels of a picture 256 high"),
            "widest_px": Parameter(1.0, 0.001, 2.0, "float", "greatest width, in pixels of a picture 256 high"),
            "rev_per_s": Parameter(0.1, -10.0, 10.0, "float", "turns per second, counter-clockwise"),
            "shutter": Parameter(0.0, 0.0, 1.0, "float", "open share of the frame interval"),
        },
    ),
)
