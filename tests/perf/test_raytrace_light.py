"""What shadow rays buy beside camera rays: error and time over a grid of both, on the floor under soft shadows.

A camera ray with one shadow ray costs two rays and improves edges and penumbrae alike; one with 63 improves penumbrae
alone. At 64 rays a pixel, 32 times one each must be at least as good as one with 63, and at most 1.2 times as slow.
`make bench` measures; otherwise a small picture is drawn, with the grid's corner, and only errors are judged.
"""

import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aliasbench.renderers.catalog import prepare, render
from aliasbench.scenes.files import load_scene

SCENE = "soft-shadow"
SHADOW_RAYS, CAMERA_RAYS = (1, 4, 16, 64, 256), (1, 4, 16, 64)
SMALL_SHADOW_RAYS, SMALL_CAMERA_RAYS = (1, 4, 16), (1, 4, 16)
SAMPLERS = ("jittered", "multijittered", "sobol")
SLOWEST = 1.2


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep references of a test in its own folder."""
    monkeypatch.setenv("ALIASBENCH_CACHE", str(tmp_path))


def exact(side: int) -> np.ndarray:
    frame = render(load_scene(SCENE), "reference:", size=(side, side))
    assert frame.uncertainty is not None
    assert frame.uncertainty < 1e-4
    return frame.pixels


def measure(technique: str, truth: np.ndarray, seeds: int) -> tuple[float, float]:
    """Return the root of the mean squared error over the picture and seeds, and the shortest time of a picture."""
    side = len(truth)
    with prepare(load_scene(SCENE), technique, size=(side, side)) as prepared:
        frames = [prepared.render(0, seed) for seed in range(seeds)]
    squares = [((frame.pixels - truth) ** 2).mean() for frame in frames]
    return math.sqrt(float(np.mean(squares))), min(frame.seconds for frame in frames)


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_one_shadow_ray_each_beats_all_shadow_rays_from_one_camera_ray(benchmark: Any, sampler: str) -> None:
    side, seeds = 64, 16 if benchmark.enabled else 6
    truth = exact(side)

    def both() -> tuple[float, float]:
        many, _ = measure(f"raytrace:spp=32,sampler={sampler},shadow_rays=1", truth, seeds)
        # A single camera ray is jittered too: the centre's error would not go away with seeds.
        single, _ = measure(f"raytrace:spp=1,sampler={sampler},shadow_rays=63", truth, seeds)
        return many, single

    many, single = benchmark.pedantic(both, rounds=1)
    print(f"\n{sampler}, 64 rays a pixel: RMSE {many:.5f} (32 x (1 + 1)), {single:.5f} (1 + 63)")
    assert 0.0 < many <= single


def test_grid_of_shadow_rays_and_camera_rays(benchmark: Any) -> None:
    is_full = benchmark.enabled
    side, seeds = (64, 3) if is_full else (24, 4)
    shadow_rays = SHADOW_RAYS if is_full else SMALL_SHADOW_RAYS
    camera_rays = CAMERA_RAYS if is_full else SMALL_CAMERA_RAYS
    truth = exact(side)
    errors, seconds = (np.zeros((len(shadow_rays), len(camera_rays))) for _ in range(2))

    def fill() -> None:
        for i, shadows in enumerate(shadow_rays):
            for j, spp in enumerate(camera_rays):
                text = f"raytrace:spp={spp},sampler=sobol,shadow_rays={shadows}"
                errors[i, j], seconds[i, j] = measure(text, truth, seeds)

    benchmark.pedantic(fill, rounds=1)
    print(f"\n{SCENE}, {side} x {side}: RMSE and milliseconds a picture")
    print("shadow rays" + "".join(f"{f'{spp} spp':>20s}" for spp in camera_rays))
    for i, shadows in enumerate(shadow_rays):
        cells = (f"{errors[i, j]:11.5f} {1e3 * seconds[i, j]:8.2f}" for j in range(len(camera_rays)))
        print(f"{shadows:11d}" + "".join(cells))
    # Edges alone are left in the first column however many shadow rays there are; camera rays bring all down.
    assert (np.diff(errors, axis=1) < 0.0).all()
    assert (errors[1:, -1] <= 1.05 * errors[:-1, -1]).all()
    assert errors[0, -1] < 0.5 * errors[0, 0]
    # With as many shadow rays in all, four times the camera rays are never worse than a tenth.
    for i in range(1, len(shadow_rays)):
        assert (errors[i - 1, 1:] < 1.1 * errors[i, :-1]).all()


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_camera_rays_cost_hardly_more_than_shadow_rays(benchmark: Any, sampler: str) -> None:
    side, rounds = (256, 9) if benchmark.enabled else (16, 1)
    scene = load_scene(SCENE)
    seconds: dict[str, list[float]] = {"32 x (1 + 1)": [], "1 + 63": []}
    with (
        prepare(scene, f"raytrace:spp=32,sampler={sampler},shadow_rays=1", size=(side, side)) as many,
        prepare(scene, f"raytrace:spp=1,sampler={sampler},shadow_rays=63", size=(side, side)) as single,
    ):
        for seed in range(rounds + 1):
            for name, prepared in zip(seconds, (many, single), strict=True):
                started = time.perf_counter()
                prepared.render(0, seed)
                seconds[name].append(time.perf_counter() - started)
        benchmark.pedantic(many.render, rounds=1)
    pairs = [a / b for a, b in zip(*(values[1:] for values in seconds.values()), strict=True)]
    if benchmark.enabled:
        ratio = float(np.median(pairs))
        print(f"\n{sampler}, {side} x {side}, 64 rays a pixel: 32 camera rays take {ratio:.2f} times as long as one")
        benchmark.extra_info["ratio"] = ratio
        assert ratio <= SLOWEST
