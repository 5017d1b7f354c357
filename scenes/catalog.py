"""The built-in scenes, by name: a literal table of the families' entries, and the text that names one of them.

A parametrised scene carries its parameters in its name (`propeller:blades=5,rev_per_s=23.5`, only those that are not
defaults), so that the name alone, in a record or on the command line, builds the same scene again.
"""

import re
from collections.abc import Mapping
from types import MappingProxyType

from aliasbench.scenes import (
    camera_turn,
    checker_floor,
    colour_bleeding,
    confetti,
    depth_of_field,
    dispersion_prism,
    distant_triangle,
    edges,
    floors,
    glossy_floor,
    grid,
    lantern,
    propeller,
    signals,
    slivers,
    soft_shadow,
    two_matrices,
    walls,
    window_screens,
    zone_plate,
)
from aliasbench.scenes.entries import Parameter, SceneEntry, Value
from aliasbench.scenes.errors import InputError, shortened, unknown_name
from aliasbench.scenes.model import Scene

_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)

SCENES: Mapping[str, SceneEntry] = MappingProxyType(
    {
        entry.name: entry
        for entry in (
            *floors.ENTRIES,
            *walls.ENTRIES,
            *checker_floor.ENTRIES,
            *distant_triangle.ENTRIES,
            *confetti.ENTRIES,
            *slivers.ENTRIES,
            *edges.ENTRIES,
            *grid.ENTRIES,
            *zone_plate.ENTRIES,
            *window_screens.ENTRIES,
            *propeller.ENTRIES,
            *signals.ENTRIES,
            *camera_turn.ENTRIES,
            *two_matrices.ENTRIES,
            *soft_shadow.ENTRIES,
            *depth_of_field.ENTRIES,
            *glossy_floor.ENTRIES,
            *dispersion_prism.ENTRIES,
            *colour_bleeding.ENTRIES,
            *lantern.ENTRIES,
        )
    }
)


def build_scene(text: str) -> Scene:
    """Return the scene of a catalog name, with parameters or without: ``propeller:blades=5,rev_per_s=23.5``.

    Raises
    ------
    InputError
        If the name or a parameter is unknown, given twice, not a number or out of range.
    TypeError
        If `text` is none.
    """
    if not isinstance(text, str):
        raise TypeError(f"a scene of the catalog is named by a text, not by {type(text).__name__}")
    name, _, rest = (part.strip() for part in text.partition(":"))
    if name not in SCENES:
        raise unknown_name("scene", name, SCENES)
    entry = SCENES[name]
    values: dict[str, Value] = {}
    for item in rest.split(",") if rest else ():
        key, equals, value = (part.strip() for part in item.partition("="))
        if not key or not equals:
            raise InputError(
                f"scene {name!r}: {shortened(item.strip())!r} is not key=value; known keys: {_known(entry)}"
            )
        if key not in entry.parameters:
            problem = unknown_name("parameter", key, entry.parameters)
            raise InputError(f"scene {name!r}: {problem}")
        if key in values:
            raise InputError(f"scene {name!r}: parameter {key} is given twice; once is allowed")
        if _NUMBER.fullmatch(value) and isinstance(entry.parameters[key], Parameter):
            values[key] = float(value)
        else:
            # What is not a number is in no range: the check words the refusal.
            values[key] = entry.parameters[key].check(f"scene {name!r}: parameter {key}", value or "nothing")
    return entry.build(**values)


def _known(entry: SceneEntry) -> str:
    return ", ".join(entry.parameters) or "none"
