"""The project's own model is made by its script, to the byte, and is the catalog's scene."""

import time

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.scenes.assets.make_lantern import PATH, lantern_glb
from aliasbench.scenes.catalog import SCENES
from aliasbench.scenes.files import load_scene


def test_the_asset_is_what_its_script_makes() -> None:
    assert PATH.read_bytes() == lantern_glb()
    assert len(lantern_glb()) < 16 * 1024


def test_the_file_opens_with_its_own_turn() -> None:
    scene = load_scene(str(PATH))
    assert {s.motion.spin.rev_per_s for s in scene.objects if s.motion.spin} == {0.25}
    assert scene.animation.frames / scene.animation.fps == pytest.approx(4.0)


def test_the_scene_is_built_in_no_time_once_the_model_is_read() -> None:
    SCENES["lantern"].build()
    start = time.perf_counter()
    scene = SCENES["lantern"].build(rev_per_s=0.5, shutter=0.5)
    assert time.perf_counter() - start < 0.05
    assert scene.animation.frames == 60


def test_after_a_whole_turn_the_picture_is_the_same() -> None:
    scene = SCENES["lantern"].build(rev_per_s=1.0)
    first, last = (render(scene, "raytrace:", size=(48, 48), frame=f).pixels for f in (0, scene.animation.frames))
    np.testing.assert_array_equal(first, last)
    other = render(scene, "raytrace:", size=(48, 48), frame=1).pixels
    assert np.abs(first - other).max() > 0.1


def test_renderers_agree_on_the_lantern() -> None:
    scene = SCENES["lantern"].build()
    exact = render(scene, "reference:", size=(32, 32))
    for technique in ("raytrace:spp=256", "raster:ssaa=8"):
        difference = render(scene, technique, size=(32, 32)).pixels - exact.pixels
        # A coverage estimate of n jittered samples is off by less than the n^-1/2 of independent ones, times contrast.
        assert np.sqrt((difference**2).mean()) < 64**-0.5 / 2
        assert abs(difference.mean()) < 2e-3
