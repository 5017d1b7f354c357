"""Edges that pass samples while they move by whole pixels: at each instant, and while the shutter is open."""

from dataclasses import replace

import numpy as np

from aliasbench.bench.hard.case import RASTERS, REFERENCE, HardCase, Verdict, with_keys
from aliasbench.bench.hard.edge_pictures import (
    DEPTH,
    EXACT,
    FINEST,
    FPS,
    REFERENCE_ROUNDING,
    Look,
    Stage,
    edge_bound,
    misplacements,
    stages,
    worst_of,
)
from aliasbench.bench.hard.edges import COVERED, SAMPLED, WHITE, bars, seams, surfaces
from aliasbench.bench.hard.ownership import pixel_points
from aliasbench.renderers.catalog import prepare, render
from aliasbench.scenes.model import Animation, Camera, FloatArray, Motion, as_vec3


def _whole_pixel_motion(subject: str) -> Verdict:
    size = (64, 4)
    steps = [sign * 2.0**-k for k in (6, 9, 10, 14, 17, 19, 21, 23) for sign in (1.0, -1.0)]
    look = Look(WHITE, bars([0.0, 0.0, *steps], size[1], upright=True))
    return worst_of([_moving_bars(subject, s, look, np.array([3.0, 0.0])) for s in stages(size) if not s.moving])


def _moving_bars(subject: str, stage: Stage, look: Look, step: FloatArray) -> Verdict:
    view = stage.view
    velocity = as_vec3(view.right * step[0] * (DEPTH if view.perspective else 1.0) / view.scale * FPS)
    objects = [replace(s, motion=Motion(velocity=velocity)) for s in surfaces(stage, [look])]
    scene = replace(stage.scene(*objects), animation=Animation(FPS, 8, 0.0))
    open_scene = replace(scene, animation=Animation(FPS, 8, 1.0))
    frames = range(1, 6)

    def at(frames_passed: float) -> Look:
        return Look(look.color, [o + step * frames_passed for o in look.outlines])

    if subject == REFERENCE:
        error, certified = 0.0, 0.0
        for frame in frames:
            shown = render(open_scene, subject, size=stage.size, frame=frame)
            pixels, certified = shown.pixels[..., 0], max(certified, shown.uncertainty or 0.0)
            truth = sum(_swept(o[:, 0] + step[0] * frame, step[0], stage.size[0]) for o in look.outlines)
            error = max(error, float(np.abs(pixels - truth).max()))
        why = "what bars cover while they move is known in closed form; the reference certifies its own error"
        bound = max(certified, REFERENCE_ROUNDING)
        return Verdict(error, "contrast", REFERENCE_ROUNDING, bound, why, note=f"{stage.name}, open shutter")
    from aliasbench.renderers.sampling.patterns import sample_set

    worst, shifted, leaks = 0.0, 0, seams(subject, stage, surfaces(stage, [look]))
    with prepare(scene, subject, size=stage.size) as prepared:
        first = prepared.render(frame=0).pixels
        for frame in frames:
            pixels = prepared.render(frame=frame).pixels
            moved = [leak + step * frame for leak in leaks]
            worst = max(worst, float(misplacements(pixels, pixel_points(stage.size), [at(frame)], moved).max()))
            by = int(step[0]) * frame
            shifted += int((pixels[:, by:] != first[:, :-by]).any(axis=-1).sum())
    keys = "sampler=random" if subject in RASTERS else "sampler=random,pattern=shared"
    with prepare(open_scene, with_keys(subject, keys), size=stage.size) as prepared:
        for seed in range(32):
            x, y, time = sample_set("random", 1, seed=seed, frame=2)[0, :3]
            pixels = prepared.render(frame=2, seed=seed).pixels
            moved = [leak + step * (2 + time) for leak in leaks]
            away = misplacements(pixels, pixel_points(stage.size, x, y), [at(2 + time)], moved)
            worst = max(worst, float(away.max()))
    if camera_is_exact(stage.camera) and shifted:
        worst = max(worst, FINEST)
    extent = float(stage.size[0] + 8 * step[0])
    bound, why = edge_bound(subject, stage, objects, extent=extent, aligned=True)
    note = f"{stage.name}; {shifted} samples differ from the first frame's, shifted"
    return Verdict(worst, "px", EXACT, max(bound, EXACT), why, note=note)


def camera_is_exact(camera: Camera) -> bool:
    """Return whether a whole pixel is a number that float32 holds."""
    return camera.projection == "orthographic" and camera.height == float(int(camera.height or 0))


def _swept(columns: FloatArray, travel: float, width: int) -> FloatArray:
    """Return (width,): mean over the frame of what a bar between the extreme columns covers while it moves `travel`."""

    def covered_twice(x: FloatArray) -> FloatArray:
        return np.maximum(x, 0.0) ** 2 / 2.0

    # the area left of x of a half plane that begins at b, averaged over b in [a, a + travel]: second differences
    left = np.arange(width, dtype=np.float64)
    out = np.zeros(width)
    for a, sign in ((columns.min(), 1.0), (columns.max(), -1.0)):
        for x, way in ((left + 1.0, 1.0), (left, -1.0)):
            out += sign * way * (covered_twice(x - a) - covered_twice(x - a - travel)) / travel
    return out


CASES = (
    HardCase(
        "whole-pixel-motion",
        "edges",
        "Edges beside pixel centres move by exactly 3 px a frame, at the instant and with the shutter open.",
        f"{SAMPLED} Where a pixel is a whole number each frame is the first one, shifted; {COVERED}",
        _whole_pixel_motion,
    ),
)
