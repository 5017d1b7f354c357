"""Motion that must not show: none at all, hardly any, and that of a camera along with what it looks at, much later."""

import math
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from aliasbench.bench.hard.case import REFERENCE, TRACERS, HardCase, Verdict, samples_key, with_keys
from aliasbench.bench.hard.passing import (
    BLADE,
    COMB,
    FPS,
    IDENTITY,
    OPEN,
    SIZE,
    find_misses,
    judge_places,
    largest_error,
    one_polygon,
    spin_about,
    turned,
)
from aliasbench.renderers.catalog import render
from aliasbench.scenes.model import Animation, Camera, Motion


def _same(
    subject: str, variants: Sequence[tuple[str, Motion, Animation, str, int]], why: str, moved: float = 0.0
) -> Verdict:
    """Return the verdict on pictures that must be the still one's, but for edges that moved by so many pixels."""
    keys = "" if subject == REFERENCE else "spp=16" if subject in TRACERS else "passes=16"
    worst, stated, note = 0.0, 0.0, "the same in all ways of not moving"
    for name, motion, animation, more, frame in variants:
        text = with_keys(subject, ",".join(k for k in (keys, more) if k))
        still, shown = (
            render(one_polygon(BLADE, m, animation), t, size=SIZE, frame=frame)
            for m, t in ((Motion(), with_keys(subject, keys)), (motion, text))
        )
        figure = largest_error(shown.pixels, still.pixels)
        if subject != REFERENCE:
            figure = float(np.count_nonzero(np.any(shown.pixels != still.pixels, axis=-1)))
        stated = max(stated, shown.uncertainty or 0.0)
        if not figure <= worst:
            worst, note = figure, name
    if subject != REFERENCE:
        return Verdict(worst, "pixels", 0.0, 0.0, why, note=note)
    allowed = max(stated, 1e-12) + moved
    reason = (
        f"the bound of {stated:.1e} that the reference states{f', and edges moved by {moved:g} px' if moved else ''}"
    )
    return Verdict(worst, "contrast", allowed, allowed, reason, note=note)


CLOSED = replace(OPEN, shutter=0.0)
NEARLY_CLOSED = replace(OPEN, shutter=1e-12)
STILL = (
    ("velocity 0", Motion(velocity=(0.0, 0.0, 0.0)), OPEN, "", 7),
    ("0 rev/s", spin_about(0.0), OPEN, "", 7),
    ("two equal matrices", Motion(matrices=(IDENTITY, IDENTITY)), OPEN, "", 7),
    ("shutter 0, 29 rev/s", spin_about(29.0), CLOSED, "", 0),
    ("shutter 0, a turn a frame", spin_about(FPS), CLOSED, "", 7),
    ("a whole turn between two matrices", spin_about(FPS), OPEN, "motion=matrix", 0),
    ("a whole turn between two matrices, later", spin_about(-3 * FPS), OPEN, "motion=matrix", 7),
)
HARDLY = (
    ("shutter 1e-12, 29 rev/s", spin_about(29.0), NEARLY_CLOSED, "", 0),
    ("shutter 1e-12, 100 px a frame", Motion(velocity=(3000.0, 0.0, 0.0)), NEARLY_CLOSED, "", 0),
    ("1e-300 rev/s", spin_about(1e-300), OPEN, "", 7),
    ("1e-300 units/s", Motion(velocity=(1e-300, 0.0, 0.0)), OPEN, "", 7),
)


def _no_motion(subject: str) -> Verdict:
    return _same(subject, STILL, "nothing moves, so every sample sees what it sees of the still scene")


def _hardly_any(subject: str) -> Verdict:
    # 100 px in a frame, of which the shutter is open for 1e-12; along a side of at most sqrt(2) px
    return _same(subject, HARDLY, "a motion of 1e-10 px at most, and no sample is as near to an edge", 2e-10)


REACH_PX = 17.0  # of the comb's corners from where it turns
LATE = ((29.3, 1_000_000), (29.3, 3_000_000), (0.0123, 3_000_000), (-4321.7, 2_999_999))


def _late_spin(subject: str) -> Verdict:
    """A million frames later."""
    misses, worst, drift = [], 0.0, 0.0
    for rate, frame in LATE:
        # turned back by as much, so that the comb is upright when it is looked at
        first = turned(COMB, -(Fraction(rate) / Fraction(FPS) * frame))
        # the rate in turns a frame and its product with the frame are rounded once each, half an ulp
        drift = max(drift, 2 * math.pi * abs(rate / FPS * frame) * 2 * 2.0**-53 * REACH_PX)
        if subject == REFERENCE:
            shown, truth = (
                render(one_polygon(outline, motion, CLOSED), subject, size=SIZE, frame=frame).pixels
                for outline, motion in ((first, spin_about(rate)), (COMB, Motion()))
            )
            worst = max(worst, largest_error(shown, truth))
        else:
            pixels = render(
                one_polygon(first, spin_about(rate), CLOSED), samples_key(subject, 1), size=SIZE, frame=frame
            ).pixels
            misses.append(find_misses(pixels, SIZE, [COMB]))
    why = f"float64 keeps the phase of the turns so far to {drift:.1e} px at {REACH_PX:g} px"
    if subject != REFERENCE:
        return judge_places(subject, misses, 32.0, why, drift)
    # two upright edges may cross one pixel, along little more than 1 px each
    allowed = 2.0 * 1.01 * drift + 1e-12
    return Verdict(worst, "contrast", allowed, allowed, why)


def _late_flight(subject: str) -> Verdict:
    """A camera and what it follows, 1e8 units from where they began."""
    velocity, frame = (1000.5, -300.25, 7.125), 3_000_000
    size, scale = SIZE, SIZE[1] / 2 / math.tan(math.radians(25.0)) / 10.0  # px a unit in the polygon's plane
    camera = Camera("perspective", position=(0.0, 0.0, 10.0), fov_y_deg=50.0, velocity=velocity)
    outline = COMB / scale
    scene = one_polygon(outline, Motion(velocity=velocity), CLOSED, camera)
    reach = float(np.linalg.norm(velocity)) * frame / FPS
    drift = scale * reach * 2 * 2.0**-53  # v t of the camera, and the places of both relative to each other
    if subject == REFERENCE:
        late, first = (render(scene, subject, size=size, frame=n).pixels for n in (frame, 0))
        allowed = 3 * drift
        why = f"half an ulp of float64 at {reach:.1e} units, twice, is {drift:.1e} px; at most two edges in a pixel"
        return Verdict(largest_error(late, first), "contrast", allowed, allowed, why)
    pixels = render(scene, samples_key(subject, 1), size=size, frame=frame).pixels
    miss = find_misses(pixels, size, [outline * scale])
    return judge_places(
        subject, [miss], 32.0, f"half an ulp of float64 at {reach:.1e} units, twice: {drift:.1e} px", drift
    )


CASES = (
    HardCase(
        "no-motion",
        "motion",
        "Motion of length zero: velocity 0, 0 rev/s, equal matrices, shutter 0, whole turns between matrices.",
        "The picture equals the still scene's, bit for bit (the reference's within the bound that it states).",
        _no_motion,
    ),
    HardCase(
        "hardly-any-motion",
        "motion",
        "Shutters of 1e-12 of the frame, rates of 1e-300.",
        "The picture equals the still scene's, bit for bit (the reference's within the bound that it states).",
        _hardly_any,
    ),
    HardCase(
        "late-spin",
        "motion",
        "A comb up to 1e5 seconds and 4e8 turns after the start.",
        "Samples see it at the phase that exact fractions give; the reference equals that of the turned outline.",
        _late_spin,
    ),
    HardCase(
        "late-flight",
        "motion",
        "A camera and what it follows at 1000 units a second, after 1e5 seconds.",
        "They are seen as in the first frame.",
        _late_flight,
    ),
)
