"""Edges and vertices that triangles share: nothing may show through between them, and no sample may count twice."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aliasbench.bench.hard.case import FAST, RASTERS, REFERENCE, TRACERS, HardCase, Verdict, samples_key, with_keys
from aliasbench.bench.hard.edge_pictures import (
    DEPTH,
    EXACT,
    FINEST,
    FPS,
    HALF_ULP,
    REFERENCE_ROUNDING,
    TRAVEL,
    Stage,
    edge_bound,
    farthest,
    label,
    ray_bound,
    stages,
    worst_of,
)
from aliasbench.bench.hard.edges import RIM, fan
from aliasbench.bench.hard.ownership import distance_to_outline, pixel_points
from aliasbench.renderers.catalog import render
from aliasbench.scenes.model import FloatArray, Surface
from aliasbench.scenes.shapes import mesh, polygon

SIDE, CELL = 112, 4  # px: a picture, and the cells of the mesh in it, all corners of which are at centres
ROUGH = 0.05  # world units: by how much the mesh's vertices differ in depth
BESIDE = (0.0, 2.0**-24, 2.0**-22, 2.0**-20, 2.0**-18, 2.0**-16, 2.0**-13, 2.0**-10)
FILMS = 16  # samples a pixel where coverages are summed
SEEDS = 4
RULE = "neighbours have the same snapped vertices, and a sample on an edge belongs to one of them by rule"


def relief(stage: Stage, beside: float) -> Surface:
    """Return a bumpy mesh of two triangles a cell that covers the picture, moved off the centres by `beside` px."""
    rng = np.random.default_rng(5)
    at = np.arange(-1, SIDE // CELL + 2) * CELL + 0.5
    n = len(at)
    points = np.stack(np.meshgrid(at, at), axis=-1).reshape(-1, 2) + np.array([beside, 0.7 * beside])
    depth = DEPTH + ROUGH * rng.random(n * n)
    i = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    turned = (rng.random(len(i)) < 0.5)[:, None]
    first = np.where(turned, np.stack([i, i + 1, i + n], axis=1), np.stack([i, i + 1, i + n + 1], axis=1))
    second = np.where(turned, np.stack([i + 1, i + n + 1, i + n], axis=1), np.stack([i, i + n + 1, i + n], axis=1))
    return mesh(stage.place(points, depth), np.concatenate([first, second]), motion=stage.motion)


def _on_vertices() -> NDArray[np.bool_]:
    """Return (side, side): which centres are beside a vertex; three in four of the others are beside an edge."""
    rows, columns = np.indices((SIDE, SIDE))
    out: NDArray[np.bool_] = (rows % CELL == 0) & (columns % CELL == 0)
    return out


def _gaps(subject: str, *, vertices: bool) -> Verdict:
    aimed = _on_vertices() if vertices else ~_on_vertices()
    found = []
    for stage in stages((SIDE, SIDE)):
        if subject == REFERENCE:
            text = with_keys(subject, "time=center" if stage.moving else "")
            pixels = render(stage.scene(relief(stage, 0.0)), text, size=stage.size, frame=stage.frame).pixels[..., 0]
            error = float(np.abs(pixels - 1.0)[aimed].max())
            why = "the areas of a pixel's parts sum to one; float64 leaves some tens of roundings"
            found.append(Verdict(error, "contrast", REFERENCE_ROUNDING, REFERENCE_ROUNDING, why, note=label(stage)))
            continue
        missed, widest, bound = 0, 0.0, 0.0
        for beside in BESIDE:
            surface = relief(stage, beside)
            pixels = render(stage.scene(surface), subject, size=stage.size, frame=stage.frame).pixels[..., 0]
            lost = (pixels == 0.0) & aimed
            missed += int(lost.sum())
            if lost.any():
                off = beside * np.hypot(1.0, 0.7) if vertices else float(_from_edges(stage, surface, lost).max())
                widest = max(widest, off, FINEST)
            if subject == FAST or (vertices and subject in TRACERS):
                bound = max(bound, ray_bound(subject, stage, [surface]))
        count = int(aimed.sum()) * len(BESIDE)
        note = f"{label(stage)}; {missed} of {count} samples see through, 0 to {BESIDE[-1]:.0e} px beside"
        found.append(Verdict(widest, "px", 0.0, bound, _why_gaps(subject, vertices), note=note))
    return worst_of(found)


def _from_edges(stage: Stage, surface: Surface, lost: NDArray[np.bool_]) -> FloatArray:
    """Return (n,): how far the lost samples are from the nearest side of any triangle of `relief`, in px."""
    moved = np.asarray(stage.motion.velocity) * ((stage.frame + 0.5) / FPS if stage.moving else 0.0)
    rows, columns = np.nonzero(lost)
    cells = SIDE // CELL + 2
    around = (np.arange(-1, 2)[:, None] * cells + np.arange(-1, 2)).ravel()
    near = ((rows // CELL + 1) * cells + columns // CELL + 1)[:, None] + around
    triangles = surface.triangles[np.concatenate([near, near + cells**2], axis=1)]
    corners = stage.view.project(surface.vertices + moved)[triangles][..., :2]
    side = np.roll(corners, -1, axis=2) - corners
    from_corner = (np.stack([columns, rows], axis=1) + 0.5)[:, None, None] - corners
    along = np.clip((from_corner * side).sum(axis=-1) / (side * side).sum(axis=-1), 0.0, 1.0)
    out: FloatArray = np.linalg.norm(from_corner - along[..., None] * side, axis=-1).min(axis=(1, 2))
    return out


def _why_gaps(subject: str, vertices: bool) -> str:
    if subject in RASTERS:
        return RULE
    if subject == FAST:
        return (
            "Embree's fast test rounds an edge in each of its two triangles on its own, by up to this much; a sample "
            "between both is in neither"
        )
    if vertices:
        return (
            "Embree's robust test rounds all edges about a vertex alike in both neighbours, but each on its own: their "
            "signs may disagree within this much of the vertex, and then no triangle is hit"
        )
    return "Embree's robust test computes an edge of two triangles alike, with opposite signs: one of them is hit"


def _edge_parts(subject: str) -> Verdict:
    size = (24, 16)
    found = []
    for stage in stages(size, ("orthographic", "perspective")):
        widest, wrong, extent, bound, why = 0.0, 0, float(size[0]), 0.0, ""
        for beside in (0.0, 2.0**-20, 2.0**-16, 2.0**-12):
            hub = (12.5 + beside, 8.5 - beside / 2)
            outlines = fan(hub)
            parts = [polygon(stage.place(outline), motion=stage.motion) for outline in outlines]
            text = with_keys(subject, "time=center" if subject == REFERENCE and stage.moving else "")
            owners = sum(
                render(stage.scene(part), text, size=size, frame=stage.frame).pixels[..., 0].astype(np.float64)
                for part in parts
            )
            inner = _inner(size, hub)
            if subject == REFERENCE:
                widest = max(widest, float(np.abs(owners - 1.0)[inner].max()))
                continue
            points = pixel_points(size)
            distance = np.min([distance_to_outline(points, o) for o in outlines], axis=0).reshape(size[::-1])
            bad = (owners != 1.0) & inner
            wrong += int(bad.sum())
            widest = max(widest, farthest(distance, bad))
            part_bound, why = (0.0, RULE) if subject in RASTERS else edge_bound(subject, stage, parts, extent=extent)
            bound = max(bound, part_bound)
        if subject == REFERENCE:
            why = "the areas of a pixel's parts sum to one; float64 leaves some tens of roundings"
            found.append(Verdict(widest, "contrast", REFERENCE_ROUNDING, REFERENCE_ROUNDING, why, note=label(stage)))
            continue
        note = f"{label(stage)}; {wrong} of {4 * int(inner.sum())} samples have another number of owners than one"
        found.append(Verdict(widest, "px", 0.0, bound, why, note=note))
    return worst_of(found)


def _inner(size: tuple[int, int], hub: tuple[float, float], margin: float = 1.0) -> NDArray[np.bool_]:
    """Return (h, w): which pixels lie within the fan's rim by a margin, in px."""
    half = np.abs(np.array(RIM)).max(axis=0) - margin - 0.5
    away = np.abs(pixel_points(size) - hub)
    out: NDArray[np.bool_] = (away <= half).all(axis=1).reshape(size[::-1])
    return out


def _coverage_sums(subject: str) -> Verdict:
    size = (24, 16)
    hub = (12.37, 8.71)
    found = []
    for stage in stages(size):
        outlines = fan(hub)
        parts = [polygon(stage.place(outline), motion=stage.motion) for outline in outlines]
        inner = _inner(size, hub, 1.0 + 2.0 * stage.moving)
        if subject == REFERENCE:
            why = "the areas of a pixel's parts sum to one; float64 leaves some tens of roundings"
            error, certified = _sum_error(subject, stage, parts, inner, seed=0)
            bound = max(REFERENCE_ROUNDING, certified)
            found.append(Verdict(error, "contrast", REFERENCE_ROUNDING, bound, why, note=label(stage)))
            continue
        rounding = (len(parts) + 1) * HALF_ULP
        raster = subject in RASTERS
        text = samples_key(subject, FILMS, "sampler=jittered" if raster else "sampler=jittered,pattern=shared")
        close = 0.0 if raster else ray_bound(subject, stage, parts)
        error, worst_share = 0.0, 0.0
        for seed in range(SEEDS):
            error = max(error, _sum_error(text, stage, parts, inner, seed=seed)[0])
            worst_share = 0.0 if raster else max(worst_share, _near_share(stage, outlines, close, inner, seed))
        if raster and not stage.moving:
            # also with the hub on the grid of subpixels, edges through hardware samples
            for at in (hub, (12.375, 8.625)):
                exact = [polygon(stage.place(o)) for o in fan(at)]
                error = max(error, _sum_error(with_keys(subject, "msaa=4"), stage, exact, inner, seed=0)[0])
        rounded = f"{len(parts)} float32 means and their sum are rounded"
        why = f"{RULE}; {rounded}"
        if not raster:
            why = (
                f"of {FILMS} samples at known places only those within {close:.1e} px of an edge may have another "
                f"number of owners than one; {rounded}"
            )
        note = f"{label(stage)}; {SEEDS} seeds"
        found.append(Verdict(error, "contrast", rounding, rounding + worst_share, why, note=note))
    return worst_of(found)


def _sum_error(
    text: str, stage: Stage, parts: Sequence[Surface], inner: NDArray[np.bool_], *, seed: int
) -> tuple[float, float]:
    """Return by how much the coverages of the parts, one by one, miss one in sum, and what a reference certifies."""
    total, certified = np.zeros(inner.shape), 0.0
    for part in parts:
        shown = render(stage.scene(part), text, size=stage.size, frame=stage.frame, seed=seed)
        total += shown.pixels[..., 0].astype(np.float64)
        certified += shown.uncertainty or 0.0
    return float(np.abs(total - 1.0)[inner].max()), certified


def _near_share(
    stage: Stage, outlines: Sequence[FloatArray], close: float, inner: NDArray[np.bool_], seed: int
) -> float:
    """Return the largest share of a pixel's samples that are within `close` px of an edge when they are taken."""
    from aliasbench.renderers.sampling.patterns import sample_set

    count = np.zeros(inner.shape)
    for x, y, time in sample_set("jittered", FILMS, seed=seed, frame=stage.frame)[:, :3]:
        moved = (time - 0.5) * np.array(TRAVEL) if stage.moving else np.zeros(2)
        points = pixel_points(stage.size, x, y)
        distance = np.min([distance_to_outline(points, o + moved) for o in outlines], axis=0)
        count += (distance <= max(close, EXACT)).reshape(count.shape)
    return float(count[inner].max()) / FILMS


CASES = (
    HardCase(
        "shared-edges",
        "edges",
        "A bumpy mesh of 1568 triangles fills the picture; its edges run through pixel centres, or pass them by 2^-24 "
        "to 2^-10 px.",
        "No sample but those at vertices sees through: how far from an edge is the worst that does? The reference: by "
        "how much is the covered area not one?",
        lambda subject: _gaps(subject, vertices=False),
    ),
    HardCase(
        "shared-vertices",
        "edges",
        "The same mesh, its 784 vertices at pixel centres or 2^-24 to 2^-10 px beside them.",
        "No sample at a vertex sees through: how far from it is the worst that does? The reference: by how much is the "
        "covered area not one?",
        lambda subject: _gaps(subject, vertices=True),
    ),
    HardCase(
        "edge-parts",
        "edges",
        "The triangles of a fan, whose edges run through pixel centres or 2^-20 to 2^-12 px beside, are rendered one "
        "by one.",
        "Every sample has exactly one owner: how far from an edge is the worst that has none or two? The reference: by "
        "how much do areas not sum to one?",
        _edge_parts,
    ),
    HardCase(
        "coverage-sums",
        "edges",
        "The triangles of a fan are rendered one by one, at rest and on the move, with 16 samples a pixel and with "
        "hardware samples.",
        "By how much do a pixel's coverages not sum to one?",
        _coverage_sums,
    ),
)
