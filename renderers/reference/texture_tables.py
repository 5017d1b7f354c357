"""Textures as the references' kernels want them: a kind, a map from uv to the texture's own coordinates, and texels."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.reference.runs import BILINEAR, GRID, SINE, ZONE
from aliasbench.scenes.errors import NotAvailableError
from aliasbench.scenes.model import Checker, FloatArray, Grating, ImageTexture, Scene, Texture


@dataclass(frozen=True, slots=True, eq=False)
class TextureTable:
    """The textures of all objects as the kernels want them; see `scanlines.scan_rows`.

    Attributes
    ----------
    blocks : (objects, 2, 3) int64
        Height, width and first row in `row_texels` of an object's texels as they are, and with u and v exchanged.
    row_texels, row_sums : (k, 3) float64
        Rows of width + 1: texels with the first repeated, and their running sums (of neighbours' means, for blends).
    """

    kinds: NDArray[np.int64]
    maps: FloatArray
    params: FloatArray
    sizes: NDArray[np.int64]
    offsets: NDArray[np.int64]
    texels: FloatArray
    blocks: NDArray[np.int64]
    row_texels: FloatArray
    row_sums: FloatArray


def texture_table(scene: Scene, *, linear: bool) -> TextureTable:
    """Return the textures of a scene's objects; `linear` images are blended, analytic textures always exact.

    Raises
    ------
    NotAvailableError
        For an image whose alpha cuts out parts.
    """
    n = len(scene.objects)
    kinds, maps, params = np.full(n, -1, np.int64), np.zeros((n, 2, 3)), np.zeros((n, 8))
    sizes, offsets = np.ones((n, 2), np.int64), np.zeros(n, np.int64)
    blocks: list[FloatArray] = []
    placed: dict[str, int] = {}
    end = 0
    for index, surface in enumerate(scene.objects):
        if surface.texture is None:
            continue
        texture = scene.textures[surface.texture]
        kinds[index], maps[index], params[index], block = _own_form(surface.texture, texture, linear)
        sizes[index] = block.shape[:2]
        if surface.texture not in placed:
            placed[surface.texture] = end
            blocks.append(np.asarray(block, dtype=np.float64).reshape(-1, 3))
            end += block.shape[0] * block.shape[1]
        offsets[index] = placed[surface.texture]
    texels = np.concatenate([*blocks, np.zeros((1, 3))])
    return TextureTable(kinds, maps, params, sizes, offsets, texels, *_in_rows(kinds, sizes, offsets, texels))


def _in_rows(
    kinds: NDArray[np.int64], sizes: NDArray[np.int64], offsets: NDArray[np.int64], texels: FloatArray
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Return blocks, row_texels and row_sums of a table."""
    blocks = np.ones((len(kinds), 2, 3), np.int64)
    rows, sums = [np.zeros((2, 3))], [np.zeros((2, 3))]
    known: dict[int, NDArray[np.int64]] = {}
    end = 2
    for index in np.flatnonzero((kinds == GRID) | (kinds == BILINEAR)):
        start = int(offsets[index])
        if start not in known:
            h, w = (int(n) for n in sizes[index])
            image = texels[start : start + h * w].reshape(h, w, 3)
            for swapped, block in enumerate((image, image.transpose(1, 0, 2))):
                padded = np.concatenate([block, block[:, :1]], axis=1)
                steps = (padded[:, 1:] + padded[:, :-1]) / 2 if kinds[index] == BILINEAR else block
                rows.append(padded.reshape(-1, 3))
                sums.append(
                    np.concatenate([np.zeros_like(block[:, :1]), np.cumsum(steps, axis=1)], axis=1).reshape(-1, 3)
                )
                blocks[index, swapped] = block.shape[0], block.shape[1], end
                end += len(rows[-1])
            known[start] = blocks[index]
        blocks[index] = known[start]
    return blocks, np.concatenate(rows), np.concatenate(sums)


def _own_form(name: str, texture: Texture, linear: bool) -> tuple[int, FloatArray, FloatArray, NDArray[np.floating]]:
    """Return kind, map, params and texels of one texture."""
    params = np.zeros(8)
    if isinstance(texture, ImageTexture):
        if texture.alpha_cutoff is not None and float(texture.texels[..., 3].min()) < texture.alpha_cutoff:
            raise NotAvailableError(
                f"reference: texture {name!r} cuts out parts by alpha_cutoff, which is not available yet; "
                "available: images without holes"
            )
        h, w = texture.texels.shape[:2]
        matrix = np.array([[w, 0.0, 0.0], [0.0, h, 0.0]])
        return (BILINEAR if linear else GRID), matrix, params, np.ascontiguousarray(texture.texels[..., :3])
    if isinstance(texture, Checker):
        matrix = np.array([[texture.squares[0], 0.0, 0.0], [0.0, texture.squares[1], 0.0]])
        black, white = texture.black, texture.white
        return GRID, matrix, params, np.array([[black, white], [white, black]])
    if isinstance(texture, Grating):
        angle = np.radians(texture.angle_deg)
        row = np.array([np.cos(angle), np.sin(angle), 0.0]) * texture.cycles
        row[2] = texture.phase
        if texture.profile == "square":
            # half a cycle to a texel, the first of them centred on phase 0
            row = 2 * row + np.array([0.0, 0.0, 0.5])
            return GRID, np.stack([row, np.zeros(3)]), params, np.array([[texture.high, texture.low]])
        params[:3], params[3:6] = texture.low, texture.high
        return SINE, np.stack([row, np.zeros(3)]), params, np.zeros((1, 1, 3))
    params[3:] = 1.0, 1.0, 1.0, texture.k, texture.phase
    matrix = np.array([[1.0, 0.0, -texture.center[0]], [0.0, 1.0, -texture.center[1]]])
    return ZONE, matrix, params, np.zeros((1, 1, 3))
