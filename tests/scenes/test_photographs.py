"""Photographs are scikit-image's files, texel for texel, found without importing it and refused in one sentence."""

import subprocess
import sys
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from aliasbench.scenes import photographs
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.photographs import PHOTOGRAPHS, load_photograph
from aliasbench.scenes.textures import srgb_to_linear


def folder() -> Path:
    package = find_spec("skimage")
    assert package is not None
    assert package.origin is not None
    return Path(package.origin).parent / "data"


@pytest.fixture
def forgotten(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """A cache of its own, so that what other tests have read is read again."""
    monkeypatch.setattr(photographs, "_load", photographs._load.__wrapped__)
    return monkeypatch


def test_every_photograph_of_the_table_is_in_the_installed_package() -> None:
    assert {"brick", "grass", "gravel", "page"} <= set(PHOTOGRAPHS)
    assert len(PHOTOGRAPHS) >= 20
    for name, file in PHOTOGRAPHS.items():
        assert Path(file).stem == name
        assert (folder() / file).is_file()


@pytest.mark.parametrize("name", ["brick", "page", "coffee", "logo"])
def test_texels_are_the_files_in_linear_light_bottom_row_first(name: str) -> None:
    with Image.open(folder() / PHOTOGRAPHS[name]) as file:
        stored = np.asarray(file.convert("RGBA"), dtype=np.float64) / 255
    stored[..., :3] = srgb_to_linear(stored[..., :3])
    texture = load_photograph(name)
    np.testing.assert_allclose(texture.texels, stored[::-1], atol=2e-7)
    assert texture.source == f"skimage:{name}.png"
    assert texture.alpha_cutoff is None


def test_a_photograph_is_one_object_under_all_its_names_and_shares_texels_with_its_cuts() -> None:
    brick = load_photograph("brick")
    # as many as there are: none is forgotten for another
    assert photographs._load.cache_info().maxsize == len(PHOTOGRAPHS)
    assert load_photograph("brick.png") is load_photograph("skimage:brick.png") is load_photograph("skimage:brick")
    assert load_photograph("brick") is brick
    cut = load_photograph("brick.png", alpha_cutoff=0.25)
    assert cut.alpha_cutoff == 0.25
    assert cut.texels is brick.texels
    assert cut.source == brick.source


def test_an_unknown_photograph_is_refused_with_the_nearest() -> None:
    with pytest.raises(
        InputError, match=r"unknown photograph 'bricks'; did you mean 'brick'\? known: astronaut, brick"
    ):
        load_photograph("bricks")
    for outside in (
        "",
        "skimage:",
        "../brick.png",
        "/etc/hostname",
        "README.txt",
        "brick.jpg",
        "skimage:skimage:brick",
    ):
        with pytest.raises(InputError, match="unknown photograph"):
            load_photograph(outside)


def test_a_missing_package_is_refused_in_a_sentence(forgotten: pytest.MonkeyPatch) -> None:
    forgotten.setattr(photographs, "find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"photograph 'grass\.png' is scikit-image's, which is not installed; install"):
        load_photograph("grass")


def test_a_photograph_that_the_package_lacks_is_refused_in_a_sentence(
    forgotten: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    spec = ModuleSpec("skimage", None, origin=str(tmp_path / "__init__.py"))
    forgotten.setattr(photographs, "find_spec", lambda _: spec)
    with pytest.raises(
        InputError, match=r"photograph 'page\.png' is not in the installed scikit-image's folder of data"
    ):
        load_photograph("page")


def test_reading_a_photograph_does_not_import_its_package() -> None:
    program = (
        "import sys\n"
        "from aliasbench.scenes.photographs import load_photograph\n"
        "print(load_photograph('page').texels.shape, *(m for m in ('skimage', 'scipy', 'numba') if m in sys.modules))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout == "(191, 384, 4)\n"
