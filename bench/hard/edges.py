"""Edges exactly where samples are, or closer to them than number formats can tell: on which side is a sample found?"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from aliasbench.bench.hard.case import FAST, RASTERS, REFERENCE, HardCase, Verdict, with_keys
from aliasbench.bench.hard.edge_pictures import (
    EXACT,
    FPS,
    REFERENCE_ROUNDING,
    Look,
    Stage,
    coverage,
    edge_bound,
    label,
    misplacements,
    stages,
    worst_of,
)
from aliasbench.bench.hard.ownership import pixel_points
from aliasbench.renderers.catalog import prepare, render
from aliasbench.scenes.model import FloatArray, Surface
from aliasbench.scenes.shapes import polygon

WHITE = (1.0, 1.0, 1.0)
TIES = "a sample exactly on an edge may have either side's colour"
SAMPLED = "No sample may have to be moved to see the colour that it has: by how many pixels must the worst one be?"
COVERED = "the reference: by how much is a pixel's covered area wrong?"


def bars(steps: Sequence[float], length: float, *, upright: bool) -> list[FloatArray]:
    """Return outlines of bars 2 px wide whose edges are beside every other centre by the steps, two for each bar."""
    out = []
    for k, (near, far) in enumerate(zip(steps[::2], steps[1::2], strict=True)):
        a, b = 4 * k + 0.5 + near, 4 * k + 2.5 + far
        bar = np.array([(a, -3.0), (b, -3.0), (b, length + 3.0), (a, length + 3.0)])
        out.append(bar if upright else bar[:, ::-1])
    return out


def surfaces(stage: Stage, looks: Sequence[Look]) -> list[Surface]:
    """Return the polygons that look like this in the picture."""
    return [polygon(stage.place(o), color=look.color, motion=stage.motion) for look in looks for o in look.outlines]


def _judge(
    subject: str,
    stage: Stage,
    looks: Sequence[Look],
    *,
    objects: Sequence[Surface] | None = None,
    visible: Sequence[Surface] | None = None,
    aligned: bool = False,
) -> Verdict:
    """Return the verdict on one centred sample a pixel; of the reference, on its areas instead."""
    objects = surfaces(stage, looks) if objects is None else objects
    scene = stage.scene(*objects)
    if subject == REFERENCE:
        text = with_keys(subject, "time=center" if stage.moving else "")
        pixels = render(scene, text, size=stage.size, frame=stage.frame).pixels
        truth = np.zeros((stage.size[1], stage.size[0], 3))
        for look in looks:
            for outline in () if look.hidden else look.outlines:
                truth += coverage(outline, stage.size)[..., None] * np.asarray(look.color)
        error = float(np.abs(pixels - truth).max())
        why = "float64 throughout: some tens of roundings of coordinates of some hundred pixels"
        return Verdict(error, "contrast", REFERENCE_ROUNDING, REFERENCE_ROUNDING, why, note=label(stage))
    visible = objects if visible is None else visible
    pixels = render(scene, subject, size=stage.size, frame=stage.frame).pixels
    away = misplacements(pixels, pixel_points(stage.size), looks, seams(subject, stage, visible))
    extent = max(float(np.abs(o).max()) for look in looks for o in look.outlines)
    bound, why = edge_bound(subject, stage, visible, extent=extent, aligned=aligned)
    note = f"{label(stage)}; {int((away > EXACT).sum())} of {away.size} samples wrong; {TIES}"
    return Verdict(float(away.max()), "px", EXACT, max(bound, EXACT), why, note=note)


def seams(subject: str, stage: Stage, objects: Sequence[Surface]) -> list[FloatArray]:
    """Return the triangles' outlines in px where a subject is known to let rays through between triangles."""
    if subject != FAST:
        return []
    moved = np.asarray(stage.motion.velocity) * ((stage.frame + 0.5) / FPS if stage.moving else 0.0)
    return [stage.view.project(s.vertices[t] + moved)[:, :2] for s in objects for t in s.triangles]


def _ladder(least: int, most: int) -> list[float]:
    """Return the steps 0, 0 and then 2^-k px to either side."""
    return [0.0, 0.0, *(sign * 2.0**-k for k in range(least, most) for sign in (1.0, -1.0))]


def _centre_edges(subject: str) -> Verdict:
    steps = _ladder(6, 25)
    long, short = 2 * len(steps), 4
    found = []
    for upright, size in ((True, (long, short)), (False, (short, long))):
        look = Look(WHITE, bars(steps, short, upright=upright))
        found += [_judge(subject, stage, [look], aligned=True) for stage in stages(size)]
    return worst_of(found)


def _border_edges(subject: str) -> Verdict:
    size = (16, 12)
    outlines = [np.array([(a, b), (a + 3.0, b), (a + 3.0, b + 4.0), (a, b + 4.0)]) for a in (2.0, 9.0) for b in (1, 7)]
    look = Look(WHITE, outlines)
    here = [stage for stage in stages(size) if not stage.moving]
    if subject == REFERENCE:
        return worst_of([_judge(subject, stage, [look]) for stage in here])
    found = []
    for stage in here:
        objects = surfaces(stage, [look])
        bound, why = edge_bound(subject, stage, objects, extent=float(size[0]), aligned=True)
        keys = "sampler=random" if subject in RASTERS else "sampler=random,pattern=shared"
        worst, wrong, leaks = 0.0, 0, seams(subject, stage, objects)
        with prepare(stage.scene(*objects), with_keys(subject, keys), size=size) as prepared:
            for seed, (x, y) in _places():
                away = misplacements(prepared.render(seed=seed).pixels, pixel_points(size, x, y), [look], leaks)
                worst, wrong = max(worst, float(away.max())), wrong + int((away > EXACT).sum())
        many = render(stage.scene(*objects), with_keys(subject, _GRID[subject in RASTERS]), size=size).pixels
        if not np.isin(many, (0.0, 1.0)).all():
            worst = max(worst, 0.125)  # what such samples are from the borders at least
        nearest = min(min(x, y, 1.0 - x, 1.0 - y) for _, (x, y) in _places())
        note = (
            f"{stage.name}; {wrong} samples wrong at {len(_places())} places, down to {nearest:.0e} px from the border"
        )
        found.append(Verdict(worst, "px", EXACT, max(bound, EXACT), why, note=note))
    return worst_of(found)


@lru_cache(maxsize=1)
def _places() -> list[tuple[int, tuple[float, float]]]:
    """Return seeds, and where in a pixel their single random sample is: anywhere, and as near to its border as any."""
    from aliasbench.renderers.sampling.patterns import sample_set

    places = np.array([sample_set("random", 1, seed=seed)[0, :2] for seed in range(_SEEDS)])
    to_border = np.minimum(places, 1.0 - places).min(axis=1)
    chosen = [*range(_PLACES), *np.argsort(to_border, kind="stable")[:_PLACES].tolist()]
    return [(seed, (float(places[seed, 0]), float(places[seed, 1]))) for seed in chosen]


_SEEDS, _PLACES = 4096, 24
_GRID = {False: "spp=16,sampler=grid", True: "passes=4,sampler=grid,msaa=4"}


def _flat_slopes(subject: str) -> Verdict:
    long, short = 256, 16
    slopes = (1e-7, -1e-7, 1e-5, -3e-4)
    found = []
    for upright, size in ((False, (long, short)), (True, (short, long))):
        outlines = []
        for k, slope in enumerate(slopes):
            a, b = (4 * k + 0.5 + slope * (end - 128.3) for end in (-2.0, 258.0))
            strip = np.array([(-2.0, a), (258.0, b), (258.0, b + 2.0), (-2.0, a + 2.0)])
            outlines.append(strip[:, ::-1] if upright else strip)
        found += [_judge(subject, stage, [Look(WHITE, outlines)]) for stage in stages(size)]
    return worst_of(found)


# Of a fan about (0, 0); all spokes go through centres of pixels if the hub is one.
RIM = ((8.0, 0.0), (8.0, 4.0), (0.0, 4.0), (-8.0, 4.0), (-8.0, 0.0), (-8.0, -4.0), (0.0, -4.0), (8.0, -4.0))


def fan(hub: tuple[float, float]) -> list[FloatArray]:
    """Return the outlines of eight triangles about a hub, in px."""
    return [np.array([(0.0, 0.0), a, b]) + hub for a, b in zip(RIM, [*RIM[1:], RIM[0]], strict=True)]


def _fan_vertex(subject: str) -> Verdict:
    size = (24, 16)
    found = []
    for beside in (0.0, 2.0**-20, -(2.0**-16), 2.0**-12):
        parts = fan((12.5 + beside, 8.5 - beside / 2))
        looks = [Look((1.0, (k + 1) / 8, (k * 3 % 8) / 8), [part]) for k, part in enumerate(parts)]
        found += [_judge(subject, stage, looks) for stage in stages(size)]
    return worst_of(found)


DEPTH_BEHIND = 6.5


def _edge_on_mesh(subject: str) -> Verdict:
    """Closed prisms whose sides lie along the rays; of each only the front may be seen."""
    size = (48, 16)
    turns = np.arange(12) / 12 * 2 * np.pi
    fronts = [
        np.array([(3.5, 3.5), (10.5, 3.5), (10.5, 12.25), (3.5, 12.25)]),
        np.array([(20.5, 2.5), (26.5, 5.5), (23.5, 11.5), (17.5, 8.5)]),
        np.stack([36.5 + 5.0 * np.cos(turns), 8.5 + 5.0 * np.sin(turns)], axis=1),
        # a plate thinner than a rasterizer's grid, around a row of centres
        np.array([(-9.0, 14.5 - 2.0**-12), (57.0, 14.5 - 2.0**-12), (57.0, 14.5 + 2.0**-12), (-9.0, 14.5 + 2.0**-12)]),
    ]
    sides_color, back_color = (0.5, 0.25, 0.0), (0.0, 0.25, 0.5)
    found = []
    for stage in stages(size):
        visible, others = [], []
        for outline in fronts:
            near, far = stage.place(outline), stage.place(outline, DEPTH_BEHIND)
            visible.append(polygon(near, color=WHITE, motion=stage.motion))
            others.append(polygon(far[::-1], color=back_color, motion=stage.motion))
            for k in range(len(outline)):
                n = (k + 1) % len(outline)
                corners = np.array([near[n], near[k], far[k], far[n]])
                others.append(polygon(corners, color=sides_color, motion=stage.motion))
        looks = [
            Look(WHITE, fronts),
            Look(sides_color, fronts, hidden=True),
            Look(back_color, fronts, hidden=True),
        ]
        found.append(_judge(subject, stage, looks, objects=[*others, *visible], visible=visible))
    return worst_of(found)


CASES = (
    HardCase(
        "centre-edges",
        "edges",
        "Edges parallel to an axis go through pixel centres, or pass them by 2^-6 to 2^-24 px on either side.",
        f"{SAMPLED} Samples on an edge may be of either side; {COVERED}",
        _centre_edges,
    ),
    HardCase(
        "border-edges",
        "edges",
        "Edges lie on pixel borders: every pixel is wholly inside or outside, wherever in it the "
        "samples are, down to 6e-5 px from the border.",
        f"{SAMPLED} With 16 samples a pixel is 0 or 1; {COVERED}",
        _border_edges,
    ),
    HardCase(
        "flat-slopes",
        "edges",
        "Edges cross a row (a column) of pixel centres with a slope of 1e-7, 1e-5 or 3e-4 over 256 px.",
        f"{SAMPLED} {COVERED[0].upper()}{COVERED[1:]}",
        _flat_slopes,
    ),
    HardCase(
        "fan-vertex",
        "edges",
        "Eight triangles of eight colours meet in a vertex on a pixel's centre, or 2^-20, 2^-16, 2^-12 px beside it; "
        "their edges go through centres.",
        f"{SAMPLED} The background between neighbours is as wrong as far as the rim is; {COVERED}",
        _fan_vertex,
    ),
    HardCase(
        "edge-on-mesh",
        "edges",
        "Closed prisms are looked at exactly along their sides; one is a plate 2^-11 px thin about a row of centres.",
        f"{SAMPLED} Sides and backs may be seen nowhere but on the outline; {COVERED}",
        _edge_on_mesh,
    ),
)
