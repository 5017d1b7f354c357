"""Random scenes of a few polygons, and random techniques, as hypothesis draws them: see `test_random_pictures`.

A scene is made in units of half the picture's height, the camera four of them away, and then turned, scaled and moved
as a whole, so that whatever is true of it near the origin must be true of it anywhere. Outlines are star-shaped about
their centre, which makes them simple, and growing them about it covers what they covered.

What kind of thing there is, and how many, hypothesis draws one by one, and finds the least that fails; coordinates and
colours come from generators whose seeds it draws. It would draw too many that are the ends of intervals or alike.
"""

import math
import os
from dataclasses import dataclass, replace

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

from aliasbench.renderers.technique import FILTER_RADII
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Animation, Camera, FloatArray, Motion, Scene, Spin, Surface, Vec3, as_vec3
from aliasbench.scenes.shapes import polygon

EXAMPLES = int(os.environ.get("EXAMPLES", "0"))  # how many to draw in all; 0: the few of every test run
# A rotation by the quaternion 4 + i + 2j + 3k: no axis of the world is one of the picture's.
TURN = np.array([(4.0, -20.0, 22.0), (28.0, 10.0, 4.0), (-10.0, 20.0, 20.0)]) / 30.0
DISTANCE = 4.0
FPS = 24.0
AT_REST = Motion()
DEPTHS = (0.0, 0.0, 0.0, -1.0, 0.5, 1.25)
WHITE, BLACK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
NOT_NEGATIVE = ("box", "tent", "cone", "gaussian")
_FAR_OFF = 1e5  # units from the origin beyond which rounding leaves coplanar polygons in planes of their own


@dataclass(frozen=True)
class Flat:
    """A star-shaped polygon: its outline (n, 2) about `center`, in a plane tilted by an angle about a level line."""

    outline: FloatArray
    center: Vec3
    tilt: float
    color: Vec3
    motion: Motion = AT_REST

    def points(self, grown: float = 1.0) -> FloatArray:
        """Corners (n, 3), the outline grown about its centre."""
        x, y = grown * self.outline.T
        c, s = math.cos(self.tilt), math.sin(self.tilt)
        out: FloatArray = np.stack([x, c * y, s * y], axis=1) + np.asarray(self.center)
        return out


@dataclass(frozen=True)
class Stage:
    """Where the scene is seen: everything but what is seen."""

    projection: str
    fov_deg: float
    at: Vec3
    unit: float
    turned: bool
    background: Vec3
    shutter: float
    camera_velocity: Vec3 = (0.0, 0.0, 0.0)

    @property
    def axes(self) -> FloatArray:
        """The rotation (3, 3) of the whole scene."""
        return TURN if self.turned else np.eye(3)

    def place(self, points: FloatArray) -> FloatArray:
        """Points (..., 3) of the plain scene in the world."""
        out: FloatArray = np.asarray(self.at) + self.unit * np.asarray(points) @ self.axes.T
        return out

    def surface(self, flat: Flat, *, grown: float = 1.0, color: Vec3 | None = None) -> Surface:
        """The polygon in the world."""
        m = flat.motion
        spin = m.spin and Spin(as_vec3(self.axes @ m.spin.axis), as_vec3(self.place(m.spin.center)), m.spin.rev_per_s)
        motion = Motion(as_vec3(self.unit * self.axes @ m.velocity), spin)
        return polygon(self.place(flat.points(grown)), color=color or flat.color, motion=motion)

    def scene(self, surfaces: list[Surface]) -> Scene:
        """A scene of surfaces that are in the world already."""
        ends = [as_vec3(self.place(np.array([0.0, 0.0, z]))) for z in (DISTANCE, 0.0)]
        up, velocity = as_vec3(self.axes[:, 1]), as_vec3(self.unit * self.axes @ self.camera_velocity)
        camera = Camera("orthographic", *ends, up, height=2.0 * self.unit, velocity=velocity)
        if self.projection == "perspective":
            camera = replace(camera, projection="perspective", height=None, fov_y_deg=self.fov_deg)
        animation = Animation(FPS, 8, self.shutter)
        return Scene("random", camera, tuple(surfaces), background=self.background, animation=animation)

    def on_black(self, surfaces: list[Surface]) -> Scene:
        """A scene of surfaces on black.

        Black ones behind all and beside all see to it that float32 has its origin in the same place, and nothing else
        is rounded another way, whatever there is between.
        """
        reach = 400.0
        behind = [(-reach, -reach, -2.0), (reach, -reach, -2.0), (reach, reach, -2.0), (-reach, reach, -2.0)]
        beside = [(reach, 0.0, 2.0), (reach - 1.0, 0.0, 2.0), (reach, 1.0, 2.0)]
        black = [polygon(self.place(np.array(p)), color=BLACK) for p in (behind, beside)]
        return replace(self, background=BLACK).scene([*black, *surfaces])


@dataclass(frozen=True)
class Case:
    """A scene and how large it is drawn."""

    stage: Stage
    flats: tuple[Flat, ...]
    scene: Scene
    size: tuple[int, int]
    frame: int
    seed: int

    @property
    def is_level(self) -> bool:
        """Whether all polygons face the camera all the time."""
        return all(f.tilt == 0.0 and _is_level(f.motion) for f in self.flats) and self.stage.camera_velocity[2] == 0.0


def _is_level(motion: Motion) -> bool:
    return motion.velocity[2] == 0.0 and (motion.spin is None or motion.spin.axis == (0.0, 0.0, 1.0))


SEEDS = st.integers(0, 2**31)
GENERATORS = SEEDS.map(np.random.default_rng)


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    """Floats of an interval, six digits of them: what is shown can be typed."""
    return st.integers(0, 1_000_000).map(lambda k: low + (high - low) * k / 1_000_000)


def vector(rng: np.random.Generator, reach: float) -> Vec3:
    """A vector within a cube."""
    return as_vec3(rng.uniform(-reach, reach, 3))


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number of an interval, evenly by its logarithm."""
    return math.exp(rng.uniform(math.log(low), math.log(high)))


@st.composite
def colors(draw) -> Vec3:
    """Colours up to 4, now and then of channels that are 0, 1 or 4."""
    rng = draw(GENERATORS)
    plain = draw(st.integers(0, 3)) == 0
    return as_vec3(rng.choice([0.0, 1.0, 4.0], 3) if plain else rng.uniform(0.0, 4.0, 3))


@st.composite
def outlines(draw) -> FloatArray:
    """Outlines (n, 2) about the origin: convex or not, slivers, far larger than the view and far smaller."""
    count, convex, sliver = draw(st.integers(3, 8)), draw(st.booleans()), draw(st.integers(0, 3)) == 0
    extreme, rng = draw(st.integers(0, 3)) == 0, draw(GENERATORS)
    # no gap as wide as half a turn, so that the origin is inside
    angles = 2.0 * math.pi * (np.arange(count) + rng.uniform(0.0, 0.45, count)) / count
    lengths = np.ones(count) if convex else rng.uniform(0.2, 1.0, count)
    flat = lengths[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    flat = flat * (1.0, log_uniform(rng, 1e-3, 0.3) if sliver else 1.0)
    turn = rng.uniform(0.0, 2.0 * math.pi)
    c, s = math.cos(turn), math.sin(turn)
    size = log_uniform(rng, 0.02, 100.0) if extreme else rng.uniform(0.3, 1.5)
    out: FloatArray = size * flat @ np.array([(c, s), (-s, c)])
    return out


@st.composite
def motions(draw, level: bool) -> Motion:
    """Motions; `level` ones stay in planes that face the camera."""
    slides, spins, rng = draw(st.booleans()), draw(st.booleans()), draw(GENERATORS)
    velocity = vector(rng, 0.5 * FPS) if slides or not spins else (0.0, 0.0, 0.0)
    spin = None
    if spins:
        axis = (0.0, 0.0, 1.0) if level or draw(st.booleans()) else as_vec3(rng.normal(size=3))
        spin = Spin(axis, vector(rng, 1.0), rng.uniform(-0.5, 0.5) * FPS)
    return Motion((velocity[0], velocity[1], 0.0 if level else velocity[2]), spin)


@st.composite
def stages(draw, moving: bool = False) -> Stage:
    """Cameras, places, units and backgrounds."""
    rng = draw(GENERATORS)
    away, other, travels = (draw(st.booleans()) for _ in range(3))
    return Stage(
        draw(st.sampled_from(("orthographic", "perspective"))),
        rng.uniform(15.0, 100.0),
        as_vec3(log_uniform(rng, 1e-3, 1e6) * rng.uniform(-1.0, 1.0, 3)) if away else (0.0, 0.0, 0.0),
        log_uniform(rng, 1e-6, 1e6) if other else 1.0,
        draw(st.booleans()),
        draw(colors()),
        (1.0 if draw(st.booleans()) else rng.uniform(0.0, 1.0)) if moving else 0.0,
        vector(rng, 0.3 * FPS) if moving and travels else (0.0, 0.0, 0.0),
    )


@st.composite
def flats(draw, stage: Stage, *, moving: bool = False, level: bool = False) -> Flat:
    """Polygons: in the view, beside it or partly; in one plane, one behind another, or tilted."""
    rng = draw(GENERATORS)
    x, y = rng.uniform(-1.0, 1.0, 2) * draw(st.sampled_from((0.8, 0.8, 0.8, 0.8, 0.8, 3.0)))
    depth = draw(st.sampled_from(DEPTHS))
    if max(map(abs, stage.at)) > _FAR_OFF * stage.unit:
        depth += rng.uniform(0.01, 0.4)
    tilt = 0.0 if level or draw(st.booleans()) else rng.uniform(-1.2, 1.2)
    motion = draw(motions(level)) if moving and draw(st.integers(0, 3)) else AT_REST
    return Flat(draw(outlines()), (float(x), float(y), depth), tilt, draw(colors()), motion)


@st.composite
def cases(draw, *, moving: bool | None = False, level: bool = False, most: int = 24) -> Case:
    """Whole cases; `moving` None is either."""
    moves = draw(st.booleans()) if moving is None else moving
    stage = draw(stages(moves))
    if level:
        x, y, _ = stage.camera_velocity
        stage = replace(stage, camera_velocity=(x, y, 0.0))
    parts: list[Flat] = []
    surfaces: list[Surface] = []
    for _ in range(draw(st.integers(1, 4))):
        flat = draw(flats(stage, moving=moves, level=level))
        try:
            surfaces.append(stage.surface(flat))
        except InputError:
            continue  # so small and far from the origin that rounding leaves no polygon
        parts.append(flat)
    size = (1, 1) if draw(st.integers(0, 9)) == 9 else as_size(draw(GENERATORS), most)
    frame = draw(st.integers(0, 3)) if moves else 0
    return Case(stage, tuple(parts), stage.scene(surfaces), size, frame, draw(SEEDS))


@st.composite
def level_cases(draw) -> Case:
    """Cases of two polygons that face the camera."""
    case = draw(cases(level=True))
    two = [draw(flats(case.stage, level=True)) for _ in range(2)]
    try:
        scene = case.stage.scene([case.stage.surface(flat) for flat in two])
    except InputError:
        assume(False)
    return replace(case, flats=tuple(two), scene=scene)


def as_size(rng: np.random.Generator, most: int) -> tuple[int, int]:
    """A size in pixels."""
    width, height = rng.integers(1, most + 1, 2).tolist()
    return width, height


@st.composite
def filters(draw, names: tuple[str, ...] = tuple(FILTER_RADII)) -> str:
    """The keys of a filter, of sensible radius; nothing for the pixel's box."""
    name = draw(st.sampled_from(names))
    if name == "box" and draw(st.booleans()):
        return ""
    # under narrower filters than .75 px a picture of few samples has pixels without any
    low, high = {"box": (0.5, 1.5), "mitchell": (1.0, 2.5), "lanczos": (1.0, 3.0)}.get(name, (0.75, 2.0))
    keys = f",filter={name},radius={draw(numbers(low, high)):.4g}"
    return keys + (f",sigma={draw(numbers(0.3, 0.8)):.4g}" if name == "gaussian" else "")


def engines(sampler: str) -> st.SearchStrategy[str]:
    """The keys of an engine, none most of the time.

    Kernels of the portable one with the samplers that have code of their own are compiled for the extended run alone:
    no other test needs them.
    """
    rare = sampler in ("multijittered", "bluenoise") and not EXAMPLES
    return st.sampled_from(("", "", "", ",robust=off", *(() if rare else (",engine=portable",))))


@st.composite
def techniques(draw, chosen: str, *, shared: bool = False, fixed: bool = True) -> str:
    """Texts of tracers and rasterizers with the keys of a filter: few samples, any sampler.

    `shared` asks for one pattern for all pixels; without `fixed` no samples whose places are the device's.
    """
    samplers = ["grid", "random", "jittered", "multijittered", "sobol"]
    count = draw(st.integers(1, 16))
    weighting = ",weighting=distribution" if chosen and draw(st.integers(0, 2)) == 0 else ""
    reseed = draw(st.sampled_from(("", "", ",reseed=never")))
    if draw(st.booleans()):
        pattern = ",pattern=shared" if shared or draw(st.booleans()) else ""
        sampler = draw(st.sampled_from([*samplers, *([] if pattern else ["bluenoise"])]))
        engine = draw(engines(sampler))
        return f"raytrace:spp={count},sampler={sampler}{pattern}{engine}{chosen}{weighting}{reseed}"
    backend = draw(st.sampled_from(("egl", "egl", "egl", "egl", "osmesa")))
    more = "" if weighting or not fixed else draw(st.sampled_from(("", ",ssaa=2", ",ssaa=3", ",msaa=4")))
    sampler = draw(st.sampled_from(samplers))
    return f"raster:passes={count},sampler={sampler},backend={backend}{more}{chosen}{weighting}{reseed}"
