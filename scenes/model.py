"""The scene as plain data: what both renderers, the references and the metrics are given.

Everything is immutable, in float64, right-handed with y up, in world units, seconds and linear radiance. Small vectors
are tuples; arrays (vertices, texels) are read-only. Two scenes are equal when their content is: `digest` hashes
every value, and is also the key under which references are cached.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.digest import content_digest as content_digest  # equality is part of the model

Vec2 = tuple[float, float]
Vec3 = tuple[float, float, float]
MaterialKind = Literal["unlit", "diffuse", "glossy", "glass"]
FloatArray = NDArray[np.float64]
Scalar = TypeVar("Scalar", bound=np.generic)


def read_only(array: NDArray[Scalar]) -> NDArray[Scalar]:
    """Return a contiguous array that nobody can write to (a copy where the argument could still be written)."""
    out = np.ascontiguousarray(array)
    if out.flags.writeable:
        out = out.copy()
        out.flags.writeable = False
    return out


def as_vec3(values: FloatArray) -> Vec3:
    """Return three numbers as a plain vector; -0.0, which calculations leave behind, becomes 0.0."""
    x, y, z = (values + 0.0).tolist()
    return (x, y, z)


@dataclass(frozen=True, slots=True)
class Spin:
    """A rotation about an axis through a point, right-handed; +z turns counter-clockwise seen from +z."""

    axis: Vec3
    center: Vec3
    rev_per_s: float


@dataclass(frozen=True, slots=True)
class Motion:
    """x(t) = c + v t + R(2 pi rev_per_s t)(x0 - c); or two matrices, at the begin and the end of each frame.

    `matrices` are row-major 4 x 4 (affine), interpolated linearly over the frame interval of every frame, and exclude
    velocity and spin.
    """

    velocity: Vec3 = (0.0, 0.0, 0.0)
    spin: Spin | None = None
    matrices: tuple[tuple[float, ...], tuple[float, ...]] | None = None

    @property
    def is_static(self) -> bool:
        """Whether points stay where they are at all times (a pair of equal matrices still displaces them)."""
        still = self.spin is None or self.spin.rev_per_s == 0.0
        return still and self.velocity == (0.0, 0.0, 0.0) and self.matrices is None


@dataclass(frozen=True, slots=True)
class Animation:
    """Frame n is at t = n / fps; the shutter is open from t to t + shutter / fps (0: an instant)."""

    fps: float = 30.0
    frames: int = 1
    shutter: float = 0.0


@dataclass(frozen=True, slots=True)
class Camera:
    """A pinhole, a thin lens or an orthographic camera; `height` is in world units, `fov_y_deg` in degrees.

    The target moves with `velocity` unless `target_velocity` is given. `focus_distance` is measured along the axis;
    None means the distance of the target.
    """

    projection: Literal["orthographic", "perspective"]
    position: Vec3 = (0.0, 0.0, 5.0)
    target: Vec3 = (0.0, 0.0, 0.0)
    up: Vec3 = (0.0, 1.0, 0.0)
    height: float | None = None
    fov_y_deg: float | None = None
    velocity: Vec3 = (0.0, 0.0, 0.0)
    target_velocity: Vec3 | None = None
    lens_radius: float = 0.0
    focus_distance: float | None = None

    @property
    def is_static(self) -> bool:
        """Whether the camera stays where it is at all times."""
        return self.velocity == (0.0, 0.0, 0.0) and self.target_velocity in (None, (0.0, 0.0, 0.0))


@dataclass(frozen=True, slots=True)
class Material:
    """How a surface answers light: unlit L = color * texture; `roughness` is the GGX alpha; `abbe` disperses."""

    kind: MaterialKind = "unlit"
    roughness: float = 0.1
    ior: float = 1.5
    abbe: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """One object: a planar simple polygon (`is_polygon`: the vertices are its outline in order) or a triangle mesh.

    Attributes
    ----------
    vertices : (n, 3) float64
        World positions at t = 0.
    triangles : (m, 3) int32
        Vertex indices; of a polygon too (every triangle keeps the outline's winding).
    uv : (n, 2) float64 or None
        Texture coordinates of the vertices, v up.
    texture : str or None
        A key of `Scene.textures`; multiplies `color`.
    """

    vertices: FloatArray
    triangles: NDArray[np.int32]
    is_polygon: bool = True
    color: Vec3 = (1.0, 1.0, 1.0)
    uv: FloatArray | None = None
    texture: str | None = None
    material: Material = Material()
    motion: Motion = Motion()
    name: str = ""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Surface) and content_digest(self) == content_digest(other)

    def __hash__(self) -> int:
        return hash(content_digest(self))


@dataclass(frozen=True, slots=True)
class Checker:
    """(floor(u sx) + floor(v sy)) even is black; `squares` = (sx, sy) per unit of uv."""

    squares: Vec2
    black: Vec3 = (0.0, 0.0, 0.0)
    white: Vec3 = (1.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class ImageTexture:
    """Texels in linear light, repeated. Texel (row r from the bottom, column k) covers [k/w, (k+1)/w) x [r/h, (r+1)/h).

    Attributes
    ----------
    texels : (h, w, 4) float32
        Linear RGBA, row 0 at v = 0 (the picture's bottom).
    alpha_cutoff : float or None
        Below this alpha the surface is absent (cut out).
    source : str
        Where it came from, for people; a path relative to the scene file where it came from one.
    """

    texels: NDArray[np.float32]
    alpha_cutoff: float | None = None
    source: str = ""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ImageTexture) and content_digest(self) == content_digest(other)

    def __hash__(self) -> int:
        return hash(content_digest(self))


@dataclass(frozen=True, slots=True)
class Grating:
    """low + (high - low)(1 + cos(2 pi (cycles s + phase))) / 2 with s = u cos(angle) + v sin(angle); or its sign."""

    cycles: float
    angle_deg: float = 0.0
    phase: float = 0.0
    profile: Literal["sine", "square"] = "sine"
    low: Vec3 = (0.0, 0.0, 0.0)
    high: Vec3 = (1.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True)
class ZonePlate:
    """(1 + cos(k r^2 + phase)) / 2 with r the distance from `center` in uv."""

    center: Vec2
    k: float
    phase: float = 0.0


Texture = Checker | ImageTexture | Grating | ZonePlate
# What scene files and people call them.
TEXTURE_KINDS: Mapping[type[Texture], str] = {
    Checker: "checker",
    ImageTexture: "image",
    Grating: "grating",
    ZonePlate: "zone_plate",
}


@dataclass(frozen=True, slots=True)
class Light:
    """A one-sided rectangle light: four corners, radiance along the winding normal; visible."""

    quad: tuple[Vec3, Vec3, Vec3, Vec3]
    radiance: Vec3


@dataclass(frozen=True, slots=True)
class EdgeFact:
    """A straight edge in world coordinates at t = 0, bright to the left of start -> end as the camera sees it."""

    start: Vec3
    end: Vec3


@dataclass(frozen=True, slots=True)
class RotorFact:
    """A rotor of equal blades; `duty` is the bright share of the circle, `inner` and `outer` bound the annulus."""

    center: Vec3
    axis: Vec3
    blades: int
    duty: float
    rev_per_s: float
    inner: float
    outer: float


@dataclass(frozen=True, slots=True)
class GratingFact:
    """A sinusoid or square wave of known frequency vector, in cycles per world unit (x, y)."""

    cycles_per_unit: Vec2


@dataclass(frozen=True, slots=True)
class PanFact:
    """The whole picture moves with `velocity` (world units per second) and repeats after `period` seconds."""

    velocity: Vec3
    period: float


@dataclass(frozen=True, slots=True)
class Facts:
    """What metrics may rely on; a metric whose fact is missing is not applicable."""

    edges: tuple[EdgeFact, ...] = ()
    rotors: tuple[RotorFact, ...] = ()
    gratings: tuple[GratingFact, ...] = ()
    pans: tuple[PanFact, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Everything that is rendered. `contrast` is white minus black as declared, used by the metrics.

    `bounces` is how often light goes on from one diffuse surface to another: 0, direct light alone, or 1. Diffuse
    surfaces then are lit by all that they see: unlit surfaces and the background as bright as they look, lights, and
    each other by direct light.
    """

    name: str
    camera: Camera
    objects: tuple[Surface, ...] = ()
    textures: Mapping[str, Texture] = field(default_factory=dict)
    lights: tuple[Light, ...] = ()
    background: Vec3 = (0.0, 0.0, 0.0)
    contrast: float = 1.0
    bounces: int = 0
    animation: Animation = Animation()
    facts: Facts = Facts()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scene) and content_digest(self) == content_digest(other)

    def __hash__(self) -> int:
        return hash(content_digest(self))

    @property
    def is_static(self) -> bool:
        """Whether nothing moves, camera included: every frame is then the same picture."""
        return self.camera.is_static and all(o.motion.is_static for o in self.objects)
