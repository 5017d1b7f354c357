"""Every metric by name, and the one way to measure: gate, facts, definition, score."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from aliasbench.metrics.entries import METRICS as METRICS
from aliasbench.metrics.entries import OPTIONAL as OPTIONAL
from aliasbench.metrics.gate import Centers, Signals, open_gate
from aliasbench.metrics.score import Metric, Score, finish
from aliasbench.scenes.errors import unknown_name
from aliasbench.scenes.model import Scene


def find_metric(name: str) -> Metric:
    """Return the metric of a name.

    Raises
    ------
    InputError
        For an unknown name, with the nearest match.
    """
    if name in OPTIONAL:
        return OPTIONAL[name]
    if name not in METRICS:
        raise unknown_name("metric", name, (*METRICS, *OPTIONAL))
    return METRICS[name]


def measure(
    name: str,
    test: NDArray[np.floating],
    reference: NDArray[np.floating],
    *,
    scene: Scene,
    filter_radius_px: float = 0.5,
    reference_uncertainty: float = 0.0,
    frame_start: int = 0,
    centers: Centers | None = None,
) -> Score:
    """Return one metric's score of a sequence; never NaN or infinite.

    Parameters
    ----------
    name : str
        A key of `METRICS` or `OPTIONAL`.
    test : (frames, h, w, 3) or (seeds, frames, h, w, 3) floating
        Linear radiance.
    reference : (frames, h, w, 3) floating
        Linear radiance, exact, with the same filter and shutter.
    scene : Scene
        Its contrast, facts, camera and animation are used.
    filter_radius_px : float
        Half-width of the pixel filter; ceil of it pixels are cut off on every side.
    reference_uncertainty : float
        Bound on the reference's pixel error, in radiance; a score below three times what it may cause is
        `below_reference_floor`.
    frame_start : int
        The scene's number of the first frame.
    centers : Centers, optional
        What `spatial`, `temporal` and `shutter` compare; where the shutter is not open, with test and reference
        themselves in it.

    Raises
    ------
    InputError
        For an unknown name.
    ValueError
        For arrays that no renderer of the suite may produce (see `gate.open_gate`).
    """
    return measure_all(
        (name,),
        test,
        reference,
        scene=scene,
        filter_radius_px=filter_radius_px,
        reference_uncertainty=reference_uncertainty,
        frame_start=frame_start,
        centers=centers,
    )[name]


def measure_all(
    names: Iterable[str],
    test: NDArray[np.floating],
    reference: NDArray[np.floating],
    *,
    scene: Scene,
    filter_radius_px: float = 0.5,
    reference_uncertainty: float = 0.0,
    frame_start: int = 0,
    centers: Centers | None = None,
) -> dict[str, Score]:
    """Return several metrics' scores, passing the gate once; arguments and errors as of `measure`."""
    metrics = [find_metric(name) for name in names]
    gated = open_gate(
        test,
        reference,
        scene=scene,
        filter_radius_px=filter_radius_px,
        reference_uncertainty=reference_uncertainty,
        frame_start=frame_start,
        centers=centers,
    )
    if isinstance(gated, Score):
        return {m.name: finish(gated) for m in metrics}
    return {m.name: _score(m, gated) for m in metrics}


def _score(metric: Metric, signals: Signals) -> Score:
    facts = signals.scene.facts
    patterns = facts.rotors or (facts.gratings and facts.pans)
    known = {"edges": facts.edges, "rotors": facts.rotors, "pans": facts.pans, "gratings": facts.gratings}
    for fact, given in {**known, "patterns": patterns}.items():
        if fact in metric.needs and not given:
            return Score(None, "not_applicable", {"missing": fact})
    if "centers" in metric.needs and signals.centers is None:
        return Score(None, "not_applicable", {"missing": "centers"})
    if "centers" in metric.needs and isinstance(signals.centers, Score):
        return finish(signals.centers)
    if "frames" in metric.needs and signals.frames < 2:
        return Score(None, "undefined_one_frame", {"frames": signals.frames})
    if "seeds" in metric.needs and signals.seeds < 2:
        return Score(None, "needs_seeds", {"seeds": signals.seeds, "needs": 2})
    # Radiances near the largest float overflow when squared; `finish` turns what comes of it into a status.
    with np.errstate(all="ignore"):
        try:
            return finish(metric.compute(signals))
        except OverflowError:
            return Score(None, "overflow")
