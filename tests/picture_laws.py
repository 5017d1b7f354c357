"""The laws of `test_random_pictures` as figures: what was found over what is allowed, 1 or less where a law holds."""

from dataclasses import replace

import numpy as np
from picture_bounds import color_range, doubtful_area, find_borders, independent_bound, stratified_bound
from random_pictures import Case

from aliasbench.renderers.catalog import render
from aliasbench.renderers.frame import Frame
from aliasbench.renderers.sampling.filters import FilterSpec, filter_of
from aliasbench.renderers.sampling.patterns import DIM_TIME, DIM_X, sample_set
from aliasbench.renderers.technique import parse_technique
from aliasbench.scenes.model import FloatArray, Scene, Vec3

HALF_ULP = 2.0**-24
ROUNDING_64 = 1e-12  # of sums of a few hundred terms in float64, relative
BEYOND_SIX_SIGMAS = 1e-6  # of a Gaussian, a share that renderers take no notice of; 2e-9 along each axis
LEAST = 1e-30  # where a scene is black nothing is allowed, and zero divided by zero is no figure


def draw(scene: Scene, technique: str, case: Case) -> FloatArray:
    """Return the pixels of a scene at a case's size, frame and seed, in float64."""
    pixels = render(scene, technique, size=case.size, frame=case.frame, seed=case.seed).pixels
    return np.asarray(pixels, dtype=np.float64)


def known(frame: Frame) -> float:
    """Return a reference's own bound."""
    assert frame.uncertainty is not None
    return frame.uncertainty


def spec_of(technique: str) -> FilterSpec:
    return filter_of(parse_technique(technique))


def rounding(technique: str) -> float:
    """Relative rounding of a picture: weights, products and sums of as many terms as a filter covers, in float32."""
    t = parse_technique(technique)
    terms = t.spp * t.passes * t.msaa * t.ssaa**2 * (2 * filter_of(t).margin + 1) ** 2
    return (2.0 * terms + 8.0) * HALF_ULP


def overshoot(technique: str, case: Case) -> float:
    """Return the sum of the weights' absolute values over their sum: of one pattern for all pixels."""
    t, spec = parse_technique(technique), spec_of(technique)
    if t.renderer == "reference":
        return spec.gain
    points = sample_set(t.sampler, t.spp * t.passes, seed=case.seed, frame=0 if t.reseed == "never" else case.frame)
    places = np.arange(-spec.margin, spec.margin + 1)[:, None] + points[:, DIM_X : DIM_X + 2].T[:, None] - 0.5
    weights = spec.profile(places[0])[:, None] * spec.profile(places[1])[None, :]
    return float(np.abs(weights).sum() / abs(weights.sum()))


def out_of_range(scene: Scene, technique: str, case: Case, pixels: FloatArray, uncertainty: float) -> float:
    """How far pixels are out of the range that a filter may bring about, over rounding and the picture's own bound.

    Weights that are not negative give means: within [low, high] of the scene's colours. Lobes give (1 + s) / 2 of one
    colour less (s - 1) / 2 of another at most, where s is the sum of the weights' absolute values over their sum: s
    times half the range from the range's middle. A mean of colours times plus or minus the filter's gain is within the
    gain times the highest.
    """
    low, high = color_range(scene)
    middle, half = (high + low) / 2.0, (high - low) / 2.0
    allowed = rounding(technique) * high + uncertainty
    t = parse_technique(technique)
    if t.filter in ("mitchell", "lanczos") and t.weighting == "distribution":
        middle, half = np.zeros(3), filter_of(t).gain * high
    elif t.filter in ("mitchell", "lanczos"):
        s = overshoot(technique, case)
        half, allowed = s * half, s * allowed
    return float(np.max((np.abs(pixels - middle) - half) / np.maximum(allowed, LEAST), initial=0.0))


def darkening(case: Case, before: Scene, after: Scene, technique: str) -> float:
    """By how much white polygons on black are darker after than before, over rounding."""
    first, second = draw(before, technique, case), draw(after, technique, case)
    allowed = 2.0 * rounding(technique)
    if technique.startswith("reference"):
        frames = (render(s, technique, size=case.size) for s in (before, after))
        allowed = sum(map(known, frames)) + ROUNDING_64
    return float(np.max(first - second, initial=0.0)) / allowed


def stratified_ratio(
    case: Case, technique: str, k: int, truth: Frame, *, shown: Scene | None = None, independent: bool = False
) -> float:
    """How far a picture of one sample in each of k x k cells is from a reference; `shown` is drawn for the scene."""
    scene, spec = case.scene, spec_of(technique)
    borders = find_borders(scene, case.size, snapped=technique.startswith("raster"), margin=spec.margin)
    bound = stratified_bound(scene, borders, case.size, k, spec, independent=independent)
    return _ratio(shown or scene, technique, case, truth.pixels, bound + known(truth))


def independent_ratio(case: Case, technique: str, truth: Frame, *, shown: Scene | None = None) -> float:
    """How far a tracer's picture of independent samples is from a reference, over what is allowed."""
    t, spec, scene = parse_technique(technique), spec_of(technique), case.scene
    area = 0.0
    for fraction in np.linspace(0.0, scene.animation.shutter, 5).tolist():
        borders = find_borders(scene, case.size, snapped=False, frame=case.frame, fraction=fraction, margin=spec.margin)
        # an edge has at most sqrt(2) px, and as much again as it may be off, in a pixel
        area = max(area, float((2.0 * borders.off * (1.5 + 4.0 * borders.off)).sum()))
    # the filter weighs a doubtful place by its peak at most
    area = min(area * spec.peak**2 * (2 * spec.margin + 1) ** 2, 1.0)
    shift = np.full(truth.pixels.shape[:2], area)
    bound = independent_bound(scene, truth.pixels, t.spp, spec.gain, shift)
    return _ratio(shown or scene, technique, case, truth.pixels, bound + known(truth))


def passes_ratio(case: Case, sampler: str, passes: int, ssaa: int, *, shown: Scene | None = None) -> float:
    """How far accumulation passes are from the mean of references of the passes' instants, over what is allowed."""
    technique = f"raster:passes={passes},sampler={sampler},ssaa={ssaa}"
    scene, spec = case.scene, spec_of(technique)
    animation = scene.animation
    mean: FloatArray = np.zeros((case.size[1], case.size[0], 3))
    allowed = np.zeros_like(mean)
    for time in sample_set(sampler, passes, seed=case.seed, frame=case.frame)[:, DIM_TIME].tolist():
        fraction = time * animation.shutter
        # the instant is the middle of a shutter of its own
        instant = replace(scene, animation=replace(animation, shutter=2.0 * fraction))
        truth = render(instant, "reference:time=center", size=case.size, frame=case.frame)
        borders = find_borders(scene, case.size, snapped=True, frame=case.frame, fraction=fraction)
        bound = stratified_bound(scene, borders, case.size, ssaa, spec, independent=False)
        mean += truth.pixels / passes
        allowed += (bound + known(truth)) / passes
    return _ratio(shown or scene, technique, case, mean, allowed)


def mirror_ratio(case: Case, technique: str, scene: Scene, mirror: Scene) -> float:
    """How far the reference of a mirror image is from the mirrored reference, over what is allowed."""
    plain, turned = (render(s, technique, size=case.size, frame=case.frame) for s in (scene, mirror))
    spec = spec_of(technique)
    # rotations and sums come out another way by a few roundings of float64 of the coordinates
    far = float(np.abs(scene.camera.position).max()) / case.stage.unit + 200.0
    borders = find_borders(scene, case.size, snapped=False, frame=case.frame, margin=spec.margin)
    moved = replace(borders, off=np.full(len(borders.off), 32.0 * 2.0**-53 * far * case.size[1]))
    area = float(doubtful_area(moved, case.size, spec.margin).max()) * spec.peak**2 * (2 * spec.margin + 1) ** 2
    allowed = known(plain) + known(turned) + (ROUNDING_64 * spec.gain + min(area, 1.0)) * color_range(scene)[1]
    return float(np.max(np.abs(plain.pixels - turned.pixels[:, ::-1]) / np.maximum(allowed, LEAST)))


def _ratio(scene: Scene, technique: str, case: Case, truth: FloatArray, bound: FloatArray) -> float:
    allowed = bound + (rounding(technique) + BEYOND_SIX_SIGMAS) * color_range(case.scene)[1] + LEAST
    return float(np.max(np.abs(draw(scene, technique, case) - truth) / allowed))


def mirrored(scene: Scene) -> Scene:
    """Return the scene with x for -x, camera included."""

    def point(p: Vec3) -> Vec3:
        return (-p[0], p[1], p[2])

    objects = []
    for surface in scene.objects:
        spin = surface.motion.spin
        if spin is not None:
            x, y, z = spin.axis
            spin = replace(spin, axis=(x, -y, -z), center=point(spin.center))
        motion = replace(surface.motion, velocity=point(surface.motion.velocity), spin=spin)
        objects.append(replace(surface, vertices=surface.vertices * (-1.0, 1.0, 1.0), motion=motion))
    c = scene.camera
    camera = replace(c, position=point(c.position), target=point(c.target), up=point(c.up), velocity=point(c.velocity))
    return replace(scene, camera=camera, objects=tuple(objects))
