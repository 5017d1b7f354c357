"""What the scenes of light, lens, gloss and glass promise: geometry and closed forms."""

import math
from collections import Counter

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.scenes import depth_of_field, soft_shadow
from aliasbench.scenes.catalog import SCENES
from aliasbench.scenes.dispersion_prism import landing
from aliasbench.scenes.entries import Parameter
from aliasbench.scenes.lamps import square_form_factor
from aliasbench.scenes.model import FloatArray, Scene, Surface
from aliasbench.scenes.projection import View, focus_at, view_at


def first_view(scene: Scene, size: tuple[int, int] = (256, 256), frame: int = 0, fraction: float = 0.0) -> View:
    return view_at(scene.camera, scene.animation, frame, fraction, size)


def normal_of(surface: Surface) -> FloatArray:
    a, b, c = surface.vertices[surface.triangles[0]]
    normal = np.cross(b - a, c - a)
    out: FloatArray = normal / np.linalg.norm(normal)
    return out


def in_picture(view: View, points: FloatArray) -> bool:
    x, y, depth = np.moveaxis(view.project(points), -1, 0)
    return bool(((x > 0) & (x < view.width) & (y > 0) & (y < view.height) & (depth > 0)).all())


# --- lights ---


@pytest.mark.parametrize(("half", "height"), [(0.3, 3.0), (1.0, 1.0), (2.0, 0.5), (0.01, 2.0)])
def test_the_form_factor_of_a_square_is_its_integral(half: float, height: float) -> None:
    nodes, weights = np.polynomial.legendre.leggauss(60)
    x, y = np.meshgrid(half * nodes, half * nodes)
    value = height**2 / (math.pi * (x**2 + y**2 + height**2) ** 2)
    assert square_form_factor(half, height) == pytest.approx(half**2 * (weights @ value @ weights), rel=1e-10)


@pytest.mark.parametrize(
    ("name", "bright"), [("soft-shadow", 0.8), ("pixel-time-lens-light", 0.6), ("colour-bleeding", 0.5)]
)
@pytest.mark.parametrize("light_size", [0.05, 1.0])
def test_lamps_shine_down_and_light_the_floor_alike_at_any_size(name: str, bright: float, light_size: float) -> None:
    scene = SCENES[name].build(light_size=light_size)
    (light,) = scene.lights
    corners = np.array(light.quad)
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    assert normal[1] < 0.0
    assert normal[0] == normal[2] == 0.0
    side = float(np.linalg.norm(corners[1] - corners[0]))
    assert side == pytest.approx(light_size)
    factor = square_form_factor(side / 2, float(corners[0, 1]))
    assert light.radiance[0] * factor == pytest.approx(bright, rel=1e-12)
    assert light.radiance[0] > 1.0


@pytest.mark.parametrize("light_height", [2.0, 3.0, 6.0])
def test_the_light_over_the_slats_is_not_in_the_picture(light_height: float) -> None:
    scene = SCENES["soft-shadow"].build(light_height=light_height)
    seen = first_view(scene).project(np.array(scene.lights[0].quad))
    assert ((seen[:, 1] < -5.0) | (seen[:, 2] <= 0.0)).all()


@pytest.mark.parametrize("slats", [1, 4, 8])
def test_slats_are_apart_over_the_middle_and_their_shadows_at_the_default_too(slats: int) -> None:
    scene = SCENES["soft-shadow"].build(slats=slats)
    floor, *blades = scene.objects
    assert len(blades) == slats
    assert all(s.material.kind == "diffuse" for s in scene.objects)
    assert normal_of(floor)[1] == 1.0
    assert np.mean([b.vertices.mean(axis=0) for b in blades], axis=0) == pytest.approx((0.0, 0.5, 0.0), abs=1e-12)
    for blade in blades:
        np.testing.assert_array_equal(blade.vertices[:, 1], 0.5)
        assert abs(normal_of(blade)[1]) == pytest.approx(1.0)
    scale = 3.0 / (3.0 - 0.5)  # of shadows, by the light's height over its distance from the slats
    penumbra = 0.6 * 0.5 / (3.0 - 0.5)
    assert penumbra == pytest.approx(0.12)
    assert soft_shadow.SLAT_WIDTH * scale > penumbra


def test_every_blur_of_the_combined_scene_has_its_parameter() -> None:
    scene = SCENES["pixel-time-lens-light"].build()
    assert not scene.is_static
    assert scene.animation.shutter > 0.0
    assert scene.camera.lens_radius > 0.0
    blades = [s for s in scene.objects if s.motion.spin is not None]
    assert len(blades) == 3
    # in focus is the plane through the rotor's middle, and nothing else that is drawn over the floor
    focus = focus_at(scene.camera, scene.animation, 0, 0.0)
    spin = blades[0].motion.spin
    assert spin is not None
    view = first_view(scene)
    assert view.to_camera(np.array(spin.center))[2] == pytest.approx(focus)
    posts = [view.to_camera(s.vertices)[:, 2] for s in scene.objects if s.name.startswith("post")]
    assert any(p.max() < focus - 0.3 for p in posts)
    assert any(p.min() > focus + 0.3 for p in posts)
    assert not in_picture(view, np.array(scene.lights[0].quad))
    sharp = SCENES["pixel-time-lens-light"].build(rev_per_s=0.0, shutter=0.0, lens_radius=0.0)
    assert sharp.is_static
    assert sharp.camera.lens_radius == 0.0
    turns = scene.animation.frames * spin.rev_per_s / scene.animation.fps
    assert turns == round(turns)


def test_the_room_is_seen_from_inside_and_its_block_stands_in_it_closed() -> None:
    scene = SCENES["colour-bleeding"].build()
    middle = np.array((0.0, 1.0, 0.0))
    for wall in scene.objects[:4]:
        assert normal_of(wall) @ (middle - wall.vertices.mean(axis=0)) > 0.0
    block = scene.objects[4:]
    heart = np.mean([s.vertices.mean(axis=0) for s in block[1:]], axis=0)
    for side in block:
        assert normal_of(side) @ (side.vertices.mean(axis=0) - heart) > 0.0
        assert np.abs(side.vertices[:, [0, 2]]).max() < 0.9
    edges = Counter(
        tuple(sorted((tuple(a), tuple(b))))
        for s in block
        for a, b in zip(s.vertices.tolist(), np.roll(s.vertices, -1, axis=0).tolist(), strict=True)
    )
    assert sorted(edges.values()) == [1] * 4 + [2] * 8  # open only where it stands on the floor
    red, green = scene.objects[2].color, scene.objects[3].color
    assert red[0] > 5 * red[1]
    assert green[1] > 5 * green[0]
    dark = SCENES["colour-bleeding"].build(reflectance=0.0)
    assert all(s.color == (0.0, 0.0, 0.0) for s in dark.objects)


# --- lens ---


@pytest.mark.parametrize("focus", [3.0, 5.0, 9.0])
def test_groups_look_alike_to_a_pinhole_and_keep_apart_by_more_than_the_lens_spreads_them(focus: float) -> None:
    scene = SCENES["depth-of-field"].build(focus=focus)
    view = first_view(scene)
    spans, spreads, sizes = [], [], []
    for depth, _, _ in depth_of_field.GROUPS:
        seen = np.concatenate([view.project(s.vertices) for s in scene.objects if s.name.endswith(f"at {depth:g}")])
        assert seen[:, 2] == pytest.approx(depth)
        spans.append((seen[:, 0].min(), seen[:, 0].max()))
        sizes.append(np.ptp(seen[:, :2], axis=0))
        spreads.append(view.scale * scene.camera.lens_radius * abs(1 / depth - 1 / focus))
        assert seen[:, :2].min() > spreads[-1]
        assert seen[:, :2].max() < 256.0 - spreads[-1]
    np.testing.assert_allclose(sizes, np.broadcast_to(sizes[0], (3, 2)), rtol=1e-12)
    assert spreads[(3.0, 5.0, 9.0).index(focus)] == 0.0
    for k in range(2):
        assert spans[k + 1][0] - spans[k][1] > spreads[k] + spreads[k + 1]


def test_the_picture_through_the_lens_is_certified() -> None:
    frame = render(SCENES["depth-of-field"].build(), "reference:", size=(64, 64))
    assert frame.uncertainty_kind == "bound"
    assert frame.uncertainty is not None
    assert frame.uncertainty < 1e-6
    # light is spread, not lost: all that the lens moves stays within the picture
    sharp = render(SCENES["depth-of-field"].build(lens_radius=0.0), "reference:", size=(64, 64))
    assert frame.pixels.sum() == pytest.approx(sharp.pixels.sum(), rel=1e-9)
    assert np.abs(frame.pixels - sharp.pixels).max() > 0.2


# --- gloss and glass ---


def test_mirror_images_in_the_glossy_floor_lie_in_the_picture_and_on_the_floor() -> None:
    scene = SCENES["glossy-floor"].build()
    view = first_view(scene)
    floor, *things = scene.objects
    assert (floor.material.kind, floor.material.roughness) == ("glossy", 0.1)
    low, high = floor.vertices.min(axis=0), floor.vertices.max(axis=0)
    for thing in things:
        assert thing.material.kind == "unlit"
        assert thing.vertices[:, 1].min() >= 0.0
        assert in_picture(view, thing.vertices)
        image = thing.vertices * (1.0, -1.0, 1.0)
        assert in_picture(view, image)
        # where the rays to the mirror image pass the plane y = 0 is where they are reflected
        share = view.origin[1] / (view.origin[1] - image[:, 1])
        crossing = view.origin + share[:, None] * (image - view.origin)
        assert (crossing[:, [0, 2]] > low[[0, 2]]).all()
        assert (crossing[:, [0, 2]] < high[[0, 2]]).all()
    far = view.project(floor.vertices[2:])
    assert (far[:, 1] > 0.0).all()  # the floor ends within the picture, under the sky


def refracted(direction: FloatArray, normal: FloatArray, ratio: float) -> FloatArray:
    """Snell's law in vectors; the normal points against the ray, `ratio` is the index before over the one behind."""
    cosine = -float(direction @ normal)
    inside = 1.0 - ratio**2 * (1.0 - cosine**2)
    assert inside > 0.0  # no total reflection
    out: FloatArray = ratio * direction + (ratio * cosine - math.sqrt(inside)) * normal
    return out


def lands(scene: Scene, x: float, index: float) -> float:
    """Return where on the screen a ray of the camera through (x, 0) lands, traced through the wedge's own faces."""
    faces = {s.name: s for s in scene.objects}
    point, direction = np.array([x, 0.0, 5.0]), np.array([0.0, 0.0, -1.0])
    for name, ratio, sign in (("wedge front", 1 / index, 1.0), ("wedge back", index, -1.0)):
        face = faces[name]
        normal = normal_of(face)
        assert direction @ normal * sign < 0.0
        point = point + direction * ((face.vertices[0] - point) @ normal / (direction @ normal))
        assert (point[0] > face.vertices[:, 0].min()) & (point[0] < face.vertices[:, 0].max())
        direction = refracted(direction, sign * normal, ratio)
    screen = faces["screen"].vertices[0, 2]
    return float((point + direction * (screen - point[2]) / direction[2])[0])


def line_indices(ior: float, abbe: float) -> dict[str, float]:
    """Return Cauchy's indices of the lines F (486.1 nm), d (587.6) and C (656.3)."""
    f, d, c = (1 / x**2 for x in (0.4861, 0.5876, 0.6563))
    slope = (ior - 1) / abbe / (f - c)
    return {"F": ior + slope * (f - d), "d": ior, "C": ior + slope * (c - d)}


@pytest.mark.parametrize("parameters", [{}, {"angle": 30.0, "ior": 1.8, "abbe": 10.0}, {"angle": 10.0, "ior": 1.3}])
def test_the_prisms_rays_land_where_snell_says(parameters: dict[str, float]) -> None:
    scene = SCENES["dispersion-prism"].build(**parameters)
    glass = next(s.material for s in scene.objects if s.name == "wedge front")
    assert glass.kind == "glass"
    assert glass.abbe is not None
    for index in line_indices(glass.ior, glass.abbe).values():
        for x in (-0.5, 0.0, 0.4):
            traced = lands(scene, x, index)
            assert traced == pytest.approx(landing(x, parameters.get("angle", 28.0), index), abs=1e-9)


def test_red_and_blue_see_the_slit_at_clearly_different_places() -> None:
    scene = SCENES["dispersion-prism"].build()
    slit = next(s for s in scene.objects if s.name == "slit").vertices[:, 0].mean()
    indices = line_indices(1.728, 28.4)
    assert (indices["F"] - indices["C"]) * 28.4 == pytest.approx(0.728)
    seen = {}
    for line, index in indices.items():
        near, far = lands(scene, -0.3, index), lands(scene, 0.3, index)  # landing places are linear in x
        seen[line] = -0.3 + 0.6 * (slit - near) / (far - near)
        assert lands(scene, seen[line], index) == pytest.approx(slit, abs=1e-9)
    assert seen["d"] == pytest.approx(0.0, abs=1e-9)
    assert seen["F"] < seen["d"] < seen["C"]
    pixels = (seen["C"] - seen["F"]) * 128.0
    assert 4.0 < pixels < 20.0
    assert in_picture(first_view(scene), np.array([[x, 0.0, 0.5] for x in seen.values()]))


def test_no_visible_light_is_totally_reflected_in_range() -> None:
    entry = SCENES["dispersion-prism"]
    angle, ior = (entry.parameters[key] for key in ("angle", "ior"))
    assert isinstance(angle, Parameter)
    assert isinstance(ior, Parameter)
    # Cauchy's index is linear in the inverse square of the wavelength; violet ends at 380 nm
    f, d, c, violet = (1 / x**2 for x in (0.4861, 0.5876, 0.6563, 0.38))
    for steepest in np.linspace(ior.low, ior.high, 5):
        index = steepest + (steepest - 1) / 10.0 * (violet - d) / (f - c)
        assert index * math.sin(math.radians(angle.high)) < 0.99


def test_the_wedge_is_closed_and_wound_outwards_and_all_of_it_is_one_glass() -> None:
    scene = SCENES["dispersion-prism"].build()
    wedge = [s for s in scene.objects if s.name.startswith("wedge")]
    assert len({s.material for s in wedge}) == 1
    heart = np.mean([s.vertices.mean(axis=0) for s in wedge], axis=0)
    directed = Counter()
    for side in wedge:
        assert normal_of(side) @ (side.vertices.mean(axis=0) - heart) > 0.0
        for a, b in zip(side.vertices.tolist(), np.roll(side.vertices, -1, axis=0).tolist(), strict=True):
            directed[tuple(a), tuple(b)] += 1
    assert len(directed) == 24
    assert all(directed[b, a] == 1 for a, b in list(directed))
