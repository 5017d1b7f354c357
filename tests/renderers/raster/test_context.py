"""Backends: what they report, that they agree, and what a user is told where one is missing."""

import itertools
import threading

import numpy as np
import pytest

from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.raster import context as context_module
from aliasbench.renderers.raster import platforms
from aliasbench.renderers.raster.context import (
    NoContextError,
    acquire_context,
    describe_contexts,
    sample_positions,
)
from aliasbench.renderers.raster.graphics import GraphicsError
from aliasbench.renderers.raster.platforms import ContextError
from aliasbench.scenes.catalog import SCENES
from aliasbench.scenes.errors import InputError, UnsupportedScene
from aliasbench.scenes.files import load_scene


def test_every_backend_is_reported_with_what_it_can_do_or_how_to_get_it():
    reports = describe_contexts()
    assert {r.backend for r in reports} == {"egl", "osmesa"}
    assert any(r.ok for r in reports)
    for r in reports:
        assert r.ok == (r.error == "") == (r.fix == "") == bool(r.renderer and r.vendor and r.version)
        if r.ok:
            assert r.max_texture_size >= 1024
            assert r.sample_counts[0] == 1
            assert r.max_samples == max(r.sample_counts)
            for count, positions in r.sample_positions:
                assert len(set(positions)) == count
                assert all(0 < v < 1 for v in itertools.chain(*positions))
        else:
            assert ("libosmesa6" if r.backend == "osmesa" else "libegl1") in r.fix


def test_egl_and_osmesa_draw_the_same_picture(make):
    scene = make.star(camera=make.perspective)
    osmesa = next(r for r in describe_contexts() if r.backend == "osmesa")
    if osmesa.ok:
        for technique in ("raster:", "raster:msaa=4,", "raster:passes=5,", "raster:msaa=4,passes=2,"):
            separator = "" if technique.endswith(",") else "passes=1,"
            one, other = (
                render(scene, f"{technique}{separator}backend={backend}", size=(64, 48)).pixels
                for backend in ("egl", "osmesa")
            )
            np.testing.assert_allclose(one, other, atol=1e-6)
    else:
        with pytest.raises(NoContextError, match=r"OSMesa: .*libosmesa6"):
            render(scene, "raster:backend=osmesa", size=(64, 48))


def supported_scenes():
    """Names of the catalog's scenes that the rasterizer draws."""
    return [name for name in SCENES if name not in ("colour-bleeding", "dispersion-prism")]


def test_the_rasterizer_draws_all_scenes_but_two():
    for name in ("colour-bleeding", "dispersion-prism"):
        with pytest.raises(UnsupportedScene):
            prepare(load_scene(name), "raster", size=(8, 8))
    assert len(supported_scenes()) == len(SCENES) - 2


@pytest.mark.parametrize("name", supported_scenes())
def test_egl_and_osmesa_draw_every_scene_alike(name):
    """On the same Mesa: largest difference 1e-6. Without OSMesa the sentence that says what is missing is shown."""
    osmesa = next(r for r in describe_contexts() if r.backend == "osmesa")
    scene, size = load_scene(name), (24, 18)
    if not osmesa.ok:
        with pytest.raises(NoContextError, match=r"OSMesa: .*libosmesa6"):
            render(scene, "raster:backend=osmesa", size=size)
        return
    for technique in ("raster:texture=trilinear,", "raster:msaa=4,passes=2,filter=tent,"):
        one, other = (render(scene, f"{technique}backend={b}", size=size).pixels for b in ("egl", "osmesa"))
        np.testing.assert_allclose(one, other, atol=1e-6)


def test_one_context_for_each_thread_and_backend():
    assert acquire_context() is acquire_context()
    other = []
    thread = threading.Thread(target=lambda: other.append(acquire_context()))
    thread.start()
    thread.join()
    assert other[0] is not acquire_context()


def test_two_prepared_scenes_alive_at_once_do_not_disturb_each_other(make):
    first, second = make.star(), make.star(camera=make.perspective)
    backends = [r.backend for r in describe_contexts() if r.ok]
    for a, b in itertools.product(backends, backends):
        texts = f"raster:msaa=4,backend={a}", f"raster:passes=3,backend={b}"
        alone = [render(s, t, size=(40, 30)).pixels for s, t in zip((first, second), texts, strict=True)]
        with (
            prepare(first, texts[0], size=(40, 30)) as one,
            prepare(second, texts[1], size=(40, 30)) as other,
        ):
            for _ in range(2):
                np.testing.assert_array_equal(one.render().pixels, alone[0])
                np.testing.assert_array_equal(other.render().pixels, alone[1])


def test_a_prepared_scene_may_be_drawn_by_another_thread(make):
    scene = make.star()
    pictures = []
    with prepare(scene, "raster:msaa=4", size=(40, 30)) as prepared:
        threads = [threading.Thread(target=lambda: pictures.append(prepared.render().pixels)) for _ in range(3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        pictures.append(prepared.render().pixels)
    assert len(pictures) == 4
    for picture in pictures[1:]:
        np.testing.assert_array_equal(picture, pictures[0])


def test_threads_with_contexts_of_their_own_draw_the_same(make):
    scene = make.star(camera=make.perspective)
    pictures = []
    threads = [
        threading.Thread(target=lambda: pictures.append(render(scene, "raster:passes=4", size=(40, 30)).pixels))
        for _ in range(3)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(pictures) == 3
    np.testing.assert_array_equal(pictures[0], pictures[1])
    np.testing.assert_array_equal(pictures[0], pictures[2])


def test_missing_libraries_are_one_error_with_each_attempt_and_its_fix(monkeypatch):
    monkeypatch.setattr(platforms, "_EGL_LIBRARY", "libEGL-missing.so.1")
    monkeypatch.setattr(platforms, "_OSMESA_LIBRARIES", ("libOSMesa-missing.so.8",))
    monkeypatch.setattr(context_module, "_POOL", context_module._Pool())
    with pytest.raises(NoContextError) as caught:
        acquire_context("auto")
    message = str(caught.value)
    for part in ("EGL: libEGL-missing.so.1", "libegl1, libgl1 and libgl1-mesa-dri", "OSMesa: ", "libosmesa6"):
        assert part in message
    assert "\n" not in message
    reports = describe_contexts()
    assert [(r.backend, r.ok) for r in reports] == [("egl", False), ("osmesa", False)]
    assert all(r.error and r.fix for r in reports)
    with pytest.raises(NoContextError, match=r"backend=osmesa: .*libosmesa6"):
        acquire_context("osmesa")


def test_without_egl_auto_falls_back_to_osmesa(monkeypatch):
    osmesa = next(r for r in describe_contexts() if r.backend == "osmesa")

    def no_devices():
        raise ContextError("EGL finds no device", "install a driver")

    monkeypatch.setattr(context_module, "egl_devices", no_devices)
    if osmesa.ok:
        assert acquire_context().backend == "osmesa"
    else:
        with pytest.raises(NoContextError, match=r"EGL finds no device .*; OSMesa: "):
            acquire_context()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("egl", 200), r"device=200: EGL lists \d+ devices? here, numbered from 0"),
        (("osmesa", 0), "device=0: backend=osmesa has no devices; device is for backend=egl"),
        (("elg", None), "unknown backend 'elg'; did you mean 'egl'"),
    ],
)
def test_a_backend_or_device_that_is_not_there_is_named(arguments, message):
    with pytest.raises(InputError, match=message):
        acquire_context(*arguments)


def test_sample_counts_the_device_lacks_are_errors_that_name_a_way():
    counts = acquire_context().sample_counts
    lacking = next(n for n in range(2, 99) if n not in counts)
    with pytest.raises(InputError, match=rf"msaa={lacking}: this device \(.+\) has 1, .*passes=\d+ takes \d+"):
        sample_positions(lacking)


def test_gl_errors_are_raised_with_the_step():
    context = acquire_context()
    with context.use() as gl:
        gl.enable_direct(0x1)
        with pytest.raises(GraphicsError, match="GL_INVALID_ENUM after planting an error"):
            context.check("planting an error")
