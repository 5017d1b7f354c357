"""The runner: references first, then every technique's pictures and their scores, then speed in interleaved rounds.

Cases of one scene and size are run together, because only times measured in the same minute may be compared. What fails
is recorded with its reason and the run goes on; what is done is committed at once and never done again, so a run that
was killed goes on where it was and ends with the same records.
"""

import gc
import hashlib
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aliasbench.bench import store as stores
from aliasbench.bench.attempt import Attempt
from aliasbench.bench.centers import (
    Further,
    Truth,
    center_frames,
    center_technique,
    center_truth,
    full_truth,
    own_truth,
    truths_of,
    truths_of_all,
)
from aliasbench.bench.frames import write_image
from aliasbench.bench.hard.case import verdict_outcome
from aliasbench.bench.machine import describe_machine
from aliasbench.bench.quality import MetricError, describe_nonfinite, measure_all, render_frames
from aliasbench.bench.resume import check_folder, forget_lost_pictures, refuse_other_run, stored_request
from aliasbench.bench.store import RunStore, StoredCase
from aliasbench.bench.suite import Case, HardCheck, Plan, Request, plan_run
from aliasbench.bench.timing import interleaved
from aliasbench.bench.truth import Reference, render_reference
from aliasbench.renderers import catalog
from aliasbench.renderers.frame import Prepared
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import content_digest


@dataclass(frozen=True, slots=True)
class Step:
    """How far a run is: what it is doing now, and how many of its renders are done."""

    doing: str
    done: int
    total: int


OnStep = Callable[[Step], None]


@dataclass(slots=True)
class _Progress:
    """Counts renders and tells the listener."""

    total: int
    on_step: OnStep | None
    done: int = 0
    doing: str = ""

    def say(self, doing: str) -> None:
        self.doing = doing
        self.advance(0)

    def advance(self, steps: int = 1) -> None:
        self.done += steps
        if self.on_step is not None:
            self.on_step(Step(self.doing, min(self.done, self.total), self.total))


@dataclass(slots=True)
class _Group:
    """What is alive while the cases of one scene and size are run: prepared techniques and references."""

    store: RunStore
    progress: _Progress
    stack: ExitStack
    prepared: dict[str, Prepared] = field(default_factory=dict)
    references: dict[str, Reference | Attempt] = field(default_factory=dict)


def start_run(
    request: Request, run_dir: Path, *, resume: bool = False, fresh: bool = False, on_step: OnStep | None = None
) -> None:
    """Run what is asked for into a run directory, to the end.

    Parameters
    ----------
    request : Request
        With `resume` it may name nothing: then what the run began with is gone on with.
    run_dir : Path
        Made where it is missing.
    resume : bool
        Go on with the run in the directory; where it was killed before it began, begin. Cases of which a picture is
        missing or damaged are done again.
    fresh : bool
        Replace the run in the directory.
    on_step : callable, optional
        Told before and after each render.

    Raises
    ------
    InputError
        If the request is wrong, the directory holds a run and neither `resume` nor `fresh` is given, or other files
        and no run, the run to go on with is missing, has other cases or was made by another machine or version, or
        another process writes there.
    """
    if resume and fresh:
        raise InputError("--resume goes on with a run and --fresh replaces it: give one of them")
    # A run may have been killed before it made its folder: then what is asked for begins.
    holds_run = check_folder(run_dir, must_exist=resume and request == Request())
    going_on = resume and holds_run
    if going_on and request == Request():
        request = stored_request(run_dir)
    plan = plan_run(request)
    facts = _facts(request, plan)
    if going_on:
        refuse_other_run(run_dir, facts)
        store = RunStore.reopen(run_dir)
    else:
        if fresh and holds_run:
            stores.remove_run(run_dir)
        store = RunStore.create(run_dir, facts, plan.specs())
    with store:
        lost = forget_lost_pictures(store)
        if lost and on_step is not None:
            on_step(Step(f"{lost} case{'s' if lost > 1 else ''} done again: pictures missing or damaged", 0, 0))
        if plan.checks:
            judge(plan.checks, store, on_step)
        if plan.cases or not plan.checks:
            execute(plan.cases, store, on_step)


def judge(checks: Iterable[HardCheck], store: RunStore, on_step: OnStep | None = None) -> None:
    """Ask what is left of the hard cases, in order, committing each verdict as soon as it is there."""
    known = {case.spec["id"] for case in store.cases() if case.outcome is not None}
    todo = [check for check in checks if check.id not in known]
    progress = _Progress(len(todo), on_step)
    for check in todo:
        progress.say(f"{check.case.name}: {check.subject}")
        attempt = Attempt()
        with attempt:
            outcome = verdict_outcome(check.case, check.case.check(check.subject))
        if attempt.error is not None:
            outcome = {"status": attempt.status, "error": attempt.reason}
        store.add_outcome(check.id, outcome, trace=attempt.trace)
        progress.advance()
    progress.say("done" if todo else "nothing left to do")


def execute(cases: Iterable[Case], store: RunStore, on_step: OnStep | None = None) -> None:
    """Do what is left to do of the cases, in order, committing each result as soon as it is there."""
    stored = {case.spec["id"]: case for case in store.cases()}
    groups = [list(g) for _, g in groupby(cases, key=lambda c: (c.scene.name, c.size))]
    groups = [[c for c in group if not stored[c.id].is_finished] for group in groups]
    steps = [_steps(group, stored) for group in groups]
    progress = _Progress(sum(steps), on_step)
    for group, count in zip(groups, steps, strict=True):
        if group:
            planned = progress.done + count
            with ExitStack() as stack:
                live = _Group(store, progress, stack)
                _find_quality(group, live)
                _find_speed(group, live)
            progress.advance(planned - progress.done)
    progress.say("done" if progress.total else "nothing left to do")


def _steps(group: list[Case], stored: Mapping[str, StoredCase]) -> int:
    """Return how many renders are left to do if none of them fails."""
    todo = [c for c in group if stored[c.id].outcome is None]
    quality = sum(truth.frames for truth in truths_of_all(todo).values())
    quality += sum(c.frames * len(c.seeds) + center_frames(c) for c in todo)
    return quality + sum(c.rounds - len(stored[c.id].seconds) + 1 for c in group if not _is_timed(c, stored[c.id]))


def _is_timed(case: Case, stored: StoredCase) -> bool:
    return len(stored.seconds) >= case.rounds


def _find_quality(group: list[Case], live: _Group) -> None:
    """Render and measure the cases that have no outcome yet."""
    known = {stored.spec["id"] for stored in live.store.cases() if stored.outcome is not None}
    todo = [case for case in group if case.id not in known]
    truths = truths_of_all(todo)
    for case in todo:
        for name in (truth.name for truth in truths_of(case)):
            if name not in live.references:
                live.progress.say(f"{case.scene.name}: {name}")
                live.references[name] = _make_reference(truths[name], case.size, live)
        live.progress.say(f"{case.scene.name}: {case.technique.text}")
        attempt = Attempt()
        with attempt:
            outcome = _quality_of(case, live)
        if attempt.error is not None:
            live.prepared.pop(case.id, None)
            outcome = {"status": attempt.status, "error": attempt.reason}
        live.store.add_outcome(case.id, outcome, trace=attempt.trace)


def _make_reference(truth: Truth, size: tuple[int, int], live: _Group) -> Reference | Attempt:
    with Attempt() as attempt:
        reference = render_reference(truth.scene, truth.technique, size, truth.frames, live.progress.advance)
        write_image(live.store.run_dir / _reference_path(truth, size), reference.pixels[0])
        return reference
    return attempt


def _reference_path(truth: Truth, size: tuple[int, int]) -> str:
    digest = content_digest((truth.scene, size, truth.technique.text))
    return f"{stores.REFERENCES}/{digest[:24]}.exr"


def _quality_of(case: Case, live: _Group) -> dict[str, object]:
    """Return the outcome of a case: its pictures rendered, the first one kept, all of them measured."""
    prepared = _prepare(case, live)
    test, first = render_frames(case, prepared, live.progress.advance)
    images = {"frame": f"{stores.FRAMES}/{case.id}.exr"}
    write_image(live.store.run_dir / images["frame"], test.reshape(-1, *test.shape[-3:])[0])
    outcome: dict[str, object] = {
        "status": "ok",
        "error": None,
        "setup_seconds": first.setup_seconds,
        "samples": int(first.samples),
        "images": images,
        "metrics": {},
    }
    truth = own_truth(case)
    reference = live.references[truth.name]
    if isinstance(reference, Attempt):
        return outcome | {"status": "failed", "error": f"no reference: {reference.reason}"}
    images["reference"] = _reference_path(truth, case.size)
    outcome |= {"uncertainty": reference.uncertainty, "uncertainty_kind": reference.uncertainty_kind}
    further = _further(case, test, live)
    problem = describe_nonfinite(test) or (further and describe_nonfinite(further.test))
    if problem:
        outcome |= {"status": "failed", "error": problem}
    try:
        return outcome | {"metrics": measure_all(case, test, reference, further)}
    except MetricError as error:
        return outcome | {"status": "failed", "error": str(error)}


def _further(case: Case, test: NDArray[np.float32], live: _Group) -> Further | None:
    """Return what tells errors in space from errors in time; None where nothing asks for it or the truth failed."""
    found = [None if t is None else live.references[t.name] for t in (center_truth(case), full_truth(case))]
    at_center, full_shutter = (None if isinstance(reference, Attempt) else reference for reference in found)
    if at_center is None:
        return None
    if center_frames(case):
        technique = center_technique(case)
        live.progress.say(f"{case.scene.name}: {technique.text}")
        with catalog.prepare(case.scene, technique, size=case.size) as prepared:
            test, _ = render_frames(case, prepared, live.progress.advance)
    return Further(test, at_center, full_shutter)


def _prepare(case: Case, live: _Group) -> Prepared:
    if case.id not in live.prepared:
        prepared = catalog.prepare(case.scene, case.technique, size=case.size)
        live.prepared[case.id] = live.stack.enter_context(prepared)
    return live.prepared[case.id]


def _find_speed(group: list[Case], live: _Group) -> None:
    """Time the cases that came out well, in rounds interleaved over them, going on after the rounds already kept."""
    stored = {s.spec["id"]: s for s in live.store.cases()}
    running = [case for case in group if not stored[case.id].is_finished]
    if not running:
        return
    live.progress.say(f"{running[0].scene.name}: speed")
    broken = {case.id for case in running if _time_once(case, stored[case.id], live) is None}
    gc.collect()
    for number, order in interleaved(len(running), max(case.rounds for case in running)):
        seconds: dict[str, float] = {}
        for case in (running[i] for i in order):
            if case.id in broken or not len(stored[case.id].seconds) <= number < case.rounds:
                continue
            taken = _time_once(case, stored[case.id], live)
            if taken is None:
                broken.add(case.id)
            else:
                seconds[case.id] = taken
        live.store.add_round(number, seconds)


def _time_once(case: Case, stored: StoredCase, live: _Group) -> float | None:
    """Return the seconds of one more render of a case's first frame, or None, recorded, where it broke."""
    with Attempt() as attempt:
        seconds = _prepare(case, live).render(frame=0, seed=case.seeds[0]).seconds
        live.progress.advance()
        return seconds
    failure = {"status": attempt.status, "error": f"while timing: {attempt.reason}"}
    live.store.add_outcome(case.id, {**(stored.outcome or {}), **failure}, trace=attempt.trace)
    return None


def _facts(request: Request, plan: Plan) -> dict[str, Any]:
    return {
        "suite": plan.name,
        "request": asdict(request),
        "plan": hashlib.sha256(repr(plan.specs()).encode()).hexdigest(),
        "machine": describe_machine(),
        "started": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
    }
