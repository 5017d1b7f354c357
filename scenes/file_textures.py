"""What a scene file says about textures, as the model's own data.

An image is named by a path relative to the scene file, by a photograph of scikit-image (``skimage:brick.png``), or held
in the file itself as a data URI; `source` is what the image is called, for people, where that is not its name.
"""

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.gltf_textures import FREE_TEXELS, TEXELS_PER_BYTE
from aliasbench.scenes.inline_data import DATA_PREFIX, decode_image
from aliasbench.scenes.limits import COUNT
from aliasbench.scenes.local_files import is_local
from aliasbench.scenes.model import TEXTURE_KINDS, Checker, Grating, ImageTexture, Texture, ZonePlate
from aliasbench.scenes.photographs import SOURCE_PREFIX, load_photograph
from aliasbench.scenes.schema import Table, shown
from aliasbench.scenes.textures import MOST_TEXELS, load_image

_KINDS = tuple(TEXTURE_KINDS.values())


def read_textures(table: Table, folder: Path) -> dict[str, Texture]:
    """Return the textures of the table `texture` by name; image paths are relative to `folder`."""
    textures: dict[str, Texture] = {}
    images = _Images(folder)
    for name in table.values:
        # The stand-in keeps objects from being told that there is no such texture.
        textures[name] = table.problems.attempt(_reader(table, name, images)) or Checker((1.0, 1.0))
    return textures


def _reader(table: Table, name: str, images: "_Images") -> Callable[[], Texture]:
    return lambda: _read_texture(table.table(name), images)


def _read_texture(table: Table, images: "_Images") -> Texture:
    table.check_keys((*_KINDS, "alpha_cutoff", "source"))
    kind = table.check_exclusive(_KINDS, "a texture")
    for key in ("alpha_cutoff", "source"):
        if table.has(key) and kind != "image":
            table.report(key, "left out: it belongs to textures with an image")
    if kind == "image":
        return _read_image(table, images)
    inner = table.table(kind)
    if kind == "checker":
        inner.check_keys(("squares", "black", "white"))
        across, up = inner.numbers("squares", 2, COUNT)
        if min(across, up) <= 0.0:
            inner.report("squares", f"two finite numbers over 0 and at most {COUNT:g} (squares per unit of u and of v)")
        return Checker((across, up), inner.color("black", (0.0, 0.0, 0.0)), inner.color("white", (1.0, 1.0, 1.0)))
    if kind == "grating":
        inner.check_keys(("cycles", "angle_deg", "phase", "profile", "low", "high"))
        return Grating(
            cycles=inner.number("cycles", at_least=0.0, at_most=COUNT),
            angle_deg=inner.number("angle_deg", 0.0, at_least=-COUNT, at_most=COUNT),
            phase=inner.number("phase", 0.0, at_least=-COUNT, at_most=COUNT),
            profile="sine" if inner.choice("profile", ("sine", "square"), "sine") == "sine" else "square",
            low=inner.color("low", (0.0, 0.0, 0.0)),
            high=inner.color("high", (1.0, 1.0, 1.0)),
        )
    inner.check_keys(("center", "k", "phase"))
    u, v = inner.numbers("center", 2, COUNT) if inner.has("center") else (0.5, 0.5)
    return ZonePlate(
        center=(u, v),
        k=inner.number("k", above=0.0, at_most=COUNT),
        phase=inner.number("phase", 0.0, at_least=-COUNT, at_most=COUNT),
    )


def _read_image(table: Table, images: "_Images") -> ImageTexture:
    given = table.text("image")
    cutoff = table.number("alpha_cutoff", at_least=0.0, at_most=1.0) if table.has("alpha_cutoff") else None
    source = None
    if table.has("source"):
        value = table.values["source"]
        if isinstance(value, str):
            source = value
        else:
            table.report("source", "a text: what the image is called")
    place = (*table.place, "image")
    if not given:
        table.problems.give_up()
    try:
        image = images.load(given, cutoff)
    except InputError as error:
        table.problems.refuse(place, f"{table.where('image')}: {error}")
    except (OSError, ValueError) as error:
        # A text that is no data URI, a path with a null character, a full disk.
        what = f"the data {error}" if given.startswith(DATA_PREFIX) else f"{shown(given)} cannot be read ({error})"
        table.problems.refuse(place, f"{table.where('image')}: {what}")
    return image if source is None else replace(image, source=source)


class _Images:
    """The images of one scene file: each is read once, and all together stay within what a file may ask for.

    Parameters
    ----------
    folder : Path
        To which paths are relative.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._loaded: dict[str, ImageTexture] = {}
        self._texels = 0
        self._bytes = 0

    def load(self, given: str, cutoff: float | None) -> ImageTexture:
        """Return the image of a path, a photograph's name or a data URI."""
        if given.startswith(SOURCE_PREFIX):
            return load_photograph(given, cutoff)
        if given not in self._loaded:
            image = self._inlined(given) if given.startswith(DATA_PREFIX) else self._beside(given)
            self._texels += image.texels.size // 4
            self._loaded[given] = image
        return replace(self._loaded[given], alpha_cutoff=cutoff)

    def _beside(self, given: str) -> ImageTexture:
        path = self._folder / given
        if is_local(path):
            self._bytes += path.stat().st_size
        return load_image(path, source=given, most_texels=self._left())

    def _inlined(self, given: str) -> ImageTexture:
        suffix, content = decode_image(given)
        self._bytes += len(content)
        with tempfile.TemporaryDirectory(prefix="aliasbench-") as temporary:
            path = Path(temporary) / f"inlined{suffix}"
            path.write_bytes(content)
            try:
                image = load_image(path, label="the image in the data", most_texels=self._left())
            except InputError as error:
                # The image library names the file that it was given.
                raise InputError(str(error).replace(f" ({path})", "").replace(str(path), "it")) from None
        return replace(image, source="")

    def _left(self) -> int:
        """Return how many texels the next image may have."""
        return max(0, min(MOST_TEXELS, max(FREE_TEXELS, TEXELS_PER_BYTE * self._bytes) - self._texels))
