"""Laws of cut-out textures: what is absent shows what lies behind, whatever that is and however many layers deep."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.scenes.model import Animation, Camera, ImageTexture, Motion, Scene, Spin, Surface, read_only
from aliasbench.scenes.textures import mip_chain

ENGINES = ("packet", "portable")
SIZE = (48, 36)
PERSPECTIVE = Camera("perspective", position=(0.4, 0.7, 4.0), fov_y_deg=50.0)
ORTHOGRAPHIC = Camera("orthographic", position=(0.4, 0.7, 4.0), height=4.0)
OPEN = Animation(shutter=0.6)
RED, GREEN, BLUE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def image(alpha: object, cutoff: float | None = 0.5, colors: object = None) -> ImageTexture:
    """Return an image from alpha (h, w), and colours (h, w, 3) or white."""
    values = np.asarray(alpha, dtype=np.float32)
    texels = np.ones((*values.shape, 4), np.float32)
    texels[..., 3] = values
    if colors is not None:
        texels[..., :3] = colors
    return ImageTexture(read_only(texels), alpha_cutoff=cutoff)


def random_image(seed: int, height: int, width: int, cutoff: float = 0.5) -> ImageTexture:
    rng = np.random.default_rng(seed)
    return image(rng.random((height, width)), cutoff, rng.random((height, width, 3)))


TEXTURES = {"coarse": random_image(0, 8, 8), "fine": random_image(1, 61, 90), "odd": random_image(2, 5, 7, 0.3)}


def screens(quad: Any, flat_scene: Any, camera: Camera, *, moving: bool, cut: bool = True) -> Scene:
    """Return cut-outs in front of, between and behind opaque surfaces, two of them in one plane."""
    slide = Motion(velocity=(9.0, -4.0, 6.0)) if moving else Motion()
    spin = Motion(spin=Spin((0.1, 0.2, 1.0), (0.2, 0.1, 0.0), 5.0)) if moving else Motion()
    textures = TEXTURES if cut else {k: dataclasses.replace(t, alpha_cutoff=None) for k, t in TEXTURES.items()}
    objects = [
        quad(-2, -2, 2, 2, -1.0, color=(0.2, 0.3, 0.9)),
        quad(-2, -2, 2, 2, -2.0, texture="fine"),
        quad(-1.5, -1.5, 1.5, 1.5, 0.0, texture="coarse", motion=slide),
        quad(-1, -1, 1.3, 1, 0.0, texture="fine"),
        quad(-1, -1, 1, 1, 0.5, texture="odd", motion=spin),
        quad(-0.3, -0.3, 0.2, 0.3, 0.8, color=(1.0, 0.0, 0.0)),
    ]
    animation = OPEN if moving else Animation()
    return flat_scene(objects, camera=camera, textures=textures, background=(0.1, 0.2, 0.3), animation=animation)


@pytest.mark.parametrize("engine", ENGINES)
def test_absent_texels_show_what_lies_behind_exactly(quad: Any, flat_scene: Any, engine: str) -> None:
    # A pixel is a texel of the nearer image; seen from behind the picture is mirrored.
    alpha = np.random.default_rng(3).random((16, 16))
    sheet = quad(-8, -8, 8, 8, 1.0, color=GREEN, texture="t")
    wall = quad(-8, -8, 8, 8, 0.0, color=RED)
    for behind, z, mirror in ((wall, 5.0, 1), (quad(-8, -8, 8, 8, 2.0, color=RED), -5.0, -1)):
        camera = Camera("orthographic", position=(0.0, 0.0, z), height=16.0)
        scene = flat_scene([sheet, behind], camera=camera, textures={"t": image(alpha, 0.4)})
        pixels = render(scene, f"raytrace:engine={engine}", size=(16, 16)).pixels
        present = (alpha.astype(np.float32) >= np.float32(0.4))[::-1, ::mirror]
        assert 0.3 < present.mean() < 0.8
        np.testing.assert_array_equal(pixels[..., 1], present)
        np.testing.assert_array_equal(pixels[..., 0], ~present)


@pytest.mark.parametrize("mode", ["point", "linear", "mipmap", "trilinear"])
def test_alpha_is_compared_in_single_precision_whatever_filters_it(quad: Any, flat_scene: Any, mode: str) -> None:
    # float32(.7) is below .7: equal in single precision is present. A hair below it is absent.
    equal = np.float32(0.7)
    assert float(equal) < 0.7
    for alpha, shown in ((equal, 1.0), (np.nextafter(equal, np.float32(0.0)), 0.0)):
        t = image(np.full((5, 9), alpha), 0.7)
        scene = flat_scene([quad(-3.3, -8, 9, 8, texture="t", uv=[[0, 0], [7, 1], [8, 9], [0, 7]])], textures={"t": t})
        pixels = render(scene, f"raytrace:spp=4,texture={mode}", size=(16, 16)).pixels
        np.testing.assert_array_equal(pixels[:, 6:], shown)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("mode", ["mipmap", "trilinear"])
def test_the_mip_chain_s_alpha_decides_at_whole_levels(quad: Any, flat_scene: Any, mode: str, engine: str) -> None:
    texture = random_image(4, 32, 32, 0.52)
    for level in (0, 1, 2):
        pixels = 32 >> level
        scene = flat_scene(
            [quad(-1, -1, 1, 1, texture="t")], height=2.0, textures={"t": texture}, background=(2.0, 2.0, 2.0)
        )
        picture = render(scene, f"raytrace:texture={mode},engine={engine}", size=(pixels, pixels)).pixels
        expected = mip_chain(texture).levels[level][::-1]
        present = expected[..., 3] >= np.float32(0.52)
        assert 0.2 < present.mean() < 0.8
        np.testing.assert_array_equal((picture != 2.0).all(axis=2), present)
        np.testing.assert_allclose(picture[present], expected[present][:, :3], atol=2e-6)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("moving", [False, True])
def test_every_layer_of_hundreds_is_looked_through(quad: Any, flat_scene: Any, engine: str, moving: bool) -> None:
    # Layer k is present on texel k alone, of all layers the last lies nearest: column k shows layer k's grey.
    count = 150
    textures = {f"t{k}": image(np.arange(count)[None, :] == k) for k in range(count)}
    motion = Motion(velocity=(0.0, 1.0, 0.0)) if moving else Motion()
    objects = [
        quad(-75, -2, 75, 2, -k / 64, color=((k + 1) / 256,) * 3, texture=f"t{k}", motion=motion) for k in range(count)
    ]
    scene = flat_scene(objects, height=1.0, textures=textures, animation=OPEN if moving else Animation())
    pixels = render(scene, f"raytrace:spp=2,engine={engine}", size=(count, 1)).pixels
    np.testing.assert_array_equal(pixels[0, :, 0], ((np.arange(count) + 1) / 256).astype(np.float32))


@pytest.mark.parametrize("camera", [PERSPECTIVE, ORTHOGRAPHIC], ids=["perspective", "orthographic"])
@pytest.mark.parametrize("moving", [False, True])
def test_of_coplanar_cut_outs_the_later_wins_and_its_holes_show_the_earlier(
    quad: Any, flat_scene: Any, camera: Camera, moving: bool
) -> None:
    # Both present, red alone, green alone, neither: some of the texels each.
    first, second = np.random.default_rng(6).integers(0, 2, (2, 9, 9))
    motion = Motion(velocity=(6.0, 0.0, 0.0)) if moving else Motion()
    alphas = {"first": first, "second": second, "first rest": first * (1 - second), "second rest": second * (1 - first)}
    textures = {name: image(alpha) for name, alpha in alphas.items()}
    sheets = {
        name: quad(-1, -1, 1, 1, color=RED if name.startswith("first") else GREEN, texture=name, motion=motion)
        for name in alphas
    }
    technique = "raytrace:spp=16,pattern=shared"
    animation = OPEN if moving else Animation()

    def draw(objects: list[Surface]) -> np.ndarray:
        scene = flat_scene(objects, camera=camera, textures=textures, animation=animation)
        return render(scene, technique, size=SIZE).pixels

    for names in (("first", "second"), ("second", "first")):
        both = draw([sheets[name] for name in names])
        apart = draw([sheets[f"{names[0]} rest"]]) + draw([sheets[names[1]]])
        assert both[..., 0].max() == both[..., 1].max() == 1.0
        # The layer's step moves no edge by more than float32's rounding: a sample in ten thousand may fall otherwise.
        assert np.count_nonzero(np.abs(both - apart).max(axis=2) > 1e-6) <= 2


@pytest.mark.parametrize("engine", ENGINES)
def test_coincident_triangles_of_a_mesh_fill_each_other_s_holes(quad: Any, flat_scene: Any, engine: str) -> None:
    # Meshes are not put into layers: both lie at the very same distance, and no ray may pass between them.
    odd = np.indices((16, 16)).sum(axis=0) % 2
    textures = {"odd": image(odd), "even": image(1 - odd)}
    tilted = quad(-9, -9, 9, 9, texture="odd", color=RED)
    vertices = read_only(tilted.vertices + tilted.vertices[:, :1] * [0.0, 0.0, 0.3])
    objects = [
        dataclasses.replace(tilted, vertices=vertices, is_polygon=False, texture=name, color=color)
        for name, color in (("odd", RED), ("even", GREEN))
    ]
    scene = flat_scene(objects, textures=textures, background=BLUE)
    pixels = render(scene, f"raytrace:spp=16,engine={engine}", size=(16, 16)).pixels
    np.testing.assert_allclose(pixels[..., 0] + pixels[..., 1], 1.0, atol=1e-6)
    assert not pixels[..., 2].any()
    assert 0.45 < pixels[..., 0].mean() < 0.55


def test_a_screen_of_400_wires_is_its_polygons_two_layers_deep(quad: Any, flat_scene: Any) -> None:
    # Wires are two texels of five wide; the nearer screen is tilted by its texture map, the farther stands upright.
    texture = {"t": image([[1, 1, 0, 0, 0]])}
    wires, sheets = [], []
    for z, color, count in ((-0.5, RED, 370), (0.0, GREEN, 400)):
        edges = -1.5 + 3.0 * np.arange(count) / count
        wide = 3.0 / count * 2 / 5
        wires += [quad(left, -1.5, left + wide, 1.5, z, color=color) for left in edges]
        uv = [[0, 0], [count, 0], [count, 1], [0, 1]]
        sheets.append(quad(-1.5, -1.5, 1.5, 1.5, z, color=color, texture="t", uv=uv))
    pictures = [
        render(flat_scene(objects, camera=PERSPECTIVE, textures=texture), "raytrace:spp=16", size=SIZE).pixels * 16
        for objects in (sheets, wires)
    ]
    assert 0.2 < (pictures[0] / 16).sum(axis=2).mean() < 0.9
    # A wire is 10^4 float32 roundings wide here: some samples in ten thousand lie within one of an edge.
    assert np.abs(pictures[0] - pictures[1]).sum() <= 2 * 5e-4 * pictures[0].size / 3 * 16


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("options", ["spp=1", "spp=5,texture=linear", "spp=16", "spp=9,texture=trilinear"])
def test_packets_equal_single_rays_bit_for_bit(quad: Any, flat_scene: Any, options: str, moving: bool) -> None:
    scene = screens(quad, flat_scene, PERSPECTIVE, moving=moving)
    packet, portable = (
        render(scene, f"raytrace:engine={engine},{options}", size=SIZE, frame=1, seed=3).pixels for engine in ENGINES
    )
    assert packet.std() > 0.05
    np.testing.assert_array_equal(packet, portable)


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("camera", [PERSPECTIVE, ORTHOGRAPHIC], ids=["perspective", "orthographic"])
def test_the_tracer_sees_what_the_rasterizer_sees_sample_for_sample(
    quad: Any, flat_scene: Any, camera: Camera, moving: bool
) -> None:
    scene = screens(quad, flat_scene, camera, moving=moving)
    traced = render(scene, "raytrace:spp=9,sampler=jittered,pattern=shared", size=SIZE).pixels
    drawn = render(scene, "raster:passes=9,sampler=jittered", size=SIZE).pixels
    solid = render(screens(quad, flat_scene, camera, moving=moving, cut=False), "raytrace:spp=9,sampler=jittered",
                   size=SIZE).pixels  # fmt: skip
    assert (np.abs(traced - solid) > 0.05).any(axis=2).mean() > 0.2
    # Edges of polygons and of texels, some 6 to a pixel here, fall otherwise within 1/512 of a pixel.
    assert (np.abs(traced - drawn) > 1e-3).any(axis=2).mean() < 0.02


@pytest.mark.parametrize(
    ("camera", "moving"),
    [(PERSPECTIVE, False), (ORTHOGRAPHIC, False), (ORTHOGRAPHIC, True)],
    ids=["perspective", "orthographic", "moving"],
)
def test_the_mean_of_many_samples_is_the_reference(quad: Any, flat_scene: Any, camera: Camera, moving: bool) -> None:
    # Few texels: the exact reference of what moves takes its time.
    tiles = {"a": random_image(7, 2, 2), "b": random_image(8, 3, 4)}
    slide = Motion(velocity=(9.0, -4.0, 0.0)) if moving else Motion()
    objects = [
        quad(-2, -2, 2, 2, -1.0, color=(0.2, 0.3, 0.9)),
        quad(-1.5, -1.5, 1.5, 1.5, 0.0, texture="a", motion=slide),
        quad(-1, -1, 1.3, 1, 0.5, texture="b"),
    ]
    objects = objects[:2] if moving else objects
    scene = flat_scene(objects, camera=camera, textures=tiles, animation=OPEN if moving else Animation())
    size, count = (4, 3) if moving else (8, 6), 1024
    exact = render(scene, "reference:", size=size)
    assert exact.uncertainty is not None
    pixels = render(scene, f"raytrace:spp={count},sampler=random", size=size).pixels.astype(np.float64)
    # Colours lie in [0, 1]: a value of mean m has a variance of at most m (1 - m), and 5.5 standard errors of it
    # (Bernstein's correction for rare samples added) are passed by one of 144 values once in 10^5 pictures.
    mean = np.clip(exact.pixels, 0.0, 1.0)
    bound = 5.5 * np.sqrt(mean * (1.0 - mean) / count) + 10.0 / count + exact.uncertainty
    assert (np.abs(pixels - exact.pixels) <= bound).all()
    assert abs(pixels.mean() - exact.pixels.mean()) < 5.5 * 0.5 / np.sqrt(count * size[0] * size[1]) + exact.uncertainty


def test_light_is_neither_lost_nor_made(quad: Any, flat_scene: Any) -> None:
    # Every ray ends on exactly one of red, green and blue.
    textures = {"coarse": image(TEXTURES["coarse"].texels[..., 3]), "fine": image(TEXTURES["fine"].texels[..., 3])}
    objects = [
        quad(-1.5, -1.5, 1.5, 1.5, 0.0, color=RED, texture="coarse", motion=Motion(velocity=(9.0, -4.0, 6.0))),
        quad(-1, -1, 1.3, 1, 0.3, color=GREEN, texture="fine"),
    ]
    scene = flat_scene(objects, camera=PERSPECTIVE, textures=textures, background=BLUE, animation=OPEN)
    for mode in ("point", "trilinear"):
        pixels = render(scene, f"raytrace:spp=16,texture={mode}", size=SIZE).pixels
        assert pixels.max(axis=(0, 1)).min() > 0.8
        np.testing.assert_allclose(pixels.sum(axis=2), 1.0, atol=1e-6)


@pytest.mark.parametrize("moving", [False, True])
def test_holes_are_the_same_on_any_number_of_threads(
    quad: Any, flat_scene: Any, monkeypatch: pytest.MonkeyPatch, moving: bool
) -> None:
    scene = screens(quad, flat_scene, PERSPECTIVE, moving=moving)
    pictures = []
    for threads in ("1", "2", "5"):
        monkeypatch.setenv("ALIASBENCH_THREADS", threads)
        pictures.append(render(scene, "raytrace:spp=6,sampler=jittered", size=SIZE, frame=2).pixels)
    np.testing.assert_array_equal(pictures[0], pictures[1])
    np.testing.assert_array_equal(pictures[0], pictures[2])


@pytest.mark.parametrize("engine", ENGINES)
def test_a_cutoff_that_no_texel_falls_below_changes_nothing(quad: Any, flat_scene: Any, engine: str) -> None:
    alpha = np.random.default_rng(5).uniform(0.25, 1.0, (6, 11))
    pictures = [
        render(
            flat_scene([quad(-7, -7, 7, 7, texture="t")], textures={"t": image(alpha, cutoff)}),
            f"raytrace:spp=4,texture=trilinear,engine={engine}", size=(16, 16),
        ).pixels
        for cutoff in (0.25, None)
    ]  # fmt: skip
    assert pictures[0].max() == 1.0
    np.testing.assert_array_equal(pictures[0], pictures[1])
