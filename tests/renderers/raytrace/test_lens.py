"""A thin lens against closed forms: discs of light, profiles of edges, and a plane in focus that moves.

A point at depth Z is seen from the point (a, b) of a lens focused at F shifted by (a, b) s with s = f (1 / Z - 1 / F)
(f the focal length in pixels), or scale (1 - Z / F) under parallel rays: to the side of (a, b) where Z is beyond F,
as the rays have crossed there. All points of the lens together spread it over a disc of radius R abs s.
"""

import math
from dataclasses import replace

import closed_forms
import numpy as np
import pytest
from closed_forms import (
    EYE_Z,
    assert_estimates,
    disc_means,
    edge_profile,
    half_plane,
    magnification,
    segment,
    segment_integral,
    shift_of,
    square,
)

from aliasbench.renderers.catalog import render
from aliasbench.scenes.model import Animation, Camera, FloatArray, Scene
from aliasbench.scenes.shapes import polygon

SAMPLERS = ("random", "jittered", "multijittered", "sobol", "bluenoise")
PERSPECTIVE = Camera("perspective", position=(0.0, 0.0, EYE_Z), fov_y_deg=40.0, lens_radius=0.5, focus_distance=5.0)
PARALLEL = Camera("orthographic", position=(0.0, 0.0, EYE_Z), height=3.0, lens_radius=0.5, focus_distance=5.0)
# A technique's format, the sampler, and pictures: of passes, each of which costs a draw, fewer.
CASES = [("raytrace:spp={},sampler={}", name, 64) for name in SAMPLERS]
CASES += [("raster:passes={},sampler={}", name, 24) for name in SAMPLERS if name != "bluenoise"]
CAMERAS = pytest.mark.parametrize("camera", [PERSPECTIVE, PARALLEL], ids=["perspective", "parallel"])


def sample(scene: Scene, technique: str, size: tuple[int, int], seeds: int, frame: int = 0) -> FloatArray:
    """Return red of pictures (seeds, h, w)."""
    return closed_forms.sample(scene, technique, size, seeds, frame)[..., 0]


def test_the_segment_s_integral_is_its_integral() -> None:
    t = np.linspace(-1.5, 1.5, 3001)
    np.testing.assert_allclose(np.gradient(segment_integral(t), t)[1:-1], segment(t)[1:-1], atol=1e-4)
    assert segment(np.array([-2.0, 0.0, 2.0])).tolist() == [0.0, 0.5, 1.0]


@CAMERAS
@pytest.mark.parametrize("depth", [3.0, 9.0], ids=["in front", "behind"])
@pytest.mark.parametrize(("technique", "sampler", "seeds"), [c for c in CASES if c[1] in ("jittered", "sobol")])
def test_a_small_bright_square_becomes_a_flat_disc(
    camera: Camera, depth: float, sampler: str, technique: str, seeds: int
) -> None:
    size, spp = (32, 32), 64
    scale = magnification(camera, size[1], depth)
    radius = camera.lens_radius * abs(shift_of(camera, size[1], depth, 5.0))
    half = 0.6 / scale
    scene = Scene("dot", camera, (polygon(square(0.21 / scale, -0.13 / scale, half, depth)),))
    x, y = 16 + 0.21, 16 + 0.13
    assert 1.9 < radius < 6.0
    truth = disc_means(x, y, 0.6, radius, size)
    # Energy is the square's own area: nothing is lost off the picture.
    assert truth.sum() == pytest.approx(1.44, rel=1e-4)
    pictures = sample(scene, technique.format(spp, sampler), size, seeds)
    brightest = float(truth.max())
    assert_estimates(pictures, truth, spread=math.sqrt(brightest / (spp * seeds)), samples=spp * seeds)
    energy = pictures.sum(axis=(1, 2))
    assert abs(energy.mean() - 1.44) < 4.5 * energy.std(ddof=1) / math.sqrt(seeds)
    assert energy.std(ddof=1) < 0.16
    # What is nearer to the middle than the rim by a pixel's and the square's diagonals is as bright as all the disc.
    far = np.hypot(*np.meshgrid(np.arange(32) + 0.5 - x, np.arange(32) + 0.5 - y))
    mean = pictures.mean(axis=0)
    assert mean[far > radius + 1.6].max() == 0.0
    inside = far < radius - 1.6
    if radius > 3.0:
        level = 1.44 / (math.pi * radius**2)
        assert inside.sum() >= 4
        assert mean[inside].mean() == pytest.approx(level, abs=4.5 * math.sqrt(level / (spp * seeds * inside.sum())))


@CAMERAS
def test_what_is_in_focus_is_the_pinhole_s_picture(camera: Camera) -> None:
    scene = Scene("sharp", camera, (polygon([(-1.0, -0.7, 1.0), (0.9, -0.4, 1.0), (0.1, 0.8, 1.0)]),))
    pinhole = replace(scene, camera=replace(camera, lens_radius=0.0))
    for technique in ("raytrace:", "raytrace:spp=16,sampler=sobol", "raytrace:spp=16,sampler=jittered"):
        blurred, sharp = (render(s, technique, size=(32, 24)).pixels for s in (scene, pinhole))
        assert 0.05 < sharp.mean() < 0.5
        # A ray in some ten thousands passes an edge nearer than float32 tells.
        assert (blurred != sharp).any(axis=2).sum() <= 2


@CAMERAS
@pytest.mark.parametrize("depth", [3.5, 8.0], ids=["in front", "behind"])
def test_beyond_the_focus_the_disc_is_upside_up_and_before_it_turned_over(camera: Camera, depth: float) -> None:
    # A screen close to the lens lets through its upper right quarter. Rays from a point meet the picture's plane as the
    # quarter lies where the point is beyond the focus, and turned by half a turn where it is before it.
    size, near = (32, 32), 1e-3
    camera = replace(camera, lens_radius=1.5)
    scale = magnification(camera, 32, depth)
    z = EYE_Z - near
    screen = [(0, 9, z), (-9, 9, z), (-9, -9, z), (9, -9, z), (9, 0, z), (0, 0, z)]
    dot = polygon(square(0.0, 0.0, 0.5 / scale, depth))
    scene = Scene("quarter", camera, (dot, polygon(screen, color=(0.0, 0.0, 0.0))))
    radius = camera.lens_radius * abs(shift_of(camera, 32, depth, 5.0))
    picture = sample(scene, "raytrace:spp=256,sampler=sobol", size, 4).mean(axis=0)
    quarters = {
        "upper right": picture[:16, 16:].sum(),
        "upper left": picture[:16, :16].sum(),
        "lower left": picture[16:, :16].sum(),
        "lower right": picture[16:, 16:].sum(),
    }
    # Parallel rays start at the image point plus the lens point a: the image point being a (depth / focus - 1) off the
    # dot, which is in the middle, their sum has the sign of a where depth is below twice the focus.
    assert abs(depth / 5.0 - 1.0) < 1.0
    assert radius > 4.0
    lit = "upper right" if depth > 5.0 else "lower left"
    # Over each of the quarter's two borders a square of one pixel spills by 1/8 pixel on average times its length, the
    # radius, over its area: 0.32 / radius in all. Under parallel rays the screen blurs with the depth: up to half more.
    assert quarters[lit] / sum(quarters.values()) > 1.0 - 0.6 / radius
    if camera.height is None:
        assert sum(quarters.values()) == pytest.approx(0.25, rel=0.05)


@CAMERAS
@pytest.mark.parametrize("depth", [3.0, 9.0], ids=["in front", "behind"])
@pytest.mark.parametrize(("technique", "sampler", "seeds"), CASES)
def test_a_straight_edge_out_of_focus_has_a_disc_s_profile(
    camera: Camera, depth: float, sampler: str, technique: str, seeds: int
) -> None:
    size, spp, seeds = (40, 12), 32, min(seeds, 24)
    camera = replace(camera, lens_radius=1.6)
    scale = magnification(camera, size[1], depth)
    radius = 1.6 * shift_of(camera, size[1], depth, 5.0)
    scene = Scene("edge", camera, (polygon(half_plane(depth, 0.3 / scale)),))
    truth = np.broadcast_to(edge_profile(20.3, radius, size[0]), size[::-1])
    assert abs(radius) > 2.0
    assert truth[0, 0] == pytest.approx(0.0, abs=1e-12)
    assert truth[0, -1] == pytest.approx(1.0, abs=1e-12)
    pictures = sample(scene, technique.format(spp, sampler), size, seeds)
    assert_estimates(pictures, truth, spread=0.5 / math.sqrt(spp * seeds), samples=spp * seeds)
    assert (pictures[:, truth == 0.0] == 0.0).all()


def test_strata_on_the_lens_bring_the_noise_down() -> None:
    camera = replace(PERSPECTIVE, lens_radius=0.8)
    scene = Scene("edge", camera, (polygon(half_plane(9.0)),))
    deviation = {}
    for sampler in SAMPLERS:
        pictures = sample(scene, f"raytrace:spp=64,sampler={sampler}", (40, 12), 16)
        deviation[sampler] = math.sqrt(pictures.var(axis=0, ddof=1).mean())
    # Of N strata of the disc some N^.5 are cut: the variance is lower by N^-.5 = 1/8 at best, 1/2 leaves room.
    for sampler in SAMPLERS[1:]:
        assert deviation[sampler] < deviation["random"] / math.sqrt(2), deviation


# Cameras that move


TIMES, TIME_WEIGHTS = np.polynomial.legendre.leggauss(24)
SHUTTER = Animation(fps=4.0, shutter=0.75)


def mean_profile(edges: FloatArray, radii: FloatArray, width: int) -> FloatArray:
    """Return the mean profile over the TIMES of the open shutter."""
    return sum(w / 2 * edge_profile(e, r, width) for e, r, w in zip(edges, radii, TIME_WEIGHTS, strict=True))


def times(frame: int) -> FloatArray:
    """Return the TIMES in seconds."""
    return (frame + SHUTTER.shutter * (TIMES + 1) / 2) / SHUTTER.fps


@CAMERAS
@pytest.mark.parametrize("sampler", ["random", "sobol"])
def test_a_lens_that_moves_sideways_has_discs_at_all_its_places(camera: Camera, sampler: str) -> None:
    size, spp, seeds, frame, depth = (48, 12), 32, 24, 3, 9.0
    camera = replace(camera, lens_radius=0.8, velocity=(3.0, 0.5, 0.0))
    scale, radius = (magnification(camera, size[1], depth), 0.8 * shift_of(camera, size[1], depth, 5.0))
    # in the frame's middle the edge is in the middle of the picture
    start = 3.0 * times(frame).mean()
    scene = Scene("moving", camera, (polygon(half_plane(depth, start)),), animation=SHUTTER)
    edges = size[0] / 2 + (start - 3.0 * times(frame)) * scale
    truth = np.broadcast_to(mean_profile(edges, np.full(24, radius), size[0]), size[::-1])
    assert np.ptp(edges) > 0.5 * abs(radius)
    pictures = sample(scene, f"raytrace:spp={spp},sampler={sampler}", size, seeds, frame)
    assert_estimates(pictures, truth, spread=0.5 / math.sqrt(spp * seeds), samples=spp * seeds)


@CAMERAS
@pytest.mark.parametrize("follows", [True, False], ids=["target's distance", "given distance"])
def test_a_lens_that_moves_along_its_axis_keeps_its_focus_distance(camera: Camera, follows: bool) -> None:
    # The target moves along with the camera: its distance stays 6, and so does a given one.
    size, spp, seeds, frame = (40, 12), 32, 24, 1
    camera = replace(camera, lens_radius=0.8, velocity=(0.0, 0.0, -6.0), focus_distance=None if follows else 4.0)
    focus = 6.0 if follows else 4.0
    scene = Scene("along", camera, (polygon(half_plane(11.0)),), animation=SHUTTER)
    depths = 11.0 - 6.0 * times(frame)
    radii = np.array([0.8 * shift_of(camera, size[1], d, focus) for d in depths])
    assert depths.max() - depths.min() > 1.0
    truth = np.broadcast_to(mean_profile(np.full(24, size[0] / 2), radii, size[0]), size[::-1])
    pictures = sample(scene, f"raytrace:spp={spp},sampler=sobol", size, seeds, frame)
    assert_estimates(pictures, truth, spread=0.5 / math.sqrt(spp * seeds), samples=spp * seeds)


@CAMERAS
@pytest.mark.parametrize("sampler", ["jittered", "sobol"])
def test_the_focus_follows_a_target_that_moves(camera: Camera, sampler: str) -> None:
    # The target goes away from the camera, which stands still: its distance is 6 + 8 t.
    size, spp, seeds, frame, depth = (40, 12), 32, 24, 1, 5.0
    camera = replace(camera, lens_radius=1.0, target_velocity=(0.0, 0.0, -8.0), focus_distance=None)
    scene = Scene("pull", camera, (polygon(half_plane(depth)),), animation=SHUTTER)
    radii = np.array([shift_of(camera, size[1], depth, 6.0 + 8.0 * t) for t in times(frame)])
    assert np.ptp(radii) > 0.3
    truth = np.broadcast_to(mean_profile(np.full(24, size[0] / 2), radii, size[0]), size[::-1])
    pictures = sample(scene, f"raytrace:spp={spp},sampler={sampler}", size, seeds, frame)
    assert_estimates(pictures, truth, spread=0.5 / math.sqrt(spp * seeds), samples=spp * seeds)
    # Had the focus stayed where it was, another picture would have come.
    stuck = np.broadcast_to(edge_profile(size[0] / 2, shift_of(camera, size[1], depth, 6.0), size[0]), size[::-1])
    assert np.abs(truth - stuck).max() > 0.03


def test_the_focus_follows_in_a_camera_that_turns_to_its_target() -> None:
    # At time=center all is still: the picture is that of the camera of the moment, focused where its target is.
    camera = replace(PERSPECTIVE, lens_radius=0.5, focus_distance=None, velocity=(1.0, 0.2, 0.3),
                     target_velocity=(-2.0, 0.5, -3.0))  # fmt: skip
    things = tuple(polygon(square(x, y, 0.4, d)) for x, y, d in ((-1.0, 0.3, 4.0), (0.2, -0.5, 6.0), (1.2, 0.4, 9.0)))
    scene = Scene("turning", camera, things, animation=SHUTTER)
    t = (2 + SHUTTER.shutter / 2) / SHUTTER.fps
    place = np.array(camera.position) + t * np.array(camera.velocity)
    target = np.array(camera.target) + t * np.array(camera.target_velocity)
    still = replace(camera, position=tuple(place.tolist()), target=tuple(target.tolist()), velocity=(0.0, 0.0, 0.0),
                    target_velocity=None)  # fmt: skip
    moment = Scene("moment", still, things)
    technique = "raytrace:spp=16,sampler=jittered,time=center,reseed=never"
    one, other = (
        render(scene, technique, size=(40, 30), frame=2).pixels,
        render(moment, technique, size=(40, 30)).pixels,
    )
    assert 0.05 < other.mean() < 0.6
    assert (one != other).any(axis=2).sum() <= 3
    elsewhere = replace(moment, camera=replace(still, focus_distance=5.0))
    assert (render(elsewhere, technique, size=(40, 30)).pixels != other).any(axis=2).sum() > 100
