"""All that is wrong with a scene file, each with its line: for the people who write them.

Loading stops at the first problem (`files.load_scene`); here the same readers go on past it (see `problems`). Lines are
looked for only where there is something to tell.
"""

import re
from dataclasses import dataclass
from pathlib import Path

from aliasbench.scenes.errors import InputError, one_line, reason_of
from aliasbench.scenes.files import NO_MEMORY, load_scene, parse_toml, read_root, read_text
from aliasbench.scenes.lines import key_lines, line_of
from aliasbench.scenes.local_files import open_input
from aliasbench.scenes.meshes import MODEL_SUFFIXES
from aliasbench.scenes.model import Scene
from aliasbench.scenes.problems import Place, Problem, Problems
from aliasbench.scenes.schema import Table

_LINE = re.compile(r"line (\d+)")


@dataclass(frozen=True, slots=True)
class Finding:
    """One problem of a file: its line from 1 (None where it has none), the key's path, and what is wrong."""

    line: int | None
    key: str
    text: str


@dataclass(frozen=True, slots=True)
class Checked:
    """What checking a file gave: the scene, or all that is wrong, in the order of the lines."""

    file: str
    scene: Scene | None
    findings: tuple[Finding, ...]


def check_scene_file(path: Path) -> Checked:
    """Return the scene of a file, or everything that is wrong with it.

    Parameters
    ----------
    path : Path
        A scene file (TOML), or a model file, of which only the first problem is found.

    Raises
    ------
    InputError
        If there is no such file, or it cannot be read.
    """
    try:
        return _check_model(path) if path.suffix.lower() in MODEL_SUFFIXES else _check_scene(path)
    except MemoryError:
        return Checked(str(path), None, (Finding(None, "", NO_MEMORY),))
    except OSError as error:
        return Checked(str(path), None, (Finding(None, "", f"cannot be read: {reason_of(error)}"),))


def _check_scene(path: Path) -> Checked:
    file = str(path)
    text = read_text(path)
    try:
        values = parse_toml(text, file)
    except InputError as error:
        return Checked(file, None, (_of_error(file, error),))
    problems = Problems(file, collect=True)
    try:
        scene = read_root(Table(problems, "", values), path.parent, path.stem)
    except InputError as error:
        # What gives up the whole file is among the problems; what else is refused is not, yet ends the reading as well.
        if not problems.found:
            return Checked(file, None, (_of_error(file, error),))
        return Checked(file, None, _located(problems.found, text))
    if problems.found:
        return Checked(file, None, _located(problems.found, text))
    return Checked(file, scene, ())


def _check_model(path: Path) -> Checked:
    file = str(path)
    try:
        with open_input(path):
            pass
    except (OSError, ValueError) as error:
        raise InputError(
            f"{file}: cannot be read ({reason_of(error)}); the path of a scene or model file is needed"
        ) from error
    try:
        return Checked(file, load_scene(file), ())
    except InputError as error:
        return Checked(file, None, (_of_error(file, error),))


def _of_error(file: str, error: InputError) -> Finding:
    text = str(error).removeprefix(one_line(f"{file}: "))
    line = _LINE.match(text)
    if line is not None:
        text = re.sub(r"^line \d+(, (?P<column>column \d+))?: ", lambda m: f"{m['column']}: " if m[1] else "", text)
    return Finding(int(line[1]) if line else None, "", text)


def _located(problems: tuple[Problem, ...], text: str) -> tuple[Finding, ...]:
    lines = key_lines(text)
    found = [Finding(line_of(lines, p.place), _key(p.place), p.text) for p in problems]
    return tuple(sorted(found, key=lambda finding: finding.line or 0))


def _key(place: Place) -> str:
    text = ""
    for part in place:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text
