"""The horizon: a floor that goes on for a million units, of which a pixel holds thousands of squares and more."""

import math

import numpy as np

from aliasbench.bench.hard.case import RASTERS, REFERENCE, RENDERERS, HardCase, Verdict, samples_key, with_keys
from aliasbench.bench.hard.footprints import OUTPUT, coordinate_bound_px, modes_of
from aliasbench.bench.hard.ownership import worst_misplacement
from aliasbench.bench.hard.sight import centres_of
from aliasbench.bench.hard.texel_areas import areas_verdict
from aliasbench.renderers.catalog import render
from aliasbench.scenes.model import Camera, Checker, Scene
from aliasbench.scenes.shapes import quad

_HORIZON_SIZE = (64, 48)
_FOCAL_PX = 64.0
_FLOOR = 1e6
_REFERENCE_FLOOR = 300.0  # the exact sums take time in proportion to the rows of squares
_SQUARES = 4.0
_SKY = (0.25, 0.5, 0.75)


def horizon(size: tuple[int, int] = _HORIZON_SIZE, far: float = _FLOOR) -> Scene:
    """Return a checker floor that goes on for `far` units, seen from a unit above, its horizon in the middle."""
    corners = [(-far, 0.0, -0.5), (far, 0.0, -0.5), (far, 0.0, -far), (-far, 0.0, -far)]
    # squares are turned a little, so that pixels are at all distances from their borders
    floor = quad(corners, uv=[(x - 0.1 * z, -z - 0.1 * x) for x, _, z in corners], texture="floor")
    fov = 2.0 * math.degrees(math.atan(size[1] / 2.0 / _FOCAL_PX))
    camera = Camera("perspective", (0.0, 1.0, 0.0), (0.0, 1.0, -1.0), fov_y_deg=fov)
    return Scene("horizon", camera, (floor,), {"floor": Checker((_SQUARES, _SQUARES))}, background=_SKY)


def _horizon_owners(subject: str) -> Verdict:
    """Point sampling of a floor up to the horizon: whose the samples are."""
    if subject == REFERENCE:
        scenes = [("up to 12 rows from the bottom", horizon(far=_REFERENCE_FLOOR))]
        return areas_verdict(scenes, _HORIZON_SIZE, rows=slice(36, None))
    scene, size = horizon(), _HORIZON_SIZE
    truth = centres_of(scene, size)
    pixels = render(scene, samples_key(subject, 1), size=size).pixels
    found = worst_misplacement(pixels, truth) if np.isfinite(pixels).all() else math.inf
    bound, why = coordinate_bound_px(subject, 4.0 * size[0])
    if subject not in RASTERS:
        # a texel's least height in the picture's last row is that of the nearest, depth 64 / 24 units
        least_slope = _SQUARES * (_FOCAL_PX / 24.0) / _FOCAL_PX
        bound = 16.0 * 2.0**-53 * _FLOOR * _SQUARES / least_slope
    note = f"{int(np.sum(truth.distance > bound))} of {len(truth.distance)} samples are farther from a border"
    return Verdict(found, "px", 0.0, bound, why, note=note)


def _horizon_filtered(subject: str) -> Verdict:
    """The row just under the horizon is the floor's mean under every minification."""
    if subject == REFERENCE:
        frame = render(horizon(far=_REFERENCE_FLOOR), subject, size=_HORIZON_SIZE)
        sky = _FOCAL_PX / _REFERENCE_FLOOR
        truth = 0.5 * (1.0 - sky) + sky * np.asarray(_SKY)
        found = float(np.abs(frame.pixels[_HORIZON_SIZE[1] // 2] - truth).max())
        # where the row ends, at a depth of 64 units, a pixel is 64 units high
        bound = 0.5 / (_SQUARES * _FOCAL_PX) + (frame.uncertainty or 0.0)
        why = "sky by how far short of the horizon the floor ends; and one row of squares, 1/256 px high, is cut"
        return Verdict(found, "contrast", bound, bound, why)
    worst, note = 0.0, ""
    for mode in modes_of(subject):
        pixels = render(horizon(), with_keys(subject, f"texture={mode}"), size=_HORIZON_SIZE).pixels
        row = _HORIZON_SIZE[1] // 2
        found = float(np.abs(pixels[row] - 0.5).max()) if np.isfinite(pixels).all() else math.inf
        worst, note = max((worst, note), (found, f"worst: {mode}"))
    return Verdict(worst, "contrast", OUTPUT, OUTPUT, "four roundings of a float32 colour", note=note)


def _horizon_mean(subject: str) -> Verdict:
    """The two rows under the horizon, point sampled: the floor's mean."""
    size, count = (1024, 4), 128
    pixels = render(horizon(size), samples_key(subject, count, "sampler=random"), size=size).pixels
    samples = 2 * size[0] * count
    error = 0.5 / math.sqrt(samples)
    found = abs(float(pixels[2:, :, 0].mean(dtype=np.float64)) - 0.5)
    return Verdict(
        found, "contrast", 4.0 * error, 4.0 * error, "4 standard errors of a mean of independent squares", error
    )


CASES = (
    HardCase(
        "horizon-point",
        "scale",
        "A checker floor a million units deep, up to its horizon, point sampled.",
        "All is finite, and every sample farther than the bound from a border of squares is its square's; the "
        "reference's last rows are the squares' areas by GEOS.",
        _horizon_owners,
    ),
    HardCase(
        "horizon-filtered",
        "scale",
        "The row of pixels under the horizon, where a pixel holds 1e3 squares and more, under every minification.",
        "All is finite, and the row is the floor's mean; the reference's less the sky where its floor ends.",
        _horizon_filtered,
    ),
    HardCase(
        "horizon-mean",
        "scale",
        "The two rows under the horizon, point sampled 128 times a pixel in a picture 1024 wide.",
        "Their mean is the floor's, to what so many samples allow; exact rows are asked for by horizon-filtered.",
        _horizon_mean,
        RENDERERS,
    ),
)
