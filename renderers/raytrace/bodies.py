"""Bodies that move while the shutter is open: every ray is taken into the body's own frame at the ray's own time.

Embree can move instances itself, but a spinning instance costs 50 to 60 ns a sample against some 15 here (transform
and a second traversal), and interpolates in float32 between at most 129 poses; this is exact at any number of turns,
needs no rebuilding between frames, and lets both engines trace the same rays. The price grows with the number of moving
bodies that a pixel may see, hence each has the rectangle of the picture that it can reach.

A body's point b lies at x = R(t)(b + pivot) + a0 + a1 t relative to the anchor, t in [0, 1) over the shutter (spin and
velocity), or at x = (M0 + t M1) b + a0 + a1 t (two matrices). Of coplanar bodies the higher layer wins: depths at which
rays meet it are compared as if it were nearer (`nearer`), wherever they come from.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.geometry import LAYER_STEP, Body
from aliasbench.renderers.kernel_parts import called, inlined
from aliasbench.renderers.raytrace.lanes import (
    DX,
    DY,
    DZ,
    LANES,
    LX,
    LY,
    LZ,
    MX,
    MY,
    MZ,
    OX,
    OY,
    OZ,
    RAY_DX,
    RAY_DY,
    RAY_DZ,
    RAY_OX,
    RAY_OY,
    RAY_OZ,
    RAY_TFAR,
    TIME,
)
from aliasbench.renderers.sampling.trig import cos_turns, sin_turns
from aliasbench.scenes.model import Animation, FloatArray, Motion, Scene
from aliasbench.scenes.motion import object_matrix, spin_turns
from aliasbench.scenes.projection import View

# Values of a body: kind, axis, turns at opening, turns over the shutter, a0, a1, pivot; or M0 and M1; rectangle; and
# how its layer is brought nearer, by a share of the depth, one that grows with depth, and a distance.
KIND, SPIN_AXIS, TURNS, TURNS_TRAVEL, SHIFT, SHIFT_TRAVEL, PIVOT = 0, 1, 4, 5, 6, 9, 12
MATRIX, MATRIX_TRAVEL, BOUNDS = 16, 25, 34
STEP, TILT, SLIDE = 38, 39, 40
BODY_SIZE = 41
RIGID, LINEAR = 0.0, 1.0
LEAST_HEIGHT = 2.0**-20  # of an eye above a plane, of how far the plane reaches: nearer, it is seen as a line


@dataclass(frozen=True, slots=True, eq=False)
class Shutter:
    """One exposure: the views at its opening and closing, the fractions of the frame interval where they are, and how
    objects move between.
    """

    frame: int
    opening: float
    closing: float
    first: View
    last: View
    layer_depth: float
    lens_radius: float = 0.0
    interpolated: bool = False

    def place(self, motion: Motion, animation: Animation, fraction: float) -> FloatArray:
        """Return the (4, 4) matrix of an object at a fraction of the frame interval.

        `interpolated` is the lecture's motion: between its matrices at the begin and the end of the frame interval,
        linearly.
        """
        if not self.interpolated:
            return object_matrix(motion, animation, self.frame, fraction)
        begin, end = (object_matrix(motion, animation, self.frame, f) for f in (0.0, 1.0))
        return (1.0 - fraction) * begin + fraction * end


def body_values(scene: Scene, body: Body, shutter: Shutter, anchor: FloatArray) -> FloatArray:
    """Return the (BODY_SIZE,) values of one body over one exposure."""
    out = np.zeros(BODY_SIZE)
    motion, animation = body.motion, scene.animation
    ends = [
        body.local_matrix(shutter.place(motion, animation, fraction), anchor)
        for fraction in (shutter.opening, shutter.closing)
    ]
    if body.layer:
        step = body.layer * LAYER_STEP * shutter.layer_depth
        if shutter.first.perspective:
            out[STEP], out[TILT] = step, _tilt(body, ends, shutter, anchor)
        else:
            out[SLIDE] = step
    if motion.spin is not None and not shutter.interpolated:
        pivot = np.asarray(motion.spin.center, dtype=np.float64)
        pivot_ends = [m[:3, :3] @ (pivot - body.origin) + m[:3, 3] for m in ends]
        axis = np.asarray(motion.spin.axis, dtype=np.float64)
        out[KIND] = RIGID
        out[SPIN_AXIS : SPIN_AXIS + 3] = axis / np.linalg.norm(axis)
        out[TURNS] = spin_turns(motion.spin, animation, shutter.frame, shutter.opening)
        out[TURNS_TRAVEL] = motion.spin.rev_per_s / animation.fps * (shutter.closing - shutter.opening)
        out[SHIFT : SHIFT + 3] = pivot_ends[0]
        out[SHIFT_TRAVEL : SHIFT_TRAVEL + 3] = pivot_ends[1] - pivot_ends[0]
        out[PIVOT : PIVOT + 3] = body.origin - pivot
    else:
        out[KIND] = LINEAR
        out[MATRIX : MATRIX + 9] = ends[0][:3, :3].ravel()
        out[MATRIX_TRAVEL : MATRIX_TRAVEL + 9] = (ends[1] - ends[0])[:3, :3].ravel()
        out[SHIFT : SHIFT + 3] = ends[0][:3, 3]
        out[SHIFT_TRAVEL : SHIFT_TRAVEL + 3] = (ends[1] - ends[0])[:3, 3]
    out[BOUNDS : BOUNDS + 4] = _image_bounds(body, ends, shutter, anchor, out)
    return out


def _tilt(body: Body, ends: list[FloatArray], shutter: Shutter, anchor: FloatArray) -> float:
    """Return the share, for each unit of depth, by which a layer is nearer where rays graze its plane."""
    heights, reach = [], float(np.abs(body.vertices).max())
    for matrix, view in zip(ends, (shutter.first, shutter.last), strict=True):
        place = matrix[:3, 3] - (view.origin - anchor)
        turn: FloatArray = matrix[:3, :3]
        if shutter.interpolated or body.motion.matrices is not None:
            if np.linalg.det(turn) == 0.0:
                return 0.0  # squeezed flat, its rays hit nothing
            turn = np.asarray(np.linalg.inv(turn).T, dtype=np.float64)
        normal = turn @ body.plane[:3]
        heights.append(abs(float(normal @ place) + float(body.plane[3])) / math.sqrt(float(normal @ normal)))
        reach = max(reach, float(np.abs(place).max()))
    # in the plane but for rounding, it is seen as a line
    height = max(min(heights), LEAST_HEIGHT * reach)
    return body.tilt * shutter.layer_depth / height if height > 0.0 else 0.0


def _image_bounds(
    body: Body, ends: list[FloatArray], shutter: Shutter, anchor: FloatArray, values: FloatArray
) -> tuple[float, float, float, float]:
    """Return left, right, top and bottom in pixels of where the body can be seen; everything where that is unknown.

    Points move on straight lines relative to a camera that does not turn, so the ends of their paths bound them. What
    spins is bounded by the sphere about its pivot.
    """
    everywhere = (-np.inf, np.inf, -np.inf, np.inf)
    views = (shutter.first, shutter.last)
    if shutter.lens_radius > 0.0:
        return everywhere  # a lens sees it elsewhere
    if not np.array_equal(views[0].forward, views[1].forward) or not len(body.vertices):
        return everywhere
    low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
    if values[KIND] == RIGID:
        radius = float(np.linalg.norm(body.vertices + values[PIVOT : PIVOT + 3], axis=1).max())
        signs = np.stack(np.meshgrid(*[(-radius, radius)] * 3), axis=-1).reshape(8, 3)
        places = [values[SHIFT : SHIFT + 3] + share * values[SHIFT_TRAVEL : SHIFT_TRAVEL + 3] for share in (0.0, 1.0)]
        corners = [anchor + place + signs for place in places]
    else:
        box = np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1).reshape(8, 3)
        corners = [anchor + box @ m[:3, :3].T + m[:3, 3] for m in ends]
    local = [view.to_camera(points) for view, points in zip(views, corners, strict=True)]
    if views[0].perspective and min(float(p[:, 2].min()) for p in local) <= 0.0:
        return everywhere
    image = np.concatenate([view.project(points) for view, points in zip(views, corners, strict=True)])
    left, top = image[:, :2].min(axis=0) - 1.0
    right, bottom = image[:, :2].max(axis=0) + 1.0
    return float(left), float(right), float(top), float(bottom)


@inlined
def turn_back(values: FloatArray, c: float, s: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return R^T (x, y, z) for the rotation by (cosine, sine) about the body's axis (Rodrigues)."""
    kx, ky, kz = values[SPIN_AXIS], values[SPIN_AXIS + 1], values[SPIN_AXIS + 2]
    along = (1.0 - c) * (kx * x + ky * y + kz * z)
    return (
        c * x - s * (ky * z - kz * y) + along * kx,
        c * y - s * (kz * x - kx * z) + along * ky,
        c * z - s * (kx * y - ky * x) + along * kz,
    )


@inlined
def _rigid_lane(values: FloatArray, scratch: FloatArray, i: int) -> None:
    time = scratch[TIME + i]
    turns = values[TURNS] + time * values[TURNS_TRAVEL]
    c, s = cos_turns(turns), sin_turns(turns)
    x = scratch[OX + i] - values[SHIFT] - time * values[SHIFT_TRAVEL]
    y = scratch[OY + i] - values[SHIFT + 1] - time * values[SHIFT_TRAVEL + 1]
    z = scratch[OZ + i] - values[SHIFT + 2] - time * values[SHIFT_TRAVEL + 2]
    lx, ly, lz = turn_back(values, c, s, x, y, z)
    scratch[LX + i], scratch[LY + i], scratch[LZ + i] = (
        lx - values[PIVOT],
        ly - values[PIVOT + 1],
        lz - values[PIVOT + 2],
    )
    mx, my, mz = turn_back(values, c, s, scratch[DX + i], scratch[DY + i], scratch[DZ + i])
    scratch[MX + i], scratch[MY + i], scratch[MZ + i] = mx, my, mz


@inlined
def _linear_lane(values: FloatArray, scratch: FloatArray, i: int) -> None:
    time = scratch[TIME + i]
    m00 = values[MATRIX] + time * values[MATRIX_TRAVEL]
    m01 = values[MATRIX + 1] + time * values[MATRIX_TRAVEL + 1]
    m02 = values[MATRIX + 2] + time * values[MATRIX_TRAVEL + 2]
    m10 = values[MATRIX + 3] + time * values[MATRIX_TRAVEL + 3]
    m11 = values[MATRIX + 4] + time * values[MATRIX_TRAVEL + 4]
    m12 = values[MATRIX + 5] + time * values[MATRIX_TRAVEL + 5]
    m20 = values[MATRIX + 6] + time * values[MATRIX_TRAVEL + 6]
    m21 = values[MATRIX + 7] + time * values[MATRIX_TRAVEL + 7]
    m22 = values[MATRIX + 8] + time * values[MATRIX_TRAVEL + 8]
    a, b, c = m11 * m22 - m12 * m21, m12 * m20 - m10 * m22, m10 * m21 - m11 * m20
    det = m00 * a + m01 * b + m02 * c
    # A body squeezed flat has no frame to go to; its rays are sent along no direction and hit nothing.
    inverse = 1.0 / det if det != 0.0 else 0.0
    d, e, f = m02 * m21 - m01 * m22, m00 * m22 - m02 * m20, m01 * m20 - m00 * m21
    g, h, k = m01 * m12 - m02 * m11, m02 * m10 - m00 * m12, m00 * m11 - m01 * m10
    x = inverse * (scratch[OX + i] - values[SHIFT] - time * values[SHIFT_TRAVEL])
    y = inverse * (scratch[OY + i] - values[SHIFT + 1] - time * values[SHIFT_TRAVEL + 1])
    z = inverse * (scratch[OZ + i] - values[SHIFT + 2] - time * values[SHIFT_TRAVEL + 2])
    scratch[LX + i] = a * x + d * y + g * z
    scratch[LY + i] = b * x + e * y + h * z
    scratch[LZ + i] = c * x + f * y + k * z
    x, y, z = inverse * scratch[DX + i], inverse * scratch[DY + i], inverse * scratch[DZ + i]
    scratch[MX + i] = a * x + d * y + g * z
    scratch[MY + i] = b * x + e * y + h * z
    scratch[MZ + i] = c * x + f * y + k * z


@inlined
def to_body(values: FloatArray, scratch: FloatArray) -> None:
    """Write the rays of all 16 lanes in the body's frame, in float64, each at its own time."""
    if values[KIND] == RIGID:
        for i in range(LANES):
            _rigid_lane(values, scratch, i)
    else:
        for i in range(LANES):
            _linear_lane(values, scratch, i)


@called
def lane_to_body(values: FloatArray, scratch: FloatArray, i: int) -> None:
    """Write the ray of one lane in the body's frame."""
    if values[KIND] == RIGID:
        _rigid_lane(values, scratch, i)
    else:
        _linear_lane(values, scratch, i)


@inlined
def nearer(values: FloatArray, start: float, t: float) -> float:
    """Return where a hit of a body counts, for rays that start at a depth."""
    depth = start + t
    return depth / (1.0 + values[STEP] + values[TILT] * depth) - values[SLIDE] - start


@inlined
def farther(values: FloatArray, start: float, t: float) -> float:
    """Return where a body must be hit to count at t: the inverse of `nearer`."""
    depth = start + t + values[SLIDE]
    rest = 1.0 - values[TILT] * depth if t < np.inf else 0.0
    return depth * (1.0 + values[STEP]) / rest - start if rest > 0.0 else np.inf


@inlined
def has_layer(values: FloatArray) -> bool:
    """Return whether a body is brought nearer."""
    return values[STEP] > 0.0 or values[SLIDE] > 0.0


@inlined
def fill_body_rays(scratch: FloatArray, ray: NDArray[np.float32], body_ray: NDArray[np.float32], start: float) -> None:
    """Write the rays in the body's frame as Embree takes them, from a depth on, to the packet's nearest hits."""
    for i in range(LANES):
        body_ray[RAY_OX + i] = np.float32(scratch[LX + i] + start * scratch[MX + i])
        body_ray[RAY_OY + i] = np.float32(scratch[LY + i] + start * scratch[MY + i])
        body_ray[RAY_OZ + i] = np.float32(scratch[LZ + i] + start * scratch[MZ + i])
        body_ray[RAY_DX + i] = np.float32(scratch[MX + i])
        body_ray[RAY_DY + i] = np.float32(scratch[MY + i])
        body_ray[RAY_DZ + i] = np.float32(scratch[MZ + i])
        body_ray[RAY_TFAR + i] = ray[RAY_TFAR + i]


@inlined
def may_see(values: FloatArray, left: float, right: float, top: float, bottom: float) -> bool:
    """Return whether a rectangle of the picture may see the body."""
    return (
        right >= values[BOUNDS]
        and left <= values[BOUNDS + 1]
        and bottom >= values[BOUNDS + 2]
        and top <= values[BOUNDS + 3]
    )
