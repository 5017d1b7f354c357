"""Depth: what is near hides what is far over ten million to one, and down to planes that nearly touch."""

import math
from dataclasses import replace

import numpy as np

from aliasbench.bench.hard.case import RENDERERS, HardCase, Verdict
from aliasbench.bench.hard.ladder import (
    DISTANCE_PX,
    FRAME,
    HALF_ULP,
    HERE,
    MIDDLE_S,
    TURN,
    bound_of,
    ladder_scene,
    misplacement,
    placed,
)
from aliasbench.renderers.catalog import render
from aliasbench.scenes.model import Camera, Motion, Scene, as_vec3
from aliasbench.scenes.shapes import polygon


def _far_depths(subject: str) -> Verdict:
    """A ladder a thousandth of a unit away before one that is ten thousand away, the near one first and last."""
    found: dict[str, float] = {}
    bound, why = 0.0, ""
    for moving in (False, True):
        for order in (1, -1):
            near, far = (
                ladder_scene("perspective", at=as_vec3(-depth * TURN[:, 2]), unit=depth / DISTANCE_PX, moving=moving)
                for depth in (1e-3, 1e4)
            )
            middle_s = MIDDLE_S if moving else 0.0
            # whole pixels aside when the shutter is half closed, so that edges are aligned again
            aside = Motion(as_vec3(TURN @ (2.0 * 1e4 / DISTANCE_PX, 1e2, 0.0) / MIDDLE_S)) if moving else Motion()
            objects = [
                [replace(s, color=tint, motion=motion) for s in scene.objects]
                for scene, tint, motion in ((near, (1.0, 0.5, 0.0), Motion()), (far, (0.0, 0.5, 1.0), aside))
            ][::order]
            scene = replace(near, objects=(*objects[0], *objects[1]), camera=replace(near.camera, velocity=HERE))
            name = f"{'moving' if moving else 'still'}, {'near' if order == 1 else 'far'} one first"
            found[name] = misplacement(subject, scene, FRAME if middle_s else 0)
            # in pixels both ladders are as far away
            allowed, why = bound_of(subject, ladder_scene("perspective"), 1.0)
            bound = max(bound, allowed)
    return placed(found, bound, why)


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
    return Verdict(
        worst,
        "of the distance",
        0.0,
        coplanar + 2.0 * 8.0 * HALF_ULP / math.cos(_TILT),
        "planes within 1e-7 of the scene's extent count as one; and either float32 depth takes 8 roundings of 2^-24",
        note=note,
    )


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
        "The near one hides the far one, and every sample farther than the bound from an edge is right.",
        _far_depths,
        RENDERERS,
    ),
    HardCase(
        "depth-close",
        "scale",
        "Two parallel planes 1e4 units away, 1e-3 to 3e-8 of that apart, facing and tilted, either drawn first.",
        "The largest distance between them, relative to that from the camera, at which the farther shows anywhere.",
        _close_planes,
    ),
)
