"""What any reference obeys, whatever its scene shows: on random scenes of every class.

Two pictures that must be one are compared within the sum of what they state. TRIALS=100 asks for as many scenes of each
class.
"""

import itertools
import os
from dataclasses import replace

import numpy as np
import pytest
from random_scenes import CLASSES, make_case

from aliasbench.renderers.catalog import render
from aliasbench.renderers.reference.faces import build_faces
from aliasbench.renderers.reference.lit import draw_lit
from aliasbench.renderers.reference.moving import draw_shutter
from aliasbench.renderers.reference.paths import scene_paths
from aliasbench.renderers.sampling.filters import filter_of
from aliasbench.renderers.technique import parse_technique
from aliasbench.scenes.model import Camera, Light, Scene, read_only
from aliasbench.scenes.projection import view_at

COUNT = int(os.environ.get("TRIALS", "0"))
SIZE = (7, 5)
# classes whose references take seconds are left to the extended run
QUICK = ("instant-flat-filter", "moving-flat-box", "moving-flat-filter", "texture-instant-box")
KINDS = CLASSES if COUNT else QUICK
ROUNDING = 1e-12


def cases(kind, few=2):
    """Return cases of a class at a small size."""
    return [replace(make_case(kind, 1001 + seed), size=SIZE) for seed in range(COUNT or few)]


def draw(case, scene=None, **given):
    """Return a case's frame, of another scene if given."""
    given = {"size": case.size, "frame": case.frame} | given
    return render(scene or case.scene, case.text, **given)


def tint(color, factor):
    return tuple(factor * c for c in color)


def scaled(scene: Scene, factor: float) -> Scene:
    """Return the scene with all it radiates multiplied."""
    return replace(
        scene,
        background=tint(scene.background, factor),
        objects=tuple(
            replace(o, color=o.color if scene.lights and o.material.kind == "diffuse" else tint(o.color, factor))
            for o in scene.objects
        ),
        lights=tuple(Light(q.quad, tint(q.radiance, factor)) for q in scene.lights),
    )


def mirrored(scene: Scene) -> Scene:
    """Return the scene with x for -x."""
    flip = np.diag([-1.0, 1.0, 1.0, 1.0])

    def point(p):
        return None if p is None else (-p[0], p[1], p[2])

    def motion(m):
        spin = m.spin and replace(
            m.spin, axis=(m.spin.axis[0], -m.spin.axis[1], -m.spin.axis[2]), center=point(m.spin.center)
        )
        pair = m.matrices and tuple(tuple((flip @ np.reshape(x, (4, 4)) @ flip).ravel().tolist()) for x in m.matrices)
        return replace(m, velocity=point(m.velocity), spin=spin, matrices=pair)

    c = scene.camera
    return replace(
        scene,
        camera=replace(
            c, position=point(c.position), target=point(c.target), up=point(c.up), velocity=point(c.velocity),
            target_velocity=point(c.target_velocity),
        ),
        objects=tuple(
            replace(o, vertices=read_only(o.vertices * [-1, 1, 1]), motion=motion(o.motion)) for o in scene.objects
        ),
        lights=tuple(Light(tuple(point(p) for p in q.quad[::-1]), q.radiance) for q in scene.lights),
    )  # fmt: skip


def close(a, b, stated):
    """Return whether two pictures differ by no more than both state."""
    return np.abs(a - b).max() <= stated + ROUNDING * max(1.0, float(np.abs(a).max()))


@pytest.mark.parametrize("kind", KINDS)
def test_scaled_colours_scale_picture_and_bound(kind):
    for case in cases(kind):
        once, thrice = draw(case), draw(case, scaled(case.scene, 3.0))
        assert close(thrice.pixels, 3 * once.pixels, thrice.uncertainty + 3 * once.uncertainty), case.seed
        assert thrice.uncertainty <= 3 * 1.5 * once.uncertainty + 1e-5, case.seed


@pytest.mark.parametrize("kind", KINDS)
def test_mirrored_scene_mirrors_the_picture(kind):
    for case in cases(kind):
        plain, turned = draw(case), draw(case, mirrored(case.scene))
        assert close(plain.pixels, turned.pixels[:, ::-1], plain.uncertainty + turned.uncertainty), case.seed


@pytest.mark.parametrize("kind", KINDS)
def test_light_of_parts_adds_up(kind):
    """The picture is linear in the colours: red and the rest are drawn apart and put together."""
    for case in cases(kind):
        whole = draw(case)
        parts = []
        for mask in ((1.0, 0.0, 0.0), (0.0, 1.0, 1.0)):
            objects = tuple(
                replace(o, color=tuple(m * c for m, c in zip(mask, o.color, strict=True))) for o in case.scene.objects
            )
            back = tuple(m * c for m, c in zip(mask, case.scene.background, strict=True))
            lights = tuple(
                Light(q.quad, tuple(m * c for m, c in zip(mask, q.radiance, strict=True))) for q in case.scene.lights
            )
            parts.append(draw(case, replace(case.scene, objects=objects, background=back, lights=lights)))
        stated = whole.uncertainty + sum(p.uncertainty for p in parts)
        assert close(sum(p.pixels for p in parts), whole.pixels, stated), case.seed


@pytest.mark.parametrize("kind", KINDS)
def test_one_pixel_alone_is_that_pixel_of_the_picture(kind):
    for case in cases(kind):
        camera: Camera = case.scene.camera
        # the pixel in the middle keeps the axis; one pixel high, it sees a fifth of the height
        if camera.projection == "orthographic":
            alone = replace(camera, height=camera.height / SIZE[1])
        else:
            half = np.tan(np.radians(camera.fov_y_deg) / 2) / SIZE[1]
            alone = replace(camera, fov_y_deg=float(2 * np.degrees(np.arctan(half))))
        whole, one = draw(case), draw(case, replace(case.scene, camera=alone), size=(1, 1))
        middle = whole.pixels[SIZE[1] // 2, SIZE[0] // 2]
        assert close(middle, one.pixels[0, 0], whole.uncertainty + one.uncertainty + 1e-11), case.seed


@pytest.mark.parametrize("kind", [k for k in KINDS if "mov" in k or "motion" in k])
def test_pictures_repeat_after_whole_turns(kind):
    for case in cases(kind):
        scene, fps = case.scene, case.scene.animation.fps
        objects = tuple(
            replace(
                o,
                motion=replace(
                    o.motion,
                    velocity=(0.0, 0.0, 0.0),
                    spin=o.motion.spin
                    and replace(o.motion.spin, rev_per_s=round(4 * o.motion.spin.rev_per_s / fps) * fps / 4),
                ),
            )
            for o in scene.objects
        )
        camera = replace(scene.camera, velocity=(0.0, 0.0, 0.0), target_velocity=None)
        loop = replace(scene, objects=objects, camera=camera)
        first, again = draw(case, loop, frame=1), draw(case, loop, frame=5)
        assert close(first.pixels, again.pixels, first.uncertainty + again.uncertainty), case.seed


@pytest.mark.parametrize("kind", [k for k in KINDS if COUNT or k != "moving-flat-filter"])
def test_pixels_do_not_depend_on_the_number_of_cores(kind, monkeypatch, tmp_path):
    for case in cases(kind, few=1):
        case = replace(case, size=(5, 130))  # enough bands of rows for two threads
        frames = []
        for cores in ({0}, {0, 1, 2}):
            monkeypatch.setenv("ALIASBENCH_CACHE", str(tmp_path / f"{case.seed}-{len(cores)}"))
            monkeypatch.setattr(os, "sched_getaffinity", lambda _, cores=cores: cores, raising=False)
            frames.append(draw(case))
        assert np.array_equal(frames[0].pixels, frames[1].pixels), case.seed
        assert frames[0].uncertainty == frames[1].uncertainty, case.seed


@pytest.mark.parametrize("kind", KINDS)
def test_empty_scenes_are_their_background(kind):
    for case in cases(kind):
        frame = draw(case, replace(case.scene, objects=(), lights=()))
        assert np.abs(frame.pixels - case.scene.background).max() <= 4e-16 * max(1.0, *case.scene.background)


@pytest.mark.parametrize("kind", ["moving-flat-box", "moving-flat-filter", "light"])
def test_a_tenth_of_the_bound_moves_no_pixel_beyond_it(kind):
    """Both ways that take a target, the shutter's and the lights', at 1e-3, 1e-4 and 1e-5."""
    for case in cases(kind):
        scene, size, frame = case.scene, case.size, case.frame
        if case.linear:
            continue
        faces, paths = build_faces(scene), scene_paths(scene, interpolated=case.matrix)
        spec = filter_of(parse_technique(case.text))
        pictures = []
        for target in (1e-3, 1e-4, 1e-5):
            if kind == "light":
                view = view_at(scene.camera, scene.animation, frame, 0.0, size)
                pictures.append(draw_lit(scene, faces, paths, view, frame, 0.0, spec, target=target))
            else:
                pictures.append(draw_shutter(scene, faces, paths, size, frame, spec, target))
        for coarse, fine in itertools.pairwise(pictures):
            moved = np.abs(coarse.pixels - fine.pixels).max(axis=2)
            assert (moved <= coarse.bound + fine.bound).all(), case.seed
            assert (moved <= 1.1 * float(coarse.bound.max())).all(), case.seed
