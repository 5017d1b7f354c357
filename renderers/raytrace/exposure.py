"""What one frame is made from: when its shutter is open, what moves meanwhile, and where float32 has its origin.

Still triangles are one mesh, built once. What moves while the shutter is open is traced in its own frame at every ray's
own time (`bodies`). An instant has no such bodies: everything is placed where it is and merged, so that frame n of an
animation is the still scene of that moment, at its speed. Only large meshes are not worth rebuilding for one picture,
and are traced as bodies that happen not to move.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aliasbench.renderers.geometry import Body, layered_corners, layered_depth
from aliasbench.renderers.raytrace.bodies import Shutter
from aliasbench.renderers.raytrace.start import Spheres, find_start
from aliasbench.renderers.technique import Technique
from aliasbench.scenes.model import FloatArray, Scene
from aliasbench.scenes.projection import View, view_at

# Above this many triangles an instant of a moving mesh is traced in the mesh's own frame instead of rebuilt.
MERGE_LIMIT = 4096


@dataclass(frozen=True, slots=True, eq=False)
class Exposure:
    """One frame's shutter, the point float32 coordinates are relative to, and the bodies.

    Attributes
    ----------
    shutter : Shutter
    anchor : (3,) float64
    anchor_view : View
        From there; the camera comes no farther away than `travel` (world units).
    travel : float
    still, moving : tuple of Body
        Bodies of the merged mesh, and those that are traced in their own frame.
    has_times : bool
        Whether samples at different times may differ (or bodies are traced in their frames).
    mesh_key : tuple of float
        Equal for frames with the same merged mesh.
    start : float
        The depth at which rays start, see `start`.
    """

    shutter: Shutter
    anchor: FloatArray
    anchor_view: View
    travel: float
    still: tuple[Body, ...]
    moving: tuple[Body, ...]
    has_times: bool
    mesh_key: tuple[float, ...]
    start: float


def plan_exposure(
    scene: Scene,
    technique: Technique,
    size: tuple[int, int],
    bodies: Sequence[Body],
    spheres: Spheres,
    frame: int,
    *,
    lit: bool = False,
) -> Exposure:
    """Return what frame number `frame` is made from; a function of the frame alone, not of what came before.

    `lit`: rays do not all come from the camera.
    """
    opening, closing = shutter_interval(scene, technique)
    first = view_at(scene.camera, scene.animation, frame, opening, size)
    last = view_at(scene.camera, scene.animation, frame, closing, size) if closing > opening else first
    span = (frame + opening) / scene.animation.fps, (frame + closing) / scene.animation.fps
    start, share = find_start(spheres, scene, (first, last), span, _margin_px(technique))
    anchor_frame = _anchor_frame(scene, frame) if start == 0.0 or scene.camera.is_static else frame
    anchor_view = view_at(scene.camera, scene.animation, anchor_frame, 0.0, size)
    anchor = anchor_view.origin + start * anchor_view.forward
    travel = 0.0 if not any(scene.camera.velocity) else _reach(scene)
    depth = share if first.perspective else layered_depth(layered_corners(bodies), first, travel, start)
    is_matrix = technique.motion == "matrix"
    shutter = Shutter(frame, opening, closing, first, last, depth, scene.camera.lens_radius, is_matrix)
    # a layer above others is brought towards the eye in one mesh with them, where all rays come from one eye
    no_eye = lit or scene.camera.lens_radius > 0.0
    apart = [body.layer > 0 and no_eye for body in bodies]
    restless = [not b.motion.is_static or (b.layer > 0 and not scene.camera.is_static) for b in bodies]
    key: tuple[float, ...] = (anchor_frame, start)
    count = sum(len(b.triangles) for b, is_restless in zip(bodies, restless, strict=True) if is_restless)
    if opening == closing and count <= MERGE_LIMIT:
        key = (*key, frame) if any(restless) else key
    else:
        apart = [a or b for a, b in zip(apart, restless, strict=True)]
    still = tuple(body for body, is_apart in zip(bodies, apart, strict=True) if not is_apart)
    moving = tuple(body for body, is_apart in zip(bodies, apart, strict=True) if is_apart)
    camera_moves = closing > opening and not scene.camera.is_static
    has_times = bool(moving) or camera_moves
    return Exposure(shutter, anchor, anchor_view, travel, still, moving, has_times, key, start)


def shutter_interval(scene: Scene, technique: Technique) -> tuple[float, float]:
    """Return the fractions of the frame interval between which samples lie; equal for an instant.

    One sample at a fixed place in its stratum is at the shutter's middle, and no other time need be modelled.
    """
    shutter = scene.animation.shutter
    is_single = technique.adaptive == "off" and technique.spp == 1
    if technique.time == "center" or (is_single and technique.sampler in ("center", "grid")):
        return shutter / 2, shutter / 2
    return 0.0, shutter


def _margin_px(technique: Technique) -> float:
    """Return how far from a pixel's centre its filter has samples, along both axes together, and a pixel more."""
    # a Gaussian without end is drawn from by numbers of 53 bits, which are no further out
    radius = technique.radius_px if np.isfinite(technique.radius_px) else 9.0 * technique.sigma_px
    return float(np.sqrt(2.0) * radius) + 1.0


def _anchor_frame(scene: Scene, frame: int) -> int:
    """Return the frame whose camera position coordinates are relative to, near enough to this frame's.

    Up to the target's distance away float32 loses no more than a bit; farther, the mesh is built anew.
    """
    camera = scene.camera
    step = float(np.linalg.norm(camera.velocity)) / scene.animation.fps
    if step == 0.0:
        return 0
    interval = int(max(1.0, min(_reach(scene) / step, 1e9)))
    return frame // interval * interval


def _reach(scene: Scene) -> float:
    return float(np.linalg.norm(np.subtract(scene.camera.target, scene.camera.position)))
