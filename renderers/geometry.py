"""The scene as the engines want it: triangles in rigid bodies, and an order for surfaces that lie in one plane.

Two needs meet here, once for both renderers:

* Triangles that move alike form one `Body`, so that edges they share stay shared (rounded alike) and a still scene is a
  single mesh. A body's vertices are relative to its own origin: float32 is used only after moving near.
* Of coplanar surfaces the later object wins. An engine that keeps the nearest hit cannot know that, so every object has
  a `layer`, 0 for most, higher where it lies in the plane of an earlier object that it may overlap; layer k is brought
  towards the eye by k * LAYER_STEP of its distance. Scaling about the eye (or sliding along an orthographic axis) moves
  no point of the picture, so only the order changes. Where rays graze the plane, what is known of a depth is less by
  the depth's ratio to the eye's height above the plane: by k * LAYER_TILT times that ratio it is brought nearer still.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.errors import UnsupportedScene
from aliasbench.scenes.model import FloatArray, Motion, Scene, Surface
from aliasbench.scenes.projection import View

# Relative step between layers: some 60 ulp of float32, well over the rounding of a ray-plane hit (a few ulp) and far
# below anything a scene means by two different planes.
LAYER_STEP = 2.0**-18
# The same for two planes whose corners, at most 8 times as far away as a hit, are rounded by half an ulp each.
LAYER_TILT = 2.0**-18
_MOST_TILT = 2.0**-14  # of all layers of a plane together: a sixteen thousandth of the distance above it
_WIDEST = 4.0  # pictures: what of a layered surface is farther out of sight does not count
MOST_LAYERS = 4096  # together 1.6 % of the distance; beyond, more and more would be brought before what is nearer
_AT_ONCE = 64  # outlines that are cut with another at a time
_PLANE_TOLERANCE = 1e-7  # two planes closer than this (relative to the scene) are one


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """Triangles that move together and lie in one layer.

    Attributes
    ----------
    motion : Motion
    layer : int
    origin : (3,) float64
        World position at rest to which the vertices are relative.
    vertices : (n, 3) float64
        Relative to `origin`.
    triangles : (m, 3) int32
    uv : (n, 2) float64
        Zero where a surface has none.
    surfaces : (m,) int32
        For each triangle the index of its object in `scene.objects`.
    plane : (4,) float64
        (n, k) of the plane n . x = k that all vertices of a layer above 0 lie in, relative to `origin`; else zeros.
    tilt : float
        By how much the layer is brought nearer where rays graze its plane, see `LAYER_TILT`.
    stacked : (m,) bool
        Which triangles lie in a plane that has layers.
    """

    motion: Motion
    layer: int
    origin: FloatArray
    vertices: FloatArray
    triangles: NDArray[np.int32]
    uv: FloatArray
    surfaces: NDArray[np.int32]
    plane: FloatArray
    tilt: float
    stacked: NDArray[np.bool_]

    def local_matrix(self, world: FloatArray, eye: FloatArray) -> FloatArray:
        """Return the (4, 4) float64 matrix from body vertices to the world relative to `eye`.

        `world` is `motion.object_matrix` at the time.
        """
        out = world.copy()
        out[:3, 3] = world[:3, :3] @ self.origin + world[:3, 3] - eye
        return out


def build_bodies(scene: Scene) -> tuple[Body, ...]:
    """Return the scene's triangles grouped by motion, layer and, above layer 0, plane, as they first appear."""
    layers, planes = _stack_planes(scene)
    highest: dict[int, int] = {}
    for plane, layer in zip(planes, layers.tolist(), strict=True):
        highest[plane] = max(highest.get(plane, 0), layer)
    tops = np.array([highest[plane] for plane in planes], np.int64)
    groups: dict[tuple[Motion, int, int], list[int]] = {}
    for index, surface in enumerate(scene.objects):
        layer = int(layers[index])
        groups.setdefault((_effective(surface.motion), layer, planes[index] if layer else -1), []).append(index)
    return tuple(_build_body(scene, motion, layer, tops, members) for (motion, layer, _), members in groups.items())


def _build_body(scene: Scene, motion: Motion, layer: int, tops: NDArray[np.int64], members: list[int]) -> Body:
    surfaces = [scene.objects[i] for i in members]
    world = np.concatenate([s.vertices for s in surfaces])
    origin = (world.min(axis=0) + world.max(axis=0)) / 2 if len(world) else np.zeros(3)
    plane, tilt = np.zeros(4), 0.0
    if layer:
        normal, offset = _plane_of(surfaces[0])
        plane = np.append(normal, offset - normal @ origin)
        tilt = layer * min(LAYER_TILT, _MOST_TILT / float(tops[members[0]]))
    starts = np.cumsum([0] + [len(s.vertices) for s in surfaces[:-1]])
    return Body(
        motion,
        layer,
        origin,
        world - origin,
        np.concatenate([s.triangles + start for s, start in zip(surfaces, starts, strict=True)]).astype(np.int32),
        np.concatenate([s.uv if s.uv is not None else np.zeros((len(s.vertices), 2)) for s in surfaces]),
        np.concatenate([np.full(len(s.triangles), i, np.int32) for i, s in zip(members, surfaces, strict=True)]),
        plane,
        tilt,
        np.concatenate([np.full(len(s.triangles), tops[i] > 0) for i, s in zip(members, surfaces, strict=True)]),
    )


def layered_corners(bodies: Sequence[Body]) -> FloatArray:
    """Return (m, 3, 3): the corners at rest of all triangles that have a layer."""
    found = [(body.vertices + body.origin)[body.triangles] for body in bodies if body.layer]
    return np.concatenate([np.zeros((0, 3, 3)), *found])


def layered_depth(corners: FloatArray, view: View, travel: float = 0.0, start: float = 0.0) -> float:
    """Return the distance that layers under parallel rays are a share of: the greatest depth, beyond where rays start,
    or half width of what can be seen, of anything with a layer at rest (`layered_corners`).

    What of it is out of sight does not count, or a sheet that reaches far out would be brought behind the camera.
    `travel` is how far the camera may move.
    """
    if not len(corners):
        return 1.0
    wide = _WIDEST * (max(view.width, view.height) / view.scale + travel)
    place = view.to_camera(corners)
    normal = np.cross(place[:, 1] - place[:, 0], place[:, 2] - place[:, 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        seen = np.abs((normal * place[:, 0]).sum(axis=1)) + wide * np.abs(normal[:, :2]).sum(axis=1)
        depth = np.fmin(seen / np.abs(normal[:, 2]), np.abs(place[..., 2]).max(axis=1)) - start
    return max(0.0, float(depth.max()), min(wide, float(np.abs(place[..., :2]).max()))) or 1.0


def coplanar_layers(scene: Scene) -> NDArray[np.int32]:
    """Return the layer of every object: one more than the highest earlier object in its plane that it may overlap.

    Objects that move alike are compared as they lie (sharing only an edge is no overlap); objects that move differently
    but stay in one plane may overlap at some time, so the later one is always put above. Meshes have layer 0.

    Raises
    ------
    UnsupportedScene
        If more than `MOST_LAYERS` lie on top of each other.
    """
    return _stack_planes(scene)[0]


def _stack_planes(scene: Scene) -> tuple[NDArray[np.int32], list[int]]:
    """Return the layer of every object, and a number of its plane, -1 for meshes."""
    layers = np.zeros(len(scene.objects), np.int32)
    numbers = [-1] * len(scene.objects)
    planes: dict[tuple[int, ...], list[int]] = {}
    extent = _scene_extent(scene)
    for index, surface in enumerate(scene.objects):
        if surface.is_polygon:
            normal, offset = _plane_of(surface)
            key = np.round(np.append(normal, offset / extent) / _PLANE_TOLERANCE).astype(np.int64)
            planes.setdefault(tuple(key.tolist()), []).append(index)
    for number, members in enumerate(planes.values()):
        for index in members:
            numbers[index] = number
        if len(members) > 1:
            layers[members] = _stack([scene.objects[i] for i in members])
    return layers, numbers


def _stack(surfaces: list[Surface]) -> NDArray[np.int32]:
    """Return the layers of surfaces that lie in one plane."""
    motions = {m: k for k, m in enumerate(dict.fromkeys(_effective(s.motion) for s in surfaces))}
    outlines = _Outlines(surfaces, [motions[_effective(s.motion)] for s in surfaces])
    highest = np.full(len(motions), -1)  # layer so far, by motion
    top = np.full(len(outlines.kinds), -1)  # the same by outline
    layers = np.zeros(len(surfaces), np.int32)
    for i, outline in enumerate(outlines.of_surface):
        kind = outlines.kinds[outline]
        others = max(highest[:kind].max(initial=-1), highest[kind + 1 :].max(initial=-1))
        layer = int(max(others, outlines.highest_below(outline, top))) + 1
        if layer > MOST_LAYERS:
            raise UnsupportedScene(
                f"more than {MOST_LAYERS} objects on top of each other in one plane; move them apart, each a little "
                "nearer than the one before"
            )
        layers[i] = top[outline] = layer
        highest[kind] = max(highest[kind], layer)
    return layers


def _effective(motion: Motion) -> Motion:
    return Motion() if motion.is_static else motion


class _Outlines:
    """The outlines of coplanar surfaces, each once however many surfaces have it, and which of them overlap.

    Parameters
    ----------
    surfaces : list of Surface
    kinds : list of int
        Which motion each has; only outlines of one motion are compared.
    """

    def __init__(self, surfaces: list[Surface], kinds: list[int]) -> None:
        import shapely

        normal, _ = _plane_of(surfaces[0])
        keep = [k for k in range(3) if k != int(np.argmax(np.abs(normal)))]
        found: dict[tuple[int, bytes], int] = {}
        first: list[int] = []
        self.of_surface: list[int] = []
        for k, (surface, kind) in enumerate(zip(surfaces, kinds, strict=True)):
            number = found.setdefault((kind, surface.vertices.tobytes()), len(found))
            if number == len(first):
                first.append(k)
            self.of_surface.append(number)
        self.kinds = np.array([kinds[k] for k in first])
        self._shapes = np.array([shapely.Polygon(surfaces[k].vertices[:, keep]) for k in first])
        self._areas = shapely.area(self._shapes)
        self._tree = shapely.STRtree(self._shapes)

    def highest_below(self, outline: int, top: NDArray[np.int64]) -> int:
        """Return the highest of the layers `top` (-1 where there is none yet) of all outlines that one overlaps."""
        import shapely

        shape, area = self._shapes[outline], self._areas[outline]
        highest = int(top[outline]) if area > 0.0 else -1
        near = self._tree.query(shape)
        near = near[(top[near] > highest) & (self.kinds[near] == self.kinds[outline]) & (near != outline)]
        near = near[np.argsort(-top[near], kind="stable")]
        # From the highest down, so that a few are looked at where many lie on top of each other.
        for start in range(0, len(near), _AT_ONCE):
            part = near[start : start + _AT_ONCE]
            shared = shapely.area(shapely.intersection(shape, self._shapes[part]))
            inside = shared > 1e-12 * np.minimum(area, self._areas[part])
            if inside.any():
                return int(top[part[int(np.argmax(inside))]])
        return highest


def _scene_extent(scene: Scene) -> float:
    points = [s.vertices for s in scene.objects if len(s.vertices)]
    return max((float(np.abs(p).max()) for p in points), default=1.0) or 1.0


def _plane_of(surface: Surface) -> tuple[FloatArray, float]:
    """Return the unit normal (first large component positive) and the offset of a polygon's plane (Newell's method)."""
    v = surface.vertices - surface.vertices[0]
    normal = np.cross(v, np.roll(v, -1, axis=0)).sum(axis=0)
    length = float(np.linalg.norm(normal))
    if length == 0.0:
        return np.zeros(3), 0.0
    normal = normal / length
    lead = normal[np.argmax(np.abs(normal) > 1e-6)]
    normal = normal * np.sign(lead) + 0.0
    return normal, float(normal @ surface.vertices.mean(axis=0))
