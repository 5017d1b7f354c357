"""Known straight edges, carried from the scene into the pixels where their error may be read.

A metric that has to find the edge in the picture first measures its own finding too. The scene declares the edge, the
camera and the motion place it, and the columns that are safe to read follow: the whole blurred edge must lie in them,
they must not touch its ends, the border or another edge.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aliasbench.metrics.gate import Signals
from aliasbench.scenes.model import EdgeFact, FloatArray, Scene, Surface
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import View, view_at

# Of the edge's length: how far an outline may be from a fact that means it.
SAME_LINE = 1e-6
NEAR_DEPTH = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class EdgeWindow:
    """One edge in one frame, as y = slope x + intercept in pixels of the picture (x and y swapped if `transposed`).

    Attributes
    ----------
    transposed : bool
        Whether the edge is nearer to vertical, so that rows play the columns' part.
    slope, intercept : float
        abs(slope) <= 1.
    sign : float
        +1 where the bright side is at smaller y, -1 where it is at larger y.
    columns : (n,) int
        Columns of the picture that may be read.
    first_row : (n,) int
        The window's first row in each of them.
    rows : int
        The window's height, the same in all columns.
    reach : float
        In every column at least the pixels whose middles are up to this far above and below the line are read.
    """

    transposed: bool
    slope: float
    intercept: float
    sign: float
    columns: NDArray[np.int64]
    first_row: NDArray[np.int64]
    rows: int
    reach: float


def outline_has(surface: Surface, rest: FloatArray, segment: FloatArray) -> bool:
    """Return whether a side of the polygon (its vertices now at `rest`, (n, 3)) contains the segment (2, 3)."""
    if not surface.is_polygon:
        return False
    start = rest
    side = np.roll(rest, -1, axis=0) - start
    length2 = np.sum(side**2, axis=1)
    usable = length2 > 0.0
    start, side, length2 = start[usable], side[usable], length2[usable]
    tolerance = SAME_LINE * float(np.linalg.norm(segment[1] - segment[0]))
    offset = segment[:, None, :] - start
    along = np.sum(offset * side, axis=2) / length2
    distance = np.linalg.norm(offset - along[..., None] * side, axis=2)
    slack = tolerance / np.sqrt(length2)
    inside = (distance <= tolerance) & (along >= -slack) & (along <= 1.0 + slack)
    return bool(np.any(np.all(inside, axis=0)))


def carrier_of(edge: EdgeFact, scene: Scene) -> Surface | None:
    """Return the object with that edge in its outline at t = 0 (the last such, which is on top), or None."""
    segment = np.array([edge.start, edge.end], dtype=np.float64)
    for surface in reversed(scene.objects):
        matrix = object_matrix(surface.motion, scene.animation, 0, 0.0)
        if outline_has(surface, surface.vertices @ matrix[:3, :3].T + matrix[:3, 3], segment):
            return surface
    return None


def edge_at(
    edge: EdgeFact, carrier: Surface | None, scene: Scene, frame: int, fraction: float, size: tuple[int, int]
) -> FloatArray | None:
    """Return the edge's ends (2, 2) in pixels at a time, or None if no part of it is before the camera."""
    points = np.array([edge.start, edge.end], dtype=np.float64)
    if carrier is not None and not carrier.motion.is_static:
        begin = object_matrix(carrier.motion, scene.animation, 0, 0.0)
        now = object_matrix(carrier.motion, scene.animation, frame, fraction)
        points = (points - begin[:3, 3]) @ np.linalg.pinv(begin[:3, :3]).T @ now[:3, :3].T + now[:3, 3]
    view = view_at(scene.camera, scene.animation, frame, fraction, size)
    if view.perspective:
        clipped = clip_to_depth(points, view)
        if clipped is None:
            return None
        points = clipped
    return view.project(points)[:, :2]


def clip_to_depth(points: FloatArray, view: View) -> FloatArray | None:
    """Return the part of a segment (2, 3) that lies before the camera, or None."""
    depth = view.to_camera(points)[:, 2]
    if np.all(depth < NEAR_DEPTH):
        return None
    if np.all(depth >= NEAR_DEPTH):
        return points
    cut = (NEAR_DEPTH - depth[0]) / (depth[1] - depth[0])
    middle = points[0] + cut * (points[1] - points[0])
    return np.stack([middle, points[1]] if depth[0] < NEAR_DEPTH else [points[0], middle])


def edge_windows(signals: Signals, carriers: list[Surface | None], frame: int) -> list[EdgeWindow | None]:
    """Return where each of the scene's edges may be read in a frame (the scene's number), None where nowhere.

    `carriers` holds the object that each edge moves with (`carrier_of`), found once for all frames.
    """
    scene = signals.scene
    shutter = scene.animation.shutter
    fractions = (shutter / 2, 0.0, shutter) if shutter > 0.0 else (0.0,)
    placed: list[list[FloatArray] | None] = []
    for edge, carrier in zip(scene.facts.edges, carriers, strict=True):
        ends = [edge_at(edge, carrier, scene, frame, f, signals.size) for f in fractions]
        present = [e for e in ends if e is not None]
        placed.append(present if len(present) == len(ends) else None)
    others = [p[0] for p in placed if p is not None]
    return [None if p is None else _window(p, others, signals) for p in placed]


def _window(ends: list[FloatArray], others: list[FloatArray], signals: Signals) -> EdgeWindow | None:
    """Return the window of an edge given at the shutter's middle, then at its begin and end."""
    (dx, dy) = ends[0][1] - ends[0][0]
    if dx == 0.0 and dy == 0.0:
        return None
    transposed = bool(abs(dy) > abs(dx))
    if transposed:
        sign = 1.0 if dy < 0.0 else -1.0
        ends, others = [e[:, ::-1] for e in ends], [e[:, ::-1] for e in others]
    else:
        sign = 1.0 if dx > 0.0 else -1.0
    height, width = signals.size if transposed else signals.size[::-1]
    middle = ends[0]
    slope = float((middle[1, 1] - middle[0, 1]) / (middle[1, 0] - middle[0, 0]))
    intercept = float(middle[0, 1] - slope * middle[0, 0])
    # While the shutter is open the edge sweeps over more rows, and its ends over more columns.
    sweep = max(float(np.max(np.abs(e[:, 1] - slope * e[:, 0] - intercept))) for e in ends)
    slide = max(float(np.max(np.abs(e[:, 0] - middle[:, 0]))) for e in ends)
    margin = signals.radius_px + 1.0
    half = abs(slope) / 2 + margin + sweep
    rows = int(np.ceil(2 * half)) + 1
    columns = np.arange(signals.crop, width - signals.crop, dtype=np.float64)
    center = slope * (columns + 0.5) + intercept
    first_row = np.floor(center - half)
    low, high = np.min(middle[:, 0]) + margin + slide, np.max(middle[:, 0]) - margin - slide
    usable = (columns >= low) & (columns + 1 <= high)
    usable &= (first_row >= signals.crop) & (first_row + rows <= height - signals.crop)
    for other in others:
        distance = other[:, 1] - slope * other[:, 0] - intercept
        if np.max(np.abs(distance)) > SAME_LINE * np.linalg.norm(middle[1] - middle[0]):
            pad = margin + sweep
            usable &= ~_crosses(other, columns - pad, columns + 1 + pad, center - half - pad, center + half + pad)
    if not usable.any():
        return None
    return EdgeWindow(
        transposed,
        slope,
        intercept,
        sign,
        columns[usable].astype(np.int64),
        first_row[usable].astype(np.int64),
        rows,
        half - 0.5,
    )


def _crosses(segment: FloatArray, x0: FloatArray, x1: FloatArray, y0: FloatArray, y1: FloatArray) -> NDArray[np.bool_]:
    """Return which of the boxes the segment (2, 2) meets (Liang and Barsky 1984)."""
    enter, leave = np.zeros(x0.shape), np.ones(x0.shape)
    apart = np.zeros(x0.shape, dtype=np.bool_)
    for axis, low, high in ((0, x0, x1), (1, y0, y1)):
        start, step = segment[0, axis], segment[1, axis] - segment[0, axis]
        if step == 0.0:
            apart |= (start < low) | (start > high)
            continue
        near, far = (low - start) / step, (high - start) / step
        enter = np.maximum(enter, np.minimum(near, far))
        leave = np.minimum(leave, np.maximum(near, far))
    crossed: NDArray[np.bool_] = ~apart & (enter <= leave)
    return crossed
