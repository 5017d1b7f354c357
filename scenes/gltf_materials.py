"""What a glTF material comes to without light: a colour, a texture, and what is cut out.

All surfaces are drawn unlit in their base colour, factor times texture (a file may say KHR_materials_unlit, or not);
of KHR_materials_pbrSpecularGlossiness it is the diffuse colour. What shines by itself is seen without light, too: the
emissive factor (times KHR_materials_emissive_strength) is added to the base colour where no texture is in either, and
where the base factor is black and cuts nothing out the emissive texture is drawn. Two textures are not added: beside a
base texture, and of a base that is not black, the emissive one is left out.

Alpha cuts out, it does not blend: MASK below its cutoff, BLEND below one half (of two half-transparent layers one is
drawn, as a screen door would), OPAQUE not at all.
Alpha at vertices cuts out whole triangles (`gltf`).

Textures repeat in this project. Where a sampler says clamp or mirror the texture is laid out as the sampler says, over
as many periods as are used, with a border of a few texels around it, and the coordinates are scaled to it. Texels are
the same then, and so are linear filtering and the finer mip levels; on levels whose texels are wider than the border
(16 texels) a little of the opposite side still shows at an edge, as it would with a texture that repeats.
"""

import math
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.gltf_data_uris import decode_data_uri
from aliasbench.scenes.gltf_document import Document
from aliasbench.scenes.limits import COUNT, RADIANCE
from aliasbench.scenes.local_files import path_beside, read_local
from aliasbench.scenes.model import FloatArray, ImageTexture, Vec3
from aliasbench.scenes.schema import Table
from aliasbench.scenes.textures import load_image

FREE_TEXELS = 2**25  # of all textures of a file, half a gigabyte of them
TEXELS_PER_BYTE = 16  # and as many more for each byte of its images: what photographs come to, and bombs do not
_BLEND_CUTOFF = 0.5
_BORDER = 16  # texels: mip levels 0 to 4; a whole period would weigh more than the picture in the coarsest levels
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
        Of the alpha of the image times that of vertices.
    uv_set : int
        Which TEXCOORD it uses.
    uv_matrix : (2, 3) float64
        From (u, v, 1) of the file to the image's, v down.
    wraps : pair of str
        Along u and v: ``repeat``, ``mirror`` or ``clamp``.
    absent : str
        Why nothing of it is left by its alpha, empty where something is.
    emissive : Vec3
        Linear RGB, added to the colour times that of vertices.
    is_emitted : bool
        The image is the emissive one: neither its alpha nor the colours of vertices count.
    """

    color: Vec3 = (1.0, 1.0, 1.0)
    image: int | None = None
    cutoff: float | None = None
    uv_set: int = 0
    uv_matrix: FloatArray = field(default_factory=lambda: np.eye(3)[:2])
    wraps: tuple[str, str] = ("repeat", "repeat")
    absent: str = ""
    emissive: Vec3 = (0.0, 0.0, 0.0)
    is_emitted: bool = False


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
            rule = "alphaCutoff" if mode == "MASK" else "where BLEND, drawn as a cut-out, is cut"
            return Look(
                absent=f"{material.path} has alphaMode {mode}, and its alpha {alpha:g} is below {least:g}, {rule}"
            )
        cutoff = least / alpha if alpha > 0.0 else None
    color = (red, green, blue)
    emissive = _emissive(material)
    if any(emissive) and material.has("emissiveTexture"):
        if not any(color) and (cutoff is None or not base.has(texture_key)):
            look = _with_texture(document, material.table("emissiveTexture"), emissive, None)
            return replace(look, is_emitted=True)
        emissive = (0.0, 0.0, 0.0)
    if not base.has(texture_key):
        return Look(color, cutoff=cutoff, emissive=emissive)
    if any(emissive) and not any(color) and cutoff is None:
        # Black times any texture is black.
        return Look(color, emissive=emissive)
    return _with_texture(document, base.table(texture_key), color, cutoff)


def _emissive(material: Table) -> Vec3:
    """Return what a material shines by itself, linear RGB before its texture."""
    extensions = material.table("extensions")
    if not material.has("emissiveFactor") or extensions.has("KHR_materials_unlit"):
        return (0.0, 0.0, 0.0)
    strength = extensions.table("KHR_materials_emissive_strength").number(
        "emissiveStrength", 1.0, at_least=0.0, at_most=RADIANCE
    )
    red, green, blue = (strength * factor for factor in material.numbers("emissiveFactor", 3, RADIANCE))
    if not 0.0 <= min(red, green, blue) <= max(red, green, blue) <= RADIANCE:
        material.refuse("emissiveFactor", f"three numbers of at least 0, with their strength at most {RADIANCE:g}")
    return (red, green, blue)


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
    """Return the (2, 3) matrix of KHR_texture_transform: translation times rotation times scale.

    The extension's README writes a GLSL constructor, which takes columns: its rows are this matrix' columns.
    """
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
    retextured : bool
        Read no image: only coordinates are needed.
    """

    __slots__ = ("_bytes", "_document", "_images", "_label", "_layouts", "_names", "_retextured", "_texels", "textures")

    def __init__(self, document: Document, label: str, *, retextured: bool = False) -> None:
        self._document = document
        self._label = label
        self._retextured = retextured
        self._layouts: dict[int, dict[tuple[_Span, _Span], NDArray[np.float32]]] = {}
        self._images: dict[int, ImageTexture] = {}
        self._names: dict[tuple[object, ...], str] = {}
        self._texels = self._bytes = 0
        self.textures: dict[str, ImageTexture] = {}

    def use(self, look: Look, uv: FloatArray, place: str) -> tuple[str | None, FloatArray]:
        """Return the name of the texture of a look, and the coordinates (n, 2) in it, v up, of the file's uv."""
        if look.image is None:
            raise ValueError("a look without an image has no texture")
        moved = uv @ look.uv_matrix[:, :2].T + look.uv_matrix[:, 2]
        if not (np.abs(moved) <= COUNT).all():
            raise InputError(f"{place}: texture coordinates must be finite numbers up to {COUNT:g}")
        moved[:, 1] = 1.0 - moved[:, 1]
        if self._retextured:
            return None, moved
        image = self._image(look.image)
        height, width = image.texels.shape[:2]
        along_u, along_v = (_span(moved[:, axis], look.wraps[axis], size) for axis, size in enumerate((width, height)))
        cutoff = look.cutoff
        if cutoff is not None and float(image.texels[..., 3].min()) >= cutoff:
            cutoff = None  # nothing is cut out: every renderer can draw it
        key = (look.image, cutoff, along_u, along_v)
        if key not in self._names:
            name = f"{self._label}#{len(self._names)}"
            texels = self._laid_out(look.image, image.texels, along_u, along_v, place)
            self._names[key] = name
            self.textures[name] = ImageTexture(texels, cutoff, image.source)
        for axis, span, size in ((0, along_u, width), (1, along_v, height)):
            if span.wrap != "repeat":
                moved[:, axis] = (moved[:, axis] * size - span.start) / span.length
        return self._names[key], moved

    def _laid_out(
        self, index: int, texels: NDArray[np.float32], along_u: "_Span", along_v: "_Span", place: str
    ) -> NDArray[np.float32]:
        """Return an image's texels laid out along both axes, once for all materials."""
        layouts = self._layouts.setdefault(index, {})
        if (along_u, along_v) not in layouts:
            # The first takes the image's own place; borders are not charged.
            texels_of = texels.size // 4
            count = along_u.periods * along_v.periods
            more = texels_of * (count if layouts else count - 1)
            self._spend(more, 0, f"{place}: its texture laid out over {along_u.periods} x {along_v.periods} periods")
            if (along_u.wrap, along_v.wrap) != ("repeat", "repeat"):
                # Both axes at once: a large picture is not there a third time.
                texels = texels[np.ix_(along_v.chosen(texels.shape[0]), along_u.chosen(texels.shape[1]))]
                texels.flags.writeable = False
            layouts[along_u, along_v] = texels
        return layouts[along_u, along_v]

    def _image(self, index: int) -> ImageTexture:
        if index not in self._images:
            table = self._document.lists["images"][index]
            what = f"{table.file}: {table.path}"
            data, source = self._encoded(table, what)
            suffix = next((suffix for magic, suffix in _FORMATS if data.startswith(magic)), None)
            if suffix is None:
                raise InputError(f"{what}: is neither PNG nor JPEG; images of these two formats are read")
            self._bytes += len(data)
            try:
                with tempfile.TemporaryDirectory(prefix="aliasbench-") as folder:
                    # The decoder reads files; through a file the bytes are decoded as an image beside a model is.
                    path = Path(folder) / f"image{suffix}"
                    path.write_bytes(data)
                    image = load_image(path, label=what, source=source, most_texels=max(0, self._left()))
            except OSError as error:
                raise InputError(
                    f"{what}: cannot be decoded: a folder for temporary files with room for it is needed "
                    f"({error.strerror or error})"
                ) from error
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


@dataclass(frozen=True, slots=True)
class _Span:
    """The texels of one axis that are used, counted from the image's first, and how they follow from the image's."""

    wrap: str
    start: int
    length: int
    periods: int

    def chosen(self, size: int) -> NDArray[np.int64]:
        """Return which of the image's texels, `size` in all, each is."""
        k = np.arange(self.start, self.start + self.length)
        if self.wrap == "repeat":
            return k % size
        if self.wrap == "clamp":
            return np.clip(k, 0, size - 1)
        return np.minimum(k % (2 * size), 2 * size - 1 - k % (2 * size))


def _span(values: FloatArray, wrap: str, size: int) -> _Span:
    """Return what of an axis of `size` texels coordinates use."""
    if wrap == "repeat" or size == 1:
        return _Span("repeat", 0, size, 1)
    low, high = float(values.min(initial=0.0)), float(values.max(initial=0.0))
    # Rounding at the border is no wrapping: half a texel of the largest texture.
    first = math.floor(low + 1e-4)
    periods = max(1, math.ceil(high - 1e-4) - first)
    if wrap == "mirror" and (first, periods) != (0, 1):
        return _Span("mirror", 0, 2 * size, 2)
    border = min(_BORDER, size)
    return _Span(wrap, first * size - border, periods * size + 2 * border, periods)
