"""References of flat-coloured scenes: exact at an instant, certified over an open shutter."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.reference.coverage import cover_rows
from aliasbench.renderers.reference.faces import Faces
from aliasbench.renderers.reference.paths import Paths
from aliasbench.renderers.reference.pieces import Pieces, join_pieces, pieces_at
from aliasbench.renderers.reference.rotor import draw_rotor
from aliasbench.renderers.reference.shutter import bound_crossings, bound_edges
from aliasbench.renderers.reference.sweeps import bound_sweeps
from aliasbench.renderers.reference.turning import find_rotor, still_faces
from aliasbench.scenes.model import FloatArray, Scene
from aliasbench.scenes.projection import View, view_at

TARGET = 1e-5  # the bound aimed at over an open shutter
ROUNDING = 1e-12  # what a pixel of an exact picture may be off, relative to the largest colour
_PILOT, _SECOND_PILOT = 16, 256
_MOST_SLICES = 8192
_CHUNK = 32
_BAND = 16
# Prices in nanoseconds, measured; they choose the number of slices, so they are constants and not clocks.
_PIXEL_COST, _CELL_COST, _FACE_COST, _BUDGET = 12.0, 900.0, 1500.0, 4e9

Answer = TypeVar("Answer")


@dataclass(frozen=True, slots=True, eq=False)
class Integral:
    """A picture (h, w, 3), and for every pixel a bound on its error (h, w)."""

    pixels: FloatArray
    bound: FloatArray


def over_bands(draw: Callable[[NDArray[np.int64]], Answer], height: int) -> list[Answer]:
    """Call `draw` for bands of rows, (first, last + 1), on all cores; the bands do not depend on their number."""
    bands = [np.array([r, min(r + _BAND, height)], np.int64) for r in range(0, height, _BAND)]
    # below a few bands starting threads costs more than they gain
    threads = min(
        len(bands) // 4, len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    )
    if threads <= 1:
        return [draw(b) for b in bands]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(draw, bands))


def palette(scene: Scene) -> FloatArray:
    """Return the objects' colours and the background's, (n + 1, 3)."""
    return np.array([*(o.color for o in scene.objects), scene.background], dtype=np.float64).reshape(-1, 3)


def scene_extent(scene: Scene) -> float:
    """Return the size of the scene with its camera, for what counts as one depth."""
    points = [np.abs(o.vertices).max() for o in scene.objects if len(o.vertices)]
    return float(max([*points, np.abs(scene.camera.position).max(), 1e-300]))


def draw_instant(
    scene: Scene, faces: Faces, paths: Paths, size: tuple[int, int], frame: int, fraction: float
) -> Integral:
    """Return the exact box-filtered picture at one instant."""
    view = view_at(scene.camera, scene.animation, frame, fraction, size)
    pixels = np.zeros((size[1], size[0], 3))
    _cover(scene, view, pieces_at(faces, paths, view, frame, fraction), np.ones(1), pixels)
    # corners are known to a few units in the last place of the picture's width
    rounding = max(ROUNDING, 8 * 2.0**-52 * max(size)) * float(np.abs(palette(scene)).max())
    return Integral(pixels, np.full(pixels.shape[:2], rounding))


def _cover(scene: Scene, view: View, pieces: Pieces, weights: FloatArray, out: FloatArray) -> int:
    colors, extent = palette(scene), scene_extent(scene)

    def draw(rows: NDArray[np.int64]) -> int:
        return cover_rows(
            pieces.points, pieces.starts, pieces.planes, pieces.owners, pieces.instants, colors, view.perspective,
            extent, weights, rows, out,
        )  # fmt: skip

    return sum(over_bands(draw, view.height))


def draw_shutter(
    scene: Scene, faces: Faces, paths: Paths, size: tuple[int, int], frame: int, target: float = TARGET
) -> Integral:
    """Return the picture averaged over the open shutter, with a certified bound for every pixel.

    What turns as one flat pattern has a closed form (`rotor`). The number of slices of anything else follows from the
    bound of fewer slices (it falls as 1 / n^2 where everything keeps its depth, else as 1 / n), within a fixed amount
    of work.
    """
    turning = _draw_turning(scene, faces, paths, size, frame)
    if turning is not None:
        return turning
    pilot, work = draw_slices(scene, faces, paths, size, frame, _PILOT)
    price = size[0] * size[1] * _PIXEL_COST + work / _PILOT * _CELL_COST + len(faces.owners) * _FACE_COST
    affordable = min(_MOST_SLICES, int(_BUDGET / price))
    layered = is_layered(scene, faces, paths, frame)
    best, count = pilot, _PILOT
    for least in (_SECOND_PILOT, 0):
        over = float(best.bound.max()) / target
        if over <= 1.0 or count >= affordable:
            break
        needed = count * (over**0.5 if layered else over) * 1.1
        # few slices say little yet about the law of second order
        count = min(affordable, max(count, least if layered and least else int(min(needed, _MOST_SLICES)) + 1))
        best = draw_slices(scene, faces, paths, size, frame, count)[0]
    return best


def _draw_turning(scene: Scene, faces: Faces, paths: Paths, size: tuple[int, int], frame: int) -> Integral | None:
    """Return the closed form of a turning pattern, None if the scene is none."""
    colors = palette(scene)
    rotor = find_rotor(scene, faces, paths, size, frame, colors)
    if rotor is None:
        return None
    base = draw_instant(scene, still_faces(faces, paths), paths, size, frame, 0.0)
    parts = over_bands(lambda rows: draw_rotor(rotor, size, (int(rows[0]), int(rows[1]))), size[1])
    turned = np.concatenate([p for p, _ in parts])[:, :, rotor.channels]
    return Integral(base.pixels + turned, base.bound + np.concatenate([b for _, b in parts]))


def draw_slices(
    scene: Scene, faces: Faces, paths: Paths, size: tuple[int, int], frame: int, count: int
) -> tuple[Integral, int]:
    """Return the mean over `count` slices, and how many cells needed slabs."""
    shutter = scene.animation.shutter
    length = shutter / count
    colors = palette(scene)
    contrasts = np.array([np.abs(colors - c).max() for c in colors[:-1]])
    kinds, turns = _kinds_and_turns(scene, paths, frame)
    layered = is_layered(scene, faces, paths, frame)
    extent = scene_extent(scene)
    span = float((colors.max(axis=0) - colors.min(axis=0)).max())
    pixels, bound = np.zeros((size[1], size[0], 3)), np.zeros((size[1], size[0]))
    work, loose = 0, 0
    for start in range(0, count, _CHUNK):
        fractions = [(k + 0.5) * length for k in range(start, min(count, start + _CHUNK))]
        views = [view_at(scene.camera, scene.animation, frame, f, size) for f in fractions]
        pieces = join_pieces(
            [pieces_at(faces, paths, v, frame, f, length, layered) for v, f in zip(views, fractions, strict=True)]
        )
        view = views[0]
        work += _cover(scene, view, pieces, np.full(len(views), 1.0 / count), pixels)

        def bind(rows: NDArray[np.int64], pieces: Pieces = pieces, view: View = view) -> None:
            if layered:
                bound_sweeps(
                    pieces.points, pieces.speeds, pieces.reach, pieces.outlined, pieces.starts, pieces.owners,
                    pieces.instants, contrasts, kinds, turns, length, 1.0 / count, rows, bound,
                )  # fmt: skip
            else:
                bound_edges(
                    pieces.points, pieces.speeds, pieces.reach, pieces.outlined, pieces.starts, pieces.owners,
                    pieces.instants, contrasts, length, 1.0 / count, rows, bound,
                )  # fmt: skip
                center = np.array([view.width / 2, view.height / 2])
                bound_crossings(
                    pieces.points, pieces.reach, pieces.starts, pieces.planes, pieces.owners, pieces.instants,
                    contrasts, kinds, turns, view.perspective, view.scale, center, extent,
                    length, 1.0 / count, rows, bound,
                )  # fmt: skip

        over_bands(bind, size[1])
        loose += pieces.loose
    rounding = ROUNDING * float(np.abs(colors).max())
    return Integral(pixels, np.minimum(bound + span * loose / count, span) + rounding), work


def _kinds_and_turns(scene: Scene, paths: Paths, frame: int) -> tuple[NDArray[np.int64], FloatArray]:
    """Return a number for each way of moving, and bounds on the angular speeds, of every object."""
    motions = {m: k for k, m in enumerate(dict.fromkeys(m for m in paths.motions if not m.is_static))}
    kinds = np.array([-1 if m.is_static else motions[m] for m in paths.motions], np.int64)
    turns = np.full(len(paths.motions), paths.camera_turn(frame))
    for index, motion in enumerate(paths.motions):
        if paths.interpolated or motion.matrices is not None:
            turns[index] += 0.0 if motion.is_static else np.inf
        elif motion.spin is not None:
            turns[index] += 2 * np.pi * abs(motion.spin.rev_per_s) / scene.animation.fps
    return kinds, turns


def is_layered(scene: Scene, faces: Faces, paths: Paths, frame: int) -> bool:
    """Return whether every face stays at one depth of its own: then no two can change their order."""
    camera = scene.camera
    if camera.projection != "orthographic" or paths.camera_turn(frame) > 0.0:
        return False
    forward = np.asarray(camera.target, dtype=np.float64) - np.asarray(camera.position)
    forward = forward / np.linalg.norm(forward)
    close = 1e-12 * scene_extent(scene)
    if len(faces.owners):
        depth = (faces.vertices @ forward)[faces.corners]
        deepest, nearest = (f.reduceat(depth, faces.starts[:-1]) for f in (np.maximum, np.minimum))
        if (deepest - nearest).max() > close:
            return False
    for motion in paths.motions:
        if motion.matrices is not None:
            return False
        if abs(float((np.asarray(motion.velocity) - np.asarray(camera.velocity)) @ forward)) > 0.0:
            return False
        if paths.interpolated and not motion.is_static:
            return False
        if motion.spin is not None and motion.spin.rev_per_s != 0.0:
            axis = np.asarray(motion.spin.axis) / np.linalg.norm(motion.spin.axis)
            if float(np.linalg.norm(np.cross(axis, forward))) > 1e-12:
                return False
    return True
