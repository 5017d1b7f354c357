"""What a glTF material comes to without light: a colour, a texture, and what is cut out.

All surfaces are drawn unlit in their base colour, factor times texture (a file may say KHR_materials_unlit, or not);
of KHR_materials_pbrSpecularGlossiness it is the diffuse colour. Alpha cuts out, it does not blend: MASK below its
cutoff, BLEND below one half (of two half-transparent layers one is drawn, as a screen door would), OPAQUE not at all.

Textures repeat in this project. Where a sampler says clamp or mirror and texture coordinates leave the unit square,
the texture is laid out as the sampler says, over as many periods as are used, and the coordinates are scaled to it.
Texels are the same then; only the blend of two borders under linear filtering may differ, by half a texel.
"""

import math
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.gltf_document import Document, decode_data_uri
from aliasbench.scenes.limits import COUNT, RADIANCE
from aliasbench.scenes.local_files import path_beside, read_local
from aliasbench.scenes.model import FloatArray, ImageTexture, Vec3, read_only
from aliasbench.scenes.schema import Table
from aliasbench.scenes.textures import load_image

FREE_TEXELS = 2**25  # of all textures of a file, half a gigabyte of them
TEXELS_PER_BYTE = 16  # and as many more for each byte of its images: what photographs come to, and bombs do not
_BLEND_CUTOFF = 0.5
_WRAPS: Mapping[int, str] = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
_FORMATS = ((b"\x89PNG\r\n\x1a\n", ".png"), (b"\xff\xd8\xff", ".jpg"))


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """How a primitive looks.

    Attributes
    ----------
    color : Vec3
        Linear RGB.
    image : int or None
        An index of images.
    cutoff : float or None
        Of the image's alpha.
    uv_set : int
        Which TEXCOORD it uses.
    uv_matrix : (2, 3) float64
        From (u, v, 1) of the file to the image's, v down.
    wraps : pair of str
        Along u and v: ``repeat``, ``mirror`` or ``clamp``.
    absent : bool
        Nothing of it is left by its alpha.
    """

    color: Vec3 = (1.0, 1.0, 1.0)
    image: int | None = None
    cutoff: float | None = None
    uv_set: int = 0
    uv_matrix: FloatArray = field(default_factory=lambda: np.eye(3)[:2])
    wraps: tuple[str, str] = ("repeat", "repeat")
    absent: bool = False


def read_look(document: Document, material: Table | None) -> Look:
    """Return how a material looks; None is the default material, white."""
    if material is None:
        return Look()
    glossy = material.table("extensions").table("KHR_materials_pbrSpecularGlossiness")
    if glossy.values and not material.has("pbrMetallicRoughness"):
        base, factor_key, texture_key = glossy, "diffuseFactor", "diffuseTexture"
    else:
        base, factor_key, texture_key = material.table("pbrMetallicRoughness"), "baseColorFactor", "baseColorTexture"
    red, green, blue, alpha = base.numbers(factor_key, 4, RADIANCE) if base.has(factor_key) else (1.0, 1.0, 1.0, 1.0)
    if min(red, green, blue, alpha) < 0.0:
        base.refuse(factor_key, "four numbers of at least 0")
    mode = material.choice("alphaMode", ("OPAQUE", "MASK", "BLEND"), "OPAQUE")
    cutoff = None
    if mode != "OPAQUE":
        least = material.number("alphaCutoff", 0.5, at_least=0.0, at_most=COUNT) if mode == "MASK" else _BLEND_CUTOFF
        if alpha < least:
            return Look(absent=True)
        cutoff = least / alpha if alpha > 0.0 else None
    color = (red, green, blue)
    if not base.has(texture_key):
        return Look(color)
    return _with_texture(document, base.table(texture_key), color, cutoff)


def _with_texture(document: Document, info: Table, color: Vec3, cutoff: float | None) -> Look:
    found = document.follow(info, "index", "textures")
    if found is None:
        info.refuse("index", "an index of textures")
    texture = found[1]
    image = document.follow(texture, "source", "images")
    if image is None:
        texture.refuse("source", "an index of images (PNG or JPEG; images of extensions are not read)")
    sampler = document.follow(texture, "sampler", "samplers")
    wraps = ("repeat", "repeat") if sampler is None else (_wrap(sampler[1], "wrapS"), _wrap(sampler[1], "wrapT"))
    transform = info.table("extensions").table("KHR_texture_transform")
    uv_set = (transform if transform.has("texCoord") else info).whole("texCoord", 0, at_least=0)
    return Look(color, image[0], cutoff, uv_set, _uv_matrix(transform), wraps)


def _wrap(sampler: Table, key: str) -> str:
    code = sampler.whole(key, 10497, at_least=0)
    if code not in _WRAPS:
        sampler.refuse(key, f"one of {', '.join(f'{number} ({name})' for number, name in _WRAPS.items())}")
    return _WRAPS[code]


def _uv_matrix(transform: Table) -> FloatArray:
    """Return the (2, 3) matrix of KHR_texture_transform: translation times rotation times scale."""
    dx, dy = transform.numbers("offset", 2, COUNT) if transform.has("offset") else (0.0, 0.0)
    sx, sy = transform.numbers("scale", 2, COUNT) if transform.has("scale") else (1.0, 1.0)
    angle = transform.number("rotation", 0.0, at_least=-COUNT, at_most=COUNT)
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c * sx, s * sy, dx], [-s * sx, c * sy, dy]])


class TextureReader:
    """The textures that a file's primitives use, each image decoded once.

    Parameters
    ----------
    document : Document
    label : str
        What the names of the textures begin with.
    """

    __slots__ = ("_bytes", "_document", "_images", "_label", "_names", "_texels", "textures")

    def __init__(self, document: Document, label: str) -> None:
        self._document = document
        self._label = label
        self._images: dict[int, ImageTexture] = {}
        self._names: dict[tuple[object, ...], str] = {}
        self._texels = self._bytes = 0
        self.textures: dict[str, ImageTexture] = {}

    def use(self, look: Look, uv: FloatArray, place: str) -> tuple[str, FloatArray]:
        """Return the name of the texture of a look, and the coordinates (n, 2) in it, v up, of the file's uv."""
        if look.image is None:
            raise ValueError("a look without an image has no texture")
        image = self._image(look.image)
        moved = uv @ look.uv_matrix[:, :2].T + look.uv_matrix[:, 2]
        if not (np.abs(moved) <= COUNT).all():
            raise InputError(f"{place}: texture coordinates must be finite numbers up to {COUNT:g}")
        moved[:, 1] = 1.0 - moved[:, 1]
        spans = [_periods(moved[:, axis], wrap) for axis, wrap in enumerate(look.wraps)]
        cutoff = look.cutoff
        if cutoff is not None and float(image.texels[..., 3].min()) >= cutoff:
            cutoff = None  # nothing is cut out: every renderer can draw it
        key = (look.image, cutoff, *spans)
        if key not in self._names:
            name = f"{self._label}#{len(self._names)}"
            texels = image.texels
            for axis, (first, count, wrap) in enumerate(spans):
                texels = self._laid_out(texels, 1 - axis, first, count, wrap, place)
            self._names[key] = name
            self.textures[name] = ImageTexture(texels, cutoff, image.source)
        for axis, (first, count, _) in enumerate(spans):
            moved[:, axis] = (moved[:, axis] - first) / count
        return self._names[key], moved

    def _laid_out(
        self, texels: NDArray[np.float32], axis: int, first: int, count: int, wrap: str, place: str
    ) -> NDArray[np.float32]:
        """Return texels laid out along an axis over `count` periods from period `first` on."""
        if wrap == "repeat":
            return texels
        self._spend(texels.size // 4 * count, 0, f"{place}: its texture laid out over {count} periods")
        size = texels.shape[axis]
        k = np.arange(first * size, (first + count) * size)
        if wrap == "clamp":
            chosen = np.clip(k, 0, size - 1)
        else:
            chosen = np.minimum(k % (2 * size), 2 * size - 1 - k % (2 * size))
        return read_only(np.take(texels, chosen, axis=axis))

    def _image(self, index: int) -> ImageTexture:
        if index not in self._images:
            table = self._document.lists["images"][index]
            what = f"{table.file}: {table.path}"
            data, source = self._encoded(table, what)
            suffix = next((suffix for magic, suffix in _FORMATS if data.startswith(magic)), None)
            if suffix is None:
                raise InputError(f"{what}: is neither PNG nor JPEG; images of these two formats are read")
            self._bytes += len(data)
            with tempfile.TemporaryDirectory(prefix="aliasbench-") as folder:
                # The decoder reads files; through a file the bytes are decoded as the same image beside a model is.
                path = Path(folder) / f"image{suffix}"
                path.write_bytes(data)
                image = load_image(path, label=what, source=source, most_texels=max(0, self._left()))
            self._spend(image.texels.size // 4, 0, what)
            self._images[index] = image
        return self._images[index]

    def _encoded(self, table: Table, what: str) -> tuple[bytes, str]:
        name = f"{self._label}#image {table.path.removeprefix('images')[1:-1]}"
        if not table.has("uri"):
            return self._document.view(table).tobytes(), name
        uri = table.text("uri")
        if uri.startswith("data:"):
            return decode_data_uri(uri, what), name
        path = path_beside(self._document.folder, uri, what, escaped=True)
        return read_local(path, f"{what}: image {path.name!r}"), path.name

    def _left(self) -> int:
        return max(FREE_TEXELS, TEXELS_PER_BYTE * self._bytes) - self._texels

    def _spend(self, texels: int, encoded: int, what: str) -> None:
        self._bytes += encoded
        if texels > self._left():
            raise InputError(
                f"{what}: the textures come to {self._texels + texels} texels; at most {self._left() + self._texels} "
                f"are allowed ({FREE_TEXELS}, or {TEXELS_PER_BYTE} for each byte of its images)"
            )
        self._texels += texels


def _periods(values: FloatArray, wrap: str) -> tuple[int, int, str]:
    """Return the first period that coordinates lie in, how many there are, and how they must be laid out."""
    low, high = float(values.min(initial=0.0)), float(values.max(initial=0.0))
    # Rounding at the border is no wrapping: half a texel of the largest texture.
    if wrap == "repeat" or (low >= -1e-4 and high <= 1 + 1e-4):
        return 0, 1, "repeat"
    if wrap == "mirror":
        return 0, 2, "mirror"
    first = math.floor(low + 1e-4)
    return first, max(1, math.ceil(high - 1e-4) - first), "clamp"
