"""Builders of small scenes for the ray tracer's laws."""

from collections.abc import Callable

import numpy as np
import pytest

from aliasbench.scenes.model import Animation, Camera, Motion, Scene, Surface, Texture, Vec3, read_only

PolygonBuilder = Callable[..., Surface]
SceneBuilder = Callable[..., Scene]


@pytest.fixture(scope="session")
def polygon() -> PolygonBuilder:
    """Return a builder of convex polygons, fan triangulated."""

    def build(
        points: object,
        *,
        color: Vec3 = (1.0, 1.0, 1.0),
        uv: object = None,
        texture: str | None = None,
        motion: Motion | None = None,
    ) -> Surface:
        vertices = np.asarray(points, dtype=np.float64)
        fan = [[0, k, k + 1] for k in range(1, len(vertices) - 1)]
        return Surface(
            read_only(vertices),
            read_only(np.array(fan, np.int32)),
            color=color,
            uv=None if uv is None else read_only(np.asarray(uv, dtype=np.float64)),
            texture=texture,
            motion=motion or Motion(),
        )

    return build


@pytest.fixture(scope="session")
def quad(polygon: PolygonBuilder) -> PolygonBuilder:
    """Return a builder of rectangles parallel to the picture: left, bottom, right, top, and z."""

    def build(left: float, bottom: float, right: float, top: float, z: float = 0.0, **options: object) -> Surface:
        corners = [[left, bottom, z], [right, bottom, z], [right, top, z], [left, top, z]]
        return polygon(corners, **{"uv": [[0, 0], [1, 0], [1, 1], [0, 1]], **options})

    return build


@pytest.fixture(scope="session")
def flat_scene() -> SceneBuilder:
    """Return a builder of scenes under a parallel camera where one world unit is one pixel at `height` pixels."""

    def build(
        objects: list[Surface],
        *,
        height: float = 16.0,
        camera: Camera | None = None,
        textures: dict[str, Texture] | None = None,
        background: Vec3 = (0.0, 0.0, 0.0),
        animation: Animation | None = None,
    ) -> Scene:
        return Scene(
            "law",
            camera or Camera("orthographic", height=height),
            tuple(objects),
            textures or {},
            background=background,
            animation=animation or Animation(),
        )

    return build
