"""What a technique's pictures are worth: its frames are rendered, kept and measured against the truth.

Every metric is asked, and answers with a value or with the reason why it has none; a picture with a pixel that is not
finite, or a metric that breaks, fails the case, because an average over what is left would look like a result.
"""

import math
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from aliasbench.bench.centers import Further
from aliasbench.bench.suite import Case
from aliasbench.bench.truth import Reference, crop_radius
from aliasbench.renderers.frame import Frame, Prepared


class MetricError(RuntimeError):
    """A metric that broke, or gave what a record cannot hold; the message gives its reason."""


def render_frames(case: Case, prepared: Prepared, on_frame: Callable[[], None]) -> tuple[NDArray[np.float32], Frame]:
    """Return what the metrics see, (seeds, frames, h, w, 3) or (frames, h, w, 3) for one seed, and the first frame."""
    first: Frame | None = None
    seeds = []
    for seed in case.seeds:
        pictures = []
        for number in range(case.frames):
            frame = prepared.render(frame=number, seed=seed)
            first = first or frame
            pictures.append(np.asarray(frame.pixels, dtype=np.float32))
            on_frame()
        seeds.append(np.stack(pictures))
    assert first is not None, "a case has at least one seed and one frame"
    return (seeds[0] if len(seeds) == 1 else np.stack(seeds)), first


def describe_nonfinite(test: NDArray[np.float32]) -> str | None:
    """Return a sentence on the values that are not finite, with the place of the first, or None."""
    bad = ~np.isfinite(test)
    count = int(bad.sum())
    if count == 0:
        return None
    frame, row, column = (int(i) for i in np.argwhere(bad)[0][-4:-1])
    return f"{count} values are not finite, the first in frame {frame} at row {row}, column {column}"


def measure_all(
    case: Case, test: NDArray[np.float32], reference: Reference, further: Further | None = None
) -> dict[str, dict[str, object]]:
    """Return every metric of a case by name: {"value": float or None, "status": str, "extras": {...}}.

    Raises
    ------
    MetricError
        If a metric breaks or returns a value that is not finite.
    """
    from aliasbench.metrics import catalog
    from aliasbench.metrics.gate import Centers

    truth = reference.pixels[: case.frames]
    centers = None
    if further is not None:
        # Of a closed shutter these are the same arrays, which says that nothing is sampled in time.
        at_center = truth if further.reference is reference else further.reference.pixels[: case.frames]
        full = further.full_shutter
        centers = Centers(
            further.test,
            at_center,
            None if full is None else full.pixels[: case.frames],
            further.reference.uncertainty or 0.0,
            0.0 if full is None else full.uncertainty or 0.0,
        )
    try:
        scores = catalog.measure_all(
            case.metrics if case.metrics is not None else catalog.METRICS,
            test,
            truth,
            scene=case.scene,
            filter_radius_px=crop_radius(case.technique),
            reference_uncertainty=reference.uncertainty or 0.0,
            frame_start=0,
            centers=centers,
        )
        return {
            name: {"value": plain(score.value), "status": score.status, "extras": plain(score.extras)}
            for name, score in scores.items()
        }
    except (ArithmeticError, LookupError, RuntimeError, TypeError, ValueError) as error:
        raise MetricError(f"metrics: {type(error).__name__}: {error}") from error


def plain(value: object) -> object:
    """Return a value as JSON can hold it: arrays as lists, numpy's scalars as numbers.

    Raises
    ------
    ValueError
        For a number that is not finite.
    TypeError
        For anything that JSON has no form for.
    """
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        if not math.isfinite(value):
            raise ValueError(f"{value} is not finite")
        return float(value)
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    raise TypeError(f"{type(value).__name__} cannot be kept in a record")
