"""What is to be run: a suite file (TOML, schema 1) becomes a flat list of cases, every default resolved.

A case is one scene rendered by one technique at one size over some frames and seeds. All names are checked here, before
anything is rendered; a case's id hashes everything its pixels depend on, so that the same case has the same id in every
run and a changed scene file is noticed.
"""

import re
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import TypeVar

from aliasbench.bench import values
from aliasbench.renderers.catalog import resolve_technique
from aliasbench.renderers.technique import Technique
from aliasbench.scenes import files
from aliasbench.scenes.errors import InputError, unknown_name
from aliasbench.scenes.model import Scene, content_digest

SCHEMA = 1
DEFAULT_SIZE = (256, 256)
DEFAULT_ROUNDS = 5


@dataclass(frozen=True, slots=True)
class SuiteEntry:
    """A packaged suite: what it is for, and its file below `bench/suites`."""

    summary: str
    file: str


SUITES: Mapping[str, SuiteEntry] = {
    "quick": SuiteEntry("five scenes, the main techniques of both renderers, at 256 x 256: about a minute", "quick.toml"),
}


@dataclass(frozen=True, slots=True)
class Case:
    """One scene by one technique.

    Attributes
    ----------
    id : str
        Readable, unique, fit for a file name.
    size : (width, height)
    frames : int
        Number of frames from frame 0 that the metrics see.
    seeds : tuple of int
        Each is rendered; with more than one the metrics see them all. The first one is timed and shown.
    rounds : int
        Timed renders.
    metrics : tuple of str or None
        None: every metric.
    truth : str
        What a texture's true value is between texels: "point" (constant squares) or "linear".
    """

    id: str
    scene: Scene
    technique: Technique
    size: tuple[int, int]
    frames: int
    seeds: tuple[int, ...]
    rounds: int
    metrics: tuple[str, ...] | None
    truth: str

    def spec(self) -> dict[str, object]:
        """Return the case without its scene's content, as records and stores hold it."""
        return {
            "id": self.id,
            "scene": self.scene.name,
            "technique": self.technique.text,
            "size": list(self.size),
            "seed": self.seeds[0],
            "seeds": list(self.seeds),
            "frames": self.frames,
            "rounds": self.rounds,
            "metrics": None if self.metrics is None else list(self.metrics),
            "truth": self.truth,
        }


@dataclass(frozen=True, slots=True)
class Suite:
    """A name and the cases in the order they are run: those of a scene follow each other."""

    name: str
    cases: tuple[Case, ...]


@dataclass(frozen=True, slots=True)
class Request:
    """What the user asked to run, as text: enough to plan the same cases again.

    `suite` is a name or a file, or None for the scenes and techniques alone; with a suite, `scenes` and `techniques`
    choose among its cases. The other values override the suite's. `shard` = (i, n): every n-th case from the i-th.
    """

    suite: str | None = None
    scenes: tuple[str, ...] = ()
    techniques: tuple[str, ...] = ()
    size: tuple[int, int] | None = None
    frames: int | None = None
    seeds: int | None = None
    rounds: int | None = None
    shard: tuple[int, int] = (1, 1)


_GROUP_KEYS: Mapping[str, Callable[[str, object], object]] = {
    "scenes": values.texts,
    "techniques": values.texts,
    "size": values.size,
    "frames": values.frames,
    "seeds": values.seeds,
    "rounds": values.whole(1, 100_000),
    "metrics": values.metrics,
    "texture_truth": values.choice("point", "linear"),
}
_SUITE_KEYS = ("schema", "name", "summary", "case", *_GROUP_KEYS)


def plan(request: Request) -> Suite:
    """Return the suite that a request asks for.

    Raises
    ------
    InputError
        For an unknown name, key or value, a missing or broken file, or a choice that leaves no case.
    """
    if request.suite is None:
        if not request.scenes:
            raise InputError("nothing to run: name a suite, or scenes with --scene")
        techniques = request.techniques or tuple(_read(*_packaged("quick"))[1]["techniques"])  # type: ignore[arg-type]
        table = {"scenes": request.scenes, "techniques": techniques}
        suite = Suite("custom", _cases([table], "command line", Path.cwd(), request))
    else:
        where, document, folder = _document(request.suite)
        suite = Suite(str(document.get("name", where)), _cases(_groups(document), where, folder, request))
        suite = _choose(suite, request)
    number, count = request.shard
    return replace(suite, cases=suite.cases[number - 1 :: count])
