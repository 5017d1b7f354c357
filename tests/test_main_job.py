"""The whole way, on the catalog: both renderers against the exact reference and against each other, figures printed."""

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from aliasbench.metrics.catalog import measure
from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.raster.context import describe_contexts, sample_positions
from aliasbench.renderers.sampling.patterns import sample_set
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import Camera, Scene, Surface
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import view_at
from aliasbench.scenes.shapes import polygon

POLYGON_SCENES = ("near-horizontal-edge", "edge-fan", "confetti", "propeller", "propeller:rev_per_s=29,shutter=0.5")
SIZE = (256, 256)
SUBPIXEL = 2 / 256  # rasterizers place vertices on a grid of 1/256 px: an edge may be off by a step at either end


def rms(values: NDArray[np.floating]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize("name", [*POLYGON_SCENES, "brick-floor"])
@pytest.mark.parametrize("technique", ["raytrace:spp=256,sampler=jittered", "raster:passes=64,sampler=jittered"])
def test_both_renderers_agree_with_the_reference(name: str, technique: str) -> None:
    scene = load_scene(name)
    truth = render(scene, "reference:", size=SIZE)
    error = rms(render(scene, technique, size=SIZE).pixels - truth.pixels)
    limit = 0.02 if name == "brick-floor" else 0.01
    print(f"{name} {technique}: RMSE {error:.5f} (limit {limit}), reference within {truth.uncertainty:.1e}")
    assert error < limit
    assert truth.pixels.std() > 0.02, "an empty picture would agree with anything"


CELL, CELLS = 16, 32


@pytest.fixture(scope="module")
def random_lines() -> Scene:
    """1024 straight edges: half planes of random angle and offset, one in each cell of a 512 x 512 picture."""
    rng = np.random.default_rng(20140401)
    surfaces: list[Surface] = []
    unit = 2.0 / (CELL * CELLS)  # world units per pixel
    while len(surfaces) < CELLS * CELLS:
        angle, offset = rng.uniform(0, 2 * np.pi), rng.uniform(-1, 1) * CELL / np.sqrt(2)
        normal = np.array([np.cos(angle), np.sin(angle)])
        corners = np.array([[0, 0], [CELL, 0], [CELL, CELL], [0, CELL]]) - CELL / 2.0
        kept: list[NDArray[np.float64]] = []
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            da, db = a @ normal - offset, b @ normal - offset
            if da >= 0:
                kept.append(a)
            if da * db < 0:
                kept.append(a + (b - a) * da / (da - db))
        if len(kept) < 3:
            continue
        index = len(surfaces)
        middle = np.array([index % CELLS, index // CELLS]) * CELL + CELL / 2.0
        points = [(*((p + middle) * unit - 1.0), 0.0) for p in kept]
        surfaces.append(polygon(points))
    return Scene("random-lines", Camera("orthographic", height=2.0), tuple(surfaces))


@pytest.fixture(scope="module")
def line_coverage(random_lines: Scene) -> NDArray[np.float64]:
    side = CELL * CELLS
    return np.asarray(render(random_lines, "reference:", size=(side, side)).pixels[..., 0], dtype=np.float64)


def partial_rms(scene: Scene, technique: str, coverage: NDArray[np.float64], seeds: range) -> float:
    partial = (coverage > 1e-6) & (coverage < 1 - 1e-6)
    side = CELL * CELLS
    with prepare(scene, technique, size=(side, side)) as prepared:
        errors = [prepared.render(seed=s).pixels[..., 0] - coverage for s in seeds]
    return rms(np.stack(errors)[:, partial])


@pytest.mark.parametrize(
    ("sampler", "count", "expected"),
    [
        ("random", 4, 0.1804),
        ("random", 16, 0.0904),
        ("random", 64, 0.0453),
        ("jittered", 4, 0.1277),
        ("jittered", 16, 0.0450),
        ("jittered", 64, 0.0160),
    ],
)
def test_random_lines_have_the_known_error(
    sampler: str, count: int, expected: float, random_lines: Scene, line_coverage: NDArray[np.float64]
) -> None:
    traced = partial_rms(random_lines, f"raytrace:spp={count},sampler={sampler}", line_coverage, range(2))
    print(f"{sampler} {count}: raytrace {traced:.4f}, known {expected}")
    assert traced == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("sampler", ["random", "jittered"])
@pytest.mark.parametrize(("count", "seeds"), [(4, 8), (16, 4), (64, 2)])
def test_random_lines_in_accumulation_passes_have_the_error_of_their_pattern(
    sampler: str, count: int, seeds: int, random_lines: Scene, line_coverage: NDArray[np.float64]
) -> None:
    # All pixels of a raster picture share one pattern, so one picture's error is that pattern's and not the average
    # over patterns: it is compared with the tracer's under the same patterns.
    drawn = partial_rms(random_lines, f"raster:passes={count},sampler={sampler}", line_coverage, range(seeds))
    shared = f"raytrace:pattern=shared,spp={count},sampler={sampler}"
    traced = partial_rms(random_lines, shared, line_coverage, range(seeds))
    print(f"{sampler} {count}: raster {drawn:.4f}, raytrace with the same patterns {traced:.4f}")
    assert drawn == pytest.approx(traced, rel=0.01)


def test_random_lines_under_the_device_s_own_sample_positions(
    random_lines: Scene, line_coverage: NDArray[np.float64]
) -> None:
    counts = [n for n in next(c for c in describe_contexts() if c.ok).sample_counts if n > 1]
    assert counts, "the device has no multisampling"
    side = CELL * CELLS
    partial = (line_coverage > 1e-6) & (line_coverage < 1 - 1e-6)
    for count in counts:
        measured = partial_rms(random_lines, f"raster:msaa={count}", line_coverage, range(1))
        inside = np.zeros((side, side))
        for x, y in sample_positions(count):
            inside += point_coverage(random_lines, side, x, y)
        model = rms((inside / count - line_coverage)[partial])
        limit = 0.333 * 0.62 ** np.log2(count)
        print(f"msaa {count}: measured {measured:.4f}, model {model:.4f}, conformance limit {limit:.4f}")
        assert measured == pytest.approx(model, rel=0.05)
        assert measured < limit


def point_coverage(scene: Scene, side: int, x: float, y: float) -> NDArray[np.float64]:
    """One sample a pixel, by half planes: 1 where (column + x, row + y) is inside the cell's convex polygon."""
    view = view_at(scene.camera, scene.animation, 0, 0.0, (side, side))
    out = np.zeros((side, side))
    for surface in scene.objects:
        ring = view.project(surface.vertices)[:, :2]
        first = np.clip(np.floor(ring.min(axis=0)).astype(int), 0, side)
        last = np.clip(np.ceil(ring.max(axis=0)).astype(int), 0, side)
        columns, rows = np.meshgrid(np.arange(first[0], last[0]) + x, np.arange(first[1], last[1]) + y)
        edge = np.roll(ring, -1, axis=0) - ring
        sides = np.stack([e[0] * (rows - p[1]) - e[1] * (columns - p[0]) for p, e in zip(ring, edge, strict=True)])
        inside = np.all(sides >= 0, axis=0) | np.all(sides <= 0, axis=0)
        out[first[1] : last[1], first[0] : last[0]] += inside
    return out


def segments_at(scene: Scene, frame: int, fraction: float, size: tuple[int, int]) -> NDArray[np.float64]:
    """All outline edges (of meshes, all triangles' edges) in the picture at a time, (n, 2, 2) pixels."""
    view = view_at(scene.camera, scene.animation, frame, fraction, size)
    edges = []
    for surface in scene.objects:
        matrix = object_matrix(surface.motion, scene.animation, frame, fraction)
        points = view.project(surface.vertices @ matrix[:3, :3].T + matrix[:3, 3])[:, :2]
        rings = points[None] if surface.is_polygon else points[surface.triangles]
        edges.append(np.stack([rings, np.roll(rings, -1, axis=1)], axis=2).reshape(-1, 2, 2))
    return np.concatenate(edges)


def distance(point: NDArray[np.float64], segments: NDArray[np.float64]) -> float:
    a, d = segments[:, 0], segments[:, 1] - segments[:, 0]
    along = np.clip(np.sum((point - a) * d, axis=1) / np.sum(d * d, axis=1), 0, 1)
    return float(np.linalg.norm(a + along[:, None] * d - point, axis=1).min(initial=np.inf))


def around(segments: NDArray[np.float64], rows: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray[np.float64]:
    """The segments whose bounding box meets any of the pixels, one pixel of margin given."""
    low, high = np.floor(segments.min(axis=1)) - 1, np.ceil(segments.max(axis=1)) + 1
    hit = np.zeros((SIZE[1] + 1, SIZE[0] + 1), np.int64)
    hit[rows + 1, columns + 1] = 1
    total = hit.cumsum(axis=0).cumsum(axis=1)
    (x0, y0), (x1, y1) = (np.clip(v, 0, SIZE[0]).astype(np.int64).T for v in (low, high))
    return segments[total[y1, x1] - total[y0, x1] - total[y1, x0] + total[y0, x0] > 0]


@pytest.mark.parametrize("name", POLYGON_SCENES)
def test_with_one_pattern_for_all_the_renderers_differ_only_at_edges(name: str) -> None:
    scene = load_scene(name)
    frame, seed, count = 1, 3, 16
    traced = render(scene, f"raytrace:pattern=shared,spp={count},sampler=jittered", size=SIZE, frame=frame, seed=seed)
    drawn = render(scene, f"raster:passes={count},sampler=jittered", size=SIZE, frame=frame, seed=seed)
    gap = np.abs(traced.pixels.astype(np.float64) - drawn.pixels).max(axis=2)
    pattern = sample_set("jittered", count, seed=seed, frame=frame)
    rows, columns = np.nonzero(gap > 1e-5)
    fractions = pattern[:, 2] * scene.animation.shutter
    edges = {f: around(segments_at(scene, frame, f, SIZE), rows, columns) for f in set(fractions)}
    for row, column in zip(rows, columns, strict=True):
        near = sum(
            distance(np.array([column + p[0], row + p[1]]), edges[f]) <= SUBPIXEL
            for p, f in zip(pattern, fractions, strict=True)
        )
        # Each sample near an edge moves the mean by at most the largest contrast / count.
        assert gap[row, column] <= near / count + 1e-5, (row, column, near)
    print(f"{name}: {len(rows)} of {gap.size} pixels differ, all by samples within 2/256 px of an edge")
    assert len(rows) < 0.02 * gap.size


@pytest.mark.parametrize(("rate", "expected"), [(1, 1.0), (29, -1.0), (30, 0.0)])
@pytest.mark.parametrize("technique", ["raytrace:", "raster:"])
def test_the_propeller_turns_as_the_lecture_says(technique: str, rate: int, expected: float) -> None:
    scene = load_scene(f"propeller:blades=3,rev_per_s={rate}")
    frames = range(scene.animation.frames)
    with prepare(scene, technique, size=SIZE) as prepared:
        test = np.stack([prepared.render(frame=n).pixels for n in frames])
    with prepare(scene, "reference:", size=SIZE) as prepared:
        reference = np.stack([prepared.render(frame=n).pixels for n in frames])
    score = measure("apparent_rate", test, reference, scene=scene)
    print(f"propeller at {rate} rev/s, {technique} {score.value:+.4f} rev/s")
    assert score.status == "ok"
    assert score.value == pytest.approx(expected, abs=0.01)


def engines() -> Iterator[tuple[str, str]]:
    for name in (*POLYGON_SCENES, "brick-floor"):
        yield name, "spp=4,sampler=jittered"
    yield "brick-floor", "spp=4,sampler=jittered,texture=trilinear"


@pytest.mark.parametrize(("name", "options"), list(engines()))
def test_packets_equal_the_portable_engine(name: str, options: str) -> None:
    scene = load_scene(name)
    packet = render(scene, f"raytrace:{options}", size=SIZE, frame=1, seed=1).pixels
    portable = render(scene, f"raytrace:{options},engine=portable", size=SIZE, frame=1, seed=1).pixels
    differing = np.mean(np.abs(packet - portable).max(axis=2) > 1e-5)
    print(f"{name} {options}: {differing:.5%} of pixels differ")
    if scene.is_static or scene.animation.shutter == 0.0:
        assert np.array_equal(packet, portable)
    assert differing <= 1e-3
