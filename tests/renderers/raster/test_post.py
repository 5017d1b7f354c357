"""Laws of every filter that looks at one picture: what is flat stays, symmetric pictures stay so, edges get better."""

import moderngl
import numpy as np
import pytest

from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.raster import post, targets
from aliasbench.renderers.raster.post import Fxaa, Smaa
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.files import load_scene

pytestmark = pytest.mark.usefixtures("gl_checked")
KINDS = {"fxaa": Fxaa, "smaa": Smaa}
each_kind = pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
each_name = pytest.mark.parametrize("name", KINDS)


@each_kind
def test_flat_pictures_stay_to_the_bit(processing, kind):
    for color in ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (0.3, 1e-7, 0.9), (37.25, 4000.0, 1.5), (0.1, 0.2, 70000.0)):
        picture = np.broadcast_to(np.float32(color), (13, 29, 3)).copy()
        np.testing.assert_array_equal(processing.process(kind, picture), picture)


@each_kind
def test_flat_areas_stay_to_the_bit_beside_edges(processing, kind):
    # a bright square of which every channel is beyond white; nothing may reach farther than its edges' neighbours
    picture = np.full((40, 40, 3), 0.25, np.float32)
    picture[10:30, 10:30] = (12.5, 3.25, 700.0)
    out = processing.process(kind, picture)
    changed = (out != picture).any(axis=2)
    allowed = np.zeros_like(changed)
    allowed[8:32, 8:32] = True
    allowed[12:28, 12:28] = False
    assert not (changed & ~allowed).any()
    assert out.min() >= 0.25
    assert (out <= np.float32([12.5, 3.25, 700.0]) * (1 + 1e-6)).all()


@each_kind
@pytest.mark.parametrize("symmetry", ["transposed", "mirrored", "upside down"])
def test_a_picture_turned_over_gives_the_result_turned_over(processing, kind, symmetry):
    turn = processing.SYMMETRIES[symmetry]
    changed = 0
    for seed in range(12):
        picture = processing.random_shapes(seed)
        out = processing.process(kind, picture)
        turned = processing.process(kind, turn(picture))
        np.testing.assert_allclose(turn(turned), out, atol=1e-5)
        changed += np.count_nonzero((out != picture).any(axis=2))
    assert changed > 12 * 100


@each_kind
def test_colours_stay_between_those_of_the_neighbourhood(processing, kind):
    for seed in range(6):
        picture = processing.random_shapes(seed)
        out = processing.process(kind, picture)
        padded = np.pad(picture, ((1, 1), (1, 1), (0, 0)), mode="edge")
        around = np.lib.stride_tricks.sliding_window_view(padded, (3, 3), axis=(0, 1))
        assert (out >= around.min(axis=(3, 4)) - 1e-6).all()
        assert (out <= around.max(axis=(3, 4)) + 1e-6).all()


@each_kind
def test_a_scaled_picture_is_processed_as_scaled(processing, kind):
    picture = processing.random_shapes(3)
    np.testing.assert_array_equal(processing.process(kind, 2.0 * picture, 0.5), processing.process(kind, picture))


@each_kind
def test_single_pixels_and_lines_of_one_pixel(processing, kind):
    for shape in ((1, 1), (1, 9), (9, 1), (2, 2), (17, 17)):
        for bright in (1.0, 1e30):
            picture = np.zeros((*shape, 3), np.float32)
            picture[shape[0] // 2, shape[1] // 2] = bright
            line = np.zeros_like(picture)
            line[shape[0] // 2] = bright
            for p in (picture, line):
                out = processing.process(kind, p)
                assert np.isfinite(out).all()
                assert (out >= 0.0).all()
                assert (out <= np.float32(bright)).all()


@each_name
def test_edges_are_nearer_the_truth(processing, name):
    # A factor of .5 to .7 is what the methods are known for; the bound is on all of them, at several sizes and angles.
    for text, size in (("edge-fan", (256, 256)), ("edge-fan", (200, 144)), ("edge-fan:wedges=10", (128, 160))):
        one, processed = processing.edge_rms(load_scene(text), ["raster:", f"raster:post={name}"], size)
        print(f"\n{text} {size}: {name} {processed / one:.3f} of the error without")
        assert processed < 0.6 * one


@each_name
def test_a_picture_of_passes_is_processed_once_and_as_a_whole(processing, make, name):
    scene, size = make.star(), (48, 40)
    for technique in ("raster:passes=5", "raster:msaa=4", "raster:passes=3,msaa=4,ssaa=2", "raster:filter=gaussian"):
        plain = render(scene, technique, size=size, seed=3).pixels
        with prepare(scene, f"{technique},post={name}", size=size) as prepared:
            first = prepared.render(seed=3).pixels
            prepared.render(frame=1, seed=4)
            again = prepared.render(seed=3).pixels
        np.testing.assert_array_equal(first, again)
        np.testing.assert_allclose(first, processing.process(KINDS[name], plain), atol=2e-6)
        assert (first != plain).any()


def test_pictures_in_parts_are_refused_with_the_largest_size(make, monkeypatch):
    monkeypatch.setattr(targets, "_MOST_BYTES", 20 * 1000)
    with pytest.raises(InputError, match=r"size 100x50 with post=fxaa: .* at most 45x22 of that shape at once"):
        prepare(make.star(), "raster:post=fxaa", size=(100, 50))
    assert render(make.star(), "raster:post=fxaa", size=(45, 22)).pixels.shape == (22, 45, 3)


def test_processing_that_finds_no_memory_is_refused(make, monkeypatch):
    def refuse(*_arguments, **_options):
        raise moderngl.Error("the framebuffer is not complete (INCOMPLETE_ATTACHMENT)")

    monkeypatch.setitem(post._FILTERS, "fxaa", refuse)
    with pytest.raises(InputError, match=r"size 32x24 with post=fxaa: this device .* cannot hold .* smaller size"):
        prepare(make.star(), "raster:post=fxaa", size=(32, 24))
