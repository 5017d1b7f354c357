"""Open shutters against closed forms: ramps of edges that move, sectors of edges that turn, matrices that shrink.

What matrices of begin and end leave of a turn by an angle A within the frame is known too: at the share t of the frame
the mean (1 - t) I + t R(A) is a rotation scaled by ((1 - t)^2 + t^2 + 2 t (1 - t) cos A)^.5, cos(A / 2) at its middle.
TRIALS=100 asks for as many random scenes.
"""

import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from closed_forms import ANIMATION, assert_estimates, box, pixel_scene, sample, sector_shares, square_of_positive
from scipy import stats

from aliasbench.renderers.catalog import render
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import Camera, Motion, Scene, Spin, Surface
from aliasbench.scenes.motion import rotation_matrix
from aliasbench.scenes.shapes import polygon

TRIALS = int(os.environ.get("TRIALS", "6"))
SAMPLERS = ("random", "jittered", "multijittered", "sobol", "bluenoise")
CASES = [("raytrace:spp={},sampler={}", name) for name in SAMPLERS]
CASES += [("raster:passes={},sampler={}", name) for name in SAMPLERS if name != "bluenoise"]
AXIS, MIDDLE = (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep references of a test in its own folder."""
    monkeypatch.setenv("ALIASBENCH_CACHE", str(tmp_path))


# Edges


@pytest.mark.parametrize(("technique", "sampler"), CASES)
@pytest.mark.parametrize(("velocity", "frame"), [(300.0, 0), (-300.0, 2), (10.0, 1)])
def test_an_edge_that_moves_leaves_a_ramp(sampler: str, velocity: float, frame: int, technique: str) -> None:
    size, spp, seeds = (24, 8), 32, 24
    # In the middle of the frame's shutter the edge is at 0.3 right of the picture's middle.
    middle = (frame + 0.25) / 20.0
    body = polygon(box(-999, -99, 0.3 - velocity * middle, 99), motion=Motion((velocity, 0.0, 0.0)))
    way = abs(velocity) * 0.025
    # The share of time that x is left of the edge, integrated over a pixel: second differences of (x)+^2 / 2.
    borders = 12.3 - np.arange(25)
    high, low = square_of_positive(borders + way / 2), square_of_positive(borders - way / 2)
    truth = -np.diff((high - low) / way)
    assert truth[0] == pytest.approx(1.0)
    assert truth[-1] == pytest.approx(0.0)
    pictures = sample(pixel_scene([body], 8.0), technique.format(spp, sampler), size, seeds, frame)
    expected = np.broadcast_to(truth[None, :, None], (8, 24, 3))
    assert_estimates(pictures, expected, spread=0.5 / math.sqrt(spp * seeds), samples=spp * seeds)


@pytest.mark.parametrize(("technique", "sampler"), [c for c in CASES if c[1] in ("random", "sobol")])
@pytest.mark.parametrize("turns", [0.3, -0.3, 2.5, -2.5, 100.0, 100.4])
def test_a_sector_that_turns_covers_each_pixel_its_share_of_the_time(
    sampler: str, turns: float, technique: str
) -> None:
    size, spp, seeds, frame, width = (24, 20), 64, 24, 3, 0.22
    rate = turns / 0.5 * 20.0
    begin = 0.05 + math.fmod(frame * rate / 20.0, 1.0)
    angles = 2 * math.pi * (0.05 + np.array([0.0, width]))
    outline = [(0.0, 0.0, 0.0), *((99 * math.cos(a), 99 * math.sin(a), 0.0) for a in angles)]
    body = polygon(outline, motion=Motion(spin=Spin(AXIS, MIDDLE, rate)))
    truth = sector_shares(begin, turns, width, size)
    if abs(turns) == 100.0:
        np.testing.assert_allclose(truth, width, atol=1e-9)
    else:
        assert np.ptp(truth) > 0.0005
    pictures = sample(pixel_scene([body], 20.0), technique.format(spp, sampler), size, seeds, frame)
    # 24 x 24 points a pixel are off where an edge's path starts or ends in it: a row of 24 counts an interval to 1/24
    # of a share that varies by one over |turns|, or the whole where the sector's tip is.
    expected = np.broadcast_to(truth[..., None], (*truth.shape, 3))
    slack = 1e-3
    assert_estimates(pictures, expected, spread=0.5 / math.sqrt(spp * seeds), samples=spp * seeds, bound=slack)
    # Over the whole picture the points' errors cancel.
    off = (pictures - expected).mean(axis=(1, 2, 3))
    assert abs(off.mean()) < 4.5 * off.std(ddof=1) / math.sqrt(seeds) + 1e-4


@pytest.mark.parametrize("projection", ["orthographic", "perspective"])
@pytest.mark.parametrize("lens", [0.0, 0.4])
def test_a_pan_of_the_camera_is_an_opposite_move_of_everything(projection: str, lens: float) -> None:
    velocity = (30.0, -12.0, 5.0)
    camera = (
        Camera("orthographic", height=6.0) if projection == "orthographic" else Camera("perspective", fov_y_deg=50.0)
    )
    camera = replace(camera, lens_radius=lens, focus_distance=4.0)
    shapes = [box(-1.0, -0.6, 0.2, 0.7), box(0.1, -1.5, 1.4, 0.1, -2.0)]
    colors = ((1.0, 0.5, 0.2), (0.3, 0.9, 0.6))
    start = np.array(velocity) * 1.25 / 20.0
    animation = replace(ANIMATION, shutter=0.5)
    still = tuple(polygon(np.array(s) + start, color=c) for s, c in zip(shapes, colors, strict=True))
    panned = Scene("pan", replace(camera, velocity=velocity), still, animation=animation)
    back = Motion((-velocity[0], -velocity[1], -velocity[2]))
    moving = tuple(polygon(np.array(s) + start, color=c, motion=back) for s, c in zip(shapes, colors, strict=True))
    moved = Scene("move", camera, moving, animation=animation)
    technique = "raytrace:spp=16,sampler=multijittered"
    one, other = (render(scene, technique, size=(32, 24), frame=1).pixels for scene in (panned, moved))
    assert 0.03 < one.mean() < 0.6
    # The same rays up to rounding: one in some ten thousands passes an edge nearer than float32 tells.
    assert (np.abs(one - other).max(axis=2) > 1e-6).sum() <= 3
    sharp = render(moved, f"{technique},time=center", size=(32, 24), frame=1).pixels
    assert (np.abs(one - sharp).max(axis=2) > 1e-3).sum() > 50


@pytest.mark.parametrize("sampler", ["center", *SAMPLERS])
def test_time_center_is_the_still_picture_of_the_shutter_s_middle(sampler: str) -> None:
    spp = 1 if sampler == "center" else 9
    spin = Spin(AXIS, (1.0, 0.5, 0.0), 3.7)
    outline = np.array([(-5.0, -3.0, 0.0), (6.0, -2.0, 0.0), (-1.0, 5.0, 0.0)])
    scene = pixel_scene([polygon(outline, motion=Motion((14.0, 3.0, 0.0), spin))], 24.0, velocity=(5.0, -9.0, 0.0))
    t = 2.25 / 20.0
    c = np.array(spin.center)
    turned = c + t * np.array((14.0, 3.0, 0.0)) + (outline - c) @ rotation_matrix(AXIS, 3.7 * t).T
    still = pixel_scene([polygon(turned - t * np.array((5.0, -9.0, 0.0)))], 24.0)
    technique = f"raytrace:spp={spp},sampler={sampler},reseed=never"
    middle = render(scene, f"{technique},time=center", size=(32, 24), frame=2).pixels
    expected = render(still, technique, size=(32, 24)).pixels
    assert 0.03 < expected.mean() < 0.5
    assert (middle != expected).any(axis=2).sum() <= 1
    if sampler != "center":
        assert (render(scene, technique, size=(32, 24), frame=2).pixels != expected).any(axis=2).sum() > 20
    exact = render(scene, "reference:time=center", size=(32, 24), frame=2)
    assert exact.uncertainty is not None
    assert abs(middle.mean() - exact.pixels.mean()) < 0.02


# Matrices


@pytest.mark.parametrize(
    ("name", "frame"),
    [
        ("two-matrices", 0),
        ("two-matrices:angle=-150,shutter=0.6", 2),
        ("propeller:rev_per_s=7,shutter=0.8", 1),
        ("propeller:rev_per_s=-12,shutter=1,blades=2", 3),
    ],
)
def test_matrices_agree_with_the_reference_s(name: str, frame: int) -> None:
    scene, size, spp, seeds = load_scene(name), (24, 20), 64, 24
    reference = render(scene, "reference:motion=matrix", size=size, frame=frame)
    assert reference.uncertainty_kind == "bound"
    assert reference.uncertainty is not None
    pictures = sample(scene, f"raytrace:spp={spp},sampler=sobol,motion=matrix", size, seeds, frame)
    kwargs = {"spread": 0.3 / math.sqrt(spp * seeds), "samples": spp * seeds}
    assert_estimates(pictures, reference.pixels, bound=reference.uncertainty, **kwargs)
    exact = render(scene, "reference:", size=size, frame=frame)
    assert np.abs(exact.pixels - reference.pixels).max() > 0.05
    pictures = sample(scene, f"raytrace:spp={spp},sampler=sobol", size, seeds, frame)
    assert exact.uncertainty is not None
    assert_estimates(pictures, exact.pixels, bound=exact.uncertainty, **kwargs)


def random_spinner(seed: int) -> Scene:
    """Return some polygons that spin about slanted axes and move on, before a camera in perspective."""
    rng = np.random.default_rng([31, seed])
    objects: list[Surface] = []
    while len(objects) < 3:
        n = int(rng.integers(3, 7))
        angles = 2 * math.pi * (np.arange(n) + rng.uniform(0.1, 0.9, n)) / n
        normal = rng.normal(size=3) * 0.4 + (0.0, 0.0, 1.0)
        a = np.cross(normal, rng.normal(size=3))
        a /= np.linalg.norm(a)
        b = np.cross(normal, a) / np.linalg.norm(normal)
        place = np.array([rng.uniform(-0.8, 0.8), rng.uniform(-0.8, 0.8), rng.uniform(-0.8, 0.8)])
        points = place + rng.uniform(0.3, 0.9) * (np.cos(angles)[:, None] * a + np.sin(angles)[:, None] * b)
        axis, velocity, shift = rng.normal(size=3).tolist(), rng.normal(size=3).tolist(), (place + 0.2).tolist()
        spin = Spin((axis[0], axis[1], axis[2]), (shift[0], shift[1], shift[2]), float(rng.uniform(-9, 9)))
        red, green, blue = rng.uniform(0.2, 1.0, 3).tolist()
        motion = Motion((velocity[0], velocity[1], velocity[2]), spin)
        try:
            objects.append(polygon(points, color=(red, green, blue), motion=motion))
        except InputError:
            continue  # an outline that happens to be degenerate
    camera = Camera("perspective", position=(0.3, 0.2, 4.0), fov_y_deg=45.0)
    return Scene("spinner", camera, tuple(objects), background=(0.1, 0.2, 0.3), animation=ANIMATION)


@pytest.mark.parametrize("seed", range(TRIALS))
@pytest.mark.parametrize("motion", ["exact", "matrix"])
def test_random_spinning_polygons_agree_with_their_references(seed: int, motion: str) -> None:
    scene, size, spp, seeds = random_spinner(seed), (12, 10), 64, 24
    reference = render(scene, f"reference:motion={motion}", size=size, frame=1)
    assert reference.uncertainty is not None
    assert reference.uncertainty < 1e-3
    sampler = SAMPLERS[seed % len(SAMPLERS)]
    pictures = sample(scene, f"raytrace:spp={spp},sampler={sampler},motion={motion}", size, seeds, frame=1)
    assert np.ptp(reference.pixels) > 0.1
    assert_estimates(
        pictures,
        reference.pixels,
        spread=0.3 / math.sqrt(spp * seeds),
        samples=spp * seeds,
        bound=reference.uncertainty,
    )


def bar(angle_deg: float, half_length: float = 9.0, half_width: float = 2.0) -> Surface:
    rate = angle_deg / 360.0 * 20.0
    corners = box(-half_length, -half_width, half_length, half_width)
    return polygon(corners, motion=Motion(spin=Spin(AXIS, MIDDLE, rate)))


@pytest.mark.parametrize("angle", [20.0, 60.0, 120.0, -120.0, 170.0])
def test_matrices_shrink_what_turns_and_exact_motion_does_not(angle: float) -> None:
    # The whole frame: at the middle both sides of the bar are cos(angle / 2) as long.
    scene = pixel_scene([bar(angle)], 24.0, replace(ANIMATION, shutter=1.0))
    area = 4 * 9.0 * 2.0
    for motion, scale in (("matrix", math.cos(math.radians(angle) / 2)), ("exact", 1.0)):
        technique = f"raytrace:spp=256,sampler=sobol,time=center,motion={motion}"
        picture = render(scene, technique, size=(24, 24)).pixels[..., 0].astype(np.float64)
        # An edge pixel's share of 256 points is known to about 256^-.75 = 1/64; a hundred of them cancel.
        assert picture.sum() == pytest.approx(area * scale**2, rel=0.02, abs=0.3)
        # About the middle a bar's second moments are 4 a b (a^2, b^2) / 3: they add up to area (a^2 + b^2) / 3, and a
        # pixel's square has 1 / 6 more.
        y, x = np.mgrid[-11.5:12, -11.5:12]
        moment = (picture * (x**2 + y**2)).sum() - picture.sum() / 6
        assert moment == pytest.approx(area * scale**4 * (81 + 4) / 3, rel=0.03, abs=2.0)
    # Over the open frame the area's mean is that of 1 - 2 t (1 - t) (1 - cos angle): 1 - (1 - cos angle) / 3.
    share = 1 - (1 - math.cos(math.radians(angle))) / 3
    for motion, expected in (("matrix", share), ("exact", 1.0)):
        pictures = sample(scene, f"raytrace:spp=64,sampler=sobol,motion={motion}", (24, 24), 16)
        sums = pictures[..., 0].sum(axis=(1, 2))
        assert sums.std(ddof=1) < 0.02 * area
        assert abs(sums.mean() - area * expected) < stats.t.ppf(1 - 5e-5, 15) * sums.std(ddof=1) / 4 + 1e-4


@pytest.mark.parametrize("half_turns", [1, -1, 3])
@pytest.mark.parametrize("sampler", ["random", "sobol"])
def test_matrices_half_a_turn_apart_squeeze_a_body_to_a_point_and_back(half_turns: int, sampler: str) -> None:
    # (1 - t) I - t I in the plane: at t a square is 1 - 2 t as wide, turned over beyond the middle; a point is in it
    # for the share 1 - max(|x|, |y|) / half of the frame.
    half, size, spp, seeds = 9.0, (24, 24), 64, 24
    rate = half_turns / 2 * 20.0
    body = polygon(box(-half, -half, half, half), motion=Motion(spin=Spin(AXIS, MIDDLE, rate)))
    scene = pixel_scene([body], 24.0, replace(ANIMATION, shutter=1.0))
    fine = (np.arange(24 * 16) + 0.5) / 16 - 12
    share = np.maximum(1 - np.maximum(np.abs(fine)[:, None], np.abs(fine)) / half, 0.0)
    truth = share.reshape(24, 16, 24, 16).mean(axis=(1, 3))
    pictures = sample(scene, f"raytrace:spp={spp},sampler={sampler},motion=matrix", size, seeds)
    assert np.isfinite(pictures).all()
    expected = np.broadcast_to(truth[..., None], (24, 24, 3))
    # 16 x 16 points are wrong only at the share's creases, by 1 / (12 16^2 half).
    assert_estimates(pictures, expected, spread=0.35 / math.sqrt(spp * seeds), samples=spp * seeds, bound=1e-4)
    assert np.ptp(truth) > 0.9
    # Exactly at the middle nothing is left, and nothing breaks.
    middle = render(scene, "raytrace:spp=16,time=center,motion=matrix", size=size).pixels
    assert np.isfinite(middle).all()
    assert middle.sum() < 1.0


def test_matrices_shrink_the_left_bar_and_the_right_one_alike() -> None:
    # Under motion=matrix the bar that spins is the bar of two matrices, half the picture to the right.
    scene = load_scene("two-matrices")
    pictures = sample(scene, "raytrace:spp=64,sampler=sobol,motion=matrix", (24, 24), 24)
    left, right = pictures[:, :, :12], pictures[:, :, 12:]
    assert left.mean() > 0.03
    difference = left - right
    assert_estimates(difference, np.zeros((24, 12, 3)), spread=0.5 / math.sqrt(64 * 24), samples=64 * 24)
