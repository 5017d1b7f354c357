"""Shapes that are hard for their own sake: slivers, triangles without area, many vertices, sizes beyond the view."""

import math
import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from aliasbench.bench.hard.case import REFERENCE, HardCase, Verdict, samples_key, with_keys
from aliasbench.bench.hard.placing import (
    BLUE,
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
    misplaced,
    moved,
)
from aliasbench.renderers.catalog import prepare, render
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.meshes import load_mesh
from aliasbench.scenes.model import FloatArray, Scene, Surface
from aliasbench.scenes.shapes import mesh, polygon

_SEEDS, _SAMPLES = 16, 16
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
    found, errors, bound = [], [], 0.0
    for power in powers:
        scene, area = sliver_hatch(10.0**-power, power)
        if subject == REFERENCE:
            frame = render(scene, subject, size=SIZE)
            found.append(abs(float(frame.pixels[..., 0].mean()) - area))
            bound = max(bound, (frame.uncertainty or 0.0) + 1e-12)
            continue
        with prepare(scene, samples_key(subject, _SAMPLES, "sampler=jittered"), size=SIZE) as prepared:
            means = [float(prepared.render(seed=k).pixels[..., 0].mean(dtype=np.float64)) for k in range(_SEEDS)]
        # of what is seldom hit 16 seeds may say too little: a hit is all or nothing, as of a random sample
        samples = SIZE[0] * SIZE[1] * _SAMPLES * _SEEDS
        error = max(float(np.std(means, ddof=1)) / math.sqrt(_SEEDS), math.sqrt(area / samples) / 2.0)
        errors.append(error)
        found.append(abs(float(np.mean(means)) - area) / error)
    if subject == REFERENCE:
        why = "its own bound, and rounding of the area compared with"
        return Verdict(max(found), "contrast", bound, bound, why)
    listed = ", ".join(f"1e-{k} px {z:.1f}" for k, z in zip(powers, found, strict=True))
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


SOUND = np.array([(-9.5, -7.5, 0.0), (10.5, -6.5, 0.0), (8.5, 8.5, 0.0), (-8.0, 7.0, 0.0)])
# without area: two corners in one vertex, in one place, three in a row; and one again in either sense
_WHISKERS = np.array(
    [(-9.5, -7.5, 0.0), (-16.5, 0.5, 0.0), (-12.5, 0.5, 0.0), (16.5, 0.5, 0.0), (-16.5, 0.5, 0.0), (0.1, 0.3, 0.0),
     (0.1 + 1.1 / 3.0, 0.3 + 0.7 / 3.0, 0.0), (1.2, 1.0, 0.0), (4.5, 11.5, 0.0), (4.5, -11.5, 0.0), (4.5, 9.5, 0.0)]
)  # fmt: skip
_TRIANGLES = [(0, 1, 2), (0, 2, 3)]
_ADDED = [(0, 1, 1), (2, 2, 2), (4, 0, 1), (5, 6, 7), (8, 5, 7), (9, 10, 11), (12, 13, 14), (0, 1, 2), (2, 1, 0)]


def _pictures(subject: str, scene: Scene, frame: int = 0) -> tuple[FloatArray, float]:
    """Return a picture as exact as the subject makes one cheaply, and its uncertainty."""
    technique = with_keys(subject, "") if subject == REFERENCE else samples_key(subject, 4)
    shown = render(scene, technique, size=SIZE, frame=frame)
    return np.asarray(shown.pixels, dtype=np.float64), shown.uncertainty or 0.0


def _alike(subject: str, pairs: Iterable[tuple[str, Scene, Scene]], why: str) -> Verdict:
    """Return by how much the second scene of each pair is shown otherwise than the first."""
    found, bound = {}, 0.0
    for name, clean, odd in pairs:
        (ours, known), (theirs, other) = (_pictures(subject, s, MOVING_FRAME) for s in (clean, odd))
        if not 0.05 < float(ours.mean()) < 0.95:
            return Verdict(math.inf, "contrast", 0.0, 0.0, why, note=f"{name}: the clean picture shows nothing")
        found[name] = float(np.abs(ours - theirs).max())
        bound = max(bound, known + other)
    listed = ", ".join(f"{name} {value:.1e}" for name, value in found.items())
    return Verdict(max(found.values()), "contrast", bound, bound, why, note=listed)


def degenerate_meshes() -> tuple[Surface, Surface]:
    """Return a mesh of two triangles, and the same with triangles without area and ones that are there twice."""
    clean = mesh(SOUND, _TRIANGLES, color=GREEN)
    return clean, mesh(np.concatenate([SOUND, _WHISKERS]), _TRIANGLES[:1] + _ADDED + _TRIANGLES[1:], color=GREEN)


def _degenerate_triangles(subject: str) -> Verdict:
    clean, odd = degenerate_meshes()
    pairs: list[tuple[str, Scene, Scene]] = []
    for projection in PROJECTIONS:
        plain, other = (Scene("mesh", camera(projection), (s,)) for s in (clean, odd))
        pairs += [(projection, plain, other), (f"{projection} turning", moved(plain), moved(other))]
    return _alike(subject, pairs, "a triangle without area covers nothing, one that is there twice covers what it did")


def _degenerate_files(subject: str) -> Verdict:
    clean, odd = degenerate_meshes()
    texts = {
        "obj": "\n".join(
            [*(f"v {x!r} {y!r} {z!r}" for x, y, z in odd.vertices.tolist()), "usemtl none"]
            + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in odd.triangles.tolist()]
        ),
        "ply": "\n".join(
            ["ply", "format ascii 1.0", f"element vertex {len(odd.vertices)}"]
            + [f"property double {axis}" for axis in "xyz"]
            + [f"element face {len(odd.triangles)}", "property list uchar int vertex_indices", "end_header"]
            + [f"{x!r} {y!r} {z!r}" for x, y, z in odd.vertices.tolist()]
            + [f"3 {a} {b} {c}" for a, b, c in odd.triangles.tolist()]
        ),
    }
    pairs = []
    with tempfile.TemporaryDirectory() as folder:
        for suffix, text in texts.items():
            path = Path(folder, f"odd.{suffix}")
            path.write_text(text + "\n")
            surfaces = load_mesh(path).surfaces
            color = surfaces[0].color
            for projection in PROJECTIONS:
                own = mesh(clean.vertices, clean.triangles, color=color)
                scenes = [Scene("mesh", camera(projection), objects) for objects in ((own,), surfaces)]
                pairs.append((f"{suffix} {projection}", scenes[0], scenes[1]))
    return _alike(subject, pairs, "a file's triangles without area, and its second copies, cover nothing more")


def _duplicate_vertices(subject: str) -> Verdict:
    """Triangles of a fan that share vertices, and the same with vertices of their own."""
    angles = 0.1 + 2.0 * np.pi * np.arange(11) / 11
    rim = np.c_[10.5 * np.cos(angles), 10.5 * np.sin(angles), np.zeros(11)]
    points = np.concatenate([[(0.5, 0.5, 0.0)], rim])
    triangles = np.array([(0, 1 + k, 1 + (k + 1) % 11) for k in range(11)])
    shared = mesh(points, triangles, color=GREEN)
    apart = mesh(points[triangles].reshape(-1, 3), np.arange(33).reshape(-1, 3), color=GREEN)
    pairs: list[tuple[str, Scene, Scene]] = []
    for projection in PROJECTIONS:
        plain, other = (Scene("fan", camera(projection), (s,)) for s in (shared, apart))
        pairs += [(projection, plain, other), (f"{projection} turning", moved(plain), moved(other))]
    verdict = _alike(subject, pairs, "vertices in one place are rounded alike, whether they are one or several")
    try:
        polygon([(0, 0, 0), (1, 0, 0), (1, 0, 0), (0, 1, 0)])
    except InputError as error:
        if "points 1 and 2 are the same" in str(error):
            return verdict
    return Verdict(1.0, "contrast", 0.0, 0.0, "a polygon that repeats a vertex is refused and names it")


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


def _many_vertices(subject: str) -> Verdict:
    still = [
        Setting(f"{name} {projection}", Scene("many", camera(projection), (flat(outline, ORANGE),)))
        for name, outline in ring_outlines().items()
        for projection in PROJECTIONS
    ]
    turning = [Setting(f"{s.name} turning", moved(s.scene), frame=MOVING_FRAME) for s in still]
    return misplaced(subject, still + turning)


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


def _huge_polygon(subject: str) -> Verdict:
    settings = [
        Setting(f"{projection} 1e{math.log10(times):.0f}", huge_scene(projection, times))
        for projection in PROJECTIONS
        for times in (1e2, 1e4, _LARGEST)
    ]
    # what float32 would misplace by more is cut in float64 first
    return misplaced(subject, settings, bound_px=2.0**-8, reach_px=2.0 * _LARGEST * SIZE[0])


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
        "degenerate-triangles",
        "shapes",
        "A mesh with triangles of no area, on lines through pixel centres, and with triangles that are there twice.",
        "The picture is the one without them.",
        _degenerate_triangles,
    ),
    HardCase(
        "degenerate-files",
        "shapes",
        "An OBJ and a PLY file with triangles of no area, triangles that are there twice, and unused vertices.",
        "The picture is the one without them.",
        _degenerate_files,
    ),
    HardCase(
        "duplicate-vertices",
        "shapes",
        "Triangles meet in vertices of their own at one place, instead of sharing one; a polygon repeats one.",
        "The picture is the one with shared vertices; the polygon is refused with the two points' numbers.",
        _duplicate_vertices,
    ),
    HardCase(
        "many-vertices",
        "shapes",
        "Polygons of 1000 corners, convex and concave, and a concave one of 280 of which most lie on straight sides.",
        SHOWN,
        _many_vertices,
    ),
    HardCase(
        "huge-polygon",
        "shapes",
        "Strips and a sheet that reach 100, 10 000 and 1 000 000 times the view's width, their edges in view.",
        "An edge is where it is to 1/256 px under rays (cut in float64), and to the rasterizer's subpixel step.",
        _huge_polygon,
    ),
)
