"""Texture values: look-ups as the scene model defines them, levels from the shared chain, analytic patterns exact."""

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.renderers.raster.minification import chosen_lod_bias
from aliasbench.renderers.technique import parse_technique
from aliasbench.scenes.model import Camera, Checker, Grating, ImageTexture, ZonePlate
from aliasbench.scenes.projection import view_at
from aliasbench.scenes.textures import evaluate_point, mip_chain

pytestmark = pytest.mark.usefixtures("gl_checked")
SIZE = (50, 41)


def random_image(width, height, **options):
    texels = np.random.default_rng(width * 1000 + height).random((height, width, 4), np.float32)
    texels[..., 3] = 1.0
    return ImageTexture(texels, **options)


TEXTURES = {
    "image": random_image(7, 5),
    "checker": Checker((9.0, 6.5), (0.1, 0.0, 0.2), (0.9, 1.0, 0.7)),
    "sine": Grating(6.3, 31.0, 0.2, "sine", (0.1, 0.2, 0.0), (0.9, 0.8, 1.0)),
    "square": Grating(5.1, -20.0, 0.4, "square"),
    "zone": ZonePlate((0.45, 0.55), 150.0, 0.7),
}


def textured_square(make, corners_uv, **options):
    corners = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]
    return make.polygon(corners, uv=corners_uv, texture="t", **options)


def lookups(scene, size, corners_uv, half=1.0):
    """uv (h, w, 2) at the pixel centres, inside (h, w), of a square in the plane z = 0."""
    view = view_at(scene.camera, scene.animation, 0, 0.0, size)
    x, y = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    origin, direction = view.ray(x, y)
    hit = origin - direction * (origin[..., 2] / direction[..., 2])[..., None]
    low, high = np.array(corners_uv[0]), np.array(corners_uv[2])
    return low + (hit[..., :2] / half + 1) / 2 * (high - low), (np.abs(hit[..., :2]) < half).all(axis=-1)


@pytest.mark.parametrize("name", TEXTURES)
@pytest.mark.parametrize("camera", ["orthographic", "perspective"])
@pytest.mark.parametrize("mode", ["point", "linear"])
def test_exact_textures_equal_the_model_away_from_their_steps(make, name, camera, mode):
    texture = TEXTURES[name]
    corners_uv = [(-0.31, -1.17), (1.6, -1.17), (1.6, 2.2), (-0.31, 2.2)]
    scene = make.scene(
        textured_square(make, corners_uv, color=(0.5, 1.0, 2.0)), camera=getattr(make, camera), textures={"t": texture}
    )
    pixels = render(scene, f"raster:texture={mode}", size=SIZE).pixels
    uv, inside = lookups(scene, SIZE, corners_uv)
    evaluate = bilinear if name == "image" and mode == "linear" else evaluate_point
    expected = evaluate(texture, uv)[..., :3] * (0.5, 1.0, 2.0)
    steady = inside.copy()
    for shift in ((1e-5, 1e-5), (-1e-5, 1e-5), (1e-5, -1e-5), (-1e-5, -1e-5)):
        change = np.abs(evaluate(texture, np.add(uv, shift)) - evaluate(texture, uv)).max(axis=-1)
        steady &= change < 0.02
    assert steady.sum() > 0.95 * inside.sum()
    # float32 coordinates of about 3: 2e-7, times the steepest slope (the zone plate's 150 * 2 * 2.4 / 2) and colour
    np.testing.assert_allclose(pixels[steady], expected[steady], atol=6e-4)


def bilinear(texture, uv):
    height, width = texture.texels.shape[:2]
    x, y = uv[..., 0] * width - 0.5, uv[..., 1] * height - 0.5
    total = 0.0
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        column, row = np.floor(x) + dx, np.floor(y) + dy
        weight = (1 - np.abs(x - column)) * (1 - np.abs(y - row))
        texel = texture.texels[np.mod(row, height).astype(int), np.mod(column, width).astype(int)]
        total = total + weight[..., None] * texel
    return total


def test_nearest_is_point(make):
    scene = make.scene(textured_square(make, [(0, 0), (1, 0), (1, 1), (0, 1)]), textures={"t": TEXTURES["image"]})
    point, nearest = (render(scene, f"raster:texture={m}", size=SIZE).pixels for m in ("point", "nearest"))
    np.testing.assert_array_equal(point, nearest)


def test_texel_rows_run_up(make):
    texels = np.zeros((2, 2, 4), np.float32)
    texels[0, 0], texels[1, 1] = (1, 0, 0, 1), (0, 1, 0, 1)
    scene = make.scene(textured_square(make, [(0, 0), (1, 0), (1, 1), (0, 1)]), textures={"t": ImageTexture(texels)})
    pixels = render(scene, "raster", size=(2, 2)).pixels
    np.testing.assert_array_equal(pixels[1, 0], (1, 0, 0))
    np.testing.assert_array_equal(pixels[0, 1], (0, 1, 0))


@pytest.mark.parametrize("mode", ["trilinear", "mipmap"])
@pytest.mark.parametrize("level", [0, 1, 2, 3])
def test_a_whole_level_of_detail_shows_that_level_of_the_shared_chain(make, mode, level):
    texture = random_image(32, 32)
    side = 32 >> level
    scene = make.scene(textured_square(make, [(0, 0), (1, 0), (1, 1), (0, 1)]), textures={"t": texture})
    # pixel centres on texel centres; float32 derivatives are exact here, log2 is to a few ulp
    pixels = render(scene, f"raster:texture={mode}", size=(side, side)).pixels
    np.testing.assert_allclose(pixels, mip_chain(texture).levels[level][::-1, :, :3], atol=1e-4)


def test_lod_bias_moves_by_levels_and_auto_by_the_shading_samples(make):
    texture = random_image(32, 32)
    scene = make.scene(textured_square(make, [(0, 0), (1, 0), (1, 1), (0, 1)]), textures={"t": texture})
    pixels = render(scene, "raster:texture=trilinear,lod_bias=2", size=(16, 16)).pixels
    coarse = mip_chain(texture).levels[3][::-1, :, :3].astype(float)
    # bilinear in level 3 at a pixel centre a quarter texel off
    fine = bilinear(ImageTexture(mip_chain(texture).levels[3]), lookups(scene, (16, 16), [(0, 0), 0, (1, 1)])[0])
    assert coarse.shape == (4, 4, 3)
    np.testing.assert_allclose(pixels, fine[..., :3], atol=1e-4)
    auto = render(scene, "raster:texture=trilinear,passes=16,lod_bias=auto,sampler=grid", size=(16, 16)).pixels
    same = render(scene, "raster:texture=trilinear,passes=16,lod_bias=-2,sampler=grid", size=(16, 16)).pixels
    np.testing.assert_array_equal(auto, same)
    assert chosen_lod_bias(parse_technique("raster:texture=trilinear,passes=16,lod_bias=auto")) == -2.0


def test_levels_between_blend_linearly(make):
    texture = random_image(64, 64)
    levels = mip_chain(texture).levels
    scene = make.scene(textured_square(make, [(0, 0), (1, 0), (1, 1), (0, 1)]), textures={"t": texture})
    uv, _ = lookups(scene, (32, 32), [(0, 0), 0, (1, 1)])
    one, two = (bilinear(ImageTexture(levels[k]), uv)[..., :3] for k in (1, 2))
    for share in (0.25, 0.5, 0.75):
        pixels = render(scene, f"raster:texture=trilinear,lod_bias={share}", size=(32, 32)).pixels
        # drivers blend levels and texels with weights of 8 bits or more
        np.testing.assert_allclose(pixels, (1 - share) * one + share * two, atol=3 / 256)


@pytest.mark.parametrize("name", TEXTURES)
def test_far_minified_textures_tend_to_their_mean(make, name):
    texture = TEXTURES[name]
    camera = Camera("orthographic", height=2.0)
    corners_uv = [(0, 0), (512, 0), (512, 512), (0, 512)]
    scene = make.scene(textured_square(make, corners_uv), camera=camera, textures={"t": texture})
    pixels = render(scene, "raster:texture=trilinear", size=(16, 16)).pixels
    # a zone plate's rings come to pi / 2k at most in one of the pixels, which are 32 units wide and high
    mean = 0.5 if name == "zone" else mip_chain(texture).levels[-1][0, 0, :3]
    expected = np.broadcast_to(mean, pixels.shape)
    np.testing.assert_allclose(pixels, expected, atol=np.pi / 300 / 32**2 if name == "zone" else 1e-6)


def test_large_texture_coordinates_lose_no_precision(make):
    texture = TEXTURES["image"]
    images = []
    for shift in (0, 1_000_000):
        corners_uv = [(shift, -shift), (shift + 2, -shift), (shift + 2, 2 - shift), (shift, 2 - shift)]
        scene = make.scene(textured_square(make, corners_uv), textures={"t": texture})
        images.append(render(scene, "raster:texture=linear", size=SIZE).pixels)
    np.testing.assert_allclose(images[0], images[1], atol=1e-5)


def test_alpha_below_the_cutoff_is_a_hole(make):
    texels = np.ones((1, 2, 4), np.float32)
    texels[0, 0, 3] = 0.4
    holed = textured_square(make, [(0, 0), (1, 0), (1, 1), (0, 1)])
    behind = make.polygon([[-2, -2, -1], [2, -2, -1], [2, 2, -1], [-2, 2, -1]], color=(0.0, 0.5, 0.0))
    for cutoff, left in ((0.5, (0, 0.5, 0)), (0.3, (1, 1, 1)), (None, (1, 1, 1))):
        scene = make.scene(holed, behind, textures={"t": ImageTexture(texels, cutoff)})
        pixels = render(scene, "raster", size=(8, 8)).pixels
        np.testing.assert_array_equal(pixels[:, :4], np.broadcast_to(left, (8, 4, 3)))
        np.testing.assert_array_equal(pixels[:, 4:], 1.0)


def test_several_textures_and_plain_colours_keep_the_order_of_objects(make):
    textures = {"a": Checker((2.0, 2.0)), "b": random_image(4, 4), "c": Checker((4.0, 4.0))}
    corners_uv = [(0, 0), (1, 0), (1, 1), (0, 1)]
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
    objects = [
        make.polygon(corners * scale, uv=corners_uv, texture=name)
        for scale, name in ((1.0, "a"), (0.75, "b"), (0.5, "c"))
    ]
    objects.insert(2, make.polygon(corners * 0.6, color=(0.0, 0.0, 1.0)))
    scene = make.scene(*objects, textures=textures)
    size = (64, 64)
    expected = np.zeros((64, 64, 3))
    for item, scale in zip(objects, (1.0, 0.75, 0.6, 0.5), strict=True):
        uv, inside = lookups(scene, size, corners_uv, half=scale)
        value = np.broadcast_to(item.color, (64, 64, 3))
        if item.texture is not None:
            value = evaluate_point(textures[item.texture], uv)[..., :3]
        expected[inside] = value[inside]
    pixels = render(scene, "raster", size=size).pixels
    assert (np.abs(pixels - expected).max(axis=-1) > 1e-6).sum() == 0


def test_hardware_samples_at_an_edge_are_shaded_inside_the_surface(make):
    # the left half of the texture is black and must not bleed in: the surface has only the white half
    texels = np.zeros((1, 2, 4), np.float32)
    texels[0, 1] = 1.0
    right = make.polygon([[0.01, -2, 0], [1, -2, 0], [1, 2, 0]], uv=[(0.5, 0), (1, 0), (1, 1)], texture="t")
    plain = make.polygon(right.vertices)
    textured = render(make.scene(right, textures={"t": ImageTexture(texels)}), "raster:msaa=4", size=(40, 40))
    np.testing.assert_array_equal(textured.pixels, render(make.scene(plain), "raster:msaa=4", size=(40, 40)).pixels)


@pytest.mark.parametrize("bias", ["0", "auto"])
def test_supersampling_filters_textures_as_a_grid_of_passes_does(make, bias):
    scene = make.scene(
        textured_square(make, [(0, 0), (3, 0), (3, 3), (0, 3)]),
        camera=make.perspective,
        textures={"t": random_image(64, 64)},
    )
    ssaa = render(scene, f"raster:texture=trilinear,ssaa=4,lod_bias={bias}", size=(40, 30)).pixels
    grid = render(scene, f"raster:texture=trilinear,passes=16,sampler=grid,lod_bias={bias}", size=(40, 30)).pixels
    difference = np.abs(ssaa - grid)
    # derivatives are taken over sub-pixels in one and over pixels in the other; edges may be drawn 1/256 px off
    assert difference.mean() < 2e-4
    assert np.ptp(grid) > 0.2
    plain = render(scene, "raster:texture=trilinear,passes=16,sampler=grid", size=(40, 30)).pixels
    assert (np.abs(plain - grid).mean() > 5e-3) == (bias == "auto")
