"""The ray tracer against Mitsuba 3 and against itself: what the project promises of its speed, as ratios.

`make bench` measures and holds the promises; otherwise every case runs once, small, and only the pictures are checked.
Ratios are of the same minute: in every round each contestant renders in turn, and the median is over the rounds'
ratios. Each renders twice and the second time counts, for Mitsuba's threads go on spinning for a while after its
pictures, which would be charged to whoever comes next.
"""

import importlib.util
import math
import os
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.raytrace.tracer import THREADS_VARIABLE
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import Camera, Checker, Grating, Scene
from aliasbench.scenes.shapes import polygon
from aliasbench.scenes.staging import flat_camera, polar

Picture = NDArray[np.floating]
Call = Callable[[int], Picture]  # from a seed
Look = Callable[[str, Picture], None]

WEDGES, STAR_RADIUS, STAR_ANGLE = 18, 0.95, 0.05  # the angle turns it out of every mirror symmetry of the picture
TARGET_RMSE = 0.004

# Ours, Mitsuba's: `ldsampler` is a (0, 2)-sequence as our `sobol` is, with the same noise on the star.
RIVALS = {"random": "independent", "sobol": "ldsampler"}
# What our samples per second are at least, in Mitsuba's, on 2, 512 and 180000 triangles.
REQUIRED: Mapping[tuple[str, str], Sequence[float]] = {
    ("random", "off"): (1.3, 1.3, 1.1),
    ("sobol", "off"): (1.0, 1.0, 1.0),
}

# Curves of error against time: a technique for every value of what it has in braces.
_COUNTS = (1, 4, 16, 64, 256)
_TOLERANCES = (0.06, 0.04, 0.03, 0.024, 0.02, 0.016, 0.012)
OURS: Mapping[str, tuple[str, Sequence[float]]] = {
    "jittered": ("raytrace:spp={},sampler=jittered,robust=off", _COUNTS),
    "multijittered": ("raytrace:spp={},sampler=multijittered,robust=off", _COUNTS),
    "sobol": ("raytrace:spp={},sampler=sobol,robust=off", _COUNTS),
    "unbiased": (
        "raytrace:adaptive=unbiased,sampler=sobol,min_spp=4,max_spp=256,tolerance={},robust=off",
        _TOLERANCES,
    ),
    "pooled": ("raytrace:adaptive=pooled,sampler=sobol,min_spp=8,max_spp=256,tolerance={},robust=off", _TOLERANCES),
}


def module_beside(name: str) -> ModuleType:
    """Return a module of this folder, which is no package."""
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


speed = module_beside("test_raytrace_speed")


@pytest.fixture(scope="module")
def peers() -> ModuleType:
    """The module that translates scenes for Mitsuba."""
    pytest.importorskip("mitsuba", reason="Mitsuba, the optional peer, is not installed: pip install -e '.[peers]'")
    return module_beside("peers")


def star_scene() -> Scene:
    """Return white wedges around the middle of a black picture, as wide as the gaps between them."""
    step = math.pi / WEDGES
    angles = [STAR_ANGLE + 2 * step * k for k in range(WEDGES)]
    wedges = [polygon([(0.0, 0.0, 0.0), polar(STAR_RADIUS, a), polar(STAR_RADIUS, a + step)]) for a in angles]
    return Scene("star", flat_camera(), tuple(wedges))


def measure(calls: Mapping[str, Call], rounds: int, look: Look | None = None) -> dict[str, NDArray[np.float64]]:
    """Return the seconds of every round, (rounds,) by name; `look` sees every picture that was timed."""
    seconds: dict[str, list[float]] = {name: [] for name in calls}
    for seed in range(rounds):
        for name, call in calls.items():
            call(seed)
            started = time.perf_counter()
            picture = call(seed)
            seconds[name].append(time.perf_counter() - started)
            if look is not None:
                look(name, picture)
    return {name: np.array(values) for name, values in seconds.items()}


def sampling_error(truth: Picture, count: float) -> float:
    """Return the mean square error of `count` independent samples, each 0 or 1; strata only lower it."""
    return float((truth * (1 - truth)).mean()) / count


def check_picture(picture: Picture, truth: Picture, error: float) -> None:
    """Hold a picture's mean square error against the expected one, of which its mirror images are far.

    The error is a mean over hundreds of pixels at edges, so it stays within half of what is expected.
    """
    assert picture.shape == truth.shape
    assert ((picture - truth) ** 2).mean() < 1.5 * error
    for mirrored in (truth[::-1], truth[:, ::-1]):
        assert ((mirrored - truth) ** 2).mean() > 2 * error


def time_to_error(seconds: Sequence[float], errors: Sequence[float], target: float) -> float:
    """Return the time in which a curve reaches an error, between its points along straight lines of the logarithms.

    Infinite if it does not, and its least time if no point has as large an error.
    """
    order = np.argsort(errors)
    times, known = np.asarray(seconds)[order], np.asarray(errors)[order]
    if known[0] > target:
        return math.inf
    if known[-1] < target:
        return float(times.min())
    return float(np.exp(np.interp(np.log(target), np.log(known), np.log(times))))


def ours(stack: ExitStack, scene: Scene, technique: str, side: int) -> Call:
    """Return the rendering of a scene that is closed with `stack`."""
    prepared = stack.enter_context(prepare(scene, technique, size=(side, side)))
    return lambda seed: prepared.render(seed=seed).pixels


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_mitsuba_is_given_the_same_scene(peers: ModuleType, projection: Literal["perspective", "orthographic"]) -> None:
    is_wide = projection == "orthographic"
    camera = Camera(
        projection,
        position=(0.5, 0.3, 2.0),
        target=(0.1, 0.2, 0.0),
        up=(0.2, 1.0, 0.0),
        height=2.0 if is_wide else None,
        fov_y_deg=None if is_wide else 50.0,
    )
    tiles = polygon(
        [(-1, -1, 0), (0.6, -1, 0), (0.6, 0.5, 0), (-1, 0.5, 0)],
        uv=[(0, 0), (1, 0), (1, 1), (0, 1)],
        texture="tiles",
        color=(0.9, 0.5, 0.2),
    )
    corner = polygon([(0.2, 0.1, 0.4), (0.9, 0.3, 0.4), (0.5, 0.8, 0.4)], color=(0.1, 0.6, 0.8))
    texture = Checker((3.0, 2.0), black=(0.1, 0.2, 0.3), white=(1.0, 0.9, 0.8))
    scene = Scene("two looks", camera, (tiles, corner), {"tiles": texture})
    size, spp = (48, 32), 1024
    theirs = peers.MitsubaScene(scene, size=size, sampler="multijitter", spp=spp, robust=True).render()
    truth = render(scene, f"raytrace:spp={spp},sampler=grid", size=size).pixels
    # A pixel at edges straight to a row of the grid is off by a column of it, 1 / 32; colours differ by less than 1.
    assert np.abs(theirs - truth).max() < 2 / 32
    for turned in (truth[::-1], truth[:, ::-1], truth[::-1, ::-1]):
        assert np.abs(turned - truth).mean() > 0.1


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"background": (0.1, 0.1, 0.1)}, "a background"),
        ({"objects": ()}, "no objects"),
        ({"textures": {"checker": Grating(4.0)}}, "texture Grating"),
    ],
)
def test_mitsuba_is_given_nothing_by_halves(peers: ModuleType, change: dict[str, Any], fault: str) -> None:
    scene = replace(speed.relief_scene(1), **change)
    with pytest.raises(ValueError, match=f"scene 'relief' has {fault}, which is not translated for Mitsuba"):
        peers.MitsubaScene(scene, size=(8, 8), sampler="independent", spp=1, robust=True)


@pytest.mark.parametrize("robust", ["off", "on"])
@pytest.mark.parametrize("sampler", RIVALS)
def test_samples_per_second_against_mitsuba(benchmark: Any, peers: ModuleType, sampler: str, robust: str) -> None:
    side, rounds, spp = (512, 11, 16) if benchmark.enabled else (64, 1, 16)
    meshes = speed.CELLS if benchmark.enabled else speed.CELLS[:2]
    calls: dict[str, Call] = {}
    truths: dict[str, Picture] = {}
    technique = f"raytrace:spp={spp},sampler={sampler},robust={robust}"
    with ExitStack() as stack:
        for cells in meshes:
            scene = speed.relief_scene(cells)
            rival = peers.MitsubaScene(
                scene, size=(side, side), sampler=RIVALS[sampler], spp=spp, robust=robust == "on"
            )
            calls[f"Mitsuba {cells}"] = rival.render
            calls[f"ours {cells}"] = ours(stack, scene, technique, side)
            truth = render(scene, "raytrace:spp=1024,sampler=grid", size=(side, side)).pixels.astype(np.float64)
            truths[f"Mitsuba {cells}"] = truths[f"ours {cells}"] = truth
        seconds = benchmark.pedantic(
            measure,
            (
                calls,
                rounds,
                lambda name, picture: check_picture(picture, truths[name], sampling_error(truths[name], spp)),
            ),
        )
    print(f"\nMsamples/s, {sampler} against Mitsuba's {RIVALS[sampler]}, robust={robust}")
    print(f"{'triangles':>9} {'ours':>9} {'Mitsuba':>9} {'ratio':>7}")
    missed = []
    for cells, least in zip(meshes, REQUIRED.get((sampler, robust), (0.0,) * len(speed.CELLS)), strict=False):
        own, other = seconds[f"ours {cells}"], seconds[f"Mitsuba {cells}"]
        rates = [side * side * spp / 1e6 / float(np.median(s)) for s in (own, other)]
        ratio = float(np.median(other / own))
        print(f"{2 * cells**2:>9} {rates[0]:>9.1f} {rates[1]:>9.1f} {ratio:>7.2f}")
        missed += [(cells, ratio, least)] if ratio < least else []
    if benchmark.enabled:
        assert not missed


def test_time_to_an_error_against_mitsuba(benchmark: Any, peers: ModuleType) -> None:
    side, rounds = (256, 5) if benchmark.enabled else (64, 1)
    scene = star_scene()
    truth = render(scene, "reference:", size=(side, side)).pixels
    calls: dict[str, Call] = {}
    curves: dict[str, list[str]] = {}
    counts: dict[str, float] = {}
    errors: dict[str, list[float]] = {}

    def look(name: str, picture: Picture) -> None:
        check_picture(picture, truth, sampling_error(truth, counts[name]))
        errors.setdefault(name, []).append(float(((picture - truth) ** 2).mean()))

    with ExitStack() as stack:
        for sampler, offered in peers.SAMPLERS.items():
            for spp in offered if benchmark.enabled else offered[1:2]:
                name = f"Mitsuba {sampler} {spp}"
                rival = peers.MitsubaScene(scene, size=(side, side), sampler=sampler, spp=spp, robust=False)
                calls[name], counts[name] = rival.render, spp
                curves.setdefault(f"Mitsuba {sampler}", []).append(name)
        for curve, (text, values) in OURS.items():
            for value in values if benchmark.enabled else values[1:2]:
                name = f"ours {curve} {value}"
                # An adaptive picture has at least one sample in every pixel, and may have no more.
                calls[name], counts[name] = ours(stack, scene, text.format(value), side), value if value >= 1 else 1
                curves.setdefault(f"ours {curve}", []).append(name)
        seconds = benchmark.pedantic(measure, (calls, rounds, look))
    print(f"\nStar of {WEDGES} wedges, {side} x {side}: ms to RMSE {TARGET_RMSE}, then ms and RMSE along the curve")
    found: dict[str, float] = {}
    for curve, names in curves.items():
        times = [float(np.median(seconds[name])) for name in names]
        rmse = [math.sqrt(statistics.fmean(errors[name])) for name in names]
        found[curve] = time_to_error(times, rmse, TARGET_RMSE)
        points = "".join(f"{1e3 * t:>9.1f} {e:.4f}" for t, e in zip(times, rmse, strict=True))
        print(f"{curve:<20} {1e3 * found[curve]:>8.1f}   {points}")
    best, rival_best = (min(t for curve, t in found.items() if curve.startswith(who)) for who in ("ours", "Mitsuba"))
    if benchmark.enabled:
        print(f"Mitsuba's best takes {rival_best / best:.2f} times as long as ours")
        assert math.isfinite(rival_best)
        assert best <= rival_best / 4


def test_two_threads_are_nearly_twice_as_fast_as_one(benchmark: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    side, rounds = (512, 15) if benchmark.enabled else (48, 1)
    meshes = speed.CELLS if benchmark.enabled else speed.CELLS[:2]
    calls: dict[str, Call] = {}
    with ExitStack() as stack:
        for cells in meshes:
            for threads in (1, 2):
                monkeypatch.setenv(THREADS_VARIABLE, str(threads))
                calls[f"{threads} {cells}"] = ours(stack, speed.relief_scene(cells), "raytrace:spp=16", side)
            assert np.array_equal(calls[f"1 {cells}"](0), calls[f"2 {cells}"](0))
        seconds = benchmark.pedantic(measure, (calls, rounds))
    ratios = {cells: float(np.median(seconds[f"1 {cells}"] / seconds[f"2 {cells}"])) for cells in meshes}
    print("\nTwo threads against one: " + ", ".join(f"{2 * c**2} triangles {r:.2f}" for c, r in ratios.items()))
    if benchmark.enabled:
        assert (os.cpu_count() or 1) >= 2, "this machine has one core, and the promise is of two"
        assert min(ratios.values()) >= 1.8


def test_motion_costs_at_most_three_times_a_still_scene(benchmark: Any) -> None:
    side, rounds, spp = (512, 15, 16) if benchmark.enabled else (64, 1, 16)
    calls: dict[str, Call] = {}
    with ExitStack() as stack:
        for name, shutter in (("moving", 0.5), ("still", 0)):
            scene = load_scene(f"propeller:rev_per_s=29,shutter={shutter}")
            calls[name] = ours(stack, scene, f"raytrace:spp={spp},sampler=jittered", side)
        moving, still = calls["moving"](0), calls["still"](0)
        # The blades keep their area as they turn, up to the noise of their edges, and are not where they were.
        assert moving.mean() == pytest.approx(still.mean(), rel=0.01)
        assert np.abs(moving - still).mean() > 0.01
        seconds = benchmark.pedantic(measure, (calls, rounds))
    ratio = float(np.median(seconds["moving"] / seconds["still"]))
    rates = {name: side * side * spp / 1e6 / float(np.median(values)) for name, values in seconds.items()}
    print(f"\nMsamples/s: still {rates['still']:.1f}, moving {rates['moving']:.1f}; motion costs {ratio:.2f} times")
    if benchmark.enabled:
        assert ratio <= 3.0
