"""Pictures without anything in them through every metric: black, white, one grey, one pixel, no contrast, no number.

A metric is a number or the reason why there is none; here its reasons are all there is, and they are written down.
"""

import json
import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from aliasbench.bench.hard.case import METRICS, HardCase, Verdict
from aliasbench.metrics import catalog
from aliasbench.metrics.score import Score
from aliasbench.scenes.model import Animation, Camera, EdgeFact, Facts, PanFact, RotorFact, Scene

FRAMES, SIDE = 4, 64
Expected = Mapping[str, float | str]
# What stands for a number that needs no more than to be one.
ANY = math.nan
FACTS = {"edges", "rotors", "pans", "gratings", "patterns", "centers"}  # needs that a bare scene does not meet
_NO_MODULATION = "undefined_no_modulation"
# A perfect picture's score, of one seed, whatever its grey above 0.
PERFECT: Expected = {
    **dict.fromkeys(catalog.METRICS, 0.0),
    **dict.fromkeys(("noise", "structure", "bias"), "needs_seeds"),
    "ssim": 1.0,
    "psnr": "identical",
    "buzz": "undefined_no_shimmer",
    "apparent_rate": _NO_MODULATION,
    **dict.fromkeys(("mtf50", "edge_width"), "undefined_no_edge"),
    **dict.fromkeys(("apparent_velocity", "spatial", "temporal", "shutter"), "not_applicable"),
}
# An error that is the same everywhere and at all times: it is no shimmer, no moire, no jaggedness.
SHIFTED: Expected = {
    **PERFECT,
    **dict.fromkeys(("flip", "ssim", "jaggies_rms", "jaggies_bias", "relmse"), ANY),
}
# A ring of pixels is summed under the window sin^4 over its 20 px: of a constant, its orders keep about 20^-4.
TOLERANCES = {"strobing": 1e-5, "strobing_err": 1e-5}
ROUNDING = 1e-7  # of the rest: float32 pixels, divided by a contrast


def scene(side: int = SIDE, contrast: float = 1.0) -> Scene:
    """Return a scene with every fact that metrics rely on; the pan repeats after the sequence's frames."""
    facts = Facts(
        edges=(EdgeFact((-0.64 * side, -0.2 * side, 0.0), (0.75 * side, 0.08 * side, 0.0)),),
        rotors=(RotorFact((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 3, 0.5, 7.0, 0.125 * side, 0.4375 * side),),
        pans=(PanFact((15.0, 0.0, 0.0), FRAMES / 30.0),),
    )
    camera = Camera("orthographic", height=float(side))
    return Scene("hard", camera, contrast=contrast, facts=facts, animation=Animation(30.0, FRAMES, 0.0))


def flat(value: float, seeds: int = 1) -> NDArray[np.float32]:
    """Return (seeds, frames, h, w, 3) of one grey."""
    return np.full((seeds, FRAMES, SIDE, SIDE, 3), value, np.float32)


def mistakes(scores: Mapping[str, Score], expected: Expected) -> list[str]:
    """Return what is not as it should be, one text a metric; a score that JSON cannot hold is always a mistake."""
    out = []
    for name, score in scores.items():
        want = expected[name]
        json.dumps(dict(score.extras), allow_nan=False)
        if score.value is not None and not math.isfinite(score.value):
            out.append(f"{name} is {score.value}")
        elif isinstance(want, str):
            if score.value is not None or score.status != want:
                out.append(f"{name} is {score.value} ({score.status}), not {want}")
        elif score.value is None or score.status not in ("ok", "deterministic"):
            out.append(f"{name} has no value ({score.status})")
        elif not math.isnan(want) and abs(score.value - want) > TOLERANCES.get(name, ROUNDING) * max(1.0, abs(want)):
            out.append(f"{name} is {score.value}, not {want}")
    return out


def _measured(
    test: NDArray[np.floating], reference: NDArray[np.floating], of: Scene, radius: float = 0.5
) -> dict[str, Score]:
    return catalog.measure_all(catalog.METRICS, test, reference, scene=of, filter_radius_px=radius)


def _count(found: Mapping[str, list[str]], why: str) -> Verdict:
    wrong = [f"{what}: {text}" for what, texts in found.items() for text in texts]
    return Verdict(float(len(wrong)), "scores", 0.0, 0.0, why, note="; ".join(wrong)[:600])


def flat_pairs() -> dict[str, tuple[NDArray[np.float32], NDArray[np.float32], float, Expected]]:
    """Return pictures with their references, the scene's contrast, and what every metric must say of them."""
    no_flux = {"flux_flicker": "undefined_zero_flux"}
    of_seeds = {"noise": 0.0, "structure": 0.0, "bias": 0.0}
    return {
        "black and black": (flat(0.0), flat(0.0)[0], 1.0, {**PERFECT, **no_flux}),
        "white and white": (flat(1.0), flat(1.0)[0], 1.0, PERFECT),
        "grey and grey, two seeds": (flat(0.5, 2), flat(0.5)[0], 1.0, {**PERFECT, **of_seeds}),
        "grey of a contrast of 1e6": (flat(5e5), flat(5e5)[0], 1e6, PERFECT),
        "an offset of an eighth": (
            flat(0.375),
            flat(0.25)[0],
            1.0,
            # -20 log10(1/8); 1/8^2 / (1/4^2 + 1e-2), the reference's square and a hundredth
            {**SHIFTED, "rmse": 0.125, "max_error": 0.125, "psnr": 18.061799739838872},
        ),
        "black for white": (
            flat(0.0, 2),
            flat(1.0)[0],
            1.0,
            {**SHIFTED, **no_flux, "rmse": 1.0, "max_error": 1.0, "psnr": 0.0}
            | {"noise": 0.0, "structure": 1.0, "bias": -1.0},
        ),
        "white for black": (
            flat(1.0, 2),
            flat(0.0)[0],
            1.0,
            {**SHIFTED, "rmse": 1.0, "max_error": 1.0, "psnr": 0.0, "noise": 0.0, "structure": 1.0, "bias": 1.0},
        ),
    }


def _flat(subject: str) -> Verdict:  # noqa: ARG001 - no renderer is involved
    found = {
        what: mistakes(_measured(test, reference, scene(contrast=contrast)), expected)
        for what, (test, reference, contrast, expected) in flat_pairs().items()
    }
    return _count(found, "closed forms of a constant error: its root mean square is it, its variance in time is 0")


def _no_contrast(subject: str) -> Verdict:  # noqa: ARG001 - no renderer is involved
    expected = dict.fromkeys(catalog.METRICS, "undefined_zero_contrast")
    pairs = {"equal": (flat(0.5), flat(0.5)[0]), "different": (flat(1.0, 2), flat(0.0)[0])}
    found = {
        f"{what}, contrast {contrast}": mistakes(_measured(*pair, scene(contrast=contrast)), expected)
        for contrast in (0.0, -0.0, -1.0, math.nan, math.inf)
        for what, pair in pairs.items()
    }
    return _count(found, "errors in units of no contrast are undefined: a reason, never a number")


def _no_number(subject: str) -> Verdict:  # noqa: ARG001 - no renderer is involved
    found: dict[str, list[str]] = {}
    place = {"seed": 1, "frame": 2, "row": 3, "column": 5, "channel": 1}
    for value in (math.nan, math.inf, -math.inf):
        test = flat(0.5, 2)
        test[tuple(place.values())] = test[1, 3, 0, 0, 0] = value
        scores = _measured(test, flat(0.5)[0], scene())
        found[f"{value}"] = mistakes(scores, dict.fromkeys(catalog.METRICS, "nonfinite"))
        found[f"place of {value}"] = [
            f"{name} says {dict(score.extras)}"
            for name, score in scores.items()
            if dict(score.extras) != {"count": 2, "first": place}
        ]
        try:
            _measured(flat(0.5), test[1], scene())
        except ValueError as error:
            found[f"{value} in a reference"] = (
                [] if "reference: 2 values are not finite" in str(error) else [str(error)]
            )
        else:
            found[f"{value} in a reference"] = ["accepted"]
    return _count(found, "one value that is no number makes every metric undefined, and its place is told")


def _small(subject: str) -> Verdict:  # noqa: ARG001 - no renderer is involved
    """Pictures down to a pixel: under a border of nothing, and of one pixel."""
    found: dict[str, list[str]] = {}
    bare = Scene("hard", Camera("orthographic", height=1.0), animation=Animation(30.0, FRAMES, 0.0))
    random = np.random.default_rng(1)
    for width, height in ((1, 1), (2, 3), (1, 9), (3, 3), (6, 64), (7, 7), (8, 8), (9, 9)):
        test = random.random((2, FRAMES, height, width, 3))
        reference = random.random((FRAMES, height, width, 3))
        for radius in (0.0, 0.5):
            left = min(width, height) - 2 * math.ceil(radius)
            scores = _measured(test, reference, bare, radius)
            what = f"{width} x {height}, border {math.ceil(radius)}"
            if left < 1:
                found[what] = mistakes(scores, dict.fromkeys(catalog.METRICS, "undefined_too_small"))
                continue
            expected: dict[str, float | str] = {
                name: "not_applicable" if FACTS & set(metric.needs) else ANY for name, metric in catalog.METRICS.items()
            }
            expected["bias"] = scores["bias"].status if scores["bias"].value is None else ANY
            if left < 7:
                expected["ssim"] = "undefined_too_small"
            for name in ("moire", "moire_peak"):
                if scores[name].value is None:
                    expected[name] = "undefined_too_small"
            error = np.sqrt(np.mean(np.square(_inner(test, radius) - _inner(reference, radius))))
            expected["rmse"] = float(error)
            found[what] = mistakes(scores, expected)
    return _count(found, "SSIM's window is 7 x 7; a border of ceil(radius) is cut off on each side")


def _inner(picture: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
    """Return the luminance inside of the border."""
    crop = math.ceil(radius)
    height, width = picture.shape[-3:-1]
    light: NDArray[np.float64] = picture @ np.array([0.2126, 0.7152, 0.0722])
    return light[..., crop : height - crop, crop : width - crop]


CASES = (
    HardCase(
        "flat-pictures",
        "sizes",
        "Constant pictures against constant references, made by hand: black, white, grey, an offset, the opposite.",
        "Every metric has the value or the reason that a constant error has in closed form.",
        _flat,
        (METRICS,),
    ),
    HardCase(
        "no-contrast",
        "sizes",
        "Pictures made by hand of scenes whose contrast is 0, negative, infinite or no number.",
        "Every metric is undefined_zero_contrast, for equal pictures too.",
        _no_contrast,
        (METRICS,),
    ),
    HardCase(
        "pictures-with-no-numbers",
        "sizes",
        "Two values of a sequence made by hand are NaN or infinite, in the picture or in its reference.",
        "Every metric is nonfinite with their count and the first one's place; the reference is an error.",
        _no_number,
        (METRICS,),
    ),
    HardCase(
        "pictures-too-small-to-measure",
        "sizes",
        "Sequences of 1 x 1 to 9 x 9 random pixels, made by hand, with and without a border that is cut off.",
        "No metric breaks: a value, or undefined_too_small; the RMS error is that of the pixels that are left.",
        _small,
        (METRICS,),
    ),
)
