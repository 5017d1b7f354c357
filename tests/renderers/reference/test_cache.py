"""A stored reference is the made one bit for bit; a damaged one is made anew; other contents have other keys."""

from dataclasses import replace

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.renderers.reference import reference
from aliasbench.renderers.reference.cache import Stored, fetch
from aliasbench.renderers.technique import parse_technique
from aliasbench.scenes.model import Motion


@pytest.fixture
def moving(make_polygon, make_scene):
    return make_scene([make_polygon([(-0.5, -0.4), (0.7, 0.1), (0, 0.8)], motion=Motion((3.0, 0, 0)))], shutter=1.0)


def make_counted(calls):
    def make():
        calls.append(1)
        return Stored(np.random.default_rng(1).random((3, 2, 3)), 1e-4, 7)

    return make


def test_hit_is_equal_bit_for_bit_and_makes_nothing(own_cache):
    calls: list[int] = []
    first, second = fetch("k", make_counted(calls)), fetch("k", make_counted(calls))
    assert len(calls) == 1
    assert np.array_equal(first.pixels, second.pixels)
    assert (first.uncertainty, first.samples) == (second.uncertainty, second.samples) == (1e-4, 7)
    assert [p.suffix for p in own_cache.iterdir()] == [".npz"]


@pytest.mark.parametrize(
    "damage", [lambda b: b[:-5], lambda b: b[:0], lambda b: b[:200] + bytes([b[200] ^ 1]) + b[201:]]
)
def test_damaged_file_is_made_anew(own_cache, damage):
    calls: list[int] = []
    first = fetch("k", make_counted(calls))
    path = own_cache / "k.npz"
    path.write_bytes(damage(path.read_bytes()))
    again = fetch("k", make_counted(calls))
    assert len(calls) == 2
    assert np.array_equal(first.pixels, again.pixels)
    fetch("k", make_counted(calls))
    assert len(calls) == 2


def test_cache_that_cannot_be_written_costs_only_time(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("not a folder")
    monkeypatch.setenv("ALIASBENCH_CACHE", str(tmp_path / "file"))
    calls: list[int] = []
    fetch("k", make_counted(calls))
    assert fetch("k", make_counted(calls)).samples == 7
    assert len(calls) == 2


def test_moving_reference_is_stored_and_returned_equal(moving, own_cache):
    first = render(moving, "reference:", size=(12, 12))
    assert len(list(own_cache.iterdir())) == 1
    second = render(moving, "reference:", size=(12, 12))
    assert np.array_equal(first.pixels, second.pixels)
    assert first.uncertainty == second.uncertainty


def test_key_follows_everything_that_enters(moving, monkeypatch):
    def key(scene=moving, technique="reference:", size=(12, 12), frame=0):
        return reference.prepare_reference(scene, parse_technique(technique), size).key(frame)

    base = key()
    assert key() == base
    others = [
        key(technique="reference:time=center"),
        key(technique="reference:texture=linear"),
        key(technique="reference:motion=matrix"),
        key(size=(12, 13)),
        key(frame=1),
        key(scene=replace(moving, background=(0, 0, 0.1))),
    ]
    monkeypatch.setattr(reference, "ALGORITHM", reference.ALGORITHM + 1)
    others.append(key())
    assert len({base, *others}) == len(others) + 1


def test_instants_are_not_stored(make_polygon, make_scene, own_cache):
    render(make_scene([make_polygon([(-0.5, -0.4), (0.7, 0.1), (0, 0.8)])]), "reference:", size=(6, 6))
    assert not own_cache.exists()
