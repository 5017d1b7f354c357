"""Laws of the packets' insides: positions, turns, layers of data, and what Embree reports."""

import numpy as np
import pytest

from aliasbench.renderers.raytrace.embree import Device, EmbreeError, TriangleScene, embree_info
from aliasbench.renderers.raytrace.lanes import LANES, PX, PY, SCRATCH_SIZE, TIME, aligned_floats
from aliasbench.renderers.raytrace.positions import (
    KEY_ROWS,
    PIXEL,
    KeyArray,
    fill_columns,
    fill_keys,
    fill_line,
    fill_plane,
    fill_positions,
    fill_times,
    orders_size,
)
from aliasbench.renderers.sampling.bluenoise import tile_level
from aliasbench.renderers.sampling.hashing import SHARED, frame_key
from aliasbench.renderers.sampling.patterns import (
    DIM_DIRECTION,
    DIM_LENS,
    DIM_LIGHT,
    DIM_TIME,
    DIM_WAVELENGTH,
    SAMPLERS,
    Pattern,
    _fill,
    make_pattern,
    sample_set,
)
from aliasbench.renderers.sampling.trig import cos_turns, sin_turns
from aliasbench.scenes.model import FloatArray

# bluenoise has a pattern of its own for each pixel
KINDS = [(name, shared) for name in SAMPLERS for shared in (False, True) if not (shared and name == "bluenoise")]
COUNTS = (1, 3, 7, 16, 50, 4096 + 5)
WIDTH, FIRST_COLUMN, ROW = 3, 4, 9
SEED, FRAME = 11, 4


def make_keys(pattern: Pattern, first_column: int) -> KeyArray:
    """Return the keys of `WIDTH` pixels of row `ROW`."""
    keys = np.zeros((KEY_ROWS, WIDTH), np.uint64)
    fill_columns(pattern, first_column, keys)
    fill_keys(pattern, first_column, ROW, keys)
    return keys


def make_test_pattern(name: str, count: int, shared: bool) -> Pattern:
    return make_pattern(name, count, frame_key(SEED, FRAME), shared=shared)


def expected_sets(name: str, count: int, first_column: int, shared: bool) -> FloatArray:
    """Return the sets of `WIDTH` pixels of row `ROW` by definition, (WIDTH, count, 10)."""
    pixels = [{} if shared else {"pixel": (first_column + k, ROW)} for k in range(WIDTH)]
    return np.stack([sample_set(name, count, seed=SEED, frame=FRAME, **pixel) for pixel in pixels])


def runs_of(count: int) -> list[tuple[int, int, int]]:
    """Return (first sample, first lane, lanes) of pieces of a pixel's samples in any order, as packets cut them."""
    pieces, index, lane = [], 0, 5
    while index < count:
        run = min(LANES - lane, count - index)
        pieces.append((index, lane, run))
        index, lane = index + run, 0
    return [pieces[k] for k in np.random.default_rng(count).permutation(len(pieces))]


@pytest.mark.parametrize(("name", "shared"), KINDS)
@pytest.mark.parametrize("count", COUNTS)
def test_packets_hold_the_places_and_times_of_the_shared_definition(name: str, count: int, shared: bool) -> None:
    pattern = make_test_pattern(name, count, shared)
    keys = make_keys(pattern, 0)
    orders, numbers = np.zeros((3, orders_size(pattern)), np.int32), np.zeros(LANES, np.int64)
    got = []
    for start in range(0, WIDTH * count, LANES):
        lanes = min(LANES, WIDTH * count - start)
        scratch = np.full(SCRATCH_SIZE, np.nan)
        fill_positions(pattern, keys, ROW, start, lanes, orders, scratch)
        fill_times(pattern, keys, ROW, start, lanes, numbers, scratch)
        got.append(np.stack([scratch[at : at + lanes] for at in (PX, PY, TIME)], axis=1))
    expected = expected_sets(name, count, 0, shared)[..., :3]
    expected[..., 0] += np.arange(WIDTH)[:, None]
    expected[..., 1] += ROW
    # The cells are a table here: position = corner + size * u rounds differently by an ulp.
    np.testing.assert_allclose(np.concatenate(got), expected.reshape(-1, 3), rtol=0, atol=4e-15)


@pytest.mark.parametrize(("name", "shared"), KINDS)
@pytest.mark.parametrize("count", COUNTS)
def test_any_run_of_samples_has_the_other_dimensions_of_the_shared_definition(
    name: str, count: int, shared: bool
) -> None:
    pattern = make_test_pattern(name, count, shared)
    keys = make_keys(pattern, FIRST_COLUMN)
    numbers = np.zeros(LANES, np.int64)
    got = np.full((WIDTH, count, 10), np.nan)
    scratch = np.full(2 * LANES, np.nan)
    for k in range(WIDTH):
        address = (pattern, count, keys[PIXEL, k], FIRST_COLUMN + k, ROW)
        for index, lane, run in runs_of(count):
            for line in (DIM_TIME, DIM_WAVELENGTH):
                fill_line(*address, line, index, lane, run, numbers, scratch, 0)
                got[k, index : index + run, line] = scratch[lane : lane + run]
            for plane in (DIM_LENS, DIM_LIGHT, DIM_DIRECTION):
                fill_plane(*address, plane, index, 1, lane, run, numbers, scratch, 0, LANES)
                for half in range(2):
                    at = half * LANES + lane
                    got[k, index : index + run, plane + half] = scratch[at : at + run]
    np.testing.assert_array_equal(got[..., 2:], expected_sets(name, count, FIRST_COLUMN, shared)[..., 2:])


@pytest.mark.parametrize(("name", "shared"), KINDS)
@pytest.mark.parametrize(("count", "shadow_rays"), [(1, 4), (3, 3), (7, 2), (16, 4), (50, 5), (4096, 4), (4096 + 5, 2)])
def test_shadow_rays_take_turns_in_one_set_of_all_light_points(
    name: str, count: int, shadow_rays: int, shared: bool
) -> None:
    pattern = make_test_pattern(name, count, shared)
    keys = make_keys(pattern, FIRST_COLUMN)
    numbers, scratch = np.zeros(LANES, np.int64), np.full(2 * LANES, np.nan)
    size = count * shadow_rays
    got = np.full((WIDTH, size, 2), np.nan)
    for column in range(WIDTH):
        address = (pattern, size, keys[PIXEL, column], FIRST_COLUMN + column, ROW, DIM_LIGHT)
        for index, lane, run in runs_of(count):
            for k in range(shadow_rays):
                first, after = index * shadow_rays + k, (index + run) * shadow_rays
                fill_plane(*address, first, shadow_rays, lane, run, numbers, scratch, 0, LANES)
                got[column, first:after:shadow_rays] = scratch.reshape(2, LANES)[:, lane : lane + run].T
    # The tile of bluenoise is the one for the samples, not for the shadow rays.
    expected = np.empty((WIDTH, size, 10))
    for column in range(WIDTH):
        place = (SHARED, SHARED) if shared else (FIRST_COLUMN + column, ROW)
        _fill(pattern._replace(samples=size), *place, expected[column])
    if name != "bluenoise" or tile_level(count) == tile_level(size):
        np.testing.assert_array_equal(expected, expected_sets(name, size, FIRST_COLUMN, shared))
    expected = expected[..., DIM_LIGHT : DIM_LIGHT + 2]
    np.testing.assert_array_equal(got, expected)
    assert len(np.unique(got[0], axis=0)) == size


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
