"""What a scene file says about textures, as the model's own data.

An image is named by a path relative to the scene file, by a photograph of scikit-image (``skimage:brick.png``), or held
in the file itself as a data URI; `source` is what the image is called, for people, where that is not its name.
"""

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.inline_data import DATA_PREFIX, decode_image
from aliasbench.scenes.limits import COUNT
from aliasbench.scenes.model import Checker, Grating, ImageTexture, Texture, ZonePlate
from aliasbench.scenes.photographs import SOURCE_PREFIX, load_photograph
from aliasbench.scenes.schema import Table, shown
from aliasbench.scenes.textures import load_image

_KINDS = ("checker", "image", "grating", "zone_plate")


def read_textures(table: Table, folder: Path) -> dict[str, Texture]:
    """Return the textures of the table `texture` by name; image paths are relative to `folder`."""
    textures: dict[str, Texture] = {}
    for name in table.values:
        # The stand-in keeps objects from being told that there is no such texture.
        textures[name] = table.problems.attempt(_reader(table, name, folder)) or Checker((1.0, 1.0))
    return textures


def _reader(table: Table, name: str, folder: Path) -> Callable[[], Texture]:
    return lambda: _read_texture(table.table(name), folder)


def _read_texture(table: Table, folder: Path) -> Texture:
    table.check_keys((*_KINDS, "alpha_cutoff", "source"))
    kind = table.check_exclusive(_KINDS, "a texture")
    for key in ("alpha_cutoff", "source"):
        if table.has(key) and kind != "image":
            table.report(key, "left out: it belongs to textures with an image")
    if kind == "image":
        return _read_image(table, folder)
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


def _read_image(table: Table, folder: Path) -> ImageTexture:
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
        image = _load(given, folder, cutoff)
    except InputError as error:
        table.problems.refuse(place, f"{table.where('image')}: {error}")
    except (OSError, ValueError) as error:
        # A text that is no data URI, a path with a null character, a full disk.
        what = f"the data {error}" if given.startswith(DATA_PREFIX) else f"{shown(given)} cannot be read ({error})"
        table.problems.refuse(place, f"{table.where('image')}: {what}")
    return image if source is None else replace(image, source=source)


def _load(given: str, folder: Path, cutoff: float | None) -> ImageTexture:
    if given.startswith(SOURCE_PREFIX):
        return load_photograph(given, cutoff)
    if not given.startswith(DATA_PREFIX):
        return load_image(folder / given, alpha_cutoff=cutoff, source=given)
    suffix, content = decode_image(given)
    with tempfile.TemporaryDirectory(prefix="aliasbench-") as temporary:
        path = Path(temporary) / f"inlined{suffix}"
        path.write_bytes(content)
        try:
            return replace(load_image(path, alpha_cutoff=cutoff, label="the image in the data"), source="")
        except InputError as error:
            # The image library names the file that it was given.
            raise InputError(str(error).replace(f" ({path})", "").replace(str(path), "it")) from None
