"""What an entry of the scene catalog is: a name, a line, a builder, and parameters that are checked and named.

Apart from `catalog`, which is the table: each family's module writes its own entries, and the table collects them.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from numbers import Real
from typing import Literal

from aliasbench.scenes.errors import InputError, shortened, unknown_name
from aliasbench.scenes.model import Scene

Value = float | str


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
            text = written(number)
        else:
            number, text = math.nan, shortened(str(value))
        whole = self.kind == "float" or number.is_integer()
        if not (whole and self.low <= number <= self.high):
            what = "a whole number" if self.kind == "int" else "a number"
            raise InputError(
                f"{place} = {text}: must be {what} from {self.low:g} to {self.high:g} "
                f"(default {self.default:g}; {self.meaning})"
            )
        # + 0.0 makes one zero of two: -0.0 would be the same scene under another name.
        return int(number) if self.kind == "int" else number + 0.0


@dataclass(frozen=True, slots=True)
class Choice:
    """A word that a scene can be built with: its default, the words allowed, and what it means."""

    default: str
    names: tuple[str, ...]
    meaning: str

    def check(self, place: str, value: object) -> str:
        """Return the value if it is one of the words; raise `InputError` otherwise."""
        if isinstance(value, str) and value in self.names:
            return value
        raise InputError(
            f"{place} = {shortened(str(value))}: must be {' or '.join(self.names)} "
            f"(default {self.default}; {self.meaning})"
        )


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
    parameters : mapping of str to Parameter or Choice
    """

    name: str
    summary: str
    family: str
    builder: Callable[..., Scene]
    parameters: Mapping[str, Parameter | Choice] = field(default_factory=dict)

    def build(self, **parameters: Value) -> Scene:
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

    def canonical_name(self, values: Mapping[str, Value]) -> str:
        """Return the name that builds the scene with these values: only those that are not defaults are in it."""
        changed = [f"{k}={written(v)}" for k, v in values.items() if v != self.parameters[k].default]
        return f"{self.name}:{','.join(changed)}" if changed else self.name


def written(value: Value) -> str:
    """Return a value as it stands in a scene's name: a word, or the shortest text that reads back as the number."""
    if isinstance(value, str):
        return value
    short = f"{value:g}"
    return short if float(short) == value else repr(value)
