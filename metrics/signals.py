"""A row of pixels as a sampled signal: the original it was taken from, and what comes back at each sampling rate.

The original is no picture of more samples but the scene itself, evaluated along the row wherever it is asked for; so a
reconstruction is compared with the truth at the same points, between the pixels too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aliasbench.metrics.quantisation import Dither, quantise
from aliasbench.metrics.reconstruction import KERNELS, expected_rmse, interval_nodes, reconstruct
from aliasbench.metrics.spectral_line import Line, aliased_frequency, recover_frequency
from aliasbench.scenes.errors import InputError, UnsupportedScene
from aliasbench.scenes.model import FloatArray, Grating, ImageTexture, Scene, Surface
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import view_at
from aliasbench.scenes.textures import evaluate_point

# Pixels at both ends of a row whose reconstruction lacks samples: the widest kernel's radius and a half, rounded up.
MARGIN = 5
# A wave of less than this share of the contrast is rounding: the rasterizer interpolates in float32.
LEAST_SHARE = 1e-3
MOST_ROWS = 32  # of one rate that are measured: without noise a band's are all the same
DITHERS: tuple[Dither, ...] = ("none", "triangular")
STEP = 1.0 / 255.0  # of 8 bits; a wave of less is no wave
_TORN = 1e-3  # pixels between a row's middle and a border, below which the row belongs to neither side
_FLAT = ("unlit", "diffuse")  # materials of one radiance in all directions where there are no lights
_CLOSE = 1e-9  # of depths: as near as this, the later surface wins


def original_rows(
    scene: Scene, size: tuple[int, int], rows: Sequence[int], x_px: FloatArray, frame: int = 0
) -> FloatArray:
    """Return (r, m, 3) float64: the scene's own radiance at points along the middles of some rows of pixels.

    Parameters
    ----------
    scene : Scene
        Unlit, or diffuse without lights, which is the same; seen through a pinhole or orthographically.
    size : (width, height)
        Of the picture, pixels.
    rows : sequence of int
        0 at the top.
    x_px : (m,) float
        From the picture's left border; pixel j has its centre at j + 0.5. May lie outside of the picture.
    frame : int
        The instant at which its shutter opens.

    Raises
    ------
    UnsupportedScene
        If the scene has lights, glossy or other materials that mirror or refract, or a lens.
    InputError
        If the picture has no such row.
    """
    for row in rows:
        if not 0 <= row < size[1]:
            raise InputError(f"row = {row}: must be a row of the picture, 0 to {size[1] - 1}")
    if scene.lights or scene.camera.lens_radius or any(s.material.kind not in _FLAT for s in scene.objects):
        raise UnsupportedScene("the signal along a row is known of unlit scenes without lights and lens only")
    view = view_at(scene.camera, scene.animation, frame, 0.0, size)
    x = np.asarray(x_px, dtype=np.float64)
    faces = [(surface, triangle) for surface in scene.objects for triangle in surface.triangles]
    corners = np.concatenate([np.empty((0, 3, 3)), *(_corners(s, scene, frame) for s in scene.objects)])
    # Under perspective a corner behind the eye is seen nowhere: every face is tried there.
    everywhere = np.tile([-np.inf, np.inf], (len(faces), 1))
    heights = everywhere if view.perspective else view.project(corners)[..., 1]
    low, high = heights.min(axis=1), heights.max(axis=1)
    out = np.empty((len(rows), len(x), 3))
    for color, row in zip(out, rows, strict=True):
        y = row + 0.5
        color[:] = scene.background
        nearest = np.full(len(x), np.inf)
        origins, directions = (np.broadcast_to(a, (len(x), 3)) for a in view.ray(x, np.full(len(x), y)))
        for index in np.flatnonzero((low <= y) & (y <= high)):
            depth, shares, hit = _meet(corners[index], origins, directions)
            hit &= (depth > (0.0 if view.perspective else -np.inf)) & (depth <= nearest + _CLOSE * np.abs(nearest))
            rgba, kept = _shade(scene, *faces[index], shares[hit])
            hit[hit] = kept
            color[hit], nearest[hit] = rgba[kept, :3], np.minimum(nearest, depth)[hit]
    return out


def _corners(surface: Surface, scene: Scene, frame: int) -> FloatArray:
    """Return a surface's triangles (t, 3, 3) in the world when a frame's shutter opens."""
    matrix = object_matrix(surface.motion, scene.animation, frame, 0.0)
    placed: FloatArray = (surface.vertices @ matrix[:3, :3].T + matrix[:3, 3])[surface.triangles]
    return placed


def _meet(
    corners: FloatArray, origins: FloatArray, directions: FloatArray
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Return depths (m,), shares of the corners (m, 3) and which rays meet the triangle (3, 3), borders included."""
    a, u, v = corners[0], corners[1] - corners[0], corners[2] - corners[0]
    normal = np.cross(u, v)
    area = float(normal @ normal)
    toward = directions @ normal
    front = toward != 0.0
    depth = np.where(front, ((a - origins) @ normal) / np.where(front, toward, 1.0), np.inf)
    w = origins + np.where(front, depth, 0.0)[:, None] * directions - a
    second, third = np.cross(w, v) @ normal / area, np.cross(u, w) @ normal / area
    shares = np.stack([1.0 - second - third, second, third], axis=1)
    return depth, shares, front & (shares >= -1e-12).all(axis=1)


def _shade(
    scene: Scene, surface: Surface, triangle: NDArray[np.int32], shares: FloatArray
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return RGBA (m, 4) at points of a triangle, and where the surface is not cut out."""
    tint = np.array([*surface.color, 1.0])
    if surface.texture is None or surface.uv is None:
        return np.tile(tint, (len(shares), 1)), np.ones(len(shares), dtype=np.bool_)
    texture = scene.textures[surface.texture]
    rgba = evaluate_point(texture, shares @ surface.uv[triangle])
    cutoff = texture.alpha_cutoff if isinstance(texture, ImageTexture) else None
    return tint * rgba, rgba[:, 3] >= (-np.inf if cutoff is None else cutoff)


@dataclass(frozen=True, slots=True)
class RatePoint:
    """What became of one frequency of a picture, over all of its rows (that is, over their phases).

    Attributes
    ----------
    rate : float
        Samples per cycle, 1 / `cycles_per_px`.
    cycles_per_px, predicted, recovered : float
        Frequency of the original, its alias by the sampling theorem, and what the samples have.
    amplitude_low, amplitude_high : float
        Least and greatest amplitude of the recovered wave over the rows, in amplitudes of the original.
    rmse : mapping of kernel to float
        RMS difference of reconstruction and original over position and rows, in contrast.
    expected : mapping of kernel to float or None
        The same of a sinusoid over all phases in closed form; None of other profiles.
    rmse_quantised, recovered_quantised : mapping of dither to float
        Of the same samples in 8 linear bits: RMS difference of Mitchell's reconstruction and original, and frequency.
    """

    rate: float
    cycles_per_px: float
    predicted: float
    recovered: float
    amplitude_low: float
    amplitude_high: float
    rmse: Mapping[str, float]
    expected: Mapping[str, float] | None
    rmse_quantised: Mapping[str, float]
    recovered_quantised: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Band:
    """A surface that some rows of pixels show in their middle: its grating, and the grating's cycles per pixel."""

    rows: tuple[int, ...]
    grating: Grating
    cycles_per_px: float


def grating_bands(scene: Scene, size: tuple[int, int]) -> tuple[Band, ...]:
    """Return the bands of a picture that show gratings along x, from the top; none where the picture moves.

    Only of orthographic scenes made of upright rectangles, of which the later ones hide the earlier. Rows whose middle
    is on a border are in no band: which of the two a renderer shows there is anyone's guess.
    """
    view = view_at(scene.camera, scene.animation, 0, 0.0, size)
    if view.perspective or not scene.is_static:
        return ()
    shown = [-1] * size[1]
    torn: set[int] = set()
    waves: dict[int, tuple[Grating, float]] = {}
    for number, surface in enumerate(scene.objects):
        outline = view.project(surface.vertices)[:, :2]
        (left, top), (right, bottom) = outline.min(axis=0), outline.max(axis=0)
        if not left <= size[0] / 2 <= right:
            continue
        for row in range(max(int(np.ceil(top - 0.5)), 0), min(int(np.ceil(bottom - 0.5)), size[1])):
            shown[row] = number
        torn.update(round(y - 0.5) for y in (top, bottom) if abs(y - 0.5 - round(y - 0.5)) < _TORN)
        grating = None if surface.texture is None else scene.textures[surface.texture]
        if isinstance(grating, Grating) and surface.uv is not None:
            at, uv = (a[surface.triangles[0]] for a in (outline, surface.uv))
            angle = np.radians(grating.angle_deg)
            per_px = np.linalg.solve(at[1:] - at[0], uv[1:] - uv[0]) @ np.array([np.cos(angle), np.sin(angle)])
            across, down = (float(grating.cycles * change) for change in per_px)
            if abs(down) <= 1e-9 * abs(across):
                waves[number] = (grating, abs(across))
    rows = {n: tuple(row for row, other in enumerate(shown) if other == n and row not in torn) for n in waves}
    return tuple(Band(rows[number], *waves[number]) for number in sorted(waves, key=lambda n: rows[n]) if rows[number])


def measure_rates(scene: Scene, pixels: NDArray[np.floating]) -> tuple[RatePoint, ...]:
    """Return what became of each frequency of a picture of gratings, the lowest sampling rate first.

    Of each rate some 32 rows at most, evenly spread, are measured, and one of every phase at least.

    Parameters
    ----------
    scene : Scene
        Orthographic and still, with gratings along x: `signals` and `nyquist-sweep`, or one like them.
    pixels : (h, w, 3) float
        A rendering of its frame 0, linear. Rows that show no grating are left out; the green channel is measured.

    Raises
    ------
    InputError
        If the picture is less than 20 pixels wide: the reconstruction lacks samples at 5 of them at either end.
    """
    height, width = pixels.shape[:2]
    if width < 4 * MARGIN:
        raise InputError(f"a picture {width} pixels wide: at least {4 * MARGIN} are needed for a reconstruction")
    groups: dict[tuple[float, Grating], list[Band]] = {}
    for band in grating_bands(scene, (width, height)):
        # phases of one wave belong together
        groups.setdefault((band.cycles_per_px, replace(band.grating, phase=0.0)), []).append(band)
    green = np.asarray(pixels[..., 1], dtype=np.float64)
    return tuple(sorted((_measure_rate(scene, green, bands) for bands in groups.values()), key=lambda p: p.rate))


def _measure_rate(scene: Scene, green: FloatArray, bands: Sequence[Band]) -> RatePoint:
    height, width = green.shape
    cycles, grating = bands[0].cycles_per_px, bands[0].grating
    offsets, weights = interval_nodes(4 + int(2.0 * cycles))
    x = (np.arange(MARGIN, width - MARGIN)[:, None] + offsets).ravel()
    share = np.tile(weights, width - 2 * MARGIN) / (width - 2 * MARGIN)
    most = max(1, MOST_ROWS // len(bands))
    rows = [band.rows[:: -(-len(band.rows) // most)] for band in bands]
    samples = green[np.concatenate(rows)]
    # bands are the same all the way down
    each = original_rows(scene, (width, height), [band.rows[0] for band in bands], x)[..., 1]
    truth = np.repeat(each, [len(own) for own in rows], axis=0)
    swing = abs(grating.high[1] - grating.low[1])

    def rmse(values: FloatArray, kernel: str) -> float:
        square = (reconstruct(values, x, kernel) - truth) ** 2
        return float(np.sqrt(np.mean(square @ share))) / scene.contrast

    def frequency(values: FloatArray, least: float) -> Line:
        return recover_frequency(values, least_amplitude=max(LEAST_SHARE * swing, least))

    stored = {dither: quantise(samples, 8, dither) for dither in DITHERS}
    line = frequency(samples, 0.0)
    amplitudes = line.amplitudes / (swing / 2.0) if swing else line.amplitudes
    closed = {name: expected_rmse(cycles, name, amplitude=swing / 2.0) / scene.contrast for name in KERNELS}
    return RatePoint(
        rate=1.0 / cycles,
        cycles_per_px=cycles,
        predicted=float(aliased_frequency(cycles)),
        recovered=line.cycles_per_px,
        amplitude_low=float(amplitudes.min()),
        amplitude_high=float(amplitudes.max()),
        rmse={name: rmse(samples, name) for name in KERNELS},
        expected=closed if grating.profile == "sine" else None,
        rmse_quantised={dither: rmse(values, "mitchell") for dither, values in stored.items()},
        recovered_quantised={d: frequency(values, STEP).cycles_per_px for d, values in stored.items()},
    )
