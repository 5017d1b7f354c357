"""What every accumulation pass takes: one sample index of the shared pattern, in all its dimensions at once.

A pass has one place in the pixel, one time, one point on the lens, its points on the lights and one direction for all
pixels: N passes sample pixel, shutter, lens and light together, and cost N passes and not the product (Haeberli and
Akeley 1990). The set is the one that the ray tracer uses under `pattern=shared`: both renderers take the same samples.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from aliasbench.renderers.raster.filtering import Optics
from aliasbench.renderers.sampling.discs import disc_point
from aliasbench.renderers.sampling.hashing import SHARED, frame_key, pixel_key
from aliasbench.renderers.sampling.patterns import (
    DIM_DIRECTION,
    DIM_LENS,
    DIM_LIGHT,
    DIM_TIME,
    DIM_X,
    Pattern,
    make_pattern,
    pattern_frame,
    plane_order,
    plane_position,
    row_count,
    sample_set,
    stream_keys,
)
from aliasbench.renderers.sampling.warps import IDENTITY, warp_points
from aliasbench.renderers.technique import Technique
from aliasbench.scenes.model import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Exposure:
    """One accumulation pass.

    Attributes
    ----------
    jitter : (x, y)
        Where its sample lies relative to the pixel's centre, in pixels, right and down.
    time : float
        Within the open shutter, [0, 1).
    lens : (a, b)
        On the unit disc.
    lights : (k, 2) float64
        Points of the unit square, one for each shadow ray.
    direction : (u, v)
        In the unit square, for glossy reflection.
    weight : float
        What its picture is multiplied by before it is added: the sign of a sample under a filter with lobes, times the
        filter's gain; 1 otherwise.
    """

    jitter: tuple[float, float]
    time: float
    lens: tuple[float, float]
    lights: FloatArray
    direction: tuple[float, float]
    weight: float


class Exposures:
    """All passes of one frame.

    Of many shadow rays at most `most_rays` are drawn at a time: such passes are drawn several times, with some of their
    points on the lights each, and count for the share of these.

    Attributes
    ----------
    passes : int
        Of the technique.
    """

    def __init__(
        self, technique: Technique, optics: Optics, seed: int, frame: int, most_rays: int | None = None
    ) -> None:
        t = technique
        number = pattern_frame(t.reseed, frame)
        points = sample_set(t.sampler, t.passes, seed=seed, frame=number)
        self._points = points
        x, y = points[:, DIM_X], points[:, DIM_X + 1]
        if optics.warp.code == IDENTITY:
            self._places = optics.spread * (points[:, DIM_X : DIM_X + 2] - 0.5)
            self._weights = np.ones(t.passes)
        else:
            dx, dy, signs = warp_points(optics.warp, x, y)
            self._places, self._weights = np.stack([dx, dy], axis=1), optics.warp.gain * signs
        self._times = np.full(t.passes, 0.5) if t.time == "center" else points[:, DIM_TIME]
        self.passes, self._groups = t.passes, -(-t.shadow_rays // (most_rays or t.shadow_rays))
        self._lights = points[:, None, DIM_LIGHT : DIM_LIGHT + 2]
        if t.shadow_rays > 1:
            lights = light_points(t.sampler, t.passes * t.shadow_rays, seed, number)
            self._lights = lights.reshape(t.passes, t.shadow_rays, 2)

    def __len__(self) -> int:
        return self.passes * self._groups

    def __getitem__(self, number: int) -> Exposure:
        k, group = divmod(number, self._groups)
        lights = self._lights[k, group :: self._groups]
        u, v = self._points[k, DIM_LENS], self._points[k, DIM_LENS + 1]
        return Exposure(
            (float(self._places[k, 0]), float(self._places[k, 1])),
            float(self._times[k]),
            disc_point(u, v),
            lights,
            (float(self._points[k, DIM_DIRECTION]), float(self._points[k, DIM_DIRECTION + 1])),
            float(self._weights[k]) * len(lights) / self._lights.shape[1],
        )


def light_points(name: str, count: int, seed: int, frame: int) -> FloatArray:
    """Return the points on the light of all shadow rays of all passes as one set, (count, 2) in [0, 1)."""
    out = np.empty((count, 2))
    _fill_lights(make_pattern(name, count, frame_key(seed, frame), shared=True), out)
    return out


@njit(cache=True)
def _fill_lights(pattern: Pattern, out: FloatArray) -> None:
    count = len(out)
    rows = row_count(count)
    key = pixel_key(pattern.start, SHARED, SHARED)
    a, b = stream_keys(pattern, key, SHARED, SHARED, DIM_LIGHT)
    order = plane_order(pattern, key, SHARED, SHARED, DIM_LIGHT)
    for index in range(count):
        out[index, 0], out[index, 1] = plane_position(pattern, count, rows, index, a, b, order)
