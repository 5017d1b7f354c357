"""Damaged model files load or are refused in one sentence, soon; a sample of the campaign in `fuzz_meshes`."""

import time
from pathlib import Path
from types import ModuleType

import pytest

from aliasbench.scenes.errors import InputError
from aliasbench.scenes.files import load_scene

FILES = 240


def test_the_undamaged_files_load(fuzz: ModuleType, tmp_path: Path) -> None:
    for name, data in fuzz.seeds().items():
        (tmp_path / name).write_bytes(data)
    models = sorted(p for p in tmp_path.iterdir() if not p.name.startswith("seed"))
    counts = {p.name: sum(len(s.triangles) for s in load_scene(str(p)).objects) for p in models}
    # Of the coloured copies some triangles are cut out by their alpha.
    assert 2000 < counts.pop("colors.gltf") < 6000
    assert list(counts.values()) == [960, 5, 960, 6, 960, 6]


@pytest.mark.parametrize("seed", [11, 12])
def test_damaged_files_load_or_are_refused_in_one_sentence(fuzz: ModuleType, tmp_path: Path, seed: int) -> None:
    loaded, sentences = 0, []
    for path in fuzz.damaged_files(tmp_path, FILES // 2, seed):
        start = time.perf_counter()
        try:
            load_scene(str(path))
            loaded += 1
        except InputError as error:
            sentences.append((path.name, str(error)))
        assert time.perf_counter() - start < 5
    # Both ways out are taken, or the damage is none, or nothing but damage.
    assert loaded > FILES // 40
    assert len(sentences) > FILES // 4
    for name, sentence in sentences:
        assert name in sentence
        assert "\n" not in sentence
