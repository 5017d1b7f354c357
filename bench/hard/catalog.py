"""Every hard case by name, group after group."""

from collections.abc import Mapping

from aliasbench.bench.hard import depth, edges, footprints, horizon, motion, scale, sizes, values
from aliasbench.bench.hard.case import HardCase

_GROUPS = (
    edges.CASES,
    scale.CASES,
    depth.CASES,
    footprints.CASES,
    horizon.CASES,
    motion.CASES,
    values.CASES,
    sizes.CASES,
)

HARD_CASES: Mapping[str, HardCase] = {case.name: case for group in _GROUPS for case in group}
