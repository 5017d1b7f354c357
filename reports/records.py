"""The records of one or several runs as typed values: the only module here that touches the untyped JSON.

Everything downstream (figures, charts, tables) works on `Record`, so that a missing key or an odd value is met once,
here, and shows on the page as a dash or a sentence instead of ending the report.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, cast

from aliasbench.bench import export
from aliasbench.bench.timing import TimingSummary, summarise
from aliasbench.renderers.catalog import TECHNIQUES
from aliasbench.scenes.errors import InputError

Status = Literal["ok", "failed", "unsupported"]
STATUSES: tuple[Status, ...] = ("ok", "failed", "unsupported")
# How a key of the technique text reads in a label; every other key is followed by its value.
_WORDS: Mapping[str, str] = {
    "spp": "{} spp",
    "passes": "{} passes",
    "msaa": "{}× MSAA",
    "ssaa": "{0}×{0} SSAA",
    "sampler": "{}",
    "filter": "{}",
    "texture": "{}",
    "post": "{}",
}


@dataclass(frozen=True, slots=True)
class Score:
    """One metric of one record: a finite value or None, the status that explains it, and further figures."""

    value: float | None
    status: str
    extras: Mapping[str, Any]

    @property
    def floor(self) -> float | None:
        """What the value is known to be below, where the reference is too uncertain to say more."""
        return _finite(self.extras.get("floor")) if self.status == "below_reference_floor" else None


@dataclass(frozen=True, slots=True)
class Record:
    """One case of one run; `run` is the label of the run, `folder` where its image files are.

    `timing` is None where nothing was timed; times are in seconds, and `seconds` the raw ones, round after round.
    `uncertainty` is the reference's, None if unknown.
    """

    run: str
    folder: Path
    scene: str
    technique: str
    size: tuple[int, int]
    seed: str
    frames: int
    status: str
    error: str
    timing: TimingSummary | None
    setup_seconds: float | None
    samples: int | None
    images: Mapping[str, str] = field(default_factory=dict)
    metrics: Mapping[str, Score] = field(default_factory=dict)
    uncertainty: float | None = None
    uncertainty_kind: str | None = None
    seconds: tuple[float, ...] = ()

    @property
    def renderer(self) -> str:
        """The renderer's name: what stands before the colon of the technique text."""
        return TECHNIQUES.get(self.technique, self.technique).partition(":")[0].strip()

    @property
    def short(self) -> str:
        """The technique in few characters, for labels in charts: values alone where they speak for themselves."""
        _, _, tail = TECHNIQUES.get(self.technique, self.technique).partition(":")
        pairs = [
            (key.strip(), value.strip()) for key, _, value in (p.partition("=") for p in tail.split(",") if p.strip())
        ]
        counted = any(key in ("spp", "passes", "msaa", "ssaa", "adaptive") for key, _ in pairs)
        words = [_WORDS.get(key, f"{key} {{}}").format(value) for key, value in pairs]
        return " ".join(words if counted else ["1 sample", *words])

    def value(self, metric: str) -> float | None:
        """Return the value of a metric, None where it has none."""
        score = self.metrics.get(metric)
        return score.value if score else None


@dataclass(frozen=True, slots=True)
class Run:
    """One run directory: a label unique on the page, the machine's facts and the records."""

    label: str
    suite: str
    started: str
    unfinished: int
    machine: Mapping[str, str]
    records: tuple[Record, ...]


def load_runs(run_dirs: Sequence[Path]) -> tuple[Run, ...]:
    """Return the runs of some directories in the order given.

    Raises
    ------
    InputError
        If no directory is given, or one holds no run (the message names it).
    """
    if not run_dirs:
        raise InputError("a report needs at least one run directory")
    labels = unique_labels(run_dirs)
    return tuple(_read_run(folder, label) for folder, label in zip(run_dirs, labels, strict=True))


def unique_labels(run_dirs: Sequence[Path]) -> list[str]:
    """Return one label for each directory: its name, with parents as far as needed, numbered where still the same."""
    paths = [Path(p).resolve() for p in run_dirs]
    deepest = max((len(p.parts) for p in paths), default=1)
    for depth in range(1, deepest + 1):
        labels = ["/".join(p.parts[-depth:]) for p in paths]
        if len(set(labels)) == len(labels):
            return labels
    return [f"{path.name} ({number})" for number, path in enumerate(paths, 1)]


def _read_run(folder: Path, label: str) -> Run:
    data = cast(Mapping[str, Any], export.load_run(folder))
    records = tuple(_read_record(r, folder, label) for r in data.get("records") or ())
    return Run(
        label=label,
        suite=_plain(data.get("suite")),
        started=_plain(data.get("started")),
        unfinished=int(data.get("unfinished") or 0),
        machine=dict(_flatten(data.get("machine") or {})),
        records=records,
    )


def _read_record(r: Mapping[str, Any], folder: Path, label: str) -> Record:
    width, height = (r.get("size") or (0, 0))[:2]
    seconds = [float(s) for s in r.get("seconds") or ()]
    return Record(
        run=label,
        folder=folder,
        scene=str(r.get("scene", "")),
        technique=str(r.get("technique", "")),
        size=(int(width), int(height)),
        seed=_plain(r.get("seeds") or r.get("seed")),
        frames=int(r.get("frames") or 0),
        status=str(r.get("status", "")),
        error=str(r.get("error") or ""),
        timing=summarise(seconds) if seconds else None,
        setup_seconds=_finite(r.get("setup_seconds")),
        samples=None if r.get("samples") is None else int(r["samples"]),
        images={str(k): str(v) for k, v in (r.get("images") or {}).items() if v},
        metrics={str(name): _read_score(score) for name, score in (r.get("metrics") or {}).items()},
        uncertainty=_finite(r.get("uncertainty")),
        uncertainty_kind=r.get("uncertainty_kind"),
        seconds=tuple(seconds),
    )


def _read_score(score: Mapping[str, Any]) -> Score:
    return Score(_finite(score.get("value")), str(score.get("status", "")), score.get("extras") or {})


def _finite(value: Any) -> float | None:
    return float(value) if isinstance(value, (int, float)) and math.isfinite(value) else None


def _flatten(facts: Mapping[str, Any], prefix: str = "") -> list[tuple[str, str]]:
    """Return nested facts as pairs, inner keys after their parent's: `("packages numpy", "2.4")`."""
    pairs: list[tuple[str, str]] = []
    for key, value in facts.items():
        name = f"{prefix}{key}".replace("_", " ")
        if isinstance(value, Mapping):
            pairs += _flatten(value, f"{name} ")
        else:
            pairs.append((name, _plain(value)))
    return pairs


def _plain(value: Any) -> str:
    """Return a JSON value as a reader would write it: lists with commas, nothing for null."""
    if value is None:
        return ""
    return ", ".join(_plain(v) for v in value) if isinstance(value, (list, tuple)) else str(value)
