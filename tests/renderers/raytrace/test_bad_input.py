"""Bad techniques and scenes: one clear sentence from either door, and never a NaN in a picture."""

import dataclasses
import math
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aliasbench.bench import cli
from aliasbench.renderers.catalog import prepare, render
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Animation, Camera, Light, Material, Motion, Scene, Spin, Surface, read_only
from aliasbench.scenes.shapes import polygon

NAN, INF = math.nan, math.inf
BACKGROUND = (0.25, 0.5, 3.0)

REFUSED = [
    ("spp=0", r"spp=0: must be a whole number from 1 to"),
    ("spp=-1", r"spp=-1: must be a whole number from 1 to"),
    ("spp=1.5", r"spp=1.5: must be a whole number from 1 to"),
    ("spp=nan", r"spp=nan: must be a whole number from 1 to"),
    ("spp=4294967296", r"spp=4294967296: must be a whole number from 1 to 16777216"),
    ("adaptive=pooled,tolerance=0", r"tolerance=0: must be a number above 0"),
    ("adaptive=pooled,tolerance=-1", r"tolerance=-1: must be a number above 0"),
    ("adaptive=unbiased,tolerance=nan", r"tolerance=nan: must be a finite number"),
    ("adaptive=unbiased,tolerance=inf", r"tolerance=inf: must be a finite number"),
    ("adaptive=pooled,min_spp=9,max_spp=8", r"min_spp=9 is above max_spp=8"),
    ("adaptive=pooled,min_spp=0", r"min_spp=0: must be a whole number from 1 to"),
    ("adaptive=pooled,max_spp=-4", r"max_spp=-4: must be a whole number from 1 to"),
    ("adaptive=pooled,spp=4", r"spp cannot be given together with adaptive; use min_spp and max_spp"),
    ("adaptive=mean", r"unknown value of adaptive: 'mean'.* known: off, pooled, unbiased"),
    ("tolerance=.1", r"tolerance has no effect without adaptive"),
    ("min_spp=4", r"min_spp has no effect without adaptive"),
    ("max_spp=4", r"max_spp has no effect without adaptive"),
    ("filter=tent,radius=0", r"radius=0: must be a number above 0"),
    ("filter=tent,radius=-1", r"radius=-1: must be a number above 0"),
    ("filter=tent,radius=nan", r"radius=nan: must be a finite number"),
    ("filter=tent,radius=inf", r"radius=inf is for the gaussian filter"),
    (
        "filter=gaussian,radius=inf",
        r"radius=inf is for the gaussian filter of reference or with weighting=distribution",
    ),
    ("filter=gaussian,sigma=0", r"sigma=0: must be a number above 0"),
    ("filter=gaussian,sigma=nan", r"sigma=nan: must be a finite number"),
    ("filter=tent,sigma=1", r"sigma has no effect without filter=gaussian"),
    ("filter=tent,radius=1e-30", r"radius=1e-30: must be at least 1e-09 pixels"),
    ("filter=gaussian,sigma=1e-200", r"sigma=1e-200: must be at least 1e-09 pixels"),
    ("filter=lanczos,radius=1e9", r"radius=1e\+09: must be at most 256 with filter=lanczos"),
    ("filter=tent,radius=1e9", r"radius=1e\+09: a picture 6 pixels wide under so wide a filter needs more than 2 GB"),
    ("filter=tents", r"unknown value of filter: 'tents'; did you mean 'tent'\?"),
    ("weighting=distributed", r"unknown value of weighting: 'distributed'; did you mean 'distribution'\?"),
    ("warp=lecture", r"warp=lecture exists for filter=gaussian and filter=tent"),
    ("filter=tent,warp=lecture", r"warp has no effect without weighting=distribution"),
    ("sampler=bluenoise,pattern=shared", r"sampler=bluenoise has a pattern of its own for each pixel"),
    ("sampler=blue", r"unknown value of sampler: 'blue'; did you mean 'bluenoise'\?"),
    ("spp=16777216", r"5000 x 6 pixels at 16777216 samples are more than 2\^32 samples in all"),
    ("adaptive=unbiased,max_spp=16777216", r"5000 x 6 pixels at 16777216 samples are more than 2\^32"),
]


def size_of(technique: str) -> tuple[int, int]:
    return (5000, 6) if "16777216" in technique else (6, 5)


@pytest.fixture(scope="module")
def triangle(polygon: Any, flat_scene: Any) -> Scene:
    scene: Scene = flat_scene([polygon([[-4, -3, 0], [5, -2, 0], [0, 4, 0]])], background=BACKGROUND)
    return scene


@pytest.mark.parametrize(("technique", "sentence"), REFUSED, ids=[t for t, _ in REFUSED])
def test_bad_techniques_are_refused_from_python(triangle: Scene, technique: str, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        prepare(triangle, "raytrace:" + technique, size=size_of(technique))


@pytest.mark.parametrize(("technique", "sentence"), REFUSED, ids=[t for t, _ in REFUSED])
def test_bad_techniques_are_one_sentence_and_exit_code_2(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, technique: str, sentence: str
) -> None:
    out, (width, height) = tmp_path / "out.exr", size_of(technique)
    code = cli.main(["render", "edge-fan", "raytrace:" + technique, "-o", str(out), "--size", f"{width}x{height}"])
    printed = capsys.readouterr()
    assert code == 2
    assert printed.out == ""
    assert printed.err.startswith("aliasbench: ")
    assert printed.err.count("\n") == 1
    assert printed.err.endswith("\n")
    assert "Traceback" not in printed.err
    assert re.search(sentence, printed.err)
    assert list(tmp_path.iterdir()) == []


def test_in_a_process_of_its_own_there_is_no_traceback_either(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "aliasbench.bench", "render", "edge-fan", "raytrace:adaptive=pooled,tolerance=nan"]
    done = subprocess.run(
        [*command, "-o", str(tmp_path / "out.exr")], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith("aliasbench: ")
    assert done.stderr.count("\n") == 1


# Scenes that no file can describe.


def with_point(surface: Surface, value: float, corner: int = 1, axis: int = 0) -> Surface:
    vertices = surface.vertices.copy()
    vertices[corner, axis] = value
    return dataclasses.replace(surface, vertices=read_only(vertices), name="bent")


@pytest.mark.parametrize("value", [NAN, INF, -INF])
@pytest.mark.parametrize("engine", ["packet", "portable"])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_vertices_that_are_no_numbers_are_refused(triangle: Scene, value: float, engine: str, axis: int) -> None:
    bent = dataclasses.replace(triangle, objects=(with_point(triangle.objects[0], value, axis=axis),))
    with pytest.raises(InputError, match="scene 'law': vertices of object bent are not all finite numbers"):
        prepare(bent, f"raytrace:spp=4,filter=tent,engine={engine}", size=(6, 5))


SPOILS: dict[str, tuple[Callable[[Scene], Scene], str]] = {
    "background": (
        lambda s: dataclasses.replace(s, background=(0.0, NAN, 0.0)),
        r"background must be finite numbers, not \(0\.0, nan, 0\.0\)",
    ),
    "color": (
        lambda s: dataclasses.replace(s, objects=(dataclasses.replace(s.objects[0], color=(INF, 0.0, 0.0)),)),
        r"color of object number 0 must be finite numbers, not \(inf, 0\.0, 0\.0\)",
    ),
    "uv": (
        lambda s: dataclasses.replace(
            s, objects=(dataclasses.replace(s.objects[0], uv=read_only(np.full((3, 2), NAN))),)
        ),
        "uv of object number 0 are not all finite numbers",
    ),
    "radiance": (
        lambda s: dataclasses.replace(
            s, lights=(Light(((0.0, 0.0, 1.0), (1.0, 0.0, 1.0), (1.0, 1.0, 1.0), (0.0, 1.0, 1.0)), (NAN, 1.0, 1.0)),)
        ),
        "radiance of light 0 must be finite numbers",
    ),
    "light": (
        lambda s: dataclasses.replace(
            s, lights=(Light(((0.0, 0.0, NAN), (1.0, 0.0, 1.0), (1.0, 1.0, 1.0), (0.0, 1.0, 1.0)), (1.0, 1.0, 1.0)),)
        ),
        "quad of light 0 must be finite numbers",
    ),
    "camera": (
        lambda s: dataclasses.replace(s, camera=Camera("orthographic", height=4.0, position=(NAN, 0.0, 5.0))),
        "position of the camera must be finite numbers",
    ),
}


@pytest.mark.parametrize("what", SPOILS)
def test_other_values_that_are_no_numbers_are_refused(triangle: Scene, what: str) -> None:
    spoil, sentence = SPOILS[what]
    with pytest.raises(InputError, match=sentence):
        prepare(spoil(triangle), "raytrace:spp=4", size=(6, 5))


TECHNIQUES = [
    f"{sampling},{filtering}"
    for sampling in (
        "spp=1", "spp=5,sampler=grid", "spp=3,sampler=random", "spp=4,sampler=jittered", "spp=6,sampler=multijittered",
        "spp=8,sampler=sobol", "spp=4,sampler=random,pattern=shared", "adaptive=pooled", "adaptive=unbiased",
        "adaptive=unbiased,pattern=shared", "adaptive=unbiased,min_spp=1,sampler=sobol",
    )
    for filtering in ("filter=box", "filter=tent", "filter=cone", "filter=gaussian", "filter=gaussian,sigma=1e-6")
]  # fmt: skip


@pytest.mark.parametrize("technique", TECHNIQUES)
@pytest.mark.parametrize("engine", ["packet", "portable"])
def test_an_empty_scene_is_its_background(flat_scene: Any, technique: str, engine: str) -> None:
    frame = render(flat_scene([], background=BACKGROUND), f"raytrace:engine={engine},{technique}", size=(5, 3))
    np.testing.assert_allclose(frame.pixels, np.broadcast_to(np.float32(BACKGROUND), (3, 5, 3)), rtol=1e-6)
    assert frame.samples >= 15


@pytest.mark.parametrize("filtering", ["filter=mitchell", "filter=lanczos"])
def test_an_empty_scene_stays_finite_under_signed_weights(flat_scene: Any, filtering: str) -> None:
    scene = flat_scene([], background=BACKGROUND)
    for sampling in ("spp=1", "spp=1,sampler=random", "adaptive=unbiased,min_spp=1", "adaptive=pooled,min_spp=1"):
        for size in ((1, 1), (1, 5), (9, 1)):
            for weighting in ("samples", "distribution"):
                text = f"raytrace:{sampling},{filtering},weighting={weighting}"
                with prepare(scene, text, size=size) as prepared:
                    pixels = np.stack([prepared.render(seed=seed).pixels for seed in range(20)])
                assert np.isfinite(pixels).all()
                # A sum of signed weights is within the gain, which is below 4.
                assert np.abs(pixels).max() < 4.0 * max(BACKGROUND)


@pytest.fixture
def box_around(polygon: Any, flat_scene: Any) -> Scene:
    """Return a closed box of six colours around a perspective camera."""
    corners = np.array([[x, y, z] for x in (-2.0, 2.0) for y in (-1.5, 2.5) for z in (-3.0, 2.0)])
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    colors = [(1.0, 0.5, 0.5), (0.5, 1.0, 0.5), (0.5, 0.5, 1.0), (1.0, 1.0, 0.5), (1.0, 0.5, 1.0), (0.5, 1.0, 1.0)]
    walls = [polygon(corners[f], color=c) for f, c in zip(faces, colors, strict=True)]
    camera = Camera("perspective", position=(0.3, 0.2, 0.1), target=(-0.5, 0.4, -3.0), fov_y_deg=100.0)
    scene: Scene = flat_scene(walls, camera=camera, background=(1e6, 1e6, 1e6))
    return scene


@pytest.mark.parametrize(
    "technique",
    [
        "spp=64", "spp=16,filter=tent", "spp=16,filter=lanczos,radius=2", "adaptive=pooled",
        "adaptive=unbiased,filter=gaussian", "spp=64,engine=portable",
    ],
)  # fmt: skip
def test_from_inside_a_closed_box_the_background_is_never_seen(box_around: Scene, technique: str) -> None:
    frame = render(box_around, "raytrace:" + technique, size=(24, 18))
    assert np.isfinite(frame.pixels).all()
    # Rays through the seams of two walls included: one in a thousand samples would show as 1000.
    assert frame.pixels.max() < 1.6
    assert frame.pixels.min() > 0.2
    assert frame.pixels.std() > 0.05


def test_a_camera_within_a_wall_gives_a_finite_picture(quad: Any, flat_scene: Any) -> None:
    camera = Camera("perspective", position=(0.0, 0.0, 0.0), target=(0.0, 0.0, -1.0), fov_y_deg=60.0)
    wall = dataclasses.replace(quad(-5, -5, 5, 5), material=Material("diffuse"))
    for technique in ("spp=16", "spp=4,filter=tent", "adaptive=unbiased"):
        pixels = render(flat_scene([wall], camera=camera), "raytrace:" + technique, size=(8, 8)).pixels
        assert np.isfinite(pixels).all()


@pytest.mark.parametrize("engine", ["packet", "portable"])
@pytest.mark.parametrize("more", ["", ",robust=off", ",spp=4,filter=tent"])
def test_a_camera_in_a_polygon_s_plane_sees_nothing_of_it(engine: str, more: str) -> None:
    """Also within its outline; another surface is seen as if it were not there."""
    corners = [(-9.0, 0.0, 9.0), (9.0, 0.0, 9.0), (9.0, 0.0, -9.0), (-9.0, 0.0, -9.0)]
    wall = polygon([(-2.0, -1.0, -4.0), (1.0, -1.0, -4.0), (1.0, 1.5, -4.0)], color=(0.2, 0.5, 0.9))
    camera = Camera("perspective", position=(0.0, 0.0, 4.0), target=(0.0, 0.5, 0.0), fov_y_deg=50.0)
    with_floor = Scene("floor", camera, (polygon(corners), wall), background=(0.1, 0.2, 0.3))
    alone = Scene("wall", camera, (wall,), background=(0.1, 0.2, 0.3))
    technique = f"raytrace:engine={engine}{more}"
    shown, expected = (render(scene, technique, size=(24, 18)).pixels for scene in (with_floor, alone))
    assert np.ptp(expected) > 0.3
    np.testing.assert_allclose(shown, expected, atol=1e-6)


def test_one_pattern_whose_weights_nearly_cancel_keeps_what_is_flat() -> None:
    scene = Scene("flat", Camera("orthographic", height=2.0), (), background=(0.2, 0.3, 0.4))
    text = "raytrace:spp=2,pattern=shared,sampler=multijittered,filter=mitchell,radius=0.3"
    for seed in range(6):
        pixels = render(scene, text, size=(6, 5), seed=seed).pixels
        np.testing.assert_allclose(pixels, np.broadcast_to((0.2, 0.3, 0.4), (5, 6, 3)), rtol=2e-4)


@pytest.mark.parametrize("renderer", ["raytrace:", "raster:", "reference:"])
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"camera": {"height": 0.0}}, "height of the camera is 0.0; it must be a finite number above 0"),
        ({"camera": {"height": math.nan}}, "height of the camera is nan; it must be a finite number above 0"),
        ({"camera": {"position": (0.0, math.inf, 1.0)}}, "position of the camera must be finite numbers"),
        ({"camera": {"velocity": (math.nan, 0.0, 0.0)}}, "velocity of the camera must be finite numbers"),
        ({"camera": {"lens_radius": -1.0}}, "lens_radius of the camera is -1.0; it must be 0 or more"),
        ({"camera": {"lens_radius": math.nan}}, "lens_radius of the camera must be finite numbers"),
        ({"camera": {"focus_distance": 0.0}}, "focus_distance of the camera is 0.0"),
        ({"animation": {"fps": 0.0}}, "fps of the animation is 0.0; it must be above 0"),
        ({"animation": {"shutter": math.nan}}, "shutter of the animation must be finite numbers"),
        ({"animation": {"shutter": 1.5}}, "shutter of the animation is 1.5; it must be from 0 to 1"),
        ({"motion": Motion((math.nan, 0.0, 0.0))}, "velocity of object number 0 must be finite numbers"),
        ({"motion": Motion(matrices=((math.nan,) * 16, (0.0,) * 16))}, "matrices of object number 0 must be finite"),
        (
            {"motion": Motion(spin=Spin((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0))},
            "axis of the spin of object number 0 is",
        ),
        (
            {"material": Material("glossy", roughness=2.0)},
            "roughness of object number 0 is 2.0; it must be from 0 to 1",
        ),
        ({"material": Material("glossy", roughness=math.nan)}, "material of object number 0 must be finite numbers"),
    ],
)
def test_numbers_that_mean_nothing_are_refused_by_name(renderer: str, change: dict[str, Any], message: str) -> None:
    surface = polygon([(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (0.0, 1.0, 0.0)])
    for key in ("motion", "material"):
        if key in change:
            surface = dataclasses.replace(surface, **{key: change[key]})
    camera = dataclasses.replace(Camera("orthographic", height=2.0), **change.get("camera", {}))
    animation = dataclasses.replace(Animation(), **change.get("animation", {}))
    scene = Scene("bad", camera, (surface,), animation=animation)
    with pytest.raises(InputError, match=re.escape(message)):
        prepare(scene, renderer, size=(8, 8))
