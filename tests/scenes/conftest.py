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


@pytest.fixture(scope="session")
def gltf() -> ModuleType:
    """The module beside this file that makes glTF documents."""
    spec = importlib.util.spec_from_file_location("gltf_builder", Path(__file__).with_name("gltf_builder.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """Return a function that writes a glTF builder's document, with changes, and returns the file's path."""

    def save(builder: Any, name: str = "a.glb", **changes: Any) -> Path:
        path = tmp_path / name
        path.write_bytes(builder.bytes(**changes))
        return path

    return save
