"""Where moving faces are at any time, computed inside a kernel: what the shutter's integrals are made of.

The same places as `pieces.pieces_at` gives for a whole scene at one instant, but of a few faces, for the price of a few
faces: a motion and the camera's pose are joined in one matrix, applied to the face's corners, and the face is cut and
projected by the same functions.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.kernel_parts import allocating, called
from aliasbench.renderers.reference.clipping import (
    NEAR_PARALLEL,
    NEAR_PERSPECTIVE,
    ONE_CORNER,
    PLANES,
    cross,
    cut_polygon,
    merge_corners,
    minus,
    nearness_plane,
    to_picture,
)  # fmt: skip
from aliasbench.renderers.reference.faces import Faces
from aliasbench.renderers.reference.paths import Paths
from aliasbench.renderers.reference.pieces import MARGIN_PX
from aliasbench.scenes.model import FloatArray
from aliasbench.scenes.motion import object_matrix, spin_turns
from aliasbench.scenes.projection import View

IntArray = NDArray[np.int64]

STILL, BETWEEN, TURNING = 0, 1, 2


class Movers(NamedTuple):
    """All that places the faces of a scene at a time within one frame interval, as arrays for a kernel.

    Attributes
    ----------
    vertices, corners, starts, spread
        Of `Faces`.
    owners, motions : (m,) int64
        The object and the motion of each face.
    kinds : (k,) int64
        Of each motion: STILL, BETWEEN two matrices, or TURNING.
    data : (k, 24) float64
        BETWEEN: rows of the matrices at the begin and the end of the interval. TURNING: axis, center, revolutions at
        the begin, revolutions per interval, way at the begin, velocity per interval.
    camera : (30,) float64
        Position and its velocity, viewing axis and its velocity, up, and right, up, forward at the begin; of a frame
        interval. Then near depth, half width and height of the picture with its margin, as slopes or lengths; scale,
        and the picture's middle.
    turns : bool
        Whether the camera turns.
    perspective : bool
    widest : int
        The most corners of a face, with what cutting adds.
    """

    vertices: FloatArray
    corners: IntArray
    starts: IntArray
    spread: IntArray
    owners: IntArray
    motions: IntArray
    kinds: IntArray
    data: FloatArray
    camera: FloatArray
    turns: bool
    perspective: bool
    widest: int


def movers_of(faces: Faces, paths: Paths, view: View, frame: int) -> Movers:
    """Return what places a scene's faces; `view` is the camera as the shutter opens."""
    distinct = {m: k for k, m in enumerate(dict.fromkeys(paths.motions))}
    kinds, data = np.zeros(len(distinct), np.int64), np.zeros((len(distinct), 24))
    fps = paths.animation.fps
    for motion, k in distinct.items():
        if motion.is_static:
            continue
        if paths.interpolated or motion.matrices is not None:
            kinds[k] = BETWEEN
            for end, fraction in enumerate((0.0, 1.0)):
                data[k, 12 * end : 12 * end + 12] = object_matrix(motion, paths.animation, frame, fraction)[:3].ravel()
            continue
        kinds[k] = TURNING
        velocity = np.asarray(motion.velocity) / fps
        data[k, 8:11], data[k, 11:14] = velocity * frame, velocity
        data[k, 2] = 1.0
        if motion.spin is not None:
            axis = np.asarray(motion.spin.axis, dtype=np.float64)
            data[k, 0:3], data[k, 3:6] = axis / np.linalg.norm(axis), motion.spin.center
            data[k, 6] = spin_turns(motion.spin, paths.animation, frame, 0.0)
            data[k, 7] = motion.spin.rev_per_s / fps
    camera = paths.camera
    velocity = np.asarray(camera.velocity, dtype=np.float64) / fps
    target = velocity if camera.target_velocity is None else np.asarray(camera.target_velocity) / fps
    sight = np.asarray(camera.target, dtype=np.float64) - np.asarray(camera.position) + (target - velocity) * frame
    start = np.asarray(camera.position, dtype=np.float64) + velocity * frame
    furthest = float(np.abs(paths.positions(faces.vertices, faces.ranges, frame, 0.0) - start).max(initial=1e-285))
    near = (NEAR_PERSPECTIVE if view.perspective else NEAR_PARALLEL) * furthest
    half = np.array([view.width / 2 + MARGIN_PX, view.height / 2 + MARGIN_PX]) / view.scale
    pose = np.concatenate(
        [start, velocity, sight, target - velocity, np.asarray(camera.up, dtype=np.float64),
         view.right, view.up, view.forward, [near], half, [view.scale, view.width / 2, view.height / 2]]
    )  # fmt: skip
    objects = np.array([distinct[m] for m in paths.motions], np.int64)
    return Movers(
        faces.vertices, faces.corners, faces.starts, faces.spread, faces.owners,
        objects[faces.owners] if len(faces.owners) else np.zeros(0, np.int64), kinds, data, pose,
        bool((target != velocity).any()), view.perspective, int(np.diff(faces.starts).max(initial=0)) + PLANES + 1,
    )  # fmt: skip


class Room(NamedTuple):
    """Where placed faces are written: as `Pieces`, and for each its place in the list asked for (`which`).

    `order` counts them: 0, 1, ...
    """

    work: FloatArray
    points: FloatArray
    starts: IntArray
    planes: FloatArray
    owners: IntArray
    which: IntArray
    order: IntArray


@njit(cache=True, nogil=True, error_model="numpy")
def room_for(count: int, widest: int) -> Room:
    """Return room for the pieces of `count` faces."""
    return Room(
        np.empty((2, widest, 5)), np.empty((count * widest, 2)), np.zeros(count + 1, np.int64),
        np.empty((count, 1, 3)), np.empty(count, np.int64), np.empty(count, np.int64), np.arange(count),
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def place_faces(movers: Movers, faces: IntArray, count: int, time: float, room: Room) -> int:
    """Write the pieces of faces[:count] at a time (a fraction of the frame interval); return their number."""
    camera, perspective = movers.camera, movers.perspective
    vertices, corners, first, spread = movers.vertices, movers.corners, movers.starts, movers.spread
    work, points, starts, planes = room.work, room.points, room.starts, room.planes
    pose, matrix = np.empty((4, 3)), np.empty((3, 4))
    spot = np.empty((3, 3))
    _camera_pose(camera, movers.turns, time, pose)
    near, half = camera[24], camera[25:27]
    scale, cx, cy = camera[27], camera[28], camera[29]
    k, m, last = 0, 0, -1
    close = ONE_CORNER * 2.0 * max(cx, cy)
    edge = np.empty(work.shape[1], np.int64)
    starts[0] = 0
    for a in range(count):
        f = faces[a]
        if movers.motions[f] != last:
            last = movers.motions[f]
            _motion_matrix(movers.kinds[last], movers.data[last], pose, time, matrix)
        n = first[f + 1] - first[f]
        now = 0
        for i in range(n):
            _apply(matrix, vertices[corners[first[f] + i]], work[0, i])
            work[0, i, 3] = 0.0
            work[0, i, 4] = 0.0
        # what no corner is beyond needs no cutting
        beyond = 0
        for i in range(n):
            x, y, z = work[0, i, 0], work[0, i, 1], work[0, i, 2]
            wide, high = (half[0] * z, half[1] * z) if perspective else (half[0], half[1])
            beyond |= (not z >= near) * 1 | (not x <= wide) * 2 | (not x >= -wide) * 4
            beyond |= (not y <= high) * 8 | (not y >= -high) * 16
        for plane in range(5):
            if beyond >> plane & 1:
                n = cut_polygon(work[now], n, plane, half, near, perspective, work[1 - now])
                now = 1 - now
                if n < 3:
                    break
        if n < 3:
            continue
        for i in range(3):
            _apply(matrix, vertices[spread[f, i]], spot[i])
        normal = cross(minus(spot[1], spot[0]), minus(spot[2], spot[0]))
        seen, near_x, near_y, near_1 = nearness_plane(spot[0], normal, perspective)
        if not seen:
            continue
        to_picture(near_x, near_y, near_1, scale, cx, cy, planes[m, 0])
        p = work[now]
        area = 0.0
        for i in range(n):
            s = scale / p[i, 2] if perspective else scale
            points[k + i, 0] = cx + p[i, 0] * s
            points[k + i, 1] = cy - p[i, 1] * s
        n = merge_corners(points[k : k + n], n, close, edge)
        for i in range(1, n - 1):
            ax, ay = points[k + i, 0] - points[k, 0], points[k + i, 1] - points[k, 1]
            bx, by = points[k + i + 1, 0] - points[k, 0], points[k + i + 1, 1] - points[k, 1]
            area += ax * by - bx * ay
        if not abs(area) > 1e-300:
            continue
        if area < 0.0:
            for i in range(n // 2):
                j = n - 1 - i
                for c in range(2):
                    points[k + i, c], points[k + j, c] = points[k + j, c], points[k + i, c]
        room.owners[m] = movers.owners[f]
        room.which[m] = a
        k += n
        m += 1
        starts[m] = k
    return m


@called
def _apply(matrix: FloatArray, p: FloatArray, out: FloatArray) -> None:
    for c in range(3):
        out[c] = p[0] * matrix[c, 0] + p[1] * matrix[c, 1] + p[2] * matrix[c, 2] + matrix[c, 3]


@called
def _camera_pose(camera: FloatArray, turns: bool, time: float, pose: FloatArray) -> None:
    """Fill right, up, forward and the position."""
    for c in range(3):
        pose[3, c] = camera[c] + camera[3 + c] * time
    if not turns:
        for k in range(3):
            for c in range(3):
                pose[k, c] = camera[15 + 3 * k + c]
        return
    length = 0.0
    for c in range(3):
        pose[2, c] = camera[6 + c] + camera[9 + c] * time
        length += pose[2, c] * pose[2, c]
    length = np.sqrt(length)
    for c in range(3):
        pose[2, c] /= length
    right = cross(pose[2], camera[12:15])
    length = np.sqrt(right[0] * right[0] + right[1] * right[1] + right[2] * right[2])
    for c in range(3):
        pose[0, c] = right[c] / length
    up = cross(pose[0], pose[2])
    for c in range(3):
        pose[1, c] = up[c]


@allocating
def _motion_matrix(kind: int, data: FloatArray, pose: FloatArray, time: float, out: FloatArray) -> None:
    """Fill the (3, 4) matrix that takes a place at rest to camera coordinates."""
    moved = np.empty((3, 4))
    if kind == BETWEEN:
        for r in range(3):
            for c in range(4):
                moved[r, c] = (1.0 - time) * data[4 * r + c] + time * data[12 + 4 * r + c]
    else:
        moved[:] = 0.0
        for r in range(3):
            moved[r, r] = 1.0
    if kind == TURNING:
        turn = data[6] + data[7] * time
        if turn != 0.0:
            _rotate(data, turn, moved)
        for r in range(3):
            back = data[3 + r] - (moved[r, 0] * data[3] + moved[r, 1] * data[4] + moved[r, 2] * data[5])
            moved[r, 3] = (back if turn != 0.0 else 0.0) + data[8 + r] + data[11 + r] * time
    for r in range(3):
        moved[r, 3] -= pose[3, r]
    for r in range(3):
        for c in range(4):
            out[r, c] = pose[r, 0] * moved[0, c] + pose[r, 1] * moved[1, c] + pose[r, 2] * moved[2, c]


@called
def _rotate(data: FloatArray, turns: float, out: FloatArray) -> None:
    """Fill the rotation by `turns` revolutions; whole and quarter turns are exact, as in `scenes.motion`."""
    reduced = turns - np.floor(turns + 0.5)
    quarter = np.floor(reduced * 4.0 + 0.5)
    rest = 2.0 * np.pi * (reduced - quarter / 4.0)
    c, s = np.cos(rest), np.sin(rest)
    q = int(quarter) % 4
    if q == 1:
        c, s = -s, c
    elif q == 2:
        c, s = -c, -s
    elif q == 3:
        c, s = s, -c
    x, y, z = data[0], data[1], data[2]
    d = 1.0 - c
    out[0, 0], out[0, 1], out[0, 2] = c + d * x * x, d * x * y - s * z, d * x * z + s * y
    out[1, 0], out[1, 1], out[1, 2] = d * x * y + s * z, c + d * y * y, d * y * z - s * x
    out[2, 0], out[2, 1], out[2, 2] = d * x * z - s * y, d * y * z + s * x, c + d * z * z
