"""What pictures of lenses and open shutters must be, in closed form, and how estimates of it are judged.

For the tests of both renderers. A point at depth Z is seen from the point (a, b) of a lens focused at F shifted by
(a, b) s with s = f (1 / Z - 1 / F) (f the focal length in pixels), or scale (1 - Z / F) under parallel rays.
"""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import shapely
from scipy import stats

from aliasbench.renderers.catalog import prepare
from aliasbench.scenes.model import Animation, Camera, FloatArray, Scene, Surface

EYE_Z = 6.0
ANIMATION = Animation(fps=20.0, shutter=0.5)


def sample(scene: Scene, technique: str, size: tuple[int, int], seeds: int, frame: int = 0) -> FloatArray:
    """Return pictures (seeds, h, w, 3)."""
    with prepare(scene, technique, size=size) as prepared:
        return np.array([prepared.render(frame, seed).pixels for seed in range(seeds)], dtype=np.float64)


def assert_estimates(
    pictures: FloatArray, truth: FloatArray, *, spread: float, samples: int, bound: float = 0.0
) -> None:
    """Assert that pictures (n, h, w, ...) are unbiased estimates of `truth`, values of at most 1 known to `bound`.

    Single values and the whole picture's mean are held to Student's t: once in 10 000 tests would a right one fail.
    `spread` is the most that the standard errors may be in the root mean square. What none of a pixel's `samples` in
    all pictures has met is worth at most 14 / samples: else it were met with probability 1 - e^-14.
    """
    n = len(pictures)
    error = pictures.std(axis=0, ddof=1) / math.sqrt(n)
    off = pictures.mean(axis=0) - truth
    limit = stats.t.ppf(1 - 1e-4 / (2 * off.size), n - 1) * error + 14 / samples + bound
    assert (np.abs(off) <= limit).all(), f"off by up to {np.max(np.abs(off) / limit):.2f} of what is allowed"
    whole = (pictures - truth).reshape(n, -1).mean(axis=1)
    z = (abs(whole.mean()) - bound) / max(float(whole.std(ddof=1)) / math.sqrt(n), 1e-6)
    assert z < stats.t.ppf(1 - 5e-5, n - 1), f"the whole is off by {z:.1f} standard errors, {whole.mean():.2e}"
    assert np.sqrt((error**2).mean()) <= spread


def magnification(camera: Camera, height: int, depth: float) -> float:
    """Return pixels to a world unit at a depth."""
    if camera.height is not None:
        return height / camera.height
    assert camera.fov_y_deg is not None
    return height / 2 / math.tan(math.radians(camera.fov_y_deg) / 2) / depth


def shift_of(camera: Camera, height: int, depth: float, focus: float) -> float:
    """Return by how many pixels an image moves with a world unit on the lens: positive to the same side."""
    return magnification(camera, height, depth) * (depth / focus - 1.0)


def square(x: float, y: float, half: float, depth: float) -> list[tuple[float, float, float]]:
    z = EYE_Z - depth
    return [(x - half, y - half, z), (x + half, y - half, z), (x + half, y + half, z), (x - half, y + half, z)]


def half_plane(depth: float, begin: float = 0.0) -> list[tuple[float, float, float]]:
    """Return what is right of x = begin, far beyond the picture."""
    z = EYE_Z - depth
    return [(begin, -99.0, z), (99.0, -99.0, z), (99.0, 99.0, z), (begin, 99.0, z)]


@cache
def disc_means(x: float, y: float, half: float, radius: float, size: tuple[int, int]) -> FloatArray:
    """Return the picture of a white square of half-width `half` that is spread over a disc, all in pixels.

    A pixel's mean is the share of disc within it, averaged over the places of the disc's middle in the square.
    """
    out = np.zeros((size[1], size[0]))
    nodes, weights = np.polynomial.legendre.leggauss(5)
    boxes = np.array([[shapely.box(j, i, j + 1, i + 1) for j in range(size[0])] for i in range(size[1])])
    for u, a in zip(nodes, weights, strict=True):
        for v, b in zip(nodes, weights, strict=True):
            disc = shapely.Point(x + half * u, y + half * v).buffer(radius, quad_segs=64)
            out += a * b / 4 * shapely.area(shapely.intersection(boxes, disc)) / disc.area
    return out * 4 * half * half


def segment(t: FloatArray) -> FloatArray:
    """Return the share of the unit disc left of x = t."""
    t = np.clip(t, -1.0, 1.0)
    return 0.5 + (t * np.sqrt(1.0 - t * t) + np.arcsin(t)) / math.pi


def segment_integral(t: FloatArray) -> FloatArray:
    """Return an antiderivative of `segment`: linear outside of the disc."""
    c = np.clip(t, -1.0, 1.0)
    root = np.sqrt(1.0 - c * c)
    inside = 0.5 * c + (c * np.arcsin(c) + root - root**3 / 3) / math.pi
    return inside + np.where(t > 1.0, t - 1.0, 0.0)


def edge_profile(edge: float, radius: float, width: int) -> FloatArray:
    """Return the means (width,) over pixels of what is right of `edge` (pixels) spread over a disc."""
    radius = max(abs(radius), 1e-9)
    borders = segment_integral((np.arange(width + 1) - edge) / radius) * radius
    return np.diff(borders)


def pixel_scene(objects: list[Surface], height: float, animation: Animation = ANIMATION, **camera: object) -> Scene:
    """Return a scene of which a world unit is a pixel at `height` pixels, its origin in the middle."""
    place = replace(Camera("orthographic", height=height), **camera)  # type: ignore[arg-type]
    return Scene("shutter", place, tuple(objects), animation=animation)


def box(x0: float, y0: float, x1: float, y1: float, z: float = 0.0) -> list[tuple[float, float, float]]:
    return [(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)]


def square_of_positive(x: FloatArray) -> FloatArray:
    return np.maximum(x, 0.0) ** 2 / 2


def sector_shares(begin: float, turns: float, width: float, size: tuple[int, int]) -> FloatArray:
    """Return the shares of time (h, w) that pixels are in a sector of `width` turns, from `begin` to begin + turns.

    A point at angle p (in turns) is in it while the sector's first edge is at p - width to p: the mean over the turns
    of a wave of period 1, whose integral is floor(x) width + min(frac(x), width). Over the pixel by 24 x 24 points.
    """
    fine = 24
    x = (np.arange(size[0] * fine) + 0.5) / fine - size[0] / 2
    y = size[1] / 2 - (np.arange(size[1] * fine) + 0.5) / fine
    angle = np.arctan2(y[:, None], x[None, :]) / (2 * math.pi)

    def integral(edge: FloatArray) -> FloatArray:
        # of 1[frac(edge - (p - width)) < width] over the edge's place
        along = edge - angle + width
        return np.floor(along) * width + np.minimum(along - np.floor(along), width)

    shares = (integral(np.asarray(begin + turns)) - integral(np.asarray(begin))) / turns
    return shares.reshape(size[1], fine, size[0], fine).mean(axis=(1, 3))
