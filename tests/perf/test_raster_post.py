"""What antialiasing after the picture costs and gives, beside hardware samples and passes.

`make bench` measures at full size; otherwise every technique runs once, small, and only the order of errors is checked.
"""

from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import numpy as np
import pytest

from aliasbench.metrics.catalog import measure
from aliasbench.renderers.catalog import CheckedScene, prepare
from aliasbench.scenes.files import load_scene

TECHNIQUES = (
    "raster:",
    "raster:msaa=4",
    "raster:post=fxaa",
    "raster:post=smaa",
    "raster:post=taa",
    "raster:passes=16,sampler=jittered,time=center",
)
STILL = "edge-fan"
MOVING = ("edge-fan:rev_per_s=0.1", "near-horizontal-edge:speed=0.1")
# of a moving scene: temporal antialiasing has then run in
FRAMES = range(16, 33)


@pytest.fixture
def side(benchmark: Any) -> Iterator[int]:
    """Width and height of the pictures whose error is measured."""
    return 256 if benchmark.enabled else 64


def _costs(text: str, side: int, rounds: int) -> list[float]:
    """Median ms a frame of every technique, rounds interleaved."""
    scene = load_scene(text)
    seconds = np.empty((rounds, len(TECHNIQUES)))
    with ExitStack() as opened:
        prepared: list[CheckedScene] = [opened.enter_context(prepare(scene, t, size=(side, side))) for t in TECHNIQUES]
        for each in prepared:
            each.render(frame=2)
        for k in range(rounds):
            for number, each in enumerate(prepared):
                seconds[k, number] = each.render(frame=3 + k).seconds
    return list(1e3 * np.median(seconds, axis=0))


def _edge_rms(side: int) -> list[float]:
    scene, size = load_scene(STILL), (side, side)
    with prepare(scene, "reference:", size=size) as prepared:
        truth = prepared.render().pixels
    colors = [scene.background, *(s.color for s in scene.objects)]
    partly = np.all([np.abs(truth - c).max(axis=2) > 1e-9 for c in colors], axis=0)
    assert partly.sum() > side
    out = []
    for technique in TECHNIQUES:
        with prepare(scene, technique, size=size) as prepared:
            error = (prepared.render(frame=32).pixels - truth)[partly]
        out.append(float(np.sqrt(np.mean(error**2))))
    return out


def _shimmer(text: str, side: int) -> list[float]:
    scene, size = load_scene(text), (side, side)
    out = []
    with prepare(scene, "reference:", size=size) as prepared:
        truth = np.stack([prepared.render(frame=f).pixels for f in FRAMES])
    for technique in TECHNIQUES:
        with prepare(scene, technique, size=size) as prepared:
            shown = np.stack([prepared.render(frame=f).pixels for f in FRAMES])
        score = measure("shimmer", shown, truth, scene=scene, frame_start=FRAMES[0])
        assert score.value is not None, score
        out.append(score.value)
    return out


def test_cost_edges_and_shimmer(benchmark: Any, side: int) -> None:
    rounds = 15 if benchmark.enabled else 1
    costs, still_costs = (_costs(text, 2 * side, rounds) for text in (MOVING[0], STILL))
    edges = _edge_rms(side)
    shimmers = [_shimmer(text, side) for text in MOVING]
    rows = list(zip(TECHNIQUES, costs, still_costs, edges, *shimmers, strict=True))
    print(f"\n{'':46} {'ms':>7} {'x':>6} {'still':>7} {'edges':>7} {'turns':>7} {'crawls':>7}")
    for technique, cost, still, edge, turning, crawling in rows:
        print(
            f"{technique:46} {cost:7.2f} {cost / costs[0]:6.2f} {still:7.2f} {edge:7.4f} {turning:7.4f} {crawling:7.4f}"
        )
    benchmark.extra_info["rows"] = rows
    with prepare(load_scene(STILL), "raster:post=fxaa", size=(side, side)) as prepared:
        benchmark.pedantic(prepared.render, rounds=3)
    # whatever antialiases beats what does not, on edges that stand still, turn and crawl
    for errors in (edges, *shimmers):
        assert max(errors[1:]) < 0.95 * errors[0]
    assert edges[4] < 0.25 * edges[0]
