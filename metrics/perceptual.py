"""What a viewer would see: FLIP of key frames, and the display that all perceptual metrics assume.

Pixels are scaled by the scene's contrast before any library sees them, so that scores do not change with exposure, and
are clamped in the copies that a display would show, never in the error; what is clamped is counted. FLIP is
OpenImageIO's. On a set of pictures (noise, edges, chroma, black against white; 30, 67 and 120 pixels per degree) its
means agree to 1.2e-5 with the authors' own tool and with the paper written out in float64, where the authors' tool
differs as much: both take the square root of a filter's rounding. It is preferred because it does not end the
interpreter on bad input, takes a quarter of the time and is a dependency already.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from aliasbench.metrics.error import key_frames
from aliasbench.metrics.gate import Signals
from aliasbench.metrics.score import Score, settle
from aliasbench.scenes.model import FloatArray

# In units of the contrast. Values within [0, 1] leave a filter with negative lobes as at most the sum of its positive
# weights less that of its negative ones: 1.423 for Lanczos of radius 3, 1.073 for Mitchell. More is light of its own.
BRIGHTER_THAN_WHITE = 1.5
MIDDLE_GREY = 0.18
MOST_EXPOSURES = 12
# In units of the contrast: white at every exposure, and far from what overflows when squared.
_BLINDING = 1e15
# Below this float32, in which FLIP is computed, tells no two values near 1 apart.
_FLOAT32_STEP = 2.0**-25
# Numerator and denominator of Narkowicz's fit to the ACES curve, exposed by 0.6 (Andersson et al. 2021).
_ACES = ((0.6**2 * 2.51, 0.6 * 0.03, 0.0), (0.6**2 * 2.43, 0.6 * 0.59, 0.14))
_SHOULDER = 0.85


@dataclass(frozen=True, slots=True)
class Display:
    """What the pictures are seen on, and from where.

    Attributes
    ----------
    pixels_per_degree : float
        Of visual angle. Default: a monitor of 3840 pixels on 0.7 m, seen from 0.7 m, as FLIP's authors assume.
    peak_cd_m2 : float
        Luminance of white.
    contrast : float
        White over black, of the display itself.
    ambient_lux, reflectivity : float
        Light of the room, and the share of it that the screen scatters back.
    """

    pixels_per_degree: float = 3840.0 * math.pi / 180.0
    peak_cd_m2: float = 200.0
    contrast: float = 1000.0
    ambient_lux: float = 250.0
    reflectivity: float = 0.005

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not (
                math.isfinite(value) and (value > 0.0 or (value == 0.0 and name in ("ambient_lux", "reflectivity")))
            ):
                raise ValueError(f"{name} = {value}: must be finite and positive")


DISPLAY = Display()


def scaled(pixels: NDArray[np.floating], contrast: float) -> FloatArray:
    """Return radiance in units of the contrast, float64, within 1e15 of 0."""
    with np.errstate(over="ignore"):
        out: FloatArray = np.clip(np.divide(pixels, contrast, dtype=np.float64), -_BLINDING, _BLINDING)
    return out


def clamped_counts(pixels: FloatArray, white: float) -> tuple[int, int]:
    """Return how many pixels (h, w, 3) have a channel below 0, and how many one above white."""
    return int(np.any(pixels < 0.0, axis=-1).sum()), int(np.any(pixels > white, axis=-1).sum())


def flip_map(test: FloatArray, reference: FloatArray, *, pixels_per_degree: float) -> FloatArray:
    """Return FLIP's error (h, w) of two pictures (h, w, 3) of linear RGB in [0, 1]; 0 to 1.

    Andersson, Nilsson, Akenine-Moller, Oskarsson, Astrom, Fairchild 2020.

    Raises
    ------
    RuntimeError
        If OpenImageIO refuses.
    """
    import OpenImageIO as oiio

    truth, picture = (oiio.ImageBuf(np.ascontiguousarray(p, dtype=np.float32)) for p in (reference, test))
    result = oiio.ImageBufAlgo.FLIP_diff(truth, picture, hdr=0, ppd=pixels_per_degree)
    pixels = result.get_pixels(oiio.FLOAT)
    if result.has_error or pixels is None:
        raise RuntimeError(f"FLIP: {result.geterror()}")
    errors: FloatArray = pixels[..., 0].astype(np.float64)
    return errors


def tone_map(pixels: FloatArray, exposure: float) -> FloatArray:
    """Return 2^exposure times non-negative pixels through the ACES curve, in [0, 1]."""
    x = np.exp2(exposure) * pixels
    above, below = (a * x * x + b * x + c for a, b, c in _ACES)
    out: FloatArray = np.clip(above / below, 0.0, 1.0)
    return out


def exposures(truth: Sequence[FloatArray]) -> tuple[float, ...]:
    """Return the exposures, in stops, at which pictures brighter than white are compared; ascending.

    At the first the brightest channel of the reference comes out at 0.85, at the last its median luminance does, or
    middle grey (0.18 of the contrast) if that is brighter; between them one about every stop, 12 at most. Andersson,
    Nilsson, Shirley, Akenine-Moller 2021, who take the greatest luminance instead, which a saturated colour is far
    above, and the median as it is, which is 0 in pictures on a black ground.

    Parameters
    ----------
    truth : sequence of (h, w, 3) float
        Reference in units of the contrast, with some channel above 0.18.
    """
    a, b, c = (p - _SHOULDER * q for p, q in zip(*_ACES, strict=True))
    shoulder = (-b + math.sqrt(b * b - 4.0 * a * c)) / (2.0 * a)
    brightest = max(float(np.max(p)) for p in truth)
    median = float(np.median(np.concatenate([(p @ (0.2126, 0.7152, 0.0722)).ravel() for p in truth])))
    start, stop = (math.log2(shoulder / level) for level in (brightest, max(median, MIDDLE_GREY)))
    count = min(max(2, math.ceil(stop - start)), MOST_EXPOSURES)
    return tuple(float(e) for e in np.unique(np.linspace(start, stop, count)))


def compute_flip(signals: Signals, *, display: Display = DISPLAY) -> Score:
    """Return the mean FLIP error of the first, middle and last frame, 0 (not seen) to 1.

    Where no reference pixel is brighter than 1.5 times the contrast this is LDR-FLIP with the contrast as white:
    lobes of a filter overshoot by less. Else it is HDR-FLIP, the largest error over several exposures at each pixel.
    Negative pixels are black and those above white are white in the copies that are compared; extras count them, and
    hold the exposures and where the worst pixel is. The floor is three times what a shift of the middle frame's pixels
    by the reference's uncertainty, away from their nearer end of [0, 1], comes to.
    """
    contrast = signals.scene.contrast
    keys = key_frames(signals.frames)
    truth = [scaled(signals.reference_rgb[k], contrast) for k in keys]
    hdr = max(float(np.max(p)) for p in truth) > BRIGHTER_THAN_WHITE
    white = _BLINDING if hdr else 1.0
    truth_counts = [clamped_counts(p, white) for p in truth]
    truth = [np.clip(p, 0.0, white) for p in truth]
    stops = exposures(truth) if hdr else ()

    def compare(picture: FloatArray, reference: FloatArray) -> FloatArray:
        shown = [(np.clip(picture, 0.0, white), reference)]
        if hdr:
            shown = [(tone_map(shown[0][0], e), tone_map(reference, e)) for e in stops]
        maps = [flip_map(*pair, pixels_per_degree=display.pixels_per_degree) for pair in shown]
        return maps[0] if len(maps) == 1 else np.maximum.reduce(maps)

    means, counts, worst = [], [], (-1.0, 0, 0, 0, 0)
    for seed in range(signals.seeds):
        for key, reference in zip(keys, truth, strict=True):
            picture = scaled(signals.test_rgb[seed, key], contrast)
            counts.append(clamped_counts(picture, white))
            errors = compare(picture, reference)
            means.append(float(np.mean(errors)))
            row, column = np.unravel_index(int(np.argmax(errors)), errors.shape)
            if errors[row, column] > worst[0]:
                worst = (float(errors[row, column]), seed, key, int(row), int(column))
    floor = 0.0
    if signals.uncertainty > _FLOAT32_STEP:
        middle = truth[len(truth) // 2]
        shift = np.where(middle.mean(axis=-1, keepdims=True) <= 0.5, signals.uncertainty, -signals.uncertainty)
        floor = 3.0 * float(np.mean(compare(middle + shift, middle)))
    extras = {
        "mode": "HDR" if hdr else "LDR",
        "exposures": list(stops),
        "pixels_per_degree": display.pixels_per_degree,
        "white": contrast,
        "frames": [k + signals.frame_start for k in keys],
        "negative_pixels": sum(below for below, _ in counts),
        "pixels_above_white": sum(above for _, above in counts),
        "reference_negative_pixels": sum(below for below, _ in truth_counts),
        "reference_pixels_above_white": sum(above for _, above in truth_counts),
        "worst": {
            "value": worst[0],
            "seed": worst[1],
            "frame": worst[2] + signals.frame_start,
            "row": worst[3] + signals.crop,
            "column": worst[4] + signals.crop,
        },
    }
    return settle(float(np.mean(means)), extras, floor=floor)
