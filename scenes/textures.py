"""What a texture's value is, and the one mip chain that both renderers filter from.

Values and filtering are in linear light. An image is a grid of constant squares (point) or their bilinear blend; an
analytic texture is evaluated exactly under point and linear, and is an image otherwise, together with the affine map
from uv to that image's coordinates. Of checkers and gratings it is one period, so that repeats are exact; of a zone
plate, which has none, all that a scene's surfaces show (`scene_chain`). Its texels are means over their areas and not
samples, or the levels would be averages of aliases.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.errors import InputError, printable
from aliasbench.scenes.limits import RADIANCE
from aliasbench.scenes.model import (
    Checker,
    FloatArray,
    Grating,
    ImageTexture,
    Scene,
    Texture,
    Vec2,
    ZonePlate,
    read_only,
)
from aliasbench.scenes.plate_levels import plate_levels
from aliasbench.scenes.stderr import silenced_stderr

TexelArray = NDArray[np.float32]
# Texels across a baked period: a checker's squares end between texels at any even size, a square wave's bars at any
# multiple of four.
BAKED_SIZE = 64
MOST_TEXELS = 2**26  # 8192 x 8192, a gigabyte of them: a few kilobytes of a file can claim any number
_BAND = 2**16  # texels converted at a time


def srgb_to_linear(values: NDArray[np.floating]) -> FloatArray:
    """Return linear light of sRGB-encoded values in [0, 1] (IEC 61966-2-1)."""
    v = np.asarray(values, dtype=np.float64)
    out: FloatArray = np.where(v <= 0.04045, v / 12.92, ((np.maximum(v, 0.04045) + 0.055) / 1.055) ** 2.4)
    return out


def linear_to_srgb(values: NDArray[np.floating]) -> FloatArray:
    """Return sRGB-encoded values of linear light, both clamped to [0, 1]."""
    v = np.clip(np.asarray(values, dtype=np.float64), 0.0, 1.0)
    out: FloatArray = np.where(v <= 0.0031308, 12.92 * v, 1.055 * np.maximum(v, 0.0031308) ** (1 / 2.4) - 0.055)
    return out


def load_image(
    path: Path,
    *,
    alpha_cutoff: float | None = None,
    source: str | None = None,
    label: str | None = None,
    most_texels: int = MOST_TEXELS,
) -> ImageTexture:
    """Return an image file as linear RGBA texels, bottom row first. Integer images are sRGB, float ones linear.

    Parameters
    ----------
    path : Path
    alpha_cutoff, source : optional
        Of the texture; the path is the source where none is given.
    label : str, optional
        What messages call the image, where its path says nothing to people (an image inside a model file).
    most_texels : int
        How many texels it may have: looked at before any is decoded.

    Raises
    ------
    InputError
        If the file is missing or not a regular one, cannot be read, has no pixels or too many, or has a value that is
        not finite or over `limits.RADIANCE`.
    """
    import OpenImageIO as oiio

    what = label or f"image {str(path)!r}"
    try:
        if not path.is_file():
            raise InputError(f"{what}: {'not a regular file' if path.exists() else 'no such file'}")
    except OSError as error:
        raise InputError(f"{what}: cannot be read ({error.strerror})") from error
    if any("\udc80" <= c <= "\udcff" for c in str(path)):  # bytes of no encoding, which the library cannot open
        raise InputError(f"{what}: cannot be read (its path is not UTF-8)")
    with silenced_stderr():
        # A colour is a colour wherever it is drawn: the library would otherwise return it multiplied by its alpha.
        options = oiio.ImageSpec()
        options.attribute("oiio:UnassociatedAlpha", 1)
        image = oiio.ImageInput.open(str(path), options)
        if image is None:
            raise InputError(f"{what}: cannot be read ({_first_line(oiio.geterror)})")
        try:
            spec = image.spec()
            kind = spec.format.basetype
            if spec.width * spec.height > most_texels:
                raise InputError(f"{what}: has {spec.width} x {spec.height} texels; at most {most_texels} are allowed")
            wanted = kind if kind in (oiio.UINT8, oiio.UINT16) else oiio.FLOAT
            pixels = image.read_image(0, 0, 0, min(spec.nchannels, 4), wanted)
            if pixels is None or pixels.size == 0:
                raise InputError(f"{what}: cannot be read ({_first_line(image.geterror)})")
        finally:
            image.close()
    is_float = kind in (oiio.HALF, oiio.FLOAT, oiio.DOUBLE)
    texels = _linear_texels(np.asarray(pixels).reshape(spec.height, spec.width, -1), is_float)
    if is_float and not np.isfinite(texels).all():
        raise InputError(f"{what}: has values that are not finite")
    if is_float and (largest := float(np.abs(texels).max())) > RADIANCE:
        raise InputError(f"{what}: has a value of {largest:g}; at most {RADIANCE:g} is allowed")
    texels.flags.writeable = False
    return ImageTexture(texels, alpha_cutoff, source or str(path))


def _linear_texels(pixels: NDArray[np.generic], is_float: bool) -> TexelArray:
    """Return (h, w, 4) linear texels, bottom row first, of an image's (h, w, 1 to 4) values: 8 or 16 bits, or float32.

    Whole numbers are looked up, everything else is converted some rows at a time: a large texture costs its texels and
    little more.
    """
    height, width, channels = pixels.shape
    color = slice(0, 1 if channels < 3 else 3)
    out = np.ones((height, width, 4), np.float32)
    is_looked_up = pixels.dtype.kind == "u"
    most = 2 ** (8 * pixels.dtype.itemsize) - 1 if is_looked_up else 1
    steps = np.arange(most + 1) / most
    light, share = srgb_to_linear(steps).astype(np.float32), steps.astype(np.float32)
    band = max(1, _BAND // width)
    for top in range(0, height, band):
        rows = pixels[::-1][top : top + band]
        part = out[top : top + band]
        if is_looked_up:
            part[..., :3] = light[rows[..., color]]
        else:
            part[..., :3] = rows[..., color] if is_float else srgb_to_linear(rows[..., color].astype(np.float64))
        if channels in (2, 4):
            part[..., 3] = share[rows[..., -1]] if is_looked_up else rows[..., -1]
    return out


def _first_line(errors: Callable[[], str]) -> str:
    """Return the first of an image library's errors: what follows says the same less plainly."""
    try:
        lines = [line.strip() for line in errors().splitlines() if line.strip()]
    except UnicodeDecodeError:
        # It quotes the file's own bytes.
        return "damaged, or no image of a known format"
    return printable(lines[0]) if lines else "no image of a known format"


def evaluate_point(texture: Texture, uv: FloatArray) -> FloatArray:
    """Return the point-sampled RGBA value (..., 4), float64, at texture coordinates (..., 2)."""
    u, v = np.asarray(uv, dtype=np.float64)[..., 0], np.asarray(uv, dtype=np.float64)[..., 1]
    if isinstance(texture, ImageTexture):
        h, w = texture.texels.shape[:2]
        column = np.mod(np.floor(u * w), w).astype(np.int64)
        row = np.mod(np.floor(v * h), h).astype(np.int64)
        texels: FloatArray = texture.texels[row, column].astype(np.float64)
        return texels
    if isinstance(texture, Checker):
        odd = np.mod(np.floor(u * texture.squares[0]) + np.floor(v * texture.squares[1]), 2.0)
        share, low, high = odd, texture.black, texture.white
    elif isinstance(texture, Grating):
        angle = np.radians(texture.angle_deg)
        wave = np.cos(2 * np.pi * (texture.cycles * (u * np.cos(angle) + v * np.sin(angle)) + texture.phase))
        share, low, high = (1 + (np.sign(wave) if texture.profile == "square" else wave)) / 2, texture.low, texture.high
    else:
        r2 = (u - texture.center[0]) ** 2 + (v - texture.center[1]) ** 2
        share, low, high = (1 + np.cos(texture.k * r2 + texture.phase)) / 2, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    rgb = np.asarray(low) + share[..., None] * (np.asarray(high) - np.asarray(low))
    return np.concatenate([rgb, np.ones_like(rgb[..., :1])], axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class MipChain:
    """Levels of a texture in linear light, each half the size (rounded down, at least 1) of the one before.

    Attributes
    ----------
    levels : tuple of (h, w, 4) float32
        Row 0 at the least v; level 0 is the image itself.
    uv_matrix : (2, 3) float64
        Takes (u, v, 1) to the coordinates in which the chain repeats with period 1.
    """

    levels: tuple[TexelArray, ...]
    uv_matrix: FloatArray


def scene_chain(scene: Scene, name: str) -> MipChain:
    """Return the mip chain of a scene's texture, of a zone plate as far as the scene's surfaces show it."""
    shown = [surface.uv for surface in scene.objects if surface.texture == name and surface.uv is not None]
    uv = np.concatenate([np.zeros((0, 2)), *shown])
    if not len(uv):
        return mip_chain(scene.textures[name])
    (left, bottom), (right, top) = uv.min(axis=0).tolist(), uv.max(axis=0).tolist()
    plates = sum(isinstance(texture, ZonePlate) for texture in scene.textures.values())
    return mip_chain(scene.textures[name], (left, bottom), (right, top), max(plates, 1))


def mip_chain(texture: Texture, low: Vec2 = (0.0, 0.0), high: Vec2 = (1.0, 1.0), plates: int = 1) -> MipChain:
    """Return the mip chain of a texture: every texel is the texture's mean over the texel's area.

    Parameters
    ----------
    texture : Texture
    low, high : Vec2
        Range of uv that is looked at, for zone plates: beyond it they are wrong. The others repeat.
    plates : int
        How many zone plates share what memory they may take.
    """
    matrix = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    if isinstance(texture, ImageTexture):
        base = texture.texels.astype(np.float64)
    elif isinstance(texture, Checker):
        sx, sy = texture.squares
        matrix = np.array([[sx / 2, 0.0, 0.0], [0.0, sy / 2, 0.0]])
        base = _bake(Checker((2.0, 2.0), texture.black, texture.white), BAKED_SIZE, BAKED_SIZE)
    elif isinstance(texture, Grating):
        angle = np.radians(texture.angle_deg)
        row = np.array([np.cos(angle), np.sin(angle), 0.0]) * texture.cycles
        matrix = np.array([[row[0], row[1], texture.phase], [0.0, 0.0, 0.5]])
        base = _bake(Grating(1.0, 0.0, 0.0, texture.profile, texture.low, texture.high), 4 * BAKED_SIZE, 1)
        if texture.profile == "sine":
            mean = base.mean(axis=1, keepdims=True)
            base = mean + (base - mean) * np.sinc(1 / (4 * BAKED_SIZE))
    else:
        return MipChain(*plate_levels(texture, low, high, plates))
    levels = [read_only(base.astype(np.float32))]
    while levels[-1].shape[0] > 1 or levels[-1].shape[1] > 1:
        levels.append(read_only(_halve(levels[-1]).astype(np.float32)))
    return MipChain(tuple(levels), matrix)


def _bake(texture: Texture, width: int, height: int) -> FloatArray:
    """Return a texture's values at the centres of the texels of uv 0..1, (height, width, 4)."""
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    return evaluate_point(texture, np.stack([u, v], axis=-1))


def _halve(level: TexelArray) -> FloatArray:
    """Return the next level: every new texel is the exact area average of the old ones it covers."""
    out = level.astype(np.float64)
    for axis in (0, 1):
        n = out.shape[axis]
        if n == 1:
            continue
        m = n // 2
        moved = np.moveaxis(out, axis, 0)
        if n == 2 * m:
            new = (moved[0::2] + moved[1::2]) / 2
        else:
            # n = 2 m + 1 texels into m: new texel k covers [k n/m, (k + 1) n/m), three old ones in part
            k = np.arange(m).reshape((m,) + (1,) * (moved.ndim - 1))
            new = ((m - k) * moved[0:-1:2] + m * moved[1::2] + (k + 1) * moved[2::2]) / n
        out = np.moveaxis(new, 0, axis)
    return out
