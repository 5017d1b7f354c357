"""The references a run measures against: one for each scene, size and filter, shared by all techniques that use it.

A technique is measured against its own pixel filter, exactly evaluated, with the shutter and the motion as the scene
says: errors of the time samples or of a linear motion model are the technique's, a wide filter is not.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from aliasbench.renderers import catalog
from aliasbench.renderers.technique import FILTER_RADII, Technique, parse_technique
from aliasbench.scenes.model import FloatArray, Scene

# The lecture prints its Gaussian with mu = .4 and lets it run to infinity; its tent is the exact one.
_LECTURE_SIGMA = 0.4


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """True pictures.

    Attributes
    ----------
    text : str
        The technique that made them.
    pixels : (frames, h, w, 3) float64
    uncertainty : float or None
        The largest bound of any frame on the error of a pixel; None where no bound was given.
    uncertainty_kind : str or None
        "bound", or "confidence" if any frame has no more than that.
    """

    text: str
    pixels: FloatArray
    uncertainty: float | None
    uncertainty_kind: str | None


def reference_technique(technique: Technique, texture_truth: str) -> Technique:
    """Return the reference that is the truth for a technique: same filter, exact shutter and motion.

    Parameters
    ----------
    technique : Technique
    texture_truth : str
        "point" (a texture is constant squares) or "linear" (their bilinear blend).
    """
    if technique.renderer == "reference":
        return technique
    keys: dict[str, str] = {}
    if technique.warp == "lecture" and technique.filter == "gaussian":
        keys = {"filter": "gaussian", "sigma": f"{_LECTURE_SIGMA:g}", "radius": "inf"}
    elif technique.warp == "lecture":
        keys = {"filter": "tent"}
    else:
        if technique.filter != "box":
            keys["filter"] = technique.filter
        if technique.filter == "gaussian":
            keys["sigma"] = repr(technique.sigma_px)
        if technique.radius_px != FILTER_RADII[technique.filter]:
            keys["radius"] = repr(technique.radius_px)
    if texture_truth != "point":
        keys["texture"] = texture_truth
    return parse_technique("reference:" + ",".join(f"{key}={value}" for key, value in keys.items()))


def render_reference(
    scene: Scene, technique: Technique, size: tuple[int, int], frames: int, on_frame: Callable[[], None]
) -> Reference:
    """Return the first `frames` true pictures; `on_frame` is called after each.

    Raises
    ------
    ValueError
        If the reference has a pixel that is not finite: a bug, never a result.
    """
    pictures, bounds, kinds = [], [], []
    with catalog.prepare(scene, technique, size=size) as prepared:
        for number in range(frames):
            frame = prepared.render(frame=number)
            pictures.append(np.asarray(frame.pixels, dtype=np.float64))
            if frame.uncertainty is not None:
                bounds.append(frame.uncertainty)
                kinds.append(frame.uncertainty_kind)
            on_frame()
    pixels = np.stack(pictures)
    if not np.isfinite(pixels).all():
        raise ValueError(f"{technique.text} of {scene.name} has pixels that are not finite")
    kind = "confidence" if "confidence" in kinds else ("bound" if kinds else None)
    return Reference(technique.text, pixels, max(bounds, default=None), kind)


def crop_radius(technique: Technique) -> float:
    """Return the filter's radius in pixels, or four sigma of an endless one: what metrics keep clear of the border."""
    if technique.warp == "lecture" and technique.filter == "gaussian":
        return 4.0 * _LECTURE_SIGMA
    if np.isinf(technique.radius_px):
        return 4.0 * technique.sigma_px
    return technique.radius_px
