"""Scale: the same picture a million units away, a millionth as large and a million times, and from far away.

What is rendered is `ladder`'s, and so are the bounds.
"""

import json
import math
import struct
import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aliasbench.bench.hard.case import RASTERS, REFERENCE, HardCase, Verdict, samples_key
from aliasbench.bench.hard.ladder import (
    DISTANCE_PX,
    FAR,
    FRAME,
    HALF_ULP,
    HERE,
    INSTANT,
    RAY_ROUNDINGS,
    SIZE,
    TURN,
    bound_of,
    camera_for,
    ladder,
    ladder_scene,
    listed,
    misplacement,
    placed,
)
from aliasbench.bench.hard.ownership import worst_misplacement
from aliasbench.bench.hard.sight import centres_of
from aliasbench.renderers.catalog import render
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import FloatArray, Scene, Vec3
from aliasbench.scenes.shapes import polygon

# half an ulp of float64: of a coordinate, at the opening and the closing, and of what is subtracted from either
_REFERENCE_ROUNDINGS = 16.0 * 2.0**-53
_BOTH = "both references' own bounds, and 16 roundings of float64 of the coordinates"


def _scaled(subject: str, *, at: Vec3 = HERE, unit: float = 1.0) -> Verdict:
    """The ladder elsewhere or of another size: misplacements, or for the reference the difference from the plain."""
    found: dict[str, float] = {}
    bound, why = 0.0, ""
    for projection in ("orthographic", "perspective"):
        for moving in (False, True):
            scene = ladder_scene(projection, at=at, unit=unit, moving=moving)
            frame, name = FRAME if moving else 0, f"{projection} {'moving' if moving else 'still'}"
            if subject == REFERENCE:
                plain = ladder_scene(projection, moving=moving)
                ours, theirs = (render(s, INSTANT, size=SIZE, frame=frame) for s in (scene, plain))
                found[name] = float(np.abs(ours.pixels - theirs.pixels).max())
                own = (ours.uncertainty or 0.0) + (theirs.uncertainty or 0.0)
                bound = max(bound, own + _moved(max(map(abs, at)) / unit + DISTANCE_PX))
            else:
                found[name] = misplacement(subject, scene, frame)
                allowed, why = bound_of(subject, scene, unit)
                bound = max(bound, allowed)
    if subject == REFERENCE:
        return Verdict(max(found.values()), "contrast", bound, bound, _BOTH, note=listed(found))
    return placed(found, bound, why)


_ELSEWHERE = (("1e6 away", FAR, 1.0), ("1e-6", HERE, 1e-6 / 64), ("1e6", HERE, 1e6 / 64))


def _exposed_exactly() -> Verdict:
    """The same of the reference, and of two of the strips in larger pixels, as its pictures take long."""
    found: dict[str, float] = {}
    bound, size = 0.0, (SIZE[0] // 4, SIZE[1] // 4)
    for projection in ("orthographic", "perspective"):
        plain, *others = (
            replace(scene, objects=scene.objects[4:6], textures={})
            for scene in (
                ladder_scene(projection, at=at, unit=unit, moving=True)
                for _, at, unit in (("plain", HERE, 1.0), *_ELSEWHERE)
            )
        )
        expected = render(plain, REFERENCE, size=size, frame=FRAME)
        for (name, at, unit), scene in zip(_ELSEWHERE, others, strict=True):
            frame = render(scene, REFERENCE, size=size, frame=FRAME)
            found[f"{projection} {name}"] = float(np.abs(frame.pixels - expected.pixels).max())
            own = (frame.uncertainty or 0.0) + (expected.uncertainty or 0.0)
            bound = max(bound, own + _moved(max(map(abs, at)) / unit + DISTANCE_PX))
    return Verdict(max(found.values()), "contrast", bound, bound, _BOTH, note=listed(found))


def _moved(coordinate: float) -> float:
    """Return by how much of the contrast roundings of coordinates, in pixels, may change a pixel of a reference."""
    # an edge that moves by d px changes a pixel by at most sqrt(2) d, and two edges pass a pixel
    return _REFERENCE_ROUNDINGS * coordinate * 2.0 * math.sqrt(2.0)


def _exposed(subject: str) -> Verdict:
    """The moving ladder under an open shutter, far from the origin, far smaller and far larger, against the plain."""
    if subject == REFERENCE:
        return _exposed_exactly()
    worst, note, bound = 0.0, "", 0.0
    for projection in ("orthographic", "perspective"):
        plain = ladder_scene(projection, moving=True)
        technique = samples_key(subject, 16, "sampler=jittered")
        expected = render(plain, technique, size=SIZE, frame=FRAME).pixels.astype(np.float64)
        for name, at, unit in _ELSEWHERE:
            scene = ladder_scene(projection, at=at, unit=unit, moving=True)
            pixels = render(scene, technique, size=SIZE, frame=FRAME).pixels
            found = float(np.abs(pixels - expected).mean())
            worst, note = max((worst, note), (found, f"worst: {projection}, {name}"))
        # of samples at random places, those at most that far from a border may differ, in both pictures
        length = sum(float(np.linalg.norm(np.diff(s.vertices, axis=0), axis=1).sum()) + 60.0 for s in plain.objects)
        bound = max(bound, 4.0 * bound_of(subject, plain, 1.0)[0] * length / (SIZE[0] * SIZE[1]))
    why = "each sample that lies within the still ladder's bound of a border, in either picture, may change its colour"
    return Verdict(worst, "contrast", 0.0, bound, why, note=note)


def _write_meshes(folder: str, corners: FloatArray, triangles: NDArray[np.int64]) -> None:
    """Write triangles, moved to `FAR`, as far.obj (in decimals) and as far.glb (float32 under a node that is moved)."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in (corners + np.asarray(FAR)).tolist()]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles.tolist()]
    Path(folder, "far.obj").write_text("\n".join(lines) + "\n")
    vertices, indices = corners.astype("<f4").tobytes(), triangles.astype("<u2").tobytes()
    views = [{"buffer": 0, "byteLength": len(vertices)}]
    views.append({"buffer": 0, "byteOffset": len(vertices), "byteLength": len(indices)})
    low, high = (getattr(corners, name)(axis=0).tolist() for name in ("min", "max"))
    document = json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": FAR}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": len(vertices) + len(indices)}],
        "bufferViews": views,
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(corners), "type": "VEC3", "min": low, "max": high},
            {"bufferView": 1, "componentType": 5123, "count": triangles.size, "type": "SCALAR"},
        ],
    }).encode()  # fmt: skip
    document += b" " * (-len(document) % 4)
    data = vertices + indices + bytes(-(len(vertices) + len(indices)) % 4)
    header = struct.pack("<4sII", b"glTF", 2, 28 + len(document) + len(data))
    chunks = struct.pack("<I4s", len(document), b"JSON") + document + struct.pack("<I4s", len(data), b"BIN\0") + data
    Path(folder, "far.glb").write_bytes(header + chunks)


def _mesh(subject: str) -> Verdict:
    """The ladder's upright strips as OBJ (coordinates in decimals) and glTF (a node's translation), 1e6 away."""
    strips = [s.vertices.astype(np.float32).astype(np.float64) for s in ladder()[:20:2]]
    corners = np.concatenate(strips)
    triangles = np.concatenate([np.array([(0, 1, 2), (0, 2, 3)]) + 4 * k for k in range(len(strips))])
    found: dict[str, float] = {}
    truth_objects = tuple(polygon(s + np.asarray(FAR), color=(1.0, 0.5, 0.25)) for s in strips)
    bound, why = 0.0, ""
    with tempfile.TemporaryDirectory() as folder:
        _write_meshes(folder, corners, triangles)
        for name in ("far.obj", "far.glb"):
            for projection in ("orthographic", "perspective"):
                camera = camera_for(projection, FAR, 1.0)
                view = "height = 64.0" if camera.height else f"fov_y_deg = {camera.fov_y_deg!r}"
                lines = [
                    "schema = 1\n[camera]",
                    f'projection = "{projection}"',
                    *(f"{key} = {list(getattr(camera, key))}" for key in ("position", "target", "up")),
                    view,
                    f'[[object]]\nmesh = "{name}"\ncolor = [1.0, 0.5, 0.25]\n',
                ]
                Path(folder, "far.toml").write_text("\n".join(lines))
                scene = load_scene(str(Path(folder, "far.toml")))
                truth_scene = Scene("truth", camera, truth_objects)
                key = f"{name[4:]} {projection}"
                if subject == REFERENCE:
                    ours, theirs = (render(s, REFERENCE, size=SIZE) for s in (scene, truth_scene))
                    found[key] = float(np.abs(ours.pixels - theirs.pixels).max())
                    bound = max(bound, (ours.uncertainty or 0.0) + (theirs.uncertainty or 0.0))
                    continue
                truth = centres_of(truth_scene, SIZE)
                found[key] = worst_misplacement(render(scene, samples_key(subject, 1), size=SIZE).pixels, truth)
                allowed, why = bound_of(subject, truth_scene, 1.0)
                bound = max(bound, allowed)
    if subject == REFERENCE:
        why = "the mesh and the same strips as polygons: both references' own bounds"
        return Verdict(max(found.values()), "contrast", bound, bound, why, note=listed(found))
    return placed(found, bound, why)


_PICTURES = 130000.0


def _far_away(subject: str) -> Verdict:
    """The ladder seen through a telescope, or by parallel rays, from 130 000 and 10 million pictures away."""
    found: dict[str, float] = {}
    bound, why = 0.0, ""
    for projection in ("orthographic", "perspective"):
        for pictures, moving in ((_PICTURES, False), (1e7, False), (1e7, True)):
            scene = ladder_scene(projection, distance_px=pictures * SIZE[1], moving=moving)
            name = f"{projection} {pictures:g} {'moving' if moving else 'still'}"
            frame = FRAME if moving else 0
            if subject == REFERENCE:
                # a plane across the axis looks the same from everywhere on it
                plain = ladder_scene(projection, moving=moving)
                ours, theirs = (render(s, INSTANT, size=SIZE, frame=frame) for s in (scene, plain))
                found[name] = float(np.abs(ours.pixels - theirs.pixels).max())
                own = (ours.uncertainty or 0.0) + (theirs.uncertainty or 0.0)
                bound, why = max(bound, own + _moved(pictures * SIZE[1])), _BOTH
                continue
            found[name] = misplacement(subject, scene, frame)
            allowed, why = bound_of(subject, scene, 1.0)
            bound = max(bound, allowed)
    if subject == REFERENCE:
        return Verdict(max(found.values()), "contrast", bound, bound, why, note=listed(found))
    return placed(found, bound, why)


# What is seen of vast strips is cut at planes about the camera no farther away than the farthest of their edges passes
# it, and its corners are at most sqrt(3) times as far.
_CUT_PX = RAY_ROUNDINGS * HALF_ULP * math.sqrt(3.0) * math.hypot(DISTANCE_PX, *SIZE)


def _strips(projection: str, reach: float) -> Scene:
    """Return a scene of ten strips that lean as the ladder's do and reach so far up, and nearly as far down."""
    strips = []
    for rung in range(10):
        lean, x = 0.5 * 4.0**-rung / 28.0, 6.0 * rung - 45.5
        low, high = -0.73 * reach, reach
        corners = [(x + lean * low, low), (x + lean * low + 2.6, low)]
        corners += [(x + lean * high + 2.6, high), (x + lean * high, high)]
        strips.append(polygon(np.array([(*c, 0.0) for c in corners]) @ TURN.T, color=(1.0, 0.5, 0.0)))
    return Scene("strips", camera_for(projection, HERE, 1.0), tuple(strips))


def _wide(subject: str) -> Verdict:
    """Strips that reach 130 000 pictures up and down, their edges aligned with pixel centres as the ladder's."""
    found: dict[str, float] = {}
    bound, why = 0.0, ""
    reach = _PICTURES * SIZE[1]
    for projection in ("orthographic", "perspective"):
        scene = _strips(projection, reach)
        if subject == REFERENCE:
            ours, theirs = (render(s, REFERENCE, size=SIZE) for s in (scene, _strips(projection, float(SIZE[1]))))
            found[projection] = float(np.abs(ours.pixels - theirs.pixels).max())
            own = (ours.uncertainty or 0.0) + (theirs.uncertainty or 0.0)
            bound, why = max(bound, own + _moved(reach)), _BOTH
            continue
        found[projection] = misplacement(subject, scene)
        bound, why = bound_of(subject, scene, 1.0)
        if subject not in RASTERS:
            bound, why = _CUT_PX, "float32 rays: 12 roundings of 2^-24 of the distance to the corners of cut parts"
    if subject == REFERENCE:
        return Verdict(max(found.values()), "contrast", bound, bound, why, note=listed(found))
    return placed(found, bound, why)


CASES = (
    HardCase(
        "far-from-origin",
        "scale",
        "Strips, plain and textured, and the camera 1.3e6 units from the origin, a pixel a unit; still and moving.",
        "Every sample farther than the bound from a border is right; the reference's picture is that at the origin.",
        partial(_scaled, at=FAR),
    ),
    HardCase(
        "units-small",
        "scale",
        "The same scene a millionth of a unit high; still and moving, parallel and perspective.",
        "Every sample farther than the bound from a border is right; the reference's picture is the plain scene's.",
        partial(_scaled, unit=1e-6 / SIZE[1]),
    ),
    HardCase(
        "units-large",
        "scale",
        "The same scene a million units high; still and moving, parallel and perspective.",
        "Every sample farther than the bound from a border is right; the reference's picture is the plain scene's.",
        partial(_scaled, unit=1e6 / SIZE[1]),
    ),
    HardCase(
        "scales-exposed",
        "scale",
        "The turning, moving scene under an open shutter, far away, tiny and vast: 16 samples at times of their own.",
        "The mean difference from the plain scene's picture with the same samples; of the reference the largest, for "
        "two strips.",
        _exposed,
    ),
    HardCase(
        "meshes-far-from-origin",
        "scale",
        "The strips as an OBJ file and as a glTF file whose node is moved, 1.3e6 units from the origin.",
        "Every sample farther than the bound from an edge is right; the reference's picture is that of polygons.",
        _mesh,
    ),
    HardCase(
        "telescope",
        "scale",
        "The scene seen from 130 000 and 10 million times its height away, still and moving, parallel and perspective.",
        "Every sample farther than the bound from a border is right; the reference's picture is that from near.",
        _far_away,
    ),
    HardCase(
        "surfaces-vast",
        "scale",
        "Strips that reach up to 130 000 picture heights beyond the picture.",
        "Every sample farther than the bound from an edge is right; the reference's picture is that of short strips.",
        _wide,
    ),
)
