"""Where all bodies are at one time, computed for all of them at once.

The same arithmetic as `motion.object_matrix`, which a test compares; called body by body and pass by pass, that would
take longer than drawing hundreds of bodies does.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aliasbench.renderers.geometry import Body, layered_corners
from aliasbench.scenes.model import Animation, FloatArray, Spin, read_only
from aliasbench.scenes.motion import object_matrix

_STILL = Spin((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """The motions of n bodies as arrays.

    Attributes
    ----------
    origins, radii : (n, 3), (n,) float64
        Every body's origin at rest, and the largest distance of its vertices from it.
    layers : (n,) float64
    planes, tilts : (n, 4), (n,) float64
        Those of layers above 0, see `geometry.Body`.
    layered : (m, 3, 3) float64
        See `geometry.layered_corners`.
    velocities, axes, centers : (n, 3) float64
    rates : (n,) float64
        Revolutions per second.
    by_matrices : tuple of int
        The bodies that are moved by two matrices instead.
    """

    bodies: tuple[Body, ...]
    origins: FloatArray
    radii: FloatArray
    layers: FloatArray
    planes: FloatArray
    tilts: FloatArray
    layered: FloatArray
    velocities: FloatArray
    axes: FloatArray
    centers: FloatArray
    rates: FloatArray
    by_matrices: tuple[int, ...]


def make_placement(bodies: Sequence[Body]) -> Placement:
    """Return the motions of bodies, ready for `body_matrices`."""
    spins = [b.motion.spin or _STILL for b in bodies]
    axes = np.array([s.axis for s in spins]).reshape(-1, 3)
    return Placement(
        tuple(bodies),
        read_only(np.array([b.origin for b in bodies]).reshape(-1, 3)),
        read_only(np.array([float(np.linalg.norm(b.vertices, axis=1).max(initial=0.0)) for b in bodies])),
        read_only(np.array([float(b.layer) for b in bodies])),
        read_only(np.array([b.plane for b in bodies]).reshape(-1, 4)),
        read_only(np.array([b.tilt for b in bodies])),
        read_only(layered_corners(bodies)),
        read_only(np.array([b.motion.velocity for b in bodies]).reshape(-1, 3)),
        read_only(axes / np.linalg.norm(axes, axis=1, keepdims=True)),
        read_only(np.array([s.center for s in spins]).reshape(-1, 3)),
        read_only(np.array([s.rev_per_s for s in spins])),
        tuple(i for i, b in enumerate(bodies) if b.motion.matrices is not None),
    )


def body_matrices(
    p: Placement, animation: Animation, frame: int, fraction: float, eye: FloatArray, *, interpolated: bool = False
) -> FloatArray:
    """Return (n, 4, 4) float64 matrices from each body's vertices to the world relative to `eye` at a time.

    `interpolated` matrices are the lecture's: between those at the begin and the end of the frame interval, linearly.
    """
    if interpolated:
        begin, end = (body_matrices(p, animation, frame, f, eye) for f in (0.0, 1.0))
        between: FloatArray = (1.0 - fraction) * begin + fraction * end
        return between
    rotations = _rotations(p, animation, frame, fraction)
    t = (frame + fraction) / animation.fps
    out = np.zeros((len(p.bodies), 4, 4))
    out[:, :3, :3] = rotations
    # R (origin - c) + c + v t: differences first, so that nothing large is added and taken off again
    turned = np.einsum("nij,nj->ni", rotations, p.origins - p.centers)
    out[:, :3, 3] = turned + (p.centers - eye) + p.velocities * t
    out[:, 3, 3] = 1.0
    for i in p.by_matrices:
        out[i] = p.bodies[i].local_matrix(object_matrix(p.bodies[i].motion, animation, frame, fraction), eye)
    return out


def _rotations(p: Placement, animation: Animation, frame: int, fraction: float) -> FloatArray:
    """Return (n, 3, 3) rotations; quarter turns are taken off in revolutions and are exact."""
    if not p.rates.any():
        return np.repeat(np.eye(3)[None], len(p.bodies), axis=0)  # what the rest comes to, too, for each of many passes
    per_frame = p.rates / animation.fps
    turns = np.fmod(per_frame * frame, 1.0) + per_frame * fraction
    reduced = turns - np.round(turns)
    quarter = np.round(reduced * 4.0)
    rest = 2.0 * np.pi * (reduced - quarter / 4.0)
    which = quarter.astype(np.int64) % 4
    cq, sq = np.array([1.0, 0.0, -1.0, 0.0])[which], np.array([0.0, 1.0, 0.0, -1.0])[which]
    c0, s0 = np.cos(rest), np.sin(rest)
    c, s = c0 * cq - s0 * sq, s0 * cq + c0 * sq
    x, y, z = p.axes.T
    cross = np.zeros((len(p.bodies), 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -z, y, -x
    cross[:, 1, 0], cross[:, 2, 0], cross[:, 2, 1] = z, -y, x
    along = p.axes[:, :, None] * p.axes[:, None, :]
    out: FloatArray = c[:, None, None] * np.eye(3) + s[:, None, None] * cross + (1.0 - c)[:, None, None] * along
    return out
