"""Pictures of which it is known what every sample sees, and how far float32 and snapped vertices may displace it.

Scenes are written down in pixels and placed in the world by a camera's own rays, so that edges go through samples in
any projection, at rest or on the move. A sample's error is how far it would have to be moved to see what it shows: a
distance in pixels, which bounds derived from number formats can be compared with. A wrong sample at no distance from
an edge counts as `FINEST`, so that an error that is infinitely narrow still is one.

Bounds, with u = 2^-24, half an ulp of 1 in float32, and R the largest distance of a vertex from the eye:

* Embree's robust test takes the sign of (e x s) . D, of an edge e, the sum s of its ends relative to the ray's origin
  and the direction D: 7 roundings each of six products whose absolute values sum to at most 6 / 3^1.5 |e| |s| |D| (the
  largest permanent), |s| <= 2 R. As the exact value is 2 |e'| |D| times the distance, e' being what the ray sees of e,
  that moves an edge by 7 * 1.155 u R |e| / |e'|. Rounded input (vertex, origin, direction, difference) adds 4 u R, and
  the test's own tolerance of 2^-23 of the triangle's height another 2 u R.
  Where two edges meet at an angle of a, both moved outwards meet 1 / sin(a / 2) times as far from the vertex.
* The fast test does the same for two edges and has the third from them, a rounding as large times (|a| + |b|) / |e'|,
  and adds 7 * 1.155 u |a| |b| / |e'| of the area; its boxes, whose slabs take a reciprocal, a difference and a product,
  add 3 u R.
* A rasterizer with 8 subpixel bits moves a vertex by up to 1/512 px along either axis: an edge by sqrt(2) / 512 px, one
  parallel to an axis by 1/512 px. Float32 clip coordinates (a matrix, 4 products and sums, a quotient, the viewport)
  add at most 16 u times the largest coordinate in pixels.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aliasbench.bench.hard.case import FAST, RASTERS, Verdict
from aliasbench.bench.hard.ownership import distance_to_outline, inside
from aliasbench.scenes.model import Animation, Camera, FloatArray, Motion, Scene, Surface, as_vec3
from aliasbench.scenes.projection import View, view_at

FINEST = 2.0**-22  # px
EXACT = 1e-12  # px: what float64 leaves of coordinates of some hundred pixels in the truth itself
REFERENCE_ROUNDING = 1e-11  # of the contrast: some tens of float64 roundings of such coordinates
HALF_ULP = 2.0**-24
PERMANENT = 6.0 / 3.0**1.5
DEPTH = 5.25  # world units, of what faces the camera
TRAVEL = (2.0, -1.0)  # px a frame, of what moves
MOVING_FRAME = 3  # with the shutter open all the time a centred sample is taken at 3.5 frames: 7 px right, 3.5 px up
FPS = 32.0

Outline = Sequence[tuple[float, float]] | FloatArray


def cameras(size: tuple[int, int]) -> dict[str, Camera]:
    """Return by name a camera whose unit is a pixel, and two that look askew, so that hardly a coordinate is exact."""
    position, target, up = (0.31, -0.23, 7.1), (0.13, 0.07, 0.2), (0.1, 1.0, 0.05)
    return {
        "orthographic": Camera("orthographic", (0.0, 0.0, 8.0), height=float(size[1])),
        "turned": Camera("orthographic", position, target, up, height=1.7),
        "perspective": Camera("perspective", position, target, up, fov_y_deg=41.0),
    }


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """A camera, a picture's size, and whether all that it shows moves; truth holds at the time of centred samples."""

    name: str
    camera: Camera
    size: tuple[int, int]
    moving: bool = False

    @property
    def animation(self) -> Animation:
        """The scene's: the shutter is open all the time where things move."""
        return Animation(FPS, 8, 1.0) if self.moving else Animation(FPS)

    @property
    def frame(self) -> int:
        """The frame that is looked at."""
        return MOVING_FRAME if self.moving else 0

    @property
    def view(self) -> View:
        """What the camera, which is at rest, sees."""
        return view_at(self.camera, self.animation, 0, 0.0, self.size)

    @property
    def motion(self) -> Motion:
        """What takes a thing at `DEPTH` by `TRAVEL` in a frame."""
        if not self.moving:
            return Motion()
        view = self.view
        step = (TRAVEL[0] * view.right - TRAVEL[1] * view.up) * (DEPTH if view.perspective else 1.0) / view.scale
        return Motion(velocity=as_vec3(step * FPS))

    def place(self, points: Outline, depth: float | FloatArray = DEPTH) -> FloatArray:
        """Return (n, 3): where in the world at rest points (n, 2) lie that are seen there at the sample's time."""
        x, y = np.asarray(points, dtype=np.float64).T
        origins, directions = self.view.ray(x, y)
        seconds = (self.frame + 0.5) / FPS if self.moving else 0.0
        out: FloatArray = origins + np.asarray(depth)[..., None] * directions
        return out - np.asarray(self.motion.velocity) * seconds

    def scene(self, *objects: Surface) -> Scene:
        """Return the scene of these objects."""
        return Scene("hard", self.camera, objects, animation=self.animation)


def stages(size: tuple[int, int], names: Iterable[str] = ("orthographic", "turned", "perspective")) -> list[Stage]:
    """Return each camera at rest and with everything moving."""
    return [Stage(n, cameras(size)[n], size, moving) for n in names for moving in (False, True)]


def label(stage: Stage) -> str:
    """Return what a note calls a stage."""
    return f"{stage.name}, {'moving' if stage.moving else 'still'}"


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """What of a picture has one colour: all of the outlines' insides, or, if hidden, only what is on the outlines."""

    color: tuple[float, float, float]
    outlines: Sequence[FloatArray]
    hidden: bool = False


def misplacements(
    pixels: NDArray[np.floating], points: FloatArray, looks: Sequence[Look], seams: Sequence[FloatArray] = ()
) -> FloatArray:
    """Return (n,): how far each sample must be moved, in px, to see the colour that it has; inf if nothing has it.

    Parameters
    ----------
    pixels : (h, w, 3)
        Of one sample each, or any array of n colours.
    points : (n, 2)
        Where the samples are.
    looks : sequence of Look
        The background, black, is what is outside of those that are not hidden.
    seams : sequence of (n, 2)
        Outlines of which the sides let samples through to the background.
    """
    colors = np.asarray(pixels, dtype=np.float64).reshape(-1, 3)
    out = np.full(len(points), np.inf)
    edges = np.full(len(points), np.inf)
    covered = np.zeros(len(points), dtype=np.bool_)
    for look in looks:
        has = (np.abs(colors - look.color) <= 1e-6).all(axis=1)
        for outline in look.outlines:
            distance, within = distance_to_outline(points, outline), inside(points, outline)
            if not look.hidden:
                covered |= within
                edges = np.minimum(edges, distance)
            away = np.where(within & (not look.hidden), 0.0, distance)
            out[has] = np.minimum(out[has], away[has])
    for seam in seams:
        edges = np.minimum(edges, distance_to_outline(points, seam))
    black = (np.abs(colors) <= 1e-6).all(axis=1)
    out[black] = np.where(covered, edges, 0.0)[black]
    return out


def coverage(outline: FloatArray, size: tuple[int, int]) -> FloatArray:
    """Return (h, w): the area of each pixel that lies in a simple outline, by GEOS."""
    import shapely

    columns, rows = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    boxes = shapely.box(columns, rows, columns + 1, rows + 1)
    out: FloatArray = shapely.area(shapely.intersection(boxes, shapely.Polygon(outline)))
    return out


def ray_bound(subject: str, stage: Stage, objects: Iterable[Surface]) -> float:
    """Return by how many pixels float32 rays may misplace the edges of these objects, as derived above."""
    view, motion = stage.view, np.asarray(stage.motion.velocity)
    seconds = (stage.frame + 0.5) / FPS if stage.moving else 0.0
    worst = 0.0
    for surface in objects:
        world = (surface.vertices + motion * seconds)[surface.triangles]
        corners, image = world - view.origin, view.project(world)[..., :2]
        reach, depth = float(np.linalg.norm(corners, axis=-1).max()), float((corners @ view.forward).min())
        edges = np.roll(corners, -1, axis=1) - corners
        ray = corners.mean(axis=1, keepdims=True) if view.perspective else np.broadcast_to(view.forward, (1, 1, 3))
        ray = ray / np.linalg.norm(ray, axis=-1, keepdims=True)
        length = np.linalg.norm(edges, axis=-1)
        across = np.linalg.norm(edges - (edges * ray).sum(axis=-1, keepdims=True) * ray, axis=-1)
        in_sight = _in_sight(image, stage.size)
        if not in_sight.any():
            continue
        if subject == FAST:
            a, b = np.roll(length, 1, axis=1), np.roll(length, 2, axis=1)
            least, share = 4.0 + 3.0, (a + b + a * b / reach) / across
        else:
            least, share = 4.0 + 2.0, length / across
        factor = least + 7.0 * PERMANENT * float(share[in_sight].max())
        # a distance across the ray at depth z, r from the eye, is (scale / z) (r / z) times as long in the picture
        per_unit = view.scale * (reach / depth**2 if view.perspective else 1.0)
        worst = max(worst, HALF_ULP * reach * factor * per_unit * _miter(image, stage.size))
    return worst


def _in_sight(image: FloatArray, size: tuple[int, int]) -> NDArray[np.bool_]:
    """Return (m, 3): which sides (from each corner to the next) of triangles (m, 3, 2) may cross the picture."""
    following = np.roll(image, -1, axis=1)
    reaches = (np.maximum(image, following) >= 0.0) & (np.minimum(image, following) <= np.asarray(size))
    out: NDArray[np.bool_] = np.all(reaches, axis=-1)
    return out


def _miter(image: FloatArray, size: tuple[int, int]) -> float:
    """Return how many times as far as its sides the corner of a triangle in the picture moves if they move outwards."""
    ahead, behind = np.roll(image, -1, axis=1) - image, np.roll(image, 1, axis=1) - image
    cosine = (ahead * behind).sum(axis=-1) / (np.linalg.norm(ahead, axis=-1) * np.linalg.norm(behind, axis=-1))
    within = ((image >= 0.0) & (image <= np.asarray(size))).all(axis=-1)
    return float((1.0 / np.sqrt((1.0 - cosine[within]) / 2.0)).max(initial=1.0))


def snap_bound(extent: float, *, aligned: bool = False) -> float:
    """Return by how many pixels a rasterizer may misplace edges whose coordinates reach `extent` px."""
    return (1.0 if aligned else np.sqrt(2.0)) / 512.0 + 16.0 * HALF_ULP * extent


def edge_bound(
    subject: str, stage: Stage, objects: Iterable[Surface], *, extent: float, aligned: bool = False
) -> tuple[float, str]:
    """Return a sampling subject's bound in px, and why."""
    if subject in RASTERS:
        return snap_bound(extent, aligned=aligned), (
            "8 subpixel bits: vertices are snapped to 1/256 px, which moves an edge by at most "
            f"{'1/512' if aligned else 'sqrt(2)/512'} px; float32 clip coordinates add 16 half ulps"
        )
    which = "fast" if subject == FAST else "robust"
    return ray_bound(subject, stage, objects), (
        f"float32 rays: roundings of 2^-24 of the distance to the vertices, as many as Embree's {which} test makes, "
        "move an edge by so much"
    )


def farthest(distances: FloatArray, wrong: NDArray[np.bool_]) -> float:
    """Return the largest distance of the wrong samples, at least `FINEST`; 0 if none is wrong."""
    return max(float(distances[wrong].max()), FINEST) if wrong.any() else 0.0


def worst_of(verdicts: Sequence[Verdict]) -> Verdict:
    """Return what failed, else what comes closest to its bound, else the first, of verdicts on one question."""
    order = {"ok": 0, "limit": 1, "failed": 2}

    def badness(verdict: Verdict) -> tuple[int, float]:
        return order[verdict.outcome], verdict.measured / verdict.bound if verdict.bound > 0.0 else verdict.measured

    return max(verdicts, key=badness)
