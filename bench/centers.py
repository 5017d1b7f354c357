"""Which truths a case needs: its own, and of a scene that moves those which tell errors in space from errors in time.

A shutter is sampled by the technique and known exactly by its reference; at the shutter's middle alone, with
`time=center`, both see an instant, and what is wrong there is wrong in space (see `metrics.separation`). Nothing is
rendered twice: a shutter that is closed shows instants anyway, and so does a technique of one sample in the middle.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aliasbench.bench.suite import Case
from aliasbench.bench.truth import Reference, reference_technique
from aliasbench.renderers.technique import Technique, parse_technique
from aliasbench.scenes.model import Scene

# Those that compare further sequences.
METRICS = ("spatial", "temporal", "shutter")
# An exact picture of a frame-long shutter may cost a hundred times as much as one of an instant, and all frames of a
# sequence have much the same: the first ones are rendered until there are so many pixels.
FULL_SHUTTER_PIXELS = 2**16


@dataclass(frozen=True, slots=True)
class Truth:
    """A sequence of true pictures.

    Attributes
    ----------
    name : str
        What it is called while it is rendered; unique among those of a scene and size.
    scene : Scene
        The case's, or with another shutter.
    technique : Technique
    frames : int
        How many of its first frames are needed.
    """

    name: str
    scene: Scene
    technique: Technique
    frames: int


@dataclass(frozen=True, slots=True, eq=False)
class Further:
    """What a case is measured with besides its own frames and truth.

    Attributes
    ----------
    test : (frames, h, w, 3) or (seeds, frames, h, w, 3) float32
        The technique at the shutter's middle.
    reference : Reference
        The truth there.
    full_shutter : Reference or None
        The truth under a full shutter, of the first frames; None where nothing asks for it or it failed.
    """

    test: NDArray[np.float32]
    reference: Reference
    full_shutter: Reference | None


def own_truth(case: Case) -> Truth:
    """Return what the case is measured against."""
    technique = reference_technique(case.technique, case.texture_truth)
    return Truth(technique.text, case.scene, technique, case.frames)


def center_truth(case: Case) -> Truth | None:
    """Return the truth at the shutter's middle: the case's own where the shutter is closed; None if nothing asks."""
    if not _asks(case, METRICS):
        return None
    own = own_truth(case)
    if not case.scene.animation.shutter:
        return own
    technique = _at(own.technique, "center")
    return Truth(technique.text, case.scene, technique, case.frames)


def full_truth(case: Case) -> Truth | None:
    """Return the truth under a shutter open from frame to frame, of the first frames; None if nothing asks for it."""
    if not _asks(case, ("shutter",)):
        return None
    own = own_truth(case)
    technique = _at(own.technique, "spread")
    if case.scene.animation.shutter == 1.0 and technique == own.technique:
        return own
    width, height = case.size
    frames = min(case.frames, math.ceil(FULL_SHUTTER_PIXELS / (width * height)))
    scene = replace(case.scene, animation=replace(case.scene.animation, shutter=1.0))
    return Truth(f"{technique.text} with a full shutter", scene, technique, frames)


def truths_of(case: Case) -> list[Truth]:
    """Return all that a case needs, its own first, each once."""
    found = [own_truth(case), center_truth(case), full_truth(case)]
    return list({truth.name: truth for truth in found if truth is not None}.values())


def truths_of_all(cases: Iterable[Case]) -> Mapping[str, Truth]:
    """Return all that cases of one scene and size need by name, each of as many frames as any of them needs."""
    found: dict[str, Truth] = {}
    for truth in (truth for case in cases for truth in truths_of(case)):
        if truth.name not in found or found[truth.name].frames < truth.frames:
            found[truth.name] = truth
    return found


def center_technique(case: Case) -> Technique:
    """Return the technique with all samples at the shutter's middle: itself where that makes no difference."""
    if not case.scene.animation.shutter or _sees_an_instant(case.technique):
        return case.technique
    return _at(case.technique, "center")


def center_frames(case: Case) -> int:
    """Return how many frames must be rendered at the shutter's middle besides the case's own."""
    needed = _asks(case, METRICS) and center_technique(case) != case.technique
    return case.frames * len(case.seeds) if needed else 0


def _asks(case: Case, metrics: tuple[str, ...]) -> bool:
    wanted = case.metrics is None or any(name in case.metrics for name in metrics)
    return wanted and not case.scene.is_static


def _sees_an_instant(technique: Technique) -> bool:
    """Return whether all samples are taken at the shutter's middle: one sample, and that in the middle of its place."""
    samples = technique.passes if technique.renderer == "raster" else technique.spp
    single = technique.renderer != "reference" and technique.adaptive == "off" and samples == 1
    return technique.time == "center" or (single and technique.sampler in ("center", "grid"))


def _at(technique: Technique, time: str) -> Technique:
    """Return the technique with another `time`."""
    if technique.time == time:
        return technique
    renderer, _, tail = technique.text.partition(":")
    keys = [key for key in tail.split(",") if key and not key.startswith("time=")]
    return parse_technique(f"{renderer}:{','.join([*keys, *(['time=center'] if time == 'center' else [])])}")
