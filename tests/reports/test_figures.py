"""Laws of the embedded pictures: PNG keeps every byte, error maps keep the order of errors."""

import base64
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from aliasbench.reports import figures


def decode(png: bytes, folder: Path) -> np.ndarray:
    path = folder / "picture.png"
    path.write_bytes(png)
    return np.asarray(oiio.ImageBuf(str(path)).get_pixels(oiio.UINT8))


@pytest.mark.parametrize("shape", [(5, 7), (1, 1), (33, 2), (5, 7, 3), (1, 1, 3), (64, 31, 3)])
def test_png_keeps_every_byte(shape: tuple[int, ...], tmp_path: Path) -> None:
    smooth = np.add.outer(np.arange(shape[0]) * 3, np.arange(shape[1]) * 5)
    for pixels in (
        np.random.default_rng(0).integers(0, 256, shape),
        np.broadcast_to(smooth.T.T[..., None], (*shape[:2], 3)),
    ):
        stored = np.ascontiguousarray(pixels if pixels.ndim == len(shape) else pixels[..., 0]).astype(np.uint8)
        read = decode(figures.png_bytes(stored), tmp_path)
        np.testing.assert_array_equal(read.reshape(shape), stored)


def test_png_palette_gives_the_colours(tmp_path: Path) -> None:
    palette = figures.heat_palette()
    levels = np.arange(figures.HEAT_LEVELS, dtype=np.uint8).reshape(8, -1)
    read = decode(figures.png_bytes(levels, palette), tmp_path)
    np.testing.assert_array_equal(read[..., :3], palette[levels])


def test_pictures_are_srgb_encoded_and_clipped(tmp_path: Path) -> None:
    # linear .5 is sRGB 187.5 / 255 (IEC 61966-2-1); what is not finite or out of range is clipped
    row = np.array([0.0, 0.5, 1.0, 7.0, -1.0, np.nan, np.inf])
    image = np.repeat(row[None, :, None], 3, axis=2)
    image[0, 1, 0] = 0.25
    picture = figures.encode_picture(image)
    assert (picture.width, picture.height) == (7, 1)
    read = decode(base64.b64decode(picture.uri.partition(",")[2]), tmp_path)
    np.testing.assert_array_equal(read[0, :, 1], [0, 188, 255, 255, 0, 0, 255])
    assert read[0, 1, 0] == 137


def test_exposure_multiplies_before_clipping() -> None:
    image = np.full((2, 2, 3), 4.0)
    assert figures.encode_picture(image, 0.25).uri == figures.encode_picture(image / 4).uri


def test_error_maps_rise_with_the_error_and_end_at_the_scale() -> None:
    errors = np.array([0.0, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 50.0, np.nan])
    test = np.zeros((1, errors.size, 3))
    test[0, :, 1] = -errors
    levels = figures.heat_levels(test, np.zeros_like(test), 1.0)[0]
    last = figures.HEAT_LEVELS - 1
    # three decades: each is a third of the scale
    np.testing.assert_array_equal(levels, [0, 0, 0, round(last / 3), round(2 * last / 3), last, last, last])


def test_error_maps_do_not_change_with_exposure() -> None:
    rng = np.random.default_rng(1)
    test, reference = rng.random((2, 9, 9, 3))
    np.testing.assert_array_equal(
        figures.heat_levels(test, reference, 1.0), figures.heat_levels(8 * test, 8 * reference, 8.0)
    )


def test_palette_brightens_from_first_to_last() -> None:
    luminance = figures.heat_palette() @ np.array([0.2126, 0.7152, 0.0722])
    assert np.all(np.diff(luminance) > 0)


def test_crop_is_the_centre_and_leaves_small_pictures_alone() -> None:
    image = np.arange(10 * 6 * 3, dtype=float).reshape(10, 6, 3)
    np.testing.assert_array_equal(figures.crop_to(image, 4), image[3:7, 1:5])
    np.testing.assert_array_equal(figures.crop_to(image, 10), image)


def test_the_close_up_starts_where_techniques_differ() -> None:
    same, other = np.full((40, 60), 0.5), np.full((40, 60), 0.5)
    other[20:24, 33:41] = 0.0
    left, top = figures.most_telling_region([same, other], 8, 4)
    assert (left, top) == (33, 20)
    left, top = figures.most_telling_region([same[:3, :5], same[:3, :5]], 8, 4)
    assert (left, top) == (0, 0)
    assert figures.most_telling_region([], 8, 4) == (0, 0)
