"""Values at the ends of float32's range, and all of it in one picture: nothing may bleed, vanish or overflow.

`CASES` are those of the whole group: of sums, adaptivity, supports and weights as well.
"""

import math
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from aliasbench.bench.hard import adaptivity, sums, supports, weights
from aliasbench.bench.hard.case import REFERENCE, HardCase, Verdict, with_keys
from aliasbench.bench.hard.panels import HALF_ULP, gray, halved, is_raster, panel, picture, sampled
from aliasbench.renderers.catalog import render, resolve_technique
from aliasbench.renderers.sampling.filters import filter_of
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import FloatArray, Motion, Scene

_BRIGHT, _DARK = 1e6, 1e-6
_SAMPLES = 1024
_LARGEST_RASTER, _LARGEST = 2.0**100, 3e38


def _red(scene: Scene, technique: str, size: tuple[int, int]) -> FloatArray:
    return np.asarray(render(scene, technique, size=size).pixels[..., 0], dtype=np.float64)


def _both_in_a_pixel(subject: str) -> Verdict:
    """Relative errors of pixels half of 1e6 and half of 1e-6."""
    size = (2, 2)
    ways = [sampled(subject, _SAMPLES, more="sampler=grid")]
    if is_raster(subject):
        ways += [with_keys(subject, keys) for keys in ("msaa=4", "ssaa=32", "msaa=4,filter=box,passes=4,sampler=grid")]
    truth = 0.5 * (_BRIGHT + _DARK)
    worst, where = 0.0, ""
    for textured in (False, True):
        scene = halved(size, _DARK, _BRIGHT, textured=textured)
        for way in ways:
            if textured and "msaa" in way:
                continue  # hardware samples share one look-up
            error = float(np.abs(_red(scene, way, size) / truth - 1.0).max())
            if error >= worst:
                worst, where = error, f"{'texture' if textured else 'edges'}, {way}"
    return Verdict(
        worst,
        "of the value",
        HALF_ULP,
        HALF_ULP * (65 if is_raster(subject) else 1),
        "float32 rounds the mean by 2^-24 of it, and each of at most 32 + 32 additions on the device likewise",
        note=f"worst by {where}",
    )


def _both_signs(subject: str) -> Verdict:
    """Absolute errors of pixels a quarter of 1e6, a quarter of -1e6 and half of 1e-6."""
    size = (2, 2)
    strips = [
        panel(k + left, -9.0, k + left + 0.25, 11.0, size, gray(value))
        for k in range(size[0])
        for left, value in ((0.0, _BRIGHT), (0.25, -_BRIGHT))
    ]
    scene = picture(strips, size, background=_DARK)
    got = _red(scene, sampled(subject, _SAMPLES, more="sampler=grid"), size)
    exact, side = 0.5 * _DARK * HALF_ULP, math.isqrt(_SAMPLES)
    return Verdict(
        float(np.abs(got - 0.5 * _DARK).max()),
        "radiance",
        exact,
        exact if subject == REFERENCE else exact + side / 4 * _BRIGHT * 2.0**-53,
        f"rows of {side} samples cancel, within one a sum reaches {side // 4}e6, and each addition loses 2^-53 of that "
        "in float64; a float32 sum would lose all of 1e-6",
    )


def _dark_beside_a_sun(subject: str) -> Verdict:
    """Relative errors where the filter does not reach a sun of 1e6, which stands still or moves by two pixels."""
    size = (24, 4)
    left, right = 10.02, 10.98
    worst, where, taps = 0.0, "", 0
    filters = ["box", "tent", "cone", "gaussian", "mitchell", "lanczos", "gaussian,radius=3,sigma=1"]
    for filtering in [f"filter={name}" for name in filters]:
        spec = filter_of(resolve_technique(with_keys("reference:", filtering)))
        taps = max(taps, 2 * math.ceil(spec.radius) + 1)
        for shift in (0.0, 2.0) if filtering in ("filter=box", "filter=tent") else (0.0,):
            motion = Motion(velocity=(2.0 * shift, 0.0, 0.0))
            sun = panel(left, -20.0, right, 24.0, size, gray(_BRIGHT), motion if shift else None)
            scene = picture([sun], size, background=_DARK, shutter=0.5 if shift else 0.0)
            centres = np.arange(size[0]) + 0.5
            dark = (centres + spec.radius < left - 0.01) | (centres - spec.radius > right + shift + 0.01)
            pixels = _red(scene, sampled(subject, 16, filtering), size)
            error = float(np.abs(pixels[:, dark] / _DARK - 1.0).max())
            lit = float(pixels[:, 10].mean())
            if not lit > 1e3:
                return Verdict(math.inf, "of the value", 0.0, 0.0, "the sun itself must be in the picture")
            if error >= worst:
                worst, where = error, filtering + (", moving" if shift else "")
    return Verdict(
        worst,
        "of the value",
        HALF_ULP,
        HALF_ULP * (2 * (2 * taps) + 2 if is_raster(subject) else 1),
        f"float32 rounds the result by 2^-24 of it; on the device also {taps} products and sums along each axis",
        note=f"worst by {where}",
    )


def _denormals(subject: str) -> Verdict:
    """Errors of colours below float32's normal numbers."""
    size = (2, 2)
    colors = (1e-40, 0.0, 1e-45)
    scene = picture([panel(-9.0, -9.0, 9.0, 9.0, size, colors)], size)
    ways = [sampled(subject, 16)]
    if is_raster(subject):
        ways += [with_keys(subject, keys) for keys in ("msaa=4", "ssaa=2", "passes=4,filter=tent")]
    errors = {way: float(np.abs(render(scene, way, size=size).pixels.astype(float) - colors).max()) for way in ways}
    worst = max(errors, key=lambda way: errors[way])
    return Verdict(
        errors[worst],
        "radiance",
        2.0**-150,
        2.0**-126 if is_raster(subject) else 2.0**-150,
        "half of the least denormal float32; OpenGL may take numbers below the least normal one, 2^-126, for 0",
        note=f"worst by {worst}",
    )


def _largest(subject: str) -> Verdict:
    """Relative errors of the mean of 1024 samples of the largest radiance that is taken; more must be refused."""
    size = (2, 2)
    value = _LARGEST_RASTER if is_raster(subject) else _LARGEST

    def flat(radiance: float) -> Scene:
        return picture([panel(-9.0, -9.0, 11.0, 11.0, size, gray(radiance))], size)

    error = float(np.abs(_red(flat(value), sampled(subject, _SAMPLES), size) / value - 1.0).max())
    note = ""
    if is_raster(subject):
        try:
            render(flat(_LARGEST), subject, size=size)
            return Verdict(1.0, "of the value", 0.0, 0.0, "a radiance beyond the rasterizer's range must be refused")
        except InputError as refusal:
            note = str(refusal)
            if not ("color" in note and "3e+38" in note and f"{_LARGEST_RASTER:.3g}" in note):
                error = 1.0
    return Verdict(
        error, "of the value", HALF_ULP, HALF_ULP, "float32 rounds the mean by 2^-24 of it; sums are float64", note=note
    )


def _overflow(subject: str) -> Verdict:
    """Whether a run records a picture that float32 cannot hold as failed, with a sentence that says so."""
    from aliasbench.bench.run import execute
    from aliasbench.bench.store import RunStore
    from aliasbench.bench.suite import Case

    size = (8, 8)
    scene = halved(size, 0.0, _LARGEST, textured=True, tint=1e3)
    if subject == REFERENCE:
        error = float(np.abs(_red(scene, subject, size) / (0.5e3 * _LARGEST) - 1.0).max())
        return Verdict(error, "of the value", 1e-12, 1e-12, "4096 roundings of float64 would be 5e-13 of it")
    keys = ["", "filter=mitchell"]
    cases = [
        Case(
            f"overflow-{number}",
            scene,
            resolve_technique(sampled(subject, 4, filtering)),
            size,
            1,
            (0,),
            1,
            ("rmse",),
            "point",
        )
        for number, filtering in enumerate(keys)
    ]
    with (
        TemporaryDirectory(prefix="aliasbench-") as folder,
        RunStore.create(Path(folder) / "run", {}, [case.spec() for case in cases]) as store,
    ):
        execute(cases, store)
        outcomes = [stored.outcome or {} for stored in store.cases()]
    told = [o.get("status") == "failed" and "not finite" in str(o.get("error")) for o in outcomes]
    return Verdict(
        float(len(keys) - sum(told)),
        "records",
        0.0,
        0.0,
        "3e41 is infinite in float32: an average over what is left would look like a result",
        note=str(outcomes[told.index(False) if False in told else 0].get("error")),
    )


CASES = (
    HardCase(
        "values-1e6-and-1e-6",
        "values",
        "Half of a pixel is 1e6 and half 1e-6, by edges or by a texture, over 1024 samples and by hardware samples.",
        "The pixel is the mean of both, to float32's rounding.",
        _both_in_a_pixel,
    ),
    HardCase(
        "values-of-both-signs",
        "values",
        "A quarter of a pixel is 1e6, a quarter -1e6, half 1e-6: the large ones cancel.",
        "The pixel is 5e-7: sums keep what is twelve orders of magnitude smaller than their terms.",
        _both_signs,
    ),
    HardCase(
        "dark-beside-a-sun",
        "values",
        "A sun of 1e6 stands, or moves, in a scene of 1e-6, under every filter.",
        "Pixels whose filter does not reach the sun are 1e-6, to float32's rounding.",
        _dark_beside_a_sun,
    ),
    HardCase(
        "denormal-colours",
        "values",
        "Colours are 1e-40 and 1e-45, below float32's normal numbers, and 0.",
        "They come out as the nearest float32.",
        _denormals,
    ),
    HardCase(
        "largest-colours",
        "values",
        "Colours are the largest that the renderer takes, 3e38 or 2^100: 1024 of them are beyond float32.",
        "The mean is that colour, and the rasterizer refuses 3e38 with the object and the limit.",
        _largest,
    ),
    HardCase(
        "colours-beyond-float32",
        "values",
        "A texture of 3e38 times a colour of 1e3 is beyond float32.",
        "A run records the picture as failed, and says that values are not finite; the reference's float64 holds it.",
        _overflow,
    ),
    *sums.CASES,
    *adaptivity.CASES,
    *supports.CASES,
    *weights.CASES,
)
