"""Triangles whose corners share one place of their texture, painted in the colour there.

Palettes - one texel to a triangle - are the usual way to colour simple models. Such a triangle has no texture map whose
texels could be followed across the picture, and needs none: it is a flat-coloured one, and is made one here, in its
place in the order. What is left of a surface keeps its texture.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.model import FloatArray, ImageTexture, Scene, Surface, Texture, Vec3, as_vec3, read_only
from aliasbench.scenes.textures import evaluate_point

# Texture coordinates that differ by less, relative to the largest, do by rounding only, and a map between them would be
# made of rounding errors.
_ONE_PLACE = 1e-12


def paint_constant(scene: Scene, *, linear: bool) -> Scene:
    """Return the scene with its triangles of one texture coordinate in the colour there; the scene itself without any.

    Parameters
    ----------
    scene : Scene
    linear : bool
        Whether images are blends of their texels instead of squares.
    """
    objects: list[Surface] = []
    for surface in scene.objects:
        constant = _constant_triangles(surface)
        if surface.texture is None or surface.uv is None or not constant.any():
            objects.append(surface)
            continue
        if not constant.all():
            objects.append(_part(surface, ~constant, surface.color, textured=True))
        texture = scene.textures[surface.texture]
        uv = surface.uv[surface.triangles[constant]]
        rgba = _values(texture, uv[:, 0] + (uv - uv[:, :1]).mean(axis=1), linear)  # to the bit where all are equal
        there = _is_there(texture, rgba)
        seen = np.flatnonzero(constant)[there]
        colors, which = np.unique(rgba[there, :3], axis=0, return_inverse=True)
        order = np.argsort(which.ravel(), kind="stable")
        ends = np.cumsum(np.bincount(which.ravel(), minlength=len(colors)))
        for color, chosen in zip(colors, np.split(seen[order], ends[:-1]), strict=True):
            mask = np.zeros(len(surface.triangles), np.bool_)
            mask[chosen] = True
            painted = as_vec3(color * np.asarray(surface.color))
            objects.append(_part(surface, mask, painted, textured=False))
    if len(objects) == len(scene.objects) and all(a is b for a, b in zip(objects, scene.objects, strict=True)):
        return scene
    return replace(scene, objects=tuple(objects))


def _constant_triangles(surface: Surface) -> NDArray[np.bool_]:
    if surface.texture is None or surface.uv is None:
        return np.zeros(len(surface.triangles), np.bool_)
    uv = surface.uv[surface.triangles]
    size = np.maximum(1.0, np.abs(uv).max(axis=(1, 2), initial=0.0))
    spread: FloatArray = np.ptp(uv, axis=1).max(axis=1, initial=0.0)
    return np.asarray(spread <= _ONE_PLACE * size)


def _part(surface: Surface, mask: NDArray[np.bool_], color: Vec3, *, textured: bool) -> Surface:
    """Return some triangles of a surface, with its texture or without; all of a polygon's are still the polygon."""
    if not textured:
        surface = replace(surface, texture=None, uv=None, color=color)
    if mask.all():
        return surface
    used, corners = np.unique(surface.triangles[mask], return_inverse=True)
    return replace(
        surface,
        vertices=read_only(surface.vertices[used]),
        triangles=read_only(corners.reshape(-1, 3).astype(np.int32)),
        uv=None if surface.uv is None else read_only(surface.uv[used]),
        is_polygon=False,
    )


def _values(texture: Texture, uv: FloatArray, linear: bool) -> FloatArray:
    """Return RGBA (n, 4) at texture coordinates (n, 2)."""
    if not linear or not isinstance(texture, ImageTexture):
        return evaluate_point(texture, uv)
    h, w = texture.texels.shape[:2]
    x, y = uv[:, 0] * w - 0.5, uv[:, 1] * h - 0.5
    column, row = np.floor(x), np.floor(y)
    a, b = (x - column)[:, None], (y - row)[:, None]
    left, low = np.mod(column, w).astype(np.int64), np.mod(row, h).astype(np.int64)
    right, high = (left + 1) % w, (low + 1) % h
    below = texture.texels[low, left] * (1 - a) + texture.texels[low, right] * a
    above = texture.texels[high, left] * (1 - a) + texture.texels[high, right] * a
    blend: FloatArray = below * (1 - b) + above * b
    return blend


def _is_there(texture: Texture, rgba: FloatArray) -> NDArray[np.bool_]:
    """Return where nothing is cut out, compared in single precision as alpha is stored and drawn."""
    if not isinstance(texture, ImageTexture) or texture.alpha_cutoff is None:
        return np.ones(len(rgba), np.bool_)
    return np.asarray(rgba[:, 3].astype(np.float32) >= np.float32(texture.alpha_cutoff))
