"""The one gate that every picture passes before anything is measured: shape, type, finiteness, contrast, border.

It stands before all library calls because the libraries do not look: image comparisons in common use turn one NaN into
a small finite score, or an all-NaN picture into a perfect one. What is wrong with the suite (shapes, a broken
reference) raises; what is wrong with the picture under test is a status that the record keeps.
"""

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from numbers import Integral, Real
from typing import TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from aliasbench.metrics.score import Score
from aliasbench.scenes.model import FloatArray, Scene

# Rec. 709 luminance of linear RGB.
LUMINANCE = (0.2126, 0.7152, 0.0722)
THREADS = 2
T = TypeVar("T")


@dataclass(frozen=True, slots=True, eq=False)
class Centers:
    """Further sequences of a scene that moves, which tell errors in space from errors in time (see `separation`).

    Attributes
    ----------
    test : the test's shape, floating
        The same technique with all its samples at the shutter's middle.
    reference : (frames, h, w, 3) floating
        Exact, with the same filter, at the instant in the shutter's middle.
    full_shutter : (n, h, w, 3) floating, optional
        Exact, with the same filter and a shutter open from frame to frame: of the first n frames, all or fewer.
    reference_uncertainty, full_shutter_uncertainty : float
        Bounds on the pixel errors of the two, in radiance.
    """

    test: NDArray[np.floating]
    reference: NDArray[np.floating]
    full_shutter: NDArray[np.floating] | None = None
    reference_uncertainty: float = 0.0
    full_shutter_uncertainty: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Signals:
    """What the metrics are given: luminance in units of the scene's contrast, the border cut off, float64.

    Attributes
    ----------
    test : (seeds, frames, h, w) float64
    reference : (frames, h, w) float64
    error : (seeds, frames, h, w) float64
        test - reference, exactly 0 where they are equal.
    test_rgb, reference_rgb : (seeds, frames, h, w, 3) and (frames, h, w, 3)
        Linear radiance as given, the border cut off.
    scene : Scene
    size : (width, height)
        Of the whole picture, in pixels.
    crop : int
        Pixels cut off on each side: pixel (0, 0) of the arrays is pixel (crop, crop) of the picture.
    radius_px : float
        Half-width of the pixel filter.
    uncertainty : float
        Largest error of a reference pixel, in units of the contrast.
    frame_start : int
        The scene's number of the first frame.
    centers : Centers, Score or None
        As given, the border cut off, `test` with seeds; a score where `test` is not finite.
    is_instant : bool
        Whether they are test and reference themselves.
    kept : dict
        What several metrics are made from (see `once`).
    """

    test: FloatArray
    reference: FloatArray
    error: FloatArray
    test_rgb: NDArray[np.floating]
    reference_rgb: NDArray[np.floating]
    scene: Scene
    size: tuple[int, int]
    crop: int
    radius_px: float
    uncertainty: float
    frame_start: int
    centers: Centers | Score | None = None
    is_instant: bool = False
    kept: dict[str, object] = field(default_factory=dict, repr=False)

    def once(self, name: str, make: Callable[[], T]) -> T:
        """Return what `make` returns, made once for all metrics that ask for it under that name."""
        if name not in self.kept:
            self.kept[name] = make()
        return cast(T, self.kept[name])

    @property
    def seeds(self) -> int:
        """How many independent seeds were rendered."""
        return int(self.error.shape[0])

    @property
    def frames(self) -> int:
        """How many frames the sequence has."""
        return int(self.error.shape[1])

    @property
    def floor(self) -> float:
        """Three times the reference's uncertainty, in units of the contrast."""
        return 3.0 * self.uncertainty


def each_frame(work: Callable[[int], T], frames: int) -> list[T]:
    """Return work(0) .. work(frames - 1), done by two threads: numpy lets go of the interpreter inside of its loops.

    A frame at a time also stays in the processor's cache from one operation to the next.
    """
    if frames < 2:
        return [work(frame) for frame in range(frames)]
    handling = np.geterr()  # a thread begins with the default

    def same(frame: int) -> T:
        with np.errstate(**handling):
            return work(frame)

    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(same, range(frames)))


def luminance(rgb: NDArray[np.floating]) -> FloatArray:
    """Return the luminance (...) of linear RGB (..., 3) in float64, channel by channel to spare a copy in float64."""
    out: FloatArray = np.multiply(rgb[..., 0], LUMINANCE[0], dtype=np.float64)
    for channel in (1, 2):
        out += np.multiply(rgb[..., channel], LUMINANCE[channel], dtype=np.float64)
    return out


def is_finite(picture: NDArray[np.floating]) -> bool:
    """Return whether all values are; their sum tells but where it overflows."""
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(np.sum(picture, dtype=np.float64))) or bool(np.isfinite(picture).all())


def open_gate(
    test: NDArray[np.floating],
    reference: NDArray[np.floating],
    *,
    scene: Scene,
    filter_radius_px: float = 0.5,
    reference_uncertainty: float = 0.0,
    frame_start: int = 0,
    centers: Centers | None = None,
) -> Signals | Score:
    """Return the signals to measure, or the score that every metric has because there is nothing to measure.

    Parameters
    ----------
    test : (frames, h, w, 3) or (seeds, frames, h, w, 3) floating
        Linear radiance.
    reference : (frames, h, w, 3) floating
        Linear radiance with the same filter and shutter.
    scene : Scene
        Its contrast, facts, camera and animation are used.
    filter_radius_px : float
        ceil of it pixels are cut off on every side of both.
    reference_uncertainty : float
        Bound on the reference's pixel error, in radiance.
    frame_start : int
        The scene's number of the first frame.
    centers : Centers, optional
        What tells errors in space from errors in time; of a shutter that is not open, test and reference themselves.

    Raises
    ------
    ValueError
        Integer pixels, wrong or different shapes, empty arrays, a reference that is not finite, a radius or an
        uncertainty that is negative or not finite.
    """
    test, reference = np.asarray(test), np.asarray(reference)
    _check_pixels("test", test)
    _check_pixels("reference", reference)
    if reference.ndim != 4 or reference.shape[-1] != 3:
        raise ValueError(f"reference: shape {reference.shape}; must be (frames, h, w, 3)")
    if test.ndim not in (4, 5) or test.shape[-4:] != reference.shape:
        raise ValueError(
            f"test: shape {test.shape}; must be the reference's {reference.shape}, with or without seeds before it"
        )
    _check_number("filter_radius_px", filter_radius_px)
    _check_number("reference_uncertainty", reference_uncertainty)
    if isinstance(frame_start, bool) or not isinstance(frame_start, Integral) or frame_start < 0:
        raise ValueError(f"frame_start {frame_start!s:.60}: must be a whole number, not negative")
    _check_finite("reference", reference)
    if centers is not None:
        _check_centers(centers, test, reference)
    is_same = centers is not None and centers.test is test
    is_instant = is_same and centers is not None and centers.reference is reference
    test = test if test.ndim == 5 else test[None]
    broken = _find_nonfinite(test)
    if broken is not None:
        return broken
    seeds, frames, height, width = test.shape[:4]
    contrast = scene.contrast
    if not (math.isfinite(contrast) and contrast > 0.0):
        return Score(None, "undefined_zero_contrast", {"contrast": contrast})
    crop = math.ceil(filter_radius_px)
    if min(height, width) <= 2 * crop:
        return Score(None, "undefined_too_small", {"size": [width, height], "border": crop})
    test, reference = _cut(test, crop), _cut(reference, crop)
    shape = reference.shape[:3]
    test_y, reference_y, error = np.empty((seeds, *shape)), np.empty(shape), np.empty((seeds, *shape))

    def convert(frame: int) -> bool:
        np.divide(luminance(reference[frame]), contrast, out=reference_y[frame])
        for seed in range(seeds):
            np.divide(luminance(test[seed, frame]), contrast, out=test_y[seed, frame])
            np.subtract(test_y[seed, frame], reference_y[frame], out=error[seed, frame])
        return is_finite(error[:, frame])

    with np.errstate(over="ignore", invalid="ignore"):
        uncertainty = reference_uncertainty / contrast
        converted = all(each_frame(convert, frames))
    if not (converted and math.isfinite(uncertainty)):
        return Score(None, "overflow", {"contrast": contrast})
    return Signals(
        test_y,
        reference_y,
        error,
        test,
        reference,
        scene,
        (width, height),
        crop,
        filter_radius_px,
        uncertainty,
        frame_start,
        None if centers is None else _open_centers(centers, crop, is_checked=is_same),
        is_instant,
    )


def _find_nonfinite(test: NDArray[np.floating]) -> Score | None:
    """Return the score of pictures (seeds, frames, h, w, 3) with values that are not finite, or None."""
    if all(each_frame(lambda frame: is_finite(test[:, frame]), test.shape[1])):
        return None
    bad = ~np.isfinite(test)
    first = np.unravel_index(int(np.argmax(bad)), bad.shape)
    keys = ("seed", "frame", "row", "column", "channel")
    position = dict(zip(keys, (int(i) for i in first), strict=True))
    return Score(None, "nonfinite", {"count": int(np.sum(bad)), "first": position})


def _check_pixels(name: str, array: NDArray[np.floating]) -> None:
    if not np.issubdtype(array.dtype, np.floating):
        raise ValueError(f"{name}: pixels of type {array.dtype} have no known scale; give linear radiance as floats")
    if array.size == 0:
        raise ValueError(f"{name}: shape {array.shape} holds no pixels")


def _check_number(name: str, number: float) -> None:
    if isinstance(number, bool) or not isinstance(number, Real) or not (math.isfinite(number) and number >= 0.0):
        raise ValueError(f"{name} {number!s:.60}: must be finite and not negative")


def _check_finite(name: str, reference: NDArray[np.floating]) -> None:
    if not all(each_frame(lambda frame: is_finite(reference[frame]), len(reference))):
        raise ValueError(f"{name}: {int(np.sum(~np.isfinite(reference)))} values are not finite")


def _check_centers(centers: Centers, test: NDArray[np.floating], reference: NDArray[np.floating]) -> None:
    """Raise for sequences that do not go with the test and the reference; pictures under test may be not finite."""
    given = {"centers.test": centers.test, "centers.reference": centers.reference}
    shapes = {"centers.test": test.shape, "centers.reference": reference.shape}
    if centers.full_shutter is not None:
        given["centers.full_shutter"] = centers.full_shutter
        frames = min(len(centers.full_shutter), len(reference)) if centers.full_shutter.ndim else 0
        shapes["centers.full_shutter"] = (frames, *reference.shape[1:])
    for name, array in given.items():
        _check_pixels(name, array)
        if array.shape != shapes[name]:
            raise ValueError(f"{name}: shape {array.shape}; must be {shapes[name]}")
        if name != "centers.test" and array is not reference:
            _check_finite(name, array)
    _check_number("centers.reference_uncertainty", centers.reference_uncertainty)
    _check_number("centers.full_shutter_uncertainty", centers.full_shutter_uncertainty)


def _cut(pictures: NDArray[np.floating], border: int) -> NDArray[np.floating]:
    """Return pictures (..., h, w, 3) without a border."""
    height, width = pictures.shape[-3:-1]
    return pictures[..., border : height - border, border : width - border, :]


def _open_centers(centers: Centers, crop: int, *, is_checked: bool) -> Centers | Score:
    test, full = centers.test if centers.test.ndim == 5 else centers.test[None], centers.full_shutter
    broken = None if is_checked else _find_nonfinite(test)
    if broken is not None:
        return broken
    full = None if full is None else _cut(full, crop)
    return replace(centers, test=_cut(test, crop), reference=_cut(centers.reference, crop), full_shutter=full)
