"""What a hard case is: a question that a renderer may fail, what must hold, and a verdict with its bound.

A verdict is a figure beside two limits. Up to `rounding` the answer is exact; up to `bound` the case is a known limit,
and `why` derives that bound from the number format or the hardware; beyond it the case has failed. A bound that was
fitted to what was measured would be no bound.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

Outcome = Literal["ok", "limit", "failed"]

TRACER, FAST, PORTABLE = "raytrace:", "raytrace:robust=off", "raytrace:engine=portable"
EGL, OSMESA = "raster:backend=egl", "raster:backend=osmesa"
REFERENCE = "reference:"
HARD_CASE = "hard_case"  # the name of a verdict among a record's metrics
METRICS = "metrics:"  # no renderer: the input is made by hand and goes straight to the metrics
TRACERS = (TRACER, FAST, PORTABLE)
RASTERS = (EGL, OSMESA)
RENDERERS = (*TRACERS, *RASTERS)
ALL = (*RENDERERS, REFERENCE)

LARGEST_STANDARD_ERROR = 1e-3


@dataclass(frozen=True, slots=True)
class Verdict:
    """What was found.

    Attributes
    ----------
    measured : float
        The error, not negative.
    unit : str
        Of it and its bounds: "px", "contrast", "samples", ...
    rounding : float
        Up to here it is what float arithmetic of the output leaves: the case is "ok".
    bound : float
        Up to here it is a known limit.
    why : str
        Where the bounds come from, in one sentence.
    standard_error : float or None
        Of a measured mean; at most 1e-3 of the contrast, or the verdict counts for nothing.
    note : str
        What else is worth knowing: a refusal's own sentence, where the error is, what the other flag does.
    """

    measured: float
    unit: str
    rounding: float
    bound: float
    why: str
    standard_error: float | None = None
    note: str = ""

    @property
    def outcome(self) -> Outcome:
        """Return "ok", "limit" or "failed"; a figure or bound that is not finite, or known too badly, fails."""
        if not (
            math.isfinite(self.measured) and self.measured >= 0.0 and 0.0 <= self.rounding <= self.bound < math.inf
        ):
            return "failed"
        if self.standard_error is not None and not 0.0 <= self.standard_error <= LARGEST_STANDARD_ERROR:
            return "failed"
        if self.measured <= self.rounding:
            return "ok"
        return "limit" if self.measured <= self.bound else "failed"


@dataclass(frozen=True, slots=True)
class HardCase:
    """A question, asked of each of its subjects.

    Attributes
    ----------
    name : str
        Unique; what `--scene` and records call it.
    group : str
        "edges", "shapes", "scale", "motion", "values" or "sizes".
    question : str
        What is hard about it, in one sentence.
    criterion : str
        What must hold, and of which figure.
    check : callable
        Takes a subject's technique text, returns the verdict. `InputError` where refusing is right is the check's own
        to catch and judge; any other exception fails the case.
    subjects : tuple of str
        Technique texts, from `ALL`, or `METRICS`.
    """

    name: str
    group: str
    question: str
    criterion: str
    check: Callable[[str], Verdict]
    subjects: tuple[str, ...] = ALL


def with_keys(subject: str, keys: str) -> str:
    """Return a subject's technique text with further keys: with_keys("raytrace:", "spp=4") is "raytrace:spp=4"."""
    if not keys:
        return subject
    return f"{subject}{keys}" if subject.endswith(":") else f"{subject},{keys}"


def samples_key(subject: str, count: int, more: str = "") -> str:
    """Return a subject's technique text with that many samples a pixel: spp or passes."""
    key = "passes" if subject.startswith("raster") else "spp"
    return with_keys(subject, f"{key}={count}{',' if more else ''}{more}")


def verdict_outcome(case: HardCase, verdict: Verdict) -> dict[str, object]:
    """Return a verdict as a store and its records hold it; a failed one says in `error` by how much."""
    failed = verdict.outcome == "failed"
    measured = verdict.measured if math.isfinite(verdict.measured) else None
    extras = {
        "group": case.group,
        "question": case.question,
        "criterion": case.criterion,
        "unit": verdict.unit,
        "rounding": verdict.rounding,
        "bound": verdict.bound,
        "why": verdict.why,
        "standard_error": verdict.standard_error,
        "note": verdict.note,
    }
    known = "" if verdict.standard_error is None else f" (standard error {verdict.standard_error:.1e})"
    found = f"{verdict.measured:.3g} {verdict.unit}{known}, {verdict.bound:.3g} allowed: {verdict.why}"
    return {
        "status": "failed" if failed else "ok",
        "error": found if failed else None,
        "metrics": {HARD_CASE: {"value": measured, "status": verdict.outcome, "extras": extras}},
    }
