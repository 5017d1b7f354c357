"""Scenes of which a unit is a pixel, still and moving, and how far a subject misplaces what their samples see.

A pixel is a world unit wide at z = 0, which a camera at z = 48 looks at. All bounds follow from the formats, see
`painting`: a ray tracer's from float32, a rasterizer's from its 8 subpixel bits.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np

from aliasbench.bench.hard.aiming import aimed
from aliasbench.bench.hard.case import FAST, RASTERS, REFERENCE, Verdict, samples_key, with_keys
from aliasbench.bench.hard.edge_pictures import PERMANENT, worst_of
from aliasbench.bench.hard.ownership import distance_to_outline, pixel_points
from aliasbench.bench.hard.painting import SNAPPED, SNAPPED_PX, TIE_PX, Painting, outline_seen, paint
from aliasbench.bench.hard.rays import WHY, WHY_FAST, ray_bound, truth_bound
from aliasbench.renderers.catalog import render
from aliasbench.scenes.model import Animation, Camera, FloatArray, Motion, Scene, Spin, Surface, Vec3
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import view_at
from aliasbench.scenes.shapes import polygon

SIZE = (36, 24)
DISTANCE = 48.0
ORANGE: Vec3 = (1.0, 0.5, 0.0)
BLUE: Vec3 = (0.0, 0.25, 1.0)
GREEN: Vec3 = (0.25, 1.0, 0.5)
WHITE: Vec3 = (1.0, 1.0, 1.0)
MAGENTA: Vec3 = (1.0, 0.0, 1.0)  # of what must not be seen
Projection = Literal["orthographic", "perspective"]
PROJECTIONS: tuple[Projection, ...] = ("orthographic", "perspective")
MOVING_FRAME = 7
ANIMATION = Animation(fps=30.0, frames=20, shutter=0.5)
MIDDLE_S = (MOVING_FRAME + ANIMATION.shutter / 2.0) / ANIMATION.fps  # of that frame's shutter
# What is cut lies between planes at distances d and 8 d, d being at least the picture's width or how far the edge is:
# its corners are at most 8 sqrt(3) d away, which bounds what `rays` adds up, 6 roundings and 7 of 1.155 |e| |s|, of
# which a pixel is seen at `DISTANCE`, off the axis 1.2 times as large.
CUT_PX = (6.0 + 7.0 * PERMANENT) * 2.0**-24 * 8.0 * math.sqrt(3.0) * 1.2 * DISTANCE
CUT = "parts cut in float64 reach at most 8 sqrt(3) times as far as they are"
SHOWN = "A sample at a pixel's centre shows what is there; where it does not, that is within the format's rounding."


@dataclass(frozen=True, slots=True)
class Setting:
    """One scene of a case. `order` is its objects' from back to front; `truth` is the scene in flat polygons."""

    name: str
    scene: Scene
    order: tuple[int, ...] | None = None
    truth: Scene | None = None
    frame: int = 0

    @property
    def fraction(self) -> float:
        """Of the frame interval: the shutter's middle, at which moving scenes are looked at."""
        return self.scene.animation.shutter / 2.0

    @property
    def timed(self) -> str:
        """What a technique needs besides to look at the shutter's middle."""
        return "" if self.scene.is_static else "time=center"

    def painting(self) -> Painting:
        """Return what is true."""
        scene = self.scene if self.truth is None else self.truth
        return paint(scene, SIZE, frame=self.frame, fraction=self.fraction, order=self.order)


def camera(projection: Projection, position: Vec3 = (0.0, 0.0, DISTANCE), target: Vec3 = (0.0, 0.0, 0.0)) -> Camera:
    """Return a camera of which a pixel is a unit, 48 units away."""
    if projection == "orthographic":
        return Camera(projection, position, target, height=float(SIZE[1]))
    return Camera(projection, position, target, fov_y_deg=2.0 * math.degrees(math.atan(SIZE[1] / 2.0 / DISTANCE)))


def flat(points: FloatArray | list[tuple[float, float]], color: Vec3, *, motion: Motion | None = None) -> Surface:
    """Return a polygon in the plane z = 0."""
    outline = np.asarray(points, dtype=np.float64)
    return polygon(np.c_[outline, np.zeros(len(outline))], color=color, motion=motion)


def moved(scene: Scene) -> Scene:
    """Return a scene whose still objects turn about the axis, and are at MOVING_FRAME's middle where they were."""
    motion = Motion(spin=Spin((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 2.0 / MIDDLE_S))
    objects = tuple(
        Surface(s.vertices, s.triangles, s.is_polygon, s.color, s.uv, s.texture, s.material, motion, s.name)
        for s in scene.objects
    )
    return replace(scene, objects=objects, animation=ANIMATION)


def flown(scene: Scene, step: Vec3) -> Scene:
    """Return a scene whose camera has gone by `step` at MOVING_FRAME's middle."""
    velocity = (step[0] / MIDDLE_S, step[1] / MIDDLE_S, step[2] / MIDDLE_S)
    return replace(scene, camera=replace(scene.camera, velocity=velocity), animation=ANIMATION)


def misplaced(
    subject: str,
    settings: Iterable[Setting],
    *,
    aim: int = 0,
    cut: bool = False,
    reach_px: float = 0.0,
    near_px: float = 0.0,
) -> Verdict:
    """Return how far a subject misplaces what samples at pixel centres see; of the reference, its coverage's error.

    Parameters
    ----------
    aim : int
        At how many samples of each setting edges are aimed besides, see `aiming`; none with a `truth` of its own.
    cut : bool
        A tracer cuts in float64 what float32 would misplace by more than 1/256 px.
    reach_px : float
        How far out float64 coordinates of the truth are.
    near_px : float
        By how much a cut at the reference's near plane moves in the picture.
    """
    judged = [
        _covered(subject, setting, reach_px, near_px) if subject == REFERENCE else _sampled(subject, setting, aim, cut)
        for setting in settings
    ]
    worst = worst_of([verdict for verdict, _, _ in judged])
    wrong, pictures = sum(number for _, number, _ in judged), sum(number for _, _, number in judged)
    more = "" if subject == REFERENCE else f"; {wrong} samples of {pictures} pictures are off"
    return replace(worst, note=f"{worst.note}{more}")


def _covered(subject: str, setting: Setting, reach_px: float, near_px: float) -> tuple[Verdict, int, int]:
    """Return the verdict on a reference's coverage, and two numbers that mean nothing."""
    frame = render(setting.scene, with_keys(subject, setting.timed), size=SIZE, frame=setting.frame)
    error = float(np.abs(frame.pixels - setting.painting().coverage()).max())
    # the truth's own roundings: 8 of float64 of its largest coordinate, of which an edge's area is at most 2
    bound = (frame.uncertainty or 0.0) + 16.0 * 2.0**-53 * max(reach_px, 1e3) + 2.0 * near_px
    why = "its own bound, and 16 roundings of float64 of the outlines compared with"
    return Verdict(error, "contrast", bound, bound, why, note=setting.name), 0, 1


def _sampled(subject: str, setting: Setting, aim: int, cut: bool) -> tuple[Verdict, int, int]:
    """Return the verdict on single samples, how many are wrong, and of how many pictures."""
    bound, exact = _bounds(setting)
    apart = np.array([_apart(subject, each, painting) for each, painting in _pictures(setting, aim)])
    if subject in RASTERS:
        bound, why = SNAPPED_PX, SNAPPED
    else:
        why = WHY_FAST if subject == FAST else WHY
        if cut and bound > CUT_PX:
            bound, why = CUT_PX, f"{CUT}; {why}"
    verdict = Verdict(float(apart.max()), "px", exact, max(bound, exact), why, note=setting.name)
    return verdict, int((apart > exact).sum()), len(apart)


@lru_cache(maxsize=512)
def _bounds(setting: Setting) -> tuple[float, float]:
    """Return by how many pixels float32 rays may misplace what is seen, and float64 the truth."""
    scene, frame, fraction = setting.scene, setting.frame, setting.fraction
    exact = truth_bound(scene, SIZE, frame=frame, fraction=fraction)
    return ray_bound(scene, SIZE, frame=frame, fraction=fraction), max(TIE_PX, exact)


@lru_cache(maxsize=512)  # one after the other, all subjects of a case are held to the same truth
def _pictures(setting: Setting, aim: int) -> tuple[tuple[Setting, Painting], ...]:
    """Return a setting and the same with the camera aimed, each with what is true of it."""
    scenes = [setting.scene]
    if aim:
        scenes += aimed(setting.scene, lambda scene: replace(setting, scene=scene).painting(), aim)
    settings = (replace(setting, scene=scene) for scene in scenes)
    return tuple((each, each.painting()) for each in settings)


def _apart(subject: str, setting: Setting, painting: Painting) -> FloatArray:
    """Return (h w,): how far each sample is from what it shows; the fast test may see through between triangles."""
    shown = render(setting.scene, samples_key(subject, 1, setting.timed), size=SIZE, frame=setting.frame).pixels
    apart = painting.apart(shown)
    wrong = np.flatnonzero(apart > TIE_PX)
    if subject == FAST and len(wrong):
        points = pixel_points(SIZE)[wrong]
        view = view_at(setting.scene.camera, setting.scene.animation, setting.frame, setting.fraction, SIZE)
        for surface in setting.scene.objects:
            matrix = object_matrix(surface.motion, setting.scene.animation, setting.frame, setting.fraction)
            corners = (surface.vertices @ matrix[:3, :3].T + matrix[:3, 3])[surface.triangles]
            for outline in (outline_seen(view, triangle) for triangle in corners):
                if len(outline):
                    apart[wrong] = np.minimum(apart[wrong], np.maximum(distance_to_outline(points, outline), TIE_PX))
    return apart
