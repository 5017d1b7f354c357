"""A propeller before a camera of 30 frames a second: strobing, the wagon wheel.

At 1 rev/s a blade moves 12 degrees a frame and is seen to; at 30 rev/s every frame is the same picture; at 29 rev/s the
blades creep backwards. Look at the direction in which they seem to turn, and with an open shutter at how blur takes the
false motion away. `propeller-1`, `propeller-29` and `propeller-30` are these three; all else is the same.

Blades are sectors with radial edges only, from inside the annulus that the metrics look at to outside of it (their
outer arcs are polylines within 1/500 of the radius, their inner ends straight): in the annulus a blade is the same
share of the circle at every radius, for which the strobing metrics have closed forms. The rotor is declared. The frames
are a whole number of turns wherever the rate allows it within ten seconds.
"""

import math

from aliasbench.scenes.entries import Parameter, SceneEntry
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Animation, Facts, Motion, RotorFact, Scene, Spin
from aliasbench.scenes.shapes import polygon
from aliasbench.scenes.staging import FPS, flat_camera, loop_frames, polar

START_ANGLE = 0.2  # radians: no edge starts along a row or a column
CHORD_ERROR = 1 / 500  # of the outer radius, which the arc's chords may come inside it
HUB_SHARE, TIP_SHARE = 0.5, 1.08  # of the annulus' inner and outer radius: where blades begin and end


def build_propeller(
    *, name: str, blades: int, rev_per_s: float, duty: float, shutter: float, inner: float, outer: float
) -> Scene:
    """Return white blades on black that turn about the picture's middle; see the catalog for the parameters."""
    if inner >= outer:
        raise InputError(
            f"scene {name.partition(':')[0]!r}: parameter inner = {inner:g}: must be less than outer, {outer:g}"
        )
    axis, center = (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
    motion = Motion(spin=Spin(axis, center, rev_per_s))
    width = 2 * math.pi * duty / blades
    steps = math.ceil(width / (2 * math.acos(1 - CHORD_ERROR)))
    hub, tip = HUB_SHARE * inner, TIP_SHARE * outer
    objects = []
    for k in range(blades):
        first = START_ANGLE + 2 * math.pi * k / blades
        arc = [polar(tip, first + width * i / steps) for i in range(steps + 1)]
        ends = [polar(hub, first + width), polar(hub, first)]
        objects.append(polygon([*arc, *ends], motion=motion, name=f"blade {k}"))
    return Scene(
        name=name,
        camera=flat_camera(),
        objects=tuple(objects),
        animation=Animation(fps=float(FPS), frames=loop_frames(rev_per_s), shutter=shutter),
        facts=Facts(rotors=(RotorFact(center, axis, blades, duty, rev_per_s, inner, outer),)),
    )


def _entry(name: str, summary: str, rev_per_s: float) -> SceneEntry:
    """Return the propeller under a name of its own, with the rate that it has unless another is asked for."""
    return SceneEntry(
        name,
        summary,
        "propeller",
        build_propeller,
        {
            "blades": Parameter(3, 1, 60, "int", "number of blades"),
            "rev_per_s": Parameter(rev_per_s, -1000.0, 1000.0, "float", "turns per second, counter-clockwise"),
            "duty": Parameter(0.5, 0.05, 0.95, "float", "bright share of the circle"),
            "shutter": Parameter(0.0, 0.0, 1.0, "float", "open share of the frame interval"),
            "inner": Parameter(0.3, 0.1, 0.8, "float", "inner radius of the metrics' annulus, world units"),
            "outer": Parameter(0.85, 0.2, 0.9, "float", "outer radius of the metrics' annulus, world units"),
        },
    )


ENTRIES = (
    _entry("propeller", "blades that turn too fast for the frame rate: they stand still or run backwards", 1.0),
    _entry("propeller-1", "a propeller of one turn a second: 12 degrees a frame, as it should be", 1.0),
    _entry("propeller-29", "a propeller of 29 turns a second: at 30 frames it runs slowly backwards", 29.0),
    _entry("propeller-30", "a propeller of 30 turns a second: at 30 frames it stands still", 30.0),
)
