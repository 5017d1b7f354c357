"""Photographed walls: no pixel's centre is on a texel's border, so both renderers sample the same texels, always."""

import numpy as np
import pytest

from aliasbench.renderers.catalog import prepare
from aliasbench.scenes.catalog import build_scene


@pytest.mark.parametrize("side", [128, 256, 512])
@pytest.mark.parametrize("text", ["brick-wall", "page-wall", "photo-wall:photo=coins"])
def test_renderers_sample_the_same_texels_of_a_wall_and_again_after_a_loop(text: str, side: int) -> None:
    scene = build_scene(text)
    pictures = []
    for technique in ("raytrace:", "raster:"):
        with prepare(scene, technique, size=(side, side)) as prepared:
            pictures += [prepared.render(frame=n).pixels for n in (0, 1, scene.animation.frames)]
    first, second, last, *others = pictures
    np.testing.assert_array_equal(last, first)
    assert (second != first).any()
    # colours in float32
    np.testing.assert_allclose(others, [first, second, last], rtol=0, atol=1e-6)
