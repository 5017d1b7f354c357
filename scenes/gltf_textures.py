"""The textures of a glTF file, each image decoded once, laid out as its samplers say.

Textures repeat in this project. Where a sampler says clamp or mirror the texture is laid out as the sampler says, over
as many periods as are used, with a border of a few texels around it, and the coordinates are scaled to it. Texels are
the same then, and so are linear filtering and the finer mip levels; on levels whose texels are wider than the border
(16 texels) a little of the opposite side still shows at an edge, as it would with a texture that repeats.
"""

import math
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.gltf_data_uris import decode_data_uri
from aliasbench.scenes.gltf_document import Document
from aliasbench.scenes.gltf_materials import Look
from aliasbench.scenes.limits import COUNT
from aliasbench.scenes.local_files import path_beside, read_local
from aliasbench.scenes.model import FloatArray, ImageTexture
from aliasbench.scenes.schema import Table
from aliasbench.scenes.textures import load_image

FREE_TEXELS = 2**25  # of all textures of a file, half a gigabyte of them
TEXELS_PER_BYTE = 16  # and as many more for each byte of its images: what photographs come to, and bombs do not
_BORDER = 16  # texels: mip levels 0 to 4; a whole period would weigh more than the picture in the coarsest levels
_FORMATS = ((b"\x89PNG\r\n\x1a\n", ".png"), (b"\xff\xd8\xff", ".jpg"))


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
