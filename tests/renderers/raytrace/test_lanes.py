"""Laws of the packets' insides: positions, turns, layers of data, and what Embree reports."""

import numpy as np
import pytest

from aliasbench.renderers.raytrace.embree import Device, EmbreeError, TriangleScene, embree_info
from aliasbench.renderers.raytrace.lanes import (
    LANES,
    PX,
    PY,
    SCRATCH_SIZE,
    TIME,
    aligned_floats,
    build_sampling,
    fill_columns,
    fill_keys,
    fill_positions,
    fill_times,
)
from aliasbench.renderers.raytrace.trig import cos_turns, sin_turns
from aliasbench.renderers.sampling.hashing import frame_key
from aliasbench.renderers.sampling.patterns import SAMPLERS, sample_set


@pytest.mark.parametrize("name", SAMPLERS)
@pytest.mark.parametrize("count", [1, 3, 7, 16, 50])
@pytest.mark.parametrize("shared", [False, True])
def test_packets_hold_the_samples_of_the_shared_definition(name: str, count: int, shared: bool) -> None:
    pattern = build_sampling(name, count, frame_key(11, 4), shared=shared)
    width, row = 5, 9
    keys = np.zeros((4, width), np.uint64)
    fill_columns(pattern, keys)
    fill_keys(pattern, row, keys)
    got = []
    for start in range(0, width * count, LANES):
        lanes = min(LANES, width * count - start)
        scratch = np.zeros(SCRATCH_SIZE)
        fill_positions(pattern, keys, row, start, lanes, scratch)
        fill_times(pattern, keys, start, lanes, scratch)
        got.append(np.stack([scratch[at : at + lanes] for at in (PX, PY, TIME)], axis=1))
    expected = []
    for column in range(width):
        pixel = {} if shared else {"pixel": (column, row)}
        places = sample_set(name, count, seed=11, frame=4, **pixel)[:, :3]
        expected.append(places + np.array([column, row, 0.0]))
    # The cells are a table here: position = corner + size * u rounds differently by an ulp.
    np.testing.assert_allclose(np.concatenate(got), np.concatenate(expected), rtol=0, atol=4e-15)


def test_sine_and_cosine_of_turns_are_exact_to_the_last_bits() -> None:
    turns = np.concatenate([np.linspace(-3, 3, 4001), np.random.default_rng(0).uniform(-1e4, 1e4, 1000)])
    reduced = turns - np.round(turns)
    for function, exact in ((sin_turns, np.sin), (cos_turns, np.cos)):
        values = np.array([function(float(t)) for t in turns])
        assert np.abs(values - exact(2 * np.pi * reduced)).max() < 1e-15
    for quarter in range(-8, 9):
        assert abs(sin_turns(quarter / 4) - [0, 1, 0, -1][quarter % 4]) < 2e-16
        assert abs(cos_turns(quarter / 4) - [1, 0, -1, 0][quarter % 4]) < 2e-16


def test_packet_memory_starts_on_64_bytes() -> None:
    for count in (16, 384):
        memory = [aligned_floats(count) for _ in range(20)]
        assert all(m.ctypes.data % 64 == 0 and m.size == count and not m.any() for m in memory)


def test_embree_says_what_it_is() -> None:
    info = embree_info()
    assert info.version.startswith("4.")
    assert info.packet_width in (1, 4, 8, 16)
    assert "embree4" in info.library


def test_embree_errors_become_exceptions() -> None:
    with Device() as device:
        device.library.rtcNewGeometry(device.handle, 119)
        with pytest.raises(EmbreeError, match=r"Embree failed to try it \(error 1\): invalid geometry type"):
            device.check("try it")
        empty = TriangleScene(device, np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32), robust=True)
        empty.close()
        empty.close()
        lost = TriangleScene(device, np.full((3, 3), np.nan, np.float32), np.array([[0, 1, 2]], np.int32), robust=False)
        lost.close()
