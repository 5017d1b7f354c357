"""Frame numbers up to the largest: time is a product of the frame's number, and must not lose the picture's bits."""

from fractions import Fraction

import numpy as np

from aliasbench.bench.hard.case import REFERENCE, HardCase, Verdict, samples_key, with_keys
from aliasbench.bench.hard.passing import COMB, SIZE, turned
from aliasbench.bench.hard.triangles import (
    coverage_error,
    grid_offsets,
    in_pixels,
    least_misplacement,
    misplaced_px,
    misplaced_why,
)
from aliasbench.renderers.catalog import prepare, render
from aliasbench.scenes.model import Animation, Camera, Motion, Scene, Spin, Surface
from aliasbench.scenes.shapes import polygon

LATE = (4 * 10**9, 2**53 - 4, 2**53)


def _late_frames(subject: str) -> Verdict:
    """A rotor of one turn in four frames: frame 4 n is frame 0, however large n."""
    size = (16, 12)
    spinning = Motion(spin=Spin((0.0, 0.0, 1.0), (0.5, 0.25, 0.0), 1.0))
    blade = polygon([(0.5, 0.25, 0.0), (7.3, -0.8, 0.0), (7.1, 2.9, 0.0)], motion=spinning)
    camera = Camera("orthographic", height=float(size[1]))
    scene = Scene("hard", camera, (blade,), animation=Animation(4.0, 4, 0.5))
    key = "" if subject == REFERENCE else "reseed=never"
    many = with_keys(subject, key) if subject == REFERENCE else samples_key(subject, 8, key)
    with prepare(scene, many, size=size) as prepared:
        first = prepared.render(frame=0).pixels
        if not np.abs(prepared.render(frame=1).pixels - first).max() > 0.5:
            return Verdict(1.0, "contrast", 0.0, 0.0, "the rotor must turn", note="frame 1 looks like frame 0")
        worst = max(float(np.abs(prepared.render(frame=late).pixels - first).max()) for late in LATE)
    why = "n / fps and whole turns are exact in float64 for fps = 4 and n up to 2^53"
    return Verdict(worst, "contrast", 0.0, 0.0, why, note=f"frames {', '.join(map(str, LATE))} against frame 0")


def _late_turns(subject: str) -> Verdict:
    """Turns that are no binary fraction of a frame, late: the angle is known in whole numbers."""
    size, frame = SIZE, 10**9 + 7
    turns = Fraction(235 * frame % 300, 300)
    corners = np.c_[turned(COMB, -turns), np.zeros(len(COMB))]
    spin = Spin((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 23.5)
    camera, animation = Camera("orthographic", height=float(size[1])), Animation(30.0, 1, 0.0)
    moving = Scene("hard", camera, (polygon(corners, motion=Motion(spin=spin)),), animation=animation)
    still = Scene("hard", camera, (polygon(np.c_[COMB, np.zeros(len(COMB))]),))
    reach = float(np.linalg.norm(corners, axis=1).max())
    # the turns of one frame are rounded once, by up to half of 2^-53 of them, and multiplied by the frame's number
    drift = 2.0 * np.pi * reach * frame * (23.5 / 30.0) * 2.0**-53
    pixels = render(moving, subject, size=size, frame=frame)
    why = f"turns a frame have 53 bits: {drift:.1e} px at frame {frame}"
    if subject == REFERENCE:
        error = coverage_error(pixels.pixels, still, size)
        bound = 2.0 * 1.01 * drift + (pixels.uncertainty or 0.0) + 8.0 * size[0] * size[1] * 2.0**-52
        return Verdict(error, "contrast", bound, bound, f"{why}, along two upright edges in a pixel")
    worst = least_misplacement(pixels.pixels, still, size, grid_offsets(1))
    return Verdict(worst, "px", drift, drift + misplaced_px(subject, size), f"{why}; {misplaced_why(subject)}")


def _late_flight(subject: str) -> Verdict:
    """Camera and object fly along together for a billion frames: float32 sees only what is near."""
    size, frame = SIZE, 10**9
    shape = polygon(np.c_[COMB, np.zeros(len(COMB))])
    flying = Surface(shape.vertices, shape.triangles, motion=Motion((3.0, 1.0, 0.0)))
    camera = Camera("orthographic", height=float(size[1]), velocity=(3.0, 1.0, 0.0))
    scene = Scene("hard", camera, (flying,), animation=Animation(1.0, 1, 0.0))
    frame_of = render(scene, subject, size=size, frame=frame)
    drift = 2.0**0.5 * 3.0 * 2.0**-22  # of both, and their difference: half a step of float64 at 3e9 is 2^-22
    why = "float64 at 3e9 units resolves 2^-22 units, a unit is a pixel"
    still = in_pixels(size, shape)
    if subject == REFERENCE:
        bound = 2.0 * 1.01 * drift + (frame_of.uncertainty or 0.0)
        return Verdict(coverage_error(frame_of.pixels, still, size), "contrast", bound, bound, why)
    worst = least_misplacement(frame_of.pixels, still, size, grid_offsets(1))
    return Verdict(worst, "px", drift, drift + misplaced_px(subject, size), f"{why}; {misplaced_why(subject)}")


CASES = (
    HardCase(
        "late-periods",
        "sizes",
        "A rotor that turns once in four frames, at frames 4e9 and 2^53.",
        "Every fourth frame is the first one, bit for bit.",
        _late_frames,
    ),
    HardCase(
        "late-turns",
        "sizes",
        "A comb at 23.5 rev/s and 30 frames/s, a billion frames later.",
        "Samples have the owners that the angle, reckoned in whole numbers, gives them.",
        _late_turns,
    ),
    HardCase(
        "latest-flight",
        "sizes",
        "Camera and object fly side by side for a billion frames, 3e9 pixels far.",
        "The picture is that of frame 0.",
        _late_flight,
    ),
)
