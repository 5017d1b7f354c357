"""Random scenes of every kind that references take, each from a class and a seed, for trials against the oracle."""

from dataclasses import dataclass, replace

import numpy as np

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import (
    Animation,
    Camera,
    Checker,
    Grating,
    ImageTexture,
    Light,
    Material,
    Motion,
    Scene,
    Spin,
    Surface,
    ZonePlate,
    read_only,
)  # fmt: skip
from aliasbench.scenes.shapes import mesh, polygon

CLASSES = (
    "instant-flat-filter", "moving-flat-box", "moving-flat-filter", "texture-instant-box", "texture-instant-filter",
    "texture-moving", "lens", "lens-motion", "light", "cutout", "everything",
)  # fmt: skip
FILTERS = ("box", "tent", "cone", "gaussian", "mitchell", "lanczos")


@dataclass(frozen=True)
class Case:
    """A picture to try; `radius` and `sigma` are the filter's, in pixels."""

    kind: str
    seed: int
    scene: Scene
    size: tuple[int, int]
    frame: int
    filter: str
    radius: float
    sigma: float
    linear: bool
    matrix: bool

    @property
    def text(self) -> str:
        """Return the technique's text."""
        out = f"reference:filter={self.filter},radius={self.radius!r}"
        out += f",sigma={self.sigma!r}" if self.filter == "gaussian" else ""
        return out + (",texture=linear" if self.linear else "") + (",motion=matrix" if self.matrix else "")

    @property
    def shutter(self) -> tuple[float, float]:
        """Return the first and last fraction of the frame that is shown."""
        s = self.scene.animation.shutter
        return (s / 2, s / 2) if self.scene.is_static else (0.0, s)


def make_case(kind: str, seed: int) -> Case:
    """Return the case of a class and a seed; the same for the same arguments."""
    rng = np.random.default_rng([CLASSES.index(kind), seed])
    while True:
        try:
            return _draw(kind, seed, rng)
        except InputError:
            continue  # a polygon that happens to be degenerate


def _draw(kind: str, seed: int, rng) -> Case:
    every = kind == "everything"
    moving = every or "mov" in kind or "motion" in kind or (kind == "cutout" and rng.random() < 0.3)
    textured = every or "texture" in kind or kind == "cutout"
    some = rng.random() < 0.25
    lens = every or "lens" in kind
    lit = every or kind == "light"
    boxed = kind in ("moving-flat-box", "texture-instant-box") or (kind in ("light", "cutout") and rng.random() < 0.6)
    textured = textured or (kind in ("lens", "lens-motion", "light") and some)
    perspective = rng.random() < 0.6
    animation = Animation(
        float(rng.choice([1.0, 8.0, 30.0])), 4, float(rng.choice([0.25, 0.5, 1.0])) if moving else 0.0
    )
    textures = (
        {f"t{k}": _texture(rng, kind == "cutout" or (every and rng.random() < 0.3)) for k in range(2)}
        if textured
        else {}
    )
    objects: list[Surface] = []
    for _ in range(int(rng.integers(1, 7))):
        objects += _object(rng, objects, textures, moving, animation.fps, lit)
    name, radius, sigma = _filter(rng, boxed)
    scene = Scene(
        f"{kind}-{seed}", _camera(rng, perspective, moving, lens, animation.fps), tuple(objects),
        textures=textures, lights=_lights(rng) if lit else (), background=_color(rng), animation=animation,
    )  # fmt: skip
    sizes = [(1, 1), (1, 9), (11, 1), (40, 30), (16, 12), (8, 8), (23, 17)]
    size = sizes[int(rng.integers(len(sizes)))]
    if kind in ("light", "everything", "lens", "lens-motion"):
        size = (min(size[0], 12), min(size[1], 10))
    linear = bool(textured and rng.random() < 0.3)
    return Case(
        kind, seed, scene, size, int(rng.choice([0, 0, 1, 3])) if moving else 0, name, radius, sigma, linear,
        bool(moving and rng.random() < 0.15),
    )  # fmt: skip


def _filter(rng, boxed):
    if boxed:
        return "box", 0.5, 0.5
    name = FILTERS[int(rng.integers(len(FILTERS)))]
    radius = float(np.round(rng.uniform(0.2, 0.5) if rng.random() < 0.2 else rng.uniform(0.3, 2.5), 3))
    if name == "gaussian" and rng.random() < 0.3:
        radius = float("inf")
    return name, radius, float(np.round(rng.uniform(0.25, 0.9), 3))


def _color(rng):
    top = 5.0 if rng.random() < 0.1 else 1.0
    return tuple(float(x) for x in np.round(rng.uniform(0, top, 3), 3))


def _vector(rng, scale):
    return tuple(float(x) for x in np.round(rng.normal(size=3) * scale, 4))


def _camera(rng, perspective, moving, lens, fps) -> Camera:
    turned = _vector(rng, 0.4)
    velocity = _vector(rng, 0.1 * fps) if moving and rng.random() < 0.3 else (0.0, 0.0, 0.0)
    drifting = _vector(rng, 0.1 * fps) if moving and rng.random() < 0.2 else None
    target = (0.1 * turned[1], 0.0, 0.2 * turned[2])
    camera = Camera(
        "orthographic", position=(turned[0], turned[1], 4.0), target=target, height=2.0, velocity=velocity,
        target_velocity=drifting,
    )  # fmt: skip
    if perspective:
        far = float(np.round(rng.uniform(2.0, 4.0), 3))
        fov = float(np.round(rng.uniform(25, 75), 2))
        camera = replace(
            camera, projection="perspective", height=None, fov_y_deg=fov, position=(turned[0], turned[1], far)
        )
    if lens:
        camera = replace(camera, lens_radius=float(np.round(rng.uniform(0.01, 0.15), 4)))
        if rng.random() < 0.7:
            camera = replace(camera, focus_distance=float(np.round(rng.uniform(1.5, 5.0), 3)))
    return camera


def _lights(rng):
    out = []
    for _ in range(int(rng.integers(1, 3))):
        corner = np.array([*rng.uniform(-1.5, 1.5, 2), rng.uniform(-0.5, 3.0)])
        a = rng.normal(size=3) * 0.5
        b = np.cross(a, rng.normal(size=3))
        b *= rng.uniform(0.2, 1.0) / np.linalg.norm(b)
        if np.cross(a, b) @ (corner - (0.0, 0.0, -0.3)) > 0 and rng.random() < 0.85:
            a, b = b, a
        quad = tuple(tuple(float(x) for x in p) for p in (corner, corner + a, corner + a + b, corner + b))
        out.append(Light(quad, tuple(float(x) for x in np.round(rng.uniform(0.5, 6, 3), 2))))
    return tuple(out)


def _texture(rng, cut):
    which = 0 if cut else int(rng.integers(4))
    if which == 0:
        h, w = rng.integers(1, 6, 2)
        texels = rng.random((h, w, 4)).astype(np.float32)
        if not cut:
            texels[..., 3] = 1.0
        elif rng.random() < 0.4:
            texels[..., :3] = texels[0, 0, :3]
        return ImageTexture(read_only(texels), float(np.round(rng.uniform(0.2, 0.8), 2)) if cut else None)
    if which == 1:
        return Checker(tuple(float(x) for x in np.round(rng.uniform(1, 8, 2), 2)), _color(rng), _color(rng))
    if which == 2:
        return Grating(
            float(np.round(rng.uniform(0.5, 8), 2)), float(np.round(rng.uniform(0, 180), 1)),
            float(np.round(rng.random(), 2)), "sine" if rng.random() < 0.6 else "square", _color(rng), _color(rng),
        )  # fmt: skip
    return ZonePlate(tuple(float(x) for x in np.round(rng.random(2), 2)), float(np.round(rng.uniform(3, 60), 1)), 0.3)


def _object(rng, before, textures, moving, fps, lit):
    """Return one object, or none where a decal has nothing to lie on."""
    what = rng.random()
    centre = np.array([*rng.uniform(-0.9, 0.9, 2), rng.uniform(-0.8, 0.8)])
    normal = np.array([0.0, 0.0, 1.0]) + rng.normal(size=3) * (0.0 if rng.random() < 0.3 else 0.6)
    radius = rng.uniform(0.2, 1.2)
    motion = _motion(rng, fps, centre) if moving and rng.random() < 0.7 else Motion()
    material = Material("diffuse") if (lit and rng.random() < 0.8) or rng.random() < 0.1 else Material()
    name = str(rng.choice(list(textures))) if textures and rng.random() < 0.7 else None
    if what < 0.08:
        points = centre + rng.normal(size=(4, 3)) * 0.5
        return [
            replace(
                mesh(points, [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]], color=_color(rng), motion=motion),
                material=material,
            )
        ]
    if what < 0.14:
        centre = centre + np.array([0.0, 0.0, 5.0])  # behind the camera or close to it
    if 0.14 <= what < 0.24:
        # a floor or wall that runs past the camera
        x, y = rng.uniform(0.3, 1.0, 2)
        corners = np.array([[-3, 0, -4], [3, 0, -4], [3, 0, 6], [-3, 0, 6]]) * [x, 1, 1] - [0, y, 0]
        if rng.random() < 0.3:
            corners = corners[:, [1, 0, 2]]
        uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * rng.uniform(0.5, 3)
        return [
            polygon(corners, color=_color(rng), uv=uv if name else None, texture=name, material=material, motion=motion)
        ]
    flat = _outline(rng, radius)
    if before and 0.24 <= what < 0.45:
        under = before[int(rng.integers(len(before)))]
        if not under.is_polygon:
            return []
        v = under.vertices
        e, f = v[1] - v[0], v[2] - v[0]
        middle = v.mean(axis=0)
        e = e / np.linalg.norm(e)
        f = f - (f @ e) * e
        f = f / np.linalg.norm(f)
        points = middle + 0.5 * (flat[:, :1] * e + flat[:, 1:] * f)
        motion = under.motion if rng.random() < 0.6 else motion
        if motion != under.motion and moving and rng.random() < 0.5:
            slide = (e * rng.normal() + f * rng.normal()) * 0.3 * fps
            motion = Motion(velocity=tuple(float(x) for x in slide))
    else:
        normal /= np.linalg.norm(normal)
        e = np.cross(normal, rng.normal(size=3))
        e /= np.linalg.norm(e)
        points = centre + flat[:, :1] * e + flat[:, 1:] * np.cross(normal, e)
    uv = None
    if name:
        turn = rng.uniform(0, 2 * np.pi)
        m = rng.uniform(0.3, 1.5) * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        uv = flat @ m.T + rng.uniform(-1, 1, 2)
        if rng.random() < 0.1:
            uv = uv + rng.normal(size=uv.shape) * 0.2  # no one affine map: by triangles
    return [polygon(points, color=_color(rng), uv=uv, texture=name, material=material, motion=motion)]


def _outline(rng, radius):
    """Return a star-shaped outline (n, 2): simple, convex or not."""
    n = int(rng.integers(3, 8))
    angle = 2 * np.pi * (np.arange(n) + rng.uniform(0.1, 0.9, n)) / n
    length = radius * (rng.uniform(0.3, 1.0, n) if rng.random() < 0.5 else np.ones(n))
    return np.stack([np.cos(angle), np.sin(angle)], axis=1) * length[:, None]


def _motion(rng, fps, centre) -> Motion:
    which = rng.random()
    velocity = _vector(rng, 0.3 * fps) if rng.random() < 0.6 else (0.0, 0.0, 0.0)
    if which < 0.3:
        return Motion(velocity=_vector(rng, 0.4 * fps))
    if which < 0.75:
        axis = (0.0, 0.0, 1.0) if rng.random() < 0.5 else _vector(rng, 1.0)
        turns = float(np.round(rng.uniform(-0.6, 0.6) if rng.random() < 0.8 else rng.uniform(-3, 3), 3))
        at = tuple(float(x) for x in np.round(centre + rng.normal(size=3) * 0.3, 3))
        return Motion(velocity=velocity, spin=Spin(axis, at, turns * fps))
    begin, end = np.eye(4), np.eye(4)
    begin[:3, :3] += rng.normal(size=(3, 3)) * 0.2
    end[:3, :3] += rng.normal(size=(3, 3)) * 0.2
    if rng.random() < 0.3:
        end[:3, :3] = np.diag([-1.0, -1.0, 1.0])
        begin[:3, :3] = np.eye(3)
    begin[:3, 3], end[:3, 3] = rng.normal(size=(2, 3)) * 0.2
    return Motion(matrices=(tuple(begin.ravel().tolist()), tuple(end.ravel().tolist())))
