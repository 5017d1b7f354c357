"""Scenes of which a unit is a pixel, still and moving, and how far a subject misplaces what their samples see.

A pixel is a world unit wide at z = 0, which a camera at z = 48 looks at. All bounds follow from the formats, see
`painting`: a ray tracer's from float32, a rasterizer's from its 8 subpixel bits.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from aliasbench.bench.hard.case import RASTERS, REFERENCE, Verdict, samples_key, with_keys
from aliasbench.bench.hard.painting import RAYS, SNAPPED, SNAPPED_PX, TIE_PX, Painting, paint, ray_bound_px
from aliasbench.renderers.catalog import render
from aliasbench.scenes.model import Animation, Camera, FloatArray, Motion, Scene, Spin, Surface, Vec3
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
    subject: str, settings: Iterable[Setting], *, bound_px: float | None = None, reach_px: float = 0.0
) -> Verdict:
    """Return how far a subject misplaces what samples at pixel centres see; of the reference, its coverage's error.

    `bound_px` replaces a tracer's bound. `reach_px`: how far out float64 coordinates of the truth are.
    """
    found: dict[str, float] = {}
    bound, wrong, why = 0.0, 0, ""
    for setting in settings:
        scene, painting = setting.scene, setting.painting()
        timed = "time=center" if not scene.is_static else ""
        if subject == REFERENCE:
            frame = render(scene, with_keys(subject, timed), size=SIZE, frame=setting.frame)
            found[setting.name] = float(np.abs(frame.pixels - painting.coverage()).max())
            # the truth's own roundings: 8 of float64 of its largest coordinate, of which an edge's area is at most 2
            own = 16.0 * 2.0**-53 * max(reach_px, 1e3)
            bound = max(bound, (frame.uncertainty or 0.0) + own)
            why = "its own bound, and 16 roundings of float64 of the outlines compared with"
            continue
        shown = render(scene, samples_key(subject, 1, timed), size=SIZE, frame=setting.frame).pixels
        apart = painting.apart(shown)
        found[setting.name] = float(apart.max())
        wrong += int((apart > TIE_PX).sum())
        if subject in RASTERS:
            bound, why = SNAPPED_PX, SNAPPED
        else:
            own = ray_bound_px(scene, SIZE, frame=setting.frame, fraction=setting.fraction)
            bound, why = max(bound, own if bound_px is None else bound_px), RAYS
    listed = ", ".join(f"{name} {value:.1e}" for name, value in found.items())
    if subject == REFERENCE:
        return Verdict(max(found.values()), "contrast", bound, bound, why, note=listed)
    return Verdict(max(found.values()), "px", TIE_PX, bound, why, note=f"{wrong} samples off; {listed}")
