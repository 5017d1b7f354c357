"""Photographs and scans as textures: those that scikit-image ships inside its own package, read without importing it.

Real pictures have what analytic patterns lack: detail at every scale, irregular, with the camera's own noise. These lie
on every machine that has scikit-image installed, so nothing is copied here and nothing is fetched: the pictures that
scikit-image would download on demand are not in the table. All are read as sRGB, whole, and repeat as they are (brick,
grass and gravel were made to be looked at as textures; they show a seam where one copy meets the next, exactly as large
as it is in the file).

A photograph is named by its word (`brick`) or its file (`brick.png`); scene files write
``image = "skimage:brick.png"``, and `ImageTexture.source` is that text.
"""

from collections.abc import Mapping
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType

from aliasbench.scenes.errors import InputError, unknown_name
from aliasbench.scenes.model import ImageTexture
from aliasbench.scenes.textures import load_image

SOURCE_PREFIX = "skimage:"

PHOTOGRAPHS: Mapping[str, str] = MappingProxyType(
    {
        "astronaut": "astronaut.png",
        "brick": "brick.png",
        "camera": "camera.png",
        "cell": "cell.png",
        "chelsea": "chelsea.png",
        "coffee": "coffee.png",
        "coins": "coins.png",
        "grass": "grass.png",
        "gravel": "gravel.png",
        "horse": "horse.png",
        "hubble_deep_field": "hubble_deep_field.jpg",
        "ihc": "ihc.png",
        "logo": "logo.png",
        "moon": "moon.png",
        "motorcycle_left": "motorcycle_left.png",
        "motorcycle_right": "motorcycle_right.png",
        "page": "page.png",
        "retina": "retina.jpg",
        "rocket": "rocket.jpg",
        "text": "text.png",
    }
)


def load_photograph(name: str, alpha_cutoff: float | None = None) -> ImageTexture:
    """Return a photograph of scikit-image as a texture. Its file is read once, and all share its texels.

    Parameters
    ----------
    name : str
        A key of `PHOTOGRAPHS` or the file's name, with or without ``skimage:`` before it.
    alpha_cutoff : float or None
        Below this alpha (0 to 1) the surface is absent.

    Raises
    ------
    InputError
        If there is no such photograph, scikit-image is not installed, or its package lacks the file.
    """
    word = name.removeprefix(SOURCE_PREFIX)
    files = {file: key for key, file in PHOTOGRAPHS.items()}
    if word not in PHOTOGRAPHS and word not in files:
        raise unknown_name("photograph", name, PHOTOGRAPHS)
    whole = _load(PHOTOGRAPHS.get(word, word))
    return whole if alpha_cutoff is None else ImageTexture(whole.texels, alpha_cutoff, whole.source)


@lru_cache(maxsize=len(PHOTOGRAPHS))
def _load(file: str) -> ImageTexture:
    return load_image(_path(file), source=SOURCE_PREFIX + file)


def _path(file: str) -> Path:
    """Return where scikit-image's package keeps one of its photographs; it is looked up, not imported."""
    package = find_spec("skimage")
    if package is None or package.origin is None:
        raise InputError(f"photograph {file!r} is scikit-image's, which is not installed; install scikit-image")
    path = Path(package.origin).parent / "data" / file
    if not path.is_file():
        raise InputError(
            f"photograph {file!r} is not in the installed scikit-image's folder of data; reinstall scikit-image"
        )
    return path
