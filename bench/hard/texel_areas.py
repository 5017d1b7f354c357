"""Means of a textured quad over pixels, as areas that GEOS cuts out texel by texel: the truth for exact references.

Texels are projected into the picture, as a pixel is a mean over its square there, not over what it sees of the texture.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np

from aliasbench.bench.hard.case import REFERENCE, Verdict, with_keys
from aliasbench.bench.hard.ownership import pixel_points
from aliasbench.bench.hard.sight import texel_place_at, texel_value
from aliasbench.renderers.catalog import render
from aliasbench.scenes.model import FloatArray, ImageTexture, Scene

_SQUARE = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])


def texel_means(
    scene: Scene,
    size: tuple[int, int],
    *,
    rows: slice = slice(None),
    bilinear: bool = False,
    frame: int = 0,
    fraction: float = 0.0,
) -> tuple[FloatArray, float]:
    """Return (h, w, 3), the mean colours of rows of pixels that a scene's only object covers, and their own error.

    Each pixel may hold some hundred texels at most. `bilinear` is for images on quads that face the camera: the mean of
    the texture that is linear between its texels' centres.
    """
    import shapely

    texture = scene.textures[scene.objects[0].texture or ""]
    corners = pixel_points(size, 0.0, 0.0).reshape(size[1], size[0], 2)[rows]
    height, width = corners.shape[:2]
    out, misplaced = np.zeros((height * width, 3)), 0.0
    box = shapely.box(0.0, 0.0, 1.0, 1.0)
    for number, corner in enumerate(corners.reshape(-1, 2)):
        place = texel_place_at(scene, size, corner + _SQUARE, frame=frame, fraction=fraction) - 0.5 * bilinear
        # 16 roundings of a place shift a texel's border, of which a pixel has as many each way as texels, and one
        side = float(np.linalg.norm(np.diff(place, axis=0), axis=1).min())
        misplaced = max(misplaced, 2.0 * 16.0 * 2.0**-53 * float(np.abs(place).max()) * (1.0 + 1.0 / side))
        base = np.floor(place.min(axis=0))
        local = place - base
        to_pixel = _projective((local - local[0]) / side, _SQUARE)  # as well conditioned as the pixel is square
        columns, levels = (np.arange(int(np.ceil(top))) for top in local.max(axis=0))
        cells = np.stack(np.meshgrid(columns, levels), axis=-1).reshape(-1, 1, 2) + _SQUARE
        pieces = shapely.intersection(shapely.polygons(_apply(to_pixel, (cells - local[0]) / side)), box)
        areas = shapely.area(pieces)
        # all of it is covered, once: or texels were projected wrongly
        assert abs(float(areas.sum()) - 1.0) < 1e-9, "a pixel's texels do not make up the pixel"
        if bilinear:
            assert isinstance(texture, ImageTexture), "only images are bilinear"
            out[number] = _bilinear_integral(texture, base, [np.array(p.exterior.coords[:-1]) for p in pieces], local)
        else:
            out[number] = areas @ texel_value(texture, cells.mean(axis=1) + base)
    return out.reshape(height, width, 3), misplaced + 1e-11  # areas are differences of products


def _bilinear_integral(
    texture: ImageTexture, base: FloatArray, pieces: list[FloatArray], local: FloatArray
) -> FloatArray:
    """Return the integral over convex pieces of a pixel, in each of which the texture is bilinear in the pixel.

    The mean over a triangle of a polynomial of degree 2 is that of its sides' middles.
    """
    total = np.zeros(3)
    along = np.stack([local[1] - local[0], local[3] - local[0]])
    levels, columns = texture.texels.shape[:2]
    for piece in pieces:
        for k in range(1, len(piece) - 1):
            a, b, c = piece[0], piece[k], piece[k + 1]
            area = 0.5 * abs((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
            cell = np.floor(local[0] + (a + b + c) / 3.0 @ along)
            for middle in ((a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0):
                part = local[0] + middle @ along - cell
                for right in (0, 1):
                    for up in (0, 1):
                        column, row = (cell + base + (right, up)).astype(np.int64)
                        weight = abs(1 - right - part[0]) * abs(1 - up - part[1])
                        total += area / 3.0 * weight * texture.texels[row % levels, column % columns, :3]
    return total


def _projective(source: FloatArray, target: FloatArray) -> FloatArray:
    """Return the 3 x 3 matrix that takes four points (4, 2) to four others."""
    x, y = source.T
    u, v = target.T
    one, zero = np.ones(4), np.zeros(4)
    rows = np.concatenate(
        [
            np.stack([x, y, one, zero, zero, zero, -u * x, -u * y], axis=1),
            np.stack([zero, zero, zero, x, y, one, -v * x, -v * y], axis=1),
        ]
    )
    return np.append(np.linalg.solve(rows, np.concatenate([u, v])), 1.0).reshape(3, 3)


def _apply(matrix: FloatArray, points: FloatArray) -> FloatArray:
    homogeneous = points @ matrix[:, :2].T + matrix[:, 2]
    out: FloatArray = homogeneous[..., :2] / homogeneous[..., 2:]
    return out


def areas_verdict(scenes: Iterable[tuple[str, Scene]], size: tuple[int, int], **options: Any) -> Verdict:
    """Return the verdict on the reference's pictures beside texels' areas; `options` are `texel_means`'s."""
    worst, bound, note = 0.0, 0.0, ""
    key = "texture=linear" if options.get("bilinear") else ""
    for name, scene in scenes:
        frame = render(scene, with_keys(REFERENCE, key), size=size)
        truth, own = texel_means(scene, size, **options)
        found = float(np.abs(frame.pixels[options.get("rows", slice(None))] - truth).max())
        # a bound that is not small excuses nothing
        bound = max(bound, min((frame.uncertainty or 0.0) + own, 1e-5))
        worst, note = max((worst, note), (found, f"worst: {name}"))
    why = "the bound that the reference states, and how far areas by GEOS are known"
    return Verdict(worst, "contrast", bound, bound, why, note=note)
