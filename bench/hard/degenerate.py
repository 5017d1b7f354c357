"""Triangles that add nothing: without area, there twice, or with vertices of their own where others have theirs."""

import math
import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from aliasbench.bench.hard.case import REFERENCE, HardCase, Verdict, samples_key, with_keys
from aliasbench.bench.hard.edge_pictures import worst_of
from aliasbench.bench.hard.placing import (
    GREEN,
    MOVING_FRAME,
    PROJECTIONS,
    SIZE,
    Setting,
    camera,
    flat,
    misplaced,
    moved,
)
from aliasbench.renderers.catalog import render
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.meshes import load_mesh
from aliasbench.scenes.model import FloatArray, Scene, Surface
from aliasbench.scenes.shapes import mesh, polygon

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
    alike = _alike(subject, pairs, "a triangle without area covers nothing, one that is there twice covers what it did")
    if subject == REFERENCE:
        return alike
    # their lines go through pixel centres: what is seen there is the sound polygon
    settings = []
    for projection in PROJECTIONS:
        scene, truth = (Scene("mesh", camera(projection), (s,)) for s in (odd, flat(SOUND[:, :2], GREEN)))
        settings.append(Setting(projection, scene, truth=truth))
        settings.append(Setting(f"{projection} turning", moved(scene), truth=moved(truth), frame=MOVING_FRAME))
    return worst_of([misplaced(subject, settings), alike])


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


CASES = (
    HardCase(
        "degenerate-triangles",
        "shapes",
        "A mesh with triangles of no area, on lines through pixel centres, and with triangles that are there twice.",
        "The picture is the one without them, and samples at pixel centres show the sound polygon alone.",
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
)
