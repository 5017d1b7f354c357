"""Pictures in files."""

from pathlib import Path

import numpy as np
import pytest

from aliasbench.bench.frames import check_output, read_image, remove_unfinished, write_image
from aliasbench.scenes.errors import InputError


def test_exr_returns_every_float32_bit_for_bit(tmp_path: Path) -> None:
    pixels = np.random.default_rng(1).normal(size=(5, 7, 3)).astype(np.float32)
    special = [0.0, -0.0, 1e-45, 3.4e38, -2.5, np.inf, -np.inf, 65505.0, 1.0 + 2.0**-23]
    pixels.reshape(-1)[: len(special)] = special
    write_image(tmp_path / "a.exr", pixels)
    assert read_image(tmp_path / "a.exr").tobytes() == pixels.tobytes()
    assert [p.name for p in tmp_path.iterdir()] == ["a.exr"]


def test_the_same_pixels_are_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, zone in (("a.exr", "UTC"), ("b.exr", "Asia/Tokyo")):
        monkeypatch.setenv("TZ", zone)
        write_image(tmp_path / name, np.full((4, 4, 3), 0.3))
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()
    assert b"1970:01:01" in (tmp_path / "a.exr").read_bytes()


def test_exr_keeps_row_0_at_the_top_and_rounds_float64_to_nearest(tmp_path: Path) -> None:
    pixels = np.zeros((2, 3, 3))
    pixels[0, 2, 1] = 1.0 / 3.0
    write_image(tmp_path / "a.exr", pixels)
    assert np.array_equal(read_image(tmp_path / "a.exr"), pixels.astype(np.float32))


def test_png_is_srgb_encoded_and_clamped(tmp_path: Path) -> None:
    import OpenImageIO as oiio

    linear = [-0.5, 0.0, 0.002, 0.0031308, 0.18, 0.5, 1.0, 7.0, float("nan")]
    pixels = np.repeat(np.array(linear)[None, :, None], 3, axis=2)
    write_image(tmp_path / "a.png", pixels)
    source = oiio.ImageInput.open(str(tmp_path / "a.png"))
    stored = source.read_image(oiio.UINT8)
    source.close()
    # IEC 61966-2-1 by hand: 12.92 * .002 * 255 = 6.59; .0031308 -> .04045 -> 10.31; .18 -> .46135 -> 117.65
    assert stored[0, :, 0].tolist() == [0, 0, 7, 10, 118, 188, 255, 255, 0]
    assert stored.shape == (1, 9, 3)


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("a.jpg", r"unknown extension of '.*a\.jpg': '\.jpg'; .*\.exr, \.png"),
        ("a", r"unknown extension"),
        ("missing/a.exr", r"cannot write '.*a\.exr': no such folder"),
    ],
)
def test_what_cannot_be_written_is_refused_before_anything_is_rendered(
    tmp_path: Path, name: str, sentence: str
) -> None:
    with pytest.raises(InputError, match=sentence):
        check_output(tmp_path / name)


def test_a_folder_in_the_place_of_the_picture_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.exr").mkdir()
    with pytest.raises(InputError, match="it is a folder"):
        check_output(tmp_path / "a.exr")
    with pytest.raises(InputError, match="cannot write"):
        write_image(tmp_path / "a.exr", np.zeros((2, 2, 3)))
    assert [p.name for p in tmp_path.iterdir()] == ["a.exr"]


def test_a_path_that_can_be_written_is_accepted_and_left_alone(tmp_path: Path) -> None:
    check_output(tmp_path / "a.png")
    assert list(tmp_path.iterdir()) == []


def test_pictures_that_are_none_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_image(tmp_path / "none.exr")
    (tmp_path / "bad.exr").write_bytes(b"no picture at all")
    with pytest.raises(InputError, match="cannot be read"):
        read_image(tmp_path / "bad.exr")
    with pytest.raises(ValueError, match=r"\(h, w, 3\)"):
        write_image(tmp_path / "a.exr", np.zeros((2, 2)))


def test_what_killed_writers_left_is_removed_and_nothing_else(tmp_path: Path) -> None:
    for name in (".writing-abc.exr", "a.exr"):
        (tmp_path / name).write_bytes(b"x")
    remove_unfinished(tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["a.exr"]
