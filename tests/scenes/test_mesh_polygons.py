"""Faces of any number of corners are covered once by their triangles, wound as they are, convex or not."""

from pathlib import Path

import numpy as np
import pytest

from aliasbench.scenes.mesh_polygons import cut_faces
from aliasbench.scenes.meshes import load_mesh

ARROW = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (1, 0.2, 0), (0, 2, 0)]  # a square of 4 less a triangle of 1.8
DART = [(0, 0, 0), (2, 1, 0), (0, 2, 0), (0.5, 1, 0)]


def areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the area vectors (m, 3) of triangles."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a) / 2


def outline_area(points: np.ndarray) -> np.ndarray:
    return np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0) / 2


@pytest.mark.parametrize("size", [1e-30, 1.0, 1e11])
def test_stars_of_all_counts_are_covered_once_and_keep_their_winding(size: float) -> None:
    rng = np.random.default_rng(5)
    faces = []
    for k in range(300):
        count = int(rng.integers(3, 12))
        # About its centre a star turns once, whatever its radii: simple, and mostly concave.
        angle = 2 * np.pi * (np.arange(count) + rng.uniform(0, 0.6, count)) / count * (1 if k % 2 else -1)
        radius = rng.uniform(0.1, 1.0, count)
        flat = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(count)], axis=1)
        axes = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        faces.append((flat @ axes + rng.standard_normal(3)) * size)
    counts = np.array([len(face) for face in faces])
    points, corners = np.concatenate(faces), np.arange(counts.sum())
    owner = np.repeat(np.arange(len(faces)), counts)
    triangles = cut_faces(corners, counts, points)
    assert (owner[triangles] == owner[triangles[:, :1]]).all()
    found = areas(points / size, triangles)
    for k, face in enumerate(faces):
        own = found[owner[triangles[:, 0]] == k]
        wanted = outline_area(face / size - face[0] / size)
        assert len(own) == len(face) - 2
        np.testing.assert_allclose(own.sum(axis=0), wanted, atol=1e-9)
        # None of them is turned over: then the areas' lengths add up as the vectors do.
        assert np.linalg.norm(own, axis=1).sum() == pytest.approx(np.linalg.norm(wanted), rel=1e-9)


@pytest.mark.parametrize("first", range(5))
@pytest.mark.parametrize("kind", ["obj", "ply"])
def test_a_concave_face_of_a_file_has_its_area_whatever_corner_is_first(tmp_path: Path, kind: str, first: int) -> None:
    turned = np.roll(np.arange(5), first).tolist()
    rows = [" ".join(map(str, p)) for p in ARROW]
    path = tmp_path / f"a.{kind}"
    if kind == "obj":
        path.write_text("".join(f"v {row}\n" for row in rows) + "f " + " ".join(str(k + 1) for k in turned) + "\n")
    else:
        head = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
        head += "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
        path.write_text(head + "\n".join([*rows, "5 " + " ".join(map(str, turned)), "3 0 1 1"]) + "\n")
    (surface,) = load_mesh(path).surfaces
    lengths = np.linalg.norm(areas(surface.vertices, surface.triangles), axis=1)
    assert lengths.sum() == pytest.approx(2.2)


def test_bent_faces_and_those_that_cross_themselves_are_cut_somehow() -> None:
    bent = np.array(DART, float) + [(0, 0, z) for z in (0.3, 0, 0.3, 0)]
    triangles = cut_faces(np.arange(4), np.array([4]), bent)
    # Seen from above, the dart; neither triangle is turned over.
    above = areas(bent, triangles)[:, 2]
    assert above.tolist() == pytest.approx([0.75, 0.75])
    bow = np.array([(0, 0, 0), (1, 1, 0), (1, 0, 0), (0, 1.5, 0)], float)
    same = np.zeros((4, 3))
    for points in (bow, same, bow * np.nan, bow * 1e300):
        assert cut_faces(np.arange(4), np.array([4]), points).tolist() == [[0, 1, 2], [0, 2, 3]]
    assert cut_faces(np.array([0, 1, 9, -1]), np.array([4]), bow).tolist() == [[0, 1, 2], [0, 2, 3]]
