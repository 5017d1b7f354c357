"""Where things are at a given time: float64, exact at any time and for any number of turns.

A time is a pair (frame, fraction): t = (frame + fraction) / fps, fraction 0 when the shutter opens. Keeping the pair,
instead of t alone, is what lets the two-matrix form start anew with every frame, and keeps fractions exact at large
frame numbers.
"""

import numpy as np

from aliasbench.scenes.model import Animation, FloatArray, Motion, Spin


def shutter_fraction(animation: Animation, u: float) -> float:
    """Return the fraction of the frame interval at which a sample u in [0, 1) of the open shutter lies."""
    return u * animation.shutter


def rotation_matrix(axis: tuple[float, float, float], turns: float) -> FloatArray:
    """Return the (3, 3) right-handed rotation by `turns` revolutions about `axis` (any length but zero).

    Whole and quarter turns are exact: the angle is reduced in revolutions before anything is multiplied by pi.
    """
    a = np.asarray(axis, dtype=np.float64)
    x, y, z = a / np.linalg.norm(a)
    reduced = turns - np.round(turns)
    quarter = np.round(reduced * 4.0)
    rest = 2.0 * np.pi * (reduced - quarter / 4.0)
    c0, s0 = np.cos(rest), np.sin(rest)
    cq, sq = ((1, 0), (0, 1), (-1, 0), (0, -1))[int(quarter) % 4]
    c, s = c0 * cq - s0 * sq, s0 * cq + c0 * sq
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    out: FloatArray = c * np.eye(3) + s * k + (1.0 - c) * np.outer((x, y, z), (x, y, z))
    return out


def spin_turns(spin: Spin, animation: Animation, frame: int, fraction: float) -> float:
    """Return the revolutions since t = 0, with the whole turns of the frame number taken out exactly."""
    per_frame = spin.rev_per_s / animation.fps
    whole = np.fmod(per_frame * frame, 1.0)
    return float(whole + per_frame * fraction)


def object_matrix(motion: Motion, animation: Animation, frame: int, fraction: float) -> FloatArray:
    """Return the (4, 4) float64 matrix that takes a world position at rest (t = 0) to its place at the time.

    Parameters
    ----------
    motion : Motion
    animation : Animation
    frame : int
        Frame number, may exceed `animation.frames`.
    fraction : float
        Position within the frame interval; the shutter is open over [0, animation.shutter].
    """
    out = np.eye(4)
    if motion.matrices is not None:
        begin, end = (np.array(m, dtype=np.float64).reshape(4, 4) for m in motion.matrices)
        return (1.0 - fraction) * begin + fraction * end
    if motion.spin is not None:
        c = np.asarray(motion.spin.center, dtype=np.float64)
        r = rotation_matrix(motion.spin.axis, spin_turns(motion.spin, animation, frame, fraction))
        out[:3, :3] = r
        out[:3, 3] = c - r @ c
    t = (frame + fraction) / animation.fps
    out[:3, 3] += np.asarray(motion.velocity) * t
    return out
