"""From a body to clip space: matrices composed in float64 for every pass and rounded to float32 only when uploaded.

Rows are drawn top first: clip y points down the picture, so that OpenGL's row 0 is the picture's top row and neither
pixels nor sample positions need turning.

Depth keeps float32's relative precision wherever a camera can use it. Perspective: z / w = near / depth (reversed and
without a far plane), so `near` is a mere unit and may be far below anything in the scene. Orthographic: depth / far, 0
at the camera's plane, since there a plane's depth must stay linear in the picture. Either way whatever is in front of
the camera is kept and the rest is cut.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.geometry import LAYER_STEP, layered_depth
from aliasbench.renderers.raster.placement import Placement, body_matrices
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Camera, FloatArray, Scene
from aliasbench.scenes.projection import View, focus_at, lens_view, view_at

# near in units of the farthest point: small enough to cut nothing, and far from float32's smallest numbers
_NEAR = 2.0**-64
_FAR = 1.01  # the greatest depth, likewise: a little beyond, so that rounding cannot push the farthest point out
_LEAST_HEIGHT = 2.0**-20  # of the farthest: a plane nearer to the eye is seen as a line
# world units; a scene that is a single point still needs a unit of depth
_LEAST_DISTANT = 2.0**-100
# world units; beyond, products of lengths and scales leave float32 (2^127) even after cutting
MOST_DISTANT = 2.0**100


@dataclass(frozen=True, slots=True)
class DepthRule:
    """Which fragment is nearer: the comparison (ties go to the one drawn later) and the value of empty depth."""

    comparison: str
    empty: float


class Window(NamedTuple):
    """Which drawn pixels of a picture are drawn: the first column and row (negative in a margin), and how many."""

    left: int
    top: int
    width: int
    height: int


@dataclass(frozen=True, slots=True)
class Instant:
    """When and from where a pass looks.

    Attributes
    ----------
    frame : int
    fraction : float
        Time within the frame interval, see `motion`.
    jitter : (x, y)
        In drawn pixels, right and down: what is drawn at a pixel's centre is the picture at the centre plus the jitter.
    lens : (a, b)
        Where on the lens, in units of its radius along right and up.
    interpolated : bool
        Objects move linearly between their matrices at the begin and the end of the frame interval.
    """

    frame: int
    fraction: float
    jitter: tuple[float, float] = (0.0, 0.0)
    lens: tuple[float, float] = (0.0, 0.0)
    interpolated: bool = False


def pass_view(scene: Scene, instant: Instant, size: tuple[int, int]) -> View:
    """Return the camera's view of a pass for a picture of `size` drawn pixels."""
    camera, frame, fraction = scene.camera, instant.frame, instant.fraction
    view = view_at(camera, scene.animation, frame, fraction, size)
    if camera.lens_radius > 0.0:
        a, b = (camera.lens_radius * c for c in instant.lens)
        view = lens_view(view, a, b, focus_at(camera, scene.animation, frame, fraction))
    return view


def depth_rule(camera: Camera) -> DepthRule:
    """Return the depth comparison that belongs to `clip_matrices` of this camera."""
    return DepthRule(">=", 0.0) if camera.projection == "perspective" else DepthRule("<=", 1.0)


def clip_matrices(
    scene: Scene, placement: Placement, instant: Instant, *, size: tuple[int, int], window: Window
) -> FloatArray:
    """Return (n, 4, 4) float64 matrices from each body's vertices to the clip space of a window of the picture.

    Parameters
    ----------
    placement : Placement
        The scene's bodies.
    size : (width, height)
        Of the whole picture in drawn pixels.

    Raises
    ------
    InputError
        If something is so far away, or the picture so small a part of the world, that float32 cannot hold it.
    """
    # what overflows is refused below
    with np.errstate(over="ignore", invalid="ignore"):
        out, farthest = _compose(scene, placement, instant, size, window)
    if not farthest <= MOST_DISTANT:
        raise InputError(
            f"frame {instant.frame}: the scene reaches {farthest:.3g} world units from the camera; "
            f"the rasterizer draws up to {MOST_DISTANT:.3g}"
        )
    if not np.isfinite(out).all() or np.abs(out).max(initial=0.0) > MOST_DISTANT**2:
        raise InputError(
            f"frame {instant.frame}: the scene reaches {farthest:.3g} world units from the camera, "
            "too many pictures wide for the rasterizer; use a larger height or fov_y_deg"
        )
    return out


def _compose(
    scene: Scene, placement: Placement, instant: Instant, size: tuple[int, int], window: Window
) -> tuple[FloatArray, float]:
    """Return the matrices of `clip_matrices` and the farthest that anything may be from the camera."""
    view = pass_view(scene, instant, size)
    local = body_matrices(
        placement, scene.animation, instant.frame, instant.fraction, view.origin, interpolated=instant.interpolated
    )
    farthest = _farthest(placement, local)
    clip = np.repeat(view_matrix(view, farthest, instant.jitter, window)[None], len(local), axis=0)
    if view.perspective:
        # layer k is nearer by k steps of its distance: only the row of depth changes, never where a point is drawn
        clip[:, 2] /= (1.0 - LAYER_STEP * placement.layers)[:, None]
    out: FloatArray = clip @ local
    return out, farthest


def layer_tilts(scene: Scene, placement: Placement, instant: Instant, size: tuple[int, int]) -> FloatArray:
    """Return (n,): what is added to each body's depth values for its layer's tilt (see `geometry`).

    A share that grows with depth is a constant of what is one over it. Under parallel rays a layer is brought nearer by
    a share of the greatest depth, and no more.
    """
    if not placement.layers.any():
        return np.zeros(len(placement.layers))
    view = pass_view(scene, instant, size)
    local = body_matrices(
        placement, scene.animation, instant.frame, instant.fraction, view.origin, interpolated=instant.interpolated
    )
    farthest = _farthest(placement, local)
    if not view.perspective:
        return placement.layers * (-LAYER_STEP * layered_depth(placement.layered, view) / (_FAR * farthest))
    heights = np.maximum(_eye_heights(placement.planes, local), _LEAST_HEIGHT * farthest)
    out: FloatArray = placement.tilts * (_NEAR * farthest / heights)
    return out


def _farthest(placement: Placement, local: FloatArray) -> float:
    # Frobenius norm: no direction is stretched by more
    reach = np.linalg.norm(local[:, :3, 3], axis=1) + placement.radii * np.linalg.norm(local[:, :3, :3], axis=(1, 2))
    return max(float(reach.max(initial=0.0)), _LEAST_DISTANT)


def _eye_heights(planes: FloatArray, local: FloatArray) -> FloatArray:
    """Return (n,): how far the eye is from planes of bodies, which `local` (n, 4, 4) places relative to the eye."""
    a, b, c = (local[:, :3, k] for k in range(3))
    n = planes[:, :3, None]
    # a plane's normal is turned by the cofactors, also by a matrix that squeezes a body flat
    ab, bc, ca = np.cross(a, b), np.cross(b, c), np.cross(c, a)
    normals = bc * n[:, 0] + ca * n[:, 1] + ab * n[:, 2]
    lengths = np.linalg.norm(normals, axis=1)
    distance = np.abs((normals * local[:, :3, 3]).sum(axis=1) + (a * bc).sum(axis=1) * planes[:, 3])
    out: FloatArray = np.divide(distance, lengths, out=np.full_like(lengths, np.inf), where=lengths > 0.0)
    return out


def view_matrix(view: View, farthest: float, jitter: tuple[float, float], window: Window) -> FloatArray:
    """Return the (4, 4) matrix to clip space from world coordinates relative to the eye, none above `farthest`."""
    camera = np.eye(4)
    camera[:3, :3] = np.stack([view.right, view.up, view.forward])
    out: FloatArray = _projection(view, farthest, jitter, window) @ camera
    return out


def _projection(view: View, farthest: float, jitter: tuple[float, float], window: Window) -> FloatArray:
    """Return the (4, 4) matrix from (right, up, forward, 1) to clip space."""
    across, down = 2 / window.width, 2 / window.height
    sx, sy = across * view.scale, -down * view.scale
    # where the axis meets the window, differences of whole numbers first: exactly 0 in the middle
    jx = (view.width - 2 * window.left - window.width) / window.width - across * jitter[0]
    jy = (view.height - 2 * window.top - window.height) / window.height - down * jitter[1]
    if view.perspective:
        near = _NEAR * farthest
        return np.array([[sx, 0, jx, 0], [0, sy, jy, 0], [0, 0, 0, near], [0, 0, 1, 0]])
    return np.array([[sx, 0, 0, jx], [0, sy, 0, jy], [0, 0, 1 / (_FAR * farthest), 0], [0, 0, 0, 1]])


def pack_matrices(matrices: FloatArray, row_length: int, rows: int) -> NDArray[np.float32]:
    """Return (rows, 4 * row_length, 4) float32: the columns of every matrix, `row_length` matrices a row."""
    out = np.zeros((rows * row_length, 4, 4), np.float32)
    out[: len(matrices)] = matrices.transpose(0, 2, 1)
    return out.reshape(rows, 4 * row_length, 4)
