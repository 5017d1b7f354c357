"""Signals planted on a clean sequence: the sequence, and what the definitions say of any error on it.

The clean sequence has facts for every metric and artifacts for none: a smooth rotor, of one angular order, makes one
step of its loop in each frame; a pan of 4 / frames pixels a frame is declared, which the rotor's one temporal frequency
is below; and several parallel edges of slope 1/q are declared, which nothing is drawn along. What is planted is an
error of known root mean square; what each metric must say of it follows from its definition by a closed form, or by an
exact sum over the planted error that shares no code with the metrics.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from aliasbench.scenes.model import Animation, Camera, EdgeFact, Facts, Motion, PanFact, RotorFact, Scene, Surface, Vec3

FloatArray = NDArray[np.float64]
FPS = 30.0
BLADES, DUTY = 3, 0.5
SWING = 0.2  # amplitude of the smooth rotor
LEVEL = 0.5  # its mean
# Rows of the window of an edge of slope 1/q <= 1/2, filter radius 0: 2 (1 + 1 / 2q), and one for where it begins.
WINDOW_ROWS = 4
HIGHEST_VISIBLE = 0.25
DEVIATIONS = 5.0


@dataclass(frozen=True)
class Expected:
    """What a metric must say: a value within a slack, or no value (None); anything if the slack is infinite."""

    value: float | None
    slack: float = 1e-9

    def holds(self, value: float | None) -> bool:
        if value is None or self.value is None:
            return value is self.value or self.slack == math.inf
        return abs(value - self.value) <= self.slack


ANYTHING = Expected(None, math.inf)


@dataclass(frozen=True, eq=False)
class Plant:
    """A planted signal: reference (frames, h, w), error (seeds, frames, h, w), of this RMS, in units of the contrast.

    `expected` holds what is said of it in particular; `Stage.expect` fills in what every error says.
    """

    name: str
    scene: Scene
    reference: FloatArray
    error: FloatArray
    expected: dict[str, Expected] = field(default_factory=dict)

    @property
    def rms(self) -> float:
        return math.sqrt(float(np.mean(self.error**2)))


class Stage:
    """Where signals are planted: a square picture of `side` pixels, a loop of `frames`, edges of slope 1 / `q`."""

    def __init__(self, side: int, frames: int, q: int, contrast: float) -> None:
        assert side % q == 0
        assert side % 4 == 0
        assert 2 < q <= 17
        self.side, self.frames, self.q, self.contrast = side, frames, q, contrast
        self.inner, self.outer = 0.15 * side, 0.45 * side
        rise = side // q
        self.intercepts = np.arange(4, side - rise - 4, 12)
        self.rate = FPS / (BLADES * frames)
        row, column = np.mgrid[:side, :side] + 0.5 - side / 2
        self.angle, self.radius = np.arctan2(-row, column), np.hypot(row, column)
        share = np.clip((self.radius - self.inner) / (self.outer - self.inner), 0.0, 1.0)
        self.weight = np.sin(np.pi * share) ** 4
        self.weight /= self.weight.sum()
        # The highest order that the annulus resolves at a quarter of its width.
        self.highest = min(int(np.pi * (self.inner + (self.outer - self.inner) / 4)), 48 * BLADES)
        self.orders = np.arange(1, self.highest + 1)

    def scene(self, *, rate: float | None = None, edge_px_per_frame: float = 0.0) -> Scene:
        """The scene of the facts; one world unit is one pixel. Edges are carried by objects if they move."""
        half = self.side / 2

        def world(x: float, y: float) -> Vec3:
            return (x - half, half - y, 0.0)

        edges, objects = [], []
        for b in self.intercepts:
            start, end = (world(x, x / self.q + float(b)) for x in (-2.0 * self.side, 3.0 * self.side))
            edges.append(EdgeFact(start, end))
            if edge_px_per_frame:
                outline = np.array([start, end, (end[0], 9.0 * self.side, 0.0), (start[0], 9.0 * self.side, 0.0)])
                motion = Motion((0.0, -edge_px_per_frame * FPS, 0.0))
                objects.append(Surface(outline, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32), motion=motion))
        rotor = RotorFact(
            (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), BLADES, DUTY, self.rate if rate is None else rate, self.inner, self.outer
        )
        pan = PanFact((4.0 / self.frames * FPS, 0.0, 0.0), self.frames / FPS)
        return Scene(
            "planted",
            Camera("orthographic", height=float(self.side)),
            objects=tuple(objects),
            contrast=self.contrast,
            animation=Animation(FPS, self.frames, 0.0),
            facts=Facts(edges=tuple(edges), rotors=(rotor,), pans=(pan,)),
        )

    def clean(self) -> FloatArray:
        """The smooth rotor, (frames, side, side)."""
        turn = 2 * np.pi * np.arange(self.frames) / self.frames
        out: FloatArray = LEVEL + SWING * np.cos(BLADES * self.angle - turn[:, None, None])
        return out

    def everywhere(self, error: FloatArray | float) -> FloatArray:
        """An error broadcast to two equal seeds of all frames, (2, frames, side, side)."""
        shape = (2, self.frames, self.side, self.side)
        return np.array(np.broadcast_to(np.asarray(error, dtype=np.float64), shape))

    # What definitions say, by sums of their own.

    def band_lines(self, error: FloatArray) -> FloatArray:
        """|E|^2 (..., lines) of pictures (..., h, w) at all frequencies of the visible band, both signs."""
        n = self.side
        most = n // 4
        k = np.arange(-most, most + 1)
        wave = np.exp(-2j * np.pi * np.outer(k, np.arange(n)) / n)
        spectrum = np.einsum("ay,...yx,bx->...ab", wave, error, wave, optimize=True) / n**2
        size = np.hypot(k[:, None], k) / n
        out: FloatArray = np.abs(spectrum[..., (size > 0.0) & (size <= HIGHEST_VISIBLE)]) ** 2
        return out

    @property
    def band_bins(self) -> int:
        """How many frequencies, of both signs, the band has."""
        most = self.side // 4
        return sum(0 < i * i + j * j <= most**2 for i in range(-most, most + 1) for j in range(-most, most + 1))

    def moire(self, error: FloatArray) -> dict[str, Expected]:
        """M and P of pictures (frames, h, w), by sums over the band."""
        lines = self.band_lines(error)
        return {
            "moire": Expected(math.sqrt(float(np.mean(np.sum(lines, axis=-1))))),
            "moire_peak": Expected(2 * math.sqrt(float(np.mean(np.max(lines, axis=-1))))),
        }

    def expect(self, plant: Plant) -> dict[str, Expected]:
        """What every metric must say of a plant."""
        a, error, reference = plant.rms, plant.error, plant.reference
        test = reference + error
        dark = reference.min(axis=(1, 2), keepdims=True)
        gaps = (reference > dark + 1 / 8) & (test < dark + 1 / 256)
        silent = Expected(0.0)
        out = {
            "rmse": Expected(a),
            "psnr": Expected(-20 * math.log10(a)),
            "relmse": Expected(float(np.mean(error**2 / (reference**2 + 0.01)))),
            "max_error": Expected(float(np.max(np.abs(error)))),
            "gaps": Expected(float(np.sum(gaps)) / (error.shape[0] * self.frames)),
            "jaggies": silent,
            "jaggies_rms": silent,
            "jaggies_bias": silent,
            "jaggies_str": silent,
            "shimmer": silent,
            "shimmer_abs": silent,
            "buzz": Expected(None),
            "flux_flicker": silent,
            "moire": silent,
            "moire_peak": silent,
            # the sum over the annulus' pixels passes that much of a constant
            "strobing": Expected(0.0, 1e-4),
            "strobing_err": Expected(0.0, 1e-4),
            "apparent_rate": Expected(self.rate, 1e-6),
            # equal seeds
            "noise": silent,
            "structure": Expected(a),
            "bias": silent,
        }
        unknown = plant.expected.keys() - out.keys()
        assert not unknown, unknown
        return out | plant.expected
