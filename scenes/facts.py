"""Facts of a scene file, read and checked against the scene: a wrong fact would turn every metric that uses it wrong.

Only geometry and motion can be checked here: an edge must touch an object, a rotor must turn as an
object does, a pan must be how an object moves against the camera. What a fact says about brightness is taken on trust.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aliasbench.scenes.limits import COUNT, LENGTH
from aliasbench.scenes.model import (
    Camera,
    EdgeFact,
    Facts,
    FloatArray,
    GratingFact,
    PanFact,
    RotorFact,
    Spin,
    Surface,
    Vec3,
)
from aliasbench.scenes.schema import Table

_EDGE_POINTS = 33  # of an edge that are looked for on the objects
TOLERANCE = 1e-6  # of lengths relative to the edge's or the scene's size, of rates relative to the rate


def read_facts(table: Table, objects: Sequence[Surface], camera: Camera) -> Facts:
    """Return the facts of the table `fact`, each kind a table or an array of tables.

    Parameters
    ----------
    table : Table
    objects : sequence of Surface
        What facts are checked against; without any, only each by itself.
    camera : Camera

    Raises
    ------
    InputError
        If a fact is incomplete, impossible, or contradicts the objects and the camera.
    """
    table.check_keys(("edge", "rotor", "grating", "pan"))
    edges = _one_or_more(table, "edge")
    solid = _solid(objects) if edges and objects else None
    return Facts(
        edges=tuple(_read_edge(t, solid) for t in edges),
        rotors=tuple(_read_rotor(t, objects) for t in _one_or_more(table, "rotor")),
        gratings=tuple(_read_grating(t) for t in _one_or_more(table, "grating")),
        pans=tuple(_read_pan(t, objects, camera) for t in _one_or_more(table, "pan")),
    )


def _one_or_more(table: Table, key: str) -> list[Table]:
    if isinstance(table.values.get(key), dict):
        return [table.table(key)]
    return table.tables(key)


def _read_edge(table: Table, solid: "_Solid | None") -> EdgeFact:
    table.check_keys(("from", "to"))
    mark = table.problems.mark()
    start, end = table.vector("from"), table.vector("to")
    if start == end and table.problems.sound_since(mark):
        table.report("to", "a point that differs from `from`")
    if solid is not None and table.problems.sound_since(mark) and not _touches(np.array([start, end]), solid):
        table.problems.report(
            table.place, f"{table.path} from {list(start)} to {list(end)} touches no object; it must lie on one"
        )
    return EdgeFact(start, end)


@dataclass(frozen=True, slots=True, eq=False)
class _Solid:
    """The triangles of all objects: a corner, two sides, normal, its square, and how large their object is."""

    corner: FloatArray
    sides: tuple[FloatArray, FloatArray]
    normal: FloatArray
    square: FloatArray
    size: FloatArray
    low: FloatArray
    high: FloatArray


def _solid(objects: Sequence[Surface]) -> _Solid:
    corners = np.concatenate([s.vertices[s.triangles] for s in objects])
    sizes = [np.full(len(s.triangles), np.abs(s.vertices).max(initial=0.0)) for s in objects]
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(u, v)
    square = np.einsum("ij,ij->i", normal, normal)
    keep = square > 0.0
    corners = corners[keep]
    low, high = corners.min(axis=1), corners.max(axis=1)
    return _Solid(corners[:, 0], (u[keep], v[keep]), normal[keep], square[keep], np.concatenate(sizes)[keep], low, high)


def _touches(edge: FloatArray, solid: _Solid) -> bool:
    """Return whether a segment (2, 3) meets an object in some of its points.

    It need not run along an outline: the edge may be one of the texture's.
    """
    close = TOLERANCE * np.maximum(solid.size, np.linalg.norm(edge[1] - edge[0]))
    # Inside is judged with a tolerance too, relative to the triangle.
    margin = close[:, None] + 2 * TOLERANCE * (solid.high - solid.low)
    meets = (solid.low - margin <= edge.max(axis=0)) & (solid.high + margin >= edge.min(axis=0))
    near = np.flatnonzero(meets.all(axis=1))
    points = edge[0] + np.linspace(0.0, 1.0, _EDGE_POINTS)[:, None] * (edge[1] - edge[0])
    u, v, normal, square = solid.sides[0][near], solid.sides[1][near], solid.normal[near], solid.square[near]
    for point in points:
        w = point - solid.corner[near]
        height = np.abs(np.einsum("ij,ij->i", w, normal)) / np.sqrt(square)
        first = np.einsum("ij,ij->i", np.cross(w, v), normal) / square
        second = np.einsum("ij,ij->i", np.cross(u, w), normal) / square
        inside = (first >= -TOLERANCE) & (second >= -TOLERANCE) & (first + second <= 1.0 + TOLERANCE)
        if bool((inside & (height <= close[near])).any()):
            return True
    return False


def _read_rotor(table: Table, objects: Sequence[Surface]) -> RotorFact:
    table.check_keys(("center", "axis", "blades", "duty", "rev_per_s", "inner", "outer"))
    mark = table.problems.mark()
    fact = RotorFact(
        center=table.vector("center", (0.0, 0.0, 0.0)),
        axis=table.direction("axis", (0.0, 0.0, 1.0)),
        blades=table.whole("blades", at_least=1),
        duty=table.number("duty", above=0.0, below=1.0),
        rev_per_s=table.number("rev_per_s", at_least=-COUNT, at_most=COUNT),
        inner=table.number("inner", at_least=0.0, at_most=LENGTH),
        outer=table.number("outer", above=0.0, at_most=LENGTH),
    )
    if not table.problems.sound_since(mark):
        return fact
    if fact.inner >= fact.outer:
        table.report("inner", f"less than outer, {fact.outer:g}")
    rates = [
        rate
        for surface in objects
        if surface.motion.spin is not None
        for rate in [_rate_about(surface.motion.spin, fact.axis, fact.center)]
        if rate is not None
    ]
    close = TOLERANCE * abs(fact.rev_per_s)
    known = bool(objects) and all(s.motion.matrices is None for s in objects)
    if known and fact.rev_per_s != 0.0 and not any(abs(rate - fact.rev_per_s) <= close for rate in rates):
        turning = ", ".join(f"{rate:g}" for rate in sorted(set(rates))) or "none"
        table.report("rev_per_s", f"the rate at which an object spins about this axis and center ({turning})")
    return fact


def _rate_about(spin: Spin, axis: Vec3, center: Vec3) -> float | None:
    """Return the rate of a spin about an axis through a center, signed; None if it turns about another line."""
    a = np.array(spin.axis) / math.hypot(*spin.axis)
    b = np.array(axis) / math.hypot(*axis)
    between = np.array(center) - np.array(spin.center)
    scale = max(1.0, math.hypot(*center), math.hypot(*spin.center))
    if np.linalg.norm(np.cross(a, b)) > TOLERANCE or np.linalg.norm(np.cross(a, between)) > TOLERANCE * scale:
        return None
    return spin.rev_per_s if a @ b > 0.0 else -spin.rev_per_s


def _read_grating(table: Table) -> GratingFact:
    table.check_keys(("cycles_per_unit",))
    x, y = table.numbers("cycles_per_unit", 2, LENGTH)
    if x == y == 0.0:
        table.report("cycles_per_unit", "a frequency vector: two finite numbers, not both zero")
    return GratingFact((x, y))


def _read_pan(table: Table, objects: Sequence[Surface], camera: Camera) -> PanFact:
    table.check_keys(("velocity", "period"))
    mark = table.problems.mark()
    fact = PanFact(table.direction("velocity"), table.number("period", at_least=1 / COUNT, at_most=LENGTH))
    known = bool(objects) and all(s.motion.matrices is None and s.motion.spin is None for s in objects)
    known = known and table.problems.sound_since(mark)
    seen = [np.array(s.motion.velocity) - np.array(camera.velocity) for s in objects]
    close = TOLERANCE * math.hypot(*fact.velocity)
    # Either sign: a pan is named after the camera's way as often as after the picture's.
    if known and not any(
        min(np.linalg.norm(v - fact.velocity), np.linalg.norm(v + fact.velocity)) <= close for v in seen
    ):
        moving = ", ".join(sorted({str(v.tolist()) for v in seen}))
        table.report("velocity", f"how an object moves against the camera ({moving})")
    return fact
