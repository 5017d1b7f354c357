"""Scene files for tests: written from a text, or made from a valid one by putting one thing wrong."""

import importlib.util
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest


@pytest.fixture
def scene_file(tmp_path: Path) -> Callable[[str], str]:
    """Return a function that writes a text to a scene file and returns the file's path."""

    def write(text: str) -> str:
        path = tmp_path / "given.toml"
        path.write_text(text, encoding="utf-8")
        return str(path)

    return write


def module_beside(name: str) -> ModuleType:
    """Return the module of a script in this folder, which is no package."""
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def gltf() -> ModuleType:
    """What makes glTF documents."""
    return module_beside("gltf_builder")


@pytest.fixture(scope="session")
def fuzz() -> ModuleType:
    """The campaign of damaged model files."""
    return module_beside("fuzz_meshes")


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """Return a function that writes a glTF builder's document, with changes, and returns the file's path."""

    def save(builder: Any, name: str = "a.glb", **changes: Any) -> Path:
        path = tmp_path / name
        path.write_bytes(builder.bytes(**changes))
        return path

    return save
