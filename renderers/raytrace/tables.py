"""The scene as the kernels want it: one still mesh in float32 near the camera, moving bodies, and look-up tables."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.geometry import LAYER_STEP, Body
from aliasbench.renderers.raytrace.bodies import Shutter
from aliasbench.renderers.raytrace.lanes import (
    AXIS,
    AXIS_TRAVEL,
    CAMERA_SIZE,
    CENTER_X,
    CENTER_Y,
    EYE,
    EYE_TRAVEL,
    FOCUS,
    FORWARD,
    LENS_RADIUS,
    PERSPECTIVE,
    RIGHT,
    SCALE,
    START,
    TURNING,
    UP,
    UP_HINT,
)
from aliasbench.renderers.raytrace.shading import (
    NORMAL,
    OFFSET,
    REACH,
    TRIANGLE_SIZE,
    U_MAP,
    U_SHIFT,
    V_MAP,
    V_SHIFT,
    EwaTables,
    Tables,
)
from aliasbench.renderers.raytrace.texturing import (
    CHECKER,
    COLOR,
    CUTOFF,
    EWA,
    KIND,
    LEVEL,
    LEVELS,
    LOW,
    MIPMAP,
    NEAREST,
    OBJECT_SIZE,
    PHASE,
    PLACE,
    PLAIN,
    RATE,
    SINE,
    SPAN,
    SQUARE,
    TRILINEAR,
    UV_MATRIX,
    ZONE,
)
from aliasbench.scenes.model import Checker, FloatArray, Grating, ImageTexture, Scene, Texture
from aliasbench.scenes.textures import MipChain, scene_chain

_CHAIN_KIND = {"point": NEAREST, "linear": TRILINEAR, "mipmap": MIPMAP, "trilinear": TRILINEAR, "ewa": EWA}


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """Triangles (m, 3) in one frame of reference, over vertices (n, 3) float64, uv (n, 2); and owners (m,).

    `holed` (m,) bool says where a ray may pass through a triangle that it hits.
    """

    vertices: FloatArray
    triangles: NDArray[np.int32]
    uv: FloatArray
    owners: NDArray[np.int32]
    holed: NDArray[np.bool_]


def body_mesh(body: Body, looks: "Looks") -> Mesh:
    """Return a body's triangles in the body's own frame."""
    return Mesh(body.vertices, body.triangles, body.uv, body.surfaces, looks.holed[body.surfaces])


def merge_bodies(
    scene: Scene,
    looks: "Looks",
    bodies: Sequence[Body],
    shutter: Shutter,
    anchor: FloatArray,
    layers: Sequence[int],
) -> Mesh:
    """Return bodies as they stand when the shutter opens, relative to `anchor`, as one mesh.

    Each is brought nearer by as many `layers`.
    """
    vertices, triangles, count = [np.zeros((0, 3))], [np.zeros((0, 3), np.int32)], 0
    for body, layer in zip(bodies, layers, strict=True):
        world = shutter.place(body.motion, scene.animation, shutter.opening)
        matrix = body.local_matrix(world, anchor)
        if layer:
            # along parallel rays: no point of the picture moves
            matrix[:3, 3] -= layer * LAYER_STEP * shutter.layer_depth * shutter.first.forward
        vertices.append(body.vertices @ matrix[:3, :3].T + matrix[:3, 3])
        triangles.append(body.triangles + np.int32(count))
        count += len(body.vertices)
    owners = np.concatenate([np.zeros(0, np.int32), *(body.surfaces for body in bodies)])
    return Mesh(
        np.concatenate(vertices),
        np.concatenate(triangles),
        np.concatenate([np.zeros((0, 2)), *(body.uv for body in bodies)]),
        owners,
        looks.holed[owners],
    )


def camera_values(scene: Scene, shutter: Shutter, anchor: FloatArray, start: float) -> FloatArray:
    """Return the (CAMERA_SIZE,) values of the camera over one exposure, its rays starting at a depth."""
    out = np.zeros(CAMERA_SIZE)
    first, last, camera = shutter.first, shutter.last, scene.camera
    out[EYE : EYE + 3] = first.origin - anchor
    out[EYE_TRAVEL : EYE_TRAVEL + 3] = last.origin - first.origin
    velocity = np.asarray(camera.velocity)
    turn = np.zeros(3) if camera.target_velocity is None else np.asarray(camera.target_velocity) - velocity
    opening, closing = ((shutter.frame + f) / scene.animation.fps for f in (shutter.opening, shutter.closing))
    out[AXIS : AXIS + 3] = np.asarray(camera.target) - np.asarray(camera.position) + turn * opening
    out[AXIS_TRAVEL : AXIS_TRAVEL + 3] = turn * (closing - opening)
    out[UP_HINT : UP_HINT + 3] = camera.up
    for at, axis in ((RIGHT, first.right), (UP, first.up), (FORWARD, first.forward)):
        out[at : at + 3] = axis
    out[SCALE], out[PERSPECTIVE] = first.scale, float(first.perspective)
    out[CENTER_X], out[CENTER_Y] = first.width / 2, first.height / 2
    out[LENS_RADIUS], out[FOCUS] = camera.lens_radius, camera.focus_distance or 0.0
    out[START] = start
    out[TURNING] = float(bool(out[AXIS_TRAVEL : AXIS_TRAVEL + 3].any()))
    return out


def triangle_values(mesh: Mesh) -> FloatArray:
    """Return (m, TRIANGLE_SIZE): plane and affine texture map of every triangle (zeros for degenerate ones)."""
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    uv = [mesh.uv[mesh.triangles[:, k]] for k in range(3)]
    first, second = b - a, c - a
    normal = np.cross(first, second)
    square = np.einsum("ij,ij->i", normal, normal)
    inverse = np.divide(1.0, square, out=np.zeros_like(square), where=square > 0.0)[:, None]
    # The dual basis of the two edges: what takes a point of the plane to its two barycentric coordinates.
    along_first, along_second = np.cross(second, normal) * inverse, np.cross(normal, first) * inverse
    out = np.zeros((len(mesh.triangles), TRIANGLE_SIZE))
    out[:, NORMAL : NORMAL + 3] = normal
    out[:, OFFSET] = np.einsum("ij,ij->i", normal, a)
    for k, (at, shift) in enumerate(((U_MAP, U_SHIFT), (V_MAP, V_SHIFT))):
        gradient = (uv[1] - uv[0])[:, k, None] * along_first + (uv[2] - uv[0])[:, k, None] * along_second
        out[:, at : at + 3] = gradient
        out[:, shift] = uv[0][:, k] - np.einsum("ij,ij->i", gradient, a)
    out[:, REACH] = np.abs(np.stack([a, b, c])).max(axis=(0, 2)) if len(out) else 0.0
    return out


@dataclass(frozen=True, slots=True, eq=False)
class Looks:
    """What does not change from frame to frame: the objects' values, which have holes, and all mip levels."""

    objects: FloatArray
    levels: NDArray[np.int64]
    texels: NDArray[np.float32]
    textured: bool
    holed: NDArray[np.bool_]


def build_looks(scene: Scene, mode: str) -> Looks:
    """Return the objects' values under a texture mode (`Technique.texture`)."""
    objects = np.zeros((max(len(scene.objects), 1), OBJECT_SIZE))
    levels: list[tuple[int, int, int]] = []
    texels = [np.zeros((1, 4), np.float32)]
    placed: dict[str, tuple[int, MipChain]] = {}
    size = 1
    for values, surface in zip(objects, scene.objects, strict=False):
        values[COLOR : COLOR + 3] = surface.color
        values[KIND] = PLAIN
        values[CUTOFF] = -np.inf
        if surface.texture is None:
            continue
        texture = scene.textures[surface.texture]
        if not isinstance(texture, ImageTexture) and mode in ("point", "linear"):
            _put_analytic(values, texture)
            continue
        if surface.texture not in placed:
            chain = scene_chain(scene, surface.texture)
            placed[surface.texture] = len(levels), chain
            for level in chain.levels:
                levels.append((size, level.shape[1], level.shape[0]))
                texels.append(level.reshape(-1, 4))
                size += level.shape[0] * level.shape[1]
        first, chain = placed[surface.texture]
        values[KIND], values[LEVEL], values[LEVELS] = _CHAIN_KIND[mode], first, len(chain.levels)
        if mode == "linear":
            values[KIND], values[LEVELS] = TRILINEAR, 1
        values[UV_MATRIX : UV_MATRIX + 6] = chain.uv_matrix.ravel()
        if isinstance(texture, ImageTexture) and texture.alpha_cutoff is not None:
            # In single precision, as alpha is stored; no average of alphas that all reach it falls below.
            cutoff = np.float32(texture.alpha_cutoff)
            values[CUTOFF] = cutoff if chain.levels[0][..., 3].min() < cutoff else -np.inf
    return Looks(
        objects,
        np.array(levels, np.int64).reshape(-1, 3),
        np.concatenate(texels),
        bool((objects[:, KIND] != PLAIN).any()),
        (objects[:, KIND] != PLAIN) & (objects[:, CUTOFF] > -np.inf),
    )


def _put_analytic(values: FloatArray, texture: Texture) -> None:
    """Write an analytic texture's values into its object's row."""
    if isinstance(texture, Checker):
        values[KIND] = CHECKER
        values[PLACE : PLACE + 2] = texture.squares
        low, high = texture.black, texture.white
    elif isinstance(texture, Grating):
        values[KIND] = SINE if texture.profile == "sine" else SQUARE
        angle = np.radians(texture.angle_deg)
        values[PLACE : PLACE + 2] = texture.cycles * np.cos(angle), texture.cycles * np.sin(angle)
        values[PHASE] = texture.phase
        low, high = texture.low, texture.high
    elif isinstance(texture, ImageTexture):
        raise TypeError("an image is no analytic texture")
    else:
        values[KIND] = ZONE
        values[PLACE : PLACE + 2] = texture.center
        values[RATE], values[PHASE] = texture.k / (2.0 * np.pi), texture.phase / (2.0 * np.pi)
        low, high = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    values[LOW : LOW + 3] = low
    values[SPAN : SPAN + 3] = np.subtract(high, low)


@dataclass(frozen=True, slots=True, eq=False)
class Ownership:
    """Of triangles in a row: whose they are (m,), and their values (m, TRIANGLE_SIZE), or none without textures."""

    owners: NDArray[np.int32]
    values: FloatArray
    counts: tuple[int, ...]

    def of_parts(self, parents: NDArray[np.int64]) -> "Ownership":
        """Return the ownership of one mesh's parts, each a part of the triangle of that number."""
        values = self.values[parents] if len(self.values) else self.values
        return Ownership(self.owners[parents], values, (len(parents),))


def build_ownership(meshes: Sequence[Mesh], *, placed: bool) -> Ownership:
    """Return what hits on meshes are looked up by, the meshes' triangles one after the other.

    `placed`: the place of a hit matters.
    """
    rows = [triangle_values(mesh) for mesh in meshes] if placed else []
    return Ownership(
        np.concatenate([np.zeros(0, np.int32), *(mesh.owners for mesh in meshes)]),
        np.concatenate([np.zeros((0, TRIANGLE_SIZE)), *rows]),
        tuple(len(mesh.triangles) for mesh in meshes),
    )


def build_tables(
    scene: Scene,
    looks: Looks,
    still: Ownership,
    moving: Ownership,
    bodies: FloatArray,
    lights: FloatArray,
    footprint: float,
) -> Tables:
    """Return everything that hits are looked up in, for one exposure.

    `bodies` (b, BODY_SIZE) are those that move, `lights` as `lights.light_values` has them.
    """
    still_only = not moving.owners.size
    kind = EwaTables if (looks.objects[:, KIND] == EWA).any() else Tables
    return kind(
        looks.objects,
        still.owners if still_only else np.concatenate([still.owners, moving.owners]),
        still.values if still_only else np.concatenate([still.values, moving.values]),
        bodies,
        np.cumsum([len(still.owners), *moving.counts], dtype=np.int64),
        looks.levels,
        looks.texels,
        lights,
        np.asarray(scene.background, dtype=np.float64),
        footprint,
    )
