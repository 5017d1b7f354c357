"""Depth: what is near hides what is far over ten million to one, and down to planes that nearly touch."""

import math
from dataclasses import replace

import numpy as np

from aliasbench.bench.hard.case import REFERENCE, HardCase, Verdict
from aliasbench.bench.hard.ladder import (
    DISTANCE_PX,
    FRAME,
    HALF_ULP,
    HERE,
    INSTANT,
    MIDDLE_S,
    SIZE,
    TURN,
    bound_of,
    ladder_scene,
    listed,
    misplacement,
    placed,
)
from aliasbench.bench.hard.painting import paint
from aliasbench.renderers.catalog import render
from aliasbench.scenes.model import Camera, Motion, Scene, as_vec3
from aliasbench.scenes.shapes import polygon


def _far_depths(subject: str) -> Verdict:
    """A ladder a thousandth of a unit away before one that is ten thousand away, the near one first and last."""
    found: dict[str, float] = {}
    bound, why, is_exact = 0.0, "", subject == REFERENCE
    for moving in (False, True):
        for order in (1, -1):
            near, far = (
                ladder_scene("perspective", at=as_vec3(-depth * TURN[:, 2]), unit=depth / DISTANCE_PX, moving=moving)
                for depth in (1e-3, 1e4)
            )
            # whole pixels aside when the shutter is half closed, so that edges are aligned again
            aside = Motion(as_vec3(TURN @ (2.0 * 1e4 / DISTANCE_PX, 1e2, 0.0) / MIDDLE_S)) if moving else Motion()
            # an exact picture is held to areas of flat polygons
            objects = [
                [replace(s, color=tint, motion=motion) for s in scene.objects if not (is_exact and s.texture)]
                for scene, tint, motion in ((near, (1.0, 0.5, 0.0), Motion()), (far, (0.0, 0.5, 1.0), aside))
            ][::order]
            scene = replace(near, objects=(*objects[0], *objects[1]), camera=replace(near.camera, velocity=HERE))
            name = f"{'moving' if moving else 'still'}, {'near' if order == 1 else 'far'} one first"
            frame = FRAME if moving else 0
            if is_exact:
                count = len(objects[0])
                halves = (*range(count),), (*range(count, 2 * count),)
                far_first = halves[1] + halves[0] if order == 1 else halves[0] + halves[1]
                found[name], own = _areas_apart(scene, frame, far_first)
                bound, why = max(bound, own), "its own bound, and 32 roundings of float64 of outlines up to 1000 px"
                continue
            found[name] = misplacement(subject, scene, frame)
            # in pixels both ladders are as far away
            allowed, why = bound_of(subject, ladder_scene("perspective"), 1.0)
            bound = max(bound, allowed)
    if is_exact:
        worst = max(found.values())
        return Verdict(worst, "contrast", bound, bound, why, note=listed(found))
    return placed(found, bound, why)


def _areas_apart(scene: Scene, frame: int, order: tuple[int, ...]) -> tuple[float, float]:
    """Return how far the exact picture is from areas painted over each other in an order, and how far it may be."""
    fraction = scene.animation.shutter / 2.0
    truth = paint(scene, SIZE, frame=frame, fraction=fraction, order=order).coverage()
    exact = render(scene, INSTANT, size=SIZE, frame=frame)
    return float(np.abs(exact.pixels - truth).max()), (exact.uncertainty or 0.0) + 32.0 * 2.0**-53 * 1e3


_TILT = 0.9  # radians, of planes seen at a slant
_APART = tuple(2.0**-k for k in (10, 14, 17, 19, 20, 21, 22, 23, 24, 25))
_ONE_PLANE = 1e-7  # of the scene's extent: planes nearer than that count as coplanar, and the later object wins


def _close_planes(subject: str) -> Verdict:
    """Two parallel planes 1e4 units away, facing and tilted, either drawn first: which separations are unresolved."""
    distance, worst, note = 1e4, 0.0, "every separation is resolved"
    for projection in ("orthographic", "perspective"):
        for tilt in (0.0, _TILT):
            for order in (1, -1):
                for apart in _APART:
                    pixels = render(
                        _two_planes(projection, distance, apart, tilt, order), subject, size=(24, 24)
                    ).pixels
                    if (pixels[..., 1] != 1.0).any() and apart > worst:
                        seen = f"{projection}, tilt {tilt:g}, {'near' if order == 1 else 'far'} plane first"
                        worst, note = apart, f"worst: {seen}"
    coplanar = 2.0 * _ONE_PLANE / math.cos(_TILT)
    why = "planes within 1e-7 of the scene's extent count as one"
    if subject == REFERENCE:
        return Verdict(worst, "of the distance", 0.0, coplanar, why, note=note)
    bound = coplanar + 2.0 * 8.0 * HALF_ULP / math.cos(_TILT)
    why += "; and either float32 depth takes 8 roundings of 2^-24"
    return Verdict(worst, "of the distance", 0.0, bound, why, note=note)


def _two_planes(projection: str, distance: float, apart: float, tilt: float, order: int) -> Scene:
    along, half = np.array([math.cos(tilt), 0.0, -math.sin(tilt)]), 0.4 * distance
    corners = half * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) @ np.stack([along, (0.0, 1.0, 0.0)])
    planes = [
        polygon((corners - (0.0, 0.0, depth)) @ TURN.T, color=color)
        for depth, color in ((distance, (0.0, 1.0, 0.0)), (distance * (1.0 + apart), (1.0, 0.0, 0.0)))
    ][::order]
    forward, up = as_vec3(-TURN[:, 2]), as_vec3(TURN[:, 1])
    if projection == "orthographic":
        camera = Camera("orthographic", HERE, forward, up, height=0.2 * distance)
    else:
        camera = Camera("perspective", HERE, forward, up, fov_y_deg=12.0)
    return Scene("planes", camera, tuple(planes))


CASES = (
    HardCase(
        "depth-range",
        "scale",
        "One ladder 1e-3 units from the camera, another 1e4 behind it; either drawn first, still and moving.",
        "The near one hides the far one, and every sample farther than the bound from an edge is right; a reference "
        "is the areas of flat strips by GEOS.",
        _far_depths,
    ),
    HardCase(
        "depth-close",
        "scale",
        "Two parallel planes 1e4 units away, 1e-3 to 3e-8 of that apart, facing and tilted, either drawn first.",
        "The largest distance between them, relative to that from the camera, at which the farther shows anywhere.",
        _close_planes,
    ),
)
