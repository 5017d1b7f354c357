"""A glTF animation as the motions of this project, where it is one: constant velocity, constant rotation.

The model moves things along straight lines and about fixed axes, exactly, at any time. Keys that are joined LINEARly
and lie on one such path say just that; they become it, and what does not (a curve, a change of pace, a scaling, STEP
and CUBICSPLINE) is left in its first pose. Of several animations the first one counts. Times count from the first key.

Keys are float32. A path is recognised up to their rounding, and what they must have been meant to be is restored: turns
over the whole animation are rounded to a degree where they are within a few millionths of one, so that loops close.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.gltf_document import Document, as_reals, entries
from aliasbench.scenes.limits import LENGTH
from aliasbench.scenes.model import FloatArray, Vec3, as_vec3
from aliasbench.scenes.schema import Table

_WIDTH: Mapping[str, int] = {"translation": 3, "rotation": 4, "scale": 3}
_PATHS = (*_WIDTH, "weights", "pointer")
_SAME = 2e-5  # of a path's extent: how far from it keys may lie
_SHORTEST_S, _LONGEST_S = 1e-3, 3600.0
_SNAP = 3e-6  # turns
_MOST_KEYS = 10_000_000  # of all channels that differ: some seconds


@dataclass(frozen=True, slots=True)
class LocalMotion:
    """How a node moves in its parent: the velocity of its origin, and turns per second about an axis through it."""

    velocity: Vec3 = (0.0, 0.0, 0.0)
    axis: Vec3 = (0.0, 0.0, 1.0)
    rev_per_s: float = 0.0


@dataclass(frozen=True, slots=True)
class NodeAnimation:
    """What an animation says of one node.

    Attributes
    ----------
    pose : mapping of str to tuple of float
        ``translation``, ``rotation`` and ``scale`` at the first key, those that are animated.
    motion : LocalMotion or None
        None where the node stays in its first pose.
    """

    pose: Mapping[str, tuple[float, ...]]
    motion: LocalMotion | None


@dataclass(frozen=True, slots=True)
class _Channel:
    """What the keys of one path come to; they themselves are let go, since a file may have many."""

    start: float
    end: float
    first: tuple[float, ...]
    is_constant: bool
    motion: LocalMotion | None  # None where they are no steady motion


def read_animation(document: Document) -> tuple[dict[int, NodeAnimation], float]:
    """Return what the file's first animation says of each node, and its duration in seconds (0: there is none)."""
    if not document.lists["animations"]:
        return {}, 0.0
    animation = document.lists["animations"][0]
    samplers = entries(animation, "samplers")
    channels: dict[int, dict[str, _Channel]] = {}
    known: dict[tuple[object, ...], _Channel] = {}
    keys = 0
    for channel in entries(animation, "channels"):
        target = channel.table("target")
        path = target.choice("path", _PATHS, "weights")
        found = document.follow(target, "node", "nodes")
        if found is None or path not in _WIDTH:
            continue
        index = channel.whole("sampler", at_least=0)
        if index >= len(samplers):
            channel.refuse("sampler", f"an index of its samplers, of which there are {len(samplers)}")
        sampler = samplers[index]
        # Many channels may have the same keys, and many samplers.
        content = (path, *(str(sampler.values.get(key)) for key in ("input", "output", "interpolation")))
        if content not in known:
            times = document.follow(sampler, "input", "accessors")
            keys += 0 if times is None else times[1].whole("count", at_least=1)
            if keys > _MOST_KEYS:
                raise InputError(
                    f"{animation.file}: {animation.path}: has more than {_MOST_KEYS} keys; fewer are allowed"
                )
            known[content] = _read_channel(document, sampler, path)
        channels.setdefault(found[0], {})[path] = known[content]
    every = [c for paths in channels.values() for c in paths.values()]
    if not every:
        return {}, 0.0
    start, end = min(c.start for c in every), max(c.end for c in every)
    playable = _SHORTEST_S <= end - start <= _LONGEST_S
    return {
        node: NodeAnimation(
            {path: c.first for path, c in paths.items()},
            _motion(paths, start, end) if playable else None,
        )
        for node, paths in channels.items()
    }, end - start if playable else 0.0


def _read_channel(document: Document, sampler: Table, path: str) -> _Channel:
    place = f"{sampler.file}: {sampler.path}"
    times = as_reals(document.accessor(sampler, "input", ("SCALAR",))[:, 0])
    values = as_reals(document.accessor(sampler, "output", ("VEC3", "VEC4")))
    kind = sampler.choice("interpolation", ("LINEAR", "STEP", "CUBICSPLINE"), "LINEAR")
    if values.shape[1] != _WIDTH[path]:
        raise InputError(f"{place}: {path} needs values of {_WIDTH[path]} numbers, not {values.shape[1]}")
    if kind == "CUBICSPLINE" and len(values) == 3 * len(times):
        # In-tangent, value, out-tangent at each key.
        values = values[1::3]
    if len(values) != len(times):
        raise InputError(f"{place}: has {len(times)} keys and {len(values)} values; one for each is needed")
    # Not (x <= limit), so that a NaN is caught by the one comparison.
    if not (np.abs(values) <= LENGTH).all() or not (np.abs(times) <= LENGTH).all() or not (np.diff(times) > 0).all():
        raise InputError(f"{place}: needs times in increasing order and finite values up to {LENGTH:g}")
    if path == "rotation":
        lengths = np.linalg.norm(values, axis=1, keepdims=True)
        if not (lengths > 0.5).all():
            raise InputError(
                f"{place}: has a quaternion of length {float(lengths.min()):g}; unit quaternions are needed"
            )
        values = values / lengths
    motion = None
    if kind == "LINEAR" and len(times) > 1:
        motion = (
            _velocity(times, values)
            if path == "translation"
            else _turning(times, values)
            if path == "rotation"
            else None
        )
    first: tuple[float, ...] = tuple(values[0].tolist())
    return _Channel(float(times[0]), float(times[-1]), first, _is_constant(values), motion)


def _motion(paths: Mapping[str, _Channel], start: float, end: float) -> LocalMotion | None:
    """Return the one motion of a node's channels, None where they are none."""
    out = LocalMotion()
    for path, channel in paths.items():
        if channel.is_constant:
            continue
        covers = channel.start - start <= _SAME * (end - start) and end - channel.end <= _SAME * (end - start)
        if channel.motion is None or not covers:
            return None
        if path == "translation":
            out = replace(out, velocity=channel.motion.velocity)
        else:
            out = replace(out, axis=channel.motion.axis, rev_per_s=channel.motion.rev_per_s)
    return out


def _is_constant(values: FloatArray) -> bool:
    first = values[0]
    return bool(np.abs(values - first).max() <= 1e-6 * max(float(np.abs(first).max()), 1e-6))


def _velocity(times: FloatArray, values: FloatArray) -> LocalMotion | None:
    t = times - times[0]
    x = values - values[0]
    velocity = x[-1] / t[-1]
    rounding = 1e-6 * np.abs(values).max() + _SAME * np.abs(x).max()
    if np.abs(x - t[:, None] * velocity).max() > rounding or not velocity.any():
        return None
    return LocalMotion(velocity=as_vec3(velocity))


def _turning(times: FloatArray, values: FloatArray) -> LocalMotion | None:
    """Return the rotation of quaternion keys (x, y, z, w) at a constant rate."""
    v0, w0 = values[:-1, :3], values[:-1, 3:]
    v1, w1 = values[1:, :3], values[1:, 3:]
    # q1 times the conjugate of q0: what turns the one into the other, in the parent's axes
    vector = w0 * v1 - w1 * v0 - np.cross(v1, v0)
    scalar = (w0 * w1)[:, 0] + (v0 * v1).sum(axis=1)
    # The specification's interpolation takes the shorter way; half a turn has none and goes as the keys' signs say.
    vector = np.where((scalar < -1e-6)[:, None], -vector, vector)
    sines = np.linalg.norm(vector, axis=1)
    angles = 2 * np.arctan2(sines, np.abs(scalar))
    total, dt = float(angles.sum()), np.diff(times)
    mean = vector.sum(axis=0)
    length = float(np.linalg.norm(mean))
    duration = float(times[-1] - times[0])
    if length < 0.999 * float(sines.sum()) or length == 0.0:
        return None
    axis = mean / length
    off = np.abs(vector - sines[:, None] * axis).max()
    uneven = np.abs(angles - total * dt / duration).max()
    if off > 1e-5 or uneven > 1e-5 + 1e-4 * total / len(dt):
        return None
    turns = total / (2 * math.pi)
    degrees = round(turns * 360)
    if abs(turns - degrees / 360) < _SNAP:
        turns = degrees / 360
    x, y, z = np.where(np.abs(axis) < 1e-6, 0.0, axis).tolist()
    size = math.hypot(x, y, z)
    return LocalMotion(axis=(x / size, y / size, z / size), rev_per_s=turns / duration)
