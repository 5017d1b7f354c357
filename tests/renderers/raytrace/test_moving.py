"""Large things that move while the shutter is open are seen where they are; others are handed over once."""

from dataclasses import replace

import numpy as np
import pytest

from aliasbench.renderers.catalog import prepare, render
from aliasbench.renderers.geometry import build_bodies
from aliasbench.renderers.raytrace.exposure import plan_exposure
from aliasbench.renderers.raytrace.moving import Moving
from aliasbench.renderers.raytrace.start import Spheres
from aliasbench.renderers.raytrace.tables import build_looks
from aliasbench.renderers.technique import parse_technique
from aliasbench.scenes.model import Animation, Camera, Checker, FloatArray, Motion, Scene, Spin, Surface
from aliasbench.scenes.shapes import polygon

SIZE = (40, 30)
CAMERAS = {
    "orthographic": Camera("orthographic", (0.0, 0.0, 40.0), height=30.0),
    "perspective": Camera("perspective", (0.0, 0.0, 40.0), fov_y_deg=41.0),
}
MOTIONS = {
    "flight": Motion((3.0, -2.0, 0.0)),
    "spin": Motion((0.0, 0.0, 0.0), Spin((0.0, 0.0, 1.0), (2.0, 1.0, 0.0), 0.2)),
    "matrices": Motion(
        matrices=(
            (1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0),
            (1.0, 0.0, 0.0, 3.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0),
        )
    ),
}


def half_plane(far: float, motion: Motion | None) -> Surface:
    """y >= 0.37 x + 0.3 with squares on it, up to `far` units away, its middle nowhere near the picture."""
    along = np.array([1.0, 0.37]) / np.hypot(1.0, 0.37)
    across = np.array([-along[1], along[0]])
    start = np.array([0.0, 0.3])
    corners = [start - far * along, start + 0.3 * far * along, start + 0.2 * far * along + far * across,
               start - 0.9 * far * along + 0.6 * far * across]  # fmt: skip
    points = np.c_[np.array(corners), np.zeros(4)]
    return polygon(points, uv=points[:, :2] / 7.3 + 0.123, texture="squares", motion=motion)


TEXTURES = {"squares": Checker((1.0, 1.0), (0.1, 0.2, 0.3), (0.9, 0.8, 0.7))}


def scene_of(projection: str, surfaces: tuple[Surface, ...], velocity: tuple[float, float, float]) -> Scene:
    camera = replace(CAMERAS[projection], velocity=velocity)
    return Scene("large", camera, surfaces, TEXTURES, animation=Animation(2.0, 6, 1.0))


@pytest.mark.parametrize("engine", ["packet", "portable"])
@pytest.mark.parametrize("projection", CAMERAS)
@pytest.mark.parametrize("moves", MOTIONS)
@pytest.mark.parametrize("far", [1e4, 1e7])
def test_samples_see_what_they_see_of_a_small_one(far: float, moves: str, projection: str, engine: str) -> None:
    """Only what is in sight counts: a sheet 60 units large is the same picture, up to samples at its edges."""

    def picture(reach: float) -> FloatArray:
        surfaces = (half_plane(reach, MOTIONS[moves]), half_plane(0.7 * reach, MOTIONS[moves]))
        scene = scene_of(projection, surfaces, (0.3, 0.1, 0.0))
        return np.asarray(render(scene, f"raytrace:spp=4,engine={engine}", size=SIZE, frame=2).pixels)

    small, large = picture(400.0), picture(far)
    assert np.ptp(small) > 0.3
    # 50 px of outline that may be 2^-8 px beside, either way, times 4 samples: 1.6 may be on the other side
    apart = np.abs(large - small).max(axis=2) > 1e-6
    assert apart.sum() <= (2 if far < 1e5 else 0)


@pytest.mark.parametrize("projection", CAMERAS)
def test_frames_come_out_alike_in_any_order(projection: str) -> None:
    scene = scene_of(projection, (half_plane(1e6, MOTIONS["spin"]), half_plane(50.0, MOTIONS["flight"])), (0.3, 0, 0))
    with prepare(scene, "raytrace:spp=2", size=SIZE) as prepared:
        once = [prepared.render(frame=k).pixels.copy() for k in (0, 5, 2, 0)]
    for k, shown in zip((0, 5, 2, 0), once, strict=True):
        np.testing.assert_array_equal(shown, render(scene, "raytrace:spp=2", size=SIZE, frame=k).pixels)


@pytest.mark.parametrize("projection", CAMERAS)
@pytest.mark.parametrize(("far", "cut"), [(30.0, False), (1e6, True)])
def test_ordinary_bodies_are_handed_over_once(far: float, cut: bool, projection: str) -> None:
    scene = scene_of(projection, (half_plane(far, MOTIONS["spin"]), half_plane(5.0, MOTIONS["flight"])), (0.0, 0, 0))
    bodies, technique = build_bodies(scene), parse_technique("raytrace:spp=4")
    plans = [plan_exposure(scene, technique, SIZE, bodies, Spheres.about(bodies), k) for k in range(3)]
    moving = Moving(scene, build_looks(scene, "point"), plans[0].moving, placed=True)
    taken: list[list[int]] = []
    for plan in plans:
        moving.place(plan, lambda meshes: taken.append([len(mesh.triangles) for mesh in meshes]))
        assert sum(moving.ownership.counts) == len(moving.ownership.owners) == len(moving.ownership.values)
    assert len(taken) == (3 if cut else 1)
    assert (taken[0][0] > 2) == cut
    assert taken[0][1] == 2
