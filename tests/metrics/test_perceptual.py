"""FLIP against the paper written out in float64, the rules of the display copies, and the contract on bad input."""

import math
import time
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import correlate

from aliasbench.metrics.catalog import measure
from aliasbench.metrics.gate import Signals, open_gate
from aliasbench.metrics.perceptual import Display, compute_flip, exposures, flip_map, tone_map

FloatArray = NDArray[np.float64]

# Andersson et al. 2020: equations of section 4, sRGB primaries and a white of equal parts.
TO_XYZ = np.array(
    [
        [10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794],
        [2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897],
        [1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382],
    ]
)
WHITE = TO_XYZ.sum(axis=1)
SPATIAL = (
    [(1.0, 0.0047)],
    [(1.0, 0.0053)],
    [(34.1, 0.04), (13.5, 0.025)],
)  # a, b of achromatic, red-green, blue-yellow
DENSITIES = (30.0, 67.0, 120.0)
N = 48


def hunt_lab(rgb: FloatArray) -> FloatArray:
    """L*a*b* with a* and b* scaled by L* / 100."""
    x = rgb @ TO_XYZ.T / WHITE
    f = np.where(x > (6 / 29) ** 3, np.cbrt(x), x / (3 * (6 / 29) ** 2) + 4 / 29)
    light = 116 * f[..., 1] - 16
    a, b = 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])
    return np.stack([light, 0.01 * light * a, 0.01 * light * b], axis=-1)


def colour_error(a: FloatArray, b: FloatArray) -> FloatArray:
    """HyAB to the power 0.7, mapped so that 0.4 of the largest comes to 0.95."""
    largest = 41.2760984  # of green and blue, see test_green_against_blue_is_the_largest_error
    difference = hunt_lab(a) - hunt_lab(b)
    q = (np.abs(difference[..., 0]) + np.hypot(difference[..., 1], difference[..., 2])) ** 0.7
    low, high = 0.95 * q / (0.4 * largest), 0.95 + 0.05 * (q - 0.4 * largest) / (0.6 * largest)
    out: FloatArray = np.where(q < 0.4 * largest, low, high)
    return out


def filtered(rgb: FloatArray, density: float) -> FloatArray:
    """What is left of a picture after the eye's contrast sensitivity, in two dimensions at once."""
    x = rgb @ TO_XYZ.T / WHITE
    opponent = (116 * x[..., 1] - 16, 500 * (x[..., 0] - x[..., 1]), 200 * (x[..., 1] - x[..., 2]))
    radius = math.ceil(3 * math.sqrt(0.04 / (2 * math.pi**2)) * density)
    k = np.arange(-radius, radius + 1) / density
    square = k[:, None] ** 2 + k**2
    seen = []
    for channel, terms in zip(opponent, SPATIAL, strict=True):
        kernel = sum(a * math.sqrt(math.pi / b) * np.exp(-(math.pi**2) * square / b) for a, b in terms)
        seen.append(correlate(channel, kernel / np.sum(kernel), mode="nearest"))
    y = (seen[0] + 16) / 116
    xyz = np.stack([y + seen[1] / 500, y, y - seen[2] / 200], axis=-1) * WHITE
    return np.clip(xyz @ np.linalg.inv(TO_XYZ).T, 0.0, 1.0)


def features(rgb: FloatArray, density: float) -> tuple[FloatArray, FloatArray]:
    """Strengths of edges and of points."""
    y = rgb @ TO_XYZ[1]
    sigma = 0.5 * 0.082 * density
    k = np.arange(-math.ceil(3 * sigma), math.ceil(3 * sigma) + 1.0)
    bell = np.exp(-(k[:, None] ** 2 + k**2) / (2 * sigma**2))
    strengths = []
    for kernel in (-k * bell, (k**2 / sigma**2 - 1) * bell):
        kernel = np.where(kernel > 0, kernel / kernel[kernel > 0].sum(), kernel / -kernel[kernel < 0].sum())
        strengths.append(np.hypot(*(correlate(y, w, mode="nearest") for w in (kernel, kernel.T))))
    return strengths[0], strengths[1]


def paper(test: FloatArray, reference: FloatArray, density: float) -> FloatArray:
    colour = colour_error(filtered(test, density), filtered(reference, density))
    pairs = zip(features(test, density), features(reference, density), strict=True)
    feature = np.sqrt(np.maximum(*(np.abs(a - b) for a, b in pairs)) / math.sqrt(2))
    out: FloatArray = colour ** (1 - feature)
    return out


def rounding(density: float) -> float:
    """How far a pixel of a float32 FLIP may be from the paper's.

    A feature filter has n taps in each direction and weights of 2 in all, on values up to 1: rounding adds up to
    4 n 2^-24 = d at most, so that the difference of two lengths of two such numbers, over sqrt 2, is off by 2 d, and
    its square root f by sqrt(2 d). The error c^(1 - f) changes by c |ln c| <= 1/e for each unit of that. Colours, good
    to 1e-6, add some 1e-5.
    """
    taps = 2 * math.ceil(3 * 0.5 * 0.082 * density) + 1
    return math.sqrt(2 * 4 * taps * 2.0**-24) / math.e + 1e-5


def scenes() -> dict[str, tuple[FloatArray, FloatArray]]:
    rng = np.random.default_rng(5)
    y, x = np.mgrid[:N, :N] / N
    smooth = np.stack([x, y, 1 - x], axis=-1)
    edge = 0.3 * x + 0.41 - y
    sharp, soft = (np.repeat(a[..., None], 3, axis=-1) for a in (np.float64(edge > 0), np.clip(N * edge, 0, 1)))
    stripes = np.zeros((N, N, 3))
    stripes[..., 1] = np.sin(30 * x) > 0
    stripes[..., 2] = 1 - stripes[..., 1]
    return {
        "noise": (np.clip(smooth + 0.1 * rng.normal(size=smooth.shape), 0, 1), smooth),
        "unlike": (rng.uniform(size=smooth.shape), rng.uniform(size=smooth.shape)),
        "stairsteps": (sharp, soft),
        "chroma": (np.roll(stripes, 1, axis=1), stripes),
        "dark": (0.0011 * smooth, 0.001 * smooth),
        "white on black": (np.ones((N, N, 3)), np.zeros((N, N, 3))),
    }


@pytest.fixture
def scene(make_scene):
    return make_scene((N, N))


def frames(picture: FloatArray) -> FloatArray:
    return picture[None]


@pytest.mark.parametrize("density", DENSITIES)
@pytest.mark.parametrize("kind", scenes())
def test_flip_is_the_papers(kind, density):
    test, reference = scenes()[kind]
    got, expected = flip_map(test, reference, pixels_per_degree=density), paper(test, reference, density)
    print(
        f"{kind}, {density:g} ppd: mean {got.mean():.6f}, paper {expected.mean():.6f}, {abs(got - expected).max():.1e}"
    )
    assert expected.mean() > 4 * rounding(density)
    assert got == pytest.approx(expected, abs=rounding(density))


def test_green_against_blue_is_the_largest_error(scene):
    green, blue = (np.full((1, N, N, 3), np.eye(3)[k]) for k in (1, 2))
    difference = hunt_lab(green[0, 0, 0]) - hunt_lab(blue[0, 0, 0])
    assert (abs(difference[0]) + math.hypot(*difference[1:])) ** 0.7 == pytest.approx(41.2760984, abs=1e-6)
    assert measure("flip", green, blue, scene=scene).value == pytest.approx(1.0, abs=1e-6)


def test_white_on_black_is_not_the_largest_error(scene):
    # L* = 100 on 0 and no edges: 100^0.7 = 25.1189 of 41.2760, on the upper branch.
    expected = 0.95 + 0.05 * (100**0.7 - 0.4 * 41.2760984) / (0.6 * 41.2760984)
    assert expected == pytest.approx(0.967380, abs=1e-6)
    got = measure("flip", np.ones((1, N, N, 3)), np.zeros((1, N, N, 3)), scene=scene).value
    print(f"white on black {got:.7f}; in real numbers {expected:.7f}")
    assert got == pytest.approx(expected, abs=rounding(67.1))


@pytest.mark.parametrize("kind", scenes())
def test_equal_pictures_have_no_error_and_others_some_below_one(scene, kind):
    test, reference = (frames(p) for p in scenes()[kind])
    assert measure("flip", reference, reference, scene=scene).value == 0.0
    score = measure("flip", test, reference, scene=scene)
    assert score.status == "ok"
    assert score.value is not None
    assert 0.0 < score.value < 1.0
    assert score.extras["worst"]["value"] >= score.value


@pytest.mark.parametrize("kind", ["noise", "stairsteps", "chroma"])
def test_a_mirrored_or_transposed_picture_has_the_mirrored_or_transposed_error(kind):
    test, reference = scenes()[kind]
    plain = flip_map(test, reference, pixels_per_degree=67.0)
    for turn in (np.flipud, np.fliplr, lambda a: np.swapaxes(a, 0, 1)):
        turned = flip_map(turn(test), turn(reference), pixels_per_degree=67.0)
        assert turned == pytest.approx(turn(plain), abs=2 * rounding(67.0))


@pytest.mark.parametrize("level", [0.9, 4.0])
def test_more_noise_is_a_greater_error(scene, level):
    rng = np.random.default_rng(2)
    truth = level * frames(scenes()["noise"][1])
    noise = rng.normal(size=truth.shape)
    values = [measure("flip", truth + s * noise, truth, scene=scene).value or 0.0 for s in (0.0, 0.01, 0.03, 0.1, 0.3)]
    assert values[0] == 0.0
    assert all(b > 1.2 * a for a, b in pairwise(values))
    assert values[-1] > 0.0


def test_noise_is_seen_less_from_farther_away(scene):
    test, reference = (frames(p) for p in scenes()["noise"])
    signals = open_gate(test, reference, scene=scene)
    assert isinstance(signals, Signals)
    near, far = (compute_flip(signals, display=Display(pixels_per_degree=d)) for d in (30.0, 90.0))
    assert float(near.value or 0) > 1.5 * float(far.value or 0)
    assert (near.extras["pixels_per_degree"], far.extras["pixels_per_degree"]) == (30.0, 90.0)


@pytest.mark.parametrize("bad", [{"pixels_per_degree": 0.0}, {"peak_cd_m2": math.nan}, {"ambient_lux": -1.0}])
def test_a_display_that_cannot_be_is_refused(bad):
    (name,) = bad
    with pytest.raises(ValueError, match=rf"{name} = .*: must be finite and positive"):
        Display(**bad)


def test_the_first_middle_and_last_frame_of_every_seed_are_measured_and_the_worst_place_is_named(make_scene):
    scene = make_scene((30, 26))
    rng = np.random.default_rng(3)
    truth = rng.uniform(0.2, 0.8, size=(7, 26, 30, 3))
    test = np.stack([truth] * 2)
    test[:, 1] = 0.0  # not a key frame
    test[1, 3, 17:20, 8:11] = 1.0
    test[0, 6, 5, 5] = 0.9
    score = measure("flip", test, truth, scene=scene, filter_radius_px=1.5, frame_start=40)
    assert score.extras["frames"] == [40, 43, 46]
    inside = (slice(2, -2), slice(2, -2))
    maps = [
        flip_map(test[s, k][inside], truth[k][inside], pixels_per_degree=3840 * math.pi / 180)
        for s in (0, 1)
        for k in (0, 3, 6)
    ]
    assert score.value == pytest.approx(np.mean(maps), rel=1e-12)
    worst = score.extras["worst"]
    assert (worst["seed"], worst["frame"]) == (1, 43)
    assert abs(worst["row"] - 18) <= 2
    assert abs(worst["column"] - 9) <= 2
    assert worst["value"] == np.max(maps)


@pytest.mark.parametrize("factor", [1.0, 5.0])
@pytest.mark.parametrize("contrast", [0.01, 3.0, 1e200])
def test_exposure_changes_nothing(make_scene, factor, contrast):
    test, reference = (factor * frames(p) for p in scenes()["noise"])
    plain = measure("flip", test, reference, scene=make_scene((N, N)))
    other = measure("flip", contrast * test, contrast * reference, scene=make_scene((N, N), contrast=contrast))
    # Products are off by an ulp of float64, which changes about one in 10^8 of the float32 they are rounded to.
    assert other.value == pytest.approx(plain.value, abs=1e-7)
    assert other.extras["mode"] == plain.extras["mode"] == ("HDR" if factor > 1 else "LDR")


def test_pixels_that_no_display_shows_are_clamped_and_counted(scene):
    reference = np.full((1, N, N, 3), 0.5)
    test = reference.copy()
    test[0, 10, 10, 0] = -0.5
    test[0, 20, 20:23, 2] = 7.0
    test[0, 0, 0] = 9.0  # cut off with the border
    score = measure("flip", test, reference, scene=scene)
    clamped = measure("flip", np.clip(test, 0, 1), reference, scene=scene)
    assert score.value == clamped.value
    assert float(score.value or 0) > 0.0
    assert (score.extras["negative_pixels"], score.extras["pixels_above_white"]) == (1, 3)
    assert (clamped.extras["negative_pixels"], clamped.extras["pixels_above_white"]) == (0, 0)


def test_twice_white_instead_of_white_is_not_passed_over_in_silence(scene):
    white = np.ones((1, N, N, 3))
    over = measure("flip", 2 * white, white, scene=scene)
    assert over.extras["pixels_above_white"] == (N - 2) ** 2
    under = measure("flip", white, 2 * white, scene=scene)
    assert under.extras["mode"] == "HDR"
    assert float(under.value or 0) > 0.1


def test_lobes_of_a_filter_do_not_make_a_picture_hdr(scene):
    reference = np.full((1, N, N, 3), 0.5)
    reference[0, 8:12] = 1.42
    score = measure("flip", reference, reference, scene=scene)
    assert (score.extras["mode"], score.extras["reference_pixels_above_white"]) == ("LDR", 4 * (N - 2))
    reference[0, 8:12] = 1.6
    assert measure("flip", reference, reference, scene=scene).extras["mode"] == "HDR"


def test_the_curve_is_the_one_of_aces():
    # Narkowicz 2015: x (2.51 x + 0.03) / (x (2.43 x + 0.59) + 0.14), at 0.6 x.
    x = np.array([0.0, 0.18, 1.0, 3.0, 1e15])
    y = 0.6 * x
    assert tone_map(x, 0.0) == pytest.approx(np.minimum(y * (2.51 * y + 0.03) / (y * (2.43 * y + 0.59) + 0.14), 1.0))
    assert tone_map(x / 8, 3.0) == pytest.approx(tone_map(x, 0.0))


@pytest.mark.parametrize(("brightest", "count"), [(2.0, 4), (40.0, 8), (1e9, 12)])
def test_exposures_go_from_the_brightest_pixel_to_middle_grey(brightest, count):
    picture = np.zeros((9, 9, 3))
    picture[4, 4, 2] = brightest
    stops = exposures([picture])
    assert len(stops) == count
    assert np.diff(stops) == pytest.approx(np.full(count - 1, np.diff(stops)[0]))
    for level, stop in ((brightest, stops[0]), (0.18, stops[-1])):
        assert tone_map(np.array([level]), stop)[0] == pytest.approx(0.85, abs=1e-12)


def test_hdr_is_the_largest_of_ldr_over_the_exposures_and_openimageios_own():
    import OpenImageIO as oiio

    rng = np.random.default_rng(8)
    reference = 4.0 * rng.uniform(size=(N, N, 3)) ** 12  # a median below middle grey, which is then taken instead
    test = np.abs(reference + 0.05 * rng.normal(size=reference.shape))
    stops = exposures([reference])
    expected = np.max([paper(tone_map(test, e), tone_map(reference, e), 67.0) for e in stops], axis=0)
    buffers = [oiio.ImageBuf(p.astype(np.float32)) for p in (reference, test)]
    theirs = oiio.ImageBufAlgo.FLIP_diff(
        *buffers, hdr=1, ppd=67.0, maxluminance=float(reference.max()), medianluminance=0.18
    ).get_pixels(oiio.FLOAT)[..., 0]
    ours = np.max([flip_map(tone_map(test, e), tone_map(reference, e), pixels_per_degree=67.0) for e in stops], axis=0)
    assert len(stops) > 2
    assert ours == pytest.approx(expected, abs=rounding(67.0))
    assert theirs == pytest.approx(ours, abs=2 * rounding(67.0))


@pytest.mark.parametrize("name", ["flip", "cvvdp"])
def test_one_nan_is_reported_whatever_the_reference(scene, name):
    test = np.zeros((1, N, N, 3))
    for bad in (test.copy(), np.full_like(test, math.nan)):
        bad[0, 7, 9, 1] = math.nan
        score = measure(name, bad, np.zeros_like(test), scene=scene)
        assert (score.value, score.status) == (None, "nonfinite")
    with pytest.raises(ValueError, match=r"test: shape .*; must be the reference's"):
        measure(name, np.zeros((1, N, N + 1, 3)), test, scene=scene)
    with pytest.raises(ValueError, match="reference: 1 values are not finite"):
        measure(name, test, np.where(np.arange(test.size).reshape(test.shape) == 5, math.inf, test), scene=scene)


@pytest.mark.parametrize("level", [0.5, 3.0, 1e30, 1e300])
def test_a_black_reference_is_compared_with_whatever_there_is(scene, level):
    black = np.zeros((1, N, N, 3))
    score = measure("flip", np.full_like(black, level), black, scene=scene)
    assert score.status == "ok"
    assert 0.5 < float(score.value or 0) < 1.0
    assert measure("flip", black, black, scene=scene).value == 0.0
    assert measure("flip", black, np.full_like(black, level), scene=scene).value == pytest.approx(
        float(score.value or 0), abs=0.2
    )


@pytest.mark.parametrize("size", [(3, 3), (4, 11), (90, 3)])
def test_small_and_narrow_pictures_have_scores_too(make_scene, size):
    rng = np.random.default_rng(0)
    test, reference = rng.uniform(size=(2, 1, size[1], size[0], 3))
    assert 0.0 < float(measure("flip", test, reference, scene=make_scene(size)).value or 0) < 1.0


@pytest.mark.parametrize("level", [0.0, 0.3, 1.0])
def test_a_score_that_the_references_own_error_may_cause_is_none(scene, level):
    reference = np.full((1, N, N, 3), level)
    shift = 0.02 if level < 0.5 else -0.02
    test = reference + shift
    causes = measure("flip", test, reference, scene=scene)
    # Errors grow as shifts to the power 0.7: a twentieth of the shift causes less than a third of the error.
    assert measure("flip", test, reference, scene=scene, reference_uncertainty=0.001) == causes
    hidden = measure("flip", test, reference, scene=scene, reference_uncertainty=0.02)
    assert (hidden.value, hidden.status) == (None, "below_reference_floor")
    assert hidden.extras["floor"] == pytest.approx(3 * float(causes.value or 0), rel=1e-4)
    assert hidden.extras["measured"] == causes.value


def test_a_key_frame_takes_less_than_a_second(make_scene):
    rng = np.random.default_rng(0)
    test, reference = rng.uniform(size=(2, 1, 512, 512, 3))
    scene = make_scene((512, 512))
    measure("flip", test[:, :32, :32], reference[:, :32, :32], scene=scene)
    start = time.process_time()
    measure("flip", test, reference, scene=scene)
    seconds = time.process_time() - start
    print(f"FLIP of a frame of 512 x 512: {seconds:.2f} s of processor time")
    # 0.2 s where this was written; ten times that would make a run of key frames slower than their rendering.
    assert seconds < 2.0
