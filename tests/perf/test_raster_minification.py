"""What each texture mode of the rasterizer costs and how far it is from the exact footprint, on receding floors.

`make bench` measures, interleaved, and prints the table; otherwise every case runs once, small, and only the order of
the errors is checked. The device's own anisotropy, which no technique uses, is there for comparison: Mesa's software
device has one mode of it, whatever number is asked for.
"""

import time
from contextlib import ExitStack
from typing import Any

import numpy as np
import pytest

from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.raster import shaders
from aliasbench.scenes.catalog import SCENES

MODES = ("point", "linear", "mipmap", "trilinear", *(f"anisotropic,anisotropy={n}" for n in (2, 4, 8, 16, 64)))
DEVICE = "device's anisotropy 16"


def prepare_device_anisotropy(scene: Any, size: tuple[int, int], monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return the scene with the driver's look-up, which takes its own derivatives, in place of ours."""
    real = shaders.read_shader
    with monkeypatch.context() as patch:
        patch.setattr(
            shaders,
            "read_shader",
            lambda name: real(name).replace("textureLod(image, coordinate, lod)", "texture(image, coordinate)"),
        )
        prepared = prepare(scene, "raster:texture=trilinear", size=size)
    inner: Any = prepared._inner  # no option asks for it
    with inner._context.use():
        for shading in inner._buffers._shadings:
            shading.image.anisotropy = 16.0
    return prepared


@pytest.mark.parametrize("name", ["checker-floor", "brick-floor"])
def test_error_and_time_of_texture_modes(benchmark: Any, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    size, rounds = ((256, 192), 15) if benchmark.enabled else ((64, 48), 1)
    scene = SCENES[name].build()
    exact = render(scene, "reference:", size=size).pixels
    # below the horizon's row: edges are another matter
    below = np.arange(size[1]) > 0.32 * size[1]
    pixels, times = {}, {mode: [] for mode in (*MODES, DEVICE)}
    with ExitStack() as stack:
        scenes = {mode: stack.enter_context(prepare(scene, f"raster:texture={mode}", size=size)) for mode in MODES}
        scenes[DEVICE] = stack.enter_context(prepare_device_anisotropy(scene, size, monkeypatch))
        for number in range(rounds + 1):
            for mode, prepared in scenes.items():
                started = time.perf_counter()
                pixels[mode] = prepared.render().pixels
                if number:
                    times[mode].append(time.perf_counter() - started)
        benchmark.pedantic(scenes["anisotropic,anisotropy=16"].render, rounds=rounds)
    error = {m: float(np.sqrt(np.mean((p[below] - exact[below]) ** 2))) for m, p in pixels.items()}
    assert error["anisotropic,anisotropy=16"] < error["trilinear"] < 1.02 * error["mipmap"] < error["point"]
    # the device's own is no better than ours with as many taps
    assert error["anisotropic,anisotropy=16"] < error[DEVICE]
    if benchmark.enabled:
        base = np.min(times["trilinear"])
        print(f"\n{name}, {size[0]} x {size[1]}, one sample; trilinear takes {1e3 * base:.1f} ms")
        for mode, values in times.items():
            print(f"{mode:28} error {error[mode]:.4f}   time {np.min(values) / base:5.2f} of trilinear's")
        assert np.min(times["anisotropic,anisotropy=16"]) < np.min(times[DEVICE])
