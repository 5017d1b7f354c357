"""Reading a scene file's tables strictly: every refusal names file, key path, value and what is allowed.

A scene with a misspelt key or a wrong type would render as something else without a word, so nothing is coerced but a
whole number where a real one is meant (a bool is neither), and no key is ignored. What happens at a refusal is up to
the file's `Problems`: the first is raised, or all are collected and stand-ins returned, which are valid by themselves.
"""

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NoReturn

import numpy as np

from aliasbench.scenes.errors import SHOWN, nearest, shortened, unknown_name
from aliasbench.scenes.limits import LENGTH, MIN_LENGTH, RADIANCE
from aliasbench.scenes.model import FloatArray, Vec3
from aliasbench.scenes.problems import Place, Problems

_DECIMAL_BITS = 10_000  # longer integers Python may refuse to write in decimal; it never does in hexadecimal
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


@dataclass(frozen=True, slots=True)
class Table:
    """A table of the file: where it is, for messages, and what it holds.

    Attributes
    ----------
    problems : Problems
        Of the file: where refusals go.
    path : str
        The table's key path, for example ``object[2].spin``; empty at the root.
    values : mapping of str to object
    place : tuple of str and int
        The path as keys and indices.
    """

    problems: Problems
    path: str
    values: Mapping[str, object]
    place: Place = field(default=())

    @property
    def file(self) -> str:
        """The file's path as the user gave it."""
        return self.problems.file

    def has(self, key: str) -> bool:
        """Return whether the key is given."""
        return key in self.values

    def where(self, key: str) -> str:
        """Return the key's path in the file."""
        written = shortened(key) if _BARE_KEY.fullmatch(key) else shown(key)
        return f"{self.path}.{written}" if self.path else written

    def report(self, key: str, allowed: str) -> None:
        """Report a key's value (or its absence), saying what is allowed."""
        if key not in self.values:
            if not self.problems.is_meant((*self.place, key)):
                self.fail(key, f"{self.where(key)} is missing; it must be {allowed}")
        else:
            self.fail(key, f"{self.where(key)} = {shown(self.values[key])}: must be {allowed}")

    def refuse(self, key: str, allowed: str) -> NoReturn:
        """Report a key's value (or its absence) and give up the part of the file that it is in."""
        self.report(key, allowed)
        self.problems.give_up()

    def fail(self, key: str, text: str) -> None:
        """Report a problem with a key in words of its own; the text says where it is."""
        self.problems.report((*self.place, key), text)

    def check_keys(self, known: Sequence[str]) -> None:
        """Report every key of the table that is not known."""
        for key, value in self.values.items():
            if key not in known:
                self.fail(key, f"{self.where(key)} = {shown(value)}: {unknown_name('key', key, known)}")
                if (meant := nearest(key, known)) is not None:
                    self.problems.expect((*self.place, meant))

    def check_exclusive(self, keys: Sequence[str], what: str) -> str:
        """Return which one of the keys is given; refuse none and more than one."""
        given = [key for key in keys if key in self.values]
        if not given and any(self.problems.is_meant((*self.place, key)) for key in keys):
            self.problems.give_up()
        if len(given) != 1:
            place = self.path or "the file"
            found = f"{' and '.join(given)} together" if given else "none of them"
            wrong = (*self.place, given[1]) if given else self.place
            self.problems.refuse(wrong, f"{place} has {found}; {what} needs exactly one of {', '.join(keys)}")
        return given[0]

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
            self.report(key, f"a finite number {text}".strip())
            return _between_limits(default, max(above, at_least), min(below, at_most))
        return number

    def whole(self, key: str, default: int | None = None, *, at_least: int, at_most: int = 2**31 - 1) -> int:
        """Return a whole number (written as one) of at least `at_least`, at most `at_most`."""
        if default is not None and key not in self.values:
            return default
        value = self.values.get(key)
        if not isinstance(value, int) or isinstance(value, bool) or not at_least <= value <= at_most:
            self.report(key, f"a whole number, {at_least} {'or more' if at_most == 2**31 - 1 else f'to {at_most}'}")
            return at_least if default is None else default
        return value

    def text(self, key: str, default: str | None = None) -> str:
        """Return a text that is not empty (a default may be)."""
        if default is not None and key not in self.values:
            return default
        value = self.values.get(key)
        if not isinstance(value, str) or not value:
            self.report(key, "a text that is not empty")
            return default or ""
        return value

    def choice(self, key: str, known: Sequence[str], default: str) -> str:
        """Return one of the known texts."""
        value = self.text(key, default)
        if value not in known:
            self.fail(key, f"{self.where(key)} = {shown(value)}: {unknown_name(key, value, known)}")
            return default
        return value

    def numbers(self, key: str, count: int, limit: float) -> tuple[float, ...]:
        """Return exactly `count` numbers from -limit to limit."""
        numbers = _finite_list(self.values.get(key), count, limit)
        if numbers is None:
            self.report(key, f"a list of {count} finite numbers{between(limit)}")
            return (1.0,) * count
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
            self.report(key, f"a direction: three finite numbers, not all zero (at least {MIN_LENGTH:g} long)")
            return (0.0, 0.0, 1.0)
        return vector

    def color(self, key: str, default: Vec3 | None = None) -> Vec3:
        """Return linear RGB, each component at least 0 and at most `limits.RADIANCE`."""
        color = self.vector(key, default, limit=math.inf)
        if not 0.0 <= min(color) <= max(color) <= RADIANCE:
            self.report(key, f"linear RGB, three finite numbers from 0 to {RADIANCE:g}")
            return (1.0, 1.0, 1.0)
        return color

    def points(self, key: str, width: int, count: int | None = None, *, limit: float = LENGTH) -> FloatArray:
        """Return a list of `count` (or any number of) points as (n, width) float64, all from -limit to limit.

        The stand-in for what is no such list has no points.
        """
        value = self.values.get(key)
        rows = [_finite_list(row, width, limit) for row in value] if isinstance(value, list) else []
        complete = [row for row in rows if row is not None]
        if not rows or len(complete) < len(rows) or count not in (None, len(rows)):
            many = f"{count} " if count else ""
            self.report(key, f"a list of {many}points of {width} finite numbers each{between(limit)}")
            return np.empty((0, width))
        return np.array(complete, dtype=np.float64)

    def table(self, key: str) -> "Table":
        """Return the table under the key, empty where the key is not given."""
        value = self.values.get(key, {})
        if not isinstance(value, dict):
            self.refuse(key, "a table")
        return Table(self.problems, self.where(key), value, (*self.place, key))

    def tables(self, key: str) -> list["Table"]:
        """Return the tables of an array of tables, none where the key is not given."""
        value = self.values.get(key, [])
        if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
            self.report(key, f"an array of tables, each under [[{self.where(key)}]]")
            return []
        return [
            Table(self.problems, f"{self.where(key)}[{k}]", item, (*self.place, key, k)) for k, item in enumerate(value)
        ]


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


def _between_limits(default: float | None, low: float, high: float) -> float:
    """Return a number in a range, for a key whose own is not."""
    if default is not None:
        return default
    return 1.0 if low < 1.0 < high else (low + high) / 2 if math.isfinite(low + high) else max(low, min(high, 0.0))


def between(limit: float) -> str:
    """Return a range from -limit to limit in words, for a sentence that goes on; nothing where there is no limit."""
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
