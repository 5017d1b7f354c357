"""Pictures that are drawn in parts are those drawn at once, up to edges that the device rounds differently."""

import os
from pathlib import Path

import numpy as np
import pytest

from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.raster import targets
from aliasbench.renderers.raster.context import acquire_context
from aliasbench.scenes.files import load_scene

pytestmark = pytest.mark.usefixtures("gl_checked")
SIZE = (75, 58)


@pytest.mark.parametrize(
    "technique",
    [
        "raster",
        "raster:passes=3,filter=lanczos",
        "raster:msaa=4,passes=2",
        "raster:ssaa=3",
        "raster:msaa=4,ssaa=2,filter=tent",
    ],
)
@pytest.mark.parametrize("scene", ["edge-fan", "brick-floor", "depth-of-field", "propeller:shutter=0.6"])
def test_parts_join_without_seams(monkeypatch, technique, scene):
    built = load_scene(scene)
    if scene == "brick-floor":
        # points of an image far smaller than its texels' places are rounded to: only filtered ones can be compared
        technique += ":texture=trilinear" if technique == "raster" else ",texture=trilinear"
    whole = render(built, technique, size=SIZE, seed=3).pixels
    monkeypatch.setattr(targets, "_MOST_BYTES", 20 * 40 * 40)
    with prepare(built, technique, size=SIZE) as prepared:
        assert len(prepared._inner._parts) > 3
        told = []
        parts = prepared.render(seed=3, progress=told.append).pixels
    assert np.ptp(whole) > 0.3
    # an edge within 2/256 px of a sample: some 4 pixels of 1000 with 16 samples of a scene full of edges
    different = np.abs(parts - whole).max(axis=2) > 2e-3
    assert different.mean() < 0.05
    assert abs((parts - whole).mean()) < 1e-3
    assert told == sorted(told)
    assert told[-1] == pytest.approx(1.0)


@pytest.mark.parametrize("tall", [False, True])
def test_pictures_wider_than_the_device_draws_are_drawn_in_parts(tall):
    limit = min(acquire_context().max_size, acquire_context().max_texture_size)
    size = (5, limit + 7) if tall else (limit + 7, 5)
    scene = load_scene("edge-fan")
    pixels = render(scene, "raster:passes=2,sampler=sobol", size=size, seed=1).pixels
    other = render(scene, "raytrace:spp=2,sampler=sobol,pattern=shared", size=size, seed=1).pixels
    assert pixels.shape == other.shape
    assert np.ptp(other) > 0.3
    assert (np.abs(pixels - other).max(axis=2) > 1e-6).mean() < 0.02


def resident_mb() -> float:
    """Megabytes of this process in memory."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def test_hundreds_of_cases_leave_no_memory_behind(make):
    techniques = (
        "raster",
        "raster:msaa=4",
        "raster:msaa=4,passes=2",
        "raster:ssaa=2",
        "raster:passes=2,filter=tent",
        "raster:passes=2,filter=cone",
        "raster:texture=trilinear",
    )
    scenes = [make.star(), make.star(camera=make.perspective), load_scene("checker-floor"), load_scene("propeller")]

    def run(cases: int) -> None:
        for k in range(cases):
            render(scenes[k % len(scenes)], techniques[k % len(techniques)], size=(40 + k % 3, 30))

    run(2 * len(scenes) * len(techniques))
    before = resident_mb()
    run(500)
    # one 40 x 30 target of four samples kept by each case would be 48 MB
    assert resident_mb() - before < 8.0
