"""The contract of a prepared scene: determinism, counts and times, what is refused, and that nothing stays behind."""

import gc
from dataclasses import replace

import moderngl
import numpy as np
import pytest

from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.raster.context import acquire_context
from aliasbench.renderers.raster.filtering import make_optics
from aliasbench.renderers.raster.projection import DepthRule
from aliasbench.renderers.raster.targets import Target, make_layout
from aliasbench.renderers.technique import parse_technique
from aliasbench.scenes.errors import InputError, UnsupportedScene
from aliasbench.scenes.model import Material

pytestmark = pytest.mark.usefixtures("gl_checked")
SIZE = (32, 24)


@pytest.mark.parametrize("technique", ["raster", "raster:msaa=4", "raster:passes=5", "raster:passes=3,msaa=4"])
def test_same_arguments_give_the_same_pixels(make, technique):
    scene = make.star(animation=make.moving)
    with prepare(scene, technique, size=SIZE) as prepared:
        first = prepared.render(frame=1, seed=2)
        prepared.render(frame=2, seed=3)
        again = prepared.render(frame=1, seed=2)
    np.testing.assert_array_equal(first.pixels, again.pixels)
    np.testing.assert_array_equal(first.pixels, render(scene, technique, size=SIZE, frame=1, seed=2).pixels)


def test_seeds_change_jittered_passes_only(make):
    scene = make.star()
    for technique, changes in (("raster:passes=4", True), ("raster:passes=4,sampler=grid", False), ("raster", False)):
        with prepare(scene, technique, size=SIZE) as prepared:
            one, other = (prepared.render(seed=s).pixels for s in (0, 1))
        assert (one != other).any() == changes


def test_frames_say_what_they_are(make):
    with prepare(make.star(), "raster:msaa=4,passes=3", size=SIZE) as prepared:
        frames = [prepared.render() for _ in range(2)]
    for frame in frames:
        assert frame.pixels.shape == (24, 32, 3)
        assert frame.pixels.dtype == np.float32
        assert frame.samples == 32 * 24 * 12
        assert 0 < frame.seconds < 60
        assert frame.setup_seconds == frames[0].setup_seconds > 0
        assert frame.sample_counts is None
        assert frame.uncertainty is None
    # a later frame must not write into an earlier one
    assert not np.shares_memory(frames[0].pixels, frames[1].pixels)


def test_a_closed_scene_refuses_to_draw(make):
    with prepare(make.star(), "raster", size=SIZE) as prepared:
        pass
    with pytest.raises(RuntimeError, match="this prepared scene is closed; prepare it again to render"):
        prepared.render()


def test_forgotten_scenes_are_freed_by_the_next(make):
    context = acquire_context()
    prepare(make.star(), "raster:msaa=4", size=SIZE)
    gc.collect()
    assert len(context._left_over) == 2
    with prepare(make.star(), "raster", size=SIZE):
        assert not context._left_over


def test_materials_and_lights_that_are_not_drawn_are_named(make):
    star = make.star()
    glass = tuple(replace(s, material=Material("glass")) for s in star.objects)
    for scene, feature in (
        (replace(star, objects=glass), r"material glass \(object .*\) is"),
        (replace(star, bounces=1), r"diffuse interreflection \(bounces = 1\) is"),
    ):
        with pytest.raises(UnsupportedScene, match=f"raster: {feature} not drawn; "):
            prepare(scene, "raster", size=SIZE)


def test_diffuse_without_lights_is_unlit(make):
    star = make.star()
    diffuse = replace(star, objects=tuple(replace(s, material=Material("diffuse")) for s in star.objects))
    np.testing.assert_array_equal(render(diffuse, "raster", size=SIZE).pixels, render(star, "raster", size=SIZE).pixels)


def test_hardware_samples_that_are_lacking_are_refused(make):
    counts = acquire_context().sample_counts
    with pytest.raises(InputError, match=f"msaa=3: this device .* has {', '.join(map(str, counts))} samples a pixel"):
        prepare(make.star(), "raster:msaa=3", size=SIZE)


def test_a_margin_beyond_the_devices_limit_is_refused(make):
    context = acquire_context()
    limit = min(context.max_size, context.max_texture_size)
    with pytest.raises(
        InputError, match=f"ssaa=1 with {limit} drawn pixels around: this device .* draws at most {limit}"
    ):
        prepare(make.star(), f"raster:filter=tent,radius={limit}", size=(4, 4))


def test_a_picture_of_one_pixel(make):
    whole = make.polygon([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], color=(0.5, 0.25, 2.0))
    for technique in ("raster", "raster:msaa=4", "raster:msaa=4,passes=2", "raster:ssaa=5"):
        np.testing.assert_array_equal(render(make.scene(whole), technique, size=(1, 1)).pixels[0, 0], (0.5, 0.25, 2.0))


@pytest.mark.parametrize("technique", ["raster", "raster:msaa=4,passes=2,ssaa=2", "raster:ssaa=3"])
@pytest.mark.parametrize("lacking", [0, 1])
def test_a_picture_that_finds_no_memory_is_refused_and_nothing_of_it_stays(make, monkeypatch, technique, lacking):
    context = acquire_context()
    real = context.gl
    textures, framebuffers = [], []

    def texture(*arguments, **options):
        textures.append(real.texture(*arguments, **options))
        return textures[-1]

    def framebuffer(*arguments):
        if len(framebuffers) == min(lacking, "=" in technique):
            raise moderngl.Error("the framebuffer is not complete (INCOMPLETE_ATTACHMENT)")
        framebuffers.append(real.framebuffer(*arguments))
        return framebuffers[-1]

    class Short:
        """The context with no room for more framebuffers."""

        def __getattr__(self, name):
            return {"texture": texture, "framebuffer": framebuffer}.get(name) or getattr(real, name)

    with context.use(), monkeypatch.context() as patch:
        patch.setattr(context, "gl", Short())
        chosen = parse_technique(technique)
        optics = make_optics(chosen)
        layout = make_layout(context, SIZE, chosen, optics)
        with pytest.raises(InputError, match=r"size 32x24: this device .* cannot hold .*GiB.*; choose a smaller size"):
            Target(context, layout, chosen, DepthRule("<=", 1.0), optics)
    assert textures
    assert all(isinstance(made.mglo, moderngl.mgl.InvalidObject) for made in (*textures, *framebuffers))
    assert render(make.star(), technique, size=SIZE).pixels.max() > 0.5
