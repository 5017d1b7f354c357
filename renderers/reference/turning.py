"""Which scenes turn about one point of the picture, and as what pattern: what `rotor` integrates in closed form.

Everything that moves must share one turn, about an axis along the view of a still camera, and lie across it, so that it
turns in the picture as one rigid flat pattern. Where its faces cover one another only what is seen counts: hidden parts
are cut away once, as the pattern lies when the shutter opens.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.reference.faces import Faces
from aliasbench.renderers.reference.flat import depth_extent
from aliasbench.renderers.reference.paths import Paths
from aliasbench.renderers.reference.slabs import TIE
from aliasbench.scenes.model import FloatArray, Scene
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import view_at

_CLOSE = 1e-12
_EPS = 2.220446049250313e-16
_WORST = 1e-6  # a turn so small that rounding costs more than this is left to time slices, which are good at it


@dataclass(frozen=True, slots=True, eq=False)
class Rotor:
    """A flat pattern that turns about the hub while the shutter is open.

    Attributes
    ----------
    edges : (n, 9) float64
        Seen from the hub, in pixels and radians: distance of the edge's line; direction of its foot as the shutter
        opens; first and last place along the line, from the foot, counter-clockwise; angle under which it is seen;
        least and greatest radius; angles of first and last place from the foot.
    jumps : (n, c) float64
        The colour on the hub's side of the edge minus the colour on the other, in `c` different channels.
    channels : (3,) int64
        Which of the `c` is red, green and blue.
    radii : (k,) float64
        Where something happens, ascending; the last is the pattern's rim.
    sweep : float
        The turn while the shutter is open, radians, counter-clockwise.
    hub : (2,) float64
        In the picture, pixels.
    rounding : float
        A bound on what rounding costs a pixel.
    """

    edges: FloatArray
    jumps: FloatArray
    channels: NDArray[np.int64]
    radii: FloatArray
    sweep: float
    hub: FloatArray
    rounding: float


def find_rotor(
    scene: Scene, faces: Faces, paths: Paths, size: tuple[int, int], frame: int, colors: FloatArray
) -> Rotor | None:
    """Return the turning pattern of a scene, None if it moves in another way or something still comes in its reach.

    `colors` has a row for every object, then the background's.
    """
    motions = dict.fromkeys(m for m in paths.motions if not m.is_static)
    if paths.interpolated or not scene.camera.is_static or len(motions) != 1:
        return None
    motion = next(iter(motions))
    spin = motion.spin
    if motion.matrices is not None or any(motion.velocity) or spin is None:
        return None
    view = view_at(scene.camera, scene.animation, frame, 0.0, size)
    axis = np.asarray(spin.axis) / np.linalg.norm(spin.axis)
    if float(np.linalg.norm(np.cross(axis, view.forward))) > _CLOSE:
        return None
    sense = -1.0 if axis @ view.forward > 0.0 else 1.0
    sweep = sense * 2 * np.pi * spin.rev_per_s / scene.animation.fps * scene.animation.shutter
    matrix = object_matrix(motion, scene.animation, frame, 0.0)
    center = view.to_camera(np.asarray(spin.center))
    parts: list[tuple[FloatArray, float, int]] = []
    still: list[tuple[FloatArray, float, float, int]] = []
    hubs: list[FloatArray] = []
    for f, owner in enumerate(faces.owners.tolist()):
        moves = not paths.motions[owner].is_static
        points = faces.vertices[faces.corners[faces.starts[f] : faces.starts[f + 1]]]
        camera = view.to_camera(points @ matrix[:3, :3].T + matrix[:3, 3] if moves else points)
        depth = camera[:, 2]
        close = _CLOSE * max(float(np.abs(camera).max()), 1e-300)
        if not moves:
            if view.perspective and not depth.min() > 0.0:
                return None
            flat = camera[:, :2] * (view.scale / (depth[:, None] if view.perspective else 1.0))
            still.append((flat, float(depth.min()), float(depth.max()), owner))
            continue
        if np.ptp(depth) > close:
            return None
        # behind the camera all through
        if depth.max() <= 0.0:
            continue
        scale = view.scale / (float(depth.mean()) if view.perspective else 1.0)
        hubs.append(np.array([view.width / 2 + center[0] * scale, view.height / 2 - center[1] * scale]))
        if np.abs(hubs[-1] - hubs[0]).max() > _CLOSE * view.width:
            return None
        parts.append(((camera[:, :2] - center[:2]) * scale, float(depth.mean()), owner))
    if not parts:
        return None
    rim = max(float(np.hypot(*p.T).max()) for p, _, _ in parts)
    middle = (hubs[0] - np.array([view.width / 2, view.height / 2])) * np.array([1.0, -1.0])
    furthest = max(d for _, d, _ in parts)
    backdrop = _backdrop([(p - middle, low, high, owner) for p, low, high, owner in still], rim, furthest)
    if backdrop is None:
        return None
    tie = TIE * (furthest if view.perspective else depth_extent(scene))
    return _build(_visible(parts, colors, tie), colors[backdrop], float(sweep), hubs[0])


def still_faces(faces: Faces, paths: Paths) -> Faces:
    """Return the faces that stand still."""
    kept = [f for f, owner in enumerate(faces.owners.tolist()) if paths.motions[owner].is_static]
    spans = [slice(faces.starts[f], faces.starts[f + 1]) for f in kept]
    empty = np.zeros(0, np.int64)
    return replace(
        faces,
        corners=np.concatenate([empty, *(faces.corners[s] for s in spans)]),
        starts=np.cumsum([0, *(s.stop - s.start for s in spans)]).astype(np.int64),
        outlined=np.concatenate([empty.astype(bool), *(faces.outlined[s] for s in spans)]),
        spread=faces.spread[kept],
        owners=faces.owners[kept],
    )


def _backdrop(still: list[tuple[FloatArray, float, float, int]], rim: float, furthest: float) -> int | None:
    """Return the owner of what lies behind all of the pattern (-1: the background), None if that is not one colour.

    `still` holds polygons about the hub with their least and greatest depths.
    """
    behind: list[tuple[float, float, int]] = []
    for points, low, high, owner in still:
        inside, distance = _from_hub(points)
        if distance <= rim * (1 + 1e-9):
            return None
        if inside:
            behind.append((low, high, owner))
    behind.sort()
    for k, (low, high, _) in enumerate(behind):
        if low <= furthest + 1e-6 * abs(furthest) or (k + 1 < len(behind) and high >= behind[k + 1][0]):
            return None
    return behind[0][2] if behind else -1


def _from_hub(points: FloatArray) -> tuple[bool, float]:
    """Return whether a convex polygon holds the origin, and the origin's distance from its outline."""
    following = np.roll(points, -1, axis=0)
    along = following - points
    squared = np.maximum((along**2).sum(axis=1), 1e-300)
    t = np.clip(-(points * along).sum(axis=1) / squared, 0.0, 1.0)
    sides = points[:, 0] * following[:, 1] - points[:, 1] * following[:, 0]
    inside = bool((sides > 0.0).all() or (sides < 0.0).all())
    return inside, float(np.linalg.norm(points + t[:, None] * along, axis=1).min())


def _visible(
    parts: list[tuple[FloatArray, float, int]], colors: FloatArray, tie: float
) -> list[tuple[FloatArray, FloatArray]]:
    """Return disjoint rings (n, 2), counter-clockwise round what they colour, with their colours.

    Depths no farther apart than `tie` are equal.
    """
    import shapely

    # nearest first; of depths that count as equal the later object
    order = sorted(range(len(parts)), key=lambda i: parts[i][1])
    layers, layer, start = {}, 0, parts[order[0]][1]
    for i in order:
        if parts[i][1] - start > tie:
            layer, start = layer + 1, parts[i][1]
        layers[i] = layer
    order.sort(key=lambda i: (layers[i], -parts[i][2]))
    shapes = np.array([shapely.Polygon(parts[i][0]) for i in order])
    first, second = shapely.STRtree(shapes).query(shapes, predicate="intersects")
    over = first < second
    first, second = first[over], second[over]
    shared = shapely.area(shapely.intersection(shapes[first], shapes[second]))
    hides = shared > _CLOSE * np.minimum(shapely.area(shapes[first]), shapely.area(shapes[second]))
    out: list[tuple[FloatArray, FloatArray]] = []
    for k, i in enumerate(order):
        color = colors[parts[i][2]]
        hidden_by = first[hides & (second == k)]
        if not len(hidden_by):
            points = parts[i][0]
            out.append((points if shapely.is_ccw(shapely.LinearRing(points)) else points[::-1], color))
            continue
        rest = shapely.difference(shapes[k], shapely.union_all(shapes[hidden_by]))
        for polygon in shapely.get_parts(rest):
            if polygon.geom_type == "Polygon" and not polygon.is_empty:
                whole = shapely.orient_polygons(polygon)
                out.extend((np.array(r.coords)[:-1], color) for r in (whole.exterior, *whole.interiors))
    return out


def _build(
    rings: list[tuple[FloatArray, FloatArray]], backdrop: FloatArray, sweep: float, hub: FloatArray
) -> Rotor | None:
    """Return the rotor of disjoint coloured rings about the hub, None if the turn is too small for it."""
    jumps: dict[tuple[float, float, float, float], FloatArray] = {}
    for points, color in rings:
        step = color - backdrop
        for p, q in zip(points.tolist(), np.roll(points, -1, axis=0).tolist(), strict=True):
            # counter-clockwise about the hub; an edge on a ray, outwards
            side = p[0] * q[1] - p[1] * q[0]
            turned = side < 0.0 or (side == 0.0 and p[0] ** 2 + p[1] ** 2 > q[0] ** 2 + q[1] ** 2)
            key = (*q, *p) if turned else (*p, *q)
            jumps[key] = jumps.get(key, np.zeros(3)) + (-step if turned else step)
    rows, kept = [], []
    for (px, py, qx, qy), step in jumps.items():
        long = float(np.hypot(qx - px, qy - py))
        if long == 0.0 or not np.abs(step).max() > 0.0:
            continue
        ax, ay = (qx - px) / long, (qy - py) / long
        # + 0.0 makes one zero of two: they have different arcs
        h = max((px * qy - py * qx) / long, 0.0) + 0.0
        start, end = px * ax + py * ay, qx * ax + qy * ay
        radii = np.hypot(px, py), np.hypot(qx, qy)
        least = h if start < 0.0 < end else min(radii)
        first, last = np.arctan2(start, h), np.arctan2(end, h)
        rows.append((h, np.arctan2(-ax, ay), start, end, last - first, least, max(radii), first, last))
        kept.append(step)
    if not rows or sweep == 0.0:
        return None
    edges, steps = np.array(rows), np.array(kept)
    distinct, channels = np.unique(steps, axis=1, return_inverse=True)
    radii_px = np.unique(np.concatenate([edges[:, 5], *(np.hypot(edges[:, 0], edges[:, k]) for k in (2, 3))]))
    strength = float(np.abs(steps).sum(axis=0).max())
    # the four sides' terms are as large as the rim, and their parts as 1 / sweep
    rounding = 8 * _EPS * float(radii_px[-1] + 1.0) * strength * (np.pi + 4.0 / abs(sweep))
    if not rounding < _WORST * max(strength, 1.0):
        return None
    return Rotor(edges, np.ascontiguousarray(distinct), channels.ravel(), radii_px, sweep, hub, float(rounding))
