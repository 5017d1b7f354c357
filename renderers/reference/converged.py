"""References of textured scenes: the mean of independent replicates, and a bound of 99 % confidence for all pixels.

Each of the S replicates is an unbiased picture from stratified lines; the bound of a value is Student's t times its
standard error. "All pixels at once" is taken literally: the quantile is Bonferroni's for every channel of every pixel,
1 - 0.01 / (2 m). Pooling variances over pixels would be smaller and wrong, pixels differ by orders of magnitude.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from aliasbench.renderers.reference.cache import Stored
from aliasbench.renderers.reference.faces import Faces
from aliasbench.renderers.reference.flat import over_bands, palette, scene_extent
from aliasbench.renderers.reference.paths import Paths
from aliasbench.renderers.reference.pieces import join_pieces, pieces_at
from aliasbench.renderers.reference.runs import BILINEAR, GRID, SINE, ZONE
from aliasbench.renderers.reference.scanlines import scan_rows
from aliasbench.renderers.sampling.hashing import combine, unit
from aliasbench.scenes.errors import NotAvailableError
from aliasbench.scenes.model import Checker, FloatArray, Grating, ImageTexture, Scene, Texture
from aliasbench.scenes.projection import view_at

REPLICATES = 16
_LINES = 64  # of a row in a replicate, at 256 x 256; the work is the same at other sizes
_TIMES = 32
_CONFIDENCE = 0.99


@dataclass(frozen=True, slots=True, eq=False)
class TextureTable:
    """The textures of all objects as the kernels want them; see `scanlines.scan_rows`."""

    kinds: NDArray[np.int64]
    maps: FloatArray
    params: FloatArray
    sizes: NDArray[np.int64]
    offsets: NDArray[np.int64]
    texels: FloatArray


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
    return TextureTable(kinds, maps, params, sizes, offsets, np.concatenate([*blocks, np.zeros((1, 3))]))


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


def converge(
    scene: Scene, faces: Faces, paths: Paths, size: tuple[int, int], frame: int, *, linear: bool, spread: bool
) -> Stored:
    """Return the reference of a textured scene with its 99 % bound.

    Parameters
    ----------
    linear : bool
        Whether images are blends of their texels instead of squares.
    spread : bool
        Whether to average over the open shutter, else at its middle.
    """
    table = texture_table(scene, linear=linear)
    times = _TIMES if spread else 1
    # an analytic texture has few squares or none: a line is cheap
    dear = any(isinstance(t, ImageTexture) for t in scene.textures.values())
    lines = int(np.clip(_LINES * (1 if dear else 4) * 65536 / (size[0] * size[1]), 8, 512))
    mean, spread_sum = np.zeros((size[1], size[0], 3)), np.zeros((size[1], size[0], 3))
    for replicate in range(REPLICATES):
        picture = _replicate(scene, faces, paths, size, frame, table, times, max(1, lines // times), replicate)
        change = picture - mean
        mean += change / (replicate + 1)
        spread_sum += change * (picture - mean)
    error = np.sqrt(spread_sum / (REPLICATES - 1) / REPLICATES)
    quantile = -float(stdtrit(REPLICATES - 1, (1 - _CONFIDENCE) / (2 * mean.size)))
    rows = lines // times * times if times > 1 else lines
    return Stored(mean, quantile * float(error.max()) + 1e-9, REPLICATES * rows * size[0] * size[1])


def _replicate(
    scene: Scene, faces: Faces, paths: Paths, size: tuple[int, int], frame: int, table: TextureTable,
    times: int, lines: int, replicate: int,
) -> FloatArray:  # fmt: skip
    """Return one unbiased picture; its times are stratified over the shutter, one in each stratum."""
    shutter = scene.animation.shutter
    key = combine(combine(0x7E57, replicate), frame)
    fractions = [shutter * (k + unit(key, k)) / times for k in range(times)] if times > 1 else [shutter / 2]
    views = [view_at(scene.camera, scene.animation, frame, f, size) for f in fractions]
    pieces = join_pieces([pieces_at(faces, paths, v, frame, f) for v, f in zip(views, fractions, strict=True)])
    colors, extent = palette(scene), scene_extent(scene)
    out = np.zeros((size[1], size[0], 3))

    def draw(rows: NDArray[np.int64]) -> None:
        scan_rows(
            pieces.points, pieces.starts, pieces.planes, pieces.owners, pieces.instants, colors,
            table.kinds, table.maps, table.params, table.sizes, table.offsets, table.texels,
            views[0].perspective, extent, lines, replicate, frame, rows, out,
        )  # fmt: skip

    over_bands(draw, size[1])
    return out
