"""Signals with known answers: scenes whose world units are pixels, exact edges, pans and rotors, as fixtures."""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from aliasbench.scenes.model import Animation, Camera, EdgeFact, Facts, RotorFact, Scene, Surface, Vec3

sys.path.append(str(Path(__file__).parent))  # where planted signals are

FloatArray = NDArray[np.float64]
MakeScene = Callable[..., Scene]


@pytest.fixture(scope="session")
def make_scene() -> MakeScene:
    """A scene of which one world unit is one pixel, the world's origin in the picture's middle."""

    def make(
        size: tuple[int, int],
        *,
        facts: Facts | None = None,
        animation: Animation | None = None,
        contrast: float = 1.0,
        objects: tuple[Surface, ...] = (),
        velocity: Vec3 = (0.0, 0.0, 0.0),
        position: Vec3 = (0.0, 0.0, 5.0),
    ) -> Scene:
        camera = Camera("orthographic", position=position, height=float(size[1]), velocity=velocity)
        return Scene(
            "planted",
            camera,
            objects=objects,
            contrast=contrast,
            animation=animation or Animation(),
            facts=facts or Facts(),
        )

    return make


@pytest.fixture(scope="session")
def edge_fact() -> Callable[..., EdgeFact]:
    """The fact of an edge from (x0, y0) to (x1, y1) in pixels of a picture of that size, for `make_scene`."""

    def make(size: tuple[int, int], start: tuple[float, float], end: tuple[float, float]) -> EdgeFact:
        def world(p: tuple[float, float]) -> Vec3:
            return (p[0] - size[0] / 2, size[1] / 2 - p[1], 0.0)

        return EdgeFact(world(start), world(end))

    return make


@pytest.fixture(scope="session")
def rgb() -> Callable[[FloatArray], FloatArray]:
    """Grey pictures (..., h, w) as (..., h, w, 3)."""

    def make(grey: FloatArray) -> FloatArray:
        return np.repeat(np.asarray(grey, dtype=np.float64)[..., None], 3, axis=-1)

    return make


@pytest.fixture(scope="session")
def box_edge() -> Callable[..., FloatArray]:
    """Exact coverage by y < slope x + intercept, box filter: int clip(slope x + intercept - i, 0, 1) dx per pixel."""

    def make(size: tuple[int, int], slope: float, intercept: float) -> FloatArray:
        width, height = size
        left = slope * np.arange(width) + intercept - np.arange(height)[:, None]
        if slope == 0.0:
            return np.clip(left, 0.0, 1.0)

        def primitive(u: FloatArray) -> FloatArray:
            inside: FloatArray = np.where(u > 1.0, u - 0.5, np.maximum(u, 0.0) ** 2 / 2)
            return inside

        # Far from the edge the difference of large numbers is off by a few ulp: coverage is never outside [0, 1].
        return np.clip((primitive(left + slope) - primitive(left)) / slope, 0.0, 1.0)

    return make


@pytest.fixture(scope="session")
def point_edge() -> Callable[..., FloatArray]:
    """y < slope x + intercept at one or n x n regular samples of each pixel."""

    def make(size: tuple[int, int], slope: float, intercept: float, n: int = 1) -> FloatArray:
        width, height = size
        offset = (np.arange(n) + 0.5) / n
        x = (np.arange(width)[:, None] + offset).ravel()
        y = (np.arange(height)[:, None] + offset).ravel()
        hits = y[:, None] < slope * x + intercept
        return hits.reshape(height, n, width, n).mean(axis=(1, 3))

    return make


@pytest.fixture(scope="session")
def rotor_frames() -> Callable[..., FloatArray]:
    """Sectors (angle modulo 1 / blades below duty is bright) at pixel centres, the shutter integrated exactly.

    `instants` > 0 averages that many equally spaced instants instead, as an accumulation buffer does.
    """

    def make(rotor: RotorFact, side: int, animation: Animation, instants: int = 0) -> FloatArray:
        center = (np.arange(side) + 0.5) - side / 2
        turn = np.arctan2(-center[:, None], center[None, :]) / (2 * np.pi) * rotor.blades
        frames = []
        for k in range(animation.frames):
            per_second = rotor.blades * rotor.rev_per_s
            u = turn - per_second * k / animation.fps
            sweep = per_second * animation.shutter / animation.fps
            if instants or sweep == 0.0:
                steps = (np.arange(max(instants, 1)) + (0.5 if instants else 0.0)) / max(instants, 1) * sweep
                frames.append(np.mean([np.mod(u - s, 1.0) < rotor.duty for s in steps], axis=0))
            else:

                def primitive(v: FloatArray, duty: float = rotor.duty) -> FloatArray:
                    out: FloatArray = np.floor(v) * duty + np.minimum(np.mod(v, 1.0), duty)
                    return out

                frames.append((primitive(u) - primitive(u - sweep)) / sweep)
        return np.array(frames, dtype=np.float64)

    return make


@pytest.fixture(scope="session")
def rotor_scene(make_scene: MakeScene) -> Callable[..., tuple[Scene, RotorFact]]:
    """A rotor of inner radius 20 % and outer radius 80 % of half the picture's side."""

    def make(
        side: int, blades: int, rate: float, *, duty: float = 0.5, frames: int = 30, shutter: float = 0.0
    ) -> tuple[Scene, RotorFact]:
        rotor = RotorFact((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), blades, duty, rate, 0.1 * side, 0.4 * side)
        animation = Animation(30.0, frames, shutter)
        return make_scene((side, side), facts=Facts(rotors=(rotor,)), animation=animation), rotor

    return make
