"""Pictures of the page: display encoding, error heat maps and their data URIs.

The page must open offline as one file, so every picture is embedded. Error maps are computed here from the float images
and not in the browser from 8-bit ones, where an error below 1/255 no longer exists. PNG is written by a few lines of
our own because OpenImageIO writes neither to memory nor palettes, and palettes make error maps five times smaller.
"""

import base64
import io
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.textures import linear_to_srgb

FloatImage = NDArray[np.floating]
Bytes = NDArray[np.uint8]

# Errors are shown on a logarithmic scale: jaggies of half the contrast and noise of a thousandth are both on the page.
HEAT_LOW, HEAT_HIGH = 1e-3, 1.0
HEAT_LEVELS = 96
# Ten stops of Inferno (S. van der Walt, N. Smith): its lightness rises evenly, and it survives colour blindness.
INFERNO = ["000004", "1b0c41", "4a0c6b", "781c6d", "a52c60", "cf4446", "ed6925", "fb9b06", "f7d13d", "fcffa4"]


@dataclass(frozen=True, slots=True)
class Picture:
    """One embedded picture: its data URI and its size in pixels."""

    uri: str
    width: int
    height: int


def crop_to(image: FloatImage, side: int) -> FloatImage:
    """Return the central window of at most `side` x `side` pixels; pixels are never resampled."""
    top, left = (max(0, (n - side) // 2) for n in image.shape[:2])
    return image[top : top + side, left : left + side]


def encode_picture(image: FloatImage, exposure: float = 1.0) -> Picture:
    """Return linear radiance times `exposure`, clipped to [0, 1], sRGB encoded (IEC 61966-2-1), as a picture.

    Parameters
    ----------
    image : (h, w, 3) float
        Linear radiance; what is not finite shows as black.
    exposure : float
        Factor before clipping.
    """
    levels = _display_levels(image, exposure)
    return _picture(png_bytes(levels), levels)


def _display_levels(image: FloatImage, exposure: float) -> Bytes:
    """Return (..., h, w, 3) radiance as sRGB bytes, of one channel where all are the same."""
    linear = np.clip(np.nan_to_num(image * exposure, posinf=1.0, neginf=0.0), 0.0, 1.0)
    levels: Bytes = np.rint(linear_to_srgb(np.asarray(linear, np.float64)) * 255.0).astype(np.uint8)
    return levels[..., 0] if np.all(levels == levels[..., :1]) else levels


def encode_film(images: FloatImage, frame_ms: int, exposure: float = 1.0) -> Picture:
    """Return (frames, h, w, 3) linear radiance as an animated PNG that loops, displayed as by `encode_picture`."""
    from PIL import Image

    first, *rest = (Image.fromarray(levels) for levels in _display_levels(images, exposure))
    out = io.BytesIO()
    first.save(out, "PNG", save_all=True, append_images=rest, duration=frame_ms, loop=0)
    return _picture(out.getvalue(), np.asarray(first))


def heat_levels(test: FloatImage, reference: FloatImage, contrast: float) -> Bytes:
    """Return |test - reference| / contrast, largest of the channels, as palette indices of the logarithmic scale.

    Index 0 is `HEAT_LOW` and below, the last one `HEAT_HIGH` and above (and what is not finite).
    """
    error = np.abs(np.asarray(test, np.float64) - reference).max(axis=2) / contrast
    error = np.nan_to_num(error, nan=HEAT_HIGH, posinf=HEAT_HIGH)
    place = np.log(np.maximum(error, HEAT_LOW) / HEAT_LOW) / np.log(HEAT_HIGH / HEAT_LOW)
    levels: Bytes = np.rint(np.clip(place, 0.0, 1.0) * (HEAT_LEVELS - 1)).astype(np.uint8)
    return levels


def encode_heat_map(test: FloatImage, reference: FloatImage, contrast: float) -> Picture:
    """Return the error map as a picture in the colours of `heat_palette`."""
    levels = heat_levels(test, reference, contrast)
    return _picture(png_bytes(levels, heat_palette()), levels)


def heat_palette() -> Bytes:
    """Return the (HEAT_LEVELS, 3) colours of the error scale, from no error to the full contrast."""
    stops = np.array([[int(c[i : i + 2], 16) for i in (0, 2, 4)] for c in INFERNO], float)
    at = np.linspace(0, len(stops) - 1, HEAT_LEVELS)
    channels = [np.interp(at, np.arange(len(stops)), stops[:, k]) for k in range(3)]
    palette: Bytes = np.rint(np.stack(channels, axis=1)).astype(np.uint8)
    return palette


def most_telling_region(errors: Sequence[FloatImage], width: int, height: int) -> tuple[int, int]:
    """Return (left, top) of the window in which the techniques' errors differ most from each other.

    That is where a close-up tells techniques apart: where all are equally right or wrong there is nothing to see.

    Parameters
    ----------
    errors : sequence of (h, w) float
        |test - reference| of every technique, all of one shape.
    width, height : int
        Of the window, in pixels.
    """
    if not errors:
        return 0, 0
    spread = np.nan_to_num(np.var(np.stack(errors), axis=0), posinf=0.0)
    rows, columns = spread.shape
    width, height = min(width, columns), min(height, rows)
    total = np.pad(spread.cumsum(0).cumsum(1), ((1, 0), (1, 0)))
    sums = total[height:, width:] - total[:-height, width:] - total[height:, :-width] + total[:-height, :-width]
    top, left = np.unravel_index(int(np.argmax(sums)), sums.shape)
    return int(left), int(top)


def png_bytes(pixels: Bytes, palette: Bytes | None = None) -> bytes:
    """Return a PNG file (RFC 2083) of (h, w) grey, (h, w) palette or (h, w, 3) RGB bytes.

    Rows are stored as they are or as differences from their left neighbours, whichever is smaller.
    """
    height, width = pixels.shape[:2]
    depth = 3 if pixels.ndim == 3 else 1
    kind = 3 if palette is not None else (2 if depth == 3 else 0)
    rows = np.ascontiguousarray(pixels).reshape(height, width * depth)
    differences = rows.copy()
    differences[:, depth:] -= rows[:, :-depth]
    packed = min((_deflate(f, r) for f, r in ((0, rows), (1, differences))), key=len)
    colours = b"" if palette is None else _chunk(b"PLTE", palette.tobytes())
    header = _chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, kind, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + colours + _chunk(b"IDAT", packed) + _chunk(b"IEND", b"")


def _deflate(filter_kind: int, rows: Bytes) -> bytes:
    column = np.full((len(rows), 1), filter_kind, np.uint8)
    return zlib.compress(np.hstack([column, rows]).tobytes(), 6)


def _chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def _picture(png: bytes, pixels: Bytes) -> Picture:
    uri = "data:image/png;base64," + base64.b64encode(png).decode("ascii")
    return Picture(uri, int(pixels.shape[1]), int(pixels.shape[0]))
