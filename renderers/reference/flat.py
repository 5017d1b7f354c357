"""Exact box-filtered pictures of flat-coloured scenes at an instant, and what all pictures of them share."""

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
from aliasbench.renderers.reference.pieces import Pieces, pieces_at
from aliasbench.renderers.reference.slabs import TIE
from aliasbench.scenes.model import FloatArray, Scene
from aliasbench.scenes.projection import View, view_at

ROUNDING = 1e-12  # what a pixel of an exact picture may be off, relative to the largest colour
ROWS = 16  # of a band

Answer = TypeVar("Answer")


@dataclass(frozen=True, slots=True, eq=False)
class Integral:
    """A picture (h, w, 3), and for every pixel a bound on its error (h, w)."""

    pixels: FloatArray
    bound: FloatArray


def over_bands(draw: Callable[[NDArray[np.int64]], Answer], height: int) -> list[Answer]:
    """Call `draw` for bands of rows, (first, last + 1), on all cores; the bands do not depend on their number."""
    bands = [np.array([r, min(r + ROWS, height)], np.int64) for r in range(0, height, ROWS)]
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


def depth_extent(scene: Scene) -> float:
    """Return how far things are from the camera, for what counts as one depth under parallel rays.

    At least a share of how far they are from the origin: coordinates of one plane differ by a few roundings, and a
    billionth (`slabs.TIE`) of what is returned is at least 16 ulp of them.
    """
    eye = np.asarray(scene.camera.position)
    away = [np.abs(o.vertices - eye).max() for o in scene.objects if len(o.vertices)]
    return float(max([*away, 16.0 * 2.0**-52 / TIE * scene_extent(scene)]))


def scene_extent(scene: Scene) -> float:
    """Return how far from the origin anything of the scene is, its camera included: what coordinates are rounded to."""
    points = [np.abs(o.vertices).max() for o in scene.objects if len(o.vertices)]
    return float(max([*points, np.abs(scene.camera.position).max(), 1e-300]))


def draw_instant(
    scene: Scene, faces: Faces, paths: Paths, size: tuple[int, int], frame: int, fraction: float
) -> Integral:
    """Return the exact box-filtered picture at one instant."""
    view = view_at(scene.camera, scene.animation, frame, fraction, size)
    return draw_view(scene, view, pieces_at(faces, paths, view, frame, fraction))


def draw_view(scene: Scene, view: View, pieces: Pieces) -> Integral:
    """Return the exact box-filtered picture of one instant's pieces."""
    pixels = np.zeros((view.height, view.width, 3))
    _cover(scene, view, pieces, np.ones(1), pixels)
    # corners are known to a few units in the last place of the picture's width
    rounding = max(ROUNDING, 8 * 2.0**-52 * max(view.width, view.height)) * float(np.abs(palette(scene)).max())
    return Integral(pixels, np.full(pixels.shape[:2], rounding))


def _cover(scene: Scene, view: View, pieces: Pieces, weights: FloatArray, out: FloatArray) -> int:
    colors, extent = palette(scene), depth_extent(scene)

    def draw(rows: NDArray[np.int64]) -> int:
        return cover_rows(
            pieces.points, pieces.starts, pieces.planes, pieces.owners, pieces.instants, colors, view.perspective,
            extent, weights, rows, out,
        )  # fmt: skip

    return sum(over_bands(draw, view.height))
