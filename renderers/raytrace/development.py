"""How a picture is exposed on film, group of rows after group of rows, and who gets how many samples.

Adaptive sampling (the lecture's: start small, look at the variance, go on to a tolerance) comes in two forms. `pooled`
looks at a pixel's own samples and goes on while their standard error is too large: efficient and biased, because a
pixel whose first samples happen to agree stops with them. `unbiased` never lets the number of a pixel's samples depend
on those samples: it comes from the pilots of the eight neighbours, which see the same edges (`allocation`), and each
pixel keeps its own pilot. Where neighbours' samples depend on each other (`pattern=shared`, `sampler=bluenoise`) a
pilot of its own decides as well, and all pilots are discarded.

Under wide filters every sample carries 1 / n of its own pixel, so that no pixel counts more for having more samples:
each pixel's part of a filter integral is estimated by itself. Samples are taken again there once their number is known,
which costs the pilot twice and memory for nothing but their number.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.frame import Progress
from aliasbench.renderers.raytrace.allocation import (
    CountArray,
    neighbour_numbers,
    next_numbers,
    resolve_sums,
    variances,
)
from aliasbench.renderers.raytrace.film import Film, develop_rows
from aliasbench.renderers.raytrace.profiles import profile_polynomials
from aliasbench.renderers.sampling.filters import GAUSSIAN, FilterSpec, filter_of
from aliasbench.renderers.sampling.hashing import combine
from aliasbench.renderers.sampling.patterns import RANDOM, SOBOL, Pattern, make_pattern
from aliasbench.renderers.sampling.warps import IDENTITY, Warp, make_warp
from aliasbench.renderers.technique import Technique
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import FloatArray

Expose = Callable[[Pattern, Film], None]
Spread = Callable[..., None]

_GROUP_BYTES = 64 << 20
_MOST_BYTES = 2 << 30
# Beyond so many sigmas a Gaussian has 4e-9 of its mass, and weights get down to what polynomials leave of it (1e-9 of
# the peak): they could be negative, and sums of them anything.
_FAR_SIGMAS = 6.0
_LANES = 16  # of a packet
_PILOT = 0x9110  # what the key of a discarded pilot is derived with
# Under a filter with lobes few samples can have weights that nearly cancel, and a quotient of them is anything; see
# `_resolve`. Of single samples of a pixel 7 % do (lanczos), of four 0.1 %, of sixteen none.
_LEAST_WEIGHT = 0.25
_NO_WEIGHT = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Optics:
    """What a technique's film is made with: whether samples are splatted, and by which filter or warp."""

    spec: FilterSpec
    warp: Warp
    is_splat: bool
    profile: FloatArray

    @property
    def reach(self) -> float:
        """How far away a sample counts at most, across or up, in pixels: where weights are more than rounding."""
        if self.spec.kind.code == GAUSSIAN:
            return min(self.spec.radius, _FAR_SIGMAS * self.spec.sigma)
        return self.spec.radius

    @property
    def margin(self) -> int:
        """How many pixels away a sample still counts."""
        return max(0, math.ceil(self.reach - 0.5)) if self.is_splat else 0

    @property
    def spread(self) -> float:
        """The side of the square in the middle of a pixel that its samples lie in: none where no filter reaches."""
        return min(1.0, 2.0 * self.reach) if self.is_splat else 1.0

    def row_bytes(self, width: int) -> int:
        """Return the memory of one row of film of a picture `width` pixels wide."""
        each = 96 if not self.is_splat else 32 * (2 * self.margin + 1) + 96
        return (width + 2 * self.margin) * each


def make_optics(technique: Technique, width: int) -> Optics:
    """Return what the film of a picture `width` pixels wide is made with.

    Raises
    ------
    InputError
        For a filter so wide that a row of its picture does not fit in memory.
    """
    spec = filter_of(technique)
    is_box = technique.filter == "box" and technique.radius_px == 0.5
    is_splat = technique.weighting == "samples" and not is_box
    optics = Optics(spec, make_warp(technique), is_splat, np.zeros((0, 0, 0)))
    if optics.row_bytes(width) * (2 * optics.margin + 2) > _MOST_BYTES:
        raise InputError(
            f"radius={technique.radius_px:g}: a picture {width} pixels wide under so wide a filter needs more than "
            f"{_MOST_BYTES >> 30} GB; a smaller radius or picture does not"
        )
    if is_splat and spec.kind.separable:
        return replace(optics, profile=profile_polynomials(spec, optics.margin, 0.5 * optics.spread))
    return optics


def is_plain(technique: Technique, optics: Optics) -> bool:
    """Return whether every pixel takes the same number of samples of equal weight, spread over the pixel alone."""
    return technique.adaptive == "off" and not optics.is_splat and optics.warp.code == IDENTITY


class Room:
    """Memory of film that is used again for the next rows and pictures: fresh memory costs as much as the samples."""

    __slots__ = ("_arrays",)

    def __init__(self) -> None:
        self._arrays: dict[str, FloatArray] = {}

    def zeros(self, name: str, shape: tuple[int, ...]) -> FloatArray:
        """Return zeros of a shape, and forget what was kept under the name before."""
        size = math.prod(shape)
        held = self._arrays.get(name)
        if held is None or held.size < size:
            held = self._arrays[name] = np.zeros(size)
        out = held[:size].reshape(shape)
        out.fill(0.0)
        return out


@dataclass(slots=True, eq=False)
class Development:
    """One picture on its way: what exposes film, with which pattern and optics.

    Attributes
    ----------
    technique : Technique
    size : (width, height)
    pattern : Pattern
    optics : Optics
    expose : callable
        Adds the samples of a pattern to a film.
    spread : callable
        Calls a function with the first row of a part of so many rows and the one after, and what else it needs, for
        all parts.
    exponent : float
        See `allocation`.
    room : Room
        Where film is kept from one picture to the next.
    progress : callable, optional
        Is told the finished share of the picture.
    """

    technique: Technique
    size: tuple[int, int]
    pattern: Pattern
    optics: Optics
    expose: Expose
    spread: Spread
    exponent: float
    room: Room
    progress: Progress | None = None

    def run(self) -> tuple[NDArray[np.float32], CountArray | None]:
        """Return the picture (h, w, 3), and the samples of each pixel (h, w) where they differ."""
        width, height = self.size
        margin = self.optics.margin
        group = max(1, min(height + 2 * margin, _GROUP_BYTES // self.optics.row_bytes(width)))
        out = np.zeros((height, width, 3), np.float32)
        counts = None if self.technique.adaptive == "off" else np.zeros((height, width), np.int32)
        window, top = np.zeros((0, width, 4)), 0  # image rows from `top` on that rows of samples still add to
        for first in range(-margin, height + margin, group):
            after = min(first + group, height + margin)
            if counts is None:
                shape = (after - first, width + 2 * margin)
                numbers, film = np.full(shape, self.pattern.samples, np.int32), None
                passes = [(np.zeros(shape, np.int32), numbers)]
            else:
                film, numbers, passes = self._adapt(first, after)
                inside = slice(max(first, 0) - first, min(after, height) - first)
                extra = self.technique.min_spp if self._discards else 0
                counts[max(first, 0) : min(after, height)] = numbers[inside, margin : margin + width] + extra
            if self.optics.is_splat:
                rows = min(after + margin, height) - top
                window = np.concatenate([window, np.zeros((max(rows - len(window), 0), width, 4))])
                self._splat(first, passes, numbers, window, top)
                done = min(after - margin, height) - top if after < height + margin else height - top
                if done > 0:
                    # what float32 cannot hold comes out infinite, as it does without a filter
                    with np.errstate(over="ignore", invalid="ignore"):
                        out[top : top + done] = self._resolve(window[:done])
                    window, top = window[done:].copy(), top + done
            else:
                if film is None:
                    film = self._film(first, -margin, *passes[0], sums=True)
                    self.expose(self.pattern, film)
                around = (len(film.sums) - len(numbers)) // 2
                self.spread(resolve_sums, after - first, film, numbers, around, out[first:after])
            if self.progress is not None:
                self.progress((after + margin) / (height + 2 * margin))
        return out, counts

    @property
    def _discards(self) -> bool:
        """Whether pilots are discarded (see the module)."""
        shares = self.pattern.shared or self.pattern.sampler > SOBOL
        return self.technique.adaptive == "unbiased" and shares

    def _film(
        self, row: int, column: int, begins: CountArray, ends: CountArray, *, sums: bool = False, squares: bool = False,
        each: int = 0, numbers: CountArray | None = None,
    ) -> Film:  # fmt: skip
        """Return a film for sums, with or without squares, or for splats of samples that weigh 1 / `numbers`.

        Every pixel takes its first `each` samples, unless it is 0.
        """
        rows, columns = begins.shape
        optics = self.optics
        empty = np.zeros((0, 0, 0))
        taps = 2 * optics.margin + 1
        return Film(
            row,
            column,
            begins,
            ends,
            each if 0 < each < _LANES and _LANES % each == 0 else 0,
            self.room.zeros("shifts", (rows, columns, 3)) if squares else empty,
            self.room.zeros("sums", (rows, columns, 3)) if sums else empty,
            self.room.zeros("squares", (rows, columns, 3)) if squares else empty,
            np.zeros((0, 0)) if numbers is None else 1.0 / numbers,
            np.zeros((0, 0, 0, 0)) if numbers is None else self.room.zeros("splats", (rows, taps, self.size[0], 4)),
            optics.margin,
            optics.reach,
            optics.spread,
            -math.inf if optics.spec.gain > 1.0 else 0.0,
            not optics.spec.kind.separable,
            optics.profile,
            optics.warp,
        )

    def _splat(
        self, row: int, passes: list[tuple[CountArray, CountArray]], numbers: CountArray, window: FloatArray, top: int
    ) -> None:
        """Add rows of samples, taken in passes, to the window."""
        film = self._film(row, -self.optics.margin, *passes[0], numbers=numbers)
        for begins, ends in passes:
            self.expose(self.pattern, film._replace(begins=begins, ends=ends))
        develop_rows(film.splats, row, window, top)

    def _resolve(self, window: FloatArray) -> FloatArray:
        """Return the colours of finished rows of a window.

        Where weights nearly cancel it is the sum of weighted colours over the weight expected, and what is missing to
        that weight, or too much, has the mean colour of the neighbours in the row: what is flat stays flat.
        """
        weights = window[..., 3:]
        if self.optics.spec.gain > 1.0:
            # samples weigh 1 / n over the square that they are spread over, and the filter's integral is 1
            expected = self.optics.spread**-2
            weak = weights < _LEAST_WEIGHT * expected
            out: FloatArray = window[..., :3] / np.where(weak, expected, weights)
            if weak.any():
                reach = 2 * self.optics.margin + 1
                padded = np.pad(window, ((0, 0), (reach, reach), (0, 0)))
                sums = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1, axis=1).sum(axis=-1)
                strong = sums[..., 3:] > _LEAST_WEIGHT * expected * reach
                means = np.divide(sums[..., :3], sums[..., 3:], out=np.zeros_like(out), where=strong)
                out += np.where(weak, (1.0 - weights / expected) * means, 0.0)
                # one pattern for all pixels may be weak everywhere: then there is but the quotient
                lone = weak & ~strong & (np.abs(weights) > _NO_WEIGHT)
                out = np.where(lone, window[..., :3] / np.where(lone, weights, 1.0), out)
            return out
        return np.divide(window[..., :3], weights, out=np.zeros_like(window[..., :3]), where=weights > 0.0)

    def _adapt(self, first: int, after: int) -> tuple[Film, CountArray, list[tuple[CountArray, CountArray]]]:
        """Return rows of film with the sums of all samples, their numbers, and the passes they were taken in.

        The film may have rows and columns around those that the numbers are of.
        """
        t, margin = self.technique, self.optics.margin
        ring = 1 if t.adaptive == "unbiased" else 0
        shape = (after - first + 2 * ring, self.size[0] + 2 * (margin + ring))
        begins, ends = np.zeros(shape, np.int32), np.full(shape, t.min_spp, np.int32)
        film = self._film(first - ring, -margin - ring, begins, ends, sums=True, squares=True, each=t.min_spp)
        pattern = self.pattern
        if self._discards:
            name = "random" if pattern.sampler == RANDOM else "sobol"
            start = int(combine(pattern.start, _PILOT))
            pattern = make_pattern(name, t.max_spp, start, shared=False, progressive=True)
        self.expose(pattern, film)
        film = film._replace(each=0)
        if t.adaptive == "pooled":
            return self._pool(film, ends)
        numbers = self._needed(film, ends)
        pilots = np.minimum(t.min_spp, numbers)
        if self._discards:
            passes = [(np.zeros_like(numbers), numbers)]
            film = self._film(first, -margin, *passes[0], sums=True, squares=True)
            if not self.optics.is_splat:
                self.expose(self.pattern, film)
            return film, numbers, passes
        if not self.optics.is_splat:
            ends = ends.copy()
            ends[1:-1, 1:-1] = numbers
            self.expose(self.pattern, film._replace(begins=film.ends, ends=ends, squares=np.zeros((0, 0, 0))))
        return film, numbers, [(np.zeros_like(numbers), pilots), (pilots, numbers)]

    def _pool(self, film: Film, numbers: CountArray) -> tuple[Film, CountArray, list[tuple[CountArray, CountArray]]]:
        """Take more samples, until their standard error is within the tolerance or there are as many as allowed."""
        t = self.technique
        passes = [(film.begins, film.ends)]
        while True:
            own, ends = np.empty(numbers.shape), np.empty_like(numbers)
            self.spread(variances, len(own), film, numbers, own)
            if not next_numbers(own, numbers, t.tolerance, self.exponent, t.max_spp, ends):
                return film, numbers, passes
            self.expose(self.pattern, film._replace(begins=numbers, ends=ends))
            passes.append((numbers, ends))
            numbers = ends

    def _needed(self, film: Film, numbers: CountArray) -> CountArray:
        """Return the numbers of samples inside the film's outermost ring that pilots ask for."""
        t = self.technique
        own = np.empty(numbers.shape)
        self.spread(variances, len(own), film, numbers, own)
        out = np.empty((numbers.shape[0] - 2, numbers.shape[1] - 2), np.int32)
        rest = (film, own, t.tolerance, self.exponent, t.min_spp, t.max_spp, self._discards, out)
        self.spread(neighbour_numbers, len(out), *rest)
        return out
