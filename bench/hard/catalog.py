"""Every hard case by name, group after group."""

from collections.abc import Mapping

from aliasbench.bench.hard import (
    coordinates,
    coplanar,
    degenerate,
    depth,
    edges,
    footprints,
    horizon,
    motion,
    moving_edges,
    scale,
    shapes,
    shared_edges,
    sizes,
    texel_lines,
    values,
    viewpoints,
)
from aliasbench.bench.hard.case import HardCase

_GROUPS = (
    edges.CASES,
    moving_edges.CASES,
    shared_edges.CASES,
    texel_lines.CASES,
    shapes.CASES,
    degenerate.CASES,
    coplanar.CASES,
    viewpoints.CASES,
    scale.CASES,
    depth.CASES,
    footprints.CASES,
    coordinates.CASES,
    horizon.CASES,
    motion.CASES,
    values.CASES,
    sizes.CASES,
)

HARD_CASES: Mapping[str, HardCase] = {case.name: case for group in _GROUPS for case in group}
