"""Renderers that cost nothing: pictures are a hash of what was asked, so that any mix-up shows."""

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from types import TracebackType
from typing import Self

import numpy as np
import pytest

from aliasbench.bench import cli
from aliasbench.renderers import catalog
from aliasbench.renderers.frame import Frame
from aliasbench.renderers.technique import Technique
from aliasbench.scenes.model import Camera, Scene


def hashed_pixels(scene: Scene, technique: Technique, size: tuple[int, int], frame: int, seed: int) -> np.ndarray:
    """Return (h, w, 3) float64 in [0, 1) that no other scene, technique, size, frame and seed has."""
    key = repr((scene.name, technique.text, size, frame, seed)).encode()
    generator = np.random.default_rng(int.from_bytes(hashlib.sha256(key).digest()[:8], "little"))
    return generator.random((size[1], size[0], 3))


@dataclass
class FakeRenderers:
    """What was asked of the renderers, in order, and what is to break."""

    log: list[tuple[str, str, int, int]] = field(default_factory=list)
    open_count: int = 0
    fail: Callable[[str, str, int], BaseException | None] = lambda *_: None
    change: Callable[[str, np.ndarray], np.ndarray] = lambda _, pixels: pixels

    def rendered(self, technique: str) -> int:
        """Return how often a technique was rendered."""
        return sum(entry[1] == technique for entry in self.log)


@dataclass
class FakePrepared:
    """A prepared scene of the fake renderers."""

    fakes: FakeRenderers
    scene: Scene
    technique: Technique
    size: tuple[int, int]

    def render(self, frame: int = 0, seed: int = 0, progress: Callable[[float], None] | None = None) -> Frame:
        """Return the hashed picture; references are the truth for all with an uncertainty of 1e-9."""
        if progress is not None:
            progress(1.0)
        text = self.technique.text
        problem = self.fakes.fail(self.scene.name, text, self.fakes.rendered(text))
        self.fakes.log.append((self.scene.name, text, frame, seed))
        if problem is not None:
            raise problem
        pixels = self.fakes.change(text, hashed_pixels(self.scene, self.technique, self.size, frame, seed))
        if self.technique.renderer == "reference":
            return Frame(pixels, 0.5, 0.25, 0, uncertainty=1e-9, uncertainty_kind="bound")
        return Frame(pixels.astype(np.float32), 0.002 + 1e-6 * len(self.fakes.log), 0.25, 7 * pixels[..., 0].size)

    def __enter__(self) -> Self:
        self.fakes.open_count += 1
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.fakes.open_count -= 1


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """The command line, called in this process: its exit code and what it wrote to either stream."""

    def call(*arguments: str) -> tuple[int, str, str]:
        code = cli.main(arguments)
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return call


@pytest.fixture
def pixels_of() -> Callable[..., np.ndarray]:
    """The picture that the fake renderers give."""
    return hashed_pixels


@pytest.fixture
def fakes(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeRenderers]:
    """Renderers and scenes that cost nothing; at the end everything prepared must have been closed."""
    made = FakeRenderers()

    def prepare(scene: Scene, technique: str | Technique, *, size: tuple[int, int]) -> FakePrepared:
        chosen = catalog.resolve_technique(technique)
        return FakePrepared(made, scene, chosen, size)

    monkeypatch.setattr(catalog, "prepare", prepare)
    monkeypatch.setattr("aliasbench.scenes.files.load_scene", fake_scene)
    monkeypatch.setattr("aliasbench.bench.machine.project_version", lambda: "0.0")
    monkeypatch.setattr("aliasbench.bench.machine.describe_engines", lambda: {"opengl": "none", "embree": "none"})
    yield made
    assert made.open_count == 0


def fake_scene(text: str) -> Scene:
    """Return an empty scene of any name."""
    return Scene(text, Camera("orthographic", height=2.0))
