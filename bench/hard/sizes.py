"""Pictures, textures and frame numbers of extreme sizes: one pixel, primes, the widest that devices draw.

Small pictures are where filters, post-processing and borders reach beyond everything there is; wide ones are where
coordinates have the fewest bits left for parts of a pixel, and devices draw in parts. The shapes are white triangles
on black, whose samples' owners are known in float64.
"""

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from aliasbench.bench.hard import empty, flat_signals, late_frames, refusals, texel_counts
from aliasbench.bench.hard.case import RASTERS, REFERENCE, HardCase, Verdict, samples_key, with_keys
from aliasbench.bench.hard.ownership import distance_to_outline, inside, outline_px, pixel_points
from aliasbench.bench.hard.painting import TIE_PX
from aliasbench.bench.hard.triangles import (
    SNAP,
    ULP,
    Size,
    comb_scene,
    coverage_error,
    grid_offsets,
    in_pixels,
    least_misplacement,
    misplaced_px,
    misplaced_why,
    near_edge_scene,
    triangle_scene,
)
from aliasbench.renderers.catalog import render
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import FloatArray, Scene
from aliasbench.scenes.shapes import polygon

SMALL: tuple[Size, ...] = ((1, 1), (1, 13), (13, 1), (2, 3), (3, 2), (17, 31), (31, 7))
GAPS_PX = (1e-2, -3e-3, 1e-3, -1e-4, 1e-5, -1e-6, 1e-7)
WIDE: tuple[Size, ...] = ((16384, 8), (8, 16384), (65536, 1), (1, 65536))


def _pictures(subject: str, sizes: tuple[Size, ...], side: int, scenes: tuple[Callable[[Size], Scene], ...]) -> Verdict:
    """One sample, side^2 samples and hardware samples of each scene at each size."""
    worst, where, far, known = 0.0, "", 0.0, 0.0
    for size, scene in ((size, make(size)) for size in sizes for make in scenes):
        if subject == REFERENCE:
            frame = render(scene, subject, size=size)
            error = coverage_error(frame.pixels, scene, size)
            # products of coordinates, of which GEOS' areas are differences
            known = max(known, (frame.uncertainty or 0.0) + 8.0 * size[0] * size[1] * 2.0**-52)
        else:
            many = samples_key(subject, side * side, "sampler=grid")
            asked = [(samples_key(subject, 1), grid_offsets(1)), (many, grid_offsets(side))]
            if subject in RASTERS:
                asked.append((with_keys(subject, f"ssaa={side}"), grid_offsets(side)))
                asked.append((with_keys(subject, "msaa=4"), hardware_offsets(subject)))
            pictures = [(render(scene, text, size=size).pixels, offsets) for text, offsets in asked]
            error = max(least_misplacement(p, scene, size, offsets) for p, offsets in pictures)
            far = max(far, misplaced_px(subject, size))
        if error > worst:
            worst, where = error, f"{size[0]} x {size[1]}"
    note = f"worst at {where}" if where else ""
    if subject == REFERENCE:
        why = "a reference is as far off as it says, and GEOS' areas lose 8 w h 2^-52"
        return Verdict(worst, "contrast", known, known, why, note=note)
    return Verdict(worst, "px", TIE_PX, far, misplaced_why(subject), note=note)


def _small(subject: str) -> Verdict:
    near = tuple(partial(near_edge_scene, gap_px=gap) for gap in GAPS_PX)
    return _pictures(subject, SMALL, 4, (triangle_scene, *near))


def _wide(subject: str) -> Verdict:
    return _pictures(subject, WIDE, 2, (triangle_scene, comb_scene))


def hardware_offsets(subject: str) -> FloatArray:
    """Return (4, 2): where the device says that its four samples a pixel are."""
    from aliasbench.renderers.raster.context import sample_positions

    return sample_positions(4, backend=subject.rpartition("=")[2])


WIDE_FILTERS = ("filter=tent", "filter=gaussian", "filter=mitchell", "filter=lanczos", "filter=cone,radius=2.5")


def _filters(subject: str) -> Verdict:
    """Filters that reach over the border: the picture is the middle of a larger one."""
    worst, allowed, where = 0.0, math.inf, ""
    for key in WIDE_FILTERS:
        for size in ((1, 1), (1, 5), (2, 3)):
            around = 8
            large = (size[0] + 2 * around, size[1] + 2 * around)
            shape = polygon([(-0.8, -0.44, 0.0), (3.21, -0.4, 0.0), (-0.02, 2.7, 0.0)])
            if subject == REFERENCE:
                own, other = (render(in_pixels(s, shape), with_keys(subject, key), size=s) for s in (size, large))
                cut = other.pixels[around:-around, around:-around]
                error = float(np.abs(own.pixels - cut).max())
                most = (own.uncertainty or 0.0) + (other.uncertainty or 0.0)
            else:
                text = samples_key(subject, 9, f"sampler=grid,{key}")
                pixels = render(in_pixels(size, shape), text, size=size).pixels[..., 0]
                truth, most = filtered_truth(in_pixels(size, shape), text, size, 3)
                error = float(np.abs(pixels - truth).max())
            if not where or error / most > worst / allowed:
                worst, allowed, where = error, most, f"{key} at {size[0]} x {size[1]}"
    why = (
        "both are as far off as they say"
        if subject == REFERENCE
        else "sums of n terms in float32: at most n 2^-24 times the sum of absolute weights over the sum of weights"
    )
    return Verdict(worst, "contrast", allowed, allowed, why, note=f"nearest to its bound: {where}")


def filtered_truth(scene: Scene, technique: str, size: Size, side: int) -> tuple[FloatArray, float]:
    """Return (h, w): sum w f / sum w over the grid's samples under the filter, and what float32 sums of it may lose.

    No sample may be nearer than `SNAP` to an edge: then all renderers see the same.
    """
    from aliasbench.renderers.sampling.filters import filter_of
    from aliasbench.renderers.technique import parse_technique

    spec = filter_of(parse_technique(technique))
    reach = spec.margin
    wide = (size[0] + 2 * reach, size[1] + 2 * reach)
    outline = outline_px(scene, 0, size, 0, 0.0) + reach
    fine = pixel_points((wide[0] * side, wide[1] * side)) / side
    assert distance_to_outline(fine, outline).min() > SNAP, "a sample too close to an edge to have one owner"
    white = inside(fine, outline).reshape(wide[1] * side, wide[0] * side).astype(np.float64)
    place = (np.arange((2 * reach + 1) * side) + 0.5) / side - reach - 0.5
    weights = spec.evaluate(place[None, :], place[:, None])
    seen = np.lib.stride_tricks.sliding_window_view(white, weights.shape)[::side, ::side]
    total = float(weights.sum())
    out: FloatArray = np.einsum("ijkl,kl->ij", seen, weights) / total
    return out, float(np.count_nonzero(weights) * ULP * np.abs(weights).sum() / abs(total))


def _post(subject: str) -> Verdict:
    """FXAA and SMAA look at neighbours that small pictures do not have; TAA is the mean of its frames."""
    from aliasbench.renderers.raster.taa import halton_place

    worst, where = 0.0, ""
    frame = 5
    for size in (*SMALL, (257, 3)):
        scene = triangle_scene(size)
        plain = render(scene, subject, size=size).pixels[..., 0]
        padded = np.pad(plain, 1, mode="edge")
        around = np.lib.stride_tricks.sliding_window_view(padded, (3, 3))
        low, high = around.min(axis=(2, 3)), around.max(axis=(2, 3))
        beside = around[..., (0, 1, 1, 2), (1, 0, 2, 1)]
        same = np.all(beside == plain[..., None], axis=-1)
        low, high = np.where(same, plain, low), np.where(same, plain, high)
        for post in ("fxaa", "smaa"):
            pixels = render(scene, with_keys(subject, f"post={post}"), size=size).pixels[..., 0]
            error = float(np.maximum(low - pixels, pixels - high).max())
            if not error <= worst:
                worst, where = error, f"{post} at {size[0]} x {size[1]}"
        pixels = render(scene, with_keys(subject, "post=taa"), size=size, frame=frame).pixels
        places = 0.5 + np.array([halton_place(n) for n in range(frame + 1)])
        error = least_misplacement(pixels, scene, size, places)
        if error > SNAP:  # these samples are far from the edge: as bad as a wrong picture
            worst, where = max(worst, 1.0), f"taa at {size[0]} x {size[1]}"
    return Verdict(
        max(worst, 0.0),
        "contrast",
        4.0 * ULP,
        4.0 * ULP,
        "blends of two neighbours in float32; TAA's samples may be wrong within sqrt 2 / 512 px of an edge",
        note=f"worst: {where}" if where else "",
    )


def _post_too_wide(subject: str) -> Verdict:
    """What needs the picture in one part is refused where no part holds it."""
    wrong = []
    for post in ("fxaa", "smaa", "taa"):
        try:
            pixels = render(triangle_scene((65536, 1)), with_keys(subject, f"post={post}"), size=(65536, 1)).pixels
        except InputError as error:
            if not all(part in str(error) for part in ("size 65536x1", f"post={post}", "at most", "at once")):
                wrong.append(f"{post}: {error}")
        else:
            # a device that draws as wide a picture in one part
            if not (np.isfinite(pixels).all() and 0.4 < pixels.mean() < 0.6):
                wrong.append(f"{post}: drawn, with a mean of {pixels.mean():.3g}")
    why = "the sentence names the size, the processing and the largest picture; a device that can draw it does"
    return Verdict(float(len(wrong)), "techniques", 0.0, 0.0, why, note="; ".join(wrong))


CASES = (
    HardCase(
        "small-pictures",
        "sizes",
        "Pictures of 1 x 1, 1 x 13, 13 x 1, 2 x 3, 3 x 2 and odd primes, with 1 sample, 4 x 4, and MSAA.",
        "How far from an edge a sample with a wrong owner must be; a reference's pixels are areas cut out by GEOS.",
        _small,
    ),
    HardCase(
        "wide-pictures",
        "sizes",
        "Pictures 16384 and 65536 pixels wide or high, which devices draw in parts: one large triangle, and small ones "
        "from end to end; 1 and 2 x 2 samples, and MSAA.",
        "How far from an edge a sample with a wrong owner must be; a reference's pixels are areas cut out by GEOS.",
        _wide,
    ),
    HardCase(
        "filters-wider-than-the-picture",
        "sizes",
        "Tent, Gaussian, Mitchell, Lanczos and cone over pictures of 1 x 1, 1 x 5 and 2 x 3 pixels.",
        "Pixels are sum w f / sum w over all samples under the filter, outside of the picture too; a reference is the "
        "middle of a larger one.",
        _filters,
    ),
    HardCase(
        "post-processing-of-small-pictures",
        "sizes",
        "FXAA, SMAA and TAA where a picture has no neighbours: 1 x 1, 1 x 13, 2 x 3, 257 x 3.",
        "FXAA and SMAA change only pixels beside a different one, within the range of their neighbours; TAA is the "
        "mean of its frames. Only rasterizers process.",
        _post,
        RASTERS,
    ),
    HardCase(
        "post-processing-of-too-wide-pictures",
        "sizes",
        "FXAA, SMAA and TAA need the picture in one part: 65536 x 1.",
        "Drawn where the device can, else refused with the size and the largest one. Only rasterizers process.",
        _post_too_wide,
        RASTERS,
    ),
    *empty.CASES,
    *texel_counts.CASES,
    *late_frames.CASES,
    *refusals.CASES,
    *flat_signals.CASES,
)
