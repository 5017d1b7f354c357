"""Straight edges, on which stairsteps are seen: one nearly along the pixel rows, and a fan at many angles.

`near-horizontal-edge` is the worst case: at slope 0.1 every stair is ten pixels long. The edge passes through the
middle of the picture; look at the stairs, and with `speed` at how they crawl. `edge-fan` has thick white wedges with
thin coloured ones between them, set so that some edges lie under two degrees from the rows and columns and others at
many angles between: look at how the stairs shorten towards the diagonal, and at thin wedges breaking up near the hub.

Both declare their edges: the half plane its only one; the fan those of the thick wedges, over the stretch where
neighbours are far enough away to be measured alone. All shapes go on far outside the picture.
"""

import math

import numpy as np

from aliasbench.scenes.entries import Parameter, SceneEntry
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Animation, EdgeFact, Facts, Motion, Scene, Spin, Surface, Vec3, as_vec3
from aliasbench.scenes.shapes import polygon, quad
from aliasbench.scenes.staging import FPS, LEAST_FRAMES, flat_camera, loop_frames, polar

REACH = 16.0  # world units from the middle to where the shapes end; the picture is 2 high
# At 18 wedges thick ones stand every 40 degrees and are 14.5 wide: modulo 90 their edges lie at 1.7, 6.2, 11.7, 16.2
# and so on up to 86.2 degrees, no two alike.
FAN_TILT_DEG = 8.95
THICK_SHARE, THIN_SHARE = 0.725, 0.15  # of the angle a wedge has to itself
MEASURED = (0.45, 0.9)  # radii between which the fan's edges are declared
THIN_COLORS: tuple[Vec3, ...] = ((1.0, 0.5, 0.0), (0.0, 0.8, 1.0), (1.0, 0.2, 0.8), (0.6, 1.0, 0.1))


def build_near_horizontal_edge(*, name: str, slope: float, offset: float, speed: float, shutter: float) -> Scene:
    """Return a white half plane above an edge of the given slope (dy/dx) through (0, offset); `speed` moves it up."""
    along = np.array([1.0, slope, 0.0]) / math.hypot(1.0, slope)
    across = np.array([-along[1], along[0], 0.0])
    middle = np.array([0.0, offset, 0.0])
    start, end = middle - REACH * along, middle + REACH * along
    plane = quad(
        [start, end, end + 2 * REACH * across, start + 2 * REACH * across],
        motion=Motion(velocity=(0.0, speed, 0.0)),
        name="half plane",
    )
    return Scene(
        name=name,
        camera=flat_camera(),
        objects=(plane,),
        animation=Animation(fps=float(FPS), frames=LEAST_FRAMES if speed else 1, shutter=shutter),
        facts=Facts(edges=(EdgeFact(as_vec3(start), as_vec3(end)),)),
    )


def build_edge_fan(*, name: str, wedges: int, rev_per_s: float, shutter: float) -> Scene:
    """Return `wedges` (even) wedges from the middle outwards, thick and thin in turn, turning at `rev_per_s`."""
    if wedges % 2:
        raise InputError(f"scene 'edge-fan': parameter wedges = {wedges}: must be even (thick and thin in turn)")
    motion = Motion(spin=Spin((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), rev_per_s)) if rev_per_s else Motion()
    objects: list[Surface] = []
    edges: list[EdgeFact] = []
    for k in range(wedges):
        thin = k % 2 == 1
        middle = 2 * math.pi * k / wedges + math.radians(FAN_TILT_DEG)
        half = math.pi / wedges * (THIN_SHARE if thin else THICK_SHARE)
        color = THIN_COLORS[k // 2 % len(THIN_COLORS)] if thin else (1.0, 1.0, 1.0)
        right, left = middle - half, middle + half
        objects.append(
            polygon(
                [(0.0, 0.0, 0.0), polar(REACH, right), polar(REACH, left)],
                color=color,
                motion=motion,
                name=f"{'thin' if thin else 'thick'} wedge {k}",
            )
        )
        if not thin:
            # Bright to the left: outwards along the right edge, inwards along the left one.
            inner, outer = MEASURED
            edges.append(EdgeFact(polar(inner, right), polar(outer, right)))
            edges.append(EdgeFact(polar(outer, left), polar(inner, left)))
    return Scene(
        name=name,
        camera=flat_camera(),
        objects=tuple(objects),
        animation=Animation(fps=float(FPS), frames=loop_frames(rev_per_s) if rev_per_s else 1, shutter=shutter),
        facts=Facts(edges=tuple(edges)),
    )


ENTRIES = (
    SceneEntry(
        "near-horizontal-edge",
        "one straight edge, nearly along the pixel rows: long stairsteps",
        "edges",
        build_near_horizontal_edge,
        {
            "slope": Parameter(0.1, -4.0, 4.0, "float", "rise over run of the edge"),
            "offset": Parameter(0.0, -1.0, 1.0, "float", "height of the edge at the middle, world units"),
            "speed": Parameter(0.0, -2.0, 2.0, "float", "upward pan of the edge, world units per second"),
            "shutter": Parameter(0.0, 0.0, 1.0, "float", "open share of the frame interval"),
        },
    ),
    SceneEntry(
        "edge-fan",
        "thick and thin wedges at many angles: where stairsteps are worst",
        "edges",
        build_edge_fan,
        {
            "wedges": Parameter(18, 4, 128, "int", "wedges in the circle, thick and thin in turn; even"),
            "rev_per_s": Parameter(0.0, -10.0, 10.0, "float", "turns per second of the whole fan"),
            "shutter": Parameter(0.0, 0.0, 1.0, "float", "open share of the frame interval"),
        },
    ),
)
