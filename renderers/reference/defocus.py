"""What a lens does to a picture where that is known exactly.

Whatever lies in the plane in focus is seen from all points of the lens alike (`scenes.projection` derives why): the
picture is the pinhole's. A flat layer that faces the camera at another depth is shifted by each point of the lens as a
whole, so that its picture is the pinhole's spread over a disc (`discs`). Layers add up as long as what one hides of
another does not depend on the point of the lens: every two of them keep apart, or one lies all before the other, by at
least as far as they are shifted against each other. What is all behind another is not seen; layers of one depth are
first cut where they overlap.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.reference.discs import disc_masses, spread_of
from aliasbench.renderers.reference.faces import Faces
from aliasbench.renderers.reference.flat import ROUNDING, Integral, depth_extent, over_bands, palette, scene_extent
from aliasbench.renderers.reference.paths import Paths
from aliasbench.renderers.reference.slabs import TIE
from aliasbench.renderers.sampling.filters import FilterSpec
from aliasbench.scenes.model import FloatArray, Scene
from aliasbench.scenes.projection import View, focus_at, view_at

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

_CLOSE = 1e-13  # of the scene's size and of the focus: as near to the plane in focus as coordinates are known
_FLAT = 1e-12  # of the scene's size: how much depths of a layer may differ
_SLACK = 1e-7  # pixels by which layers must keep more than apart
_MOST_LAYERS, _MOST_CONTACTS = 400, 4e5  # pixels times edges, some 50 microseconds each


def is_in_focus(scene: Scene, faces: Faces, paths: Paths, frame: int, fractions: tuple[float, float]) -> bool:
    """Return whether everything stays in the plane in focus from one fraction of a frame interval to another."""
    if fractions[0] < fractions[1] and not _keeps_depths(scene, paths, frame):
        return False
    view = view_at(scene.camera, scene.animation, frame, fractions[0], (1, 1))
    focus = focus_at(scene.camera, scene.animation, frame, fractions[0])
    world = paths.positions(faces.vertices, faces.ranges, frame, fractions[0])
    lights = np.array([light.quad for light in scene.lights], dtype=np.float64).reshape(-1, 3)
    depths = (np.concatenate([world, lights]) - view.origin) @ view.forward
    return bool(np.abs(depths - focus).max(initial=0.0) <= _CLOSE * (scene_extent(scene) + focus))


def _keeps_depths(scene: Scene, paths: Paths, frame: int) -> bool:
    """Return whether it is certain that no point's depth changes: motions across the axis and about it."""
    camera = scene.camera
    if paths.camera_turn(frame) > 0.0:
        return False
    forward = np.asarray(camera.target, dtype=np.float64) - np.asarray(camera.position)
    forward = forward / np.linalg.norm(forward)
    eye = np.asarray(camera.velocity)
    for motion in paths.motions:
        turning = motion.spin is not None and motion.spin.rev_per_s != 0.0
        if motion.matrices is not None or (paths.interpolated and turning):
            return False
        if float((np.asarray(motion.velocity) - eye) @ forward) != 0.0:
            return False
        if motion.spin is not None and turning:
            axis = np.asarray(motion.spin.axis) / np.linalg.norm(motion.spin.axis)
            if float(np.linalg.norm(np.cross(axis, forward))) > 1e-15:
                return False
    return True


@dataclass(frozen=True, slots=True, eq=False)
class _Layer:
    """What faces the camera at one depth.

    Attributes
    ----------
    owner : int
    depth : float
    shift : float
        By how many pixels of its picture the rim of the lens sees it shifted.
    whole, shape : geometry
        Its part that nothing of its own depth hides, in the pinhole's picture: all of it, and what matters.
    """

    owner: int
    depth: float
    shift: float
    whole: "BaseGeometry"
    shape: "BaseGeometry"


def draw_layers(
    scene: Scene, faces: Faces, paths: Paths, size: tuple[int, int], frame: int, fraction: float, spec: FilterSpec
) -> Integral | None:
    """Return the picture of one instant through a lens if it is one of layers, else None.

    The bound rests on the difference of Gauss's and Kronrod's rules between places where the integrand may have kinks,
    all of which are known.
    """
    if not spec.kind.separable:
        return None
    view = view_at(scene.camera, scene.animation, frame, fraction, size)
    found = _layers(scene, faces, paths, view, frame, fraction)
    colors = palette(scene)
    layers = None if found is None else _visible(found, view, spec, TIE * depth_extent(scene))
    beneath = None if layers is None else _beneath(layers)
    if layers is None or beneath is None:
        return None
    outlines = {k: _edges(layers[k].shape) for k in beneath}
    if sum(_contacts(edges, layers[k].shift, view, spec) for k, edges in outlines.items()) > _MOST_CONTACTS:
        return None
    spread = spread_of(spec)
    pixels = np.empty((size[1], size[0], 3))
    pixels[:] = colors[-1]
    bound = np.full(pixels.shape[:2], ROUNDING * float(np.abs(colors).max()))
    mass, doubt = np.empty(bound.shape), np.empty(bound.shape)
    for k, edges in outlines.items():
        radius = abs(layers[k].shift)

        def draw(rows: NDArray[np.int64], edges: FloatArray = edges, radius: float = radius) -> None:
            disc_masses(
                edges, radius, spec.support, spread.params, spread.knots, spread.longest, spread.nodes, spread.ends,
                spread.series, rows, mass, doubt,
            )  # fmt: skip

        over_bands(draw, size[1])
        step = colors[layers[k].owner] - colors[beneath[k]]
        # corners are known to a few units in the last place of the picture's width
        place = 16 * 2.0**-52 * (max(size) + radius) * max(1.0, spec.peak)
        pixels += mass[:, :, None] * step
        bound += (doubt + place) * float(np.abs(step).max())
    return Integral(pixels, bound)


def _layers(scene: Scene, faces: Faces, paths: Paths, view: View, frame: int, fraction: float) -> list[_Layer] | None:
    """Return all that lies before the camera, None if something does not face it."""
    import shapely

    radius, focus = scene.camera.lens_radius, focus_at(scene.camera, scene.animation, frame, fraction)
    world = paths.positions(faces.vertices, faces.ranges, frame, fraction)
    depths = (world - view.origin) @ view.forward
    close = _FLAT * (scene_extent(scene) + focus)
    out = []
    for index, (surface, rows) in enumerate(zip(scene.objects, faces.ranges, strict=True)):
        if not len(surface.triangles):
            continue
        if float(np.ptp(depths[rows])) > close:
            return None
        z = float(depths[rows].mean())
        if z < -close:
            continue
        if view.perspective and z < close:
            return None
        scale = view.scale / z if view.perspective else view.scale
        flat = view.project(world[rows])[:, :2]
        shape = shapely.union_all([t for t in map(shapely.Polygon, flat[surface.triangles]) if t.area > 0.0])
        out.append(_Layer(index, z, radius * (1.0 - z / focus) * scale, shape, shape))
    return out


def _visible(layers: list[_Layer], view: View, spec: FilterSpec, tie: float) -> list[_Layer] | None:
    """Return the layers from front to back, cut by those of the same depth and by the border of what is seen.

    None where depths are so near that some count as one and some do not.
    """
    import shapely

    layers = sorted(layers, key=lambda layer: layer.depth)
    place, previous = 0, -np.inf
    ranked = []
    for layer in layers:
        gap, width = layer.depth - previous, TIE * layer.depth if view.perspective else tie
        if 1e-3 * width < gap < 4.0 * width:
            return None
        place += gap >= width
        previous = layer.depth
        ranked.append(replace(layer, depth=float(place)))
    out: list[_Layer] = []
    for layer in sorted(ranked, key=lambda layer: (layer.depth, -layer.owner)):
        reach = abs(layer.shift) + spec.support + 1.0
        whole = layer.whole
        for front in out:
            if front.depth == layer.depth:
                whole = whole.difference(front.whole)
        shape = whole.intersection(shapely.box(-reach, -reach, view.width + reach, view.height + reach))
        # what is left of a layer outside the picture still cuts others of its depth, outside the picture
        out.append(replace(layer, whole=whole, shape=shape))
    return [layer for layer in out if layer.shape.area > 0.0]


def _beneath(layers: list[_Layer]) -> dict[int, int] | None:
    """Return for every layer that is seen what lies beneath it (-1: the background), None if that depends on where."""
    hidden: set[int] = set()
    out: dict[int, int] = {}
    for back, b in enumerate(layers):
        for front in range(back):
            a = layers[front]
            if front in hidden or a.depth == b.depth:
                continue
            apart = abs(a.shift - b.shift) + _SLACK
            if a.shape.distance(b.shape) >= apart:
                continue
            if a.whole.covers(b.shape) and b.shape.distance(a.whole.boundary) >= apart:
                hidden.add(back)
                break
            if not (b.whole.covers(a.shape) and a.shape.distance(b.whole.boundary) >= apart):
                return None
            out.setdefault(front, b.owner)
    return {k: out.get(k, -1) for k in range(len(layers)) if k not in hidden}


def _edges(shape: "BaseGeometry") -> FloatArray:
    """Return the edges (n, 4) of all rings, each with what is inside on the side that `disc_masses` wants."""
    import shapely
    from shapely.geometry.polygon import orient

    rings = []
    for part in shapely.get_parts(shape):
        if part.geom_type == "Polygon":
            turned = orient(part, 1.0)
            rings += [np.asarray(ring.coords) for ring in (turned.exterior, *turned.interiors)]
    return np.concatenate([np.hstack([r[:-1], r[1:]]) for r in rings])


def _contacts(edges: FloatArray, shift: float, view: View, spec: FilterSpec) -> float:
    """Return about how many pixels have an edge within reach, summed over edges."""
    width = 2 * (abs(shift) + spec.support)
    spans = np.abs(edges[:, 2:] - edges[:, :2]) + width
    return float((np.minimum(spans, (view.width, view.height)).max(axis=1) * min(width, view.height)).sum())
