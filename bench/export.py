"""What a run found, in the form that programs read: the records of `export`, of the report and of comparisons.

Records are derived from what the store holds, and hold raw timings: statistics are for whoever reads them.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TypedDict

from aliasbench.bench import store as stores
from aliasbench.bench.store import Json

SCHEMA = 1


class Record(TypedDict):
    """One finished case.

    `status` is "ok", "failed" or "unsupported", `error` then the reason; `seconds` are the raw timings of frame 0;
    `metrics` are {name: {"value": float or None, "status": str, "extras": {...}}}; `images` are paths relative to the
    run directory ("frame" and "reference", missing where there is none); `uncertainty` is the reference's largest.
    """

    id: str
    scene: str
    technique: str
    size: list[int]
    seed: int
    seeds: list[int]
    frames: int
    status: str
    error: str | None
    seconds: list[float]
    setup_seconds: float | None
    samples: int | None
    uncertainty: float | None
    uncertainty_kind: str | None
    images: dict[str, str]
    metrics: dict[str, dict[str, object]]


class Run(TypedDict):
    """A run: `unfinished` is how many cases of its plan have no record yet."""

    schema: int
    suite: str
    started: str
    machine: dict[str, str]
    unfinished: int
    records: list[Record]


def load_run(run_dir: Path) -> Run:
    """Return the records of a run directory, exactly what `export --format json` prints; reads only.

    Raises
    ------
    InputError
        If the folder holds no run, a damaged one, or one of a newer version.
    """
    facts = stores.read_facts(run_dir)
    cases = stores.read_cases(run_dir)
    records = [_record(case.spec, case.outcome, case.seconds) for case in cases if case.outcome and case.is_finished]
    return {
        "schema": SCHEMA,
        "suite": facts["suite"],
        "started": facts["started"],
        "machine": facts["machine"],
        "unfinished": len(cases) - len(records),
        "records": records,
    }


def _record(spec: Json, outcome: Json, seconds: Sequence[float]) -> Record:
    return {
        "id": spec["id"],
        "scene": spec["scene"],
        "technique": spec["technique"],
        "size": spec["size"],
        "seed": spec["seed"],
        "seeds": spec["seeds"],
        "frames": spec["frames"],
        "status": outcome["status"],
        "error": outcome["error"],
        "seconds": list(seconds),
        "setup_seconds": outcome.get("setup_seconds"),
        "samples": outcome.get("samples"),
        "uncertainty": outcome.get("uncertainty"),
        "uncertainty_kind": outcome.get("uncertainty_kind"),
        "images": outcome.get("images", {}),
        "metrics": outcome.get("metrics", {}),
    }
