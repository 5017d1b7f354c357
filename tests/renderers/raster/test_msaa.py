"""The error of hardware samples is that of the positions that the device tells; what is not partly covered is exact."""

import math

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.renderers.raster.context import acquire_context, sample_positions
from aliasbench.scenes.model import Camera, Scene
from aliasbench.scenes.shapes import polygon

pytestmark = pytest.mark.usefixtures("gl_checked")
SIZE = 64
EDGES = 96


def edge_scene(angle: float, offset: float) -> Scene:
    """White left of a straight edge, black right of it; a world unit is a pixel."""
    along = np.array([-math.sin(angle), math.cos(angle), 0.0])
    across = np.array([math.cos(angle), math.sin(angle), 0.0])
    on = offset * across
    far = 200.0
    corners = [on - far * along, on + far * along, on + far * along - far * across, on - far * along - far * across]
    return Scene("edge", Camera("orthographic", height=float(SIZE)), (polygon([tuple(c) for c in corners]),))


def distances(angle: float, offset: float, x: float, y: float) -> np.ndarray:
    """How far right of the edge the places (column + x, row + y) lie, (h, w)."""
    column, row = np.meshgrid(np.arange(SIZE) + x - SIZE / 2, SIZE / 2 - np.arange(SIZE) - y)
    return column * math.cos(angle) + row * math.sin(angle) - offset


@pytest.mark.parametrize("count", acquire_context().sample_counts)
def test_the_error_on_random_edges_is_that_of_the_device_s_positions(count: int) -> None:
    """RMS over partly covered pixels, 3 % for the model; 2/256 px of doubt at an edge change a thirtieth of that."""
    rng = np.random.default_rng(count)
    places = sample_positions(count)
    measured, modelled, pixels = 0.0, 0.0, 0
    for _ in range(EDGES):
        angle, offset = rng.uniform(0, 2 * math.pi), rng.uniform(-3, 3)
        scene = edge_scene(angle, offset)
        shown = render(scene, f"raster:msaa={count}", size=(SIZE, SIZE)).pixels[..., 0]
        truth = render(scene, "reference:", size=(SIZE, SIZE)).pixels[..., 0]
        middle = distances(angle, offset, 0.5, 0.5)
        reach = 0.5 * (abs(math.cos(angle)) + abs(math.sin(angle)))
        partial = np.abs(middle) < reach
        assert partial.sum() >= SIZE
        clear = np.abs(middle) > reach + 2 / 256
        np.testing.assert_array_equal(shown[clear], (middle < 0)[clear])
        model = np.mean([distances(angle, offset, x, y) < 0 for x, y in places], axis=0)
        measured += float(((shown - truth)[partial] ** 2).sum())
        modelled += float(((model - truth)[partial] ** 2).sum())
        pixels += int(partial.sum())
    rms, expected = math.sqrt(measured / pixels), math.sqrt(modelled / pixels)
    print(f"msaa={count}: RMS {rms:.4f}, of the positions {expected:.4f}")
    assert rms == pytest.approx(expected, rel=0.03)
    assert rms < 0.333 * 0.62 ** math.log2(count)


def test_the_resolve_is_linear_and_keeps_high_values() -> None:
    scene = edge_scene(0.4, 0.3)
    bright = Scene("bright", scene.camera, tuple(_lit(s, 1000.0) for s in scene.objects), background=(0.25, 0.0, 0.5))
    share = render(scene, "raster:msaa=4", size=(SIZE, SIZE)).pixels[..., :1]
    shown = render(bright, "raster:msaa=4", size=(SIZE, SIZE)).pixels
    expected = share * 1000.0 + (1.0 - share) * np.array([0.25, 0.0, 0.5])
    np.testing.assert_allclose(shown, expected, rtol=1e-6)


def _lit(surface, value):
    from dataclasses import replace

    return replace(surface, color=(value, value, value))
