"""Translations: a grating that a pan moves, seen to move at another speed, backwards, or not at all.

A grating of frequency nu moved by v pixels a frame is a line of its picture at nu in space and -nu v in time, in cycles
per pixel and frame. A shutter open for tau frames leaves |sinc(nu v tau)| of it. Frames are samples in time, and pixels
in space: what is seen is the line's alias, wrapped to half a cycle a frame and half a cycle a pixel along either axis,

    seen speed = wrap(nu v) / |wrap(nu)|    along wrap(nu),

so a grating of 1 / 4 cycle a pixel that moves 3 pixels a frame seems to go back by one. Where wrap(nu) points the other
way than nu, a false grating moves against the true one even if time is not aliased; near a whole number of cycles a
pixel it is coarse, and races.
"""

from dataclasses import asdict, dataclass
from typing import Literal

import numpy as np

from aliasbench.metrics.gate import Signals
from aliasbench.metrics.grating_lines import Lines, all_lines
from aliasbench.metrics.score import Score, rms
from aliasbench.scenes.model import FloatArray

# Below this share of the sharp amplitude a line is not there, and has no speed.
NO_MODULATION = 1e-6
AT_NYQUIST = 1e-6


@dataclass(frozen=True, slots=True)
class LineSpeed:
    """How one line seems to move.

    Attributes
    ----------
    k : int
        Harmonic.
    size : float
        |c_k|, in units of the contrast.
    aliased : bool
        Whether it moves half a cycle a frame or more.
    seen_cycles_per_px : (float, float)
    px_per_frame : float or None
        Along that frequency, above 0 the way of the grating's own; None for a line that is not there.
    sign : int or None
        -1, 0 or 1; None at half a cycle a frame, where there is no direction.
    """

    k: int
    size: float
    aliased: bool
    seen_cycles_per_px: tuple[float, float]
    px_per_frame: float | None = None
    sign: int | None = None


def line_speeds(lines: Lines) -> list[LineSpeed]:
    """Return how each line of two or more frames seems to move, from its advance between neighbouring frames."""
    out = []
    grating = lines.grating
    sharp = 0.5 if grating.amplitudes is None else float(grating.amplitudes.max())
    for k, seen, c in zip(lines.harmonics, lines.seen, np.moveaxis(lines.coefficients, -1, 0), strict=True):
        size = rms(np.abs(c))
        aliased = bool(grating.is_aliased(k))
        place = (float(seen[0]), float(seen[1]))
        if not NO_MODULATION * sharp <= size < np.inf:
            out.append(LineSpeed(int(k), size, aliased, place))
            continue
        phasor = c / size
        turn = -float(np.angle(np.sum(phasor[:, 1:] * np.conj(phasor[:, :-1])))) / (2.0 * np.pi)
        turn *= -1.0 if float(seen @ grating.frequency) < 0.0 else 1.0
        period = 1.0 / float(np.hypot(*seen))
        if 0.5 - abs(turn) < AT_NYQUIST:
            out.append(LineSpeed(int(k), size, aliased, place, -0.5 * period))
            continue
        sign = 0 if abs(turn) < AT_NYQUIST else int(np.sign(turn))
        out.append(LineSpeed(int(k), size, aliased, place, turn * period, sign))
    return out


def backward_share(speeds: list[LineSpeed], cycles_per_frame: float) -> float | None:
    """Return the share of the lines' power that does not seem to move the grating's way (undirected: a half)."""
    shown = [s for s in speeds if s.px_per_frame is not None]
    if cycles_per_frame == 0.0 or not shown:
        return None
    power = np.square(np.array([s.size for s in shown]) / max(s.size for s in shown))
    wrong = [0.5 if s.sign is None else float(s.sign != np.sign(cycles_per_frame)) for s in shown]
    return float(power @ np.array(wrong) / np.sum(power))


def compute_apparent_velocity(signals: Signals) -> Score:
    """Return the speed in px/frame at which a grating seems to move along its frequency vector.

    Of several the first that moves; extras hold all: the true speed, the lines seen, what is left of the sharp
    amplitude (`attenuation`, the pixel filter included) and what the scene's shutter alone leaves
    (`shutter_attenuation`, |sinc(nu v tau)|), and the share that seems to move backwards.
    """
    every = all_lines(signals, "test")
    if not every:
        return Score(None, "not_applicable", {"missing": "gratings of one frequency"})
    shutter = signals.scene.animation.shutter
    extras = []
    values: list[LineSpeed | None] = []
    for lines in every:
        grating, speeds = lines.grating, line_speeds(lines)
        first = speeds[0] if speeds and speeds[0].k == 1 else None
        sharp = None if grating.amplitudes is None else float(grating.amplitudes[0])
        extras.append(
            {
                "cycles_per_px": grating.frequency,
                "cycles_per_frame": grating.cycles_per_frame,
                "true_px_per_frame": grating.cycles_per_frame / grating.length if grating.length else 0.0,
                "aliased": bool(grating.is_aliased(np.array(1.0))),
                "attenuation": first.size / sharp if first is not None and sharp else None,
                "shutter_attenuation": abs(float(np.sinc(grating.cycles_per_frame * shutter))),
                "backward_fraction": backward_share(speeds, grating.cycles_per_frame),
                "lines": [asdict(s) for s in speeds],
            }
        )
        values.append(first)
    chosen = next((i for i, lines in enumerate(every) if lines.grating.cycles_per_frame), 0)
    first = values[chosen]
    if first is None:
        return Score(None, "undefined_no_direction", {"gratings": extras})
    if first.px_per_frame is None:
        return Score(None, "undefined_no_modulation", {"gratings": extras})
    return Score(first.px_per_frame, "ok", {"grating": chosen, "sign": first.sign, "gratings": extras})


def shown_share(lines: Lines) -> tuple[float, dict[str, object]]:
    """Return the visible share (a square) of a moving grating that is aliased in time, and what it was made from.

    A line's power is that of its coefficient at its own temporal frequency, less what noise leaves there: of N frames
    one part in N - 1 of all that the coefficient has at others. Harmonics without a line of their own are taken to be
    attenuated as the last octave of those that have one.
    """
    amplitudes, grating = lines.grating.amplitudes, lines.grating
    assert amplitudes is not None, "the share of a pattern that is known"
    power = line_powers(lines)
    k = np.arange(1, amplitudes.size + 1)
    sharp = amplitudes**2
    total = float(np.sum(sharp))
    own = lines.harmonics.astype(np.int64) - 1
    octave = lines.harmonics > lines.harmonics[-1] / 2
    kept = float(np.clip(np.sum(power[octave]) / np.sum(sharp[own[octave]]), 0.0, 1.0))
    aliased = grating.is_aliased(k)
    rest = np.ones(amplitudes.size, dtype=np.bool_)
    rest[own] = False
    measured = float(np.sum(power[aliased[own]]))
    tail = float(np.sum(sharp[rest & aliased]))
    share = float(np.clip((measured + kept * tail) / total, 0.0, 1.0))
    left = float(np.sum(power)) + kept * float(np.sum(sharp[rest]))
    extras: dict[str, object] = {
        "harmonics": lines.harmonics,
        "measured_share": measured / total,
        "tail_share": tail / total,
        "tail_kept": kept,
        "modulation_kept": float(np.clip(left / total, 0.0, 1.0)),
    }
    return share, extras


def line_powers(lines: Lines) -> FloatArray:
    """Return |c_k|^2 of each line at its known temporal frequency, the noise's share taken off; may be negative."""
    frames = lines.coefficients.shape[1]
    steps = np.outer(np.arange(frames), lines.harmonics * lines.grating.cycles_per_frame)
    mean = np.mean(lines.coefficients * np.exp(2j * np.pi * steps), axis=1)
    power = np.abs(mean) ** 2
    rest = np.mean(np.abs(lines.coefficients) ** 2, axis=1) - power
    out: FloatArray = np.mean(power - rest / max(frames - 1, 1), axis=0)
    return out


def _known_lines(signals: Signals, which: Literal["test", "error"]) -> list[Lines] | Score:
    """Return the lines of the gratings that move, or why there are none to weigh; of the first if nothing moves."""
    every = all_lines(signals, which)
    if not every:
        return Score(None, "not_applicable", {"missing": "gratings of one frequency"})
    moving = [lines for lines in every if lines.grating.cycles_per_frame]
    if not moving and not signals.scene.facts.rotors:
        moving = every[:1]
    for lines in moving:
        if lines.grating.amplitudes is None:
            return Score(None, "not_applicable", {"missing": "a texture of the grating's frequency"})
        if not lines.harmonics.size or lines.harmonics[0] != 1.0:
            return Score(None, "undefined_no_direction", {"cycles_per_px": lines.grating.frequency})
    return moving


def grating_shares(signals: Signals) -> list[tuple[float, dict[str, object]]] | Score:
    """Return the visible aliased share (a square) of each grating that moves, or why there is none."""
    known = _known_lines(signals, "test")
    return known if isinstance(known, Score) else [shown_share(lines) for lines in known]


def grating_errors(signals: Signals) -> list[tuple[float, float]] | Score:
    """Return, for each grating that moves, the RMS of the error's lines per sharp pattern's RMS, and the latter."""
    known = _known_lines(signals, "error")
    if isinstance(known, Score):
        return known
    out = []
    for lines in known:
        amplitudes = lines.grating.amplitudes
        assert amplitudes is not None, "the share of a pattern that is known"
        total = float(np.sqrt(2.0 * np.sum(amplitudes**2)))
        value = rms(np.abs(lines.coefficients)) * float(np.sqrt(2.0 * lines.harmonics.size))
        out.append((value / total, total))
    return out
