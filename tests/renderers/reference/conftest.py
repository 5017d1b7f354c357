"""Small scenes for the references' tests, built from the plain model; and a cache of their own.

The oracle, the maker of random scenes and the trials that bring them together are modules beside the tests, not tests:
this folder is put on the path for them.
"""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from aliasbench.scenes.model import Animation, Camera, Motion, Scene, Surface, Texture, Vec3, read_only

sys.path.append(str(Path(__file__).parent))
CORNERS = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Keep references of a test in its own folder."""
    monkeypatch.setenv("ALIASBENCH_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / "references"


@pytest.fixture
def make_polygon() -> Callable[..., Surface]:
    """Return a maker of surfaces from points; triangles are a fan unless given."""

    def make(
        points: object,
        color: Vec3 = (1.0, 1.0, 1.0),
        *,
        motion: Motion | None = None,
        triangles: Sequence[Sequence[int]] | None = None,
        texture: str | None = None,
        is_polygon: bool = True,
    ) -> Surface:
        v = np.asarray(points, dtype=np.float64)
        if v.shape[1] == 2:
            v = np.c_[v, np.zeros(len(v))]
        fan = [[0, i, i + 1] for i in range(1, len(v) - 1)] if triangles is None else triangles
        return Surface(
            read_only(v),
            read_only(np.array(fan, np.int32)),
            is_polygon=is_polygon,
            color=color,
            uv=read_only(np.array(CORNERS)) if texture else None,
            texture=texture,
            motion=motion or Motion(),
        )

    return make


@pytest.fixture
def make_scene() -> Callable[..., Scene]:
    """Return a maker of scenes: orthographic, two units high, black behind."""

    def make(
        objects: Sequence[Surface],
        *,
        background: Vec3 = (0.0, 0.0, 0.0),
        camera: Camera | None = None,
        shutter: float = 0.0,
        fps: float = 30.0,
        textures: dict[str, Texture] | None = None,
    ) -> Scene:
        return Scene(
            "test",
            camera or Camera("orthographic", height=2.0),
            tuple(objects),
            textures=textures or {},
            background=background,
            animation=Animation(fps, 30, shutter),
        )

    return make
