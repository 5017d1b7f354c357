"""What it costs to measure: every metric but the perceptual ones of 60 frames of 512 x 512, in time and memory."""

import time
import tracemalloc
from typing import Any

import numpy as np

from aliasbench.metrics.catalog import METRICS, Centers, measure_all
from aliasbench.scenes.model import (
    Animation,
    Camera,
    EdgeFact,
    Facts,
    Grating,
    GratingFact,
    Motion,
    PanFact,
    RotorFact,
    Scene,
)
from aliasbench.scenes.shapes import polygon

FRAMES, SIDE = 60, 512
PERCEPTUAL = ("ssim", "flip")
SECONDS, GIGABYTES = 2.0, 1.0


def full_scene(frames: int, side: int) -> Scene:
    """A scene of which every fact is declared: five edges, a rotor, a grating that a pan moves."""
    half = side / 2.0
    facts = Facts(
        edges=tuple(
            EdgeFact((-0.98 * half, y * half, 0.0), (0.98 * half, (y + 0.12) * half, 0.0))
            for y in (-0.8, -0.4, 0.0, 0.4, 0.7)
        ),
        rotors=(RotorFact((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 3, 0.5, 7.0, 0.2 * half, 0.97 * half),),
        gratings=(GratingFact((17 / 128, 0.0)),),
        pans=(PanFact((15.0, 0.0, 0.0), frames / 30.0),),
    )
    corners = [(-half, -half, 0.0), (half, -half, 0.0), (half, half, 0.0), (-half, half, 0.0)]
    uv = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
    wall = polygon(corners, uv=np.array(uv), texture="waves", motion=Motion((15.0, 0.0, 0.0)))
    camera = Camera("orthographic", height=float(side))
    textures = {"waves": Grating(17 / 128 * side)}
    return Scene("full", camera, (wall,), textures, animation=Animation(30.0, frames, 0.0), facts=facts)


def sequences(frames: int, side: int) -> tuple[np.ndarray, np.ndarray]:
    """Noise about noise, which no metric is done with early."""
    rng = np.random.default_rng(0)
    reference = rng.random((frames, side, side, 3), dtype=np.float32)
    test = reference + np.float32(0.1) * rng.standard_normal(reference.shape, dtype=np.float32)
    return test, reference.astype(np.float64)


def measured(frames: int, side: int, *, traced: bool) -> tuple[float, float]:
    """Seconds, and with `traced` the peak of gigabytes above the inputs (which takes time of its own)."""
    test, reference = sequences(frames, side)
    names = [name for name in METRICS if name not in PERCEPTUAL]
    centers = Centers(test, reference, full_shutter=reference[:1])
    if traced:
        tracemalloc.start()
    start = time.perf_counter()
    scores = measure_all(names, test, reference, scene=full_scene(frames, side), centers=centers)
    seconds = time.perf_counter() - start
    peak = tracemalloc.get_traced_memory()[1] if traced else 0
    tracemalloc.stop()
    without = {n: s.status for n, s in scores.items() if s.value is None}
    assert set(without) <= {"noise", "structure", "bias", "mtf50", "edge_width"}, without
    return seconds, peak / 2**30


def test_sixty_frames_are_measured_in_two_seconds_and_a_gigabyte(benchmark: Any) -> None:
    """`make bench` measures at full size; otherwise the same is done once, small, and no time is judged."""
    if not benchmark.enabled:
        benchmark(lambda: measured(6, 128, traced=False))
        return
    runs = [measured(FRAMES, SIDE, traced=False)[0] for _ in range(4)]
    runs.append(benchmark.pedantic(lambda: measured(FRAMES, SIDE, traced=False), rounds=1)[0])
    peak = measured(FRAMES, SIDE, traced=True)[1]
    print(f"\n{len(METRICS) - len(PERCEPTUAL)} metrics of {FRAMES} x {SIDE} x {SIDE}:", *runs, "s;", peak, "GiB")
    assert min(runs) < SECONDS
    assert peak < GIGABYTES
