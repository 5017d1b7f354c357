"""By how much a sampled picture of polygons may differ from the exact one, derived pixel by pixel.

Misplacement. A renderer draws edges up to `d` px from where they are. Its picture is the exact one but within bands of
half width d about the edges, whose area in a pixel is at most 2 d (l + 2 d) for l px of edge in it or beside it.

* Rays: float32 rounds corners, origins and directions; see `ROUNDINGS`. A rounding is half an ulp, 2^-24 of the
  distance from the camera to the corner, seen at the nearest depth of the edge.
* Rasterizer: the same roundings, and corners snap to 1/256 px: by half a step each way, sqrt(2) / 512 px.
* Where planes cross, the order of depths decides: a depth is known to `DEPTH_ROUNDING`, so the band about the line
  where depths are equal is that over the slope of their difference wide. Depths (of perspective, their inverse) are
  affine in the picture.

Sampling, with one sample in each of the k x k cells of a pixel: only a cell that an edge crosses can be wrong, by the
range of colours R at most. A line that spans dx, dy in a pixel crosses k (dx + dy) + 3 cells at most: C in all, and
the mean is off by R C / k^2 at most. If cells are sampled independently (jittered), Hoeffding's inequality bounds the
error by R sqrt(C L / 2) / k^2 with L = ln(2 values / p), but with probability p for any value of the picture.

Under a filter w, the sum over all cells of area a times how much w varies within the cell, V, is by how much a sum of
weights differs from 1; of weights times colours, with colours counted from the middle of their range, R V / 2. Crossed
cells add R a w each. The quotient is then off by at most (R V + R sum a w) / (1 - V).

Independent samples drawn from the filter, of mean m, each within B of it, and of variance v: Bernstein's inequality,
sqrt(2 v L / N) + 2 B L / (3 N).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.geometry import LAYER_STEP
from aliasbench.renderers.sampling.filters import FilterSpec
from aliasbench.scenes.model import FloatArray, Scene, Surface
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import View, view_at

MISS = 1e-9  # the chance that a right picture is refused
SNAPPED_PX = math.sqrt(2.0) / 512.0
# Half ulps of float32: 12 of an edge under rays (`bench.hard.ladder`), again as many for rays taken to a moving body's
# frame; of a rasterizer, corner, matrix and product (8), and a cut at each of four borders and the camera's plane (4 of
# each). The larger for both.
ROUNDINGS = 32.0 * 2.0**-24
ROUNDINGS_64 = 32.0 * 2.0**-53  # of world coordinates before the camera's are subtracted
# Relative: layers of at most four polygons, and roundings of depths.
DEPTH_ROUNDING = 4.0 * LAYER_STEP + ROUNDINGS
_NOTHING = (np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0), np.zeros(0, bool))


@dataclass(frozen=True)
class Borders:
    """Segments in the picture, a to b (n, 2) in pixels, and how far from there each may be drawn (n,).

    `inner` ones, between triangles of one polygon, show nothing but where a ray may slip through.
    """

    a: FloatArray
    b: FloatArray
    off: FloatArray
    inner: NDArray[np.bool_]

    def in_pixels(self, size: tuple[int, int], margin: int = 0) -> tuple[NDArray[np.bool_], FloatArray, FloatArray]:
        """Whether a segment may show in a pixel (n, h, w), and by how much it spans dx and dy there.

        Pixels are those of a picture with a margin, each as much larger as the segment may be off.
        """
        width, height = (side + 2 * margin for side in size)
        middle = np.meshgrid(np.arange(width) + 0.5 - margin, np.arange(height) + 0.5 - margin)
        first = np.zeros((len(self.a), height, width))
        last = np.ones_like(first)
        for k in range(2):
            begin, step = (v[:, k, None, None] for v in (self.a, self.b - self.a))
            half = 0.5 + self.off[:, None, None]
            with np.errstate(divide="ignore", invalid="ignore"):
                t = np.stack([(middle[k] - half - begin) / step, (middle[k] + half - begin) / step])
            level = step == 0.0
            within = np.abs(middle[k] - begin) <= half
            first = np.maximum(first, np.where(level, np.where(within, 0.0, np.inf), t.min(axis=0)))
            last = np.minimum(last, np.where(level, np.where(within, 1.0, -np.inf), t.max(axis=0)))
        shown = first <= last
        share = np.where(shown, last - np.where(shown, first, 0.0), 0.0)
        dx, dy = (share * np.abs(self.b - self.a)[:, k, None, None] for k in range(2))
        return shown, dx, dy


def color_range(scene: Scene) -> tuple[FloatArray, FloatArray]:
    """The least and greatest value of each channel, (3,) each."""
    colors = np.array([scene.background, *(s.color for s in scene.objects)])
    return colors.min(axis=0), colors.max(axis=0)


def find_borders(
    scene: Scene, size: tuple[int, int], *, snapped: bool, frame: int = 0, fraction: float = 0.0, margin: int = 0
) -> Borders:
    """Everything across which a picture may change: edges of triangles, and lines where polygons cross."""
    view = view_at(scene.camera, scene.animation, frame, fraction, size)
    start = view_at(scene.camera, scene.animation, 0, 0.0, size).origin
    box = np.array([[-1.0, -1.0], [size[0] + 1.0, size[1] + 1.0]]) + margin * np.array([[-1.0], [1.0]])
    found: list[tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]] = []
    planes = []
    for surface in scene.objects:
        matrix = object_matrix(surface.motion, scene.animation, frame, fraction)
        corners = surface.vertices @ matrix[:3, :3].T + matrix[:3, 3]
        far = float(np.abs(corners).max()) + float(np.abs(surface.vertices).max()) + float(np.abs(view.origin).max())
        local = view.to_camera(corners)
        # coordinates may be relative to where the camera was, and of a body to where it was at rest
        reach = float(np.linalg.norm(local, axis=1).max()) + float(np.linalg.norm(view.origin - start))
        reach += float(np.linalg.norm(corners - surface.vertices, axis=1).max())
        a, b, depth, inner = _shown_edges(local, surface, view, box)
        off = (ROUNDINGS * reach + ROUNDINGS_64 * far) * view.scale / depth + (SNAPPED_PX if snapped else 0.0)
        found.append((a, b, off, inner))
        if not view.perspective:
            found.append(_begins(local, surface, view, ROUNDINGS * reach + ROUNDINGS_64 * far))
        planes.append((_depths(local, view), reach))
    for i, (one, reach) in enumerate(planes):
        for other, beyond in planes[:i]:
            if one is not None and other is not None:
                found.append(_crossing(one, other, max(reach, beyond), view, box))
    a, b, off, inner = (np.concatenate(parts) for parts in zip(_NOTHING, *found, strict=True))
    return Borders(a, b, np.minimum(off, 2.0 * sum(size)), inner)


def _shown_edges(
    local: FloatArray, surface: Surface, view: View, box: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]:
    """Edges before the camera and in a box of the picture, the least depth of each there (1 of parallel rays), and
    whether two triangles share it.
    """
    t = surface.triangles
    sides_of = np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), axis=1)
    ends, uses = np.unique(sides_of, axis=0, return_counts=True)
    p, q = local[ends[:, 0]], local[ends[:, 1]]
    # a point x px right of the middle has X scale = x Z: the box is four planes through the eye
    half = np.array([view.width / 2, view.height / 2])
    sides = [(np.array([0.0, 0.0, 1.0]), 0.0)]
    for k, sign in ((0, 1.0), (1, -1.0)):
        for bound, way in ((box[0, k] - half[k], 1.0), (box[1, k] - half[k], -1.0)):
            normal = np.zeros(3)
            normal[k] = way * sign * view.scale
            if view.perspective:
                normal[2] = -way * bound
            sides.append((normal, 0.0 if view.perspective else -way * bound))
    first, last = np.zeros(len(p)), np.ones(len(p))
    for normal, shift in sides:
        u, v = p @ normal + shift, q @ normal + shift
        with np.errstate(divide="ignore", invalid="ignore"):
            cut = u / (u - v)
        first = np.where((u < 0) & (v >= 0), np.maximum(first, cut), first)
        last = np.where((u >= 0) & (v < 0), np.minimum(last, cut), last)
        last = np.where((u < 0) & (v < 0), -1.0, last)
    kept = first < last
    p, q, first, last = p[kept], q[kept], first[kept, None], last[kept, None]
    a, b = p + first * (q - p), p + last * (q - p)
    depth = np.minimum(a[:, 2], b[:, 2]) if view.perspective else np.ones(len(a))
    depth = np.maximum(depth, 1e-300)
    scale = [view.scale / np.maximum(v[:, 2:], 1e-300) if view.perspective else view.scale for v in (a, b)]
    a, b = (half + v[:, :2] * (1.0, -1.0) * s for v, s in zip((a, b), scale, strict=True))
    return a, b, depth, uses[kept] > 1


def _begins(
    local: FloatArray, surface: Surface, view: View, rounding: float
) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]:
    """Lines at which parallel rays begin to see what passes through the camera's plane, and how far they may be off."""
    half = np.array([view.width / 2, view.height / 2])
    ends, off = [], []
    for corners in local[surface.triangles]:
        following = np.roll(corners, -1, axis=0)
        passing = (corners[:, 2] < 0.0) != (following[:, 2] < 0.0)
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        across = float(np.hypot(normal[0], normal[1]))
        if passing.sum() != 2 or across == 0.0:
            continue
        share = corners[passing, 2] / (corners[passing, 2] - following[passing, 2])
        points = corners[passing] + share[:, None] * (following[passing] - corners[passing])
        ends.append(half + points[:, :2] * (1.0, -1.0) * view.scale)
        # a distance from the plane, over the share of its normal that is across the rays
        off.append(rounding * float(np.linalg.norm(normal)) / across * view.scale)
    if not ends:
        return _NOTHING
    lines = np.array(ends)
    return lines[:, 0], lines[:, 1], np.array(off), np.zeros(len(lines), bool)


def _depths(local: FloatArray, view: View) -> FloatArray | None:
    """Depth (of perspective its inverse) as gx, gy, g0 of x and y in pixels; None for a plane seen from its edge."""
    v = local - local[0]
    normal = np.cross(v, np.roll(v, -1, axis=0)).sum(axis=0)
    normal = normal / np.linalg.norm(normal)
    c = float(normal @ local[0])
    across, down = normal[0] / view.scale, -normal[1] / view.scale
    ahead = normal[2] - across * view.width / 2 - down * view.height / 2
    if view.perspective:
        return None if abs(c) < 1e-300 else np.array([across, down, ahead]) / c
    if abs(normal[2]) < 1e-12:
        return None
    beside = c + across * view.width / 2 + down * view.height / 2
    return np.array([-across, -down, beside]) / normal[2]


def _crossing(
    one: FloatArray, other: FloatArray, reach: float, view: View, box: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]:
    """The line in a box where two planes are equally deep, if they are anywhere within rounding, and its doubt."""
    corners = np.array([(x, y, 1.0) for x in box[:, 0] for y in box[:, 1]])
    values = corners @ one, corners @ other
    difference = values[0] - values[1]
    size = float(np.max(np.abs(values))) if view.perspective else reach
    if np.abs(difference).max() < 1e-9 * size:
        return _NOTHING  # one plane: the later object is on top
    doubt = DEPTH_ROUNDING * size
    if np.abs(difference).min() > doubt and np.ptp(np.sign(difference)) == 0:
        return _NOTHING
    slope = one[:2] - other[:2]
    steep = float(np.linalg.norm(slope))
    middle = box.mean(axis=0)
    diagonal = float(np.linalg.norm(np.ptp(box, axis=0)))
    if steep * diagonal < doubt:
        return middle[None], middle[None], np.array([diagonal]), np.zeros(1, bool)
    foot = middle - slope / steep * float(np.append(middle, 1.0) @ (one - other)) / steep
    along = np.array([-slope[1], slope[0]]) / steep * diagonal
    return (foot - along)[None], (foot + along)[None], np.array([min(doubt / steep, diagonal)]), np.zeros(1, bool)


def crossed_cells(borders: Borders, size: tuple[int, int], k: int, margin: int = 0) -> FloatArray:
    """How many of the k x k cells of each pixel are crossed by a border as drawn, at most; (h, w)."""
    shown, dx, dy = borders.in_pixels(size, margin)
    spans = np.where(shown & ~borders.inner[:, None, None], k * (dx + dy + 4.0 * borders.off[:, None, None]) + 3.0, 0.0)
    out: FloatArray = np.minimum(spans.sum(axis=0), float(k * k))
    return out


def doubtful_area(borders: Borders, size: tuple[int, int], margin: int = 0) -> FloatArray:
    """The area of each pixel that lies so close to a border that either side may be drawn there, at most; (h, w)."""
    shown, dx, dy = borders.in_pixels(size, margin)
    off = borders.off[:, None, None]
    out: FloatArray = np.minimum(np.where(shown, 2.0 * off * (np.hypot(dx, dy) + 2.0 * off), 0.0).sum(axis=0), 1.0)
    return out


def stratified_bound(
    scene: Scene, borders: Borders, size: tuple[int, int], k: int, spec: FilterSpec, *, independent: bool
) -> FloatArray:
    """By how much pixels of one sample in each of k x k cells may be off, (h, w, 3)."""
    low, high = color_range(scene)
    margin = spec.margin
    crossed = crossed_cells(borders, size, k, margin)
    doubtful = doubtful_area(borders, size, margin)
    if spec.name == "box" and spec.radius == 0.5:
        if independent:
            log = math.log(2.0 * crossed.size * 3 / MISS)
            crossed = np.minimum(crossed, np.sqrt(crossed * log / 2.0))
        return (crossed / k**2 + doubtful)[..., None] * (high - low)
    variation = filter_variation(spec, k)
    if variation >= 1.0:
        return np.full((size[1], size[0], 3), np.inf)
    errors = np.zeros((size[1], size[0]))
    for y in range(2 * margin + 1):
        for x in range(2 * margin + 1):
            nearest = [max(0.0, abs(v - margin) - 0.5) for v in (x, y)]
            weight = float(spec.evaluate(nearest[0], nearest[1]))
            part = np.s_[y : y + size[1], x : x + size[0]]
            errors += weight * np.minimum(crossed[part] / k**2 + doubtful[part], 1.0)
    return ((variation + errors) / (1.0 - variation))[..., None] * (high - low)


def filter_variation(spec: FilterSpec, k: int) -> float:
    """The sum over all cells of their area times how much a filter varies within; of filters that fall from 0 out."""
    count = (2 * spec.margin + 1) * k
    edges = np.abs((np.arange(count + 1) - count / 2) / k)
    near, far = np.minimum(edges[:-1], edges[1:]), np.maximum(edges[:-1], edges[1:])
    if count % 2:
        near[count // 2] = 0.0
    # rounding must not take the border of a box for its inside or outside
    most = spec.evaluate(near[:, None] * (1.0 - 1e-12), near[None, :] * (1.0 - 1e-12))
    least = spec.evaluate(far[:, None] * (1.0 + 1e-12), far[None, :] * (1.0 + 1e-12))
    return float((most - least).sum()) / k**2


def independent_bound(scene: Scene, truth: FloatArray, count: int, gain: float, shift: FloatArray) -> FloatArray:
    """By how much a mean of `count` independent samples may be off, (h, w, 3); `shift` (h, w) is misplaced area."""
    low, high = color_range(scene)
    log = math.log(2.0 * truth.size / MISS)
    moved = shift[..., None] * (high - low)
    if gain == 1.0:
        reach = high - low
        variance = np.maximum(high - truth, 0.0) * np.maximum(truth - low, 0.0) + moved * reach
    else:
        # signed samples, gain times a colour: E X^2 <= (gain high)^2
        reach = 2.0 * gain * high
        variance = np.broadcast_to((gain * high) ** 2, truth.shape)
        moved = gain * gain * moved
    bound: FloatArray = np.sqrt(2.0 * variance * log / count) + 2.0 * reach * log / (3.0 * count) + moved
    return bound
