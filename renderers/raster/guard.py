"""Surfaces that the device would misplace, found and cut in float64 before its float32 sees them.

The device rounds every vertex to float32 and cuts triangles at the picture's borders in float32 too: a vertex that is
2^23 pixels away moves whatever is seen of its triangle by a good part of a pixel. Such objects ("far" ones) are placed
here, pass by pass, cut to a frustum a little wider than the picture, and handed over in clip space. Everything else
goes the device's own way. Objects as a whole, so that triangles which share an edge are treated alike.

Three more cases need float64: a perspective camera in a polygon's plane sees nothing of it; an orthographic one sees a
surface at depth 0 (visible: depth >= 0); and where objects lie on top of each other in one plane, a triangle's depth is
rounded by a share of its greatest one, which where it is nearest may be more than what tells layers apart. There
polygons are cut into shells of depth.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.geometry import Body
from aliasbench.renderers.raster.cutting import DEEP, cut_shells, cut_side
from aliasbench.renderers.raster.placement import Placement
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import FloatArray, Scene

# in half pictures: how much wider than the picture the frustum is that far triangles are cut to
_WIDTH = 2.0
# half pixels: float32 rounds there by 2^-8 of a pixel, one of a device's own sub-pixel steps
_REACH = 2.0**18
# relative roundings: what is beyond doubt in float32; float64's in the sums at hand; beyond anything float32 can hold
_SURE, _ROUNDING, _HUGE = 2.0**-20, 2.0**-48, 2.0**60
# half pictures: float64 rounds there by 2^-8 of one
_MOST = 2.0**45

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """Triangles of far objects, cut.

    Attributes
    ----------
    corners : (m, 3, 3) float64
        Taken to clip space by `matrix`.
    uv : (m, 3, 2) float64
    nearest : (m,) int64
        Of each triangle the corner that is nearest to the camera.
    surfaces : (m,) int32
        For each triangle the index of its object.
    triangles : (m,) int64
        What it was cut from: the number of a triangle, counted body by body.
    bodies : (m,) int32
        The number of its body.
    matrix : (4, 4) float64
    """

    corners: FloatArray
    uv: FloatArray
    nearest: NDArray[np.int64]
    surfaces: NDArray[np.int32]
    triangles: NDArray[np.int64]
    bodies: NDArray[np.int32]
    matrix: FloatArray


class Guard:
    """Which objects of a scene are far at a time; what cannot change is asked once."""

    def __init__(self, scene: Scene, placement: Placement, size: tuple[int, int]) -> None:
        self._bodies = placement.bodies
        # a body's vertices lie in a box about its origin
        self._boxes = np.array([np.abs(b.vertices).max(axis=0, initial=0.0) for b in self._bodies]).reshape(-1, 3)
        self._perspective = scene.camera.projection == "perspective"
        self._polygon = np.array([s.is_polygon for s in scene.objects], dtype=bool)
        self._limit = _REACH / max(size)
        self._layered = any(b.layer for b in self._bodies)
        still = scene.camera.is_static and scene.camera.lens_radius == 0.0
        self._changing = np.array([not (still and b.motion.is_static) for b in self._bodies], dtype=bool)
        self._steady: BoolArray | None = None

    def far_objects(self, matrices: FloatArray) -> BoolArray:
        """Return for every object whether the device would misplace it under (n, 4, 4) float64 clip matrices."""
        if self._steady is None:
            self._steady = np.zeros(len(self._polygon), dtype=bool)
            self._steady.flags.writeable = False
            self._steady = self._find(matrices, np.flatnonzero(~self._changing))
        if not self._changing.any():
            return self._steady
        near = _surely_near(matrices, self._boxes, self._limit, self._perspective)
        if self._layered:
            near &= _surely_shallow(matrices, self._boxes, self._perspective)
        doubtful = self._changing & ~near
        return self._find(matrices, np.flatnonzero(doubtful)) if doubtful.any() else self._steady

    def _find(self, matrices: FloatArray, numbers: NDArray[np.int64]) -> BoolArray:
        out = np.zeros(len(self._polygon), dtype=bool) if self._steady is None else self._steady.copy()
        for number in numbers.tolist():
            body = self._bodies[number]
            flat = self._polygon[body.surfaces]
            box, layered = self._boxes[number], flat & self._layered
            found = _far_triangles(body, matrices[number], box, self._limit, flat, layered, self._perspective)
            out[body.surfaces[found]] = True
        return out

    def cut(self, matrices: FloatArray, far: BoolArray) -> Pieces:
        """Return what may be seen of the far objects under (n, 4, 4) float64 clip matrices.

        Raises
        ------
        InputError
            If an orthographic picture is so small a part of an object that float64 cannot place it either.
        """
        corners, surfaces, bodies = [np.zeros((0, 3, 7))], [np.zeros(0, np.int32)], [np.zeros(0, np.int32)]
        first = 0
        for number, (body, matrix) in enumerate(zip(self._bodies, matrices, strict=True)):
            chosen = far[body.surfaces]
            if chosen.any():
                cut, owners = _cut_body(body, matrix, chosen, self._polygon, self._perspective)
                if self._layered:
                    cut, owners = cut_shells(cut, owners, self._perspective)
                cut[..., 6] += first
                corners.append(cut)
                surfaces.append(owners)
                bodies.append(np.full(len(owners), number, np.int32))
            first += len(body.triangles)
        joined = np.concatenate(corners)
        place, uv, triangles = joined[..., :4], joined[..., 4:6], joined[:, 0, 6].astype(np.int64)
        nearest = np.argmin(place[..., 3], axis=1)
        matrix = np.eye(4)
        if self._perspective:
            # z is the same for a whole body: one matrix does for all when it is divided out
            matrix[2:, 2:] = [[0.0, 1.0], [1.0, 0.0]]
            place = place[..., [0, 1, 3]] / place[..., 2:3]
        owners = np.concatenate(surfaces)
        return Pieces(place[..., :3], uv, nearest, owners, triangles, np.concatenate(bodies), matrix)


def _surely_near(matrices: FloatArray, boxes: FloatArray, limit: float, perspective: bool) -> BoolArray:
    """Return for every body whether its box alone shows that no triangle of it is far."""
    spread = np.einsum("nij,nj->ni", np.abs(matrices[:, :, :3]), boxes)
    reach = (np.abs(matrices[:, :, 3]) + spread)[:, [0, 1, 3]].max(axis=1)
    bounded = np.abs(matrices).max(axis=(1, 2)) < _HUGE
    if perspective:
        out: BoolArray = bounded & (reach < limit * (matrices[:, 3, 3] - spread[:, 3]))
        return out
    # nor at depth 0
    return bounded & (reach < limit) & (np.abs(matrices[:, 2, 3]) * (1 - _SURE) > spread[:, 2] * (1 + _SURE))


def _surely_shallow(matrices: FloatArray, boxes: FloatArray, perspective: bool) -> BoolArray:
    """Return for every body whether its box alone shows that none of its triangles is deep."""
    row = 3 if perspective else 2
    spread = (np.abs(matrices[:, row, :3]) * boxes).sum(axis=1)
    middle = matrices[:, row, 3]
    out: BoolArray = middle + spread <= DEEP * (middle - spread)
    return out


def _far_triangles(
    body: Body,
    matrix: FloatArray,
    box: FloatArray,
    limit: float,
    flat: BoolArray,
    layered: BoolArray,
    perspective: bool,
) -> BoolArray:
    """Return which triangles of a body are far; `flat` says which belong to polygons, `layered` where layers matter."""
    if np.abs(matrix).max() > _HUGE:
        return np.ones(len(body.triangles), dtype=bool)
    most = np.abs(matrix[:, :3]) @ box + np.abs(matrix[:, 3])
    reach = float(most[[0, 1, 3]].max())
    if perspective:
        # only what comes close to the eye or passes it can be, or what is seen edge-on
        close = body.vertices @ matrix[3, :3] + matrix[3, 3] < reach / limit
        out = close[body.triangles].any(axis=1) | flat | (reach > _HUGE)
    elif reach < limit:
        at_camera = np.abs(body.vertices @ matrix[2, :3] + matrix[2, 3]) <= _SURE * most[2]
        out = at_camera[body.triangles].all(axis=1) | layered
    else:
        out = np.ones(len(body.triangles), dtype=bool)
    chosen = np.flatnonzero(out)
    if len(chosen):
        corners = body.vertices[body.triangles[chosen]]
        out[chosen] = _far(corners, matrix, limit, flat[chosen], layered[chosen], perspective)
    return out


def _far(
    corners: FloatArray, matrix: FloatArray, limit: float, flat: BoolArray, layered: BoolArray, perspective: bool
) -> BoolArray:
    """Return which triangles with these corners (m, 3, 3) are far."""
    place = corners @ matrix[:, :3].T + matrix[:, 3]
    terms = _terms(corners, matrix)
    reach = terms[..., [0, 1, 3]].max(axis=(1, 2))
    w = place[..., 3]
    slack = (_SURE * reach)[:, None]
    hidden = np.zeros(len(reach), dtype=bool)
    for axis in (0, 1):
        for sign in (1.0, -1.0):
            hidden |= (sign * place[..., axis] > _WIDTH * w + slack).all(axis=1)
    huge: BoolArray = reach > _HUGE
    depth = w if perspective else place[..., 2]
    deep = layered & (depth.max(axis=1) > DEEP * np.maximum(depth.min(axis=1), 0.0))
    if not perspective:
        at_camera = (np.abs(place[..., 2]) <= _SURE * terms[..., 2]).all(axis=1)
        return huge | (~hidden & ((reach > limit) | at_camera | deep))
    hidden |= (w < -slack).all(axis=1)
    height, normal = _plane(place)
    # what is seen of the plane n . (a w, b w, w) = height has |a|, |b| <= _WIDTH
    widest = _WIDTH * (normal[:, 0] + normal[:, 1]) + normal[:, 2]
    nearest = np.maximum(w.min(axis=1) * widest, height)
    edge_on = flat & (height <= _SURE * reach * normal.max(axis=1))
    return huge | (~hidden & ((reach * widest > limit * nearest) | edge_on | deep))


def _terms(points: FloatArray, matrix: FloatArray) -> FloatArray:
    """Return (..., 4) the sums of the sizes of all terms in `matrix` times points: what rounding is relative to."""
    out: FloatArray = np.abs(points) @ np.abs(matrix[:, :3]).T + np.abs(matrix[:, 3])
    return out


def _plane(place: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return |n . p| (m,) and |n| by components (m, 3) of the planes of triangles, in (x, y, w) of clip space."""
    p = place[..., [0, 1, 3]]
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    return np.abs((normal * p[:, 0]).sum(axis=1)), np.abs(normal)


def _cut_body(
    body: Body, matrix: FloatArray, chosen: BoolArray, polygon: BoolArray, perspective: bool
) -> tuple[FloatArray, NDArray[np.int32]]:
    """Return the chosen triangles cut, (m, 3, 7): clip space, uv and number in the body, and the object of each."""
    place = body.vertices @ matrix[:, :3].T + matrix[:, 3]
    terms = _terms(body.vertices, matrix)
    if not perspective:
        place[:, 2] = np.where(np.abs(place[:, 2]) <= _ROUNDING * terms[:, 2], 0.0, place[:, 2])
    corners = np.concatenate([place, body.uv, np.zeros((len(place), 1))], axis=1)[body.triangles[chosen]]
    corners[..., 6] = np.flatnonzero(chosen)[:, None]
    owners = body.surfaces[chosen]
    if perspective:
        height, normal = _plane(corners[..., :4])
        reach = terms[:, [0, 1, 3]].max(axis=1)[body.triangles[chosen]].max(axis=1)
        seen = ~(polygon[owners] & (height <= _ROUNDING * reach * normal.max(axis=1)))
        corners, owners = corners[seen], owners[seen]
    sides = [(1.0, 0.0, 0.0, _WIDTH), (-1.0, 0.0, 0.0, _WIDTH), (0.0, 1.0, 0.0, _WIDTH), (0.0, -1.0, 0.0, _WIDTH)]
    # clip space ends at z = w under perspective (the nearest depth), at z = 0 otherwise (the camera's plane)
    if not perspective:
        _check_size(corners[..., :4], owners, sides)
    for side in (*sides, (0.0, 0.0, -1.0, 1.0) if perspective else (0.0, 0.0, 1.0, 0.0)):
        corners, owners = cut_side(corners, owners, side)
    return corners, owners


def _check_size(place: FloatArray, owners: NDArray[np.int32], sides: Sequence[Sequence[float]]) -> None:
    reach = np.abs(place[..., :2]).max(axis=(1, 2))
    seen = ~(place @ np.array(sides).T < 0.0).all(axis=1).any(axis=1)
    beyond = np.flatnonzero(seen & (reach > _MOST))
    if len(beyond):
        raise InputError(
            f"object {owners[beyond[0]]} reaches {reach[beyond[0]] / 2:.3g} pictures far; "
            f"the rasterizer places up to {_MOST / 2:.3g}; use a larger camera height"
        )
