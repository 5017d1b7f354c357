"""The node tree of a glTF file: where each mesh and camera is in the world, and how it moves.

Walked with a stack and a set of nodes seen: neither a cycle nor a tree a million nodes deep can hang or overflow.

A node that moves takes its children along. Velocities add up along the tree, and one rotation among them is a spin in
the world if what is above it neither shears nor scales it unevenly; its centre may be carried along by nodes that
only move straight. Of two rotations, one inside the other, no spin is made: what they carry stays in its first pose.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.gltf_animation import LocalMotion, NodeAnimation
from aliasbench.scenes.gltf_document import Document
from aliasbench.scenes.limits import LENGTH
from aliasbench.scenes.model import FloatArray, Motion, Spin, as_vec3
from aliasbench.scenes.schema import Table

_SIMILAR = 1e-5  # how unevenly, relatively, a transform may scale what spins under it


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A node in the world.

    Attributes
    ----------
    node : Table
    matrix : (4, 4) float64
        From the node's coordinates to the world at t = 0.
    motion : Motion
        In the world.
    """

    node: Table
    matrix: FloatArray
    motion: Motion


@dataclass(frozen=True, slots=True, eq=False)
class _Carried:
    matrix: FloatArray
    velocity: FloatArray = field(default_factory=lambda: np.zeros(3))
    spin: Spin | None = None
    frozen: bool = False


def walk_nodes(document: Document, animated: Mapping[int, NodeAnimation]) -> Iterator[Placed]:
    """Yield the nodes of the default scene in depth-first order: a parent before its children, these in their order.

    The default scene is the one that the file names, else its first, else all nodes that are nobody's children.

    Raises
    ------
    InputError
        If a node is reached twice (a cycle, or two parents), or a transform is no finite affine one.
    """
    nodes = document.lists["nodes"]
    seen = np.zeros(len(nodes), dtype=bool)
    stack = [(index, _Carried(np.eye(4))) for index in reversed(_roots(document))]
    while stack:
        index, above = stack.pop()
        node = nodes[index]
        if seen[index]:
            raise InputError(f"{node.file}: {node.path}: is reached twice; nodes must form a tree, without cycles")
        seen[index] = True
        here = _enter(node, above, animated.get(index))
        yield Placed(node, here.matrix, _motion(here))
        stack.extend((child, here) for child in reversed(document.indices(node, "children", "nodes")))


def _roots(document: Document) -> list[int]:
    found = document.follow(document.root, "scene", "scenes")
    scenes = document.lists["scenes"]
    if found is not None or scenes:
        return document.indices(found[1] if found is not None else scenes[0], "nodes", "nodes")
    children = {c for node in document.lists["nodes"] for c in document.indices(node, "children", "nodes")}
    roots = [k for k in range(len(document.lists["nodes"])) if k not in children]
    if not roots and document.lists["nodes"]:
        raise InputError(f"{document.root.file}: nodes: every node is another's child; they must form a tree")
    return roots


def _enter(node: Table, above: _Carried, animated: NodeAnimation | None) -> _Carried:
    matrix = above.matrix @ _local_matrix(node, {} if animated is None else animated.pose)
    if not (np.abs(matrix) <= LENGTH).all():
        raise InputError(f"{node.file}: {node.path}: its transform leads beyond {LENGTH:g}; less is allowed")
    moved = LocalMotion() if animated is None else animated.motion
    if above.frozen or moved is None:
        return _Carried(matrix, frozen=True)
    linear = above.matrix[:3, :3]
    turning = moved.rev_per_s != 0.0
    if above.spin is not None and (turning or any(moved.velocity)):
        return _Carried(matrix, frozen=True)
    velocity = above.velocity + linear @ np.array(moved.velocity)
    spin = above.spin
    if turning:
        gram = linear.T @ linear
        scale = float(np.trace(gram)) / 3
        if not scale > 0.0 or np.abs(gram - scale * np.eye(3)).max() > _SIMILAR * scale:
            return _Carried(matrix, frozen=True)
        # A reflection turns about the reflected axis the other way.
        axis = linear @ np.array(moved.axis) * np.sign(np.linalg.det(linear)) / math.sqrt(scale)
        spin = Spin(as_vec3(axis), as_vec3(matrix[:3, 3]), moved.rev_per_s)
    return _Carried(matrix, velocity, spin)


def _motion(carried: _Carried) -> Motion:
    return Motion() if carried.frozen else Motion(as_vec3(carried.velocity), carried.spin)


def _local_matrix(node: Table, pose: Mapping[str, tuple[float, ...]]) -> FloatArray:
    """Return a node's (4, 4) matrix: its own, or of translation, rotation and scale, those of the pose first."""
    if node.has("matrix") and not pose:
        matrix = np.array(node.numbers("matrix", 16, LENGTH)).reshape(4, 4).T
        if np.abs(matrix[3] - (0.0, 0.0, 0.0, 1.0)).max() > 1e-6:
            node.refuse("matrix", "affine: 16 numbers, column by column, with 0, 0, 0, 1 as the last row")
        return np.vstack([matrix[:3], (0.0, 0.0, 0.0, 1.0)])
    translation = pose.get("translation") or node.vector("translation", (0.0, 0.0, 0.0))
    scale = pose.get("scale") or node.vector("scale", (1.0, 1.0, 1.0))
    x, y, z, w = pose.get("rotation") or _rotation(node)
    out = np.eye(4)
    out[:3, :3] = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    ) * np.array(scale)
    out[:3, 3] = translation
    return out


def _rotation(node: Table) -> tuple[float, ...]:
    if not node.has("rotation"):
        return (0.0, 0.0, 0.0, 1.0)
    quaternion = node.numbers("rotation", 4, 2.0)
    length = math.hypot(*quaternion)
    if length < 0.5:
        node.refuse("rotation", "a unit quaternion, four numbers")
    return tuple(q / length for q in quaternion)
