"""Minification: which level is looked up, how near the exact footprint that comes, and that it agrees with the tracer.

Levels are read off a texture whose levels hold their own number. The ideal level of detail comes from derivatives of
the exact map from picture to texture, taken in float64 without any renderer.
"""

import itertools

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.renderers.raster import minification
from aliasbench.renderers.raster.context import acquire_context
from aliasbench.scenes.catalog import SCENES
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Camera, ImageTexture
from aliasbench.scenes.projection import view_at
from aliasbench.scenes.textures import MipChain

pytestmark = pytest.mark.usefixtures("gl_checked")
SIZE = (48, 36)
TEXELS = (1024, 256)  # across, up
LAST = 10.0  # level of one texel
# Levels blend with at least 8 bits on any device (GL_SUBTEXEL_BITS says 4 or more; all have 8).
FRACTION = 2.0**-8
MODES = (
    "point",
    "linear",
    "mipmap",
    "trilinear",
    "anisotropic",
    "anisotropic,anisotropy=2",
    "anisotropic,anisotropy=64",
)


@pytest.fixture
def numbered(monkeypatch):
    """Levels that hold their own number, in place of their texels."""
    real = minification.scene_chain

    def chain(scene, name):
        made = real(scene, name)
        levels = []
        for number, level in enumerate(made.levels):
            levels.append(np.full_like(level, number))
            levels[-1][..., 3] = 1.0
        return MipChain(tuple(levels), made.uv_matrix)

    monkeypatch.setattr(minification, "scene_chain", chain)


def image(width, height, seed=0, **options):
    texels = np.random.default_rng(seed).random((height, width, 4), np.float32)
    texels[..., 3] = 1.0
    return ImageTexture(texels, **options)


class Plane:
    """A large parallelogram in space with any affine texture map, and that map's exact derivatives in the picture."""

    def __init__(self, make, projection, seed):
        rng = np.random.default_rng(seed)
        # magnified with the first seeds, minified with the last
        scale = 10.0 ** (0.5 * seed - 3.0)
        along, up = (a / np.linalg.norm(a) for a in rng.standard_normal((2, 3)))
        self.normal = np.cross(along, up)
        # the eye looks at the origin of the plane, never quite along it
        toward = self.normal + rng.uniform(-2.0, 2.0) * along + rng.uniform(-2.0, 2.0) * up
        eye = 3.0 * toward / np.linalg.norm(toward)
        self.camera = Camera(projection, position=tuple(eye), fov_y_deg=50.0, height=3.0, up=tuple(along))
        self.uv = rng.standard_normal((2, 3)) * scale
        corners = [6.0 * (a * along + b * up) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        surface = make.polygon(corners, uv=[self.uv @ c for c in corners], texture="t")
        self.scene = make.scene(surface, camera=self.camera, textures={"t": image(*TEXELS)}, background=(-1.0,) * 3)

    def texels_at(self, x, y):
        """Texture coordinates in texels, (h, w, 2)."""
        view = view_at(self.camera, self.scene.animation, 0, 0.0, SIZE)
        origin, direction = view.ray(x, y)
        far = -(origin @ self.normal) / (direction @ self.normal)
        return (origin + direction * far[..., None]) @ self.uv.T * TEXELS

    def footprints(self):
        """Derivatives (h, w, 2, 2): texels along u and v, to the right and down; and coordinates (h, w, 2)."""
        x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
        h = 1e-4
        right = (self.texels_at(x + h, y) - self.texels_at(x - h, y)) / (2 * h)
        down = (self.texels_at(x, y + h) - self.texels_at(x, y - h)) / (2 * h)
        return np.stack([right, down], axis=-1), self.texels_at(x, y)

    def exact_enough(self, footprints, places, drawn):
        """Pixels of the plane where float32 holds coordinates well enough for 2^-8 of a level.

        A coordinate over w and its difference round by some 2^-22 of the coordinate, counted from the surface's middle;
        relative to a derivative that is an error of log2(e) times as many levels.
        """
        longest = np.linalg.norm(footprints, axis=-2).max(axis=-1)
        error = 2.0**-22 * np.log2(np.e) * np.linalg.norm(places, axis=-1) / longest
        chosen = (drawn[..., 0] >= 0.0) & (error < FRACTION / 4)
        assert chosen.mean() > 0.2
        return chosen


VIEWS = list(itertools.product(["perspective", "orthographic"], range(8), [0.0]))


@pytest.mark.usefixtures("numbered")
@pytest.mark.parametrize(("projection", "seed", "bias"), [*VIEWS, ("perspective", 6, -1.7), ("orthographic", 4, 2.3)])
@pytest.mark.parametrize("mode", ["mipmap", "trilinear"])
def test_the_level_of_detail_is_within_what_opengl_allows_and_the_ideal_one(make, projection, seed, bias, mode):
    plane = Plane(make, projection, seed)
    drawn = render(plane.scene, f"raster:texture={mode},lod_bias={bias}", size=SIZE).pixels
    footprints, places = plane.footprints()
    # OpenGL 3.3, 3.8.11: m_u and m_v, and max(m_u, m_v) <= f <= m_u + m_v; the ideal f is equation 3.17's
    most = np.abs(footprints).max(axis=-1)
    ideal = np.log2(np.linalg.norm(footprints, axis=-2).max(axis=-1)) + bias
    low, high = np.log2(most.max(axis=-1)) + bias, np.log2(most.sum(axis=-1)) + bias
    chosen = plane.exact_enough(footprints, places, drawn)
    level = drawn[chosen][:, 0]
    low, high, ideal = (np.clip(a[chosen], 0.0, LAST) for a in (low, high, ideal))
    if mode == "trilinear":
        assert (level >= low - FRACTION).all()
        assert (level <= high + FRACTION).all()
        np.testing.assert_allclose(level, ideal, atol=FRACTION)
    else:
        # equation 3.21: the nearest, of two as near the lower
        nearest = np.maximum(np.ceil(ideal + 0.5) - 1.0, 0.0)
        clear = np.abs(ideal - np.floor(ideal) - 0.5) > FRACTION
        assert clear.mean() > 0.9
        np.testing.assert_array_equal(level[clear], nearest[clear])


def test_those_views_are_magnified_minified_and_beyond_the_last_level(make):
    lods = []
    for projection, seed, _ in VIEWS:
        plane = Plane(make, projection, seed)
        lods.append(np.log2(np.linalg.norm(plane.footprints()[0], axis=-2).max(axis=-1)))
    assert np.min(lods) < 0.0
    assert np.max(lods) > LAST
    assert ((np.array(lods) > 0.0) & (np.array(lods) < LAST)).mean() > 0.4


@pytest.mark.usefixtures("numbered")
@pytest.mark.parametrize(("projection", "seed"), [(p, s) for p, s, _ in VIEWS])
@pytest.mark.parametrize("most", [1, 2, 16])
def test_anisotropic_taps_are_as_wide_as_the_ellipse_s_shorter_axis_or_their_share_of_the_longer(
    make, projection, seed, most
):
    plane = Plane(make, projection, seed)
    technique = f"raster:texture=anisotropic,anisotropy={most},lod_bias=0.75"
    drawn = render(plane.scene, technique, size=SIZE).pixels
    footprints, places = plane.footprints()
    longer, shorter = np.moveaxis(np.linalg.svd(footprints, compute_uv=False), -1, 0) * 2.0**0.75
    ratio = longer / np.maximum(shorter, 1.0)
    taps = np.clip(np.ceil(ratio), 1, most)
    chosen = plane.exact_enough(footprints, places, drawn)
    # at a whole ratio a rounding error is one tap more or less
    chosen &= (np.abs(ratio - np.round(ratio)) > 0.01) | (ratio > most + 0.5) | (ratio < 0.9)
    expected = np.clip(np.log2(longer / taps), 0.0, LAST)
    assert chosen.mean() > 0.2
    np.testing.assert_allclose(drawn[chosen][:, 0], expected[chosen], atol=FRACTION)


@pytest.mark.usefixtures("numbered")
def test_the_automatic_bias_shrinks_by_the_root_of_the_shading_samples_and_no_bias_does_not(make):
    corners = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]
    square = make.polygon(corners, uv=[(0, 0), (1, 0), (1, 1), (0, 1)], texture="t")
    scene = make.scene(square, textures={"t": image(512, 512)})
    for mode, samples, bias, level in (
        ("trilinear", "passes=4", "0", 4.0),
        ("trilinear", "passes=8", "auto", 2.5),
        ("trilinear", "ssaa=4", "0", 4.0),
        ("trilinear", "ssaa=4", "auto", 2.0),
        ("anisotropic", "ssaa=4", "0", 4.0),
        ("anisotropic", "passes=3,ssaa=2", "auto", 4.0 - 0.5 * np.log2(12)),
        ("anisotropic", "msaa=4", "auto", 4.0),
    ):
        pixels = render(scene, f"raster:texture={mode},{samples},lod_bias={bias}", size=(32, 32)).pixels
        np.testing.assert_allclose(pixels, level, atol=FRACTION)


SHAPES = [(64, 64), (1, 1), (1, 37), (53, 1), (7, 5), (2048, 2), (3, 700)]


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("shape", SHAPES)
def test_any_footprint_on_any_texture_keeps_a_constant_and_stays_within_the_texels(make, mode, shape):
    width, height = shape
    noise, constant = image(width, height, seed=3), np.ones((height, width, 4), np.float32)
    constant[..., :3] = (0.1, 0.7, 123.0)
    low, high = noise.texels[..., :3].min(axis=(0, 1)), noise.texels[..., :3].max(axis=(0, 1))
    corners = np.array([[-40, -0.8, 1], [40, -0.8, 1], [40, -0.8, -30], [-40, -0.8, -30]], float)
    for across, up in ((1e-3, 1e-3), (1.0, 1.0), (1e6, 1e6), (1e-3, 1e6), (1e6, 1e-3), (30.0, 0.3)):
        # texels to a pixel at a distance of 1, some ten times as many at the far end
        uv = corners[:, [0, 2]] * (across * 20 / width, up * 20 / height)
        floor = make.polygon(corners, uv=uv, texture="t")
        for texture in (noise, ImageTexture(constant)):
            camera = Camera("perspective", position=(0.0, 0.0, 0.0), target=(0.0, -0.7, -1.0), fov_y_deg=60.0)
            scene = make.scene(floor, camera=camera, textures={"t": texture}, background=(-9.0,) * 3)
            pixels = render(scene, f"raster:texture={mode}", size=(24, 18)).pixels
            assert np.isfinite(pixels).all()
            pixels = pixels[(pixels != -9.0).any(axis=2)]
            assert len(pixels) > 0.8 * 24 * 18
            if texture is noise:
                # weights add up to 1 but for rounding
                assert (pixels >= low - 1e-6).all()
                assert (pixels <= high + 1e-6).all()
            else:
                np.testing.assert_allclose(pixels, np.broadcast_to(constant[0, 0, :3], pixels.shape), rtol=1e-6)


@pytest.mark.parametrize("shape", [(1, 1), (1, 0), (0, 1)])
def test_textures_up_to_the_device_s_limit_are_drawn_and_larger_ones_name_it(make, shape):
    limit = acquire_context().max_texture_size
    corners = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]
    square = make.polygon(corners, uv=[(0, 0), (1, 0), (1, 1), (0, 1)], texture="t")
    for extra in (0, 1, limit):
        width, height = (limit + extra if side == 0 else 1 for side in shape)
        scene = make.scene(square, textures={"t": ImageTexture(np.ones((height, width, 4), np.float32))})
        for mode in ("point", "anisotropic"):
            if max(width, height) <= limit:
                np.testing.assert_array_equal(render(scene, f"raster:texture={mode}", size=(4, 4)).pixels, 1.0)
                continue
            with pytest.raises(InputError, match=f"{width}x{height} texels: this device takes at most {limit}x{limit}"):
                render(scene, f"raster:texture={mode}", size=(4, 4))


FLOOR_SIZE = (96, 72)


def floor_rows(scene):
    """The rows that lie on a floor all over, the far third of them, and coordinates (h, w, 2) at the pixel centres."""
    view = view_at(scene.camera, scene.animation, 0, 0.0, FLOOR_SIZE)
    x, y = np.meshgrid(np.arange(FLOOR_SIZE[0]) + 0.5, np.arange(FLOOR_SIZE[1]) - 0.5)
    origin, direction = view.ray(x, y)
    with np.errstate(divide="ignore", invalid="ignore"):
        place = origin - direction * (origin[..., 1:2] / direction[..., 1:2])
    depth = -place[..., 2].min(axis=1)
    far = depth < -scene.objects[0].vertices[:, 2].min()
    first = int(np.flatnonzero((direction[:, 0, 1] < 0.0) & far)[0])
    return slice(first, None), slice(first, first + (FLOOR_SIZE[1] - first) // 3)


def rmse(one, other):
    return float(np.sqrt(np.mean((np.asarray(one, float) - other) ** 2)))


@pytest.mark.parametrize("name", ["checker-floor", "brick-floor"])
def test_far_floors_come_nearer_to_the_exact_footprint_with_every_mode(name):
    scene = SCENES[name].build()
    exact = render(scene, "reference:", size=FLOOR_SIZE)
    rows, far = floor_rows(scene)
    error, whole = {}, {}
    for mode in ("point", "linear", "mipmap", "trilinear", *(f"anisotropic,anisotropy={n}" for n in (2, 4, 8, 16))):
        pixels = render(scene, f"raster:texture={mode}", size=FLOOR_SIZE).pixels
        error[mode], whole[mode] = rmse(pixels[far], exact.pixels[far]), rmse(pixels[rows], exact.pixels[rows])
    assert exact.uncertainty < 1e-3 * whole["anisotropic,anisotropy=16"]
    anisotropic = [whole[f"anisotropic,anisotropy={n}"] for n in (2, 4, 8, 16)]
    # from some number of taps on nothing is left to gain on such a floor
    assert all(after < 1.03 * before for before, after in itertools.pairwise(anisotropic))
    assert anisotropic[-1] < 0.8 * anisotropic[0] < 0.8 * whole["trilinear"]
    assert anisotropic[-1] < 0.5 * whole["trilinear"] < 0.51 * whole["mipmap"] < 0.25 * whole["point"]
    # far away all of a photograph is its mean, and modes with levels differ by little; a checker's pixels are not even
    assert error["anisotropic,anisotropy=16"] < (0.2 if name == "checker-floor" else 1.0) * error["trilinear"]
    assert error["trilinear"] < 1.02 * error["mipmap"] < 0.3 * error["point"]


@pytest.mark.parametrize("name", ["checker-floor", "brick-floor"])
def test_the_tracer_s_modes_are_the_same_but_for_rounding_and_its_ellipses_are_nearer_than_levels(name):
    scene = SCENES[name].build()
    rows, _ = floor_rows(scene)
    chain = minification.scene_chain(scene, scene.objects[0].texture)
    texels = max(chain.levels[0].shape)
    drawn, traced = {}, {}
    for mode in ("mipmap", "trilinear"):
        drawn[mode] = render(scene, f"raster:texture={mode}", size=FLOOR_SIZE).pixels[rows]
        traced[mode] = render(scene, f"raytrace:texture={mode}", size=FLOOR_SIZE).pixels[rows]
        # Chains and ideal levels are shared, and both differentiate exactly: what is left is the rounding of float32
        # coordinates, half a unit in the last place of up to 160 periods, times texels, times the largest step (1);
        # and of levels of detail, as much again.
        periods = np.abs(chain.uv_matrix[:, :2]).max() * 80.0
        assert rmse(drawn[mode], traced[mode]) < 2 * periods * 2.0**-24 * texels
        assert drawn[mode].std() > 0.01
    anisotropic = render(scene, "raster:texture=anisotropic", size=FLOOR_SIZE).pixels[rows]
    ellipses = render(scene, "raytrace:texture=ewa", size=FLOOR_SIZE).pixels[rows]
    apart = rmse(anisotropic, ellipses)
    assert apart < 0.5 * rmse(anisotropic, drawn["trilinear"])
    assert apart < 0.5 * rmse(ellipses, traced["trilinear"])


def test_supersampled_footprints_that_shrink_come_nearer_than_one_footprint_and_than_double_filtering():
    scene = SCENES["brick-floor"].build()
    rows, _ = floor_rows(scene)
    exact = render(scene, "reference:", size=FLOOR_SIZE).pixels[rows]
    error = {
        text: rmse(render(scene, f"raster:texture=anisotropic,{text}", size=FLOOR_SIZE).pixels[rows], exact)
        for text in ("passes=1", "ssaa=4", "ssaa=4,lod_bias=auto", "passes=16,sampler=grid,lod_bias=auto")
    }
    assert error["ssaa=4,lod_bias=auto"] < 0.4 * min(error["passes=1"], error["ssaa=4"])
    assert error["passes=16,sampler=grid,lod_bias=auto"] == pytest.approx(error["ssaa=4,lod_bias=auto"], rel=0.05)


@pytest.mark.parametrize("mode", [m for m in MODES if m != "point"])
@pytest.mark.parametrize("seed", range(3))
def test_hardware_samples_never_show_an_atlas_s_neighbour(make, mode, seed):
    # A triangle ends half a texel inside the dark part: a bilinear look-up inside of it is dark exactly, and one at a
    # pixel's centre outside of it is not. It is magnified, so that level 0 is asked for.
    texels = np.full((16, 16, 4), 100.0, np.float32)
    texels[:, :8, :3] = 0.0
    texels[..., 3] = 1.0
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0, 2 * np.pi)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    uv = np.array([(7.5 / 16, 0.1), (7.5 / 16, 0.9), (0.5 / 16, 0.5)])
    corners = np.concatenate([(16 * uv - (4.0, 8.0)) @ turn.T / 6, np.zeros((3, 1))], axis=1)
    corners[2, 2] = -1.0
    for camera in (make.orthographic, make.perspective):
        triangle = make.polygon(corners, uv=uv, texture="t")
        scene = make.scene(triangle, textures={"t": ImageTexture(texels)}, camera=camera, background=(0.5, 0.5, 0.5))
        pixels = render(scene, f"raster:texture={mode},msaa=4", size=(64, 64)).pixels
        assert (pixels < 0.1).sum() > 300
        # rounding of a coordinate at the border, times the step of 100 to a texel
        assert pixels.max() <= 0.5 + 100 * 16 * 2.0**-20


@pytest.mark.parametrize("seed", range(4))
def test_hardware_samples_of_a_receding_surface_are_looked_up_within_the_pixel(make, seed):
    # Two triangles share the pixels along their seam, and each is looked up where its own samples are: less than a
    # pixel away, so that the value is one of those about it. Forty periods from the middle of the surface an error of
    # perspective of a hundredth is many texels.
    texels = np.random.default_rng(seed).random((4, 4, 4), np.float32)
    texels[..., 3] = 1.0
    corners = np.array([[-20, -1, 1], [20, -1, 1], [20, -1, -40], [-20, -1, -40]], float)
    camera = Camera("perspective", position=(0.0, 0.0, 0.0), target=(0.3 * seed - 0.5, -0.5, -1.0), fov_y_deg=60.0)
    floor = make.polygon(corners, uv=corners[:, [0, 2]] * 0.25 + (17.0, 3.0), texture="t")
    scene = make.scene(floor, camera=camera, textures={"t": ImageTexture(texels)})
    plain, sampled = (
        render(scene, f"raster:texture=linear{o}", size=(128, 96)).pixels[48:].astype(float) for o in ("", ",msaa=4")
    )
    around = np.stack([np.roll(plain, (dy, dx), (0, 1)) for dy in (-1, 0, 1) for dx in (-1, 0, 1)])
    # bilinear between texels of 4 or more pixels each: extremes within a pixel are those at its neighbours, nearly
    inside = np.s_[1:-1, 1:-1]
    assert (sampled >= around.min(axis=0) - 0.02)[inside].all()
    assert (sampled <= around.max(axis=0) + 0.02)[inside].all()
    assert np.ptp(plain) > 0.5
