"""Every hard case by name, group after group."""

from collections.abc import Mapping

from aliasbench.bench.hard import edges, motion
from aliasbench.bench.hard.case import HardCase

HARD_CASES: Mapping[str, HardCase] = {case.name: case for group in (edges.CASES, motion.CASES) for case in group}
