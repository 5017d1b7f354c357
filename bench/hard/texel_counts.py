"""Textures of one texel, odd sizes and the widest that devices take: which texel a sample shows."""

import numpy as np

from aliasbench.bench.hard.case import RASTERS, REFERENCE, TRACERS, HardCase, Verdict, with_keys
from aliasbench.bench.hard.triangles import ULP, Size
from aliasbench.renderers.catalog import render
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Camera, FloatArray, ImageTexture, Scene
from aliasbench.scenes.shapes import quad

SIZES: tuple[Size, ...] = ((1, 1), (1, 7), (7, 1), (2, 3), (5, 3), (13, 11), (16384, 1), (1, 16384), (16381, 2))
TOO_WIDE: Size = (70001, 1)
_FILTERED = ("texture=linear", "texture=mipmap", "texture=trilinear")


def texels_of(size: Size, seed: int = 3) -> ImageTexture:
    """Return random colours, opaque, (h, w, 4)."""
    texels = np.random.default_rng(seed).random((size[1], size[0], 4), dtype=np.float32)
    texels[..., 3] = 1.0
    return ImageTexture(texels)


def textured(size: Size, texture: ImageTexture) -> Scene:
    """Return a picture that the texture fills, a texel a pixel."""
    x, y = size[0] / 2, size[1] / 2
    picture = quad([(-x, -y, 0.0), (x, -y, 0.0), (x, y, 0.0), (-x, y, 0.0)], texture="t")
    return Scene("hard", Camera("orthographic", height=float(size[1])), (picture,), textures={"t": texture})


def as_picture(texture: ImageTexture) -> FloatArray:
    """Return what such a picture must be: the texels, top row first."""
    return texture.texels[::-1, :, :3].astype(np.float64)


def bilinear_means(texture: ImageTexture) -> FloatArray:
    """Return the means of a bilinear texture over its texels: 1/8, 3/4 and 1/8 of three in a row, each way."""
    out = as_picture(texture)
    for axis in (0, 1):
        out = 0.75 * out + 0.125 * (np.roll(out, 1, axis) + np.roll(out, -1, axis))
    return out


def _texel_a_pixel(subject: str) -> Verdict:
    worst, where = 0, ""
    for size in SIZES:
        texture = texels_of(size)
        truth = as_picture(texture)
        pixels = render(textured(size, texture), with_keys(subject, "texture=point"), size=size).pixels
        # a texel's own value, or a mean over its area that has it at all places, in float64
        wrong = int(np.sum(np.abs(pixels - truth).max(axis=-1) > (1e-9 if subject == REFERENCE else 0.0)))
        if wrong > worst:
            worst, where = wrong, f"{size[0]} x {size[1]}"
    why = (
        "centres of pixels are centres of texels, half a texel from all others: 16384 ulp of a coordinate with 24 bits"
    )
    return Verdict(float(worst), "pixels", 0.0, 0.0, why, note=f"worst at {where} texels" if where else "")


def _filtered_texels(subject: str) -> Verdict:
    """Filters at a texel's centre and at its own size: that texel; of one colour, that colour, EWA included."""
    worst, where, widest = 0.0, "", max(max(size) for size in SIZES)
    modes = ("texture=linear",) if subject == REFERENCE else _FILTERED
    more = () if subject == REFERENCE else ("texture=ewa",) if subject in TRACERS else ("texture=anisotropic",)
    for size in SIZES:
        texture = texels_of(size)
        flat = ImageTexture(np.broadcast_to(np.array([0.3, 0.1, 7.7, 1.0], np.float32), texture.texels.shape).copy())
        for key in (*modes, *more):
            for shown, scale in ((flat, 1.0 / 7.7), (texture, 1.0))[: 1 if key in more else 2]:
                pixels = render(textured(size, shown), with_keys(subject, key), size=size).pixels
                truth = bilinear_means(shown) if subject == REFERENCE else as_picture(shown)
                error = float(np.abs(pixels - truth).max()) * scale
                if not error <= worst:
                    worst, where = error, f"{key} of {size[0]} x {size[1]} texels"
    if subject not in RASTERS:
        # of a coordinate of up to `widest` texels float64 keeps 2^-53, and a filter's slope is 1 a texel
        allowed = 8.0 * widest * 2.0**-53 + (0.0 if subject == REFERENCE else 4.0 * ULP)
        why = f"float64 places: 8 roundings of {widest} texels" + ("" if subject == REFERENCE else "; float32 colours")
        return Verdict(worst, "contrast", allowed, allowed, why, note=f"worst: {where}" if where else "")
    return Verdict(
        worst,
        "contrast",
        64.0 * ULP,
        2.0**-9 + 4.0 * widest * ULP,
        f"places within a texel are what 24 bits leave of {widest} texels, and have 8 bits on graphics devices",
        note=f"worst: {where}" if where else "",
    )


def _too_wide(subject: str) -> Verdict:
    """A texture wider than devices take: shown right, or refused with the limit."""
    texture = texels_of(TOO_WIDE)
    size = (64, 1)
    # the last 64 texels: a picture that shows a corner of the quad
    x = TOO_WIDE[0]
    picture = quad([(32.0 - x, -0.5, 0.0), (32.0, -0.5, 0.0), (32.0, 0.5, 0.0), (32.0 - x, 0.5, 0.0)], texture="t")
    scene = Scene("hard", Camera("orthographic", height=1.0), (picture,), textures={"t": texture})
    why = "texels are half a texel from their neighbours; a device that takes no such texture is named with its limit"
    try:
        pixels = render(scene, with_keys(subject, "texture=point"), size=size).pixels
    except InputError as error:
        text = str(error)
        named = subject in RASTERS and f"{TOO_WIDE[0]}x1 texels" in text and "at most" in text
        return Verdict(0.0 if named else 64.0, "pixels", 0.0, 0.0, why, note=text)
    wrong = np.abs(pixels - as_picture(texture)[:, -64:]).max(axis=-1) > (1e-9 if subject == REFERENCE else 0.0)
    return Verdict(float(wrong.sum()), "pixels", 0.0, 0.0, why)


CASES = (
    HardCase(
        "texel-a-pixel",
        "sizes",
        "Textures of 1 x 1, 1 x 7, odd primes and up to 16384 texels, one texel a pixel.",
        "Every pixel has its own texel's value, to the last bit (references: 1e-9).",
        _texel_a_pixel,
    ),
    HardCase(
        "filtered-texels",
        "sizes",
        "The same textures filtered: bilinear, mipmapped, trilinear, anisotropic or EWA.",
        "At a texel's centre, a texel a pixel, filters of two texels show that texel, a reference its mean with its "
        "neighbours; all of them keep one colour.",
        _filtered_texels,
    ),
    HardCase(
        "texture-too-wide",
        "sizes",
        "A texture of 70001 texels in a row, wider than graphics devices take.",
        "Its last 64 texels are shown, or the device is named with the most it takes.",
        _too_wide,
    ),
)
