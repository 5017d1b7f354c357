"""What stands still, as the engines get it: one mesh, in which float32 places whatever is seen where it belongs.

On the way there, in float64: planes through a pinhole are left out (`edge_on`), what is too large is cut (`cutting`),
coplanar polygons are brought nearer layer by layer (`layers`), and what is seen along its plane is left out. Hits are
looked up by the triangles as they were before all that: a part has its whole triangle's plane and texture map, which
its own corners know less well.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.geometry import LAYER_STEP
from aliasbench.renderers.raytrace.cutting import cut_large
from aliasbench.renderers.raytrace.edge_on import seen_edge_on, through_eye, without
from aliasbench.renderers.raytrace.exposure import MERGE_LIMIT, Exposure
from aliasbench.renderers.raytrace.layers import bring_nearer, nearest_of_deep, plane_distances
from aliasbench.renderers.raytrace.start import MOST_NEARER
from aliasbench.renderers.raytrace.tables import Looks, Mesh, build_ownership, merge_bodies
from aliasbench.scenes.model import Scene

Numbers = NDArray[np.int64]
_NONE = np.zeros(0, np.int64)


class Still:
    """The still mesh of one exposure after the other; `ownership` is what hits on it are looked up by.

    Parameters
    ----------
    scene : Scene
    looks : Looks
    placed : bool
        The place of a hit matters.
    lit : bool
        Light is scattered. It comes from all sides: what the camera does not see has to stay.
    robust : bool
        Whether rays are.
    """

    __slots__ = (
        "_chosen",
        "_key",
        "_lit",
        "_looks",
        "_mesh",
        "_of_whole",
        "_placed",
        "_robust",
        "_scene",
        "_stacked",
        "_steps",
        "_thin",
        "_through",
        "_tilts",
        "_whole",
        "ownership",
    )

    def __init__(self, scene: Scene, looks: Looks, *, placed: bool, lit: bool, robust: bool) -> None:
        self._scene, self._looks = scene, looks
        self._placed, self._lit, self._robust = placed, lit, robust
        self._key: tuple[float, ...] = ()
        self._through = self._thin = _NONE
        self.ownership = build_ownership((), placed=False)

    def place(self, exposure: Exposure, take: Callable[[Mesh], None]) -> None:
        """Give `take` the mesh of an exposure, unless it has it."""
        is_known = exposure.mesh_key == self._key
        if is_known and self._scene.camera.is_static:
            return
        if not is_known:
            self._merge(exposure)
        through = self._find_through(exposure)
        is_cut = is_known and np.array_equal(through, self._through)
        if not is_cut:
            self._cut(exposure, through)
        thin = self._find_thin(exposure, is_cut=is_cut)
        if is_cut and np.array_equal(thin, self._thin):
            return
        mesh, chosen = self._mesh, self._chosen
        if len(thin):
            mesh, kept = without(mesh, thin)
            chosen = kept if chosen is None else chosen[kept]
        take(mesh)
        self.ownership = self._of_whole if chosen is None else self._of_whole.of_parts(chosen)
        self._key, self._through, self._thin = exposure.mesh_key, through, thin

    def _merge(self, exposure: Exposure) -> None:
        bodies, share = exposure.still, exposure.shutter.layer_depth
        is_perspective = self._scene.camera.projection == "perspective"
        self._stacked = np.concatenate([np.zeros(0, np.bool_), *(body.stacked for body in bodies)]) & is_perspective
        owned = [len(body.triangles) for body in bodies]
        self._steps = np.repeat([body.layer * LAYER_STEP * share for body in bodies], owned) * is_perspective
        self._tilts = np.repeat([body.tilt * share for body in bodies], owned)
        layers = [0 if is_perspective else body.layer for body in bodies]
        self._whole = merge_bodies(self._scene, self._looks, bodies, exposure.shutter, exposure.anchor, layers)
        self._of_whole = build_ownership((self._whole,), placed=self._placed)

    def _cut(self, exposure: Exposure, through: Numbers) -> None:
        """Make the mesh in which float32 places everything, and note which triangles it consists of parts of."""
        view, anchor = exposure.shutter.first, exposure.anchor
        mesh, chosen = without(self._whole, through) if len(through) else (self._whole, None)
        nearest = np.inf
        if self._stacked.any():
            distances = plane_distances(self._whole, view.origin - anchor, len(self._scene.objects))
            nearest = nearest_of_deep(self._whole, self._stacked, distances, view.origin - anchor)
        mesh, parents = cut_large(mesh, exposure.anchor_view, anchor, exposure.travel, nearest, robust=self._robust)
        if parents is not None:
            chosen = parents if chosen is None else chosen[parents]
        if self._steps.any():
            steps, tilts = (v if chosen is None else v[chosen] for v in (self._steps, self._tilts))
            most = np.inf if exposure.start == 0.0 else MOST_NEARER * exposure.shutter.layer_depth
            mesh = bring_nearer(mesh, steps, tilts, distances, view, anchor, most)
        self._mesh, self._chosen = mesh, chosen

    def _find_through(self, exposure: Exposure) -> Numbers:
        """Return the triangles that a pinhole sees nothing of, as it is in their plane."""
        camera, shutter = self._scene.camera, exposure.shutter
        moves = shutter.opening != shutter.closing and not camera.is_static
        if camera.projection != "perspective" or camera.lens_radius > 0.0 or moves or self._lit:
            return _NONE
        flat = np.array([s.is_polygon for s in self._scene.objects], dtype=bool)
        return through_eye(self._whole, shutter.first.origin - exposure.anchor, flat)

    def _find_thin(self, exposure: Exposure, *, is_cut: bool) -> Numbers:
        """Return the triangles that are seen along their plane all the time; `is_cut`: of a mesh already looked at."""
        camera, shutter = self._scene.camera, exposure.shutter
        if camera.lens_radius > 0.0 or self._lit:
            return _NONE
        if camera.is_static or (camera.projection == "orthographic" and camera.target_velocity is None):
            return self._thin if is_cut else seen_edge_on(self._mesh, shutter.first, exposure.anchor)
        # where others come or go the mesh has to be built anew
        if len(self._mesh.triangles) > MERGE_LIMIT:
            return _NONE
        # an eye that moves straight is as near to a plane in between as at the ends
        ends = [seen_edge_on(self._mesh, view, exposure.anchor) for view in (shutter.first, shutter.last)]
        return np.intersect1d(ends[0], ends[1])
