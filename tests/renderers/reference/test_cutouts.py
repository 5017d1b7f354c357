"""Cut-outs by alpha: as geometry against overlays by shapely, polygons and brute force; as samples against geometry."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from aliasbench.renderers.catalog import render
from aliasbench.renderers.reference import cutouts, texel_rectangles
from aliasbench.renderers.reference.cutout_samples import sample_cutouts
from aliasbench.renderers.reference.cutouts import expand, opaque_texels
from aliasbench.renderers.reference.faces import build_faces
from aliasbench.renderers.reference.paths import scene_paths
from aliasbench.renderers.reference.snapshots import Shot
from aliasbench.renderers.sampling.filters import make_filter
from aliasbench.scenes.model import Camera, ImageTexture, Motion, Scene, Spin, Surface, read_only
from aliasbench.scenes.projection import view_at
from aliasbench.scenes.textures import evaluate_point

SIZE = (13, 11)
TILTED = Camera("perspective", position=(0.7, -0.9, 2.6), target=(0.1, 0.0, 0.0), up=(0.2, 1.0, 0.1), fov_y_deg=42.0)


def image_of(alpha, colors=None, cutoff=0.5):
    """Return an image from alpha (h, w) and linear colours (h, w, 3), white if there are none."""
    alpha = np.asarray(alpha, dtype=np.float32)
    texels = np.ones((*alpha.shape, 4), np.float32)
    texels[..., 3] = alpha
    if colors is not None:
        texels[..., :3] = colors
    return ImageTexture(read_only(texels), alpha_cutoff=cutoff)


def quad_of(uv, z=0.0, half=1.0, **others):
    corners = np.array([(-half, -half, z), (half, -half, z), (half, half, z), (-half, half, z)])
    uv = None if uv is None else read_only(np.asarray(uv, dtype=np.float64))
    triangles = read_only(np.array([(0, 1, 2), (0, 2, 3)], np.int32))
    return Surface(read_only(corners), triangles, uv=uv, **{"texture": None if uv is None else "i", **others})


def tiles(u0, u1, v0, v1):
    return [(u0, v0), (u1, v0), (u1, v1), (u0, v1)]


def scene_of(objects, texture, camera=TILTED, **others):
    return Scene("test", camera, tuple(objects), textures={"i": texture}, **others)


def cut(scene):
    out = expand(scene, linear=False)
    assert out is not None
    return out


def overlay(scene, size):
    """Return each pixel's share covered by the opaque texels of the scene's one quad, clipped and projected alone."""
    (surface,) = scene.objects
    solid = opaque_texels(scene.textures["i"])
    h, w = solid.shape
    origin, corner, other = surface.uv[0], surface.uv[1], surface.uv[3]
    to_world = np.linalg.inv(np.array([corner - origin, other - origin]))
    edges = surface.vertices[1] - surface.vertices[0], surface.vertices[3] - surface.vertices[0]
    outline = shapely.Polygon(surface.uv * (w, h))
    low, high = np.floor(surface.uv.min(axis=0) * (w, h)), np.ceil(surface.uv.max(axis=0) * (w, h))
    view = view_at(scene.camera, scene.animation, 0, 0.0, size)
    shapes = []
    for j in range(int(low[1]), int(high[1])):
        for i in range(int(low[0]), int(high[0])):
            part = shapely.intersection(outline, shapely.box(i, j, i + 1, j + 1))
            if solid[j % h, i % w] and part.area > 1e-12:
                st_ = (np.array(part.exterior.coords) / (w, h) - origin) @ to_world
                shapes.append(view.project(surface.vertices[0] + st_ @ np.array(edges))[:, :2])
    polygons = [shapely.Polygon(s) for s in shapes]
    cells = [[shapely.box(x, y, x + 1, y + 1) for x in range(size[0])] for y in range(size[1])]
    return np.array([[sum(shapely.intersection(c, p).area for p in polygons) for c in row] for row in cells])


def brute(scene, size, side, *, linear=False, seed=0):
    """Return the picture from side^2 jittered rays a pixel through every triangle; nearest opaque hit."""
    rng = np.random.default_rng(seed)
    view = view_at(scene.camera, scene.animation, 0, 0.0, size)
    y, x = np.meshgrid(np.arange(size[1] * side), np.arange(size[0] * side), indexing="ij")
    x, y = (x + rng.random(x.shape)) / side, (y + rng.random(y.shape)) / side
    origins, ways = view.ray(x, y)
    nearest = np.full(x.shape, np.inf)
    out = np.broadcast_to(np.array(scene.background), (*x.shape, 3)).copy()
    for surface in scene.objects:
        for a, b, c in surface.triangles:
            p, e, f = (
                surface.vertices[a],
                surface.vertices[b] - surface.vertices[a],
                surface.vertices[c] - surface.vertices[a],
            )
            cross = np.cross(ways, f)
            det = cross @ e
            away = origins - p
            s = (away * cross).sum(axis=-1) / det
            other = np.cross(away, e)
            t = (ways * other).sum(axis=-1) / det
            depth = (other @ f) / det
            hit = (s >= 0) & (t >= 0) & (s + t <= 1) & (depth > 0) & (depth <= nearest + 1e-9)
            color = np.broadcast_to(np.array(surface.color), out.shape)
            if surface.texture is not None:
                texture = scene.textures[surface.texture]
                uv = (
                    surface.uv[a]
                    + s[..., None] * (surface.uv[b] - surface.uv[a])
                    + t[..., None] * (surface.uv[c] - surface.uv[a])
                )
                value = blend(texture, uv) if linear else evaluate_point(texture, uv)
                if texture.alpha_cutoff is not None:
                    hit = hit & (value[..., 3] >= texture.alpha_cutoff)
                color = color * value[..., :3]
            nearest = np.where(hit, depth, nearest)
            out = np.where(hit[..., None], color, out)
    return out.reshape(size[1], side, size[0], side, 3).mean(axis=(1, 3))


def blend(texture, uv):
    """Return the bilinear blend of an image's texels."""
    h, w = texture.texels.shape[:2]
    at = uv * (w, h) - 0.5
    first = np.floor(at)
    share = at - first
    i, j = first.astype(int).transpose(2, 0, 1)
    total = 0.0
    for dy in (0, 1):
        for dx in (0, 1):
            weight = np.abs(1 - dx - share[..., 0]) * np.abs(1 - dy - share[..., 1])
            total = total + weight[..., None] * texture.texels[(j + dy) % h, (i + dx) % w].astype(np.float64)
    return total


def jitter_bound(side):
    """Return six standard errors of side^2 jittered points: at most 4 side cells straddle two edges' worth of borders.

    A cell that a border crosses has a variance of at most 1/4; few pixels here see more than some six borders.
    """
    return 6 * np.sqrt(6 * 2 * side * 0.25) / side**2


def test_a_cut_out_square_is_the_polygon_of_that_square(make_polygon):
    alpha = np.zeros((4, 4))
    alpha[1:3, 1:4] = 1.0
    colored = replace(quad_of(tiles(0, 1, 0, 1)), color=(0.5, 0.25, 1.0))
    scene = cut(scene_of([colored], image_of(alpha, [0.5, 1.0, 0.25]), background=(0.1, 0.2, 0.3)))
    (surface,) = scene.objects
    assert surface.texture is None
    assert len(surface.triangles) == 2
    polygon = make_polygon([(-0.5, -0.5), (1, -0.5), (1, 0.5), (-0.5, 0.5)], (0.25, 0.25, 0.25))
    for filter_ in ("box", "tent", "gaussian", "cone"):
        pictures = [
            render(replace(scene, objects=(o,)), f"reference:filter={filter_}", size=(24, 20))
            for o in (surface, polygon)
        ]
        assert [p.uncertainty_kind for p in pictures] == ["bound", "bound"]
        assert np.abs(pictures[0].pixels - pictures[1].pixels).max() < 1e-14


@settings(max_examples=12)
@given(
    mask=st.tuples(st.integers(1, 5), st.integers(1, 5), st.integers(0, 2**25 - 1)),
    offset=st.tuples(st.floats(-3, 3), st.floats(-3, 3)),
    span=st.tuples(st.floats(0.2, 2.6), st.floats(0.2, 2.6)),
    shear=st.floats(-0.8, 0.8),
    tilted=st.booleans(),
)
def test_random_masks_cover_what_an_overlay_of_their_texels_says(mask, offset, span, shear, tilted):
    h, w, bits = mask
    alpha = np.array([bits >> k & 1 for k in range(h * w)]).reshape(h, w)
    o, e, f = np.array(offset), np.array([span[0], shear * span[0]]), np.array([-shear * span[1], span[1]])
    scene = scene_of(
        [quad_of([o, o + e, o + e + f, o + f])],
        image_of(alpha),
        camera=TILTED if tilted else Camera("orthographic", height=1.7),
    )
    frame = render(cut(scene), "reference:", size=SIZE)
    assert frame.uncertainty_kind == "bound"
    assert np.abs(frame.pixels[..., 0] - overlay(scene, SIZE)).max() < 1e-10


def test_everything_opaque_is_the_plain_texture_and_nothing_opaque_the_background():
    colors = np.random.default_rng(0).random((3, 4, 3))
    scene = scene_of([quad_of(tiles(0, 2, -1, 1))], image_of(np.full((3, 4), 0.5), colors), background=(0.3, 0.1, 0.0))
    plain = replace(scene, textures={"i": image_of(np.ones((3, 4)), colors, None)})
    for texture in ("point", "linear"):
        shown = expand(scene, linear=texture == "linear")
        same, other = (render(s, f"reference:texture={texture}", size=SIZE).pixels for s in (shown, plain))
        assert np.array_equal(same, other)
        absent = expand(
            replace(scene, textures={"i": image_of(np.full((3, 4), 0.4), colors)}), linear=texture == "linear"
        )
        assert absent.objects == ()
        assert np.array_equal(
            render(absent, "reference:", size=SIZE).pixels, np.broadcast_to((0.3, 0.1, 0.0), (11, 13, 3))
        )


def test_a_scene_without_cut_outs_is_left_alone():
    scene = scene_of([quad_of(tiles(0, 1, 0, 1))], image_of(np.zeros((2, 2)), cutoff=None))
    assert expand(scene, linear=False) is scene
    assert expand(scene, linear=True) is scene


def test_alpha_at_the_cutoff_is_there_in_single_precision():
    # .7 stored in single precision lies below .7
    texture = image_of([[0.7, np.nextafter(np.float32(0.7), np.float32(0))]], cutoff=0.7)
    assert opaque_texels(texture).tolist() == [[True, False]]


def leaf(rng, h=5, w=6):
    return image_of(rng.random((h, w)) < 0.6, rng.random((h, w, 3)))


def bent_mesh(rng):
    """Return a mesh of two triangles in different planes and a quad whose texture map has a crease."""
    points = np.array([(-1, -0.8, 0.2), (0.1, -0.9, -0.3), (0.2, 0.7, 0.1), (-0.9, 0.9, -0.2), (1, -0.5, 0.5)])
    uv = rng.uniform(-1.5, 1.5, (5, 2))
    triangles = np.array([(0, 1, 2), (0, 2, 3), (1, 4, 2)], np.int32)
    return Surface(read_only(points), read_only(triangles), is_polygon=False, uv=read_only(uv), texture="i")


@pytest.mark.parametrize("seed", range(3))
def test_what_lies_behind_shows_through_the_holes(seed):
    rng = np.random.default_rng(seed)
    creased = [(0.0, 0.1), (1.3, 0.2), (0.7, 1.9), (-0.2, 0.8)]
    scene = scene_of(
        [
            bent_mesh(rng),
            replace(quad_of(creased, z=-0.5), color=(0.4, 1.0, 0.7)),
            quad_of(None, z=-0.8, half=0.7, color=(0, 0, 1)),
        ],
        leaf(rng),
        background=(0.2, 0.1, 0.0),
    )
    frame = render(cut(scene), "reference:", size=SIZE)
    assert frame.uncertainty_kind == "bound"
    error = frame.pixels - brute(scene, SIZE, 48, seed=seed)
    assert np.abs(error).max() < jitter_bound(48)
    assert np.abs(error.mean()) < 1e-4


@pytest.mark.parametrize("filter_", ["tent", "gaussian,radius=inf", "mitchell"])
def test_wires_are_flat_colours_under_every_filter(make_polygon, filter_):
    wires = scene_of([quad_of(tiles(0, 20, 0, 1))], image_of([[1, 1, 0, 0, 0]] * 3))
    apart = [make_polygon([(x, -1), (x + 0.04, -1), (x + 0.04, 1), (x, 1)]) for x in -1 + 0.1 * np.arange(20)]
    shown = cut(wires)
    assert [o.texture for o in shown.objects] == [None]
    assert len(shown.objects[0].triangles) == 40
    one, other = (
        render(s, f"reference:filter={filter_}", size=SIZE) for s in (shown, replace(wires, objects=tuple(apart)))
    )
    assert one.uncertainty_kind == "bound"
    assert np.abs(one.pixels - other.pixels).max() < 1e-13


def test_a_moving_cut_out_is_the_moving_polygon(make_polygon, make_scene):
    motion = Motion((3.0, 1.0, 0.0), Spin((0, 0, 1), (0.2, 0.0, 0.0), 4.0))
    alpha = np.zeros((3, 3))
    alpha[1, :2] = 1.0
    scene = scene_of(
        [quad_of(tiles(0, 1, 0, 1), motion=motion)], image_of(alpha), camera=Camera("orthographic", height=2.0)
    )
    third = 1 / 3
    polygon = make_polygon([(-1, -third), (third, -third), (third, third), (-1, third)], motion=motion)
    moving = make_scene([polygon], shutter=0.7)
    shown = replace(cut(scene), animation=moving.animation)
    for frame in (0, 3):
        one, other = (render(s, "reference:", size=SIZE, frame=frame) for s in (shown, moving))
        assert one.uncertainty_kind == "bound"
        assert np.abs(one.pixels - other.pixels).max() <= one.uncertainty + other.uncertainty


@pytest.mark.parametrize(
    ("uv", "expected"),
    [
        ([(0.3, 0.3)] * 4, 1.0),  # one texel, opaque
        ([(0.5, 0.3)] * 4, 0.0),  # on the border: of the texel that begins there
        ([(-0.7, 0.3)] * 4, 1.0),
        ([(0.0, 0.0), (1.0, 0.0), (1.0, 0.0), (0.0, 0.0)], 0.5),  # v the same all over
    ],
)
def test_texture_maps_without_area_still_have_texels(uv, expected):
    scene = scene_of([quad_of(uv)], image_of([[1, 0], [0, 1]]), camera=Camera("orthographic", height=2.0))
    assert render(cut(scene), "reference:", size=(1, 1)).pixels[0, 0, 0] == pytest.approx(expected, abs=1e-12)


def test_rows_and_repeats_that_are_alike_cost_nothing():
    striped = scene_of([quad_of(tiles(0, 1, 0, 1e6))], image_of(np.tile([[1, 0, 0, 1]], (64, 1))))
    assert len(cut(striped).objects[0].triangles) == 4


def test_what_is_curved_or_too_many_is_not_expanded(monkeypatch):
    holes = scene_of([quad_of(tiles(0, 3, 0, 3))], image_of([[1, 0], [0, 1]]))
    assert expand(holes, linear=True) is None
    assert len(cut(holes).objects[0].triangles) == 36
    monkeypatch.setattr(cutouts, "MOST_PARTS", 17)
    assert expand(holes, linear=False) is None
    monkeypatch.setattr(cutouts, "MOST_PARTS", 18)
    assert expand(holes, linear=False) is not None
    monkeypatch.setattr(texel_rectangles, "MOST_CELLS", 35)
    assert expand(holes, linear=False) is None


def shot_of(scene, size, filter_=("box", 0.5)):
    paths = scene_paths(scene)
    return Shot(scene, build_faces(scene), paths, size, 0, make_filter(*filter_))


@pytest.fixture
def few_points(monkeypatch):
    monkeypatch.setattr("aliasbench.renderers.reference.cutout_samples._POINTS", 1 << 22)


@pytest.mark.usefixtures("few_points")
@pytest.mark.parametrize("filter_", [("box", 0.5), ("tent", 1.0), ("cone", 1.0), ("lanczos", 3.0)])
def test_samples_agree_with_geometry_within_their_interval(filter_):
    rng = np.random.default_rng(5)
    scene = scene_of([bent_mesh(rng), quad_of(tiles(0, 2, 0, 1), z=-0.7)], leaf(rng), background=(0.2, 0.1, 0.0))
    sampled = sample_cutouts(shot_of(scene, SIZE, filter_), linear=False, shutter=(0.0, 0.0))
    assert sampled.samples > 0
    exact = render(cut(scene), f"reference:filter={filter_[0]},radius={filter_[1]}", size=SIZE)
    assert np.abs(sampled.pixels - exact.pixels).max() <= sampled.uncertainty + exact.uncertainty
    assert sampled.uncertainty < 2e-2


@pytest.mark.usefixtures("few_points")
def test_blended_alpha_is_cut_at_its_curve():
    rng = np.random.default_rng(2)
    texture = image_of(rng.random((4, 5)), rng.random((4, 5, 3)))
    scene = scene_of([quad_of(tiles(0, 1.4, 0.3, 1.2)), quad_of(None, z=-0.5, color=(0, 0.3, 1))], texture)
    sampled = sample_cutouts(shot_of(scene, SIZE), linear=True, shutter=(0.0, 0.0))
    error = sampled.pixels - brute(scene, SIZE, 64, linear=True)
    assert np.abs(error).max() < jitter_bound(64) + sampled.uncertainty
    assert np.abs(error.mean()) < 1e-4


@pytest.mark.usefixtures("few_points")
def test_samples_over_the_shutter_agree_with_moving_geometry(make_scene):
    motion = Motion((4.0, 0.0, 0.0))
    scene = scene_of(
        [quad_of(tiles(0, 1, 0, 1), motion=motion)],
        image_of([[1, 0], [0, 1]]),
        camera=Camera("orthographic", height=2.5),
    )
    scene = replace(scene, animation=make_scene([], shutter=1.0).animation)
    sampled = sample_cutouts(shot_of(scene, SIZE), linear=False, shutter=(0.0, 1.0))
    exact = render(cut(scene), "reference:", size=SIZE)
    assert np.abs(sampled.pixels - exact.pixels).max() <= sampled.uncertainty + exact.uncertainty


def test_the_rasterizer_converges_to_the_cut_out():
    rng = np.random.default_rng(3)
    scene = scene_of([quad_of(tiles(0, 1.5, 0, 1.2))], leaf(rng))
    exact = render(cut(scene), "reference:", size=SIZE).pixels
    drawn = render(scene, "raster:passes=256", size=SIZE).pixels
    # 256 jittered points, and edges on a lattice of 1 / 256 pixel
    assert np.abs(drawn - exact).max() < jitter_bound(16)
    assert np.sqrt(((drawn - exact) ** 2).mean()) < 0.01


@pytest.mark.usefixtures("few_points")
@pytest.mark.parametrize(("texture", "kind"), [("point", "bound"), ("linear", "confidence")])
def test_references_of_cut_outs_say_how_they_were_made(texture, kind):
    rng = np.random.default_rng(8)
    scene = scene_of([quad_of(tiles(0, 1.5, 0, 1.2))], image_of(rng.random((4, 5))))
    frame = render(scene, f"reference:texture={texture}", size=(5, 4))
    assert frame.uncertainty_kind == kind
    shown = brute(scene, (5, 4), 96, linear=texture == "linear")
    assert np.abs(frame.pixels - shown).max() < jitter_bound(96) + frame.uncertainty
