"""Pictures of signals: what a row of pixels samples, what comes back of it, and how that depends on the sampling rate.

Made for the scenes that are signals, from the very pixels that a run has kept. Plain SVG without script, in the colours
of the page's style sheet: lines and dots of a lecture's figure, which are looked at and not explored.
"""

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np
from numpy.typing import NDArray

from aliasbench.bench.frames import read_image
from aliasbench.metrics.quantisation import quantise
from aliasbench.metrics.reconstruction import KERNELS, reconstruct
from aliasbench.metrics.signals import MARGIN, RatePoint, measure_rates, original_rows
from aliasbench.reports.charts import number
from aliasbench.reports.records import Record
from aliasbench.scenes.errors import InputError, UnsupportedScene
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import FloatArray, Scene

SCENES_DRAWN = ("signals", "nyquist-sweep")
SHOWN_PX = 40  # samples of a row that are drawn
STEPS_PER_PX = 24
WIDTH, LEFT, RIGHT, TOP, BOTTOM = 860.0, 64.0, 14.0, 26.0, 34.0
KERNEL_STYLES: Mapping[str, str] = {
    "box": "k-box",
    "tent": "k-tent",
    "gaussian": "k-gaussian",
    "mitchell": "k-mitchell",
}


@dataclass(frozen=True, slots=True)
class SignalFigure:
    """One drawing: SVG text (safe to embed; empty where there is none), whose samples, and a sentence on it."""

    svg: str
    caption: str
    technique: str = ""


@dataclass(frozen=True, slots=True)
class Plot:
    """Axes of a drawing: their place from the top, and the values at their borders; `log2` for octaves along x."""

    top: float
    height: float
    x_range: tuple[float, float]
    y_range: tuple[float, float]
    log2: bool = False

    def at(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return (n, 2): places in the drawing."""
        low, high = np.log2(self.x_range) if self.log2 else np.asarray(self.x_range)
        share = ((np.log2(x) if self.log2 else x) - low) / (high - low)
        up = (np.clip(y, *self.y_range) - self.y_range[0]) / (self.y_range[1] - self.y_range[0])
        return np.stack([LEFT + share * (WIDTH - LEFT - RIGHT), self.top + (1.0 - up) * self.height], axis=1)

    def line(self, x: FloatArray, y: FloatArray, style: str) -> str:
        """Return a line through points."""
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in self.at(x, y))
        return f'<polyline class="{style}" points="{points}"/>'

    def dots(self, x: FloatArray, y: FloatArray, style: str) -> str:
        """Return a dot at every point."""
        return "".join(f'<circle class="{style}" cx="{a:.1f}" cy="{b:.1f}" r="2.6"/>' for a, b in self.at(x, y))

    def frame(self, title: str, x_ticks: Sequence[float], y_ticks: Sequence[float], x_title: str = "") -> str:
        """Return the axes with their ticks, the title above and to the left."""
        right, bottom = WIDTH - RIGHT, self.top + self.height
        parts = [f'<text class="title" x="{LEFT}" y="{self.top - 8:.1f}">{html.escape(title)}</text>']
        for value in y_ticks:
            y = self.at(np.array([self.x_range[0]]), np.array([value]))[0, 1]
            parts.append(f'<line class="grid" x1="{LEFT}" x2="{right}" y1="{y:.1f}" y2="{y:.1f}"/>')
            parts.append(f'<text class="tick" text-anchor="end" x="{LEFT - 7}" y="{y + 4:.1f}">{value:g}</text>')
        for value in x_ticks:
            x = self.at(np.array([value]), np.array([self.y_range[0]]))[0, 0]
            parts.append(f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{self.top}" y2="{bottom}"/>')
            parts.append(f'<text class="tick" text-anchor="middle" x="{x:.1f}" y="{bottom + 16:.1f}">{value:g}</text>')
        if x_title:
            parts.append(f'<text class="tick" text-anchor="end" x="{right}" y="{bottom + 31:.1f}">{x_title}</text>')
        return "".join(parts)


def draw_records(group: Sequence[Record]) -> list[SignalFigure]:
    """Return the drawings of one scene's records: of each renderer the one with the fewest samples and a picture.

    None of scenes that are no signals, that cannot be built here, or of which no picture was kept. Of pictures too
    small to be drawn only a sentence.
    """
    if group[0].scene.partition(":")[0].strip() not in SCENES_DRAWN:
        return []
    drawn: list[SignalFigure] = []
    for renderer in ("raytrace", "raster"):
        kept = [r for r in group if r.renderer == renderer and r.status == "ok" and "frame" in r.images]
        if not kept:
            continue
        chosen = min(kept, key=lambda r: r.samples or 0)
        try:
            pixels = read_image(chosen.folder / chosen.images["frame"])
            figure = draw_signals(load_scene(chosen.scene), pixels)
        except InputError:
            continue
        if figure is None:
            height, width = pixels.shape[:2]
            figure = SignalFigure("", f"No drawing: {width} x {height} pixels are too few for rows of one wave each.")
        drawn.append(replace(figure, technique=chosen.technique))
    return drawn


def draw_signals(scene: Scene, pixels: NDArray[np.floating]) -> SignalFigure | None:
    """Return the drawing of a picture of signals: of its middle row, or over its rates where it has several.

    Parameters
    ----------
    scene : Scene
        What is in the picture; its exact values are drawn behind the samples.
    pixels : (h, w, 3) float
        Frame 0, linear. The green channel is drawn.

    Returns
    -------
    SignalFigure or None
        None where the picture is too small or the scene's rows are not known.
    """
    if pixels.shape[1] < 4 * MARGIN:
        return None
    try:
        points = measure_rates(scene, pixels)
        if not points and len(scene.textures) > 1:
            return None  # many waves, and no row that shows one of them alone
        return draw_rates(points) if len(points) > 1 else draw_row(scene, pixels)
    except UnsupportedScene:
        return None


def draw_row(scene: Scene, pixels: NDArray[np.floating]) -> SignalFigure:
    """Return the middle of the middle row: original and samples, what four kernels make of them, and 8 bits."""
    height, width = pixels.shape[:2]
    row = height // 2
    shown = min(SHOWN_PX, width - 2 * MARGIN)
    start = (width - shown) // 2
    x = start + (np.arange(shown * STEPS_PER_PX) + 0.5) / STEPS_PER_PX
    truth = original_rows(scene, (width, height), [row], x)[0, :, 1]
    samples = np.asarray(pixels[row, :, 1], dtype=np.float64)
    centres = np.arange(start, start + shown) + 0.5
    taken = samples[start : start + shown]
    span = (float(start), float(start + shown))
    levels = (-0.05, 1.05)
    grey = [0.0, 0.5, 1.0]
    plots = [Plot(TOP + k * 112.0, 76.0, span, levels) for k in range(6)]
    parts = [
        plots[0].frame("original, and its samples", [], grey),
        plots[0].line(x, truth, "s-truth"),
        plots[0].dots(centres, taken, "s-sample"),
    ]
    for plot, name in zip(plots[1:5], KERNELS, strict=True):
        back = reconstruct(samples, x, name)
        error = float(np.sqrt(np.mean((back - truth) ** 2))) / scene.contrast
        parts += [
            plot.frame(f"reconstructed by {name}: RMS difference {number(error)} of the contrast here", [], grey),
            plot.line(x, truth, "s-truth"),
            plot.line(x, back, KERNEL_STYLES[name]),
            plot.dots(centres, taken, "s-sample"),
        ]
    steps = Plot(plots[5].top, 76.0, span, (-2.0, 2.0))
    rounded, dithered = (255.0 * (quantise(samples, 8, d) - samples) for d in ("none", "triangular"))
    parts += [
        steps.frame(
            "error of 8 bits (linear), in steps of 1/255: rounded (line), with triangular dither (dots)",
            list(np.arange(np.ceil(start / 5) * 5, start + shown + 1, 5)),
            [-2, -1, 0, 1, 2],
            "pixels",
        ),
        steps.line(centres, rounded[start : start + shown], "k-mitchell"),
        steps.dots(centres, dithered[start : start + shown], "s-sample"),
    ]
    caption = f"Grey: the exact signal along row {row}. Dots: what the pixels hold. Lines: what is shown of them."
    return SignalFigure(_svg(parts, steps.top + steps.height + BOTTOM, "Original, samples and reconstruction"), caption)


def draw_rates(points: Sequence[RatePoint]) -> SignalFigure:
    """Return frequency, amplitude and error against the sampling rate, of at least two rates."""
    rate = np.array([p.rate for p in points])
    span = (float(rate.min()), float(rate.max()))
    octaves = [2.0**k for k in range(-4, 8) if span[0] * 0.999 <= 2.0**k <= span[1] * 1.001]
    fine = np.geomspace(*span, 400)
    true = np.array([p.cycles_per_px for p in points])
    top = float(true.max())
    frequency = Plot(TOP, 150.0, span, (0.0, max(0.5, top)), log2=True)
    swing = Plot(TOP + 206.0, 90.0, span, (0.0, 1.1), log2=True)
    worst = max(max(p.rmse.values()) for p in points)
    error = Plot(TOP + 352.0, 190.0, span, (0.0, 1.05 * worst), log2=True)
    tops = [v for v in (0.0, 0.25, 0.5, 0.75, 1.0, 2.0, 4.0) if v <= frequency.y_range[1]]
    parts = [
        frequency.frame("frequency [cycles per pixel]: of the original (grey), and recovered (dots)", octaves, tops),
        frequency.line(fine, 1.0 / fine, "s-truth"),
        frequency.dots(rate, np.array([p.recovered for p in points]), "s-sample"),
        swing.frame(
            "amplitude of the samples, least and greatest over the phases (original = 1)", octaves, [0, 0.5, 1]
        ),
        swing.line(rate, np.array([p.amplitude_high for p in points]), "k-tent"),
        swing.line(rate, np.array([p.amplitude_low for p in points]), "k-mitchell"),
        error.frame(
            "RMS difference of reconstruction and original over all phases [contrast]: measured (dots), exact (lines)",
            octaves,
            [v for v in (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7) if v <= 1.05 * worst],
            "samples per cycle",
        ),
    ]
    for place, name in enumerate(KERNELS):
        measured = np.array([p.rmse[name] for p in points])
        exact = [p.expected[name] for p in points if p.expected is not None]
        parts.append(error.line(rate, np.array(exact) if len(exact) == len(points) else measured, KERNEL_STYLES[name]))
        parts.append(error.dots(rate, measured, f"{KERNEL_STYLES[name]} dot"))
        x, y = WIDTH - RIGHT - 92.0, error.top + 18.0 + 18.0 * place
        parts.append(f'<line class="{KERNEL_STYLES[name]}" x1="{x}" x2="{x + 24}" y1="{y - 4}" y2="{y - 4}"/>')
        parts.append(f'<text class="tick" x="{x + 30}" y="{y}">{name}</text>')
    caption = _rates_in_words(points)
    return SignalFigure(_svg(parts, error.top + error.height + BOTTOM, "Sampling rate against error"), caption)


def _rates_in_words(points: Sequence[RatePoint]) -> str:
    """Return from which rate on the frequency is right, what 2 and 4 samples per cycle show, and what 8 bits change."""
    downwards = sorted(points, key=lambda p: p.rate, reverse=True)
    # up to the first that is wrong: below it one may be right by chance
    right = list(takewhile(lambda p: abs(p.recovered - p.cycles_per_px) < 1e-3, downwards))
    lines = []
    if right and len(right) < len(points):
        lines.append(f"The frequency comes back from {number(right[-1].rate)} samples per cycle on.")
    for p in (p for wanted in (2.0, 4.0) for p in points if abs(p.rate - wanted) < 1e-6 * wanted):
        lines.append(
            f"At {number(p.rate)} the amplitude is {p.amplitude_low:.2f} to {p.amplitude_high:.2f} of the original's, "
            f"as the phase falls, and the best kernel is off by {number(min(p.rmse.values()))}."
        )
    change = max(abs(v - p.rmse["mitchell"]) for p in points for v in p.rmse_quantised.values())
    lines.append(f"In 8 bits, with or without dither, Mitchell's differs from the float samples' by {number(change)}.")
    return " ".join(lines)


def _svg(parts: Sequence[str], height: float, label: str) -> str:
    size = f'viewBox="0 0 {WIDTH:g} {height:g}"'
    return f'<svg class="signal" {size} role="img" aria-label="{html.escape(label)}">{"".join(parts)}</svg>'
