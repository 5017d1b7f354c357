"""Both engines on everything that blurs, scatters or adapts: one picture, bit for bit, on packets and on single rays.

`robust=on`, the default: both then find the same triangle even where edges are shared. All random numbers, weights and
directions come from the same functions in the same order, so that nothing is left to differ.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import (
    Animation,
    Camera,
    Checker,
    ImageTexture,
    Light,
    Material,
    Motion,
    Scene,
    Spin,
    read_only,
)
from aliasbench.scenes.shapes import polygon

SIZE = (24, 20)
LAMPS = (
    Light(((-0.7, 2.2, -0.5), (0.5, 2.2, -0.5), (0.5, 2.2, 0.5), (-0.7, 2.2, 0.5)), (6.0, 5.0, 3.0)),
    Light(((2.0, 0.2, 0.8), (2.0, 0.2, -0.8), (2.0, 1.4, -0.8), (2.0, 1.4, 0.8)), (1.0, 2.0, 3.0)),
)


def build_lit(*, lens: float = 0.0, bounces: int = 0, shutter: float = 0.0) -> Scene:
    """Return a floor, a sheet with holes, a glossy and a glass one, and a triangle that spins, under two lights."""
    rng = np.random.default_rng(2)
    texels = rng.random((5, 6, 4)).astype(np.float32)
    textures = {
        "checker": Checker((9.0, 9.0), (0.1, 0.1, 0.2)),
        "holes": ImageTexture(read_only(texels), alpha_cutoff=0.4),
    }
    uv = [(0, 0), (1, 0), (1, 1), (0, 1)]
    spin = Motion((3.0, 0.0, 1.0), Spin((0.1, 1.0, 0.2), (0.3, 0.8, 0.2), 5.0))
    diffuse = Material("diffuse")
    objects = (
        polygon([(-3, 0, 3), (3, 0, 3), (3, 0, -3), (-3, 0, -3)], uv=uv, texture="checker", material=diffuse),
        polygon([(-1.3, 0, -0.6), (0.2, 0, -0.9), (0.2, 1.2, -0.9), (-1.3, 1.2, -0.6)], uv=uv, texture="holes",
                color=(0.9, 0.7, 0.5), material=diffuse),
        polygon([(0.3, 0, -1.0), (1.4, 0, -0.4), (1.4, 1.1, -0.4), (0.3, 1.1, -1.0)], color=(0.8, 0.9, 0.6),
                material=Material("glossy", roughness=0.2)),
        polygon([(-0.6, 0.1, 0.9), (0.5, 0.1, 0.8), (0.5, 0.8, 0.8), (-0.6, 0.8, 0.9)],
                material=Material("glass", ior=1.3, abbe=20.0)),
        polygon([(0.0, 0.8, 0.1), (0.6, 0.8, 0.0), (0.5, 0.8, 0.5)], color=(0.2, 0.5, 0.9), material=diffuse,
                motion=spin),
    )  # fmt: skip
    camera = Camera("perspective", position=(0.4, 1.6, 4.0), target=(0.0, 0.4, 0.0), fov_y_deg=38.0, lens_radius=lens)
    return Scene(
        "lit",
        camera,
        objects,
        textures,
        LAMPS,
        (0.05, 0.1, 0.2),
        bounces=bounces,
        animation=Animation(20.0, 1, shutter),
    )


SCENES: dict[str, Callable[[], Scene]] = {
    "lit": build_lit,
    "lit, a lens": lambda: build_lit(lens=0.15),
    "lit, an open shutter": lambda: build_lit(shutter=0.6),
    "lit, a bounce": lambda: build_lit(bounces=1),
    "all": lambda: build_lit(lens=0.1, bounces=1, shutter=0.6),
    "soft-shadow": lambda: load_scene("soft-shadow"),
    "pixel-time-lens-light": lambda: load_scene("pixel-time-lens-light"),
    "depth-of-field": lambda: load_scene("depth-of-field"),
    "glossy-floor": lambda: load_scene("glossy-floor"),
    "dispersion-prism": lambda: load_scene("dispersion-prism"),
    "colour-bleeding": lambda: load_scene("colour-bleeding"),
}
TECHNIQUES = (
    "spp=5,sampler=sobol",
    "spp=16,sampler=multijittered,shadow_rays=3",
    "spp=4,filter=gaussian",
    "spp=9,sampler=random,filter=lanczos,weighting=distribution",
    "adaptive=unbiased,tolerance=0.03,min_spp=4,max_spp=32",
    "adaptive=pooled,tolerance=0.03,min_spp=3,max_spp=40,filter=mitchell,sampler=sobol",
    "spp=7,pattern=shared,texture=ewa",
    "spp=3,texture=trilinear,motion=matrix",
)


def assert_equal(scene: Scene, technique: str) -> None:
    packet, portable = (
        render(scene, f"raytrace:engine={engine},{technique}", size=SIZE, frame=1, seed=4)
        for engine in ("packet", "portable")
    )
    assert packet.pixels.std() > 0.03
    np.testing.assert_array_equal(packet.pixels, portable.pixels)
    assert packet.samples == portable.samples
    if packet.sample_counts is None or portable.sample_counts is None:
        assert packet.sample_counts is portable.sample_counts
        return
    np.testing.assert_array_equal(packet.sample_counts, portable.sample_counts)
    assert np.ptp(packet.sample_counts) > 0


@pytest.mark.parametrize("name", SCENES)
def test_both_engines_see_the_same_in_every_scene(name: str) -> None:
    for technique in TECHNIQUES[:2]:
        assert_equal(SCENES[name](), technique)


@pytest.mark.parametrize("technique", TECHNIQUES)
def test_both_engines_see_the_same_under_every_technique(technique: str) -> None:
    assert_equal(SCENES["all"](), technique)


def test_the_scene_of_all_has_all() -> None:
    # Each part of it changes the picture: what both engines agree on is not nothing.
    whole = SCENES["all"]()
    technique = "raytrace:spp=16,sampler=sobol"
    picture = render(whole, technique, size=SIZE, frame=1).pixels
    without = [
        replace(whole, lights=whole.lights[:1]),
        replace(whole, bounces=0),
        replace(whole, animation=replace(whole.animation, shutter=0.0)),
        replace(whole, camera=replace(whole.camera, lens_radius=0.0)),
        *(replace(whole, objects=(*whole.objects[:k], *whole.objects[k + 1 :])) for k in range(len(whole.objects))),
    ]
    for scene in without:
        other = render(scene, technique, size=SIZE, frame=1).pixels
        assert (np.abs(other - picture).max(axis=2) > 0.02).sum() > 10


@pytest.mark.parametrize("threads", ["1", "3"])
def test_paths_are_the_same_on_any_number_of_threads(threads: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = SCENES["all"]()
    pictures = []
    for count in ("2", threads):
        monkeypatch.setenv("ALIASBENCH_THREADS", count)
        pictures.append(render(scene, "raytrace:spp=6,sampler=multijittered,filter=tent", size=(37, 23), seed=2).pixels)
    np.testing.assert_array_equal(*pictures)
