"""Textures that slide along their own rows while the shutter is open: the mean over the way is exact too.

A camera that moves sideways over a floor leaves the picture's outlines and depths where they are, and moves every u by
the same amount c. The mean of a row of texels over [u, u + c] is a difference of its running sum (`textured`), and that
of a sine wave is the wave of the middle times sinc(c). So such a frame costs three instants and has their bound.
"""

from dataclasses import replace

import numpy as np

from aliasbench.renderers.reference.paths import Paths
from aliasbench.renderers.reference.surfaces import FLAT, WALK, WAVE, Surfaces
from aliasbench.renderers.reference.textured import Instant
from aliasbench.scenes.model import FloatArray

_STILL = 1e-9  # texels, pixels and shares of a depth
_EPS = 64 * 2.0**-52
_LOOSEST = 1e-6


def is_even_motion(paths: Paths, frame: int) -> bool:
    """Return whether everything moves in straight lines at constant speed and nothing turns."""
    turning = any(m.matrices is not None or (m.spin is not None and m.spin.rev_per_s != 0.0) for m in paths.motions)
    return not turning and paths.camera_turn(frame) == 0.0


def average_slide(begin: Instant, end: Instant) -> Instant | None:
    """Return what to draw for the mean from one instant to another of an even motion; None if more than u changes.

    The outlines are straight and move evenly: where both instants have the same, so have all between.
    """
    a, b = begin.pieces, end.pieces
    if (
        len(a.owners) != len(b.owners)
        or not np.array_equal(a.starts, b.starts)
        or not np.array_equal(a.owners, b.owners)
    ):
        return None
    moved = float(np.abs(a.points - b.points).max(initial=0.0))
    depth = np.abs(a.planes[:, 0]).max(axis=(0,), initial=1e-300)
    if moved > _STILL or (np.abs(a.planes[:, 0] - b.planes[:, 0]) > 1e-12 * depth).any():
        return None
    s, e = begin.surfaces, end.surfaces
    if not np.array_equal(s.ways, e.ways):
        return None
    shifts, left = np.zeros(len(a.owners)), moved
    for m in np.flatnonzero(s.ways != FLAT):
        points = a.points[a.starts[m] : a.starts[m + 1]]
        homogeneous = np.c_[points, np.ones(len(points))]
        change = homogeneous @ e.own[m, :2].T / (homogeneous @ e.own[m, 2])[:, None]
        change -= homogeneous @ s.own[m, :2].T / (homogeneous @ s.own[m, 2])[:, None]
        shifts[m] = change[:, 0].mean()
        stray = float(np.abs(change - [shifts[m], 0.0]).max())
        if abs(shifts[m]) <= 1e-12 and stray <= 1e-12:
            shifts[m] = 0.0
        elif stray > _STILL or s.ways[m] not in (WALK, WAVE):
            return None
        left = max(left, stray)
    brightest = float(np.abs(begin.colors).max() * max(1.0, float(np.abs(s.texels).max())))
    surfaces = _slid(s, shifts, 4 * left * brightest, brightest)
    return None if surfaces.bound > _LOOSEST else replace(begin, surfaces=surfaces)


def _slid(still: Surfaces, shifts: FloatArray, left: float, brightest: float) -> Surfaces:
    """Return surfaces that show the mean over their shifts; `left` is what moves otherwise, times the contrast."""
    own, params, shifted = still.own.copy(), still.params.copy(), still.shifted.copy()
    rests, blocks = shifts.copy(), [still.texels]
    totals = [still.sums]
    end, loss, rounding = len(still.texels), 1.0, 0.0
    known: dict[int, tuple[tuple[int, int, int], tuple[int, int, int], float]] = {}
    for m in np.flatnonzero(shifts):
        if still.ways[m] == WAVE:
            own[m, 0] += shifts[m] / 2 * own[m, 2]
            middle, half = (params[m, :3] + params[m, 3:6]) / 2, (params[m, 3:6] - params[m, :3]) / 2
            params[m, :3], params[m, 3:6] = middle - half * np.sinc(shifts[m]), middle + half * np.sinc(shifts[m])
            rests[m] = 0.0
            continue
        h, w, first = (int(v) for v in still.blocks[m])
        if first not in known:
            image = still.texels[first : first + h * (w + 1)].reshape(h, w + 1, 3)[:, :w]
            mean = image.mean(axis=1, keepdims=True)
            running = np.concatenate([np.zeros((h, 1, 3)), np.cumsum(image - mean, axis=1)], axis=1)
            running[:, w] = 0.0
            running -= running[:, :w].mean(axis=1, keepdims=True)
            steps = np.cumsum((running[:, 1:] + running[:, :-1]) / 2, axis=1)
            blocks += [np.repeat(mean, 2, axis=1).reshape(-1, 3), running.reshape(-1, 3)]
            zero = np.zeros((h, 1, 3))
            totals += [np.concatenate([zero, mean], axis=1).reshape(-1, 3)]
            totals += [np.concatenate([zero, steps], axis=1).reshape(-1, 3)]
            known[first] = ((h, 1, end), (h, w, end + 2 * h), float(np.abs(running).max()))
            end += 2 * h + h * (w + 1)
        shifted[m, 0], shifted[m, 1], height = known[first]
        loss = max(loss, 1.0 + 2.0 / abs(shifts[m]))
        rounding = max(rounding, _EPS * (1.0 + height / abs(shifts[m])))
    bound = (still.bound + left) * loss + rounding * brightest
    return replace(
        still, own=own, params=params, shifts=rests, shifted=shifted, texels=np.concatenate(blocks),
        sums=np.concatenate(totals), bound=bound,
    )  # fmt: skip
