"""Scene files for tests: written from a text, or made from a valid one by putting one thing wrong."""

from collections.abc import Callable
from pathlib import Path

import pytest


@pytest.fixture
def scene_file(tmp_path: Path) -> Callable[[str], str]:
    """Return a function that writes a text to a scene file and returns the file's path."""

    def write(text: str) -> str:
        path = tmp_path / "given.toml"
        path.write_text(text, encoding="utf-8")
        return str(path)

    return write
