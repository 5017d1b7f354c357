"""Texture footprints: from a thousandth of a texel to a million texels a pixel, and coordinates far from 0.

Coordinates on a rasterizer are float32, interpolated as c0 + cx x + cy y: a vertex's, the sum's three terms and the
division by w round once each, both corners count, so a coordinate is off by up to 8 x 2^-24 of the largest on the
surface, where whole repeats have been taken off already. The ray tracer's are float64.
"""

import math

import numpy as np

from aliasbench.bench.hard.case import RASTERS, REFERENCE, HardCase, Verdict, samples_key, with_keys
from aliasbench.bench.hard.ownership import pixel_points, worst_misplacement
from aliasbench.bench.hard.placing import MOVING_FRAME, moved
from aliasbench.bench.hard.sight import centres_of
from aliasbench.bench.hard.texel_areas import areas_verdict
from aliasbench.renderers.catalog import render
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Camera, Checker, FloatArray, ImageTexture, Scene
from aliasbench.scenes.shapes import quad

SIDE = 32
COARSE = (8, 8)  # pictures of sheets that the reference is asked for, of which a pixel is `PX` units
PX = SIDE / COARSE[0]
HALF_PX = 24.015  # of a sheet: beyond the picture, and between the places that corners snap to
HALF_ULP = 2.0**-24
ROUNDINGS = 8.0
SNAPPED_PX = math.sqrt(2.0) / 512.0
OUTPUT = 2.0**-22  # four float32 roundings of a colour up to 1
_RANDOM = np.random.default_rng(5).random((16, 16, 4), dtype=np.float32)
IMAGE = ImageTexture(np.where(np.arange(4) == 3, np.float32(1.0), _RANDOM))
CHECKER = Checker((1.0, 1.0), (0.2, 0.3, 0.4), (0.9, 0.8, 0.7))
TEXELS = {"image": 16.0, "checker": 1.0}  # a unit of uv
LEANS = (1e-3, 1e-5)  # of texel rows against pixel rows: borders pass pixel centres at 5e-6 px and more


def sheet(
    name: str,
    per_pixel: float,
    *,
    offset: float = 0.0,
    right_px: float = HALF_PX,
    projection: str = "orthographic",
    lean: float = LEANS[0],
) -> Scene:
    """Return a textured sheet that faces the camera, so many texels a unit; `offset` in units of uv, even.

    A unit is a pixel of a picture of `SIDE`. The sheet covers it and goes on to the right up to `right_px`. A corner of
    four texels is on the centre of the pixel to the right of and above the middle, but for the lean.
    """
    half = HALF_PX
    corners = np.array([(-half, -half), (right_px, -half), (right_px, half), (-half, half)])
    turned = np.array([(1.0, lean), (-lean, 1.0)])
    uv = ((corners @ turned.T - 0.5) * per_pixel) / TEXELS[name] + offset
    if projection == "orthographic":
        camera = Camera("orthographic", (0.0, 0.0, 50.0), height=float(SIDE))
    else:
        camera = Camera("perspective", (0.0, 0.0, 50.0), fov_y_deg=2.0 * math.degrees(math.atan(SIDE / 100.0)))
    surface = quad(np.column_stack([corners, np.zeros(4)]), uv=uv, texture=name)
    return Scene("sheet", camera, (surface,), {"image": IMAGE, "checker": CHECKER})


def coordinate_bound_px(subject: str, reach_px: float) -> tuple[float, str]:
    """Return by how many pixels a texel's border may move on a sheet that reaches so far from its middle, and why."""
    if subject in RASTERS:
        why = "corners snap to 1/256 px, half a step each way; and coordinates take 8 roundings of 2^-24 of the largest"
        return SNAPPED_PX + ROUNDINGS * HALF_ULP * reach_px, why
    # rays and look-ups are float64: only the direction's own rounding is left
    return 16.0 * 2.0**-53 * (reach_px + 100.0), "float64: 16 roundings of 2^-53 of the coordinate"


def misplaced(subject: str, scene: Scene) -> float:
    frame = 0 if scene.is_static else MOVING_FRAME
    truth = centres_of(scene, (SIDE, SIDE), frame, scene.animation.shutter / 2.0)
    text = samples_key(subject, 1, "" if scene.is_static else "time=center")
    return worst_misplacement(render(scene, text, size=(SIDE, SIDE), frame=frame).pixels, truth)


def _owners(subject: str) -> Verdict:
    """Point sampling of a facing sheet, from 1e-3 to 1e3 texels a pixel."""
    if subject == REFERENCE:
        return areas_verdict(
            (
                (f"{name}, {projection}, {per_pixel:g} texels a pixel", sheet(name, per_pixel / PX, **options))
                for options in ({"projection": "orthographic", "lean": 0.1}, {"projection": "perspective"})
                for projection in (options["projection"],)
                for name in TEXELS
                for per_pixel in (1e-3, 1.0, 8.0)
            ),
            COARSE,
        )
    found: list[tuple[float, str]] = []
    for projection in ("orthographic", "perspective"):
        for name in TEXELS:
            for power in (-3, -1, 0, 1, 3):
                for lean in LEANS:
                    still = sheet(name, 10.0**power, projection=projection, lean=lean)
                    for scene, how in ((still, ""), (moved(still), ", turning")):
                        at = f"worst: {name}, {projection}, {10.0**power:g} texels a pixel{how}"
                        found.append((misplaced(subject, scene), at))
    worst, note = max(found)
    bound, why = coordinate_bound_px(subject, 34.0)
    return Verdict(worst, "px", 0.0, bound, why, note=note if worst else "no wrong texel")


def _extreme_means(subject: str) -> Verdict:
    """Means of point sampled sheets at 1e4 to 1e6 texels a pixel."""
    if subject == REFERENCE:
        return _exact_extremes()
    worst, note, bound = 0.0, "", 0.0
    count = SIDE * SIDE * 256
    error = 0.5 / math.sqrt(count)
    refusals: list[str] = []
    for name, texture in (("image", IMAGE), ("checker", CHECKER)):
        for power in (4, 5, 6):
            # an odd number of texels: neighbours' samples, at the same place in their pixels, see other texels
            scene = sheet(name, 1.0618033 * 10.0**power)
            try:
                pixels = render(scene, samples_key(subject, 256, "sampler=random"), size=(SIDE, SIDE)).pixels
            except InputError as refusal:
                if not all(words in str(refusal) for words in ("object 0", "repeats so often", "divide the surface")):
                    return Verdict(
                        1.0, "refusals", 0.0, 0.0, "a refusal names object, reason and remedy", note=str(refusal)
                    )
                refusals.append(f"{name} at 1e{power} is refused: {refusal}")
                continue
            found = float(np.abs(pixels.mean(axis=(0, 1), dtype=np.float64) - _mean_of(texture)).max())
            if found > worst:
                worst, note = found, f"worst: {name} at 1e{power}"
                is_coarse = subject in RASTERS and name == "image"
                bound = _coarse_mean_error(1.0618033 * 10.0**power * HALF_PX) if is_coarse else 0.0
    why = "4 standard errors; and where float32 is 2 texels apart only every second texel may be met"
    allowed = 4.0 * error
    return Verdict(worst, "contrast", allowed, allowed + bound, why, error, "; ".join([note, *refusals]))


def _exact_extremes() -> Verdict:
    """The reference's pixels at 1e4 to 1e6 texels a pixel: the texture's mean, but for repeats that sides cut."""
    size, worst, bound, note = (2, 2), 0.0, 0.0, ""
    for name, period, texture in (("image", 16.0, IMAGE), ("checker", 2.0, CHECKER)):
        for power in (4, 5, 6):
            frame = render(sheet(name, 1.0618033 * 10.0**power / (SIDE / size[0])), REFERENCE, size=size)
            found = float(np.abs(frame.pixels - _mean_of(texture)).max())
            # all repeats that a pixel's four sides cut together
            cut = 4.0 * period / (1.0618033 * 10.0**power)
            bound = max(bound, cut * (1.0 + cut / 2.0) + (frame.uncertainty or 0.0))
            worst, note = max((worst, note), (found, f"worst: {name} at 1e{power}"))
    why = "repeats that a pixel's sides cut, 4 times 16 texels of 1e4, are whatever they are"
    return Verdict(worst, "contrast", bound, bound, why, note=note)


def _coarse_mean_error(largest: float) -> float:
    """Return how much the image's mean may change if only texels are met that float32 tells apart at `largest`."""
    apart = int(max(1.0, np.spacing(np.float32(largest / 16.0)) * 16.0))
    texels = IMAGE.texels[..., :3].astype(np.float64)
    means = [texels[a::apart, b::apart].mean(axis=(0, 1)) for a in range(apart) for b in range(apart)]
    return float(np.abs(np.stack(means) - _mean_of(IMAGE)).max())


def _mean_of(texture: Checker | ImageTexture) -> FloatArray:
    if isinstance(texture, Checker):
        return 0.5 * np.add(texture.black, texture.white, dtype=np.float64)
    out: FloatArray = texture.texels[..., :3].mean(axis=(0, 1), dtype=np.float64)
    return out


def modes_of(subject: str) -> tuple[str, ...]:
    """Return the minifications that a subject has."""
    return ("mipmap", "trilinear", "anisotropic" if subject in RASTERS else "ewa")


def _minified(subject: str) -> Verdict:
    """Filtered sheets from one texture a pixel up to a million texels: the texture's mean, in every pixel."""
    worst, note = 0.0, ""
    for name, mean in (("image", _mean_of(IMAGE)), ("checker", _mean_of(CHECKER))):
        # whole periods of 16 texels, so that even a box, cut by its sides, has the mean
        for per_pixel in (64.0, 1024.0, 10240.0) if subject == REFERENCE else (64.0, 1e3, 1e4, 1e5, 1e6):
            scene = sheet(name, per_pixel)
            if subject == REFERENCE:
                frame = render(scene, subject, size=(8, 8))
                found = float(np.abs(frame.pixels - mean).max())
                worst, note = max((worst, note), (found, f"worst: {name}, {per_pixel:g} texels a pixel"))
                continue
            for mode in modes_of(subject):
                pixels = render(scene, with_keys(subject, f"texture={mode}"), size=(SIDE, SIDE)).pixels
                found = float(np.abs(pixels - mean).max())
                worst, note = max((worst, note), (found, f"worst: {name}, {mode}, {per_pixel:g} texels a pixel"))
    if subject == REFERENCE:
        # the lean takes 1e-6 of a box off one side and puts it on the other
        bound = LEANS[0] ** 2 + 1e-8
        return Verdict(worst, "contrast", bound, bound, "a box that leans by 1e-3 is 1e-6 off whole periods", note=note)
    return Verdict(worst, "contrast", OUTPUT, OUTPUT, "four roundings of a float32 colour", note=note)


def _magnified(subject: str) -> Verdict:
    """Linear magnification, 1e-3 to 1e-1 texels a pixel, against the bilinear formula in float64."""
    if subject == REFERENCE:
        scenes = ((f"{p:g} texels a pixel", sheet("image", p / PX)) for p in (1e-3, 1e-2, 1e-1))
        return areas_verdict(scenes, COARSE, bilinear=True)
    worst, note = 0.0, ""
    points = pixel_points((SIDE, SIDE))
    place_px = np.stack([points[:, 0] - SIDE / 2, SIDE / 2 - points[:, 1]], axis=1)
    for per_pixel in (1e-3, 1e-2, 1e-1):
        lean = np.array([(1.0, LEANS[0]), (-LEANS[0], 1.0)])
        place = (place_px @ lean.T - 0.5) * per_pixel - 0.5
        whole = np.floor(place).astype(np.int64)
        part = place - whole
        truth = np.zeros((len(points), 3))
        for right in (0, 1):
            for up in (0, 1):
                weight = np.abs(1 - right - part[:, 0]) * np.abs(1 - up - part[:, 1])
                texels = IMAGE.texels[(whole[:, 1] + up) % 16, (whole[:, 0] + right) % 16, :3]
                truth += weight[:, None] * texels
        for mode in ("linear", "trilinear"):
            pixels = render(sheet("image", per_pixel), with_keys(subject, f"texture={mode}"), size=(SIDE, SIDE)).pixels
            found = float(np.abs(pixels.reshape(-1, 3) - truth).max())
            worst, note = max((worst, note), (found, f"worst: {mode}, {per_pixel:g} texels a pixel"))
    # the largest coordinate is a whole repeat of 16 texels where fewer are seen
    rounding = OUTPUT + (2.0 * ROUNDINGS * HALF_ULP * 16.0 if subject in RASTERS else 0.0)
    bound = rounding + (2.0 * (2.0**-9 + 0.1 * SNAPPED_PX) if subject in RASTERS else 0.0)
    why = "float32 coordinates within 16 texels; a GPU's weights of 8 bits (2^-9) and snapped corners, right and up"
    return Verdict(worst, "contrast", rounding, bound, why if subject in RASTERS else "float32 colours", note=note)


TEXELS_OWN = (
    "Every sample has the colour of the texel that float64 finds, but for those within the bound of a border; a "
    "reference's pixels are the texels' areas by GEOS"
)

CASES = (
    HardCase(
        "footprints-point",
        "scale",
        "Checker and image that face the camera, still and turning, 1e-3 to 1e3 texels a pixel, borders as close as "
        "5e-6 px to samples.",
        f"{TEXELS_OWN} (up to 8 texels a pixel).",
        _owners,
    ),
    HardCase(
        "footprints-extreme",
        "scale",
        "Point sampled textures of 1e4 to 1e6 texels a pixel, in 256 samples a pixel.",
        "The picture's mean is the texture's, or the renderer refuses and says why and what to do; a reference's "
        "pixels are, but for repeats that their sides cut.",
        _extreme_means,
    ),
    HardCase(
        "footprints-minified",
        "scale",
        "Checker and image of 64 to 1e6 texels a pixel under every minification.",
        "Every pixel is the texture's mean.",
        _minified,
    ),
    HardCase(
        "footprints-magnified",
        "scale",
        "An image of 1e-3 to 1e-1 texels a pixel, looked up bilinearly.",
        "Every pixel is what the bilinear formula gives in float64; a reference's is the formula's integral over it.",
        _magnified,
    ),
)
