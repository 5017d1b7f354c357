"""What a metric is and what it returns, and the two pieces of arithmetic that all of them share.

A score is a number or the reason why there is none: nothing that leaves this package is NaN or infinite, and nothing is
averaged over missing values. Root mean squares are scaled by the largest magnitude, so that radiances of 1e200 neither
overflow nor lose small ones.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from aliasbench.scenes.model import FloatArray

if TYPE_CHECKING:
    from aliasbench.metrics.gate import Signals

Better = Literal["lower", "higher", "zero", "truth"]
Need = Literal["reference", "frames", "seeds", "edges", "rotors", "pans", "gratings", "patterns", "centers"]
NEEDS: Mapping[Need, str] = {
    "reference": "an exact picture to compare with",
    "frames": "two frames or more",
    "seeds": "two seeds or more",
    "edges": "an edge that the scene declares",
    "rotors": "a rotor that the scene declares",
    "pans": "a pan that the scene declares",
    "gratings": "a grating that the scene declares",
    "patterns": "a rotor that the scene declares, or a grating and a pan",
    "centers": "a moving scene, rendered at the shutter's middle too",
}
BLOCK = 1 << 16


@dataclass(frozen=True, slots=True)
class Score:
    """A number, or the reason why there is none.

    Attributes
    ----------
    value : float or None
        Finite, or None.
    status : str
        ``ok``, ``windowed`` (a value, but not of a whole loop), ``deterministic`` (a value without an interval),
        ``extrapolated`` (a value beyond what was measured), or the reason for None: ``identical``, ``nonfinite``,
        ``overflow``, ``undefined_zero_contrast``, ``undefined_one_frame``, ``undefined_one_count``,
        ``undefined_too_small``, ``undefined_no_shimmer``, ``undefined_zero_flux``, ``undefined_no_modulation``,
        ``undefined_no_direction``, ``undefined_uniform_error``, ``undefined_too_few_phases``, ``undefined_no_edge``,
        ``undefined_no_crossing``, ``below_resolution``, ``not_applicable``, ``needs_seeds``, ``edge_leaves_window``,
        ``annulus_leaves_window``, ``out_of_reach``, ``below_reference_floor``, ``not_installed`` (extras say how to).
    extras : mapping
        Further figures and what they depend on; JSON serialisable.
    """

    value: float | None
    status: str = "ok"
    extras: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Metric:
    """One entry of the catalog.

    Attributes
    ----------
    name, label, unit : str
        Key, heading and unit ("contrast" is white minus black as the scene declares it).
    better : {"lower", "higher", "zero", "truth"}
        The direction of improvement; "zero" is signed, "truth" is better the nearer to the scene's own figure.
    needs : tuple of str
        "reference" (it measures error), "frames" and "seeds" (two or more of them), "centers" (further sequences), or
        a fact of the scene; "patterns" are rotors, or gratings that a pan moves.
    compute : callable
        Takes the gated signals, returns the score.
    source : str
        Where the definition comes from.
    """

    name: str
    label: str
    unit: str
    better: Better
    needs: tuple[Need, ...]
    compute: Callable[["Signals"], Score]
    source: str


def rms(values: FloatArray) -> float:
    """Return the root mean square, without overflow for any finite values; 0 for all zeros."""
    largest = max(float(np.max(values)), -float(np.min(values)))
    if largest == 0.0:
        return 0.0
    # Squares and their sum stay within range by far, so that the copy which scaling needs is not made.
    if 1e-100 < largest < 1e100:
        # einsum: a dot product of this length starts threads of its own. In blocks: rounding grows with their length.
        flat = values.ravel()
        blocks = (flat[start : start + BLOCK] for start in range(0, flat.size, BLOCK))
        return math.sqrt(math.fsum(float(np.einsum("i,i->", block, block)) for block in blocks) / flat.size)
    return largest * math.sqrt(float(np.mean(np.square(values / largest))))


def signed_root(square: float) -> float:
    """Return sqrt(square), with the sign of an unbiased estimate of a square that came out negative."""
    return math.copysign(math.sqrt(abs(square)), square)


def settle(value: float, extras: Mapping[str, object], *, floor: float, status: str = "ok") -> Score:
    """Return the score, or `below_reference_floor` when the reference is not good enough to tell it from zero.

    Parameters
    ----------
    value : float
        What was measured.
    extras : mapping
    floor : float
        Three times the error that the reference's uncertainty alone may cause, in the metric's unit.
    status : str
        Of a value that stands.
    """
    if abs(value) < floor:
        return Score(None, "below_reference_floor", {**extras, "floor": floor, "measured": value})
    return Score(value, status, extras)


def sanitize(value: object) -> object:
    """Return plain JSON data: numpy scalars and arrays as numbers and lists, what is not finite as None."""
    if isinstance(value, Mapping):
        return {str(k): sanitize(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [sanitize(v) for v in value]
    if isinstance(value, np.ndarray):
        return sanitize(value.tolist())
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    if value is None or isinstance(value, str):
        return value
    raise TypeError(f"extras cannot hold a {type(value).__name__}")


def finish(score: Score) -> Score:
    """Return the score as it may be stored: finite or None, extras as plain JSON data."""
    extras = {str(k): sanitize(v) for k, v in score.extras.items()}
    if score.value is not None and not math.isfinite(score.value):
        return Score(None, "overflow", extras)
    return Score(None if score.value is None else float(score.value), score.status, extras)
