"""Rasterizer against ray tracer, sample for sample: an accumulation pass is one sample of the shared pattern.

They may differ only where a sample lies within 2/256 px of an edge (8 sub-pixel bits): polygon scenes are compared with
a float64 model that knows where that is, others by how many pixels may have such a sample.
"""

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.renderers.sampling.patterns import sample_set
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import Motion, Spin
from aliasbench.scenes.motion import shutter_fraction

pytestmark = pytest.mark.usefixtures("gl_checked")
SIZE = (64, 48)
SAMPLERS = ("grid", "random", "jittered", "multijittered", "sobol")
SPIN = Motion(velocity=(0.4, -0.2, 0.0), spin=Spin((0.0, 0.0, 1.0), (0.05, 0.0, 0.0), 3.7))


def both(scene, count, sampler, more="", *, frame=0, seed=0, size=SIZE):
    raster = render(scene, f"raster:passes={count},sampler={sampler}{more}", size=size, frame=frame, seed=seed)
    tracer = render(
        scene, f"raytrace:spp={count},pattern=shared,sampler={sampler}{more}", size=size, frame=frame, seed=seed
    )
    assert raster.samples == tracer.samples
    return raster.pixels, tracer.pixels


@pytest.mark.parametrize("camera", ["orthographic", "perspective"])
@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.parametrize("moves", [False, True])
def test_polygons_differ_only_at_samples_by_an_edge(make, camera, sampler, moves):
    options = {"motion": SPIN, "animation": make.moving} if moves else {}
    scene = make.star(camera=getattr(make, camera), **options)
    frame, seed = 2, 5
    raster, tracer = both(scene, 8, sampler, frame=frame, seed=seed)
    doubtful = np.zeros((SIZE[1], SIZE[0]), int)
    for x, y, time in sample_set(sampler, 8, seed=seed, frame=frame)[:, :3]:
        at = shutter_fraction(scene.animation, time)
        doubtful += make.sample(scene, SIZE, x, y, frame=frame, fraction=at)[1]
    assert 0 < (doubtful > 0).sum() < 0.2 * doubtful.size
    off = np.abs(raster - tracer).max(axis=2)
    assert np.ptp(tracer) > 0.3
    assert off[doubtful == 0].max() < 2e-6
    # each sample in doubt is worth the largest contrast of the scene
    assert (off <= doubtful / 8 * 0.9 + 2e-6).all()
    assert (off > 1e-3).sum() <= 0.5 * (doubtful > 0).sum()


@pytest.mark.parametrize(
    ("name", "more", "share"),
    [
        ("edge-fan", "", 0.02),
        ("edge-fan", ",filter=mitchell", 0.2),
        ("edge-fan", ",filter=lanczos,weighting=distribution", 0.02),
        ("propeller:shutter=0.8", "", 0.02),
        ("propeller:shutter=0.8", ",motion=matrix", 0.02),
        ("propeller:shutter=0.8", ",time=center,filter=cone", 0.05),
        ("two-matrices:shutter=1", ",motion=matrix", 0.02),
        ("depth-of-field", "", 0.03),
        ("depth-of-field", ",filter=tent,weighting=distribution", 0.03),
        ("camera-turn:shutter=1", "", 0.03),
    ],
)
@pytest.mark.parametrize("sampler", ["random", "sobol"])
def test_moving_scenes_lenses_and_filters_agree(name, more, share, sampler):
    raster, tracer = both(load_scene(name), 7, sampler, more, frame=1, seed=3, size=(96, 64))
    off = np.abs(raster - tracer).max(axis=2)
    assert np.ptp(tracer) > 0.2
    assert (off > 1e-4).mean() < share
    assert np.median(off) < 1e-6
    assert abs((raster - tracer).mean()) < 1e-3


@pytest.mark.parametrize("name", ["checker-floor", "brick-floor", "zone-plate", "photo-wall"])
@pytest.mark.parametrize("sampler", ["jittered", "sobol"])
def test_textured_scenes_with_nearest_texels_agree(name, sampler):
    raster, tracer = both(load_scene(name), 16, sampler, ",texture=nearest", seed=3, size=(96, 64))
    assert np.ptp(tracer) > 0.2
    assert np.sqrt(np.mean((raster - tracer) ** 2)) < 2e-3
