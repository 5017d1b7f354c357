"""Laws of things that move while the shutter is open, sample by sample against float64 and in closed form."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.raytrace import exposure
from aliasbench.renderers.sampling.patterns import sample_set
from aliasbench.scenes.model import Animation, Camera, Motion, Spin, read_only
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import view_at

HALF_OPEN = Animation(fps=30.0, frames=10, shutter=0.5)
SIZE = (32, 24)


def shared_samples(count: int, frame: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return image x, y (h, w, count) and times (count,) of `sampler=random,pattern=shared`, seed 0."""
    places = sample_set("random", count, frame=frame)
    x = np.arange(SIZE[0])[None, :, None] + places[:, 0]
    y = np.arange(SIZE[1])[:, None, None] + places[:, 1]
    return np.broadcast_to(x, (*SIZE[::-1], count)), np.broadcast_to(y, (*SIZE[::-1], count)), places[:, 2]


def mean_inside(corners: np.ndarray, motion: Motion, camera: Camera, frame: int, count: int) -> np.ndarray:
    """Return the share of samples (h, w) inside a convex counter-clockwise planar polygon, each at its own time."""
    x, y, times = shared_samples(count, frame)
    inside = np.zeros(x.shape)
    for k, time in enumerate(times):
        fraction = time * HALF_OPEN.shutter
        view = view_at(camera, HALF_OPEN, frame, fraction, SIZE)
        matrix = object_matrix(motion, HALF_OPEN, frame, fraction)
        points = corners @ matrix[:3, :3].T + matrix[:3, 3]
        image = view.project(points)[:, :2]
        signs = []
        for a, b in zip(image, np.roll(image, -1, axis=0), strict=True):
            signs.append((b[0] - a[0]) * (y[..., k] - a[1]) - (b[1] - a[1]) * (x[..., k] - a[0]))
        inside[..., k] = np.all(np.array(signs) < 0, axis=0)
    return inside.mean(axis=2)


CORNERS = np.array([[-5.0, -3.0, 0.0], [6.0, -2.0, 0.0], [5.0, 4.0, 0.0], [-4.0, 3.0, 0.0]])
ORTHOGRAPHIC = Camera("orthographic", position=(0.0, 0.0, 14.0), height=24.0)
PERSPECTIVE = Camera("perspective", position=(1.0, 0.5, 14.0), fov_y_deg=75.0)
SHEAR = (1.0, 0.3, 0.0, 2.0, 0.1, 0.9, 0.0, -1.0, 0.0, 0.0, 1.0, 0.5, 0.0, 0.0, 0.0, 1.0)
MOTIONS = {
    "velocity": Motion(velocity=(90.0, -40.0, 20.0)),
    "spin": Motion(spin=Spin((0.0, 0.0, 1.0), (1.0, 1.0, 0.0), 11.0)),
    "spin about a tilted axis on the move": Motion((40.0, 0.0, 5.0), Spin((0.2, 0.3, 1.0), (-1.0, 0.5, 0.0), -7.0)),
    "700 turns in the shutter": Motion(spin=Spin((0.0, 0.0, 1.0), (1.0, 1.0, 0.0), 42000.3)),
    "matrices": Motion(matrices=(tuple(np.eye(4).ravel().tolist()), SHEAR)),
}


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("camera", [ORTHOGRAPHIC, PERSPECTIVE], ids=["orthographic", "perspective"])
def test_every_sample_sees_the_body_where_it_is_at_its_own_time(
    polygon: Any, flat_scene: Any, name: str, camera: Camera
) -> None:
    scene = flat_scene([polygon(CORNERS, motion=MOTIONS[name])], camera=camera, animation=HALF_OPEN)
    pixels = render(scene, "raytrace:spp=19,sampler=random,pattern=shared", size=SIZE, frame=3).pixels[..., 0]
    expected = mean_inside(CORNERS, MOTIONS[name], camera, 3, 19)
    assert 0.05 < expected.mean() < 0.6
    # At most a sample in ten thousand lies within float32's rounding of an edge.
    assert np.count_nonzero(np.abs(pixels - expected) > 1e-6) <= 1


@pytest.mark.parametrize("target_velocity", [None, (0.0, 40.0, 0.0)], ids=["along", "turning"])
@pytest.mark.parametrize("camera", [ORTHOGRAPHIC, PERSPECTIVE], ids=["orthographic", "perspective"])
@pytest.mark.parametrize("name", [None, "velocity", "spin"])
def test_every_ray_starts_where_the_camera_is_at_its_own_time(
    polygon: Any, flat_scene: Any, camera: Camera, target_velocity: tuple[float, float, float] | None, name: str | None
) -> None:
    moving = dataclasses.replace(camera, velocity=(60.0, 30.0, 25.0), target_velocity=target_velocity)
    motion = Motion() if name is None else MOTIONS[name]
    scene = flat_scene([polygon(CORNERS, motion=motion)], camera=moving, animation=HALF_OPEN)
    pixels = render(scene, "raytrace:spp=19,sampler=random,pattern=shared", size=SIZE, frame=2).pixels[..., 0]
    expected = mean_inside(CORNERS, motion, moving, 2, 19)
    assert expected.mean() > 0.02
    assert np.count_nonzero(np.abs(pixels - expected) > 1e-6) <= 1


def test_a_moving_edge_gives_its_time_integral(quad: Any, flat_scene: Any) -> None:
    # x(t) = -10 + 12 t pixels over the shutter; a pixel at j is covered for the mean of clamp(x(t) - j, 0, 1), whose
    # variance under independent samples is p (1 - p) / N.
    scene = flat_scene(
        [quad(-100, -100, -10, 100, motion=Motion(velocity=(12.0 * 60.0, 0.0, 0.0)))], height=24.0, animation=HALF_OPEN
    )
    count = 1024
    pixels = render(scene, f"raytrace:spp={count},sampler=random", size=SIZE).pixels[..., 0].astype(np.float64)
    t = (np.arange(20000) + 0.5) / 20000
    exact = np.clip(-10 + 12 * t[:, None] - (np.arange(32) - 16), 0, 1).mean(axis=0)
    np.testing.assert_array_equal(pixels[:, exact == 0.0], 0.0)
    np.testing.assert_array_equal(pixels[:, exact == 1.0], 1.0)
    partial = (exact > 0.0) & (exact < 1.0)
    assert partial.sum() >= 12
    z = (pixels - exact)[:, partial] / np.sqrt(exact * (1 - exact) / count)[partial]
    # 24 x 12 values: the largest of them passes 5 standard deviations once in 6000 tries.
    assert np.abs(z).max() < 5.0
    assert abs(z.mean()) < 4.0 / np.sqrt(z.size)
    # Samples' times are independent of their places and of each other: the scatter is what chance gives.
    assert 0.8 < z.std() < 1.2


@pytest.mark.parametrize("turns", [1, 3, 50])
def test_half_a_plane_in_whole_turns_covers_every_pixel_half_the_time(quad: Any, flat_scene: Any, turns: int) -> None:
    # For N strata in time each turn has N / turns of them; a pixel's share is off by at most one stratum per crossing.
    spin = Spin((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), turns * 60.0)
    scene = flat_scene([quad(-90, 0, 90, 90, motion=Motion(spin=spin))], height=24.0, animation=HALF_OPEN)
    pixels = render(scene, "raytrace:spp=1024", size=SIZE).pixels[..., 0]
    far = np.hypot(*np.meshgrid(np.arange(32) - 15.5, np.arange(24) - 11.5)) > 4
    assert np.abs(pixels[far] - 0.5).max() < 5 * np.sqrt(0.25 / 1024)
    assert abs(float(pixels.mean()) - 0.5) < 1e-3


@pytest.mark.parametrize("camera", [ORTHOGRAPHIC, PERSPECTIVE], ids=["orthographic", "perspective"])
@pytest.mark.parametrize("name", MOTIONS)
def test_an_instant_is_the_still_scene_of_that_moment(
    polygon: Any, flat_scene: Any, name: str, camera: Camera, monkeypatch: pytest.MonkeyPatch
) -> None:
    motion, frame, fraction = MOTIONS[name], 4, HALF_OPEN.shutter / 2
    scene = flat_scene([polygon(CORNERS, motion=motion)], camera=camera, animation=HALF_OPEN)
    matrix = object_matrix(motion, HALF_OPEN, frame, fraction)
    moved = flat_scene([polygon(CORNERS @ matrix[:3, :3].T + matrix[:3, 3])], camera=camera)
    technique = "raytrace:spp=9,time=center,reseed=never"
    still = render(moved, technique, size=SIZE).pixels
    assert still.max() == 1.0
    assert np.count_nonzero(render(scene, technique, size=SIZE, frame=frame).pixels != still) <= 3
    # A mesh too large to be rebuilt for every frame is traced in its own frame: the same picture.
    monkeypatch.setattr(exposure, "MERGE_LIMIT", 0)
    assert np.count_nonzero(render(scene, technique, size=SIZE, frame=frame).pixels != still) <= 3


def test_one_fixed_sample_is_at_the_middle_of_the_shutter(polygon: Any, flat_scene: Any) -> None:
    scene = flat_scene([polygon(CORNERS, motion=MOTIONS["spin"])], height=24.0, animation=HALF_OPEN)
    for sampler in ("center", "grid"):
        spread, center = (
            render(scene, f"raytrace:sampler={sampler},time={time}", size=SIZE, frame=2).pixels
            for time in ("spread", "center")
        )
        np.testing.assert_array_equal(spread, center)


def test_frames_do_not_depend_on_the_frames_before(polygon: Any, flat_scene: Any) -> None:
    # The camera flies far past its target, so that the origin of float32 coordinates changes on the way.
    camera = dataclasses.replace(PERSPECTIVE, velocity=(200.0, 0.0, 0.0), target_velocity=(0.0, 0.0, 0.0))
    above = polygon(CORNERS + np.array([0, 0, 1]), motion=MOTIONS["velocity"])
    scene = flat_scene([polygon(CORNERS), above], camera=camera, animation=HALF_OPEN)
    with prepare(scene, "raytrace:spp=4", size=SIZE) as prepared:
        forward = [prepared.render(n).pixels for n in range(6)]
        backward = [prepared.render(n).pixels for n in reversed(range(6))][::-1]
    np.testing.assert_array_equal(forward, backward)
    np.testing.assert_array_equal(render(scene, "raytrace:spp=4", size=SIZE, frame=5).pixels, forward[5])


def test_time_samples_leave_a_still_scene_as_it_is(polygon: Any, flat_scene: Any) -> None:
    still, open_shutter = (flat_scene([polygon(CORNERS)], animation=a) for a in (Animation(), HALF_OPEN))
    pictures = [render(scene, "raytrace:spp=16", size=SIZE).pixels for scene in (still, open_shutter)]
    np.testing.assert_array_equal(*pictures)


def test_a_body_squeezed_flat_is_no_crash(polygon: Any, flat_scene: Any) -> None:
    flat = (1.0, 0.0, 0.0, 0.0) + (0.0,) * 4 + (0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    scene = flat_scene([polygon(CORNERS, motion=Motion(matrices=(flat, flat)))], animation=HALF_OPEN)
    assert np.array_equal(render(scene, "raytrace:spp=4", size=SIZE).pixels, np.zeros((24, 32, 3)))


def test_meshes_and_polygons_move_alike(polygon: Any, flat_scene: Any) -> None:
    body = polygon(CORNERS, motion=MOTIONS["spin"])
    mesh = dataclasses.replace(body, is_polygon=False, vertices=read_only(CORNERS.copy()))
    pictures = [render(flat_scene([s], animation=HALF_OPEN), "raytrace:spp=5", size=SIZE).pixels for s in (body, mesh)]
    np.testing.assert_array_equal(*pictures)
