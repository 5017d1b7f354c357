"""The scene at one instant as convex pieces in the picture: what every exact reference starts from.

Faces (outlines of convex polygons, else triangles) are taken to camera space, cut by the near plane and by the picture's
border with a margin, and projected. Cutting before the division keeps coordinates small, so a plane that runs behind the
camera loses no digits. Everything that neighbours share is computed from the same numbers in the same order, whichever
face asks: shared edges stay shared to the last bit, and parts of a plane leave no gap.

Nearness (minus the depth, or 1 / depth under perspective) and texture coordinates (times nearness) are affine in the
picture, three coefficients each.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.reference.paths import Paths
from aliasbench.scenes.model import FloatArray, Scene, Surface
from aliasbench.scenes.projection import View

MARGIN_PX = 4.0  # scenes go on outside the picture; the shutter's bound needs room for what comes in during a slice
_NEAR = 1e-9  # relative to the largest camera coordinate
_PLANES = 5


@dataclass(frozen=True, slots=True, eq=False)
class Faces:
    """Flat faces of all objects, at rest.

    Attributes
    ----------
    vertices : (n, 3) float64
    uv : (n, 2) float64
    corners, starts : (k,) and (m + 1,) int64
        Vertices of face i: corners[starts[i]:starts[i + 1]], in order, convex.
    outlined : (k,) bool
        Whether the edge from a corner to the next one is on the object's outline.
    spread : (m, 3) int64
        Three vertices that give the face's plane and texture map; the same for all faces of a polygon.
    owners : (m,) int64
        The object of each face.
    ranges : tuple of slices
        The vertices of each object.
    """

    vertices: FloatArray
    uv: FloatArray
    corners: NDArray[np.int64]
    starts: NDArray[np.int64]
    outlined: NDArray[np.bool_]
    spread: NDArray[np.int64]
    owners: NDArray[np.int64]
    ranges: tuple[slice, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """Convex pieces in the picture, positively oriented (x right, y down), of one or several instants.

    Attributes
    ----------
    points : (k, 2) float64
        Corners in pixels.
    speeds : (k, 2) float64
        Bounds on the speed across the edge that starts at a corner, at its both ends, in pixels per frame interval.
    reach : (k,) float64
        Bounds on the speed in any direction of points of that edge.
    outlined : (k,) bool
    starts : (m + 1,) int64
    planes : (m, 4, 3) float64
        Coefficients (of x, y and 1) of nearness, u q, v q and q, with q = nearness under perspective, else 1.
    owners : (m,) int64
    instants : (t + 1,) int64
        The pieces of instant i: instants[i] to instants[i + 1].
    """

    points: FloatArray
    speeds: FloatArray
    reach: FloatArray
    outlined: NDArray[np.bool_]
    starts: NDArray[np.int64]
    planes: FloatArray
    owners: NDArray[np.int64]
    instants: NDArray[np.int64]


def build_faces(scene: Scene) -> Faces:
    """Return the faces of a scene's objects: a convex polygon is one, anything else one for each triangle."""
    vertices, uv, ranges = [np.zeros((0, 3))], [np.zeros((0, 2))], []
    corners: list[int] = []
    starts, outlined, spread, owners = [0], [], [], []
    offset = 0
    for index, surface in enumerate(scene.objects):
        n = len(surface.vertices)
        vertices.append(surface.vertices)
        uv.append(surface.uv if surface.uv is not None else np.zeros((n, 2)))
        ranges.append(slice(offset, offset + n))
        whole = surface.is_polygon and (surface.texture is None or _is_affine(surface))
        common = _spread(surface.vertices) if whole else None
        if surface.is_polygon and whole and _is_convex(surface.vertices):
            loops, flags = [list(range(n))], [[True] * n]
        else:
            loops = [t for t in surface.triangles.tolist() if len(set(t)) == 3]
            flags = _outline_flags(surface, loops)
        for loop, flag in zip(loops, flags, strict=True):
            corners.extend(v + offset for v in loop)
            outlined.extend(flag)
            starts.append(len(corners))
            spread.append([v + offset for v in (common or loop)])
            owners.append(index)
        offset += n
    return Faces(
        np.concatenate(vertices),
        np.concatenate(uv),
        np.array(corners, np.int64),
        np.array(starts, np.int64),
        np.array(outlined, bool),
        np.array(spread, np.int64).reshape(-1, 3),
        np.array(owners, np.int64),
        tuple(ranges),
    )


def _outline_flags(surface: Surface, loops: list[list[int]]) -> list[list[bool]]:
    """Return for each edge of each triangle whether it is no diagonal; every edge of a mesh may be a silhouette."""
    edges = [[tuple(sorted((t[k], t[(k + 1) % 3]))) for k in range(3)] for t in loops]
    seen: dict[tuple[int, ...], int] = {}
    for edge in (e for triangle in edges for e in triangle):
        seen[edge] = seen.get(edge, 0) + 1
    return [[not surface.is_polygon or seen[e] == 1 for e in triangle] for triangle in edges]


def _spread(vertices: FloatArray) -> list[int]:
    """Return three far-apart vertices: the farthest from the first, and the farthest from the line through both."""
    v = vertices - vertices[0]
    b = int(np.argmax((v**2).sum(axis=1)))
    c = int(np.argmax((np.cross(v, v[b]) ** 2).sum(axis=1)))
    return [0, b, c]


def _is_convex(vertices: FloatArray) -> bool:
    edge = np.roll(vertices, -1, axis=0) - vertices
    turns = np.cross(edge, np.roll(edge, -1, axis=0))
    normal = np.cross(vertices - vertices[0], np.roll(vertices, -1, axis=0) - vertices[0]).sum(axis=0)
    if (turns @ normal < 0.0).any():
        return False
    # all turns to one side and one turn in total: a star polygon turns twice
    lengths = np.linalg.norm(edge, axis=1)
    following = np.roll(edge, -1, axis=0)
    angles = np.arctan2(np.linalg.norm(turns, axis=1), (edge * following).sum(axis=1))
    return bool((lengths > 0).all() and abs(angles.sum() - 2 * np.pi) < 1e-6)


def _is_affine(surface: Surface) -> bool:
    """Return whether one affine map takes all of a polygon's vertices to their texture coordinates."""
    if surface.uv is None:
        return True
    a, b, c = _spread(surface.vertices)
    e1, e2 = surface.vertices[b] - surface.vertices[a], surface.vertices[c] - surface.vertices[a]
    weights = np.linalg.lstsq(np.stack([e1, e2], axis=1), (surface.vertices - surface.vertices[a]).T, rcond=None)[0].T
    predicted = surface.uv[a] + weights @ np.stack([surface.uv[b] - surface.uv[a], surface.uv[c] - surface.uv[a]])
    return bool(np.abs(predicted - surface.uv).max() <= 1e-12 * max(1.0, float(np.abs(surface.uv).max())))


def pieces_at(
    faces: Faces, paths: Paths, view: View, frame: int, fraction: float, slice_length: float = 0.0, in_layers: bool = False
) -> Pieces:
    """Return the pieces of one instant.

    Parameters
    ----------
    faces, paths
        Of the scene.
    view : View
        The camera at the instant.
    frame, fraction
        The instant, see `scenes.motion`.
    slice_length : float
        Length of the time slice around the instant, in frame intervals; enters the speeds.
    in_layers : bool
        Whether everything moves parallel to the picture, orthographically (`flat.is_layered`): then the speed across an
        edge is known, and smaller than the speed as such.
    """
    world = paths.positions(faces.vertices, faces.ranges, frame, fraction)
    local = world - view.origin
    # sums in a fixed order, unlike a matrix product, so that equal vertices of different objects stay equal
    camera = np.stack(
        [
            local[:, 0] * axis[0] + local[:, 1] * axis[1] + local[:, 2] * axis[2]
            for axis in (view.right, view.up, view.forward)
        ],
        axis=1,
    ).reshape(-1, 3)
    speed = paths.speeds(faces.vertices, faces.ranges, camera, frame)
    drift = np.empty((0, 3))
    if in_layers:
        velocity = paths.velocities(world, faces.ranges, frame, fraction)
        slack = paths.velocity_change(faces.ranges, speed) * slice_length
        drift = np.stack([velocity @ view.right, -(velocity @ view.up), slack], axis=1) * view.scale
    near = _NEAR * float(np.abs(camera).max(initial=1e-300))
    half = np.array([view.width / 2 + MARGIN_PX, view.height / 2 + MARGIN_PX]) / view.scale
    count = len(faces.owners)
    room = len(faces.corners) + _PLANES * count
    points, speeds, reach = np.empty((room, 2)), np.empty((room, 2)), np.empty(room)
    outlined, starts = np.empty(room, np.bool_), np.zeros(count + 1, np.int64)
    planes, owners = np.empty((count, 4, 3)), np.empty(count, np.int64)
    widest = int(np.diff(faces.starts).max(initial=0)) + _PLANES + 1
    k, m = _clip_project(
        camera, speed, drift, faces.uv, faces.corners, faces.starts, faces.outlined, faces.spread, faces.owners,
        near, half, view.perspective, view.scale, view.width / 2, view.height / 2, slice_length,
        np.empty((2, widest, 8)), points, speeds, reach, outlined, starts, planes, owners,
    )  # fmt: skip
    return Pieces(  # fmt: skip
        points[:k], speeds[:k], reach[:k], outlined[:k], starts[: m + 1], planes[:m], owners[:m],
        np.array([0, m], np.int64),
    )


def join_pieces(parts: list[Pieces]) -> Pieces:
    """Return the pieces of several instants as one set."""
    corners = np.cumsum([0] + [len(p.points) for p in parts])
    counts = np.cumsum([0] + [len(p.owners) for p in parts])
    return Pieces(
        np.concatenate([p.points for p in parts]),
        np.concatenate([p.speeds for p in parts]),
        np.concatenate([p.reach for p in parts]),
        np.concatenate([p.outlined for p in parts]),
        np.concatenate([np.zeros(1, np.int64)] + [p.starts[1:] + c for p, c in zip(parts, corners[:-1], strict=True)]),
        np.concatenate([p.planes for p in parts]),
        np.concatenate([p.owners for p in parts]),
        counts.astype(np.int64),
    )


@njit(cache=True, nogil=True)
def _cut(points, n, plane, half, near, perspective, out):  # type: ignore[no-untyped-def]
    """Write a convex polygon's part on the inner side of one plane; return its size. Columns: x y z speed outlined drift slack."""
    size = 0
    for i in range(n):
        a, b = points[i], points[(i + 1) % n]
        da = _inside(a, plane, half, near, perspective)
        db = _inside(b, plane, half, near, perspective)
        if da >= 0.0:
            out[size] = a
            size += 1
        if (da >= 0.0) != (db >= 0.0):
            # from the same end whichever face asks
            swap = (a[0], a[1], a[2]) > (b[0], b[1], b[2])
            t = db / (db - da) if swap else da / (da - db)
            for c in range(8):
                start, end = (b[c], a[c]) if swap else (a[c], b[c])
                out[size, c] = start + t * (end - start)
            # leaving, the next edge runs along the plane; entering, it is the rest of this one
            out[size, 4] = 0.0 if da >= 0.0 else a[4]
            size += 1
    return size


@njit(cache=True, nogil=True)
def _inside(p, plane, half, near, perspective):  # type: ignore[no-untyped-def]
    """Return the signed distance (up to a factor) to the near plane (0) or a side of the picture (1 to 4)."""
    if plane == 0:
        return p[2] - near
    reach = half[(plane - 1) // 2] * (p[2] if perspective else 1.0)
    value = p[(plane - 1) // 2]
    return reach - value if plane % 2 else reach + value


@njit(cache=True, nogil=True)
def _clip_project(
    camera, speed, drift, uv, corners, first, edge_flags, spread, face_owners,
    near, half, perspective, scale, cx, cy, slice_length,
    work, points, speeds, reach, outlined, starts, planes, owners,
):  # type: ignore[no-untyped-def]  # fmt: skip
    """Fill the output arrays; return the numbers of corners and pieces."""
    k, m = 0, 0
    for f in range(len(face_owners)):
        n = first[f + 1] - first[f]
        now = 0
        for i in range(n):
            v = corners[first[f] + i]
            for c in range(3):
                work[now, i, c] = camera[v, c]
            work[now, i, 3] = speed[v]
            work[now, i, 4] = 1.0 if edge_flags[first[f] + i] else 0.0
            for c in range(3):
                work[now, i, 5 + c] = drift[v, c] if len(drift) > 0 else 0.0
        for plane in range(5):
            n = _cut(work[now], n, plane, half, near, perspective, work[1 - now])
            now = 1 - now
            if n < 3:
                break
        if n < 3 or not _plane(camera, uv, spread[f], perspective, scale, cx, cy, planes[m]):
            continue
        p = work[now]
        area = 0.0
        for i in range(n):
            s = scale / p[i, 2] if perspective else scale
            points[k + i, 0] = cx + p[i, 0] * s
            points[k + i, 1] = cy - p[i, 1] * s
        for i in range(n):
            j = (i + 1) % n
            ax, ay = points[k + i, 0] - points[k, 0], points[k + i, 1] - points[k, 1]
            bx, by = points[k + j, 0] - points[k, 0], points[k + j, 1] - points[k, 1]
            area += ax * by - bx * ay
        if not abs(area) > 1e-300:
            continue
        for i in range(n):
            j = (i + 1) % n
            outlined[k + i] = p[i, 4] != 0.0
            if perspective:
                # over the whole slice: the depth may shrink by what the speed allows in half of it
                v = max(p[i, 3], p[j, 3])
                z = min(p[i, 2], p[j, 2]) - v * slice_length / 2.0
                wide = 0.0
                for e in (i, j):
                    wide = max(wide, 1.0 + (p[e, 0] ** 2 + p[e, 1] ** 2) / p[e, 2] ** 2)
                bound = 0.0
                if v > 0.0:
                    bound = 1.1 * scale * v * np.sqrt(wide) / z if z > 0.0 else np.inf
                speeds[k + i, 0] = bound
                speeds[k + i, 1] = bound
                reach[k + i] = bound
                continue
            reach[k + i] = scale * max(p[i, 3], p[j, 3])
            nx, ny = points[k + j, 1] - points[k + i, 1], points[k + i, 0] - points[k + j, 0]
            long = np.sqrt(nx * nx + ny * ny)
            for e in range(2):
                at = p[j] if e else p[i]
                speeds[k + i, e] = scale * at[3]
                if len(drift) > 0 and long > 0.0:
                    across = abs(at[5] * nx + at[6] * ny) / long + at[7]
                    speeds[k + i, e] = min(speeds[k + i, e], across)
        if area < 0.0:
            _reverse(points[k : k + n], speeds[k : k + n], reach[k : k + n], outlined[k : k + n], n)
        owners[m] = face_owners[f]
        k += n
        m += 1
        starts[m] = k
    return k, m


@njit(cache=True, nogil=True)
def _reverse(points, speeds, reach, outlined, n):  # type: ignore[no-untyped-def]
    """Turn a loop round; an edge's data move with the edge."""
    points[:] = points[::-1].copy()
    old_speeds, old_reach, old_flags = speeds.copy(), reach.copy(), outlined.copy()
    for i in range(n):
        j = (2 * n - 2 - i) % n
        speeds[i, 0], speeds[i, 1] = old_speeds[j, 1], old_speeds[j, 0]
        reach[i] = old_reach[j]
        outlined[i] = old_flags[j]


@njit(cache=True, nogil=True)
def _plane(camera, uv, spread, perspective, scale, cx, cy, out):  # type: ignore[no-untyped-def]
    """Fill the coefficients of nearness, u q, v q and q in the picture; return False for a face seen edge-on."""
    o = camera[spread[0]]
    e1 = camera[spread[1]] - o
    e2 = camera[spread[2]] - o
    n = np.cross(e1, e2)
    squared = n[0] ** 2 + n[1] ** 2 + n[2] ** 2
    d = n[0] * o[0] + n[1] * o[1] + n[2] * o[2]
    lead = d if perspective else n[2]
    if squared == 0.0 or lead == 0.0:
        return False
    # (X, Y) of a picture point at depth 1, or in the world: ((x - cx) / scale, (cy - y) / scale)
    if perspective:
        near_x, near_y, near_1 = n[0] / d, n[1] / d, n[2] / d
    else:
        near_x, near_y, near_1 = n[0] / n[2], n[1] / n[2], -d / n[2]
    _to_picture(near_x, near_y, near_1, scale, cx, cy, out[0])
    g1 = np.cross(e2, n)
    g2 = np.cross(n, e1)
    for c in range(2):
        t0, t1, t2 = uv[spread[0], c], uv[spread[1], c], uv[spread[2], c]
        g = ((t1 - t0) * g1 + (t2 - t0) * g2) / squared
        rest = t0 - (g[0] * o[0] + g[1] * o[1] + g[2] * o[2])
        if perspective:
            # u q = (g . q (X, Y, 1) z) q / z ... with P = (X, Y, 1) / q: u q = g . (X, Y, 1) + rest q
            _to_picture(g[0] + rest * near_x, g[1] + rest * near_y, g[2] + rest * near_1, scale, cx, cy, out[1 + c])
        else:
            # P = (X, Y, -nearness)
            _to_picture(g[0] - g[2] * near_x, g[1] - g[2] * near_y, rest - g[2] * near_1, scale, cx, cy, out[1 + c])
    if perspective:
        out[3] = out[0]
    else:
        out[3, 0], out[3, 1], out[3, 2] = 0.0, 0.0, 1.0
    return True


@njit(cache=True, nogil=True)
def _to_picture(a, b, c, scale, cx, cy, out):  # type: ignore[no-untyped-def]
    out[0] = a / scale
    out[1] = -b / scale
    out[2] = c - a * cx / scale + b * cy / scale
