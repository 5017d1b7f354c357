"""Shapes that are hard for their own sake: slivers, many vertices, sizes beyond the view."""

import math
from collections.abc import Iterable
from functools import lru_cache

import numpy as np

from aliasbench.bench.hard.case import RASTERS, REFERENCE, RENDERERS, HardCase, Verdict, samples_key, with_keys
from aliasbench.bench.hard.edge_pictures import worst_of
from aliasbench.bench.hard.painting import SNAPPED, SNAPPED_PX, TIE_PX, paint
from aliasbench.bench.hard.placing import (
    BLUE,
    CUT,
    CUT_PX,
    GREEN,
    MOVING_FRAME,
    ORANGE,
    PROJECTIONS,
    SHOWN,
    SIZE,
    Projection,
    Setting,
    camera,
    flat,
    flown,
    misplaced,
    moved,
)
from aliasbench.bench.hard.rays import WHY, ray_bound
from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.sampling.patterns import sample_set
from aliasbench.scenes.model import FloatArray, Scene
from aliasbench.scenes.shapes import mesh

_SEEDS, _SAMPLES, _INSTANTS = 16, 16, 16
_MORE = {5: 4, 6: 16}  # times as many samples of what is hardly ever hit: some 200 hits are expected at least
_MOST_ERRORS = 4.5  # standard errors, of 15 degrees of freedom: one in 2400 by chance, and no seed here is chance
_LARGEST = 1e6  # times the view


def sliver_hatch(width: float, seed: int) -> tuple[Scene, float]:
    """Return parallel needles of a mean width in px across the picture, and the share of the picture they cover."""
    rng = np.random.default_rng(seed)
    room = SIZE[0] - 14.0
    count = int(min(2000, 0.2 * room / width))  # none touches the next: a base is twice the mean width
    lean = np.array([math.sin(0.37), math.cos(0.37)])
    across = np.array([lean[1], -lean[0]])
    # not even: a step that the pixels' own has a common measure with would be seen as often by all samples of a pass
    step = room / count
    at = (np.arange(count) + rng.uniform(0.3, 0.7, count)) * step - room / 2.0
    length = SIZE[1] - 2.0
    tip = np.where(rng.uniform(size=count) < 0.5, -0.5, 0.5)
    middle = np.stack([at, np.zeros(count)], axis=1)
    ends = middle - tip[:, None] * length * lean
    corners = np.stack([middle + tip[:, None] * length * lean, ends - width * across, ends + width * across], axis=1)
    area = width * length * count
    points = np.concatenate([corners, np.zeros((count, 3, 1))], axis=2).reshape(-1, 3)
    surface = mesh(points, np.arange(3 * count).reshape(-1, 3))
    return Scene("slivers", camera("orthographic"), (surface,)), area / (SIZE[0] * SIZE[1])


def _sliver_light(subject: str, powers: Iterable[int] = range(1, 7)) -> Verdict:
    """The light of needles 1e-1 to 1e-6 px wide: the mean of 16 seeds against their area."""
    found, errors, shares, bound = [], [], [], 0.0
    for power in powers:
        scene, area = sliver_hatch(10.0**-power, power)
        if subject == REFERENCE:
            frame = render(scene, subject, size=SIZE)
            found.append(abs(float(frame.pixels[..., 0].mean()) - area))
            bound = max(bound, (frame.uncertainty or 0.0) + 1e-12)
            continue
        count = _SAMPLES * _MORE.get(power, 1)
        with prepare(scene, samples_key(subject, count, "sampler=jittered"), size=SIZE) as prepared:
            means = [float(prepared.render(seed=k).pixels[..., 0].mean(dtype=np.float64)) for k in range(_SEEDS)]
        # of what is seldom hit 16 seeds may say too little: a hit is all or nothing, as of a random sample
        samples = SIZE[0] * SIZE[1] * count * _SEEDS
        error = max(float(np.std(means, ddof=1)) / math.sqrt(_SEEDS), math.sqrt(area / samples) / 2.0)
        errors.append(error)
        shares.append(error / area)
        found.append(abs(float(np.mean(means)) - area) / error)
    if subject == REFERENCE:
        why = "its own bound, and rounding of the area compared with"
        return Verdict(max(found), "contrast", bound, bound, why)
    listed = ", ".join(
        f"1e-{k} px {z:.1f} (each {s:.1%} of the light)" for k, z, s in zip(powers, found, shares, strict=True)
    )
    why = "samples are unbiased whatever the width: only chance is left, 4.5 standard errors of 16 seeds"
    return Verdict(max(found), "standard errors", _MOST_ERRORS, _MOST_ERRORS, why, max(errors), listed)


def sliver_settings() -> list[Setting]:
    """Return slivers of all widths: some with pixel centres along their middle, some just beside, level and leaning."""
    objects = []
    for power in range(1, 7):
        width = 10.0**-power
        for k, (y, off) in enumerate(((3.5 * power - 13.0, 0.0), (3.5 * power - 11.5, 0.5 + 1e-3))):
            y = math.floor(y) + 0.5 + off * width
            color = ORANGE if (power + k) % 2 else BLUE
            objects.append(flat([(-15.25, y - width / 2), (-1.25, y - width / 2), (-1.25, y + width / 2)], color))
            ends = np.array([[2.5, y], [14.5, y + 3.0]])
            normal = width / 2 * np.array([-3.0, 12.0]) / math.hypot(12.0, 3.0)
            objects.append(flat([*(ends - normal), *(ends[::-1] + normal)], color))
    still = [Setting(p, Scene("slivers", camera(p), tuple(objects))) for p in PROJECTIONS]
    return still + [Setting(f"{s.name} turning", moved(s.scene), frame=MOVING_FRAME) for s in still]


def _sliver_samples(subject: str) -> Verdict:
    return misplaced(subject, sliver_settings())


def ring_outlines() -> dict[str, FloatArray]:
    """Return outlines (n, 2): a circle of 1000 corners, a concave star of 1000, and one with corners in a row."""
    angles = 2.0 * np.pi * np.arange(1000) / 1000
    circle = np.c_[np.cos(angles), np.sin(angles)]
    radius = np.where(np.arange(1000) % 2, 10.5, 7.0 + 2.0 * np.sin(5.0 * angles))
    corners = np.array(
        [(-12.5, -9.5), (13.0, -9.5), (13.0, -2.5), (1.5, -1.0), (12.0, 9.0), (-12.5, 7.5), (-6.5, -1.5)]
    )
    shares = np.linspace(0.0, 1.0, 40, endpoint=False)[:, None]
    rows = np.concatenate([a + shares * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])
    return {"circle": 10.7 * circle, "star": radius[:, None] * circle, "rows": rows}


@lru_cache(maxsize=1)
def ring_settings() -> list[Setting]:
    """Return the rings, still and turning."""
    still = [
        Setting(f"{name} {projection}", Scene("many", camera(projection), (flat(outline, ORANGE),)))
        for name, outline in ring_outlines().items()
        for projection in PROJECTIONS
    ]
    turning = [Setting(f"{s.name} turning", moved(s.scene), frame=MOVING_FRAME) for s in still]
    return still + turning


def _many_vertices(subject: str) -> Verdict:
    return misplaced(subject, ring_settings(), aim=1)


def huge_scene(projection: Projection, times: float) -> Scene:
    """Return strips that cross the view and reach `times` its width far, each at another angle."""
    objects = []
    for k in range(12):
        angle = 0.23 + 0.52 * k
        along = np.array([math.cos(angle), math.sin(angle)])
        across = np.array([-along[1], along[0]])
        near, reach = (2.0 + 0.83 * k) * across, times * SIZE[0]
        outline = [near - reach * along, near + 0.77 * reach * along, near + across + 0.8 * reach * along,
                   near + 0.7 * across - 0.9 * reach * along]  # fmt: skip
        objects.append(flat(np.array(outline), (ORANGE, BLUE, GREEN)[k % 3]))
    sheet = times * SIZE[0] * np.array([(-0.9, -1.0), (1.0, -0.8), (0.7, 1.0), (-1.0, 0.6)])
    return Scene("huge", camera(projection), (flat(sheet, (0.1, 0.1, 0.1)), *objects))


@lru_cache(maxsize=2)
def huge_settings(most: float = _LARGEST) -> list[Setting]:
    """Return scenes that reach 100 to `most` times the view's width, still, turning, and with a camera that flies."""
    out = []
    for projection in PROJECTIONS:
        for times in (1e2, 1e4, _LARGEST):
            if times <= most:
                name, scene = f"{projection} 1e{math.log10(times):.0f}", huge_scene(projection, times)
                out.append(Setting(name, scene))
                out.append(Setting(f"{name} turning", moved(scene), frame=MOVING_FRAME))
                out.append(Setting(f"{name} flying", flown(scene, (0.5, 0.25, -4.0)), frame=MOVING_FRAME))
    return out


def _huge_polygon(subject: str) -> Verdict:
    return misplaced(subject, huge_settings(), aim=1, cut=True, reach_px=2.0 * _LARGEST * SIZE[0])


def _huge_exposed(subject: str) -> Verdict:
    """Samples at other places and times, one of each a picture, while the shutter is open."""
    found = []
    for setting in huge_settings():
        scene, wrong, worst = setting.scene, 0, 0.0
        if scene.is_static:
            continue
        keys = "sampler=random" if subject in RASTERS else "sampler=random,pattern=shared"
        with prepare(scene, with_keys(subject, keys), size=SIZE) as prepared:
            for seed in range(_INSTANTS):
                x, y, time = sample_set("random", 1, seed=seed, frame=setting.frame)[0, :3]
                shown = prepared.render(frame=setting.frame, seed=seed).pixels
                painting = paint(scene, SIZE, frame=setting.frame, fraction=time * scene.animation.shutter)
                apart = painting.apart(shown, x, y)
                worst, wrong = max(worst, float(apart.max())), wrong + int((apart > 0.0).sum())
        if subject in RASTERS:
            bound, why = SNAPPED_PX, SNAPPED
        else:
            bound, why = ray_bound(scene, SIZE, frame=setting.frame, fraction=setting.fraction), WHY
            if bound > CUT_PX:
                bound, why = CUT_PX, f"{CUT}; {WHY}"
        found.append(Verdict(worst, "px", TIE_PX, bound, why, note=f"{setting.name}; {wrong} samples off"))
    return worst_of(found)


CASES = (
    HardCase(
        "sliver-light",
        "shapes",
        "2000 needles in a row, 1e-1 to 1e-6 px wide: most samples miss every one of them.",
        "The mean over 16 seeds of jittered samples is the needles' area, within 4.5 standard errors for each width.",
        _sliver_light,
    ),
    HardCase(
        "sliver-samples",
        "shapes",
        "Slivers 1e-1 to 1e-6 px wide along pixel centres or a thousandth of their width beside them.",
        SHOWN,
        _sliver_samples,
    ),
    HardCase(
        "many-vertices",
        "shapes",
        "Polygons of 1000 corners, convex and concave, and a concave one of 280 of which most lie on straight sides; "
        "edges also 2^-10 to 2^-22 px from samples.",
        SHOWN,
        _many_vertices,
    ),
    HardCase(
        "huge-polygon",
        "shapes",
        "Strips and a sheet that reach 100, 10 000 and 1 000 000 times the view's width, their edges in view "
        "and also 2^-10 to 2^-22 px from samples; still, turning, and with a camera that flies.",
        "An edge is where it is to the rounding of parts cut in float64 under rays, or to a rasterizer's subpixel.",
        _huge_polygon,
    ),
    HardCase(
        "huge-polygon-exposed",
        "shapes",
        "The same strips turn, or the camera flies by, while the shutter is open: pictures of samples at 16 instants.",
        "A sample shows what is there at its instant. The reference has no samples: it is asked in huge-polygon.",
        _huge_exposed,
        RENDERERS,
    ),
)
