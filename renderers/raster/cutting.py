"""Triangles in clip space cut in float64: along a side of a frustum, and into shells of depth.

Neighbours get the very same points, so that what shares an edge still does.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.model import FloatArray

# How many times its least depth a triangle's greatest may be where layers matter: depths are rounded by a few times
# 2^-24 of the greatest, and layers are 2^-18 of the least apart. Beyond so many shells the rest is one.
DEEP, _SHELLS = 8.0, 12

BoolArray = NDArray[np.bool_]


def cut_shells(
    corners: FloatArray, owners: NDArray[np.int32], perspective: bool
) -> tuple[FloatArray, NDArray[np.int32]]:
    """Return triangles cut at depths that are powers of `DEEP`, the same for all bodies."""
    if not len(corners):
        return corners, owners
    depth = corners[..., 3] if perspective else corners[..., 2]
    least, most = float(depth.min()), float(depth.max())
    if not most > DEEP * max(least, 0.0):
        return corners, owners
    last = int(np.ceil(np.log2(most) / np.log2(DEEP)))
    for power in range(last - 1, last - _SHELLS, -1):
        at = DEEP**power
        if at <= least:
            break
        # perspective: z is one number for a whole body
        c, d = (-at / float(corners[0, 0, 2]), 1.0) if perspective else (1.0, -at)
        parts = [cut_side(corners, owners, (0.0, 0.0, sign * c, sign * d)) for sign in (1.0, -1.0)]
        corners, owners = np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])
    return corners, owners


def cut_side(
    corners: FloatArray, owners: NDArray[np.int32], side: Sequence[float]
) -> tuple[FloatArray, NDArray[np.int32]]:
    """Return what of triangles (m, 3, n) lies where `side` . (x, y, z, w) >= 0, as triangles, and their objects."""
    distance = corners[..., :4] @ np.asarray(side)
    inside = distance >= 0.0
    count = inside.sum(axis=1)
    kept = count == 3
    one, two = np.flatnonzero(count == 1), np.flatnonzero(count == 2)
    tips, tip_distance = _turned(corners, distance, one, inside[one])
    bases, base_distance = _turned(corners, distance, two, ~inside[two])
    a, b, c = bases[:, 0], bases[:, 1], bases[:, 2]
    left, right = (
        _crossing(b, a, base_distance[:, 1], base_distance[:, 0]),
        _crossing(c, a, base_distance[:, 2], base_distance[:, 0]),
    )
    # of the two ways to halve what is left of those with two corners inside, the one along the shorter line in the view
    other = _cosine(right, b) > _cosine(left, c)
    small = [_crossing(tips[:, 0], tips[:, k], tip_distance[:, 0], tip_distance[:, k]) for k in (1, 2)]
    out = np.concatenate(
        [
            corners[kept],
            np.stack([tips[:, 0], *small], axis=1),
            np.stack([left, b, np.where(other[:, None], right, c)], axis=1),
            np.stack([np.where(other[:, None], b, left), c, right], axis=1),
        ]
    )
    return out, np.concatenate([owners[kept], owners[one], owners[two], owners[two]])


def _turned(
    corners: FloatArray, distance: FloatArray, chosen: NDArray[np.int64], lone: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Return the chosen triangles and distances with the lone corner first, in the same sense of rotation."""
    order = (np.argmax(lone, axis=1)[:, None] + np.arange(3)) % 3
    return corners[chosen[:, None], order], distance[chosen[:, None], order]


def _cosine(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return (m,) the cosine between the rays to points in clip space."""
    p, q = one[:, [0, 1, 3]], other[:, [0, 1, 3]]
    lengths = np.linalg.norm(p, axis=1) * np.linalg.norm(q, axis=1)
    out: FloatArray = np.divide((p * q).sum(axis=1), lengths, out=np.zeros_like(lengths), where=lengths > 0.0)
    return out


def _crossing(inner: FloatArray, outer: FloatArray, d_inner: FloatArray, d_outer: FloatArray) -> FloatArray:
    """Return where edges cross a side, always reckoned from inside: neighbours get the very same point."""
    share = d_inner / (d_inner - d_outer)
    out: FloatArray = inner + share[:, None] * (outer - inner)
    return out
