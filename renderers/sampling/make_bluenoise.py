"""Makes the tiles of `bluenoise`: `python -m aliasbench.renderers.sampling.make_bluenoise` writes its data file.

The errors to be made blue are those of half spaces n.l - a.x < t over the second pair's point l and the place x in the
pixel, both about the squares' centres. Over the picture t grows by a.p, since the edge does not move with the pixel:
|n| = 1 and |a| is one over the border's width in pixels. In t, the error of a set is a Fourier series with terms

    E_w = (mean of exp(-i w (n.l - a.x)) over the set - the same over both squares) / (i w),

and the blurred error's mean square over all t of an edge is the sum over w of |sum_q g(p - q) E_w(q) exp(i w a.q)|^2.
With G = g * g and K_w(d) = G(d) exp(-i w a.d) the energy to be minimised is the sum over pixels p, q and over terms
(edges and w) of conj(E_w(p)) K_w(p - q) E_w(q). Metropolis' algorithm changes one field of one pixel's keys at a time;
the blurred terms h = K E are kept, so that a proposal costs only the new E of one pixel.

The energy alone would also prefer sets with small errors of their own. A multiple of the sum of |E|^2 is subtracted,
and adjusted after every sweep so that the mean square stays that of random keys: the sampler's error is neither helped
nor harmed. A multiple of the square of the tile's mean of E is added, also for edges over one pair alone: that is the
sampler's bias over all seeds, which chance alone would leave at 1 / SIDE of a pixel's error.

The same machine and libraries give the same file; others may round differently and end in another tile as good.
"""

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aliasbench.renderers.sampling.bluenoise import (
    DATA,
    FIELDS,
    LEVELS,
    OWN,
    SIDE,
    WORDS,
    Tile,
    fill_pair,
    fill_words,
    to_planes,
)
from aliasbench.renderers.sampling.hashing import combine, mix32, unit
from aliasbench.renderers.sampling.sobol import WordArray, sobol_tables
from aliasbench.scenes.model import FloatArray

Single = NDArray[np.float32]

BLUR_PX = 1.0
REACH = 4  # of the kernel; G has fallen to e^-4 of its peak there
WIDEST, NARROWEST = 0.05, 0.25  # |a|: borders of 20 and 4 pixels
STRETCH = 1.6  # of a against n, for slanted surfaces
HOT, COLD = 0.05, 0.001  # temperatures, relative to what a random change costs at first
PHASES = 8192  # steps of a turn in the table of exponentials
COARSE = 256.0  # points are known to 8 bits
# What is free in each field; bit 8 of a key has no effect, since the factor it belongs to is odd.
MASKS = np.array([0xFEFF] * 4 + [OWN] * (FIELDS - 5) + [0xFFFF])


@dataclass(frozen=True, slots=True)
class Plan:
    """How one tile is made.

    Attributes
    ----------
    fields : tuple of int
        Which fields are free.
    terms : int
        Of each edge's series.
    mirrored : float
        Weight of errors of edges that move over the second pair in other than the picture's direction.
    sweeps : int
        Proposals for each pixel.
    """

    fields: tuple[int, ...]
    terms: int
    mirrored: float
    sweeps: int


_ONE_KEY, _ALL_KEYS = (0, 1, 2, 3, FIELDS - 1), tuple(range(FIELDS))
# With few samples a pixel's error has few degrees of freedom, and all directions can be had at once.
PLANS = {
    1: Plan((0, 1, 2, 3), 8, 1.0, 150),
    2: Plan(_ONE_KEY, 8, 1.0, 200),
    4: Plan(_ALL_KEYS, 8, 0.6, 400),
    8: Plan(_ALL_KEYS, 10, 0.0, 500),
    16: Plan(_ALL_KEYS, 12, 0.0, 900),
    32: Plan(_ONE_KEY, 12, 0.0, 120),
}
EDGES = 32  # to be blue
LONE_EDGES = 16  # over either pair alone, to have no bias
EVEN = 0.002  # weight of the squared sum over the tile for the lowest frequency, relative to the kernel's peak


def edge_family(mirrored: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return normals n (edges, 2), slopes a (edges, 2) and weights (edges,), spread evenly over what edges may be."""
    golden, plastic = 0.6180339887498949, 0.7548776662466927
    k = np.arange(EDGES)
    angle = math.pi * (k + 0.5) / EDGES
    n = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    size = WIDEST * (NARROWEST / WIDEST) ** (k * golden % 1.0)
    ratio = STRETCH ** (k * plastic % 1.0 - 0.5)
    a = n * np.stack([size * ratio, size / ratio], axis=1)
    if mirrored == 0.0:
        return n, a, np.ones(EDGES)
    signs = np.array([(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0)])[k % 3]
    return np.concatenate([n, n]), np.concatenate([a, a * signs]), np.repeat([1.0, mirrored], EDGES)


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """Terms of the edges' errors; a term's index is frequency * edges + edge.

    Attributes
    ----------
    direction : (4, edges) float32
        n.l - a.x in turns of the lowest frequency, over the coordinates (x, l).
    scale, mean : (terms,) float32
        The factor of a term and its expectation before it.
    even : (terms,) float32
        The weight of the squared sum of a term over the tile.
    kernel : (2, 2 REACH + 1, 2 REACH + 1, terms) float32
        K by parts, rows and columns; 0 for edges over one pair alone.
    """

    direction: Single
    scale: Single
    mean: Single
    even: Single
    kernel: Single


def make_series(plan: Plan) -> Series:
    """Return the terms that a plan's tile is made for."""
    n, a, weight = edge_family(plan.mirrored)
    angle = math.pi * np.arange(LONE_EDGES) / LONE_EDGES
    lone, none = np.stack([np.cos(angle), np.sin(angle)], axis=1), np.zeros((LONE_EDGES, 2))
    n, a = np.concatenate([n, lone, none]), np.concatenate([a, none, lone])
    blurred = np.arange(len(n)) < len(weight)
    weight = np.where(blurred, np.resize(weight, len(n)), 1.0)
    vector = np.concatenate([-a, n], axis=1)
    period = np.abs(vector).sum(axis=1)  # outside of it all or nothing is inside the edge
    order = np.arange(1, plan.terms + 1)[:, None]
    turns = order / period
    mean = np.sinc(turns[:, :, None] * vector).prod(axis=2)
    scale = weight / (2.0 * math.pi * turns * np.sqrt(period))
    d = np.arange(-REACH, REACH + 1)
    blur = np.exp(-(d[:, None] ** 2 + d**2) / (4.0 * BLUR_PX**2)) / (4.0 * math.pi * BLUR_PX**2)
    motion = d[None, :, None] * a[:, 0] + d[:, None, None] * a[:, 1]
    kernel = blurred * blur[:, :, None, None] * np.exp(-2j * math.pi * turns * motion[:, :, None, :])
    kernel = kernel.reshape(len(d), len(d), -1)
    return Series(
        np.ascontiguousarray((vector / period[:, None]).T, dtype=np.float32),
        scale.ravel().astype(np.float32),
        mean.ravel().astype(np.float32),
        (EVEN * blur.max() * order**2 * np.ones(len(n))).ravel().astype(np.float32),
        np.stack([kernel.real, kernel.imag]).astype(np.float32),
    )


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def errors(
    tables: WordArray,
    words: Tile,
    count: int,
    direction: Single,
    scale: Single,
    mean: Single,
    turn: Single,
    points: FloatArray,
    out: Single,
) -> None:
    """Write E of one pixel to `out`, (2, terms): real and imaginary parts, up to the factor 1 / i."""
    edges, terms = direction.shape[1], len(scale)
    fill_pair(tables, words, count, False, 0, 0, 0, points[0])
    fill_pair(tables, words, count, True, 0, 0, 0, points[1])
    out[:] = np.float32(0.0)
    for s in range(count):
        x = np.float32((math.floor(points[0, s, 0] * COARSE) + 0.5) / COARSE - 0.5)
        y = np.float32((math.floor(points[0, s, 1] * COARSE) + 0.5) / COARSE - 0.5)
        u = np.float32((math.floor(points[1, s, 0] * COARSE) + 0.5) / COARSE - 0.5)
        v = np.float32((math.floor(points[1, s, 1] * COARSE) + 0.5) / COARSE - 0.5)
        for e in range(edges):
            turns = direction[0, e] * x + direction[1, e] * y + direction[2, e] * u + direction[3, e] * v
            phase = int(turns * np.float32(PHASES)) & (PHASES - 1)
            step_r, step_i = turn[0, phase], turn[1, phase]
            real, imaginary = step_r, step_i
            for k in range(e, terms, edges):
                out[0, k] += real
                out[1, k] += imaginary
                real, imaginary = real * step_r - imaginary * step_i, real * step_i + imaginary * step_r
    share = np.float32(1.0 / count)
    for k in range(terms):
        out[0, k] = (out[0, k] * share - mean[k]) * scale[k]
        out[1, k] *= share * scale[k]


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def spread(change: Single, pixel: int, kernel: Single, h: Single) -> None:
    """Add K times a change of one pixel's E to `h`, (SIDE^2, 2, terms)."""
    terms = change.shape[1]
    row, column = pixel // SIDE, pixel % SIDE
    for i in range(2 * REACH + 1):
        for j in range(2 * REACH + 1):
            at = (row + i - REACH) % SIDE * SIDE + (column + j - REACH) % SIDE
            for k in range(terms):
                h[at, 0, k] += kernel[0, i, j, k] * change[0, k] - kernel[1, i, j, k] * change[1, k]
                h[at, 1, k] += kernel[0, i, j, k] * change[1, k] + kernel[1, i, j, k] * change[0, k]


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _sweep(
    tables: WordArray,
    fields: NDArray[np.int64],
    free: NDArray[np.int64],
    masks: NDArray[np.int64],
    count: int,
    direction: Single,
    scale: Single,
    mean: Single,
    turn: Single,
    kernel: Single,
    even: Single,
    keep: float,
    heat: float,
    key: int,
    E: Single,
    h: Single,
) -> None:
    """Propose one change for each pixel on average; `keep` is the subtracted share of each pixel's own energy."""
    terms = len(scale)
    new, total = np.empty((2, terms), np.float32), np.zeros((2, terms), np.float32)
    points = np.empty((2, count, 2))
    trial, words = np.empty(FIELDS, np.int64), np.empty(WORDS, np.uint64)
    two, spared = np.float32(2.0), np.float32(keep)
    for pixel in range(SIDE * SIDE):
        total += E[pixel]
    for step in range(SIDE * SIDE):
        pixel = int(unit(key, 4 * step) * SIDE * SIDE)
        field = free[int(unit(key, 4 * step + 1) * len(free))]
        for k in range(FIELDS):
            trial[k] = fields[pixel, k]
        trial[field] = int(unit(key, 4 * step + 2) * 65536.0) & masks[field]
        fill_words(trial, words)
        errors(tables, words, count, direction, scale, mean, turn, points, new)
        cost = np.float32(0.0)
        for part in range(2):
            for k in range(terms):
                old = E[pixel, part, k]
                d = new[part, k] - old
                own = kernel[0, REACH, REACH, k]
                cost += d * (two * h[pixel, part, k] + own * (d - spared * (new[part, k] + old)))
                cost += d * even[k] * (two * total[part, k] + d)
        if cost < 0.0 or unit(key, 4 * step + 3) < math.exp(-cost / heat):
            fields[pixel, field] = trial[field]
            for part in range(2):
                for k in range(terms):
                    value = new[part, k]
                    new[part, k] = value - E[pixel, part, k]
                    total[part, k] += new[part, k]
                    E[pixel, part, k] = value
            spread(new, pixel, kernel, h)


@njit(cache=True, nogil=True)
def start(
    tables: WordArray,
    fields: NDArray[np.int64],
    count: int,
    direction: Single,
    scale: Single,
    mean: Single,
    turn: Single,
    kernel: Single,
    E: Single,
    h: Single,
) -> None:
    words, points = np.empty(WORDS, np.uint64), np.empty((2, count, 2))
    for pixel in range(len(fields)):
        fill_words(fields[pixel], words)
        errors(tables, words, count, direction, scale, mean, turn, points, E[pixel])
        spread(E[pixel], pixel, kernel, h)


@njit(cache=True)
def _random_fields(key: int, out: NDArray[np.int64]) -> None:
    for k in range(out.size):
        out.ravel()[k] = int(mix32(combine(key, k))) >> 16


def phase_table() -> Single:
    """Return (2, PHASES) parts of exp(-i phase) over a turn."""
    angle = 2.0 * math.pi * np.arange(PHASES) / PHASES
    return np.stack([np.cos(angle), -np.sin(angle)]).astype(np.float32)


def make_tile(count: int, plan: Plan) -> NDArray[np.uint16]:
    """Return the tile for `count` samples as (SIDE^2, FIELDS) fields, see `bluenoise.FIELDS`."""
    tables, series, free = sobol_tables(), make_series(plan), np.array(plan.fields)
    terms = (series.direction, series.scale, series.mean, phase_table())
    fields = np.zeros((SIDE * SIDE, FIELDS), np.int64)
    _random_fields(int(combine(0xB10E, count)), fields)
    fields &= MASKS
    fields[:, np.setdiff1d(np.arange(FIELDS), free)] = 0
    E = np.zeros((SIDE * SIDE, 2, len(series.scale)), np.float32)
    h = np.zeros_like(E)
    start(tables, fields, count, *terms, series.kernel, E, h)
    own = series.kernel[0, REACH, REACH]
    # What random keys have, from the tile of random keys.
    wanted = own_energy(E, own)
    change, keep = 2.0 * wanted / SIDE**2, 0.5
    for k in range(plan.sweeps):
        heat = HOT * (COLD / HOT) ** (k / (plan.sweeps - 1)) * change
        key = int(combine(combine(0x5EED, count), k))
        _sweep(tables, fields, free, MASKS, count, *terms, series.kernel, series.even, keep, heat, key, E, h)
        keep += 0.5 * (1.0 - own_energy(E, own) / wanted)
    return fields.astype(np.uint16)


def own_energy(E: Single, own: Single) -> float:
    return float((np.square(E).sum(axis=1).mean(axis=0, dtype=np.float64) * own).sum()) * len(E)


def main() -> None:
    """Write the data file anew."""
    with ThreadPoolExecutor() as pool:
        tiles = pool.map(lambda count: make_tile(count, PLANS[count]), reversed(LEVELS))
        planes = {f"level_{n}": to_planes(t) for n, t in zip(reversed(LEVELS), tiles, strict=True)}
    np.savez_compressed(DATA, allow_pickle=False, **planes)


if __name__ == "__main__":
    main()
