"""Fabricated runs: small pictures with known errors, so that the page is tested without rendering anything."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aliasbench.bench import export
from aliasbench.bench.frames import write_image
from aliasbench.reports.page import write_report

MACHINE = {
    "cpu": "Testium 9000",
    "cores": "2",
    "os": "TestOS 1",
    "opengl": "softpipe",
    "embree": "4.4.0",
    "numpy": "2.1",
}
SIDE = 64


def disc(samples: int, seed: int | None = None) -> np.ndarray:
    """Return (64, 64, 3) coverage of a disc by `samples` x `samples` points a pixel, jittered where a seed is given."""
    rng = np.random.default_rng(seed)
    shift = rng.random((SIDE * samples, SIDE * samples, 2)) if seed is not None else 0.5
    at = (np.stack(np.mgrid[: SIDE * samples, : SIDE * samples], axis=-1) + shift) / samples
    inside = np.hypot(at[..., 0] - 30.3, at[..., 1] - 33.7) < 20.2
    grey = inside.reshape(SIDE, samples, SIDE, samples).mean(axis=(1, 3))
    return np.repeat(grey[..., None], 3, axis=2).astype(np.float32)


def score(value: float | None, status: str = "ok", **extras: object) -> dict[str, Any]:
    """Return a metric of a record."""
    return {"value": value, "status": status, "extras": extras}


def record(scene: str, technique: str, **changes: Any) -> dict[str, Any]:
    """Return a record that came out ok, with some of its fields changed."""
    base: dict[str, Any] = {
        "id": f"{scene} {technique}",
        "scene": scene,
        "technique": technique,
        "size": [SIDE, SIDE],
        "seed": 0,
        "frames": 1,
        "status": "ok",
        "error": None,
        "seconds": [0.010, 0.0102, 0.0101, 0.0103, 0.0101],
        "setup_seconds": 0.02,
        "samples": SIDE * SIDE,
        "uncertainty": 1e-12,
        "images": {},
        "metrics": {"rmse": score(0.05), "strobing": score(None, "not_applicable")},
    }
    return base | changes


def make_run(folder: Path, records: Sequence[dict[str, Any]], pictures: Mapping[str, np.ndarray], **facts: Any) -> Path:
    """Make a run directory of some records and pictures, in the form that `load` reads."""
    folder.mkdir(parents=True)
    for file, pixels in pictures.items():
        (folder / file).parent.mkdir(exist_ok=True)
        write_image(folder / file, pixels)
    data = {"schema": 1, "machine": MACHINE, "suite": "quick", "records": list(records)} | facts
    (folder / "run.json").write_text(json.dumps(data), encoding="utf-8")
    return folder


def load(run_dir: Path) -> dict[str, Any]:
    """Stand in for `export.load_run`."""
    data: dict[str, Any] = json.loads((run_dir / "run.json").read_text(encoding="utf-8"))
    return data


def make_typical(folder: Path) -> Path:
    """Make a run of one scene by four techniques with pictures (one exact), a failure and an unsupported case."""
    rows = [
        ("raytrace:", disc(1), 0.08, 0.002),
        ("raytrace:spp=16,sampler=jittered", disc(4, seed=1), 0.02, 0.011),
        ("raster:msaa=4", disc(2), 0.04, 0.02),
        ("raster:", disc(16), 0.0, 0.01),
    ]
    pictures = {"frames/ref.exr": disc(16)}
    records = []
    for number, (technique, pixels, rmse, s) in enumerate(rows):
        pictures[f"frames/{number}.exr"] = pixels
        records.append(
            record(
                "disc",
                technique,
                images={"frame": f"frames/{number}.exr", "reference": "frames/ref.exr"},
                seconds=[s, s * 1.02, s * 1.01, s * 1.03, s],
                metrics={
                    "rmse": score(rmse),
                    "jaggies": score(rmse * 3, columns=64),
                    "strobing": score(None, "not_applicable"),
                },
            )
        )
    for technique, status, error in (
        ("raster:msaa=16", "failed", "16 samples are more than this device has"),
        ("raster:ssaa=2", "unsupported", "the rasterizer has no dispersion"),
    ):
        records.append(record("disc", technique, status=status, error=error, seconds=[], metrics={}))
    return make_run(folder, records, pictures)


@pytest.fixture
def fabricate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    """Return a function that makes a run directory of some records, which `load_run` then reads."""
    monkeypatch.setattr(export, "load_run", load)

    def make(
        records: Sequence[dict[str, Any]],
        name: str = "run",
        *,
        pictures: Mapping[str, np.ndarray] | None = None,
        **facts: Any,
    ) -> Path:
        return make_run(tmp_path / name, records, pictures or {}, **facts)

    return make


@pytest.fixture
def make_record() -> Callable[..., dict[str, Any]]:
    """Return `record`."""
    return record


@pytest.fixture
def make_score() -> Callable[..., dict[str, Any]]:
    """Return `score`."""
    return score


@pytest.fixture
def typical(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the run of `make_typical`."""
    monkeypatch.setattr(export, "load_run", load)
    return make_typical(tmp_path / "run")


@pytest.fixture(scope="session")
def typical_page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the path of the report of that run, written once."""
    folder = tmp_path_factory.mktemp("typical")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(export, "load_run", load)
        return write_report([make_typical(folder / "run")], folder / "out")
