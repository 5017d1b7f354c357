"""Motion within the shutter at its extremes: half turns and hundreds of turns, and a camera that passes an object."""

import math
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from aliasbench.bench.hard import periodic, stillness
from aliasbench.bench.hard.case import REFERENCE, TRACERS, HardCase, Verdict, samples_key, with_keys
from aliasbench.bench.hard.passing import (
    BLADE,
    COMB,
    FPS,
    IDENTITY,
    OPEN,
    PINHOLE,
    PINHOLE_REACH,
    SIZE,
    Z,
    find_misses,
    judge_places,
    judge_reference,
    middles,
    one_polygon,
    seeds_error,
    spin_about,
    turned,
)
from aliasbench.renderers.catalog import prepare, render
from aliasbench.scenes.model import Camera, FloatArray, Motion, Vec3

AXES: tuple[Vec3, ...] = (Z, (0.0, 1.0, 0.0), (2.0, 1.0, 0.0))  # no pixel centre lies on them
FRAMES = (0, 7)
FAR = 40.0  # px, past the picture's corners from its middle


def _mesh(size: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
    """Return the nearest corner to the picture's middle of every pixel, (h, w) along x and y, 0 or more."""
    x, y = np.arange(size[0]) - size[0] // 2, np.arange(size[1]) - size[1] // 2
    columns, rows = np.meshgrid(np.where(x < 0, -x - 1, x), np.where(y < 0, -y - 1, y))
    return columns.astype(np.float64), rows.astype(np.float64)


def _half_turn(subject: str) -> Verdict:
    """Half a turn while the shutter is open."""
    if subject == REFERENCE:
        # The half-plane y > 0 is at an angle theta for |theta| / pi of the time: harmonic but on y = 0, so rules of 20
        # points see no kink; of the pixels at the hub the mean is 1/4 and 3/4 by symmetry.
        frame = render(one_polygon([(-99, 0), (99, 0), (99, 99), (-99, 99)], spin_about(FPS / 2)), subject, size=SIZE)
        nodes, weights = np.polynomial.legendre.leggauss(20)
        y, x = np.meshgrid(
            np.arange(SIZE[1]) + 0.5 - SIZE[1] / 2, np.arange(SIZE[0]) + 0.5 - SIZE[0] / 2, indexing="ij"
        )
        angle = np.arctan2(np.abs(y[..., None, None] + nodes[:, None] / 2), x[..., None, None] + nodes / 2)
        expected = (angle * weights[:, None] * weights).sum(axis=(2, 3)) / 4 / np.pi
        i, j = SIZE[1] // 2, SIZE[0] // 2
        expected[i - 1 : i + 1, j - 1 : j + 1] = (0.75, 0.25)
        return judge_reference(frame, expected, "|theta| / pi")
    times = middles(65)
    outlines, misses = [turned(COMB, u / 2) for u in times], []
    for camera in (None, PINHOLE):
        scene = one_polygon(COMB, spin_about(FPS / 2), camera=camera)
        pixels = render(scene, samples_key(subject, 65, "sampler=center"), size=SIZE).pixels
        misses.append(find_misses(pixels, SIZE, outlines))
    return judge_places(subject, misses, PINHOLE_REACH)


def _between(axis: Vec3, share: float) -> FloatArray:
    """Return (2, 2): (1 - u) + u times the half turn about an axis, at 1 - 2 u = share, seen along z."""
    unit = np.array(axis) / np.linalg.norm(axis)
    along = np.outer(unit, unit)
    out: FloatArray = (along + share * (np.eye(3) - along))[:2, :2]
    return out


def _two_matrices(axis: Vec3) -> Motion:
    unit = np.array(axis) / np.linalg.norm(axis)
    end = np.eye(4)
    end[:3, :3] = 2.0 * np.outer(unit, unit) - np.eye(3)
    return Motion(matrices=(IDENTITY, tuple(end.ravel().tolist())))


def _half_turn_matrix(subject: str) -> Verdict:
    """Half a turn, interpolated between matrices."""
    if subject == REFERENCE:
        square = np.array([(-8.0, -8.0), (8.0, -8.0), (8.0, 8.0), (-8.0, 8.0)])
        frame = render(one_polygon(square, spin_about(FPS / 2)), "reference:motion=matrix", size=SIZE)
        x, y = _mesh(SIZE)
        # |1 - 2 u| 8 > max(|x|, |y|); on the diagonal max has the mean corner + 2/3
        far = np.where(x == y, x + 2 / 3, np.maximum(x, y) + 0.5)
        return judge_reference(frame, np.maximum(0.0, 1.0 - far / 8.0), "1 - max(|x|, |y|) / 8")
    times, misses = middles(33), []
    for axis in AXES:
        for motion, keys in ((spin_about(FPS / 2, axis), ",motion=matrix"), (_two_matrices(axis), "")):
            with prepare(
                one_polygon(COMB, motion), samples_key(subject, 33, f"sampler=center{keys}"), size=SIZE
            ) as ready:
                for number in FRAMES if keys else FRAMES[:1]:
                    sign = -1 if number % 2 and keys else 1
                    parts = [_between(axis, float(1 - 2 * u)) for u in times]
                    if sign < 0:
                        parts = [p @ _between(axis, -1.0) for p in parts]
                    pixels = ready.render(frame=number).pixels
                    outlines = [COMB @ p.T if abs(u * 2 - 1) else None for u, p in zip(times, parts, strict=True)]
                    misses.append(find_misses(pixels, SIZE, outlines))
    return judge_places(subject, misses, 32.0)


def _collapse(subject: str) -> Verdict:
    """The middle of a half turn by matrices."""
    shown = []
    for axis in AXES:
        for motion, keys in (
            (spin_about(FPS / 2, axis), "time=center,motion=matrix"),
            (_two_matrices(axis), "time=center"),
        ):
            with prepare(one_polygon(BLADE, motion), with_keys(subject, keys), size=SIZE) as ready:
                shown += [ready.render(frame=frame).pixels for frame in FRAMES]
    # what is left of areas is 1e-16 of their sides
    lit = float(np.count_nonzero(np.abs(shown).max(axis=-1) > 1e-9)) if np.isfinite(shown).all() else math.inf
    return Verdict(
        lit, "pixels", 0.0, 0.0, "a polygon squeezed onto a line has no area, and no sample lies on the line"
    )


def _hundred_turns(subject: str) -> Verdict:
    """A wedge of a quarter turn, or a comb, goes round a hundred times."""
    if subject == REFERENCE:
        wedge = np.array([(0.0, 0.0), (2 * FAR, -2 * FAR), (2 * FAR, 2 * FAR)])
        scene = one_polygon(wedge, spin_about(100 * FPS))
        return judge_reference(render(scene, subject, size=SIZE), np.full(SIZE[::-1], 0.25), "1/4")
    times = middles(101)  # 101 and 100 have no common factor: as many different angles
    scene = one_polygon(COMB, spin_about(100 * FPS))
    pixels = render(scene, samples_key(subject, 101, "sampler=center"), size=SIZE).pixels
    return judge_places(subject, [find_misses(pixels, SIZE, [turned(COMB, 100 * u) for u in times])], 32.0)


def _hundred_turns_mean(subject: str) -> Verdict:
    """The same wedge by stratified times: the mean is a quarter."""
    size, count, seeds = (16, 16), 64, 32
    wedge = np.array([(0.0, 0.0), (FAR, -FAR), (FAR, FAR)])
    scene = one_polygon(wedge, spin_about(100 * FPS), camera=Camera("orthographic", height=float(size[1])))
    rows, columns = np.indices(size) - 7.5
    disc = np.hypot(rows, columns) < 8.0
    if subject == REFERENCE:
        frame = render(scene, subject, size=size)
        return judge_reference(replace(frame, pixels=frame.pixels[disc]), np.full(int(disc.sum()), 0.25), "1/4")
    with prepare(scene, samples_key(subject, count), size=size) as ready:
        means = [float(ready.render(seed=seed).pixels[disc].mean(dtype=np.float64)) for seed in range(seeds)]
    error, allowed = seeds_error(means)
    why = f"chance alone (Student's t of {seeds} seeds, once in 10 000): nothing is biased"
    return Verdict(abs(float(np.mean(means)) - 0.25), "contrast", allowed, allowed, why, standard_error=error)


def _fly_through(subject: str) -> Verdict:
    """The camera passes a square while the shutter is open."""
    size, focal, half, start = (24, 24), 12.0, 2.5, 5.0
    camera = Camera("perspective", position=(0.0, 0.0, start), fov_y_deg=90.0, velocity=(0.0, 0.0, -2 * start * FPS))
    square = half * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    if subject == REFERENCE:
        scene = one_polygon(square, Motion(), OPEN, camera)
        # at distance z a pixel sees the square while max(|x|, |y|) z < 12 x 2.5, z over (0, 5) half of the time
        x, y = _mesh(size)
        near, reach = np.maximum(x, y), focal * half
        log = np.log1p(1.0 / np.maximum(near, 1.0))
        mean = reach * np.where(x == y, 2 * (1.0 - near * log), log)
        expected = np.where(near < reach / start, start, mean) / (2 * start)
        return judge_reference(render(scene, subject, size=size), expected, "min(5, 30 / max(|x|, |y|)) / 10")
    times = [float(u) for u in middles(256)]
    depths = [start * (1.0 - 2.0 * u) for u in times]
    leaning = turned(square, Fraction(1, 50))  # its edges pass centres at all distances
    outlines = [leaning * focal / z if z > 0.0 else None for z in depths]
    scene = one_polygon(leaning, Motion(), OPEN, camera)
    pixels = render(scene, samples_key(subject, 256, "sampler=center"), size=size).pixels
    # of `PINHOLE_REACH`'s kind: corners are at most sqrt 2 times as far as their edges, and pixels 45 degrees off
    reach = math.sqrt(2.0) * focal * (1.0 + 2.0 * (size[0] / 2.0 / focal) ** 2)
    return judge_places(subject, [find_misses(pixels, size, outlines)], reach)


def _adaptive(subject: str) -> Verdict:
    """A bar passes every pixel for a tenth of the shutter."""
    size, seeds = (32, 32), 24
    bar = np.array([(-22.0, -99.0), (-18.0, -99.0), (-18.0, 99.0), (-22.0, 99.0)])
    scene = one_polygon(bar, Motion(velocity=(40.0 * FPS, 0.0, 0.0)), camera=Camera("orthographic", height=32.0))
    if subject == REFERENCE:
        return judge_reference(render(scene, subject, size=size), np.full(size, 0.1), "1/10")
    text = with_keys(subject, "adaptive=unbiased,tolerance=0.04,min_spp=8,max_spp=64")
    means, counts = [], []
    with prepare(scene, text, size=size) as ready:
        for seed in range(seeds):
            frame = ready.render(seed=seed)
            means.append(float(frame.pixels.mean(dtype=np.float64)))
            counts.append(frame.sample_counts)
    error, allowed = seeds_error(means)
    spread = _spread(counts)
    why = f"chance alone (Student's t of {seeds} seeds, once in 10 000): the estimate is unbiased"
    note = f"{spread[0]} to {spread[1]} samples a pixel"
    measured = abs(float(np.mean(means)) - 0.1) if spread[0] < spread[1] else math.inf
    return Verdict(measured, "contrast", allowed, allowed, why, standard_error=error, note=note)


def _spread(counts: Sequence[NDArray[np.integer] | None]) -> tuple[int, int]:
    given = [c for c in counts if c is not None]
    return (min(int(c.min()) for c in given), max(int(c.max()) for c in given)) if given else (0, 0)


_PLACE = "Every sample sees the body where it is at its own time (float64 truth); the reference equals {}."

CASES = (
    *periodic.CASES,
    *stillness.CASES,
    HardCase(
        "half-turn",
        "motion",
        "A comb turns by exactly 180 degrees while the shutter is open, under parallel rays and before a pinhole.",
        _PLACE.format("|theta| / pi for a half-plane"),
        _half_turn,
    ),
    HardCase(
        "half-turn-matrix",
        "motion",
        "Half a turn as two matrices, interpolated: at x (1 - 2 u) about the axis, singular in the middle.",
        _PLACE.format("1 - max(|x|, |y|) / a for a square"),
        _half_turn_matrix,
    ),
    HardCase(
        "half-turn-collapse",
        "motion",
        "The middle of half a turn between two matrices: all bodies are squeezed onto the axis.",
        "Nothing is seen, and every pixel is finite.",
        _collapse,
    ),
    HardCase(
        "hundred-turns",
        "motion",
        "A wedge of a quarter circle, to samples a comb, turns 100 times while the shutter is open.",
        _PLACE.format("1/4 everywhere"),
        _hundred_turns,
    ),
    HardCase(
        "hundred-turns-mean",
        "motion",
        "The same wedge, sampled at stratified random times, fewer than one a turn.",
        "The mean over a disc and 32 seeds is 1/4; the reference's pixels are.",
        _hundred_turns_mean,
    ),
    HardCase(
        "fly-through",
        "motion",
        "The camera passes through a square while the shutter is open.",
        _PLACE.format("min(5, 30 / max(|x|, |y|)) / 10"),
        _fly_through,
    ),
    HardCase(
        "adaptive-motion",
        "motion",
        "Adaptive sampling of a bar that passes every pixel in a tenth of the shutter.",
        "The mean is 1/10, with different numbers of samples in different pixels; the reference's pixels are. Only "
        "tracers are adaptive.",
        _adaptive,
        (*TRACERS, REFERENCE),
    ),
)
