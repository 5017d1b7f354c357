"""Where a plane of equally turned facets shows a point, and triangles fine enough to be drawn there.

In a pass all facets of a glossy plane have one normal h. A pixel's ray from the eye E meets the plane at P and goes on
along R (P - E), R the reflection in h. It meets X where P + s R (P - E) = X for an s >= 0, and the eye sees X where it
saw P: as if at E + (1 + s) (P - E). With heights e, x of eye and point over the plane, n its normal, taking n . P = 0:

    e s^2 - c s - x = 0,   c = e - x - 2 (n . h) h . (E - X),   X' = X - h (x + s e) / (n . h).

For e > 0 and x >= 0 one root is not negative. For h = n it is s = x / e, and X' is X mirrored. To mirror in a plane
through some pivot instead would be linear in X, but right at the pivot alone: what stands on a floor would leave it.
Under parallel rays along d, X' = X + 2 s (h . d) h with s = x / (n . R d).

A straight edge has a curved image unless h = n. Edges are halved until the image of the middle is near enough the
middle of the images, and on both sides of an edge alike.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.model import FloatArray

_MOST_LEVELS, _MOST_TRIANGLES = 6, 30000
_TINY = 1e-300


@dataclass(frozen=True, slots=True, eq=False)
class Mirror:
    """A glossy plane as the viewer sees it.

    Attributes
    ----------
    normal : (3,) float64
        Unit, on the viewer's side.
    offset : float
    eye : (3,) float64
    direction : (3,) float64 or None
        Of parallel rays, unit.
    """

    normal: FloatArray
    offset: float
    eye: FloatArray
    direction: FloatArray | None

    @property
    def eye_height(self) -> float:
        """Of the eye over the plane."""
        return float(self.normal @ self.eye) - self.offset

    def parallel_shift(self, half: FloatArray) -> FloatArray:
        """Return X' - X for a point at height 1, under parallel rays; 0 where these would go on below the plane."""
        if self.direction is None:
            return np.zeros(3)
        turned = float(half @ self.direction)
        onward = self.direction - 2.0 * turned * half
        rise = float(self.normal @ onward)
        return 2.0 * turned * half / rise if rise > 0.0 else np.zeros(3)

    def image(self, points: FloatArray, half: FloatArray) -> FloatArray:
        """Return where points (..., 3) at or above the plane appear."""
        x = np.maximum(points @ self.normal - self.offset, 0.0)
        if self.direction is not None:
            return points + x[..., None] * self.parallel_shift(half)
        e, slope = self.eye_height, float(self.normal @ half)
        c = e - x - 2.0 * slope * ((self.eye - points) @ half)
        root = np.sqrt(c * c + 4.0 * e * x)
        along = np.where(c > 0.0, 0.5 * (c + root), 2.0 * e * x / np.maximum(root - c, _TINY))
        return points - ((x + along) / slope)[..., None] * half


def refine(mirror: Mirror, corners: FloatArray, halves: FloatArray, tolerance: float) -> FloatArray:
    """Return triangles (m, 3, n) halved until their images are straight.

    Parameters
    ----------
    corners : (m, 3, n) float64
        Places, and n - 3 more values that are linear on a triangle.
    halves : (k, 3) float64
        Facets that images must be straight for.
    tolerance : float
        How far off the middle of an edge may appear: the tangent of an angle seen from the eye, or a length where rays
        are parallel.
    """
    for _ in range(_MOST_LEVELS):
        middles = 0.5 * (corners + np.roll(corners, -1, axis=1))  # of the edges 0-1, 1-2, 2-0
        split = np.zeros(middles.shape[:2], dtype=bool)
        for half in halves:
            ends, middle = mirror.image(corners[..., :3], half), mirror.image(middles[..., :3], half)
            off = np.linalg.norm(middle - 0.5 * (ends + np.roll(ends, -1, axis=1)), axis=2)
            scale = 1.0 if mirror.direction is not None else np.linalg.norm(middle - mirror.eye, axis=2)
            split |= off > tolerance * scale
        if not split.any() or len(corners) > _MOST_TRIANGLES:
            break
        corners = _halve(corners, middles, split)
    return corners


def _halve(corners: FloatArray, middles: FloatArray, split: NDArray[np.bool_]) -> FloatArray:
    count = split.sum(axis=1)
    out = [corners[count == 0]]
    for number in (1, 2):
        chosen = np.flatnonzero(count == number)
        # the one edge that is split, or is not, comes first
        first = np.argmax(split[chosen] == (number == 1), axis=1)
        order = (first[:, None] + np.arange(3)) % 3
        a, b, c = (corners[chosen[:, None], order][:, k] for k in range(3))
        ab, bc, ca = (middles[chosen[:, None], order][:, k] for k in range(3))
        parts = [(a, ab, c), (ab, b, c)] if number == 1 else [(a, b, bc), (a, bc, ca), (ca, bc, c)]
        out += [np.stack(part, axis=1) for part in parts]
    whole = count == 3
    a, b, c = (corners[whole][:, k] for k in range(3))
    ab, bc, ca = (middles[whole][:, k] for k in range(3))
    out += [np.stack(part, axis=1) for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    return np.concatenate(out)
