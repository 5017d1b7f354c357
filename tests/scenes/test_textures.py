"""Texture values follow the stated conventions, and filtering loses no light."""

import os
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Camera, Checker, Grating, ImageTexture, Scene, Texture, ZonePlate
from aliasbench.scenes.shapes import quad
from aliasbench.scenes.textures import (
    MipChain,
    evaluate_point,
    linear_to_srgb,
    load_image,
    mip_chain,
    scene_chain,
    srgb_to_linear,
)


def write(path: Path, pixels: np.ndarray) -> Path:
    out = oiio.ImageOutput.create(str(path))
    assert out is not None, oiio.geterror()
    kind = {"uint8": oiio.UINT8, "uint16": oiio.UINT16}.get(pixels.dtype.name, oiio.FLOAT)
    assert out.open(str(path), oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], kind))
    assert out.write_image(pixels)
    out.close()
    return path


def image(h: int, w: int) -> ImageTexture:
    rng = np.random.default_rng(h * 100 + w)
    return ImageTexture(rng.random((h, w, 4)).astype(np.float32))


def test_srgb_has_its_published_values_and_undoes_itself() -> None:
    encoded = np.linspace(0.0, 1.0, 256)
    # the two pieces of the standard meet to 1e-8 only
    np.testing.assert_allclose(linear_to_srgb(srgb_to_linear(encoded)), encoded, rtol=0, atol=1e-7)
    np.testing.assert_allclose(srgb_to_linear(np.array([0.0, 0.5, 1.0])), [0.0, 0.21404114, 1.0], rtol=0, atol=1e-8)
    # 1.055 - 0.055 is half an ulp off
    np.testing.assert_allclose(linear_to_srgb(np.array([-1.0, 2.0])), [0.0, 1.0], rtol=0, atol=2**-52)


def test_an_eight_bit_image_is_srgb_with_its_bottom_row_first(tmp_path: Path) -> None:
    pixels = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [128, 128, 128]]], np.uint8)
    texture = load_image(write(tmp_path / "a.png", pixels))
    assert texture.texels.shape == (2, 2, 4)
    grey = float(srgb_to_linear(np.array(128 / 255)))
    bottom_left = evaluate_point(texture, np.array([0.1, 0.1]))
    bottom_right = evaluate_point(texture, np.array([0.9, 0.1]))
    top_left = evaluate_point(texture, np.array([0.1, 0.9]))
    assert bottom_left.tolist() == [0.0, 0.0, 1.0, 1.0]
    # encoded values and texels are rounded to float32, the first magnified by the exponent 2.4
    np.testing.assert_allclose(bottom_right, [grey, grey, grey, 1.0], rtol=3.4 * 2**-24)
    assert top_left.tolist() == [1.0, 0.0, 0.0, 1.0]


def test_a_float_image_is_linear_and_keeps_values_over_one(tmp_path: Path) -> None:
    pixels = np.full((1, 1, 3), 4.5, np.float32)
    assert load_image(write(tmp_path / "a.exr", pixels)).texels[0, 0].tolist() == [4.5, 4.5, 4.5, 1.0]


def test_grey_and_alpha_are_told_apart(tmp_path: Path) -> None:
    grey = load_image(write(tmp_path / "g.png", np.full((1, 1, 1), 255, np.uint8)))
    assert grey.texels[0, 0].tolist() == [1.0, 1.0, 1.0, 1.0]
    rgba = load_image(write(tmp_path / "a.png", np.array([[[255, 255, 255, 51]]], np.uint8)), alpha_cutoff=0.5)
    assert rgba.alpha_cutoff == 0.5
    assert rgba.texels[0, 0, 3] == pytest.approx(0.2, abs=1e-7)  # alpha is no light: not decoded


@pytest.mark.parametrize(
    ("content", "message"),
    [(None, "no such file"), (b"", "cannot be read"), (b"this is no picture", "cannot be read")],
)
def test_an_image_that_cannot_be_read_is_refused(tmp_path: Path, content: bytes | None, message: str) -> None:
    path = tmp_path / "a.png"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=f"image '.*a.png': {message}"):
        load_image(path)


def test_an_image_with_a_value_that_is_not_finite_is_refused(tmp_path: Path) -> None:
    pixels = np.ones((2, 2, 3), np.float32)
    pixels[1, 0, 2] = np.nan
    with pytest.raises(InputError, match="has values that are not finite"):
        load_image(write(tmp_path / "a.exr", pixels))


def test_values_that_no_picture_holds_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"has a value of 1e\+16; at most 1e\+15 is allowed"):
        load_image(write(tmp_path / "a.exr", np.full((1, 1, 3), 1e16, np.float32)))


def test_a_damaged_exr_is_read_or_refused_in_a_sentence(tmp_path: Path) -> None:
    path = write(tmp_path / "a.exr", np.ones((8, 8, 3), np.float32))
    data = path.read_bytes()
    said = []
    for k in range(0, len(data), 3):
        path.write_bytes(data[:k] + b"\xff" + data[k + 1 :])
        try:
            load_image(path)
        except InputError as error:
            said.append(str(error))
    assert len(said) > 10
    assert all(text.isprintable() for text in said)
    assert any("damaged" in text for text in said)


def test_sixteen_bits_are_read_as_srgb_and_alpha_as_it_is(tmp_path: Path) -> None:
    values = np.array([0, 1, 2570, 32768, 65535], np.uint16)
    paths = [write(tmp_path / f"{n}.png", np.repeat(values, n).reshape(1, 5, n)) for n in (3, 4)]
    grey, clear = (load_image(path).texels[0] for path in paths)
    np.testing.assert_allclose(grey[:, 0], srgb_to_linear(values / 65535), rtol=1e-7)
    np.testing.assert_allclose(clear[:, 3], values / 65535, rtol=1e-7)


@pytest.mark.parametrize("damage", ["corrupt", "cut off"])
def test_a_damaged_image_is_refused_once_and_nothing_else_is_said(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], damage: str
) -> None:
    path = write(tmp_path / "a.png", np.random.default_rng(1).integers(0, 256, (64, 64, 3)).astype(np.uint8))
    data = bytearray(path.read_bytes())
    if damage == "corrupt":
        data[len(data) // 2] ^= 255
    else:
        del data[len(data) // 2 :]
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"cannot be read \([^()\n]+\)$") as caught:
        load_image(path)
    assert "PNG library error" not in str(caught.value)
    os.write(2, b"heard again")
    assert capfd.readouterr() == ("", "heard again")


def test_what_is_no_regular_file_is_refused_as_such(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo.png")
    for path in (tmp_path, tmp_path / "fifo.png", Path("/dev/zero")):
        with pytest.raises(InputError, match="not a regular file"):
            load_image(path)
    with pytest.raises(InputError, match="no such file"):
        load_image(tmp_path / "gone.png")
    with pytest.raises(InputError, match="File name too long"):
        load_image(tmp_path / ("x" * 5000))


@pytest.mark.parametrize("shift", [-3.0, 0.0, 5.0])
def test_an_image_repeats_and_texel_k_covers_k_to_k_plus_one(shift: float) -> None:
    texture = image(3, 4)
    for column in range(4):
        for row in range(3):
            for a, b in ((0.001, 0.001), (0.5, 0.5), (0.999, 0.999)):
                uv = np.array([(column + a) / 4 + shift, (row + b) / 3 - shift])
                np.testing.assert_array_equal(evaluate_point(texture, uv), texture.texels[row, column])


def test_the_first_square_of_a_checker_is_black_and_colours_are_kept() -> None:
    texture = Checker((2.0, 4.0), black=(0.1, 0.0, 0.0), white=(0.0, 0.9, 0.0))
    uv = np.array([[0.1, 0.1], [0.6, 0.1], [0.6, 0.3], [-0.1, 0.1], [1.1, 0.1]])
    expected = [texture.black, texture.white, texture.black, texture.white, texture.black]
    np.testing.assert_allclose(evaluate_point(texture, uv)[:, :3], expected, rtol=0, atol=1e-16)


def test_a_grating_runs_along_its_angle_with_its_phase() -> None:
    uv = np.array([[0.3, 0.2]])
    s = 0.3 * np.cos(np.radians(30.0)) + 0.2 * np.sin(np.radians(30.0))
    wave = np.cos(2 * np.pi * (5.0 * s + 0.2))
    sine = evaluate_point(Grating(5.0, 30.0, 0.2), uv)[0]
    np.testing.assert_allclose(sine, [(1 + wave) / 2] * 3 + [1.0], rtol=0, atol=1e-14)
    square = evaluate_point(Grating(5.0, 30.0, 0.2, "square", (0.2,) * 3, (0.7,) * 3), uv)[0]
    np.testing.assert_allclose(square[:3], 0.7 if wave > 0 else 0.2, rtol=0, atol=1e-15)


def test_a_zone_plate_is_its_formula() -> None:
    value = evaluate_point(ZonePlate((0.5, 0.25), 300.0, 1.0), np.array([0.9, 0.1]))
    assert value[0] == pytest.approx((1 + np.cos(300.0 * (0.16 + 0.0225) + 1.0)) / 2, abs=1e-13)


TEXTURES: dict[str, Texture] = {
    "square": image(8, 8),
    "wide": image(2, 16),
    "odd": image(7, 5),
    "prime": image(1, 13),
    "one": image(1, 1),
    "checker": Checker((7.0, 3.0)),
    "grating": Grating(11.0, 20.0, 0.3),
    "zone plate": ZonePlate((0.5, 0.5), 100.0),
}


@cache
def chain_of(name: str) -> MipChain:
    return mip_chain(TEXTURES[name])


@pytest.mark.parametrize("name", TEXTURES)
def test_every_level_of_a_mip_chain_has_the_mean_of_the_first(name: str) -> None:
    chain = chain_of(name)
    means = [level.mean(axis=(0, 1), dtype=np.float64) for level in chain.levels]
    # each level is rounded to float32 once: half an ulp of 1 for each
    for depth, mean in enumerate(means):
        np.testing.assert_allclose(mean, means[0], rtol=0, atol=(depth + 1) * 2**-24)


@pytest.mark.parametrize("name", TEXTURES)
def test_levels_halve_down_to_one_texel(name: str) -> None:
    shapes = [level.shape[:2] for level in chain_of(name).levels]
    assert shapes[-1] == (1, 1)
    for (h, w), (h2, w2) in pairwise(shapes):
        assert (h2, w2) == (max(1, h // 2), max(1, w // 2))


def area_mean(
    texture: Texture, linear: np.ndarray, offset: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """The mean of a formula over a box of its image's coordinates: Gauss for smooth ones, a raster for steps."""
    if isinstance(texture, ZonePlate):
        # nodes for the radians that the phase turns by in the box, which is less than 2 uv from the plate's middle
        nodes, weights = np.polynomial.legendre.leggauss(
            24 + int(4 * abs(texture.k) * np.max((high - low) / linear.diagonal()))
        )
    elif isinstance(texture, Grating) and texture.profile == "sine":
        nodes, weights = np.polynomial.legendre.leggauss(24)
    else:
        # a power of two: steps are between its cells
        nodes, weights = (np.arange(64) + 0.5) / 32 - 1, np.full(64, 2 / 64)
    places = (low + high)[:, None] / 2 + (high - low)[:, None] / 2 * nodes
    tile = np.stack(np.broadcast_arrays(places[0], places[1][:, None]), axis=-1)
    values = evaluate_point(texture, (tile - offset) @ np.linalg.pinv(linear).T)
    mean: np.ndarray = np.einsum("vuc,v,u->c", values, weights, weights) / 4
    return mean


@pytest.mark.parametrize(
    ("texture", "low", "high"),
    [
        (Checker((7.3, 3.0), (0.1, 0.2, 0.3), (0.7, 1.0, 0.5)), (0.0, 0.0), (1.0, 1.0)),
        (Grating(11.4, 20.0, 0.3, "sine", (0.2,) * 3, (1.0,) * 3), (0.0, 0.0), (1.0, 1.0)),
        (Grating(0.7, -70.0, -0.1, "square"), (0.0, 0.0), (1.0, 1.0)),
        (ZonePlate((0.5, 0.5), 100.0), (0.0, 0.0), (1.0, 1.0)),
        (ZonePlate((-0.3, 0.6), 40000.0, 1.0), (-0.5, 0.2), (-0.2, 0.9)),
        (ZonePlate((0.5, 0.5), -9000.0, -2.0), (-6.75, -0.25), (2.75, 1.25)),
        (ZonePlate((0.0, 0.0), 0.0, 0.4), (-30.0, 0.0), (1000.0, 1.0)),
    ],
)
def test_every_level_of_an_analytic_texture_has_its_means_over_areas(
    texture: Texture, low: tuple[float, float], high: tuple[float, float]
) -> None:
    chain = mip_chain(texture, low, high)
    linear, offset = chain.uv_matrix[:, :2], chain.uv_matrix[:, 2]
    rng = np.random.default_rng(8)
    for depth, level in enumerate(chain.levels):
        size = np.array(level.shape[1::-1])
        if isinstance(texture, ZonePlate) and 2 * abs(texture.k) / size.min() / linear.max() > 40:
            continue  # too many nodes
        for _ in range(3):
            texel = rng.integers(size)
            expected = area_mean(texture, linear, offset, texel / size, (texel + 1) / size)
            # levels are rounded to float32; 1e-9: phases of 10^5 radians
            atol = (depth + 1) * 2**-24 + 1e-9
            np.testing.assert_allclose(level[texel[1], texel[0]], expected, rtol=0, atol=atol)


@pytest.mark.parametrize("plates", [1, 20, 10**6])
@pytest.mark.parametrize("high", [(1.0, 1.0), (3.0, 0.3), (1e5, 1.0), (-0.6999, 0.1001)])
def test_a_zone_plate_s_image_covers_what_is_looked_at_and_is_of_a_bounded_size(
    high: tuple[float, float], plates: int
) -> None:
    chain = mip_chain(ZonePlate((0.5, 0.5), 10.0), (-0.7, 0.1), high, plates)
    height, width = chain.levels[0].shape[:2]
    assert width * height <= max(2**23 // plates, 2**17)
    assert max(width, height) <= 8192
    tile = np.array([(-0.7, 0.1, 1.0), (*high, 1.0)]) @ chain.uv_matrix.T
    # with room for what filters see beyond; rounding aside
    assert (tile * (width, height) >= 63.99).all()
    assert (tile * (width, height) <= np.array([width, height]) - 63.99).all()
    # square texels, a power of two of them to a unit
    assert chain.uv_matrix[0, 0] * width == pytest.approx(chain.uv_matrix[1, 1] * height)
    assert np.log2(chain.uv_matrix[0, 0] * width) % 1 == pytest.approx(0.0, abs=1e-9)


def test_a_scene_s_chain_covers_all_surfaces_that_show_the_plate_and_no_others() -> None:
    uvs = ([(0, 0), (1, 0), (1, 1), (0, 1)], [(-2, 0), (-1, 0), (-1, 1), (-2, 1)], [(0, 0), (9, 0), (9, 9), (0, 9)])
    corners = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)]
    objects = [quad(corners, uv=uv, texture=name) for uv, name in zip(uvs, ("a", "a", "b"), strict=True)]
    textures: dict[str, Texture] = {"a": ZonePlate((0.0, 0.0), 9.0), "b": Checker((2.0, 2.0))}
    scene = Scene("two", Camera("orthographic", height=2.0), tuple(objects), textures)
    np.testing.assert_array_equal(
        scene_chain(scene, "a").uv_matrix, mip_chain(textures["a"], (-2.0, 0.0), (1.0, 1.0)).uv_matrix
    )
    np.testing.assert_array_equal(scene_chain(scene, "b").uv_matrix, mip_chain(textures["b"]).uv_matrix)


def test_halving_an_even_image_averages_two_by_two() -> None:
    texture = image(4, 6)
    expected = texture.texels.astype(np.float64).reshape(2, 2, 3, 2, 4).mean(axis=(1, 3))
    np.testing.assert_allclose(mip_chain(texture).levels[1], expected, rtol=0, atol=2**-24)


def test_halving_three_texels_weighs_each_by_what_is_covered() -> None:
    texture = ImageTexture(np.arange(12, dtype=np.float32).reshape(1, 3, 4))
    expected = texture.texels.astype(np.float64).mean(axis=1)
    np.testing.assert_allclose(mip_chain(texture).levels[1][:, 0], expected, rtol=2**-24)


def test_texels_of_a_chain_are_read_only() -> None:
    for level in mip_chain(image(4, 4)).levels:
        assert level.dtype == np.float32
        assert not level.flags.writeable
