"""Facts of a scene file, read and checked against the scene: a wrong fact would turn every metric that uses it wrong.

Only geometry and motion can be checked here: an edge must touch an object, a rotor must turn as an
object does, a pan must be how an object moves against the camera. What a fact says about brightness is taken on trust.
"""

import math
from collections.abc import Sequence

import numpy as np

from aliasbench.scenes.errors import InputError
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

    Raises
    ------
    InputError
        If a fact is incomplete, impossible, or contradicts the objects and the camera.
    """
    table.check_keys(("edge", "rotor", "grating", "pan"))
    return Facts(
        edges=tuple(_read_edge(t, objects) for t in _one_or_more(table, "edge")),
        rotors=tuple(_read_rotor(t, objects) for t in _one_or_more(table, "rotor")),
        gratings=tuple(_read_grating(t) for t in _one_or_more(table, "grating")),
        pans=tuple(_read_pan(t, objects, camera) for t in _one_or_more(table, "pan")),
    )


def _one_or_more(table: Table, key: str) -> list[Table]:
    if isinstance(table.values.get(key), dict):
        return [table.table(key)]
    return table.tables(key)


def _read_edge(table: Table, objects: Sequence[Surface]) -> EdgeFact:
    table.check_keys(("from", "to"))
    start, end = table.vector("from"), table.vector("to")
    if start == end:
        table.refuse("to", "a point that differs from `from`")
    if objects and not any(_touches(np.array([start, end]), s) for s in objects):
        raise InputError(
            f"{table.file}: {table.path} from {list(start)} to {list(end)} touches no object; it must lie on one"
        )
    return EdgeFact(start, end)


def _touches(edge: FloatArray, surface: Surface) -> bool:
    """Return whether a segment (2, 3) meets a surface in some of its points.

    It need not run along an outline: the edge may be one of the texture's.
    """
    points = edge[0] + np.linspace(0.0, 1.0, _EDGE_POINTS)[:, None] * (edge[1] - edge[0])
    a, b, c = (surface.vertices[surface.triangles[:, k]] for k in range(3))
    u, v = b - a, c - a
    normal = np.cross(u, v)
    area = np.einsum("ij,ij->i", normal, normal)
    keep = area > 0.0
    a, u, v, normal, area = a[keep], u[keep], v[keep], normal[keep], area[keep]
    close = TOLERANCE * max(float(np.abs(surface.vertices).max(initial=0.0)), float(np.linalg.norm(edge[1] - edge[0])))
    for point in points:
        w = point - a
        height = np.abs(np.einsum("ij,ij->i", w, normal)) / np.sqrt(area)
        first = np.einsum("ij,ij->i", np.cross(w, v), normal) / area
        second = np.einsum("ij,ij->i", np.cross(u, w), normal) / area
        inside = (first >= -TOLERANCE) & (second >= -TOLERANCE) & (first + second <= 1.0 + TOLERANCE)
        if bool((inside & (height <= close)).any()):
            return True
    return False


def _read_rotor(table: Table, objects: Sequence[Surface]) -> RotorFact:
    table.check_keys(("center", "axis", "blades", "duty", "rev_per_s", "inner", "outer"))
    fact = RotorFact(
        center=table.vector("center", (0.0, 0.0, 0.0)),
        axis=table.direction("axis", (0.0, 0.0, 1.0)),
        blades=table.whole("blades", at_least=1),
        duty=table.number("duty", above=0.0, below=1.0),
        rev_per_s=table.number("rev_per_s", at_least=-COUNT, at_most=COUNT),
        inner=table.number("inner", at_least=0.0, at_most=LENGTH),
        outer=table.number("outer", above=0.0, at_most=LENGTH),
    )
    if fact.inner >= fact.outer:
        table.refuse("inner", f"less than outer, {fact.outer:g}")
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
        table.refuse("rev_per_s", f"the rate at which an object spins about this axis and center ({turning})")
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
        table.refuse("cycles_per_unit", "a frequency vector: two finite numbers, not both zero")
    return GratingFact((x, y))


def _read_pan(table: Table, objects: Sequence[Surface], camera: Camera) -> PanFact:
    table.check_keys(("velocity", "period"))
    fact = PanFact(table.direction("velocity"), table.number("period", at_least=1 / COUNT, at_most=LENGTH))
    known = bool(objects) and all(s.motion.matrices is None and s.motion.spin is None for s in objects)
    seen = [np.array(s.motion.velocity) - np.array(camera.velocity) for s in objects]
    close = TOLERANCE * math.hypot(*fact.velocity)
    # Either sign: a pan is named after the camera's way as often as after the picture's.
    if known and not any(
        min(np.linalg.norm(v - fact.velocity), np.linalg.norm(v + fact.velocity)) <= close for v in seen
    ):
        moving = ", ".join(sorted({str(v.tolist()) for v in seen}))
        table.refuse("velocity", f"how an object moves against the camera ({moving})")
    return fact
