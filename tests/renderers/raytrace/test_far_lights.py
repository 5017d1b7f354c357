"""Light on what a far camera sees: coordinates are rounded there, and nothing may come between that is not there."""

import math

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.scenes.lamps import square_lamp
from aliasbench.scenes.model import Camera, Material, Scene
from aliasbench.scenes.shapes import quad


def far_scene(distance: float) -> Scene:
    """Return a lit sheet that looks nearly the same from any distance."""
    sheet = quad([(-0.5, 0.9, 0.5), (0.5, 0.9, 0.5), (0.5, 0.9, -0.5), (-0.5, 0.9, -0.5)], material=Material("diffuse"))
    camera = Camera(
        "perspective",
        position=(0.0, 0.3 * distance, distance),
        target=(0.0, 0.9, 0.0),
        fov_y_deg=math.degrees(2 * math.atan(0.6 / distance)),
    )
    return Scene("far", camera, (sheet,), lights=(square_lamp(size=1.0, height=2.5, radiosity=1.0),))


@pytest.mark.parametrize("engine", ["packet", "portable"])
@pytest.mark.parametrize("distance", [100.0, 15000.0, 25000.0, 40000.0, 45000.0, 80000.0])
def test_a_light_does_not_stand_in_its_own_way(distance: float, engine: str) -> None:
    near = render(far_scene(100.0), "raytrace:spp=256", size=(24, 16)).pixels
    far = render(far_scene(distance), f"raytrace:spp=256,engine={engine}", size=(24, 16)).pixels
    assert near.max() > 1.0
    # The picture changes by a share of 1 / distance, and by noise of some thousandths.
    assert abs(float(far.mean()) / float(near.mean()) - 1.0) < 0.03
    assert float(np.median(np.abs(far - near))) < 0.03
