"""Rays that start close before the scene: nothing is missed before, and from afar nothing is misplaced."""

from dataclasses import replace

import numpy as np
import pytest

from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.geometry import build_bodies
from aliasbench.renderers.raytrace.start import Spheres, find_start
from aliasbench.scenes.model import Animation, Camera, Checker, FloatArray, Light, Material, Motion, Scene, Spin
from aliasbench.scenes.motion import object_matrix
from aliasbench.scenes.projection import view_at
from aliasbench.scenes.shapes import polygon, quad

SIZE = (30, 20)
ENGINES = ("raytrace:", "raytrace:robust=off", "raytrace:engine=portable")
PROJECTIONS = ("orthographic", "perspective")


def camera_at(projection: str, distance: float, **options: object) -> Camera:
    """A camera that sees 20 units from bottom to top at the origin, a pixel a unit, from obliquely above."""
    position = tuple(distance * np.array([0.36, 0.48, 0.8]))
    if projection == "orthographic":
        return Camera(projection, position, height=20.0, **options)
    return Camera(projection, position, fov_y_deg=2.0 * float(np.degrees(np.arctan(10.0 / distance))), **options)


def stack(motion: Motion | None = None) -> tuple:
    """Polygons in one plane, one a little before them that comes first, one behind that comes last, and a texture."""

    def at(points: list[tuple[float, float]], z: float) -> FloatArray:
        return np.array([(x, y, z) for x, y in points])

    return (
        polygon(at([(-6.0, -5.0), (1.0, -6.0), (0.3, -0.2)], 0.02), color=(1.0, 1.0, 0.0), motion=motion),
        polygon(at([(-7.3, -6.1), (6.9, -5.7), (7.7, 6.3), (-6.6, 7.1)], 0.0), color=(1.0, 0.5, 0.0), motion=motion),
        polygon(at([(-5.2, -4.4), (4.1, -3.3), (5.3, 5.1), (-4.7, 4.3)], 0.0), color=(0.0, 0.5, 1.0), motion=motion),
        quad(at([(-2.1, -2.3), (3.2, -2.2), (3.3, 3.4), (-2.2, 3.3)], 0.0), texture="squares", motion=motion),
        polygon(at([(-9.0, -8.0), (9.0, -8.0), (9.0, 2.0), (-9.0, 2.0)], -0.02), color=(0.0, 1.0, 0.5), motion=motion),
    )


TEXTURES = {"squares": Checker((5.0, 5.0), (0.2, 0.1, 0.3), (0.9, 0.8, 0.7))}
MOTIONS = {
    "still": None,
    "turning": Motion((3.0, -2.0, 1.0), Spin((0.3, 0.2, 1.0), (1.0, 2.0, 0.0), 0.3)),
    "matrices": Motion(
        matrices=(
            (1.0, 0.1, 0.0, 0.5, -0.1, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0),
            (0.9, -0.1, 0.0, -0.5, 0.2, 1.1, 0.0, 0.3, 0.0, 0.0, 1.0, 0.2, 0.0, 0.0, 0.0, 1.0),
        )
    ),
}


@pytest.mark.parametrize("technique", ENGINES)
@pytest.mark.parametrize("moves", MOTIONS)
def test_a_picture_from_afar_is_that_by_parallel_rays(moves: str, technique: str) -> None:
    """At 1e9 units a pinhole's rays are parallel to 1e-8, over a scene of some 20 units: less than 1e-6 px."""
    objects = stack(MOTIONS[moves])
    key = "spp=4" if technique.endswith(":") else ",spp=4"
    animation = Animation(10.0, 4, 0.5)
    pictures = [
        render(
            Scene("afar", camera, objects, TEXTURES, animation=animation), technique + key, size=SIZE, frame=1
        ).pixels
        for camera in (camera_at("orthographic", 40.0), *(camera_at(p, 1e9) for p in PROJECTIONS))
    ]
    assert np.ptp(pictures[0]) > 0.5
    for far in pictures[1:]:
        # texture coordinates differ by the rays' slopes; a sample that close to an edge is not among these
        np.testing.assert_allclose(far, pictures[0], atol=1e-6)


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_nothing_is_before_the_start(projection: str) -> None:
    rng = np.random.default_rng(7)
    found = 0
    for number in range(60):
        distance = float(rng.choice([1.0, 3.0, 10.0, 100.0, 1e6])) * 10.0
        motion = list(MOTIONS.values())[number % 3]
        camera = camera_at(projection, distance, velocity=tuple(rng.uniform(-5.0, 5.0, 3)), lens_radius=0.1)
        scene = Scene("any", camera, stack(motion), TEXTURES, animation=Animation(5.0, 8, 1.0))
        frame = int(rng.integers(0, 8))
        views = tuple(view_at(camera, scene.animation, frame, f, SIZE) for f in (0.0, 1.0))
        span = frame / 5.0, (frame + 1.0) / 5.0
        start, share = find_start(Spheres.about(build_bodies(scene)), scene, views, span)
        assert 0.0 < share <= 1.0
        if start == 0.0:
            assert share == 1.0
            continue
        found += 1
        for fraction in np.linspace(0.0, 1.0, 9).tolist():
            view = view_at(camera, scene.animation, frame, fraction, SIZE)
            for surface in scene.objects:
                matrix = object_matrix(surface.motion, scene.animation, frame, fraction)
                points = surface.vertices @ matrix[:3, :3].T + matrix[:3, 3]
                depth = view.to_camera(points)[:, 2] - 0.1
                assert (depth > start).all()
                # and the start is close to what is there
                assert start > 0.7 * depth.max()
    assert found > 15


def test_scenes_about_the_camera_are_traced_from_it() -> None:
    near = Scene("near", camera_at("perspective", 30.0), stack(), TEXTURES)
    floor = polygon([(-1e4, -2.0, -1e4), (1e4, -2.0, -1e4), (1e4, -2.0, 1e4), (-1e4, -2.0, 1e4)])
    wide = Scene("wide", camera_at("perspective", 300.0), (*stack(), floor), TEXTURES)
    for scene in (near, wide, replace(near, objects=())):
        view = view_at(scene.camera, scene.animation, 0, 0.0, SIZE)
        assert find_start(Spheres.about(build_bodies(scene)), scene, (view, view), (0.0, 0.0)) == (0.0, 1.0)


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_order_of_frames_does_not_matter_where_the_start_changes(projection: str) -> None:
    camera = camera_at(projection, 3e3, velocity=(-108.0, -144.0, -240.0))
    objects = (*stack()[:3], *stack(Motion((1.0, 2.0, 3.0)))[3:])
    scene = Scene("approach", camera, objects, TEXTURES, animation=Animation(1.0, 10, 0.5))
    with prepare(scene, "raytrace:spp=2", size=SIZE) as prepared:
        once = [prepared.render(frame=k).pixels.copy() for k in (0, 9, 5, 0)]
    fresh = [render(scene, "raytrace:spp=2", size=SIZE, frame=k).pixels for k in (0, 9, 5)]
    for a, b in zip(once, [*fresh, fresh[0]], strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("engine", ["packet", "portable"])
def test_light_from_afar(engine: str) -> None:
    """A lit scene seen by parallel rays from 1e7 units away is the same picture as from 40."""
    corners = [(-8.0, -8.0, 0.0), (8.0, -8.0, 0.0), (8.0, 8.0, 0.0), (-8.0, 8.0, 0.0)]
    blade = [(-3.0, -2.0, 2.0), (3.0, -2.0, 2.0), (2.0, 4.0, 2.0)]
    objects = (
        polygon(corners, material=Material("diffuse")),
        polygon(blade, color=(0.9, 0.4, 0.2), material=Material("diffuse")),
    )
    lights = (Light(((-2.0, -2.0, 9.0), (-2.0, 2.0, 9.0), (2.0, 2.0, 9.0), (2.0, -2.0, 9.0)), (3.0, 3.0, 3.0)),)
    pictures = [
        render(
            Scene("lit", camera_at("orthographic", distance), objects, lights=lights),
            f"raytrace:spp=8,engine={engine}",
            size=SIZE,
        ).pixels
        for distance in (40.0, 1e7)
    ]
    assert np.ptp(pictures[0]) > 0.1
    # float32 shadow rays start at points that are rounded otherwise: a sample in a penumbra may turn over
    apart = np.abs(pictures[1] - pictures[0]).max(axis=2)
    assert np.median(apart) < 1e-6
    assert (apart > 1e-4).mean() < 0.02


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_what_is_behind_the_camera_or_far_beyond_changes_nothing(projection: str) -> None:
    distance = 1e7
    camera = camera_at(projection, distance)
    view = view_at(camera, Animation(), 0, 0.0, SIZE)
    middle = camera.position

    def sheet(depth: float, size: float) -> FloatArray:
        corners = [(-size, -size), (size, -size), (size, size), (-size, size)]
        return np.array([np.add(middle, depth * view.forward + x * view.right + y * view.up) for x, y in corners])

    behind = polygon(sheet(-0.5 * distance, 3.0), color=(0.3, 0.3, 0.3))
    backdrop = polygon(sheet(10.0 * distance, 1e3), color=(0.1, 0.2, 0.4))
    alone = render(Scene("alone", camera, stack(), TEXTURES, background=(0.1, 0.2, 0.4)), "raytrace:", size=SIZE).pixels
    for more in ((behind,), (backdrop,), (behind, backdrop)):
        background = (0.1, 0.2, 0.4) if backdrop not in more else (0.0, 0.0, 0.0)
        scene = Scene("more", camera, (*stack(), *more), TEXTURES, background=background)
        np.testing.assert_allclose(render(scene, "raytrace:", size=SIZE).pixels, alone, atol=1e-6)
