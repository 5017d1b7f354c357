"""What is wrong with a scene file: raised at the first problem, or collected so that all are told at once.

The readers are written once for both. Loading stops at the first problem, which is an `InputError`. Checking goes on:
each problem is kept with its place in the file, the getter that met it returns a stand-in that is valid by itself, and
a part of the file of which too little is left to go on (an object without a shape) is given up by `PartRefusedError`.
Stand-ins must not cause further problems: what compares several values asks `sound_since` first.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NoReturn, TypeVar

from aliasbench.scenes.errors import InputError, one_line

Place = tuple[str | int, ...]  # keys and indices from the file's root
Part = TypeVar("Part")


class PartRefusedError(InputError):
    """A part of a scene file was given up; its problem is among those collected."""


@dataclass(frozen=True, slots=True)
class Problem:
    """One problem: where in the file, and the sentence that says what is wrong and what is allowed."""

    place: Place
    text: str


class Problems:
    """The problems of one file, in the order in which they were met.

    Parameters
    ----------
    file : str
        The file's path as the user gave it.
    collect : bool
        Keep problems instead of raising the first.
    """

    __slots__ = ("_collect", "_found", "_keys", "_meant", "file")

    def __init__(self, file: str, *, collect: bool = False) -> None:
        self.file = file
        self._collect = collect
        self._found: list[Problem] = []
        self._keys: set[Problem] = set()
        self._meant: set[Place] = set()

    @property
    def found(self) -> tuple[Problem, ...]:
        """What was collected so far."""
        return tuple(self._found)

    def report(self, place: Place, text: str) -> None:
        """Raise `InputError` with the file and the text; keep the problem instead where they are collected."""
        if not self._collect:
            raise InputError(f"{self.file}: {text}")
        problem = Problem(place, one_line(text))
        if problem not in self._keys:
            self._keys.add(problem)
            self._found.append(problem)

    def expect(self, place: Place) -> None:
        """Take note that an unknown key, which was reported, was probably meant to be this one."""
        self._meant.add(place)

    def is_meant(self, place: Place) -> bool:
        """Return whether a key is missing only because it is misspelt, of which enough was said."""
        return place in self._meant

    def refuse(self, place: Place, text: str) -> NoReturn:
        """Report a problem after which the part of the file that it is in cannot be read on."""
        self.report(place, text)
        self.give_up()

    def give_up(self) -> NoReturn:
        """Leave the part of the file that is read, its problems being reported."""
        raise PartRefusedError(self.file)

    def mark(self) -> int:
        """Return a point in time, for `sound_since`."""
        return len(self._found)

    def sound_since(self, mark: int) -> bool:
        """Return whether no problem was met since the mark was made."""
        return len(self._found) == mark

    def attempt(self, read: Callable[[], Part]) -> Part | None:
        """Return what a reader of a part returns; None where it gave up, only ever if problems are collected."""
        try:
            return read()
        except PartRefusedError:
            return None
