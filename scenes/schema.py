"""Reading a scene file's tables strictly: every refusal names file, key path, value and what is allowed.

A scene with a misspelt key or a wrong type would render as something else without a word, so nothing is coerced but a
whole number where a real one is meant (a bool is neither), and no key is ignored.
"""

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NoReturn

import numpy as np

from aliasbench.scenes.errors import SHOWN, InputError, shortened, unknown_name
from aliasbench.scenes.limits import LENGTH, MIN_LENGTH, RADIANCE
from aliasbench.scenes.model import FloatArray, Vec3

_DECIMAL_BITS = 10_000  # longer integers Python may refuse to write in decimal; it never does in hexadecimal
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


@dataclass(frozen=True, slots=True)
class Table:
    """A table of the file: where it is, for messages, and what it holds.

    Attributes
    ----------
    file : str
        The file's path as the user gave it.
    path : str
        The table's key path, for example ``object[2].spin``; empty at the root.
    values : mapping of str to object
    """

    file: str
    path: str
    values: Mapping[str, object]

    def has(self, key: str) -> bool:
        """Return whether the key is given."""
        return key in self.values

    def where(self, key: str) -> str:
        """Return the key's path in the file."""
        written = shortened(key) if _BARE_KEY.fullmatch(key) else shown(key)
        return f"{self.path}.{written}" if self.path else written

    def refuse(self, key: str, allowed: str) -> NoReturn:
        """Raise the error for a key's value (or its absence), saying what is allowed."""
        if key not in self.values:
            raise InputError(f"{self.file}: {self.where(key)} is missing; it must be {allowed}")
        raise InputError(f"{self.file}: {self.where(key)} = {shown(self.values[key])}: must be {allowed}")

    def check_keys(self, known: Sequence[str]) -> None:
        """Raise if the table has a key that is not known."""
        for key, value in self.values.items():
            if key not in known:
                problem = unknown_name("key", key, known)
                raise InputError(f"{self.file}: {self.where(key)} = {shown(value)}: {problem}")

    def check_exclusive(self, keys: Sequence[str], what: str) -> str:
        """Return which one of the keys is given; raise if it is none or more than one."""
        given = [key for key in keys if key in self.values]
        if len(given) == 1:
            return given[0]
        place = self.path or "the file"
        found = f"{' and '.join(given)} together" if given else "none of them"
        raise InputError(f"{self.file}: {place} has {found}; {what} needs exactly one of {', '.join(keys)}")

    def number(
        self,
        key: str,
        default: float | None = None,
        *,
        above: float = -math.inf,
        at_least: float = -math.inf,
        below: float = math.inf,
        at_most: float = math.inf,
    ) -> float:
        """Return a finite number in the range given; without a default the key must be there."""
        if default is not None and key not in self.values:
            return default
        number = _finite(self.values.get(key))
        if number is None or not (above < number < below and at_least <= number <= at_most):
            limits = [("over", above), ("at least", at_least), ("under", below), ("at most", at_most)]
            text = " and ".join(f"{word} {limit:g}" for word, limit in limits if math.isfinite(limit))
            self.refuse(key, f"a finite number {text}".strip())
        return number

    def whole(self, key: str, default: int | None = None, *, at_least: int) -> int:
        """Return a whole number (written as one) of at least `at_least`."""
        if default is not None and key not in self.values:
            return default
        value = self.values.get(key)
        if not isinstance(value, int) or isinstance(value, bool) or not at_least <= value < 2**31:
            self.refuse(key, f"a whole number, {at_least} or more")
        return value

    def text(self, key: str, default: str | None = None) -> str:
        """Return a text that is not empty."""
        if default is not None and key not in self.values:
            return default
        value = self.values.get(key)
        if not isinstance(value, str) or not value:
            self.refuse(key, "a text that is not empty")
        return value

    def choice(self, key: str, known: Sequence[str], default: str) -> str:
        """Return one of the known texts."""
        value = self.text(key, default)
        if value not in known:
            problem = unknown_name(key, value, known)
            raise InputError(f"{self.file}: {self.where(key)} = {shown(value)}: {problem}")
        return value

    def numbers(self, key: str, count: int, limit: float) -> tuple[float, ...]:
        """Return exactly `count` numbers from -limit to limit."""
        numbers = _finite_list(self.values.get(key), count, limit)
        if numbers is None:
            self.refuse(key, f"a list of {count} finite numbers{_between(limit)}")
        return numbers

    def vector(self, key: str, default: Vec3 | None = None, *, limit: float = LENGTH) -> Vec3:
        """Return three numbers from -limit to limit."""
        if default is not None and key not in self.values:
            return default
        x, y, z = self.numbers(key, 3, limit)
        return (x, y, z)

    def direction(self, key: str, default: Vec3 | None = None) -> Vec3:
        """Return three finite numbers, not all zero."""
        vector = self.vector(key, default)
        if math.hypot(*vector) < MIN_LENGTH:
            self.refuse(key, f"a direction: three finite numbers, not all zero (at least {MIN_LENGTH:g} long)")
        return vector

    def color(self, key: str, default: Vec3 | None = None) -> Vec3:
        """Return linear RGB, each component at least 0 and at most `limits.RADIANCE`."""
        color = self.vector(key, default, limit=math.inf)
        if not 0.0 <= min(color) <= max(color) <= RADIANCE:
            self.refuse(key, f"linear RGB, three finite numbers from 0 to {RADIANCE:g}")
        return color

    def points(self, key: str, width: int, count: int | None = None, *, limit: float = LENGTH) -> FloatArray:
        """Return a list of `count` (or any number of) points as (n, width) float64, all from -limit to limit."""
        value = self.values.get(key)
        rows = [_finite_list(row, width, limit) for row in value] if isinstance(value, list) else []
        complete = [row for row in rows if row is not None]
        if not rows or len(complete) < len(rows) or count not in (None, len(rows)):
            many = f"{count} " if count else ""
            self.refuse(key, f"a list of {many}points of {width} finite numbers each{_between(limit)}")
        return np.array(complete, dtype=np.float64)

    def table(self, key: str) -> "Table":
        """Return the table under the key, empty where the key is not given."""
        value = self.values.get(key, {})
        if not isinstance(value, dict):
            self.refuse(key, "a table")
        return Table(self.file, self.where(key), value)

    def tables(self, key: str) -> list["Table"]:
        """Return the tables of an array of tables, none where the key is not given."""
        value = self.values.get(key, [])
        if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
            self.refuse(key, f"an array of tables, each under [[{self.where(key)}]]")
        return [Table(self.file, f"{self.where(key)}[{k}]", item) for k, item in enumerate(value)]


def shown(value: object) -> str:
    """Return a value as the file would write it, shortened where it is long."""
    # Written only as far as it is shown: the rest may be nested deeper than Python recurses.
    text = ""
    for piece in _pieces(value):
        text += piece
        if len(text) > SHOWN:
            break
    return shortened(text)


def _pieces(value: object) -> Iterator[str]:
    """Yield a value of the file in JSON's notation, piece by piece; control characters as escapes."""
    if isinstance(value, dict):
        yield "{"
        for k, (key, item) in enumerate(value.items()):
            yield ", " if k else ""
            yield from _pieces(key)
            yield ": "
            yield from _pieces(item)
        yield "}"
    elif isinstance(value, list):
        yield "["
        for k, item in enumerate(value):
            yield ", " if k else ""
            yield from _pieces(item)
        yield "]"
    elif isinstance(value, int) and value.bit_length() > _DECIMAL_BITS:
        yield hex(value)
    else:
        text = value[: SHOWN + 1] if isinstance(value, str) else value
        written = json.dumps(text, default=str, ensure_ascii=False)
        yield "".join(c if c.isprintable() else json.dumps(c)[1:-1] for c in written)


def _between(limit: float) -> str:
    return f" from {-limit:g} to {limit:g}" if math.isfinite(limit) else ""


def _finite(value: object) -> float | None:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def _finite_list(value: object, count: int, limit: float) -> tuple[float, ...] | None:
    if not isinstance(value, list) or len(value) != count:
        return None
    numbers = tuple(number for number in map(_finite, value) if number is not None and abs(number) <= limit)
    return numbers if len(numbers) == count else None
