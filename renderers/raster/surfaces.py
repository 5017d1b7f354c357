"""All triangles of a scene one by one, where they are in a pass, as everything that depends on light asks for them.

A fragment finds its triangle's plane here and meets it with its own ray, as the ray tracer does: places interpolated
from vertices lose on a wide floor what shadows must not lose. Coordinates are relative to where the camera is when the
frame begins, in a unit (a power of two) that makes the largest of them about 1: squares then stay within float32
whatever the size and the place of a scene.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.geometry import Body
from aliasbench.renderers.raster.graphics import GraphicsContext
from aliasbench.renderers.raster.placement import Placement, body_matrices
from aliasbench.renderers.raster.projection import Instant, Window
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import FloatArray, Scene
from aliasbench.scenes.projection import View, view_at

# As in surface.glsl. Seen as it is; seen from its bright side; answers lights; mirrors.
UNLIT, LIGHT, DIFFUSE, GLOSSY = range(4)
TRIANGLES_PER_ROW = 1024
_LEAST_REACH = 2.0**-100

Uniforms = dict[str, float | tuple[float, ...]]


def object_kinds(scene: Scene) -> NDArray[np.int32]:
    """Return how each object of a scene `with_lights` answers light; without lights diffuse objects are unlit."""
    own = len(scene.objects) - len(scene.lights)
    codes = {"unlit": UNLIT, "diffuse": DIFFUSE if scene.lights else UNLIT, "glossy": GLOSSY}
    kinds = [codes[o.material.kind] if k < own else LIGHT for k, o in enumerate(scene.objects)]
    return np.array(kinds, dtype=np.int32)


def objects_order(bodies: Sequence[Body]) -> NDArray[np.int64]:
    """Return the numbers of all triangles, counted body by body, in the order of their objects."""
    owners = [b.surfaces for b in bodies]
    return np.argsort(np.concatenate(owners), kind="stable") if owners else np.zeros(0, np.int64)


class Surfaces:
    """The planes of all triangles on the device; made and used inside the context's `use`.

    Attributes
    ----------
    owners, kinds : (m,) int32
        Of each triangle, in the objects' order, its object and how that answers light.
    uv : (m, 3, 2) float64
    corners : (m, 3, 3) float64
        Where they are in the pass, in units of `unit` from `anchor`.
    version : int
        Another one whenever `corners` have changed.
    anchor : (3,) float64
    unit : float
        World units.
    uniforms : dict
        What shaders need for the pass; the texture of planes is that of number `slot`.
    """

    def __init__(
        self, context: GraphicsContext, scene: Scene, bodies: Sequence[Body], placement: Placement, slot: int
    ) -> None:
        self._scene, self._bodies, self._placement, self._slot = scene, bodies, placement, slot
        self._order = objects_order(bodies)
        self.owners = np.concatenate([b.surfaces for b in bodies])[self._order]
        self.kinds = object_kinds(scene)[self.owners]
        self.uv = np.concatenate([b.uv[b.triangles] for b in bodies])[self._order]
        self.corners = np.zeros((len(self.owners), 3, 3))
        self.version, self.unit, self.anchor = 0, 1.0, np.zeros(3)
        self.uniforms: Uniforms = {}
        self._placed: FloatArray | None = None
        rows = -(-len(self.owners) // TRIANGLES_PER_ROW)
        if rows > context.max_texture_size:
            limit = context.max_texture_size * TRIANGLES_PER_ROW
            raise InputError(f"{len(self.owners)} triangles: this device lights at most {limit}")
        self._planes = context.gl.texture((2 * min(len(self.owners), TRIANGLES_PER_ROW), rows), 4, dtype="f4")
        self._planes.filter = (context.gl.NEAREST, context.gl.NEAREST)

    def update(self, instant: Instant, view: View, window: Window) -> None:
        """Place everything for a pass, seen as `view` says through a window of the picture."""
        camera, animation = self._scene.camera, self._scene.animation
        self.anchor = view_at(camera, animation, instant.frame, 0.0, (view.width, view.height)).origin
        matrices = body_matrices(
            self._placement, animation, instant.frame, instant.fraction, self.anchor, interpolated=instant.interpolated
        )
        if self._placed is None or not np.array_equal(matrices, self._placed):
            self._place(matrices)
            self._placed = matrices
        self.uniforms = {"planes": self._slot, **_rays(view, window, instant.jitter, self.anchor, self.unit)}

    def _place(self, matrices: FloatArray) -> None:
        placed = [
            (b.vertices @ m[:3, :3].T + m[:3, 3])[b.triangles] for b, m in zip(self._bodies, matrices, strict=True)
        ]
        corners = np.concatenate(placed)[self._order]
        reach = np.abs(corners).max(axis=(1, 2))
        self.unit = float(2.0 ** np.ceil(np.log2(max(float(reach.max()), _LEAST_REACH))))
        self.corners = corners / self.unit
        self.version += 1
        a, b, c = (self.corners[:, k] for k in range(3))
        normals = np.cross(b - a, c - a)
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        normals = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0.0)
        table = np.zeros((self._planes.height * self._planes.width // 2, 2, 4), np.float32)
        used = table[: len(corners)]
        used[:, 0, :3], used[:, 0, 3] = normals, (normals * a).sum(axis=1)
        used[:, 1, 0], used[:, 1, 1] = self.kinds, reach / self.unit
        self._planes.write(table.tobytes())

    def use(self) -> None:
        """Bind the planes."""
        self._planes.use(self._slot)

    def release(self) -> None:
        """Free them."""
        self._planes.release()


def _rays(view: View, window: Window, jitter: tuple[float, float], anchor: FloatArray, unit: float) -> Uniforms:
    """Return the rays through a pass's pixels: at the window's middle, and their steps to the right and down."""
    x = window.left + window.width / 2 + jitter[0]
    y = window.top + window.height / 2 + jitter[1]
    origins, directions = view.ray(np.array([x, x + 1.0, x]), np.array([y, y, y + 1.0]))
    if view.perspective:
        across, down = directions[1] - directions[0], directions[2] - directions[0]
        starts = (origins[0] - anchor, np.zeros(3), np.zeros(3))
        steps = (directions[0], across, down)
    else:
        starts = (origins[0] - anchor, origins[1] - origins[0], origins[2] - origins[0])
        steps = (directions[0], np.zeros(3), np.zeros(3))
    names = ("eye", "eye_across", "eye_down")
    out: Uniforms = {n: tuple((v / unit).tolist()) for n, v in zip(names, starts, strict=True)}
    out.update({n: tuple(v.tolist()) for n, v in zip(("ray", "ray_across", "ray_down"), steps, strict=True)})
    out["middle"] = (window.width / 2, window.height / 2)
    return out
