"""Texture coordinates far from 0: numbers with few bits left for parts of a texel, and repeats without end."""

import itertools

import numpy as np

from aliasbench.bench.hard.case import RASTERS, REFERENCE, HardCase, Verdict, with_keys
from aliasbench.bench.hard.footprints import (
    COARSE,
    HALF_ULP,
    LEANS,
    OUTPUT,
    PX,
    ROUNDINGS,
    SIDE,
    TEXELS,
    TEXELS_OWN,
    coordinate_bound_px,
    misplaced,
    modes_of,
    sheet,
)
from aliasbench.bench.hard.placing import moved
from aliasbench.bench.hard.texel_areas import areas_verdict
from aliasbench.renderers.catalog import render


def _far_coordinates(subject: str) -> Verdict:
    """Point sampling where texture coordinates are 1e4, 1e6 and 1e8 texels from 0."""
    if subject == REFERENCE:
        return areas_verdict(
            (
                (f"{name}, {offset:g} texels from 0", sheet(name, 1.0 / PX, offset=offset / TEXELS[name]))
                for name in TEXELS
                for offset in (1e4, -1e6, 1e8)
            ),
            COARSE,
        )
    worst, note = 0.0, "no wrong texel"
    for name in TEXELS:
        for offset in (1e4, -1e6, 1e8):
            for lean, projection in itertools.product(LEANS, ("orthographic", "perspective")):
                still = sheet(name, 0.25, offset=offset / TEXELS[name], lean=lean, projection=projection)
                for scene in (still, moved(still)):
                    at = f"worst: {name}, {offset:g} texels from 0, {projection}{'' if scene is still else ', turning'}"
                    worst, note = max((worst, note), (misplaced(subject, scene), at))
    bound, why = coordinate_bound_px(subject, 34.0)
    if subject not in RASTERS:
        bound += 16.0 * 2.0**-53 * 1e8 / 0.25
    return Verdict(worst, "px", 0.0, bound, why, note=note)


def _far_filtered(subject: str) -> Verdict:
    """Filtered look-ups 1e4 and 1e6 texels from 0 against the same ones near 0."""
    worst, note, uncertainty = 0.0, "equal", 0.0
    for name in TEXELS:
        for mode in ("point", "linear") if subject == REFERENCE else ("linear", *modes_of(subject)):
            for per_pixel in (0.25, 3.0):
                key = with_keys(subject, f"texture={mode}")
                near = render(sheet(name, per_pixel), key, size=(SIDE, SIDE)).pixels
                for offset in (1e4, -1e6):
                    scene = sheet(name, per_pixel, offset=offset / TEXELS[name])
                    frame = render(scene, key, size=(SIDE, SIDE))
                    found = float(np.abs(frame.pixels - near).max())
                    uncertainty = max(uncertainty, frame.uncertainty or 0.0)
                    worst, note = max((worst, note), (found, f"worst: {name}, {mode}, {offset:g} texels from 0"))
    if subject == REFERENCE:
        # the bound itself must be small beside what 8-bit pictures resolve, or it would excuse anything
        rounding = min(2.0 * uncertainty, 1e-6)
        why = "twice the reference's own bound"
    elif subject in RASTERS:
        # texels differ by at most 1 and blend over one; both axes move
        rounding = OUTPUT + 2.0 * 3.0 * ROUNDINGS * HALF_ULP * 34.0
        why = "8 roundings of 2^-24 of coordinates up to 34 px, at 3 texels a pixel, right and up"
    else:
        rounding = OUTPUT + 2.0 * 16.0 * 2.0**-53 * 1e6
        why = "16 roundings of 2^-53 of coordinates, right and up, and 4 of the float32 colour"
    return Verdict(worst, "contrast", rounding, rounding, why, note=note)


_REACHES_PX = (1e3, 1e4, 1e5, 2.5e5, 1e6, 1e7)
_CUT_PX = 2.0**17  # beyond, the rasterizer cuts surfaces in float64 near the picture's border


def _many_repeats(subject: str) -> Verdict:
    """Point sampling at one end of sheets up to 1e7 px long, four pixels a texel."""
    if subject == REFERENCE:
        return areas_verdict(
            (
                (f"{name}, {reach:g} px long", sheet(name, 0.25 / PX, right_px=reach * PX))
                for name in TEXELS
                for reach in (1e3, 2.5e5, 1e7)
            ),
            COARSE,
        )
    judged = []
    for reach in _REACHES_PX:
        bound, why = coordinate_bound_px(subject, min(reach, _CUT_PX) if subject in RASTERS else reach)
        for name in TEXELS:
            for lean in LEANS:
                found = misplaced(subject, sheet(name, 0.25, right_px=reach, lean=lean))
                judged.append((found / bound, found, bound, f"worst: {name}, {reach:g} px long"))
    # each length is held to its own bound: shown is the one that comes nearest to it
    _, found, bound, note = max(judged)
    return Verdict(found, "px", 0.0, bound, why, note=note if found else "no wrong texel")


CASES = (
    HardCase(
        "coordinates-far-point",
        "scale",
        "Texture coordinates 1e4, -1e6 and 1e8 texels from 0, on sheets still and turning, before either camera.",
        f"{TEXELS_OWN}.",
        _far_coordinates,
    ),
    HardCase(
        "coordinates-far-filtered",
        "scale",
        "Filtered look-ups at texture coordinates 1e4 and -1e6 texels from 0.",
        "The picture is the one of the same surface with coordinates near 0.",
        _far_filtered,
    ),
    HardCase(
        "repeats-many",
        "scale",
        "One end of surfaces 1e3 to 1e7 px long on which a texture repeats all along, 4 px a texel.",
        f"{TEXELS_OWN}.",
        _many_repeats,
    ),
)
