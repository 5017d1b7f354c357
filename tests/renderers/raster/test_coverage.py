"""Which samples a surface covers: the raster's own positions against the float64 model, at every place in the pixel."""

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.renderers.raster.context import acquire_context, sample_positions
from aliasbench.renderers.raster.stages import wrapped_positions
from aliasbench.renderers.raster.targets import ssaa_positions
from aliasbench.renderers.sampling.patterns import sample_set

pytestmark = pytest.mark.usefixtures("gl_checked")
SIZE = (61, 47)
ROUNDING = 2e-6  # sums of float32 colours below 1


def compare(pixels: np.ndarray, samples: list[tuple[np.ndarray, np.ndarray]]) -> None:
    """Pixels are the mean of the samples' colours wherever no sample is doubtful, which holds for most pixels."""
    expected = np.mean([colors for colors, _ in samples], axis=0)
    sure = ~np.any([doubtful for _, doubtful in samples], axis=0)
    assert sure.mean() > 0.7
    assert np.ptp(expected[sure]) > 0.3
    np.testing.assert_allclose(pixels[sure], expected[sure], atol=ROUNDING)


def test_quad_with_edges_on_pixel_borders_covers_exactly_its_pixels(make):
    # 8 px a unit: the quad spans columns 3 to 12 and rows 2 to 6 of a 16 x 16 picture
    quad = make.polygon([[-0.625, 0.125, 0], [0.625, 0.125, 0], [0.625, 0.75, 0], [-0.625, 0.75, 0]])
    expected = np.zeros((16, 16, 3))
    expected[2:7, 3:13] = 1.0
    for technique in ("raster", "raster:passes=9", "raster:msaa=4"):
        pixels = render(make.scene(quad), technique, size=(16, 16)).pixels
        assert pixels.dtype == np.float32
        np.testing.assert_array_equal(pixels, expected)


def test_rows_run_down_and_columns_run_right(make):
    up_right = make.polygon([[0.5, 0.5, 0], [1, 0.5, 0], [1, 1, 0], [0.5, 1, 0]])
    pixels = render(make.scene(up_right), "raster", size=(8, 8)).pixels[..., 0]
    rows, columns = np.nonzero(pixels)
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (0, 1, 6, 7)


@pytest.mark.parametrize("camera", ["orthographic", "perspective"])
def test_one_sample_is_taken_at_the_pixel_centre(make, camera):
    scene = make.star(camera=getattr(make, camera))
    compare(render(scene, "raster", size=SIZE).pixels, [make.sample(scene, SIZE, 0.5, 0.5)])


@pytest.mark.parametrize("camera", ["orthographic", "perspective"])
def test_hardware_samples_lie_where_the_device_says(make, camera):
    scene = make.star(camera=getattr(make, camera))
    count = max(acquire_context().sample_counts)
    positions = sample_positions(count)
    assert count > 1
    assert positions.shape == (count, 2)
    pixels = render(scene, f"raster:msaa={count}", size=SIZE).pixels
    compare(pixels, [make.sample(scene, SIZE, x, y) for x, y in positions])


@pytest.mark.parametrize("camera", ["orthographic", "perspective"])
@pytest.mark.parametrize(("sampler", "count"), [("center", 2), ("grid", 9), ("random", 5), ("jittered", 7)])
def test_passes_are_the_mean_of_the_shared_pattern(make, camera, sampler, count):
    scene = make.star(camera=getattr(make, camera))
    pixels = render(scene, f"raster:passes={count},sampler={sampler}", size=SIZE, frame=2, seed=11).pixels
    pattern = sample_set(sampler, count, seed=11, frame=2)
    compare(pixels, [make.sample(scene, SIZE, x, y) for x, y, *_ in pattern])


def test_hardware_samples_in_moved_passes_stay_in_their_pixel(make):
    scene = make.star(camera=make.perspective)
    pixels = render(scene, "raster:msaa=4,passes=3", size=SIZE, seed=5).pixels
    samples = []
    for x, y, *_ in sample_set("jittered", 3, seed=5):
        places, _ = wrapped_positions(sample_positions(4), (x - 0.5, y - 0.5))
        assert ((places >= 0) & (places < 1)).all()
        samples += [make.sample(scene, SIZE, *place) for place in places]
    compare(pixels, samples)


def test_hardware_samples_in_moved_passes_keep_the_box_filter(make):
    # an edge .3 px into column 5: exact coverage there, none of it in the neighbours
    edge = make.polygon([[-2, -2, 0], [0.0375, -2, 0], [0.0375, 2, 0], [-2, 2, 0]])
    for passes in (16, 64):
        pixels = render(make.scene(edge), f"raster:msaa=4,passes={passes}", size=(10, 16)).pixels[..., 0]
        np.testing.assert_array_equal(pixels[:, :5], 1.0)
        np.testing.assert_array_equal(pixels[:, 6:], 0.0)
        # a sample's x is uniform: its share left of the edge varies by less than .3 (1 - .3), samples being stratified
        assert np.abs(pixels[:, 5] - 0.3).max() < 4 * np.sqrt(0.21 / (4 * passes))


def test_one_jittered_pass_is_one_jittered_sample(make):
    scene = make.star()
    x, y, *_ = sample_set("jittered", 1, seed=3)[0]
    pixels = render(scene, "raster:sampler=jittered", size=SIZE, seed=3).pixels
    compare(pixels, [make.sample(scene, SIZE, x, y)])


def test_pattern_changes_with_the_frame_unless_never_reseeded(make):
    scene = make.star()
    for reseed, frame in (("frame", 5), ("never", 0)):
        pixels = render(scene, f"raster:passes=4,reseed={reseed}", size=SIZE, frame=5, seed=1).pixels
        pattern = sample_set("jittered", 4, seed=1, frame=frame)
        compare(pixels, [make.sample(scene, SIZE, x, y) for x, y, *_ in pattern])


def test_sum_of_many_passes_keeps_float32_precision(make):
    whole = make.polygon([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], color=(0.1, 0.7, 123.456))
    pixels = render(make.scene(whole), "raster:passes=300", size=(3, 2)).pixels
    np.testing.assert_array_equal(pixels, np.broadcast_to(np.float32([0.1, 0.7, 123.456]), (2, 3, 3)))


def test_empty_scene_is_the_background(make):
    pixels = render(make.scene(background=(0.25, 0.5, 3.0)), "raster:passes=2", size=(5, 4)).pixels
    np.testing.assert_array_equal(pixels, np.broadcast_to(np.float32([0.25, 0.5, 3.0]), (4, 5, 3)))


def test_shared_edges_have_neither_gaps_nor_doubles(make):
    # a fan of triangles about an odd point: together they cover the picture
    corners = [[-3, -3, 0], [3, -3, 0], [3, 3, 0], [-3, 3, 0]]
    fan = [
        make.polygon([corners[k], corners[(k + 1) % 4], [0.1234, -0.0567, 0]], color=(1.0, 1.0, 1.0)) for k in range(4)
    ]
    pixels = render(make.scene(*fan), "raster:passes=5", size=(64, 64)).pixels
    np.testing.assert_array_equal(pixels, np.ones((64, 64, 3)))


def test_supersampling_takes_the_grid(make):
    scene = make.star(camera=make.perspective)
    pixels = render(scene, "raster:ssaa=3", size=SIZE).pixels
    grid = sample_set("grid", 9)[:, :2]
    np.testing.assert_allclose(ssaa_positions(3, (0.0, 0.0)), grid, atol=1e-15)
    compare(pixels, [make.sample(scene, SIZE, x, y) for x, y in grid])


def test_supersampling_combines_with_passes_and_hardware_samples(make):
    scene = make.star(camera=make.perspective)
    moved = [(x - 0.5, y - 0.5) for x, y, *_ in sample_set("jittered", 2, seed=6)]
    places = [place for jitter in moved for place in ssaa_positions(2, jitter)]
    pixels = render(scene, "raster:ssaa=2,passes=2", size=SIZE, seed=6).pixels
    compare(pixels, [make.sample(scene, SIZE, *place) for place in places])
    corners = np.array([(0, 0), (0.5, 0), (0, 0.5), (0.5, 0.5)])
    places = [c + p / 2 for j in moved for p in wrapped_positions(sample_positions(4), j)[0] for c in corners]
    pixels = render(scene, "raster:ssaa=2,passes=2,msaa=4", size=SIZE, seed=6).pixels
    compare(pixels, [make.sample(scene, SIZE, *place) for place in places])
    places = [c + p / 2 for p in sample_positions(4) for c in corners]
    pixels = render(scene, "raster:ssaa=2,msaa=4", size=SIZE, seed=6).pixels
    compare(pixels, [make.sample(scene, SIZE, *place) for place in places])
