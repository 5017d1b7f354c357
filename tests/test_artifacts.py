"""The lecture's artifacts, rendered by both renderers: high under point sampling, low under the remedy it names.

The factors are about two thirds of the least that was seen in pictures of 96 x 96 to 192 x 128 pixels under three
seeds: what they notice is a metric or a renderer that no longer sees or no longer cures an artifact; they rank no
techniques. Where a closed form says what must come out, that is asserted instead. With -s a table is printed.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from aliasbench.metrics.catalog import measure_all
from aliasbench.metrics.score import Score
from aliasbench.renderers.catalog import prepare
from aliasbench.scenes.catalog import build_scene

FloatArray = NDArray[np.float64]
SIZE = (128, 128)
RENDERERS = ("raytrace", "raster")
POINT = {"raytrace": "raytrace:", "raster": "raster:"}
# What a sample is to the ray tracer, a pass is to the rasterizer.
REMEDIES = {
    "trilinear": {"raytrace": "raytrace:texture=trilinear", "raster": "raster:texture=trilinear"},
    "mipmap": {"raytrace": "raytrace:texture=mipmap", "raster": "raster:texture=mipmap"},
    "4 samples": {"raytrace": "raytrace:spp=4", "raster": "raster:msaa=4"},
    "16 samples": {"raytrace": "raytrace:spp=16", "raster": "raster:passes=16"},
    "64 samples": {"raytrace": "raytrace:spp=64", "raster": "raster:passes=64"},
}


@dataclass(frozen=True)
class Artifact:
    """A scene with its headline metric: a score or a figure of its extras.

    Attributes
    ----------
    least : float
        What point sampling scores at least.
    remedies : mapping
        By which factor at least each remedy lowers it.
    """

    lecture: str
    scene: str
    metric: str
    frames: int
    least: float
    remedies: tuple[tuple[str, float], ...]


ARTIFACTS = (
    Artifact("A1", "brick-floor", "shimmer", 4, 0.04, (("trilinear", 1.2), ("mipmap", 1.2), ("16 samples", 3.0))),
    Artifact("A1", "checker-floor", "shimmer", 6, 0.09, (("trilinear", 1.4), ("mipmap", 1.4), ("16 samples", 2.0))),
    Artifact("A1", "distant-triangle", "shimmer", 6, 0.03, (("trilinear", 5.0), ("mipmap", 5.0), ("16 samples", 2.5))),
    Artifact("A2", "confetti", "shimmer", 6, 0.05, (("16 samples", 3.0),)),
    Artifact("A2", "confetti", "flux_flicker", 6, 0.04, (("16 samples", 1.6),)),
    Artifact("A3", "slivers", "gaps", 3, 200.0, (("4 samples", 1.5), ("16 samples", 20.0), ("64 samples", 100.0))),
    Artifact("A3", "slivers", "gaps.coverage_error", 3, 0.02, (("16 samples", 1.8), ("64 samples", 3.0))),
    Artifact("A4", "near-horizontal-edge", "jaggies", 1, 0.25, (("4 samples", 1.5), ("16 samples", 2.6))),
    Artifact("A4", "edge-fan", "jaggies", 1, 0.25, (("4 samples", 1.5), ("16 samples", 3.4))),
    # 33 lines to 16 pixels: the false grid of 16 pixels is well inside the visible band.
    Artifact("A5", "grid:lines=264", "moire", 2, 0.25, (("16 samples", 2.4), ("64 samples", 5.5))),
    Artifact("A5", "zone-plate", "moire", 1, 0.1, (("16 samples", 2.6), ("64 samples", 5.5))),
    Artifact("A6", "window-screens:wires=132", "moire", 2, 0.25, (("16 samples", 2.1), ("64 samples", 6.6))),
)


@cache
def sequence(scene: str, technique: str, frames: int, seed: int = 0) -> FloatArray:
    """Frames 0 to `frames` - 1 in float64, (frames, h, w, 3)."""
    with prepare(build_scene(scene), technique, size=SIZE) as prepared:
        pictures = [prepared.render(frame=n, seed=seed).pixels for n in range(frames)]
    out = np.array(pictures, dtype=np.float64)
    out.flags.writeable = False
    return out


def scores(names: tuple[str, ...], scene: str, technique: str, frames: int, seed: int = 0) -> dict[str, Score]:
    test, truth = sequence(scene, technique, frames, seed), sequence(scene, "reference:", frames)
    return measure_all(names, test, truth, scene=build_scene(scene))


def figure(name: str, scene: str, technique: str, frames: int) -> float:
    """A metric's value, or after a dot a figure of its extras."""
    metric, _, extra = name.partition(".")
    score = scores((metric,), scene, technique, frames)[metric]
    value = score.extras[extra] if extra else score.value
    assert isinstance(value, float), (scene, technique, score)
    return value


@pytest.fixture(scope="module")
def table() -> Iterator[list[str]]:
    """Lines of the table that is printed when all is measured."""
    lines: list[str] = []
    yield lines
    print("\n\nartifact  renderer  scene                       metric                  point  remedies")
    print("\n".join(lines))


def note(table: list[str], lecture: str, renderer: str, scene: str, metric: str, point: str, remedies: str) -> None:
    table.append(f"{lecture:9s} {renderer:9s} {scene:27s} {metric:20s} {point:>8s}  {remedies}")


@pytest.mark.parametrize("renderer", RENDERERS)
@pytest.mark.parametrize("artifact", ARTIFACTS, ids=lambda a: f"{a.lecture}-{a.scene}-{a.metric}")
def test_an_artifact_is_there_under_point_sampling_and_lowered_by_its_remedies(
    table: list[str], artifact: Artifact, renderer: str
) -> None:
    point = figure(artifact.metric, artifact.scene, POINT[renderer], artifact.frames)
    remedied = {
        remedy: figure(artifact.metric, artifact.scene, REMEDIES[remedy][renderer], artifact.frames)
        for remedy, _ in artifact.remedies
    }
    shown = ", ".join(f"{remedy} {value:.4g}" for remedy, value in remedied.items())
    note(table, artifact.lecture, renderer, artifact.scene, artifact.metric, f"{point:.4g}", shown)
    assert point >= artifact.least
    for remedy, factor in artifact.remedies:
        assert remedied[remedy] <= point / factor, remedy


@pytest.mark.parametrize("artifact", ARTIFACTS, ids=lambda a: f"{a.lecture}-{a.scene}-{a.metric}")
def test_the_truth_has_none_of_it(artifact: Artifact) -> None:
    # Total light is not quite constant in truth: what drifts in is not what drifts out.
    truth = figure(artifact.metric, artifact.scene, "reference:", artifact.frames)
    assert truth <= (artifact.least / 20 if artifact.metric == "flux_flicker" else 0.0)


@pytest.mark.parametrize("renderer", RENDERERS)
def test_stairs_of_a_known_edge_are_as_large_as_derived(renderer: str) -> None:
    got = scores(("jaggies", "jaggies_bias", "jaggies_str"), "near-horizontal-edge", POINT[renderer], 1)
    # Slope 1/10, ten phases: sqrt((1 - 1/100) / 12). 126 columns are twelve periods and six columns, of at most 1/12 of
    # the variance; the rasterizer's corners lie on 1/256 pixel.
    assert got["jaggies"].value == pytest.approx(math.sqrt((1 - 1 / 100) / 12), rel=1 / 24)
    assert got["jaggies_str"].value == pytest.approx(got["jaggies"].value, rel=1e-2)
    assert abs(got["jaggies_bias"].value or 0.0) <= 1 / 20 + 1 / 24 + 1 / 256


@pytest.mark.parametrize("renderer", RENDERERS)
def test_a_regular_grid_of_samples_leaves_ghosts_that_every_seed_has_and_jittered_ones_do_not(
    table: list[str], renderer: str
) -> None:
    regular = {"raytrace": "raytrace:spp=16,sampler=grid", "raster": "raster:ssaa=4"}[renderer]
    square = {}
    for technique in (regular, REMEDIES["16 samples"][renderer]):
        test = np.stack([sequence("zone-plate", technique, 1, seed) for seed in range(6)])
        score = measure_all(("moire",), test, sequence("zone-plate", "reference:", 1), scene=build_scene("zone-plate"))[
            "moire"
        ]
        square[technique] = (float(str(score.extras["structured_square"])), float(score.value or 0.0) ** 2)
    (ghosts, all_of_it), (shared, noise) = square.values()
    shown = (
        f"jittered shares {shared / noise:+.3f} of its square between seeds, a regular grid {ghosts / all_of_it:.3f}"
    )
    note(table, "A5", renderer, "zone-plate", "moire, 16 samples", "", shown)
    assert ghosts == pytest.approx(all_of_it, rel=1e-9)
    # Fifteen pairs of seeds. Of the ray tracer pixels are independent and so hundreds of bins; a pass is one value for
    # the whole picture, and the pairs' products are the only average: five times 1 / sqrt 15 is no bound, a half is.
    assert abs(shared) < (0.1 if renderer == "raytrace" else 0.5) * noise


def line_amplitude(picture: FloatArray, cycles_per_px: tuple[float, float]) -> float:
    """The amplitude of a sinusoid in a picture (h, w), under a Hann window."""
    height, width = picture.shape
    y, x = (np.arange(n) + 0.5 for n in picture.shape)
    window = np.sin(np.pi * y / height)[:, None] ** 2 * np.sin(np.pi * x / width) ** 2
    window /= window.sum()
    centered = (picture - np.sum(window * picture)) * window
    fx, fy = cycles_per_px
    return float(2 * abs(np.exp(-2j * np.pi * fy * y) @ centered @ np.exp(-2j * np.pi * fx * x)))


@pytest.mark.parametrize("renderer", ["reference", *RENDERERS])
def test_the_true_beat_of_two_screens_survives_and_the_false_stripes_fall(table: list[str], renderer: str) -> None:
    scene = "window-screens:wires=132"
    front, back, beat = (
        (g.cycles_per_unit[0] * 2.0 / SIZE[1], -g.cycles_per_unit[1] * 2.0 / SIZE[1])
        for g in build_scene(scene).facts.gratings
    )
    # Where samples a pixel apart put them.
    false = [((fx + 0.5) % 1 - 0.5, (fy + 0.5) % 1 - 0.5) for fx, fy in (front, back)]
    # Screens let half of the light through: cosines of amplitude 2 / pi about 1/2. Their product has the beat, of
    # 1/2 (2 / pi)^2, and each screen's line, of 1/2 of 2 / pi; a pixel's square attenuates all by sinc fx sinc fy.
    sharp = [1 / math.pi, 1 / math.pi, 2 / math.pi**2]
    blurred = [a * abs(float(np.sinc(f[0]) * np.sinc(f[1]))) for a, f in zip(sharp, (front, back, beat), strict=True)]

    def measured(technique: str) -> list[float]:
        picture = sequence(scene, technique, 1)[0, ..., 1]
        return [line_amplitude(picture, f) for f in (*false, beat)]

    # Lines are 2.4 bins apart both ways or more: the window passes .03 of an amplitude of .3, squared. The rasterizer's
    # corners, half of 1/256 pixel off, change an amplitude by no more than twice that share.
    leak = 0.03**2 * 0.3 * 3 + 1 / 256
    if renderer == "reference":
        assert measured("reference:") == pytest.approx(blurred, abs=leak)
        return
    point = measured(POINT[renderer])
    shown = []
    for samples in (16, 64):
        technique = REMEDIES[f"{samples} samples"][renderer]
        got = measured(technique)
        shown.append(f"{samples} samples {max(got[:2]):.4f} beside a beat of {got[2]:.4f}")
        rmse = scores(("rmse",), scene, technique, 1)["rmse"].value
        assert rmse is not None
        # Noise of that size in a sum under the window, whose mean square is 2.25: five standard deviations.
        noise = 5 * rmse * math.sqrt(2 * 2.25 / (SIZE[0] * SIZE[1]))
        assert got[2] == pytest.approx(blurred[2], abs=leak + noise)
        if renderer == "raytrace":
            assert got[:2] == pytest.approx(blurred[:2], abs=leak + noise)
        else:
            # All pixels have one pattern, and what sqrt(N) columns of jittered strata leave of a line of frequency 1 is
            # random with mean square (1 - sinc^2(1 / sqrt N)) / N: four times its root.
            left = math.sqrt((1 - float(np.sinc(1 / math.sqrt(samples))) ** 2) / samples)
            assert max(got[:2]) <= max(blurred[:2]) + 4 * left * sharp[0] + leak
            assert max(got[:2]) <= sharp[0] / 2
    note(table, "A6", renderer, scene, "false lines", f"{max(point[:2]):.4f}", ", ".join(shown))
    assert point == pytest.approx(sharp, abs=leak)


# STROBE_abs of three blades and duty 1/2, for an instant and for a shutter that is open all the time.
PROPELLERS = (
    (1, 1.0, math.sqrt(1 - (80 / 9) / math.pi**2), 0.1267),
    (29, -1.0, 1.0, 0.0321),
    (30, 0.0, 1.0, 0.0),
)


@pytest.mark.parametrize("renderer", RENDERERS)
@pytest.mark.parametrize(("rate", "apparent", "sharp", "blurred"), PROPELLERS)
def test_a_propeller_strobes_as_derived_and_motion_blur_takes_it_away(
    table: list[str], renderer: str, rate: int, apparent: float, sharp: float, blurred: float
) -> None:
    frames = 6
    still, open_shutter = f"propeller-{rate}", f"propeller-{rate}:shutter=1"
    names = ("strobing", "strobing_err", "apparent_rate")
    point = scores(names, still, POINT[renderer], frames)
    assert point["strobing"].value == pytest.approx(sharp, rel=0.01)
    # Pixel centres see an edge on a lattice: at 60 pixels from the hub, half a pixel is half a degree, of 12 a frame.
    assert point["apparent_rate"].value == pytest.approx(apparent, abs=0.5 / 12)
    shown = [f"instant: {point['apparent_rate'].value:+.3f} rev/s"]
    for samples in (16, 64):
        got = scores(names, open_shutter, REMEDIES[f"{samples} samples"][renderer], frames)
        value, error = got["strobing"].value, got["strobing_err"].value
        assert value is not None
        assert error is not None
        shown.append(f"{samples} samples {value:.4f}")
        if renderer == "raytrace":
            # White noise e: of its square over M orders, a third of them the blades', all but the spread in so many
            # frames is taken off, and what is beyond order M is as uncertain again; its product with what is there has
            # twice the root of e^2 / M and the share, half in phase. Five standard deviations; 1 % is lattice.
            highest = float(str(got["strobing_err"].extras["highest_order"][0]))
            spread = 2 * error**2 / math.sqrt(3 * highest * frames)
            crossed = 2 * blurred * error / math.sqrt(2 * highest * frames)
            assert value**2 == pytest.approx(blurred**2, abs=0.02 * blurred**2 + 5 * math.hypot(spread, crossed))
        else:
            # What the times leave adds as vectors, in the mean over frames and orders; twice its expected length.
            assert value == pytest.approx(blurred, rel=0.01, abs=2 * math.sqrt(left_by_jittered_times(rate, samples)))
        assert value <= sharp / (2.0 if rate == 1 else 5.0)
    note(table, "A7", renderer, still, "strobing", f"{point['strobing'].value:.4f}", ", ".join(shown))
    # One sample under an open shutter is an instant all the same.
    frozen = scores(names, open_shutter, POINT[renderer], frames)
    assert frozen["strobing"].value == pytest.approx(sharp, rel=0.02)
    converged = scores(names, open_shutter, "raytrace:spp=64", frames)
    assert (frozen["strobing_err"].value or 0.0) >= 5 * (converged["strobing_err"].value or 0.0) > 0.0


def left_by_jittered_times(rate: float, passes: int) -> float:
    """The aliased share of three blades that n jittered times leave of a shutter that is open all the time.

    One time in each of n strata: the order that turns u times while the shutter is open is left with a mean square of
    (1 - sinc^2(u / n)) / n; of duty 1/2, odd k have 8 / (pi k)^2 of the pattern's power.
    """
    k = np.arange(1.0, 2000.0, 2.0)
    turns = 3 * k * rate / 30
    power = 8 / (np.pi * k) ** 2 * (1 - np.sinc(turns / passes) ** 2) / passes
    return float(np.sum(power[2 * turns >= 1.0]))


def test_rates_between_are_where_they_wrap_to() -> None:
    for blades, rate in ((2, 14.0), (3, 6.5), (5, 23.5), (4, -4.0)):
        wrapped = (blades * rate + 15.0) % 30.0 - 15.0
        scene = f"propeller:blades={blades},rev_per_s={rate}"
        for renderer in RENDERERS:
            score = scores(("apparent_rate",), scene, POINT[renderer], 4)["apparent_rate"]
            assert score.value == pytest.approx(wrapped / blades, abs=0.05), (scene, renderer)
