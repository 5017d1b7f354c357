"""The suite file (TOML, schema 1) as checked text: groups of scenes x techniques with their sizes, frames and rounds.

    schema = 1
    name = "quick"
    summary = "one line"
    size = [256, 256]           # width, height
    frames = "loop"             # as many as the scene says, or a number
    seeds = 1                   # how many, from 0 on, or a list of them
    rounds = 5                  # timed renders of each case
    metrics = ["rmse"]          # default: every metric
    texture_truth = "point"     # what a texture is between texels, for the reference: point or linear
    scenes = ["edge-fan", "scenes/mine.toml"]
    techniques = ["raytrace:spp=4", "raster-msaa-4"]
    [[case]]                    # further groups; what one leaves out it takes from above
    scenes = ["brick-floor"]
    frames = 4

    hard_cases = ["all"]        # or names of them: they bring their own scenes, techniques and criteria

Every scene of a group is rendered by every technique of it. Scene files are looked for beside the suite file first.
Whether the scenes and techniques exist is checked by `suite.plan`, which builds them.
"""

import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Literal

from aliasbench.bench.wording import shown
from aliasbench.scenes.errors import InputError, unknown_name

SCHEMA = 1
MAX_SIDE = 65536
MAX_SEED = 2**31 - 1
_NEEDED = f"schema = {SCHEMA}, scenes = [...] and techniques = [...]"

Frames = int | Literal["loop"]


@dataclass(frozen=True, slots=True)
class SuiteEntry:
    """A packaged suite: what it is for, and its file below `bench/suites`."""

    summary: str
    file: str


SUITES: Mapping[str, SuiteEntry] = {
    "quick": SuiteEntry(
        "five scenes by the main techniques of both renderers, 256 x 256, under a minute", "quick.toml"
    ),
    "hard-cases": SuiteEntry(
        "where renderers break numerically, each with a criterion and a verdict", "hard-cases.toml"
    ),
}


@dataclass(frozen=True, slots=True)
class Group:
    """Scenes that are each rendered by every one of the techniques; the fields are the keys of the suite file."""

    scenes: tuple[str, ...] = ()
    techniques: tuple[str, ...] = ()
    size: tuple[int, int] = (256, 256)
    frames: Frames = "loop"
    seeds: tuple[int, ...] = (0,)
    rounds: int = 5
    metrics: tuple[str, ...] | None = None
    texture_truth: str = "point"


@dataclass(frozen=True, slots=True)
class SuiteFile:
    """A suite as written. `where` names it in errors; `folder` is where its scene files are looked for first.

    `hard_cases` are names of `bench.hard.catalog`, all of which are known.
    """

    name: str
    where: str
    folder: Path | None
    groups: tuple[Group, ...]
    hard_cases: tuple[str, ...] = ()


def read_suite(text: str) -> SuiteFile:
    """Return a packaged suite by its name, or a suite file by its path.

    Raises
    ------
    InputError
        For an unknown suite, a missing, unreadable or broken file, a newer schema, an unknown key or a bad value; the
        message names file, key, value and what is allowed.
    """
    path = Path(text)
    if text in SUITES:
        packaged = resources.files("aliasbench.bench").joinpath("suites", SUITES[text].file)
        return parse_suite(packaged.read_text(encoding="utf-8"), f"suite {text}", None, text)
    try:
        is_file = path.is_file()
    except OSError as problem:
        raise InputError(f"suite {shown(text)}: cannot be read ({problem.strerror})") from None
    if not is_file:
        if path.suffix == ".toml" or path.name != text:
            raise InputError(f"suite {text!r}: no such file")
        unknown = unknown_name("suite", text, SUITES)
        raise InputError(f"{unknown} (or a path to a suite file, *.toml)")
    try:
        document = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise InputError(f"suite {text!r}: cannot be read ({error.strerror or error})") from None
    except UnicodeDecodeError as error:
        raise InputError(
            f"suite {text!r}: byte {error.start} is not UTF-8; a suite file is a TOML text in UTF-8"
        ) from None
    return parse_suite(document, text, path.parent, path.stem)


def parse_suite(document: str, where: str, folder: Path | None, default_name: str) -> SuiteFile:
    """Return the suite in a TOML text; `where` is what errors call it. See `read_suite`."""
    table = _parse(document, where)
    if "schema" not in table:
        if not table:
            raise InputError(f"{where}: is empty; a suite needs {_NEEDED}")
        raise InputError(f"{where}: schema is missing; give schema = {SCHEMA} at the top")
    schema = table["schema"]
    if isinstance(schema, bool) or not isinstance(schema, int) or schema < 1:
        raise InputError(f"{where}: schema = {shown(schema)}: must be {SCHEMA}")
    if schema > SCHEMA:
        raise InputError(f"{where}: schema = {shown(schema)} is newer than this version, which reads up to {SCHEMA}")
    known = ("schema", "name", "summary", "case", "hard_cases", *_READERS)
    _refuse_unknown(table, known, where)
    for key in ("name", "summary"):
        if not isinstance(table.get(key, ""), str):
            raise InputError(f"{where}: {key} = {shown(table[key])}: must be text")
    base = _read_group({k: v for k, v in table.items() if k in _READERS}, Group(), where)
    groups = [base] if base.scenes else []
    cases = table.get("case", [])
    if not isinstance(cases, list) or not all(isinstance(c, dict) for c in cases):
        raise InputError(f"{where}: case: must be tables, as in [[case]]")
    for number, case in enumerate(cases):
        place = f"{where}: case[{number}]"
        _refuse_unknown(case, _READERS, place)
        groups.append(_read_group(case, base, place))
    for number, group in enumerate(groups):
        for key in ("scenes", "techniques"):
            if not getattr(group, key):
                raise InputError(f"{where}: {key} is missing in group {number} (give it there or at the top)")
    hard_cases = _hard_cases(table, where)
    if not groups and not hard_cases:
        raise InputError(f"{where}: no scenes: give scenes = [...] at the top or in a [[case]]")
    return SuiteFile(str(table.get("name", default_name)), where, folder, tuple(groups), hard_cases)


def _hard_cases(table: Mapping[str, object], where: str) -> tuple[str, ...]:
    if "hard_cases" not in table:
        return ()
    from aliasbench.bench.hard.catalog import HARD_CASES

    try:
        names = _texts(table["hard_cases"])
        for name in names:
            if name not in HARD_CASES and name != "all":
                raise unknown_name("hard case", name, (*HARD_CASES, "all"))
    except InputError as error:
        raise InputError(f"{where}: hard_cases = {shown(table['hard_cases'])}: {error}") from None
    return tuple(HARD_CASES) if "all" in names else names


def _parse(document: str, where: str) -> dict[str, object]:
    try:
        return tomllib.loads(document)
    except tomllib.TOMLDecodeError as error:
        problem = str(error)
    except RecursionError:
        problem = "its values are nested too deeply"
    except ValueError:
        # What Python says of a whole number that has more digits than it converts.
        problem = "a number has too many digits"
    raise InputError(f"{where}: not valid TOML: {problem}")


def _refuse_unknown(table: Mapping[str, object], known: Iterable[str], where: str) -> None:
    for key in table:
        if key not in known:
            raise InputError(f"{where}: {unknown_name('key', key, known)}")


def _read_group(table: Mapping[str, object], base: Group, where: str) -> Group:
    group = base
    for key, value in table.items():
        try:
            group = _READERS[key](group, value)
        except InputError as error:
            raise InputError(f"{where}: {key} = {shown(value)}: {error}") from None
    return group


def whole_number(value: object, low: int, high: int) -> int:
    """Return a whole number of a range; InputError says what is allowed."""
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise InputError(f"must be a whole number from {low} to {high}")
    return value


def _texts(value: object) -> tuple[str, ...]:
    if not isinstance(value, list) or not value or not all(isinstance(v, str) and v.strip() for v in value):
        raise InputError("must be a list of texts, with at least one")
    texts = tuple(v.strip() for v in value)
    for text in texts:
        if texts.count(text) > 1:
            raise InputError(f"{shown(text)} is there twice")
    return texts


def _size(value: object) -> tuple[int, int]:
    if not isinstance(value, list) or len(value) != 2:
        raise InputError("must be [width, height]")
    return whole_number(value[0], 1, MAX_SIDE), whole_number(value[1], 1, MAX_SIDE)


def _frames(value: object) -> Frames:
    if value == "loop":
        return "loop"
    try:
        return whole_number(value, 1, 1_000_000)
    except InputError as error:
        raise InputError(f'{error}, or "loop"') from None


def _seeds(value: object) -> tuple[int, ...]:
    if not isinstance(value, list):
        return tuple(range(whole_number(value, 1, 4096)))
    seeds = tuple(whole_number(v, 0, MAX_SEED) for v in value)
    if not seeds or len(set(seeds)) < len(seeds):
        raise InputError("must be different seeds, at least one")
    return seeds


def _metrics(value: object) -> tuple[str, ...]:
    from aliasbench.metrics.catalog import find_metric

    return tuple(find_metric(name).name for name in _texts(value))


def _texture_truth(value: object) -> str:
    if value not in ("point", "linear"):
        raise InputError('must be "point" or "linear"')
    return str(value)


_READERS: Mapping[str, Callable[[Group, object], Group]] = {
    "scenes": lambda group, value: replace(group, scenes=_texts(value)),
    "techniques": lambda group, value: replace(group, techniques=_texts(value)),
    "size": lambda group, value: replace(group, size=_size(value)),
    "frames": lambda group, value: replace(group, frames=_frames(value)),
    "seeds": lambda group, value: replace(group, seeds=_seeds(value)),
    "rounds": lambda group, value: replace(group, rounds=whole_number(value, 1, 100_000)),
    "metrics": lambda group, value: replace(group, metrics=_metrics(value)),
    "texture_truth": lambda group, value: replace(group, texture_truth=_texture_truth(value)),
}
