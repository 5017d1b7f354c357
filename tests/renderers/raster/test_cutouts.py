"""Cut-outs by alpha to coverage: borders as smooth as hardware samples allow, in their place; all else unchanged."""

import dataclasses

import numpy as np
import pytest

from aliasbench.renderers.catalog import render
from aliasbench.renderers.raster import pipeline
from aliasbench.renderers.raster.alpha_coverage import coverage_curve, coverage_excess
from aliasbench.renderers.raster.context import acquire_context
from aliasbench.scenes.catalog import SCENES
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import ImageTexture

pytestmark = pytest.mark.usefixtures("gl_checked")
SIZE = (80, 64)
COVERAGE = "msaa=4,alpha_to_coverage=on"
CORNERS = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
UNIT = [(0, 0), (1, 0), (1, 1), (0, 1)]


def cut(alpha, cutoff=0.5, color=(1.0, 1.0, 1.0)):
    alpha = np.atleast_2d(np.asarray(alpha, np.float32))
    texels = np.empty((*alpha.shape, 4), np.float32)
    texels[..., :3], texels[..., 3] = color, alpha
    return ImageTexture(texels, cutoff)


def leaves(make, color=(0.2, 0.9, 0.3)):
    """Smooth random blobs on a plane that leans away."""
    side = 32
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(side), np.fft.fftfreq(side)))
    noise = np.fft.fft2(np.random.default_rng(3).standard_normal((side, side))) * np.exp(-((9 * frequency) ** 2))
    shape = np.fft.ifft2(noise).real
    alpha = np.clip(0.5 + 0.25 * shape / shape.std(), 0.0, 1.0)
    corners = [(-3, -1, 1), (3, -1, 1), (3, 2, -3), (-3, 2, -3)]
    sheet = make.polygon(corners, uv=np.array(UNIT) * 2.0, texture="t")
    return make.scene(sheet, camera=make.perspective, textures={"t": cut(alpha, color=color)})


def rmse(one, other):
    return float(np.sqrt(np.mean((np.asarray(one, float) - other) ** 2)))


def test_the_excess_is_that_of_the_device_and_alpha_covers_from_none_to_all():
    context = acquire_context()
    for samples in context.sample_counts[1:]:
        curve = coverage_curve(context, samples)
        assert curve[0] <= 1 / samples
        assert curve[-1] == 1.0
        # dithered or not, over runs of alphas more of it covers more
        assert (np.diff(curve.reshape(32, -1).mean(axis=1)) >= -1e-6).all()
        assert set(np.round(curve * samples, 5)) <= set(range(samples + 1))
        assert coverage_excess(context, samples) == pytest.approx(curve.mean() - 0.5)
        assert abs(coverage_excess(context, samples)) <= 0.5 / samples + 1e-6
        if "llvmpipe" in context.renderer:
            steps = np.ceil((np.arange(len(curve)) + 0.5) / len(curve) * samples) / samples
            np.testing.assert_allclose(curve, steps, atol=1e-6)


@pytest.mark.parametrize("mode", ["linear", "trilinear", "anisotropic"])
@pytest.mark.parametrize("wires", [10.0, 20.0])
def test_borders_of_a_screen_of_wires_err_less_than_with_hardware_samples_alone(mode, wires):
    # Half of the texels are cut out: where a blend of the two kinds is 1/2 they meet.
    scene = SCENES["window-screens"].build(kind="cutouts", wires=wires, tilt_deg=17.0)
    exact = render(scene, "reference:", size=SIZE).pixels
    alone, covered = (
        render(scene, f"raster:texture={mode},{options}", size=SIZE).pixels for options in ("msaa=4", COVERAGE)
    )
    assert rmse(covered, exact) < 0.55 * rmse(alone, exact)
    # and the wires are not made wider
    assert abs(covered.mean() - exact.mean()) < 0.01
    assert 0.2 < exact.mean() < 0.8


def test_borders_of_leaves_err_less_than_with_hardware_samples_alone(make):
    scene = leaves(make)
    exact = render(scene, "reference:texture=linear", size=SIZE)
    for mode in ("linear", "trilinear", "anisotropic"):
        alone, covered = (
            render(scene, f"raster:texture={mode},{options}", size=SIZE).pixels for options in ("msaa=4", COVERAGE)
        )
        assert rmse(covered, exact.pixels) < 0.6 * rmse(alone, exact.pixels)


# Passes smooth borders by themselves: ramps a whole pixel wide in each of them made the error up to 2.5 times as large.
# Sub-pixels are small pixels, whose borders coverage smooths as it does those of pixels.
@pytest.mark.parametrize(("more", "factor"), [("passes=4", 1.1), ("passes=16", 1.1), ("ssaa=2", 0.75)])
def test_borders_are_not_blurred_twice_where_passes_smooth_them_too(make, more, factor):
    for scene, reference in (
        (leaves(make), "reference:texture=linear"),
        (SCENES["window-screens"].build(kind="cutouts", wires=20.0, tilt_deg=17.0), "reference:"),
    ):
        exact = render(scene, reference, size=SIZE).pixels
        alone, covered = (
            render(scene, f"raster:texture=trilinear,{options},{more}", size=SIZE).pixels
            for options in ("msaa=4", COVERAGE)
        )
        assert rmse(covered, exact) < factor * rmse(alone, exact)


@pytest.mark.parametrize("angle_deg", [0.0, 20.0, 45.0])
@pytest.mark.parametrize("cutoff", [0.3, 0.5, 0.8])
def test_a_straight_border_is_where_the_cutoff_is_whatever_the_slope(make, angle_deg, cutoff):
    # A ramp of alpha, with one border in it; where it wraps around is outside the picture.
    count = 64
    ramp = (np.arange(count) + 0.5) / count
    angle = np.radians(angle_deg)
    for steepness in (0.1, 1.0):
        alpha = np.clip((ramp - 0.5) * count / 8 * steepness + cutoff, 0.0, 1.0)
        across = (CORNERS[:, :2] @ [np.cos(angle), np.sin(angle)]) * 0.2 + 0.4993
        sheet = make.polygon(CORNERS, uv=np.stack([across, 0 * across], axis=1), texture="t")
        scene = make.scene(sheet, textures={"t": cut(alpha, cutoff)})
        pixels = render(scene, f"raster:texture=linear,{COVERAGE}", size=(64, 64)).pixels[..., 0]
        x, y = np.meshgrid((np.arange(64) + 0.5) / 32 - 1, 1 - (np.arange(64) + 0.5) / 32)
        # a pixel is 1/32 wide, and the border's ramp as wide as the pixel is across it
        distance = 32 * (x * np.cos(angle) + y * np.sin(angle) + (0.4993 - 0.5) / 0.2)
        ideal = np.clip(distance / (abs(np.cos(angle)) + abs(np.sin(angle))) + 0.5, 0.0, 1.0)
        # four samples: quarters, to the nearest, and rounding at their ends
        error = np.abs(pixels - ideal)
        # Where two triangles meet each has its own samples, place and alpha, which also spoils its neighbours' slopes.
        row, column = np.divmod(np.arange(64 * 64).reshape(64, 64), 64)
        seam = row // 2 + column // 2 == 31
        assert error[~seam].max() <= 1 / 8 + 0.02
        assert error[seam].max() < 0.5
        assert ((ideal > 0.01) & (ideal < 0.99))[~seam].sum() >= 24


def test_without_a_slope_alpha_decides_as_ever(make):
    for alpha, cutoff, present in ((0.5, 0.5, 1), (0.49, 0.5, 0), (0.0, 0.0, 1), (1.0, 1.0, 1), (0.0, 0.01, 0)):
        sheet = make.polygon(CORNERS * 2, uv=UNIT, texture="t")
        scene = make.scene(sheet, textures={"t": cut(np.full((4, 4), alpha), cutoff)})
        for mode in ("point", "linear", "mipmap", "trilinear", "anisotropic"):
            pixels = render(scene, f"raster:texture={mode},{COVERAGE}", size=(8, 8)).pixels
            np.testing.assert_array_equal(pixels, present)


@pytest.mark.parametrize("options", ["", ",passes=3", ",ssaa=2", ",passes=2,filter=gaussian"])
def test_pictures_without_cut_outs_stay_as_they_are_to_the_bit(make, options):
    translucent = dataclasses.replace(cut(np.random.default_rng(0).random((16, 16))), alpha_cutoff=None)
    sheet = make.polygon(CORNERS, uv=UNIT, texture="t")
    scenes = [make.star(), SCENES["brick-floor"].build(), make.scene(sheet, textures={"t": translucent})]
    for scene in scenes:
        for mode in ("point", "anisotropic"):
            alone, covered = (
                render(scene, f"raster:texture={mode},msaa=4{extra}{options}", size=(32, 24)).pixels
                for extra in ("", ",alpha_to_coverage=on")
            )
            assert alone.max() > 0.1
            np.testing.assert_array_equal(alone, covered)


def test_opaque_surfaces_among_cut_outs_keep_their_pixels(make):
    # the opaque half is drawn after and before the cut-out one
    left, right = CORNERS * (0.5, 1, 1) - (0.5, 0, 0), CORNERS * (0.5, 1, 1) + (0.5, 0, 0)
    holes = make.polygon(left, uv=UNIT, texture="t")
    textures = {"t": cut(np.random.default_rng(1).random((8, 8)))}
    plain = make.polygon(right[[0, 1, 3]], color=(0.3, 0.6, 0.9))
    for objects in ((holes, plain), (plain, holes)):
        scene = make.scene(*objects, textures=textures)
        alone, covered = (
            render(scene, f"raster:texture=linear,{o}", size=(64, 64)).pixels for o in ("msaa=4", COVERAGE)
        )
        np.testing.assert_array_equal(alone[:, 32:], covered[:, 32:])
        assert (alone[:, :32] != covered[:, :32]).any()


def test_the_color_does_not_depend_on_how_much_is_covered(make):
    # alpha is coverage and no factor: every value is a mix of the leaf's colour and what lies behind
    scene = leaves(make, color=(1.0, 0.5, 0.25))
    pixels = render(scene, f"raster:texture=trilinear,{COVERAGE}", size=SIZE).pixels
    share = pixels[..., :1]
    assert ((share > 0.1) & (share < 0.9)).sum() > 100
    np.testing.assert_array_equal(np.round(share * 4), share * 4)
    np.testing.assert_allclose(pixels, share * (1.0, 0.5, 0.25), atol=1e-6)


def test_far_cut_outs_are_decided_by_the_mean_alpha_of_a_level(make):
    # Levels average alpha: where a pixel holds many holes their mean is compared, and all or nothing is there.
    sheet = make.polygon(CORNERS * 2, uv=np.array(UNIT) * 400, texture="t")
    for share, present in ((0.25, 0.0), (0.75, 1.0)):
        alpha = np.zeros((4, 4))
        alpha.flat[: round(16 * share)] = 1.0
        scene = make.scene(sheet, textures={"t": cut(alpha)})
        for options in ("msaa=4", COVERAGE):
            pixels = render(scene, f"raster:texture=trilinear,{options}", size=(8, 8)).pixels
            np.testing.assert_array_equal(pixels, present)


def test_far_triangles_are_cut_out_alike(make, monkeypatch):
    # surfaces that reach far are drawn as pieces of their own
    scene = leaves(make)
    whole = render(scene, f"raster:texture=linear,{COVERAGE}", size=SIZE).pixels
    drawn = []
    real = pipeline.SceneBuffers._draw_pieces
    monkeypatch.setattr(pipeline.SceneBuffers, "_draw_pieces", lambda *a, **k: (drawn.append(1), real(*a, **k)))
    corners = 3e6 * (scene.objects[0].vertices - scene.objects[0].vertices.mean(axis=0))
    far = dataclasses.replace(
        scene.objects[0],
        vertices=corners + scene.objects[0].vertices.mean(axis=0),
        uv=3e6 * (scene.objects[0].uv - scene.objects[0].uv.mean(axis=0)) + scene.objects[0].uv.mean(axis=0),
    )
    pieces = render(dataclasses.replace(scene, objects=(far,)), f"raster:texture=linear,{COVERAGE}", size=SIZE).pixels
    assert drawn
    inside = np.s_[20:44, 20:60]
    assert (np.abs(pieces - whole)[inside] > 0.01).any(axis=-1).mean() < 0.1
    assert ((pieces[inside] > 0.01) & (pieces[inside] < 0.19)).any()


def test_it_needs_hardware_samples(make):
    with pytest.raises(InputError, match="alpha_to_coverage has no effect without msaa above 1"):
        render(make.star(), "raster:alpha_to_coverage=on", size=SIZE)
