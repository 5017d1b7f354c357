"""What samples at many instants of one shutter see of a moving polygon: the truth, and how far off a picture is.

All samples are at pixel centres (`sampler=center`), their times in the middles of equal parts of the shutter, so a
pixel's value is the number of instants at which its centre is inside the outline. Outlines come from closed forms of
the motion, not from the code that moves objects.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aliasbench.bench.hard.case import Verdict
from aliasbench.bench.hard.ladder import HALF_ULP, RAY_ROUNDINGS
from aliasbench.bench.hard.ownership import distance_to_outline, inside, pixel_points
from aliasbench.bench.hard.painting import TIE_PX
from aliasbench.renderers.frame import Frame
from aliasbench.scenes.model import Animation, Camera, FloatArray, Motion, Scene, Spin, Vec3
from aliasbench.scenes.shapes import polygon

SIZE = (32, 24)
FPS = 30.0
OPEN = Animation(fps=FPS, frames=1, shutter=1.0)
Z: Vec3 = (0.0, 0.0, 1.0)
HUB: Vec3 = (0.0, 0.0, 0.0)
BLADE = np.array([(1.7, -3.2), (11.3, -2.6), (10.9, 4.1), (2.2, 3.7)])
TEETH = 12


def _comb() -> FloatArray:
    """Return one outline whose edges pass centres of `SIZE`'s pixels ever more closely."""
    points = [(-13.3, -9.7), (13.4, -9.9)]
    for tooth in range(TEETH):
        right, lean = 12.5 - 2.0 * tooth, 0.618 * 4.0**-tooth
        points += [(right + lean, -8.6), (right - lean, 8.3), (right - 0.9, 8.2), (right - 1.1, -8.6)]
    return np.array(points)


COMB = _comb()
PINHOLE_PX = 48.0  # a perspective camera's distance from the plane z = 0, of which a unit is a pixel
PINHOLE = Camera(
    "perspective", (0.0, 0.0, PINHOLE_PX), fov_y_deg=2.0 * math.degrees(math.atan(SIZE[1] / 2.0 / PINHOLE_PX))
)
# A pinhole's rays turn about it by roundings of the distance to a corner over that to the edge, each 48 px and more,
# which at an angle off the axis are 48 px / cos^2 a radian: with corners up to 17 px aside in a plane 48 px away.
PINHOLE_REACH = PINHOLE_PX * (1.0 + (17.0 / PINHOLE_PX) ** 2) * math.hypot(1.0, 17.0 / PINHOLE_PX)
IDENTITY = tuple(np.eye(4).ravel().tolist())
RASTER_PX = 2.0**0.5 / 512
RASTER_WHY = (
    "vertices are snapped to 1/256 px, so an edge moves by at most half of that along both axes: sqrt(2)/512 px"
)


@dataclass(frozen=True, slots=True)
class Miss:
    """How wrong a picture is: the worst pixel's misplacement in px, and how many pixels are wrong."""

    px: float
    pixels: int


def middles(count: int) -> list[Fraction]:
    """Return the middles of equal parts of [0, 1], exactly."""
    return [Fraction(2 * k + 1, 2 * count) for k in range(count)]


def turned(outline: FloatArray, turns: Fraction) -> FloatArray:
    """Return points (n, 2), y up, turned counter-clockwise about the origin; turns are reduced exactly."""
    part = turns - round(turns)
    if part * 4 == round(part * 4):
        c, s = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[round(part * 4) % 4]
    else:
        angle = 2.0 * np.pi * float(part)
        c, s = float(np.cos(angle)), float(np.sin(angle))
    out: FloatArray = outline @ np.array([[c, s], [-s, c]])
    return out


def to_picture(points: FloatArray, size: tuple[int, int]) -> FloatArray:
    """Return image positions of points (n, 2) about the picture's middle, y up, one unit a pixel."""
    out: FloatArray = points * (1.0, -1.0) + np.array(size) / 2
    return out


def find_misses(pixels: NDArray[np.floating], size: tuple[int, int], outlines: Sequence[FloatArray | None]) -> Miss:
    """Return how far from an outline the samples are that a picture has wrong.

    Parameters
    ----------
    pixels : (h, w, 3)
        White on black, the mean of one sample at the pixel's centre for each outline.
    outlines : sequence of (m, 2) float or None
        About the picture's middle, y up, at every sample's time; None: out of sight.

    Returns
    -------
    Miss
        Of a pixel with k samples wrong the k-th smallest distance of its centre from the outlines: no less can explain
        it. Infinite for a value that is no number of samples.
    """
    points = pixel_points(size)
    count = len(outlines)
    there = [None if outline is None else to_picture(outline, size) for outline in outlines]
    seen = np.sum([np.zeros(len(points)), *(inside(points, o) for o in there if o is not None)], axis=0)
    found = np.asarray(pixels, dtype=np.float64).reshape(-1, 3) * count
    whole = np.rint(found)
    if not np.isfinite(found).all() or np.abs(found - whole).max() > 1e-3 or np.ptp(whole, axis=1).max() > 0.0:
        return Miss(float("inf"), len(points))
    missed = np.abs(whole[:, 0] - seen).astype(int)
    wrong = np.flatnonzero(missed)
    if not len(wrong):
        return Miss(0.0, 0)
    far = np.array([np.full(len(wrong), np.inf) if o is None else distance_to_outline(points[wrong], o) for o in there])
    nth = np.minimum(missed[wrong], count) - 1
    return Miss(float(np.take_along_axis(np.sort(far, axis=0), nth[None], axis=0).max()), len(wrong))


def float32_px(reach_px: float, roundings: float = RAY_ROUNDINGS) -> float:
    """Return by how much float32 may move an edge of a polygon whose corners are up to `reach_px` from rays' origins.

    See `ladder` for the roundings.
    """
    return roundings * reach_px * HALF_ULP


def seeds_error(means: Sequence[float]) -> tuple[float, float]:
    """Return the standard error of the mean of independent means, and what chance keeps within but once in 10 000."""
    from scipy.stats import t

    error = float(np.std(means, ddof=1)) / math.sqrt(len(means))
    return error, float(t.isf(0.5e-4, len(means) - 1)) * error


def largest_error(pixels: NDArray[np.floating], expected: ArrayLike) -> float:
    """Return the largest difference, infinite where a pixel is not finite: NaN would be lost among others."""
    error = float(np.abs(np.asarray(pixels, dtype=np.float64) - np.asarray(expected)).max())
    return error if math.isfinite(error) else math.inf


def one_polygon(outline: ArrayLike, motion: Motion, animation: Animation = OPEN, camera: Camera | None = None) -> Scene:
    """Return one white polygon on black; without a camera a world unit is a pixel, the origin the picture's middle."""
    flat = np.asarray(outline, dtype=np.float64)
    body = polygon(np.c_[flat, np.zeros(len(flat))], motion=motion)
    return Scene("hard", camera or Camera("orthographic", height=float(SIZE[1])), (body,), animation=animation)


def spin_about(rev_per_s: float, axis: Vec3 = Z) -> Motion:
    """Return a spin about an axis through the picture's middle."""
    return Motion(spin=Spin(axis, HUB, rev_per_s))


def judge_places(subject: str, misses: Iterable[Miss], reach_px: float, why: str = "", more_px: float = 0.0) -> Verdict:
    """Return the verdict on samples that should have been seen where the body is at their own times."""
    found = list(misses)
    worst, pixels = max(m.px for m in found), sum(m.pixels for m in found)
    is_raster = subject.startswith("raster")
    bound = RASTER_PX if is_raster else float32_px(reach_px)
    reason = RASTER_WHY if is_raster else f"float32 rays: {RAY_ROUNDINGS:g} roundings of 2^-24 of up to {reach_px:g} px"
    why = f"{reason}{f', and {why}' if why else ''}"
    return Verdict(
        worst, "px", max(TIE_PX, more_px), bound + more_px, why, note=f"{pixels} pixels differ from the float64 truth"
    )


def judge_reference(frame: Frame, expected: ArrayLike, what: str, more: float = 0.0) -> Verdict:
    """Return the verdict on a reference beside a closed form (h, w): it must keep the bound that it states."""
    error = largest_error(frame.pixels, np.asarray(expected)[..., None])
    stated = frame.uncertainty if frame.uncertainty is not None else 0.0
    allowed = max(stated, 1e-9) + more
    why = f"the bound of {stated:.1e} that the reference itself states, beside {what} in float64"
    return Verdict(error, "contrast", allowed, allowed, why)
