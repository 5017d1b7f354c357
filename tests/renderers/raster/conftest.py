"""Scenes of a few polygons and what they must look like, point by point, computed in float64 without any renderer."""

import importlib.util
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from aliasbench.renderers.raster.context import acquire_context
from aliasbench.scenes.model import Animation, Camera, Motion, Scene, Surface
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import view_at

EDGE_PX = 2 / 256  # 8 sub-pixel bits: an edge may be drawn this far from its place

ORTHOGRAPHIC = Camera("orthographic", height=2.0)
PERSPECTIVE = Camera("perspective", position=(0.3, -0.2, 4.0), target=(0.0, 0.1, 0.0), fov_y_deg=35.0)


def make_polygon(points: object, **options: object) -> Surface:
    """A convex polygon (a fan of triangles)."""
    vertices = np.array(points, dtype=np.float64)
    fan = [[0, i, i + 1] for i in range(1, len(vertices) - 1)]
    uv = options.pop("uv", None)
    return Surface(vertices, np.array(fan, np.int32), uv=None if uv is None else np.array(uv, float), **options)


def make_scene(*objects: Surface, camera: Camera = ORTHOGRAPHIC, **options: object) -> Scene:
    return Scene("test", camera, tuple(objects), **options)


def make_star(*, camera: Camera = ORTHOGRAPHIC, motion: Motion | None = None, **options: object) -> Scene:
    """Nine thin wedges of three colours about the origin, in the plane z = 0."""
    angles = 2 * np.pi * np.arange(9) / 9 + 0.1
    wedges = []
    for k, a in enumerate(angles):
        tip = [[0.9 * np.cos(b), 0.9 * np.sin(b), 0.0] for b in (a, a + 0.3)]
        color = tuple(float(c) for c in np.roll([1.0, 0.5, 0.25], k))
        wedges.append(make_polygon([[0.013, 0.007, 0.0], *tip], color=color, motion=motion or Motion()))
    return make_scene(*wedges, camera=camera, background=(0.1, 0.2, 0.3), **options)


def sample_scene(
    scene: Scene, size: tuple[int, int], x: float, y: float, *, frame: int = 0, fraction: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Colours (h, w, 3) at the places (column + x, row + y), painting flat convex polygons in their order.

    Also (h, w): whether a place is within EDGE_PX of an edge, where the answer may be either.
    """
    view = view_at(scene.camera, scene.animation, frame, fraction, size)
    px, py = np.meshgrid(np.arange(size[0]) + x, np.arange(size[1]) + y)
    colors = np.broadcast_to(scene.background, (*px.shape, 3)).copy()
    doubtful = np.zeros(px.shape, bool)
    for surface in scene.objects:
        matrix = object_matrix(surface.motion, scene.animation, frame, fraction)
        corners = view.project(surface.vertices @ matrix[:3, :3].T + matrix[:3, 3])[:, :2]
        ends = np.roll(corners, -1, axis=0)
        sides = []
        for (ax, ay), (bx, by) in zip(corners, ends, strict=True):
            length = np.hypot(bx - ax, by - ay)
            sides.append(((bx - ax) * (py - ay) - (by - ay) * (px - ax)) / length)
        inward = np.array(sides) * np.sign(_twice_area(corners))
        depth_inside = inward.min(axis=0)
        colors[depth_inside > 0] = surface.color
        doubtful |= np.abs(depth_inside) < EDGE_PX
    return colors, doubtful


def _twice_area(corners: np.ndarray) -> float:
    x, y = corners.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


@pytest.fixture(scope="session")
def make() -> SimpleNamespace:
    """Makers of polygons and scenes, two cameras, and the model `sample`."""
    return SimpleNamespace(
        polygon=make_polygon,
        scene=make_scene,
        star=make_star,
        sample=sample_scene,
        orthographic=ORTHOGRAPHIC,
        perspective=PERSPECTIVE,
        moving=Animation(fps=24.0, frames=3, shutter=0.75),
    )


@pytest.fixture(scope="session")
def processing() -> ModuleType:
    """The module `processing` beside this file."""
    spec = importlib.util.spec_from_file_location("raster_processing", Path(__file__).with_name("processing.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def gl_checked() -> Iterator[Callable[[], str]]:
    """Fail a test that leaves an OpenGL error behind."""
    context = acquire_context()
    with context.use() as gl:
        assert gl.error == "GL_NO_ERROR"
    yield lambda: context.renderer
    with context.use() as gl:
        assert gl.error == "GL_NO_ERROR"
