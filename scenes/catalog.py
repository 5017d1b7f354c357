"""The built-in scenes, by name: a literal table from a name to what it shows, its parameters and its builder.

A parametrised scene carries its parameters in its name (`propeller:blades=5,rev_per_s=23.5`, only those that are not
defaults), so that the name alone, in a record or on the command line, builds the same scene again.
"""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from numbers import Real
from types import MappingProxyType
from typing import Literal

from aliasbench.scenes.confetti import build_confetti
from aliasbench.scenes.edges import build_edge_fan, build_near_horizontal_edge
from aliasbench.scenes.errors import InputError, shortened, unknown_name
from aliasbench.scenes.floors import build_brick_floor
from aliasbench.scenes.model import Scene
from aliasbench.scenes.propeller import build_propeller

_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number that a scene can be built with: its default, the least and greatest allowed, and what it means."""

    default: float
    low: float
    high: float
    kind: Literal["int", "float"]
    meaning: str

    def check(self, place: str, value: object) -> float:
        """Return the value as this parameter's kind of number; raise `InputError` if it is none or out of range."""
        if isinstance(value, Real) and not isinstance(value, bool):
            try:
                number = float(value)
            except OverflowError:
                number = math.inf if value == abs(value) else -math.inf
            written = _shortest(number)
        else:
            number, written = math.nan, shortened(str(value))
        whole = self.kind == "float" or number.is_integer()
        if not (whole and self.low <= number <= self.high):
            what = "a whole number" if self.kind == "int" else "a number"
            raise InputError(
                f"{place} = {written}: must be {what} from {self.low:g} to {self.high:g} "
                f"(default {self.default:g}; {self.meaning})"
            )
        # + 0.0 makes one zero of two: -0.0 would be the same scene under another name.
        return int(number) if self.kind == "int" else number + 0.0


@dataclass(frozen=True, slots=True)
class SceneEntry:
    """A scene of the catalog.

    Attributes
    ----------
    name : str
        Its key in `SCENES`.
    summary : str
        One line: what it shows.
    family : str
        The module of `scenes` that builds it.
    builder : callable
        Takes the scene's `name` and every parameter by keyword.
    parameters : mapping of str to Parameter
    """

    name: str
    summary: str
    family: str
    builder: Callable[..., Scene]
    parameters: Mapping[str, Parameter] = field(default_factory=dict)

    def build(self, **parameters: float) -> Scene:
        """Return the scene with the given parameters, the others at their defaults.

        Raises
        ------
        InputError
            If a parameter is unknown, of the wrong kind or out of range.
        """
        for key in parameters:
            if key not in self.parameters:
                problem = unknown_name("parameter", key, self.parameters)
                raise InputError(f"scene {self.name!r}: {problem}")
        values = {
            key: parameter.check(f"scene {self.name!r}: parameter {key}", parameters.get(key, parameter.default))
            for key, parameter in self.parameters.items()
        }
        return self.builder(name=self.canonical_name(values), **values)

    def canonical_name(self, values: Mapping[str, float]) -> str:
        """Return the name that builds the scene with these values: only those that are not defaults are in it."""
        changed = [f"{k}={_shortest(v)}" for k, v in values.items() if v != self.parameters[k].default]
        return f"{self.name}:{','.join(changed)}" if changed else self.name


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
    values: dict[str, float] = {}
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
        if not _NUMBER.fullmatch(value):
            # The range check words the refusal: what is not a number is in no range.
            entry.parameters[key].check(f"scene {name!r}: parameter {key}", value or "nothing")
        values[key] = float(value)
    return entry.build(**values)


def _known(entry: SceneEntry) -> str:
    return ", ".join(entry.parameters) or "none"


def _shortest(value: float) -> str:
    short = f"{value:g}"
    return short if float(short) == value else repr(value)


SCENES: Mapping[str, SceneEntry] = MappingProxyType(
    {
        "near-horizontal-edge": SceneEntry(
            "near-horizontal-edge",
            "one straight edge, nearly along the pixel rows: long stairsteps",
            "edges",
            build_near_horizontal_edge,
            {
                "slope": Parameter(0.1, -4.0, 4.0, "float", "rise over run of the edge"),
                "offset": Parameter(0.0, -1.0, 1.0, "float", "height of the edge at the middle, world units"),
                "speed": Parameter(0.0, -2.0, 2.0, "float", "upward pan of the edge, world units per second"),
            },
        ),
        "edge-fan": SceneEntry(
            "edge-fan",
            "thick and thin wedges at many angles: where stairsteps are worst",
            "edges",
            build_edge_fan,
            {
                "wedges": Parameter(18, 4, 128, "int", "wedges in the circle, thick and thin in turn; even"),
                "rev_per_s": Parameter(0.0, -10.0, 10.0, "float", "turns per second of the whole fan"),
            },
        ),
        "confetti": SceneEntry(
            "confetti",
            "small triangles that drift over the pixel centres: they flicker on and off",
            "confetti",
            build_confetti,
            {
                "count": Parameter(4000, 8, 20000, "int", "triangles in a square of the picture's height"),
                "size_px": Parameter(1.5, 0.2, 20.0, "float", "largest diameter, in pixels of a picture 256 high"),
                "seed": Parameter(1, 0, 2**31 - 1, "int", "of places, shapes and colours"),
                "speed": Parameter(0.08, -2.0, 2.0, "float", "drift to the right and up, world units per second"),
            },
        ),
        "propeller": SceneEntry(
            "propeller",
            "blades that turn too fast for the frame rate: they stand still or run backwards",
            "propeller",
            build_propeller,
            {
                "blades": Parameter(3, 1, 60, "int", "number of blades"),
                "rev_per_s": Parameter(1.0, -1000.0, 1000.0, "float", "turns per second, counter-clockwise"),
                "duty": Parameter(0.5, 0.05, 0.95, "float", "bright share of the circle"),
                "shutter": Parameter(0.0, 0.0, 1.0, "float", "open share of the frame interval"),
                "inner": Parameter(0.3, 0.1, 0.8, "float", "inner radius of the metrics' annulus, world units"),
                "outer": Parameter(0.85, 0.2, 0.9, "float", "outer radius of the metrics' annulus, world units"),
            },
        ),
        "brick-floor": SceneEntry(
            "brick-floor",
            "a photograph of bricks on a receding floor under a slow pan: far texture shimmers",
            "floors",
            build_brick_floor,
            {
                "speed": Parameter(0.5, -4.0, 4.0, "float", "sideways pan of the camera, world units per second"),
                "shutter": Parameter(0.0, 0.0, 1.0, "float", "open share of the frame interval"),
            },
        ),
    }
)
