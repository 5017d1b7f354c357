"""What moves while the shutter is open, as the engines get it: a mesh for each body, in the body's own frame.

Bodies so large that float32 would misplace their outline are cut, as the still mesh is (`cutting`): about the place in
the body's frame from which, or in which, the camera sees it, which may wander there while the shutter is open; and that
is where their frames then have their origins. Ordinary bodies never change.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.geometry import Body
from aliasbench.renderers.raytrace.cutting import PLACED_PX, cut_about, first_cut
from aliasbench.renderers.raytrace.exposure import MERGE_LIMIT, Exposure
from aliasbench.renderers.raytrace.layers import nearest_of_deep, plane_distances
from aliasbench.renderers.raytrace.start import Spheres
from aliasbench.renderers.raytrace.tables import Looks, Mesh, Ownership, body_mesh, build_ownership
from aliasbench.scenes.model import FloatArray, Scene

_TIMES = 9  # at which it is looked where a camera is in a body's frame
_NEAR = 2.0  # radii of a sphere about a body: from farther away none of its edges is long


class Moving:
    """The meshes of moving bodies, exposure after exposure.

    `bodies` is what they are meshes of, and `ownership` what hits on them are looked up by.

    Parameters
    ----------
    scene : Scene
    looks : Looks
    bodies : sequence of Body
        Of all exposures, see `exposure.Exposure`.
    placed : bool
        The place of a hit matters.
    """

    __slots__ = ("_is_whole", "_meshes", "_numbers", "_placed", "_scene", "_spheres", "_whole", "bodies", "ownership")

    def __init__(self, scene: Scene, looks: Looks, bodies: Sequence[Body], *, placed: bool) -> None:
        self._scene, self._placed = scene, placed
        self.bodies = tuple(bodies)
        self._meshes = [body_mesh(body, looks) for body in bodies]
        # a large mesh is not worth building anew for every picture
        few = [k for k, mesh in enumerate(self._meshes) if 0 < len(mesh.triangles) <= MERGE_LIMIT]
        self._spheres = Spheres.about([bodies[k] for k in few])
        self._numbers = np.array(few, dtype=np.int64)[self._spheres.bodies]
        self._whole = self.ownership = build_ownership(self._meshes, placed=placed)
        self._is_whole = False

    def place(self, exposure: Exposure, take: Callable[[Sequence[Mesh]], None]) -> None:
        """Give `take` the meshes of an exposure, unless it has them."""
        large = {k: self._divide(self._meshes[k], exposure.moving[k], exposure) for k in self._find_large(exposure)}
        cut = {k: divided for k, divided in large.items() if divided is not None}
        if not cut and self._is_whole:
            return
        bodies, wholes, meshes, rows, first = list(exposure.moving), list(self._meshes), [], [], 0
        for k, mesh in enumerate(self._meshes):
            chosen = np.arange(len(mesh.triangles))
            if k in cut:
                bodies[k], wholes[k], mesh, chosen = cut[k]
            meshes.append(mesh)
            rows.append(first + chosen)
            first += len(wholes[k].triangles)
        take(meshes)
        self.bodies, self._is_whole = tuple(bodies), not cut
        self.ownership = _rows_of(build_ownership(wholes, placed=self._placed), rows) if cut else self._whole

    def _find_large(self, exposure: Exposure) -> list[int]:
        """Return the bodies that may have edges which are long beside their distance."""
        shutter, spheres = exposure.shutter, self._spheres
        view = shutter.first
        if view.perspective:
            seconds = (shutter.frame + (shutter.opening + shutter.closing) / 2.0) / self._scene.animation.fps
            eye = (shutter.first.origin + shutter.last.origin) / 2.0
            centers = spheres.centers + seconds * spheres.velocities
            found = np.linalg.norm(centers - eye, axis=1) < _NEAR * spheres.radii
        else:
            # from anywhere within it
            found = 2.0 * spheres.radii * view.scale > PLACED_PX
        return np.unique(self._numbers[found]).tolist()

    def _divide(self, mesh: Mesh, body: Body, exposure: Exposure) -> tuple[Body, Mesh, Mesh, NDArray[np.int64]] | None:
        """Return a body with another origin, its mesh, that cut, and which triangles its are parts of; None if whole.

        A body that is squeezed flat has no frame, and stays whole.
        """
        view = exposure.shutter.first
        middle = self._seen_from(mesh, body, exposure, 0.5)
        if middle is None:
            return None
        place, axes = middle
        plane = np.append(body.plane[:3], body.plane[3] - body.plane[:3] @ place)
        nearer = replace(body, origin=body.origin + place, vertices=body.vertices - place, plane=plane)
        whole = replace(mesh, vertices=nearer.vertices)
        nearest = first_cut(whole, view)
        if view.perspective and body.stacked.any():
            distances = plane_distances(whole, np.zeros(3), len(self._scene.objects))
            nearest = min(nearest, nearest_of_deep(whole, body.stacked, distances, np.zeros(3)))
        if nearest == np.inf:
            return None
        others = [self._seen_from(mesh, body, exposure, share) for share in np.linspace(0.0, 1.0, _TIMES).tolist()]
        travel = max(float(np.linalg.norm(other[0] - place)) for other in others if other is not None)
        part, parents = cut_about(whole, max(nearest, travel) if view.perspective else nearest + travel, axes)
        return nearer, whole, part, parents

    def _seen_from(
        self, mesh: Mesh, body: Body, exposure: Exposure, share: float
    ) -> tuple[FloatArray, FloatArray] | None:
        """Return from which place in a body's frame, or about which, it is seen at a share of the exposure, and the
        camera's axes there; None if there is no such frame.
        """
        shutter = exposure.shutter
        fraction = shutter.opening + share * (shutter.closing - shutter.opening)
        world = shutter.place(body.motion, self._scene.animation, fraction)
        matrix = body.local_matrix(world, exposure.anchor)
        if abs(np.linalg.det(matrix[:3, :3])) < np.finfo(np.float64).tiny:
            return None
        back = np.linalg.inv(matrix[:3, :3])
        eye = shutter.first.origin + share * (shutter.last.origin - shutter.first.origin) - exposure.anchor
        place = back @ (eye - matrix[:3, 3])
        axes = np.stack([shutter.first.right, shutter.first.up, shutter.first.forward]) @ back.T
        if not shutter.first.perspective:
            place = _where_met(body, mesh, place, axes[2])
        return place, axes / np.linalg.norm(axes, axis=1, keepdims=True)


def _where_met(body: Body, mesh: Mesh, place: FloatArray, forward: FloatArray) -> FloatArray:
    """Return where a camera's axis comes closest to what it sees: a body's plane, or the middle of its box."""
    if body.plane.any():
        normal, offset = body.plane[:3], body.plane[3]
    else:
        a, b, c = mesh.vertices[mesh.triangles[0]]
        normal = np.cross(b - a, c - a)
        offset = normal @ a
        lengths = float(np.linalg.norm(normal)) * float(np.abs(mesh.vertices).max())
        if not (np.abs(mesh.vertices @ normal - offset) <= 1e-9 * lengths).all():
            normal, offset = forward, 0.0  # relative to the body's origin, which is its middle
    along = float(normal @ forward)
    if abs(along) <= 1e-9 * float(np.linalg.norm(normal) * np.linalg.norm(forward)):
        return place
    out: FloatArray = place + float(offset - normal @ place) / along * forward
    return out


def _rows_of(whole: Ownership, rows: list[NDArray[np.int64]]) -> Ownership:
    chosen = np.concatenate(rows)
    values = whole.values[chosen] if len(whole.values) else whole.values
    return Ownership(whole.owners[chosen], values, tuple(len(r) for r in rows))
