"""What is to be run: a suite and the user's choices become a flat list of cases, every name checked, every default set.

A case is one scene rendered by one technique at one size over some frames and seeds. Everything is checked here, before
anything is rendered; a case's id hashes everything that its pixels depend on, so that the same case has the same id in
every run and a changed scene file is noticed.
"""

import re
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

from aliasbench.bench.hard.case import HARD_CASE, HardCase
from aliasbench.bench.suite_file import Group, SuiteFile, read_suite
from aliasbench.renderers.catalog import resolve_technique
from aliasbench.renderers.technique import Technique
from aliasbench.scenes import files
from aliasbench.scenes.errors import InputError, unknown_name
from aliasbench.scenes.model import Scene, content_digest


@dataclass(frozen=True, slots=True)
class Case:
    """One scene by one technique.

    Attributes
    ----------
    id : str
        Readable, unique, fit for a file name.
    size : (width, height)
        In pixels.
    frames : int
        Number of frames, from frame 0 on, that the metrics see.
    seeds : tuple of int
        Each is rendered; with more than one the metrics see them all. The first one is timed and shown.
    rounds : int
        Timed renders.
    metrics : tuple of str or None
        None: every metric.
    texture_truth : str
        What the reference takes a texture for between texels: "point" (constant squares) or "linear".
    """

    id: str
    scene: Scene
    technique: Technique
    size: tuple[int, int]
    frames: int
    seeds: tuple[int, ...]
    rounds: int
    metrics: tuple[str, ...] | None
    texture_truth: str

    def spec(self) -> dict[str, object]:
        """Return the case as records and stores hold it: the scene by its name (the id holds its content)."""
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
            "texture_truth": self.texture_truth,
        }


@dataclass(frozen=True, slots=True)
class HardCheck:
    """One hard case for one of its subjects: it is judged, not measured and timed.

    `size` is what records hold; a hard case chooses its own sizes.
    """

    id: str
    case: HardCase
    subject: str
    size: tuple[int, int] = (0, 0)

    def spec(self) -> dict[str, object]:
        """Return the check as records and stores hold it: the hard case's name in the scene's place."""
        return {
            "id": self.id,
            "scene": self.case.name,
            "technique": self.subject,
            "size": list(self.size),
            "seed": 0,
            "seeds": [0],
            "frames": 1,
            "rounds": 0,
            "metrics": [HARD_CASE],
            "texture_truth": "point",
        }


@dataclass(frozen=True, slots=True)
class Plan:
    """The suite's name and its cases in the order they are run: those of a scene follow each other.

    `checks` come first.
    """

    name: str
    cases: tuple[Case, ...]
    checks: tuple[HardCheck, ...] = ()

    def specs(self) -> list[dict[str, object]]:
        """Return all of it as stores hold it."""
        return [*(check.spec() for check in self.checks), *(case.spec() for case in self.cases)]


@dataclass(frozen=True, slots=True)
class Request:
    """What the user asked to run, as text: enough to plan the same cases again.

    `suite` is a name or a file, or None: then `scenes` by `techniques` (default: those of the quick suite). With a
    suite, they choose among its cases. `size`, `frames`, `seeds` and `rounds` override the suite's. `shard` = (i, n)
    keeps every n-th case from the i-th, counted from 1.
    """

    suite: str | None = None
    scenes: tuple[str, ...] = ()
    techniques: tuple[str, ...] = ()
    size: tuple[int, int] | None = None
    frames: int | None = None
    seeds: int | None = None
    rounds: int | None = None
    shard: tuple[int, int] = (1, 1)


def plan_run(request: Request) -> Plan:
    """Return the cases that a request asks for.

    Raises
    ------
    InputError
        For an unknown name, key or value, a missing or broken file, or a case that is there twice.
    """
    suite = _ad_hoc(request) if request.suite is None else read_suite(request.suite)
    cases = _expand(suite, [_overridden(group, request) for group in suite.groups])
    checks = _checks(suite)
    if request.suite is not None:
        cases, checks = _choose(cases, checks, request)
    number, count = request.shard
    mine = [*checks, *cases][number - 1 :: count]
    return Plan(
        suite.name,
        tuple(item for item in mine if isinstance(item, Case)),
        tuple(item for item in mine if isinstance(item, HardCheck)),
    )


def _checks(suite: SuiteFile) -> list[HardCheck]:
    from aliasbench.bench.hard.catalog import HARD_CASES

    return [
        HardCheck(re.sub(r"[^A-Za-z0-9.]+", "-", f"hard {name} {subject}").strip("-."), HARD_CASES[name], subject)
        for name in suite.hard_cases
        for subject in HARD_CASES[name].subjects
    ]


def _ad_hoc(request: Request) -> SuiteFile:
    if not request.scenes:
        raise InputError("nothing to run: name a suite, or scenes with --scene")
    techniques = request.techniques or read_suite("quick").groups[0].techniques
    return SuiteFile("custom", "command line", None, (Group(request.scenes, techniques),))


def _overridden(group: Group, request: Request) -> Group:
    return replace(
        group,
        size=request.size or group.size,
        frames=request.frames or group.frames,
        seeds=tuple(range(request.seeds)) if request.seeds else group.seeds,
        rounds=request.rounds or group.rounds,
    )


def _expand(suite: SuiteFile, groups: Sequence[Group]) -> list[Case]:
    """Return scenes x techniques of every group, each scene's cases of one size together, in order of appearance."""
    scenes: dict[str, tuple[Scene, str]] = {}
    names: dict[str, str] = {}
    cases: dict[Hashable, Case] = {}
    for group in groups:
        for scene_text in group.scenes:
            if scene_text not in scenes:
                scene = _load(suite, scene_text)
                scenes[scene_text] = scene, content_digest(scene)
            scene, digest = scenes[scene_text]
            if names.setdefault(scene.name, digest) != digest:
                raise InputError(f"{suite.where}: two different scenes are called {scene.name!r}; rename one")
            for technique_text in group.techniques:
                case = _case(scene, digest, _technique(suite, technique_text), group)
                same = cases.setdefault(_pixels_key(case), case)
                if same is not case:
                    raise InputError(f"{suite.where}: {scene.name} by {_twice(same.technique, case.technique)}")
    order = {(c.scene.name, c.size): i for i, c in reversed(list(enumerate(cases.values())))}
    return sorted(cases.values(), key=lambda c: order[c.scene.name, c.size])


def _pixels_key(case: Case) -> Hashable:
    """Return what two cases have in common if they are the same one, however their techniques are spelled."""
    return case.scene.name, _meaning(case.technique), case.size, case.frames, case.seeds, case.texture_truth


def _meaning(technique: Technique) -> Technique:
    return replace(technique, text="")


def _twice(one: Technique, other: Technique) -> str:
    if one.text == other.text:
        return f"{one.text} is there twice"
    return f"{one.text} is there twice: {other.text} is the same technique spelled differently; leave one of them out"


def _load(suite: SuiteFile, text: str) -> Scene:
    beside = suite.folder / text if suite.folder is not None else None
    try:
        return files.load_scene(str(beside) if beside is not None and beside.is_file() else text)
    except InputError as error:
        raise InputError(f"{suite.where}: {error}") from None


def _technique(suite: SuiteFile, text: str) -> Technique:
    try:
        return resolve_technique(text)
    except InputError as error:
        raise InputError(f"{suite.where}: {error}") from None


def _case(scene: Scene, digest: str, technique: Technique, group: Group) -> Case:
    frames = scene.animation.frames if group.frames == "loop" else group.frames
    content = (digest, technique, group.size, frames, group.seeds, group.texture_truth)
    width, height = group.size
    slug = re.sub(r"[^A-Za-z0-9.]+", "-", f"{scene.name} {technique.text} {width}x{height}").strip("-.")[:100]
    return Case(
        f"{slug}-{content_digest(content)[:12]}",
        scene,
        technique,
        group.size,
        frames,
        group.seeds,
        group.rounds,
        group.metrics,
        group.texture_truth,
    )


def _choose(cases: list[Case], checks: list[HardCheck], request: Request) -> tuple[list[Case], list[HardCheck]]:
    """Return what the request's scenes and techniques choose; a name without parameters means all of that name."""
    if request.scenes:
        names = {case.scene.name for case in cases} | {check.case.name for check in checks}
        known = names | {name.partition(":")[0] for name in names}
        for text in request.scenes:
            if text not in known:
                raise unknown_name("scene of this suite:", text, known)
        exact = names.intersection(request.scenes)
        short = set(request.scenes) - exact
        cases = [c for c in cases if c.scene.name in exact or c.scene.name.partition(":")[0] in short]
        checks = [c for c in checks if c.case.name in exact]
    if request.techniques:
        known_techniques = {_meaning(case.technique) for case in cases}
        subjects = {check.subject for check in checks}
        wanted = {text.strip(): resolve_technique(text) for text in request.techniques if text.strip() not in subjects}
        for technique in wanted.values():
            if _meaning(technique) not in known_techniques:
                texts = {c.technique.text for c in cases} | subjects
                raise unknown_name("technique of this suite:", technique.text, texts)
        meanings = {_meaning(technique) for technique in wanted.values()}
        cases = [c for c in cases if _meaning(c.technique) in meanings]
        checks = [c for c in checks if c.subject in {text.strip() for text in request.techniques}]
    return cases, checks
