"""What float32 would misplace is drawn right: surfaces far larger than the picture, at the camera's plane, edge-on."""

import numpy as np
import pytest

from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.geometry import build_bodies
from aliasbench.renderers.raster.guard import Guard
from aliasbench.renderers.raster.placement import make_placement
from aliasbench.renderers.raster.projection import Instant, Window, clip_matrices
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Camera, Checker, Motion, Spin

pytestmark = pytest.mark.usefixtures("gl_checked")
SIZE = (32, 24)
FAR = (1e6, 1e8, 1e10, 1e12)


def floor(make, e, **options):
    return make.polygon([[-e, 0, e], [e, 0, e], [e, 0, -e], [-e, 0, -e]], **options)


def eye(**options):
    return Camera("perspective", position=(0, 1, 0), target=(0.2, 0.7, -1), fov_y_deg=60.0, **options)


def axes(camera):
    forward = np.subtract(camera.target, camera.position)
    right = np.cross(forward, camera.up)
    up = np.cross(right, forward)
    return [v / np.linalg.norm(v) for v in (right, up, forward)]


@pytest.mark.parametrize("technique", ["raster", "raster:passes=16", "raster:msaa=4", "raster:msaa=4,passes=2"])
def test_a_vast_floor_looks_like_a_large_one(make, technique):
    # 1e5 units already end less than 1e-3 px short of the horizon: no sample lies between
    expected = render(make.scene(floor(make, 1e5), camera=eye()), technique, size=SIZE).pixels
    assert 0.5 < expected.mean() < 1.0
    for e in FAR:
        pixels = render(make.scene(floor(make, e), camera=eye()), technique, size=SIZE).pixels
        np.testing.assert_array_equal(pixels, expected)


@pytest.mark.parametrize("technique", ["raster:texture=point", "raster:texture=trilinear"])
def test_the_texture_of_a_vast_floor_keeps_its_place(make, technique):
    squares = {"tiles": Checker((1.0, 1.0), (0.1, 0.2, 0.3), (0.9, 0.8, 0.7))}
    camera = Camera("perspective", position=(0.3, 1, 0.2), target=(0.3, -1, -0.8), fov_y_deg=50.0)

    def picture(e):
        # one tile of 1/4 unit for each whole uv, whatever the size
        uv = [[-4 * e, -4 * e], [4 * e, -4 * e], [4 * e, 4 * e], [-4 * e, 4 * e]]
        scene = make.scene(floor(make, e, uv=uv, texture="tiles"), camera=camera, textures=squares)
        return render(scene, technique, size=SIZE).pixels

    small = picture(16.0)
    assert np.ptp(small) > 0.3
    # a sample on the border of two tiles may fall on either side
    assert (np.abs(picture(2.0**23) - small).max(axis=2) < 2e-3).mean() > 0.99


@pytest.mark.parametrize("e", FAR)
def test_a_vast_triangle_fills_an_orthographic_picture(make, e):
    scene = make.scene(make.polygon([[-e, -e, 0], [e, -e, 0], [0, e, 0]]))
    np.testing.assert_array_equal(render(scene, "raster:passes=4", size=SIZE).pixels, 1.0)


@pytest.mark.parametrize("length", [5e4, 1.2e5, 2.5e5, 1e6])
def test_the_texture_of_a_long_surface_keeps_its_place(make, length):
    # a pixel is a unit; rows of squares of 4 pixels start at a pixel's centre and lean by 1e-3 of a pixel each row
    corners = np.array([(-24.015, -24.015, 0.0), (length, -24.015, 0.0), (length, 24.015, 0.0), (-24.015, 24.015, 0.0)])
    uv = [((x - 0.5 + 1e-3 * y) / 4.0, 0.5) for x, y, _ in corners]
    scene = make.scene(
        make.polygon(corners, uv=uv, texture="c"),
        camera=Camera("orthographic", height=float(SIZE[1])),
        textures={"c": Checker((1.0, 1.0))},
    )
    pixels = render(scene, "raster", size=SIZE).pixels[..., 0]
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5 - SIZE[0] / 2, SIZE[1] / 2 - 0.5 - np.arange(SIZE[1]))
    place = x - 0.5 + 1e-3 * y
    apart = np.abs(place - 4.0 * np.round(place / 4.0))
    wrong = pixels != np.floor(place / 4.0) % 2.0
    # corners that snap to 1/256 pixel move what lies between them by half of that, right and up
    assert (apart < 1e-3).any()
    assert apart[wrong].max(initial=0.0) <= np.sqrt(2.0) / 512.0


def test_the_edge_of_a_vast_triangle_is_where_it_is(make):
    # x + 2 y = 0.1 for every e; the picture is 2 high
    for e in FAR[:3]:
        shape = make.polygon([[0.1 - 2 * e, e, 0], [0.1 + 2 * e, -e, 0], [0.1 + 2 * e, e, 0]])
        pixels = render(make.scene(shape), "raster", size=SIZE).pixels[..., 0]
        rows, columns = np.indices(pixels.shape)
        side = (columns + 0.5 - 16) / 12 + 2 * (12 - rows - 0.5) / 12 - 0.1
        sure = np.abs(side) > 0.02
        assert sure.mean() > 0.9
        np.testing.assert_array_equal(pixels[sure], (side > 0)[sure])


def test_a_camera_may_see_a_tiny_part_of_an_ordinary_scene(make):
    camera = Camera("orthographic", position=(0.25, 0.125, 5.0), target=(0.25, 0.125, 0.0), height=1e-8)
    shape = make.polygon([[-1, -1, 0], [0.25, -1, 0], [0.25, 1, 0], [-1, 1, 0]])
    pixels = render(make.scene(shape, camera=camera), "raster", size=SIZE).pixels
    np.testing.assert_array_equal(pixels[:, :16], 1.0)
    np.testing.assert_array_equal(pixels[:, 16:], 0.0)


def test_a_small_object_beside_a_vast_one_keeps_its_shape(make):
    # one body: relative to the middle of both, float32 would round the small one to whole units
    vast = make.polygon([[0, -1, 1], [1e9, -1, 1], [1e9, -1, -1e9], [0, -1, -1e9]], color=(0.0, 0.5, 0.0))
    alone = make.star(camera=make.perspective)
    both = make.scene(vast, *alone.objects, camera=make.perspective, background=alone.background)
    seen = render(make.scene(vast, camera=make.perspective, background=alone.background), "raster", size=SIZE).pixels
    expected, doubtful = make.sample(alone, SIZE, 0.5, 0.5)
    hit = np.any([np.all(np.isclose(expected, s.color), axis=2) for s in alone.objects], axis=0)
    expected = np.where(hit[..., None], expected, seen)
    pixels = render(both, "raster", size=SIZE).pixels
    np.testing.assert_allclose(pixels[~doubtful], expected[~doubtful], atol=1e-6)


@pytest.mark.parametrize("msaa", [1, 4])
def test_vast_surfaces_move_with_their_bodies_and_the_camera(make, msaa):
    spin = Motion(spin=Spin((0, 0, 1), (0.1, 0, 0), 1.3), velocity=(0.3, 0.1, 0))
    walk = eye(velocity=(0.0, 0.5, -3.0), target_velocity=(1.0, 0.0, -3.0))
    technique = f"raster:passes=6,msaa={msaa}"
    for objects, camera in (
        (lambda e: [make.polygon([[0, 0, 0], [e, 0, 0], [e, e, 0]], motion=spin)], make.orthographic),
        (lambda e: [floor(make, e, motion=Motion(velocity=(3.0, 0.2, 1.0)))], walk),
        (lambda e: [floor(make, e)], walk),
    ):
        near, far = (
            render(make.scene(*objects(e), camera=camera, animation=make.moving), technique, size=SIZE, frame=1).pixels
            for e in (1e4, 1e11)
        )
        assert 0.02 < near.mean() < 0.98
        # edges within a sub-pixel step of a sample may fall to either side
        assert (near == far).mean() > 0.99


def test_of_vast_surfaces_in_one_plane_the_later_wins_and_nearer_ones_hide_them(make):
    red, green, blue = np.eye(3)
    patch = make.polygon([[-1, 0, -1], [1, 0, -1], [1, 0, -3], [-1, 0, -3]], color=tuple(blue))
    lid = make.polygon([[-9, 0.5, -1], [9, 0.5, -1], [9, 0.5, -30], [-9, 0.5, -30]], color=(1.0, 1.0, 1.0))
    low = [floor(make, e, color=tuple(c)) for e, c in ((1e9, red), (1e8, green))]
    lone = render(make.scene(patch, camera=eye()), "raster", size=SIZE).pixels[..., 2] > 0
    assert 0.02 < lone.mean() < 0.9
    pixels = render(make.scene(*low, patch, camera=eye()), "raster", size=SIZE).pixels
    np.testing.assert_array_equal(pixels[lone], np.broadcast_to(blue, (lone.sum(), 3)))
    np.testing.assert_array_equal(np.unique(pixels[~lone], axis=0), [[0, 0, 0], green])
    hidden = render(make.scene(lid, *low, camera=eye()), "raster", size=SIZE).pixels
    above = render(make.scene(lid, camera=eye()), "raster", size=SIZE).pixels[..., 0] > 0
    assert above.any()
    np.testing.assert_array_equal(hidden[above], 1.0)


@pytest.mark.parametrize("target", [(0, 0, -1), (0.3, 0.2, -1), (1, 2, -3)])
@pytest.mark.parametrize("position", [(0.0, 0.0, 0.0), (3.1, -2.2, 5.7)])
def test_an_orthographic_camera_sees_what_lies_at_depth_zero(make, position, target):
    camera = Camera("orthographic", position=position, target=tuple(np.add(position, target)), height=2.0)
    right, up, _ = axes(camera)
    square = make.polygon([position + a * right + b * up for a, b in ((-5, -5), (5, -5), (5, 5), (-5, 5))])
    for technique in ("raster", "raster:passes=4,msaa=4"):
        np.testing.assert_array_equal(render(make.scene(square, camera=camera), technique, size=SIZE).pixels, 1.0)


@pytest.mark.parametrize("target", [(0, 0, -1), (0.3, 0.2, -1), (1, 2, -3)])
@pytest.mark.parametrize("nearest", [1.0, -5.0])
def test_a_perspective_camera_in_a_polygons_plane_sees_nothing_of_it(make, target, nearest):
    position = np.array((3.1, -2.2, 5.7))
    camera = Camera("perspective", position=tuple(position), target=tuple(position + target), fov_y_deg=60.0)
    right, _, forward = axes(camera)
    corners = [position + a * forward + b * right for a, b in ((nearest, -5), (5, -5), (5, 5), (nearest, 5))]
    scene = make.scene(make.polygon(corners), camera=camera)
    for technique in ("raster", "raster:passes=4"):
        np.testing.assert_array_equal(render(scene, technique, size=(33, 33)).pixels, 0.0)


def test_what_is_far_may_change_from_frame_to_frame(make):
    camera = Camera("orthographic", height=2.0)
    # 1e9 units to the right at frame 0, in the picture at frame 1, gone again at frame 2
    motion = Motion(velocity=(-24e9, 0, 0))
    one = make.polygon([[1e9 - 9, -9, 0], [1e9 + 9, -9, 0], [1e9, 9, 0]], motion=motion)
    still = make.polygon([[-9, -9, -1], [0, -9, -1], [0, 9, -1], [-9, 9, -1]], color=(0.5, 0.5, 0.5))
    scene = make.scene(one, still, camera=camera, animation=make.moving.__class__(fps=24.0, frames=3))
    with prepare(scene, "raster", size=SIZE) as prepared:
        means = [prepared.render(frame=f).pixels.mean() for f in (0, 1, 2, 1, 0)]
    np.testing.assert_allclose(means, [0.25, 1.0, 0.25, 1.0, 0.25])


def test_ordinary_objects_are_left_to_the_device(make):
    for camera in (make.orthographic, make.perspective):
        for motion in (Motion(), Motion(velocity=(0.3, 0.0, 0.1))):
            scene = make.star(camera=camera, motion=motion)
            placement = make_placement(build_bodies(scene))
            size = (2048, 2048)
            matrices = clip_matrices(
                scene, placement, Instant(0, 0.0, (0.2, 0.1)), size=size, window=Window(0, 0, *size)
            )
            assert not Guard(scene, placement, size).far_objects(matrices).any()


@pytest.mark.parametrize(
    ("vertex", "options", "message"),
    [
        (1e200, {}, r"object 0: vertices: 1e\+200 is too large for the rasterizer, which takes up to 1.27e\+30"),
        (1.0, {"color": (1e39, 0.0, 0.0)}, r"object 0: color: 1e\+39 is too large"),
        (1.0, {"uv": [[0, 0], [1e40, 0], [0, 1]]}, r"object 0: uv: 1e\+40 is too large"),
        (1.0, {"motion": Motion(velocity=(1e200, 0, 0))}, r"frame 7: the scene reaches .* world units"),
        (1.0, {"camera": Camera("orthographic", height=1e-250)}, "frame 7: .* use a larger height or fov_y_deg"),
        (
            1.0,
            {"camera": Camera("orthographic", height=1e-25)},
            r"object 0 reaches 1e\+25 pictures .* larger camera height",
        ),
    ],
)
def test_numbers_beyond_the_device_are_refused_with_their_cause(make, vertex, options, message):
    camera = options.pop("camera", make.orthographic)
    scene = make.scene(make.polygon([[0, 0, 0], [vertex, 0, 0], [0, 1, 0]], **options), camera=camera)
    with pytest.raises(InputError, match=message):
        render(scene, "raster", size=SIZE, frame=7)


@pytest.mark.parametrize("height", [1e-12, 1e15, 1e300])
def test_extreme_cameras_are_drawn_without_a_warning(make, height):
    camera = Camera("orthographic", height=height)
    big = make.scene(make.polygon([[-1, -1, 0], [1, -1, 0], [0, 1, 0]]), camera=camera)
    expected = 1.0 if height < 1 else 0.0
    np.testing.assert_array_equal(render(big, "raster:passes=2", size=SIZE).pixels, expected)


@pytest.mark.parametrize("projection", ["orthographic", "perspective"])
def test_on_a_deep_floor_the_later_object_wins(make, projection):
    # from 1 to 2000 units deep: float32 rounds depths by more than what tells layers apart unless they are cut
    options = {"height": 8.0} if projection == "orthographic" else {"fov_y_deg": 50.0}
    camera = Camera(projection, position=(0, 2, 0), target=(0.1, 1.7, -1), **options)
    tilt = np.array([[0.98, 0.2, 0.0], [-0.2, 0.98, 0.0], [0.0, 0.0, 1.0]])

    def piece(left, right, near, far, color):
        corners = np.array([[left, 0, near], [right, 0, near], [right, 0, far], [left, 0, far]])
        return make.polygon(corners @ tilt, color=color)

    floor = piece(-900.0, 1000.0, 500.0, -2000.0, (1.0, 0.0, 0.0))
    lids = [piece(-950.0, 1100.0, 450.0 + k, -1900.0 + k, c) for k, c in enumerate(((0, 1.0, 0), (0, 0, 1.0)))]
    pixels = render(make.scene(floor, *lids, camera=camera), "raster", size=SIZE).pixels
    alone = render(make.scene(lids[-1], camera=camera), "raster", size=SIZE).pixels[..., 2] > 0
    assert alone.mean() > 0.3
    wrong = (pixels[alone] != (0.0, 0.0, 1.0)).any(axis=1)
    # depths are still interpolated across the picture in float32: one sample in a hundred at most
    assert wrong.mean() <= 0.01
